//! What several joints see of one cause is told once.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::collections::BTreeMap;
use std::path::PathBuf;

use gap_diagnosis::{Options, diagnose};
use gap_report::{Report, Verdict};
use recording::{JointColumns, Recording, Signal};
use robot::{Control, ControlKind, Effect, Feedback, Feedforward, Robot, RobotFile, Source};

const RATE_HZ: f64 = 250.0;
const JOINTS: [&str; 3] = ["base", "shoulder", "elbow"];

fn robot() -> Robot {
    let link = |joint: &str, axis: &str, origin: &str, mass: f64| {
        format!(
            "[[link]]\njoint = \"{joint}\"\norigin_m = {origin}\naxis = {axis}\nmass_kg = {mass}\ncentre_of_mass_m = [0.0, 0.02, 0.2]\n\
             inertia_kg_m2 = {{ xx = 0.05, yy = 0.05, zz = 0.02, xy = 0.0, yz = 0.0, xz = 0.0 }}\n[[joint]]\nname = \"{joint}\"\n"
        )
    };
    let text = [
        "name = \"arm\"\n".to_owned(),
        link("base", "[0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0]", 6.0),
        link("shoulder", "[0.0, 1.0, 0.0]", "[0.0, 0.0, 0.3]", 5.0),
        link("elbow", "[0.0, 1.0, 0.0]", "[0.0, 0.0, 0.4]", 3.0),
    ]
    .concat();
    let file = RobotFile::parse(&text, "arm.toml").unwrap();
    file.build(Source::File(PathBuf::from("arm.toml"))).unwrap()
}

/// What is said of the robot when it has these effects.
fn told(effects: Vec<Effect>) -> Report {
    let real = Robot {
        shared_effects: effects,
        ..robot()
    };
    told_of(&real, [1.0; 3])
}

/// What is said along sines: the torque that the real robot needs, friction of 2 Nm at every joint, and noise, each joint's torque times a
/// factor.
fn told_of(real: &Robot, factors: [f64; 3]) -> Report {
    told_when(real, |joint, torque_nm, _| factors[joint] * torque_nm)
}

/// The same with what is recorded of each joint's torque, by its velocity.
fn told_when(real: &Robot, recorded_nm: impl Fn(usize, f64, f64) -> f64) -> Report {
    let recordings = [("log".to_owned(), recorded(real, recorded_nm))];
    diagnose(&robot(), &recordings, &Options::default(), &|_| ())
        .unwrap()
        .report
}

fn recorded(real: &Robot, recorded_nm: impl Fn(usize, f64, f64) -> f64) -> Recording {
    let chain = real.loaded_chain().unwrap();
    let waves = [[0.7, 0.9], [0.5, 1.3], [0.8, 1.1]];
    let rows = (20.0 * RATE_HZ) as usize;
    let time_s: Vec<f64> = (0..rows).map(|k| k as f64 / RATE_HZ).collect();
    let mut columns = vec![[Vec::new(), Vec::new()]; JOINTS.len()];
    let mut seed = 3_u64;
    for t in &time_s {
        let mut motion = [[0.0; 3]; 3];
        for (joint, [size, rate]) in waves.iter().enumerate() {
            for (part, rate) in [(1.0, *rate), (0.3, 2.7 * rate)] {
                let phase = rate * t + joint as f64;
                motion[0][joint] += part * size * phase.sin();
                motion[1][joint] += part * size * rate * phase.cos();
                motion[2][joint] -= part * size * rate * rate * phase.sin();
            }
        }
        let mut torque_nm = [0.0; 3];
        chain.inverse_dynamics(&motion[0], &motion[1], &motion[2], &mut torque_nm);
        for (joint, column) in columns.iter_mut().enumerate() {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let noise = (seed >> 33) as f64 / f64::from(1_u32 << 30) - 1.0;
            column[0].push(motion[0][joint]);
            let torque_nm = torque_nm[joint] + 2.0 * motion[1][joint].signum() + 0.2 * noise;
            column[1].push(recorded_nm(joint, torque_nm, motion[1][joint]));
        }
    }
    let joints = JOINTS
        .iter()
        .zip(columns)
        .map(|(name, [position, torque])| JointColumns {
            name: (*name).to_owned(),
            signals: BTreeMap::from([
                (Signal::LinkPositionRad, position),
                (Signal::MotorTorqueNm, torque),
            ]),
        });
    Recording {
        time_s,
        segment: None,
        joints: joints.collect(),
        sample_rate_hz: RATE_HZ,
        metadata: BTreeMap::new(),
        truncated: false,
    }
}

fn has_friction(report: &Report) {
    for joint in &report.joints {
        assert_eq!(joint.verdict, Verdict::Explained, "{}", joint.joint);
        let friction = joint
            .effects
            .iter()
            .find(|e| e.effect == "coulomb_friction");
        let coulomb_nm = friction.unwrap().parameters["coulomb_nm"].value;
        assert!(
            (coulomb_nm - 2.0).abs() < 0.1,
            "{}: {coulomb_nm}",
            joint.joint
        );
        let of_shared = report.shared_effects.iter().flat_map(|s| &s.joint_shares);
        let shared: f64 = of_shared
            .filter(|(name, _)| **name == joint.joint)
            .map(|(_, share)| share.share)
            .sum();
        let own = joint.effects.iter().chain(&joint.minor_effects);
        let all = own.map(|e| e.share).sum::<f64>() + shared + joint.remaining_share;
        assert!((all - 1.0).abs() < 1e-6, "{}: {all}", joint.joint);
    }
}

#[test]
fn a_payload_is_one_cause_of_all_joints() {
    let report = told(vec![Effect::Payload {
        mass_kg: 1.5,
        centre_m: [0.0, 0.05, 0.3],
    }]);
    let shared = &report.shared_effects;
    assert_eq!(shared.len(), 1);
    assert_eq!(shared[0].effect.effect, "payload");
    let value = |name: &str| shared[0].effect.parameters[name].value;
    assert!((value("mass_kg") - 1.5).abs() < 0.3, "{}", value("mass_kg"));
    assert!((value("mass_kg") * value("centre_m_z") - 0.45).abs() < 0.1);
    has_friction(&report);
}

#[test]
fn a_tilted_base_is_told_as_one() {
    let report = told(vec![Effect::BaseTilt {
        roll_rad: 0.0,
        pitch_rad: 0.05,
    }]);
    assert_eq!(report.shared_effects[0].effect.effect, "base_tilt");
    let pitch_rad = report.shared_effects[0].effect.parameters["pitch_rad"].value;
    assert!((pitch_rad - 0.05).abs() < 0.01, "{pitch_rad}");
    has_friction(&report);
}

/// Arms are mounted on walls and ceilings, and their files seldom say so.
#[test]
fn a_base_on_its_side_or_upside_down_is_a_tilt() {
    use std::f64::consts::PI;
    for (roll_rad, pitch_rad) in [(0.0, PI / 2.0), (-PI / 2.0, 0.0), (PI, 0.0), (0.4, -0.9)] {
        let report = told(vec![Effect::BaseTilt {
            roll_rad,
            pitch_rad,
        }]);
        let shared = &report.shared_effects;
        let named: Vec<&str> = shared.iter().map(|s| s.effect.effect.as_str()).collect();
        assert_eq!(named, ["base_tilt"], "{roll_rad} {pitch_rad}");
        let value = |name: &str| shared[0].effect.parameters[name].value;
        let found = Effect::BaseTilt {
            roll_rad: value("roll_rad"),
            pitch_rad: value("pitch_rad"),
        };
        let on = |tilt: Effect| {
            let robot = Robot {
                shared_effects: vec![tilt],
                ..robot()
            };
            robot.loaded_chain().unwrap().gravity_m_s2()
        };
        let real = on(Effect::BaseTilt {
            roll_rad,
            pitch_rad,
        });
        let off = on(found).angle(&real);
        assert!(off < 0.02, "{off} rad at {roll_rad} {pitch_rad}");
        for joint in &report.joints[1..] {
            let torque = joint.gap.torque_rms_nm;
            assert!(torque.after < 0.05 * torque.before, "{}", joint.joint);
        }
    }
}

#[test]
fn friction_alone_is_no_cause_that_joints_share() {
    let report = told(Vec::new());
    assert!(report.shared_effects.is_empty());
    has_friction(&report);
}

#[test]
fn inertia_of_a_link_is_felt_as_the_link_turns_in_space() {
    let mut real = robot();
    let inertia_kg_m2 = 0.3;
    real.joints[2]
        .effects
        .push(Effect::LinkInertia { inertia_kg_m2 });
    let report = told_of(&real, [1.0; 3]);
    let elbow = &report.joints[2];
    let named = elbow.effects.iter().find(|e| e.effect == "link_inertia");
    let found = named.unwrap().parameters["inertia_kg_m2"].value;
    assert!((found / inertia_kg_m2 - 1.0).abs() < 0.1, "{found}");
    assert!(report.shared_effects.is_empty());
}

#[test]
fn a_joint_that_nothing_explains_has_no_voice_in_what_the_arm_carries() {
    let payload = Effect::Payload {
        mass_kg: 1.5,
        centre_m: [0.0, 0.05, 0.3],
    };
    let real = Robot {
        shared_effects: vec![payload],
        ..robot()
    };
    // a drive that compensates more friction than there is
    let compensated = |joint: usize, torque_nm: f64, velocity_rad_s: f64| {
        if joint == 0 {
            torque_nm + 5.0 * velocity_rad_s.signum() - 40.0 * velocity_rad_s
        } else {
            torque_nm
        }
    };
    let report = told_when(&real, compensated);
    let base = &report.joints[0];
    assert_eq!(base.verdict, Verdict::Unexplained);
    assert!(base.reason.contains("drives the joint"), "{}", base.reason);
    let shared = &report.shared_effects;
    let mass_kg = shared[0].effect.parameters["mass_kg"].value;
    assert!((mass_kg - 1.5).abs() < 0.1, "{mass_kg}");
}

/// Coulomb friction of a joint, and in how many times the recorded torque.
fn rubs(report: &Report, joint: usize) -> [f64; 2] {
    let joint = &report.joints[joint];
    let mut effects = joint.effects.iter();
    let coulomb = effects.find(|found| found.effect == "coulomb_friction");
    let coulomb_nm = coulomb.unwrap().parameters["coulomb_nm"].value;
    [coulomb_nm, joint.torque.unwrap().unit]
}

#[test]
fn masses_that_do_not_fit_one_torque_are_wrong_where_others_fit_theirs() {
    let report = told_of(&robot(), [1.0, 1.0, 0.2]);
    assert!(report.shared_effects.is_empty());
    let warned = report.data.iter().any(|finding| {
        finding.joint.as_deref() == Some("elbow")
            && finding.what.contains("as if its masses were 0.2")
    });
    assert!(warned, "{:?}", report.data);
    let [coulomb_nm, unit] = rubs(&report, 2);
    assert!((coulomb_nm - 0.4).abs() < 0.05, "{coulomb_nm}");
    assert!((unit - 1.0).abs() < 1e-12, "{unit}");
    assert!((rubs(&report, 1)[0] - 2.0).abs() < 0.1);
}

#[test]
fn torques_that_fit_no_joints_masses_are_in_another_unit() {
    let report = told_of(&robot(), [0.2; 3]);
    for joint in 0..JOINTS.len() {
        let [coulomb_nm, unit] = rubs(&report, joint);
        assert!((unit / 5.0 - 1.0).abs() < 0.05, "{unit}");
        assert!((coulomb_nm - 2.0).abs() < 0.1, "{coulomb_nm}");
    }
}

#[test]
fn a_reversed_torque_is_seen_by_its_inertia_where_nothing_rubs() {
    let report = told_when(&robot(), |_, torque_nm, velocity_rad_s| {
        2.0 * velocity_rad_s.signum() - torque_nm
    });
    for joint in &report.joints {
        assert!(joint.reason.contains("reversed"), "{}", joint.reason);
    }
}

#[test]
fn a_load_far_heavier_than_the_file_s_links_is_no_unit_of_the_torques_that_carry_it() {
    let report = told(vec![Effect::Payload {
        mass_kg: 12.0,
        centre_m: [0.0, 0.03, 0.25],
    }]);
    let shared = &report.shared_effects;
    assert_eq!(shared[0].effect.effect, "payload");
    let mass_kg = shared[0].effect.parameters["mass_kg"].value;
    assert!((mass_kg / 12.0 - 1.0).abs() < 0.1, "{mass_kg}");
    for joint in &report.joints {
        let unit = joint.torque.unwrap().unit;
        assert!((unit - 1.0).abs() < 1e-12, "{}: {unit}", joint.joint);
    }
}

/// The arm under stiffnesses of 20 and 30 Nm/rad, of which positions and a reference were recorded: that reaches its drive so many rows
/// later.
fn told_without_torques(late_rows: usize) -> Report {
    let stiffness_nm_rad = [20.0, 30.0, 20.0];
    let control = Control {
        rate_hz: RATE_HZ,
        kind: ControlKind::PdFeedforward,
        proportional_nm_rad: stiffness_nm_rad.to_vec(),
        derivative_nm_s_rad: vec![0.0; 3],
        feedback: Feedback::Link,
        feedforward: Feedforward::None,
        velocity_filter_hz: 0.0,
        velocity_filter_order: 1,
        delay_cycles: 0,
    };
    let file = Robot {
        control: Some(control),
        ..robot()
    };
    let mut recording = recorded(&robot(), |_, torque_nm, _| torque_nm);
    for (joint, stiffness_nm_rad) in recording.joints.iter_mut().zip(stiffness_nm_rad) {
        let torque_nm = joint.signals.remove(&Signal::MotorTorqueNm).unwrap();
        let position_rad = &joint.signals[&Signal::LinkPositionRad];
        let both = position_rad.iter().zip(&torque_nm);
        let mut reference_rad: Vec<f64> = both.map(|(q, nm)| q + nm / stiffness_nm_rad).collect();
        reference_rad.rotate_left(late_rows);
        joint
            .signals
            .insert(Signal::ReferencePositionRad, reference_rad);
    }
    let recordings = [("log".to_owned(), recording)];
    diagnose(&file, &recordings, &Options::default(), &|_| ())
        .unwrap()
        .report
}

#[test]
fn one_delay_of_all_references_is_a_warning_and_no_name() {
    let delays_ms = |report: &Report| -> Vec<f64> {
        let all = report.data.iter();
        let told = all.filter_map(|found| {
            found
                .what
                .strip_prefix("one delay of all references, about ")
        });
        told.map(|text| text.split(' ').next().unwrap().parse().unwrap())
            .collect()
    };
    assert!(delays_ms(&told_without_torques(0)).is_empty());
    let late = told_without_torques(15);
    let [delay_ms] = delays_ms(&late)[..] else {
        panic!("{:?}", late.data);
    };
    // to first order of a reference that jumps where friction turns round
    assert!((20.0..80.0).contains(&delay_ms), "{delay_ms}");
    assert!(late.shared_effects.is_empty());
}
