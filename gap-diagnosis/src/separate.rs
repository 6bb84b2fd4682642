//! How far two effects would be apart on a motion that no robot has made yet: `d²` along a simulated recording of it.
//!
//! `d² = min_b ‖F[φ_a - Σ b·φ_b - Σ z·φ_known]‖²` with `φ_a` the twin's response to one effect at its size, `φ_b` its responses
//! to the other, `φ_known` to what the robot file may be a little wrong about, and `F` the whitening of the diagnosis. Below 9
//! nobody can tell the two apart.

use gap_report::Regime;
use joint_twin::observe::Channel;
use joint_twin::on_all_cores::OnAllCores;
use joint_twin::signal::difference;
use joint_twin::stretch::stretches;
use joint_twin::{Changes, JointTwin, Row};
use nalgebra::{DMatrix, DVector};
use recording::Recording;
use recording_checks::mend;
use robot::{Effect, Robot};

use crate::closed_loop::search::{Model, Search};
use crate::diagnose::DiagnoseError;
use crate::effects::{Hypothesis, Shown, periodic, plain};
use crate::evidence::place::regimes;

/// What rows are told apart by: its name, and what a row has of it.
type Variable<'a> = (&'a str, &'a dyn Fn(&Row) -> f64);

/// A question: could the other effect be taken for this one?
#[derive(Clone, Debug, PartialEq)]
pub struct Pair {
    /// Index of the joint.
    pub joint: usize,
    /// What is there, at its size.
    pub effect: Effect,
    /// Identifier of what it may be taken for.
    pub other: String,
}

/// How far the two of a pair are apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// `d²`.
    pub distance: f64,
    /// The range of a variable in which most of what tells them apart lies, for the part of the time it takes.
    pub shows: Option<Regime>,
}

/// How far the effects of each pair are apart on a recording of the robot as its file has it.
///
/// # Errors
/// [`DiagnoseError`] if the recording cannot be simulated along.
pub fn separations(
    robot: &Robot,
    recording: &Recording,
    pairs: &[Pair],
) -> Result<Vec<Separation>, DiagnoseError> {
    let robot = &mend::robot(robot, &[]);
    let stretches = stretches(&[recording], robot)?;
    let mut found = vec![None; pairs.len()];
    for joint in 0..robot.joints.len() {
        let of_joint = || (0..pairs.len()).filter(|k| pairs[*k].joint == joint);
        if of_joint().next().is_none() {
            continue;
        }
        let Some(twin) = JointTwin::new(robot, joint, &stretches)? else {
            continue;
        };
        let responses = Responses::new(Search::new(&twin)?)?;
        for k in of_joint() {
            found[k] = Some(responses.separation(&pairs[k])?);
        }
    }
    let nothing = Separation {
        distance: 0.0,
        shows: None,
    };
    let told = found.into_iter();
    Ok(told.map(|one| one.unwrap_or(nothing.clone())).collect())
}

/// One joint's twin with its responses to what is known.
struct Responses<'a> {
    search: Search<'a>,
    /// The joint as its file has it.
    model: Model,
    base_nm: Vec<f64>,
    known_nm: Vec<Vec<f64>>,
}

impl<'a> Responses<'a> {
    fn new(search: Search<'a>) -> Result<Self, DiagnoseError> {
        let model = Model::of_settled(&search, &[]);
        let base_nm = search.coarsely_nm(&model)?;
        Ok(Self {
            known_nm: search.known_columns(&base_nm, &model)?,
            search,
            model,
            base_nm,
        })
    }

    fn to_effect(&self, effect: Effect) -> Result<Vec<f64>, DiagnoseError> {
        let simulated_nm = self.search.twin.coarsely(&Changes {
            known: Vec::new(),
            effects: vec![effect],
        })?;
        Ok(difference(&simulated_nm, &self.base_nm))
    }

    /// The least distance over the shapes that the other effect may have.
    fn separation(&self, pair: &Pair) -> Result<Separation, DiagnoseError> {
        let target_nm = self.to_effect(pair.effect)?;
        let variants = self.variants(pair);
        let variants = self.search.columns(&self.base_nm, &self.model, variants)?;
        let each = variants
            .iter()
            .on_all_cores(|(hypothesis, own_nm)| self.imitated(&target_nm, hypothesis, own_nm));
        let nearest = each.min_by(|a, b| a.0.total_cmp(&b.0));
        // an effect that no simulation shows is imitated by what is known alone
        let (distance, left_nm) = nearest.unwrap_or((0.0, target_nm));
        Ok(Separation {
            distance,
            shows: self.shows(&left_nm),
        })
    }

    /// The other effect at every shape that the diagnosis begins with.
    fn variants(&self, pair: &Pair) -> Vec<Hypothesis> {
        let twin = self.search.twin;
        let shown = Shown {
            joints: twin.joints(),
            has_link_encoder: twin.channels.contains(&Channel::Torsion),
            has_command: true,
            timing_is_open: true,
            limit_is_open: true,
            feels_weight: true,
        };
        let cycles = cycles_per_motor_rev(&pair.effect);
        plain(&self.search.scale, shown)
            .into_iter()
            .chain(cycles.into_iter().flat_map(periodic))
            .filter(|hypothesis| hypothesis.name() == pair.other)
            .collect()
    }

    /// What the hypothesis and what is known leave of a response: whitened square, and raw. What is known has a prior of its deviation.
    fn imitated(
        &self,
        target_nm: &[f64],
        hypothesis: &Hypothesis,
        own_nm: &[Vec<f64>],
    ) -> (f64, Vec<f64>) {
        let left_by = |own_nm: &[Vec<f64>]| {
            let raw_nm = [&self.known_nm[..], own_nm].concat();
            let white = self.search.whitened(&raw_nm);
            let white = DMatrix::from_vec(target_nm.len(), raw_nm.len(), white.concat());
            let target = DVector::from_vec(self.search.whitener.apply(target_nm));
            let mut products = white.tr_mul(&white);
            for k in 0..products.nrows() {
                let precision = if k < self.known_nm.len() { 1.0 } else { 0.0 };
                // a hair of its own size keeps two equal columns apart
                products[(k, k)] += precision + 1e-9 * products[(k, k)] + 1e-12;
            }
            let pulled = white.tr_mul(&target);
            let values = products
                .cholesky()
                .map_or_else(|| 0.0 * &pulled, |of| of.solve(&pulled));
            let mut left_nm = target_nm.to_vec();
            for (column, value) in raw_nm.iter().zip(&values) {
                let rows = left_nm.iter_mut().zip(column);
                rows.for_each(|(left, x)| *left -= value * x);
            }
            let square = (target - white * &values).norm_squared();
            (
                square,
                left_nm,
                values.as_slice().last().copied().unwrap_or(0.0),
            )
        };
        let (square, left_nm, last) = left_by(own_nm);
        if hypothesis.is_positive() && last < 0.0 {
            // it could not be less than nothing
            let (square, left_nm, _) = left_by(&[]);
            return (square, left_nm);
        }
        (square, left_nm)
    }

    /// Where most of the motor's torque lies, row by row as it counts.
    fn shows(&self, left_nm: &[f64]) -> Option<Regime> {
        let rows = &self.search.twin.rows;
        let of_motor: Vec<usize> = (0..rows.len())
            .filter(|k| rows[*k].channel == Channel::Motor)
            .collect();
        let counted = of_motor.iter();
        let counted_nm: Vec<f64> = counted
            .map(|k| self.search.whitener.weight(*k) * left_nm[*k])
            .collect();
        let ratio = self.search.scale.gear_ratio;
        let variables: [Variable<'_>; 4] = [
            ("position_rad", &|row| row.position_rad),
            ("motor_velocity_rad_s", &|row| ratio * row.velocity_rad_s),
            ("load_nm", &|row| row.load_nm),
            ("time_s", &|row| row.time_s),
        ];
        variables
            .into_iter()
            .flat_map(|(variable, of)| {
                let values: Vec<f64> = of_motor.iter().map(|k| of(&rows[*k])).collect();
                regimes(variable, &values, &counted_nm)
            })
            .max_by(|a, b| a.share.total_cmp(&b.share))
            .filter(|regime| regime.share > 0.0)
    }
}

/// Of an effect that repeats with the motor's turn.
fn cycles_per_motor_rev(effect: &Effect) -> Option<f64> {
    match *effect {
        Effect::PositionDependentFriction {
            cycles_per_motor_rev,
            ..
        }
        | Effect::KinematicError {
            cycles_per_motor_rev,
            ..
        }
        | Effect::TorqueRipple {
            cycles_per_motor_rev,
            ..
        } => Some(cycles_per_motor_rev),
        Effect::EncoderEccentricity { cycles_per_rev, .. } => Some(cycles_per_rev),
        _ => None,
    }
}
