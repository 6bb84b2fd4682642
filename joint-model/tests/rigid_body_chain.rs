//! What a chain accepts and how it names what it does not.

use joint_model::rigid_body::{Chain, ChainError, JointKind, LINKS_MAX, Link};
use nalgebra::{
    Isometry3, Matrix3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};

const GRAVITY_M_S2: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn pendulum() -> Link {
    Link {
        parent: None,
        kind: JointKind::Revolute,
        origin: Isometry3::identity(),
        axis: Vector3::y_axis(),
        mass_kg: 2.0,
        centre_of_mass_m: Vector3::new(0.0, 0.0, -0.5),
        inertia_kg_m2: Matrix3::from_diagonal(&Vector3::new(0.02, 0.02, 0.004)),
    }
}

/// Builds a pendulum that carries `link`.
fn build(mut link: Link) -> Result<Chain, ChainError> {
    link.parent = Some(0);
    Chain::new(&[pendulum(), link], GRAVITY_M_S2, Isometry3::identity())
}

fn inertia(inertia_kg_m2: Matrix3<f64>) -> Result<Chain, ChainError> {
    build(Link {
        inertia_kg_m2,
        ..pendulum()
    })
}

fn moments(xx: f64, yy: f64, zz: f64) -> Matrix3<f64> {
    Matrix3::from_diagonal(&Vector3::new(xx, yy, zz))
}

#[test]
fn a_pendulum_hangs_swings_and_falls_as_it_must() {
    let chain = Chain::new(
        &[pendulum()],
        GRAVITY_M_S2,
        Translation3::new(0.0, 0.0, -1.0).into(),
    )
    .unwrap();
    let (angle_rad, weight_n, inertia_kg_m2) = (0.3_f64, 2.0 * 9.81, 0.02 + 2.0 * 0.5 * 0.5);
    // Turning +y onto the hanging centre moves it towards -x, so the weight pulls back, negatively about y.
    let holding_nm = weight_n * 0.5 * angle_rad.sin();
    let mut result = [0.0];
    chain.gravity_torque(&[angle_rad], &mut result);
    assert!((result[0] - holding_nm).abs() < 1e-14, "{result:?}");
    chain.inverse_dynamics(&[angle_rad], &[5.0], &[2.0], &mut result);
    assert!(
        (result[0] - holding_nm - 2.0 * inertia_kg_m2).abs() < 1e-14,
        "{result:?}"
    );
    chain.forward_dynamics(&[angle_rad], &[5.0], &[0.0], &mut result);
    assert!(
        (result[0] + holding_nm / inertia_kg_m2).abs() < 1e-13,
        "{result:?}"
    );
    let tool_m = chain.tool_pose(&[angle_rad]).translation.vector;
    assert!(
        (tool_m - Vector3::new(-angle_rad.sin(), 0.0, -angle_rad.cos())).amax() < 1e-15,
        "{tool_m}"
    );
    assert!(
        (chain.potential_energy_j(&[angle_rad]) + weight_n * 0.5 * angle_rad.cos()).abs() < 1e-14
    );
}

#[test]
fn a_joint_turns_its_frame_about_its_axis_even_next_to_z() {
    let origin = Isometry3::new(Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.4, 1.5, -0.6));
    let tilts = [[0.0, 0.0], [1e-8, 0.0], [0.0, -1e-5], [0.3, 2.0]];
    for (tilt, z) in tilts
        .into_iter()
        .flat_map(|tilt| [(tilt, 1.0), (tilt, -1.0)])
    {
        let axis = Unit::new_normalize(Vector3::new(tilt[0], tilt[1], z));
        let chain = build(Link {
            origin,
            axis,
            ..pendulum()
        })
        .unwrap();
        let found = chain.joint_frame(&[0.7, 2.5], 1);
        let turned_base = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.7);
        let expected = turned_base * origin * UnitQuaternion::from_axis_angle(&axis, 2.5);
        let error = (found.to_homogeneous() - expected.to_homogeneous()).amax();
        assert!(error < 1e-15, "{axis:?}: {error:e}");
    }
}

#[test]
fn longer_slices_are_read_and_written_up_to_the_last_joint() {
    let chain = Chain::new(&[pendulum()], GRAVITY_M_S2, Isometry3::identity()).unwrap();
    let mut torque_nm = [0.0, 7.0];
    chain.inverse_dynamics(&[0.1, f64::NAN], &[0.0; 2], &[0.0; 2], &mut torque_nm);
    assert!(torque_nm[0].is_finite());
    assert_eq!(torque_nm[1], 7.0);
}

#[test]
#[should_panic(expected = "a chain of 2 joints was given slices of [2, 1] values")]
fn a_short_slice_is_a_programming_error() {
    build(pendulum())
        .unwrap()
        .gravity_torque(&[0.0, 0.0], &mut [0.0]);
}

#[test]
fn no_links_and_too_many_links_are_refused() {
    for count in [0, LINKS_MAX + 1] {
        let error = Chain::new(
            &vec![pendulum(); count],
            GRAVITY_M_S2,
            Isometry3::identity(),
        )
        .unwrap_err();
        assert_eq!(error, ChainError::JointCount { found: count });
    }
    assert!(
        Chain::new(
            &[pendulum(); LINKS_MAX],
            GRAVITY_M_S2,
            Isometry3::identity()
        )
        .is_ok()
    );
}

#[test]
fn a_link_hangs_on_one_before_it() {
    for parent in [1, 7] {
        let link = Link {
            parent: Some(parent),
            ..pendulum()
        };
        let error =
            Chain::new(&[pendulum(), link], GRAVITY_M_S2, Isometry3::identity()).unwrap_err();
        assert_eq!(error, ChainError::Parent { link: 1, parent });
    }
}

#[test]
fn a_mass_is_finite_and_not_negative() {
    assert!(
        build(Link {
            mass_kg: 0.0,
            ..pendulum()
        })
        .is_ok()
    );
    for mass_kg in [-1e-9, f64::NAN, f64::INFINITY] {
        let error = build(Link {
            mass_kg,
            ..pendulum()
        })
        .unwrap_err();
        assert!(
            matches!(error, ChainError::Mass { link: 1, .. }),
            "{mass_kg}: {error}"
        );
    }
    let error = build(Link {
        mass_kg: -3.0,
        ..pendulum()
    })
    .unwrap_err();
    assert_eq!(
        error.to_string(),
        "link 1: a mass is at least 0 kg, not -3 kg"
    );
}

#[test]
fn an_inertia_belongs_to_a_body() {
    let asymmetric = Matrix3::new(1.0, 0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let refused = [
        asymmetric,
        moments(-0.01, 1.0, 1.0),
        moments(1.0, 1.0, 2.1), // larger than the sum of the others
        moments(0.0, 0.0, 1e-9),
        moments(1.0, f64::NAN, 1.0),
        moments(1.0, 1.0, f64::INFINITY),
        // Positive on the diagonal, but with a negative principal moment.
        Matrix3::new(1.0, 1.5, 0.0, 1.5, 1.0, 0.0, 0.0, 0.0, 2.0),
    ];
    for inertia_kg_m2 in refused {
        assert_eq!(
            inertia(inertia_kg_m2).unwrap_err(),
            ChainError::Inertia { link: 1 },
            "{inertia_kg_m2}"
        );
    }
}

#[test]
fn points_rods_and_rounded_discs_are_bodies() {
    assert!(inertia(Matrix3::zeros()).is_ok());
    let rod = moments(0.3, 0.3, 0.0);
    assert!(inertia(1e-310 * rod).is_ok());
    let turn = Rotation3::from_euler_angles(0.3, 1.1, -2.0);
    assert!(inertia(rod).is_ok());
    assert!(inertia(turn.matrix() * rod * turn.matrix().transpose()).is_ok());
    // A disc of zz = 0.0024694, written with four significant digits.
    assert!(inertia(moments(0.001234, 0.001234, 0.002469)).is_ok());
}

#[test]
fn frames_axes_and_centres_are_finite_and_directions_of_unit_length() {
    let nan = Vector3::new(0.0, f64::NAN, 0.0);
    let broken_turn = UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
    let stretched = UnitQuaternion::new_unchecked(Quaternion::new(1.1, 0.0, 0.0, 0.0));
    let refused = [
        Link {
            origin: Translation3::from(nan).into(),
            ..pendulum()
        },
        Link {
            origin: Isometry3::from_parts(Translation3::identity(), broken_turn),
            ..pendulum()
        },
        Link {
            origin: Isometry3::from_parts(Translation3::identity(), stretched),
            ..pendulum()
        },
        Link {
            axis: Unit::new_unchecked(nan),
            ..pendulum()
        },
        Link {
            axis: Unit::new_unchecked(Vector3::zeros()),
            ..pendulum()
        },
        Link {
            axis: Unit::new_unchecked(Vector3::new(0.0, 2.0, 0.0)),
            ..pendulum()
        },
        Link {
            centre_of_mass_m: nan,
            ..pendulum()
        },
    ];
    for link in refused {
        assert_eq!(
            build(link).unwrap_err(),
            ChainError::Geometry { link: 1 },
            "{link:?}"
        );
    }
}

#[test]
fn gravity_and_tool_are_finite() {
    let nan = Vector3::new(0.0, f64::NAN, 0.0);
    let gravity = Chain::new(&[pendulum()], nan, Isometry3::identity()).unwrap_err();
    assert!(matches!(gravity, ChainError::Gravity { .. }), "{gravity}");
    let tool = Chain::new(&[pendulum()], GRAVITY_M_S2, Translation3::from(nan).into()).unwrap_err();
    assert_eq!(tool, ChainError::Tool);
}

#[test]
fn gravity_that_is_refused_changes_nothing() {
    let mut chain = build(pendulum()).unwrap();
    assert!(chain.set_gravity(Vector3::repeat(f64::INFINITY)).is_err());
    assert_eq!(chain.gravity_m_s2(), GRAVITY_M_S2);
    chain.set_gravity(Vector3::zeros()).unwrap();
    let mut torque_nm = [1.0; 2];
    chain.gravity_torque(&[0.4, 0.4], &mut torque_nm);
    assert_eq!(torque_nm, [0.0; 2]);
}

#[test]
fn gravity_across_an_axis_is_what_a_weight_can_make_its_joint_feel() {
    // the first axis is vertical, the second lies at an angle to it that the first joint does not change
    let tilt_rad = 0.3_f64;
    let upright = Link {
        axis: Vector3::z_axis(),
        ..pendulum()
    };
    let tilted = Link {
        parent: Some(0),
        origin: Isometry3::rotation(Vector3::x() * tilt_rad),
        ..upright
    };
    let sliding = Link {
        parent: Some(1),
        kind: JointKind::Prismatic,
        axis: Vector3::x_axis(),
        ..upright
    };
    let links = [upright, tilted, sliding];
    let chain = Chain::new(&links, GRAVITY_M_S2, Isometry3::identity()).unwrap();
    for pose_rad in [[0.0, 0.0, 0.0], [1.1, -0.4, 0.2]] {
        let across = |joint: usize| chain.gravity_across_axis(&pose_rad, joint);
        assert!(across(0) < 1e-12);
        assert!((across(1) - tilt_rad.sin()).abs() < 1e-12);
        // what slides weighs the same wherever it is
        assert_eq!(across(2), 0.0);
    }
    let floating = Chain::new(&links, Vector3::zeros(), Isometry3::identity()).unwrap();
    assert_eq!(floating.gravity_across_axis(&[0.0; 3], 1), 0.0);
}
