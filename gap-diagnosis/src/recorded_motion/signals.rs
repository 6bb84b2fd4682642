//! Which columns of a recording tell where a joint is and what torque moves it; the rest is left out, and said.

use gap_report::TorqueSource;
use recording::{JointColumns, Signal};
use robot::{Control, ControlKind, Feedback, Feedforward, Robot};

/// The column that a joint's torque is taken from.
pub fn of_torque(source: TorqueSource) -> Signal {
    match source {
        TorqueSource::Drive => Signal::MotorTorqueNm,
        TorqueSource::Command => Signal::CommandTorqueNm,
        TorqueSource::Sensor => Signal::JointTorqueNm,
        TorqueSource::Controller => Signal::ReferencePositionRad,
    }
}

/// All torques that a joint of all these recordings has, the best first. `is_bad`: columns that a check found wrong.
pub fn torques(
    robot: &Robot,
    joints: &[&JointColumns],
    is_bad: impl Fn(Signal) -> bool,
) -> Vec<TorqueSource> {
    let controller = controller(robot).is_some();
    let there = |source: &TorqueSource| {
        let signal = of_torque(*source);
        !is_bad(signal)
            && (*source != TorqueSource::Controller || controller)
            && joints
                .iter()
                .all(|columns| columns.measured(signal).is_some())
    };
    [
        TorqueSource::Drive,
        TorqueSource::Sensor,
        TorqueSource::Command,
        TorqueSource::Controller,
    ]
    .into_iter()
    .filter(there)
    .collect()
}

/// A controller whose torque follows from reference and position alone.
pub fn controller(robot: &Robot) -> Option<&Control> {
    robot.control.as_ref().filter(|control| {
        control.kind == ControlKind::PdFeedforward && control.feedforward == Feedforward::None
    })
}

/// Where a joint's position is taken from, in all recordings alike: the motor's encoder where there is one, for it is the finer.
pub fn position(
    joints: &[&JointColumns],
    is_bad: impl Fn(Signal) -> bool,
    control: Option<&Control>,
) -> Option<Signal> {
    let there = |signal: &Signal| {
        !is_bad(*signal)
            && joints
                .iter()
                .all(|columns| columns.measured(*signal).is_some())
    };
    let fed_back = control.map(|control| match control.feedback {
        Feedback::Motor => Signal::MotorPositionRad,
        Feedback::Link => Signal::LinkPositionRad,
    });
    let all = [Signal::MotorPositionRad, Signal::LinkPositionRad];
    fed_back.into_iter().chain(all).find(there)
}
