//! The page that `identify` writes: the papers' tables and figures, redrawn from this robot's recordings.
//!
//! Where a robot has published numbers ([`robot::published()`]), they stand beside ours. A part that was not identified
//! keeps its section and says so. docs/papers.md lists which figure of which paper is where.

mod checks;
mod elbow;
mod friction;
mod gravity;
mod load;
mod periodic;

use ::report::{Column, Page, Section, Table, number};
use identification::gravity::GravityFit;
use robot::Robot;
use robot::published::Published;

use super::{Identified, JointResult};

/// The page.
pub fn page(identified: &Identified, robot: &Robot) -> Page {
    let (joints, gravity) = (&identified.joints, identified.gravity.as_ref());
    let [early, late] = ["2003", "2005"].map(|year| paper(robot, year));
    let late = late.as_ref();
    let mut page = Page::new(
        format!("Identification of {}", robot.name),
        verdict(joints, gravity),
    )
    .section(overview(identified, late))
    .section(friction::section(joints, late))
    .section(periodic::section(joints, late))
    .section(gravity::section(gravity, late))
    .section(load::section(joints, late))
    .section(checks::held_out(joints, gravity))
    .section(checks::residuals(joints));
    let trapezoid = early.as_ref().and_then(|paper| paper.trapezoids.first());
    let elbow = trapezoid.and_then(|moved| joints.iter().find(|joint| joint.joint == moved.joint));
    if let Some(joint) = elbow {
        page = page.section(elbow::section(joint));
    }
    page
}

/// The robot's paper of this year, if one comes with the program.
fn paper(robot: &Robot, year: &str) -> Option<Published> {
    robot::published(&format!("{}-{year}", robot.name)).ok()
}

fn verdict(joints: &[JointResult], gravity: Option<&GravityFit>) -> String {
    let of = |what: &str, has: fn(&JointResult) -> bool| {
        let count = joints.iter().filter(|joint| has(joint)).count();
        (count > 0).then(|| format!("{what} of {count}"))
    };
    let mut found: Vec<String> = [
        of("friction over velocity", |joint| joint.friction.is_some()),
        of("friction over position", |joint| joint.periodic.is_some()),
        of("torque over gravity load", |joint| {
            joint.stiffness.is_some()
        }),
    ]
    .into_iter()
    .flatten()
    .collect();
    if let Some(fit) = gravity {
        found.push(format!(
            "gravity by {} sums of masses and moments",
            fit.rank()
        ));
    }
    if found.is_empty() {
        return "Nothing was identified.".to_owned();
    }
    let worst = joints
        .iter()
        .filter_map(|joint| Some((joint, checks::held_out_share(joint)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    let worst = worst.map_or(String::new(), |(joint, share)| {
        format!(
            "; motion never fitted is predicted within {} % rms of the friction (worst: {})",
            number(100.0 * share, 2),
            joint.joint
        )
    });
    let (count, plural) = (joints.len(), if joints.len() == 1 { "" } else { "s" });
    format!(
        "From recordings of {count} joint{plural}: {}{worst}.",
        found.join(", ")
    )
}

fn overview(identified: &Identified, paper: Option<&Published>) -> Section {
    let mut table = Table::new(
        "What was identified, by joint",
        [
            Column::text("joint"),
            Column::text("friction over velocity"),
            Column::text("friction over position"),
            Column::text("torque over gravity load"),
        ],
    );
    for joint in &identified.joints {
        let nothing = || "not identified".to_owned();
        let friction = joint.friction.as_ref();
        let periodic = joint.periodic.as_ref();
        let load = joint.stiffness.as_ref();
        table.row([
            joint.joint.as_str().into(),
            friction
                .map_or_else(nothing, |fit| fit.robot_model().name().to_owned())
                .into(),
            periodic
                .map_or_else(nothing, |fit| harmonics(fit.combined.len()))
                .into(),
            load.map_or_else(nothing, |fit| {
                let regions = [&fit.positive, &fit.negative].map(|fit| fit.law.regions());
                format!("regions: {} (+), {} (−)", regions[0], regions[1])
            })
            .into(),
        ]);
    }
    let findings = findings(identified);
    let section = Section::new("overview", "Overview")
        .paragraph(
            "Everything here comes from recorded motor torque, motor position and reference velocity. All torques are at \
             the joint side: motor torque times gear ratio.",
        )
        .table(table);
    let section = match paper {
        Some(paper) => section.paragraph(format!(
            "Published values, in grey italics, are those of {}: {}, {}.",
            paper.authors.join(" and "),
            paper.title,
            paper.year
        )),
        None => section,
    };
    let section = section.heading("Findings");
    if findings.is_empty() {
        return section
            .paragraph("None: no fit ended on a bound, and all that was asked for was found.");
    }
    section.list(findings)
}

fn harmonics(count: usize) -> String {
    match count {
        0 => "none above noise".to_owned(),
        1 => "1 harmonic".to_owned(),
        _ => format!("{count} harmonics"),
    }
}

/// What a reader should know before trusting the values.
fn findings(identified: &Identified) -> Vec<String> {
    let mut all = identified.findings.clone();
    for joint in &identified.joints {
        let of_friction = joint.friction.iter().flat_map(|fit| &fit.findings);
        all.extend(of_friction.chain(&joint.findings).cloned());
    }
    all
}

/// The section with what is missing in it said first, and why or what to run.
fn without(
    section: Section,
    joints: &[JointResult],
    has: impl Fn(&JointResult) -> bool,
    what: &str,
    command: &str,
) -> Section {
    let missing: Vec<&JointResult> = joints.iter().filter(|joint| !has(joint)).collect();
    if missing.is_empty() {
        return section;
    }
    let names: Vec<&str> = missing.iter().map(|joint| joint.joint.as_str()).collect();
    let asked = if missing.iter().all(|joint| joint.findings.is_empty()) {
        "It was not asked for"
    } else {
        "The findings in the overview say why, or it was not asked for"
    };
    section.paragraph(format!(
        "{what} was not identified for {}. {asked}; `flexspline identify {command}` does it.",
        names.join(", ")
    ))
}

/// Both directions of motion with their signs, as tables write them.
const SIGNS: [&str; 2] = ["+", "−"];
/// The same as titles.
const DIRECTIONS: [&str; 2] = ["positive direction", "negative direction"];

#[cfg(test)]
mod tests;
