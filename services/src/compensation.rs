//! What the robot file knows of one joint beside friction and rigid bodies, for feedforward.
//!
//! At the link, `gravity_torque` and `joint_spring` have to be held, and torque that only a table knows:
//! `T = a·sin q + b·cos q + k·(q - q_0) + t(q) + t(load) + t(ω = 0)`; what that table adds in motion is friction's. At the shaft the
//! drive's torque `u` comes out as `g·u + T_o + N·τ_r(θ_m)` (`torque_constant_error`, `torque_offset`, `torque_ripple`), so
//! that is undone: a ripple at the measured motor angle, as friction over the angle is. `encoder_offset` is where the joint
//! is when its encoder says zero. Feedback is not divided by `g`: its gains are of torque as the drive has it.

use joint_model::torque_table::TorqueTables;
use robot::{Effect, RobotJoint};

/// One joint's, joint side but for the motor angle.
#[derive(Clone, Debug, PartialEq)]
pub struct Compensation {
    torque_gain: f64,
    torque_offset_nm: f64,
    ripples: Vec<Ripple>,
    gravity_sin_nm: f64,
    gravity_cos_nm: f64,
    springs: Vec<Spring>,
    tables: TorqueTables,
    encoder_offset_rad: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Ripple {
    amplitude_nm: f64,
    cycles_per_motor_rev: f64,
    phase_rad: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Spring {
    stiffness_nm_rad: f64,
    rest_rad: f64,
}

impl Compensation {
    /// Of the effects in a joint's file.
    pub fn of(joint: &RobotJoint) -> Self {
        let mut all = Self {
            torque_gain: 1.0,
            torque_offset_nm: 0.0,
            ripples: Vec::new(),
            gravity_sin_nm: 0.0,
            gravity_cos_nm: 0.0,
            springs: Vec::new(),
            tables: joint.torque_tables(),
            encoder_offset_rad: 0.0,
        };
        for effect in &joint.effects {
            all.add(effect, joint.gear_ratio);
        }
        all
    }

    fn add(&mut self, effect: &Effect, gear_ratio: f64) {
        match *effect {
            Effect::TorqueConstantError { gain } => self.torque_gain *= gain,
            Effect::TorqueOffset { offset_nm } => self.torque_offset_nm += offset_nm,
            Effect::TorqueRipple {
                amplitude_nm,
                cycles_per_motor_rev,
                phase_rad,
            } => self.ripples.push(Ripple {
                amplitude_nm: gear_ratio * amplitude_nm,
                cycles_per_motor_rev,
                phase_rad,
            }),
            Effect::GravityTorque { sin_nm, cos_nm } => {
                self.gravity_sin_nm += sin_nm;
                self.gravity_cos_nm += cos_nm;
            }
            Effect::JointSpring {
                stiffness_nm_rad,
                rest_rad,
            } => self.springs.push(Spring {
                stiffness_nm_rad,
                rest_rad,
            }),
            Effect::EncoderOffset { offset_rad } => self.encoder_offset_rad += offset_rad,
            _ => {}
        }
    }

    /// Where the link is when its encoder is to read this.
    pub fn link_rad(&self, reading_rad: f64) -> f64 {
        reading_rad - self.encoder_offset_rad
    }

    /// Torque that holds the link against added gravity, springs and tables, beside what else it carries.
    pub fn holding_nm(&self, link_rad: f64, load_nm: f64) -> f64 {
        let (sin, cos) = link_rad.sin_cos();
        let springs_nm: f64 = self
            .springs
            .iter()
            .map(|spring| spring.stiffness_nm_rad * (link_rad - spring.rest_rad))
            .sum();
        self.gravity_sin_nm * sin
            + self.gravity_cos_nm * cos
            + springs_nm
            + self.tables.held_nm(link_rad, load_nm)
    }

    /// What to send for this torque at the shaft.
    pub fn sent_nm(&self, shaft_nm: f64, motor_rad: f64) -> f64 {
        let ripple_nm: f64 = self
            .ripples
            .iter()
            .map(|ripple| {
                let angle_rad = ripple.cycles_per_motor_rev * motor_rad + ripple.phase_rad;
                ripple.amplitude_nm * angle_rad.sin()
            })
            .sum();
        (shaft_nm - self.torque_offset_nm - ripple_nm) / self.torque_gain
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use robot::{TableOver, TorqueTable};

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
