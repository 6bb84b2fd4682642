//! The gap report for people: verdict first, then where, which, how far, what next.

mod place;
mod traces;
pub mod words;

use gap_diagnosis::Diagnosis;
use gap_diagnosis::report::{JointReport, Report, Verdict};
use report::{
    Axis, Cell, Chain, Column, Figure, Node, Page, Panel, Section, Series, Table, number,
};
use robot::Robot;

use words::{next_steps, sentence, unit, verdict_in_words, with_value};

/// Candidates that a joint's bars show.
const CANDIDATES_MAX: usize = 8;
/// Two-sided 95 % of the normal distribution.
const Z95: f64 = 1.96;

/// The whole page.
pub fn page(robot: &Robot, diagnosis: &Diagnosis) -> Page {
    let report = &diagnosis.report;
    Page::new(
        format!("Sim-to-real gap of {}", report.robot),
        sentence(report),
    )
    .section(arm(robot, report))
    .section(place::section(report))
    .section(traces::section(report, &diagnosis.traces))
    .section(probabilities(report))
    .section(parameters(report))
    .section(shrink(report))
    .section(Section::new("next", "What to do next").list(next_steps(report)))
    .section(data(report))
}

/// Rms of the gap over that of the noise, as the torque shows it.
fn gap_to_noise(joint: &JointReport) -> Option<f64> {
    let torque = &joint.gap.torque_rms_nm;
    let known = joint.verdict != Verdict::InsufficientData && torque.noise_floor > 0.0;
    known.then(|| torque.before / torque.noise_floor)
}

/// Joints that were found to have a gap.
fn with_gap(report: &Report) -> impl Iterator<Item = &JointReport> {
    report
        .joints
        .iter()
        .filter(|joint| !matches!(joint.verdict, Verdict::NoGap | Verdict::InsufficientData))
}

/// The arm at zero, seen from the side on which it is widest.
fn arm(robot: &Robot, report: &Report) -> Section {
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
        let ratio = gap_to_noise(joint);
        let told = ratio.map_or(String::new(), |ratio| {
            format!(", {} × noise", number(ratio, 2))
        });
        Node {
            label: format!("{}: {}{told}", joint.joint, verdict_in_words(joint.verdict)),
            place: flat(*frame),
            value: ratio,
        }
    });
    let end = frames_m.last().copied().map_or([0.0; 2], flat);
    let mut table = Table::new(
        "Every joint, the largest gap first",
        [
            Column::text("joint"),
            Column::text("verdict"),
            Column::text("effects, share of the gap"),
            Column::text("torque rms, Nm"),
            Column::text("why"),
        ],
    );
    let mut largest: Vec<&JointReport> = report.joints.iter().collect();
    largest.sort_by(|a, b| {
        let before = |joint: &JointReport| joint.gap.torque_rms_nm.before;
        before(b).total_cmp(&before(a))
    });
    for joint in largest {
        let effects: Vec<String> = joint
            .effects
            .iter()
            .map(|found| {
                format!(
                    "{} ({} %)",
                    with_value(found),
                    number(100.0 * found.share, 2)
                )
            })
            .collect();
        let torque = &joint.gap.torque_rms_nm;
        table.row([
            joint.joint.clone().into(),
            Cell::strong(verdict_in_words(joint.verdict)),
            effects.join(", ").into(),
            format!("{} → {}", number(torque.before, 3), number(torque.after, 3)).into(),
            joint.reason.clone().into(),
        ]);
    }
    Section::new("arm", "The robot")
        .chain(Chain::new(
            "The arm at joint angle zero. Colour: rms of the gap in torque over that of the noise.",
            "gap over noise",
            nodes,
            end,
        ))
        .table(table)
}

fn probabilities(report: &Report) -> Section {
    let mut section = Section::new("which", "Which effect").paragraph(
        "Probabilities are calibrated: of the statements made with 0.9, nine in ten are right. `none`: no gap; `unknown`: an effect on no list.",
    );
    for joint in with_gap(report) {
        let shown = || joint.candidates.iter().take(CANDIDATES_MAX).rev();
        let panel = Panel::new(
            Axis::new("probability", "").range(0.0, 1.0),
            Axis::categories("", shown().map(|candidate| candidate.effect.as_str())),
        )
        .series(Series::bars(
            "",
            shown().map(|candidate| candidate.probability),
        ));
        let height = (26 * shown().count() + 70) as u32;
        let figure = Figure::new(format!("{}: candidates", joint.joint))
            .panel(panel)
            .columns(1)
            .panel_height(height);
        section = section.figure(figure);
    }
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
    let mut pairs = 0;
    for joint in &report.joints {
        for pair in &joint.confusable {
            pairs += 1;
            let [one, other] = &pair.effects;
            table.row([
                joint.joint.clone().into(),
                one.clone().into(),
                other.clone().into(),
                number(pair.distance, 2).into(),
                pair.reason.clone().into(),
            ]);
        }
    }
    table.note("d²: how far, in noise units, the one is from being imitated by the other; below 9 nobody can tell them apart.");
    if pairs == 0 {
        return section
            .paragraph("No two explanations were found that this data could not tell apart.");
    }
    section.table(table)
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
                found.effect.clone().into(),
                name.clone().into(),
                number(parameter.value, 4).into(),
                format!("{} to {}", number(low, 3), number(high, 3)).into(),
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

/// Before, after and noise floor on data that nothing was fitted to.
fn shrink(report: &Report) -> Section {
    let names: Vec<&str> = report
        .joints
        .iter()
        .map(|joint| joint.joint.as_str())
        .collect();
    let bars = |of: fn(&JointReport) -> f64| report.joints.iter().map(of).collect::<Vec<f64>>();
    let torque = Panel::new(
        Axis::categories("", names.clone()),
        Axis::new("torque rms", "Nm"),
    )
    .series(Series::bars(
        "before",
        bars(|joint| joint.gap.torque_rms_nm.before),
    ))
    .series(Series::bars(
        "after",
        bars(|joint| joint.gap.torque_rms_nm.after),
    ))
    .series(Series::bars(
        "noise floor",
        bars(|joint| joint.gap.torque_rms_nm.noise_floor),
    ));
    let position = Panel::new(
        Axis::categories("", names),
        Axis::new("position rms", "mrad"),
    )
    .series(Series::bars(
        "before",
        bars(|joint| 1e3 * joint.gap.position_rms_rad.before),
    ))
    .series(Series::bars(
        "after",
        bars(|joint| 1e3 * joint.gap.position_rms_rad.after),
    ))
    .series(Series::bars(
        "noise floor",
        bars(|joint| 1e3 * joint.gap.position_rms_rad.noise_floor),
    ));
    let mut table = Table::new(
        "Shrink of the gap in torque",
        [
            Column::text("joint"),
            Column::number("shrink"),
            Column::number("95 % interval"),
            Column::text("judged on"),
            Column::text("what is left"),
        ],
    );
    for joint in with_gap(report) {
        let gap = &joint.gap;
        let left = match joint.remaining {
            gap_diagnosis::report::Remaining::White => "nothing that a model could use",
            gap_diagnosis::report::Remaining::Structured => "structure",
        };
        table.row([
            joint.joint.clone().into(),
            Cell::strong(number(gap.shrink, 3)),
            format!(
                "{} to {}",
                number(gap.shrink_low, 3),
                number(gap.shrink_high, 3)
            )
            .into(),
            if gap.torque_rms_nm.held_out {
                "held-out data"
            } else {
                "the data fitted to"
            }
            .into(),
            left.into(),
        ]);
    }
    table.note("Shrink: 1 - (V_after - V_noise)/(V_before - V_noise), V the mean square of the torque that nobody explains.");
    Section::new("shrink", "How far the gap shrinks")
        .figure(
            Figure::new("Gap before and after the effects are added, and what noise alone leaves")
                .panel(torque)
                .panel(position)
                .columns(2),
        )
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
