//! Which twin a diagnosis compares the robot with, and how it is asked.

use gap_report::DataFinding;
use joint_model::rigid_body::JointKind;
use joint_twin::control;
use recording::{Recording, Signal};
use robot::{EffectKind, Robot, RobotJoint};

use crate::closed_loop;
use crate::diagnose::{DiagnoseError, Diagnosis, Progress};
use crate::evidence;
use crate::recorded_motion;
use crate::seen_steps;

/// What the recording is held against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Engine {
    /// Inverse dynamics of the recorded motion, on all sets of names by one held-out score.
    Motion,
    /// A simulation of each joint in its controller's loop, on sets of names by the same held-out score.
    ClosedLoop,
}

/// How a diagnosis is asked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// The twin; by what the robot file tells where none is given.
    pub engine: Option<Engine>,
    /// Share of a joint's gap below which an effect is a minor one.
    pub materiality: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            engine: None,
            materiality: evidence::told::MATERIALITY,
        }
    }
}

impl Engine {
    /// The one that a robot file and recordings call for: a simulation needs what the encoders show, the controller or the joints' own
    /// friction, and a torque to hold against it. Without them it would be made up. Where the file states how stiff a gear is, its encoders
    /// are what the recording shows.
    pub fn for_robot(robot: &Robot, recordings: &[(String, Recording)]) -> Self {
        let tells_encoder = |joint: &RobotJoint| {
            joint.motor_encoder_resolution_rad.is_some()
                || joint.link_encoder_resolution_rad.is_some()
                || joint.position_noise_rad > 0.0
                || states(joint, EffectKind::TorsionalCompliance)
        };
        let has_torque = |joint: &RobotJoint| {
            recordings.iter().all(|(_, recording)| {
                recording.joint(&joint.name).is_ok_and(|columns| {
                    let torques = [Signal::MotorTorqueNm, Signal::CommandTorqueNm];
                    torques
                        .iter()
                        .any(|signal| columns.measured(*signal).is_some())
                })
            })
        };
        // a joint that rubs does so at rest and in motion; a file that states one of both guesses
        let rubs = |joint: &RobotJoint| {
            states(joint, EffectKind::CoulombFriction) && states(joint, EffectKind::ViscousFriction)
        };
        let is_told = (control::is_known(robot) || robot.joints.iter().all(rubs))
            && robot.check_fits_loop().is_ok()
            && robot.joints.iter().all(tells_encoder)
            && robot.joints.iter().any(has_torque);
        if is_told {
            Self::ClosedLoop
        } else {
            Self::Motion
        }
    }
}

fn states(joint: &RobotJoint, kind: EffectKind) -> bool {
    joint.effects.iter().any(|effect| effect.kind() == kind)
}

/// Diagnoses a robot from recordings with their names.
///
/// # Errors
/// [`DiagnoseError`].
pub fn diagnose(
    robot: &Robot,
    recordings: &[(String, Recording)],
    options: &Options,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Diagnosis, DiagnoseError> {
    let engine = options.engine;
    let mut diagnosis = match engine.unwrap_or_else(|| Engine::for_robot(robot, recordings)) {
        Engine::Motion => {
            recorded_motion::diagnose(robot, recordings, options.materiality, progress)?
        }
        Engine::ClosedLoop => {
            let (robot, note) = seen_steps::added(robot, recordings);
            let mut diagnosis =
                closed_loop::diagnose(&robot, recordings, options.materiality, progress)?;
            diagnosis.report.data.extend(note);
            diagnosis
        }
    };
    let of_file = robot.notes.iter().map(|what| DataFinding {
        joint: None,
        severity: "note".to_owned(),
        what: what.clone(),
        remedy: String::new(),
    });
    diagnosis.report.data.extend(of_file);
    diagnosis.report.data.extend(of_linear(robot));
    Ok(diagnosis)
}

/// How the values of joints that slide are read.
fn of_linear(robot: &Robot) -> impl Iterator<Item = DataFinding> {
    let joints = robot.joints.iter().zip(robot.chain.links());
    let linear = joints.filter(|(_, link)| link.kind == JointKind::Prismatic);
    linear.map(|(joint, _)| DataFinding {
        joint: Some(joint.name.clone()),
        severity: "note".to_owned(),
        what: "it slides: read N for Nm, m for rad, N s/m for Nm s/rad and kg for kg m²".to_owned(),
        remedy: String::new(),
    })
}
