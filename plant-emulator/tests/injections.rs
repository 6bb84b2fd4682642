//! Every effect of the contract, injected alone: it shows at its joint, at no other, and not before it begins.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use std::path::PathBuf;

use common::{PERIOD_S, velocity};
use plant_emulator::{Plant, PlantError, PlantParameters, PlantSample};
use robot::{Effect, EncoderSide, Injection, Robot, RobotFile, Source};

/// Two joints that cannot feel each other: perpendicular axes through one point, centres of mass on it, a ball as last
/// link, no gravity. What shows at the other joint would be a mix-up and not coupling.
const UNCOUPLED: &str = r#"
name = "uncoupled"
gravity_m_s2 = [0.0, 0.0, 0.0]
[[link]]
joint = "first"
axis = [0.0, 0.0, 1.0]
mass_kg = 1.0
centre_of_mass_m = [0.0, 0.0, 0.0]
inertia_kg_m2 = { xx = 0.05, yy = 0.05, zz = 0.05 }
[[link]]
joint = "second"
axis = [1.0, 0.0, 0.0]
mass_kg = 1.0
centre_of_mass_m = [0.0, 0.0, 0.0]
inertia_kg_m2 = { xx = 0.05, yy = 0.05, zz = 0.05 }
[[joint]]
name = "first"
gear_ratio = 100.0
rotor_inertia_kg_m2 = 1e-5
torque_limit_nm = 0.5
motor_encoder_resolution_rad = 1e-4
link_encoder_resolution_rad = 1e-6
torque_noise_nm = 1e-4
effects = [
  { effect = "coulomb_friction", coulomb_nm = 2.0 },
  { effect = "viscous_friction", viscous_nm_s_rad = 1.0 },
  { effect = "torsional_compliance", stiffness_nm_rad = 8000.0 },
]
[[joint]]
name = "second"
gear_ratio = 100.0
rotor_inertia_kg_m2 = 1e-5
torque_limit_nm = 0.5
motor_encoder_resolution_rad = 1e-4
link_encoder_resolution_rad = 1e-6
torque_noise_nm = 1e-4
effects = [
  { effect = "coulomb_friction", coulomb_nm = 2.0 },
  { effect = "viscous_friction", viscous_nm_s_rad = 1.0 },
  { effect = "torsional_compliance", stiffness_nm_rad = 8000.0 },
]
"#;

fn uncoupled() -> Robot {
    let source = Source::File(PathBuf::from("uncoupled.toml"));
    RobotFile::parse(UNCOUPLED, "uncoupled.toml")
        .unwrap()
        .build(source)
        .unwrap()
}

/// One of each, large enough to see within a second.
fn every_joint_effect() -> Vec<Effect> {
    let harmonic = |amplitude_rad| Effect::KinematicError {
        amplitude_rad,
        cycles_per_motor_rev: 2.0,
        phase_rad: 0.5,
        amplitude_rad_2: 0.5 * amplitude_rad,
        cycles_per_motor_rev_2: 4.0,
        phase_rad_2: 0.0,
        amplitude_rad_3: 0.0,
        cycles_per_motor_rev_3: 0.0,
        phase_rad_3: 0.0,
    };
    vec![
        Effect::CoulombFriction { coulomb_nm: 1.0 },
        Effect::ViscousFriction {
            viscous_nm_s_rad: 2.0,
        },
        Effect::QuadraticFriction {
            quadratic_nm_s2_rad2: 2.0,
        },
        Effect::StribeckFriction {
            stribeck_nm: 1.0,
            stribeck_velocity_rad_s: 0.05,
        },
        Effect::AsymmetricFriction { asymmetry_nm: 0.5 },
        Effect::LoadDependentFriction {
            load_coefficient: 0.3,
        },
        Effect::PositionDependentFriction {
            amplitude_nm: 0.5,
            cycles_per_motor_rev: 2.0,
            phase_rad: 0.3,
        },
        harmonic(2e-4),
        Effect::TorsionalCompliance {
            stiffness_nm_rad: -4000.0,
        },
        Effect::SoftWindup {
            low_stiffness_nm_rad: 2000.0,
            knee_nm: 1.0,
        },
        Effect::TorsionalHysteresis {
            width_nm: 1.0,
            yield_rad: 1e-4,
        },
        Effect::StructuralDamping {
            damping_nm_s_rad: 50.0,
            exponent: 0.7,
        },
        Effect::Backlash { gap_rad: 1e-3 },
        Effect::ThermalFrictionDrift {
            drift_nm_s: Some(0.5),
            time_constant_s: None,
            change_nm: None,
        },
        Effect::ThermalFrictionDrift {
            drift_nm_s: None,
            time_constant_s: Some(0.3),
            change_nm: Some(1.0),
        },
        Effect::TorqueConstantError { gain: 0.9 },
        Effect::TorqueOffset { offset_nm: 1.0 },
        Effect::TorqueRipple {
            amplitude_nm: 0.005,
            cycles_per_motor_rev: 6.0,
            phase_rad: 0.0,
        },
        Effect::TorqueSaturation { limit_nm: 0.02 },
        Effect::CurrentLoopLag {
            time_constant_s: 1e-3,
        },
        Effect::LinkInertia { inertia_kg_m2: 0.1 },
        Effect::RotorInertia {
            inertia_kg_m2: 1e-5,
        },
        Effect::GravityTorque {
            sin_nm: 1.0,
            cos_nm: 0.5,
        },
        Effect::JointSpring {
            stiffness_nm_rad: 5.0,
            rest_rad: 0.2,
        },
        Effect::EncoderOffset { offset_rad: 1e-3 },
        Effect::EncoderEccentricity {
            amplitude_rad: 1e-3,
            cycles_per_rev: 1.0,
            phase_rad: 0.3,
            side: EncoderSide::Motor,
        },
        Effect::EncoderEccentricity {
            amplitude_rad: 1e-3,
            cycles_per_rev: 1.0,
            phase_rad: 0.3,
            side: EncoderSide::Link,
        },
        Effect::EncoderQuantisation {
            resolution_rad: 0.05,
            side: EncoderSide::Motor,
        },
        Effect::EncoderQuantisation {
            resolution_rad: 1e-3,
            side: EncoderSide::Link,
        },
        Effect::VelocityFilterLag { cutoff_hz: 50.0 },
        Effect::CommandDelay { delay_s: 5e-3 },
        Effect::SensorDelay {
            delay_s: 2.3e-3,
            side: None,
        },
        Effect::DroppedCommands { fraction: 0.3 },
        Effect::DroppedSamples { fraction: 0.3 },
    ]
}

const PERIODS: usize = 1500;

fn recording(robot: &Robot, injections: &[Injection]) -> Vec<PlantSample> {
    let parameters = PlantParameters::for_robot(robot).unwrap();
    let start_rad = vec![0.1; robot.joints.len()];
    let mut plant = Plant::new(robot, &parameters, injections, 5, &start_rad, PERIOD_S).unwrap();
    (0..PERIODS)
        .map(|k| {
            let swing_rad_s = 0.5 * (8.0 * k as f64 * PERIOD_S).sin();
            plant.step(&velocity(&vec![swing_rad_s; robot.joints.len()]))
        })
        .collect()
}

/// All signals of a joint with NaN for a sensor that is not there.
fn signals(sample: &PlantSample, joint: usize) -> [f64; 5] {
    [
        sample.motor_position_rad[joint],
        sample.motor_velocity_rad_s[joint],
        sample.motor_torque_nm[joint],
        sample.link_position_rad[joint],
        sample.joint_torque_nm[joint],
    ]
}

fn differs(a: &PlantSample, b: &PlantSample, joint: usize) -> bool {
    signals(a, joint).map(f64::to_bits) != signals(b, joint).map(f64::to_bits)
}

/// Part of the samples that differ at a joint.
fn share_changed(with: &[PlantSample], without: &[PlantSample], joint: usize) -> f64 {
    let changed = with
        .iter()
        .zip(without)
        .filter(|(a, b)| differs(a, b, joint))
        .count();
    changed as f64 / with.len() as f64
}

#[test]
fn the_table_holds_every_effect_of_the_contract() {
    let of_the_whole_arm = ["payload", "base_tilt"];
    let mut found: Vec<&str> = every_joint_effect().iter().map(Effect::name).collect();
    found.extend(of_the_whole_arm);
    for name in Effect::names() {
        assert!(found.contains(name), "{name} is not injected by any test");
    }
}

#[test]
fn each_effect_shows_at_its_joint_and_at_no_other() {
    let robot = uncoupled();
    let without = recording(&robot, &[]);
    for effect in every_joint_effect() {
        let with = recording(
            &robot,
            &[Injection {
                joint: Some(0),
                effect,
                start_s: 0.0,
            }],
        );
        assert!(
            share_changed(&with, &without, 0) > 0.1,
            "{effect:?} does not show"
        );
        assert_eq!(
            share_changed(&with, &without, 1),
            0.0,
            "{effect:?} shows at the other joint"
        );
    }
}

#[test]
fn no_effect_shows_before_it_begins() {
    let robot = uncoupled();
    let without = recording(&robot, &[]);
    let start = PERIODS / 2;
    for effect in every_joint_effect() {
        let start_s = start as f64 * PERIOD_S;
        let with = recording(
            &robot,
            &[Injection {
                joint: Some(0),
                effect,
                start_s,
            }],
        );
        assert_eq!(
            share_changed(&with[..start], &without[..start], 0),
            0.0,
            "{effect:?} shows early"
        );
        assert!(
            share_changed(&with[start..], &without[start..], 0) > 0.1,
            "{effect:?} does not begin"
        );
    }
}

#[test]
fn payload_and_tilt_show_at_the_joints_that_carry_them() {
    let robot = robot::load("pa10").unwrap();
    let without = recording(&robot, &[]);
    let start = PERIODS / 2;
    let start_s = start as f64 * PERIOD_S;
    for effect in [
        Effect::Payload {
            mass_kg: 3.0,
            centre_m: [0.05, 0.0, 0.1],
        },
        Effect::BaseTilt {
            roll_rad: 0.02,
            pitch_rad: 0.05,
        },
    ] {
        let with = recording(
            &robot,
            &[Injection {
                joint: None,
                effect,
                start_s,
            }],
        );
        for joint in 0..7 {
            assert_eq!(
                share_changed(&with[..start], &without[..start], joint),
                0.0,
                "{effect:?} shows early"
            );
        }
        for joint in [1, 3, 5] {
            assert!(
                share_changed(&with[start..], &without[start..], joint) > 0.5,
                "{effect:?}, joint {joint}"
            );
        }
    }
}

#[test]
fn timing_without_a_joint_acts_on_all() {
    let robot = uncoupled();
    let without = recording(&robot, &[]);
    let effect = Effect::SensorDelay {
        delay_s: 3e-3,
        side: None,
    };
    let with = recording(
        &robot,
        &[Injection {
            joint: None,
            effect,
            start_s: 0.0,
        }],
    );
    for joint in 0..2 {
        assert!(share_changed(&with, &without, joint) > 0.5);
    }
}

#[test]
fn what_begins_during_the_run_does_so_without_a_jump() {
    let robot = uncoupled();
    let smooth = [
        Effect::CoulombFriction { coulomb_nm: 1.0 },
        Effect::kinematic_error(2e-4, 2.0, 1.5),
        Effect::TorsionalCompliance {
            stiffness_nm_rad: -4000.0,
        },
        Effect::SoftWindup {
            low_stiffness_nm_rad: 2000.0,
            knee_nm: 1.0,
        },
        Effect::TorqueOffset { offset_nm: 1.0 },
        Effect::JointSpring {
            stiffness_nm_rad: 5.0,
            rest_rad: 0.2,
        },
    ];
    let parameters = PlantParameters::for_robot(&robot).unwrap();
    for effect in smooth {
        let injection = Injection {
            joint: Some(0),
            effect,
            start_s: 0.5,
        };
        let mut plant =
            Plant::new(&robot, &parameters, &[injection], 5, &[0.1; 2], PERIOD_S).unwrap();
        let mut last_nm: Option<f64> = None;
        for k in 0..900 {
            plant.step(&velocity(&[0.3, 0.0]));
            let torque_nm = plant.truth().joint_torque_nm[0];
            let jump_nm = last_nm.map_or(0.0, |last_nm| (torque_nm - last_nm).abs());
            assert!(
                k < 600 || jump_nm < 0.3,
                "{effect:?}: {jump_nm} Nm in one period"
            );
            last_nm = Some(torque_nm);
        }
    }
}

#[test]
fn what_cannot_be_is_refused_with_the_number_that_decides() {
    let robot = uncoupled();
    let parameters = PlantParameters::for_robot(&robot).unwrap();
    let refused = |joint, effect| {
        let injection = Injection {
            joint,
            effect,
            start_s: 0.0,
        };
        Plant::new(&robot, &parameters, &[injection], 1, &[0.0; 2], PERIOD_S).unwrap_err()
    };
    let spring = Effect::JointSpring {
        stiffness_nm_rad: 1.0,
        rest_rad: 0.0,
    };
    assert!(matches!(
        refused(Some(2), spring),
        PlantError::InjectedJoint {
            joint: Some(2),
            last: 1,
            ..
        }
    ));
    assert!(matches!(
        refused(None, spring),
        PlantError::InjectedJoint { joint: None, .. }
    ));
    let limp = Effect::TorsionalCompliance {
        stiffness_nm_rad: -9000.0,
    };
    assert!(matches!(
        refused(Some(0), limp),
        PlantError::NotPositive {
            joint: 0,
            name: "stiffness_nm_rad",
            ..
        }
    ));
    let late = Effect::CommandDelay { delay_s: 5.0 };
    assert!(matches!(
        refused(Some(1), late),
        PlantError::Delay { joint: 1, .. }
    ));
    let heavy = Effect::Payload {
        mass_kg: -5.0,
        centre_m: [0.0; 3],
    };
    assert!(matches!(refused(None, heavy), PlantError::Chain(_)));
    let start = Plant::new(&robot, &parameters, &[], 1, &[0.0], PERIOD_S).unwrap_err();
    assert_eq!(
        start.to_string(),
        "start position needs 2 finite values in rad, got [0.0]"
    );
    let period = Plant::new(&robot, &parameters, &[], 1, &[0.0; 2], 0.5).unwrap_err();
    assert!(matches!(period, PlantError::Period { period_s: 0.5 }));
}
