//! Whether the fits can be trusted: errors on data they have not seen, and what they leave.

use identification::gravity::GravityFit;
use report::{Cell, Column, Section, Table, number};

use super::{JointResult, SIGNS, without};

/// Root mean square error at trials left out of the friction fit, as a share of the mean friction.
pub fn held_out_share(joint: &JointResult) -> Option<f64> {
    let friction = joint.friction.as_ref()?;
    let rms_nm = friction.model(friction.robot_model())?.held_out_rms_nm?;
    Some(rms_nm / mean_friction_nm(joint)?)
}

fn mean_friction_nm(joint: &JointResult) -> Option<f64> {
    let measurements = &joint.friction.as_ref()?.measurements;
    let sum_nm: f64 = measurements
        .iter()
        .map(|measurement| measurement.level_nm())
        .sum();
    (!measurements.is_empty()).then(|| sum_nm / measurements.len() as f64)
}

/// Errors on data that were left out of the fits.
pub fn held_out(joints: &[JointResult], gravity: Option<&GravityFit>) -> Section {
    let section = Section::new("held-out", "Held-out errors");
    let section = without(
        section,
        joints,
        |j| j.friction.is_some(),
        "Held-out friction error",
        "friction",
    );
    let mut table = Table::new(
        "Errors on data left out of the fit, root mean square",
        [
            Column::text("joint"),
            Column::number("mean friction, Nm"),
            Column::number("friction, trials left out, Nm"),
            Column::number("% of friction"),
            Column::number("gravity, poses left out, Nm"),
        ],
    );
    for joint in joints {
        let friction = joint.friction.as_ref();
        let rms_nm = friction.and_then(|fit| fit.model(fit.robot_model())?.held_out_rms_nm);
        let of_gravity = gravity.and_then(|fit| fit.joints.iter().find(|g| g.joint == joint.joint));
        table.row([
            joint.joint.as_str().into(),
            optional(mean_friction_nm(joint)),
            optional(rms_nm),
            optional(held_out_share(joint).map(|share| 100.0 * share)),
            optional(of_gravity.map(|fit| fit.held_out_rms_nm)),
        ]);
    }
    section.table(table)
}

/// What the fits leave of the data they were fitted to.
pub fn residuals(joints: &[JointResult]) -> Section {
    let mut table = Table::new(
        "Residuals by direction of motion",
        [
            Column::text("joint"),
            Column::text(""),
            Column::number("friction, χ² per freedom"),
            Column::number("friction, Nm rms"),
            Column::number("over position, Nm rms"),
            Column::number("over load, Nm rms"),
            Column::number("over load, samples"),
            Column::number("of which independent"),
        ],
    );
    for joint in joints {
        let friction = joint
            .friction
            .as_ref()
            .and_then(|fit| fit.model(fit.robot_model()));
        let friction = friction.map(|model| [&model.positive, &model.negative]);
        let periodic = joint
            .periodic
            .as_ref()
            .map(|fit| [&fit.positive, &fit.negative]);
        let load = joint
            .stiffness
            .as_ref()
            .map(|fit| [&fit.positive.law, &fit.negative.law]);
        for index in 0..2 {
            let law = load.map(|laws| laws[index]);
            table.row([
                if index == 0 { joint.joint.as_str() } else { "" }.into(),
                SIGNS[index].into(),
                optional(friction.and_then(|fits| fits[index].reduced_chi_squared)),
                optional(friction.map(|fits| fits[index].rms_nm)),
                optional(periodic.map(|fits| fits[index].residual_rms_nm)),
                optional(law.map(|law| law.residual_rms_nm)),
                law.map(|law| law.samples.to_string())
                    .unwrap_or_default()
                    .into(),
                optional(law.map(|law| law.samples as f64 / law.correlated_samples)),
            ]);
        }
    }
    Section::new("residuals", "Residual checks")
        .paragraph(
            "χ² per freedom is one where friction scatters about its model as much as trials scatter about their mean; \
             above one the model misses something, and standard errors are widened by its root. Successive samples \
             over load are alike; the last column says how many count.",
        )
        .table(table)
}

fn optional(value: Option<f64>) -> Cell {
    value
        .map(|value| number(value, 3))
        .unwrap_or_default()
        .into()
}
