//! The search for a cause that the arm shares: every joint's sets beside it, with what the other joints say of it.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use joint_twin::on_all_cores::OnAllCores;
use robot::Robot;

use super::gravity::{COMPONENTS, Gravity};
use super::joint::{Joint, Searched};
use crate::diagnose::Progress;
use crate::evidence::Message;
use crate::evidence::arm::{self, Cause, ROUNDS, Shared};

/// All joints by themselves, their torques in some units.
pub struct Arm {
    /// What is regressed of them.
    pub joints: Vec<Joint>,
    /// The best sets of each.
    pub alone: Vec<Searched>,
}

/// Causes that the arm may share, with every joint beside them.
pub struct Found {
    /// In which units torques are: the place among the arms.
    pub arm: usize,
    /// None where a joint has no say.
    pub with: Vec<Option<Searched>>,
    /// The causes; none of them is one of the possibilities.
    pub shared: Vec<Shared>,
    /// By which the joints are better told with them.
    pub nats: f64,
}

/// A shared cause as one joint has it: its columns, and what the other joints say of their amplitudes.
pub struct Prior<'a> {
    /// Which.
    pub causes: &'a [Cause],
    /// One for each amplitude.
    pub columns: Vec<Vec<f64>>,
    /// Whether values of the links are among them: they are within their tolerance or beyond it, and not both.
    pub has_links: bool,
    /// Of the other joints.
    pub message: Message,
}

/// The best sets of every joint by itself, and beside all causes that the arm may share, the most probable first. The last is none. Where
/// a joint's torque seems to have another unit, one load that all joints carry may be why as well: that is looked at with all torques as
/// they were recorded.
pub fn searched(
    robot: &Robot,
    joints: Vec<Joint>,
    progress: &(dyn Fn(Progress) + Sync),
) -> (Vec<Arm>, Vec<Found>) {
    let done = AtomicUsize::new(0);
    let (alone, others): (Vec<Searched>, Vec<Option<(Joint, Searched)>>) = joints
        .iter()
        .on_all_cores(|joint| {
            let alone = joint.searched(None);
            let other = joint
                .in_another_unit(&alone)
                .or_else(|| joint.beside_its_sensor(&alone));
            progress(Progress {
                done: done.fetch_add(1, Ordering::Relaxed) + 1,
                of: robot.joints.len(),
            });
            (alone, other)
        })
        .unzip();
    let recorded = Arm { joints, alone };
    let others = at_fault(&recorded, others);
    let arms = if others.iter().any(Option::is_some) {
        let same = recorded.joints.iter().zip(&recorded.alone);
        let (joints, alone) = same
            .zip(others)
            .map(|((joint, alone), other)| other.unwrap_or_else(|| (joint.clone(), alone.clone())))
            .unzip();
        vec![Arm { joints, alone }, recorded]
    } else {
        vec![recorded]
    };
    let [payload, tilt] = Cause::OF_MASSES;
    let masses = Cause::Masses(robot.chain.joint_count());
    // where gravity points is told by masses that are known
    let causes: [&[Cause]; 5] = [
        &[payload],
        &[tilt],
        &Cause::OF_MASSES,
        &[masses],
        &[payload, masses],
    ];
    let all = (0..arms.len()).flat_map(|arm| causes.map(|causes| (arm, causes)));
    let mut all: Vec<Found> = all
        .filter_map(|(arm, causes)| beside(robot, &arms, arm, causes))
        .collect();
    all.sort_by(|a, b| b.nats.total_cmp(&a.nats));
    all.push(Found {
        arm: 0,
        with: arms[0].joints.iter().map(|_| None).collect(),
        shared: Vec::new(),
        nats: 0.0,
    });
    (arms, all)
}

/// Puts a misfit of torque and masses down to one of them: torques of one log are in one unit, so that where a joint tells N m the others
/// have them too.
fn at_fault(
    recorded: &Arm,
    others: Vec<Option<(Joint, Searched)>>,
) -> Vec<Option<(Joint, Searched)>> {
    if others.iter().all(Option::is_none) {
        return others;
    }
    let each = || recorded.joints.iter().zip(&recorded.alone).zip(&others);
    let tells = each().on_all_cores(|((joint, alone), other): ((&Joint, &Searched), _)| {
        other.is_none() && joint.is_in_newton_metres(alone)
    });
    if !tells.collect::<Vec<bool>>().contains(&true) {
        return others;
    }
    let joints = recorded.joints.iter().zip(others);
    joints
        .on_all_cores(|(joint, other)| {
            let other = other?;
            joint.with_masses_for(&other.0).or(Some(other))
        })
        .collect()
}

/// A delay of all references that tells the joints better than what is told of them.
pub struct Late {
    /// To first order in what the reference does within it.
    pub delay_s: f64,
    /// By which it is better.
    pub nats: f64,
}

/// One delay of all references beside the shared causes that are told, where the joints are better told with it.
pub fn late(robot: &Robot, arms: &[Arm], told: &Found) -> Option<Late> {
    let mut causes: Vec<Cause> = told.causes().collect();
    // a payload is the first
    let place = usize::from(causes.first() == Some(&Cause::Payload));
    causes.insert(place, Cause::Delay);
    let late = beside(robot, arms, told.arm, &causes)?;
    let nats = late.nats - told.nats;
    let mut shared = late.shared.into_iter();
    let delay = shared.find(|shared| shared.cause == Cause::Delay)?;
    let told = delay.told(1.0, BTreeMap::new())?.effect;
    let delay_s = told.parameters.get("delay_s")?.value;
    (nats > 0.0).then_some(Late { delay_s, nats })
}

impl Found {
    /// Which.
    pub fn causes(&self) -> impl Iterator<Item = Cause> {
        self.shared.iter().map(|shared| shared.cause)
    }
}

/// How probable a cause is, among all that may be.
pub fn probability(cause: Cause, all: &[Found]) -> f64 {
    let best = all.iter().map(|found| found.nats).fold(0.0, f64::max);
    let weight = |found: &Found| (found.nats - best).exp();
    let has = |found: &&Found| found.causes().any(|other| other == cause);
    let with: f64 = all.iter().filter(has).map(weight).sum();
    with / all.iter().map(weight).sum::<f64>()
}

/// Every joint of one of the arms beside shared causes, against the first arm without any; none where fewer than two joints see them, or
/// they are not worth their cost.
fn beside(robot: &Robot, arms: &[Arm], arm: usize, causes: &[Cause]) -> Option<Found> {
    let joints = &arms[arm].joints;
    // a torque that its masses do not need tells nothing of what the arm carries
    let mut gravity = Gravity::of(robot);
    let sees: Vec<bool> = joints
        .iter()
        .map(|joint| {
            let shows = |cause: &Cause| {
                let columns = joint.of_arm(*cause);
                let mut values = columns.iter().flatten();
                !columns.is_empty() && values.any(|x| x.abs() > f64::EPSILON)
            };
            joint.misfit.is_none() && causes.iter().all(shows)
        })
        .collect();
    if sees.iter().filter(|sees| **sees).count() < 2 {
        return None;
    }
    let columns = |joint: &Joint, centre_m: [f64; 3]| {
        let each = causes.iter().map(|cause| match cause {
            Cause::Payload => joint.rows.payload_at(centre_m),
            Cause::Delay | Cause::Masses(_) | Cause::Tilt => joint.of_arm(*cause).to_vec(),
        });
        each.flatten().collect::<Vec<Vec<f64>>>()
    };
    let has_links = causes.iter().any(Cause::is_of_links);
    let mut priors: Vec<Prior<'_>> = joints
        .iter()
        .map(|joint| Prior {
            causes,
            columns: columns(joint, [0.0; 3]),
            has_links,
            message: gravity.prior(causes),
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
                    let evidence = joint.evidence(Some(prior));
                    let usual = evidence.usual() & !joint.in_place_of(causes);
                    let can_be = joint.is_possible(&evidence.fit(usual));
                    return can_be.then(|| evidence.message(usual))?;
                }
                let searched = with[place].as_ref()?;
                searched.evidence.message(searched.sets[0].names)
            })
            .collect();
        let whole = arm::all(&gravity.prior(causes), &own);
        let (said, _) = whole.said()?;
        // a payload is the first
        let centre_m = match causes[0] {
            Cause::Payload => [1, 2, 3].map(|k| said[k] / said[0]),
            Cause::Delay | Cause::Masses(_) | Cause::Tilt => [0.0; 3],
        };
        if causes.contains(&Cause::Tilt) {
            // it is the last
            gravity.turn(&said.as_slice()[said.len() - COMPONENTS..]);
        }
        let messages = arm::others(&gravity.prior(causes), &own).into_iter();
        priors = joints
            .iter()
            .zip(messages)
            .map(|(joint, mut message)| {
                // shares and what is left are those of the values that are told
                message.hold_within_bodies(causes, whole.clone());
                Prior {
                    causes,
                    columns: columns(joint, centre_m),
                    has_links,
                    message,
                }
            })
            .collect();
        with = joints
            .iter()
            .zip(&priors)
            .zip(&sees)
            .on_all_cores(|((joint, prior), sees)| sees.then(|| joint.searched(Some(prior))))
            .collect();
    }
    let none = arms[0].joints.iter().zip(&arms[0].alone);
    let beside = joints.iter().zip(&arms[arm].alone).zip(&with);
    let gained = none
        .zip(beside)
        .map(|((none, without), ((joint, alone), with))| {
            let with = with.as_ref().unwrap_or(alone);
            with.ahead_of(without, joint.unit_nm() / none.unit_nm())
        });
    let own: Vec<Option<Message>> = own
        .iter()
        .map(|said| Some(gravity.as_tilt(causes, said.as_ref()?)))
        .collect();
    let (shared, nats) = arm::found(causes, robot, &own, arm::ahead_together(gained))?;
    Some(Found {
        arm,
        with,
        shared,
        nats,
    })
}
