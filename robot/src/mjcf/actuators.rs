//! Actuators: which law made each joint's torque, and its limits.

use super::classes::{Classes, View};
use super::joints::largest;
use crate::ControlKind;
use crate::error::RobotError;
use crate::model::{Joint, Law, Model};
use crate::xml::Element;

/// Takes laws and limits of the actuators over into the joints.
pub fn read(root: &Element, classes: &Classes, model: &mut Model) -> Result<(), RobotError> {
    let autolimits = root
        .all("compiler")
        .filter_map(|compiler| compiler.attribute("autolimits"))
        .next_back()
        != Some("false");
    let mut damps_velocity = None;
    for element in root.all("actuator").flat_map(Element::children) {
        // a copy: views live as long as what they look at
        let view = classes.view(element, None)?;
        let name = view.attribute("joint").or(view.attribute("jointinparent"));
        let Some(name) = name else {
            let words = "not read: it drives no joint by itself";
            model.notes.push(element.note(words));
            continue;
        };
        let law = law(&view)?;
        let gear = view.list("gear")?.and_then(|gear| gear.first().copied());
        let gear = gear.unwrap_or(1.0);
        let limit = limit(&view, autolimits, law.as_ref(), gear)?;
        let names: Vec<String> = model
            .joints()
            .map(|joint| joint.drive.name.clone())
            .collect();
        let Some(joint) = joint_of(model, name) else {
            let known = root_has_joint(root, name);
            if known {
                continue;
            }
            return Err(element.place().unknown("joint", name, &names));
        };
        let limits = [joint.drive.torque_limit_nm, limit];
        joint.drive.torque_limit_nm = limits.into_iter().flatten().reduce(f64::min);
        match law {
            None => model
                .notes
                .push(element.note("its law is not one that is read")),
            Some(_) if joint.law.is_some() => {
                let words = format!("joint `{name}` has another actuator, which is the one read");
                model.notes.push(element.note(&words));
            }
            Some(law) => {
                if law.kind == ControlKind::PdFeedforward && law.derivative > 0.0 {
                    damps_velocity.get_or_insert(element);
                }
                joint.law = Some(Law {
                    proportional: law.proportional * gear * gear,
                    derivative: law.derivative * gear * gear,
                    ..law
                });
            }
        }
    }
    if let Some(element) = damps_velocity {
        let words = "MuJoCo's kv is on the velocity; it is read as on the velocity's error, the same while the reference rests";
        model.notes.push(element.note(words));
    }
    let mut kinds: Vec<ControlKind> = Vec::new();
    for law in model.joints().filter_map(|joint| joint.law.as_ref()) {
        if !kinds.contains(&law.kind) {
            kinds.push(law.kind);
        }
    }
    if kinds.len() > 1 {
        let words = "actuators of several kinds; the controller is known only to robots whose joints have one";
        model.notes.push(words.to_owned());
    }
    Ok(())
}

fn joint_of<'m>(model: &'m mut Model, name: &str) -> Option<&'m mut Joint> {
    let mut joints = model
        .bodies
        .iter_mut()
        .filter_map(|body| body.joint.as_mut());
    joints.find(|joint| joint.drive.name == name)
}

/// Whether there is such a joint, of a kind that is taken as fixed.
fn root_has_joint(root: &Element, name: &str) -> bool {
    let mut open: Vec<&Element> = root.all("worldbody").collect();
    while let Some(element) = open.pop() {
        let is_joint = matches!(element.tag(), "joint" | "freejoint");
        if is_joint && element.attribute("name") == Some(name) {
            return true;
        }
        open.extend(element.children());
    }
    false
}

/// The law on the actuator's own length, `None` where it is another.
fn law(view: &View) -> Result<Option<Law>, RobotError> {
    let known = |kind, proportional, derivative| {
        Some(Law {
            kind,
            proportional,
            derivative,
        })
    };
    let kv = view.number("kv")?;
    Ok(match view.element.tag() {
        "motor" => known(ControlKind::OpenLoopTorque, 0.0, 0.0),
        "position" => {
            let is_filtered = view.number("timeconst")?.is_some_and(|time_s| time_s > 0.0);
            if is_filtered || (view.number("dampratio")?.is_some() && kv.is_none()) {
                return Ok(None);
            }
            let kp = view.number("kp")?.unwrap_or(1.0);
            known(ControlKind::PdFeedforward, kp, kv.unwrap_or(0.0))
        }
        "velocity" => known(ControlKind::VelocityPi, 0.0, kv.unwrap_or(1.0)),
        "general" => general(view)?,
        _ => None,
    })
}

/// Fixed gain and an affine bias, where they make one of the laws.
fn general(view: &View) -> Result<Option<Law>, RobotError> {
    let is_plain = |key: &str, plain: &str| view.attribute(key).is_none_or(|value| value == plain);
    if !is_plain("dyntype", "none") || !is_plain("gaintype", "fixed") {
        return Ok(None);
    }
    let gain = view
        .list("gainprm")?
        .and_then(|values| values.first().copied());
    let gain = gain.unwrap_or(1.0);
    let mut bias = view.list("biasprm")?.unwrap_or_default();
    bias.resize(3, 0.0);
    let bias = match view.attribute("biastype").unwrap_or("none") {
        "none" => [0.0; 3],
        "affine" => [bias[0], bias[1], bias[2]],
        _ => return Ok(None),
    };
    let law = |kind, proportional, derivative| {
        Some(Law {
            kind,
            proportional,
            derivative,
        })
    };
    Ok(match bias {
        [0.0, 0.0, 0.0] => law(ControlKind::OpenLoopTorque, 0.0, 0.0),
        [0.0, position, velocity] if position == -gain && velocity <= 0.0 => {
            law(ControlKind::PdFeedforward, gain, -velocity)
        }
        [0.0, 0.0, velocity] if velocity == -gain => law(ControlKind::VelocityPi, 0.0, gain),
        _ => None,
    })
}

/// The largest torque at the joint.
fn limit(
    view: &View,
    autolimits: bool,
    law: Option<&Law>,
    gear: f64,
) -> Result<Option<f64>, RobotError> {
    let force = view.range("forcerange", "forcelimited", autolimits)?;
    let control = view.range("ctrlrange", "ctrllimited", autolimits)?;
    // of a motor the control is its torque
    let gain = match view.element.tag() {
        "general" => view
            .list("gainprm")?
            .and_then(|values| values.first().copied()),
        _ => None,
    };
    let is_motor = law.is_some_and(|law| law.kind == ControlKind::OpenLoopTorque);
    let control_nm = control.filter(|_| is_motor).map(largest);
    let control_nm = control_nm.map(|control| control * gain.unwrap_or(1.0).abs());
    let limits = [force.map(largest), control_nm];
    let limit_nm = limits.into_iter().flatten().reduce(f64::min);
    Ok(limit_nm
        .map(|limit_nm| limit_nm * gear.abs())
        .filter(|limit_nm| *limit_nm > 0.0))
}
