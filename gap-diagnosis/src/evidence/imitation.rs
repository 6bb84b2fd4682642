//! Smooth laws on no list that may stand for names: a set of names that only imitates one is taken back.
//!
//! Each law has a cost as a name has. Where the best set's names, or some of them, predict worse than the law beside the others, the
//! others are what is told.

use std::f64::consts::TAU;

use gap_report::Remains;
use joint_twin::signal::waves::{PERIODS_MIN, Waves};

use super::remaining::{bent, braking, hats, since_reversal};
use super::rows::Rows;

use super::{AMPLITUDE_NATS, Evidence, Fit, INEXACT, NAME_NATS, Names, Scored, Smooth};

/// Parts of the recording between which something may have changed at once: half of what is left out in turn.
const INSTANTS: usize = 20;

/// A law on no list that explains something that the names leave.
#[derive(Clone, Copy, Debug)]
pub struct Ahead {
    /// What it is a law over.
    pub over: Remains,
    /// Sum of squares that the names leave with it, in the units of [`Scored::left`].
    pub left: f64,
}

/// Takes back those names of the best set whose part of the gap a smooth law explains better; sets with such a name are no more. Tells the
/// law that explains most of what the best set leaves, if there is one. `counted`: a column of the rows as it counts in the evidence. `expected`: friction that
/// the joint has, as every joint, and that nobody measured.
pub fn take_back(
    sets: &mut Vec<Scored>,
    evidence: &Evidence,
    rows: &Rows,
    counted: impl Fn(&[f64]) -> Vec<f64>,
    expected: Names,
    is_possible: impl Fn(&Fit) -> bool,
) -> Option<Ahead> {
    let best = sets[0].names;
    // what every joint may have is not taken back
    let usual = best & evidence.usual();
    let fit = evidence.fit(usual);
    let both = evidence.gap_nm().iter().zip(&fit.predicted_nm);
    let rest_nm: Vec<f64> = both
        .map(|(gap, predicted)| gap - predicted)
        .take(rows.count())
        .collect();
    let mut laws = laws(rows, &rest_nm);
    for column in laws.iter_mut().flat_map(|law| &mut law.columns) {
        *column = counted(column);
    }
    let beside = evidence.with_smooth(best, &laws);
    let (law, told) = without_imitations(&beside, best, usual)?;
    let taken = best & !told;
    if taken != 0 {
        let left = if expected == 0 {
            evidence.scored(told)
        } else {
            chosen_anew(evidence, told | expected, is_possible)
        };
        sets.retain(|set| set.names & taken == 0 && set.names != left.names);
        sets.insert(0, left);
    }
    let square = |names: Names| beside.scored(names).left.iter().sum::<f64>();
    let ahead = |(law, smooth): (Names, &Smooth)| Ahead {
        over: smooth.over,
        left: square(told | law),
    };
    let all = || beside.smooth().zip(&laws);
    if taken != 0 {
        return all().find(|(own, _)| *own == law).map(ahead);
    }
    let (known, left) = (beside.scored(best).score, square(best));
    let explained = square(0) - left;
    let untold = beside.floor_square(best);
    let others = all().filter(|(law, smooth)| {
        let with = best | law;
        let least = untold.max(smooth.inexact.powi(2) * explained);
        let is_more = left - square(with) > least;
        is_more && beside.scored(with).score > known
    });
    let others = others.map(ahead);
    others.min_by(|a, b| a.left.total_cmp(&b.left))
}

/// The best set of these names: beside names that are gone there may have been no need of friction that is there.
fn chosen_anew(evidence: &Evidence, names: Names, is_possible: impl Fn(&Fit) -> bool) -> Scored {
    let mut best = evidence.scored(0);
    let mut subset = names;
    while subset != 0 {
        let scored = evidence.scored(subset);
        if scored.score > best.score && is_possible(&evidence.fit(subset)) {
            best = scored;
        }
        subset = (subset - 1) & names;
    }
    best
}

/// The law that explains most with names of the best set, and these names; none where no law is ahead of the names.
fn without_imitations(evidence: &Evidence, best: Names, usual: Names) -> Option<(Names, Names)> {
    let others = best & !usual;
    let known = evidence.scored(best).score;
    let mut ahead: Option<(f64, Names, Names)> = None;
    for law in evidence.smooth() {
        let mut subset = others;
        loop {
            let score = evidence.scored(subset | usual | law).score;
            if score > known && ahead.is_none_or(|(most, _, _)| score > most) {
                ahead = Some((score, law, subset | usual));
            }
            if subset == 0 {
                break;
            }
            subset = (subset - 1) & others;
        }
    }
    ahead.map(|(_, law, names)| (law, names))
}

/// Laws over time, position, speed and the time since a reversal that no name on the list is. The other joints' motion is not among them:
/// where joints move together it stands for any law of this one.
fn laws(rows: &Rows, rest_nm: &[f64]) -> Vec<Smooth> {
    let braking = |columns| braking(columns, &rows.velocity_rad_s);
    let over_position = hats(&rows.position_rad);
    let speed_rad_s: Vec<f64> = rows.velocity_rad_s.iter().map(|v| v.abs()).collect();
    // all columns together are Coulomb friction, a constant is an offset
    let but_first = |columns: Vec<Vec<f64>>| columns.into_iter().skip(1).collect::<Vec<_>>();
    let law = |over: Remains, columns: Vec<Vec<f64>>, among: f64, inexact: f64| Smooth {
        over,
        inexact,
        cost: NAME_NATS + among + AMPLITUDE_NATS * columns.len().saturating_sub(1) as f64,
        columns,
    };
    let smooth = [
        (Remains::SinceReversal, since_reversal(rows)),
        (Remains::Time, bent(&rows.time_s)),
        (Remains::Position, over_position.clone()),
    ];
    // no friction is a named curve exactly, nor the same at all angles
    let frictions = [
        (Remains::Position, braking(over_position)),
        (Remains::Velocity, braking(hats(&speed_rad_s))),
    ];
    let jumps = jumps(&rows.time_s);
    let among = (2.0 * jumps.len() as f64).ln();
    let jumps = braking(jumps.clone()).into_iter().chain(jumps);
    let vibration = vibration(&rows.time_s, rest_nm).into_iter();
    let smooth = smooth.map(|(over, columns)| law(over, but_first(columns), 0.0, 0.0));
    let frictions = frictions.map(|(over, columns)| law(over, but_first(columns), 0.0, INEXACT));
    smooth
        .into_iter()
        .chain(frictions)
        .chain(jumps.map(|jump| law(Remains::Time, vec![jump], among, 0.0)))
        .chain(vibration.map(|(waves, among)| law(Remains::Time, waves, among, 0.0)))
        .filter(|law| !law.columns.is_empty())
        .collect()
}

/// Ones from some instant on, for instants all over the time.
fn jumps(time_s: &[f64]) -> Vec<Vec<f64>> {
    let Some((first_s, last_s)) = time_s.first().zip(time_s.last()) else {
        return Vec::new();
    };
    (1..INSTANTS)
        .map(|k| {
            let at_s = first_s + (last_s - first_s) * k as f64 / INSTANTS as f64;
            let after = time_s.iter().map(|t| f64::from(u8::from(*t >= at_s)));
            after.collect()
        })
        .collect()
}

/// The wave over time that shows most in a rest, with the logarithm of how many there are.
fn vibration(time_s: &[f64], rest_nm: &[f64]) -> Option<(Vec<Vec<f64>>, f64)> {
    let whole_s = time_s.last()? - time_s.first()?;
    // half a line apart, so that none is missed, up to half the rate of rows, where a wave's sine is gone
    let first = (2.0 * PERIODS_MIN) as usize;
    let last = time_s.len() - 1;
    let angles_rad = || time_s.iter().map(|t| TAU * 0.5 / whole_s * t);
    let mut waves = Waves::from(angles_rad(), first as f64, 1.0);
    let mut most: Option<(f64, usize)> = None;
    for line in first..last {
        let both = waves.now().iter().zip(rest_nm);
        let [sin, cos] = both.fold([0.0, 0.0], |[s, c], ([sin, cos], rest)| {
            [s + sin * rest, c + cos * rest]
        });
        let power = sin * sin + cos * cos;
        if most.is_none_or(|(before, _)| power > before) {
            most = Some((power, line));
        }
        waves.turn();
    }
    let (_, line) = most?;
    let waves = Waves::from(angles_rad(), line as f64, 0.0);
    let part = |place: usize| waves.now().iter().map(|wave| wave[place]).collect();
    Some((vec![part(0), part(1)], (last as f64).ln()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evidence::{Item, Presupposed, Problem, Span};

    const ROWS: usize = 1000;

    fn noise(seed: u64) -> Vec<f64> {
        let mut random = joint_twin::signal::random::uniform(seed);
        (0..ROWS).map(|_| random() - 0.5).collect()
    }

    /// A joint that swings, with friction that is less or more by these, row by row.
    fn told(friction_nm: impl Fn(f64, f64) -> f64) -> (Option<Remains>, Names) {
        let time_s: Vec<f64> = (0..ROWS).map(|k| 0.02 * k as f64).collect();
        let position_rad: Vec<f64> = time_s
            .iter()
            .map(|t| (1.3 * t).sin() + 0.4 * (2.9 * t).sin())
            .collect();
        let velocity_rad_s: Vec<f64> = time_s
            .iter()
            .map(|t| 1.3 * (1.3 * t).cos() + 1.16 * (2.9 * t).cos())
            .collect();
        let gap_nm: Vec<f64> = (0..ROWS)
            .map(|k| {
                friction_nm(time_s[k], position_rad[k]) * velocity_rad_s[k].signum()
                    + 0.1 * noise(5)[k]
            })
            .collect();
        let rows = Rows {
            time_s,
            since_reversal_s: vec![0.0; ROWS],
            measured_nm: gap_nm.clone(),
            nominal_nm: vec![0.0; ROWS],
            load_nm: vec![0.0; ROWS],
            position_rad,
            velocity_rad_s,
        };
        // friction that grows with time, and with the angle
        let drift: Vec<f64> = (0..ROWS)
            .map(|k| rows.time_s[k] * rows.velocity_rad_s[k].signum())
            .collect();
        let slope: Vec<f64> = (0..ROWS)
            .map(|k| rows.position_rad[k] * rows.velocity_rad_s[k].signum())
            .collect();
        let columns = [vec![drift], vec![slope]];
        let items = [0, 1].map(|kind| Item {
            kind,
            cost: NAME_NATS,
            presupposed: Presupposed::NOTHING,
            deviation: None,
            is_usual: false,
            columns: &columns[kind],
        });
        let evidence = Evidence::of(&Problem {
            gap_nm: &gap_nm,
            spans: &[Span {
                rows: 0..ROWS,
                floor_nm: 0.01,
            }],
            items: &items,
            tolerated: &[],
            is_open: false,
            inexact: 0.0,
            shared: None,
        });
        let mut sets = evidence.best(|_| true);
        let law = take_back(&mut sets, &evidence, &rows, <[f64]>::to_vec, 0, |_| true);
        (law.map(|law| law.over), sets[0].names)
    }

    #[test]
    fn a_law_that_is_named_is_not_taken_back() {
        assert_eq!(told(|t, _| 0.1 * t).1, 1);
        assert_eq!(told(|_, q| q).1, 2);
    }

    #[test]
    fn friction_that_jumps_is_no_drift() {
        let jumps = |t: f64, _: f64| if t < 11.0 { 0.0 } else { 1.0 };
        assert_eq!(told(jumps), (Some(Remains::Time), 0));
    }

    #[test]
    fn friction_near_one_angle_does_not_grow_with_it() {
        assert_eq!(told(|_, q| (-((q - 0.5) / 0.2).powi(2)).exp()).1, 0);
    }
}
