//! URDF: links, joints and what their drives are known to do, read as ROS reads them.

use std::collections::BTreeMap;

use joint_model::rigid_body::{JointKind, is_inertia_of_a_body, nearest_inertia_of_a_body};
use nalgebra::{Isometry3, Matrix3, Unit, Vector3};

use crate::error::RobotError;
use crate::mass::{MassProperties, isometry};
use crate::model::{BODIES_MAX, Body, ElementOfJoint, Joint, Mimic, Model};
use crate::xml::{self, Element};
use crate::{Effect, RobotJoint};

/// Elements that a reader takes once, by what they are in; of repeated ones the first counts, as in ROS.
const ONCE: [(&str, &[&str]); 3] = [
    ("link", &["inertial"]),
    ("inertial", &["origin", "mass", "inertia"]),
    (
        "joint",
        &[
            "origin", "parent", "child", "axis", "limit", "dynamics", "mimic",
        ],
    ),
];

/// Elements that say nothing of masses, joints or drives and are passed over without a note, by what they are in.
const SILENT: [(&str, &[&str]); 3] = [
    ("robot", &["material"]),
    ("link", &["visual", "collision"]),
    ("joint", &[]),
];

/// The link that a base may be fixed to without the file's having it, as in Drake.
const WORLD: &str = "world";

/// Reads the URDF's text.
pub fn read(text: &str, file: &str) -> Result<Model, RobotError> {
    let robot = &xml::parse(text, file)?;
    if robot.tag() != "robot" {
        return Err(robot.invalid(format!(
            "not a URDF: the first element is <{}>, not <robot>",
            robot.tag()
        )));
    }
    if has_macros(robot) {
        return Err(xml::refuse_xacro(file));
    }
    let tree = Tree::of(robot)?;
    let reductions = reductions(robot)?;
    let mut model = Model {
        name: robot.attribute("name").unwrap_or("robot").to_owned(),
        gravity_m_s2: None,
        bodies: Vec::new(),
        timestep_s: None,
        angle_rad: 1.0,
        notes: notes(robot),
    };
    let root = tree.root()?;
    let mut open = vec![(root, None, None)];
    // depth first, so that a chain's links follow each other
    while let Some((link, through, parent)) = open.pop() {
        let body = tree.body(link, through, parent, &reductions, &mut model.notes)?;
        model.bodies.push(body);
        let index = model.bodies.len() - 1;
        let below = tree.below.get(link).into_iter().flatten().rev();
        open.extend(below.map(|(joint, child)| (*child, Some(*joint), Some(index))));
    }
    if model.bodies.len() < tree.links.len() {
        return Err(tree.not_connected(root));
    }
    if model.joints().next().is_none() {
        return Err(robot.invalid("no joint that moves; a robot needs at least one"));
    }
    Ok(model)
}

fn has_macros(robot: &Element) -> bool {
    let mut open = vec![robot];
    while let Some(element) = open.pop() {
        if element.namespace().contains("xacro") {
            return true;
        }
        open.extend(element.children());
    }
    false
}

/// What is repeated, and what is not read, each kind once; in the file's order.
fn notes(robot: &Element) -> Vec<String> {
    let mut notes: Vec<(usize, String)> = Vec::new();
    let mut unread: BTreeMap<(&str, &str), (usize, &Element)> = BTreeMap::new();
    let mut open = vec![robot];
    while let Some(element) = open.pop() {
        for tag in listed(&ONCE, element.tag()) {
            if let Some(second) = element.all(tag).nth(1) {
                let words = "repeated; the first one counts, as in ROS";
                notes.push((second.line(), second.note(words)));
            }
        }
        let known = match element.tag() {
            "robot" => &["link", "joint", "transmission"][..],
            tag => listed(&ONCE, tag),
        };
        for child in element.children() {
            if known.contains(&child.tag()) {
                open.push(child);
            } else if let Some((_, silent)) = SILENT.iter().find(|(tag, _)| *tag == element.tag())
                && !silent.contains(&child.tag())
            {
                let key = (element.tag(), child.tag());
                let (count, first) = unread.entry(key).or_insert((0, child));
                *count += 1;
                if child.line() < first.line() {
                    *first = child;
                }
            }
        }
    }
    for ((_, tag), (count, first)) in unread {
        let times = if count > 1 {
            format!(", {count} times")
        } else {
            String::new()
        };
        notes.push((
            first.line(),
            first.note(&format!("<{tag}> is not read{times}")),
        ));
    }
    notes.sort();
    notes.into_iter().map(|(_, note)| note).collect()
}

fn listed<'a>(table: &[(&str, &'a [&'a str])], tag: &str) -> &'a [&'a str] {
    table
        .iter()
        .find(|(parent, _)| *parent == tag)
        .map_or(&[], |(_, children)| children)
}

/// Gear ratios of the transmissions, by joint.
fn reductions(robot: &Element) -> Result<BTreeMap<&str, f64>, RobotError> {
    let mut ratios = BTreeMap::new();
    for transmission in robot.all("transmission") {
        let Some(joint) = transmission.child("joint") else {
            continue;
        };
        let places = [
            Some(joint),
            transmission.child("actuator"),
            Some(transmission),
        ];
        let reduction = places
            .into_iter()
            .flatten()
            .find_map(|place| place.child("mechanicalReduction"));
        if let (Some(name), Some(reduction)) = (joint.attribute("name"), reduction) {
            let values = xml::numbers(reduction, "mechanicalReduction", reduction.text())?;
            let ratio = values.first().copied().unwrap_or(1.0).abs();
            if ratio == 0.0 {
                return Err(reduction.invalid("a reduction must not be 0"));
            }
            ratios.insert(name, ratio);
        }
    }
    Ok(ratios)
}

/// Links by name, and the joints below each.
struct Tree<'a> {
    robot: &'a Element,
    links: BTreeMap<&'a str, &'a Element>,
    /// Links in the file's order.
    order: Vec<&'a str>,
    below: BTreeMap<&'a str, Vec<(&'a Element, &'a str)>>,
    parents: BTreeMap<&'a str, &'a str>,
}

impl<'a> Tree<'a> {
    fn of(robot: &'a Element) -> Result<Self, RobotError> {
        let mut tree = Self {
            robot,
            links: BTreeMap::new(),
            order: Vec::new(),
            below: BTreeMap::new(),
            parents: BTreeMap::new(),
        };
        for link in robot.all("link") {
            let name = link.required("name")?;
            if tree.links.insert(name, link).is_some() {
                return Err(link.invalid("two links have this name; give each its own"));
            }
            tree.order.push(name);
        }
        let is_on_world = |joint: &Element| {
            let parent = joint.child("parent");
            parent.and_then(|parent| parent.attribute("link")) == Some(WORLD)
        };
        if !tree.links.contains_key(WORLD) && robot.all("joint").any(is_on_world) {
            // It has no mass: the file's first element, which has none either, stands for it.
            tree.links.insert(WORLD, robot);
            tree.order.insert(0, WORLD);
        }
        if tree.order.len() > BODIES_MAX {
            return Err(robot.invalid(format!("more than {BODIES_MAX} links")));
        }
        let mut joints: Vec<&str> = Vec::new();
        for joint in robot.all("joint") {
            let name = joint.required("name")?;
            if joints.contains(&name) {
                return Err(joint.invalid("two joints have this name; give each its own"));
            }
            joints.push(name);
            let [parent, child] = [tree.end(joint, "parent")?, tree.end(joint, "child")?];
            if tree.parents.insert(child, parent).is_some() {
                return Err(joint.invalid(format!(
                    "link `{child}` has two parents; remove the joint that closes the loop"
                )));
            }
            tree.below.entry(parent).or_default().push((joint, child));
        }
        Ok(tree)
    }

    fn end(&self, joint: &'a Element, tag: &'a str) -> Result<&'a str, RobotError> {
        let end = joint
            .child(tag)
            .ok_or_else(|| joint.invalid(format!("<{tag} link=\"…\"/> is missing, add it")))?;
        let name = end.required("link")?;
        if self.links.contains_key(name) {
            return Ok(name);
        }
        let known: Vec<String> = self.order.iter().map(|link| (*link).to_owned()).collect();
        Err(joint.place().unknown("link", name, &known))
    }

    fn root(&self) -> Result<&'a str, RobotError> {
        let roots: Vec<&str> = self
            .order
            .iter()
            .copied()
            .filter(|link| !self.parents.contains_key(link))
            .collect();
        match roots.as_slice() {
            [root] => Ok(*root),
            [] => Err(self
                .robot
                .invalid("no base link: every link is a joint's child, so the joints form a loop")),
            _ => Err(self.robot.invalid(format!(
                "several base links: `{}`; connect them, or remove all but one",
                roots.join("`, `")
            ))),
        }
    }

    /// With one parent each, links that cannot be reached from the base form loops.
    fn not_connected(&self, root: &str) -> RobotError {
        let reaches = |link: &str| {
            let mut above = link;
            for _ in 0..self.links.len() {
                match self.parents.get(above) {
                    Some(parent) => above = parent,
                    None => return true,
                }
            }
            false
        };
        let link = self.order.iter().find(|link| !reaches(link));
        let at = link.map_or(self.robot, |link| self.links[link]);
        at.invalid(format!(
            "not connected to the base link `{root}` but part of a loop; break the loop"
        ))
    }

    fn body(
        &self,
        link: &str,
        through: Option<&'a Element>,
        parent: Option<usize>,
        reductions: &BTreeMap<&str, f64>,
        notes: &mut Vec<String>,
    ) -> Result<Body, RobotError> {
        let mass = mass_properties(self.links[link], notes)?;
        let Some(joint) = through else {
            return Ok(Body {
                place: self.links[link].place(),
                at: self.links[link].at(),
                parent,
                origin: Isometry3::identity(),
                joint: None,
                mass,
            });
        };
        Ok(Body {
            place: self.links[link].place(),
            at: self.links[link].at(),
            parent,
            origin: origin_of(joint)?,
            joint: moving_joint(joint, reductions, notes)?,
            mass,
        })
    }
}

fn origin_of(element: &Element) -> Result<Isometry3<f64>, RobotError> {
    let Some(origin) = element.child("origin") else {
        return Ok(Isometry3::identity());
    };
    Ok(isometry(
        origin.numbers("xyz")?.unwrap_or_default(),
        origin.numbers("rpy")?.unwrap_or_default(),
    ))
}

fn mass_properties(link: &Element, notes: &mut Vec<String>) -> Result<MassProperties, RobotError> {
    let Some(inertial) = link.child("inertial") else {
        return Ok(MassProperties::none());
    };
    let mass_kg = match inertial.child("mass") {
        Some(mass) => mass.number("value")?.unwrap_or(0.0),
        None => 0.0,
    };
    if mass_kg < 0.0 {
        return Err(link.invalid(format!("mass {mass_kg} kg must be zero or above")));
    }
    let mut inertia_kg_m2 = Matrix3::zeros();
    if let Some(inertia) = inertial.child("inertia") {
        let element = |key: &str| Ok(inertia.number(key)?.unwrap_or(0.0));
        let [xy, xz, yz] = [element("ixy")?, element("ixz")?, element("iyz")?];
        inertia_kg_m2 = Matrix3::new(
            element("ixx")?,
            xy,
            xz,
            xy,
            element("iyy")?,
            yz,
            xz,
            yz,
            element("izz")?,
        );
    }
    if mass_kg == 0.0 && inertia_kg_m2 != Matrix3::zeros() {
        notes.push(link.note("inertia without mass, which no body has"));
    } else if !is_inertia_of_a_body(&inertia_kg_m2) {
        // published descriptions have such inertias, and other tools read them
        let nearest_kg_m2 = nearest_inertia_of_a_body(&inertia_kg_m2);
        let change = (nearest_kg_m2 - inertia_kg_m2).norm() / inertia_kg_m2.norm();
        notes.push(link.note(&format!(
            "doubtful: no body has this inertia (each principal moment must be at least zero and at most the sum of the other two); \
             the nearest that a body can have is taken, {:.1} % away",
            100.0 * change
        )));
        inertia_kg_m2 = nearest_kg_m2;
    }
    let about_itself = MassProperties {
        mass_kg,
        centre_m: Vector3::zeros(),
        inertia_kg_m2,
    };
    Ok(about_itself.seen_from(&origin_of(inertial)?))
}

/// `None` where the joint is fixed or taken as fixed.
fn moving_joint(
    joint: &Element,
    reductions: &BTreeMap<&str, f64>,
    notes: &mut Vec<String>,
) -> Result<Option<Joint>, RobotError> {
    let name = joint.required("name")?;
    let kind = match joint.required("type")? {
        "fixed" => return Ok(None),
        "revolute" | "continuous" => JointKind::Revolute,
        "prismatic" => JointKind::Prismatic,
        floating @ ("floating" | "planar") => {
            notes.push(joint.note(&format!("{floating}, taken as fixed where it stands")));
            return Ok(None);
        }
        other => {
            return Err(joint.invalid(format!(
                "type {other} is not known; make it revolute, continuous, prismatic or fixed"
            )));
        }
    };
    let axis = match joint.child("axis") {
        Some(axis) => axis.numbers("xyz")?.unwrap_or([1.0, 0.0, 0.0]),
        None => [1.0, 0.0, 0.0],
    };
    let unit_axis = Unit::try_new(Vector3::from(axis), 1e-9)
        .ok_or_else(|| joint.invalid(format!("axis {axis:?} must not be zero")))?;
    let mimic = match joint.child("mimic") {
        Some(mimic) => Some(Mimic {
            joint: mimic.required("joint")?.to_owned(),
            multiplier: mimic.number("multiplier")?.unwrap_or(1.0),
            offset: mimic.number("offset")?.unwrap_or(0.0),
        }),
        None => None,
    };
    let mut drive = RobotJoint::named(name);
    if let Some(ratio) = reductions.get(name) {
        drive.gear_ratio = *ratio;
    }
    limits(joint, &mut drive)?;
    drive.effects = friction(joint)?;
    Ok(Some(Joint {
        place: joint.place(),
        kind,
        axis: unit_axis,
        mimic,
        drive,
        law: None,
        element: ElementOfJoint {
            at: joint.at(),
            ..ElementOfJoint::default()
        },
        actuators: Vec::new(),
    }))
}

/// Limits, where they mean something: many files write zeros where they know none.
fn limits(joint: &Element, drive: &mut RobotJoint) -> Result<(), RobotError> {
    let Some(limit) = joint.child("limit") else {
        return Ok(());
    };
    let positive = |key: &str| Ok(limit.finite(key)?.filter(|value| *value > 0.0));
    drive.velocity_limit_rad_s = positive("velocity")?;
    drive.torque_limit_nm = positive("effort")?.map(|effort_nm: f64| effort_nm / drive.gear_ratio);
    let ends = [limit.finite("lower")?, limit.finite("upper")?].map(Option::unwrap_or_default);
    let limited = joint.attribute("type") != Some("continuous") && ends[0] < ends[1];
    drive.position_limit_rad = limited.then_some(ends);
    Ok(())
}

fn friction(joint: &Element) -> Result<Vec<Effect>, RobotError> {
    let Some(dynamics) = joint.child("dynamics") else {
        return Ok(Vec::new());
    };
    let known = |key: &str| -> Result<Option<f64>, RobotError> {
        let value = dynamics.number(key)?.filter(|value| *value != 0.0);
        match value.filter(|value| *value < 0.0) {
            Some(value) => Err(dynamics.invalid(format!("{key} = {value} must be zero or above"))),
            None => Ok(value),
        }
    };
    let viscous =
        known("damping")?.map(|viscous_nm_s_rad| Effect::ViscousFriction { viscous_nm_s_rad });
    let coulomb = known("friction")?.map(|coulomb_nm| Effect::CoulombFriction { coulomb_nm });
    Ok(coulomb.into_iter().chain(viscous).collect())
}
