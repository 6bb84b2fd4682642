//! The fits in their order: each uses what the ones before it found.
//!
//! Friction over velocity, friction over the motor's angle, torque over gravity load (Table V) with the file's gravity; then
//! gravity with these, and Table V once more with the gravity found. A robot file with a URDF keeps its masses: they are
//! not the file's to change, and the fit is reported.

use std::path::PathBuf;

use identification::experiment::{
    friction_experiments, held_out_experiments, periodic_experiment, stiffness_experiments,
};
use identification::friction::{JointFriction, SETTLING_S, identify_friction, measure_steady};
use identification::gravity::{GravityFit, SlowPoses, fit_gravity};
use identification::held_out::held_out_error;
use identification::periodic::analyse_periodic;
use identification::stiffness::fit_stiffness;
use identification::{IdentificationError, Sweep};
use robot::{Effect, Robot, RobotFile, RobotJoint, Source};

use super::execute::Rig;
use super::{HeldOut, Identified, JointResult};
use crate::cli::IdentifyArguments;
use crate::error::CliError;

/// Points of the look-up table that is fed forward: cycles up to a hundred a revolution keep 95 % of their amplitude.
const TABLE_POINTS: usize = 1024;

/// What was found so far, and the robot file with it.
pub struct Fits<'a> {
    arguments: &'a IdentifyArguments,
    rig: &'a Rig<'a>,
    file: RobotFile,
    source: Source,
    joints: Vec<JointResult>,
    gravity: Option<GravityFit>,
    findings: Vec<String>,
}

impl<'a> Fits<'a> {
    /// Nothing found yet.
    pub fn new(
        arguments: &'a IdentifyArguments,
        rig: &'a Rig<'a>,
        file: RobotFile,
        source: Source,
    ) -> Self {
        Self {
            arguments,
            rig,
            file,
            source,
            joints: Vec::new(),
            gravity: None,
            findings: Vec::new(),
        }
    }

    /// The robot file with what was found.
    pub fn file(&self) -> &RobotFile {
        &self.file
    }

    /// What was found, for reports.
    pub(super) fn identified(self, robot_file: PathBuf) -> Identified {
        Identified {
            schema: 1,
            robot: self.file.name,
            seed: self.arguments.seed,
            robot_file,
            joints: self.joints,
            gravity: self.gravity,
            findings: self.findings,
        }
    }

    /// Runs all fits that are wanted.
    ///
    /// # Errors
    /// [`CliError::Input`], naming joint and signal of the recording that tells nothing.
    pub fn fit(&mut self, joints: &[&RobotJoint]) -> Result<(), CliError> {
        let what = self.arguments.what;
        let nominal = self.robot()?;
        for joint in joints {
            let result = self.fit_friction(&nominal, joint)?;
            change_friction(&mut self.file, &result);
            self.joints.push(result);
        }
        let whole_arm = joints.len() == nominal.joints.len();
        if what.gravity() && !whole_arm {
            self.findings.push(
                "gravity: identified only from the motion of every joint; masses stay".to_owned(),
            );
        }
        let mut slow = Vec::new();
        if what.stiffness() {
            self.fit_load_torque(joints, (what.gravity() && whole_arm).then_some(&mut slow))?;
        } else if what.gravity() {
            for joint in joints {
                slow.extend(self.slow_poses(joint)?);
            }
        }
        if what.gravity() && whole_arm {
            self.fit_gravity(&slow)?;
            if what.stiffness() {
                self.fit_load_torque(joints, None)?;
            }
        }
        if what.stiffness() {
            self.tell_load_torque();
        }
        if what.held_out() {
            self.test_held_out(&nominal, joints)?;
        }
        Ok(())
    }

    fn robot(&self) -> Result<Robot, CliError> {
        let file = self.file.clone();
        file.build(self.source.clone()).map_err(CliError::input)
    }

    fn fit_friction(&self, nominal: &Robot, joint: &RobotJoint) -> Result<JointResult, CliError> {
        let (what, protocol) = (self.arguments.what, self.arguments.speeds.into());
        let name = &joint.name;
        let mut result = JointResult {
            joint: name.clone(),
            friction: None,
            periodic: None,
            stiffness: None,
            held_out: None,
            findings: Vec::new(),
        };
        if what.friction() {
            let recordings = self.rig.read(&friction_experiments(joint, protocol))?;
            let measured = measure_steady(&recordings, nominal, name, SETTLING_S);
            let friction = identify_friction(name, measured.map_err(CliError::input)?);
            result.friction = Some(friction.map_err(CliError::input)?);
        }
        if what.periodic() {
            let recordings = self.rig.read(&[periodic_experiment(joint, protocol)])?;
            let periodic = analyse_periodic(&recordings, nominal, name, SETTLING_S);
            result.periodic = Some(periodic.map_err(CliError::input)?);
        }
        Ok(result)
    }

    /// Table V of every joint with the friction and gravity known now. `slow` also takes what the sweeps say of gravity, for
    /// they are large and read one joint at a time. A joint that gravity hardly loads keeps what its file says.
    fn fit_load_torque(
        &mut self,
        joints: &[&RobotJoint],
        mut slow: Option<&mut Vec<SlowPoses>>,
    ) -> Result<(), CliError> {
        let model = self.robot()?;
        for (joint, result) in joints.iter().zip(&mut self.joints) {
            let plan = stiffness_experiments(self.rig.robot(), joint);
            let recordings = self.rig.read(&plan)?;
            let sweeps: Vec<Sweep<'_>> = recordings
                .iter()
                .zip(&plan)
                .map(|(recording, experiment)| Sweep {
                    recording,
                    payload: experiment.payload,
                })
                .collect();
            result.findings.clear();
            match fit_stiffness(&sweeps, &model, &joint.name) {
                Ok(fitted) => result.stiffness = Some(fitted),
                Err(error @ IdentificationError::SmallGravityRange { .. }) => {
                    result.stiffness = None;
                    result.findings.push(error.to_string());
                }
                Err(error) => return Err(CliError::input(error)),
            }
            if let Some(slow) = &mut slow {
                for sweep in &sweeps {
                    slow.push(SlowPoses::of(sweep, &model).map_err(CliError::input)?);
                }
            }
            change_load_torque(&mut self.file, result);
        }
        Ok(())
    }

    fn slow_poses(&self, joint: &RobotJoint) -> Result<Vec<SlowPoses>, CliError> {
        let model = self.robot()?;
        let plan = stiffness_experiments(self.rig.robot(), joint);
        let slow = plan.into_iter().map(|experiment| {
            let recordings = self.rig.read(std::slice::from_ref(&experiment))?;
            let payload = experiment.payload;
            let poses = recordings
                .iter()
                .map(|recording| SlowPoses::of(&Sweep { recording, payload }, &model));
            poses
                .collect::<Result<Vec<_>, _>>()
                .map_err(CliError::input)
        });
        let slow: Vec<Vec<SlowPoses>> = slow.collect::<Result<_, CliError>>()?;
        Ok(slow.into_iter().flatten().collect())
    }

    fn fit_gravity(&mut self, slow: &[SlowPoses]) -> Result<(), CliError> {
        let fit = fit_gravity(slow, &self.robot()?).map_err(CliError::input)?;
        match &self.file.urdf {
            None => fit.apply(&mut self.file.links),
            Some(urdf) => self.findings.push(format!(
                "gravity: the masses and centres found are not written; the robot's own stay in {urdf}"
            )),
        }
        self.gravity = Some(fit);
        Ok(())
    }

    fn tell_load_torque(&mut self) {
        for result in &mut self.joints {
            let stiffness = result.stiffness.iter();
            let findings = stiffness.flat_map(|fit| fit.findings());
            let named = findings.map(|finding| format!("joint `{}`, {finding}", result.joint));
            let named: Vec<String> = named.collect();
            result.findings.extend(named);
        }
    }

    fn test_held_out(&mut self, nominal: &Robot, joints: &[&RobotJoint]) -> Result<(), CliError> {
        let identified = self.robot()?;
        for (joint, result) in joints.iter().zip(&mut self.joints) {
            let recordings = self.rig.read(&held_out_experiments(joint))?;
            let error = |model: &Robot| {
                held_out_error(&recordings, model, &joint.name).map_err(CliError::input)
            };
            result.held_out = Some(HeldOut {
                file: error(nominal)?,
                identified: error(&identified)?,
            });
        }
        Ok(())
    }
}

fn joint_of<'a>(file: &'a mut RobotFile, result: &JointResult) -> Option<&'a mut RobotJoint> {
    let mut joints = file.joints.iter_mut();
    joints.find(|joint| joint.name == result.joint)
}

/// What was found in place of what stood there.
fn change_friction(file: &mut RobotFile, result: &JointResult) {
    let Some(joint) = joint_of(file, result) else {
        return;
    };
    let friction = result.friction.as_ref();
    if let Some(friction) = friction.and_then(JointFriction::robot_friction) {
        joint.direction_friction = Some(friction);
        joint
            .effects
            .retain(|effect| !is_friction_over_velocity(effect));
    }
    if let Some(periodic) = &result.periodic {
        joint.friction_table = Some(periodic.friction_table(TABLE_POINTS));
        let periodic = |effect: &Effect| matches!(effect, Effect::PositionDependentFriction { .. });
        joint.effects.retain(|effect| !periodic(effect));
    }
}

fn change_load_torque(file: &mut RobotFile, result: &JointResult) {
    if let (Some(joint), Some(stiffness)) = (joint_of(file, result), &result.stiffness) {
        joint.load_torque = Some(stiffness.table());
    }
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
