//! What any arm with friction owes to physics, and this one to its tables.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod common;

use common::{PERIOD_S, braked, damping, released, run, torque, velocity};
use plant_emulator::{DriveState, Plant, PlantParameters};
use robot::{Robot, TableOver, TorqueTable};

/// A bent pose in which gravity acts on joints 2 to 6.
const BENT_RAD: [f64; 7] = [0.1, 0.7, -0.4, 0.9, 0.3, 0.6, -0.2];

fn pa10(seed: u64, position_rad: &[f64]) -> Plant {
    let robot = robot::load("pa10").unwrap();
    let parameters = PlantParameters::for_robot(&robot).unwrap();
    Plant::new(&robot, &parameters, &[], seed, position_rad, PERIOD_S).unwrap()
}

fn shd17(seed: u64, position_rad: f64) -> Plant {
    let robot = robot::load("shd17").unwrap();
    let parameters = PlantParameters::for_robot(&robot).unwrap();
    Plant::new(&robot, &parameters, &[], seed, &[position_rad], PERIOD_S).unwrap()
}

/// Position-dependent friction averages out over motor revolutions; the other tests want the curve alone.
fn exact(robot: &Robot) -> PlantParameters {
    PlantParameters {
        parameter_deviation: 0.0,
        ..PlantParameters::for_robot(robot).unwrap()
    }
}

#[test]
fn energy_is_never_created_without_input() {
    for mut plant in [pa10(1, &BENT_RAD), shd17(1, 2.5)] {
        let mut least_j = plant.truth().mechanical_energy_j;
        let start_j = least_j;
        for _ in 0..3000 {
            plant.step(&released());
            let energy_j = plant.truth().mechanical_energy_j;
            // the current of the holding torque dies away within a few periods; semi-implicit steps wobble a little
            let wobble_j = 2e-3 * (start_j - least_j).abs() + 0.02;
            assert!(
                energy_j < least_j + wobble_j,
                "{energy_j} J after {least_j} J at {} s",
                plant.time_s()
            );
            least_j = least_j.min(energy_j);
        }
        assert!(
            least_j < start_j - 0.5,
            "it fell, so energy went into friction: {start_j} to {least_j}"
        );
    }
}

#[test]
fn a_held_arm_stays_where_it_is() {
    let mut plant = pa10(2, &BENT_RAD);
    run(&mut plant, &torque_not_fresh(), 1500);
    let truth = plant.truth();
    for (joint, start_rad) in BENT_RAD.iter().enumerate() {
        assert!((truth.link_position_rad[joint] - start_rad).abs() < 1e-9);
        assert_eq!(plant.sample().drive[joint], DriveState::Holding);
    }
}

fn torque_not_fresh() -> plant_emulator::PlantCommand {
    plant_emulator::PlantCommand {
        fresh: false,
        ..braked()
    }
}

#[test]
fn the_torque_it_is_held_with_goes_on_holding_it() {
    let mut plant = pa10(3, &BENT_RAD);
    let holding_nm = plant.sample().motor_torque_nm;
    run(&mut plant, &torque(&holding_nm[..7]), 1500);
    let truth = plant.truth();
    for (joint, start_rad) in BENT_RAD.iter().enumerate() {
        let moved_rad = (truth.link_position_rad[joint] - start_rad).abs();
        assert!(moved_rad < 3e-5, "joint {joint} moved {moved_rad} rad");
        assert!(truth.link_velocity_rad_s[joint].abs() < 1e-4);
    }
}

#[test]
fn a_torque_table_is_held_at_rest_and_drags_in_motion() {
    const AT_RAD: f64 = 0.3;
    let table = |over, torque_nm: [f64; 2]| TorqueTable {
        over,
        at: vec![-1.0, 1.0],
        torque_nm: torque_nm.to_vec(),
    };
    let mean_nm = |tables: Vec<TorqueTable>, velocity_rad_s: f64| {
        let mut robot = robot::load("shd17").unwrap();
        robot.joints[0].torque_tables = tables;
        let parameters = exact(&robot);
        let mut plant = Plant::new(&robot, &parameters, &[], 1, &[AT_RAD], PERIOD_S).unwrap();
        run(&mut plant, &velocity(&[velocity_rad_s]), 750);
        let torques_nm = (0..750).map(|_| {
            plant.step(&velocity(&[velocity_rad_s]));
            robot.joints[0].gear_ratio * plant.sample().motor_torque_nm[0]
        });
        torques_nm.sum::<f64>() / 750.0
    };
    let added_nm = |table: TorqueTable, velocity_rad_s: f64| {
        mean_nm(vec![table], velocity_rad_s) - mean_nm(Vec::new(), velocity_rad_s)
    };
    let held_nm = added_nm(table(TableOver::Position, [4.0, 4.0]), 0.0);
    assert!((held_nm - 4.0).abs() < 0.2, "{held_nm}");
    for velocity_rad_s in [-0.5, 0.5] {
        let dragged_nm = added_nm(table(TableOver::Velocity, [-2.0, 6.0]), velocity_rad_s);
        let expected_nm = 2.0 + 4.0 * velocity_rad_s;
        assert!((dragged_nm - expected_nm).abs() < 0.2, "{dragged_nm}");
    }
}

#[test]
fn a_pendulum_let_go_comes_to_rest_below() {
    let mut plant = shd17(4, 2.0);
    run(&mut plant, &released(), 15_000);
    let truth = plant.truth();
    assert!(
        truth.link_velocity_rad_s[0].abs() < 1e-4,
        "{} rad/s",
        truth.link_velocity_rad_s[0]
    );
    // friction of about 2.6 Nm against 6.7 Nm of gravity stops it somewhere on the way down
    assert!(truth.link_position_rad[0].abs() < 1.0);
}

#[test]
fn static_friction_holds_below_breakaway_and_not_above() {
    for (share, moves) in [(0.6, false), (1.5, true)] {
        let mut plant = pa10(5, &[0.0; 7]);
        // joint 1 has no gravity; its friction at rest is 35 to 37 Nm and varies by ±12.55 Nm with the motor angle
        let breakaway_nm = if moves { 36.0 + 12.55 } else { 35.0 - 12.55 };
        run(&mut plant, &torque(&[share * breakaway_nm / 50.0]), 1500);
        let moved_rad = plant.truth().link_position_rad[0].abs();
        assert_eq!(
            moved_rad > 5e-3,
            moves,
            "moved {moved_rad} rad under {share} of breakaway"
        );
    }
}

#[test]
fn damping_stops_a_moving_joint() {
    let mut plant = pa10(6, &[0.0; 7]);
    run(&mut plant, &velocity(&[0.3, 0.0, 0.0, 0.0, 0.3]), 750);
    assert!(plant.truth().link_velocity_rad_s[0] > 0.2);
    run(&mut plant, &damping(), 1500);
    assert!(plant.truth().link_velocity_rad_s[0].abs() < 1e-3);
    assert!(plant.truth().link_velocity_rad_s[4].abs() < 1e-3);
}

#[test]
fn silence_trips_the_watchdog_and_the_arm_comes_to_rest() {
    let mut plant = pa10(7, &[0.0; 7]);
    run(&mut plant, &velocity(&[0.3]), 750);
    run(&mut plant, &torque_not_fresh(), 1500);
    assert!(matches!(
        plant.sample().drive[0],
        DriveState::Watchdog { missed_cycles: 15 }
    ));
    assert!(plant.truth().link_velocity_rad_s[0].abs() < 1e-3);
}

/// PA10-05 Table II: F0, Fv, Fs, Vc of both directions, as printed.
const TABLE_II: [[f64; 8]; 7] = [
    [
        34.9647, 29.7153, 2.8103, 0.3376, 36.7050, 26.4796, -2.2885, -0.6172,
    ],
    [
        39.9709, 35.3200, 6.2713, 0.0685, 41.3113, 35.8947, -5.9018, -0.0709,
    ],
    [
        18.3053, 17.6413, 2.2282, 0.0430, 18.7327, 17.8371, -2.7240, -0.0405,
    ],
    [
        30.4416, 28.5552, 19.7181, 0.3278, 30.6897, 29.4670, -21.7854, -0.3676,
    ],
    [
        3.7145, 0.7493, 1.0792, 0.0386, 4.1271, 0.7919, -1.3756, -0.0393,
    ],
    [
        5.5090, 0.5859, 0.9983, 0.0126, 5.7954, 0.5711, -0.9967, -0.0135,
    ],
    [
        2.2980, 0.6062, -1.1803, 0.0759, 2.3027, 0.6836, 1.1470, -0.0690,
    ],
];

fn table_ii_nm(joint: usize, velocity_rad_s: f64) -> f64 {
    let [f0p, fvp, fsp, vcp, f0n, fvn, fsn, vcn] = TABLE_II[joint];
    let (f0, fv, fs, vc) = if velocity_rad_s > 0.0 {
        (f0p, fvp, fsp, vcp)
    } else {
        (f0n, fvn, fsn, vcn)
    };
    f0 * velocity_rad_s.signum() + fv * velocity_rad_s + fs * (1.0 - (-velocity_rad_s / vc).exp())
}

/// Mean reported torque, joint side, over whole motor revolutions at constant velocity without gravity.
fn mean_torque_nm(joint: usize, velocity_rad_s: f64) -> f64 {
    const REVOLUTION_RAD: f64 = core::f64::consts::TAU / 50.0;
    let mut robot = robot::load("pa10").unwrap();
    robot.chain.set_gravity(nalgebra::Vector3::zeros()).unwrap();
    let mut plant = Plant::new(&robot, &exact(&robot), &[], 8, &[0.0; 7], PERIOD_S).unwrap();
    let mut command = [0.0; 7];
    command[joint] = velocity_rad_s;
    let per_revolution = REVOLUTION_RAD / velocity_rad_s.abs() / PERIOD_S;
    run(
        &mut plant,
        &velocity(&command),
        1500 + per_revolution as usize,
    );
    let periods = (2.0 * per_revolution).round() as usize;
    let sum_nm: f64 = (0..periods)
        .map(|_| plant.step(&velocity(&command)).motor_torque_nm[joint])
        .sum();
    50.0 * sum_nm / periods as f64
}

#[test]
fn friction_at_constant_velocity_is_table_ii() {
    let of_joint = |joint: usize| {
        for velocity_rad_s in [0.04, -0.04, 0.1, -0.1, 0.4] {
            let (found_nm, table_nm) = (
                mean_torque_nm(joint, velocity_rad_s),
                table_ii_nm(joint, velocity_rad_s),
            );
            let error = found_nm / table_nm - 1.0;
            assert!(
                error.abs() < 0.03,
                "joint {}, {velocity_rad_s} rad/s: {found_nm:.3} Nm, Table II {table_nm:.3} Nm",
                joint + 1
            );
        }
    };
    // one after the other they would be what the other tests wait for
    std::thread::scope(|scope| {
        for joint in 0..7 {
            scope.spawn(move || of_joint(joint));
        }
    });
}

#[test]
fn friction_never_drives() {
    let mut plant = pa10(9, &BENT_RAD);
    let mut command = [0.0; 7];
    for k in 0..6000 {
        let swing = 0.3 * (f64::from(k) * PERIOD_S * 3.0).sin();
        command.fill(swing);
        plant.step(&velocity(&command));
        let truth = plant.truth();
        for joint in 0..7 {
            let power_w =
                truth.friction_torque_nm[joint] * truth.motor_velocity_rad_s[joint] / 50.0;
            // bent bristles give back what they hold within their deflection, and no more
            let sliding = truth.motor_velocity_rad_s[joint].abs() / 50.0 > 0.05;
            assert!(!sliding || power_w > -0.3, "joint {joint}: {power_w} W");
        }
    }
}

#[test]
fn an_overrunning_load_eases_the_motion() {
    // joint 2 stretched out forwards at 1.2 rad: lifting against gravity and lowering with it, 0.05 rad/s
    let friction_nm = |velocity_rad_s: f64| {
        let mut plant = pa10(10, &[0.0, 0.9, 0.0, 0.0, 0.0, 0.0, 0.0]);
        run(&mut plant, &velocity(&[0.0, velocity_rad_s]), 3000);
        let means = (0..3000).map(|_| {
            plant.step(&velocity(&[0.0, velocity_rad_s]));
            plant.truth().friction_torque_nm[1]
        });
        (means.sum::<f64>() / 3000.0).abs()
    };
    let (lowering_nm, lifting_nm) = (friction_nm(0.05), friction_nm(-0.05));
    assert!(
        lowering_nm < 0.4 * lifting_nm,
        "lowering {lowering_nm} Nm, lifting {lifting_nm} Nm"
    );
}

#[test]
fn equal_seeds_give_equal_bits_and_others_do_not() {
    let recording = |seed: u64| {
        let mut plant = pa10(seed, &BENT_RAD);
        let samples = (0..600).flat_map(|k| {
            let sample = plant.step(&velocity(&[
                0.1 * f64::from(k % 7),
                -0.05,
                0.1,
                0.0,
                0.2,
                -0.2,
                0.3,
            ]));
            let truth = plant.truth();
            (0..7).flat_map(move |joint| {
                [
                    sample.motor_position_rad[joint].to_bits(),
                    sample.motor_torque_nm[joint].to_bits(),
                    truth.joint_torque_nm[joint].to_bits(),
                ]
            })
        });
        samples.collect::<Vec<u64>>()
    };
    assert_eq!(recording(11), recording(11));
    assert_ne!(recording(11), recording(12));
}

#[test]
fn absent_sensors_are_nan_and_present_ones_are_not() {
    let arm = pa10(1, &[0.0; 7]).sample();
    assert!(arm.link_position_rad[0].is_nan() && arm.joint_torque_nm[0].is_nan());
    assert!(arm.motor_velocity_rad_s[0].is_nan() && arm.motor_position_rad[7].is_nan());
    let bench = shd17(1, 0.5).sample();
    assert!((bench.link_position_rad[0] - 0.5).abs() < 1e-5);
    assert!((bench.joint_torque_nm[0] - 1.841 * 9.81 * 0.3717 * 0.5_f64.sin()).abs() < 0.5);
}
