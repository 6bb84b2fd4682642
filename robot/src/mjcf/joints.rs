//! Joints: hinges and slides with what their drives are known to do.

use joint_model::rigid_body::JointKind;
use nalgebra::{Isometry3, Unit, Vector3};

use super::classes::View;
use super::{Parts, Reader};
use crate::error::RobotError;
use crate::model::{ElementOfJoint, Joint, Mimic, Model, moved};
use crate::xml::Element;
use crate::{Effect, RobotJoint};

/// A joint, its frame in the body's, and what turns that to where the joint is at zero.
pub type Joined = (Joint, Isometry3<f64>, Isometry3<f64>);

impl<'a> Reader<'a> {
    /// The joints of a body, from its parent on. What has more than one degree of freedom is taken as fixed.
    pub(super) fn joints(
        &mut self,
        body: &'a Element,
        parts: &Parts<'a>,
    ) -> Result<Vec<Joined>, RobotError> {
        let mut joints = Vec::new();
        for (element, frame, class) in &parts.joints {
            let view = self.classes.view(element, *class)?;
            let kind = match view.attribute("type").unwrap_or("hinge") {
                _ if element.tag() == "freejoint" => "free",
                kind => kind,
            };
            let kind = match kind {
                "hinge" => JointKind::Revolute,
                "slide" => JointKind::Prismatic,
                "free" | "ball" => {
                    let words = format!("{kind} joint, taken as fixed where it stands");
                    self.model.notes.push(element.note(&words));
                    continue;
                }
                other => {
                    return Err(element.invalid(format!(
                        "type {other:?} is not known; make it hinge, slide, ball or free"
                    )));
                }
            };
            let joint = self.joint(&view, kind, frame, body, joints.len())?;
            let anchor_m =
                frame * nalgebra::Point3::from(view.numbers::<3>("pos")?.unwrap_or_default());
            // MuJoCo's model stands at `ref`, where this one's joint is at zero
            let reference = view.number("ref")?.unwrap_or(0.0) * self.unit(kind);
            let at_zero = moved(kind, &joint.axis, -reference);
            joints.push((joint, anchor_m.coords.into(), at_zero));
        }
        Ok(joints)
    }

    /// What 1 is of a position: a degree, a radian or a metre.
    fn unit(&self, kind: JointKind) -> f64 {
        match kind {
            JointKind::Revolute => self.compiler.angle_rad,
            JointKind::Prismatic => 1.0,
        }
    }

    fn joint(
        &self,
        view: &View,
        kind: JointKind,
        frame: &Isometry3<f64>,
        body: &Element,
        number: usize,
    ) -> Result<Joint, RobotError> {
        let element = view.element;
        let axis = view.numbers::<3>("axis")?.unwrap_or([0.0, 0.0, 1.0]);
        let axis = Unit::try_new(Vector3::from(axis), 1e-12)
            .ok_or_else(|| element.invalid(format!("axis {axis:?} must not be zero")))?;
        let unnamed = || match body.attribute("name") {
            Some(body) if number == 0 => format!("{body}_joint"),
            Some(body) => format!("{body}_joint{}", number + 1),
            None => format!("joint{}", self.model.bodies.len() + number + 1),
        };
        let name = element
            .attribute("name")
            .map_or_else(unnamed, str::to_owned);
        let at_least_zero = |key: &str| -> Result<f64, RobotError> {
            let value = view.number(key)?.unwrap_or(0.0);
            if value < 0.0 {
                return Err(element.invalid(format!("{key} = {value} must be zero or above")));
            }
            Ok(value)
        };
        let mut drive = RobotJoint::named(&name);
        drive.rotor_inertia_kg_m2 = at_least_zero("armature")?;
        let autolimits = self.compiler.autolimits;
        let range = view.range("range", "limited", autolimits)?;
        drive.position_limit_rad = range.map(|range| range.map(|end| end * self.unit(kind)));
        let force = view.range("actuatorfrcrange", "actuatorfrclimited", autolimits)?;
        drive.torque_limit_nm = force.map(largest);
        let coulomb_nm = at_least_zero("frictionloss")?;
        let viscous_nm_s_rad = at_least_zero("damping")?;
        let stiffness_nm_rad = at_least_zero("stiffness")?;
        let rest_rad = view.number("springref")?.unwrap_or(0.0) * self.unit(kind);
        let known = [
            (coulomb_nm, Effect::CoulombFriction { coulomb_nm }),
            (
                viscous_nm_s_rad,
                Effect::ViscousFriction { viscous_nm_s_rad },
            ),
            (
                stiffness_nm_rad,
                Effect::JointSpring {
                    stiffness_nm_rad,
                    rest_rad,
                },
            ),
        ];
        let there = known.into_iter().filter(|(size, _)| *size > 0.0);
        drive.effects = there.map(|(_, effect)| effect).collect();
        Ok(Joint {
            place: element.place(),
            kind,
            axis: frame.rotation * axis,
            mimic: None,
            drive,
            law: None,
            element: ElementOfJoint {
                at: element.at(),
                ..ElementOfJoint::default()
            },
            actuators: Vec::new(),
        })
    }
}

/// The larger end of a range of torques: limits here are the same either way.
pub fn largest([low, high]: [f64; 2]) -> f64 {
    low.abs().max(high.abs())
}

/// `<equality><joint>` that ties one joint to another along a line: the first mimics the second, as in a gripper.
pub fn couple(root: &Element, model: &mut Model) -> Result<(), RobotError> {
    for equality in root.all("equality").flat_map(Element::children) {
        let is_off = equality.attribute("active") == Some("false");
        if is_off {
            continue;
        }
        if equality.tag() != "joint" {
            let words = "not read: it closes a loop, which the bodies here do not have";
            model.notes.push(equality.note(words));
            continue;
        }
        let follower = equality.required("joint1")?;
        let leader = equality.attribute("joint2");
        let mut polynomial = equality.list("polycoef")?.unwrap_or(vec![0.0, 1.0]);
        polynomial.resize(5, 0.0);
        let is_line = polynomial[2..].iter().all(|factor| *factor == 0.0);
        for name in std::iter::once(follower).chain(leader) {
            if model.joint(name).is_none() {
                let known = model.joint_names();
                return Err(equality.place().unknown("joint", name, &known));
            }
        }
        let mut joints = model
            .bodies
            .iter_mut()
            .filter_map(|body| body.joint.as_mut());
        let found = joints.find(|joint| joint.drive.name == follower);
        match (found, leader) {
            (Some(joint), Some(leader)) if is_line => {
                joint.mimic = Some(Mimic {
                    joint: leader.to_owned(),
                    multiplier: polynomial[1],
                    offset: polynomial[0],
                });
            }
            _ => model
                .notes
                .push(equality.note("not read: it is no line between two joints")),
        }
    }
    Ok(())
}
