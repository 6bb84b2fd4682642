//! Links that weigh other than the robot file says are told as what they are, and leave each joint its friction.

#![allow(clippy::unwrap_used, reason = "a test may")]

use std::collections::BTreeMap;
use std::path::PathBuf;

use gap_diagnosis::{Options, diagnose};
use gap_report::{DataFinding, Report};
use joint_model::rigid_body::Chain;
use recording::{JointColumns, Recording, Signal};
use robot::{Robot, RobotFile, Source};

const RATE_HZ: f64 = 200.0;
const AXES: [&str; 5] = ["z", "y", "y", "x", "y"];
/// By the file: kilograms, and metres along the link's z.
const FILE: [(f64, f64); 5] = [(8.0, 0.1), (6.0, 0.2), (4.0, 0.15), (2.0, 0.1), (1.0, 0.05)];
/// Beside a viscous friction of a fifth of it, Nm.
const COULOMB_NM: [f64; 5] = [6.0, 7.0, 4.0, 2.0, 1.0];

fn robot(links: [(f64, f64); 5]) -> Robot {
    let mut text = "name = \"arm\"\n".to_owned();
    for (joint, (mass, centre)) in links.iter().enumerate() {
        let axis = ["x", "y", "z"].map(|axis| f64::from(u8::from(AXES[joint] == axis)));
        let inertia = 0.01 * mass;
        text += &format!(
            "[[link]]\njoint = \"j{joint}\"\norigin_m = [0.0, 0.0, 0.3]\naxis = {axis:?}\nmass_kg = {mass}\n\
             centre_of_mass_m = [0.0, 0.01, {centre}]\n\
             inertia_kg_m2 = {{ xx = {inertia}, yy = {inertia}, zz = {inertia} }}\n[[joint]]\nname = \"j{joint}\"\n"
        );
    }
    let file = RobotFile::parse(&text, "arm.toml").unwrap();
    file.build(Source::File(PathBuf::from("arm.toml"))).unwrap()
}

/// Along sines, with noise of 2 % of the friction.
fn recorded(real: &Robot) -> Recording {
    let chain = real.loaded_chain().unwrap();
    let rows = (30.0 * RATE_HZ) as usize;
    let time_s: Vec<f64> = (0..rows).map(|k| k as f64 / RATE_HZ).collect();
    let mut columns = vec![[Vec::new(), Vec::new()]; AXES.len()];
    let mut seed = 5_u64;
    for t in &time_s {
        let mut motion = [[0.0; 5]; 3];
        let [position, velocity, acceleration] = &mut motion;
        let joints = position.iter_mut().zip(velocity).zip(acceleration);
        for (joint, ((position, velocity), acceleration)) in joints.enumerate() {
            let joint = joint as f64;
            for (size, rate) in [(0.7, 0.7 + 0.13 * joint), (0.25, 2.3 - 0.11 * joint)] {
                let phase: f64 = rate * t + 1.7 * joint;
                *position += size * phase.sin();
                *velocity += size * rate * phase.cos();
                *acceleration -= size * rate * rate * phase.sin();
            }
        }
        let mut torque_nm = [0.0; 5];
        chain.inverse_dynamics(&motion[0], &motion[1], &motion[2], &mut torque_nm);
        for (joint, [position, torque]) in columns.iter_mut().enumerate() {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let noise = (seed >> 33) as f64 / f64::from(1_u32 << 30) - 1.0;
            let velocity = motion[1][joint];
            position.push(motion[0][joint]);
            let friction_nm = velocity.signum() + 0.2 * velocity + 0.02 * noise;
            torque.push(torque_nm[joint] + COULOMB_NM[joint] * friction_nm);
        }
    }
    let joints = columns
        .into_iter()
        .enumerate()
        .map(|(joint, [position, torque])| JointColumns {
            name: format!("j{joint}"),
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

fn told(real: [(f64, f64); 5]) -> Report {
    let recordings = [("log".to_owned(), recorded(&robot(real)))];
    let told = diagnose(&robot(FILE), &recordings, &Options::default(), &|_| ());
    told.unwrap().report
}

fn has_its_friction(report: &Report) {
    for (joint, coulomb_nm) in report.joints.iter().zip(COULOMB_NM) {
        let mut effects = joint.effects.iter();
        let found = effects.find(|effect| effect.effect == "coulomb_friction");
        let value = found.unwrap().parameters["coulomb_nm"].value;
        assert!(
            (value / coulomb_nm - 1.0).abs() < 0.05,
            "{}: {value}",
            joint.joint
        );
    }
}

#[test]
fn links_that_weigh_other_than_the_file_says_are_told_and_friction_is_as_it_is() {
    let real = [
        (8.0, 0.1),
        (7.8, 0.25),
        (2.8, 0.2),
        (2.7, 0.07),
        (1.0, 0.05),
    ];
    let report = told(real);
    has_its_friction(&report);
    assert!(
        report.shared_effects.is_empty(),
        "{:?}",
        report.shared_effects
    );
    assert!(gravity_is_off(real, &mended(&report)) < 0.03);
    let weighs = report.joints[1]
        .effects
        .iter()
        .find(|effect| effect.of_links);
    assert_eq!(weighs.unwrap().effect, "gravity_torque");
    let is_told = |finding: &DataFinding| finding.what.starts_with("links weigh other");
    assert!(report.data.iter().any(is_told), "{:?}", report.data);
}

#[test]
fn links_within_their_tolerance_are_no_finding_and_what_all_joints_say_of_them_is_written() {
    let real = FILE.map(|(mass, centre)| (1.02 * mass, 1.02 * centre));
    let report = told(real);
    has_its_friction(&report);
    let is_told = |finding: &DataFinding| finding.what.starts_with("links weigh other");
    assert!(!report.data.iter().any(is_told), "{:?}", report.data);
    let mut all = report.joints.iter().flat_map(|joint| &joint.effects);
    assert!(!all.any(|effect| effect.of_links), "{:?}", report.joints);
    let [before, after] =
        [robot(FILE).chain, mended(&report)].map(|chain| gravity_is_off(real, &chain));
    assert!(after < 0.25 * before, "{after} of {before}");
}

/// The file's arm with the report's links.
fn mended(report: &Report) -> Chain {
    let file = robot(FILE).chain;
    let mut links = file.links().to_vec();
    for (link, change) in links.iter_mut().zip(&report.links) {
        link.mass_kg += change.mass_kg.value;
        for axis in 0..3 {
            link.centre_of_mass_m[axis] += change.centre_of_mass_m[axis].value;
        }
    }
    Chain::new(&links, file.gravity_m_s2(), file.tool()).unwrap()
}

/// By which part what two joints carry in two poses is off at most.
fn gravity_is_off(real: [(f64, f64); 5], found: &Chain) -> f64 {
    let real = robot(real).chain;
    let poses = [[0.0, 0.6, 0.3, -0.4, 0.5], [0.3, -0.5, 0.9, 0.2, -0.7]];
    let off = poses.into_iter().flat_map(|pose| {
        let [mut needed_nm, mut found_nm] = [[0.0; 5]; 2];
        real.gravity_torque(&pose, &mut needed_nm);
        found.gravity_torque(&pose, &mut found_nm);
        [1, 2].map(|joint| (found_nm[joint] / needed_nm[joint] - 1.0).abs())
    });
    off.fold(0.0, f64::max)
}
