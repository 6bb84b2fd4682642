//! `flexspline drives`, and a run with the EtherCAT driver, with virtual drives over a veth pair in a network namespace of its own.
//! Where that is not allowed the tests say so and end.

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Output, Stdio};

const PROGRAM: &str = env!("CARGO_BIN_EXE_flexspline");
const PAIR: &str =
    "ip link add veth0 type veth peer name veth1 && ip link set veth0 up && ip link set veth1 up";

/// Runs a shell script in a namespace with a veth pair; `$F` is the program. `None` where that is not allowed.
fn inside(script: &str) -> Option<Output> {
    let mut probe = Command::new("unshare");
    probe.args(["-n", "sh", "-c", PAIR]).stderr(Stdio::null());
    if !probe.status().is_ok_and(|status| status.success()) {
        eprintln!("skipped: no network namespace with a veth pair can be made here");
        return None;
    }
    let output = Command::new("unshare")
        .args(["-n", "sh", "-c", &format!("{PAIR} && {script}")])
        .env("F", PROGRAM)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output();
    Some(output.expect("unshare"))
}

/// Virtual drives for one of the shipped robot files, and something to do with them.
fn with_drives(robot: &str, axes: usize, act: &str) -> Option<Output> {
    inside(&format!(
        "{{ \"$F\" drives emulate ethercat --interface veth1 --robot {robot} --axes {axes} --rate 1000 >/dev/null & }} \
         && drives=$! && sleep 1 && {{ {act}; code=$?; kill $drives; wait $drives; exit $code; }}"
    ))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn bad_input_is_one_line_and_exit_code_2() {
    let cases = [
        (
            "drives emulate ethercat --interface ec9",
            "no network interface `ec9`",
        ),
        (
            "drives emulate ethercat --interface veth1 --axes 9",
            "give 1 to 8",
        ),
        (
            "drives emulate ethercat --interface veth1 --fault x@1s",
            "known: cable-out",
        ),
        (
            "drives emulate ethercat --interface veth1 --fault brown-out:slave=1@1s",
            "no slave 1",
        ),
        (
            "drives emulate ethercat --interface veth1 --clock-error 2000",
            "clock error",
        ),
        ("drives scan --interface ec9", "no network interface `ec9`"),
        ("drives scan --interface veth0", "no slaves answer"),
        ("drives check --robot shd17", "no [drive] table"),
        (
            "drives check --robot robots/ethercat_one_encoder.toml",
            "no slaves answer",
        ),
        (
            "run --driver ethercat --robot shd17 --duration 1s --instance ec-bad",
            "no [drive] table",
        ),
    ];
    for (arguments, part) in cases {
        let Some(output) = inside(&format!("exec \"$F\" {arguments}")) else {
            return;
        };
        let told = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments}: {told}");
        assert!(told.contains(part), "{arguments}: {told}");
        assert_eq!(told.lines().count(), 1, "{arguments}: {told}");
    }
}

#[test]
fn scan_and_check_tell_what_is_there() {
    let robot = "robots/ethercat_several_axes.toml";
    let act = format!(
        "\"$F\" drives scan --interface veth0 && \"$F\" drives scan --interface veth0 --json - && \
         \"$F\" drives check --robot {robot} --read 0x6079 --read 0x1008 --read 0x5000:1"
    );
    let Some(output) = with_drives(robot, 2, &act) else {
        return;
    };
    let told = text(&output.stdout);
    assert!(output.status.success(), "{told}{}", text(&output.stderr));
    for part in [
        "slave 0: FS-VD2",
        "axis 1: modes 8 9 10, motor encoder 4096 counts a turn, rated torque 124 mNm",
        "\"distributed_clock\": true",
        "The drives fit the robot file.",
        "0.3720 Nm",
        "20 ms",
        // 0x6085 of the virtual drive, and what was read beside: supply, name, an object it has not
        "option 2",
        "48000 = 0xbb80",
        "FS-VD2",
        "the drive refused with code 0x06020000",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
}

#[test]
fn a_second_master_is_refused_and_the_first_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let robot = "robots/ethercat_one_encoder.toml";
    let record = folder.path().join("run.mcap");
    let act = format!(
        "{{ D=/tmp/flexspline-$(id -u)/ec-two; \"$F\" run --driver ethercat --robot {robot} --duration 120s --instance ec-two --record {} >/dev/null 2>&1 & first=$!; \
         for i in $(seq 300); do grep -q '\"loop\"' $D/processes.json 2>/dev/null && grep -q flexspline-ethercat /proc/net/unix && break; \
         sleep 0.1; done; \
         \"$F\" drives check --robot {robot}; checked=$?; \"$F\" run --driver ethercat --robot {robot} --instance ec-three; ran=$?; \
         kill -0 $first && echo goes on; kill -INT $first; wait $first; [ $checked = 2 ] && (exit $ran); }}",
        record.display()
    );
    let Some(output) = with_drives(robot, 1, &act) else {
        return;
    };
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert_eq!(told.lines().count(), 2, "{told}");
    for line in told.lines() {
        assert!(line.contains("another flexspline runs this bus"), "{line}");
    }
    assert!(text(&output.stdout).contains("goes on"), "{told}");
}

#[test]
fn a_port_or_an_interface_without_permission_is_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let open = |path: &std::path::Path, mode| {
        fs::set_permissions(path, fs::Permissions::from_mode(mode)).expect("our own file");
    };
    open(folder.path(), 0o755);
    let place = folder.path().display();
    let belt = fs::read_to_string(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/robots/moteus_belt.toml"
    ));
    let port = format!("ports = [\"{place}/port\"]");
    let belt: String = belt
        .expect("a robot file")
        .lines()
        .map(|line| if line.starts_with("ports =") { port.clone() } else { line.to_owned() } + "\n")
        .collect();
    fs::write(folder.path().join("belt.toml"), belt).expect("written");
    // As nobody, who may read program and robot files, and neither open the port nor send frames.
    let act = format!(
        "install -m 755 \"$F\" {place}/program && cp robots/ethercat_one_encoder.toml {place}/one.toml && cd {place} && \
         {{ ./program drives emulate moteus --robot belt.toml --link {place}/port >/dev/null & drives=$!; \
         until [ -e port ]; do sleep 0.1; done; n='setpriv --reuid 65534 --regid 65534 --clear-groups'; \
         $n ./program drives check --driver moteus --robot belt.toml; moteus=$?; $n ./program drives check --robot one.toml; \
         ethercat=$?; kill -INT $drives; wait $drives; [ $moteus = 2 ] && exit $ethercat; }}"
    );
    let Some(output) = inside(&act) else {
        return;
    };
    let told = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{told}");
    let lines: Vec<&str> = told.lines().collect();
    assert_eq!(lines.len(), 2, "{told}");
    for line in lines {
        assert!(
            line.contains("permission") || line.contains("CAP_NET_RAW"),
            "{line}"
        );
    }
}

#[test]
fn a_run_moves_virtual_drives() {
    let folder = tempfile::tempdir().expect("a folder");
    let shipped = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/robots/ethercat_two_encoders.toml"
    );
    // a busy machine keeps frames for longer than the shipped watchdog
    let patient = std::fs::read_to_string(shipped)
        .expect("a robot file")
        .replace("watchdog_ms = 20.0", "watchdog_ms = 100.0");
    let robot = folder.path().join("arm.toml");
    std::fs::write(&robot, patient).expect("written");
    let robot = robot.display();
    let act = format!(
        "\"$F\" run --driver ethercat --robot {robot} --duration 3s --instance ec-run --record {robot}.mcap --json -"
    );
    let Some(output) = with_drives(&robot.to_string(), 1, &act) else {
        return;
    };
    let told = text(&output.stdout);
    assert!(output.status.success(), "{told}{}", text(&output.stderr));
    let report: serde_json::Value = serde_json::from_str(&told).expect("the report is JSON");
    assert_eq!(report["timing"]["final_state"], "Running", "{told}");
    let cycles = report["timing"]["counters"]["cycles"].as_u64();
    assert!(cycles.is_some_and(|cycles| cycles > 1000), "{told}");
    let error_rad = &report["tracking"]["joints"][0]["position_error_rad"]["rms"];
    assert!(error_rad.as_f64().is_some_and(|rms| rms < 0.02), "{told}");
}
