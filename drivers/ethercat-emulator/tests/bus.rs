//! The bus: working counters, mailbox, states, clocks, watchdog, and what breaks.

mod common;

use common::{CYCLE_NS, INIT, Master, OP, PRE_OP, SAFE_OP};
use ethercat_emulator::axis::error_code;
use ethercat_emulator::objects::abort;
use ethercat_emulator::slave::al_code;
use ethercat_emulator::wire::{frame, u16_at};
use ethercat_emulator::{Fault, Returned};

const SECOND_NS: u64 = 1_000_000_000;

#[test]
fn a_frame_comes_back_marked() {
    let mut master = Master::new("shd17", |_| {});
    let mut bytes = frame(&[(7, 0, [0; 4], &[0])]);
    assert_eq!(bytes[6], 0x10);
    let returned = master.drives.receive(&mut bytes, 5).expect("EtherCAT");
    assert_eq!(
        returned,
        Returned {
            copies: 1,
            delay_ns: 0
        }
    );
    assert_eq!(bytes[6], 0x12);
    assert_eq!(master.drives.receive(&mut [0; 60], 6), None);
}

#[test]
fn every_command_counts_as_it_should() {
    let mut master = Master::new("pa10", |options| options.axes_per_slave = 3);
    master.address_slaves();
    let cases: [(u8, u16, u16); 13] = [
        (1, 0, 1),
        (1, 1, 0),
        (2, 0xffff, 1),
        (3, 0, 3),
        (4, 0x1002, 1),
        (4, 0x2002, 0),
        (5, 0x1003, 1),
        (6, 0x1003, 3),
        (7, 0, 3),
        (8, 0, 3),
        (9, 0, 9),
        (13, 0, 3),
        (14, 0x1001, 3),
    ];
    for (command, station, counter) in cases {
        let [a, b] = station.to_le_bytes();
        // a byte of user memory
        let (_, counted) = master.datagram(command, [a, b, 0x00, 0x18], &[1]);
        assert_eq!(counted, counter, "command {command} to {station:#06x}");
    }
}

#[test]
fn sdos_of_every_size() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_pre_op();
    assert_eq!(master.upload(0, 0x1018, 0, false), Ok(vec![4]));
    assert_eq!(
        master.upload(0, 0x1018, 1, false),
        Ok(0x0f1e_7890_u32.to_le_bytes().to_vec())
    );
    let name = master.upload(0, 0x1008, 0, false).expect("the name");
    assert_eq!(name, b"Flexspline virtual drive, one axis");
    // 16 entries of four bytes and the count in two: more than fits a mailbox is not, the segments of the download are
    let all = master.upload(0, 0x1600, 0, true).expect("the mapping");
    assert_eq!((all.len(), all[0]), (66, 7));
    assert_eq!(master.download(0, 0x1600, 0, &all, true), Ok(()));
    assert_eq!(master.upload(0, 0x1600, 0, true), Ok(all));
    let cases = [
        (0x2000, 0, abort::NO_OBJECT),
        (0x1018, 5, abort::NO_SUB_INDEX),
        (0x1c32, 7, abort::UNSUPPORTED_ACCESS),
    ];
    for (index, sub_index, code) in cases {
        assert_eq!(master.upload(0, index, sub_index, false), Err(code));
    }
    let cases: [(u16, u8, &[u8], u32); 6] = [
        (0x6041, 0, &[0, 0], abort::READ_ONLY),
        (0x6040, 0, &[0], abort::TOO_SHORT),
        (0x6060, 0, &[0, 0], abort::TOO_LONG),
        (0x6060, 0, &[3], abort::VALUE_RANGE),
        (0x6060, 0, &[11], abort::VALUE_TOO_HIGH),
        (0x1600, 1, &[0; 4], abort::DEVICE_STATE),
    ];
    for (index, sub_index, bytes, code) in cases {
        assert_eq!(
            master.download(0, index, sub_index, bytes, false),
            Err(code),
            "{index:#06x}"
        );
    }
    let segment = master.mailbox(0, &[0, 0x20, 0x60, 0, 0, 0, 0, 0, 0, 0]);
    // as a request of the slave's own: a response would be taken for success
    assert_eq!(
        (segment[1] >> 4, segment[2]),
        (2, 0x80),
        "no transfer is under way"
    );
}

#[test]
fn a_long_upload_comes_in_segments() {
    let mut master = Master::new("pa10", |options| options.axes_per_slave = 7);
    master.enter_pre_op();
    // the object list of seven axes does not fit one message
    let first = master.mailbox(0, &[0, 0x80, 1, 0, 0, 0, 1, 0]);
    assert_eq!(first[2], 0x82, "a list, incomplete");
    let mut left = u16_at(&first, 4);
    let mut bytes = first[8..].to_vec();
    while left > 0 {
        let next = master.fetch(0);
        assert_eq!(u16_at(&next, 4), left - 1);
        left = u16_at(&next, 4);
        bytes.extend(&next[6..]);
    }
    let indices: Vec<u16> = bytes.chunks(2).map(|two| u16_at(two, 0)).collect();
    assert!(indices.contains(&0x6040) && indices.contains(&(0x6040 + 6 * 0x800)));
    assert!(indices.is_sorted());
}

#[test]
fn what_is_no_sdo_is_answered_with_an_error() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_pre_op();
    let mut message = [0; 128];
    message[0] = 4;
    message[5] = 0x14; // FoE
    master.write(0, 0x1000, &message);
    assert_eq!(master.fetch(0), [1, 0, 2, 0], "unsupported protocol");
    message[0] = 200;
    message[5] = 0x23;
    master.write(0, 0x1000, &message);
    assert_eq!(master.fetch(0), [1, 0, 1, 0], "longer than the mailbox");
}

#[test]
fn states_are_checked_on_the_way() {
    let mut master = Master::new("shd17", |_| {});
    master.address_slaves();
    assert_eq!(master.ask(0, PRE_OP), (0x10 | INIT, al_code::MAILBOX));
    assert_eq!(master.ask(0, OP), (0x10 | INIT, al_code::INVALID_CHANGE));
    assert_eq!(master.ask(0, 3), (0x10 | INIT, al_code::NO_BOOT));
    assert_eq!(master.ask(0, 7), (0x10 | INIT, al_code::UNKNOWN_STATE));
    master.enter_pre_op();
    assert_eq!(master.ask(0, SAFE_OP), (0x10 | PRE_OP, al_code::OUTPUTS));
    master.lengths[0][1] -= 1;
    master.map();
    assert_eq!(master.ask(0, SAFE_OP), (0x10 | PRE_OP, al_code::INPUTS));
    // without the acknowledgement nothing goes up
    master.write(0, 0x120, &[PRE_OP, 0]);
    master.lengths[0][1] += 1;
    master.map();
    assert_eq!(master.ask(0, SAFE_OP), (SAFE_OP, 0));
    assert_eq!(master.ask(0, OP), (OP, 0));
    assert_eq!(master.ask(0, INIT), (INIT, 0));
}

#[test]
fn the_watchdog_takes_the_slave_out_of_op_and_the_axis_into_fault() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_op();
    master.write(0, 0x420, &100_u16.to_le_bytes());
    master.enable(10);
    master.now_ns += 9_000_000;
    assert_eq!(master.read(0, 0x130, 1), [OP]);
    master.now_ns += 2_000_000;
    let status = master.read(0, 0x130, 6);
    assert_eq!((status[0], status[4]), (0x14, al_code::WATCHDOG as u8));
    assert_eq!(master.read(0, 0x440, 4), [0, 0, 1, 0]);
    master.now_ns += SECOND_NS / 2;
    master.read(0, 0x130, 1);
    let slave = &master.drives.slaves()[0];
    assert_eq!(
        slave.object(0x603f, 0),
        i64::from(error_code::SYNC_CONTROLLER)
    );
    assert_eq!(master.ask(0, OP), (OP, 0), "and it comes back");
}

#[test]
fn clocks_are_brought_together_by_the_bus() {
    let mut master = Master::new("pa10", |options| {
        options.axes_per_slave = 3;
        options.clock_error_ppm = 80.0;
    });
    master.address_slaves();
    // receive times: a broadcast write latches them
    master.datagram(8, [0, 0, 0x00, 0x09], &[0; 4]);
    let mut local_ns = Vec::new();
    for slave in 0..3 {
        let bytes = master.read(slave, 0x918, 8);
        local_ns.push(u64::from_le_bytes(bytes.try_into().expect("8 bytes")));
        let ports = master.read(slave, 0x900, 8);
        let round_ns = u32::from_le_bytes(ports[4..].try_into().expect("4 bytes"))
            .wrapping_sub(u32::from_le_bytes(ports[..4].try_into().expect("4 bytes")));
        let behind = 2 - slave as u32;
        assert!(
            behind == 0 || round_ns.abs_diff(1200 * behind) < 2,
            "{round_ns}"
        );
    }
    for slave in 1..3 {
        let offset_ns = local_ns[0]
            .wrapping_sub(local_ns[slave])
            .wrapping_add(600 * slave as u64);
        master.write(slave, 0x920, &offset_ns.to_le_bytes());
        master.write(slave, 0x928, &(600 * slave as u32).to_le_bytes());
    }
    for _ in 0..15_000 {
        master.now_ns += CYCLE_NS;
        let (_, counter) = master.datagram(14, [0x01, 0x10, 0x10, 0x09], &[0; 8]);
        assert_eq!(counter, 3);
    }
    for slave in 1..3 {
        let bytes = master.read(slave, 0x92c, 4);
        let apart_ns = u32::from_le_bytes(bytes.try_into().expect("4 bytes")) & 0x7fff_ffff;
        assert!(apart_ns < 50, "slave {slave}: {apart_ns} ns");
    }
}

#[test]
fn at_sync0_outputs_act_and_inputs_are_latched() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_pre_op();
    master.map();
    master.start_sync0(0, 666_667, 5_000_000);
    assert_eq!(master.ask(0, SAFE_OP), (SAFE_OP, 0));
    assert_eq!(master.ask(0, OP), (OP, 0));
    master.outputs[0].mode = 10;
    master.cycle();
    assert_eq!(
        master.inputs[0].mode, 0,
        "before the first pulse nothing acts"
    );
    master.cycles(20);
    assert_eq!(master.inputs[0].mode, 10);
    master.enable(10);
    assert_eq!(master.drives.slaves()[0].object(0x1c32, 0x0a), 666_667);
}

#[test]
fn a_cut_cable_leaves_the_slaves_before_it() {
    let mut master = Master::new("pa10", |options| options.axes_per_slave = 3);
    master.enter_op();
    master.cycles(10);
    master.inject(Fault::CableOut {
        after: 1,
        for_ns: SECOND_NS / 20,
    });
    let (_, counter) = master.datagram(7, [0; 4], &[0]);
    assert_eq!(counter, 1);
    let ports = u16_at(&master.read(0, 0x110, 2), 0);
    assert_eq!(ports & 0x0c20, 0x0400, "port 1 is closed and without link");
    assert_eq!(master.read(0, 0x311, 1), [1], "and the lost link counted");
    assert!(!master.cycle());
    master.now_ns += SECOND_NS / 20;
    assert!(master.cycle(), "it is back in before the watchdog");
    master.inject(Fault::CableOut {
        after: 0,
        for_ns: SECOND_NS / 20,
    });
    assert_eq!(master.way_back().copies, 0);
}

#[test]
fn frames_get_lost_doubled_and_late() {
    let mut master = Master::new("shd17", |_| {});
    for (fault, returned) in [
        (
            Fault::FrameLost { count: 2 },
            Returned {
                copies: 0,
                delay_ns: 0,
            },
        ),
        (
            Fault::FrameDoubled { count: 2 },
            Returned {
                copies: 2,
                delay_ns: 0,
            },
        ),
        (
            Fault::FrameDelayed { count: 2, by_ns: 7 },
            Returned {
                copies: 1,
                delay_ns: 7,
            },
        ),
    ] {
        master.inject(fault);
        assert_eq!([master.way_back(), master.way_back()], [returned; 2]);
        assert_eq!(
            master.way_back(),
            Returned {
                copies: 1,
                delay_ns: 0
            }
        );
    }
}

#[test]
fn a_working_counter_is_short_as_often_as_asked() {
    let mut master = Master::new("pa10", |_| {});
    master.enter_op();
    master.inject(Fault::CounterShort { slave: 2, count: 3 });
    master.cycles(10);
    assert_eq!(master.counter_short, 3);
}

#[test]
fn a_slave_that_starts_anew_is_in_init_without_address() {
    let mut master = Master::new("pa10", |options| options.axes_per_slave = 3);
    master.enter_op();
    master.inject(Fault::SlaveReset { slave: 1 });
    assert!(!master.cycle());
    let (status, counter) = master.datagram(1, [0xff, 0xff, 0x30, 0x01], &[0; 2]);
    assert_eq!((status[0], counter), (INIT, 1));
    let (_, counter) = master.datagram(4, [0x02, 0x10, 0x30, 0x01], &[0; 2]);
    assert_eq!(counter, 0, "its address is gone");
}

#[test]
fn the_reset_register_wants_its_three_letters() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_op();
    for letter in *b"RE" {
        master.write(0, 0x40, &[letter]);
    }
    assert_eq!(master.read(0, 0x130, 1), [OP]);
    master.write(0, 0x40, b"S");
    let (status, _) = master.datagram(1, [0, 0, 0x30, 0x01], &[0]);
    assert_eq!(status, [INIT]);
}

#[test]
fn a_brown_out_ends_and_its_fault_is_reset_then() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_op();
    master.enable(10);
    master.inject(Fault::BrownOut {
        slave: 0,
        for_ns: SECOND_NS,
    });
    assert_eq!(master.wait_fault(0), error_code::UNDERVOLTAGE);
    assert_eq!(master.inputs[0].statusword & 0x10, 0, "no voltage");
    master.outputs[0].controlword = 0;
    master.cycles(2);
    master.outputs[0].controlword = 0x80;
    master.cycles(5);
    assert_eq!(master.inputs[0].state(), 0x08, "still without voltage");
    master.cycles(1500);
    master.outputs[0].controlword = 0;
    master.cycles(2);
    master.outputs[0].controlword = 0x80;
    master.cycles(5);
    assert_eq!(master.inputs[0].state(), 0x40);
}

#[test]
fn a_drive_fault_hits_its_joint_alone_and_is_told() {
    let mut master = Master::new("pa10", |_| {});
    master.enter_op();
    master.enable(9);
    master.inject(Fault::DriveFault {
        joint: 3,
        code: 0x4310,
        for_ns: 0,
    });
    assert_eq!(master.wait_fault(3), 0x4310);
    for joint in [0, 1, 2, 4, 5, 6] {
        assert_eq!(master.inputs[joint].state(), 0x27, "joint {joint}");
    }
    let emergency = master.fetch(3);
    assert_eq!(
        (u16_at(&emergency, 0) >> 12, u16_at(&emergency, 2)),
        (1, 0x4310)
    );
}

#[test]
fn a_drive_without_sync0_leaves_op() {
    let mut master = Master::new("shd17", |options| options.sync_error_limit = 30);
    master.enter_pre_op();
    master.map();
    master.start_sync0(0, 666_667, 5_000_000);
    master.ask(0, SAFE_OP);
    master.ask(0, OP);
    master.cycles(100);
    master.inject(Fault::DcLost {
        slave: 0,
        for_ns: SECOND_NS,
    });
    master.cycles(20);
    let status = master.read(0, 0x130, 6);
    assert_eq!((status[0], status[4]), (0x14, al_code::SYNC_LOST as u8));
}

#[test]
fn a_quick_stop_stops_on_its_ramp() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_op();
    master.enable(9);
    master.outputs[0].velocity = 20_000;
    master.cycles(400);
    assert!(master.inputs[0].velocity > 15_000);
    master.outputs[0].controlword = 2;
    master.cycle();
    master.cycle();
    assert_eq!(master.inputs[0].state(), 0x07);
    master.cycles(600);
    assert_eq!(
        master.inputs[0].state(),
        0x40,
        "option 2: switched off after it"
    );
    assert!(master.inputs[0].velocity.abs() < 100);
}

#[test]
fn a_master_that_does_not_fetch_is_not_answered_without_end() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_pre_op();
    let mut message = [0; 128];
    message[..12].copy_from_slice(&[10, 0, 0, 0, 0, 0x13, 0, 0x20, 0x40, 0x18, 0x10, 0]);
    let station = common::STATION.to_le_bytes();
    let address = [station[0], station[1], 0x00, 0x10];
    let taken: u16 = (0..100)
        .map(|_| master.datagram(5, address, &message).1)
        .sum();
    assert!((2..20).contains(&taken), "{taken}");
    for _ in 0..taken {
        assert_eq!(master.fetch(0)[2], 0x4f, "each that was taken is answered");
    }
    assert_eq!(
        master.datagram(5, address, &message).1,
        1,
        "and there is room again"
    );
}

#[test]
fn a_system_time_that_jumps_brings_no_pulses_from_before() {
    let mut master = Master::new("shd17", |_| {});
    master.enter_pre_op();
    master.start_sync0(0, 125_000, 1_000_000);
    master.now_ns += 2_000_000;
    master.write(0, 0x920, &(1_u64 << 62).to_le_bytes());
    let slave = &master.drives.slaves()[0];
    let next_ns = slave.next_sync0_ns(master.now_ns).expect("pulses");
    assert!(next_ns.abs_diff(master.now_ns) <= 125_000, "{next_ns}");
    master.read(0, 0x130, 2);
}

#[test]
fn an_answer_that_was_lost_is_repeated_as_often_as_asked() {
    const REPEAT: u8 = 0x02;
    let mut master = Master::new("shd17", |_| {});
    master.enter_pre_op();
    let request = [0, 0x20, 0x40, 0x76, 0x60, 0, 0, 0, 0, 0];
    let answer = master.mailbox(0, &request);
    assert!(
        answer.len() >= 10 && answer[3..5] == [0x76, 0x60],
        "{answer:?}"
    );
    for asked in [REPEAT, 0] {
        let activate = master.read(0, 0x080e, 1)[0] & !REPEAT | asked;
        master.write(0, 0x080e, &[activate]);
        assert_eq!(master.fetch(0), answer, "the same once more");
        assert_eq!(master.read(0, 0x080f, 1)[0] & REPEAT, asked, "and told");
    }
}
