//! What a URDF or a MuJoCo model says of a robot, the same for both, and how links come of it: what is fixed or held becomes
//! one body with what carries it.

use std::collections::BTreeMap;

use joint_model::rigid_body::{JointKind, Link};
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::error::{Place, RobotError};
use crate::mass::MassProperties;
use crate::{Control, RobotJoint};

/// A robot as its description has it.
pub struct Model {
    pub name: String,
    /// Where the description says it.
    pub gravity_m_s2: Option<[f64; 3]>,
    /// Each after its parent.
    pub bodies: Vec<Body>,
    /// What drives the joints that [`Model::free_joints`] lists, in their order.
    pub control: Option<Control>,
    /// What was assumed or not read.
    pub notes: Vec<String>,
}

/// A body and what joins it to its parent.
pub struct Body {
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
    pub kind: JointKind,
    /// In the joint's frame.
    pub axis: Unit<Vector3<f64>>,
    pub mimic: Option<Mimic>,
    /// Name, limits, drive and nominal effects, as far as the description has them.
    pub drive: RobotJoint,
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

    pub fn joint(&self, name: &str) -> Option<&Joint> {
        self.joints().find(|joint| joint.drive.name == name)
    }

    /// The joints that are `wanted` with their links, and where each of the others is held.
    pub fn links(
        &self,
        place: &Place,
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
                    let position = self.held_position(place, joint, held, 0)?;
                    held_joints.push(HeldJoint {
                        name: joint.drive.name.clone(),
                        position,
                        mimics: joint.mimic.as_ref().map(|mimic| mimic.joint.clone()),
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
        Ok(Moving {
            names,
            links: lump(&parts).links,
            held: held_joints,
        })
    }

    /// Where a joint stands that is none of the robot's.
    fn held_position(
        &self,
        place: &Place,
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
        let leader = leader.filter(|_| followed < self.bodies.len());
        let leader = leader.ok_or_else(|| {
            place.invalid(format!(
                "joint `{}` mimics `{}`, which is no joint that moves by itself or by another",
                joint.drive.name, mimic.joint
            ))
        })?;
        let leading = self.held_position(place, leader, held, followed + 1)?;
        Ok(mimic.multiplier * leading + mimic.offset)
    }
}

/// What of a model moves, and what does not.
pub struct Moving {
    /// Of the joints, in the order of the links.
    pub names: Vec<String>,
    pub links: Vec<Link>,
    pub held: Vec<HeldJoint>,
}

/// A joint that does not move, and where it is held.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldJoint {
    pub name: String,
    /// rad or m.
    pub position: f64,
    pub mimics: Option<String>,
}

/// What holds are worth a note, all in one.
pub fn note_of_held(held: &[HeldJoint]) -> Option<String> {
    let one = |joint: &HeldJoint| match &joint.mimics {
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
