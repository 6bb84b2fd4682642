//! The loop follows the drives' clock, where they have one (distributed clocks): a little of the way each cycle.

use shm_types::drive::{BusReport, ClockState};

/// Part of the way to the drives' clock that is gone in one cycle. Drives measure the way with the jitter of a frame, some ten
/// microseconds; a sixteenth of that is little beside the loop's own wake-up.
const SHARE: i64 = 16;
/// Longest step over the period: a cycle stays a cycle, for whoever differentiates. A whole period is gone in a hundred cycles.
const STEP_MAX_PARTS: i64 = 100;

/// By how much the next cycle begins later than a period after this one.
pub fn step_ns(bus: &BusReport, period_ns: u64) -> i64 {
    let follows = matches!(
        ClockState::from_raw(bus.clock),
        Some(ClockState::Locking | ClockState::Locked)
    );
    if !follows {
        return 0;
    }
    let most_ns = i64::try_from(period_ns).unwrap_or(i64::MAX) / STEP_MAX_PARTS;
    (bus.clock_offset_ns / SHARE).clamp(-most_ns, most_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 666_667;

    #[test]
    fn half_a_period_is_gone_without_a_long_cycle_and_a_drift_is_held() {
        let mut away_ns = PERIOD_NS as i64 / 2;
        for _ in 0..400 {
            let bus = BusReport {
                clock: ClockState::Locking as u32,
                clock_offset_ns: away_ns,
                ..BusReport::default()
            };
            let step_ns = step_ns(&bus, PERIOD_NS);
            assert!(step_ns.abs() <= PERIOD_NS as i64 / 100);
            // drives whose clock is 80 ppm fast
            away_ns += -step_ns - 53;
        }
        assert!(away_ns.abs() < 1000, "{away_ns} ns");
    }

    #[test]
    fn offsets_that_cannot_be_move_nothing_far() {
        for clock_offset_ns in [i64::MAX, i64::MIN] {
            let bus = BusReport {
                clock: ClockState::Locked as u32,
                clock_offset_ns,
                ..BusReport::default()
            };
            assert!(step_ns(&bus, PERIOD_NS).abs() <= PERIOD_NS as i64 / STEP_MAX_PARTS);
            assert!(step_ns(&bus, u64::MAX).abs() <= i64::MAX / STEP_MAX_PARTS);
        }
    }

    #[test]
    fn drives_without_a_clock_are_not_followed() {
        for clock in [ClockState::None as u32, ClockState::Lost as u32, 77] {
            let bus = BusReport {
                clock,
                clock_offset_ns: i64::MIN,
                ..BusReport::default()
            };
            assert_eq!(step_ns(&bus, PERIOD_NS), 0);
        }
    }
}
