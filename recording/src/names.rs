//! What the names of columns and arrays say: position, velocity or torque; asked for or measured; which side of the gear;
//! in which unit.

use crate::Signal;
use crate::clock::time_column;
use crate::columns::{TIME, joint_and_signal};
use std::f64::consts::PI;

/// What kind of value a name is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Quantity {
    Position,
    Velocity,
    Torque,
    Current,
    Temperature,
}

/// What a name says.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Meaning {
    pub(crate) quantity: Quantity,
    /// What the joint was asked to do, or the torque it was sent.
    pub(crate) is_reference: bool,
    /// Before the gear (true) or after it, where the name says so.
    pub(crate) is_motor: Option<bool>,
    /// SI per unit, where the name tells a unit.
    pub(crate) scale: Option<f64>,
    /// What is left of the name: the joint.
    pub(crate) rest: Vec<String>,
}

const POSITION: &[&str] = &[
    "position",
    "positions",
    "pos",
    "angle",
    "angles",
    "q",
    "qpos",
    "theta",
    "jointpos",
];
/// A position where nothing else says what the state is of.
const STATE: &str = "state";
const VELOCITY: &[&str] = &[
    "velocity",
    "velocities",
    "vel",
    "speed",
    "qd",
    "dq",
    "qdot",
    "qvel",
    "omega",
    "qp",
    "dot",
];
const TORQUE: &[&str] = &[
    "torque", "torques", "tau", "effort", "efforts", "eff", "moment", "trq", "tq", "tor",
];
const CURRENT: &[&str] = &["current", "currents", "amps", "cur"];
const TEMPERATURE: &[&str] = &["temperature", "temp", "temperatures"];
const REFERENCE: &[&str] = &[
    "reference",
    "ref",
    "req",
    "requested",
    "desired",
    "des",
    "target",
    "command",
    "commanded",
    "cmd",
    "control",
    "ctrl",
    "con",
    "goal",
    "setpoint",
    ACTION,
    "d",
];
const ACTION: &str = "action";
const MOTOR: &[&str] = &["motor", "mot", "rotor", "drive"];
const LINK: &[&str] = &["link", "joint", "load", "output"];
/// Said of measured values, and of nothing else.
const MEASURED: &[&str] = &["measured", "meas", "actual", "act", "feedback", "fb", "fbk"];
/// Said of what stands for measured values where there are none.
const ESTIMATED: &[&str] = &["est", "estimated", "applied"];
/// Said of what a model makes.
const COMPUTED: &[&str] = &[
    "cal",
    "calc",
    "calculated",
    "computed",
    "model",
    "predicted",
    "pred",
    "sim",
    "simulated",
];
/// Said of what is computed from values of that kind, or bounds them.
const OF_OTHERS: &[&str] = &[
    "error",
    "err",
    "std",
    "var",
    "min",
    "max",
    "limit",
    "offset",
    "ext",
    "external",
    "ddot",
    "acc",
    "accel",
    "acceleration",
];
/// Said of values without saying anything.
const FILLERS: &[&str] = &[
    "observation",
    "observations",
    "obs",
    "s",
    "data",
    "dof",
    "dofs",
    "field",
];
/// What names of quantities have behind them before an axis' number: `posa1`, `torquej2`.
const AXES: &[&str] = &["joint", "axis", "j", "a"];
/// What a joint that slides has instead of an angle and a torque.
const OF_SLIDES: &[(&str, Quantity)] = &[
    ("x", Quantity::Position),
    ("displacement", Quantity::Position),
    ("v", Quantity::Velocity),
    ("xd", Quantity::Velocity),
    ("dx", Quantity::Velocity),
    ("xdot", Quantity::Velocity),
    ("f", Quantity::Torque),
    ("force", Quantity::Torque),
];
/// Its units, as [`UNITS`] has them.
const UNITS_OF_SLIDES: &[(&str, Quantity, f64)] = &[
    ("m", Quantity::Position, 1.0),
    ("cm", Quantity::Position, 1e-2),
    ("mm", Quantity::Position, 1e-3),
    ("n", Quantity::Torque, 1.0),
    ("mn", Quantity::Torque, 1e-3),
    ("kn", Quantity::Torque, 1e3),
];
/// Unit, what it is a unit of, and SI per unit. Of a velocity per second where a time does not follow.
const UNITS: &[(&str, Quantity, f64)] = &[
    ("rad", Quantity::Position, 1.0),
    ("rads", Quantity::Position, 1.0),
    ("radian", Quantity::Position, 1.0),
    ("radians", Quantity::Position, 1.0),
    ("deg", Quantity::Position, PI / 180.0),
    ("degree", Quantity::Position, PI / 180.0),
    ("degrees", Quantity::Position, PI / 180.0),
    ("degs", Quantity::Position, PI / 180.0),
    ("mrad", Quantity::Position, 1e-3),
    ("turns", Quantity::Position, 2.0 * PI),
    ("rev", Quantity::Position, 2.0 * PI),
    ("rpm", Quantity::Velocity, 2.0 * PI / 60.0),
    ("nm", Quantity::Torque, 1.0),
    ("mnm", Quantity::Torque, 1e-3),
    ("ncm", Quantity::Torque, 1e-2),
    ("nmm", Quantity::Torque, 1e-3),
    ("knm", Quantity::Torque, 1e3),
    ("a", Quantity::Current, 1.0),
    ("amps", Quantity::Current, 1.0),
    ("ampere", Quantity::Current, 1.0),
    ("amperes", Quantity::Current, 1.0),
    ("ma", Quantity::Current, 1e-3),
    ("degc", Quantity::Temperature, 1.0),
    ("c", Quantity::Temperature, 1.0),
    ("celsius", Quantity::Temperature, 1.0),
];

/// Units of other things than joints, and of times.
const OTHER_UNITS: &[&str] = &[
    "s", "sec", "seconds", "ms", "us", "µs", "ns", "min", "h", "hz", "khz", "m", "mm", "cm", "n",
    "kn", "v", "mv", "w", "kg", "g", "k", "bool", "int", "1", "2",
];
/// Of those, what no joint's position, velocity, torque, current or temperature is in.
const NO_JOINTS: &[&str] = &["v", "mv", "w", "hz", "khz", "kg", "g", "bool"];
/// How units are written, and the words that are known for them.
const SPELLINGS: &[(&str, &str)] = &[
    ("°C", "degC"),
    ("Deg C", "degC"),
    ("deg C", "degC"),
    ("°", "deg"),
    ("º", "deg"),
    ("rev/min", "rpm"),
    ("U/min", "rpm"),
    ("1/min", "rpm"),
    ("N·m", "Nm"),
    ("N⋅m", "Nm"),
    ("N*m", "Nm"),
    ("N.m", "Nm"),
    ("N-m", "Nm"),
    ("newton_meters", "Nm"),
    ("newton_metres", "Nm"),
    ("_per_second", "_s"),
    ("_per_sec", "_s"),
    ("_per_s", "_s"),
    ("set_point", "setpoint"),
    (PROCESS_VALUE, "position"),
];
/// What ROS's controllers of one joint measure: its position, or its velocity where that is what they control.
pub(crate) const PROCESS_VALUE: &str = "process_value";

/// Whether these are the units of columns: more known ones than words that are none, and no number.
pub(crate) fn are_units(fields: &[String]) -> bool {
    let is_known = |word: &String| {
        UNITS.iter().any(|(unit, _, _)| unit == word) || OTHER_UNITS.contains(&&**word)
    };
    let nothing = |field: &str| matches!(field.trim_matches(['[', ']', '(', ')']), "" | "-" | "%");
    let (mut known, mut unknown) = (0, 0);
    for field in fields.iter().filter(|field| !nothing(field)) {
        if field.replacen(',', ".", 1).parse::<f64>().is_ok() {
            return false;
        }
        let words = words(&spelled(field));
        match !words.is_empty() && words.iter().all(is_known) {
            true => known += 1,
            false => unknown += 1,
        }
    }
    known > unknown
}

/// A name with the units in it written as they are known.
fn spelled(name: &str) -> String {
    let mut name = name.to_owned();
    for (written, known) in SPELLINGS {
        name = name.replace(written, known);
    }
    name
}

/// What is left of a column's name without that joint's, if it is in there, in words parted as may be: `joint 1` is `joint1`.
pub(crate) fn without_joint(column: &str, joint: &str) -> Option<String> {
    let (mut column, joint) = (words(&spelled(column)), together(&words(joint)));
    let starts = 0..column.len();
    let mut parts = starts.flat_map(|from| (from..column.len()).map(move |to| from..=to));
    let part = parts.find(|part| together(&column[part.clone()]) == joint)?;
    column.drain(part);
    Some(column.join("_"))
}

/// Words as one; two numbers are not one.
fn together(words: &[String]) -> String {
    let mut all = String::new();
    for word in words {
        let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
        if is_digit(all.chars().last()) && is_digit(word.chars().next()) {
            all.push('_');
        }
        all.push_str(word);
    }
    all
}

/// How far from a measurement a name says that its values are: measured, nothing, estimated, a model's.
pub(crate) fn remoteness(name: &str) -> u8 {
    let words = words(name);
    let says = |known: &[&str]| {
        words
            .iter()
            .any(|word| known.contains(&without_number(word)))
    };
    match (says(COMPUTED), says(MEASURED), says(ESTIMATED)) {
        (true, _, _) => 3,
        (_, true, _) => 0,
        (_, _, true) => 2,
        _ => 1,
    }
}

/// Whether a word says nothing about what kind of value it is beside.
fn is_filler(word: &str) -> bool {
    [FILLERS, MEASURED, ESTIMATED]
        .iter()
        .any(|known| known.contains(&word))
}

/// The kind of value that a word is of.
fn quantity_of(word: &str) -> Option<Quantity> {
    let known = [
        (POSITION, Quantity::Position),
        (VELOCITY, Quantity::Velocity),
        (TORQUE, Quantity::Torque),
        (CURRENT, Quantity::Current),
        (TEMPERATURE, Quantity::Temperature),
    ];
    let mut known = known.into_iter();
    known.find_map(|(words, quantity)| words.contains(&word).then_some(quantity))
}

/// `pos` of the `posa` of `posa1`, where that is a word.
fn without_axis(letters: &str) -> &str {
    let stems = AXES.iter().filter_map(|axis| letters.strip_suffix(axis));
    let mut known = stems.filter(|stem| stem.len() > 2 && quantity_of(stem).is_some());
    known.next().unwrap_or(letters)
}

/// How many words of a name say nothing that is known: `filt` in `pos_filt1`.
pub(crate) fn words_unknown(name: &str) -> usize {
    let rest = meaning(name).map_or_else(Vec::new, |meaning| meaning.rest);
    let is_unknown = |word: &&String| !matches!(without_number(word), "" | "joint" | "j" | "axis");
    rest.iter().filter(is_unknown).count()
}

/// What names of one numbered family have in common beside their quantity: `hand` of `q_hand1`, nothing of `q1`, `joint1_pos` and
/// `tau_meas1`. Of the rest of a name.
pub(crate) fn family(rest: &[String]) -> String {
    let Some((last, before)) = rest.split_last() else {
        return String::new();
    };
    let words = before.iter().map(|word| &**word);
    let words = words.chain([without_number(last)]);
    let says_more = |word: &&str| {
        let is_any = matches!(*word, "" | "joint" | "j" | "axis");
        !is_any && !is_filler(word)
    };
    words.filter(says_more).collect::<Vec<_>>().join("_")
}

/// A word without the number that it ends with.
fn without_number(word: &str) -> &str {
    word.trim_end_matches(|c: char| c.is_ascii_digit())
}

/// Whether a name is that of a joint and says nothing else: `joint_3`, `J1`, `Axis 2`.
pub(crate) fn is_numbered_joint(name: &str) -> bool {
    let name = words(name).concat();
    let letters = name.trim_end_matches(|c: char| c.is_ascii_digit());
    matches!(letters, "joint" | "j" | "axis") && letters.len() < name.len()
}

/// The name of a column and the unit that another line tells of it, unless the name tells it already.
pub(crate) fn with_unit(name: String, unit: &str) -> String {
    let unit = unit.trim_matches(['[', ']', '(', ')']).trim();
    let is_told = name == TIME
        || joint_and_signal(&name).is_some()
        || time_column(&name).flatten().is_some()
        || meaning(&name).is_some_and(|meaning| meaning.scale.is_some());
    match unit {
        "" | "-" => name,
        _ if is_told => name,
        unit => format!("{name} [{unit}]"),
    }
}

/// The words of a name, in small letters: parted by marks and by capitals.
pub(crate) fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = vec![String::new()];
    let mut before = ' ';
    for c in name.chars() {
        // `mA` and `kNm` are one word.
        let prefix = words
            .last()
            .is_some_and(|word| matches!(word.as_str(), "m" | "k"));
        let begins = c.is_uppercase() && before.is_lowercase() && !prefix;
        if !c.is_alphanumeric() || begins {
            words.push(String::new());
        }
        if c.is_alphanumeric()
            && let Some(word) = words.last_mut()
        {
            word.extend(c.to_lowercase());
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

/// What stands in brackets at a name's end.
fn in_brackets(name: &str) -> Option<String> {
    let name = spelled(name);
    let (open, inside) = [('[', ']'), ('(', ')')]
        .into_iter()
        .find_map(|(open, close)| Some((open, name.trim_end().strip_suffix(close)?)))?;
    let written = &inside[inside.rfind(open)? + 1..];
    Some(written.trim().to_lowercase())
}

/// What the name of a column or an array says, if it says what kind of value it holds.
pub(crate) fn meaning(name: &str) -> Option<Meaning> {
    read_name(name, false)
}

/// The same of a joint that slides: the rad and Nm of its signals are m and N.
pub(crate) fn meaning_of_slide(name: &str) -> Option<Meaning> {
    read_name(name, true)
}

fn read_name(name: &str, slides: bool) -> Option<Meaning> {
    let (mut quantity, mut is_reference, mut is_motor, mut unit) = (None, false, None, None);
    let (mut is_state, mut is_action) = (false, false);
    let mut rest = Vec::new();
    for word in words(&spelled(name)) {
        if OF_OTHERS.contains(&&*word) {
            return None;
        }
        let letters = without_number(&word);
        let number = &word[letters.len()..];
        let letters = if number.is_empty() {
            letters
        } else {
            without_axis(letters)
        };
        let is = |known: &[&str]| known.contains(&letters);
        let named = quantity_of(letters);
        let unit_of_word = UNITS
            .iter()
            .find(|(unit, _, _)| *unit == letters && number.is_empty());
        // the velocity of an angle is one
        let is_new = |named: &Quantity| match quantity {
            None => true,
            Some(known) => (known, *named) == (Quantity::Position, Quantity::Velocity),
        };
        if let Some(named) = named.filter(is_new) {
            quantity = Some(named);
        } else if quantity.is_none() && word == "rpm" {
            (quantity, unit) = (Some(Quantity::Velocity), unit_of_word);
            continue;
        } else if letters == STATE {
            is_state = true;
        } else if is(REFERENCE) {
            is_reference = true;
            is_action |= letters == ACTION;
        } else if is(MOTOR) || is(LINK) && number.is_empty() {
            is_motor = Some(is(MOTOR));
        } else if let Some(found) = unit_of_word.filter(|_| quantity.is_some()) {
            unit = Some(found);
            continue;
        } else if !(is_filler(letters) && number.is_empty()) {
            rest.push(word.clone());
            continue;
        }
        if !number.is_empty() {
            rest.push(number.to_owned());
        }
    }
    if slides {
        let of_slide = |word: &str| OF_SLIDES.iter().find(|(known, _)| *known == word);
        if quantity.is_none()
            && let Some(word) = rest
                .iter_mut()
                .find(|word| of_slide(without_number(word)).is_some())
        {
            quantity = of_slide(without_number(word)).map(|(_, quantity)| *quantity);
            *word = word
                .trim_start_matches(|c: char| !c.is_ascii_digit())
                .to_owned();
        }
        let unit_of = |word: &String| UNITS_OF_SLIDES.iter().find(|(known, _, _)| known == word);
        unit = unit.or_else(|| rest.iter().find_map(unit_of));
        rest.retain(|word| !word.is_empty() && unit_of(word).is_none());
    }
    // An action with nothing else but a number is where a policy sends the joint.
    let is_number = |word: &String| word.bytes().all(|byte| byte.is_ascii_digit());
    let is_position = is_state || is_action && rest.iter().all(is_number);
    let mut quantity = quantity.or(is_position.then_some(Quantity::Position))?;
    // a unit in brackets is one, and knows better than a word: the current of a motor's q axis is no position
    if let Some(written) = in_brackets(name) {
        if NO_JOINTS.contains(&&*written) {
            return None;
        }
        let known = UNITS.iter().find(|(unit, _, _)| *unit == written);
        if let Some(found) = known
            && !matches!(
                (found.1, quantity),
                (Quantity::Position, Quantity::Velocity)
            )
        {
            quantity = found.1;
            unit = Some(found);
        }
    }
    let scale = unit.and_then(|(_, of, scale)| match (of, quantity) {
        (of, quantity) if *of == quantity => Some(*scale),
        (Quantity::Position, Quantity::Velocity) => Some(*scale),
        _ => None,
    });
    Some(Meaning {
        quantity,
        is_reference,
        is_motor,
        scale,
        rest,
    })
}

impl Meaning {
    /// The signal, and whether the side of the gear was only supposed.
    pub(crate) fn signal(&self) -> (Signal, bool) {
        let is_motor = self.is_motor.unwrap_or(false);
        let supposed = self.is_motor.is_none();
        match (self.quantity, self.is_reference) {
            (Quantity::Position, true) => (Signal::ReferencePositionRad, false),
            (Quantity::Velocity, true) => (Signal::ReferenceVelocityRadS, false),
            (Quantity::Torque, true) => (Signal::CommandTorqueNm, supposed),
            (Quantity::Position, false) if is_motor => (Signal::MotorPositionRad, false),
            (Quantity::Position, false) => (Signal::LinkPositionRad, supposed),
            (Quantity::Velocity, false) if is_motor => (Signal::MotorVelocityRadS, false),
            (Quantity::Velocity, false) => (Signal::LinkVelocityRadS, supposed),
            (Quantity::Torque, false) if is_motor => (Signal::MotorTorqueNm, false),
            (Quantity::Torque, false) => (Signal::JointTorqueNm, supposed),
            (Quantity::Current, _) => (Signal::MotorCurrentA, false),
            (Quantity::Temperature, _) => (Signal::TemperatureC, false),
        }
    }
}

/// The signal of an array that has a column for each joint, by its name alone.
pub(crate) fn array_signal(name: &str) -> Option<Signal> {
    let meaning = meaning(name)?;
    // A torque that was asked for at the joint is no signal: commands are the motor's.
    let unclear = meaning.quantity == Quantity::Torque
        && meaning.is_reference
        && meaning.is_motor != Some(true)
        || remoteness(name) > 1;
    (!unclear && meaning.rest.is_empty()).then(|| meaning.signal().0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_arrays_are_told() {
        for (name, signal) in [
            ("q", Signal::LinkPositionRad),
            ("qd", Signal::LinkVelocityRadS),
            ("dq", Signal::LinkVelocityRadS),
            ("tau", Signal::JointTorqueNm),
            ("q_des", Signal::ReferencePositionRad),
            ("q_d", Signal::ReferencePositionRad),
            ("dq_ref", Signal::ReferenceVelocityRadS),
            ("observation.state", Signal::LinkPositionRad),
            ("action", Signal::ReferencePositionRad),
            ("motor_torque", Signal::MotorTorqueNm),
            ("motorStatePos", Signal::MotorPositionRad),
            ("motorStateTor", Signal::MotorTorqueNm),
            ("motorAction", Signal::ReferencePositionRad),
            ("eff", Signal::JointTorqueNm),
            ("jointPositions", Signal::LinkPositionRad),
            ("des_dof_pos", Signal::ReferencePositionRad),
        ] {
            assert_eq!(array_signal(name), Some(signal), "{name}");
        }
        for other in [
            "tau_des",
            "images",
            "wrench",
            "q_left",
            "error_pos_deg",
            "q_max",
            "tau_est",
            "",
        ] {
            assert_eq!(array_signal(other), None, "{other}");
        }
    }

    #[test]
    fn a_columns_name_tells_joint_side_and_unit() {
        let told = meaning("axis1_motor_position_deg").unwrap();
        assert_eq!(told.signal(), (Signal::MotorPositionRad, false));
        assert_eq!(
            (told.scale, told.rest),
            (Some(PI / 180.0), vec!["axis1".to_owned()])
        );
        let told = meaning("q3 [rad]").unwrap();
        assert_eq!(told.signal(), (Signal::LinkPositionRad, true));
        assert_eq!((told.scale, told.rest), (Some(1.0), vec!["3".to_owned()]));
        let told = meaning("elbow_speed_rpm").unwrap();
        assert_eq!(
            (told.quantity, told.scale),
            (Quantity::Velocity, Some(PI / 30.0))
        );
        for (name, scale) in [("baseAngleVel", None), ("rpm_2", Some(PI / 30.0))] {
            let told = meaning(name).unwrap();
            assert_eq!(
                (told.quantity, told.scale),
                (Quantity::Velocity, scale),
                "{name}"
            );
        }
        assert_eq!(meaning("torAct").unwrap().quantity, Quantity::Torque);
        let told = meaning("torquea2").unwrap();
        assert_eq!(
            (told.quantity, told.rest),
            (Quantity::Torque, vec!["2".to_owned()])
        );
        assert_eq!(meaning("wrist_current_mA").unwrap().scale, Some(1e-3));
        for (name, scale) in [
            ("q [°]", PI / 180.0),
            ("speed (1/min)", PI / 30.0),
            ("tau [N·m]", 1.0),
        ] {
            let told = meaning(name).unwrap();
            assert_eq!((told.scale, told.rest), (Some(scale), vec![]), "{name}");
        }
        for (name, signal, scale) in [
            ("torque_feedback", Signal::JointTorqueNm, None),
            ("feedback_torque", Signal::JointTorqueNm, None),
            ("tau_fb", Signal::JointTorqueNm, None),
            ("motor_current_amps", Signal::MotorCurrentA, Some(1.0)),
            ("position_radians", Signal::LinkPositionRad, Some(1.0)),
            (
                "velocity_radians_per_second",
                Signal::LinkVelocityRadS,
                Some(1.0),
            ),
            (
                "velocity_degrees_per_sec",
                Signal::LinkVelocityRadS,
                Some(PI / 180.0),
            ),
            ("torque_newton_meters", Signal::JointTorqueNm, Some(1.0)),
        ] {
            let told = meaning(name).unwrap();
            assert_eq!(
                (told.signal().0, told.scale, told.rest),
                (signal, scale, vec![]),
                "{name}"
            );
        }
        assert_eq!(meaning("comment"), None);
    }

    #[test]
    fn a_slide_has_places_and_forces() {
        for (name, signal, scale) in [
            ("x", Signal::LinkPositionRad, None),
            ("v_des", Signal::ReferenceVelocityRadS, None),
            ("F [kN]", Signal::JointTorqueNm, Some(1e3)),
            ("velocity_mm_s", Signal::LinkVelocityRadS, Some(1e-3)),
            ("pos (m)", Signal::LinkPositionRad, Some(1.0)),
            ("force_n", Signal::JointTorqueNm, Some(1.0)),
        ] {
            let told = meaning_of_slide(name).unwrap();
            assert_eq!(
                (told.signal().0, told.scale, told.rest),
                (signal, scale, vec![]),
                "{name}"
            );
        }
        assert_eq!(meaning_of_slide("x2").unwrap().rest, ["2"]);
        for other in ["Fx", "force"] {
            assert_eq!(meaning(other), None, "{other}");
        }
    }

    #[test]
    fn a_joints_name_may_be_parted_otherwise() {
        for (column, joint, rest) in [
            ("joint 1 position", "joint1", Some("position")),
            ("wrist1_pos", "wrist_1", Some("pos")),
            ("link1_1_pos", "link11", None),
            ("joint 10 pos", "joint1", None),
        ] {
            assert_eq!(without_joint(column, joint).as_deref(), rest, "{column}");
        }
    }

    #[test]
    fn a_unit_in_brackets_knows_better_than_a_word() {
        let told = meaning("a1 q-axis [A]").unwrap();
        assert_eq!((told.quantity, told.scale), (Quantity::Current, Some(1.0)));
        for (name, scale) in [
            ("Output Torque [N.mm]", 1e-3),
            ("Torque (mNm)", 1e-3),
            ("tau [N.m]", 1.0),
        ] {
            assert_eq!(meaning(name).unwrap().scale, Some(scale), "{name}");
        }
        // an actual position is none
        let told = meaning("q_a").unwrap();
        assert_eq!(told.quantity, Quantity::Position);
        let told = meaning("speed [deg]").unwrap();
        assert_eq!(told.quantity, Quantity::Velocity);
        assert_eq!(meaning("q-axis (V)"), None);
        assert_eq!(meaning("q1 [m]").unwrap().quantity, Quantity::Position);
    }

    #[test]
    fn a_unit_from_another_line_is_added_where_the_name_tells_none() {
        for (name, unit, expected) in [
            ("q1", "[deg]", "q1 [deg]"),
            ("t", "ms", "t [ms]"),
            ("time_s", "s", "time_s"),
            ("elbow.motor_torque_nm", "mNm", "elbow.motor_torque_nm"),
            ("q1_rad", "deg", "q1_rad"),
            ("mode", "-", "mode"),
        ] {
            assert_eq!(with_unit(name.to_owned(), unit), expected);
        }
    }
}
