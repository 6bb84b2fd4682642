//! What a joint carries along a recorded motion: inertia and torque of the rigid bodies, with all other joints moving as
//! they were recorded.

use joint_model::filter::FilterError;
use joint_model::rigid_body::Chain;

use crate::elastic::{links_rad, mass_column_kg_m2};
use crate::joint::JointModel;
use crate::rounding::Rounding;
use crate::smooth::{derivative, low_pass, second_derivative};

/// Motion above this is noise: no joint of an arm is moved faster on purpose.
const MOTION_HZ: f64 = 30.0;
/// Of the sample rate, where that is low.
const MOTION_OF_RATE: f64 = 0.2;
/// The load is computed about so many times a second and interpolated: poses change slowly.
const LOAD_HZ: f64 = 200.0;
/// Step of the gravity torque's slope.
const SLOPE_RAD: f64 = 1e-4;

/// The rigid bodies as one joint feels them, sample by sample.
///
/// Torque that moves the joint is `inertia·q̈ + torque + slope·(q - position)`, all at the link.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Load {
    /// Joint angle of the recorded motion, smoothed.
    pub position_rad: Vec<f64>,
    /// Velocity of the recorded motion, smoothed.
    pub velocity_rad_s: Vec<f64>,
    /// Of everything beyond the joint, about its axis.
    pub inertia_kg_m2: Vec<f64>,
    /// At the recorded motion but without this joint's own acceleration: gravity, and what the other joints do.
    pub torque_nm: Vec<f64>,
    /// The part of it that is not gravity.
    pub coupling_nm: Vec<f64>,
    /// How that changes with this joint's angle.
    pub slope_nm_rad: Vec<f64>,
}

impl Load {
    /// Adds the difference of two loads, times a factor.
    pub fn add(&mut self, change: &LoadChange, factor: f64) {
        let add = |mine: &mut Vec<f64>, change: &[f64]| {
            for (value, change) in mine.iter_mut().zip(change) {
                *value += factor * change;
            }
        };
        add(&mut self.inertia_kg_m2, &change.inertia_kg_m2);
        add(&mut self.torque_nm, &change.torque_nm);
        add(&mut self.slope_nm_rad, &change.slope_nm_rad);
    }
}

/// How a load changes with one property of the rigid bodies.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadChange {
    inertia_kg_m2: Vec<f64>,
    torque_nm: Vec<f64>,
    slope_nm_rad: Vec<f64>,
}

impl LoadChange {
    /// From one load to another of the same motion.
    pub fn between(from: &Load, to: &Load) -> Self {
        let difference =
            |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| b - a).collect() };
        Self {
            inertia_kg_m2: difference(&from.inertia_kg_m2, &to.inertia_kg_m2),
            torque_nm: difference(&from.torque_nm, &to.torque_nm),
            slope_nm_rad: difference(&from.slope_nm_rad, &to.slope_nm_rad),
        }
    }

    /// Scaled.
    #[must_use]
    pub fn times(mut self, factor: f64) -> Self {
        for column in [
            &mut self.inertia_kg_m2,
            &mut self.torque_nm,
            &mut self.slope_nm_rad,
        ] {
            column.iter_mut().for_each(|value| *value *= factor);
        }
        self
    }

    #[cfg(test)]
    pub(crate) fn largest_difference(&self, other: &Self) -> f64 {
        let columns = [
            (&self.inertia_kg_m2, &other.inertia_kg_m2),
            (&self.torque_nm, &other.torque_nm),
            (&self.slope_nm_rad, &other.slope_nm_rad),
        ];
        let all = columns.into_iter().flat_map(|(a, b)| a.iter().zip(b));
        all.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    /// Root mean square of the torque it takes to move the joint so.
    pub fn rms_nm(&self, acceleration_rad_s2: &[f64]) -> f64 {
        let count = self.torque_nm.len().max(1) as f64;
        let rows = self.torque_nm.iter().zip(&self.inertia_kg_m2);
        let torques_nm = rows
            .zip(acceleration_rad_s2)
            .map(|((torque_nm, inertia_kg_m2), a)| torque_nm + inertia_kg_m2 * a);
        (torques_nm.map(|x| x * x).sum::<f64>() / count).sqrt()
    }
}

/// A load at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct AtKnot {
    pub torque_nm: f64,
    pub gravity_nm: f64,
    pub inertia_kg_m2: f64,
    pub slope_nm_rad: f64,
}

impl AtKnot {
    /// This, and so many times another.
    #[must_use]
    pub fn plus(self, factor: f64, other: &Self) -> Self {
        Self {
            torque_nm: self.torque_nm + factor * other.torque_nm,
            gravity_nm: self.gravity_nm + factor * other.gravity_nm,
            inertia_kg_m2: self.inertia_kg_m2 + factor * other.inertia_kg_m2,
            slope_nm_rad: self.slope_nm_rad + factor * other.slope_nm_rad,
        }
    }
}

/// The motion of the whole arm, smoothed.
#[derive(Clone, Debug)]
pub struct Motion {
    rate_hz: f64,
    position_rad: Vec<Vec<f64>>,
    velocity_rad_s: Vec<Vec<f64>>,
    acceleration_rad_s2: Vec<Vec<f64>>,
}

impl Motion {
    /// From every joint's measured position, joint side.
    ///
    /// # Errors
    /// [`FilterError`] if the rate is no rate.
    pub fn of(position_rad: &[Vec<f64>], rate_hz: f64) -> Result<Self, FilterError> {
        let period_s = 1.0 / rate_hz;
        let cutoff_hz = MOTION_HZ.min(MOTION_OF_RATE * rate_hz);
        let position_rad = position_rad
            .iter()
            .map(|joint| low_pass(joint, cutoff_hz, rate_hz))
            .collect::<Result<Vec<_>, _>>()?;
        let each = |make: fn(&[f64], f64) -> Vec<f64>| {
            position_rad
                .iter()
                .map(|joint| make(joint, period_s))
                .collect::<Vec<_>>()
        };
        Ok(Self {
            rate_hz,
            velocity_rad_s: each(derivative),
            acceleration_rad_s2: each(second_derivative),
            position_rad,
        })
    }

    /// Takes one joint's motion from another measurement of its position.
    ///
    /// # Errors
    /// [`FilterError`] if the rate is no rate.
    pub fn set(&mut self, joint: usize, position_rad: &[f64]) -> Result<(), FilterError> {
        let of_joint = Self::of(&[position_rad.to_vec()], self.rate_hz)?;
        let first = |mut columns: Vec<Vec<f64>>| columns.swap_remove(0);
        self.position_rad[joint] = first(of_joint.position_rad);
        self.velocity_rad_s[joint] = first(of_joint.velocity_rad_s);
        self.acceleration_rad_s2[joint] = first(of_joint.acceleration_rad_s2);
        Ok(())
    }

    /// This, with one joint's motion from another.
    pub fn with_own(&self, other: &Self, joint: usize) -> Self {
        let mut with = self.clone();
        with.position_rad[joint].clone_from(&other.position_rad[joint]);
        with.velocity_rad_s[joint].clone_from(&other.velocity_rad_s[joint]);
        with.acceleration_rad_s2[joint].clone_from(&other.acceleration_rad_s2[joint]);
        with
    }

    /// The links' motion, where this is the motors': they swing behind their gears, whose kinematic error turns with the
    /// motor. A joint without a gear here was measured behind it.
    ///
    /// # Errors
    /// [`FilterError`] if the rate is no rate.
    pub fn behind_gears(
        &self,
        chain: &Chain,
        gears: &[Option<JointModel>],
    ) -> Result<Self, FilterError> {
        let link_rad = links_rad(chain, gears, &self.position_rad, self.rate_hz);
        Self::of(&link_rad, self.rate_hz)
    }

    fn knots(&self, samples: usize) -> Vec<usize> {
        let every = ((self.rate_hz / LOAD_HZ) as usize).max(1);
        (0..samples)
            .step_by(every)
            .chain([samples.saturating_sub(1)])
            .collect()
    }

    /// Every joint's position, velocity and acceleration at a sample.
    fn at(&self, k: usize) -> [Vec<f64>; 3] {
        [
            &self.position_rad,
            &self.velocity_rad_s,
            &self.acceleration_rad_s2,
        ]
        .map(|columns| columns.iter().map(|column| column[k]).collect())
    }

    /// A joint's velocity.
    pub fn velocity_rad_s(&self, joint: usize) -> &[f64] {
        &self.velocity_rad_s[joint]
    }

    /// A joint's acceleration.
    pub fn acceleration_rad_s2(&self, joint: usize) -> &[f64] {
        &self.acceleration_rad_s2[joint]
    }

    /// Torque on one joint that rounding of the other joints' encoders pretends within a band, root mean square, sample by
    /// sample. `encoders`: each joint's step and noise, joint side.
    pub fn rounding_nm(
        &self,
        chain: &Chain,
        joint: usize,
        encoders: &[[f64; 2]],
        cutoff_hz: f64,
    ) -> Vec<f64> {
        let samples = self.position_rad[joint].len();
        let count = self.position_rad.len();
        let knots = self.knots(samples);
        let bandwidth_rad_s = std::f64::consts::TAU * cutoff_hz;
        let at_knots: Vec<f64> = knots
            .iter()
            .map(|&k| {
                let [position_rad, velocity_rad_s, _] = self.at(k);
                let inertia_kg_m2 = mass_column_kg_m2(chain, &position_rad, joint);
                let others = (0..count).filter(|other| *other != joint);
                let square: f64 = others
                    .map(|other| {
                        let [step_rad, noise_rad] = encoders[other];
                        let rounding = Rounding {
                            step_rad,
                            noise_rad,
                            steps_hz: velocity_rad_s[other].abs() / step_rad,
                        };
                        let rounded_rad = rounding.beating_rad(self.rate_hz, cutoff_hz);
                        (inertia_kg_m2[other] * bandwidth_rad_s.powi(2) * rounded_rad).powi(2)
                    })
                    .sum();
                square.sqrt()
            })
            .collect();
        interpolate(&knots, samples, |knot| at_knots[knot])
    }

    /// What one joint of a chain carries along this motion.
    pub fn load(&self, chain: &Chain, joint: usize) -> Load {
        let values = self.at_knots(chain, joint);
        let samples = self.position_rad[joint].len();
        let knots = self.knots(samples);
        let column =
            |of: fn(&AtKnot) -> f64| interpolate(&knots, samples, |knot| of(&values[knot]));
        Load {
            position_rad: self.position_rad[joint].clone(),
            velocity_rad_s: self.velocity_rad_s[joint].clone(),
            torque_nm: column(|at| at.torque_nm),
            inertia_kg_m2: column(|at| at.inertia_kg_m2),
            slope_nm_rad: column(|at| at.slope_nm_rad),
            coupling_nm: column(|at| at.torque_nm - at.gravity_nm),
        }
    }

    /// The change of a load that is so much where loads are computed.
    pub(crate) fn change(&self, at_knots: &[AtKnot]) -> LoadChange {
        let samples = self.position_rad.first().map_or(0, Vec::len);
        let knots = self.knots(samples);
        let column =
            |of: fn(&AtKnot) -> f64| interpolate(&knots, samples, |knot| of(&at_knots[knot]));
        LoadChange {
            torque_nm: column(|at| at.torque_nm),
            inertia_kg_m2: column(|at| at.inertia_kg_m2),
            slope_nm_rad: column(|at| at.slope_nm_rad),
        }
    }

    /// What one joint of a chain carries where loads are computed.
    pub(crate) fn at_knots(&self, chain: &Chain, joint: usize) -> Vec<AtKnot> {
        let count = self.position_rad.len();
        let knots = self.knots(self.position_rad[joint].len());
        let rest = vec![0.0; count];
        let mut unit = vec![0.0; count];
        unit[joint] = 1.0;
        let mut out = vec![0.0; count];
        let at = |k: &usize| {
            let [mut position_rad, velocity_rad_s, mut acceleration_rad_s2] = self.at(*k);
            acceleration_rad_s2[joint] = 0.0;
            chain.inverse_dynamics(
                &position_rad,
                &velocity_rad_s,
                &acceleration_rad_s2,
                &mut out,
            );
            let torque_nm = out[joint];
            chain.gravity_torque(&position_rad, &mut out);
            let gravity_nm = out[joint];
            chain.inverse_dynamics(&position_rad, &rest, &unit, &mut out);
            let inertia_kg_m2 = out[joint] - gravity_nm;
            position_rad[joint] += SLOPE_RAD;
            chain.gravity_torque(&position_rad, &mut out);
            let slope_nm_rad = (out[joint] - gravity_nm) / SLOPE_RAD;
            AtKnot {
                torque_nm,
                gravity_nm,
                inertia_kg_m2,
                slope_nm_rad,
            }
        };
        knots.iter().map(at).collect()
    }
}

fn interpolate(knots: &[usize], samples: usize, value: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut column = Vec::with_capacity(samples);
    for (index, pair) in knots.windows(2).enumerate() {
        let steps = pair[1] - pair[0];
        for step in 0..steps {
            let share = step as f64 / steps as f64;
            column.push(value(index) + share * (value(index + 1) - value(index)));
        }
    }
    if !knots.is_empty() {
        column.push(value(knots.len() - 1));
    }
    column
}
