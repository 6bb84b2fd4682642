//! What was wanted, and whether it was reached: on the worst of the arms, with the gains of the papers.

use robot::published::Published;

use super::bench::Row;
use super::controllers::{HIGH_GAINS, IDENTIFIED, NO_MODEL, PUBLISHED};
use super::experiments::{ELBOW, JOINT_THREE, LEMNISCATE, SHOULDER};
use super::results::{Arm, Reached, Run, Target};
use super::shares::REVERSAL_S;

/// Mean error of the tool along the lemniscate.
const TOOL_MEAN_M: f64 = 0.003;
/// Largest after the start.
const TOOL_MAX_AFTER_START_M: f64 = 0.010;
/// Mean error of joint 3.
const JOINT_THREE_MEAN_RAD: f64 = 0.004;
/// How many times worse a joint may follow in the region of low stiffness.
const LOW_STIFFNESS_RATIO: f64 = 2.0;
/// Start of a motion, as long as a run's summary has it.
const START_S: f64 = 2.0;

/// Judges the experiments that were run.
///
/// `elbow` are the numbers of PA10-03, which alone tells the region of low stiffness from the rest.
pub fn judge(arms: &[Arm], published: &Published, elbow: &Published) -> Vec<Target> {
    let lemniscate = published.lemniscate.as_ref();
    let trapezoid = published.trapezoids.first();
    let elbow = elbow.trapezoids.first();
    let published_ratio = elbow
        .and_then(|numbers| Some(numbers.low_stiffness?.mean_error_rad / numbers.mean_error_rad));
    let mut targets = vec![
        target(
            "lemniscate: mean error of the tool",
            "m",
            lemniscate.map(|numbers| numbers.mean_error_m),
            TOOL_MEAN_M,
        )
        .of(arms, LEMNISCATE, |run, _| {
            Some((run.mean_error()?, by_joint(run)))
        }),
        target(
            "lemniscate: largest error of the tool after the start",
            "m",
            lemniscate.map(|numbers| numbers.largest_error_after_start_m),
            TOOL_MAX_AFTER_START_M,
        )
        .of(arms, LEMNISCATE, |run, _| {
            Some((run.end_effector_error_m?.max_after_start, by_joint(run)))
        }),
        target(
            "joint 3 trapezoid: mean error",
            "rad",
            trapezoid
                .filter(|_| lemniscate.is_some())
                .map(|numbers| numbers.mean_error_rad),
            JOINT_THREE_MEAN_RAD,
        )
        .of(arms, JOINT_THREE, |run, _| {
            Some((run.mean_error()?, start_and_rest(run)))
        }),
    ];
    for (experiment, name) in [
        (
            SHOULDER,
            "shoulder sweep: mean error in the low-stiffness region over the rest",
        ),
        (
            ELBOW,
            "elbow sweep: mean error in the low-stiffness region over the rest",
        ),
    ] {
        let target = target(name, "", published_ratio, LOW_STIFFNESS_RATIO);
        targets.push(target.of(arms, experiment, low_stiffness_ratio));
    }
    targets.push(
        target(
            "lemniscate: mean error over that with the published tables",
            "",
            None,
            1.0,
        )
        .of(arms, LEMNISCATE, |run, arm| {
            let tables = arm.run(LEMNISCATE, PUBLISHED)?.mean_error()?;
            Some((run.mean_error()? / tables, by_joint(run)))
        }),
    );
    targets.push(
        target(
            "elbow sweep: mean error over that with the published tables",
            "",
            None,
            1.0,
        )
        .of(arms, ELBOW, |run, arm| {
            let tables = arm.run(ELBOW, PUBLISHED)?.mean_error()?;
            Some((run.mean_error()? / tables, start_and_rest(run)))
        }),
    );
    targets.retain(|target| !target.reached.is_empty());
    targets
}

fn target(name: &str, unit: &'static str, published: Option<f64>, limit: f64) -> Target {
    Target {
        name: name.to_owned(),
        unit,
        published,
        limit,
        reached: Vec::new(),
    }
}

impl Target {
    /// Adds each controller with an identified model. `measure` gives the value, and what it is made of.
    fn of(
        mut self,
        arms: &[Arm],
        experiment: &str,
        measure: impl Fn(&Run, &Arm) -> Option<(f64, String)>,
    ) -> Self {
        let others = [PUBLISHED, NO_MODEL, HIGH_GAINS];
        let runs = arms.first().map_or(&[][..], |arm| &arm.runs);
        for run in runs.iter().filter(|run| run.experiment == experiment) {
            if others.contains(&run.controller.as_str()) {
                continue;
            }
            let each = |arm: &Arm| {
                let run = arm.run(experiment, &run.controller)?;
                let stopped = run.stopped.clone();
                let failed =
                    stopped.map(|why| (f64::INFINITY, format!("stopped for safety {why}")));
                failed.or_else(|| measure(run, arm))
            };
            let worst = arms
                .iter()
                .filter_map(each)
                .max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((value, made_of)) = worst else {
                continue;
            };
            let met = value <= self.limit;
            self.reached.push(Reached {
                controller: run.controller.clone(),
                value,
                met,
                missed_by: (!met).then_some(made_of),
            });
        }
        self
    }

    /// By this controller.
    pub fn by(&self, controller: &str) -> Option<&Reached> {
        self.reached
            .iter()
            .find(|reached| reached.controller == controller)
    }

    /// With the paper's control and the identified model.
    pub fn identified(&self) -> Option<&Reached> {
        self.by(IDENTIFIED)
    }
}

/// The one extension that does best on all targets together: the product of what it reached over what was wanted is least.
/// A ratio that is good because both of its sides are bad does not win so.
pub fn best_extension(targets: &[Target]) -> Option<&str> {
    let names = targets
        .first()?
        .reached
        .iter()
        .map(|reached| reached.controller.as_str());
    let score = |name: &str| {
        let reached = targets
            .iter()
            .filter_map(|target| Some((target.limit, target.by(name)?)));
        reached
            .map(|(limit, reached)| (reached.value / limit).ln())
            .sum::<f64>()
    };
    names
        .filter(|name| *name != IDENTIFIED)
        .min_by(|a, b| score(a).total_cmp(&score(b)))
}

fn low_stiffness_ratio(run: &Run, _: &Arm) -> Option<(f64, String)> {
    let sides = run.low_stiffness?;
    let made_of = format!(
        "mean error {:.1} mrad inside ({:.1} s), {:.1} mrad outside; mean feedback {:.2} Nm and {:.2} Nm",
        1e3 * sides.inside.mean_error_rad,
        sides.inside.seconds,
        1e3 * sides.outside.mean_error_rad,
        sides.inside.mean_feedback_nm,
        sides.outside.mean_feedback_nm
    );
    Some((sides.error_ratio(), made_of))
}

/// Which joints the tool's error comes from, the largest shares first.
fn by_joint(run: &Run) -> String {
    let mut shares: Vec<_> = run
        .shares
        .iter()
        .filter(|share| share.share.abs() >= 0.05)
        .collect();
    shares.sort_by(|a, b| b.share.total_cmp(&a.share));
    let each = shares.iter().map(|share| {
        format!(
            "{} {:.0} %, of which {:.0} % within {REVERSAL_S} s of its reversals ({:.0} % of the time)",
            share.joint,
            100.0 * share.share,
            100.0 * share.at_reversals / share.share,
            100.0 * share.reversing_time
        )
    });
    let each: Vec<String> = each.collect();
    format!("of the error's mean square: {}", each.join("; "))
}

/// The only joint that moves: how far it was off at the start and later.
fn start_and_rest(run: &Run) -> String {
    let Some(joint) = run.joints.first() else {
        return String::new();
    };
    let error_rad = |row: &Row| (row.reference_rad[joint.index] - row.link_rad[joint.index]).abs();
    let (start, later): (Vec<&Row>, Vec<&Row>) =
        run.rows.iter().partition(|row| row.time_s < START_S);
    let mean_mrad = |rows: &[&Row]| {
        1e3 * rows.iter().map(|row| error_rad(row)).sum::<f64>() / rows.len() as f64
    };
    let feedback_nm = joint
        .feedback_torque_nm
        .map_or(f64::NAN, |torque| torque.mean_magnitude);
    format!(
        "mean error {:.1} mrad in the first {START_S} s, {:.1} mrad later; mean feedback {feedback_nm:.2} Nm",
        mean_mrad(&start),
        mean_mrad(&later)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn target_with(limit: f64, reached: &[(&str, f64)]) -> Target {
        let reached = reached.iter().map(|(controller, value)| Reached {
            controller: (*controller).to_owned(),
            value: *value,
            met: *value <= limit,
            missed_by: None,
        });
        Target {
            reached: reached.collect(),
            ..target("", "", None, limit)
        }
    }

    #[test]
    fn the_best_extension_does_best_on_all_targets_together_and_is_never_the_papers_own_way() {
        let targets = [
            target_with(
                1.0,
                &[(IDENTIFIED, 0.1), ("a", 0.9), ("b", 0.8), ("c", 0.7)],
            ),
            target_with(
                1.0,
                &[(IDENTIFIED, 0.1), ("a", 0.9), ("b", 0.9), ("c", 1.1)],
            ),
        ];
        assert_eq!(best_extension(&targets), Some("b"));
        assert_eq!(
            best_extension(&[target_with(1.0, &[(IDENTIFIED, 0.1)])]),
            None
        );
        assert_eq!(best_extension(&[]), None);
    }
}
