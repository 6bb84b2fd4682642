//! The torque estimator's answer to a sample: every joint's estimates in one message.

use estimators::{
    Estimate, EstimatorError, ExternalTorque, JointEstimators, Kind, Missing, Sample,
};
use joint_model::rigid_body::Chain;
use robot::Robot;
use shm_types::messages::{
    Estimates, ExternalTorque as ExternalMessage, Header, PerJoint, Readings, SensorSample,
    TorqueEstimate, Validity,
};

/// Why a robot's estimators cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EstimatorsError {
    /// There is no estimator of that name.
    #[error("unknown estimator `{name}`; known: {}", known())]
    Unknown {
        /// As given.
        name: String,
    },
    /// It was asked for, and no joint has its parameters.
    #[error(
        "no joint of robot `{robot}` has parameters for estimator `{}`; `flexspline estimate calibrate` writes them into its file",
        kind.identifier()
    )]
    NotCalibrated {
        /// Which.
        kind: Kind,
        /// The robot's name.
        robot: String,
    },
    /// One of them cannot be made.
    #[error(transparent)]
    Estimator(#[from] EstimatorError),
}

fn known() -> String {
    Kind::ALL.map(Kind::identifier).join(", ")
}

/// The estimators that names stand for; all if none is named.
///
/// # Errors
/// [`EstimatorsError::Unknown`] with those there are.
pub fn kinds(names: &[String]) -> Result<Vec<Kind>, EstimatorsError> {
    if names.is_empty() {
        return Ok(Kind::ALL.to_vec());
    }
    let kind = |name: &String| {
        Kind::from_identifier(name).ok_or_else(|| EstimatorsError::Unknown { name: name.clone() })
    };
    names.iter().map(kind).collect()
}

/// All estimators of one robot.
#[derive(Clone, Debug)]
pub struct Estimators {
    chain: Chain,
    gear_ratios: Vec<f64>,
    joints: Vec<JointEstimators>,
    kinds: Vec<Kind>,
    external: ExternalTorque,
    samples: Vec<Sample>,
    fused: Vec<Option<Estimate>>,
    /// The newest answer, of which torques are held.
    answer: TorqueEstimate,
}

impl Estimators {
    /// The estimators of these names, all if none is named, with the robot file's values.
    ///
    /// # Errors
    /// [`EstimatorsError`] for a name that is unknown or that no joint has parameters for, a control period that is too long
    /// for their filters, or an encoder's step that the robot file lacks.
    pub fn new(robot: &Robot, names: &[String], period_s: f64) -> Result<Self, EstimatorsError> {
        let joints = robot.joints.iter();
        let joints: Result<Vec<_>, _> = joints
            .map(|joint| JointEstimators::new(joint, period_s))
            .collect();
        let (mut joints, kinds) = (joints?, kinds(names)?);
        let mut is_absent = |kind: Kind| joints.iter_mut().all(|joint| joint.get(kind).is_none());
        let absent = kinds.iter().find(|kind| is_absent(**kind));
        if let (Some(kind), false) = (absent, names.is_empty()) {
            return Err(EstimatorsError::NotCalibrated {
                kind: *kind,
                robot: robot.name.clone(),
            });
        }
        let count = robot.joints.len();
        Ok(Self {
            joints,
            kinds,
            external: ExternalTorque::new(robot, period_s)?,
            gear_ratios: robot.joints.iter().map(|joint| joint.gear_ratio).collect(),
            chain: robot.chain.clone(),
            samples: Vec::with_capacity(count),
            fused: vec![None; count],
            answer: TorqueEstimate::default(),
        })
    }

    /// The estimates for one sample. No allocation, no clock.
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    pub fn estimate(&mut self, sample: &SensorSample) -> TorqueEstimate {
        let passed_cycles = passed_cycles(&self.answer.header, &sample.header);
        self.answer.header = sample.header;
        self.take(sample);
        self.fused.fill(None);
        for (index, (joint, sample)) in self.joints.iter_mut().zip(&self.samples).enumerate() {
            for kind in &self.kinds {
                let Some(answer) = joint.estimate(*kind, sample) else {
                    continue;
                };
                if *kind == Kind::Fusion {
                    self.fused[index] = answer.ok();
                }
                let estimates = place_of(&mut self.answer, *kind);
                note(estimates, index, answer, passed_cycles);
            }
        }
        self.note_external();
        self.answer
    }

    fn take(&mut self, sample: &SensorSample) {
        let readings = &sample.readings;
        let load_nm = self.gravity_nm(readings);
        self.samples.clear();
        self.samples
            .extend((0..self.joints.len()).map(|index| Sample {
                cycle: sample.header.cycle,
                motor_position_rad: readings.motor_position_rad[index],
                link_position_rad: readings.link_position_rad[index],
                motor_torque_nm: readings.motor_torque_nm[index],
                load_nm: load_nm[index],
            }));
    }

    fn note_external(&mut self) {
        let mut message = ExternalMessage::default();
        let found = self.external.estimate(&self.samples, &self.fused);
        for (index, external) in found.iter().enumerate() {
            if let Some(external) = external {
                message.torque_nm[index] = external.torque_nm;
                message.std_nm[index] = external.std_nm;
                message.threshold_nm[index] = external.threshold_nm();
                message.contact_joints |= u64::from(external.is_contact) << index;
            }
        }
        self.answer.external = message;
    }

    /// Gravity at the measured motor angles over the gear ratios; a joint without one counts as at zero.
    fn gravity_nm(&self, readings: &Readings) -> PerJoint {
        let mut position_rad = PerJoint::default();
        for (index, gear_ratio) in self.gear_ratios.iter().enumerate() {
            let motor_rad = readings.motor_position_rad[index];
            if motor_rad.is_finite() {
                position_rad[index] = motor_rad / gear_ratio;
            }
        }
        let count = self.joints.len();
        let mut gravity_nm = PerJoint::default();
        self.chain
            .gravity_torque(&position_rad[..count], &mut gravity_nm[..count]);
        gravity_nm
    }
}

/// What a message says by an estimator.
pub fn of(message: &TorqueEstimate, kind: Kind) -> &Estimates {
    match kind {
        Kind::Residual => &message.residual,
        Kind::StructuralDamping => &message.structural_damping,
        Kind::Compliance => &message.compliance,
        Kind::Taghirad => &message.taghirad,
        Kind::DisturbanceObserver => &message.disturbance_observer,
        Kind::GaussianProcess => &message.gaussian_process,
        Kind::Fusion => &message.fusion,
    }
}

/// Where an estimator's torques go in a message.
fn place_of(message: &mut TorqueEstimate, kind: Kind) -> &mut Estimates {
    match kind {
        Kind::Residual => &mut message.residual,
        Kind::StructuralDamping => &mut message.structural_damping,
        Kind::Compliance => &mut message.compliance,
        Kind::Taghirad => &mut message.taghirad,
        Kind::DisturbanceObserver => &mut message.disturbance_observer,
        Kind::GaussianProcess => &mut message.gaussian_process,
        Kind::Fusion => &mut message.fusion,
    }
}

/// Cycles since the answer before.
fn passed_cycles(before: &Header, now: &Header) -> u32 {
    let passed = now.cycle.saturating_sub(before.cycle);
    u32::try_from(passed).unwrap_or(u32::MAX)
}

fn note(
    estimates: &mut Estimates,
    joint: usize,
    answer: Result<Estimate, Missing>,
    passed_cycles: u32,
) {
    match answer {
        Ok(found) => {
            estimates.torque_nm[joint] = found.torque_nm;
            estimates.std_nm[joint] = found.std_nm.unwrap_or(f64::NAN);
            estimates.age_cycles[joint] = 0;
            estimates.validity[joint] = Validity::Valid as u32;
        }
        Err(_) => {
            estimates.age_cycles[joint] = estimates.age_cycles[joint].saturating_add(passed_cycles);
            estimates.validity[joint] = Validity::Held as u32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use recording::Signal;

    const PERIOD_S: f64 = 1.0 / 1500.0;

    fn sample(cycle: u64, motor_torque_nm: f64) -> SensorSample {
        let mut sample = SensorSample::default();
        sample.header.cycle = cycle;
        sample.header.joint_count = 1;
        sample.readings.motor_position_rad[0] = 10.0;
        sample.readings.link_position_rad[0] = 0.1 - 5e-4;
        sample.readings.motor_torque_nm[0] = motor_torque_nm;
        sample
    }

    fn estimators(names: &[&str]) -> Estimators {
        let robot = robot::load("shd17").expect("shipped");
        let names: Vec<String> = names.iter().map(ToString::to_string).collect();
        Estimators::new(&robot, &names, PERIOD_S).expect("possible")
    }

    #[test]
    fn a_missing_signal_holds_the_torque_and_counts_its_age() {
        let mut estimators = estimators(&[]);
        let first = estimators.estimate(&sample(0, 0.05)).residual;
        assert_eq!(
            (first.validity[0], first.age_cycles[0]),
            (Validity::Valid as u32, 0)
        );
        for (cycle, age_cycles) in [(1, 1), (2, 2), (5, 5)] {
            let held = estimators.estimate(&sample(cycle, f64::NAN));
            assert_eq!(held.residual.validity[0], Validity::Held as u32);
            assert_eq!(held.residual.age_cycles[0], age_cycles);
            assert_eq!(held.residual.torque_nm[0], first.torque_nm[0]);
            assert!(held.residual.valid_nm(0)[0].is_nan());
            // this one needs no motor torque
            assert_eq!(held.structural_damping.validity[0], Validity::Valid as u32);
        }
        assert_eq!(
            estimators.estimate(&sample(6, 0.05)).residual.age_cycles[0],
            0
        );
    }

    #[test]
    fn what_was_not_asked_for_or_has_no_parameters_is_absent() {
        let both = estimators(&[]).estimate(&sample(0, 0.05));
        assert_eq!(both.fusion.validity[0], Validity::Absent as u32);
        assert!(both.external.torque_nm[0].is_nan());
        let one = estimators(&["structural_damping"]).estimate(&sample(0, 0.05));
        assert_eq!(one.residual.validity[0], Validity::Absent as u32);
        assert_eq!(one.structural_damping.validity[0], Validity::Valid as u32);
        assert!(kinds(&["momentum".to_owned()]).is_err());
    }

    #[test]
    fn asking_for_what_no_joint_is_calibrated_for_is_an_error_that_says_how() {
        let robot = robot::load("shd17").expect("shipped");
        let refused = Estimators::new(&robot, &["fusion".to_owned()], PERIOD_S);
        let told = refused.expect_err("nothing calibrated").to_string();
        assert!(
            told.contains("`fusion`") && told.contains("estimate calibrate"),
            "{told}"
        );
    }

    #[test]
    fn without_any_one_signal_those_that_need_it_are_held_and_the_others_valid() {
        for signal in [
            Signal::MotorPositionRad,
            Signal::LinkPositionRad,
            Signal::MotorTorqueNm,
        ] {
            let mut sample = sample(0, 0.05);
            let readings = &mut sample.readings;
            let blinded = match signal {
                Signal::MotorPositionRad => &mut readings.motor_position_rad,
                Signal::LinkPositionRad => &mut readings.link_position_rad,
                _ => &mut readings.motor_torque_nm,
            };
            blinded[0] = f64::NAN;
            let answer = estimators(&[]).estimate(&sample);
            // what the shipped file has parameters for
            for kind in [Kind::Residual, Kind::StructuralDamping] {
                let expected = match kind.needs().contains(&signal) {
                    true => Validity::Held,
                    false => Validity::Valid,
                };
                let found = of(&answer, kind).validity[0];
                assert_eq!(found, expected as u32, "{kind:?} without {signal}");
            }
        }
    }
}
