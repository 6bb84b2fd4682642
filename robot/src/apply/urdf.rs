//! Effects in a URDF: `<dynamics>`, `<limit effort>`, and links for payloads and inertia.

use std::collections::BTreeMap;
use std::path::Path;

use joint_model::rigid_body::JointKind;
use nalgebra::{Matrix3, Vector3};

use super::bodies;
use super::text::Changes;
use super::{Outcome, Sums, Takes, added, changed, differs, short};
use crate::error::RobotError;
use crate::links::Reshaping;
use crate::model::{Body, Model};
use crate::{Effect, Robot, RobotJoint, urdf, xml};

/// A URDF with effects.
pub struct UrdfFile {
    text: String,
    file: String,
    model: Model,
    bodies: Vec<usize>,
    before: Vec<Sums>,
    after: Vec<Sums>,
    ratios: Vec<f64>,
    changes: Changes,
}

impl UrdfFile {
    pub fn of(robot: &Robot, text: String, path: &Path) -> Result<Self, RobotError> {
        let file = path.display().to_string();
        let mut model = urdf::read(&text, &file)?;
        model.make_names_usable();
        let body_of = |name: &str| {
            let mut bodies = model.bodies.iter();
            bodies.position(|body| {
                let joint = body.joint.as_ref();
                joint.is_some_and(|joint| joint.drive.name == name)
            })
        };
        // the robot was read from the very text, or the text was written from it
        let joints = robot.joints.iter();
        let bodies: Vec<usize> = joints.filter_map(|joint| body_of(&joint.name)).collect();
        let drives = bodies.iter();
        let drives = drives.filter_map(|body| model.bodies[*body].joint.as_ref());
        Ok(Self {
            before: drives.map(|joint| friction_of(&joint.drive)).collect(),
            bodies,
            after: robot.joints.iter().map(Sums::of).collect(),
            ratios: robot.joints.iter().map(|joint| joint.gear_ratio).collect(),
            text,
            file,
            model,
            changes: Changes::default(),
        })
    }

    fn body(&self, index: usize) -> Option<&Body> {
        self.bodies.get(index).map(|body| &self.model.bodies[*body])
    }

    /// Sets attributes of an element in a joint, which is added where there is none.
    fn set_in_joint(&mut self, index: usize, tag: &str, values: &[(&str, String)]) {
        let joint = self.body(index).and_then(|body| body.joint.as_ref());
        let Some(at) = joint.map(|joint| joint.element.at) else {
            return;
        };
        let Ok(document) = xml::document(&self.text, &self.file) else {
            return;
        };
        let mut nodes = document.descendants();
        let joint = nodes.find(|node| node.is_element() && node.range().start == at);
        // of repeated elements the first counts
        let child = joint.and_then(|joint| {
            let mut children = joint.children();
            children.find(|child| child.has_tag_name(tag))
        });
        match child {
            Some(child) => {
                for (key, value) in values {
                    self.changes.set(child.range().start, key, value);
                }
            }
            None => {
                let said = values
                    .iter()
                    .map(|(key, value)| format!(" {key}=\"{value}\""));
                let text = format!("<{tag}{}/>", said.collect::<String>());
                self.changes.replace_child(at, &format!("<{tag} "), text);
            }
        }
    }

    fn friction(&mut self, index: usize, effect: &Effect) -> Outcome {
        let sums = &mut self.after[index];
        let (key, sum, change) = match *effect {
            Effect::CoulombFriction { coulomb_nm } => {
                ("friction", &mut sums.coulomb_nm, coulomb_nm)
            }
            Effect::ViscousFriction { viscous_nm_s_rad } => {
                ("damping", &mut sums.viscous_nm_s_rad, viscous_nm_s_rad)
            }
            _ => return Outcome::Cannot(cannot(effect)),
        };
        let after = added(*sum, change);
        if after < 0.0 {
            return Outcome::Cannot(format!("{key} would be below zero"));
        }
        let told = changed(key, *sum, after);
        *sum = after;
        let (before, after) = (&self.before[index], &self.after[index]);
        let values = [
            ("damping", before.viscous_nm_s_rad, after.viscous_nm_s_rad),
            ("friction", before.coulomb_nm, after.coulomb_nm),
        ];
        let values = values
            .into_iter()
            .filter(|(_, before, after)| differs(*before, *after));
        let values: Vec<(&str, String)> =
            values.map(|(key, _, after)| (key, short(after))).collect();
        if !values.is_empty() {
            self.set_in_joint(index, "dynamics", &values);
        }
        Outcome::Written(told)
    }

    fn saturate(&mut self, index: usize, limit_nm: f64) -> Outcome {
        let limit_nm = limit_nm * self.ratios[index].abs();
        let before = self.after[index].limit_nm;
        let limit_nm = before.map_or(limit_nm, |before| before.min(limit_nm));
        self.after[index].limit_nm = Some(limit_nm);
        self.set_in_joint(index, "limit", &[("effort", short(limit_nm))]);
        let before = before.map_or("none".to_owned(), short);
        Outcome::Written(format!("effort {before} -> {}", short(limit_nm)))
    }

    fn payload(&mut self, mass_kg: f64, centre_m: [f64; 3]) -> Outcome {
        if mass_kg < 0.0 {
            return Outcome::Cannot(
                "a mass is missing, not added; take it off the last link".to_owned(),
            );
        }
        let Some(last) = self.bodies.len().checked_sub(1) else {
            return Outcome::Cannot("the joint is not in the file".to_owned());
        };
        let inertia = [0.0; 6];
        self.add_link(last, "payload", centre_m, mass_kg, inertia);
        Outcome::Written(format!("a link of {} kg on the last one", short(mass_kg)))
    }

    fn link_inertia(&mut self, index: usize, added_kg_m2: f64) -> Outcome {
        let joint = self.body(index).and_then(|body| body.joint.clone());
        let Some(joint) = joint.filter(|joint| joint.kind == JointKind::Revolute) else {
            return Outcome::Cannot("what resists a joint that slides is mass".to_owned());
        };
        if added_kg_m2 < 0.0 {
            return Outcome::Cannot(
                "inertia is missing, not added; take it off the link".to_owned(),
            );
        }
        let axis: Vector3<f64> = joint.axis.into_inner();
        let along = axis * axis.transpose();
        let ring = added_kg_m2 * (along + 0.5 * (Matrix3::identity() - along));
        let inertia = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|at| ring[at]);
        let name = format!("{}_inertia", joint.drive.name);
        self.add_link(index, &name, [0.0; 3], 0.0, inertia);
        Outcome::Written(format!(
            "a link without mass and with {} kg m² about the axis",
            short(added_kg_m2)
        ))
    }

    /// A link that is fixed to a joint's.
    fn add_link(
        &mut self,
        index: usize,
        name: &str,
        place_m: [f64; 3],
        mass_kg: f64,
        inertia_kg_m2: [f64; 6],
    ) {
        let Ok(document) = xml::document(&self.text, &self.file) else {
            return;
        };
        let Some(body) = self.body(index) else {
            return;
        };
        let mut nodes = document.descendants();
        let link = nodes.find(|node| node.is_element() && node.range().start == body.at);
        let parent = link
            .and_then(|link| link.attribute("name"))
            .unwrap_or_default();
        let mut name = name.to_owned();
        while self.text.contains(&format!("\"{name}\"")) {
            name += "_added";
        }
        let [ixx, ixy, ixz, iyy, iyz, izz] = inertia_kg_m2.map(short);
        let place = place_m.map(short).join(" ");
        let text = format!(
            "<link name=\"{name}\">\n  <inertial>\n    <mass value=\"{}\"/>\n    \
             <inertia ixx=\"{ixx}\" ixy=\"{ixy}\" ixz=\"{ixz}\" iyy=\"{iyy}\" iyz=\"{iyz}\" izz=\"{izz}\"/>\n  \
             </inertial>\n</link>\n<joint name=\"{name}_joint\" type=\"fixed\">\n  \
             <parent link=\"{parent}\"/>\n  <child link=\"{name}\"/>\n  <origin xyz=\"{place}\"/>\n</joint>",
            short(mass_kg)
        );
        self.changes
            .add_child(document.root_element().range().start, text);
    }
}

impl Takes for UrdfFile {
    fn add(&mut self, joint: Option<usize>, effect: &Effect) -> Outcome {
        match (*effect, joint) {
            (Effect::Payload { mass_kg, centre_m }, _) => self.payload(mass_kg, centre_m),
            (Effect::TorqueSaturation { limit_nm }, Some(index)) => self.saturate(index, limit_nm),
            (Effect::LinkInertia { inertia_kg_m2 }, Some(index)) => {
                self.link_inertia(index, inertia_kg_m2)
            }
            (_, Some(index)) => self.friction(index, effect),
            (_, None) => Outcome::Cannot(cannot(effect)),
        }
    }

    fn reshape(&mut self, held: &BTreeMap<String, f64>, by: &Reshaping) -> Result<(), RobotError> {
        let document = xml::document(&self.text, &self.file)?;
        bodies::of_urdf(
            &document,
            &self.model.reshaped(held, by)?,
            &mut self.changes,
        );
        Ok(())
    }

    fn sums(&self, index: usize) -> &Sums {
        &self.after[index]
    }

    fn text(&self) -> Result<String, RobotError> {
        self.changes.apply(&self.text, &self.file)
    }
}

/// What the file says itself.
fn friction_of(joint: &RobotJoint) -> Sums {
    let friction = joint.steady_friction();
    Sums {
        coulomb_nm: friction.coulomb.coulomb_nm,
        viscous_nm_s_rad: friction.viscous.viscous_nm_s_rad,
        ..Sums::of(joint)
    }
}

/// Why a URDF cannot say it.
fn cannot(effect: &Effect) -> String {
    match effect {
        Effect::RotorInertia { .. } => "URDF has no inertia before the gear",
        Effect::JointSpring { .. } => "URDF has no springs",
        Effect::TorqueOffset { .. } | Effect::AsymmetricFriction { .. } => {
            "URDF's friction is the same in both directions"
        }
        Effect::BaseTilt { .. } => "URDF has no gravity; place the base turned by these angles",
        Effect::TorqueConstantError { .. } => "URDF has no actuators; multiply the torque that you apply",
        Effect::CommandDelay { .. } => "URDF has no actuators; delay the torque that you apply",
        Effect::GravityTorque { .. } => {
            "it is a wrong mass or centre of mass, and which one it does not say; correct <inertial>"
        }
        Effect::CoulombFriction { .. }
        | Effect::ViscousFriction { .. }
        | Effect::QuadraticFriction { .. }
        | Effect::StribeckFriction { .. }
        | Effect::LoadDependentFriction { .. }
        | Effect::PositionDependentFriction { .. }
        | Effect::ThermalFrictionDrift { .. }
        | Effect::KinematicError { .. }
        | Effect::TorsionalCompliance { .. }
        | Effect::SoftWindup { .. }
        | Effect::TorsionalHysteresis { .. }
        | Effect::StructuralDamping { .. }
        | Effect::Backlash { .. }
        | Effect::TorqueRipple { .. }
        | Effect::TorqueSaturation { .. }
        | Effect::CurrentLoopLag { .. }
        | Effect::Payload { .. }
        | Effect::LinkInertia { .. }
        | Effect::EncoderOffset { .. }
        | Effect::EncoderEccentricity { .. }
        | Effect::EncoderQuantisation { .. }
        | Effect::VelocityFilterLag { .. }
        | Effect::SensorDelay { .. }
        | Effect::DroppedCommands { .. }
        | Effect::DroppedSamples { .. } => "URDF has only damping and friction",
    }
    .to_owned()
}
