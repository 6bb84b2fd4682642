//! Masses, centres and inertias of links where the file is wrong of them, or where they lie within its tolerance: what they do to each
//! joint by name, and what they come to.

use gap_report::{DataFinding, LinkChange, NamedEffect, Parameter};
use joint_twin::on_all_cores::OnAllCores;
use nalgebra::{DMatrix, DVector};
use robot::{Effect, Robot};

use super::joint::{Joint, Searched};
use super::laws::Law;
use super::shared::Prior;
use crate::evidence::arm::{self, Cause, LINKS_WRONG, OF_LINK, ROUNDS, Shared};
use crate::evidence::told;
use crate::evidence::{ERRORS, Message};

/// What the links' values within their tolerance come to where all joints have the same.
pub struct WithinTolerance {
    /// The values.
    pub links: Shared,
    /// Every joint's sets beside them; none where a joint has no say.
    pub with: Vec<Option<Searched>>,
}

/// One estimate of the links' values within their tolerance for all joints, which share no other cause: each by itself moves them as it
/// needs. `alone`: what each tells by itself.
pub fn within_tolerance(
    robot: &Robot,
    joints: &[Joint],
    alone: &[Searched],
) -> Option<WithinTolerance> {
    let cause = Cause::Masses(robot.chain.joint_count());
    let of_tolerance = of_tolerance(robot);
    let prior = |joint: &Joint, message: Message| Prior {
        causes: &[],
        columns: joint.of_arm(cause).to_vec(),
        has_links: true,
        message,
    };
    // a torque that its masses do not need tells nothing of them
    let says = |joint: &Joint| joint.misfit.is_none() && !joint.of_arm(cause).is_empty();
    let mut own: Vec<Option<Message>> = joints
        .iter()
        .zip(alone)
        .on_all_cores(|(joint, alone)| {
            let evidence = || joint.evidence(Some(&prior(joint, of_tolerance.clone())));
            says(joint).then(|| evidence().message(alone.sets[0].names))?
        })
        .collect();
    let mut found = None;
    for _ in 0..ROUNDS {
        let whole = arm::all(&of_tolerance, &own);
        let mut of_bodies = whole.clone();
        of_bodies.hold_within_bodies(&[cause], whole);
        let (said, covariance) = of_bodies.said()?;
        // names, and what they come to, are those of a file that has the values
        let precision = DMatrix::identity(said.len(), said.len()) / f64::EPSILON.sqrt();
        let held = Message {
            pull: &precision * &said,
            precision,
        };
        let with: Vec<Option<Searched>> = joints
            .iter()
            .on_all_cores(|joint| {
                says(joint).then(|| joint.searched(Some(&prior(joint, held.clone()))))
            })
            .collect();
        own = with
            .iter()
            .on_all_cores(|searched| {
                let searched = searched.as_ref()?;
                searched.evidence.message(searched.sets[0].names)
            })
            .collect();
        let links = Shared {
            cause,
            said,
            covariance,
        };
        found = Some(WithinTolerance { links, with });
    }
    found
}

/// What is known of the links' values by the robot file's tolerance, in the deviations that they have where the file is wrong.
fn of_tolerance(robot: &Robot) -> Message {
    let of = |name| robot.tolerance.of(name) / LINKS_WRONG;
    let chain = super::dynamics::chain(robot);
    let deviations = chain.links().iter().flat_map(|link| {
        let centre_m = link.centre_of_mass_m;
        let part = centre_m.try_normalize(f64::MIN_POSITIVE);
        let along = part.unwrap_or_default() * of("centre_of_mass_m");
        let mass = of("mass_kg");
        [
            mass,
            along.x.abs(),
            along.y.abs(),
            along.z.abs(),
            of("inertia_kg_m2"),
        ]
    });
    // a value without a tolerance is held
    let precision = deviations.map(|deviation| deviation.max(f64::EPSILON.sqrt()).powi(-2));
    let precision = DVector::from_iterator(OF_LINK * chain.joint_count(), precision);
    Message {
        pull: DVector::zeros(precision.len()),
        precision: DMatrix::from_diagonal(&precision),
    }
}

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
