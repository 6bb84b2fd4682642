//! What a stiffness fit says: Table V with errors, and every step of Fig. 7.

use robot::{LoadTorqueRow, LoadTorqueTable};
use serde::Serialize;

use crate::Estimate;

/// One joint's torque over gravity load, PA10-05 Table V.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StiffnessFit {
    /// The joint's name.
    pub joint: String,
    /// Payloads that the sweeps were made with.
    pub payloads_kg: Vec<f64>,
    /// Motion in the positive direction.
    pub positive: DirectionFit,
    /// Motion in the negative direction.
    pub negative: DirectionFit,
}

/// One direction of motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DirectionFit {
    /// Successive subtraction, eq (5), one entry per recording that has this direction.
    pub steps: Vec<SweepSteps>,
    /// The piecewise-linear law that fits all of them.
    pub law: LoadTorqueFit,
}

/// The steps of Fig. 7(a) for one payload and one direction: arrays of one length, in the order of the motion.
///
/// Joint side, about the joint's axis. Each value is the mean over a short travel of the joint.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SweepSteps {
    /// Payload at the flange.
    pub payload_kg: f64,
    /// Joint angle.
    pub position_rad: Vec<f64>,
    /// `T_in·N`, motor torque times gear ratio.
    pub total_nm: Vec<f64>,
    /// The same without position-dependent friction `T_cf(θ)`.
    pub without_position_friction_nm: Vec<f64>,
    /// The same without velocity-dependent friction `T_vf(θ̇)` either.
    pub without_friction_nm: Vec<f64>,
    /// Gravity torque `T_g` of arm and payload.
    pub gravity_nm: Vec<f64>,
    /// What remains: `T_c`, along the direction of motion (positive hinders it), as [`LoadTorqueTable`] has it.
    pub load_torque_nm: Vec<f64>,
    /// Where an overrunning load has eased friction to its floor: not fitted.
    pub on_floor: Vec<bool>,
}

/// `T_c` over `T_g`: continuous, piecewise linear, with as many regions as the data support.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoadTorqueFit {
    /// Slopes in order of rising gravity torque, Nm per Nm: one per region, 1 to 3.
    pub slopes: Vec<Estimate>,
    /// Gravity torques at which the slope changes, rising: one less than slopes.
    pub knees: Vec<Knee>,
    /// `T_c` at gravity torque zero.
    pub zero_load_nm: Estimate,
    /// Whether gravity torque zero lies outside the data, so that `zero_load_nm` is extrapolated.
    pub zero_load_extrapolated: bool,
    /// Smallest and largest gravity torque in the data.
    pub gravity_range_nm: [f64; 2],
    /// Root mean square of the residual.
    pub residual_rms_nm: f64,
    /// Samples fitted.
    pub samples: usize,
    /// Samples left out because friction was on its floor there.
    pub samples_on_floor: usize,
    /// Over how many successive samples a residual persists; so many times fewer samples count in standard errors and
    /// information criteria.
    pub correlated_samples: f64,
    /// The laws compared, one to three regions; the smallest criterion was chosen. A law whose regions the data are too
    /// few for is absent.
    pub candidates: Vec<Candidate>,
}

/// A gravity torque at which the slope changes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Knee {
    /// Where.
    pub gravity_nm: Estimate,
    /// The search ended as near to the edge of the data, or to the other knee, as it may go: a finding, not a value.
    pub at_bound: bool,
}

/// One law that was compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// Linear regions.
    pub regions: usize,
    /// Root mean square of its residual.
    pub residual_rms_nm: f64,
    /// Bayesian information criterion; only differences mean something.
    pub bic: f64,
}

impl StiffnessFit {
    /// What a reader should know before trusting the table.
    #[must_use]
    pub fn findings(&self) -> Vec<String> {
        let directions = [("positive", &self.positive), ("negative", &self.negative)];
        let of_direction = |(name, fit): (&str, &DirectionFit)| {
            let LoadTorqueFit { knees, .. } = &fit.law;
            let mut findings: Vec<String> = knees
                .iter()
                .filter(|knee| knee.at_bound)
                .map(|knee| {
                    format!(
                        "{name} direction: the knee at {:.2} Nm is on the edge of the data or of the other knee; the sweeps \
                         do not show it",
                        knee.gravity_nm.value
                    )
                })
                .collect();
            let moved = |payload_kg: &f64| fit.steps.iter().any(|s| s.payload_kg == *payload_kg);
            for payload_kg in self
                .payloads_kg
                .iter()
                .filter(|payload_kg| !moved(payload_kg))
            {
                findings.push(format!(
                    "{name} direction: no slow and steady motion with {payload_kg} kg; too heavy for the drive?"
                ));
            }
            if knees.len() < 2 {
                findings.push(format!(
                    "{name} direction: {} of Table V's 2 knees found between {:.1} and {:.1} Nm",
                    knees.len(),
                    fit.law.gravity_range_nm[0],
                    fit.law.gravity_range_nm[1]
                ));
            }
            findings
        };
        directions.into_iter().flat_map(of_direction).collect()
    }

    /// The table for the robot file.
    pub fn table(&self) -> LoadTorqueTable {
        LoadTorqueTable {
            positive: self.positive.law.row(),
            negative: self.negative.law.row(),
        }
    }
}

impl LoadTorqueFit {
    /// Linear regions, 1 to 3.
    pub fn regions(&self) -> usize {
        self.slopes.len()
    }

    /// `T_c` along the direction of motion, at a gravity torque about the axis.
    pub fn torque_nm(&self, gravity_nm: f64) -> f64 {
        let law_nm = |load_nm: f64| {
            let first_nm = self.slopes[0].value * load_nm;
            let changes = self.slopes.windows(2).zip(&self.knees);
            changes.fold(first_nm, |sum_nm, (pair, knee)| {
                let excess_nm = (load_nm - knee.gravity_nm.value).max(0.0);
                sum_nm + (pair[1].value - pair[0].value) * excess_nm
            })
        };
        self.zero_load_nm.value + law_nm(gravity_nm) - law_nm(0.0)
    }

    /// The row of Table V. With fewer regions than three the last slope stands in for the missing ones, and the missing
    /// knees at the end of the data, where they change nothing.
    pub fn row(&self) -> LoadTorqueRow {
        let slope = |region: usize| self.slopes[region.min(self.regions() - 1)].value;
        let [low_nm, high_nm] = self.gravity_range_nm;
        let knees_nm = match self.knees.as_slice() {
            [] => [low_nm, high_nm],
            [knee] => [knee.gravity_nm.value, high_nm],
            [first, second, ..] => [first.gravity_nm.value, second.gravity_nm.value],
        };
        LoadTorqueRow {
            slopes: [slope(0), slope(1), slope(2)],
            knees_nm,
            zero_load_nm: self.zero_load_nm.value,
        }
    }
}
