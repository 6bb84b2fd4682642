//! An operator stops a running robot and lets it go on; what the loop did before the stop is kept.

use crate::support::{Bench, eventually, kill, spawn, text};
use realtime::process::user_id;
use shm_types::bus::{Bus, Writer};
use shm_types::instance::Instance;
use shm_types::messages::{LoopState, OperatorOrder, OperatorRequest};
use shm_types::topics;

fn order(writer: &mut Writer<OperatorRequest>, session: u64, order: OperatorOrder) {
    let sent = writer.send_and_prepare(OperatorRequest {
        session,
        order: order as u32,
        reserved: 0,
    });
    assert!(sent, "the supervisor listens");
}

#[test]
fn the_emergency_stop_closes_the_brakes_until_a_reset_and_leaves_the_last_cycles() {
    let bench = Bench::new("operator");
    // In lockstep a busy machine neither stops the robot nor leaves out cycles.
    let run = spawn(bench.run(&["--mode", "lockstep", "--duration", "10h"]));
    bench.await_process("loop");
    let instance = Instance::new(&bench.instance, user_id()).expect("a good name");
    let session = instance.run_config().expect("written before").session;
    let bus = Bus::join(&instance).expect("ours");
    let mut writer = bus
        .writer(&topics::OPERATOR_REQUEST)
        .expect("the only operator");
    let status = bus.reader(&topics::OBSERVED_STATUS).expect("an observer");
    let reaches = |state: LoopState| {
        eventually(|| {
            let newest = status.take_newest()?;
            let enough = newest.header.cycle > topics::LAST_CYCLES_KEPT as u64;
            (newest.state == state as u32 && enough).then_some(newest)
        })
        .unwrap_or_else(|| panic!("{state:?} is reached"))
    };
    reaches(LoopState::Running);
    order(&mut writer, session + 1, OperatorOrder::EmergencyStop);
    order(&mut writer, session, OperatorOrder::EmergencyStop);
    let stopped = reaches(LoopState::SafeStop);
    assert_eq!(stopped.motor_torque_nm[..7], [0.0; 7]);
    order(&mut writer, session, OperatorOrder::Reset);
    reaches(LoopState::Running);
    kill(run.id(), libc::SIGINT);
    drop((writer, status, bus));
    let output = run.wait_with_output().expect("the run ends");
    assert!(output.status.success(), "{}", text(&output));
    let report = bench.report();
    let kept = report["last_cycles"].as_array().expect("a list");
    assert_eq!(kept.len(), 1, "{report}");
    let path = kept[0].as_str().expect("a path");
    assert!(path.ends_with("run.stop1.mcap"), "{path}");
    let last = recording::read(path.as_ref()).expect("our own file");
    assert_eq!(last.rows(), topics::LAST_CYCLES_KEPT);
    assert_eq!(bench.left_behind(), Vec::<String>::new());
}
