//! A small master for tests: it knows where the virtual drives keep things and checks every working counter.

#![allow(dead_code, reason = "each test program uses its part")]

use ethercat_emulator::wire::{for_each_datagram, frame, u16_at, u32_at};
use ethercat_emulator::{Fault, Options, Returned, Segment, segment};
use plant_emulator::PlantParameters;

pub const INIT: u8 = 1;
pub const PRE_OP: u8 = 2;
pub const SAFE_OP: u8 = 4;
pub const OP: u8 = 8;
/// Station address of the first slave.
pub const STATION: u16 = 0x1001;
const LOGICAL: u32 = 0x0001_0000;
pub const CYCLE_NS: u64 = 666_667;

/// The outputs of one axis in the default mapping.
#[derive(Clone, Copy, Debug, Default)]
pub struct Outputs {
    pub controlword: u16,
    pub mode: i8,
    pub position: i32,
    pub velocity: i32,
    pub torque: i16,
    pub torque_offset: i16,
}

/// The inputs of one axis in the default mapping.
#[derive(Clone, Copy, Debug, Default)]
pub struct Inputs {
    pub statusword: u16,
    pub mode: i8,
    pub position: i32,
    pub velocity: i32,
    pub torque: i16,
    pub error_code: u16,
}

impl Inputs {
    pub fn state(self) -> u16 {
        self.statusword & 0x6f
    }
}

pub struct Master {
    pub drives: Segment,
    pub now_ns: u64,
    /// Bytes of outputs and inputs of each slave.
    pub lengths: Vec<[u16; 2]>,
    /// Bytes of inputs of an axis.
    pub input_stride: usize,
    pub outputs: Vec<Outputs>,
    pub inputs: Vec<Inputs>,
    pub counter_short: u32,
    counter: u8,
}

impl Master {
    pub fn new(robot: &str, change: impl FnOnce(&mut Options)) -> Self {
        let robot = robot::load(robot).expect("a shipped robot");
        let mut options = Options::for_joints(robot.joints.len());
        change(&mut options);
        let parameters = PlantParameters::for_robot(&robot).expect("its plant");
        let drives = segment(&robot, &parameters, &[], &options, 0).expect("drives");
        let two_encoders = robot.joints[0].link_encoder_resolution_rad.is_some();
        let axes = robot.joints.len();
        let input_stride = if two_encoders { 20 } else { 16 };
        let lengths = drives
            .slaves()
            .iter()
            .map(|slave| {
                let axes = slave.axes().len() as u16;
                [16 * axes, input_stride as u16 * axes]
            })
            .collect();
        Self {
            drives,
            now_ns: 1_000_000,
            lengths,
            input_stride,
            outputs: vec![Outputs::default(); axes],
            inputs: vec![Inputs::default(); axes],
            counter_short: 0,
            counter: 0,
        }
    }

    pub fn inject(&mut self, fault: Fault) {
        let now_ns = self.now_ns;
        self.drives.inject(fault, now_ns);
    }

    /// One datagram: what came back and how often it was served. A lost frame is served by nobody.
    pub fn datagram(&mut self, command: u8, address: [u8; 4], data: &[u8]) -> (Vec<u8>, u16) {
        self.now_ns += 20_000;
        let mut bytes = frame(&[(command, 0, address, data)]);
        let returned = self
            .drives
            .receive(&mut bytes, self.now_ns)
            .expect("EtherCAT");
        if returned.copies == 0 {
            return (data.to_vec(), 0);
        }
        let mut answer = (Vec::new(), 0);
        for_each_datagram(&mut bytes, |datagram| {
            answer = (datagram.data.to_vec(), datagram.working_counter());
        });
        answer
    }

    fn at(station: u16, offset: u16) -> [u8; 4] {
        let [a, b] = station.to_le_bytes();
        let [c, d] = offset.to_le_bytes();
        [a, b, c, d]
    }

    /// FPRD.
    pub fn read(&mut self, slave: usize, offset: u16, length: usize) -> Vec<u8> {
        let address = Self::at(STATION + slave as u16, offset);
        let (data, counter) = self.datagram(4, address, &vec![0; length]);
        assert_eq!(counter, 1, "read of {offset:#06x}");
        data
    }

    /// FPWR.
    pub fn write(&mut self, slave: usize, offset: u16, data: &[u8]) {
        let address = Self::at(STATION + slave as u16, offset);
        let (_, counter) = self.datagram(5, address, data);
        assert_eq!(counter, 1, "write of {offset:#06x}");
    }

    pub fn address_slaves(&mut self) {
        for slave in 0..self.lengths.len() {
            let position = (slave as u16).wrapping_neg();
            let station = (STATION + slave as u16).to_le_bytes();
            let (_, counter) = self.datagram(2, Self::at(position, 0x10), &station);
            assert_eq!(counter, 1);
        }
    }

    /// Asks a slave for a state; AL status and code afterwards.
    pub fn ask(&mut self, slave: usize, state: u8) -> (u8, u16) {
        self.write(slave, 0x120, &[state | 0x10, 0]);
        let status = self.read(slave, 0x130, 6);
        (status[0], u16_at(&status, 4))
    }

    fn manager(&mut self, slave: usize, index: u16, start: u16, length: u16, control: u8) {
        let mut bytes = [0; 8];
        bytes[..2].copy_from_slice(&start.to_le_bytes());
        bytes[2..4].copy_from_slice(&length.to_le_bytes());
        bytes[4] = control;
        bytes[6] = 1;
        self.write(slave, 0x800 + 8 * index, &bytes);
    }

    pub fn enter_pre_op(&mut self) {
        self.address_slaves();
        for slave in 0..self.lengths.len() {
            self.manager(slave, 0, 0x1000, 128, 0x26);
            self.manager(slave, 1, 0x1080, 128, 0x22);
            assert_eq!(self.ask(slave, PRE_OP), (PRE_OP, 0));
        }
    }

    fn fmmu(&mut self, slave: usize, index: u16, logical: u32, length: u16, start: u16, kind: u8) {
        let mut bytes = [0; 16];
        bytes[..4].copy_from_slice(&logical.to_le_bytes());
        bytes[4..6].copy_from_slice(&length.to_le_bytes());
        bytes[7] = 7;
        bytes[8..10].copy_from_slice(&start.to_le_bytes());
        bytes[11] = kind;
        bytes[12] = 1;
        self.write(slave, 0x600 + 16 * index, &bytes);
    }

    /// Sync managers and FMMUs of the process data.
    pub fn map(&mut self) {
        let mut logical = LOGICAL;
        for slave in 0..self.lengths.len() {
            let [outputs, inputs] = self.lengths[slave];
            self.manager(slave, 2, 0x1100, outputs, 0x64);
            self.manager(slave, 3, 0x1400, inputs, 0x20);
            self.fmmu(slave, 0, logical, outputs, 0x1100, 2);
            logical += u32::from(outputs);
            self.fmmu(slave, 1, logical, inputs, 0x1400, 1);
            logical += u32::from(inputs);
        }
    }

    pub fn enter_op(&mut self) {
        self.enter_pre_op();
        self.map();
        for state in [SAFE_OP, OP] {
            for slave in 0..self.lengths.len() {
                assert_eq!(self.ask(slave, state), (state, 0));
            }
        }
    }

    pub fn start_sync0(&mut self, slave: usize, cycle_ns: u32, ahead_ns: i64) {
        let system = self.read(slave, 0x910, 8);
        let system_ns = u64::from_le_bytes(system.try_into().expect("8 bytes"));
        self.write(slave, 0x981, &[0]);
        let start_ns = system_ns.wrapping_add_signed(ahead_ns);
        self.write(slave, 0x990, &start_ns.to_le_bytes());
        self.write(slave, 0x9a0, &cycle_ns.to_le_bytes());
        self.write(slave, 0x981, &[3]);
    }

    /// One cycle with all slaves; whether every working counter was full.
    pub fn cycle(&mut self) -> bool {
        self.now_ns += CYCLE_NS - 20_000;
        let mut data = Vec::new();
        let mut axis = 0;
        for [outputs, inputs] in &self.lengths {
            for _ in 0..outputs / 16 {
                let output = self.outputs[axis];
                data.extend(output.controlword.to_le_bytes());
                data.extend([output.mode as u8, 0]);
                data.extend(output.position.to_le_bytes());
                data.extend(output.velocity.to_le_bytes());
                data.extend(output.torque.to_le_bytes());
                data.extend(output.torque_offset.to_le_bytes());
                axis += 1;
            }
            data.extend(vec![0; usize::from(*inputs)]);
        }
        let (data, counter) = self.datagram(12, LOGICAL.to_le_bytes(), &data);
        let full = counter == 3 * self.lengths.len() as u16;
        self.counter_short += u32::from(!full);
        if full {
            self.take(&data);
        }
        full
    }

    fn take(&mut self, data: &[u8]) {
        let (mut at, mut axis) = (0, 0);
        for [outputs, inputs] in &self.lengths {
            at += usize::from(*outputs);
            for offset in (0..usize::from(*inputs)).step_by(self.input_stride) {
                let bytes = &data[at + offset..];
                self.inputs[axis] = Inputs {
                    statusword: u16_at(bytes, 0),
                    mode: bytes[2] as i8,
                    position: u32_at(bytes, 4) as i32,
                    velocity: u32_at(bytes, 8) as i32,
                    torque: u16_at(bytes, 12) as i16,
                    error_code: u16_at(bytes, 14),
                };
                axis += 1;
            }
            at += usize::from(*inputs);
        }
    }

    pub fn cycles(&mut self, count: usize) {
        for _ in 0..count {
            self.cycle();
        }
    }

    /// Walks all axes to operation enabled in a mode, with targets that hold; the cycles it took.
    pub fn enable(&mut self, mode: i8) -> usize {
        for count in 0..1000 {
            self.cycle();
            for (output, input) in self.outputs.iter_mut().zip(&self.inputs) {
                output.mode = mode;
                output.controlword = match input.state() {
                    0x40 => 6,
                    0x21 => 7,
                    0x23 | 0x27 => 15,
                    _ => 0,
                };
                if input.state() != 0x27 {
                    output.position = input.position;
                }
            }
            // bit 12: follows its target, the brake is open
            if self
                .inputs
                .iter()
                .all(|input| input.statusword & 0x106f == 0x1027)
            {
                return count;
            }
        }
        panic!("not enabled: {:x?}", self.inputs);
    }

    /// Until an axis is in fault; its error code.
    pub fn wait_fault(&mut self, axis: usize) -> u16 {
        for _ in 0..2000 {
            self.cycle();
            if self.inputs[axis].state() == 0x08 {
                return self.inputs[axis].error_code;
            }
        }
        panic!("no fault: {:x?}", self.inputs);
    }

    /// A message into the mailbox and the answer out of it, both without their mailbox headers.
    pub fn mailbox(&mut self, slave: usize, body: &[u8]) -> Vec<u8> {
        self.counter = self.counter % 7 + 1;
        let mut message = vec![0; 128];
        message[..2].copy_from_slice(&(body.len() as u16).to_le_bytes());
        message[5] = 3 | self.counter << 4;
        message[6..6 + body.len()].copy_from_slice(body);
        self.write(slave, 0x1000, &message);
        self.fetch(slave)
    }

    pub fn fetch(&mut self, slave: usize) -> Vec<u8> {
        let answer = self.read(slave, 0x1080, 128);
        let length = usize::from(u16_at(&answer, 0));
        answer[6..6 + length].to_vec()
    }

    fn sdo(command: u8, index: u16, sub_index: u8, data: &[u8]) -> Vec<u8> {
        let mut body = vec![0, 0x20, command];
        body.extend(index.to_le_bytes());
        body.push(sub_index);
        body.extend(data);
        body
    }

    /// SDO upload, in segments where it has to be.
    pub fn upload(
        &mut self,
        slave: usize,
        index: u16,
        sub_index: u8,
        complete: bool,
    ) -> Result<Vec<u8>, u32> {
        let command = 0x40 | if complete { 0x10 } else { 0 };
        let answer = self.mailbox(slave, &Self::sdo(command, index, sub_index, &[0; 4]));
        if answer[2] == 0x80 {
            return Err(u32_at(&answer, 6));
        }
        if answer[2] & 2 != 0 {
            let unused = usize::from(answer[2] >> 2 & 3);
            return Ok(answer[6..10 - unused].to_vec());
        }
        let length = u32_at(&answer, 6) as usize;
        let mut bytes = answer[10..].to_vec();
        let mut toggle = 0;
        while bytes.len() < length {
            let segment = self.mailbox(slave, &Self::sdo(0x60 | toggle, 0, 0, &[0; 4]));
            assert_eq!(segment[2] & 0x10, toggle);
            let unused = usize::from(segment[2] >> 1 & 7);
            bytes.extend(&segment[3..segment.len() - unused]);
            toggle ^= 0x10;
        }
        assert_eq!(bytes.len(), length);
        Ok(bytes)
    }

    /// SDO download: expedited, normal, or in segments of what fits.
    pub fn download(
        &mut self,
        slave: usize,
        index: u16,
        sub_index: u8,
        bytes: &[u8],
        complete: bool,
    ) -> Result<(), u32> {
        let flag = if complete { 0x10 } else { 0 };
        let abort = |answer: &[u8]| {
            if answer[2] == 0x80 {
                Err(u32_at(answer, 6))
            } else {
                Ok(())
            }
        };
        if (1..=4).contains(&bytes.len()) && !complete {
            let unused = (4 - bytes.len() as u8) << 2;
            let mut data = [0; 4];
            data[..bytes.len()].copy_from_slice(bytes);
            let answer = self.mailbox(slave, &Self::sdo(0x23 | unused, index, sub_index, &data));
            return abort(&answer);
        }
        const FIRST: usize = 128 - 6 - 10;
        const NEXT: usize = 128 - 6 - 3;
        let mut data = (bytes.len() as u32).to_le_bytes().to_vec();
        let (first, mut rest) = bytes.split_at(bytes.len().min(FIRST));
        data.extend(first);
        let answer = self.mailbox(slave, &Self::sdo(0x21 | flag, index, sub_index, &data));
        abort(&answer)?;
        let mut toggle = 0;
        while !rest.is_empty() {
            let (part, after) = rest.split_at(rest.len().min(NEXT));
            rest = after;
            let unused = 7_usize.saturating_sub(part.len());
            let last = u8::from(rest.is_empty());
            let mut body = vec![0, 0x20, toggle | (unused as u8) << 1 | last];
            body.extend(part);
            body.extend(vec![0; unused]);
            let answer = self.mailbox(slave, &body);
            abort(&answer)?;
            toggle ^= 0x10;
        }
        Ok(())
    }

    pub fn way_back(&mut self) -> Returned {
        self.now_ns += CYCLE_NS;
        let mut bytes = frame(&[(7, 0, [0; 4], &[0])]);
        self.drives
            .receive(&mut bytes, self.now_ns)
            .expect("EtherCAT")
    }
}
