//! EtherCAT frames as bytes: where the datagrams of a frame lie and what their headers say.
//!
//! Source: ETG.1000.4, section 5 (frame structure). All numbers on the wire are little endian.

/// Ethernet type of EtherCAT.
pub const ETHERTYPE: u16 = 0x88a4;
/// Ethernet type of a VLAN tag, which may stand before that of EtherCAT.
const ETHERTYPE_VLAN: u16 = 0x8100;
/// Destination, source and type of an Ethernet frame.
const ETHERNET_HEADER: usize = 14;
/// The nibble in an EtherCAT header that says "datagrams follow" (ETG.1000.4, Table 3).
const TYPE_DATAGRAMS: u16 = 1;
/// Header of a datagram before its data.
const DATAGRAM_HEADER: usize = 10;
/// Length of the working counter behind a datagram's data.
const WORKING_COUNTER: usize = 2;
/// Bits of the length in EtherCAT and datagram headers.
const LENGTH_MASK: u16 = 0x07ff;
/// More datagrams follow in this frame.
const MORE_FOLLOW: u16 = 0x8000;

/// Two bytes at `at`; 0 beyond the end.
pub fn u16_at(bytes: &[u8], at: usize) -> u16 {
    bytes
        .get(at..at + 2)
        .map_or(0, |two| u16::from_le_bytes([two[0], two[1]]))
}

/// Four bytes at `at`; 0 beyond the end.
pub fn u32_at(bytes: &[u8], at: usize) -> u32 {
    bytes.get(at..at + 4).map_or(0, |four| {
        u32::from_le_bytes([four[0], four[1], four[2], four[3]])
    })
}

/// Eight bytes at `at`; 0 beyond the end.
pub fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}

/// What a datagram asks for (ETG.1000.4, section 5.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are those of the specification")]
pub enum Command {
    Aprd,
    Apwr,
    Aprw,
    Fprd,
    Fpwr,
    Fprw,
    Brd,
    Bwr,
    Brw,
    Lrd,
    Lwr,
    Lrw,
    Armw,
    Frmw,
}

impl Command {
    /// The command a number stands for; none for "no operation" and numbers without meaning.
    pub fn from_raw(raw: u8) -> Option<Self> {
        use Command::*;
        let commands = [
            Aprd, Apwr, Aprw, Fprd, Fpwr, Fprw, Brd, Bwr, Brw, Lrd, Lwr, Lrw, Armw, Frmw,
        ];
        commands.get(usize::from(raw).checked_sub(1)?).copied()
    }

    /// Whether the address counts slaves on its way.
    pub fn counts_position(self) -> bool {
        use Command::*;
        matches!(self, Aprd | Apwr | Aprw | Armw | Brd | Bwr | Brw)
    }
}

/// One datagram in a frame.
#[derive(Debug)]
pub struct Datagram<'a> {
    header: &'a mut [u8],
    /// What is written, and where what is read goes.
    pub data: &'a mut [u8],
    counter: &'a mut [u8],
}

impl Datagram<'_> {
    /// What it asks for.
    pub fn command(&self) -> Option<Command> {
        Command::from_raw(self.header[0])
    }

    /// The command as a number.
    pub fn raw_command(&self) -> u8 {
        self.header[0]
    }

    /// The master's number of it, which comes back unchanged.
    pub fn index(&self) -> u8 {
        self.header[1]
    }

    /// Changes it.
    pub fn set_index(&mut self, index: u8) {
        self.header[1] = index;
    }

    /// Position or station address.
    pub fn station(&self) -> u16 {
        u16_at(self.header, 2)
    }

    /// Changes position or station address.
    pub fn set_station(&mut self, station: u16) {
        self.header[2..4].copy_from_slice(&station.to_le_bytes());
    }

    /// Address in the slave's memory.
    pub fn offset(&self) -> u16 {
        u16_at(self.header, 4)
    }

    /// Logical address, over both of the above.
    pub fn logical(&self) -> u32 {
        u32_at(self.header, 2)
    }

    /// How often it was served.
    pub fn working_counter(&self) -> u16 {
        u16_at(self.counter, 0)
    }

    /// Counts it as served.
    pub fn count(&mut self, by: u16) {
        let counter = self.working_counter().wrapping_add(by);
        self.counter.copy_from_slice(&counter.to_le_bytes());
    }

    /// Takes back what one slave has counted.
    pub fn uncount(&mut self, by: u16) {
        let counter = self.working_counter().wrapping_sub(by);
        self.counter.copy_from_slice(&counter.to_le_bytes());
    }
}

/// Whether a frame is EtherCAT with datagrams.
pub fn is_ethercat(frame: &[u8]) -> bool {
    payload_start(frame).is_some()
}

/// Where the first datagram begins.
fn payload_start(frame: &[u8]) -> Option<usize> {
    let ethertype = |at: usize| Some(u16::from_be_bytes([*frame.get(at)?, *frame.get(at + 1)?]));
    let header = match ethertype(12)? {
        ETHERTYPE => ETHERNET_HEADER,
        ETHERTYPE_VLAN if ethertype(16)? == ETHERTYPE => ETHERNET_HEADER + 4,
        _ => return None,
    };
    let ethercat = u16_at(frame, header);
    (frame.len() >= header + 2 && ethercat >> 12 == TYPE_DATAGRAMS).then_some(header + 2)
}

/// Calls `each` with every whole datagram of a frame. What is cut off or beyond the frame's length is left alone, as a slave
/// leaves it.
pub fn for_each_datagram(frame: &mut [u8], mut each: impl FnMut(Datagram<'_>)) {
    let Some(start) = payload_start(frame) else {
        return;
    };
    let length = usize::from(u16_at(frame, start - 2) & LENGTH_MASK);
    let end = frame.len().min(start + length);
    let mut rest = &mut frame[start..end];
    loop {
        if rest.len() < DATAGRAM_HEADER + WORKING_COUNTER {
            return;
        }
        let (header, after) = rest.split_at_mut(DATAGRAM_HEADER);
        let length_and_flags = u16_at(header, 6);
        let length = usize::from(length_and_flags & LENGTH_MASK);
        if after.len() < length + WORKING_COUNTER {
            return;
        }
        let (data, after) = after.split_at_mut(length);
        let (counter, after) = after.split_at_mut(WORKING_COUNTER);
        each(Datagram {
            header,
            data,
            counter,
        });
        if length_and_flags & MORE_FOLLOW == 0 {
            return;
        }
        rest = after;
    }
}

/// Marks a frame as one that came back: bit 1 of the source address' first byte, which the first slave sets (ETG.1000.4,
/// section 5.2). Masters tell their own frames from replies by it.
pub fn mark_returned(frame: &mut [u8]) {
    if let Some(byte) = frame.get_mut(6) {
        *byte |= 0x02;
    }
}

/// Builds a frame of datagrams `(command, index, address, data)`, as a master would; for tests and tools.
pub fn frame(datagrams: &[(u8, u8, [u8; 4], &[u8])]) -> Vec<u8> {
    let mut bytes = vec![0xff; 6];
    bytes.extend([0x10; 6]);
    bytes.extend(ETHERTYPE.to_be_bytes());
    let length: usize = datagrams
        .iter()
        .map(|(.., data)| DATAGRAM_HEADER + data.len() + WORKING_COUNTER)
        .sum();
    bytes.extend((length as u16 & LENGTH_MASK | TYPE_DATAGRAMS << 12).to_le_bytes());
    for (position, (command, index, address, data)) in datagrams.iter().enumerate() {
        let more = if position + 1 < datagrams.len() {
            MORE_FOLLOW
        } else {
            0
        };
        bytes.extend([*command, *index]);
        bytes.extend(address);
        bytes.extend((data.len() as u16 | more).to_le_bytes());
        bytes.extend([0, 0]);
        bytes.extend(*data);
        bytes.extend([0, 0]);
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn datagrams_are_found_and_counted() {
        let mut bytes = frame(&[
            (7, 1, [0, 0, 0, 0], &[0, 0]),
            (12, 2, [0, 0, 1, 0], &[1, 2, 3]),
        ]);
        let mut seen = Vec::new();
        for_each_datagram(&mut bytes, |mut datagram| {
            datagram.count(3);
            seen.push((datagram.command(), datagram.data.len()));
        });
        assert_eq!(seen, [(Some(Command::Brd), 2), (Some(Command::Lrw), 3)]);
        for_each_datagram(&mut bytes, |datagram| {
            assert_eq!(datagram.working_counter(), 3);
        });
    }

    #[test]
    fn a_datagram_that_is_cut_off_is_left_alone() {
        let whole = frame(&[(7, 1, [0; 4], &[0; 20])]);
        for length in 0..whole.len() {
            let mut cut = whole[..length].to_vec();
            for_each_datagram(&mut cut, |_| panic!("{length} bytes hold no datagram"));
        }
    }

    #[test]
    fn a_vlan_tag_is_read_over() {
        let plain = frame(&[(7, 1, [0; 4], &[0; 2])]);
        let mut tagged = plain[..12].to_vec();
        tagged.extend([0x81, 0x00, 0x00, 0x01]);
        tagged.extend(&plain[12..]);
        let mut seen = 0;
        for_each_datagram(&mut tagged, |_| seen += 1);
        assert_eq!(seen, 1);
    }
}
