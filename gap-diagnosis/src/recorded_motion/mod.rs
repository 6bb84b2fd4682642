//! The diagnosis along the recorded motion: each joint's torque beside what the robot file needs of it, regressed on the laws of motion
//! by one held-out score.
//!
//! For a robot whose controller or gears the file does not tell, this is the honest twin: inverse dynamics of the motion that was
//! recorded, which cannot leave the recording. What has a state of its own (a gear's windup, hysteresis, a delay) is not seen.

mod dynamics;
mod gravity;
mod joint;
mod laws;
mod links;
mod motion;
mod presliding;
mod rows;
mod shapes;
mod shared;
mod sign;
mod signals;
mod turning;
mod usable;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::time::Instant;

use dynamics::{Drive, Torques};
use gap_report::{DataFinding, JointReport, JointShare, TorqueSource, TwinKind, Verdict};
use joint::{Joint, Searched};
use joint_twin::on_all_cores::OnAllCores;
use laws::Laws;
use motion::{Piece, Read};
use recording::{Recording, Signal, as_measured};
use robot::{EffectKind, Robot};
use rows::JointRows;
use shared::{Arm, Late};
use sign::Sign;
use usable::Usable;

use crate::diagnose::{
    DiagnoseError, Diagnosis, JointTraces, Progress, blank_report, insufficient,
};
use crate::evidence::Fit;
use crate::evidence::arm::{Cause, Shared};
use crate::evidence::shares::Interval;
use crate::evidence::told::{Found, Said};

/// Diagnoses a robot along the motion that was recorded. Effects below `materiality` are minor ones.
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
    let mut report = blank_report(robot, recordings)?;
    report.twin = TwinKind::FollowsMotion;
    let mut usable = Usable::of(robot, &tables);
    report.data.extend(usable.findings.iter().cloned());
    let whole: Vec<Cow<Recording>> = tables.iter().map(|table| as_measured(table)).collect();
    let tables: Vec<&Recording> = whole.iter().map(AsRef::as_ref).collect();
    let mut traces = Vec::new();
    if usable.against.iter().any(Option::is_none) {
        let pieces = motion::pieces_of(robot, &tables, &usable.read)?;
        let joints = joints(robot, &usable.read, &pieces)?;
        let signs: Vec<Sign> = joints.iter().map(|joint| joint.rows.sign()).collect();
        let is_any = |of: Sign| signs.contains(&of);
        // one logger has one sign
        let is_all = is_any(Sign::Reversed) && !is_any(Sign::Right);
        let mut of_right_sign = Vec::new();
        for (joint, sign) in joints.into_iter().zip(&signs) {
            let name = &robot.joints[joint.index].name;
            let signal = joint.source.signal_name();
            let in_mapping = format!("in the mapping file, [joint.{name}]");
            let (why, because, remedy) = match sign {
                Sign::Reversed => (
                    format!("{signal} is reversed"),
                    "it goes against what the robot file's masses and friction need",
                    format!("{in_mapping}, {signal}: multiply its scale by -1"),
                ),
                Sign::OfMotion => (
                    format!("its position is reversed beside {signal}"),
                    "friction and inertia go against the torque, and what the robot file's masses need as they are carried does not",
                    format!(
                        "{in_mapping}: multiply the scales of its position, velocity and references by -1; if the file's masses or the \
                         position's zero are not what they should be, that of {signal} alone"
                    ),
                ),
                Sign::Untold if is_all => (
                    format!("{signal} may be reversed"),
                    "nothing tells its sign, and wherever something does the torque is reversed",
                    format!("{in_mapping}, {signal}: multiply its scale by -1"),
                ),
                Sign::Right | Sign::Untold => {
                    if *sign == Sign::Untold {
                        report.data.extend(usable.doubts(name));
                    }
                    of_right_sign.push(joint);
                    continue;
                }
            };
            report.data.push(DataFinding {
                joint: Some(name.clone()),
                severity: "error".to_owned(),
                what: format!("{why}: {because}"),
                remedy,
            });
            usable.against[joint.index] = Some(why);
        }
        report.data.extend(untold(robot, &usable.read, &pieces));
        let (mut arms, mut all) = shared::searched(robot, of_right_sign, progress);
        // what explains little of every joint is no cause of theirs: it is left out, and nothing but the links takes its place
        let mut said = loop {
            let probability = probabilities(&all);
            let best = &mut all[0];
            let Arm { joints, alone } = &mut arms[best.arm];
            without_imitations(joints, alone, &mut best.with);
            let said = said(robot, joints, alone, (&*best, &probability), materiality);
            let mattering: Vec<Cause> = best
                .causes()
                .enumerate()
                .filter(|(place, _)| matters(&said, *place, materiality))
                .map(|(_, cause)| cause)
                .collect();
            if mattering.len() == best.causes().count() {
                break said;
            }
            // links that weigh other than the file says are what a payload is a part of
            let told: Vec<Cause> = best.causes().collect();
            let may_be = |cause: Cause| {
                let are_others = cause.is_of_links() && !told.contains(&cause);
                mattering.contains(&cause) || are_others
            };
            all.retain(|found| found.causes().all(may_be));
        };
        let best = &mut all[0];
        let Arm { joints, alone } = &mut arms[best.arm];
        let of_file = |joint: &Joint| robot.joints[joint.index].name.as_str();
        let note_of_values = |joint: &Joint, searched: &Searched, of_links: Option<&Shared>| {
            joint.note_of_values(of_file(joint), searched, of_links)
        };
        // what joints move the links by for themselves is what no file can have
        let is_moved = best.shared.is_empty() && {
            let mut each = joints.iter().zip(&*alone);
            each.any(|(joint, alone)| note_of_values(joint, alone, None).is_some())
        };
        let within = is_moved.then(|| links::within_tolerance(robot, joints, alone));
        let of_links = within.flatten().map(|within| {
            best.with = within.with;
            without_imitations(joints, alone, &mut best.with);
            said = self::said(robot, joints, alone, (&*best, &[]), materiality);
            within.links
        });
        for ((joint, alone), with) in joints.iter().zip(&*alone).zip(&best.with) {
            let searched = with.as_ref().unwrap_or(alone);
            report
                .data
                .extend(joint.note_of_clock(of_file(joint), searched));
            report
                .data
                .extend(note_of_values(joint, searched, of_links.as_ref()));
        }
        if let Some(of_links) = &of_links {
            report.links = links::changes(robot, of_links);
        }
        let late = shared::late(robot, &arms, &all[0]);
        report.data.extend(late.as_ref().map(note_of_late));
        let probability = probabilities(&all);
        let shared::Found {
            arm, shared, nats, ..
        } = all.swap_remove(0);
        if let Some((_, of_links)) = links::among(&shared) {
            report.links = links::changes(robot, of_links);
            report.data.push(links::note(robot, &report.links, nats));
        }
        let joints = arms.swap_remove(arm).joints;
        let mut of_shared = vec![BTreeMap::new(); shared.len()];
        let mut told = joints.iter().zip(said).peekable();
        for (index, file) in robot.joints.iter().enumerate() {
            let next = told.next_if(|(joint, _)| joint.index == index);
            let Some((joint, said)) = next else {
                let why = usable.against[index].clone();
                let why = why.unwrap_or_else(|| too_few(&pieces, index));
                report.joints.push(insufficient(&file.name, why));
                continue;
            };
            for (of_joints, share) in of_shared.iter_mut().zip(&said.shared) {
                let share = JointShare {
                    share: share.value,
                    share_low: share.low,
                    share_high: share.high,
                };
                of_joints.insert(file.name.clone(), share);
            }
            report.data.extend(joint.notes(robot));
            report.data.extend(joint.note_of_misfit(&file.name));
            traces.push(traces_of(&file.name, &joint.rows, &said.fit));
            let mut told = said.report;
            told.torque = Some(joint.torque(&told));
            report.data.extend(joint.note_of_file(&told));
            report.data.extend(joint.note_of_inertia(&told));
            report
                .data
                .extend(joint.note_of_zero(&told, &robot.tolerance));
            report.data.extend(note_of_scale(&told));
            report.data.extend(note_of_sensor(&told));
            report.data.extend(note_of_its_friction(&told));
            report.joints.push(told);
        }
        report.shared_effects = shared
            .into_iter()
            .zip(of_shared)
            .zip(probability)
            .filter_map(|((shared, of_joints), probability)| shared.told(probability, of_joints))
            .collect();
    } else {
        let both = robot.joints.iter().zip(usable.against);
        report.joints = both
            .map(|(joint, why)| insufficient(&joint.name, why.unwrap_or_default()))
            .collect();
    }
    report.data.sort_by_key(DataFinding::rank);
    report.compute_seconds = begin.elapsed().as_secs_f64();
    Ok(Diagnosis { report, traces })
}

/// Why a joint has too few rows.
fn too_few(pieces: &[Piece], joint: usize) -> String {
    let parts = pieces.iter().map(|piece| piece.joints[joint].at_limit_part);
    let at_limit = parts.fold(0.0, f64::max);
    let of_limit = if at_limit > 0.0 {
        format!(
            "; in {:.0} % its controller asks for more than torque_limit_nm, and those do not count",
            100.0 * at_limit
        )
    } else {
        String::new()
    };
    format!(
        "too few rows without a hole in which it moves, or no further than friction may bend (10 mrad){of_limit}"
    )
}

/// What one delay of all references would explain of what is told as friction. Its size is to first order in what the reference does
/// within it, so no error goes with it.
fn note_of_late(late: &Late) -> DataFinding {
    let Late { delay_s, nats } = late;
    DataFinding {
        joint: None,
        severity: "warning".to_owned(),
        what: format!(
            "one delay of all references, about {:.0} ms, explains the joints better than what is named does, by {nats:.0} nats, in the place \
             of viscous friction: where no torque was measured nothing else tells them apart",
            1e3 * delay_s,
        ),
        remedy: "measure how late a reference reaches its drive, and take that off the references' times; or record a torque".to_owned(),
    }
}

/// In which newton metres the values stand beside a torque constant.
fn note_of_scale(told: &JointReport) -> Option<DataFinding> {
    let factor = told.motor_per_recorded();
    let beside = told.named().count() > 1 || !told.remaining_over.is_empty();
    let by = match told.torque.map(|torque| torque.source) {
        Some(TorqueSource::Controller) => "by the controller's gains",
        _ => "as recorded",
    };
    (factor != 1.0 && beside).then(|| DataFinding {
        joint: Some(told.joint.clone()),
        severity: "note".to_owned(),
        what: format!(
            "beside its torque constant, torques are in newton metres {by}; the motor's are {factor:.3} times as much, and \
             `flexspline gap apply` writes those"
        ),
        remedy: String::new(),
    })
}

/// That a torque feels what no sensor behind the gear does.
fn note_of_its_friction(told: &JointReport) -> Option<DataFinding> {
    let is_of_sensor = told
        .torque
        .is_some_and(|torque| torque.source == TorqueSource::Sensor);
    let rubs = [EffectKind::CoulombFriction, EffectKind::ViscousFriction];
    let rubs = rubs.map(EffectKind::name);
    let mut named = told.effects.iter();
    let feels = named.any(|found| rubs.contains(&&*found.effect));
    (is_of_sensor && feels).then(|| DataFinding {
        joint: Some(told.joint.clone()),
        severity: "note".to_owned(),
        what: "joint_torque_nm feels friction, which a sensor behind the gear does not: it may be the motor's torque, as seen at the joint"
            .to_owned(),
        remedy: format!(
            "if no sensor measured it, in the mapping file, [joint.{}]: call it motor_torque_nm, its scale over the gear ratio",
            told.joint
        ),
    })
}

/// What a torque sensor is wrong by, as the line of the mapping file that puts it right.
fn note_of_sensor(told: &JointReport) -> Option<DataFinding> {
    let value = |kind: EffectKind, parameter: &str| {
        // what is minor may as well be none
        let mut named = told.effects.iter();
        let found =
            named.find(|found| told.is_of_sensor(&found.effect) && found.effect == kind.name())?;
        Some(found.parameters.get(parameter)?.value)
    };
    let gain = value(EffectKind::TorqueConstantError, "gain");
    let offset_nm = value(EffectKind::TorqueOffset, "offset_nm");
    // the motor's offset helps, and what the sensor shows is less by it
    let added = offset_nm.map(|nm| format!("{:.3}", nm * gain.unwrap_or(1.0)));
    let added = added.filter(|nm| nm.trim_start_matches('-') != "0.000");
    let added = added.map(|nm| format!("add {nm} to its offset"));
    let scaled = gain.map(|gain| {
        format!(
            "multiply its scale{} by {gain:.3}",
            if added.is_some() {
                " and its offset"
            } else {
                ""
            }
        )
    });
    let both = [scaled, added].into_iter().flatten();
    let remedy = both.collect::<Vec<String>>().join(", then ");
    (!remedy.is_empty()).then(|| DataFinding {
        joint: Some(told.joint.clone()),
        severity: "note".to_owned(),
        what: "an offset or a factor of its torque is the torque sensor's, or what the file's masses lack: `flexspline gap apply` leaves it \
               out"
            .to_owned(),
        remedy: format!("in the mapping file, [joint.{}], joint_torque_nm: {remedy}", told.joint),
    })
}

/// What the robot file does not state of the measurement, as lines to add to it: it is unknown, and never an effect.
fn untold(robot: &Robot, read: &[Read], pieces: &[Piece]) -> Option<DataFinding> {
    let piece = pieces.first()?;
    let lines =
        robot
            .joints
            .iter()
            .zip(read)
            .zip(&piece.joints)
            .filter_map(|((file, read), motion)| {
                let mut lines = Vec::new();
                let (key, stated) = match read.position? {
                    Signal::MotorPositionRad => (
                        "motor_encoder_resolution_rad",
                        file.motor_encoder_resolution_rad,
                    ),
                    _ => (
                        "link_encoder_resolution_rad",
                        file.link_encoder_resolution_rad,
                    ),
                };
                if let Some(step_rad) = motion.step_rad.filter(|_| stated.is_none()) {
                    lines.push(format!("{key} = {step_rad:.2e}"));
                }
                let of_drive = read.torque == Some(TorqueSource::Drive);
                let torque_nm = motion.torque_nm.iter().flatten();
                let largest_nm = torque_nm.fold(0.0, |largest: f64, nm| largest.max(nm.abs()));
                // what a number's digits make is no noise
                let is_seen = motion.noise_nm > f64::from(f32::EPSILON) * largest_nm;
                if of_drive && file.torque_noise_nm == 0.0 && is_seen {
                    let noise_nm = motion.noise_nm / file.gear_ratio.abs();
                    lines.push(format!("torque_noise_nm = {noise_nm:.1e}"));
                }
                (!lines.is_empty()).then(|| format!("{}: {}", file.name, lines.join(", ")))
            });
    let lines: Vec<String> = lines.collect();
    (!lines.is_empty()).then(|| DataFinding {
        joint: None,
        severity: "note".to_owned(),
        what: "the robot file does not state what the sensors show; that is unknown here and no effect".to_owned(),
        remedy: format!("the recording shows, to be added to [[joint]]: {}", lines.join("; ")),
    })
}

/// Takes back what only imitates a smooth law, joint by joint.
fn without_imitations(joints: &[Joint], alone: &mut [Searched], with: &mut [Option<Searched>]) {
    let all = joints.iter().zip(alone).zip(with);
    all.on_all_cores(|((joint, alone), with)| {
        joint.without_imitations(with.as_mut().unwrap_or(alone));
    })
    .for_each(drop);
}

/// How probable each of the first possibility's causes is.
fn probabilities(all: &[shared::Found]) -> Vec<f64> {
    let causes = all[0].causes();
    causes
        .map(|cause| shared::probability(cause, all))
        .collect()
}

/// What is said of every joint. `found`: what the arm shares, with each cause's probability.
fn said(
    robot: &Robot,
    joints: &[Joint],
    alone: &[Searched],
    (found, probability): (&shared::Found, &[f64]),
    materiality: f64,
) -> Vec<Said> {
    let both = joints.iter().zip(alone).zip(&found.with).enumerate();
    both.on_all_cores(|(place, ((joint, alone), with))| {
        let best = with.as_ref().unwrap_or(alone);
        let names = best.sets[0].names;
        let mut laws = joint.rows.laws.iter().enumerate();
        let rubs = laws.any(|(place, (law, _))| names & 1 << place != 0 && law.is_expected());
        let called = Laws {
            all: joint.rows.laws.iter().map(|(law, _)| *law).collect(),
            told: laws::Told {
                model: joint.drive.model(),
                // what feels a gear's friction is before it, whatever it is called
                feels_rotor: joint.source != TorqueSource::Sensor || rubs,
                mean_rad: joint.rows.mean_rad,
            },
        };
        let named = |cause: Cause| (cause.name(), joint.of_arm(cause).len());
        let named: Vec<(Option<&'static str>, usize)> = found.causes().map(named).collect();
        let of_links = links::among(&found.shared).filter(|_| with.is_some());
        let of_links = of_links.and_then(|(place, shared)| {
            let told = links::of_joint(joint, shared, probability[place])?;
            Some((place, told))
        });
        let found = Found {
            joint: &robot.joints[joint.index].name,
            rows: &joint.rows.seen,
            called: &called,
            gear_ratio: joint.drive.model().gear_ratio,
            friction: &joint.drive.model().friction,
            // what is left where it was not fitted holds the noise
            noise_square: (joint.rows.noise_nm.powi(2) * joint.rows.seen.count() as f64)
                .min(best.sets[0].left.iter().sum()),
            evidence: &best.evidence,
            sets: &best.sets,
            leaves: best.leaves.flatten(),
            is_at_floor: None,
            shared: if with.is_some() { &named } else { &[] },
            of_links,
            signals: vec![joint.signal_gap()],
            // no law of the motion has a state
            is_one_frequency: false,
            materiality,
        };
        found.said(&others(joints, place))
    })
    .collect()
}

/// Whether a shared cause takes a part of the joints' gaps on average, and for certain: few arms have one. A joint that nothing explains has
/// no voice.
fn matters(said: &[Said], place: usize, materiality: f64) -> bool {
    let told = said
        .iter()
        .filter(|said| said.report.verdict != Verdict::Unexplained);
    let shares: Vec<Interval> = told
        .filter_map(|said| said.shared.get(place).copied())
        .collect();
    let mean =
        |of: fn(&Interval) -> f64| shares.iter().map(of).sum::<f64>() / shares.len().max(1) as f64;
    mean(|share| share.value) >= materiality && mean(|share| share.low) > 0.0
}

fn joints(robot: &Robot, read: &[Read], pieces: &[Piece]) -> Result<Vec<Joint>, DiagnoseError> {
    let torques: Vec<Torques> = pieces
        .iter()
        .on_all_cores(|piece| Torques::along(robot, piece))
        .collect();
    let rows = read
        .iter()
        .enumerate()
        .on_all_cores(|(index, read)| {
            let Some(source) = read.torque else {
                return Ok(None);
            };
            let rows = JointRows::of(robot, index, source, pieces, &torques)?;
            let of_gear = JointRows::beside_its_sensor(robot, index, pieces, &torques)?;
            Ok(rows.map(|rows| Joint {
                index,
                source,
                drive: Drive::of(robot, index, source),
                misfit: None,
                of_gear,
                rows,
            }))
        })
        .collect::<Result<Vec<_>, DiagnoseError>>()?;
    Ok(rows.into_iter().flatten().collect())
}

/// What the other joints do, in a joint's rows; only where rows are the same.
fn others(joints: &[Joint], own: usize) -> Vec<Vec<f64>> {
    let rows = joints[own].rows.seen.count();
    let others = joints.iter().enumerate().filter(|(k, _)| *k != own);
    others
        .filter(|(_, joint)| joint.rows.seen.time_s == joints[own].rows.seen.time_s)
        .flat_map(|(_, joint)| {
            let velocity = &joint.rows.seen.velocity_rad_s;
            let sign: Vec<f64> = velocity.iter().map(|v| v.signum()).collect();
            [velocity.clone(), sign]
        })
        .filter(|column| column.len() == rows)
        .collect()
}

fn traces_of(name: &str, rows: &JointRows, fit: &Fit) -> JointTraces {
    let beyond = |torque: &[f64]| -> Vec<f64> {
        let both = torque.iter().zip(&rows.rigid_nm);
        both.map(|(torque, rigid)| torque - rigid).collect()
    };
    let nominal_nm = beyond(&rows.seen.nominal_nm);
    let added = nominal_nm.iter().zip(&fit.predicted_nm);
    JointTraces {
        joint: name.to_owned(),
        time_s: rows.seen.time_s.clone(),
        measured_nm: beyond(&rows.seen.measured_nm),
        augmented_nm: added.map(|(nominal, added)| nominal + added).collect(),
        nominal_nm,
        position_rad: rows.seen.position_rad.clone(),
        velocity_rad_s: rows.seen.velocity_rad_s.clone(),
    }
}
