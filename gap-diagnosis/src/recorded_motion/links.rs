//! Masses, centres and inertias of links where the file is wrong of them: what they do to each joint by name, and what they come to.

use gap_report::{DataFinding, LinkChange, NamedEffect, Parameter};
use nalgebra::DMatrix;
use robot::{Effect, Robot};

use super::joint::Joint;
use super::laws::Law;
use crate::evidence::ERRORS;
use crate::evidence::arm::{LINKS_WRONG, OF_LINK, Shared};
use crate::evidence::told;

/// What the links' values do to one joint, called by what comes nearest of what a link is to its own joint: weight, or inertia. No share
/// yet.
pub fn of_joint(joint: &Joint, links: &Shared, probability: f64) -> Option<NamedEffect> {
    let changes = matrix(&joint.rows.masses);
    let torque_nm = &changes * &links.said;
    let laws = [Law::Gravity, Law::LinkInertia, Law::Inertia];
    let fitted = laws.into_iter().filter_map(|law| {
        let columns = joint.rows.columns(law);
        let columns = (!columns.is_empty()).then(|| matrix(columns))?;
        let solved = (columns.transpose() * &columns).cholesky()?;
        let of_values = solved.solve(&(columns.transpose() * &changes));
        let amplitudes = &of_values * &links.said;
        let left = (&torque_nm - &columns * &amplitudes).norm_squared();
        Some((left, law, amplitudes, of_values))
    });
    let (_, law, amplitudes, of_values) = fitted.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let covariance = &of_values * &links.covariance * of_values.transpose();
    let effect = match law {
        Law::Gravity => Effect::GravityTorque {
            sin_nm: amplitudes[0],
            cos_nm: amplitudes[1],
        },
        _ => Effect::LinkInertia {
            inertia_kg_m2: amplitudes[0],
        },
    };
    let mut parameters = told::parameters(&effect);
    for (place, of) in effect.kind().parameters().iter().enumerate() {
        if let Some(parameter) = parameters.get_mut(of.name) {
            parameter.std = covariance[(place, place)].max(0.0).sqrt();
        }
    }
    Some(NamedEffect {
        effect: effect.name().to_owned(),
        probability,
        parameters,
        of_links: true,
        ..NamedEffect::default()
    })
}

fn matrix(columns: &[Vec<f64>]) -> DMatrix<f64> {
    let rows = columns.first().map_or(0, Vec::len);
    DMatrix::from_fn(rows, columns.len(), |row, column| columns[column][row])
}

/// What the links' values come to, link by link.
pub fn changes(robot: &Robot, links: &Shared) -> Vec<LinkChange> {
    let chain = super::dynamics::chain(robot);
    let both = chain.links().iter().zip(&robot.joints);
    both.enumerate()
        .map(|(index, (link, joint))| {
            let value = |place: usize, unit: f64| {
                let at = OF_LINK * index + place;
                Parameter {
                    value: unit * links.said[at],
                    std: unit * links.covariance[(at, at)].max(0.0).sqrt(),
                    at_bound: false,
                }
            };
            let mass_kg = value(0, LINKS_WRONG * link.mass_kg);
            // torques are linear in mass and first moment
            let heavier = 1.0 + mass_kg.value / link.mass_kg.max(f64::MIN_POSITIVE);
            let moved_m = LINKS_WRONG * link.centre_of_mass_m.norm();
            let along_m = moved_m / heavier.max(f64::EPSILON);
            LinkChange {
                joint: joint.name.clone(),
                mass_kg,
                centre_of_mass_m: [1, 2, 3].map(|place| value(place, along_m)),
                inertia_part: value(OF_LINK - 1, LINKS_WRONG),
            }
        })
        .collect()
}

/// That the file's masses are wrong, and by what.
pub fn note(robot: &Robot, changes: &[LinkChange], nats: f64) -> DataFinding {
    let is_certain = |of: &Parameter| of.value.abs() > ERRORS * of.std;
    let chain = super::dynamics::chain(robot);
    let both = chain.links().iter().zip(changes);
    let told: Vec<String> = both
        .filter_map(|(link, change)| {
            let mut parts = Vec::new();
            let mass = &change.mass_kg;
            if is_certain(mass) {
                let [before, after] = [link.mass_kg, link.mass_kg + mass.value];
                parts.push(format!("{before:.3} -> {after:.3} kg (± {:.3})", mass.std));
            }
            for (axis, of) in ["x", "y", "z"].iter().zip(&change.centre_of_mass_m) {
                if is_certain(of) {
                    let [mm, std_mm] = [of.value, of.std].map(|m| 1e3 * m);
                    parts.push(format!("centre {mm:+.0} mm along {axis} (± {std_mm:.0})"));
                }
            }
            let inertia = &change.inertia_part;
            if is_certain(inertia) {
                parts.push(format!(
                    "inertia {:+.0} % (± {:.0})",
                    100.0 * inertia.value,
                    100.0 * inertia.std
                ));
            }
            (!parts.is_empty()).then(|| format!("{}: {}", change.joint, parts.join(", ")))
        })
        .collect();
    let tolerance = robot.tolerance.of("mass_kg");
    let told = if told.is_empty() {
        "No value by itself is certain".to_owned()
    } else {
        format!("Of the link behind each joint: {}", told.join("; "))
    };
    DataFinding {
        joint: None,
        severity: "warning".to_owned(),
        what: format!(
            "links weigh other than the file says: beyond parameter_tolerance = {tolerance} their masses, centres and inertias explain all \
             joints better, by {nats:.0} nats. {told}. Torques tell sums over several links, so others may be wrong instead"
        ),
        remedy: "measure the links, or ask the maker; `flexspline gap apply` writes the values that the report's `links` have"
            .to_owned(),
    }
}

/// The links' values among what the arm shares.
pub fn among(shared: &[Shared]) -> Option<(usize, &Shared)> {
    let mut all = shared.iter().enumerate();
    all.find(|(_, shared)| shared.cause.is_of_links())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn links_of_which_no_value_is_certain_are_told_without_a_list() {
        let robot = robot::load("shd17").unwrap();
        let told = |value: f64| {
            let parameter = Parameter {
                value,
                std: 1.0,
                at_bound: false,
            };
            let change = LinkChange {
                joint: robot.joints[0].name.clone(),
                mass_kg: parameter,
                centre_of_mass_m: [parameter; 3],
                inertia_part: parameter,
            };
            note(&robot, &[change], 9.0).what
        };
        assert!(
            told(0.1).contains("nats. No value by itself is certain. "),
            "{}",
            told(0.1)
        );
        assert!(told(4.0).contains("each joint: ") && told(4.0).contains("inertia +400 %"));
    }
}
