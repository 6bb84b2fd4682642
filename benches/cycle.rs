//! What a cycle of seven joints costs each process, without waiting for anybody. `messages` is the yardstick: what
//! handing one message over costs, so that the rest can be read as a multiple of it on any machine.
#![allow(missing_docs, reason = "the macros make undocumented functions")]

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use realtime::process::user_id;
use robot::Robot;
use rt_loop::config::cycle_config;
use rt_loop::cycle::{CycleConfig, CycleInput, CycleState, Orders};
use services::estimators::Estimators;
use services::feedforward::Feedforward;
use shm_types::bus::Bus;
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Instance, Mode, RunConfig, Wait};
use shm_types::messages::{Command, DriveMode, DriveSample, SensorSample};
use shm_types::topics;

const PERIOD_NS: u64 = 666_667;

fn pa10() -> Robot {
    robot::load("pa10").expect("a shipped robot")
}

fn config(robot: &Robot) -> CycleConfig {
    let run = RunConfig {
        session: 1,
        robot: robot.name.clone(),
        driver: "emulator".to_owned(),
        trajectory: "lemniscate".to_owned(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        estimators: Vec::new(),
        mode: Mode::Lockstep,
        period_ns: PERIOD_NS,
        cycles: u64::MAX,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        command_deadline_ns: 500_000,
        cores: Vec::new(),
        initial_position_rad: vec![0.0; robot.joints.len()],
    };
    cycle_config(&run, robot)
}

fn torque_command() -> Command {
    Command {
        mode: DriveMode::Torque as u32,
        ..Command::default()
    }
}

/// A drive sample of an arm that moves slowly, as `cycle` would measure it.
fn drive_sample(cycle: u64) -> DriveSample {
    let mut sample = DriveSample::default();
    sample.header.cycle = cycle;
    let phase = TAU * cycle as f64 / 15_000.0;
    sample.readings.motor_position_rad[..7].fill(50.0 * 0.1 * phase.sin());
    sample.readings.motor_torque_nm[..7].fill(0.3 * phase.cos());
    sample
}

fn sensor_sample(cycle: u64) -> SensorSample {
    let drive = drive_sample(cycle);
    let mut sample = SensorSample {
        header: drive.header,
        motion_time_ns: cycle * PERIOD_NS,
        motion_rate: 1.0,
        readings: drive.readings,
        ..SensorSample::default()
    };
    sample.header.joint_count = 7;
    sample
}

fn loop_step(criterion: &mut Criterion) {
    let config = config(&pa10());
    let (mut state, mut cycle) = (CycleState::default(), 0);
    criterion.bench_function("loop: one step", |bench| {
        bench.iter(|| {
            cycle += 1;
            let (sample, command) = (drive_sample(cycle), torque_command());
            let input = CycleInput {
                cycle,
                planned_ns: cycle * PERIOD_NS,
                sample: Ok(&sample),
                command: Some(&command),
                orders: Orders::default(),
            };
            black_box(state.step(&config, black_box(&input)))
        })
    });
}

fn feedforward(criterion: &mut Criterion) {
    let robot = pa10();
    let trajectory = motion::load("lemniscate", &robot).expect("a shipped trajectory");
    let controller = Feedforward::new(
        robot,
        trajectory,
        PERIOD_NS as f64 * 1e-9,
        &ControlOptions::default(),
    );
    let (mut controller, mut cycle) = (controller.expect("a shipped robot"), 0);
    criterion.bench_function("feedforward: one command", |bench| {
        bench.iter(|| {
            cycle += 1;
            black_box(controller.command(black_box(&sensor_sample(cycle))))
        })
    });
}

fn estimators(criterion: &mut Criterion) {
    let estimators = Estimators::new(&pa10(), &[], PERIOD_NS as f64 * 1e-9);
    let (mut estimators, mut cycle) = (estimators.expect("a shipped robot"), 0);
    criterion.bench_function("estimator: one estimate of each joint", |bench| {
        bench.iter(|| {
            cycle += 1;
            black_box(estimators.estimate(black_box(&sensor_sample(cycle))))
        })
    });
}

fn messages(criterion: &mut Criterion) {
    let name = format!("bench-{}", std::process::id());
    let instance = Instance::new(&name, user_id()).expect("a good name");
    instance.make_parent(user_id()).expect("ours");
    instance.make_directory().expect("made");
    let bus = Bus::join(&instance).expect("joined");
    let mut writer = bus.writer(&topics::COMMAND).expect("the only writer");
    let reader = bus.reader(&topics::COMMAND).expect("a reader");
    let mut cycle = 0;
    criterion.bench_function("messages: a command sent and taken", |bench| {
        bench.iter(|| {
            cycle += 1;
            let mut command = Command::default();
            command.header.cycle = cycle;
            assert!(
                writer.send_and_prepare(black_box(command)),
                "somebody reads"
            );
            black_box(reader.take_newest())
        })
    });
    drop((writer, reader, bus));
    instance.vanish().expect("wiped");
}

criterion_group!(benches, loop_step, feedforward, estimators, messages);
criterion_main!(benches);
