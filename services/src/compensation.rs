//! What the robot file knows of one joint beside friction and rigid bodies, for feedforward.
//!
//! At the link, `gravity_torque` and `joint_spring` have to be held, and torque that only a table knows:
//! `T = a·sin q + b·cos q + k·(q - q_0) + t(q) + t(load) + t(ω = 0)`; what that table adds in motion is friction's. At the shaft the
//! drive's torque `u` comes out as `g·u + T_o + N·τ_r(θ_m)` (`torque_constant_error`, `torque_offset`, `torque_ripple`), so
//! that is undone: a ripple at the measured motor angle, as friction over the angle is. `encoder_offset` is where the joint
//! is when its encoder says zero. Feedback is not divided by `g`: its gains are of torque as the drive has it.

use joint_model::friction::SteadyFriction;
use joint_model::harmonic::{self, Harmonic};
use joint_model::joint_spring::JointSpring;
use joint_model::torque_table::TorqueTables;
use robot::effect::parts::{Actuator, Bus, Full, Gear, JointParts, Load, Sensors, Warming};
use robot::{Bodies, EncoderSide, RobotJoint};

/// One joint's, joint side but for the motor angle.
#[derive(Clone, Debug, PartialEq)]
pub struct Compensation {
    gear_ratio: f64,
    torque_gain: f64,
    torque_offset_nm: f64,
    ripples_nm: Vec<Harmonic>,
    gravity_sin_nm: f64,
    gravity_cos_nm: f64,
    springs: Vec<JointSpring>,
    tables: TorqueTables,
    encoder_offset_rad: f64,
}

impl Compensation {
    /// Of the effects in a joint's file.
    pub fn of(joint: &RobotJoint) -> Self {
        let mut all = Self {
            gear_ratio: joint.gear_ratio,
            torque_gain: 1.0,
            torque_offset_nm: 0.0,
            ripples_nm: Vec::new(),
            gravity_sin_nm: 0.0,
            gravity_cos_nm: 0.0,
            springs: Vec::new(),
            tables: joint.torque_tables(),
            encoder_offset_rad: 0.0,
        };
        for effect in &joint.effects {
            let acted = effect.act(&mut all, 1.0);
            assert!(acted.is_ok(), "feedforward has room for all");
        }
        all
    }

    /// Where the link is when its encoder is to read this.
    pub fn link_rad(&self, reading_rad: f64) -> f64 {
        reading_rad - self.encoder_offset_rad
    }

    /// Torque that holds the link against added gravity, springs and tables, beside what else it carries.
    pub fn holding_nm(&self, link_rad: f64, load_nm: f64) -> f64 {
        let (sin, cos) = link_rad.sin_cos();
        let springs = self.springs.iter();
        let springs_nm: f64 = springs.map(|spring| spring.holding_nm(link_rad)).sum();
        self.gravity_sin_nm * sin
            + self.gravity_cos_nm * cos
            + springs_nm
            + self.tables.held_nm(link_rad, load_nm)
    }

    /// What to send for this torque at the shaft.
    pub fn sent_nm(&self, shaft_nm: f64, motor_rad: f64) -> f64 {
        let ripple_nm = harmonic::sum(&self.ripples_nm, motor_rad);
        (shaft_nm - self.torque_offset_nm - ripple_nm) / self.torque_gain
    }
}

impl JointParts for Compensation {
    /// Steady friction has it.
    fn friction(&mut self) -> Option<&mut SteadyFriction> {
        None
    }

    /// Nobody tells how long a joint has been warming.
    fn warming(&mut self) -> Option<&mut dyn Warming> {
        None
    }

    /// References are the link's, and what the gear bends is not led.
    fn gear(&mut self) -> Option<&mut dyn Gear> {
        None
    }

    fn actuator(&mut self) -> Option<&mut dyn Actuator> {
        Some(self)
    }

    fn load(&mut self) -> Option<&mut dyn Load> {
        Some(self)
    }

    /// The loaded chain has them.
    fn bodies(&mut self) -> Option<&mut Bodies> {
        None
    }

    fn sensors(&mut self) -> Option<&mut dyn Sensors> {
        Some(self)
    }

    /// References are not led by what the bus is late.
    fn bus(&mut self) -> Option<&mut dyn Bus> {
        None
    }
}

impl Actuator for Compensation {
    fn scale_torque(&mut self, gain: f64) {
        self.torque_gain *= gain;
    }

    fn add_torque(&mut self, offset_nm: f64) {
        self.torque_offset_nm += offset_nm;
    }

    fn add_ripple(&mut self, ripple_nm: Harmonic) -> Result<(), Full> {
        self.ripples_nm.push(Harmonic {
            amplitude: self.gear_ratio * ripple_nm.amplitude,
            ..ripple_nm
        });
        Ok(())
    }

    /// More than the drive gives cannot be asked for.
    fn limit_torque(&mut self, _limit_nm: f64) {}

    /// A lag is not led.
    fn add_lag(&mut self, _time_constant_s: f64) {}
}

impl Load for Compensation {
    /// Feedforward takes the rotor from [`RobotJoint::reflected_inertia_kg_m2`].
    fn add_rotor_inertia(&mut self, _inertia_kg_m2: f64) {}

    fn add_gravity(&mut self, sin_nm: f64, cos_nm: f64) {
        self.gravity_sin_nm += sin_nm;
        self.gravity_cos_nm += cos_nm;
    }

    fn add_spring(&mut self, spring: JointSpring) -> Result<(), Full> {
        self.springs.push(spring);
        Ok(())
    }
}

/// Of what sensors show beside the truth, only the zero moves what the joint has to do.
impl Sensors for Compensation {
    fn add_offset(&mut self, offset_rad: f64) {
        self.encoder_offset_rad += offset_rad;
    }

    fn add_eccentricity(&mut self, _side: EncoderSide, _error_rad: Harmonic) -> Result<(), Full> {
        Ok(())
    }

    fn set_resolution(&mut self, _side: EncoderSide, _resolution_rad: f64) {}

    fn filter_velocity(&mut self, _cutoff_hz: f64) {}
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use robot::{Effect, TableOver, TorqueTable};

    use super::*;

    fn joint(effects: &[Effect]) -> Compensation {
        let mut joint = robot::load("shd17").unwrap().joints.remove(0);
        joint.effects = effects.to_vec();
        Compensation::of(&joint)
    }

    #[test]
    fn a_joint_without_such_effects_is_left_as_it_is() {
        let plain = joint(&[Effect::CoulombFriction { coulomb_nm: 3.0 }]);
        assert_eq!(plain.sent_nm(4.25, 1.0), 4.25);
        assert_eq!(plain.holding_nm(0.7, 2.0), 0.0);
        assert_eq!(plain.link_rad(0.7), 0.7);
    }

    #[test]
    fn what_is_sent_comes_out_as_the_torque_that_was_wanted() {
        let (gain, offset_nm, amplitude_nm) = (0.9, 1.5, 0.01);
        let known = joint(&[
            Effect::TorqueConstantError { gain },
            Effect::TorqueOffset { offset_nm },
            Effect::TorqueRipple {
                amplitude_nm,
                cycles_per_motor_rev: 2.0,
                phase_rad: 0.4,
            },
        ]);
        for motor_rad in [0.0_f64, 0.8, 3.0] {
            let shaft_nm = gain * known.sent_nm(7.0, motor_rad)
                + offset_nm
                + 100.0 * amplitude_nm * (2.0 * motor_rad + 0.4).sin();
            assert!((shaft_nm - 7.0).abs() < 1e-12, "{shaft_nm}");
        }
    }

    #[test]
    fn a_table_is_held_over_position_load_and_at_rest() {
        let mut file = robot::load("shd17").unwrap().joints.remove(0);
        file.effects.clear();
        let tables = [TableOver::Position, TableOver::Load, TableOver::Velocity].into_iter();
        file.torque_tables = tables
            .map(|over| TorqueTable {
                over,
                at: vec![0.0, 1.0],
                torque_nm: vec![0.5, 2.5],
            })
            .collect();
        let known = Compensation::of(&file);
        assert!((known.holding_nm(0.5, 0.25) - (1.5 + 1.0 + 0.5)).abs() < 1e-12);
    }

    #[test]
    fn springs_and_gravity_add_up_and_springs_rest() {
        let spring = |stiffness_nm_rad, rest_rad| Effect::JointSpring {
            stiffness_nm_rad,
            rest_rad,
        };
        let gravity = Effect::GravityTorque {
            sin_nm: 2.0,
            cos_nm: -1.0,
        };
        assert_eq!(joint(&[spring(5.0, 0.3)]).holding_nm(0.3, 2.0), 0.0);
        let all = joint(&[spring(5.0, 0.3), spring(1.0, 0.0), gravity]);
        let expected_nm = 5.0 * 0.2 + 0.5 + 2.0 * 0.5_f64.sin() - 0.5_f64.cos();
        assert!((all.holding_nm(0.5, 2.0) - expected_nm).abs() < 1e-12);
    }
}
