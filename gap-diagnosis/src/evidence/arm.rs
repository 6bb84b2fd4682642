//! Causes that the whole arm shares, a payload, wrong masses or a tilted base: one set of amplitudes in the models of all joints.
//!
//! Each joint's rows say something of the amplitudes beside its own names. What the others say is a prior to each: Gaussian messages,
//! which make the joint fits one fit of all joints (Bishop, Pattern Recognition and Machine Learning, 2006, section 8.4.4).

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use robot::{Effect, Robot};

use super::told;
use super::{AMPLITUDE_NATS, ERRORS, Message, NAME_NATS};
use crate::report::{JointShare, NamedEffect, SharedEffect};

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
    /// Masses, centres and inertias of so many links, in standard deviations.
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

    /// The effect's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Payload => "payload",
            Self::Delay => "command_delay",
            Self::Masses(_) => "gravity_torque",
            Self::Tilt => "base_tilt",
        }
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
            (Self::Masses(links), _) => {
                let of_links =
                    (0..links).flat_map(|link| [0, OF_LINK - 1].map(|k| OF_LINK * link + k));
                let mut parts = of_links.map(|k| 1.0 + LINKS_WRONG * (said[k] + error(k)));
                return parts.all(|part| part > 0.0);
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
        let moment_kg_m = said.rows(1, 3).norm();
        said[0] + error(0) > -last.mass_kg && moment_kg_m <= length_m * said[0].abs()
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

/// A cause with what all joints say of it.
pub struct Shared {
    cause: Cause,
    /// Its amplitudes.
    pub said: DVector<f64>,
    /// Theirs.
    pub covariance: DMatrix<f64>,
}

impl Shared {
    /// Which.
    pub fn cause(&self) -> Cause {
        self.cause
    }

    /// Holds masses and inertias of links above nothing, as far as their errors let them; the other values give way as they go with those
    /// (a Gaussian given some of its values).
    fn hold_within_bodies(&mut self) {
        /// Of the file's: as good as nothing, and still a body.
        const LEAST: f64 = 0.01;
        let Cause::Masses(links) = self.cause else {
            return;
        };
        let least = (LEAST - 1.0) / LINKS_WRONG;
        // one more is held in each round
        for _ in 0..2 * links {
            let of_links = (0..links).flat_map(|link| [0, OF_LINK - 1].map(|k| OF_LINK * link + k));
            let lowest = of_links.min_by(|a, b| self.said[*a].total_cmp(&self.said[*b]));
            let Some(place) = lowest.filter(|place| self.said[*place] < least) else {
                return;
            };
            let with = self.covariance.column(place) / self.covariance[(place, place)];
            self.said += &with * (least - self.said[place]);
            self.covariance -= &with * self.covariance.row(place).into_owned();
            self.said[place] = least;
            // what is held has no error
            self.covariance.column_mut(place).fill(0.0);
            self.covariance.row_mut(place).fill(0.0);
        }
    }

    /// Its name, and how many columns it has.
    pub fn named(&self) -> (&'static str, usize) {
        (self.cause.name(), self.cause.amplitudes())
    }

    /// For the report, with what it takes of each joint's gap; none where it is told joint by joint.
    pub fn told(
        &self,
        probability: f64,
        joint_shares: BTreeMap<String, JointShare>,
    ) -> Option<SharedEffect> {
        let mut parameters = told::parameters(&self.cause.effect(&self.said)?);
        for (name, error) in self.cause.errors(&self.said, &self.covariance) {
            if let Some(parameter) = parameters.get_mut(name) {
                parameter.std = error;
            }
        }
        let count = joint_shares.len().max(1) as f64;
        let mean = |of: fn(&JointShare) -> f64| joint_shares.values().map(of).sum::<f64>() / count;
        Some(SharedEffect {
            effect: NamedEffect {
                effect: self.cause.name().to_owned(),
                probability,
                parameters,
                side: None,
                share: mean(|share| share.share),
                share_low: mean(|share| share.share_low),
                share_high: mean(|share| share.share_high),
                shrink_alone: 0.0,
                of_links: false,
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

    /// The amplitudes, and their covariance.
    pub fn said(&self) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let solved = self.precision.clone().cholesky()?;
        Some((solved.solve(&self.pull), solved.inverse()))
    }
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
    let (said, covariance) = all(&prior(causes), own).said()?;
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
        let mut of_cause = Shared {
            cause: *cause,
            said,
            covariance,
        };
        of_cause.hold_within_bodies();
        shared.push(of_cause);
        from += count;
    }
    Some((shared, nats))
}
