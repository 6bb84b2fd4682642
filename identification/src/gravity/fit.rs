//! What a gravity fit says: links, what is identifiable, errors per joint.

use joint_model::rigid_body::{Chain, ChainError};
use nalgebra::{Isometry3, Vector3};
use robot::{LinkFile, Robot};
use serde::Serialize;

use crate::Estimate;

/// Masses and centres of mass from measured gravity torques.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GravityFit {
    /// The links, base to tip, as the data change them.
    pub links: Vec<FittedLink>,
    /// Combinations of masses and first moments that the data determine better than the robot file does; as many as
    /// the rank.
    pub identifiable: Vec<Combination>,
    /// Directions in the space of all parameters that the data cannot see: the parameters may change in these
    /// proportions and every torque stays. Here the robot file's values are kept.
    pub unseen: Vec<UnseenDirection>,
    /// The joints, base to tip.
    pub joints: Vec<JointGravity>,
}

/// One link with the values that reproduce the fitted torques.
///
/// Masses and centres are not identifiable one by one; these are the ones closest to the robot file's. A standard error
/// holds what the data leave open and, in the directions they do not see, the robot file's own tolerance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FittedLink {
    /// Name of the joint that carries the link.
    pub joint: String,
    /// Mass.
    pub mass_kg: Estimate,
    /// Centre of mass in the joint frame.
    pub centre_of_mass_m: [Estimate; 3],
    /// Mass times centre of mass, the parameter of the fit.
    pub first_moment_kg_m: [Estimate; 3],
    /// Mass in the robot file.
    pub file_mass_kg: f64,
    /// Centre of mass in the robot file.
    pub file_centre_of_mass_m: [f64; 3],
}

/// What a parameter of the fit is: a link's mass, or a component of its first moment in the joint frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Mass, kg.
    Mass,
    /// Mass times the centre's x, kg m.
    MomentX,
    /// Mass times the centre's y, kg m.
    MomentY,
    /// Mass times the centre's z, kg m.
    MomentZ,
}

/// One parameter with its coefficient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Term {
    /// Name of the joint that carries the link.
    pub joint: String,
    /// Which of the link's parameters.
    pub quantity: Quantity,
    /// Its factor; the first term's is 1.
    pub coefficient: f64,
}

/// A sum of parameters that the data determine: one base parameter.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Combination {
    /// The sum in words, such as `m·c_x of joint1 + 0.45·m of joint2`.
    pub words: String,
    /// The sum.
    pub terms: Vec<Term>,
    /// `kg m` or `kg`, the unit of the first term.
    pub unit: &'static str,
    /// Its value in the robot file.
    pub file_value: f64,
    /// Its value from the data.
    pub fitted: Estimate,
}

/// Parameters that may change together unseen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnseenDirection {
    /// The proportions in words.
    pub words: String,
    /// The proportions.
    pub terms: Vec<Term>,
}

/// How well one joint's gravity torque is known. Root mean squares over its poses, joint side.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointGravity {
    /// The joint's name.
    pub joint: String,
    /// Residual with the robot file's masses and centres.
    pub file_rms_nm: f64,
    /// Residual with the fitted ones.
    pub fitted_rms_nm: f64,
    /// Residual at poses left out of the fit, with the robot file's masses and centres.
    pub held_out_file_rms_nm: f64,
    /// Residual at poses left out of the fit.
    pub held_out_rms_nm: f64,
    /// For plots, one value per pose: the joint's angle, ...
    pub position_rad: Vec<f64>,
    /// ... torque without friction, ...
    pub measured_nm: Vec<f64>,
    /// ... gravity torque of the robot file, ...
    pub file_nm: Vec<f64>,
    /// ... and the fitted gravity torque.
    pub fitted_nm: Vec<f64>,
}

impl GravityFit {
    /// How many combinations of masses and first moments the data determine.
    pub fn rank(&self) -> usize {
        self.identifiable.len()
    }

    /// Writes the fitted masses and centres into the `[[link]]` tables of the same joints; other keys stay.
    pub fn apply(&self, links: &mut [LinkFile]) {
        for link in links {
            if let Some(fitted) = self.links.iter().find(|fitted| fitted.joint == link.joint) {
                link.mass_kg = fitted.mass_kg.value;
                link.centre_of_mass_m = fitted.centre_m();
            }
        }
    }

    /// The robot's chain with the fitted masses and centres, without a tool frame.
    ///
    /// # Errors
    /// [`ChainError`] if the robot has another number of links than the fit.
    pub fn chain(&self, robot: &Robot) -> Result<Chain, ChainError> {
        let mut links = robot.chain.links().to_vec();
        if links.len() != self.links.len() {
            return Err(ChainError::JointCount { found: links.len() });
        }
        for (link, fitted) in links.iter_mut().zip(&self.links) {
            link.mass_kg = fitted.mass_kg.value;
            link.centre_of_mass_m = Vector3::from(fitted.centre_m());
        }
        Chain::new(&links, robot.chain.gravity_m_s2(), Isometry3::identity())
    }
}

impl FittedLink {
    fn centre_m(&self) -> [f64; 3] {
        self.centre_of_mass_m.map(|component| component.value)
    }
}
