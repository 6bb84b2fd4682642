//! One joint as the simulation has it: what the robot file says, with changes.

use arrayvec::ArrayVec;
use joint_model::friction::{Sliding, SteadyFriction, ThermalFrictionDrift};
use joint_model::transmission::{
    Backlash, KinematicError, KinematicHarmonic, LinearCompliance, SoftWindup, Spring,
    StructuralDamping, TorsionalHysteresis,
};
use robot::{Effect, EncoderSide, Robot, add_friction};

/// No change makes the gear softer than this.
const STIFFNESS_MIN_NM_RAD: f64 = 1.0;

/// A degree of the motor at a ratio of a hundred.
const PRESLIDING_RAD: f64 = 2e-4;

/// Twist under its own friction of a gear whose stiffness no file tells: less than any encoder shows.
const STIFF_RAD: f64 = 1e-5;
/// Such a gear is at least this stiff.
const STIFF_MIN_NM_RAD: f64 = 1e4;

/// The most terms of a kind that one joint is given.
const TERMS_MAX: usize = 8;

/// A sine over an angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonic {
    /// Of the quantity it adds to.
    pub amplitude: f64,
    /// Per revolution of the angle.
    pub cycles_per_rev: f64,
    /// At angle zero.
    pub phase_rad: f64,
}

impl Harmonic {
    fn at(&self, angle_rad: f64) -> f64 {
        self.amplitude * (self.cycles_per_rev * angle_rad + self.phase_rad).sin()
    }
}

/// Sum of harmonics at an angle.
pub(crate) fn sum(harmonics: &[Harmonic], angle_rad: f64) -> f64 {
    harmonics
        .iter()
        .map(|harmonic| harmonic.at(angle_rad))
        .sum()
}

/// A spring to a rest position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSpring {
    /// At the joint.
    pub stiffness_nm_rad: f64,
    /// Where it pulls to.
    pub rest_rad: f64,
}

/// One joint's physics, joint side where nothing else is said.
#[derive(Clone, Debug, PartialEq)]
pub struct JointModel {
    /// Motor turns per joint turn.
    pub gear_ratio: f64,
    /// Rotor inertia at the joint side.
    pub rotor_inertia_kg_m2: f64,
    /// All friction over velocity, load and motor angle.
    pub friction: SteadyFriction,
    /// How far a joint at rest gives before it slips. No robot file speaks of it; every real gear does it.
    pub presliding_rad: f64,
    /// Friction that changes with time.
    pub drift: Option<ThermalFrictionDrift>,
    /// Stiffness of the gear; of a gear that is as good as rigid where the robot file tells none.
    pub stiffness_nm_rad: f64,
    /// Whether the robot file tells the stiffness.
    pub stiffness_is_known: bool,
    /// Low stiffness and knee torque.
    pub soft_windup: Option<(f64, f64)>,
    /// Rate-independent loop.
    pub hysteresis: Option<TorsionalHysteresis>,
    /// Loss with torsion rate.
    pub structural_damping: Option<StructuralDamping>,
    /// Lost motion.
    pub backlash: Backlash,
    /// Position error of the gear.
    pub kinematic_error: KinematicError,
    /// True over nominal torque constant.
    pub torque_gain: f64,
    /// Added to the motor torque.
    pub torque_offset_nm: f64,
    /// Motor side.
    pub torque_ripple: ArrayVec<Harmonic, TERMS_MAX>,
    /// Motor side.
    pub torque_limit_nm: f64,
    /// Of the current loop.
    pub current_lag_s: f64,
    /// Added torque that holds the joint, with the sine and the cosine of its angle.
    pub gravity_sin_cos_nm: [f64; 2],
    /// Springs between the links.
    pub springs: ArrayVec<JointSpring, TERMS_MAX>,
    /// Of both encoders, joint side.
    pub encoder_offset_rad: f64,
    /// On the motor angle, motor side.
    pub motor_eccentricity: ArrayVec<Harmonic, TERMS_MAX>,
    /// On the link angle.
    pub link_eccentricity: ArrayVec<Harmonic, TERMS_MAX>,
    /// Motor side; zero for none.
    pub motor_resolution_rad: f64,
    /// Zero for none.
    pub link_resolution_rad: f64,
    /// How much later the link's encoder is read than the motor's.
    pub link_skew_s: f64,
    /// Zero of the link's encoder less that of the motor's.
    pub link_zero_rad: f64,
    /// Noise of the position sensors, each on its side.
    pub position_noise_rad: f64,
    /// Motor side.
    pub torque_noise_nm: f64,
    /// Beside the controller's own delay.
    pub command_delay_s: f64,
    /// Of every measurement.
    pub sensor_delay_s: f64,
    /// Part of the commands that never arrives.
    pub dropped_commands: f64,
}

impl JointModel {
    /// The joint as its robot file has it.
    pub fn nominal(robot: &Robot, joint: usize) -> Self {
        let file = &robot.joints[joint];
        let friction = file.steady_friction();
        let friction_nm = friction.level_nm(&Sliding::at(0.0));
        let mut model = Self {
            gear_ratio: file.gear_ratio,
            rotor_inertia_kg_m2: file.rotor_inertia_kg_m2 * file.gear_ratio.powi(2),
            friction,
            presliding_rad: PRESLIDING_RAD,
            drift: None,
            stiffness_nm_rad: STIFF_MIN_NM_RAD.max(friction_nm / STIFF_RAD),
            stiffness_is_known: false,
            soft_windup: None,
            hysteresis: None,
            structural_damping: None,
            backlash: Backlash::default(),
            kinematic_error: KinematicError::default(),
            torque_gain: 1.0,
            torque_offset_nm: 0.0,
            torque_ripple: ArrayVec::new(),
            torque_limit_nm: file.torque_limit_nm.unwrap_or(f64::INFINITY),
            current_lag_s: 0.0,
            gravity_sin_cos_nm: [0.0; 2],
            springs: ArrayVec::new(),
            encoder_offset_rad: 0.0,
            motor_eccentricity: ArrayVec::new(),
            link_eccentricity: ArrayVec::new(),
            motor_resolution_rad: file.motor_encoder_resolution_rad.unwrap_or(0.0),
            link_resolution_rad: file.link_encoder_resolution_rad.unwrap_or(0.0),
            link_skew_s: 0.0,
            link_zero_rad: 0.0,
            position_noise_rad: file.position_noise_rad,
            torque_noise_nm: file.torque_noise_nm,
            command_delay_s: 0.0,
            sensor_delay_s: 0.0,
            dropped_commands: 0.0,
        };
        for effect in &file.effects {
            // friction is in `steady_friction`
            model.add_beside_friction(effect);
        }
        for effect in &robot.shared_effects {
            model.add_timing(effect);
        }
        model
    }

    /// The joint with an effect more. Effects on links and base change the load, not the joint: see
    /// [`Load`](crate::twin::load::Load).
    #[must_use]
    pub fn with(&self, effect: &Effect) -> Self {
        let mut model = self.clone();
        // Terms beyond the room there is are left out: a diagnosis adds a few at most.
        let _ = add_friction(&mut model.friction, effect, 1.0);
        model.add_beside_friction(effect);
        model
    }

    fn add_beside_friction(&mut self, effect: &Effect) {
        self.add_transmission(effect);
        self.add_actuator(effect);
        self.add_load(effect);
        self.add_sensing(effect);
        self.add_timing(effect);
    }

    fn add_transmission(&mut self, effect: &Effect) {
        match *effect {
            Effect::TorsionalCompliance { stiffness_nm_rad } => {
                // a change where there is a stiffness, the stiffness itself where the gear was rigid
                let known_nm_rad = if self.stiffness_is_known {
                    self.stiffness_nm_rad
                } else {
                    0.0
                };
                self.stiffness_nm_rad = (known_nm_rad + stiffness_nm_rad).max(STIFFNESS_MIN_NM_RAD);
                self.stiffness_is_known = true;
            }
            Effect::SoftWindup {
                low_stiffness_nm_rad,
                knee_nm,
            } => self.soft_windup = Some((low_stiffness_nm_rad, knee_nm)),
            Effect::TorsionalHysteresis {
                width_nm,
                yield_rad,
            } => {
                self.hysteresis = Some(TorsionalHysteresis {
                    width_nm,
                    yield_rad,
                })
            }
            Effect::StructuralDamping {
                damping_nm_s_rad,
                exponent,
            } => {
                self.structural_damping = Some(StructuralDamping {
                    damping_nm_s_rad,
                    exponent,
                });
            }
            Effect::Backlash { gap_rad } => self.backlash.gap_rad += gap_rad,
            Effect::KinematicError { .. } => self.add_kinematic_error(effect),
            Effect::ThermalFrictionDrift {
                drift_nm_s,
                time_constant_s,
                change_nm,
            } => {
                self.drift = match (drift_nm_s, time_constant_s, change_nm) {
                    (Some(drift_nm_s), _, _) => Some(ThermalFrictionDrift::Constant { drift_nm_s }),
                    (None, Some(time_constant_s), Some(change_nm)) => {
                        Some(ThermalFrictionDrift::FirstOrder {
                            change_nm,
                            time_constant_s,
                        })
                    }
                    _ => self.drift,
                };
            }
            _ => {}
        }
    }

    fn add_kinematic_error(&mut self, effect: &Effect) {
        let Effect::KinematicError {
            amplitude_rad,
            cycles_per_motor_rev,
            phase_rad,
            amplitude_rad_2,
            cycles_per_motor_rev_2,
            phase_rad_2,
            amplitude_rad_3,
            cycles_per_motor_rev_3,
            phase_rad_3,
        } = *effect
        else {
            return;
        };
        for (amplitude_rad, cycles_per_motor_rev, phase_rad) in [
            (amplitude_rad, cycles_per_motor_rev, phase_rad),
            (amplitude_rad_2, cycles_per_motor_rev_2, phase_rad_2),
            (amplitude_rad_3, cycles_per_motor_rev_3, phase_rad_3),
        ] {
            if amplitude_rad != 0.0 {
                let _ = self.kinematic_error.harmonics.try_push(KinematicHarmonic {
                    amplitude_rad,
                    cycles_per_motor_rev,
                    phase_rad,
                });
            }
        }
    }

    fn add_actuator(&mut self, effect: &Effect) {
        match *effect {
            Effect::TorqueConstantError { gain } => self.torque_gain *= gain,
            Effect::TorqueOffset { offset_nm } => self.torque_offset_nm += offset_nm,
            Effect::TorqueRipple {
                amplitude_nm,
                cycles_per_motor_rev,
                phase_rad,
            } => {
                let _ = self.torque_ripple.try_push(Harmonic {
                    amplitude: amplitude_nm,
                    cycles_per_rev: cycles_per_motor_rev,
                    phase_rad,
                });
            }
            Effect::TorqueSaturation { limit_nm } => {
                self.torque_limit_nm = self.torque_limit_nm.min(limit_nm);
            }
            Effect::CurrentLoopLag { time_constant_s } => self.current_lag_s += time_constant_s,
            _ => {}
        }
    }

    fn add_load(&mut self, effect: &Effect) {
        match *effect {
            Effect::RotorInertia { inertia_kg_m2 } => {
                self.rotor_inertia_kg_m2 += inertia_kg_m2 * self.gear_ratio.powi(2);
            }
            Effect::GravityTorque { sin_nm, cos_nm } => {
                self.gravity_sin_cos_nm[0] += sin_nm;
                self.gravity_sin_cos_nm[1] += cos_nm;
            }
            Effect::JointSpring {
                stiffness_nm_rad,
                rest_rad,
            } => {
                let _ = self.springs.try_push(JointSpring {
                    stiffness_nm_rad,
                    rest_rad,
                });
            }
            _ => {}
        }
    }

    fn add_sensing(&mut self, effect: &Effect) {
        match *effect {
            Effect::EncoderOffset { offset_rad } => self.encoder_offset_rad += offset_rad,
            Effect::EncoderEccentricity {
                amplitude_rad,
                cycles_per_rev,
                phase_rad,
                side,
            } => {
                let harmonic = Harmonic {
                    amplitude: amplitude_rad,
                    cycles_per_rev,
                    phase_rad,
                };
                let _ = match side {
                    EncoderSide::Motor => self.motor_eccentricity.try_push(harmonic),
                    EncoderSide::Link => self.link_eccentricity.try_push(harmonic),
                };
            }
            Effect::EncoderQuantisation {
                resolution_rad,
                side,
            } => match side {
                EncoderSide::Motor => self.motor_resolution_rad = resolution_rad,
                EncoderSide::Link => self.link_resolution_rad = resolution_rad,
            },
            _ => {}
        }
    }

    fn add_timing(&mut self, effect: &Effect) {
        match *effect {
            Effect::CommandDelay { delay_s } => self.command_delay_s += delay_s,
            Effect::SensorDelay { delay_s } => self.sensor_delay_s += delay_s,
            Effect::DroppedCommands { fraction } => self.dropped_commands += fraction,
            _ => {}
        }
    }

    /// What the motor's encoder shows beyond the motor's angle, joint side.
    pub(crate) fn motor_fault_rad(&self, motor_rad: f64) -> f64 {
        if self.motor_eccentricity.is_empty() {
            return self.encoder_offset_rad;
        }
        let ratio = self.gear_ratio;
        self.encoder_offset_rad + sum(&self.motor_eccentricity, motor_rad * ratio) / ratio
    }

    /// What the link's encoder shows beyond the link's angle.
    pub(crate) fn link_fault_rad(&self, link_rad: f64) -> f64 {
        self.encoder_offset_rad + sum(&self.link_eccentricity, link_rad)
    }

    /// Whether the gear's spring is a straight line.
    pub(crate) fn is_linear(&self) -> bool {
        self.soft_windup.is_none() && self.backlash.gap_rad == 0.0
    }

    /// Torque of the gear's spring at a torsion.
    pub fn elastic_nm(&self, torsion_rad: f64) -> f64 {
        let main = self.compliance();
        let loaded_rad = self.backlash.loaded_torsion_rad(torsion_rad);
        match self.windup() {
            Some(windup) => windup.torque_nm(loaded_rad),
            None => main.torque_nm(loaded_rad),
        }
    }

    /// Torsion under a torque, without memory.
    pub fn torsion_rad(&self, torque_nm: f64) -> f64 {
        let loaded_rad = match self.windup() {
            Some(windup) => windup.torsion_rad(torque_nm),
            None => self.compliance().torsion_rad(torque_nm),
        };
        self.backlash.torsion_rad(loaded_rad)
    }

    fn compliance(&self) -> LinearCompliance {
        LinearCompliance {
            stiffness_nm_rad: self.stiffness_nm_rad,
        }
    }

    fn windup(&self) -> Option<SoftWindup<LinearCompliance>> {
        let (low_stiffness_nm_rad, knee_nm) = self.soft_windup?;
        Some(SoftWindup {
            main: self.compliance(),
            low_stiffness_nm_rad,
            knee_nm,
        })
    }
}
