//! Torque over gravity load: Table V, Figs. 7(a) and 7(b) for every joint that gravity loads.

use identification::experiment::PAYLOADS_KG;
use identification::stiffness::{DirectionFit, LoadTorqueFit, StiffnessFit, SweepSteps};
use joint_model::friction::LoadTorqueRow;
use report::{
    Axis, Cell, Column, Figure, Panel, Section, Series, Table, number, printed, with_error,
};
use robot::published::Published;

use super::{DIRECTIONS, JointResult, SIGNS, without};

/// Points of a drawn law.
const LAW_POINTS: u32 = 300;

pub fn section(joints: &[JointResult], paper: Option<&Published>) -> Section {
    let section = Section::new("load", "Torque over gravity load");
    let section = without(
        section,
        joints,
        |j| j.stiffness.is_some(),
        "Torque over gravity load",
        "stiffness",
    );
    let fits: Vec<&StiffnessFit> = joints.iter().filter_map(|j| j.stiffness.as_ref()).collect();
    if fits.is_empty() {
        return section;
    }
    let section = section
        .paragraph(
            "A joint sweeps slowly through its range, bare and with payloads. From motor torque times gear ratio \
             the friction and the gravity torque are subtracted one by one; what is left is T_c, the torque that deforms \
             the gear, eq (5). Over gravity torque it is fitted by one to three straight pieces, as many as the data support.",
        )
        .table(table_v(&fits, paper))
        .definitions([
            ("T_g", "Gravity torque of arm and payload about the joint's axis."),
            ("T_c", "What remains, along the direction of motion: positive hinders the motion, negative helps."),
            ("slopes, knees", "Slopes of T_c over T_g from the lowest T_g upwards, and the T_g at which they change."),
            ("residual rms", "Root mean square of T_c less the law, over all payloads."),
        ]);
    fits.iter().fold(section, |section, fit| {
        with_unmoved(section.heading(&fit.joint), fit)
            .figure(steps_figure(fit))
            .figure(law_figure(fit, paper))
    })
}

/// Names the payloads of the experiment whose sweeps hold no steady motion in either direction.
pub fn with_unmoved(section: Section, fit: &StiffnessFit) -> Section {
    let moved_kg = payloads_kg(fit);
    let unmoved = PAYLOADS_KG.iter().filter(|kg| !moved_kg.contains(kg));
    let unmoved: Vec<String> = unmoved.map(|kg| format!("{} kg", printed(*kg))).collect();
    if unmoved.is_empty() {
        return section;
    }
    section.paragraph(format!(
        "With {} the joint did not move steadily, so these sweeps are in no fit and no figure.",
        unmoved.join(" and ")
    ))
}

/// Payloads with steady motion in either direction, rising.
fn payloads_kg(fit: &StiffnessFit) -> Vec<f64> {
    let steps = directions(fit)
        .into_iter()
        .flat_map(|direction| &direction.steps);
    let mut all: Vec<f64> = steps.map(|steps| steps.payload_kg).collect();
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

fn table_v(fits: &[&StiffnessFit], paper: Option<&Published>) -> Table {
    let mut table = Table::new(
        "T_c over gravity torque ± standard error (PA10-05, Table V)",
        [
            Column::text("joint"),
            Column::text(""),
            Column::number("slope 1, Nm/Nm"),
            Column::number("T1, Nm"),
            Column::number("slope 2, Nm/Nm"),
            Column::number("T2, Nm"),
            Column::number("slope 3, Nm/Nm"),
            Column::number("at T_g = 0, Nm"),
            Column::number("residual rms, Nm"),
        ],
    );
    for fit in fits {
        let published = published_rows(paper, &fit.joint);
        for (index, direction) in directions(fit).into_iter().enumerate() {
            let joint = if index == 0 { fit.joint.as_str() } else { "" };
            let mut row: Vec<Cell> = vec![joint.into(), SIGNS[index].into()];
            row.extend(law_cells(&direction.law));
            table.row(row);
            if let Some(rows) = published {
                table.row(published_cells(&rows[index]));
            }
        }
    }
    table.note("* at the edge of the data, or as near to the other knee as it may be: a finding, not a value. ° T_g = 0 lies outside the data.");
    table
}

fn law_cells(law: &LoadTorqueFit) -> Vec<Cell> {
    let slope = |region: usize| {
        let text = law
            .slopes
            .get(region)
            .map(|slope| with_error(slope.value, slope.standard_error));
        Cell::from(text.unwrap_or_else(|| "-".to_owned()))
    };
    let knee = |place: usize| {
        let text = law.knees.get(place).map(|knee| {
            let bound = if knee.at_bound { " *" } else { "" };
            with_error(knee.gravity_nm.value, knee.gravity_nm.standard_error) + bound
        });
        Cell::from(text.unwrap_or_else(|| "-".to_owned()))
    };
    let outside = if law.zero_load_extrapolated {
        " °"
    } else {
        ""
    };
    let zero_load = with_error(law.zero_load_nm.value, law.zero_load_nm.standard_error) + outside;
    vec![
        slope(0),
        knee(0),
        slope(1),
        knee(1),
        slope(2),
        zero_load.into(),
        number(law.residual_rms_nm, 3).into(),
    ]
}

fn published_cells(row: &LoadTorqueRow) -> Vec<Cell> {
    let value = |value: f64| Cell::published(printed(value));
    let ([a, b, c], [low, high]) = (row.slopes, row.knees_nm);
    let mut cells: Vec<Cell> = vec!["".into(), Cell::published("published")];
    cells.extend([a, low, b, high, c, row.zero_load_nm].map(value));
    cells
}

fn published_rows(paper: Option<&Published>, joint: &str) -> Option<[LoadTorqueRow; 2]> {
    let table = paper?.joint(joint)?.table_v?;
    Some([table.positive, table.negative].map(|row| LoadTorqueRow {
        slopes: row.slopes,
        knees_nm: row.knees_nm,
        zero_load_nm: row.zero_load_nm,
    }))
}

pub fn directions(fit: &StiffnessFit) -> [&DirectionFit; 2] {
    [&fit.positive, &fit.negative]
}

/// One row of panels for each payload, one column for each direction.
fn steps_figure(fit: &StiffnessFit) -> Figure {
    let figure = Figure::new(format!(
        "Successive subtraction for {} (PA10-05, Fig. 7(a); PA10-03, Fig. 6): motor torque times gear ratio, the same less position-dependent \
         friction, less friction over velocity too, gravity torque, and what remains of the torque without friction \
         after gravity is subtracted. All about the joint's axis.",
        fit.joint
    ))
    .columns(2)
    .panel_height(270);
    payloads_kg(fit)
        .into_iter()
        .fold(figure, |figure, payload_kg| {
            let both = directions(fit).into_iter().zip(DIRECTIONS);
            both.fold(figure, |figure, (direction, name)| {
                let mut all = direction.steps.iter();
                let steps = all.find(|steps| steps.payload_kg == payload_kg);
                let title = format!("{} kg, {name}", printed(payload_kg));
                figure.panel(match steps {
                    Some(steps) => steps_panel(steps).title(title),
                    None => torque_panel().title(format!("{title}: no steady motion")),
                })
            })
        })
}

fn torque_panel() -> Panel {
    Panel::new(Axis::new("joint angle", "rad"), Axis::new("torque", "Nm"))
}

fn steps_panel(steps: &SweepSteps) -> Panel {
    let remaining_nm: Vec<f64> = steps
        .without_friction_nm
        .iter()
        .zip(&steps.gravity_nm)
        .map(|(torque_nm, gravity_nm)| torque_nm - gravity_nm)
        .collect();
    let series = [
        ("total", &steps.total_nm),
        (
            "less position-dependent friction",
            &steps.without_position_friction_nm,
        ),
        ("less all friction", &steps.without_friction_nm),
        ("gravity torque", &steps.gravity_nm),
        ("remaining", &remaining_nm),
    ];
    series
        .into_iter()
        .fold(torque_panel(), |panel, (name, values_nm)| {
            panel.series(Series::line(name, zipped(&steps.position_rad, values_nm)))
        })
}

pub fn payload(steps: &SweepSteps) -> String {
    format!("{} kg", printed(steps.payload_kg))
}

pub fn zipped<'a>(x: &'a [f64], y: &'a [f64]) -> impl Iterator<Item = [f64; 2]> + 'a {
    x.iter().zip(y).map(|(x, y)| [*x, *y])
}

fn law_figure(fit: &StiffnessFit, paper: Option<&Published>) -> Figure {
    let figure = Figure::new(format!(
        "T_c of {} over gravity torque (PA10-05, Fig. 7(b)): each payload's samples and the law fitted to all of them; \
         lines mark its knees.",
        fit.joint
    ))
    .columns(2)
    .panel_height(340);
    let published = published_rows(paper, &fit.joint);
    directions(fit)
        .into_iter()
        .enumerate()
        .fold(figure, |figure, (index, direction)| {
            let [low_nm, high_nm] = direction.law.gravity_range_nm;
            let curve = |law: &dyn Fn(f64) -> f64| -> Vec<[f64; 2]> {
                (0..=LAW_POINTS)
                    .map(|i| low_nm + (high_nm - low_nm) * f64::from(i) / f64::from(LAW_POINTS))
                    .map(|gravity_nm| [gravity_nm, law(gravity_nm)])
                    .collect()
            };
            let mut panel = Panel::new(
                Axis::new("gravity torque T_g", "Nm"),
                Axis::new("T_c", "Nm"),
            )
            .title(DIRECTIONS[index]);
            for steps in &direction.steps {
                panel = panel.series(Series::points(
                    payload(steps),
                    zipped(&steps.gravity_nm, &steps.load_torque_nm),
                ));
            }
            panel = panel.series(Series::line(
                "law",
                curve(&|nm| direction.law.torque_nm(nm)),
            ));
            if let Some(rows) = published {
                panel = panel.series(Series::dashed(
                    "published law",
                    curve(&|nm| rows[index].torque_nm(nm)),
                ));
            }
            for (knee, label) in direction.law.knees.iter().zip(["T1", "T2"]) {
                panel = panel.vertical(knee.gravity_nm.value, label);
            }
            figure.panel(panel)
        })
}
