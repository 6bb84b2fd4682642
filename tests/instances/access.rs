//! Who may touch a running instance: its owner, and nobody else. Readers, however many and however rude, change nothing.
//!
//! What needs a second user is tried where the tests run as root, and says so where they do not.

use std::fs;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::MetadataExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::support::{Bench, eventually, for_everybody, kill, output, spawn, text};
use realtime::process::user_id;
use shm_types::bus::Bus;
use shm_types::instance::Instance;
use shm_types::topics;
use tempfile::TempDir;

/// `nobody`: any number that is not ours would do.
const OTHER_USER: u32 = 65_534;

/// Tells a copy of this test program which instance to join.
const INSTANCE: &str = "FLEXSPLINE_TEST_INSTANCE";
/// Tells it whose instance that is.
const OWNER: &str = "FLEXSPLINE_TEST_OWNER";

fn is_root(what: &str) -> bool {
    if user_id() != 0 {
        println!("skipped: {what} needs a second user, and only root may become one");
    }
    user_id() == 0
}

fn as_other_user(mut command: Command) -> Output {
    command.uid(OTHER_USER).gid(OTHER_USER);
    output(command)
}

fn shell_as_other_user(script: &str, argument: &Path) -> Output {
    let mut shell = Command::new("sh");
    shell.args(["-c", script, "sh"]).arg(argument);
    as_other_user(shell)
}

fn shared_memory(instance: &Instance) -> Vec<PathBuf> {
    let prefix = instance.ipc_prefix();
    fs::read_dir("/dev/shm")
        .expect("shared memory is there")
        .flatten()
        .filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix))
        .map(|entry| entry.path())
        .collect()
}

/// A running instance, and its owner's way to it.
fn running(bench: &Bench) -> (std::process::Child, Instance) {
    let run = spawn(bench.run(&["--duration", "60s"]));
    bench.await_process("loop");
    let instance = Instance::new(&bench.instance, user_id()).expect("a good name");
    (run, instance)
}

/// The loop ran to its end, and nobody was lost but by a busy machine's silence.
fn ends_well(run: std::process::Child, bench: &Bench) {
    kill(run.id(), libc::SIGINT);
    let output = run.wait_with_output().expect("the run ends");
    assert!(output.status.success(), "{}", text(&output));
    let report = bench.report();
    assert_ne!(report["timing"]["final_state"], "SafeStop", "{report}");
    let counters = &report["timing"]["counters"];
    assert_eq!(counters["refused_foreign_commands"], 0, "{report}");
    for restart in report["restarts"].as_array().expect("a list") {
        let reason = restart["reason"].as_str().expect("a reason");
        assert!(reason.starts_with("silent"), "{report}");
    }
    assert_eq!(bench.left_behind(), Vec::<String>::new());
}

fn nothing_is_open_to_others(instance: &Instance) {
    let files = shared_memory(instance);
    assert!(!files.is_empty(), "the instance has shared memory");
    for file in files {
        // Processes may come and go meanwhile.
        let Ok(metadata) = fs::metadata(&file) else {
            continue;
        };
        let open = metadata.mode() & 0o077;
        assert_eq!((open, metadata.uid()), (0, user_id()), "{}", file.display());
    }
    let parent = instance.directory().parent().expect("a directory");
    assert_eq!(fs::metadata(parent).expect("there").mode() & 0o077, 0);
}

#[test]
fn another_user_cannot_read_write_or_attach() {
    let bench = Bench::new("intruder");
    let (run, instance) = running(&bench);
    nothing_is_open_to_others(&instance);
    if is_root("keeping another user out") {
        keep_another_user_out(&bench, &instance);
    }
    ends_well(run, &bench);
}

fn keep_another_user_out(bench: &Bench, instance: &Instance) {
    for file in shared_memory(instance) {
        for script in ["cat \"$1\"", "echo x >> \"$1\"", "rm \"$1\""] {
            let tried = shell_as_other_user(script, &file);
            assert!(
                !tried.status.success(),
                "{script} {}: {}",
                file.display(),
                text(&tried)
            );
        }
    }
    for place in [
        instance.directory().to_owned(),
        instance.lock_file(),
        instance.file("run.json"),
    ] {
        let tried = shell_as_other_user("ls \"$1\" || cat \"$1\" || echo x >> \"$1\"", &place);
        assert!(
            !tried.status.success(),
            "{}: {}",
            place.display(),
            text(&tried)
        );
    }
    for (process_id, role) in bench.processes() {
        let tried = shell_as_other_user(&format!("kill -9 {process_id}"), Path::new("-"));
        assert!(!tried.status.success(), "{role} was killed by another user");
    }
    let directory = TempDir::new().expect("a temporary directory");
    let program = std::env::current_exe().expect("this program");
    let mut attach = Command::new(for_everybody(&program, &directory));
    attach
        .args(["--exact", "access::an_intruder", "--ignored", "--nocapture"])
        .env(INSTANCE, instance.name())
        .env(OWNER, user_id().to_string());
    let tried = as_other_user(attach);
    assert!(tried.status.success(), "{}", text(&tried));
    assert!(text(&tried).contains("1 passed"), "{}", text(&tried));
}

#[test]
#[ignore = "run as another user by another_user_cannot_read_write_or_attach"]
fn an_intruder() {
    let name = std::env::var(INSTANCE).expect("told which");
    let owner = std::env::var(OWNER)
        .expect("told whose")
        .parse()
        .expect("a user");
    let instance = Instance::new(&name, owner).expect("a good name");
    assert!(instance.run_config().is_err(), "the run is not his to see");
    let joined = Bus::join(&instance);
    assert!(joined.is_err(), "the instance is not his to join");
}

#[test]
fn files_another_user_has_put_in_the_way_are_refused_by_name() {
    if !is_root("putting files in the way of another user") {
        return;
    }
    let bench = Bench::new("planted");
    let directory = TempDir::new().expect("a temporary directory");
    let program = for_everybody(Path::new(env!("CARGO_BIN_EXE_flexspline")), &directory);
    let instance = Instance::new(&bench.instance, OTHER_USER).expect("a good name");
    let planted = PathBuf::from(format!("/dev/shm/{}planted", instance.ipc_prefix()));
    fs::write(&planted, "x").expect("root may");
    let mut run = Command::new(program);
    run.current_dir("/tmp")
        .args([
            "run",
            "--duration",
            "1s",
            "--instance",
            &bench.instance,
            "--record",
        ])
        .arg(format!("/tmp/{}.mcap", bench.instance));
    let refused = as_other_user(run);
    fs::remove_file(&planted).expect("still there");
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    for part in ["planted", "belongs to user 0", "remove it"] {
        assert!(message.contains(part), "`{part}` is missing in: {message}");
    }
    let gone = eventually(|| (!instance.directory().exists()).then_some(()));
    assert!(gone.is_some(), "nothing is left of the start");
}

#[test]
fn readers_that_crowd_never_read_or_crash_change_nothing() {
    let bench = Bench::new("crowd");
    let (run, instance) = running(&bench);
    let program = std::env::current_exe().expect("this program");
    let reader = || {
        let mut command = Command::new(&program);
        command
            .args([
                "--exact",
                "access::a_reader_that_never_reads",
                "--ignored",
                "--nocapture",
            ])
            .env(INSTANCE, instance.name());
        spawn(command)
    };
    // More than the topics admit; then all of them crash at once, and so does a second crowd.
    for crowd in ["first", "second"] {
        let mut readers: Vec<_> = (0..topics::OBSERVED_SAMPLE.readers_max + 2)
            .map(|_| reader())
            .collect();
        let placed = readers.iter_mut().filter_map(found_a_place).count();
        assert!(
            placed >= topics::OBSERVED_STATUS.readers_max - 1,
            "{placed} in the {crowd} crowd"
        );
        for reader in &mut readers {
            // Those that found no place have ended already.
            let _ = reader.kill();
            reader.wait().expect("killed");
        }
    }
    let bus = Bus::join(&instance).expect("the instance is ours");
    let samples = bus
        .reader(&topics::OBSERVED_SAMPLE)
        .expect("places are free again");
    assert!(eventually(|| samples.take()).is_some(), "the relay goes on");
    drop((samples, bus));
    ends_well(run, &bench);
}

/// Waits until a reader says that it has its places, or ends without.
fn found_a_place(reader: &mut std::process::Child) -> Option<()> {
    let said = BufReader::new(reader.stdout.take().expect("piped"));
    said.lines()
        .map_while(Result::ok)
        .any(|line| line.contains(PLACED))
        .then_some(())
}

/// What a reader says that has its places.
const PLACED: &str = "has its places";

#[test]
#[ignore = "started by readers_that_crowd_never_read_or_crash_change_nothing"]
fn a_reader_that_never_reads() {
    let name = std::env::var(INSTANCE).expect("told which");
    let instance = Instance::new(&name, user_id()).expect("a good name");
    let bus = Bus::join(&instance).expect("the instance is ours");
    let _readers = (
        bus.reader(&topics::OBSERVED_SAMPLE).expect("a place"),
        bus.reader(&topics::OBSERVED_STATUS).expect("a place"),
        bus.reader(&topics::OBSERVED_ESTIMATE).expect("a place"),
    );
    println!("{PLACED}");
    std::thread::sleep(std::time::Duration::from_secs(60));
}
