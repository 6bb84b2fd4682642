//! The suite's tables for a terminal and for a page: the same Markdown.

use comfy_table::{CellAlignment, Table, presets};

use super::processes::{Ending, ProcessOutcome};
use super::virtual_time::VirtualOutcome;

fn markdown(header: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut table = Table::new();
    table
        .load_preset(presets::ASCII_MARKDOWN)
        .set_header(header.to_vec())
        .add_rows(rows);
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table.to_string()
}

fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "–".to_owned())
}

/// Faults in virtual time.
pub fn virtual_time(outcomes: &[VirtualOutcome]) -> String {
    let header = [
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
    let rows = outcomes.iter().map(
        |VirtualOutcome {
             fault,
             as_documented,
             outcome,
         }| {
            vec![
                format!(
                    "{fault}{}",
                    if *as_documented {
                        ""
                    } else {
                        " (not as documented)"
                    }
                ),
                states(&outcome.states, &outcome.end_state),
                or_dash(
                    outcome
                        .reacted_after_cycles
                        .map(|cycles| cycles.to_string()),
                ),
                or_dash(outcome.braked_after_cycles.map(|cycles| cycles.to_string())),
                format!("{:.0}", outcome.torque_max * 100.0),
                format!("{:.1}", outcome.torque_step_max * 100.0),
                format!("{:.1}", outcome.excursion_rad * 1e3),
                outcome.samples_lost.to_string(),
                outcome.commands_lost.to_string(),
                outcome.commands_refused.to_string(),
            ]
        },
    );
    markdown(&header, rows)
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
