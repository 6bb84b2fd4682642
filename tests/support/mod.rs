//! What the tests of whole runs share: an instance of one's own, and looking for what a run leaves behind.
#![allow(dead_code, reason = "every test file uses another part of this module")]

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use shm_types::instance::Instance;
use tempfile::TempDir;

/// A command-line call with an instance name and a directory that no other test uses.
pub struct Bench {
    pub instance: String,
    pub directory: TempDir,
}

impl Bench {
    pub fn new(name: &str) -> Self {
        // An instance name has at most 16 letters, a process id up to seven.
        let short: String = name.chars().take(8).collect();
        let instance = format!("{short}-{}", std::process::id());
        Self {
            instance,
            directory: TempDir::new().expect("a temporary directory"),
        }
    }

    pub fn file(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    /// `flexspline run` with this instance, recording to `run.mcap` and reporting to `run.json`.
    pub fn run(&self, arguments: &[&str]) -> Command {
        let mut command = self.flexspline();
        command.args(["run", "--instance", &self.instance]);
        command.arg("--record").arg(self.file("run.mcap"));
        command.arg("--json").arg(self.file("run.json"));
        command.args(arguments);
        command
    }

    pub fn flexspline(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_flexspline"));
        command.current_dir(self.directory.path());
        command
    }

    pub fn report(&self) -> Value {
        let text = fs::read(self.file("run.json")).expect("the run wrote its report");
        serde_json::from_slice(&text).expect("the report is JSON")
    }

    /// Files and processes of this instance that are still there.
    pub fn left_behind(&self) -> Vec<String> {
        let user = realtime::process::user_id();
        let instance = Instance::new(&self.instance, user).ok();
        let mut left: Vec<String> = Vec::new();
        for path in instance
            .iter()
            .flat_map(|instance| [instance.directory().to_owned(), instance.lock_file()])
        {
            if path.exists() {
                left.push(path.display().to_string());
            }
        }
        let prefix = instance.map_or("none".to_owned(), |instance| instance.ipc_prefix());
        for entry in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with(&prefix) {
                left.push(name);
            }
        }
        left.extend(
            self.processes()
                .into_iter()
                .map(|(process_id, role)| format!("process {process_id} {role}")),
        );
        left
    }

    /// Process ids and roles of this instance.
    pub fn processes(&self) -> Vec<(u32, String)> {
        let mut found = Vec::new();
        for entry in fs::read_dir("/proc").expect("/proc").flatten() {
            let Ok(process_id) = entry.file_name().to_string_lossy().parse::<u32>() else {
                continue;
            };
            let command_line = fs::read(entry.path().join("cmdline")).unwrap_or_default();
            let words: Vec<String> = command_line
                .split(|&byte| byte == 0)
                .map(|word| String::from_utf8_lossy(word).into_owned())
                .collect();
            if words.get(1).is_some_and(|word| word == "process") && words.contains(&self.instance)
            {
                found.push((process_id, words[2].clone()));
            }
        }
        found
    }

    pub fn process(&self, role: &str) -> Option<u32> {
        self.processes()
            .into_iter()
            .find(|(_, found)| found == role)
            .map(|(process_id, _)| process_id)
    }

    /// Waits until the loop runs; gives up after a generous while.
    pub fn await_process(&self, role: &str) -> u32 {
        eventually(|| self.process(role)).unwrap_or_else(|| panic!("no process {role}"))
    }
}

/// Asks again and again, for at most half a minute.
pub fn eventually<T>(mut ask: impl FnMut() -> Option<T>) -> Option<T> {
    let begun = Instant::now();
    loop {
        if let Some(answer) = ask() {
            return Some(answer);
        }
        if begun.elapsed() > Duration::from_secs(30) {
            return None;
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

pub fn kill(process_id: u32, signal: i32) {
    assert!(
        realtime::process::send_signal(process_id, signal),
        "process {process_id} is there"
    );
}

pub fn spawn(mut command: Command) -> Child {
    command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts")
}

pub fn output(mut command: Command) -> Output {
    command.output().expect("the program starts")
}

/// Standard output and error, for a failing assertion.
pub fn text(output: &Output) -> String {
    format!(
        "{}\n--- standard output\n{}\n--- standard error\n{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    )
}

/// A Python with the packages of `tests/requirements.txt`; the reason is printed where there is none.
pub fn python() -> Option<Command> {
    let python = std::env::var("FLEXSPLINE_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has_package = Command::new(&python)
        .args(["-c", "import iceoryx2"])
        .output()
        .is_ok_and(|found| found.status.success());
    if !has_package {
        println!(
            "skipped: {python} has no package iceoryx2; see tests/requirements.txt, and set FLEXSPLINE_PYTHON"
        );
        return None;
    }
    Some(Command::new(python))
}

/// A copy of a program that another user may execute too: folders of builds are often closed to him.
pub fn for_everybody(program: &Path, directory: &TempDir) -> PathBuf {
    fs::set_permissions(directory.path(), fs::Permissions::from_mode(0o755)).expect("our folder");
    let copy = directory.path().join("program");
    // Not by this process: a file open for writing in it would be so in whatever another test starts, and cannot be
    // executed meanwhile.
    let mut install = Command::new("install");
    install.args(["-m", "755"]).arg(program).arg(&copy);
    let output = output(install);
    assert!(output.status.success(), "{}", text(&output));
    copy
}
