//! Signals of two joints that changed places.

use super::{Finding, FindingKind, mapping_line, values};
use crate::statistics::line;
use crate::{Recording, Signal};

/// A joint's own signals agree less than this where they were swapped,
const OWN: f64 = 0.8;
/// and more than this with the other joint's.
const OTHERS: f64 = 0.98;

/// For each pair of joints, the first pair of signals that shows it.
pub(super) fn check(recording: &Recording) -> Vec<Finding> {
    use Signal::{
        CommandTorqueNm, LinkPositionRad, MotorPositionRad, MotorTorqueNm, ReferencePositionRad,
    };
    let pairs = [
        (LinkPositionRad, MotorPositionRad),
        (ReferencePositionRad, LinkPositionRad),
        (ReferencePositionRad, MotorPositionRad),
        (CommandTorqueNm, MotorTorqueNm),
    ];
    let mut findings: Vec<Finding> = Vec::new();
    for (kept, swapped) in pairs {
        let found = swapped_joints(recording, kept, swapped).into_iter();
        // neither of the two is to be diagnosed
        for (a, b) in found.flat_map(|(a, b)| [(a, b), (b, a)]) {
            let (first, second) = (&recording.joints[a], &recording.joints[b]);
            if findings
                .iter()
                .any(|known| known.joint.as_ref() == Some(&first.name))
            {
                continue;
            }
            let what = format!(
                "goes with {}.{kept}, and {}.{swapped} with {}.{kept}: the two joints are swapped",
                second.name, second.name, first.name
            );
            let remedy = format!("exchange the columns with those of [joint.{}]", second.name);
            let finding = Finding::error(FindingKind::SwappedJoints, what)
                .at(first)
                .of(swapped);
            findings.push(finding.remedy(mapping_line(first, swapped, &remedy)));
        }
    }
    findings
}

fn swapped_joints(recording: &Recording, kept: Signal, swapped: Signal) -> Vec<(usize, usize)> {
    let agreement = |a: usize, b: usize| {
        let kept = values(&recording.joints[a], kept)?;
        let swapped = values(&recording.joints[b], swapped)?;
        Some(line(kept, swapped).map_or(0.0, |line| line.correlation.abs()))
    };
    let strange: Vec<usize> = (0..recording.joints.len())
        .filter(|joint| agreement(*joint, *joint).is_some_and(|own| own < OWN))
        .collect();
    let mut found = Vec::new();
    for (index, a) in strange.iter().enumerate() {
        for b in &strange[index + 1..] {
            let agrees = |a, b| agreement(a, b).is_some_and(|other| other > OTHERS);
            if agrees(*a, *b) && agrees(*b, *a) {
                found.push((*a, *b));
            }
        }
    }
    found
}
