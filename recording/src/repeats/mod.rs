//! Repeats of one input: how far a robot that is given the same twice does not do the same twice.
//!
//! What repeats differ by is nobody's model error: it is the noise floor, found without a model. Pieces of recordings are
//! repeats of each other where every joint had the same reference; where none is recorded, the same commanded torque; where there
//! is none either, bit for bit the same measured torque. Where they start and how they part is part of the scatter.
//!
//! Each repeat is judged against the others, left out itself (see the module `statistics`). While one is found that chance would
//! hardly make, the least probable one is taken out and the rest are judged anew. What then remains is alike, and its scatter is the
//! noise floor. Whether repeats drift is a question of its own: then neighbours are nearer than any two are.

mod statistics;

use std::collections::BTreeSet;

use serde::Serialize;

use crate::grid::{Grid, pieces};
use crate::{Recording, STILL_RAD, Signal};
pub use statistics::mean_and_variance;
use statistics::{Deviation, Means};

/// Fewer repeats tell nothing: one is left out, and the scatter of one other cannot be told.
pub const REPEATS_MIN: usize = 3;
/// Of groups of repeats that are alike, the part in which one is said to differ; and in which a joint is said to drift.
pub const FALSE_ALARMS: f64 = 0.01;

/// Shorter pieces are no motion.
const ROWS_MIN: usize = 64;
/// The shorter of two repeats has at least this part of the longer one's length.
const COMMON: f64 = 0.9;
/// Inputs that differ by less than this part of their largest value are the same.
const SAME: f64 = 1e-6;
/// Part of the time that is the start, and the end.
const AT_END: f64 = 0.05;
/// What a joint may be told to do, the best first.
const INPUTS: [Signal; 3] = [
    Signal::ReferencePositionRad,
    Signal::CommandTorqueNm,
    Signal::MotorTorqueNm,
];
/// What is compared.
const MEASURED: [Signal; 7] = [
    Signal::MotorPositionRad,
    Signal::MotorVelocityRadS,
    Signal::MotorTorqueNm,
    Signal::CommandTorqueNm,
    Signal::LinkPositionRad,
    Signal::LinkVelocityRadS,
    Signal::JointTorqueNm,
];

/// Where a piece begins among the recordings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Index of the recording.
    pub recording: usize,
    /// Its first row.
    pub first_row: usize,
}

/// Repeats of one input.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// What was the same, of any joint.
    pub input: BTreeSet<Signal>,
    /// Samples per second.
    pub sample_rate_hz: f64,
    /// Of the shortest repeat: so much of all is compared.
    pub samples: usize,
    /// The same in seconds.
    pub seconds: f64,
    /// A deviation that lasts is found from about so many scatters on.
    pub found_from_scatters: f64,
    /// In the first recording's order.
    pub joints: Vec<JointScatter>,
    /// In the order of the recordings.
    pub repeats: Vec<Repeat>,
}

/// How a joint's repeats scatter, those that differ left out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointScatter {
    /// Name.
    pub joint: String,
    /// It moves too little to be judged.
    pub stands: bool,
    /// Of each signal that is not the same in all repeats.
    pub signals: Vec<SignalScatter>,
    /// What order the repeats came in matters; none where it cannot be told.
    pub order: Option<Order>,
}

/// Standard deviation between the repeats at one instant, in the unit of the signal's name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SignalScatter {
    /// What.
    pub signal: Signal,
    /// Root mean square over the whole time.
    pub rms: f64,
    /// The same over the first twentieth of the time.
    pub rms_at_start: f64,
    /// And over the last.
    pub rms_at_end: f64,
}

/// How much the order of the repeats has to do with how they differ.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Order {
    /// How far a repeat is from the next over how far any two are from each other: 1 where the order does not matter.
    pub next_to_any: f64,
    /// Part of all orders in which neighbours would be as near.
    pub probability: f64,
    /// Chance would hardly make that.
    pub drifts: bool,
}

/// One repeat among the others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repeat {
    /// Name of its recording.
    pub recording: String,
    /// When in that recording it begins.
    pub from_s: f64,
    /// Chance would hardly make one like it.
    pub differs: bool,
    /// Of each joint that moves, in the order of the recordings.
    pub joints: Vec<JointDeviation>,
    /// Where it lies.
    #[serde(skip)]
    pub place: Place,
}

/// How a joint of one repeat deviates from the others.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointDeviation {
    /// Name.
    pub joint: String,
    /// Of repeats that are alike, the part that deviates as much.
    pub probability: f64,
    /// This joint differs.
    pub differs: bool,
    /// What shows it most.
    pub signal: Signal,
    /// Of that signal, root mean square over time in units of the others' scatter: about 1 for what is alike.
    pub in_scatters: f64,
    /// When it shows most, since the repeat began.
    pub from_s: f64,
    /// Until then.
    pub to_s: f64,
}

/// Finds repeats among recordings with their names and judges them.
///
/// # Errors
/// [`NoRepeats`].
pub fn repeats(recordings: &[(String, Recording)]) -> Result<Vec<Group>, NoRepeats> {
    let tables: Vec<&Recording> = recordings.iter().map(|(_, table)| table).collect();
    let found = same_inputs(&tables);
    let most = found.iter().map(Vec::len).max().unwrap_or(0);
    let enough = |group: &Vec<Piece>| group.len() >= REPEATS_MIN;
    let groups: Vec<Group> = found
        .into_iter()
        .filter(enough)
        .map(|pieces| Group::of(&pieces, recordings))
        .collect();
    if groups.is_empty() {
        return Err(NoRepeats { most });
    }
    Ok(groups)
}

/// No input was repeated often enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{} had the same input, and {REPEATS_MIN} are needed: the same reference_position_rad of every joint (where none is \
     recorded the same command_torque_nm, else bit for bit the same motor_torque_nm), the same rate, about the same length and at \
     least {ROWS_MIN} rows",
    in_words(*.most)
)]
pub struct NoRepeats {
    /// The most that had the same input.
    pub most: usize,
}

fn in_words(most: usize) -> String {
    match most {
        0 | 1 => "no two pieces of the recordings".to_owned(),
        most => format!("no more than {most} pieces of the recordings"),
    }
}

/// A piece of a recording with what its joints were told to do.
struct Piece {
    place: Place,
    rate_hz: f64,
    from_s: f64,
    grid: Grid,
    /// Of each joint; of the first of a group only.
    inputs: Vec<Input>,
}

/// Pieces with the same input, in the order in which they first come.
fn same_inputs(recordings: &[&Recording]) -> Vec<Vec<Piece>> {
    let mut groups: Vec<Vec<Piece>> = Vec::new();
    for (index, recording) in recordings.iter().enumerate() {
        for rows in pieces(recording) {
            let Some(mut piece) = Piece::new(index, recording, rows) else {
                continue;
            };
            let same = |group: &&mut Vec<Piece>| group[0].is_repeated_by(&piece);
            match groups.iter_mut().find(same) {
                Some(group) => {
                    piece.inputs.clear();
                    group.push(piece);
                }
                None => groups.push(vec![piece]),
            }
        }
    }
    groups
}

impl Piece {
    /// None where it is too short, or nothing tells what a joint was to do, or no joint was to do anything.
    fn new(index: usize, recording: &Recording, rows: std::ops::Range<usize>) -> Option<Self> {
        let rate_hz = recording.sample_rate_hz;
        if rows.len() < ROWS_MIN || !(rate_hz.is_finite() && rate_hz > 0.0) {
            return None;
        }
        let time_s = &recording.time_s[rows.clone()];
        let grid = Grid::new(time_s, rows.start, rate_hz);
        let inputs = recording
            .joints
            .iter()
            .map(|joint| {
                INPUTS.iter().find_map(|&signal| {
                    let (values, _) = grid.sample(joint.measured(signal)?, 1.0);
                    Some(Input {
                        joint: joint.name.clone(),
                        signal,
                        values,
                    })
                })
            })
            .collect::<Option<Vec<_>>>()?;
        let changes = |values: &[f64]| values.iter().any(|x| *x != values[0]);
        let place = Place {
            recording: index,
            first_row: rows.start,
        };
        let piece = Self {
            place,
            rate_hz,
            from_s: time_s[0],
            grid,
            inputs,
        };
        let any = piece.inputs.iter().any(|input| changes(&input.values));
        (any && piece.grid.samples() >= ROWS_MIN).then_some(piece)
    }

    fn is_repeated_by(&self, other: &Self) -> bool {
        let (a, b) = (self.grid.samples() as f64, other.grid.samples() as f64);
        (self.rate_hz - other.rate_hz).abs() <= 1e-3 * self.rate_hz
            && a.min(b) >= COMMON * a.max(b)
            && self.inputs.len() == other.inputs.len()
            && self
                .inputs
                .iter()
                .zip(&other.inputs)
                .all(|(a, b)| a.is_the_same_as(b))
    }
}

/// What a joint was told to do.
struct Input {
    joint: String,
    signal: Signal,
    values: Vec<f64>,
}

impl Input {
    fn is_the_same_as(&self, other: &Self) -> bool {
        let largest = self.values.iter().map(|x| x.abs()).fold(0.0, f64::max);
        let apart = match self.signal {
            // what was measured is only the same where it is not measured but told
            Signal::MotorTorqueNm => 0.0,
            _ => SAME * largest,
        };
        let mut both = self.values.iter().zip(&other.values);
        self.joint == other.joint
            && self.signal == other.signal
            && both.all(|(a, b)| (a - b).abs() <= apart)
    }
}

/// A joint in all repeats.
struct Joint {
    name: String,
    stands: bool,
    signals: Vec<Signal>,
    means: Vec<Means>,
}

/// A signal in all repeats, as long as the shortest is.
struct Values {
    signal: Signal,
    repeats: Vec<Vec<f64>>,
    /// Whether it was there at an instant, in all.
    counts: Vec<bool>,
}

impl Values {
    fn is_the_same(&self) -> bool {
        self.repeats.iter().all(|values| *values == self.repeats[0])
    }

    /// Farthest way of any repeat.
    fn way(&self) -> f64 {
        let way = |values: &Vec<f64>| {
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            values.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
        };
        self.repeats.iter().map(way).fold(0.0, f64::max)
    }

    fn scatter(&self, among: &[usize]) -> SignalScatter {
        let samples = self.counts.len();
        let end = ((AT_END * samples as f64) as usize).max(1);
        let rms = |rows: std::ops::Range<usize>| {
            let counted = rows.filter(|row| self.counts[*row]);
            let (sum, count) = counted.fold((0.0, 0.0), |(sum, count), row| {
                let values: Vec<f64> = among.iter().map(|one| self.repeats[*one][row]).collect();
                (sum + mean_and_variance(&values).1, count + 1.0)
            });
            (sum / f64::max(count, 1.0)).sqrt()
        };
        SignalScatter {
            signal: self.signal,
            rms: rms(0..samples),
            rms_at_start: rms(0..end),
            rms_at_end: rms(samples - end..samples),
        }
    }
}

/// The pieces of a group with the recordings they are of.
struct Pieces<'a> {
    recordings: &'a [(String, Recording)],
    pieces: &'a [Piece],
    samples: usize,
}

impl Pieces<'_> {
    /// All that was measured of a joint.
    fn values(&self, joint: &str) -> Vec<Values> {
        let of = |signal: &Signal| self.of_signal(joint, *signal);
        MEASURED.iter().filter_map(of).collect()
    }

    /// None where a repeat lacks it.
    fn of_signal(&self, joint: &str, signal: Signal) -> Option<Values> {
        let mut counts = vec![true; self.samples];
        let mut repeats = Vec::with_capacity(self.pieces.len());
        for piece in self.pieces {
            let columns = self.recordings[piece.place.recording].1.joint(joint).ok()?;
            let (mut values, whole) = piece.grid.sample(columns.measured(signal)?, 1.0);
            values.truncate(self.samples);
            repeats.push(values);
            for (counts, whole) in counts.iter_mut().zip(whole) {
                *counts &= whole;
            }
        }
        Some(Values {
            signal,
            repeats,
            counts,
        })
    }

    /// What judging a joint needs; its values would fill the memory if all joints' were kept.
    fn joint(&self, name: &str, input: Signal) -> Joint {
        let mut values = self.values(name);
        values.retain(|values| values.signal != input);
        let position = |of: Signal| values.iter().find(|values| values.signal == of);
        let position =
            position(Signal::LinkPositionRad).or_else(|| position(Signal::MotorPositionRad));
        let scattering = || values.iter().filter(|values| !values.is_the_same());
        Joint {
            name: name.to_owned(),
            stands: position.is_some_and(|position| position.way() < STILL_RAD),
            signals: scattering().map(|values| values.signal).collect(),
            means: scattering()
                .map(|values| Means::new(&values.repeats, &values.counts))
                .collect(),
        }
    }

    fn scatter(&self, joint: &Joint, alike: &[usize]) -> Vec<SignalScatter> {
        let scattering = joint.signals.iter();
        scattering
            .filter_map(|signal| Some(self.of_signal(&joint.name, *signal)?.scatter(alike)))
            .collect()
    }

    fn repeat(&self, one: usize, differs: bool, joints: Vec<JointDeviation>) -> Repeat {
        let piece = &self.pieces[one];
        Repeat {
            recording: self.recordings[piece.place.recording].0.clone(),
            from_s: piece.from_s,
            differs,
            joints,
            place: piece.place,
        }
    }
}

impl Joint {
    fn is_judged(&self) -> bool {
        !(self.stands || self.signals.is_empty())
    }

    fn told(
        &self,
        deviation: Deviation,
        differs: bool,
        samples: usize,
        rate_hz: f64,
    ) -> JointDeviation {
        let rows = statistics::rows(deviation.mean, samples);
        JointDeviation {
            joint: self.name.clone(),
            probability: deviation.probability,
            differs,
            signal: self.signals[deviation.signal],
            in_scatters: deviation.in_scatters,
            from_s: rows.start as f64 / rate_hz,
            to_s: rows.end as f64 / rate_hz,
        }
    }
}

impl Group {
    /// From at least [`REPEATS_MIN`] pieces.
    fn of(pieces: &[Piece], recordings: &[(String, Recording)]) -> Self {
        let first = &pieces[0];
        let samples = pieces.iter().map(|piece| piece.grid.samples()).min();
        let samples = samples.unwrap_or(0);
        let all = Pieces {
            recordings,
            pieces,
            samples,
        };
        let inputs = first.inputs.iter();
        let joints: Vec<Joint> = inputs
            .map(|input| all.joint(&input.joint, input.signal))
            .collect();
        let judged: Vec<&Joint> = joints.iter().filter(|joint| joint.is_judged()).collect();
        let (alike, deviations) = judge(&judged, pieces.len());
        let scatter = joints.iter().map(|joint| JointScatter {
            joint: joint.name.clone(),
            stands: joint.stands,
            signals: all.scatter(joint, &alike),
            order: order(joint, &alike, judged.len()),
        });
        let repeats = deviations.into_iter().enumerate().map(|(one, deviations)| {
            let joints = judged.iter().zip(deviations);
            let told = joints.filter_map(|(joint, deviation)| {
                let (deviation, differs) = deviation?;
                Some(joint.told(deviation, differs, samples, first.rate_hz))
            });
            all.repeat(one, !alike.contains(&one), told.collect())
        });
        Self {
            input: first.inputs.iter().map(|input| input.signal).collect(),
            sample_rate_hz: first.rate_hz,
            samples,
            seconds: samples as f64 / first.rate_hz,
            found_from_scatters: statistics::found_from(
                limit(judged.len(), pieces.len()),
                pieces.len() - 1,
            ),
            joints: scatter.collect(),
            repeats: repeats.collect(),
        }
    }

    /// Where the repeats lie that are alike.
    pub fn alike(&self) -> impl Iterator<Item = Place> {
        let alike = self.repeats.iter().filter(|repeat| !repeat.differs);
        alike.map(|repeat| repeat.place)
    }
}

/// Less probable than this is told: of all that is asked about a group, chance makes [`FALSE_ALARMS`] together.
fn limit(joints: usize, repeats: usize) -> f64 {
    FALSE_ALARMS / (joints * repeats).max(1) as f64
}

/// Of each joint, how it deviates and whether that is too much.
type OfJoints = Vec<Option<(Deviation, bool)>>;

/// The repeats that are alike, and how each repeat deviates from those that are.
fn judge(joints: &[&Joint], repeats: usize) -> (Vec<usize>, Vec<OfJoints>) {
    let mut alike: Vec<usize> = (0..repeats).collect();
    let mut told: Vec<OfJoints> = vec![Vec::new(); repeats];
    loop {
        let limit = limit(joints.len(), alike.len());
        for &one in &alike {
            let others: Vec<usize> = alike.iter().copied().filter(|k| *k != one).collect();
            let of_joint = |joint: &&Joint| {
                let deviation = statistics::deviation(&joint.means, one, &others)?;
                Some((deviation, deviation.probability < limit))
            };
            told[one] = joints.iter().map(of_joint).collect();
        }
        let least = |one: &usize| {
            let of_joints = told[*one].iter().flatten();
            of_joints.map(|(d, _)| d.probability).fold(1.0, f64::min)
        };
        let worst = alike
            .iter()
            .copied()
            .min_by(|a, b| least(a).total_cmp(&least(b)))
            .filter(|one| least(one) < limit);
        let Some(worst) = worst else {
            return (alike, told);
        };
        alike.retain(|one| *one != worst);
        if alike.len() < REPEATS_MIN {
            // two that are left cannot be judged against each other
            for one in &alike {
                for (_, differs) in told[*one].iter_mut().flatten() {
                    *differs = false;
                }
            }
            return (alike, told);
        }
    }
}

fn order(joint: &Joint, alike: &[usize], joints: usize) -> Option<Order> {
    if !joint.is_judged() || alike.len() < REPEATS_MIN {
        return None;
    }
    let found = statistics::neighbours(&joint.means, alike)?;
    Some(Order {
        next_to_any: found.next_to_any,
        probability: found.probability,
        drifts: found.probability < FALSE_ALARMS / joints as f64,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::statistics::uniform;
    use super::*;
    use crate::JointColumns;

    const ROWS: usize = 400;

    /// A joint that is told a torque and scatters where it goes, the farther the longer.
    fn log(seed: u64, told: impl Fn(f64) -> f64, rows: usize) -> Recording {
        let mut random = uniform(seed);
        let astray = (0..12).map(|_| random()).sum::<f64>() - 6.0;
        let time_s: Vec<f64> = (0..rows).map(|row| row as f64 / 250.0).collect();
        let position_rad = time_s
            .iter()
            .map(|t| t.sin() + 0.01 * astray * t * t + 1e-4 * random());
        let signals = [
            (
                Signal::CommandTorqueNm,
                time_s.iter().map(|t| told(*t)).collect(),
            ),
            (Signal::LinkPositionRad, position_rad.collect()),
        ];
        let joint = JointColumns {
            name: "elbow".to_owned(),
            signals: signals.into(),
        };
        Recording {
            time_s,
            segment: None,
            joints: vec![joint],
            sample_rate_hz: 250.0,
            metadata: std::collections::BTreeMap::new(),
            truncated: false,
        }
    }

    fn named(recordings: impl IntoIterator<Item = Recording>) -> Vec<(String, Recording)> {
        let named = recordings.into_iter().enumerate();
        named.map(|(k, log)| (format!("log{k}"), log)).collect()
    }

    fn signal(recording: &mut Recording, of: Signal) -> &mut Vec<f64> {
        recording.joints[0].signals.get_mut(&of).unwrap()
    }

    #[test]
    fn what_was_told_the_same_is_a_group_whatever_came_of_it() {
        let first = (0..4).map(|seed| log(seed, f64::cos, ROWS));
        let second =
            (4..7).map(|seed| log(seed, |t| (2.0 * t).cos(), ROWS - 8 * (seed as usize - 4)));
        let alone = [log(7, |t| 1.001 * t.cos(), ROWS)];
        let groups = repeats(&named(first.chain(second).chain(alone))).unwrap();
        let sizes: Vec<usize> = groups.iter().map(|group| group.repeats.len()).collect();
        assert_eq!(sizes, [4, 3]);
        assert_eq!(groups[0].input, [Signal::CommandTorqueNm].into());
        assert_eq!(groups[1].samples, ROWS - 16);
        let joint = &groups[0].joints[0];
        assert_eq!(joint.signals.len(), 1, "the command is the same in all");
        let scatter = &joint.signals[0];
        assert!(
            scatter.rms_at_end > 5.0 * scatter.rms_at_start,
            "{scatter:?}"
        );
        assert!(groups[0].repeats.iter().all(|repeat| !repeat.differs));
    }

    #[test]
    fn a_reference_counts_before_a_torque_and_a_measured_torque_to_the_last_bit() {
        let mut logs: Vec<Recording> = (0..3).map(|seed| log(seed, f64::cos, ROWS)).collect();
        for (log, off) in logs.iter_mut().zip([0.0, 1e-12, 0.3]) {
            let mut told = signal(log, Signal::CommandTorqueNm).clone();
            told[7] += off;
            log.joints[0].signals.remove(&Signal::CommandTorqueNm);
            log.joints[0].signals.insert(Signal::MotorTorqueNm, told);
        }
        assert_eq!(repeats(&named(logs.clone())), Err(NoRepeats { most: 1 }));
        for log in &mut logs {
            let reference = log.time_s.iter().map(|t| t.sin()).collect();
            log.joints[0]
                .signals
                .insert(Signal::ReferencePositionRad, reference);
        }
        let groups = repeats(&named(logs)).unwrap();
        assert_eq!(groups[0].input, [Signal::ReferencePositionRad].into());
    }

    #[test]
    fn a_repeat_with_another_start_is_found_and_its_scatter_does_not_count() {
        let mut logs: Vec<Recording> = (0..8).map(|seed| log(seed, f64::cos, ROWS)).collect();
        for x in signal(&mut logs[5], Signal::LinkPositionRad) {
            *x += 0.5;
        }
        let group = &repeats(&named(logs)).unwrap()[0];
        let differ: Vec<bool> = group.repeats.iter().map(|repeat| repeat.differs).collect();
        assert_eq!(differ, (0..8).map(|k| k == 5).collect::<Vec<_>>());
        assert_eq!(group.alike().count(), 7);
        assert!(group.joints[0].signals[0].rms < 0.05, "{:?}", group.joints);
    }

    #[test]
    fn trials_in_one_recording_are_repeats_and_a_standing_joint_is_not_judged() {
        let mut all = log(0, f64::cos, 3 * ROWS);
        all.segment = Some((0..3 * ROWS).map(|row| (row / ROWS) as i64).collect());
        for row in 0..3 * ROWS {
            all.time_s[row] = (row % ROWS) as f64 / 250.0;
            let t = all.time_s[row];
            signal(&mut all, Signal::CommandTorqueNm)[row] = t.cos();
            signal(&mut all, Signal::LinkPositionRad)[row] = 1e-5 * f64::from(row > 2 * ROWS);
        }
        let group = &repeats(&named([all])).unwrap()[0];
        assert_eq!(group.repeats.len(), 3);
        assert_eq!(group.repeats[2].place.first_row, 2 * ROWS);
        assert!(group.joints[0].stands && group.joints[0].order.is_none());
        assert!(
            group
                .repeats
                .iter()
                .all(|repeat| repeat.joints.is_empty() && !repeat.differs)
        );
    }

    #[test]
    fn what_cannot_be_judged_says_why() {
        let short = (0..3).map(|seed| log(seed, f64::cos, 20));
        assert_eq!(repeats(&named(short)), Err(NoRepeats { most: 0 }));
        let two = repeats(&named((0..2).map(|seed| log(seed, f64::cos, ROWS))));
        let why = two.unwrap_err().to_string();
        assert!(
            why.starts_with("no more than 2 pieces") && why.contains("3 are needed"),
            "{why}"
        );
        // a joint that was told nothing, and one of which nothing is known
        let idle = (0..3).map(|seed| log(seed, |_| 0.0, ROWS));
        assert_eq!(repeats(&named(idle)), Err(NoRepeats { most: 0 }));
        let mut unknown: Vec<Recording> = (0..3).map(|seed| log(seed, f64::cos, ROWS)).collect();
        for log in &mut unknown {
            signal(log, Signal::CommandTorqueNm).fill(f64::NAN);
        }
        assert_eq!(repeats(&named(unknown)), Err(NoRepeats { most: 0 }));
        assert_eq!(repeats(&[]), Err(NoRepeats { most: 0 }));
    }
}
