//! What a fit tells of the recording itself, beside every effect.

use gap_report::DataFinding;
use joint_twin::known::Known;

use super::search::Search;
use crate::evidence::DEVIATIONS;

/// A vibration that outpaces the joint's motion in this part of the rows is told.
const VIBRATES: f64 = 0.2;

/// That a joint vibrates, where that outpaces its own motion for long.
pub(crate) fn vibration(joint: &str, search: &Search<'_>) -> Option<DataFinding> {
    let swing = search.twin.swing()?;
    (swing.share > VIBRATES).then(|| DataFinding {
        joint: Some(joint.to_owned()),
        severity: "warning".to_owned(),
        what: format!(
            "vibrates at about {:.0} Hz by {:.2} mrad at the joint, faster than it moves, in {:.0} % of the rows; what friction does \
             meanwhile counts little",
            swing.frequency_hz,
            1e3 * swing.amplitude_rad,
            100.0 * swing.share,
        ),
        remedy: "record with a controller of lower gains".to_owned(),
    })
}

/// That a joint's signals are not of the same instant or its encoders not of the same angle, by what a fit found of the file's values and
/// their errors, in standard deviations.
pub(crate) fn readings(joint: &str, search: &Search<'_>, known: &[[f64; 2]]) -> Vec<DataFinding> {
    let found = |value: Known| {
        let of_twin = &search.twin.known;
        let place = of_twin.iter().position(|known| known.known == value)?;
        let usual = of_twin[place].deviation;
        let [off, std] = known.get(place)?.map(|x| x * usual);
        // what is small beside what is usual is not worth a word, however sure it is
        (off.abs() > (DEVIATIONS * std).max(0.5 * usual)).then_some((off, std))
    };
    let note = |what: String, remedy: &str| DataFinding {
        joint: Some(joint.to_owned()),
        severity: "note".to_owned(),
        what,
        remedy: remedy.to_owned(),
    };
    let period_s = search.scale.period_s;
    let skew = found(Known::Skew).map(|(skew_s, std_s)| {
        let when = if skew_s > 0.0 { "later" } else { "earlier" };
        let what = format!(
            "the link's encoder is read {:.2} ± {:.2} ms {when} than the motor's, {:.2} of the time between samples; the \
             diagnosis allows for it, but the twist between them is off by that times the velocity",
            1e3 * skew_s.abs(),
            1e3 * std_s,
            skew_s.abs() / period_s,
        );
        note(what, "record both at the same instant")
    });
    let zero = found(Known::Zero).map(|(zero_rad, std_rad)| {
        let what = format!(
            "the link's encoder shows {:.2} ± {:.2} mrad {} than the motor's without load; the diagnosis allows for it",
            1e3 * zero_rad.abs(),
            1e3 * std_rad,
            if zero_rad > 0.0 { "more" } else { "less" },
        );
        note(what, "set the zeros of both where no torque twists the gear")
    });
    let instant = found(Known::Instant).or_else(|| found(Known::Reported));
    let instant = instant.map(|(later_s, std_s)| {
        let what = format!(
            "the torque of a row is that of {:.2} ± {:.2} ms {} its position, {:.2} of the time between samples; the diagnosis allows \
             for it",
            1e3 * later_s.abs(),
            1e3 * std_s,
            if later_s > 0.0 { "after" } else { "before" },
            later_s.abs() / period_s,
        );
        note(what, "record both at the same instant")
    });
    skew.into_iter().chain(zero).chain(instant).collect()
}
