//! The messages that tell about joints.
//!
//! Definitions: `sensor_msgs/msg/JointState`, `trajectory_msgs/msg/JointTrajectory`,
//! `control_msgs/msg/JointTrajectoryControllerState` and `control_msgs/msg/DynamicJointState` of common_interfaces and
//! control_msgs; their beginnings, which are all that is read, are the same in every distribution.

use super::wire::{Encoding, Wire};
use crate::Signal;

/// The type of a topic's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    JointState,
    DynamicJointState,
    ControllerState,
    Trajectory,
}

impl Kind {
    /// By the name of ROS 1 or ROS 2.
    pub(crate) fn of(name: &str) -> Option<Self> {
        let (package, message) = name.split_once('/')?;
        let message = message.strip_prefix("msg/").unwrap_or(message);
        match (package, message) {
            ("sensor_msgs", "JointState") => Some(Self::JointState),
            ("control_msgs", "DynamicJointState") => Some(Self::DynamicJointState),
            ("control_msgs", "JointTrajectoryControllerState") => Some(Self::ControllerState),
            ("trajectory_msgs", "JointTrajectory") => Some(Self::Trajectory),
            _ => None,
        }
    }

    /// Whether its messages are of what the joints did.
    pub(crate) fn is_state(self) -> bool {
        matches!(self, Self::JointState | Self::DynamicJointState)
    }

    /// Whether its messages say what the joints did, not only what they were asked to do.
    pub(crate) fn tells_states(self) -> bool {
        self != Self::Trajectory
    }

    /// What is read of each joint, in the order of the values, by the names that columns get.
    pub(crate) fn quantities(self) -> &'static [Quantity] {
        use Quantity::{
            Effort, Position, ReferenceEffort, ReferencePosition, ReferenceVelocity, Velocity,
        };
        match self {
            Self::JointState | Self::DynamicJointState => &[Position, Velocity, Effort],
            Self::Trajectory => &[ReferencePosition, ReferenceVelocity, ReferenceEffort],
            Self::ControllerState => &[
                ReferencePosition,
                ReferenceVelocity,
                ReferenceEffort,
                Position,
                Velocity,
                Effort,
            ],
        }
    }
}

/// What one value of a joint is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    Position,
    Velocity,
    Effort,
    ReferencePosition,
    ReferenceVelocity,
    ReferenceEffort,
}

impl Quantity {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Effort => "effort",
            Self::ReferencePosition => "reference_position",
            Self::ReferenceVelocity => "reference_velocity",
            Self::ReferenceEffort => "reference_effort",
        }
    }

    /// ROS speaks of joints, so everything is behind the gear.
    pub(crate) fn signal(self) -> Option<Signal> {
        match self {
            Self::Position => Some(Signal::LinkPositionRad),
            Self::Velocity => Some(Signal::LinkVelocityRadS),
            Self::Effort => Some(Signal::JointTorqueNm),
            Self::ReferencePosition => Some(Signal::ReferencePositionRad),
            Self::ReferenceVelocity => Some(Signal::ReferenceVelocityRadS),
            // A controller's own torque before its gains: no signal is that.
            Self::ReferenceEffort => None,
        }
    }
}

/// What one message says.
#[derive(Debug, Default)]
pub(crate) struct Told {
    pub(crate) joints: Vec<String>,
    /// Of the header; zero if the sender left it out.
    pub(crate) stamp_ns: i64,
    /// How long after the stamp, and the [`Kind::quantities`] of each joint in turn; NaN where there is none.
    pub(crate) rows: Vec<(i64, Vec<f64>)>,
}

/// What a message says, if it is one of that kind.
pub(crate) fn decode(kind: Kind, bytes: &[u8], encoding: Encoding) -> Option<Told> {
    let mut wire = Wire::new(bytes, encoding)?;
    let stamp_ns = header(&mut wire)?;
    let joints = wire.texts()?;
    let rows = match kind {
        Kind::JointState => {
            let values = [wire.numbers()?, wire.numbers()?, wire.numbers()?];
            vec![(0, by_joint(joints.len(), &values))]
        }
        Kind::DynamicJointState => {
            let mut values = Vec::new();
            for _ in 0..wire.u32()? {
                values.extend(interfaces(&mut wire)?);
            }
            values.resize(3 * joints.len(), f64::NAN);
            vec![(0, values)]
        }
        Kind::ControllerState => {
            let ([a, b, c], _) = point(&mut wire)?;
            let ([d, e, f], _) = point(&mut wire)?;
            vec![(0, by_joint(joints.len(), &[a, b, c, d, e, f]))]
        }
        Kind::Trajectory => {
            let mut rows = Vec::new();
            for _ in 0..wire.u32()? {
                let (values, after_ns) = point(&mut wire)?;
                // A point without positions tells nothing that is read.
                if values[0].len() == joints.len() {
                    rows.push((after_ns, by_joint(joints.len(), &values)));
                }
            }
            rows
        }
    };
    Some(Told {
        joints,
        stamp_ns,
        rows,
    })
}

/// Of a message that begins with `std_msgs/Header`: its stamp.
fn header(wire: &mut Wire<'_>) -> Option<i64> {
    if wire.encoding() == Encoding::Ros1 {
        let _sequence = wire.u32()?;
    }
    let stamp_ns = time_ns(wire)?;
    let _frame = wire.text()?;
    Some(stamp_ns)
}

fn time_ns(wire: &mut Wire<'_>) -> Option<i64> {
    let (seconds, nanoseconds) = (wire.i32()?, wire.u32()?);
    Some(i64::from(seconds) * 1_000_000_000 + i64::from(nanoseconds))
}

/// A `trajectory_msgs/JointTrajectoryPoint`: position, velocity and effort, and the time from the start.
fn point(wire: &mut Wire<'_>) -> Option<([Vec<f64>; 3], i64)> {
    let (positions, velocities) = (wire.numbers()?, wire.numbers()?);
    let (_accelerations, efforts) = (wire.numbers()?, wire.numbers()?);
    Some(([positions, velocities, efforts], time_ns(wire)?))
}

/// A `control_msgs/InterfaceValue`: what `ros2_control` calls the three.
fn interfaces(wire: &mut Wire<'_>) -> Option<[f64; 3]> {
    let names = wire.texts()?;
    let values = wire.numbers()?;
    let named = |name: &str| {
        let index = names.iter().position(|known| known == name);
        index.and_then(|index| values.get(index).copied())
    };
    Some(["position", "velocity", "effort"].map(|name| named(name).unwrap_or(f64::NAN)))
}

/// The quantities of the first joint, then of the next.
fn by_joint<const N: usize>(joints: usize, quantities: &[Vec<f64>; N]) -> Vec<f64> {
    // Many senders leave velocity or effort empty.
    let value = |quantity: &Vec<f64>, joint: usize| {
        let value = quantity.get(joint).copied();
        value.filter(|value| value.is_finite()).unwrap_or(f64::NAN)
    };
    (0..joints)
        .flat_map(|joint| {
            quantities
                .iter()
                .map(move |quantity| value(quantity, joint))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A `JointState` as ROS 1 writes it.
    fn ros1_joint_state() -> Vec<u8> {
        let mut bytes = Vec::new();
        bytes.extend(7_u32.to_le_bytes());
        bytes.extend(5_i32.to_le_bytes());
        bytes.extend(500_000_000_u32.to_le_bytes());
        bytes.extend(0_u32.to_le_bytes());
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend(5_u32.to_le_bytes());
        bytes.extend(b"elbow");
        bytes.extend(1_u32.to_le_bytes());
        bytes.extend(0.25_f64.to_le_bytes());
        bytes.extend([0; 8]);
        bytes
    }

    #[test]
    fn a_joint_state_without_velocity_and_effort_is_one_with_its_position() {
        let bytes = ros1_joint_state();
        let told = decode(Kind::JointState, &bytes, Encoding::Ros1).unwrap();
        assert_eq!(told.stamp_ns, 5_500_000_000);
        assert_eq!(told.joints, ["elbow"]);
        let [(0, values)] = &told.rows[..] else {
            panic!("{told:?}")
        };
        assert_eq!(values[0], 0.25);
        assert!(values[1..].iter().all(|value| value.is_nan()));
        for length in 0..bytes.len() {
            assert!(decode(Kind::JointState, &bytes[..length], Encoding::Ros1).is_none());
        }
    }

    #[test]
    fn types_are_known_by_the_names_of_both_versions() {
        assert_eq!(Kind::of("sensor_msgs/JointState"), Some(Kind::JointState));
        assert_eq!(
            Kind::of("sensor_msgs/msg/JointState"),
            Some(Kind::JointState)
        );
        assert_eq!(Kind::of("sensor_msgs/msg/Image"), None);
        assert_eq!(Kind::of("JointState"), None);
    }
}
