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
//! says is there: a joint that sticks is not pushed with the friction of one that slides, and a joint whose friction rises with
//! speed (PA10-05, joint 7) does not leap when it breaks away. The direction stays the desired one on purpose: at
//! standstill it is the one the joint is about to break away in, and against an opposite motion it brakes. A direction taken from
//! the observed velocity makes the compensation follow every spring-back of the gear, a limit cycle at standstill. Fluid drag
//! stays on the desired velocity too: fed forward on the measured one it would take away the damping it has.
//! Limit: where friction falls with speed, the measured level brakes less than it should when the joint is too fast.

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
