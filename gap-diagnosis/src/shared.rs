//! Effects with one cause that several joints see: payload, tilt of the base, delays of the bus. One set of amplitudes
//! is fitted to all joints, each with its own known values refitted.

use joint_model::filter::FilterError;
use nalgebra::{DMatrix, DVector};
use robot::Effect;

use crate::evidence::{Remains, naming, remains, tempered_nats};
use crate::found::Found;
use crate::hypothesis::{Hypothesis, shared};
use crate::on_all_cores::OnAllCores;
use crate::refine::Refined;
use crate::search::{Model, Search, Term};
use crate::step::Step;

/// Of what the own best explanations of the joints that see it are worth together, a shared one must be worth this part:
/// one cause is likelier than several.
const PART: f64 = 0.6;
/// Shared effects that are fitted by simulation, those first that are worth most by their responses.
const REFITTED: usize = 2;
/// Steps of the fit by simulation, and squares that one more takes off when it is good enough.
const REFITS: usize = 4;
const SETTLED_SQUARE: f64 = 1.0;
/// Standard errors within which delays of several joints are one.
const DELAYS_ALIKE_ERRORS: f64 = 2.0;

/// A joint with a step of its explanation, beside which shared effects are sought.
pub type Seen<'a, 's> = (&'a Search<'s>, &'a Step);

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

impl Shared {
    /// Fits the amplitudes by simulation of all joints, each with its own known values refitted: a payload does not respond in
    /// proportion. Tells what that is worth to each joint, in nats, and how each is then fitted.
    fn refit(
        &mut self,
        joints: &[Option<Seen<'_, '_>>],
    ) -> Result<Vec<Option<(f64, Refined)>>, FilterError> {
        let mut models: Vec<Model> = joints
            .iter()
            .map(|seen| seen.map_or_else(Model::default, |(_, step)| step.base.model.clone()))
            .collect();
        for model in &mut models {
            model.settled.push(self.term.clone());
        }
        let mut fitted = vec![None; joints.len()];
        for pass in 0..REFITS {
            let told = joints
                .iter()
                .zip(&models)
                .on_all_cores(|(seen, model)| {
                    let Some((search, step)) = seen else {
                        return Ok(None);
                    };
                    let told = search.told_of_settled(&step.round, model)?;
                    Ok(Some((step.worth(search, &told.refined), told)))
                })
                .collect::<Result<Vec<_>, FilterError>>()?;
            let mut matrix = plausible(&self.term.hypothesis);
            let mut vector = -&matrix * DVector::from_column_slice(&self.term.amplitudes);
            for (joint, told) in told.into_iter().enumerate() {
                if let Some((worth, told)) = told {
                    models[joint].clone_from(&told.refined.model);
                    matrix += told.matrix;
                    vector += told.vector;
                    fitted[joint] = Some((worth, told.refined));
                }
            }
            let Some(inverse) = inverse(&matrix) else {
                break;
            };
            let steps = &inverse * &vector;
            self.covariance = inverse;
            if vector.dot(&steps) < SETTLED_SQUARE || pass + 1 == REFITS {
                break;
            }
            for (amplitude, step) in self.term.amplitudes.iter_mut().zip(steps.iter()) {
                *amplitude += step;
                if self.term.hypothesis.is_positive() {
                    *amplitude = amplitude.max(0.0);
                }
            }
            for model in &mut models {
                model.settled.pop();
                model.settled.push(self.term.clone());
            }
        }
        Ok(fitted)
    }
}

/// What is known of amplitudes before anything is seen, as a matrix of information: the tilt about an axis along which every
/// joint turns shows nowhere.
fn plausible(hypothesis: &Hypothesis) -> DMatrix<f64> {
    let count = hypothesis.amplitudes();
    DMatrix::identity(count, count) * hypothesis.plausible_steps().powi(-2)
}

fn inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let ridge = DMatrix::from_diagonal(&matrix.diagonal().map(|own| 1e-9 * own + 1e-12));
    Some((matrix + ridge).cholesky()?.inverse())
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
///
/// # Errors
/// [`FilterError`].
pub fn find(joints: &[Option<Seen<'_, '_>>]) -> Result<Option<Shared>, FilterError> {
    let own: Vec<f64> = joints
        .iter()
        .map(|joint| {
            joint
                .as_ref()
                .map_or(0.0, |(_, own)| best_nats(own).max(0.0))
        })
        .collect();
    if own.iter().filter(|nats| **nats > 0.0).count() < 2 {
        return Ok(None);
    }
    let fits = shared().filter_map(|effect| fit(effect, joints));
    let mut fits: Vec<(f64, Shared)> = fits.filter(|(nats, _)| *nats > 0.0).collect();
    fits.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut best: Option<(f64, Shared)> = None;
    for (_, mut shared) in fits.into_iter().take(REFITTED) {
        let fitted = shared.refit(joints)?;
        let worth: Vec<f64> = fitted
            .iter()
            .map(|fit| fit.as_ref().map_or(0.0, |(worth, _)| *worth))
            .collect();
        let seeing = (0..joints.len()).filter(|joint| worth[*joint] > naming(1));
        shared.joints = seeing.collect();
        let nats = worth.iter().sum::<f64>() - naming(shared.term.amplitudes.len());
        // what joints have that do not see it does not speak against it
        let ahead = nats - PART * shared.joints.iter().map(|joint| own[*joint]).sum::<f64>();
        shared.probability = 1.0 / (1.0 + (-ahead).exp());
        let is_best = best.as_ref().is_none_or(|(most, _)| nats > *most);
        if ahead > 0.0 && shared.joints.len() > 1 && is_best {
            // names that leave most of it would be wrong names
            let imitated = shared.joints.iter().on_all_cores(|joint| {
                let fit = joints[*joint].zip(fitted[*joint].as_ref());
                fit.is_some_and(|((search, step), (worth, refined))| {
                    let structure = search.structure(&step.round, refined);
                    remains(&structure, *worth) == Remains::Most
                })
            });
            if 2 * imitated.filter(|is| *is).count() < shared.joints.len() {
                best = Some((nats, shared));
            }
        }
    }
    Ok(best.map(|(_, shared)| shared))
}

fn best_nats(step: &Step) -> f64 {
    let best = step.standings.effects.first();
    best.map_or(0.0, |(_, nats)| *nats)
}

/// Fitted to responses.
fn fit(effect: &str, joints: &[Option<Seen<'_, '_>>]) -> Option<(f64, Shared)> {
    let mut sum: Option<(DMatrix<f64>, DVector<f64>)> = None;
    let mut hypothesis = None;
    for (_, Step { round, .. }) in joints.iter().flatten() {
        let mut scored = round.ranking.scored.iter();
        let Some(scored) = scored.find(|scored| scored.hypothesis.effect == effect) else {
            continue;
        };
        hypothesis = Some(scored.hypothesis.clone());
        let (matrix, vector) = round.information(scored);
        sum = Some(match sum {
            Some((a, b)) => (a + matrix, b + vector),
            None => (matrix, vector),
        });
    }
    let (matrix, vector) = sum?;
    let hypothesis = hypothesis?;
    let matrix = matrix + plausible(&hypothesis);
    let inverse = inverse(&matrix)?;
    let mut amplitudes = &inverse * &vector;
    if hypothesis.is_positive() {
        amplitudes.apply(|a| *a = a.max(0.0));
    }
    let gain = 2.0 * amplitudes.dot(&vector) - amplitudes.dot(&(matrix * &amplitudes));
    let shared = Shared {
        term: Term {
            hypothesis,
            amplitudes: amplitudes.iter().copied().collect(),
        },
        covariance: inverse,
        probability: 0.0,
        joints: Vec::new(),
    };
    Some((tempered_nats(gain, vector.len()), shared))
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
