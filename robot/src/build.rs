//! From a robot file to the robot: its description read, its joints matched, everything checked.

use std::fs;
use std::path::Path;

use joint_model::rigid_body::{Chain, ChainError, JointKind, LINKS_MAX};
use nalgebra::{Matrix3, Unit, Vector3};

use crate::check::{self, Must};
use crate::description::Description;
use crate::error::{Place, RobotError};
use crate::file::{LinkFile, LinkKind, RobotFile, RobotJoint, down};
use crate::mass::{MassProperties, isometry};
use crate::model::{Body, ElementOfJoint, Joint, Model, note_of_held};
use crate::{Control, Effect, Robot, Source};

/// What no fit and no simulation can do anything with.
const NO_BODY: &str = "no body has this inertia: each principal moment must be at least zero and at most the sum of the other two, about the centre of mass; correct it";

impl RobotFile {
    /// Checks the file and makes the robot. The source names the file in errors, and a URDF or a MuJoCo model is read
    /// beside it.
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
        let mut model = self.model(&file, &source)?;
        self.complete(&file, &model)?;
        // whoever writes a link by hand means its joint
        let means_all = !self.links.is_empty();
        let wanted = |name: &str| {
            self.joints.iter().any(|joint| joint.name == name)
                || (means_all && !self.held.contains_key(name))
        };
        let moving = model.links(wanted, &self.held)?;
        let order = match_joints(&file, &moving.names, &self.joints, &model)?;
        let mut notes = std::mem::take(&mut model.notes);
        notes.extend(model.notes_of_wide(&moving));
        notes.extend(note_of_held(&moving.held));
        let control = self
            .control
            .take()
            .filter(|control| !control.is_silent())
            .map(|control| ordered_control(&file, control, &order))
            .transpose()?;
        let tool = isometry(self.tool_origin_m, self.tool_origin_rpy_rad);
        let names = &moving.names;
        let chain =
            Chain::new(&moving.links, Vector3::from(self.gravity_m_s2), tool).map_err(|error| {
                match error {
                    ChainError::Inertia { link } => {
                        let own = chain_error(&file, names, &error);
                        let culprit = model.culprit(&moving, link);
                        culprit.map_or(own, |place| place.invalid(NO_BODY))
                    }
                    _ => chain_error(&file, names, &error),
                }
            })?;
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
            drive: self.drive,
            tolerance: self.parameter_tolerance,
            source,
            notes,
        };
        robot
            .loaded_chain()
            .map_err(|error| chain_error(&file, names, &error))?;
        Ok(robot)
    }

    /// The rigid bodies and what else their description says.
    pub(crate) fn model(&self, file: &str, source: &Source) -> Result<Model, RobotError> {
        let top = Place::new(file, "top level");
        let named = [
            (Description::Urdf, &self.urdf),
            (Description::Mjcf, &self.mjcf),
        ];
        let mut named = named
            .into_iter()
            .filter_map(|(kind, path)| Some((kind, path.as_ref()?)));
        match (named.next(), named.next(), self.links.is_empty()) {
            (Some(_), Some(_), _) => {
                Err(top.invalid("there are both urdf and mjcf; remove one of them"))
            }
            (Some((kind, _)), None, false) => Err(top.invalid(format!(
                "there are both {} and [[link]] tables; remove one of them",
                kind.key()
            ))),
            (None, _, true) => {
                Err(top
                    .invalid("there is neither urdf, mjcf nor a [[link]] table; add one of them"))
            }
            (None, _, false) => model_of_links(file, &self.links),
            (Some((kind, path)), None, true) => {
                let key = kind.key();
                let Source::File(robot_file) = source else {
                    return Err(top.invalid(format!(
                        "a shipped robot has no folder to find {key} in; use [[link]] tables"
                    )));
                };
                let whole = robot_file.parent().unwrap_or(Path::new("")).join(path);
                let text = read_beside(&whole, file, &format!("{key} = {path:?}"))?;
                kind.read(&text, &whole)
            }
        }
    }

    /// Fills in what the description says and the file does not; without any `[[joint]]` table every joint that moves by
    /// itself is one.
    fn complete(&mut self, file: &str, model: &Model) -> Result<(), RobotError> {
        let movable = model.joint_names();
        let place = Place::new(file, "held");
        for (name, position) in &self.held {
            if !movable.contains(name) {
                return Err(place.unknown("joint", name, &movable));
            }
            check::number(&place, name, *position, Must::BeFinite)?;
            if self.joints.iter().any(|joint| joint.name == *name) {
                return Err(place.invalid(format!(
                    "joint `{name}` has a [[joint]] table too; remove it here or there"
                )));
            }
        }
        if self.joints.is_empty() {
            let free = model.free_joints().map(|joint| joint.drive.clone());
            self.joints = free
                .filter(|drive| !self.held.contains_key(&drive.name))
                .collect();
        }
        if self.joints.is_empty() || self.joints.len() > LINKS_MAX {
            let count = self.joints.len();
            return Err(Place::new(file, "top level").invalid(format!(
                "the robot has {count} joints of 1 to {LINKS_MAX}; list those that are meant in [[joint]] tables, the others are held"
            )));
        }
        check_joints(file, &self.joints)?;
        for joint in &mut self.joints {
            if let Some(known) = model.joint(&joint.name) {
                joint.fill_from(&known.drive);
            }
        }
        if self.control.is_none() {
            self.control = model.control_of(&self.joints);
        }
        if let Some(gravity_m_s2) = model.gravity_m_s2.filter(|_| self.gravity_m_s2 == down()) {
            self.gravity_m_s2 = gravity_m_s2;
        }
        Ok(())
    }
}

impl RobotJoint {
    /// Takes over what a description knows of the joint where this says nothing.
    fn fill_from(&mut self, known: &Self) {
        let ratio = known.gear_ratio / self.gear_ratio;
        self.position_limit_rad = self.position_limit_rad.or(known.position_limit_rad);
        self.velocity_limit_rad_s = self.velocity_limit_rad_s.or(known.velocity_limit_rad_s);
        self.torque_limit_nm = self
            .torque_limit_nm
            .or(known.torque_limit_nm.map(|limit_nm| limit_nm * ratio));
        if self.rotor_inertia_kg_m2 == 0.0 {
            self.rotor_inertia_kg_m2 = known.rotor_inertia_kg_m2 * ratio.powi(2);
        }
        let is_friction = |effect: &Effect| {
            matches!(
                effect,
                Effect::CoulombFriction { .. } | Effect::ViscousFriction { .. }
            )
        };
        let stated = |effect: &Effect| {
            (is_friction(effect) && self.direction_friction.is_some())
                || self.effects.iter().any(|own| own.name() == effect.name())
        };
        let added: Vec<Effect> = known
            .effects
            .iter()
            .filter(|effect| !stated(effect))
            .copied()
            .collect();
        self.effects.extend(added);
        let mut described = known.effects.iter().filter(|effect| is_friction(effect));
        self.friction_is_a_simulators = described.any(|effect| self.effects.contains(effect));
    }
}

/// Reads a file that another one names.
pub fn read_beside(path: &Path, named_by: &str, as_what: &str) -> Result<String, RobotError> {
    let bytes = fs::read(path).map_err(|error| RobotError::Read {
        file: path.display().to_string(),
        reason: error.to_string(),
        hint: format!("; {named_by} names it as {as_what}, relative to itself"),
    })?;
    // bytes that are no UTF-8 are somebody's name in a comment, more often than not
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

fn check_joints(file: &str, joints: &[RobotJoint]) -> Result<(), RobotError> {
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
    model: &Model,
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
        let known = model.joint_names();
        return Err(place.unknown("joint, no link moves with", &joint.name, &known));
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

/// Link after link, each on the one before it unless it says otherwise.
fn model_of_links(file: &str, links: &[LinkFile]) -> Result<Model, RobotError> {
    let bodies = links.iter().enumerate();
    Ok(Model {
        name: String::new(),
        gravity_m_s2: None,
        bodies: bodies
            .map(|(index, link)| body(file, link, parent_of(file, links, index)?))
            .collect::<Result<_, _>>()?,
        timestep_s: None,
        angle_rad: 1.0,
        notes: Vec::new(),
    })
}

fn parent_of(file: &str, links: &[LinkFile], index: usize) -> Result<Option<usize>, RobotError> {
    let Some(parent) = &links[index].parent else {
        return Ok(index.checked_sub(1));
    };
    let before = &links[..index];
    match before.iter().position(|link| link.joint == *parent) {
        Some(parent) => Ok(Some(parent)),
        None if parent == "base" => Ok(None),
        None => {
            let place = Place::new(file, format!("link `{}`", links[index].joint));
            let names = before.iter().map(|link| link.joint.clone());
            let known: Vec<String> = names.chain(["base".to_owned()]).collect();
            Err(place.unknown("parent among the links before it", parent, &known))
        }
    }
}

fn body(file: &str, link: &LinkFile, parent: Option<usize>) -> Result<Body, RobotError> {
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
    Ok(Body {
        place: place.clone(),
        at: 0,
        parent,
        origin: isometry(link.origin_m, link.origin_rpy_rad),
        joint: Some(Joint {
            place,
            kind: match link.kind {
                LinkKind::Revolute => JointKind::Revolute,
                LinkKind::Prismatic => JointKind::Prismatic,
            },
            axis,
            mimic: None,
            drive: RobotJoint::named(&link.joint),
            law: None,
            element: ElementOfJoint::default(),
            actuators: Vec::new(),
        }),
        mass: MassProperties {
            mass_kg: link.mass_kg,
            centre_m: Vector3::from(link.centre_of_mass_m),
            inertia_kg_m2: Matrix3::new(i.xx, i.xy, i.xz, i.xy, i.yy, i.yz, i.xz, i.yz, i.zz),
        },
    })
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
