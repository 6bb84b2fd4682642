//! What a factor between two signals that should be equal is the sign of.

use super::FindingKind;
use std::f64::consts::{PI, TAU};

/// Degrees per radian.
pub(super) const DEGREES: f64 = 180.0 / PI;
/// Revolutions per minute per rad/s.
const RPM: f64 = 60.0 / TAU;

/// Two measurements of one thing agree as well as this.
pub(super) const MEASURED: f64 = 0.06;
/// A joint that stays behind its reference, or overshoots it, is off by less.
pub(super) const TRACKED: f64 = 0.3;

/// What a factor is the sign of.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Meaning {
    pub(super) kind: FindingKind,
    /// For people.
    pub(super) text: String,
    /// The exact factor of that unit, sign and side; the measured one where it is none.
    pub(super) factor: f64,
}

impl Meaning {
    /// Of a motion: the unit, sign and gear side that come nearest, if they come as near as this.
    pub(super) fn of(measured: f64, gear_ratio: Option<f64>, near: f64) -> Self {
        let ratio = gear_ratio.map_or(1.0, f64::abs);
        let units = [
            (1.0, ""),
            (DEGREES, "in degrees"),
            (1.0 / DEGREES, "in radians where the other is in degrees"),
            (RPM, "in revolutions per minute"),
            (1.0 / TAU, "in turns"),
            (
                RPM / DEGREES,
                "in revolutions per minute where degrees a second were taken",
            ),
        ];
        Self::nearest(measured, &units, &sides(ratio), near)
    }

    /// Of a torque, which a gear makes larger where it makes motion smaller, and which no angle's unit is in.
    pub(super) fn of_torque(measured: f64, gear_ratio: Option<f64>, near: f64) -> Self {
        let ratio = gear_ratio.map_or(1.0, f64::abs);
        Self::nearest(measured, &[(1.0, "")], &sides(1.0 / ratio), near)
    }

    fn nearest(measured: f64, units: &[(f64, &str)], sides: &[(f64, &str)], near: f64) -> Self {
        let combined = units
            .iter()
            .flat_map(|unit| sides.iter().map(move |side| (unit, side)));
        let distance = |factor: f64| (measured.abs() / factor).ln().abs();
        let nearest = combined
            .min_by(|a, b| distance(a.0.0 * a.1.0).total_cmp(&distance(b.0.0 * b.1.0)))
            .filter(|(unit, side)| distance(unit.0 * side.0) < near);
        let reversed = if measured < 0.0 { "reversed" } else { "" };
        let Some(((unit, unit_text), (side, side_text))) = nearest else {
            return Self {
                kind: FindingKind::WrongScale,
                text: format!("{reversed} off by a factor that is no unit")
                    .trim()
                    .to_owned(),
                factor: measured,
            };
        };
        let parts: Vec<&str> = [reversed, unit_text, side_text]
            .into_iter()
            .filter(|part| !part.is_empty())
            .collect();
        Self {
            kind: match (*unit_text, *side_text) {
                ("", "") => FindingKind::ReversedSign,
                ("", _) => FindingKind::WrongSide,
                _ => FindingKind::WrongUnit,
            },
            text: parts.join(", "),
            factor: unit * side * measured.signum(),
        }
    }
}

/// Sides of a gear between which a quantity grows so much from joint to motor.
fn sides(to_motor: f64) -> [(f64, &'static str); 3] {
    [
        (1.0, ""),
        (to_motor, "motor side instead of joint side"),
        (1.0 / to_motor, "joint side instead of motor side"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_torque_is_never_in_degrees_and_is_larger_behind_the_gear() {
        let of = |factor| {
            let meaning = Meaning::of_torque(factor, Some(100.0), TRACKED);
            (meaning.kind, meaning.text)
        };
        let joint_side = "joint side instead of motor side".to_owned();
        assert_eq!(of(101.0), (FindingKind::WrongSide, joint_side));
        assert_eq!(of(0.0099).1, "motor side instead of joint side");
        assert_eq!(of(57.3).0, FindingKind::WrongScale);
        assert_eq!(of(-1.1).0, FindingKind::ReversedSign);
    }

    #[test]
    fn a_factor_is_told_from_its_neighbours() {
        let of = |factor| {
            let meaning = Meaning::of(factor, Some(50.0), MEASURED);
            (meaning.kind, meaning.text, meaning.factor)
        };
        let degrees = (FindingKind::WrongUnit, "in degrees".to_owned(), DEGREES);
        assert_eq!(of(57.0), degrees);
        assert_eq!(of(50.5).0, FindingKind::WrongSide);
        assert_eq!(
            of(-1.02),
            (FindingKind::ReversedSign, "reversed".to_owned(), -1.0)
        );
        assert_eq!(of(-0.01999).1, "reversed, joint side instead of motor side");
        assert_eq!(of(1.0 / 6.2).1, "in turns");
        let minutes = "in revolutions per minute where degrees a second were taken";
        assert_eq!(of(1.0 / 6.05).1, minutes);
        assert_eq!(
            of(50.0 * DEGREES).1,
            "in degrees, motor side instead of joint side"
        );
        assert_eq!(
            of(1.3),
            (
                FindingKind::WrongScale,
                "off by a factor that is no unit".to_owned(),
                1.3
            )
        );
        assert_eq!(
            Meaning::of(-1.2, None, TRACKED).kind,
            FindingKind::ReversedSign
        );
    }
}
