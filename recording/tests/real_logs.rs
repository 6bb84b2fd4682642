//! Logs of real robots, where a folder of them is at hand: what is right about them is not complained about, and
//! what is wrong is found.
#![allow(clippy::unwrap_used, reason = "a test may")]

use recording::{
    CheckJoint, CheckRobot, FindingKind, ReadProblem, Recording, Severity, Signal, check, describe,
    read, read_mapped,
};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// The folder, unless there is none: then the reason is printed and the test has nothing to do.
fn logs(name: &str) -> Option<PathBuf> {
    let folder =
        std::env::var_os("FLEXSPLINE_REALDATA").map(|folder| PathBuf::from(folder).join(name));
    let found = folder.filter(|folder| folder.is_dir());
    if found.is_none() {
        println!("skipped: FLEXSPLINE_REALDATA names no folder with {name}");
    }
    found
}

/// KUKA KR300 R2500: the authors' gear ratios.
const RATIOS: [f64; 6] = [
    1798.0 / 7.0,
    1872.0 / 7.0,
    757.0 / 3.0,
    221.0,
    5032.0 / 21.0,
    206_793.0 / 1340.0,
];

/// The log's motor angles were divided by the gear ratio.
fn kuka_mapping(undo_division: bool) -> String {
    let mut mapping = String::from("[columns]\ntime_s = 'time_s'\n");
    for (axis, ratio) in (1..).zip(RATIOS) {
        let motor = if undo_division { ratio } else { 1.0 }.to_radians();
        let link = 1_f64.to_radians();
        writeln!(
            mapping,
            "[joint.axis{axis}]\nmotor_torque_nm = 'axis{axis}_motor_torque_nm'"
        )
        .unwrap();
        let mut line = |signal: &str, column: &str, scale: f64| {
            writeln!(
                mapping,
                "{signal} = {{ column = 'axis{axis}_{column}', scale = {scale:?} }}"
            )
            .unwrap();
        };
        line("reference_position_rad", "reference_position_deg", link);
        line("motor_position_rad", "motor_position_deg", motor);
        line("motor_velocity_rad_s", "motor_velocity_deg_s", motor);
        if axis <= 3 {
            line("link_position_rad", "link_position_deg", link);
            line("link_velocity_rad_s", "link_velocity_deg_s", link);
        }
    }
    mapping
}

fn kuka() -> CheckRobot {
    let joint = |(axis, gear_ratio): (usize, f64)| CheckJoint {
        name: format!("axis{axis}"),
        gear_ratio,
        position_limit_rad: None,
        velocity_limit_rad_s: None,
        torque_limit_nm: None,
        torque_constant_nm_a: None,
        motor_encoder_resolution_rad: None,
        link_encoder_resolution_rad: None,
        stiffness_nm_rad: None,
    };
    CheckRobot {
        name: "kr300".to_owned(),
        joints: (1..).zip(RATIOS).map(joint).collect(),
    }
}

fn read_with(log: &Path, mapping: &str) -> Recording {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mapping.toml");
    std::fs::write(&path, mapping).unwrap();
    read_mapped(log, &path).unwrap()
}

#[test]
fn a_mapped_industrial_robot_has_no_serious_findings() {
    let Some(folder) = logs("kuka_kr300") else {
        return;
    };
    for trajectory in ["a", "b", "c"] {
        let log = folder.join(format!("trajectory_{trajectory}.csv"));
        let recording = read_with(&log, &kuka_mapping(true));
        let info = describe(&recording);
        assert_eq!((info.rows, info.joints.len()), (2501, 6));
        assert!((info.sample_rate_hz - 250.0).abs() < 1e-6);
        for robot in [None, Some(kuka())] {
            let findings = check(&recording, robot.as_ref());
            assert!(
                findings
                    .iter()
                    .all(|finding| finding.severity == Severity::Note),
                "{findings:#?}"
            );
        }
    }
}

#[test]
fn angles_divided_by_the_gear_ratio_are_found_on_every_axis() {
    let Some(folder) = logs("kuka_kr300") else {
        return;
    };
    let recording = read_with(&folder.join("trajectory_a.csv"), &kuka_mapping(false));
    let findings = check(&recording, Some(&kuka()));
    for axis in 1..=6 {
        let name = format!("axis{axis}");
        let found = findings.iter().find(|finding| {
            finding.joint.as_ref() == Some(&name)
                && finding.signal == Some(Signal::MotorPositionRad)
        });
        assert_eq!(found.unwrap().kind, FindingKind::WrongSide, "{findings:#?}");
    }
}

#[test]
fn a_reversed_torque_is_found_on_most_axes_and_never_where_it_is_right() {
    let Some(folder) = logs("kuka_kr300") else {
        return;
    };
    let mut found = 0;
    for trajectory in ["a", "b", "c"] {
        let log = folder.join(format!("trajectory_{trajectory}.csv"));
        let reversed = kuka_mapping(true).replace(
            "motor_torque_nm = 'axis",
            "motor_torque_nm = { scale = -1, column = 'axis",
        );
        let reversed = reversed.replace("_motor_torque_nm'", "_motor_torque_nm' }");
        let recording = read_with(&log, &reversed);
        let findings = check(&recording, Some(&kuka()));
        found += findings
            .iter()
            .filter(|finding| finding.kind == FindingKind::ReversedSign)
            .count();
    }
    println!("{found} of 18 reversed torques were found");
    assert!(found >= 12, "{found} of 18");
}

#[test]
fn a_log_without_column_names_is_refused_with_what_to_do() {
    let Some(folder) = logs("schunk_lwa4p") else {
        return;
    };
    let log = folder.join("Robot/measurement_1/trajectory.csv");
    let refused = read(&log).unwrap_err();
    assert!(matches!(
        refused.problem,
        ReadProblem::HeaderOfNumbers { .. }
    ));
    assert!(
        refused
            .to_string()
            .contains("or name them in the first line")
    );
}
