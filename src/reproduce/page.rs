//! The page: the papers' figures redrawn from the emulated arm, and the tables.

use report::{Axis, Cell, Column, Figure, Page, Panel, Section, Series, Table, number};
use robot::Robot;
use robot::published::Published;

use super::bench::Row;
use super::controllers::{HIGH_GAINS, IDENTIFIED, NO_MODEL};
use super::experiments::{ELBOW, JOINT_THREE, LEMNISCATE, SHOULDER};
use super::region::is_inside;
use super::results::{Arm, Reproduction, Run};
use super::tables;

/// The whole page. Figures are of the first arm.
pub fn page(
    reproduction: &Reproduction,
    published: &Published,
    elbow: &Published,
    robot: &Robot,
) -> Page {
    let title = format!("{} on the emulated arm", published.title);
    let mut page = Page::new(title, verdict(reproduction)).section(method(reproduction));
    let Some(arm) = reproduction.arms.first() else {
        return page;
    };
    for (name, sheets) in tables::all(reproduction, published, elbow) {
        let mut section = Section::new(name.replace(' ', "-"), capital(name));
        for sheet in &sheets {
            section = section.table(sheet.html());
        }
        for figure in figures(name, arm, robot) {
            section = section.figure(figure);
        }
        if name == "gains" && reproduction.paper == "pa10-2005" {
            section = section.table(table_six(published));
        }
        page = page.section(section);
    }
    page
}

fn verdict(reproduction: &Reproduction) -> String {
    let judged: Vec<bool> = reproduction
        .targets
        .iter()
        .filter_map(|target| Some(target.identified()?.met))
        .collect();
    let met = judged.iter().filter(|met| **met).count();
    format!(
        "With the model identified on the arm and the paper's gains, {met} of {} targets are met.",
        judged.len()
    )
}

fn method(reproduction: &Reproduction) -> Section {
    let seeds: Vec<String> = reproduction
        .arms
        .iter()
        .map(|arm| arm.seed.to_string())
        .collect();
    Section::new("method", "What was done")
        .paragraph(format!(
            "The paper's experiments on the emulated PA-10 with seed {}, in virtual time, in torque mode at 1.5 kHz. The \
             arm's parameters deviate from its robot file, and it has compliance, hysteresis, kinematic error, torque ripple \
             and drives that the file does not know; the seed makes them. Errors are the plant's own, after the gear.",
            seeds.join(", ")
        ))
        .definitions([
            ("published tables", "feedforward with the tables of PA10-05 as printed"),
            ("identified", "the same law with the model identified from recordings of this arm"),
            ("+ measured velocity", "identified, with friction at the observed speed of the joint"),
            ("+ torsion", "identified, with load-dependent friction at the load that a link encoder's torsion shows"),
            ("+ correction", "identified, with the slow model error seen by the torque estimator fed forward"),
            ("no model", "the same gains with nothing fed forward"),
            ("no model, high gains", "of all gains tried in the search below, those that follow best with nothing fed forward and do not ring"),
            ("feedback", "what proportional and derivative feedback add to the model's torque, at the joint"),
            ("inside", "the reference moves, and its gravity torque lies between the knees of the published Table V for its \
              direction: there gravity and friction balance, and the drive has next to nothing to transmit"),
            ("held joints", "where one joint moves, the others are held with ten times their proportional gain"),
        ])
}

fn figures(name: &str, arm: &Arm, robot: &Robot) -> Vec<Figure> {
    match name {
        LEMNISCATE => [path(arm, robot), tool_error(arm, robot), joint_torques(arm)]
            .into_iter()
            .flatten()
            .collect(),
        JOINT_THREE | SHOULDER | ELBOW => single_joint(arm, name, robot),
        _ => Vec::new(),
    }
}

/// Runs to draw: those with a model.
fn modelled<'a>(arm: &'a Arm, experiment: &'a str) -> impl Iterator<Item = &'a Run> {
    let without = [NO_MODEL, HIGH_GAINS];
    let runs = arm
        .runs
        .iter()
        .filter(move |run| run.experiment == experiment);
    runs.filter(move |run| !without.contains(&run.controller.as_str()))
}

fn tool_m(robot: &Robot, position_rad: &[f64]) -> [f64; 3] {
    let pose = robot.chain.tool_pose(&position_rad[..robot.joints.len()]);
    pose.translation.vector.into()
}

/// Fig. 8.
fn path(arm: &Arm, robot: &Robot) -> Option<Figure> {
    let first = modelled(arm, LEMNISCATE).next()?;
    let place = |position_rad: &[f64]| {
        let [_, y_m, z_m] = tool_m(robot, position_rad);
        [y_m, z_m]
    };
    let wanted = first.rows.iter().map(|row| place(&row.reference_rad));
    let mut panel = Panel::new(Axis::new("y", "m"), Axis::new("z", "m"))
        .equal_aspect()
        .series(Series::dashed("desired", wanted));
    for run in modelled(arm, LEMNISCATE) {
        let found = run.rows.iter().map(|row| place(&row.link_rad));
        panel = panel.series(Series::line(&run.controller, found));
    }
    let caption = "Path of the tool in the plane x = 0.6 m (PA10-05, Fig. 8).";
    Some(Figure::new(caption).panel(panel).panel_height(520))
}

fn tool_error(arm: &Arm, robot: &Robot) -> Option<Figure> {
    let mut panel = Panel::new(Axis::new("time", "s"), Axis::new("error of the tool", "mm"));
    for run in modelled(arm, LEMNISCATE) {
        let error = run.rows.iter().map(|row| {
            let (wanted, found) = (
                tool_m(robot, &row.reference_rad),
                tool_m(robot, &row.link_rad),
            );
            let square: f64 = wanted.iter().zip(found).map(|(a, b)| (a - b).powi(2)).sum();
            [row.time_s, 1e3 * square.sqrt()]
        });
        panel = panel.series(Series::line(&run.controller, error));
    }
    let caption = "Distance of the tool from its reference.";
    arm.run(LEMNISCATE, IDENTIFIED)
        .map(|_| Figure::new(caption).panel(panel))
}

/// Fig. 9.
fn joint_torques(arm: &Arm) -> Option<Figure> {
    let run = arm.run(LEMNISCATE, IDENTIFIED)?;
    let caption = "Torques of each joint along the lemniscate with the identified model, at the joint (PA10-05, Fig. 9): \
                   what was fed forward for friction, gravity and stiffness, and what feedback added. Joint 3 is locked.";
    let joints = run.joints.iter().filter(|joint| joint.joint != "joint3");
    Some(joints.fold(
        Figure::new(caption).columns(2).panel_height(260),
        |figure, joint| figure.panel(torques(&run.rows, joint.index).title(&joint.joint)),
    ))
}

/// Parts of one joint's torque over time.
fn torques(rows: &[Row], joint: usize) -> Panel {
    let series = |name: &str, of: &dyn Fn(&Row) -> f64| {
        Series::line(name, rows.iter().map(|row| [row.time_s, of(row)]))
    };
    Panel::new(Axis::new("time", "s"), Axis::new("torque", "Nm"))
        .series(series("friction", &|row| row.friction_nm[joint]))
        .series(series("gravity", &|row| row.gravity_nm[joint]))
        .series(series("stiffness", &|row| row.stiffness_nm[joint]))
        .series(series("feedback", &|row| row.feedback_nm[joint]))
}

/// Fig. 10; for sweeps Figs. 8 and 9 of PA10-03.
fn single_joint(arm: &Arm, experiment: &str, robot: &Robot) -> Vec<Figure> {
    let Some(identified) = arm.run(experiment, IDENTIFIED) else {
        return Vec::new();
    };
    let Some(joint) = identified.joints.first() else {
        return Vec::new();
    };
    let (index, name) = (joint.index, &joint.joint);
    let parts = Figure::new(format!(
        "Torques of {name} with the identified model, at the joint{}.",
        match experiment {
            JOINT_THREE => " (PA10-05, Fig. 10)",
            _ => "",
        }
    ));
    let borders_s = borders_s(&identified.rows, robot, index);
    let panel = |quantity: &str, unit: &str, title: &str| {
        let panel = Panel::new(Axis::new("time", "s"), Axis::new(quantity, unit)).title(title);
        borders_s
            .iter()
            .fold(panel, |panel, time_s| panel.vertical(*time_s, ""))
    };
    let line = |run: &Run, of: &dyn Fn(&Row) -> f64| {
        Series::line(
            &run.controller,
            run.rows.iter().map(|row| [row.time_s, of(row)]),
        )
    };
    let desired = identified
        .rows
        .iter()
        .map(|row| [row.time_s, row.reference_rad[index]]);
    let mut position =
        panel("position", "rad", "desired and actual").series(Series::dashed("desired", desired));
    let mut error = panel("error", "mrad", "tracking error");
    let mut feedback = panel("feedback", "Nm", "feedback torque with a model");
    let mut high = panel(
        "feedback",
        "Nm",
        "feedback torque without a model, high gains",
    );
    for run in modelled(arm, experiment) {
        feedback = feedback.series(line(run, &|row| row.feedback_nm[index]));
    }
    let without = arm.run(experiment, HIGH_GAINS);
    if let Some(run) = without {
        high = high.series(line(run, &|row| row.feedback_nm[index]));
    }
    for run in modelled(arm, experiment).chain(without) {
        position = position.series(line(run, &|row| row.link_rad[index]));
        error = error.series(line(run, &|row| {
            1e3 * (row.reference_rad[index] - row.link_rad[index])
        }));
    }
    let what = match experiment {
        ELBOW => "Feedback torque, position and error of the elbow (PA10-03, Figs. 8 and 9).",
        _ => "Feedback torque, position and error.",
    };
    let lines = match borders_s.is_empty() {
        true => "",
        false => " Vertical lines: borders of the region of low stiffness.",
    };
    let mut compared = Figure::new(format!("{what}{lines}"))
        .columns(2)
        .panel_height(280)
        .panel(position)
        .panel(error)
        .panel(feedback);
    if without.is_some() {
        compared = compared.panel(high);
    }
    vec![parts.panel(torques(&identified.rows, index)), compared]
}

/// When the reference enters or leaves the region of low stiffness.
fn borders_s(rows: &[Row], robot: &Robot, joint: usize) -> Vec<f64> {
    let inside = rows
        .iter()
        .map(|row| (row.time_s, is_inside(row, robot, joint) == Some(true)));
    let inside: Vec<(f64, bool)> = inside.collect();
    let changes = inside.windows(2).filter(|pair| pair[0].1 != pair[1].1);
    changes.map(|pair| pair[1].0).collect()
}

fn table_six(published: &Published) -> Table {
    let mut table = Table::new(
        "Gains (PA10-05, Table VI; joint 3: section V-A)",
        [
            Column::text("joint"),
            Column::number("proportional, Nm/rad"),
            Column::number("derivative, Nm s/rad"),
            Column::number("at the joint, Nm/rad"),
            Column::number("at the joint, Nm s/rad"),
        ],
    );
    for joint in &published.joints {
        let own = joint
            .table_vi
            .map(|gains| [gains.proportional_nm_rad, gains.derivative_nm_s_rad]);
        let trapezoid = published
            .trapezoids
            .iter()
            .find(|numbers| numbers.joint == joint.name);
        let alone =
            trapezoid.map(|numbers| [numbers.proportional_nm_rad, numbers.derivative_nm_s_rad]);
        let Some(gains) = own.or(alone) else { continue };
        let printed = gains.map(|gain| Cell::published(number(gain, 3)));
        let used = gains.map(|gain| Cell::from(number(gain * published.drive.gear_ratio, 3)));
        table.row(
            [Cell::from(joint.name.as_str())]
                .into_iter()
                .chain(printed)
                .chain(used),
        );
    }
    table.note("Printed at the motor per radian of the joint; used at the joint, times the gear ratio of 50.");
    table
}

fn capital(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or(String::new(), |first| {
        first.to_uppercase().chain(letters).collect()
    })
}
