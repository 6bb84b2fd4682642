//! A run of this very program to put faults into: started, looked into, ended, searched for what it left.

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use realtime::process::{send_signal, user_id};
use serde_json::Value;
use shm_types::instance::Instance;
use shm_types::topics::Role;

use crate::cli::FaultsArguments;
use crate::error::CliError;
use crate::run::PERIOD_NS;

/// Anything that is to come comes within this.
const PATIENCE: Duration = Duration::from_secs(30);
/// Between two looks.
const LOOK: Duration = Duration::from_millis(5);

/// One running `flexspline run`.
pub struct Subject {
    instance: Instance,
    folder: tempfile::TempDir,
    child: Child,
}

/// How it ended.
pub struct End {
    /// Exit code; none if a signal ended it.
    pub exit_code: Option<i32>,
    /// What it said on standard error.
    pub said: String,
    /// Its report, if it wrote one.
    pub report: Value,
    /// Files and processes of the instance that are still there.
    pub left_behind: Vec<String>,
}

/// What is run.
#[derive(Clone, Copy, Debug)]
pub struct Target<'a> {
    /// Name or file of the robot.
    pub robot: &'a str,
    /// Name of the driver.
    pub driver: &'a str,
}

impl<'a> Target<'a> {
    /// What the command line names.
    pub fn of(arguments: &'a FaultsArguments) -> Self {
        Self {
            robot: &arguments.robot,
            driver: &arguments.driver,
        }
    }
}

/// What a run is started with.
#[derive(Clone, Copy, Debug, Default)]
pub struct Setting<'a> {
    /// Where it records to; a folder of its own if none.
    pub record: Option<&'a Path>,
    /// A command that runs it.
    pub wrapper: &'a [&'a str],
    /// In lockstep instead of real time.
    pub lockstep: bool,
}

impl Subject {
    /// Starts a run with a name of its own, in real time.
    ///
    /// # Errors
    /// [`CliError::Input`] if it cannot be started.
    pub fn start(target: Target<'_>, duration: Duration) -> Result<Self, CliError> {
        Self::start_with(target, duration, &Setting::default())
    }

    /// Starts a run with a name of its own.
    ///
    /// # Errors
    /// [`CliError::Input`] if it cannot be started.
    pub fn start_with(
        target: Target<'_>,
        duration: Duration,
        setting: &Setting<'_>,
    ) -> Result<Self, CliError> {
        let name = format!("faults-{}", std::process::id());
        let instance = Instance::new(&name, user_id()).map_err(CliError::input)?;
        let folder = tempfile::tempdir().map_err(CliError::input)?;
        let program = std::env::current_exe().map_err(CliError::input)?;
        let mut command = match setting.wrapper {
            [] => Command::new(&program),
            [first, others @ ..] => {
                let mut command = Command::new(first);
                command.args(others).arg(&program);
                command
            }
        };
        let recording = folder.path().join("run.mcap");
        command
            .args(["run", "--robot", target.robot, "--driver", target.driver])
            .args(["--instance", &name, "--duration"])
            .arg(format!("{}ms", duration.as_millis()))
            // Cycles are counted and told in periods of this length, whatever the robot file says.
            .arg("--rate")
            .arg((1e9 / PERIOD_NS as f64).to_string())
            .arg("--record")
            .arg(setting.record.unwrap_or(&recording))
            .args([
                "--mode",
                if setting.lockstep {
                    "lockstep"
                } else {
                    "realtime"
                },
            ])
            .arg("--json")
            .arg(folder.path().join("run.json"))
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        // Ctrl-C is for the suite, which ends its runs itself.
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let child = command.spawn().map_err(CliError::input)?;
        Ok(Self {
            instance,
            folder,
            child,
        })
    }

    /// The instance of the run.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Sends a signal to the supervisor.
    pub fn signal(&self, signal: i32) {
        send_signal(self.child.id(), signal);
    }

    /// Whether the run has not ended yet.
    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().is_ok_and(|ended| ended.is_none())
    }

    /// The process of a role, if there is one.
    pub fn process(&self, role: Role) -> Option<u32> {
        processes(self.instance.name())
            .into_iter()
            .find(|(_, found)| found == role.name())
            .map(|(process_id, _)| process_id)
    }

    /// Waits for a process of a role other than `before`.
    pub fn await_process(&mut self, role: Role, before: Option<u32>) -> Option<u32> {
        let begun = Instant::now();
        while begun.elapsed() < PATIENCE && self.is_running() {
            let found = self.process(role).filter(|&found| Some(found) != before);
            if found.is_some() {
                return found;
            }
            std::thread::sleep(LOOK);
        }
        None
    }

    /// Files of the instance in shared memory and in the middleware's folder.
    pub fn files(&self) -> usize {
        let folder = self.instance.file("ipc");
        shared_memory(&self.instance).len() + count_files(&folder)
    }

    /// Waits for its end, kills what does not end by itself, and looks for what is left.
    pub fn finish(mut self, longest: Duration) -> End {
        let begun = Instant::now();
        while self.is_running() && begun.elapsed() < longest + PATIENCE {
            std::thread::sleep(LOOK);
        }
        // Ended already, as a rule.
        let _ = self.child.kill();
        let exit_code = self.child.wait().ok().and_then(|status| status.code());
        let mut said = String::new();
        // The janitor may hold the other end; what is there is there once nothing of the instance is left.
        let left_behind = self.await_nothing_left();
        if left_behind.is_empty()
            && let Some(mut stderr) = self.child.stderr.take()
        {
            let _ = stderr.read_to_string(&mut said);
        }
        let report = fs::read(self.folder.path().join("run.json"))
            .ok()
            .and_then(|text| serde_json::from_slice(&text).ok())
            .unwrap_or(Value::Null);
        End {
            exit_code,
            said,
            report,
            left_behind,
        }
    }

    fn await_nothing_left(&self) -> Vec<String> {
        let begun = Instant::now();
        loop {
            let left = self.left_behind();
            if left.is_empty() || begun.elapsed() > PATIENCE {
                return left;
            }
            std::thread::sleep(LOOK);
        }
    }

    fn left_behind(&self) -> Vec<String> {
        let mut left = shared_memory(&self.instance);
        for path in [
            self.instance.directory().to_owned(),
            self.instance.lock_file(),
        ] {
            if path.exists() {
                left.push(path.display().to_string());
            }
        }
        let running = processes(self.instance.name());
        left.extend(running.iter().map(|(id, role)| format!("{role} {id}")));
        left
    }
}

fn shared_memory(instance: &Instance) -> Vec<String> {
    let prefix = instance.ipc_prefix();
    let entries = fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    entries
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| name.starts_with(&prefix))
        .collect()
}

fn count_files(folder: &Path) -> usize {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries
        .map(|entry| match entry.file_type() {
            Ok(kind) if kind.is_dir() => count_files(&entry.path()),
            _ => 1,
        })
        .sum()
}

/// Process ids and roles of an instance.
fn processes(instance: &str) -> Vec<(u32, String)> {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let ids = entries.filter_map(|entry| entry.file_name().to_string_lossy().parse::<u32>().ok());
    ids.filter_map(|process_id| Some((process_id, role_in(instance, process_id)?)))
        .collect()
}

fn role_in(instance: &str, process_id: u32) -> Option<String> {
    let command_line = fs::read(format!("/proc/{process_id}/cmdline")).ok()?;
    let words: Vec<&[u8]> = command_line.split(|&byte| byte == 0).collect();
    let ours = words.get(1) == Some(&&b"process"[..]) && words.contains(&instance.as_bytes());
    ours.then(|| String::from_utf8_lossy(words[2]).into_owned())
}
