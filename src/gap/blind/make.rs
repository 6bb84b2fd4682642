//! `flexspline gap blind make`: cases whose cause is known and put away.

use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use blind::{BlindError, CaseKind, CasePlan, Label, Order, RigKind};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::cli::BlindMakeArguments;
use crate::error::CliError;
use crate::output::{cannot_write, print, write_json};

/// For programs; tells nothing that is sealed.
#[derive(Serialize)]
struct Made<'a> {
    schema: u32,
    folder: &'a Path,
    cases: usize,
    one_joint: usize,
    seven_joints: usize,
    seal: &'static str,
    labels: &'static str,
}

/// Makes the cases and seals their labels.
///
/// # Errors
/// [`CliError::Input`] if the folder is in use or cannot be written.
pub fn make(arguments: &BlindMakeArguments) -> Result<(), CliError> {
    check_folder(&arguments.out)?;
    let plans = blind::plan(&Order {
        cases: arguments.cases as usize,
        seed: arguments.seed,
        seven_joint_share: arguments.seven_joints,
        kind: arguments.kind.map(CaseKind::from),
        duration_s: arguments.duration.as_secs_f64(),
    });
    let labels = make_all(&plans, &arguments.out, arguments.jobs)?;
    blind::seal(&arguments.out, arguments.seed, &labels).map_err(CliError::input)?;
    let count = |rig| plans.iter().filter(|plan| plan.rig == rig).count();
    let made = Made {
        schema: 1,
        folder: &arguments.out,
        cases: plans.len(),
        one_joint: count(RigKind::OneJoint),
        seven_joints: count(RigKind::SevenJoints),
        seal: blind::SEAL,
        labels: blind::SEALED,
    };
    if let Some(path) = &arguments.json {
        write_json(&made, path)?;
    }
    if arguments.json.as_deref() != Some(Path::new("-")) {
        print(&format!(
            "{} cases in {}: {} with one joint, {} with seven; digests in {}, labels in {}\n",
            made.cases,
            made.folder.display(),
            made.one_joint,
            made.seven_joints,
            made.seal,
            made.labels
        ))?;
    }
    Ok(())
}

/// Cases of two orders in one folder would share names.
fn check_folder(folder: &Path) -> Result<(), CliError> {
    fs::create_dir_all(folder).map_err(|error| cannot_write(folder, &error))?;
    let mut entries = fs::read_dir(folder).map_err(|error| cannot_write(folder, &error))?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(CliError::Input(format!(
            "--out {}: is not empty; give a new folder",
            folder.display()
        ))),
    }
}

/// As many at a time as asked for; the same cases whatever that is.
fn make_all(plans: &[CasePlan], folder: &Path, jobs: Option<u16>) -> Result<Vec<Label>, CliError> {
    let bar = progress_bar(plans.len());
    let next = AtomicUsize::new(0);
    let made: Mutex<Vec<(usize, Result<Label, BlindError>)>> = Mutex::new(Vec::new());
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let workers = jobs.map_or(cores, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers.min(plans.len()) {
            scope.spawn(|| {
                while let Some(plan) = plans.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let label = blind::make_case(plan, folder);
                    if label.is_err() {
                        next.store(plans.len(), Ordering::Relaxed);
                    }
                    bar.inc(1);
                    if let Ok(mut made) = made.lock() {
                        made.push((plan.number, label));
                    }
                }
            });
        }
    });
    bar.finish_and_clear();
    let mut made = made
        .into_inner()
        .map_err(|_| CliError::Negative("a case panicked".to_owned()))?;
    made.sort_by_key(|(number, _)| *number);
    made.into_iter()
        .map(|(_, label)| label.map_err(CliError::input))
        .collect()
}

/// In cases.
pub fn progress_bar(cases: usize) -> ProgressBar {
    let bar = ProgressBar::new(cases as u64);
    let template = "{bar:32} {pos} of {len} cases, {eta} left";
    bar.set_style(
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar
}
