//! Torque over gravity load in three regions: PA10-05, eq (5), Table V, Fig. 7.
//!
//! A joint sweeps slowly from -90° to 90° and back, bare and with payloads at the flange. From the drive's torque at the
//! joint side, position-dependent friction, velocity-dependent friction and gravity are subtracted one by one
//! ([`SweepSteps`]); what remains is the paper's `T_c`, here along the direction of motion, as
//! [`LoadTorqueTable`](robot::LoadTorqueTable) has it: positive hinders the motion like friction, negative helps. Over
//! gravity torque `T_g` (about the joint's axis) of arm and payload it is fitted as continuous, piecewise linear, each
//! direction on its own; knees are found by the fit, and three regions are kept only if the data support them.
//!
//! Friction and gravity come from the robot file, so they are to be identified first. Left out: rows at rest, within
//! 0.01 rad after a reversal, faster than 0.2 rad/s, or accelerating.
//!
//! Friction cannot fall below zero: rows in which an overrunning load has taken nearly all of it away are left out, for
//! there `T_c` only says how much there was. Kept, they would bend the outermost region towards slope zero, and more so
//! the heavier the payload.

mod fit;
mod hinges;
mod law;
mod steps;

pub use fit::{Candidate, DirectionFit, Knee, LoadTorqueFit, StiffnessFit, SweepSteps};

use joint_model::friction::Direction;
use joint_model::rigid_body::Chain;
use recording::Signal;
use robot::Robot;

use crate::IdentificationError;
use crate::loaded_arm::{Sweep, loaded_chain};
use crate::steady_motion::joint_index;
use crate::steady_motion::slow::{
    Run, check_sign, fastest_rad_s, no_slow_motion, position_signal, runs,
};
use law::{NoLaw, fit_law};
use steps::{UnloadedFriction, subtract};

/// Fits one joint's torque over gravity load.
///
/// # Errors
/// [`IdentificationError`], naming joint and signal: a signal is missing or too often not measured, the joint never
/// moved slowly and steadily in one of the directions, the payload gives no possible arm, or the gravity torque varies
/// too little for the scatter of the data.
pub fn fit_stiffness(
    sweeps: &[Sweep],
    robot: &Robot,
    joint: &str,
) -> Result<StiffnessFit, IdentificationError> {
    let index = joint_index(robot, joint)?;
    let loaded = sweeps
        .iter()
        .map(|sweep| Loaded::new(sweep, robot, index))
        .collect::<Result<Vec<_>, _>>()?;
    let steps = |direction| subtracted(&loaded, robot, index, direction);
    let (positive, negative) = (steps(Direction::Positive)?, steps(Direction::Negative)?);
    check_friction_sign(joint, &positive, &negative)?;
    let fit = |direction, steps| fit_direction(joint, direction, steps);
    Ok(StiffnessFit {
        joint: joint.to_owned(),
        payloads_kg: sweeps.iter().map(|sweep| sweep.payload.mass_kg).collect(),
        positive: fit(Direction::Positive, positive)?,
        negative: fit(Direction::Negative, negative)?,
    })
}

/// A sweep with the arm it was made with.
struct Loaded<'a> {
    sweep: &'a Sweep<'a>,
    runs: Vec<Run>,
    chain: Chain,
}

impl<'a> Loaded<'a> {
    fn new(sweep: &'a Sweep, robot: &Robot, joint: usize) -> Result<Self, IdentificationError> {
        let chain = loaded_chain(robot, &sweep.payload)?;
        Ok(Self {
            sweep,
            runs: runs(sweep.recording, robot, &[joint])?,
            chain,
        })
    }
}

/// The steps of eq (5) in every recording that has slow motion in this direction.
fn subtracted(
    sweeps: &[Loaded],
    robot: &Robot,
    joint: usize,
    direction: Direction,
) -> Result<Vec<SweepSteps>, IdentificationError> {
    let friction = UnloadedFriction::of(robot, joint);
    let steps_of = |loaded: &Loaded| {
        let mut steps = SweepSteps {
            payload_kg: loaded.sweep.payload.mass_kg,
            ..SweepSteps::default()
        };
        for run in &loaded.runs {
            subtract(
                &mut steps,
                run,
                (joint, direction),
                &friction,
                &loaded.chain,
            );
        }
        steps
    };
    let steps: Vec<SweepSteps> = sweeps
        .iter()
        .map(steps_of)
        .filter(|steps| !steps.position_rad.is_empty())
        .collect();
    if steps.is_empty() {
        let name = &robot.joints[joint].name;
        let signal = sweeps.first().map_or(Signal::MotorPositionRad, |loaded| {
            position_signal(loaded.sweep.recording, name)
        });
        let runs = sweeps.iter().flat_map(|loaded| &loaded.runs);
        let fastest = (signal, fastest_rad_s(runs, joint));
        return Err(no_slow_motion(name, fastest, direction));
    }
    Ok(steps)
}

fn check_friction_sign(
    joint: &str,
    positive: &[SweepSteps],
    negative: &[SweepSteps],
) -> Result<(), IdentificationError> {
    let along = |steps: &[SweepSteps], sign: f64| -> Vec<f64> {
        let pairs = steps
            .iter()
            .flat_map(|steps| steps.total_nm.iter().zip(&steps.gravity_nm));
        pairs
            .map(|(total_nm, gravity_nm)| sign * (total_nm - gravity_nm))
            .collect()
    };
    let along_nm = [along(positive, 1.0), along(negative, -1.0)].concat();
    let all = positive.iter().chain(negative);
    let total_nm: Vec<f64> = all.flat_map(|steps| &steps.total_nm).copied().collect();
    check_sign(joint, &along_nm, &total_nm)
}

fn fit_direction(
    joint: &str,
    direction: Direction,
    steps: Vec<SweepSteps>,
) -> Result<DirectionFit, IdentificationError> {
    match fit_law(&steps) {
        Ok(law) => Ok(DirectionFit { steps, law }),
        Err(NoLaw::TooFew { found, needed }) => Err(IdentificationError::TooShort {
            joint: joint.to_owned(),
            signal: Signal::MotorTorqueNm,
            what: "independent samples of slow motion",
            found,
            needed,
        }),
        Err(NoLaw::SmallRange {
            found_nm,
            needed_nm,
        }) => Err(IdentificationError::SmallGravityRange {
            joint: joint.to_owned(),
            direction,
            found_nm,
            needed_nm,
        }),
    }
}
