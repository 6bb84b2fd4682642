//! The suite's tables for a terminal and for a page: the same Markdown.

use comfy_table::{CellAlignment, Table, presets};

use super::processes::{Ending, ProcessOutcome};
use super::virtual_time::{OnDrives, SetUpOutcome, VirtualOutcome};

fn plain(header: &[&str], rows: impl Iterator<Item = Vec<String>>) -> Table {
    let mut table = Table::new();
    table
        .load_preset(presets::ASCII_MARKDOWN)
        .set_header(header.to_vec())
        .add_rows(rows);
    table
}

/// A table of words.
fn left(header: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    plain(header, rows).to_string()
}

/// A table of figures behind two columns of words.
fn markdown(header: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut table = plain(header, rows);
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.to_string()
}

fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "–".to_owned())
}

/// Faults in virtual time: on the emulator in full, on the buses beside it, those of the buses themselves, and cables pulled.
pub fn virtual_time(drives: &[OnDrives]) -> Vec<String> {
    let in_full = drives.first().map(|emulator| {
        let rows = emulator.around_the_loop.iter().map(full_row);
        markdown(&FULL, rows)
    });
    let buses = || drives.iter().filter(|on| on.pulls.is_some());
    let beside = || {
        let with_all = buses().filter(|on| !on.around_the_loop.is_empty());
        let header: Vec<&str> = ["fault"]
            .into_iter()
            .chain(with_all.clone().map(|on| on.drives))
            .collect();
        let outcomes: Vec<_> = with_all.map(|on| on.around_the_loop.iter()).collect();
        let count = outcomes.first().map_or(0, ExactSizeIterator::len);
        let rows = (0..count).map(|row| {
            let mut cells = Vec::new();
            for of_bus in &outcomes {
                if let Some(outcome) = of_bus.clone().nth(row) {
                    if cells.is_empty() {
                        cells.push(outcome.fault.to_owned());
                    }
                    cells.push(told_states(outcome));
                }
            }
            cells
        });
        (count > 0).then(|| left(&header, rows))
    };
    let of_buses = buses().map(|on| {
        let header = [
            "fault",
            "states, cycles",
            "why it left `Running` last",
            "leaves `Running` after, cycles",
            "brakes after, cycles",
            "torque unasked, cycles",
            "furthest from reference, mrad",
            "samples lost",
        ];
        format!(
            "{}\n{}",
            on.drives,
            markdown(&header, on.of_the_bus.iter().map(bus_row))
        )
    });
    let at_set_up = || {
        let rows = buses().flat_map(|on| on.at_set_up.iter().map(|of| set_up_row(on.drives, of)));
        left(&["drives", "broken at set-up", "what is told"], rows)
    };
    let pulled = || {
        let header = [
            "cables pulled",
            "pulls",
            "went on by itself",
            "ran after a reset",
            "joint broken",
            "never ran again",
            "longest until it ran by itself, cycles",
            "torque unasked, cycles",
        ];
        markdown(&header, buses().filter_map(pulls_row))
    };
    in_full
        .into_iter()
        .chain(beside())
        .chain(of_buses)
        .chain([at_set_up(), pulled()])
        .collect()
}

/// Columns of a fault in full.
const FULL: [&str; 10] = [
    "fault",
    "states, cycles",
    "leaves `Running` after, cycles",
    "brakes after, cycles",
    "largest torque, % of limit",
    "largest step, % of limit",
    "furthest from reference, mrad",
    "samples lost",
    "commands lost",
    "commands refused",
];

fn full_row(of: &VirtualOutcome) -> Vec<String> {
    let outcome = &of.outcome;
    vec![
        of.fault.to_owned(),
        told_states(of),
        cycles(outcome.reacted_after_cycles),
        cycles(outcome.braked_after_cycles),
        format!("{:.0}", outcome.torque_max * 100.0),
        format!("{:.1}", outcome.torque_step_max * 100.0),
        format!("{:.1}", outcome.excursion_rad * 1e3),
        outcome.samples_lost.to_string(),
        outcome.commands_lost.to_string(),
        outcome.commands_refused.to_string(),
    ]
}

fn bus_row(of: &VirtualOutcome) -> Vec<String> {
    let outcome = &of.outcome;
    vec![
        of.fault.to_owned(),
        told_states(of),
        or_dash(outcome.fault.clone()),
        cycles(outcome.reacted_after_cycles),
        cycles(outcome.braked_after_cycles),
        outcome.unasked_torque_cycles.to_string(),
        format!("{:.1}", outcome.excursion_rad * 1e3),
        outcome.samples_lost.to_string(),
    ]
}

fn set_up_row(drives: &str, of: &SetUpOutcome) -> Vec<String> {
    let told = of.outcome.refused.clone();
    let told = told.map_or_else(
        || "nothing: they are opened".to_owned(),
        |line| format!("`{line}`"),
    );
    let told = match of.as_documented {
        true => told,
        false => format!("{told} (not as documented)"),
    };
    vec![drives.to_owned(), of.fault.to_owned(), told]
}

fn pulls_row(on: &OnDrives) -> Option<Vec<String>> {
    let pulls = on.pulls.as_ref()?;
    let counts = [
        pulls.pulls,
        pulls.went_on,
        pulls.reset,
        pulls.faulted,
        pulls.never,
        pulls.longest_cycles,
        pulls.unasked_torque_cycles,
    ];
    let name = [on.drives.to_owned()].into_iter();
    Some(name.chain(counts.iter().map(u64::to_string)).collect())
}

fn cycles(cycles: Option<u64>) -> String {
    or_dash(cycles.map(|cycles| cycles.to_string()))
}

fn told_states(of: &VirtualOutcome) -> String {
    let states = states(&of.outcome.states, &of.outcome.end_state);
    if of.as_documented {
        states
    } else {
        format!("{states} (not as documented)")
    }
}

/// A run of states, cut where they only alternate.
fn states(states: &[(String, u64)], end_state: &str) -> String {
    const SHOWN: usize = 4;
    if states.is_empty() {
        return end_state.to_owned();
    }
    let mut shown: Vec<String> = states
        .iter()
        .take(SHOWN)
        .enumerate()
        .map(|(index, (state, cycles))| match index + 1 == states.len() {
            true => state.clone(),
            false => format!("{state} {cycles}"),
        })
        .collect();
    if states.len() > SHOWN {
        shown.push("…".to_owned());
        shown.push(end_state.to_owned());
    }
    shown.join(", ")
}

/// Faults of processes.
pub fn processes(outcomes: &[ProcessOutcome]) -> String {
    let header = [
        "fault",
        "what the run did",
        "longest time without a command, cycles",
        "back after, ms",
        "tool off its path, mm",
        "rows lost",
    ];
    let rows = outcomes.iter().map(|outcome| {
        vec![
            outcome.fault.to_owned(),
            what_it_did(outcome),
            or_dash(outcome.command_gap_cycles.map(|cycles| cycles.to_string())),
            or_dash(outcome.back_after_ms.map(|ms| format!("{ms:.0}"))),
            or_dash(outcome.tool_off_path_mm.map(|mm| format!("{mm:.1}"))),
            or_dash(outcome.lost_rows.map(|rows| rows.to_string())),
        ]
    });
    markdown(&header, rows)
}

fn what_it_did(outcome: &ProcessOutcome) -> String {
    if let Some(obstacle) = &outcome.skipped {
        return format!("skipped: {obstacle}");
    }
    let did = match outcome.documented {
        Ending::GoesOn => "goes on",
        Ending::GoesOnUnrecorded => "goes on, says that the recording is not complete",
        Ending::SafeStop => "the loop stops for safety, exit code 1",
        Ending::Lost => "ends with exit code 1 and one line",
        Ending::Refused => "does not start; one line",
        Ending::Gone => "everything ends, nothing is left",
    };
    if outcome.as_documented {
        return did.to_owned();
    }
    let state = outcome.end_state.as_deref().unwrap_or("no report");
    let code = or_dash(outcome.exit_code.map(|code| code.to_string()));
    let left = outcome.left_behind.len();
    format!(
        "NOT: {did}; {state}, exit code {code}, {left} left: {}",
        outcome.said
    )
}
