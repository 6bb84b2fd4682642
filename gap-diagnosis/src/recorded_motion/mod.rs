//! The diagnosis along the recorded motion: each joint's torque beside what the robot file needs of it, regressed on the laws of motion
//! by one held-out score.
//!
//! For a robot whose controller or gears the file does not tell, this is the honest twin: inverse dynamics of the motion that was
//! recorded, which cannot leave the recording. What has a state of its own (a gear's windup, hysteresis, a delay) is not seen.

mod dynamics;
mod laws;
mod motion;
mod presliding;
mod rows;
mod signals;
mod usable;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use recording::{Recording, Signal};
use robot::{Effect, Robot};

use crate::diagnose::{
    DiagnoseError, Diagnosis, JointTraces, Progress, blank_report, insufficient,
};
use crate::evidence::arm::{self, Cause, ROUNDS};
use crate::evidence::imitation;
use crate::evidence::shares::Interval;
use crate::evidence::told::{self, Found, Said};
use crate::on_all_cores::OnAllCores;
use crate::report::{
    DataFinding, JointShare, NamedEffect, Parameter, SharedEffect, SignalGap, TwinKind,
};
use crate::signal::band::COMPARED_HZ;

use crate::evidence::{
    Evidence, Fit, Item, Message, NAME_NATS, Names, Presupposed, Problem, Scored, Span,
};
use dynamics::{Drive, Torques};
use laws::{Law, Laws};
use motion::{Piece, Read};
use rows::JointRows;
use signals::TorqueSource;
use usable::Usable;

/// Part of the torque that nobody can tell: torque transducers and current sensors of class 0.5 are linear to half a per cent.
const LINEAR: f64 = 0.005;
/// Part of the torque by which a command may differ from it without a word.
const COMMAND_TOLD: f64 = 0.05;

/// A joint as it is regressed.
struct Joint {
    index: usize,
    source: TorqueSource,
    rows: JointRows,
    drive: Drive,
}

/// A joint's sets of names, without and with a shared cause.
struct Searched {
    evidence: Evidence,
    sets: Vec<Scored>,
    /// The best set, possible or not.
    first: Scored,
    /// Whether a smooth law on no list explains something that the names leave.
    leaves_a_law: bool,
}

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
    let mut traces = Vec::new();
    if usable.against.iter().any(Option::is_none) {
        let pieces = motion::pieces_of(robot, &tables, &usable.read)?;
        let (reversed, joints): (Vec<Joint>, Vec<Joint>) = joints(robot, &usable.read, &pieces)?
            .into_iter()
            .partition(|joint| joint.rows.is_reversed());
        for joint in reversed {
            let name = &robot.joints[joint.index].name;
            let signal = joint.source.signal_name();
            report.data.push(DataFinding {
                joint: Some(name.clone()),
                severity: "error".to_owned(),
                what: format!("{signal} is reversed: it goes against what the robot file's masses and friction need"),
                remedy: format!("in the mapping file, [joint.{name}], {signal}: multiply its scale by -1"),
            });
            usable.against[joint.index] = Some(format!("{signal} is reversed"));
        }
        report.data.extend(untold(robot, &usable.read, &pieces));
        let (mut searched, mut shared) = searched(robot, &joints, progress);
        without_imitations(&joints, &mut searched);
        let mut said = said(robot, &joints, &searched, shared.as_ref(), materiality);
        if shared.is_some() && !matters(&said, materiality) {
            // what explains little of every joint is no cause of theirs
            shared = None;
            for both in &mut searched {
                both.with = None;
            }
            without_imitations(&joints, &mut searched);
            said = self::said(robot, &joints, &searched, None, materiality);
        }
        let mut of_shared = BTreeMap::new();
        let mut told = joints.iter().zip(&searched).zip(said).peekable();
        for (index, file) in robot.joints.iter().enumerate() {
            let next = told.next_if(|((joint, _), _)| joint.index == index);
            let Some(((joint, searched), said)) = next else {
                let why = usable.against[index].clone();
                let why = why.unwrap_or_else(|| "too few rows without a hole".to_owned());
                report.joints.push(insufficient(&file.name, why));
                continue;
            };
            if let Some(share) = said.shared {
                let share = JointShare {
                    share: share.value,
                    share_low: share.low,
                    share_high: share.high,
                };
                of_shared.insert(file.name.clone(), share);
            }
            report.data.extend(joint.notes(&file.name));
            report
                .data
                .extend(joint.note_of_scale(&file.name, &searched.alone));
            traces.push(traces_of(&file.name, &joint.rows, &said.fit));
            report.joints.push(said.report);
        }
        report.shared_effects = shared
            .into_iter()
            .map(|shared| shared.told(of_shared.clone()))
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
                if read.torque == Some(TorqueSource::Drive) && file.torque_noise_nm == 0.0 {
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

/// What is said of every joint.
fn said(
    robot: &Robot,
    joints: &[Joint],
    searched: &[Both],
    shared: Option<&Shared>,
    materiality: f64,
) -> Vec<Said> {
    let both = joints.iter().zip(searched).enumerate();
    both.on_all_cores(|(place, (joint, Both { alone, with }))| {
        let best = with.as_ref().unwrap_or(alone);
        let called = Laws {
            all: joint.rows.laws.iter().map(|(law, _)| *law).collect(),
            told: laws::Told {
                model: joint.drive.model(),
                feels_rotor: joint.source != TorqueSource::Sensor,
                mean_rad: joint.rows.mean_rad,
            },
        };
        let found = Found {
            joint: &robot.joints[joint.index].name,
            rows: &joint.rows.seen,
            called: &called,
            gear_ratio: joint.drive.model().gear_ratio,
            noise_square: joint.rows.noise_nm.powi(2) * joint.rows.seen.count() as f64,
            evidence: &best.evidence,
            alone: &alone.evidence,
            sets: &best.sets,
            leaves_a_law: best.leaves_a_law,
            is_at_floor: None,
            shared: shared.map(Shared::name),
            signals: vec![joint.signal_gap()],
            // no law of the motion has a state
            is_one_frequency: false,
            materiality,
        };
        found.said(&others(joints, place))
    })
    .collect()
}

/// Whether a shared cause takes a part of the joints' gaps on average, and for certain: few arms have one.
fn matters(said: &[Said], materiality: f64) -> bool {
    let shares: Vec<Interval> = said.iter().filter_map(|said| said.shared).collect();
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
            Ok(rows.map(|rows| Joint {
                index,
                source,
                drive: Drive::of(robot, index, source),
                rows,
            }))
        })
        .collect::<Result<Vec<_>, DiagnoseError>>()?;
    Ok(rows.into_iter().flatten().collect())
}

impl Joint {
    fn items(&self) -> Vec<Item<'_>> {
        let expects_friction = self.drive.rubs_unmeasured();
        let laws = self.rows.laws.iter();
        laws.map(|(law, columns)| Item {
            kind: law.kind(),
            cost: law.cost(expects_friction),
            presupposed: if expects_friction {
                law.presupposes(self.rows.laws.iter().map(|(law, _)| *law))
            } else {
                Presupposed::NOTHING
            },
            deviation: law.deviation(),
            is_usual: law.is_usual(),
            columns,
        })
        .collect()
    }

    /// Friction that every joint has, where nobody measured it.
    fn expected(&self) -> Names {
        if !self.drive.rubs_unmeasured() {
            return 0;
        }
        let laws = self.rows.laws.iter().enumerate();
        laws.filter(|(_, (law, _))| law.is_expected())
            .fold(0, |names, (place, _)| names | 1 << place)
    }

    /// Columns of a cause that the arm shares.
    fn of_arm(&self, cause: Cause) -> &[Vec<f64>] {
        match cause {
            Cause::Payload => &self.rows.payload,
            Cause::Tilt => &self.rows.tilt,
        }
    }

    fn spans(&self) -> [Span; 1] {
        let torque_nm = &self.rows.seen.measured_nm;
        let square = torque_nm.iter().map(|x| x * x).sum::<f64>();
        [Span {
            rows: 0..self.rows.seen.count(),
            floor_nm: LINEAR * (square / torque_nm.len().max(1) as f64).sqrt(),
        }]
    }

    fn evidence<R>(&self, shared: Option<&Prior>, of: impl FnOnce(&Problem<'_>) -> R) -> R {
        of(&Problem {
            gap_nm: &self.rows.seen.gap_nm(),
            spans: &self.spans(),
            items: &self.items(),
            tolerated: &self.rows.tolerated,
            inexact: 0.0,
            shared: shared.map(|prior| (prior.columns.as_slice(), &prior.message)),
        })
    }

    fn signal_gap(&self) -> SignalGap {
        let rows = self.rows.seen.count().max(1) as f64;
        let gap_nm = self.rows.seen.gap_nm();
        let square = gap_nm.iter().map(|x| x * x).sum::<f64>() / rows;
        SignalGap {
            signal: self.source.signal_name().to_owned(),
            gap_to_noise: square.sqrt() / self.rows.noise_nm.max(f64::MIN_POSITIVE),
        }
    }

    fn searched(&self, shared: Option<&Prior>) -> Searched {
        let evidence = self.evidence(shared, Evidence::of);
        let ranked = evidence.ranked();
        let first = ranked[0];
        let sets = evidence.possible(ranked, |fit| self.is_possible(fit));
        Searched {
            evidence,
            sets,
            first,
            leaves_a_law: false,
        }
    }

    /// Takes back names whose part of the gap a smooth law over what no name depends on explains better: the best set of the others,
    /// beside such a law, where that is ahead of the best set.
    fn without_imitations(&self, searched: &mut Searched) {
        searched.leaves_a_law = imitation::take_back(
            &mut searched.sets,
            &searched.evidence,
            &self.rows.seen,
            <[f64]>::to_vec,
            self.expected(),
            |fit| self.is_possible(fit),
        );
    }

    fn is_possible(&self, fit: &Fit) -> bool {
        let rows = &self.rows;
        let model = self.drive.model();
        laws::is_possible(
            fit,
            |item| rows.laws[item].0,
            |law| law.limits(model, rows.speed_rad_s, rows.inertia_kg_m2),
            |velocity_rad_s| model.friction.drag_nm(velocity_rad_s, 0.0, 0.0, 0.0),
            rows.speed_rad_s,
        )
    }

    /// What part of what the joint needs its torque is, and by how many nats that explains more than any names that can be; none unless it
    /// does, and the part is beyond what a torque constant can be off.
    fn scale(&self, searched: &Searched) -> Option<(f64, f64)> {
        let Searched {
            evidence, first, ..
        } = searched;
        let ahead_nats = first.score - searched.sets[0].score;
        if ahead_nats < NAME_NATS {
            return None;
        }
        let fit = evidence.fit(first.names);
        let mut values = fit.amplitudes.iter();
        let (_, scaled) =
            values.find(|(item, _)| self.rows.laws[*item].0 == Law::TorqueConstant)?;
        let part = 1.0 + scaled.first()?;
        let is_gain = (laws::GAIN[0]..laws::GAIN[1]).contains(&part.recip());
        (!is_gain).then_some((part, ahead_nats))
    }

    fn note_of_scale(&self, name: &str, searched: &Searched) -> Option<DataFinding> {
        let (part, ahead_nats) = self.scale(searched)?;
        let signal = self.source.signal_name();
        Some(DataFinding {
            joint: Some(name.to_owned()),
            severity: "warning".to_owned(),
            what: format!(
                "{signal} is {part:.2} times what the file's masses and friction need, by {ahead_nats:.0} nats a better explanation than any that \
                 is told; no torque constant is so far off"
            ),
            remedy: format!(
                "in the mapping file, [joint.{name}], {signal}: check its scale (amperes, per cent, gear side)"
            ),
        })
    }

    /// What a reader should know of where the torque comes from.
    fn notes(&self, name: &str) -> Vec<DataFinding> {
        let note = |severity: &str, what: String, remedy: &str| DataFinding {
            joint: Some(name.to_owned()),
            severity: severity.to_owned(),
            what,
            remedy: remedy.to_owned(),
        };
        let mut notes = Vec::new();
        match self.source {
            TorqueSource::Sensor => notes.push(note(
                "note",
                "its torque is that of the sensor behind the gear, which does not feel the motor, its rotor and what the gear loses \
                 before the sensor"
                    .to_owned(),
                "",
            )),
            TorqueSource::Controller => notes.push(note(
                "note",
                format!(
                    "its torque is what the robot file's controller makes of reference and position; no torque was measured{}",
                    if self.rows.feeds_rate {
                        ""
                    } else {
                        ", and it leaves less where the controller brakes the whole velocity, not its difference from the reference's"
                    },
                ),
                "",
            )),
            TorqueSource::Drive | TorqueSource::Command => {}
        }
        if let Some(command_nm) = &self.rows.command_nm {
            let rms = |of: &dyn Fn(usize) -> f64| {
                let rows = 0..self.rows.seen.count();
                rows.map(|k| of(k).powi(2)).sum::<f64>().sqrt()
            };
            let apart = rms(&|k| command_nm[k] - self.rows.seen.measured_nm[k])
                / rms(&|k| self.rows.seen.measured_nm[k]).max(f64::MIN_POSITIVE);
            if apart > COMMAND_TOLD {
                notes.push(note(
                    "warning",
                    format!(
                        "command_torque_nm is not what the drive made: they differ by {:.0} % of the measured torque below {} Hz; \
                         the joint is judged by the measured torque",
                        100.0 * apart,
                        COMPARED_HZ,
                    ),
                    "if the column is a model's torque and no command, leave it out of the mapping",
                ));
            }
        }
        notes
    }
}

/// Takes back what only imitates a smooth law, joint by joint.
fn without_imitations(joints: &[Joint], searched: &mut [Both]) {
    let both = joints.iter().zip(searched);
    both.on_all_cores(|(joint, both)| {
        joint.without_imitations(both.with.as_mut().unwrap_or(&mut both.alone));
    })
    .for_each(drop);
}

/// A joint's search without and with what the arm shares.
struct Both {
    alone: Searched,
    with: Option<Searched>,
}

/// A shared cause as one joint has it: its columns, and what the other joints say of their amplitudes.
struct Prior {
    columns: Vec<Vec<f64>>,
    message: Message,
}

/// A cause that the arm shares.
struct Shared {
    effect: Effect,
    std: Vec<f64>,
    joints: Vec<String>,
    probability: f64,
}

impl Shared {
    fn name(&self) -> &'static str {
        self.effect.name()
    }

    fn told(self, joint_shares: BTreeMap<String, JointShare>) -> SharedEffect {
        let mut parameters = told::parameters(&self.effect);
        let names: &[&str] = match self.effect {
            Effect::Payload { .. } => &["mass_kg"],
            _ => &["roll_rad", "pitch_rad"],
        };
        for (name, std) in names.iter().zip(&self.std) {
            parameters
                .entry((*name).to_owned())
                .and_modify(|p: &mut Parameter| p.std = *std);
        }
        let count = joint_shares.len().max(1) as f64;
        let mean = |of: fn(&JointShare) -> f64| joint_shares.values().map(of).sum::<f64>() / count;
        SharedEffect {
            effect: NamedEffect {
                effect: self.effect.name().to_owned(),
                probability: self.probability,
                parameters,
                side: None,
                share: mean(|share| share.share),
                share_low: mean(|share| share.share_low),
                share_high: mean(|share| share.share_high),
                shrink_alone: 0.0,
            },
            joints: self.joints,
            joint_shares,
        }
    }
}

/// The best sets of every joint, beside the cause that the arm shares, if the evidence for one outweighs its cost.
fn searched(
    robot: &Robot,
    joints: &[Joint],
    progress: &(dyn Fn(Progress) + Sync),
) -> (Vec<Both>, Option<Shared>) {
    let done = AtomicUsize::new(0);
    let alone: Vec<Searched> = joints
        .iter()
        .on_all_cores(|joint| {
            let searched = joint.searched(None);
            progress(Progress {
                done: done.fetch_add(1, Ordering::Relaxed) + 1,
                of: robot.joints.len(),
            });
            searched
        })
        .collect();
    let causes = Cause::ALL.into_iter().filter_map(|cause| {
        let (with, shared, nats) = beside(robot, joints, &alone, cause)?;
        (nats > 0.0).then_some((with, shared, nats))
    });
    let best = causes.max_by(|a, b| a.2.total_cmp(&b.2));
    let (with, shared) = match best {
        Some((with, shared, _)) => (with, Some(shared)),
        None => (joints.iter().map(|_| None).collect::<Vec<_>>(), None),
    };
    let both = alone
        .into_iter()
        .zip(with)
        .map(|(alone, with)| Both { alone, with });
    (both.collect(), shared)
}

/// Every joint beside a shared cause, the cause, and by how many nats it is worth its cost; none where fewer than two joints see it.
fn beside(
    robot: &Robot,
    joints: &[Joint],
    alone: &[Searched],
    cause: Cause,
) -> Option<(Vec<Option<Searched>>, Shared, f64)> {
    // a torque in another unit tells nothing of what the arm carries
    let sees: Vec<bool> = joints
        .iter()
        .zip(alone)
        .map(|(joint, alone)| {
            let columns = joint.of_arm(cause);
            let shows = columns.iter().flatten().any(|x| x.abs() > f64::EPSILON);
            columns.len() == cause.amplitudes() && shows && joint.scale(alone).is_none()
        })
        .collect();
    if sees.iter().filter(|sees| **sees).count() < 2 {
        return None;
    }
    let columns = |joint: &Joint, centre_m: [f64; 3]| match cause {
        Cause::Payload => joint.rows.payload_at(centre_m),
        Cause::Tilt => joint.of_arm(cause).to_vec(),
    };
    let mut priors: Vec<Prior> = joints
        .iter()
        .map(|joint| Prior {
            columns: columns(joint, [0.0; 3]),
            message: cause.prior(),
        })
        .collect();
    let mut with: Vec<Option<Searched>> = Vec::new();
    let mut own: Vec<Option<Message>> = Vec::new();
    for round in 0..=ROUNDS {
        let said = joints.iter().zip(&priors).zip(0..);
        own = said
            .on_all_cores(|((joint, prior), place): (_, usize)| {
                if !sees[place] {
                    return None;
                }
                // names that were found without the cause may stand for it
                if round == 0 {
                    let evidence = joint.evidence(Some(prior), Evidence::of);
                    return evidence.message(evidence.usual());
                }
                let searched = with[place].as_ref()?;
                searched.evidence.message(searched.sets[0].names)
            })
            .collect();
        let (said, _) = arm::all(cause, &own).said()?;
        let centre_m = match cause {
            Cause::Payload => [1, 2, 3].map(|k| said[k] / said[0]),
            Cause::Tilt => [0.0; 3],
        };
        let messages = arm::others(cause, &own).into_iter();
        priors = joints
            .iter()
            .zip(messages)
            .map(|(joint, message)| Prior {
                columns: columns(joint, centre_m),
                message,
            })
            .collect();
        with = joints
            .iter()
            .zip(&priors)
            .zip(&sees)
            .on_all_cores(|((joint, prior), sees)| sees.then(|| joint.searched(Some(prior))))
            .collect();
    }
    let nats: f64 = alone
        .iter()
        .zip(&with)
        .filter_map(|(alone, with)| Some(worth(alone, with.as_ref()?)))
        .sum::<f64>()
        - cause.cost();
    let (said, covariance) = arm::all(cause, &own).said()?;
    if !cause.can_be(robot, &said, &covariance) {
        return None;
    }
    let effect = match cause {
        Cause::Payload => {
            let mass_kg = said[0];
            let centre_m = [1, 2, 3].map(|k| said[k] / mass_kg);
            Effect::Payload { mass_kg, centre_m }
        }
        Cause::Tilt => Effect::BaseTilt {
            roll_rad: said[0],
            pitch_rad: said[1],
        },
    };
    let seen = joints.iter().zip(&sees).filter(|(_, sees)| **sees);
    let shared = Shared {
        effect,
        std: covariance
            .diagonal()
            .iter()
            .map(|x| x.max(0.0).sqrt())
            .collect(),
        joints: seen
            .map(|(joint, _)| robot.joints[joint.index].name.clone())
            .collect(),
        probability: 1.0 / (1.0 + (-nats / told::TEMPERATURE).exp()),
    };
    Some((with, shared, nats))
}

/// Nats by which a joint is better told beside a shared cause, with the rows that both count as independent.
fn worth(alone: &Searched, with: &Searched) -> f64 {
    let [a, b] = [alone, with].map(|searched| {
        let left: f64 = searched.sets[0].left.iter().sum();
        let cost = searched.evidence.cost(searched.sets[0].names);
        (left.max(f64::MIN_POSITIVE), cost)
    });
    let rows = |of: &Searched| of.evidence.independent_rows();
    let independent = rows(alone).min(rows(with));
    0.5 * independent * (a.0 / b.0).ln() + a.1 - b.1
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
