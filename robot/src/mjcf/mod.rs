//! MuJoCo models (MJCF): bodies, joints, masses and actuators, as MuJoCo's own compiler understands them.
//!
//! Source: the MJCF reference of MuJoCo's documentation. Kinematics and dynamics are ours: contact, tendons, equality
//! constraints and fluids are not read. What a model says beyond that is listed in the notes.

mod actuators;
mod classes;
mod compiler;
mod frames;
mod geoms;
mod include;
mod joints;
mod unread;

use std::path::Path;

pub use self::include::inlined;

use nalgebra::{Isometry3, Matrix3, Vector3};

use self::classes::{Classes, View};
use self::compiler::Compiler;
use crate::error::RobotError;
use crate::mass::MassProperties;
use crate::model::{BODIES_MAX, Body, Model};
use crate::xml::Element;

/// Reads the model's text; files that it includes are looked for beside `path`.
pub fn read(text: &str, path: &Path) -> Result<Model, RobotError> {
    let root = include::read(text, path)?;
    if root.tag() != "mujoco" {
        return Err(root.invalid(format!(
            "not a MuJoCo model: the first element is <{}>, not <mujoco>",
            root.tag()
        )));
    }
    let compiler = Compiler::of(&root)?;
    let mut reader = Reader {
        classes: Classes::of(&root)?,
        model: Model {
            name: root.attribute("model").unwrap_or("robot").to_owned(),
            gravity_m_s2: Some(compiler.gravity_m_s2),
            bodies: Vec::new(),
            timestep_s: Some(compiler.timestep_s),
            angle_rad: compiler.angle_rad,
            notes: Vec::new(),
        },
        compiler,
    };
    for world in root.all("worldbody") {
        let base = Place {
            parent: None,
            frame: Isometry3::identity(),
            moves: false,
        };
        reader.children(world, base, None)?;
    }
    if reader.model.joints().next().is_none() {
        return Err(root.invalid("no hinge or slide joint; a robot needs at least one"));
    }
    reader.check_names()?;
    reader.compiler.total_mass(&mut reader.model);
    let autolimits = reader.compiler.autolimits;
    actuators::read(&root, &reader.classes, autolimits, &mut reader.model)?;
    joints::couple(&root, &mut reader.model)?;
    unread::note(&root, &mut reader.model.notes);
    Ok(reader.model)
}

struct Reader<'a> {
    classes: Classes<'a>,
    compiler: Compiler,
    model: Model,
}

/// What new bodies hang on.
#[derive(Clone, Copy)]
struct Place {
    /// Index in the model's bodies; `None` for the base.
    parent: Option<usize>,
    /// The frame around, in the parent's.
    frame: Isometry3<f64>,
    /// Whether any joint lies between it and the base.
    moves: bool,
}

impl<'a> Reader<'a> {
    /// Bodies in a body, a frame or the world; nesting is bounded by the reader of XML.
    fn children(
        &mut self,
        around: &'a Element,
        place: Place,
        class: Option<&'a str>,
    ) -> Result<(), RobotError> {
        for child in around.children() {
            let class = child.attribute("childclass").or(class);
            match child.tag() {
                "body" => self.body(child, place, class)?,
                "frame" => {
                    let frame = place.frame * frames::pose(&View::of(child), &self.compiler)?;
                    self.children(child, Place { frame, ..place }, class)?;
                }
                "replicate" | "attach" | "composite" | "flexcomp" => {
                    let words = format!("<{}> is not read: its bodies are missing", child.tag());
                    self.model.notes.push(child.note(&words));
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn body(
        &mut self,
        body: &'a Element,
        place: Place,
        class: Option<&'a str>,
    ) -> Result<(), RobotError> {
        if self.model.bodies.len() > BODIES_MAX {
            return Err(body.invalid(format!("more than {BODIES_MAX} bodies")));
        }
        let mut parts = Parts::default();
        parts.gather(body, Isometry3::identity(), class, &self.compiler)?;
        let pose = place.frame * frames::pose(&View::of(body), &self.compiler)?;
        let joints = self.joints(body, &parts)?;
        let moves = place.moves || !joints.is_empty();
        // masses that nothing carries around matter to nobody, nor do they need to be known
        let mass = if moves || self.compiler.weighs_everything() {
            let mass = self.mass(body, &parts)?;
            if !joint_model::rigid_body::is_inertia_of_a_body(&mass.inertia_kg_m2) {
                let words = "doubtful: no body has this inertia";
                self.model.notes.push(body.note(words));
            }
            mass
        } else {
            MassProperties::none()
        };
        // each joint a body of its own, with its frame where the joint is
        let (mut parent, mut from_parent) = (place.parent, pose);
        let count = joints.len();
        for (number, (mut joint, anchor, at_zero)) in joints.into_iter().enumerate() {
            let is_last = number + 1 == count;
            let from_anchor = anchor.inverse();
            joint.element.anchor_m = anchor.translation.vector;
            joint.element.is_followed = !is_last;
            self.model.bodies.push(Body {
                place: body.place(),
                at: body.at(),
                parent,
                origin: from_parent * anchor * at_zero,
                joint: Some(joint),
                mass: if is_last {
                    mass.seen_from(&from_anchor)
                } else {
                    MassProperties::none()
                },
            });
            parent = Some(self.model.bodies.len() - 1);
            from_parent = from_anchor;
        }
        if count == 0 {
            self.model.bodies.push(Body {
                place: body.place(),
                at: body.at(),
                parent,
                origin: from_parent,
                joint: None,
                mass,
            });
            parent = Some(self.model.bodies.len() - 1);
            from_parent = Isometry3::identity();
        }
        let inside = Place {
            parent,
            frame: from_parent,
            moves,
        };
        self.children(body, inside, class)
    }

    /// The body's `<inertial>`, or what its geoms weigh.
    fn mass(&self, body: &'a Element, parts: &Parts<'a>) -> Result<MassProperties, RobotError> {
        let mass = match (body.child("inertial"), self.compiler.weighs_geoms_of(body)) {
            (Some(inertial), false) => self.inertial(inertial)?,
            (_, true) => {
                let geoms = parts.geoms.iter().map(|(geom, frame, class)| {
                    let view = self.classes.view(geom, *class)?;
                    let mass = geoms::mass(&view, &self.compiler)?;
                    Ok(mass.map(|mass| mass.seen_from(frame)))
                });
                let geoms: Vec<_> = geoms
                    .filter_map(Result::transpose)
                    .collect::<Result<_, _>>()?;
                MassProperties::sum(&geoms)
            }
            (None, false) => MassProperties::none(),
        };
        self.compiler.bounded(mass, body)
    }

    fn inertial(&self, inertial: &Element) -> Result<MassProperties, RobotError> {
        let mass_kg = inertial.number("mass")?;
        let mass_kg = mass_kg.ok_or_else(|| inertial.invalid("mass is missing, add it"))?;
        if mass_kg < 0.0 {
            return Err(inertial.invalid(format!("mass {mass_kg} kg must be zero or above")));
        }
        let diagonal = inertial.numbers::<3>("diaginertia")?;
        let full = inertial.numbers::<6>("fullinertia")?;
        let inertia_kg_m2 = match (full, diagonal) {
            (Some([xx, yy, zz, xy, xz, yz]), _) => Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
            (None, diagonal) => Matrix3::from_diagonal(&diagonal.unwrap_or_default().into()),
        };
        let about_itself = MassProperties {
            mass_kg,
            centre_m: Vector3::zeros(),
            inertia_kg_m2,
        };
        Ok(about_itself.seen_from(&frames::pose(&View::of(inertial), &self.compiler)?))
    }

    fn check_names(&self) -> Result<(), RobotError> {
        let mut names: Vec<&str> = Vec::new();
        for joint in self.model.joints() {
            let name = joint.drive.name.as_str();
            if names.contains(&name) {
                return Err(joint.place.invalid(format!(
                    "two joints are called `{name}`; give each its own name"
                )));
            }
            names.push(name);
        }
        Ok(())
    }
}

/// Joints and geoms of one body with the class around them, those in its frames too.
#[derive(Default)]
struct Parts<'a> {
    joints: Vec<(&'a Element, Isometry3<f64>, Option<&'a str>)>,
    geoms: Vec<(&'a Element, Isometry3<f64>, Option<&'a str>)>,
}

impl<'a> Parts<'a> {
    fn gather(
        &mut self,
        around: &'a Element,
        frame: Isometry3<f64>,
        class: Option<&'a str>,
        compiler: &Compiler,
    ) -> Result<(), RobotError> {
        for child in around.children() {
            match child.tag() {
                "joint" | "freejoint" => self.joints.push((child, frame, class)),
                "geom" => self.geoms.push((child, frame, class)),
                "frame" => {
                    let inside = frame * frames::pose(&View::of(child), compiler)?;
                    let class = child.attribute("childclass").or(class);
                    self.gather(child, inside, class, compiler)?;
                }
                _ => {}
            }
        }
        Ok(())
    }
}
