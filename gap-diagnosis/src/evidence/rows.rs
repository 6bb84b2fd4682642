//! One joint's compared rows: where it was, and the torque that is held against the file's.

/// Rows of one joint, all of one length.
#[derive(Clone, Debug, Default)]
pub struct Rows {
    /// Since the recording began.
    pub time_s: Vec<f64>,
    /// Joint angle.
    pub position_rad: Vec<f64>,
    /// Its rate.
    pub velocity_rad_s: Vec<f64>,
    /// Torque that the gear carries, by the file.
    pub load_nm: Vec<f64>,
    /// Time since the direction last changed.
    pub since_reversal_s: Vec<f64>,
    /// Torque measured.
    pub measured_nm: Vec<f64>,
    /// Torque that the file needs.
    pub nominal_nm: Vec<f64>,
}

impl Rows {
    /// Compared rows.
    pub fn count(&self) -> usize {
        self.time_s.len()
    }

    /// Torque that the file does not need.
    pub fn gap_nm(&self) -> Vec<f64> {
        let both = self.measured_nm.iter().zip(&self.nominal_nm);
        both.map(|(measured, nominal)| measured - nominal).collect()
    }
}
