//! What cannot be computed because a signal is not there.

use super::{Finding, FindingKind, values};
use crate::{JointColumns, Signal};

pub(super) fn check(joint: &JointColumns) -> Vec<Finding> {
    let has = |signal| values(joint, signal).is_some();
    let (motor, link) = (has(Signal::MotorPositionRad), has(Signal::LinkPositionRad));
    let mut findings = Vec::new();
    let mut add = |finding: Finding, remedy: &str| findings.push(finding.at(joint).remedy(remedy));
    if !motor && !link {
        let what = "neither motor_position_rad nor link_position_rad: nothing can be identified";
        add(
            Finding::error(FindingKind::NoPosition, what.to_owned()),
            "map the encoder's column",
        );
    } else if !motor || !link {
        let there = if motor { "motor" } else { "link" };
        let what = format!(
            "only the {there} encoder: what happens inside the gear (compliance, windup, hysteresis, kinematic error) \
             shows through torque and resonance alone"
        );
        add(Finding::note(FindingKind::OneEncoder, what), "");
    }
    let torque = (has(Signal::MotorTorqueNm), has(Signal::CommandTorqueNm));
    match torque {
        (false, false) if has(Signal::MotorCurrentA) => add(
            Finding::warning(
                FindingKind::NoTorque,
                "no motor torque but a current: friction cannot be identified before it is a torque".to_owned(),
            ),
            "map the current to motor_torque_nm too, with the torque constant as scale",
        ),
        (false, false) if has(Signal::JointTorqueNm) => add(
            Finding::note(
                FindingKind::NoTorque,
                "the torque is the one at the joint: of a sensor behind the gear it lacks the motor's friction and inertia"
                    .to_owned(),
            ),
            "if it was made from the motor's current, map it to motor_torque_nm, over the gear ratio",
        ),
        (false, false) => add(
            Finding::warning(
                FindingKind::NoTorque,
                "no motor torque, measured or commanded: friction, inertia and load cannot be identified".to_owned(),
            ),
            "map the drive's torque to motor_torque_nm or command_torque_nm; for a joint without a drive map a column of zeros to \
             command_torque_nm",
        ),
        // beside a sensor the command is not what is taken for the torque
        (false, true) if !has(Signal::JointTorqueNm) => add(
            Finding::note(
                FindingKind::CommandOnly,
                "the torque is the commanded one: what the drive makes of it (torque constant, lag, saturation, \
                 ripple) cannot be told from what the joint does"
                    .to_owned(),
            ),
            "",
        ),
        _ => {}
    }
    if !has(Signal::ReferencePositionRad) {
        let what = "no reference_position_rad: the loop cannot be closed in simulation, a twin can only follow the measured motion";
        add(Finding::note(FindingKind::NoReference, what.to_owned()), "");
    }
    findings
}
