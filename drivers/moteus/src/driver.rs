//! The cycle: one frame out and one in for each joint.
//!
//! `write` sends each drive its command and asks how it is in the same frame; the answers come while the loop sleeps, and
//! `read` of the next cycle finds them. A sample is therefore latched when its frame reached the drive, in the cycle before,
//! and the command acts at once: one cycle from latch to act. Frames on one bus are sent with one call; the buses work at
//! the same time.

use std::time::Duration;

use rt_loop::driver::{
    AGE_MAX_CYCLES, Behind, Capabilities, DriveFault, Driver, DriverEntry, JointCapabilities,
    OpenContext, OpenError,
};
use shm_types::JOINTS_MAX;
use shm_types::drive::{DriveState, bus_fault, position, warning};
use shm_types::instance::{ControlMode, Mode};
use shm_types::messages::{DriveCommand, DriveMode, DriveRequest, DriveSample, Header};

use crate::capacity;
use crate::host::{Computer, Host, PORTS_MAX};
use crate::port::{Port, PortError, wait};
use crate::settings::{JointTable, Settings};
use crate::setup::{Found, set_up};
use crate::units::{JointUnits, RotorCount, link_rev};
use crate::wire::{Aim, Answer, Ask, answer_bytes, command_bytes, frame};

/// Drives that speak moteus' registers on CAN-FD, behind fdcanusb adapters.
pub const MOTEUS: DriverEntry = DriverEntry {
    name: "moteus",
    summary: "moteus drives on CAN-FD behind fdcanusb adapters",
    behind: Behind::Hardware,
    open,
};

/// Between two questions to the adapter of a bus that is silent.
const STATUS_NS: u64 = 100_000_000;
/// Answers to frames that were sent longer ago than so many periods are not of this cycle, however late the loop is.
const OLD_PERIODS: u64 = 2;
/// Between two tries to open a port that is gone.
const REOPEN_NS: u64 = 200_000_000;
/// How long the drives are told to stop at the end.
const SHUTDOWN_TRIES: usize = 10;
/// Between two of them.
const SHUTDOWN_NS: u64 = 2_000_000;
/// Register 0x00f: from this number on it is a limit that is active and no fault (moteus, protocol/registers.md).
const LIMITS_FROM: i32 = 96;

/// Modes of register 0x000.
mod mode {
    pub const STOPPED: i32 = 0;
    pub const FAULT: i32 = 1;
    pub const TIMEOUT: i32 = 11;
    pub const BRAKE: i32 = 15;
}

fn open(context: &OpenContext<'_>) -> Result<Box<dyn Driver>, OpenError> {
    if context.run.mode == Mode::Lockstep {
        return Err(OpenError::Setting(
            "moteus drives keep their own time; run with --mode realtime".to_owned(),
        ));
    }
    Ok(Box::new(MoteusDriver::open(context, Box::new(Computer))?))
}

/// How long each joint's frames are on its bus.
fn times_on_bus(settings: &Settings, context: &OpenContext<'_>) -> Vec<Duration> {
    let joints = context.robot.joints.iter().zip(&settings.joints);
    let is_torque_alone = context.run.control == ControlMode::Torque;
    joints
        .map(|(joint, table)| {
            let has_link_encoder = joint.link_encoder_resolution_rad.is_some();
            // Unlimited torque has the longer number.
            let limit_nm = joint.torque_limit_nm.unwrap_or(f64::INFINITY) * joint.gear_ratio.abs();
            let bytes = command_bytes(is_torque_alone, limit_nm, has_link_encoder);
            capacity::exchange(table.id, bytes, answer_bytes(has_link_encoder))
        })
        .collect()
}

/// Time and joints on a bus.
fn load(settings: &Settings, on_bus: &[Duration], bus: usize) -> (Duration, usize) {
    let joints = settings.joints.iter().zip(on_bus);
    joints
        .filter(|(table, _)| table.bus == bus + 1)
        .fold((Duration::ZERO, 0), |(sum, count), (_, time)| {
            (sum + *time, count + 1)
        })
}

/// Holds what the buses can carry against the cycle.
fn check_capacity(
    settings: &Settings,
    on_bus: &[Duration],
    period_ns: u64,
) -> Result<(), OpenError> {
    for (bus, port) in settings.bus.ports.iter().enumerate() {
        let (time, count) = load(settings, on_bus, bus);
        if count > 0 && !capacity::fits(time, period_ns) {
            return Err(OpenError::Setting(format!(
                "{port}: {count} joints take {} us on the bus, a cycle is {} us; run with --rate {} or less, or spread them \
                 over more ports",
                time.as_micros(),
                period_ns / 1000,
                capacity::rate_max_hz(time)
            )));
        }
    }
    Ok(())
}

/// What the buses carry, for people.
fn told(settings: &Settings, on_bus: &[Duration]) -> String {
    let buses = settings.bus.ports.iter().enumerate().map(|(bus, port)| {
        let (time, count) = load(settings, on_bus, bus);
        if count == 0 {
            return format!("{port}: no drives");
        }
        let most_hz = capacity::rate_max_hz(time);
        format!(
            "{port}: {count} drives, {} us a cycle, up to {most_hz} Hz",
            time.as_micros()
        )
    });
    format!("CAN-FD, {}", buses.collect::<Vec<_>>().join("; "))
}

/// One joint's drive.
#[derive(Clone, Debug)]
struct Joint {
    id: u8,
    bus: usize,
    units: JointUnits,
    /// At the output.
    torque_max_nm: f64,
    has_link_encoder: bool,
    rotor: RotorCount,
    /// Whether it has obeyed once. Until then it is left without current, and so is whatever holds the arm.
    was_enabled: bool,
    newest: Option<Answer>,
    /// The newest of a drive that knew where its joint is: a drive that lost its supply may count from elsewhere.
    placed: Option<Answer>,
    /// What a drive knows of that, as found when it was opened.
    home: i32,
    /// Cycles since the newest answer that tells where the joint is.
    age_cycles: u32,
    /// Whether an answer is still to come.
    is_asked: bool,
}

impl Joint {
    fn new(gear_ratio: f64, limit_nm: f64, table: &JointTable, found: &Found) -> Self {
        Self {
            id: table.id,
            bus: table.bus - 1,
            units: JointUnits {
                gear_ratio,
                sign: if table.reversed { -1.0 } else { 1.0 },
            },
            torque_max_nm: limit_nm * gear_ratio.abs(),
            has_link_encoder: found.has_link_encoder,
            rotor: RotorCount::default(),
            was_enabled: false,
            newest: None,
            placed: None,
            home: found.home,
            age_cycles: AGE_MAX_CYCLES + 1,
            is_asked: false,
        }
    }

    fn take(&mut self, answer: Answer) {
        self.newest = Some(answer);
        self.is_asked = false;
        if answer.home >= self.home {
            self.placed = Some(answer);
            self.age_cycles = 0;
        }
    }

    /// What it is to do in this cycle.
    fn ask(&mut self, command: &DriveCommand, index: usize) -> Result<Ask, DriveFault> {
        let refused = DriveFault::ModeRefused { mode: command.mode };
        let drive_mode = command.mode_of(index).ok_or(refused)?;
        let request = DriveRequest::from_raw(command.request).unwrap_or_default();
        let is_at = |wanted: i32| self.newest.is_some_and(|answer| answer.mode == wanted);
        // Nobody knows what a drive does that has been silent for longer than can be seen through. It is asked before it is
        // commanded again: it may just have been switched on.
        if self.age_cycles > AGE_MAX_CYCLES {
            return Ok(Ask::Query);
        }
        // A drive that was reset stands still until the loop enables it: it may no longer know where the joint is.
        if drive_mode.obeys() && request != DriveRequest::Enable && is_at(mode::STOPPED) {
            return Ok(Ask::Stop);
        }
        if request == DriveRequest::ResetFault && (is_at(mode::FAULT) || is_at(mode::TIMEOUT)) {
            return Ok(Ask::Stop);
        }
        // A watchdog that ran out ends with a stop and nothing else; enabling it again is what the loop asks for.
        if request == DriveRequest::Enable && is_at(mode::TIMEOUT) {
            return Ok(Ask::Stop);
        }
        let limit_nm = self.torque_max_nm;
        let torque_nm = self.units.output_nm(command.motor_torque_nm[index]);
        let position_rev = self.units.output_rev(command.joint_position_rad[index]);
        let velocity_rev_s = self.units.output_rev(command.joint_velocity_rad_s[index]);
        let aim = match drive_mode {
            DriveMode::Braked | DriveMode::Damping if !self.was_enabled => return Ok(Ask::Stop),
            DriveMode::Braked => return Ok(Ask::Brake),
            DriveMode::Damping => return Ok(Ask::ZeroVelocity),
            DriveMode::Torque => Aim::torque(torque_nm, limit_nm),
            DriveMode::Velocity => Aim {
                velocity_rev_s,
                kp_scale: 1.0,
                kd_scale: 1.0,
                torque_nm: 0.0,
                ..Aim::torque(0.0, limit_nm)
            },
            DriveMode::Position => Aim {
                position_rev,
                velocity_rev_s: 0.0,
                torque_nm,
                kp_scale: 1.0,
                kd_scale: 1.0,
                torque_max_nm: limit_nm,
            },
            DriveMode::Impedance => Aim {
                position_rev,
                velocity_rev_s,
                torque_nm,
                kp_scale: command.position_gain_scale[index].clamp(0.0, 1.0),
                kd_scale: command.velocity_gain_scale[index].clamp(0.0, 1.0),
                torque_max_nm: limit_nm,
            },
        };
        let is_number = aim.torque_nm.is_finite()
            && aim.velocity_rev_s.is_finite()
            && aim.kp_scale.is_finite()
            && aim.kd_scale.is_finite()
            && !aim.position_rev.is_infinite();
        if !is_number {
            return Err(refused);
        }
        self.was_enabled = true;
        Ok(Ask::Position(aim))
    }

    fn state(&self) -> DriveState {
        let Some(answer) = self.newest else {
            return DriveState::NotReady;
        };
        if answer.home < self.home {
            // It was without supply, and no longer knows where the joint is.
            return DriveState::NotReady;
        }
        match answer.mode {
            mode::STOPPED | mode::BRAKE => DriveState::SwitchedOff,
            mode::FAULT => DriveState::Fault,
            2..=4 => DriveState::Enabling,
            mode::TIMEOUT => DriveState::QuickStop,
            _ => DriveState::Enabled,
        }
    }

    /// Its readings and how it is, into its place in a sample.
    fn put(&mut self, found: &Found, index: usize, sample: &mut DriveSample) {
        let drives = &mut sample.drives;
        drives.state[index] = self.state() as u32;
        drives.mode[index] = self.drive_mode() as u32;
        drives.age_cycles[index] = self.age_cycles;
        let Some(answer) = self.newest else {
            return;
        };
        drives.status_word[index] = answer.mode as u32;
        if answer.mode == mode::FAULT {
            drives.error_code[index] = answer.fault as u32;
        } else {
            drives.warnings[index] = warnings(answer.fault);
        }
        drives.position_validity[index] = validity(answer.home, self.units.gear_ratio);
        drives.supply_voltage_v[index] = answer.supply_v;
        let Some(answer) = self.placed else {
            return;
        };
        let (units, sign) = (self.units, found.output_sign);
        let coarse_rev = answer.position_rev * units.gear_ratio;
        let rotor_rev = self
            .rotor
            .rotor_rev(coarse_rev, sign * answer.rotor_encoder_rev);
        let readings = &mut sample.readings;
        readings.motor_position_rad[index] = units.motor_rad(rotor_rev / units.gear_ratio);
        readings.motor_velocity_rad_s[index] =
            units.motor_rad(sign * answer.rotor_rev_s / units.gear_ratio);
        readings.motor_torque_nm[index] = units.motor_nm(answer.torque_nm);
        if self.has_link_encoder {
            let encoder_rev = sign * (answer.link_encoder_rev + found.output_offset_rev);
            readings.link_position_rad[index] =
                units.joint_rad(link_rev(encoder_rev, answer.position_rev));
        }
    }

    /// What it does, as the loop names it.
    fn drive_mode(&self) -> DriveMode {
        match self.newest.map(|answer| answer.mode) {
            Some(10) => DriveMode::Torque,
            Some(mode::TIMEOUT | 12 | mode::BRAKE) => DriveMode::Damping,
            _ => DriveMode::Braked,
        }
    }
}

/// What a limit that is active means to people (moteus, protocol/registers.md, 0x00f).
fn warnings(code: i32) -> u32 {
    match code {
        100 | 101 => warning::TEMPERATURE | warning::LIMITED,
        98 => warning::VOLTAGE | warning::LIMITED,
        103 => warning::END_STOP,
        LIMITS_FROM.. => warning::LIMITED,
        _ => 0,
    }
}

/// What the position is worth: behind a gear a drive must know the output, without one the rotor is enough.
fn validity(home: i32, gear_ratio: f64) -> u32 {
    let is_homed = home == 2 || home == 1 && gear_ratio.abs() <= 1.0;
    position::KNOWN | position::ABSOLUTE | if is_homed { position::HOMED } else { 0 }
}

/// The drives of a robot.
pub struct MoteusDriver {
    host: Box<dyn Host>,
    session: u64,
    on_bus: String,
    ports: Vec<Port>,
    joints: Vec<Joint>,
    found: Vec<Found>,
    /// When the frames were sent that are answered next.
    sent_at_ns: u64,
    period_ns: u64,
    /// When an adapter was last asked how its bus is.
    asked_status_ns: u64,
    /// When a port was last missed.
    gone_at_ns: u64,
    frames_lost: u64,
}

impl MoteusDriver {
    /// Finds the drives of a robot at the ports of `host` and looks at each. Nothing moves.
    ///
    /// # Errors
    /// [`OpenError`]: where, what is wrong, what to change.
    pub fn open(context: &OpenContext<'_>, host: Box<dyn Host>) -> Result<Self, OpenError> {
        let robot = context.robot;
        let settings = Settings::of(robot)?;
        if settings.bus.ports.len() > PORTS_MAX {
            return Err(OpenError::Setting(format!(
                "[drive] ports names {} ports, {PORTS_MAX} are the most",
                settings.bus.ports.len()
            )));
        }
        let on_bus = times_on_bus(&settings, context);
        check_capacity(&settings, &on_bus, context.run.period_ns)?;
        let mut ports = Vec::new();
        for path in &settings.bus.ports {
            ports.push(Port::open(&*host, path)?);
        }
        let found = set_up(&*host, &mut ports, &settings, robot)?;
        let joints = robot.joints.iter().zip(&settings.joints).zip(&found);
        let joints: Vec<Joint> = joints
            .map(|((joint, table), found)| {
                let limit_nm = joint.torque_limit_nm.unwrap_or(found.motor_torque_max_nm);
                Joint::new(joint.gear_ratio, limit_nm, table, found)
            })
            .collect();
        Ok(Self {
            host,
            session: context.run.session,
            on_bus: told(&settings, &on_bus),
            ports,
            joints,
            found,
            sent_at_ns: 0,
            period_ns: context.run.period_ns,
            asked_status_ns: 0,
            gone_at_ns: 0,
            frames_lost: 0,
        })
    }

    /// Takes what has come.
    fn take_answers(&mut self) {
        let Self { ports, joints, .. } = self;
        for (bus, port) in ports.iter_mut().enumerate() {
            // A port that is gone is told of where it is written to.
            let _ = port.receive(|received| {
                for joint in joints.iter_mut().filter(|joint| joint.bus == bus) {
                    let answer = Answer::of(received, joint.has_link_encoder);
                    if let Some((id, answer)) = answer
                        && id == joint.id
                    {
                        joint.take(answer);
                    }
                }
            });
        }
    }

    fn is_complete(&self) -> bool {
        !self.joints.iter().any(|joint| joint.is_asked)
    }

    /// Sends one frame to each drive: what `ask` says, and the question how it is.
    fn transmit(
        &mut self,
        ask: impl Fn(&mut Joint, usize) -> Result<Ask, DriveFault>,
    ) -> Result<(), DriveFault> {
        let mut asked = [Ask::Query; JOINTS_MAX];
        for (index, joint) in self.joints.iter_mut().enumerate() {
            asked[index] = ask(joint, index)?;
        }
        let mut outcome = Ok(());
        let mut is_blocked = [false; PORTS_MAX];
        for (port, is_blocked) in self.ports.iter_mut().zip(&mut is_blocked) {
            // What a port has not taken yet goes first; meanwhile nothing is put on top, it would come late.
            *is_blocked = port.is_behind() && port.send().is_err();
        }
        for (joint, ask) in self.joints.iter_mut().zip(&asked) {
            let frame = frame(joint.id, ask, joint.has_link_encoder);
            if is_blocked[joint.bus] || self.ports[joint.bus].queue(&frame).is_err() {
                outcome = Err(DriveFault::NotSent);
                continue;
            }
            self.frames_lost += u64::from(joint.is_asked);
            joint.is_asked = true;
        }
        self.sent_at_ns = self.host.now_ns();
        for port in &mut self.ports {
            match port.send() {
                Ok(()) => {}
                Err(PortError::Gone) => outcome = Err(DriveFault::LinkLost),
                Err(PortError::Full) => outcome = Err(DriveFault::NotSent),
            }
        }
        outcome
    }

    /// A bus of which nothing comes may be off, and only its adapter knows.
    fn ask_about_silent_buses(&mut self, now_ns: u64) {
        if now_ns < self.asked_status_ns + STATUS_NS {
            return;
        }
        let Self { ports, joints, .. } = self;
        for (bus, port) in ports.iter_mut().enumerate() {
            let mut on_bus = joints.iter().filter(|joint| joint.bus == bus).peekable();
            let is_silent =
                on_bus.peek().is_some() && on_bus.all(|joint| joint.age_cycles > AGE_MAX_CYCLES);
            if is_silent && port.is_open() {
                self.asked_status_ns = now_ns;
                // one that cannot be asked now is asked the next time
                let _ = port.ask_status();
            }
        }
    }

    fn sample(&mut self, cycle: u64, measured_at_ns: u64) -> Result<DriveSample, DriveFault> {
        if !self.joints.iter().any(|joint| joint.age_cycles == 0) {
            return Err(if !self.ports.iter().any(Port::is_open) {
                DriveFault::LinkLost
            } else if self.ports.iter().all(Port::is_bus_off) {
                DriveFault::BusOff
            } else {
                DriveFault::NoSample
            });
        }
        let header = Header {
            session: self.session,
            cycle,
            measured_at_ns,
            joint_count: self.joints.len() as u64,
        };
        let mut sample = DriveSample {
            header,
            ..DriveSample::default()
        };
        let mut mode = DriveMode::Torque;
        for (index, (joint, found)) in self.joints.iter_mut().zip(&self.found).enumerate() {
            joint.put(found, index, &mut sample);
            if joint.state() != DriveState::Enabled {
                mode = DriveMode::Braked;
            }
        }
        sample.mode = mode as u32;
        sample.bus.working_counter_expected = self.joints.len() as u32;
        let answered = self.joints.iter().filter(|joint| joint.age_cycles == 0);
        sample.bus.working_counter = answered.count() as u32;
        sample.bus.frames_lost = self.frames_lost;
        if !self.ports.iter().all(Port::is_open) {
            sample.bus.faults |= bus_fault::LINK_LOST;
        }
        if self.ports.iter().any(Port::is_bus_off) {
            sample.bus.faults |= bus_fault::BUS_OFF;
        }
        Ok(sample)
    }
}

impl Driver for MoteusDriver {
    fn capabilities(&self) -> Capabilities {
        let joints = self
            .found
            .iter()
            .zip(&self.joints)
            .map(|(found, joint)| JointCapabilities {
                device: found.device.clone(),
                modes: vec![
                    DriveMode::Torque,
                    DriveMode::Velocity,
                    DriveMode::Position,
                    DriveMode::Impedance,
                ],
                motor_torque_max_nm: Some(found.motor_torque_max_nm),
                motor_position_step_rad: Some(core::f64::consts::TAU / found.rotor_counts),
                watchdog: Some(found.watchdog),
                position_validity: validity(found.home, joint.units.gear_ratio),
                ..JointCapabilities::default()
            });
        Capabilities {
            bus: self.on_bus.clone(),
            joints: joints.collect(),
            latch_to_act_cycles: Some(1),
            ..Capabilities::default()
        }
    }

    fn read(
        &mut self,
        cycle: u64,
        planned_ns: u64,
        give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault> {
        for joint in &mut self.joints {
            joint.age_cycles = joint.age_cycles.saturating_add(1);
        }
        self.take_answers();
        let since_ns = planned_ns.saturating_sub(self.sent_at_ns);
        if self.sent_at_ns == 0 || since_ns > OLD_PERIODS * self.period_ns {
            // In the first cycle nobody has been asked yet, and a loop that overslept has the answers of long ago.
            let age_cycles = u32::try_from(since_ns / self.period_ns).unwrap_or(u32::MAX);
            for joint in &mut self.joints {
                joint.age_cycles = joint.age_cycles.max(age_cycles);
            }
            self.transmit(|_, _| Ok(Ask::Query))?;
        }
        let sent_at_ns = self.sent_at_ns;
        while !self.is_complete() {
            let now_ns = self.host.now_ns();
            if now_ns >= give_up_at_ns {
                break;
            }
            wait(&*self.host, &self.ports, give_up_at_ns - now_ns);
            self.take_answers();
        }
        self.sample(cycle, sent_at_ns)
    }

    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        // What comes after this is an answer to this command.
        self.take_answers();
        self.transmit(|joint, index| joint.ask(command, index))
    }

    fn prepare(&mut self) {
        let now_ns = self.host.now_ns();
        self.ask_about_silent_buses(now_ns);
        if self.ports.iter().all(Port::is_open) || now_ns < self.gone_at_ns + REOPEN_NS {
            return;
        }
        self.gone_at_ns = now_ns;
        for port in &mut self.ports {
            port.reopen(&*self.host);
        }
    }

    fn shutdown(&mut self) {
        for _ in 0..SHUTDOWN_TRIES {
            let _ = self.transmit(|_, _| Ok(Ask::Stop));
            self.host.sleep(SHUTDOWN_NS);
            self.take_answers();
            let is_stopped = |joint: &Joint| {
                joint
                    .newest
                    .is_some_and(|answer| answer.mode == mode::STOPPED)
            };
            if self.joints.iter().all(is_stopped) {
                return;
            }
        }
    }
}
