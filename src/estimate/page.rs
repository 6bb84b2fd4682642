//! The page of a comparison: SD Figs. 8 and 10 redrawn from one's own recordings.

use estimators::Kind;
use report::{Axis, Column, Figure, Page, Panel, Section, Series, Table};

use super::compare::{Compared, JointCompared};
use super::table::{COLUMNS, row};

/// The whole page.
pub fn page(compared: &Compared) -> Page {
    let mut page = Page::new(
        format!("Torque estimators of {}", compared.robot),
        verdict(compared),
    );
    for (place, joint) in compared.joints.iter().enumerate() {
        page = page.section(section(place, joint));
    }
    page
}

/// The best in motion, recording by recording.
fn verdict(compared: &Compared) -> String {
    let best = |joint: &JointCompared| {
        let dynamic = joint.estimators.iter().filter_map(|measured| {
            let errors = measured.score.dynamic.as_ref()?;
            Some((measured.score.kind, errors.rms_nm))
        });
        let (kind, rms_nm) = dynamic.min_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(format!(
            "{}: smallest error in motion by {}, {rms_nm:.3} Nm rms",
            joint.joint,
            kind.name()
        ))
    };
    let told: Vec<String> = compared.joints.iter().filter_map(best).collect();
    if told.is_empty() {
        return "No estimator had its signals.".to_owned();
    }
    format!("{}.", told.join("; "))
}

fn section(place: usize, joint: &JointCompared) -> Section {
    let mut table = Table::new(
        "Errors against the torque sensor",
        COLUMNS
            .iter()
            .enumerate()
            .map(|(place, title)| match place {
                0 => Column::text(*title),
                _ => Column::number(*title),
            }),
    );
    for measured in &joint.estimators {
        table.row(row(measured).map(Into::into));
    }
    table.note(format!(
        "{} rows in which the joint moved, {} in which it stood for a quarter of a second at least. Reversals: within 50 ms of \
         one. Noise: sample to sample at rest. Drift: over the longest hold. Cost: of one sample of one joint on this machine.",
        joint.dynamic_rows, joint.static_rows
    ));
    Section::new(
        format!("comparison-{place}"),
        format!("{}, {}", joint.joint, joint.recording.display()),
    )
    .table(table)
    .figure(figure(
        joint,
        &Kind::PUBLISHED[..2],
        "as SD Figs. 8 and 10: structural damping and compliance",
    ))
    .figure(figure(
        joint,
        &Kind::PUBLISHED[2..],
        "the other published estimators",
    ))
    .figure(figure(
        joint,
        &[Kind::Fusion, Kind::Residual],
        "torsion, rate and momentum together, and motor torque less the model's friction",
    ))
}

/// Torque above, error below.
fn figure(joint: &JointCompared, kinds: &[Kind], what: &str) -> Figure {
    let traces = &joint.traces;
    let time = Axis::new("time", "s");
    let over_time = |values: &[f64]| -> Vec<[f64; 2]> {
        let pairs = traces.time_s.iter().zip(values);
        pairs.map(|(time_s, value)| [*time_s, *value]).collect()
    };
    let mut torques = Panel::new(time.clone(), Axis::new("joint torque", "Nm")).series(
        Series::line("torque sensor", over_time(&traces.reference_nm)),
    );
    let mut errors = Panel::new(time, Axis::new("estimate minus sensor", "Nm"));
    for (kind, values) in traces
        .torques_nm
        .iter()
        .filter(|(kind, _)| kinds.contains(kind))
    {
        let error: Vec<f64> = values
            .iter()
            .zip(&traces.reference_nm)
            .map(|(value, reference)| value - reference)
            .collect();
        torques = torques.series(Series::line(kind.name(), over_time(values)));
        errors = errors.series(Series::line(kind.name(), over_time(&error)));
    }
    if kinds.contains(&Kind::Fusion) && !traces.fusion_std_nm.is_empty() {
        for (name, sign) in [("95 % interval of fusion", 1.96), ("", -1.96)] {
            let bound: Vec<f64> = traces.fusion_std_nm.iter().map(|std| sign * std).collect();
            errors = errors.series(Series::line(name, over_time(&bound)));
        }
    }
    Figure::new(format!("Estimated torque and its error over time: {what}."))
        .panel(torques)
        .panel(errors)
        .panel_height(240)
}
