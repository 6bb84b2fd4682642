//! What was measured, as programs read it. Torque and position are joint side.

use std::path::PathBuf;

use robot::Robot;
use serde::Serialize;
use services::tracking::ErrorSummary;

use super::bench::{Row, Tracked};
use super::gain_search::Found;
use super::region::LowStiffness;
use super::shares::{JointShare, of_tool_error};

/// A paper's experiments on one or several arms.
#[derive(Clone, Debug, Serialize)]
pub struct Reproduction {
    /// Of this layout.
    pub schema: u32,
    /// Its name.
    pub paper: String,
    /// The robot file that the arms deviate from.
    pub robot: String,
    /// Each emulated arm.
    pub arms: Vec<Arm>,
    /// What was wanted, and whether it was reached.
    pub targets: Vec<Target>,
}

/// One emulated arm.
#[derive(Clone, Debug, Serialize)]
pub struct Arm {
    /// Its seed.
    pub seed: u64,
    /// The robot file identified on it.
    pub identified: PathBuf,
    /// Every experiment with every controller.
    pub runs: Vec<Run>,
    /// Gains without the model.
    pub gain_searches: Vec<GainSearch>,
}

impl Arm {
    /// The run of a controller in an experiment.
    pub fn run(&self, experiment: &str, controller: &str) -> Option<&Run> {
        self.runs
            .iter()
            .find(|run| run.experiment == experiment && run.controller == controller)
    }
}

/// One motion with one controller.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    /// The motion.
    pub experiment: String,
    /// What followed it.
    pub controller: String,
    /// When and why the loop stopped for safety, if it did; sums end there.
    pub stopped: Option<String>,
    /// Distance of the tool from its reference, in metres.
    pub end_effector_error_m: Option<ErrorSummary>,
    /// The joints that move in this experiment.
    pub joints: Vec<JointRun>,
    /// Inside and outside the region of low stiffness, where one joint moves through it.
    pub low_stiffness: Option<LowStiffness>,
    /// What the tool's error is made of.
    pub shares: Vec<JointShare>,
    /// For figures.
    #[serde(skip)]
    pub rows: Vec<Row>,
}

/// One joint in a run.
#[derive(Clone, Debug, Serialize)]
pub struct JointRun {
    /// Its name.
    pub joint: String,
    /// Its place in the chain.
    #[serde(skip)]
    pub index: usize,
    /// Reference minus link position.
    pub position_error_rad: Option<ErrorSummary>,
    /// What the feedback had to add.
    pub feedback_torque_nm: Option<ErrorSummary>,
    /// Of all cycles, in how many its command was cut to the drive's limit.
    pub limited: f64,
}

/// By what the gains must grow without the model.
#[derive(Clone, Debug, Serialize)]
pub struct GainSearch {
    /// The motion.
    pub experiment: String,
    /// Whether the derivative gains grow too.
    pub derivative_too: bool,
    /// Unit of the errors.
    pub unit: &'static str,
    /// The result.
    pub found: Found,
}

/// Something to be reached.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Target {
    /// What.
    pub name: String,
    /// Unit of the numbers, empty for a pure number.
    pub unit: &'static str,
    /// What the paper reached, where it says so.
    pub published: Option<f64>,
    /// At most this.
    pub limit: f64,
    /// By each controller.
    pub reached: Vec<Reached>,
}

/// How one controller did.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reached {
    /// Which.
    pub controller: String,
    /// On the worst of the arms.
    pub value: f64,
    /// Whether that is within the limit.
    pub met: bool,
    /// By what it was missed, from the numbers of that arm.
    pub missed_by: Option<String>,
}

impl Run {
    /// What came of a run; `joint` is the only one that moves, none if all do.
    pub fn new(
        experiment: &str,
        controller: &str,
        tracked: Tracked,
        robot: &Robot,
        joint: Option<usize>,
    ) -> Self {
        let moving = |index: usize| joint.is_none_or(|joint| joint == index);
        let joints = tracked.sums.joints.into_iter().enumerate();
        let joints = joints
            .filter(|(index, _)| moving(*index))
            .map(|(index, sums)| JointRun {
                joint: sums.joint,
                index,
                position_error_rad: sums.position_error_rad,
                feedback_torque_nm: sums.feedback_torque_nm,
                limited: tracked.limited[index],
            });
        Self {
            experiment: experiment.to_owned(),
            controller: controller.to_owned(),
            stopped: tracked.stopped,
            end_effector_error_m: tracked.sums.end_effector_error_m,
            joints: joints.collect(),
            low_stiffness: joint.and_then(|joint| LowStiffness::of(&tracked.rows, robot, joint)),
            shares: match joint {
                None => of_tool_error(&tracked.rows, robot),
                Some(_) => Vec::new(),
            },
            rows: tracked.rows,
        }
    }

    /// The joint whose command was cut to its limit most often, and how often.
    pub fn most_limited(&self) -> Option<&JointRun> {
        self.joints
            .iter()
            .max_by(|a, b| a.limited.total_cmp(&b.limited))
    }

    /// Mean error of the tool, or of the only joint that moves; none if the loop stopped for safety.
    pub fn mean_error(&self) -> Option<f64> {
        let error = match self.joints.as_slice() {
            [joint] => joint.position_error_rad.map(|error| error.mean_magnitude),
            _ => self.end_effector_error_m.map(|error| error.mean),
        };
        error.filter(|_| self.stopped.is_none())
    }
}
