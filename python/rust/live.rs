//! A running robot: its rows as they come, and what a watch says of rows.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use flexspline::library::{CliError, Feed};
use gap_diagnosis::watch::Settings;
use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use recording::{JointCycle, Signal};
use services::relay::{CycleMessages, record_row};
use shm_types::messages::LoopState;

use crate::errors::{input, raised};
use crate::robot::Robot;
use crate::work::detached;

/// Between two looks at the topics, which hold 43 ms of messages.
const POLL: Duration = Duration::from_millis(10);
/// Batches of a [`POLL`] that wait for a reader that is busy: a minute's.
const WAITING_MAX: usize = 6000;
/// What stands in a row before its joints' signals: cycle and state as integers' bits, and time.
const BEFORE_JOINTS: usize = 3;

/// An observer of a running instance. A thread takes rows as they come, so that none is lost while Python is busy.
#[pyclass(frozen, module = "flexspline._native")]
pub struct Attachment {
    joints: Vec<String>,
    sample_rate_hz: f64,
    robot: String,
    rows: Mutex<Receiver<Vec<f64>>>,
    thread: Mutex<Option<JoinHandle<()>>>,
    shared: Arc<Shared>,
}

/// Between the thread and whoever reads.
#[derive(Default)]
struct Shared {
    is_closed: AtomicBool,
    lost: AtomicU64,
}

/// What the thread says once it has joined.
struct Joined {
    joints: Vec<String>,
    sample_rate_hz: f64,
    robot: String,
}

#[pymethods]
impl Attachment {
    #[new]
    fn new(py: Python<'_>, name: &str) -> PyResult<Self> {
        let shared = Arc::new(Shared::default());
        let (joined, has_joined) = sync_channel(1);
        let (rows, taken) = sync_channel(WAITING_MAX);
        let own = shared.clone();
        let instance = name.to_owned();
        let thread = std::thread::Builder::new()
            .name("flexspline".to_owned())
            .spawn(move || observe(&instance, &joined, &rows, &own))
            .map_err(input)?;
        let joined = py
            .detach(move || has_joined.recv())
            .map_err(|_| input("the observer ended before it had joined"))?
            .map_err(raised)?;
        Ok(Self {
            joints: joined.joints,
            sample_rate_hz: joined.sample_rate_hz,
            robot: joined.robot,
            rows: Mutex::new(taken),
            thread: Mutex::new(Some(thread)),
            shared,
        })
    }

    #[getter]
    fn joints(&self) -> Vec<String> {
        self.joints.clone()
    }

    #[getter]
    fn sample_rate_hz(&self) -> f64 {
        self.sample_rate_hz
    }

    /// Name or path of the robot that runs.
    #[getter]
    fn robot(&self) -> &str {
        &self.robot
    }

    /// Rows that came while a minute's waited already.
    #[getter]
    fn lost(&self) -> u64 {
        self.shared.lost.load(Ordering::Relaxed)
    }

    /// The next rows; `None` once the run has ended. Ctrl-C ends the wait.
    fn next_rows<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        loop {
            let next = py.detach(|| {
                let rows = self.rows.lock().unwrap_or_else(PoisonError::into_inner);
                rows.recv_timeout(5 * POLL)
            });
            match next {
                Ok(rows) => {
                    let width = BEFORE_JOINTS + Signal::ALL.len() * self.joints.len();
                    let array = numpy::PyArray1::from_vec(py, rows);
                    let count = array.len() / width;
                    return Ok(Some(array.reshape([count, width])?));
                }
                Err(RecvTimeoutError::Timeout) => py.check_signals()?,
                Err(RecvTimeoutError::Disconnected) => return Ok(None),
            }
        }
    }

    /// Leaves the instance.
    fn close(&self, py: Python<'_>) {
        self.shared.is_closed.store(true, Ordering::Relaxed);
        let mut thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(thread) = thread.take() {
            // a thread that panicked has left too
            let _ = py.detach(|| thread.join());
        }
    }
}

impl Drop for Attachment {
    fn drop(&mut self) {
        self.shared.is_closed.store(true, Ordering::Relaxed);
    }
}

/// Joins, says so, and hands over rows until the run ends or nobody wants them.
fn observe(
    name: &str,
    joined: &SyncSender<Result<Joined, CliError>>,
    rows: &SyncSender<Vec<f64>>,
    shared: &Shared,
) {
    let (mut feed, run, robot) = match Feed::attach(name) {
        Ok(attached) => attached,
        Err(error) => {
            // the one who asked is still there: it waits
            let _ = joined.send(Err(error));
            return;
        }
    };
    let names = robot.joint_names().into_iter().map(str::to_owned);
    let _ = joined.send(Ok(Joined {
        joints: names.collect(),
        sample_rate_hz: 1e9 / run.period_ns as f64,
        robot: run.robot.clone(),
    }));
    let mut table = Table {
        period_ns: run.period_ns,
        joints: robot.joints.len(),
        row: Vec::new(),
        truth: Vec::new(),
    };
    loop {
        let mut batch = Vec::new();
        let mut count = 0;
        let goes_on = feed.drain(|cycle| {
            count += u64::from(table.add(&cycle, &mut batch));
            true
        });
        if count > 0 {
            match rows.try_send(batch) {
                Ok(()) => {}
                Err(TrySendError::Full(_)) => {
                    shared.lost.fetch_add(count, Ordering::Relaxed);
                }
                Err(TrySendError::Disconnected(_)) => return,
            }
        }
        if !goes_on || shared.is_closed.load(Ordering::Relaxed) {
            return;
        }
        std::thread::sleep(POLL);
    }
}

/// Cycles as rows of numbers.
struct Table {
    period_ns: u64,
    joints: usize,
    row: Vec<JointCycle>,
    truth: Vec<recording::JointTruth>,
}

impl Table {
    /// Adds the cycle, if anything was measured in it.
    fn add(&mut self, cycle: &CycleMessages, batch: &mut Vec<f64>) -> bool {
        let measured = record_row(cycle, self.joints, &mut self.row, &mut self.truth);
        if measured.is_none() {
            return false;
        }
        let is_running = |state: u32| state == LoopState::Running as u32;
        let running = cycle.status.is_some_and(|status| is_running(status.state));
        batch.push(f64::from_bits(cycle.cycle));
        batch.push(f64::from_bits(u64::from(running)));
        batch.push((cycle.cycle * self.period_ns) as f64 * 1e-9);
        for signal in Signal::ALL {
            let values = self.row.iter().map(|joint| joint.get(signal));
            batch.extend(values.map(|value| value.unwrap_or(f64::NAN)));
        }
        true
    }
}

/// Says when a gap appears.
#[pyclass(module = "flexspline._native")]
pub struct Watch {
    inner: gap_diagnosis::watch::Watch,
    joints: usize,
}

#[pymethods]
impl Watch {
    #[new]
    fn new(robot: &Robot, sample_rate_hz: f64, window_s: f64, between_false_s: f64) -> Self {
        let settings = Settings {
            window_s,
            between_false_s,
        };
        Self {
            inner: gap_diagnosis::watch::Watch::new(robot.built.clone(), sample_rate_hz, settings),
            joints: robot.built.joints.len(),
        }
    }

    /// Takes rows, each its time and every joint's signals, signal by signal; what it found out, as JSON.
    fn push(
        &mut self,
        py: Python<'_>,
        rows: PyReadonlyArray2<'_, f64>,
        threads: Option<usize>,
    ) -> PyResult<Vec<String>> {
        let rows = rows.as_array().to_owned();
        let joints = self.joints;
        let inner = &mut self.inner;
        let events = detached(py, threads, None, move |_| {
            let mut events = Vec::new();
            for row in rows.rows() {
                let mut cells = vec![JointCycle::default(); joints];
                for (k, signal) in Signal::ALL.into_iter().enumerate() {
                    for (joint, cell) in cells.iter_mut().enumerate() {
                        let value = row[1 + k * joints + joint];
                        cell.set(signal, (!value.is_nan()).then_some(value));
                    }
                }
                events.extend(inner.push(row[0], &cells)?);
            }
            Ok::<_, gap_diagnosis::DiagnoseError>(events)
        })?;
        let events = events.map_err(input)?;
        let told = events.iter().map(serde_json::to_string);
        told.collect::<Result<_, _>>().map_err(input)
    }
}
