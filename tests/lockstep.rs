//! Lockstep: virtual time, every process waits for every other, the same bytes every time.

mod support;

use std::fs;

use recording::Signal;
use shm_types::control_options::{ControlOptions, FrictionVelocity};
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use support::{Bench, output, text};

fn run(bench: &Bench, arguments: &[&str]) -> Vec<u8> {
    let output = output(bench.run(&[&["--mode", "lockstep"], arguments].concat()));
    assert!(output.status.success(), "{}", text(&output));
    assert_eq!(bench.left_behind(), Vec::<String>::new());
    fs::read(bench.file("run.mcap")).expect("a recording")
}

#[test]
fn two_runs_give_the_same_bytes_and_another_seed_gives_others() {
    let (first, second, third) = (
        Bench::new("same1"),
        Bench::new("same2"),
        Bench::new("same3"),
    );
    let bytes = run(&first, &["--duration", "3s"]);
    assert!(
        bytes == run(&second, &["--duration", "3s"]),
        "two runs differ"
    );
    assert!(
        bytes != run(&third, &["--duration", "3s", "--seed", "2"]),
        "the seed changes nothing"
    );
}

#[test]
fn the_twin_in_one_process_gives_the_same_bytes() {
    let corrected = ControlOptions {
        friction_velocity: FrictionVelocity::Measured,
        correction_gain: 1.0,
        ..ControlOptions::default()
    };
    for (name, control, options, arguments) in [
        (
            "torque",
            ControlMode::Torque,
            ControlOptions::default(),
            &[][..],
        ),
        (
            "options",
            ControlMode::Torque,
            corrected,
            &["--friction-velocity", "measured", "--correction", "1"][..],
        ),
        (
            "velocity",
            ControlMode::Velocity,
            ControlOptions::default(),
            &["--control", "velocity"][..],
        ),
    ] {
        let bench = Bench::new(&format!("tw-{}", &name[..3]));
        let bytes = run(&bench, &[&["--duration", "2s"], arguments].concat());
        let robot = robot::load("pa10").expect("shipped");
        let trajectory = motion::load("lemniscate", &robot).expect("shipped");
        let mut start = motion::Reference::default();
        trajectory.sample(0.0, &mut start);
        let path = bench.file("twin.mcap");
        let config = RunConfig {
            session: 99,
            robot: "pa10".to_owned(),
            driver: "emulator".to_owned(),
            trajectory: "lemniscate".to_owned(),
            plant: None,
            control,
            options,
            estimators: Vec::new(),
            mode: Mode::Lockstep,
            period_ns: 666_667,
            cycles: 2_999,
            wait: Wait::Block,
            wake_early_ns: 0,
            seed: 1,
            inject: None,
            record: Some(path.clone()),
            command_deadline_ns: 500_000,
            cores: Vec::new(),
            initial_position_rad: start.position_rad[..7].to_vec(),
        };
        twin::record(&config, twin::Robots::same(&robot), trajectory, &[], |_| {
            true
        })
        .expect("runs");
        assert!(bytes == fs::read(path).expect("recorded"), "{name} differs");
    }
}

#[test]
fn every_cycle_is_recorded_with_every_signal() {
    let bench = Bench::new("rows");
    run(&bench, &["--duration", "2s"]);
    let recording = recording::read(&bench.file("run.mcap")).expect("our own file");
    assert_eq!(
        recording.rows(),
        2 * 1500 - 1,
        "2 s of periods of 666 667 ns"
    );
    assert_eq!(recording.joint_names().count(), 7);
    for joint in recording.joint_names() {
        for signal in [
            Signal::MotorPositionRad,
            Signal::MotorTorqueNm,
            Signal::CommandTorqueNm,
        ] {
            let values = recording.signal(joint, signal).expect("recorded");
            assert!(
                values.iter().all(|value| value.is_finite()),
                "{joint} {}",
                signal.name()
            );
        }
    }
}

#[test]
fn the_arm_follows_its_lemniscate() {
    let bench = Bench::new("follow");
    run(&bench, &["--duration", "15s"]);
    let report = bench.report();
    let error = &report["tracking"]["end_effector_error_m"];
    let mean_m = error["mean"].as_f64().expect("a mean error");
    // The paper's arm: 42 mm at most. Its mean of 7 mm took a table of position-dependent friction as well.
    assert!(mean_m < 0.025, "{error}");
    assert!(error["max"].as_f64().expect("a maximum") < 0.042, "{error}");
    assert_eq!(report["timing"]["final_state"], "Running");
    assert_eq!(report["timing"]["counters"]["stale_commands"], 0);
    assert_eq!(report["tracking"]["lost_rows"], 0);
}

#[test]
fn the_correction_takes_away_most_of_what_the_published_tables_lack() {
    let (paper, corrected) = (Bench::new("paper"), Bench::new("corr"));
    run(&paper, &["--duration", "8s"]);
    run(&corrected, &["--duration", "8s", "--correction", "1"]);
    let mean_m = |bench: &Bench| {
        bench.report()["tracking"]["end_effector_error_m"]["mean"]
            .as_f64()
            .expect("a mean error")
    };
    assert!(mean_m(&corrected) < 0.7 * mean_m(&paper));
}

#[test]
fn the_single_test_joint_runs_with_its_torque_sensor() {
    let bench = Bench::new("shd17");
    run(&bench, &["--robot", "shd17", "--duration", "5s"]);
    let recording = recording::read(&bench.file("run.mcap")).expect("our own file");
    let joint = recording.joints[0].name.clone();
    for signal in [Signal::JointTorqueNm, Signal::LinkPositionRad] {
        assert!(
            recording.signal(&joint, signal).is_ok(),
            "{}",
            signal.name()
        );
    }
    let estimate =
        &bench.report()["tracking"]["joints"][0]["estimate_errors_nm"]["structural_damping"];
    assert!(
        estimate["rms"].as_f64().is_some_and(f64::is_finite),
        "{estimate}"
    );
}

#[test]
fn an_injected_effect_shows_from_its_start_on() {
    let (plain, changed) = (Bench::new("plain"), Bench::new("inject"));
    let file = changed.file("gap.toml");
    let effect = "[[effect]]\njoint = \"joint2\"\neffect = \"coulomb_friction\"\ncoulomb_nm = 10.0\nstart_s = 1.5\n";
    fs::write(&file, effect).expect("written");
    run(&plain, &["--duration", "3s"]);
    run(
        &changed,
        &[
            "--duration",
            "3s",
            "--inject",
            file.to_str().expect("a path"),
        ],
    );
    let command = |bench: &Bench| {
        let recording = recording::read(&bench.file("run.mcap")).expect("our own file");
        recording
            .signal("joint2", Signal::CommandTorqueNm)
            .expect("recorded")
            .to_vec()
    };
    let (before, after) = (command(&plain), command(&changed));
    let first_difference = before
        .iter()
        .zip(&after)
        .position(|(a, b)| a != b)
        .expect("the effect shows");
    // 1.5 s is sample 2250. The effect grows over 50 ms, 75 samples, and within them moves the motor by a step of its encoder.
    assert!(
        (2250..2325).contains(&first_difference),
        "sample {first_difference}"
    );
}
