//! The two frames of a cycle, made once and filled in place: inputs and states first, outputs when the command is known.
//!
//! One datagram a slave each way, so that a working counter that is short says whose.

use ethercat_wire::frame::{Datagram, for_each_datagram, frame, is_ethercat, u16_at, u64_at};
use ethercat_wire::link::Link;
use ethercat_wire::socket::FRAME_MAX;

use crate::setup::Slave;

/// Commands (ETG.1000.4, section 5.4).
const FPRD: u8 = 4;
const FPWR: u8 = 5;
const LRD: u8 = 10;
const LWR: u8 = 11;
const FRMW: u8 = 14;
/// Numbers of the cycle's datagrams: from here on, in a ring.
const FIRST_INDEX: u8 = 0x80;
const INDICES: u8 = 0x70;
/// Numbers of datagrams whose answers nobody waits for.
const UNHEARD_INDEX: u8 = 0x7f;

/// What a slave said in this cycle.
#[derive(Clone, Debug, Default)]
pub struct Answer {
    /// Its inputs, as they last came.
    pub inputs: Vec<u8>,
    /// Whether they came in this cycle.
    pub inputs_came: bool,
    /// AL status, and whether it came in this cycle.
    pub al_status: u16,
    /// AL status code.
    pub al_status_code: u16,
    /// Whether the status came in this cycle.
    pub status_came: bool,
}

/// A frame that came back.
#[derive(Clone, Copy, Debug)]
pub struct Exchange {
    /// System time at the reference clock.
    pub system_ns: Option<u64>,
    /// When the frame was sent, on the loop's clock.
    pub sent_ns: u64,
    /// When it had come back, on the loop's clock.
    pub received_ns: u64,
    /// How often it was served, of what was expected.
    pub working_counter: u16,
}

/// Both frames, and what came back.
pub struct Frames {
    link: Box<dyn Link>,
    stations: Vec<u16>,
    inputs: Vec<u8>,
    outputs: Vec<u8>,
    state_request: Vec<u8>,
    has_clock: bool,
    sequence: u8,
    /// What each slave said.
    pub answers: Vec<Answer>,
    /// Working counter of a whole exchange of inputs.
    pub expected: u16,
    buffer: [u8; FRAME_MAX],
}

impl Frames {
    /// Frames for these slaves; with `has_clock` the first keeps everybody's.
    ///
    /// # Errors
    /// What does not fit into one frame.
    pub fn new(link: Box<dyn Link>, slaves: &[Slave], has_clock: bool) -> Result<Self, String> {
        /// Longest payload of an Ethernet frame, less EtherCAT's header.
        const ROOM: usize = 1498;
        let too_long = |bytes: usize| {
            format!(
                "the process data of {} slaves take {bytes} bytes a frame, {ROOM} are the most; map less",
                slaves.len()
            )
        };
        // what a slave says of its own data may be anything
        let lengths = slaves
            .iter()
            .flat_map(|slave| [slave.inputs.1, slave.outputs.1]);
        let largest = lengths.max().unwrap_or(0);
        if largest > ROOM {
            return Err(too_long(largest));
        }
        let zeros = vec![0; FRAME_MAX];
        let at = |station: u16, register: u16| {
            let ([a, b], [c, d]) = (station.to_le_bytes(), register.to_le_bytes());
            [a, b, c, d]
        };
        let (mut read, mut written, mut asked) = (Vec::new(), Vec::new(), Vec::new());
        if let (true, Some(first)) = (has_clock, slaves.first()) {
            read.push((FRMW, 0, at(first.device.station, 0x0910), &zeros[..8]));
        }
        let mut expected = 0;
        for slave in slaves {
            if slave.inputs.1 > 0 {
                expected += 1;
            }
            let (address, length) = slave.inputs;
            read.push((LRD, 0, address.to_le_bytes(), &zeros[..length]));
            read.push((FPRD, 0, at(slave.device.station, 0x0130), &zeros[..6]));
            let (address, length) = slave.outputs;
            written.push((LWR, 0, address.to_le_bytes(), &zeros[..length]));
            asked.push((
                FPWR,
                UNHEARD_INDEX,
                at(slave.device.station, 0x0120),
                &zeros[..2],
            ));
        }
        let length = |datagrams: &[(u8, u8, [u8; 4], &[u8])]| {
            datagrams
                .iter()
                .map(|(.., data)| 12 + data.len())
                .sum::<usize>()
        };
        let longest = length(&read).max(length(&written));
        if longest > ROOM {
            return Err(too_long(longest));
        }
        Ok(Self {
            link,
            stations: slaves.iter().map(|slave| slave.device.station).collect(),
            inputs: frame(&read),
            outputs: frame(&written),
            state_request: frame(&asked),
            has_clock,
            sequence: 0,
            answers: slaves
                .iter()
                .map(|slave| Answer {
                    inputs: vec![0; slave.inputs.1],
                    ..Answer::default()
                })
                .collect(),
            expected,
            buffer: [0; FRAME_MAX],
        })
    }

    /// Nanoseconds of the clock at this end of the cable.
    pub fn now_ns(&self) -> u64 {
        self.link.now_ns()
    }

    /// Lets time pass.
    pub fn sleep(&self, for_ns: u64) {
        self.link.sleep(for_ns);
    }

    /// Fetches inputs and states; waits for them until `give_up_at_ns` at most.
    pub fn fetch(&mut self, give_up_at_ns: u64) -> Option<Exchange> {
        self.sequence = (self.sequence + 1) % INDICES;
        let index = FIRST_INDEX + self.sequence;
        for_each_datagram(&mut self.inputs, |mut datagram| datagram.set_index(index));
        for answer in &mut self.answers {
            (answer.inputs_came, answer.status_came) = (false, false);
        }
        let sent_ns = self.link.now_ns();
        if !self.link.send(&self.inputs) {
            return None;
        }
        loop {
            while let Some(length) = self.link.receive(&mut self.buffer) {
                let received_ns = self.link.now_ns();
                if let Some((system_ns, working_counter)) = self.take(length, index) {
                    return Some(Exchange {
                        system_ns,
                        sent_ns,
                        received_ns,
                        working_counter,
                    });
                }
            }
            let now_ns = self.link.now_ns();
            if now_ns >= give_up_at_ns {
                return None;
            }
            self.link.wait(give_up_at_ns - now_ns);
        }
    }

    /// Takes a frame of this cycle's inputs. Others are late, double, or answers that nobody waits for.
    fn take(&mut self, length: usize, index: u8) -> Option<(Option<u64>, u16)> {
        let bytes = &mut self.buffer[..length];
        if !is_ethercat(bytes) {
            return None;
        }
        let (mut position, mut is_ours, mut working_counter) = (0, true, 0);
        let mut system_ns = None;
        let (answers, stations, has_clock) = (&mut self.answers, &self.stations, self.has_clock);
        for_each_datagram(bytes, |datagram| {
            is_ours &= datagram.index() == index;
            if !is_ours {
                return;
            }
            let served = datagram.working_counter();
            if has_clock && position == 0 {
                system_ns = (datagram.raw_command() == FRMW && served > 0)
                    .then(|| u64_at(datagram.data, 0));
            } else {
                let at = position - usize::from(has_clock);
                if let (Some(answer), Some(station)) =
                    (answers.get_mut(at / 2), stations.get(at / 2))
                {
                    if at % 2 == 0 {
                        working_counter += take_inputs(answer, &datagram);
                    } else {
                        take_status(answer, *station, &datagram);
                    }
                }
            }
            position += 1;
        });
        (is_ours && position > 0).then_some((system_ns, working_counter))
    }

    /// Fills the outputs of each slave.
    pub fn fill(&mut self, mut fill: impl FnMut(usize, &mut [u8])) {
        let mut slave = 0;
        for_each_datagram(&mut self.outputs, |datagram| {
            fill(slave, datagram.data);
            slave += 1;
        });
    }

    /// Sends the outputs; whether the kernel took them.
    pub fn send_outputs(&mut self) -> bool {
        for_each_datagram(&mut self.outputs, |mut datagram| {
            datagram.set_index(UNHEARD_INDEX);
        });
        self.link.send(&self.outputs)
    }

    /// Asks some slaves for a state.
    pub fn ask(&mut self, control: u16, wanted: impl Fn(usize) -> bool) {
        let mut slave = 0;
        for_each_datagram(&mut self.state_request, |mut datagram| {
            // a slave that is not asked is not addressed: no slave has station 0 here
            let station = if wanted(slave) {
                self.stations[slave]
            } else {
                0
            };
            datagram.set_station(station);
            datagram.data.copy_from_slice(&control.to_le_bytes());
            slave += 1;
        });
        let _ = self.link.send(&self.state_request);
    }
}

fn take_inputs(answer: &mut Answer, datagram: &Datagram<'_>) -> u16 {
    let served = datagram.working_counter();
    let whole = datagram.raw_command() == LRD && datagram.data.len() == answer.inputs.len();
    if served == 1 && whole {
        answer.inputs.copy_from_slice(datagram.data);
        answer.inputs_came = true;
    }
    served
}

fn take_status(answer: &mut Answer, station: u16, datagram: &Datagram<'_>) {
    let is_its = datagram.raw_command() == FPRD && datagram.station() == station;
    if datagram.working_counter() == 1 && is_its {
        answer.al_status = u16_at(datagram.data, 0) & 0x1f;
        answer.al_status_code = u16_at(datagram.data, 4);
        answer.status_came = true;
    }
}
