//! `flexspline identify`: runs the papers' experiments, fits the joint model, writes the robot file.

mod execute;
mod fits;
mod report;
mod table;

use std::path::{Path, PathBuf};

use identification::experiment::{
    Experiment, friction_experiments, held_out_experiments, periodic_experiment,
    stiffness_experiments,
};
use identification::friction::JointFriction;
use identification::gravity::GravityFit;
use identification::held_out::HeldOutError;
use identification::periodic::PeriodicAnalysis;
use identification::stiffness::StiffnessFit;
use robot::{Robot, RobotFile, RobotJoint};
use serde::Serialize;

use clap::ValueEnum;

use crate::cli::{IdentifyArguments, IdentifyWhat, ModeArgument, SpeedsArgument};
use crate::error::CliError;
use crate::output::{print, write_json, write_text};
use execute::Rig;
use fits::Fits;

/// The robot file with what was identified.
pub const ROBOT_FILE: &str = "identified.toml";
/// The same for people.
const REPORT_FILE: &str = "report.html";

/// What was found at one joint.
#[derive(Clone, Debug, Serialize)]
struct JointResult {
    joint: String,
    friction: Option<JointFriction>,
    periodic: Option<PeriodicAnalysis>,
    stiffness: Option<StiffnessFit>,
    held_out: Option<HeldOut>,
    /// What could not be identified, and why.
    findings: Vec<String>,
}

/// How well motion that was never fitted is predicted.
#[derive(Clone, Debug, Serialize)]
struct HeldOut {
    /// By the robot file that identification started from.
    file: HeldOutError,
    /// By the identified one.
    identified: HeldOutError,
}

/// Everything found, for programs.
#[derive(Clone, Debug, Serialize)]
struct Identified {
    schema: u32,
    robot: String,
    seed: u64,
    robot_file: PathBuf,
    joints: Vec<JointResult>,
    gravity: Option<GravityFit>,
    /// Of the whole arm.
    findings: Vec<String>,
}

/// Runs what is not yet recorded, fits, and writes.
///
/// # Errors
/// [`CliError::Input`] for bad input, recordings that tell nothing included; what was recorded stays.
pub fn identify(arguments: &IdentifyArguments) -> Result<(), CliError> {
    let (file, source) = robot::load_file(&arguments.robot).map_err(CliError::input)?;
    let robot = file
        .clone()
        .build(source.clone())
        .map_err(CliError::input)?;
    let joints = chosen_joints(&robot, arguments)?;
    let rig = Rig::new(&robot, arguments)?;
    let plan: Vec<Experiment> = joints
        .iter()
        .flat_map(|joint| experiments(arguments, &robot, joint))
        .collect();
    if arguments.plan {
        return rig.print_plan(&plan);
    }
    rig.record_all(&plan)?;
    let mut fits = Fits::new(arguments, &rig, file, source);
    fits.fit(&joints)?;
    let path = arguments.out.join(ROBOT_FILE);
    write_robot(fits.file(), &path)?;
    report(arguments, &robot, fits.identified(path))
}

/// Identifies on the emulated robot in virtual time, or from what was recorded into the folder `out` already, and writes there.
/// `what` is typed as for the command.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if it was stopped.
pub fn identify_into(
    out: &Path,
    what: &str,
    robot: &str,
    joints: &[String],
    seed: u64,
) -> Result<(), CliError> {
    let what = IdentifyWhat::from_str(what, false).map_err(|_| {
        let all = IdentifyWhat::value_variants()
            .iter()
            .map(|what| what.name());
        let all = all.collect::<Vec<_>>().join(", ");
        CliError::Input(format!("`{what}` cannot be identified; there are {all}"))
    })?;
    identify(&IdentifyArguments {
        what,
        robot: robot.to_owned(),
        out: out.to_owned(),
        joint: joints.to_vec(),
        speeds: SpeedsArgument::Pa10_2005,
        plan: false,
        mode: ModeArgument::Lockstep,
        driver: "emulator".to_owned(),
        instance: "default".to_owned(),
        json: None,
        seed,
        quiet: true,
    })
}

fn report(
    arguments: &IdentifyArguments,
    robot: &Robot,
    identified: Identified,
) -> Result<(), CliError> {
    let json_path = arguments
        .out
        .join(format!("{}.json", arguments.what.name()));
    write_json(&identified, &json_path)?;
    let report_path = arguments.out.join(REPORT_FILE);
    write_report(&identified, robot, &report_path)?;
    if let Some(path) = &arguments.json {
        write_json(&identified, path)?;
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    if !arguments.quiet {
        let text = table::text(&identified, robot);
        print(&format!("{text}report: {}\n", report_path.display()))?;
    }
    Ok(())
}

fn chosen_joints<'a>(
    robot: &'a Robot,
    arguments: &IdentifyArguments,
) -> Result<Vec<&'a RobotJoint>, CliError> {
    let names = &arguments.joint;
    for name in names {
        if robot.joint_index(name).is_none() {
            return Err(CliError::Input(format!(
                "--joint {name}: robot `{}` has no such joint; its joints are {}",
                robot.name,
                robot.joint_names().join(", ")
            )));
        }
    }
    let chosen = |joint: &&RobotJoint| names.is_empty() || names.contains(&joint.name);
    let chosen: Vec<&RobotJoint> = robot.joints.iter().filter(chosen).collect();
    if arguments.what == crate::cli::IdentifyWhat::Gravity && chosen.len() < robot.joints.len() {
        return Err(CliError::Input(
            "--joint: gravity is identified from the motion of every joint; leave it out"
                .to_owned(),
        ));
    }
    Ok(chosen)
}

fn experiments(
    arguments: &IdentifyArguments,
    robot: &Robot,
    joint: &RobotJoint,
) -> Vec<Experiment> {
    let (what, protocol) = (arguments.what, arguments.speeds.into());
    let mut plan = Vec::new();
    if what.friction() {
        plan.extend(friction_experiments(joint, protocol));
    }
    if what.periodic() {
        plan.push(periodic_experiment(joint, protocol));
    }
    if what.stiffness() || what.gravity() {
        plan.extend(stiffness_experiments(robot, joint));
    }
    if what.held_out() {
        plan.extend(held_out_experiments(joint));
    }
    plan
}

fn write_robot(file: &RobotFile, path: &Path) -> Result<(), CliError> {
    let text = file.to_toml().map_err(CliError::input)?;
    write_text(path, &text)
}

fn write_report(identified: &Identified, robot: &Robot, path: &Path) -> Result<(), CliError> {
    let html = report::page(identified, robot).to_html();
    write_text(path, &html)
}
