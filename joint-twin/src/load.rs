//! What a joint carries along a recorded motion: inertia and torque of the rigid bodies, with all other joints moving as
//! they were recorded.

use joint_model::filter::FilterError;
use joint_model::rigid_body::{Chain, Moving, Standing};

use crate::elastic::{links_rad, mass_column_kg_m2};
use crate::joint::JointModel;
use crate::signal::band::{MOTION_HZ, up_to};
use crate::signal::rounding::Rounding;
use crate::signal::smooth::{derivative, low_pass, second_derivative};

/// The load is computed about so many times a second and interpolated: poses change slowly.
const LOAD_HZ: f64 = 200.0;
/// Poses that are looked at in a recording's piece.
pub const POSES: usize = 50;
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

/// How a load changes with one property of the rigid bodies, where loads are computed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadChange(Vec<AtKnot>);

impl LoadChange {
    /// From one load to another of the same motion.
    pub(crate) fn between(from: &[AtKnot], to: &[AtKnot]) -> Self {
        let both = from.iter().zip(to);
        Self(both.map(|(from, to)| to.plus(-1.0, from)).collect())
    }

    /// Adds another of the same motion, times a factor.
    pub fn add(&mut self, other: &Self, factor: f64) {
        if self.0.is_empty() {
            self.0 = vec![AtKnot::default(); other.0.len()];
        }
        for (sum, other) in self.0.iter_mut().zip(&other.0) {
            *sum = sum.plus(factor, other);
        }
    }

    /// Scaled.
    #[must_use]
    pub fn times(&self, factor: f64) -> Self {
        let mut scaled = Self::default();
        scaled.add(self, factor);
        scaled
    }

    #[cfg(test)]
    pub(crate) fn largest_difference(&self, other: &Self) -> f64 {
        let both = self.0.iter().zip(&other.0);
        let differences = both.map(|(a, b)| {
            let AtKnot {
                torque_nm,
                gravity_nm,
                inertia_kg_m2,
                slope_nm_rad,
            } = a.plus(-1.0, b);
            let columns = [torque_nm, gravity_nm, inertia_kg_m2, slope_nm_rad];
            columns.map(f64::abs).into_iter().fold(0.0, f64::max)
        });
        differences.fold(0.0, f64::max)
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
        let cutoff_hz = up_to(MOTION_HZ, rate_hz);
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
    fn at(&self, k: usize, [position, velocity, acceleration]: [&mut [f64]; 3]) {
        for (at, columns) in [
            (position, &self.position_rad),
            (velocity, &self.velocity_rad_s),
            (acceleration, &self.acceleration_rad_s2),
        ] {
            for (value, column) in at.iter_mut().zip(columns) {
                *value = column[k];
            }
        }
    }

    /// Poses all along it, some from each of its parts.
    pub fn poses_rad(&self) -> impl Iterator<Item = Vec<f64>> {
        let rows = self.position_rad.first().map_or(0, Vec::len);
        let every = (rows / POSES).max(1);
        (0..rows).step_by(every).map(|row| {
            let joints = self.position_rad.iter();
            joints.map(|position_rad| position_rad[row]).collect()
        })
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
        let mut at = [(); 3].map(|()| vec![0.0; count]);
        let at_knots: Vec<f64> = knots
            .iter()
            .map(|&k| {
                self.at(k, at.each_mut().map(|values| &mut values[..]));
                let [position_rad, velocity_rad_s, _] = &at;
                let inertia_kg_m2 = mass_column_kg_m2(chain, position_rad, joint);
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

    /// Adds a change along this motion to a load of every so many of its samples.
    pub fn change(&self, load: &mut Load, change: &LoadChange, every: usize) {
        let Some(last) = change.0.last() else {
            return;
        };
        let samples = self.position_rad.first().map_or(0, Vec::len);
        let mut between = self.knots(samples);
        // whatever lies at the last knot or behind it is as there
        between.push(usize::MAX);
        let mut knot = 0;
        for k in 0..load.torque_nm.len() {
            let sample = k * every;
            while between[knot + 1] <= sample {
                knot += 1;
            }
            let added = match change.0.get(knot..knot + 2) {
                Some([before, after]) => {
                    let steps = (between[knot + 1] - between[knot]) as f64;
                    let share = (sample - between[knot]) as f64 / steps;
                    before.plus(share, &after.plus(-1.0, before))
                }
                _ => *last,
            };
            load.torque_nm[k] += added.torque_nm;
            load.inertia_kg_m2[k] += added.inertia_kg_m2;
            load.slope_nm_rad[k] += added.slope_nm_rad;
        }
    }

    /// Root mean square of the torque by which a changed load moves a joint along this motion.
    pub fn rms_nm(&self, joint: usize, change: &LoadChange) -> f64 {
        let acceleration_rad_s2 = self.acceleration_rad_s2(joint);
        let knots = self.knots(acceleration_rad_s2.len());
        let square = |(k, at): (&usize, &AtKnot)| {
            (at.torque_nm + at.inertia_kg_m2 * acceleration_rad_s2[*k]).powi(2)
        };
        let squares: f64 = knots.iter().zip(&change.0).map(square).sum();
        (squares / knots.len().max(1) as f64).sqrt()
    }

    /// What one joint of a chain carries where loads are computed.
    pub(crate) fn at_knots(&self, chain: &Chain, joint: usize) -> Vec<AtKnot> {
        self.at_knots_of(std::slice::from_ref(chain), joint)
            .swap_remove(0)
    }

    /// The same of several chains that differ in the mass and inertia of their links only.
    ///
    /// # Panics
    /// If there is none, or they differ in more.
    pub(crate) fn at_knots_of(&self, chains: &[Chain], joint: usize) -> Vec<Vec<AtKnot>> {
        let one = &chains[0];
        assert!(
            chains.iter().all(|chain| chain.moves_as(one)),
            "chains whose links move in different ways"
        );
        let count = self.position_rad.len();
        let knots = self.knots(self.position_rad[joint].len());
        let rest = vec![0.0; count];
        let mut unit = vec![0.0; count];
        unit[joint] = 1.0;
        let [
            mut position_rad,
            mut velocity_rad_s,
            mut acceleration_rad_s2,
        ] = [(); 3].map(|()| vec![0.0; count]);
        let [mut moving, mut pushed] = [Moving::default(), Moving::default()];
        let [mut standing, mut beside] = [Standing::default(), Standing::default()];
        let mut all = vec![Vec::with_capacity(knots.len()); chains.len()];
        for k in knots {
            let motion = [
                &mut position_rad[..],
                &mut velocity_rad_s,
                &mut acceleration_rad_s2,
            ];
            self.at(k, motion);
            acceleration_rad_s2[joint] = 0.0;
            one.links_moving(
                &position_rad,
                &velocity_rad_s,
                &acceleration_rad_s2,
                &mut moving,
            );
            one.links_moving(&position_rad, &rest, &unit, &mut pushed);
            one.links_standing(&position_rad, &mut standing);
            position_rad[joint] += SLOPE_RAD;
            one.links_standing(&position_rad, &mut beside);
            for (chain, at_knots) in chains.iter().zip(&mut all) {
                let carried = chain.carried(joint, &standing);
                let gravity_nm = standing.holding_torque_nm(joint, &carried);
                let beside_nm = beside.holding_torque_nm(joint, &carried);
                at_knots.push(AtKnot {
                    torque_nm: chain.moving_torque_nm(joint, &moving),
                    gravity_nm,
                    inertia_kg_m2: chain.moving_torque_nm(joint, &pushed) - gravity_nm,
                    slope_nm_rad: (beside_nm - gravity_nm) / SLOPE_RAD,
                });
            }
        }
        all
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
