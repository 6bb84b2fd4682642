//! Lines and frames of any kind: nothing panics, hangs or makes a torque that is no number.
#![allow(clippy::unwrap_used, reason = "a test may")]

use moteus_emulator::fdcanusb::{Adapter, Frame, Request, crc8};
use moteus_emulator::{Bench, Setup};
use proptest::prelude::*;

fn bench() -> Bench {
    let robot = robot::load("shd17").unwrap();
    let setup = Setup {
        initial_position_rad: vec![0.0],
        buses: 1,
        is_homed: true,
        seed: 1,
        faults: vec![
            "lost:1/0.1@0s".parse().unwrap(),
            "doubled:1/0.1@0s".parse().unwrap(),
        ],
    };
    Bench::new(&robot, &setup).unwrap()
}

/// Lines that begin right and go wrong somewhere, and lines of nothing but bytes.
fn line() -> impl Strategy<Value = Vec<u8>> {
    let bytes = prop::collection::vec(any::<u8>(), 0..200);
    let near = "can (send|std|ext|status) ?(8001|0001|807f|[0-9a-fA-F]{0,9}) ?[0-9a-fA-F]{0,140}( [bBfFeErR]{0,3})?( \\*[0-9A-F]{2})?";
    prop_oneof![bytes, near.prop_map(String::into_bytes)]
}

/// Frames made of subframes that are mostly right, or of bytes.
fn data() -> impl Strategy<Value = Vec<u8>> {
    let kind = prop_oneof![
        0u8..0x20,
        Just(0x40),
        Just(0x42),
        Just(0x44),
        Just(0x50),
        any::<u8>()
    ];
    let register = prop_oneof![0u8..0x60, any::<u8>()];
    let part = (
        kind,
        prop_oneof![Just(None), register.prop_map(Some)],
        prop::collection::vec(any::<u8>(), 0..12),
    );
    prop::collection::vec(part, 0..6).prop_map(|parts| {
        let mut data = Vec::new();
        for (kind, register, bytes) in parts {
            data.push(kind);
            data.extend(register);
            data.extend(bytes);
        }
        data.truncate(64);
        data
    })
}

/// Diagnostic text, cut into frames.
fn words() -> impl Strategy<Value = String> {
    let word = prop_oneof![
        "(conf|tel|d)",
        "(get|set|enumerate|list|write|load|default|schema|rate|fmt|stop|text|pos|tmt|zero|within|dq|exact|nearest|cfg-set-output|reset|brake)",
        "(servo|id|motor_position|servopos)\\.[a-z_.]{0,20}",
        "(servo_stats|firmware|git)",
        "[pdisftavb]?-?[0-9]{0,6}(\\.[0-9]{0,3})?(e[0-9]{1,3})?",
        "(nan|inf|-inf)",
        "\\PC{0,8}",
    ];
    prop::collection::vec(word, 0..8).prop_map(|words| words.join(" "))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

/// The bench still answers, and the joint is somewhere.
fn check(bench: &mut Bench, now_ns: u64) -> Result<(), TestCaseError> {
    bench.advance_to(now_ns);
    let mut out = Vec::new();
    bench.read(0, now_ns, &mut out);
    for answer in out
        .split(|byte| *byte == b'\n')
        .filter(|answer| !answer.is_empty())
    {
        prop_assert!(answer.len() < 180, "{} bytes", answer.len());
        let known = [&b"OK"[..], b"ERR ", b"rcv ", b"lec="]
            .iter()
            .any(|word| answer.starts_with(word));
        prop_assert!(known, "{}", String::from_utf8_lossy(answer));
    }
    prop_assert!(bench.link_position_rad(0).is_finite());
    Ok(())
}

proptest! {
    #[test]
    fn lines(lines in prop::collection::vec(line(), 1..8)) {
        let mut bench = bench();
        for (index, line) in lines.iter().enumerate() {
            bench.take_line(0, index as u64 * 1_000_000, line);
        }
        check(&mut bench, 20_000_000)?;
    }

    #[test]
    fn frames(frames in prop::collection::vec(data(), 1..8)) {
        let mut bench = bench();
        for (index, data) in frames.iter().enumerate() {
            let line = format!("can send 8001 {}", hex(data));
            bench.take_line(0, index as u64 * 5_000_000, line.as_bytes());
        }
        check(&mut bench, 60_000_000)?;
    }

    #[test]
    fn diagnostics(texts in prop::collection::vec(words(), 1..6)) {
        let mut bench = bench();
        let text = texts.join("\n") + "\n";
        for (index, piece) in text.as_bytes().chunks(60).enumerate() {
            let mut data = vec![0x40, 1, piece.len() as u8];
            data.extend(piece);
            let line = format!("can send 8001 {}", hex(&data));
            bench.take_line(0, index as u64 * 5_000_000, line.as_bytes());
        }
        check(&mut bench, 100_000_000)?;
    }

    #[test]
    fn a_frame_that_is_written_is_the_one_that_is_read(id in 0u32..1 << 29, bytes in prop::collection::vec(any::<u8>(), 0..=64)) {
        let frame = Frame { id, data: bytes.iter().copied().collect() };
        let mut out = Vec::new();
        let mut adapter = Adapter::default();
        adapter.write_frame(&frame, &mut out);
        let text = String::from_utf8(out).unwrap();
        let sent = text.trim_end().replacen("rcv", "can send", 1);
        let crc = crc8(format!("{sent} ").as_bytes());
        let read = adapter.read(format!("{sent} *{crc:02X}").as_bytes());
        // a frame without data has no second word
        prop_assert_eq!(read.ok().flatten().is_some(), !bytes.is_empty());
        if !bytes.is_empty() {
            prop_assert_eq!(adapter.read(format!("{sent} *{crc:02X}").as_bytes()), Ok(Some(Request::Send(frame))));
        }
    }
}
