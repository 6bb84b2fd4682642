//! One joint as the simulation has it: what the robot file says, with changes.

use joint_model::friction::{Sliding, SteadyFriction, ThermalFrictionDrift};
use joint_model::harmonic::{self, Harmonic};
use joint_model::joint_spring::JointSpring;
use joint_model::transmission::{
    Backlash, KinematicHarmonic, LinearCompliance, SoftWindup, Spring, StructuralDamping,
    TorsionalHysteresis, kinematic_error,
};
use robot::effect::parts::{
    Actuator, Bus, Full, Gear, JointParts, Load, Sensors, SoftStart, Warming, either_lost,
};
use robot::{Bodies, Effect, EncoderSide, Part, Robot};

use crate::TwinError;

/// No change makes the gear softer than this.
const STIFFNESS_MIN_NM_RAD: f64 = 1.0;

/// A degree of the motor at a ratio of a hundred.
const PRESLIDING_RAD: f64 = 2e-4;

/// Twist under its own friction of a gear whose stiffness no file tells: less than any encoder shows.
const STIFF_RAD: f64 = 1e-5;
/// Such a gear is at least this stiff.
const STIFF_MIN_NM_RAD: f64 = 1e4;

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
    pub kinematic_harmonics: Vec<KinematicHarmonic>,
    /// True over nominal torque constant.
    pub torque_gain: f64,
    /// Added to the motor torque.
    pub torque_offset_nm: f64,
    /// Motor side.
    pub torque_ripple: Vec<Harmonic>,
    /// Motor side.
    pub torque_limit_nm: f64,
    /// Of the current loop.
    pub current_lag_s: f64,
    /// Added torque that holds the joint, with the sine and the cosine of its angle.
    pub gravity_sin_cos_nm: [f64; 2],
    /// Springs between the links.
    pub springs: Vec<JointSpring>,
    /// Of both encoders, joint side.
    pub encoder_offset_rad: f64,
    /// On the motor angle, motor side.
    pub motor_eccentricity: Vec<Harmonic>,
    /// On the link angle.
    pub link_eccentricity: Vec<Harmonic>,
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
    /// By which motor's and link's encoder are later than that.
    pub encoder_delays_s: [f64; 2],
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
            kinematic_harmonics: Vec::new(),
            torque_gain: 1.0,
            torque_offset_nm: 0.0,
            torque_ripple: Vec::new(),
            torque_limit_nm: file.torque_limit_nm.unwrap_or(f64::INFINITY),
            current_lag_s: 0.0,
            gravity_sin_cos_nm: [0.0; 2],
            springs: Vec::new(),
            encoder_offset_rad: 0.0,
            motor_eccentricity: Vec::new(),
            link_eccentricity: Vec::new(),
            motor_resolution_rad: file.motor_encoder_resolution_rad.unwrap_or(0.0),
            link_resolution_rad: file.link_encoder_resolution_rad.unwrap_or(0.0),
            link_skew_s: 0.0,
            link_zero_rad: 0.0,
            position_noise_rad: file.position_noise_rad,
            torque_noise_nm: file.torque_noise_nm,
            command_delay_s: 0.0,
            sensor_delay_s: 0.0,
            encoder_delays_s: [0.0; 2],
            dropped_commands: 0.0,
        };
        let own = file.effects.iter().chain(&robot.shared_effects);
        for effect in own.filter(|effect| effect.part() != Part::Friction) {
            let acted = effect.act(&mut model, 1.0);
            assert!(acted.is_ok(), "beside friction a model has room for all");
        }
        model
    }

    /// The joint with an effect more. Effects on the arm's bodies change the load, not the joint: see
    /// [`Load`](crate::load::Load).
    ///
    /// # Errors
    /// [`TwinError::Full`] where its friction has no room for it.
    pub fn with(mut self, effect: &Effect) -> Result<Self, TwinError> {
        let full = |full| TwinError::Full {
            effect: effect.name(),
            full,
        };
        effect.act(&mut self, 1.0).map_err(full)?;
        Ok(self)
    }

    /// What the gear's output is ahead of its input, and its slope over the motor's angle.
    pub(crate) fn kinematic_error(&self, motor_angle_rad: f64) -> (f64, f64) {
        kinematic_error(&self.kinematic_harmonics, motor_angle_rad)
    }

    /// What the motor's encoder shows beyond the motor's angle, joint side.
    pub(crate) fn motor_fault_rad(&self, motor_rad: f64) -> f64 {
        if self.motor_eccentricity.is_empty() {
            return self.encoder_offset_rad;
        }
        let ratio = self.gear_ratio;
        self.encoder_offset_rad + harmonic::sum(&self.motor_eccentricity, motor_rad * ratio) / ratio
    }

    /// What the link's encoder shows beyond the link's angle.
    pub(crate) fn link_fault_rad(&self, link_rad: f64) -> f64 {
        self.encoder_offset_rad + harmonic::sum(&self.link_eccentricity, link_rad)
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

impl JointParts for JointModel {
    fn friction(&mut self) -> Option<&mut SteadyFriction> {
        Some(&mut self.friction)
    }

    fn warming(&mut self) -> Option<&mut dyn Warming> {
        Some(self)
    }

    fn gear(&mut self) -> Option<&mut dyn Gear> {
        Some(self)
    }

    fn actuator(&mut self) -> Option<&mut dyn Actuator> {
        Some(self)
    }

    fn load(&mut self) -> Option<&mut dyn Load> {
        Some(self)
    }

    /// The load has them.
    fn bodies(&mut self) -> Option<&mut Bodies> {
        None
    }

    fn sensors(&mut self) -> Option<&mut dyn Sensors> {
        Some(self)
    }

    fn bus(&mut self) -> Option<&mut dyn Bus> {
        Some(self)
    }
}

impl Warming for JointModel {
    fn add_drift(&mut self, drift: ThermalFrictionDrift) {
        self.drift = Some(drift);
    }
}

/// Of soft wind-up, hysteresis and damping there is one each: a later one stands for those before it.
impl Gear for JointModel {
    fn add_stiffness(&mut self, stiffness_nm_rad: f64, strength: f64) {
        // a change where there is a stiffness, the stiffness itself where the gear was rigid
        let known_nm_rad = if self.stiffness_is_known {
            self.stiffness_nm_rad
        } else {
            0.0
        };
        let changed_nm_rad = known_nm_rad + strength * stiffness_nm_rad;
        self.stiffness_nm_rad = changed_nm_rad.max(STIFFNESS_MIN_NM_RAD);
        self.stiffness_is_known = true;
    }

    fn add_soft_windup(&mut self, start: SoftStart) -> Result<(), Full> {
        self.soft_windup = Some((start.low_stiffness_nm_rad, start.knee_nm));
        Ok(())
    }

    fn add_hysteresis(&mut self, element: TorsionalHysteresis) -> Result<(), Full> {
        self.hysteresis = Some(element);
        Ok(())
    }

    fn add_structural_damping(&mut self, element: StructuralDamping) -> Result<(), Full> {
        self.structural_damping = Some(element);
        Ok(())
    }

    fn add_gap(&mut self, gap_rad: f64) {
        self.backlash.gap_rad += gap_rad;
    }

    fn add_kinematic_error(&mut self, harmonic: KinematicHarmonic) -> Result<(), Full> {
        self.kinematic_harmonics.push(harmonic);
        Ok(())
    }
}

impl Actuator for JointModel {
    fn scale_torque(&mut self, gain: f64) {
        self.torque_gain *= gain;
    }

    fn add_torque(&mut self, offset_nm: f64) {
        self.torque_offset_nm += offset_nm;
    }

    fn add_ripple(&mut self, ripple_nm: Harmonic) -> Result<(), Full> {
        self.torque_ripple.push(ripple_nm);
        Ok(())
    }

    fn limit_torque(&mut self, limit_nm: f64) {
        self.torque_limit_nm = self.torque_limit_nm.min(limit_nm);
    }

    fn add_lag(&mut self, time_constant_s: f64) {
        self.current_lag_s += time_constant_s;
    }
}

impl Load for JointModel {
    fn add_rotor_inertia(&mut self, inertia_kg_m2: f64) {
        self.rotor_inertia_kg_m2 += inertia_kg_m2 * self.gear_ratio.powi(2);
    }

    fn add_gravity(&mut self, sin_nm: f64, cos_nm: f64) {
        self.gravity_sin_cos_nm[0] += sin_nm;
        self.gravity_sin_cos_nm[1] += cos_nm;
    }

    fn add_spring(&mut self, spring: JointSpring) -> Result<(), Full> {
        self.springs.push(spring);
        Ok(())
    }
}

impl Sensors for JointModel {
    fn add_offset(&mut self, offset_rad: f64) {
        self.encoder_offset_rad += offset_rad;
    }

    fn add_eccentricity(&mut self, side: EncoderSide, error_rad: Harmonic) -> Result<(), Full> {
        match side {
            EncoderSide::Motor => self.motor_eccentricity.push(error_rad),
            EncoderSide::Link => self.link_eccentricity.push(error_rad),
        }
        Ok(())
    }

    fn set_resolution(&mut self, side: EncoderSide, resolution_rad: f64) {
        match side {
            EncoderSide::Motor => self.motor_resolution_rad = resolution_rad,
            EncoderSide::Link => self.link_resolution_rad = resolution_rad,
        }
    }

    /// The drive's velocity is not compared: positions and torques are.
    fn filter_velocity(&mut self, _cutoff_hz: f64) {}
}

impl Bus for JointModel {
    fn delay_commands(&mut self, delay_s: f64) {
        self.command_delay_s += delay_s;
    }

    fn delay_samples(&mut self, delay_s: f64) {
        self.sensor_delay_s += delay_s;
    }

    fn delay_encoder(&mut self, side: EncoderSide, delay_s: f64) {
        self.encoder_delays_s[side as usize] += delay_s;
    }

    fn lose_commands(&mut self, fraction: f64) {
        self.dropped_commands = either_lost(self.dropped_commands, fraction);
    }

    /// Rows that were not measured anew are taken out of the recording, and compared with nothing.
    fn lose_samples(&mut self, _fraction: f64) {}
}
