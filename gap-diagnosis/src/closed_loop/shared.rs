//! Causes that the whole arm shares: a payload or a tilted base, which every joint carries its part of, and a delay of the bus.

use std::collections::BTreeMap;

use gap_report::{JointShare, SharedEffect};
use joint_twin::TwinError;
use joint_twin::on_all_cores::OnAllCores;
use nalgebra::DVector;
use robot::{Effect, Robot};

use super::bus::CommonDelay;
use super::counted;
use super::joint::{Explained, Joint};
use super::rows::{About, OfArm, Step, own_columns};
use crate::closed_loop::search::Term;
use crate::effects::Hypothesis;
use crate::evidence::Message;
use crate::evidence::arm::{self, Cause, Shared};

/// A cause, by how many nats the joints are better told with it, and every joint that has a twin beside it.
type Beside = (Shared, f64, Vec<Option<Explained>>);

/// A payload's inertia goes with the inverse of its mass; for this part of the mass a step both ways tells its slope to a tenth.
const PART_OF_MASS: f64 = 0.25;
/// Rounds in which joints tell each other of a cause at most: one whose mass is first taken for a third of what it is has it to a hundredth.
const SETTLE: usize = 8;
/// A cause has settled where it moves by no more than this part of its standard errors.
const SETTLED: f64 = 0.1;

/// One step of each amplitude of its hypothesis.
fn steps(cause: Cause, joint: &Joint<'_>, hypothesis: &Hypothesis) -> Vec<f64> {
    let mut ones = vec![1.0; cause.amplitudes()];
    ones.truncate(hypothesis.amplitudes());
    match hypothesis.effect(&ones, &joint.search.scale) {
        Effect::Payload { mass_kg, centre_m } => {
            let moments = centre_m.map(|along| mass_kg * along);
            [mass_kg].into_iter().chain(moments).collect()
        }
        Effect::BaseTilt {
            roll_rad,
            pitch_rad,
        } => vec![roll_rad, pitch_rad],
        _ => ones,
    }
}

/// A joint's responses about a cause of this size.
fn beside(
    joint: &Joint<'_>,
    begin: &About,
    cause: Cause,
    said: &[f64],
) -> Result<Option<(About, OfArm)>, TwinError> {
    let search = &joint.search;
    let mut hypotheses = search.hypotheses.iter();
    let Some(hypothesis) = hypotheses.find(|of| Some(of.name()) == cause.name()) else {
        return Ok(None);
    };
    let steps = steps(cause, joint, hypothesis);
    let amplitudes = said.iter().zip(&steps).map(|(value, step)| value / step);
    let term = Term {
        hypothesis: hypothesis.clone(),
        amplitudes: amplitudes.collect(),
    };
    let mut model = begin.model.clone();
    model.terms.insert(0, term.clone());
    let mut sizes = vec![1.0; steps.len()];
    if cause == Cause::Payload {
        let part = PART_OF_MASS * said[0].abs() / steps[0];
        sizes[0] = part.clamp(f64::EPSILON.sqrt(), 1.0);
    }
    let step = Step::BothWays(&sizes);
    let mut columns = own_columns(search, &joint.compared, &model, 0, step)?;
    for ((column, step), size) in columns.iter_mut().zip(&steps).zip(&sizes) {
        column.iter_mut().for_each(|x| *x /= step * size);
        // what is below the floor however much there is of it tells nothing but rounding
        if !joint.compared.shows(column, cause.deviation()) {
            column.fill(0.0);
        }
    }
    model.terms.remove(0);
    model.settled.push(term);
    let of_arm = OfArm {
        columns,
        said: said.to_vec(),
        message: arm::prior(&[cause]),
    };
    let mut about = About {
        gap_nm: joint.compared.pick(&search.residual_nm(&model)?),
        model,
        ..begin.clone()
    };
    of_arm.add_to(&mut about);
    Ok(Some((about, of_arm)))
}

/// The cause that explains the joints better than each its own does, with every joint beside it; none if there is none.
pub(super) fn found<'a>(
    robot: &Robot,
    joints: &[Option<Joint<'a>>],
    begins: &[Option<About>],
    alone: &[Option<Explained>],
) -> Result<Option<Beside>, TwinError> {
    let mut best: Option<Beside> = None;
    for cause in Cause::OF_MASSES {
        let found = worth(robot, joints, begins, alone, cause)?;
        let is_better = |found: &Beside| best.as_ref().is_none_or(|best| found.1 > best.1);
        if let Some(found) = found.filter(is_better) {
            best = Some(found);
        }
    }
    Ok(best)
}

fn worth<'a>(
    robot: &Robot,
    joints: &[Option<Joint<'a>>],
    begins: &[Option<About>],
    alone: &[Option<Explained>],
    cause: Cause,
) -> Result<Option<Beside>, TwinError> {
    // about a little of it, since nothing has no centre
    let mut said = DVector::zeros(cause.amplitudes());
    if cause == Cause::Payload {
        said[0] = 0.1;
    }
    let mut all: Vec<Option<(About, OfArm)>> = Vec::new();
    let mut messages: Vec<Option<Message>> = Vec::new();
    for _ in 0..SETTLE {
        all = joints
            .iter()
            .zip(begins)
            .on_all_cores(|both| match both {
                (Some(joint), Some(begin)) => beside(joint, begin, cause, said.as_slice()),
                _ => Ok(None),
            })
            .collect::<Result<Vec<_>, TwinError>>()?;
        if all.iter().flatten().count() < 2 {
            return Ok(None);
        }
        // names that were found without the cause may stand for it
        messages = joints
            .iter()
            .zip(&all)
            .on_all_cores(|both| match both {
                (Some(joint), Some((about, of_arm))) => {
                    let evidence = about.usual_evidence(&joint.compared, of_arm);
                    evidence.message(evidence.usual())
                }
                _ => None,
            })
            .collect();
        let together = arm::all(&arm::prior(&[cause]), &messages);
        let Some((next, _)) = together.said() else {
            return Ok(None);
        };
        // half of what it takes off if nothing else could
        if 0.5 * next.dot(&together.pull) < cause.cost() {
            return Ok(None);
        }
        let moved = &next - &said;
        said = next;
        if (&together.precision * &moved).dot(&moved) < SETTLED * SETTLED {
            break;
        }
    }
    let others = arm::others(&arm::prior(&[cause]), &messages);
    let with = joints
        .iter()
        .zip(all)
        .zip(others)
        .on_all_cores(|((joint, all), message)| {
            let (Some(joint), Some((about, of_arm))) = (joint, all) else {
                return Ok(None);
            };
            let of_arm = OfArm { message, ..of_arm };
            Ok(Some(joint.explained(about, Some(&of_arm))?))
        })
        .collect::<Result<Vec<_>, TwinError>>()?;
    let both = joints.iter().zip(alone).zip(&with);
    let gained = both.filter_map(|((joint, alone), with)| {
        let (joint, alone, with) = (joint.as_ref()?, alone.as_ref()?, with.as_ref()?);
        Some(with.ahead_of(alone, joint))
    });
    let gained_nats = arm::ahead_together(gained);
    let own: Vec<Option<Message>> = with
        .iter()
        .map(|with| {
            let with = with.as_ref()?;
            with.evidence.message(with.sets[0].names)
        })
        .collect();
    let shared = arm::found(&[cause], robot, &own, gained_nats);
    let first = shared.and_then(|(shared, nats)| Some((shared.into_iter().next()?, nats)));
    Ok(first.map(|(shared, nats)| (shared, nats, with)))
}

/// A delay of the bus, for the report.
pub fn told_delay(
    common: &CommonDelay,
    robot: &Robot,
    joint_shares: BTreeMap<String, JointShare>,
) -> SharedEffect {
    let count = joint_shares.len().max(1) as f64;
    let share = joint_shares.values().map(|share| share.share).sum::<f64>() / count;
    let names = common.joints.iter();
    SharedEffect {
        effect: counted::named_effect(&common.found, share),
        joints: names
            .map(|joint| robot.joints[*joint].name.clone())
            .collect(),
        joint_shares,
    }
}
