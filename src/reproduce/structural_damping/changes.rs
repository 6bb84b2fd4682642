//! The judged motion again: on a joint that has changed since it was calibrated, and calibrated without a torque sensor.
//!
//! Neither robot file nor calibration is told of a change. SD, section I, argues that ageing asks for frequent calibration.

use std::fs;

use estimators::compare::Errors;
use recording::Recording;
use robot::{Effect, EncoderSide, Injection, Robot, RobotJoint};
use serde::Serialize;

use super::Joint;
use super::motions::Motion;
use super::stage::Stage;
use crate::error::CliError;
use crate::estimate::compare::{Measured, one};
use crate::output::cannot_write;
use crate::reproduce::sheet::{Sheet, mean_and_range};

/// What may change about a joint.
struct Change {
    /// In words.
    name: &'static str,
    /// Of its files.
    file: &'static str,
    /// What that is on a joint of this robot file.
    effects: fn(&RobotJoint) -> Vec<Effect>,
}

const CHANGES: [Change; 4] = [
    Change {
        name: "encoders twice as coarse",
        file: "coarse",
        effects: coarse,
    },
    Change {
        name: "warm gear",
        file: "warm",
        effects: warm,
    },
    Change {
        name: "stiffness a tenth lower",
        file: "soft",
        effects: soft,
    },
    Change {
        name: "one sample in 100 lost",
        file: "lost",
        effects: |_| vec![Effect::DroppedSamples { fraction: 0.01 }],
    },
];
/// What a warm gear has less of; assumed.
const WARM_COULOMB_SHARE: f64 = 0.3;
const WARM_VISCOUS_SHARE: f64 = 0.4;
/// Ageing, as much as the paper's argument asks about.
const AGED_SHARE: f64 = 0.1;

/// All estimators on one changed joint.
#[derive(Debug, Serialize)]
pub struct Changed {
    /// What is different.
    pub change: &'static str,
    /// Estimator by estimator.
    pub estimators: Vec<Measured>,
}

fn coarse(joint: &RobotJoint) -> Vec<Effect> {
    let twice = |resolution_rad: Option<f64>, side| {
        resolution_rad.map(|resolution_rad| Effect::EncoderQuantisation {
            resolution_rad: 2.0 * resolution_rad,
            side,
        })
    };
    let motor = twice(joint.motor_encoder_resolution_rad, EncoderSide::Motor);
    let link = twice(joint.link_encoder_resolution_rad, EncoderSide::Link);
    motor.into_iter().chain(link).collect()
}

fn warm(joint: &RobotJoint) -> Vec<Effect> {
    let less = |effect: &Effect| match *effect {
        Effect::CoulombFriction { coulomb_nm } => Some(Effect::CoulombFriction {
            coulomb_nm: -WARM_COULOMB_SHARE * coulomb_nm,
        }),
        Effect::ViscousFriction { viscous_nm_s_rad } => Some(Effect::ViscousFriction {
            viscous_nm_s_rad: -WARM_VISCOUS_SHARE * viscous_nm_s_rad,
        }),
        _ => None,
    };
    joint.effects.iter().filter_map(less).collect()
}

fn soft(joint: &RobotJoint) -> Vec<Effect> {
    let less = |effect: &Effect| match *effect {
        Effect::TorsionalCompliance { stiffness_nm_rad } => Some(Effect::TorsionalCompliance {
            stiffness_nm_rad: -AGED_SHARE * stiffness_nm_rad,
        }),
        _ => None,
    };
    joint.effects.iter().filter_map(less).collect()
}

/// Each change in turn, judged with what was calibrated before it. Its recording is not kept: seed and effects make it again.
///
/// # Errors
/// [`CliError`] if the loop stopped or a file cannot be written.
pub fn run(stage: &Stage, calibrated: &Robot, motion: &Motion) -> Result<Vec<Changed>, CliError> {
    let each = CHANGES.iter().map(|change| {
        let added = |effect| Injection {
            joint: Some(0),
            effect,
            start_s: 0.0,
        };
        let effects = (change.effects)(&stage.robot.joints[0]).into_iter();
        let injections: Vec<Injection> = effects.map(added).collect();
        let name = format!("{}-{}", motion.name, change.file);
        let (path, recording) = stage.record(motion, &injections, &name)?;
        fs::remove_file(&path).map_err(|error| cannot_write(&path, &error))?;
        scored(change.name, &recording, calibrated)
    });
    each.collect()
}

/// All estimators of a robot file on a recording.
///
/// # Errors
/// [`CliError::Input`] if the recording has no torque sensor.
pub fn scored(
    change: &'static str,
    recording: &Recording,
    calibrated: &Robot,
) -> Result<Changed, CliError> {
    let judged = one(
        change.as_ref(),
        recording,
        calibrated,
        &calibrated.joints[0],
    );
    Ok(Changed {
        change,
        estimators: judged.map_err(CliError::Input)?.estimators,
    })
}

/// Estimators down, changes across; a sheet for each quantity.
pub fn sheets(joints: &[Joint]) -> Vec<Sheet> {
    let rms = |errors: &Option<Errors>| errors.map(|errors| errors.rms_nm);
    let max = |errors: &Option<Errors>| errors.map(|errors| errors.max_nm);
    vec![
        sheet(
            joints,
            "Changed joints: error in motion, rms, Nm",
            |found| rms(&found.score.dynamic),
        ),
        sheet(
            joints,
            "Changed joints: error in motion, largest, Nm",
            |found| max(&found.score.dynamic),
        ),
        sheet(joints, "Changed joints: error standing, rms, Nm", |found| {
            rms(&found.score.static_load)
        }),
        sheet(
            joints,
            "Changed joints: errors within 1.96 standard deviations, %",
            |found| found.score.coverage_95.map(|share| 100.0 * share),
        ),
        sheet(joints, "Changed joints: one estimate, ns", |found| {
            Some(found.cost_ns)
        }),
    ]
}

fn sheet(joints: &[Joint], title: &str, of: impl Fn(&Measured) -> Option<f64>) -> Sheet {
    let Some(first) = joints.first() else {
        return Sheet::new(title, [""]);
    };
    let changes = first.changed.iter().map(|changed| changed.change);
    let mut sheet = Sheet::new(title, ["estimator"].into_iter().chain(changes));
    let kinds = first
        .changed
        .first()
        .map_or(&[][..], |changed| &changed.estimators);
    for kind in kinds.iter().map(|found| found.score.kind) {
        let cell = |change: usize| {
            let found = joints.iter().filter_map(|joint| {
                let mut estimators = joint.changed.get(change)?.estimators.iter();
                of(estimators.find(|found| found.score.kind == kind)?)
            });
            mean_and_range(&found.collect::<Vec<f64>>(), 3)
        };
        let cells = (0..first.changed.len()).map(cell);
        let row = [kind.name().to_owned()].into_iter().chain(cells).collect();
        sheet.rows.push(row);
    }
    sheet
}
