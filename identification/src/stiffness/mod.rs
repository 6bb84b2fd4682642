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
//! Friction cannot fall below zero: where an overrunning load has taken all of it away, `T_c` stays at minus the
//! unloaded friction, and the fit sees that as a region of slope zero.

mod fit;
mod hinges;
mod law;
mod steps;

pub use fit::{Candidate, DirectionFit, Knee, LoadTorqueFit, StiffnessFit, SweepSteps};

use joint_model::friction::Direction;
use joint_model::rigid_body::Chain;
use nalgebra::Vector3;
use recording::{Recording, Signal};
use robot::Robot;

use crate::IdentificationError;
use crate::loaded_arm::{PointMass, base_gravity_m_s2, gravity_chain, known_payloads};
use crate::slow_motion::{Run, check_sign, no_slow_motion, runs};
use law::{NoLaw, fit_law};
use steps::{UnloadedFriction, subtract};

/// What hangs at the flange.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Payload {
    /// Its mass; zero for the bare arm.
    pub mass_kg: f64,
    /// Its centre in the last link's frame, as the effect `payload` has it.
    pub centre_m: [f64; 3],
}

/// One recording of slow sweeps of a joint, and what hung at the flange.
#[derive(Clone, Copy, Debug)]
pub struct Sweep<'a> {
    /// The recording; the other joints may stand or move slowly too.
    pub recording: &'a Recording,
    /// The payload it was made with.
    pub payload: Payload,
}

/// Metadata of a recording: mass of the payload in kg.
pub const PAYLOAD_KEY: &str = "payload_kg";

/// Metadata of a recording: centre of the payload in the last link's frame, in m, as `x, y, z`.
pub const PAYLOAD_CENTRE_KEY: &str = "payload_centre_m";

impl Payload {
    /// What the recorder wrote: metadata [`PAYLOAD_KEY`] and, if that is not zero, [`PAYLOAD_CENTRE_KEY`].
    ///
    /// # Errors
    /// [`IdentificationError::PayloadMissing`] if either is missing or no number.
    pub fn of(recording: &Recording) -> Result<Self, IdentificationError> {
        let numbers = |key: &'static str, count: usize| {
            let text = recording.metadata.get(key);
            let parsed: Option<Vec<f64>> = text.and_then(|text| {
                let numbers = text.split(',').map(|part| part.trim().parse().ok());
                numbers.collect()
            });
            parsed
                .filter(|found| found.len() == count && found.iter().all(|x| x.is_finite()))
                .ok_or_else(|| IdentificationError::PayloadMissing {
                    key,
                    found: text.cloned(),
                })
        };
        let mass_kg = numbers(PAYLOAD_KEY, 1)?[0];
        if mass_kg == 0.0 {
            return Ok(Self::default());
        }
        let centre_m = numbers(PAYLOAD_CENTRE_KEY, 3)?;
        Ok(Self {
            mass_kg,
            centre_m: [centre_m[0], centre_m[1], centre_m[2]],
        })
    }
}

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
    let index = robot
        .joint_index(joint)
        .ok_or_else(|| IdentificationError::UnknownJoint {
            joint: joint.to_owned(),
            there: robot
                .joints
                .iter()
                .map(|joint| joint.name.clone())
                .collect(),
        })?;
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
        let mut payloads = known_payloads(robot);
        payloads.push(PointMass {
            mass_kg: sweep.payload.mass_kg,
            centre_m: Vector3::from(sweep.payload.centre_m),
        });
        let chain = gravity_chain(robot.chain.links(), base_gravity_m_s2(robot), &payloads)?;
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
        let recording = sweeps.first().map(|loaded| loaded.sweep.recording);
        let runs = sweeps.iter().flat_map(|loaded| &loaded.runs);
        return Err(no_slow_motion(recording, runs, robot, joint, direction));
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
