//! The estimators' errors on the second data set, joint beside joint.

use estimators::compare::Errors;

use crate::estimate::compare::{JointCompared, Measured};
use crate::reproduce::sheet::{Sheet, mean_and_range};

/// A column: its title and where its number is.
type Quantity = (&'static str, fn(&Measured) -> Option<f64>);

const MOVING: [Quantity; 6] = [
    ("average, Nm", |found| {
        moving(found, |errors| errors.average_nm)
    }),
    ("rms", |found| moving(found, |errors| errors.rms_nm)),
    ("largest", |found| moving(found, |errors| errors.max_nm)),
    ("95 %", |found| moving(found, |errors| errors.p95_nm)),
    ("largest at reversals", |found| {
        found.score.reversals.map(|errors| errors.max_nm)
    }),
    ("late, ms", |found| found.score.delay_ms),
];
const STANDING: [Quantity; 6] = [
    ("rms, Nm", |found| standing(found, |errors| errors.rms_nm)),
    ("largest", |found| standing(found, |errors| errors.max_nm)),
    ("noise", |found| found.score.noise_nm),
    ("drift over the held minute", |found| {
        found.score.drift.map(|drift| drift.change_nm)
    }),
    (
        "moving or not: within 1.96 standard deviations, %",
        |found| found.score.coverage_95.map(|share| 100.0 * share),
    ),
    ("one estimate, ns", |found| Some(found.cost_ns)),
];

fn moving(found: &Measured, of: fn(&Errors) -> f64) -> Option<f64> {
    found.score.dynamic.as_ref().map(of)
}

fn standing(found: &Measured, of: fn(&Errors) -> f64) -> Option<f64> {
    found.score.static_load.as_ref().map(of)
}

/// In motion, and standing.
pub fn sheets(joints: &[JointCompared]) -> Vec<Sheet> {
    vec![
        sheet("Errors against the torque sensor, moving", joints, &MOVING),
        sheet(
            "Errors against the torque sensor, standing",
            joints,
            &STANDING,
        ),
    ]
}

fn sheet(title: &str, joints: &[JointCompared], quantities: &[Quantity]) -> Sheet {
    let titles = quantities.iter().map(|(title, _)| *title);
    let mut sheet = Sheet::new(title, ["estimator"].into_iter().chain(titles));
    let first = joints.first().map_or(&[][..], |joint| &joint.estimators);
    for kind in first.iter().map(|found| found.score.kind) {
        let found: Vec<&Measured> = joints
            .iter()
            .filter_map(|joint| {
                joint
                    .estimators
                    .iter()
                    .find(|found| found.score.kind == kind)
            })
            .collect();
        let cells = quantities.iter().map(|(_, of)| {
            let values: Vec<f64> = found.iter().copied().filter_map(of).collect();
            mean_and_range(&values, 3)
        });
        sheet
            .rows
            .push([kind.name().to_owned()].into_iter().chain(cells).collect());
    }
    sheet
}
