//! What people trip over with real CiA 402 drives on EtherCAT: each is a test of the virtual ones.

mod common;

use common::{Master, OP, SAFE_OP};
use ethercat_emulator::axis::error_code;
use ethercat_emulator::objects::abort;
use ethercat_emulator::slave::al_code;

#[test]
fn a_fault_is_reset_by_a_rising_edge_only() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_op();
    master.enable(10);
    master.drives.slaves_mut()[0].axes_mut()[0].raise(0x2310, false);
    assert_eq!(master.wait_fault(0), 0x2310);
    master.outputs[0].controlword = 0x80;
    master.cycles(10);
    assert_eq!(master.inputs[0].state(), 0x40, "the first edge resets");
    master.drives.slaves_mut()[0].axes_mut()[0].raise(0x2310, false);
    master.cycles(1000);
    assert_eq!(
        master.inputs[0].state(),
        0x08,
        "the bit was held: no edge, no reset"
    );
    master.outputs[0].controlword = 0;
    master.cycles(3);
    master.outputs[0].controlword = 0x80;
    master.cycles(3);
    assert_eq!(
        (master.inputs[0].state(), master.inputs[0].error_code),
        (0x40, 0)
    );
}

#[test]
fn enabling_with_a_torque_is_a_fault() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_op();
    master.outputs[0].torque = 5;
    for word in [6, 6, 6, 7, 7, 15] {
        master.outputs[0].mode = 10;
        master.outputs[0].controlword = word;
        master.cycles(100);
    }
    assert_eq!(master.inputs[0].state(), 0x08);
    assert_eq!(master.inputs[0].error_code, error_code::TARGET_AT_ENABLING);
}

#[test]
fn enabling_without_a_mapped_target_is_a_fault() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_pre_op();
    // controlword and mode only
    let download = |master: &mut Master, index: u16, sub_index: u8, bytes: &[u8]| {
        assert_eq!(master.download(0, index, sub_index, bytes, false), Ok(()));
    };
    download(&mut master, 0x1600, 0, &[0]);
    download(&mut master, 0x1600, 1, &0x6040_0010_u32.to_le_bytes());
    download(&mut master, 0x1600, 2, &0x6060_0008_u32.to_le_bytes());
    download(&mut master, 0x1600, 0, &[2]);
    master.lengths = vec![[3, 20]];
    master.map();
    assert_eq!(master.ask(0, SAFE_OP), (SAFE_OP, 0));
    assert_eq!(master.ask(0, OP), (OP, 0));
    for word in [6_u8, 7, 15] {
        for _ in 0..100 {
            master.now_ns += common::CYCLE_NS;
            let mut data = vec![word, 0, 10];
            data.extend([0; 20]);
            master.datagram(12, 0x0001_0000_u32.to_le_bytes(), &data);
        }
    }
    let slave = &master.drives.slaves()[0];
    assert_eq!(slave.object(0x6041, 0) & 0x6f, 0x08);
    assert_eq!(slave.object(0x603f, 0), i64::from(error_code::PARAMETER));
}

#[test]
fn a_cycle_time_that_the_drive_does_not_take_is_refused() {
    let rates = |options: &mut ethercat_emulator::Options| {
        options.cycle_times_ns = vec![8_000_000, 2_000_000];
    };
    for (cycle_ns, status) in [
        (666_667, (0x12, al_code::DC_CYCLE)),
        (2_000_000, (SAFE_OP, 0)),
        (8_000_000, (SAFE_OP, 0)),
    ] {
        let mut master = Master::new("shd17", rates);
        master.enter_pre_op();
        master.map();
        master.start_sync0(0, cycle_ns, 10_000_000);
        assert_eq!(master.ask(0, SAFE_OP), status, "{cycle_ns}");
    }
}

#[test]
fn frames_missing_at_the_start_are_no_fault_and_later_they_are() {
    let mut master = Master::new("shd17", |options| options.sync_error_limit = 9);
    master.enter_pre_op();
    master.map();
    master.start_sync0(0, 666_667, 10_000_000);
    assert_eq!(master.ask(0, SAFE_OP), (SAFE_OP, 0));
    assert_eq!(master.ask(0, OP), (OP, 0));
    // longer than four missed cycles, shorter than the watchdog
    master.now_ns += 90_000_000;
    assert_eq!(master.read(0, 0x130, 1), [OP], "nothing came yet");
    master.cycles(100);
    assert_eq!(master.read(0, 0x130, 1), [OP]);
    master.now_ns += 5 * common::CYCLE_NS;
    let status = master.read(0, 0x130, 6);
    assert_eq!(
        (status[0], status[4]),
        (0x10 | SAFE_OP, al_code::SYNC_LOST as u8)
    );
    assert_eq!(master.upload(0, 0x1c32, 0x20, false), Ok(vec![1]));
    assert!(master.drives.slaves()[0].object(0x1c32, 0x0b) >= 4);
}

#[test]
fn a_start_of_sync0_in_the_past_is_seconds_away() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_pre_op();
    master.start_sync0(0, 666_667, -1_000_000);
    let slave = &master.drives.slaves()[0];
    let next_ns = slave.next_sync0_ns(master.now_ns).expect("pulses");
    assert!(next_ns > master.now_ns + 4_000_000_000);
}

#[test]
fn an_axis_left_out_of_the_outputs_puts_all_into_fault() {
    let mut master = Master::new("pa10", |options| options.axes_per_slave = 2);
    master.enter_pre_op();
    assert_eq!(master.download(0, 0x1c12, 0, &[0], false), Ok(()));
    assert_eq!(master.download(0, 0x1c12, 0, &[1], false), Ok(()));
    master.lengths[0][0] = 16;
    master.map();
    assert_eq!(master.ask(0, SAFE_OP), (SAFE_OP, 0));
    assert_eq!(master.ask(0, OP), (OP, 0));
    for word in [6_u8, 7, 15] {
        for _ in 0..100 {
            master.now_ns += common::CYCLE_NS;
            let mut data = [0; 16];
            data[0] = word;
            data[2] = 9;
            master.datagram(11, 0x0001_0000_u32.to_le_bytes(), &data);
        }
    }
    let slave = &master.drives.slaves()[0];
    for axis in [0, 0x800] {
        assert_eq!(slave.object(0x6041 + axis, 0) & 0x6f, 0x08);
        assert_eq!(
            slave.object(0x603f + axis, 0),
            i64::from(error_code::PARAMETER)
        );
    }
}

#[test]
fn a_read_only_synchronisation_type_says_so() {
    let mut master = Master::new("shd17", |options| options.sync_type_writable = false);
    master.enter_pre_op();
    let write = |master: &mut Master| master.download(0, 0x1c32, 1, &[2, 0], false);
    assert_eq!(write(&mut master), Err(abort::READ_ONLY));
    let mut master = Master::new("shd17", |_| {});
    master.enter_pre_op();
    assert_eq!(write(&mut master), Ok(()));
}

#[test]
fn a_target_position_away_from_the_actual_one_is_a_fault() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_op();
    master.outputs[0].position = 1_000_000;
    for word in [6, 7, 15] {
        master.outputs[0].mode = 8;
        master.outputs[0].controlword = word;
        master.cycles(100);
    }
    assert_eq!(master.inputs[0].error_code, error_code::FOLLOWING_ERROR);
}

#[test]
fn torque_is_per_mille_of_the_rated_torque() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_op();
    master.enable(10);
    let rated = master.upload(0, 0x6076, 0, false).expect("rated torque");
    let rated_mnm = u32::from_le_bytes(rated.try_into().expect("4 bytes"));
    // a third of 0.37 Nm, rounded up
    assert_eq!(rated_mnm, 124);
    master.outputs[0].torque = 500;
    master.cycles(30);
    let truth_nm = master.drives.plant().truth().motor_torque_nm[0];
    assert!((truth_nm - 0.062).abs() < 0.006, "{truth_nm}");
    assert!((i32::from(master.inputs[0].torque) - 500).abs() < 20);
}

#[test]
fn positions_wrap_at_32_bits_and_the_drive_follows_across() {
    let before = i64::from(i32::MAX) - 300;
    let mut master = Master::new("shd17", |options| options.first_count = before);
    master.enter_op();
    master.enable(8);
    assert!(master.inputs[0].position > 0);
    let first = master.inputs[0].position;
    for step in 1..=1500 {
        master.outputs[0].position = first.wrapping_add(step);
        master.cycle();
    }
    master.cycles(300);
    let moved = master.inputs[0].position.wrapping_sub(first);
    assert!(master.inputs[0].position < 0, "it wrapped");
    assert!((moved - 1500).abs() < 100, "{moved}");
    assert_eq!(master.inputs[0].state(), 0x27);
}

#[test]
fn polarity_turns_what_is_read_and_what_is_asked() {
    let mut plain = Master::new("shd17", |_| {});
    let mut turned = Master::new("shd17", |_| {});
    plain.enter_op();
    turned.enter_pre_op();
    assert_eq!(turned.download(0, 0x607e, 0, &[0xe0], false), Ok(()));
    turned.map();
    turned.ask(0, SAFE_OP);
    turned.ask(0, OP);
    for master in [&mut plain, &mut turned] {
        master.enable(9);
        master.outputs[0].velocity = 8000;
        master.cycles(600);
    }
    let joint = |master: &Master| master.drives.plant().truth().motor_position_rad[0];
    assert!(joint(&plain) > 3.0 && joint(&turned) < -3.0);
    for master in [&plain, &turned] {
        assert!(master.inputs[0].position > 2000 && master.inputs[0].velocity > 6000);
    }
}

#[test]
fn the_second_encoder_counts_behind_the_gear() {
    let mut master = Master::new("shd17", |options| options.position_rad = vec![0.3]);
    master.enter_op();
    master.cycles(10);
    let slave = &master.drives.slaves()[0];
    let turns = slave.object(0x60e4, 1) as f64 / slave.object(0x60e6, 1) as f64;
    assert!((turns * core::f64::consts::TAU - 0.3).abs() < 1e-3);
    let motor_turns = f64::from(master.inputs[0].position) / slave.object(0x608f, 1) as f64;
    assert!(
        (motor_turns / turns - 100.0).abs() < 2.0,
        "the gear ratio between both"
    );
}

#[test]
fn the_shaft_is_held_until_the_brake_is_open() {
    let mut master = Master::new("shd17", |options| options.brake_release_s = 0.1);
    master.enter_op();
    for word in [6, 7] {
        master.outputs[0].controlword = word;
        master.outputs[0].mode = 10;
        master.cycles(100);
    }
    master.outputs[0].controlword = 15;
    master.cycles(5);
    let at = master.inputs[0].position;
    assert_eq!(
        master.inputs[0].statusword & 0x106f,
        0x0027,
        "enabled, not following"
    );
    master.outputs[0].torque = 900;
    master.cycles(100);
    assert!((master.inputs[0].position - at).abs() < 20, "held");
    master.cycles(150);
    assert_eq!(master.inputs[0].statusword & 0x1000, 0x1000);
    assert!((master.inputs[0].position - at).abs() > 100, "free");
}

#[test]
fn switching_off_holds_the_load_until_the_brake_does() {
    let mut master = Master::new("shd17", |options| {
        options.brake_release_s = 0.2;
        options.position_rad = vec![1.2];
    });
    master.enter_op();
    master.enable(8);
    master.cycles(500);
    let at = master.inputs[0].position;
    master.outputs[0].controlword = 6;
    master.cycles(400);
    assert_eq!(master.inputs[0].state(), 0x21);
    // an arm in free fall for 0.1 s would be 20 counts of the joint, 2000 of the motor away
    let fell = master.inputs[0].position - at;
    assert!(fell.abs() < 60, "{fell}");
}

#[test]
fn a_drive_set_for_sync0_does_not_run_without_it() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_pre_op();
    assert_eq!(master.download(0, 0x1c32, 1, &[2, 0], false), Ok(()));
    master.map();
    assert_eq!(master.ask(0, SAFE_OP), (SAFE_OP, 0));
    assert_eq!(master.ask(0, OP), (0x10 | SAFE_OP, al_code::DC_SETTING));
    master.start_sync0(0, 666_667, 5_000_000);
    assert_eq!(master.ask(0, OP), (OP, 0));
}
