//! Where a joint moves steadily, and what both ways of finding it share.
//!
//! [`constant`] takes the recorder's word: stretches in which the *reference* velocity is constant, as in the papers'
//! friction experiments. [`slow`] takes the encoder's: rows in which *measured* motion is slow and unaccelerated, whatever
//! was asked for, as quasi-static fits need it.

pub(crate) mod constant;
pub(crate) mod slow;

use recording::Signal;
use robot::Robot;

use crate::IdentificationError;

/// The joint's place in the chain.
pub(crate) fn joint_index(robot: &Robot, joint: &str) -> Result<usize, IdentificationError> {
    robot
        .joint_index(joint)
        .ok_or_else(|| IdentificationError::UnknownJoint {
            joint: joint.to_owned(),
            there: robot.joints.iter().map(|j| j.name.clone()).collect(),
        })
}

/// That at least half of a signal's values in these rows are there.
pub(crate) fn check_measured(
    joint: &str,
    signal: Signal,
    values: &[f64],
    rows: std::ops::Range<usize>,
    time_s: &[f64],
) -> Result<(), IdentificationError> {
    let measured = |row: &usize| values.get(*row).is_some_and(|value| value.is_finite());
    let missing = rows.len() - rows.clone().filter(measured).count();
    if 2 * missing <= rows.len() {
        return Ok(());
    }
    Err(IdentificationError::NotMeasured {
        joint: joint.to_owned(),
        signal,
        missing,
        rows: rows.len(),
        from_s: time_s.get(rows.start).copied().unwrap_or(f64::NAN),
    })
}
