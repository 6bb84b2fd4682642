//! The region of low stiffness, and how a joint follows inside and outside of it.
//!
//! PA10-05 meets it where gravity and friction balance, so that the drive has next to nothing to transmit: between the
//! knees T1 and T2 of Table V, where `T_c` rises steeply and the motor's torque changes sign. So here a joint is inside
//! while the gravity torque of the reference lies between the knees of the published row for its direction of motion. The
//! region is the same for every controller. Only instants at which the reference moves count.

use robot::Robot;
use serde::Serialize;
use shm_types::JOINTS_MAX;

use super::bench::{ROW_S, Row};

/// How one joint followed on one side of the border.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Side {
    /// How long it was there.
    pub seconds: f64,
    /// Mean magnitude of reference minus link position.
    pub mean_error_rad: f64,
    /// Largest.
    pub max_error_rad: f64,
    /// Mean magnitude of the feedback torque, joint side.
    pub mean_feedback_nm: f64,
    /// Largest.
    pub max_feedback_nm: f64,
}

/// Both sides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LowStiffness {
    /// Between the knees.
    pub inside: Side,
    /// Elsewhere.
    pub outside: Side,
}

impl LowStiffness {
    /// Of one joint; `None` if it never entered the region, or the robot file knows none.
    pub fn of(rows: &[Row], robot: &Robot, joint: usize) -> Option<Self> {
        let mut sides = [Vec::new(), Vec::new()];
        for row in rows.iter().filter(|row| row.reference_rad_s[joint] != 0.0) {
            sides[usize::from(is_inside(row, robot, joint)?)].push(row);
        }
        let [outside, inside] = sides.map(|rows| Side::of(&rows, joint));
        Some(Self {
            inside: inside?,
            outside: outside?,
        })
    }

    /// How many times worse the joint follows inside.
    pub fn error_ratio(&self) -> f64 {
        self.inside.mean_error_rad / self.outside.mean_error_rad
    }
}

/// Whether the reference loads the joint between the knees; `None` if the robot file has no Table V for it.
pub fn is_inside(row: &Row, robot: &Robot, joint: usize) -> Option<bool> {
    let table = robot.joints[joint].load_torque.as_ref()?;
    let mut gravity_nm = [0.0; JOINTS_MAX];
    let count = robot.joints.len();
    robot
        .chain
        .gravity_torque(&row.reference_rad[..count], &mut gravity_nm[..count]);
    let direction = if row.reference_rad_s[joint] > 0.0 {
        &table.positive
    } else {
        &table.negative
    };
    let [first_nm, second_nm] = direction.knees_nm;
    Some((first_nm..=second_nm).contains(&gravity_nm[joint]))
}

impl Side {
    fn of(rows: &[&Row], joint: usize) -> Option<Self> {
        let count = rows.len() as f64;
        let mut side = Self {
            seconds: count * ROW_S,
            ..Self::default()
        };
        for row in rows {
            let error_rad = (row.reference_rad[joint] - row.link_rad[joint]).abs();
            let feedback_nm = row.feedback_nm[joint].abs();
            side.mean_error_rad += error_rad / count;
            side.mean_feedback_nm += feedback_nm / count;
            side.max_error_rad = side.max_error_rad.max(error_rad);
            side.max_feedback_nm = side.max_feedback_nm.max(feedback_nm);
        }
        (!rows.is_empty()).then_some(side)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The elbow from -90 to 90 degrees and back, a millirad off outside and three inside.
    fn sweep(robot: &Robot) -> Vec<Row> {
        let angle_rad = |step: i32| std::f64::consts::FRAC_PI_2 * f64::from(step) / 500.0;
        let there = (-500..500).map(|step| (angle_rad(step), 0.1));
        let back = (-500..500).map(|step| (angle_rad(-step), -0.1));
        there
            .chain(back)
            .chain([(-1.5, 0.0)])
            .map(|(angle_rad, velocity_rad_s)| {
                let mut row = Row::default();
                row.reference_rad[3] = angle_rad;
                row.reference_rad_s[3] = velocity_rad_s;
                let inside = is_inside(&row, robot, 3) == Some(true);
                row.link_rad[3] = angle_rad + if inside { 0.003 } else { -0.001 };
                row.feedback_nm[3] = if velocity_rad_s == 0.0 { 99.0 } else { -0.5 };
                row
            })
            .collect()
    }

    #[test]
    fn each_side_has_its_own_error_and_rest_does_not_count() {
        let robot = robot::load("pa10").expect("shipped");
        let found = LowStiffness::of(&sweep(&robot), &robot, 3).expect("the elbow passes through");
        assert!((found.error_ratio() - 3.0).abs() < 1e-9, "{found:?}");
        assert_eq!(found.outside.max_feedback_nm, 0.5);
        assert!((found.inside.seconds + found.outside.seconds - 2000.0 * ROW_S).abs() < 1e-9);
    }

    #[test]
    fn the_region_is_where_the_load_overruns_the_drive() {
        let robot = robot::load("pa10").expect("shipped");
        for row in sweep(&robot) {
            if is_inside(&row, &robot, 3) == Some(true) {
                // From upright outwards, either way: gravity helps the motion.
                assert!(
                    row.reference_rad[3] * row.reference_rad_s[3] > 0.0,
                    "{row:?}"
                );
            }
        }
        assert_eq!(
            is_inside(&Row::default(), &robot, 6),
            None,
            "joint 7 has no Table V"
        );
    }
}
