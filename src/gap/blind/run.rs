//! `flexspline gap blind run`: predictions for sealed cases, from robot file and recording alone.

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use gap_diagnosis::baseline::{Baseline, baseline};
use gap_diagnosis::{DiagnoseError, Engine, Options};
use gap_report::Report;
use serde::Serialize;

use super::make::progress_bar;
use super::score::{FAILURE, Failure, REPORT};
use crate::cli::{BaselineMethod, BlindRunArguments};
use crate::error::CliError;
use crate::output::{cannot_write, print, write_json};

/// For programs.
#[derive(Debug, Default, Serialize)]
struct Done {
    schema: u32,
    cases: usize,
    /// Predicted by an earlier call.
    already_there: usize,
    predicted: usize,
    failed: usize,
}

/// Predicts every case that has no prediction yet. A case that fails is written down and the next one taken.
///
/// # Errors
/// [`CliError::Input`] if the cases cannot be listed or a prediction cannot be written.
pub fn run(arguments: &BlindRunArguments) -> Result<(), CliError> {
    let names = blind::cases(&arguments.cases).map_err(CliError::input)?;
    let bar = progress_bar(names.len());
    let mut done = Done {
        schema: 1,
        cases: names.len(),
        ..Done::default()
    };
    for name in &names {
        let out = arguments.out.join(name);
        if out.join(REPORT).is_file() || out.join(FAILURE).is_file() {
            done.already_there += 1;
        } else {
            fs::create_dir_all(&out).map_err(|error| cannot_write(&out, &error))?;
            let options = Options {
                engine: arguments.engine.map(Engine::from),
                ..Options::default()
            };
            match predict(&arguments.cases.join(name), arguments.baseline, &options) {
                Ok(report) => {
                    write_json(&report, &out.join(REPORT))?;
                    done.predicted += 1;
                }
                Err(reason) => {
                    write_json(&Failure { reason }, &out.join(FAILURE))?;
                    done.failed += 1;
                }
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    if let Some(path) = &arguments.json {
        write_json(&done, path)?;
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    print(&format!(
        "{} cases: {} predicted now, {} before, {} failed; in {}\n",
        done.cases,
        done.predicted,
        done.already_there,
        done.failed,
        arguments.out.display()
    ))
}

/// The report on one case, or in one line why there is none.
fn predict(
    case: &Path,
    method: Option<BaselineMethod>,
    options: &Options,
) -> Result<Report, String> {
    let [robot_path, recording_path] = blind::CASE_FILES.map(|name| case.join(name));
    let robot =
        robot::load(&robot_path.display().to_string()).map_err(|error| error.to_string())?;
    let recording = recording::read(&recording_path).map_err(|error| error.to_string())?;
    let name = blind::CASE_FILES[1].to_owned();
    let recordings = [(name, recording)];
    let diagnosed = catch_unwind(AssertUnwindSafe(|| {
        let method = match method {
            None => {
                let diagnosis = gap_diagnosis::diagnose(&robot, &recordings, options, &|_| {})?;
                return Ok(diagnosis.report);
            }
            Some(BaselineMethod::LargestR2) => Baseline::LargestR2,
            Some(BaselineMethod::Bic) => Baseline::Bic,
        };
        baseline(&robot, &recordings, method)
    }));
    match diagnosed {
        Ok(report) => report.map_err(|error: DiagnoseError| error.to_string()),
        Err(_) => Err("the diagnosis panicked".to_owned()),
    }
}
