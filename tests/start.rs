//! `docs/start.md`: each section runs from an empty folder exactly as it is printed, and says what is printed but for the
//! numbers.
#![allow(clippy::unwrap_used, reason = "a test may")]

use std::path::Path;
use std::process::Command;

/// Runs a section's shell blocks in one shell, and returns what it says.
fn run(section: &str, folder: &Path) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_flexspline"))
        .parent()
        .unwrap();
    let path = std::env::var("PATH").unwrap_or_default();
    let python = python();
    let output = Command::new("sh")
        .args(["-e", "-c", &blocks(section, "sh").concat()])
        .current_dir(folder)
        .env("PATH", format!("{}:{python}:{path}", program.display()))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    let failed = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}{failed}");
    said
}

/// The folder of the interpreter that `FLEXSPLINE_PYTHON` names, whose `python3` then has the packages.
fn python() -> String {
    let interpreter = std::env::var("FLEXSPLINE_PYTHON").unwrap_or_default();
    let folder = Path::new(&interpreter).parent();
    folder.map_or(String::new(), |folder| folder.display().to_string())
}

fn blocks<'t>(section: &'t str, kind: &str) -> Vec<&'t str> {
    let fence = format!("```{kind}\n");
    let parts = section.split(&fence).skip(1);
    parts
        .map(|part| part.split("```").next().unwrap())
        .collect()
}

/// Lines may be broken in print, and numbers are a machine's own.
fn words(text: &str) -> String {
    let number = |word: &str| {
        let bare = word.trim_matches(['(', ')', '%']).replace('−', "-");
        if bare.parse::<f64>().is_ok() {
            "#".to_owned()
        } else {
            word.to_owned()
        }
    };
    let words: Vec<String> = text.split_whitespace().map(number).collect();
    words.join(" ")
}

#[test]
fn every_section_runs_as_printed_from_an_empty_folder() {
    let python = python();
    let has_packages = Command::new("python3")
        .args(["-c", "import numpy, pyarrow, rosbags"])
        .env(
            "PATH",
            format!("{python}:{}", std::env::var("PATH").unwrap_or_default()),
        )
        .output();
    if !has_packages.is_ok_and(|output| output.status.success()) {
        println!(
            "skipped: python3 lacks numpy, pyarrow or rosbags; name one that has them in FLEXSPLINE_PYTHON"
        );
        return;
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/start.md")).unwrap();
    let sections: Vec<&str> = page.split("\n## ").skip(1).collect();
    assert_eq!(sections.len(), 3);
    for section in sections {
        let folder = tempfile::tempdir().unwrap();
        let said = words(&run(section, folder.path()));
        for printed in blocks(section, "text") {
            assert!(said.contains(&words(printed)), "{}\n{said}", words(printed));
        }
    }
}
