//! Torques and currents that were recorded without their sign: they reach zero again and again, and turn back each time.

use super::motion::STILL_RAD;
use super::{Finding, FindingKind, POSITIONS, mapping_line, values};
use crate::statistics::span;
use crate::{JointColumns, Recording, Signal};

/// What may have lost its sign.
const TORQUES: [Signal; 4] = [
    Signal::MotorTorqueNm,
    Signal::CommandTorqueNm,
    Signal::JointTorqueNm,
    Signal::MotorCurrentA,
];
/// A signal with a sign that is within a row's step of zero goes on or turns back: that it turns back so many times by chance is as
/// probable as 2⁻²⁰, one in a million.
const TURNS: usize = 20;

/// How often values reach zero within a row's step and turn back, from beyond their root mean square each time; none where they have both
/// signs, or are zero, and never where they turn back too far from zero: what goes through zero does so anywhere within a row's step, up to
/// half of it from the nearer row, so that of many turns one is near.
fn turns(values: &[f64]) -> Option<usize> {
    let finite = || values.iter().copied().filter(|value| value.is_finite());
    let [low, high] = finite().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [low.min(value), high.max(value)]
    });
    let has_both = low < 0.0 && high > 0.0;
    if has_both || low >= high {
        return None;
    }
    let mut sizes: Vec<f64> = finite().map(f64::abs).collect();
    sizes.dedup();
    let square = sizes.iter().map(|size| size * size).sum::<f64>();
    let usual = (square / sizes.len() as f64).sqrt();
    let (mut turns, mut farthest, mut nearest) = (0, 0.0_f64, 0.5_f64);
    for three in sizes.windows(3) {
        let (before, least, after) = (three[0], three[1], three[2]);
        farthest = farthest.max(before);
        if least < before.min(after) && 2.0 * least < before.max(after) {
            if farthest > usual {
                turns += 1;
                // in steps of a row, were its sign lost on the way
                nearest = nearest.min(least / (before.max(after) - least));
            }
            farthest = 0.0;
        }
    }
    // the binary logarithm of how probable it is that they all are that far
    let stays_away = turns as f64 * (1.0 - 2.0 * nearest).log2() < -(TURNS as f64);
    Some(if stays_away { 0 } else { turns })
}

/// Torques of joints that move: those that turn back often enough, and the same signal of others that never have the other sign, for one
/// logger has one way.
pub(super) fn check(recording: &Recording) -> Vec<Finding> {
    let moves = |joint: &&JointColumns| {
        let mut ways = POSITIONS.iter().filter_map(|of| values(joint, *of));
        ways.any(|way| span(way) > STILL_RAD)
    };
    let moving: Vec<&JointColumns> = recording.joints.iter().filter(moves).collect();
    TORQUES
        .into_iter()
        .flat_map(|signal| {
            let each = moving.iter().copied();
            let one_way = each.filter_map(|joint| Some((joint, turns(values(joint, signal)?)?)));
            let one_way: Vec<(&JointColumns, usize)> = one_way.collect();
            let is_clear = one_way.iter().any(|(_, turns)| *turns >= TURNS);
            let told = one_way.into_iter().filter(move |_| is_clear);
            told.map(move |(joint, turns)| finding(joint, signal, turns))
        })
        .collect()
}

fn finding(joint: &JointColumns, signal: Signal, turns: usize) -> Finding {
    let what = format!(
        "was recorded without its sign: never beyond zero, it turns back {turns} times where it reaches it"
    );
    let remedy = "record it with its sign, as some drives give its direction in a bit of their own; else leave it out";
    Finding::error(FindingKind::Unsigned, what)
        .at(joint)
        .of(signal)
        .decided_by(turns as f64)
        .remedy(mapping_line(joint, signal, remedy))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    fn wave(offset: f64) -> Vec<f64> {
        let at = |k: u32| (f64::from(k) * 0.02).sin() + 0.3 * (f64::from(k) * 0.047).sin() + offset;
        (0..20_000).map(at).collect()
    }

    #[test]
    fn what_turns_back_at_zero_has_lost_its_sign() {
        let folded: Vec<f64> = wave(0.2).into_iter().map(f64::abs).collect();
        assert!(turns(&folded).unwrap() > 100);
        // in steps of a current's
        let steps: Vec<f64> = folded.iter().map(|x| (x / 0.05).floor() * 0.05).collect();
        assert!(turns(&steps).unwrap() > 100);
        let negative: Vec<f64> = folded.iter().map(|x| -x).collect();
        assert_eq!(turns(&negative), turns(&folded));
    }

    #[test]
    fn what_has_its_sign_or_stays_away_from_zero_has_not() {
        assert_eq!(turns(&wave(0.2)), None);
        // gravity holds the joint one way
        assert_eq!(turns(&wave(3.0)), Some(0));
        // a ripple that is as large as what it is about, in steps of a current's
        let ripple = |k: u32| {
            let value = 0.096 - 0.08 * (f64::from(k) * 0.61).sin();
            (value / 0.001).round() * 0.001
        };
        let ripple: Vec<f64> = (0..20_000).map(ripple).collect();
        assert_eq!(turns(&ripple), Some(0));
        // a drive that was switched on late
        let mut late = wave(3.0);
        late[..500].fill(0.0);
        assert_eq!(turns(&late), Some(0));
        assert_eq!(turns(&[0.0; 9]), None);
        assert_eq!(turns(&[]), None);
        assert_eq!(turns(&[f64::NAN; 9]), None);
    }
}
