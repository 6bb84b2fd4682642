//! From sending to every joint of the PA-10 until all have answered, on virtual drives behind pseudo-terminals.
//!
//! `cargo bench -p moteus-driver` prints p50, p99, p99.9 and maximum, and how many cycles lacked an answer. It says what
//! driver and port cost; the bus's own time comes on top and is what the driver reckons with at its start.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use moteus_driver::MOTEUS;
use moteus_emulator::process::Ports;
use moteus_emulator::{Bench, Setup};
use realtime::clock::{monotonic_ns, sleep_until};
use rt_loop::driver::OpenContext;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use shm_types::messages::{DriveCommand, DriveMode, DriveRequest, Header};

const CYCLES: u64 = 15_000;
const PERIOD_NS: u64 = 2_000_000;
/// An answer that has not come by then is lost.
const PATIENCE_NS: u64 = 1_800_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for buses in [1, 2, 4] {
        measure(buses)?;
    }
    Ok(())
}

fn measure(buses: usize) -> Result<(), Box<dyn std::error::Error>> {
    let mut robot = robot::load("pa10")?;
    let joints = robot.joints.len();
    let mut ports = Ports::open(buses, None)?;
    let paths: Vec<String> = (0..buses)
        .map(|bus| format!("{:?}", ports.path(bus)))
        .collect();
    robot.drive = Some(format!("ports = [{}]", paths.join(", ")).parse()?);
    for (index, joint) in robot.joints.iter_mut().enumerate() {
        let bus = index * buses / joints + 1;
        joint.drive = Some(format!("id = {}\nbus = {bus}", index + 1).parse()?);
    }
    let setup = Setup {
        initial_position_rad: vec![0.0; joints],
        buses,
        is_homed: true,
        seed: 1,
        faults: Vec::new(),
    };
    let stop = Arc::new(AtomicBool::new(false));
    let served = {
        let (robot, stop) = (robot.clone(), Arc::clone(&stop));
        thread::spawn(move || {
            Bench::new(&robot, &setup)
                .map(|mut bench| ports.serve(&mut bench, &stop, |_| ()))
                .is_ok()
        })
    };
    let run = RunConfig {
        session: 1,
        robot: "pa10".to_owned(),
        driver: "moteus".to_owned(),
        trajectory: "hold".to_owned(),
        plant: None,
        control: ControlMode::Torque,
        options: Default::default(),
        estimators: Vec::new(),
        mode: Mode::Realtime,
        period_ns: PERIOD_NS,
        cycles: CYCLES,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        command_deadline_ns: PERIOD_NS,
        cores: Vec::new(),
        initial_position_rad: vec![0.0; joints],
    };
    let mut driver = (MOTEUS.open)(&OpenContext {
        run: &run,
        robot: &robot,
        bus: None,
    })?;
    let (mut taken_ns, mut lacking) = (Vec::with_capacity(CYCLES as usize), 0);
    let mut planned_ns = monotonic_ns();
    for cycle in 0..CYCLES {
        let command = DriveCommand {
            header: Header {
                session: 1,
                cycle,
                measured_at_ns: planned_ns,
                joint_count: joints as u64,
            },
            mode: DriveMode::Torque as u32,
            request: DriveRequest::Enable as u32,
            ..DriveCommand::default()
        };
        let begun_ns = monotonic_ns();
        let written = driver.write(&command);
        let sample = driver.read(cycle, planned_ns, begun_ns + PATIENCE_NS);
        taken_ns.push(monotonic_ns() - begun_ns);
        let answered = sample.map_or(0, |sample| sample.bus.working_counter);
        lacking += u64::from(written.is_err() || answered < joints as u32);
        planned_ns += PERIOD_NS;
        sleep_until(planned_ns);
    }
    driver.shutdown();
    stop.store(true, Ordering::Relaxed);
    let _ = served.join();
    taken_ns.sort_unstable();
    let at = |share: f64| taken_ns[((taken_ns.len() - 1) as f64 * share) as usize] as f64 / 1000.0;
    println!(
        "7 joints on {buses} buses: p50 {:.0} us, p99 {:.0} us, p99.9 {:.0} us, maximum {:.0} us; {lacking} of {CYCLES} cycles \
         lacked an answer",
        at(0.5),
        at(0.99),
        at(0.999),
        at(1.0)
    );
    Ok(())
}
