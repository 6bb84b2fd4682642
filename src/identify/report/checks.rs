//! Whether the fits can be trusted: errors on data they have not seen, and what they leave.

use identification::gravity::GravityFit;
use report::{Cell, Column, Section, Table, number};

use super::{JointResult, SIGNS, without};

/// Root mean square error at motion that was never fitted, as a share of the mean friction.
pub fn held_out_share(joint: &JointResult) -> Option<f64> {
    Some(joint.held_out.as_ref()?.identified.share)
}

/// Errors on data that were left out of the fits.
pub fn held_out(joints: &[JointResult], gravity: Option<&GravityFit>) -> Section {
    let section = Section::new("held-out", "Held-out errors").paragraph(
        "Motion at speeds between those of the friction experiments is recorded and never fitted; the torque it takes is \
         predicted from gravity and all friction of the robot file. Trials and poses left out of a fit and predicted \
         by the rest say whether that fit repeats itself.",
    );
    let section = without(
        section,
        joints,
        |j| j.held_out.is_some(),
        "The error on motion never fitted",
        "all",
    );
    let mut table = Table::new(
        "Errors on data left out of the fits, root mean square",
        [
            Column::text("joint"),
            Column::number("mean friction, Nm"),
            Column::number("motion never fitted, Nm"),
            Column::number("% of friction"),
            Column::number("by the file before, Nm"),
            Column::number("friction, trials left out, Nm"),
            Column::number("gravity, poses left out, Nm"),
        ],
    );
    for joint in joints {
        let friction = joint.friction.as_ref();
        let trials_nm = friction.and_then(|fit| fit.model(fit.robot_model())?.held_out_rms_nm);
        let of_gravity = gravity.and_then(|fit| fit.joints.iter().find(|g| g.joint == joint.joint));
        let motion = joint.held_out.as_ref();
        table.row([
            joint.joint.as_str().into(),
            optional(motion.map(|error| error.identified.mean_friction_nm)),
            optional(motion.map(|error| error.identified.rms_nm)),
            optional(held_out_share(joint).map(|share| 100.0 * share)),
            optional(motion.map(|error| error.file.rms_nm)),
            optional(trials_nm),
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
