//! Published beside ours: the tables, the same on the terminal and on the page.

use report::number;
use robot::published::Published;
use services::tracking::ErrorSummary;

use super::controllers::IDENTIFIED;
use super::experiments::{ELBOW, JOINT_THREE, LEMNISCATE, SHOULDER};
use super::region::{LowStiffness, Side};
use super::results::{Arm, JointRun, Reached, Reproduction, Run, Target};
use super::sheet::{PAPER, Sheet, mean_and_range};
use super::targets::best_extension;

/// A quantity, what the paper says about it, and where it is in a run.
struct Quantity {
    name: String,
    published: Option<String>,
    /// From SI to what the name says.
    scale: f64,
    of: Measure,
}

/// A value of a run, in SI.
type Measure = Box<dyn Fn(&Run) -> Option<f64>>;

impl Quantity {
    fn new(
        name: impl Into<String>,
        scale: f64,
        of: impl Fn(&Run) -> Option<f64> + 'static,
    ) -> Self {
        Self {
            name: name.into(),
            published: None,
            scale,
            of: Box::new(of),
        }
    }

    fn published(mut self, value: Option<f64>) -> Self {
        self.published = value.map(|value| number(value * self.scale, 3));
        self
    }
}

/// One experiment: controllers down, quantities across.
fn sheet(title: &str, arms: &[Arm], experiment: &str, quantities: &[Quantity]) -> Option<Sheet> {
    let controllers = controllers(arms, experiment);
    if controllers.is_empty() {
        return None;
    }
    let heading = quantities.iter().map(|quantity| quantity.name.as_str());
    let mut sheet = Sheet::new(title, [""].into_iter().chain(heading));
    if quantities
        .iter()
        .any(|quantity| quantity.published.is_some())
    {
        let numbers = quantities
            .iter()
            .map(|quantity| quantity.published.clone().unwrap_or_default());
        sheet
            .rows
            .push([PAPER.to_owned()].into_iter().chain(numbers).collect());
    }
    for controller in controllers {
        let runs: Vec<&Run> = arms
            .iter()
            .filter_map(|arm| arm.run(experiment, controller))
            .collect();
        let cells = quantities.iter().map(|quantity| cell(&runs, quantity));
        sheet
            .rows
            .push([controller.to_owned()].into_iter().chain(cells).collect());
    }
    for arm in arms {
        for run in arm.runs.iter().filter(|run| run.experiment == experiment) {
            if let Some(why) = &run.stopped {
                let (controller, seed) = (&run.controller, arm.seed);
                sheet.notes.push(format!(
                    "{controller}, arm {seed}: stopped for safety {why}"
                ));
            }
        }
    }
    Some(sheet)
}

fn controllers<'a>(arms: &'a [Arm], experiment: &str) -> Vec<&'a str> {
    let runs = arms.first().map_or(&[][..], |arm| &arm.runs);
    let runs = runs.iter().filter(|run| run.experiment == experiment);
    runs.map(|run| run.controller.as_str()).collect()
}

/// The value; over several arms their mean and range.
fn cell(runs: &[&Run], quantity: &Quantity) -> String {
    if runs.iter().any(|run| run.stopped.is_some()) {
        return "stopped".to_owned();
    }
    let values: Vec<f64> = runs
        .iter()
        .filter_map(|run| Some(quantity.scale * (quantity.of)(run)?))
        .collect();
    mean_and_range(&values, 3)
}

/// Every table of a reproduction, the judgement first.
pub fn all(
    reproduction: &Reproduction,
    published: &Published,
    elbow: &Published,
) -> Vec<(&'static str, Vec<Sheet>)> {
    let arms = &reproduction.arms;
    let lemniscate = [lemniscate_tool(arms, published), lemniscate_joints(arms)];
    let sections = [
        ("targets", vec![targets(&reproduction.targets)]),
        (LEMNISCATE, lemniscate.into_iter().flatten().collect()),
        (JOINT_THREE, Vec::from_iter(joint_three(arms, published))),
        (SHOULDER, Vec::from_iter(sweep(arms, SHOULDER, None))),
        (ELBOW, Vec::from_iter(sweep(arms, ELBOW, Some(elbow)))),
        ("gains", Vec::from_iter(gains(arms, published))),
    ];
    sections
        .into_iter()
        .filter(|(_, sheets)| !sheets.is_empty())
        .collect()
}

fn targets(targets: &[Target]) -> Sheet {
    let best = best_extension(targets);
    let columns = ["", PAPER, "wanted at most", IDENTIFIED, ""];
    let mut sheet = Sheet::new(
        "Targets, on the worst arm, with the papers' gains",
        columns
            .into_iter()
            .chain(best.map(|best| [best, ""]).into_iter().flatten()),
    );
    for target in targets {
        let judged = |reached: Option<&Reached>| match reached {
            Some(reached) => [
                with_unit(reached.value, target.unit),
                if reached.met { "met" } else { "missed" }.to_owned(),
            ],
            None => ["-".to_owned(), String::new()],
        };
        let mut row = vec![
            target.name.clone(),
            target
                .published
                .map_or("-".to_owned(), |value| with_unit(value, target.unit)),
            with_unit(target.limit, target.unit),
        ];
        let extension = best.and_then(|best| target.by(best));
        row.extend(judged(target.identified()));
        row.extend(best.map(|_| judged(extension)).into_iter().flatten());
        sheet.rows.push(row);
        for reached in target.identified().into_iter().chain(extension) {
            if let Some(by) = &reached.missed_by {
                sheet
                    .notes
                    .push(format!("{}, {}: {by}", target.name, reached.controller));
            }
        }
    }
    sheet
}

/// As people read it: lengths in mm, angles in mrad.
fn with_unit(value: f64, unit: &str) -> String {
    match unit {
        "m" | "rad" => format!("{} m{unit}", number(1e3 * value, 3)),
        "" => number(value, 3),
        _ => format!("{} {unit}", number(value, 3)),
    }
}

fn lemniscate_tool(arms: &[Arm], published: &Published) -> Option<Sheet> {
    let numbers = published.lemniscate?;
    let tool = |run: &Run| run.end_effector_error_m;
    let quantities = [
        Quantity::new("mean, mm", 1e3, move |run| Some(tool(run)?.mean))
            .published(Some(numbers.mean_error_m)),
        Quantity::new("largest, mm", 1e3, move |run| Some(tool(run)?.max))
            .published(Some(numbers.largest_error_m)),
        Quantity::new("largest after the first 2 s, mm", 1e3, move |run| {
            Some(tool(run)?.max_after_start)
        })
        .published(Some(numbers.largest_error_after_start_m)),
    ];
    sheet(
        "End-effector error along the lemniscate (Fig. 8)",
        arms,
        LEMNISCATE,
        &quantities,
    )
}

/// Joints down, and below each joint the controllers.
fn lemniscate_joints(arms: &[Arm]) -> Option<Sheet> {
    let first = arms
        .first()?
        .runs
        .iter()
        .find(|run| run.experiment == LEMNISCATE)?;
    let error = |of: fn(&ErrorSummary) -> f64| {
        move |joint: &JointRun| joint.position_error_rad.as_ref().map(of)
    };
    let torque = |of: fn(&ErrorSummary) -> f64| {
        move |joint: &JointRun| joint.feedback_torque_nm.as_ref().map(of)
    };
    let columns: [(&str, f64, OfJoint); 6] = [
        (
            "error, mrad: mean",
            1e3,
            Box::new(error(|sum| sum.mean_magnitude)),
        ),
        ("rms", 1e3, Box::new(error(|sum| sum.rms))),
        ("largest", 1e3, Box::new(error(|sum| sum.max))),
        (
            "feedback, Nm: mean",
            1.0,
            Box::new(torque(|sum| sum.mean_magnitude)),
        ),
        ("rms", 1.0, Box::new(torque(|sum| sum.rms))),
        ("largest", 1.0, Box::new(torque(|sum| sum.max))),
    ];
    let heading = ["joint", "controller"]
        .into_iter()
        .chain(columns.iter().map(|(name, ..)| *name));
    let mut sheet = Sheet::new(
        "Joints along the lemniscate: tracking error and feedback torque (Fig. 9)",
        heading,
    );
    sheet.words = 2;
    for (place, joint) in first.joints.iter().enumerate() {
        for (row, controller) in controllers(arms, LEMNISCATE).into_iter().enumerate() {
            let name = if row == 0 {
                joint.joint.clone()
            } else {
                String::new()
            };
            let runs: Vec<&Run> = arms
                .iter()
                .filter_map(|arm| arm.run(LEMNISCATE, controller))
                .collect();
            let cells = columns.iter().map(|(_, scale, of)| {
                let values = runs.iter().filter_map(|run| of(run.joints.get(place)?));
                let values: Vec<f64> = values.collect();
                number(scale * values.iter().sum::<f64>() / values.len() as f64, 3)
            });
            sheet.rows.push(
                [name, controller.to_owned()]
                    .into_iter()
                    .chain(cells)
                    .collect(),
            );
        }
    }
    if arms.len() > 1 {
        sheet.notes.push("Mean over the arms.".to_owned());
    }
    Some(sheet)
}

/// A value of one joint of a run, in SI.
type OfJoint = Box<dyn Fn(&JointRun) -> Option<f64>>;

fn joint_three(arms: &[Arm], published: &Published) -> Option<Sheet> {
    let error = |run: &Run| run.joints.first()?.position_error_rad;
    let torque = |run: &Run| run.joints.first()?.feedback_torque_nm;
    let quantities = [
        Quantity::new("mean error, mrad", 1e3, move |run| {
            Some(error(run)?.mean_magnitude)
        })
        .published(
            published
                .trapezoids
                .first()
                .map(|numbers| numbers.mean_error_rad),
        ),
        Quantity::new("rms error, mrad", 1e3, move |run| Some(error(run)?.rms)),
        Quantity::new("largest error, mrad", 1e3, move |run| Some(error(run)?.max)),
        Quantity::new("mean feedback, Nm", 1.0, move |run| {
            Some(torque(run)?.mean_magnitude)
        }),
        Quantity::new("largest feedback, Nm", 1.0, move |run| {
            Some(torque(run)?.max)
        }),
    ];
    sheet(
        "Joint 3, 1.0 rad at 0.1 rad/s from the greatest gravity load (Fig. 10)",
        arms,
        JOINT_THREE,
        &quantities,
    )
}

/// `numbers` are PA10-03's, for the joint it speaks of.
fn sweep(arms: &[Arm], experiment: &'static str, numbers: Option<&Published>) -> Option<Sheet> {
    let numbers = numbers.and_then(|numbers| numbers.trapezoids.first());
    let low = numbers.and_then(|numbers| numbers.low_stiffness);
    let inside = |of: fn(&Side) -> f64| move |run: &Run| Some(of(&run.low_stiffness?.inside));
    let outside = |of: fn(&Side) -> f64| move |run: &Run| Some(of(&run.low_stiffness?.outside));
    let error: fn(&Side) -> f64 = |side| side.mean_error_rad;
    let feedback: fn(&Side) -> f64 = |side| side.mean_feedback_nm;
    let published_ratio = || Some(low?.mean_error_rad / numbers?.mean_error_rad);
    let quantities = [
        Quantity::new("mean error outside, mrad", 1e3, outside(error))
            .published(numbers.map(|n| n.mean_error_rad)),
        Quantity::new("mean error inside, mrad", 1e3, inside(error))
            .published(low.map(|low| low.mean_error_rad)),
        Quantity::new("inside over outside", 1.0, |run| {
            run.low_stiffness.as_ref().map(LowStiffness::error_ratio)
        })
        .published(published_ratio()),
        Quantity::new("largest error, mrad", 1e3, |run| {
            let sides = run.low_stiffness?;
            Some(sides.inside.max_error_rad.max(sides.outside.max_error_rad))
        }),
        Quantity::new("mean feedback outside, Nm", 1.0, outside(feedback))
            .published(numbers.and_then(|n| n.feedback_torque_nm)),
        Quantity::new("mean feedback inside, Nm", 1.0, inside(feedback))
            .published(low.map(|low| low.feedback_torque_nm)),
        Quantity::new(
            "largest feedback inside, Nm",
            1.0,
            inside(|side| side.max_feedback_nm),
        ),
        Quantity::new("time inside, s", 1.0, inside(|side| side.seconds)),
    ];
    let title = format!(
        "{experiment}, there and back at 0.1 rad/s: inside and outside the region of low stiffness"
    );
    sheet(&title, arms, experiment, &quantities)
}

fn gains(arms: &[Arm], published: &Published) -> Option<Sheet> {
    let factor = published
        .lemniscate
        .map(|numbers| numbers.gain_factor_without_model);
    let paper = factor.map_or(String::new(), |factor| format!("at least {factor}"));
    let mut sheet = Sheet::new(
        "Gains that follow as well without the model, as a factor on the papers' gains",
        [
            "",
            "gains that grow",
            "error to reach",
            PAPER,
            "factor",
            "best without model",
            "no higher, because",
        ],
    );
    sheet.words = 2;
    for arm in arms {
        for search in &arm.gain_searches {
            let found = &search.found;
            let seed = if arms.len() > 1 {
                format!(", arm {}", arm.seed)
            } else {
                String::new()
            };
            let best = found
                .best()
                .map(|(factor, error)| format!("{} at {factor:.1}", with_unit(error, search.unit)));
            sheet.rows.push(vec![
                format!("{}{seed}", search.experiment),
                if search.derivative_too {
                    "both"
                } else {
                    "proportional"
                }
                .to_owned(),
                with_unit(found.target_error, search.unit),
                paper.clone(),
                found.factor(),
                best.unwrap_or("-".to_owned()),
                found.end().unwrap_or_default(),
            ]);
        }
    }
    (!sheet.rows.is_empty()).then_some(sheet)
}
