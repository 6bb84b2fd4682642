//! Laws whose shape the rows tell: friction that rises with the speed, ripple, friction that repeats with the motor's angle, drift.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::collections::BTreeMap;
use std::path::PathBuf;

use gap_diagnosis::{Options, diagnose};
use gap_report::JointReport;
use recording::{JointColumns, Recording, Signal};
use robot::{Robot, RobotFile, Source};

const RATIO: f64 = 6.0;
const INERTIA_KG_M2: f64 = 0.025 + 2.0 * 0.25 * 0.25;

/// A pendulum of 2 kg at 0.25 m behind a gear of 6:1, of which the file knows no friction but these effects.
fn robot(effects: &str) -> Robot {
    let text = format!(
        r#"
        name = "pendulum"
        [[link]]
        joint = "shoulder"
        axis = [0.0, 1.0, 0.0]
        mass_kg = 2.0
        centre_of_mass_m = [0.0, 0.0, -0.25]
        inertia_kg_m2 = {{ xx = 0.025, yy = 0.025, zz = 0.004, xy = 0.0, yz = 0.0, xz = 0.0 }}
        [[joint]]
        name = "shoulder"
        gear_ratio = {RATIO:?}
        rotor_inertia_kg_m2 = 0.0
        effects = [{effects}]
        "#
    );
    let file = RobotFile::parse(&text, "pendulum.toml").unwrap();
    file.build(Source::File(PathBuf::from("pendulum.toml")))
        .unwrap()
}

/// One instant of the motion.
struct At {
    time_s: f64,
    position_rad: f64,
    velocity_rad_s: f64,
}

/// What is told of 40 s of a slow motion with this friction and more, joint side.
fn told(friction_nm: impl Fn(&At) -> f64) -> JointReport {
    told_of("", friction_nm)
}

/// The same of a robot file with effects.
fn told_of(effects: &str, friction_nm: impl Fn(&At) -> f64) -> JointReport {
    const RATE_HZ: f64 = 500.0;
    let waves = [(0.5, 0.5, 0.3), (0.2, 1.1, 1.0), (0.15, 1.7, 2.0)];
    let sum = |of: &dyn Fn(f64, f64, f64) -> f64| -> f64 {
        waves
            .iter()
            .map(|(size, w, phase)| of(*size, *w, *phase))
            .sum()
    };
    let mut state = 11_u64;
    let mut noise = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
    };
    let time_s: Vec<f64> = (0..20_000).map(|k| f64::from(k) / RATE_HZ).collect();
    let mut signals = BTreeMap::from([
        (Signal::MotorPositionRad, Vec::new()),
        (Signal::MotorTorqueNm, Vec::new()),
    ]);
    for t in &time_s {
        let at = At {
            time_s: *t,
            position_rad: sum(&|size, w, phase| size * (w * t + phase).sin()),
            velocity_rad_s: sum(&|size, w, phase| size * w * (w * t + phase).cos()),
        };
        let acceleration_rad_s2 = sum(&|size, w, phase| -size * w * w * (w * t + phase).sin());
        let rigid_nm =
            INERTIA_KG_M2 * acceleration_rad_s2 + 2.0 * 9.81 * 0.25 * at.position_rad.sin();
        let torque_nm = rigid_nm + friction_nm(&at) + 0.02 * noise();
        let mut add = |signal: Signal, value: f64| signals.get_mut(&signal).unwrap().push(value);
        add(Signal::MotorPositionRad, RATIO * at.position_rad);
        add(Signal::MotorTorqueNm, torque_nm / RATIO);
    }
    let recording = Recording {
        time_s,
        segment: None,
        joints: vec![JointColumns {
            name: "shoulder".to_owned(),
            signals,
        }],
        sample_rate_hz: RATE_HZ,
        metadata: BTreeMap::new(),
        truncated: false,
    };
    let all = [("log".to_owned(), recording)];
    let diagnosis = diagnose(&robot(effects), &all, &Options::default(), &|_| {}).unwrap();
    let [joint] = &diagnosis.report.joints[..] else {
        panic!("one joint")
    };
    joint.clone()
}

/// Friction of 1 Nm and 0.8 Nm s/rad that turns round within a few mrad/s, nearly as the sign of the velocity.
fn plain_nm(at: &At) -> f64 {
    (at.velocity_rad_s / 1e-3).tanh() + 0.8 * at.velocity_rad_s
}

fn names(joint: &JointReport) -> Vec<&str> {
    let all = joint.effects.iter().chain(&joint.minor_effects);
    let mut names: Vec<&str> = all.map(|effect| effect.effect.as_str()).collect();
    names.sort_unstable();
    names
}

#[track_caller]
fn is(joint: &JointReport, effect: &str, parameter: &str, value: f64, within: f64) {
    let mut all = joint.effects.iter().chain(&joint.minor_effects);
    let effect = all.find(|told| told.effect == effect).unwrap();
    let told = &effect.parameters[parameter];
    assert!((told.value - value).abs() < within, "{parameter}: {told:?}");
    assert!(told.std < within, "{parameter}: {told:?}");
}

#[test]
fn friction_that_rises_with_the_speed_is_no_other_friction() {
    let joint = told(|at| (at.velocity_rad_s / 0.02).tanh() + 0.8 * at.velocity_rad_s);
    assert_eq!(names(&joint), ["coulomb_friction", "viscous_friction"]);
    is(&joint, "coulomb_friction", "coulomb_nm", 1.0, 0.03);
    is(&joint, "viscous_friction", "viscous_nm_s_rad", 0.8, 0.08);
}

#[test]
fn a_ripple_of_pole_pairs_is_told() {
    let joint =
        told(|at| plain_nm(at) - RATIO * 0.05 * (21.0 * RATIO * at.position_rad + 0.4).sin());
    assert_eq!(
        names(&joint),
        ["coulomb_friction", "torque_ripple", "viscous_friction"]
    );
    is(&joint, "torque_ripple", "cycles_per_motor_rev", 21.0, 1e-9);
    is(&joint, "torque_ripple", "amplitude_nm", 0.05, 0.005);
    is(&joint, "torque_ripple", "phase_rad", 0.4, 0.1);
}

#[test]
fn friction_that_repeats_with_the_motor_is_told() {
    let joint = told(|at| {
        let level_nm = 0.3 * (7.0 * RATIO * at.position_rad - 1.0).sin();
        plain_nm(at) + level_nm * at.velocity_rad_s.signum()
    });
    let told = names(&joint);
    assert_eq!(
        told,
        [
            "coulomb_friction",
            "position_dependent_friction",
            "viscous_friction"
        ]
    );
    is(
        &joint,
        "position_dependent_friction",
        "cycles_per_motor_rev",
        7.0,
        1e-9,
    );
    is(
        &joint,
        "position_dependent_friction",
        "amplitude_nm",
        0.3,
        0.03,
    );
    is(
        &joint,
        "position_dependent_friction",
        "phase_rad",
        -1.0,
        0.1,
    );
}

#[test]
fn friction_that_thins_is_told_and_no_other_drift() {
    let drifting =
        |nm_s: f64| told(|at| plain_nm(at) + nm_s * at.time_s * at.velocity_rad_s.signum());
    let joint = drifting(-0.01);
    assert_eq!(
        names(&joint),
        [
            "coulomb_friction",
            "thermal_friction_drift",
            "viscous_friction"
        ]
    );
    is(&joint, "thermal_friction_drift", "drift_nm_s", -0.01, 0.001);
    let rising = drifting(0.01);
    assert!(!names(&rising).contains(&"thermal_friction_drift"));
}

#[test]
fn what_the_file_has_is_not_told_again() {
    let joint = told_of(
        "{ effect = \"coulomb_friction\", coulomb_nm = 1.0 },
         { effect = \"viscous_friction\", viscous_nm_s_rad = 0.8 },
         { effect = \"torque_ripple\", amplitude_nm = 0.05, cycles_per_motor_rev = 21, phase_rad = 0.4 },
         { effect = \"position_dependent_friction\", amplitude_nm = 0.3, cycles_per_motor_rev = 7, phase_rad = -1.0 },
         { effect = \"thermal_friction_drift\", drift_nm_s = -0.01 }",
        |at| {
            let angle_rad = RATIO * at.position_rad;
            let level_nm = 0.3 * (7.0 * angle_rad - 1.0).sin() - 0.01 * at.time_s;
            plain_nm(at) - RATIO * 0.05 * (21.0 * angle_rad + 0.4).sin() + level_nm * at.velocity_rad_s.signum()
        },
    );
    assert!(names(&joint).is_empty(), "{:?}", names(&joint));
}
