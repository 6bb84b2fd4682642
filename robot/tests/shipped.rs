//! The robots that come with the program.
#![allow(clippy::unwrap_used, reason = "a test may")]

use joint_model::rigid_body::Chain;
use robot::{ControlKind, Robot, RobotFile, Source, load};

fn gravity_torque(chain: &Chain, position_rad: &[f64; 7]) -> [f64; 7] {
    let mut torque_nm = [0.0; 7];
    chain.gravity_torque(position_rad, &mut torque_nm);
    torque_nm
}

/// Mass and centre along z of the links `first..=last`, from the frame of link `first`, with the joints at zero.
fn lump(robot: &Robot, first: usize, last: usize) -> (f64, f64) {
    let (mut mass_kg, mut moment_kg_m, mut frame_m) = (0.0, 0.0, 0.0);
    for link in &robot.chain.links()[first..=last] {
        if mass_kg > 0.0 {
            frame_m += link.origin.translation.z;
        }
        mass_kg += link.mass_kg;
        moment_kg_m += link.mass_kg * (frame_m + link.centre_of_mass_m.z);
    }
    (mass_kg, moment_kg_m / mass_kg)
}

#[track_caller]
fn assert_close(found: f64, expected: f64, tolerance: f64) {
    assert!(
        (found - expected).abs() <= tolerance,
        "{found} is not {expected} ± {tolerance}"
    );
}

#[test]
fn every_shipped_robot_loads_and_survives_writing() {
    for name in robot::shipped() {
        let robot = load(name).unwrap();
        assert_eq!(robot.source, Source::Shipped(name));
        assert_eq!(robot.name, name);
        assert_eq!(robot.joints.len(), robot.chain.joint_count());
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../robots/");
        let text = std::fs::read_to_string(format!("{folder}{name}.toml")).unwrap();
        let file = RobotFile::parse(&text, name).unwrap();
        let written = toml::to_string(&file).unwrap();
        assert_eq!(RobotFile::parse(&written, name).unwrap(), file);
    }
}

#[test]
fn pa10_lumps_are_those_of_table_iv() {
    let robot = load("pa10").unwrap();
    // m2 with lc2 from the shoulder, m4 with lc4 from the elbow, m6 with lc6 from the wrist.
    for (first, mass_kg, centre_m) in [(1, 9.86, 0.32), (3, 2.18, 0.17), (5, 4.34, -0.09)] {
        let (found_kg, found_m) = lump(&robot, first, if first == 5 { 6 } else { first + 1 });
        assert_close(found_kg, mass_kg, 1e-9);
        assert_close(found_m, centre_m, 1e-4);
    }
}

#[test]
fn pa10_needs_the_shoulder_torque_that_table_iv_implies() {
    let robot = load("pa10").unwrap();
    let mut arm_level = [0.0; 7];
    arm_level[1] = std::f64::consts::FRAC_PI_2;
    let expected_nm = 9.81 * (9.86 * 0.32 + 2.18 * (0.45 + 0.17) + 4.34 * (0.45 + 0.50 - 0.09));
    // Leaning forward, gravity pulls on; holding needs torque the other way.
    assert_close(
        gravity_torque(&robot.chain, &arm_level)[1],
        -expected_nm,
        0.02,
    );
    assert_close(gravity_torque(&robot.chain, &[0.0; 7])[1], 0.0, 1e-9);
}

#[test]
fn pa10_points_up_at_zero_with_the_flange_at_the_sum_of_its_lengths() {
    let tool = load("pa10").unwrap().chain.tool_pose(&[0.0; 7]);
    let height_m = 0.317 + 0.450 + 0.500 + 0.080;
    assert!((tool.translation.vector - nalgebra::Vector3::new(0.0, 0.0, height_m)).norm() < 1e-12);
    assert!(tool.rotation.angle() < 1e-12);
}

#[test]
fn pa10_drives_can_hold_the_arm_and_overcome_friction() {
    let robot = load("pa10").unwrap();
    let mut arm_level = [0.0; 7];
    arm_level[1] = std::f64::consts::FRAC_PI_2;
    let load_nm = gravity_torque(&robot.chain, &arm_level);
    for (joint, load_nm) in robot.joints.iter().zip(load_nm) {
        let friction = joint.direction_friction.unwrap();
        let limit_nm = joint.torque_limit_nm.unwrap() * joint.gear_ratio;
        for row in [friction.positive, friction.negative] {
            let moving_nm =
                row.f0_nm + row.fv_nm_s_rad * 0.4 + row.fs_nm * (1.0 - (-0.4 / row.vc_rad_s).exp());
            assert!(
                load_nm.abs() + moving_nm < limit_nm,
                "{}: {load_nm} + {moving_nm}",
                joint.name
            );
        }
    }
}

#[test]
fn pa10_control_is_table_vi_at_the_joint() {
    let control = load("pa10").unwrap().control.unwrap();
    assert_eq!(control.kind, ControlKind::PdFeedforward);
    let motor_side = |gains: &[f64]| gains.iter().map(|gain| gain / 50.0).collect::<Vec<_>>();
    assert_eq!(
        motor_side(&control.proportional_nm_rad),
        [4.0, 5.0, 4.0, 2.0, 0.6, 1.2, 0.6]
    );
    assert_eq!(
        motor_side(&control.derivative_nm_s_rad),
        [1.0, 1.0, 0.5, 0.5, 0.05, 0.15, 0.05]
    );
}

#[test]
fn shd17_hangs_at_zero_and_its_link_is_the_papers() {
    let robot = load("shd17").unwrap();
    let mut torque_nm = [1.0];
    robot.chain.gravity_torque(&[0.0], &mut torque_nm);
    assert_close(torque_nm[0], 0.0, 1e-9);
    robot
        .chain
        .gravity_torque(&[std::f64::consts::FRAC_PI_2], &mut torque_nm);
    assert_close(
        torque_nm[0].abs(),
        9.81 * (0.641 * 0.225 + 1.2 * 0.45),
        0.01,
    );
    assert_close(robot.chain.tool_pose(&[0.0]).translation.z, -0.45, 1e-12);
}
