//! The static laws of motion that a joint's torque may hold beside the robot file: their columns, what more freedom costs them, and
//! the effect they are called.

use std::collections::BTreeMap;

use gap_report::Parameter;
use joint_twin::joint::JointModel;
use nalgebra::{DMatrix, DVector};
use recording_checks::units::GAIN;
use robot::Effect;

use super::motion::JointMotion;
use crate::effects::form::Wave;
use crate::evidence::told::{self, Called, MATERIALITY};
use crate::evidence::{AMPLITUDE_NATS, ERRORS, Fit, NAME_NATS, Presupposed};

/// Speeds of Stribeck's fall, as parts of the usual speed: 0.05 to 0.4, below which there are no rows and above which the law is
/// viscous friction's.
const STRIBECK_PARTS: [f64; 3] = [0.05, 0.15, 0.4];
/// What Coulomb and viscous friction cost less where nobody measured a joint's friction, in nats: every joint rubs, and it is the odds
/// of a cause nobody expects that a name costs. A law that corrects one of them costs more by what naming that one would cost, where it is
/// not named: with more, a friction of nothing would be named to save it.
const EXPECTED_NATS: f64 = 2.0;
/// By how many times its sliding friction a joint may stick more than it slides: greased steel on steel sticks with 0.11 to 0.23 of the load
/// and slides with 0.03 to 0.12 of it (Marks' Standard Handbook for Mechanical Engineers, friction), three times as much at most.
const STICKS: f64 = 2.0;
/// Cost of a freedom, in nats.
const FREEDOM_NATS: f64 = 0.5;

/// Up to which a joint creeps.
pub fn creeping_rad_s(usual_rad_s: f64) -> f64 {
    STRIBECK_PARTS[0] * usual_rad_s
}

/// A law of motion at one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Law {
    /// `s`, the bristles' bend (see [`Along::slip`]); `sign q̇` once the joint slips.
    Coulomb,
    /// `q̇`.
    Viscous,
    /// `q̇|q̇|`.
    Quadratic,
    /// `s · exp(-|q̇|/v)`, with v.
    Stribeck(f64),
    /// `|s|`: half the difference between the directions.
    Asymmetric,
    /// `s · |load|`.
    LoadDependent,
    /// 1.
    Offset,
    /// The torque that the file needs.
    TorqueConstant,
    /// `q̈`.
    Inertia,
    /// What the link's inertia about the joint's axis needs: of its acceleration in space, the other joints' included.
    LinkInertia,
    /// `sin q` and `cos q`.
    Gravity,
    /// `q`, from its mean on.
    Spring,
    /// Sine and cosine of so many times the motor's angle.
    Ripple(Repeats),
    /// `s` times those.
    PositionDependent(Repeats),
    /// `s` times the part of the longest recording, of so many seconds, that is over.
    Drift(f64),
}

/// How often something repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Repeats {
    /// Cycles per turn of the motor.
    pub cycles: u32,
    /// How many numbers of cycles it was chosen from.
    pub among: usize,
}

/// What the columns of laws are made of.
pub struct Along<'a> {
    /// The joint's motion.
    pub motion: &'a JointMotion,
    /// Turns of the motor per turn of the joint.
    pub gear_ratio: f64,
    /// Torque that is in proportion to a torque constant.
    pub in_proportion_nm: Vec<f64>,
    /// Torque that the gear carries.
    pub load_nm: &'a [f64],
    /// How far friction is bent: -1 to 1, and the sign of the velocity once the joint slips.
    pub slip: Vec<f64>,
    /// What a kg m² of the link about the joint's axis needs.
    pub link_inertia_nm: &'a [f64],
    /// Mean position.
    pub mean_rad: f64,
}

impl Repeats {
    /// Sine and cosine of the motor's angle, times something row by row.
    fn waves(self, along: &Along<'_>, factor: impl Fn(usize) -> f64) -> Vec<Vec<f64>> {
        let angle = |q: &f64| f64::from(self.cycles) * along.gear_ratio * q;
        [f64::sin, f64::cos]
            .map(|of| {
                let rows = along.motion.position_rad.iter().enumerate();
                rows.map(|(k, q)| factor(k) * of(angle(q))).collect()
            })
            .to_vec()
    }
}

impl Law {
    /// All that a joint may have. `carries`: whether the file needs torque here; `gravity_part`: part of gravity that lies across the
    /// axis.
    pub fn of_joint(speed_rad_s: f64, carries: bool, gravity_part: f64) -> Vec<Self> {
        let mut all = vec![
            Self::Coulomb,
            Self::Viscous,
            Self::Offset,
            Self::Quadratic,
            Self::Asymmetric,
            Self::Inertia,
            Self::LinkInertia,
            Self::Spring,
        ];
        all.extend(STRIBECK_PARTS.map(|part| Self::Stribeck(part * speed_rad_s)));
        if carries {
            all.extend([Self::LoadDependent, Self::TorqueConstant]);
        }
        if gravity_part > MATERIALITY {
            all.push(Self::Gravity);
        }
        all
    }

    /// Which of the laws are the same with another shape: one name.
    pub fn kind(self) -> usize {
        match self {
            Self::Coulomb => 0,
            Self::Viscous => 1,
            Self::Quadratic => 2,
            Self::Stribeck(_) => 3,
            Self::Asymmetric => 4,
            Self::LoadDependent => 5,
            Self::Offset => 6,
            Self::TorqueConstant => 7,
            Self::Inertia | Self::LinkInertia => 8,
            Self::Gravity => 9,
            Self::Spring => 10,
            Self::Ripple(_) => 11,
            Self::PositionDependent(_) => 12,
            Self::Drift(_) => 13,
        }
    }

    /// What the law costs beyond a name, in halves of a nat: how many other laws' shapes it can take on a usual motion. A delay, a
    /// soft gear or a wrong torque constant look like friction; a Stribeck term like any curve over velocity.
    pub fn freedom(self) -> f64 {
        match self {
            Self::Coulomb | Self::Viscous | Self::Offset => 0.0,
            Self::TorqueConstant
            | Self::Gravity
            | Self::Spring
            | Self::Inertia
            | Self::LinkInertia
            | Self::Ripple(_)
            | Self::PositionDependent(_)
            | Self::Drift(_)
            | Self::Asymmetric => 1.0,
            Self::Quadratic | Self::LoadDependent | Self::Stribeck(_) => 2.0,
        }
    }

    /// Laws that it corrects: without them it is one by longer odds where nobody measured them (effect heredity; Chipman, Bayesian
    /// variable selection with related predictors, Canadian Journal of Statistics 24 (1996) 17-36).
    fn corrects(self) -> &'static [Self] {
        match self {
            Self::Stribeck(_) => &[Self::Coulomb, Self::Viscous],
            Self::Quadratic => &[Self::Viscous],
            Self::Asymmetric
            | Self::LoadDependent
            | Self::PositionDependent(_)
            | Self::Drift(_) => &[Self::Coulomb],
            _ => &[],
        }
    }

    /// What it presupposes among all of a joint's laws where nobody measured its friction: places, and nats for each that is missing.
    pub fn presupposes(self, all: impl Iterator<Item = Self>) -> Presupposed {
        let places = all
            .enumerate()
            .filter(|(_, law)| self.corrects().contains(law));
        Presupposed {
            names: places.fold(0, |names, (place, _)| names | 1 << place),
            nats: NAME_NATS - EXPECTED_NATS,
        }
    }

    /// Whether every joint has it.
    pub fn is_expected(self) -> bool {
        matches!(self, Self::Coulomb | Self::Viscous)
    }

    /// What naming it costs, in nats. `expects_friction`: whether nobody measured the joint's.
    pub fn cost(self, expects_friction: bool) -> f64 {
        NAME_NATS
            - if expects_friction && self.is_expected() {
                EXPECTED_NATS
            } else {
                0.0
            }
            + FREEDOM_NATS * self.freedom()
            + AMPLITUDE_NATS * (self.amplitudes() - 1) as f64
            + (self.among() as f64).ln()
    }

    /// From how many shapes it was chosen by what the rows show.
    fn among(self) -> usize {
        match self {
            Self::Ripple(of) | Self::PositionDependent(of) => of.among,
            _ => 1,
        }
    }

    /// Standard deviation of its amplitude, where something is known of that before anything is seen: makers state torque constants to
    /// a tenth, and a current sensor may be off by as much again.
    pub fn deviation(self) -> Option<f64> {
        (self == Self::TorqueConstant).then_some(0.2)
    }

    /// Whether every joint may have it: friction and an offset of the torque.
    pub fn is_usual(self) -> bool {
        matches!(self, Self::Coulomb | Self::Viscous | Self::Offset)
    }

    /// Numbers that it has.
    pub fn amplitudes(self) -> usize {
        match self {
            Self::Gravity | Self::Ripple(_) | Self::PositionDependent(_) => 2,
            _ => 1,
        }
    }

    /// Its columns along a piece, Nm per unit of each amplitude.
    pub fn columns(self, along: &Along<'_>) -> Vec<Vec<f64>> {
        let rows = 0..along.slip.len();
        let q = |k: usize| along.motion.position_rad[k];
        let v = |k: usize| along.motion.velocity_rad_s[k];
        let slip = |k: usize| along.slip[k];
        let one = |of: &dyn Fn(usize) -> f64| vec![rows.clone().map(of).collect::<Vec<f64>>()];
        match self {
            Self::Coulomb => one(&slip),
            Self::Viscous => one(&v),
            Self::Quadratic => one(&|k| v(k) * v(k).abs()),
            Self::Stribeck(speed_rad_s) => {
                one(&|k| slip(k) * (-v(k).abs() / speed_rad_s.max(f64::MIN_POSITIVE)).exp())
            }
            Self::Asymmetric => one(&|k| slip(k).abs()),
            Self::LoadDependent => one(&|k| slip(k) * along.load_nm[k].abs()),
            Self::Offset => one(&|_| 1.0),
            Self::TorqueConstant => one(&|k| along.in_proportion_nm[k]),
            Self::Inertia => one(&|k| along.motion.acceleration_rad_s2[k]),
            Self::LinkInertia => one(&|k| along.link_inertia_nm[k]),
            Self::Gravity => vec![
                rows.clone().map(|k| q(k).sin()).collect(),
                rows.clone().map(|k| q(k).cos()).collect(),
            ],
            Self::Spring => one(&|k| q(k) - along.mean_rad),
            Self::Ripple(of) => of.waves(along, |_| 1.0),
            Self::PositionDependent(of) => of.waves(along, slip),
            Self::Drift(until_s) => one(&|k| slip(k) * along.motion.time_s[k] / until_s),
        }
    }

    /// Torque of the law at a constant velocity per unit of its first amplitude; none where it is no friction.
    pub fn friction_nm(self, velocity_rad_s: f64) -> Option<f64> {
        let sign = velocity_rad_s.signum();
        match self {
            Self::Coulomb => Some(sign),
            Self::Viscous => Some(velocity_rad_s),
            Self::Quadratic => Some(velocity_rad_s * velocity_rad_s.abs()),
            Self::Stribeck(speed_rad_s) => Some(sign * (-velocity_rad_s.abs() / speed_rad_s).exp()),
            // more one way and less the other
            Self::Asymmetric => Some(1.0),
            Self::PositionDependent(_) | Self::Drift(_) => Some(sign),
            _ => None,
        }
    }

    /// Its amplitude where and when it brakes least.
    fn least_braking(self, amplitudes: &[f64]) -> f64 {
        match self {
            Self::PositionDependent(_) => -Wave::of(amplitudes).size,
            Self::Drift(_) => amplitudes[0].min(0.0),
            _ => amplitudes[0],
        }
    }

    /// Limits of its first amplitude that no joint passes, by what the file has of the same kind already.
    pub fn limits(self, model: &JointModel, speed_rad_s: f64, inertia_kg_m2: f64) -> [f64; 2] {
        let friction = &model.friction;
        match self {
            Self::Coulomb => {
                let at = joint_model::friction::Sliding::at(speed_rad_s);
                [-friction.level_nm(&at), f64::INFINITY]
            }
            Self::Viscous => [-friction.fluid_drag_nm_s_rad(speed_rad_s), f64::INFINITY],
            // a gear whose friction is as large as its load holds that by itself
            Self::LoadDependent => {
                let known = friction.load_dependent.load_coefficient;
                [-known, 1.0 - known]
            }
            // the column is what the file needs, and the gain's inverse multiplies that
            Self::TorqueConstant => [1.0 / GAIN[1] - 1.0, 1.0 / GAIN[0] - 1.0],
            Self::Inertia => [-(inertia_kg_m2 + model.rotor_inertia_kg_m2), f64::INFINITY],
            Self::LinkInertia => [-inertia_kg_m2, f64::INFINITY],
            // grease thins as it warms
            Self::Drift(_) => [f64::NEG_INFINITY, 0.0],
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// The effect it is called, as a change against the file, from its amplitudes.
    pub fn effect(self, amplitudes: &[f64], told: &Told<'_>) -> Effect {
        // a name alone has none
        let of = |k: usize| amplitudes.get(k).copied().unwrap_or(0.0);
        let (value, both) = (of(0), [of(0), of(1)]);
        match self {
            Self::Coulomb => Effect::CoulombFriction { coulomb_nm: value },
            Self::Viscous => Effect::ViscousFriction {
                viscous_nm_s_rad: value,
            },
            Self::Quadratic => Effect::QuadraticFriction {
                quadratic_nm_s2_rad2: value,
            },
            Self::Stribeck(speed_rad_s) => Effect::StribeckFriction {
                stribeck_nm: value,
                stribeck_velocity_rad_s: speed_rad_s,
            },
            Self::Asymmetric => Effect::AsymmetricFriction {
                asymmetry_nm: value,
            },
            Self::LoadDependent => Effect::LoadDependentFriction {
                load_coefficient: value,
            },
            // the effect is added to the motor's torque, and what the joint needs of it is less by that
            Self::Offset => Effect::TorqueOffset { offset_nm: -value },
            Self::TorqueConstant => Effect::TorqueConstantError {
                gain: 1.0 / (1.0 + value),
            },
            Self::Inertia => {
                // a rotor cannot be lighter than nothing, and a sensor behind the gear does not feel it
                if told.feels_rotor && value > -told.model.rotor_inertia_kg_m2 {
                    Effect::RotorInertia {
                        inertia_kg_m2: value / told.model.gear_ratio.powi(2),
                    }
                } else {
                    Effect::LinkInertia {
                        inertia_kg_m2: value,
                    }
                }
            }
            Self::LinkInertia => Effect::LinkInertia {
                inertia_kg_m2: value,
            },
            Self::Gravity => Effect::GravityTorque {
                sin_nm: value,
                cos_nm: both[1],
            },
            Self::Spring => Effect::JointSpring {
                stiffness_nm_rad: value,
                rest_rad: told.mean_rad,
            },
            // the motor helps by it, and what the joint needs of it is less by that
            Self::Ripple(of) => {
                let of_motor = both.map(|nm| -nm / told.model.gear_ratio);
                let Wave { size, phase_rad } = Wave::of(&of_motor);
                Effect::TorqueRipple {
                    amplitude_nm: size,
                    cycles_per_motor_rev: f64::from(of.cycles),
                    phase_rad,
                }
            }
            Self::PositionDependent(of) => {
                let Wave { size, phase_rad } = Wave::of(&both);
                Effect::PositionDependentFriction {
                    amplitude_nm: size,
                    cycles_per_motor_rev: f64::from(of.cycles),
                    phase_rad,
                }
            }
            Self::Drift(until_s) => Effect::ThermalFrictionDrift {
                drift_nm_s: Some(value / until_s),
                time_constant_s: None,
                change_nm: None,
            },
        }
    }

    /// Parameters of its effect that are estimated: name, and its change per change of each amplitude.
    pub fn parameters(self, amplitudes: &[f64], told: &Told<'_>) -> Vec<(&'static str, Vec<f64>)> {
        let value = amplitudes.first().copied().unwrap_or(0.0);
        let of_wave = |per: f64| {
            let size = Wave::of(amplitudes).size.max(f64::MIN_POSITIVE);
            let [sin, cos] = [0, 1].map(|k| amplitudes[k] / size);
            vec![
                ("amplitude_nm", vec![per * sin, per * cos]),
                ("phase_rad", vec![-cos / size, sin / size]),
            ]
        };
        match self {
            Self::Coulomb => vec![("coulomb_nm", vec![1.0])],
            Self::Viscous => vec![("viscous_nm_s_rad", vec![1.0])],
            Self::Quadratic => vec![("quadratic_nm_s2_rad2", vec![1.0])],
            Self::Stribeck(_) => vec![("stribeck_nm", vec![1.0])],
            Self::Asymmetric => vec![("asymmetry_nm", vec![1.0])],
            Self::LoadDependent => vec![("load_coefficient", vec![1.0])],
            Self::Offset => vec![("offset_nm", vec![-1.0])],
            Self::TorqueConstant => vec![("gain", vec![-(1.0 + value).powi(-2)])],
            Self::Inertia => {
                let rotor = matches!(self.effect(amplitudes, told), Effect::RotorInertia { .. });
                let per = if rotor {
                    told.model.gear_ratio.powi(-2)
                } else {
                    1.0
                };
                vec![("inertia_kg_m2", vec![per])]
            }
            Self::LinkInertia => vec![("inertia_kg_m2", vec![1.0])],
            Self::Gravity => vec![("sin_nm", vec![1.0, 0.0]), ("cos_nm", vec![0.0, 1.0])],
            Self::Spring => vec![("stiffness_nm_rad", vec![1.0])],
            Self::Ripple(_) => of_wave(told.model.gear_ratio.abs().recip()),
            Self::PositionDependent(_) => of_wave(1.0),
            Self::Drift(until_s) => vec![("drift_nm_s", vec![until_s.recip()])],
        }
    }
}

/// What a law's name depends on beside its amplitudes.
pub struct Told<'a> {
    /// The joint by its file.
    pub model: &'a JointModel,
    /// Whether the torque was taken before the gear.
    pub feels_rotor: bool,
    /// Mean position.
    pub mean_rad: f64,
}

/// Laws as they are called at one joint.
pub struct Laws<'a> {
    /// All of them.
    pub all: Vec<Law>,
    /// What their names depend on.
    pub told: Told<'a>,
}

impl Called for Laws<'_> {
    fn items(&self) -> usize {
        self.all.len()
    }

    fn kind(&self, item: usize) -> usize {
        self.all[item].kind()
    }

    fn is_usual(&self, item: usize) -> bool {
        self.all[item].is_usual()
    }

    fn effect(&self, item: usize, amplitudes: &[f64]) -> Effect {
        self.all[item].effect(amplitudes, &self.told)
    }

    fn parameters(
        &self,
        item: usize,
        amplitudes: &[f64],
        covariance: &DMatrix<f64>,
    ) -> BTreeMap<String, Parameter> {
        let law = self.all[item];
        let mut parameters = told::parameters(&law.effect(amplitudes, &self.told));
        for (name, per) in law.parameters(amplitudes, &self.told) {
            if let Some(parameter) = parameters.get_mut(name) {
                let per = DVector::from_vec(per);
                parameter.std = (covariance * &per).dot(&per).max(0.0).sqrt();
            }
        }
        parameters
    }
}

/// Whether a fit is one that a joint can have: every value within its limits, friction that brakes at every speed, and by which a joint
/// does not stick less than it slides, but for how it creeps, nor more than any does; each by two standard errors. `unmeasured_coulomb_nm`: what the file says of
/// Coulomb friction where nobody measured the joint's; a curve that was measured may be corrected either way.
pub fn is_possible(
    fit: &Fit,
    law_of: impl Fn(usize) -> Law,
    limits: impl Fn(Law) -> [f64; 2],
    nominal_friction_nm: impl Fn(f64) -> f64,
    unmeasured_coulomb_nm: Option<f64>,
    speed_rad_s: f64,
) -> bool {
    let mut place = 0;
    let mut braking = Vec::new();
    for (item, amplitudes) in &fit.amplitudes {
        let law = law_of(*item);
        let [least, most] = limits(law);
        let error = ERRORS * fit.covariance[(place, place)].max(0.0).sqrt();
        let Some(value) = amplitudes.first() else {
            continue;
        };
        // a gain beyond its range is another thing, and noise passes the limits of others
        let error = if law == Law::TorqueConstant {
            0.0
        } else {
            error
        };
        if value + error < least || value - error > most {
            return false;
        }
        braking.push((place, law, law.least_braking(amplitudes)));
        place += amplitudes.len();
    }
    braking.retain(|(_, law, _)| law.friction_nm(1.0).is_some());
    if braking.is_empty() {
        return true;
    }
    let error = |variance: f64| ERRORS * variance.max(0.0).sqrt();
    let stribeck = braking
        .iter()
        .find(|(_, law, _)| matches!(law, Law::Stribeck(_)));
    if let (Some(file_nm), Some((own, law, excess_nm))) = (unmeasured_coulomb_nm, stribeck) {
        let mut room_nm = STICKS * file_nm - excess_nm;
        let mut variance = fit.covariance[(*own, *own)];
        let creeps = *law == Law::Stribeck(creeping_rad_s(speed_rad_s));
        let falls = creeps || excess_nm + error(variance) >= 0.0;
        if let Some((of, _, nm)) = braking.iter().find(|(_, law, _)| *law == Law::Coulomb) {
            room_nm += STICKS * nm;
            variance += STICKS.powi(2) * fit.covariance[(*of, *of)]
                - 2.0 * STICKS * fit.covariance[(*own, *of)];
        }
        if !falls || room_nm + error(variance) < 0.0 {
            return false;
        }
    }
    /// Speeds at which friction is looked at.
    const SPEEDS: usize = 25;
    let speeds = (1..=SPEEDS).map(|k| speed_rad_s * k as f64 / SPEEDS as f64);
    let both_ways = speeds.flat_map(|speed_rad_s| [speed_rad_s, -speed_rad_s]);
    both_ways.into_iter().all(|v| {
        let at = |law: Law| law.friction_nm(v).unwrap_or(0.0);
        let added: f64 = braking.iter().map(|(_, law, value)| value * at(*law)).sum();
        let mut variance = 0.0;
        for (i, one, _) in &braking {
            for (j, other, _) in &braking {
                variance += at(*one) * fit.covariance[(*i, *j)] * at(*other);
            }
        }
        v.signum() * (nominal_friction_nm(v) + added) + error(variance) >= 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_sticks_no_less_than_it_slides_and_no_more_than_joints_do() {
        let laws = [Law::Coulomb, Law::Viscous, Law::Stribeck(0.1)];
        let is_possible = |values: [f64; 3], unmeasured_coulomb_nm: Option<f64>| {
            let all = values
                .iter()
                .enumerate()
                .filter(|(_, value)| **value != 0.0);
            let amplitudes: Vec<_> = all.map(|(item, value)| (item, vec![*value])).collect();
            let fit = Fit {
                covariance: DMatrix::identity(amplitudes.len(), amplitudes.len()) * 1e-4,
                amplitudes,
                beside: Vec::new(),
                predicted_nm: Vec::new(),
            };
            let anything = |_: Law| [f64::NEG_INFINITY, f64::INFINITY];
            super::is_possible(
                &fit,
                |item| laws[item],
                anything,
                |_| 0.0,
                unmeasured_coulomb_nm,
                1.0,
            )
        };
        assert!(is_possible([2.0, 5.0, 3.0], Some(0.0)));
        // without friction that it slides with
        assert!(!is_possible([0.0, 5.0, 3.0], Some(0.0)));
        assert!(is_possible([0.0, 5.0, 3.0], Some(2.0)));
        // a rise is no fall, unless it is how the joint creeps
        assert!(!is_possible([4.0, 0.0, -2.0], Some(0.0)));
        let slowest = Law::Stribeck(STRIBECK_PARTS[0]);
        let creeping = [(0, vec![4.0]), (1, vec![-2.0])];
        let fit = Fit {
            covariance: DMatrix::identity(2, 2) * 1e-4,
            amplitudes: creeping.to_vec(),
            beside: Vec::new(),
            predicted_nm: Vec::new(),
        };
        let anything = |_: Law| [f64::NEG_INFINITY, f64::INFINITY];
        let law_of = |item: usize| [Law::Coulomb, slowest][item];
        assert!(super::is_possible(
            &fit,
            law_of,
            anything,
            |_| 0.0,
            Some(0.0),
            1.0
        ));
        // what was measured is corrected either way
        assert!(is_possible([4.0, 0.0, -2.0], None));
    }

    #[test]
    fn no_friction_of_nothing_is_named_to_save_what_its_absence_costs() {
        let all = [Law::Coulomb, Law::Viscous, Law::LoadDependent];
        let presupposed = Law::LoadDependent.presupposes(all.into_iter());
        assert_eq!(presupposed.names, 1);
        assert!(presupposed.nats <= Law::Coulomb.cost(true));
    }
}
