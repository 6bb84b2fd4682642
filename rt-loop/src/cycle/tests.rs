//! Laws of the cycle.

use super::*;
use crate::admission::{check_sample, is_usable};
use proptest::prelude::*;
use shm_types::JOINTS_MAX;
use shm_types::drive::DriveState;

fn config() -> CycleConfig {
    let joint = JointLimits {
        gear_ratio: 50.0,
        motor_torque_nm: 2.0,
        motor_torque_rate_nm_s: 300.0,
        position_min_rad: -1.0,
        position_max_rad: 1.0,
        velocity_rad_s: 1.0,
        acceleration_rad_s2: 10.0,
        damping_nm_s_rad: 50.0,
        standstill_rad: 0.05,
        following_rad: 1.0,
    };
    CycleConfig {
        session: 9,
        period_ns: 666_667,
        joints: vec![joint; 2],
        joint_names: vec!["shoulder".to_owned(), "elbow".to_owned()],
        hold_cycles: 3,
        damping_cycles: 2,
        waiting_cycles: 2,
        enabling_cycles: 6,
        reenabling_cycles: 4,
        reset_cycles: 3,
    }
}

fn sample(position_rad: f64) -> DriveSample {
    let header = Header {
        session: 9,
        cycle: 0,
        measured_at_ns: 0,
        joint_count: 2,
    };
    let mut sample = DriveSample {
        header,
        mode: DriveMode::Torque as u32,
        ..DriveSample::default()
    };
    sample.readings.motor_position_rad[..2].fill(50.0 * position_rad);
    sample
}

fn command(torque_nm: f64) -> Command {
    Command {
        mode: DriveMode::Torque as u32,
        motor_torque_nm: [torque_nm; JOINTS_MAX],
        ..Command::default()
    }
}

fn run(
    state: &mut CycleState,
    cycle: u64,
    sample: Result<&DriveSample, DriveFault>,
    command: Option<&Command>,
) -> CycleOutput {
    state.step(
        &config(),
        &CycleInput {
            cycle,
            planned_ns: cycle * 666_667,
            sample,
            command,
            orders: Orders::default(),
        },
    )
}

#[test]
fn the_policy_for_missing_commands_goes_step_by_step_and_latches() {
    let (still, hold) = (sample(0.0), command(1.0));
    let mut state = CycleState::default();
    let mut seen = Vec::new();
    run(&mut state, 0, Err(DriveFault::NoSample), None);
    seen.push(state.state);
    run(&mut state, 1, Ok(&still), None);
    seen.push(state.state);
    let first = run(&mut state, 2, Ok(&still), Some(&hold));
    assert_eq!(
        first.drive_command.motor_torque_nm[0], 1.0,
        "brakes open with the whole torque"
    );
    seen.push(state.state);
    for cycle in 3..12 {
        run(&mut state, cycle, Ok(&still), None);
        seen.push(state.state);
    }
    let late = run(&mut state, 12, Ok(&still), Some(&hold));
    seen.push(state.state);
    use LoopState::*;
    assert_eq!(
        seen,
        [
            Initialising,
            Ready,
            Running,
            Holding,
            Holding,
            Holding,
            Damping,
            Damping,
            Damping,
            Damping,
            SafeStop,
            SafeStop,
            SafeStop
        ]
    );
    assert_eq!(late.drive_command.mode, DriveMode::Braked as u32);
    assert_eq!(late.drive_command.motor_torque_nm[0], 0.0);
}

#[test]
fn one_late_cycle_changes_nothing_but_a_counter() {
    let (still, hold) = (sample(0.0), command(1.0));
    let mut state = CycleState::default();
    for cycle in 0..100 {
        run(&mut state, cycle, Ok(&still), Some(&hold));
    }
    let held = run(&mut state, 100, Ok(&still), None);
    assert_eq!(
        (state.state, held.drive_command.motor_torque_nm[0]),
        (LoopState::Holding, 1.0)
    );
    let before_ns = motion_time_ns(&state);
    run(&mut state, 101, Ok(&still), Some(&hold));
    assert_eq!(state.state, LoopState::Running);
    assert_eq!(
        motion_time_ns(&state),
        before_ns + 666_667,
        "the trajectory keeps time"
    );
}

#[test]
fn skipped_periods_advance_the_trajectory_and_damping_stops_it() {
    let (still, hold) = (sample(0.0), command(0.0));
    let mut state = CycleState::default();
    run(&mut state, 0, Ok(&still), Some(&hold));
    run(&mut state, 5, Ok(&still), Some(&hold));
    assert_eq!(motion_time_ns(&state), 5 * 666_667);
    for cycle in 6..11 {
        run(&mut state, cycle, Ok(&still), None);
    }
    assert_eq!((state.state, state.clock.rate()), (LoopState::Damping, 0.0));
    let waiting_ns = motion_time_ns(&state);
    run(&mut state, 11, Ok(&still), Some(&hold));
    assert_eq!(motion_time_ns(&state), waiting_ns);
    let asked = state.sensor_sample(&config(), 12, &still);
    assert!(
        asked.motion_time_ns < waiting_ns + 666_667 / 100,
        "starts again gently"
    );
}

#[test]
fn drives_that_have_stopped_are_acknowledged_and_the_run_goes_on() {
    let (still, hold) = (sample(0.0), command(1.0));
    let stopped = DriveSample {
        mode: DriveMode::Damping as u32,
        ..still
    };
    let mut state = CycleState::default();
    for cycle in 0..10 {
        run(&mut state, cycle, Ok(&still), Some(&hold));
    }
    let acknowledged = run(&mut state, 10, Ok(&stopped), Some(&hold));
    assert_eq!(
        (state.state, acknowledged.drive_command.mode),
        (LoopState::Damping, DriveMode::Damping as u32)
    );
    assert_eq!(state.fault, Some(Fault::DrivesStopped));
    // The drives still show damping for two cycles, now because they were asked to.
    for cycle in 11..13 {
        let output = run(&mut state, cycle, Ok(&stopped), Some(&hold));
        assert_eq!(
            (state.state, output.drive_command.mode),
            (LoopState::Running, DriveMode::Torque as u32)
        );
    }
    run(&mut state, 13, Ok(&still), Some(&hold));
    assert_eq!(state.state, LoopState::Running);
}

#[test]
fn velocities_are_limited_held_and_dropped_like_torques() {
    let still = sample(0.0);
    let ask = |velocity_rad_s| Command {
        mode: DriveMode::Velocity as u32,
        joint_velocity_rad_s: [velocity_rad_s; JOINTS_MAX],
        ..Command::default()
    };
    let mut state = CycleState::default();
    let mut sent_rad_s = 0.0;
    for cycle in 0..200 {
        let output = run(&mut state, cycle, Ok(&still), Some(&ask(5.0)));
        assert_eq!(output.drive_command.mode, DriveMode::Velocity as u32);
        let rad_s = output.drive_command.joint_velocity_rad_s[0];
        assert!(
            rad_s - sent_rad_s < 10.0 / 1500.0 + 1e-6,
            "no faster than the limit"
        );
        sent_rad_s = rad_s;
    }
    assert_eq!(sent_rad_s, 1.0, "the velocity limit");
    let held = run(&mut state, 200, Ok(&still), None);
    assert_eq!(held.drive_command.joint_velocity_rad_s[0], 1.0);
    for cycle in 201..210 {
        run(&mut state, cycle, Ok(&still), None);
    }
    let damped = run(&mut state, 210, Ok(&still), None);
    assert_ne!(damped.drive_command.mode, DriveMode::Velocity as u32);
    assert_eq!(damped.drive_command.joint_velocity_rad_s[0], 0.0);
    assert!(!is_usable(&ask(f64::NAN), 2));
    assert!(!is_usable(
        &Command {
            mode: 9,
            ..ask(0.0)
        },
        2
    ));
}

#[test]
fn a_joint_that_runs_away_ends_the_run() {
    let hold = command(0.0);
    let mut state = CycleState::default();
    run(&mut state, 0, Ok(&sample(0.0)), Some(&hold));
    let output = run(&mut state, 1, Ok(&sample(0.0015)), Some(&hold));
    assert_eq!(state.state, LoopState::Faulted);
    let reason = state
        .fault
        .map(|fault| fault.sentence(&config().joint_names));
    let reason = reason.unwrap();
    assert!(
        reason.contains("shoulder ran away: 2.250 rad/s"),
        "{reason}"
    );
    assert_eq!(output.drive_command.mode, DriveMode::Braked as u32);
}

#[test]
fn a_repeated_sample_at_high_speed_is_no_runaway() {
    let hold = command(0.0);
    let mut state = CycleState::default();
    // 0.9 of the velocity limit; every tenth sample is that of the cycle before.
    for cycle in 0..1000_u64 {
        let seen = if cycle % 10 == 9 { cycle - 1 } else { cycle };
        let moving = sample(0.9 * seen as f64 / 1500.0);
        run(&mut state, cycle, Ok(&moving), Some(&hold));
        assert_eq!(state.state, LoopState::Running, "cycle {cycle}");
    }
}

#[test]
fn one_jump_of_an_encoder_is_not_believed_and_one_that_stays_is_a_fault() {
    let config = config();
    let mut state = CycleState::default();
    run(&mut state, 0, Ok(&sample(0.0)), Some(&command(0.0)));
    let jumped = sample(0.05);
    let refused = Err(DriveFault::JumpedSample { joint: 0 });
    assert_eq!(state.admit(&config, 1, &jumped), refused);
    run(&mut state, 1, refused.map(|()| &jumped), None);
    assert_eq!(state.state, LoopState::Holding);
    assert_eq!(state.admit(&config, 2, &sample(0.0001)), Ok(()));
    // A joint at its velocity limit would need 75 cycles for it; at ten times that it is no longer a jump but a runaway.
    let believed = (2..100).find(|&cycle| state.admit(&config, cycle, &jumped).is_ok());
    let cycle = believed.unwrap();
    run(&mut state, cycle, Ok(&jumped), Some(&command(0.0)));
    assert_eq!((cycle, state.state), (8, LoopState::Faulted));
}

#[test]
fn an_encoder_that_stands_while_its_reference_goes_on_is_a_fault() {
    let mut state = CycleState::default();
    let mut reference = command(0.0);
    let mut stopped_at_rad = None;
    for cycle in 0..2000_u64 {
        reference.reference_position_rad[..2].fill(0.3 * cycle as f64 / 1500.0);
        // The second joint's encoder shows no step; the first one's is coarse.
        let mut seen = sample(0.0);
        seen.readings.motor_position_rad[0] = 0.01 * (cycle / 100) as f64;
        run(&mut state, cycle, Ok(&seen), Some(&reference));
        if state.state == LoopState::Faulted {
            stopped_at_rad.get_or_insert(reference.reference_position_rad[0]);
        }
    }
    assert!(
        matches!(state.fault, Some(Fault::Stuck { joint: 1, .. })),
        "{:?}",
        state.fault
    );
    assert!((stopped_at_rad.unwrap() - config().joints[1].standstill_rad).abs() < 0.001);
}

#[test]
fn a_joint_far_from_its_reference_is_a_fault() {
    let mut state = CycleState::default();
    let mut reference = command(0.0);
    run(&mut state, 0, Ok(&sample(0.0)), Some(&reference));
    reference.reference_position_rad[1] = -0.9;
    run(&mut state, 1, Ok(&sample(0.0)), Some(&reference));
    assert_eq!(state.state, LoopState::Running, "low gains");
    reference.reference_position_rad[..2].fill(-1.1);
    let output = run(&mut state, 2, Ok(&sample(0.0)), Some(&reference));
    assert!(matches!(
        state.fault,
        Some(Fault::Stuck { .. } | Fault::Astray { joint: 0, .. })
    ));
    assert_eq!(output.drive_command.mode, DriveMode::Braked as u32);
}

fn run_with(state: &mut CycleState, cycle: u64, orders: Orders, inputs: u32) -> CycleOutput {
    let seen = DriveSample {
        inputs,
        ..sample(0.0)
    };
    let asked = command(1.0);
    let input = CycleInput {
        cycle,
        planned_ns: cycle * 666_667,
        sample: Ok(&seen),
        command: Some(&asked),
        orders,
    };
    state.step(&config(), &input)
}

#[test]
fn an_emergency_stop_brakes_in_its_cycle_and_only_a_reset_without_it_goes_on() {
    let none = Orders::default();
    let reset = Orders {
        reset: true,
        ..none
    };
    let mut state = CycleState::default();
    run_with(&mut state, 0, none, 0);
    run_with(&mut state, 1, none, 0);
    let stopped = run_with(&mut state, 2, none, EMERGENCY_STOP_PRESSED);
    assert_eq!(stopped.drive_command.mode, DriveMode::Braked as u32);
    assert_eq!(
        (state.state, state.fault),
        (LoopState::SafeStop, Some(Fault::EmergencyStop))
    );
    run_with(&mut state, 3, reset, EMERGENCY_STOP_PRESSED);
    assert_eq!(state.state, LoopState::SafeStop, "still pressed");
    run_with(&mut state, 4, none, 0);
    assert_eq!(state.state, LoopState::SafeStop, "released is not reset");
    run_with(&mut state, 5, reset, 0);
    assert_eq!(state.state, LoopState::Ready);
    let moving = run_with(&mut state, 6, none, 0);
    assert_eq!(state.state, LoopState::Running);
    assert_eq!(
        moving.drive_command.motor_torque_nm[0], 1.0,
        "brakes open with the whole torque"
    );
    for orders in [
        Orders {
            emergency_stop: true,
            ..none
        },
        Orders {
            supervisor_silent: true,
            ..none
        },
    ] {
        let mut state = state.clone();
        let stopped = run_with(&mut state, 7, orders, 0);
        assert_eq!(
            (state.state, stopped.drive_command.mode),
            (LoopState::SafeStop, DriveMode::Braked as u32)
        );
    }
}

#[test]
fn drives_that_never_obey_again_end_the_run() {
    let (still, hold) = (sample(0.0), command(1.0));
    let stopped = DriveSample {
        mode: DriveMode::Damping as u32,
        ..still
    };
    let mut state = CycleState::default();
    let end = (0..2000).find(|&cycle| {
        run(&mut state, cycle, Ok(&stopped), Some(&hold));
        state.state.is_latched()
    });
    assert_eq!(state.state, LoopState::SafeStop);
    assert!(end.unwrap() < 600, "{end:?}");
}

#[test]
fn drives_that_are_off_while_torque_is_commanded_stop_the_run() {
    let (still, hold) = (sample(0.0), command(1.0));
    for mode in [DriveMode::Braked as u32, 99] {
        let off = DriveSample { mode, ..still };
        let mut state = CycleState::default();
        for cycle in 0..10 {
            run(&mut state, cycle, Ok(&still), Some(&hold));
        }
        let output = run(&mut state, 10, Ok(&off), Some(&hold));
        assert_eq!(
            (state.state, state.fault, output.drive_command.mode),
            (
                LoopState::SafeStop,
                Some(Fault::DrivesOff),
                DriveMode::Braked as u32
            )
        );
    }
    // Brakes that have just been told to open are seen as closed for a few samples more.
    let off = DriveSample {
        mode: DriveMode::Braked as u32,
        ..still
    };
    let mut state = CycleState::default();
    for cycle in 0..4 {
        run(&mut state, cycle, Ok(&off), Some(&hold));
        assert_eq!(state.state, LoopState::Running);
    }
}

#[test]
fn a_command_that_was_not_sent_is_as_if_none_had_come() {
    let (still, hold) = (sample(0.0), command(1.0));
    let mut state = CycleState::default();
    for cycle in 0..10 {
        run(&mut state, cycle, Ok(&still), Some(&hold));
        state.written(Ok(()));
    }
    state.written(Err(DriveFault::NotSent));
    run(&mut state, 10, Ok(&still), Some(&hold));
    let told = Some(Fault::Drive(DriveFault::NotSent));
    assert_eq!((state.state, state.fault), (LoopState::Holding, told));
    state.written(Ok(()));
    run(&mut state, 11, Ok(&still), Some(&hold));
    assert_eq!(state.state, LoopState::Running);
    let end = (12..30).find(|&cycle| {
        state.written(Err(DriveFault::NotSent));
        run(&mut state, cycle, Ok(&still), Some(&hold));
        state.state.is_latched()
    });
    assert_eq!((end, state.state), (Some(19), LoopState::SafeStop));
    // Drives that do not know the mode will not know it in the next cycle either.
    let mut state = CycleState::default();
    run(&mut state, 0, Ok(&still), Some(&hold));
    let refused = DriveFault::ModeRefused { mode: 2 };
    state.written(Err(refused));
    run(&mut state, 1, Ok(&still), Some(&hold));
    assert_eq!(
        (state.state, state.fault),
        (LoopState::SafeStop, Some(Fault::Drive(refused)))
    );
}

/// A sample of drives that tell their states.
fn told(states: [DriveState; 2]) -> DriveSample {
    let mut sample = sample(0.0);
    for (told, state) in sample.drives.state.iter_mut().zip(states) {
        *told = state as u32;
    }
    sample
}

/// After twenty cycles of torque, the last in cycle 19.
fn moving() -> CycleState {
    let mut state = CycleState::default();
    let obeys = told([DriveState::Enabled; 2]);
    for cycle in 0..20 {
        run(&mut state, cycle, Ok(&obeys), Some(&command(1.0)));
    }
    state
}

#[test]
fn drives_are_enabled_over_many_cycles_before_anything_moves() {
    use DriveState::{Enabled, Enabling, NotReady, SwitchedOff};
    let hold = command(1.0);
    let mut state = CycleState::default();
    let mut seen = Vec::new();
    let walk = [
        [NotReady, SwitchedOff],
        [SwitchedOff; 2],
        [Enabling; 2],
        [Enabled, Enabling],
        [Enabled, Enabling],
        [Enabled; 2],
        [Enabled; 2],
    ];
    for (cycle, states) in (0..).zip(walk) {
        let output = run(&mut state, cycle, Ok(&told(states)), Some(&hold));
        seen.push((state.state, output.drive_command.request));
        if state.state == LoopState::Enabling {
            assert_eq!(
                output.drive_command.motor_torque_nm[0], 1.0,
                "the load is held"
            );
            assert_eq!(motion_time_ns(&state), 0);
        }
    }
    let enable = (LoopState::Enabling, DriveRequest::Enable as u32);
    let ready = (LoopState::Ready, DriveRequest::None as u32);
    let running = (LoopState::Running, DriveRequest::None as u32);
    assert_eq!(
        seen,
        [ready, enable, enable, enable, enable, running, running]
    );
}

#[test]
fn a_drive_that_is_never_enabled_is_named() {
    use DriveState::{Enabled, Enabling};
    let mut waiting = told([Enabled, Enabling]);
    waiting.drives.status_word[1] = 0x0233;
    let mut state = CycleState::default();
    for cycle in 0..20 {
        run(&mut state, cycle, Ok(&waiting), Some(&command(1.0)));
    }
    let reason = state.fault.unwrap().sentence(&config().joint_names);
    assert_eq!(state.state, LoopState::SafeStop);
    assert!(
        reason.contains("elbow") && reason.contains("0x0233"),
        "{reason}"
    );
}

#[test]
fn a_drive_fault_while_moving_is_told_with_joint_and_code_and_reset_by_the_operator() {
    use DriveState::{Enabled, Fault as Faulted, SwitchedOff};
    let mut state = moving();
    assert_eq!(state.state, LoopState::Running);
    let mut tripped = told([Enabled, Faulted]);
    tripped.drives.error_code[1] = 0x2310;
    let output = run(&mut state, 20, Ok(&tripped), Some(&command(1.0)));
    let fault = DriveFault::DriveError {
        joint: 1,
        code: 0x2310,
    };
    assert_eq!(
        (state.state, state.fault),
        (LoopState::SafeStop, Some(Fault::Drive(fault)))
    );
    assert_eq!(
        (output.drive_command.mode, output.drive_command.request),
        (DriveMode::Braked as u32, DriveRequest::QuickStop as u32)
    );
    // A reset reaches the drive, and the loop waits until it has cleared.
    let reset = |state: &mut CycleState, cycle, sample: &DriveSample, reset| {
        let orders = Orders {
            reset,
            ..Orders::default()
        };
        let input = CycleInput {
            cycle,
            planned_ns: cycle * 666_667,
            sample: Ok(sample),
            command: None,
            orders,
        };
        state.step(&config(), &input).drive_command.request
    };
    let asked = DriveRequest::ResetFault as u32;
    assert_eq!(reset(&mut state, 21, &tripped, true), asked);
    assert_eq!(state.state, LoopState::SafeStop);
    assert_eq!(reset(&mut state, 22, &tripped, false), asked);
    let cleared = told([SwitchedOff; 2]);
    assert_eq!(
        reset(&mut state, 23, &cleared, false),
        DriveRequest::None as u32
    );
    assert_eq!(state.state, LoopState::Ready);
    // A device that has left its exchange is asked as long.
    let mut state = CycleState::default();
    reset(&mut state, 0, &tripped, false);
    let mut gone = told([SwitchedOff; 2]);
    gone.drives.device_status[1] = 0x001b_0014;
    assert_eq!(reset(&mut state, 1, &gone, true), asked);
    assert_eq!(reset(&mut state, 2, &gone, false), asked);
    assert_eq!(state.state, LoopState::SafeStop);
    reset(&mut state, 3, &cleared, false);
    assert_eq!(state.state, LoopState::Ready);
    // One that does not clear is asked for a while and no longer.
    let mut state = CycleState::default();
    reset(&mut state, 0, &tripped, false);
    reset(&mut state, 1, &tripped, true);
    for cycle in 2..10 {
        reset(&mut state, cycle, &tripped, false);
    }
    assert_eq!(
        reset(&mut state, 10, &tripped, false),
        DriveRequest::QuickStop as u32
    );
    assert_eq!(state.state, LoopState::SafeStop);
}

#[test]
fn a_drive_that_drops_out_while_it_should_obey_stops_the_run() {
    use DriveState::{Enabled, QuickStop, SwitchedOff};
    let mut state = moving();
    run(
        &mut state,
        20,
        Ok(&told([SwitchedOff, Enabled])),
        Some(&command(1.0)),
    );
    let off = DriveFault::DriveOff {
        joint: 0,
        state: SwitchedOff,
    };
    assert_eq!(
        (state.state, state.fault),
        (LoopState::SafeStop, Some(Fault::Drive(off)))
    );
    // One whose watchdog ran out is damped, enabled again and goes on.
    let mut state = moving();
    let mut seen = Vec::new();
    let walk = [QuickStop, QuickStop, QuickStop, Enabled, Enabled, Enabled];
    for (cycle, second) in (20..).zip(walk) {
        let sample = told([Enabled, second]);
        run(&mut state, cycle, Ok(&sample), Some(&command(1.0)));
        seen.push(state.state);
    }
    use LoopState::{Damping, Enabling, Running};
    let waits = [Enabling; 4];
    assert_eq!(seen, [&[Damping][..], &waits, &[Running]].concat());
}

#[test]
fn drives_that_damped_by_themselves_get_their_time_to_take_torque_again() {
    use DriveState::{Enabled, Enabling};
    let mut state = moving();
    // Held for three cycles, then damped by the drives: without a sample the loop's own damping is not asked for.
    for cycle in 20..25 {
        run(&mut state, cycle, Err(DriveFault::NoSample), None);
    }
    assert_eq!(
        (state.state, state.sending.mode),
        (LoopState::Damping, DriveMode::Damping)
    );
    // They have taken that; then each shows for two cycles that it has not yet taken torque.
    let mut seen = Vec::new();
    for (cycle, shown) in (25..).zip([Enabled, Enabling, Enabling, Enabled, Enabled]) {
        run(
            &mut state,
            cycle,
            Ok(&told([shown; 2])),
            Some(&command(1.0)),
        );
        seen.push(state.state);
    }
    use LoopState::{Enabling as Waits, Running};
    assert_eq!(
        seen,
        [Waits, Waits, Waits, Waits, Running],
        "{:?}",
        state.fault
    );
}

#[test]
fn a_silent_joint_costs_the_sample_only_when_it_cannot_be_seen_through() {
    let mut sample = sample(0.0);
    let mut state = CycleState::default();
    sample.drives.age_cycles[1] = AGE_MAX_CYCLES;
    assert_eq!(state.admit(&config(), 0, &sample), Ok(()));
    sample.drives.age_cycles[1] = AGE_MAX_CYCLES + 1;
    let silent = DriveFault::JointSilent {
        joint: 1,
        age_cycles: AGE_MAX_CYCLES + 1,
    };
    assert_eq!(state.admit(&config(), 1, &sample), Err(silent));
    assert_eq!(
        state.drives.age_cycles[1],
        AGE_MAX_CYCLES + 1,
        "told either way"
    );
}

#[test]
fn what_is_known_of_the_drives_gets_old_where_no_sample_comes() {
    let mut state = CycleState::default();
    run(&mut state, 3, Err(DriveFault::NoSample), None);
    assert_eq!(state.drives.age_cycles[0], 0, "nothing was told yet");
    let mut told = sample(0.0);
    told.drives.age_cycles[1] = 2;
    assert_eq!(state.admit(&config(), 4, &told), Ok(()));
    run(&mut state, 4, Ok(&told), None);
    assert_eq!(state.drives.age_cycles[..2], [0, 2]);
    for cycle in [5, 6, 10] {
        run(&mut state, cycle, Err(DriveFault::LinkLost), None);
    }
    assert_eq!(state.drives.age_cycles[..2], [6, 8]);
    assert_eq!(state.admit(&config(), 11, &told), Ok(()));
    assert_eq!(state.drives.age_cycles[..2], [0, 2]);
}

#[test]
fn samples_that_are_not_ours_or_no_numbers_are_faults() {
    let mut foreign = sample(0.0);
    foreign.header.session = 8;
    assert_eq!(
        check_sample(&foreign, 9, 0, 2),
        Err(DriveFault::ForeignSample)
    );
    let mut broken = sample(0.0);
    broken.readings.motor_position_rad[1] = f64::INFINITY;
    assert_eq!(
        check_sample(&broken, 9, 0, 2),
        Err(DriveFault::InvalidSample { joint: 1 })
    );
    assert!(!is_usable(&command(f64::NAN), 2));
}

#[derive(Clone, Debug)]
struct AnyCycle {
    sample: u8,
    states: (u32, u32),
    positions_rad: (f64, f64),
    mode: u32,
    inputs: u32,
    command: Option<(u32, f64, f64)>,
    orders: Orders,
    skipped: u64,
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![4 => -3.0..3.0_f64, 1 => any::<f64>(), 1 => prop::num::f64::ANY]
}

fn any_cycle() -> impl Strategy<Value = AnyCycle> {
    let position = || prop_oneof![8 => -0.001..0.001_f64, 1 => any_number()];
    let rarely = || prop::bool::weighted(0.03);
    (
        (
            0..8_u8,
            prop_oneof![3 => Just((0, 0)), 5 => Just((4, 4)), 2 => (0..9_u32, 0..9_u32)],
        ),
        (position(), position()),
        0..5_u32,
        prop_oneof![20 => Just(0_u32), 1 => Just(EMERGENCY_STOP_PRESSED), 1 => any::<u32>()],
        prop::option::weighted(0.8, (0..5_u32, any_number(), any_number())),
        (rarely(), prop::bool::weighted(0.2), rarely()),
        prop_oneof![9 => Just(0_u64), 1 => 0..30_u64],
    )
        .prop_map(
            |(
                (sample, states),
                positions_rad,
                mode,
                inputs,
                command,
                (emergency_stop, reset, supervisor_silent),
                skipped,
            )| {
                AnyCycle {
                    sample,
                    states,
                    positions_rad,
                    mode,
                    inputs,
                    command,
                    orders: Orders {
                        emergency_stop,
                        reset,
                        supervisor_silent,
                    },
                    skipped,
                }
            },
        )
}

/// Checks and admits as the loop does, then steps.
fn run_any(state: &mut CycleState, cycle: u64, any: &AnyCycle) -> (CycleOutput, bool) {
    let config = config();
    let mut seen = DriveSample {
        mode: any.mode,
        inputs: any.inputs,
        ..sample(0.0)
    };
    (seen.drives.state[0], seen.drives.state[1]) = any.states;
    seen.header.cycle = cycle;
    seen.header.session += u64::from(any.sample == 1);
    seen.readings.motor_position_rad[0] = 50.0 * any.positions_rad.0;
    seen.readings.motor_position_rad[1] = 50.0 * any.positions_rad.1;
    let sample = match any.sample {
        0 => Err(DriveFault::NoSample),
        _ => check_sample(&seen, 9, cycle, 2).and_then(|()| state.admit(&config, cycle, &seen)),
    };
    let asked = any
        .command
        .map(|(mode, torque_nm, velocity_rad_s)| Command {
            mode,
            motor_torque_nm: [torque_nm; JOINTS_MAX],
            joint_velocity_rad_s: [velocity_rad_s; JOINTS_MAX],
            reference_position_rad: [torque_nm; JOINTS_MAX],
            ..Command::default()
        });
    let asked = asked.filter(|command| sample.is_ok() && is_usable(command, 2));
    let fresh = sample.is_ok() && asked.is_some();
    let input = CycleInput {
        cycle,
        planned_ns: cycle * 666_667,
        sample: sample.map(|()| &seen),
        command: asked.as_ref(),
        orders: any.orders,
    };
    (state.step(&config, &input), fresh)
}

proptest! {
    /// Whatever comes in whatever order: torque or velocity of a command only flows while one is fresh or was a moment
    /// ago; nothing moves in a state that is not to; every number sent is finite and within its limit; latched is latched.
    #[test]
    fn no_messages_lead_to_torque_from_an_invalid_state(cycles in prop::collection::vec(any_cycle(), 1..120)) {
        let config = config();
        let mut state = CycleState::default();
        let (mut since_command, mut since_reset) = (u64::MAX / 2, u64::MAX / 2);
        let mut cycle = 0;
        for any in &cycles {
            cycle += 1 + any.skipped;
            let before = state.state;
            let (output, fresh) = run_any(&mut state, cycle, any);
            since_command = if fresh { 0 } else { since_command + 1 };
            since_reset = if any.orders.reset { 0 } else { since_reset + 1 };
            let sent = &output.drive_command;
            let moves = sent.mode == DriveMode::Torque as u32 || sent.mode == DriveMode::Velocity as u32;
            match state.state {
                LoopState::Running => prop_assert!(fresh),
                LoopState::Holding => prop_assert!(since_command <= config.hold_cycles),
                LoopState::Damping => prop_assert!(sent.mode != DriveMode::Velocity as u32),
                LoopState::Enabling => prop_assert!(since_command <= config.hold_cycles),
                _ => prop_assert_eq!(sent.mode, DriveMode::Braked as u32),
            }
            for joint in 0..2 {
                prop_assert!(sent.motor_torque_nm[joint].abs() <= config.joints[joint].motor_torque_nm);
                prop_assert!(sent.joint_velocity_rad_s[joint].abs() <= config.joints[joint].velocity_rad_s);
                prop_assert!(moves || (sent.motor_torque_nm[joint] == 0.0 && sent.joint_velocity_rad_s[joint] == 0.0));
            }
            if state.state == LoopState::Damping && any.sample == 0 {
                prop_assert!(sent.mode == DriveMode::Damping as u32 || sent.mode == DriveMode::Braked as u32);
            }
            if before == LoopState::Faulted {
                prop_assert_eq!(state.state, LoopState::Faulted);
            }
            if before == LoopState::SafeStop && state.state != before {
                prop_assert!(since_reset < config.reset_cycles && !any.orders.emergency_stop && state.state == LoopState::Ready);
            }
            if any.orders.emergency_stop || any.orders.supervisor_silent {
                prop_assert!(state.state.is_latched());
            }
        }
    }
}

fn motion_time_ns(state: &CycleState) -> u64 {
    state.clock.time_at_ns(&config(), LoopState::Ready, 0)
}
