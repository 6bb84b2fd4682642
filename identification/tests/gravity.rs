//! Masses and centres from synthetic slow motion whose arm is known.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod slow_sweeps;

use identification::gravity::{GravityFit, Quantity, SlowPoses, fit_gravity};
use identification::{IdentificationError, Payload, Sweep};
use joint_model::rigid_body::{Chain, Link};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use rand_core::SeedableRng;
use rand_pcg::Pcg64;
use recording::{Recording, Signal};
use robot::{Robot, RobotFile, Source};
use slow_sweeps::{Noise, Plant, path_rad};

/// Two parallel axes across gravity, or the first along it.
fn two_links(first_axis: &str) -> Robot {
    let joint = |name: &str| {
        format!(
            "[[joint]]\nname = \"{name}\"\ngear_ratio = 100.0\nrotor_inertia_kg_m2 = 1e-5\n\
             effects = [{{ effect = \"coulomb_friction\", coulomb_nm = 5.0 }}]\n"
        )
    };
    let link = |name: &str, axis: &str, x_m: f64, mass_kg: f64| {
        format!(
            "[[link]]\njoint = \"{name}\"\norigin_m = [{x_m}, 0.0, 0.0]\naxis = {axis}\nmass_kg = {mass_kg}\n\
             centre_of_mass_m = [0.2, 0.0, 0.0]\ninertia_kg_m2 = {{ xx = 0.01, yy = 0.01, zz = 0.01 }}\n"
        )
    };
    let text = [
        "name = \"two\"\nparameter_tolerance = 0.1\n".to_owned(),
        link("shoulder", first_axis, 0.0, 3.0),
        link("elbow", "[0.0, 1.0, 0.0]", 0.4, 2.0),
        joint("shoulder"),
        joint("elbow"),
    ]
    .concat();
    let file = RobotFile::parse(&text, "two").unwrap();
    file.build(Source::Shipped("two")).unwrap()
}

/// Links with masses and centres moved at random by some percent of mass and of 0.3 m.
fn deviating(robot: &Robot, share: f64, seed: u64) -> Chain {
    let mut noise = Noise(Pcg64::seed_from_u64(seed));
    let deviate = |link: &Link| {
        let mut link = *link;
        link.mass_kg *= 1.0 + share * noise.normal();
        let away = Vector3::new(noise.normal(), noise.normal(), noise.normal());
        link.centre_of_mass_m += away * (share * 0.3);
        link
    };
    let links: Vec<Link> = robot.chain.links().iter().map(deviate).collect();
    Chain::new(&links, robot.chain.gravity_m_s2(), Isometry3::identity()).unwrap()
}

/// Straight lines between random poses, forth and back.
fn wander(robot: &Robot, poses: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut noise = Noise(Pcg64::seed_from_u64(seed));
    let count = robot.joints.len();
    let pose = |_| (0..count).map(|_| 3.0 * noise.uniform() - 1.5).collect();
    let forth: Vec<Vec<f64>> = (0..poses).map(pose).collect();
    let back = forth.iter().rev().skip(1).cloned();
    let stops: Vec<Vec<f64>> = forth.iter().cloned().chain(back).collect();
    path_rad(&stops, 0.15)
}

fn record(robot: &Robot, chain: &Chain, noise_nm: f64, path_rad: &[Vec<f64>]) -> Recording {
    let mut plant = Plant::of(robot, noise_nm);
    plant.chain = chain.clone();
    plant.record(path_rad, 7)
}

/// Root mean square of the difference of two arms' gravity torques at poses that nobody recorded.
fn difference_nm(a: &Chain, b: &Chain) -> f64 {
    let mut noise = Noise(Pcg64::seed_from_u64(99));
    let count = a.joint_count();
    let (mut a_nm, mut b_nm) = (vec![0.0; count], vec![0.0; count]);
    let mut sum = 0.0;
    for _ in 0..200 {
        let pose_rad: Vec<f64> = (0..count).map(|_| 3.0 * noise.uniform() - 1.5).collect();
        a.gravity_torque(&pose_rad, &mut a_nm);
        b.gravity_torque(&pose_rad, &mut b_nm);
        sum += a_nm
            .iter()
            .zip(&b_nm)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f64>();
    }
    (sum / (200 * count) as f64).sqrt()
}

/// Without payload.
fn fit(recordings: &[&Recording], robot: &Robot) -> Result<GravityFit, IdentificationError> {
    let poses = |recording: &&Recording| {
        let payload = Payload::default();
        SlowPoses::of(&Sweep { recording, payload }, robot)
    };
    let slow = recordings
        .iter()
        .map(poses)
        .collect::<Result<Vec<_>, _>>()?;
    fit_gravity(&slow, robot)
}

fn words(fit: &GravityFit) -> Vec<&str> {
    fit.identifiable
        .iter()
        .map(|sum| sum.words.as_str())
        .collect()
}

#[test]
fn a_planar_arm_shows_four_sums_known_by_hand() {
    let robot = two_links("[0.0, 1.0, 0.0]");
    let truth = deviating(&robot, 0.05, 1);
    let recording = record(&robot, &truth, 0.1, &wander(&robot, 30, 2));
    let fit = fit(&[&recording], &robot).unwrap();
    assert_eq!(
        words(&fit),
        [
            "m·c_x of shoulder + 0.4·m of elbow",
            "m·c_z of shoulder",
            "m·c_x of elbow",
            "m·c_z of elbow",
        ]
    );
    let [first, second] = truth.links() else {
        panic!("two links")
    };
    let (h1, h2) = (
        first.centre_of_mass_m * first.mass_kg,
        second.centre_of_mass_m * second.mass_kg,
    );
    let by_hand = [h1.x + 0.4 * second.mass_kg, h1.z, h2.x, h2.z];
    for (sum, truth) in fit.identifiable.iter().zip(by_hand) {
        let errors = (sum.fitted.value - truth).abs() / sum.fitted.standard_error;
        assert!(errors < 4.0, "{sum:?} instead of {truth}");
        assert!(sum.fitted.standard_error < 0.02, "{sum:?}");
        assert_eq!(sum.unit, "kg m");
    }
    // m·c_y of both, the first mass, and the second mass against the first link's moment.
    assert_eq!(fit.unseen.len(), 4);
    let against = fit
        .unseen
        .iter()
        .find(|direction| direction.terms.len() == 2)
        .unwrap();
    assert_eq!(
        against.words,
        "m of elbow +1 kg with m·c_x of shoulder -0.4 kg m"
    );
    assert_eq!(against.terms[0].quantity, Quantity::Mass);
}

#[test]
fn an_axis_along_gravity_sees_nothing() {
    let robot = two_links("[0.0, 0.0, 1.0]");
    let recording = record(
        &robot,
        &deviating(&robot, 0.05, 1),
        0.1,
        &wander(&robot, 30, 2),
    );
    let fit = fit(&[&recording], &robot).unwrap();
    assert_eq!(words(&fit), ["m·c_x of elbow", "m·c_z of elbow"]);
    let [shoulder, elbow] = fit.links.as_slice() else {
        panic!("two links")
    };
    // What nobody saw stays, known as well as the file says.
    assert!((shoulder.mass_kg.value - 3.0).abs() < 1e-9);
    assert!((shoulder.mass_kg.standard_error - 0.3).abs() < 1e-9);
    assert_eq!(shoulder.file_centre_of_mass_m, [0.2, 0.0, 0.0]);
    assert!((shoulder.centre_of_mass_m[0].value - 0.2).abs() < 1e-9);
    assert!(elbow.first_moment_kg_m[0].standard_error < 0.02);
}

#[test]
fn a_seven_joint_arm_is_found_as_far_as_its_torques_show() {
    let robot = robot::load("pa10").unwrap();
    let truth = deviating(&robot, 0.05, 3);
    let recording = record(&robot, &truth, 0.3, &wander(&robot, 25, 4));
    let fit = fit(&[&recording], &robot).unwrap();
    let before_nm = difference_nm(&robot.chain, &truth);
    let after_nm = difference_nm(&fit.chain(&robot).unwrap(), &truth);
    assert!(
        after_nm < 0.1 * before_nm,
        "{before_nm} Nm before, {after_nm} Nm after"
    );
    for joint in &fit.joints {
        assert!(joint.fitted_rms_nm <= joint.file_rms_nm + 1e-9);
        assert!(
            joint.held_out_rms_nm < 1.3 * joint.fitted_rms_nm,
            "{}",
            joint.joint
        );
        assert_eq!(joint.measured_nm.len(), joint.position_rad.len());
    }
    assert_eq!(fit.rank() + fit.unseen.len(), 28);
    // The base turns about gravity, so nothing of its own link is seen.
    assert!(
        fit.identifiable
            .iter()
            .all(|sum| sum.terms.iter().all(|term| term.joint != "joint1"))
    );
}

#[test]
fn a_chain_in_other_frames_tells_the_same_torques() {
    let robot = robot::load("pa10").unwrap();
    let truth = deviating(&robot, 0.05, 3);
    // Every link's frame turned; the arm is the same.
    let turn = UnitQuaternion::from_euler_angles(0.7, -0.4, 1.9);
    let turned = |chain: &Chain| {
        let links: Vec<Link> = chain
            .links()
            .iter()
            .enumerate()
            .map(|(index, link)| {
                let mut origin = link.origin;
                if index > 0 {
                    origin = Isometry3::from_parts(
                        (turn.inverse() * origin.translation.vector).into(),
                        turn.inverse() * origin.rotation,
                    );
                }
                origin.rotation *= turn;
                let matrix = turn.to_rotation_matrix();
                Link {
                    origin,
                    axis: turn.inverse() * link.axis,
                    centre_of_mass_m: turn.inverse() * link.centre_of_mass_m,
                    inertia_kg_m2: matrix.transpose() * link.inertia_kg_m2 * matrix,
                    ..*link
                }
            })
            .collect();
        Chain::new(&links, chain.gravity_m_s2(), Isometry3::identity()).unwrap()
    };
    let recording = record(&robot, &truth, 0.3, &wander(&robot, 12, 4));
    let straight = fit(&[&recording], &robot).unwrap();
    let mut robot_turned = robot.clone();
    robot_turned.chain = turned(&robot.chain);
    assert!(difference_nm(&robot.chain, &robot_turned.chain) < 1e-9);
    let other = fit(&[&recording], &robot_turned).unwrap();
    assert_eq!(other.rank(), straight.rank());
    let apart_nm = difference_nm(
        &straight.chain(&robot).unwrap(),
        &other.chain(&robot_turned).unwrap(),
    );
    assert!(apart_nm < 1e-6, "{apart_nm}");
}

#[test]
fn without_noise_the_torques_are_reproduced_and_applied_links_make_them() {
    let robot = two_links("[0.0, 1.0, 0.0]");
    let truth = deviating(&robot, 0.05, 5);
    let path = wander(&robot, 30, 6);
    let (front, back) = path.split_at(path.len() / 2);
    let recordings = [front, back].map(|part| record(&robot, &truth, 0.0, part));
    let fit = fit(&[&recordings[0], &recordings[1]], &robot).unwrap();
    let fitted = fit.chain(&robot).unwrap();
    assert!(
        difference_nm(&fitted, &truth) < 0.01,
        "{}",
        difference_nm(&fitted, &truth)
    );
    for (link, fitted) in fitted.links().iter().zip(&fit.links) {
        let moment = link.centre_of_mass_m * link.mass_kg;
        for axis in 0..3 {
            assert!((moment[axis] - fitted.first_moment_kg_m[axis].value).abs() < 1e-12);
        }
    }
}

#[test]
fn friction_the_file_does_not_know_changes_nothing() {
    let robot = two_links("[0.0, 1.0, 0.0]");
    let truth = deviating(&robot, 0.05, 1);
    let mut plant = Plant::of(&robot, 0.1);
    plant.chain = truth.clone();
    for friction in &mut plant.friction {
        friction.coulomb.coulomb_nm = 12.0;
        friction.asymmetric.asymmetry_nm = 2.0;
        friction.viscous.viscous_nm_s_rad = 20.0;
    }
    let recording = plant.record(&wander(&robot, 30, 2), 1);
    let fit = fit(&[&recording], &robot).unwrap();
    let apart_nm = difference_nm(&fit.chain(&robot).unwrap(), &truth);
    assert!(apart_nm < 0.1, "{apart_nm}");
}

#[test]
fn errors_name_joint_and_signal() {
    let robot = two_links("[0.0, 1.0, 0.0]");
    let good = record(&robot, &robot.chain, 0.1, &wander(&robot, 10, 2));
    let spoilt = |spoil: &dyn Fn(&mut Recording)| {
        let mut recording = good.clone();
        spoil(&mut recording);
        fit(&[&recording], &robot).unwrap_err().to_string()
    };
    let missing = spoilt(&|recording| {
        recording.joints[1]
            .signals
            .remove(&Signal::MotorPositionRad);
    });
    assert!(
        missing.contains("motor_position_rad") && missing.contains("elbow"),
        "{missing}"
    );
    let column = |recording: &mut Recording, signal, change: &dyn Fn(f64) -> f64| {
        let values = recording.joints[1].signals.get_mut(&signal).unwrap();
        values.iter_mut().for_each(|value| *value = change(*value));
    };
    let still = spoilt(&|recording| column(recording, Signal::MotorPositionRad, &|_| 30.0));
    assert!(still.contains("joint `elbow` never moved"), "{still}");
    let empty = spoilt(&|recording| column(recording, Signal::MotorTorqueNm, &|_| f64::NAN));
    assert!(
        empty.contains("joint `elbow`: motor_torque_nm is missing"),
        "{empty}"
    );
    let reversed = spoilt(&|recording| column(recording, Signal::MotorTorqueNm, &|nm| -nm));
    assert!(
        reversed.contains("joint `elbow`: motor_torque_nm has the wrong sign"),
        "{reversed}"
    );
    let short = spoilt(&|recording| {
        recording.time_s.truncate(150);
        for joint in &mut recording.joints {
            joint
                .signals
                .values_mut()
                .for_each(|values| values.truncate(150));
        }
    });
    assert!(short.contains("poses"), "{short}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn garbage_is_an_error_or_a_fit_but_never_a_panic(
        rows in prop::collection::vec((any::<f64>(), any::<f64>(), any::<f64>()), 0..300),
        tame in any::<bool>(),
    ) {
        let robot = two_links("[0.0, 1.0, 0.0]");
        let mut recording = record(&robot, &robot.chain, 0.0, &[vec![0.0; 2], vec![0.0; 2]]);
        let mut angle = 0.0;
        let angles: Vec<f64> = rows.iter().map(|(_, rad, _)| {
            angle = if tame { angle + (rad % 1.0) * 0.1 + 0.05 } else { *rad };
            angle
        }).collect();
        recording.time_s = rows.iter().enumerate()
            .map(|(row, (time, _, _))| if tame { row as f64 * 0.01 } else { *time }).collect();
        for joint in &mut recording.joints {
            joint.signals = [
                (Signal::MotorPositionRad, angles.clone()),
                (Signal::MotorTorqueNm, rows.iter().map(|(_, _, nm)| *nm).collect()),
            ].into();
        }
        let _ = fit(&[&recording], &robot);
    }
}
