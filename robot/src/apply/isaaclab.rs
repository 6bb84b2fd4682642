//! Effects as Isaac Lab's actuator configuration: Python text to put into `ArticulationCfg.actuators`.
//!
//! Fields after `ActuatorBaseCfg` of Isaac Lab 2.2 and later, in which friction is a torque (Isaac Sim 5.0 and later).

use std::collections::BTreeMap;
use std::fmt::Write;

use super::{Outcome, Sums, Takes, added, changed, short};
use crate::error::RobotError;
use crate::links::Reshaping;
use crate::{Control, ControlKind, Effect, Robot};

/// Actuators of Isaac Lab.
pub struct IsaacLabFile {
    robot: String,
    names: Vec<String>,
    ratios: Vec<f64>,
    sums: Vec<Sums>,
    /// The controller whose gains the actuators have.
    control: Option<Control>,
    delay_s: f64,
}

impl IsaacLabFile {
    pub fn of(robot: &Robot) -> Self {
        let is_pd = |control: &&Control| control.kind == ControlKind::PdFeedforward;
        Self {
            robot: robot.name.clone(),
            names: robot
                .joints
                .iter()
                .map(|joint| joint.name.clone())
                .collect(),
            ratios: robot.joints.iter().map(|joint| joint.gear_ratio).collect(),
            sums: robot.joints.iter().map(Sums::of).collect(),
            control: robot.control.as_ref().filter(is_pd).cloned(),
            delay_s: 0.0,
        }
    }

    /// A dictionary over the joints, where any value is there.
    fn dictionary(&self, key: &str, value: impl Fn(usize) -> Option<f64>) -> Option<String> {
        let values: Vec<(usize, f64)> = (0..self.names.len())
            .filter_map(|index| Some((index, value(index)?)))
            .collect();
        let mut text = format!("        {key}={{\n");
        for (index, value) in &values {
            let name = pattern(&self.names[*index]);
            let _ = writeln!(text, "            {name}: {},", python(*value));
        }
        (!values.is_empty()).then(|| text + "        },\n")
    }
}

/// A name as Isaac Lab takes it: a regular expression, in Python's quotes.
fn pattern(name: &str) -> String {
    let mut text = String::new();
    for c in name.chars() {
        if "\\+*?()[]{}^$|.".contains(c) {
            text.push('\\');
        }
        text.push(c);
    }
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// Python reads `3` as an integer, which a field of floats may not be.
fn python(value: f64) -> String {
    let text = short(value);
    if text.contains(['.', 'e']) {
        text
    } else {
        text + ".0"
    }
}

impl Takes for IsaacLabFile {
    fn add(&mut self, joint: Option<usize>, effect: &Effect) -> Outcome {
        if let Effect::CommandDelay { delay_s } = *effect {
            let before = self.delay_s;
            // of several joints the largest: the group has one delay
            self.delay_s = match joint {
                Some(_) => self.delay_s.max(delay_s),
                None => self.delay_s + delay_s,
            };
            let told = changed("delay", before, self.delay_s);
            return if joint.is_some() && self.names.len() > 1 {
                Outcome::InPart(told, "all joints of a group have one delay".to_owned())
            } else {
                Outcome::Written(told)
            };
        }
        let Some(index) = joint else {
            return Outcome::Cannot(cannot(effect).to_owned());
        };
        let ratio = self.ratios[index].abs();
        let sums = &mut self.sums[index];
        let (key, sum, change) = match *effect {
            Effect::CoulombFriction { coulomb_nm } => {
                ("friction", &mut sums.coulomb_nm, coulomb_nm)
            }
            Effect::ViscousFriction { viscous_nm_s_rad } => (
                "viscous_friction",
                &mut sums.viscous_nm_s_rad,
                viscous_nm_s_rad,
            ),
            Effect::RotorInertia { inertia_kg_m2 } => (
                "armature",
                &mut sums.armature_kg_m2,
                inertia_kg_m2 * ratio * ratio,
            ),
            Effect::LinkInertia { inertia_kg_m2 } => {
                ("armature", &mut sums.armature_kg_m2, inertia_kg_m2)
            }
            Effect::TorqueSaturation { limit_nm } => {
                let before = sums.limit_nm.map_or("none".to_owned(), short);
                let limit_nm = sums
                    .limit_nm
                    .map_or(limit_nm * ratio, |before| before.min(limit_nm * ratio));
                sums.limit_nm = Some(limit_nm);
                let told = format!("effort_limit_sim {before} -> {}", short(limit_nm));
                return Outcome::Written(told);
            }
            Effect::TorqueConstantError { gain } if self.control.is_some() => {
                sums.torque_gain *= gain;
                let told = format!("stiffness and damping times {}", short(sums.torque_gain));
                return Outcome::Written(told);
            }
            _ => return Outcome::Cannot(cannot(effect).to_owned()),
        };
        let after = added(*sum, change);
        if after < 0.0 {
            return Outcome::Cannot(format!("{key} would be below zero"));
        }
        let told = changed(key, *sum, after);
        *sum = after;
        match effect {
            Effect::LinkInertia { .. } => {
                Outcome::InPart(told, "only its own joint feels armature".to_owned())
            }
            _ => Outcome::Written(told),
        }
    }

    fn reshape(&mut self, _: &BTreeMap<String, f64>, _: &Reshaping) -> Result<(), RobotError> {
        // bodies are the USD's
        Ok(())
    }

    fn sums(&self, index: usize) -> &Sums {
        &self.sums[index]
    }

    fn text(&self) -> Result<String, RobotError> {
        let delayed = self.delay_s > 0.0;
        let class = if delayed {
            "DelayedPDActuatorCfg"
        } else {
            "ImplicitActuatorCfg"
        };
        let mut text = format!(
            "\"\"\"Actuators of {} for ArticulationCfg(actuators=ACTUATORS): Isaac Lab 2.2 and later.\n\n\
             friction and viscous_friction are torques, as Isaac Sim 5.0 and later take them.\n\"\"\"\n\n\
             from isaaclab.actuators import {class}\n\n",
            self.robot.replace('\\', " ").replace('"', "'")
        );
        if delayed {
            let _ = write!(
                text,
                "PHYSICS_DT_S = 0.005  # your SimulationCfg.dt\nDELAY_STEPS = round({} / PHYSICS_DT_S)\n\n",
                short(self.delay_s)
            );
        }
        let names: Vec<String> = self.names.iter().map(|name| pattern(name)).collect();
        let _ = write!(
            text,
            "ACTUATORS = {{\n    \"{}\": {class}(\n        joint_names_expr=[{}],\n",
            self.robot.replace(['\\', '"'], "_"),
            names.join(", ")
        );
        let gain = |index: usize, gains: fn(&Control) -> &Vec<f64>| {
            let control = self.control.as_ref()?;
            Some(gains(control)[index] * self.sums[index].torque_gain)
        };
        let gains = [
            self.dictionary("stiffness", |i| gain(i, |c| &c.proportional_nm_rad)),
            self.dictionary("damping", |i| gain(i, |c| &c.derivative_nm_s_rad)),
        ];
        match gains {
            [Some(stiffness), Some(damping)] => text += &(stiffness + &damping),
            _ => {
                text += "        stiffness=None,  # of the USD; the robot file does not tell the controller\n        damping=None,\n";
            }
        }
        let limit = |i: usize| Some(self.sums[i].limit_nm? * self.sums[i].torque_gain);
        let there = |value: f64| (value != 0.0).then_some(value);
        let fields = [
            self.dictionary("effort_limit_sim", limit),
            self.dictionary("armature", |i| there(self.sums[i].armature_kg_m2)),
            self.dictionary("friction", |i| there(self.sums[i].coulomb_nm)),
            self.dictionary("dynamic_friction", |i| there(self.sums[i].coulomb_nm)),
            self.dictionary("viscous_friction", |i| there(self.sums[i].viscous_nm_s_rad)),
        ];
        text.extend(fields.into_iter().flatten());
        if delayed {
            text += "        min_delay=DELAY_STEPS,\n        max_delay=DELAY_STEPS,\n";
        }
        Ok(text + "    ),\n}\n")
    }
}

/// Why Isaac Lab's actuators cannot say it.
fn cannot(effect: &Effect) -> &'static str {
    match effect {
        Effect::TorqueConstantError { .. } => {
            "the robot file tells no gains to multiply; multiply the torque that you apply"
        }
        Effect::StribeckFriction { .. } => {
            "friction is the same at all speeds once the joint moves"
        }
        Effect::Payload { .. } => "actuators have no mass; add it to the body of the USD",
        Effect::BaseTilt { .. } => "actuators have no gravity; turn the base where you place it",
        Effect::JointSpring { .. } => "an actuator's spring is its controller",
        Effect::TorqueOffset { .. } | Effect::AsymmetricFriction { .. } => {
            "friction is the same in both directions, and there is no constant torque"
        }
        Effect::GravityTorque { .. } => {
            "it is a wrong mass or centre of mass, and which one it does not say; correct the body of the USD"
        }
        Effect::CoulombFriction { .. }
        | Effect::ViscousFriction { .. }
        | Effect::QuadraticFriction { .. }
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
        | Effect::LinkInertia { .. }
        | Effect::RotorInertia { .. }
        | Effect::EncoderOffset { .. }
        | Effect::EncoderEccentricity { .. }
        | Effect::EncoderQuantisation { .. }
        | Effect::VelocityFilterLag { .. }
        | Effect::CommandDelay { .. }
        | Effect::SensorDelay { .. }
        | Effect::DroppedCommands { .. }
        | Effect::DroppedSamples { .. } => "an actuator's configuration has no such field",
    }
}
