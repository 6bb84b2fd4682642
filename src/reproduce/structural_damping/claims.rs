//! The paper's numbers and claims, and what was wanted beyond them, each with the numbers that decide it.

use std::fmt::Write;

use estimators::Kind;
use estimators::compare::Errors;
use report::{Column, Section, Table};
use serde::Serialize;

use crate::estimate::compare::JointCompared;

/// A statement and whether the second data set bears it out.
#[derive(Clone, Debug, Serialize)]
pub struct Statement {
    /// Whose: the paper's claim, or a target of ours.
    pub source: &'static str,
    /// What is said.
    pub said: String,
    /// The numbers here.
    pub found: String,
    /// Whether it holds here.
    pub holds: bool,
}

/// SD, section IV.B: largest error and magnitude of the average error on the second data set.
const PUBLISHED_STRUCTURAL_DAMPING_NM: [f64; 2] = [2.3, 0.05];
/// The same of the compliance method.
const PUBLISHED_COMPLIANCE_NM: [f64; 2] = [3.7, 0.6];

const CLAIM: &str = "SD's claim";
const NUMBER: &str = "SD's number";
const TARGET: &str = "target";

/// What the scores say.
pub fn judge(compared: &JointCompared) -> Vec<Statement> {
    let score = |kind: Kind| {
        compared
            .estimators
            .iter()
            .find(|found| found.score.kind == kind)
    };
    let dynamic = |kind| score(kind).and_then(|found| found.score.dynamic);
    let standing = |kind| score(kind).and_then(|found| found.score.static_load);
    let rms = |errors: Option<Errors>| errors.map_or(f64::NAN, |errors| errors.rms_nm);
    let (damping, compliance) = (Kind::StructuralDamping, Kind::Compliance);
    let mut statements = vec![
        less(
            CLAIM,
            "structural damping is better than compliance in dynamic load, rms",
            rms(dynamic(damping)),
            rms(dynamic(compliance)),
        ),
        less(
            CLAIM,
            "compliance is better than structural damping in static load, rms",
            rms(standing(compliance)),
            rms(standing(damping)),
        ),
    ];
    for (kind, [max_nm, average_nm]) in [
        (damping, PUBLISHED_STRUCTURAL_DAMPING_NM),
        (compliance, PUBLISHED_COMPLIANCE_NM),
    ] {
        let errors = dynamic(kind);
        let name = kind.name();
        let of = |value: fn(Errors) -> f64| errors.map_or(f64::NAN, value);
        statements.push(less(
            NUMBER,
            &format!("{name}: average error in motion"),
            of(|errors| errors.average_nm.abs()),
            average_nm,
        ));
        statements.push(less(
            NUMBER,
            &format!("{name}: maximum error in motion"),
            of(|errors| errors.max_nm),
            max_nm,
        ));
    }
    let best = |phase: &dyn Fn(Kind) -> Option<Errors>| {
        let all = Kind::PUBLISHED.into_iter().map(|kind| rms(phase(kind)));
        all.fold(f64::INFINITY, f64::min)
    };
    let coverage = score(Kind::Fusion).and_then(|found| found.score.coverage_95);
    let max_nm = score(Kind::Fusion)
        .and_then(|found| found.score.all)
        .map_or(f64::NAN, |errors| errors.max_nm);
    statements.extend([
        less(
            TARGET,
            "fusion in motion, rms, at most half of the best of the five",
            rms(dynamic(Kind::Fusion)),
            0.5 * best(&dynamic),
        ),
        less(
            TARGET,
            "fusion standing, rms, at most the best of the five",
            rms(standing(Kind::Fusion)),
            best(&standing),
        ),
        less(TARGET, "fusion: maximum error", max_nm, 1.0),
        Statement {
            source: TARGET,
            said: "fusion: 92 to 98 % of the errors within 1.96 standard deviations".to_owned(),
            found: coverage.map_or("no estimate".to_owned(), |share| {
                format!("{:.1} %", 100.0 * share)
            }),
            holds: coverage.is_some_and(|share| (0.92..=0.98).contains(&share)),
        },
    ]);
    statements
}

fn less(source: &'static str, said: &str, value_nm: f64, limit_nm: f64) -> Statement {
    Statement {
        source,
        said: said.to_owned(),
        found: format!("{value_nm:.3} Nm against {limit_nm:.3} Nm"),
        holds: value_nm <= limit_nm,
    }
}

fn verdict(statement: &Statement) -> &'static str {
    if statement.holds {
        "holds"
    } else {
        "does not hold"
    }
}

/// Line by line.
pub fn text(statements: &[Statement]) -> String {
    let mut text = String::new();
    for statement in statements {
        let _ = writeln!(
            text,
            "{}: {}: {}, {}",
            statement.source,
            statement.said,
            statement.found,
            verdict(statement)
        );
    }
    text
}

/// The same for the page.
pub fn section(statements: &[Statement]) -> Section {
    let columns = ["source", "statement", "here", "verdict"].map(Column::text);
    let mut table = Table::new(
        "Claims, numbers and targets on the second data set",
        columns,
    );
    for statement in statements {
        table.row([
            statement.source.into(),
            statement.said.as_str().into(),
            statement.found.as_str().into(),
            verdict(statement).into(),
        ]);
    }
    Section::new("claims", "What holds here")
        .paragraph(
            "SD also claims fewer parameters, three against six and a kinematic error, and no need of motor torque: both lie in \
             the method and need no data.",
        )
        .table(table)
}
