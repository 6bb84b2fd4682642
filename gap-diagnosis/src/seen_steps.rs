//! Encoder steps that the robot file does not state, as the recordings show them: what is not stated is unknown, and not none.

use gap_report::DataFinding;
use recording::{Recording, Signal};
use robot::{Robot, RobotJoint};

/// The robot with the steps that its recordings show where it states none, and the lines that would state them.
pub fn added(robot: &Robot, recordings: &[(String, Recording)]) -> (Robot, Option<DataFinding>) {
    let mut robot = robot.clone();
    let mut lines = Vec::new();
    for joint in &mut robot.joints {
        let name = joint.name.clone();
        let mut shown = Vec::new();
        for (signal, key, stated) in encoders(joint) {
            if stated.is_some() {
                continue;
            }
            *stated = seen(recordings, &name, signal);
            shown.extend(stated.map(|step_rad| format!("{key} = {step_rad:.3e}")));
        }
        if !shown.is_empty() {
            lines.push(format!("{name}: {}", shown.join(", ")));
        }
    }
    let note = (!lines.is_empty()).then(|| DataFinding {
        joint: None,
        severity: "note".to_owned(),
        what: "the robot file does not state every encoder's step: the recording's own is taken for it, and is no effect"
            .to_owned(),
        remedy: format!("to be added to [[joint]]: {}", lines.join("; ")),
    });
    (robot, note)
}

fn encoders(joint: &mut RobotJoint) -> [(Signal, &'static str, &mut Option<f64>); 2] {
    [
        (
            Signal::MotorPositionRad,
            "motor_encoder_resolution_rad",
            &mut joint.motor_encoder_resolution_rad,
        ),
        (
            Signal::LinkPositionRad,
            "link_encoder_resolution_rad",
            &mut joint.link_encoder_resolution_rad,
        ),
    ]
}

/// The step of a signal; none where its values are not in steps.
fn seen(recordings: &[(String, Recording)], joint: &str, signal: Signal) -> Option<f64> {
    let columns = recordings
        .iter()
        .filter_map(|(_, recording)| recording.joint(joint).ok()?.measured(signal));
    recording::step(&columns.flatten().copied().collect::<Vec<f64>>())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use made_up::swinging;

    use super::*;

    #[test]
    fn a_step_is_the_files_where_it_states_one_and_the_recordings_else() {
        let mut robot = robot::load("pa10").unwrap();
        let mut recording = swinging(&robot, None);
        let name = robot.joints[0].name.clone();
        let joint_ratio = robot.joints[0].gear_ratio;
        let motor_rad = recording.joints[0].signals[&Signal::MotorPositionRad].clone();
        for (signal, side, step_rad) in [
            (Signal::MotorPositionRad, 1.0, 1e-3),
            (Signal::LinkPositionRad, joint_ratio, 2e-5),
        ] {
            let shown = motor_rad
                .iter()
                .map(|rad| (rad / side / step_rad).round() * step_rad);
            let shown = shown.collect();
            recording.joints[0].signals.insert(signal, shown);
        }
        robot.joints[0].motor_encoder_resolution_rad = Some(5e-4);
        robot.joints[0].link_encoder_resolution_rad = None;
        let (robot, note) = added(&robot, &[("log".to_owned(), recording)]);
        let joint = &robot.joints[0];
        assert_eq!(joint.motor_encoder_resolution_rad, Some(5e-4));
        let seen_rad = joint.link_encoder_resolution_rad.unwrap();
        assert!((seen_rad / 2e-5 - 1.0).abs() < 1e-3, "{seen_rad}");
        let remedy = note.unwrap().remedy;
        assert!(
            remedy.contains(&format!("{name}: link_encoder_resolution_rad = 2.000e-5")),
            "{remedy}"
        );
    }
}
