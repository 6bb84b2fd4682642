//! Friction of a harmonic-drive joint, joint side: one law, one file.
//!
//! Dry laws give a *level*: the torque spent against friction per unit of direction, which [`SteadyFriction`] turns
//! into a feedforward torque and [`LuGre`] into bristles. Drag (`drag_nm`) is the torque the drive spends, positive
//! with positive velocity as in PA10-05 eq (5); friction acts on the joint with the opposite sign.

mod asymmetric;
mod coulomb;
mod cubic;
mod load_dependent;
mod load_torque;
mod lookup;
mod lugre;
mod periodic;
mod quadratic;
mod steady;
mod stribeck;
mod thermal;
mod viscous;

pub use asymmetric::AsymmetricFriction;
pub use coulomb::CoulombFriction;
pub use cubic::{CubicFriction, CubicRow};
pub use load_dependent::LoadDependentFriction;
pub use load_torque::{LoadTorque, LoadTorqueRow};
pub use lookup::FrictionLookup;
pub use lugre::{BristleStep, LuGre};
pub use periodic::{PeriodicFriction, cycles_per_motor_rev};
pub use quadratic::QuadraticFriction;
pub use steady::{SteadyFriction, TERMS_MAX};
pub use stribeck::{StribeckCurve, StribeckFriction, StribeckRow};
pub use thermal::ThermalFrictionDrift;
pub use viscous::ViscousFriction;

/// Direction of motion about the joint's axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Along the axis; a joint at rest counts here.
    Positive,
    /// Against the axis.
    Negative,
}

impl Direction {
    /// Direction of a velocity.
    pub fn of(velocity_rad_s: f64) -> Self {
        if velocity_rad_s < 0.0 {
            Self::Negative
        } else {
            Self::Positive
        }
    }

    /// +1 or -1.
    pub fn sign(self) -> f64 {
        match self {
            Self::Positive => 1.0,
            Self::Negative => -1.0,
        }
    }
}

/// What a dry friction level may depend on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sliding {
    /// Magnitude of the joint velocity.
    pub speed_rad_s: f64,
    /// Its direction.
    pub direction: Direction,
    /// Torque the gear transmits to the link, about the joint's axis (slowly moved: the gravity torque).
    pub load_nm: f64,
    /// Motor angle, before the gear.
    pub motor_position_rad: f64,
}

impl Sliding {
    /// Motion without load at motor angle zero.
    pub fn at(velocity_rad_s: f64) -> Self {
        Self {
            speed_rad_s: velocity_rad_s.abs(),
            direction: Direction::of(velocity_rad_s),
            load_nm: 0.0,
            motor_position_rad: 0.0,
        }
    }
}

/// A dry friction law.
pub trait DryFriction {
    /// Friction level, or the change it makes to one; a positive level opposes motion.
    fn level_nm(&self, at: &Sliding) -> f64;
}
