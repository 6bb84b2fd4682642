//! The messages of an MCAP recording: what the protobuf encoder writes and the schema that says so, from one
//! definition.

use crate::Signal;
use prost_types::field_descriptor_proto::{Label, Type};
use prost_types::{
    DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet,
    OneofDescriptorProto,
};

/// A protobuf message that can describe itself.
pub(crate) trait Described: prost::Message + Default {
    /// The schema's name in the file.
    const SCHEMA: &'static str;

    /// The message's own part of the schema.
    fn descriptor() -> DescriptorProto;

    /// The schema as MCAP wants it: a serialized `FileDescriptorSet`.
    fn schema() -> Vec<u8> {
        let file = FileDescriptorProto {
            name: Some(format!("{}.proto", Self::SCHEMA.replace('.', "/"))),
            package: Some("flexspline".to_owned()),
            message_type: vec![Self::descriptor()],
            syntax: Some("proto3".to_owned()),
            ..Default::default()
        };
        prost::Message::encode_to_vec(&FileDescriptorSet { file: vec![file] })
    }
}

/// Defines a message: the struct that prost encodes and its descriptor.
macro_rules! message {
    (
        $(#[$doc:meta])*
        $name:ident {
            $($(#[$field_doc:meta])* $field:ident: $rust:ty = $tag:tt as [$($proto:tt),+];)+
        }
    ) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, prost::Message)]
        pub struct $name {
            $($(#[$field_doc])* #[prost($($proto),+, tag = $tag)] pub $field: $rust,)+
        }

        impl Described for $name {
            const SCHEMA: &'static str = concat!("flexspline.", stringify!($name));

            fn descriptor() -> DescriptorProto {
                describe(stringify!($name), &[$((stringify!($field), $tag, &[$(stringify!($proto)),+])),+])
            }
        }
    };
}

message! {
    /// One joint in one cycle. A value that was not measured is `None`. SI; positive about the joint's axis on
    /// both sides of the gear.
    JointCycle {
        /// What the joint was asked to do, joint side.
        reference_position_rad: Option<f64> = "1" as [double, optional];
        /// What the joint was asked to do, joint side.
        reference_velocity_rad_s: Option<f64> = "2" as [double, optional];
        /// Torque sent to the drive, motor side.
        command_torque_nm: Option<f64> = "3" as [double, optional];
        /// Torque the drive reports (current times torque constant), motor side.
        motor_torque_nm: Option<f64> = "4" as [double, optional];
        /// Before the gear.
        motor_position_rad: Option<f64> = "5" as [double, optional];
        /// Before the gear.
        motor_velocity_rad_s: Option<f64> = "6" as [double, optional];
        /// After the gear.
        link_position_rad: Option<f64> = "7" as [double, optional];
        /// After the gear.
        link_velocity_rad_s: Option<f64> = "8" as [double, optional];
        /// A torque sensor at the gear's output.
        joint_torque_nm: Option<f64> = "9" as [double, optional];
        /// The drive's current.
        motor_current_a: Option<f64> = "10" as [double, optional];
        /// Of the gear or the motor, in degrees Celsius.
        temperature_c: Option<f64> = "11" as [double, optional];
        /// Joint-side torque by the residual estimator.
        estimate_residual_torque_nm: Option<f64> = "12" as [double, optional];
        /// Joint-side torque by the structural-damping estimator.
        estimate_structural_damping_nm: Option<f64> = "13" as [double, optional];
        /// The trajectory this cycle belongs to; the same in all joints of a cycle.
        segment: Option<i64> = "14" as [int64, optional];
        /// Joint-side torque by the fused estimator.
        estimate_fusion_nm: Option<f64> = "15" as [double, optional];
        /// One standard deviation of it.
        estimate_fusion_std_nm: Option<f64> = "16" as [double, optional];
        /// What pushes the link from outside, by the fused torque and the rigid bodies, joint side.
        estimate_external_nm: Option<f64> = "17" as [double, optional];
        /// One standard deviation of it, the model's tolerance included.
        estimate_external_std_nm: Option<f64> = "18" as [double, optional];
        /// State of the drive, as the loop numbers it: 4 is enabled, 7 a fault. Missing where the driver does not tell.
        drive_state: Option<i64> = "19" as [int64, optional];
        /// The drive's own status word. Missing where the driver does not tell the state.
        drive_status_word: Option<i64> = "20" as [int64, optional];
        /// The drive's own fault number; missing where there is none.
        drive_error_code: Option<i64> = "21" as [int64, optional];
        /// Cycles since the readings were latched; missing where they are fresh.
        drive_age_cycles: Option<i64> = "22" as [int64, optional];
    }
}

message! {
    /// The control loop in one cycle.
    LoopCycle {
        /// Counts every cycle.
        cycle: u64 = "1" as [uint64];
        /// The loop's state, as the loop numbers it.
        state: u32 = "2" as [uint32];
        /// Actual wake-up minus planned.
        wakeup_lateness_ns: i64 = "3" as [int64];
        /// From the samples' arrival to the command.
        compute_ns: i64 = "4" as [int64];
        /// From the encoder latch to the command's departure.
        command_latency_ns: i64 = "5" as [int64];
        /// The exchange with the drives.
        exchange_ns: i64 = "6" as [int64];
        /// One bit per joint whose command was limited.
        limited: u32 = "7" as [uint32];
        /// Since the loop started.
        missed_deadlines: u64 = "8" as [uint64];
        /// Since the loop started.
        stale_commands: u64 = "9" as [uint64];
    }
}

message! {
    /// What the emulated plant really did at one joint, unseen by the loop. After the gear.
    JointTruth {
        /// After the gear.
        link_position_rad: f64 = "1" as [double];
        /// After the gear.
        link_velocity_rad_s: f64 = "2" as [double];
        /// Through the gear to the link.
        joint_torque_nm: f64 = "3" as [double];
        /// All friction, at the joint side.
        friction_torque_nm: f64 = "4" as [double];
    }
}

/// One control cycle as a recording holds it.
#[derive(Clone, Copy, Debug)]
pub struct CycleRow<'a> {
    /// Counts every cycle; the messages' sequence number (its low 32 bits). With the time it tells rows apart.
    pub cycle: u64,
    /// Of the measurement, in the loop's clock.
    pub time_ns: u64,
    /// The loop's own account of the cycle.
    pub loop_cycle: Option<&'a LoopCycle>,
    /// One per joint, in the order of the joint names.
    pub joints: &'a [JointCycle],
    /// One per joint, where an emulator told.
    pub truth: Option<&'a [JointTruth]>,
}

impl JointCycle {
    /// One signal's value.
    #[must_use]
    pub const fn get(&self, signal: Signal) -> Option<f64> {
        match signal {
            Signal::ReferencePositionRad => self.reference_position_rad,
            Signal::ReferenceVelocityRadS => self.reference_velocity_rad_s,
            Signal::CommandTorqueNm => self.command_torque_nm,
            Signal::MotorTorqueNm => self.motor_torque_nm,
            Signal::MotorPositionRad => self.motor_position_rad,
            Signal::MotorVelocityRadS => self.motor_velocity_rad_s,
            Signal::LinkPositionRad => self.link_position_rad,
            Signal::LinkVelocityRadS => self.link_velocity_rad_s,
            Signal::JointTorqueNm => self.joint_torque_nm,
            Signal::MotorCurrentA => self.motor_current_a,
            Signal::TemperatureC => self.temperature_c,
        }
    }

    /// Sets one signal's value.
    pub const fn set(&mut self, signal: Signal, value: Option<f64>) {
        let field = match signal {
            Signal::ReferencePositionRad => &mut self.reference_position_rad,
            Signal::ReferenceVelocityRadS => &mut self.reference_velocity_rad_s,
            Signal::CommandTorqueNm => &mut self.command_torque_nm,
            Signal::MotorTorqueNm => &mut self.motor_torque_nm,
            Signal::MotorPositionRad => &mut self.motor_position_rad,
            Signal::MotorVelocityRadS => &mut self.motor_velocity_rad_s,
            Signal::LinkPositionRad => &mut self.link_position_rad,
            Signal::LinkVelocityRadS => &mut self.link_velocity_rad_s,
            Signal::JointTorqueNm => &mut self.joint_torque_nm,
            Signal::MotorCurrentA => &mut self.motor_current_a,
            Signal::TemperatureC => &mut self.temperature_c,
        };
        *field = value;
    }
}

fn describe(name: &str, fields: &[(&str, &str, &[&str])]) -> DescriptorProto {
    let mut message = DescriptorProto {
        name: Some(name.to_owned()),
        ..Default::default()
    };
    for (field, tag, proto) in fields {
        let optional = proto.contains(&"optional");
        // proto3 says "optional" with a oneof of that one field.
        let oneof_index = optional.then_some(message.oneof_decl.len() as i32);
        if optional {
            message.oneof_decl.push(OneofDescriptorProto {
                name: Some(format!("_{field}")),
                options: None,
            });
        }
        message.field.push(FieldDescriptorProto {
            name: Some((*field).to_owned()),
            number: tag.parse().ok(),
            label: Some(Label::Optional.into()),
            r#type: Some(protobuf_type(proto[0]).into()),
            oneof_index,
            proto3_optional: optional.then_some(true),
            ..Default::default()
        });
    }
    message
}

fn protobuf_type(name: &str) -> Type {
    match name {
        "double" => Type::Double,
        "int64" => Type::Int64,
        "uint32" => Type::Uint32,
        "uint64" => Type::Uint64,
        _ => unreachable!("no message has a field of type {name}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use prost::Message;

    #[test]
    fn a_signal_is_the_field_of_its_name() {
        let fields = JointCycle::descriptor().field;
        for signal in Signal::ALL {
            let mut joint = JointCycle::default();
            joint.set(signal, Some(1.5));
            assert_eq!(joint.get(signal), Some(1.5));
            let number = fields
                .iter()
                .find(|field| field.name() == signal.name())
                .unwrap()
                .number();
            let key = (number as u8) << 3 | 1; // protobuf's key of a 64-bit field
            assert_eq!(joint.encode_to_vec()[0], key, "{signal}");
        }
    }

    #[test]
    fn zero_is_a_value_and_not_a_missing_one() {
        let joint = JointCycle {
            motor_torque_nm: Some(0.0),
            ..Default::default()
        };
        assert_eq!(JointCycle::decode(&*joint.encode_to_vec()).unwrap(), joint);
    }

    #[test]
    fn field_numbers_are_counted_from_one() {
        for message in [
            JointCycle::descriptor(),
            LoopCycle::descriptor(),
            JointTruth::descriptor(),
        ] {
            let numbers: Vec<_> = message.field.iter().map(|field| field.number()).collect();
            assert_eq!(
                numbers,
                (1..=message.field.len() as i32).collect::<Vec<_>>()
            );
        }
    }
}
