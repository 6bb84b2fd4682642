//! Robots: from a shipped name or a file to a chain with drives.

use std::fs;
use std::path::{Path, PathBuf};

use joint_model::JOINTS_MAX;
use joint_model::rigid_body::{Chain, ChainError, JointKind, Link};
use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::check::{self, Must};
use crate::error::{Place, RobotError, nearest};
use crate::file::{LinkFile, RobotFile, RobotJoint};
use crate::urdf;
use crate::{Control, Effect, Tolerance};

/// The robots that come with the program, by name.
const SHIPPED: [(&str, &str); 2] = [
    ("pa10", include_str!("../../robots/pa10.toml")),
    ("shd17", include_str!("../../robots/shd17.toml")),
];

/// Where a robot's description came from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// Part of the program.
    Shipped(&'static str),
    /// Read from this path.
    File(PathBuf),
}

/// A robot: rigid bodies, drives, and the controller that ran on it. The nominal model, the "sim" of every comparison.
#[derive(Clone, Debug)]
pub struct Robot {
    /// What the robot is called.
    pub name: String,
    /// Rigid bodies; [`Chain::links`] gives the links to rebuild a changed chain from.
    pub chain: Chain,
    /// Drives and sensors, in the chain's order.
    pub joints: Vec<RobotJoint>,
    /// Effects of the whole arm (payload, base tilt, bus timing), wherever the file wrote them.
    pub shared_effects: Vec<Effect>,
    /// What ran on the robot while it was recorded, where the file says anything of it; gains in the chain's order.
    pub control: Option<Control>,
    /// How well the values are known.
    pub tolerance: Tolerance,
    /// Where the description came from.
    pub source: Source,
}

impl Robot {
    /// Index of the joint in the chain.
    pub fn joint_index(&self, name: &str) -> Option<usize> {
        self.joints.iter().position(|joint| joint.name == name)
    }

    /// The joints' names, in the chain's order.
    pub fn joint_names(&self) -> Vec<&str> {
        self.joints
            .iter()
            .map(|joint| joint.name.as_str())
            .collect()
    }
}

/// Names of the robots that come with the program.
pub fn shipped() -> impl Iterator<Item = &'static str> {
    SHIPPED.iter().map(|(name, _)| *name)
}

/// Loads a shipped robot by name, or a robot file by path.
///
/// # Errors
/// [`RobotError`]: one line with file, place, and what to change.
pub fn load(name_or_path: &str) -> Result<Robot, RobotError> {
    let (file, source) = load_file(name_or_path)?;
    file.build(source)
}

/// Reads what [`load`] reads without making the robot: to change values and write the file again.
///
/// # Errors
/// [`RobotError`]: one line with file, place, and what to change.
pub fn load_file(name_or_path: &str) -> Result<(RobotFile, Source), RobotError> {
    let (text, source) = load_text(name_or_path)?;
    Ok((RobotFile::parse(&text, name_or_path)?, source))
}

/// Reads the text of what [`load`] reads: to change it and keep the rest as it was written.
///
/// # Errors
/// [`RobotError`] if there is no such file.
pub fn load_text(name_or_path: &str) -> Result<(String, Source), RobotError> {
    if let Some((name, text)) = SHIPPED.iter().find(|(name, _)| *name == name_or_path) {
        return Ok(((*text).to_owned(), Source::Shipped(name)));
    }
    let text = fs::read_to_string(name_or_path).map_err(|error| RobotError::Read {
        file: name_or_path.to_owned(),
        reason: error.to_string(),
        hint: shipped_hint(name_or_path),
    })?;
    Ok((text, Source::File(PathBuf::from(name_or_path))))
}

fn shipped_hint(name: &str) -> String {
    let names: Vec<String> = shipped().map(str::to_owned).collect();
    match nearest(name, &names) {
        Some(near) => format!("; did you mean the shipped robot `{near}`?"),
        None => format!(
            "; give a robot file, or one of the shipped robots {}",
            names.join(", ")
        ),
    }
}

impl RobotFile {
    /// Checks the file and makes the robot. The source names the file in errors, and a URDF is read beside it.
    ///
    /// # Errors
    /// [`RobotError`]: one line with file, place, and what to change.
    pub fn build(mut self, source: Source) -> Result<Robot, RobotError> {
        let file = match &source {
            Source::Shipped(name) => (*name).to_owned(),
            Source::File(path) => path.display().to_string(),
        };
        let top = Place::new(&file, "top level");
        if self.name.trim().is_empty() {
            return Err(top.invalid("name must not be empty"));
        }
        check::tolerance(&file, &self.parameter_tolerance)?;
        check_joints(&file, &self.joints)?;
        let (names, mut links) = self.links(&file, &source)?;
        for (index, link) in links.iter_mut().enumerate() {
            link.parent = Link::serial(index);
        }
        let order = match_joints(&file, &names, &self.joints)?;
        let control = self
            .control
            .take()
            .filter(|control| !control.is_silent())
            .map(|control| ordered_control(&file, control, &order))
            .transpose()?;
        let tool = isometry(self.tool_origin_m, self.tool_origin_rpy_rad);
        let chain = Chain::new(&links, Vector3::from(self.gravity_m_s2), tool)
            .map_err(|error| chain_error(&file, &names, &error))?;
        let mut joints: Vec<RobotJoint> = order
            .iter()
            .map(|index| self.joints[*index].clone())
            .collect();
        let mut shared_effects = self.shared_effects;
        check_shared(&file, &shared_effects)?;
        for joint in &mut joints {
            shared_effects.extend(joint.effects.extract_if(.., |effect| effect.is_whole_arm()));
        }
        let robot = Robot {
            name: self.name,
            chain,
            joints,
            shared_effects,
            control,
            tolerance: self.parameter_tolerance,
            source,
        };
        robot
            .loaded_chain()
            .map_err(|error| chain_error(&file, &names, &error))?;
        Ok(robot)
    }

    /// Joint names and links, base to tip. Limits that only the URDF has are written into the joints.
    fn links(
        &mut self,
        file: &str,
        source: &Source,
    ) -> Result<(Vec<String>, Vec<Link>), RobotError> {
        let top = Place::new(file, "top level");
        match (&self.urdf, self.links.is_empty()) {
            (Some(_), false) => {
                Err(top.invalid("there are both urdf and [[link]] tables; remove one of them"))
            }
            (None, true) => {
                Err(top.invalid("there is neither urdf nor a [[link]] table; add one of them"))
            }
            (None, false) => {
                let names = self.links.iter().map(|link| link.joint.clone()).collect();
                let links = self
                    .links
                    .iter()
                    .map(|link| rigid_link(file, link))
                    .collect::<Result<_, _>>()?;
                Ok((names, links))
            }
            (Some(urdf), true) => {
                let Source::File(robot_file) = source else {
                    return Err(top.invalid(
                        "a shipped robot has no folder to find a urdf in; use [[link]] tables",
                    ));
                };
                let path = robot_file.parent().unwrap_or(Path::new("")).join(urdf);
                let chain = read_urdf(&path, file, urdf)?;
                for (joint, link) in self.joints.iter_mut().flat_map(|joint| {
                    let link = chain.iter().find(|link| link.joint == joint.name);
                    link.map(|link| (joint, link))
                }) {
                    joint.position_limit_rad = joint.position_limit_rad.or(link.position_limit_rad);
                    joint.velocity_limit_rad_s =
                        joint.velocity_limit_rad_s.or(link.velocity_limit_rad_s);
                }
                Ok(chain
                    .into_iter()
                    .map(|link| (link.joint, link.link))
                    .unzip())
            }
        }
    }
}

fn read_urdf(path: &Path, robot_file: &str, urdf: &str) -> Result<Vec<urdf::UrdfLink>, RobotError> {
    let text = fs::read_to_string(path).map_err(|error| RobotError::Read {
        file: path.display().to_string(),
        reason: error.to_string(),
        hint: format!("; {robot_file} names it as urdf = {urdf:?}, relative to itself"),
    })?;
    urdf::read_chain(&text, &path.display().to_string())
}

fn check_joints(file: &str, joints: &[RobotJoint]) -> Result<(), RobotError> {
    let top = Place::new(file, "top level");
    if joints.is_empty() || joints.len() > JOINTS_MAX {
        return Err(top.invalid(format!(
            "there are {} [[joint]] tables; give 1 to {JOINTS_MAX}",
            joints.len()
        )));
    }
    for (index, joint) in joints.iter().enumerate() {
        check::name(
            &Place::new(file, format!("joint {}", index + 1)),
            "name",
            &joint.name,
        )?;
        let place = Place::new(file, format!("joint `{}`", joint.name));
        if joints[..index]
            .iter()
            .any(|earlier| earlier.name == joint.name)
        {
            return Err(
                place.invalid("the name is used by two [[joint]] tables; give each its own")
            );
        }
        check::joint(&place, joint)?;
    }
    Ok(())
}

fn check_shared(file: &str, effects: &[Effect]) -> Result<(), RobotError> {
    let place = Place::new(file, "shared_effects");
    if let Some(effect) = effects.iter().find(|effect| !effect.may_be_shared()) {
        return Err(place.invalid(format!(
            "{} belongs to one joint; move it into that [[joint]]'s effects",
            effect.name()
        )));
    }
    check::effects(&place, effects)
}

/// For each joint of the chain, the index of its `[[joint]]` table.
fn match_joints(
    file: &str,
    names: &[String],
    joints: &[RobotJoint],
) -> Result<Vec<usize>, RobotError> {
    for (index, name) in names.iter().enumerate() {
        if names[..index].contains(name) {
            let place = Place::new(file, format!("link `{name}`"));
            return Err(
                place.invalid("two links name this joint; each link needs a joint of its own")
            );
        }
    }
    if let Some(joint) = joints.iter().find(|joint| !names.contains(&joint.name)) {
        let place = Place::new(file, format!("joint `{}`", joint.name));
        return Err(place.unknown("joint, no link moves with", &joint.name, names));
    }
    let position = |name: &String| {
        let missing = || {
            Place::new(file, format!("link `{name}`"))
                .invalid(format!("joint `{name}` has no [[joint]] table, add one"))
        };
        joints
            .iter()
            .position(|joint| joint.name == *name)
            .ok_or_else(missing)
    };
    names.iter().map(position).collect()
}

/// Checks the controller and brings its gains from the file's joint order into the chain's.
fn ordered_control(
    file: &str,
    mut control: Control,
    order: &[usize],
) -> Result<Control, RobotError> {
    check::control(file, &mut control, order.len())?;
    let in_chain_order = |gains: &[f64]| order.iter().map(|index| gains[*index]).collect();
    control.proportional_nm_rad = in_chain_order(&control.proportional_nm_rad);
    control.derivative_nm_s_rad = in_chain_order(&control.derivative_nm_s_rad);
    Ok(control)
}

fn rigid_link(file: &str, link: &LinkFile) -> Result<Link, RobotError> {
    let place = Place::new(file, format!("link `{}`", link.joint));
    check::numbers(&place, "origin_m", &link.origin_m, Must::BeFinite)?;
    check::numbers(
        &place,
        "origin_rpy_rad",
        &link.origin_rpy_rad,
        Must::BeFinite,
    )?;
    check::numbers(&place, "axis", &link.axis, Must::BeFinite)?;
    check::number(&place, "mass_kg", link.mass_kg, Must::NotBeNegative)?;
    check::numbers(
        &place,
        "centre_of_mass_m",
        &link.centre_of_mass_m,
        Must::BeFinite,
    )?;
    let i = link.inertia_kg_m2;
    check::numbers(
        &place,
        "inertia_kg_m2",
        &[i.xx, i.yy, i.zz, i.xy, i.yz, i.xz],
        Must::BeFinite,
    )?;
    let axis = Unit::try_new(Vector3::from(link.axis), 1e-9)
        .filter(|axis| axis.iter().all(|x| x.is_finite()))
        .ok_or_else(|| {
            place.invalid(format!(
                "axis = {:?} must have a length above zero",
                link.axis
            ))
        })?;
    Ok(Link {
        parent: None,
        kind: JointKind::Revolute,
        origin: isometry(link.origin_m, link.origin_rpy_rad),
        axis,
        mass_kg: link.mass_kg,
        centre_of_mass_m: Vector3::from(link.centre_of_mass_m),
        inertia_kg_m2: Matrix3::new(i.xx, i.xy, i.xz, i.xy, i.yy, i.yz, i.xz, i.yz, i.zz),
    })
}

fn isometry(origin_m: [f64; 3], rpy_rad: [f64; 3]) -> Isometry3<f64> {
    let [roll, pitch, yaw] = rpy_rad;
    Isometry3::from_parts(
        Translation3::from(origin_m),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

fn chain_error(file: &str, names: &[String], error: &ChainError) -> RobotError {
    let within = match error {
        ChainError::Mass { link, .. }
        | ChainError::Inertia { link }
        | ChainError::Geometry { link } => names
            .get(*link)
            .map_or(String::new(), |name| format!("link `{name}`")),
        _ => "top level".to_owned(),
    };
    Place::new(file, within).invalid(error.to_string())
}
