//! Table V from synthetic sweeps whose law is known.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod slow_sweeps;

use identification::stiffness::{DirectionFit, LoadTorqueFit, StiffnessFit, fit_stiffness};
use identification::{IdentificationError, Payload, Sweep};
use joint_model::friction::LoadTorqueRow;
use joint_model::rigid_body::Chain;
use nalgebra::Isometry3;
use proptest::prelude::*;
use recording::{Recording, Signal};
use robot::{Effect, LoadTorqueTable, Robot};
use slow_sweeps::{Plant, path_rad};

const JOINT: usize = 1;
const PAYLOADS_KG: [f64; 3] = [0.0, 2.3, 4.5];
const FLANGE_M: [f64; 3] = [0.0, 0.0, 0.05];

/// What is known before: friction without load. The truth has Table V on top.
fn known(robot: &Robot) -> Robot {
    let mut robot = robot.clone();
    robot.joints[JOINT].load_torque = None;
    robot
}

/// Robot, but its second joint keeps enough Coulomb friction that no load drives it: the law itself is what is seen.
fn arm() -> Robot {
    let mut robot = robot::load("pa10").unwrap();
    let friction = robot.joints[JOINT].direction_friction.as_mut().unwrap();
    friction.positive.f0_nm = 120.0;
    friction.negative.f0_nm = 120.0;
    robot
}

/// Joint 2 from -90° to 90° and back with these payloads.
fn sweeps(robot: &Robot, payloads_kg: &[f64], noise_nm: f64) -> Vec<(Recording, Payload)> {
    let sweep = |(seed, mass_kg): (usize, &f64)| {
        let mut plant = Plant::of(robot, noise_nm);
        plant.chain = with_payload(robot, *mass_kg);
        let at = |angle_rad: f64| {
            let mut pose_rad = vec![0.0; robot.joints.len()];
            pose_rad[JOINT] = angle_rad;
            pose_rad
        };
        let path = path_rad(&[at(-1.57), at(1.57), at(-1.57)], 0.02);
        let payload = Payload {
            mass_kg: *mass_kg,
            centre_m: FLANGE_M,
        };
        (plant.record(&path, seed as u64), payload)
    };
    payloads_kg.iter().enumerate().map(sweep).collect()
}

fn with_payload(robot: &Robot, mass_kg: f64) -> Chain {
    let mut links = robot.chain.links().to_vec();
    let last = links.last_mut().unwrap();
    let total_kg = last.mass_kg + mass_kg;
    last.centre_of_mass_m = (last.centre_of_mass_m * last.mass_kg
        + nalgebra::Vector3::from(FLANGE_M) * mass_kg)
        / total_kg;
    last.mass_kg = total_kg;
    Chain::new(&links, robot.chain.gravity_m_s2(), Isometry3::identity()).unwrap()
}

fn fit(
    recorded: &[(Recording, Payload)],
    robot: &Robot,
) -> Result<StiffnessFit, IdentificationError> {
    let sweeps: Vec<Sweep> = recorded
        .iter()
        .map(|(recording, payload)| Sweep {
            recording,
            payload: *payload,
        })
        .collect();
    fit_stiffness(&sweeps, robot, &robot.joints[JOINT].name)
}

fn assert_near(what: &str, found: identification::Estimate, truth: f64) {
    let errors = (found.value - truth).abs() / found.standard_error;
    assert!(
        errors < 4.0,
        "{what}: {found:?} instead of {truth}, {errors:.1} standard errors"
    );
}

fn assert_law(fit: &LoadTorqueFit, truth: &robot::LoadTorqueRow) {
    assert_eq!(fit.regions(), 3, "{:?}", fit.candidates);
    for (slope, truth) in fit.slopes.iter().zip(truth.slopes) {
        assert_near("slope", *slope, truth);
        assert!(
            slope.standard_error < 0.1,
            "{slope:?} {} {} {}",
            fit.correlated_samples,
            fit.samples,
            fit.residual_rms_nm
        );
    }
    for (knee, truth) in fit.knees.iter().zip(truth.knees_nm) {
        assert_near("knee", knee.gravity_nm, truth);
        assert!(!knee.at_bound);
    }
    // The model takes the law's change against zero load.
    assert_near("zero load", fit.zero_load_nm, 0.0);
}

#[test]
fn finds_the_table_the_sweeps_were_made_with() {
    let robot = arm();
    let truth = robot.joints[JOINT].load_torque.unwrap();
    let fit = fit(&sweeps(&robot, &PAYLOADS_KG, 1.0), &known(&robot)).unwrap();
    assert_law(&fit.positive.law, &truth.positive);
    assert_law(&fit.negative.law, &truth.negative);
    let table = fit.table();
    assert!((table.positive.knees_nm[0] - truth.positive.knees_nm[0]).abs() < 0.5);
    assert!((table.negative.slopes[1] - truth.negative.slopes[1]).abs() < 0.1);
}

#[test]
fn each_step_takes_off_one_term_of_equation_5() {
    let mut robot = arm();
    robot.joints[JOINT]
        .effects
        .push(Effect::PositionDependentFriction {
            amplitude_nm: 6.0,
            cycles_per_motor_rev: 6.0,
            phase_rad: -1.5,
        });
    let fit = fit(&sweeps(&robot, &PAYLOADS_KG, 0.0), &known(&robot)).unwrap();
    let law = robot.joints[JOINT].steady_friction().load_torque.unwrap();
    let check = |direction: &DirectionFit, row: &LoadTorqueRow, sign: f64| {
        assert_eq!(direction.steps.len(), 3);
        for steps in &direction.steps {
            assert!(steps.position_rad.len() > 1000);
            for index in 0..steps.position_rad.len() {
                let gravity_nm = steps.gravity_nm[index];
                let expected_nm = row.torque_nm(gravity_nm) - row.zero_load_nm;
                assert!(
                    (steps.load_torque_nm[index] - expected_nm).abs() < 0.15,
                    "{} at {} Nm {} rad: {} {expected_nm}",
                    sign,
                    gravity_nm,
                    steps.position_rad[index],
                    steps.load_torque_nm[index]
                );
                let rest_nm = steps.without_friction_nm[index] - gravity_nm;
                assert!((sign * rest_nm - steps.load_torque_nm[index]).abs() < 1e-9);
                let speed_part_nm = sign
                    * (steps.without_position_friction_nm[index]
                        - steps.without_friction_nm[index]);
                assert!(speed_part_nm > 120.0 && speed_part_nm < 130.0);
                let angle_part_nm =
                    steps.total_nm[index] - steps.without_position_friction_nm[index];
                assert!(angle_part_nm.abs() < 6.0 + 1e-9);
            }
        }
    };
    check(&fit.positive, &law.positive, 1.0);
    check(&fit.negative, &law.negative, -1.0);
    let low_rad = fit.positive.steps[0].position_rad[0];
    assert!(
        low_rad < -1.5,
        "after settling the sweep is there from {low_rad} rad on"
    );
}

#[test]
fn the_fitted_law_is_continuous() {
    let robot = arm();
    let fit = fit(&sweeps(&robot, &PAYLOADS_KG, 2.0), &known(&robot)).unwrap();
    for law in [&fit.positive.law, &fit.negative.law] {
        for knee in &law.knees {
            let at_nm = knee.gravity_nm.value;
            let jump_nm = law.torque_nm(at_nm + 1e-9) - law.torque_nm(at_nm - 1e-9);
            assert!(jump_nm.abs() < 1e-6);
        }
        assert!((law.torque_nm(0.0) - law.zero_load_nm.value).abs() < 1e-9);
    }
}

#[test]
fn keeps_one_region_where_load_changes_nothing() {
    let robot = known(&arm());
    let fit = fit(&sweeps(&robot, &PAYLOADS_KG, 1.0), &robot).unwrap();
    for law in [&fit.positive.law, &fit.negative.law] {
        assert_eq!(law.regions(), 1, "{:?}", law.candidates);
        assert_eq!(law.candidates.len(), 3);
        assert_near("slope", law.slopes[0], 0.0);
        let row = law.row();
        assert_eq!(row.slopes, [law.slopes[0].value; 3]);
        assert!(row.knees_nm[0] < row.knees_nm[1]);
    }
}

#[test]
fn a_knee_beyond_the_data_is_not_invented() {
    let mut robot = arm();
    let table = robot.joints[JOINT].load_torque.as_mut().unwrap();
    // The bare arm's gravity torque stays within 70 Nm.
    *table = LoadTorqueTable {
        positive: robot::LoadTorqueRow {
            slopes: [0.3, 2.6, 0.2],
            knees_nm: [-200.0, -20.0],
            zero_load_nm: 0.0,
        },
        negative: table.negative,
    };
    robot.joints[JOINT]
        .direction_friction
        .as_mut()
        .unwrap()
        .positive
        .f0_nm = 500.0;
    let fit = fit(&sweeps(&robot, &[0.0], 1.0), &known(&robot)).unwrap();
    let law = &fit.positive.law;
    assert_eq!(law.regions(), 2, "{:?}", law.candidates);
    assert_near("knee", law.knees[0].gravity_nm, -20.0);
    assert_near("slope", law.slopes[0], 2.6);
    assert_near("slope", law.slopes[1], 0.2);
    assert_eq!(law.row().slopes[1], law.row().slopes[2]);
}

#[test]
fn standard_errors_tell_the_scatter_of_repeated_measurements() {
    let robot = arm();
    let truth = robot.joints[JOINT].load_torque.unwrap().positive;
    let plant = |seed: u64| {
        let mut plant = Plant::of(&robot, 3.0);
        plant.chain = with_payload(&robot, 2.3);
        let at = |angle_rad: f64| vec![0.0, angle_rad, 0.0, 0.0, 0.0, 0.0, 0.0];
        let path = path_rad(&[at(-1.57), at(1.57), at(-1.57)], 0.05);
        plant.record(&path, seed)
    };
    let payload = Payload {
        mass_kg: 2.3,
        centre_m: FLANGE_M,
    };
    let errors: Vec<f64> = (0..30)
        .map(|seed| {
            let recording = plant(seed);
            let fit = fit(&[(recording, payload)], &known(&robot)).unwrap();
            let knee = fit.positive.law.knees[0].gravity_nm;
            (knee.value - truth.knees_nm[0]) / knee.standard_error
        })
        .collect();
    let rms = (errors.iter().map(|error| error * error).sum::<f64>() / 30.0).sqrt();
    assert!((0.6..1.5).contains(&rms), "{rms}: {errors:?}");
}

#[test]
fn errors_name_joint_and_signal() {
    let robot = arm();
    let good = sweeps(&robot, &[0.0], 1.0);
    let spoilt = |spoil: &dyn Fn(&mut Recording)| {
        let mut recorded = good.clone();
        spoil(&mut recorded[0].0);
        fit(&recorded, &known(&robot)).unwrap_err().to_string()
    };
    let column = |recording: &mut Recording, signal, change: &dyn Fn(f64) -> f64| {
        let values = recording.joints[JOINT].signals.get_mut(&signal).unwrap();
        values.iter_mut().for_each(|value| *value = change(*value));
    };
    let missing = spoilt(&|recording| {
        recording.joints[JOINT]
            .signals
            .remove(&Signal::MotorTorqueNm);
    });
    assert!(
        missing.contains("motor_torque_nm") && missing.contains("joint2"),
        "{missing}"
    );
    let empty = spoilt(&|recording| column(recording, Signal::MotorTorqueNm, &|_| f64::NAN));
    assert!(empty.contains("motor_torque_nm is missing in"), "{empty}");
    let still = spoilt(&|recording| column(recording, Signal::MotorPositionRad, &|_| 0.1));
    assert!(
        still.contains("joint `joint2` never moved: motor_position_rad"),
        "{still}"
    );
    let reversed = spoilt(&|recording| column(recording, Signal::MotorTorqueNm, &|nm| -nm));
    assert!(
        reversed.contains("motor_torque_nm has the wrong sign"),
        "{reversed}"
    );
    let short = spoilt(&|recording| {
        recording.time_s.truncate(10);
        for joint in &mut recording.joints {
            joint
                .signals
                .values_mut()
                .for_each(|values| values.truncate(10));
        }
    });
    assert!(short.contains("joint2"), "{short}");
    let unknown = fit_stiffness(&[], &robot, "elbow").unwrap_err().to_string();
    assert!(unknown.contains("no joint `elbow`"), "{unknown}");
    assert!(fit(&[], &robot).unwrap_err().to_string().contains("joint2"));
}

#[test]
fn a_joint_that_gravity_does_not_load_is_refused() {
    let robot = arm();
    let at = |angle_rad: f64| vec![angle_rad, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0];
    let path = path_rad(&[at(-1.0), at(1.0), at(-1.0)], 0.05);
    let recording = Plant::of(&robot, 1.0).record(&path, 1);
    let sweep = Sweep {
        recording: &recording,
        payload: Payload::default(),
    };
    let error = fit_stiffness(&[sweep], &known(&robot), "joint1").unwrap_err();
    assert!(
        matches!(&error, IdentificationError::SmallGravityRange { joint, .. } if joint == "joint1"),
        "{error}"
    );
}

#[test]
fn the_payload_is_read_from_the_recording_or_missed() {
    let mut recording = sweeps(&arm(), &[0.0], 0.0).remove(0).0;
    assert!(matches!(
        Payload::of(&recording),
        Err(IdentificationError::PayloadMissing { .. })
    ));
    recording.metadata.insert("payload_kg".into(), "2.3".into());
    let error = Payload::of(&recording).unwrap_err().to_string();
    assert!(error.contains("payload_centre_m"), "{error}");
    recording
        .metadata
        .insert("payload_centre_m".into(), "0, 0, 0.05".into());
    let payload = Payload {
        mass_kg: 2.3,
        centre_m: FLANGE_M,
    };
    assert_eq!(Payload::of(&recording).unwrap(), payload);
    recording
        .metadata
        .insert("payload_kg".into(), "heavy".into());
    assert!(
        Payload::of(&recording)
            .unwrap_err()
            .to_string()
            .contains("heavy")
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn garbage_is_an_error_or_a_fit_but_never_a_panic(
        rows in prop::collection::vec((any::<f64>(), any::<f64>(), any::<f64>()), 0..200),
        tame in any::<bool>(),
        mass_kg in any::<f64>(),
    ) {
        let robot = known(&arm());
        let mut recording = Plant::of(&arm(), 0.0).record(&[vec![0.0; 7], vec![0.0; 7]], 1);
        let pick = |value: f64, scale: f64| if tame { (value % 1.0) * scale } else { value };
        recording.time_s = rows.iter().enumerate()
            .map(|(row, (time, _, _))| if tame { row as f64 * 0.01 } else { *time }).collect();
        for joint in &mut recording.joints {
            joint.signals = [
                (Signal::MotorPositionRad, rows.iter().map(|(_, rad, _)| pick(*rad, 10.0)).collect()),
                (Signal::MotorTorqueNm, rows.iter().map(|(_, _, nm)| pick(*nm, 1.0)).collect()),
            ].into();
        }
        let payload = Payload { mass_kg, centre_m: [0.0; 3] };
        let _ = fit(&[(recording, payload)], &robot);
    }
}
