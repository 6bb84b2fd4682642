//! What a bus can carry: how long a joint's command and answer take on CAN-FD.

use std::time::Duration;

use moteus_protocol::CanFdFrame;

/// Before and after the data the bits come at this rate (moteus, protocol/can.md).
const ARBITRATION_BIT_S: f64 = 1e-6;
/// The data and its checksum come at this one (moteus, protocol/can.md).
const DATA_BIT_S: f64 = 0.2e-6;
/// Start, 11 identifier bits, RRS, IDE, FDF, res and BRS, and behind the checksum its delimiter, acknowledgement with
/// delimiter, 7 end bits and 3 of pause (ISO 11898-1:2015, 10.4.2).
const ARBITRATION_BITS: f64 = 17.0 + 13.0;
/// The same with an identifier of 29 bits, which a moteus needs for those above 0x7ff: SRR and 18 bits more.
const EXTENDED_BITS: f64 = 19.0;
/// ESI, 4 length bits, 4 of the stuff count (ISO 11898-1:2015, 10.4.2).
const DATA_HEAD_BITS: f64 = 9.0;
/// One stuff bit at most after each four (ISO 11898-1:2015, 10.5); half of that is reckoned with: data is not all alike.
const STUFFING: f64 = 1.125;
/// A moteus answers so long after the end of a query. Reckoned, not measured: its control runs at 15 to 30 kHz and frames
/// are looked at between two turns of it (fw/moteus.cc).
const ANSWER_S: f64 = 30e-6;
/// Part of a cycle that may be spent on the bus: the rest is for the sample to be used and for one frame to be sent again.
const SHARE_MAX: f64 = 0.9;

/// The largest identifier of a frame that is not extended.
const STANDARD_MAX: u32 = 0x7ff;

/// How long a frame of so many bytes is on the bus.
fn frame_s(id: u32, bytes: usize) -> f64 {
    let bytes = CanFdFrame::round_up_dlc(bytes);
    // 17 bits up to 16 bytes of data, 21 above, each with a fixed stuff bit after four
    let checksum_bits = if bytes <= 16 { 17.0 + 5.0 } else { 21.0 + 6.0 };
    let extended_bits = if id > STANDARD_MAX {
        EXTENDED_BITS
    } else {
        0.0
    };
    let arbitration_bits = ARBITRATION_BITS + extended_bits;
    let data_bits = DATA_HEAD_BITS + 8.0 * bytes as f64;
    arbitration_bits * STUFFING * ARBITRATION_BIT_S
        + (data_bits * STUFFING + checksum_bits) * DATA_BIT_S
}

/// How long the command for a drive and its answer take.
pub(crate) fn exchange(drive: u8, command_bytes: usize, answer_bytes: usize) -> Duration {
    let (command, answer) = (0x8000 | u32::from(drive), u32::from(drive) << 8);
    let on_bus_s = frame_s(command, command_bytes) + ANSWER_S + frame_s(answer, answer_bytes);
    Duration::from_secs_f64(on_bus_s)
}

/// Whether a cycle has room for these exchanges on one bus.
pub(crate) fn fits(on_bus: Duration, period_ns: u64) -> bool {
    on_bus.as_secs_f64() <= SHARE_MAX * period_ns as f64 * 1e-9
}

/// The fastest cycle that has room for these exchanges, in whole cycles a second.
pub(crate) fn rate_max_hz(on_bus: Duration) -> f64 {
    (SHARE_MAX / on_bus.as_secs_f64()).floor()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_takes_what_can_be_reckoned_by_hand() {
        // 49 bits of 1 us and 265 of 0.2 us with an eighth more for stuffing, and 27 of 0.2 us: 120.2 us; the answer has 30
        // bits of 1 us: 98.8 us
        let joint_us = exchange(1, 32, 32).as_secs_f64() * 1e6;
        assert!((joint_us - (120.2 + 30.0 + 98.8)).abs() < 0.2, "{joint_us}");
        // a short question and its answer are the 150 us that are often named
        let short_us = exchange(1, 8, 24).as_secs_f64() * 1e6;
        assert!((150.0..210.0).contains(&short_us), "{short_us}");
        // the answers of drives above 7 need the longer identifier
        assert!(exchange(8, 32, 32) > exchange(7, 32, 32));
    }

    #[test]
    fn the_rate_that_is_named_fits_and_the_next_does_not() {
        let on_bus = 7 * exchange(1, 32, 32);
        let most_hz = rate_max_hz(on_bus);
        assert!(fits(on_bus, (1e9 / most_hz) as u64));
        assert!(!fits(on_bus, (1e9 / (most_hz + 1.0)) as u64));
    }
}
