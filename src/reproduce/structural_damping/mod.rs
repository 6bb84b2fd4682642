//! `flexspline reproduce structural-damping`: the torque paper's experiment on the emulated SHD-17 joint.
//!
//! As in SD, section IV: one data set to find the parameters (Figs. 7 and 8), another to judge (Figs. 9 and 10), of the same
//! joint. Both are recorded in virtual time; calibration and comparison see the recordings and the robot file only. The
//! judged motion comes again on joints that have changed since: [`changes`]. Then the joint is pushed, and left alone, with
//! what was calibrated: [`collisions`]. Each seed is another joint.

mod changes;
mod claims;
mod collisions;
mod least_maximum;
mod motions;
mod scores;
mod stage;

use std::fs;
use std::path::{Path, PathBuf};

use estimators::calibrate::{Reference, calibrate};
use estimators::compare::Judge;
use report::Section;
use robot::{EstimatorParameters, Robot};
use serde::Serialize;

use super::sheet::Sheet;
use crate::cli::{Paper, ReproduceArguments};
use crate::error::CliError;
use crate::estimate::compare::{Compared, JointCompared, one};
use crate::estimate::{page, table};
use crate::output::{cannot_write, print, write_json, write_text};
use changes::Changed;
use claims::Statement;
use collisions::{Collisions, Pushed};
use least_maximum::least_maximum_nm;
use motions::Motion;
use stage::Stage;

/// With the figures, in the folder.
const PAGE_FILE: &str = "report.html";
/// The joint of the paper.
const ROBOT: &str = "shd17";
/// The judged motion without any change.
const UNCHANGED: &str = "as calibrated";
/// The same by estimators that never saw a torque sensor: calibrated on known bodies in slow motion, judged with the sensor.
const SENSORLESS: &str = "calibrated on gravity";

/// Everything found, for programs.
#[derive(Serialize)]
struct Reproduction {
    schema: u32,
    paper: &'static str,
    joints: Vec<Joint>,
    /// One for each joint.
    comparison: Compared,
    /// Of all joints together.
    collisions: Collisions,
}

/// One seed's joint.
#[derive(Serialize)]
struct Joint {
    seed: u64,
    robot_file: PathBuf,
    #[serde(skip)]
    fits: String,
    statements: Vec<Statement>,
    /// The first is the joint as it was calibrated, the second by gravity alone.
    changed: Vec<Changed>,
    collisions: Collisions,
}

/// What is moved: to calibrate, to judge, and to count false alarms.
struct Motions {
    calibration: Motion,
    judgement: Motion,
    alone: Motion,
}

/// As long as the results are documented for.
const MOTIONS: Motions = Motions {
    calibration: motions::CALIBRATION,
    judgement: motions::JUDGEMENT,
    alone: motions::ROUTINE,
};

/// Records, calibrates, compares, judges, prints and writes.
///
/// # Errors
/// [`CliError::Input`] for a folder that cannot be written, [`CliError::Negative`] if the loop stopped.
pub fn reproduce(arguments: &ReproduceArguments) -> Result<(), CliError> {
    let paper = arguments.paper.name();
    if arguments.identified.is_some() {
        return Err(CliError::Input(format!(
            "--identified: {paper} needs no identified robot file, it calibrates the joint of its own; leave it out"
        )));
    }
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => Path::new("reproduce").join(paper),
    };
    let seeds = arguments.seed..arguments.seed.saturating_add(arguments.arms);
    let found = experiments(&MOTIONS, &out, seeds)?;
    if let Some(path) = &arguments.json {
        write_json(&found, path)?;
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    for joint in &found.joints {
        print(&format!("seed {}, {}", joint.seed, joint.fits))?;
    }
    for (_, _, sheets) in found.sections() {
        for sheet in sheets {
            print(&format!("{}\n", sheet.text()))?;
        }
    }
    print(&format!("report: {}\n", out.join(PAGE_FILE).display()))
}

/// Every joint, into a folder with one of its own for each.
fn experiments(
    motions: &Motions,
    out: &Path,
    seeds: impl Iterator<Item = u64>,
) -> Result<Reproduction, CliError> {
    let (mut joints, mut compared) = (Vec::new(), Vec::new());
    for seed in seeds {
        let (joint, judged) = experiment(motions, &out.join(format!("seed{seed}")), seed)?;
        joints.push(joint);
        compared.push(judged);
    }
    let collisions: Vec<&Collisions> = joints.iter().map(|joint| &joint.collisions).collect();
    let reproduction = Reproduction {
        schema: 3,
        paper: Paper::StructuralDamping.name(),
        collisions: Collisions::together(&collisions),
        joints,
        comparison: Compared {
            schema: 1,
            robot: ROBOT.to_owned(),
            joints: compared,
        },
    };
    let mut html = page::page(&reproduction.comparison);
    for (id, title, sheets) in reproduction.sections() {
        let section = Section::new(id, title);
        html = html.section(
            sheets
                .iter()
                .fold(section, |section, sheet| section.table(sheet.html())),
        );
    }
    write_text(&out.join(PAGE_FILE), &html.to_html())?;
    write_json(&reproduction, &out.join("reproduce.json"))?;
    Ok(reproduction)
}

/// Everything about one joint.
fn experiment(
    motions: &Motions,
    out: &Path,
    seed: u64,
) -> Result<(Joint, JointCompared), CliError> {
    fs::create_dir_all(out).map_err(|error| cannot_write(out, &error))?;
    let robot = robot::load(ROBOT).map_err(CliError::input)?;
    let stage = Stage {
        robot: &robot,
        out,
        seed,
    };
    let (_, first) = stage.record(&motions.calibration, &[], motions.calibration.name)?;
    let (path, second) = stage.record(&motions.judgement, &[], motions.judgement.name)?;
    let joint = &robot.joints[0];
    let calibrated_on = |reference| calibrate(&first, &robot, joint, reference);
    let (by_sensor, by_gravity) = rayon::join(
        || calibrated_on(Reference::JointTorque),
        || calibrated_on(Reference::Gravity),
    );
    let by_sensor = by_sensor.map_err(CliError::input)?;
    let by_gravity = by_gravity.map_err(CliError::input)?;
    let fits = table::fits(&by_sensor);
    let robot_file = out.join("calibrated.toml");
    let calibrated = equipped(by_sensor.parameters, Some(&robot_file))?;
    let judged =
        one(&path, &second, &calibrated, &calibrated.joints[0]).map_err(CliError::Input)?;
    let judge = Judge::new(&second, &robot, joint).map_err(CliError::input)?;
    let mut changed = vec![
        Changed {
            change: UNCHANGED,
            estimators: judged.estimators.clone(),
        },
        changes::scored(SENSORLESS, &second, &equipped(by_gravity.parameters, None)?)?,
    ];
    changed.extend(changes::run(&stage, &calibrated, &motions.judgement)?);
    let pushed = Pushed {
        stage: &stage,
        model: &calibrated,
    };
    let collisions = pushed.collide(&[&motions.calibration, &motions.judgement], &motions.alone)?;
    let joint = Joint {
        seed,
        robot_file,
        fits,
        statements: claims::judge(&judged.estimators, least_maximum_nm(&judge, joint)),
        changed,
        collisions,
    };
    Ok((joint, judged))
}

/// The joint's robot with calibrated estimators, written to a file where one is named.
fn equipped(parameters: EstimatorParameters, path: Option<&Path>) -> Result<Robot, CliError> {
    let (mut file, source) = robot::load_file(ROBOT).map_err(CliError::input)?;
    file.joints[0].estimators = Some(parameters);
    if let Some(path) = path {
        write_text(path, &file.to_toml().map_err(CliError::input)?)?;
    }
    file.build(source).map_err(CliError::input)
}

impl Reproduction {
    /// Every table, with its section's place and title.
    fn sections(&self) -> [(&'static str, &'static str, Vec<Sheet>); 4] {
        let statements: Vec<&[Statement]> = self
            .joints
            .iter()
            .map(|joint| &joint.statements[..])
            .collect();
        [
            (
                "scores",
                "All joints",
                scores::sheets(&self.comparison.joints),
            ),
            (
                "claims",
                "What holds here",
                vec![claims::sheet(&statements)],
            ),
            ("changes", "Changed joints", changes::sheets(&self.joints)),
            ("contacts", "Contacts", vec![self.collisions.sheet()]),
        ]
    }
}

#[cfg(test)]
mod tests {
    use estimators::Kind;

    use super::*;

    #[test]
    fn the_short_form_calibrates_judges_and_finds_pushes() {
        let out = tempfile::tempdir().expect("a folder");
        let short = |motion: Motion, duration_s| Motion {
            duration_s,
            ..motion
        };
        let motions = Motions {
            // from half a minute on: some swings, then the slow sweep that gravity is known in
            calibration: Motion {
                position_rad: |time_s| (motions::CALIBRATION.position_rad)(time_s + 30.0),
                ..short(motions::CALIBRATION, 34.0)
            },
            judgement: short(motions::JUDGEMENT, 20.0),
            alone: short(motions::ROUTINE, 10.0),
        };
        let found = experiments(&motions, out.path(), 4..5).expect("runs");
        let scores = &found.comparison.joints[0].estimators;
        let rms_nm = |kind| {
            let score = scores.iter().find(|found| found.score.kind == kind);
            score
                .expect("there")
                .score
                .dynamic
                .expect("it moved")
                .rms_nm
        };
        assert!(rms_nm(Kind::Fusion) < rms_nm(Kind::Compliance));
        let joint = &found.joints[0];
        assert_eq!(joint.statements.len(), 11);
        // as calibrated, on gravity, and four changes
        assert_eq!(joint.changed.len(), 6);
        for changed in &joint.changed {
            let known = changed
                .estimators
                .iter()
                .filter(|found| found.score.all.is_some());
            assert_eq!(known.count(), Kind::ALL.len(), "{}", changed.change);
        }
        let hardest = found.collisions.detections.last().expect("sizes");
        assert!(hardest.found.of > 1);
        assert_eq!(hardest.found.hits, hardest.found.of, "{hardest:?}");
        assert_eq!(found.collisions.false_alarms.alarms, 0);
        for file in ["seed4/calibrated.toml", "report.html", "reproduce.json"] {
            assert!(out.path().join(file).is_file(), "{file}");
        }
    }
}
