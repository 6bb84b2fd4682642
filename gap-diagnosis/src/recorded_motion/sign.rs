//! Which way a recorded torque goes: as what is accelerated, what is carried and friction need it, or against them.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use super::laws::Law;
use super::rows::JointRows;
use crate::evidence::PARTS;

/// A torque's sign is clear where what goes with or against the motion is so many times the square of all else: two of its root mean
/// squares.
const CLEAR: f64 = 4.0;

/// Which way a torque goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// As masses and friction need it.
    Right,
    /// Against them.
    Reversed,
    /// As the masses that are carried need it, while friction and inertia go against it: the motion is reversed.
    OfMotion,
    /// They do not tell.
    Untold,
}

/// Squares of a torque that masses and friction take, each beyond all else, with their signs.
struct Parts {
    masses: f64,
    friction: f64,
    /// What both leave of parts of the motion that they were not fitted to.
    left: f64,
}

impl Parts {
    fn sign(&self) -> Sign {
        let is_clear = (self.masses + self.friction).abs() > CLEAR * self.left;
        if is_clear && self.masses <= 0.0 && self.friction <= 0.0 {
            Sign::Reversed
        } else if is_clear && self.masses >= 0.0 && self.friction >= 0.0 {
            Sign::Right
        } else {
            Sign::Untold
        }
    }

    /// Whether masses clearly need the torque as it is, and friction does not.
    fn agrees_with_masses(&self) -> bool {
        self.masses > CLEAR * self.left && self.friction < 0.0
    }

    /// Without friction, where that takes less than nothing explains.
    fn heard(self) -> Self {
        let friction = if self.friction.abs() > self.left {
            self.friction
        } else {
            0.0
        };
        Self { friction, ..self }
    }
}

impl JointRows {
    /// Which way the torque goes, where both friction and what the rigid bodies need of it tell it clearly; or, as masses may be any,
    /// friction and the inertia that the torque shows, beside gravity however strong. Inertia alone tells it where there is no friction to
    /// speak of: nothing has less than none. A weight that is the same either way, as that of a horizontal arm about its zero, does not turn
    /// with the position; then the torque may be right where what moves says that it is reversed.
    pub fn sign(&self) -> Sign {
        let [slip, acceleration] =
            [Law::Coulomb, Law::Inertia].map(|law| self.columns(law).first());
        let (Some(slip), Some(acceleration)) = (slip, acceleration) else {
            return Sign::Untold;
        };
        let ones = vec![1.0; slip.len()];
        let mean_nm = self.rigid_nm.iter().sum::<f64>() / slip.len().max(1) as f64;
        let rigid: Vec<f64> = self.rigid_nm.iter().map(|x| x - mean_nm).collect();
        let sign = |parts: Option<Parts>| parts.map_or(Sign::Untold, |parts| parts.sign());
        let by_masses = sign(self.parts(&rigid, slip, &[&ones]));
        let gravity = self.columns(Law::Gravity).iter();
        let beside: Vec<&Vec<f64>> = std::iter::once(&ones).chain(gravity).collect();
        let by_motion = || sign(self.parts(acceleration, slip, &beside).map(Parts::heard));
        let told = match by_masses {
            Sign::Untold => by_motion(),
            told => told,
        };
        // what hangs there, without what accelerates it
        let carried = self.rigid_nm.iter().zip(acceleration);
        let carried: Vec<f64> = carried.map(|(nm, a)| nm - self.inertia_kg_m2 * a).collect();
        let hangs = || self.parts(&carried, slip, &[&ones, acceleration]);
        match told {
            Sign::Reversed if hangs().is_some_and(|of| of.agrees_with_masses()) => Sign::OfMotion,
            told => told,
        }
    }

    /// What moves masses, and friction, beside other columns (least squares); none where they are alike, or friction brakes at one speed and
    /// drives at another.
    fn parts(&self, masses: &[f64], slip: &[f64], beside: &[&Vec<f64>]) -> Option<Parts> {
        let of = [masses, slip, &self.seen.velocity_rad_s].into_iter();
        let of: Vec<&[f64]> = of.chain(beside.iter().map(|column| &column[..])).collect();
        let rows = slip.len();
        let products = |part: usize| {
            let (from, to) = (part * rows / PARTS, (part + 1) * rows / PARTS);
            let x = DMatrix::from_fn(to - from, of.len(), |row, column| of[column][from + row]);
            let y = DVector::from_column_slice(&self.seen.measured_nm[from..to]);
            (x.tr_mul(&x), x.tr_mul(&y), y.norm_squared())
        };
        let parts: Vec<_> = (0..PARTS).map(products).collect();
        let gram: DMatrix<f64> = parts.iter().map(|(gram, ..)| gram).sum();
        let vector: DVector<f64> = parts.iter().map(|(_, vector, _)| vector).sum();
        let solved = gram.clone().cholesky()?;
        let values = solved.solve(&vector);
        let beyond = solved.inverse();
        let left = parts.iter().map(|(own, own_vector, square)| {
            let others = (&gram - own).cholesky()?.solve(&(&vector - own_vector));
            Some(square - 2.0 * others.dot(own_vector) + others.dot(&(own * &others)))
        });
        let left = left.sum::<Option<f64>>()?;
        // what columns take beyond all others: on a motion one way an offset looks like friction
        let part = |columns: Range<usize>| {
            let (from, count) = (columns.start, columns.len());
            let own = beyond.view((from, from), (count, count)).into_owned();
            let values = values.rows(from, count);
            let with = own.cholesky()?.solve(&values);
            Some(values.dot(&with))
        };
        let (masses, friction) = (part(0..1)?, part(1..3)?);
        // what brakes at one speed and drives at another is no friction
        let [slow, fast] = [values[1], values[1] + values[2] * self.speed_rad_s];
        let is_friction = slow * fast > 0.0 || friction < left;
        is_friction.then(|| Parts {
            masses: masses.copysign(values[0]),
            friction: friction.copysign(slow),
            left,
        })
    }
}
