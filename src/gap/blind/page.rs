//! The page of scores.

use blind::Label;
use blind::score::Scores;
use report::{Axis, Column, Figure, HeatMap, Page, Panel, Section, Series, Table, decimal};

use super::score::Scored;
use super::table::{MEASURES, calibration, miss, parts, rate};

/// Fewer truths or names than this make a map of no use.
const MAP_MIN: usize = 2;

/// The whole page; the first set is what is judged, the others stand beside it.
pub fn page(labels: &[Label], scored: &[Scored]) -> Page {
    let Some(first) = scored.first() else {
        return Page::new("Blind evaluation", "Nothing was predicted.");
    };
    let scores = &first.scores;
    Page::new(
        "Blind evaluation of the gap diagnosis",
        verdict(labels, scores),
    )
    .section(measures(scored))
    .section(in_parts(scores))
    .section(reliability(scores))
    .section(confusion(scores))
    .section(misses(scores))
}

fn verdict(labels: &[Label], scores: &Scores) -> String {
    format!(
        "Of {} sealed cases: one effect named rightly {}; false alarms without a gap {}; unknown recognised {}.",
        labels.len(),
        rate(&scores.all.top_1),
        rate(&scores.all.false_alarms),
        rate(&scores.all.unknown_recognised)
    )
}

fn measures(scored: &[Scored]) -> Section {
    let names = scored.iter().map(|one| Column::number(&one.name));
    let fixed = [
        Column::text("measure"),
        Column::number("must"),
        Column::number("aim"),
    ];
    let mut table = Table::new("Gap over noise 1 and 3", fixed.into_iter().chain(names));
    for measure in &MEASURES {
        let values = scored
            .iter()
            .map(|one| (measure.value)(&one.scores.all).into());
        let first = [measure.name, measure.must, measure.aim].map(Into::into);
        table.row(first.into_iter().chain(values));
    }
    if let Some(first) = scored.first() {
        for (row, (name, must, aim, _)) in calibration(&first.scores).into_iter().enumerate() {
            let values = scored
                .iter()
                .map(|one| calibration(&one.scores)[row].3.clone().into());
            table.row([name, must, aim].map(Into::into).into_iter().chain(values));
        }
    }
    table.note("In brackets the 95 % interval: Wilson's for rates, of cases drawn again and again for F1. Shrink over the oracle's needs the true structure refitted, which is not done.");
    Section::new("measures", "Measures").table(table)
}

fn in_parts(scores: &Scores) -> Section {
    let parts = parts(scores);
    let columns = std::iter::once(Column::text("measure"))
        .chain(parts.iter().map(|part| Column::number(&part.0)));
    let mut table = Table::new("By kind of robot and by gap over noise", columns);
    for measure in &MEASURES {
        let values = parts.iter().map(|part| (measure.value)(part.1).into());
        table.row(std::iter::once(measure.name.into()).chain(values));
    }
    Section::new("parts", "In parts").table(table)
}

fn reliability(scores: &Scores) -> Section {
    let bins = &scores.calibration.bins;
    let points = bins
        .iter()
        .filter_map(|bin| Some((bin, [bin.stated, bin.right.rate?])));
    let intervals: Vec<[f64; 2]> = points
        .clone()
        .map(|(bin, [_, right])| [right - bin.right.low, bin.right.high - right])
        .collect();
    let panel = Panel::new(
        Axis::new("probability stated", "").range(0.0, 1.0),
        Axis::new("share that was right", "").range(0.0, 1.0),
    )
    .series(Series::dashed("as stated", [[0.0, 0.0], [1.0, 1.0]]))
    .series(Series::points("statements", points.map(|(_, point)| point)).with_intervals(intervals));
    let mut table = Table::new(
        "Statements by their probability",
        ["from", "to", "stated, mean", "right"].map(Column::number),
    );
    for bin in bins {
        table.row([
            decimal(bin.from, 1).into(),
            decimal(bin.to, 1).into(),
            decimal(bin.stated, 3).into(),
            rate(&bin.right).into(),
        ]);
    }
    Section::new("reliability", "Reliability")
        .paragraph("Of the statements made with a probability, that share should be right. One statement a case: the most probable about the joint in question, names that nobody can tell apart taken together.")
        .figure(Figure::new("Reliability, with 95 % intervals").panel(panel).columns(2))
        .table(table)
}

fn confusion(scores: &Scores) -> Section {
    let names = |of: fn(&blind::score::Confused) -> &String| {
        let mut names: Vec<&str> = scores
            .confusion
            .iter()
            .map(|one| of(one).as_str())
            .collect();
        names.sort_unstable();
        names.dedup();
        names
    };
    let (truths, called) = (names(|one| &one.truth), names(|one| &one.called));
    let section = Section::new("confusion", "Confusion");
    if truths.len() < MAP_MIN || called.len() < MAP_MIN {
        return section.paragraph("Too few cases for a map.");
    }
    let mut values = vec![vec![f64::NAN; called.len()]; truths.len()];
    for one in &scores.confusion {
        let row = truths.iter().position(|name| *name == one.truth);
        let column = called.iter().position(|name| *name == one.called);
        if let (Some(row), Some(column)) = (row, column) {
            values[row][column] = one.count as f64;
        }
    }
    let edges = |count: usize| (0..=count).map(|edge| edge as f64 - 0.5);
    let numbers: Vec<String> = (1..=called.len())
        .map(|number| number.to_string())
        .collect();
    let map = HeatMap::new(
        "cases",
        "",
        edges(called.len()),
        edges(truths.len()),
        values,
    );
    let panel = Panel::new(
        Axis::categories("called, by its number below", numbers),
        Axis::categories("truth", truths.iter().copied()),
    )
    .heat_map(map);
    let height = (22 * truths.len() + 90) as u32;
    section
        .figure(
            Figure::new("What each truth was called")
                .panel(panel)
                .columns(1)
                .panel_height(height),
        )
        .list(
            called
                .iter()
                .enumerate()
                .map(|(index, name)| format!("{}: {name}", index + 1)),
        )
}

fn misses(scores: &Scores) -> Section {
    let mut table = Table::new(
        format!(
            "{} of {} cases, {} without a prediction",
            scores.misses.len(),
            scores.cases,
            scores.without_prediction
        ),
        ["case", "truth, with its gap over noise", "predicted"].map(Column::text),
    );
    for judgement in &scores.misses {
        table.row(miss(judgement).map(Into::into));
    }
    Section::new("misses", "Every miss").table(table)
}
