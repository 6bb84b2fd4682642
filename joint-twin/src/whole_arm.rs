//! How a joint's load changes with what concerns the whole arm: a payload, or a tilt of the base.
//!
//! A load is linear in gravity and in the mass of a payload. In the payload's place it is a polynomial of second degree, which ten
//! places determine. So a few loads are computed once, and every payload and tilt is a sum of them; so are both at once, for the
//! payload's own weight tilts too. So does what a link weighs more than its file says.

use std::sync::OnceLock;

use joint_model::rigid_body::Chain;
use nalgebra::{Isometry3, Vector3};
use robot::Effect;

use crate::known::{self, KnownValue};
use crate::load::{AtKnot, LoadChange, Motion};

/// From the last link's origin to the places of the payload.
const PLACE_M: f64 = 0.1;
/// Places in [`PLACE_M`]: the origin, both sides along each axis, between each two axes.
const PLACES: [[f64; 3]; 10] = [
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
    [1.0, 1.0, 0.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
];

/// Changes of one joint's load along one motion.
#[derive(Debug)]
pub(crate) struct WholeArm {
    joint: usize,
    /// With a payload of a kilogram at each place.
    payloads: OnceLock<Option<Vec<LoadChange>>>,
    /// With gravity of one m/s² more along each axis.
    gravity: OnceLock<Option<Vec<LoadChange>>>,
    /// How the latter change with a payload of a kilogram at each place: of each axis, one place after the other.
    weights: OnceLock<Option<Vec<LoadChange>>>,
    /// How they change with a standard deviation of each value of links: of each axis, one value after the other.
    links: OnceLock<Option<Vec<LoadChange>>>,
}

impl WholeArm {
    /// Of a joint; loads are computed when they are asked for.
    pub fn of(joint: usize) -> Self {
        Self {
            joint,
            payloads: OnceLock::new(),
            gravity: OnceLock::new(),
            weights: OnceLock::new(),
            links: OnceLock::new(),
        }
    }

    /// How these effects change the load, with these values of links moved by so many standard deviations; none where they change
    /// nothing, or the arm allows none.
    pub fn change(
        &self,
        chain: &Chain,
        motion: &Motion,
        effects: &[Effect],
        links: &[(KnownValue, LoadChange)],
        deviations: &[f64],
    ) -> Option<LoadChange> {
        if !effects.iter().any(Effect::is_whole_arm) {
            return None;
        }
        let changed = changed_chain(chain, chain.gravity_m_s2(), effects)?;
        let tilted = changed.gravity_m_s2() - chain.gravity_m_s2();
        let payloads = effects.iter().filter_map(|effect| match effect {
            Effect::Payload { mass_kg, centre_m } => Some((*mass_kg, Vector3::from(*centre_m))),
            _ => None,
        });
        let mut weights = [0.0; PLACES.len()];
        for (mass_kg, centre_m) in payloads {
            for (sum, weight) in weights.iter_mut().zip(weights_at(centre_m / PLACE_M)) {
                *sum += mass_kg * weight;
            }
        }
        let is_loaded = weights.iter().any(|weight| *weight != 0.0);
        let is_tilted = tilted != Vector3::zeros();
        let mut sum = LoadChange::default();
        let mut add = |weights: &[f64], changes: &[LoadChange]| {
            for (weight, change) in weights.iter().zip(changes).filter(|(w, _)| **w != 0.0) {
                sum.add(change, *weight);
            }
        };
        if is_loaded {
            let of = || self.payload_changes(chain, motion);
            add(&weights, self.payloads.get_or_init(of).as_ref()?);
        }
        if is_tilted {
            let of = || self.gravity_changes(chain, motion);
            add(tilted.as_slice(), self.gravity.get_or_init(of).as_ref()?);
        }
        if is_loaded && is_tilted {
            let of = || self.weight_changes(chain, motion);
            let changes = self.weights.get_or_init(of).as_ref()?;
            for (along, changes) in tilted.iter().zip(changes.chunks(PLACES.len())) {
                add(&weights.map(|weight| along * weight), changes);
            }
        }
        if is_tilted && deviations.iter().any(|moved| *moved != 0.0) {
            let of = || self.link_changes(chain, motion, links);
            let changes = self.links.get_or_init(of).as_ref()?;
            for (along, changes) in tilted.iter().zip(changes.chunks(links.len())) {
                let weights: Vec<f64> = deviations.iter().map(|moved| along * moved).collect();
                add(&weights, changes);
            }
        }
        Some(sum)
    }

    fn payload_changes(&self, chain: &Chain, motion: &Motion) -> Option<Vec<LoadChange>> {
        let loaded = loaded(chain, chain.gravity_m_s2())?;
        Some(self.changes(&motion.at_knots(chain, self.joint), &loaded, motion))
    }

    fn gravity_changes(&self, chain: &Chain, motion: &Motion) -> Option<Vec<LoadChange>> {
        let from = motion.at_knots(chain, self.joint);
        let tilted = (0..3).map(|axis| {
            let tilted = changed_chain(chain, more_along(chain, axis), &[])?;
            let to = motion.at_knots(&tilted, self.joint);
            Some(LoadChange::between(&from, &to))
        });
        tilted.collect()
    }

    fn weight_changes(&self, chain: &Chain, motion: &Motion) -> Option<Vec<LoadChange>> {
        let payloads = self.payloads.get()?.as_ref()?;
        let gravity = self.gravity.get()?.as_ref()?;
        let from = motion.at_knots(chain, self.joint);
        let mut all = Vec::with_capacity(gravity.len() * PLACES.len());
        for (axis, gravity) in gravity.iter().enumerate() {
            let loaded = loaded(chain, more_along(chain, axis))?;
            let both = self.changes(&from, &loaded, motion);
            for (mut change, payload) in both.into_iter().zip(payloads) {
                change.add(payload, -1.0);
                change.add(gravity, -1.0);
                all.push(change);
            }
        }
        Some(all)
    }

    fn link_changes(
        &self,
        chain: &Chain,
        motion: &Motion,
        links: &[(KnownValue, LoadChange)],
    ) -> Option<Vec<LoadChange>> {
        let (values, upright): (Vec<KnownValue>, Vec<LoadChange>) = links.iter().cloned().unzip();
        let mut all = Vec::with_capacity(3 * links.len());
        for axis in 0..3 {
            let tilted = changed_chain(chain, more_along(chain, axis), &[])?;
            let changes = known::link_changes(&tilted, self.joint, motion, &values);
            for (mut change, upright) in changes.into_iter().zip(&upright) {
                change.add(upright, -1.0);
                all.push(change);
            }
        }
        Some(all)
    }

    fn changes(&self, from: &[AtKnot], changed: &[Chain], motion: &Motion) -> Vec<LoadChange> {
        let changed = motion.at_knots_of(changed, self.joint);
        let changes = changed.iter().map(|to| LoadChange::between(from, to));
        changes.collect()
    }
}

/// With a kilogram at each of [`PLACES`], in this gravity.
fn loaded(chain: &Chain, gravity_m_s2: Vector3<f64>) -> Option<Vec<Chain>> {
    let places = PLACES.into_iter();
    places
        .map(|place| changed_chain(chain, gravity_m_s2, &[payload(place)]))
        .collect()
}

/// A kilogram at a place.
fn payload(place: [f64; 3]) -> Effect {
    Effect::Payload {
        mass_kg: 1.0,
        centre_m: place.map(|along| PLACE_M * along),
    }
}

/// Gravity of one m/s² more along an axis.
fn more_along(chain: &Chain, axis: usize) -> Vector3<f64> {
    let mut gravity_m_s2 = chain.gravity_m_s2();
    gravity_m_s2[axis] += 1.0;
    gravity_m_s2
}

fn changed_chain(chain: &Chain, gravity_m_s2: Vector3<f64>, effects: &[Effect]) -> Option<Chain> {
    let effects = effects.iter().map(|effect| (None, effect));
    robot::changed_chain(chain.links(), gravity_m_s2, Isometry3::identity(), effects).ok()
}

/// What the load of a kilogram at each of [`PLACES`] counts in that of a kilogram at another place, in the same unit.
fn weights_at(place: Vector3<f64>) -> [f64; PLACES.len()] {
    let [x, y, z] = [place.x, place.y, place.z];
    // f = f0 + Σ (f+ - f-)/2·c + Σ (f+ + f- - 2·f0)/2·c² + Σ (fij - fi - fj + f0)·ci·cj
    let pairs = [x * y, x * z, y * z];
    let side = |c: f64, pairs: f64| 0.5 * (c * c + c) - pairs;
    let other_side = |c: f64| 0.5 * (c * c - c);
    [
        1.0 - (x * x + y * y + z * z) + pairs.iter().sum::<f64>(),
        side(x, pairs[0] + pairs[1]),
        other_side(x),
        side(y, pairs[0] + pairs[2]),
        other_side(y),
        side(z, pairs[1] + pairs[2]),
        other_side(z),
        pairs[0],
        pairs[1],
        pairs[2],
    ]
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;
    use crate::known::Known;

    const RATE_HZ: f64 = 200.0;

    fn motion(joints: usize) -> Motion {
        let position_rad: Vec<Vec<f64>> = (0..joints)
            .map(|joint| {
                let at = |k: usize| (0.01 * k as f64 + joint as f64).sin();
                (0..600).map(at).collect()
            })
            .collect();
        Motion::of(&position_rad, RATE_HZ).unwrap()
    }

    /// Of the sums, and of the arm with the effects; links heavier by so many standard deviations of 2 % than the file says.
    fn both_ways(joint: usize, effects: &[Effect], deviations: f64) -> [LoadChange; 2] {
        let chain = robot::load("pa10").unwrap().chain;
        let motion = motion(7);
        let mut heavier = chain.links().to_vec();
        let values: Vec<KnownValue> = (0..heavier.len())
            .map(|link| KnownValue {
                known: Known::Mass(link),
                deviation: 0.02,
            })
            .collect();
        for value in &values {
            let factor = 1.0 + deviations * value.deviation;
            value.known.multiply(&mut heavier, factor);
        }
        let heavier = Chain::new(&heavier, chain.gravity_m_s2(), chain.tool()).unwrap();
        let changes = known::link_changes(&chain, joint, &motion, &values);
        let links: Vec<(KnownValue, LoadChange)> = values.into_iter().zip(changes).collect();
        let moved = vec![deviations; links.len()];
        let sum = WholeArm::of(joint).change(&chain, &motion, effects, &links, &moved);
        let changed = changed_chain(&heavier, chain.gravity_m_s2(), effects).unwrap();
        let [from, to] = [&heavier, &changed].map(|chain| motion.at_knots(chain, joint));
        [sum.unwrap(), LoadChange::between(&from, &to)]
    }

    #[test]
    fn sums_are_the_load_of_any_payload_or_tilt() {
        let payload = Effect::Payload {
            mass_kg: 3.2,
            centre_m: [0.07, -0.13, 0.21],
        };
        let tilt = Effect::BaseTilt {
            roll_rad: 0.05,
            pitch_rad: -0.02,
        };
        let cases = [vec![payload], vec![tilt], vec![payload, tilt]];
        for effects in &cases {
            for joint in [1, 3, 6] {
                for deviations in [0.0, -2.0] {
                    let [sum, direct] = both_ways(joint, effects, deviations);
                    let off = sum.largest_difference(&direct);
                    assert!(
                        off < 1e-6 * (1.0 + motion(7).rms_nm(joint, &direct)),
                        "{joint}, {deviations}: {off}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_concerns_one_joint_changes_no_load() {
        let chain = robot::load("pa10").unwrap().chain;
        let offset = Effect::TorqueOffset { offset_nm: 1.0 };
        assert!(
            WholeArm::of(2)
                .change(&chain, &motion(7), &[offset], &[], &[])
                .is_none()
        );
    }
}
