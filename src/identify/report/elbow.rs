//! PA10-03's figures of the elbow that have no counterpart among PA10-05's: torque by weight, and T_c over external
//! torque.

use identification::stiffness::{DirectionFit, StiffnessFit, SweepSteps};
use report::{Axis, Figure, Panel, Section, Series};

use super::load::{directions, payload, with_unmoved, zipped};
use super::{DIRECTIONS, JointResult};

pub fn section(joint: &JointResult) -> Section {
    let section = Section::new("elbow", format!("The elbow alone: {}", joint.joint)).paragraph(
        "PA10-03 identifies this joint only. Its Fig. 4 (friction over velocity) and Fig. 6 (successive subtraction) are \
         those of this joint above; the other two follow.",
    );
    match &joint.stiffness {
        Some(fit) => with_unmoved(section, fit)
            .figure(weights(fit))
            .figure(external(fit)),
        None => {
            section.paragraph("They need the torque over gravity load, which was not identified.")
        }
    }
}

fn weights(fit: &StiffnessFit) -> Figure {
    let figure = Figure::new(
        "Torque of slow motion at constant velocity with weights (PA10-03, Fig. 5): motor torque times gear ratio over \
         joint angle.",
    );
    panels(figure, fit, |direction, title| {
        let panel =
            Panel::new(Axis::new("joint angle", "rad"), Axis::new("torque", "Nm")).title(title);
        direction.steps.iter().fold(panel, |panel, steps| {
            panel.series(Series::line(
                payload(steps),
                zipped(&steps.position_rad, &steps.total_nm),
            ))
        })
    })
}

fn external(fit: &StiffnessFit) -> Figure {
    let figure = Figure::new(
        "T_c over external torque (PA10-03, Fig. 7), which is gravity torque plus mean friction, for each weight.",
    );
    panels(figure, fit, |direction, title| {
        let panel =
            Panel::new(Axis::new("external torque", "Nm"), Axis::new("T_c", "Nm")).title(title);
        direction.steps.iter().fold(panel, |panel, steps| {
            let friction_nm = mean_friction_nm(steps);
            let external_nm: Vec<f64> =
                steps.gravity_nm.iter().map(|nm| nm + friction_nm).collect();
            panel.series(Series::points(
                payload(steps),
                zipped(&external_nm, &steps.load_torque_nm),
            ))
        })
    })
}

/// About the joint's axis: positive in the positive direction of motion.
fn mean_friction_nm(steps: &SweepSteps) -> f64 {
    let pairs = steps.total_nm.iter().zip(&steps.without_friction_nm);
    pairs
        .map(|(total_nm, without_nm)| total_nm - without_nm)
        .sum::<f64>()
        / steps.total_nm.len().max(1) as f64
}

fn panels(
    figure: Figure,
    fit: &StiffnessFit,
    panel: impl Fn(&DirectionFit, &str) -> Panel,
) -> Figure {
    let figure = figure.columns(2).panel_height(300);
    let both = directions(fit).into_iter().zip(DIRECTIONS);
    both.fold(figure, |figure, (direction, title)| {
        figure.panel(panel(direction, title))
    })
}
