//! Successive subtraction: PA10-05, eq (5), `T_in·N = T_cf(θ) + T_vf(θ̇) + T_g(θ) + T_c`, Fig. 7(a).
//!
//! Friction is what the robot file knows of it without load: its law over speed is `T_vf`, its harmonics and its look-up
//! table over the motor's angle are `T_cf`. What the file already says about load is left out, for it is what is sought.

use joint_model::friction::{Direction, DryFriction, Sliding, SteadyFriction};
use joint_model::rigid_body::Chain;
use robot::Robot;

use super::SweepSteps;
use crate::floor::is_above_floor;
use crate::steady_motion::slow::Run;

/// Travel over which one value is the mean: short beside the regions of Table V, which take some hundredths of a
/// radian, and some rows long even at 1 rad/s.
const SAMPLE_TRAVEL_RAD: f64 = 0.002;

/// One joint's friction without load, in its two parts.
pub(super) struct UnloadedFriction {
    over_speed: SteadyFriction,
    over_angle: SteadyFriction,
}

impl UnloadedFriction {
    pub fn of(robot: &Robot, joint: usize) -> Self {
        let known = robot.joints[joint].steady_friction();
        let over_angle = SteadyFriction {
            periodic: known.periodic.clone(),
            lookup: known.lookup.clone(),
            ..SteadyFriction::default()
        };
        let over_speed = SteadyFriction {
            load_torque: None,
            lookup: None,
            periodic: Default::default(),
            ..known
        };
        Self {
            over_speed,
            over_angle,
        }
    }

    /// `T_cf`, along the motion. May be negative: it varies about the level over speed.
    fn over_angle_nm(&self, direction: Direction, motor_position_rad: f64) -> f64 {
        let at = Sliding {
            motor_position_rad,
            ..Sliding::at(direction.sign())
        };
        let harmonics_nm: f64 = (self.over_angle.periodic.iter())
            .map(|law| law.level_nm(&at))
            .sum();
        let lookup = self.over_angle.lookup.as_ref();
        harmonics_nm + lookup.map_or(0.0, |law| law.level_nm(&at))
    }

    /// `T_vf`, along the motion.
    fn over_speed_nm(&self, velocity_rad_s: f64) -> f64 {
        self.over_speed.drag_nm(velocity_rad_s, 0.0, 0.0, 0.0).abs()
    }

    /// Viscous and quadratic drag, along the motion.
    fn fluid_nm(&self, velocity_rad_s: f64) -> f64 {
        self.over_speed.fluid_drag_nm(velocity_rad_s).abs()
    }
}

/// One row, or the sum of some.
#[derive(Clone, Copy, Default)]
struct Row {
    position_rad: f64,
    total_nm: f64,
    over_angle_nm: f64,
    over_speed_nm: f64,
    gravity_nm: f64,
    /// The part of `over_speed_nm` that load does not ease.
    fluid_nm: f64,
}

/// Adds to `steps` what a run says about the joint's motion in one direction. `chain` holds the payload.
pub(super) fn subtract(
    steps: &mut SweepSteps,
    run: &Run,
    (joint, direction): (usize, Direction),
    friction: &UnloadedFriction,
    chain: &Chain,
) {
    let motion = &run.joints[joint];
    let mut pose_rad = vec![0.0; run.joints.len()];
    let mut gravity_nm = vec![0.0; run.joints.len()];
    let mut held: Vec<Row> = Vec::new();
    for row in 0..run.rows {
        let position_rad = motion.position_rad[row];
        let sliding = motion.direction[row] == Some(direction);
        let travelled =
            |first: &Row| (position_rad - first.position_rad).abs() >= SAMPLE_TRAVEL_RAD;
        if !sliding || held.first().is_some_and(travelled) {
            push_mean(steps, &mut held, direction);
        }
        if !sliding {
            continue;
        }
        for (angle_rad, other) in pose_rad.iter_mut().zip(&run.joints) {
            *angle_rad = other.position_rad[row];
        }
        chain.gravity_torque(&pose_rad, &mut gravity_nm);
        held.push(Row {
            position_rad,
            total_nm: motion.torque_nm[row],
            over_angle_nm: friction.over_angle_nm(direction, motion.motor_position_rad[row]),
            over_speed_nm: friction.over_speed_nm(motion.velocity_rad_s[row]),
            gravity_nm: gravity_nm[joint],
            fluid_nm: friction.fluid_nm(motion.velocity_rad_s[row]),
        });
    }
    push_mean(steps, &mut held, direction);
}

fn push_mean(steps: &mut SweepSteps, held: &mut Vec<Row>, direction: Direction) {
    if held.is_empty() {
        return;
    }
    let mean = |value: fn(&Row) -> f64| held.iter().map(value).sum::<f64>() / held.len() as f64;
    let (sign, total_nm, gravity_nm) = (
        direction.sign(),
        mean(|row| row.total_nm),
        mean(|row| row.gravity_nm),
    );
    let (over_speed_nm, fluid_nm) = (mean(|row| row.over_speed_nm), mean(|row| row.fluid_nm));
    let level_nm = sign * (total_nm - gravity_nm) - fluid_nm;
    let without_position_nm = total_nm - sign * mean(|row| row.over_angle_nm);
    let without_friction_nm = without_position_nm - sign * over_speed_nm;
    steps.position_rad.push(mean(|row| row.position_rad));
    steps.total_nm.push(total_nm);
    steps.without_position_friction_nm.push(without_position_nm);
    steps.without_friction_nm.push(without_friction_nm);
    steps.gravity_nm.push(gravity_nm);
    steps
        .on_floor
        .push(!is_above_floor(level_nm, over_speed_nm - fluid_nm));
    steps
        .load_torque_nm
        .push(sign * (without_friction_nm - gravity_nm));
    held.clear();
}
