//! Effects of robot file, plant file and injection file, all by the same names: what they change, one file per stage.
//!
//! Effects of one kind add up and gains multiply. An effect that begins during the run grows linearly over
//! [`RAMP_S`], so that positions and torques stay continuous; delays, losses, coarser encoders, torque limits and what
//! changes the rigid bodies (payload, link inertia, base tilt) begin at once.

mod actuator;
mod body;
mod friction;
mod sensing;
mod timing;
mod transmission;

use joint_model::friction::SteadyFriction;
use robot::Effect;

pub(crate) use actuator::Actuator;
pub(crate) use body::{JointLoad, chains};
pub(crate) use sensing::Sensing;
pub(crate) use timing::Timing;
pub(crate) use transmission::{ELEMENTS_MAX, Transmission};

/// Over how long an effect grows that begins during the run.
const RAMP_S: f64 = 0.05;

/// One effect and when it begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TimedEffect {
    pub effect: Effect,
    pub start_s: f64,
    /// Multiplies the effect's amplitude.
    pub factor: f64,
}

impl TimedEffect {
    /// An effect that was always there.
    pub fn always(effect: Effect) -> Self {
        Self {
            effect,
            start_s: 0.0,
            factor: 1.0,
        }
    }

    /// Whether it is the same at all times.
    pub fn is_constant(&self) -> bool {
        self.start_s <= 0.0 && !matches!(self.effect, Effect::ThermalFrictionDrift { .. })
    }

    /// Amplitude at a time: 0 before the start, `factor` after the ramp.
    fn strength(&self, time_s: f64) -> f64 {
        if self.start_s <= 0.0 {
            return self.factor;
        }
        self.factor * ((time_s - self.start_s) / RAMP_S).clamp(0.0, 1.0)
    }
}

/// There was no room for an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Full {
    /// Room for so many.
    pub at_most: usize,
}

impl Full {
    fn of<T>(at_most: usize) -> impl FnOnce(arrayvec::CapacityError<T>) -> Self {
        move |_| Self { at_most }
    }
}

/// Everything effects change at one joint, as it is now.
#[derive(Clone, Debug)]
pub(crate) struct Conditions {
    pub friction: SteadyFriction,
    pub transmission: Transmission,
    pub actuator: Actuator,
    pub load: JointLoad,
    pub sensing: Sensing,
    pub timing: Timing,
}

impl Conditions {
    pub fn new(friction: SteadyFriction, transmission: Transmission) -> Self {
        Self {
            friction,
            transmission,
            actuator: Actuator::default(),
            load: JointLoad::default(),
            sensing: Sensing::default(),
            timing: Timing::default(),
        }
    }

    /// Torque needed to hold the link against what effects and tables add, beside what its gear carries.
    pub fn holding_nm(&self, link_position_rad: f64, load_nm: f64) -> f64 {
        self.load.holding_nm(link_position_rad)
            + self.friction.tables.held_nm(link_position_rad, load_nm)
    }

    /// Energy whose slope is [`Conditions::holding_nm`] without load.
    pub fn energy_j(&self, link_position_rad: f64) -> f64 {
        self.load.energy_j(link_position_rad) + self.friction.tables.energy_j(link_position_rad)
    }

    /// Adds an effect as strong as it is at a time; with `time_s` infinite, at its full strength.
    pub fn add(&mut self, timed: &TimedEffect, time_s: f64) -> Result<(), Full> {
        let strength = timed.strength(time_s);
        if strength == 0.0 {
            return Ok(());
        }
        match timed.effect {
            Effect::CoulombFriction { .. }
            | Effect::ViscousFriction { .. }
            | Effect::QuadraticFriction { .. }
            | Effect::StribeckFriction { .. }
            | Effect::AsymmetricFriction { .. }
            | Effect::LoadDependentFriction { .. }
            | Effect::PositionDependentFriction { .. }
            | Effect::ThermalFrictionDrift { .. } => friction::add(
                &mut self.friction,
                &timed.effect,
                strength,
                time_s - timed.start_s,
            ),
            Effect::KinematicError { .. }
            | Effect::TorsionalCompliance { .. }
            | Effect::SoftWindup { .. }
            | Effect::TorsionalHysteresis { .. }
            | Effect::StructuralDamping { .. }
            | Effect::Backlash { .. } => self.transmission.add(&timed.effect, strength),
            Effect::TorqueConstantError { .. }
            | Effect::TorqueOffset { .. }
            | Effect::TorqueRipple { .. }
            | Effect::TorqueSaturation { .. }
            | Effect::CurrentLoopLag { .. } => self.actuator.add(&timed.effect, strength),
            Effect::RotorInertia { .. }
            | Effect::GravityTorque { .. }
            | Effect::JointSpring { .. } => self.load.add(&timed.effect, strength),
            Effect::EncoderOffset { .. }
            | Effect::EncoderEccentricity { .. }
            | Effect::EncoderQuantisation { .. }
            | Effect::VelocityFilterLag { .. } => self.sensing.add(&timed.effect, strength),
            Effect::CommandDelay { .. }
            | Effect::SensorDelay { .. }
            | Effect::DroppedCommands { .. }
            | Effect::DroppedSamples { .. } => {
                self.timing.add(&timed.effect);
                Ok(())
            }
            // these change the chain: body.rs
            Effect::Payload { .. } | Effect::LinkInertia { .. } | Effect::BaseTilt { .. } => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_grows_from_its_start_and_one_from_the_beginning_is_there_at_once() {
        let effect = Effect::TorqueOffset { offset_nm: 1.0 };
        let late = TimedEffect {
            start_s: 1.0,
            ..TimedEffect::always(effect)
        };
        assert_eq!(late.strength(1.0), 0.0);
        assert!((late.strength(1.0 + 0.5 * RAMP_S) - 0.5).abs() < 1e-9);
        assert_eq!(late.strength(2.0), 1.0);
        assert_eq!(TimedEffect::always(effect).strength(0.0), 1.0);
    }
}
