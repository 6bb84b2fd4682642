//! Masters that nobody here wrote bring the drives to OP, read their objects and run their process data: SOEM (pysoem), KickCAT
//! and ethercrab.
//!
//! They run in a network namespace of their own. Where that is not allowed, or the packages are not installed
//! (`FLEXSPLINE_PYTHON` names a Python that has them), the tests say so and end.

use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use ethercat_emulator::socket::{RawSocket, now_ns, serve};
use ethercat_emulator::{Options, segment};
use ethercrab::subdevice_group::DcConfiguration;
use ethercrab::{DcSync, MainDevice, MainDeviceConfig, PduStorage, Timeouts};
use plant_emulator::PlantParameters;

/// Set in the process that runs inside the namespace.
const INSIDE: &str = "FLEXSPLINE_ETHERCAT_INSIDE";

fn python() -> String {
    std::env::var("FLEXSPLINE_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

/// Why the test cannot be run, if it cannot.
fn obstacle(module: Option<&str>) -> Option<String> {
    let works = |command: &mut Command| {
        let status = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
        status.is_ok_and(|status| status.success())
    };
    if let Some(module) = module
        && !works(Command::new(python()).args(["-c", &format!("import {module}")]))
    {
        return Some(format!("{} has no package {module}", python()));
    }
    let veth = "ip link add ecTry0 type veth peer name ecTry1";
    if !works(Command::new("unshare").args(["-n", "sh", "-c", veth])) {
        return Some("no network namespace with a veth pair can be made here".to_owned());
    }
    None
}

/// Runs the test `name` again inside a namespace, where it finds a veth pair; true in there.
fn is_inside(name: &str, module: Option<&str>) -> bool {
    if std::env::var_os(INSIDE).is_some() {
        return true;
    }
    if let Some(obstacle) = obstacle(module) {
        eprintln!("skipped: {obstacle}");
        return false;
    }
    let program = std::env::current_exe().expect("a test program");
    let setup = "ip link add ecA0 type veth peer name ecA1 && ip link set ecA0 up && ip link set ecA1 up && exec \"$0\" \"$@\"";
    let status = Command::new("unshare")
        .args(["-n", "sh", "-c", setup])
        .arg(program)
        .args(["--exact", name, "--nocapture"])
        .env(INSIDE, "1")
        .status()
        .expect("unshare");
    assert!(status.success(), "{name} failed inside its namespace");
    false
}

/// Serves drives for a robot while `act` runs.
fn with_drives(robot: &str, axes: usize, act: impl FnOnce()) {
    let robot = robot::load(robot).expect("a shipped robot");
    let parameters = PlantParameters::for_robot(&robot).expect("its plant");
    let mut options = Options::for_joints(robot.joints.len());
    options.axes_per_slave = axes;
    let mut drives = segment(&robot, &parameters, &[], &options, now_ns()).expect("drives");
    let socket = RawSocket::open("ecA1").expect("the other end");
    let stop = Arc::new(AtomicBool::new(false));
    let server = std::thread::spawn({
        let stop = Arc::clone(&stop);
        move || serve(&socket, &mut drives, &stop, |_| ())
    });
    act();
    stop.store(true, Ordering::Relaxed);
    server.join().expect("the drives end");
}

fn seconds() -> String {
    std::env::var("FLEXSPLINE_ORACLE_SECONDS").unwrap_or_else(|_| "2".to_owned())
}

/// Runs a script of `tests/oracles` against drives for a robot.
fn run_script(script: &str, robot: &str, axes: usize) {
    with_drives(robot, axes, || {
        let path = format!("{}/tests/oracles/{script}", env!("CARGO_MANIFEST_DIR"));
        let status = Command::new(python())
            .args([&path, "ecA0", &seconds()])
            .status()
            .expect("python");
        assert!(status.success(), "{script} found fault");
    });
}

/// ethercrab's own time-out of a frame. It has a longer one here, for a busy machine is late while drives are set up, too.
const LATE: Duration = Duration::from_millis(30);

/// ethercrab, with its own task for frames: distributed clocks, OP, objects, process data.
async fn run_ethercrab(main: &MainDevice<'_>) -> Result<(), ethercrab::error::Error> {
    let begun = Instant::now();
    let mut group = main
        .init_single_group::<16, 512>(ethercrab::std::ethercat_now)
        .await?;
    for mut slave in group.iter_mut(main) {
        assert!(slave.name().starts_with("FS-VD"), "{}", slave.name());
        assert_eq!(
            slave.sdo_read::<u32>(0x1018, 1).await?,
            slave.identity().vendor_id
        );
        slave.sdo_write(0x1c32, 1, 2_u16).await?;
        slave.set_dc_sync(DcSync::Sync0);
    }
    let clocks = DcConfiguration {
        start_delay: Duration::from_millis(50),
        sync0_period: Duration::from_micros(1000),
        sync0_shift: Duration::from_micros(500),
    };
    let group = group.into_pre_op_pdi(main).await?;
    let group = group.configure_dc_sync(main, clocks).await?;
    let group = group
        .into_safe_op(main)
        .await?
        .request_into_op(main)
        .await?;
    let mut expected = 0;
    let (mut cycles, mut wrong, mut late, mut operational) = (0_u32, 0_u32, 0_u32, None);
    let mut times_us = Vec::new();
    let end = Instant::now() + Duration::from_secs_f64(seconds().parse().expect("seconds"));
    while Instant::now() < end {
        let sent = Instant::now();
        let response = match group.tx_rx_dc(main).await {
            Ok(response) => response,
            // no frame in time, which a busy machine does
            Err(ethercrab::error::Error::Timeout(_)) => {
                late += 1;
                continue;
            }
            Err(error) => return Err(error),
        };
        late += u32::from(sent.elapsed() > LATE);
        if operational.is_none() && response.all_op() {
            operational = Some(begun.elapsed());
            expected = response.working_counter;
        }
        if operational.is_some() {
            wrong += u32::from(response.working_counter != expected);
            times_us.push(sent.elapsed().as_micros());
            cycles += 1;
        }
        async_io::Timer::at(sent + response.extra.next_cycle_wait).await;
    }
    times_us.sort_unstable();
    let quantile = |part: usize| times_us[(times_us.len() - 1) * part / 1000];
    println!(
        "ethercrab: OP after {:?}, {cycles} cycles, {wrong} with a wrong working counter, {late} late; exchange p50 {} us, p99 {} us",
        operational.expect("OP"),
        quantile(500),
        quantile(990)
    );
    assert_eq!(wrong, 0);
    assert_eq!(usize::from(expected), 3 * group.len());
    assert!(cycles > 100 && late < cycles / 100);
    Ok(())
}

fn ethercrab_runs(robot: &str, axes: usize) {
    static STORAGE: PduStorage<16, { PduStorage::element_size(1100) }> = PduStorage::new();
    with_drives(robot, axes, || {
        let (tx, rx, pdu_loop) = STORAGE.try_split().expect("once");
        let task = ethercrab::std::tx_rx_task("ecA0", tx, rx).expect("the interface");
        std::thread::spawn(move || async_io::block_on(task));
        let timeouts = Timeouts {
            pdu: Duration::from_secs(2),
            ..Timeouts::default()
        };
        let main = MainDevice::new(pdu_loop, timeouts, MainDeviceConfig::default());
        async_io::block_on(run_ethercrab(&main)).expect("ethercrab finds no fault");
    });
}

#[test]
fn ethercrab_runs_one_axis() {
    if is_inside("ethercrab_runs_one_axis", None) {
        ethercrab_runs("shd17", 1);
    }
}

#[test]
fn ethercrab_runs_seven_axes_on_three_slaves() {
    if is_inside("ethercrab_runs_seven_axes_on_three_slaves", None) {
        ethercrab_runs("pa10", 3);
    }
}

#[test]
fn soem_moves_one_axis() {
    if is_inside("soem_moves_one_axis", Some("pysoem")) {
        run_script("soem.py", "shd17", 1);
    }
}

#[test]
fn soem_moves_seven_axes_on_three_slaves() {
    if is_inside("soem_moves_seven_axes_on_three_slaves", Some("pysoem")) {
        run_script("soem.py", "pa10", 3);
    }
}

#[test]
fn kickcat_moves_one_axis() {
    if is_inside("kickcat_moves_one_axis", Some("kickcat")) {
        run_script("kickcat_master.py", "shd17", 1);
    }
}

#[test]
fn kickcat_moves_seven_axes_on_three_slaves() {
    if is_inside("kickcat_moves_seven_axes_on_three_slaves", Some("kickcat")) {
        run_script("kickcat_master.py", "pa10", 3);
    }
}
