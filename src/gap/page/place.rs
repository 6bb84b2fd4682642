//! Where simulation and robot part: by stage, signal, range and frequency.

use std::collections::BTreeMap;

use gap_report::{JointReport, Regime, Report};
use report::{Axis, Column, Figure, HeatMap, Panel, Section, Series, Table, number};
use robot::Stage;

use super::words::{percent, signal_axis};
use super::{of_shared, with_gap};

const STAGES: [(Stage, &str); 5] = [
    (Stage::Actuator, "actuator"),
    (Stage::Transmission, "transmission"),
    (Stage::RigidBody, "rigid body"),
    (Stage::Sensing, "sensing"),
    (Stage::Timing, "timing"),
];

/// Values of a variable that all lie within this are one value: a tenth of a milliradian, of a mNm and of a millisecond are less than any
/// joint moves, carries or lasts.
const ONE_VALUE: f64 = 1e-4;
/// Ranges and bands in a row at most; more stand in two rows.
const PANELS: usize = 5;
/// Ranges whose widths differ by less than this part of them were cut by width, and hold different numbers of rows.
const EQUAL: f64 = 0.01;
const PANEL_HEIGHT: u32 = 170;

/// Of all joints that have a gap.
pub fn section(report: &Report) -> Section {
    let joints: Vec<&JointReport> = with_gap(report).collect();
    let section = Section::new("where", "Where they part");
    if joints.is_empty() {
        return section.paragraph("No joint has a gap.");
    }
    let mut signals = Table::new(
        "Where each gap comes from, or looks most like where nothing accounts for it, and the signals in which it shows",
        [
            Column::text("joint"),
            Column::text("stage"),
            Column::text("signal"),
            Column::number("gap over noise"),
        ],
    );
    for joint in &joints {
        for signal in &joint.place.signals {
            signals.row([
                joint.joint.clone().into(),
                stage_in_words(joint.place.stage).into(),
                signal.signal.clone().into(),
                number(signal.gap_to_noise, 3).into(),
            ]);
        }
    }
    let section = section
        .figure(stages(report, &joints))
        .table(signals)
        .paragraph(
            "Below: which part of the gap lies in which range. A grey line is drawn where each range of a variable holds as many rows as \
             the others: it is an even spread, and what stands above it is where the gap is.",
        );
    joints.iter().fold(section, |section, joint| {
        let figure = ranges(joint);
        match figure {
            Some(figure) => section.figure(figure),
            None => section,
        }
    })
}

fn stage_in_words(stage: Option<Stage>) -> &'static str {
    let known = STAGES.iter().find(|(known, _)| Some(*known) == stage);
    known.map_or("", |(_, name)| name)
}

fn edges(count: usize) -> impl Iterator<Item = f64> {
    (0..=count).map(|edge| edge as f64 - 0.5)
}

/// Shares of the named effects, stage by stage.
fn shares(report: &Report, joint: &JointReport) -> BTreeMap<Stage, f64> {
    let own = joint
        .effects
        .iter()
        .map(|found| (&found.effect, found.share));
    let shared = of_shared(report, joint).map(|(shared, here)| (&shared.effect.effect, here.share));
    let mut shares = BTreeMap::new();
    for (effect, share) in own.chain(shared) {
        if let Some(stage) = Stage::of(effect) {
            *shares.entry(stage).or_default() += share;
        }
    }
    shares
}

fn stages(report: &Report, joints: &[&JointReport]) -> Figure {
    let names = STAGES
        .map(|(_, name)| name)
        .into_iter()
        .chain(["without a name"]);
    let of_joint = |joint: &&JointReport| {
        let shares = shares(report, joint);
        let named = STAGES.map(|(stage, _)| shares.get(&stage).copied().unwrap_or(0.0));
        let all = named.into_iter().chain([joint.remaining_share]);
        all.collect::<Vec<f64>>()
    };
    let values: Vec<Vec<f64>> = joints.iter().map(of_joint).collect();
    let label = |share: &f64| format!("{} %", percent(*share));
    let labels = values.iter().map(|row| row.iter().map(label).collect());
    let labels = labels.collect();
    let map = HeatMap::new(
        "share of the gap",
        "",
        edges(STAGES.len() + 1),
        edges(joints.len()),
        values,
    );
    let panel = Panel::new(
        Axis::categories("", names),
        Axis::categories("", joints.iter().map(|joint| joint.joint.as_str())),
    )
    .heat_map(map.on_scale(0.0, 1.0).with_labels(labels));
    Figure::new("Share of each joint's gap that its named effects take, by the stage they act in; minor effects left out")
        .panel(panel)
        .panel_height((30 * joints.len() + 80) as u32)
}

/// A joint's shares over each variable and over frequency, with values and units.
fn ranges(joint: &JointReport) -> Option<Figure> {
    let mut variables: Vec<(&str, Vec<[f64; 3]>)> = Vec::new();
    for Regime {
        variable,
        from,
        to,
        share,
    } in &joint.place.regimes
    {
        let range = [*from, *to, *share];
        match variables.iter_mut().find(|(known, _)| known == variable) {
            Some((_, ranges)) => ranges.push(range),
            None => variables.push((variable, vec![range])),
        }
    }
    // ranges of one width hold different numbers of rows, and have no even spread
    let even = |ranges: &[[f64; 3]]| {
        let widths = ranges.iter().map(|[from, to, _]| to - from);
        let (low, high) = widths.fold((f64::INFINITY, 0.0_f64), |(low, high), width| {
            (low.min(width), high.max(width))
        });
        (low < (1.0 - EQUAL) * high).then_some(1.0 / ranges.len() as f64)
    };
    let mut panels: Vec<Panel> = Vec::new();
    let is_range = |ranges: &[[f64; 3]]| {
        let ends = ranges.first().zip(ranges.last());
        ends.is_some_and(|(first, last)| last[1] - first[0] > ONE_VALUE)
    };
    for (variable, ranges) in variables.iter().filter(|(_, ranges)| is_range(ranges)) {
        let (quantity, unit) = signal_axis(variable);
        let panel = steps(Axis::new(quantity, unit), ranges);
        panels.push(match even(ranges) {
            Some(share) => panel.horizontal(100.0 * share, ""),
            None => panel,
        });
    }
    let bands = joint.place.bands.iter();
    let bands: Vec<[f64; 3]> = bands.map(|b| [b.from_hz, b.to_hz, b.share]).collect();
    if !bands.is_empty() {
        panels.push(steps(Axis::new("frequency", "Hz"), &bands));
    }
    if panels.is_empty() {
        return None;
    }
    let caption = format!("{}: share of the gap in each range, %", joint.joint);
    let figure = Figure::new(caption)
        .columns(if panels.len() > PANELS {
            panels.len().div_ceil(2)
        } else {
            panels.len()
        })
        .panel_height(PANEL_HEIGHT);
    Some(panels.into_iter().fold(figure, Figure::panel))
}

/// A step for each range, up to its share.
fn steps(x: Axis, ranges: &[[f64; 3]]) -> Panel {
    let corners = ranges.iter().flat_map(|[from, to, share]| {
        let percent = 100.0 * share;
        [[*from, percent], [*to, percent]]
    });
    let ends = [ranges.first().map(|r| r[0]), ranges.last().map(|r| r[1])];
    let [first, last] = ends.map(|end| end.map(|at| [at, 0.0]));
    let line = first.into_iter().chain(corners).chain(last);
    Panel::new(x, Axis::new("", "")).series(Series::line("", line))
}
