//! The paper's numbers and claims, and what was wanted beyond them, each with the numbers that decide it.

use estimators::Kind;
use estimators::compare::Errors;
use report::number;
use serde::Serialize;

use crate::estimate::compare::Measured;
use crate::reproduce::sheet::{Sheet, mean_and_range};

/// A statement, and whether the second data set of one joint bears it out.
#[derive(Clone, Debug, Serialize)]
pub struct Statement {
    /// Whose: the paper's claim or number, or a target of ours.
    pub source: &'static str,
    /// What is said.
    pub said: String,
    /// Of the numbers.
    pub unit: &'static str,
    /// Here.
    pub value: f64,
    /// Between which the value must lie.
    pub limits: [f64; 2],
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

/// What the scores say; and how small structural damping's maximum can be with any parameters.
pub fn judge(estimators: &[Measured], least_maximum_nm: Option<f64>) -> Vec<Statement> {
    let score = |kind: Kind| estimators.iter().find(|found| found.score.kind == kind);
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
    statements.extend(least_maximum_nm.map(|least_nm| {
        less(
            NUMBER,
            "structural damping: maximum error in motion, parameters chosen on the judged data itself",
            least_nm,
            PUBLISHED_STRUCTURAL_DAMPING_NM[0],
        )
    }));
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
        Statement::new(
            TARGET,
            "fusion: errors within 1.96 standard deviations",
            "%",
            coverage.map_or(f64::NAN, |share| 100.0 * share),
            [92.0, 98.0],
        ),
    ]);
    statements
}

fn less(source: &'static str, said: &str, value_nm: f64, limit_nm: f64) -> Statement {
    Statement::new(source, said, "Nm", value_nm, [0.0, limit_nm])
}

impl Statement {
    fn new(
        source: &'static str,
        said: &str,
        unit: &'static str,
        value: f64,
        limits: [f64; 2],
    ) -> Self {
        let [low, high] = limits;
        Self {
            source,
            said: said.to_owned(),
            unit,
            value,
            limits,
            holds: (low..=high).contains(&value),
        }
    }
}

/// What all joints say: statements down, their mean and range across.
pub fn sheet(joints: &[&[Statement]]) -> Sheet {
    let columns = ["", "statement", "here", "wanted", "holds on"];
    let mut sheet = Sheet::new(
        "Claims, numbers and targets on the second data set",
        columns,
    );
    sheet.words = 2;
    let first = joints.first().copied().unwrap_or_default();
    for (place, statement) in first.iter().enumerate() {
        let of = |value: &dyn Fn(&Statement) -> f64| -> Vec<f64> {
            joints.iter().map(|all| value(&all[place])).collect()
        };
        let highest = mean_and_range(&of(&|statement| statement.limits[1]), 3);
        let wanted = match statement.limits[0] {
            0.0 => format!("at most {highest}"),
            low => format!("{} to {highest}", number(low, 3)),
        };
        let holding = joints.iter().filter(|all| all[place].holds).count();
        let here = mean_and_range(&of(&|statement| statement.value), 3);
        sheet.rows.push(vec![
            statement.source.to_owned(),
            statement.said.clone(),
            format!("{here} {}", statement.unit),
            wanted,
            format!("{holding} of {}", joints.len()),
        ]);
    }
    sheet.notes.push(
        "SD also claims fewer parameters, three against six and a kinematic error, and no need of motor torque: both lie in \
         the method and need no data."
            .to_owned(),
    );
    sheet
}
