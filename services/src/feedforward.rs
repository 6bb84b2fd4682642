//! Control torque from model and low-gain feedback: PA10-05, eq (5) and Fig. 2.
//!
//! `T_in N = T_rigid(θ_d, θ̇_d, θ̈_d) + T_friction(θ̇_d, θ_m) + T_c(T_g, sgn θ̇_d) + J N² θ̈_d + K_p (θ_d - θ) + K_d (θ̇_d - θ̇)`,
//! all at the joint side; the model acts on the desired motion, as in the paper, because the measured velocity is noisy.
//! Only position-dependent friction is taken at the measured motor angle, which a resolver knows without noise: with
//! twelve cycles a motor revolution, 5 mrad of tracking error at the joint would put the desired angle half a cycle off.
//! Rigid bodies are those of the file with its payload, tilt and added link inertia; what else it knows of a joint's load and
//! drive is in [`crate::compensation`].
//! [`ControlOptions`] go beyond the paper: friction on measured velocity ([`crate::friction`]), `T_c` at the load of the measured
//! torsion ([`crate::torsion_load`]), and the torque estimator's correction ([`crate::correction`]).

use joint_model::filter::FilterError;
use joint_model::rigid_body::{Chain, ChainError};
use joint_model::velocity_observer::VelocityObserver;
use motion::{Reference, Trajectory};
use robot::{ControlKind, Feedback, Feedforward as ModelPart, Robot, RobotJoint};
use shm_types::JOINTS_MAX;
use shm_types::control_options::{ControlOptions, StiffnessTorque};
use shm_types::messages::{Command, DriveMode, PerJoint, SensorSample, TorqueEstimate};

use crate::compensation::Compensation;
use crate::correction::{Correction, Lesson};
use crate::friction::{FrictionFeedforward, FrictionPoint};
use crate::reference::ReferenceSource;
use crate::torsion_load::{Missing, TorsionLoad};
use joint_model::velocity_filter::VelocityFilter;

/// Of the observed velocity that friction and correction use. At 25 Hz an encoder of the PA-10 that flickers by one step
/// shows less than a tenth of the velocity that its difference would.
const OBSERVER_BANDWIDTH_HZ: f64 = 25.0;

/// The controller of one robot on one trajectory.
#[derive(Clone, Debug)]
pub struct Feedforward {
    robot: Robot,
    /// With the effects on rigid bodies.
    chain: Chain,
    compensation: Vec<Compensation>,
    friction: Vec<FrictionFeedforward>,
    /// None where friction is taken at the model's load.
    torsion_loads: Option<Vec<TorsionLoad>>,
    correction: Correction,
    gains: Vec<Gains>,
    model: ModelPart,
    feedback: Feedback,
    source: ReferenceSource,
    velocity: Vec<VelocityFilter>,
    observers: Vec<VelocityObserver>,
    observed_rad_s: PerJoint,
    period_s: f64,
    reference: Reference,
    gravity_nm: PerJoint,
    rigid_nm: PerJoint,
}

/// Parts of the torque that a model feeds forward to one joint, joint side; inertia is the rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TorqueParts {
    /// `T_g`.
    pub gravity_nm: f64,
    /// `T_cf + T_vf`, as the unloaded gear has it.
    pub friction_nm: f64,
    /// `T_c`: what load adds to friction or takes from it.
    pub stiffness_nm: f64,
}

#[derive(Clone, Copy, Debug)]
struct Gains {
    proportional_nm_rad: f64,
    derivative_nm_s_rad: f64,
}

/// Why a robot cannot be controlled this way.
#[derive(Debug, thiserror::Error)]
pub enum FeedforwardError {
    /// The robot file has no usable gains.
    #[error(
        "robot `{robot}`: {reason}; add a [control] table with kind = \"pd_feedforward\" and its gains"
    )]
    Control {
        /// Its name.
        robot: String,
        /// What is missing.
        reason: String,
    },
    /// An option needs what the robot does not have.
    #[error(
        "robot `{robot}`, joint `{joint}`: stiffness torque from torsion needs {missing}, which the robot file does not give; add it or take the model's load"
    )]
    Torsion {
        /// Its name.
        robot: String,
        /// The first joint without.
        joint: String,
        /// A key or effect of the robot file.
        missing: &'static str,
    },
    /// A correction above the whole or below nothing.
    #[error("correction {gain}: must be between 0 (none) and 1 (all of the estimated model error)")]
    CorrectionGain {
        /// As given.
        gain: f64,
    },
    /// The robot file's payload or link inertia make a body that cannot be.
    #[error("robot `{robot}`: {source}; change payload, link_inertia or base_tilt")]
    Bodies {
        /// Its name.
        robot: String,
        /// Why.
        source: ChainError,
    },
    /// The velocity filter of the robot file cannot be built.
    #[error("robot `{robot}`, [control]: {source}")]
    Filter {
        /// Its name.
        robot: String,
        /// Why.
        source: FilterError,
    },
}

impl Feedforward {
    /// A controller that follows `trajectory` with the robot's own gains.
    ///
    /// # Errors
    /// [`FeedforwardError`] if the robot file says nothing usable about control.
    pub fn new(
        robot: Robot,
        trajectory: Trajectory,
        period_s: f64,
        options: &ControlOptions,
    ) -> Result<Self, FeedforwardError> {
        let control_error = |reason: &str| FeedforwardError::Control {
            robot: robot.name.clone(),
            reason: reason.into(),
        };
        let control = robot
            .control
            .as_ref()
            .ok_or_else(|| control_error("it has no [control]"))?;
        if control.kind != ControlKind::PdFeedforward {
            return Err(control_error("its control is of another kind"));
        }
        if *options != ControlOptions::default() && control.feedforward != ModelPart::Model {
            return Err(control_error(
                "options of the friction feedforward need feedforward = \"model\"",
            ));
        }
        let gain = options.correction_gain;
        if !(0.0..=1.0).contains(&gain) {
            return Err(FeedforwardError::CorrectionGain { gain });
        }
        let gains = control
            .proportional_nm_rad
            .iter()
            .zip(&control.derivative_nm_s_rad);
        let gains: Vec<Gains> = gains
            .map(|(&proportional_nm_rad, &derivative_nm_s_rad)| Gains {
                proportional_nm_rad,
                derivative_nm_s_rad,
            })
            .collect();
        let order = control.velocity_filter_order as usize;
        let velocity = VelocityFilter::new(order, control.velocity_filter_hz, 1.0 / period_s)
            .map_err(|source| FeedforwardError::Filter {
                robot: robot.name.clone(),
                source,
            })?;
        let chain = robot
            .loaded_chain()
            .map_err(|source| FeedforwardError::Bodies {
                robot: robot.name.clone(),
                source,
            })?;
        Ok(Self {
            chain,
            compensation: robot.joints.iter().map(Compensation::of).collect(),
            friction: robot
                .joints
                .iter()
                .map(|joint| {
                    FrictionFeedforward::new(joint.steady_friction(), options.friction_velocity)
                })
                .collect(),
            torsion_loads: match options.stiffness_torque {
                StiffnessTorque::Load => None,
                StiffnessTorque::Torsion => Some(torsion_loads(&robot)?),
            },
            correction: Correction::new(gain, &robot.joints, period_s),
            gains,
            model: control.feedforward,
            feedback: control.feedback,
            source: ReferenceSource::new(trajectory),
            velocity: vec![velocity; robot.joints.len()],
            observers: vec![
                VelocityObserver::new(OBSERVER_BANDWIDTH_HZ, period_s);
                robot.joints.len()
            ],
            observed_rad_s: PerJoint::default(),
            period_s,
            reference: Reference::default(),
            gravity_nm: [0.0; JOINTS_MAX],
            rigid_nm: [0.0; JOINTS_MAX],
            robot,
        })
    }

    /// Keeps a torque estimate for the commands of later cycles.
    pub fn take_estimate(&mut self, estimate: TorqueEstimate) {
        self.correction.take(estimate);
    }

    /// The command that answers one sample. No allocation, no clock.
    pub fn command(&mut self, sample: &SensorSample) -> Command {
        self.learn(sample.header.cycle);
        self.observe(sample);
        self.reference = *self.source.at(sample);
        self.rigid_body_torque();
        let mut command = Command {
            header: sample.header,
            mode: DriveMode::Torque as u32,
            reference_position_rad: self.reference.position_rad,
            reference_velocity_rad_s: self.reference.velocity_rad_s,
            reference_acceleration_rad_s2: self.reference.acceleration_rad_s2,
            ..Command::default()
        };
        for joint in 0..self.robot.joints.len() {
            let gear_ratio = self.robot.joints[joint].gear_ratio;
            let feedforward_nm = self.feedforward_nm(joint, sample) / gear_ratio;
            let feedback_nm = self.feedback_nm(joint, sample) / gear_ratio;
            command.feedforward_torque_nm[joint] = feedforward_nm;
            command.feedback_torque_nm[joint] = feedback_nm;
            command.motor_torque_nm[joint] = feedforward_nm + feedback_nm;
        }
        command
    }

    /// From what the cycle before left: reference, observed velocity and the model's torque belong to its estimate.
    fn learn(&mut self, cycle: u64) {
        self.correction.learn(
            cycle,
            &Lesson {
                desired_velocity_rad_s: &self.reference.velocity_rad_s,
                measured_velocity_rad_s: &self.observed_rad_s,
                modelled_torque_nm: &self.rigid_nm,
            },
        );
    }

    fn observe(&mut self, sample: &SensorSample) {
        for (joint, observer) in self.observers.iter_mut().enumerate() {
            let position_rad =
                sample.readings.motor_position_rad[joint] / self.robot.joints[joint].gear_ratio;
            self.observed_rad_s[joint] = observer.observe(sample.header.cycle, position_rad);
        }
    }

    fn rigid_body_torque(&mut self) {
        let count = self.robot.joints.len();
        let Reference {
            velocity_rad_s,
            acceleration_rad_s2,
            ..
        } = &self.reference;
        if self.model == ModelPart::None {
            return;
        }
        let mut link_rad = self.reference.position_rad;
        for (position_rad, joint) in link_rad.iter_mut().zip(&self.compensation) {
            *position_rad = joint.link_rad(*position_rad);
        }
        self.chain
            .gravity_torque(&link_rad[..count], &mut self.gravity_nm[..count]);
        self.chain.inverse_dynamics(
            &link_rad[..count],
            &velocity_rad_s[..count],
            &acceleration_rad_s2[..count],
            &mut self.rigid_nm[..count],
        );
        for (joint, known) in self.compensation.iter().enumerate() {
            for load_nm in [&mut self.gravity_nm[joint], &mut self.rigid_nm[joint]] {
                *load_nm += known.holding_nm(link_rad[joint], *load_nm);
            }
        }
    }

    fn feedforward_nm(&mut self, joint: usize, sample: &SensorSample) -> f64 {
        if self.model == ModelPart::None {
            return 0.0;
        }
        let drive = &self.robot.joints[joint];
        let rotor_nm = drive.reflected_inertia_kg_m2() * self.reference.acceleration_rad_s2[joint];
        let mut shaft_nm = self.rigid_nm[joint] + rotor_nm;
        if self.model == ModelPart::Model {
            let load_nm = self.load_nm(joint, sample);
            shaft_nm += self.friction_nm(joint, load_nm, sample) + self.correction.torque_nm(joint);
        }
        let motor_rad = sample.readings.motor_position_rad[joint];
        self.compensation[joint].sent_nm(shaft_nm, motor_rad)
    }

    fn friction_nm(&self, joint: usize, load_nm: f64, sample: &SensorSample) -> f64 {
        self.friction[joint].drag_nm(&FrictionPoint {
            desired_velocity_rad_s: self.reference.velocity_rad_s[joint],
            measured_velocity_rad_s: self.observed_rad_s[joint],
            motor_position_rad: sample.readings.motor_position_rad[joint],
            load_nm,
        })
    }

    /// What the model's torque in the command that answered `sample` was made of, as PA10-05, Fig. 9 draws it; `T_c` at
    /// the model's load.
    pub fn torque_parts(&self, joint: usize, sample: &SensorSample) -> TorqueParts {
        if self.model == ModelPart::None {
            return TorqueParts::default();
        }
        let gravity_nm = self.gravity_nm[joint];
        let unloaded_nm = self.friction_nm(joint, 0.0, sample);
        TorqueParts {
            gravity_nm,
            friction_nm: unloaded_nm,
            stiffness_nm: self.friction_nm(joint, gravity_nm, sample) - unloaded_nm,
        }
    }

    /// The torque the gear transmits to the link: gravity, as in the paper, or what the torsion shows.
    fn load_nm(&mut self, joint: usize, sample: &SensorSample) -> f64 {
        let gravity_nm = self.gravity_nm[joint];
        let Some(torsion_loads) = &mut self.torsion_loads else {
            return gravity_nm;
        };
        let readings = &sample.readings;
        let motor_rad = readings.motor_position_rad[joint] / self.robot.joints[joint].gear_ratio;
        torsion_loads[joint].load_nm(motor_rad - readings.link_position_rad[joint], gravity_nm)
    }

    fn feedback_nm(&mut self, joint: usize, sample: &SensorSample) -> f64 {
        let motor_rad =
            sample.readings.motor_position_rad[joint] / self.robot.joints[joint].gear_ratio;
        let position_rad = match self.feedback {
            Feedback::Motor => motor_rad,
            Feedback::Link => sample.readings.link_position_rad[joint],
        };
        let velocity_rad_s =
            self.velocity[joint].observe(sample.header.cycle, position_rad, self.period_s);
        let gains = self.gains[joint];
        gains.proportional_nm_rad * (self.reference.position_rad[joint] - position_rad)
            + gains.derivative_nm_s_rad * (self.reference.velocity_rad_s[joint] - velocity_rad_s)
    }
}

fn torsion_loads(robot: &Robot) -> Result<Vec<TorsionLoad>, FeedforwardError> {
    let load = |joint: &RobotJoint| {
        TorsionLoad::new(joint).map_err(|Missing(missing)| FeedforwardError::Torsion {
            robot: robot.name.clone(),
            joint: joint.name.clone(),
            missing,
        })
    };
    robot.joints.iter().map(load).collect()
}
