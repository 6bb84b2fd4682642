//! What is known of a robot, what nobody said, and what can hardly be meant: by place in its files.

use joint_model::rigid_body::{Link, is_inertia_of_a_body};
use nalgebra::Matrix3;

use crate::description::Description;
use crate::error::{Place, RobotError};
use crate::file::RobotFile;
use crate::model::Model;
use crate::robot::{load_file, load_raw};
use crate::{Effect, Robot, RobotJoint};

/// A robot and what its files say of it.
#[derive(Clone, Debug)]
pub struct Survey {
    /// The robot.
    pub robot: Robot,
    /// What the files say, in sentences; what is the same of several joints once.
    pub known: Vec<String>,
    /// What they do not say and what is taken instead.
    pub unknown: Vec<String>,
    /// What can hardly be meant or was not read, each with file, line and element where they are known.
    pub doubtful: Vec<String>,
}

/// A centre of mass farther from its joint is in other units than metres.
const CENTRE_M: f64 = 3.0;

/// Free fall on Earth, from the equator to the poles, and rounded.
const GRAVITY_M_S2: std::ops::RangeInclusive<f64> = 9.7..=9.9;

/// Looks at a robot: a shipped one by name, a robot file, a URDF or a MuJoCo model.
///
/// # Errors
/// [`RobotError`] if there is no robot in it.
pub fn survey(name_or_path: &str) -> Result<Survey, RobotError> {
    let (text, _) = load_raw(name_or_path)?;
    let (file, source) = load_file(name_or_path)?;
    let mut model = file.model(name_or_path, &source)?;
    if Description::of(&text, name_or_path)?.is_none() {
        number_lines(&mut model, &file, &text);
    }
    let robot = file.clone().build(source)?;
    let mut doubtful = doubts_of_bodies(&robot, &model);
    doubtful.extend(doubts_of_joints(&robot, &model));
    let mut known = Vec::new();
    for note in &robot.notes {
        let is_known = note.starts_with("held") || note.contains("as in ROS");
        let told = if is_known { &mut known } else { &mut doubtful };
        // some that matter are in both
        if !told.contains(note) {
            told.push(note.clone());
        }
    }
    known.splice(0..0, known_of(&robot));
    Ok(Survey {
        unknown: unknown_of(&robot),
        robot,
        known,
        doubtful,
    })
}

/// Places in a robot file have no line of their own: the n-th `[[link]]` is the n-th link.
fn number_lines(model: &mut Model, file: &RobotFile, text: &str) {
    if file.links.is_empty() {
        return;
    }
    let lines = text.lines().enumerate();
    let tables = lines.filter(|(_, line)| line.trim_start().starts_with("[[link]]"));
    for (body, (line, _)) in model.bodies.iter_mut().zip(tables) {
        body.place.line = Some(line + 1);
        if let Some(joint) = &mut body.joint {
            joint.place.line = Some(line + 1);
        }
    }
}

fn doubts_of_bodies(robot: &Robot, model: &Model) -> Vec<String> {
    let mut doubts = Vec::new();
    for body in &model.bodies {
        let mass = &body.mass;
        let mut doubt = |what: String| doubts.push(told(&body.place, &what));
        let inertia = &mass.inertia_kg_m2;
        if mass.mass_kg > 0.0 && *inertia == Matrix3::zeros() {
            doubt(format!(
                "{} kg without inertia: a point; write its inertia, or leave the mass to the body it is part of",
                mass.mass_kg
            ));
        } else if mass.mass_kg == 0.0 && *inertia != Matrix3::zeros() {
            doubt("inertia without mass, which no body has; write its mass".to_owned());
        } else if let Some(wide) = mass.told_if_wide() {
            doubt(wide);
        }
        // an inertia of no body stands in the notes where the description is one of others
        if mass.centre_m.norm() > CENTRE_M {
            doubt(format!(
                "its centre of mass is {:.1} m from its frame; are these metres?",
                mass.centre_m.norm()
            ));
        }
    }
    let links = robot.chain.links();
    for (index, link) in links.iter().enumerate() {
        let Some(joint) = model.joint(&robot.joints[index].name) else {
            continue;
        };
        if weighs_nothing(link) {
            let what = if nothing_below(links, index) {
                "nothing that it moves has mass; write the masses"
            } else {
                "its own link has no mass; only what follows it does"
            };
            doubts.push(told(&joint.place, what));
        } else if !is_inertia_of_a_body(&link.inertia_kg_m2) {
            doubts.push(told(&joint.place, "no body has the inertia that it moves"));
        }
    }
    let gravity = robot.chain.gravity_m_s2().norm();
    if gravity != 0.0 && !GRAVITY_M_S2.contains(&gravity) {
        doubts.push(format!(
            "gravity is {gravity} m/s², on Earth it is 9.8; see gravity_m_s2"
        ));
    }
    doubts
}

fn weighs_nothing(link: &Link) -> bool {
    link.mass_kg == 0.0 && link.inertia_kg_m2 == Matrix3::zeros()
}

fn nothing_below(links: &[Link], index: usize) -> bool {
    let mut is_below = vec![false; links.len()];
    is_below[index] = true;
    for (link, own) in links.iter().enumerate().skip(index + 1) {
        is_below[link] = own.parent.is_some_and(|parent| is_below[parent]);
    }
    let mut all = links.iter().zip(is_below);
    all.all(|(link, is_below)| !is_below || weighs_nothing(link))
}

fn doubts_of_joints(robot: &Robot, model: &Model) -> Vec<String> {
    let drives_some = model.joints().any(|joint| !joint.actuators.is_empty());
    let mut doubts = Vec::new();
    for drive in &robot.joints {
        let Some(joint) = model.joint(&drive.name) else {
            continue;
        };
        let mut doubt = |what: String| doubts.push(told(&joint.place, &what));
        if drives_some && joint.actuators.is_empty() {
            doubt("no actuator turns it; add one, or hold it (held = { … })".to_owned());
        }
        if drive.torque_limit_nm == Some(0.0) {
            doubt("its largest torque is 0: nothing turns it; correct the limit".to_owned());
        }
        if let Some([low, high]) = drive.position_limit_rad
            && high - low < 1e-6
        {
            doubt(format!(
                "it may not move: {low} to {high}; correct the limits"
            ));
        }
    }
    doubts
}

fn told(place: &Place, what: &str) -> String {
    format!("{place}: {what}")
}

/// What a joint's file says, in words.
fn known_of_joint(joint: &RobotJoint) -> Vec<String> {
    let mut parts = Vec::new();
    let mut part = |is_there: bool, what: &str| {
        if is_there {
            parts.push(what.to_owned());
        }
    };
    part(joint.gear_ratio != 1.0, "gear ratio");
    part(joint.rotor_inertia_kg_m2 != 0.0, "rotor inertia");
    part(joint.torque_limit_nm.is_some(), "largest torque");
    part(joint.torque_constant_nm_a.is_some(), "torque constant");
    part(joint.position_limit_rad.is_some(), "range");
    part(joint.velocity_limit_rad_s.is_some(), "largest velocity");
    part(
        joint.motor_encoder_resolution_rad.is_some() || joint.link_encoder_resolution_rad.is_some(),
        "encoder steps",
    );
    part(
        joint.position_noise_rad != 0.0 || joint.torque_noise_nm != 0.0,
        "noise",
    );
    part(
        joint.direction_friction.is_some(),
        "friction in each direction",
    );
    part(joint.load_torque.is_some(), "friction over load");
    part(joint.friction_table.is_some(), "friction over the angle");
    part(!joint.torque_tables.is_empty(), "torque tables");
    let effects = joint.effects.iter().map(|effect| effect.name().to_owned());
    parts.extend(effects);
    parts
}

fn known_of(robot: &Robot) -> Vec<String> {
    let masses_kg = robot.chain.links().iter().map(|link| link.mass_kg);
    let mass_kg = masses_kg.fold(0.0, |sum_kg, mass_kg| sum_kg + mass_kg);
    let count = robot.joints.len();
    let mut known = vec![format!(
        "{count} joint{}, {:.3} kg that move, gravity {:.2} m/s²",
        if count == 1 { "" } else { "s" },
        mass_kg,
        robot.chain.gravity_m_s2().norm()
    )];
    if robot.chain.gravity_m_s2().norm() == 0.0 {
        known.push("no gravity, as of axes that stand upright or hold no weight; see gravity_m_s2 if it pulls".to_owned());
    }
    known.extend(grouped(robot, known_of_joint));
    if let Some(control) = &robot.control {
        known.push(format!(
            "control: {} at {} Hz",
            words_of_control(control.kind),
            control.rate_hz
        ));
    }
    known
}

fn words_of_control(kind: crate::ControlKind) -> &'static str {
    match kind {
        crate::ControlKind::PdFeedforward => "proportional-derivative on the position",
        crate::ControlKind::VelocityPi => "proportional-integral on the velocity",
        crate::ControlKind::OpenLoopTorque => "torques from elsewhere",
        crate::ControlKind::Unknown => "unknown",
    }
}

fn unknown_of_joint(joint: &RobotJoint) -> Vec<String> {
    let has = |name: &str| joint.effects.iter().any(|effect| effect.name() == name);
    let has_friction = joint.direction_friction.is_some()
        || joint.friction_table.is_some()
        || joint.effects.iter().any(|effect| {
            matches!(
                effect,
                Effect::CoulombFriction { .. } | Effect::ViscousFriction { .. }
            )
        });
    let missing = [
        (joint.gear_ratio == 1.0, "gear ratio (taken as 1)"),
        (
            joint.rotor_inertia_kg_m2 == 0.0,
            "rotor inertia (taken as none)",
        ),
        (!has_friction, "friction (taken as none)"),
        (
            !has("torsional_compliance"),
            "stiffness of the gear (taken as rigid)",
        ),
        (joint.torque_limit_nm.is_none(), "largest torque"),
        (joint.position_limit_rad.is_none(), "range"),
        (
            joint.motor_encoder_resolution_rad.is_none()
                && joint.link_encoder_resolution_rad.is_none(),
            "encoder steps",
        ),
        (
            joint.position_noise_rad == 0.0 && joint.torque_noise_nm == 0.0,
            "noise",
        ),
    ];
    let missing = missing.into_iter().filter(|(is_missing, _)| *is_missing);
    missing.map(|(_, what)| what.to_owned()).collect()
}

fn unknown_of(robot: &Robot) -> Vec<String> {
    let mut unknown = grouped(robot, unknown_of_joint);
    if robot.control.is_none() {
        unknown.push("control: nobody says what made the torques".to_owned());
    }
    unknown
}

/// What is the same of several joints once.
fn grouped(robot: &Robot, parts: impl Fn(&RobotJoint) -> Vec<String>) -> Vec<String> {
    let mut groups: Vec<(String, Vec<&str>)> = Vec::new();
    for joint in &robot.joints {
        let parts = parts(joint).join(", ");
        if parts.is_empty() {
            continue;
        }
        match groups.iter_mut().find(|(known, _)| *known == parts) {
            Some((_, joints)) => joints.push(&joint.name),
            None => groups.push((parts, vec![&joint.name])),
        }
    }
    groups
        .into_iter()
        .map(|(parts, joints)| format!("{}: {parts}", joints.join(", ")))
        .collect()
}
