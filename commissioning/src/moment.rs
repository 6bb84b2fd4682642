//! What the loop and the drives are doing, as observers hear it.

use std::collections::VecDeque;

use shm_types::drive::DriveReport;
use shm_types::messages::{LoopState, LoopStatus, PerJoint, Readings, SensorSample};

/// Samples whose status has not come yet: a tenth of a second at 1.5 kHz. More means that nobody finishes cycles.
const WAITING_MAX: usize = 150;

/// One cycle, as far as it was heard.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    /// Time of the cycle's measurement.
    pub at_s: f64,
    /// What the loop is doing.
    pub state: LoopState,
    /// How each drive is.
    pub drives: DriveReport,
    /// What was sent to the drives, motor side.
    pub motor_torque_nm: PerJoint,
    /// Joints whose command was limited, one bit each.
    pub limited_joints: u64,
    /// What was measured; none where no sample of this cycle was heard.
    pub seen: Option<Seen>,
}

/// A measurement.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// As it came.
    pub readings: Readings,
    /// Where the trajectory stands.
    pub motion_time_s: f64,
}

/// Puts samples and statuses of the same cycle together.
#[derive(Debug, Default)]
pub struct Eyes {
    samples: VecDeque<SensorSample>,
}

impl Eyes {
    /// Keeps a sample until its status comes.
    pub fn take_sample(&mut self, sample: SensorSample) {
        if self.samples.len() == WAITING_MAX {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
    }

    /// The cycle that this status ends; `None` for a number that is no state.
    pub fn take_status(&mut self, status: &LoopStatus) -> Option<Moment> {
        let cycle = status.header.cycle;
        let mut seen = None;
        while let Some(sample) = self.samples.front().copied() {
            if sample.header.cycle > cycle {
                break;
            }
            self.samples.pop_front();
            if sample.header.cycle == cycle {
                seen = Some(Seen {
                    readings: sample.readings,
                    motion_time_s: sample.motion_time_ns as f64 * 1e-9,
                });
            }
        }
        Some(Moment {
            at_s: status.header.measured_at_ns as f64 * 1e-9,
            state: LoopState::from_raw(status.state)?,
            drives: status.drives,
            motor_torque_nm: status.motor_torque_nm,
            limited_joints: status.limited_joints,
            seen,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::messages::Header;

    fn header(cycle: u64) -> Header {
        Header {
            cycle,
            measured_at_ns: 1_000_000 * cycle,
            ..Header::default()
        }
    }

    fn sample(cycle: u64) -> SensorSample {
        SensorSample {
            header: header(cycle),
            motion_time_ns: 2_000_000 * cycle,
            ..SensorSample::default()
        }
    }

    fn status(cycle: u64, state: u32) -> LoopStatus {
        LoopStatus {
            header: header(cycle),
            state,
            ..LoopStatus::default()
        }
    }

    #[test]
    fn a_moment_has_the_sample_of_its_own_cycle_or_none() {
        let mut eyes = Eyes::default();
        for cycle in [3, 4, 6] {
            eyes.take_sample(sample(cycle));
        }
        let mut motion_s = |cycle| {
            let moment = eyes.take_status(&status(cycle, 2)).expect("a state");
            assert_eq!(moment.at_s, 1e-3 * cycle as f64);
            moment.seen.map(|seen| seen.motion_time_s)
        };
        assert_eq!(motion_s(4), Some(0.008));
        assert_eq!(motion_s(5), None);
        assert_eq!(motion_s(6), Some(0.012));
        assert!(eyes.take_status(&status(7, 99)).is_none());
    }

    #[test]
    fn samples_that_no_status_follows_are_not_kept_for_ever() {
        let mut eyes = Eyes::default();
        for cycle in 0..10_000 {
            eyes.take_sample(sample(cycle));
        }
        assert_eq!(eyes.samples.len(), WAITING_MAX);
    }
}
