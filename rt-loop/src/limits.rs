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
    /// Joint side: a reference may go this far before the joint must have moved by one step of its encoder.
    pub standstill_rad: f64,
    /// Joint side: a joint this far from its reference does not follow it.
    pub following_rad: f64,
}

/// Motion of one joint, joint side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct JointMotion {
    /// Position.
    pub position_rad: f64,
    /// Velocity.
    pub velocity_rad_s: f64,
}

/// `value` between `lowest` and `highest`; a bound that is no number does not bind, and a value that is none is zero.
///
/// [`f64::clamp`] panics where a bound is no number or the bounds have crossed, and the loop must outlive any input.
pub(crate) fn within(lowest: f64, value: f64, highest: f64) -> f64 {
    let value = if value.is_nan() { 0.0 } else { value };
    value.max(lowest).min(highest)
}

/// A joint this far over its velocity limit has run away.
pub const RUNAWAY_VELOCITY_FACTOR: f64 = 1.5;
/// A joint this far outside its position range has run away.
pub const RUNAWAY_POSITION_RAD: f64 = 0.1;

impl JointLimits {
    /// The torque that may be sent instead of `asked_nm`, motor side; equal to it where no limit acts.
    ///
    /// `sent_nm` was sent one `period_s` ago. Whatever comes in, what comes out is a number within the limit.
    pub fn allowed_torque_nm(
        &self,
        asked_nm: f64,
        sent_nm: f64,
        motion: JointMotion,
        period_s: f64,
    ) -> f64 {
        let step_nm = self.motor_torque_rate_nm_s * period_s;
        let rated_nm = within(sent_nm - step_nm, asked_nm, sent_nm + step_nm);
        let (lowest_nm, highest_nm) = self.torque_range_nm(motion);
        // The range narrows to braking beyond a limit; it overrules the rate, which would let the joint run on.
        let ranged_nm = within(lowest_nm, rated_nm, highest_nm);
        within(-self.motor_torque_nm, ranged_nm, self.motor_torque_nm)
    }

    /// The velocity that may be sent instead of `asked_rad_s`, joint side; equal to it where no limit acts.
    ///
    /// `sent_rad_s` was sent one `period_s` ago. Whatever comes in, what comes out is a number within the limit.
    pub fn allowed_velocity_rad_s(
        &self,
        asked_rad_s: f64,
        sent_rad_s: f64,
        motion: JointMotion,
        period_s: f64,
    ) -> f64 {
        let step_rad_s = self.acceleration_rad_s2 * period_s;
        let rated_rad_s = within(
            sent_rad_s - step_rad_s,
            asked_rad_s,
            sent_rad_s + step_rad_s,
        );
        let (mut lowest_rad_s, mut highest_rad_s) = (-self.velocity_rad_s, self.velocity_rad_s);
        if motion.position_rad > self.position_max_rad {
            highest_rad_s = 0.0;
        } else if motion.position_rad < self.position_min_rad {
            lowest_rad_s = 0.0;
        }
        within(lowest_rad_s, rated_rad_s, highest_rad_s)
    }

    /// Motor torque that brakes this motion; none for a velocity that is no number.
    pub fn damping_torque_nm(&self, motion: JointMotion) -> f64 {
        let torque_nm = -self.damping_nm_s_rad * motion.velocity_rad_s / self.gear_ratio;
        within(-self.motor_torque_nm, torque_nm, self.motor_torque_nm)
    }

    /// Whether the joint is so far outside its limits that something else moves it.
    pub fn has_run_away(&self, motion: JointMotion) -> bool {
        // What is no number is outside too.
        let slow = motion.velocity_rad_s.abs() <= RUNAWAY_VELOCITY_FACTOR * self.velocity_rad_s;
        let inside = motion.position_rad <= self.position_max_rad + RUNAWAY_POSITION_RAD
            && motion.position_rad >= self.position_min_rad - RUNAWAY_POSITION_RAD;
        !(slow && inside)
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
        standstill_rad: 0.05,
        following_rad: 1.0,
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

    /// Numbers of every kind, those that are none among them.
    fn anything() -> impl Strategy<Value = f64> {
        let odd = prop::sample::select(vec![
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            f64::MIN,
            0.0,
            -0.0,
        ]);
        prop_oneof![odd, any::<f64>(), -10.0..10.0_f64]
    }

    #[test]
    fn a_motion_that_is_no_number_is_braked_by_nothing_and_has_run_away() {
        let none = JointMotion {
            position_rad: f64::NAN,
            velocity_rad_s: f64::NAN,
        };
        assert_eq!(LIMITS.damping_torque_nm(none), 0.0);
        assert_eq!(LIMITS.allowed_torque_nm(0.1, 0.0, none, PERIOD_S), 0.1);
        for half in [(0.0, f64::NAN), (f64::NAN, 0.0)] {
            let (position_rad, velocity_rad_s) = half;
            assert!(LIMITS.has_run_away(JointMotion {
                position_rad,
                velocity_rad_s
            }));
        }
    }

    proptest! {
        #[test]
        fn whatever_comes_in_what_is_sent_is_within_the_limit(
            asked in anything(), sent in anything(), position_rad in anything(), velocity_rad_s in anything(),
            period_s in anything(),
        ) {
            let motion = JointMotion { position_rad, velocity_rad_s };
            let torque_nm = LIMITS.allowed_torque_nm(asked, sent, motion, period_s);
            prop_assert!(torque_nm.abs() <= LIMITS.motor_torque_nm, "{torque_nm} Nm");
            let velocity = LIMITS.allowed_velocity_rad_s(asked, sent, motion, period_s);
            prop_assert!(velocity.abs() <= LIMITS.velocity_rad_s, "{velocity} rad/s");
            prop_assert!(LIMITS.damping_torque_nm(motion).abs() <= LIMITS.motor_torque_nm);
        }

        #[test]
        fn limits_that_are_no_numbers_panic_nowhere(values in prop::array::uniform8(anything()), other in prop::array::uniform4(anything())) {
            let limits = JointLimits {
                gear_ratio: values[0],
                motor_torque_nm: values[1],
                motor_torque_rate_nm_s: values[2],
                position_min_rad: values[3],
                position_max_rad: values[4],
                velocity_rad_s: values[5],
                acceleration_rad_s2: values[6],
                damping_nm_s_rad: values[7],
                standstill_rad: 0.05,
                following_rad: 1.0,
            };
            let motion = JointMotion { position_rad: other[0], velocity_rad_s: other[1] };
            prop_assert!(!limits.allowed_torque_nm(other[2], other[3], motion, PERIOD_S).is_nan());
            prop_assert!(!limits.allowed_velocity_rad_s(other[2], other[3], motion, PERIOD_S).is_nan());
            prop_assert!(!limits.damping_torque_nm(motion).is_nan());
            limits.has_run_away(motion);
        }

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
