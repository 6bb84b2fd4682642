//! A spring between two links, such as a weight compensation: `T = k·(q - q₀)`.

/// A spring to a rest position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSpring {
    /// At the joint.
    pub stiffness_nm_rad: f64,
    /// Where it pulls to.
    pub rest_rad: f64,
}

impl JointSpring {
    /// Torque that holds the joint against it.
    pub fn holding_nm(&self, link_rad: f64) -> f64 {
        self.stiffness_nm_rad * (link_rad - self.rest_rad)
    }

    /// Energy whose slope is [`holding_nm`](Self::holding_nm).
    pub fn energy_j(&self, link_rad: f64) -> f64 {
        0.5 * self.stiffness_nm_rad * (link_rad - self.rest_rad).powi(2)
    }
}
