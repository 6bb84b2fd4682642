//! The tables that `identify` prints: Tables I, II, III and V for this robot, its gravity, and what the model is worth.

use std::fmt::Write;

use comfy_table::{CellAlignment, Table, presets};
use identification::Estimate;
use identification::experiment::HELD_OUT_RAD_S;
use identification::friction::{DirectionFit, FrictionModel, JointFriction};
use identification::gravity::GravityFit;
use identification::periodic::PeriodicAnalysis;
use identification::stiffness::StiffnessFit;
use robot::{Robot, StribeckRow};

use super::{HeldOut, Identified};

/// Everything as text.
pub fn text(identified: &Identified, robot: &Robot) -> String {
    let mut text = String::new();
    let frictions: Vec<&JointFriction> = identified
        .joints
        .iter()
        .filter_map(|joint| joint.friction.as_ref())
        .collect();
    let periodics: Vec<&PeriodicAnalysis> = identified
        .joints
        .iter()
        .filter_map(|joint| joint.periodic.as_ref())
        .collect();
    // Writing to a string cannot fail.
    if !frictions.is_empty() {
        let _ = writeln!(
            text,
            "Friction models (PA10-05, Table I): weighted residual variance, MSE per degree of freedom, held-out rms"
        );
        let _ = writeln!(text, "{}", comparison(&frictions));
        let _ = writeln!(
            text,
            "Friction as the robot file takes it (Table II), standard errors after ±, the file's own values below"
        );
        let _ = writeln!(text, "{}", values(&frictions, robot));
        for friction in &frictions {
            let _ = writeln!(text, "{}: {}", friction.joint, friction.reason);
            for finding in &friction.findings {
                let _ = writeln!(text, "  {finding}");
            }
        }
    }
    if !periodics.is_empty() {
        let _ = writeln!(
            text,
            "Position-dependent friction (Table III), both directions together"
        );
        let _ = writeln!(text, "{}", harmonics(&periodics));
    }
    let stiffnesses: Vec<&StiffnessFit> = identified
        .joints
        .iter()
        .filter_map(|joint| joint.stiffness.as_ref())
        .collect();
    if !stiffnesses.is_empty() {
        let _ = writeln!(
            text,
            "Torque over gravity load (Table V), by direction of motion"
        );
        let _ = writeln!(text, "{}", load_torques(&stiffnesses));
    }
    if let Some(gravity) = &identified.gravity {
        let _ = writeln!(text, "Gravity, from slow motion with known payloads");
        let _ = writeln!(text, "{}", gravity_torques(gravity));
        let _ = writeln!(text, "{}", identifiable(gravity));
        let _ = writeln!(
            text,
            "{} directions of masses and centres change no torque of these motions; there the file's values stay",
            gravity.unseen.len()
        );
    }
    if identified
        .joints
        .iter()
        .any(|joint| joint.held_out.is_some())
    {
        let _ = writeln!(
            text,
            "Motion that was not fitted, at {} rad/s: error of the predicted torque",
            HELD_OUT_RAD_S
                .map(|speed_rad_s| speed_rad_s.to_string())
                .join(", ")
        );
        let _ = writeln!(text, "{}", held_out(identified));
    }
    let of_joints = identified.joints.iter().flat_map(|joint| &joint.findings);
    for finding in of_joints.chain(&identified.findings) {
        let _ = writeln!(text, "{finding}");
    }
    let _ = writeln!(text, "robot file: {}", identified.robot_file.display());
    text
}

fn comparison(frictions: &[&JointFriction]) -> Table {
    let mut table = new_table(&[
        "joint",
        "model",
        "variance",
        "MSE per DOF",
        "held-out rms, Nm",
        "BIC",
        "",
    ]);
    for friction in frictions {
        for model in &friction.models {
            let chosen = if model.model == friction.chosen {
                "chosen"
            } else {
                ""
            };
            table.add_row([
                friction.joint.clone(),
                model.model.name().to_owned(),
                format!("{:.2}", model.weighted_residual_variance),
                optional(model.mse_per_dof, 2),
                optional(model.held_out_rms_nm, 3),
                format!("{:.1}", model.bic),
                chosen.to_owned(),
            ]);
        }
    }
    aligned(table, 2)
}

fn values(frictions: &[&JointFriction], robot: &Robot) -> Table {
    let mut table = new_table(&["joint", "", "F0, Nm", "Fv, Nm s/rad", "Fs, Nm", "Vc, rad/s"]);
    for friction in frictions {
        let Some(comparison) = friction.model(friction.robot_model()) else {
            continue;
        };
        let known = robot
            .joint_index(&friction.joint)
            .and_then(|index| robot.joints[index].direction_friction.as_ref());
        for (sign, fit, known) in [
            ("+", &comparison.positive, known.map(|known| known.positive)),
            ("-", &comparison.negative, known.map(|known| known.negative)),
        ] {
            table.add_row(fitted_row(&friction.joint, sign, fit));
            if let Some(row) = known {
                table.add_row(known_row(&row));
            }
        }
    }
    aligned(table, 2)
}

fn fitted_row(joint: &str, sign: &str, fit: &DirectionFit) -> Vec<String> {
    let mut row = vec![joint.to_owned(), sign.to_owned()];
    for symbol in FrictionModel::Stribeck
        .symbols()
        .iter()
        .map(|(symbol, _)| symbol)
    {
        row.push(fit.parameter(symbol).map_or("-".to_owned(), |parameter| {
            let error = optional(parameter.standard_error, 4);
            let bound = if parameter.at_bound { " (bound)" } else { "" };
            format!("{:.4} ± {error}{bound}", parameter.value)
        }));
    }
    row
}

fn known_row(row: &StribeckRow) -> Vec<String> {
    let value = |value: f64| format!("{value:.4}");
    vec![
        String::new(),
        "file".to_owned(),
        value(row.f0_nm),
        value(row.fv_nm_s_rad),
        value(row.fs_nm),
        value(row.vc_rad_s),
    ]
}

fn harmonics(periodics: &[&PeriodicAnalysis]) -> Table {
    let mut table = new_table(&[
        "joint",
        "cycles per motor revolution",
        "per joint radian",
        "amplitude, Nm",
        "phase, rad",
        "rms before, Nm",
        "after, Nm",
    ]);
    for periodic in periodics {
        let rms = |pick: fn(&identification::periodic::DirectionAnalysis) -> f64| {
            let (positive, negative) = (pick(&periodic.positive), pick(&periodic.negative));
            format!(
                "{:.3}",
                (0.5 * (positive * positive + negative * negative)).sqrt()
            )
        };
        for (index, harmonic) in periodic.combined.iter().enumerate() {
            let first = index == 0;
            table.add_row([
                if first {
                    periodic.joint.clone()
                } else {
                    String::new()
                },
                format!("{:.3}", harmonic.cycles_per_motor_rev),
                format!("{:.2}", harmonic.cycles_per_joint_rad),
                format!(
                    "{:.3} ± {:.3}",
                    harmonic.amplitude_nm, harmonic.amplitude_standard_error_nm
                ),
                format!("{:.2}", harmonic.phase_rad),
                if first {
                    rms(|analysis| analysis.rms_nm)
                } else {
                    String::new()
                },
                if first {
                    rms(|analysis| analysis.residual_rms_nm)
                } else {
                    String::new()
                },
            ]);
        }
    }
    aligned(table, 1)
}

fn load_torques(stiffnesses: &[&StiffnessFit]) -> Table {
    let mut table = new_table(&[
        "joint",
        "",
        "slopes, Nm/Nm",
        "knees, Nm",
        "at no load, Nm",
        "residual rms, Nm",
    ]);
    for fit in stiffnesses {
        for (sign, direction) in [("+", &fit.positive), ("-", &fit.negative)] {
            let law = &direction.law;
            let slopes: Vec<String> = law
                .slopes
                .iter()
                .map(|slope| format!("{:.3} ± {:.3}", slope.value, slope.standard_error))
                .collect();
            let knees: Vec<String> = law
                .knees
                .iter()
                .map(|knee| {
                    let bound = if knee.at_bound { " (bound)" } else { "" };
                    let Estimate {
                        value,
                        standard_error,
                    } = knee.gravity_nm;
                    format!("{value:.2} ± {standard_error:.2}{bound}")
                })
                .collect();
            table.add_row([
                fit.joint.clone(),
                sign.to_owned(),
                slopes.join(", "),
                knees.join(", "),
                format!("{:.2}", law.zero_load_nm.value),
                format!("{:.3}", law.residual_rms_nm),
            ]);
        }
    }
    aligned(table, 2)
}

fn gravity_torques(gravity: &GravityFit) -> Table {
    let mut table = new_table(&[
        "joint",
        "mass, kg",
        "file",
        "centre, m",
        "file",
        "rms with the file, Nm",
        "fitted, Nm",
        "poses left out, Nm",
    ]);
    for (link, joint) in gravity.links.iter().zip(&gravity.joints) {
        let centre_m = link.centre_of_mass_m.map(|component| component.value);
        table.add_row([
            link.joint.clone(),
            format!(
                "{:.3} ± {:.3}",
                link.mass_kg.value, link.mass_kg.standard_error
            ),
            format!("{:.3}", link.file_mass_kg),
            vector(&centre_m),
            vector(&link.file_centre_of_mass_m),
            format!("{:.3}", joint.file_rms_nm),
            format!("{:.3}", joint.fitted_rms_nm),
            format!("{:.3}", joint.held_out_rms_nm),
        ]);
    }
    aligned(table, 1)
}

fn vector(values: &[f64; 3]) -> String {
    values.map(|value| format!("{value:.4}")).join(", ")
}

fn identifiable(gravity: &GravityFit) -> Table {
    let mut table = new_table(&["what these motions determine", "file", "fitted", ""]);
    for sum in &gravity.identifiable {
        table.add_row([
            sum.words.clone(),
            format!("{:.4}", sum.file_value),
            format!("{:.4} ± {:.4}", sum.fitted.value, sum.fitted.standard_error),
            sum.unit.to_owned(),
        ]);
    }
    aligned(table, 1)
}

fn held_out(identified: &Identified) -> Table {
    let mut table = new_table(&[
        "joint",
        "friction, Nm",
        "rms with the file, Nm",
        "of friction",
        "identified, Nm",
        "of friction",
    ]);
    for joint in &identified.joints {
        if let Some(HeldOut { file, identified }) = &joint.held_out {
            table.add_row([
                joint.joint.clone(),
                format!("{:.2}", identified.mean_friction_nm),
                format!("{:.3}", file.rms_nm),
                format!("{:.1} %", 100.0 * file.share),
                format!("{:.3}", identified.rms_nm),
                format!("{:.1} %", 100.0 * identified.share),
            ]);
        }
    }
    aligned(table, 1)
}

fn new_table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::UTF8_HORIZONTAL_ONLY)
        .set_header(header);
    table
}

/// Numbers to the right, from this column on.
fn aligned(mut table: Table, from: usize) -> Table {
    for column in table.column_iter_mut().skip(from) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn optional(value: Option<f64>, digits: usize) -> String {
    value.map_or("-".to_owned(), |value| format!("{value:.digits$}"))
}
