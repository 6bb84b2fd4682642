//! No text makes the readers panic, and every refusal is one line.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;
use std::sync::LazyLock;

use proptest::prelude::*;
use robot::{
    Effect, Robot, RobotFile, Simulator, SimulatorFile, Source, load, load_drive_faults,
    load_pushes, parse_injection,
};
use tempfile::TempDir;

const ROBOT: &str = include_str!("../../robots/shd17.toml");
const INJECTION: &str = "[[effect]]\njoint = \"joint1\"\neffect = \"backlash\"\ngap_rad = 0.01\nstart_s = 5\n\
                         [[push]]\njoint = \"joint1\"\ntorque_nm = 2\nstart_s = 1\nduration_s = 0.5\n";
const URDF: &str = r#"<robot name="arm"><link name="base"/><link name="upper"><inertial><origin xyz="0 0 0.1"/>
<mass value="1"/><inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial></link><link name="tip"/>
<joint name="q1" type="revolute"><origin xyz="0.1 0 0"/><parent link="base"/><child link="upper"/><axis xyz="0 2 0"/>
<limit lower="-1" upper="1" effort="10" velocity="2"/></joint>
<joint name="end" type="fixed"><parent link="upper"/><child link="tip"/></joint></robot>"#;
const URDF_ROBOT: &str = "name = \"arm\"\nurdf = \"arm.urdf\"\n[[joint]]\nname = \"q1\"\ngear_ratio = 50.0\nrotor_inertia_kg_m2 = 1e-5\n";
const MJCF: &str = r#"<mujoco model="arm"><compiler angle="radian" eulerseq="zyx" boundinertia="1e-6"/><option gravity="0 0 -9.8"/>
<default><joint damping="0.5"/><default class="x"><geom type="capsule" size="0.1 0.2"/></default></default>
<worldbody><body name="l1" pos="0 0 1" euler="0.1 0.2 0.3"><joint name="a" axis="0 1 0" range="-2 2" ref="0.1"/>
<inertial pos="0 0 -0.25" mass="2" fullinertia="0.02 0.02 0.01 0 0 0"/><body childclass="x" zaxis="0 1 0"><joint name="b" type="slide"/>
<geom fromto="0 0 0 0 0 1"/><geom type="box" size="0.1 0.1 0.1" density="10"/></body></body></worldbody>
<equality><joint joint1="b" joint2="a" polycoef="0 0.5"/></equality>
<actuator><position joint="a" kp="3" kv="1" forcerange="-6 6"/><general joint="b" gainprm="2" biastype="affine" biasprm="0 -2 -1"/></actuator></mujoco>"#;
static SHD17: LazyLock<Robot> = LazyLock::new(|| load("shd17").expect("shipped"));

/// One of each way in which a model is changed.
const EFFECTS: [(Option<usize>, Effect); 9] = [
    (Some(0), Effect::CoulombFriction { coulomb_nm: 1.0 }),
    (Some(0), Effect::TorqueOffset { offset_nm: -0.5 }),
    (
        Some(0),
        Effect::RotorInertia {
            inertia_kg_m2: 0.01,
        },
    ),
    (
        Some(0),
        Effect::LinkInertia {
            inertia_kg_m2: 0.01,
        },
    ),
    (Some(0), Effect::TorqueConstantError { gain: 0.9 }),
    (Some(0), Effect::TorqueSaturation { limit_nm: 3.0 }),
    (
        Some(0),
        Effect::CurrentLoopLag {
            time_constant_s: 0.01,
        },
    ),
    (None, Effect::CommandDelay { delay_s: 0.01 }),
    (
        None,
        Effect::Payload {
            mass_kg: 0.5,
            centre_m: [0.0, 0.1, 0.2],
        },
    ),
];

/// The text with some stretches removed, doubled or overwritten.
fn mangle(text: &str, wounds: &[(prop::sample::Index, usize, String)]) -> String {
    let mut chars: Vec<char> = text.chars().collect();
    for (at, length, insert) in wounds {
        let start = at.index(chars.len() + 1);
        let end = (start + length).min(chars.len());
        chars.splice(start..end, insert.chars());
    }
    chars.into_iter().collect()
}

fn wounds() -> impl Strategy<Value = Vec<(prop::sample::Index, usize, String)>> {
    let scrap = prop_oneof![
        Just(String::new()),
        Just("nan".to_owned()),
        Just("-1e400".to_owned()),
        Just("[[joint]]\n".to_owned()),
        Just("\"".to_owned()),
        Just("}, {".to_owned()),
        "[-0-9.eE\\[\\]{}=\"'`\\\\\n a-z_ä😀]{0,12}",
    ];
    prop::collection::vec((any::<prop::sample::Index>(), 0usize..30, scrap), 1..6)
}

/// A folder to read files from, written again for each input.
fn folder() -> &'static Path {
    static FOLDER: LazyLock<TempDir> = LazyLock::new(|| TempDir::new().expect("a folder"));
    FOLDER.path()
}

proptest! {
    #[test]
    fn mangled_bodies(wounds in wounds()) {
        let path = folder().join("arm.toml");
        std::fs::write(folder().join("arm.urdf"), mangle(URDF, &wounds)).unwrap();
        std::fs::write(&path, URDF_ROBOT).unwrap();
        if let Err(error) = load(path.to_str().unwrap()) {
            prop_assert!(!error.to_string().contains('\n'), "{error}");
        }
    }

    #[test]
    fn mangled_models(wounds in wounds()) {
        for (name, text) in [("own.urdf", URDF), ("own.xml", MJCF)] {
            let path = folder().join(name);
            std::fs::write(&path, mangle(text, &wounds)).unwrap();
            if let Err(error) = load(path.to_str().unwrap()) {
                prop_assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }

    #[test]
    fn what_is_read_can_be_written_and_given_effects(wounds in wounds()) {
        for (name, text) in [("said.urdf", URDF), ("said.xml", MJCF)] {
            let path = folder().join(name);
            std::fs::write(&path, mangle(text, &wounds)).unwrap();
            let path = path.to_str().unwrap();
            let Ok(robot) = load(path) else { continue };
            for (out, written) in [("out.urdf", robot.to_urdf()), ("out.xml", robot.to_mjcf()), ("out.toml", robot.to_robot_file().unwrap())] {
                let out = folder().join(out);
                std::fs::write(&out, &written.text).unwrap();
                let read = load(out.to_str().unwrap());
                prop_assert!(read.is_ok(), "{}\n{}", read.unwrap_err(), written.text);
            }
            for simulator in [Simulator::Mjcf, Simulator::Urdf, Simulator::IsaacLab] {
                let out = folder().join("effects");
                let mut file = SimulatorFile::of(&robot, path, simulator, &out).unwrap();
                for (joint, effect) in EFFECTS {
                    file.add(joint, &effect);
                }
                let text = file.text().unwrap();
                std::fs::write(&out, &text).unwrap();
                if simulator != Simulator::IsaacLab {
                    let read = load(out.to_str().unwrap());
                    prop_assert!(read.is_ok(), "{}\n{text}", read.unwrap_err());
                }
            }
        }
    }

    #[test]
    fn mangled_pushes(wounds in wounds()) {
        let path = folder().join("push.toml");
        std::fs::write(&path, mangle(INJECTION, &wounds)).unwrap();
        if let Err(error) = load_drive_faults(&path, &SHD17) {
            assert_eq!(error.to_string().lines().count(), 1, "{error}");
        }
        if let Err(error) = load_pushes(&path, &SHD17) {
            prop_assert!(!error.to_string().contains('\n'), "{error}");
        }
    }

    #[test]
    fn mangled_robot_files(wounds in wounds()) {
        let text = mangle(ROBOT, &wounds);
        let robot = RobotFile::parse(&text, "x.toml").and_then(|file| file.build(Source::File("x.toml".into())));
        if let Err(error) = robot {
            prop_assert!(!error.to_string().contains('\n'), "{error}");
        }
    }

    #[test]
    fn mangled_injection_files(wounds in wounds()) {
        if let Err(error) = parse_injection(&mangle(INJECTION, &wounds), "x.toml", &SHD17) {
            prop_assert!(!error.to_string().contains('\n'), "{error}");
        }
    }
}
