//! Draws a snapshot. Knows nothing of where it came from.

use ratatui::Frame;
use ratatui::layout::{Alignment, Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Bar, BarChart, BarGroup, Block, Cell, Paragraph, Row, Table};
use rt_loop::report::Quantiles;
use shm_types::instance::Mode;

use super::snapshot::{DriveLine, JointLine, Snapshot};

/// Rows of the table of times: a frame, a header, four times.
const TIMES_ROWS: u16 = 7;
/// Columns of the same.
const TIMES_COLUMNS: u16 = 62;
/// Rows of the table of processes: a frame, a header, five processes.
const PROCESSES_ROWS: u16 = 8;

/// Draws everything; `note` is the last line.
pub fn draw(frame: &mut Frame<'_>, snapshot: &Snapshot, note: &str) {
    let joint_rows = snapshot.joints.len() as u16 + 4;
    let [head, times, joints, processes, foot] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Length(TIMES_ROWS),
        Constraint::Length(joint_rows),
        Constraint::Length(PROCESSES_ROWS),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    let [quantiles, buckets] =
        Layout::horizontal([Constraint::Length(TIMES_COLUMNS), Constraint::Fill(1)]).areas(times);
    let [members, counters] =
        Layout::horizontal([Constraint::Length(TIMES_COLUMNS), Constraint::Fill(1)])
            .areas(processes);
    frame.render_widget(headline(snapshot), head);
    frame.render_widget(times_table(snapshot), quantiles);
    draw_buckets(frame, snapshot, buckets);
    frame.render_widget(joints_table(snapshot), joints);
    frame.render_widget(processes_table(snapshot), members);
    frame.render_widget(counters_text(snapshot), counters);
    frame.render_widget(Paragraph::new(note.to_owned()), foot);
}

/// How many rows a screen with everything on it has.
pub fn rows_wanted(snapshot: &Snapshot) -> u16 {
    1 + TIMES_ROWS + snapshot.joints.len() as u16 + 4 + PROCESSES_ROWS + 1
}

fn headline(snapshot: &Snapshot) -> Line<'static> {
    let mode = match snapshot.mode {
        Mode::Realtime => "real time",
        Mode::Lockstep => "lockstep",
    };
    let state = if snapshot.heard {
        snapshot.state.clone()
    } else {
        "nothing heard yet".to_owned()
    };
    let rate = snapshot
        .rate_hz
        .map_or("- Hz".to_owned(), |rate_hz| format!("{rate_hz:.1} Hz"));
    let fault = match &snapshot.fault {
        Some(fault) => format!("  last fault: {fault}"),
        None => String::new(),
    };
    Line::from(vec![
        Span::raw(format!(
            "{}: {}, {}, {}, {mode}  ",
            snapshot.instance, snapshot.robot, snapshot.trajectory, snapshot.driver
        )),
        Span::styled(state, state_style(&snapshot.state)),
        Span::raw(format!(
            "  {rate} of {:.0}  {:.1} s{fault}",
            snapshot.asked_rate_hz, snapshot.time_s
        )),
    ])
}

fn state_style(state: &str) -> Style {
    let colour = match state {
        "Running" => Color::Green,
        "Initialising" | "Ready" => Color::Reset,
        "Holding" | "Damping" => Color::Yellow,
        _ => Color::Red,
    };
    Style::default().fg(colour).add_modifier(Modifier::BOLD)
}

fn times_table(snapshot: &Snapshot) -> Table<'static> {
    let times = &snapshot.times;
    let rows = [
        ("late at wake-up", &times.late_at_wakeup),
        ("own compute", &times.own_compute),
        ("sample to command", &times.sample_to_command),
        ("exchange with drives", &times.exchange_with_drives),
    ]
    .map(|(name, quantiles)| quantiles_row(name, quantiles));
    let widths = [
        Constraint::Fill(1),
        Constraint::Length(8),
        Constraint::Length(8),
        Constraint::Length(8),
        Constraint::Length(8),
    ];
    Table::new(rows, widths)
        .header(header(["time, µs", "p50", "p99", "p99.9", "max"]))
        .block(Block::bordered().title(format!("{} cycles heard", times.late_at_wakeup.count)))
}

fn quantiles_row(name: &str, quantiles: &Quantiles) -> Row<'static> {
    let value = |value_us: f64| match quantiles.count {
        0 => right("-"),
        _ => right(&format!("{value_us:.1}")),
    };
    Row::new([
        Cell::from(name.to_owned()),
        value(quantiles.p50_us),
        value(quantiles.p99_us),
        value(quantiles.p999_us),
        value(quantiles.max_us),
    ])
}

fn header<const N: usize>(names: [&str; N]) -> Row<'static> {
    let mut cells: Vec<Cell<'static>> = Vec::with_capacity(N);
    for (index, name) in names.into_iter().enumerate() {
        let text = ratatui::text::Text::from(name.to_owned());
        cells.push(Cell::from(match index {
            0 => text,
            _ => text.alignment(Alignment::Right),
        }));
    }
    let height = names
        .iter()
        .map(|name| name.lines().count())
        .max()
        .unwrap_or(1);
    Row::new(cells)
        .height(height as u16)
        .style(Style::default().add_modifier(Modifier::BOLD))
}

fn right(text: &str) -> Cell<'static> {
    Cell::from(Line::from(text.to_owned()).alignment(Alignment::Right))
}

/// How late the loop woke up: one bar for each power of two, its height the logarithm of the count, because one cycle in a
/// thousand shall be seen.
fn draw_buckets(frame: &mut Frame<'_>, snapshot: &Snapshot, area: Rect) {
    let height = |count: u64| ((1.0 + count as f64).log10() * LOG_STEPS) as u64;
    let buckets = &snapshot.lateness_buckets;
    let bars: Vec<Bar<'static>> = buckets
        .iter()
        .map(|bucket| {
            Bar::default()
                .value(height(bucket.count))
                .text_value(String::new())
                .label(Line::from(bucket.up_to_us.to_string()))
        })
        .collect();
    let most = buckets.iter().map(|bucket| bucket.count).max();
    let chart = BarChart::default()
        .data(BarGroup::default().bars(&bars))
        .bar_width(4)
        .bar_gap(1)
        .max(height(most.unwrap_or(0)).max(1))
        .block(Block::bordered().title("late by up to, µs (height: logarithm of the count)"));
    frame.render_widget(chart, area);
}

/// Steps of a bar for each power of ten.
const LOG_STEPS: f64 = 100.0;

fn joints_table(snapshot: &Snapshot) -> Table<'static> {
    let rows: Vec<Row<'static>> = snapshot.joints.iter().map(joint_row).collect();
    let widths = [
        Constraint::Length(10),
        Constraint::Length(9),
        Constraint::Length(11),
        Constraint::Length(9),
        Constraint::Length(6),
        Constraint::Length(9),
        Constraint::Length(9),
        Constraint::Length(6),
        Constraint::Length(9),
        Constraint::Length(9),
        Constraint::Length(9),
        Constraint::Length(15),
        Constraint::Length(7),
    ];
    Table::new(rows, widths)
        .header(header([
            "joint",
            "position\nrad",
            "range\n",
            "velocity\nrad/s",
            "limit\n%",
            "motor\nNm",
            "sent\nNm",
            "limit\n%",
            "sensor\nNm",
            "residual\nNm",
            "damping\nNm",
            "fusion\nNm",
            "drive\n",
        ]))
        .block(
            Block::bordered()
                .title("joints (torque: motor, sent before the gear; sensor, estimates after it)"),
        )
}

fn joint_row(line: &JointLine) -> Row<'static> {
    let estimates = &line.estimates;
    let fusion = match (estimates.fusion_torque_nm, estimates.fusion_std_nm) {
        (Some(torque_nm), Some(std_nm)) => right(&format!("{torque_nm:.2} ± {std_nm:.2}")),
        (torque_nm, _) => number(torque_nm, 2),
    };
    let drive = line.drive.as_ref().map_or(String::new(), DriveLine::words);
    let drive = match (drive.is_empty(), line.limited) {
        (true, true) => "limited".to_owned(),
        _ => drive,
    };
    let row = Row::new([
        Cell::from(line.joint.clone()),
        number(line.link_position_rad, 4),
        right(&range_gauge(
            line.link_position_rad,
            line.position_limit_rad,
        )),
        number(line.link_velocity_rad_s, 4),
        share(line.link_velocity_rad_s, line.velocity_limit_rad_s),
        number(line.motor_torque_nm, 3),
        number(line.commanded_motor_torque_nm, 3),
        share(line.commanded_motor_torque_nm, line.motor_torque_limit_nm),
        number(line.joint_torque_nm, 2),
        number(estimates.residual_torque_nm, 2),
        number(estimates.structural_damping_torque_nm, 2),
        fusion,
        right(&drive),
    ]);
    match line.limited {
        true => row.style(Style::default().fg(Color::Yellow)),
        false => row,
    }
}

fn number(value: Option<f64>, digits: usize) -> Cell<'static> {
    match value {
        Some(value) => right(&format!("{value:.digits$}")),
        None => right("-"),
    }
}

fn share(value: Option<f64>, limit: Option<f64>) -> Cell<'static> {
    match (value, limit) {
        (Some(value), Some(limit)) if limit > 0.0 => {
            right(&format!("{:.0}", 100.0 * value.abs() / limit))
        }
        _ => right("-"),
    }
}

/// Where a position stands between its limits: `├───●─────┤`.
fn range_gauge(position_rad: Option<f64>, limit_rad: Option<[f64; 2]>) -> String {
    const STEPS: usize = 9;
    let (Some(position_rad), Some([min_rad, max_rad])) = (position_rad, limit_rad) else {
        return "-".to_owned();
    };
    let part = (position_rad - min_rad) / (max_rad - min_rad);
    if part < 0.0 {
        return format!("●{}┤", "─".repeat(STEPS));
    } else if part > 1.0 {
        return format!("├{}●", "─".repeat(STEPS));
    }
    let place = ((part * STEPS as f64) as usize).min(STEPS - 1);
    format!("├{}●{}┤", "─".repeat(place), "─".repeat(STEPS - 1 - place))
}

fn processes_table(snapshot: &Snapshot) -> Table<'static> {
    let rows: Vec<Row<'static>> = snapshot
        .processes
        .iter()
        .map(|process| {
            Row::new([
                Cell::from(process.role.clone()),
                right(&process.process_id.to_string()),
                right(&format!("{:.1}", process.age_s)),
                right(&process.restarts.to_string()),
                right(process.last_end.as_deref().unwrap_or("")),
            ])
        })
        .collect();
    let widths = [
        Constraint::Fill(1),
        Constraint::Length(8),
        Constraint::Length(9),
        Constraint::Length(8),
        Constraint::Length(16),
    ];
    Table::new(rows, widths)
        .header(header(["process", "id", "age, s", "restarts", "last end"]))
        .block(Block::bordered().title("processes"))
}

fn counters_text(snapshot: &Snapshot) -> Paragraph<'static> {
    let counters = &snapshot.counters;
    let lines: Vec<Line<'static>> = [
        ("missed deadlines", counters.missed_deadlines),
        ("skipped periods", counters.skipped_periods),
        ("stale commands", counters.stale_commands),
        ("refused commands", counters.refused_commands),
        ("not heard by this monitor", snapshot.lost_cycles),
    ]
    .into_iter()
    .map(|(name, count)| Line::from(format!("{count:>10} {name}")))
    .collect();
    Paragraph::new(lines).block(Block::bordered().title("counted by the loop since its start"))
}

#[cfg(test)]
#[path = "screen_tests.rs"]
mod tests;
