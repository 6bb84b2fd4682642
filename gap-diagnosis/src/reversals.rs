//! Joints of which nothing was told although they are off by more than noise and twin: in motion that turns and rests all the time
//! what is off may lie where rows count little. They are looked at again with those rows counting more.

use joint_model::filter::FilterError;
use rayon::prelude::*;
use robot::Robot;

use crate::beside::Searched;
use crate::evidence::tempered_nats;
use crate::explain::{Explanation, explain};
use crate::report::DataFinding;
use crate::search::Search;
use crate::step::is_beyond;

/// Times noise and the twin's own errors, as squares over rows as they count, above which a joint is off. Of 243 joints without
/// a gap, of two simulators, four are, and none of them is told anything then.
const OFF: f64 = 2.0;
/// The same with rows near reversals looked at, above which no twin is off without a gap: of those joints the most is 8.5.
const FAR_OFF: f64 = 16.0;

/// Every joint as it was told, or as rows near reversals tell it where they tell more.
pub(crate) fn looked_at<'a>(
    robot: &Robot,
    joints: Vec<Searched<'a>>,
) -> Result<(Vec<Searched<'a>>, Vec<DataFinding>), FilterError> {
    let looked_at = joints
        .into_par_iter()
        .zip(&robot.joints)
        .map(|(joint, of)| {
            let again = match &joint {
                Some((search, explanation)) => told_more(search, explanation)?,
                None => None,
            };
            let note = again.as_ref().map(|_| note(&of.name));
            Ok((again.or(joint), note))
        })
        .collect::<Result<Vec<_>, FilterError>>()?;
    let (joints, notes): (Vec<_>, Vec<_>) = looked_at.into_iter().unzip();
    Ok((joints, notes.into_iter().flatten().collect()))
}

/// What rows near reversals tell of a joint that is off, where nothing was told without them and something is with them.
fn told_more<'a>(search: &Search<'a>, told: &Explanation) -> Result<Searched<'a>, FilterError> {
    if told.is_told() || !is_beyond(search, &told.refined.residual_nm, OFF) {
        return Ok(None);
    }
    let search = search.at_reversals()?;
    let mut explanation = explain(&search, &told.without.model.settled)?;
    if explanation.refined.model.terms.is_empty() {
        // without a name it is what any twin gets wrong there, but for what is far off
        if !is_beyond(&search, &explanation.refined.residual_nm, FAR_OFF) {
            return Ok(None);
        }
        if !explanation.is_told() {
            let square = search.square(&explanation.refined.residual_nm);
            explanation.leave("the way through reversals", tempered_nats(square, 1));
        }
    }
    Ok(Some((search, explanation)))
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
    fn what_is_far_off_is_no_agreement_though_nothing_tells_what_it_is() {
        let (verdict, names, is_looked_at) = told(MadeUp {
            ripple_nm: 0.5,
            ripple_cycles: 2.0,
            sines: [[0.08, 24.0], [0.02, 1.7]],
            ..MadeUp::KNOWN
        });
        assert_eq!((verdict, names.len()), (Verdict::Unexplained, 0));
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
