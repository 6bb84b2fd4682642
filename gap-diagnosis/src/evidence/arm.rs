//! Causes that the whole arm shares, a payload, wrong masses or a tilted base: one set of amplitudes in the models of all joints.
//!
//! Each joint's rows say something of the amplitudes beside its own names. What the others say is a prior to each: Gaussian messages,
//! which make the joint fits one fit of all joints (Bishop, Pattern Recognition and Machine Learning, 2006, section 8.4.4).

use std::collections::BTreeMap;

use gap_report::{JointShare, NamedEffect, SharedEffect};
use nalgebra::{DMatrix, DVector};
use robot::{Effect, Robot};

use super::told;
use super::{AMPLITUDE_NATS, ERRORS, Message, NAME_NATS};

/// Rounds in which joints tell each other of a cause: a payload's inertia is quadratic in its moments, which settle to a hundredth in three.
pub const ROUNDS: usize = 3;
/// One standard deviation of what links weigh, where their centres lie and how they spread, where the file is wrong of them, as a part of
/// the file's: half of the middle one of 21 masses of public arms that torques refute (0.65), which are the worst.
pub const LINKS_WRONG: f64 = 0.3;
/// Values of a link: its mass, its centre along three axes, and its inertia.
pub const OF_LINK: usize = 5;

/// A cause that the arm may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Mass, and first moment along the axes of the last link's frame.
    Payload,
    /// By how much later a reference reaches every drive than it was recorded.
    Delay,
    /// Masses, centres and inertias of so many links, in standard deviations; the last of several causes.
    Masses(usize),
    /// Roll and pitch of the base.
    Tilt,
}

impl Cause {
    /// Those that a simulation of the arm has.
    pub const OF_MASSES: [Self; 2] = [Self::Payload, Self::Tilt];

    /// Numbers that it has.
    pub fn amplitudes(self) -> usize {
        match self {
            Self::Payload => 4,
            Self::Delay => 1,
            Self::Masses(links) => OF_LINK * links,
            Self::Tilt => 2,
        }
    }

    /// Standard deviation of each amplitude before anything was seen, far beyond what arms carry, wait for or stand on: 100 kg, 100 kg m;
    /// 1 s; 1 rad. Values of links are in standard deviations.
    pub fn deviation(self) -> f64 {
        match self {
            Self::Payload => 100.0,
            Self::Delay | Self::Masses(_) | Self::Tilt => 1.0,
        }
    }

    /// The effect's name; none where it has another one at each joint.
    pub fn name(self) -> Option<&'static str> {
        match self {
            Self::Payload => Some("payload"),
            Self::Delay => Some("command_delay"),
            Self::Masses(_) => None,
            Self::Tilt => Some("base_tilt"),
        }
    }

    /// Whether it is what links are.
    pub fn is_of_links(&self) -> bool {
        matches!(self, Self::Masses(_))
    }

    /// What it is called at these amplitudes; none where it has another name at each joint.
    fn effect(self, said: &DVector<f64>) -> Option<Effect> {
        Some(match self {
            Self::Payload => Effect::Payload {
                mass_kg: said[0],
                centre_m: [1, 2, 3].map(|k| said[k] / said[0]),
            },
            Self::Delay => Effect::CommandDelay { delay_s: said[0] },
            Self::Masses(_) => return None,
            Self::Tilt => Effect::BaseTilt {
                roll_rad: said[0],
                pitch_rad: said[1],
            },
        })
    }

    /// The effect's numbers with their standard errors, from those of the amplitudes; a centre's follows from moment and mass.
    fn errors(self, said: &DVector<f64>, covariance: &DMatrix<f64>) -> Vec<(&'static str, f64)> {
        let error = |of: &[f64]| {
            let slope = DVector::from_column_slice(of);
            (covariance * &slope).dot(&slope).max(0.0).sqrt()
        };
        match self {
            Self::Payload => {
                let mass_kg = said[0];
                // `centre_m` is the distance along z
                let places = [
                    ("centre_m_x", 1),
                    ("centre_m_y", 2),
                    ("centre_m_z", 3),
                    ("centre_m", 3),
                ];
                let centre = places.into_iter().map(|(name, k)| {
                    let mut slope = [0.0; 4];
                    (slope[0], slope[k]) = (-said[k] / mass_kg.powi(2), 1.0 / mass_kg);
                    (name, error(&slope))
                });
                let mass = [("mass_kg", error(&[1.0, 0.0, 0.0, 0.0]))].into_iter();
                mass.chain(centre).collect()
            }
            Self::Delay => vec![("delay_s", error(&[1.0]))],
            Self::Masses(_) => Vec::new(),
            Self::Tilt => vec![
                ("roll_rad", error(&[1.0, 0.0])),
                ("pitch_rad", error(&[0.0, 1.0])),
            ],
        }
    }

    /// Whether an arm can have it: nothing comes before it was sent, no link weighs less than nothing, no more can be missing at its end
    /// than the last link weighs, as far as its error tells, and what hangs there is no further away than the arm is long.
    fn can_be(self, robot: &Robot, said: &DVector<f64>, covariance: &DMatrix<f64>) -> bool {
        let error = |place: usize| ERRORS * covariance[(place, place)].max(0.0).sqrt();
        let links = robot.chain.links();
        let last = match (self, links.last()) {
            (Self::Delay, _) => return said[0] + error(0) > 0.0,
            (Self::Masses(_), _) => {
                let is_body = |k: usize| 1.0 + LINKS_WRONG * (said[k] + error(k)) > 0.0;
                return of_bodies(&[self]).into_iter().all(is_body);
            }
            (Self::Payload, Some(last)) => last,
            _ => return true,
        };
        let to_last_m: f64 = links
            .iter()
            .map(|link| link.origin.translation.vector.norm())
            .sum();
        // a link's centre is half way to its end
        let length_m = to_last_m
            + 2.0 * last.centre_of_mass_m.norm()
            + robot.chain.tool().translation.vector.norm();
        let least_kg_m = |place: usize| (said[place].abs() - error(place)).max(0.0);
        let moment_kg_m = [1, 2, 3].map(least_kg_m).iter().map(|x| x * x).sum::<f64>();
        said[0] + error(0) > -last.mass_kg
            && moment_kg_m.sqrt() <= length_m * (said[0].abs() + error(0))
    }

    /// What it costs the whole arm, in nats: a name, and each further amplitude or link. What links' values cost beyond that is seen with what
    /// the joints say of them.
    pub fn cost(self) -> f64 {
        let further = match self {
            Self::Masses(links) => links,
            _ => self.amplitudes(),
        };
        NAME_NATS + AMPLITUDE_NATS * further.saturating_sub(1) as f64
    }

    /// What it costs beyond that at the values that the joints say: their distance from the file's, and how much narrower the joints make what
    /// is known of them (the Occam factor; MacKay, Bayesian interpolation, Neural Computation 4 (1992) 415-447).
    fn cost_of_values(self, said: &DVector<f64>, covariance: &DMatrix<f64>) -> f64 {
        let Self::Masses(_) = self else { return 0.0 };
        let narrower = covariance.clone().cholesky().map_or(f64::INFINITY, |root| {
            root.l().diagonal().iter().map(|x| -x.ln()).sum()
        });
        0.5 * said.norm_squared() + narrower
    }
}

/// By how much one explanation of a joint is better than another, in nats.
#[derive(Clone, Copy, Debug)]
pub struct AheadOf {
    /// By what it leaves, what its names cost, and how little it strains the joint's own values.
    pub own: f64,
    /// What the values of links that the joint carries are strained by the one, and by the other.
    pub strain_of_links: [f64; 2],
}

impl AheadOf {
    /// Of one joint alone.
    pub fn of_one(self) -> f64 {
        ahead_together([self])
    }
}

/// By how much the joints are better told together. Links are those of all joints: what the file is wrong about of them it is wrong about
/// once, and two joints have to say so, since one may strain them for something of its own.
pub fn ahead_together(joints: impl IntoIterator<Item = AheadOf>) -> f64 {
    let (mut own, mut strains) = (0.0, [Vec::new(), Vec::new()]);
    for ahead in joints {
        own += ahead.own;
        for (all, strain) in strains.iter_mut().zip(ahead.strain_of_links) {
            all.push(strain);
        }
    }
    let [with, without] = strains.map(|mut all: Vec<f64>| {
        all.sort_by(|a, b| b.total_cmp(a));
        all.get(1).or(all.first()).copied().unwrap_or(0.0)
    });
    own + without - with
}

/// A cause with what all joints say of it.
pub struct Shared {
    /// Which.
    pub cause: Cause,
    /// Its amplitudes.
    pub said: DVector<f64>,
    /// Theirs.
    pub covariance: DMatrix<f64>,
}

impl Shared {
    /// For the report, with what it takes of each joint's gap; none where it is told joint by joint.
    pub fn told(
        &self,
        probability: f64,
        joint_shares: BTreeMap<String, JointShare>,
    ) -> Option<SharedEffect> {
        let effect = self.cause.effect(&self.said)?;
        let mut parameters = told::parameters(&effect);
        for (name, error) in self.cause.errors(&self.said, &self.covariance) {
            if let Some(parameter) = parameters.get_mut(name) {
                parameter.std = error;
            }
        }
        let count = joint_shares.len().max(1) as f64;
        let mean = |of: fn(&JointShare) -> f64| joint_shares.values().map(of).sum::<f64>() / count;
        Some(SharedEffect {
            effect: NamedEffect {
                effect: effect.name().to_owned(),
                probability,
                parameters,
                share: mean(|share| share.share),
                share_low: mean(|share| share.share_low),
                share_high: mean(|share| share.share_high),
                ..NamedEffect::default()
            },
            joints: joint_shares.keys().cloned().collect(),
            joint_shares,
        })
    }
}

impl Message {
    /// Both together.
    pub fn and(&self, other: &Self) -> Self {
        Self {
            precision: &self.precision + &other.precision,
            pull: &self.pull + &other.pull,
        }
    }

    /// Holds masses and inertias of links above nothing where they are said to be below; the other values give way as they go with those (a
    /// Gaussian given some of its values). `whole` is what all joints say, and what each is told is held where that is.
    pub fn hold_within_bodies(&mut self, causes: &[Cause], mut whole: Self) {
        /// Of the file's: as good as nothing, and still a body.
        const LEAST: f64 = 0.01;
        let least = (LEAST - 1.0) / LINKS_WRONG;
        let places = of_bodies(causes);
        // one more is held in each round, as near as numbers tell
        for _ in &places {
            let Some((said, _)) = whole.said() else {
                return;
            };
            let below = places.iter().min_by(|a, b| said[**a].total_cmp(&said[**b]));
            let below = below.filter(|place| said[**place] < least - f64::EPSILON.sqrt());
            let Some(place) = below else { return };
            for message in [&mut whole, self] {
                message.precision[(*place, *place)] += f64::EPSILON.recip();
                message.pull[*place] += least / f64::EPSILON;
            }
        }
    }

    /// The amplitudes, and their covariance.
    pub fn said(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let solved = self.precision.clone().cholesky()?;
        Some((solved.solve(&self.pull), solved.inverse()))
    }
}

/// Which amplitudes are masses and inertias of links.
fn of_bodies(causes: &[Cause]) -> Vec<usize> {
    let links = causes.last().filter(|last| last.is_of_links());
    let count = links.map_or(0, |links| links.amplitudes());
    let from = amplitudes(causes) - count;
    let is_of_body = |k: &usize| [0, OF_LINK - 1].contains(&(k % OF_LINK));
    (0..count).filter(is_of_body).map(|k| from + k).collect()
}

/// Numbers that causes have together.
pub fn amplitudes(causes: &[Cause]) -> usize {
    causes.iter().map(|cause| cause.amplitudes()).sum()
}

/// What causes cost the whole arm, in nats.
pub fn cost(causes: &[Cause]) -> f64 {
    causes.iter().map(|cause| cause.cost()).sum()
}

/// What is said of causes when nothing was looked at.
pub fn prior(causes: &[Cause]) -> Message {
    let precision = causes.iter().flat_map(|cause| {
        let of_each = cause.deviation().powi(-2);
        std::iter::repeat_n(of_each, cause.amplitudes())
    });
    let precision = DVector::from_iterator(amplitudes(causes), precision);
    Message {
        pull: DVector::zeros(precision.len()),
        precision: DMatrix::from_diagonal(&precision),
    }
}

/// What each joint's others say, from what each says beside its names, and what is known before.
pub fn others(prior: &Message, own: &[Option<Message>]) -> Vec<Message> {
    (0..own.len())
        .map(|joint| {
            let beside = own.iter().enumerate().filter(|(k, _)| *k != joint);
            let said = beside.filter_map(|(_, message)| message.as_ref());
            said.fold(prior.clone(), |sum, message| sum.and(message))
        })
        .collect()
}

/// What all say, and what is known before.
pub fn all(prior: &Message, own: &[Option<Message>]) -> Message {
    let said = own.iter().flatten();
    said.fold(prior.clone(), |sum, message| sum.and(message))
}

/// Causes by what each joint says of them, where they are worth their cost with what the joints gain by them together, and an arm can have
/// them; and by how many nats.
pub fn found(
    causes: &[Cause],
    robot: &Robot,
    own: &[Option<Message>],
    gained_nats: f64,
) -> Option<(Vec<Shared>, f64)> {
    let mut nats = gained_nats - cost(causes);
    let message = all(&prior(causes), own);
    let (said, covariance) = message.said()?;
    let mut held = message.clone();
    held.hold_within_bodies(causes, message);
    let (held, held_covariance) = held.said()?;
    let mut from = 0;
    let mut shared = Vec::new();
    for cause in causes {
        let count = cause.amplitudes();
        let said = said.rows(from, count).into_owned();
        let covariance = covariance.view((from, from), (count, count)).into_owned();
        nats -= cause.cost_of_values(&said, &covariance);
        if nats <= 0.0 || !cause.can_be(robot, &said, &covariance) {
            return None;
        }
        shared.push(Shared {
            cause: *cause,
            said: held.rows(from, count).into_owned(),
            covariance: held_covariance
                .view((from, from), (count, count))
                .into_owned(),
        });
        from += count;
    }
    Some((shared, nats))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn what_two_joints_say_of_links_counts_once_and_what_is_of_joints_each_time() {
        let joint = |own, strain| AheadOf {
            own,
            strain_of_links: [0.5, strain],
        };
        let together = ahead_together([joint(1.0, 8.0), joint(2.0, 6.0), joint(-0.5, 0.0)]);
        assert!((together - (2.5 + 6.0 - 0.5)).abs() < 1e-12, "{together}");
        // a cause that strains the links more is behind
        let worse = AheadOf {
            own: 0.0,
            strain_of_links: [3.0, 1.0],
        };
        assert!((worse.of_one() + 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_payload_hangs_where_its_errors_let_it() {
        let text = "name = \"one\"\n[[link]]\njoint = \"j\"\norigin_m = [0.0, 0.0, 0.3]\naxis = [0.0, 1.0, 0.0]\nmass_kg = 3.0\n\
                    centre_of_mass_m = [0.0, 0.0, 0.2]\n\
                    inertia_kg_m2 = { xx = 0.05, yy = 0.05, zz = 0.02, xy = 0.0, yz = 0.0, xz = 0.0 }\n[[joint]]\nname = \"j\"\n";
        let file = robot::RobotFile::parse(text, "one.toml").unwrap();
        let robot = file.build(robot::Source::Shipped("one")).unwrap();
        // 2 kg m across the plane in which the arm turns, as no joint feels
        let said = DVector::from_vec(vec![0.3, 0.02, 2.0, 0.06]);
        let can_be = |error_kg_m: f64| {
            let errors = DVector::from_vec(vec![1e-4, 1e-6, error_kg_m.powi(2), 1e-6]);
            Cause::Payload.can_be(&robot, &said, &DMatrix::from_diagonal(&errors))
        };
        assert!(can_be(50.0));
        assert!(!can_be(0.1));
    }

    #[test]
    fn a_link_of_less_than_nothing_is_held_and_the_others_give_way() {
        let causes = [Cause::Payload, Cause::Masses(2)];
        let mass = |link: usize| 4 + OF_LINK * link;
        let mut said = prior(&causes);
        // the sum of two masses is known, and the first is said to be below nothing
        for (at, with) in [
            (mass(0), mass(0)),
            (mass(0), mass(1)),
            (mass(1), mass(0)),
            (mass(1), mass(1)),
        ] {
            said.precision[(at, with)] += 1e4;
        }
        said.pull[mass(0)] -= 6e4;
        said.pull[mass(1)] -= 2e4;
        said.precision[(mass(0), mass(0))] += 1e4;
        let (before, _) = said.said().unwrap();
        let is_body = |said: f64| 1.0 + LINKS_WRONG * said > 0.0;
        assert!(!is_body(before[mass(0)]), "{before}");
        let mut held = said.clone();
        held.hold_within_bodies(&causes, said.clone());
        let (after, _) = held.said().unwrap();
        assert!(
            (1.0 + LINKS_WRONG * after[mass(0)] - 0.01).abs() < 1e-6,
            "{after}"
        );
        let sums = [&before, &after].map(|of| of[mass(0)] + of[mass(1)]);
        assert!((sums[0] - sums[1]).abs() < 0.01, "{sums:?}");
        // what is a body stays as it is said
        let mut same = held.clone();
        same.hold_within_bodies(&causes, held.clone());
        assert_eq!(same.pull, held.pull);
    }
}
