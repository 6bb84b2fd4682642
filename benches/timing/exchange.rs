//! From publishing a sample to holding the command for it, through the feedforward process, beside a bare exchange of messages of
//! the same size between two processes: both asleep until woken, and both spinning. The loop is the real one with drives that stand
//! still in memory, because on two cores no third process would get a core while two spin. The whole system is timed too.

use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use realtime::cores::usable_cores;
use realtime::process::{send_signal, user_id};
use rt_loop::config::cycle_config;
use rt_loop::driver::{Capabilities, DriveFault, Driver};
use rt_loop::process::control;
use rt_loop::report::LoopReport;
use shm_types::bus::Bus;
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Instance, Mode, RunConfig, Wait};
use shm_types::messages::{DriveCommand, DriveSample, Header, Supervision};
use shm_types::topics;

use crate::Extent;
use crate::echo;
use crate::histograms::{cells, empty, quantiles_us, ratios, write_hgrm};
use crate::page;
use crate::run::{PROGRAM, flexspline, instance_name, stay_off};

const PERIOD_NS: u64 = 666_667;
const SESSION: u64 = 1;
/// The service needs so long to join.
const START: Duration = Duration::from_millis(700);

/// Drives of an arm that stands where it is.
struct StillDrives {
    start_rad: Vec<f64>,
    mode: u32,
}

impl Driver for StillDrives {
    fn capabilities(&self) -> Capabilities {
        Capabilities::default()
    }

    fn read(
        &mut self,
        cycle: u64,
        planned_ns: u64,
        _give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault> {
        let mut sample = DriveSample {
            header: Header {
                session: SESSION,
                cycle,
                measured_at_ns: planned_ns,
                joint_count: self.start_rad.len() as u64,
            },
            mode: self.mode,
            ..DriveSample::default()
        };
        sample.readings.motor_position_rad[..self.start_rad.len()].copy_from_slice(&self.start_rad);
        Ok(sample)
    }

    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        self.mode = command.mode;
        Ok(())
    }
}

pub fn report(extent: &Extent) {
    println!(
        "{} rounds of {} s for each case; from a sample's publication to its command, µs\n",
        extent.rounds, extent.seconds
    );
    let waits = [(Wait::Block, "blocking"), (Wait::Spin, "spinning")];
    let mut bare = waits.map(|_| (Vec::new(), empty()));
    let mut through = waits.map(|_| Vec::new());
    let mut whole = Vec::new();
    for _ in 0..extent.rounds {
        for (index, (wait, _)) in waits.iter().enumerate() {
            let times = in_instance(*wait, |instance| echo::ask(instance, extent.seconds));
            bare[index].0.push(quantiles_us(&times));
            bare[index].1 += &times;
            let report = in_instance(*wait, |instance| loop_alone(instance, extent.seconds));
            let latency = report.command_latency;
            through[index].push([latency.p50_us, latency.p99_us, latency.p999_us]);
        }
        whole.push(flexspline(&[], extent.seconds, None).quantiles_us("command_latency"));
    }
    println!("| | p50 | p99 | p99.9 |\n|---|---|---|---|");
    for (index, (_, name)) in waits.iter().enumerate() {
        println!("| bare exchange, {name} | {} |", cells(&bare[index].0, 2));
        println!(
            "| loop and feedforward, {name} | {} |",
            cells(&through[index], 2)
        );
        let over = ratios(&through[index], &bare[index].0);
        println!("| over the bare exchange | {} |", cells(&over, 2));
        let file = format!("exchange-bare-{name}.hgrm");
        write_hgrm(&extent.folder.join(file), &bare[index].1);
    }
    println!("| whole system, blocking | {} |", cells(&whole, 2));
    println!(
        "| over the bare exchange | {} |",
        cells(&ratios(&whole, &bare[0].0), 2)
    );
    let panel = page::percentiles(
        "bare exchange",
        waits
            .iter()
            .zip(&bare)
            .map(|((_, name), (_, times))| (*name, times)),
    );
    let figure = page::figure("Bare exchange of a sample and a command.", vec![panel]);
    page::write(
        &extent.folder.join("exchange.html"),
        "Exchange",
        vec![figure],
    );
}

/// An instance with its directory and its run, for as long as `work` takes, on a thread of its own that may become real-time.
fn in_instance<T: Send>(wait: Wait, work: impl FnOnce(&Instance) -> T + Send) -> T {
    let instance = Instance::new(&instance_name(), user_id()).expect("a good name");
    instance.make_parent(user_id()).expect("ours");
    instance.wipe().expect("nobody lives there");
    instance.make_directory().expect("ours");
    instance.write_run_config(&run(wait)).expect("ours");
    let result = std::thread::scope(|scope| scope.spawn(|| work(&instance)).join());
    instance.vanish().expect("ours");
    result.expect("the work is done")
}

fn run(wait: Wait) -> RunConfig {
    let robot = robot::load("pa10").expect("shipped");
    let hold = motion::load("hold", &robot).expect("shipped");
    let mut start = motion::Reference::default();
    hold.sample(0.0, &mut start);
    RunConfig {
        session: SESSION,
        robot: "pa10".to_owned(),
        driver: "still".to_owned(),
        trajectory: "hold".to_owned(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        estimators: Vec::new(),
        mode: Mode::Realtime,
        period_ns: PERIOD_NS,
        cycles: 0,
        wait,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        command_deadline_ns: PERIOD_NS * 3 / 4,
        cores: usable_cores(),
        initial_position_rad: start.position_rad[..robot.joints.len()].to_vec(),
    }
}

/// The loop on the calling thread, and the feedforward process.
fn loop_alone(instance: &Instance, seconds: u64) -> LoopReport {
    let mut run = instance.run_config().expect("written before");
    run.cycles = seconds * 1_000_000_000 / PERIOD_NS;
    let robot = robot::load(&run.robot).expect("shipped");
    let mut feedforward = start_feedforward(instance);
    std::thread::sleep(START);
    let stop = Arc::new(AtomicBool::new(false));
    let supervisor = supervise(instance, run.core_of(topics::Role::Loop), &stop);
    let bus = Bus::join(instance).expect("ours");
    let gears = robot.joints.iter().map(|joint| joint.gear_ratio);
    let drives = StillDrives {
        start_rad: run
            .initial_position_rad
            .iter()
            .zip(gears)
            .map(|(joint_rad, gear)| joint_rad * gear)
            .collect(),
        mode: 0,
    };
    let config = cycle_config(&run, &robot);
    let report = control(&bus, drives, run, config, &AtomicBool::new(false)).expect("runs");
    stop.store(true, Ordering::Relaxed);
    supervisor.join().expect("it only sends");
    send_signal(feedforward.id(), libc::SIGTERM);
    feedforward.wait().expect("our own process");
    assert_eq!(report.final_state, "Running", "{:?}", report.last_fault);
    report
}

fn start_feedforward(instance: &Instance) -> Child {
    Command::new(PROGRAM)
        .args(["process", "feedforward", "--instance", instance.name()])
        .stdin(Stdio::null())
        .spawn()
        .expect("the program starts")
}

/// Tells the loop that somebody looks after it.
fn supervise(
    instance: &Instance,
    loop_core: Option<usize>,
    stop: &Arc<AtomicBool>,
) -> std::thread::JoinHandle<()> {
    let (instance, stop) = (instance.clone(), Arc::clone(stop));
    std::thread::spawn(move || {
        if let Some(core) = loop_core {
            stay_off(core);
        }
        let bus = Bus::join(&instance).expect("ours");
        let mut orders = bus.writer(&topics::SUPERVISION).expect("the only one");
        while !stop.load(Ordering::Relaxed) {
            orders.send_and_prepare(Supervision {
                session: SESSION,
                ..Supervision::default()
            });
            std::thread::sleep(Duration::from_millis(5));
        }
    })
}
