//! Gravity: measured, by the file and fitted; what the data determine; Table IV.

use identification::gravity::{FittedLink, GravityFit, JointGravity};
use report::{
    Axis, Cell, Column, Figure, Panel, Section, Series, Table, number, printed, with_error,
};
use robot::published::Published;

pub fn section(fit: Option<&GravityFit>, paper: Option<&Published>) -> Section {
    let section = Section::new("gravity", "Gravity");
    let section = match fit {
        Some(fit) => identified(section, fit),
        None => section.paragraph(
            "Masses and centres of mass were not identified: gravity torque is that of the robot file.",
        ),
    };
    match paper.and_then(table_iv) {
        Some(table) => section.table(table),
        None => section,
    }
}

fn identified(section: Section, fit: &GravityFit) -> Section {
    let section = section
        .paragraph(format!(
            "Torque of slow motion without friction, fitted by masses and first moments. The data determine {} sums of \
             them, listed below; in all other directions the robot file's values stay.",
            fit.rank()
        ))
        .table(links(&fit.links))
        .table(combinations(fit));
    let section = if fit.unseen.is_empty() {
        section
    } else {
        let unseen = fit.unseen.iter().map(|direction| direction.words.as_str());
        section.heading("What the data cannot see").list(unseen)
    };
    let figure = Figure::new(
        "Gravity torque over joint angle (PA10-05, section IV-C): measured torque without friction, gravity of the robot \
         file, and the fit, at the poses of the slow motions.",
    )
    .columns(2)
    .panel_height(280);
    section.table(errors(&fit.joints)).figure(
        fit.joints
            .iter()
            .fold(figure, |figure, joint| figure.panel(panel(joint))),
    )
}

fn links(links: &[FittedLink]) -> Table {
    let mut table = Table::new(
        "Masses and centres of mass in the joint frame ± standard error, the robot file's in grey italics",
        [
            Column::text("link of"),
            Column::number("mass, kg"),
            Column::number("file"),
            Column::number("x, m"),
            Column::number("file"),
            Column::number("y, m"),
            Column::number("file"),
            Column::number("z, m"),
            Column::number("file"),
        ],
    );
    for link in links {
        let mass = with_error(link.mass_kg.value, link.mass_kg.standard_error);
        let mut row: Vec<Cell> = vec![link.joint.as_str().into(), mass.into()];
        row.push(Cell::published(number(link.file_mass_kg, 4)));
        for (centre, file) in link.centre_of_mass_m.iter().zip(link.file_centre_of_mass_m) {
            row.push(with_error(centre.value, centre.standard_error).into());
            row.push(Cell::published(number(file, 3)));
        }
        table.row(row);
    }
    table.note("Of all values that fit, these are nearest to the file's; a standard error holds the file's tolerance where the data see nothing.");
    table
}

fn combinations(fit: &GravityFit) -> Table {
    let mut table = Table::new(
        "What the data determine",
        [
            Column::text("sum (m mass, c centre of mass)"),
            Column::text("unit"),
            Column::number("fitted"),
            Column::number("file"),
        ],
    );
    for sum in &fit.identifiable {
        table.row([
            sum.words.as_str().into(),
            sum.unit.into(),
            with_error(sum.fitted.value, sum.fitted.standard_error).into(),
            Cell::published(number(sum.file_value, 4)),
        ]);
    }
    table
}

fn errors(joints: &[JointGravity]) -> Table {
    let mut table = Table::new(
        "Gravity torque less measured, root mean square in Nm",
        [
            Column::text("joint"),
            Column::number("file"),
            Column::number("fitted"),
            Column::number("file, poses left out"),
            Column::number("fitted, poses left out"),
        ],
    );
    for joint in joints {
        let values = [
            joint.file_rms_nm,
            joint.fitted_rms_nm,
            joint.held_out_file_rms_nm,
            joint.held_out_rms_nm,
        ];
        let mut row: Vec<Cell> = vec![joint.joint.as_str().into()];
        row.extend(values.map(|nm| Cell::from(number(nm, 3))));
        table.row(row);
    }
    table
}

fn panel(joint: &JointGravity) -> Panel {
    let over_angle = |values_nm: &[f64]| -> Vec<[f64; 2]> {
        let angles = joint.position_rad.iter();
        angles
            .zip(values_nm)
            .map(|(angle, nm)| [*angle, *nm])
            .collect()
    };
    Panel::new(Axis::new("joint angle", "rad"), Axis::new("torque", "Nm"))
        .title(&joint.joint)
        .series(Series::points("measured", over_angle(&joint.measured_nm)))
        .series(Series::points("robot file", over_angle(&joint.file_nm)))
        .series(Series::points("fitted", over_angle(&joint.fitted_nm)))
}

fn table_iv(paper: &Published) -> Option<Table> {
    let values = paper.gravity?;
    let mut table = Table::new(
        "Published masses and lengths (PA10-05, Table IV; symbols as in its Fig. 6)",
        [Column::text("symbol"), Column::number("published")],
    );
    for (symbol, value, unit) in [
        ("m2", values.m2_kg, "kg"),
        ("m4", values.m4_kg, "kg"),
        ("m6", values.m6_kg, "kg"),
        ("l2", values.l2_m, "m"),
        ("l4", values.l4_m, "m"),
        ("lc2", values.lc2_m, "m"),
        ("lc4", values.lc4_m, "m"),
        ("lc6", values.lc6_m, "m"),
    ] {
        table.row([
            symbol.into(),
            Cell::published(format!("{} {unit}", printed(value))),
        ]);
    }
    Some(table)
}
