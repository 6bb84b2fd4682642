//! An instance: one running robot, and the directory it owns.
//!
//! The directory holds what its processes need to find each other (`run.json`, the middleware's files) and what they
//! leave for the report. It belongs to one user; nobody else may enter.

use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use iceoryx2::config::Config;
use iceoryx2::prelude::{FileName, Path as IpcPath, SemanticString};
use serde::{Deserialize, Serialize};

use crate::control_options::ControlOptions;
use crate::topics::Role;

/// How time passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// By the wall clock.
    Realtime,
    /// Virtual: a cycle ends when everybody has done its part.
    Lockstep,
}

/// What the drives are commanded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControlMode {
    /// Motor torque: model feedforward and low-gain feedback.
    Torque,
    /// Joint velocity, held by the drives' own loops.
    Velocity,
}

/// How a process waits for the next message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wait {
    /// Sleep until woken.
    Block,
    /// Look without pause; wants a core of its own.
    Spin,
}

/// Everything the processes of a run need to know; written once by the supervisor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RunConfig {
    /// Number of this run; messages of any other are refused.
    pub session: u64,
    /// Name of a shipped robot, or an absolute path.
    pub robot: String,
    /// Name of a driver.
    pub driver: String,
    /// Name of a trajectory, or an absolute path.
    pub trajectory: String,
    /// Robot the emulated plant is made from; `robot` if none. They differ where a model was identified.
    pub plant: Option<String>,
    /// What the drives are commanded.
    pub control: ControlMode,
    /// How torque control makes its feedforward.
    pub options: ControlOptions,
    /// Names of the torque estimators that run; all that the robot file has parameters for if none is named.
    pub estimators: Vec<String>,
    /// How time passes.
    pub mode: Mode,
    /// Control period.
    pub period_ns: u64,
    /// Cycles to run; 0 runs until stopped.
    pub cycles: u64,
    /// How the loop and the services wait.
    pub wait: Wait,
    /// The loop wakes this long before each cycle's instant and watches the clock until it has come; 0 sleeps to it.
    pub wake_early_ns: u64,
    /// Seed of everything random in the emulator.
    pub seed: u64,
    /// File of effects the emulator adds.
    pub inject: Option<PathBuf>,
    /// Where the recording goes.
    pub record: Option<PathBuf>,
    /// After this much of the period, a command that has not come is missing.
    pub command_deadline_ns: u64,
    /// Cores the processes may use, the loop's own last.
    pub cores: Vec<usize>,
    /// Where the emulated joints stand at the start.
    pub initial_position_rad: Vec<f64>,
}

impl RunConfig {
    /// The core a process is pinned to, of the cores the processes may use.
    pub fn core_of(&self, role: Role) -> Option<usize> {
        core_of(role, &self.cores)
    }

    /// The cores a process starts on. In lockstep, where one works while the others wait for it, those that wake each other are
    /// on the loop's core: waking a process there takes half the time of waking it elsewhere. The relay is not woken by anybody.
    pub fn start_cores(&self, role: Role) -> &[usize] {
        match (self.mode, role) {
            (Mode::Realtime, _) | (_, Role::Relay) => &self.cores,
            (Mode::Lockstep, _) => &self.cores[self.cores.len().saturating_sub(1)..],
        }
    }

    /// After how long a lost wake-up is found; `realtime_ns` where time is the wall clock's.
    pub fn recheck_ns(&self, realtime_ns: u64) -> u64 {
        match self.mode {
            Mode::Realtime => realtime_ns,
            Mode::Lockstep => LOCKSTEP_RECHECK_NS,
        }
    }
}

/// In lockstep nothing is missed by waiting. Longer than the kernel's tick, because a wait that ends before the next tick has
/// the clock's interrupt set anew, which on a virtual machine costs more than the wake-up.
const LOCKSTEP_RECHECK_NS: u64 = 20_000_000;

/// The core a process is pinned to: the loop has the last of `cores` to itself, the others one each below it, and those
/// left share the first. `None`, the kernel's choice, where there is only one core.
pub fn core_of(role: Role, cores: &[usize]) -> Option<usize> {
    let from_the_top = match role {
        Role::Loop => 0,
        Role::Feedforward => 1,
        Role::Emulator => 2,
        Role::Estimator => 3,
        Role::Relay => 4,
    };
    let last = cores.len().checked_sub(1).filter(|&last| last > 0)?;
    Some(cores[last - from_the_top.min(last)])
}

/// Why an instance cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum InstanceError {
    /// The name would not do as a file name.
    #[error("instance name `{name}`: use 1 to {NAME_BYTES_MAX} letters, digits, `-` or `_`")]
    Name {
        /// As given.
        name: String,
    },
    /// The directory is somebody else's or open to others.
    #[error("{}: {reason}", path.display())]
    Access {
        /// The directory.
        path: PathBuf,
        /// Whose it is.
        reason: String,
    },
    /// A file operation failed.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// `run.json` is not what the supervisor writes.
    #[error("{}: {reason}", path.display())]
    RunConfig {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

/// Longest instance name. A socket's path has at most 107 bytes: 27 for `/tmp/flexspline-UID/`, the name, 5 for `/ipc/`,
/// 13 for the prefix, up to 45 for what the middleware adds.
const NAME_BYTES_MAX: usize = 16;

/// How often a directory is removed in which somebody makes files meanwhile.
const WIPE_TRIES: usize = 100;

/// What group and others may do, in a file's mode.
const OTHERS: u32 = 0o077;

/// One running robot's directory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance {
    name: String,
    directory: PathBuf,
}

impl Instance {
    /// The instance of this name of the calling user (`user_id`). Touches no file.
    ///
    /// # Errors
    /// [`InstanceError::Name`].
    pub fn new(name: &str, user_id: u32) -> Result<Self, InstanceError> {
        let plain = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
        if name.is_empty() || name.len() > NAME_BYTES_MAX || !name.bytes().all(plain) {
            return Err(InstanceError::Name {
                name: name.to_owned(),
            });
        }
        let directory = directory_of(user_id).join(name);
        Ok(Self {
            name: name.to_owned(),
            directory,
        })
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its directory.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// A file in its directory.
    pub fn file(&self, name: &str) -> PathBuf {
        self.directory.join(name)
    }

    /// The file whose lock says that the instance is taken. It lies beside the directory, which is wiped before each run.
    pub fn lock_file(&self) -> PathBuf {
        self.directory.with_extension("lock")
    }

    /// Names of the user's instances that have a directory or a lock file, running or not.
    pub fn names(user_id: u32) -> Vec<String> {
        let entries = fs::read_dir(directory_of(user_id)).into_iter().flatten();
        let mut names: Vec<String> = entries
            .flatten()
            .map(|entry| entry.path())
            .filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned()))
            .collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    /// Makes the parent directory and checks that it is the caller's alone.
    ///
    /// # Errors
    /// [`InstanceError::Access`] if another user owns it or may enter it, [`InstanceError::File`] if it cannot be made.
    pub fn make_parent(&self, user_id: u32) -> Result<(), InstanceError> {
        make_private_directory(self.parent())?;
        self.check_parent(user_id)
    }

    fn parent(&self) -> &Path {
        self.directory.parent().unwrap_or(Path::new("/tmp"))
    }

    /// Checks that the parent directory is the caller's alone.
    ///
    /// # Errors
    /// [`InstanceError::Access`] if another user owns it or may enter it, [`InstanceError::File`] if it is not there.
    pub fn check_parent(&self, user_id: u32) -> Result<(), InstanceError> {
        let parent = self.parent();
        let file_error = |source| InstanceError::File {
            path: parent.to_owned(),
            source,
        };
        let metadata = fs::symlink_metadata(parent).map_err(file_error)?;
        let refuse = |reason: String| {
            Err(InstanceError::Access {
                path: parent.to_owned(),
                reason,
            })
        };
        if !metadata.is_dir() {
            return refuse("is not a directory; remove it".to_owned());
        }
        if metadata.uid() != user_id {
            return refuse(format!(
                "belongs to user {}, not to {user_id}; ask its owner to remove it",
                metadata.uid()
            ));
        }
        if metadata.mode() & OTHERS != 0 {
            return refuse(format!(
                "is open to others (mode {:03o}); run chmod 700 on it",
                metadata.mode() & 0o777
            ));
        }
        Ok(())
    }

    /// Makes the directory; it must not exist.
    ///
    /// # Errors
    /// [`InstanceError::File`].
    pub fn make_directory(&self) -> Result<(), InstanceError> {
        make_private_directory(&self.directory)
    }

    /// Removes the directory and every shared memory file of the instance. The caller holds its lock.
    ///
    /// # Errors
    /// [`InstanceError::File`] for the first file that cannot be removed. Files that another user has put there stay.
    pub fn wipe(&self) -> Result<(), InstanceError> {
        // The directory first: without it nobody else joins. An observer that is just joining may still put files into it.
        let mut outcome = fs::remove_dir_all(&self.directory);
        for _ in 1..WIPE_TRIES {
            match outcome {
                Err(error) if error.kind() == io::ErrorKind::DirectoryNotEmpty => {
                    outcome = fs::remove_dir_all(&self.directory);
                }
                _ => break,
            }
        }
        ignore_missing(outcome, &self.directory)?;
        for path in self.shared_memory_files() {
            match fs::remove_file(&path) {
                // Another user's: whoever joins is told so.
                Err(error) if error.kind() == io::ErrorKind::PermissionDenied => (),
                outcome => ignore_missing(outcome, &path)?,
            }
        }
        Ok(())
    }

    /// Makes sure that no other user can open the instance's shared memory.
    ///
    /// The middleware (iceoryx2 0.10) gives all its files to their owner alone but one, the counter of its nodes, which
    /// it opens to everybody: who may write to it could keep a service from being started again.
    ///
    /// # Errors
    /// [`InstanceError::Access`] if another user has put a file there, [`InstanceError::File`] if one cannot be closed.
    pub fn close_shared_memory(&self, user_id: u32) -> Result<(), InstanceError> {
        for path in self.shared_memory_files() {
            let metadata = match fs::symlink_metadata(&path) {
                // Processes come and go.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                metadata => metadata.map_err(|source| InstanceError::File {
                    path: path.clone(),
                    source,
                })?,
            };
            if metadata.uid() != user_id {
                let reason = format!(
                    "belongs to user {}, not to {user_id}; ask its owner to remove it",
                    metadata.uid()
                );
                return Err(InstanceError::Access { path, reason });
            }
            if metadata.mode() & OTHERS != 0 {
                ignore_missing(
                    fs::set_permissions(&path, Permissions::from_mode(0o600)),
                    &path,
                )?;
            }
        }
        Ok(())
    }

    fn shared_memory_files(&self) -> impl Iterator<Item = PathBuf> {
        let prefix = self.ipc_prefix();
        let files = fs::read_dir("/dev/shm").into_iter().flatten().flatten();
        files
            .filter(move |entry| entry.file_name().to_string_lossy().starts_with(&prefix))
            .map(|entry| entry.path())
    }

    /// Removes the lock file too, and the parent directory if this was the last instance. The caller holds the lock,
    /// and whoever takes it must check that the file it locked is still the one of that name.
    ///
    /// # Errors
    /// [`InstanceError::File`].
    pub fn vanish(&self) -> Result<(), InstanceError> {
        self.wipe()?;
        let lock = self.lock_file();
        ignore_missing(fs::remove_file(&lock), &lock)?;
        // Other instances may live there.
        let _ = fs::remove_dir(self.parent());
        Ok(())
    }

    /// Writes what the processes of the run need to know.
    ///
    /// # Errors
    /// [`InstanceError::File`].
    pub fn write_run_config(&self, config: &RunConfig) -> Result<(), InstanceError> {
        self.write_report("run.json", config)?;
        let path = self.file("iceoryx2.toml");
        let ipc = self.ipc_config()?;
        let text = toml::to_string(&ipc).map_err(|error| InstanceError::RunConfig {
            path: path.clone(),
            reason: error.to_string(),
        })?;
        fs::write(&path, text).map_err(|source| InstanceError::File { path, source })
    }

    /// Reads it.
    ///
    /// # Errors
    /// [`InstanceError::File`] where there is no such run, [`InstanceError::RunConfig`] where the file is not ours.
    pub fn run_config(&self) -> Result<RunConfig, InstanceError> {
        self.read_report("run.json")
    }

    /// Writes one process's part of the report, whole or not at all.
    ///
    /// # Errors
    /// [`InstanceError::File`].
    pub fn write_report<T: Serialize + ?Sized>(
        &self,
        name: &str,
        report: &T,
    ) -> Result<(), InstanceError> {
        let path = self.file(name);
        let file_error = |source| InstanceError::File {
            path: path.clone(),
            source,
        };
        let text = serde_json::to_vec_pretty(report).map_err(|error| file_error(error.into()))?;
        let unfinished = self.file(&format!("{name}.part"));
        fs::write(&unfinished, text).map_err(file_error)?;
        fs::rename(&unfinished, &path).map_err(file_error)
    }

    /// Reads one process's part of the report.
    ///
    /// # Errors
    /// [`InstanceError::File`], [`InstanceError::RunConfig`].
    pub fn read_report<T: for<'de> Deserialize<'de>>(
        &self,
        name: &str,
    ) -> Result<T, InstanceError> {
        let path = self.file(name);
        let text = fs::read(&path).map_err(|source| InstanceError::File {
            path: path.clone(),
            source,
        })?;
        serde_json::from_slice(&text).map_err(|error| InstanceError::RunConfig {
            path,
            reason: error.to_string(),
        })
    }

    /// The middleware's settings: files and shared memory of this instance apart from all others.
    ///
    /// # Errors
    /// [`InstanceError::Name`] if the middleware does not take the path.
    pub fn ipc_config(&self) -> Result<Config, InstanceError> {
        let name_error = |_: String| InstanceError::Name {
            name: self.name.clone(),
        };
        let mut config = Config::default();
        let root = self.file("ipc");
        let root = root.to_string_lossy().into_owned();
        config.global.set_root_path(
            &IpcPath::new(root.as_bytes()).map_err(|error| name_error(format!("{error:?}")))?,
        );
        config.global.prefix = FileName::new(self.ipc_prefix().as_bytes())
            .map_err(|error| name_error(format!("{error:?}")))?;
        // The janitor wipes what the dead have left. The middleware would wait for ever for a file that a killed process had
        // made and not filled.
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        Ok(config)
    }

    /// What the names of this instance's files in `/dev/shm` begin with, and no other instance's: `fs`, ten digits made
    /// from user and name, a dot. Short, because it is part of a socket's path too.
    pub fn ipc_prefix(&self) -> String {
        // FNV-1a, 64 bits.
        let hash = self
            .directory
            .as_os_str()
            .as_encoded_bytes()
            .iter()
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
                (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
            });
        let digits: String = (0..10)
            .map(|place| hash / 36_u64.pow(place) % 36)
            .filter_map(|digit| char::from_digit(digit as u32, 36))
            .collect();
        format!("fs{digits}.")
    }
}

/// The directory of all instances of a user.
fn directory_of(user_id: u32) -> PathBuf {
    PathBuf::from(format!("/tmp/flexspline-{user_id}"))
}

fn make_private_directory(path: &Path) -> Result<(), InstanceError> {
    match fs::DirBuilder::new().mode(0o700).create(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
        outcome => outcome.map_err(|source| InstanceError::File {
            path: path.to_owned(),
            source,
        }),
    }
}

fn ignore_missing(outcome: io::Result<()>, path: &Path) -> Result<(), InstanceError> {
    match outcome {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        outcome => outcome.map_err(|source| InstanceError::File {
            path: path.to_owned(),
            source,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_could_leave_the_directory_are_refused() {
        for name in [
            "",
            "..",
            "a/b",
            "a b",
            "ä",
            "a.b",
            "0123456789012345678901234",
        ] {
            assert!(Instance::new(name, 0).is_err(), "{name}");
        }
        assert!(Instance::new("robot-1_A", 0).is_ok());
    }

    #[test]
    fn shared_memory_is_closed_to_others_and_others_files_are_refused() {
        let user = realtime::process::user_id();
        let name = format!("closed-{}", std::process::id());
        let instance = Instance::new(&name, user).expect("a good name");
        let path = PathBuf::from(format!("/dev/shm/{}counter", instance.ipc_prefix()));
        fs::write(&path, "x").expect("shared memory is there");
        fs::set_permissions(&path, Permissions::from_mode(0o666)).expect("our own file");
        instance.close_shared_memory(user).expect("our own file");
        let mode = fs::metadata(&path).expect("still there").mode();
        let refused = instance.close_shared_memory(user + 1);
        instance.wipe().expect("our own file");
        assert_eq!(mode & 0o777, 0o600);
        let message = refused.expect_err("another user's").to_string();
        assert!(
            message.contains("counter") && message.contains("remove it"),
            "{message}"
        );
        assert!(!path.exists(), "wiped");
    }

    #[test]
    fn every_user_and_name_has_its_prefix() {
        let prefix = |name, user| Instance::new(name, user).expect("a good name").ipc_prefix();
        let prefixes =
            [("a", 0), ("b", 0), ("a", 1), ("ab", 0)].map(|(name, user)| prefix(name, user));
        for (index, one) in prefixes.iter().enumerate() {
            assert_eq!(one.len(), 13);
            assert!(
                prefixes[..index].iter().all(|other| other != one),
                "{prefixes:?}"
            );
        }
    }

    #[test]
    fn the_longest_socket_path_fits() {
        let instance = Instance::new(&"n".repeat(NAME_BYTES_MAX), u32::MAX).expect("a good name");
        let socket =
            instance
                .file("ipc")
                .join(format!("{}{}.event", instance.ipc_prefix(), u128::MAX));
        assert!(socket.as_os_str().len() <= 107, "{}", socket.display());
    }
}
