//! Whatever comes from the wire: slaves answer or do not, and neither panic nor hang. `.ci/fuzz` runs many more.

mod common;

use common::Master;
use ethercat_emulator::wire::frame;
use proptest::collection::vec;
use proptest::prelude::*;

/// Offsets where something happens, and any.
fn offset() -> impl Strategy<Value = u16> {
    let known = prop_oneof![
        Just(0x0010_u16),
        Just(0x0040),
        Just(0x0100),
        Just(0x0120),
        Just(0x0400),
        Just(0x0420),
        Just(0x0500),
        Just(0x0502),
        Just(0x0508),
        Just(0x0600),
        Just(0x0610),
        Just(0x0800),
        Just(0x0808),
        Just(0x0810),
        Just(0x0818),
        Just(0x0900),
        Just(0x0910),
        Just(0x0920),
        Just(0x0980),
        Just(0x0981),
        Just(0x0990),
        Just(0x09a0),
        Just(0x1000),
        Just(0x1080),
        Just(0x1100),
        Just(0x1400),
    ];
    prop_oneof![4 => known, 1 => any::<u16>()]
}

fn station() -> impl Strategy<Value = u16> {
    prop_oneof![
        Just(0_u16),
        Just(0xffff),
        Just(0x1001),
        Just(0x1002),
        any::<u16>()
    ]
}

type Made = (u8, u16, u16, Vec<u8>);

fn datagram() -> impl Strategy<Value = Made> {
    (0_u8..16, station(), offset(), vec(any::<u8>(), 0..160))
}

proptest! {
    #[test]
    fn any_bytes(bytes in vec(any::<u8>(), 0..200)) {
        let mut master = Master::new("shd17", |_| {});
        let mut bytes = bytes;
        master.drives.receive(&mut bytes, 1_000);
        if bytes.len() >= 16 {
            bytes[12..14].copy_from_slice(&[0x88, 0xa4]);
            bytes[15] = bytes[15] & 0x07 | 0x10;
            master.drives.receive(&mut bytes, 2_000);
        }
    }

    #[test]
    fn any_datagrams(datagrams in vec(datagram(), 1..12), to_op: bool, steps in vec(0_u64..3_000_000, 12)) {
        let mut master = Master::new("shd17", |_| {});
        if to_op {
            master.enter_op();
        }
        for ((command, station, offset, data), step_ns) in datagrams.iter().zip(steps) {
            master.now_ns += step_ns;
            let [a, b] = station.to_le_bytes();
            let [c, d] = offset.to_le_bytes();
            let mut bytes = frame(&[(*command, 0, [a, b, c, d], data)]);
            let returned = master.drives.receive(&mut bytes, master.now_ns);
            prop_assert!(returned.is_some());
        }
    }

    #[test]
    fn any_mailbox(messages in vec((0_u8..8, vec(any::<u8>(), 0..122)), 1..8)) {
        let mut master = Master::new("shd17", |_| {});
        master.enter_pre_op();
        for (service, mut body) in messages {
            if body.len() > 1 {
                body[1] = body[1] & 0x0f | service << 4;
            }
            let mut message = vec![0; 128];
            message[..2].copy_from_slice(&(body.len() as u16).to_le_bytes());
            message[5] = 0x13;
            message[6..6 + body.len()].copy_from_slice(&body);
            let station = common::STATION.to_le_bytes();
            master.datagram(5, [station[0], station[1], 0x00, 0x10], &message);
            for _ in 0..3 {
                master.datagram(4, [station[0], station[1], 0x80, 0x10], &[0; 128]);
            }
        }
    }

    #[test]
    fn any_sdo(requests in vec((0_u8..=255, 0_usize..12, any::<u8>(), vec(any::<u8>(), 4..100)), 1..8), op: bool) {
        const INDICES: [u16; 12] = [
            0x1000, 0x1008, 0x1018, 0x1600, 0x1a00, 0x1c12, 0x1c13, 0x1c32, 0x6040, 0x6060, 0x607d, 0x60e4,
        ];
        let mut master = Master::new("shd17", |_| {});
        if op { master.enter_op() } else { master.enter_pre_op() }
        for (command, index, sub_index, data) in requests {
            let mut body = vec![0, 0x20, command];
            body.extend(INDICES[index].to_le_bytes());
            body.push(sub_index);
            body.extend(data);
            let mut message = vec![0; 128];
            message[..2].copy_from_slice(&(body.len() as u16).to_le_bytes());
            message[5] = 0x13;
            message[6..6 + body.len()].copy_from_slice(&body);
            let station = common::STATION.to_le_bytes();
            master.datagram(5, [station[0], station[1], 0x00, 0x10], &message);
            master.datagram(4, [station[0], station[1], 0x80, 0x10], &[0; 128]);
            // whatever was mapped, going up is refused or works
            master.datagram(5, [station[0], station[1], 0x20, 0x01], &[0x14, 0]);
            master.now_ns += 1_000_000;
        }
    }
}
