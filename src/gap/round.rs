//! `flexspline gap round`: the whole round on the emulator, effect by effect: inject, diagnose, apply, and run the
//! control with the mended robot file on the plant that has the effect.

use comfy_table::{Table, presets};
use gap_diagnosis::Options;
use gap_report::{JointReport, Report, Verdict};
use report::number;
use robot::{Injection, Robot, RobotFile, Source};
use serde::Serialize;
use services::tracking::TrackingReport;
use twin::Robots;

use super::apply::links::with_links;
use super::apply::{with_effects, with_joint_tables};
use super::emulated::Course;
use crate::cli::GapRoundArguments;
use crate::error::CliError;
use crate::output::{print, write_json};

/// One effect's round, at the joint it was put into.
#[derive(Clone, Debug, Serialize)]
struct Round {
    joint: String,
    effect: &'static str,
    verdict: Verdict,
    /// What was named and applied.
    named: Vec<String>,
    /// Reference minus link, root mean square.
    position_rms_rad: Errors,
    /// What feedback had to add, joint side, root mean square.
    feedback_rms_nm: Errors,
}

/// On the second trajectory: one number for each controller and plant.
#[derive(Clone, Copy, Debug, Serialize)]
struct Errors {
    /// The robot file as it was, on the plant without the effect.
    without_effect: f64,
    /// The robot file as it was, on the plant with the effect.
    before: f64,
    /// The mended robot file, on the plant with the effect.
    after: f64,
}

/// Both trajectories of a round.
struct Courses {
    diagnosed: Course,
    tracked: Course,
}

/// Makes every round of the file of effects, prints the table.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if a loop stopped for safety.
pub fn round(arguments: &GapRoundArguments) -> Result<(), CliError> {
    let (text, source) = robot::load_text(&arguments.robot).map_err(CliError::input)?;
    let file = RobotFile::parse(&text, &arguments.robot).map_err(CliError::input)?;
    let robot = build(&text, &arguments.robot, &source)?;
    let text = with_joint_tables(&text, file, &robot).map_err(CliError::Input)?;
    let injections = robot::load_injection(&arguments.inject, &robot).map_err(CliError::input)?;
    let courses = Courses {
        diagnosed: course(arguments, &arguments.trajectory, &robot)?,
        tracked: course(arguments, &arguments.tracked, &robot)?,
    };
    let unchanged = courses.tracked.run(Robots::same(&robot), &[])?.tracking;
    let mut rounds = Vec::with_capacity(injections.len());
    for injection in &injections {
        let report = diagnosed(&robot, &courses.diagnosed, injection)?;
        let linked = with_links(&text, &robot, &report, None).map_err(CliError::Negative)?;
        let (mended, _) = with_effects(&linked.text, &report).map_err(CliError::Negative)?;
        let mended = build(&mended, "the mended robot file", &source)?;
        let tracked = |model| {
            let robots = Robots {
                plant: &robot,
                model,
            };
            let run = courses.tracked.run(robots, &[*injection])?;
            Ok::<_, CliError>(run.tracking)
        };
        let all = [unchanged.clone(), tracked(&robot)?, tracked(&mended)?];
        rounds.push(of_joint(&robot, injection, &report, &all));
    }
    if let Some(path) = &arguments.json {
        write_json(&rounds, path)?;
        if path.as_os_str() == "-" {
            return Ok(());
        }
    }
    print(&table(&rounds))
}

fn build(text: &str, name: &str, source: &Source) -> Result<Robot, CliError> {
    RobotFile::parse(text, name)
        .and_then(|file| file.build(source.clone()))
        .map_err(CliError::input)
}

fn course(arguments: &GapRoundArguments, name: &str, robot: &Robot) -> Result<Course, CliError> {
    Ok(Course {
        trajectory: motion::load(name, robot).map_err(CliError::input)?,
        duration_s: arguments.duration.as_secs_f64(),
        seed: arguments.seed,
    })
}

fn diagnosed(robot: &Robot, course: &Course, injection: &Injection) -> Result<Report, CliError> {
    let run = course.run(Robots::same(robot), &[*injection])?;
    let recordings = [(injection.effect.name().to_owned(), run.recording)];
    let diagnosis = gap_diagnosis::diagnose(robot, &recordings, &Options::default(), &|_| ());
    Ok(diagnosis.map_err(CliError::input)?.report)
}

/// What the round came to at the joint of the effect, or at the one that it disturbs most.
fn of_joint(
    robot: &Robot,
    injection: &Injection,
    report: &Report,
    tracked: &[TrackingReport; 3],
) -> Round {
    let most_disturbed = || {
        let disturbed =
            |joint: &usize| position_rms(&tracked[1], *joint) / position_rms(&tracked[0], *joint);
        (0..robot.joints.len()).max_by(|a, b| disturbed(a).total_cmp(&disturbed(b)))
    };
    let joint = injection.joint.or_else(most_disturbed).unwrap_or(0);
    let errors = |of: fn(&TrackingReport, usize) -> f64| Errors {
        without_effect: of(&tracked[0], joint),
        before: of(&tracked[1], joint),
        after: of(&tracked[2], joint),
    };
    let found: &JointReport = &report.joints[joint];
    let own = found.effects.iter().map(|named| &named.effect);
    let shared = report
        .shared_effects
        .iter()
        .map(|named| &named.effect.effect);
    Round {
        joint: robot.joints[joint].name.clone(),
        effect: injection.effect.name(),
        verdict: found.verdict,
        named: own.chain(shared).cloned().collect(),
        position_rms_rad: errors(position_rms),
        feedback_rms_nm: errors(feedback_rms),
    }
}

fn position_rms(tracking: &TrackingReport, joint: usize) -> f64 {
    tracking.joints[joint]
        .position_error_rad
        .map_or(f64::NAN, |error| error.rms)
}

fn feedback_rms(tracking: &TrackingReport, joint: usize) -> f64 {
    tracking.joints[joint]
        .feedback_torque_nm
        .map_or(f64::NAN, |error| error.rms)
}

fn table(rounds: &[Round]) -> String {
    let mut rows = Table::new();
    rows.load_preset(presets::UTF8_HORIZONTAL_ONLY).set_header([
        "joint",
        "effect put in",
        "named and applied",
        "tracking rms, mrad: before",
        "after",
        "without effect",
        "feedback rms, Nm: before",
        "after",
        "without effect",
    ]);
    for round in rounds {
        let (position, feedback) = (&round.position_rms_rad, &round.feedback_rms_nm);
        let mrad = |rad: f64| number(1e3 * rad, 3);
        rows.add_row([
            round.joint.clone(),
            round.effect.to_owned(),
            round.named.join(", "),
            mrad(position.before),
            mrad(position.after),
            mrad(position.without_effect),
            number(feedback.before, 3),
            number(feedback.after, 3),
            number(feedback.without_effect, 3),
        ]);
    }
    format!("{rows}\n")
}
