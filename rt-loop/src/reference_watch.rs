//! A joint that does not follow its reference at all: its encoder shows no motion while the reference goes on, or it is far away.
//!
//! An encoder that stands is dead, or the joint is blocked; either way the controller no longer knows where the joint is, and
//! without a link encoder nothing else tells. A joint far from its reference obeys a torque that has nothing to do with it.

use shm_types::JOINTS_MAX;
use shm_types::messages::{Command, PerJoint};

use crate::cycle::CycleConfig;
use crate::fault::Fault;
use crate::joint_motion::JointMotions;
use crate::limits::JointLimits;

/// How far each reference has gone since the joint last moved, and how far the joint is from it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReferenceWatch {
    gone_rad: PerJoint,
    away_rad: PerJoint,
    reference_rad: [Option<f64>; JOINTS_MAX],
}

impl ReferenceWatch {
    /// Takes a cycle in which the loop obeys a command.
    pub fn observe(
        &mut self,
        config: &CycleConfig,
        cycle: u64,
        command: &Command,
        motions: &JointMotions,
    ) {
        let joints = motions.motions().into_iter().enumerate();
        for (joint, motion) in joints.take(config.joint_count()) {
            let reference_rad = command.reference_position_rad[joint];
            let before_rad = self.reference_rad[joint].replace(reference_rad);
            let gone_rad = before_rad.map_or(0.0, |before_rad| (reference_rad - before_rad).abs());
            self.gone_rad[joint] = match motions.stands_still(joint, cycle) {
                true if gone_rad.is_finite() => self.gone_rad[joint] + gone_rad,
                true => self.gone_rad[joint],
                false => 0.0,
            };
            self.away_rad[joint] = (reference_rad - motion.position_rad).abs();
        }
    }

    /// Forgets everything: the joints are not asked to move.
    pub fn rest(&mut self) {
        *self = Self::default();
    }

    /// The first joint that does not follow.
    pub fn fault(&self, config: &CycleConfig) -> Option<Fault> {
        let first = |values: &PerJoint, limit: fn(&JointLimits) -> f64| {
            let mut joints = values.iter().zip(&config.joints);
            joints.position(|(&value, joint)| value > limit(joint))
        };
        if let Some(joint) = first(&self.gone_rad, |joint| joint.standstill_rad) {
            return Some(Fault::Stuck {
                joint: joint as u32,
                reference_rad: self.gone_rad[joint],
            });
        }
        first(&self.away_rad, |joint| joint.following_rad).map(|joint| Fault::Astray {
            joint: joint as u32,
            away_rad: self.away_rad[joint],
        })
    }
}
