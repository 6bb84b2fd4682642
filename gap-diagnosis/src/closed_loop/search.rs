//! A joint's recordings beside its twin: the numbers that are compared, how sure they are, and models of the joint.

use joint_twin::TwinError;
use joint_twin::known::Known;
use joint_twin::observe::{Channel, SPREAD_S};
use joint_twin::on_all_cores::OnAllCores;
use joint_twin::scale::Scale;
use joint_twin::signal::difference;
use joint_twin::simulate::Between;
use joint_twin::whiten::{Floor, Whitener, series};
use joint_twin::{Changes, JointTwin, Row};
use robot::Effect;

use super::turns::{self, FastRipple};
use crate::effects::{Hypothesis, Shown, plain};
use crate::evidence::told::MATERIALITY;

/// Runs of the twin with noise, of which the mean is taken.
const NOISY_RUNS: u64 = 6;
/// What the twin itself is off, as parts of the friction: from sample to sample, and slowly.
const TWIN_QUICK: f64 = 0.002;
const TWIN_SLOW: f64 = 0.006;
/// Over which the slow part changes.
const TWIN_SLOW_S: f64 = 0.15;
/// An effect with its fitted amplitudes.
#[derive(Clone, Debug, PartialEq)]
pub struct Term {
    /// What.
    pub hypothesis: Hypothesis,
    /// How much.
    pub amplitudes: Vec<f64>,
}

impl Term {
    /// As a robot file writes it.
    pub fn effect(&self, scale: &Scale) -> Effect {
        self.hypothesis.effect(&self.amplitudes, scale)
    }
}

/// A joint's model: what is known, refitted, and the effects added to it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// In standard deviations.
    pub known: Vec<f64>,
    /// Effects that were found elsewhere, in the samples or with other joints: they are not fitted here.
    pub settled: Vec<Term>,
    /// Added effects.
    pub terms: Vec<Term>,
}

impl Model {
    /// With what is settled, and everything else as the robot file has it.
    pub fn of_settled(search: &Search<'_>, settled: &[Term]) -> Self {
        Self {
            known: vec![0.0; search.twin.known.len()],
            settled: settled.to_vec(),
            terms: Vec::new(),
        }
    }

    /// For the twin.
    pub fn changes(&self, scale: &Scale) -> Changes {
        Changes {
            known: self.known.clone(),
            effects: self
                .settled
                .iter()
                .chain(&self.terms)
                .map(|term| term.effect(scale))
                .collect(),
        }
    }
}

/// A joint's recordings beside its twin, ready to be searched.
#[derive(Clone)]
pub struct Search<'a> {
    /// The twin.
    pub twin: &'a JointTwin<'a>,
    /// Sizes of the joint.
    pub scale: Scale,
    /// Measured channels less what noise does to them.
    pub measured_nm: Vec<f64>,
    /// Standard deviation of what noise does, row by row of each channel.
    pub noise_nm: Vec<(Channel, f64)>,
    /// Standard deviation between repeats of one input, of the motor's channel, where there are any.
    pub repeats_nm: Option<f64>,
    /// Makes residuals independent.
    pub whitener: Whitener,
    /// What may be added, periodic effects aside.
    pub(crate) hypotheses: Vec<Hypothesis>,
    /// A ripple that is faster than what is compared.
    pub(crate) fast_ripple: Option<FastRipple>,
}

impl<'a> Search<'a> {
    /// Runs the twin without changes, with and without noise.
    ///
    /// # Errors
    /// [`TwinError`].
    pub fn new(twin: &'a JointTwin<'a>) -> Result<Self, TwinError> {
        let stretches = twin.stretches();
        let scale = Scale::of(
            &twin.nominal,
            twin.axis(),
            &stretches,
            twin.spare_link_inertia_kg_m2(),
        );
        let nominal = Changes::default();
        let clean = twin.simulated(&nominal, None)?;
        let noisy = (1..=NOISY_RUNS)
            .on_all_cores(|seed| twin.simulated(&nominal, Some(seed)))
            .collect::<Result<Vec<_>, _>>()?;
        let runs = NOISY_RUNS as f64;
        let mean: Vec<f64> = (0..clean.len())
            .map(|k| noisy.iter().map(|run| run[k]).sum::<f64>() / runs)
            .collect();
        let mut measured_nm = twin.measured()?;
        for ((value, mean), clean) in measured_nm.iter_mut().zip(&mean).zip(&clean) {
            *value -= mean - clean;
        }
        let noise_nm: Vec<(Channel, f64)> = twin
            .channels
            .iter()
            .map(|&channel| {
                let of_channel = (0..twin.rows.len()).filter(|k| twin.rows[*k].channel == channel);
                let (mut sum, mut count) = (0.0, 0.0);
                for k in of_channel {
                    sum += noisy
                        .iter()
                        .map(|run| (run[k] - mean[k]).powi(2))
                        .sum::<f64>();
                    count += runs - 1.0;
                }
                let noise_nm = (sum / f64::max(count, 1.0)).sqrt();
                match channel {
                    // no robot file tells the noise of a torque sensor
                    Channel::Link => (channel, noise_nm.hypot(twin.torque_sensor_noise_nm())),
                    _ => (channel, noise_nm),
                }
            })
            .collect();
        let has_link_encoder = stretches.iter().any(|stretch| stretch.link_rad.is_some());
        let has_command = stretches.iter().all(|stretch| stretch.has_command);
        // where the drive reports its torque beside every command, its limit, delay and lag are read off the samples
        let lacks_commands = lacks_commands(twin);
        let limit_is_open = !twin.channels.contains(&Channel::Drive);
        let timing_is_open = lacks_commands || limit_is_open;
        let shown = Shown {
            joints: twin.joints(),
            has_link_encoder,
            has_command,
            timing_is_open,
            limit_is_open,
            feels_weight: twin.gravity_part() > MATERIALITY,
        };
        Ok(Self {
            twin,
            scale,
            measured_nm,
            whitener: whitener(twin, &noise_nm, &scale)?,
            noise_nm,
            repeats_nm: None,
            hypotheses: plain(&scale, shown),
            fast_ripple: turns::fast_ripple(twin),
        })
    }

    /// What a channel holds whatever the model: noise and what the twin itself is off.
    pub fn floor(&self, channel: Channel) -> Floor {
        let mut floor = floor(channel, &self.noise_nm, &self.scale, self.twin);
        if let (Channel::Motor, Some(repeats_nm)) = (channel, self.repeats_nm) {
            let quick_nm = repeats_nm.hypot(TWIN_QUICK * self.scale.friction_nm);
            floor.quick_nm = floor.quick_nm.max(quick_nm);
        }
        floor
    }

    /// What the robot file's noise makes of a channel.
    pub(crate) fn file_noise_nm(&self, channel: Channel) -> f64 {
        noise_nm(&self.noise_nm, channel)
    }

    /// Its standard deviation.
    pub fn twin_floor_nm(&self, channel: Channel) -> f64 {
        let floor = self.floor(channel);
        floor.quick_nm.hypot(floor.slow_nm)
    }

    /// Fitted values of a hypothesis: amplitudes, and the shape where it is free.
    pub fn values(hypothesis: &Hypothesis) -> usize {
        let amplitudes = if hypothesis.is_switch() {
            0
        } else {
            hypothesis.amplitudes()
        };
        amplitudes + usize::from(hypothesis.shape_is_free())
    }

    /// A term with its values moved by so many steps, its shape within its range.
    pub fn stepped(&self, term: &Term, steps: &[f64]) -> Term {
        let mut term = term.clone();
        let mut steps = steps.iter().copied();
        if !term.hypothesis.is_switch() {
            for amplitude in &mut term.amplitudes {
                *amplitude += steps.next().unwrap_or(0.0);
            }
        }
        if term.hypothesis.shape_is_free() {
            let factor = 1.0 + term.hypothesis.shape_step(&self.scale);
            let [least, most] = term.hypothesis.shape_range(&self.scale);
            let shape = term.hypothesis.shape[0] * factor.powf(steps.next().unwrap_or(0.0));
            let shape = shape.max(least).min(most);
            term.hypothesis = term.hypothesis.shaped(&[shape]);
        }
        term
    }

    /// What the model leaves of the measurement.
    ///
    /// # Errors
    /// [`TwinError`].
    pub fn residual_nm(&self, model: &Model) -> Result<Vec<f64>, TwinError> {
        let simulated = self.twin.simulated(&model.changes(&self.scale), None)?;
        Ok(difference(&self.measured_nm, &simulated))
    }

    /// In coarse substeps, whose runs are compared with each other only.
    pub(crate) fn coarsely_nm(&self, model: &Model) -> Result<Vec<f64>, TwinError> {
        self.twin.coarsely(&model.changes(&self.scale))
    }

    /// What a run in coarse substeps would have to be to leave nothing: this less the coarse run of another model near it is what that
    /// model leaves in fine ones, since what the longer substeps do to both is the same.
    pub(crate) fn to_reach_nm(
        &self,
        model: &Model,
        residual_nm: &[f64],
    ) -> Result<Vec<f64>, TwinError> {
        let coarse_nm = self.coarsely_nm(model)?;
        let both = coarse_nm.iter().zip(residual_nm);
        Ok(both.map(|(simulated, left)| simulated + left).collect())
    }
}

/// Whether there were commands that the recording does not show.
fn lacks_commands(twin: &JointTwin<'_>) -> bool {
    let stretches = twin.stretches();
    let mut drives = stretches.iter().map(|stretch| &stretch.drive);
    drives.any(|drive| drive.between == Between::Line)
}

fn noise_nm(of_channels: &[(Channel, f64)], channel: Channel) -> f64 {
    let mut of_channels = of_channels.iter();
    let found = of_channels.find(|(of, _)| *of == channel);
    found.map_or(0.0, |(_, noise_nm)| *noise_nm)
}

/// What a channel holds whatever the model.
fn floor(
    channel: Channel,
    noise_nm: &[(Channel, f64)],
    scale: &Scale,
    twin: &JointTwin<'_>,
) -> Floor {
    let noise_nm = self::noise_nm(noise_nm, channel);
    Floor {
        quick_nm: noise_nm.hypot(TWIN_QUICK * scale.friction_nm),
        slow_nm: match channel {
            Channel::Drive => 0.0,
            Channel::Motor => TWIN_SLOW * scale.friction_nm,
            // the twist of the gear swings, and nobody knows its damping
            Channel::Torsion | Channel::Link => 2.0 * TWIN_SLOW * scale.friction_nm,
        },
        slow_samples: TWIN_SLOW_S * twin.rows_hz(),
    }
}

fn whitener(
    twin: &JointTwin<'_>,
    noise_nm: &[(Channel, f64)],
    scale: &Scale,
) -> Result<Whitener, TwinError> {
    let floor = |row: &Row| floor(row.channel, noise_nm, scale, twin);
    Ok(Whitener::new(&twin.rows, floor).doubting(&doubts_nm(twin)?))
}

/// What nobody can tell of a row: the part of what friction before it slips does that is not in proportion to it, and where
/// friction is a table over the load, of what the corners of the table and the links do. When a joint breaks away from
/// rest, and on which side of a corner it moves, is such a thing.
fn doubts_nm(twin: &JointTwin<'_>) -> Result<Vec<f64>, TwinError> {
    let has_table = twin.nominal.friction.load_torque.is_some();
    let clean = twin.coarsely(&Changes::default())?;
    let mut squares = vec![0.0; clean.len()];
    for (place, known) in twin.known.iter().enumerate() {
        let steps = match known.known {
            Known::Presliding => [-1.0, 1.0],
            Known::Creep(_) | Known::Rounding => [1.0, 2.0],
            known if known.is_of_links() && has_table => [-1.0, 1.0],
            _ => continue,
        };
        let run = |deviations: f64| {
            let mut known = vec![0.0; twin.known.len()];
            known[place] = deviations;
            let changes = Changes {
                known,
                effects: Vec::new(),
            };
            twin.coarsely(&changes)
        };
        let [a, b] = [run(steps[0])?, run(steps[1])?];
        for (k, square) in squares.iter_mut().enumerate() {
            // values at three places one apart, in whatever order
            let [least, middle, most] = if steps[0] < 0.0 {
                [a[k], clean[k], b[k]]
            } else {
                [clean[k], a[k], b[k]]
            };
            *square += (0.5 * (least + most) - middle).powi(2);
        }
    }
    // what nobody can tell of a row counts for its neighbours too
    let around = (SPREAD_S * twin.rows_hz()).round() as usize;
    let mut doubts_nm = vec![0.0; clean.len()];
    for of in series(&twin.rows) {
        for k in of.clone() {
            let near = k.saturating_sub(around).max(of.start)..(k + around + 1).min(of.end);
            doubts_nm[k] = squares[near].iter().copied().fold(0.0, f64::max).sqrt();
        }
    }
    Ok(doubts_nm)
}
