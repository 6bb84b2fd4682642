//! What effects act on: the parts of a joint, of its arm and of its bus, one trait each.
//!
//! Plant, simulation twin and feedforward have these parts; each says with [`JointParts`] which of them it takes from there. A new
//! part, or a new change of one, does not compile until all of them know it.

use joint_model::friction::{SteadyFriction, ThermalFrictionDrift};
use joint_model::harmonic::Harmonic;
use joint_model::joint_spring::JointSpring;
use joint_model::transmission::{KinematicHarmonic, StructuralDamping, TorsionalHysteresis};

use super::EncoderSide;
use crate::bodies::Bodies;

/// There is no room for an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a joint takes at most {at_most} effects of this kind")]
pub struct Full {
    /// Room for so many.
    pub at_most: usize,
}

impl Full {
    /// Adds to a list that has no more room than its capacity.
    ///
    /// # Errors
    /// [`Full`].
    pub fn push<T, const AT_MOST: usize>(
        list: &mut arrayvec::ArrayVec<T, AT_MOST>,
        one: T,
    ) -> Result<(), Self> {
        list.try_push(one).map_err(|_| Self { at_most: AT_MOST })
    }
}

/// Where effects act. `None`: nothing of it is here, so an effect on it changes nothing here.
pub trait JointParts {
    /// The laws of friction in steady motion.
    fn friction(&mut self) -> Option<&mut SteadyFriction>;
    /// Friction over time.
    fn warming(&mut self) -> Option<&mut dyn Warming>;
    /// What lies between motor and link.
    fn gear(&mut self) -> Option<&mut dyn Gear>;
    /// What lies between the torque that is asked for and that at the shaft.
    fn actuator(&mut self) -> Option<&mut dyn Actuator>;
    /// What acts at the joint beside the arm's bodies.
    fn load(&mut self) -> Option<&mut dyn Load>;
    /// The arm's bodies.
    fn bodies(&mut self) -> Option<&mut Bodies>;
    /// What lies between an angle and its reading.
    fn sensors(&mut self) -> Option<&mut dyn Sensors>;
    /// The path of commands and samples.
    fn bus(&mut self) -> Option<&mut dyn Bus>;
}

/// Friction over time, joint side.
pub trait Warming {
    /// Friction rises by this beside what it is.
    fn add_drift(&mut self, drift: ThermalFrictionDrift);
}

/// A gear that is soft below its knee torque, joint side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftStart {
    /// Stiffness below the knee.
    pub low_stiffness_nm_rad: f64,
    /// Torque from which on the gear is as stiff as it is without.
    pub knee_nm: f64,
    /// How far it has taken over: 0 to 1.
    pub strength: f64,
}

/// What lies between motor and link, joint side.
#[allow(
    clippy::missing_errors_doc,
    reason = "each is Full where the part has no room"
)]
pub trait Gear {
    /// Stiffer by this; as stiff as this where nothing tells the stiffness.
    fn add_stiffness(&mut self, stiffness_nm_rad: f64, strength: f64);
    /// Softer below a torque.
    fn add_soft_windup(&mut self, start: SoftStart) -> Result<(), Full>;
    /// A loop of torque over torsion.
    fn add_hysteresis(&mut self, element: TorsionalHysteresis) -> Result<(), Full>;
    /// Torque against the rate of torsion.
    fn add_structural_damping(&mut self, element: StructuralDamping) -> Result<(), Full>;
    /// A gap, or a wider one.
    fn add_gap(&mut self, gap_rad: f64);
    /// Angle that repeats with the motor's.
    fn add_kinematic_error(&mut self, harmonic: KinematicHarmonic) -> Result<(), Full>;
}

/// What lies between the torque that is asked for and that at the shaft.
#[allow(
    clippy::missing_errors_doc,
    reason = "each is Full where the part has no room"
)]
pub trait Actuator {
    /// True over nominal torque.
    fn scale_torque(&mut self, gain: f64);
    /// A constant, joint side.
    fn add_torque(&mut self, offset_nm: f64);
    /// What repeats with the motor's angle, motor side.
    fn add_ripple(&mut self, ripple_nm: Harmonic) -> Result<(), Full>;
    /// No more than this, motor side.
    fn limit_torque(&mut self, limit_nm: f64);
    /// Later by a first-order low-pass.
    fn add_lag(&mut self, time_constant_s: f64);
}

/// What acts at the joint beside the arm's bodies.
#[allow(
    clippy::missing_errors_doc,
    reason = "each is Full where the part has no room"
)]
pub trait Load {
    /// Motor side.
    fn add_rotor_inertia(&mut self, inertia_kg_m2: f64);
    /// Holding torque with the sine and the cosine of the joint's angle.
    fn add_gravity(&mut self, sin_nm: f64, cos_nm: f64);
    /// A spring between the links.
    fn add_spring(&mut self, spring: JointSpring) -> Result<(), Full>;
}

/// What lies between an angle and its reading.
#[allow(
    clippy::missing_errors_doc,
    reason = "each is Full where the part has no room"
)]
pub trait Sensors {
    /// Both encoders read so much more, joint side.
    fn add_offset(&mut self, offset_rad: f64);
    /// An encoder reads more as its angle turns, in angle of its side.
    fn add_eccentricity(&mut self, side: EncoderSide, error_rad: Harmonic) -> Result<(), Full>;
    /// An encoder has such steps, in angle of its side.
    fn set_resolution(&mut self, side: EncoderSide, resolution_rad: f64);
    /// A further low-pass on the drive's velocity.
    fn filter_velocity(&mut self, cutoff_hz: f64);
}

/// The path of commands and samples.
pub trait Bus {
    /// Commands act so much later.
    fn delay_commands(&mut self, delay_s: f64);
    /// Samples are so much older.
    fn delay_samples(&mut self, delay_s: f64);
    /// An encoder's angle is so much older than the sample that it comes with.
    fn delay_encoder(&mut self, side: EncoderSide, delay_s: f64);
    /// A part of the commands never arrives, independently of what was lost before.
    fn lose_commands(&mut self, fraction: f64);
    /// A part of the samples never arrives, independently of what was lost before.
    fn lose_samples(&mut self, fraction: f64);
}

/// Part that is lost by one of two independent causes.
pub fn either_lost(one: f64, other: f64) -> f64 {
    1.0 - (1.0 - one) * (1.0 - other)
}

/// Steady motion alone: other parts are for others.
impl JointParts for SteadyFriction {
    fn friction(&mut self) -> Option<&mut SteadyFriction> {
        Some(self)
    }

    fn warming(&mut self) -> Option<&mut dyn Warming> {
        None
    }

    fn gear(&mut self) -> Option<&mut dyn Gear> {
        None
    }

    fn actuator(&mut self) -> Option<&mut dyn Actuator> {
        None
    }

    fn load(&mut self) -> Option<&mut dyn Load> {
        None
    }

    fn bodies(&mut self) -> Option<&mut Bodies> {
        None
    }

    fn sensors(&mut self) -> Option<&mut dyn Sensors> {
        None
    }

    fn bus(&mut self) -> Option<&mut dyn Bus> {
        None
    }
}
