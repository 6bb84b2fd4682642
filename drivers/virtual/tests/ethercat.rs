//! What the EtherCAT driver does with its drives, in virtual time: no answer is late because a machine is busy.

mod common;

use std::time::Duration;

use common::{Loop, PERIOD_NS};
use rt_loop::driver::{AcyclicError, Object};
use shm_types::drive::{ClockState, DriveState};
use shm_types::messages::{DriveMode, DriveRequest};
use virtual_drives::{BusFault, EthercatFault, Kind, open, run_config};

fn bench(robot: &str) -> Loop {
    let robot = robot::load(robot).expect("shipped");
    let run = run_config(robot.joints.len(), PERIOD_NS);
    Loop::new(open(Kind::Ethercat, &robot, &run).expect("it opens"))
}

fn break_now(bench: &mut Loop, fault: EthercatFault) {
    bench.bus.break_now(BusFault::Ethercat(fault));
}

#[test]
fn torque_moves_a_joint_and_the_clocks_come_into_step() {
    let mut bench = bench("shd17");
    let told = bench.bus.capabilities();
    assert_eq!(told.joints.len(), 1);
    let joint = &told.joints[0];
    let modes = [DriveMode::Torque, DriveMode::Velocity, DriveMode::Position];
    assert_eq!(joint.modes, modes);
    assert_eq!(joint.watchdog, Some(Duration::from_millis(20)));
    assert!((joint.motor_torque_max_nm.expect("a limit") - 0.372).abs() < 1e-9);
    bench.enable(1, DriveMode::Torque);
    bench.cycles(1500);
    assert_eq!(bench.last.bus.clock, ClockState::Locked as u32);
    let first_rad = bench.last.readings.motor_position_rad[0];
    bench.command.motor_torque_nm[0] = 0.1;
    bench.cycles(150);
    assert!(bench.last.readings.motor_position_rad[0] > first_rad + 1.0);
    assert!((bench.last.readings.motor_torque_nm[0] - 0.1).abs() < 0.01);
    let apart_rad = bench.last.readings.link_position_rad[0]
        - bench.last.readings.motor_position_rad[0] / 100.0;
    assert!(
        apart_rad.abs() < 0.05,
        "two encoders, {apart_rad} rad apart"
    );
    assert_eq!(bench.errors, []);
    assert_eq!(bench.last.bus.frames_lost, 0);
    // beside the cycle
    let mut acyclic = bench.bus.acyclic().expect("a channel");
    let mut bytes = [0; 8];
    let of = |index: u16| Object {
        index,
        sub_index: 0,
    };
    assert_eq!(acyclic.read(0, of(0x6076), &mut bytes), Ok(4));
    assert_eq!(bytes[..4], 124_u32.to_le_bytes());
    let refused = AcyclicError::Refused { code: 0x0602_0000 };
    assert_eq!(acyclic.read(0, of(0x2000), &mut bytes), Err(refused));
}

#[test]
fn seven_joints_follow_velocities_and_positions() {
    let mut bench = bench("pa10");
    bench.enable(7, DriveMode::Velocity);
    bench.command.joint_velocity_rad_s[..7].fill(0.1);
    let first = bench.last.readings.motor_position_rad;
    bench.cycles(1500);
    for (joint, first_rad) in first.iter().enumerate().take(7) {
        let moved_rad = (bench.last.readings.motor_position_rad[joint] - first_rad) / 50.0;
        assert!(moved_rad > 0.05, "joint {joint}: {moved_rad} rad");
    }
    bench.command.mode = DriveMode::Position as u32;
    for joint in 0..7 {
        bench.command.joint_position_rad[joint] =
            bench.last.readings.motor_position_rad[joint] / 50.0;
    }
    let held = bench.last.readings.motor_position_rad;
    bench.cycles(750);
    for (joint, held_rad) in held.iter().enumerate().take(7) {
        let away_rad = (bench.last.readings.motor_position_rad[joint] - held_rad) / 50.0;
        assert!(away_rad.abs() < 0.03, "joint {joint}: {away_rad} rad");
        assert_eq!(bench.last.drives.state_of(joint), DriveState::Enabled);
    }
}

#[test]
fn a_drive_fault_is_told_with_its_code_and_reset_by_edges() {
    let mut bench = bench("pa10");
    bench.enable(7, DriveMode::Velocity);
    let fault = EthercatFault::DriveFault {
        joint: 2,
        code: 0x4310,
        for_ns: 0,
    };
    break_now(&mut bench, fault);
    let after = bench.until("a fault", |sample| sample.drives.state_of(2).is_faulted());
    assert!(after <= 2, "{after} cycles");
    assert_eq!(bench.last.drives.error_code[2], 0x4310);
    assert_eq!(bench.last.drives.error_code[1], 0);
    bench.stop_and_reset(300);
    bench.until_all(7, DriveState::SwitchedOff);
    bench.command.request = DriveRequest::None as u32;
    bench.enable(7, DriveMode::Velocity);
}

#[test]
fn one_slave_that_is_cut_off_ages_alone() {
    let mut bench = bench("pa10");
    bench.enable(7, DriveMode::Velocity);
    let cut = EthercatFault::CableOut {
        after: 5,
        for_ns: 500_000_000,
    };
    break_now(&mut bench, cut);
    bench.until("cut", |sample| sample.drives.age_cycles[6] > 4);
    assert_eq!(
        bench.last.drives.age_cycles[5],
        bench.last.drives.age_cycles[6]
    );
    assert_eq!(bench.last.drives.age_cycles[..5], [0; 5]);
    assert_eq!(bench.last.bus.working_counter, 5);
    assert_eq!(bench.last.bus.working_counter_expected, 7);
    // its watchdog took it out of OP meanwhile
    bench.until("back", |sample| {
        sample.drives.device_status[6] != 0 && sample.drives.age_cycles[6] == 0
    });
    assert_eq!(bench.last.drives.device_status[6], 0x001b_0014);
    bench.stop_and_reset(200);
    bench.until("in OP again", |sample| {
        sample.drives.device_status[..7] == [0; 7]
    });
    bench.until_all(7, DriveState::SwitchedOff);
}

#[test]
fn lost_and_doubled_frames_are_counted_and_survived() {
    let mut bench = bench("shd17");
    bench.enable(1, DriveMode::Velocity);
    break_now(&mut bench, EthercatFault::FrameDoubled { count: 20 });
    bench.cycles(100);
    assert_eq!(bench.errors, []);
    break_now(&mut bench, EthercatFault::FrameLost { count: 1 });
    bench.cycles(100);
    break_now(
        &mut bench,
        EthercatFault::CounterShort { slave: 0, count: 1 },
    );
    bench.cycles(100);
    assert_eq!(bench.last.drives.state_of(0), DriveState::Enabled);
    // the lost frame carried inputs or outputs; only lost inputs are missed
    assert!(bench.last.bus.frames_lost <= 1);
    assert!(bench.errors.len() <= 2, "{:?}", bench.errors);
}
