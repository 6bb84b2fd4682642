//! What was named at one joint may change how its link swings, or how its encoders show that. The other joints feel the link by
//! the arm's rigid bodies; their twins took it for the robot file's, and they were told effects of their own for it. They are
//! judged again beside it where that explains more.

use joint_model::filter::FilterError;
use rayon::prelude::*;
use robot::{Effect, Robot};

use crate::evidence::{Remains, naming};
use crate::explain::{Explanation, explain, without_effects};
use crate::refine::Refined;
use crate::repeats::floor::Repeated;
use crate::report::DataFinding;
use crate::search::Search;
use crate::stretch::Stretch;
use crate::twin::JointTwin;

/// Effects of one joint that others feel.
const FELT: [&str; 8] = [
    "link_inertia",
    "torsional_compliance",
    "soft_windup",
    "backlash",
    "kinematic_error",
    "encoder_eccentricity",
    "encoder_offset",
    "sensor_delay",
];
/// Joints whose effects are tried, those first whose names are worth most.
const TRIED: usize = 3;

/// A joint's search and what it was told; none where nothing tells its torque.
pub(crate) type Searched<'a> = Option<(Search<'a>, Explanation)>;

/// A joint with effects that others feel, and a robot that has them.
pub(crate) struct Beside {
    joint: usize,
    names: Vec<&'static str>,
    /// The other joints with a gap.
    others: Vec<usize>,
    pub robot: Robot,
}

impl Beside {
    /// Every joint that was told such effects while others have a gap.
    pub fn among(robot: &Robot, joints: &[Searched<'_>]) -> Vec<Self> {
        let has_gap = |joint: &usize| {
            joints[*joint].as_ref().is_some_and(|(_, explanation)| {
                !explanation.refined.model.terms.is_empty()
                    || explanation.remains() != Remains::Nothing
            })
        };
        let with_gap: Vec<usize> = (0..joints.len()).filter(has_gap).collect();
        let mut found: Vec<(f64, Self)> = Vec::new();
        for &joint in &with_gap {
            let Some((search, explanation)) = &joints[joint] else {
                continue;
            };
            let terms = explanation.refined.model.terms.iter();
            let felt: Vec<(&'static str, Effect)> = terms
                .filter(|term| FELT.contains(&term.hypothesis.effect))
                .map(|term| (term.hypothesis.effect, term.effect(&search.scale)))
                .collect();
            let others: Vec<usize> = with_gap.iter().copied().filter(|k| *k != joint).collect();
            if felt.is_empty() || others.is_empty() {
                continue;
            }
            let beside = Self {
                joint,
                names: felt.iter().map(|(name, _)| *name).collect(),
                others,
                robot: with(robot, joint, felt.into_iter().map(|(_, effect)| effect)),
            };
            found.push((explanation.named_gain(), beside));
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found
            .into_iter()
            .take(TRIED)
            .map(|(_, beside)| beside)
            .collect()
    }

    /// Of the other joints with a gap, in the robot's order; none of the rest.
    pub fn twins<'a>(
        &'a self,
        stretches: &'a [Stretch],
    ) -> Result<Vec<Option<JointTwin<'a>>>, FilterError> {
        (0..self.robot.joints.len())
            .into_par_iter()
            .map(|joint| {
                if self.others.contains(&joint) {
                    JointTwin::new(&self.robot, joint, stretches)
                } else {
                    Ok(None)
                }
            })
            .collect()
    }

    fn note(&self, joint: usize) -> DataFinding {
        let of = &self.robot.joints[self.joint].name;
        DataFinding {
            joint: Some(self.robot.joints[joint].name.clone()),
            severity: "note".to_owned(),
            what: format!(
                "feels what was named at {of} ({}); it is judged beside it",
                self.names.join(", ")
            ),
            remedy: String::new(),
        }
    }
}

/// The robot with effects of one joint.
fn with(robot: &Robot, joint: usize, effects: impl Iterator<Item = Effect>) -> Robot {
    let mut changed = robot.clone();
    for effect in effects {
        if !matches!(effect, Effect::LinkInertia { .. }) {
            changed.joints[joint].effects.push(effect);
            continue;
        }
        let chain = robot::changed_chain(
            changed.chain.links(),
            changed.chain.gravity_m_s2(),
            changed.chain.tool(),
            [(Some(joint), &effect)],
        );
        // an inertia that makes no body was named wrongly, and helps nobody
        if let Ok(chain) = chain {
            changed.chain = chain;
        }
    }
    changed
}

/// Explains anew the joints that have less to explain beside what was named at another one: the one that takes most off all of
/// them together. `twins`: of each that is tried.
pub(crate) fn explained_again<'a>(
    tried: &[Beside],
    twins: &'a [Vec<Option<JointTwin<'a>>>],
    mut joints: Vec<Searched<'a>>,
    repeated: &Repeated,
) -> Result<(Vec<Searched<'a>>, Vec<DataFinding>), FilterError> {
    let mut best: Option<(f64, &Beside, Vec<(usize, Search<'a>)>)> = None;
    for (beside, twins) in tried.iter().zip(twins) {
        let better = better(&beside.robot, twins, &joints, repeated)?;
        let nats = better.iter().map(|(_, nats, _)| nats).sum();
        if nats > best.as_ref().map_or(0.0, |(most, ..)| *most) {
            let searches = better.into_iter().map(|(joint, _, search)| (joint, search));
            best = Some((nats, beside, searches.collect()));
        }
    }
    let Some((_, beside, searches)) = best else {
        return Ok((joints, Vec::new()));
    };
    let notes = searches.iter().map(|(joint, _)| beside.note(*joint));
    let notes = notes.collect();
    let again = searches
        .into_par_iter()
        .map(|(joint, search)| {
            let settled = joints[joint]
                .as_ref()
                .map_or(&[][..], |(_, before)| &before.without.model.settled);
            let explanation = explain(&search, settled)?;
            Ok((joint, (search, explanation)))
        })
        .collect::<Result<Vec<_>, FilterError>>()?;
    for (joint, searched) in again {
        joints[joint] = Some(searched);
    }
    Ok((joints, notes))
}

/// Joints of which these twins leave less than those before, no effect added, with how many nats less.
fn better<'a>(
    robot: &Robot,
    twins: &'a [Option<JointTwin<'a>>],
    joints: &[Searched<'_>],
    repeated: &Repeated,
) -> Result<Vec<(usize, f64, Search<'a>)>, FilterError> {
    let all = twins
        .par_iter()
        .zip(joints)
        .enumerate()
        .map(|(joint, (twin, before))| {
            let (Some(twin), Some((search, explanation))) = (twin, before) else {
                return Ok(None);
            };
            let left = |search: &Search<'_>, refined: &Refined| {
                search.left(&refined.model, &refined.residual_nm).total()
            };
            let before = left(search, &explanation.without);
            let mut search = Search::new(twin)?;
            search.repeats_nm = repeated.scatter_nm(&robot.joints[joint].name, &search)?;
            let now = without_effects(&search, &explanation.without.model.settled)?;
            let nats = 0.5 * (before - left(&search, &now));
            Ok((nats > naming(1)).then_some((joint, nats, search)))
        })
        .collect::<Result<Vec<_>, FilterError>>()?;
    Ok(all.into_iter().flatten().collect())
}
