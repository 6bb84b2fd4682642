//! Effects on the sensors: offset, eccentricity, coarser steps, a slower velocity.

use arrayvec::ArrayVec;
use joint_model::harmonic::{self, Harmonic};
use robot::EncoderSide;
use robot::effect::parts::{self, Full};

/// The most eccentricities of one encoder.
const ECCENTRICITIES_MAX: usize = 8;

/// What lies between an angle and its reading.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sensing {
    /// The joint's zero, joint side: both encoders read so much more.
    pub offset_rad: f64,
    motor_eccentricities: ArrayVec<Harmonic, ECCENTRICITIES_MAX>,
    link_eccentricities: ArrayVec<Harmonic, ECCENTRICITIES_MAX>,
    /// Step of the motor encoder where it is not the robot file's.
    pub motor_resolution_rad: Option<f64>,
    /// Step of the link encoder where it is not the robot file's.
    pub link_resolution_rad: Option<f64>,
    /// Further low-pass on the drive's velocity signal, for its velocity loop and for its report. A drive that
    /// otherwise reports no velocity reports this one.
    pub velocity_cutoff_hz: Option<f64>,
}

impl parts::Sensors for Sensing {
    fn add_offset(&mut self, offset_rad: f64) {
        self.offset_rad += offset_rad;
    }

    fn add_eccentricity(&mut self, side: EncoderSide, error_rad: Harmonic) -> Result<(), Full> {
        let own = match side {
            EncoderSide::Motor => &mut self.motor_eccentricities,
            EncoderSide::Link => &mut self.link_eccentricities,
        };
        Full::push(own, error_rad)
    }

    fn set_resolution(&mut self, side: EncoderSide, resolution_rad: f64) {
        let own = match side {
            EncoderSide::Motor => &mut self.motor_resolution_rad,
            EncoderSide::Link => &mut self.link_resolution_rad,
        };
        *own = Some(resolution_rad);
    }

    fn filter_velocity(&mut self, cutoff_hz: f64) {
        self.velocity_cutoff_hz = Some(cutoff_hz);
    }
}

impl Sensing {
    /// By how much the encoder of a side reads too much for its eccentricity, in angle of that side.
    pub fn eccentricity_rad(&self, side: EncoderSide, angle_rad: f64) -> f64 {
        let own = match side {
            EncoderSide::Motor => &self.motor_eccentricities,
            EncoderSide::Link => &self.link_eccentricities,
        };
        harmonic::sum(own, angle_rad)
    }
}
