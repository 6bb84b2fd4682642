//! What is fed forward against one joint's friction: PA10-05, eq (5), on desired or measured velocity.
//!
//! `T_friction = s·g(ω, θ_m, T) + f(ω_d)`: dry friction `g` in the direction `s` of the desired motion, and fluid drag `f`.
//!
//! The motor angle `θ_m` is always the measured one. Friction has twelve and more cycles per motor revolution, on the PA-10
//! one in 10 mrad of joint motion; looked up at the desired angle, an error of half of that compensates in antiphase and
//! holds the joint back until feedback tears it loose. The encoder knows the wave generator's angle exactly, and an angle,
//! unlike a velocity, does not flicker.
//!
//! With [`FrictionVelocity::Measured`] the dry level is that of the observed speed, so it is never more than what the model
//! says is there. A joint whose friction falls with speed (PA10-05, joint 7: 2.3 Nm at rest, 1.1 Nm sliding) is given what it
//! takes to break away; at the desired speed it gets half of that, sticks until feedback adds the rest, and leaps. A joint whose
//! friction rises (joints 1 to 6) is not pushed with more than it resists. The direction stays the desired one on purpose: at
//! standstill it is the one the joint is about to break away in, and against an opposite motion it brakes. A direction taken from
//! the observed velocity makes the compensation follow every spring-back of the gear, a limit cycle at standstill. Fluid drag
//! stays on the desired velocity too: fed forward on the measured one it would take away the damping it has.
//! Limit: where friction rises with speed, the measured level compensates the damping in it as well, which joint 4 notices.

use joint_model::friction::{Direction, Sliding, SteadyFriction};
use shm_types::control_options::FrictionVelocity;

/// Friction is fed forward fully above this desired velocity, and in proportion below: a step at a reversal of the
/// reference would hit a joint that has not reversed yet. The lowest velocity the papers identified friction at (PA10-03).
pub const REVERSAL_VELOCITY_RAD_S: f64 = 0.005;

/// One joint's friction feedforward.
#[derive(Clone, Debug)]
pub struct FrictionFeedforward {
    law: SteadyFriction,
    velocity: FrictionVelocity,
}

/// What friction is taken at, joint side but for the motor angle.
#[derive(Clone, Copy, Debug)]
pub struct FrictionPoint {
    /// The reference's.
    pub desired_velocity_rad_s: f64,
    /// The joint's own, observed.
    pub measured_velocity_rad_s: f64,
    /// Before the gear.
    pub motor_position_rad: f64,
    /// Torque the gear transmits to the link.
    pub load_nm: f64,
}

impl FrictionFeedforward {
    /// Feedforward of a friction law.
    pub fn new(law: SteadyFriction, velocity: FrictionVelocity) -> Self {
        Self { law, velocity }
    }

    /// Torque to spend, joint side, positive with positive desired velocity.
    pub fn drag_nm(&self, at: &FrictionPoint) -> f64 {
        let desired_rad_s = at.desired_velocity_rad_s;
        let velocity_rad_s = match self.velocity {
            FrictionVelocity::Desired => desired_rad_s,
            FrictionVelocity::Measured => at.measured_velocity_rad_s,
        };
        let level_nm = self.law.level_nm(&Sliding {
            speed_rad_s: velocity_rad_s.abs(),
            direction: Direction::of(desired_rad_s),
            load_nm: at.load_nm,
            motor_position_rad: at.motor_position_rad,
        });
        level_nm * (desired_rad_s / REVERSAL_VELOCITY_RAD_S).tanh()
            + self.law.fluid_drag_nm(desired_rad_s)
    }
}

#[cfg(test)]
mod tests {
    use joint_model::velocity_observer::VelocityObserver;

    use super::*;

    /// PA10-05, Table II: friction of joint 7 falls with speed, that of all others rises.
    fn joint_7(velocity: FrictionVelocity) -> (FrictionFeedforward, SteadyFriction) {
        of_joint(6, velocity)
    }

    fn of_joint(index: usize, velocity: FrictionVelocity) -> (FrictionFeedforward, SteadyFriction) {
        let law = robot::load("pa10").expect("shipped").joints[index].steady_friction();
        (FrictionFeedforward::new(law.clone(), velocity), law)
    }

    fn at(desired_velocity_rad_s: f64, measured_velocity_rad_s: f64) -> FrictionPoint {
        FrictionPoint {
            desired_velocity_rad_s,
            measured_velocity_rad_s,
            motor_position_rad: 0.0,
            load_nm: 0.0,
        }
    }

    #[test]
    fn both_agree_where_the_joint_moves_as_desired() {
        let (desired, law) = joint_7(FrictionVelocity::Desired);
        let (measured, _) = joint_7(FrictionVelocity::Measured);
        for velocity_rad_s in [-0.3, -0.05, 0.05, 0.3] {
            let point = at(velocity_rad_s, velocity_rad_s);
            let law_nm = law.drag_nm(velocity_rad_s, 0.0, 0.0, REVERSAL_VELOCITY_RAD_S);
            assert_eq!(measured.drag_nm(&point), desired.drag_nm(&point));
            assert_eq!(desired.drag_nm(&point), law_nm);
            assert!(law_nm * velocity_rad_s > 0.0);
        }
    }

    #[test]
    fn a_joint_that_sticks_gets_what_it_takes_to_break_away_and_no_more() {
        for joint in [3, 6] {
            let (measured, law) = of_joint(joint, FrictionVelocity::Measured);
            let drag_nm = measured.drag_nm(&at(0.2, 0.0)) - law.fluid_drag_nm(0.2);
            assert!((drag_nm - law.level_nm(&Sliding::at(0.0))).abs() < 1e-9);
        }
        let desired_nm = |joint| {
            let (desired, law) = of_joint(joint, FrictionVelocity::Desired);
            desired.drag_nm(&at(0.2, 0.0)) / law.level_nm(&Sliding::at(0.0))
        };
        assert!(desired_nm(3) > 1.2, "joint 4 is pushed");
        assert!(desired_nm(6) < 0.7, "joint 7 sticks");
    }

    #[test]
    fn against_an_opposite_motion_it_brakes() {
        let (measured, _) = joint_7(FrictionVelocity::Measured);
        assert!(measured.drag_nm(&at(0.1, -0.2)) * -0.2 < 0.0);
    }

    #[test]
    fn at_rest_a_flickering_encoder_moves_no_torque() {
        const STEP_RAD: f64 = 7.66e-6; // PA10-05, section II
        let (measured, law) = joint_7(FrictionVelocity::Measured);
        let mut observer = VelocityObserver::new(25.0, 1.0 / 1500.0);
        let (mut resting_nm, mut slow_nm) = (Vec::new(), Vec::new());
        for cycle in 0..1500 {
            let velocity_rad_s = observer.observe(cycle, STEP_RAD * (cycle * 7 % 3 % 2) as f64);
            resting_nm.push(measured.drag_nm(&at(0.0, velocity_rad_s)));
            slow_nm.push(measured.drag_nm(&at(0.02, velocity_rad_s)));
        }
        let variation_nm = |torques_nm: &[f64]| -> f64 {
            torques_nm
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).abs())
                .sum()
        };
        assert_eq!(variation_nm(&resting_nm), 0.0);
        // a second of flicker, less than the level itself once
        assert!(
            variation_nm(&slow_nm) < law.level_nm(&Sliding::at(0.0)),
            "{}",
            variation_nm(&slow_nm)
        );
    }
}
