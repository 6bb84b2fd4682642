//! The parts of a joint that effects of robot file, plant file and injection file act on, one file a part.
//!
//! Effects of one kind add up and gains multiply. An effect that begins during the run grows linearly over
//! [`RAMP_S`], so that positions and torques stay continuous; delays, losses, coarser encoders, torque limits and what
//! changes the rigid bodies (payload, link inertia, base tilt) begin at once.

mod actuator;
mod body;
mod sensing;
mod timing;
mod transmission;

use joint_model::friction::{SteadyFriction, ThermalFrictionDrift};
use robot::effect::parts::{self, Bus, Full, Gear, JointParts, Load, Sensors, Warming};
use robot::{Bodies, Effect, EffectKind};

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
        self.start_s <= 0.0 && self.effect.kind() != EffectKind::ThermalFrictionDrift
    }

    /// Amplitude at a time: 0 before the start, `factor` after the ramp.
    fn strength(&self, time_s: f64) -> f64 {
        if self.start_s <= 0.0 {
            return self.factor;
        }
        self.factor * ((time_s - self.start_s) / RAMP_S).clamp(0.0, 1.0)
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
    ///
    /// # Errors
    /// [`Full`].
    pub fn add(&mut self, timed: &TimedEffect, time_s: f64) -> Result<(), Full> {
        let strength = timed.strength(time_s);
        if strength == 0.0 {
            return Ok(());
        }
        let mut now = Now {
            conditions: self,
            elapsed_s: time_s - timed.start_s,
        };
        timed.effect.act(&mut now, strength)
    }
}

/// A joint at an instant of an effect.
struct Now<'a> {
    conditions: &'a mut Conditions,
    /// Since the effect began.
    elapsed_s: f64,
}

impl JointParts for Now<'_> {
    fn friction(&mut self) -> Option<&mut SteadyFriction> {
        Some(&mut self.conditions.friction)
    }

    fn warming(&mut self) -> Option<&mut dyn Warming> {
        Some(self)
    }

    fn gear(&mut self) -> Option<&mut dyn Gear> {
        Some(&mut self.conditions.transmission)
    }

    fn actuator(&mut self) -> Option<&mut dyn parts::Actuator> {
        Some(&mut self.conditions.actuator)
    }

    fn load(&mut self) -> Option<&mut dyn Load> {
        Some(&mut self.conditions.load)
    }

    /// The chains of a run have them.
    fn bodies(&mut self) -> Option<&mut Bodies> {
        None
    }

    fn sensors(&mut self) -> Option<&mut dyn Sensors> {
        Some(&mut self.conditions.sensing)
    }

    fn bus(&mut self) -> Option<&mut dyn Bus> {
        Some(&mut self.conditions.timing)
    }
}

impl Warming for Now<'_> {
    fn add_drift(&mut self, drift: ThermalFrictionDrift) {
        self.conditions.friction.coulomb.coulomb_nm += drift.change_nm(self.elapsed_s);
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
