//! Which columns of a recording tell where a joint is and what torque moves it; the rest is left out, and said.

use recording::{JointColumns, Signal};
use robot::{Control, ControlKind, Feedback, Feedforward, Robot};

use crate::report::TorqueSource;

impl TorqueSource {
    /// The recording's name of it.
    pub fn signal_name(self) -> &'static str {
        match self {
            Self::Drive => "motor_torque_nm",
            Self::Command => "command_torque_nm",
            Self::Sensor => "joint_torque_nm",
            Self::Controller => "reference_position_rad",
        }
    }

    /// The column.
    pub fn signal(self) -> Signal {
        match self {
            Self::Drive => Signal::MotorTorqueNm,
            Self::Command => Signal::CommandTorqueNm,
            Self::Sensor => Signal::JointTorqueNm,
            Self::Controller => Signal::ReferencePositionRad,
        }
    }

    /// All that a joint of all these recordings has, the best first. `is_bad`: columns that a check found wrong.
    pub fn of(
        robot: &Robot,
        joints: &[&JointColumns],
        is_bad: impl Fn(Signal) -> bool,
    ) -> Vec<Self> {
        let controller = controller(robot).is_some();
        let there = |source: &Self| {
            let signal = source.signal();
            !is_bad(signal)
                && (*source != Self::Controller || controller)
                && joints
                    .iter()
                    .all(|columns| columns.measured(signal).is_some())
        };
        [Self::Drive, Self::Sensor, Self::Command, Self::Controller]
            .into_iter()
            .filter(there)
            .collect()
    }
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
