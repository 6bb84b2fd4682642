//! Fit of the fused estimator: its torsion law, then how wrong that law still is.
//!
//! The law is fitted twice: on the readings as they are, then on the motion that the filter with the first law makes of them,
//! whose rates are less noisy than a difference. Friction is the disturbance observer's; the filter corrects it anyway.
//! Inertia and gravity of the link are those of [`link`](super::link).

use robot::estimators::FusionParameters;

use super::least_squares::{Parameter, fit};
use super::models::{KINEMATIC_TERMS, kinematic_error};
use super::{Bench, Calibration, range};
use crate::fusion::{Motion, Plays, TorsionLaw};
use crate::joint::{EstimatorError, Kind};
use crate::kinematic_error::KinematicError;
use crate::{Estimate, Fusion, TorqueEstimator};

/// Knees of the spring, as shares of the largest torsion: closer near zero, where gears are soft.
const KNEES: [f64; 7] = [0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8];
/// Half widths of the plays, as shares of the largest torsion.
const PLAYS: [f64; 4] = [0.035, 0.07, 0.14, 0.28];
/// How a play element's stiffness is called.
pub(super) const PLAY_STIFFNESS: &str = "play_stiffnesses_nm_rad";
/// Of the normal distribution within 95 %.
const SIGMAS_95: f64 = 1.96;
/// Half of the samples over which a rate is taken from bare readings: 4 ms, for rings up to 80 Hz.
const RATE_ROWS: usize = 3;
/// Joint speed above which errors count as those in motion; the filter blends around it.
const MOVING_RAD_S: f64 = 0.03;

/// Of the gear's stiffness, a play element's in the beginning: away from its bound, where the search would stick.
const START_PLAY_SHARE: f64 = 0.05;
/// A stiffness that seems to change by more than this while nothing has changed is not followed: a tenth is to be found.
const STIFFNESS_ERROR_MAX: f64 = 0.05;
/// See [`Bench::reluctance_nm`].
const RELUCTANCE_NM: f64 = 0.02;

const ZERO: usize = 2 * KINEMATIC_TERMS;
const SPRINGS: usize = ZERO + 1;
const PLAY_SPRINGS: usize = SPRINGS + KNEES.len();
const DAMPING: usize = PLAY_SPRINGS + PLAYS.len();

impl Bench<'_> {
    /// Needs the compliance model and the disturbance observer as starts.
    pub(super) fn fusion(&self, found: &mut Calibration) -> Result<(), EstimatorError> {
        let (Some(compliance), Some(observer)) = (
            found.parameters.compliance.clone(),
            found.parameters.disturbance_observer,
        ) else {
            return Ok(());
        };
        let mean = |[positive, negative]: [f64; 2]| (0.5 * (positive + negative)).max(0.0);
        let twist_rad = 0.5 * range(self.torsions_rad().into_iter());
        let link = self.link();
        let frame = FusionParameters {
            zero_rad: compliance.zero_rad,
            kinematic_error: compliance.kinematic_error.clone(),
            knees_rad: KNEES.map(|share| share * twist_rad).to_vec(),
            stiffness_steps_nm_rad: Vec::new(),
            plays_rad: PLAYS.map(|share| share * twist_rad).to_vec(),
            play_stiffnesses_nm_rad: Vec::new(),
            damping_nm_s_rad: 0.0,
            coulomb_nm: mean(observer.coulomb_nm),
            viscous_nm_s_rad: mean(observer.viscous_nm_s_rad),
            link_inertia_kg_m2: link.inertia_kg_m2,
            gravity_share: link.gravity_share,
            free_std_nm: link.left_nm,
            moving_std_nm: 0.0,
            resting_std_nm: 0.0,
            follows_stiffness: true,
        };
        self.filter(&frame)?; // what the robot file lacks is told before the long fit
        let start = self.start(&frame);
        let (first, _) = self.law(&frame, &start, &self.raw_motion());
        let filtered = self.filtered_motion(&first)?;
        let start = values(&first);
        let (mut law, solution) = self.law(&frame, &start, &filtered);
        // to the filter, what the law misses is a torque on the link
        law.free_std_nm = link.left_nm.hypot(solution.rms);
        law.follows_stiffness = self.can_follow_stiffness(&law, found)?;
        (law.moving_std_nm, law.resting_std_nm) = self.model_stds_nm(&law, found)?;
        found.parameters.fusion = Some(law);
        found.keep(Kind::Fusion, solution, 1);
        Ok(())
    }

    fn start(&self, frame: &FusionParameters) -> Vec<f64> {
        let mut start = vec![0.0; DAMPING + 1];
        let table = &frame.kinematic_error;
        let pairs = table.cosine_rad.iter().zip(&table.sine_rad);
        for (term, (cosine, sine)) in pairs.enumerate() {
            start[2 * term] = *cosine;
            start[2 * term + 1] = *sine;
        }
        start[ZERO] = frame.zero_rad;
        let stiffness = self.stiffness_nm_rad();
        start[SPRINGS] = stiffness;
        start[PLAY_SPRINGS..DAMPING].fill(START_PLAY_SHARE * stiffness);
        start
    }

    /// The law whose torque over this motion is nearest to the reference.
    fn law(
        &self,
        frame: &FusionParameters,
        start: &[f64],
        motion: &[Option<Motion>],
    ) -> (FusionParameters, super::least_squares::Solution) {
        let parameters = self.law_parameters(start);
        let made = |values: &[f64]| {
            let mut law = frame.clone();
            law.kinematic_error = kinematic_error(&values[..ZERO]);
            law.zero_rad = values[ZERO];
            law.stiffness_steps_nm_rad = values[SPRINGS..PLAY_SPRINGS].to_vec();
            law.play_stiffnesses_nm_rad = values[PLAY_SPRINGS..DAMPING].to_vec();
            law.damping_nm_s_rad = values[DAMPING].max(0.0);
            law
        };
        let ratio = self.joint.gear_ratio;
        // the rotor is where it is, whatever the law
        let turned: Vec<Option<Turned>> = motion
            .iter()
            .map(|motion| motion.map(|motion| (motion, (motion.motor_rad * ratio).sin_cos())))
            .collect();
        let solution = fit(&parameters, 1, &|values| {
            let mut misses = self.law_misses(&made(values), values[DAMPING], &turned);
            misses.extend(self.reluctance_nm(values));
            misses
        });
        (made(&solution.values()), solution)
    }

    /// What keeps terms near zero that the data do not tell: a step or a play as stiff as the gear counts like this error in
    /// every row. Slow motion under small loads needs it; where the data speak it is a hundredth of what they say.
    fn reluctance_nm(&self, values: &[f64]) -> Vec<f64> {
        let size_nm = RELUCTANCE_NM * (self.rows.len() as f64).sqrt() / self.stiffness_nm_rad();
        let steps = &values[SPRINGS + 1..DAMPING];
        steps.iter().map(|step| size_nm * step).collect()
    }

    fn law_parameters(&self, start: &[f64]) -> Vec<Parameter> {
        let stiffness = self.stiffness_nm_rad();
        let twist_rad = range(self.torsions_rad().into_iter());
        let each = start.iter().enumerate().map(|(place, start)| {
            let (name, bounds) = if place < ZERO {
                ("kinematic_error", [-twist_rad, twist_rad])
            } else if place == ZERO {
                ("zero_rad", [-twist_rad, twist_rad])
            } else if place == SPRINGS {
                (
                    "stiffness_steps_nm_rad, first",
                    [0.05 * stiffness, 10.0 * stiffness],
                )
            } else if place < PLAY_SPRINGS {
                (
                    "stiffness_steps_nm_rad",
                    [-2.0 * stiffness, 5.0 * stiffness],
                )
            } else if place < DAMPING {
                (PLAY_STIFFNESS, [0.0, 5.0 * stiffness])
            } else {
                ("damping_nm_s_rad", [-0.001 * stiffness, 0.02 * stiffness])
            };
            Parameter {
                name,
                start: *start,
                bounds,
            }
        });
        each.collect()
    }

    fn law_misses(
        &self,
        parameters: &FusionParameters,
        damping_nm_s_rad: f64,
        turned: &[Option<Turned>],
    ) -> Vec<f64> {
        let law = TorsionLaw::new(parameters);
        let error = KinematicError::new(&parameters.kinematic_error);
        let ratio = self.joint.gear_ratio;
        let mut plays = Plays::default();
        let mut rows = self.rows.iter().peekable();
        let mut misses = Vec::with_capacity(self.rows.len());
        for (row, turned) in turned.iter().enumerate() {
            let wanted = rows.next_if(|wanted| **wanted == row).is_some();
            let Some((motion, sine_and_cosine)) = turned else {
                continue;
            };
            let (error_rad, slope) = error.at(*sine_and_cosine);
            let torsion_rad = motion.motor_rad - error_rad - motion.link_rad - parameters.zero_rad;
            if wanted {
                let (elastic_nm, _) = law.torque_and_slope(torsion_rad, &plays);
                let rate_rad_s = (1.0 - ratio * slope) * motion.motor_rad_s - motion.link_rad_s;
                let torque_nm = elastic_nm + damping_nm_s_rad * rate_rad_s;
                misses.push(torque_nm - self.reference_nm[row]);
            }
            law.drag(torsion_rad, &mut plays);
        }
        misses
    }

    /// The readings as they are, with rates by a difference around each row.
    fn raw_motion(&self) -> Vec<Option<Motion>> {
        let samples = &self.log.samples;
        let ratio = self.joint.gear_ratio;
        (0..samples.len())
            .map(|row| {
                let before = &samples[row.checked_sub(RATE_ROWS)?];
                let (now, after) = (&samples[row], samples.get(row + RATE_ROWS)?);
                let cycles = after.cycle - before.cycle;
                if cycles > 4 * RATE_ROWS as u64 {
                    return None;
                }
                let time_s = cycles as f64 * self.period_s();
                let motion = Motion {
                    motor_rad: now.motor_position_rad / ratio,
                    motor_rad_s: (after.motor_position_rad - before.motor_position_rad)
                        / (ratio * time_s),
                    link_rad: now.link_position_rad,
                    link_rad_s: (after.link_position_rad - before.link_position_rad) / time_s,
                };
                let sum =
                    motion.motor_rad + motion.motor_rad_s + motion.link_rad + motion.link_rad_s;
                sum.is_finite().then_some(motion)
            })
            .collect()
    }

    fn filter(&self, law: &FusionParameters) -> Result<Fusion, EstimatorError> {
        Fusion::new(law, self.joint, self.period_s()).map_err(|source| EstimatorError::Resolution {
            joint: self.joint.name.clone(),
            source,
        })
    }

    /// The motion that the filter makes of the readings.
    fn filtered_motion(
        &self,
        law: &FusionParameters,
    ) -> Result<Vec<Option<Motion>>, EstimatorError> {
        let mut filter = self.filter(law)?;
        let each = self.log.samples.iter().map(|sample| {
            let known = filter.estimate(sample).is_ok();
            known.then(|| filter.motion())
        });
        Ok(each.collect())
    }

    /// Does a filter that follows stiffness leave it alone on the calibration's own recording?
    fn can_follow_stiffness(
        &self,
        law: &FusionParameters,
        found: &mut Calibration,
    ) -> Result<bool, EstimatorError> {
        let mut filter = self.filter(law)?;
        let mut worst = 0.0_f64;
        for sample in &self.log.samples {
            if filter.estimate(sample).is_ok() {
                worst = worst.max((filter.stiffness_factor() - 1.0).abs());
            }
        }
        let can = worst <= STIFFNESS_ERROR_MAX;
        if !can {
            found.findings.push(format!(
                "joint `{}`, fusion: a change of stiffness is not followed: friction that depends on load would be taken for \
                 one of {:.0} % (at most {:.0} % can be allowed)",
                self.joint.name,
                100.0 * worst,
                100.0 * STIFFNESS_ERROR_MAX
            ));
        }
        Ok(can)
    }

    /// What to add to the filter's variance, moving and standing, so that 95 % of the errors lie within 1.96 standard deviations.
    fn model_stds_nm(
        &self,
        law: &FusionParameters,
        found: &mut Calibration,
    ) -> Result<(f64, f64), EstimatorError> {
        let mut filter = self.filter(law)?;
        let mut errors: [Vec<(f64, Estimate)>; 2] = [Vec::new(), Vec::new()];
        for (sample, reference_nm) in self.log.samples.iter().zip(&self.reference_nm) {
            let Ok(estimate) = filter.estimate(sample) else {
                continue;
            };
            if reference_nm.is_finite() {
                let stands = filter.motion().motor_rad_s.abs() < MOVING_RAD_S;
                errors[usize::from(stands)].push((estimate.torque_nm - reference_nm, estimate));
            }
        }
        let stds = errors.map(|errors| added_std_nm(&errors));
        let [Some(moving_nm), Some(resting_nm)] = stds else {
            let (missing, other) = if stds[0].is_none() {
                ("moves", stds[1])
            } else {
                ("stands", stds[0])
            };
            found.findings.push(format!(
                "joint `{}`, fusion: there is no row in which the joint {missing}; its standard deviation there is that of \
                 the other rows",
                self.joint.name
            ));
            let std_nm = other.unwrap_or(0.0);
            return Ok((std_nm, std_nm));
        };
        Ok((moving_nm, resting_nm))
    }
}

/// A motion, with sine and cosine of the motor angle.
type Turned = (Motion, (f64, f64));

fn values(law: &FusionParameters) -> Vec<f64> {
    let table = &law.kinematic_error;
    let terms = table.cosine_rad.iter().zip(&table.sine_rad);
    terms
        .flat_map(|(cosine, sine)| [*cosine, *sine])
        .chain([law.zero_rad])
        .chain(law.stiffness_steps_nm_rad.iter().copied())
        .chain(law.play_stiffnesses_nm_rad.iter().copied())
        .chain([law.damping_nm_s_rad])
        .collect()
}

/// Found by halving, between nothing and twice the largest error.
fn added_std_nm(errors: &[(f64, Estimate)]) -> Option<f64> {
    if errors.is_empty() {
        return None;
    }
    let within = |added_nm: f64| {
        let inside = errors.iter().filter(|(error_nm, estimate)| {
            let std_nm = estimate.std_nm.unwrap_or(0.0).hypot(added_nm);
            error_nm.abs() <= SIGMAS_95 * std_nm
        });
        inside.count() as f64 / errors.len() as f64
    };
    let most = errors.iter().map(|(error_nm, _)| error_nm.abs());
    let (mut low, mut high) = (0.0, 2.0 * most.fold(0.0, f64::max));
    if within(low) >= 0.95 {
        return Some(0.0);
    }
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if within(middle) < 0.95 {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(high)
}
