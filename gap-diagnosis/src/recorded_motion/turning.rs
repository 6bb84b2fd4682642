//! How a joint's friction turns round, which is found before any name: every joint has it.

use joint_model::filter::FilterError;
use joint_twin::signal::band::Band;
use nalgebra::{SMatrix, SVector};

use super::dynamics::{Drive, Torques};
use super::laws;
use super::motion::{JointMotion, Piece};
use super::presliding::{self, Presliding};
use crate::evidence::ALIKE;

/// What is found first of a joint.
pub struct Bent {
    /// What leaves least, and what it may be as well.
    pub bend: [Presliding; 3],
    /// Sum of squares that is left.
    pub left: f64,
    /// Dry friction beyond the file's.
    pub dry_nm: f64,
    /// What a unit of the torque is, by what masses and friction need.
    pub unit_nm: f64,
}

/// A joint's motion and torque, of which it is found.
pub struct Turning<'a> {
    /// The joint's file.
    pub drive: &'a Drive,
    /// Its place.
    pub joint: usize,
    /// Of the recordings.
    pub pieces: &'a [Piece],
    /// Piece by piece.
    pub torques: &'a [Torques],
    /// Rows that count, piece by piece.
    pub counted: &'a [Vec<usize>],
    /// The speed that is usual.
    pub speed_rad_s: f64,
}

impl Turning<'_> {
    /// The way friction turns round that leaves least of the joint's torque beside Coulomb and viscous friction, an offset, inertia, a
    /// gain, and what the clocks may be apart. `feeds_rate`: whether the controller feeds the reference's velocity, where nothing tells.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn bent(&self, feeds_rate: bool) -> Result<Bent, FilterError> {
        let Self {
            drive,
            joint,
            pieces,
            torques,
            counted,
            speed_rad_s,
        } = *self;
        /// Rows of a piece that are looked at.
        const ROWS: usize = 2000;
        // what does not depend on the bend
        struct Still<'a> {
            motion: &'a JointMotion,
            rigid_nm: &'a [f64],
            band: Band,
            rows: Vec<usize>,
            torque_nm: Vec<f64>,
            limited: [Vec<f64>; 3],
        }
        let mut still = Vec::new();
        for ((piece, torques), counted) in pieces.iter().zip(torques).zip(counted) {
            let motion = &piece.joints[joint];
            let Some(torque_nm) = motion.torque_nm(feeds_rate) else {
                continue;
            };
            let band = Band::of(piece.rate_hz, piece.compared_hz());
            let smooth_nm = band.limit(&torque_nm)?;
            let limited = [
                band.limit(&motion.velocity_rad_s)?,
                band.limit(&motion.acceleration_rad_s2)?,
                motion.clock_nm(&smooth_nm, piece.rate_hz),
            ];
            let every = counted.len().div_ceil(ROWS).max(1);
            still.push(Still {
                motion,
                rigid_nm: &torques.rigid_nm[joint],
                band,
                rows: counted.iter().copied().step_by(every).collect(),
                torque_nm: torque_nm.into_owned(),
                limited,
            });
        }
        let [mut dry_nm, mut unit_nm] = [0.0, 1.0];
        let mut least = f64::INFINITY;
        let all = presliding::least(laws::creeping_rad_s(speed_rad_s), |bend| {
            let mut gram = SMatrix::<f64, 6, 6>::identity() * f64::MIN_POSITIVE;
            let mut vector = SVector::<f64, 6>::zeros();
            let mut square = 0.0;
            for still in &still {
                let slip = bend.slip(still.motion);
                let nominal_nm = drive.torque_nm(still.motion, &slip, still.rigid_nm);
                let in_proportion_nm = drive.in_proportion_nm(still.motion, &slip, still.rigid_nm);
                let both = still.torque_nm.iter().zip(&nominal_nm);
                let gap_nm: Vec<f64> = both.map(|(torque, nominal)| torque - nominal).collect();
                let gap_nm = still.band.limit(&gap_nm)?;
                let slip = still.band.limit(&slip)?;
                let in_proportion_nm = still.band.limit(&in_proportion_nm)?;
                let [velocity, acceleration, clock] = &still.limited;
                for row in still.rows.iter().copied() {
                    let x = SVector::from([
                        slip[row],
                        velocity[row],
                        1.0,
                        clock[row],
                        acceleration[row],
                        in_proportion_nm[row],
                    ]);
                    gram += x * x.transpose();
                    vector += x * gap_nm[row];
                    square += gap_nm[row].powi(2);
                }
            }
            // where the joint moves one way alone friction is an offset: half of each
            let alike = gram.diagonal() * ALIKE;
            let Some(solved) = (gram + SMatrix::from_diagonal(&alike)).cholesky() else {
                return Ok(square);
            };
            let values = solved.solve(&vector);
            let left = square - vector.dot(&values);
            if left < least {
                least = left;
                dry_nm = values[0].abs();
                unit_nm = (1.0 + values[5]).recip();
            }
            Ok(left)
        })?;
        let [(best, left), (second, _), (third, _)] = all;
        let is_by_speed = matches!(second, Presliding::BySpeed { .. });
        let other = if is_by_speed { third } else { second };
        Ok(Bent {
            bend: [best, other, best.longer()],
            left,
            dry_nm,
            unit_nm,
        })
    }
}
