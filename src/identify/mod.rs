//! `flexspline identify`: runs the papers' experiments, fits the joint model, writes the robot file.

mod execute;
mod report;
mod table;

use std::path::{Path, PathBuf};

use identification::IdentificationError;
use identification::experiment::{
    Experiment, FRICTION_SPEEDS_RAD_S, FRICTION_TRIALS, friction_experiments, periodic_experiment,
    stiffness_experiments,
};
use identification::friction::{JointFriction, SETTLING_S, identify_friction, measure_steady};
use identification::periodic::{PeriodicAnalysis, analyse_periodic};
use identification::stiffness::{StiffnessFit, Sweep, fit_stiffness};
use robot::{Effect, Robot, RobotFile, RobotJoint};
use serde::Serialize;

use crate::cli::{IdentifyArguments, IdentifyWhat};
use crate::error::CliError;
use execute::Rig;

/// Points of the look-up table that is fed forward: cycles up to a hundred a revolution keep 95 % of their amplitude.
const TABLE_POINTS: usize = 1024;
/// The robot file with what was identified.
const ROBOT_FILE: &str = "identified.toml";
/// The same for people.
const REPORT_FILE: &str = "report.html";

/// What was found at one joint.
#[derive(Clone, Debug, Serialize)]
struct JointResult {
    joint: String,
    friction: Option<JointFriction>,
    periodic: Option<PeriodicAnalysis>,
    stiffness: Option<StiffnessFit>,
    /// What could not be identified, and why.
    findings: Vec<String>,
}

/// Everything found, for programs.
#[derive(Clone, Debug, Serialize)]
struct Identified {
    schema: u32,
    robot: String,
    seed: u64,
    robot_file: PathBuf,
    joints: Vec<JointResult>,
}

/// Runs what is not yet recorded, fits, and writes.
///
/// # Errors
/// [`CliError::Input`] for bad input, recordings that tell nothing included; what was recorded stays.
pub fn identify(arguments: &IdentifyArguments) -> Result<(), CliError> {
    let (mut file, source) = robot::load_file(&arguments.robot).map_err(CliError::input)?;
    let robot = file
        .clone()
        .build(source.clone())
        .map_err(CliError::input)?;
    let joints = chosen_joints(&robot, &arguments.joint)?;
    let rig = Rig::new(&robot, &arguments.robot, &arguments.out, arguments.seed)?;
    let plan: Vec<Experiment> = joints
        .iter()
        .flat_map(|joint| experiments(arguments.what, joint))
        .collect();
    rig.record_all(&plan)?;
    let mut results = Vec::new();
    for joint in joints {
        let mut result = fit(arguments.what, &rig, &robot, joint)?;
        change_robot(&mut file, &result);
        if arguments.what.stiffness() {
            let model = file
                .clone()
                .build(source.clone())
                .map_err(CliError::input)?;
            fit_load_torque(&rig, &model, joint, &mut result)?;
            change_robot(&mut file, &result);
        }
        results.push(result);
    }
    let path = arguments.out.join(ROBOT_FILE);
    write_robot(&file, &path)?;
    let identified = Identified {
        schema: 1,
        robot: robot.name.clone(),
        seed: arguments.seed,
        robot_file: path,
        joints: results,
    };
    let json_path = arguments
        .out
        .join(format!("{}.json", arguments.what.name()));
    write_json(&identified, &json_path)?;
    let report_path = arguments.out.join(REPORT_FILE);
    write_report(&identified, &robot, &report_path)?;
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return print_json(&identified);
    }
    if let Some(path) = &arguments.json {
        write_json(&identified, path)?;
    }
    print!("{}", table::text(&identified, &robot));
    println!("report: {}", report_path.display());
    Ok(())
}

fn chosen_joints<'a>(robot: &'a Robot, names: &[String]) -> Result<Vec<&'a RobotJoint>, CliError> {
    for name in names {
        if robot.joint_index(name).is_none() {
            let known: Vec<&str> = robot
                .joints
                .iter()
                .map(|joint| joint.name.as_str())
                .collect();
            return Err(CliError::Input(format!(
                "--joint {name}: robot `{}` has no such joint; its joints are {}",
                robot.name,
                known.join(", ")
            )));
        }
    }
    let chosen = |joint: &&RobotJoint| names.is_empty() || names.contains(&joint.name);
    Ok(robot.joints.iter().filter(chosen).collect())
}

fn experiments(what: IdentifyWhat, joint: &RobotJoint) -> Vec<Experiment> {
    let mut plan = Vec::new();
    if what.friction() {
        plan.extend(friction_experiments(
            joint,
            &FRICTION_SPEEDS_RAD_S,
            FRICTION_TRIALS,
        ));
    }
    if what.periodic() {
        plan.push(periodic_experiment(joint));
    }
    if what.stiffness() {
        plan.extend(stiffness_experiments(joint));
    }
    plan
}

fn fit(
    what: IdentifyWhat,
    rig: &Rig<'_>,
    robot: &Robot,
    joint: &RobotJoint,
) -> Result<JointResult, CliError> {
    let name = &joint.name;
    let mut result = JointResult {
        joint: name.clone(),
        friction: None,
        periodic: None,
        stiffness: None,
        findings: Vec::new(),
    };
    if what.friction() {
        let plan = friction_experiments(joint, &FRICTION_SPEEDS_RAD_S, FRICTION_TRIALS);
        let recordings = rig.read(&plan)?;
        let measured =
            measure_steady(&recordings, robot, name, SETTLING_S).map_err(CliError::input)?;
        result.friction = Some(identify_friction(name, measured).map_err(CliError::input)?);
    }
    if what.periodic() {
        let recordings = rig.read(&[periodic_experiment(joint)])?;
        result.periodic =
            Some(analyse_periodic(&recordings, robot, name, SETTLING_S).map_err(CliError::input)?);
    }
    Ok(result)
}

/// Table V with the friction that `model` knows. A joint that gravity hardly loads keeps what its file says.
fn fit_load_torque(
    rig: &Rig<'_>,
    model: &Robot,
    joint: &RobotJoint,
    result: &mut JointResult,
) -> Result<(), CliError> {
    let plan = stiffness_experiments(joint);
    let recordings = rig.read(&plan)?;
    let sweeps: Vec<Sweep<'_>> = recordings
        .iter()
        .zip(&plan)
        .map(|(recording, experiment)| Sweep {
            recording,
            payload: experiment.payload,
        })
        .collect();
    match fit_stiffness(&sweeps, model, &joint.name) {
        Ok(fitted) => result.stiffness = Some(fitted),
        Err(error @ IdentificationError::SmallGravityRange { .. }) => {
            result.findings.push(error.to_string());
        }
        Err(error) => return Err(CliError::input(error)),
    }
    Ok(())
}

/// What was found in place of what stood there.
fn change_robot(file: &mut RobotFile, result: &JointResult) {
    let found = file
        .joints
        .iter_mut()
        .find(|joint| joint.name == result.joint);
    if let Some(joint) = found {
        if let Some(stiffness) = &result.stiffness {
            joint.load_torque = Some(stiffness.table());
        }
        if let Some(friction) = result
            .friction
            .as_ref()
            .and_then(JointFriction::robot_friction)
        {
            joint.direction_friction = Some(friction);
            joint
                .effects
                .retain(|effect| !is_friction_over_velocity(effect));
        }
        if let Some(periodic) = &result.periodic {
            joint.friction_table = Some(periodic.friction_table(TABLE_POINTS));
            let periodic =
                |effect: &Effect| matches!(effect, Effect::PositionDependentFriction { .. });
            joint.effects.retain(|effect| !periodic(effect));
        }
    }
}

fn write_robot(file: &RobotFile, path: &Path) -> Result<(), CliError> {
    let text = toml::to_string(file).map_err(CliError::input)?;
    std::fs::write(path, text).map_err(|error| cannot_write(path, &error))
}

/// What the measured curve holds already: everything in a robot file adds up.
fn is_friction_over_velocity(effect: &Effect) -> bool {
    matches!(
        effect,
        Effect::CoulombFriction { .. }
            | Effect::ViscousFriction { .. }
            | Effect::QuadraticFriction { .. }
            | Effect::StribeckFriction { .. }
            | Effect::AsymmetricFriction { .. }
    )
}

fn write_report(identified: &Identified, robot: &Robot, path: &Path) -> Result<(), CliError> {
    let html = report::page(identified, robot, None).to_html();
    std::fs::write(path, html).map_err(|error| cannot_write(path, &error))
}

fn write_json(identified: &Identified, path: &Path) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(identified).map_err(CliError::input)?;
    std::fs::write(path, text + "\n").map_err(|error| cannot_write(path, &error))
}

fn print_json(identified: &Identified) -> Result<(), CliError> {
    let text = serde_json::to_string_pretty(identified).map_err(CliError::input)?;
    println!("{text}");
    Ok(())
}

fn cannot_write(path: &Path, error: &std::io::Error) -> CliError {
    CliError::Input(format!(
        "cannot write {}: {error}; choose a place with --out or --json",
        path.display()
    ))
}
