//! `flexspline run --commission` at a terminal, with the emulator: a whole walk, and how it ends otherwise.

mod support;

use std::fs;
use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use serde_json::Value;
use support::{Bench, eventually, kill, output, text};

/// One walk at a time: several loops in real time would be in each other's way.
static ONE: Mutex<()> = Mutex::new(());

/// One joint about the vertical, with a spring that brings it back: no gravity that would have to be supported. Its rate leaves a
/// busy machine time.
const JOINT: &str = r#"
name = "bench"
gravity_m_s2 = [0.0, 0.0, -9.81]
parameter_tolerance = 0.02

[control]
rate_hz = 250.0
kind = "pd_feedforward"
proportional_nm_rad = [400.0]
derivative_nm_s_rad = [20.0]
feedback = "motor"
feedforward = "model"
velocity_filter_hz = 50.0
velocity_filter_order = 1
delay_cycles = 1

[[link]]
joint = "joint1"
origin_m = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
mass_kg = 1.0
centre_of_mass_m = [0.0, 0.0, 0.1]
inertia_kg_m2 = { xx = 0.03, yy = 0.03, zz = 0.05 }

[[joint]]
name = "joint1"
gear_ratio = 100.0
rotor_inertia_kg_m2 = 2e-5
torque_limit_nm = 0.37
torque_constant_nm_a = 0.05
motor_encoder_resolution_rad = 1.5e-4
position_limit_rad = [-0.15, 0.15]
velocity_limit_rad_s = 3.0
effects = [
  { effect = "coulomb_friction", coulomb_nm = 0.3 },
  { effect = "viscous_friction", viscous_nm_s_rad = 8.0 },
  { effect = "joint_spring", stiffness_nm_rad = 30.0, rest_rad = 0.0 },
  { effect = "torsional_compliance", stiffness_nm_rad = 8333.0 },
]
"#;

/// The hand of an emulated arm: it turns the joint to one end of its range and to the other, in every run anew.
fn hand(torque_nm: f64) -> String {
    format!(
        "[[push]]\njoint = \"joint1\"\ntorque_nm = {torque_nm}\nstart_s = 3.0\nduration_s = 1.5\n\n\
         [[push]]\njoint = \"joint1\"\ntorque_nm = {}\nstart_s = 5.0\nduration_s = 1.5\n",
        -torque_nm
    )
}

/// Longest wait for a line on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// A walk at a terminal of its own.
struct Terminal {
    _alone: MutexGuard<'static, ()>,
    child: Child,
    keyboard: fs::File,
    said: Arc<Mutex<String>>,
    reader: JoinHandle<()>,
    read_to: usize,
}

/// A walk that a test gave up is not left behind.
impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Terminal {
    fn open(bench: &Bench, arguments: &[&str]) -> Self {
        Self::open_with(bench, "--commission", arguments)
    }

    fn open_with(bench: &Bench, commission: &str, arguments: &[&str]) -> Self {
        let mut command: Command = bench.flexspline();
        command
            .args(["run", commission, "--instance", &bench.instance])
            .args(["--robot", "arm.toml", "--json", "walk.json"])
            .args(arguments);
        Self::with(command)
    }

    fn with(mut command: Command) -> Self {
        let alone = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        // Another test may start a program at any moment: inherited, either end would outlive the walk, and its reader wait for good.
        let flags = OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC;
        let master = openpt(flags).expect("a terminal");
        grantpt(&master).expect("granted");
        unlockpt(&master).expect("unlocked");
        let name = ptsname(&master, Vec::new()).expect("a name");
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
        let slave: OwnedFd =
            rustix::fs::open(name.as_c_str(), flags, Mode::empty()).expect("its other end");
        command
            .stdin(Stdio::from(slave.try_clone().expect("a copy")))
            .stderr(Stdio::from(slave))
            .stdout(Stdio::null());
        let child = command.spawn().expect("the program starts");
        drop(command);
        let mut screen = fs::File::from(master.try_clone().expect("a copy"));
        let said = Arc::new(Mutex::new(String::new()));
        let shared = Arc::clone(&said);
        let reader = std::thread::spawn(move || {
            let mut bytes = [0; 4096];
            // A terminal whose other end is closed ends with an error.
            while let Ok(count @ 1..) = screen.read(&mut bytes) {
                let text = String::from_utf8_lossy(&bytes[..count]).into_owned();
                shared.lock().expect("nobody panics").push_str(&text);
            }
        });
        Self {
            _alone: alone,
            child,
            keyboard: fs::File::from(master),
            said,
            reader,
            read_to: 0,
        }
    }

    fn said(&self) -> String {
        self.said.lock().expect("nobody panics").clone()
    }

    /// Waits for a text after what was waited for before.
    fn until(&mut self, wanted: &str) {
        let begun = Instant::now();
        loop {
            let said = self.said();
            if let Some(at) = said[self.read_to..].find(wanted) {
                self.read_to += at + wanted.len();
                return;
            }
            let over = self.child.try_wait().expect("a child").is_some();
            std::thread::sleep(Duration::from_millis(20));
            // what it said last may come after its end is seen
            let said = self.said();
            let is_late = over && !said[self.read_to..].contains(wanted);
            assert!(
                begun.elapsed() < PATIENCE && !is_late,
                "never said: {wanted}\n--- it said\n{said}"
            );
        }
    }

    fn answer(&mut self, line: &str) {
        self.keyboard.write_all(line.as_bytes()).expect("typed");
    }

    /// Confirms the step of this name.
    fn begin(&mut self, step: &str) {
        self.until(step);
        self.until("Begin?");
        self.answer("y\n");
    }

    /// Exit code and everything that was said.
    fn end(mut self) -> (Option<i32>, String) {
        let begun = Instant::now();
        while begun.elapsed() < PATIENCE {
            // The reader ends with the terminal's other end, once the last words were read.
            if let Some(status) = self.child.try_wait().expect("a child")
                && self.reader.is_finished()
            {
                return (status.code(), self.said());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("it or its terminal did not end: {}", self.said());
    }
}

fn bench(name: &str, hand: &str) -> Bench {
    let bench = Bench::new(name);
    fs::write(bench.file("arm.toml"), JOINT).expect("written");
    fs::write(bench.file("hand.toml"), hand).expect("written");
    bench
}

fn json(path: PathBuf) -> Value {
    let text = fs::read(&path).expect("written");
    serde_json::from_slice(&text).expect("JSON")
}

fn passed(walk: &Value) -> Vec<String> {
    let passed = walk["passed"].as_array().expect("a list");
    let name = |passed: &Value| passed["step"].as_str().unwrap_or_default().to_owned();
    passed.iter().map(name).collect()
}

const STEPS: [&str; 11] = [
    "scan",
    "check",
    "brakes-closed",
    "brakes-open",
    "zero-torque",
    "sign",
    "limits",
    "emergency-stop",
    "operator-stop",
    "first-torque",
    "sine",
];

#[test]
fn a_whole_walk_passes_and_a_changed_robot_file_begins_again() {
    let bench = bench("walk", &hand(5.1));
    let mut walk = Terminal::open(&bench, &["--inject", "hand.toml"]);
    for step in &STEPS[..6] {
        walk.begin(step);
        walk.until("passed:");
    }
    // Somebody goes home and comes again.
    walk.until("limits");
    walk.until("Begin?");
    walk.answer("n\n");
    let (code, said) = walk.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("left at limits of joint1"), "{said}");
    assert_eq!(passed(&json(bench.file("arm.commission.json"))), STEPS[..6]);

    let mut walk = Terminal::open(&bench, &["--inject", "hand.toml"]);
    for step in ["limits", "operator-stop", "first-torque"] {
        walk.begin(step);
        walk.until("passed:");
    }
    walk.begin("sine of joint1");
    walk.until("look and sound right?");
    walk.answer("y\n");
    let (code, said) = walk.end();
    assert_eq!(code, Some(0), "{said}");
    let told = json(bench.file("walk.json"));
    assert_eq!(told["complete"], true, "{told}");
    assert_eq!(passed(&told), STEPS);
    let gain = told["passed"][10]["finding"]["value"].as_f64();
    assert!(
        gain.is_some_and(|gain| (0.8..1.2).contains(&gain)),
        "{told}"
    );
    assert!(bench.left_behind().is_empty(), "{:?}", bench.left_behind());

    fs::write(bench.file("arm.toml"), JOINT.replace("0.37", "0.36")).expect("written");
    let mut walk = Terminal::open(&bench, &["--inject", "hand.toml"]);
    walk.until("the robot file has changed since; the walk begins again");
    walk.until("1/11 scan");
    walk.until("Begin?");
    walk.answer("n\n");
    let (code, said) = walk.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(passed(&json(bench.file("arm.commission.json"))).is_empty());
}

#[test]
fn a_joint_that_turns_the_wrong_way_is_refused_and_so_is_what_comes_after() {
    let bench = bench("sign", &hand(-5.1));
    let mut walk = Terminal::open(&bench, &["--inject", "hand.toml"]);
    for step in &STEPS[..5] {
        walk.begin(step);
        walk.until("passed:");
    }
    walk.begin("sign");
    let (code, said) = walk.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(
        said.contains("sign of joint1 is not passed") && said.contains("reversed"),
        "{said}"
    );
    let told = json(bench.file("walk.json"));
    assert_eq!(told["refused"]["step"], "sign", "{told}");
    assert_eq!(told["refused"]["joint"], "joint1", "{told}");
    assert_eq!(told["complete"], false);

    let (code, said) = Terminal::open_with(&bench, "--commission=sine", &[]).end();
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("sign of joint1 has not been passed"),
        "{said}"
    );
}

#[test]
fn ctrl_c_while_the_joint_is_free_leaves_it_braked_and_what_was_passed_kept() {
    let bench = bench("ctrlc", "");
    fs::remove_file(bench.file("hand.toml")).expect("not needed");
    let mut walk = Terminal::open(&bench, &[]);
    for step in &STEPS[..4] {
        walk.begin(step);
        walk.until("passed:");
    }
    walk.begin("zero-torque");
    walk.until("move it to and fro by hand");
    walk.until("0.000 of 0.075 rad");
    kill(walk.child.id(), libc::SIGINT);
    let (code, said) = walk.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("left at zero-torque of joint1"), "{said}");
    assert_eq!(passed(&json(bench.file("arm.commission.json"))), STEPS[..4]);
    assert!(bench.left_behind().is_empty(), "{:?}", bench.left_behind());

    // The same walk again, and a joint that nobody moves.
    let mut walk = Terminal::open(&bench, &[]);
    walk.begin("zero-torque");
    walk.until("0.000 of 0.075 rad");
    walk.answer("n\n");
    let (code, said) = walk.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(
        said.contains("zero-torque of joint1 is not passed"),
        "{said}"
    );
}

#[test]
fn without_a_terminal_with_an_unknown_step_or_another_file_it_is_one_line() {
    let bench = bench("noterm", "");
    let refused = |arguments: &[&str]| {
        let mut run = bench.flexspline();
        run.args(["run", "--instance", &bench.instance, "--robot", "arm.toml"])
            .args(arguments)
            .stdin(Stdio::null());
        let output = output(run);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(said.lines().count(), 1, "{said}");
        said
    };
    assert!(refused(&["--commission"]).contains("no terminal"));
    assert!(refused(&["--commission=jump"]).contains("first-torque"));
    assert!(refused(&["--commission", "--mode", "lockstep"]).contains("--mode"));
    assert!(refused(&["--commission-file", "x.json"]).contains("--commission"));
    fs::write(bench.file("arm.commission.json"), "{}").expect("written");
    let (code, said) = Terminal::open(&bench, &[]).end();
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("arm.commission.json") && said.contains("remove it"),
        "{said}"
    );
}

/// The steps before the brakes open, on drives behind a bus: what comes after is the same on all drives.
fn walk_with_brakes_closed(mut walk: Terminal, bench: &Bench) {
    for step in &STEPS[..3] {
        walk.begin(step);
        walk.until("passed:");
    }
    walk.until("brakes-open");
    walk.until("Begin?");
    walk.answer("n\n");
    let (code, said) = walk.end();
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("left at brakes-open"), "{said}");
    assert_eq!(passed(&json(bench.file("walk.json"))), STEPS[..3]);
}

#[test]
fn virtual_moteus_drives_are_walked() {
    let bench = bench("wmoteus", "");
    let place = bench.directory.path().display();
    let robot = format!("{JOINT}\n[joint.drive]\nid = 1\n\n[drive]\nports = [\"{place}/port\"]\n");
    fs::write(bench.file("arm.toml"), robot).expect("written");
    let mut emulate = bench.flexspline();
    emulate
        .args([
            "drives", "emulate", "moteus", "--robot", "arm.toml", "--link", "port",
        ])
        .stdout(Stdio::null());
    let mut drives = emulate.spawn().expect("the program starts");
    assert!(eventually(|| bench.file("port").exists().then_some(())).is_some());
    walk_with_brakes_closed(Terminal::open(&bench, &["--driver", "moteus"]), &bench);
    kill(drives.id(), libc::SIGINT);
    drives.wait().expect("it ends");
}

#[test]
fn virtual_ethercat_drives_are_walked() {
    let pair = "ip link add veth0 type veth peer name veth1 && ip link set veth0 up && ip link set veth1 up";
    let mut probe = Command::new("unshare");
    probe.args(["-n", "sh", "-c", pair]).stderr(Stdio::null());
    if !probe.status().is_ok_and(|status| status.success()) {
        eprintln!("skipped: no network namespace with a veth pair can be made here");
        return;
    }
    let bench = bench("wether", "");
    // A busy machine keeps frames for longer than the usual watchdog.
    let robot = format!(
        "{JOINT}\n[joint.drive]\nhomed = true\n\n[drive]\ninterface = \"veth0\"\nwatchdog_ms = 100.0\n"
    );
    fs::write(bench.file("arm.toml"), robot).expect("written");
    let script = format!(
        "{pair} && {{ \"$F\" drives emulate ethercat --interface veth1 --robot arm.toml >/dev/null & }} && drives=$! && sleep 1 && \
         \"$F\" run --commission --driver ethercat --robot arm.toml --json walk.json --instance {}; code=$?; \
         kill -INT $drives; wait $drives; exit $code",
        bench.instance
    );
    let mut inside = Command::new("unshare");
    inside
        .args(["-n", "sh", "-c", &script])
        .env("F", env!("CARGO_BIN_EXE_flexspline"))
        .current_dir(bench.directory.path());
    walk_with_brakes_closed(Terminal::with(inside), &bench);
}
