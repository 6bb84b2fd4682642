//! Explanations that the data cannot tell apart, with the reason.

use crate::explain::Step;
use crate::hypothesis::Stage;
use crate::known::Known;
use crate::rank::Scored;
use crate::report::Confusable;
use crate::tell::{Told, names};

/// Two explanations nearer than this cannot be told apart.
pub(crate) const DISTANCE_MIN: f64 = 9.0;
/// Pairs that are shown.
const PAIRS_MAX: usize = 5;
/// Nats by which an explanation must lead one that is near to it.
const LEAD_NATS: f64 = 3.0;

/// What is too near to an effect that was named to be told from it, nearest first.
pub(crate) fn pairs(told: &Told<'_>) -> Vec<Confusable> {
    let counted = told.counted.iter().filter_map(|found| match names(found) {
        [one, other] => Some(pair(told, [one, other], 0.0)),
        _ => None,
    });
    let mut all: Vec<Confusable> = counted.collect();
    for step in told.added() {
        let Some((own, own_nats)) = named(step) else {
            continue;
        };
        all.extend(others_alike(told, step, own, own_nats));
        all.extend(imitated_by_known(told, step, own));
    }
    all.sort_by(|a, b| a.distance.total_cmp(&b.distance));
    all.truncate(PAIRS_MAX);
    all
}

/// The effect that a step added, with its nats.
fn named(step: &Step) -> Option<(&Scored, f64)> {
    let scored = &step.round.ranking.scored;
    let mut effects = step.standings.effects.iter();
    effects.find_map(|&(index, nats)| {
        let own = &scored[index];
        (Some(own.hypothesis.effect) == step.added).then_some((own, nats))
    })
}

fn others_alike(told: &Told<'_>, step: &Step, own: &Scored, own_nats: f64) -> Vec<Confusable> {
    let mut found = Vec::new();
    for &(index, nats) in &step.standings.effects {
        let other = &step.round.ranking.scored[index];
        if other.hypothesis.effect == own.hypothesis.effect || nats < own_nats - DISTANCE_MIN {
            continue;
        }
        let distance = step.round.distance(own, other);
        if distance < DISTANCE_MIN || nats > own_nats - LEAD_NATS {
            let names = [own, other].map(|scored| scored.hypothesis.effect);
            found.push(pair(told, names, distance));
        }
    }
    found
}

/// What known values could imitate if they were off by more than their tolerance.
fn imitated_by_known(told: &Told<'_>, step: &Step, own: &Scored) -> Option<Confusable> {
    let known = &told.search.twin.known;
    let (distance, needed) = step.round.distance_from_known(own, known);
    let other = needed.and_then(Known::effect)?;
    (distance < DISTANCE_MIN).then(|| Confusable {
        effects: [own.hypothesis.effect, other].map(str::to_owned),
        distance,
        reason: "known values off by more than their tolerance would look the same".to_owned(),
    })
}

fn pair(told: &Told<'_>, names: [&str; 2], distance: f64) -> Confusable {
    Confusable {
        effects: names.map(str::to_owned),
        distance,
        reason: why(told, names),
    }
}

fn why(told: &Told<'_>, pair: [&str; 2]) -> String {
    if let Some(poverty) = told.poverty {
        return poverty.to_owned();
    }
    let is = |a: &str, b: &str| pair == [a, b] || pair == [b, a];
    if is("command_delay", "sensor_delay") {
        "command and position show only the sum of both delays".to_owned()
    } else if is("torque_offset", "asymmetric_friction") {
        "both add the same torque whichever way the joint turns".to_owned()
    } else if is("torque_offset", "gravity_torque") || is("encoder_offset", "gravity_torque") {
        "the range of motion is too small for the torque to change with the angle".to_owned()
    } else if pair
        .iter()
        .all(|effect| Stage::of(effect) == Stage::Transmission)
    {
        "both oppose the motion in nearly the same way over the speeds and loads driven".to_owned()
    } else {
        "their torques along this motion are nearly alike".to_owned()
    }
}
