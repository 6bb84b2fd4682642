//! What the tool's error is made of: which joint, and whether it had just reversed.
//!
//! Each joint's part is how far the tool is displaced if only that joint is where it is and all others are where they
//! should be. Its share is the mean of that part along the whole error, over the mean square of the whole error: for
//! errors this small the shares add up to one, and a joint that works against the others has a negative share.

use robot::Robot;
use serde::Serialize;
use shm_types::messages::PerJoint;

use super::bench::Row;

/// A joint counts as reversing for so long after its reference has changed direction.
pub const REVERSAL_S: f64 = 1.0;

/// One joint's share in the mean square of the tool's error.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointShare {
    /// Its name.
    pub joint: String,
    /// Of the whole; all joints add up to about one.
    pub share: f64,
    /// Of the whole, what this joint gave within [`REVERSAL_S`] of its own reversals.
    pub at_reversals: f64,
    /// Of the time, how much that is.
    pub reversing_time: f64,
}

/// Shares of all joints; none without rows.
pub fn of_tool_error(rows: &[Row], robot: &Robot) -> Vec<JointShare> {
    let count = robot.joints.len();
    let mut reversed_at_s = vec![f64::NEG_INFINITY; count];
    let (mut whole_m2, mut sums) = (0.0, vec![[0.0; 3]; count]);
    let mut moved_rad_s = vec![0.0; count];
    for row in rows {
        let wanted = robot
            .chain
            .tool_pose(&row.reference_rad[..count])
            .translation
            .vector;
        let found = robot
            .chain
            .tool_pose(&row.link_rad[..count])
            .translation
            .vector;
        let error = found - wanted;
        whole_m2 += error.norm_squared();
        for (joint, [share_m2, reversing_m2, reversing]) in sums.iter_mut().enumerate() {
            let velocity_rad_s = row.reference_rad_s[joint];
            if velocity_rad_s * moved_rad_s[joint] < 0.0 {
                reversed_at_s[joint] = row.time_s;
            }
            if velocity_rad_s != 0.0 {
                moved_rad_s[joint] = velocity_rad_s;
            }
            let displaced = robot
                .chain
                .tool_pose(&only(row, joint)[..count])
                .translation
                .vector;
            let part_m2 = (displaced - wanted).dot(&error);
            *share_m2 += part_m2;
            if row.time_s - reversed_at_s[joint] < REVERSAL_S {
                *reversing_m2 += part_m2;
                *reversing += 1.0;
            }
        }
    }
    if whole_m2 == 0.0 {
        return Vec::new();
    }
    let share =
        |(joint, [share_m2, reversing_m2, reversing]): (&robot::RobotJoint, [f64; 3])| JointShare {
            joint: joint.name.clone(),
            share: share_m2 / whole_m2,
            at_reversals: reversing_m2 / whole_m2,
            reversing_time: reversing / rows.len() as f64,
        };
    robot.joints.iter().zip(sums).map(share).collect()
}

/// The reference, with one joint where it really is.
fn only(row: &Row, joint: usize) -> PerJoint {
    let mut position_rad = row.reference_rad;
    position_rad[joint] = row.link_rad[joint];
    position_rad
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_up_and_name_the_joint_that_is_off() {
        let robot = robot::load("pa10").expect("shipped");
        let rows: Vec<Row> = (0..300)
            .map(|step| {
                let time_s = f64::from(step) * 0.01;
                let mut row = Row {
                    time_s,
                    ..Row::default()
                };
                row.reference_rad[1] = 0.5;
                row.reference_rad[3] = 0.8;
                row.reference_rad_s[3] = 1.0 - time_s;
                row.link_rad = row.reference_rad;
                row.link_rad[1] += 0.001;
                // Joint 4 is off for the second after its reversal at 1 s.
                row.link_rad[3] += if (1.0..2.0).contains(&time_s) {
                    0.003
                } else {
                    0.0
                };
                row
            })
            .collect();
        let shares = of_tool_error(&rows, &robot);
        let total: f64 = shares.iter().map(|share| share.share).sum();
        assert!((total - 1.0).abs() < 0.01, "{total}");
        assert_eq!(shares[0].share, 0.0);
        assert!(shares[3].share > 0.0);
        assert!(
            (shares[3].at_reversals / shares[3].share - 1.0).abs() < 0.02,
            "{:?}",
            shares[3]
        );
        assert!((shares[3].reversing_time - 1.0 / 3.0).abs() < 0.02);
        assert!(of_tool_error(&[], &robot).is_empty());
    }
}
