//! The relay as a process: records the run, sums it up, and serves observers, so that none of them touches the loop.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use realtime::clock::{monotonic_ns, sleep_until};
use realtime::grant::{Request, apply};
use recording::{CycleRow, JointCycle, JointTruth, WriteError, Writer as Recorder};
use robot::Robot;
use shm_types::bus::{Bus, BusError, Reader, Writer};
use shm_types::instance::{Instance, InstanceError, Mode, RunConfig};
use shm_types::messages::{
    Command, Heartbeat, LoopStatus, PlantTruth, SensorSample, TorqueEstimate,
};
use shm_types::topics::{self, Role};

use crate::answering::{heartbeat_now, take_over};
use crate::relay::{Assembler, CycleMessages, record_row, recording_header};
use crate::tracking::{TRACKING_REPORT_FILE, Tracking};

/// Between two looks at the topics, which hold more than a second of messages.
const POLL_NS: u64 = 1_000_000;
/// Between two heartbeats.
const BEAT_NS: u64 = 100_000_000;
/// A killed recorder loses at most what came since the last flush.
const FLUSH_NS: u64 = 500_000_000;

/// Why the relay cannot work.
#[derive(Debug, thiserror::Error)]
pub enum RelayError {
    /// The instance cannot be used.
    #[error(transparent)]
    Instance(#[from] InstanceError),
    /// The robot file cannot be used.
    #[error(transparent)]
    Robot(#[from] robot::RobotError),
    /// A topic cannot be opened.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The recording cannot be begun.
    #[error(transparent)]
    Recording(#[from] WriteError),
}

/// Relays until `stop` is set, then writes what is left and its report.
///
/// # Errors
/// [`RelayError`] if it cannot start. A recording that fails later ends; relaying goes on.
pub fn run(instance: &Instance, stop: &AtomicBool) -> Result<(), RelayError> {
    let run = instance.run_config()?;
    let robot = robot::load(&run.robot)?;
    let bus = Bus::join(instance)?;
    let mut relay = Relay::new(&bus, instance, run, &robot)?;
    let _held = (relay.run.mode == Mode::Realtime).then(|| {
        apply(&Request {
            fifo_priority: None,
            // Its system calls would hold up the loop's wake-up, even at the lowest priority.
            core: relay.run.core_of(Role::Relay),
            lock_memory: false,
            hold_dma_latency: false,
        })
    });
    let (mut beat_at_ns, mut flush_at_ns) = (0, monotonic_ns() + FLUSH_NS);
    while !stop.load(Ordering::Relaxed) {
        let moved = relay.drain();
        let now_ns = monotonic_ns();
        if now_ns >= beat_at_ns {
            relay.beat(now_ns);
            beat_at_ns = now_ns + BEAT_NS;
        }
        // In lockstep the chunks' ends are part of the bytes: there they depend on recorded time alone.
        if now_ns >= flush_at_ns && relay.run.mode == Mode::Realtime {
            relay.flush();
            flush_at_ns = now_ns + FLUSH_NS;
        }
        if !moved {
            sleep_until(now_ns + POLL_NS);
        }
    }
    relay.drain();
    relay.finish(instance)?;
    Ok(())
}

struct Relay {
    run: RunConfig,
    joint_count: usize,
    samples: Reader<SensorSample>,
    commands: Reader<Command>,
    estimates: Reader<TorqueEstimate>,
    statuses: Reader<LoopStatus>,
    truths: Reader<PlantTruth>,
    observed_sample: Writer<SensorSample>,
    observed_status: Writer<LoopStatus>,
    observed_estimate: Writer<TorqueEstimate>,
    progress: Writer<Heartbeat>,
    heartbeat: Writer<Heartbeat>,
    assembler: Assembler,
    tracking: Tracking,
    recorder: Option<Recorder>,
    recordings: Vec<String>,
    recording_error: Option<String>,
    recorded_rows: u64,
    lost_rows: u64,
    last_cycle: Option<u64>,
    joints: Vec<JointCycle>,
    truth: Vec<JointTruth>,
}

impl Relay {
    fn new(
        bus: &Bus,
        instance: &Instance,
        run: RunConfig,
        robot: &Robot,
    ) -> Result<Self, RelayError> {
        let mut recordings = Vec::new();
        let mut recorder = None;
        if let Some(path) = &run.record {
            let (path, earlier) = free_path(path, instance);
            recorder = Some(Recorder::create(&path, &recording_header(&run, robot))?);
            recordings = earlier;
            recordings.push(path.display().to_string());
        }
        Ok(Self {
            joint_count: robot.joints.len(),
            samples: bus.reader(&topics::SENSOR_SAMPLE)?,
            commands: bus.reader(&topics::COMMAND)?,
            estimates: bus.reader(&topics::TORQUE_ESTIMATE)?,
            statuses: bus.reader(&topics::LOOP_STATUS)?,
            truths: bus.reader(&topics::PLANT_TRUTH)?,
            observed_sample: take_over(bus, &topics::OBSERVED_SAMPLE)?,
            observed_status: take_over(bus, &topics::OBSERVED_STATUS)?,
            observed_estimate: take_over(bus, &topics::OBSERVED_ESTIMATE)?,
            progress: take_over(bus, &topics::RELAY_PROGRESS)?,
            heartbeat: take_over(bus, &Role::Relay.heartbeat())?,
            assembler: Assembler::default(),
            tracking: Tracking::new(robot),
            recorder,
            recordings,
            recording_error: None,
            recorded_rows: 0,
            lost_rows: 0,
            last_cycle: None,
            joints: Vec::new(),
            truth: Vec::new(),
            run,
        })
    }

    /// Takes every message that is there; `true` if there was any.
    fn drain(&mut self) -> bool {
        let (session, count) = (self.run.session, self.joint_count);
        let mut moved = false;
        // First what ends a cycle: whatever was sent before it is then there when the other topics are emptied.
        while let Some(status) = self.statuses.take() {
            self.observed_status.send_and_prepare(status);
            if status.header.check(session, count).is_ok() {
                self.assembler.add_status(status);
            }
        }
        while let Some(sample) = self.samples.take() {
            moved = true;
            self.observed_sample.send_and_prepare(sample);
            if sample.header.check(session, count).is_ok()
                && let Some(row) = self.assembler.row(sample.header.cycle)
            {
                row.sample = Some(sample);
            }
        }
        while let Some(command) = self.commands.take() {
            if command.header.check(session, count).is_ok()
                && let Some(row) = self.assembler.row(command.header.cycle)
            {
                row.command = Some(command);
            }
        }
        while let Some(estimate) = self.estimates.take() {
            self.observed_estimate.send_and_prepare(estimate);
            if estimate.header.check(session, count).is_ok()
                && let Some(row) = self.assembler.row(estimate.header.cycle)
            {
                row.estimate = Some(estimate);
            }
        }
        while let Some(truth) = self.truths.take() {
            if truth.header.check(session, count).is_ok()
                && let Some(row) = self.assembler.row(truth.header.cycle)
            {
                row.truth = Some(truth);
            }
        }
        while let Some(row) = self.assembler.next_due() {
            self.write(&row);
        }
        if moved && let Some(cycle) = self.last_cycle {
            self.progress
                .send_and_prepare(heartbeat_now(session, monotonic_ns(), cycle));
        }
        moved
    }

    fn write(&mut self, row: &CycleMessages) {
        self.lost_rows += self.last_cycle.map_or(0, |last| row.cycle - last - 1);
        self.last_cycle = Some(row.cycle);
        self.tracking.add(row);
        let Some(loop_cycle) = record_row(row, self.joint_count, &mut self.joints, &mut self.truth)
        else {
            return;
        };
        let Some(recorder) = &mut self.recorder else {
            return;
        };
        let written = recorder.write_cycle(&CycleRow {
            cycle: row.cycle,
            time_ns: row.cycle * self.run.period_ns,
            loop_cycle: Some(&loop_cycle),
            joints: &self.joints,
            truth: (!self.truth.is_empty()).then_some(self.truth.as_slice()),
        });
        match written {
            Ok(()) => self.recorded_rows += 1,
            Err(error) => self.end_recording(&error),
        }
    }

    fn flush(&mut self) {
        if let Some(recorder) = &mut self.recorder
            && let Err(error) = recorder.flush()
        {
            self.end_recording(&error);
        }
    }

    fn end_recording(&mut self, error: &WriteError) {
        eprintln!("flexspline: recording ended early: {error}");
        self.recording_error = Some(error.to_string());
        self.recorder = None;
    }

    fn beat(&mut self, now_ns: u64) {
        let cycle = self.last_cycle.unwrap_or(0);
        self.heartbeat
            .send_and_prepare(heartbeat_now(self.run.session, now_ns, cycle));
    }

    fn finish(mut self, instance: &Instance) -> Result<(), RelayError> {
        while let Some(row) = self.assembler.next_left() {
            self.write(&row);
        }
        if let Some(recorder) = self.recorder.take()
            && let Err(error) = recorder.finish()
        {
            self.end_recording(&error);
        }
        let mut report = self.tracking.report();
        report.recorded_rows = self.recorded_rows;
        report.lost_rows = self.lost_rows;
        report.late_messages = self.assembler.late_messages;
        report.refused_messages = self.assembler.refused_messages;
        report.recordings = self.recordings;
        report.recording_error = self.recording_error;
        instance.write_report(TRACKING_REPORT_FILE, &report)?;
        Ok(())
    }
}

/// The first part of the recording that this run has not begun yet, and the parts before it.
///
/// A relay that was killed has left a recording that can be read; its successor must not overwrite it. Which parts
/// belong to this run is noted in the instance's directory, so that a file of an earlier run does not count.
fn free_path(path: &Path, instance: &Instance) -> (PathBuf, Vec<String>) {
    let mut earlier = Vec::new();
    let mut part = 1;
    loop {
        let candidate = if part == 1 {
            path.to_owned()
        } else {
            path.with_extension(format!("part{part}.mcap"))
        };
        let begun = instance.file(&format!("recording-part{part}"));
        if std::fs::File::options()
            .write(true)
            .create_new(true)
            .open(begun)
            .is_ok()
        {
            return (candidate, earlier);
        }
        earlier.push(candidate.display().to_string());
        part += 1;
    }
}
