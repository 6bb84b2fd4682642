//! Friction over position: Table III, Fig. 5 for every joint, and its spectrum.

use std::f64::consts::{PI, TAU};

use identification::periodic::{
    DirectionAnalysis, FALSE_ALARM_PROBABILITY, Harmonic, PeriodicAnalysis,
};
use report::{
    Axis, Cell, Column, Figure, Panel, Section, Series, Table, decimal, number, with_error,
};
use robot::published::{Published, PublishedHarmonic};

use super::{DIRECTIONS, JointResult, without};

/// The spectrum is drawn so far at least: PA10-05's highest harmonic is 39 cycles per motor revolution.
const SPECTRUM_CYCLES: f64 = 45.0;

/// Cells that a harmonic fills, published ones included.
const HARMONIC_COLUMNS: usize = 7;

pub fn section(joints: &[JointResult], paper: Option<&Published>) -> Section {
    let section = Section::new("periodic", "Friction over position");
    let section = without(
        section,
        joints,
        |j| j.periodic.is_some(),
        "Friction over position",
        "periodic",
    );
    let analyses: Vec<&PeriodicAnalysis> =
        joints.iter().filter_map(|j| j.periodic.as_ref()).collect();
    if analyses.is_empty() {
        return section;
    }
    let section = section
        .paragraph(format!(
            "The torque that keeps a joint at {} rad/s, less gravity and its mean, over whole motor revolutions. A line of \
             the spectrum counts as a harmonic where noise alone would reach it anywhere with a probability of {} or less. \
             What is fed forward is the mean revolution itself, as a look-up table.",
            number(analyses[0].positive.reference_rad_s.abs(), 1),
            FALSE_ALARM_PROBABILITY
        ))
        .table(table_iii(&analyses, paper))
        .definitions([
            ("f", "Cycles per radian of the joint; N/2π = one cycle per motor revolution."),
            ("order", "The nearest whole number of cycles per revolution of the wave generator, which turns with the motor; f is the order times N/2π where the data agree with that, else as measured."),
            ("A, φ", "A·sin(order·motor angle + φ), friction that opposes the motion, both directions together."),
            ("rms before, after", "Root mean square of zero-mean friction, and of what its harmonics leave."),
        ]);
    analyses.iter().fold(section, |section, analysis| {
        section.heading(&analysis.joint).figure(figure(analysis))
    })
}

fn table_iii(analyses: &[&PeriodicAnalysis], paper: Option<&Published>) -> Table {
    let mut table = Table::new(
        "Harmonics of position-dependent friction (PA10-05, Table III)",
        [
            Column::text("joint"),
            Column::number("order"),
            Column::number("f, 1/rad"),
            Column::number("published"),
            Column::number("A, Nm"),
            Column::number("published"),
            Column::number("φ, rad"),
            Column::number("published"),
            Column::number("rms before, Nm"),
            Column::number("after, Nm"),
        ],
    );
    for analysis in analyses {
        let known = paper.and_then(|paper| paper.joint(&analysis.joint));
        let mut published: Vec<PublishedHarmonic> =
            known.map_or(Vec::new(), |joint| joint.table_iii.to_vec());
        let rms = |pick: fn(&DirectionAnalysis) -> f64| {
            let squares = pick(&analysis.positive).powi(2) + pick(&analysis.negative).powi(2);
            Cell::from(number((0.5 * squares).sqrt(), 3))
        };
        let mut rows: Vec<[Cell; HARMONIC_COLUMNS]> = Vec::new();
        for harmonic in &analysis.combined {
            let partner = published
                .iter()
                .position(|row| is_same(row, harmonic, analysis.gear_ratio));
            rows.push(harmonic_row(
                harmonic,
                partner.map(|place| published.remove(place)),
            ));
        }
        rows.extend(published.into_iter().map(|row| missed_row(&row)));
        if rows.is_empty() {
            let mut none: [Cell; HARMONIC_COLUMNS] = Default::default();
            none[0] = "none".into();
            rows.push(none);
        }
        for (index, row) in rows.into_iter().enumerate() {
            let first = index == 0;
            let mut cells: Vec<Cell> =
                vec![if first { analysis.joint.as_str() } else { "" }.into()];
            cells.extend(row);
            if first {
                cells.extend([rms(|a| a.rms_nm), rms(|a| a.residual_rms_nm)]);
            }
            table.row(cells);
        }
    }
    if paper.is_some() {
        table.note("Published phases are brought into −π to π. A published harmonic without one of ours was not found above the noise.");
    }
    table
}

/// Whether both are the same cycle per motor revolution.
fn is_same(row: &PublishedHarmonic, harmonic: &Harmonic, gear_ratio: f64) -> bool {
    let published = row.cycles_per_joint_rad * TAU / gear_ratio;
    (published - harmonic.cycles_per_motor_rev).abs() < 0.5
}

fn harmonic_row(
    harmonic: &Harmonic,
    published: Option<PublishedHarmonic>,
) -> [Cell; HARMONIC_COLUMNS] {
    let [f, a, phi] = published_cells(published);
    [
        harmonic.order.to_string().into(),
        decimal(harmonic.cycles_per_joint_rad, 2).into(),
        f,
        with_error(harmonic.amplitude_nm, harmonic.amplitude_standard_error_nm).into(),
        a,
        decimal(harmonic.phase_rad, 2).into(),
        phi,
    ]
}

fn missed_row(row: &PublishedHarmonic) -> [Cell; HARMONIC_COLUMNS] {
    let [f, a, phi] = published_cells(Some(*row));
    [
        "".into(),
        "-".into(),
        f,
        "not found".into(),
        a,
        "-".into(),
        phi,
    ]
}

fn published_cells(row: Option<PublishedHarmonic>) -> [Cell; 3] {
    let cell = |pick: fn(PublishedHarmonic) -> f64| {
        Cell::published(row.map_or(String::new(), |row| decimal(pick(row), 2)))
    };
    [
        cell(|row| row.cycles_per_joint_rad),
        cell(|row| row.amplitude_nm),
        cell(|row| (row.phase_rad + PI).rem_euclid(TAU) - PI),
    ]
}

fn figure(analysis: &PeriodicAnalysis) -> Figure {
    let directions = [&analysis.positive, &analysis.negative];
    let figure = Figure::new(format!(
        "Position-dependent friction of {} (PA10-05, Fig. 5; PA10-03, section 4.1). Above: mean of {} and {} motor \
         revolutions and the harmonics found in that direction. Below: amplitude spectrum, what a line must exceed to \
         count, and the orders of the wave generator that were found.",
        analysis.joint, analysis.positive.revolutions, analysis.negative.revolutions
    ))
    .columns(2)
    .panel_height(280);
    let figure = directions
        .iter()
        .zip(DIRECTIONS)
        .fold(figure, |figure, (direction, title)| {
            figure.panel(revolution(direction, analysis.gear_ratio).title(title))
        });
    directions.iter().fold(figure, |figure, direction| {
        figure.panel(spectrum(direction))
    })
}

fn revolution(direction: &DirectionAnalysis, gear_ratio: f64) -> Panel {
    let count = direction.mean_revolution_nm.len() as f64;
    let motor_rad = |place: usize| TAU * place as f64 / count;
    let fitted = |angle_rad: f64| -> f64 {
        let harmonics = direction.harmonics.iter();
        harmonics
            .map(|h| h.amplitude_nm * (h.cycles_per_motor_rev * angle_rad + h.phase_rad).sin())
            .sum()
    };
    let measured = direction.mean_revolution_nm.iter().enumerate();
    let measured = measured.map(|(place, nm)| [motor_rad(place) / gear_ratio, *nm]);
    let fit = (0..direction.mean_revolution_nm.len()).map(|place| {
        let angle_rad = motor_rad(place);
        [angle_rad / gear_ratio, fitted(angle_rad)]
    });
    Panel::new(
        Axis::new("joint angle within one motor revolution", "rad"),
        Axis::new("friction, zero mean", "Nm"),
    )
    .series(Series::line("measured", measured))
    .series(Series::dashed("harmonics", fit))
}

fn spectrum(direction: &DirectionAnalysis) -> Panel {
    let harmonics = direction.harmonics.iter();
    let highest = harmonics.fold(0.0_f64, |highest, h| highest.max(h.cycles_per_motor_rev));
    let lines = || direction.spectrum.iter();
    let panel = Panel::new(
        Axis::new("cycles per motor revolution", "").range(0.0, SPECTRUM_CYCLES.max(1.2 * highest)),
        Axis::new("amplitude", "Nm").log(),
    )
    .series(Series::line(
        "spectrum",
        lines().map(|l| [l.cycles_per_motor_rev, l.amplitude_nm]),
    ))
    .series(Series::line(
        "threshold",
        lines().map(|l| [l.cycles_per_motor_rev, l.threshold_nm]),
    ));
    let mut orders: Vec<u32> = direction
        .harmonics
        .iter()
        .map(|harmonic| harmonic.order)
        .collect();
    orders.sort_unstable();
    orders.dedup();
    orders.into_iter().fold(panel, |panel, order| {
        panel.vertical(f64::from(order), order.to_string())
    })
}
