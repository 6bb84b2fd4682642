//! What the samples show by themselves, told beside what the evidence explains: steps of an encoder, samples that were dropped, and
//! delay, lag and limit of the drive.

use gap_report::{Candidate, Confusable, JointReport, NamedEffect, Parameter, Verdict};
use joint_twin::scale::Scale;
use recording_checks::found::Found;
use robot::{Effect, EffectKind, Stage};

use crate::closed_loop::search::Term;
use crate::effects::numbers::{numbers, side};

/// Probability of what was counted in the samples. Of 60 development cases with one of these none was wrong.
const COUNTED: f64 = 0.97;

/// What a delay may be called: command and position show only the sum of both.
const DELAYS: [EffectKind; 2] = [EffectKind::CommandDelay, EffectKind::SensorDelay];

/// What the samples settle already, for the twin.
pub fn settled(counted: &[Found], scale: &Scale) -> Vec<Term> {
    counted
        .iter()
        .filter_map(|found| {
            let (hypothesis, amplitude) = match found.effect {
                Effect::CurrentLoopLag { time_constant_s } => crate::effects::lag(time_constant_s),
                Effect::CommandDelay { delay_s } => crate::effects::delay(delay_s, scale),
                Effect::TorqueSaturation { limit_nm } => crate::effects::limit(limit_nm),
                _ => return None,
            };
            Some(Term {
                hypothesis,
                amplitudes: vec![amplitude],
            })
        })
        .collect()
}

/// Adds what was counted to a joint's report. `settled_shares`: the parts of the gap's energy that the drive takes, in the order of
/// [`settled`]. `is_common`: whether a finding is told of the whole arm.
pub fn add(
    report: &mut JointReport,
    counted: &[Found],
    settled_shares: &[f64],
    is_common: impl Fn(&Found) -> bool,
) {
    if counted.is_empty() {
        return;
    }
    let settled_share: f64 = settled_shares.iter().sum();
    let had_names = !report.effects.is_empty();
    let named = report.effects.iter_mut().chain(&mut report.minor_effects);
    for effect in named {
        for share in [
            &mut effect.share,
            &mut effect.share_low,
            &mut effect.share_high,
        ] {
            *share *= 1.0 - settled_share;
        }
    }
    report.remaining_share *= 1.0 - settled_share;
    let (settled, beside): (Vec<&Found>, Vec<&Found>) =
        counted.iter().partition(|found| is_settled(found));
    let own = settled.iter().zip(settled_shares);
    for (found, share) in own.filter(|(found, _)| !is_common(found)) {
        let effect = with_more(named_effect(found, *share), report);
        report.effects.push(effect);
    }
    // what does not change the torque has the gap that no torque is left of
    let is_at_floor = matches!(report.verdict, Verdict::NoGap | Verdict::Explained);
    let rest = if is_at_floor && settled.is_empty() && !had_names {
        std::mem::take(&mut report.remaining_share)
    } else {
        0.0
    };
    for found in &beside {
        let share = rest / beside.len() as f64;
        report.effects.push(named_effect(found, share));
    }
    report.effects.sort_by(|a, b| b.share.total_cmp(&a.share));
    report.verdict = match report.verdict {
        Verdict::NoGap => Verdict::Explained,
        Verdict::Unexplained => Verdict::PartlyExplained,
        verdict => verdict,
    };
    for candidate in &mut report.candidates {
        candidate.probability *= 1.0 - COUNTED;
    }
    for found in counted {
        let names = names(found);
        for name in &names {
            let probability = COUNTED / (counted.len() * names.len()) as f64;
            let own = report.candidates.iter_mut().find(|of| of.effect == *name);
            match own {
                Some(candidate) => candidate.probability += probability,
                None => report.candidates.push(Candidate {
                    effect: (*name).to_owned(),
                    probability,
                }),
            }
        }
    }
    let is_late = |found: &Found| matches!(found.effect, Effect::CommandDelay { .. });
    if counted.iter().any(is_late) {
        report.confusable.push(Confusable {
            effects: DELAYS.map(|kind| kind.name().to_owned()),
            distance: 0.0,
            reason: "command and position show only the sum of both delays".to_owned(),
        });
    }
    let candidates = &mut report.candidates;
    candidates.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    if report.place.stage.is_none() || !had_names {
        let first = report.effects.first();
        report.place.stage = first.and_then(|first| Stage::of(&first.effect));
    }
    let because: Vec<&str> = counted.iter().map(|found| found.because.as_str()).collect();
    if !report.reason.is_empty() {
        report.reason.push_str("; ");
    }
    report.reason.push_str(&because.join("; "));
}

/// What was counted with what the evidence says is more of it: both are one effect, whose parameters add up, as delays and lags do. Of two
/// limits a drive ends at the lower.
fn with_more(mut counted: NamedEffect, report: &mut JointReport) -> NamedEffect {
    let told = [&mut report.effects, &mut report.minor_effects];
    let more = told.into_iter().find_map(|effects| {
        let place = effects.iter().position(|of| of.effect == counted.effect)?;
        Some(effects.remove(place))
    });
    let Some(more) = more else { return counted };
    for (name, parameter) in &mut counted.parameters {
        let Some(more) = more.parameters.get(name) else {
            continue;
        };
        if name == "limit_nm" {
            if more.value < parameter.value {
                *parameter = *more;
            }
        } else {
            parameter.value += more.value;
            parameter.std = parameter.std.hypot(more.std);
        }
    }
    counted.share += more.share;
    counted.share_low += more.share_low;
    counted.share_high += more.share_high;
    counted.shrink_alone += more.shrink_alone;
    counted
}

/// Whether the twin has it, and the torque is compared beside it.
pub fn is_settled(found: &Found) -> bool {
    matches!(
        found.effect,
        Effect::CurrentLoopLag { .. }
            | Effect::CommandDelay { .. }
            | Effect::TorqueSaturation { .. }
    )
}

/// What a finding may be called.
fn names(found: &Found) -> Vec<&'static str> {
    match found.effect.kind() {
        EffectKind::CommandDelay => DELAYS.map(EffectKind::name).to_vec(),
        kind => vec![kind.name()],
    }
}

/// A finding as a report tells it.
pub fn named_effect(found: &Found, share: f64) -> NamedEffect {
    let parameters = numbers(&found.effect).into_iter();
    let parameters = parameters.map(|(name, value)| {
        let std = match (&found.effect, name.as_str()) {
            // a whole number
            (Effect::TorqueRipple { .. }, "cycles_per_motor_rev") => 0.0,
            (Effect::TorqueRipple { amplitude_nm, .. }, "phase_rad") => found.std / amplitude_nm,
            _ => found.std,
        };
        let parameter = Parameter {
            value,
            std,
            at_bound: false,
        };
        (name, parameter)
    });
    NamedEffect {
        effect: found.effect.name().to_owned(),
        probability: COUNTED / names(found).len() as f64,
        parameters: parameters.collect(),
        side: side(&found.effect),
        share,
        share_low: share,
        share_high: share,
        shrink_alone: share,
        ..NamedEffect::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::insufficient;

    #[test]
    fn a_lag_that_the_samples_tell_in_part_is_told_once() {
        let found = Found {
            effect: Effect::CurrentLoopLag {
                time_constant_s: 8e-3,
            },
            std: 3e-4,
            because: String::new(),
        };
        let mut more = named_effect(&found, 0.1);
        if let Some(parameter) = more.parameters.get_mut("time_constant_s") {
            parameter.value = 3e-3;
        }
        let mut report = insufficient("joint1", String::new());
        report.verdict = Verdict::Explained;
        report.effects = vec![more];
        add(&mut report, &[found], &[0.5], |_| false);
        assert_eq!(report.effects.len(), 1);
        let lag = &report.effects[0];
        assert!((lag.parameters["time_constant_s"].value - 11e-3).abs() < 1e-12);
        assert!((lag.share - 0.55).abs() < 1e-12, "{}", lag.share);
    }

    #[test]
    fn of_two_limits_a_drive_ends_at_the_lower() {
        let found = |limit_nm: f64| Found {
            effect: Effect::TorqueSaturation { limit_nm },
            std: 0.01,
            because: String::new(),
        };
        for (counted, more) in [(0.5, 0.4), (0.4, 0.5)] {
            let mut report = insufficient("joint1", String::new());
            report.effects = vec![named_effect(&found(more), 0.1)];
            let both = with_more(named_effect(&found(counted), 0.5), &mut report);
            assert_eq!(both.parameters["limit_nm"].value, 0.4);
            assert!((both.share - 0.6).abs() < 1e-12);
        }
    }

    #[test]
    fn what_the_arm_is_told_of_takes_no_share_of_a_joint_twice() {
        let found = |effect: Effect| Found {
            effect,
            std: 1e-4,
            because: String::new(),
        };
        let counted = [
            found(Effect::CurrentLoopLag {
                time_constant_s: 3e-3,
            }),
            found(Effect::CommandDelay { delay_s: 2e-3 }),
        ];
        let mut report = insufficient("joint1", String::new());
        report.verdict = Verdict::NoGap;
        report.remaining_share = 1.0;
        let is_common = |found: &Found| found.effect.kind() == EffectKind::CommandDelay;
        add(&mut report, &counted, &[0.6, 0.3], is_common);
        let told: Vec<_> = report
            .effects
            .iter()
            .map(|of| (of.effect.as_str(), of.share))
            .collect();
        assert_eq!(told, [("current_loop_lag", 0.6)]);
        assert!((report.remaining_share - 0.1).abs() < 1e-12);
    }
}
