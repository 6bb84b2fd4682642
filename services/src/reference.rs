//! Where the joints should be when a sample was taken.

use motion::{Reference, Trajectory};
use shm_types::messages::SensorSample;

/// A trajectory read at the loop's motion time.
#[derive(Clone, Debug)]
pub struct ReferenceSource {
    trajectory: Trajectory,
    reference: Reference,
}

impl ReferenceSource {
    /// Of a trajectory.
    pub fn new(trajectory: Trajectory) -> Self {
        Self {
            trajectory,
            reference: Reference::default(),
        }
    }

    /// The reference for a sample. The trajectory advances at `motion_rate`, so its derivatives by wall time scale
    /// with it.
    pub fn at(&mut self, sample: &SensorSample) -> &Reference {
        self.trajectory
            .sample(sample.motion_time_ns as f64 * 1e-9, &mut self.reference);
        // Written by another process: out of range would be an absurd speed.
        let rate = if sample.motion_rate.is_finite() {
            sample.motion_rate.clamp(0.0, 1.0)
        } else {
            0.0
        };
        for joint in 0..self.trajectory.joint_count() {
            self.reference.velocity_rad_s[joint] *= rate;
            self.reference.acceleration_rad_s2[joint] *= rate * rate;
        }
        &self.reference
    }
}
