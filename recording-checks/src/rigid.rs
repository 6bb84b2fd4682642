//! What the robot file's rigid bodies make of a joint's torque beside friction of any level and slope: by it a recording is held
//! against the file before anything is fitted.

use joint_twin::known::LAW;
use joint_twin::scale::ROWS_MIN;
use joint_twin::stretch::Stretch;
use nalgebra::{Matrix2, Vector2};
use recording::{JointColumns, Recording, STILL_RAD, Signal};
use robot::Robot;

/// Rate at which this is looked at: what rigid bodies do is slow.
const RATE_HZ: f64 = 50.0;
/// The rigid bodies leave this part of a joint's torque, as squares, where it may be another's.
pub(crate) const OWN: f64 = 0.4;
/// Below this part left, as squares, nothing tells one twin from a better one: no law is truer.
const RIGHT: f64 = LAW * LAW;
/// Natural logarithm of the factor by which a change must let the rigid bodies leave less, over all joints.
const GAIN: f64 = 2.0;

/// Rows at about [`RATE_HZ`]. A torque that is measured behind the gear alone stands for the motor's: masses need the same of both.
pub(crate) fn thinned(robot: &Robot, recording: &Recording) -> Recording {
    let every = ((recording.sample_rate_hz / RATE_HZ) as usize).max(1);
    let mut thinned = recording.clone();
    thinned.time_s = recording.time_s.iter().copied().step_by(every).collect();
    thinned.segment = recording
        .segment
        .as_ref()
        .map(|segment| segment.iter().copied().step_by(every).collect());
    thinned.sample_rate_hz = recording.sample_rate_hz / every as f64;
    for joint in &mut thinned.joints {
        for values in joint.signals.values_mut() {
            *values = values.iter().copied().step_by(every).collect();
        }
        let file = robot.joints.iter().find(|file| file.name == joint.name);
        if let (Some(Signal::JointTorqueNm), Some(file)) = (torque_signal(joint), file) {
            let sensed_nm = joint.signals[&Signal::JointTorqueNm].iter();
            let motor_nm = sensed_nm.map(|nm| nm / file.gear_ratio).collect();
            joint.signals.insert(Signal::MotorTorqueNm, motor_nm);
        }
    }
    thinned
}

/// The signal that a joint's torque is taken from.
pub(crate) fn torque_signal(columns: &JointColumns) -> Option<Signal> {
    let torques = [
        Signal::MotorTorqueNm,
        Signal::CommandTorqueNm,
        Signal::JointTorqueNm,
    ];
    let mut torques = torques.into_iter();
    torques.find(|signal| columns.measured(*signal).is_some())
}

/// By how much a change lets the rigid bodies leave less of all joints' torques, if it is believed: the sum of natural logarithms.
pub(crate) fn gain(before: &[f64], after: &[f64]) -> Option<f64> {
    let each = before.iter().zip(after);
    let gain: f64 = each.map(|(b, a)| (b.max(RIGHT) / a.max(RIGHT)).ln()).sum();
    (gain > GAIN).then_some(gain)
}

/// A joint's torque, and what the rigid bodies make of it.
pub(crate) struct Moving(Vec<Row>);

struct Row {
    /// Direction and velocity.
    friction: Vector2<f64>,
    torque_nm: f64,
    rigid_nm: f64,
}

/// How a joint's torque is made up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MadeOf {
    /// Of what the rigid bodies need, in the torque.
    pub rigid: f64,
    /// Friction at the root mean square velocity.
    pub friction_nm: f64,
    /// At which it is that.
    pub velocity_rad_s: f64,
    /// Part of the torque beyond friction, as squares, that so much of the rigid bodies' leaves.
    pub left: f64,
    /// The same as a root mean square.
    pub left_nm: f64,
    /// Rows in the direction that has fewer of them.
    pub other_way: usize,
}

impl Moving {
    /// Of a joint with the torque that is recorded as a joint's, another or itself; none where it stands still or too few rows tell
    /// of it.
    pub fn of(
        robot: &Robot,
        joint: usize,
        torque_of: usize,
        stretches: &[Stretch],
    ) -> Option<Self> {
        let positions = stretches
            .iter()
            .filter_map(|stretch| stretch.joints[joint].as_ref())
            .flat_map(|of_joint| &of_joint.load.position_rad);
        let (low, high) = positions.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), rad| {
            (low.min(*rad), high.max(*rad))
        });
        if high - low < STILL_RAD {
            return None;
        }
        let rows: Vec<Row> = stretches
            .iter()
            .flat_map(|stretch| rows(robot, joint, torque_of, stretch))
            .filter(|row| row.friction.y != 0.0)
            .collect();
        (rows.len() >= ROWS_MIN).then_some(Self(rows))
    }

    /// What the rigid bodies leave of the squares of the torque beyond friction; all of it where that is not known.
    pub fn left(&self) -> f64 {
        let all = self.beyond_friction(|row| row.torque_nm);
        let left = self.beyond_friction(|row| row.torque_nm - row.rigid_nm);
        match (all, left) {
            (Some((all, _)), Some((left, _))) if all > 0.0 => left / all,
            _ => 1.0,
        }
    }

    /// The torque as so much of the rigid bodies' and friction (least squares).
    pub fn made_of(&self) -> Option<MadeOf> {
        let (all, of_torque) = self.beyond_friction(|row| row.torque_nm)?;
        let (needed, of_rigid) = self.beyond_friction(|row| row.rigid_nm)?;
        let beyond = |value: f64, row: &Row, law: &Vector2<f64>| value - row.friction.dot(law);
        let products = self.0.iter().map(|row| {
            beyond(row.torque_nm, row, &of_torque) * beyond(row.rigid_nm, row, &of_rigid)
        });
        let rigid = products.sum::<f64>() / needed;
        let law = of_torque - rigid * of_rigid;
        let square = self.0.iter().map(|row| row.friction.y.powi(2)).sum::<f64>();
        let velocity_rad_s = (square / self.0.len() as f64).sqrt();
        let positive = self.0.iter().filter(|row| row.friction.x > 0.0);
        let one_way = positive.count();
        let left = 1.0 - rigid * rigid * needed / all;
        let made_of = MadeOf {
            rigid,
            friction_nm: law.x + law.y * velocity_rad_s,
            velocity_rad_s,
            left,
            left_nm: (left.max(0.0) * all / self.0.len() as f64).sqrt(),
            other_way: one_way.min(self.0.len() - one_way),
        };
        made_of.left.is_finite().then_some(made_of)
    }

    /// Squares that friction of any level and slope leaves, and that law.
    fn beyond_friction(&self, torque_nm: impl Fn(&Row) -> f64) -> Option<(f64, Vector2<f64>)> {
        let mut information = Matrix2::zeros();
        let mut vector = Vector2::zeros();
        for row in &self.0 {
            information += row.friction * row.friction.transpose();
            vector += row.friction * torque_nm(row);
        }
        let law = information.try_inverse()? * vector;
        let left = self.0.iter();
        let left = left.map(|row| (torque_nm(row) - row.friction.dot(&law)).powi(2));
        let left: f64 = left.sum();
        left.is_finite().then_some((left, law))
    }
}

/// Of a joint's motion, with the torque that is recorded as another's or its own.
fn rows(robot: &Robot, joint: usize, torque_of: usize, stretch: &Stretch) -> Vec<Row> {
    let (Some(of_joint), Some(of_torque)) = (&stretch.joints[joint], &stretch.joints[torque_of])
    else {
        return Vec::new();
    };
    let [file, other] = [joint, torque_of].map(|joint| &robot.joints[joint]);
    let rotor_kg_m2 = file.rotor_inertia_kg_m2 * file.gear_ratio.powi(2);
    let load = &of_joint.load;
    let acceleration_rad_s2 = stretch.motion.acceleration_rad_s2(joint);
    let whole = (0..of_joint.samples().min(of_torque.samples()))
        .filter(|k| of_joint.is_whole[*k] && of_torque.is_whole[*k]);
    whole
        .map(|k| {
            let velocity_rad_s = load.velocity_rad_s[k];
            let inertia_kg_m2 = rotor_kg_m2 + load.inertia_kg_m2[k];
            Row {
                friction: Vector2::new(velocity_rad_s.signum(), velocity_rad_s),
                // what is recorded is of the motor, whose ratio the file tells
                torque_nm: of_torque.torque_nm[k] * file.gear_ratio / other.gear_ratio,
                rigid_nm: load.torque_nm[k] + inertia_kg_m2 * acceleration_rad_s2[k],
            }
        })
        .collect()
}
