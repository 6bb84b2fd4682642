//! Logs that others wrote.
#![allow(clippy::unwrap_used, reason = "a test may")]

use recording::{GuessJoint, Recording, Signal, read, read_guessing};
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::{Path, PathBuf};

struct Log(tempfile::TempDir);

impl Log {
    fn new(csv: impl AsRef<[u8]>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("log.csv"), csv).unwrap();
        Self(folder)
    }

    fn mapped(self, mapping: &str) -> Self {
        std::fs::write(self.0.path().join("log.toml"), mapping).unwrap();
        self
    }

    fn read(&self) -> Recording {
        read(&self.0.path().join("log.csv")).unwrap()
    }

    /// Without the file's name before it.
    fn refusal(&self) -> String {
        let error = read(&self.0.path().join("log.csv")).unwrap_err();
        error
            .problem
            .to_string()
            .replace(&format!("{}/", self.0.path().display()), "")
    }
}

#[test]
fn contract_names_need_no_mapping() {
    let log =
        Log::new("time_s,segment,elbow.motor_torque_nm,other\n0,1,2.5,x\n0.5,1,,y\n0,2.0,nan,\n");
    let recording = log.read();
    assert_eq!(recording.time_s, [0.0, 0.5, 0.0]);
    assert_eq!(recording.segment.as_deref(), Some(&[1, 1, 2][..]));
    let torque_nm = recording.signal("elbow", Signal::MotorTorqueNm).unwrap();
    assert_eq!(torque_nm[0], 2.5);
    assert!(torque_nm[1].is_nan() && torque_nm[2].is_nan());
    assert_eq!(recording.sample_rate_hz, 2.0);
}

#[test]
fn a_mapping_scales_and_shifts() {
    let log = Log::new("t,q,i\n10,180,1\n20,0,2\n").mapped(
        "[columns]\ntime_s = { column = 't', scale = 1e-3 }\n[joint.j]\nmotor_current_a = 'i'\n\
         link_position_rad = { column = 'q', scale = -0.5, offset = 1 }",
    );
    let recording = log.read();
    assert_eq!(recording.time_s, [0.01, 0.02]);
    assert_eq!(
        recording.signal("j", Signal::LinkPositionRad).unwrap(),
        [-89.0, 1.0]
    );
    assert_eq!(
        recording.signal("j", Signal::MotorCurrentA).unwrap(),
        [1.0, 2.0]
    );
}

#[test]
fn a_robot_file_of_the_logs_name_is_no_mapping_and_a_mapping_of_its_own_name_goes_first() {
    let log = Log::new("time_s,j.motor_torque_nm,raw\n0,1,3\n1,1,3\n")
        .mapped("name = 'arm'\n[[joint]]\nname = 'j'\ngear_ratio = 100.0\n");
    let torque_nm = |log: &Log| log.read().signal("j", Signal::MotorTorqueNm).unwrap()[0];
    assert_eq!(torque_nm(&log), 1.0);
    let own = log.0.path().join("log.mapping.toml");
    assert_eq!(
        recording::mapping_beside(&log.0.path().join("log.csv")),
        own
    );
    std::fs::write(own, "[joint.j]\nmotor_torque_nm = 'raw'").unwrap();
    assert_eq!(torque_nm(&log), 3.0);
    assert_eq!(
        torque_nm(&log.mapped("[joint.j]\nmotor_torque_nm = 'none'")),
        3.0
    );
}

#[test]
fn a_mapping_adds_to_the_columns_that_have_their_names_and_wins_over_them() {
    let log = Log::new("time_s,j.motor_torque_nm,j.motor_current_a,raw\n0,1,2,3\n1,1,2,3\n")
        .mapped("[joint.j]\nmotor_current_a = 'raw'");
    let recording = log.read();
    assert_eq!(
        recording.signal("j", Signal::MotorTorqueNm).unwrap(),
        [1.0, 1.0]
    );
    assert_eq!(
        recording.signal("j", Signal::MotorCurrentA).unwrap(),
        [3.0, 3.0]
    );
}

#[test]
fn columns_without_names_have_numbers() {
    let mapping = "[columns]\ntime_s = '1'\n[joint.j]\nlink_position_rad = '3'";
    let recording = Log::new("0.5,7,0.1\n0.6,7,0.2\n").mapped(mapping).read();
    assert_eq!(recording.time_s, [0.5, 0.6]);
    assert_eq!(
        recording.signal("j", Signal::LinkPositionRad).unwrap(),
        [0.1, 0.2]
    );
}

#[test]
fn a_told_rate_stands_in_for_a_time_column_and_goes_before_the_shown_one() {
    let untimed = Log::new("j.motor_torque_nm\n1\n2\n3\n").mapped("sample_rate_hz = 4");
    assert_eq!(untimed.read().time_s, [0.0, 0.25, 0.5]);
    let timed = Log::new("time_s,j.motor_torque_nm\n0,1\n1,2\n").mapped("sample_rate_hz = 4");
    let recording = timed.read();
    assert_eq!((recording.time_s[1], recording.sample_rate_hz), (1.0, 4.0));
}

#[test]
fn other_separators_line_ends_marks_and_quotes_are_taken_as_they_come() {
    for csv in [
        "time_s;j.motor_torque_nm\r\n0;1\r\n1;2\r\n",
        "time_s\tj.motor_torque_nm\n0\t1\n\n1\t2",
        "\u{feff}time_s ,\"j.motor_torque_nm\"\n0, 1\n\"1\",\t2e0 \n",
    ] {
        let recording = Log::new(csv).read();
        assert_eq!(recording.time_s, [0.0, 1.0]);
        assert_eq!(
            recording.signal("j", Signal::MotorTorqueNm).unwrap(),
            [1.0, 2.0]
        );
    }
    let latin_1 = Log::new(b"time_s,j.motor_torque_nm,q [\xb0]\n0,1,2\n1,1,2\n");
    assert_eq!(latin_1.read().rows(), 2);
}

/// Three rows at 500 Hz as `clock` writes their times, in milliseconds, and their values with a decimal mark.
fn pendulum(header: &str, separator: &str, mark: &str, clock: impl Fn(u32) -> String) -> String {
    let mut text = format!("{header}{separator}j.link_position_rad{separator}j.motor_torque_nm\n");
    for (row, (angle, torque)) in [("0", "-1.5"), ("0.25", "2e-1"), ("0.5", "")]
        .iter()
        .enumerate()
    {
        let [time, angle, torque] =
            [&clock(2 * row as u32), *angle, *torque].map(|cell| cell.replace('.', mark));
        text += &format!("{time}{separator}{angle}{separator}{torque}\n");
    }
    text
}

#[test]
fn the_same_rows_are_the_same_recording_however_they_are_written() {
    let plain = Log::new(pendulum("time_s", ",", ".", |ms| format!("0.{ms:03}"))).read();
    assert_eq!(plain.time_s, [0.0, 0.002, 0.004]);
    let since_start: [(&str, String); 9] = [
        (
            "a German spreadsheet",
            pendulum("time_s", ";", ",", |ms| format!("0.{ms:03}")),
        ),
        (
            "tabs and a decimal comma",
            pendulum("time_s", "\t", ",", |ms| format!("0.{ms:03}")),
        ),
        (
            "milliseconds",
            pendulum("time_ms", ",", ".", |ms| ms.to_string()),
        ),
        (
            "microseconds that nothing tells",
            pendulum("timestamp", ",", ".", |ms| format!("{ms}000")),
        ),
        (
            "nanoseconds",
            pendulum("t [ns]", ",", ".", |ms| format!("{ms}000000")),
        ),
        (
            "a mark, line ends of another system and comments",
            "\u{feff}# robot 3\r\n% calibrated\r\n".to_owned()
                + &pendulum("time_s", ",", ".", |ms| format!("0.{ms:03}"))
                    .replace('\n', "\r\n# and\r\n"),
        ),
        (
            "spaces, so that numbers stand below each other",
            pendulum("time_s", "   ", ".", |ms| format!("0.{ms:03}"))
                .replace("0.5   \n", "0.5   nan\n"),
        ),
        (
            "a line of units",
            pendulum("time", ",", ".", |ms| ms.to_string()).replacen('\n', "\nms,rad,Nm\n", 1),
        ),
        (
            "names in a comment",
            "# run 7\n# ".to_owned() + &pendulum("time_s", ",", ".", |ms| format!("0.{ms:03}")),
        ),
    ];
    for (kind, text) in since_start {
        let recording = Log::new(text).read();
        assert!(recording.same_table(&plain), "{kind}: {recording:?}");
    }
    let since_1970: [(&str, String); 9] = [
        (
            "seconds",
            pendulum("time_s", ",", ".", |ms| format!("1700000000.{ms:03}")),
        ),
        (
            "seconds that nothing tells",
            pendulum("t", ";", ",", |ms| format!("1700000000.{ms:03}")),
        ),
        (
            "milliseconds",
            pendulum("time", ",", ".", |ms| format!("1700000000{ms:03}")),
        ),
        (
            "microseconds",
            pendulum("stamp_us", ",", ".", |ms| format!("1700000000{ms:03}000")),
        ),
        (
            "nanoseconds",
            pendulum("stamp", ",", ".", |ms| format!("1700000000{ms:03}000000")),
        ),
        (
            "dates",
            pendulum("time", ",", ".", |ms| {
                format!("2023-11-14T22:13:20.{ms:03}Z")
            }),
        ),
        (
            "dates with the day first",
            pendulum("Date Time", ",", ".", |ms| {
                format!("14/11/2023 22:13:20.{ms:03}")
            }),
        ),
        (
            "dates with the month first",
            pendulum("time", ";", ",", |ms| {
                format!("11/14/2023 22:13:20.{ms:03}")
            }),
        ),
        (
            "local dates",
            pendulum("time_s", ",", ".", |ms| {
                format!("2023-11-15 00:13:20.{ms:03}+02:00")
            }),
        ),
    ];
    for (kind, text) in since_1970 {
        let recording = Log::new(text).read();
        assert!(recording.same_table(&plain), "{kind}: {recording:?}");
        assert_eq!(
            recording.metadata["start_unix_ns"], "1700000000000000000",
            "{kind}"
        );
    }
}

#[test]
fn dates_that_tell_too_little_say_what_to_write() {
    let dated = |date: &str| Log::new(format!("time,j.motor_torque_nm\n{date},1\n{date},2\n"));
    let refusal = dated("05/06/2024 0:53").refusal();
    assert!(
        refusal.starts_with("line 2, column `time`: `05/06/2024 0:53` is not a date that can be"),
        "{refusal}"
    );
    assert_eq!(
        dated("13/05/2024 0:53").refusal(),
        "has 2 rows, from which no sample rate can be told: all times are the same, as where the clock tells whole minutes; \
         give `sample_rate_hz` in log.mapping.toml"
    );
}

#[test]
fn nanoseconds_of_a_clock_since_1970_are_kept() {
    let log = Log::new("t,j.motor_torque_nm\n1700000000.000000001,1\n1700000000.000000004,1\n");
    assert_eq!(log.read().time_s, [0.0, 4e-9 - 1e-9]);
    let mapped = Log::new("t,j.motor_torque_nm\n1700000000000000001,1\n1700000000000000004,1\n")
        .mapped("[columns]\ntime_s = { column = 't', scale = 1e-9 }");
    assert_eq!(mapped.read().time_s, [0.0, 4e-9 - 1e-9]);
}

#[test]
fn a_file_has_one_decimal_mark() {
    let text = "time_s;j.motor_torque_nm\n0,0;1,5\n0,1;1.234,5\n";
    assert!(
        Log::new(text)
            .refusal()
            .starts_with("line 3, column `j.motor_torque_nm`: `1.234,5`")
    );
}

#[test]
fn what_an_instrument_writes_before_the_names_is_passed_over() {
    let log = Log::new(
        "Rig 7\nSerial,1234\n\npi_time [ms],j.motor_torque_nm,mode\n0,1.5,on\n10,2.5,on\n",
    );
    let recording = log.read();
    assert_eq!(recording.time_s, [0.0, 0.01]);
    assert_eq!(
        recording.signal("j", Signal::MotorTorqueNm).unwrap(),
        [1.5, 2.5]
    );
    // a dynamometer of ODrive's
    let rig = Log::new(
        "2019-05-11 15:22:21.2\nInput voltage, Output Torque, Output Speed, Temperature\n\
         V, N.mm, rad.s, Deg C\n48.1, -15.2, -10.5, 25.4\n48.0, -191.5, -10.3, 25.0\n",
    );
    let mapped = rig.mapped(
        "sample_rate_hz = 10\n[joint.j]\njoint_torque_nm = { column = 'Output Torque [N.mm]', scale = 1e-3 }\n\
         temperature_c = 'Temperature [Deg C]'",
    );
    let recording = mapped.read();
    let torque_nm = recording.signal("j", Signal::JointTorqueNm).unwrap();
    assert!((torque_nm[1] + 0.1915).abs() < 1e-12);
    assert_eq!(
        recording.signal("j", Signal::TemperatureC).unwrap()[0],
        25.4
    );
    let wrong = "Rig 7\n\ntime_s,j.motor_torque_nm\n0,1.5\n0.1,x\n";
    assert!(Log::new(wrong).refusal().starts_with("line 5, column"));
}

#[test]
fn nanoseconds_that_are_mapped_as_seconds_are_refused_with_the_scale() {
    let text = "TIME,q\n1720085544312973400,0\n1720085544315403100,1\n1720085544317874900,2\n";
    let mapped = |scale: &str| {
        let time = format!("time_s = {{ column = 'TIME', scale = {scale} }}");
        Log::new(text).mapped(&format!(
            "[columns]\n{time}\n[joint.j]\nlink_position_rad = 'q'"
        ))
    };
    for (scale, factor) in [("1.0", "1e-9"), ("1e-3", "1e-6")] {
        let refusal = mapped(scale).refusal();
        assert!(
            refusal.contains("since 1970 its times would be right; in log.toml, [columns]")
                && refusal.ends_with(&format!("by {factor}")),
            "{refusal}"
        );
    }
    let right = mapped("1e-9").read();
    assert!((right.time_s[1] - 0.002_429_7).abs() < 1e-12);
}

#[test]
fn a_log_with_a_line_for_each_signal_is_to_be_turned_round() {
    let line = |name: &str, values: u32| {
        let values = (0..values).map(|row| (0.25 * f64::from(row)).to_string());
        let names = std::iter::once(name.to_owned()).filter(|name| !name.is_empty());
        names.chain(values).collect::<Vec<_>>().join("\t")
    };
    for (log, columns, rows) in [
        (line("", 500), 500, 1),
        (format!("{}\n{}\n", line("", 500), line("", 499)), 500, 2),
        (
            format!("{}\n{}\n", line("q", 500), line("tau", 500)),
            501,
            2,
        ),
    ] {
        let refusal = Log::new(log).refusal();
        let told = format!("has more columns ({columns}) than rows ({rows}) by far");
        assert!(
            refusal.starts_with(&told) && refusal.contains("turn the table round"),
            "{refusal}"
        );
    }
    // moments, though few
    let rows: Vec<String> = (0..60).map(|_| line("", 500)).collect();
    let refusal = Log::new(rows.join("\n")).refusal();
    assert!(refusal.starts_with("begins with numbers"), "{refusal}");
}

#[test]
fn refusals_say_where_and_what_to_change() {
    let header = "time_s,segment,j.motor_torque_nm\n";
    let refusal = |lines: &str| Log::new(header.to_owned() + lines).refusal();
    assert_eq!(
        refusal("0,0,1\n1,0,1.5 Nm\n"),
        "line 3, column `j.motor_torque_nm`: `1.5 Nm` is not a number (no unit and nothing between \
         thousands is expected, and one decimal mark, point or comma, in the whole file)"
    );
    assert!(
        refusal("0,0,1\n1,0.5,1\n")
            .starts_with("line 3, column `segment`: `0.5` is not an integer")
    );
    assert!(
        refusal("1,0,1\n0.5,0,1\n").starts_with("line 3: time runs backwards, from 1 s to 0.5 s")
    );
    assert_eq!(
        refusal("0,0,1\n,0,1\n"),
        "line 3: no time in column `time_s`"
    );
    assert_eq!(
        refusal("0,0,1\n1,0\n"),
        "line 3: 2 fields where the header names 3"
    );
    assert!(refusal("0,0,1\n1,0,inf\n").starts_with("line 3: j.motor_torque_nm is inf"));
    assert!(refusal("0,0,1\n").starts_with(
        "has 1 rows, from which no sample rate can be told; give `sample_rate_hz` in log.mapping.toml"
    ));
    assert!(Log::new("").refusal().starts_with("is empty"));
    assert!(Log::new("0.1,0.2\n0.3,0.4\n").refusal().starts_with(
        "begins with numbers, so its columns are called `1` to `2`; say in log.mapping.toml"
    ));
    assert!(
        Log::new("j.motor_torque_nm\n1\n")
            .refusal()
            .starts_with("has no column `time_s`; name the time column in log.mapping.toml")
    );
    assert_eq!(
        Log::new("time_s,q\n0,1\n").refusal(),
        "no column is named JOINT.SIGNAL, and log.mapping.toml does not say which column is which signal; \
         its columns are `time_s`, `q`"
    );
    let twice = Log::new("time_s,q,q\n0,1,2\n").mapped("[joint.j]\nmotor_torque_nm = 'q'");
    assert_eq!(twice.refusal(), "has two columns named `q`; rename one");
}

#[test]
fn refusals_of_a_mapping_say_where_and_what_to_change() {
    let log = |mapping: &str| {
        Log::new("time_s,axis1_torque_nm\n0,1\n1,1\n")
            .mapped(mapping)
            .refusal()
    };
    assert_eq!(
        log("[joint.j]\nmotor_torque_nm = 'axis_torque_nm'"),
        "has no column `axis_torque_nm`, which `joint.j.motor_torque_nm` in the mapping file asks for; \
         did you mean `axis1_torque_nm`?"
    );
    assert_eq!(
        log("[joint.j]\nmotor_torqe_nm = 'axis1_torque_nm'"),
        "its mapping file log.toml: unknown key `joint.j.motor_torqe_nm`; did you mean `motor_torque_nm`?"
    );
}

/// The folder of real robots' logs, kept outside the project.
fn real_logs() -> Option<PathBuf> {
    let folder = std::env::var_os("FLEXSPLINE_REALDATA").map(PathBuf::from);
    if folder.is_none() {
        eprintln!("skipped: FLEXSPLINE_REALDATA does not name the folder of real logs");
    }
    folder
}

/// Six axes at 250 Hz for 10 s; motor positions and velocities are already behind the gear, in degrees.
fn kuka_mapping() -> String {
    const GEAR_RATIOS: [f64; 6] = [
        1798.0 / 7.0,
        1872.0 / 7.0,
        757.0 / 3.0,
        221.0,
        5032.0 / 21.0,
        206_793.0 / 1340.0,
    ];
    let degree_rad = PI / 180.0;
    let mut mapping = String::new();
    for (index, gear_ratio) in GEAR_RATIOS.into_iter().enumerate() {
        let axis = index + 1;
        mapping += &format!("[joint.axis{axis}]\n");
        let mut add = |signal: &str, column: &str, scale: f64| {
            mapping +=
                &format!("{signal} = {{ column = \"axis{axis}_{column}\", scale = {scale:?} }}\n");
        };
        add(
            "motor_position_rad",
            "motor_position_deg",
            gear_ratio * degree_rad,
        );
        add(
            "motor_velocity_rad_s",
            "motor_velocity_deg_s",
            gear_ratio * degree_rad,
        );
        add("motor_torque_nm", "motor_torque_nm", 1.0);
        add(
            "reference_position_rad",
            "reference_position_deg",
            degree_rad,
        );
        if axis <= 3 {
            add("link_position_rad", "link_position_deg", degree_rad);
        }
    }
    mapping
}

fn read_kuka(folder: &Path) -> Recording {
    let csv = std::fs::read(folder.join("kuka_kr300/trajectory_a.csv")).unwrap();
    Log::new(csv).mapped(&kuka_mapping()).read()
}

#[test]
fn an_industrial_robots_log_is_read_through_its_mapping() {
    let Some(folder) = real_logs() else { return };
    let recording = read_kuka(&folder);
    assert!(
        (recording.sample_rate_hz - 250.0).abs() < 1e-6,
        "{}",
        recording.sample_rate_hz
    );
    assert!(
        (2400..=2600).contains(&recording.rows()),
        "{}",
        recording.rows()
    );
    let names: Vec<_> = recording.joint_names().collect();
    assert_eq!(
        names,
        ["axis1", "axis2", "axis3", "axis4", "axis5", "axis6"]
    );
    assert!(recording.signal("axis4", Signal::LinkPositionRad).is_err());
    // Motor and link of one joint say the same but for the gear's windup.
    let link_rad = recording.signal("axis1", Signal::LinkPositionRad).unwrap();
    let motor_rad = recording.signal("axis1", Signal::MotorPositionRad).unwrap();
    assert!((motor_rad[0] - 0.059_679_002_4 * PI / 180.0 * 1798.0 / 7.0).abs() < 1e-12);
    let apart = link_rad
        .iter()
        .zip(motor_rad)
        .map(|(link, motor)| (link - motor / (1798.0 / 7.0)).abs());
    let apart_rad = apart.fold(0.0, f64::max);
    let reach_rad = link_rad
        .iter()
        .copied()
        .fold(0.0, |reach: f64, link| reach.max(link.abs()));
    assert!(apart_rad < 0.02 * reach_rad, "{apart_rad} of {reach_rad}");
}

#[test]
fn cells_that_are_lists_are_tables_of_joints() {
    let mut text = "type,timestamp,positions,torques\n".to_owned();
    for row in 0..200 {
        let time_s = 0.02 * f64::from(row);
        let (a, b) = ((3.0 * time_s).sin(), (5.0 * time_s).cos());
        // as Python and as NumPy print them
        let _ = writeln!(
            text,
            "STATE,{:.3},\"[{a}, {b}]\",[{} 2e-1]",
            1e6 * time_s,
            2.0 * a
        );
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("state.csv");
    std::fs::write(&path, text).unwrap();
    let joints = ["shoulder", "elbow"].map(|name| GuessJoint {
        name: name.to_owned(),
        gear_ratio: 1.0,
        is_limited: true,
        has_rotor: false,
        slides: false,
    });
    let (recording, guess) = read_guessing(&path, &joints).unwrap();
    assert_eq!(guess.unwrap().columns.len(), 4);
    assert!((recording.sample_rate_hz - 50.0).abs() < 1e-6);
    let elbow = &recording.joint("elbow").unwrap().signals;
    assert_eq!(elbow[&Signal::JointTorqueNm][7], 0.2);
    assert_eq!(elbow[&Signal::LinkPositionRad][7], (5.0_f64 * 0.14).cos());
}
