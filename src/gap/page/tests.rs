//! The page says what the report says, needs no network, and stands with the least a report may hold.

use gap_diagnosis::{Diagnosis, JointTraces};
use gap_report::{BeforeAfter, JointTorque, Remains, RemainsOver, Report, TorqueSource, Verdict};
use serde_json::json;

use super::page;

/// A report on the single test joint.
fn report(verdict: &str) -> Report {
    let effects = if verdict == "explained" {
        json!([{ "effect": "coulomb_friction", "probability": 0.96, "share": 0.96, "shrink_alone": 0.9,
                 "parameters": { "coulomb_nm": { "value": 0.8, "std": 0.05, "at_bound": false } } }])
    } else {
        json!([])
    };
    serde_json::from_value(json!({
        "schema": 2, "robot": "shd17", "recordings": ["<run>.mcap"], "samples": 45000, "seconds": 30.0,
        "sample_rate_hz": 1500.0, "twin": "closed_loop", "compute_seconds": 1.5, "shared_effects": [],
        "joints": [{
            "joint": "joint1", "verdict": verdict, "effects": effects,
            "candidates": [{ "effect": "coulomb_friction", "probability": 0.96 },
                           { "effect": "none", "probability": 0.04 }],
            "confusable": [{ "effects": ["coulomb_friction", "viscous_friction"], "distance": 3.0, "reason": "one speed" }],
            "where": { "stage": "transmission", "signals": [{ "signal": "motor_torque_nm", "gap_to_noise": 9.0 }],
                       "regimes": [{ "variable": "time_s", "from": 0.0, "to": 15.0, "share": 0.7 },
                                   { "variable": "time_s", "from": 15.0, "to": 30.0, "share": 0.3 }],
                       "bands": [{ "from_hz": 0.0, "to_hz": 4.0, "share": 1.0 }] },
            "gap": { "torque_rms_nm": { "before": 0.9, "after": 0.2, "noise_floor": 0.1, "held_out": true },
                     "position_rms_rad": { "before": 2e-3, "after": 4e-4, "noise_floor": 3e-4, "held_out": true },
                     "shrink": 0.96, "shrink_low": 0.9, "shrink_high": 0.98 },
            "remaining": "white"
        }]
    }))
    .unwrap()
}

fn html(verdict: &str, traces: Vec<JointTraces>) -> String {
    html_of(report(verdict), traces)
}

fn html_of(report: Report, traces: Vec<JointTraces>) -> String {
    let robot = robot::load("shd17").unwrap();
    page(&robot, &Diagnosis { report, traces }, None).to_html()
}

/// With a minor effect, and a rest over position and since the last reversal.
fn with_rest() -> Report {
    let mut report = report("explained");
    let joint = &mut report.joints[0];
    joint.verdict = Verdict::PartlyExplained;
    let mut minor = joint.effects[0].clone();
    minor.effect = "torque_offset".to_owned();
    minor.share = 0.01;
    joint.minor_effects.push(minor);
    joint.remaining_share = 0.2;
    joint.remaining_over = vec![
        RemainsOver {
            over: Remains::Position,
            share: 0.15,
            at: vec![-1.0, 0.0, 1.0],
            torque_nm: vec![0.2, -0.1, 0.3],
        },
        RemainsOver {
            over: Remains::SinceReversal,
            share: 0.05,
            at: Vec::new(),
            torque_nm: Vec::new(),
        },
    ];
    report
}

fn traces() -> Vec<JointTraces> {
    let time_s: Vec<f64> = (0..900).map(|k| f64::from(k) / 30.0).collect();
    let measured_nm: Vec<f64> = time_s.iter().map(|t| (2.0 * t).sin().signum()).collect();
    vec![JointTraces {
        joint: "joint1".to_owned(),
        nominal_nm: vec![0.0; time_s.len()],
        augmented_nm: measured_nm.iter().map(|nm| 0.9 * nm).collect(),
        measured_nm,
        time_s,
        position_rad: Vec::new(),
        velocity_rad_s: Vec::new(),
    }]
}

#[test]
fn the_page_says_verdict_values_and_next_steps_without_network_or_script() {
    let html = html("explained", traces());
    for told in [
        "joint1 has a gap of 0.900 Nm rms: Coulomb friction 0.80 Nm takes 96 % of it",
        "0.7020 to 0.8980",
        "flexspline gap apply",
        "one speed",
        "robot file with the effects",
        "&lt;run&gt;.mcap",
    ] {
        assert!(html.contains(told), "{told}");
    }
    for foreign in ["<script", "http://", "https://", "NaN"] {
        assert!(
            !html.contains(foreign) || foreign == "http://" && html.contains("w3.org"),
            "{foreign}"
        );
    }
}

#[test]
fn a_joint_without_a_gap_or_without_traces_has_its_page_too() {
    assert!(html("no_gap", Vec::new()).contains("Simulation and robot agree"));
    assert!(
        html("unexplained", Vec::new())
            .contains("most likely Coulomb friction (0.96), not surely enough to be named")
    );
    let mut unknown = report("unexplained");
    unknown.joints[0].candidates.remove(0);
    assert!(html_of(unknown, Vec::new()).contains("no known effect accounts for"));
    assert!(html("insufficient_data", Vec::new()).contains("supports no statement"));
}

#[test]
fn the_largest_gap_of_an_arm_is_told_by_what_the_report_knows_of_it() {
    let told = |verdict: &str, candidate: &str| {
        let mut report = report(verdict);
        report.joints[0].effects.clear();
        report.joints[0].candidates[0].effect = candidate.to_owned();
        let mut other = report.joints[0].clone();
        other.joint = "joint2".to_owned();
        report.joints.push(other);
        super::words::sentence(&report)
    };
    for (verdict, candidate, expected) in [
        (
            "unexplained",
            "torque_offset",
            "most likely torque offset (0.96), not surely enough to be named; what is named",
        ),
        (
            "unexplained",
            "unknown",
            "for which no effect on the list accounts; what is named",
        ),
        (
            "explained",
            "payload",
            ", explained by what acts on several joints; what is named",
        ),
        (
            "partly_explained",
            "payload",
            ", partly explained by what acts on several joints; what is named",
        ),
    ] {
        let told = told(verdict, candidate);
        assert!(told.contains(expected), "{told}");
    }
}

#[test]
fn what_remains_is_drawn_over_what_it_depends_on_and_minor_effects_stand_apart() {
    let html = html_of(with_rest(), Vec::new());
    for told in [
        "what remains depends on position.",
        "position (15 %), the time since the last reversal (5.0 %)",
        "torque that remains, Nm",
        "Minor effects: too small",
        "gap apply --remaining",
        "share of the gap",
    ] {
        assert!(html.contains(told), "{told}");
    }
    assert!(!html.contains("probability\">") && !html.contains("probability:"));
    // minor effects are in no headline and no stage
    let verdict = html.split("class=\"verdict\"").nth(1).unwrap();
    assert!(!verdict.split("</p>").next().unwrap().contains("offset"));
}

#[test]
fn a_size_that_nothing_was_found_of_has_no_panel() {
    let mut report = with_rest();
    assert!(html_of(report.clone(), Vec::new()).contains("position rms, mrad"));
    report.joints[0].gap.position_rms_rad = BeforeAfter::default();
    assert!(!html_of(report, Vec::new()).contains("position rms, mrad"));
}

#[test]
fn ranges_have_their_values_and_units() {
    let html = html("explained", Vec::new());
    assert!(html.contains("time, s") && html.contains("frequency, Hz"));
    assert!(!html.contains("range, low to high"));
}

#[test]
fn an_arm_is_told_in_one_sentence_and_a_line_a_joint_the_largest_first() {
    let mut report = report("explained");
    let mut second = report.joints[0].clone();
    second.joint = "joint2".to_owned();
    second.gap.torque_rms_nm.before = 4.0;
    second.torque = Some(JointTorque {
        source: TorqueSource::Drive,
        unit: 2.86,
        motor_per_recorded: 1.0,
    });
    report.joints.push(second);
    let robot = robot::load("pa10").unwrap();
    let traces = Vec::new();
    let html = page(&robot, &Diagnosis { report, traces }, None).to_html();
    assert!(html.contains("torque taken 2.86 times as recorded"));
    assert!(html.contains(
        "2 of 2 joints have a gap, the largest joint2 with 4.00 Nm rms, of which Coulomb friction 0.80 Nm is 96 %"
    ));
    let table = html.split("Every joint").nth(1).unwrap();
    assert!(table.find("joint2").unwrap() < table.find("joint1").unwrap());
}
