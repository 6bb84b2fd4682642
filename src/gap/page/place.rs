//! Where simulation and robot part: by stage, signal, regime and frequency.

use gap_diagnosis::report::{JointReport, Report};
use gap_diagnosis::stage::Stage;
use report::{Axis, Column, Figure, HeatMap, Panel, Section, Table, number};

use super::with_gap;

const STAGES: [(Stage, &str); 5] = [
    (Stage::Actuator, "actuator"),
    (Stage::Transmission, "transmission"),
    (Stage::RigidBody, "rigid body"),
    (Stage::Sensing, "sensing"),
    (Stage::Timing, "timing"),
];

/// Heat maps of all joints that have a gap.
pub fn section(report: &Report) -> Section {
    let joints: Vec<&JointReport> = with_gap(report).collect();
    let section = Section::new("where", "Where they part");
    if joints.is_empty() {
        return section.paragraph("No joint has a gap.");
    }
    let mut signals = Table::new(
        "Signals in which it shows",
        [
            Column::text("joint"),
            Column::text("signal"),
            Column::number("gap over noise"),
        ],
    );
    for joint in &joints {
        for signal in &joint.place.signals {
            signals.row([
                joint.joint.clone().into(),
                signal.signal.clone().into(),
                number(signal.gap_to_noise, 3).into(),
            ]);
        }
    }
    let mut section = section.figure(stages(&joints)).table(signals);
    let regimes = regimes(&joints);
    if let Some(figure) = regimes {
        section = section.figure(figure);
    }
    section
}

fn rows_of(joints: &[&JointReport]) -> Axis {
    Axis::categories("", joints.iter().map(|joint| joint.joint.as_str()))
}

fn edges(count: usize) -> impl Iterator<Item = f64> {
    (0..=count).map(|edge| edge as f64 - 0.5)
}

fn height(joints: usize) -> u32 {
    (30 * joints + 110) as u32
}

fn stages(joints: &[&JointReport]) -> Figure {
    let of_joint = |joint: &&JointReport| {
        let of_stage = |(stage, _): &(Stage, &str)| {
            let certain = f64::from(u8::from(joint.place.stage == Some(*stage)));
            joint.place.stages.get(stage).copied().unwrap_or(certain)
        };
        STAGES.iter().map(of_stage).collect::<Vec<f64>>()
    };
    let map = HeatMap::new(
        "probability",
        "",
        edges(STAGES.len()),
        edges(joints.len()),
        joints.iter().map(of_joint).collect(),
    );
    let panel = Panel::new(
        Axis::categories("", STAGES.map(|(_, name)| name)),
        rows_of(joints),
    )
    .heat_map(map);
    Figure::new("Stage that the gap comes from")
        .panel(panel)
        .columns(1)
        .panel_height(height(joints.len()))
}

/// One map for each variable and one for frequency; ranges from low to high. Each joint has its own.
fn regimes(joints: &[&JointReport]) -> Option<Figure> {
    let mut variables: Vec<&str> = Vec::new();
    for regime in joints.iter().flat_map(|joint| &joint.place.regimes) {
        if !variables.contains(&regime.variable.as_str()) {
            variables.push(&regime.variable);
        }
    }
    let mut figure = Figure::new(
        "Shares of the gap's energy above the noise floor. Ranges run from the lowest to the highest value that the joint has \
         in the recordings; the last map is over frequency",
    )
    .columns(2)
    .panel_height(height(joints.len()));
    let mut panels = 0;
    let shares = variables.iter().map(|variable| {
        let of_joint = |joint: &&JointReport| {
            let regimes = joint.place.regimes.iter();
            let own = regimes.filter(|regime| regime.variable == *variable);
            own.map(|regime| regime.share).collect::<Vec<f64>>()
        };
        (*variable, joints.iter().map(of_joint).collect::<Vec<_>>())
    });
    let of_bands = |joint: &&JointReport| {
        let bands = joint.place.bands.iter();
        bands.map(|band| band.share).collect::<Vec<f64>>()
    };
    let bands = ("frequency, Hz", joints.iter().map(of_bands).collect());
    let all: Vec<(&str, Vec<Vec<f64>>)> = shares.chain([bands]).collect();
    let every_share = all.iter().flat_map(|(_, values)| values.iter().flatten());
    let largest = every_share.copied().fold(0.0, f64::max);
    for (name, values) in all {
        let columns = values.iter().map(Vec::len).max().unwrap_or(0);
        if columns == 0 {
            continue;
        }
        panels += 1;
        let map = HeatMap::new("share", "", edges(columns), edges(joints.len()), values)
            .on_scale(0.0, largest);
        let numbers = (1..=columns).map(|range| range.to_string());
        let panel = Panel::new(
            Axis::categories("range, low to high", numbers),
            rows_of(joints),
        );
        figure = figure.panel(panel.title(name).heat_map(map));
    }
    (panels > 0).then_some(figure)
}
