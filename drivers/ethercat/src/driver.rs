//! The loop's driver: one exchange a cycle with drives in cyclic torque, velocity or position.
//!
//! Inputs are fetched when the cycle begins, outputs sent as soon as the command is known; both take effect at SYNC0, which comes
//! an eighth of a period before the next cycle. A command so acts from the next latch on.

use std::time::Duration;

use ethercat_wire::link::Cable;
use rt_loop::driver::{
    Acyclic, AcyclicError, Behind, Brake, Capabilities, DriveFault, Driver, DriverEntry,
    JointCapabilities, Object, OpenContext, OpenError,
};
use shm_types::JOINTS_MAX;
use shm_types::drive::{BusReport, ClockState, DriveState, bus_fault, position, warning};
use shm_types::instance::Mode;
use shm_types::messages::{DriveCommand, DriveMode, DriveRequest, DriveSample, Header};

use crate::client::{Client, ClientError};
use crate::frames::Frames;
use crate::image::{AXIS_OFFSET, Inputs, Outputs};
use crate::pace::{Pace, Reading};
use crate::settings::Settings;
use crate::setup::{self, Axis, CLIENT_INDICES, OP, OwnInterface, Slave};
use crate::units::Unwrapped;
use crate::walk::{PowerState, Walk, Wish};

/// The driver as `--driver` chooses it.
pub const ETHERCAT: DriverEntry = DriverEntry {
    name: "ethercat",
    summary: "CiA 402 drives on EtherCAT, by the robot file's [drive] tables",
    behind: Behind::Hardware,
    open,
};

/// Frames lost in a row after which the cable is taken for gone.
const LINK_LOST_FRAMES: u32 = 10;
/// A drive that does not tell when its brake is open (bit 12 of the statusword) is taken to have opened it after this.
const BRAKE_RELEASE: Duration = Duration::from_millis(500);
/// A slave is asked for OP again after so many cycles.
const ASK_CYCLES: u32 = 500;
/// How long drives have to stop at the end.
const SHUTDOWN_NS: u64 = 1_000_000_000;
/// AL control: OP, with a failed change acknowledged.
const ASK_OP: u16 = 0x18;
/// AL status of a slave in SAFE-OP without error.
const SAFE_OP: u16 = 4;
/// Bit of the AL status for a failed change, or a state left by itself.
const AL_ERROR: u16 = 0x10;
/// Bits of the statusword (IEC 61800-7-201, Table 9).
const STATUS_WARNING: u16 = 1 << 7;
const STATUS_LIMITED: u16 = 1 << 11;
const STATUS_FOLLOWS: u16 = 1 << 12;
const STATUS_FOLLOWING_ERROR: u16 = 1 << 13;
/// Modes of operation (0x6060), and their bits in 0x6502.
const POSITION: (i8, u32) = (8, 1 << 7);
const VELOCITY: (i8, u32) = (9, 1 << 8);
const TORQUE: (i8, u32) = (10, 1 << 9);

fn open(context: &OpenContext<'_>) -> Result<Box<dyn Driver>, OpenError> {
    if context.run.mode == Mode::Lockstep {
        return Err(OpenError::Setting(
            "drives have a clock of their own; run them with --mode realtime".to_owned(),
        ));
    }
    let interface = Settings::of(context.robot)?.bus.interface;
    let cable = Box::new(OwnInterface::take(&interface)?);
    Ok(Box::new(EthercatDriver::open(context, cable)?))
}

/// One joint's drive.
struct Joint {
    axis: Axis,
    gear_ratio: f64,
    brake: Option<Brake>,
    walk: Walk,
    count: Unwrapped,
    link_count: Unwrapped,
    inputs: Inputs,
    outputs: Outputs,
    /// Cycles since its inputs came.
    age_cycles: u32,
    enabled_cycles: u32,
    /// What it does, as the last sample told.
    state: DriveState,
    /// What it was last asked to do.
    asked: DriveMode,
}

/// Drives on EtherCAT.
pub struct EthercatDriver {
    cable: Box<dyn Cable>,
    interface: String,
    session: u64,
    period_ns: u64,
    frames: Frames,
    slaves: Vec<Slave>,
    /// Whether a slave has been in OP.
    begun: Vec<bool>,
    asked_before_cycles: u32,
    joints: Vec<Joint>,
    pace: Option<Pace>,
    frames_lost: u64,
    lost_in_a_row: u32,
    jitter_ns: u64,
    resets: bool,
    client: Option<Client>,
}

impl EthercatDriver {
    /// Finds the drives of a robot at a cable, sets them up, and brings them to SAFE-OP. Nothing moves.
    ///
    /// # Errors
    /// [`OpenError`]: where, what is wrong, what to change.
    pub fn open(context: &OpenContext<'_>, cable: Box<dyn Cable>) -> Result<Self, OpenError> {
        let robot = context.robot;
        let (session, period_ns) = (context.run.session, context.run.period_ns);
        let settings = Settings::of(robot)?;
        let bus = setup::open(&*cable, robot, &settings, period_ns)?;
        let interface = settings.bus.interface;
        let told = |error: &dyn std::fmt::Display| {
            OpenError::Hardware(format!("interface `{interface}`: {error}"))
        };
        let link = cable.open().map_err(|error| told(&error))?;
        let frames =
            Frames::new(link, &bus.slaves, bus.sync0_ns.is_some()).map_err(|error| told(&error))?;
        let joints = bus
            .axes
            .into_iter()
            .zip(&robot.joints)
            .map(|(axis, joint)| Joint {
                axis,
                gear_ratio: joint.gear_ratio,
                brake: joint.brake.map(|brake| Brake {
                    release: time(brake.release_s),
                    engage: time(brake.engage_s),
                }),
                walk: Walk::default(),
                count: Unwrapped::default(),
                link_count: Unwrapped::default(),
                inputs: Inputs::default(),
                outputs: Outputs::default(),
                age_cycles: 0,
                enabled_cycles: 0,
                state: DriveState::NotReady,
                asked: DriveMode::Braked,
            })
            .collect();
        Ok(Self {
            cable,
            interface,
            session,
            period_ns,
            frames,
            begun: vec![false; bus.slaves.len()],
            slaves: bus.slaves,
            asked_before_cycles: ASK_CYCLES,
            joints,
            pace: bus.sync0_ns.map(|sync0_ns| Pace::new(sync0_ns, period_ns)),
            frames_lost: 0,
            lost_in_a_row: 0,
            jitter_ns: 0,
            resets: false,
            client: Some(bus.client),
        })
    }

    /// Whether a slave runs, as last heard.
    fn is_op(&self, slave: usize) -> bool {
        self.frames.answers[slave].al_status == u16::from(OP)
    }

    fn lost(&mut self) -> DriveFault {
        self.frames_lost += 1;
        self.lost_in_a_row = self.lost_in_a_row.saturating_add(1);
        for joint in &mut self.joints {
            joint.age_cycles = joint.age_cycles.saturating_add(1);
        }
        if let Some(pace) = &mut self.pace {
            pace.miss();
        }
        if self.lost_in_a_row >= LINK_LOST_FRAMES {
            DriveFault::LinkLost
        } else {
            DriveFault::NoSample
        }
    }

    /// A slave that refuses to run at the start: joint and reason.
    fn refusal(&self) -> Option<DriveFault> {
        let refuses = |slave: usize| {
            let answer = &self.frames.answers[slave];
            !self.begun[slave] && answer.status_came && answer.al_status & AL_ERROR != 0
        };
        let slave = (0..self.slaves.len()).find(|slave| refuses(*slave))?;
        let joint = self
            .joints
            .iter()
            .position(|joint| joint.axis.slave == slave)?;
        let answer = &self.frames.answers[slave];
        Some(DriveFault::DeviceState {
            joint: joint as u32,
            al_status: answer.al_status,
            al_status_code: answer.al_status_code,
        })
    }

    fn take_inputs(&mut self) {
        for slave in 0..self.slaves.len() {
            self.begun[slave] |= self.is_op(slave);
        }
        let period = Duration::from_nanos(self.period_ns);
        for joint in &mut self.joints {
            let answer = &self.frames.answers[joint.axis.slave];
            if answer.inputs_came {
                joint.inputs = Inputs::read(&joint.axis.input_fields, &answer.inputs);
                joint.age_cycles = 0;
            } else {
                joint.age_cycles = joint.age_cycles.saturating_add(1);
            }
            let is_op = answer.al_status == u16::from(OP);
            joint.judge(is_op, period);
        }
    }

    fn fill(&self, sample: &mut DriveSample) {
        let readings = &mut sample.readings;
        for (index, joint) in self.joints.iter().enumerate().take(JOINTS_MAX) {
            let (axis, inputs) = (&joint.axis, &joint.inputs);
            if let Some(counts_s) = inputs.velocity {
                readings.motor_velocity_rad_s[index] = axis.encoder.velocity_rad_s(counts_s);
            }
            if let Some(permille) = inputs.torque {
                readings.motor_torque_nm[index] = axis.torque.torque_nm(permille);
            }
            let drives = &mut sample.drives;
            drives.state[index] = joint.state as u32;
            drives.mode[index] = joint.doing() as u32;
            drives.status_word[index] = u32::from(inputs.statusword);
            drives.error_code[index] = u32::from(inputs.error_code);
            drives.age_cycles[index] = joint.age_cycles;
            drives.warnings[index] = warnings(inputs.statusword);
            drives.position_validity[index] = joint.validity();
            let answer = &self.frames.answers[axis.slave];
            if self.begun[axis.slave] && !self.is_op(axis.slave) {
                drives.device_status[index] =
                    u32::from(answer.al_status) | u32::from(answer.al_status_code) << 16;
            }
        }
        sample.mode = self.together() as u32;
    }

    /// What the drives do together: the gravest.
    fn together(&self) -> DriveMode {
        let of = |mode: DriveMode| self.joints.iter().any(|joint| joint.doing() == mode);
        if of(DriveMode::Braked) {
            DriveMode::Braked
        } else if of(DriveMode::Damping) {
            DriveMode::Damping
        } else {
            self.joints.first().map_or(DriveMode::Braked, Joint::doing)
        }
    }

    fn report(&mut self, working_counter: u16) -> BusReport {
        let (clock, clock_offset_ns) = match &self.pace {
            Some(pace) => (pace.state(), pace.offset_ns()),
            None => (ClockState::None, 0),
        };
        let cut = (0..self.slaves.len()).any(|slave| !self.frames.answers[slave].status_came);
        BusReport {
            clock: clock as u32,
            faults: if cut { bus_fault::LINK_LOST } else { 0 },
            working_counter_expected: u32::from(self.frames.expected),
            working_counter: u32::from(working_counter),
            clock_offset_ns,
            frames_lost: self.frames_lost,
            jitter_ns: std::mem::take(&mut self.jitter_ns),
        }
    }
}

/// The longest there is where a number is too large for one.
fn time(time_s: f64) -> Duration {
    Duration::try_from_secs_f64(time_s).unwrap_or(Duration::MAX)
}

fn warnings(statusword: u16) -> u32 {
    let bits = [
        (STATUS_WARNING, warning::OTHER),
        (STATUS_LIMITED, warning::LIMITED),
        (STATUS_FOLLOWING_ERROR, warning::FOLLOWING),
    ];
    bits.into_iter()
        .filter(|(bit, _)| statusword & bit != 0)
        .fold(0, |warnings, (_, warning)| warnings | warning)
}

impl Joint {
    /// What its statusword comes to.
    fn judge(&mut self, is_op: bool, period: Duration) {
        let power = PowerState::of(self.inputs.statusword);
        self.enabled_cycles = match power {
            PowerState::OperationEnabled => self.enabled_cycles.saturating_add(1),
            _ => 0,
        };
        let opened = self.brake.map_or(BRAKE_RELEASE, |brake| brake.release);
        let open =
            self.inputs.statusword & STATUS_FOLLOWS != 0 || period * self.enabled_cycles > opened;
        self.state = match power {
            _ if !is_op => DriveState::NotReady,
            PowerState::NotReady => DriveState::NotReady,
            PowerState::OperationEnabled if open && self.shows_mode() => DriveState::Enabled,
            PowerState::OperationEnabled => DriveState::Enabling,
            PowerState::QuickStopActive => DriveState::QuickStop,
            PowerState::FaultReactionActive => DriveState::FaultReaction,
            PowerState::Fault => DriveState::Fault,
            _ if self.outputs.controlword != 0 && self.asked.obeys() => DriveState::Enabling,
            _ => DriveState::SwitchedOff,
        };
    }

    /// Whether the drive has taken the mode it was told.
    fn shows_mode(&self) -> bool {
        self.inputs
            .mode
            .is_none_or(|mode| mode == self.outputs.mode)
    }

    fn doing(&self) -> DriveMode {
        match self.state {
            DriveState::Enabled => self.asked,
            DriveState::QuickStop | DriveState::FaultReaction => DriveMode::Damping,
            _ => DriveMode::Braked,
        }
    }

    fn validity(&self) -> u32 {
        let homed = position::HOMED | position::ABSOLUTE | position::MULTI_TURN;
        position::KNOWN | if self.axis.homed { homed } else { 0 }
    }

    fn can(&self, (_, bit): (i8, u32)) -> bool {
        let fields = &self.axis.output_fields;
        let mapped = match bit {
            bit if bit == POSITION.1 => fields.position.is_some(),
            bit if bit == VELOCITY.1 => fields.velocity.is_some(),
            _ => fields.torque.is_some(),
        };
        mapped && self.axis.modes & bit != 0
    }

    fn modes(&self) -> Vec<DriveMode> {
        [
            (TORQUE, DriveMode::Torque),
            (VELOCITY, DriveMode::Velocity),
            (POSITION, DriveMode::Position),
        ]
        .into_iter()
        .filter(|(mode, _)| self.can(*mode))
        .map(|(_, mode)| mode)
        .collect()
    }

    /// What the drive is told next.
    fn tell(
        &mut self,
        index: usize,
        command: &DriveCommand,
        mode: DriveMode,
        request: DriveRequest,
    ) {
        let power = PowerState::of(self.inputs.statusword);
        let is_on = power == PowerState::OperationEnabled;
        let wish = match (mode, request) {
            (DriveMode::Braked, DriveRequest::ResetFault) => Wish::Reset,
            (DriveMode::Braked, DriveRequest::QuickStop) => Wish::QuickStop,
            (DriveMode::Braked, _) => Wish::Off,
            (DriveMode::Damping, _) if is_on => Wish::On,
            (DriveMode::Damping, _) => Wish::Off,
            (_, DriveRequest::Enable) => Wish::On,
            _ if is_on => Wish::On,
            _ => Wish::Off,
        };
        self.asked = mode;
        let axis = &self.axis;
        // Neutral until the drive follows: no torque, no velocity, its own position.
        let mut outputs = Outputs {
            controlword: self.walk.controlword(self.inputs.statusword, wish),
            position: self.inputs.position,
            mode: self.outputs.mode,
            ..Outputs::default()
        };
        let follows = self.state == DriveState::Enabled || (is_on && mode == DriveMode::Damping);
        match mode {
            DriveMode::Torque => {
                outputs.mode = TORQUE.0;
                if follows {
                    outputs.torque = axis.torque.permille(command.motor_torque_nm[index]);
                }
            }
            DriveMode::Velocity => {
                outputs.mode = VELOCITY.0;
                if follows {
                    let motor_rad_s = command.joint_velocity_rad_s[index] * self.gear_ratio;
                    outputs.velocity = axis.encoder.counts_s(motor_rad_s);
                }
            }
            DriveMode::Position => {
                outputs.mode = POSITION.0;
                if follows {
                    let motor_rad = command.joint_position_rad[index] * self.gear_ratio;
                    outputs.position = axis.encoder.count(motor_rad);
                    outputs.torque_offset = axis.torque.permille(command.motor_torque_nm[index]);
                }
            }
            DriveMode::Damping if self.can(VELOCITY) => outputs.mode = VELOCITY.0,
            DriveMode::Damping => {
                outputs.controlword = self
                    .walk
                    .controlword(self.inputs.statusword, Wish::QuickStop)
            }
            DriveMode::Braked | DriveMode::Impedance => {}
        }
        self.outputs = outputs;
    }
}

impl Driver for EthercatDriver {
    fn capabilities(&self) -> Capabilities {
        let joints = self
            .joints
            .iter()
            .map(|joint| {
                let (axis, slave) = (&joint.axis, &self.slaves[joint.axis.slave]);
                let step_nm = axis.torque.rated_nm * 1e-3;
                let [vendor, product, revision, serial] = slave.device.identity;
                JointCapabilities {
                    device: format!(
                        "{} ({vendor:#010x}:{product:#010x}, revision {revision}, serial number {serial}), axis {}",
                        slave.device.name, axis.axis
                    ),
                    joint: None,
                    modes: joint.modes(),
                    motor_torque_max_nm: Some(f64::from(axis.torque.most_permille) * step_nm),
                    motor_torque_step_nm: Some(step_nm),
                    motor_position_step_rad: Some(core::f64::consts::TAU / axis.encoder.counts_turn),
                    watchdog: slave.watchdog,
                    brake: joint.brake,
                    quick_stop: Some(axis.quick_stop),
                    position_validity: joint.validity(),
                }
            })
            .collect();
        Capabilities {
            bus: format!(
                "EtherCAT on {}, {} slaves",
                self.interface,
                self.slaves.len()
            ),
            joints,
            latch_to_act_cycles: Some(1),
            periods_ns: Vec::new(),
            has_clock: self.pace.is_some(),
        }
    }

    fn read(
        &mut self,
        cycle: u64,
        planned_ns: u64,
        give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault> {
        let Some(exchange) = self.frames.fetch(give_up_at_ns) else {
            return Err(self.lost());
        };
        self.lost_in_a_row = 0;
        let half_way_ns = exchange.sent_ns.midpoint(exchange.received_ns);
        self.jitter_ns = self.jitter_ns.max(half_way_ns.abs_diff(planned_ns));
        if let Some(fault) = self.refusal() {
            return Err(fault);
        }
        let mut latched_ns = half_way_ns;
        if let Some(pace) = &mut self.pace {
            match exchange.system_ns {
                Some(system_ns) => {
                    let reading = Reading {
                        system_ns,
                        sent_ns: exchange.sent_ns,
                        received_ns: exchange.received_ns,
                    };
                    latched_ns = pace.observe(reading, planned_ns);
                }
                None => pace.miss(),
            }
        }
        self.take_inputs();
        if self.joints.iter().all(|joint| joint.age_cycles > 0) {
            return Err(DriveFault::WorkingCounter {
                expected: self.frames.expected,
                received: exchange.working_counter,
            });
        }
        let header = Header {
            session: self.session,
            cycle,
            measured_at_ns: latched_ns,
            joint_count: self.joints.len() as u64,
        };
        let mut sample = DriveSample {
            header,
            bus: self.report(exchange.working_counter),
            ..DriveSample::default()
        };
        for (index, joint) in self.joints.iter_mut().enumerate().take(JOINTS_MAX) {
            let count = joint.count.follow(joint.inputs.position);
            sample.readings.motor_position_rad[index] = joint.axis.encoder.angle_rad(count);
            if let (Some(encoder), Some(low)) =
                (&joint.axis.link_encoder, joint.inputs.link_position)
            {
                let count = joint.link_count.follow(low);
                sample.readings.link_position_rad[index] = encoder.angle_rad(count);
            }
        }
        self.fill(&mut sample);
        Ok(sample)
    }

    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        let request = DriveRequest::from_raw(command.request).unwrap_or_default();
        self.resets = request == DriveRequest::ResetFault;
        let mut refused = None;
        for (index, joint) in self.joints.iter_mut().enumerate().take(JOINTS_MAX) {
            let knows = |mode: DriveMode| match mode {
                DriveMode::Torque => joint.can(TORQUE),
                DriveMode::Velocity => joint.can(VELOCITY),
                DriveMode::Position => joint.can(POSITION),
                DriveMode::Impedance => false,
                DriveMode::Braked | DriveMode::Damping => true,
            };
            let mode = command.mode_of(index).filter(|mode| knows(*mode));
            if mode.is_none() {
                refused = Some(DriveFault::ModeRefused { mode: command.mode });
            }
            joint.tell(index, command, mode.unwrap_or(DriveMode::Braked), request);
        }
        let joints = &self.joints;
        self.frames.fill(|slave, bytes| {
            for joint in joints.iter().filter(|joint| joint.axis.slave == slave) {
                joint.outputs.write(&joint.axis.output_fields, bytes);
            }
        });
        let sent = self.frames.send_outputs();
        match refused {
            Some(fault) => Err(fault),
            None if sent => Ok(()),
            None => Err(DriveFault::NotSent),
        }
    }

    /// Asks slaves for OP: at the start, and after they left it when the operator resets.
    fn prepare(&mut self) {
        self.asked_before_cycles = self.asked_before_cycles.saturating_add(1);
        let (answers, begun, resets) = (&self.frames.answers, &self.begun, self.resets);
        let mut waits = [false; 64];
        for (slave, waits) in waits.iter_mut().enumerate().take(answers.len()) {
            let status = answers[slave].al_status;
            let first = !begun[slave] && status == SAFE_OP;
            let fallen = begun[slave] && resets && status & 0x0f == SAFE_OP;
            *waits = first || fallen;
        }
        if self.asked_before_cycles >= ASK_CYCLES && waits.contains(&true) {
            self.asked_before_cycles = 0;
            self.frames.ask(ASK_OP, |slave| waits[slave]);
        }
    }

    fn acyclic(&mut self) -> Option<Box<dyn Acyclic>> {
        let stations = self
            .joints
            .iter()
            .map(|joint| {
                let station = self.slaves[joint.axis.slave].device.station;
                (station, joint.axis.axis)
            })
            .collect();
        Some(Box::new(Channel {
            client: self.client.take()?,
            stations,
        }))
    }

    fn shutdown(&mut self) {
        let braked = DriveCommand {
            request: DriveRequest::QuickStop as u32,
            ..DriveCommand::default()
        };
        let end_ns = self.frames.now_ns() + SHUTDOWN_NS;
        while self.frames.now_ns() < end_ns {
            let give_up_at_ns = self.frames.now_ns() + self.period_ns;
            let fetched = self.frames.fetch(give_up_at_ns).is_some();
            if fetched {
                self.take_inputs();
            }
            let moves = |joint: &Joint| {
                use PowerState::{FaultReactionActive, OperationEnabled, QuickStopActive};
                let power = PowerState::of(joint.inputs.statusword);
                matches!(
                    power,
                    OperationEnabled | QuickStopActive | FaultReactionActive
                )
            };
            // what a drive out of OP would do it cannot be told; it stops by itself
            if !self.joints.iter().any(moves) || self.lost_in_a_row >= LINK_LOST_FRAMES {
                break;
            }
            self.lost_in_a_row = if fetched { 0 } else { self.lost_in_a_row + 1 };
            let _ = self.write(&braked);
            self.frames.sleep(self.period_ns);
        }
        let (first, count) = CLIENT_INDICES;
        if let Ok(link) = self.cable.open() {
            let mut client = Client::new(link, first, count);
            // INIT first: a drive in OP would take the end of SYNC0 for a fault
            let _ = client.write_all(0x0120, &[0x11, 0]);
            let _ = client.write_all(0x0981, &[0]);
        }
    }
}

/// SDOs beside the cycle, on a socket of their own.
struct Channel {
    client: Client,
    stations: Vec<(u16, u8)>,
}

impl Channel {
    fn place(&self, joint: usize, object: Object) -> Result<(u16, u16), AcyclicError> {
        let (station, axis) = *self
            .stations
            .get(joint)
            .ok_or(AcyclicError::NoJoint { joint })?;
        // the profile's objects, of which each axis has its own
        let of_axis = (0x6000..0xa000).contains(&object.index);
        let offset = if of_axis {
            AXIS_OFFSET * u16::from(axis)
        } else {
            0
        };
        Ok((station, object.index.wrapping_add(offset)))
    }
}

fn acyclic_error(error: ClientError) -> AcyclicError {
    match error {
        ClientError::Refused { code, .. } => AcyclicError::Refused { code },
        _ => AcyclicError::NoAnswer,
    }
}

impl Acyclic for Channel {
    fn read(
        &mut self,
        joint: usize,
        object: Object,
        buffer: &mut [u8],
    ) -> Result<usize, AcyclicError> {
        let (station, index) = self.place(joint, object)?;
        let bytes = self
            .client
            .upload(station, index, object.sub_index)
            .map_err(acyclic_error)?;
        let target = buffer
            .get_mut(..bytes.len())
            .ok_or(AcyclicError::TooLong { bytes: bytes.len() })?;
        target.copy_from_slice(&bytes);
        Ok(bytes.len())
    }

    fn write(&mut self, joint: usize, object: Object, bytes: &[u8]) -> Result<(), AcyclicError> {
        if bytes.len() > 4 {
            return Err(AcyclicError::TooLong { bytes: bytes.len() });
        }
        let (station, index) = self.place(joint, object)?;
        self.client
            .download(station, index, object.sub_index, bytes)
            .map_err(acyclic_error)
    }
}
