//! Effects in a MuJoCo model: joints' `damping`, `frictionloss`, `armature` and spring, actuators' gains, limits, lag and delay,
//! bodies for payloads and inertia, and the direction of gravity.
//!
//! A constant torque is a spring so soft and bent so far that its torque is constant. Checked beside MuJoCo 4.0.0.

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::bodies;
use super::text::Changes;
use super::{Outcome, Sums, Takes, added, changed, differs, short};
use crate::error::RobotError;
use crate::links::Reshaping;
use crate::model::{Actuator, Joint, Model};
use crate::{ControlKind, Effect, Robot, mjcf, xml};

/// A spring of a constant torque is bent by so many radians, and loses a millionth of it over one.
const BENT_RAD: f64 = 1e6;

/// A MuJoCo model with effects.
pub struct MjcfFile {
    text: String,
    file: String,
    model: Model,
    /// Of each of the robot's joints: the model's bodies with a joint.
    bodies: Vec<usize>,
    before: Vec<Sums>,
    after: Vec<Sums>,
    gravity_m_s2: Vector3<f64>,
    timestep_s: f64,
    ratios: Vec<f64>,
    changes: Changes,
}

impl MjcfFile {
    pub fn of(robot: &Robot, text: String, path: &Path) -> Result<Self, RobotError> {
        let mut model = mjcf::read(&text, path)?;
        model.make_names_usable();
        let body_of = |name: &str| {
            let mut bodies = model.bodies.iter();
            bodies.position(|body| {
                let joint = body.joint.as_ref();
                joint.is_some_and(|joint| joint.drive.name == name)
            })
        };
        // the robot was read from the very text, or the text was written from it
        let bodies: Vec<usize> = robot
            .joints
            .iter()
            .filter_map(|joint| body_of(&joint.name))
            .collect();
        let drives = bodies.iter();
        let drives = drives.filter_map(|body| model.bodies[*body].joint.as_ref());
        let mut before: Vec<Sums> = Vec::new();
        for joint in drives {
            let mut sums = Sums::of(&joint.drive);
            for effect in &joint.drive.effects {
                sums.add(effect);
            }
            sums.delay_s = joint.actuators.first().map_or(0.0, |first| first.delay_s);
            before.push(sums);
        }
        let after = robot
            .joints
            .iter()
            .zip(&before)
            .map(|(joint, before)| Sums {
                delay_s: before.delay_s,
                ..Sums::of(joint)
            });
        Ok(Self {
            after: after.collect(),
            file: path.display().to_string(),
            timestep_s: model.timestep_s.unwrap_or(0.002),
            gravity_m_s2: robot.chain.gravity_m_s2(),
            ratios: robot.joints.iter().map(|joint| joint.gear_ratio).collect(),
            text,
            model,
            bodies,
            before,
            changes: Changes::default(),
        })
    }

    fn joint(&self, index: usize) -> Option<&Joint> {
        self.model.bodies[*self.bodies.get(index)?].joint.as_ref()
    }

    /// What 1 of the joint's positions is, in rad or m.
    fn unit(&self, joint: &Joint) -> f64 {
        match joint.kind {
            joint_model::rigid_body::JointKind::Revolute => self.model.angle_rad,
            joint_model::rigid_body::JointKind::Prismatic => 1.0,
        }
    }

    fn gain(&mut self, index: usize, gain: f64) -> Outcome {
        let Some(joint) = self.joint(index).cloned() else {
            return Outcome::Cannot("the joint is not in the model".to_owned());
        };
        if joint.actuators.is_empty() {
            return Outcome::Cannot(
                "the model has no actuator on this joint; multiply the torque that you apply"
                    .to_owned(),
            );
        }
        let unknown = |actuator: &&Actuator| {
            actuator.kind.is_none() || (actuator.tag == "position" && actuator.kp.is_none())
        };
        if joint.actuators.iter().any(|own| unknown(&own)) {
            return Outcome::Cannot("the actuator's law is not one that is read".to_owned());
        }
        self.after[index].torque_gain *= gain;
        let whole = self.after[index].torque_gain;
        for actuator in &joint.actuators {
            scale(actuator, whole, &mut self.changes);
        }
        if let Some(limit_nm) = joint_force_limit(&self.text, joint.element.at) {
            let limit = numbers(&limit_nm.map(|end| end * whole));
            self.changes
                .set(joint.element.at, "actuatorfrcrange", limit);
        }
        Outcome::Written(format!("torque of its actuator times {}", short(whole)))
    }

    fn saturate(&mut self, index: usize, limit_nm: f64) -> Outcome {
        let Some(joint) = self.joint(index).cloned() else {
            return Outcome::Cannot("the joint is not in the model".to_owned());
        };
        let before = self.after[index].limit_nm;
        let limit_nm = before.map_or(limit_nm, |before| before.min(limit_nm));
        self.after[index].limit_nm = Some(limit_nm);
        let told = |key: &str| {
            let before = before.map_or("none".to_owned(), short);
            Outcome::Written(format!("{key} {before} -> {}", short(limit_nm)))
        };
        match joint.actuators.as_slice() {
            [only] => {
                let gear = only.gear.first().copied().unwrap_or(1.0).abs();
                let force = limit_nm / if gear == 0.0 { 1.0 } else { gear };
                self.changes
                    .set(only.at, "forcerange", numbers(&[-force, force]));
                self.changes.set(only.at, "forcelimited", "true");
                told("forcerange")
            }
            _ => {
                let at = joint.element.at;
                self.changes
                    .set(at, "actuatorfrcrange", numbers(&[-limit_nm, limit_nm]));
                self.changes.set(at, "actuatorfrclimited", "true");
                told("actuatorfrcrange")
            }
        }
    }

    fn lag(&mut self, index: usize, time_constant_s: f64) -> Outcome {
        let motors = self.joint(index).map(|joint| joint.actuators.clone());
        let motors = motors.unwrap_or_default();
        let is_plain = |actuator: &Actuator| {
            actuator.tag == "motor" && actuator.kind == Some(ControlKind::OpenLoopTorque)
        };
        if motors.is_empty() || !motors.iter().all(is_plain) {
            return Outcome::Cannot(
                "MuJoCo filters what an actuator is told, not its torque; only a <motor> is told a torque".to_owned(),
            );
        }
        for motor in &motors {
            self.changes.rename(motor.at, "general");
            let attributes = [
                ("dyntype", "filterexact".to_owned()),
                ("dynprm", short(time_constant_s)),
                ("gaintype", "fixed".to_owned()),
                ("gainprm", "1".to_owned()),
                ("biastype", "none".to_owned()),
            ];
            for (key, value) in attributes {
                self.changes.set(motor.at, key, value);
            }
        }
        Outcome::Written(format!(
            "motor filtered with {} s, which gives it an activation",
            short(time_constant_s)
        ))
    }

    fn delay(&mut self, joints: std::ops::Range<usize>, delay_s: f64) -> Outcome {
        let (mut is_told, mut is_motor) = (false, true);
        let mut told = String::new();
        for index in joints {
            let actuators = self.joint(index).map(|joint| joint.actuators.clone());
            let before = self.after[index].delay_s;
            self.after[index].delay_s += delay_s;
            let after = self.after[index].delay_s;
            for actuator in actuators.unwrap_or_default() {
                let samples = (after / self.timestep_s).ceil().clamp(1.0, 1e6) + 2.0;
                self.changes.set(actuator.at, "delay", short(after));
                self.changes.set(actuator.at, "nsample", short(samples));
                self.changes.set(actuator.at, "interp", "linear");
                is_told = true;
                is_motor &= actuator.kind == Some(ControlKind::OpenLoopTorque);
                told = changed("delay", before, after);
            }
        }
        match (is_told, is_motor) {
            (false, _) => Outcome::Cannot(
                "the model has no actuator; delay the torque that you apply".to_owned(),
            ),
            (true, true) => Outcome::Written(told),
            (true, false) => Outcome::InPart(
                told,
                "MuJoCo delays what the actuator is told, not its torque".to_owned(),
            ),
        }
    }

    fn payload(&mut self, mass_kg: f64, centre_m: [f64; 3]) -> Outcome {
        if mass_kg < 0.0 {
            return Outcome::Cannot(
                "a mass is missing, not added; take it off the last link".to_owned(),
            );
        }
        let Some((body, joint)) = self.last_body() else {
            return Outcome::Cannot("the joint is not in the model".to_owned());
        };
        let centre_m = joint.element.anchor_m + Vector3::from(centre_m);
        let inertial = format!(
            "<inertial pos=\"0 0 0\" mass=\"{}\" diaginertia=\"0 0 0\"/>",
            short(mass_kg)
        );
        self.add_body(body, "payload", centre_m, &inertial);
        Outcome::Written(format!("a body of {} kg on the last link", short(mass_kg)))
    }

    fn last_body(&self) -> Option<(usize, Joint)> {
        let body = &self.model.bodies[*self.bodies.last()?];
        Some((body.at, body.joint.clone()?))
    }

    fn add_body(&mut self, at: usize, name: &str, position_m: Vector3<f64>, inside: &str) {
        let mut name = name.to_owned();
        while self.text.contains(&format!("\"{name}\"")) {
            name += "_added";
        }
        let text = format!(
            "<body name=\"{name}\" pos=\"{}\">\n  {inside}\n</body>",
            numbers(position_m.as_slice())
        );
        self.changes.add_child(at, text);
    }

    fn link_inertia(&mut self, index: usize, added_kg_m2: f64) -> Outcome {
        let armature = self.after[index].armature_kg_m2;
        let body = self.bodies.get(index).map(|body| &self.model.bodies[*body]);
        let Some((at, joint)) = body.and_then(|body| Some((body.at, body.joint.clone()?))) else {
            return Outcome::Cannot("the joint is not in the model".to_owned());
        };
        let turns = joint.kind == joint_model::rigid_body::JointKind::Revolute;
        if added_kg_m2 > 0.0 && turns && !joint.element.is_followed {
            let axis = joint.axis.into_inner();
            let along = axis * axis.transpose();
            let ring = added_kg_m2 * (along + 0.5 * (Matrix3::identity() - along));
            let inertial = format!(
                "<inertial pos=\"0 0 0\" mass=\"0\" fullinertia=\"{}\"/>",
                numbers(&[
                    ring[(0, 0)],
                    ring[(1, 1)],
                    ring[(2, 2)],
                    ring[(0, 1)],
                    ring[(0, 2)],
                    ring[(1, 2)],
                ])
            );
            let name = format!("{}_inertia", joint.drive.name);
            self.add_body(at, &name, joint.element.anchor_m, &inertial);
            return Outcome::Written(format!(
                "a body without mass and with {} kg m² about the axis",
                short(added_kg_m2)
            ));
        }
        if armature + added_kg_m2 < 0.0 {
            return Outcome::Cannot(
                "inertia is missing, not added; take it off the link".to_owned(),
            );
        }
        self.after[index].armature_kg_m2 += added_kg_m2;
        Outcome::InPart(
            changed("armature", armature, armature + added_kg_m2),
            "only its own joint feels armature".to_owned(),
        )
    }

    fn tilt(&mut self, roll_rad: f64, pitch_rad: f64) -> Outcome {
        let tilt = UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, 0.0);
        self.gravity_m_s2 = tilt.inverse() * self.gravity_m_s2;
        let gravity = numbers(self.gravity_m_s2.as_slice());
        let document = match xml::document(&self.text, &self.file) {
            Ok(document) => document,
            Err(error) => return Outcome::Cannot(error.to_string()),
        };
        let root = document.root_element();
        let mut options = root.children().filter(|node| node.has_tag_name("option"));
        match options.next_back() {
            Some(option) => {
                let at = option.range().start;
                self.changes.set(at, "gravity", gravity.clone());
            }
            None => {
                let option = format!("<option gravity=\"{gravity}\"/>");
                self.changes.add_child(root.range().start, option);
            }
        }
        Outcome::Written(format!("gravity {gravity}"))
    }

    /// Writes what became of a joint's own values.
    fn write(&self, index: usize, changes: &mut Changes) {
        let Some(joint) = self.joint(index).cloned() else {
            return;
        };
        let (before, after) = (&self.before[index], &self.after[index]);
        let (at, unit) = (joint.element.at, self.unit(&joint));
        let mut set = |key: &str, value: String| changes.set(at, key, value);
        if differs(before.viscous_nm_s_rad, after.viscous_nm_s_rad)
            || differs(before.quadratic_nm_s2_rad2, after.quadratic_nm_s2_rad2)
        {
            let mut damping = short(after.viscous_nm_s_rad);
            if after.quadratic_nm_s2_rad2 != 0.0 {
                damping += &format!(" {}", short(after.quadratic_nm_s2_rad2));
            }
            set("damping", damping);
        }
        if differs(before.coulomb_nm, after.coulomb_nm) {
            set("frictionloss", short(after.coulomb_nm));
        }
        if differs(before.armature_kg_m2, after.armature_kg_m2) {
            set("armature", short(after.armature_kg_m2));
        }
        if differs(before.stiffness_nm_rad, after.stiffness_nm_rad)
            || differs(before.torque_at_zero_nm, after.torque_at_zero_nm)
        {
            let (stiffness, rest_rad) = after.spring();
            set("stiffness", short(stiffness));
            set("springref", short(rest_rad / unit));
        }
    }

    /// Adds what the joint's own element says, everything at the joint.
    fn sum(&mut self, index: usize, effect: &Effect) -> Outcome {
        let mut after = self.after[index].clone();
        let Some(told) = after.add(effect) else {
            return Outcome::Cannot(cannot(effect));
        };
        if let Some(why) = Self::refused(&after) {
            return Outcome::Cannot(why.to_owned());
        }
        self.after[index] = after;
        Outcome::Written(told)
    }

    /// Why a joint cannot have these values.
    fn refused(after: &Sums) -> Option<&'static str> {
        let negative = [
            (after.coulomb_nm, "frictionloss would be below zero"),
            (after.viscous_nm_s_rad, "damping would be below zero"),
            (after.armature_kg_m2, "armature would be below zero"),
            (after.stiffness_nm_rad, "stiffness would be below zero"),
        ];
        let mut negative = negative.into_iter().filter(|(value, _)| *value < 0.0);
        negative.next().map(|(_, why)| why)
    }
}

impl Takes for MjcfFile {
    fn add(&mut self, joint: Option<usize>, effect: &Effect) -> Outcome {
        let Some(index) = joint else {
            return match *effect {
                Effect::Payload { mass_kg, centre_m } => self.payload(mass_kg, centre_m),
                Effect::BaseTilt {
                    roll_rad,
                    pitch_rad,
                } => self.tilt(roll_rad, pitch_rad),
                Effect::CommandDelay { delay_s } => self.delay(0..self.bodies.len(), delay_s),
                _ => Outcome::Cannot(cannot(effect)),
            };
        };
        match *effect {
            Effect::TorqueConstantError { gain } => self.gain(index, gain),
            Effect::TorqueSaturation { limit_nm } => {
                self.saturate(index, limit_nm * self.ratios[index].abs())
            }
            Effect::CurrentLoopLag { time_constant_s } => self.lag(index, time_constant_s),
            Effect::CommandDelay { delay_s } => self.delay(index..index + 1, delay_s),
            Effect::LinkInertia { inertia_kg_m2 } => self.link_inertia(index, inertia_kg_m2),
            Effect::RotorInertia { inertia_kg_m2 } => {
                let inertia_kg_m2 = inertia_kg_m2 * self.ratios[index].powi(2);
                self.sum(index, &Effect::RotorInertia { inertia_kg_m2 })
            }
            _ => self.sum(index, effect),
        }
    }

    fn reshape(&mut self, held: &BTreeMap<String, f64>, by: &Reshaping) -> Result<(), RobotError> {
        let document = xml::document(&self.text, &self.file)?;
        bodies::of_mjcf(
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
        let mut changes = self.changes.clone();
        for index in 0..self.bodies.len() {
            self.write(index, &mut changes);
        }
        changes.apply(&self.text, &self.file)
    }
}

impl Sums {
    /// Adds what a joint of MuJoCo has; `None` where it has no such thing.
    fn add(&mut self, effect: &Effect) -> Option<String> {
        let summed = |key: &str, sum: &mut f64, change: f64| {
            let before = *sum;
            *sum = added(before, change);
            Some(changed(key, before, *sum))
        };
        match *effect {
            Effect::CoulombFriction { coulomb_nm } => {
                summed("frictionloss", &mut self.coulomb_nm, coulomb_nm)
            }
            Effect::ViscousFriction { viscous_nm_s_rad } => {
                summed("damping", &mut self.viscous_nm_s_rad, viscous_nm_s_rad)
            }
            Effect::QuadraticFriction {
                quadratic_nm_s2_rad2,
            } => summed(
                "second number of damping",
                &mut self.quadratic_nm_s2_rad2,
                quadratic_nm_s2_rad2,
            ),
            Effect::RotorInertia { inertia_kg_m2 } => {
                summed("armature", &mut self.armature_kg_m2, inertia_kg_m2)
            }
            Effect::JointSpring {
                stiffness_nm_rad,
                rest_rad,
            } => {
                self.torque_at_zero_nm += stiffness_nm_rad * rest_rad;
                summed("stiffness", &mut self.stiffness_nm_rad, stiffness_nm_rad)
            }
            Effect::TorqueOffset { offset_nm } => summed(
                "constant torque (springref)",
                &mut self.torque_at_zero_nm,
                offset_nm,
            ),
            // dry friction between -(c - a) and c + a is one of c and a constant torque against positive motion
            Effect::AsymmetricFriction { asymmetry_nm } => summed(
                "constant torque (springref)",
                &mut self.torque_at_zero_nm,
                -asymmetry_nm,
            ),
            _ => None,
        }
    }

    /// Stiffness and rest of one spring for all of it.
    fn spring(&self) -> (f64, f64) {
        if self.stiffness_nm_rad > 0.0 {
            return (
                self.stiffness_nm_rad,
                self.torque_at_zero_nm / self.stiffness_nm_rad,
            );
        }
        let stiffness = self.torque_at_zero_nm.abs() / BENT_RAD;
        (stiffness, self.torque_at_zero_nm.signum() * BENT_RAD)
    }
}

/// Multiplies an actuator's torque.
fn scale(actuator: &Actuator, gain: f64, changes: &mut Changes) {
    let scaled =
        |values: &[f64]| numbers(&values.iter().map(|value| value * gain).collect::<Vec<_>>());
    let at = actuator.at;
    if actuator.kind == Some(ControlKind::OpenLoopTorque) {
        // the gear is on the torque alone, and the limits are before it
        let mut gear = actuator.gear.clone();
        if gear.is_empty() {
            gear.push(1.0);
        }
        gear[0] *= gain;
        changes.set(at, "gear", numbers(&gear));
        return;
    }
    // of a law on the position or the velocity the gear is on those too
    match actuator.tag.as_str() {
        "general" => {
            let own = &actuator.gain;
            let own = if own.is_empty() { &[1.0][..] } else { own };
            changes.set(at, "gainprm", scaled(own));
            if !actuator.bias.is_empty() {
                changes.set(at, "biasprm", scaled(&actuator.bias));
            }
        }
        tag => {
            if tag == "position" {
                changes.set(at, "kp", short(actuator.kp.unwrap_or(1.0) * gain));
            }
            if let Some(kv) = actuator.kv.or((tag == "velocity").then_some(1.0)) {
                changes.set(at, "kv", short(kv * gain));
            }
        }
    }
    if let Some(range) = actuator.force_range {
        changes.set(at, "forcerange", scaled(&range));
    }
}

/// A joint's own limit on what all its actuators give, where its element says one.
fn joint_force_limit(text: &str, at: usize) -> Option<[f64; 2]> {
    let document = roxmltree::Document::parse(text).ok()?;
    let mut nodes = document.descendants();
    let joint = nodes.find(|node| node.is_element() && node.range().start == at)?;
    let values = joint.attribute("actuatorfrcrange")?.split_whitespace();
    let values: Vec<f64> = values.filter_map(|value| value.parse().ok()).collect();
    values.try_into().ok()
}

fn numbers(values: &[f64]) -> String {
    let all: Vec<String> = values.iter().map(|value| short(*value)).collect();
    all.join(" ")
}

/// Why MuJoCo cannot say it.
fn cannot(effect: &Effect) -> String {
    match effect {
        Effect::StribeckFriction { .. } => "MuJoCo's dry friction is the same at all speeds",
        Effect::LoadDependentFriction { .. } => "MuJoCo's dry friction is the same under all loads",
        Effect::PositionDependentFriction { .. } => {
            "MuJoCo's dry friction is the same at all angles"
        }
        Effect::ThermalFrictionDrift { .. } => "MuJoCo's friction does not change with time",
        Effect::GravityTorque { .. } => {
            "it is a wrong mass or centre of mass, and which one it does not say; correct <inertial>"
        }
        Effect::TorsionalCompliance { .. }
        | Effect::SoftWindup { .. }
        | Effect::TorsionalHysteresis { .. }
        | Effect::StructuralDamping { .. }
        | Effect::Backlash { .. }
        | Effect::KinematicError { .. } => {
            "MuJoCo's joint has no gear; it takes a second body before the gear"
        }
        Effect::TorqueRipple { .. } => "MuJoCo's actuators have no torque over the angle",
        Effect::EncoderOffset { .. }
        | Effect::EncoderEccentricity { .. }
        | Effect::EncoderQuantisation { .. }
        | Effect::VelocityFilterLag { .. }
        | Effect::SensorDelay { .. }
        | Effect::DroppedSamples { .. } => {
            "it is what sensors make of the motion; put it between MuJoCo and your controller"
        }
        Effect::DroppedCommands { .. } => {
            "MuJoCo's actuators lose no command; put it between your controller and MuJoCo"
        }
        Effect::CoulombFriction { .. }
        | Effect::ViscousFriction { .. }
        | Effect::QuadraticFriction { .. }
        | Effect::AsymmetricFriction { .. }
        | Effect::TorqueConstantError { .. }
        | Effect::TorqueOffset { .. }
        | Effect::TorqueSaturation { .. }
        | Effect::CurrentLoopLag { .. }
        | Effect::Payload { .. }
        | Effect::LinkInertia { .. }
        | Effect::RotorInertia { .. }
        | Effect::JointSpring { .. }
        | Effect::BaseTilt { .. }
        | Effect::CommandDelay { .. } => "MuJoCo has no such thing",
    }
    .to_owned()
}
