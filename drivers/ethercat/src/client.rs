//! Single datagrams and SDO transfers, each waited for: for start-up, checks and the channel beside the cycle.
//!
//! SDOs are done here and not by ethercrab, which ends the program when a drive tells of a fault (an emergency message) between
//! request and answer. Source: ETG.1000.6, section 5.6.2.

use ethercat_wire::frame::{for_each_datagram, frame, is_ethercat, u16_at, u32_at};
use ethercat_wire::link::Link;
use ethercat_wire::socket::FRAME_MAX;

/// How long one frame may take, and how often it is sent again. A busy machine, on which this thread has no priority yet, takes long;
/// an answer from a mailbox that is not waited for is lost.
const FRAME_NS: u64 = 200_000_000;
const TRIES: usize = 5;
/// How long a drive may take to answer a request.
const MAILBOX_NS: u64 = 1_000_000_000;
/// Transfers of more bytes than any object of a drive has are ended.
const TRANSFER_MAX: usize = 65_536;
/// Commands (ETG.1000.4, section 5.4).
const APRD: u8 = 1;
const FPRD: u8 = 4;
const FPWR: u8 = 5;
const BRD: u8 = 7;
const BWR: u8 = 8;

/// Why an exchange failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ClientError {
    /// No frame came back.
    #[error("no frame comes back")]
    NoAnswer,
    /// A frame came back that the slave did not serve.
    #[error("slave {station:#06x} does not answer at register {register:#06x}")]
    NotServed {
        /// Its address.
        station: u16,
        /// What was asked for.
        register: u16,
    },
    /// The slave took a request and does not answer it.
    #[error("slave {station:#06x} has not answered an SDO within {} s; take its supply away and give it back", MAILBOX_NS / 1_000_000_000)]
    NoSdo {
        /// Its address.
        station: u16,
    },
    /// The slave has no mailbox that is set up.
    #[error("slave {station:#06x} has no mailbox for SDOs")]
    NoMailbox {
        /// Its address.
        station: u16,
    },
    /// The slave refuses the transfer.
    #[error("object {index:#06x}:{sub_index:02x} of slave {station:#06x} is refused: {}", abort_text(*code))]
    Refused {
        /// Its address.
        station: u16,
        /// Object.
        index: u16,
        /// Part of it.
        sub_index: u8,
        /// Abort code (ETG.1000.6, Table 41).
        code: u32,
    },
    /// The answer is none to the request.
    #[error("slave {station:#06x} answers out of turn")]
    Nonsense {
        /// Its address.
        station: u16,
    },
}

/// What an abort code means (ETG.1000.6, Table 41).
fn abort_text(code: u32) -> String {
    let text = match code {
        0x0601_0001 => "it is write-only",
        0x0601_0002 => "it is read-only",
        0x0602_0000 => "there is no such object",
        0x0604_0041 => "it cannot be mapped",
        0x0604_0042 => "the mapping is too long",
        0x0607_0010 | 0x0607_0012 | 0x0607_0013 => "its length is another",
        0x0609_0011 => "there is no such sub-index",
        0x0609_0030..=0x0609_0032 => "the value is out of range",
        0x0800_0021 | 0x0800_0022 => "not in this state of the drive",
        _ => return format!("abort code {code:#010x}"),
    };
    format!("{text} (abort code {code:#010x})")
}

/// A place of its own at the cable, with datagrams that only it uses.
pub struct Client {
    link: Box<dyn Link>,
    /// First index of its datagrams, and how many follow.
    indices: (u8, u8),
    next: u8,
    counter: u8,
}

/// A mailbox's place: start and length.
type Mailbox = (u16, u16);

impl Client {
    /// Datagrams are numbered from `first` on, so many; other users of the cable take other numbers.
    pub fn new(link: Box<dyn Link>, first: u8, count: u8) -> Self {
        Self {
            link,
            indices: (first, count),
            next: 0,
            counter: 0,
        }
    }

    /// Nanoseconds of the clock at this end of the cable.
    pub fn now_ns(&self) -> u64 {
        self.link.now_ns()
    }

    /// Whether EtherCAT frames of somebody else come in within `for_ns`, while nothing is sent.
    pub fn hears_another_master(&self, for_ns: u64) -> bool {
        let end_ns = self.link.now_ns() + for_ns;
        let mut buffer = [0; FRAME_MAX];
        loop {
            while let Some(length) = self.link.receive(&mut buffer) {
                if is_ethercat(&buffer[..length]) {
                    return true;
                }
            }
            let now_ns = self.link.now_ns();
            if now_ns >= end_ns {
                return false;
            }
            self.link.wait(end_ns - now_ns);
        }
    }

    /// One datagram; its data and how often it was served.
    ///
    /// # Errors
    /// [`ClientError::NoAnswer`].
    pub fn datagram(
        &mut self,
        command: u8,
        station: u16,
        register: u16,
        data: &[u8],
    ) -> Result<(Vec<u8>, u16), ClientError> {
        let [a, b] = station.to_le_bytes();
        let [c, d] = register.to_le_bytes();
        for _ in 0..TRIES {
            let index = self.indices.0 + self.next;
            self.next = (self.next + 1) % self.indices.1;
            let bytes = frame(&[(command, index, [a, b, c, d], data)]);
            self.drain();
            let _ = self.link.send(&bytes);
            if let Some(answer) = self.wait(command, index, register, data.len()) {
                return Ok(answer);
            }
        }
        Err(ClientError::NoAnswer)
    }

    /// Throws away what came before: answers to others at this cable, whose numbers may be ours.
    fn drain(&self) {
        let mut buffer = [0; FRAME_MAX];
        while self.link.receive(&mut buffer).is_some() {}
    }

    fn wait(&self, command: u8, index: u8, register: u16, length: usize) -> Option<(Vec<u8>, u16)> {
        let end_ns = self.link.now_ns() + FRAME_NS;
        let mut buffer = [0; FRAME_MAX];
        loop {
            while let Some(got) = self.link.receive(&mut buffer) {
                let mut answer = None;
                for_each_datagram(&mut buffer[..got], |datagram| {
                    let is_ours = datagram.raw_command() == command
                        && datagram.index() == index
                        && datagram.offset() == register;
                    if is_ours && datagram.data.len() == length {
                        answer = Some((datagram.data.to_vec(), datagram.working_counter()));
                    }
                });
                if answer.is_some() {
                    return answer;
                }
            }
            let now_ns = self.link.now_ns();
            if now_ns >= end_ns {
                return None;
            }
            self.link.wait(end_ns - now_ns);
        }
    }

    /// Reads so many bytes of a slave's memory.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn read(
        &mut self,
        station: u16,
        register: u16,
        length: usize,
    ) -> Result<Vec<u8>, ClientError> {
        match self.datagram(FPRD, station, register, &vec![0; length])? {
            (data, 1) => Ok(data),
            _ => Err(ClientError::NotServed { station, register }),
        }
    }

    /// Writes to a slave's memory.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn write(&mut self, station: u16, register: u16, data: &[u8]) -> Result<(), ClientError> {
        match self.datagram(FPWR, station, register, data)? {
            (_, 1) => Ok(()),
            _ => Err(ClientError::NotServed { station, register }),
        }
    }

    /// Reads the slave at a position along the cable.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn read_position(
        &mut self,
        position: u16,
        register: u16,
        length: usize,
    ) -> Result<Vec<u8>, ClientError> {
        match self.datagram(APRD, position.wrapping_neg(), register, &vec![0; length])? {
            (data, 1) => Ok(data),
            _ => Err(ClientError::NotServed {
                station: position,
                register,
            }),
        }
    }

    /// Reads a register of all slaves joined by OR, and how many there are.
    ///
    /// # Errors
    /// [`ClientError::NoAnswer`].
    pub fn read_all(
        &mut self,
        register: u16,
        length: usize,
    ) -> Result<(Vec<u8>, u16), ClientError> {
        self.datagram(BRD, 0, register, &vec![0; length])
    }

    /// Writes a register of all slaves; how many took it.
    ///
    /// # Errors
    /// [`ClientError::NoAnswer`].
    pub fn write_all(&mut self, register: u16, data: &[u8]) -> Result<u16, ClientError> {
        Ok(self.datagram(BWR, 0, register, data)?.1)
    }

    fn mailboxes(&mut self, station: u16) -> Result<[Mailbox; 2], ClientError> {
        let managers = self.read(station, 0x0800, 16)?;
        let mailbox = |at: usize| (u16_at(&managers, at), u16_at(&managers, at + 2));
        let is_mailbox = |at: usize| managers[at + 4] & 3 == 2 && managers[at + 6] & 1 != 0;
        let long_enough = |(_, length): Mailbox| (16..=1400).contains(&length);
        let both = [mailbox(0), mailbox(8)];
        if is_mailbox(0) && is_mailbox(8) && both.into_iter().all(long_enough) {
            Ok(both)
        } else {
            Err(ClientError::NoMailbox { station })
        }
    }

    /// Sends a CoE message and fetches the answer to it: without mailbox header. Emergencies on the way are read over.
    fn mailbox(&mut self, station: u16, body: &[u8]) -> Result<Vec<u8>, ClientError> {
        let [request, answer] = self.mailboxes(station)?;
        let end_ns = self.link.now_ns() + MAILBOX_NS;
        self.counter = self.counter % 7 + 1;
        let mut message = (body.len() as u16).to_le_bytes().to_vec();
        message.extend([0, 0, 0, 3 | self.counter << 4]);
        message.extend(body);
        message.resize(usize::from(request.1), 0);
        // What nobody fetched is in the way.
        while self.fetch(station, answer)?.is_some() && self.link.now_ns() < end_ns {}
        loop {
            let (_, served) = self.datagram(FPWR, station, request.0, &message)?;
            if served == 1 {
                break;
            }
            if self.link.now_ns() > end_ns {
                return Err(ClientError::NotServed {
                    station,
                    register: request.0,
                });
            }
        }
        while self.link.now_ns() < end_ns {
            const EMERGENCY: u16 = 1;
            if let Some(body) = self.fetch(station, answer)?
                && u16_at(&body, 0) >> 12 != EMERGENCY
            {
                return Ok(body);
            }
        }
        Err(ClientError::NoSdo { station })
    }

    fn fetch(
        &mut self,
        station: u16,
        (start, length): Mailbox,
    ) -> Result<Option<Vec<u8>>, ClientError> {
        let (data, served) = self.datagram(FPRD, station, start, &vec![0; usize::from(length)])?;
        let body_length = usize::from(u16_at(&data, 0));
        let is_coe = data[5] & 0x0f == 3;
        match data.get(6..6 + body_length) {
            Some(body) if served == 1 && is_coe && body.len() >= 10 => Ok(Some(body.to_vec())),
            _ if served == 1 => Err(ClientError::Nonsense { station }),
            _ => Ok(None),
        }
    }

    fn sdo(
        &mut self,
        station: u16,
        command: u8,
        (index, sub_index): (u16, u8),
        data: &[u8],
    ) -> Result<Vec<u8>, ClientError> {
        let mut body = vec![0, 0x20, command];
        body.extend(index.to_le_bytes());
        body.push(sub_index);
        body.extend(data);
        let answer = self.mailbox(station, &body)?;
        if answer[2] == 0x80 {
            let code = u32_at(&answer, 6);
            return Err(ClientError::Refused {
                station,
                index,
                sub_index,
                code,
            });
        }
        Ok(answer)
    }

    /// Reads an object.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn upload(
        &mut self,
        station: u16,
        index: u16,
        sub_index: u8,
    ) -> Result<Vec<u8>, ClientError> {
        let answer = self.sdo(station, 0x40, (index, sub_index), &[0; 4])?;
        let is_answer =
            answer[2] >> 5 == 2 && u16_at(&answer, 3) == index && answer[5] == sub_index;
        if !is_answer {
            return Err(ClientError::Nonsense { station });
        }
        if answer[2] & 0x02 != 0 {
            let unused = if answer[2] & 1 != 0 {
                usize::from(answer[2] >> 2 & 3)
            } else {
                0
            };
            return Ok(answer[6..10 - unused].to_vec());
        }
        let length = u32_at(&answer, 6) as usize;
        let mut bytes = answer[10..].to_vec();
        let mut toggle = 0;
        while bytes.len() < length && length <= TRANSFER_MAX {
            let segment = self.sdo(station, 0x60 | toggle, (0, 0), &[0; 4])?;
            let data = &segment[3..];
            let unused = if data.len() <= 7 {
                usize::from(segment[2] >> 1 & 7)
            } else {
                0
            };
            if segment[2] >> 5 != 0 || segment[2] & 0x10 != toggle || data.len() <= unused {
                return Err(ClientError::Nonsense { station });
            }
            bytes.extend(&data[..data.len() - unused]);
            toggle ^= 0x10;
        }
        if bytes.len() < length {
            return Err(ClientError::Nonsense { station });
        }
        bytes.truncate(length);
        Ok(bytes)
    }

    /// Reads an unsigned number of one to four bytes.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn number(&mut self, station: u16, index: u16, sub_index: u8) -> Result<u32, ClientError> {
        let mut bytes = self.upload(station, index, sub_index)?;
        bytes.resize(4, 0);
        Ok(u32_at(&bytes, 0))
    }

    /// Writes an object of at most four bytes.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn download(
        &mut self,
        station: u16,
        index: u16,
        sub_index: u8,
        bytes: &[u8],
    ) -> Result<(), ClientError> {
        let mut data = [0; 4];
        let length = bytes.len().clamp(1, 4);
        data[..bytes.len().min(4)].copy_from_slice(&bytes[..bytes.len().min(4)]);
        let command = 0x23 | ((4 - length) as u8) << 2;
        let answer = self.sdo(station, command, (index, sub_index), &data)?;
        let is_answer = answer[2] == 0x60 && u16_at(&answer, 3) == index && answer[5] == sub_index;
        if is_answer {
            Ok(())
        } else {
            Err(ClientError::Nonsense { station })
        }
    }
}
