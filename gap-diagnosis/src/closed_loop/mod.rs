//! The diagnosis of a robot whose controller and encoders are known: each joint simulated in its loop beside its recordings, and the
//! evidence of what the simulation's response to every effect explains.

mod bus;
mod called;
mod counted;
mod findings;
mod joint;
pub mod named;
mod refine;
pub mod repeated;
pub mod respond;
mod rows;
mod said;
pub mod search;
mod shared;
mod spectrum;
mod turns;
pub mod values;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use gap_report::{Candidate, DataFinding, JointShare};
use joint_twin::JointTwin;
use joint_twin::TwinError;
use joint_twin::on_all_cores::OnAllCores;
use joint_twin::stretch::stretches;
use recording::{Recording, as_measured};
use recording_checks::data::Checked;
use robot::Robot;

use crate::closed_loop::repeated::Repeated;
use crate::closed_loop::search::{Model, Search};
use crate::diagnose::{
    DiagnoseError, Diagnosis, Prepared, Progress, blank_report, insufficient, prepared,
};
use crate::evidence::told::MATERIALITY;
use bus::common_delay;
use joint::Joint;
pub use rows::About;
use rows::Compared;
use said::Arm;

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
    use gap_report::{JointReport, Remains, Verdict};
    use joint_twin::signal::random::uniform;
    use made_up::{MadeUp, robot};
    use recording::Signal;

    use super::*;

    fn told(made_up: &MadeUp) -> JointReport {
        told_of(made_up.recorded(uniform(3)))
    }

    fn told_of(recording: Recording) -> JointReport {
        let recordings = [("made up".to_owned(), recording)];
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
    fn a_law_on_no_list_is_a_gap_without_a_name() {
        let joint = told(&MadeUp {
            bump_nm: 0.3,
            ..MadeUp::KNOWN
        });
        assert_eq!(joint.verdict, Verdict::Unexplained, "{:?}", names(&joint));
        assert_eq!(joint.candidates[0].effect, "unknown");
        assert_eq!(joint.remaining_over[0].over, Remains::Position);
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
    fn damping_of_a_gear_is_no_hysteresis() {
        let mut robot = robot();
        robot.joints[0].link_encoder_resolution_rad = Some(1e-5);
        for root_damping_nm in [20.0, 40.0] {
            let recording = MadeUp {
                root_damping_nm,
                has_link_encoder: true,
                ..MadeUp::KNOWN
            }
            .recorded(uniform(3));
            let recordings = [("made up".to_owned(), recording)];
            let report = diagnose(&robot, &recordings, 0.02, &|_| ()).unwrap().report;
            let joint = &report.joints[0];
            assert_eq!(names(joint), ["structural_damping"]);
            let exponent = joint.effects[0].parameters["exponent"].value;
            assert!((exponent - 0.5).abs() < 0.05, "{exponent}");
        }
    }

    #[test]
    fn a_ripple_faster_than_what_is_compared_is_told() {
        let ripple_nm = 0.3;
        let joint = told(&MadeUp {
            ripple_nm,
            ripple_cycles: 12.0,
            ..MadeUp::KNOWN
        });
        assert_eq!(names(&joint), ["torque_ripple"]);
        let found = &joint.effects[0].parameters;
        assert_eq!(found["cycles_per_motor_rev"].value, 12.0);
        // motor side, of a gear of a hundred
        let amplitude_nm = 100.0 * found["amplitude_nm"].value;
        assert!(
            (amplitude_nm / ripple_nm - 1.0).abs() < 0.1,
            "{amplitude_nm}"
        );
        assert!(
            found["phase_rad"].value.abs() < 0.1,
            "{:?}",
            found["phase_rad"]
        );
    }

    #[test]
    fn positions_that_come_after_their_torques_are_a_delay_of_the_encoders() {
        let mut recording = MadeUp::KNOWN.recorded(uniform(3));
        let late = 6;
        let signals = &mut recording.joints[0].signals;
        let shown_rad = signals.get_mut(&Signal::MotorPositionRad).unwrap();
        shown_rad.rotate_right(late);
        let first_rad = shown_rad[late];
        shown_rad[..late].fill(first_rad);
        let period_s = 1.0 / recording.sample_rate_hz;
        let joint = told_of(recording);
        assert_eq!(names(&joint), ["sensor_delay"]);
        let told = &joint.effects[0];
        assert_eq!(told.side.as_deref(), Some("both"));
        // a torque acts somewhere between its row and the next
        let found = told.parameters["delay_s"].value / period_s;
        assert!((found - late as f64).abs() < 1.0, "{found}");
        assert!(joint.gap.shrink > 0.9, "{}", joint.gap.shrink);
    }

    #[test]
    fn a_row_may_hold_the_torque_before_its_command_acted_or_after() {
        for later in [false, true] {
            let mut recording = MadeUp::KNOWN.recorded(uniform(3));
            let signals = &mut recording.joints[0].signals;
            let torque_nm = signals.get_mut(&Signal::MotorTorqueNm).unwrap();
            let command_nm = torque_nm.clone();
            if later {
                torque_nm.rotate_left(1);
            }
            signals.insert(Signal::CommandTorqueNm, command_nm);
            let joint = told_of(recording);
            assert_eq!(
                joint.verdict,
                Verdict::NoGap,
                "{later}: {:?}",
                names(&joint)
            );
        }
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
