//! The same rubbing pendulum in the logs that people have: one answer, whatever the log lacks or gets wrong.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::collections::BTreeMap;
use std::path::PathBuf;

use gap_diagnosis::{Options, diagnose};
use gap_report::{JointReport, Remaining, Remains, Report, Verdict};
use joint_model::rigid_body::{Chain, Link};
use nalgebra::Vector3;
use recording::{JointColumns, Recording, Signal};
use robot::{Robot, RobotFile, Source};

const RATIO: f64 = 100.0;
const RATE_HZ: f64 = 500.0;
const BEND_RAD: f64 = 1e-3;
const KP: f64 = 300.0;
const KD: f64 = 30.0;
const SENSING: [&str; 3] = [
    "encoder_quantisation",
    "sensor_delay",
    "velocity_filter_lag",
];

/// A pendulum of 2 kg at 0.25 m behind a gear of 100:1, of which the file knows no friction, no encoder and no noise.
fn robot(control: &str) -> Robot {
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
        rotor_inertia_kg_m2 = 1e-5
        {control}
        "#
    );
    let file = RobotFile::parse(&text, "pendulum.toml").unwrap();
    file.build(Source::File(PathBuf::from("pendulum.toml")))
        .unwrap()
}

fn known_control() -> Robot {
    robot(&control())
}

fn control() -> String {
    format!(
        "[control]\nrate_hz = {RATE_HZ:?}\nkind = \"pd_feedforward\"\nproportional_nm_rad = [{KP:?}]\n\
         derivative_nm_s_rad = [{KD:?}]\nfeedback = \"link\"\ndelay_cycles = 1\n"
    )
}

/// What was recorded, joint side.
struct Log {
    time_s: Vec<f64>,
    reference_rad: Vec<f64>,
    position_rad: Vec<f64>,
    velocity_rad_s: Vec<f64>,
    torque_nm: Vec<f64>,
    /// What friction took.
    friction_nm: Vec<f64>,
}

/// Noise between -1 and 1.
fn noise(state: &mut u64) -> f64 {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
}

/// 10 s under a proportional and derivative controller, with friction of 3.0 Nm and 2.0 Nm s/rad, and `more` by the time since the
/// direction changed. Friction gives way after `bend_rad`.
fn log(more: impl Fn(f64) -> f64, bend_rad: f64) -> Log {
    log_within(f64::INFINITY, more, bend_rad)
}

/// The same of a drive that gives so much at most.
fn log_within(limit_nm: f64, more: impl Fn(f64) -> f64, bend_rad: f64) -> Log {
    const FINE: usize = 20;
    const ENCODER_RAD: f64 = 1e-5;
    let inertia_kg_m2 = 0.025 + 2.0 * 0.25 * 0.25 + 1e-5 * RATIO * RATIO;
    let step_s = 1.0 / RATE_HZ / FINE as f64;
    let reference =
        |t: f64| 0.6 * (3.1 * t).sin() + 0.35 * (7.3 * t).sin() - 0.2 * (1.3 * t).cos() + 0.2;
    let (mut q, mut v, mut bend, mut since_s) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0_f64);
    let mut torque_nm = 0.0_f64;
    let mut seed = 7;
    let mut all = Log {
        time_s: Vec::new(),
        reference_rad: Vec::new(),
        position_rad: Vec::new(),
        velocity_rad_s: Vec::new(),
        torque_nm: Vec::new(),
        friction_nm: Vec::new(),
    };
    let mut seen_rad = 0.0;
    for k in 0..(10.0 * RATE_HZ) as usize {
        let t = k as f64 / RATE_HZ;
        let before_rad = seen_rad;
        seen_rad = (q / ENCODER_RAD).round() * ENCODER_RAD;
        let rate_rad_s = if k == 0 {
            0.0
        } else {
            (seen_rad - before_rad) * RATE_HZ
        };
        let reference_rate = (reference(t) - reference(t - 1.0 / RATE_HZ)) * RATE_HZ;
        let command_nm = KP * (reference(t) - seen_rad) + KD * (reference_rate - rate_rad_s);
        let friction_nm = 3.0 * bend + 2.0 * v + more(since_s) * v.signum();
        all.time_s.push(t);
        all.reference_rad.push(reference(t));
        all.position_rad.push(seen_rad);
        all.velocity_rad_s.push(v);
        all.torque_nm.push(torque_nm + 0.02 * noise(&mut seed));
        all.friction_nm.push(friction_nm);
        for _ in 0..FINE {
            let friction_nm = 3.0 * bend + 2.0 * v + more(since_s) * v.signum();
            let weight_nm = 2.0 * 9.81 * 0.25 * q.sin();
            let before = v;
            v += step_s * (torque_nm - weight_nm - friction_nm) / inertia_kg_m2;
            q += step_s * v;
            bend = (bend + step_s * v / bend_rad).clamp(-1.0, 1.0);
            since_s = if before * v < 0.0 {
                0.0
            } else {
                since_s + step_s
            };
        }
        torque_nm = command_nm.clamp(-limit_nm, limit_nm);
    }
    all
}

fn plain() -> Log {
    log(|_| 0.0, BEND_RAD)
}

fn recording(time_s: Vec<f64>, signals: Vec<(Signal, Vec<f64>)>) -> Recording {
    Recording {
        time_s,
        segment: None,
        joints: vec![JointColumns {
            name: "shoulder".to_owned(),
            signals: signals.into_iter().collect(),
        }],
        sample_rate_hz: RATE_HZ,
        metadata: BTreeMap::new(),
        truncated: false,
    }
}

fn motor_side(joint_side_nm: &[f64]) -> Vec<f64> {
    joint_side_nm.iter().map(|nm| nm / RATIO).collect()
}

fn as_recorded(log: Log) -> Vec<(Signal, Vec<f64>)> {
    let torque_nm = motor_side(&log.torque_nm);
    vec![
        (Signal::ReferencePositionRad, log.reference_rad),
        (Signal::LinkPositionRad, log.position_rad),
        (Signal::LinkVelocityRadS, log.velocity_rad_s),
        (Signal::MotorTorqueNm, torque_nm),
    ]
}

fn told(robot: &Robot, recording: Recording) -> Report {
    let recordings = [("log".to_owned(), recording)];
    diagnose(robot, &recordings, &Options::default(), &|_| ())
        .unwrap()
        .report
}

fn value(joint: &JointReport, effect: &str, parameter: &str) -> f64 {
    let found = joint.effects.iter().find(|found| found.effect == effect);
    found.map_or(f64::NAN, |found| found.parameters[parameter].value)
}

/// Coulomb friction of 3.0 Nm and viscous friction of 2.0 Nm s/rad explain it, and nothing misleads.
fn is_told(report: &Report) {
    let joint = &report.joints[0];
    let names: Vec<&str> = joint.effects.iter().map(|e| e.effect.as_str()).collect();
    let first = |name: &str| names.iter().take(2).any(|known| *known == name);
    assert!(
        first("coulomb_friction") && first("viscous_friction"),
        "{names:?}"
    );
    assert!(
        !names.iter().any(|name| SENSING.contains(name)),
        "{names:?}"
    );
    assert_eq!(joint.verdict, Verdict::Explained, "{names:?}");
    let coulomb_nm = value(joint, "coulomb_friction", "coulomb_nm");
    let viscous = value(joint, "viscous_friction", "viscous_nm_s_rad");
    assert!((2.8..3.2).contains(&coulomb_nm), "{coulomb_nm}");
    assert!((1.8..2.2).contains(&viscous), "{viscous}");
    let all = joint.effects.iter().chain(&joint.minor_effects);
    let sum: f64 = all.map(|effect| effect.share).sum::<f64>() + joint.remaining_share;
    assert!((sum - 1.0).abs() < 1e-6, "{sum}");
}

fn finds(report: &Report, severity: &str, of: &str) -> bool {
    let mut all = report.data.iter();
    all.any(|finding| finding.severity == severity && finding.to_string().contains(of))
}

fn warns(report: &Report, of: &str) {
    let all: Vec<String> = report.data.iter().map(ToString::to_string).collect();
    assert!(finds(report, "warning", of), "{all:?}");
}

#[test]
fn friction_explains_a_joint_whose_file_states_little() {
    let log = plain();
    let report = told(&robot(""), recording(log.time_s.clone(), as_recorded(log)));
    is_told(&report);
    // what the sensors show is a line to add, and no effect
    let all: Vec<String> = report.data.iter().map(ToString::to_string).collect();
    let told = all
        .iter()
        .any(|note| note.contains("link_encoder_resolution_rad = 1.00e-5"));
    assert!(told, "{all:?}");
}

#[test]
fn time_since_1970_is_time() {
    let log = plain();
    let time_s = log.time_s.iter().map(|t| 1.7e9 + t).collect();
    is_told(&told(&robot(""), recording(time_s, as_recorded(log))));
}

#[test]
fn a_reversed_command_beside_a_good_torque_is_left_out() {
    let log = plain();
    let time_s = log.time_s.clone();
    let reversed = log.torque_nm.iter().map(|nm| -nm / RATIO).collect();
    let mut signals = as_recorded(log);
    signals.push((Signal::CommandTorqueNm, reversed));
    let report = told(&robot(""), recording(time_s, signals));
    is_told(&report);
    warns(&report, "command_torque_nm is left out");
}

#[test]
fn a_reversed_torque_is_told_and_not_used() {
    let log = plain();
    let time_s = log.time_s.clone();
    let mut signals = as_recorded(log);
    signals[3].1.iter_mut().for_each(|nm| *nm = -*nm);
    let report = told(&robot(""), recording(time_s, signals));
    assert_eq!(report.joints[0].verdict, Verdict::InsufficientData);
    assert!(
        report.joints[0].reason.contains("reversed"),
        "{}",
        report.joints[0].reason
    );
}

#[test]
fn a_reversed_torque_is_seen_beside_masses_that_are_far_off() {
    let log = plain();
    let time_s = log.time_s.clone();
    let mut signals = as_recorded(log);
    let mut light = robot("");
    let links = light.chain.links().iter().map(|link| Link {
        mass_kg: 0.02,
        inertia_kg_m2: 0.01 * link.inertia_kg_m2,
        ..*link
    });
    let links: Vec<Link> = links.collect();
    let gravity_m_s2 = light.chain.gravity_m_s2();
    light.chain = Chain::new(&links, gravity_m_s2, nalgebra::Isometry3::identity()).unwrap();
    let right = told(&light, recording(time_s.clone(), signals.clone()));
    assert_ne!(right.joints[0].verdict, Verdict::InsufficientData);
    signals[3].1.iter_mut().for_each(|nm| *nm = -*nm);
    let report = told(&light, recording(time_s, signals));
    assert_eq!(report.joints[0].reason, "motor_torque_nm is reversed");
}

#[test]
fn a_torque_that_may_be_reversed_is_a_warning_where_masses_do_not_tell() {
    let log = plain();
    let time_s = log.time_s.clone();
    // it carries the masses, and friction drives
    let both = log.torque_nm.iter().zip(&log.friction_nm);
    let torque_nm: Vec<f64> = both
        .map(|(torque, friction)| torque - 2.0 * friction)
        .collect();
    let motor_nm = motor_side(&torque_nm);
    let mut signals = as_recorded(log);
    signals[3].1 = motor_nm;
    let report = told(&robot(""), recording(time_s, signals));
    warns(
        &report,
        "motor_torque_nm may be reversed: friction would drive the joint",
    );
}

#[test]
fn a_torque_in_another_unit_is_told() {
    let log = plain();
    let time_s = log.time_s.clone();
    let mut signals = as_recorded(log);
    signals[3].1.iter_mut().for_each(|nm| *nm *= 0.35);
    // friction that was measured is smaller by the same part as what masses need
    let file = robot(
        "effects = [{ effect = \"coulomb_friction\", coulomb_nm = 3.0 }, { effect = \"viscous_friction\", viscous_nm_s_rad = 2.0 }]",
    );
    let report = told(&file, recording(time_s, signals));
    warns(&report, "times what the file's masses and friction need");
    let unit = report.joints[0].torque.unwrap().unit;
    assert!((0.35 * unit - 1.0).abs() < 0.02, "{unit}");
}

#[test]
fn a_models_torque_in_the_commands_place_is_told_and_left_alone() {
    let log = plain();
    let time_s = log.time_s.clone();
    let both = log.torque_nm.iter().zip(&log.friction_nm);
    let target = both
        .map(|(torque, friction)| (torque - friction) / RATIO)
        .collect();
    let mut signals = as_recorded(log);
    signals.push((Signal::CommandTorqueNm, target));
    let report = told(&robot(""), recording(time_s, signals));
    is_told(&report);
    warns(&report, "command_torque_nm is not what the drive made");
}

#[test]
fn a_velocity_that_lags_is_left_out() {
    let log = plain();
    let time_s = log.time_s.clone();
    let rows = 0..log.velocity_rad_s.len();
    let slow = rows.map(|k| {
        let within = &log.velocity_rad_s[k.saturating_sub(40)..=k];
        0.765 * within.iter().sum::<f64>() / within.len() as f64
    });
    let slow: Vec<f64> = slow.collect();
    let mut signals = as_recorded(log);
    signals[2].1 = slow;
    let report = told(&robot(""), recording(time_s, signals));
    is_told(&report);
    warns(&report, "link_velocity_rad_s is left out");
}

/// A sensor behind the gear does not feel the rotor, so the log has none.
fn behind_the_gear() -> (Robot, Log) {
    let mut log = plain();
    let rotor_kg_m2 = 1e-5 * RATIO * RATIO;
    for k in 1..log.torque_nm.len() - 1 {
        let acceleration = (log.velocity_rad_s[k + 1] - log.velocity_rad_s[k - 1]) * 0.5 * RATE_HZ;
        log.torque_nm[k] -= rotor_kg_m2 * acceleration;
    }
    (robot(""), log)
}

#[test]
fn a_torque_sensor_alone_is_enough() {
    let (robot, log) = behind_the_gear();
    let signals = vec![
        (Signal::LinkPositionRad, log.position_rad),
        (Signal::JointTorqueNm, log.torque_nm),
    ];
    is_told(&told(&robot, recording(log.time_s, signals)));
}

#[test]
fn what_a_torque_sensor_is_wrong_by_is_told_as_a_line_of_the_mapping() {
    let (robot, log) = behind_the_gear();
    let wrong_nm = log.torque_nm.iter().map(|nm| nm - 2.0);
    let signals = vec![
        (Signal::LinkPositionRad, log.position_rad),
        (Signal::JointTorqueNm, wrong_nm.collect()),
    ];
    let report = told(&robot, recording(log.time_s, signals));
    let offset_nm = value(&report.joints[0], "torque_offset", "offset_nm");
    assert!((offset_nm - 2.0).abs() < 0.1, "{:?}", report.joints[0]);
    assert!(report.joints[0].is_of_sensor("torque_offset"));
    let remedy = format!("joint_torque_nm: add {offset_nm:.3} to its offset");
    let told = report
        .data
        .iter()
        .find(|note| note.remedy.ends_with(&remedy));
    assert!(told.is_some(), "{:?}", report.data);
}

/// The log, and what a sensor behind the gear's friction measures beside its motor's torque.
fn with_a_sensor() -> (Log, Vec<f64>) {
    let (_, behind) = behind_the_gear();
    let both = behind.torque_nm.iter().zip(&behind.friction_nm);
    (plain(), both.map(|(nm, friction)| nm - friction).collect())
}

#[test]
fn what_a_torque_sensor_measures_beside_the_motor_is_carried_whatever_the_file_says() {
    let (mut log, mut carried_nm) = with_a_sensor();
    // a machine that pulls at the link, of which the file knows nothing
    for (k, (motor_nm, carried_nm)) in log.torque_nm.iter_mut().zip(&mut carried_nm).enumerate() {
        let t = k as f64 / RATE_HZ;
        let pulled_nm = 40.0 * ((4.1 * t).sin() + (2.3 * t + 1.0).sin() + (9.7 * t).cos());
        *motor_nm += pulled_nm;
        *carried_nm += pulled_nm;
    }
    let time_s = log.time_s.clone();
    let mut signals = as_recorded(log);
    let without = told(&robot(""), recording(time_s.clone(), signals.clone()));
    assert!(
        without.joints[0].effects.is_empty(),
        "{:?}",
        without.joints[0]
    );
    signals.push((Signal::JointTorqueNm, carried_nm));
    let report = told(&robot(""), recording(time_s, signals));
    is_told(&report);
    warns(&report, "its torque sensor says that it carries");
}

#[test]
fn a_sensor_beside_the_motor_of_a_joint_as_its_file_says_is_not_asked() {
    let (log, carried_nm) = with_a_sensor();
    let time_s = log.time_s.clone();
    let mut signals = as_recorded(log);
    signals.push((Signal::JointTorqueNm, carried_nm));
    let rubs = "effects = [{ effect = \"coulomb_friction\", coulomb_nm = 3.0 }, { effect = \"viscous_friction\", viscous_nm_s_rad = 2.0 }]";
    let report = told(&robot(rubs), recording(time_s, signals));
    assert_eq!(report.joints[0].verdict, Verdict::NoGap);
    let mut notes = report.data.iter();
    assert!(!notes.any(|note| note.what.contains("its torque sensor says")));
}

#[test]
fn a_torque_that_comes_long_after_the_position_is_a_warning() {
    let told_late = |rows: usize| {
        let mut log = plain();
        log.torque_nm.rotate_right(rows);
        let time_s = log.time_s.clone();
        told(&robot(""), recording(time_s, as_recorded(log)))
    };
    let is_told_late = |report: &Report| {
        let mut all = report.data.iter();
        all.any(|finding| finding.what.contains("after the position"))
    };
    // 40 ms
    assert!(is_told_late(&told_late(20)));
    assert!(!is_told_late(&told_late(0)));
}

#[test]
fn a_reversed_position_is_called_so_where_the_weight_does_not_turn_with_it() {
    // its centre lies beside the axis, so that it weighs the same as far on either side
    let right = robot("");
    let beside = Link {
        centre_of_mass_m: Vector3::new(-0.25, 0.0, 0.0),
        ..right.chain.links()[0]
    };
    let chain = Chain::new(&[beside], right.chain.gravity_m_s2(), right.chain.tool()).unwrap();
    let beside = Robot { chain, ..right };
    let told_with = |position: f64, torque: f64| {
        let mut log = plain();
        for (nm, q) in log.torque_nm.iter_mut().zip(&log.position_rad) {
            *nm = torque * (*nm + 2.0 * 9.81 * 0.25 * (q.cos() - q.sin()));
        }
        let of_motion = [
            &mut log.position_rad,
            &mut log.velocity_rad_s,
            &mut log.reference_rad,
        ];
        of_motion
            .into_iter()
            .flatten()
            .for_each(|value| *value *= position);
        told(&beside, recording(log.time_s.clone(), as_recorded(log)))
    };
    is_told(&told_with(1.0, 1.0));
    let reversed = told_with(-1.0, 1.0);
    let what = "its position is reversed beside motor_torque_nm";
    assert!(finds(&reversed, "error", what), "{:?}", reversed.data);
    let reversed = told_with(1.0, -1.0);
    let what = "motor_torque_nm is reversed";
    assert!(finds(&reversed, "error", what), "{:?}", reversed.data);
}

#[test]
fn a_gravity_torque_that_another_zero_would_make_is_said_to_be_that() {
    let of_zero = "rad elsewhere";
    let log = plain();
    let right = told(&robot(""), recording(log.time_s.clone(), as_recorded(log)));
    assert!(!finds(&right, "note", of_zero), "{:?}", right.data);
    let mut log = plain();
    log.position_rad.iter_mut().for_each(|q| *q -= 1.0);
    let moved = told(&robot(""), recording(log.time_s.clone(), as_recorded(log)));
    let mut all = moved.data.iter();
    let found = all.find(|finding| finding.what.contains(of_zero)).unwrap();
    let (_, offset) = found.remedy.split_once("add ").unwrap();
    let offset_rad: f64 = offset.split(' ').next().unwrap().parse().unwrap();
    assert!((offset_rad - 1.0).abs() < 0.03, "{offset_rad}");
}

#[test]
fn a_joint_whose_inertia_all_goes_was_moved_by_something_that_was_not_recorded() {
    let mut log = plain();
    let mut seed = 3;
    let weight = |q: &f64| 2.0 * 9.81 * 0.25 * q.sin();
    log.torque_nm = log.position_rad.iter().map(weight).collect();
    log.torque_nm
        .iter_mut()
        .for_each(|nm| *nm += 0.02 * noise(&mut seed));
    let moved = told(&robot(""), recording(log.time_s.clone(), as_recorded(log)));
    warns(&moved, "nothing is left for certain");
    let log = plain();
    let right = told(&robot(""), recording(log.time_s.clone(), as_recorded(log)));
    assert!(!finds(&right, "warning", "nothing is left for certain"));
}

#[test]
fn what_the_files_own_values_take_within_their_tolerance_is_said() {
    let moved = "the robot file's own values, moved within their tolerance";
    let told_with = |mass: f64| {
        let right = robot("");
        let links: Vec<Link> = right
            .chain
            .links()
            .iter()
            .map(|link| Link {
                mass_kg: mass * link.mass_kg,
                ..*link
            })
            .collect();
        let chain = Chain::new(&links, right.chain.gravity_m_s2(), right.chain.tool()).unwrap();
        let log = plain();
        told(
            &Robot { chain, ..right },
            recording(log.time_s.clone(), as_recorded(log)),
        )
    };
    let right = told_with(1.0);
    assert!(!finds(&right, "note", moved), "{:?}", right.data);
    assert!(right.links.is_empty());
    // two standard deviations of what is taken for known where nothing is stated
    let heavier = told_with(1.04);
    is_told(&heavier);
    assert!(finds(&heavier, "note", moved), "{:?}", heavier.data);
    // and written for the mended file: mass and centre together are what they were, whichever of them is moved
    let link = &heavier.links[0];
    let before = robot("").chain.links()[0];
    let centre_m = before.centre_of_mass_m;
    let moved_m = Vector3::from(link.centre_of_mass_m.map(|of| of.value));
    let mass_kg = 1.04 * before.mass_kg + link.mass_kg.value;
    let moment_kg_m = mass_kg * (centre_m + moved_m).norm();
    let right_kg_m = before.mass_kg * centre_m.norm();
    assert!(
        (moment_kg_m / right_kg_m - 1.0).abs() < 5e-3,
        "{moment_kg_m} of {right_kg_m}"
    );
}

#[test]
fn lost_rows_are_bridged() {
    let (robot, log) = behind_the_gear();
    // bursts of one to three rows of 40
    let kept: Vec<usize> = (0..log.time_s.len())
        .filter(|k| k % 120 > 2 && k % 77 > 0)
        .collect();
    let pick = |values: &[f64]| kept.iter().map(|k| values[*k]).collect::<Vec<f64>>();
    let signals = vec![
        (Signal::LinkPositionRad, pick(&log.position_rad)),
        (Signal::JointTorqueNm, pick(&log.torque_nm)),
    ];
    is_told(&told(&robot, recording(pick(&log.time_s), signals)));
}

#[test]
fn a_joint_that_sticks_wherever_it_turns_has_no_other_friction() {
    // less than its encoder shows
    let log = log(|_| 0.0, 5e-6);
    let report = told(&robot(""), recording(log.time_s.clone(), as_recorded(log)));
    is_told(&report);
    let joint = &report.joints[0];
    let all = joint.effects.iter().chain(&joint.minor_effects);
    let names: Vec<_> = all
        .map(|effect| (effect.effect.as_str(), effect.share, &effect.parameters))
        .collect();
    assert_eq!(names.len(), 2, "{names:?}");
}

#[test]
fn a_joint_may_stand_in_one_of_the_recordings() {
    let log = plain();
    let standing = vec![
        (Signal::LinkPositionRad, vec![0.3; log.time_s.len()]),
        (Signal::MotorTorqueNm, vec![0.01; log.time_s.len()]),
    ];
    let recordings = [
        (
            "standing".to_owned(),
            recording(log.time_s.clone(), standing),
        ),
        (
            "moving".to_owned(),
            recording(log.time_s.clone(), as_recorded(log)),
        ),
    ];
    let told = diagnose(&robot(""), &recordings, &Options::default(), &|_| ());
    is_told(&told.unwrap().report);
}

#[test]
fn a_joint_that_others_push_within_its_bend_says_nothing_of_its_friction() {
    let log = plain();
    // held by friction that does not slip, as the other joints move: anything up to the breakaway
    let pushed = |rate: f64, size: f64| {
        let time_s = log.time_s.iter();
        time_s
            .map(|t| size * (rate * t).sin())
            .collect::<Vec<f64>>()
    };
    let swayed_rad = pushed(2.0, 2e-3).iter().map(|rad| 0.3 + rad).collect();
    let pushed = vec![
        (Signal::LinkPositionRad, swayed_rad),
        (Signal::MotorTorqueNm, pushed(3.1, 0.025)),
    ];
    let recordings = [
        ("pushed".to_owned(), recording(log.time_s.clone(), pushed)),
        (
            "moving".to_owned(),
            recording(log.time_s.clone(), as_recorded(log)),
        ),
    ];
    let told = diagnose(&robot(""), &recordings, &Options::default(), &|_| ());
    is_told(&told.unwrap().report);
}

#[test]
fn a_torque_that_keeps_one_value_is_no_measurement_and_a_joint_without_a_drive_tells_its_friction()
{
    // swings freely from 2 rad on, with friction of 0.2 Nm and 0.1 Nm s/rad
    const FINE: usize = 20;
    let inertia_kg_m2 = 0.025 + 2.0 * 0.25 * 0.25 + 1e-5 * RATIO * RATIO;
    let (mut q, mut v) = (2.0_f64, 0.0_f64);
    let rows = (10.0 * RATE_HZ) as usize;
    let mut swung_rad = Vec::new();
    for _ in 0..rows {
        swung_rad.push(q);
        for _ in 0..FINE {
            let friction_nm = 0.2 * (v / 1e-3).tanh() + 0.1 * v;
            v -= (2.0 * 9.81 * 0.25 * q.sin() + friction_nm)
                / inertia_kg_m2
                / (RATE_HZ * FINE as f64);
            q += v / (RATE_HZ * FINE as f64);
        }
    }
    let time_s: Vec<f64> = (0..rows).map(|k| k as f64 / RATE_HZ).collect();
    let with = |torque: Signal| {
        let signals = vec![
            (Signal::LinkPositionRad, swung_rad.clone()),
            (torque, vec![0.0; rows]),
        ];
        told(&robot(""), recording(time_s.clone(), signals))
    };
    let measured = with(Signal::MotorTorqueNm);
    assert_eq!(measured.joints[0].verdict, Verdict::InsufficientData);
    let commanded = with(Signal::CommandTorqueNm);
    let joint = &commanded.joints[0];
    let coulomb_nm = value(joint, "coulomb_friction", "coulomb_nm");
    let viscous_nm_s_rad = value(joint, "viscous_friction", "viscous_nm_s_rad");
    assert!((coulomb_nm - 0.2).abs() < 0.03, "{coulomb_nm}");
    assert!((viscous_nm_s_rad - 0.1).abs() < 0.03, "{viscous_nm_s_rad}");
    let of_masses = ["rotor_inertia", "gravity_torque", "torque_constant_error"];
    let mut named = joint.effects.iter();
    assert!(named.all(|found| !of_masses.contains(&&*found.effect)));
}

#[test]
fn positions_alone_are_enough_where_the_controller_is_known() {
    let log = plain();
    let signals = vec![
        (Signal::ReferencePositionRad, log.reference_rad),
        (Signal::LinkPositionRad, log.position_rad),
    ];
    let report = told(&known_control(), recording(log.time_s, signals));
    is_told(&report);
    warns(&report, "the robot file states no limit");
    // 300 Nm/rad for half a row of 500 in a second
    let late = "half a row late, 1.0 ms, which looks like viscous friction of 0.300 Nm s/rad";
    assert!(finds(&report, "note", late), "{:?}", report.data);
}

#[test]
fn a_torque_that_is_mostly_faster_than_what_is_compared_has_a_note() {
    let faster = "of its torque is faster than 8 Hz, more than its gap is below";
    let told_with = |ripple_nm: f64| {
        let mut log = plain();
        for (torque_nm, time_s) in log.torque_nm.iter_mut().zip(&log.time_s) {
            *torque_nm += ripple_nm * (2.0 * std::f64::consts::PI * 40.0 * time_s).sin();
        }
        told(&robot(""), recording(log.time_s.clone(), as_recorded(log)))
    };
    let quiet = told_with(0.0);
    assert!(!finds(&quiet, "note", faster), "{:?}", quiet.data);
    let loud = told_with(10.0);
    is_told(&loud);
    assert!(finds(&loud, "note", faster), "{:?}", loud.data);
}

#[test]
fn a_controller_that_asks_for_more_than_its_drive_gives_does_not_count() {
    // the file's limit is a quarter too high
    let limit_nm = 10.0;
    let log = log_within(limit_nm, |_| 0.0, BEND_RAD);
    let time_s = log.time_s;
    let signals = vec![
        (Signal::ReferencePositionRad, log.reference_rad),
        (Signal::LinkPositionRad, log.position_rad),
    ];
    let told_with = |limit_nm: f64| {
        let of_file = format!("torque_limit_nm = {:?}\n{}", limit_nm / RATIO, control());
        told(&robot(&of_file), recording(time_s.clone(), signals.clone()))
    };
    let report = told_with(1.25 * limit_nm);
    is_told(&report);
    warns(&report, "asks for more than the drive's limit");
    // beyond it all the time
    let joint = &told_with(0.01).joints[0];
    assert_eq!(joint.verdict, Verdict::InsufficientData);
    assert!(
        joint.reason.contains("more than torque_limit_nm"),
        "{}",
        joint.reason
    );
}

#[test]
fn positions_alone_are_not_enough_without() {
    let log = plain();
    let signals = vec![
        (Signal::ReferencePositionRad, log.reference_rad),
        (Signal::LinkPositionRad, log.position_rad),
    ];
    let report = told(&robot(""), recording(log.time_s, signals));
    assert_eq!(report.joints[0].verdict, Verdict::InsufficientData);
    assert!(
        report.joints[0].reason.contains("[control]"),
        "{}",
        report.joints[0].reason
    );
}

#[test]
fn friction_stays_named_beside_a_law_on_no_list() {
    let log = log(|since_s| 2.0 * (1.0 - (-since_s / 0.4).exp()), BEND_RAD);
    let report = told(&robot(""), recording(log.time_s.clone(), as_recorded(log)));
    let joint = &report.joints[0];
    assert_eq!(joint.verdict, Verdict::PartlyExplained);
    let names: Vec<&str> = joint.effects.iter().map(|e| e.effect.as_str()).collect();
    assert_eq!(names.len(), 2, "{names:?}");
    assert!(
        names.contains(&"coulomb_friction") && names.contains(&"viscous_friction"),
        "{names:?}"
    );
    assert_eq!(joint.remaining, Remaining::Structured);
    let over = joint.remaining_over.first().map(|over| over.over);
    assert_eq!(over, Some(Remains::SinceReversal));
}

#[test]
fn without_a_gap_nothing_is_named() {
    let log = plain();
    let time_s = log.time_s.clone();
    let file = "effects = [\n  { effect = \"coulomb_friction\", coulomb_nm = 3.0 },\n  { effect = \"viscous_friction\", \
                viscous_nm_s_rad = 2.0 },\n]\n";
    let report = told(&robot(file), recording(time_s, as_recorded(log)));
    let joint = &report.joints[0];
    assert_eq!(joint.verdict, Verdict::NoGap, "{:?}", joint.effects);
}

/// The log with a second's rest wherever the joint turns, in which the torque goes from one side of what holds the joint to the other.
fn stopping(log: &Log) -> Log {
    const REST: usize = RATE_HZ as usize;
    let mut all = Log {
        time_s: Vec::new(),
        reference_rad: Vec::new(),
        position_rad: Vec::new(),
        velocity_rad_s: Vec::new(),
        torque_nm: Vec::new(),
        friction_nm: Vec::new(),
    };
    let mut add = |k: usize, rest: Option<f64>| {
        let rad = log.position_rad[k];
        let weight_nm = 2.0 * 9.81 * 0.25 * rad.sin();
        all.time_s.push(all.time_s.len() as f64 / RATE_HZ);
        all.reference_rad.push(log.reference_rad[k]);
        all.position_rad.push(rad);
        let moving = rest.is_none().then_some(log.velocity_rad_s[k]);
        all.velocity_rad_s.push(moving.unwrap_or(0.0));
        let torque_nm = rest.map(|part| weight_nm + 2.8 * part);
        all.torque_nm.push(torque_nm.unwrap_or(log.torque_nm[k]));
        all.friction_nm.push(log.friction_nm[k]);
    };
    for k in 0..log.time_s.len() {
        add(k, None);
        let next = log.velocity_rad_s.get(k + 1).copied().unwrap_or(0.0);
        if log.velocity_rad_s[k] * next < 0.0 {
            let side = log.velocity_rad_s[k].signum();
            for row in 0..REST {
                add(k, Some(side * (1.0 - 2.0 * row as f64 / REST as f64)));
            }
        }
    }
    all
}

#[test]
fn a_joint_at_rest_says_nothing_of_its_friction() {
    let log = stopping(&plain());
    assert!(log.time_s.len() > 2 * plain().time_s.len());
    let report = told(&robot(""), recording(log.time_s.clone(), as_recorded(log)));
    let joint = &report.joints[0];
    assert_eq!(joint.effects.len(), 2, "{:?}", joint.effects);
    let coulomb_nm = value(joint, "coulomb_friction", "coulomb_nm");
    let viscous = value(joint, "viscous_friction", "viscous_nm_s_rad");
    assert!((2.8..3.2).contains(&coulomb_nm), "{coulomb_nm}");
    assert!((1.8..2.2).contains(&viscous), "{viscous}");
    assert!(joint.remaining_share < 0.02, "{}", joint.remaining_share);
}

#[test]
fn a_gap_that_depends_on_nothing_is_no_agreement() {
    let log = plain();
    let time_s = log.time_s.clone();
    let file = "effects = [\n  { effect = \"coulomb_friction\", coulomb_nm = 3.0 },\n  { effect = \"viscous_friction\", \
                viscous_nm_s_rad = 2.0 },\n]\n";
    let mut signals = as_recorded(log);
    let (mut seed, mut more_nm) = (11, 0.0);
    for (row, nm) in signals[3].1.iter_mut().enumerate() {
        if row % 40 == 0 {
            more_nm = 3.0 * noise(&mut seed);
        }
        *nm += more_nm / RATIO;
    }
    let report = told(&robot(file), recording(time_s, signals));
    let joint = &report.joints[0];
    assert_eq!(joint.verdict, Verdict::Unexplained, "{:?}", joint.effects);
}
