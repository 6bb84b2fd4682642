//! Scores as rows, for terminal and page alike.

use std::fmt::Write;

use blind::RigKind;
use blind::score::{Judgement, Measures, Rate, Scores};
use comfy_table::{CellAlignment, Table, presets};
use report::decimal;

use super::score::Scored;

/// A measure of the evaluation: what it is called, what it must reach and should reach.
pub struct Measure {
    /// In words.
    pub name: &'static str,
    /// At least, or at most, this.
    pub must: &'static str,
    /// Better.
    pub aim: &'static str,
    /// Its value.
    pub value: fn(&Measures) -> String,
}

/// All of them, in the order of the table.
pub const MEASURES: [Measure; 14] = [
    Measure {
        name: "top-1, one effect",
        must: "0.85",
        aim: "0.93",
        value: |measures| rate(&measures.top_1),
    },
    Measure {
        name: "top-3, one effect",
        must: "0.97",
        aim: "0.99",
        value: |measures| rate(&measures.top_3),
    },
    Measure {
        name: "truth within the reported set",
        must: "0.95",
        aim: "0.98",
        value: |measures| rate(&measures.in_set),
    },
    Measure {
        name: "mean size of that set",
        must: "1.6",
        aim: "",
        value: |measures| optional(measures.set_size, 2),
    },
    Measure {
        name: "joint",
        must: "0.98",
        aim: "0.99",
        value: |measures| rate(&measures.joint),
    },
    Measure {
        name: "stage",
        must: "0.90",
        aim: "0.95",
        value: |measures| rate(&measures.stage),
    },
    Measure {
        name: "false alarms without a gap",
        must: "0.02",
        aim: "0.01",
        value: |measures| rate(&measures.false_alarms),
    },
    Measure {
        name: "unknown recognised",
        must: "0.80",
        aim: "0.90",
        value: |measures| rate(&measures.unknown_recognised),
    },
    Measure {
        name: "known called unknown",
        must: "0.08",
        aim: "0.04",
        value: |measures| rate(&measures.called_unknown),
    },
    Measure {
        name: "two effects, F1",
        must: "0.80",
        aim: "0.90",
        value: |measures| {
            measures
                .two_effects_f1
                .map_or_else(nothing, |f1| interval(f1.value, f1.low, f1.high))
        },
    },
    Measure {
        name: "designed pairs called not separable",
        must: "0.90",
        aim: "0.97",
        value: |measures| rate(&measures.not_separable),
    },
    Measure {
        name: "parameter error, median",
        must: "0.10",
        aim: "0.05",
        value: |measures| optional(measures.parameter_error, 3),
    },
    Measure {
        name: "95 % interval covers the parameter",
        must: "0.90-0.98",
        aim: "0.93-0.97",
        value: |measures| rate(&measures.coverage),
    },
    Measure {
        name: "shrink over the oracle's",
        must: "0.95",
        aim: "0.98",
        value: |measures| optional(measures.shrink_over_oracle, 3),
    },
];

fn nothing() -> String {
    "-".to_owned()
}

fn interval(value: f64, low: f64, high: f64) -> String {
    format!(
        "{} ({}-{})",
        decimal(value, 3),
        decimal(low, 2),
        decimal(high, 2)
    )
}

/// A rate with its interval and the number of cases.
pub fn rate(rate: &Rate) -> String {
    rate.rate.map_or_else(nothing, |value| {
        format!("{} of {}", interval(value, rate.low, rate.high), rate.of)
    })
}

fn optional(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(nothing, |value| decimal(value, decimals))
}

/// Brier's score and calibration error.
pub fn calibration(scores: &Scores) -> [(&'static str, &'static str, &'static str, String); 2] {
    let calibration = &scores.calibration;
    [
        (
            "calibration error",
            "0.07",
            "0.04",
            optional(calibration.error, 3),
        ),
        ("Brier score", "", "", optional(calibration.brier, 3)),
    ]
}

/// The parts that the cases fall into, each with its measures.
pub fn parts(scores: &Scores) -> Vec<(String, &Measures)> {
    let mut parts = vec![("all".to_owned(), &scores.all)];
    for (rig, measures) in &scores.by_rig {
        let name = match rig {
            RigKind::OneJoint => "one joint",
            RigKind::SevenJoints => "seven joints",
        };
        parts.push((name.to_owned(), measures));
    }
    for (level, measures) in &scores.by_level {
        parts.push((format!("gap over noise {level}"), measures));
    }
    parts
}

/// A miss in one line.
pub fn miss(judgement: &Judgement) -> [String; 3] {
    [
        judgement.case.clone(),
        judgement.truth.clone(),
        judgement.predicted.clone(),
    ]
}

fn table<T: Into<comfy_table::Cell>>(header: impl IntoIterator<Item = T>) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::UTF8_HORIZONTAL_ONLY)
        .set_header(header.into_iter().map(Into::into).collect::<Vec<_>>());
    table
}

/// All tables for the terminal.
pub fn text(scored: &[Scored]) -> String {
    let mut text = String::new();
    let names = scored.iter().map(|one| one.name.as_str());
    let mut rows = table(["measure", "must", "aim"].into_iter().chain(names));
    for measure in &MEASURES {
        let values = scored.iter().map(|one| (measure.value)(&one.scores.all));
        let first = [measure.name, measure.must, measure.aim].map(str::to_owned);
        rows.add_row(first.into_iter().chain(values));
    }
    for row in 0..2 {
        let values = scored
            .iter()
            .map(|one| calibration(&one.scores)[row].3.clone());
        let Some(one) = scored.first() else { break };
        let (name, must, aim, _) = calibration(&one.scores)[row].clone();
        let first = [name, must, aim].map(str::to_owned);
        rows.add_row(first.into_iter().chain(values));
    }
    let _ = writeln!(text, "{rows}");
    let Some(first) = scored.first() else {
        return text;
    };
    let parts = parts(&first.scores);
    let mut rows =
        table(std::iter::once("measure").chain(parts.iter().map(|part| part.0.as_str())));
    for measure in &MEASURES {
        let values = parts.iter().map(|part| (measure.value)(part.1));
        rows.add_row(std::iter::once(measure.name.to_owned()).chain(values));
    }
    let _ = writeln!(text, "{}, in parts\n{rows}", first.name);
    let mut rows = table(["truth", "called", "times"]);
    for one in first
        .scores
        .confusion
        .iter()
        .filter(|one| one.truth != one.called)
    {
        rows.add_row([one.truth.clone(), one.called.clone(), one.count.to_string()]);
    }
    for column in rows.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    let _ = writeln!(text, "confused\n{rows}");
    let mut rows = table(["case", "truth, with its gap over noise", "predicted"]);
    for judgement in &first.scores.misses {
        rows.add_row(miss(judgement));
    }
    let _ = writeln!(
        text,
        "{} of {} cases missed in something, {} without a prediction\n{rows}",
        first.scores.misses.len(),
        first.scores.cases,
        first.scores.without_prediction
    );
    text
}
