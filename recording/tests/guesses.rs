//! What the columns of a foreign log are taken for.
#![allow(clippy::unwrap_used, reason = "a test may")]

use recording::{
    Guess, GuessJoint, ReadProblem, Signal, Sure, guess, mapping_beside, read, read_guessing,
};
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::PathBuf;

struct Log(tempfile::TempDir);

impl Log {
    fn new(header: &str, row: impl Fn(f64) -> Vec<f64>) -> Self {
        let mut text = format!("time_s,{header}\n");
        for index in 0..500 {
            let time_s = f64::from(index) * 0.002;
            let cells: Vec<String> = row(time_s).iter().map(f64::to_string).collect();
            writeln!(text, "{time_s},{}", cells.join(",")).unwrap();
        }
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("log.csv"), text).unwrap();
        Self(folder)
    }

    fn path(&self) -> PathBuf {
        self.0.path().join("log.csv")
    }

    fn guess(&self, joints: &[(&str, f64)]) -> Guess {
        guess(&self.path(), &guess_joints(joints)).unwrap()
    }
}

fn guess_joints(joints: &[(&str, f64)]) -> Vec<GuessJoint> {
    let joint = |(name, gear_ratio): &(&str, f64)| GuessJoint {
        name: (*name).to_owned(),
        gear_ratio: *gear_ratio,
        is_limited: true,
        has_rotor: false,
        slides: false,
    };
    joints.iter().map(joint).collect()
}

fn swing(time_s: f64) -> (f64, f64) {
    ((6.0 * time_s).sin(), 6.0 * (6.0 * time_s).cos())
}

fn told(guess: &Guess, column: &str) -> (String, Signal, f64, Sure) {
    let found = guess
        .columns
        .iter()
        .find(|found| found.column == column)
        .unwrap();
    (found.joint.clone(), found.signal, found.scale, found.sure)
}

#[test]
fn names_units_sides_and_signs_are_told_by_names_and_physics() {
    let log = Log::new(
        "axis1_pos,axis1_vel,axis1_motor_torque_mNm,q2,dq2,comment",
        |time_s| {
            let (angle, speed) = swing(time_s);
            let degrees = 180.0 / PI;
            vec![
                20.0 * angle,
                20.0 * speed,
                1.0,
                angle,
                -100.0 * speed * 30.0 / PI,
                7.0 + degrees,
            ]
        },
    );
    let guess = log.guess(&[("axis1", 50.0), ("axis2", 100.0)]);
    assert_eq!(
        told(&guess, "axis1_pos"),
        (
            "axis1".to_owned(),
            Signal::LinkPositionRad,
            PI / 180.0,
            Sure::Likely
        )
    );
    let (_, signal, scale, _) = told(&guess, "axis1_vel");
    assert_eq!(signal, Signal::LinkVelocityRadS);
    assert!((scale - PI / 180.0).abs() < 1e-12, "{scale}");
    assert_eq!(
        told(&guess, "axis1_motor_torque_mNm"),
        (
            "axis1".to_owned(),
            Signal::MotorTorqueNm,
            1e-3,
            Sure::Certain
        )
    );
    // Turns per minute before the gear, reversed.
    let (joint, signal, scale, _) = told(&guess, "dq2");
    assert_eq!((&joint[..], signal), ("axis2", Signal::MotorVelocityRadS));
    assert!((scale + PI / 30.0).abs() < 1e-12, "{scale}");
    assert_eq!(guess.left_out[0].0, "comment");
}

#[test]
fn what_is_fed_back_was_measured_unless_a_controller_feeds_forward_too() {
    let log = |header: &str| {
        Log::new(header, |time_s| {
            let (angle, speed) = swing(time_s);
            vec![angle, speed, 2.0, 3.0]
        })
    };
    let robot = [("shoulder", 1.0)];
    for name in ["torque_feedback", "feedback_torque", "tau_fb"] {
        let header = format!("position_radians,velocity_radians_per_second,{name},torque");
        let guess = log(&header).guess(&robot);
        let (_, signal, scale, sure) = told(&guess, name);
        assert_eq!(
            (signal, scale, sure),
            (Signal::JointTorqueNm, 1.0, Sure::Likely),
            "{name}"
        );
        assert_eq!(guess.columns.len(), 3, "{:?}", guess.left_out);
    }
    let guess = log("q,dq,tau_fb,tau_ff").guess(&robot);
    assert_eq!(told(&guess, "tau_fb").3, Sure::Doubtful);
}

#[test]
fn a_row_that_was_misread_tells_no_unit() {
    let log = Log::new("q,tau", |time_s| {
        let is_misread = (time_s - 0.4).abs() < 1e-6;
        let leap = if is_misread { 25.0 } else { 0.0 };
        vec![swing(time_s).0 + leap, 1.0]
    });
    let (_, signal, scale, _) = told(&log.guess(&[("shoulder", 1.0)]), "q");
    assert_eq!((signal, scale), (Signal::LinkPositionRad, 1.0));
}

fn write_rows(rows: u32, row: impl Fn(u32) -> String) -> Log {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..rows).map(row).collect();
    let text = format!("t,q,dq,tau\n{rows}");
    std::fs::write(folder.path().join("log.csv"), text).unwrap();
    Log(folder)
}

#[test]
fn rows_are_even_between_the_steps_of_a_coarse_clock() {
    let robot = guess_joints(&[("shoulder", 1.0)]);
    let motion = |time_s: f64| format!("{},{},1.0", time_s.sin(), time_s.cos());
    let minutes = write_rows(20_000, |row| {
        let time_s = 40.0 + 0.01 * f64::from(row);
        format!(
            "13.05.2024 10:{:02},{}\n",
            (time_s / 60.0) as u32,
            motion(time_s)
        )
    });
    let (recording, guess) = read_guessing(&minutes.path(), &robot).unwrap();
    assert!((recording.sample_rate_hz / 100.0 - 1.0).abs() < 1e-3);
    assert_eq!(recording.metadata["clock_step_s"], "60");
    // the velocity agrees with the position
    assert_eq!(told(&guess.unwrap(), "dq").2, 1.0);
    let seconds = write_rows(2000, |row| {
        let time_s = 0.01 * f64::from(row);
        format!("{},{}\n", time_s as u32, motion(time_s))
    });
    let (recording, _) = read_guessing(&seconds.path(), &robot).unwrap();
    assert!((recording.sample_rate_hz / 100.0 - 1.0).abs() < 1e-3);
    assert_eq!(recording.metadata["time_unit_guessed"], "seconds");
    // a minute and its next show no rate
    let short = write_rows(5000, |row| {
        let time_s = 40.0 + 0.01 * f64::from(row);
        format!(
            "13.05.2024 10:{:02},{}\n",
            (time_s / 60.0) as u32,
            motion(time_s)
        )
    });
    let error = read_guessing(&short.path(), &robot).unwrap_err();
    let told = error.to_string();
    assert!(
        told.contains("sample_rate_hz") && !told.contains('\n'),
        "{told}"
    );
    // written three times each
    let thrice = write_rows(300, |row| {
        let time_s = 0.01 * f64::from(row / 3);
        format!("{time_s},{}\n", motion(time_s))
    });
    let (recording, _) = read_guessing(&thrice.path(), &robot).unwrap();
    assert!((recording.sample_rate_hz / 100.0 - 1.0).abs() < 1e-3);
    assert_eq!(recording.time_s[2], 0.0);
}

#[test]
fn rows_of_a_clock_with_ticks_of_about_a_row_are_evened_out() {
    let robot = guess_joints(&[("shoulder", 1.0)]);
    let tick_s = 0.015_625;
    let log = write_rows(4000, |row| {
        let time_s = 0.012 * f64::from(row);
        let told_s = tick_s * (time_s / tick_s).floor();
        format!("{told_s:.3},{},{},1.0\n", time_s.sin(), time_s.cos())
    });
    let (recording, guess) = read_guessing(&log.path(), &robot).unwrap();
    assert_eq!(recording.metadata["clock_step_s"], "0.01562");
    assert!((recording.sample_rate_hz * 0.012 - 1.0).abs() < 0.01);
    for (row, told_s) in recording.time_s.iter().enumerate() {
        let off_s = told_s - 0.012 * row as f64;
        assert!(off_s.abs() < 0.2 * tick_s, "row {row}: {off_s}");
    }
    assert_eq!(told(&guess.unwrap(), "dq").2, 1.0);
}

#[test]
fn a_velocity_tells_the_unit_of_times_that_nothing_else_does() {
    let robot = guess_joints(&[("shoulder", 1.0)]);
    // one row a second, as of a slow joint
    let slow = write_rows(600, |row| {
        let time_s = f64::from(row);
        let angle = (0.05 * time_s).sin();
        let speed = 0.05 * (0.05 * time_s).cos();
        format!("{time_s},{angle},{speed},1.0\n")
    });
    let (recording, guess) = read_guessing(&slow.path(), &robot).unwrap();
    assert_eq!(recording.time_s[599], 599.0);
    assert!(
        guess
            .unwrap()
            .to_toml()
            .contains("scale = 1.0 }   # likely: seconds")
    );
    let fast = write_rows(600, |row| {
        let time_s = 1e-3 * f64::from(row);
        let (angle, speed) = swing(time_s);
        format!("{row},{angle},{speed},1.0\n")
    });
    let (recording, _) = read_guessing(&fast.path(), &robot).unwrap();
    assert!((recording.time_s[599] - 0.599).abs() < 1e-12);
}

#[test]
fn a_torque_at_a_geared_joint_is_doubtful_and_at_one_without_a_gear_is_not() {
    let log = Log::new("q,tau", |time_s| vec![swing(time_s).0, 70.0]);
    let (_, signal, scale, sure) = told(&log.guess(&[("shoulder", 100.0)]), "tau");
    assert_eq!(
        (signal, scale, sure),
        (Signal::MotorTorqueNm, 0.01, Sure::Doubtful)
    );
    let (_, signal, scale, sure) = told(&log.guess(&[("shoulder", 1.0)]), "tau");
    assert_eq!(
        (signal, scale, sure),
        (Signal::JointTorqueNm, 1.0, Sure::Likely)
    );
}

#[test]
fn the_mapping_file_that_is_written_is_read() {
    let log = Log::new("q,q_des,tau", |time_s| vec![swing(time_s).0, 0.5, 70.0]);
    let guess = log.guess(&[("the \"first\" joint", 100.0)]);
    std::fs::write(mapping_beside(&log.path()), guess.to_toml()).unwrap();
    let recording = read(&log.path()).unwrap();
    let of_joint = |signal| recording.signal("the \"first\" joint", signal).unwrap()[0];
    assert_eq!(of_joint(Signal::ReferencePositionRad), 0.5);
    assert!((of_joint(Signal::MotorTorqueNm) - 0.7).abs() < 1e-15);
}

#[test]
fn a_mapping_without_a_time_says_what_to_write() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    std::fs::write(&path, "time,stamp,q\n0,7,0.1\n0.1,8,0.2\n").unwrap();
    let guess = guess(&path, &guess_joints(&[("shoulder", 1.0)])).unwrap();
    assert!(!guess.has_time);
    let text = guess.to_toml();
    assert!(text.contains("# sample_rate_hz = 500.0\n"), "{text}");
    std::fs::write(mapping_beside(&path), &text).unwrap();
    assert!(read(&path).is_err());
    let with_rate = text.replace("# sample_rate_hz", "sample_rate_hz");
    std::fs::write(mapping_beside(&path), with_rate).unwrap();
    assert_eq!(read(&path).unwrap().time_s, [0.0, 0.002]);
}

#[test]
fn joints_are_counted_from_the_least_number() {
    let row = |time_s| vec![swing(time_s).0, 2.0 * swing(time_s).0];
    let joints = [("shoulder", 1.0), ("elbow", 1.0)];
    for header in ["q0,q1", "q1,q2", "position_1,position_2"] {
        let guess = Log::new(header, row).guess(&joints);
        let of: Vec<&str> = guess
            .columns
            .iter()
            .map(|found| found.joint.as_str())
            .collect();
        assert_eq!(of, ["shoulder", "elbow"], "{header}");
    }
    let guess = Log::new("q0,elbow_pos", row).guess(&joints);
    assert_eq!(told(&guess, "elbow_pos").3, Sure::Likely);
}

#[test]
fn columns_from_zero_are_the_joints_from_one_on() {
    let log = Log::new("q0,q1", |time_s| vec![swing(time_s).0, 0.5]);
    let guess = log.guess(&[("joint1", 1.0), ("joint2", 1.0)]);
    let of: Vec<&str> = guess.columns.iter().map(|found| &*found.joint).collect();
    assert_eq!(of, ["joint1", "joint2"]);
}

/// Every column moves: what is told is told by names.
fn named(header: &str, joints: &[&str]) -> Guess {
    let joints: Vec<(&str, f64)> = joints.iter().map(|name| (*name, 1.0)).collect();
    let count = header.split(',').count();
    let log = Log::new(header, |time_s| vec![swing(time_s).0; count]);
    log.guess(&joints)
}

fn doubts(guess: &Guess) -> Vec<&str> {
    guess.doubtful().map(|found| &*found.column).collect()
}

#[test]
fn numbers_that_are_not_the_joints_alone_are_doubtful() {
    let arm = ["shoulder", "elbow", "wrist"];
    for (header, doubtful) in [
        // one family for each of them
        ("q1,q2,q3,tau1,tau2,tau3", &[][..]),
        ("q_arm1,q_arm2,q_arm3,tau_arm1,tau_arm2,tau_arm3", &[]),
        // a hand has more fingers than the arm joints
        (
            "q_hand1,q_hand2,q_hand3,q_hand4",
            &["q_hand1", "q_hand2", "q_hand3"],
        ),
        // and a gripper fewer
        ("theta_1,theta_2", &["theta_1", "theta_2"]),
        ("q1,q2,q3,tau1,tau2", &["tau1", "tau2"]),
        (
            "theta_1,theta_2,q_hand1,q_hand2,q_hand3,q_hand4,tau_hand1",
            &["q_hand1", "tau_hand1", "q_hand2", "q_hand3"],
        ),
        // a part of the drive is no other limb
        ("q1,q2,q3,mos_temp1,mos_temp2,mos_temp3", &[]),
        // some by name, the others by number
        ("q_elbow,q1,q2,q3", &["q1", "q3"]),
        // the torques are of something else than the positions
        (
            "q1,q2,q3,tau_hand1,tau_hand2,tau_hand3",
            &["tau_hand1", "tau_hand2", "tau_hand3"],
        ),
        (
            "q_shoulder,q_elbow,q_wrist,tau_1,tau_2,tau_3",
            &["tau_1", "tau_2", "tau_3"],
        ),
    ] {
        let guess = named(header, &arm);
        assert_eq!(doubts(&guess), doubtful, "{header}: {:?}", guess.columns);
    }
}

#[test]
fn a_log_without_the_gripper_has_the_arms_own_numbers() {
    let robot = ["arm_joint1", "arm_joint2", "finger_left", "finger_right"];
    let guess = named("q1,q2,tau1,tau2", &robot);
    assert_eq!(doubts(&guess), [""; 0], "{:?}", guess.columns);
    let of: Vec<&str> = guess.columns.iter().map(|found| &*found.joint).collect();
    assert_eq!(of, ["arm_joint1", "arm_joint1", "arm_joint2", "arm_joint2"]);
}

#[test]
fn an_arm_goes_before_its_hand_whichever_comes_first() {
    let header = "q_hand1,q_hand2,qd_hand1,qd_hand2,tau_hand1,tau_hand2,q1,q2,tau1,tau2,q_hand3";
    let guess = named(header, &["shoulder", "elbow"]);
    let of = |signal| {
        let mut columns = guess.columns.iter();
        columns.find(|found| found.signal == signal).unwrap()
    };
    assert_eq!(of(Signal::LinkPositionRad).column, "q1");
    assert_eq!(of(Signal::JointTorqueNm).column, "tau1");
    assert_eq!(of(Signal::LinkPositionRad).sure, Sure::Likely);
}

#[test]
fn a_robots_own_numbers_go_with_its_names_and_others_do_not() {
    let robot = ["arm_joint1", "arm_joint2"];
    let guess = named("arm_joint1_pos,arm_joint2_pos,tau_1,tau_2", &robot);
    assert_eq!(doubts(&guess), [""; 0]);
    assert_eq!(told(&guess, "tau_2").0, "arm_joint2");
    // The log counts from 0 and the robot from 1: what has the name of a joint may be the next one.
    let guess = named("joint0_pos,joint1_pos", &["joint1", "joint2"]);
    assert_eq!(doubts(&guess), ["joint1_pos"]);
}

#[test]
fn what_is_certain_enough_is_read_without_a_mapping_and_said() {
    let log = Log::new("elbow_pos_deg,elbow_motor_torque", |time_s| {
        vec![20.0 * swing(time_s).0, 1.5]
    });
    let joints = guess_joints(&[("elbow", 100.0)]);
    let (recording, guess) = read_guessing(&log.path(), &joints).unwrap();
    let line = "elbow: motor_torque_nm is `elbow_motor_torque`, link_position_rad is 0.017453 × `elbow_pos_deg`";
    assert_eq!(guess.unwrap().lines(), [line]);
    assert_eq!(recording.metadata["columns_guessed"], line);
    assert_eq!(
        recording.signal("elbow", Signal::MotorTorqueNm).unwrap()[9],
        1.5
    );
    // A mapping file goes before any guess.
    let mapping = "[joint.elbow]\nmotor_position_rad = 'elbow_pos_deg'";
    std::fs::write(mapping_beside(&log.path()), mapping).unwrap();
    let (recording, guess) = read_guessing(&log.path(), &joints).unwrap();
    assert!(guess.is_none());
    assert!(recording.signal("elbow", Signal::MotorPositionRad).is_ok());
}

#[test]
fn what_is_doubtful_or_told_already_is_not_guessed() {
    let joints = guess_joints(&[("elbow", 100.0)]);
    let log = Log::new("q,tau", |time_s| vec![swing(time_s).0, 70.0]);
    let problem = read_guessing(&log.path(), &joints).unwrap_err().problem;
    assert!(matches!(&problem, ReadProblem::Doubtful { columns, .. } if columns == &["tau"]));
    assert!(
        problem
            .to_string()
            .starts_with("what is in `tau` is doubtful (`tau`: by its name;")
    );
    let log = Log::new("elbow.link_position_rad,tau", |time_s| {
        vec![swing(time_s).0, 70.0]
    });
    let (recording, guess) = read_guessing(&log.path(), &joints).unwrap();
    assert!(guess.is_none() && recording.signal("elbow", Signal::LinkPositionRad).is_ok());
    let log = Log::new("wind", |_| vec![1.0]);
    let problem = read_guessing(&log.path(), &joints).unwrap_err().problem;
    assert!(
        matches!(problem, ReadProblem::NoSignals { .. }),
        "{problem}"
    );
}

#[test]
fn a_line_of_units_is_used() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let mut text = "t q1 motor_torque1\n[ms] [°] [N·m]\n".to_owned();
    for row in 0..500 {
        let angle = 20.0 * swing(f64::from(row) * 0.002).0;
        writeln!(text, "{:6} {angle:9.4}  2.5", 2 * row).unwrap();
    }
    std::fs::write(&path, text).unwrap();
    let (recording, _) = read_guessing(&path, &guess_joints(&[("elbow", 1.0)])).unwrap();
    assert_eq!(recording.time_s[1], 0.002);
    let angle = recording.signal("elbow", Signal::LinkPositionRad).unwrap()[100];
    assert!((angle - (20.0 * swing(0.2).0).to_radians()).abs() < 1e-5);
    assert_eq!(
        recording.signal("elbow", Signal::MotorTorqueNm).unwrap()[1],
        2.5
    );
}

#[test]
fn joints_are_known_by_names_that_say_something_themselves() {
    let row = |time_s| vec![swing(time_s).0, swing(time_s).1, 0.5];
    let header = "- arm_1_joint_position,arm_1_joint_velocity,panda_joint10_effort";
    let joints = [
        ("arm_1_joint", 1.0),
        ("panda_joint1", 1.0),
        ("panda_joint10", 1.0),
    ];
    let guess = Log::new(header, row).guess(&joints);
    let (joint, signal, _, _) = told(&guess, "- arm_1_joint_position");
    assert_eq!((&*joint, signal), ("arm_1_joint", Signal::LinkPositionRad));
    let (joint, signal, _, _) = told(&guess, "arm_1_joint_velocity");
    assert_eq!((&*joint, signal), ("arm_1_joint", Signal::LinkVelocityRadS));
    let (joint, signal, _, _) = told(&guess, "panda_joint10_effort");
    assert_eq!((&*joint, signal), ("panda_joint10", Signal::JointTorqueNm));
}

#[test]
fn a_joints_name_alone_is_its_position_by_custom_only() {
    let row = |time_s| vec![swing(time_s).0, 0.5];
    for header in ["shoulder,elbow", "joint_0,joint_1", "J1,J2"] {
        let guess = Log::new(header, row).guess(&[("shoulder", 1.0), ("elbow", 1.0)]);
        let elbow = &guess.columns[1];
        assert_eq!(
            (&*elbow.joint, elbow.signal),
            ("elbow", Signal::LinkPositionRad),
            "{header}"
        );
        assert_eq!(elbow.sure, Sure::Doubtful);
    }
}

#[test]
fn what_most_positions_are_in_all_are_in() {
    let row = |time_s| {
        vec![
            60.0 * swing(time_s).0,
            40.0 * swing(time_s).0,
            5.0 * swing(time_s).0,
        ]
    };
    let joints = [("a", 1.0), ("b", 1.0), ("c", 1.0)];
    for header in [
        "q1,q2,q3",
        "action[0],action[1],action[2]",
        "Joint_1,Joint_2,Joint_3",
    ] {
        let guess = Log::new(header, row).guess(&joints);
        let scales: Vec<f64> = guess.columns.iter().map(|found| found.scale).collect();
        assert_eq!(scales, [PI / 180.0; 3], "{header}");
    }
}

#[test]
fn of_several_columns_for_one_signal_the_measured_one_is_taken() {
    let log = Log::new("tau_model1,act_torque1_nm", |_| vec![1.0, 2.0]);
    let guess = log.guess(&[("elbow", 1.0)]);
    assert_eq!(guess.columns[0].column, "act_torque1_nm");
    assert_eq!(guess.left_out[0].0, "tau_model1");
}

#[test]
fn a_controllers_torque_and_a_filtered_position_give_way_to_what_was_measured() {
    let log = Log::new(
        "pos_filt1,pos_raw1,q1,tau_con1,tau_fric1,tau_meas1",
        |time_s| vec![swing(time_s).0; 6],
    );
    let guess = log.guess(&[("elbow", 1.0)]);
    let signal_of = |column| told(&guess, column).1;
    assert_eq!(signal_of("q1"), Signal::LinkPositionRad);
    assert_eq!(signal_of("tau_meas1"), Signal::JointTorqueNm);
    assert_eq!(signal_of("tau_con1"), Signal::CommandTorqueNm);
    assert_eq!(guess.columns.len(), 3);
}

#[test]
fn a_joints_name_with_a_quantity_and_another_word_is_doubtful() {
    let log = Log::new("q2,dq2,q2_tau_J_compensate,q2_tau_ext", |time_s| {
        let (q_rad, dq_rad_s) = swing(time_s);
        vec![q_rad, dq_rad_s, 3.0 * q_rad, 0.1]
    });
    let guess = log.guess(&[("q2", 1.0)]);
    let (joint, signal, scale, sure) = told(&guess, "q2_tau_J_compensate");
    assert_eq!((&*joint, signal, scale), ("q2", Signal::JointTorqueNm, 1.0));
    assert_eq!(sure, Sure::Doubtful);
    // a torque from outside is none of the joint's
    let left_out = guess
        .left_out
        .iter()
        .find(|(column, _)| column == "q2_tau_ext");
    assert!(left_out.is_some());
    assert_eq!(told(&guess, "dq2").1, Signal::LinkVelocityRadS);
}

#[test]
fn a_torque_is_never_in_degrees_whatever_its_joint_is_called() {
    // joints that are called as positions are
    let log = Log::new("q3,q3_tau_filtered,q3_tau_mNm", |time_s| {
        vec![swing(time_s).0, 9.9 * swing(time_s).0, 990.0]
    });
    for is_limited in [true, false] {
        let mut joints = guess_joints(&[("q3", 1.0)]);
        joints[0].is_limited = is_limited;
        let guess = guess(&log.path(), &joints).unwrap();
        assert_eq!(told(&guess, "q3").2, 1.0);
        let (_, signal, scale, _) = told(&guess, "q3_tau_mNm");
        assert_eq!((signal, scale), (Signal::JointTorqueNm, 1e-3));
    }
    let log = Log::new("q3,q3_tau_filtered", |time_s| {
        vec![swing(time_s).0, 9.9 * swing(time_s).0]
    });
    let guess = log.guess(&[("q3", 1.0)]);
    let (_, signal, scale, _) = told(&guess, "q3_tau_filtered");
    assert_eq!((signal, scale), (Signal::JointTorqueNm, 1.0));
    assert!(!guess.columns[0].why.contains("degrees"));
}

#[test]
fn a_joint_that_may_turn_round_is_not_taken_for_degrees_without_a_question() {
    let five_turns = Log::new("q", |time_s| vec![30.0 * time_s]);
    let joints = |is_limited| {
        let mut joints = guess_joints(&[("wheel", 1.0)]);
        joints[0].is_limited = is_limited;
        joints
    };
    for (is_limited, sure) in [(true, Sure::Likely), (false, Sure::Doubtful)] {
        let guess = guess(&five_turns.path(), &joints(is_limited)).unwrap();
        assert_eq!(told(&guess, "q").3, sure, "{}", guess.columns[0].why);
    }
    let degrees = Log::new("q", |time_s| vec![90.0 * time_s]);
    let guess = guess(&degrees.path(), &joints(false)).unwrap();
    assert_eq!(told(&guess, "q").3, Sure::Likely);
}

#[test]
fn an_encoders_counts_are_not_taken_for_degrees_without_a_question() {
    let counts = |step: f64| {
        Log::new("q", move |time_s| {
            let counts = 2048.0 + 1000.0 * swing(time_s).0;
            vec![(counts / step).round() * step]
        })
    };
    let whole = counts(1.0).guess(&[("elbow", 1.0)]);
    let found = &whole.columns[0];
    assert_eq!(found.sure, Sure::Doubtful);
    assert!(found.why.contains("an encoder's counts"), "{}", found.why);
    let parts = counts(0.1).guess(&[("elbow", 1.0)]);
    assert_eq!(parts.columns[0].sure, Sure::Likely);
}

#[test]
fn a_torque_at_a_rotor_without_a_gear_is_the_motors() {
    let log = Log::new("q1,tau1", |time_s| vec![swing(time_s).0, 1.0]);
    for (has_rotor, signal) in [
        (false, Signal::JointTorqueNm),
        (true, Signal::MotorTorqueNm),
    ] {
        let mut joints = guess_joints(&[("elbow", 1.0)]);
        joints[0].has_rotor = has_rotor;
        let guess = guess(&log.path(), &joints).unwrap();
        let (_, found, scale, sure) = told(&guess, "tau1");
        assert_eq!((found, scale, sure), (signal, 1.0, Sure::Likely));
    }
}

#[test]
fn a_velocity_beside_a_coarse_encoder_is_as_right() {
    let log = Log::new("q1,qd1,tau1", |time_s| {
        let (angle, velocity) = swing(time_s);
        // from row to row the joint goes a part of a step
        vec![(angle / 0.03).round() * 0.03, velocity, 1.0]
    });
    let guess = log.guess(&[("elbow", 1.0)]);
    assert!(guess.left_out.is_empty(), "{:?}", guess.left_out);
    let (_, signal, scale, _) = told(&guess, "qd1");
    assert_eq!((signal, scale), (Signal::LinkVelocityRadS, 1.0));
}

#[test]
fn a_velocity_that_lags_is_left_out() {
    let log = Log::new("q1,qd1,tau1", |time_s| {
        let (angle, _) = swing(time_s);
        // what a slow low-pass makes of the velocity
        vec![angle, 0.57 * swing(time_s - 0.05).1, 1.0]
    });
    let guess = log.guess(&[("elbow", 1.0)]);
    assert_eq!(guess.doubtful().count(), 0);
    assert_eq!(guess.left_out[0].0, "qd1");
    let signals: Vec<Signal> = guess.columns.iter().map(|found| found.signal).collect();
    assert_eq!(signals, [Signal::LinkPositionRad, Signal::JointTorqueNm]);
}

#[test]
fn a_slide_is_known_by_its_place_and_its_force() {
    let slides = |names: &[&str]| {
        let joints: Vec<(&str, f64)> = names.iter().map(|name| (*name, 1.0)).collect();
        let mut joints = guess_joints(&joints);
        joints.iter_mut().for_each(|joint| joint.slides = true);
        joints
    };
    for (header, scale) in [
        ("x,v,F", 1.0),
        ("pos,vel,force", 1.0),
        ("position_m,velocity_m_s,force_n", 1.0),
        ("x [mm],v [mm/s],F [mN]", 1e-3),
    ] {
        let log = Log::new(header, |time_s| vec![swing(time_s).0, swing(time_s).1, 2.0]);
        let guess = guess(&log.path(), &slides(&["slide"])).unwrap();
        let found: Vec<(Signal, f64, Sure)> = guess
            .columns
            .iter()
            .map(|found| (found.signal, found.scale, found.sure))
            .collect();
        let expected = [
            (Signal::LinkPositionRad, scale, Sure::Likely),
            (Signal::LinkVelocityRadS, scale, Sure::Likely),
            (Signal::JointTorqueNm, scale, Sure::Likely),
        ];
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!((found.0, found.2), (expected.0, expected.2), "{header}");
            assert!((found.1 - expected.1).abs() < 1e-12, "{header}: {found:?}");
        }
        assert_eq!(found.len(), 3, "{header}: {:?}", guess.left_out);
        // of a joint that turns these say nothing, but for the plain words
        let turning = log.guess(&[("elbow", 1.0)]);
        assert!(turning.columns.len() <= 2 && turning.doubtful().count() == 0);
        assert!(
            turning
                .left_out
                .iter()
                .any(|(column, _)| column.to_lowercase().starts_with('f'))
        );
    }
    // never degrees, and a place in space is not the joint's
    let log = Log::new("x", |time_s| vec![300.0 * swing(time_s).0]);
    let far = guess(&log.path(), &slides(&["slide"])).unwrap();
    assert_eq!(
        (far.columns[0].scale, far.columns[0].sure),
        (1.0, Sure::Doubtful)
    );
    let log = Log::new("x,y", |time_s| vec![swing(time_s).0, 1.0]);
    let tool = guess(&log.path(), &slides(&["slide"])).unwrap();
    assert_eq!(doubts(&tool), ["x"]);
    let log = Log::new("x1,x2,F1,F2", |time_s| vec![swing(time_s).0; 4]);
    let gantry = guess(&log.path(), &slides(&["bridge", "trolley"])).unwrap();
    assert_eq!((gantry.columns.len(), gantry.doubtful().count()), (4, 0));
}

#[test]
fn an_estimate_goes_before_what_a_model_makes_and_behind_a_measurement() {
    for (header, taken) in [
        ("q1,tau_cal1,tau_est1", "tau_est1"),
        ("q1,tau_est1,tau_meas1", "tau_meas1"),
        ("q1,tau_est1,tau1", "tau1"),
        ("q1,computed_torque1,applied_torque1", "applied_torque1"),
    ] {
        let guess = named(header, &["elbow"]);
        let torque = guess
            .columns
            .iter()
            .find(|found| found.signal == Signal::JointTorqueNm);
        let torque = torque.unwrap();
        assert_eq!(
            (&*torque.column, torque.sure),
            (taken, Sure::Likely),
            "{header}"
        );
    }
    // one joint without a number
    let guess = named("position,velocity,applied_torque", &["axis"]);
    assert_eq!(told(&guess, "applied_torque").1, Signal::JointTorqueNm);
    let guess = named("q,tau_cal", &["axis"]);
    assert_eq!(guess.left_out[0].0, "tau_cal");
}

#[test]
fn joints_are_known_by_spaces_short_names_and_letters_before_their_number() {
    for (header, joints) in [
        ("joint 1 position,joint 2 position", ["joint1", "joint2"]),
        (
            "Joint 1 Torque [Nm],Joint 2 Torque [Nm]",
            ["axis_1", "axis_2"],
        ),
        ("posa1,posa2", ["shoulder", "elbow"]),
        ("torquej1,torquej2", ["shoulder", "elbow"]),
        ("elbow_pos,fl_hip_pos", ["elbow_joint", "FL_hip_joint"]),
        ("wrist1_vel,wrist2_vel", ["wrist_1", "wrist_2"]),
    ] {
        let guess = named(header, &joints);
        let of: Vec<&str> = guess.columns.iter().map(|found| &*found.joint).collect();
        assert_eq!(of, joints, "{header}: {:?}", guess.left_out);
        assert_eq!(doubts(&guess), [""; 0], "{header}");
    }
    // what is left of a joint's name says which side it is
    let guess = named("motor_torque", &["motor_joint"]);
    assert_eq!(told(&guess, "motor_torque").1, Signal::MotorTorqueNm);
    let guess = named("left_elbow_pos", &["elbow_joint", "wrist_joint"]);
    assert_eq!(doubts(&guess), ["left_elbow_pos"]);
}

#[test]
fn an_arm_may_be_called_as_its_maker_does() {
    let joints = [
        "ur_shoulder_pan_joint",
        "ur_shoulder_lift_joint",
        "ur_elbow_joint",
        "ur_wrist_1_joint",
        "ur_wrist_2_joint",
        "ur_wrist_3_joint",
    ];
    let header = "wrist 3 position,wrist 2 position,wrist 1 position,elbow position,shoulder position,base position";
    let guess = named(header, &joints);
    assert_eq!(doubts(&guess), [""; 0], "{:?}", guess.columns);
    assert_eq!(told(&guess, "base position").0, joints[0]);
    assert_eq!(told(&guess, "shoulder position").0, joints[1]);
    assert_eq!(told(&guess, "wrist 3 position").0, joints[5]);
    let guess = named("shoulder_pan_pos,shoulder_lift_pos", &joints);
    assert_eq!(told(&guess, "shoulder_pan_pos").0, joints[0]);
    assert_eq!(doubts(&guess), [""; 0]);
    // without a base the shoulder may be either
    assert_eq!(
        doubts(&named("shoulder_pos,elbow_pos", &joints)),
        ["shoulder_pos"]
    );
    // and beside the description's names a base is the cart's
    let guess = named("base_pos,ur_shoulder_pan_joint_pos", &joints);
    assert_eq!(guess.columns[0].column, "ur_shoulder_pan_joint_pos");
    assert_eq!(guess.left_out[0].0, "base_pos");
    // and of another arm it is not known
    let other = ["shoulder_yaw", "shoulder_pitch", "elbow_pitch"];
    assert!(named("base_pos,shoulder_pos", &other).columns.is_empty());
    let guess = named(
        "actual_q_0,actual_q_1,actual_q_2,actual_q_3,actual_q_4,actual_q_5",
        &joints,
    );
    let of: Vec<&str> = guess.columns.iter().map(|found| &*found.joint).collect();
    assert_eq!(of, joints);
}

/// Messages as `rostopic echo -p` writes them, one a row.
fn echoed(header: &str, row: impl Fn(f64) -> String) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("echo.csv");
    let mut text = format!("{header}\n");
    for index in 0..500_u64 {
        let time_s = index as f64 * 0.002;
        let stamp_ns = 1_700_000_000_000_000_000 + 2_000_000 * index;
        writeln!(text, "{stamp_ns},{}", row(time_s)).unwrap();
    }
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

#[test]
fn a_message_that_was_echoed_tells_its_joints() {
    let header = "%time,field.header.seq,field.name0,field.name1,field.position0,field.position1,field.effort0,field.effort1";
    let row = |time_s: f64| format!("7,wrist,elbow,{},0.25,3.5,-1", swing(time_s).0);
    let (_folder, path) = echoed(header, row);
    let joints = guess_joints(&[("elbow", 1.0), ("wrist", 1.0)]);
    let (recording, _) = read_guessing(&path, &joints).unwrap();
    assert!((recording.sample_rate_hz - 500.0).abs() < 1e-6);
    assert_eq!(
        recording.signal("elbow", Signal::LinkPositionRad).unwrap()[9],
        0.25
    );
    assert_eq!(
        recording.signal("wrist", Signal::JointTorqueNm).unwrap()[9],
        3.5
    );
    // two publishers by turns: no column is of one joint
    let row = |time_s: f64| {
        let names = if time_s < 0.5 {
            "wrist,elbow"
        } else {
            "elbow,wrist"
        };
        format!("7,{names},{},0.25,3.5,-1", swing(time_s).0)
    };
    let (_folder, path) = echoed(header, row);
    assert!(guess(&path, &joints).unwrap().columns.is_empty());
}

#[test]
fn a_controllers_process_value_is_a_position_by_custom() {
    let header = "%time,field.set_point,field.process_value,field.process_value_dot,field.error,field.command";
    let row = |time_s| {
        let (angle, velocity) = swing(time_s);
        format!("{angle},{angle},{velocity},0,1")
    };
    let (_folder, path) = echoed(header, row);
    let guess = guess(&path, &guess_joints(&[("axis", 1.0)])).unwrap();
    let (_, signal, _, sure) = told(&guess, "field.process_value");
    assert_eq!((signal, sure), (Signal::LinkPositionRad, Sure::Doubtful));
    assert_eq!(
        told(&guess, "field.process_value_dot").1,
        Signal::LinkVelocityRadS
    );
    assert_eq!(guess.columns.len(), 2, "{:?}", guess.left_out);
}
