//! The slave controller (ESC): registers, memory, sync managers, FMMUs, EEPROM interface. What a master can read and write.
//!
//! Source: ETG.1000.4, section 6 (register numbers and bits are those of its tables). Left out: interrupts to the master,
//! ports 2 and 3, latch inputs, SYNC1.

use crate::clock::Clock;
use crate::wire::{u16_at, u32_at, u64_at};

/// First byte of the process memory; registers lie before it.
pub const MEMORY_START: u16 = 0x1000;
/// Registers and 8 KiB of process memory.
const MEMORY_END: usize = 0x3000;
/// Sync managers and FMMUs of this controller.
const UNITS: usize = 8;

/// Registers by number.
pub mod register {
    #![allow(missing_docs, reason = "the names are those of the specification")]
    pub const STATION_ADDRESS: u16 = 0x0010;
    pub const STATION_ALIAS: u16 = 0x0012;
    pub const ESC_RESET: u16 = 0x0040;
    pub const DL_CONTROL: u16 = 0x0100;
    pub const DL_STATUS: u16 = 0x0110;
    pub const AL_CONTROL: u16 = 0x0120;
    pub const AL_STATUS: u16 = 0x0130;
    pub const AL_STATUS_CODE: u16 = 0x0134;
    pub const ERROR_COUNTERS: u16 = 0x0300;
    pub const LOST_LINK_PORT_1: u16 = 0x0311;
    pub const WATCHDOG_DIVIDER: u16 = 0x0400;
    pub const WATCHDOG_PROCESS_DATA: u16 = 0x0420;
    pub const WATCHDOG_STATUS: u16 = 0x0440;
    pub const WATCHDOG_COUNTER: u16 = 0x0442;
    pub const EEPROM_CONFIGURATION: u16 = 0x0500;
    pub const EEPROM_CONTROL: u16 = 0x0502;
    pub const EEPROM_ADDRESS: u16 = 0x0504;
    pub const EEPROM_DATA: u16 = 0x0508;
    pub const FMMU: u16 = 0x0600;
    pub const SYNC_MANAGER: u16 = 0x0800;
    pub const DC_RECEIVE_TIME: u16 = 0x0900;
    pub const DC_SYSTEM_TIME: u16 = 0x0910;
    pub const DC_RECEIVE_TIME_UNIT: u16 = 0x0918;
    pub const DC_OFFSET: u16 = 0x0920;
    pub const DC_DELAY: u16 = 0x0928;
    pub const DC_DIFFERENCE: u16 = 0x092c;
    pub const DC_ACTIVATION: u16 = 0x0981;
    pub const DC_START_TIME: u16 = 0x0990;
    pub const DC_SYNC0_CYCLE: u16 = 0x09a0;
    pub const DC_END: u16 = 0x0a00;
}
use register::*;

/// Registers that a master may change, first and last. What else it writes is counted as served and has no effect.
const WRITABLE: [(u16, u16); 17] = [
    (0x0010, 0x0011),
    (0x0020, 0x0021),
    (0x0030, 0x0031),
    (0x0100, 0x0103),
    (0x0120, 0x0121),
    (0x0200, 0x0201),
    (0x0400, 0x0401),
    (0x0410, 0x0411),
    (0x0420, 0x0421),
    (0x0500, 0x0500),
    (0x0502, 0x050f),
    (0x0600, 0x067f),
    (0x0800, 0x083f),
    (0x0920, 0x092b),
    (0x0930, 0x0936),
    (0x0980, 0x0981),
    (0x0990, 0x09af),
];

/// Where a frame is on its way through a slave.
#[derive(Clone, Copy, Debug, Default)]
pub struct Passing {
    /// Time outside at which the frame reaches port 0.
    pub in_ns: u64,
    /// Time outside at which it comes back to port 1; `None` where nothing is plugged in there.
    pub back_ns: Option<u64>,
}

/// What a master did that the slave's firmware has to look at.
#[derive(Clone, Copy, Debug, Default)]
pub struct Events {
    /// AL control was written.
    pub al_control: bool,
    /// A request lies in the mailbox.
    pub mailbox_request: bool,
    /// The answer in the mailbox was fetched.
    pub answer_fetched: bool,
    /// The last answer is asked for again.
    pub repeat: bool,
    /// Outputs came.
    pub outputs: bool,
    /// The reset sequence was written.
    pub reset: bool,
}

/// How a sync manager treats its memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Buffering {
    /// Whoever writes is never held up; the reader has the newest.
    Three,
    /// One at a time: written, then read.
    Mailbox,
}

/// One sync manager's settings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncManager {
    /// First byte in the slave's memory.
    pub start: u16,
    /// Bytes.
    pub length: u16,
    /// Control register.
    pub control: u8,
    /// Whether it works.
    pub enabled: bool,
}

impl SyncManager {
    fn end(self) -> usize {
        usize::from(self.start) + usize::from(self.length)
    }

    fn buffering(self) -> Buffering {
        if self.control & 0x03 == 0x02 {
            Buffering::Mailbox
        } else {
            Buffering::Three
        }
    }

    /// Whether the master writes and the slave reads.
    pub fn master_writes(self) -> bool {
        self.control & 0x0c == 0x04
    }

    /// Whether what comes keeps the watchdog quiet.
    pub fn feeds_watchdog(self) -> bool {
        self.control & 0x40 != 0
    }
}

/// One FMMU's settings.
#[derive(Clone, Copy, Debug)]
struct Fmmu {
    logical_start: u64,
    length: u64,
    start_bit: u32,
    end_bit: u32,
    physical_start: u16,
    physical_bit: u32,
    readable: bool,
    writable: bool,
}

/// A slave controller.
#[derive(Clone, Debug)]
pub struct Esc {
    memory: Vec<u8>,
    /// Whether an access to a mailbox has begun at its first byte.
    opened: [bool; UNITS],
    full: [bool; UNITS],
    eeprom: Vec<u8>,
    /// The slave's clock.
    pub clock: Clock,
    /// What happened since they were taken.
    pub events: Events,
    reset_progress: u8,
    repeat_request: bool,
}

impl Esc {
    /// A controller as after power-up, with this EEPROM.
    pub fn new(eeprom: Vec<u8>, clock: Clock) -> Self {
        let mut esc = Self {
            memory: vec![0; MEMORY_END],
            opened: [false; UNITS],
            full: [false; UNITS],
            eeprom,
            clock,
            events: Events::default(),
            reset_progress: 0,
            repeat_request: false,
        };
        // Type ET1100, 8 FMMUs, 8 sync managers, 8 KiB, two MII ports; distributed clocks of 64 bits (ETG.1000.4, Table 31)
        esc.memory[..10].copy_from_slice(&[0x11, 0, 2, 0, 8, 8, 8, 0x0f, 0x0c, 0]);
        esc.set_u16(WATCHDOG_DIVIDER, 2498);
        esc.set_u16(0x0410, 1000);
        esc.set_u16(WATCHDOG_PROCESS_DATA, 1000);
        esc.set_u16(WATCHDOG_STATUS, 1);
        esc.set_u16(0x0982, 1000);
        esc.set_u16(0x0930, 0x1000);
        esc.load_alias();
        esc
    }

    /// The EEPROM as it is now; a master may have written to it.
    pub fn eeprom(&self) -> &[u8] {
        &self.eeprom
    }

    fn load_alias(&mut self) {
        let alias = u16_at(&self.eeprom, 8);
        self.set_u16(STATION_ALIAS, alias);
    }

    /// A register of two bytes.
    pub fn u16(&self, register: u16) -> u16 {
        u16_at(&self.memory, usize::from(register))
    }

    fn u32(&self, register: u16) -> u32 {
        u32_at(&self.memory, usize::from(register))
    }

    fn u64(&self, register: u16) -> u64 {
        u64_at(&self.memory, usize::from(register))
    }

    /// Sets a register of two bytes from within.
    pub fn set_u16(&mut self, register: u16, value: u16) {
        self.set(register, &value.to_le_bytes());
    }

    fn set(&mut self, register: u16, bytes: &[u8]) {
        let at = usize::from(register);
        self.memory[at..at + bytes.len()].copy_from_slice(bytes);
    }

    /// The settings of sync manager `index`.
    pub fn sync_manager(&self, index: usize) -> SyncManager {
        let at = usize::from(SYNC_MANAGER) + 8 * index;
        SyncManager {
            start: u16_at(&self.memory, at),
            length: u16_at(&self.memory, at + 2),
            control: self.memory[at + 4],
            enabled: self.memory[at + 6] & 1 != 0 && self.memory[at + 7] & 1 == 0,
        }
    }

    fn fmmu(&self, index: usize) -> Option<Fmmu> {
        let at = usize::from(FMMU) + 16 * index;
        let bytes = &self.memory[at..at + 16];
        (bytes[12] & 1 != 0).then(|| Fmmu {
            logical_start: u64::from(u32_at(bytes, 0)),
            length: u64::from(u16_at(bytes, 4)),
            start_bit: u32::from(bytes[6] & 7),
            end_bit: u32::from(bytes[7] & 7),
            physical_start: u16_at(bytes, 8),
            physical_bit: u32::from(bytes[10] & 7),
            readable: bytes[11] & 1 != 0,
            writable: bytes[11] & 2 != 0,
        })
    }

    /// A master reads `data.len()` bytes at `address`; whether it got them.
    pub fn read(&mut self, passing: Passing, address: u16, data: &mut [u8]) -> bool {
        let (first, end) = (usize::from(address), usize::from(address) + data.len());
        if end > MEMORY_END || !self.may_access(first, end, false) {
            return false;
        }
        self.refresh(passing, first, end);
        data.copy_from_slice(&self.memory[first..end]);
        self.after_access(first, end, false);
        true
    }

    /// A master writes `data` at `address`; whether it was taken.
    pub fn write(&mut self, passing: Passing, address: u16, data: &[u8]) -> bool {
        let (first, end) = (usize::from(address), usize::from(address) + data.len());
        if end > MEMORY_END || !self.may_access(first, end, true) {
            return false;
        }
        if address >= MEMORY_START {
            self.memory[first..end].copy_from_slice(data);
            self.after_access(first, end, true);
        } else {
            self.write_registers(passing, first, data);
        }
        true
    }

    fn active(&self) -> impl Iterator<Item = (usize, SyncManager)> + '_ {
        (0..UNITS)
            .map(|index| (index, self.sync_manager(index)))
            .filter(|(_, manager)| manager.enabled && manager.length > 0)
    }

    fn may_access(&mut self, first: usize, end: usize, writes: bool) -> bool {
        if first < usize::from(MEMORY_START) {
            return end <= usize::from(MEMORY_START);
        }
        let touched = self
            .active()
            .find(|(_, manager)| first < manager.end() && end > usize::from(manager.start));
        let Some((index, manager)) = touched else {
            return true;
        };
        if manager.master_writes() != writes || end > manager.end() {
            return false;
        }
        let at_start = first == usize::from(manager.start);
        match manager.buffering() {
            Buffering::Three => true,
            Buffering::Mailbox if self.full[index] == writes => false,
            Buffering::Mailbox => {
                self.opened[index] |= at_start;
                self.opened[index]
            }
        }
    }

    fn after_access(&mut self, first: usize, end: usize, writes: bool) {
        let touched = self
            .active()
            .find(|(_, manager)| first < manager.end() && end == manager.end());
        let Some((index, manager)) = touched else {
            return;
        };
        self.opened[index] = false;
        if manager.buffering() == Buffering::Mailbox {
            self.set_full(index, writes);
            self.events.mailbox_request |= writes;
            self.events.answer_fetched |= !writes;
        } else {
            self.events.outputs |= writes;
        }
    }

    fn set_full(&mut self, index: usize, full: bool) {
        self.full[index] = full;
        let status = usize::from(SYNC_MANAGER) + 8 * index + 5;
        self.memory[status] = self.memory[status] & !0x08 | u8::from(full) << 3;
    }

    /// What the firmware finds in a mailbox that the master has filled; it is empty afterwards.
    pub fn take_mailbox(&mut self, index: usize) -> Option<Vec<u8>> {
        let manager = self.sync_manager(index);
        if !manager.enabled || !self.full[index] {
            return None;
        }
        self.set_full(index, false);
        self.memory
            .get(usize::from(manager.start)..manager.end())
            .map(<[u8]>::to_vec)
    }

    /// Puts an answer where the master fetches it; whether there was room.
    pub fn fill_mailbox(&mut self, index: usize, answer: &[u8]) -> bool {
        let manager = self.sync_manager(index);
        if !manager.enabled || self.full[index] || answer.len() > usize::from(manager.length) {
            return false;
        }
        let Some(memory) = self
            .memory
            .get_mut(usize::from(manager.start)..manager.end())
        else {
            return false;
        };
        memory.fill(0);
        memory[..answer.len()].copy_from_slice(answer);
        self.set_full(index, true);
        true
    }

    /// Lays the last answer out once more, as a master asks that did not get it, and says so (ETG.1000.4, section 6.7.3).
    pub fn repeat_mailbox(&mut self, index: usize) {
        let manager = self.sync_manager(index);
        let is_message = u16_at(&self.memory, usize::from(manager.start)) > 0;
        if manager.enabled && is_message && !self.full[index] {
            self.set_full(index, true);
        }
        let at = usize::from(SYNC_MANAGER) + 8 * index;
        self.memory[at + 7] = self.memory[at + 7] & !0x02 | self.memory[at + 6] & 0x02;
    }

    /// The memory of a sync manager, as the firmware sees it.
    pub fn buffer(&self, index: usize) -> &[u8] {
        let manager = self.sync_manager(index);
        self.memory
            .get(usize::from(manager.start)..manager.end())
            .unwrap_or(&[])
    }

    /// The same to write to.
    pub fn buffer_mut(&mut self, index: usize) -> &mut [u8] {
        let manager = self.sync_manager(index);
        self.memory
            .get_mut(usize::from(manager.start)..manager.end())
            .unwrap_or(&mut [])
    }

    /// Brings registers that change by themselves up to date before they are read.
    fn refresh(&mut self, passing: Passing, first: usize, end: usize) {
        if end <= usize::from(DC_SYSTEM_TIME) || first >= usize::from(DC_END) {
            return;
        }
        let system_ns = self.clock.system_ns(passing.in_ns);
        let difference = self.clock.difference_register();
        self.set(DC_SYSTEM_TIME, &system_ns.to_le_bytes());
        self.set(DC_DIFFERENCE, &difference.to_le_bytes());
        if let Some(next_ns) = self.clock.next_sync0_system_ns() {
            self.set(DC_START_TIME, &next_ns.to_le_bytes());
        }
    }

    fn write_registers(&mut self, passing: Passing, first: usize, data: &[u8]) {
        let end = first + data.len();
        let was_enabled: [bool; UNITS] =
            core::array::from_fn(|index| self.sync_manager(index).enabled);
        let was_active = self.memory[usize::from(DC_ACTIVATION)];
        for (at, byte) in (first..end).zip(data) {
            // Status and slave's side of a sync manager are not the master's.
            let of_slave = (0x0800..0x0840).contains(&at) && matches!(at % 8, 5 | 7);
            let register = at as u16;
            let writable = WRITABLE
                .iter()
                .any(|(from, to)| (*from..=*to).contains(&register));
            if writable && !of_slave {
                self.memory[at] = *byte;
            }
        }
        let touches = |from: u16, to: u16| first < usize::from(to) && end > usize::from(from);
        self.events.al_control |= touches(AL_CONTROL, AL_CONTROL + 2);
        if touches(ESC_RESET, ESC_RESET + 1) {
            self.reset_sequence(data[usize::from(ESC_RESET) - first]);
        }
        if touches(ERROR_COUNTERS, ERROR_COUNTERS + 0x14) {
            self.set(ERROR_COUNTERS, &[0; 0x14]);
        }
        if touches(WATCHDOG_COUNTER, WATCHDOG_COUNTER + 2) {
            self.set_u16(WATCHDOG_COUNTER, 0);
        }
        if touches(EEPROM_CONTROL, EEPROM_CONTROL + 2) {
            self.eeprom_command();
        }
        if touches(SYNC_MANAGER, SYNC_MANAGER + 0x40) {
            self.sync_managers_written(&was_enabled);
        }
        if touches(DC_RECEIVE_TIME, DC_RECEIVE_TIME + 4) {
            self.latch_receive_times(passing);
        }
        if first <= usize::from(DC_SYSTEM_TIME) && end >= usize::from(DC_SYSTEM_TIME) + 4 {
            self.steer(passing, &data[usize::from(DC_SYSTEM_TIME) - first..]);
        }
        let offset_ns = self.u64(DC_OFFSET);
        self.clock.set_offset(passing.in_ns, offset_ns);
        self.clock.delay_ns = self.u32(DC_DELAY);
        let active = self.memory[usize::from(DC_ACTIVATION)];
        if touches(DC_ACTIVATION, DC_ACTIVATION + 1) && active & 0x03 != was_active & 0x03 {
            self.switch_sync0(passing);
        }
    }

    fn reset_sequence(&mut self, byte: u8) {
        // ETG.1000.4, Table 33: 'R', 'E', 'S' in three frames
        self.reset_progress = match (self.reset_progress, byte) {
            (_, b'R') => 1,
            (1, b'E') => 2,
            (2, b'S') => {
                self.events.reset = true;
                0
            }
            _ => 0,
        };
    }

    fn sync_managers_written(&mut self, was_enabled: &[bool; UNITS]) {
        for (index, was_enabled) in was_enabled.iter().enumerate() {
            if self.sync_manager(index).enabled != *was_enabled {
                self.opened[index] = false;
                self.set_full(index, false);
            }
        }
        let repeat = self.memory[usize::from(SYNC_MANAGER) + 8 + 6] & 0x02 != 0;
        self.events.repeat |= repeat != self.repeat_request;
        self.repeat_request = repeat;
    }

    fn latch_receive_times(&mut self, passing: Passing) {
        let local_ns = self.clock.local_ns(passing.in_ns);
        let back_ns = passing
            .back_ns
            .map_or(0, |back_ns| self.clock.local_ns(back_ns));
        self.set(DC_RECEIVE_TIME, &(local_ns as u32).to_le_bytes());
        self.set(DC_RECEIVE_TIME + 4, &(back_ns as u32).to_le_bytes());
        self.set(DC_RECEIVE_TIME_UNIT, &local_ns.to_le_bytes());
    }

    fn steer(&mut self, passing: Passing, bytes: &[u8]) {
        let system_ns = self.clock.system_ns(passing.in_ns);
        let received_ns = if bytes.len() >= 8 {
            u64_at(bytes, 0)
        } else {
            // the nearest time with these lower 32 bits
            let ahead = u32_at(bytes, 0).wrapping_sub(system_ns as u32) as i32;
            system_ns.wrapping_add_signed(i64::from(ahead))
        };
        // Masters blank the register at start; that is no time.
        if received_ns != 0 {
            self.clock.steer(passing.in_ns, received_ns);
        }
    }

    fn switch_sync0(&mut self, passing: Passing) {
        let active = self.memory[usize::from(DC_ACTIVATION)];
        if active & 0x03 == 0x03 {
            let (start_ns, cycle_ns) = (self.u64(DC_START_TIME), self.u32(DC_SYNC0_CYCLE));
            self.clock.start_sync0(passing.in_ns, start_ns, cycle_ns);
        } else {
            self.clock.stop_sync0();
        }
    }

    /// Whether the master has switched SYNC0 on, and with which cycle.
    pub fn sync0_setting(&self) -> Option<u32> {
        let active = self.memory[usize::from(DC_ACTIVATION)];
        (active & 0x03 == 0x03).then(|| self.u32(DC_SYNC0_CYCLE))
    }

    /// Carries out an EEPROM command (ETG.1000.4, section 6.4).
    fn eeprom_command(&mut self) {
        const BYTES_8: u16 = 0x0040;
        const ADDRESS_16: u16 = 0x0080;
        const ERROR: u16 = 0x2000;
        let control = self.u16(EEPROM_CONTROL);
        let at = 2 * self.u32(EEPROM_ADDRESS) as usize;
        let masters = self.memory[usize::from(EEPROM_CONFIGURATION)] & 1 == 0;
        let failed = match control & 0x0700 {
            0 => false,
            _ if !masters => true,
            0x0100 => {
                let mut bytes = [0xff; 8];
                for (byte, stored) in bytes.iter_mut().zip(self.eeprom.iter().skip(at)) {
                    *byte = *stored;
                }
                self.set(EEPROM_DATA, &bytes);
                false
            }
            0x0200 if control & 1 != 0 && at + 2 <= self.eeprom.len() => {
                let word = self.u16(EEPROM_DATA);
                self.eeprom[at..at + 2].copy_from_slice(&word.to_le_bytes());
                false
            }
            0x0400 => {
                self.load_alias();
                false
            }
            _ => true,
        };
        let status = BYTES_8 | ADDRESS_16 | if failed { ERROR } else { 0 };
        self.set_u16(EEPROM_CONTROL, status);
    }

    /// A master reads through the FMMUs at a logical address; whether there was anything.
    pub fn read_logical(&mut self, passing: Passing, logical: u32, data: &mut [u8]) -> bool {
        self.mapped(passing, logical, data, |esc, fmmu, passing, span, data| {
            if !fmmu.readable {
                return false;
            }
            if let Some(range) = span.whole_bytes(&fmmu) {
                let address = span.physical(&fmmu);
                return esc.read(passing, address, &mut data[range]);
            }
            esc.read_bits(passing, &fmmu, span, data)
        })
    }

    /// A master writes through the FMMUs at a logical address; whether anything was taken.
    pub fn write_logical(&mut self, passing: Passing, logical: u32, data: &mut [u8]) -> bool {
        self.mapped(passing, logical, data, |esc, fmmu, passing, span, data| {
            if !fmmu.writable {
                return false;
            }
            if let Some(range) = span.whole_bytes(&fmmu) {
                let address = span.physical(&fmmu);
                return esc.write(passing, address, &data[range]);
            }
            esc.write_bits(passing, &fmmu, span, data)
        })
    }

    fn mapped(
        &mut self,
        passing: Passing,
        logical: u32,
        data: &mut [u8],
        access: impl Fn(&mut Self, Fmmu, Passing, Span, &mut [u8]) -> bool,
    ) -> bool {
        let mut served = false;
        for index in 0..UNITS {
            let Some(fmmu) = self.fmmu(index) else {
                continue;
            };
            if let Some(span) = Span::overlap(&fmmu, u64::from(logical), data.len()) {
                served |= access(self, fmmu, passing, span, data);
            }
        }
        served
    }

    fn read_bits(&mut self, passing: Passing, fmmu: &Fmmu, span: Span, data: &mut [u8]) -> bool {
        let mut served = false;
        for bit in span.bits(fmmu) {
            let (address, at_bit) = bit.physical;
            let mut byte = [0];
            if self.read(passing, address, &mut byte) {
                served = true;
                let value = byte[0] >> at_bit & 1;
                let target = &mut data[bit.at];
                *target = *target & !(1 << bit.bit) | value << bit.bit;
            }
        }
        served
    }

    fn write_bits(&mut self, passing: Passing, fmmu: &Fmmu, span: Span, data: &[u8]) -> bool {
        let mut served = false;
        for bit in span.bits(fmmu) {
            let (address, at_bit) = bit.physical;
            let Some(old) = self.memory.get(usize::from(address)) else {
                continue;
            };
            let value = data[bit.at] >> bit.bit & 1;
            let byte = old & !(1 << at_bit) | value << at_bit;
            served |= self.write(passing, address, &[byte]);
        }
        served
    }
}

/// The part of a datagram that an FMMU maps.
#[derive(Clone, Copy, Debug)]
struct Span {
    /// First byte in the datagram.
    first: usize,
    /// Bytes.
    length: usize,
    /// First byte from the FMMU's start.
    within: u64,
}

struct MappedBit {
    at: usize,
    bit: u32,
    physical: (u16, u32),
}

impl Span {
    fn overlap(fmmu: &Fmmu, logical: u64, length: usize) -> Option<Self> {
        let first = fmmu.logical_start.max(logical);
        let end = (fmmu.logical_start + fmmu.length).min(logical + length as u64);
        (first < end).then(|| Self {
            first: (first - logical) as usize,
            length: (end - first) as usize,
            within: first - fmmu.logical_start,
        })
    }

    /// Its bytes in the datagram, where no bit is split off.
    fn whole_bytes(self, fmmu: &Fmmu) -> Option<core::ops::Range<usize>> {
        let whole = fmmu.start_bit == 0 && fmmu.end_bit == 7 && fmmu.physical_bit == 0;
        whole.then_some(self.first..self.first + self.length)
    }

    fn physical(self, fmmu: &Fmmu) -> u16 {
        fmmu.physical_start.saturating_add(self.within as u16)
    }

    fn bits(self, fmmu: &Fmmu) -> impl Iterator<Item = MappedBit> + use<> {
        let fmmu = *fmmu;
        let last = (fmmu.length.max(1) - 1) * 8 + u64::from(fmmu.end_bit);
        let of_bytes = self.within * 8..(self.within + self.length as u64) * 8;
        of_bytes
            .filter(move |bit| (u64::from(fmmu.start_bit)..=last).contains(bit))
            .map(move |bit| {
                let physical = bit - u64::from(fmmu.start_bit) + u64::from(fmmu.physical_bit);
                MappedBit {
                    at: self.first + (bit / 8 - self.within) as usize,
                    bit: (bit % 8) as u32,
                    physical: (
                        fmmu.physical_start.saturating_add((physical / 8) as u16),
                        (physical % 8) as u32,
                    ),
                }
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn esc() -> Esc {
        Esc::new(vec![0; 256], Clock::new(0, 0.0))
    }

    fn set_manager(esc: &mut Esc, index: u16, start: u16, length: u16, control: u8) {
        let mut bytes = Vec::new();
        bytes.extend(start.to_le_bytes());
        bytes.extend(length.to_le_bytes());
        bytes.extend([control, 0, 1, 0]);
        assert!(esc.write(Passing::default(), SYNC_MANAGER + 8 * index, &bytes));
    }

    #[test]
    fn a_mailbox_is_written_once_and_read_once() {
        let mut esc = esc();
        let passing = Passing::default();
        set_manager(&mut esc, 0, 0x1000, 16, 0x26);
        set_manager(&mut esc, 1, 0x1080, 16, 0x22);
        assert!(esc.write(passing, 0x1000, &[1; 16]));
        assert!(!esc.write(passing, 0x1000, &[2; 16]), "it is full");
        assert_eq!(esc.take_mailbox(0), Some(vec![1; 16]));
        assert!(esc.write(passing, 0x1000, &[2; 16]));
        let mut read = [0; 16];
        assert!(!esc.read(passing, 0x1080, &mut read), "it is empty");
        assert!(esc.fill_mailbox(1, &[7; 3]));
        assert!(esc.read(passing, 0x1080, &mut read));
        assert_eq!(read[..4], [7, 7, 7, 0]);
        assert!(!esc.read(passing, 0x1080, &mut read), "it was read");
    }

    #[test]
    fn a_sync_manager_keeps_its_direction() {
        let mut esc = esc();
        set_manager(&mut esc, 3, 0x1400, 4, 0x20);
        assert!(!esc.write(Passing::default(), 0x1400, &[1; 4]));
        assert!(esc.read(Passing::default(), 0x1400, &mut [0; 4]));
    }

    #[test]
    fn an_fmmu_maps_bytes_and_single_bits() {
        let mut esc = esc();
        let passing = Passing::default();
        let mut bytes = [0; 16];
        bytes[..4].copy_from_slice(&0x1_0000_u32.to_le_bytes());
        bytes[4] = 2;
        bytes[7] = 7;
        bytes[8..10].copy_from_slice(&0x1100_u16.to_le_bytes());
        bytes[11] = 3;
        bytes[12] = 1;
        assert!(esc.write(passing, FMMU, &bytes));
        assert!(esc.write_logical(passing, 0xffff, &mut [9, 1, 2, 9]));
        let mut read = [0xee; 3];
        assert!(esc.read_logical(passing, 0x1_0001, &mut read));
        assert_eq!(read, [2, 0xee, 0xee]);
        assert!(!esc.read_logical(passing, 0x1_0002, &mut read));
        // bits 3 to 5 of one byte lie at bit 1 of the memory
        bytes[4] = 1;
        bytes[6] = 3;
        bytes[7] = 5;
        bytes[10] = 1;
        assert!(esc.write(passing, FMMU, &bytes));
        assert!(esc.write(passing, 0x1100, &[0]));
        assert!(esc.write_logical(passing, 0x1_0000, &mut [0b0010_1000]));
        let mut byte = [0];
        assert!(esc.read(passing, 0x1100, &mut byte));
        assert_eq!(byte, [0b0000_1010]);
    }

    #[test]
    fn the_eeprom_is_read_written_and_refused() {
        let mut esc = esc();
        let passing = Passing::default();
        let mut write = vec![0x01, 0x02, 4, 0, 0, 0, 0xcd, 0xab];
        assert!(esc.write(passing, EEPROM_CONTROL, &write));
        assert_eq!(u16_at(esc.eeprom(), 8), 0xabcd);
        write[..2].copy_from_slice(&[0, 4]);
        assert!(esc.write(passing, EEPROM_CONTROL, &write[..2]));
        assert_eq!(esc.u16(STATION_ALIAS), 0xabcd);
        assert!(esc.write(passing, EEPROM_CONFIGURATION, &[1]));
        assert!(esc.write(passing, EEPROM_CONTROL, &[0, 1, 0, 0, 0, 0]));
        assert_ne!(esc.u16(EEPROM_CONTROL) & 0x2000, 0, "the slave owns it");
    }

    #[test]
    fn read_only_registers_stay_as_they_are() {
        let mut esc = esc();
        assert!(esc.write(Passing::default(), 0, &[0xff; 16]));
        let mut read = [0; 6];
        assert!(esc.read(Passing::default(), 0, &mut read));
        assert_eq!(read, [0x11, 0, 2, 0, 8, 8]);
    }
}
