//! A planar arm whose friction the file tells: what a tilted base does to its joints is one cause of its true size, beside values that
//! are off within their tolerance.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::collections::BTreeMap;
use std::path::PathBuf;

use gap_diagnosis::{Engine, Options, diagnose};
use recording::{JointColumns, Recording, Signal};
use robot::{Robot, RobotFile, Source};

const RATE_HZ: f64 = 250.0;
const SECONDS: f64 = 20.0;
const JOINTS: [&str; 2] = ["shoulder", "elbow"];
const MASS_KG: [f64; 2] = [5.0, 2.5];
const COULOMB_NM: [f64; 2] = [3.0, 0.6];
const VISCOUS_NM_S_RAD: [f64; 2] = [1.2, 0.3];
/// Gravity at the base, m/s².
const UPRIGHT: [f64; 3] = [0.0, 0.0, -9.81];

fn robot(mass_kg: [f64; 2], gravity_m_s2: [f64; 3]) -> Robot {
    let mut text =
        format!("name = \"planar\"\ngravity_m_s2 = {gravity_m_s2:?}\nparameter_tolerance = 0.02\n");
    for (joint, name) in JOINTS.iter().enumerate() {
        text += &format!(
            "[[link]]\njoint = \"{name}\"\norigin_m = [0.0, 0.0, 0.35]\naxis = [0.0, 1.0, 0.0]\nmass_kg = {}\n\
             centre_of_mass_m = [0.0, 0.0, 0.22]\n\
             inertia_kg_m2 = {{ xx = 0.05, yy = 0.05, zz = 0.02, xy = 0.0, yz = 0.0, xz = 0.0 }}\n\
             [[joint]]\nname = \"{name}\"\nmotor_encoder_resolution_rad = 1e-5\ntorque_noise_nm = 0.012\neffects = [\n\
             {{ effect = \"coulomb_friction\", coulomb_nm = {} }},\n\
             {{ effect = \"viscous_friction\", viscous_nm_s_rad = {} }}]\n",
            mass_kg[joint], COULOMB_NM[joint], VISCOUS_NM_S_RAD[joint]
        );
    }
    let file = RobotFile::parse(&text, "planar.toml").unwrap();
    file.build(Source::File(PathBuf::from("planar.toml")))
        .unwrap()
}

/// Motion by sines, and the torque that the real arm needs for it with noise.
fn recorded(real: &Robot, rubs: f64) -> Recording {
    let waves = [[0.6, 1.3], [0.7, 1.9]];
    let rows = (SECONDS * RATE_HZ) as usize;
    let time_s: Vec<f64> = (0..rows).map(|k| k as f64 / RATE_HZ).collect();
    let mut columns = vec![[Vec::new(), Vec::new()]; JOINTS.len()];
    let mut seed = 5_u64;
    for t in &time_s {
        let mut motion = [[0.0; 2]; 3];
        for (joint, [size, rate]) in waves.into_iter().enumerate() {
            for (part, rate) in [(1.0, rate), (0.3, 2.7 * rate)] {
                let phase = rate * t + joint as f64;
                motion[0][joint] += part * size * phase.sin();
                motion[1][joint] += part * size * rate * phase.cos();
                motion[2][joint] -= part * size * rate * rate * phase.sin();
            }
        }
        let mut torque_nm = [0.0; 2];
        let [position, velocity, acceleration] = motion;
        real.chain
            .inverse_dynamics(&position, &velocity, &acceleration, &mut torque_nm);
        for (joint, column) in columns.iter_mut().enumerate() {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let noise = (seed >> 33) as f64 / f64::from(1_u32 << 30) - 1.0;
            let friction = COULOMB_NM[joint] * (velocity[joint] / 1e-3).tanh()
                + VISCOUS_NM_S_RAD[joint] * velocity[joint];
            column[0].push(position[joint]);
            column[1].push(torque_nm[joint] + rubs * friction + 0.02 * noise);
        }
    }
    let both = JOINTS.iter().zip(columns);
    let joints = both.map(|(name, [position, torque])| JointColumns {
        name: (*name).to_owned(),
        signals: BTreeMap::from([
            (Signal::MotorPositionRad, position),
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

#[test]
fn a_tilted_base_under_a_planar_arm_is_one_cause() {
    let pitch_rad: f64 = 0.1;
    let gravity_m_s2 = [9.81 * pitch_rad.sin(), 0.0, -9.81 * pitch_rad.cos()];
    // heavier by two standard deviations than the file says, so that a tilt weighs more too, and with less friction
    let real = robot(MASS_KG.map(|mass_kg| 1.04 * mass_kg), gravity_m_s2);
    let file = robot(MASS_KG, UPRIGHT);
    let recordings = [("log".to_owned(), recorded(&real, 0.96))];
    assert_eq!(Engine::for_robot(&file, &recordings), Engine::ClosedLoop);
    let report = diagnose(&file, &recordings, &Options::default(), &|_| ())
        .unwrap()
        .report;
    let shared = report.shared_effects.iter();
    let shared: Vec<&str> = shared.map(|s| s.effect.effect.as_str()).collect();
    assert_eq!(shared, ["base_tilt"]);
    let told = &report.shared_effects[0].effect.parameters;
    let pitch = &told["pitch_rad"];
    assert!(
        (pitch.value.abs() - pitch_rad).abs() < 3.0 * pitch.std,
        "{pitch:?}"
    );
    // nothing in the plane tells the roll, which is said to be as open as it was
    assert!(told["roll_rad"].value.abs() < 1e-3, "{told:?}");
    assert!(told["roll_rad"].std > 0.5, "{told:?}");
    for joint in &report.joints {
        let names: Vec<&str> = joint.effects.iter().map(|e| e.effect.as_str()).collect();
        assert!(names.is_empty(), "{}: {names:?}", joint.joint);
    }
}
