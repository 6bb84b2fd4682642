//! One control cycle as a pure function of time, drive sample, command and state.
//!
//! ```text
//! Initialising ──sample──► Ready ──command──► Running ◄──command── Holding ◄─┐
//!                                               │ ▲                  ▲       │
//!                                               │ └────command── Damping     │
//!                                               └── nothing fresh ──────────►┘ → Damping → SafeStop (latched)
//! any state ── a joint has run away ──► SafeStop
//! ```
//!
//! "Nothing fresh" is a missing command or a missing sample. The last torque is held for [`CycleConfig::hold_cycles`],
//! then the joints are damped without any model, and after [`CycleConfig::damping_cycles`] the loop stops for good.

use shm_types::JOINTS_MAX;
use shm_types::messages::{
    ABSENT, Command, DriveCommand, DriveMode, DriveSample, Header, LoopState, LoopStatus, PerJoint,
    SensorSample,
};

use crate::driver::DriveFault;
use crate::limits::{JointLimits, JointMotion, allowed_torques_nm, allowed_velocities_rad_s};
use crate::statistics::{Counters, CycleTimes};

/// What does not change during a run.
#[derive(Clone, Debug, PartialEq)]
pub struct CycleConfig {
    /// Number of the run; carried by every message.
    pub session: u64,
    /// Control period.
    pub period_ns: u64,
    /// Joint limits, in the robot's order.
    pub joints: Vec<JointLimits>,
    /// Cycles without a fresh command for which the last torque is held.
    pub hold_cycles: u64,
    /// Cycles of damping after that, before the safe stop.
    pub damping_cycles: u64,
}

/// A sample shows what the drives made of a command at most this many cycles after it was sent.
const DRIVE_ANSWER_CYCLES: u64 = 3;
/// How long after damping the trajectory takes to come back to full speed.
const MOTION_RAMP_S: f64 = 0.3;

impl CycleConfig {
    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    fn period_s(&self) -> f64 {
        self.period_ns as f64 * 1e-9
    }
}

/// Why the loop last left [`LoopState::Running`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// No fresh command.
    CommandMissing,
    /// No sample from the drives.
    Drive(DriveFault),
    /// The drives have stopped by themselves: their watchdog missed commands.
    DrivesStopped,
    /// A joint moved far outside its limits.
    Runaway {
        /// The joint.
        joint: u32,
    },
}

impl Fault {
    /// The number it travels as: kind in the low byte, joint above it. 0 is no fault.
    pub fn code(self) -> u32 {
        match self {
            Self::CommandMissing => 1,
            Self::Drive(DriveFault::NoSample) => 2,
            Self::Drive(DriveFault::StaleSample { .. }) => 3,
            Self::Drive(DriveFault::ForeignSample) => 4,
            Self::Drive(DriveFault::InvalidSample { joint }) => 5 | (joint << 8),
            Self::Drive(DriveFault::ModeRefused { .. }) => 6,
            Self::Drive(DriveFault::NotSent) => 7,
            Self::Runaway { joint } => 8 | (joint << 8),
            Self::DrivesStopped => 9,
        }
    }
}

/// What the loop remembers from cycle to cycle.
#[derive(Clone, Debug, PartialEq)]
pub struct CycleState {
    /// Where the state machine stands.
    pub state: LoopState,
    /// Why it last left [`LoopState::Running`].
    pub fault: Option<Fault>,
    /// Cycles in a row without a fresh command.
    pub cycles_without_command: u64,
    /// Where the trajectory stood in [`last_cycle`](Self::last_cycle).
    motion_time_ns: u64,
    motion_rate: f64,
    last_cycle: u64,
    sent_mode: DriveMode,
    sent_torque_nm: PerJoint,
    sent_velocity_rad_s: PerJoint,
    /// Cycles in a row in which the drives were sent a torque or a velocity.
    moving_cycles: u64,
    motion: [JointMotion; JOINTS_MAX],
    /// Cycle of the last measurement; a velocity needs two.
    measured_cycle: Option<u64>,
}

impl Default for CycleState {
    fn default() -> Self {
        Self {
            state: LoopState::Initialising,
            fault: None,
            cycles_without_command: 0,
            motion_time_ns: 0,
            motion_rate: 1.0,
            last_cycle: 0,
            sent_mode: DriveMode::Torque,
            sent_torque_nm: [0.0; JOINTS_MAX],
            sent_velocity_rad_s: [0.0; JOINTS_MAX],
            moving_cycles: 0,
            motion: [JointMotion::default(); JOINTS_MAX],
            measured_cycle: None,
        }
    }
}

/// What a cycle works with.
#[derive(Clone, Copy, Debug)]
pub struct CycleInput<'a> {
    /// Counts every period since the start, skipped ones too.
    pub cycle: u64,
    /// The planned instant of this cycle.
    pub planned_ns: u64,
    /// What the drives measured.
    pub sample: Result<&'a DriveSample, DriveFault>,
    /// The command that answers this cycle's sample, if it came in time.
    pub command: Option<&'a Command>,
}

/// What a cycle decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleOutput {
    /// For the drives.
    pub drive_command: DriveCommand,
    /// Joints whose command was limited, one bit each.
    pub limited_joints: u64,
}

impl CycleState {
    /// The message that asks the services for the command of `cycle`.
    pub fn sensor_sample(
        &self,
        config: &CycleConfig,
        cycle: u64,
        sample: &DriveSample,
    ) -> SensorSample {
        SensorSample {
            header: Header {
                session: config.session,
                cycle,
                ..sample.header
            },
            motion_time_ns: self.motion_time_at(config, cycle),
            motion_rate: self.motion_rate,
            state: self.state as u32,
            reserved: 0,
            readings: sample.readings,
        }
    }

    /// One cycle.
    pub fn step(&mut self, config: &CycleConfig, input: &CycleInput<'_>) -> CycleOutput {
        self.motion_time_ns = self.motion_time_at(config, input.cycle);
        self.last_cycle = input.cycle;
        if let Ok(sample) = input.sample {
            self.observe_motion(config, input.cycle, sample);
        }
        self.advance_state(config, input);
        self.advance_motion_rate(config);
        self.drive_command(config, input)
    }

    fn motion_time_at(&self, config: &CycleConfig, cycle: u64) -> u64 {
        if !matches!(self.state, LoopState::Running | LoopState::Holding) {
            return self.motion_time_ns;
        }
        let elapsed_ns = cycle.saturating_sub(self.last_cycle) * config.period_ns;
        self.motion_time_ns + (elapsed_ns as f64 * self.motion_rate).round() as u64
    }

    fn observe_motion(&mut self, config: &CycleConfig, cycle: u64, sample: &DriveSample) {
        let elapsed_s = self
            .measured_cycle
            .map(|before| cycle.saturating_sub(before) as f64 * config.period_s());
        for (joint, limits) in config.joints.iter().enumerate() {
            let position_rad = sample.readings.motor_position_rad[joint] / limits.gear_ratio;
            let motion = &mut self.motion[joint];
            motion.velocity_rad_s = match elapsed_s {
                Some(elapsed_s) if elapsed_s > 0.0 => {
                    (position_rad - motion.position_rad) / elapsed_s
                }
                _ => 0.0,
            };
            motion.position_rad = position_rad;
        }
        self.measured_cycle = Some(cycle);
    }

    fn advance_state(&mut self, config: &CycleConfig, input: &CycleInput<'_>) {
        if self.state == LoopState::SafeStop {
            return;
        }
        if let Some(joint) = self.runaway_joint(config) {
            self.fault = Some(Fault::Runaway { joint });
            self.state = LoopState::SafeStop;
            return;
        }
        let fresh = input.sample.is_ok() && input.command.is_some();
        if fresh && self.drives_have_stopped(input.sample) {
            // Damping is also what acknowledges the drives' watchdog; the next fresh command goes on.
            self.cycles_without_command += 1;
            self.fault = Some(Fault::DrivesStopped);
            self.state = LoopState::Damping;
            return;
        }
        match self.state {
            LoopState::Initialising | LoopState::Ready if !fresh => {
                if input.sample.is_ok() {
                    self.state = LoopState::Ready;
                }
            }
            _ if fresh => {
                self.cycles_without_command = 0;
                self.state = LoopState::Running;
            }
            _ => {
                self.cycles_without_command += 1;
                self.fault = Some(match input.sample {
                    Err(fault) => Fault::Drive(fault),
                    Ok(_) => Fault::CommandMissing,
                });
                self.state = match self.cycles_without_command {
                    missed if missed <= config.hold_cycles => LoopState::Holding,
                    missed if missed <= config.hold_cycles + config.damping_cycles => {
                        LoopState::Damping
                    }
                    _ => LoopState::SafeStop,
                };
            }
        }
    }

    /// Whether the drives damp although a torque should have reached them by now.
    fn drives_have_stopped(&self, sample: Result<&DriveSample, DriveFault>) -> bool {
        let damping = sample.is_ok_and(|sample| sample.mode == DriveMode::Damping as u32);
        damping && self.moving_cycles > DRIVE_ANSWER_CYCLES
    }

    fn runaway_joint(&self, config: &CycleConfig) -> Option<u32> {
        if !matches!(
            self.state,
            LoopState::Running | LoopState::Holding | LoopState::Damping
        ) {
            return None;
        }
        let runs_away = |(joint, limits): (usize, &JointLimits)| {
            limits
                .has_run_away(self.motion[joint])
                .then_some(joint as u32)
        };
        config.joints.iter().enumerate().find_map(runs_away)
    }

    fn advance_motion_rate(&mut self, config: &CycleConfig) {
        match self.state {
            // The joints stand still or sag: the trajectory waits, and starts again gently.
            LoopState::Damping | LoopState::SafeStop => self.motion_rate = 0.0,
            LoopState::Running => {
                self.motion_rate = (self.motion_rate + config.period_s() / MOTION_RAMP_S).min(1.0)
            }
            _ => (),
        }
    }

    fn drive_command(&mut self, config: &CycleConfig, input: &CycleInput<'_>) -> CycleOutput {
        let mut limited_joints = 0;
        let mode = match self.state {
            LoopState::Initialising | LoopState::Ready | LoopState::SafeStop => {
                self.forget_sent();
                DriveMode::Braked
            }
            LoopState::Running => {
                if let Some(command) = input.command {
                    limited_joints = self.obey(config, command);
                }
                self.sent_mode
            }
            LoopState::Holding => {
                limited_joints = self.hold(config);
                self.sent_mode
            }
            LoopState::Damping => {
                self.sent_velocity_rad_s = [0.0; JOINTS_MAX];
                for (joint, limits) in config.joints.iter().enumerate() {
                    self.sent_torque_nm[joint] = limits.damping_torque_nm(self.motion[joint]);
                }
                // Without a measurement the loop's own damping would act on an old velocity: leave it to the drives.
                // And drives that have stopped do nothing else anyway.
                let own = input.sample.is_ok() && self.fault != Some(Fault::DrivesStopped);
                if own {
                    DriveMode::Torque
                } else {
                    DriveMode::Damping
                }
            }
        };
        self.moving_cycles = match mode {
            DriveMode::Torque | DriveMode::Velocity => self.moving_cycles + 1,
            DriveMode::Braked | DriveMode::Damping => 0,
        };
        let header = Header {
            session: config.session,
            cycle: input.cycle,
            measured_at_ns: input.planned_ns,
            joint_count: config.joint_count() as u64,
        };
        let drive_command = DriveCommand {
            header,
            mode: mode as u32,
            reserved: 0,
            motor_torque_nm: self.sent_torque_nm,
            joint_velocity_rad_s: self.sent_velocity_rad_s,
        };
        CycleOutput {
            drive_command,
            limited_joints,
        }
    }

    fn forget_sent(&mut self) {
        self.sent_torque_nm = [0.0; JOINTS_MAX];
        self.sent_velocity_rad_s = [0.0; JOINTS_MAX];
    }

    /// What the command asks for, within the limits.
    fn obey(&mut self, config: &CycleConfig, command: &Command) -> u64 {
        let first = self.fault.is_none() && self.moving_cycles == 0;
        if DriveMode::from_raw(command.mode) == Some(DriveMode::Velocity) {
            self.sent_mode = DriveMode::Velocity;
            self.limited_velocity(config, &command.joint_velocity_rad_s)
        } else {
            self.sent_mode = DriveMode::Torque;
            // Brakes open with this torque: from zero, the rate limit would let the arm sag first.
            if first {
                self.sent_torque_nm = command.motor_torque_nm;
            }
            self.limited_torque(config, &command.motor_torque_nm)
        }
    }

    /// What was sent last, within the limits.
    fn hold(&mut self, config: &CycleConfig) -> u64 {
        if self.sent_mode == DriveMode::Velocity {
            let held_rad_s = self.sent_velocity_rad_s;
            self.limited_velocity(config, &held_rad_s)
        } else {
            let held_nm = self.sent_torque_nm;
            self.limited_torque(config, &held_nm)
        }
    }

    fn limited_torque(&mut self, config: &CycleConfig, asked_nm: &PerJoint) -> u64 {
        let (torque_nm, limited_joints) = allowed_torques_nm(
            &config.joints,
            asked_nm,
            &self.sent_torque_nm,
            &self.motion,
            config.period_s(),
        );
        self.sent_torque_nm = torque_nm;
        self.sent_velocity_rad_s = [0.0; JOINTS_MAX];
        limited_joints
    }

    fn limited_velocity(&mut self, config: &CycleConfig, asked_rad_s: &PerJoint) -> u64 {
        let (velocity_rad_s, limited_joints) = allowed_velocities_rad_s(
            &config.joints,
            asked_rad_s,
            &self.sent_velocity_rad_s,
            &self.motion,
            config.period_s(),
        );
        self.sent_velocity_rad_s = velocity_rad_s;
        self.sent_torque_nm = [0.0; JOINTS_MAX];
        limited_joints
    }
}

/// The message that ends a cycle: how the loop stands, what it sent, how it kept its time.
pub fn loop_status(
    state: &CycleState,
    output: &CycleOutput,
    times: &CycleTimes,
    counters: &Counters,
) -> LoopStatus {
    let sent = &output.drive_command;
    LoopStatus {
        header: sent.header,
        state: state.state as u32,
        fault: state.fault.map_or(0, |fault| fault.code()),
        limited_joints: output.limited_joints,
        wakeup_lateness_ns: times.wakeup_lateness_ns,
        compute_ns: times.compute_ns,
        command_latency_ns: times.command_latency_ns,
        exchange_ns: times.exchange_ns,
        missed_deadlines: counters.missed_deadlines,
        skipped_periods: counters.skipped_periods,
        stale_commands: counters.stale_commands,
        refused_commands: counters.refused_commands(),
        // In velocity mode no torque was commanded, which is not the same as none.
        motor_torque_nm: if sent.mode == DriveMode::Velocity as u32 {
            ABSENT
        } else {
            sent.motor_torque_nm
        },
    }
}

/// Whether a command may be used at all: it asks for torque or velocity, and every joint's is a number.
pub fn is_usable(command: &Command, joint_count: usize) -> bool {
    let asked = match DriveMode::from_raw(command.mode) {
        Some(DriveMode::Torque) => &command.motor_torque_nm,
        Some(DriveMode::Velocity) => &command.joint_velocity_rad_s,
        Some(DriveMode::Braked | DriveMode::Damping) | None => return false,
    };
    asked[..joint_count].iter().all(|value| value.is_finite())
}

/// Whether a drive sample may be used: it is of this run and robot, and every joint has a position.
///
/// # Errors
/// [`DriveFault::ForeignSample`], [`DriveFault::InvalidSample`].
pub fn check_sample(
    sample: &DriveSample,
    session: u64,
    joint_count: usize,
) -> Result<(), DriveFault> {
    sample
        .header
        .check(session, joint_count)
        .map_err(|_| DriveFault::ForeignSample)?;
    let invalid = |position: &f64| !position.is_finite();
    match sample.readings.motor_position_rad[..joint_count]
        .iter()
        .position(invalid)
    {
        Some(joint) => Err(DriveFault::InvalidSample {
            joint: joint as u32,
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn config() -> CycleConfig {
        let joint = JointLimits {
            gear_ratio: 50.0,
            motor_torque_nm: 2.0,
            motor_torque_rate_nm_s: 300.0,
            position_min_rad: -1.0,
            position_max_rad: 1.0,
            velocity_rad_s: 1.0,
            acceleration_rad_s2: 10.0,
            damping_nm_s_rad: 50.0,
        };
        CycleConfig {
            session: 9,
            period_ns: 666_667,
            joints: vec![joint; 2],
            hold_cycles: 3,
            damping_cycles: 4,
        }
    }

    fn sample(position_rad: f64) -> DriveSample {
        let header = Header {
            session: 9,
            cycle: 0,
            measured_at_ns: 0,
            joint_count: 2,
        };
        let mut sample = DriveSample {
            header,
            ..DriveSample::default()
        };
        sample.readings.motor_position_rad[..2].fill(50.0 * position_rad);
        sample
    }

    fn command(torque_nm: f64) -> Command {
        Command {
            mode: DriveMode::Torque as u32,
            motor_torque_nm: [torque_nm; JOINTS_MAX],
            ..Command::default()
        }
    }

    fn run(
        state: &mut CycleState,
        cycle: u64,
        sample: Result<&DriveSample, DriveFault>,
        command: Option<&Command>,
    ) -> CycleOutput {
        state.step(
            &config(),
            &CycleInput {
                cycle,
                planned_ns: cycle * 666_667,
                sample,
                command,
            },
        )
    }

    #[test]
    fn the_policy_for_missing_commands_goes_step_by_step_and_latches() {
        let (still, hold) = (sample(0.0), command(1.0));
        let mut state = CycleState::default();
        let mut seen = Vec::new();
        run(&mut state, 0, Err(DriveFault::NoSample), None);
        seen.push(state.state);
        run(&mut state, 1, Ok(&still), None);
        seen.push(state.state);
        let first = run(&mut state, 2, Ok(&still), Some(&hold));
        assert_eq!(
            first.drive_command.motor_torque_nm[0], 1.0,
            "brakes open with the whole torque"
        );
        seen.push(state.state);
        for cycle in 3..12 {
            run(&mut state, cycle, Ok(&still), None);
            seen.push(state.state);
        }
        let late = run(&mut state, 12, Ok(&still), Some(&hold));
        seen.push(state.state);
        use LoopState::*;
        assert_eq!(
            seen,
            [
                Initialising,
                Ready,
                Running,
                Holding,
                Holding,
                Holding,
                Damping,
                Damping,
                Damping,
                Damping,
                SafeStop,
                SafeStop,
                SafeStop
            ]
        );
        assert_eq!(late.drive_command.mode, DriveMode::Braked as u32);
        assert_eq!(late.drive_command.motor_torque_nm[0], 0.0);
    }

    #[test]
    fn one_late_cycle_changes_nothing_but_a_counter() {
        let (still, hold) = (sample(0.0), command(1.0));
        let mut state = CycleState::default();
        for cycle in 0..100 {
            run(&mut state, cycle, Ok(&still), Some(&hold));
        }
        let held = run(&mut state, 100, Ok(&still), None);
        assert_eq!(
            (state.state, held.drive_command.motor_torque_nm[0]),
            (LoopState::Holding, 1.0)
        );
        let before_ns = state.motion_time_ns;
        run(&mut state, 101, Ok(&still), Some(&hold));
        assert_eq!(state.state, LoopState::Running);
        assert_eq!(
            state.motion_time_ns,
            before_ns + 666_667,
            "the trajectory keeps time"
        );
    }

    #[test]
    fn skipped_periods_advance_the_trajectory_and_damping_stops_it() {
        let (still, hold) = (sample(0.0), command(0.0));
        let mut state = CycleState::default();
        run(&mut state, 0, Ok(&still), Some(&hold));
        run(&mut state, 5, Ok(&still), Some(&hold));
        assert_eq!(state.motion_time_ns, 5 * 666_667);
        for cycle in 6..11 {
            run(&mut state, cycle, Ok(&still), None);
        }
        assert_eq!((state.state, state.motion_rate), (LoopState::Damping, 0.0));
        let waiting_ns = state.motion_time_ns;
        run(&mut state, 11, Ok(&still), Some(&hold));
        assert_eq!(state.motion_time_ns, waiting_ns);
        let asked = state.sensor_sample(&config(), 12, &still);
        assert!(
            asked.motion_time_ns < waiting_ns + 666_667 / 100,
            "starts again gently"
        );
    }

    #[test]
    fn drives_that_have_stopped_are_acknowledged_and_the_run_goes_on() {
        let (still, hold) = (sample(0.0), command(1.0));
        let stopped = DriveSample {
            mode: DriveMode::Damping as u32,
            ..still
        };
        let mut state = CycleState::default();
        for cycle in 0..10 {
            run(&mut state, cycle, Ok(&still), Some(&hold));
        }
        let acknowledged = run(&mut state, 10, Ok(&stopped), Some(&hold));
        assert_eq!(
            (state.state, acknowledged.drive_command.mode),
            (LoopState::Damping, DriveMode::Damping as u32)
        );
        assert_eq!(state.fault, Some(Fault::DrivesStopped));
        // The drives still show damping for two cycles, now because they were asked to.
        for cycle in 11..13 {
            let output = run(&mut state, cycle, Ok(&stopped), Some(&hold));
            assert_eq!(
                (state.state, output.drive_command.mode),
                (LoopState::Running, DriveMode::Torque as u32)
            );
        }
        run(&mut state, 13, Ok(&still), Some(&hold));
        assert_eq!(state.state, LoopState::Running);
    }

    #[test]
    fn velocities_are_limited_held_and_dropped_like_torques() {
        let still = sample(0.0);
        let ask = |velocity_rad_s| Command {
            mode: DriveMode::Velocity as u32,
            joint_velocity_rad_s: [velocity_rad_s; JOINTS_MAX],
            ..Command::default()
        };
        let mut state = CycleState::default();
        let mut sent_rad_s = 0.0;
        for cycle in 0..200 {
            let output = run(&mut state, cycle, Ok(&still), Some(&ask(5.0)));
            assert_eq!(output.drive_command.mode, DriveMode::Velocity as u32);
            let rad_s = output.drive_command.joint_velocity_rad_s[0];
            assert!(
                rad_s - sent_rad_s < 10.0 / 1500.0 + 1e-6,
                "no faster than the limit"
            );
            sent_rad_s = rad_s;
        }
        assert_eq!(sent_rad_s, 1.0, "the velocity limit");
        let held = run(&mut state, 200, Ok(&still), None);
        assert_eq!(held.drive_command.joint_velocity_rad_s[0], 1.0);
        for cycle in 201..210 {
            run(&mut state, cycle, Ok(&still), None);
        }
        let damped = run(&mut state, 210, Ok(&still), None);
        assert_ne!(damped.drive_command.mode, DriveMode::Velocity as u32);
        assert_eq!(damped.drive_command.joint_velocity_rad_s[0], 0.0);
        assert!(!is_usable(&ask(f64::NAN), 2));
        assert!(!is_usable(
            &Command {
                mode: 9,
                ..ask(0.0)
            },
            2
        ));
    }

    #[test]
    fn a_joint_that_runs_away_ends_the_run() {
        let hold = command(0.0);
        let mut state = CycleState::default();
        run(&mut state, 0, Ok(&sample(0.0)), Some(&hold));
        let output = run(&mut state, 1, Ok(&sample(0.1)), Some(&hold));
        assert_eq!(state.fault, Some(Fault::Runaway { joint: 0 }));
        assert_eq!(output.drive_command.mode, DriveMode::Braked as u32);
    }

    #[test]
    fn samples_that_are_not_ours_or_no_numbers_are_faults() {
        let mut foreign = sample(0.0);
        foreign.header.session = 8;
        assert_eq!(check_sample(&foreign, 9, 2), Err(DriveFault::ForeignSample));
        let mut broken = sample(0.0);
        broken.readings.motor_position_rad[1] = f64::INFINITY;
        assert_eq!(
            check_sample(&broken, 9, 2),
            Err(DriveFault::InvalidSample { joint: 1 })
        );
        assert!(!is_usable(&command(f64::NAN), 2));
    }

    proptest! {
        /// Whatever comes in whatever order: torque only flows while a command is fresh or was a moment ago, and
        /// never again after the safe stop.
        #[test]
        fn no_torque_without_a_command(events in prop::collection::vec((any::<bool>(), any::<bool>(), -3.0..3.0_f64), 1..200)) {
            let mut state = CycleState::default();
            let mut since_command = u64::MAX / 2;
            let mut stopped = false;
            for (cycle, (has_sample, has_command, torque)) in events.into_iter().enumerate() {
                let (still, asked) = (sample(0.0), command(torque));
                let sample = if has_sample { Ok(&still) } else { Err(DriveFault::NoSample) };
                let fresh = has_sample && has_command;
                since_command = if fresh { 0 } else { since_command + 1 };
                let output = run(&mut state, cycle as u64, sample, has_command.then_some(&asked));
                let torque_flows = output.drive_command.motor_torque_nm[0] != 0.0;
                if stopped || since_command > config().hold_cycles { prop_assert!(!torque_flows); }
                prop_assert!(output.drive_command.motor_torque_nm[0].abs() <= 2.0);
                stopped |= state.state == LoopState::SafeStop;
                prop_assert!(!stopped || state.state == LoopState::SafeStop, "latched");
            }
        }
    }
}
