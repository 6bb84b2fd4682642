//! What the robot file already knows and may be a little wrong about, and what no file speaks of but every joint has:
//! refitted within its tolerance before anything is called a gap.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use joint_model::friction::{Sliding, StribeckFriction};
use joint_model::harmonic::Harmonic;
use joint_model::rigid_body::{Chain, ChainError, Link};
use robot::{Robot, Tolerance};

use crate::joint::JointModel;
use crate::load::{LoadChange, Motion};

/// Values whose tolerance moves the joint's torque less than this part of what the most important one does do not count: they are not
/// seen beside it.
pub const PART_MIN: f64 = 0.05;
/// Relative change by which a link's share of the load is found.
const LINK_STEP: f64 = 0.1;
/// How far the corners of a published table may be rounded off.
const ROUNDING_NM: f64 = 1.0;
/// In creeping motion friction is less than its law says: by about this part, below about this speed. First of joints whose bristles
/// have not all bent; then of those that drag as they begin to move, as an oil's film does and the smoothed sign of a simulator.
const CREEPS: [(f64, f64); 2] = [(0.15, 0.015), (0.3, 0.003)];
/// Friction that bristles carry follows a wavy level otherwise than a law does: part of the level's amplitude, 0.10 to 0.13 on
/// development robots, and how many harmonics are looked at.
const WAVINESS_PART: f64 = 0.06;
const WAVY_TERMS: usize = 3;
/// Standard deviation of the time between readings of a joint's two encoders, or of its torque and its encoder, as a part of the time
/// between samples: who reads them one after the other does so within about one.
const SKEW_PART: f64 = 0.5;
/// Standard deviation of the difference between their zeros.
const ZERO_RAD: f64 = 1e-3;
/// A value that no joint is without is no less than this part of the file's.
const NEEDED_PART: f64 = 0.1;
/// Natural logarithm of the factor by which a presliding length may be off.
const PRESLIDING_LN: f64 = 1.0;
/// No law of friction, gear or drive is truer than this part of its values, however well it is fitted.
pub const LAW: f64 = 0.03;
/// Steps in which the inertia that a link can spare is found.
const HALVINGS: usize = 30;

/// A value of the robot file, or a property of every joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Known {
    /// One of the joint's own values, by its place among all that the file says of it.
    File(usize),
    /// What bristles make of a harmonic of friction: a torque over the same angle, whatever the direction, in phase with it
    /// (0) or a quarter cycle before (1).
    Waviness(usize, usize),
    /// A link's mass, its inertia about its centre aside.
    Mass(usize),
    /// Where a link's centre of mass is, along an axis of its joint's frame.
    Centre(usize, usize),
    /// A link's inertia about its centre of mass.
    Inertia(usize),
    /// How far friction bends before it slips.
    Presliding,
    /// Corners of the load torque.
    Rounding,
    /// How much less friction there is in creeping motion, the slower of two ways: joint-side torque.
    Creep(usize),
    /// How much later the link's encoder is read than the motor's.
    Skew,
    /// How much later a torque acts than the row it is recorded in.
    Instant,
    /// How much later the encoders are read than the torque that a drive reports beside its command: a row may hold what it made before
    /// the row's command took effect, or after.
    Reported,
    /// Zero of the link's encoder less that of the motor's.
    Zero,
}

impl Known {
    /// Whether it is of a link, and so of the load of every joint before it.
    pub fn is_of_links(self) -> bool {
        matches!(self, Self::Mass(_) | Self::Centre(..) | Self::Inertia(_))
    }

    /// Multiplies what it is of a chain's links; nothing if it is not of links.
    pub fn multiply(self, links: &mut [Link], factor: f64) {
        match self {
            Self::Mass(link) => links[link].mass_kg *= factor,
            Self::Centre(link, axis) => links[link].centre_of_mass_m[axis] *= factor,
            Self::Inertia(link) => links[link].inertia_kg_m2 *= factor,
            _ => {}
        }
    }
}

/// A value of the robot file.
struct FileValue<'a> {
    /// Its name among the file's tolerances.
    name: &'static str,
    /// The numbers that are off together.
    numbers: Vec<&'a mut f64>,
    /// Whether there is no joint without it.
    is_needed: bool,
}

/// All that the robot file says of a joint itself. What else is in its place among them stays in it whatever is added to the friction.
fn of_file(model: &mut JointModel) -> Vec<FileValue<'_>> {
    let mut all = Vec::new();
    let mut add = |name, numbers, is_needed| {
        all.push(FileValue {
            name,
            numbers,
            is_needed,
        });
    };
    let friction = &mut model.friction;
    if let Some(curve) = &mut friction.curve {
        for row in [&mut curve.positive, &mut curve.negative] {
            for number in [
                &mut row.f0_nm,
                &mut row.fv_nm_s_rad,
                &mut row.fs_nm,
                &mut row.vc_rad_s,
            ] {
                add("direction_friction", vec![number], false);
            }
        }
    }
    if let Some(law) = &mut friction.load_torque {
        for row in [&mut law.positive, &mut law.negative] {
            add("load_torque", row.slopes.iter_mut().collect(), false);
        }
    }
    if let Some(lookup) = &mut friction.lookup {
        let levels = [&mut lookup.positive_nm, &mut lookup.negative_nm].into_iter();
        let levels = levels.flat_map(|row| Arc::make_mut(row).iter_mut());
        add("friction_table", levels.collect(), false);
    }
    let load = &mut friction.load_dependent.load_coefficient;
    for (name, number) in [
        ("coulomb_nm", &mut friction.coulomb.coulomb_nm),
        ("viscous_nm_s_rad", &mut friction.viscous.viscous_nm_s_rad),
        (
            "quadratic_nm_s2_rad2",
            &mut friction.quadratic.quadratic_nm_s2_rad2,
        ),
        ("asymmetry_nm", &mut friction.asymmetric.asymmetry_nm),
        ("load_coefficient", load),
    ] {
        add(name, vec![number], false);
    }
    if model.stiffness_is_known {
        add("stiffness_nm_rad", vec![&mut model.stiffness_nm_rad], true);
    }
    let rotor = &mut model.rotor_inertia_kg_m2;
    add("rotor_inertia_kg_m2", vec![rotor], true);
    for term in &mut friction.periodic {
        add("amplitude_nm", vec![&mut term.amplitude_nm], false);
    }
    for term in &mut friction.stribeck {
        add("stribeck_nm", vec![&mut term.stribeck_nm], false);
        let velocity = &mut term.stribeck_velocity_rad_s;
        add("stribeck_velocity_rad_s", vec![velocity], true);
    }
    all
}

/// Something known, with how well.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownValue {
    /// What.
    pub known: Known,
    /// Standard deviation: relative for values of the file, else in the property's own unit.
    pub deviation: f64,
}

impl KnownValue {
    /// Whether it cannot be negative.
    pub fn is_positive(&self) -> bool {
        matches!(self.known, Known::Rounding | Known::Creep(_))
    }

    /// A chain whose link has [`LINK_STEP`] more of it; none if no body can.
    fn changed(&self, chain: &Chain) -> Option<Chain> {
        let mut links = chain.links().to_vec();
        self.known.multiply(&mut links, 1.0 + LINK_STEP);
        Chain::new(&links, chain.gravity_m_s2(), chain.tool()).ok()
    }

    /// Changes the model by so many standard deviations.
    pub fn apply(&self, model: &mut JointModel, deviations: f64) {
        let change = deviations * self.deviation;
        let friction = &mut model.friction;
        match self.known {
            Known::File(place) => {
                let value = &mut of_file(model)[place];
                let factor = if value.is_needed {
                    (1.0 + change).max(NEEDED_PART)
                } else {
                    1.0 + change
                };
                for number in &mut value.numbers {
                    **number *= factor;
                }
            }
            Known::Waviness(term, quarter) if change != 0.0 => {
                let law = &friction.periodic[term];
                model.torque_ripple.push(Harmonic {
                    amplitude: change * law.amplitude_nm / model.gear_ratio,
                    cycles_per_rev: law.cycles_per_motor_rev,
                    phase_rad: law.phase_rad + quarter as f64 * FRAC_PI_2,
                });
            }
            Known::Waviness(..) => {}
            Known::Presliding => model.presliding_rad *= change.exp(),
            Known::Rounding => {
                if let Some(law) = &mut friction.load_torque {
                    law.knee_rounding_nm += change.max(0.0);
                }
            }
            Known::Creep(way) => {
                // there is room, or it was not to be refitted
                friction.stribeck.push(StribeckFriction {
                    stribeck_nm: -change.max(0.0),
                    stribeck_velocity_rad_s: CREEPS[way].1,
                });
            }
            Known::Skew => model.link_skew_s += change,
            Known::Instant => model.command_delay_s += change,
            Known::Reported => {
                let delays_s = model.encoder_delays_s.iter_mut();
                delays_s.for_each(|delay_s| *delay_s += change);
            }
            Known::Zero => model.link_zero_rad += change,
            Known::Mass(_) | Known::Centre(..) | Known::Inertia(_) => {}
        }
    }
}

/// Time between samples, where it tells how well something is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Every {
    /// Where both encoders are recorded.
    pub both_s: Option<f64>,
    /// Where a torque may be any instant's between two samples.
    pub torque_s: Option<f64>,
    /// Where a torque is reported beside its command.
    pub reported_s: Option<f64>,
}

/// What is known of a joint, its links aside.
pub fn of_joint(model: &JointModel, tolerance: &Tolerance, every: Every) -> Vec<KnownValue> {
    let mut model = model.clone();
    let is_there = |value: &FileValue<'_>| value.numbers.iter().any(|number| **number != 0.0);
    let of_file = of_file(&mut model).into_iter().enumerate();
    let of_file = of_file.map(|(place, value)| KnownValue {
        known: Known::File(place),
        deviation: if is_there(&value) {
            tolerance.of(value.name)
        } else {
            0.0
        },
    });
    let mut all: Vec<KnownValue> = of_file.filter(|value| value.deviation > 0.0).collect();
    let friction = &model.friction;
    let mut beside = |known: Known, deviation: f64| all.push(KnownValue { known, deviation });
    beside(Known::Presliding, PRESLIDING_LN);
    for term in 0..friction.periodic.len().min(WAVY_TERMS) {
        beside(Known::Waviness(term, 0), WAVINESS_PART);
        beside(Known::Waviness(term, 1), WAVINESS_PART);
    }
    for (way, (part, speed_rad_s)) in CREEPS.into_iter().enumerate() {
        let friction_nm = friction.level_nm(&Sliding::at(speed_rad_s));
        let has_room = friction.stribeck.remaining_capacity() >= CREEPS.len();
        if friction_nm > 0.0 && has_room {
            beside(Known::Creep(way), part * friction_nm);
        }
    }
    if friction.load_torque.is_some() {
        beside(Known::Rounding, ROUNDING_NM);
    }
    if let Some(period_s) = every.both_s {
        beside(Known::Skew, SKEW_PART * period_s);
        beside(Known::Zero, ZERO_RAD);
    }
    if let Some(period_s) = every.torque_s {
        beside(Known::Instant, SKEW_PART * period_s);
    }
    if let Some(period_s) = every.reported_s {
        beside(Known::Reported, SKEW_PART * period_s);
    }
    all
}

/// How a load changes with inertia added to the joint's link about its axis, per kg m².
pub fn link_inertia(robot: &Robot, joint: usize, motion: &Motion) -> LoadChange {
    let Ok(chain) = with_link_inertia(robot, joint, 1.0) else {
        return LoadChange::default();
    };
    let loads = motion.at_knots_of(&[robot.chain.clone(), chain], joint);
    LoadChange::between(&loads[0], &loads[1])
}

/// What can be taken off a link's inertia about its joint's axis and leave a body: no more than it has, and not so much that
/// another axis has less than none.
pub fn spare_link_inertia_kg_m2(robot: &Robot, joint: usize) -> f64 {
    let link = &robot.chain.links()[joint];
    let axis = link.axis.into_inner();
    let mut spare_kg_m2 = 0.0;
    let mut step_kg_m2 = axis.dot(&(link.inertia_kg_m2 * axis));
    for _ in 0..HALVINGS {
        if with_link_inertia(robot, joint, -(spare_kg_m2 + step_kg_m2)).is_ok() {
            spare_kg_m2 += step_kg_m2;
        }
        step_kg_m2 *= 0.5;
    }
    spare_kg_m2
}

fn with_link_inertia(robot: &Robot, joint: usize, added_kg_m2: f64) -> Result<Chain, ChainError> {
    let inertia_kg_m2 = added_kg_m2;
    robot::changed_chain(
        robot.chain.links(),
        robot.chain.gravity_m_s2(),
        nalgebra::Isometry3::identity(),
        [(Some(joint), &robot::Effect::LinkInertia { inertia_kg_m2 })],
    )
}

/// The values of links that matter to a joint along the motions, each with how the load changes by a standard deviation.
pub fn of_links(
    robot: &Robot,
    joint: usize,
    motions: &[&Motion],
) -> Vec<(KnownValue, Vec<LoadChange>)> {
    let links = robot.chain.links();
    let axes = |link: usize| (0..3).map(move |axis| Known::Centre(link, axis));
    let all = (joint..links.len())
        .flat_map(|link| {
            [Known::Mass(link), Known::Inertia(link)]
                .into_iter()
                .chain(axes(link))
        })
        .filter_map(|known| {
            let (name, is_there) = match known {
                Known::Centre(link, axis) => (
                    "centre_of_mass_m",
                    links[link].centre_of_mass_m[axis] != 0.0,
                ),
                Known::Inertia(_) => ("inertia_kg_m2", true),
                _ => ("mass_kg", true),
            };
            let deviation = robot.tolerance.of(name);
            (is_there && deviation > 0.0).then_some(KnownValue { known, deviation })
        });
    let values: Vec<KnownValue> = all
        .filter(|value| value.changed(&robot.chain).is_some())
        .collect();
    let along: Vec<Vec<LoadChange>> = motions
        .iter()
        .map(|motion| link_changes(&robot.chain, joint, motion, &values))
        .collect();
    let mut found: Vec<(KnownValue, Vec<LoadChange>, f64)> = Vec::new();
    for (place, value) in values.into_iter().enumerate() {
        let changes: Vec<LoadChange> = along.iter().map(|of| of[place].clone()).collect();
        let sizes_nm = changes
            .iter()
            .zip(motions)
            .map(|(change, motion)| motion.rms_nm(joint, change));
        let size_nm = sizes_nm.fold(0.0, f64::max);
        found.push((value, changes, size_nm));
    }
    let largest_nm = found
        .iter()
        .map(|(.., size_nm)| *size_nm)
        .fold(0.0, f64::max);
    found
        .into_iter()
        .filter(|(.., size_nm)| *size_nm > PART_MIN * largest_nm)
        .map(|(value, changes, _)| (value, changes))
        .collect()
}

/// How a joint's load changes by a standard deviation of each of these values of links.
pub(crate) fn link_changes(
    chain: &Chain,
    joint: usize,
    motion: &Motion,
    values: &[KnownValue],
) -> Vec<LoadChange> {
    let own = values.iter().map(|value| value.changed(chain));
    // a chain that could not be is not changed
    let own = own.map(|changed| changed.unwrap_or_else(|| chain.clone()));
    let chains: Vec<Chain> = [chain.clone()].into_iter().chain(own).collect();
    let loads = motion.at_knots_of(&chains, joint);
    let both = values.iter().zip(&loads[1..]);
    both.map(|(value, load)| {
        LoadChange::between(&loads[0], load).times(value.deviation / LINK_STEP)
    })
    .collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn friction_is_less_in_creeping_motion_only_and_never_pushes() {
        let robot = robot::load("shd17").unwrap();
        let nominal = JointModel::nominal(&robot, 0);
        let all = of_joint(&nominal, &robot.tolerance, Every::default());
        let creeps = all
            .iter()
            .filter(|value| matches!(value.known, Known::Creep(_)));
        assert_eq!(creeps.clone().count(), CREEPS.len());
        for (value, (part, speed_rad_s)) in creeps.zip(CREEPS) {
            let level_nm = |deviations: f64, speed_rad_s: f64| {
                let mut model = nominal.clone();
                value.apply(&mut model, deviations);
                model.friction.level_nm(&Sliding::at(speed_rad_s))
            };
            let less = |speeds: f64| {
                1.0 - level_nm(1.0, speeds * speed_rad_s) / level_nm(0.0, speeds * speed_rad_s)
            };
            assert!(less(0.0) > 0.8 * part && less(10.0) < 1e-3 * part);
            assert_eq!(level_nm(-1.0, 0.0), level_nm(0.0, 0.0));
            assert_eq!(level_nm(20.0, 0.0), nominal.friction.least_nm);
        }
    }

    #[test]
    fn a_link_spares_what_leaves_a_body() {
        let robot = robot::load("pa10").unwrap();
        for joint in 0..robot.joints.len() {
            let spare_kg_m2 = spare_link_inertia_kg_m2(&robot, joint);
            assert!(spare_kg_m2 > 0.0, "{joint}");
            assert!(with_link_inertia(&robot, joint, -spare_kg_m2).is_ok());
            assert!(with_link_inertia(&robot, joint, -1.001 * spare_kg_m2).is_err());
        }
    }
}
