//! What a URDF or a MuJoCo model says of a robot, the same for both, and how links come of it: what is fixed or held becomes
//! one body with what carries it.

use std::collections::BTreeMap;

use joint_model::rigid_body::{JointKind, Link, is_inertia_of_a_body};
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::check;
use crate::error::{Place, RobotError};
use crate::links::{Reshaped, Reshaping};
use crate::mass::MassProperties;
use crate::{Control, ControlKind, Feedback, Feedforward, RobotJoint};

/// More bodies than any robot has; reading would take long with many more.
pub const BODIES_MAX: usize = 4096;

/// A joint that follows one that follows one, and so on, is followed so far.
const FOLLOWED_MAX: usize = 32;

/// A robot as its description has it.
pub struct Model {
    pub name: String,
    /// Where the description says it.
    pub gravity_m_s2: Option<[f64; 3]>,
    /// Each after its parent.
    pub bodies: Vec<Body>,
    /// Of the simulation whose model it is.
    pub timestep_s: Option<f64>,
    /// What an angle of 1 is.
    pub angle_rad: f64,
    /// What was assumed or not read.
    pub notes: Vec<String>,
}

/// A body and what joins it to its parent.
pub struct Body {
    /// Where it is described.
    pub place: Place,
    /// Byte of its file at which its element begins.
    pub at: usize,
    /// Index of the body that carries it, smaller than its own; `None` for the base.
    pub parent: Option<usize>,
    /// Its frame, which is the joint's, in the parent's frame, with the joint at zero.
    pub origin: Isometry3<f64>,
    /// `None` where it is fixed.
    pub joint: Option<Joint>,
    pub mass: MassProperties,
}

/// A joint that can move.
#[derive(Clone)]
pub struct Joint {
    /// Where it is described.
    pub place: Place,
    pub kind: JointKind,
    /// In the joint's frame.
    pub axis: Unit<Vector3<f64>>,
    pub mimic: Option<Mimic>,
    /// Name, limits, drive and nominal effects, as far as the description has them.
    pub drive: RobotJoint,
    /// What commands its torque.
    pub law: Option<Law>,
    /// Where its element stands.
    pub element: ElementOfJoint,
    /// What drives it.
    pub actuators: Vec<Actuator>,
}

/// Where a joint's element stands in its file and in its body.
#[derive(Clone, Default)]
pub struct ElementOfJoint {
    /// Byte at which it begins.
    pub at: usize,
    /// The joint's frame is so far from the body's.
    pub anchor_m: Vector3<f64>,
    /// Whether another joint of the same body follows it.
    pub is_followed: bool,
}

/// An actuator of a MuJoCo model, with what its class says.
#[derive(Clone)]
pub struct Actuator {
    /// Byte of its file at which its element begins.
    pub at: usize,
    pub tag: String,
    /// `None` where it is not one that is read.
    pub kind: Option<ControlKind>,
    pub gear: Vec<f64>,
    pub kp: Option<f64>,
    pub kv: Option<f64>,
    pub gain: Vec<f64>,
    pub bias: Vec<f64>,
    pub force_range: Option<[f64; 2]>,
    pub delay_s: f64,
}

/// A law of control with its gains, at the joint.
#[derive(Clone)]
pub struct Law {
    pub kind: ControlKind,
    pub proportional: f64,
    pub derivative: f64,
}

/// `position = multiplier·(the other's position) + offset`.
#[derive(Clone)]
pub struct Mimic {
    pub joint: String,
    pub multiplier: f64,
    pub offset: f64,
}

impl Model {
    pub fn joints(&self) -> impl Iterator<Item = &Joint> {
        self.bodies.iter().filter_map(|body| body.joint.as_ref())
    }

    /// The joints that move by themselves.
    pub fn free_joints(&self) -> impl Iterator<Item = &Joint> {
        self.joints().filter(|joint| joint.mimic.is_none())
    }

    pub fn joint_names(&self) -> Vec<String> {
        let names = self.joints().map(|joint| joint.drive.name.clone());
        names.collect()
    }

    pub fn joint(&self, name: &str) -> Option<&Joint> {
        self.joints().find(|joint| joint.drive.name == name)
    }

    /// The controller of these joints, where their laws are of one kind. A simulation's acts at once, on the joint itself.
    pub fn control_of(&self, joints: &[RobotJoint]) -> Option<Control> {
        let law = |joint: &RobotJoint| self.joint(&joint.name)?.law.as_ref();
        let mut laws = joints.iter().filter_map(law);
        let kind = laws.next()?.kind;
        if kind == ControlKind::Unknown || laws.any(|law| law.kind != kind) {
            return None;
        }
        let gains = |gain: fn(&Law) -> f64| {
            let all = joints.iter().map(|joint| law(joint).map_or(0.0, gain));
            all.collect()
        };
        Some(Control {
            rate_hz: 1.0 / self.timestep_s?,
            kind,
            proportional_nm_rad: gains(|law| law.proportional),
            derivative_nm_s_rad: gains(|law| law.derivative),
            feedback: Feedback::Link,
            feedforward: Feedforward::None,
            velocity_filter_hz: 0.0,
            velocity_filter_order: 1,
            delay_cycles: 0,
        })
    }

    /// The joints that are `wanted` with their links, and where each of the others is held.
    pub fn links(
        &self,
        wanted: impl Fn(&str) -> bool,
        held: &BTreeMap<String, f64>,
    ) -> Result<Moving, RobotError> {
        let mut names = Vec::new();
        let mut held_joints = Vec::new();
        let mut parts = Vec::new();
        for body in &self.bodies {
            let movement = match &body.joint {
                None => Movement::None,
                Some(joint) if wanted(&joint.drive.name) => {
                    names.push(joint.drive.name.clone());
                    Movement::Joint(joint.kind, joint.axis)
                }
                Some(joint) => {
                    let position = self.held_position(joint, held, 0)?;
                    held_joints.push(HeldJoint {
                        name: joint.drive.name.clone(),
                        position,
                        mimics: joint.mimic.as_ref().map(|mimic| mimic.joint.clone()),
                        leader_moves: joint
                            .mimic
                            .as_ref()
                            .is_some_and(|mimic| wanted(&mimic.joint)),
                    });
                    Movement::Held(joint.kind, joint.axis, position)
                }
            };
            parts.push(Part {
                parent: body.parent,
                origin: body.origin,
                movement,
                mass: body.mass,
            });
        }
        let Lumped { links, places } = lump(&parts);
        Ok(Moving {
            names,
            links,
            held: held_joints,
            places,
        })
    }

    /// Bodies that move and swing as no part of a robot does, where they have more inertia than all others together.
    pub fn notes_of_wide(&self, moving: &Moving) -> Vec<String> {
        let bodies = self.bodies.iter().zip(&moving.places);
        let moved = bodies.filter(|(_, (carrier, _))| carrier.is_some());
        let moved: Vec<(&Body, f64)> = moved
            .map(|(body, _)| (body, body.mass.largest_inertia_kg_m2()))
            .collect();
        let all: f64 = moved.iter().map(|(_, largest)| largest).sum();
        let most = moved.into_iter().filter(|(_, own)| *own > all - own);
        most.filter_map(|(body, _)| Some(format!("{}: {}", body.place, body.mass.told_if_wide()?)))
            .collect()
    }

    /// The bodies that links are made of, each with its link and what its own mass properties come to, where `held` says how the other joints
    /// stand.
    pub fn reshaped<'a>(
        &'a self,
        held: &BTreeMap<String, f64>,
        by: &'a Reshaping,
    ) -> Result<Vec<(&'a Body, &'a Reshaped, MassProperties)>, RobotError> {
        let moving = self.links(|name| by.names.iter().any(|own| own == name), held)?;
        let bodies = self.bodies.iter().zip(&moving.places);
        let parts = bodies.filter_map(|(body, (carrier, frame))| {
            let link = by.links.get((*carrier)?)?;
            Some((body, link, link.body(&body.mass, frame)))
        });
        Ok(parts.collect())
    }

    /// Where an inertia is described that makes a link none that a body can have.
    pub fn culprit(&self, moving: &Moving, link: usize) -> Option<&Place> {
        let bodies = self.bodies.iter().zip(&moving.places);
        let mut parts = bodies.filter(|(_, (carrier, _))| *carrier == Some(link));
        parts
            .find(|(body, _)| !is_inertia_of_a_body(&body.mass.inertia_kg_m2))
            .map(|(body, _)| &body.place)
    }

    /// Gives joints names that recordings can have in their headings, and says so.
    pub fn make_names_usable(&mut self) {
        let names = self.joint_names();
        for name in names.iter().filter(|name| !check::is_usable_name(name)) {
            let mut usable: String = name
                .chars()
                .map(|c| if check::is_usable_in_name(c) { c } else { '_' })
                .collect();
            while usable.is_empty() || names.contains(&usable) {
                usable.push('_');
            }
            self.notes.push(format!(
                "joint {name:?} is called `{usable}`: recordings' headings have no spaces, commas, dots and quotes in a name"
            ));
            for joint in self
                .bodies
                .iter_mut()
                .filter_map(|body| body.joint.as_mut())
            {
                if joint.drive.name == *name {
                    joint.drive.name.clone_from(&usable);
                }
                if let Some(mimic) = joint.mimic.as_mut().filter(|mimic| mimic.joint == *name) {
                    mimic.joint.clone_from(&usable);
                }
            }
        }
    }

    /// Where a joint stands that is none of the robot's.
    fn held_position(
        &self,
        joint: &Joint,
        held: &BTreeMap<String, f64>,
        followed: usize,
    ) -> Result<f64, RobotError> {
        if let Some(position) = held.get(&joint.drive.name) {
            return Ok(*position);
        }
        let Some(mimic) = &joint.mimic else {
            return Ok(0.0);
        };
        let leader = self.joint(&mimic.joint);
        let leader = leader.filter(|_| followed < FOLLOWED_MAX);
        let leader = leader.ok_or_else(|| {
            joint.place.invalid(format!(
                "mimics `{}`, which is no joint that moves by itself or by another",
                mimic.joint
            ))
        })?;
        let leading = self.held_position(leader, held, followed + 1)?;
        Ok(mimic.multiplier * leading + mimic.offset)
    }
}

/// What of a model moves, and what does not.
pub struct Moving {
    /// Of the joints, in the order of the links.
    pub names: Vec<String>,
    pub links: Vec<Link>,
    pub held: Vec<HeldJoint>,
    /// The link that each of the model's bodies is part of, `None` for the base, and the body's frame in it.
    places: Vec<(Option<usize>, Isometry3<f64>)>,
}

/// A joint that does not move, and where it is held.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldJoint {
    pub name: String,
    /// rad or m.
    pub position: f64,
    pub mimics: Option<String>,
    /// It would move with it, and does not.
    pub leader_moves: bool,
}

/// What holds are worth a note, all in one.
pub fn note_of_held(held: &[HeldJoint]) -> Option<String> {
    let one = |joint: &HeldJoint| match &joint.mimics {
        Some(leader) if joint.leader_moves => format!(
            "`{}` at {} (mimics `{leader}`, which moves: its mass stays there)",
            joint.name, joint.position
        ),
        Some(leader) => format!("`{}` at {} (mimics `{leader}`)", joint.name, joint.position),
        None => format!("`{}` at {}", joint.name, joint.position),
    };
    let all: Vec<String> = held.iter().map(one).collect();
    (!all.is_empty()).then(|| format!("held, as part of what carries them: {}", all.join(", ")))
}

/// One body of many that are to be lumped.
pub struct Part {
    pub parent: Option<usize>,
    pub origin: Isometry3<f64>,
    pub movement: Movement,
    pub mass: MassProperties,
}

/// How a part may move against its parent.
pub enum Movement {
    None,
    Joint(JointKind, Unit<Vector3<f64>>),
    /// At this position, which is rad or m.
    Held(JointKind, Unit<Vector3<f64>>, f64),
}

/// Links, and where each part went.
pub struct Lumped {
    pub links: Vec<Link>,
    /// The link of each part, none for the base, and the part's frame in it.
    pub places: Vec<(Option<usize>, Isometry3<f64>)>,
}

/// Adds up what does not move. What is fixed to the base is left out: no joint feels it.
pub fn lump(parts: &[Part]) -> Lumped {
    let mut places: Vec<(Option<usize>, Isometry3<f64>)> = Vec::with_capacity(parts.len());
    let mut links: Vec<Link> = Vec::new();
    let mut masses: Vec<Vec<MassProperties>> = Vec::new();
    for part in parts {
        let (carrier, frame) = part
            .parent
            .map_or((None, Isometry3::identity()), |parent| places[parent]);
        let origin = frame * part.origin;
        let place = match part.movement {
            Movement::None => (carrier, origin),
            Movement::Held(kind, axis, position) => {
                (carrier, origin * moved(kind, &axis, position))
            }
            Movement::Joint(kind, axis) => {
                links.push(Link {
                    parent: carrier,
                    kind,
                    origin,
                    axis,
                    mass_kg: 0.0,
                    centre_of_mass_m: Vector3::zeros(),
                    inertia_kg_m2: nalgebra::Matrix3::zeros(),
                });
                masses.push(Vec::new());
                (Some(links.len() - 1), Isometry3::identity())
            }
        };
        if let Some(link) = place.0.filter(|_| part.mass != MassProperties::none()) {
            masses[link].push(part.mass.seen_from(&place.1));
        }
        places.push(place);
    }
    for (link, parts) in links.iter_mut().zip(&masses) {
        let whole = MassProperties::sum(parts);
        link.mass_kg = whole.mass_kg;
        link.centre_of_mass_m = whole.centre_m;
        link.inertia_kg_m2 = whole.inertia_kg_m2;
    }
    Lumped { links, places }
}

/// What a joint does to its link's frame.
pub fn moved(kind: JointKind, axis: &Unit<Vector3<f64>>, position: f64) -> Isometry3<f64> {
    match kind {
        JointKind::Revolute => Isometry3::from_parts(
            Translation3::identity(),
            UnitQuaternion::from_axis_angle(axis, position),
        ),
        JointKind::Prismatic => Translation3::from(axis.into_inner() * position).into(),
    }
}
