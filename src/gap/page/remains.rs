//! What the named effects leave, drawn over what it depends on.

use gap_report::{JointReport, Remains, RemainsOver, Report};
use report::{Axis, Column, Figure, Panel, Section, Series, Table};

use super::effects::bars_height;
use super::with_gap;
use super::words::{percent, variable};

/// A rest below half of the last per cent that is shown is nothing.
const NOTHING: f64 = 0.005;

/// Curves in a row.
const COLUMNS: usize = 3;
const PANEL_HEIGHT: u32 = 250;

/// A line a joint, bars over what its rest depends on, and the curves.
pub fn section(report: &Report) -> Section {
    let section = Section::new("remains", "What remains");
    let has_rest =
        |joint: &&JointReport| joint.remaining_share > NOTHING || !joint.remaining_over.is_empty();
    let joints: Vec<&JointReport> = with_gap(report).filter(has_rest).collect();
    if joints.is_empty() {
        return section.paragraph("Nothing: what has a name is all of the gap.");
    }
    let mut table = Table::new(
        "What no effect on the list accounts for",
        [
            Column::text("joint"),
            Column::number("part of the gap, %"),
            Column::text("depends on (part of the gap)"),
        ],
    );
    for joint in &joints {
        let over = joint.remaining_over.iter();
        let over: Vec<String> = over
            .map(|rest| format!("{} ({} %)", variable(rest.over), percent(rest.share)))
            .collect();
        let over = if over.is_empty() {
            "not known".to_owned()
        } else {
            over.join(", ")
        };
        table.row([
            joint.joint.clone().into(),
            percent(joint.remaining_share).into(),
            over.into(),
        ]);
    }
    table.note(
        "Curves through the rest are fits, not causes. One rest may show over several variables: these parts do not add up.",
    );
    let figures = [bars(&joints), curves(&joints)];
    figures
        .into_iter()
        .flatten()
        .fold(section.table(table), Section::figure)
}

fn bars(joints: &[&JointReport]) -> Option<Figure> {
    let over = |joint: &&JointReport| joint.remaining_over.len();
    let most = joints.iter().map(over).max().filter(|most| *most > 0)?;
    let figure = Figure::new("Part of each joint's gap that lies over a variable")
        .columns(2)
        .panel_height(bars_height(most));
    let with_rest = joints.iter().filter(|joint| over(joint) > 0);
    let panels = with_rest.map(|joint| {
        let rests = &joint.remaining_over;
        Panel::new(
            Axis::new("part of the gap", "%"),
            Axis::categories("", rests.iter().map(|rest| variable(rest.over))),
        )
        .title(&joint.joint)
        .series(Series::bars(
            "",
            rests.iter().map(|rest| 100.0 * rest.share),
        ))
    });
    Some(panels.fold(figure, Figure::panel))
}

fn curves(joints: &[&JointReport]) -> Option<Figure> {
    let curve_of = |joint: &&JointReport| {
        let rests = joint.remaining_over.iter();
        let curves = rests.filter_map(curve);
        let titled = curves.map(|panel| panel.title(&joint.joint));
        titled.collect::<Vec<Panel>>()
    };
    let panels: Vec<Panel> = joints.iter().flat_map(curve_of).collect();
    if panels.is_empty() {
        return None;
    }
    let figure = Figure::new("Torque that is still missing once the effects are added")
        .columns(COLUMNS)
        .panel_height(PANEL_HEIGHT);
    Some(panels.into_iter().fold(figure, Figure::panel))
}

/// None where the rest is no function of one number.
fn curve(rest: &RemainsOver) -> Option<Panel> {
    let unit = match rest.over {
        Remains::Position | Remains::MotorPhase => "rad",
        Remains::Velocity => "rad/s",
        Remains::Load => "Nm",
        Remains::Time | Remains::SinceReversal => "s",
        Remains::OtherJoints => "",
    };
    if rest.at.is_empty() {
        return None;
    }
    let corners = rest.at.iter().zip(&rest.torque_nm);
    let corners: Vec<[f64; 2]> = corners.map(|(at, nm)| [*at, *nm]).collect();
    let panel = Panel::new(
        Axis::new(variable(rest.over), unit),
        Axis::new("torque that remains", "Nm"),
    );
    Some(panel.series(Series::line("", corners)).horizontal(0.0, ""))
}
