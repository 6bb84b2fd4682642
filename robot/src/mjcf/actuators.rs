//! Actuators: which law made each joint's torque, and its limits.

use super::classes::{Classes, View};
use super::joints::largest;
use crate::ControlKind;
use crate::error::RobotError;
use crate::model::{Actuator, Joint, Law, Model};
use crate::xml::Element;

/// MuJoCo's position actuators are not quite the law they are read as.
const KV_IS_ON_VELOCITY: &str = "MuJoCo's kv is on the velocity; it is read as on the velocity's error, the same while the reference rests";

/// Takes laws and limits of the actuators over into the joints.
pub fn read(
    root: &Element,
    classes: &Classes,
    autolimits: bool,
    model: &mut Model,
) -> Result<(), RobotError> {
    for element in root.all("actuator").flat_map(Element::children) {
        let view = classes.view(element, None)?;
        let name = view.attribute("joint").or(view.attribute("jointinparent"));
        let Some(name) = name else {
            let words = "not read: it drives no joint by itself";
            model.notes.push(element.note(words));
            continue;
        };
        let gear = view.number("gear")?.unwrap_or(1.0);
        let law = law(&view)?;
        let limit_nm = limit(&view, autolimits, law.as_ref(), gear)?;
        match joint_of(model, name) {
            Some(joint) => {
                let limits_nm = [joint.drive.torque_limit_nm, limit_nm];
                joint.drive.torque_limit_nm = limits_nm.into_iter().flatten().reduce(f64::min);
                joint
                    .actuators
                    .push(actuator(&view, autolimits, law.as_ref())?);
                let words = commanded_by(joint, law, gear);
                model.notes.extend(words.map(|words| element.note(words)));
            }
            None if is_of_other_kind(root, name) => {
                let words = "not read: its joint is taken as fixed";
                model.notes.push(element.note(words));
            }
            None => return Err(element.place().unknown("joint", name, &model.joint_names())),
        }
    }
    note_laws(root, model);
    Ok(())
}

/// What it says itself and by its class.
fn actuator(view: &View, autolimits: bool, law: Option<&Law>) -> Result<Actuator, RobotError> {
    let list =
        |key: &str| -> Result<Vec<f64>, RobotError> { Ok(view.list(key)?.unwrap_or_default()) };
    Ok(Actuator {
        at: view.element.at(),
        tag: view.element.tag().to_owned(),
        kind: law.map(|law| law.kind),
        gear: list("gear")?,
        kp: view.number("kp")?,
        kv: view.number("kv")?,
        gain: list("gainprm")?,
        bias: list("biasprm")?,
        force_range: view.range("forcerange", "forcelimited", autolimits)?,
        delay_s: view.number("delay")?.unwrap_or(0.0),
    })
}

/// Gives the joint its law, and says what is odd about it.
fn commanded_by(joint: &mut Joint, law: Option<Law>, gear: f64) -> Option<&'static str> {
    if joint.law.is_some() {
        return Some("not read: its joint has another actuator, whose law is the one read");
    }
    let (law, words) = match law {
        Some(law) => (law, None),
        None => (
            Law {
                kind: ControlKind::Unknown,
                proportional: 0.0,
                derivative: 0.0,
            },
            Some("its law is not one that is read"),
        ),
    };
    // the actuator's length and force are the joint's, times and over the gear
    joint.law = Some(Law {
        proportional: law.proportional * gear * gear,
        derivative: law.derivative * gear * gear,
        ..law
    });
    words
}

/// What is to be said of all laws together, once.
fn note_laws(root: &Element, model: &mut Model) {
    let laws: Vec<&Law> = model
        .joints()
        .filter_map(|joint| joint.law.as_ref())
        .collect();
    let damps = |law: &&Law| law.kind == ControlKind::PdFeedforward && law.derivative > 0.0;
    let first = root.all("actuator").flat_map(Element::children).next();
    let mut notes = Vec::new();
    if let Some(element) = first.filter(|_| laws.iter().any(damps)) {
        notes.push(element.note(KV_IS_ON_VELOCITY));
    }
    if laws.windows(2).any(|pair| pair[0].kind != pair[1].kind) {
        let words = "actuators of several kinds; the controller is known only to robots whose joints have one";
        notes.push(words.to_owned());
    }
    model.notes.extend(notes);
}

fn joint_of<'m>(model: &'m mut Model, name: &str) -> Option<&'m mut Joint> {
    let mut joints = model
        .bodies
        .iter_mut()
        .filter_map(|body| body.joint.as_mut());
    joints.find(|joint| joint.drive.name == name)
}

/// Whether there is such a joint all the same, of a kind that is taken as fixed.
fn is_of_other_kind(root: &Element, name: &str) -> bool {
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
