use shm_types::control_options::ControlOptions;
use shm_types::drive::DriveState;
use shm_types::instance::{ControlMode, Wait};
use shm_types::messages::Header;

use super::*;

const PERIOD_NS: u64 = 1_000_000;

fn run(mode: Mode) -> RunConfig {
    RunConfig {
        session: 7,
        robot: "shd17".to_owned(),
        driver: "emulator".to_owned(),
        trajectory: "sine".to_owned(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        mode,
        period_ns: PERIOD_NS,
        cycles: 1,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        estimators: Vec::new(),
        command_deadline_ns: 500_000,
        cores: Vec::new(),
        initial_position_rad: vec![0.0],
    }
}

fn view(mode: Mode) -> View {
    let robot = robot::load("shd17").expect("a shipped robot");
    View::new("arm1", run(mode), robot)
}

fn header(cycle: u64) -> Header {
    Header {
        session: 7,
        cycle,
        measured_at_ns: cycle * PERIOD_NS,
        joint_count: 1,
    }
}

fn status(cycle: u64) -> LoopStatus {
    LoopStatus {
        header: header(cycle),
        state: LoopState::Running as u32,
        wakeup_lateness_ns: 3_000,
        ..LoopStatus::default()
    }
}

#[test]
fn messages_of_another_run_or_robot_are_not_shown() {
    let mut view = view(Mode::Realtime);
    let foreign = Header {
        session: 8,
        ..header(5)
    };
    view.add_status(
        &LoopStatus {
            header: foreign,
            ..status(5)
        },
        0,
    );
    view.add_sample(&SensorSample {
        header: foreign,
        ..SensorSample::default()
    });
    let two_joints = Header {
        joint_count: 2,
        ..header(5)
    };
    view.add_status(
        &LoopStatus {
            header: two_joints,
            ..status(5)
        },
        0,
    );
    let snapshot = view.snapshot(0);
    assert!(!snapshot.heard && snapshot.times.late_at_wakeup.count == 0);
    assert_eq!(snapshot.joints[0].link_position_rad, None);
}

#[test]
fn cycles_not_heard_are_counted_and_skipped_periods_are_not() {
    let mut view = view(Mode::Realtime);
    view.add_status(&status(10), 0);
    view.add_status(&status(11), 0);
    view.add_status(&status(14), 0);
    assert_eq!(view.snapshot(0).lost_cycles, 2);
    let after_a_skip = LoopStatus {
        skipped_periods: 3,
        ..status(18)
    };
    view.add_status(&after_a_skip, 0);
    assert_eq!(view.snapshot(0).lost_cycles, 2);
}

#[test]
fn the_rate_is_of_cycles_that_were_run() {
    let mut view = view(Mode::Realtime);
    // A loop that skips every other period.
    for cycle in (0..4000).step_by(2) {
        let status = LoopStatus {
            skipped_periods: cycle / 2,
            ..status(cycle)
        };
        view.add_status(&status, 0);
    }
    let rate_hz = view.snapshot(0).rate_hz.expect("a rate");
    assert!((rate_hz - 500.0).abs() < 1.0, "{rate_hz}");
}

#[test]
fn every_cycle_is_in_one_bucket_and_lockstep_has_none() {
    let mut times = Times::default();
    for lateness_ns in [900, 1_500, 3_000, 100_000, 5_000_000_000] {
        let status = LoopStatus {
            wakeup_lateness_ns: lateness_ns,
            ..status(0)
        };
        times.record(&status);
    }
    let buckets = times.lateness_buckets();
    let counts = |up_to_us| {
        let bucket = buckets.iter().find(|bucket| bucket.up_to_us == up_to_us);
        bucket.map(|bucket| bucket.count)
    };
    assert_eq!([1, 2, 4, 128, 4096].map(counts), [Some(1); 5]);
    assert_eq!(buckets.iter().map(|bucket| bucket.count).sum::<u64>(), 5);

    let mut lockstep = view(Mode::Lockstep);
    lockstep.add_status(&status(1), 0);
    assert_eq!(lockstep.snapshot(0).times.late_at_wakeup.count, 0);
}

#[test]
fn without_a_sensor_velocity_comes_from_positions() {
    let mut view = view(Mode::Realtime);
    let gear_ratio = view.robot.joints[0].gear_ratio;
    for cycle in 0..=100 {
        let mut sample = SensorSample {
            header: header(cycle),
            ..SensorSample::default()
        };
        // 0.5 rad/s at the joint.
        sample.readings.motor_position_rad[0] = gear_ratio * 0.5 * cycle as f64 * 1e-3;
        view.add_sample(&sample);
    }
    let joint = &view.snapshot(0).joints[0];
    let velocity_rad_s = joint.link_velocity_rad_s.expect("a velocity");
    assert!((velocity_rad_s - 0.5).abs() < 1e-9, "{velocity_rad_s}");
    assert_eq!(joint.joint_torque_nm, None, "no sensor, no number");
}

#[test]
fn a_limit_stays_marked_for_a_moment_and_no_longer() {
    let mut view = view(Mode::Realtime);
    let limited = LoopStatus {
        limited_joints: 1,
        ..status(1)
    };
    view.add_status(&limited, 0);
    view.add_status(&status(1 + LIMITED_SHOWN_CYCLES), 0);
    assert!(view.snapshot(0).joints[0].limited);
    view.add_status(&status(2 + LIMITED_SHOWN_CYCLES), 0);
    assert!(!view.snapshot(0).joints[0].limited);
}

#[test]
fn clearing_forgets_times_and_keeps_the_state() {
    let mut view = view(Mode::Realtime);
    view.add_status(&status(1), 0);
    view.clear();
    let snapshot = view.snapshot(0);
    assert_eq!(snapshot.times.late_at_wakeup.count, 0);
    assert_eq!(snapshot.state, "Running");
}

#[test]
fn a_drive_that_is_not_as_it_should_be_is_told_first() {
    let mut view = view(Mode::Realtime);
    view.add_status(&status(1), 0);
    assert_eq!(
        view.snapshot(0).joints[0].drive,
        None,
        "a driver that tells nothing"
    );
    let mut told = status(2);
    let words = |view: &View| {
        let snapshot = view.snapshot(0);
        snapshot.joints[0].drive.as_ref().expect("told").words()
    };
    told.drives.state[0] = DriveState::Enabled as u32;
    view.add_status(&told, 0);
    assert_eq!(words(&view), "");
    told.drives.age_cycles[0] = 3;
    view.add_status(&told, 0);
    assert_eq!(words(&view), "old 3");
    told.drives.state[0] = DriveState::Fault as u32;
    told.drives.error_code[0] = 0x2310;
    told.fault = 18 | 0x2310 << 16;
    view.add_status(&told, 0);
    assert_eq!(words(&view), "0x2310");
    let fault = view.snapshot(0).fault.expect("told");
    assert!(
        fault.contains("joint1") && fault.contains("0x2310"),
        "{fault}"
    );
}
