//! Effects on the sensors: offset, eccentricity, coarser steps, a slower velocity.

use arrayvec::ArrayVec;
use robot::{Effect, EncoderSide};

use super::Full;

/// The most eccentricities of one joint.
const ECCENTRICITIES_MAX: usize = 8;

#[derive(Clone, Copy, Debug)]
struct Eccentricity {
    amplitude_rad: f64,
    cycles_per_rev: f64,
    phase_rad: f64,
    side: EncoderSide,
}

/// What lies between an angle and its reading.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sensing {
    /// The joint's zero, joint side: both encoders read so much more.
    pub offset_rad: f64,
    eccentricities: ArrayVec<Eccentricity, ECCENTRICITIES_MAX>,
    /// Step of the motor encoder where it is not the robot file's.
    pub motor_resolution_rad: Option<f64>,
    /// Step of the link encoder where it is not the robot file's.
    pub link_resolution_rad: Option<f64>,
    /// Further low-pass on the drive's velocity signal, for its velocity loop and for its report. A drive that
    /// otherwise reports no velocity reports this one.
    pub velocity_cutoff_hz: Option<f64>,
}

impl Sensing {
    pub(super) fn add(&mut self, effect: &Effect, strength: f64) -> Result<(), Full> {
        match *effect {
            Effect::EncoderOffset { offset_rad } => self.offset_rad += strength * offset_rad,
            Effect::EncoderEccentricity {
                amplitude_rad,
                cycles_per_rev,
                phase_rad,
                side,
            } => {
                let amplitude_rad = strength * amplitude_rad;
                let eccentricity = Eccentricity {
                    amplitude_rad,
                    cycles_per_rev,
                    phase_rad,
                    side,
                };
                return self
                    .eccentricities
                    .try_push(eccentricity)
                    .map_err(Full::of(ECCENTRICITIES_MAX));
            }
            Effect::EncoderQuantisation {
                resolution_rad,
                side: EncoderSide::Motor,
            } => {
                self.motor_resolution_rad = Some(resolution_rad);
            }
            Effect::EncoderQuantisation {
                resolution_rad,
                side: EncoderSide::Link,
            } => {
                self.link_resolution_rad = Some(resolution_rad);
            }
            Effect::VelocityFilterLag { cutoff_hz } => self.velocity_cutoff_hz = Some(cutoff_hz),
            _ => {}
        }
        Ok(())
    }

    /// By how much the encoder of a side reads too much for its eccentricity, in angle of that side.
    pub fn eccentricity_rad(&self, side: EncoderSide, angle_rad: f64) -> f64 {
        let on_side = self
            .eccentricities
            .iter()
            .filter(|eccentricity| eccentricity.side == side);
        on_side
            .map(|eccentricity| {
                eccentricity.amplitude_rad
                    * (eccentricity.cycles_per_rev * angle_rad + eccentricity.phase_rad).sin()
            })
            .sum()
    }
}
