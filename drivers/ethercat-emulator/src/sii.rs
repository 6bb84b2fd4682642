//! The slave information (SII) in the EEPROM: who the slave is and what it has.
//!
//! Source: ETG.2010 (tables by number below), ETG.1000.6 section 5.4.

/// Length of the EEPROM.
const LENGTH: usize = 4096;
/// First byte of the categories (ETG.2010, Table 2: word 0x40).
const CATEGORIES: usize = 0x80;

/// What is written into it.
#[derive(Clone, Debug)]
pub struct Information<'a> {
    /// Station alias.
    pub alias: u16,
    /// Vendor, product, revision, serial number.
    pub identity: [u32; 4],
    /// What a master's scan shows.
    pub order: &'a str,
    /// The long name.
    pub name: &'a str,
    /// Axes, as the general category counts them.
    pub axes: u8,
    /// Request mailbox, answer mailbox: start and length.
    pub mailboxes: [(u16, u16); 2],
    /// Outputs, inputs: start and length.
    pub process_data: [(u16, u16); 2],
    /// Default outputs (RxPDO), then inputs (TxPDO).
    pub pdos: [&'a [Pdo]; 2],
}

/// A process data object with its entries.
#[derive(Clone, Debug)]
pub struct Pdo {
    /// Index of its mapping object.
    pub index: u16,
    /// Name.
    pub name: String,
    /// What it carries.
    pub entries: Vec<PdoEntry>,
}

/// One entry of a process data object.
#[derive(Clone, Debug)]
pub struct PdoEntry {
    /// Object.
    pub index: u16,
    /// Part of it.
    pub sub_index: u8,
    /// Data type, as the object dictionary numbers it.
    pub data_type: u8,
    /// Length.
    pub bits: u8,
    /// Name.
    pub name: String,
}

/// CRC-8 with polynomial x⁸+x²+x+1 and initial value 0xff (ETG.2010, Table 2, word 7), over the first 14 bytes.
pub fn crc(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0xff, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| {
            if crc & 0x80 != 0 {
                crc << 1 ^ 0x07
            } else {
                crc << 1
            }
        })
    })
}

/// The names of an EEPROM, each once.
#[derive(Default)]
struct Strings(Vec<String>);

impl Strings {
    /// Its number, from 1. 0, "none", where there are as many as a byte counts.
    fn number(&mut self, text: &str) -> u8 {
        let found = self.0.iter().position(|known| known == text);
        let at = found.unwrap_or_else(|| {
            self.0.push(text.to_owned());
            self.0.len() - 1
        });
        u8::try_from(at + 1).unwrap_or(0)
    }

    fn category(&self) -> Vec<u8> {
        let texts = &self.0[..self.0.len().min(255)];
        let mut bytes = vec![texts.len() as u8];
        for text in texts {
            let text = &text.as_bytes()[..text.len().min(255)];
            bytes.push(text.len() as u8);
            bytes.extend(text);
        }
        bytes
    }
}

/// The bytes of the EEPROM.
pub fn image(information: &Information<'_>) -> Vec<u8> {
    let mut bytes = vec![0; CATEGORIES];
    let put = |bytes: &mut Vec<u8>, word: usize, value: u16| {
        bytes[2 * word..2 * word + 2].copy_from_slice(&value.to_le_bytes());
    };
    // An SPI slave; word 1 to 3 stay at their defaults.
    put(&mut bytes, 0, 0x0005);
    put(&mut bytes, 4, information.alias);
    let crc = crc(&bytes[..14]);
    put(&mut bytes, 7, u16::from(crc));
    for (position, value) in information.identity.iter().enumerate() {
        let at = 2 * (8 + 2 * position);
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
    for (position, (start, length)) in information.mailboxes.iter().enumerate() {
        put(&mut bytes, 0x18 + 2 * position, *start);
        put(&mut bytes, 0x19 + 2 * position, *length);
    }
    const COE: u16 = 0x0004;
    put(&mut bytes, 0x1c, COE);
    put(&mut bytes, 0x3e, (LENGTH * 8 / 1024 - 1) as u16);
    put(&mut bytes, 0x3f, 1);

    let mut strings = Strings::default();
    let general = general(information, &mut strings);
    let pdos = information.pdos.map(|pdos| {
        pdos.iter()
            .flat_map(|pdo| pdo_bytes(pdo, &mut strings))
            .collect::<Vec<u8>>()
    });
    let clocks = clocks(&mut strings);
    let [outputs, inputs] = pdos;
    let inputs = with_sync_manager(inputs, 3);
    let outputs = with_sync_manager(outputs, 2);
    for (kind, content) in [
        (10, strings.category()),
        (30, general),
        // outputs, inputs, mailbox state
        (40, vec![1, 2, 3, 0]),
        (41, sync_managers(information)),
        (50, inputs),
        (51, outputs),
        (60, clocks),
    ] {
        category(&mut bytes, kind, content);
    }
    bytes.extend([0xff, 0xff]);
    bytes.resize(LENGTH.max(bytes.len()), 0xff);
    bytes
}

fn category(bytes: &mut Vec<u8>, kind: u16, mut content: Vec<u8>) {
    if !content.len().is_multiple_of(2) {
        content.push(0);
    }
    bytes.extend(kind.to_le_bytes());
    bytes.extend(((content.len() / 2) as u16).to_le_bytes());
    bytes.extend(content);
}

/// ETG.2010, Table 7.
fn general(information: &Information<'_>, strings: &mut Strings) -> Vec<u8> {
    /// SDO, SDO information, PDO assignment, PDO mapping, complete access.
    const COE_DETAILS: u8 = 0b0010_1111;
    /// Ports 0 and 1 are MII.
    const PORTS: [u8; 2] = [0x11, 0x00];
    let mut bytes = vec![0; 32];
    // SOEM takes the first text for the slave's name
    bytes[2] = strings.number(information.order);
    let group = strings.number("Drives");
    bytes[0] = group;
    bytes[3] = strings.number(information.name);
    bytes[5] = COE_DETAILS;
    bytes[9] = information.axes;
    bytes[14] = group;
    bytes[16..18].copy_from_slice(&PORTS);
    bytes
}

/// ETG.2010, Table 11.
fn sync_managers(information: &Information<'_>) -> Vec<u8> {
    // mailbox out, mailbox in, outputs with watchdog, inputs
    let settings = [(0x26, 1), (0x22, 2), (0x64, 3), (0x20, 4)];
    let areas = information
        .mailboxes
        .iter()
        .chain(&information.process_data);
    areas
        .zip(settings)
        .flat_map(|((start, length), (control, kind))| {
            let [start, length] = [start, length].map(|value| value.to_le_bytes());
            [
                start[0], start[1], length[0], length[1], control, 0, 1, kind,
            ]
        })
        .collect()
}

/// ETG.2010, Table 14; the sync manager follows in [`with_sync_manager`].
fn pdo_bytes(pdo: &Pdo, strings: &mut Strings) -> Vec<u8> {
    let name = strings.number(&pdo.name);
    let [low, high] = pdo.index.to_le_bytes();
    let mut bytes = vec![low, high, pdo.entries.len() as u8, 0, 0, name, 0, 0];
    for entry in &pdo.entries {
        let [low, high] = entry.index.to_le_bytes();
        let name = if entry.index == 0 {
            0
        } else {
            strings.number(&entry.name)
        };
        bytes.extend([
            low,
            high,
            entry.sub_index,
            name,
            entry.data_type,
            entry.bits,
            0,
            0,
        ]);
    }
    bytes
}

fn with_sync_manager(mut pdos: Vec<u8>, manager: u8) -> Vec<u8> {
    let mut at = 0;
    while at + 8 <= pdos.len() {
        pdos[at + 3] = manager;
        at += 8 + 8 * usize::from(pdos[at + 2]);
    }
    pdos
}

/// ETG.2010, Table 16: with SYNC0, and without.
fn clocks(strings: &mut Strings) -> Vec<u8> {
    [("DC", 0x0300_u16), ("SM", 0)]
        .iter()
        .flat_map(|(name, activate)| {
            let mut bytes = [0; 24];
            bytes[14..16].copy_from_slice(&activate.to_le_bytes());
            bytes[18] = strings.number(name);
            bytes
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::u16_at;

    #[test]
    fn the_checksum_is_the_one_of_real_slaves() {
        // what the EEPROM of a Beckhoff EK1100 says with alias 0xabcd
        let head = [9, 0, 0, 8, 0, 0, 0, 0, 0xcd, 0xab, 0, 0, 0, 0];
        assert_eq!(crc(&head), 0x04);
    }

    #[test]
    fn categories_follow_each_other_to_the_end_mark() {
        let pdo = Pdo {
            index: 0x1600,
            name: "Outputs".into(),
            entries: vec![PdoEntry {
                index: 0x6040,
                sub_index: 0,
                data_type: 6,
                bits: 16,
                name: "Controlword".into(),
            }],
        };
        let bytes = image(&Information {
            alias: 7,
            identity: [1, 2, 3, 4],
            order: "FS-1",
            name: "One axis",
            axes: 1,
            mailboxes: [(0x1000, 128), (0x1080, 128)],
            process_data: [(0x1100, 2), (0x1400, 0)],
            pdos: [&[pdo], &[]],
        });
        let (mut at, mut kinds) = (CATEGORIES, Vec::new());
        while u16_at(&bytes, at) != 0xffff {
            kinds.push(u16_at(&bytes, at));
            at += 4 + 2 * usize::from(u16_at(&bytes, at + 2));
        }
        assert_eq!(kinds, [10, 30, 40, 41, 50, 51, 60]);
        assert_eq!(bytes.len(), LENGTH);
        assert_eq!(bytes[14], crc(&bytes[..14]));
        assert_eq!(u16_at(&bytes, 8), 7);
    }
}
