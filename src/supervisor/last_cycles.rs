//! The last cycles before a stop, as the loop hands them out: collected, and written as a recording beside the run's own.

use std::path::{Path, PathBuf};

use recording::{CycleRow, WriteError, Writer};
use robot::Robot;
use services::relay::{CycleMessages, record_row, recording_header};
use shm_types::bus::{Bus, BusError, Reader};
use shm_types::instance::RunConfig;
use shm_types::messages::{LastCycle, LoopState};
use shm_types::topics::{self, LAST_CYCLES_KEPT};

/// Collects what the loop hands out.
#[derive(Debug)]
pub struct LastCycles {
    reader: Reader<LastCycle>,
    session: u64,
    joint_count: usize,
    collected: Vec<LastCycle>,
    stops: usize,
}

impl LastCycles {
    /// Listens to the loop of a run.
    ///
    /// # Errors
    /// [`BusError`].
    pub fn open(bus: &Bus, run: &RunConfig) -> Result<Self, BusError> {
        Ok(Self {
            reader: bus.reader(&topics::LAST_CYCLES)?,
            session: run.session,
            joint_count: run.initial_position_rad.len(),
            collected: Vec::new(),
            stops: 0,
        })
    }

    /// Takes what has come. A stop whose last cycle is there gives its number, from 1, and its cycles.
    pub fn take(&mut self) -> Option<(usize, Vec<LastCycle>)> {
        while let Some(cycle) = self.reader.take() {
            let ours = cycle
                .status
                .header
                .check(self.session, self.joint_count)
                .is_ok()
                && (1..=LAST_CYCLES_KEPT as u32).contains(&cycle.count);
            if !ours {
                continue;
            }
            if cycle.index == 0 {
                self.collected.clear();
            }
            self.collected.push(cycle);
            if cycle.index + 1 >= cycle.count {
                self.stops += 1;
                return Some((self.stops, std::mem::take(&mut self.collected)));
            }
            // Whoever sends more than there are is not listened to for longer.
            self.collected.truncate(LAST_CYCLES_KEPT);
        }
        None
    }
}

/// Where the last cycles of a stop go: beside the recording, `NAME.stop1.mcap`.
pub fn stop_path(record: &Path, stop: usize) -> PathBuf {
    record.with_extension(format!("stop{stop}.mcap"))
}

/// Writes the cycles of one stop.
///
/// # Errors
/// [`WriteError`].
pub fn write(
    path: &Path,
    run: &RunConfig,
    robot: &Robot,
    cycles: &[LastCycle],
) -> Result<(), WriteError> {
    let mut header = recording_header(run, robot);
    if let Some(last) = cycles.last() {
        let state = LoopState::from_raw(last.status.state);
        let state = state.map_or("?".to_owned(), |state| format!("{state:?}"));
        header.metadata.insert("stopped_in".to_owned(), state);
        let code = last.status.fault.to_string();
        header.metadata.insert("fault_code".to_owned(), code);
    }
    let mut writer = Writer::create(path, &header)?;
    let (mut joints, mut truth) = (Vec::new(), Vec::new());
    for cycle in cycles {
        // A cycle without a measurement is a row without values.
        let messages = CycleMessages {
            cycle: cycle.status.header.cycle,
            sample: Some(if cycle.has_sample == 1 {
                cycle.sample
            } else {
                Default::default()
            }),
            command: (cycle.has_command == 1).then_some(cycle.command),
            estimate: None,
            status: Some(cycle.status),
            truth: None,
        };
        let loop_cycle = record_row(&messages, robot.joints.len(), &mut joints, &mut truth);
        writer.write_cycle(&CycleRow {
            cycle: messages.cycle,
            time_ns: messages.cycle.saturating_mul(run.period_ns),
            loop_cycle: loop_cycle.as_ref(),
            joints: &joints,
            truth: None,
        })?;
    }
    writer.finish()
}
