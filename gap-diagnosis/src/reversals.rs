//! Joints of which nothing was told although they are off by more than noise and twin: in motion that turns and rests all the time
//! what is off may lie where rows count little. They are looked at again with those rows counting more.

use joint_model::filter::FilterError;
use robot::Robot;

use crate::beside::Searched;
use crate::explain::{Explanation, explain};
use crate::judge::Squares;
use crate::on_all_cores::OnAllCores;
use crate::report::DataFinding;
use crate::search::Search;
use crate::step::is_beyond;

/// Times noise and the twin's own errors, as squares over rows as they count, above which a joint is off. Of 243 joints without
/// a gap, of two simulators, four are, and none of them is told anything then.
const OFF: f64 = 2.0;
/// The same with rows near reversals looked at, above which a torque of no named law is told, and where there is none that the joint is
/// off: of those joints the most is 8.5.
const FAR_OFF: f64 = 16.0;

/// What rows near reversals tell of a joint.
enum Look<'a> {
    Nothing,
    /// Off by so much there, which no effect explains.
    Off(f64),
    Told(Box<(Search<'a>, Explanation)>),
}

/// Every joint as it was told, or as rows near reversals tell it where they tell more.
pub(crate) fn looked_at<'a>(
    robot: &Robot,
    joints: Vec<Searched<'a>>,
) -> Result<(Vec<Searched<'a>>, Vec<DataFinding>), FilterError> {
    let looked_at = joints
        .into_iter()
        .zip(&robot.joints)
        .on_all_cores(|(joint, of)| {
            let look = match &joint {
                Some((search, explanation)) => look(search, explanation)?,
                None => Look::Nothing,
            };
            Ok(match look {
                Look::Nothing => (joint, None),
                Look::Off(off_nm) => (joint, Some(off(&of.name, off_nm))),
                Look::Told(told) => (Some(*told), Some(note(&of.name))),
            })
        })
        .collect::<Result<Vec<_>, FilterError>>()?;
    let (joints, notes): (Vec<_>, Vec<_>) = looked_at.into_iter().unzip();
    Ok((joints, notes.into_iter().flatten().collect()))
}

/// Looks where a joint is off and nothing was told.
fn look<'a>(search: &Search<'a>, told: &Explanation) -> Result<Look<'a>, FilterError> {
    if told.is_told() || !is_beyond(search, &told.refined.residual_nm, OFF) {
        return Ok(Look::Nothing);
    }
    let search = search.at_reversals()?;
    let explanation = explain(&search, &told.without.model.settled)?;
    let residual_nm = &explanation.refined.residual_nm;
    let is_far_off = is_beyond(&search, residual_nm, FAR_OFF);
    let is_named = !explanation.refined.model.terms.is_empty();
    Ok(if is_named || is_far_off && explanation.is_told() {
        Look::Told(Box::new((search, explanation)))
    } else if is_far_off {
        // a joint that sticks may be held by any torque below its friction, and no twin tells which
        Look::Off(most_nm(&search, residual_nm))
    } else {
        Look::Nothing
    })
}

/// Root mean square of the channel that is farthest off, rows as they count.
fn most_nm(search: &Search<'_>, residual_nm: &[f64]) -> f64 {
    let channels = search.twin.channels.iter();
    let of_channels = channels.map(|&channel| {
        let mean = Squares::of(search, residual_nm, channel).mean();
        (mean / search.twin_floor_nm(channel).powi(2), mean.sqrt())
    });
    let most = of_channels.max_by(|a, b| a.0.total_cmp(&b.0));
    most.map_or(0.0, |(_, rms_nm)| rms_nm)
}

fn note(joint: &str) -> DataFinding {
    DataFinding {
        joint: Some(joint.to_owned()),
        severity: "note".to_owned(),
        what: "what is off lies near reversals and rest; rows there count a fifth, not a fifteenth"
            .to_owned(),
        remedy: "a recording with longer moves in one direction would show it without them"
            .to_owned(),
    }
}

fn off(joint: &str, off_nm: f64) -> DataFinding {
    DataFinding {
        joint: Some(joint.to_owned()),
        severity: "warning".to_owned(),
        what: format!(
            "near reversals and rest the robot file is off by {off_nm:.3} Nm, which no effect explains and no friction law is sure of"
        ),
        remedy: "record longer moves in one direction: they show whether that is a gap".to_owned(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use crate::diagnose::diagnose;
    use crate::made_up::{MadeUp, robot};
    use crate::report::Verdict;

    fn told(made_up: MadeUp) -> (Verdict, Vec<String>, bool) {
        let recordings = [("made up".to_owned(), made_up.recorded())];
        let report = diagnose(&robot(), &recordings, &|_| ()).unwrap().report;
        let joint = &report.joints[0];
        let effects = joint.effects.iter();
        let mut findings = report.data.iter();
        (
            joint.verdict,
            effects.map(|found| found.effect.clone()).collect(),
            findings.any(|finding| finding.what.contains("near reversals")),
        )
    }

    #[test]
    fn what_is_far_off_and_nothing_tells_is_no_gap_but_is_said() {
        let (verdict, names, is_looked_at) = told(MadeUp {
            ripple_nm: 0.5,
            ripple_cycles: 2.0,
            sines: [[0.08, 24.0], [0.02, 1.7]],
            ..MadeUp::KNOWN
        });
        assert_eq!((verdict, names), (Verdict::NoGap, Vec::new()));
        assert!(is_looked_at);
    }

    #[test]
    fn a_ripple_in_motion_that_turns_all_the_time_is_told_and_nothing_without_one() {
        let rippled = |ripple_nm: f64| MadeUp {
            ripple_nm,
            // a turn within every fifth of a second
            sines: [[0.01, 16.0], [0.02, 1.3]],
            ..MadeUp::KNOWN
        };
        assert_eq!(told(rippled(0.0)), (Verdict::NoGap, Vec::new(), false));
        let (_, names, is_looked_at) = told(rippled(0.08));
        assert_eq!(names, ["torque_ripple"]);
        assert!(is_looked_at);
    }
}
