//! `simulate`: the recording that the nominal model makes of the same reference.

use std::ops::Range;
use std::path::Path;

use motion::{SampledJoint, SampledReference, Trajectory};
use recording::{CycleRow, Header, Recording, Signal, Writer};
use robot::Robot;
use rt_loop::config::ENABLING_NS;
use services::relay::{record_row, recorded_control, recording_header};
use shm_types::instance::{Mode, RunConfig, Wait};
use shm_types::messages::{LoopState, LoopStatus};
use twin::TwinError;

use super::{cannot_write, read};
use crate::cli::RecordingSimulateArguments;
use crate::error::CliError;
use crate::output::{print, write_whole};

/// The plant that the twin's recording says it has.
const PLANT: &str = "nominal";

/// Follows the recording's reference with the nominal model and records that.
///
/// # Errors
/// [`CliError::Input`] if there is no reference to follow, [`CliError::Negative`] if the twin stops for safety.
pub fn simulate(arguments: &RecordingSimulateArguments) -> Result<(), CliError> {
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    let table = read(&arguments.file, arguments.mapping.as_deref())?;
    let followed = Followed {
        robot: &robot,
        robot_name: &arguments.robot,
        table: &table,
        file: &arguments.file,
        seed: arguments.seed,
    };
    let mut rows = 0;
    write_whole(&arguments.out, |unfinished| {
        rows = followed.record(unfinished, &arguments.out, &|| true)?;
        Ok(())
    })?;
    print(&format!(
        "{}: {rows} rows of the nominal model of `{}`\n",
        arguments.out.display(),
        robot.name
    ))
}

/// A recording whose reference the nominal model follows.
#[derive(Clone, Copy, Debug)]
pub struct Followed<'a> {
    /// Whose model it is.
    pub robot: &'a Robot,
    /// As the new recording names it.
    pub robot_name: &'a str,
    /// With a reference of every joint.
    pub table: &'a Recording,
    /// What errors call the recording.
    pub file: &'a Path,
    /// Of the sensors' noise.
    pub seed: u64,
}

impl Followed<'_> {
    /// The model's recording, in memory. It is given up once it is not wanted any more.
    ///
    /// # Errors
    /// [`CliError::Input`] if there is no reference to follow, [`CliError::Negative`] if the twin stops for safety.
    pub fn simulated(&self, is_wanted: &dyn Fn() -> bool) -> Result<Recording, CliError> {
        let folder = tempfile::tempdir().map_err(CliError::input)?;
        let path = folder.path().join("simulated.mcap");
        self.record(&path, &path, is_wanted)?;
        read(&path, None)
    }

    /// Writes it and counts its rows; `out` is what errors call it.
    fn record(
        &self,
        path: &Path,
        out: &Path,
        is_wanted: &dyn Fn() -> bool,
    ) -> Result<u64, CliError> {
        let refuse = |reason: String| CliError::Input(format!("{}: {reason}", self.file.display()));
        let runs: Vec<Run> = self
            .table
            .segments()
            .into_iter()
            .map(|rows| Run::new(self.table, rows, self.robot))
            .collect::<Result<_, _>>()
            .map_err(refuse)?;
        if runs.is_empty() {
            return Err(refuse("holds no row to follow".to_owned()));
        }
        let twin = Twin {
            robot: self.robot,
            config: self.config(),
            every: cycles_per_row(self.table, self.robot),
            is_wanted,
        };
        twin.record(runs, path, out)
    }

    fn config(&self) -> RunConfig {
        let (control, options) = recorded_control(&self.table.metadata);
        let rate_hz = self.table.sample_rate_hz * cycles_per_row(self.table, self.robot) as f64;
        let period_ns = (1e9 / rate_hz).round() as u64;
        RunConfig {
            session: 1,
            robot: self.robot_name.to_owned(),
            driver: "emulator".to_owned(),
            trajectory: self.file.display().to_string(),
            plant: None,
            control,
            options,
            estimators: Vec::new(),
            mode: Mode::Lockstep,
            period_ns,
            cycles: 0,
            wait: Wait::Block,
            wake_early_ns: 0,
            seed: self.seed,
            inject: None,
            record: None,
            command_deadline_ns: period_ns,
            cores: Vec::new(),
            initial_position_rad: Vec::new(),
        }
    }
}

/// The loop runs at the multiple of the recording's rate that is nearest to the robot's own.
fn cycles_per_row(table: &Recording, robot: &Robot) -> u64 {
    let own_hz = robot.control.as_ref().map(|control| control.rate_hz);
    let multiple = own_hz.map_or(1.0, |own_hz| own_hz / table.sample_rate_hz);
    (multiple.round() as u64).max(1)
}

/// One trajectory of the recording.
struct Run {
    segment: Option<i64>,
    start_s: f64,
    reference: SampledReference,
}

impl Run {
    fn new(table: &Recording, rows: Range<usize>, robot: &Robot) -> Result<Self, String> {
        let mut columns = Vec::new();
        for joint in &robot.joints {
            let reference = table.signal(&joint.name, Signal::ReferencePositionRad);
            columns.push(reference.map_err(|missing| {
                format!("{missing}; a twin needs the reference of every joint of the robot")
            })?);
        }
        let first_row = rows.start;
        let rows: Vec<usize> = whole_rows(table, rows, &columns);
        let (Some(&first), Some(&last)) = (rows.first(), rows.last()) else {
            return Err(format!(
                "no row of the trajectory from {} s on has the reference of every joint",
                table.time_s[first_row]
            ));
        };
        if first == last {
            return Err(format!(
                "only one row of the trajectory from {} s on has the reference of every joint; at least 2 are needed",
                table.time_s[first]
            ));
        }
        let start_s = table.time_s[first];
        let joints = robot.joints.iter().zip(columns).map(|(joint, column)| {
            let velocity = table
                .signal(&joint.name, Signal::ReferenceVelocityRadS)
                .ok();
            SampledJoint {
                positions_rad: rows.iter().map(|row| column[*row]).collect(),
                end_velocities_rad_s: [
                    velocity_at(table, column, velocity, [rows[0], rows[1]], first),
                    velocity_at(table, column, velocity, [rows[rows.len() - 2], last], last),
                ],
            }
        });
        Ok(Self {
            segment: table.segment.as_ref().map(|segment| segment[first]),
            start_s,
            reference: SampledReference {
                joints: joints.collect(),
                times_s: rows
                    .iter()
                    .map(|row| table.time_s[*row] - start_s)
                    .collect(),
            },
        })
    }

    fn duration_s(&self) -> f64 {
        self.reference.times_s.last().copied().unwrap_or_default()
    }
}

/// Rows that have every joint's reference, the first of each time.
fn whole_rows(table: &Recording, rows: Range<usize>, columns: &[&[f64]]) -> Vec<usize> {
    let mut whole: Vec<usize> = rows
        .filter(|row| columns.iter().all(|column| !column[*row].is_nan()))
        .collect();
    whole.dedup_by(|later, row| table.time_s[*later] == table.time_s[*row]);
    whole
}

/// The reference's velocity where it is recorded, else what the two positions at that end show.
fn velocity_at(
    table: &Recording,
    position: &[f64],
    velocity: Option<&[f64]>,
    [before, after]: [usize; 2],
    at: usize,
) -> f64 {
    let recorded = velocity.map(|velocity| velocity[at]);
    recorded
        .filter(|velocity| !velocity.is_nan())
        .unwrap_or_else(|| {
            (position[after] - position[before]) / (table.time_s[after] - table.time_s[before])
        })
}

struct Twin<'a> {
    robot: &'a Robot,
    config: RunConfig,
    /// Cycles of the loop per row of the recording.
    every: u64,
    is_wanted: &'a dyn Fn() -> bool,
}

impl Twin<'_> {
    /// Records all runs into one file and counts its rows; `out` is what errors call it.
    fn record(&self, runs: Vec<Run>, path: &Path, out: &Path) -> Result<u64, CliError> {
        let mut header: Header = recording_header(&self.config, self.robot);
        header.metadata.insert("plant".to_owned(), PLANT.to_owned());
        header.sample_rate_hz = 1e9 / (self.config.period_ns * self.every) as f64;
        let mut writer = Writer::create(path, &header).map_err(|error| cannot_write(out, error))?;
        let mut rows = 0;
        for run in runs {
            self.record_run(run, &mut writer, &mut rows, out)?;
        }
        writer.finish().map_err(|error| cannot_write(out, error))?;
        Ok(rows)
    }

    fn record_run(
        &self,
        run: Run,
        writer: &mut Writer,
        rows: &mut u64,
        out: &Path,
    ) -> Result<(), CliError> {
        let row_ns = self.config.period_ns * self.every;
        let start_ns = (run.start_s * 1e9).round().max(0.0) as u64;
        let segment = run.segment;
        let last_row = (run.duration_s() * 1e9 / row_ns as f64).round() as u64;
        let last_cycle = last_row * self.every;
        let config = RunConfig {
            // within this the drives are enabled, or the loop stops for safety
            cycles: last_cycle + 1 + ENABLING_NS / self.config.period_ns,
            initial_position_rad: run
                .reference
                .joints
                .iter()
                .map(|joint| joint.positions_rad[0])
                .collect(),
            ..self.config.clone()
        };
        let trajectory = Trajectory::sampled(run.reference, self.robot).map_err(CliError::input)?;
        let (mut joints, mut truth) = (Vec::new(), Vec::new());
        let mut written = Ok(());
        // what was recorded begins with the motion or stands first; the twin's drives are enabled before either
        let mut enabled = None;
        twin::simulate_nominal(&config, self.robot, trajectory, |messages| {
            let is_running = |status: &LoopStatus| status.state == LoopState::Running as u32;
            if enabled.is_none() && messages.status.as_ref().is_some_and(is_running) {
                enabled = Some(messages.cycle);
            }
            let Some(cycle) = enabled.map(|enabled| messages.cycle - enabled) else {
                return true;
            };
            if !cycle.is_multiple_of(self.every) {
                return true;
            }
            let loop_cycle = record_row(messages, self.robot.joints.len(), &mut joints, &mut truth);
            joints.iter_mut().for_each(|joint| joint.segment = segment);
            written = writer.write_cycle(&CycleRow {
                cycle: *rows,
                time_ns: start_ns + cycle / self.every * row_ns,
                loop_cycle: loop_cycle.as_ref(),
                joints: &joints,
                truth: Some(&truth),
            });
            *rows += 1;
            written.is_ok() && cycle < last_cycle && (self.is_wanted)()
        })
        .map_err(|error| match error {
            stop @ TwinError::SafeStop { .. } => CliError::Negative(stop.to_string()),
            input => CliError::input(input),
        })?;
        written.map_err(|error| cannot_write(out, error))
    }
}
