//! Effects with one cause that several joints see: payload, tilt of the base, delays of the bus. One set of amplitudes
//! is fitted to all joints, each with its own known values refitted.

use nalgebra::{DMatrix, DVector};

use crate::evidence::tempered_nats;
use crate::explain::Explanation;
use crate::search::{Search, Term};

/// Effects that joints may share.
const SHARED: [&str; 4] = ["payload", "base_tilt", "command_delay", "sensor_delay"];
/// Of what the joints' own best explanations are worth together, a shared one must be worth this part: one cause is
/// likelier than several.
const PART: f64 = 0.6;

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
    let own: Vec<f64> = there
        .iter()
        .map(|(_, explanation)| best_nats(explanation).max(0.0))
        .collect();
    let own_sum: f64 = own.iter().sum();
    if own.iter().filter(|nats| **nats > 0.0).count() < 2 {
        return None;
    }
    let mut best: Option<(f64, Shared)> = None;
    for effect in SHARED {
        let Some((nats, shared)) = fit(effect, &there) else {
            continue;
        };
        if nats > PART * own_sum && best.as_ref().is_none_or(|(most, _)| nats > *most) {
            best = Some((nats, shared));
        }
    }
    let (nats, mut shared) = best?;
    shared.probability = 1.0 / (1.0 + (PART * own_sum - nats).exp());
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
