//! A robot as a MuJoCo model.

use std::fmt::Write;

use joint_model::rigid_body::{Chain, JointKind, Link};
use nalgebra::{Isometry3, Matrix3, Vector3};

use super::{
    Symmetric, Written, coulomb_nm, in_attribute, left_out_of_joints, left_out_of_robot, link_name,
    loaded, numbers, sum_of, unsaid, vector, viscous_nm_s_rad,
};
use crate::{Control, ControlKind, Effect, Feedback, Feedforward, Robot, RobotJoint};

impl Robot {
    /// As a MuJoCo model: bodies, limits, rotor inertia, friction, springs, and the controller where MuJoCo has one like it.
    pub fn to_mjcf(&self) -> Written {
        let chain = loaded(self);
        let mut text = String::new();
        let gravity = vector(&chain.gravity_m_s2());
        let rate_hz = self.control.as_ref().map(|control| control.rate_hz);
        let timestep = rate_hz.filter(|rate_hz| *rate_hz > 0.0);
        let timestep = timestep.map_or(String::new(), |rate_hz| {
            format!(" timestep=\"{}\"", 1.0 / rate_hz)
        });
        let _ = writeln!(
            text,
            "<mujoco model=\"{}\">\n  <compiler angle=\"radian\" autolimits=\"true\"/>\n  \
             <option gravity=\"{gravity}\"{timestep}/>\n  <worldbody>",
            in_attribute(&self.name)
        );
        for index in 0..chain.joint_count() {
            if chain.links()[index].parent.is_none() {
                self.body(&chain, index, 2, &mut text);
            }
        }
        text += "  </worldbody>\n";
        let actuators: Vec<String> = (0..self.joints.len())
            .filter_map(|index| self.actuator(index))
            .collect();
        if !actuators.is_empty() {
            let _ = writeln!(
                text,
                "  <actuator>\n    {}\n  </actuator>",
                actuators.join("\n    ")
            );
        }
        text += "</mujoco>\n";
        let mut left_out = left_out_of_robot(self, "MJCF");
        left_out.extend(refused(self, chain.links()));
        left_out.extend(left_out_of_joints(self, "MJCF", |joint| {
            let mut parts = unsaid(joint, is_said);
            if joint.gear_ratio != 1.0 {
                parts.push(format!(
                    "gear (rotor inertia and torque limit of the {} stand at the joint)",
                    joint.gear_ratio
                ));
            }
            if joint.velocity_limit_rad_s.is_some() {
                parts.push("limit of the velocity".to_owned());
            }
            parts
        }));
        left_out.extend(self.control.as_ref().and_then(control_left_out));
        Written { text, left_out }
    }

    /// A link and what hangs on it. MuJoCo wants mass in every body that moves: links without any share one with the link that
    /// follows them, which then has several joints.
    fn body(&self, chain: &Chain, first: usize, depth: usize, text: &mut String) {
        let links = chain.links();
        let mut run = vec![first];
        let mut index = first;
        while let [only] = below(links, index)[..]
            && weighs_nothing(&links[index])
        {
            run.push(only);
            index = only;
        }
        let pose = |run: &[usize]| {
            let origins = run.iter().map(|link| links[*link].origin);
            origins.fold(Isometry3::identity(), |pose, origin| pose * origin)
        };
        let origin = pose(&run);
        let indent = "  ".repeat(depth);
        let turn = origin.rotation;
        let _ = writeln!(
            text,
            "{indent}<body name=\"{}\" pos=\"{}\" quat=\"{}\">",
            link_name(self, Some(index)),
            vector(&origin.translation.vector),
            numbers(&[turn.w, turn.i, turn.j, turn.k])
        );
        if let Some(inertial) = inertial(&links[index]) {
            let _ = writeln!(text, "{indent}  {inertial}");
        }
        for (number, own) in run.iter().enumerate() {
            let frame = pose(&run[number + 1..]);
            let joint = joint(&self.joints[*own], &links[*own], &frame.inverse());
            let _ = writeln!(text, "{indent}  {joint}");
        }
        for link in below(links, index) {
            self.body(chain, link, depth + 1, text);
        }
        let _ = writeln!(text, "{indent}</body>");
    }

    /// What MuJoCo has of the controller: of the proportional-derivative law with its damping on the velocity itself.
    fn actuator(&self, index: usize) -> Option<String> {
        let control = self.control.as_ref()?;
        let name = in_attribute(&self.joints[index].name);
        let start = |tag: &str| format!("<{tag} name=\"{name}\" joint=\"{name}\"");
        let gains = [
            control.proportional_nm_rad[index],
            control.derivative_nm_s_rad[index],
        ];
        match control.kind {
            ControlKind::PdFeedforward => Some(format!(
                "{} kp=\"{}\" kv=\"{}\"/>",
                start("position"),
                gains[0],
                gains[1]
            )),
            ControlKind::VelocityPi => Some(format!("{} kv=\"{}\"/>", start("velocity"), gains[1])),
            ControlKind::OpenLoopTorque => Some(start("motor") + "/>"),
            ControlKind::Unknown => None,
        }
    }
}

/// The links that hang on one.
fn below(links: &[Link], index: usize) -> Vec<usize> {
    let all = index + 1..links.len();
    all.filter(|link| links[*link].parent == Some(index))
        .collect()
}

fn weighs_nothing(link: &Link) -> bool {
    link.mass_kg == 0.0 && link.inertia_kg_m2 == Matrix3::zeros()
}

/// What MuJoCo refuses to move.
fn refused(robot: &Robot, links: &[Link]) -> Option<String> {
    let is_refused = |index: &usize| {
        let link = &links[*index];
        let is_point = link.mass_kg == 0.0 || link.inertia_kg_m2 == Matrix3::zeros();
        is_point && !(weighs_nothing(link) && below(links, *index).len() == 1)
    };
    let refused = (0..links.len()).filter(is_refused);
    let names: Vec<&str> = refused
        .map(|index| robot.joints[index].name.as_str())
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "{}: MuJoCo refuses a body that moves without mass or inertia; give its link both",
            names.join(", ")
        )
    })
}

fn is_said(effect: &Effect) -> bool {
    matches!(
        effect,
        Effect::CoulombFriction { .. }
            | Effect::ViscousFriction { .. }
            | Effect::JointSpring { .. }
            | Effect::RotorInertia { .. }
    )
}

fn inertial(link: &Link) -> Option<String> {
    let i = Symmetric::of(&link.inertia_kg_m2);
    (!weighs_nothing(link)).then(|| {
        format!(
            "<inertial pos=\"{}\" mass=\"{}\" fullinertia=\"{}\"/>",
            vector(&link.centre_of_mass_m),
            link.mass_kg,
            numbers(&[i.xx, i.yy, i.zz, i.xy, i.xz, i.yz])
        )
    })
}

/// `frame` is the joint's in that of its body.
fn joint(joint: &RobotJoint, link: &Link, frame: &Isometry3<f64>) -> String {
    let kind = match link.kind {
        JointKind::Revolute => "hinge",
        JointKind::Prismatic => "slide",
    };
    let mut text = format!(
        "<joint name=\"{}\" type=\"{kind}\" axis=\"{}\"",
        in_attribute(&joint.name),
        vector(&(frame.rotation * link.axis))
    );
    if frame.translation.vector != Vector3::zeros() {
        let place = vector(&frame.translation.vector);
        let _ = write!(text, " pos=\"{place}\"");
    }
    let mut attribute = |key: &str, value: &str| {
        let _ = write!(text, " {key}=\"{value}\"");
    };
    if let Some(range) = &joint.position_limit_rad {
        attribute("range", &numbers(range));
    }
    if let Some(limit_nm) = joint.torque_limit_nm {
        let limit_nm = limit_nm * joint.gear_ratio.abs();
        attribute("actuatorfrcrange", &numbers(&[-limit_nm, limit_nm]));
    }
    let added = sum_of(joint, |effect| match effect {
        Effect::RotorInertia { inertia_kg_m2 } => Some(*inertia_kg_m2),
        _ => None,
    });
    let armature = (joint.rotor_inertia_kg_m2 + added) * joint.gear_ratio.powi(2);
    let (stiffness, rest) = spring(joint);
    let values = [
        ("armature", armature),
        ("damping", sum_of(joint, viscous_nm_s_rad)),
        ("frictionloss", sum_of(joint, coulomb_nm)),
        ("stiffness", stiffness),
        ("springref", rest),
    ];
    for (key, value) in values {
        if value != 0.0 {
            attribute(key, &value.to_string());
        }
    }
    text + "/>"
}

/// All springs as one.
fn spring(joint: &RobotJoint) -> (f64, f64) {
    let springs = joint.effects.iter().filter_map(|effect| match effect {
        Effect::JointSpring {
            stiffness_nm_rad,
            rest_rad,
        } => Some((*stiffness_nm_rad, *rest_rad)),
        _ => None,
    });
    let (stiffness, moment) = springs.fold((0.0, 0.0), |(sum, moment), (stiffness, rest)| {
        (sum + stiffness, moment + stiffness * rest)
    });
    (
        stiffness,
        if stiffness == 0.0 {
            0.0
        } else {
            moment / stiffness
        },
    )
}

fn control_left_out(control: &Control) -> Option<String> {
    let mut parts = Vec::new();
    match control.kind {
        ControlKind::PdFeedforward => {
            parts.push("damping of the velocity's error (kv damps the velocity)");
        }
        ControlKind::VelocityPi => parts.push("integral of the velocity's error"),
        ControlKind::OpenLoopTorque | ControlKind::Unknown => {}
    }
    if control.feedforward != Feedforward::None {
        parts.push("feedforward");
    }
    if control.feedback == Feedback::Motor {
        parts.push("encoder before the gear");
    }
    if control.velocity_filter_hz > 0.0 {
        parts.push("filter of the velocity");
    }
    if control.delay_cycles > 0 {
        parts.push("cycle from sample to command");
    }
    (!parts.is_empty()).then(|| format!("control: MJCF has no {}", parts.join(", no ")))
}
