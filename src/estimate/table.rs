//! Calibrations and comparisons as text.

use std::fmt::Write;

use comfy_table::{CellAlignment, Table, presets};
use estimators::calibrate::Calibration;
use estimators::compare::Errors;
use report::{number, with_error};

use super::compare::{JointCompared, Measured};

fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::UTF8_HORIZONTAL_ONLY)
        .set_header(header.to_vec());
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// One joint's parameters and findings.
pub fn fits(calibration: &Calibration) -> String {
    let mut text = format!(
        "{}: {} rows with a reference\n",
        calibration.joint, calibration.rows
    );
    let mut rows = table(&["estimator", "left, rms Nm", "starts agreeing", "parameters"]);
    for fit in &calibration.fits {
        // the terms of a series are in the file; here they would hide the rest
        let told: Vec<String> = fit
            .fitted
            .iter()
            .filter(|fitted| fitted.name != "kinematic_error")
            .map(|fitted| {
                format!(
                    "{} {}",
                    fitted.name,
                    with_error(fitted.value, fitted.std_error)
                )
            })
            .collect();
        rows.add_row([
            fit.kind.name().to_owned(),
            number(fit.rms_nm, 3),
            format!("{} of {}", fit.agreeing_starts, fit.starts),
            told.join("\n"),
        ]);
    }
    let _ = writeln!(text, "{rows}");
    for finding in &calibration.findings {
        let _ = writeln!(text, "finding: {finding}");
    }
    text
}

/// The columns of a comparison.
pub const COLUMNS: [&str; 14] = [
    "estimator",
    "moving: average, Nm",
    "rms",
    "max",
    "95 %",
    "standing: average, Nm",
    "rms",
    "max",
    "reversals: max, Nm",
    "delay, ms",
    "noise, Nm",
    "drift, Nm",
    "within 1.96 σ",
    "cost, ns",
];

/// One estimator's row.
pub fn row(measured: &Measured) -> [String; COLUMNS.len()] {
    let score = &measured.score;
    let of = |errors: &Option<Errors>, value: fn(&Errors) -> f64| {
        errors
            .as_ref()
            .map_or(String::new(), |errors| format!("{:.3}", value(errors)))
    };
    let plain = |value: Option<f64>, digits: usize| {
        value.map_or(String::new(), |value| format!("{value:.digits$}"))
    };
    [
        score.kind.name().to_owned(),
        of(&score.dynamic, |errors| errors.average_nm),
        of(&score.dynamic, |errors| errors.rms_nm),
        of(&score.dynamic, |errors| errors.max_nm),
        of(&score.dynamic, |errors| errors.p95_nm),
        of(&score.static_load, |errors| errors.average_nm),
        of(&score.static_load, |errors| errors.rms_nm),
        of(&score.static_load, |errors| errors.max_nm),
        of(&score.reversals, |errors| errors.max_nm),
        plain(score.delay_ms, 2),
        plain(score.noise_nm, 4),
        score.drift.map_or(String::new(), |drift| {
            format!("{:.3} in {:.0} s", drift.change_nm, drift.over_s)
        }),
        score
            .coverage_95
            .map_or(String::new(), |share| format!("{:.1} %", 100.0 * share)),
        format!("{:.0}", measured.cost_ns),
    ]
}

/// One joint on one recording.
pub fn scores(compared: &JointCompared) -> String {
    let mut rows = table(&COLUMNS);
    let mut text = format!(
        "{}, {}: {} rows moving, {} standing\n",
        compared.recording.display(),
        compared.joint,
        compared.dynamic_rows,
        compared.static_rows
    );
    let (known, missing): (Vec<&Measured>, Vec<&Measured>) = compared
        .estimators
        .iter()
        .partition(|measured| measured.score.missing.is_none());
    known.into_iter().for_each(|measured| {
        rows.add_row(row(measured));
    });
    let _ = writeln!(text, "{rows}");
    for measured in missing {
        let why = measured.score.missing.as_deref().unwrap_or_default();
        let _ = writeln!(text, "{}: no estimate, {why}", measured.score.kind.name());
    }
    if !compared.not_calibrated.is_empty() {
        let names: Vec<&str> = compared
            .not_calibrated
            .iter()
            .map(|kind| kind.name())
            .collect();
        let _ = writeln!(
            text,
            "not in the robot file, `estimate calibrate` finds them: {}",
            names.join(", ")
        );
    }
    text
}
