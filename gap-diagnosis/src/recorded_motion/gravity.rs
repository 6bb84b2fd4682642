//! Where gravity points at a base that may be tilted, however far: torques are linear in its three components, and how long it is is
//! known.

use nalgebra::{DMatrix, DVector, Matrix3x2, UnitQuaternion, Vector2, Vector3};
use robot::Robot;

use super::dynamics;
use crate::evidence::Message;
use crate::evidence::arm::{self, Cause};

/// Standard deviation of gravity, as a part of it: 9.78 to 9.83 m/s² over the Earth.
const LENGTH: f64 = 0.003;
/// Components, which are the columns of a tilt.
pub const COMPONENTS: usize = 3;
/// Turn by which a derivative is found.
const TURN_RAD: f64 = 1e-6;

/// Gravity's direction in the base's frame.
#[derive(Clone, Copy, Debug)]
pub struct Gravity {
    /// As the robot file has it.
    file: Vector3<f64>,
    /// As far as it is known.
    now: Option<Vector3<f64>>,
}

impl Gravity {
    /// As the robot file has it.
    pub fn of(robot: &Robot) -> Self {
        let gravity_m_s2 = dynamics::chain(robot).gravity_m_s2();
        // where nothing falls no tilt is seen
        let file = gravity_m_s2.try_normalize(f64::EPSILON);
        Self {
            file: file.unwrap_or_else(Vector3::zeros),
            now: None,
        }
    }

    /// Takes what is said of how the components change, as parts of gravity.
    pub fn turn(&mut self, said: &[f64]) {
        let change = Vector3::from_fn(|axis, _| said[axis]);
        self.now = (self.file + change).try_normalize(f64::EPSILON);
    }

    /// What is said of causes, the tilt among them as changes of the components, before anything was seen: once the direction is known,
    /// gravity is as long as it is.
    pub fn prior(&self, causes: &[Cause]) -> Message {
        let mut message = Message {
            precision: DMatrix::zeros(0, 0),
            pull: DVector::zeros(0),
        };
        for cause in causes {
            message = beside(
                &message,
                &match cause {
                    Cause::Payload | Cause::Delay | Cause::Masses(_) => arm::prior(&[*cause]),
                    Cause::Tilt => self.of_components(*cause),
                },
            );
        }
        message
    }

    fn of_components(&self, tilt: Cause) -> Message {
        let mut precision = DMatrix::identity(COMPONENTS, COMPONENTS) * tilt.deviation().powi(-2);
        let mut pull = DVector::zeros(COMPONENTS);
        if let Some(now) = self.now {
            let of_length = LENGTH.powi(-2);
            precision += of_length * now * now.transpose();
            pull += of_length * (1.0 - now.dot(&self.file)) * now;
        }
        Message { precision, pull }
    }

    /// What is said of causes with the tilt as the base's roll and pitch: about where gravity points.
    pub fn as_tilt(&self, causes: &[Cause], said: &Message) -> Message {
        let count = arm::amplitudes(causes);
        let mut slope = DMatrix::zeros(said.pull.len(), count);
        let mut beyond = DVector::zeros(said.pull.len());
        let (mut row, mut column) = (0, 0);
        for cause in causes {
            match cause {
                Cause::Payload | Cause::Delay | Cause::Masses(_) => {
                    let own = cause.amplitudes();
                    slope
                        .view_mut((row, column), (own, own))
                        .fill_with_identity();
                    row += own;
                }
                Cause::Tilt => {
                    let turn_rad = self.turn_rad();
                    let slope_here = self.slope(turn_rad);
                    let here = self.change(turn_rad) - slope_here * turn_rad;
                    slope
                        .view_mut((row, column), (COMPONENTS, cause.amplitudes()))
                        .copy_from(&slope_here);
                    beyond.rows_mut(row, COMPONENTS).copy_from(&here);
                    row += COMPONENTS;
                }
            }
            column += cause.amplitudes();
        }
        Message {
            precision: slope.transpose() * &said.precision * &slope,
            pull: slope.transpose() * (&said.pull - &said.precision * beyond),
        }
    }

    /// How a base's roll and pitch change gravity's components.
    fn change(&self, turn_rad: Vector2<f64>) -> Vector3<f64> {
        let turn = UnitQuaternion::from_euler_angles(turn_rad.x, turn_rad.y, 0.0);
        turn.inverse() * self.file - self.file
    }

    fn slope(&self, at_rad: Vector2<f64>) -> Matrix3x2<f64> {
        let along = [Vector2::x(), Vector2::y()].map(|axis| {
            let [ahead, behind] =
                [1.0, -1.0].map(|way| self.change(at_rad + way * TURN_RAD * axis));
            (ahead - behind) / (2.0 * TURN_RAD)
        });
        Matrix3x2::from_columns(&along)
    }

    /// The smallest roll and pitch that turn gravity to where it points, or as near as they can.
    fn turn_rad(&self) -> Vector2<f64> {
        let (from, to) = (self.file, self.now.unwrap_or(self.file));
        // the pitch alone decides what is along x, the roll turns the rest about it
        let across = from.x.hypot(from.z);
        let reached = (to.x / across.max(f64::MIN_POSITIVE))
            .clamp(-1.0, 1.0)
            .acos();
        let begin = from.z.atan2(from.x);
        let each = [reached, -reached].map(|angle| {
            let pitch = wrapped(angle - begin);
            let pitched = Vector3::new(0.0, pitch, 0.0);
            let pitched = UnitQuaternion::from_scaled_axis(-pitched) * from;
            let roll = pitched.z.atan2(pitched.y) - to.z.atan2(to.y);
            // what points along the roll's axis is turned by none
            let is_along = pitched.yz().norm().min(to.yz().norm()) < TURN_RAD;
            Vector2::new(if is_along { 0.0 } else { wrapped(roll) }, pitch)
        });
        let [one, other] = each;
        if other.norm() < one.norm() {
            other
        } else {
            one
        }
    }
}

/// An angle within half a turn.
fn wrapped(rad: f64) -> f64 {
    rad.sin().atan2(rad.cos())
}

/// Two causes' messages as one.
fn beside(one: &Message, other: &Message) -> Message {
    let [first, second] = [one, other].map(|of| of.pull.len());
    let mut precision = DMatrix::zeros(first + second, first + second);
    precision
        .view_mut((0, 0), (first, first))
        .copy_from(&one.precision);
    precision
        .view_mut((first, first), (second, second))
        .copy_from(&other.precision);
    let pull = one.pull.iter().chain(other.pull.iter()).copied();
    Message {
        precision,
        pull: DVector::from_iterator(first + second, pull),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn pointing(file: [f64; 3], now: Vector3<f64>) -> Gravity {
        Gravity {
            file: Vector3::from(file),
            now: Some(now),
        }
    }

    #[test]
    fn a_base_may_stand_anyhow() {
        for file in [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.6, 0.48, -0.64]] {
            for (roll, pitch) in [
                (0.02, -0.03),
                (0.7, -0.4),
                (PI, 0.0),
                (0.0, PI / 2.0),
                (-1.5, 0.3),
            ] {
                let base = pointing(file, Vector3::z());
                let now = base.file + base.change(Vector2::new(roll, pitch));
                let there = pointing(file, now);
                let turn = there.turn_rad();
                let missed = base.file + base.change(turn) - now;
                assert!(
                    missed.norm() < 1e-6,
                    "{file:?} {roll} {pitch}: {turn} {missed}"
                );
                assert!(turn.norm() <= Vector2::new(roll, pitch).norm() + 1e-6);
            }
        }
    }

    #[test]
    fn gravity_is_as_long_as_it_is_once_its_direction_is_known() {
        let mut gravity = pointing([0.0, 0.0, -1.0], Vector3::z());
        // a third of the torque, of an arm on its side
        gravity.turn(&[0.32, 0.0, 1.0]);
        let (said, _) = gravity.prior(&[Cause::Tilt]).said().unwrap();
        assert!(gravity.file.x + said[0] > 0.9, "{said}");
        let seen = Message {
            precision: DMatrix::identity(3, 3) * 1e4,
            pull: DVector::from_vec(vec![1e4, 0.0, 1e4]),
        };
        let told = gravity.as_tilt(&[Cause::Tilt], &seen);
        let (turn, _) = told.and(&arm::prior(&[Cause::Tilt])).said().unwrap();
        assert!((turn[1].abs() - PI / 2.0).abs() < 1e-3, "{turn}");
    }
}
