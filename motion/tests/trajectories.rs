//! Laws of every trajectory, and the numbers of the lemniscate.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::fs;

use motion::{
    JointEntry, LEMNISCATE_PERIOD_S, MotionError, MultiSineEntry, NAMES, PaTenArm, Reference,
    Trajectory, TrajectoryFile, TrajectoryKind, default_name, lemniscate_pose, load,
};
use robot::Robot;

fn pa10() -> Robot {
    robot::load("pa10").unwrap()
}

fn at(trajectory: &Trajectory, time_s: f64) -> Reference {
    let mut reference = Reference::default();
    trajectory.sample(time_s, &mut reference);
    reference
}

fn from_file(name: &str, text: &str, robot: &Robot) -> Result<Trajectory, MotionError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, text).unwrap();
    load(path.to_str().unwrap(), robot)
}

/// The lemniscate as the paper ran it, without a soft start.
fn abrupt_lemniscate(robot: &Robot) -> Trajectory {
    let file = TrajectoryFile {
        kind: TrajectoryKind::Lemniscate,
        soft_start_s: Some(0.0),
        ..Default::default()
    };
    file.build("test", robot).unwrap()
}

#[track_caller]
fn assert_derivatives_match(trajectory: &Trajectory, times_s: impl Iterator<Item = f64>) {
    let h = 1e-4;
    for t in times_s {
        let (low, mid, high) = (
            at(trajectory, t - h),
            at(trajectory, t),
            at(trajectory, t + h),
        );
        for joint in 0..trajectory.joint_count() {
            let slope = (high.position_rad[joint] - low.position_rad[joint]) / (2.0 * h);
            let slope_error = slope - mid.velocity_rad_s[joint];
            assert!(
                slope_error.abs() < 1e-6,
                "joint {joint} at {t}: velocity off by {slope_error}"
            );
            let curvature = (high.velocity_rad_s[joint] - low.velocity_rad_s[joint]) / (2.0 * h);
            let curvature_error = curvature - mid.acceleration_rad_s2[joint];
            assert!(
                curvature_error.abs() < 1e-5,
                "joint {joint} at {t}: acceleration off by {curvature_error}"
            );
        }
    }
}

#[test]
fn velocity_and_acceleration_are_the_derivatives() {
    let robot = pa10();
    for name in ["lemniscate", "sine", "multi_sine", "hold"] {
        assert_derivatives_match(
            &load(name, &robot).unwrap(),
            (1..400).map(|step| 0.0371 * f64::from(step)),
        );
    }
}

#[test]
fn every_named_trajectory_starts_at_rest_on_every_robot() {
    for robot_name in robot::shipped() {
        let robot = robot::load(robot_name).unwrap();
        for name in NAMES
            .into_iter()
            .filter(|name| robot_name == "pa10" || *name != "lemniscate")
        {
            let trajectory = load(name, &robot).unwrap();
            let start = at(&trajectory, 0.0);
            assert_eq!(start.velocity_rad_s, [0.0; 16], "{robot_name} {name}");
            assert_eq!(start.acceleration_rad_s2, [0.0; 16], "{robot_name} {name}");
            assert_eq!(at(&trajectory, -1.0), start);
            assert_eq!(at(&trajectory, f64::NAN), start);
            assert_eq!(trajectory.joint_count(), robot.joints.len());
            assert!(
                start.position_rad[robot.joints.len()..]
                    .iter()
                    .all(|position| *position == 0.0)
            );
        }
    }
}

#[test]
fn lemniscate_follows_equation_14_to_the_micron() {
    let robot = pa10();
    let trajectory = abrupt_lemniscate(&robot);
    let arm = PaTenArm::new(&robot.chain).unwrap();
    for step in 0..1000 {
        let t = LEMNISCATE_PERIOD_S * f64::from(step) / 1000.0;
        let reached = robot.chain.tool_pose(&at(&trajectory, t).position_rad[..7]);
        let (sin, cos) = (t / 2.0).sin_cos();
        let shrink = 1.0 + sin * sin;
        let expected =
            nalgebra::Vector3::new(0.6, 0.2 * cos / shrink, 0.1 + 0.4 * sin * cos / shrink);
        assert!((reached.translation.vector - expected).norm() < 1e-6);
        assert!((reached.rotation.angle_to(&lemniscate_pose(0.0).rotation)) < 1e-6);
        let solved = arm.solve(&lemniscate_pose(t)).unwrap();
        assert!(
            solved
                .iter()
                .zip(at(&trajectory, t).position_rad)
                .all(|(a, b)| (a - b).abs() < 1e-9)
        );
    }
}

#[test]
fn lemniscate_is_periodic_and_locks_joint_3() {
    let trajectory = load("lemniscate", &pa10()).unwrap();
    for step in 0..100 {
        let t = 2.0 + 0.13 * f64::from(step);
        let (once, again) = (at(&trajectory, t), at(&trajectory, t + LEMNISCATE_PERIOD_S));
        for joint in 0..7 {
            assert!((once.position_rad[joint] - again.position_rad[joint]).abs() < 1e-9);
            assert!(
                (once.acceleration_rad_s2[joint] - again.acceleration_rad_s2[joint]).abs() < 1e-9
            );
        }
        assert_eq!(once.position_rad[2], 0.0);
    }
}

#[test]
fn lemniscate_stays_slow_and_away_from_limits_and_singularity() {
    let robot = pa10();
    let trajectory = load("lemniscate", &robot).unwrap();
    let (mut wrist, mut speed_rad_s, mut margin_rad) = ((f64::MAX, f64::MIN), 0.0_f64, f64::MAX);
    for step in 0..15_000 {
        let reference = at(&trajectory, 0.001 * f64::from(step));
        wrist = (
            wrist.0.min(reference.position_rad[5]),
            wrist.1.max(reference.position_rad[5]),
        );
        for (joint, limits) in robot
            .joints
            .iter()
            .map(|joint| joint.position_limit_rad.unwrap())
            .enumerate()
        {
            let position_rad = reference.position_rad[joint];
            speed_rad_s = speed_rad_s.max(reference.velocity_rad_s[joint].abs());
            margin_rad = margin_rad
                .min(limits[1] - position_rad)
                .min(position_rad - limits[0]);
        }
    }
    // The numbers the documentation of the path gives.
    assert!(speed_rad_s < 0.37, "{speed_rad_s}");
    assert!(wrist.0 > 0.49 && wrist.1 < 0.86, "{wrist:?}");
    assert!(margin_rad > 0.4, "{margin_rad}");
}

#[test]
fn lemniscate_loads_joint_6_as_the_paper_says() {
    let robot = pa10();
    let mut torque_nm = [0.0; 7];
    let mut largest_nm = 0.0_f64;
    let trajectory = abrupt_lemniscate(&robot);
    for step in 0..100 {
        let position_rad = at(&trajectory, 0.126 * f64::from(step)).position_rad;
        robot
            .chain
            .gravity_torque(&position_rad[..7], &mut torque_nm);
        largest_nm = largest_nm.max(torque_nm[5].abs());
        assert!(torque_nm[4].abs() <= 0.3);
    }
    assert!((largest_nm - 0.3).abs() < 0.01, "{largest_nm}");
}

#[test]
fn trapezoid_is_the_papers_experiment_on_joint_3() {
    let robot = pa10();
    let trajectory = load("trapezoid", &robot).unwrap();
    let (start, middle, end) = (
        at(&trajectory, 0.0),
        at(&trajectory, 5.0),
        at(&trajectory, 60.0),
    );
    assert!((end.position_rad[2] - start.position_rad[2] - 1.0).abs() < 1e-12);
    assert!((middle.velocity_rad_s[2] - 0.1).abs() < 1e-12);
    assert!((trajectory.duration_s().unwrap() - 10.1).abs() < 1e-9);
    let (mut at_start_nm, mut turned_nm) = ([0.0; 7], [0.0; 7]);
    robot
        .chain
        .gravity_torque(&start.position_rad[..7], &mut at_start_nm);
    for turn in [-0.3, 0.3, 1.0] {
        let mut turned = start.position_rad;
        turned[2] += turn;
        robot.chain.gravity_torque(&turned[..7], &mut turned_nm);
        assert!(
            turned_nm[2].abs() < at_start_nm[2].abs(),
            "gravity load is largest at the start"
        );
    }
}

#[test]
fn only_ends_that_come_are_given_a_duration() {
    let robot = pa10();
    for name in ["lemniscate", "sine", "multi_sine", "hold"] {
        assert_eq!(load(name, &robot).unwrap().duration_s(), None, "{name}");
    }
    assert_eq!(default_name(&robot), "lemniscate");
    assert_eq!(default_name(&robot::load("shd17").unwrap()), "multi_sine");
}

#[test]
fn waypoints_are_passed_and_held() {
    let csv = "time_s,joint2.reference_position_rad,joint4.reference_position_rad,joint4.motor_position_rad\n\
               10,0.1,0.5,\n11,0.3,0.4,\n12.5,0.2,0.6,\n";
    let trajectory = from_file("way.csv", csv, &pa10()).unwrap();
    for (time_s, joint2, joint4) in [
        (0.0, 0.1, 0.5),
        (1.0, 0.3, 0.4),
        (2.5, 0.2, 0.6),
        (9.0, 0.2, 0.6),
    ] {
        let position_rad = at(&trajectory, time_s).position_rad;
        assert!(
            (position_rad[1] - joint2).abs() < 1e-12 && (position_rad[3] - joint4).abs() < 1e-12,
            "{time_s}"
        );
        assert_eq!(position_rad[0], 0.0);
    }
    assert_eq!(trajectory.duration_s(), Some(2.5));
    assert_eq!(at(&trajectory, 0.0).velocity_rad_s, [0.0; 16]);
    assert_derivatives_match(&trajectory, [0.2, 0.7, 1.3, 2.0].into_iter());
}

#[test]
fn a_file_gives_each_joint_its_own_motion() {
    let text = r#"
        kind = "sine"
        soft_start_s = 1
        duration_s = 30
        [[joint]]
        name = "joint2"
        kind = "trapezoid"
        start_rad = 0.1
        distance_rad = -0.2
        speed_rad_s = 0.2
        dwell_s = 0.5
        [[joint]]
        name = "joint3"
        kind = "hold"
        position_rad = 0.4
        [[joint]]
        name = "joint7"
        kind = "multi_sine"
        band_hz = [0.1, 2.0]
        amplitude_rad = 0.2
        speed_rad_s = 5.0
        seed = 3
    "#;
    let trajectory = from_file("mix.toml", text, &pa10()).unwrap();
    assert_eq!(trajectory.duration_s(), Some(30.0));
    assert_eq!(trajectory.soft_start_s(), 1.0);
    assert_eq!(at(&trajectory, 3.0).position_rad[2], 0.4);
    let samples: Vec<Reference> = (0..3000)
        .map(|step| at(&trajectory, 0.01 * f64::from(step)))
        .collect();
    let range = |joint: usize| {
        let positions = samples
            .iter()
            .map(|reference| reference.position_rad[joint]);
        positions.fold((f64::MAX, f64::MIN), |(low, high), x| {
            (low.min(x), high.max(x))
        })
    };
    assert!((range(1).0 + 0.1).abs() < 1e-9 && (range(1).1 - 0.1).abs() < 1e-9);
    assert!((range(0).1 - 0.3).abs() < 1e-4 && range(6).1.max(-range(6).0) > 0.19);
}

#[test]
fn trajectory_files_survive_writing() {
    let entry = MultiSineEntry {
        name: "joint7".into(),
        seed: Some(3),
        ..Default::default()
    };
    let file = TrajectoryFile {
        kind: TrajectoryKind::Trapezoid,
        joints: vec![JointEntry::MultiSine(entry)],
        ..Default::default()
    };
    let text = toml::to_string(&file).unwrap();
    assert_eq!(
        robot::parse_toml::<TrajectoryFile>(&text, "written").unwrap(),
        file
    );
}

#[test]
fn limits_are_checked_with_joint_time_and_value() {
    let robot = pa10();
    let far = "[[joint]]\nname = \"joint2\"\nkind = \"trapezoid\"\nstart_rad = 0\ndistance_rad = 2.0\nspeed_rad_s = 0.5";
    let message = from_file("far.toml", far, &robot).unwrap_err().to_string();
    assert!(message.starts_with("joint2 would be at 1.64"), "{message}");
    assert!(
        message.contains("limits -1.6406 to 1.6406") && message.contains(" at 3."),
        "{message}"
    );
    let fast =
        "[[joint]]\nname = \"joint1\"\nkind = \"sine\"\namplitude_rad = 0.5\nfrequency_hz = 1.0";
    let message = from_file("fast.toml", fast, &robot)
        .unwrap_err()
        .to_string();
    assert!(
        message.starts_with("joint1 would move at") && message.contains("0.8500"),
        "{message}"
    );
    let csv = "time_s,joint4.reference_position_rad\n0,0\n10,2.5\n";
    let message = from_file("far.csv", csv, &robot).unwrap_err().to_string();
    assert!(message.starts_with("joint4 would be at 2.39"), "{message}");
}

#[test]
fn bad_requests_are_refused_in_one_line() {
    let robot = pa10();
    let unknown = load("lemniscat", &robot).unwrap_err().to_string();
    assert!(NAMES.iter().all(|name| unknown.contains(name)), "{unknown}");
    assert!(unknown.contains("did you mean `lemniscate`?"), "{unknown}");
    let missing = load("missing.csv", &robot).unwrap_err().to_string();
    assert!(
        missing.starts_with("missing.csv: cannot be read"),
        "{missing}"
    );
    let other_arm = load("lemniscate", &robot::load("shd17").unwrap())
        .unwrap_err()
        .to_string();
    assert!(
        other_arm.contains("needs a PA-10-shaped arm") && other_arm.contains("use multi_sine"),
        "{other_arm}"
    );
    let joint = |line: &str| format!("[[joint]]\nname = \"joint2\"\n{line}");
    for (name, text, words) in [
        (
            "a.toml",
            "kind = \"lemniscat\"".to_owned(),
            "did you mean `lemniscate`?",
        ),
        (
            "a.toml",
            "kindd = \"sine\"".to_owned(),
            "did you mean `kind`?",
        ),
        (
            "a.toml",
            "kind = \"sine\"\nsoft_start_s = -1".to_owned(),
            "soft_start_s = -1 must be zero or above",
        ),
        (
            "a.toml",
            "kind = \"sine\"\nduration_s = inf".to_owned(),
            "duration_s = inf must be above zero",
        ),
        ("a.toml", "kind = ".to_owned(), "line 1"),
        (
            "a.toml",
            format!("kind = \"lemniscate\"\n{}", joint("kind = \"hold\"")),
            "remove the [[joint]] tables",
        ),
        (
            "a.toml",
            joint("kind = \"hold\"").replace("joint2", "joint9"),
            "unknown joint `joint9`",
        ),
        (
            "a.toml",
            format!("{0}\n{0}", joint("kind = \"hold\"")),
            "two [[joint]] tables",
        ),
        (
            "a.toml",
            joint("kind = \"hold\"\nposition = 1"),
            "did you mean `position_rad`?",
        ),
        (
            "a.toml",
            joint("kind = \"sine\"\nfrequency_hz = 0"),
            "frequency_hz = 0 must be from 0.0001",
        ),
        (
            "a.toml",
            joint("kind = \"multi_sine\"\nband_hz = [1, 0.5]"),
            "must hold 1 to 256 multiples",
        ),
        (
            "a.toml",
            joint("kind = \"multi_sine\"\nband_hz = [nan, nan]"),
            "must hold 1 to 256 multiples",
        ),
        (
            "a.toml",
            joint("kind = \"trapezoid\"\nspeed_rad_s = 0"),
            "speed_rad_s = 0 must be above zero",
        ),
        ("a.csv", String::new(), "column time_s is missing"),
        (
            "a.csv",
            "time_s\n0\n1\n".to_owned(),
            "add a column such as joint1.reference_position_rad",
        ),
        (
            "a.csv",
            "time_s,joint8.reference_position_rad\n0,0\n1,1".to_owned(),
            "did you mean `joint",
        ),
        (
            "a.csv",
            "time_s,joint2.reference_position_rd\n0,0\n1,1".to_owned(),
            "did you mean `joint2.reference_position_rad`?",
        ),
        (
            "a.csv",
            "time_s,joint2.reference_position_rad\n0,0\n0,1".to_owned(),
            "line 3: time_s = 0 must be above",
        ),
        (
            "a.csv",
            "time_s,joint2.reference_position_rad\n0,0\n1,x".to_owned(),
            "line 3: joint2.reference_position_rad = \"x\"",
        ),
        (
            "a.csv",
            "time_s,joint2.reference_position_rad\n0,0\n1".to_owned(),
            "line: 3",
        ),
        (
            "a.csv",
            "time_s,joint2.reference_position_rad\n0,0\n".to_owned(),
            "give at least 2",
        ),
    ] {
        let message = from_file(name, &text, &robot).unwrap_err().to_string();
        assert!(
            message.contains(words) && !message.contains('\n'),
            "{words:?} is not in: {message}"
        );
    }
}

mod mangled {
    use std::sync::LazyLock;

    use proptest::prelude::*;

    use super::*;

    const FILE: &str = "kind = \"sine\"\nsoft_start_s = 1\n[[joint]]\nname = \"joint1\"\nkind = \"multi_sine\"\n\
                        band_hz = [0.1, 0.8]\nperiod_s = 10\namplitude_rad = 0.3\nseed = 4\n";

    proptest! {
        #[test]
        fn files_never_panic(wounds in prop::collection::vec((any::<prop::sample::Index>(), 0usize..12, "[-0-9.eE=\"\\[\\]\n a-z_]{0,8}"), 1..5)) {
            static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().unwrap());
            static SHD17: LazyLock<Robot> = LazyLock::new(|| robot::load("shd17").expect("shipped"));
            let mut chars: Vec<char> = FILE.chars().collect();
            for (at, length, scrap) in &wounds {
                let start = at.index(chars.len() + 1);
                let end = (start + length).min(chars.len());
                chars.splice(start..end, scrap.chars());
            }
            let text: String = chars.into_iter().collect();
            let path = FOLDER.path().join("x.toml");
            fs::write(&path, &text).unwrap();
            match load(path.to_str().unwrap(), &SHD17) {
                Err(error) => prop_assert!(!error.to_string().contains('\n'), "{error}"),
                Ok(trajectory) => {
                    let mut reference = motion::Reference::default();
                    trajectory.sample(12.3, &mut reference);
                    prop_assert!(reference.position_rad[0].is_finite(), "{text}");
                }
            }
        }
    }
}
