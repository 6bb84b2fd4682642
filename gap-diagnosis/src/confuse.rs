//! Explanations that the data cannot tell apart, with the reason.

use robot::Effect;

use crate::data::ONE_FREQUENCY;
use crate::evidence::SAME_TORQUE;
use crate::hypothesis::giving;
use crate::known::Known;
use crate::rank::Scored;
use crate::report::Confusable;
use crate::simulate::Between;
use crate::stage::Stage;
use crate::step::Step;
use crate::tell::{Told, names};

/// Two explanations nearer than this cannot be told apart.
pub(crate) const DISTANCE_MIN: f64 = 9.0;
/// On motion of one speed, direction or frequency laws that are nearly the same differ by less than any law is off: part of
/// the squared response that the other one leaves, and that all known values together leave.
const ALIKE_PART: f64 = 0.05;
const ALIKE_TO_KNOWN_PART: f64 = 0.1;
/// A gear's stiffness, and what it is like at one frequency where nobody sees its twist.
const SOFT_GEAR: &str = "torsional_compliance";
const INERTIAS: [&str; 2] = ["rotor_inertia", "link_inertia"];
/// Pairs that are shown.
const PAIRS_MAX: usize = 24;
/// Nats by which the evidence tells apart even what is near: it has heard more than the shape of a response.
const FAR_NATS: f64 = 4.0;
/// Nats by which an explanation must lead one that is near to it.
const LEAD_NATS: f64 = 3.0;

/// What is too near to an effect that was named to be told from it, the most probable two first. On poor motion also what is near among the
/// effects of known values, if nothing was named.
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
    all.extend(lost_or_slow(told));
    all.extend(in_step(told));
    let candidates = told.candidates();
    let probable = |pair: &Confusable| -> f64 {
        let of = |name: &String| {
            let mut all = candidates.iter();
            all.find(|candidate| candidate.effect == *name)
                .map_or(0.0, |candidate| candidate.probability)
        };
        pair.effects.iter().map(of).product()
    };
    all.sort_by(|a, b| {
        let by_distance = a.distance.total_cmp(&b.distance);
        probable(b).total_cmp(&probable(a)).then(by_distance)
    });
    if told.poverty.is_some() && told.added().next().is_none() {
        all.extend(hidden_by_known(told, told.last()));
    }
    let is_one = |effect: &str| SAME_TORQUE.contains(&effect);
    let names_one = |pair: &Confusable| pair.effects.iter().any(|effect| is_one(effect));
    match all.iter().position(names_one) {
        Some(place) => all.insert(place + 1, pair(told, SAME_TORQUE, 0.0)),
        None if told.added().any(|step| step.added.is_some_and(is_one)) => {
            all.insert(0, pair(told, SAME_TORQUE, 0.0));
        }
        None => {}
    }
    let mut seen: Vec<[String; 2]> = Vec::new();
    all.retain(|pair| {
        let mut names = pair.effects.clone();
        names.sort();
        let is_new = !seen.contains(&names);
        seen.push(names);
        is_new
    });
    all.truncate(PAIRS_MAX);
    all
}

/// A soft gear and inertia at one frequency, seen from the motor alone: if one of them was named, or nothing that could hide them.
fn in_step(told: &Told<'_>) -> Vec<Confusable> {
    let is_unseen = !told.last().round.ranking.sees_torsion;
    if told.poverty != Some(ONE_FREQUENCY) || !is_unseen {
        return Vec::new();
    }
    let named: Vec<&str> = told.added().filter_map(|step| step.added).collect();
    let hypotheses = &told.search.hypotheses;
    let is_possible = |name: &str| hypotheses.iter().any(|of| of.effect == name);
    let pairs = in_step_pairs(&named).into_iter();
    let pairs = pairs.filter(|pair| pair.iter().all(|name| is_possible(name)));
    let told = pairs.map(|pair| Confusable {
        effects: pair.map(str::to_owned),
        distance: 0.0,
        reason: "one frequency only: there stiffness and inertia are one number each, a torque in step with the acceleration; only \
                 the swinging that friction sets off at reversals tells them apart"
            .to_owned(),
    });
    told.collect()
}

/// Driven at one frequency, what is linear shows at that frequency only, as two numbers: in step with the acceleration, and with
/// the velocity, where friction is. Windup and backlash are one stiffness at one amplitude. A twin does part them, by the swinging
/// that friction sets off at reversals, which stays out of it: the distance is of the frequency that the joint was driven at.
fn in_step_pairs(named: &[&str]) -> Vec<[&'static str; 2]> {
    let twist = giving().find(|effect| named.contains(effect));
    let is_inertia = INERTIAS.iter().any(|inertia| named.contains(inertia));
    if twist.is_none() && !is_inertia && !named.is_empty() {
        return Vec::new();
    }
    let other_twist = twist.filter(|twist| *twist != SOFT_GEAR);
    let other_twist = other_twist.map(|twist| [twist, SOFT_GEAR]);
    let inertias = INERTIAS.map(|inertia| [SOFT_GEAR, inertia]);
    inertias.into_iter().chain(other_twist).collect()
}

/// Commands that the drive leaves out, where a current loop was found slow by what it does on the whole: holding the command before
/// is the same on the whole, and only its steps from row to row tell it apart.
fn lost_or_slow(told: &Told<'_>) -> Option<Confusable> {
    let mut terms = told.explanation.refined.model.terms.iter();
    let lag_s = terms.find_map(|term| {
        match term.hypothesis.effect(&term.amplitudes, &told.search.scale) {
            Effect::CurrentLoopLag { time_constant_s } => Some(time_constant_s),
            _ => None,
        }
    })?;
    let stretches = told.search.twin.stretches().into_iter();
    // rows between which commands were sent, or whose torque nobody measured, tell nothing
    let telling =
        stretches.filter(|of| of.has_torque_beside_command && of.drive.between == Between::Stays);
    let nominal = &told.search.twin.nominal;
    let noise_nm = nominal.gear_ratio * nominal.torque_noise_nm;
    let distances = telling
        .map(|of| steps_over_noise(&of.drive.command_nm, lag_s / of.drive.period_s, noise_nm));
    let distance: f64 = distances.sum();
    (distance < DISTANCE_MIN).then(|| Confusable {
        effects: ["current_loop_lag", "dropped_commands"].map(str::to_owned),
        distance,
        reason: "commands that are held in place of lost ones come later on the whole, as a slow loop's do; the steps from row to \
                 row that tell them apart are not recorded, or drown in the torque's noise"
            .to_owned(),
    })
}

/// `d²` of held commands from those of a loop that is as late on the whole: what the scatter of a command's age adds to the
/// variance of the torque, over that of its noise, squared, half of it for each row.
fn steps_over_noise(command_nm: &[f64], late_rows: f64, noise_nm: f64) -> f64 {
    // of a command that is held with probability p the age is p/(1-p) on the whole, and its variance p/(1-p)²
    let age_variance = late_rows * (1.0 + late_rows);
    let rows = command_nm.windows(2).map(|pair| {
        let variance_nm2 = age_variance * (pair[1] - pair[0]).powi(2);
        0.5 * (variance_nm2 / noise_nm.powi(2)).powi(2)
    });
    // a step over no noise is no number where there is no step either
    rows.filter(|square| !square.is_nan()).sum()
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
    let mut alike: Vec<&Scored> = Vec::new();
    for &(index, nats) in &step.standings.effects {
        let other = &step.round.ranking.scored[index];
        if other.hypothesis.effect == own.hypothesis.effect {
            continue;
        }
        let distance = step.round.distance(own, other);
        let is_near = nats > own_nats - FAR_NATS && distance < DISTANCE_MIN;
        let is_alike = is_alike(told, step, own, distance, ALIKE_PART);
        if is_near || nats > own_nats - LEAD_NATS || is_alike {
            found.push(pair(told, names_of(own, other), distance));
        }
        if is_alike {
            alike.push(other);
        }
    }
    found.extend(each_other(told, step, &alike));
    found
}

/// Effects that are all like a third one, as pairs.
fn each_other(told: &Told<'_>, step: &Step, alike: &[&Scored]) -> Vec<Confusable> {
    let mut found = Vec::new();
    for (k, one) in alike.iter().enumerate() {
        for other in &alike[k + 1..] {
            let distance = step.round.distance_alone(one, other);
            found.push(pair(told, names_of(one, other), distance));
        }
    }
    found
}

/// Whether what is left of an effect is less than laws are off, on poor motion.
fn is_alike(told: &Told<'_>, step: &Step, own: &Scored, distance: f64, part: f64) -> bool {
    told.poverty.is_some() && distance < part * step.round.square(own)
}

/// What known values could imitate if they were off by more than their tolerance.
fn imitated_by_known(told: &Told<'_>, step: &Step, own: &Scored) -> Option<Confusable> {
    let known = &told.search.twin.known;
    let (distance, needed) = step.round.distance_from_known(own, known);
    let other = needed.and_then(Known::effect)?;
    let is_near =
        distance < DISTANCE_MIN || is_alike(told, step, own, distance, ALIKE_TO_KNOWN_PART);
    is_near.then(|| Confusable {
        effects: [own.hypothesis.effect, other].map(str::to_owned),
        distance,
        reason: told.poverty.map_or_else(
            || "known values off by more than their tolerance would look the same".to_owned(),
            str::to_owned,
        ),
    })
}

/// What this motion does not tell from a known value that is a little off: neither from that one nor from each other. Those
/// most alike first.
fn hidden_by_known(told: &Told<'_>, step: &Step) -> Vec<Confusable> {
    let known = told.search.twin.known.iter();
    let of_known: Vec<&str> = known.filter_map(|known| known.known.effect()).collect();
    let scored = step.standings.effects.iter();
    let scored: Vec<&Scored> = scored
        .map(|(index, _)| &step.round.ranking.scored[*index])
        .collect();
    let is_known = |scored: &&&Scored| of_known.contains(&scored.hypothesis.effect);
    let mut found: Vec<(f64, Confusable)> = Vec::new();
    for behind in scored.iter().filter(is_known) {
        let mut hidden: Vec<&Scored> = vec![behind];
        for one in &scored {
            let distance = step.round.distance_alone(one, behind);
            let is_other = one.hypothesis.effect != behind.hypothesis.effect;
            if is_other && is_alike(told, step, one, distance, ALIKE_PART) {
                hidden.push(one);
            }
        }
        for (k, one) in hidden.iter().enumerate() {
            for other in &hidden[k + 1..] {
                let distance = step.round.distance_alone(other, one);
                let part = distance / step.round.square(other);
                found.push((part, pair(told, names_of(one, other), distance)));
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.into_iter().map(|(_, pair)| pair).collect()
}

fn names_of<'a>(one: &'a Scored, other: &'a Scored) -> [&'a str; 2] {
    [one, other].map(|scored| scored.hypothesis.effect)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_one_frequency_a_stiffness_is_an_inertia_whatever_of_both_was_named() {
        let both = INERTIAS.map(|inertia| [SOFT_GEAR, inertia]);
        for named in [SOFT_GEAR, "rotor_inertia", "link_inertia"] {
            assert_eq!(in_step_pairs(&[named]), both);
        }
        // within the known values' tolerance either hides behind the other
        assert_eq!(in_step_pairs(&[]), both);
        assert!(in_step_pairs(&["soft_windup"]).contains(&["soft_windup", SOFT_GEAR]));
        assert!(in_step_pairs(&["backlash", "coulomb_friction"]).len() > both.len());
        assert!(in_step_pairs(&["coulomb_friction"]).is_empty());
    }

    #[test]
    fn lost_commands_are_told_from_a_slow_loop_by_steps_above_the_noise() {
        let smooth: Vec<f64> = (0..30_000).map(|k| (0.002 * f64::from(k)).sin()).collect();
        let noise_nm = 0.1;
        assert!(steps_over_noise(&smooth, 1.2, noise_nm) < DISTANCE_MIN);
        let stepping = smooth.iter().zip(0..);
        let stepping: Vec<f64> = stepping
            .map(|(smooth, k): (&f64, i32)| smooth + 0.1 * f64::from(k % 2))
            .collect();
        assert!(steps_over_noise(&stepping, 1.2, noise_nm) > 1000.0 * DISTANCE_MIN);
        assert_eq!(steps_over_noise(&stepping, 1.2, 0.0), f64::INFINITY);
        assert_eq!(steps_over_noise(&[0.5; 100], 1.2, 0.0), 0.0);
    }
}
