//! Which model a joint gets, and why.

use joint_model::friction::Direction;
use robot::{DirectionalFriction, StribeckRow};
use serde::Serialize;

use super::speeds::{grouped, weighted};
use super::{DirectionFit, FrictionModel, ModelComparison, SteadyMeasurement};
use crate::IdentificationError;
use crate::error::direction_name;

/// A model whose BIC exceeds the lowest by no more than this is as well supported (Kass and Raftery, J. American
/// Statistical Association 90 (1995) 773-795, section 3.2).
const AS_WELL_SUPPORTED: f64 = 2.0;

/// Of equally supported models the first: fewest parameters, then the one that stays linear at high speed, which is
/// why PA10-05 prefers Stribeck to cubic.
const PREFERENCE: [FrictionModel; 3] = [
    FrictionModel::CoulombViscous,
    FrictionModel::Stribeck,
    FrictionModel::Cubic,
];

/// Friction of one joint: measurements, the models fitted and the one chosen.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointFriction {
    /// The joint's name.
    pub joint: String,
    /// What was fitted, as measured.
    pub measurements: Vec<SteadyMeasurement>,
    /// The models that the speeds allow, in the order of Table I; at least Coulomb and viscous.
    pub models: Vec<ModelComparison>,
    /// The model chosen, one of `models`.
    pub chosen: FrictionModel,
    /// Why, in words and numbers.
    pub reason: String,
    /// What a reader should know before trusting the values, such as a `Vc` on its bound.
    pub findings: Vec<String>,
}

/// Fits the three models to a joint's measurements and chooses one by BIC.
///
/// AICc, which is reported too, adds an exponential to a joint without one too readily: the weights come from the
/// trials that are fitted.
///
/// # Errors
/// [`IdentificationError::TooFewSpeeds`] where a direction has fewer than two different speeds.
pub fn identify_friction(
    joint: &str,
    measurements: Vec<SteadyMeasurement>,
) -> Result<JointFriction, IdentificationError> {
    let positive = weighted(&measurements, Direction::Positive);
    let negative = weighted(&measurements, Direction::Negative);
    let models: Vec<ModelComparison> = FrictionModel::ALL
        .into_iter()
        .filter_map(|model| ModelComparison::new(model, &positive, &negative))
        .collect();
    let Some(chosen) = choose(&models) else {
        let (positive_speeds, negative_speeds) =
            (grouped(&positive).len(), grouped(&negative).len());
        return Err(IdentificationError::TooFewSpeeds {
            joint: joint.to_owned(),
            direction: if positive_speeds <= negative_speeds {
                Direction::Positive
            } else {
                Direction::Negative
            },
            found: positive_speeds.min(negative_speeds),
            needed: FrictionModel::CoulombViscous.parameter_count(),
        });
    };
    let mut friction = JointFriction {
        joint: joint.to_owned(),
        measurements,
        reason: reason(&models, chosen),
        models,
        chosen,
        findings: Vec::new(),
    };
    friction.findings = findings(&friction);
    Ok(friction)
}

impl JointFriction {
    /// A model's fits, where the speeds allowed it.
    #[must_use]
    pub fn model(&self, model: FrictionModel) -> Option<&ModelComparison> {
        self.models
            .iter()
            .find(|comparison| comparison.model == model)
    }

    /// The model a robot file takes: the chosen one, but Stribeck in place of cubic. A cubic fits the measured speeds
    /// and runs away beyond them; PA10-05 decides the same way.
    #[must_use]
    pub fn robot_model(&self) -> FrictionModel {
        let stribeck = self.model(FrictionModel::Stribeck);
        match (self.chosen, stribeck) {
            (FrictionModel::Cubic, Some(_)) => FrictionModel::Stribeck,
            (FrictionModel::Cubic, None) => FrictionModel::CoulombViscous,
            (chosen, _) => chosen,
        }
    }

    /// Rows of Table II for the robot file, by [`Self::robot_model`].
    #[must_use]
    pub fn robot_friction(&self) -> Option<DirectionalFriction> {
        let comparison = self.model(self.robot_model())?;
        let largest_rad_s = self
            .measurements
            .iter()
            .fold(0.0_f64, |largest, m| largest.max(m.speed_rad_s()));
        Some(DirectionalFriction {
            positive: row(&comparison.positive, largest_rad_s),
            negative: row(&comparison.negative, largest_rad_s),
        })
    }
}

/// Without an exponential `Vc` only has to be positive: the largest speed stands there.
fn row(fit: &DirectionFit, largest_rad_s: f64) -> StribeckRow {
    let value = |symbol| fit.parameter(symbol).map(|parameter| parameter.value);
    StribeckRow {
        f0_nm: value("F0").unwrap_or_default(),
        fv_nm_s_rad: value("Fv").unwrap_or_default(),
        fs_nm: value("Fs").unwrap_or_default(),
        vc_rad_s: value("Vc").unwrap_or(largest_rad_s),
    }
}

fn choose(models: &[ModelComparison]) -> Option<FrictionModel> {
    let find = |model: &FrictionModel| models.iter().find(|comparison| comparison.model == *model);
    let lowest = lowest_bic(models)?;
    let supported = |comparison: &&ModelComparison| comparison.bic <= lowest + AS_WELL_SUPPORTED;
    let chosen = PREFERENCE.iter().filter_map(find).find(supported);
    chosen.map(|comparison| comparison.model)
}

fn lowest_bic(models: &[ModelComparison]) -> Option<f64> {
    let criteria = models.iter().map(|comparison| comparison.bic);
    criteria.min_by(f64::total_cmp)
}

fn reason(models: &[ModelComparison], chosen: FrictionModel) -> String {
    let numbers: Vec<String> = models.iter().map(criteria).collect();
    let lowest = lowest_bic(models);
    let is_lowest = models
        .iter()
        .any(|comparison| comparison.model == chosen && Some(comparison.bic) == lowest);
    let why = if is_lowest {
        "its BIC is the lowest".to_owned()
    } else {
        format!(
            "its BIC is within {AS_WELL_SUPPORTED} of the lowest, and of models as well supported it is preferred"
        )
    };
    format!("{}: {why} ({})", chosen.name(), numbers.join("; "))
}

fn criteria(comparison: &ModelComparison) -> String {
    let aicc = match comparison.aicc {
        Some(aicc) => format!(", AICc {aicc:.1}"),
        None => String::new(),
    };
    let held_out = match comparison.held_out_rms_nm {
        Some(rms_nm) => format!(", held-out rms {rms_nm:.4} Nm"),
        None => String::new(),
    };
    format!(
        "{} BIC {:.1}{aicc}{held_out}",
        comparison.model.name(),
        comparison.bic
    )
}

fn findings(friction: &JointFriction) -> Vec<String> {
    let mut findings = Vec::new();
    let short = friction
        .measurements
        .iter()
        .filter(|m| m.motor_revolutions == 0)
        .count();
    if short > 0 {
        findings.push(format!(
            "{short} of {} measurements are shorter than a motor revolution: position-dependent friction does not \
             average out in them",
            friction.measurements.len()
        ));
    }
    let aiccs = friction
        .models
        .iter()
        .filter_map(|c| Some((c.model, c.aicc?)));
    let lowest = aiccs.min_by(|(_, a), (_, b)| a.total_cmp(b));
    if let Some((model, _)) = lowest.filter(|(model, _)| *model != friction.chosen) {
        findings.push(format!("AICc is lowest for {}", model.name()));
    }
    let model = friction.robot_model();
    if model != friction.chosen {
        findings.push(format!(
            "the robot file takes {} in place of {}, which holds only between the measured speeds",
            model.name(),
            friction.chosen.name()
        ));
    }
    if let Some(comparison) = friction.model(model) {
        findings.extend(fit_findings(&comparison.positive, Direction::Positive));
        findings.extend(fit_findings(&comparison.negative, Direction::Negative));
    }
    findings
}

fn fit_findings(fit: &DirectionFit, direction: Direction) -> Vec<String> {
    let name = direction_name(direction);
    let doubtful = |parameter: &super::Parameter| {
        let super::Parameter {
            symbol,
            unit,
            value,
            standard_error,
            at_bound,
        } = *parameter;
        match standard_error {
            _ if at_bound => Some(format!(
                "{name} direction: {symbol} = {value:.4} {unit} is on its bound; the speeds do not show it"
            )),
            None => Some(format!(
                "{name} direction: {symbol} = {value:.4} {unit} has no standard error; the measurements do not \
                 determine it"
            )),
            Some(error) if error > value.abs() => Some(format!(
                "{name} direction: {symbol} = {value:.4} {unit} is uncertain by {error:.4} {unit}"
            )),
            Some(_) => None,
        }
    };
    let on_bound = fit.parameters.iter().any(|parameter| parameter.at_bound);
    let undetermined = fit
        .vc_range_rad_s
        .filter(|_| !fit.vc_is_determined && !on_bound);
    let undetermined = undetermined.map(|[low, high]| {
        format!(
            "{name} direction: these speeds do not determine Vc: {low:.3} to {high:.3} rad/s fit within two standard \
             errors, with other Fs and Fv; the curve holds between the speeds, not its parts"
        )
    });
    let doubtful = fit.parameters.iter().filter_map(doubtful);
    doubtful.chain(undetermined).collect()
}
