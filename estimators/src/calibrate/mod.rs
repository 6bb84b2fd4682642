//! Calibration of a joint's estimators on one recording, SD eq (14).
//!
//! The reference is a torque sensor, or where there is none the gravity of known bodies while the joint moves slowly. An
//! estimator that needs a signal the recording does not have is left out and named. Every parameter comes with a standard
//! error and the bounds it was searched in; one that ends on a bound is a finding, not a value.

mod fusion;
mod least_squares;
mod link;
mod models;
mod process;

pub use least_squares::Fitted;

use recording::{MissingSignal, Recording, Signal};
use robot::estimators::EstimatorParameters;
use robot::{Effect, Robot, RobotJoint};
use serde::Serialize;

use crate::{EstimatorError, JointLog, Kind, TorqueEstimator};

/// What an estimate is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// The sensor at the gear's output.
    JointTorque,
    /// Gravity of the robot file's bodies, payload included, where the joint moves slowly and evenly.
    Gravity,
}

/// One estimator's calibration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fit {
    /// Which estimator.
    pub kind: Kind,
    /// Its parameters.
    pub fitted: Vec<Fitted>,
    /// What remained of the torque error, root mean square.
    pub rms_nm: f64,
    /// Starts of the search.
    pub starts: usize,
    /// Of these, how many came within 1 % of the best.
    pub agreeing_starts: usize,
}

/// Everything found for one joint.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Calibration {
    /// The joint.
    pub joint: String,
    /// What estimates were compared with.
    pub reference: Reference,
    /// Rows with a reference.
    pub rows: usize,
    /// For the robot file.
    #[serde(skip)]
    pub parameters: EstimatorParameters,
    /// How they were found, estimator by estimator.
    pub fits: Vec<Fit>,
    /// What a reader should know before trusting the values.
    pub findings: Vec<String>,
}

/// Why a recording gives no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// A joint or the reference is not in the recording.
    #[error("{0}{1}")]
    Missing(MissingSignal, &'static str),
    /// No estimator has its signals.
    #[error(
        "joint `{joint}`: no estimator can be calibrated; beside motor_position_rad all need link_position_rad or \
         motor_torque_nm"
    )]
    NoEstimator {
        /// The joint.
        joint: String,
    },
    /// Too little was measured.
    #[error(
        "joint `{joint}`: {rows} rows have a reference torque{}, at least {ROWS_MIN} are needed",
        if *.reference == Reference::Gravity { " (slower than 0.1 rad/s and even)" } else { "" }
    )]
    TooFewRows {
        /// The joint.
        joint: String,
        /// Rows with a reference.
        rows: usize,
        /// Which reference.
        reference: Reference,
    },
    /// The torque hardly changed.
    #[error(
        "joint `{joint}`: the reference torque varies by {range_nm:.3} Nm only; move under load, in both directions"
    )]
    NoLoad {
        /// The joint.
        joint: String,
        /// Its range.
        range_nm: f64,
    },
    /// None of those it has the signals for can be made.
    #[error(transparent)]
    Estimator(EstimatorError),
}

/// What to do where no torque was measured.
pub const WITHOUT_SENSOR: &str = "; without a torque sensor calibrate with --reference gravity";
/// The fewest rows with a reference: one second at 1.5 kHz.
const ROWS_MIN: usize = 1500;
/// Below this range of torque friction alone may be what the sensor saw.
const RANGE_MIN_NM: f64 = 0.5;
/// Filters of the estimators have forgotten how they began.
const SETTLING_S: f64 = 0.2;
/// Rows a fit looks at, evenly spread; estimators with memory still run over all of them.
const FIT_ROWS: usize = 20_000;
/// Slow enough for gravity to be the torque.
const SLOW_RAD_S: f64 = 0.1;
/// Even enough: with 0.3 kg m² that is 0.06 Nm.
const EVEN_RAD_S2: f64 = 0.2;

/// What a fit works on.
struct Bench<'a> {
    joint: &'a RobotJoint,
    log: &'a JointLog,
    /// NaN where there is none.
    reference_nm: Vec<f64>,
    /// Rows that the fit looks at.
    rows: Vec<usize>,
    /// Of the robot file's bodies about the joint, in the recording's middle.
    link_inertia_kg_m2: f64,
}

/// Calibrates what the recording has the signals for.
///
/// # Errors
/// [`CalibrationError`] names joint, signal and the number that decided.
pub fn calibrate(
    recording: &Recording,
    robot: &Robot,
    joint: &RobotJoint,
    reference: Reference,
) -> Result<Calibration, CalibrationError> {
    let name = &joint.name;
    let log = JointLog::new(recording, robot, joint)
        .map_err(|missing| CalibrationError::Missing(missing, ""))?;
    if reference == Reference::JointTorque {
        JointLog::need(recording, name, &[Signal::JointTorqueNm])
            .map_err(|missing| CalibrationError::Missing(missing, WITHOUT_SENSOR))?;
    }
    JointLog::need(recording, name, &[Signal::MotorPositionRad])
        .map_err(|missing| CalibrationError::Missing(missing, "; every estimator needs it"))?;
    let inertia_kg_m2 = link_inertia_kg_m2(recording, robot, joint);
    let bench = Bench::new(joint, &log, reference, inertia_kg_m2)?;
    let has = |signal| recording.signal(name, signal).is_ok();
    let [torsion, drive] = [Signal::LinkPositionRad, Signal::MotorTorqueNm].map(has);
    if !torsion && !drive {
        return Err(CalibrationError::NoEstimator {
            joint: name.clone(),
        });
    }
    let mut found = Calibration {
        joint: name.clone(),
        reference,
        rows: bench
            .reference_nm
            .iter()
            .filter(|nm| nm.is_finite())
            .count(),
        parameters: EstimatorParameters::default(),
        fits: Vec::new(),
        findings: Vec::new(),
    };
    let mut refusals = Vec::new();
    if torsion {
        bench.structural_damping(&mut found);
        refusals.extend(
            bench
                .taghirad(&mut found)
                .err()
                .map(|why| (Kind::Taghirad, why)),
        );
    } else {
        found.leave_out(Signal::LinkPositionRad);
    }
    if drive {
        let tried = bench.disturbance_observer(&mut found);
        refusals.extend(tried.err().map(|why| (Kind::DisturbanceObserver, why)));
    } else {
        found.leave_out(Signal::MotorTorqueNm);
    }
    if torsion && drive {
        bench.compliance(&mut found);
        bench.gaussian_process(&mut found);
        refusals.extend(
            bench
                .fusion(&mut found)
                .err()
                .map(|why| (Kind::Fusion, why)),
        );
    }
    found.note_bounds();
    found.note_refusals(refusals)?;
    Ok(found)
}

impl Calibration {
    /// Those that need this signal.
    fn leave_out(&mut self, signal: Signal) {
        let calibrated = Kind::ALL.into_iter().filter(|kind| *kind != Kind::Residual);
        let without = calibrated.filter(|kind| kind.needs().contains(&signal));
        let names: Vec<&str> = without.map(Kind::name).collect();
        self.findings.push(format!(
            "joint `{}`: not calibrated, because the recording has no {signal}: {}",
            self.joint,
            names.join(", ")
        ));
    }

    /// Those that cannot be made for this joint and rate; an error if that leaves none.
    fn note_refusals(
        &mut self,
        refusals: Vec<(Kind, EstimatorError)>,
    ) -> Result<(), CalibrationError> {
        for (kind, why) in refusals {
            if self.fits.is_empty() {
                return Err(CalibrationError::Estimator(why));
            }
            self.findings
                .push(format!("{why}: {} not calibrated", kind.name()));
        }
        Ok(())
    }

    fn note_bounds(&mut self) {
        for fit in &self.fits {
            // a play element of no stiffness is one that is not there, and no finding
            let is_play = |fitted: &&Fitted| fitted.name == fusion::PLAY_STIFFNESS;
            let told = fit.fitted.iter().filter(|fitted| !is_play(fitted));
            for fitted in told.filter(|fitted| fitted.at_bound) {
                let [low, high] = fitted.bounds;
                self.findings.push(format!(
                    "joint `{}`, {}: {} = {:.4e} is on the bound of its search ({low:.3e} to {high:.3e}): the data do not \
                     tell it, or the law does not fit",
                    self.joint,
                    fit.kind.name(),
                    fitted.name,
                    fitted.value
                ));
            }
        }
    }
}

impl<'a> Bench<'a> {
    fn new(
        joint: &'a RobotJoint,
        log: &'a JointLog,
        reference: Reference,
        link_inertia_kg_m2: f64,
    ) -> Result<Self, CalibrationError> {
        let settled = log.settled(SETTLING_S);
        let source = match reference {
            Reference::JointTorque => log.joint_torque_nm.clone(),
            Reference::Gravity => slow_gravity_nm(joint, log),
        };
        let reference_nm: Vec<f64> = source
            .iter()
            .zip(&settled)
            .map(|(nm, settled)| if *settled { *nm } else { f64::NAN })
            .collect();
        let usable: Vec<usize> = (0..log.rows())
            .filter(|row| reference_nm[*row].is_finite())
            .collect();
        if usable.len() < ROWS_MIN {
            return Err(CalibrationError::TooFewRows {
                joint: joint.name.clone(),
                rows: usable.len(),
                reference,
            });
        }
        let range_nm = range(usable.iter().map(|row| reference_nm[*row]));
        if range_nm < RANGE_MIN_NM {
            return Err(CalibrationError::NoLoad {
                joint: joint.name.clone(),
                range_nm,
            });
        }
        let stride = usable.len().div_ceil(FIT_ROWS);
        Ok(Self {
            joint,
            log,
            rows: usable.into_iter().step_by(stride).collect(),
            reference_nm,
            link_inertia_kg_m2,
        })
    }

    /// Errors of an estimator with memory at those of the fit's rows that it has its signals in.
    fn misses(&self, mut estimator: impl TorqueEstimator) -> Vec<f64> {
        let mut rows = self.rows.iter().peekable();
        let mut misses = Vec::with_capacity(self.rows.len());
        for (row, sample) in self.log.samples.iter().enumerate() {
            let estimate = estimator.estimate(sample);
            let wanted = rows.next_if(|wanted| **wanted == row).is_some();
            if let (true, Ok(found)) = (wanted, estimate) {
                misses.push(found.torque_nm - self.reference_nm[row]);
            }
        }
        misses
    }

    /// The same for an estimator without memory.
    fn static_misses(&self, mut estimator: impl TorqueEstimator) -> Vec<f64> {
        let miss = |row: &usize| {
            let estimate = estimator.estimate(&self.log.samples[*row]).ok()?;
            Some(estimate.torque_nm - self.reference_nm[*row])
        };
        self.rows.iter().filter_map(miss).collect()
    }

    /// Torsion at the fit's rows.
    fn torsions_rad(&self) -> Vec<f64> {
        let torsion = |row: &usize| {
            let sample = &self.log.samples[*row];
            sample.motor_position_rad / self.joint.gear_ratio - sample.link_position_rad
        };
        self.rows.iter().map(torsion).collect()
    }

    /// About how stiff the gear is: the robot file's value, or how the reference follows the torsion.
    fn stiffness_nm_rad(&self) -> f64 {
        let nominal = self.joint.effects.iter().find_map(|effect| match effect {
            Effect::TorsionalCompliance { stiffness_nm_rad } => Some(*stiffness_nm_rad),
            _ => None,
        });
        nominal.unwrap_or_else(|| {
            let torsions = self.torsions_rad();
            let torques = self.rows.iter().map(|row| self.reference_nm[*row]);
            range(torques) / range(torsions.into_iter()).max(f64::MIN_POSITIVE)
        })
    }

    fn period_s(&self) -> f64 {
        self.log.period_s
    }
}

/// Largest minus smallest; what is no number does not count.
fn range(values: impl Iterator<Item = f64>) -> f64 {
    let [low, high] = values
        .filter(|value| value.is_finite())
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
            [low.min(value), high.max(value)]
        });
    high - low
}

/// The model's gravity where the joint moves slowly and evenly, for a while: a mean over that while would take a fast swing for
/// rest.
fn slow_gravity_nm(joint: &RobotJoint, log: &JointLog) -> Vec<f64> {
    const HALF_WINDOW_S: f64 = 0.1;
    const HALF_DIFFERENCE_S: f64 = 0.01;
    let velocity = log.slow_velocity_rad_s(joint.gear_ratio, HALF_DIFFERENCE_S);
    let half = (HALF_WINDOW_S / log.period_s).round().max(1.0) as usize;
    let is_slow = |row: usize| {
        let around = row
            .checked_sub(half)
            .and_then(|first| velocity.get(first..=row + half))?;
        let known = around.iter().all(|velocity| velocity.abs() < SLOW_RAD_S);
        let change_rad_s = range(around.iter().copied());
        Some(known && change_rad_s < EVEN_RAD_S2 * 2.0 * HALF_WINDOW_S)
    };
    let gravity = |row: usize| match is_slow(row) {
        Some(true) => log.gravity_nm[row],
        _ => f64::NAN,
    };
    (0..log.rows()).map(gravity).collect()
}

/// Torque per acceleration of the joint alone, the arm as it stood in the recording's middle.
fn link_inertia_kg_m2(recording: &Recording, robot: &Robot, joint: &RobotJoint) -> f64 {
    let position_rad: Vec<f64> = robot
        .joints
        .iter()
        .map(|joint| {
            let column = recording.signal(&joint.name, Signal::MotorPositionRad);
            let motor_rad = column.map_or(0.0, |column| column[column.len() / 2]);
            let position_rad = motor_rad / joint.gear_ratio;
            if position_rad.is_finite() {
                position_rad
            } else {
                0.0
            }
        })
        .collect();
    let count = position_rad.len();
    let index = robot.joint_index(&joint.name).unwrap_or_default();
    let rest = vec![0.0; count];
    let mut push = rest.clone();
    push[index] = 1.0;
    let torque_nm = |acceleration: &[f64]| {
        let mut torque_nm = vec![0.0; count];
        robot
            .chain
            .inverse_dynamics(&position_rad, &rest, acceleration, &mut torque_nm);
        torque_nm[index]
    };
    torque_nm(&push) - torque_nm(&rest)
}
