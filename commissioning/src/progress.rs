//! What was passed: of one robot file, with one driver.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::step::{Stage, Step};
use crate::verdict::Finding;

/// Number of this layout.
const SCHEMA: u32 = 1;

/// What a walk has passed so far.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    schema: u32,
    /// Name of the robot.
    pub robot: String,
    /// Its [`fingerprint`].
    pub fingerprint: String,
    /// The driver that reached the drives.
    pub driver: String,
    /// In the order in which it happened.
    pub passed: Vec<Passed>,
}

/// A stage that was passed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Passed {
    /// The step.
    pub step: Step,
    /// The joint, where each passes by itself.
    pub joint: Option<String>,
    /// When, as RFC 3339 has it.
    pub at: String,
    /// What was seen.
    pub finding: Finding,
}

/// What has to be passed before.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    /// The first stage that is missing.
    pub stage: Stage,
}

/// What binds a walk to a robot file: SHA-256 of its text.
pub fn fingerprint(robot_text: &str) -> String {
    let digest = Sha256::digest(robot_text.as_bytes());
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

impl Progress {
    /// Nothing was passed yet.
    pub fn new(robot: &str, fingerprint: &str, driver: &str) -> Self {
        Self {
            schema: SCHEMA,
            robot: robot.to_owned(),
            fingerprint: fingerprint.to_owned(),
            driver: driver.to_owned(),
            passed: Vec::new(),
        }
    }

    /// Why what was passed says nothing of this robot file and driver; `None` where it does.
    pub fn outdated(&self, fingerprint: &str, driver: &str) -> Option<String> {
        if self.schema != SCHEMA {
            return Some(format!("it is of layout {}, not {SCHEMA}", self.schema));
        }
        if self.fingerprint != fingerprint {
            return Some("the robot file has changed since".to_owned());
        }
        if self.driver != driver {
            return Some(format!("it was walked with the driver {}", self.driver));
        }
        None
    }

    /// Whether a stage was passed.
    pub fn has(&self, stage: Stage, joint_names: &[&str]) -> bool {
        let joint = stage.joint.map(|joint| joint_names[joint]);
        let mut passed = self.passed.iter();
        passed.any(|passed| passed.step == stage.step && passed.joint.as_deref() == joint)
    }

    /// The first stage that was not.
    pub fn next(&self, joint_names: &[&str]) -> Option<Stage> {
        Stage::all(joint_names.len()).find(|stage| !self.has(*stage, joint_names))
    }

    /// Whether everything that a step relies on was passed.
    ///
    /// # Errors
    /// [`Missing`], the first thing that was not.
    pub fn may_begin(&self, step: Step, joint_names: &[&str]) -> Result<(), Missing> {
        let before = Stage::all(joint_names.len()).take_while(|stage| stage.step < step);
        let mut missing = before.filter(|stage| !self.has(*stage, joint_names));
        missing
            .next()
            .map_or(Ok(()), |stage| Err(Missing { stage }))
    }

    /// Notes a stage; one that was passed before is told anew.
    pub fn pass(&mut self, stage: Stage, joint_names: &[&str], at: String, finding: Finding) {
        self.forget(stage, joint_names);
        self.passed.push(Passed {
            step: stage.step,
            joint: stage.joint.map(|joint| joint_names[joint].to_owned()),
            at,
            finding,
        });
    }

    /// Takes a stage back that was tried again: until it is passed anew it counts for nothing.
    pub fn forget(&mut self, stage: Stage, joint_names: &[&str]) {
        let joint = stage.joint.map(|joint| joint_names[joint]);
        self.passed
            .retain(|passed| passed.step != stage.step || passed.joint.as_deref() != joint);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOINTS: [&str; 2] = ["shoulder", "elbow"];

    fn finding() -> Finding {
        Finding::new(1.0, 2.0, "rad", "seen")
    }

    fn walked(stages: usize) -> Progress {
        let mut progress = Progress::new("arm", "f", "ethercat");
        for stage in Stage::all(2).take(stages) {
            progress.pass(stage, &JOINTS, "now".to_owned(), finding());
        }
        progress
    }

    #[test]
    fn a_walk_goes_on_where_it_stood_and_each_step_needs_all_before() {
        let all: Vec<Stage> = Stage::all(2).collect();
        for passed in 0..=all.len() {
            let progress = walked(passed);
            assert_eq!(progress.next(&JOINTS), all.get(passed).copied());
            for step in Step::ALL {
                let first_missing = all[passed.min(all.len())..].first().copied();
                let may = progress.may_begin(step, &JOINTS);
                match first_missing.filter(|stage| stage.step < step) {
                    None => assert_eq!(may, Ok(())),
                    Some(stage) => assert_eq!(may, Err(Missing { stage })),
                }
            }
        }
    }

    #[test]
    fn a_stage_that_is_tried_again_counts_once_and_not_before_it_is_passed() {
        let mut progress = walked(Stage::all(2).count());
        let sign = Stage {
            step: Step::Sign,
            joint: Some(1),
        };
        progress.forget(sign, &JOINTS);
        assert_eq!(progress.next(&JOINTS), Some(sign));
        assert_eq!(
            progress.may_begin(Step::Sine, &JOINTS),
            Err(Missing { stage: sign })
        );
        progress.pass(sign, &JOINTS, "later".to_owned(), finding());
        progress.pass(sign, &JOINTS, "later still".to_owned(), finding());
        assert_eq!(progress.passed.len(), Stage::all(2).count());
        assert_eq!(progress.next(&JOINTS), None);
    }

    #[test]
    fn another_file_or_driver_begins_again() {
        let progress = walked(3);
        assert_eq!(progress.outdated("f", "ethercat"), None);
        let changed = progress.outdated("g", "ethercat").expect("changed");
        assert!(changed.contains("changed"), "{changed}");
        let other = progress.outdated("f", "moteus").expect("another");
        assert!(other.contains("ethercat"), "{other}");
        assert_ne!(
            fingerprint("torque_limit_nm = 1"),
            fingerprint("torque_limit_nm = 2")
        );
        assert_eq!(
            fingerprint(""),
            "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
        );
    }

    #[test]
    fn a_file_reads_as_it_was_written() {
        let progress = walked(7);
        let text = serde_json::to_string(&progress).expect("JSON");
        let read: Progress = serde_json::from_str(&text).expect("ours");
        assert_eq!(read, progress);
    }
}
