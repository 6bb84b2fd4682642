//! Links that weigh other than a file says, and what then becomes of all that each is made of: bodies that are fixed to each other or held,
//! a payload, added inertia.
//!
//! A link's mass, centre and inertia are sums, and nothing tells which body they are wrong of. So all are treated alike: masses by one
//! factor `f`, and distances from the centre by one scale `s`: `m' = f·m`, `x' = c' + s·(x - c)`, `I' = f·s²·I`. The sums come out as
//! they are meant, and what was a body is one still, however its link is put together.

use joint_model::rigid_body::{Chain, Link};
use nalgebra::{Isometry3, Point3, Vector3};

use crate::apply::{changed, short};
use crate::error::{Place, RobotError};
use crate::mass::MassProperties;
use crate::{Effect, Robot};

/// By what a link differs from the robot's, its effects on bodies included.
#[derive(Clone, Debug, PartialEq)]
pub struct MassChange {
    /// The joint that moves the link.
    pub joint: String,
    /// More than it weighs.
    pub mass_kg: f64,
    /// Along the link's axes.
    pub centre_of_mass_m: [f64; 3],
    /// About the centre of mass, as a part of what it is.
    pub inertia_part: f64,
}

/// What becomes of all that one link is made of.
#[derive(Clone, Debug)]
pub(crate) struct Reshaped {
    link: Link,
    /// Masses times this.
    mass: f64,
    /// Inertias about their own centres times this.
    pub inertia: f64,
    moved_m: Vector3<f64>,
}

impl Reshaped {
    fn of(link: &Link, change: &MassChange) -> Result<Self, String> {
        let part = match change.mass_kg {
            0.0 => 0.0,
            added_kg => added_kg / link.mass_kg,
        };
        let moved_m = Vector3::from(change.centre_of_mass_m);
        let (mass, inertia) = (1.0 + part, 1.0 + change.inertia_part);
        let is_body = |factor: f64| factor.is_finite() && factor > 0.0;
        if is_body(mass) && is_body(inertia) && moved_m.iter().all(|x| x.is_finite()) {
            return Ok(Self {
                link: *link,
                mass,
                inertia,
                moved_m,
            });
        }
        Err(format!(
            "{} kg more than its {} kg and {} times its inertia is no body; correct the report's links, or diagnose again",
            short(change.mass_kg),
            short(link.mass_kg),
            short(inertia)
        ))
    }

    /// A body that is part of the link, in a frame that stands so in the link's.
    pub fn body(&self, mass: &MassProperties, frame: &Isometry3<f64>) -> MassProperties {
        MassProperties {
            mass_kg: self.mass * mass.mass_kg,
            centre_m: self.place_m(mass.centre_m, frame),
            inertia_kg_m2: self.inertia * mass.inertia_kg_m2,
        }
    }

    fn place_m(&self, place_m: Vector3<f64>, frame: &Isometry3<f64>) -> Vector3<f64> {
        let from_centre_m = (frame * Point3::from(place_m)).coords - self.link.centre_of_mass_m;
        let farther = (self.inertia / self.mass).sqrt() - 1.0;
        place_m + frame.rotation.inverse() * (self.moved_m + farther * from_centre_m)
    }

    fn told(&self) -> String {
        let vector = |of: Vector3<f64>| of.iter().map(|x| short(*x)).collect::<Vec<_>>().join(" ");
        let centre_m = self.link.centre_of_mass_m;
        format!(
            "{}, centre_of_mass_m {} -> {}, inertia_kg_m2 times {}",
            changed("mass_kg", self.link.mass_kg, self.mass * self.link.mass_kg),
            vector(centre_m),
            vector(centre_m + self.moved_m),
            short(self.inertia)
        )
    }
}

/// What becomes of a robot's links.
#[derive(Clone, Debug)]
pub struct Reshaping {
    /// Of the joints whose links they are.
    pub(crate) names: Vec<String>,
    pub(crate) links: Vec<Reshaped>,
    /// For each of the robot's links: which it is part of, and its frame in that one.
    places: Vec<(Option<usize>, Isometry3<f64>)>,
    slides: Vec<bool>,
    /// Of the last link's frame, in which payloads are.
    last: Isometry3<f64>,
}

impl Reshaping {
    /// Joint by joint, what its link comes to, in words.
    pub fn told(&self) -> impl Iterator<Item = (&str, String)> {
        let names = self.names.iter().map(String::as_str);
        names.zip(self.links.iter().map(Reshaped::told))
    }

    /// What an effect of a joint of the robot, or of the whole arm, comes to as part of its link.
    pub fn effect(&self, joint: Option<usize>, effect: &Effect) -> Effect {
        let carrier = |joint: usize| self.links.get(self.places.get(joint)?.0?);
        match (*effect, joint, self.links.last()) {
            (Effect::Payload { mass_kg, centre_m }, _, Some(last)) => Effect::Payload {
                mass_kg: last.mass * mass_kg,
                centre_m: last.place_m(centre_m.into(), &self.last).into(),
            },
            (Effect::LinkInertia { inertia_kg_m2 }, Some(joint), _) => {
                // what resists acceleration along an axis is mass
                let factor = carrier(joint).map_or(1.0, |link| match self.slides[joint] {
                    true => link.mass,
                    false => link.inertia,
                });
                Effect::LinkInertia {
                    inertia_kg_m2: factor * inertia_kg_m2,
                }
            }
            _ => *effect,
        }
    }
}

impl Robot {
    /// What becomes of its links by changes of those that move where only these joints do.
    ///
    /// # Errors
    /// [`RobotError`] for a joint that the robot does not have, and for what no body can be.
    pub fn reshaping(&self, changes: &[MassChange]) -> Result<Reshaping, RobotError> {
        let place = Place::new(&self.name, "");
        let known = || {
            self.joints
                .iter()
                .map(|joint| joint.name.clone())
                .collect::<Vec<_>>()
        };
        let names: Vec<&str> = changes.iter().map(|change| change.joint.as_str()).collect();
        if let Some(unknown) = names.iter().find(|name| self.joint_index(name).is_none()) {
            return Err(place.unknown("joint", unknown, &known()));
        }
        let moving = self.moving_only(&names)?;
        let chain = moving.loaded_chain();
        let chain = chain.map_err(|error| place.invalid(error.to_string()))?;
        let own = moving.joints.iter().zip(chain.links());
        let links = own.filter_map(|(joint, link)| {
            let change = changes.iter().find(|change| change.joint == joint.name)?;
            let refuse =
                |reason| Place::new(&self.name, format!("link `{}`", joint.name)).invalid(reason);
            Some(Reshaped::of(link, change).map_err(refuse))
        });
        let lumped = self.lumped(&|index| names.contains(&self.joints[index].name.as_str()));
        Ok(Reshaping {
            links: links.collect::<Result<_, _>>()?,
            names: moving
                .joints
                .iter()
                .map(|joint| joint.name.clone())
                .collect(),
            slides: (0..self.joints.len())
                .map(|joint| self.slides(joint))
                .collect(),
            last: crate::hold::last_frame(&lumped).unwrap_or_default(),
            places: lumped.places,
        })
    }

    /// The robot with these links, and with its effects as parts of them.
    ///
    /// # Errors
    /// [`RobotError`] for what no body can be.
    pub fn reshaped(&self, by: &Reshaping) -> Result<Self, RobotError> {
        let own = self.chain.links().iter().zip(&by.places);
        let links: Vec<Link> = own
            .map(
                |(link, (carrier, frame))| match carrier.and_then(|of| by.links.get(of)) {
                    None => *link,
                    Some(carrier) => {
                        let body = carrier.body(&MassProperties::of(link), frame);
                        Link {
                            mass_kg: body.mass_kg,
                            centre_of_mass_m: body.centre_m,
                            inertia_kg_m2: body.inertia_kg_m2,
                            ..*link
                        }
                    }
                },
            )
            .collect();
        let chain = Chain::new(&links, self.chain.gravity_m_s2(), self.chain.tool());
        let mut robot = Self {
            chain: chain.map_err(|error| Place::new(&self.name, "").invalid(error.to_string()))?,
            ..self.clone()
        };
        for (index, joint) in robot.joints.iter_mut().enumerate() {
            for effect in &mut joint.effects {
                *effect = by.effect(Some(index), effect);
            }
        }
        for effect in &mut robot.shared_effects {
            *effect = by.effect(None, effect);
        }
        Ok(robot)
    }
}
