//! Opening the driver with virtual drives over a veth pair, in a network namespace of its own. Where that is not allowed the tests say so
//! and end.

use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use ethercat::ETHERCAT;
use ethercat_emulator::socket::{RawSocket, now_ns, serve};
use ethercat_emulator::{Options, Segment, VENDOR, segment, wire};
use plant_emulator::PlantParameters;
use robot::Robot;
use rt_loop::driver::{DriveFault, Driver, OpenContext};
use shm_types::control_options::ControlOptions;
use shm_types::drive::DriveState;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use shm_types::messages::{DriveCommand, DriveMode, DriveRequest, DriveSample};

/// Set in the process that runs inside the namespace.
const INSIDE: &str = "FLEXSPLINE_ETHERCAT_INSIDE";
const PERIOD_NS: u64 = 1_000_000;
/// Longer than any stall of a busy machine that is not the test's business.
const PATIENCE_NS: u64 = 50_000_000;

/// Runs the test `name` again inside a namespace, where it finds a veth pair; true in there.
fn is_inside(name: &str) -> bool {
    if std::env::var_os(INSIDE).is_some() {
        return true;
    }
    let setup =
        "ip link add ecA0 type veth peer name ecA1 && ip link set ecA0 up && ip link set ecA1 up";
    let mut probe = Command::new("unshare");
    probe.args(["-n", "sh", "-c", setup]).stderr(Stdio::null());
    if !probe.status().is_ok_and(|status| status.success()) {
        eprintln!("skipped: no network namespace with a veth pair can be made here");
        return false;
    }
    let program = std::env::current_exe().expect("a test program");
    let status = Command::new("unshare")
        .args(["-n", "sh", "-c", &format!("{setup} && exec \"$0\" \"$@\"")])
        .arg(program)
        .args(["--exact", name, "--nocapture"])
        .env(INSIDE, "1")
        .status()
        .expect("unshare");
    assert!(status.success(), "{name} failed inside its namespace");
    false
}

fn run_config(session: u64, period_ns: u64) -> RunConfig {
    RunConfig {
        session,
        robot: "shd17".to_owned(),
        driver: "ethercat".to_owned(),
        trajectory: String::new(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        mode: Mode::Realtime,
        period_ns,
        cycles: 0,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        estimators: Vec::new(),
        command_deadline_ns: 750_000,
        cores: Vec::new(),
        initial_position_rad: Vec::new(),
    }
}

/// A robot whose drives are on the veth pair.
fn robot(name: &str, bus: &str, joint: &str) -> Robot {
    let mut robot = robot::load(name).expect("a shipped robot");
    robot.drive = Some(
        format!("interface = \"ecA0\"\n{bus}")
            .parse()
            .expect("TOML"),
    );
    for table in &mut robot.joints {
        table.drive = Some(format!("homed = true\n{joint}").parse().expect("TOML"));
    }
    robot
}

/// Virtual drives at the other end.
struct Drives {
    stop: Arc<AtomicBool>,
    server: Option<JoinHandle<Segment>>,
}

impl Drives {
    fn start(name: &str, change: impl FnOnce(&mut Options)) -> Self {
        let robot = robot::load(name).expect("a shipped robot");
        let parameters = PlantParameters::for_robot(&robot).expect("its plant");
        let mut options = Options::for_joints(robot.joints.len());
        options.rate_hz = 1e9 / PERIOD_NS as f64;
        change(&mut options);
        let mut drives = segment(&robot, &parameters, &[], &options, now_ns()).expect("drives");
        let socket = RawSocket::open("ecA1").expect("the other end");
        let stop = Arc::new(AtomicBool::new(false));
        let server = std::thread::spawn({
            let stop = Arc::clone(&stop);
            move || {
                serve(&socket, &mut drives, &stop, |_| ());
                drives
            }
        });
        Self {
            stop,
            server: Some(server),
        }
    }

    fn end(mut self) -> Segment {
        self.stop.store(true, Ordering::Relaxed);
        let server = self.server.take().expect("it runs");
        server.join().expect("the drives end")
    }
}

/// A loop that does no more than call the driver.
struct Loop {
    driver: Box<dyn Driver>,
    cycle: u64,
    planned_ns: u64,
    command: DriveCommand,
    errors: Vec<DriveFault>,
    last: DriveSample,
}

impl Loop {
    fn open(robot: &Robot) -> Self {
        Self::try_open(robot, PERIOD_NS).unwrap_or_else(|error| panic!("{error}"))
    }

    fn try_open(robot: &Robot, period_ns: u64) -> Result<Self, String> {
        let run = run_config(7, period_ns);
        let context = OpenContext {
            run: &run,
            robot,
            bus: None,
        };
        let driver = (ETHERCAT.open)(&context).map_err(|error| error.to_string())?;
        Ok(Self {
            driver,
            cycle: 0,
            planned_ns: now_ns() + period_ns,
            command: DriveCommand::default(),
            errors: Vec::new(),
            last: DriveSample::default(),
        })
    }

    fn cycle(&mut self) {
        let now_ns = now_ns();
        if self.planned_ns > now_ns {
            std::thread::sleep(Duration::from_nanos(self.planned_ns - now_ns));
        }
        let give_up_at_ns = self.planned_ns.max(now_ns) + PATIENCE_NS;
        match self.driver.read(self.cycle, self.planned_ns, give_up_at_ns) {
            Ok(sample) => self.last = sample,
            Err(fault) => self.errors.push(fault),
        }
        let written = self.driver.write(&self.command);
        assert_eq!(written, Ok(()));
        self.driver.prepare();
        self.cycle += 1;
        let follow_ns = (self.last.bus.clock_offset_ns / 16).clamp(-20_000, 20_000);
        self.planned_ns = self.planned_ns.saturating_add_signed(follow_ns) + PERIOD_NS;
    }

    fn until_all(&mut self, joints: usize, state: DriveState) {
        for _ in 0..5000 {
            self.cycle();
            let drives = &self.last.drives;
            if (0..joints).all(|joint| drives.state_of(joint) == state) {
                return;
            }
        }
        panic!(
            "never {}: {:?}, {:?}",
            state.name(),
            self.last.drives,
            self.errors
        );
    }

    fn enable(&mut self, joints: usize, mode: DriveMode) {
        self.until_all(joints, DriveState::SwitchedOff);
        self.command.mode = mode as u32;
        self.command.request = DriveRequest::Enable as u32;
        self.until_all(joints, DriveState::Enabled);
        self.command.request = DriveRequest::None as u32;
    }
}

#[test]
fn bad_input_is_one_line_before_anything_moves() {
    if !is_inside("bad_input_is_one_line_before_anything_moves") {
        return;
    }
    let refused = |robot: &Robot, period_ns: u64| match Loop::try_open(robot, period_ns) {
        Ok(_) => panic!("opened"),
        Err(error) => error,
    };
    let check = |error: String, part: &str| {
        assert!(error.contains(part), "{error}");
        assert_eq!(error.lines().count(), 1, "{error}");
    };
    let mut elsewhere = robot("shd17", "", "");
    elsewhere.drive = Some("interface = \"ec9\"".parse().expect("TOML"));
    check(refused(&elsewhere, PERIOD_NS), "no network interface `ec9`");
    check(
        refused(&robot("shd17", "", ""), PERIOD_NS),
        "no slaves answer",
    );

    let drives = Drives::start("shd17", |options| options.cycle_times_ns = vec![2_000_000]);
    let stop = Arc::new(AtomicBool::new(false));
    let other = std::thread::spawn({
        let stop = Arc::clone(&stop);
        move || {
            let socket = RawSocket::open("ecA0").expect("the interface");
            while !stop.load(Ordering::Relaxed) {
                assert!(socket.send(&wire::frame(&[(7, 0xf0, [0; 4], &[0])])));
                std::thread::sleep(Duration::from_millis(2));
            }
        }
    });
    check(
        refused(&robot("shd17", "", ""), 2_000_000),
        "another master",
    );
    stop.store(true, Ordering::Relaxed);
    other.join().expect("it ends");
    let cases = [
        ("vendor = 1", "put the drives in the file's order"),
        (
            "encoder_counts = 1000",
            "the robot file says encoder_counts = 1000",
        ),
        ("link_encoder_counts = 1000", "second encoder"),
        ("rated_torque_nm = 5.0", "rated torque"),
        ("slave = 3", "the bus has 1 slaves"),
        ("slave = 0\naxis = 2", "slave 0 has 1 axes"),
        ("zero_count = 100000", "encoders disagree"),
    ];
    for (joint, part) in cases {
        check(refused(&robot("shd17", "", joint), 2_000_000), part);
    }
    check(
        refused(&robot("pa10", "", ""), 2_000_000),
        "7 joints, the bus 1 axes",
    );
    check(refused(&robot("shd17", "", ""), PERIOD_NS), "--rate");
    let fits = format!("vendor = {VENDOR}\nslave = 0");
    let first = Loop::try_open(&robot("shd17", "", &fits), 2_000_000).expect("it fits");
    check(
        refused(&robot("shd17", "", ""), 2_000_000),
        "another flexspline",
    );
    drop(first);
    let segment = drives.end();
    assert_eq!(segment.slaves()[0].object(0x603f, 0), 0);
}

#[test]
fn the_shipped_robot_files_fit_the_virtual_drives() {
    if !is_inside("the_shipped_robot_files_fit_the_virtual_drives") {
        return;
    }
    for (name, axes) in [("one_encoder", 1), ("two_encoders", 1), ("several_axes", 2)] {
        let path = format!(
            "{}/../../robots/ethercat_{name}.toml",
            env!("CARGO_MANIFEST_DIR")
        );
        let drives = Drives::start(&path, |options| options.axes_per_slave = axes);
        let mut robot = robot::load(&path).expect("a robot file");
        let bus = robot.drive.as_mut().expect("a table");
        bus["interface"] = "ecA0".into();
        // a busy machine is not what is tested
        bus["watchdog_ms"] = 100.0.into();
        let mut bench = Loop::open(&robot);
        let drives_told = bench.driver.capabilities();
        let fits = drives_told.check(&robot, DriveMode::Torque, PERIOD_NS);
        assert_eq!(fits, Ok(()), "{name}");
        bench.enable(robot.joints.len(), DriveMode::Position);
        bench.driver.shutdown();
        drives.end();
    }
}
