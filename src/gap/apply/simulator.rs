//! `gap apply --format mjcf|urdf|isaaclab`: the effects where the user's simulator reads them, and what it cannot say with the
//! share of the gap that this is.

use std::fmt::Write;
use std::path::Path;

use gap_report::{JointReport, Report};
use robot::{Effect, EffectKind, Outcome, Part, Reshaping, Simulator, SimulatorFile};
use serde::Serialize;

use super::{OF_SENSOR, check_name, effects_of, names_nothing, to_effect};
use crate::cli::GapApplyArguments;
use crate::error::CliError;
use crate::gap::page::words::percent;
use crate::output::{print, write_json, write_text};

/// What became of one effect of one joint.
#[derive(Debug, Serialize)]
struct Said {
    /// None for the whole arm.
    joint: Option<String>,
    effect: &'static str,
    /// Of its joint's gap; of an effect of the whole arm the mean over its joints.
    share: f64,
    /// What was changed; none where nothing could be.
    #[serde(skip_serializing_if = "Option::is_none")]
    done: Option<String>,
    /// What the format cannot say of it, and why.
    #[serde(skip_serializing_if = "Option::is_none")]
    cannot_say: Option<String>,
}

/// How much of a joint's gap the new file holds.
#[derive(Debug, Default, PartialEq, Serialize)]
struct JointShares {
    joint: String,
    written: f64,
    written_in_part: f64,
    cannot_say: f64,
    /// What has no name.
    no_name: f64,
}

/// For programs.
#[derive(Serialize)]
struct Applied<'a> {
    schema: u32,
    format: &'static str,
    file: &'a Path,
    effects: &'a [Said],
    joints: &'a [JointShares],
    /// What of the robot file itself the format cannot say.
    notes: &'a [String],
}

/// Reads the robot, writes the file, tells what is in it and what is not.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if there is nothing that can be written.
pub fn apply(
    arguments: &GapApplyArguments,
    report: &Report,
    simulator: Simulator,
) -> Result<(), CliError> {
    if arguments.remaining {
        return Err(CliError::Input(format!(
            "--remaining: {} has no torque tables; leave it out, or write a robot file with --format toml",
            simulator.name()
        )));
    }
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    let report_name = arguments.report.display().to_string();
    check_name([&report_name, &arguments.robot], report, &robot.name)?;
    let names: Vec<&str> = report
        .joints
        .iter()
        .map(|joint| joint.joint.as_str())
        .collect();
    if let Some(unknown) = names.iter().find(|name| robot.joint_index(name).is_none()) {
        return Err(CliError::Input(format!(
            "{}: joint `{unknown}` is not in {}; give the robot file that was diagnosed",
            arguments.report.display(),
            arguments.robot
        )));
    }
    // payloads are in the frame of the last joint that was diagnosed
    let robot = robot.moving_only(&names).map_err(CliError::input)?;
    let refuse =
        |reason: String| CliError::Input(format!("{}: {reason}", arguments.report.display()));
    let links = super::links::reshaping(report, &robot).map_err(refuse)?;
    let (given, out) = (&arguments.robot, &arguments.out);
    let file = SimulatorFile::with_links(&robot, links.as_ref(), given, simulator, out);
    let mut file = file.map_err(CliError::input)?;
    let mut effects =
        add_all(&mut file, report, &|name| robot.joint_index(name)).map_err(refuse)?;
    effects.extend(
        links
            .iter()
            .flat_map(|links| of_links(links, report, simulator)),
    );
    if effects.is_empty() {
        return Err(names_nothing(&report_name, report));
    }
    let joints = shares(report, &effects);
    if effects.iter().all(|said| said.done.is_none()) {
        let first = effects.iter().find_map(|said| said.cannot_say.as_deref());
        return Err(CliError::Negative(format!(
            "{}: nothing of what it names can be said in {}: {}",
            arguments.report.display(),
            simulator.name(),
            first.unwrap_or_default()
        )));
    }
    let text = file.text().map_err(CliError::input)?;
    write_text(&arguments.out, &text)?;
    if let Some(path) = &arguments.json {
        let applied = Applied {
            schema: 1,
            format: simulator.name(),
            file: &arguments.out,
            effects: &effects,
            joints: &joints,
            notes: &file.notes,
        };
        write_json(&applied, path)?;
        if path == Path::new("-") {
            return Ok(());
        }
    }
    let told = told(&effects, &joints, &file.notes, simulator);
    print(&format!(
        "{told}{}: {}\n",
        simulator.name(),
        arguments.out.display()
    ))
}

/// A file and what became of every effect that was to be added to it.
struct Adding<'a> {
    file: &'a mut SimulatorFile,
    index: &'a dyn Fn(&str) -> Option<usize>,
    all: Vec<Said>,
}

impl Adding<'_> {
    /// Adds an effect, of the whole arm if of no joint.
    fn add(&mut self, joint: Option<&str>, effect: &Effect, share: f64) {
        let outcome = self.file.add(joint.and_then(self.index), effect);
        let (done, cannot_say) = match outcome {
            Outcome::Written(done) => (Some(done), None),
            Outcome::InPart(done, missing) => (Some(done), Some(missing)),
            Outcome::Cannot(why) => (None, Some(why)),
        };
        self.all.push(Said {
            joint: joint.map(str::to_owned),
            effect: effect.name(),
            share,
            done,
            cannot_say,
        });
    }

    /// Tells of an effect that is left out.
    fn leave(&mut self, joint: &str, effect: &Effect, share: f64, why: &str) {
        self.all.push(Said {
            joint: Some(joint.to_owned()),
            effect: effect.name(),
            share,
            done: None,
            cannot_say: Some(why.to_owned()),
        });
    }

    /// A joint's own effects. What corrects Coulomb and viscous friction was fitted beside them: where one of it cannot be said, or one
    /// of the two would be below zero, they are written as they are without any and with none below zero.
    fn add_joint(&mut self, joint: &JointReport) -> Result<(), String> {
        let name = &joint.joint;
        let effects = effects_of(joint)?;
        let is_friction = |effect: &Effect| effect.kind().part() == Part::Friction;
        let index = (self.index)(name);
        let lacks_one = effects.iter().any(|(_, effect)| {
            is_friction(effect)
                && index.is_some_and(|index| !self.file.says_friction(index, effect))
        });
        let Some(plain) = joint.plain_friction.filter(|_| lacks_one) else {
            for (found, effect) in &effects {
                self.add(Some(name), effect, found.share);
            }
            return Ok(());
        };
        let torque_nm = joint.gap.torque_rms_nm;
        let square = |nm: f64| (nm / torque_nm.before).powi(2);
        let lost = (square(plain.torque_rms_nm) - square(torque_nm.after)).max(0.0);
        let sum = |is_one: fn(&Effect) -> bool| -> f64 {
            let own = effects.iter().filter(|(_, effect)| is_one(effect));
            own.map(|(found, _)| found.share).sum()
        };
        // what the corrections take, the others take without them, but for this; no more than all of it
        let friction_share = sum(corrects) + sum(is_plain);
        let corrections = effects.iter().filter(|(_, effect)| corrects(effect));
        let corrections = corrections.count();
        let lost = match corrections {
            0 => 0.0,
            _ => lost.min(friction_share.max(0.0)),
        };
        let factor = joint.motor_per_recorded();
        let friction = [
            Effect::CoulombFriction {
                coulomb_nm: factor * plain.coulomb_nm,
            },
            Effect::ViscousFriction {
                viscous_nm_s_rad: factor * plain.viscous_nm_s_rad,
            },
        ];
        // what stays as the file has it takes nothing
        let changed = [plain.coulomb_nm, plain.viscous_nm_s_rad].map(|change| change != 0.0);
        let changes = changed.iter().filter(|is_one| **is_one).count();
        for (effect, is_one) in friction.iter().zip(changed) {
            if is_one {
                let share = (friction_share - lost) / changes as f64;
                self.add(Some(name), effect, share);
            }
        }
        let why = format!(
            "Coulomb and viscous friction are those that leave least without it and are not below zero, {:.3} Nm rms instead of {:.3} Nm",
            plain.torque_rms_nm, torque_nm.after
        );
        for (found, effect) in effects.iter().filter(|(_, effect)| !is_plain(effect)) {
            if corrects(effect) {
                self.leave(name, effect, lost / corrections as f64, &why);
            } else {
                self.add(Some(name), effect, found.share);
            }
        }
        Ok(())
    }
}

/// Whether it is friction beyond Coulomb's and viscous friction.
fn corrects(effect: &Effect) -> bool {
    effect.kind().part() == Part::Friction && !is_plain(effect)
}

fn is_plain(effect: &Effect) -> bool {
    let plain = [EffectKind::CoulombFriction, EffectKind::ViscousFriction];
    plain.contains(&effect.kind())
}

/// Adds every effect that the report names, those of the whole arm first.
fn add_all(
    file: &mut SimulatorFile,
    report: &Report,
    index: &dyn Fn(&str) -> Option<usize>,
) -> Result<Vec<Said>, String> {
    let mut adding = Adding {
        file,
        index,
        all: Vec::new(),
    };
    for shared in &report.shared_effects {
        let effect = to_effect(&shared.effect)?;
        if effect.may_be_shared() {
            adding.add(None, &effect, shared.effect.share);
            continue;
        }
        for joint in &shared.joints {
            let share = shared.joint_shares.get(joint);
            adding.add(Some(joint), &effect, share.map_or(0.0, |share| share.share));
        }
    }
    for joint in &report.joints {
        adding.add_joint(joint)?;
    }
    for joint in &report.joints {
        for found in joint
            .named()
            .filter(|found| joint.is_of_sensor(&found.effect))
        {
            adding.leave(&joint.joint, &to_effect(found)?, found.share, OF_SENSOR);
        }
    }
    Ok(adding.all)
}

/// What became of the links, each with the share of what all of them do to its joint.
fn of_links<'a>(
    links: &'a Reshaping,
    report: &'a Report,
    simulator: Simulator,
) -> impl Iterator<Item = Said> + 'a {
    links.told().map(move |(name, told)| {
        let joint = report.joints.iter().find(|joint| joint.joint == name);
        let found = joint.and_then(|joint| joint.named().find(|found| found.of_links));
        let is_written = simulator != Simulator::IsaacLab;
        let by_hand = || format!("actuators have no mass; change the body of the USD: {told}");
        Said {
            joint: Some(name.to_owned()),
            effect: found
                .and_then(|found| EffectKind::named(&found.effect))
                .map_or("link", EffectKind::name),
            share: found.map_or(0.0, |found| found.share),
            cannot_say: (!is_written).then(by_hand),
            done: is_written.then_some(told),
        }
    })
}

/// How much of each joint's gap is in the file; of joints that have one.
fn shares(report: &Report, effects: &[Said]) -> Vec<JointShares> {
    let mut all = Vec::new();
    for joint in &report.joints {
        let mut shares = JointShares {
            joint: joint.joint.clone(),
            no_name: joint.remaining_share,
            ..JointShares::default()
        };
        for said in effects {
            let share = match &said.joint {
                Some(own) if *own == joint.joint => said.share,
                Some(_) => continue,
                None => shared_share(report, said.effect, &joint.joint),
            };
            match (&said.done, &said.cannot_say) {
                (Some(_), None) => shares.written += share,
                (Some(_), Some(_)) => shares.written_in_part += share,
                (None, _) => shares.cannot_say += share,
            }
        }
        let is_told = shares.written != 0.0
            || shares.written_in_part != 0.0
            || shares.cannot_say != 0.0
            || shares.no_name != 0.0;
        if is_told {
            all.push(shares);
        }
    }
    all
}

fn shared_share(report: &Report, effect: &str, joint: &str) -> f64 {
    let shared = report.shared_effects.iter();
    let own = shared.filter(|shared| shared.effect.effect == effect);
    own.filter_map(|shared| Some(shared.joint_shares.get(joint)?.share))
        .sum()
}

fn told(
    effects: &[Said],
    joints: &[JointShares],
    notes: &[String],
    simulator: Simulator,
) -> String {
    let mut text = String::new();
    let format = simulator.name();
    for said in effects {
        let on = said.joint.as_deref().unwrap_or("arm");
        let of = format!("{} % of the gap", percent(said.share));
        let _ = match (&said.done, &said.cannot_say) {
            (Some(done), None) => writeln!(text, "{on}: {}: {done} ({of})", said.effect),
            (Some(done), Some(missing)) => {
                writeln!(
                    text,
                    "{on}: {}: {done}, in part ({of}): {missing}",
                    said.effect
                )
            }
            (None, why) => writeln!(
                text,
                "{on}: {}: not in {format} ({of}): {}",
                said.effect,
                why.as_deref().unwrap_or_default()
            ),
        };
    }
    for shares in joints {
        let mut parts = vec![format!(
            "{} % of the gap is written",
            percent(shares.written)
        )];
        let others = [
            (shares.written_in_part, "in part".to_owned()),
            (shares.cannot_say, format!("cannot be said in {format}")),
            (shares.no_name, "has no name".to_owned()),
        ];
        let others = others
            .into_iter()
            .filter(|(share, _)| share.abs() >= WORTH_A_WORD);
        parts.extend(others.map(|(share, words)| format!("{} % {words}", percent(share))));
        let _ = writeln!(text, "{}: {}", shares.joint, parts.join(", "));
    }
    for note in notes {
        let _ = writeln!(text, "{note}");
    }
    text
}

/// Half of the last per cent that is shown.
const WORTH_A_WORD: f64 = 0.005;
