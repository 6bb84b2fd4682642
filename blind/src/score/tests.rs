//! A prediction that knows the truth scores fully; one that knows nothing does not; each wrong answer is counted where it
//! belongs.

use std::collections::BTreeMap;

use gap_report::Report;
use robot::Effect;
use serde_json::{Value, json};

use super::{Prediction, Scores, score};
use crate::label::{CaseKind, Label, TrueEffect, TrueUnlisted};
use crate::rig::RigKind;
use crate::unlisted::Unlisted;

fn label(case: &str, kind: CaseKind) -> Label {
    Label {
        case: case.to_owned(),
        kind,
        rig: RigKind::SevenJoints,
        level: if kind == CaseKind::NoGap { 0.0 } else { 3.0 },
        effects: Vec::new(),
        unlisted: None,
        pair: Vec::new(),
        noise_nm: Vec::new(),
        files: BTreeMap::new(),
    }
}

fn truth(joint: &str, effect: Effect, equivalents: &[&str]) -> TrueEffect {
    TrueEffect {
        joint: Some(joint.to_owned()),
        stage: effect.kind().stage(),
        effect,
        gap_to_noise: 3.0,
        equivalents: equivalents.iter().map(|name| (*name).to_owned()).collect(),
    }
}

fn coulomb() -> TrueEffect {
    truth("joint2", Effect::CoulombFriction { coulomb_nm: 2.0 }, &[])
}

fn labels() -> Vec<Label> {
    let delay = Effect::CommandDelay { delay_s: 0.002 };
    let offset = Effect::TorqueOffset { offset_nm: 1.0 };
    vec![
        label("none", CaseKind::NoGap),
        Label {
            effects: vec![coulomb()],
            ..label("one", CaseKind::OneEffect)
        },
        Label {
            effects: vec![truth("joint2", delay, &["sensor_delay"])],
            ..label("equivalent", CaseKind::OneEffect)
        },
        Label {
            effects: vec![coulomb(), truth("joint1", offset, &[])],
            ..label("two", CaseKind::TwoEffects)
        },
        Label {
            unlisted: Some(TrueUnlisted {
                joint: "joint2".to_owned(),
                law: Unlisted::Step {
                    at_s: 1.0,
                    sign: 1.0,
                },
                nm: 1.0,
                gap_to_noise: 3.0,
                in_common: BTreeMap::from([("coulomb_friction".to_owned(), 0.6)]),
            }),
            ..label("unknown", CaseKind::Unknown)
        },
        Label {
            effects: vec![truth("joint2", offset, &[])],
            pair: ["torque_offset", "asymmetric_friction"]
                .map(str::to_owned)
                .to_vec(),
            ..label("pair", CaseKind::Pair)
        },
    ]
}

/// A joint without a gap.
fn quiet(joint: &str) -> Value {
    json!({
        "joint": joint, "verdict": "no_gap", "effects": [],
        "candidates": [{ "effect": "none", "probability": 1.0 }], "confusable": [],
        "where": { "stage": null, "signals": [], "regimes": [], "bands": [] },
        "gap": {
            "torque_rms_nm": { "before": 0.1, "after": 0.1, "noise_floor": 0.1, "held_out": true },
            "position_rms_rad": { "before": 0.1, "after": 0.1, "noise_floor": 0.1, "held_out": true },
            "shrink": 0.0, "shrink_low": 0.0, "shrink_high": 0.0
        },
        "remaining": "white"
    })
}

/// A joint with a gap that is called by a name.
fn loud(joint: &str, verdict: &str, name: &str, parameters: Value, stage: &str) -> Value {
    let mut value = quiet(joint);
    value["verdict"] = json!(verdict);
    value["candidates"] = json!([
        { "effect": name, "probability": 0.9 },
        { "effect": "none", "probability": 0.1 }
    ]);
    if name != "unknown" {
        value["effects"] = json!([
            { "effect": name, "probability": 0.9, "parameters": parameters, "shrink_alone": 0.9 }
        ]);
    }
    value["where"]["stage"] = json!(stage);
    value["gap"]["torque_rms_nm"]["before"] = json!(1.0);
    value
}

fn report(joints: &[Value]) -> Report {
    serde_json::from_value(json!({
        "schema": 2, "robot": "r", "recordings": [], "samples": 1, "seconds": 1.0,
        "sample_rate_hz": 1500.0, "twin": "closed_loop", "compute_seconds": 1.0,
        "shared_effects": [], "joints": joints
    }))
    .unwrap()
}

fn number(value: f64, std: f64) -> Value {
    json!({ "value": value, "std": std, "at_bound": false })
}

fn omniscient() -> BTreeMap<String, Prediction> {
    let two = || quiet("joint1");
    let coulomb = loud(
        "joint2",
        "explained",
        "coulomb_friction",
        json!({ "coulomb_nm": number(2.1, 0.1) }),
        "transmission",
    );
    let offset = |joint| loud(joint, "explained", "torque_offset", json!({}), "actuator");
    let mut pair = offset("joint2");
    pair["verdict"] = json!("ambiguous");
    pair["confusable"] = json!([
        { "effects": ["asymmetric_friction", "torque_offset"], "distance": 1.0, "reason": "one direction" }
    ]);
    let delay = loud("joint2", "explained", "sensor_delay", json!({}), "timing");
    let unknown = loud(
        "joint2",
        "unexplained",
        "unknown",
        json!({}),
        "transmission",
    );
    [
        ("none", report(&[two(), quiet("joint2")])),
        ("one", report(&[two(), coulomb.clone()])),
        ("equivalent", report(&[two(), delay])),
        ("two", report(&[offset("joint1"), coulomb])),
        ("unknown", report(&[two(), unknown])),
        ("pair", report(&[two(), pair])),
    ]
    .map(|(case, report)| (case.to_owned(), Ok(report)))
    .into()
}

#[test]
fn an_oracle_that_makes_a_gap_larger_counts_as_one_that_names_nothing() {
    let mut predictions = omniscient();
    for report in predictions.values_mut().flatten() {
        for joint in &mut report.joints {
            joint.gap.shrink = 0.9;
        }
    }
    let over = |oracle: &[(&str, f64)]| {
        let oracle = oracle
            .iter()
            .map(|(case, shrink)| ((*case).to_owned(), *shrink));
        let scores = score(&labels(), &predictions, &oracle.collect());
        scores.all.shrink_over_oracle
    };
    assert!((over(&[("one", 0.9)]).unwrap() - 1.0).abs() < 1e-12);
    let beside_a_bad_one = over(&[("one", 0.9), ("equivalent", -1e9)]).unwrap();
    assert!((beside_a_bad_one - 2.0).abs() < 1e-12, "{beside_a_bad_one}");
    assert_eq!(over(&[("one", -1.0)]), None);
}

fn scores_with(changes: &[(&str, Report)]) -> Scores {
    let mut predictions = omniscient();
    for (case, report) in changes {
        predictions.insert((*case).to_owned(), Ok(report.clone()));
    }
    score(&labels(), &predictions, &BTreeMap::new())
}

#[test]
fn who_knows_everything_misses_nothing() {
    let scores = scores_with(&[]);
    assert!(scores.misses.is_empty(), "{:?}", scores.misses);
    let all = &scores.all;
    for (rate, hits) in [
        (all.top_1, 2),
        (all.top_3, 2),
        (all.in_set, 2),
        (all.joint, 2),
        (all.stage, 2),
        (all.unknown_recognised, 1),
        (all.not_separable, 1),
        (all.coverage, 1),
    ] {
        assert_eq!((rate.hits, rate.of), (hits, hits));
    }
    assert_eq!((all.false_alarms.hits, all.called_unknown.hits), (0, 0));
    assert_eq!((all.false_alarms.of, all.called_unknown.of), (1, 3));
    assert_eq!(all.two_effects_f1.unwrap().value, 1.0);
    assert_eq!(all.set_size, Some(1.0));
    assert!((all.parameter_error.unwrap() - 0.05).abs() < 1e-9);
}

#[test]
fn a_wrong_name_is_wrong_and_confused_with_the_right_one() {
    let viscous = loud(
        "joint2",
        "explained",
        "viscous_friction",
        json!({}),
        "transmission",
    );
    let scores = scores_with(&[("one", report(&[quiet("joint1"), viscous]))]);
    assert_eq!((scores.all.top_1.hits, scores.all.stage.hits), (1, 2));
    let confused = scores
        .confusion
        .iter()
        .find(|one| one.called == "viscous_friction");
    assert_eq!(
        confused.map(|one| one.truth.as_str()),
        Some("coulomb_friction")
    );
    assert_eq!(scores.misses.len(), 1);
}

#[test]
fn a_wrong_joint_an_alarm_and_a_name_for_the_unknown_are_each_counted() {
    let other = loud(
        "joint1",
        "explained",
        "coulomb_friction",
        json!({}),
        "transmission",
    );
    let wrong = report(&[other.clone(), quiet("joint2")]);
    let scores = scores_with(&[
        ("one", wrong.clone()),
        ("none", wrong),
        (
            "unknown",
            report(&[quiet("joint1"), taking("coulomb_friction", 0.9)]),
        ),
    ]);
    let all = &scores.all;
    assert_eq!((all.joint.hits, all.false_alarms.hits), (1, 1));
    assert_eq!((all.unknown_recognised.hits, scores.misses.len()), (0, 3));
}

/// The second joint, partly explained by a name that takes a share.
fn taking(name: &str, share: f64) -> Value {
    let mut joint = loud(
        "joint2",
        "partly_explained",
        name,
        json!({}),
        "transmission",
    );
    joint["effects"][0]["share"] = json!(share);
    joint["remaining_share"] = json!(1.0 - share);
    joint
}

#[test]
fn a_name_may_take_of_a_law_on_no_list_what_it_has_in_common_with_it() {
    let hits = |name: &str, share: f64| {
        let report = report(&[quiet("joint1"), taking(name, share)]);
        scores_with(&[("unknown", report)])
            .all
            .unknown_recognised
            .hits
    };
    assert_eq!(hits("coulomb_friction", 0.65), 1);
    assert_eq!(hits("coulomb_friction", 0.75), 0);
    assert_eq!(hits("torque_ripple", 0.05), 1);
    assert_eq!(hits("torque_ripple", 0.65), 0);
}

#[test]
fn a_true_name_among_the_minor_effects_is_found() {
    let mut both = omniscient()["two"].clone().unwrap();
    let joint = &mut both.joints[0];
    joint.minor_effects.append(&mut joint.effects);
    let scores = scores_with(&[("two", both)]);
    assert_eq!(scores.all.two_effects_f1.unwrap().value, 1.0);
}

#[test]
fn a_name_left_out_costs_f1() {
    let mut only_one = omniscient()["two"].clone().unwrap();
    only_one.joints[0] = serde_json::from_value(quiet("joint1")).unwrap();
    let scores = scores_with(&[("two", only_one)]);
    // one right, none wrong, one left out
    assert!((scores.all.two_effects_f1.unwrap().value - 2.0 / 3.0).abs() < 1e-12);
}

#[test]
fn what_was_not_predicted_is_missed_but_no_alarm() {
    let scores = score(&labels(), &BTreeMap::new(), &BTreeMap::new());
    assert_eq!((scores.without_prediction, scores.all.top_1.hits), (6, 0));
    assert_eq!(scores.all.false_alarms.hits, 0);
    assert_eq!(scores.misses.len(), 5);
}
