//! A page made of fits to exact data: every part in its place, and what is missing said.

use std::f64::consts::TAU;

use identification::Estimate;
use identification::friction::{SteadyMeasurement, identify_friction};
use identification::gravity::{Combination, FittedLink, GravityFit, JointGravity, UnseenDirection};
use identification::periodic::{DirectionAnalysis, Harmonic, PeriodicAnalysis, SpectralLine};
use identification::stiffness::{DirectionFit, Knee, LoadTorqueFit, StiffnessFit, SweepSteps};

use super::super::HeldOut;
use super::*;
use identification::held_out::HeldOutError;

const REASON: &str = "joint `joint4`: gravity torque varies too little <here>";

fn estimate(value: f64) -> Estimate {
    Estimate {
        value,
        standard_error: 0.01 * value.abs(),
    }
}

fn friction(joint: &str) -> identification::friction::JointFriction {
    let speeds = [0.02, 0.04, 0.06, 0.08, 0.1, 0.2, 0.3, 0.4];
    let trials = speeds
        .iter()
        .flat_map(|speed| (0..5).map(move |trial| (*speed, trial)));
    let both = trials.flat_map(|(speed, trial)| [(speed, trial), (-speed, trial)]);
    let measurement = |(velocity_rad_s, trial): (f64, usize)| {
        let law_nm = 30.0 + 28.0 * velocity_rad_s.abs() + 1e-3 * trial as f64;
        SteadyMeasurement {
            velocity_rad_s,
            reference_rad_s: velocity_rad_s,
            friction_nm: law_nm * velocity_rad_s.signum(),
            std_nm: 1.0,
            trial,
            motor_revolutions: 1,
            load_nm: 0.0,
            duration_s: 3.0,
            recording: 0,
        }
    };
    identify_friction(joint, both.map(measurement).collect()).expect("exact data")
}

fn periodic(joint: &str) -> PeriodicAnalysis {
    let harmonic = Harmonic {
        amplitude_nm: 5.0,
        amplitude_standard_error_nm: 0.01,
        phase_rad: 3.1,
        phase_standard_error_rad: 0.01,
        cycles_per_motor_rev: 5.0,
        cycles_per_joint_rad: 5.0 * 50.0 / TAU,
        order: 5,
        order_deviation: 0.0,
        order_standard_error: 1e-3,
    };
    let line = |i: u32| SpectralLine {
        cycles_per_motor_rev: f64::from(i) / 8.0,
        amplitude_nm: if i == 40 { 5.0 } else { 1e-3 },
        threshold_nm: 2e-3,
    };
    let direction = |reference_rad_s| DirectionAnalysis {
        reference_rad_s,
        harmonics: vec![harmonic],
        mean_nm: 30.0,
        revolutions: 8,
        rms_nm: 3.5,
        residual_rms_nm: 0.02,
        mean_revolution_nm: (0..512)
            .map(|i| 5.0 * (TAU * 5.0 * f64::from(i) / 512.0).sin())
            .collect(),
        spectrum: (0..800).map(line).collect(),
    };
    PeriodicAnalysis {
        joint: joint.to_owned(),
        gear_ratio: 50.0,
        positive: direction(0.01),
        negative: direction(-0.01),
        combined: vec![harmonic],
    }
}

fn load(joint: &str) -> StiffnessFit {
    let position_rad: Vec<f64> = (-150..=150).map(|i| 0.01 * f64::from(i)).collect();
    let gravity_nm: Vec<f64> = position_rad
        .iter()
        .map(|angle| -20.0 * angle.sin())
        .collect();
    let steps = |payload_kg: f64| SweepSteps {
        payload_kg,
        position_rad: position_rad.clone(),
        total_nm: gravity_nm.iter().map(|nm| nm + 35.0).collect(),
        without_position_friction_nm: gravity_nm.iter().map(|nm| nm + 34.0).collect(),
        without_friction_nm: gravity_nm.clone(),
        gravity_nm: gravity_nm.clone(),
        load_torque_nm: gravity_nm.iter().map(|nm| 0.2 * nm).collect(),
        on_floor: vec![false; gravity_nm.len()],
    };
    let knee = |nm: f64| Knee {
        gravity_nm: estimate(nm),
        at_bound: nm > 0.0,
    };
    let law = LoadTorqueFit {
        slopes: [0.2, 5.0, 0.9].map(estimate).to_vec(),
        knees: [-15.0, 12.0].map(knee).to_vec(),
        zero_load_nm: estimate(2.5),
        zero_load_extrapolated: false,
        gravity_range_nm: [-20.0, 20.0],
        residual_rms_nm: 0.1,
        samples: 903,
        samples_on_floor: 0,
        correlated_samples: 3.0,
        candidates: Vec::new(),
    };
    let direction = |payloads_kg: &[f64]| DirectionFit {
        steps: payloads_kg.iter().map(|kg| steps(*kg)).collect(),
        law: law.clone(),
    };
    StiffnessFit {
        joint: joint.to_owned(),
        payloads_kg: vec![0.0, 2.3, 4.5],
        positive: direction(&[0.0, 2.3]),
        negative: direction(&[0.0]),
    }
}

fn gravity(joint: &str) -> GravityFit {
    let position_rad: Vec<f64> = (0..40).map(|i| -1.5 + 0.075 * f64::from(i)).collect();
    let torque_nm: Vec<f64> = position_rad
        .iter()
        .map(|angle| 20.0 * angle.sin())
        .collect();
    GravityFit {
        links: vec![FittedLink {
            joint: joint.to_owned(),
            mass_kg: estimate(2.18),
            centre_of_mass_m: [0.01, 0.0, 0.17].map(estimate),
            first_moment_kg_m: [0.02, 0.0, 0.4].map(estimate),
            file_mass_kg: 2.2,
            file_centre_of_mass_m: [0.0, 0.0, 0.18],
        }],
        identifiable: vec![Combination {
            words: "m·c_x of joint4 + 0.5·m of joint6".to_owned(),
            terms: Vec::new(),
            unit: "kg m",
            file_value: 2.5,
            fitted: estimate(2.4),
        }],
        unseen: vec![UnseenDirection {
            words: "m of joint1".to_owned(),
            terms: Vec::new(),
        }],
        joints: vec![JointGravity {
            joint: joint.to_owned(),
            file_rms_nm: 1.0,
            fitted_rms_nm: 0.1,
            held_out_file_rms_nm: 1.1,
            held_out_rms_nm: 0.123,
            position_rad,
            measured_nm: torque_nm.clone(),
            file_nm: torque_nm.iter().map(|nm| 1.1 * nm).collect(),
            fitted_nm: torque_nm,
        }],
    }
}

fn html(robot: &str, joints: Vec<JointResult>, gravity: Option<GravityFit>) -> String {
    let robot = robot::load(robot).expect("shipped");
    let identified = Identified {
        schema: 1,
        robot: robot.name.clone(),
        seed: 1,
        robot_file: "identified.toml".into(),
        joints,
        gravity,
        findings: Vec::new(),
    };
    page(&identified, &robot).to_html()
}

fn held_out(joint: &str, rms_nm: f64) -> HeldOutError {
    HeldOutError {
        joint: joint.to_owned(),
        rms_nm,
        mean_friction_nm: 30.0,
        share: rms_nm / 30.0,
        rows: 1000,
        speeds: Vec::new(),
    }
}

fn everything() -> JointResult {
    JointResult {
        joint: "joint4".to_owned(),
        friction: Some(friction("joint4")),
        periodic: Some(periodic("joint4")),
        stiffness: Some(load("joint4")),
        held_out: Some(HeldOut {
            file: held_out("joint4", 3.0),
            identified: held_out("joint4", 0.75),
        }),
        findings: Vec::new(),
    }
}

fn nothing() -> JointResult {
    JointResult {
        friction: None,
        periodic: None,
        stiffness: None,
        held_out: None,
        findings: vec![REASON.to_owned()],
        ..everything()
    }
}

const SECTIONS: [&str; 7] = [
    "overview",
    "friction",
    "periodic",
    "gravity",
    "load",
    "held-out",
    "residuals",
];

#[test]
fn every_table_and_figure_of_the_papers_has_its_place() {
    let html = html("pa10", vec![everything()], Some(gravity("joint4")));
    for id in SECTIONS.iter().chain(&["elbow"]) {
        assert!(html.contains(&format!(r#"<section id="{id}">"#)), "{id}");
    }
    for part in [
        "PA10-05, Table I)",
        "PA10-05, Table II)",
        "PA10-05, Table III)",
        "PA10-05, Table IV;",
        "PA10-05, Table V)",
        "PA10-05, Fig. 4;",
        "PA10-05, Fig. 5;",
        "PA10-05, Fig. 7(a);",
        "PA10-05, Fig. 7(b))",
        "PA10-03, Fig. 4)",
        "PA10-03, Fig. 5)",
        "PA10-03, Fig. 6)",
        "PA10-03, Fig. 7)",
    ] {
        assert!(html.contains(part), "{part}");
    }
    assert_eq!(html.matches("<figure>").count(), 7);
    assert!(!html.contains("not identified") && !html.contains("could not be drawn"));
}

#[test]
fn published_values_stand_beside_ours() {
    let html = html("pa10", vec![everything()], None);
    for printed in ["415.8925", "30.4416", "39.65", "5.08", "9.86 kg"] {
        let cell = format!(r#"<span class="published">{printed}</span>"#);
        assert!(html.contains(&cell), "{printed}");
    }
    // Table III's second harmonic is not in the data.
    assert!(html.contains("not found"));
}

#[test]
fn what_was_not_identified_is_said() {
    let html = html("pa10", vec![nothing()], None);
    assert!(html.contains("Nothing was identified."));
    for id in SECTIONS {
        assert!(html.contains(&format!(r#"<section id="{id}">"#)), "{id}");
    }
    for what in [
        "Friction over velocity was not identified for joint4",
        "Friction over position was not identified for joint4",
        "Torque over gravity load was not identified for joint4",
        "Masses and centres of mass were not identified",
        "They need the torque over gravity load, which was not identified",
        "varies too little &lt;here&gt;",
    ] {
        assert!(html.contains(what), "{what}");
    }
    assert!(!html.contains("<figure>"));
}

#[test]
fn a_joint_without_harmonics_keeps_its_row() {
    let mut joint = everything();
    if let Some(periodic) = &mut joint.periodic {
        periodic.combined.clear();
    }
    let html = html("shd17", vec![joint], None);
    assert!(html.contains("none above noise") && html.contains(">none</td>"));
}

#[test]
fn a_robot_without_a_paper_has_no_published_values() {
    let html = html("shd17", vec![everything()], None);
    assert!(!html.contains(r#"class="published""#) && !html.contains("ublished val"));
    assert!(!html.contains(r#"id="elbow""#));
}

#[test]
fn a_sweep_in_one_direction_leaves_a_panel_that_says_so() {
    let html = html("pa10", vec![everything()], None);
    assert!(html.contains("2.3 kg, negative direction: no steady motion"));
    assert!(html.contains("With 4.5 kg the joint did not move steadily"));
}

#[test]
fn the_page_opens_anywhere_and_is_the_same_each_time() {
    let make = || {
        html(
            "pa10",
            vec![everything(), nothing()],
            Some(gravity("joint4")),
        )
    };
    let page = make();
    for outside in ["http:", "https:", "src=", "url(", "<script", "<link", "NaN"] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert_eq!(page, make());
    assert!(page.len() < 1_000_000, "{} bytes", page.len());
}
