//! The search for a cause that the arm shares: every joint's sets beside it, with what the other joints say of it.

use std::sync::atomic::{AtomicUsize, Ordering};

use robot::Robot;

use super::joint::{Joint, Searched};
use crate::diagnose::Progress;
use crate::evidence::arm::{self, Cause, ROUNDS, Shared};
use crate::evidence::{Evidence, Message};
use crate::on_all_cores::OnAllCores;

/// Takes back what only imitates a smooth law, joint by joint.
pub fn without_imitations(joints: &[Joint], searched: &mut [Both]) {
    let both = joints.iter().zip(searched);
    both.on_all_cores(|(joint, both)| {
        joint.without_imitations(both.with.as_mut().unwrap_or(&mut both.alone));
    })
    .for_each(drop);
}

/// A joint's search without and with what the arm shares.
pub struct Both {
    /// Without it.
    pub alone: Searched,
    /// With it; none where there is none, or the joint has no say.
    pub with: Option<Searched>,
}

/// A shared cause as one joint has it: its columns, and what the other joints say of their amplitudes.
pub struct Prior {
    /// One for each amplitude.
    pub columns: Vec<Vec<f64>>,
    /// Of the other joints.
    pub message: Message,
}

/// The best sets of every joint, beside the cause that the arm shares, if the evidence for one outweighs its cost.
pub fn searched(
    robot: &Robot,
    joints: &mut [Joint],
    progress: &(dyn Fn(Progress) + Sync),
) -> (Vec<Both>, Option<Shared>) {
    let done = AtomicUsize::new(0);
    let alone: Vec<Searched> = joints
        .iter_mut()
        .on_all_cores(|joint| {
            let searched = joint.alone();
            progress(Progress {
                done: done.fetch_add(1, Ordering::Relaxed) + 1,
                of: robot.joints.len(),
            });
            searched
        })
        .collect();
    let causes = Cause::ALL
        .into_iter()
        .filter_map(|cause| beside(robot, joints, &alone, cause));
    let best = causes.max_by(|a, b| a.1.nats.total_cmp(&b.1.nats));
    let (with, shared) = match best {
        Some((with, shared)) => (with, Some(shared)),
        None => (joints.iter().map(|_| None).collect::<Vec<_>>(), None),
    };
    let both = alone
        .into_iter()
        .zip(with)
        .map(|(alone, with)| Both { alone, with });
    (both.collect(), shared)
}

/// Every joint beside a shared cause, and the cause; none where fewer than two joints see it, or it is not worth its cost.
fn beside(
    robot: &Robot,
    joints: &[Joint],
    alone: &[Searched],
    cause: Cause,
) -> Option<(Vec<Option<Searched>>, Shared)> {
    // a torque in another unit tells nothing of what the arm carries
    let sees: Vec<bool> = joints
        .iter()
        .map(|joint| {
            let columns = joint.of_arm(cause);
            let shows = columns.iter().flatten().any(|x| x.abs() > f64::EPSILON);
            columns.len() == cause.amplitudes() && shows && joint.unit.is_none()
        })
        .collect();
    if sees.iter().filter(|sees| **sees).count() < 2 {
        return None;
    }
    let columns = |joint: &Joint, centre_m: [f64; 3]| match cause {
        Cause::Payload => joint.rows.payload_at(centre_m),
        Cause::Tilt => joint.of_arm(cause).to_vec(),
    };
    let mut priors: Vec<Prior> = joints
        .iter()
        .map(|joint| Prior {
            columns: columns(joint, [0.0; 3]),
            message: cause.prior(),
        })
        .collect();
    let mut with: Vec<Option<Searched>> = Vec::new();
    let mut own: Vec<Option<Message>> = Vec::new();
    for round in 0..=ROUNDS {
        let said = joints.iter().zip(&priors).zip(0..);
        own = said
            .on_all_cores(|((joint, prior), place): (_, usize)| {
                if !sees[place] {
                    return None;
                }
                // names that were found without the cause may stand for it
                if round == 0 {
                    let evidence = joint.evidence(Some(prior), Evidence::of);
                    return evidence.message(evidence.usual());
                }
                let searched = with[place].as_ref()?;
                searched.evidence.message(searched.sets[0].names)
            })
            .collect();
        let (said, _) = arm::all(cause, &own).said()?;
        let centre_m = match cause {
            Cause::Payload => [1, 2, 3].map(|k| said[k] / said[0]),
            Cause::Tilt => [0.0; 3],
        };
        let messages = arm::others(cause, &own).into_iter();
        priors = joints
            .iter()
            .zip(messages)
            .map(|(joint, message)| Prior {
                columns: columns(joint, centre_m),
                message,
            })
            .collect();
        with = joints
            .iter()
            .zip(&priors)
            .zip(&sees)
            .on_all_cores(|((joint, prior), sees)| sees.then(|| joint.searched(Some(prior))))
            .collect();
    }
    let gained = alone
        .iter()
        .zip(&with)
        .filter_map(|(alone, with)| Some(with.as_ref()?.ahead_of(alone, 1.0)));
    let shared = cause.found(robot, &own, gained.sum())?;
    Some((with, shared))
}
