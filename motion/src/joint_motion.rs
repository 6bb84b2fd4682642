//! What a single joint does.

use std::f64::consts::TAU;

use crate::even_waypoints::EvenWaypoints;
use crate::multi_sine::MultiSine;
use crate::trapezoid::Trapezoid;

/// What a single joint does.
#[derive(Clone, Debug)]
pub enum JointMotion {
    /// Stays where it is.
    Hold { position_rad: f64 },
    /// `centre + amplitude·sin(2π·frequency·t + phase)`.
    Sine {
        centre_rad: f64,
        amplitude_rad: f64,
        frequency_hz: f64,
        phase_rad: f64,
    },
    /// Many sines.
    MultiSine(MultiSine),
    /// A move from rest to rest.
    Trapezoid(Trapezoid),
    /// A spline through points.
    Waypoints(EvenWaypoints),
}

impl JointMotion {
    /// Position, velocity and acceleration.
    pub fn sample(&self, time_s: f64) -> [f64; 3] {
        match self {
            Self::Hold { position_rad } => [*position_rad, 0.0, 0.0],
            Self::Sine {
                centre_rad,
                amplitude_rad,
                frequency_hz,
                phase_rad,
            } => {
                let frequency_rad_s = TAU * frequency_hz;
                let (sin, cos) = (frequency_rad_s * time_s + phase_rad).sin_cos();
                let (swing_rad, swing_rad_s) =
                    (amplitude_rad * sin, amplitude_rad * frequency_rad_s * cos);
                [
                    centre_rad + swing_rad,
                    swing_rad_s,
                    -frequency_rad_s.powi(2) * swing_rad,
                ]
            }
            Self::MultiSine(motion) => motion.sample(time_s),
            Self::Trapezoid(motion) => motion.sample(time_s),
            Self::Waypoints(motion) => motion.sample(time_s),
        }
    }

    /// After this time nothing new happens.
    pub fn horizon_s(&self) -> f64 {
        match self {
            Self::Hold { .. } => 0.0,
            Self::Sine { frequency_hz, .. } => 1.0 / frequency_hz,
            Self::MultiSine(motion) => motion.period_s(),
            Self::Trapezoid(motion) => motion.period_s().unwrap_or(motion.move_s()),
            Self::Waypoints(motion) => motion.duration_s(),
        }
    }

    /// When the motion is over, if it ends.
    pub fn end_s(&self) -> Option<f64> {
        match self {
            Self::Hold { .. } => Some(0.0),
            Self::Trapezoid(motion) if motion.period_s().is_none() => Some(motion.move_s()),
            Self::Waypoints(motion) => Some(motion.duration_s()),
            _ => None,
        }
    }

    /// Whether the joint starts with zero velocity by itself.
    pub fn starts_at_rest(&self) -> bool {
        matches!(
            self,
            Self::Hold { .. } | Self::Trapezoid(_) | Self::Waypoints(_)
        )
    }
}
