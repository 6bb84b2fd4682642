//! The gap report for people: verdict first, then which, where, what remains, how far, what next.

mod effects;
mod place;
mod remains;
mod traces;
pub mod words;

use gap_diagnosis::{Diagnosis, Options};
use gap_report::{JointReport, JointShare, Report, SharedEffect, Verdict};
use report::{
    Axis, Cell, Chain, Column, Figure, Node, Page, Panel, Section, Series, Table, number,
};
use robot::Robot;

use super::beside::Beside;
use words::{next_steps, percent, sentence, unit, verdict_in_words, with_value, words};

/// Two-sided 95 % of the normal distribution.
const Z95: f64 = 1.96;

/// The whole page.
pub fn page(robot: &Robot, diagnosis: &Diagnosis, beside: Option<&Beside>) -> Page {
    let report = &diagnosis.report;
    let sections = [
        effects::section(report),
        traces::section(report, &diagnosis.traces),
        place::section(report),
        remains::section(report),
        parameters(report),
        shrink(report),
        Section::new("next", "What to do next").list(next_steps(report)),
        data(report),
    ];
    let title = format!("Sim-to-real gap of {}", report.robot);
    let page = Page::new(title, sentence(report));
    let first = [arm(robot, report)].into_iter();
    let first = first.chain(beside.map(Beside::section));
    first.chain(sections).fold(page, Page::section)
}

/// What somebody who tries things out looks at first: the robot, the shares, what remains.
pub fn short_page(robot: &Robot, report: &Report) -> Page {
    let title = format!("Sim-to-real gap of {}", report.robot);
    let page = Page::new(title, sentence(report));
    let sections = [
        arm(robot, report),
        effects::section(report),
        remains::section(report),
    ];
    sections.into_iter().fold(page, Page::section)
}

/// Rms of the gap over that of the noise, as the torque shows it.
fn gap_to_noise(joint: &JointReport) -> Option<f64> {
    let torque = &joint.gap.torque_rms_nm;
    let known = joint.verdict != Verdict::InsufficientData && torque.noise_floor > 0.0;
    known.then(|| torque.before / torque.noise_floor)
}

/// Joints that were found to have a gap.
fn with_gap(report: &Report) -> impl Iterator<Item = &JointReport> {
    report.joints.iter().filter(|joint| has_gap(joint))
}

fn has_gap(joint: &JointReport) -> bool {
    !matches!(joint.verdict, Verdict::NoGap | Verdict::InsufficientData)
}

/// Joints, the largest gap first and those without one last.
pub fn largest_first(report: &Report) -> Vec<&JointReport> {
    let mut joints: Vec<&JointReport> = report.joints.iter().collect();
    let gap_nm = |joint: &JointReport| {
        let before_nm = joint.gap.torque_rms_nm.before;
        if has_gap(joint) { before_nm } else { -1.0 }
    };
    joints.sort_by(|a, b| gap_nm(b).total_cmp(&gap_nm(a)));
    joints
}

/// A line a joint, and of an arm a picture.
fn arm(robot: &Robot, report: &Report) -> Section {
    let mut table = Table::new(
        "Every joint, the largest gap first",
        [
            Column::text("joint"),
            Column::text("verdict"),
            Column::text("effects, share of the gap"),
            Column::number("no name, %"),
            Column::number("gap, Nm rms"),
            Column::number("after"),
            Column::text("why"),
        ],
    );
    for joint in largest_first(report) {
        let torque = &joint.gap.torque_rms_nm;
        let told = |text: String| if has_gap(joint) { text } else { String::new() };
        // what is explained needs no reason beside the effects
        let reason = if joint.verdict == Verdict::Explained {
            ""
        } else {
            &joint.reason
        };
        table.row([
            joint.joint.clone().into(),
            Cell::strong(verdict_in_words(joint.verdict)),
            with_shares(report, joint).join(", ").into(),
            told(percent(joint.remaining_share)).into(),
            told(number(torque.before, 3)).into(),
            told(number(torque.after, 3)).into(),
            unit_taken(joint)
                .into_iter()
                .chain([reason.to_owned()])
                .filter(|sentence| !sentence.is_empty())
                .collect::<Vec<String>>()
                .join("; ")
                .into(),
        ]);
    }
    let section = Section::new("arm", "The robot").table(table);
    if report.joints.len() < 2 {
        return section;
    }
    section.chain(picture(robot, report))
}

/// In which unit a joint's torque was taken, where that is not as it was recorded.
pub fn unit_taken(joint: &JointReport) -> Option<String> {
    let times = joint.torque.map_or(1.0, |torque| torque.unit);
    (times != 1.0).then(|| format!("torque taken {} times as recorded", number(times, 3)))
}

/// A joint's effects, each with its share.
pub fn with_shares(report: &Report, joint: &JointReport) -> Vec<String> {
    let told = |(found, share)| format!("{} ({} %)", with_value(found), percent(share));
    let shared = of_shared(report, joint);
    let own = joint.effects.iter().map(|found| (found, found.share));
    let all = shared.map(|(found, share)| (&found.effect, share.share));
    let material = all.filter(|(_, share)| *share >= Options::default().materiality);
    material.chain(own).map(told).collect()
}

/// Causes that the arm shares, with what each takes of a joint's gap.
pub fn of_shared<'a>(
    report: &'a Report,
    joint: &JointReport,
) -> impl Iterator<Item = (&'a SharedEffect, JointShare)> {
    let all = report.shared_effects.iter();
    all.filter_map(|shared| Some((shared, *shared.joint_shares.get(&joint.joint)?)))
}

/// The arm at zero, seen from the side on which it is widest.
fn picture(robot: &Robot, report: &Report) -> Chain {
    let zero = vec![0.0; robot.joints.len()];
    let frames_m: Vec<[f64; 3]> = (0..robot.joints.len())
        .map(|joint| {
            robot
                .chain
                .joint_frame(&zero, joint)
                .translation
                .vector
                .into()
        })
        .chain([robot.chain.tool_pose(&zero).translation.vector.into()])
        .collect();
    let width = |axis: usize| {
        let all = frames_m.iter().map(|frame| frame[axis]);
        all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min)
    };
    let across = if width(1) > width(0) { 1 } else { 0 };
    let flat = |frame: [f64; 3]| [frame[across], frame[2]];
    let nodes = report.joints.iter().zip(&frames_m).map(|(joint, frame)| {
        let before_nm = has_gap(joint).then_some(joint.gap.torque_rms_nm.before);
        let told = before_nm.map_or(String::new(), |nm| format!(", {} Nm", number(nm, 3)));
        Node {
            label: format!("{}: {}{told}", joint.joint, verdict_in_words(joint.verdict)),
            place: flat(*frame),
            value: before_nm,
        }
    });
    let end = frames_m.last().copied().map_or([0.0; 2], flat);
    Chain::new(
        "The arm at joint angle zero. Colour: rms of the gap in torque; white: no gap, or not enough data.",
        "gap, Nm rms",
        nodes,
        end,
    )
}

fn parameters(report: &Report) -> Section {
    let mut table = Table::new(
        "Change against the robot file, except where the file has no such effect",
        [
            Column::text("joint"),
            Column::text("effect"),
            Column::text("parameter"),
            Column::number("value"),
            Column::number("95 % interval"),
            Column::text("unit"),
            Column::text(""),
        ],
    );
    let own = report.joints.iter().flat_map(|joint| {
        let effects = joint.effects.iter();
        effects.map(move |found| (joint.joint.clone(), found))
    });
    let shared = report
        .shared_effects
        .iter()
        .map(|shared| (shared.joints.join(", "), &shared.effect));
    for (joint, found) in shared.chain(own) {
        for (name, parameter) in &found.parameters {
            let half = Z95 * parameter.std;
            let [low, high] = [parameter.value - half, parameter.value + half];
            table.row([
                joint.clone().into(),
                words(&found.effect).into(),
                name.clone().into(),
                number(parameter.value, 4).into(),
                format!("{} to {}", number(low, 4), number(high, 4)).into(),
                unit(name).into(),
                if parameter.at_bound {
                    "on the limit of what was searched: a finding, not a value"
                } else {
                    ""
                }
                .into(),
            ]);
        }
    }
    Section::new("parameters", "How large it is").table(table)
}

/// A joint's rms before, after, and of noise.
type Sizes = fn(&JointReport) -> [f64; 3];

/// Before, after and noise floor on data that nothing was fitted to.
fn shrink(report: &Report) -> Section {
    let sizes: [(&str, &str, Sizes); 2] = [
        ("torque rms", "Nm", |joint| {
            let rms = &joint.gap.torque_rms_nm;
            [rms.before, rms.after, rms.noise_floor]
        }),
        ("position rms", "mrad", |joint| {
            let rms = &joint.gap.position_rms_rad;
            [rms.before, rms.after, rms.noise_floor].map(|rad| 1e3 * rad)
        }),
    ];
    let names = || report.joints.iter().map(|joint| joint.joint.as_str());
    let panels = sizes.into_iter().filter_map(|(quantity, unit, of)| {
        let all: Vec<[f64; 3]> = report.joints.iter().map(of).collect();
        // along the recorded motion no position is simulated
        all.iter().flatten().any(|size| *size > 0.0).then(|| {
            let panel = Panel::new(Axis::categories("", names()), Axis::new(quantity, unit));
            let names = ["before", "after", "noise floor"].into_iter().enumerate();
            names.fold(panel, |panel, (place, name)| {
                panel.series(Series::bars(name, all.iter().map(|sizes| sizes[place])))
            })
        })
    });
    let panels: Vec<Panel> = panels.collect();
    let mut table = Table::new(
        "Shrink of the gap in torque",
        [
            Column::text("joint"),
            Column::number("rms before, Nm"),
            Column::number("after, Nm"),
            Column::number("noise floor, Nm"),
            Column::number("shrink"),
            Column::number("95 % interval"),
            Column::text("judged on"),
        ],
    );
    for joint in with_gap(report) {
        let gap = &joint.gap;
        let torque = &gap.torque_rms_nm;
        table.row([
            joint.joint.clone().into(),
            number(torque.before, 3).into(),
            number(torque.after, 3).into(),
            number(torque.noise_floor, 3).into(),
            Cell::strong(number(gap.shrink, 3)),
            format!(
                "{} to {}",
                number(gap.shrink_low, 3),
                number(gap.shrink_high, 3)
            )
            .into(),
            if torque.held_out {
                "held-out data"
            } else {
                "the data fitted to"
            }
            .into(),
        ]);
    }
    table.note("Shrink: 1 - (V_after - V_noise)/(V_before - V_noise), V the mean square of the torque that nobody explains.");
    let section = Section::new("shrink", "How far the gap shrinks");
    if panels.is_empty() {
        return section.table(table);
    }
    let caption = "Gap before and after the effects are added, and what noise alone leaves";
    // names of more joints need the whole width
    let columns = if report.joints.len() > 2 { 1 } else { 2 };
    let figure = Figure::new(caption).columns(columns).panel_height(240);
    section
        .figure(panels.into_iter().fold(figure, Figure::panel))
        .table(table)
}

/// What the data is and what is wrong with it.
fn data(report: &Report) -> Section {
    let facts = [
        ("recordings", report.recordings.join(", ")),
        (
            "length",
            format!(
                "{} s, {} rows at {} Hz",
                number(report.seconds, 4),
                report.samples,
                number(report.sample_rate_hz, 5)
            ),
        ),
        ("simulation", words::twin(report.twin).to_owned()),
        (
            "computed in",
            format!("{} s", number(report.compute_seconds, 3)),
        ),
    ];
    let findings = report.data.iter().map(ToString::to_string);
    Section::new("data", "The data")
        .definitions(facts)
        .list(findings)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests;
