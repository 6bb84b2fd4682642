//! `flexspline monitor`: a live view of a running instance, from outside.
//!
//! It reads what the relay hands on to observers, and the list of processes the supervisor writes; its orders go to the
//! supervisor. Nothing of it touches the loop, a service, or their core.

mod console;
mod keys;
mod screen;
mod snapshot;
mod view;

use std::io::IsTerminal;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ratatui::backend::TestBackend;
use ratatui::crossterm::event::{self, Event};
use ratatui::{DefaultTerminal, Terminal};
use realtime::clock::monotonic_ns;
use realtime::grant::{Request, apply};
use realtime::process::user_id;
use shm_types::bus::{Bus, BusError, Reader};
use shm_types::instance::{Instance, RunConfig};
use shm_types::messages::{LoopStatus, SensorSample, TorqueEstimate};
use shm_types::roster;
use shm_types::topics::{self, Role};

use crate::cli::MonitorArguments;
use crate::error::CliError;
use crate::output::{print, write_json};
use crate::run::stop_on_signals;
use console::Console;
use keys::{Action, Keys};
use snapshot::Snapshot;
use view::View;

/// Between two looks at the topics, which hold 43 ms of messages.
const POLL: Duration = Duration::from_millis(15);
/// Between two pictures.
const DRAW_NS: u64 = 100_000_000;
/// Between two looks at the list of processes.
const ROSTER_NS: u64 = 500_000_000;
/// Columns of a picture that is printed.
const PRINTED_COLUMNS: u16 = 132;

/// Shows a running instance.
///
/// # Errors
/// [`CliError::Input`] if there is no such instance, [`CliError::Negative`] if nothing comes from it.
pub fn monitor(arguments: &MonitorArguments) -> Result<(), CliError> {
    let instance = Instance::new(&arguments.instance, user_id()).map_err(CliError::input)?;
    if !arguments.once && !std::io::stdout().is_terminal() {
        return Err(CliError::Input(
            "monitor: standard output is no terminal; use --once, or --once --json -".to_owned(),
        ));
    }
    let run = running(&instance)?;
    stay_off_the_loops_core(&run);
    let robot = robot::load(&run.robot).map_err(CliError::input)?;
    let mut feed = Feed::join(&instance, &run)?;
    let mut view = View::new(instance.name(), run.clone(), robot);
    if arguments.once {
        listen(&mut feed, &mut view, arguments.listen);
        return show_once(&view.snapshot(monotonic_ns()), arguments.json.as_deref());
    }
    let stop = stop_on_signals()?;
    let mut console = Console::join(&feed.bus, run.session);
    let ended = ratatui::run(|terminal| watch(terminal, &mut feed, &mut view, &mut console, &stop));
    let ended = ended
        .map_err(|error| CliError::Negative(format!("monitor: the terminal failed: {error}")))?;
    if ended {
        print(&format!("instance `{}` has ended\n", instance.name()))?;
    }
    Ok(())
}

/// The settings of the run; there are none where nothing runs.
///
/// # Errors
/// [`CliError::Input`] with the instances there are.
pub fn running(instance: &Instance) -> Result<RunConfig, CliError> {
    instance.run_config().map_err(|_| {
        let names = Instance::names(user_id());
        let others = match names.as_slice() {
            [] => "none of yours does".to_owned(),
            names => format!("there are: {}", names.join(", ")),
        };
        CliError::Input(format!(
            "no instance `{}` is running; {others}; start one with `flexspline run --instance {0}`, or name another with \
             --instance",
            instance.name()
        ))
    })
}

/// System calls on the loop's core would hold up its wake-up, even those of an ordinary process.
pub fn stay_off_the_loops_core(run: &RunConfig) {
    apply(&Request {
        fifo_priority: None,
        core: run.core_of(Role::Relay),
        lock_memory: false,
        hold_dma_latency: false,
    });
}

/// What an observer hears.
struct Feed {
    instance: Instance,
    session: u64,
    bus: Bus,
    statuses: Reader<LoopStatus>,
    samples: Reader<SensorSample>,
    estimates: Reader<TorqueEstimate>,
    roster_at_ns: u64,
}

impl Feed {
    fn join(instance: &Instance, run: &RunConfig) -> Result<Self, CliError> {
        let bus = Bus::join(instance).map_err(CliError::input)?;
        let full = |error: BusError| {
            CliError::Input(format!(
                "{error}; the relay serves {} readers at a time, the supervisor among them: close one",
                topics::OBSERVED_STATUS.readers_max
            ))
        };
        Ok(Self {
            instance: instance.clone(),
            session: run.session,
            statuses: bus.reader(&topics::OBSERVED_STATUS).map_err(full)?,
            samples: bus.reader(&topics::OBSERVED_SAMPLE).map_err(full)?,
            estimates: bus.reader(&topics::OBSERVED_ESTIMATE).map_err(full)?,
            bus,
            roster_at_ns: 0,
        })
    }

    /// Takes everything that is there; `false` once the run has ended.
    fn drain(&mut self, view: &mut View) -> bool {
        let now_ns = monotonic_ns();
        while let Some(status) = self.statuses.take() {
            view.add_status(&status, now_ns);
        }
        while let Some(sample) = self.samples.take() {
            view.add_sample(&sample);
        }
        while let Some(estimate) = self.estimates.take() {
            view.add_estimate(&estimate);
        }
        if now_ns < self.roster_at_ns {
            return true;
        }
        self.roster_at_ns = now_ns + ROSTER_NS;
        if let Ok(members) = roster::read(&self.instance) {
            view.set_members(members);
        }
        self.instance
            .run_config()
            .is_ok_and(|run| run.session == self.session)
    }
}

fn listen(feed: &mut Feed, view: &mut View, duration: Duration) {
    let until_ns = monotonic_ns().saturating_add(duration.as_nanos() as u64);
    while feed.drain(view) && monotonic_ns() < until_ns {
        std::thread::sleep(POLL);
    }
}

fn show_once(snapshot: &Snapshot, json: Option<&Path>) -> Result<(), CliError> {
    match json {
        Some(path) => write_json(snapshot, path)?,
        None => print(&picture(snapshot)?)?,
    }
    match snapshot.heard {
        true => Ok(()),
        false => Err(CliError::Negative(format!(
            "nothing came from instance `{}`; its loop or relay is not running yet, or any more",
            snapshot.instance
        ))),
    }
}

/// The screen as text.
fn picture(snapshot: &Snapshot) -> Result<String, CliError> {
    let backend = TestBackend::new(PRINTED_COLUMNS, screen::rows_wanted(snapshot));
    let mut terminal = Terminal::new(backend).map_err(CliError::input)?;
    terminal
        .draw(|frame| screen::draw(frame, snapshot, ""))
        .map_err(CliError::input)?;
    let buffer = terminal.backend().buffer();
    let columns = usize::from(buffer.area.width);
    let line = |cells: &[ratatui::buffer::Cell]| {
        let text: String = cells.iter().map(|cell| cell.symbol()).collect();
        text.trim_end().to_owned() + "\n"
    };
    Ok(buffer.content().chunks(columns).map(line).collect())
}

/// The last line of the screen.
fn note(keys: Keys, outcome: &str) -> String {
    if keys.reset_asked {
        return "leave the safe stop? the robot moves again: y, or any other key not to".to_owned();
    }
    format!("e stop  r reset  c count anew  q leave   {outcome}")
}

/// Draws until somebody leaves; `true` if the run has ended.
fn watch(
    terminal: &mut DefaultTerminal,
    feed: &mut Feed,
    view: &mut View,
    console: &mut Console,
    stop: &AtomicBool,
) -> std::io::Result<bool> {
    let mut keys = Keys::default();
    let mut draw_at_ns = 0;
    while !stop.load(Ordering::Relaxed) {
        if !feed.drain(view) {
            return Ok(true);
        }
        if event::poll(POLL)? {
            if let Event::Key(key) = event::read()? {
                match keys.press(key) {
                    Some(Action::Leave) => return Ok(false),
                    Some(Action::Clear) => view.clear(),
                    Some(Action::Order(order)) => console.order(order, monotonic_ns()),
                    None => (),
                }
            }
            draw_at_ns = 0;
        }
        let now_ns = monotonic_ns();
        if now_ns >= draw_at_ns {
            let snapshot = view.snapshot(now_ns);
            let note = note(keys, console.outcome(&snapshot.state, now_ns));
            terminal.draw(|frame| screen::draw(frame, &snapshot, &note))?;
            draw_at_ns = now_ns + DRAW_NS;
        }
    }
    Ok(false)
}
