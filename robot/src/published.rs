//! What the papers behind a robot print: tables and headline numbers as data, to set beside one's own.
//!
//! Not a robot and not used by any model: a robot file has its own numbers, and where they come from a paper a test
//! holds the two together.

use joint_model::rigid_body::PublishedGravity;
use serde::Deserialize;

use crate::error::{Place, RobotError};
use crate::parse::parse;
use crate::{DirectionalFriction, LoadTorqueTable};

/// The papers that come with the program, by name.
const PAPERS: [(&str, &str); 2] = [
    (
        "pa10-2003",
        include_str!("../../robots/published/pa10-2003.toml"),
    ),
    (
        "pa10-2005",
        include_str!("../../robots/published/pa10-2005.toml"),
    ),
];

/// Names of the papers that come with the program.
pub fn papers() -> impl Iterator<Item = &'static str> {
    PAPERS.iter().map(|(name, _)| *name)
}

/// The numbers of a paper, by its name.
///
/// # Errors
/// [`RobotError::Unknown`] with the nearest name, for a paper that does not come with the program.
pub fn published(name: &str) -> Result<Published, RobotError> {
    match PAPERS.iter().find(|(known, _)| *known == name) {
        Some((name, text)) => parse(text, name),
        None => {
            let known: Vec<String> = papers().map(str::to_owned).collect();
            Err(Place::new("published numbers", "").unknown("paper", name, &known))
        }
    }
}

/// The numbers of one paper. What a paper does not have is empty.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// Title of the paper.
    pub title: String,
    /// Its authors.
    pub authors: Vec<String>,
    /// Year of its publication.
    pub year: u32,
    /// Drive, sensors and host of the robot.
    pub drive: PublishedDrive,
    /// Friction over velocity and position.
    pub friction_experiment: FrictionExperiment,
    /// Torque over load.
    pub stiffness_experiment: StiffnessExperiment,
    /// Masses and lengths for the gravity torque.
    pub gravity: Option<GravityTable>,
    /// Tracking of the end effector.
    pub lemniscate: Option<LemniscateResult>,
    /// Tracking of single joints.
    #[serde(default, rename = "trapezoid")]
    pub trapezoids: Vec<TrapezoidResult>,
    /// Tables by joint.
    #[serde(default, rename = "joint")]
    pub joints: Vec<PublishedJoint>,
}

impl Published {
    /// The tables of a joint.
    pub fn joint(&self, name: &str) -> Option<&PublishedJoint> {
        self.joints.iter().find(|joint| joint.name == name)
    }
}

/// Drive, sensors and host.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedDrive {
    /// Motor turns per joint turn.
    pub gear_ratio: f64,
    /// One digit of the torque command, motor side.
    pub torque_digit_nm: f64,
    /// Step of the position sensor, joint side.
    pub joint_resolution_rad: f64,
    /// Rate of the drive's velocity loop.
    pub velocity_loop_rate_hz: f64,
    /// Rate of the host's commands.
    pub host_rate_hz: f64,
    /// Cut-off of the Butterworth filter on velocity.
    pub velocity_filter_hz: f64,
    /// Order of that filter.
    pub velocity_filter_order: u32,
}

/// How friction was measured.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionExperiment {
    /// Constant speeds, rising, each driven in both directions.
    pub velocities_rad_s: Vec<f64>,
    /// How often each was driven in each direction, where the paper says so.
    pub trials: Option<u32>,
    /// Speed at which friction over position was measured.
    pub slow_velocity_rad_s: f64,
}

/// How the torque over load was measured.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StiffnessExperiment {
    /// From where to where the joint moved.
    pub range_rad: [f64; 2],
    /// How fast.
    pub velocity_rad_s: f64,
    /// The weights that are printed, rising.
    pub weights_kg: Vec<f64>,
}

/// PA10-05 Table IV: masses and lengths in the paper's symbols.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(
    missing_docs,
    reason = "the names are the symbols; PublishedGravity explains them"
)]
pub struct GravityTable {
    pub g_m_s2: f64,
    pub m2_kg: f64,
    pub m4_kg: f64,
    pub m6_kg: f64,
    pub l2_m: f64,
    pub l4_m: f64,
    pub lc2_m: f64,
    pub lc4_m: f64,
    pub lc6_m: f64,
}

impl From<GravityTable> for PublishedGravity {
    fn from(table: GravityTable) -> Self {
        Self {
            g_m_s2: table.g_m_s2,
            m2_kg: table.m2_kg,
            m4_kg: table.m4_kg,
            m6_kg: table.m6_kg,
            l2_m: table.l2_m,
            l4_m: table.l4_m,
            lc2_m: table.lc2_m,
            lc4_m: table.lc4_m,
            lc6_m: table.lc6_m,
        }
    }
}

/// How well the end effector followed the lemniscate.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LemniscateResult {
    /// Mean distance from the reference.
    pub mean_error_m: f64,
    /// Largest distance.
    pub largest_error_m: f64,
    /// Largest distance after the error of the start has gone.
    pub largest_error_after_start_m: f64,
    /// By what the gains would have to grow for the same accuracy without the model, at least.
    pub gain_factor_without_model: f64,
}

/// How well one joint followed a trapezoidal velocity profile.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrapezoidResult {
    /// The joint that moved.
    pub joint: String,
    /// Velocity of the plateau.
    pub velocity_rad_s: f64,
    /// How far it moved, where the paper says so.
    pub distance_rad: Option<f64>,
    /// Proportional gain as printed: motor torque per radian of the joint.
    pub proportional_nm_rad: f64,
    /// Derivative gain as printed, likewise.
    pub derivative_nm_s_rad: f64,
    /// Mean error; outside the region of low stiffness where the paper tells the two apart.
    pub mean_error_rad: f64,
    /// Feedback torque there.
    pub feedback_torque_nm: Option<f64>,
    /// Inside the region of low stiffness, where the paper tells the two apart.
    pub low_stiffness: Option<LowStiffnessResult>,
}

/// Tracking inside the region of low stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LowStiffnessResult {
    /// Mean error.
    pub mean_error_rad: f64,
    /// Feedback torque.
    pub feedback_torque_nm: f64,
}

/// The tables of one joint.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedJoint {
    /// The joint's name, as in the robot file.
    pub name: String,
    /// PA10-05 Table I.
    pub table_i: FrictionModelScores,
    /// PA10-05 Table II, both directions as magnitudes that oppose motion.
    pub table_ii: DirectionalFriction,
    /// PA10-05 Table III.
    pub table_iii: [PublishedHarmonic; 2],
    /// PA10-05 Table V, for the joints that have a row in it.
    pub table_v: Option<LoadTorqueTable>,
    /// PA10-05 Table VI, for the joints that have a row in it.
    pub table_vi: Option<PublishedGains>,
}

/// How well three friction models fit one joint.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionModelScores {
    /// Coulomb and viscous friction: two coefficients.
    pub viscous: ModelScore,
    /// Cubic polynomial: four.
    pub cubic: ModelScore,
    /// Eq (7): four.
    pub stribeck: ModelScore,
}

/// How well one model fits.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelScore {
    /// Weighted residual variance, eq (6).
    pub residual_variance: f64,
    /// Mean squared error per degree of freedom.
    pub mse_per_dof: f64,
}

/// One harmonic of position-dependent friction, `A·sin(2π·f·θ + φ)` with the joint's angle θ.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedHarmonic {
    /// `f`.
    pub cycles_per_joint_rad: f64,
    /// `A`.
    pub amplitude_nm: f64,
    /// `φ`.
    pub phase_rad: f64,
}

/// Gains of one joint as printed: motor torque per radian of the joint.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PublishedGains {
    /// Proportional gain.
    pub proportional_nm_rad: f64,
    /// Derivative gain.
    pub derivative_nm_s_rad: f64,
}
