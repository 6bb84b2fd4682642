//! How far two effects would be apart on a motion that no robot has made yet: `d²` along a simulated recording of it.
//!
//! `d² = min_b ‖F[φ_a - Σ b·φ_b - Σ z·φ_known]‖²` with `φ_a` the twin's response to one effect at its size, `φ_b` its responses
//! to the other, `φ_known` to what the robot file may be a little wrong about, and `F` the whitening of the diagnosis. Below 9
//! nobody can tell the two apart.

use recording::Recording;
use robot::{Effect, Robot};

use crate::checks::mend;
use crate::closed_loop::search::Search;
use crate::diagnose::DiagnoseError;
use crate::effects::{Hypothesis, Shown, periodic, plain};
use crate::evidence::DEVIATIONS;
use crate::evidence::told::regimes;
use crate::fit::{Bound, Fit};
use crate::on_all_cores::OnAllCores;
use crate::report::Regime;
use crate::twin::observe::Channel;
use crate::twin::stretch::stretches;
use crate::twin::{Changes, JointTwin, Row};

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
    base_nm: Vec<f64>,
    known_nm: Vec<Vec<f64>>,
}

impl<'a> Responses<'a> {
    fn new(search: Search<'a>) -> Result<Self, DiagnoseError> {
        let base_nm = search.twin.coarsely(&Changes::default())?;
        let count = search.twin.known.len();
        let mut responses = Self {
            search,
            base_nm,
            known_nm: Vec::new(),
        };
        responses.known_nm = (0..count)
            .on_all_cores(|index| {
                let mut known = vec![0.0; count];
                known[index] = 1.0;
                responses.to(Changes {
                    known,
                    effects: Vec::new(),
                })
            })
            .collect::<Result<_, _>>()?;
        Ok(responses)
    }

    fn to(&self, changes: Changes) -> Result<Vec<f64>, DiagnoseError> {
        let simulated = self.search.twin.coarsely(&changes)?;
        let difference = simulated.iter().zip(&self.base_nm).map(|(a, b)| a - b);
        Ok(difference.collect())
    }

    fn to_effect(&self, effect: Effect) -> Result<Vec<f64>, DiagnoseError> {
        self.to(Changes {
            known: Vec::new(),
            effects: vec![effect],
        })
    }

    /// The least distance over the shapes that the other effect may have.
    fn separation(&self, pair: &Pair) -> Result<Separation, DiagnoseError> {
        let target_nm = self.to_effect(pair.effect)?;
        let white = self.search.whitener.apply(&target_nm);
        let each = self
            .variants(pair)
            .into_iter()
            .on_all_cores(|hypothesis| self.imitated(&target_nm, &white, &hypothesis))
            .collect::<Result<Vec<_>, DiagnoseError>>()?;
        let nearest = each.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
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
        };
        let cycles = cycles_per_motor_rev(&pair.effect);
        plain(&self.search.scale, shown)
            .into_iter()
            .chain(cycles.into_iter().flat_map(periodic))
            .filter(|hypothesis| hypothesis.name() == pair.other)
            .collect()
    }

    /// What the hypothesis and what is known leave of a response: whitened square, and raw.
    fn imitated(
        &self,
        target_nm: &[f64],
        target_white: &[f64],
        hypothesis: &Hypothesis,
    ) -> Result<(f64, Vec<f64>), DiagnoseError> {
        let mut columns = self.known_nm.clone();
        let mut bounds: Vec<Bound> = self
            .search
            .twin
            .known
            .iter()
            .map(|known| Bound {
                range: [
                    if known.is_positive() {
                        0.0
                    } else {
                        -DEVIATIONS
                    },
                    DEVIATIONS,
                ],
                precision: 1.0,
            })
            .collect();
        for index in 0..hypothesis.amplitudes() {
            let (probe, beside) = hypothesis.probes(index);
            let at = |probe: &[f64]| self.to_effect(hypothesis.effect(probe, &self.search.scale));
            let mut column = at(&probe)?;
            if let Some(beside) = beside {
                let beside = at(&beside)?;
                column.iter_mut().zip(beside).for_each(|(x, y)| *x -= y);
            }
            columns.push(column);
            bounds.push(if hypothesis.is_positive() {
                Bound::POSITIVE
            } else {
                Bound::FREE
            });
        }
        let white: Vec<Vec<f64>> = columns
            .iter()
            .map(|column| self.search.whitener.apply(column))
            .collect();
        let fit = Fit::of(&white, target_white, &bounds);
        let mut left_nm = target_nm.to_vec();
        for (column, coefficient) in columns.iter().zip(&fit.coefficients) {
            for (left, x) in left_nm.iter_mut().zip(column) {
                *left -= coefficient * x;
            }
        }
        Ok((fit.square, left_nm))
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
