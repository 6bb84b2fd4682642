//! What the papers print, against the robot file that is built from it.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::f64::consts::TAU;

use joint_model::friction::cycles_per_motor_rev;
use joint_model::rigid_body::PublishedGravity;
use robot::published::{FrictionModelScores, Published, papers};
use robot::{load, published};

fn pa10_2005() -> Published {
    published("pa10-2005").unwrap()
}

#[test]
fn every_paper_loads() {
    for name in papers() {
        let paper = published(name).unwrap();
        assert!(name.ends_with(&paper.year.to_string()));
        assert!(paper.friction_experiment.velocities_rad_s.is_sorted());
        assert!(paper.stiffness_experiment.weights_kg.is_sorted());
    }
}

#[test]
fn a_paper_that_is_not_there_is_looked_for_among_those_that_are() {
    let message = published("pa10-2006").unwrap_err().to_string();
    assert!(message.contains("unknown paper `pa10-2006`"), "{message}");
    assert!(message.contains("did you mean `pa10-200"), "{message}");
}

#[test]
fn the_robot_file_has_tables_ii_and_v() {
    let (paper, robot) = (pa10_2005(), load("pa10").unwrap());
    assert_eq!(paper.joints.len(), robot.joints.len());
    for joint in &robot.joints {
        let tables = paper.joint(&joint.name).unwrap();
        assert_eq!(Some(tables.table_ii), joint.direction_friction);
        assert_eq!(tables.table_v, joint.load_torque);
    }
}

#[test]
fn the_robot_file_has_the_gear_ratio_and_the_sensors() {
    let (drive, robot) = (pa10_2005().drive, load("pa10").unwrap());
    for joint in &robot.joints {
        assert_eq!(joint.gear_ratio, drive.gear_ratio);
        let step_rad = joint.motor_encoder_resolution_rad.unwrap() / joint.gear_ratio;
        assert!((step_rad / drive.joint_resolution_rad - 1.0).abs() < 1e-3);
    }
    let control = robot.control.unwrap();
    assert_eq!(control.velocity_filter_hz, drive.velocity_filter_hz);
    assert_eq!(control.velocity_filter_order, drive.velocity_filter_order);
}

#[test]
fn the_robot_files_gains_are_the_printed_ones_at_the_joint() {
    let (paper, robot) = (pa10_2005(), load("pa10").unwrap());
    let control = robot.control.as_ref().unwrap();
    let trapezoid = &paper.trapezoids[0];
    for (index, joint) in robot.joints.iter().enumerate() {
        // joint 3 was locked for Table VI
        let printed = match paper.joint(&joint.name).unwrap().table_vi {
            Some(gains) => (gains.proportional_nm_rad, gains.derivative_nm_s_rad),
            None => {
                assert_eq!(joint.name, trapezoid.joint);
                (trapezoid.proportional_nm_rad, trapezoid.derivative_nm_s_rad)
            }
        };
        let ratio = paper.drive.gear_ratio;
        let (proportional, derivative) = (
            control.proportional_nm_rad[index],
            control.derivative_nm_s_rad[index],
        );
        assert_eq!((proportional / ratio, derivative / ratio), printed);
    }
}

#[test]
fn the_frequencies_of_table_iii_are_whole_cycles_of_the_wave_generator() {
    let paper = pa10_2005();
    let per_revolution = paper.drive.gear_ratio / TAU;
    for joint in &paper.joints {
        for harmonic in joint.table_iii {
            let f = harmonic.cycles_per_joint_rad;
            let cycles = f / per_revolution;
            let off = cycles / cycles.round() - 1.0;
            assert!(off.abs() < 0.01, "{}: {f} is {cycles} cycles", joint.name);
            let by_model = cycles_per_motor_rev(f, paper.drive.gear_ratio);
            assert!((by_model - cycles).abs() < 1e-9);
        }
    }
}

#[test]
fn table_i_has_a_winner_per_joint_and_no_model_wins_everywhere() {
    let best = |scores: &FrictionModelScores| {
        let [viscous, cubic, stribeck] =
            [scores.viscous, scores.cubic, scores.stribeck].map(|score| score.mse_per_dof);
        assert!(cubic < viscous && stribeck < viscous);
        if cubic < stribeck {
            "cubic"
        } else {
            "stribeck"
        }
    };
    let winners: Vec<_> = pa10_2005()
        .joints
        .iter()
        .map(|joint| best(&joint.table_i))
        .collect();
    assert!(winners.contains(&"cubic") && winners.contains(&"stribeck"));
}

#[test]
fn table_iv_is_what_the_gravity_equations_take() {
    let gravity = PublishedGravity::from(pa10_2005().gravity.unwrap());
    let expected_nm = gravity.g_m_s2 * 9.86 * 0.32;
    assert!((gravity.torque_nm(&[0.0; 7])[1] - expected_nm).abs() < 1e-9);
}

#[test]
fn the_friction_experiment_is_80_measurements_a_joint() {
    let experiment = pa10_2005().friction_experiment;
    let speeds = experiment.velocities_rad_s.len();
    assert_eq!(2 * speeds * experiment.trials.unwrap() as usize, 80);
}
