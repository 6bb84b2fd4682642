//! The fault suite in its short form: every fault ends as documented.

mod support;

use support::{Bench, output, text};

#[test]
fn every_fault_of_the_short_suite_ends_as_documented() {
    let bench = Bench::new("suite");
    let mut command = bench.flexspline();
    command.args(["faults", "--short", "--json"]);
    command.arg(bench.file("faults.json"));
    let output = output(command);
    assert!(output.status.success(), "{}", text(&output));
    let written = std::fs::read(bench.file("faults.json")).expect("the suite wrote its results");
    let report: serde_json::Value = serde_json::from_slice(&written).expect("JSON");
    for part in ["virtual_time", "processes"] {
        assert!(
            report[part]
                .as_array()
                .is_some_and(|faults| !faults.is_empty()),
            "{part}"
        );
    }
    assert_eq!(report["kills"]["kills"], 5, "{}", text(&output));
}
