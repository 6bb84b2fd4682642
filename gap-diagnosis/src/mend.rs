//! What was found in the samples is taken out before anything is fitted: rows that were not measured anew are no
//! measurement, and an encoder's steps are those it has. What the file itself tells of the whole arm is put into its links.

use recording::{JointColumns, Recording, Signal};
use robot::{Effect, EncoderSide, Robot};

use crate::samples::Found;

/// Signals that a lost sample repeats.
const MEASURED: [Signal; 4] = [
    Signal::MotorPositionRad,
    Signal::LinkPositionRad,
    Signal::MotorTorqueNm,
    Signal::JointTorqueNm,
];

/// Recordings in which rows that repeat the row before hold no value, of the joints where such were found.
pub fn recordings(
    tables: &[&Recording],
    robot: &Robot,
    found: &[Vec<Found>],
) -> Option<Vec<Recording>> {
    let lost: Vec<&str> = robot
        .joints
        .iter()
        .zip(found)
        .filter(|(_, found)| {
            let mut effects = found.iter().map(|found| &found.effect);
            effects.any(|effect| matches!(effect, Effect::DroppedSamples { .. }))
        })
        .map(|(joint, _)| joint.name.as_str())
        .collect();
    if lost.is_empty() {
        return None;
    }
    let mended = tables.iter().map(|table| {
        let mut mended = (*table).clone();
        for joint in &mut mended.joints {
            if lost.contains(&joint.name.as_str()) {
                blank_repeats(joint);
            }
        }
        mended
    });
    Some(mended.collect())
}

fn blank_repeats(joint: &mut JointColumns) {
    let measured: Vec<&Vec<f64>> = MEASURED
        .iter()
        .filter_map(|signal| joint.signals.get(signal))
        .filter(|values| values.iter().any(|value| value.is_finite()))
        .collect();
    let rows = measured.first().map_or(0, |values| values.len());
    let repeats: Vec<usize> = (1..rows)
        .filter(|&k| measured.iter().all(|values| values[k] == values[k - 1]))
        .collect();
    for signal in MEASURED {
        if let Some(values) = joint.signals.get_mut(&signal) {
            for &k in &repeats {
                values[k] = f64::NAN;
            }
        }
    }
}

/// The robot file with the encoder steps that were found, and with its own payload, tilt and added inertia in the chain.
pub fn robot(robot: &Robot, found: &[Vec<Found>]) -> Robot {
    let mut mended = robot.clone();
    if let Ok(chain) = robot.loaded_chain() {
        mended.chain = chain;
    }
    for (joint, found) in mended.joints.iter_mut().zip(found) {
        for found in found {
            let Effect::EncoderQuantisation {
                resolution_rad,
                side,
            } = found.effect
            else {
                continue;
            };
            match side {
                EncoderSide::Motor => joint.motor_encoder_resolution_rad = Some(resolution_rad),
                EncoderSide::Link => joint.link_encoder_resolution_rad = Some(resolution_rad),
            }
        }
    }
    mended
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_that_repeats_all_signals_holds_no_value() {
        let mut joint = JointColumns {
            name: "joint1".to_owned(),
            signals: [
                (Signal::MotorPositionRad, vec![0.0, 0.1, 0.1, 0.1, 0.2]),
                (Signal::MotorTorqueNm, vec![1.0, 1.1, 1.1, 1.2, 1.3]),
                (Signal::CommandTorqueNm, vec![1.0; 5]),
            ]
            .into(),
        };
        blank_repeats(&mut joint);
        let position_rad = &joint.signals[&Signal::MotorPositionRad];
        assert!(position_rad[2].is_nan());
        assert_eq!(position_rad[3], 0.1);
        assert_eq!(joint.signals[&Signal::CommandTorqueNm], [1.0; 5]);
    }
}
