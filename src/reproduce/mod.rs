//! `flexspline reproduce`: a paper's experiments on the emulated PA-10, published numbers beside ours.

mod bench;
mod controllers;
mod courses;
mod drives;
mod experiments;
mod gain_search;
mod page;
mod region;
mod results;
mod shares;
mod sheet;
mod structural_damping;
mod tables;
mod targets;

use std::fs;
use std::path::{Path, PathBuf};

use robot::Robot;

use crate::cli::{
    IdentifyArguments, IdentifyWhat, ModeArgument, Paper, ReproduceArguments, SpeedsArgument,
};
use crate::error::CliError;
use crate::identify::{ROBOT_FILE, identify};
use crate::output::{cannot_write, print, write_json, write_text};
use bench::Bench;
use experiments::Stage;
use results::Reproduction;

/// The robot of both papers.
const ROBOT: &str = "pa10";

/// Identifies, runs the experiments, judges, prints and writes.
///
/// # Errors
/// [`CliError::Input`] for bad input, [`CliError::Negative`] if it was stopped; what was recorded stays.
pub fn reproduce(arguments: &ReproduceArguments) -> Result<(), CliError> {
    let paper = arguments.paper;
    let speeds = match paper {
        Paper::StructuralDamping => return structural_damping::reproduce(arguments),
        Paper::Pa10Of2005 => SpeedsArgument::Pa10_2005,
        Paper::Pa10Of2003 => SpeedsArgument::Pa10_2003,
    };
    let out = match &arguments.out {
        Some(out) => out.clone(),
        None => Path::new("reproduce").join(paper.name()),
    };
    let plant = robot::load(ROBOT).map_err(CliError::input)?;
    let published = robot::published(paper.name()).map_err(CliError::input)?;
    let elbow = robot::published(Paper::Pa10Of2003.name()).map_err(CliError::input)?;
    let experiments = experiments::of_paper(speeds, &published, &plant)?;
    fs::create_dir_all(&out).map_err(|error| cannot_write(&out, &error))?;
    let mut arms = Vec::new();
    for seed in arguments.seed..arguments.seed.saturating_add(arguments.arms) {
        let (identified, file) = identified(arguments, speeds, &out, seed, &plant)?;
        let bench = Bench::new(arguments.drives.kind())?;
        let stage = Stage {
            bench: &bench,
            plant: &plant,
            seed,
        };
        let arm = stage.run_all(&experiments, &identified, file);
        bench.finish();
        arms.push(arm?);
    }
    let targets = targets::judge(&arms, &published, &elbow);
    let reproduction = Reproduction {
        schema: 1,
        paper: paper.name().to_owned(),
        robot: ROBOT.to_owned(),
        arms,
        targets,
    };
    write_json(&reproduction, &out.join("reproduce.json"))?;
    let html = page::page(&reproduction, &published, &elbow, &plant).to_html();
    let page_path = out.join("report.html");
    write_text(&page_path, &html)?;
    if let Some(path) = &arguments.json {
        write_json(&reproduction, path)?;
    }
    if arguments.json.as_deref() == Some(Path::new("-")) {
        return Ok(());
    }
    for (_, sheets) in tables::all(&reproduction, &published, &elbow) {
        for sheet in sheets {
            print(&format!("{}\n", sheet.text()))?;
        }
    }
    print(&format!("report: {}\n", page_path.display()))
}

/// The model of the arm with this seed, and where it stands: as given, or identified in the folder now.
fn identified(
    arguments: &ReproduceArguments,
    speeds: SpeedsArgument,
    out: &Path,
    seed: u64,
    plant: &Robot,
) -> Result<(Robot, PathBuf), CliError> {
    let file = match &arguments.identified {
        Some(file) => PathBuf::from(file),
        None => {
            let folder = out.join("identify").join(format!("seed{seed}"));
            identify(&IdentifyArguments {
                what: IdentifyWhat::All,
                robot: ROBOT.to_owned(),
                out: folder.clone(),
                joint: match speeds {
                    SpeedsArgument::Pa10_2005 => Vec::new(),
                    SpeedsArgument::Pa10_2003 => vec!["joint4".to_owned()],
                },
                speeds,
                plan: false,
                mode: ModeArgument::Lockstep,
                driver: "emulator".to_owned(),
                instance: "default".to_owned(),
                json: None,
                seed,
                quiet: true,
            })?;
            folder.join(ROBOT_FILE)
        }
    };
    let identified = robot::load(&file.display().to_string()).map_err(CliError::input)?;
    if identified.joint_names() != plant.joint_names() || identified.control.is_none() {
        return Err(CliError::Input(format!(
            "--identified {}: its joints or its control are not those of `{ROBOT}`; give a file that identify wrote for it",
            file.display()
        )));
    }
    Ok((identified, file))
}
