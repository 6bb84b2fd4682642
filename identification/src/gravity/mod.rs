//! Gravity torque from slow motion: what data can tell of masses and centres.
//!
//! The arm moves slowly through many poses, in both directions. Torque is averaged over one motor turn, friction is taken
//! off (what the robot file knows of it, and for each joint what the data show besides), and the gravity torque that
//! remains is fitted by least squares. It is linear in each link's mass `m` and first moment `m·c`
//! (Khalil and Dombre, Modeling, Identification and Control of Robots, 2002, section 12.3).
//!
//! No data determine every mass and centre of a chain: [`GravityFit::identifiable`] lists the sums they do determine,
//! [`GravityFit::unseen`] the directions they cannot see. There the robot file's values stay: of all parameters that
//! fit, those with the smallest change are taken, counted in the tolerance of the robot file. A sum that the data know
//! worse than this tolerance counts as unseen too.
//!
//! Torque that loads a joint the same in all poses (a cable, an offset of the current) counts as friction that differs
//! by direction and does not disturb the fit. Load-dependent friction does: it is not the same in both directions, so
//! half the difference looks like gravity unless the robot file has it (`load_torque`, `load_dependent_friction`). An arm
//! with the soft wind-up of Table V therefore needs [`stiffness`](crate::stiffness) first; without it the residual of a
//! loaded joint is as large as its friction, and the fit leaves such a joint's masses as the file has them.
//!
//! Table V was itself fitted with some gravity. So where the file has it, the slopes of its regions are fitted along and
//! only its knees are taken from the file. What tells slopes from gravity is a known payload: sweeps with several of
//! them. Poses in which an overrunning load has eased friction to its floor are left out, for the file does not say how much
//! friction that is.
//!
//! Rows at rest are not used, because friction at rest may be anything up to breakaway: a pose "approached from both
//! directions" is used by the slow motion that leads to it. Left out as well: the first 0.01 rad after a reversal, motion
//! faster than 0.2 rad/s, and accelerated motion.

mod equations;
mod fit;
mod parameters;
mod poses;
mod words;

pub use fit::{Combination, FittedLink, GravityFit, JointGravity, Quantity, Term, UnseenDirection};

use joint_model::friction::Direction;
use joint_model::rigid_body::Chain;
use nalgebra::{DMatrix, DVector};
use recording::Signal;
use robot::Robot;

use crate::loaded_arm::{Payload, Sweep};
use crate::statistics::root_mean_square;
use crate::steady_motion::slow::{
    check_sign, fastest_rad_s, no_slow_motion, position_signal, runs,
};
use crate::{Estimate, IdentificationError};
use equations::{JointEquations, solve};
use parameters::{PER_LINK, Parameters};
use poses::{Pose, poses};

/// Poses of one joint at least: each direction's friction, viscous drag and a sine of gravity have six unknowns.
const LEAST_POSES: usize = 12;

/// The poses are split in so many parts; each is left out once.
const FOLDS: i64 = 5;

/// What one recording of slow motion says about gravity. Small beside the recording.
#[derive(Clone, Debug)]
pub struct SlowPoses {
    poses: Vec<Pose>,
    payload: Payload,
    /// For each joint, which position was read and how fast it moved at most.
    moved: Vec<(Signal, f64)>,
}

impl SlowPoses {
    /// Averages the slow motion in both directions over turns of the motor.
    ///
    /// # Errors
    /// [`IdentificationError`], naming joint and signal that is missing or too often not measured.
    pub fn of(sweep: &Sweep, robot: &Robot) -> Result<Self, IdentificationError> {
        let all: Vec<usize> = (0..robot.joints.len()).collect();
        let runs = runs(sweep.recording, robot, &all)?;
        let moved = robot.joints.iter().enumerate().map(|(index, joint)| {
            let signal = position_signal(sweep.recording, &joint.name);
            (signal, fastest_rad_s(&runs, index))
        });
        Ok(Self {
            moved: moved.collect(),
            poses: runs.iter().flat_map(|run| poses(run, robot)).collect(),
            payload: sweep.payload,
        })
    }
}

/// Fits masses and centres of mass to slow motion in both directions. Every joint must move in some of the recordings,
/// several may move at a time. What hung at the flange is known and not fitted.
///
/// # Errors
/// [`IdentificationError`], naming joint and signal: a joint never moved slowly and steadily, or in too few poses, torque
/// has the wrong sign, or the masses found are impossible.
pub fn fit_gravity(
    recorded: &[SlowPoses],
    robot: &Robot,
) -> Result<GravityFit, IdentificationError> {
    let parameters = Parameters::of(robot)?;
    let payloads = recorded
        .iter()
        .map(|slow| parameters.payload_chain(&slow.payload))
        .collect::<Result<Vec<_>, _>>()?;
    let poses: Vec<(&Pose, &Chain)> = recorded
        .iter()
        .zip(&payloads)
        .flat_map(|(slow, payload)| slow.poses.iter().map(move |pose| (pose, payload)))
        .collect();
    let joints: Vec<JointEquations> = (0..robot.joints.len())
        .map(|joint| JointEquations::new(joint, &poses, robot, &parameters))
        .collect();
    for (joint, equations) in joints.iter().enumerate() {
        check_joint(recorded, robot, joint, equations)?;
    }
    let solution = solve(&joints, parameters.count());
    let covariance = solution.covariance();
    let names = robot.joints.iter().map(|joint| joint.name.clone());
    let held_out = held_out_rms_nm(&joints, parameters.count());
    Ok(GravityFit {
        links: links(robot, &parameters, &solution.change, &covariance)?,
        identifiable: words::combinations(
            robot,
            &parameters,
            &solution.seen,
            &solution.change,
            &covariance,
        ),
        unseen: words::unseen_directions(robot, &parameters, &solution.unseen),
        joints: names
            .zip(&joints)
            .zip(held_out)
            .map(|((name, joint), held_out)| summary(name, joint, &solution.change, held_out))
            .collect(),
    })
}

fn check_joint(
    recorded: &[SlowPoses],
    robot: &Robot,
    joint: usize,
    equations: &JointEquations,
) -> Result<(), IdentificationError> {
    let name = &robot.joints[joint].name;
    if equations.count() == 0 {
        let moved = recorded.iter().map(|slow| slow.moved[joint]);
        let fastest = moved.max_by(|a, b| a.1.total_cmp(&b.1));
        let fastest = fastest.unwrap_or((Signal::MotorPositionRad, 0.0));
        return Err(no_slow_motion(name, fastest, Direction::Positive));
    }
    if equations.count() < LEAST_POSES {
        return Err(IdentificationError::TooShort {
            joint: name.clone(),
            signal: Signal::MotorTorqueNm,
            what: "poses (one motor turn of slow motion each)",
            found: equations.count() as f64,
            needed: LEAST_POSES as f64,
        });
    }
    let (along_nm, torque_nm) = equations.along_and_torque_nm();
    check_sign(name, &along_nm, &torque_nm)
}

/// For each joint, root mean square of the residual at left-out poses, with the file's parameters and with fitted ones.
fn held_out_rms_nm(joints: &[JointEquations], parameters: usize) -> Vec<[f64; 2]> {
    let mut squares = vec![[0.0, 0.0]; joints.len()];
    for fold in 0..FOLDS {
        let left_out = |cell: i64| cell.rem_euclid(FOLDS) == fold;
        let trained: Vec<JointEquations> = joints
            .iter()
            .map(|joint| joint.only(|cell| !left_out(cell)))
            .collect();
        let fitted = solve(&trained, parameters).change;
        for ((joint, trained), squares) in joints.iter().zip(&trained).zip(&mut squares) {
            let tested = joint.only(left_out);
            for (square, change) in squares
                .iter_mut()
                .zip([&DVector::zeros(parameters), &fitted])
            {
                *square += prediction_error_nm(trained, &tested, change).norm_squared();
            }
        }
    }
    let mean = |(squares, joint): ([f64; 2], &JointEquations)| {
        squares.map(|squares: f64| (squares / joint.count() as f64).sqrt())
    };
    squares.into_iter().zip(joints).map(mean).collect()
}

/// At the tested poses, with the friction that the trained ones show.
fn prediction_error_nm(
    trained: &JointEquations,
    tested: &JointEquations,
    change: &DVector<f64>,
) -> DVector<f64> {
    let friction = trained.fit_friction(change);
    if tested.count() == 0 {
        return DVector::zeros(0);
    }
    tested.unexplained_nm(change) - tested.friction_nm(&friction, change)
}

fn summary(
    joint: String,
    equations: &JointEquations,
    change: &DVector<f64>,
    [held_out_file_rms_nm, held_out_rms_nm]: [f64; 2],
) -> JointGravity {
    let fitted_nm = equations.gravity_nm(change);
    let residual_nm = equations.residual_nm(change);
    let rms_nm = |residual_nm: &DVector<f64>| root_mean_square(residual_nm.iter().copied());
    JointGravity {
        joint,
        file_rms_nm: rms_nm(&equations.residual_nm(&DVector::zeros(change.len()))),
        fitted_rms_nm: rms_nm(&residual_nm),
        held_out_file_rms_nm,
        held_out_rms_nm,
        position_rad: equations.position_rad(),
        measured_nm: (&fitted_nm + residual_nm).as_slice().to_vec(),
        file_nm: equations
            .gravity_nm(&DVector::zeros(change.len()))
            .as_slice()
            .to_vec(),
        fitted_nm: fitted_nm.as_slice().to_vec(),
    }
}

/// Masses and centres from the changed parameters. `change` and `covariance` are in units of the file's tolerance.
fn links(
    robot: &Robot,
    parameters: &Parameters,
    change: &DVector<f64>,
    covariance: &DMatrix<f64>,
) -> Result<Vec<FittedLink>, IdentificationError> {
    let tolerance = &parameters.tolerance;
    let values = &parameters.file + change.component_mul(tolerance);
    let variance = |a: usize, b: usize| covariance[(a, b)] * tolerance[a] * tolerance[b];
    let mut fitted = Vec::with_capacity(robot.joints.len());
    for (index, (link, joint)) in robot.chain.links().iter().zip(&robot.joints).enumerate() {
        let mass = index * PER_LINK + 3;
        let mass_kg = values[mass];
        if mass_kg < 0.0 || (mass_kg == 0.0 && link.mass_kg > 0.0) || !mass_kg.is_finite() {
            return Err(IdentificationError::ImpossibleMass {
                joint: joint.name.clone(),
                mass_kg,
                file_mass_kg: link.mass_kg,
            });
        }
        let estimate = |parameter: usize| Estimate {
            value: values[parameter],
            standard_error: variance(parameter, parameter).max(0.0).sqrt(),
        };
        // c = (m·c)/m, linearised.
        let centre = |axis: usize| {
            if mass_kg == 0.0 {
                return Estimate {
                    value: link.centre_of_mass_m[axis],
                    standard_error: 0.0,
                };
            }
            let moment = index * PER_LINK + axis;
            let centre_m = values[moment] / mass_kg;
            let variance = variance(moment, moment) - 2.0 * centre_m * variance(moment, mass)
                + centre_m.powi(2) * variance(mass, mass);
            Estimate {
                value: centre_m,
                standard_error: variance.max(0.0).sqrt() / mass_kg,
            }
        };
        fitted.push(FittedLink {
            joint: joint.name.clone(),
            mass_kg: estimate(mass),
            centre_of_mass_m: [0, 1, 2].map(centre),
            first_moment_kg_m: [0, 1, 2].map(|axis| estimate(index * PER_LINK + axis)),
            file_mass_kg: link.mass_kg,
            file_centre_of_mass_m: link.centre_of_mass_m.into(),
        });
    }
    Ok(fitted)
}
