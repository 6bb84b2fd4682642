//! The diagnosis of a robot whose controller and encoders are known: each joint simulated in its loop beside its recordings, and the
//! evidence of what the simulation's response to every effect explains.

mod bus;
mod called;
mod counted;
mod findings;
pub mod named;
mod refine;
pub mod repeated;
pub mod respond;
mod rows;
pub mod search;
mod shared;
mod spectrum;
pub mod values;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use crate::twin::TwinError;
use recording::{Recording, as_measured};
use robot::Robot;

use crate::checks::data::{Checked, ONE_FREQUENCY};
use crate::checks::found::Found as Counted;
use crate::closed_loop::repeated::Repeated;
use crate::closed_loop::search::{Model, Search, Term};
use crate::diagnose::{
    DiagnoseError, Diagnosis, JointTraces, Prepared, Progress, blank_report, insufficient, prepared,
};
use crate::evidence::imitation;
use crate::evidence::rows::Rows;
use crate::evidence::shares::Interval;
use crate::evidence::told::{Found, MATERIALITY, Said};
use crate::evidence::{ERRORS, Evidence, Scored};
use crate::on_all_cores::OnAllCores;
use crate::report::{
    BeforeAfter, Candidate, DataFinding, Gap, JointReport, JointShare, SignalGap, Verdict,
};
use crate::twin::JointTwin;
use crate::twin::observe::Channel;
use crate::twin::stretch::stretches;
use bus::{CommonDelay, common_delay};
use called::Responses;
use refine::{Worth, refined};
pub use rows::About;
use rows::{Compared, OfArm, kinds_of};

/// Rounds in which the best set and the responses about it settle.
const ROUNDS: usize = 3;
/// Sets of different names that are fitted by simulation in each.
const FITTED: usize = 4;

/// One joint with its twin, ready to be explained.
struct Joint<'a> {
    index: usize,
    search: Search<'a>,
    compared: Compared,
    settled: Vec<Term>,
    poverty: Option<&'static str>,
}

/// What the arm shares.
struct Arm<'a> {
    /// Name of a cause, and its columns.
    shared: Option<(Option<&'static str>, usize)>,
    /// A delay of its bus.
    common: Option<&'a CommonDelay>,
}

/// What is told of a joint.
struct Told {
    report: JointReport,
    traces: JointTraces,
    /// Share of the cause that the arm shares.
    shared: Option<Interval>,
    /// Share of the delay that the arm has in common.
    delay_share: f64,
}

/// What explains a joint.
struct Explained {
    about: About,
    evidence: Evidence,
    sets: Vec<Scored>,
}

impl Explained {
    /// Nats by which a joint is better told than it is by another explanation, with the rows that both count as independent.
    fn ahead_of(&self, other: &Self) -> f64 {
        let [own, others] = [self, other].map(|of| {
            let names = of.sets[0].names;
            let left = of.evidence.mean_squares(names);
            let settled = of.evidence.settled();
            let all: Vec<(f64, f64)> = left
                .iter()
                .zip(settled)
                .map(|(left, settled)| (left + settled.floor, settled.independent_rows))
                .collect();
            (all, of.evidence.cost(names))
        });
        let by_signal = own.0.iter().zip(&others.0);
        let gained: f64 = by_signal
            .map(|((own, own_rows), (others, other_rows))| {
                0.5 * own_rows.min(*other_rows) * (others / own).ln()
            })
            .sum();
        gained + others.1 - own.1
    }
}

impl<'a> Joint<'a> {
    fn of(
        index: usize,
        twin: &'a JointTwin<'a>,
        counted: &[Counted],
        name: &str,
        repeated: &Repeated,
        poverty: Option<&'static str>,
    ) -> Result<Self, TwinError> {
        let mut search = Search::new(twin)?;
        search.repeats_nm = repeated.scatter_nm(name, &search)?;
        Ok(Self {
            index,
            compared: Compared::of(&search),
            poverty,
            settled: counted::settled(counted, &search.scale),
            search,
        })
    }

    fn start(&self) -> Model {
        Model::of_settled(&self.search, &self.settled)
    }

    fn weighed(&self, about: About, of_arm: Option<&OfArm>) -> Explained {
        let evidence = about.evidence(&self.compared, of_arm);
        let sets = evidence.best(|fit| about.is_possible(&self.search, fit));
        Explained {
            about,
            evidence,
            sets,
        }
    }

    /// The best set: responses choose some, simulation fits them, and the responses about the best of them choose again until the
    /// names stay.
    fn explained(&self, begin: About, of_arm: Option<&OfArm>) -> Result<Explained, TwinError> {
        let mut explained = self.weighed(begin, of_arm);
        for _ in 0..ROUNDS {
            let Some(best) = self.best_fitted(&explained)? else {
                break;
            };
            let is_settled = kinds_of(&best) == kinds_of(&explained.about.model)
                && !explained.about.model.terms.is_empty();
            if is_settled {
                break;
            }
            let mut about = About::of(&self.search, &self.compared, &best)?;
            if let Some(of_arm) = of_arm {
                of_arm.add_to(&mut about);
            }
            explained = self.weighed(about, of_arm);
        }
        self.take_back_imitations(&mut explained)?;
        Ok(explained)
    }

    /// Takes back names whose part of the gap a smooth law on no list explains better.
    fn take_back_imitations(&self, explained: &mut Explained) -> Result<(), TwinError> {
        let Explained {
            about,
            evidence,
            sets,
        } = explained;
        let rows = self.rows()?;
        let best = sets[0].names;
        imitation::take_back(
            sets,
            evidence,
            &rows,
            |column| self.compared.of_motor(column),
            0,
            |fit| about.is_possible(&self.search, fit),
        );
        let names = sets[0].names;
        if names != best {
            about.model = about.told(&self.search, &evidence.fit(names));
        }
        Ok(())
    }

    /// Of the first few sets of different names the one that leaves least where it is simulated; none if that has no names.
    fn best_fitted(&self, explained: &Explained) -> Result<Option<Model>, TwinError> {
        let Explained {
            about,
            evidence,
            sets,
        } = explained;
        let mut tried: Vec<(Vec<String>, Scored)> = Vec::new();
        for set in sets {
            let kinds = about.kinds(set.names);
            if tried.len() < FITTED && !tried.iter().any(|(other, _)| *other == kinds) {
                tried.push((kinds, *set));
            }
        }
        if tried.iter().all(|(kinds, _)| kinds.is_empty()) {
            return Ok(None);
        }
        let worth = Worth::of(&self.compared, evidence.settled());
        let fitted = tried
            .iter()
            .on_all_cores(|(_, set)| {
                let start = about.told(&self.search, &evidence.fit(set.names));
                let refined = refined(&self.search, &self.compared, &worth, &about.known, &start)?;
                Ok((refined.nats + evidence.cost(set.names), refined.model))
            })
            .collect::<Result<Vec<(f64, Model)>, TwinError>>()?;
        let best = fitted.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        Ok(best
            .map(|(_, model)| model)
            .filter(|model| !model.terms.is_empty()))
    }

    /// Rows of the motor's signal, as they count.
    fn rows(&self) -> Result<Rows, TwinError> {
        let gap_nm = self
            .compared
            .pick(&self.search.residual_nm(&Model::default())?);
        let measured_nm = self.compared.pick(&self.search.measured_nm);
        let of_motor = self.compared.motor_rows();
        let row = |of: fn(&crate::twin::Row) -> f64| {
            let rows = of_motor.iter().map(|k| of(&self.search.twin.rows[*k]));
            rows.collect::<Vec<f64>>()
        };
        let count = of_motor.len();
        let both = measured_nm.iter().zip(&gap_nm).take(count);
        Ok(Rows {
            time_s: row(|row| row.time_s),
            position_rad: row(|row| row.position_rad),
            velocity_rad_s: row(|row| row.velocity_rad_s),
            load_nm: row(|row| row.load_nm),
            since_reversal_s: self.since_reversal_s(),
            nominal_nm: both.map(|(measured, gap)| measured - gap).collect(),
            measured_nm: measured_nm[..count].to_vec(),
        })
    }

    /// What the other joints do, rows of the motor's signal.
    fn others_moving(&self) -> Vec<Vec<f64>> {
        let of_motor = self.compared.motor_rows();
        let others = self.search.twin.others().into_iter();
        others
            .map(|of| of_motor.iter().map(|k| of[*k]).collect())
            .collect()
    }

    fn since_reversal_s(&self) -> Vec<f64> {
        let rows = &self.search.twin.rows;
        let of_motor = self.compared.motor_rows();
        let mut since_s = Vec::with_capacity(of_motor.len());
        let mut turned_s = f64::NEG_INFINITY;
        for (place, k) in of_motor.iter().enumerate() {
            let row = &rows[*k];
            let before = place.checked_sub(1).map(|p| &rows[of_motor[p]]);
            let turns = before.is_none_or(|before| {
                before.stretch != row.stretch || before.velocity_rad_s * row.velocity_rad_s <= 0.0
            });
            if turns {
                turned_s = row.time_s;
            }
            since_s.push(row.time_s - turned_s);
        }
        since_s
    }

    fn signals(&self, gap_nm: &[f64]) -> Vec<SignalGap> {
        let channels = self.search.twin.channels.iter().zip(&self.compared.spans);
        let mut all: Vec<SignalGap> = channels
            .map(|(channel, span)| {
                let own = &gap_nm[span.rows.clone()];
                let square = own.iter().map(|x| x * x).sum::<f64>() / own.len().max(1) as f64;
                SignalGap {
                    signal: channel.signal().to_owned(),
                    gap_to_noise: square.sqrt() / span.floor_nm.max(f64::MIN_POSITIVE),
                }
            })
            .collect();
        all.sort_by(|a, b| b.gap_to_noise.total_cmp(&a.gap_to_noise));
        all
    }

    fn said(
        &self,
        name: &str,
        explained: &Explained,
        counted: &[Counted],
        arm: &Arm<'_>,
        materiality: f64,
    ) -> Result<Told, TwinError> {
        let rows = self.rows()?;
        let gap_nm = self
            .compared
            .pick(&self.search.residual_nm(&Model::default())?);
        let best = explained.sets[0];
        let left = explained.evidence.mean_squares(best.names);
        let settled = explained.evidence.settled();
        let mut above = left.iter().zip(settled);
        let is_at_floor = above.all(|(left, settled)| *left <= ERRORS.powi(2) * settled.floor);
        let called = Responses {
            search: &self.search,
            about: &explained.about,
        };
        let found = Found {
            joint: name,
            rows: &rows,
            called: &called,
            gear_ratio: self.search.scale.gear_ratio,
            friction: &self.search.twin.nominal.friction,
            noise_square: explained.evidence.floor_square(best.names),
            evidence: &explained.evidence,
            sets: &explained.sets,
            leaves: None,
            is_at_floor: Some(is_at_floor),
            shared: arm.shared.as_slice(),
            of_links: None,
            signals: self.signals(&gap_nm),
            is_one_frequency: self.poverty == Some(ONE_FREQUENCY),
            materiality,
        };
        let Said {
            mut report, shared, ..
        } = found.said(&self.others_moving());
        report.gap = self.gap(&report, &gap_nm, left[0]);
        let settled_shares = self.settled_shares(explained, &gap_nm)?;
        let rest = 1.0 - settled_shares.iter().sum::<f64>();
        let shared = shared.first().map(|share| Interval {
            value: rest * share.value,
            low: rest * share.low,
            high: rest * share.high,
        });
        let is_common = |found: &Counted| {
            let common = arm.common;
            common.is_some_and(|common| common.is_seen_as(found, self.index))
        };
        counted::add(&mut report, counted, &settled_shares, is_common);
        let settled = counted.iter().filter(|found| counted::is_settled(found));
        let in_common = settled.zip(&settled_shares);
        let in_common = in_common.filter(|(found, _)| is_common(found));
        let delay_share = in_common.map(|(_, share)| share).sum();
        let model = &explained.about.model;
        report.gap.position_rms_rad =
            crate::closed_loop::values::position_rms_rad(&self.search, &Model::default(), model)?;
        Ok(Told {
            report,
            traces: self.traces(name, model)?,
            shared,
            delay_share,
        })
    }

    /// Parts of the gap that delay and lag take, each, beside what the file's values are in the end: what each takes off, over both
    /// orders of the two (Shapley).
    fn settled_shares(&self, explained: &Explained, gap_nm: &[f64]) -> Result<Vec<f64>, TwinError> {
        if self.settled.is_empty() {
            return Ok(Vec::new());
        }
        let Explained {
            about,
            evidence,
            sets,
        } = explained;
        let beside = evidence.values_beside(sets[0].names);
        let square = |gap_nm: &[f64]| {
            let mut without_nm = gap_nm.to_vec();
            for (column, value) in about.known.iter().zip(&beside) {
                let rows = without_nm.iter_mut().zip(column);
                rows.for_each(|(row, x)| *row -= value * x);
            }
            evidence.square(&without_nm)
        };
        let with: f64 = evidence.left_at(0, &beside).iter().sum();
        let without = square(gap_nm);
        let taken = (1.0 - with / without.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let [one, other] = self.settled.as_slice() else {
            return Ok(vec![taken]);
        };
        let alone = |term: &Term| -> Result<f64, TwinError> {
            let model = Model::of_settled(&self.search, std::slice::from_ref(term));
            let left_nm = self.compared.pick(&self.search.residual_nm(&model)?);
            Ok(square(&left_nm))
        };
        let [one, other] = [alone(one)?, alone(other)?];
        let both = (without - with).max(f64::MIN_POSITIVE);
        let first = (0.5 * (1.0 + (other - one) / both)).clamp(0.0, 1.0);
        Ok(vec![taken * first, taken * (1.0 - first)])
    }

    /// Mean square of the motor's gap, and what nobody can tell of it.
    fn motor_squares(&self, gap_nm: &[f64]) -> [f64; 2] {
        let span = &self.compared.spans[0];
        let own = &gap_nm[span.rows.clone()];
        let square = own.iter().map(|x| x * x).sum::<f64>() / own.len().max(1) as f64;
        [square, span.floor_nm.powi(2)]
    }

    /// How far the motor's gap shrinks to this mean square, above what nobody can tell.
    fn shrink(&self, gap_nm: &[f64], after: f64) -> f64 {
        let [before, noise] = self.motor_squares(gap_nm);
        let above = |square: f64| (square - noise).max(0.0);
        if above(before) > 0.0 {
            1.0 - above(after) / above(before)
        } else {
            0.0
        }
    }

    /// Of the motor's torque.
    fn gap(&self, report: &JointReport, gap_nm: &[f64], after: f64) -> Gap {
        let [before, noise] = self.motor_squares(gap_nm);
        let shrink = if report.verdict == Verdict::NoGap {
            0.0
        } else {
            self.shrink(gap_nm, after)
        };
        let told = &report.gap;
        Gap {
            torque_rms_nm: BeforeAfter {
                before: before.sqrt(),
                after: after.sqrt(),
                noise_floor: noise.sqrt(),
                held_out: true,
            },
            position_rms_rad: told.position_rms_rad,
            shrink,
            // as far from it as the interval of what all signals are told
            shrink_low: (shrink - (told.shrink - told.shrink_low)).min(shrink),
            shrink_high: (shrink + (told.shrink_high - told.shrink))
                .clamp(shrink, f64::max(1.0, shrink)),
        }
    }

    fn traces(&self, name: &str, model: &Model) -> Result<JointTraces, TwinError> {
        let before_nm = self.search.residual_nm(&Model::default())?;
        let after_nm = self.search.residual_nm(model)?;
        let rows = &self.search.twin.rows;
        let shown: Vec<usize> = (0..rows.len())
            .filter(|k| rows[*k].channel == Channel::Motor && rows[*k].stretch == 0)
            .collect();
        let pick = |of: &dyn Fn(usize) -> f64| shown.iter().map(|k| of(*k)).collect::<Vec<f64>>();
        let measured = &self.search.measured_nm;
        Ok(JointTraces {
            joint: name.to_owned(),
            time_s: pick(&|k| rows[k].time_s),
            measured_nm: pick(&|k| measured[k]),
            nominal_nm: pick(&|k| measured[k] - before_nm[k]),
            augmented_nm: pick(&|k| measured[k] - after_nm[k]),
            position_rad: pick(&|k| rows[k].position_rad),
            velocity_rad_s: pick(&|k| rows[k].velocity_rad_s),
        })
    }
}

/// What one joint shows by itself.
#[derive(Clone, Debug)]
pub struct OfOne {
    /// With the names that are told.
    pub model: Model,
    /// What may be the largest part of its gap, most probable first.
    pub candidates: Vec<Candidate>,
}

/// One joint explained by itself, without what its samples show.
///
/// # Errors
/// [`TwinError`].
pub fn one(twin: &JointTwin<'_>, name: &str) -> Result<OfOne, TwinError> {
    let joint = Joint::of(0, twin, &[], name, &Repeated::among(&[]), None)?;
    let begin = About::of(&joint.search, &joint.compared, &joint.start())?;
    let explained = joint.explained(begin, None)?;
    let arm = Arm {
        shared: None,
        common: None,
    };
    let told = joint.said(name, &explained, &[], &arm, MATERIALITY)?;
    let fit = explained.evidence.fit(explained.sets[0].names);
    Ok(OfOne {
        model: explained.about.told(&joint.search, &fit),
        candidates: told.report.candidates,
    })
}

/// Responses about the joint as its file has it.
///
/// # Errors
/// [`TwinError`].
pub(crate) fn about_the_file(search: &Search<'_>) -> Result<About, TwinError> {
    About::of(
        search,
        &Compared::of(search),
        &Model::of_settled(search, &[]),
    )
}

/// Diagnoses a robot in its controller's loop. Effects below `materiality` are minor ones.
///
/// # Errors
/// [`DiagnoseError`].
pub fn diagnose(
    robot: &Robot,
    recordings: &[(String, Recording)],
    materiality: f64,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Diagnosis, DiagnoseError> {
    let begin = Instant::now();
    let tables: Vec<&Recording> = recordings.iter().map(|(_, recording)| recording).collect();
    if tables.is_empty() {
        return Err(DiagnoseError::Nothing);
    }
    let checked = Checked::of(robot, &tables);
    let whole: Vec<Cow<Recording>> = tables.iter().map(|table| as_measured(table)).collect();
    let tables: Vec<&Recording> = whole.iter().map(AsRef::as_ref).collect();
    let against: Vec<Option<String>> = robot
        .joints
        .iter()
        .map(|joint| checked.against(&joint.name))
        .collect();
    let mut report = blank_report(robot, recordings)?;
    let mut traces = Vec::new();
    if against.iter().all(Option::is_some) {
        let blank = robot.joints.iter().zip(against);
        report.joints = blank
            .map(|(joint, why)| insufficient(&joint.name, why.unwrap_or_default()))
            .collect();
    } else {
        let prepared = prepared(robot, &tables, |index| against[index].is_none());
        report.data.extend(prepared.findings.iter().cloned());
        let tables = prepared.tables(&tables);
        let Prepared { robot, counted, .. } = &prepared;
        let stretches = stretches(&tables, robot)?;
        let twins = robot
            .joints
            .iter()
            .enumerate()
            .on_all_cores(|(index, _)| {
                if against[index].is_some() {
                    return Ok(None);
                }
                JointTwin::new(robot, index, &stretches)
            })
            .collect::<Result<Vec<_>, TwinError>>()?;
        let repeated = Repeated::among(recordings);
        report.data.extend(repeated.that_differ());
        let done = AtomicUsize::new(0);
        let joints = twins
            .iter()
            .enumerate()
            .on_all_cores(|(index, twin)| {
                let Some(twin) = twin else { return Ok(None) };
                let name = &robot.joints[index].name;
                let joint = Joint::of(
                    index,
                    twin,
                    &counted[index],
                    name,
                    &repeated,
                    checked.poverty(name),
                )?;
                let begin = About::of(&joint.search, &joint.compared, &joint.start())?;
                let alone = joint.explained(begin.clone(), None)?;
                progress(Progress {
                    done: done.fetch_add(1, Ordering::Relaxed) + 1,
                    of: robot.joints.len(),
                });
                Ok(Some((joint, begin, alone)))
            })
            .collect::<Result<Vec<_>, TwinError>>()?;
        let (mut all, mut begins, mut explained) = (Vec::new(), Vec::new(), Vec::new());
        for joint in joints {
            let (joint, begin, alone) = match joint {
                Some((joint, begin, alone)) => (Some(joint), Some(begin), Some(alone)),
                None => (None, None, None),
            };
            all.push(joint);
            begins.push(begin);
            explained.push(alone);
        }
        let found = shared::found(robot, &all, &begins, &explained)?;
        let cause = found.map(|(shared, nats, with)| {
            explained = with;
            (shared, nats)
        });
        let common = common_delay(counted);
        let arm = Arm {
            shared: cause
                .as_ref()
                .map(|(shared, _)| (shared.cause.name(), shared.cause.amplitudes())),
            common: common.as_ref(),
        };
        let told = all
            .iter()
            .zip(&explained)
            .enumerate()
            .on_all_cores(|(index, both)| {
                let (Some(joint), Some(explained)) = both else {
                    return Ok(None);
                };
                let name = &robot.joints[index].name;
                let told = joint.said(name, explained, &counted[index], &arm, materiality)?;
                let mut findings: Vec<DataFinding> =
                    repeated.floor(name, &joint.search).into_iter().collect();
                findings.extend(findings::vibration(name, &joint.search));
                if joint.poverty.is_none() {
                    // at one speed a delay and a zero are the same, and neither would be known to be off
                    let names = explained.sets[0].names;
                    let known = explained.evidence.known_beside(names);
                    findings.extend(findings::readings(name, &joint.search, &known));
                }
                Ok(Some((told, findings)))
            })
            .collect::<Result<Vec<_>, TwinError>>()?;
        let (mut of_cause, mut of_delay) = (BTreeMap::new(), BTreeMap::new());
        for (index, told) in told.into_iter().enumerate() {
            let name = &robot.joints[index].name;
            let Some((told, findings)) = told else {
                let why = against[index].clone();
                let why = why.unwrap_or_else(|| "nothing tells the joint's torque".to_owned());
                report.joints.push(insufficient(name, why));
                continue;
            };
            if let Some(share) = told.shared {
                let share = JointShare {
                    share: share.value,
                    share_low: share.low,
                    share_high: share.high,
                };
                of_cause.insert(name.clone(), share);
            }
            if common
                .as_ref()
                .is_some_and(|common| common.joints.contains(&index))
            {
                let share = JointShare {
                    share: told.delay_share,
                    share_low: told.delay_share,
                    share_high: told.delay_share,
                };
                of_delay.insert(name.clone(), share);
            }
            report.joints.push(told.report);
            report.data.extend(findings);
            traces.push(told.traces);
        }
        let of_cause = cause.and_then(|(shared, nats)| {
            let probability = 1.0 / (1.0 + (-nats).exp());
            shared.told(probability, of_cause)
        });
        let of_delay = common.map(|common| shared::told_delay(&common, robot, of_delay));
        report.shared_effects = of_cause.into_iter().chain(of_delay).collect();
    }
    report.data.splice(..0, checked.report());
    report.data.sort_by_key(DataFinding::rank);
    report.compute_seconds = begin.elapsed().as_secs_f64();
    Ok(Diagnosis { report, traces })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;
    use crate::made_up::{MadeUp, robot};

    fn told(made_up: &MadeUp) -> JointReport {
        let recordings = [("made up".to_owned(), made_up.recorded())];
        let diagnosis = diagnose(&robot(), &recordings, 0.02, &|_| ()).unwrap();
        diagnosis.report.joints.into_iter().next().unwrap()
    }

    fn names(joint: &JointReport) -> Vec<&str> {
        let effects = joint.effects.iter();
        effects.map(|found| found.effect.as_str()).collect()
    }

    #[test]
    fn a_joint_as_its_file_has_it_has_no_gap() {
        let joint = told(&MadeUp::KNOWN);
        assert_eq!(joint.verdict, Verdict::NoGap, "{:?}", names(&joint));
    }

    #[test]
    fn a_gap_in_the_gear_is_found_at_its_size() {
        let gap_rad = 0.003;
        let joint = told(&MadeUp {
            gap_rad,
            ..MadeUp::KNOWN
        });
        assert_eq!(names(&joint)[0], "backlash");
        let found_rad = joint.effects[0].parameters["gap_rad"].value;
        assert!((found_rad / gap_rad - 1.0).abs() < 0.1, "{found_rad}");
        assert!(joint.gap.shrink > 0.8, "{}", joint.gap.shrink);
    }

    #[test]
    fn a_ripple_is_told_with_its_cycles_and_takes_the_gap() {
        let joint = told(&MadeUp {
            ripple_nm: 1.0,
            ..MadeUp::KNOWN
        });
        let ripple = &joint.effects[0];
        assert_eq!(ripple.effect, "torque_ripple");
        let cycles = ripple.parameters["cycles_per_motor_rev"].value;
        assert!((cycles - 6.0).abs() < 0.05, "{cycles}");
        assert!(ripple.share > 0.9, "{}", ripple.share);
    }
}
