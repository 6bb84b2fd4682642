//! Parameters of a joint's torque estimators, as calibration writes them into the robot file.
//!
//! Joint side. The laws are those of the crate `estimators`, file by file. "SD" is the structural-damping paper; its
//! eq (8) and Table II give the symbols.

use serde::{Deserialize, Serialize};

use crate::check::{self, Must};
use crate::error::{Place, RobotError};

/// Calibrated torque estimators of one joint; what is not there was not calibrated.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EstimatorParameters {
    /// SD eqs (10) to (13).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub structural_damping: Option<StructuralDampingParameters>,
    /// Zhang's, SD eqs (5) to (8).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compliance: Option<ComplianceParameters>,
    /// SD eq (9).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub taghirad: Option<TaghiradParameters>,
    /// Vassileva's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub disturbance_observer: Option<DisturbanceObserverParameters>,
    /// Xia's: what a Gaussian process adds to `compliance`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gaussian_process: Option<GaussianProcessTable>,
    /// Torsion, its rate and motor-side momentum together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fusion: Option<FusionParameters>,
}

/// SD eqs (10) to (13).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StructuralDampingParameters {
    /// `B_st`: printed in Nm s/rad, acts as a stiffness.
    pub accumulation_nm_rad: f64,
    /// `τ`.
    pub time_constant_s: f64,
    /// `θ_offset`.
    pub offset_rad: f64,
    /// Moving average against the ripples of SD Fig. 8; none if not said.
    #[serde(default)]
    pub average_s: f64,
}

/// A periodic difference between motor and link angle: `Σ_k a_k cos(k θ_m) + b_k sin(k θ_m)`, `θ_m` the motor angle.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KinematicErrorTable {
    /// `a_k`, from one cycle per motor revolution on.
    pub cosine_rad: Vec<f64>,
    /// `b_k`, as many.
    pub sine_rad: Vec<f64>,
}

/// SD eqs (5) to (8): six parameters, the kinematic error, and the torsion at which the torque is zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComplianceParameters {
    /// `K_fs0`.
    pub stiffness_nm_rad: f64,
    /// `C_fs`.
    pub stiffening_per_nm: f64,
    /// `K_wg0`, motor side.
    pub wave_generator_stiffness_nm_rad: f64,
    /// `C_wg`, motor side.
    pub wave_generator_stiffening_per_nm: f64,
    /// `S_1`.
    pub torsion_scale: f64,
    /// `S_2`.
    pub torque_scale: f64,
    /// Torsion read without torque: where the encoders' zeros lie.
    pub zero_rad: f64,
    /// Largest torque of the calibration: beyond it eq (8) goes on as a straight line.
    pub torque_max_nm: f64,
    /// `θ_ke`.
    pub kinematic_error: KinematicErrorTable,
}

/// SD eq (9).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TaghiradParameters {
    /// `K`.
    pub stiffness_nm_rad: f64,
    /// `B_st`: torque at a torsion rate of 1 rad/s.
    pub damping_nm: f64,
    /// `α`.
    pub exponent: f64,
    /// Torsion read without torque.
    pub zero_rad: f64,
}

/// Coulomb and viscous friction in each direction of motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DisturbanceObserverParameters {
    /// Coulomb friction in positive and in negative motion, both as magnitudes.
    pub coulomb_nm: [f64; 2],
    /// Viscous friction in positive and in negative motion.
    pub viscous_nm_s_rad: [f64; 2],
}

/// A Gaussian process evaluated on a grid once, so that a prediction takes the time of a look-up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GaussianProcessTable {
    /// Torque by `compliance` at the first and the last column.
    pub compliance_nm: [f64; 2],
    /// Motor torque times gear ratio at the first and the last row.
    pub motor_nm: [f64; 2],
    /// What to add to `compliance`, row by row.
    pub residual_nm: Vec<Vec<f64>>,
    /// Standard deviation of the process there, noise included, row by row.
    pub std_nm: Vec<Vec<f64>>,
}

/// What the fused estimator knows of the joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FusionParameters {
    /// Torsion read without torque.
    pub zero_rad: f64,
    /// Kinematic error.
    pub kinematic_error: KinematicErrorTable,
    /// Torsions, either way, from which on each stiffness counts; rising from 0.
    pub knees_rad: Vec<f64>,
    /// What each knee adds to the stiffness; the sums are positive.
    pub stiffness_steps_nm_rad: Vec<f64>,
    /// Half widths of the hysteresis' play elements.
    pub plays_rad: Vec<f64>,
    /// Stiffness of each play element.
    pub play_stiffnesses_nm_rad: Vec<f64>,
    /// Damping of the torsion.
    pub damping_nm_s_rad: f64,
    /// Friction before the gear's spring.
    pub coulomb_nm: f64,
    /// The same, in proportion to velocity.
    pub viscous_nm_s_rad: f64,
    /// Inertia about the joint's axis behind the spring.
    pub link_inertia_kg_m2: f64,
    /// The link's gravity over the robot file's.
    pub gravity_share: f64,
    /// What inertia and gravity leave unexplained of the torque on a free link, one standard deviation.
    pub free_std_nm: f64,
    /// Error of these laws while the joint moves, one standard deviation.
    pub moving_std_nm: f64,
    /// The same while it stands.
    pub resting_std_nm: f64,
    /// Whether a change of stiffness is followed: not where the joint's friction would be taken for one. Yes if not said.
    #[serde(default = "followed")]
    pub follows_stiffness: bool,
}

fn followed() -> bool {
    true
}

/// The most values a list here may have; the estimators' buffers are sized by it.
pub const TERMS_MAX: usize = 8;

/// Rows and columns that a table of a Gaussian process has at least and at most.
const GRID: std::ops::RangeInclusive<usize> = 2..=64;

impl EstimatorParameters {
    /// Are the numbers possible?
    pub(crate) fn check(&self, joint: &Place) -> Result<(), RobotError> {
        let place = |table: &str| Place {
            within: format!("{}, estimators.{table}", joint.within),
            ..joint.clone()
        };
        if let Some(found) = &self.structural_damping {
            found.check(&place("structural_damping"))?;
        }
        if let Some(found) = &self.compliance {
            found.check(&place("compliance"))?;
        }
        if let Some(found) = &self.taghirad {
            found.check(&place("taghirad"))?;
        }
        if let Some(found) = &self.disturbance_observer {
            let place = place("disturbance_observer");
            check::numbers(&place, "coulomb_nm", &found.coulomb_nm, Must::BeFinite)?;
            check::numbers(
                &place,
                "viscous_nm_s_rad",
                &found.viscous_nm_s_rad,
                Must::BeFinite,
            )?;
        }
        if let Some(found) = &self.gaussian_process {
            let place = place("gaussian_process");
            if self.compliance.is_none() {
                return Err(place.invalid(
                    "there is no estimators.compliance, to which the process adds; calibrate both",
                ));
            }
            found.check(&place)?;
        }
        if let Some(found) = &self.fusion {
            found.check(&place("fusion"))?;
        }
        Ok(())
    }
}

impl StructuralDampingParameters {
    fn check(&self, place: &Place) -> Result<(), RobotError> {
        check::number(
            place,
            "accumulation_nm_rad",
            self.accumulation_nm_rad,
            Must::BePositive,
        )?;
        check::number(
            place,
            "time_constant_s",
            self.time_constant_s,
            Must::BePositive,
        )?;
        check::number(place, "offset_rad", self.offset_rad, Must::NotBeNegative)?;
        check::number(place, "average_s", self.average_s, Must::NotBeNegative)
    }
}

impl KinematicErrorTable {
    fn check(&self, place: &Place) -> Result<(), RobotError> {
        as_many(
            place,
            ["kinematic_error.cosine_rad", "kinematic_error.sine_rad"],
            [&self.cosine_rad, &self.sine_rad],
        )
    }
}

impl ComplianceParameters {
    fn check(&self, place: &Place) -> Result<(), RobotError> {
        for (key, value) in [
            ("stiffness_nm_rad", self.stiffness_nm_rad),
            ("stiffening_per_nm", self.stiffening_per_nm),
            (
                "wave_generator_stiffness_nm_rad",
                self.wave_generator_stiffness_nm_rad,
            ),
            (
                "wave_generator_stiffening_per_nm",
                self.wave_generator_stiffening_per_nm,
            ),
            ("torsion_scale", self.torsion_scale),
            ("torque_scale", self.torque_scale),
            ("torque_max_nm", self.torque_max_nm),
        ] {
            check::number(place, key, value, Must::BePositive)?;
        }
        check::number(place, "zero_rad", self.zero_rad, Must::BeFinite)?;
        self.kinematic_error.check(place)
    }
}

impl TaghiradParameters {
    fn check(&self, place: &Place) -> Result<(), RobotError> {
        check::number(
            place,
            "stiffness_nm_rad",
            self.stiffness_nm_rad,
            Must::BePositive,
        )?;
        check::number(place, "damping_nm", self.damping_nm, Must::BeFinite)?;
        check::number(place, "exponent", self.exponent, Must::BePositive)?;
        check::number(place, "zero_rad", self.zero_rad, Must::BeFinite)
    }
}

impl GaussianProcessTable {
    fn check(&self, place: &Place) -> Result<(), RobotError> {
        for (key, [low, high]) in [
            ("compliance_nm", self.compliance_nm),
            ("motor_nm", self.motor_nm),
        ] {
            check::numbers(place, key, &[low, high], Must::BeFinite)?;
            if low >= high {
                return Err(place.invalid(format!("{key} = [{low}, {high}] must be ascending")));
            }
        }
        let columns = self.residual_nm.first().map_or(0, Vec::len);
        for (key, rows, must) in [
            ("residual_nm", &self.residual_nm, Must::BeFinite),
            ("std_nm", &self.std_nm, Must::NotBeNegative),
        ] {
            let (least, most) = GRID.into_inner();
            if rows.len() != self.residual_nm.len()
                || !GRID.contains(&rows.len())
                || !GRID.contains(&columns)
                || rows.iter().any(|row| row.len() != columns)
            {
                return Err(place.invalid(format!(
                    "{key} has {} rows, the first of {} values; residual_nm and std_nm need as many, \
                     {least} to {most} each way, and all rows as long as the first",
                    rows.len(),
                    rows.first().map_or(0, Vec::len)
                )));
            }
            rows.iter()
                .try_for_each(|row| check::numbers(place, key, row, must))?;
        }
        Ok(())
    }
}

impl FusionParameters {
    fn check(&self, place: &Place) -> Result<(), RobotError> {
        check::number(place, "zero_rad", self.zero_rad, Must::BeFinite)?;
        self.kinematic_error.check(place)?;
        as_many(
            place,
            ["knees_rad", "stiffness_steps_nm_rad"],
            [&self.knees_rad, &self.stiffness_steps_nm_rad],
        )?;
        as_many(
            place,
            ["plays_rad", "play_stiffnesses_nm_rad"],
            [&self.plays_rad, &self.play_stiffnesses_nm_rad],
        )?;
        check::numbers(place, "plays_rad", &self.plays_rad, Must::BePositive)?;
        // a negative one would give energy
        check::numbers(
            place,
            "play_stiffnesses_nm_rad",
            &self.play_stiffnesses_nm_rad,
            Must::NotBeNegative,
        )?;
        let rising = self.knees_rad.windows(2).all(|pair| pair[0] < pair[1]);
        if self.knees_rad.first() != Some(&0.0) || !rising {
            return Err(place.invalid(format!("knees_rad = {:?} must rise from 0", self.knees_rad)));
        }
        let mut sum_nm_rad = 0.0;
        for step_nm_rad in &self.stiffness_steps_nm_rad {
            sum_nm_rad += step_nm_rad;
            check::number(
                place,
                "stiffness_steps_nm_rad, summed up to a knee,",
                sum_nm_rad,
                Must::BePositive,
            )?;
        }
        for (key, value, must) in [
            (
                "damping_nm_s_rad",
                self.damping_nm_s_rad,
                Must::NotBeNegative,
            ),
            ("coulomb_nm", self.coulomb_nm, Must::NotBeNegative),
            (
                "viscous_nm_s_rad",
                self.viscous_nm_s_rad,
                Must::NotBeNegative,
            ),
            (
                "link_inertia_kg_m2",
                self.link_inertia_kg_m2,
                Must::BePositive,
            ),
            ("gravity_share", self.gravity_share, Must::BePositive),
            ("free_std_nm", self.free_std_nm, Must::BePositive),
            ("moving_std_nm", self.moving_std_nm, Must::NotBeNegative),
            ("resting_std_nm", self.resting_std_nm, Must::NotBeNegative),
        ] {
            check::number(place, key, value, must)?;
        }
        Ok(())
    }
}

/// Two lists of finite numbers, one for each term.
fn as_many(place: &Place, keys: [&str; 2], lists: [&[f64]; 2]) -> Result<(), RobotError> {
    for (key, list) in keys.into_iter().zip(lists) {
        check::numbers(place, key, list, Must::BeFinite)?;
    }
    let [first, second] = lists.map(<[f64]>::len);
    if first == second && first <= TERMS_MAX {
        return Ok(());
    }
    Err(place.invalid(format!(
        "{} has {first} values and {} has {second}; give as many in both, at most {TERMS_MAX}",
        keys[0], keys[1]
    )))
}
