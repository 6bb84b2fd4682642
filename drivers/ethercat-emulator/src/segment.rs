//! A line of slaves: frames go from one to the next and back, time passes for all of them, and faults come.

use joint_model::JOINTS_MAX;
use plant_emulator::{JointCommand, Plant, PlantSample};

use crate::axis::Sensed;
use crate::esc::{Passing, register};
use crate::fault::{Fault, TimedFault};
use crate::slave::Slave;
use crate::wire::{Command, Datagram, for_each_datagram, is_ethercat, mark_returned};

/// From one slave's port to the next one's: two PHYs and the controller between them. Assumed; a data sheet's example has 0.6 µs.
const HOP_NS: u64 = 600;
/// A pause in which nobody called is stepped over, not lived through.
const PAUSE_MAX_NS: u64 = 1_000_000_000;
/// AL state OP.
const OP: u8 = 8;
/// More than any frame carries.
const DATAGRAM_MAX: usize = 2048;

/// How a frame comes back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Returned {
    /// How often: 0 where it is lost.
    pub copies: u8,
    /// How much later.
    pub delay_ns: u64,
}

/// Something that ends by itself.
#[derive(Clone, Copy, Debug)]
enum Ending {
    Cable,
    Cause { joint: usize },
    BrownOut { slave: usize },
    DcLost { slave: usize },
    MailboxSilent { slave: usize },
}

/// What is broken at the moment.
#[derive(Debug, Default)]
struct Broken {
    cut_after: Option<usize>,
    lost: u32,
    doubled: u32,
    delayed: u32,
    delay_ns: u64,
    /// Slave and datagrams left.
    short: Option<(usize, u32)>,
    endings: Vec<(u64, Ending)>,
}

/// A line of slaves with a robot behind them.
#[derive(Debug)]
pub struct Segment {
    slaves: Vec<Slave>,
    plant: Plant,
    sample: PlantSample,
    step_ns: u64,
    next_step_ns: u64,
    /// Where the robot will be at the next step: worked out half a period before, when no frame waits for it.
    ahead: Option<PlantSample>,
    ahead_at_ns: Option<u64>,
    seen_ns: u64,
    /// Still to come, the next one last; in time since `operational_ns`.
    faults: Vec<TimedFault>,
    operational_ns: Option<u64>,
    broken: Broken,
    frames: u64,
}

impl Segment {
    /// A line of slaves at `now_ns`, powered up before. The drives' own cycle is the plant's period, `step_ns`.
    pub fn new(
        slaves: Vec<Slave>,
        plant: Plant,
        step_ns: u64,
        mut faults: Vec<TimedFault>,
        now_ns: u64,
    ) -> Self {
        faults.sort_by_key(|timed| core::cmp::Reverse(timed.at_ns));
        let mut segment = Self {
            slaves,
            sample: plant.sample(),
            plant,
            step_ns,
            next_step_ns: now_ns + step_ns,
            ahead: None,
            ahead_at_ns: None,
            seen_ns: now_ns,
            faults,
            operational_ns: None,
            broken: Broken::default(),
            frames: 0,
        };
        segment.show_ports();
        segment
    }

    /// The slaves, in the frame's order.
    pub fn slaves(&self) -> &[Slave] {
        &self.slaves
    }

    /// The slaves, to break.
    pub fn slaves_mut(&mut self) -> &mut [Slave] {
        &mut self.slaves
    }

    /// The same with pushes on the robot from outside.
    #[must_use]
    pub fn with_pushes(mut self, pushes: Vec<robot::Push>) -> Self {
        self.plant = self.plant.with_pushes(pushes);
        self
    }

    /// Pushes a joint of the robot from now on, joint side. What names a joint that is not there does nothing.
    pub fn push(&mut self, joint: usize, torque_nm: f64, duration_s: f64) {
        self.plant.push(joint, torque_nm, duration_s);
    }

    /// The robot behind them.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Frames that came.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// A frame of the master comes in; it is changed as the slaves change it. `None` for what is not EtherCAT.
    pub fn receive(&mut self, frame: &mut [u8], now_ns: u64) -> Option<Returned> {
        if !is_ethercat(frame) {
            return None;
        }
        self.advance(now_ns);
        self.frames += 1;
        let reachable = self.reachable();
        if reachable == 0 {
            return Some(Returned {
                copies: 0,
                delay_ns: 0,
            });
        }
        for_each_datagram(frame, |mut datagram| {
            for position in 0..reachable {
                let in_ns = now_ns + HOP_NS * position as u64;
                let behind = (reachable - 1 - position) as u64;
                let passing = Passing {
                    in_ns,
                    back_ns: (behind > 0).then_some(in_ns + 2 * HOP_NS * behind),
                };
                let before = datagram.working_counter();
                serve(&mut self.slaves[position], &mut datagram, passing);
                shorten(&mut self.broken.short, position, &mut datagram, before);
            }
        });
        for slave in &mut self.slaves[..reachable] {
            slave.react(now_ns);
        }
        self.look_around(now_ns);
        mark_returned(frame);
        Some(self.way_back())
    }

    /// Slaves that frames reach.
    fn reachable(&self) -> usize {
        let cut = self.broken.cut_after.unwrap_or(usize::MAX);
        // DL control, bits 10 and 11: port 1 closed by the master
        let closed = self
            .slaves
            .iter()
            .position(|slave| slave.esc.u16(register::DL_CONTROL) & 0x0c00 == 0x0c00)
            .map_or(usize::MAX, |position| position + 1);
        self.slaves.len().min(cut).min(closed)
    }

    fn way_back(&mut self) -> Returned {
        let takes = |left: &mut u32| {
            let takes = *left > 0;
            *left = left.saturating_sub(1);
            takes
        };
        let broken = &mut self.broken;
        let copies = if takes(&mut broken.lost) {
            0
        } else if takes(&mut broken.doubled) {
            2
        } else {
            1
        };
        let delay_ns = if takes(&mut broken.delayed) {
            broken.delay_ns
        } else {
            0
        };
        Returned { copies, delay_ns }
    }

    fn look_around(&mut self, now_ns: u64) {
        for slave in &mut self.slaves {
            slave.watch(now_ns);
        }
        self.show_ports();
        if self.operational_ns.is_none() && self.slaves.iter().all(|slave| slave.al_state() == OP) {
            self.operational_ns = Some(now_ns);
        }
    }

    /// DL status: which ports have a link, and lost links counted.
    fn show_ports(&mut self) {
        // the slave works, its watchdog too; link and signal at port 0; ports 2 and 3 closed
        const ALWAYS: u16 = 0x5213;
        const PORT_1_OPEN: u16 = 0x0820;
        const PORT_1_CLOSED: u16 = 0x0400;
        let reachable = self.reachable();
        let last = self.slaves.len() - 1;
        for (position, slave) in self.slaves.iter_mut().enumerate() {
            let open = position < last && (position >= reachable || position + 1 < reachable);
            let status = ALWAYS | if open { PORT_1_OPEN } else { PORT_1_CLOSED };
            let before = slave.esc.u16(register::DL_STATUS);
            if before & PORT_1_OPEN != 0 && !open {
                let lost = slave.esc.u16(register::LOST_LINK_PORT_1);
                slave
                    .esc
                    .set_u16(register::LOST_LINK_PORT_1, lost.saturating_add(1) & 0xff);
            }
            slave.esc.set_u16(register::DL_STATUS, status);
        }
    }

    /// When something happens next without a frame.
    pub fn next_event_ns(&self) -> u64 {
        self.next_event().0
    }

    fn next_event(&self) -> (u64, Event) {
        let mut next = (self.next_step_ns, Event::Step);
        let mut consider = |at_ns: Option<u64>, event: Event| {
            if let Some(at_ns) = at_ns
                && at_ns < next.0
            {
                next = (at_ns, event);
            }
        };
        for (position, slave) in self.slaves.iter().enumerate() {
            consider(slave.next_sync0_ns(self.seen_ns), Event::Sync0(position));
            consider(slave.watchdog_due_ns(), Event::Watchdog(position));
        }
        for (position, (at_ns, _)) in self.broken.endings.iter().enumerate() {
            consider(Some(*at_ns), Event::Ending(position));
        }
        consider(self.ahead_at_ns, Event::Ahead);
        let fault_ns = self
            .operational_ns
            .zip(self.faults.last())
            .map(|(since_ns, timed)| since_ns.saturating_add(timed.at_ns));
        consider(fault_ns, Event::Fault);
        next
    }

    /// Time passes: whatever is due up to `now_ns` happens, in its order.
    pub fn advance(&mut self, now_ns: u64) {
        if now_ns.saturating_sub(self.seen_ns) > PAUSE_MAX_NS {
            for slave in &mut self.slaves {
                slave.esc.clock.skip_pulses(now_ns);
            }
            self.next_step_ns = self.next_step_ns.max(now_ns);
        }
        loop {
            let (at_ns, event) = self.next_event();
            if at_ns > now_ns {
                break;
            }
            self.seen_ns = self.seen_ns.max(at_ns);
            match event {
                Event::Ahead => {
                    self.ahead_at_ns = None;
                    self.ahead = Some(self.work_out());
                }
                Event::Step => {
                    self.step_plant(at_ns);
                    self.next_step_ns = at_ns + self.step_ns;
                    self.step_slaves(|slave, step_ns| !slave.paced_by_sync0(step_ns));
                }
                Event::Sync0(position) => self.sync0(position, at_ns),
                Event::Watchdog(position) => self.slaves[position].watch(at_ns),
                Event::Ending(position) => {
                    let (_, ending) = self.broken.endings.swap_remove(position);
                    self.end(ending);
                }
                Event::Fault => {
                    if let Some(timed) = self.faults.pop() {
                        self.inject(timed.fault, at_ns);
                    }
                }
            }
        }
        self.seen_ns = self.seen_ns.max(now_ns);
    }

    /// The first slave paced by SYNC0 paces the plant too: what acts from one pulse is latched at the next.
    fn sync0(&mut self, position: usize, at_ns: u64) {
        let paced = |slave: &Slave| slave.paced_by_sync0(self.step_ns);
        let leads = self.slaves.iter().position(paced) == Some(position);
        if leads {
            self.step_plant(at_ns);
            // takes over again where the pulses stop
            self.next_step_ns = at_ns + self.step_ns + self.step_ns / 2;
        }
        let step_ns = self.step_ns;
        let is_paced = self.slaves[position].paced_by_sync0(step_ns);
        self.slaves[position].sync0();
        if is_paced {
            let sample = self.sample;
            self.slaves[position].step(|joint| sensed(&sample, joint), step_ns as f64 * 1e-9);
        }
        if leads {
            self.step_slaves(|slave, step_ns| !slave.paced_by_sync0(step_ns));
        }
    }

    fn step_plant(&mut self, at_ns: u64) {
        self.sample = match self.ahead.take() {
            Some(sample) => sample,
            None => self.work_out(),
        };
        self.ahead_at_ns = Some(at_ns + self.step_ns / 2);
    }

    /// One period of the robot with what the drives do in it, which they decided at its beginning.
    fn work_out(&mut self) -> PlantSample {
        let mut commands = [JointCommand::default(); JOINTS_MAX];
        for axis in self.slaves.iter().flat_map(Slave::axes) {
            if let Some(command) = commands.get_mut(axis.config().joint) {
                *command = axis.command();
            }
        }
        self.plant.step_joints(true, &commands)
    }

    fn step_slaves(&mut self, wanted: impl Fn(&Slave, u64) -> bool) {
        let (sample, step_ns) = (self.sample, self.step_ns);
        for slave in &mut self.slaves {
            if wanted(slave, step_ns) {
                slave.step(|joint| sensed(&sample, joint), step_ns as f64 * 1e-9);
            }
        }
    }

    /// Breaks something now. What names a slave or joint that is not there does nothing.
    pub fn inject(&mut self, fault: Fault, now_ns: u64) {
        let broken = &mut self.broken;
        let mut ends = |for_ns: u64, ending: Ending| {
            broken.endings.push((now_ns.saturating_add(for_ns), ending));
        };
        match fault {
            Fault::CableOut { after, for_ns } => {
                ends(for_ns, Ending::Cable);
                broken.cut_after = Some(after);
            }
            Fault::FrameLost { count } => broken.lost = count,
            Fault::FrameDoubled { count } => broken.doubled = count,
            Fault::FrameDelayed { count, by_ns } => {
                broken.delayed = count;
                broken.delay_ns = by_ns;
            }
            Fault::CounterShort { slave, count } => broken.short = Some((slave, count)),
            Fault::SlaveReset { slave } => {
                if let Some(slave) = self.slaves.get_mut(slave) {
                    slave.power_cycle(now_ns);
                }
            }
            Fault::DriveFault {
                joint,
                code,
                for_ns,
            } => {
                ends(for_ns, Ending::Cause { joint });
                self.each_axis_of(joint, |axis| axis.raise(code, for_ns > 0));
            }
            Fault::BrownOut { slave, for_ns } => {
                ends(for_ns, Ending::BrownOut { slave });
                self.brown_out(slave, true);
            }
            Fault::DcLost { slave, for_ns } => {
                ends(for_ns, Ending::DcLost { slave });
                if let Some(slave) = self.slaves.get_mut(slave) {
                    slave.cut_sync(true);
                }
            }
            Fault::MailboxSilent { slave, for_ns } => {
                ends(for_ns, Ending::MailboxSilent { slave });
                if let Some(slave) = self.slaves.get_mut(slave) {
                    slave.silence_mailbox(true);
                }
            }
        }
        self.show_ports();
    }

    fn end(&mut self, ending: Ending) {
        match ending {
            Ending::Cable => self.broken.cut_after = None,
            Ending::Cause { joint } => self.each_axis_of(joint, crate::axis::Axis::clear_cause),
            Ending::BrownOut { slave } => self.brown_out(slave, false),
            Ending::DcLost { slave } => {
                if let Some(slave) = self.slaves.get_mut(slave) {
                    slave.cut_sync(false);
                }
            }
            Ending::MailboxSilent { slave } => {
                if let Some(slave) = self.slaves.get_mut(slave) {
                    slave.silence_mailbox(false);
                }
            }
        }
        self.show_ports();
    }

    fn each_axis_of(&mut self, joint: usize, act: impl Fn(&mut crate::axis::Axis)) {
        for axis in self.slaves.iter_mut().flat_map(Slave::axes_mut) {
            if axis.config().joint == joint {
                act(axis);
            }
        }
    }

    fn brown_out(&mut self, slave: usize, brown_out: bool) {
        let axes = self.slaves.get_mut(slave).map(Slave::axes_mut);
        for axis in axes.unwrap_or_default() {
            axis.set_brown_out(brown_out);
        }
    }
}

#[derive(Clone, Copy, Debug)]
enum Event {
    Step,
    Ahead,
    Sync0(usize),
    Watchdog(usize),
    Ending(usize),
    Fault,
}

fn sensed(sample: &PlantSample, joint: usize) -> Sensed {
    let reading = |values: &[f64; JOINTS_MAX]| values.get(joint).copied().unwrap_or(f64::NAN);
    Sensed {
        motor_position_rad: reading(&sample.motor_position_rad),
        motor_velocity_rad_s: reading(&sample.motor_velocity_rad_s),
        motor_torque_nm: reading(&sample.motor_torque_nm),
        link_position_rad: reading(&sample.link_position_rad),
    }
}

/// Takes back what the slave counted, where it is to be short.
fn shorten(
    short: &mut Option<(usize, u32)>,
    position: usize,
    datagram: &mut Datagram<'_>,
    before: u16,
) {
    let counted = datagram.working_counter().wrapping_sub(before);
    let logical = matches!(
        datagram.command(),
        Some(Command::Lrd | Command::Lwr | Command::Lrw)
    );
    let Some((slave, left)) = short else {
        return;
    };
    if *slave != position || !logical || counted == 0 {
        return;
    }
    datagram.uncount(counted);
    *left = left.saturating_sub(1);
    if *left == 0 {
        *short = None;
    }
}

/// One slave serves one datagram (ETG.1000.4, section 5.4).
fn serve(slave: &mut Slave, datagram: &mut Datagram<'_>, passing: Passing) {
    use Command::*;
    let Some(command) = datagram.command() else {
        return;
    };
    let station = datagram.station();
    if command.counts_position() {
        datagram.set_station(station.wrapping_add(1));
    }
    let esc = &mut slave.esc;
    let by_address = station == esc.u16(register::STATION_ADDRESS);
    let addressed = match command {
        Aprd | Apwr | Aprw | Armw => station == 0,
        Fprd | Fpwr | Fprw | Frmw => by_address,
        Brd | Bwr | Brw | Lrd | Lwr | Lrw => true,
    };
    let mut scratch = [0; DATAGRAM_MAX];
    let (offset, logical, length) = (datagram.offset(), datagram.logical(), datagram.data.len());
    let read = &mut scratch[..length];
    let (reads, writes) = match command {
        Aprd | Fprd | Brd => (addressed, false),
        Apwr | Fpwr | Bwr => (false, addressed),
        Aprw | Fprw | Brw => (addressed, addressed),
        // one reads, all others write
        Armw | Frmw => (addressed, !addressed),
        Lrd | Lwr | Lrw => {
            read.copy_from_slice(datagram.data);
            let was_read = command != Lwr && esc.read_logical(passing, logical, read);
            let written = command != Lrd && esc.write_logical(passing, logical, datagram.data);
            if was_read {
                datagram.data.copy_from_slice(read);
            }
            let writes = if command == Lrw { 2 } else { 1 };
            datagram.count(u16::from(was_read) + writes * u16::from(written));
            return;
        }
    };
    let was_read = reads && esc.read(passing, offset, read);
    let written = writes && esc.write(passing, offset, datagram.data);
    if was_read {
        let joins = matches!(command, Brd | Brw);
        for (target, byte) in datagram.data.iter_mut().zip(read) {
            *target = if joins { *target | *byte } else { *byte };
        }
    }
    let both = matches!(command, Aprw | Fprw | Brw);
    let writes = if both { 2 } else { 1 };
    datagram.count(u16::from(was_read) + writes * u16::from(written));
}
