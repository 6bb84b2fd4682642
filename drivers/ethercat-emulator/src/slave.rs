//! One slave: controller, state machine, mailbox, process data, and the axes behind them.
//!
//! Source: ETG.1000.6, sections 5.3 (state machine) and Table 11 (AL status codes); ETG.1020 for what is checked when.

use crate::axis::{AXIS_OFFSET, Axis, AxisConfig, BusState, Mapped, Sensed, error_code};
use crate::clock::{CYCLE_MIN_NS, Clock};
use crate::coe::{Objects, Server};
use crate::esc::{Esc, register};
use crate::objects::{DataType, Dictionary, Entry, Mappable, abort};
use crate::power::PowerState;
use crate::sii::{self, Pdo, PdoEntry};

/// Mailboxes: request, answer.
const MAILBOXES: [(u16, u16); 2] = [(0x1000, 128), (0x1080, 128)];
/// Where outputs and inputs lie.
const PROCESS_DATA_START: [u16; 2] = [0x1100, 0x1400];
/// Bytes of outputs or inputs at most.
pub const PROCESS_DATA_MAX: usize = 256;
/// Axes of a slave at most: as many as fit between the objects of the first and the end of the profile's area.
pub const AXES_MAX: usize = 8;
/// Entries of a mapping at most.
const MAPPING_MAX: u8 = 16;
/// Mapping objects of the next axis begin this much later (ETG.6010).
const MAPPING_OFFSET: u16 = 0x10;
/// What a missed SYNC0 adds to the counter that a met one takes 1 off (ETG.1020, section 10.3: object 0x10f1).
const MISSED_WEIGHT: u32 = 3;

/// AL status codes (ETG.1000.6, Table 11).
pub mod al_code {
    #![allow(missing_docs, reason = "the names say it")]
    pub const INVALID_CHANGE: u16 = 0x0011;
    pub const UNKNOWN_STATE: u16 = 0x0012;
    pub const NO_BOOT: u16 = 0x0013;
    pub const MAILBOX: u16 = 0x0016;
    pub const WATCHDOG: u16 = 0x001b;
    pub const OUTPUTS: u16 = 0x001d;
    pub const INPUTS: u16 = 0x001e;
    pub const SYNC_LOST: u16 = 0x001a;
    pub const SYNC_TYPE: u16 = 0x0028;
    pub const DC_SETTING: u16 = 0x0030;
    pub const DC_CYCLE: u16 = 0x0035;
    pub const FATAL_SYNC: u16 = 0x002c;
}

const INIT: u8 = 1;
const PRE_OP: u8 = 2;
const BOOT: u8 = 3;
const SAFE_OP: u8 = 4;
const OP: u8 = 8;

/// How a slave is built.
#[derive(Clone, Debug)]
pub struct SlaveConfig {
    /// Station alias.
    pub alias: u16,
    /// Vendor, product, revision, serial number.
    pub identity: [u32; 4],
    /// Axes, at most [`AXES_MAX`].
    pub axes: Vec<AxisConfig>,
    /// What its clock is off by.
    pub clock_error_ppm: f64,
    /// Cycle times of SYNC0 that it takes; all from 125 µs on if empty.
    pub cycle_times_ns: Vec<u32>,
    /// The master may write the synchronisation type (0x1c32:01).
    pub sync_type_writable: bool,
    /// Missed SYNC0s, each counting 3, each met taking one off, after which it leaves OP; 0: never. Object 0x10f1:02.
    pub sync_error_limit: u32,
    /// An axis whose controlword the master does not send puts all axes into fault when one is enabled.
    pub needs_all_axes: bool,
    /// Faults are told by an emergency message.
    pub emergencies: bool,
}

/// One copied entry between process data and dictionary.
#[derive(Clone, Copy, Debug)]
struct Copied {
    at: usize,
    length: usize,
    object: Option<(u16, u8)>,
}

/// A slave.
#[derive(Clone, Debug)]
pub struct Slave {
    config: SlaveConfig,
    /// What the master sees.
    pub esc: Esc,
    dictionary: Dictionary,
    server: Server,
    axes: Vec<Axis>,
    /// Outputs, inputs.
    copied: [Vec<Copied>; 2],
    mapped: Vec<Mapped>,
    state: u8,
    failed: bool,
    outputs_at_ns: Option<u64>,
    outputs_since_sync: bool,
    sync_started: bool,
    sync_error_count: u32,
    was_in_process_data: bool,
    /// SYNC0 does not reach the drive.
    sync_cut: bool,
    mailbox_silent: bool,
}

impl Slave {
    /// A slave as after power-up at `now_ns`.
    pub fn new(config: SlaveConfig, now_ns: u64) -> Self {
        let axes: Vec<Axis> = config
            .axes
            .iter()
            .enumerate()
            .map(|(position, axis)| Axis::new(axis.clone(), position))
            .collect();
        let dictionary = dictionary(&config, &axes);
        let esc = Esc::new(
            eeprom(&config, &dictionary),
            Clock::new(now_ns, config.clock_error_ppm),
        );
        let mut slave = Self {
            mapped: vec![Mapped::default(); axes.len()],
            config,
            esc,
            dictionary,
            server: Server::default(),
            axes,
            copied: [Vec::new(), Vec::new()],
            state: INIT,
            failed: false,
            outputs_at_ns: None,
            outputs_since_sync: false,
            sync_started: false,
            sync_error_count: 0,
            was_in_process_data: false,
            sync_cut: false,
            mailbox_silent: false,
        };
        slave.show_state(0);
        slave
    }

    /// Power off and on again: registers and objects are as new; what was written to the EEPROM stays.
    pub fn power_cycle(&mut self, now_ns: u64) {
        let eeprom = self.esc.eeprom().to_vec();
        let mut fresh = Self::new(self.config.clone(), now_ns);
        fresh.esc = Esc::new(eeprom, Clock::new(now_ns, self.config.clock_error_ppm));
        fresh.show_state(0);
        *self = fresh;
    }

    /// Its axes.
    pub fn axes(&self) -> &[Axis] {
        &self.axes
    }

    /// Its axes, to break.
    pub fn axes_mut(&mut self) -> &mut [Axis] {
        &mut self.axes
    }

    /// State as AL status has it, without the error bit.
    pub fn al_state(&self) -> u8 {
        self.state
    }

    /// SYNC0 stops reaching the drive, or comes back.
    pub fn cut_sync(&mut self, cut: bool) {
        self.sync_cut = cut;
    }

    /// Requests in the mailbox are left where they are, or taken up again.
    pub fn silence_mailbox(&mut self, silent: bool) {
        self.mailbox_silent = silent;
        if !silent && self.state >= PRE_OP && !self.server.is_busy() {
            self.mailbox();
            self.hand_out_answer();
        }
    }

    /// A value of its dictionary.
    pub fn object(&self, index: u16, sub_index: u8) -> i64 {
        self.dictionary.number(index, sub_index)
    }

    fn show_state(&mut self, code: u16) {
        let error = if self.failed { 0x10 } else { 0 };
        self.esc
            .set_u16(register::AL_STATUS, u16::from(self.state) | error);
        self.esc.set_u16(register::AL_STATUS_CODE, code);
    }

    /// Looks at what the master did since the last time.
    pub fn react(&mut self, now_ns: u64) {
        let events = core::mem::take(&mut self.esc.events);
        if events.reset {
            self.power_cycle(now_ns);
            return;
        }
        if events.al_control {
            self.al_control(now_ns);
        }
        // A request stays in the mailbox while answers wait to be fetched.
        let asked = (events.mailbox_request || events.answer_fetched) && !self.mailbox_silent;
        if asked && self.state >= PRE_OP && !self.server.is_busy() {
            self.mailbox();
        }
        if events.repeat {
            self.esc.repeat_mailbox(1);
        }
        self.hand_out_answer();
        if events.outputs && self.state >= SAFE_OP {
            self.outputs_at_ns = Some(now_ns);
            self.outputs_since_sync = true;
            self.esc.set_u16(register::WATCHDOG_STATUS, 1);
            if !self.synchronised() {
                self.take_outputs();
            }
        }
    }

    fn hand_out_answer(&mut self) {
        if self.state < PRE_OP {
            return;
        }
        if let Some(answer) = self.server.answer()
            && self.esc.fill_mailbox(1, answer)
        {
            self.server.handed_out();
        }
    }

    fn mailbox(&mut self) {
        let Some(message) = self.esc.take_mailbox(0) else {
            return;
        };
        let capacity = usize::from(self.esc.sync_manager(1).length);
        let mut server = core::mem::take(&mut self.server);
        server.request(&message, capacity, self);
        self.server = server;
    }

    // ---- state machine ----

    fn al_control(&mut self, now_ns: u64) {
        let control = self.esc.u16(register::AL_CONTROL);
        let acknowledged = control & 0x10 != 0;
        let asked = (control & 0x0f) as u8;
        if self.failed && !acknowledged && asked > self.state {
            return;
        }
        if acknowledged {
            self.failed = false;
        }
        let outcome = match asked {
            INIT | PRE_OP | SAFE_OP | OP => self.change(asked, now_ns),
            BOOT => Err(al_code::NO_BOOT),
            _ => Err(al_code::UNKNOWN_STATE),
        };
        match outcome {
            Ok(()) => self.show_state(0),
            Err(code) => {
                self.failed = true;
                self.show_state(code);
            }
        }
    }

    fn change(&mut self, asked: u8, now_ns: u64) -> Result<(), u16> {
        match (self.state, asked) {
            (from, to) if to == from => Ok(()),
            (_, INIT) => {
                self.leave_process_data();
                self.server.reset();
                self.state = INIT;
                Ok(())
            }
            (INIT, PRE_OP) => {
                self.check_mailboxes()?;
                self.server.reset();
                self.state = PRE_OP;
                Ok(())
            }
            (SAFE_OP | OP, PRE_OP) => {
                self.leave_process_data();
                self.state = PRE_OP;
                Ok(())
            }
            (PRE_OP, SAFE_OP) => {
                self.prepare_process_data()?;
                self.state = SAFE_OP;
                self.give_inputs();
                Ok(())
            }
            (OP, SAFE_OP) => {
                self.state = SAFE_OP;
                Ok(())
            }
            (SAFE_OP, OP) => {
                self.check_sync()?;
                // SOEM goes to SAFE-OP before it starts SYNC0, so it is missed here only.
                let wants_sync0 = self.dictionary.number(0x1c32, 1) == 2;
                if wants_sync0 && !self.synchronised() {
                    return Err(al_code::DC_SETTING);
                }
                self.sync_error_count = 0;
                // The watchdog runs from here, whether outputs have come or not.
                self.outputs_at_ns = Some(now_ns);
                self.state = OP;
                Ok(())
            }
            _ => Err(al_code::INVALID_CHANGE),
        }
    }

    fn leave_process_data(&mut self) {
        self.outputs_at_ns = None;
        self.sync_started = false;
        self.copied = [Vec::new(), Vec::new()];
        self.mapped.fill(Mapped::default());
    }

    /// Falls back with an error.
    fn fall(&mut self, state: u8, code: u16) {
        self.failed = true;
        self.state = state;
        self.show_state(code);
    }

    fn check_mailboxes(&self) -> Result<(), u16> {
        for (index, (start, length)) in MAILBOXES.into_iter().enumerate() {
            let manager = self.esc.sync_manager(index);
            let is_ours = manager.start == start
                && manager.length == length
                && manager.enabled
                && manager.master_writes() == (index == 0);
            if !is_ours {
                return Err(al_code::MAILBOX);
            }
        }
        Ok(())
    }

    fn prepare_process_data(&mut self) -> Result<(), u16> {
        let codes = [al_code::OUTPUTS, al_code::INPUTS];
        for (direction, code) in codes.into_iter().enumerate() {
            let copied = self.compile(direction).ok_or(code)?;
            let length = copied.last().map_or(0, |last| last.at + last.length);
            let manager = self.esc.sync_manager(2 + direction);
            let fits = manager.start == PROCESS_DATA_START[direction]
                && usize::from(manager.length) == length
                && manager.enabled
                && manager.master_writes() == (direction == 0);
            let is_off = length == 0 && (!manager.enabled || manager.length == 0);
            if !fits && !is_off {
                return Err(code);
            }
            self.copied[direction] = copied;
        }
        self.mapped = (0..self.axes.len())
            .map(|axis| self.mapped_of(axis))
            .collect();
        self.check_sync()
    }

    /// What the assigned mappings say, entry by entry; `None` where one cannot be.
    fn compile(&self, direction: usize) -> Option<Vec<Copied>> {
        let assignment = 0x1c12 + direction as u16;
        let mut bits = 0_usize;
        let mut copied = Vec::new();
        for position in 1..=self.dictionary.number(assignment, 0) as u8 {
            let pdo = self.dictionary.number(assignment, position) as u16;
            self.dictionary.entry(pdo, 0)?;
            for entry in 1..=self.dictionary.number(pdo, 0) as u8 {
                let mapping = self.dictionary.number(pdo, entry) as u32;
                let (object, length) = split_mapping(mapping);
                if !bits.is_multiple_of(8) || !length.is_multiple_of(8) {
                    return None;
                }
                copied.push(Copied {
                    at: bits / 8,
                    length: usize::from(length / 8),
                    object: (object.0 != 0).then_some(object),
                });
                bits += usize::from(length);
            }
        }
        (bits <= 8 * PROCESS_DATA_MAX).then_some(copied)
    }

    fn mapped_of(&self, axis: usize) -> Mapped {
        let has = |index: u16| {
            let object = (index + AXIS_OFFSET * axis as u16, 0);
            self.copied[0]
                .iter()
                .any(|copied| copied.object == Some(object))
        };
        Mapped {
            controlword: has(0x6040),
            position: has(0x607a),
            velocity: has(0x60ff),
            torque: has(0x6071),
        }
    }

    fn check_sync(&self) -> Result<(), u16> {
        match self.esc.sync0_setting() {
            None => Ok(()),
            Some(0) => Err(al_code::DC_SETTING),
            Some(cycle_ns) => {
                let taken = &self.config.cycle_times_ns;
                let fits = |taken_ns: &u32| taken_ns.abs_diff(cycle_ns) <= taken_ns / 1000;
                let listed = taken.is_empty() || taken.iter().any(fits);
                if listed && cycle_ns >= CYCLE_MIN_NS {
                    Ok(())
                } else {
                    Err(al_code::DC_CYCLE)
                }
            }
        }
    }

    // ---- process data ----

    /// Whether outputs act at SYNC0 instead of when they come.
    fn synchronised(&self) -> bool {
        self.esc.sync0_setting().is_some()
    }

    /// Whether SYNC0 paces the drive's own cycle of `step_ns`.
    pub fn paced_by_sync0(&self, step_ns: u64) -> bool {
        self.sync0_pulses()
            .is_some_and(|cycle_ns| cycle_ns.abs_diff(step_ns) <= step_ns / 100)
    }

    fn sync0_pulses(&self) -> Option<u64> {
        if self.sync_cut {
            return None;
        }
        self.esc.clock.sync0_cycle_ns()
    }

    /// When the next SYNC0 is due, by the time outside.
    pub fn next_sync0_ns(&self, now_ns: u64) -> Option<u64> {
        self.esc.clock.next_sync0_ns(now_ns)
    }

    /// SYNC0: outputs act, whether they are new is counted.
    pub fn sync0(&mut self) {
        self.esc.clock.pulse();
        if self.sync_cut {
            self.count_sync(false);
            return;
        }
        let met = core::mem::take(&mut self.outputs_since_sync);
        self.sync_started |= met;
        if self.sync_started {
            self.count_sync(met);
        }
        if self.state >= SAFE_OP {
            self.take_outputs();
        }
    }

    fn count_sync(&mut self, met: bool) {
        if self.state != OP {
            return;
        }
        if met {
            self.sync_error_count = self.sync_error_count.saturating_sub(1);
            return;
        }
        let missed = self.dictionary.number(0x1c32, 0x0b) + 1;
        self.dictionary
            .set(0x1c32, 0x0b, missed.min(i64::from(u16::MAX)));
        self.sync_error_count += MISSED_WEIGHT;
        let limit = self.dictionary.number(0x10f1, 2);
        if limit > 0 && i64::from(self.sync_error_count) > limit {
            self.dictionary.set(0x1c32, 0x20, 1);
            self.fall(SAFE_OP, al_code::SYNC_LOST);
        }
    }

    fn take_outputs(&mut self) {
        if self.state != OP {
            return;
        }
        for copied in &self.copied[0] {
            let Some((index, sub_index)) = copied.object else {
                continue;
            };
            let bytes = self.esc.buffer(2).get(copied.at..copied.at + copied.length);
            if let (Some(bytes), Some(entry)) = (bytes, self.dictionary.entry_mut(index, sub_index))
            {
                entry.value = entry.decode(bytes);
            }
        }
    }

    /// Puts the newest values where the master fetches them.
    pub fn give_inputs(&mut self) {
        if self.state < SAFE_OP {
            return;
        }
        for copied in &self.copied[1] {
            let value = copied.object.map_or(0, |(index, sub_index)| {
                self.dictionary.number(index, sub_index)
            });
            let range = copied.at..copied.at + copied.length;
            if let Some(bytes) = self.esc.buffer_mut(3).get_mut(range) {
                bytes.copy_from_slice(&value.to_le_bytes()[..copied.length]);
            }
        }
    }

    /// One step of the drive's own cycle.
    pub fn step(&mut self, sensed: impl Fn(usize) -> Sensed, step_s: f64) {
        let operational = self.state == OP;
        for (axis, mapped) in self.axes.iter_mut().zip(&self.mapped) {
            let bus = BusState {
                operational,
                mapped: *mapped,
            };
            let was_enabled = axis.state() == PowerState::OperationEnabled;
            axis.step(
                &mut self.dictionary,
                &sensed(axis.config().joint),
                bus,
                step_s,
            );
            let begins = !was_enabled && axis.state() == PowerState::OperationEnabled;
            let all = self.mapped.iter().all(|mapped| mapped.controlword);
            if begins && self.config.needs_all_axes && !all {
                axis.raise(error_code::PARAMETER, false);
                self.failed_together();
                break;
            }
        }
        self.tell_faults();
        self.give_inputs();
    }

    fn failed_together(&mut self) {
        for axis in &mut self.axes {
            axis.raise(error_code::PARAMETER, false);
        }
    }

    fn tell_faults(&mut self) {
        let mut any = false;
        for axis in &mut self.axes {
            if let Some(code) = axis.take_new_fault() {
                // bit 0: generic error (CiA 301, object 0x1001)
                if self.config.emergencies && self.state >= PRE_OP {
                    self.server.emergency(code, 1);
                }
            }
            any |= matches!(
                axis.state(),
                PowerState::Fault | PowerState::FaultReactionActive
            );
        }
        self.dictionary.set(0x1001, 0, i64::from(any));
        self.hand_out_answer();
    }

    /// When the process-data watchdog runs out, by the time outside.
    pub fn watchdog_due_ns(&self) -> Option<u64> {
        let time = u64::from(self.esc.u16(register::WATCHDOG_PROCESS_DATA));
        let feeds = self.esc.sync_manager(2).feeds_watchdog();
        if self.state != OP || time == 0 || !feeds || self.copied[0].is_empty() {
            return None;
        }
        // ETG.1000.4, Table 34: the divider counts 25 MHz, and 2 is added.
        let unit_ns = 40 * (u64::from(self.esc.u16(register::WATCHDOG_DIVIDER)) + 2);
        Some(self.outputs_at_ns? + time * unit_ns)
    }

    /// Time passes: the watchdog may run out, SYNC0 may have been switched off under way.
    pub fn watch(&mut self, now_ns: u64) {
        let expired = self
            .watchdog_due_ns()
            .is_some_and(|due_ns| due_ns <= now_ns);
        if expired {
            let count = self.esc.u16(register::WATCHDOG_COUNTER);
            // one byte, which stops at its end
            self.esc
                .set_u16(register::WATCHDOG_COUNTER, (count + 1).min(255));
            self.fall(SAFE_OP, al_code::WATCHDOG);
        }
        if expired {
            self.esc.set_u16(register::WATCHDOG_STATUS, 0);
        }
        let runs_synchronised = self.state == OP && self.sync_started;
        if runs_synchronised && self.esc.sync0_setting().is_none() {
            self.sync_started = false;
            self.fall(SAFE_OP, al_code::FATAL_SYNC);
        }
        let runs = self.state >= SAFE_OP;
        if core::mem::replace(&mut self.was_in_process_data, runs) != runs {
            let cycle_ns = self.esc.sync0_setting().unwrap_or(0);
            for index in [0x1c32, 0x1c33] {
                self.dictionary.set(index, 0x0a, i64::from(cycle_ns));
            }
        }
    }
}

impl Objects for Slave {
    fn dictionary(&mut self) -> &Dictionary {
        &self.dictionary
    }

    fn write(&mut self, index: u16, sub_index: u8, bytes: &[u8]) -> Result<(), u32> {
        let runs = self.state >= SAFE_OP;
        let value = self.dictionary.check(index, sub_index, bytes, runs)?;
        if let Some(axis) = axis_of(index, 0x6040)
            && self
                .mapped
                .get(axis)
                .is_some_and(|mapped| mapped.controlword)
        {
            return Err(abort::DEVICE_STATE);
        }
        if axis_of(index, 0x6060).is_some() && ![0, 8, 9, 10].contains(&value) {
            return Err(abort::VALUE_RANGE);
        }
        if is_mapping(index) {
            self.check_mapping(index, sub_index, value)?;
        }
        if matches!(index, 0x1c12 | 0x1c13) {
            self.check_assignment(index, sub_index, value)?;
        }
        self.dictionary.set(index, sub_index, value);
        Ok(())
    }
}

impl Slave {
    /// A mapping is changed with its count at 0; the count is set when its entries are in order.
    fn check_mapping(&self, index: u16, sub_index: u8, value: i64) -> Result<(), u32> {
        let direction = if index < 0x1a00 {
            Mappable::Rx
        } else {
            Mappable::Tx
        };
        if sub_index > 0 {
            if self.dictionary.number(index, 0) != 0 {
                return Err(abort::DEVICE_STATE);
            }
            return self.check_mapped(value as u32, direction);
        }
        let mut bits = 0;
        for entry in 1..=value as u8 {
            let mapping = self.dictionary.number(index, entry) as u32;
            self.check_mapped(mapping, direction)?;
            bits += usize::from(split_mapping(mapping).1);
        }
        if bits > 8 * PROCESS_DATA_MAX {
            return Err(abort::MAPPING_TOO_LONG);
        }
        Ok(())
    }

    fn check_mapped(&self, mapping: u32, direction: Mappable) -> Result<(), u32> {
        let ((index, sub_index), bits) = split_mapping(mapping);
        if index == 0 {
            // a gap
            return if bits % 8 == 0 && bits > 0 {
                Ok(())
            } else {
                Err(abort::NOT_MAPPABLE)
            };
        }
        let entry = self
            .dictionary
            .entry(index, sub_index)
            .ok_or(abort::NO_OBJECT)?;
        let fits = entry.mappable == direction && usize::from(bits) == 8 * entry.length();
        if fits {
            Ok(())
        } else {
            Err(abort::NOT_MAPPABLE)
        }
    }

    fn check_assignment(&self, index: u16, sub_index: u8, value: i64) -> Result<(), u32> {
        if sub_index == 0 {
            return Ok(());
        }
        let pdo = value as u16;
        let of_direction = (pdo < 0x1a00) == (index == 0x1c12);
        let known = is_mapping(pdo) && of_direction && self.dictionary.entry(pdo, 0).is_some();
        if known {
            Ok(())
        } else {
            Err(abort::VALUE_RANGE)
        }
    }
}

/// Whose object it is, of the object that is `first` for the first axis.
fn axis_of(index: u16, first: u16) -> Option<usize> {
    let beyond = index.checked_sub(first)?;
    (beyond % AXIS_OFFSET == 0).then_some(usize::from(beyond / AXIS_OFFSET))
}

fn is_mapping(index: u16) -> bool {
    matches!(index, 0x1600..=0x17ff | 0x1a00..=0x1bff)
}

/// Object and length in bits of a mapping entry.
fn split_mapping(mapping: u32) -> ((u16, u8), u8) {
    (
        ((mapping >> 16) as u16, (mapping >> 8) as u8),
        mapping as u8,
    )
}

/// Outputs, inputs of an axis as they come.
fn default_mapping(axis: &AxisConfig, position: usize) -> [Vec<u32>; 2] {
    let at = AXIS_OFFSET * position as u16;
    let object = |index: u16, sub_index: u8, bits: u8| {
        u32::from(index + at) << 16 | u32::from(sub_index) << 8 | u32::from(bits)
    };
    // a byte of padding keeps words at even addresses
    const GAP: u32 = 8;
    let outputs = vec![
        object(0x6040, 0, 16),
        object(0x6060, 0, 8),
        GAP,
        object(0x607a, 0, 32),
        object(0x60ff, 0, 32),
        object(0x6071, 0, 16),
        object(0x60b2, 0, 16),
    ];
    let mut inputs = vec![
        object(0x6041, 0, 16),
        object(0x6061, 0, 8),
        GAP,
        object(0x6064, 0, 32),
        object(0x606c, 0, 32),
        object(0x6077, 0, 16),
        object(0x603f, 0, 16),
    ];
    if axis.link_encoder_counts.is_some() {
        inputs.push(object(0x60e4, 1, 32));
    }
    [outputs, inputs]
}

fn dictionary(config: &SlaveConfig, axes: &[Axis]) -> Dictionary {
    use DataType::*;
    let mut dictionary = Dictionary::default();
    dictionary.variable(0x1000, Entry::new(U32, "Device type", 0x0002_0192));
    dictionary.variable(0x1001, Entry::new(U8, "Error register", 0));
    dictionary.variable(0x1008, Entry::text("Device name", &device_name(axes.len())));
    dictionary.variable(0x1009, Entry::text("Hardware version", "virtual"));
    dictionary.variable(
        0x100a,
        Entry::text("Software version", env!("CARGO_PKG_VERSION")),
    );
    let names = [
        "Vendor ID",
        "Product code",
        "Revision number",
        "Serial number",
    ];
    let identity = names
        .into_iter()
        .zip(config.identity)
        .map(|(name, value)| Entry::new(U32, name, i64::from(value)));
    dictionary.record(0x1018, "Identity", identity);
    dictionary.record(
        0x10f1,
        "Error settings",
        [
            Entry::new(U32, "Local error reaction", 1).writable(),
            Entry::new(
                U32,
                "Sync error counter limit",
                i64::from(config.sync_error_limit),
            )
            .writable(),
        ],
    );
    let kinds = [1, 2, 3, 4].map(|kind| Entry::new(U8, "Sync manager type", kind));
    dictionary.record(0x1c00, "Sync manager communication type", kinds);
    for (position, axis) in axes.iter().enumerate() {
        axis.add_objects(&mut dictionary);
        let mappings = default_mapping(axis.config(), position);
        for ((first, name), mapping) in [(0x1600, "RxPDO"), (0x1a00, "TxPDO")]
            .into_iter()
            .zip(mappings)
        {
            add_list(
                &mut dictionary,
                first + MAPPING_OFFSET * position as u16,
                &format!("{name} mapping of axis {position}"),
                (U32, MAPPING_MAX),
                mapping.into_iter().map(i64::from),
            );
        }
    }
    for (index, first) in [(0x1c12, 0x1600), (0x1c13, 0x1a00)] {
        let assigned = (0..axes.len()).map(|axis| first + i64::from(MAPPING_OFFSET) * axis as i64);
        let name = if index == 0x1c12 {
            "RxPDO assignment"
        } else {
            "TxPDO assignment"
        };
        add_list(
            &mut dictionary,
            index,
            name,
            (U16, AXES_MAX as u8),
            assigned,
        );
    }
    for index in [0x1c32, 0x1c33] {
        add_sync_parameters(&mut dictionary, index, config);
    }
    dictionary
}

/// A list whose length the master sets.
fn add_list(
    dictionary: &mut Dictionary,
    index: u16,
    name: &str,
    (data_type, most): (DataType, u8),
    values: impl Iterator<Item = i64>,
) {
    let mut values: Vec<i64> = values.collect();
    let count = values.len();
    values.resize(usize::from(most), 0);
    let entries = values
        .into_iter()
        .zip(1..)
        .map(|(value, sub_index)| (sub_index, Entry::new(data_type, "Entry", value).pre_op()));
    dictionary.sparse(index, name, entries);
    if let Some(entry) = dictionary.entry_mut(index, 0) {
        *entry = Entry::new(DataType::U8, "Number of entries", count as i64)
            .pre_op()
            .within(0, i64::from(most));
    }
}

/// ETG.1020, section 10: 0x1c32 for outputs, 0x1c33 for inputs.
fn add_sync_parameters(dictionary: &mut Dictionary, index: u16, config: &SlaveConfig) {
    use DataType::*;
    /// Free run, with outputs, with SYNC0.
    const SUPPORTED: i64 = 0b0_0111;
    let kind = Entry::new(
        U16,
        "Synchronisation type",
        if index == 0x1c32 { 1 } else { 0x22 },
    );
    let kind = if config.sync_type_writable {
        kind.pre_op()
    } else {
        kind
    };
    let number = |name: &str, value: i64| Entry::new(U32, name, value);
    let counter = |name: &str| Entry::new(U16, name, 0);
    let parts = [
        (1, kind),
        (2, number("Cycle time", 0).writable()),
        (3, number("Shift time", 0).writable()),
        (
            4,
            Entry::new(U16, "Supported synchronisation types", SUPPORTED),
        ),
        (5, number("Minimum cycle time", i64::from(CYCLE_MIN_NS))),
        (6, number("Calc and copy time", 0)),
        (9, number("Delay time", 0)),
        (0x0a, number("SYNC0 cycle time", 0)),
        (0x0b, counter("SM event missed counter")),
        (0x0c, counter("Cycle exceeded counter")),
        (0x20, Entry::new(U8, "Sync error", 0)),
    ];
    let name = if index == 0x1c32 {
        "Output sync manager parameter"
    } else {
        "Input sync manager parameter"
    };
    dictionary.sparse(index, name, parts);
}

fn device_name(axes: usize) -> String {
    match axes {
        1 => "Flexspline virtual drive, one axis".to_owned(),
        axes => format!("Flexspline virtual drive, {axes} axes"),
    }
}

fn eeprom(config: &SlaveConfig, dictionary: &Dictionary) -> Vec<u8> {
    let pdos = |assignment: u16| -> Vec<Pdo> {
        (1..=dictionary.number(assignment, 0) as u8)
            .map(|position| pdo(dictionary, dictionary.number(assignment, position) as u16))
            .collect()
    };
    let (outputs, inputs) = (pdos(0x1c12), pdos(0x1c13));
    let length = |pdos: &[Pdo]| {
        let entries = pdos.iter().flat_map(|pdo| &pdo.entries);
        entries.map(|entry| u16::from(entry.bits)).sum::<u16>() / 8
    };
    let axes = config.axes.len();
    sii::image(&sii::Information {
        alias: config.alias,
        identity: config.identity,
        order: &format!("FS-VD{axes}"),
        name: &device_name(axes),
        axes: axes as u8,
        mailboxes: MAILBOXES,
        process_data: [
            (PROCESS_DATA_START[0], length(&outputs)),
            (PROCESS_DATA_START[1], length(&inputs)),
        ],
        pdos: [&outputs, &inputs],
    })
}

fn pdo(dictionary: &Dictionary, index: u16) -> Pdo {
    let entries = (1..=dictionary.number(index, 0) as u8)
        .map(|position| {
            let ((object, sub_index), bits) =
                split_mapping(dictionary.number(index, position) as u32);
            let entry = dictionary.entry(object, sub_index);
            PdoEntry {
                index: object,
                sub_index,
                data_type: entry.map_or(0, |entry| entry.data_type as u8),
                bits,
                name: entry.map_or_else(String::new, |entry| entry.name.clone()),
            }
        })
        .collect();
    Pdo {
        index,
        name: dictionary.name(index).to_owned(),
        entries,
    }
}
