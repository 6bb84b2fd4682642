//! The driver on virtual drives behind pseudo-terminals: from opening to every fault of a bus.
//!
//! Nothing here asserts a time: a cycle waits for its answers as long as it takes.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fs::File;
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use moteus_driver::MOTEUS;
use moteus_emulator::process::Ports;
use moteus_emulator::{Bench, Setup};
use realtime::clock::monotonic_ns;
use robot::Robot;
use rt_loop::driver::{DriveFault, Driver, OpenContext, OpenError};
use shm_types::drive::{DriveState, bus_fault};
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use shm_types::messages::{DriveCommand, DriveMode, DriveRequest, DriveSample, Header};

/// Counts what this thread asks of the heap.
struct Counting;

thread_local! {
    static HEAP_CALLS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator as it came; only a counter is added.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        HEAP_CALLS.set(HEAP_CALLS.get() + 1);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const PERIOD_NS: u64 = 2_000_000;
/// Longer than an answer takes on a busy machine; less than the drives' watchdog, for where one is missing.
const PATIENCE_NS: u64 = 20_000_000;

/// Virtual drives in a thread of their own.
struct Rig {
    robot: Robot,
    stop: Arc<AtomicBool>,
    served: Option<JoinHandle<()>>,
}

impl Rig {
    fn new(name: &str, buses: usize, is_homed: bool, faults: &[&str]) -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let mut robot = robot::load(name).unwrap();
        let link = std::env::temp_dir().join(format!(
            "moteus-test-{}-{}",
            std::process::id(),
            COUNT.fetch_add(1, Ordering::Relaxed)
        ));
        let link = link.to_str().unwrap().to_owned();
        let mut ports = Ports::open(buses, Some(&link)).unwrap();
        let paths: Vec<String> = (0..buses)
            .map(|bus| format!("{:?}", ports.path(bus)))
            .collect();
        robot.drive = Some(format!("ports = [{}]", paths.join(", ")).parse().unwrap());
        let setup = Setup {
            initial_position_rad: vec![0.0; robot.joints.len()],
            buses,
            is_homed,
            seed: 1,
            faults: faults.iter().map(|text| text.parse().unwrap()).collect(),
        };
        let stop = Arc::new(AtomicBool::new(false));
        let (sent, told) = std::sync::mpsc::channel();
        let served = {
            let (robot, stop) = (robot.clone(), Arc::clone(&stop));
            thread::spawn(move || {
                let mut bench = Bench::new(&robot, &setup).unwrap();
                let places: Vec<Vec<(usize, u8)>> =
                    (0..buses).map(|bus| bench.joints_on(bus)).collect();
                sent.send(places).unwrap();
                ports.serve(&mut bench, &stop, |_| ()).unwrap();
            })
        };
        for (bus, joints) in told.recv().unwrap().into_iter().enumerate() {
            for (joint, id) in joints {
                let text = format!("id = {id}\nbus = {}", bus + 1);
                robot.joints[joint].drive = Some(text.parse().unwrap());
            }
        }
        Self {
            robot,
            stop,
            served: Some(served),
        }
    }

    fn run_config(&self) -> RunConfig {
        RunConfig {
            session: 7,
            robot: self.robot.name.clone(),
            driver: "moteus".to_owned(),
            trajectory: "hold".to_owned(),
            plant: None,
            control: ControlMode::Torque,
            options: Default::default(),
            estimators: Vec::new(),
            mode: Mode::Realtime,
            period_ns: PERIOD_NS,
            cycles: 1000,
            wait: Wait::Block,
            wake_early_ns: 0,
            seed: 1,
            inject: None,
            record: None,
            command_deadline_ns: PERIOD_NS,
            cores: Vec::new(),
            initial_position_rad: vec![0.0; self.robot.joints.len()],
        }
    }

    fn open(&self) -> Result<Box<dyn Driver>, OpenError> {
        self.open_with(&self.run_config())
    }

    fn open_with(&self, run: &RunConfig) -> Result<Box<dyn Driver>, OpenError> {
        (MOTEUS.open)(&OpenContext {
            run,
            robot: &self.robot,
            bus: None,
        })
    }

    fn told(&self) -> String {
        match self.open() {
            Ok(_) => "opened".to_owned(),
            Err(error) => error.to_string(),
        }
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(served) = self.served.take() {
            let _ = served.join();
        }
    }
}

/// The loop, by hand.
struct Cycles {
    driver: Box<dyn Driver>,
    cycle: u64,
    joints: usize,
}

impl Cycles {
    fn new(rig: &Rig) -> Self {
        Self {
            driver: rig.open().unwrap(),
            cycle: 0,
            joints: rig.robot.joints.len(),
        }
    }

    fn command(&self, mode: DriveMode, request: DriveRequest) -> DriveCommand {
        DriveCommand {
            header: Header {
                session: 7,
                cycle: self.cycle,
                measured_at_ns: 1,
                joint_count: self.joints as u64,
            },
            mode: mode as u32,
            request: request as u32,
            ..DriveCommand::default()
        }
    }

    fn read(&mut self) -> Result<DriveSample, DriveFault> {
        let now_ns = monotonic_ns();
        self.driver.read(self.cycle, now_ns, now_ns + PATIENCE_NS)
    }

    /// One cycle of a command; its sample.
    fn turn(&mut self, command: &DriveCommand) -> Result<DriveSample, DriveFault> {
        let sample = self.read();
        let written = self.driver.write(command);
        self.driver.prepare();
        self.cycle += 1;
        thread::sleep(Duration::from_nanos(PERIOD_NS));
        written.and(sample)
    }

    /// Cycles of a command until a sample is as wanted.
    fn until(
        &mut self,
        command: &DriveCommand,
        wanted: impl Fn(&Result<DriveSample, DriveFault>) -> bool,
    ) -> Result<DriveSample, DriveFault> {
        for _ in 0..3000 {
            let sample = self.turn(command);
            if wanted(&sample) {
                return sample;
            }
        }
        panic!("it never came to that");
    }

    fn enable(&mut self) {
        let enable = self.command(DriveMode::Torque, DriveRequest::Enable);
        let joints = self.joints;
        self.until(&enable, |sample| {
            let all = |sample: &DriveSample| {
                (0..joints).all(|joint| sample.drives.state_of(joint) == DriveState::Enabled)
            };
            sample.as_ref().is_ok_and(all)
        })
        .unwrap();
    }
}

fn is_at(state: DriveState) -> impl Fn(&Result<DriveSample, DriveFault>) -> bool {
    move |sample| {
        sample
            .as_ref()
            .is_ok_and(|sample| sample.drives.state_of(0) == state)
    }
}

#[test]
fn drives_are_found_enabled_moved_by_torque_and_stopped() {
    let rig = Rig::new("pa10", 2, true, &[]);
    let mut cycles = Cycles::new(&rig);
    let capabilities = cycles.driver.capabilities();
    assert_eq!(
        capabilities.check(&rig.robot, DriveMode::Torque, PERIOD_NS),
        Ok(())
    );
    assert_eq!(
        capabilities.joints[0].watchdog,
        Some(Duration::from_millis(100))
    );
    assert!(
        capabilities.bus.contains("4 drives"),
        "{}",
        capabilities.bus
    );

    let braked = cycles.command(DriveMode::Braked, DriveRequest::None);
    let before = cycles
        .until(&braked, is_at(DriveState::SwitchedOff))
        .unwrap();
    cycles.enable();
    let mut push = cycles.command(DriveMode::Torque, DriveRequest::None);
    let limit_nm = rig.robot.joints[0].torque_limit_nm.unwrap();
    push.motor_torque_nm[0] = 0.8 * limit_nm;
    let moved = cycles
        .until(&push, |sample| {
            sample.as_ref().is_ok_and(|sample| {
                let moved_rad =
                    sample.readings.motor_position_rad[0] - before.readings.motor_position_rad[0];
                moved_rad > 1.0
            })
        })
        .unwrap();
    assert!((moved.readings.motor_torque_nm[0] - 0.8 * limit_nm).abs() < 0.1 * limit_nm);
    assert!(moved.readings.motor_velocity_rad_s[0] > 0.0);
    let stop = cycles.command(DriveMode::Braked, DriveRequest::QuickStop);
    cycles.until(&stop, is_at(DriveState::SwitchedOff)).unwrap();
    cycles.driver.shutdown();
}

#[test]
fn neither_read_nor_write_uses_the_heap() {
    let rig = Rig::new("shd17", 1, true, &[]);
    let mut cycles = Cycles::new(&rig);
    cycles.enable();
    let torque = cycles.command(DriveMode::Torque, DriveRequest::None);
    let damping = cycles.command(DriveMode::Damping, DriveRequest::None);
    let mut impedance = cycles.command(DriveMode::Impedance, DriveRequest::None);
    impedance.position_gain_scale[0] = 0.5;
    for command in [torque, damping, impedance] {
        for _ in 0..20 {
            let before = HEAP_CALLS.get();
            let sample = cycles.turn(&command);
            assert_eq!(HEAP_CALLS.get(), before, "{sample:?}");
        }
    }
    let before = HEAP_CALLS.get();
    drop(std::hint::black_box(vec![1_u8]));
    assert!(HEAP_CALLS.get() > before, "the counter counts nothing");
}

#[test]
fn velocity_position_and_impedance_lead_the_joint() {
    let rig = Rig::new("shd17", 1, true, &[]);
    let mut cycles = Cycles::new(&rig);
    cycles.enable();
    let link_rad = |sample: &Result<DriveSample, DriveFault>| {
        sample
            .as_ref()
            .map_or(f64::NAN, |sample| sample.readings.link_position_rad[0])
    };
    let mut velocity = cycles.command(DriveMode::Velocity, DriveRequest::None);
    velocity.joint_velocity_rad_s[0] = 0.5;
    cycles
        .until(&velocity, |sample| link_rad(sample) > 0.3)
        .unwrap();
    let mut position = cycles.command(DriveMode::Position, DriveRequest::None);
    position.joint_position_rad[0] = -0.2;
    cycles
        .until(&position, |sample| link_rad(sample) < -0.15)
        .unwrap();
    let mut impedance = cycles.command(DriveMode::Impedance, DriveRequest::None);
    impedance.joint_position_rad[0] = 0.3;
    impedance.position_gain_scale[0] = 1.0;
    impedance.velocity_gain_scale[0] = 1.0;
    cycles
        .until(&impedance, |sample| link_rad(sample) > 0.2)
        .unwrap();
}

#[test]
fn a_silent_drive_costs_its_own_readings_alone() {
    let rig = Rig::new("pa10", 1, true, &["silent:3@2s+500ms"]);
    let mut cycles = Cycles::new(&rig);
    cycles.enable();
    let torque = cycles.command(DriveMode::Torque, DriveRequest::None);
    let old = |sample: &DriveSample| sample.drives.age_cycles[2] > 2;
    let sample = cycles
        .until(&torque, |sample| sample.as_ref().is_ok_and(old))
        .unwrap();
    assert_eq!(sample.drives.age_cycles[1], 0);
    assert_eq!(
        (
            sample.bus.working_counter_expected,
            sample.bus.working_counter
        ),
        (7, 6)
    );
    // Its watchdog has stopped it meanwhile, and it says so when it is back.
    cycles
        .until(&torque, |sample| {
            sample
                .as_ref()
                .is_ok_and(|sample| sample.drives.state_of(2) == DriveState::QuickStop)
        })
        .unwrap();
    cycles.enable();
}

#[test]
fn a_faulted_drive_tells_its_number_and_is_reset() {
    let rig = Rig::new("shd17", 1, true, &["drive-fault:1/33@1s+200ms"]);
    let mut cycles = Cycles::new(&rig);
    cycles.enable();
    let torque = cycles.command(DriveMode::Torque, DriveRequest::None);
    let sample = cycles.until(&torque, is_at(DriveState::Fault)).unwrap();
    assert_eq!(sample.drives.error_code[0], 33);
    let reset = cycles.command(DriveMode::Braked, DriveRequest::ResetFault);
    cycles
        .until(&reset, is_at(DriveState::SwitchedOff))
        .unwrap();
    // It faults again as long as its cause is there.
    for _ in 0..200 {
        let _ = cycles.turn(&reset);
    }
    cycles.enable();
}

#[test]
fn a_drive_that_lost_its_supply_is_not_started_again() {
    let rig = Rig::new("pa10", 1, true, &["brown-out:2@2s+500ms"]);
    let mut cycles = Cycles::new(&rig);
    cycles.enable();
    let torque = cycles.command(DriveMode::Torque, DriveRequest::None);
    let is_lost = |sample: &DriveSample| sample.drives.state_of(1) == DriveState::NotReady;
    let sample = cycles
        .until(&torque, |sample| sample.as_ref().is_ok_and(is_lost))
        .unwrap();
    assert_eq!(sample.drives.status_word[1], 0, "it stands still");
    let sample = cycles.turn(&torque).unwrap();
    assert_eq!(sample.drives.status_word[1], 0, "and stays so");
}

#[test]
fn a_port_that_goes_away_is_told_and_taken_again() {
    let rig = Rig::new("shd17", 1, true, &["pty-closed:1@1s+300ms"]);
    let mut cycles = Cycles::new(&rig);
    cycles.enable();
    let torque = cycles.command(DriveMode::Torque, DriveRequest::None);
    let gone = cycles.until(&torque, Result::is_err);
    assert_eq!(gone, Err(DriveFault::LinkLost));
    let sample = cycles.until(&torque, Result::is_ok).unwrap();
    assert_eq!(sample.bus.faults & bus_fault::LINK_LOST, 0);
}

#[test]
fn frames_that_are_lost_doubled_or_late_do_not_stop_it() {
    let faults = ["lost:1/0.2@1s", "doubled:1/0.3@1s", "delayed:1/1ms@1s"];
    let rig = Rig::new("shd17", 1, true, &faults);
    let mut cycles = Cycles::new(&rig);
    cycles.enable();
    let torque = cycles.command(DriveMode::Torque, DriveRequest::None);
    let mut lost = 0;
    while lost < 5 {
        // a frame lost is a sample missing, and nothing more
        let sample = cycles.turn(&torque);
        assert!(
            matches!(sample, Ok(_) | Err(DriveFault::NoSample)),
            "{sample:?}"
        );
        lost = sample.map_or(lost, |sample| sample.bus.frames_lost);
    }
}

#[test]
fn what_does_not_fit_is_told_before_anything_moves() {
    let mut rig = Rig::new("shd17", 1, true, &[]);
    let right = rig.robot.clone();
    let drive = |text: &str| Some(text.parse().unwrap());

    rig.robot.joints[0].drive = drive("id = 9");
    assert!(rig.told().contains("no drive answers to id 9") && rig.told().contains("ids 1"));
    rig.robot = right.clone();
    rig.robot.joints[0].gear_ratio = 50.0;
    assert!(
        rig.told().contains("the robot file has gear_ratio = 50"),
        "{}",
        rig.told()
    );
    rig.robot = right.clone();
    rig.robot.drive = drive("ports = [\"/dev/no-such-port\"]");
    assert!(rig.told().contains("no such port"), "{}", rig.told());
    rig.robot.drive = drive("ports = [\"/dev/null\"]");
    assert!(rig.told().contains("no serial port"), "{}", rig.told());
    rig.robot = right;
    let opened = rig.open().unwrap();
    assert!(rig.told().contains("in use"), "{}", rig.told());
    drop(opened);

    let too_fast = RunConfig {
        period_ns: 100_000,
        ..rig.run_config()
    };
    let told = rig.open_with(&too_fast).err().unwrap().to_string();
    assert!(told.contains("--rate") && !told.contains('\n'), "{told}");
    let lockstep = RunConfig {
        mode: Mode::Lockstep,
        ..rig.run_config()
    };
    assert!(rig.open_with(&lockstep).is_err());
}

#[test]
fn two_drives_with_one_id_are_told_before_anything_moves() {
    let rig = Rig::new("pa10", 1, true, &[]);
    let ports = rig.robot.drive.as_ref().unwrap()["ports"]
        .as_array()
        .unwrap();
    let port = ports[0].as_str().unwrap();
    // Drive 2 is told over its diagnostic channel, as moteus_tool does it, that it is drive 1, and says OK.
    let text = b"conf set id.id 1\n";
    let hex: String = text.iter().map(|byte| format!("{byte:02x}")).collect();
    let line = format!("can send 8002 4001{:02x}{hex}\n", text.len());
    let mut opened = File::options().read(true).write(true).open(port).unwrap();
    opened.write_all(line.as_bytes()).unwrap();
    let mut answered = Vec::new();
    while !answered.ends_with(b"4101044F4B0D0A\r\n") {
        let mut byte = [0];
        opened.read_exact(&mut byte).unwrap();
        answered.extend(byte);
    }
    drop(opened);
    let told = rig.told();
    assert!(
        told.contains("two drives answer to id 1") && told.contains("id.id"),
        "{told}"
    );
    assert_eq!(told.lines().count(), 1, "{told}");
}

#[test]
fn a_drive_that_does_not_know_where_the_joint_is_is_not_run() {
    let rig = Rig::new("pa10", 1, false, &[]);
    let capabilities = rig.open().unwrap().capabilities();
    let told = capabilities.check(&rig.robot, DriveMode::Torque, PERIOD_NS);
    assert!(told.unwrap_err().to_string().contains("home it"));
}

#[test]
fn the_shipped_robot_file_is_read_and_run() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../robots/moteus_belt.toml");
    let rig = Rig::new(file, 1, true, &[]);
    let mut cycles = Cycles::new(&rig);
    let capabilities = cycles.driver.capabilities();
    assert_eq!(
        capabilities.check(&rig.robot, DriveMode::Torque, PERIOD_NS),
        Ok(())
    );
    cycles.enable();
    cycles.driver.shutdown();
}
