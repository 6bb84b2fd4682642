//! The signals of a joint: the columns a table may have, by the names that files use.

use std::fmt;

/// What one column of a joint holds. SI; positive about the joint's axis on both sides of the gear.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub enum Signal {
    /// What the joint was asked to do, joint side.
    ReferencePositionRad,
    /// What the joint was asked to do, joint side.
    ReferenceVelocityRadS,
    /// Torque sent to the drive, motor side.
    CommandTorqueNm,
    /// Torque the drive reports (current times torque constant), motor side.
    MotorTorqueNm,
    /// Before the gear.
    MotorPositionRad,
    /// Before the gear.
    MotorVelocityRadS,
    /// After the gear.
    LinkPositionRad,
    /// After the gear.
    LinkVelocityRadS,
    /// A torque sensor at the gear's output.
    JointTorqueNm,
    /// The drive's current.
    MotorCurrentA,
    /// Of the gear or the motor, in degrees Celsius.
    TemperatureC,
}

impl Signal {
    /// Every signal, in the order of its column.
    pub const ALL: [Self; 11] = [
        Self::ReferencePositionRad,
        Self::ReferenceVelocityRadS,
        Self::CommandTorqueNm,
        Self::MotorTorqueNm,
        Self::MotorPositionRad,
        Self::MotorVelocityRadS,
        Self::LinkPositionRad,
        Self::LinkVelocityRadS,
        Self::JointTorqueNm,
        Self::MotorCurrentA,
        Self::TemperatureC,
    ];

    /// The name in files: the column `JOINT.NAME` and the message's field.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::ReferencePositionRad => "reference_position_rad",
            Self::ReferenceVelocityRadS => "reference_velocity_rad_s",
            Self::CommandTorqueNm => "command_torque_nm",
            Self::MotorTorqueNm => "motor_torque_nm",
            Self::MotorPositionRad => "motor_position_rad",
            Self::MotorVelocityRadS => "motor_velocity_rad_s",
            Self::LinkPositionRad => "link_position_rad",
            Self::LinkVelocityRadS => "link_velocity_rad_s",
            Self::JointTorqueNm => "joint_torque_nm",
            Self::MotorCurrentA => "motor_current_a",
            Self::TemperatureC => "temperature_c",
        }
    }

    /// The signal of that name in files.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|signal| signal.name() == name)
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_leads_back_to_its_signal() {
        for (column, signal) in Signal::ALL.into_iter().enumerate() {
            assert_eq!(Signal::from_name(signal.name()), Some(signal));
            assert_eq!(signal as usize, column);
        }
        assert_eq!(Signal::from_name("motor_position_deg"), None);
    }
}
