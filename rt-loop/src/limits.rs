//! What every command must pass before it reaches a drive.
//!
//! A limit that acts is a status, not a fault: the torque is reduced, the joint's bit is set, the run goes on. Far
//! outside the limits the joint has run away, and that is a fault.

use shm_types::JOINTS_MAX;

/// Limits of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointLimits {
    /// Motor turns per joint turn.
    pub gear_ratio: f64,
    /// Motor side, both directions.
    pub motor_torque_nm: f64,
    /// Motor side, both directions.
    pub motor_torque_rate_nm_s: f64,
    /// Lowest joint position.
    pub position_min_rad: f64,
    /// Highest joint position.
    pub position_max_rad: f64,
    /// Joint side, both directions.
    pub velocity_rad_s: f64,
    /// Joint side, both directions: how fast a commanded velocity may change.
    pub acceleration_rad_s2: f64,
    /// Joint side: brakes a joint beyond its limits, and all joints when commands stop.
    pub damping_nm_s_rad: f64,
}

/// Motion of one joint, joint side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointMotion {
    /// Position.
    pub position_rad: f64,
    /// Velocity.
    pub velocity_rad_s: f64,
}

/// A joint this far over its velocity limit has run away.
pub const RUNAWAY_VELOCITY_FACTOR: f64 = 1.5;
/// A joint this far outside its position range has run away.
pub const RUNAWAY_POSITION_RAD: f64 = 0.1;

impl JointLimits {
    /// The torque that may be sent instead of `asked_nm`, motor side; equal to it where no limit acts.
    ///
    /// `sent_nm` was sent one `period_s` ago. `asked_nm` is finite.
    pub fn allowed_torque_nm(
        &self,
        asked_nm: f64,
        sent_nm: f64,
        motion: JointMotion,
        period_s: f64,
    ) -> f64 {
        let step_nm = self.motor_torque_rate_nm_s * period_s;
        let rated_nm = asked_nm.clamp(sent_nm - step_nm, sent_nm + step_nm);
        let (lowest_nm, highest_nm) = self.torque_range_nm(motion);
        // The range narrows to braking beyond a limit; it overrules the rate, which would let the joint run on.
        rated_nm
            .clamp(lowest_nm, highest_nm)
            .clamp(-self.motor_torque_nm, self.motor_torque_nm)
    }

    /// The velocity that may be sent instead of `asked_rad_s`, joint side; equal to it where no limit acts.
    ///
    /// `sent_rad_s` was sent one `period_s` ago. `asked_rad_s` is finite.
    pub fn allowed_velocity_rad_s(
        &self,
        asked_rad_s: f64,
        sent_rad_s: f64,
        motion: JointMotion,
        period_s: f64,
    ) -> f64 {
        let step_rad_s = self.acceleration_rad_s2 * period_s;
        let rated_rad_s = asked_rad_s.clamp(sent_rad_s - step_rad_s, sent_rad_s + step_rad_s);
        let (mut lowest_rad_s, mut highest_rad_s) = (-self.velocity_rad_s, self.velocity_rad_s);
        if motion.position_rad > self.position_max_rad {
            highest_rad_s = 0.0;
        } else if motion.position_rad < self.position_min_rad {
            lowest_rad_s = 0.0;
        }
        rated_rad_s.clamp(lowest_rad_s, highest_rad_s)
    }

    /// Motor torque that brakes this motion.
    pub fn damping_torque_nm(&self, motion: JointMotion) -> f64 {
        let torque_nm = -self.damping_nm_s_rad * motion.velocity_rad_s / self.gear_ratio;
        torque_nm.clamp(-self.motor_torque_nm, self.motor_torque_nm)
    }

    /// Whether the joint is so far outside its limits that something else moves it.
    pub fn has_run_away(&self, motion: JointMotion) -> bool {
        // What is no number is outside too.
        let slow = motion.velocity_rad_s.abs() <= RUNAWAY_VELOCITY_FACTOR * self.velocity_rad_s;
        !slow
            || motion.position_rad > self.position_max_rad + RUNAWAY_POSITION_RAD
            || motion.position_rad < self.position_min_rad - RUNAWAY_POSITION_RAD
    }

    /// Beyond a limit, only torque that leads back or brakes is allowed.
    fn torque_range_nm(&self, motion: JointMotion) -> (f64, f64) {
        let mut range = (f64::NEG_INFINITY, f64::INFINITY);
        let braking_nm = self.damping_torque_nm(motion);
        if motion.velocity_rad_s > self.velocity_rad_s {
            range.1 = braking_nm;
        } else if motion.velocity_rad_s < -self.velocity_rad_s {
            range.0 = braking_nm;
        }
        if motion.position_rad > self.position_max_rad {
            range.1 = range.1.min(braking_nm.min(0.0));
        } else if motion.position_rad < self.position_min_rad {
            range.0 = range.0.max(braking_nm.max(0.0));
        }
        // At one end of the range and fast towards it from the other side: braking is right for both.
        if range.0 > range.1 {
            (braking_nm, braking_nm)
        } else {
            range
        }
    }
}

/// Applies every joint's limits; returns the torques to send and the joints that were limited, one bit each.
pub fn allowed_torques_nm(
    limits: &[JointLimits],
    asked_nm: &[f64; JOINTS_MAX],
    sent_nm: &[f64; JOINTS_MAX],
    motion: &[JointMotion; JOINTS_MAX],
    period_s: f64,
) -> ([f64; JOINTS_MAX], u64) {
    let mut torque_nm = [0.0; JOINTS_MAX];
    let mut limited_joints = 0;
    for (joint, limit) in limits.iter().enumerate() {
        torque_nm[joint] =
            limit.allowed_torque_nm(asked_nm[joint], sent_nm[joint], motion[joint], period_s);
        if torque_nm[joint] != asked_nm[joint] {
            limited_joints |= 1 << joint;
        }
    }
    (torque_nm, limited_joints)
}

/// [`allowed_torques_nm`] for velocities.
pub fn allowed_velocities_rad_s(
    limits: &[JointLimits],
    asked_rad_s: &[f64; JOINTS_MAX],
    sent_rad_s: &[f64; JOINTS_MAX],
    motion: &[JointMotion; JOINTS_MAX],
    period_s: f64,
) -> ([f64; JOINTS_MAX], u64) {
    let mut velocity_rad_s = [0.0; JOINTS_MAX];
    let mut limited_joints = 0;
    for (joint, limit) in limits.iter().enumerate() {
        velocity_rad_s[joint] = limit.allowed_velocity_rad_s(
            asked_rad_s[joint],
            sent_rad_s[joint],
            motion[joint],
            period_s,
        );
        if velocity_rad_s[joint] != asked_rad_s[joint] {
            limited_joints |= 1 << joint;
        }
    }
    (velocity_rad_s, limited_joints)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LIMITS: JointLimits = JointLimits {
        gear_ratio: 50.0,
        motor_torque_nm: 2.0,
        motor_torque_rate_nm_s: 300.0,
        position_min_rad: -1.0,
        position_max_rad: 1.0,
        velocity_rad_s: 0.5,
        acceleration_rad_s2: 5.0,
        damping_nm_s_rad: 50.0,
    };
    const STILL: JointMotion = JointMotion {
        position_rad: 0.0,
        velocity_rad_s: 0.0,
    };
    const PERIOD_S: f64 = 1.0 / 1500.0;

    #[test]
    fn inside_all_limits_nothing_changes() {
        assert_eq!(LIMITS.allowed_torque_nm(1.0, 1.0, STILL, PERIOD_S), 1.0);
    }

    #[test]
    fn the_rate_bounds_a_step() {
        assert!((LIMITS.allowed_torque_nm(2.0, 0.0, STILL, PERIOD_S) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn beyond_the_range_torque_only_leads_back() {
        let outside = JointMotion {
            position_rad: 1.05,
            velocity_rad_s: 0.1,
        };
        assert_eq!(LIMITS.allowed_torque_nm(1.0, 1.0, outside, PERIOD_S), -0.1);
        assert_eq!(
            LIMITS.allowed_torque_nm(-1.0, -1.0, outside, PERIOD_S),
            -1.0
        );
        assert!(!LIMITS.has_run_away(outside));
        assert!(LIMITS.has_run_away(JointMotion {
            position_rad: 1.2,
            velocity_rad_s: 0.0
        }));
    }

    #[test]
    fn too_fast_is_braked() {
        let fast = JointMotion {
            position_rad: 0.0,
            velocity_rad_s: -0.6,
        };
        assert!((LIMITS.allowed_torque_nm(-2.0, -2.0, fast, PERIOD_S) - 0.6).abs() < 1e-12);
        assert!(LIMITS.has_run_away(JointMotion {
            position_rad: 0.0,
            velocity_rad_s: 0.8
        }));
    }

    proptest! {
        #[test]
        fn no_command_passes_the_torque_limit(
            asked in -1e6..1e6_f64, sent in -2.0..2.0_f64, position in -10.0..10.0_f64, velocity in -10.0..10.0_f64,
        ) {
            let motion = JointMotion { position_rad: position, velocity_rad_s: velocity };
            let torque = LIMITS.allowed_torque_nm(asked, sent, motion, PERIOD_S);
            prop_assert!(torque.abs() <= LIMITS.motor_torque_nm);
            // Never drives a joint further out.
            if position > LIMITS.position_max_rad { prop_assert!(torque <= 0.0 || velocity < 0.0); }
            if position < LIMITS.position_min_rad { prop_assert!(torque >= 0.0 || velocity > 0.0); }
        }
    }
}
