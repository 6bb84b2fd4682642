//! The whole arm: joints, rigid bodies, drives and sensors, one control period a step.

mod assembly;
#[cfg(test)]
mod convergence;
mod substeps;

use joint_model::JOINTS_MAX;
use joint_model::rigid_body::Chain;
use robot::{Injection, Push, Robot};

use crate::disturbance::{ArmMotion, Disturbance};
use crate::inject::{Conditions, TimedEffect};
use crate::mechanics::{JointConstants, JointState, LinkMotion};
use crate::noise::Noise;
use crate::sensors::{HISTORY, Observed, Sensors};
use crate::servo::{Servo, Setpoint};
use crate::{JointCommand, PlantCommand, PlantError, PlantParameters, PlantSample, PlantTruth};

/// One joint with its drive and sensors.
#[derive(Clone, Debug)]
struct Joint {
    constants: JointConstants,
    /// With the effects that are the same at all times.
    fixed: Conditions,
    /// Effects that begin or drift during the run.
    timed: Vec<TimedEffect>,
    /// With all effects, as they are in this period.
    now: Conditions,
    state: JointState,
    servo: Servo,
    sensors: Sensors,
    /// Commands as sent, so that they can arrive late; indexed by period.
    commands: Vec<Option<Setpoint>>,
    command_drops: Noise,
    mobility_rad_s2_nm: f64,
}

impl Joint {
    fn motor_position_rad(&self) -> f64 {
        self.state.rotor_rad * self.constants.gear_ratio
    }

    fn refresh(&mut self, time_s: f64) {
        if self.timed.is_empty() {
            return;
        }
        self.now.clone_from(&self.fixed);
        for timed in &self.timed {
            let added = self.now.add(timed, time_s);
            debug_assert!(added.is_ok(), "room was checked when the plant was built");
        }
    }

    /// Remembers what was sent in a period, unless it is lost on the way.
    fn send(&mut self, cycle: u64, setpoint: Option<Setpoint>) {
        let lost = self.command_drops.uniform() < self.now.timing.dropped_commands;
        self.commands[cycle as usize % HISTORY] = setpoint.filter(|_| !lost);
    }

    /// The period whose command arrives during this one, and the substep at which it does.
    fn arrival(&self, cycle: u64, period_s: f64, substeps: usize) -> (Option<u64>, usize) {
        let late_substeps =
            (self.now.timing.command_delay_s / period_s * substeps as f64).round() as usize;
        (
            cycle.checked_sub((late_substeps / substeps) as u64),
            late_substeps % substeps,
        )
    }

    fn receive(&mut self, sent_cycle: Option<u64>) {
        let setpoint = sent_cycle.and_then(|cycle| self.commands[cycle as usize % HISTORY]);
        self.servo.receive(setpoint);
    }

    /// Drive, rotor and gear to the end of a substep; the torque left to the link.
    fn advance(&mut self, link_position_rad: f64, link_velocity_rad_s: f64, step_s: f64) -> f64 {
        let (actuator, sensing) = (&self.now.actuator, &self.now.sensing);
        self.servo
            .advance(actuator, sensing, self.state.rotor_rad_s, step_s);
        let link = LinkMotion {
            position_rad: link_position_rad,
            velocity_rad_s: link_velocity_rad_s,
            mobility_rad_s2_nm: self.mobility_rad_s2_nm,
        };
        let shaft = self.servo.shaft(self.shaft_nm());
        self.state
            .advance(&self.constants, &self.now, &link, shaft, step_s);
        let load_nm = self.state.joint_torque_nm;
        load_nm - self.now.holding_nm(link_position_rad, load_nm)
    }

    fn shaft_nm(&self) -> f64 {
        let gear_ratio = self.constants.gear_ratio;
        self.now.actuator.shaft_nm(
            self.servo.torque_nm(),
            self.motor_position_rad(),
            gear_ratio,
        )
    }

    fn observed(&self, link_position_rad: f64) -> Observed {
        Observed {
            motor_position_rad: self.motor_position_rad(),
            motor_velocity_rad_s: self.servo.velocity_rad_s(&self.now.sensing)
                * self.constants.gear_ratio,
            motor_torque_nm: self.servo.torque_nm(),
            link_position_rad,
            joint_torque_nm: self.state.joint_torque_nm,
        }
    }
}

/// The emulated arm.
#[derive(Debug)]
pub struct Plant {
    joints: Vec<Joint>,
    pushes: Vec<Push>,
    /// What pushes the links in this period.
    external_nm: [f64; JOINTS_MAX],
    /// Rigid bodies, each with the time from which they hold.
    chains: Vec<(f64, Chain)>,
    chain: usize,
    link_position_rad: [f64; JOINTS_MAX],
    link_velocity_rad_s: [f64; JOINTS_MAX],
    cycle: u64,
    period_s: f64,
    substeps: usize,
    sample: PlantSample,
    /// Each with the joint whose link it acts on.
    disturbances: Vec<(usize, Box<dyn Disturbance>)>,
}

impl Plant {
    /// An arm at rest with its links at `initial_position_rad`, its gears wound up by the load, its drives holding.
    ///
    /// The seed fixes how the arm deviates from its robot file, its noise and its losses.
    ///
    /// # Errors
    /// [`PlantError`], naming the value that decided it.
    pub fn new(
        robot: &Robot,
        parameters: &PlantParameters,
        injections: &[Injection],
        seed: u64,
        initial_position_rad: &[f64],
        period_s: f64,
    ) -> Result<Self, PlantError> {
        assembly::assemble(
            robot,
            parameters,
            injections,
            seed,
            initial_position_rad,
            period_s,
        )
    }

    /// The same arm with pushes from outside. Each acts in the periods that begin within its time.
    #[must_use]
    pub fn with_pushes(mut self, pushes: Vec<Push>) -> Self {
        self.pushes = pushes;
        self
    }

    /// Pushes a joint from now on. What names a joint that is not there does nothing.
    pub fn push(&mut self, joint: usize, torque_nm: f64, duration_s: f64) {
        let start_s = self.time_s();
        let is_to_come = |push: &Push| push.start_s + push.duration_s > start_s;
        self.pushes.retain(is_to_come);
        self.pushes.push(Push {
            joint,
            torque_nm,
            start_s,
            duration_s,
        });
    }

    /// Has something outside every model act on a joint's link, beside whatever acts there already.
    ///
    /// # Errors
    /// [`PlantError::DisturbedJoint`] if there is no such joint.
    pub fn disturb(
        &mut self,
        joint: usize,
        disturbance: Box<dyn Disturbance>,
    ) -> Result<(), PlantError> {
        let joints = self.joints.len();
        if joint >= joints {
            return Err(PlantError::DisturbedJoint { joint, joints });
        }
        self.disturbances.push((joint, disturbance));
        Ok(())
    }

    /// Advances one control period. The command reaches the drives at its beginning, the sensors latch at its end.
    pub fn step(&mut self, command: &PlantCommand) -> PlantSample {
        self.step_joints(command.fresh, &command.joints())
    }

    /// The same with a command of its own for each joint's drive; `fresh` as in [`PlantCommand`].
    pub fn step_joints(
        &mut self,
        fresh: bool,
        commands: &[JointCommand; JOINTS_MAX],
    ) -> PlantSample {
        self.begin_period(fresh, commands);
        let arrivals = self.arrivals();
        let step_s = self.period_s / self.substeps as f64;
        let start_s = self.time_s();
        for substep in 0..self.substeps {
            for (joint, (sent_cycle, at_substep)) in self.joints.iter_mut().zip(arrivals) {
                if substep == at_substep {
                    joint.receive(sent_cycle);
                }
            }
            self.advance(start_s + substep as f64 * step_s, step_s);
        }
        self.refresh_mobility();
        self.cycle += 1;
        self.latch();
        self.sample
    }

    /// The sensors as last latched.
    pub fn sample(&self) -> PlantSample {
        self.sample
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// Substeps in a control period, chosen when the plant was built.
    pub fn substeps(&self) -> usize {
        self.substeps
    }

    /// Time since the start.
    pub fn time_s(&self) -> f64 {
        self.cycle as f64 * self.period_s
    }

    fn begin_period(&mut self, fresh: bool, commands: &[JointCommand; JOINTS_MAX]) {
        let time_s = self.time_s();
        while self
            .chains
            .get(self.chain + 1)
            .is_some_and(|(start_s, _)| *start_s <= time_s)
        {
            self.chain += 1;
        }
        self.external_nm = [0.0; JOINTS_MAX];
        let now = |push: &&Push| (push.start_s..push.start_s + push.duration_s).contains(&time_s);
        for push in self.pushes.iter().filter(now) {
            self.external_nm[push.joint] += push.torque_nm;
        }
        for (joint, command) in self.joints.iter_mut().zip(commands) {
            joint.refresh(time_s);
            let setpoint = Setpoint::new(
                command.mode,
                command.motor_torque_nm,
                command.joint_velocity_rad_s,
            );
            joint.send(self.cycle, setpoint.filter(|_| fresh));
        }
    }

    fn arrivals(&self) -> [(Option<u64>, usize); JOINTS_MAX] {
        let mut arrivals = [(None, 0); JOINTS_MAX];
        for (arrival, joint) in arrivals.iter_mut().zip(&self.joints) {
            *arrival = joint.arrival(self.cycle, self.period_s, self.substeps);
        }
        arrivals
    }

    /// One substep: joint torques from the motion at its beginning, velocities from them, positions from those.
    fn advance(&mut self, time_s: f64, step_s: f64) {
        let mut torque_nm = [0.0; JOINTS_MAX];
        let mut acceleration_rad_s2 = [0.0; JOINTS_MAX];
        for (index, joint) in self.joints.iter_mut().enumerate() {
            torque_nm[index] = joint.advance(
                self.link_position_rad[index],
                self.link_velocity_rad_s[index],
                step_s,
            ) + self.external_nm[index];
        }
        let joints = self.joints.len();
        let arm = ArmMotion {
            time_s,
            step_s,
            link_position_rad: &self.link_position_rad[..joints],
            link_velocity_rad_s: &self.link_velocity_rad_s[..joints],
        };
        for (joint, disturbance) in &mut self.disturbances {
            torque_nm[*joint] += disturbance.torque_nm(&arm);
        }
        let (_, chain) = &self.chains[self.chain];
        chain.forward_dynamics(
            &self.link_position_rad,
            &self.link_velocity_rad_s,
            &torque_nm,
            &mut acceleration_rad_s2,
        );
        let motion = self
            .link_position_rad
            .iter_mut()
            .zip(&mut self.link_velocity_rad_s);
        for ((position_rad, velocity_rad_s), acceleration_rad_s2) in
            motion.zip(&acceleration_rad_s2)
        {
            *velocity_rad_s += step_s * acceleration_rad_s2;
            *position_rad += step_s * *velocity_rad_s;
        }
    }

    /// One joint's mobility a period: it only steadies the damping, and changes no faster than the pose.
    fn refresh_mobility(&mut self) {
        let index = self.cycle as usize % self.joints.len();
        let (_, chain) = &self.chains[self.chain];
        self.joints[index].mobility_rad_s2_nm =
            mobility_rad_s2_nm(chain, &self.link_position_rad, index);
    }

    fn latch(&mut self) {
        self.sample.cycle = self.cycle;
        for (index, joint) in self.joints.iter_mut().enumerate() {
            let observed = joint.observed(self.link_position_rad[index]);
            let (sensing, timing) = (&joint.now.sensing, &joint.now.timing);
            let reading = joint
                .sensors
                .latch(observed, sensing, timing, self.period_s);
            self.sample.fresh[index] = reading.is_some();
            self.sample.drive[index] = joint.servo.state();
            self.sample.torque_limited[index] = joint.servo.is_limited();
            if let Some(reading) = reading {
                self.sample.motor_position_rad[index] = reading.motor_position_rad;
                self.sample.motor_velocity_rad_s[index] = reading.motor_velocity_rad_s;
                self.sample.motor_torque_nm[index] = reading.motor_torque_nm;
                self.sample.link_position_rad[index] = reading.link_position_rad;
                self.sample.joint_torque_nm[index] = reading.joint_torque_nm;
            }
        }
    }

    /// What no sensor shows.
    pub fn truth(&self) -> PlantTruth {
        let mut truth = PlantTruth {
            joint_count: self.joints.len(),
            motor_position_rad: [f64::NAN; JOINTS_MAX],
            motor_velocity_rad_s: [f64::NAN; JOINTS_MAX],
            motor_torque_nm: [f64::NAN; JOINTS_MAX],
            link_position_rad: [f64::NAN; JOINTS_MAX],
            link_velocity_rad_s: [f64::NAN; JOINTS_MAX],
            joint_torque_nm: [f64::NAN; JOINTS_MAX],
            friction_torque_nm: [f64::NAN; JOINTS_MAX],
            mechanical_energy_j: self.mechanical_energy_j(),
        };
        for (index, joint) in self.joints.iter().enumerate() {
            truth.motor_position_rad[index] = joint.motor_position_rad();
            truth.motor_velocity_rad_s[index] =
                joint.state.rotor_rad_s * joint.constants.gear_ratio;
            truth.motor_torque_nm[index] = joint.shaft_nm();
            truth.link_position_rad[index] = self.link_position_rad[index];
            truth.link_velocity_rad_s[index] = self.link_velocity_rad_s[index];
            truth.joint_torque_nm[index] = joint.state.joint_torque_nm;
            truth.friction_torque_nm[index] = joint.state.friction_nm;
        }
        truth
    }

    fn mechanical_energy_j(&self) -> f64 {
        let (_, chain) = &self.chains[self.chain];
        let at_rest = [0.0; JOINTS_MAX];
        let (mut with_gravity_nm, mut gravity_nm) = ([0.0; JOINTS_MAX], [0.0; JOINTS_MAX]);
        // M(q)·q̇ is the torque that would give an acceleration of the velocity's size
        let as_acceleration = &self.link_velocity_rad_s;
        chain.inverse_dynamics(
            &self.link_position_rad,
            &at_rest,
            as_acceleration,
            &mut with_gravity_nm,
        );
        chain.gravity_torque(&self.link_position_rad, &mut gravity_nm);
        let joints_j: f64 = self
            .joints
            .iter()
            .enumerate()
            .map(|(index, joint)| {
                let position_rad = self.link_position_rad[index];
                let momentum = with_gravity_nm[index] - gravity_nm[index];
                0.5 * self.link_velocity_rad_s[index] * momentum
                    + joint
                        .state
                        .energy_j(&joint.constants, &joint.now, position_rad)
                    + joint.now.energy_j(position_rad)
            })
            .sum();
        joints_j + chain.potential_energy_j(&self.link_position_rad)
    }
}

/// Joint acceleration per torque at that joint, all other torques held.
fn mobility_rad_s2_nm(chain: &Chain, position_rad: &[f64; JOINTS_MAX], joint: usize) -> f64 {
    let at_rest = [0.0; JOINTS_MAX];
    let (mut pushed, mut free) = ([0.0; JOINTS_MAX], [0.0; JOINTS_MAX]);
    let mut torque_nm = [0.0; JOINTS_MAX];
    chain.forward_dynamics(position_rad, &at_rest, &torque_nm, &mut free);
    torque_nm[joint] = 1.0;
    chain.forward_dynamics(position_rad, &at_rest, &torque_nm, &mut pushed);
    pushed[joint] - free[joint]
}
