//! Parameters found, held against the true ones.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use gap_report::{Parameter, Report};
use robot::Effect;
use serde::Serialize;

use crate::label::TrueEffect;
use crate::score::rate::Z95;

/// One parameter of an effect that was named rightly.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterError {
    /// The effect's.
    pub effect: String,
    /// The parameter's name.
    pub parameter: String,
    /// The true value.
    pub truth: f64,
    /// What was found.
    pub found: f64,
    /// Its standard deviation.
    pub std: f64,
    /// Error over the true value; none for phases and cycles, where it means nothing. A gain counts from 1.
    pub relative: Option<f64>,
    /// Whether the true value lies within 1.96 standard deviations.
    pub covered: bool,
}

/// Of the effect that carries the true name, at the true joint. A value on its bound is a finding and no estimate.
pub(super) fn parameter_errors(truth: &TrueEffect, report: &Report) -> Vec<ParameterError> {
    let Some(found) = parameters(truth, report) else {
        return Vec::new();
    };
    let mut errors = Vec::new();
    for (name, value) in numbers(&truth.effect) {
        let Some(parameter) = found.get(&name) else {
            continue;
        };
        let number = parameter.value;
        if parameter.at_bound {
            continue;
        }
        let turns = name.starts_with("phase_rad");
        let error = if turns {
            let turned = (number - value).rem_euclid(TAU);
            turned.min(TAU - turned)
        } else {
            (number - value).abs()
        };
        let zero = if name == "gain" { 1.0 } else { 0.0 };
        let relative = !turns && !name.starts_with("cycles") && value != zero;
        errors.push(ParameterError {
            effect: truth.effect.name().to_owned(),
            relative: relative.then(|| error / (value - zero).abs()),
            covered: error <= Z95 * parameter.std,
            parameter: name,
            truth: value,
            found: number,
            std: parameter.std,
        });
    }
    errors
}

fn parameters<'a>(
    truth: &TrueEffect,
    report: &'a Report,
) -> Option<&'a BTreeMap<String, Parameter>> {
    let name = truth.effect.name();
    let shared = report
        .shared_effects
        .iter()
        .map(|shared| &shared.effect)
        .find(|found| found.effect == name);
    let own = report
        .joints
        .iter()
        .filter(|joint| truth.joint.as_ref().is_none_or(|on| *on == joint.joint))
        .flat_map(|joint| &joint.effects)
        .find(|found| found.effect == name);
    own.map(|found| &found.parameters)
        .or(shared.map(|found| &found.parameters))
}

/// The effect's numbers by name; those of a point as `NAME_x`, `NAME_y`, `NAME_z`.
fn numbers(effect: &Effect) -> Vec<(String, f64)> {
    let Ok(serde_json::Value::Object(fields)) = serde_json::to_value(effect) else {
        return Vec::new();
    };
    let mut numbers = Vec::new();
    for (name, value) in fields {
        match value {
            serde_json::Value::Array(point) => {
                let coordinates = point.iter().filter_map(serde_json::Value::as_f64);
                let named = coordinates.zip(["x", "y", "z"]);
                numbers.extend(named.map(|(value, axis)| (format!("{name}_{axis}"), value)));
            }
            value => numbers.extend(value.as_f64().map(|value| (name, value))),
        }
    }
    numbers
}
