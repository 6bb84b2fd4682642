//! Effects with one cause that several joints see: payload, tilt of the base, delays of the bus. One set of amplitudes
//! is fitted to all joints, each with its own known values refitted.

use nalgebra::{DMatrix, DVector};
use robot::Effect;

use crate::evidence::tempered_nats;
use crate::explain::Explanation;
use crate::samples::Found;
use crate::search::{Search, Term};

/// Effects that joints may share.
const SHARED: [&str; 4] = ["payload", "base_tilt", "command_delay", "sensor_delay"];
/// Of what the own best explanations of the joints that see it are worth together, a shared one must be worth this part:
/// one cause is likelier than several.
const PART: f64 = 0.6;

/// Standard errors within which delays of several joints are one.
const DELAYS_ALIKE_ERRORS: f64 = 2.0;

/// A shared effect.
#[derive(Clone, Debug)]
pub struct Shared {
    /// With the amplitudes that all joints share.
    pub term: Term,
    /// Standard errors of the amplitudes, as a covariance.
    pub covariance: DMatrix<f64>,
    /// Against what the joints have to say on their own.
    pub probability: f64,
    /// Indices of the joints that see it.
    pub joints: Vec<usize>,
}

/// A delay that the samples of several joints show alike.
#[derive(Clone, Debug)]
pub struct CommonDelay {
    /// Mean over the joints.
    pub found: Found,
    /// Indices of the joints.
    pub joints: Vec<usize>,
}

impl CommonDelay {
    /// Whether this joint is one of those, and this what it shows.
    pub fn is_seen_as(&self, found: &Found, joint: usize) -> bool {
        self.joints.contains(&joint) && matches!(found.effect, Effect::CommandDelay { .. })
    }
}

/// The delay that more than half of the joints show within their errors: joints on one bus are late together.
pub fn common_delay(counted: &[Vec<Found>]) -> Option<CommonDelay> {
    let mut delays: Vec<(usize, f64, f64)> = Vec::new();
    for (joint, found) in counted.iter().enumerate() {
        delays.extend(found.iter().filter_map(|found| match found.effect {
            Effect::CommandDelay { delay_s } => Some((joint, delay_s, found.std)),
            _ => None,
        }));
    }
    delays.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (_, median_s, _) = *delays.get(delays.len() / 2)?;
    delays.retain(|(_, delay_s, std_s)| (delay_s - median_s).abs() <= DELAYS_ALIKE_ERRORS * std_s);
    if delays.len() < 2 || 2 * delays.len() <= counted.len() {
        return None;
    }
    let count = delays.len() as f64;
    let mean = |of: fn(&(usize, f64, f64)) -> f64| delays.iter().map(of).sum::<f64>() / count;
    let delay_s = mean(|delay| delay.1);
    let mut joints: Vec<usize> = delays.iter().map(|delay| delay.0).collect();
    joints.sort_unstable();
    Some(CommonDelay {
        found: Found {
            effect: Effect::CommandDelay { delay_s },
            // what one joint's error comes from, the grid of delays that are tried, is the same at all
            std: mean(|delay| delay.2),
            because: format!(
                "the drives of {} joints are all {:.2} ms later than the controller's delay",
                joints.len(),
                1e3 * delay_s
            ),
        },
        joints,
    })
}

/// The shared effect that explains several joints better than each its own, if there is one.
pub fn find(joints: &[Option<(Search<'_>, Explanation)>]) -> Option<Shared> {
    let there: Vec<(usize, &Explanation)> = joints
        .iter()
        .enumerate()
        .filter_map(|(index, joint)| Some((index, &joint.as_ref()?.1)))
        .collect();
    if there.len() < 2 {
        return None;
    }
    let own_nats = |(_, explanation): &(usize, &Explanation)| best_nats(explanation).max(0.0);
    if there.iter().filter(|joint| own_nats(joint) > 0.0).count() < 2 {
        return None;
    }
    let mut best: Option<(f64, f64, Shared)> = None;
    for effect in SHARED {
        let Some((nats, shared)) = fit(effect, &there) else {
            continue;
        };
        // what joints have that do not see it does not speak against it
        let seeing = there
            .iter()
            .filter(|(index, _)| shared.joints.contains(index));
        let ahead = nats - PART * seeing.map(own_nats).sum::<f64>();
        if ahead > 0.0 && best.as_ref().is_none_or(|(most, ..)| nats > *most) {
            best = Some((nats, ahead, shared));
        }
    }
    let (_, ahead, mut shared) = best?;
    shared.probability = 1.0 / (1.0 + (-ahead).exp());
    Some(shared)
}

fn best_nats(explanation: &Explanation) -> f64 {
    explanation
        .rounds
        .first()
        .and_then(|step| step.standings.effects.first())
        .map_or(0.0, |(_, nats)| *nats)
}

fn fit(effect: &str, joints: &[(usize, &Explanation)]) -> Option<(f64, Shared)> {
    let mut sum: Option<(DMatrix<f64>, DVector<f64>)> = None;
    let mut seen = Vec::new();
    let mut hypothesis = None;
    for (index, explanation) in joints {
        let round = &explanation.rounds.first()?.round;
        let Some(scored) = round
            .ranking
            .scored
            .iter()
            .find(|scored| scored.hypothesis.effect == effect)
        else {
            continue;
        };
        hypothesis = Some(scored.hypothesis.clone());
        let (matrix, vector) = round.information(scored);
        seen.push((*index, matrix.clone(), vector.clone()));
        sum = Some(match sum {
            Some((a, b)) => (a + matrix, b + vector),
            None => (matrix, vector),
        });
    }
    let (matrix, vector) = sum?;
    let hypothesis = hypothesis?;
    let count = vector.len();
    let ridge = DMatrix::from_diagonal(&matrix.diagonal().map(|own| 1e-9 * own + 1e-12));
    let inverse = (matrix + ridge).cholesky()?.inverse();
    let mut amplitudes = &inverse * &vector;
    if hypothesis.is_positive() {
        amplitudes.apply(|a| *a = a.max(0.0));
    }
    let gained = |matrix: &DMatrix<f64>, vector: &DVector<f64>| {
        2.0 * amplitudes.dot(vector) - amplitudes.dot(&(matrix * &amplitudes))
    };
    let each: Vec<(usize, f64)> = seen
        .iter()
        .map(|(index, matrix, vector)| (*index, gained(matrix, vector)))
        .collect();
    let nats = tempered_nats(each.iter().map(|(_, gain)| gain).sum(), count);
    let joints = each
        .iter()
        .filter(|(_, gain)| tempered_nats(*gain, 1) > 0.0)
        .map(|(index, _)| *index)
        .collect::<Vec<_>>();
    let shared = Shared {
        term: Term {
            hypothesis,
            amplitudes: amplitudes.iter().copied().collect(),
        },
        covariance: inverse,
        probability: 0.0,
        joints,
    };
    (nats > 0.0 && shared.joints.len() > 1).then_some((nats, shared))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn late(delay_s: f64) -> Vec<Found> {
        vec![Found {
            effect: Effect::CommandDelay { delay_s },
            std: 1e-4,
            because: String::new(),
        }]
    }

    #[test]
    fn a_delay_of_most_joints_is_one() {
        let common = common_delay(&[late(2.0e-3), late(2.1e-3), Vec::new(), late(1.9e-3)]);
        let common = common.expect("three of four joints are late alike");
        assert_eq!(common.joints, [0, 1, 3]);
        assert!(
            matches!(common.found.effect, Effect::CommandDelay { delay_s } if (delay_s - 2e-3).abs() < 1e-9)
        );
        assert!(common.is_seen_as(&late(2.1e-3)[0], 1));
        assert!(!common.is_seen_as(&late(2.1e-3)[0], 2));
    }

    #[test]
    fn delays_of_few_joints_or_of_different_length_are_their_own() {
        let joints = [late(2e-3), Vec::new(), Vec::new(), Vec::new()];
        assert!(common_delay(&joints).is_none());
        assert!(common_delay(&[late(2e-3), late(2e-3), Vec::new(), Vec::new()]).is_none());
        assert!(common_delay(&[late(2e-3), late(5e-3), late(9e-3)]).is_none());
        assert!(common_delay(&[late(2e-3)]).is_none());
    }
}
