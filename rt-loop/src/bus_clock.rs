//! The loop follows the drives' clock, where they have one: its instants move until they stand where the bus wants them.
//!
//! Two crystals differ by tens of parts in a million: at 20 ppm a period of 667 µs drifts through itself in 33 s, and with
//! distributed clocks a frame that comes after the drives' instant is a lost one.

use shm_types::drive::{BusReport, ClockState};

/// Part of the offset that is made up for in a cycle. It lets the loop's own lateness, which is in each offset, even out over as
/// many cycles; a drift of 20 ppm leaves 16 times 13 ns.
const OFFSET_PARTS: i64 = 16;
/// Part of the period that an instant moves by at most in a cycle: what integrates over it need not know.
const STEP_PARTS: i64 = 1000;

/// By how much the loop's next instants move for what the bus said in this cycle; nothing while its clock is not locked.
pub fn step_ns(bus: &BusReport, period_ns: u64) -> i64 {
    if bus.clock != ClockState::Locked as u32 {
        return 0;
    }
    let most_ns = i64::try_from(period_ns).unwrap_or(i64::MAX) / STEP_PARTS;
    (bus.clock_offset_ns / OFFSET_PARTS).clamp(-most_ns, most_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 666_667;

    fn locked(clock_offset_ns: i64) -> BusReport {
        BusReport {
            clock: ClockState::Locked as u32,
            clock_offset_ns,
            ..BusReport::default()
        }
    }

    #[test]
    fn a_drifting_bus_is_followed_and_none_is_left_alone() {
        // The bus' clock is slow by 20 ppm and begins half a period away.
        let (mut offset_ns, mut fastest_ns) = (333_333.0_f64, 0);
        for _ in 0..3000 {
            let step = step_ns(&locked(offset_ns as i64), PERIOD_NS);
            fastest_ns = fastest_ns.max(step.abs());
            offset_ns += 20e-6 * PERIOD_NS as f64 - step as f64;
        }
        assert!(offset_ns.abs() < 250.0, "{offset_ns} ns");
        assert!(fastest_ns <= 666, "{fastest_ns} ns in a cycle");
        let mut lost = locked(1_000_000);
        lost.clock = ClockState::Lost as u32;
        assert_eq!(step_ns(&lost, PERIOD_NS), 0);
        assert_eq!(step_ns(&BusReport::default(), PERIOD_NS), 0);
    }

    #[test]
    fn offsets_that_cannot_be_move_nothing_far() {
        for offset_ns in [i64::MAX, i64::MIN] {
            assert!(step_ns(&locked(offset_ns), PERIOD_NS).abs() <= 666);
            assert!(step_ns(&locked(offset_ns), u64::MAX).abs() <= i64::MAX / STEP_PARTS);
        }
    }
}
