//! `flexspline recording`: what is in a recording, other formats in and out, the twin's recording.

mod support;

use std::fs;
use std::process::Output;

use recording::{Recording, Signal, read};
use serde_json::Value;
use support::{Bench, output, text};

fn recording(bench: &Bench, arguments: &[&str]) -> Output {
    let mut command = bench.flexspline();
    command.arg("recording").args(arguments);
    output(command)
}

fn succeeds(bench: &Bench, arguments: &[&str]) -> String {
    let output = recording(bench, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", text(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn refused(bench: &Bench, arguments: &[&str], expected: &[&str]) {
    let output = recording(bench, arguments);
    assert_eq!(
        output.status.code(),
        Some(2),
        "{arguments:?}: {}",
        text(&output)
    );
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(message.trim_end().lines().count(), 1, "one line: {message}");
    for part in expected {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
}

/// A recording of the single test joint.
fn run(bench: &Bench, arguments: &[&str]) -> Recording {
    let output = output(
        bench.run(
            &[
                &["--robot", "shd17", "--mode", "lockstep", "--duration", "4s"],
                arguments,
            ]
            .concat(),
        ),
    );
    assert!(output.status.success(), "{}", text(&output));
    read(&bench.file("run.mcap")).expect("a recording")
}

#[test]
fn every_format_gives_the_table_back() {
    let bench = Bench::new("formats");
    let table = run(&bench, &[]);
    succeeds(&bench, &["export", "run.mcap", "--out", "run.parquet"]);
    succeeds(&bench, &["export", "run.parquet", "--out", "copy.mcap"]);
    for name in ["run.parquet", "copy.mcap"] {
        assert!(
            read(&bench.file(name)).expect(name).same_table(&table),
            "{name}"
        );
    }
    succeeds(&bench, &["export", "copy.mcap", "--out", "log.csv"]);
    let rate = format!("sample_rate_hz = {:?}\n", table.sample_rate_hz);
    fs::write(bench.file("elsewhere.toml"), rate).expect("written");
    succeeds(
        &bench,
        &[
            "import",
            "log.csv",
            "--mapping",
            "elsewhere.toml",
            "--out",
            "back.mcap",
        ],
    );
    let back = read(&bench.file("back.mcap")).expect("a recording");
    assert!(back.same_table(&table));
    assert_eq!(back.metadata["source"], "log.csv");
    let left = fs::read_dir(bench.directory.path())
        .expect("a folder")
        .flatten();
    assert!(
        left.into_iter()
            .all(|entry| !entry.file_name().to_string_lossy().contains("unfinished"))
    );
}

#[test]
fn a_part_is_cut_in_time_and_to_joints() {
    let bench = Bench::new("part");
    let table = run(&bench, &[]);
    succeeds(
        &bench,
        &[
            "export", "run.mcap", "--out", "part.csv", "--from", "1", "--to", "1.5", "--joint",
            "joint1",
        ],
    );
    let part = read(&bench.file("part.csv")).expect("a table");
    let rows: Vec<usize> = (0..table.rows())
        .filter(|row| (1.0..=1.5).contains(&table.time_s[*row]))
        .collect();
    assert_eq!(part.time_s, table.time_s[rows[0]..=rows[rows.len() - 1]]);
    refused(
        &bench,
        &["export", "run.mcap", "--out", "p.csv", "--from", "9"],
        &["--from 9", "from 0 to 3.99"],
    );
    refused(
        &bench,
        &["export", "run.mcap", "--out", "p.csv", "--joint", "joint2"],
        &["--joint", "joint2", "`joint1`"],
    );
    refused(
        &bench,
        &["export", "run.mcap", "--out", "p.xlsx"],
        &["p.xlsx", ".parquet"],
    );
}

#[test]
fn info_says_what_is_there_and_what_does_not_fit_the_robot() {
    let bench = Bench::new("info");
    run(&bench, &[]);
    let printed = succeeds(&bench, &["info", "run.mcap", "--robot", "shd17"]);
    for part in [
        "5999 rows",
        "1.534e-3",
        "1.198e-5",
        "trajectory: multi_sine",
    ] {
        assert!(printed.contains(part), "`{part}` is missing in {printed}");
    }
    assert!(
        !printed.contains("warning") && !printed.contains("error: "),
        "{printed}"
    );

    succeeds(&bench, &["export", "run.mcap", "--out", "log.csv"]);
    let swapped = "[joint.joint1]\nmotor_position_rad = { column = 'joint1.motor_position_rad', scale = -1 }\n";
    fs::write(bench.file("log.toml"), swapped).expect("written");
    let found = recording(
        &bench,
        &["info", "log.csv", "--robot", "shd17", "--json", "-"],
    );
    assert_eq!(found.status.code(), Some(1), "{}", text(&found));
    let json: Value = serde_json::from_slice(&found.stdout).expect("JSON");
    let finding = &json[0]["findings"][0];
    assert_eq!(
        (
            &finding["kind"],
            &finding["joint"],
            &finding["signal"],
            &finding["severity"]
        ),
        (
            &"reversed_sign".into(),
            &"joint1".into(),
            &"motor_position_rad".into(),
            &"error".into()
        ),
    );
    assert_eq!(
        json[0]["joints"][0]["signals"][0]["signal"],
        "reference_position_rad"
    );
}

#[test]
fn the_pa10_on_its_lemniscate_is_found_whole() {
    let bench = Bench::new("whole");
    let mut command = bench.run(&["--mode", "lockstep", "--duration", "12s"]);
    command.args(["--robot", "pa10"]);
    assert!(output(command).status.success());
    let printed = succeeds(&bench, &["info", "run.mcap", "--robot", "pa10"]);
    // Joint 3 is locked on the lemniscate.
    assert_eq!(printed.matches("warning").count(), 1, "{printed}");
    assert!(
        printed.contains("joint3.motor_position_rad: stands still") && !printed.contains("error: "),
        "{printed}"
    );
}

#[test]
fn the_twin_follows_the_same_reference_with_the_nominal_model() {
    let bench = Bench::new("twin");
    let table = run(&bench, &["--seed", "3"]);
    for out in ["twin.mcap", "again.mcap"] {
        succeeds(
            &bench,
            &[
                "simulate", "run.mcap", "--robot", "shd17", "--out", out, "--seed", "5",
            ],
        );
    }
    let bytes = |name: &str| fs::read(bench.file(name)).expect("a file");
    assert!(
        bytes("twin.mcap") == bytes("again.mcap"),
        "the same bytes every time"
    );
    let twin = read(&bench.file("twin.mcap")).expect("a recording");
    assert_eq!(twin.time_s, table.time_s);
    assert_eq!(twin.sample_rate_hz, table.sample_rate_hz);
    assert_eq!(
        (
            twin.metadata["plant"].as_str(),
            twin.metadata["seed"].as_str()
        ),
        ("nominal", "5")
    );
    let farthest = |signal| {
        let [a, b] = [&table, &twin].map(|table| table.signal("joint1", signal).expect("recorded"));
        a.iter()
            .zip(b)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max)
    };
    assert!(
        farthest(Signal::ReferencePositionRad) < 1e-9,
        "{}",
        farthest(Signal::ReferencePositionRad)
    );
    assert!(
        farthest(Signal::ReferenceVelocityRadS) < 1e-6,
        "{}",
        farthest(Signal::ReferenceVelocityRadS)
    );
    let other = farthest(Signal::MotorTorqueNm);
    assert!(
        other > 1e-4,
        "the plant is another one, {other} Nm apart at most"
    );
}

#[test]
fn a_decimated_recording_of_several_trajectories_is_followed_one_by_one() {
    let bench = Bench::new("segments");
    let table = run(&bench, &[]);
    let mut csv = "time_s,segment,joint1.reference_position_rad\n".to_owned();
    let position_rad = table
        .signal("joint1", Signal::ReferencePositionRad)
        .expect("recorded");
    for segment in [4, 9] {
        for row in (0..table.rows()).step_by(3) {
            csv += &format!(
                "{:?},{segment},{:?}\n",
                table.time_s[row], position_rad[row]
            );
        }
    }
    fs::write(bench.file("log.csv"), csv).expect("written");
    succeeds(
        &bench,
        &[
            "simulate",
            "log.csv",
            "--robot",
            "shd17",
            "--out",
            "twin.mcap",
        ],
    );
    let (log, twin) = (read(&bench.file("log.csv")), read(&bench.file("twin.mcap")));
    let (log, twin) = (log.expect("a log"), twin.expect("a recording"));
    assert_eq!((twin.rows(), &twin.segment), (log.rows(), &log.segment));
    assert!((twin.sample_rate_hz - 500.0).abs() < 1e-3);
    let link_rad = twin
        .signal("joint1", Signal::LinkPositionRad)
        .expect("the twin has it");
    let [first, second] = &twin.segments()[..] else {
        panic!("two trajectories")
    };
    let apart = |row: usize| (link_rad[first.start + row] - link_rad[second.start + row]).abs();
    assert!(
        (0..first.len()).all(|row| apart(row) < 1e-3),
        "both are of the same reference"
    );
}

#[test]
fn what_a_log_holds_is_guessed_where_that_is_certain_and_asked_for_where_it_is_not() {
    let bench = Bench::new("guessed");
    let mut log = "time;joint1_pos;joint1_motor_torque\nms;deg;Nm\n".to_owned();
    let mut doubtful = "t q tau\n".to_owned();
    for row in 0..1500_u32 {
        let time_s = f64::from(row) * 0.002;
        let angle = 30.0 * (6.0 * time_s + (17.0 * time_s).sin()).sin();
        log += &format!("{};{angle};{}\n", 2 * row, 0.1 * time_s);
        doubtful += &format!("{time_s} {} 3.5\n", angle.to_radians());
    }
    fs::write(bench.file("log.csv"), log).expect("written");
    fs::write(bench.file("doubtful.csv"), doubtful).expect("written");
    let import = ["import", "log.csv", "--robot", "shd17", "--out", "log.mcap"];
    let line = "log.csv: guessed: joint1: motor_torque_nm is `joint1_motor_torque [Nm]`, \
                link_position_rad is 0.017453 × `joint1_pos [deg]`\n";
    assert!(succeeds(&bench, &import).starts_with(line));
    let imported = read(&bench.file("log.mcap")).expect("a recording");
    assert!(imported.metadata["columns_guessed"].starts_with("joint1: motor_torque_nm"));
    let farthest = imported
        .signal("joint1", Signal::LinkPositionRad)
        .expect("positions");
    assert!(
        farthest
            .iter()
            .all(|angle| angle.abs() <= 30_f64.to_radians())
    );

    let diagnose = |log: &str| {
        let mut command = bench.flexspline();
        let robot = ["gap", "diagnose", "--robot", "shd17", "--recording"];
        command.args(robot).arg(log);
        output(command)
    };
    let diagnosed = diagnose("log.csv");
    assert!(text(&diagnosed).contains(line), "{}", text(&diagnosed));
    let asked = [
        "`tau`",
        "doubtful",
        "`flexspline recording map doubtful.csv --robot shd17`",
    ];
    refused(
        &bench,
        &[
            "import",
            "doubtful.csv",
            "--robot",
            "shd17",
            "--out",
            "d.mcap",
        ],
        &asked,
    );
    let diagnosed = diagnose("doubtful.csv");
    assert_eq!(diagnosed.status.code(), Some(2));
    assert!(text(&diagnosed).contains(asked[2]), "{}", text(&diagnosed));
}

/// A MATLAB file of version 5 with these matrices, a list for each column.
fn mat(matrices: &[(&str, &[Vec<f64>])]) -> Vec<u8> {
    let element = |kind: u32, bytes: &[u8]| {
        let mut element = [kind, bytes.len() as u32].map(u32::to_le_bytes).concat();
        element.extend(bytes);
        element.resize(element.len().next_multiple_of(8), 0);
        element
    };
    let mut file = b"MATLAB 5.0 MAT-file".to_vec();
    file.resize(124, b' ');
    file.extend(b"\x00\x01IM");
    for (name, columns) in matrices {
        let axes = [columns[0].len() as u32, columns.len() as u32];
        let values = columns.iter().flatten();
        let values: Vec<u8> = values.flat_map(|value| value.to_le_bytes()).collect();
        let parts = [
            element(6, &[6, 0, 0, 0, 0, 0, 0, 0]),
            element(5, &axes.map(u32::to_le_bytes).concat()),
            element(1, name.as_bytes()),
            element(9, &values),
        ];
        file.extend(element(14, &parts.concat()));
    }
    file
}

#[test]
fn joints_without_names_are_looked_at_by_their_number() {
    let bench = Bench::new("rec-numbers");
    let of_rows = |value: &dyn Fn(f64) -> f64| -> Vec<f64> {
        (0..500).map(|row| value(f64::from(row) * 0.005)).collect()
    };
    let time = [of_rows(&|time_s| time_s)];
    let angles = |reach: f64| {
        let swing = move |factor: f64| of_rows(&move |time_s| reach * (factor * time_s).sin());
        [swing(6.0), swing(7.0)]
    };
    fs::write(
        bench.file("log.mat"),
        mat(&[("t", &time), ("q", &angles(0.5))]),
    )
    .expect("written");
    let told = succeeds(&bench, &["info", "log.mat"]);
    for expected in [
        "500 rows, 2.495 s, 2 joints",
        "rate 200.000 Hz",
        "joint2",
        "joints_without_names: called by their number; --robot names them",
    ] {
        assert!(told.contains(expected), "`{expected}`: {told}");
    }
    // Degrees or turns of a joint: that is not for a plain look to decide.
    fs::write(
        bench.file("far.mat"),
        mat(&[("t", &time), ("q", &angles(20.0))]),
    )
    .expect("written");
    let names = ["`q` has 2 columns", "far.mapping.toml"];
    refused(&bench, &["info", "far.mat"], &names);
    // What is made of the log needs the names.
    let import = ["import", "log.mat", "--out", "log.mcap"];
    refused(&bench, &import, &["`q` has 2 columns"]);
}

#[test]
fn bad_input_is_one_line_and_exit_code_two() {
    let bench = Bench::new("rec-bad");
    run(&bench, &[]);
    refused(
        &bench,
        &["info", "none.mcap"],
        &["none.mcap", "cannot be read"],
    );
    refused(
        &bench,
        &["info", "run.json"],
        &["run.json", "neither an MCAP recording"],
    );
    refused(
        &bench,
        &["info", "run.mcap", "--robot", "shd71"],
        &["shd71", "shd17"],
    );
    let mat = [
        &[b' '; 124][..],
        b"\x00\x01IM",
        &[15, 0, 0, 0, 4, 0, 0, 0, 1, 2, 3, 4],
    ]
    .concat();
    for (name, bytes, expected) in [
        (
            "log.bag",
            &b"#ROSBAG V2.0\n\x01\x00\x00\x00x\x00\x00\x00\x00"[..],
            "damaged at byte 13",
        ),
        ("log.mat", &mat, "MATLAB file that cannot be read"),
        ("log.h5", b"\x89HDF\r\n\x1a\n and nothing else", "HDF5 file"),
        ("log.xlsx", b"PK\x03\x04", "save it as CSV"),
        ("log.pkl", b"\x80\x04\x95", "Python pickle"),
        (
            "lfs.bag",
            b"version https://git-lfs.github.com/spec/v1\n",
            "git lfs pull",
        ),
    ] {
        fs::write(bench.file(name), bytes).expect("written");
        refused(&bench, &["info", name], &[name, expected]);
        refused(
            &bench,
            &["import", name, "--robot", "shd17", "--out", "x.mcap"],
            &[name, expected],
        );
    }
    fs::write(bench.file("other.toml"), "sample_rate_hz = 100.0\n").expect("written");
    refused(
        &bench,
        &[
            "import",
            "run.mcap",
            "--mapping",
            "other.toml",
            "--out",
            "x.mcap",
        ],
        &["leave the mapping file out"],
    );
    fs::write(bench.file("log.csv"), "t,q\n0,1\n1,2\n").expect("written");
    refused(
        &bench,
        &["import", "log.csv", "--out", "x.mcap"],
        &["log.csv", "JOINT.SIGNAL", "log.mapping.toml"],
    );
    refused(
        &bench,
        &[
            "import",
            "log.csv",
            "--mapping",
            "m.toml",
            "--out",
            "x.mcap",
        ],
        &["m.toml", "cannot be read"],
    );
    refused(
        &bench,
        &["import", "run.mcap", "--out", "x.csv"],
        &["x.csv", "recording export"],
    );
    refused(
        &bench,
        &["export", "run.mcap", "--out", "no/such/x.csv"],
        &["no/such/x.csv"],
    );
    refused(
        &bench,
        &["simulate", "run.mcap", "--robot", "pa10", "--out", "x.mcap"],
        &["joint2", "reference", "every joint"],
    );
    fs::write(
        bench.file("still.csv"),
        "time_s,joint1.link_position_rad\n0,1\n1,2\n",
    )
    .expect("written");
    refused(
        &bench,
        &[
            "simulate",
            "still.csv",
            "--robot",
            "shd17",
            "--out",
            "x.mcap",
        ],
        &["still.csv", "reference_position_rad", "joint1"],
    );
    fs::write(
        bench.file("far.csv"),
        "time_s,joint1.reference_position_rad\n0,1\n1,200\n",
    )
    .expect("written");
    refused(
        &bench,
        &["simulate", "far.csv", "--robot", "shd17", "--out", "x.mcap"],
        &["joint1", "limit"],
    );
    assert!(!bench.file("x.mcap").exists());
}
