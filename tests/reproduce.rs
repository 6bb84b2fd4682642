//! `flexspline reproduce`: what it refuses. Its experiments are tested beside the code, at a length that tests can pay.

mod support;

use std::fs;

use support::{Bench, output, text};

#[test]
fn bad_input_is_one_line_and_exit_code_two() {
    let bench = Bench::new("reproduce");
    fs::write(bench.file("occupied"), "").expect("written");
    fs::write(bench.file("broken.toml"), "name = ").expect("written");
    for (arguments, told) in [
        (vec!["pa10-2004"], "pa10-2005"),
        (
            vec!["pa10-2005", "--identified", "missing.toml"],
            "missing.toml",
        ),
        (
            vec!["pa10-2005", "--identified", "broken.toml"],
            "broken.toml",
        ),
        (vec!["pa10-2003", "--identified", "shd17"], "shd17"),
        (
            vec!["pa10-2003", "--identified", "pa10", "--arms", "2"],
            "--arms",
        ),
        (vec!["pa10-2003", "--arms", "0"], "--arms"),
        (vec!["pa10-2003", "--out", "occupied"], "occupied"),
    ] {
        let mut command = bench.flexspline();
        command.arg("reproduce").args(&arguments);
        let refused = output(command);
        assert_eq!(refused.status.code(), Some(2), "{}", text(&refused));
        let message = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(
            message.contains(told) && message.trim_end().lines().count() == 1,
            "{message}"
        );
    }
}
