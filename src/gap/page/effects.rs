//! Which effects take which part of the gap, and how sure that is.

use gap_report::{JointReport, NamedEffect, Report};
use report::{Axis, Column, Figure, Panel, Section, Series, Table, number};

use super::words::{percent, with_value, words};
use super::{of_shared, with_gap};

/// Candidates that a joint's line holds.
const CANDIDATES_MAX: usize = 4;
/// A first candidate that is likelier than this needs no others beside it: one in twenty such statements is wrong.
const CERTAIN: f64 = 0.95;
/// Candidates below what is printed as 0.01 are left out.
const PRINTED: f64 = 0.005;
/// What is no effect.
const NAMELESS: &str = "without a name";

/// Shares, minor effects, how probable the largest part is, and what cannot be told apart.
pub fn section(report: &Report) -> Section {
    let section = Section::new("which", "Which effect").paragraph(
        "Share: the part of the gap, on data that nothing was fitted to, that an effect takes off, averaged over the orders in which \
         the effects can be added. All shares of a joint add up to 100 %; one below zero makes the gap larger there.",
    );
    let section = match shares(report) {
        Some(figure) => section.figure(figure),
        None => section,
    };
    let section = [minor(report), candidates(report), confusable(report)]
        .into_iter()
        .flatten()
        .fold(section, Section::table);
    if report
        .joints
        .iter()
        .all(|joint| joint.confusable.is_empty())
    {
        return section
            .paragraph("No two explanations were found that this data could not tell apart.");
    }
    section
}

/// Name, share and 95 % interval of all that takes a part of a joint's gap.
fn parts(report: &Report, joint: &JointReport) -> Vec<(String, f64, [f64; 2])> {
    let of_effect = |found: &NamedEffect| {
        (
            with_value(found),
            found.share,
            [found.share_low, found.share_high],
        )
    };
    let shared = of_shared(report, joint).map(|(shared, here)| {
        let ends = [here.share_low, here.share_high];
        (with_value(&shared.effect), here.share, ends)
    });
    let mut parts: Vec<_> = joint.effects.iter().map(of_effect).chain(shared).collect();
    let minor: f64 = joint.minor_effects.iter().map(|found| found.share).sum();
    if !joint.minor_effects.is_empty() {
        parts.push(("minor effects".to_owned(), minor, [minor; 2]));
    }
    let remaining = joint.remaining_share;
    parts.push((NAMELESS.to_owned(), remaining, [remaining; 2]));
    parts
}

/// Bars for each joint, all panels as high as the one with the most.
fn shares(report: &Report) -> Option<Figure> {
    let joints = with_gap(report).map(|joint| (joint, parts(report, joint)));
    let joints: Vec<_> = joints.collect();
    let most = joints.iter().map(|(_, parts)| parts.len()).max()?;
    let figure = Figure::new("Share of each joint's gap, with its 95 % interval")
        .columns(2)
        .panel_height(bars_height(most));
    let panels = joints.into_iter().map(|(joint, parts)| {
        let names = parts.iter().map(|(name, _, _)| name.as_str());
        let bars = Series::bars("", parts.iter().map(|(_, share, _)| 100.0 * share));
        let intervals = parts.iter().map(|(_, share, [low, high])| {
            [share - low, high - share].map(|away| 100.0 * away.max(0.0))
        });
        Panel::new(
            Axis::new("share of the gap", "%"),
            Axis::categories("", names),
        )
        .title(&joint.joint)
        .series(bars.with_intervals(intervals))
    });
    Some(panels.fold(figure, Figure::panel))
}

/// Height of a panel with a title and so many bars.
pub fn bars_height(bars: usize) -> u32 {
    (26 * bars + 110) as u32
}

fn minor(report: &Report) -> Option<Table> {
    let mut table = Table::new(
        "Minor effects: too small or too uncertain a part of the gap to count in the headline or the verdict",
        [
            Column::text("joint"),
            Column::text("effect"),
            Column::number("share, %"),
            Column::number("95 % interval, %"),
        ],
    );
    let mut any = false;
    for joint in with_gap(report) {
        for found in &joint.minor_effects {
            any = true;
            let ends = [found.share_low, found.share_high].map(percent);
            table.row([
                joint.joint.clone().into(),
                with_value(found).into(),
                percent(found.share).into(),
                ends.join(" to ").into(),
            ]);
        }
    }
    any.then_some(table)
}

/// Joints of which the largest part is not certain.
fn candidates(report: &Report) -> Option<Table> {
    let mut table = Table::new(
        "What the largest part of the gap is, where that is not certain",
        [
            Column::text("joint"),
            Column::text("probability of each explanation"),
        ],
    );
    let is_open = |joint: &&JointReport| {
        let first = joint.candidates.first();
        first.is_some_and(|first| first.probability < CERTAIN)
    };
    let mut any = false;
    for joint in with_gap(report).filter(is_open) {
        any = true;
        let likely = joint.candidates.iter();
        let likely = likely.filter(|candidate| candidate.probability >= PRINTED);
        let shown = likely.take(CANDIDATES_MAX);
        let told: Vec<String> = shown
            .map(|candidate| {
                let probability = number(candidate.probability, 2);
                format!("{} {probability}", words(&candidate.effect))
            })
            .collect();
        table.row([joint.joint.clone().into(), told.join(", ").into()]);
    }
    table.note(
        "Calibrated: of the statements made with 0.9, nine in ten are right. None: no gap; unknown: something on no list.",
    );
    any.then_some(table)
}

fn confusable(report: &Report) -> Option<Table> {
    let mut table = Table::new(
        "Explanations that this data cannot tell apart",
        [
            Column::text("joint"),
            Column::text("one"),
            Column::text("other"),
            Column::number("distance d²"),
            Column::text("because"),
        ],
    );
    let mut any = false;
    for joint in &report.joints {
        for pair in &joint.confusable {
            any = true;
            let [one, other] = &pair.effects;
            table.row([
                joint.joint.clone().into(),
                words(one).into(),
                words(other).into(),
                number(pair.distance, 2).into(),
                pair.reason.clone().into(),
            ]);
        }
    }
    table.note("d²: how far, in noise units, the one is from being imitated by the other; below 9 nobody can tell them apart.");
    any.then_some(table)
}
