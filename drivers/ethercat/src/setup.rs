//! Opening the bus: who is there, whether they are the robot's drives, their settings written and read back, SAFE-OP.

use core::f64::consts::TAU;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::time::Duration;

use ethercat_wire::frame::{u16_at, u32_at, u64_at};
use ethercat_wire::link::{Cable, Link};
use ethercat_wire::socket::{RawSocket, SocketError};
use robot::Robot;
use rt_loop::driver::{OpenError, QuickStop};

use crate::client::{Client, ClientError};
use crate::image::{AXIS_OFFSET, InputFields, Mapped, OutputFields};
use crate::master::{Device, Master};
use crate::settings::{JointTable, Settings};
use crate::units::{Encoder, TorqueScale};

/// Frames of another master come at least so often: masters cycle at 100 Hz and faster.
const LISTEN_NS: u64 = 50_000_000;
/// How long a change of state may take (ETG.1020: 5 s and more for some; ours has no firmware to load).
const STATE_NS: u64 = 5_000_000_000;
/// Before the first SYNC0, so that all slaves are told of it.
const SYNC0_AHEAD_NS: u64 = 100_000_000;
/// How near all clocks must be before SYNC0 starts, and how long that may take.
const CLOCKS_NEAR_NS: u32 = 1000;
const CLOCKS_NS: u64 = 2_000_000_000;
/// Axes a slave at most, by the profile's area of 0x800 objects for each.
const AXES_MAX: u8 = 8;
/// Mapping objects of the next axis of a slave begin this much later (ETG.6010).
const MAPPING_OFFSET: u16 = 0x10;
/// What is told of both sides may differ so much: rated torque has whole mNm, files have few digits.
const RATED_SHARE: f64 = 0.02;
/// Quick stop option (0x605a): down the quick stop ramp, then without torque.
const QUICK_STOP_RAMP: i16 = 2;
/// A quick stop ramp that is read back may differ by what a file's digits leave.
const RAMP_SHARE: f64 = 1e-3;
/// How far two encoders of a joint may disagree at start: a gear's windup is a hundredth of that.
const ENCODERS_APART_RAD: f64 = 0.1;
/// Datagrams of start-up and of the channel beside the cycle have these numbers, the cycle's have others.
pub const CLIENT_INDICES: (u8, u8) = (1, 60);

/// AL states.
const INIT: u8 = 1;
const SAFE_OP: u8 = 4;
/// AL status of a slave that runs.
pub const OP: u8 = 8;

/// A slave in SAFE-OP.
#[derive(Clone, Debug)]
pub struct Slave {
    /// Who it is.
    pub device: Device,
    /// Logical address and length of its outputs and inputs.
    pub outputs: (u32, usize),
    /// The same of its inputs.
    pub inputs: (u32, usize),
    /// Watchdog of its process data, read back.
    pub watchdog: Option<Duration>,
}

/// An axis of a slave, as read from it.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Position of its slave along the cable.
    pub slave: usize,
    /// Axis of the slave.
    pub axis: u8,
    /// Where its outputs lie.
    pub output_fields: OutputFields,
    /// Where its inputs lie.
    pub input_fields: InputFields,
    /// Motor encoder.
    pub encoder: Encoder,
    /// Encoder behind the gear.
    pub link_encoder: Option<Encoder>,
    /// Torque.
    pub torque: TorqueScale,
    /// Supported modes (0x6502).
    pub modes: u32,
    /// Whether counts stand for the joint's angle.
    pub homed: bool,
    /// How it stops, read back.
    pub quick_stop: QuickStop,
}

/// The bus in SAFE-OP, ready to run.
pub struct Bus {
    /// For what is not urgent.
    pub client: Client,
    /// Slaves along the cable.
    pub slaves: Vec<Slave>,
    /// Axes in the robot's order of joints.
    pub axes: Vec<Axis>,
    /// System time of a SYNC0, and that of its reference: where distributed clocks are used.
    pub sync0_ns: Option<u64>,
}

fn hardware(error: impl std::fmt::Display) -> OpenError {
    OpenError::Hardware(error.to_string())
}

/// The slaves at a cable in PRE-OP; `interface` is what people call it.
///
/// # Errors
/// [`OpenError::Hardware`].
pub fn find(cable: &dyn Cable, interface: &str) -> Result<(Client, Master), OpenError> {
    let open = || cable.open().map_err(hardware);
    let (first, count) = CLIENT_INDICES;
    let mut client = Client::new(open()?, first, count);
    if client.hears_another_master(LISTEN_NS) {
        return Err(OpenError::Hardware(format!(
            "interface `{interface}`: another master runs this bus; stop it first"
        )));
    }
    let slaves = client.read_all(0x0130, 2).map(|(_, slaves)| slaves);
    if matches!(slaves, Err(_) | Ok(0)) {
        return Err(OpenError::Hardware(format!(
            "interface `{interface}`: no slaves answer; look at the cable, the drives' supply and [drive] interface"
        )));
    }
    let master = Master::to_pre_op(open()?)
        .map_err(|error| OpenError::Hardware(format!("interface `{interface}`: {error}")))?;
    Ok((client, master))
}

/// The cable at an interface that no other program of ours has meanwhile.
#[derive(Debug)]
pub struct OwnInterface {
    name: String,
    _lock: UnixListener,
}

impl OwnInterface {
    /// Takes it.
    ///
    /// # Errors
    /// [`OpenError::Hardware`] while another one has it.
    pub fn take(name: &str) -> Result<Self, OpenError> {
        // An abstract name belongs to the network namespace, as the interface does, and ends with the program.
        let address = SocketAddr::from_abstract_name(format!("flexspline-ethercat-{name}"));
        let lock = UnixListener::bind_addr(&address.map_err(hardware)?).map_err(|_| {
            OpenError::Hardware(format!(
                "interface `{name}`: another flexspline runs this bus; stop it first"
            ))
        })?;
        Ok(Self {
            name: name.to_owned(),
            _lock: lock,
        })
    }
}

impl Cable for OwnInterface {
    fn open(&self) -> Result<Box<dyn Link>, SocketError> {
        Ok(Box::new(RawSocket::open(&self.name)?))
    }
}

/// Axes that a slave has, by their statuswords.
///
/// # Errors
/// [`ClientError`].
pub fn axes_of(client: &mut Client, station: u16) -> Result<u8, ClientError> {
    for axis in 0..AXES_MAX {
        if !exists(client, station, 0x6041 + AXIS_OFFSET * u16::from(axis), 0)? {
            return Ok(axis);
        }
    }
    Ok(AXES_MAX)
}

/// Whether a slave has an object.
///
/// # Errors
/// [`ClientError`].
pub fn exists(
    client: &mut Client,
    station: u16,
    index: u16,
    sub_index: u8,
) -> Result<bool, ClientError> {
    match client.upload(station, index, sub_index) {
        Ok(_) => Ok(true),
        Err(ClientError::Refused { .. }) => Ok(false),
        Err(error) => Err(error),
    }
}

/// Opens the bus of a robot.
///
/// # Errors
/// [`OpenError`] in one line.
pub fn open(
    cable: &dyn Cable,
    robot: &Robot,
    settings: &Settings,
    period_ns: u64,
) -> Result<Bus, OpenError> {
    let (mut client, master) = find(cable, &settings.bus.interface)?;
    let devices = master.devices.clone();
    let outcome = configure(&mut client, master, robot, settings, period_ns);
    match outcome {
        Ok((slaves, axes, sync0_ns)) => Ok(Bus {
            client,
            slaves,
            axes,
            sync0_ns,
        }),
        Err(error) => {
            // nothing moved; leave the slaves as they were found
            for device in devices {
                let _ = client.write(device.station, 0x0120, &[INIT | 0x10, 0]);
            }
            Err(error)
        }
    }
}

type Configured = (Vec<Slave>, Vec<Axis>, Option<u64>);

fn configure(
    client: &mut Client,
    master: Master,
    robot: &Robot,
    settings: &Settings,
    period_ns: u64,
) -> Result<Configured, OpenError> {
    let devices = master.devices.clone();
    let mut counts = Vec::new();
    for device in &devices {
        counts.push(axes_of(client, device.station).map_err(hardware)?);
    }
    let places = places(robot, settings, &devices, &counts)?;
    for (device, axes) in devices.iter().zip(&counts) {
        if settings.bus.write_mapping && *axes > 0 {
            write_mapping(client, device, *axes)?;
        }
        synchronise(client, device, *axes, settings, period_ns)?;
    }
    let mut axes = Vec::new();
    for (joint, (slave, axis)) in places.iter().enumerate() {
        let place = Place {
            robot,
            joint,
            table: &settings.joints[joint],
            device: &devices[*slave],
            axis: *axis,
        };
        axes.push(place.read(client, *slave)?);
    }
    master.map().map_err(hardware)?;
    let mut slaves = Vec::new();
    for device in &devices {
        slaves.push(mapped_slave(client, device, settings)?);
    }
    let sync0_ns = if settings.bus.distributed_clocks {
        Some(start_clocks(client, &devices, period_ns)?)
    } else {
        None
    };
    for device in &devices {
        to_safe_op(client, device)?;
    }
    check_positions(client, robot, &slaves, &axes)?;
    Ok((slaves, axes, sync0_ns))
}

/// Which axis drives which joint.
fn places(
    robot: &Robot,
    settings: &Settings,
    devices: &[Device],
    counts: &[u8],
) -> Result<Vec<(usize, u8)>, OpenError> {
    let all: Vec<(usize, u8)> = counts
        .iter()
        .enumerate()
        .flat_map(|(slave, count)| (0..*count).map(move |axis| (slave, axis)))
        .collect();
    let wrong = |joint: usize, what: String| {
        Err(OpenError::Hardware(format!(
            "joint `{}`: {what}",
            robot.joints[joint].name
        )))
    };
    let mut places = Vec::new();
    for (joint, table) in settings.joints.iter().enumerate() {
        let place = match table.slave {
            Some(slave) => (usize::from(slave), table.axis),
            None => match all.get(joint) {
                Some(place) => *place,
                None => {
                    return Err(OpenError::Hardware(format!(
                        "the robot has {} joints, the bus {} axes on {} slaves; connect the rest, or name another robot file",
                        robot.joints.len(),
                        all.len(),
                        devices.len()
                    )));
                }
            },
        };
        if !all.contains(&place) {
            let told = match counts.get(place.0) {
                Some(count) => format!("slave {} has {count} axes", place.0),
                None => format!("the bus has {} slaves", devices.len()),
            };
            return wrong(
                joint,
                format!(
                    "no slave {} with axis {}: {told}; change its drive table",
                    place.0, place.1
                ),
            );
        }
        let device = &devices[place.0];
        for (what, asked, found) in [
            ("vendor", table.vendor, device.identity[0]),
            ("product", table.product, device.identity[1]),
        ] {
            if let Some(asked) = asked
                && asked != found
            {
                return wrong(
                    joint,
                    format!(
                        "slave {} ({}) has {what} {found:#010x}, the robot file says {asked:#010x}; put the drives in the file's order",
                        place.0, device.name
                    ),
                );
            }
        }
        places.push(place);
    }
    Ok(places)
}

/// Objects that are mapped where a drive has them: index, sub-index, bits.
const OUTPUTS: [(u16, u8, u8); 6] = [
    (0x6040, 0, 16),
    (0x6071, 0, 16),
    (0x607a, 0, 32),
    (0x60ff, 0, 32),
    (0x60b2, 0, 16),
    (0x6060, 0, 8),
];
const INPUTS: [(u16, u8, u8); 7] = [
    (0x6041, 0, 16),
    (0x603f, 0, 16),
    (0x6064, 0, 32),
    (0x606c, 0, 32),
    (0x60e4, 1, 32),
    (0x6077, 0, 16),
    (0x6061, 0, 8),
];

fn write_mapping(client: &mut Client, device: &Device, axes: u8) -> Result<(), OpenError> {
    let station = device.station;
    let told = |error: ClientError| {
        OpenError::Hardware(format!(
            "{error}, while its mapping is written; with write_mapping = false in [drive] the drive's own is taken"
        ))
    };
    for (assignment, first, objects) in [
        (0x1c12_u16, 0x1600_u16, &OUTPUTS[..]),
        (0x1c13, 0x1a00, &INPUTS[..]),
    ] {
        client
            .download(station, assignment, 0, &[0])
            .map_err(told)?;
        for axis in 0..axes {
            let pdo = first + MAPPING_OFFSET * u16::from(axis);
            client.download(station, pdo, 0, &[0]).map_err(told)?;
            let mut count = 0;
            for (index, sub_index, bits) in objects {
                let index = index + AXIS_OFFSET * u16::from(axis);
                if !exists(client, station, index, *sub_index).map_err(hardware)? {
                    continue;
                }
                count += 1;
                let entry = u32::from(index) << 16 | u32::from(*sub_index) << 8 | u32::from(*bits);
                client
                    .download(station, pdo, count, &entry.to_le_bytes())
                    .map_err(told)?;
            }
            client.download(station, pdo, 0, &[count]).map_err(told)?;
            client
                .download(station, assignment, axis + 1, &pdo.to_le_bytes())
                .map_err(told)?;
        }
        client
            .download(station, assignment, 0, &[axes])
            .map_err(told)?;
    }
    Ok(())
}

/// Synchronisation type and period.
fn synchronise(
    client: &mut Client,
    device: &Device,
    axes: u8,
    settings: &Settings,
    period_ns: u64,
) -> Result<(), OpenError> {
    let station = device.station;
    let kind: u16 = if settings.bus.distributed_clocks {
        2
    } else {
        1
    };
    // Read-only in some drives, which set it by themselves, and missing in others.
    optional(client.download(station, 0x1c32, 1, &kind.to_le_bytes()))?;
    for axis in 0..axes {
        let at = |index: u16| index + AXIS_OFFSET * u16::from(axis);
        let (value, index) = interpolation_period(period_ns);
        optional(client.download(station, at(0x60c2), 1, &[value]))?;
        optional(client.download(station, at(0x60c2), 2, &index.to_le_bytes()))?;
    }
    Ok(())
}

/// What a drive may refuse.
fn optional(outcome: Result<(), ClientError>) -> Result<(), OpenError> {
    match outcome {
        Ok(()) | Err(ClientError::Refused { .. }) => Ok(()),
        Err(error) => Err(hardware(error)),
    }
}

/// A period as value and power of ten of a second, as near as a byte comes (0x60c2).
fn interpolation_period(period_ns: u64) -> (u8, i8) {
    let exponents = (-9_i8..=0).map(|exponent| (10_u64.pow((exponent + 9) as u32), exponent));
    let mut rounded =
        exponents.map(|(unit_ns, exponent)| ((period_ns + unit_ns / 2) / unit_ns, exponent));
    let fits = rounded.find(|(value, _)| *value <= 255);
    fits.map_or((1, -3), |(value, exponent)| (value.max(1) as u8, exponent))
}

/// A joint's axis in its slave.
struct Place<'a> {
    robot: &'a Robot,
    joint: usize,
    table: &'a JointTable,
    device: &'a Device,
    axis: u8,
}

impl Place<'_> {
    fn told(&self, what: impl std::fmt::Display) -> OpenError {
        OpenError::Hardware(format!(
            "joint `{}` ({} at {:#06x}, axis {}): {what}",
            self.robot.joints[self.joint].name, self.device.name, self.device.station, self.axis
        ))
    }

    /// A number of the axis.
    fn number(&self, client: &mut Client, index: u16, sub_index: u8) -> Result<u32, OpenError> {
        let at = index + AXIS_OFFSET * u16::from(self.axis);
        client
            .number(self.device.station, at, sub_index)
            .map_err(|error| self.told(error))
    }

    /// The same, of an object that not every drive has.
    fn optional(
        &self,
        client: &mut Client,
        index: u16,
        sub_index: u8,
    ) -> Result<Option<u32>, OpenError> {
        let at = index + AXIS_OFFSET * u16::from(self.axis);
        match client.number(self.device.station, at, sub_index) {
            Ok(number) => Ok(Some(number)),
            Err(ClientError::Refused { .. }) => Ok(None),
            Err(error) => Err(self.told(error)),
        }
    }

    fn read(&self, client: &mut Client, slave: usize) -> Result<Axis, OpenError> {
        let station = self.device.station;
        let missing = |object: u16| {
            self.told(format!(
                "object {object:#06x} is not in the process data; map it in the drive, or let write_mapping do it"
            ))
        };
        let mut mapping = |assignment| {
            read_mapping(client, station, assignment).map_err(|error| self.told(error))
        };
        let output_fields = OutputFields::of(&mapping(0x1c12)?, self.axis).map_err(missing)?;
        let input_fields = InputFields::of(&mapping(0x1c13)?, self.axis).map_err(missing)?;
        let encoder = self.encoder(client)?;
        let quick_stop = self.quick_stop(client, &encoder)?;
        let link_encoder = self.link_encoder(client, input_fields.link_position.is_some())?;
        Ok(Axis {
            slave,
            axis: self.axis,
            output_fields,
            input_fields,
            encoder,
            link_encoder,
            torque: self.torque(client)?,
            modes: self.number(client, 0x6502, 0)?,
            homed: self.table.homed,
            quick_stop,
        })
    }

    /// Ramp and option, written where the robot file says so, and read back.
    fn quick_stop(&self, client: &mut Client, encoder: &Encoder) -> Result<QuickStop, OpenError> {
        let station = self.device.station;
        let at = |index: u16| index + AXIS_OFFSET * u16::from(self.axis);
        // Down the ramp, then without torque: a stop that ends. A drive that has no choice refuses what nobody asked for.
        let option = self.table.quick_stop_option.unwrap_or(QUICK_STOP_RAMP);
        optional(client.download(station, at(0x605a), 0, &option.to_le_bytes()))?;
        let read_option = self.optional(client, 0x605a, 0)?.map(|raw| raw as i16);
        if let Some(asked) = self.table.quick_stop_option
            && read_option != Some(asked)
        {
            let has = read_option.map_or("has none".to_owned(), |option| format!("keeps {option}"));
            return Err(self.told(format!(
                "the drive {has} as its quick stop option (0x605a), the robot file says quick_stop_option = {asked}; leave it out, or \
                 set the drive"
            )));
        }
        let counts_rad = self.robot.joints[self.joint].gear_ratio * encoder.counts_turn / TAU;
        if let Some(ramp_rad_s2) = self.table.quick_stop_rad_s2 {
            let counts_s2 = (ramp_rad_s2 * counts_rad)
                .round()
                .clamp(1.0, f64::from(u32::MAX)) as u32;
            optional(client.download(station, at(0x6085), 0, &counts_s2.to_le_bytes()))?;
        }
        let read_rad_s2 = self
            .optional(client, 0x6085, 0)?
            .map(|counts_s2| f64::from(counts_s2) / counts_rad);
        if let Some(asked_rad_s2) = self.table.quick_stop_rad_s2 {
            // A count a second squared, or the digits of a file.
            let tolerance_rad_s2 = (1.0 / counts_rad).max(RAMP_SHARE * asked_rad_s2);
            let fits =
                read_rad_s2.is_some_and(|read| (read - asked_rad_s2).abs() <= tolerance_rad_s2);
            if !fits {
                let has = read_rad_s2.map_or("has none".to_owned(), |read| {
                    format!("keeps {read:.3} rad/s²")
                });
                return Err(self.told(format!(
                    "the drive {has} as its quick stop ramp (0x6085, joint side), the robot file says quick_stop_rad_s2 = \
                     {asked_rad_s2}; leave it out, or set the drive"
                )));
            }
        }
        Ok(QuickStop {
            ramp_rad_s2: read_rad_s2,
            option: read_option,
        })
    }

    fn encoder(&self, client: &mut Client) -> Result<Encoder, OpenError> {
        let ratio = |turns: Option<u32>, of: Option<u32>| {
            turns.zip(of).map(|(turns, of)| (turns, of.max(1)))
        };
        let gear = ratio(
            self.optional(client, 0x6091, 1)?,
            self.optional(client, 0x6091, 2)?,
        );
        if let Some((motor, shaft)) = gear
            && motor != shaft
        {
            return Err(self.told(format!(
                "the drive has a gear ratio of {motor}/{shaft} of its own (0x6091); set it to 1/1, the joint's is gear_ratio"
            )));
        }
        let read = ratio(
            self.optional(client, 0x608f, 1)?,
            self.optional(client, 0x608f, 2)?,
        );
        let counts_turn = match (self.table.encoder_counts, read) {
            (Some(asked), Some((counts, turns)))
                if u64::from(asked) * u64::from(turns) != u64::from(counts) =>
            {
                return Err(self.told(format!(
                    "the drive counts {} a turn (0x608f), the robot file says encoder_counts = {asked}",
                    f64::from(counts) / f64::from(turns)
                )));
            }
            (Some(asked), _) => f64::from(asked),
            (None, Some((counts, turns))) if counts > 0 => f64::from(counts) / f64::from(turns),
            _ => {
                return Err(self.told(
                    "the drive does not say what a turn counts (0x608f); give encoder_counts in its drive table",
                ));
            }
        };
        Ok(Encoder {
            counts_turn,
            reversed: self.table.reversed,
            zero_count: self.table.zero_count,
        })
    }

    fn link_encoder(
        &self,
        client: &mut Client,
        mapped: bool,
    ) -> Result<Option<Encoder>, OpenError> {
        let asked = self.table.link_encoder_counts;
        let read = self
            .optional(client, 0x60e6, 1)?
            .filter(|counts| *counts > 0);
        if asked.is_some() && !mapped {
            return Err(self.told(
                "the robot file has link_encoder_counts, and the drive no second position (0x60e4:01) in its process data",
            ));
        }
        if let (Some(asked), Some(counts)) = (asked, read)
            && asked != counts
        {
            return Err(self.told(format!(
                "the second encoder counts {counts} a turn (0x60e6), the robot file says link_encoder_counts = {asked}"
            )));
        }
        let counts = asked.or(read).filter(|_| mapped);
        Ok(counts.map(|counts| Encoder {
            counts_turn: f64::from(counts),
            reversed: self.table.link_reversed,
            zero_count: self.table.link_zero_count,
        }))
    }

    fn torque(&self, client: &mut Client) -> Result<TorqueScale, OpenError> {
        let read_nm = self
            .optional(client, 0x6076, 0)?
            .filter(|mnm| *mnm > 0)
            .map(|mnm| f64::from(mnm) * 1e-3);
        let rated_nm = match (self.table.rated_torque_nm, read_nm) {
            (Some(asked_nm), Some(read_nm))
                if (asked_nm - read_nm).abs() > RATED_SHARE * read_nm =>
            {
                return Err(self.told(format!(
                    "the drive's rated torque is {read_nm} Nm (0x6076), the robot file says rated_torque_nm = {asked_nm}"
                )));
            }
            (_, Some(read_nm)) => read_nm,
            (Some(asked_nm), None) => asked_nm,
            (None, None) => {
                return Err(self.told(
                    "the drive does not say its rated torque (0x6076); give rated_torque_nm in its drive table",
                ));
            }
        };
        let most_permille = self.optional(client, 0x6072, 0)?.unwrap_or(1000);
        Ok(TorqueScale {
            rated_nm,
            reversed: self.table.reversed,
            most_permille: u16::try_from(most_permille).unwrap_or(u16::MAX),
        })
    }
}

/// What a slave's assigned mappings say.
///
/// # Errors
/// [`ClientError`].
pub fn read_mapping(
    client: &mut Client,
    station: u16,
    assignment: u16,
) -> Result<Vec<Mapped>, ClientError> {
    let (mut mapping, mut at_bit) = (Vec::new(), 0);
    for position in 1..=client.number(station, assignment, 0)? as u8 {
        let pdo = client.number(station, assignment, position)? as u16;
        for entry in 1..=client.number(station, pdo, 0)? as u8 {
            let raw = client.number(station, pdo, entry)?;
            let bits = raw as u8;
            mapping.push(Mapped {
                index: (raw >> 16) as u16,
                sub_index: (raw >> 8) as u8,
                bits,
                at_bit,
            });
            at_bit += usize::from(bits);
        }
    }
    Ok(mapping)
}

/// Where a slave's process data lie, and its watchdog, written and read back.
fn mapped_slave(
    client: &mut Client,
    device: &Device,
    settings: &Settings,
) -> Result<Slave, OpenError> {
    const WATCHDOG_TRIGGER: u8 = 0x40;
    let station = device.station;
    let fmmus = client.read(station, 0x0600, 128).map_err(hardware)?;
    let area = |kind: u8| {
        let of_kind = |fmmu: &&[u8]| fmmu[12] & 1 != 0 && fmmu[11] & 3 == kind;
        let found = fmmus.chunks(16).find(of_kind);
        found.map_or((0, 0), |fmmu| {
            (u32_at(fmmu, 0), usize::from(u16_at(fmmu, 4)))
        })
    };
    let (outputs, inputs) = (area(2), area(1));
    let divider = u16_at(&client.read(station, 0x0400, 2).map_err(hardware)?, 0);
    // ETG.1000.4, Table 34: units of the divider plus 2, in 40 ns
    let unit_ns = 40 * (u64::from(divider) + 2);
    let wanted_ns = settings.watchdog().as_nanos() as u64;
    let count = (wanted_ns / unit_ns).clamp(1, u64::from(u16::MAX)) as u16;
    client
        .write(station, 0x0420, &count.to_le_bytes())
        .map_err(hardware)?;
    let mut manager = client.read(station, 0x0810, 8).map_err(hardware)?;
    if manager[4] & WATCHDOG_TRIGGER == 0 && outputs.1 > 0 {
        manager[4] |= WATCHDOG_TRIGGER;
        client.write(station, 0x0810, &manager).map_err(hardware)?;
    }
    let control = client.read(station, 0x0814, 1).map_err(hardware)?[0];
    let count = u16_at(&client.read(station, 0x0420, 2).map_err(hardware)?, 0);
    let watches = control & WATCHDOG_TRIGGER != 0 && count > 0;
    Ok(Slave {
        device: device.clone(),
        outputs,
        inputs,
        watchdog: watches.then(|| Duration::from_nanos(unit_ns * u64::from(count))),
    })
}

/// Brings the clocks together and starts SYNC0 in all slaves; the system time of its first pulse.
fn start_clocks(client: &mut Client, devices: &[Device], period_ns: u64) -> Result<u64, OpenError> {
    const FRMW: u8 = 14;
    if let Some(position) = devices.iter().position(|device| !device.has_clock) {
        return Err(OpenError::Hardware(format!(
            "slave {position} ({}) has no distributed clock; set distributed_clocks = false in [drive]",
            devices[position].name
        )));
    }
    let reference = devices[0].station;
    let end_ns = client.now_ns() + CLOCKS_NS;
    loop {
        for _ in 0..50 {
            client
                .datagram(FRMW, reference, 0x0910, &[0; 8])
                .map_err(hardware)?;
        }
        let mut apart = (0, 0);
        for (position, device) in devices.iter().enumerate() {
            let raw = u32_at(
                &client.read(device.station, 0x092c, 4).map_err(hardware)?,
                0,
            );
            apart = apart.max((raw & 0x7fff_ffff, position));
        }
        if apart.0 < CLOCKS_NEAR_NS {
            break;
        }
        if client.now_ns() > end_ns {
            return Err(OpenError::Hardware(format!(
                "the clock of slave {} ({}) does not come into step: {} ns apart; set distributed_clocks = false in [drive]",
                apart.1, devices[apart.1].name, apart.0
            )));
        }
    }
    let cycle_ns = u32::try_from(period_ns).map_err(hardware)?;
    let system_ns = u64_at(&client.read(reference, 0x0910, 8).map_err(hardware)?, 0);
    let start_ns = system_ns + SYNC0_AHEAD_NS;
    for device in devices {
        let mut write = |register: u16, bytes: &[u8]| {
            client
                .write(device.station, register, bytes)
                .map_err(hardware)
        };
        write(0x0981, &[0])?;
        write(0x0990, &start_ns.to_le_bytes())?;
        write(0x09a0, &cycle_ns.to_le_bytes())?;
        write(0x0981, &[0x03])?;
    }
    Ok(start_ns)
}

fn to_safe_op(client: &mut Client, device: &Device) -> Result<(), OpenError> {
    let station = device.station;
    client
        .write(station, 0x0120, &[SAFE_OP | 0x10, 0])
        .map_err(hardware)?;
    let end_ns = client.now_ns() + STATE_NS;
    loop {
        let status = client.read(station, 0x0130, 6).map_err(hardware)?;
        if status[0] == SAFE_OP {
            return Ok(());
        }
        if status[0] & 0x10 != 0 || client.now_ns() > end_ns {
            let code = u16_at(&status, 4);
            return Err(OpenError::Hardware(format!(
                "slave {station:#06x} ({}) refuses SAFE-OP: AL status {:#04x}, code {code:#06x}, {}",
                device.name,
                status[0],
                al_text(code)
            )));
        }
    }
}

/// What an AL status code means (ETG.1000.6, Table 11), with what to change.
pub fn al_text(code: u16) -> &'static str {
    match code {
        0x0000 => "it gives no reason",
        0x0011 | 0x0012 => "the state cannot be had from here",
        0x0016 => "its mailbox is set up wrongly",
        0x001a => "it lost the synchronisation",
        0x001b => "its watchdog ran out: no outputs came",
        0x001d => "its outputs are mapped wrongly",
        0x001e => "its inputs are mapped wrongly",
        0x002c | 0x002d => "SYNC0 does not come",
        0x0030 => {
            "distributed clocks are set up wrongly; try distributed_clocks = false in [drive]"
        }
        0x0035 | 0x0036 => "it does not take this cycle time; choose another with --rate",
        _ => "see the drive's manual",
    }
}

/// The first position is not believed blindly: two encoders must agree, and one must lie where the joint can be.
fn check_positions(
    client: &mut Client,
    robot: &Robot,
    slaves: &[Slave],
    axes: &[Axis],
) -> Result<(), OpenError> {
    for (joint, axis) in robot.joints.iter().zip(axes) {
        let station = slaves[axis.slave].device.station;
        let at = |index: u16| index + AXIS_OFFSET * u16::from(axis.axis);
        let mut count = |index: u16, sub_index: u8| {
            client
                .number(station, at(index), sub_index)
                .map_err(hardware)
        };
        let motor = i64::from(count(0x6064, 0)? as i32);
        let of_motor_rad = axis.encoder.angle_rad(motor) / joint.gear_ratio;
        if let Some(encoder) = &axis.link_encoder {
            let of_link_rad = encoder.angle_rad(i64::from(count(0x60e4, 1)? as i32));
            if axis.homed && (of_link_rad - of_motor_rad).abs() > ENCODERS_APART_RAD {
                return Err(OpenError::Hardware(format!(
                    "joint `{}`: its encoders disagree: {of_motor_rad:.3} rad by the motor's, {of_link_rad:.3} rad by the second; look at gear_ratio, zero_count, link_zero_count and which are reversed",
                    joint.name
                )));
            }
        }
        if let Some([low_rad, high_rad]) = joint.position_limit_rad
            && axis.homed
            && !(low_rad..=high_rad).contains(&of_motor_rad)
        {
            return Err(OpenError::Hardware(format!(
                "joint `{}`: it stands at {of_motor_rad:.3} rad, outside its limits {low_rad} to {high_rad}; look at zero_count and gear_ratio",
                joint.name
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_is_a_byte_and_a_power_of_ten() {
        assert_eq!(interpolation_period(1_000_000), (100, -5));
        assert_eq!(interpolation_period(2_000_000), (200, -5));
        assert_eq!(interpolation_period(666_667), (67, -5));
        assert_eq!(interpolation_period(8_000_000), (80, -4));
        assert_eq!(interpolation_period(125_000), (125, -6));
    }
}
