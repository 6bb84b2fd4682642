//! The experiments of a paper on one arm: every motion with every controller, and the search for gains.

use std::path::PathBuf;

use rayon::prelude::*;
use robot::published::Published;
use robot::{Control, Robot};

use super::bench::{Bench, Course};
use super::controllers::{Controller, HIGH_GAINS, IDENTIFIED, with_models, without_model};
use super::courses;
use super::gain_search::{Tried, search};
use super::results::{Arm, GainSearch, Run};
use crate::cli::SpeedsArgument;
use crate::error::CliError;

/// Names of the experiments.
pub const LEMNISCATE: &str = "lemniscate";
/// See [`courses::joint_three`].
pub const JOINT_THREE: &str = "joint 3 trapezoid";
/// See [`courses::sweep`].
pub const SHOULDER: &str = "shoulder sweep";
/// The same of joint 4.
pub const ELBOW: &str = "elbow sweep";

/// Where one joint moves, the others are held by so many times their proportional gain: neither paper tracks with more
/// than the joints it speaks of, and an arm without a model would collapse.
const HOLD_FACTOR: f64 = 10.0;

/// A joint that is at its torque limit in more than this share of the cycles rings. With the gains of Table VI joint 6 of
/// the emulated arm is there in 2 % already, at its reversals.
const LIMITED_MAX: f64 = 0.1;

/// One motion, and the gains to follow it with.
pub struct Experiment {
    /// In tables.
    pub name: &'static str,
    /// The only joint that moves; none if all do.
    pub joint: Option<usize>,
    course: Course,
    /// Gains of that joint, joint side, where they are not the robot file's.
    gains: Option<[f64; 2]>,
    /// Whether the gains are searched that do without the model.
    is_searched: bool,
}

/// At the gains of PA10-03 the elbow's motor may stand until the feedback is stronger than friction: its 6 Nm inside the region of
/// low stiffness are 0.24 rad at 25 Nm/rad. Twice that.
const SOFT_STANDSTILL_RAD: f64 = 0.5;
/// At those gains a model that is off by a fifth of the gravity torque lets the elbow fall. The sweep is from one end to the other,
/// so no error is larger than its range.
const SOFT_FOLLOWING_RAD: f64 = std::f64::consts::PI;

/// All experiments of a paper.
///
/// # Errors
/// [`CliError::Input`] if the robot cannot do them.
pub fn of_paper(
    speeds: SpeedsArgument,
    published: &Published,
    robot: &Robot,
) -> Result<Vec<Experiment>, CliError> {
    let range_rad = published.stiffness_experiment.range_rad;
    let sweep = |name, joint_name: &str, speed_rad_s, gains, is_searched| {
        let joint = robot.joint_index(joint_name).ok_or_else(|| {
            CliError::Input(format!("robot `{}` has no {joint_name}", robot.name))
        })?;
        let course =
            courses::sweep(robot, joint, range_rad, speed_rad_s).map_err(CliError::input)?;
        Ok(Experiment {
            name,
            joint: Some(joint),
            course,
            gains,
            is_searched,
        })
    };
    let trapezoid = published
        .trapezoids
        .first()
        .ok_or_else(|| CliError::Input("the published numbers have no trapezoid".to_owned()))?;
    let speed_rad_s = trapezoid.velocity_rad_s;
    let motor_to_joint = published.drive.gear_ratio;
    match speeds {
        SpeedsArgument::Pa10_2003 => {
            let gains = [trapezoid.proportional_nm_rad, trapezoid.derivative_nm_s_rad];
            let gains = gains.map(|gain| gain * motor_to_joint);
            Ok(vec![sweep(
                ELBOW,
                &trapezoid.joint,
                speed_rad_s,
                Some(gains),
                true,
            )?])
        }
        SpeedsArgument::Pa10_2005 => Ok(vec![
            Experiment {
                name: LEMNISCATE,
                joint: None,
                course: courses::lemniscate(robot).map_err(CliError::input)?,
                gains: None,
                is_searched: true,
            },
            Experiment {
                name: JOINT_THREE,
                joint: robot.joint_index(&trapezoid.joint),
                course: courses::joint_three(robot).map_err(CliError::input)?,
                gains: None,
                is_searched: true,
            },
            sweep(SHOULDER, "joint2", speed_rad_s, None, false)?,
            sweep(ELBOW, "joint4", speed_rad_s, None, true)?,
        ]),
    }
}

impl Experiment {
    /// The controller with this experiment's gains, watched as they ask for.
    fn prepared(&self, controller: &Controller) -> Controller {
        let mut controller = controller.clone();
        if let (Some(moving), Some(_)) = (self.joint, self.gains) {
            let joint = &mut controller.model.joints[moving];
            joint.standstill_limit_rad = Some(SOFT_STANDSTILL_RAD);
            joint.following_limit_rad = Some(SOFT_FOLLOWING_RAD);
        }
        controller.with_gains(|control| {
            let Some(moving) = self.joint else { return };
            for (joint, gain_nm_rad) in control.proportional_nm_rad.iter_mut().enumerate() {
                if joint != moving {
                    *gain_nm_rad *= HOLD_FACTOR;
                }
            }
            if let Some([proportional_nm_rad, derivative_nm_s_rad]) = self.gains {
                control.proportional_nm_rad[moving] = proportional_nm_rad;
                control.derivative_nm_s_rad[moving] = derivative_nm_s_rad;
            }
        })
    }

    /// Gains of the joints that move, times a factor.
    fn scale(&self, control: &mut Control, factor: f64, derivative_too: bool) {
        let moves = |joint: usize| self.joint.is_none_or(|moving| moving == joint);
        let scale = |gains: &mut [f64]| {
            for (_, gain) in gains
                .iter_mut()
                .enumerate()
                .filter(|(joint, _)| moves(*joint))
            {
                *gain *= factor;
            }
        };
        scale(&mut control.proportional_nm_rad);
        if derivative_too {
            scale(&mut control.derivative_nm_s_rad);
        }
    }
}

/// One arm and what runs it.
pub struct Stage<'a> {
    /// Runs one motion.
    pub bench: &'a Bench,
    /// The robot file with the published tables, which the emulated arm deviates from.
    pub plant: &'a Robot,
    /// The arm.
    pub seed: u64,
}

impl Stage<'_> {
    /// Every experiment on this arm.
    ///
    /// # Errors
    /// [`CliError`] of the first that failed, or that was stopped.
    pub fn run_all(
        &self,
        experiments: &[Experiment],
        identified: &Robot,
        file: PathBuf,
    ) -> Result<Arm, CliError> {
        let controllers = with_models(self.plant, identified);
        let nothing = without_model(self.plant);
        let pairs: Vec<(&Experiment, &Controller)> = experiments
            .iter()
            .flat_map(|experiment| {
                controllers
                    .iter()
                    .chain([&nothing])
                    .map(move |with| (experiment, with))
            })
            .collect();
        self.bench
            .announce(format!("arm {}, experiments", self.seed));
        let mut arm = Arm {
            seed: self.seed,
            identified: file,
            runs: pairs
                .par_iter()
                .map(|(experiment, controller)| {
                    self.run(experiment, &experiment.prepared(controller))
                })
                .collect::<Result<_, _>>()?,
            gain_searches: Vec::new(),
        };
        self.bench
            .announce(format!("arm {}, gains without the model", self.seed));
        let searches: Vec<(&Experiment, bool)> = experiments
            .iter()
            .filter(|experiment| experiment.is_searched)
            .flat_map(|experiment| [(experiment, true), (experiment, false)])
            .collect();
        let found = searches
            .par_iter()
            .map(|(experiment, derivative_too)| self.search(experiment, *derivative_too, &arm))
            .collect::<Result<Vec<_>, _>>()?;
        for (search, best) in found {
            arm.gain_searches.push(search);
            arm.keep_better(best);
        }
        Ok(arm)
    }

    fn run(&self, experiment: &Experiment, controller: &Controller) -> Result<Run, CliError> {
        let tracked = self
            .bench
            .track(controller, &experiment.course, self.seed)?;
        Ok(Run::new(
            experiment.name,
            controller.name,
            tracked,
            self.plant,
            experiment.joint,
        ))
    }

    /// Also gives the run that came nearest.
    fn search(
        &self,
        experiment: &Experiment,
        derivative_too: bool,
        arm: &Arm,
    ) -> Result<(GainSearch, Option<Run>), CliError> {
        let target_error = arm
            .run(experiment.name, IDENTIFIED)
            .and_then(Run::mean_error)
            .unwrap_or_default();
        let controller = experiment.prepared(&without_model(self.plant));
        let mut best: Option<Run> = None;
        let found = search(target_error, |factor| {
            let mut scaled = controller
                .clone()
                .with_gains(|control| experiment.scale(control, factor, derivative_too));
            scaled.name = HIGH_GAINS;
            let run = self.run(experiment, &scaled)?;
            let failed = failure(&run);
            let tried = Tried {
                factor,
                mean_error: run.mean_error().filter(|_| failed.is_none()),
                failed,
            };
            if tried.mean_error.is_some() && is_better(&run, best.as_ref()) {
                best = Some(run);
            }
            Ok::<_, CliError>(tried)
        })?;
        let search = GainSearch {
            experiment: experiment.name.to_owned(),
            derivative_too,
            unit: if experiment.joint.is_some() {
                "rad"
            } else {
                "m"
            },
            found,
        };
        Ok((search, best))
    }
}

/// Why a run with high gains does not count.
fn failure(run: &Run) -> Option<String> {
    let stopped = run
        .stopped
        .as_ref()
        .map(|why| format!("stops for safety {why}"));
    let limited = || {
        run.most_limited()
            .filter(|joint| joint.limited > LIMITED_MAX)
    };
    let rings = || {
        let joint = limited()?;
        let percent = 100.0 * joint.limited;
        Some(format!(
            "{} rings, at its torque limit in {percent:.0} % of the cycles",
            joint.joint
        ))
    };
    stopped.or_else(rings)
}

fn is_better(run: &Run, other: Option<&Run>) -> bool {
    let error = |run: &Run| run.mean_error().unwrap_or(f64::INFINITY);
    error(run) < other.map_or(f64::INFINITY, error)
}

impl Arm {
    /// Takes the run with high gains that is nearest to the reference.
    fn keep_better(&mut self, run: Option<Run>) {
        let Some(run) = run else { return };
        let known = self
            .runs
            .iter_mut()
            .find(|known| known.experiment == run.experiment && known.controller == run.controller);
        match known {
            Some(known) if is_better(&run, Some(known)) => *known = run,
            Some(_) => {}
            None => self.runs.push(run),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::controllers::{NO_MODEL, PUBLISHED};
    use crate::reproduce::results::Reproduction;
    use crate::reproduce::{page, tables, targets};

    /// Every experiment of a paper, cut short.
    fn shortened(name: &str, speeds: SpeedsArgument) -> Reproduction {
        let robot = robot::load("pa10").expect("shipped");
        let published = robot::published(name).expect("shipped");
        let elbow = robot::published("pa10-2003").expect("shipped");
        let mut experiments = of_paper(speeds, &published, &robot).expect("the PA-10 can do them");
        for experiment in &mut experiments {
            experiment.course.duration_s = 1.0;
        }
        let bench = Bench::new(virtual_drives::Kind::Emulator).expect("signals can be caught");
        let stage = Stage {
            bench: &bench,
            plant: &robot,
            seed: 1,
        };
        let arm = stage.run_all(&experiments, &robot, PathBuf::from("arm.toml"));
        let arms = vec![arm.expect("it runs")];
        Reproduction {
            schema: 1,
            paper: name.to_owned(),
            robot: "pa10".to_owned(),
            targets: targets::judge(&arms, &published, &elbow),
            arms,
        }
    }

    #[test]
    fn every_experiment_is_run_with_every_controller_and_shown() {
        let reproduction = shortened("pa10-2005", SpeedsArgument::Pa10_2005);
        let arm = &reproduction.arms[0];
        for experiment in [LEMNISCATE, JOINT_THREE, SHOULDER, ELBOW] {
            for controller in [PUBLISHED, IDENTIFIED, NO_MODEL] {
                assert!(
                    arm.run(experiment, controller).is_some(),
                    "{experiment}, {controller}"
                );
            }
        }
        let (tables_error, identified_error) = (
            arm.run(LEMNISCATE, PUBLISHED).and_then(Run::mean_error),
            arm.run(LEMNISCATE, IDENTIFIED).and_then(Run::mean_error),
        );
        assert_eq!(
            tables_error, identified_error,
            "one model under two names, one seed"
        );
        assert!(arm.run(LEMNISCATE, NO_MODEL).and_then(Run::mean_error) > identified_error);
        assert_eq!(arm.gain_searches.len(), 6);
        assert!(
            reproduction
                .targets
                .iter()
                .all(|target| target.identified().is_some())
        );

        let published = robot::published("pa10-2005").expect("shipped");
        let elbow = robot::published("pa10-2003").expect("shipped");
        let robot = robot::load("pa10").expect("shipped");
        let sections = tables::all(&reproduction, &published, &elbow);
        assert_eq!(sections.len(), 6);
        let html = page::page(&reproduction, &published, &elbow, &robot).to_html();
        for figure in ["Fig. 8", "Fig. 9", "Fig. 10", "Table VI"] {
            assert!(html.contains(figure), "{figure}");
        }
    }

    #[test]
    fn the_elbow_alone_has_the_gains_of_its_paper() {
        let robot = robot::load("pa10").expect("shipped");
        let published = robot::published("pa10-2003").expect("shipped");
        let experiments =
            of_paper(SpeedsArgument::Pa10_2003, &published, &robot).expect("the PA-10 can do them");
        let [experiment] = experiments.as_slice() else {
            panic!("the elbow only")
        };
        let prepared = experiment.prepared(&without_model(&robot));
        let own = robot.control.expect("the PA-10 has one");
        let control = prepared.model.control.expect("still there");
        // 0.5 and 0.15 at the motor, times the ratio of 50.
        assert_eq!(
            (
                control.proportional_nm_rad[3],
                control.derivative_nm_s_rad[3]
            ),
            (25.0, 7.5)
        );
        assert_eq!(
            control.proportional_nm_rad[1],
            HOLD_FACTOR * own.proportional_nm_rad[1]
        );
        assert_eq!(control.derivative_nm_s_rad[1], own.derivative_nm_s_rad[1]);
    }
}
