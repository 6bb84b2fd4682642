//! Sealed evaluation of the gap diagnosis: cases whose cause is known and put away, and scores of what was predicted.
//!
//! [`plan`] says which cases an [`Order`] has, [`make_case`] makes one: a robot drawn at random, a rich motion, the
//! emulated plant ([`plant_emulator`], which shares neither integrator nor friction law with the diagnosis' simulation)
//! with parameters off by the robot file's tolerance, and an effect scaled until its gap has the wanted size over what
//! nobody can know. A case's folder holds `robot.toml` and `recording.mcap` and tells nothing else. [`seal`] puts the
//! labels away, [`unseal`] opens them and holds them against the published digests.
//!
//! # Sizes
//!
//! Gap: rms of the disturbance torque's difference, 0 to 15 Hz, between the plant with and without the effect, on equal
//! noise. Noise: rms of the same between the plant without the effect and the exact nominal plant, that is parameters
//! off by their tolerance, sensors, and bristles that differ. Both at the joint side.
#![forbid(unsafe_code)]

mod bench;
mod case;
mod course;
mod disturbance;
mod families;
mod label;
mod likeness;
mod pairs;
mod plan;
mod random;
mod rig;
pub mod score;
mod seal;
mod sizes;
mod strength;
mod tolerance;
mod unlisted;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use joint_model::filter::FilterError;
use plant_emulator::PlantError;
use recording::{CycleRow, Header, WriteError, Writer};
use robot::RobotError;
use twin::TwinError;

pub use label::{CaseKind, Label, TrueEffect, TrueUnlisted};
pub use plan::{CasePlan, Order, plan};
pub use rig::RigKind;
pub use seal::{CASE_FILES, SEAL, SEALED, SealError, cases, seal, unseal};
pub use unlisted::Unlisted;

/// Why a case cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum BlindError {
    /// A robot that was drawn is none.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// Its plant cannot be built.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// Its plant cannot be run.
    #[error(transparent)]
    Twin(#[from] TwinError),
    /// Its disturbance torque cannot be taken.
    #[error(transparent)]
    Filter(#[from] FilterError),
    /// The recording cannot be written.
    #[error(transparent)]
    Recording(#[from] WriteError),
    /// A digest cannot be taken.
    #[error(transparent)]
    Seal(#[from] SealError),
    /// The robot file cannot be written as TOML.
    #[error("robot file: {0}")]
    Toml(#[from] toml::ser::Error),
    /// A file cannot be written.
    #[error("cannot write {}: {reason}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// Nothing that was drawn suits the plan.
    #[error("case {case}: none of {draws} robots and motions drawn suits it; choose another seed")]
    Exhausted {
        /// Its number.
        case: usize,
        /// How many were drawn.
        draws: usize,
    },
}

/// Makes a case, writes its folder into `folder`, and tells the truth about it.
///
/// # Errors
/// [`BlindError`].
pub fn make_case(plan: &CasePlan, folder: &Path) -> Result<Label, BlindError> {
    let case = case::make(plan)?;
    let mut label = case.label;
    let folder = folder.join(&label.case);
    let file_error = |path: &Path, error: std::io::Error| BlindError::File {
        path: path.to_owned(),
        reason: error.to_string(),
    };
    fs::create_dir_all(&folder).map_err(|error| file_error(&folder, error))?;
    let [robot_path, recording_path] = CASE_FILES.map(|name| folder.join(name));
    let text = case.rig.file.to_toml()?;
    fs::write(&robot_path, text).map_err(|error| file_error(&robot_path, error))?;
    write_recording(&case.run, &case.rig, &recording_path)?;
    for name in CASE_FILES {
        let digest = seal::digest_of(&folder.join(name))?;
        label.files.insert(name.to_owned(), digest);
    }
    Ok(label)
}

fn write_recording(run: &bench::Run, rig: &rig::Rig, path: &Path) -> Result<(), BlindError> {
    let header = Header {
        joint_names: rig
            .robot
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .collect(),
        sample_rate_hz: 1e9 / bench::PERIOD_NS as f64,
        metadata: BTreeMap::new(),
    };
    let mut writer = Writer::create(path, &header)?;
    for (cycle, joints) in run.rows().enumerate() {
        writer.write_cycle(&CycleRow {
            cycle: cycle as u64,
            time_ns: cycle as u64 * bench::PERIOD_NS,
            loop_cycle: None,
            joints,
            truth: None,
        })?;
    }
    Ok(writer.finish()?)
}
