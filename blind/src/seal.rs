//! The seal: labels put away, with a salted digest of each published before anybody predicts.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::label::Label;
use crate::random::Random;

/// The file of digests, published with the cases.
pub const SEAL: &str = "seal.json";
/// The file of labels and salts.
pub const SEALED: &str = "labels.sealed";
/// The files of a case.
pub const CASE_FILES: [&str; 2] = ["robot.toml", "recording.mcap"];

const SCHEMA: u32 = 1;
/// The random stream of the salts.
const SALTS: u64 = 1;
/// Labels are small; this is far above what they need.
const LABELS_BYTES_MAX: usize = 1 << 28;

/// Why cases cannot be sealed or unsealed.
#[derive(Debug, thiserror::Error)]
pub enum SealError {
    /// A file cannot be read or written.
    #[error("{}: {reason}", path.display())]
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// A label is not the one that was sealed.
    #[error(
        "{case}: the label in labels.sealed has digest {found}, seal.json says {sealed}; these labels were changed after the seal"
    )]
    Broken {
        /// Which case.
        case: String,
        /// What the label has.
        found: String,
        /// What was published.
        sealed: String,
    },
    /// A case's file is not the one that was sealed.
    #[error("{}: is not the file that was sealed with this case; restore it or make the cases again", path.display())]
    Changed {
        /// Which.
        path: PathBuf,
    },
}

/// `seal.json`.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Seal {
    schema: u32,
    /// SHA-256 of salt and label, by case.
    sha256: BTreeMap<String, String>,
}

/// `labels.sealed`, compressed.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Sealed {
    schema: u32,
    seed: u64,
    /// By case.
    labels: BTreeMap<String, Salted>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Salted {
    salt: String,
    /// JSON of a [`Label`], to the byte.
    label: String,
}

impl Salted {
    fn digest(&self) -> String {
        hex(&Sha256::digest(format!("{}{}", self.salt, self.label)))
    }
}

/// Puts the labels of a folder of cases away.
///
/// # Errors
/// [`SealError::File`].
pub fn seal(folder: &Path, seed: u64, labels: &[Label]) -> Result<(), SealError> {
    let mut random = Random::new(seed, SALTS);
    let mut sealed = Sealed {
        schema: SCHEMA,
        seed,
        labels: BTreeMap::new(),
    };
    let mut digests = BTreeMap::new();
    for label in labels {
        let salted = Salted {
            salt: format!("{:016x}{:016x}", random.bits(), random.bits()),
            label: json(folder, label)?,
        };
        digests.insert(label.case.clone(), salted.digest());
        sealed.labels.insert(label.case.clone(), salted);
    }
    let path = folder.join(SEALED);
    let packed = zstd::bulk::compress(json(&path, &sealed)?.as_bytes(), 0)
        .map_err(|error| file_error(&path, &error))?;
    write(&path, &packed)?;
    let path = folder.join(SEAL);
    let seal = Seal {
        schema: SCHEMA,
        sha256: digests,
    };
    let text = serde_json::to_string_pretty(&seal).map_err(|error| file_error(&path, &error))?;
    write(&path, text.as_bytes())
}

/// Opens the labels of a folder of cases and holds them, and the cases' files, against the seal.
///
/// # Errors
/// [`SealError`], naming the first case that is not as it was sealed.
pub fn unseal(folder: &Path) -> Result<Vec<Label>, SealError> {
    let path = folder.join(SEAL);
    let seal: Seal = parse(&path, &read(&path)?)?;
    let path = folder.join(SEALED);
    let unpacked = zstd::bulk::decompress(&read(&path)?, LABELS_BYTES_MAX)
        .map_err(|error| file_error(&path, &error))?;
    let sealed: Sealed = parse(&path, &unpacked)?;
    if !sealed.labels.keys().eq(seal.sha256.keys()) {
        return Err(file_error(&path, &"its cases are not those of seal.json"));
    }
    let labels = sealed.labels.iter().map(|(case, salted)| {
        let (found, published) = (salted.digest(), &seal.sha256[case]);
        if found != *published {
            return Err(SealError::Broken {
                case: case.clone(),
                found,
                sealed: published.clone(),
            });
        }
        let label: Label = parse(&path, salted.label.as_bytes())?;
        check_files(folder, &label)?;
        Ok(label)
    });
    labels.collect()
}

/// The names of a folder's cases, as the seal lists them.
///
/// # Errors
/// [`SealError::File`].
pub fn cases(folder: &Path) -> Result<Vec<String>, SealError> {
    let path = folder.join(SEAL);
    let seal: Seal = parse(&path, &read(&path)?)?;
    Ok(seal.sha256.into_keys().collect())
}

fn check_files(folder: &Path, label: &Label) -> Result<(), SealError> {
    for (name, sealed) in &label.files {
        let path = folder.join(&label.case).join(name);
        if digest_of(&path)? != *sealed {
            return Err(SealError::Changed { path });
        }
    }
    Ok(())
}

/// SHA-256 of a file.
pub(crate) fn digest_of(path: &Path) -> Result<String, SealError> {
    let mut digest = Sha256::new();
    let mut file = fs::File::open(path).map_err(|error| file_error(path, &error))?;
    std::io::copy(&mut file, &mut digest).map_err(|error| file_error(path, &error))?;
    Ok(hex(&digest.finalize()))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn json(path: &Path, value: &impl Serialize) -> Result<String, SealError> {
    serde_json::to_string(value).map_err(|error| file_error(path, &error))
}

fn parse<T: for<'de> Deserialize<'de>>(path: &Path, bytes: &[u8]) -> Result<T, SealError> {
    serde_json::from_slice(bytes).map_err(|error| file_error(path, &error))
}

fn read(path: &Path) -> Result<Vec<u8>, SealError> {
    fs::read(path).map_err(|error| file_error(path, &error))
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), SealError> {
    fs::write(path, bytes).map_err(|error| file_error(path, &error))
}

fn file_error(path: &Path, reason: &dyn std::fmt::Display) -> SealError {
    SealError::File {
        path: path.to_owned(),
        reason: reason.to_string(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;
    use crate::label::CaseKind;
    use crate::rig::RigKind;

    fn label(case: &str) -> Label {
        Label {
            case: case.to_owned(),
            kind: CaseKind::NoGap,
            rig: RigKind::OneJoint,
            level: 0.0,
            effects: Vec::new(),
            unlisted: None,
            pair: Vec::new(),
            noise_nm: vec![0.1],
            files: BTreeMap::new(),
        }
    }

    #[test]
    fn what_was_sealed_comes_out_again() {
        let folder = tempfile::tempdir().unwrap();
        let labels = [label("case-0001"), label("case-0002")];
        seal(folder.path(), 3, &labels).unwrap();
        assert_eq!(unseal(folder.path()).unwrap(), labels);
        assert_eq!(cases(folder.path()).unwrap(), ["case-0001", "case-0002"]);
    }

    #[test]
    fn labels_changed_after_the_seal_are_noticed() {
        let folder = tempfile::tempdir().unwrap();
        seal(folder.path(), 3, &[label("case-0001")]).unwrap();
        let published = fs::read(folder.path().join(SEAL)).unwrap();
        let other = Label {
            kind: CaseKind::Unknown,
            ..label("case-0001")
        };
        seal(folder.path(), 3, &[other]).unwrap();
        fs::write(folder.path().join(SEAL), published).unwrap();
        let refused = unseal(folder.path()).unwrap_err();
        assert!(matches!(refused, SealError::Broken { .. }), "{refused}");
    }

    #[test]
    fn a_case_changed_after_the_seal_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let case = folder.path().join("case-0001");
        fs::create_dir(&case).unwrap();
        let file = case.join(CASE_FILES[0]);
        fs::write(&file, "as it was").unwrap();
        let mut sealed = label("case-0001");
        sealed
            .files
            .insert(CASE_FILES[0].to_owned(), digest_of(&file).unwrap());
        seal(folder.path(), 3, &[sealed]).unwrap();
        assert!(unseal(folder.path()).is_ok());
        fs::write(&file, "as it is").unwrap();
        let refused = unseal(folder.path()).unwrap_err();
        assert!(matches!(refused, SealError::Changed { .. }), "{refused}");
    }
}
