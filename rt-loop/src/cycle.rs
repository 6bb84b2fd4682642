//! One control cycle as a pure function of time, drive sample, command, orders and state.
//!
//! What happened is sorted into one [`Event`], the [state machine](crate::state_machine) says which state follows, and the
//! state says what the drives are [sent](crate::sending). "Nothing fresh" is a missing command or a missing sample: the last
//! torque is held for [`CycleConfig::hold_cycles`], then the joints are damped without any model for
//! [`CycleConfig::damping_cycles`], then the brakes wait for [`CycleConfig::waiting_cycles`], and then the loop stops.

use shm_types::drive::{BusReport, DriveReport, DriveState, bus_fault};
use shm_types::messages::{
    Command, DriveCommand, DriveMode, DriveRequest, DriveSample, EMERGENCY_STOP_PRESSED, Header,
    LoopState, SensorSample,
};

use crate::driver::{AGE_MAX_CYCLES, DriveFault};
use crate::fault::Fault;
use crate::joint_motion::JointMotions;
use crate::limits::JointLimits;
use crate::motion_clock::MotionClock;
use crate::reference_watch::ReferenceWatch;
use crate::sending::{Sending, asked_mode};
use crate::state_machine::{Event, next};

/// What does not change during a run.
#[derive(Clone, Debug, PartialEq)]
pub struct CycleConfig {
    /// Number of the run; carried by every message.
    pub session: u64,
    /// Control period.
    pub period_ns: u64,
    /// Joint limits, in the robot's order.
    pub joints: Vec<JointLimits>,
    /// In the same order; for what is told to people afterwards.
    pub joint_names: Vec<String>,
    /// Cycles without a fresh command for which the last torque is held; at least one.
    pub hold_cycles: u64,
    /// Cycles of damping after that, before the brakes close: a joint that gravity pulls does not stop by damping.
    pub damping_cycles: u64,
    /// Cycles after that in which a command still goes on, before the safe stop.
    pub waiting_cycles: u64,
    /// Cycles in which drives that are ready must be enabled.
    pub enabling_cycles: u64,
    /// Cycles in which drives that were damped must be enabled again: until then gravity moves the joints.
    pub reenabling_cycles: u64,
    /// Cycles for which drives are asked to clear their faults, after the operator's reset.
    pub reset_cycles: u64,
}

impl CycleConfig {
    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// Cycles without a fresh command before the safe stop.
    pub fn patience_cycles(&self) -> u64 {
        self.hold_cycles + self.damping_cycles + self.waiting_cycles
    }

    /// Control period.
    pub fn period_s(&self) -> f64 {
        self.period_ns as f64 * 1e-9
    }
}

/// Drives that have stopped by themselves are acknowledged this often without a cycle in which they obeyed: for a third of a
/// second at 1.5 kHz, as each takes five cycles.
const ACKNOWLEDGEMENTS_MAX: u32 = 100;

/// What the loop remembers from cycle to cycle.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CycleState {
    /// Where the state machine stands.
    pub state: LoopState,
    /// Why it last left [`LoopState::Running`].
    pub fault: Option<Fault>,
    /// Cycles in a row without a fresh command.
    pub cycles_without_command: u64,
    clock: MotionClock,
    motions: JointMotions,
    reference_watch: ReferenceWatch,
    sending: Sending,
    /// How often in a row drives that had stopped were acknowledged.
    acknowledgements: u32,
    /// As the drives' last sample had it: where none comes, nobody has let go of the switch.
    emergency_stop_pressed: bool,
    /// Cycles that are left for the drives to be enabled.
    enabling_left: u64,
    /// Cycles for which the drives are still asked to clear their faults.
    resetting_cycles: u64,
    /// Why the last command was not handed to the drives.
    unsent: Option<DriveFault>,
    /// How each drive was, as the last sample had it. Its ages go on where none comes: what was told once gets old.
    pub drives: DriveReport,
    /// The cycle that the ages of `drives` are told for; none before the first sample.
    drives_cycle: Option<u64>,
    /// How the bus was, as the last sample had it.
    pub bus: BusReport,
}

/// What is asked of the loop from outside its control.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Orders {
    /// The operator wants a stop.
    pub emergency_stop: bool,
    /// The operator has asked in this cycle to leave the safe stop.
    pub reset: bool,
    /// Nothing has come from the supervisor for too long.
    pub supervisor_silent: bool,
}

/// What a cycle works with.
#[derive(Clone, Copy, Debug)]
pub struct CycleInput<'a> {
    /// Counts every period since the start, skipped ones too.
    pub cycle: u64,
    /// The planned instant of this cycle.
    pub planned_ns: u64,
    /// What the drives measured, [admitted](CycleState::admit).
    pub sample: Result<&'a DriveSample, DriveFault>,
    /// The command that answers this cycle's sample, if it came in time.
    pub command: Option<&'a Command>,
    /// What is asked from outside.
    pub orders: Orders,
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
    /// Takes what this sample of `cycle` says of the drives, and whether every joint has answered and can have moved as it says.
    /// Asked before anybody is shown the sample.
    ///
    /// # Errors
    /// [`DriveFault::JointSilent`], [`DriveFault::JumpedSample`].
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    pub fn admit(
        &mut self,
        config: &CycleConfig,
        cycle: u64,
        sample: &DriveSample,
    ) -> Result<(), DriveFault> {
        (self.drives, self.bus) = (sample.drives, sample.bus);
        self.drives_cycle = Some(cycle);
        let ages = &sample.drives.age_cycles[..config.joint_count()];
        if let Some(joint) = ages.iter().position(|&age| age > AGE_MAX_CYCLES) {
            if sample.bus.faults & bus_fault::BUS_OFF != 0 {
                return Err(DriveFault::BusOff);
            }
            return Err(DriveFault::JointSilent {
                joint: joint as u32,
                age_cycles: ages[joint],
            });
        }
        match self.motions.jumped_joint(config, cycle, sample) {
            Some(joint) => Err(DriveFault::JumpedSample { joint }),
            None => Ok(()),
        }
    }

    /// The message that asks the services for the command of `cycle`.
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
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
            motion_time_ns: self.clock.time_at_ns(config, self.state, cycle),
            motion_rate: self.clock.rate(),
            state: self.state as u32,
            reserved: 0,
            readings: sample.readings,
        }
    }

    /// Takes whether the last cycle's command was handed to the drives.
    pub fn written(&mut self, outcome: Result<(), DriveFault>) {
        self.unsent = outcome.err();
    }

    /// One cycle.
    #[cfg_attr(rtsan, sanitize(realtime = "nonblocking"))]
    pub fn step(&mut self, config: &CycleConfig, input: &CycleInput<'_>) -> CycleOutput {
        self.clock.advance(config, self.state, input.cycle);
        self.age_drives(input.cycle);
        self.observe(config, input);
        let event = self.event(config, input);
        let before = self.state;
        self.state = next(before, event);
        self.enabling_left = match (before, self.state) {
            (LoopState::Enabling, LoopState::Enabling) => self.enabling_left.saturating_sub(1),
            (LoopState::Damping, LoopState::Enabling) => config.reenabling_cycles,
            _ => config.enabling_cycles,
        };
        self.clock.enter(config, self.state);
        let limited_joints = self.send(config, input);
        CycleOutput {
            drive_command: self.drive_command(config, input),
            limited_joints,
        }
    }

    /// What is known of the drives is as old as the last sample that told it.
    fn age_drives(&mut self, cycle: u64) {
        let Some(told) = self.drives_cycle else {
            return;
        };
        self.drives_cycle = Some(cycle);
        let passed = u32::try_from(cycle.saturating_sub(told)).unwrap_or(u32::MAX);
        for age_cycles in &mut self.drives.age_cycles {
            *age_cycles = age_cycles.saturating_add(passed);
        }
    }

    fn observe(&mut self, config: &CycleConfig, input: &CycleInput<'_>) {
        let Ok(sample) = input.sample else { return };
        self.motions.observe(config, input.cycle, sample);
        self.emergency_stop_pressed = sample.inputs & EMERGENCY_STOP_PRESSED != 0;
        match (self.state, input.command) {
            (LoopState::Running | LoopState::Holding, Some(command)) => self
                .reference_watch
                .observe(config, input.cycle, command, &self.motions),
            (LoopState::Running | LoopState::Holding, None) => (),
            _ => self.reference_watch.rest(),
        }
    }

    /// What this cycle brought; notes the fault, if it is one. A latched state keeps the fault that led to it.
    fn event(&mut self, config: &CycleConfig, input: &CycleInput<'_>) -> Event {
        let (event, fault) = self.classify(config, input);
        match event {
            Event::Fresh | Event::Reset | Event::DrivesNotReady | Event::DrivesNotEnabled => {
                self.cycles_without_command = 0;
            }
            _ if self.state.is_latched() => (),
            Event::Broken | Event::Stop => self.fault = fault,
            _ if self.state.has_begun() => {
                self.cycles_without_command += 1;
                self.fault = fault;
            }
            // Before the first command there is nothing to miss.
            _ => (),
        }
        event
    }

    fn classify(&mut self, config: &CycleConfig, input: &CycleInput<'_>) -> (Event, Option<Fault>) {
        if let Some(fault) = self.broken_joint(config) {
            return (Event::Broken, Some(fault));
        }
        if let Some(fault) = self.asked_to_stop(input.orders) {
            self.resetting_cycles = 0;
            return (Event::Stop, Some(fault));
        }
        if let Ok(sample) = input.sample {
            if self.is_reset(config, input.orders, &sample.drives) {
                return (Event::Reset, None);
            }
            if let Some(fault) = self.drive_fault(config, sample) {
                return (Event::Stop, Some(Fault::Drive(fault)));
            }
        }
        let missing = |for_a_moment| match self.cycles_without_command + 1 {
            missed if missed <= config.hold_cycles => for_a_moment,
            missed if missed <= config.patience_cycles() => Event::MissingForLonger,
            _ => Event::MissingForTooLong,
        };
        let exchanged = match self.unsent {
            Some(fault) => input.sample.and(Err(fault)),
            None => input.sample,
        };
        match (exchanged, input.command) {
            (Err(fault), _) if fault.is_latched() => (Event::Stop, Some(Fault::Drive(fault))),
            (Err(fault), _) => (missing(Event::SampleMissing), Some(Fault::Drive(fault))),
            (Ok(_), None) => (missing(Event::CommandMissing), Some(Fault::CommandMissing)),
            (Ok(sample), Some(command)) => {
                match self.not_enabled(config, &sample.drives, command) {
                    Some(event) => (event, None),
                    None => self.answered(config, sample),
                }
            }
        }
    }

    /// Whether the safe stop is left: the operator has asked for it, and no drive is faulted, no device out of its exchange, or
    /// is any more. Those that are get their time to clear.
    fn is_reset(&mut self, config: &CycleConfig, orders: Orders, drives: &DriveReport) -> bool {
        if self.state != LoopState::SafeStop {
            self.resetting_cycles = 0;
            return false;
        }
        if orders.reset {
            self.resetting_cycles = config.reset_cycles;
        }
        let asked = self.resetting_cycles > 0;
        self.resetting_cycles = self.resetting_cycles.saturating_sub(1);
        let joints = config.joint_count();
        let is_faulted = drives.find(joints, DriveState::is_faulted).is_some();
        let is_gone = drives.device_status[..joints]
            .iter()
            .any(|&status| status != 0);
        let is_reset = asked && !is_faulted && !is_gone;
        if is_reset {
            self.resetting_cycles = 0;
        }
        is_reset
    }

    /// What the drives tell that nothing but a stop answers.
    fn drive_fault(&self, config: &CycleConfig, sample: &DriveSample) -> Option<DriveFault> {
        let (drives, joints) = (&sample.drives, config.joint_count());
        if let Some(joint) = drives.find(joints, DriveState::is_faulted) {
            return Some(DriveFault::DriveError {
                joint: joint as u32,
                code: drives.error_code[joint],
            });
        }
        if sample.bus.faults & bus_fault::BUS_OFF != 0 {
            return Some(DriveFault::BusOff);
        }
        if !self.state.has_begun() {
            return None;
        }
        let gone = drives.device_status[..joints]
            .iter()
            .position(|&status| status != 0);
        if let Some(joint) = gone {
            return Some(DriveFault::DeviceState {
                joint: joint as u32,
                al_status: drives.device_status[joint] as u16,
                al_status_code: (drives.device_status[joint] >> 16) as u16,
            });
        }
        let off = |state| match self.state {
            LoopState::Running | LoopState::Holding => matches!(
                state,
                DriveState::NotReady | DriveState::SwitchedOff | DriveState::Enabling
            ),
            LoopState::Damping => state == DriveState::NotReady,
            _ => false,
        };
        if let Some(joint) = drives.find(joints, off) {
            return Some(DriveFault::DriveOff {
                joint: joint as u32,
                state: drives.state_of(joint),
            });
        }
        if self.state != LoopState::Enabling || self.enabling_left > 0 {
            return None;
        }
        let joint = drives.find(joints, is_off)?;
        Some(DriveFault::NotEnabled {
            joint: joint as u32,
            state: drives.state_of(joint),
            status_word: drives.status_word[joint],
        })
    }

    /// What has to be waited for before drives that tell their state obey a command.
    fn not_enabled(
        &self,
        config: &CycleConfig,
        drives: &DriveReport,
        command: &Command,
    ) -> Option<Event> {
        let any = |wanted: fn(DriveState) -> bool| drives.find(config.joint_count(), wanted);
        if any(|state| state == DriveState::NotReady).is_some() {
            return Some(Event::DrivesNotReady);
        }
        let stopped = any(|state| state == DriveState::QuickStop).is_some();
        if stopped && matches!(self.state, LoopState::Running | LoopState::Holding) {
            return None;
        }
        let told = any(|state| state != DriveState::Unknown).is_some();
        let wait = any(is_off).is_some() || (told && !self.sending.must_show(asked_mode(command)));
        wait.then_some(Event::DrivesNotEnabled)
    }

    fn answered(&mut self, config: &CycleConfig, sample: &DriveSample) -> (Event, Option<Fault>) {
        let is_stopped = |state| state == DriveState::QuickStop;
        let shown = match sample.drives.find(config.joint_count(), is_stopped) {
            Some(_) => Some(DriveMode::Damping),
            None => DriveMode::from_raw(sample.mode),
        };
        let obeying = shown.is_some_and(DriveMode::obeys);
        if obeying || !self.sending.must_show_motion() {
            if obeying {
                self.acknowledgements = 0;
            }
            return (Event::Fresh, None);
        }
        if shown != Some(DriveMode::Damping) {
            return (Event::Stop, Some(Fault::DrivesOff));
        }
        // Damping is also what acknowledges the drives' watchdog; the next fresh command goes on.
        self.acknowledgements += 1;
        let event = match self.acknowledgements > ACKNOWLEDGEMENTS_MAX {
            true => Event::Stop,
            false => Event::DrivesStopped,
        };
        (event, Some(Fault::DrivesStopped))
    }

    fn asked_to_stop(&self, orders: Orders) -> Option<Fault> {
        if orders.emergency_stop || self.emergency_stop_pressed {
            Some(Fault::EmergencyStop)
        } else if orders.supervisor_silent {
            Some(Fault::SupervisorSilent)
        } else {
            None
        }
    }

    fn broken_joint(&self, config: &CycleConfig) -> Option<Fault> {
        if !matches!(
            self.state,
            LoopState::Enabling | LoopState::Running | LoopState::Holding | LoopState::Damping
        ) {
            return None;
        }
        let motions = self.motions.motions();
        let runs_away = |(joint, limits): (usize, &JointLimits)| {
            let motion = motions[joint];
            limits.has_run_away(motion).then_some(Fault::Runaway {
                joint: joint as u32,
                position_rad: motion.position_rad,
                velocity_rad_s: motion.velocity_rad_s,
            })
        };
        config
            .joints
            .iter()
            .enumerate()
            .find_map(runs_away)
            .or_else(|| self.reference_watch.fault(config))
    }

    fn has_damped(&self, config: &CycleConfig) -> bool {
        self.cycles_without_command > config.hold_cycles + config.damping_cycles
    }

    /// Chooses what the drives are sent; returns the joints whose command was limited, one bit each.
    fn send(&mut self, config: &CycleConfig, input: &CycleInput<'_>) -> u64 {
        let motions = self.motions.motions();
        match (self.state, input.command) {
            (LoopState::Enabling | LoopState::Running, Some(command)) => {
                self.sending.obey(config, &motions, command)
            }
            (LoopState::Enabling | LoopState::Running | LoopState::Holding, _) => {
                self.sending.hold(config, &motions)
            }
            (LoopState::Damping, _) if self.has_damped(config) => {
                self.sending.brake();
                0
            }
            (LoopState::Damping, _) => {
                // Without a measurement the loop's own damping would act on an old velocity, and drives that have stopped
                // do nothing else than damp anyway.
                let by_torque = input.sample.is_ok() && self.fault != Some(Fault::DrivesStopped);
                self.sending.damp(config, &motions, by_torque);
                0
            }
            _ => {
                self.sending.brake();
                0
            }
        }
    }

    fn request(&self) -> DriveRequest {
        match self.state {
            LoopState::Enabling => DriveRequest::Enable,
            LoopState::SafeStop if self.resetting_cycles > 0 => DriveRequest::ResetFault,
            LoopState::SafeStop | LoopState::Faulted => DriveRequest::QuickStop,
            _ => DriveRequest::None,
        }
    }

    fn drive_command(&self, config: &CycleConfig, input: &CycleInput<'_>) -> DriveCommand {
        DriveCommand {
            header: Header {
                session: config.session,
                cycle: input.cycle,
                measured_at_ns: input.planned_ns,
                joint_count: config.joint_count() as u64,
            },
            mode: self.sending.mode as u32,
            request: self.request() as u32,
            motor_torque_nm: self.sending.torque_nm,
            joint_velocity_rad_s: self.sending.velocity_rad_s,
            ..DriveCommand::default()
        }
    }
}

/// Whether a drive that tells its state does not obey.
fn is_off(state: DriveState) -> bool {
    !matches!(state, DriveState::Unknown | DriveState::Enabled)
}

#[cfg(test)]
mod every_order;
#[cfg(test)]
mod tests;
