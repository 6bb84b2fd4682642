//! Reads what the checks look at. What cannot be read is none: containers hide much, users may not see all.

use std::ffi::CString;
use std::fs;
use std::io::Read;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use realtime::usage::stolen_ns;
use shm_types::instance::Instance;

use super::cores::SleepState;
use super::kernel::cpu_group;
use super::storage::{Seen, locked_inodes};

/// The text of every file a check looks at, and a few numbers.
#[derive(Debug)]
pub struct Machine {
    pub version: Option<String>,
    pub command_line: Option<String>,
    pub preemption: Option<String>,
    pub config: Option<String>,
    pub rt_runtime_us: Option<String>,
    pub rt_period_us: Option<String>,
    pub rt_group_share_us: Option<String>,
    pub limits: Option<String>,
    pub status: Option<String>,
    pub isolated: Option<String>,
    pub siblings: Option<String>,
    pub governor: Option<String>,
    pub sleep_states: Option<Vec<SleepState>>,
    pub can_hold_dma_latency: bool,
    pub clock_source: Option<String>,
    pub cpu_info: Option<String>,
    pub stolen_s: Option<f64>,
    pub shared_memory_free_bytes: Option<u64>,
    pub files_free_bytes: Option<u64>,
    pub directory_refusal: Option<String>,
    pub instances: Vec<Seen>,
    pub shared_memory: Vec<String>,
    pub logind: Option<Vec<String>>,
    pub tmpfiles: Option<Vec<String>>,
}

const CPU: &str = "/sys/devices/system/cpu";

impl Machine {
    /// Reads this machine for `user`, whose loop would run on `loop_core`.
    pub fn read(user: u32, loop_core: Option<usize>) -> Self {
        let core = format!("{CPU}/cpu{}", loop_core.unwrap_or(0));
        let version = read("/proc/version");
        let systemd = Path::new("/run/systemd/system").is_dir();
        Self {
            command_line: read("/proc/cmdline"),
            preemption: read("/sys/kernel/debug/sched/preempt"),
            config: kernel_config(version.as_deref()),
            version,
            rt_runtime_us: read("/proc/sys/kernel/sched_rt_runtime_us"),
            rt_period_us: read("/proc/sys/kernel/sched_rt_period_us"),
            rt_group_share_us: rt_group_share_us(),
            limits: read("/proc/self/limits"),
            status: read("/proc/self/status"),
            isolated: read(&format!("{CPU}/isolated")),
            siblings: read(&format!("{core}/topology/thread_siblings_list")),
            governor: read(&format!("{core}/cpufreq/scaling_governor")),
            sleep_states: sleep_states(Path::new(&core)),
            // Opening asks for nothing; only what is written does.
            can_hold_dma_latency: fs::File::options()
                .write(true)
                .open("/dev/cpu_dma_latency")
                .is_ok(),
            clock_source: read("/sys/devices/system/clocksource/clocksource0/current_clocksource"),
            cpu_info: read("/proc/cpuinfo"),
            stolen_s: read("/proc/stat")
                .and_then(|text| stolen_ns(&text))
                .map(|stolen_ns| stolen_ns as f64 * 1e-9),
            shared_memory_free_bytes: free_bytes(Path::new("/dev/shm")),
            files_free_bytes: free_bytes(Path::new("/tmp")),
            directory_refusal: directory_refusal(user),
            instances: instances(user),
            shared_memory: shared_memory_of(user),
            logind: systemd.then(|| {
                let mut texts: Vec<String> = read("/etc/systemd/logind.conf").into_iter().collect();
                texts.extend(drop_ins("systemd/logind.conf.d"));
                texts
            }),
            tmpfiles: systemd.then(|| drop_ins("tmpfiles.d")),
        }
    }
}

fn read(path: &str) -> Option<String> {
    fs::read_to_string(path).ok()
}

/// What the kernel was built with: as it tells itself, or as the distribution left it in `/boot`.
fn kernel_config(version: Option<&str>) -> Option<String> {
    let own = fs::File::open("/proc/config.gz").ok().and_then(|file| {
        let mut text = String::new();
        GzDecoder::new(file).read_to_string(&mut text).ok()?;
        Some(text)
    });
    let release = version.and_then(|text| text.split_whitespace().nth(2));
    own.or_else(|| read(&format!("/boot/config-{}", release?)))
}

fn rt_group_share_us() -> Option<String> {
    let cgroup = read("/proc/self/cgroup")?;
    let group = cpu_group(&cgroup)?;
    read(&format!("/sys/fs/cgroup/cpu{group}/cpu.rt_runtime_us"))
}

fn sleep_states(core: &Path) -> Option<Vec<SleepState>> {
    let states = fs::read_dir(core.join("cpuidle")).ok()?;
    let state = |directory: PathBuf| {
        Some(SleepState {
            name: fs::read_to_string(directory.join("name"))
                .ok()?
                .trim()
                .to_owned(),
            latency_us: fs::read_to_string(directory.join("latency"))
                .ok()?
                .trim()
                .parse()
                .ok()?,
        })
    };
    Some(
        states
            .flatten()
            .filter_map(|entry| state(entry.path()))
            .collect(),
    )
}

/// Room for ordinary users on the file system of `path`.
#[allow(
    unsafe_code,
    reason = "the standard library does not tell the room of a file system"
)]
fn free_bytes(path: &Path) -> Option<u64> {
    let path = CString::new(path.as_os_str().as_bytes()).ok()?;
    // SAFETY: an all-zero statvfs is a valid value of this plain C struct.
    let mut room: libc::statvfs = unsafe { std::mem::zeroed() };
    // SAFETY: the path is NUL-terminated and `room` valid for writing, both through the call.
    let outcome = unsafe { libc::statvfs(path.as_ptr(), &mut room) };
    (outcome == 0).then(|| room.f_bavail * room.f_frsize)
}

/// What a start would say of the user's directory; nothing where it is as it should be, or not there.
fn directory_refusal(user: u32) -> Option<String> {
    let instance = Instance::new("doctor", user).ok()?;
    if !instance.directory().parent()?.exists() {
        return None;
    }
    instance
        .check_parent(user)
        .err()
        .map(|error| error.to_string())
}

/// The user's instances, known by their directories and lock files.
fn instances(user: u32) -> Vec<Seen> {
    let locked = locked_inodes(&read("/proc/locks").unwrap_or_default());
    let named = |name: &str| {
        let instance = Instance::new(name, user).ok()?;
        let lock = fs::metadata(instance.lock_file());
        Some(Seen {
            name: name.to_owned(),
            ipc_prefix: instance.ipc_prefix(),
            running: lock.is_ok_and(|lock| locked.contains(&lock.ino())),
        })
    };
    Instance::names(user)
        .iter()
        .filter_map(|name| named(name))
        .collect()
}

/// Names of the files in `/dev/shm` that belong to the user.
fn shared_memory_of(user: u32) -> Vec<String> {
    fs::read_dir("/dev/shm")
        .into_iter()
        .flatten()
        .flatten()
        .filter(|entry| {
            entry
                .metadata()
                .is_ok_and(|metadata| metadata.uid() == user)
        })
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .collect()
}

/// Settings in the folders of systemd, in the order in which they count; a file of the same name in a later folder stands
/// for the one before.
fn drop_ins(folder: &str) -> Vec<String> {
    let mut files: std::collections::BTreeMap<std::ffi::OsString, PathBuf> = Default::default();
    for root in ["/usr/lib", "/usr/local/lib", "/run", "/etc"] {
        for entry in fs::read_dir(Path::new(root).join(folder))
            .into_iter()
            .flatten()
            .flatten()
        {
            files.insert(entry.file_name(), entry.path());
        }
    }
    files
        .into_values()
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "conf")
        })
        .filter_map(|path| fs::read_to_string(path).ok())
        .collect()
}
