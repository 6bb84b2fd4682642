//! The tool path of PA10-05, eq (14): a lemniscate in the plane x = 0.6 m, with joint 3 locked.
//!
//! The paper holds the tool's orientation constant but does not print it. It does say that gravity loads joints 5 and 6
//! with 0.3 Nm at most; with 4.34 kg at 0.09 m (Table IV), that is a tool axis 4.5 degrees off the vertical. So here the
//! tool points down and 4.5 degrees back to the base, the side away from the wrist singularity. On our PA-10 that keeps
//! every joint below 0.37 rad/s (identified range: 0.4 rad/s), joint 6 between 0.49 and 0.86 rad (singular at 0), and
//! all joints at least 0.4 rad from their limits. A tool pointing forward would drive joint 2 at 0.42 rad/s.

use nalgebra::{Isometry3, Rotation3, Translation3, Vector3};
use num_dual::{Dual2_64, DualNum};

use crate::{MotionError, PaTenArm};

/// One round of the lemniscate: eq (14) runs on `t/2`.
pub const LEMNISCATE_PERIOD_S: f64 = 4.0 * std::f64::consts::PI;

/// Tool axis from the vertical, towards the base: asin(0.3 Nm / (4.34 kg · 9.81 m/s² · 0.09 m)).
const TOOL_TILT_RAD: f64 = 0.0784;

/// The PA-10 following the path.
#[derive(Clone, Debug)]
pub struct Lemniscate {
    arm: PaTenArm,
    orientation: Rotation3<f64>,
}

/// Where the tool should be, in the base frame, at a time on the path (without soft start).
pub fn lemniscate_pose(time_s: f64) -> Isometry3<f64> {
    let position_m = Vector3::from(position_m(time_s));
    Isometry3::from_parts(Translation3::from(position_m), orientation().into())
}

/// Eq (14).
fn position_m<D: DualNum<Primitive = f64> + Copy>(time_s: D) -> [D; 3] {
    let (sin, cos) = (time_s / 2.0).sin_cos();
    let shrink = sin * sin + 1.0;
    [
        D::from(0.6),
        cos / shrink * 0.2,
        sin * cos / shrink * 0.4 + 0.1,
    ]
}

fn orientation() -> Rotation3<f64> {
    Rotation3::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI + TOOL_TILT_RAD)
}

impl Lemniscate {
    /// The path for this arm, checked to be reachable all the way round.
    pub fn new(arm: PaTenArm) -> Result<Self, MotionError> {
        const CHECKS: u32 = 2000;
        let lemniscate = Self {
            arm,
            orientation: orientation(),
        };
        for check in 0..CHECKS {
            let time_s = LEMNISCATE_PERIOD_S * f64::from(check) / f64::from(CHECKS);
            lemniscate
                .solve(Dual2_64::from(time_s))
                .ok_or(MotionError::Reach { time_s })?;
        }
        Ok(lemniscate)
    }

    fn solve(&self, time_s: Dual2_64) -> Option<[Dual2_64; 7]> {
        self.arm.solve_along(position_m(time_s), &self.orientation)
    }

    /// Position, velocity and acceleration of every joint. Exact derivatives: the closed form on dual numbers.
    pub fn sample(&self, time_s: f64) -> [[f64; 3]; 7] {
        // Where `new` found the path reachable, so does this.
        let joints = self.solve(Dual2_64::from_re(time_s).derivative());
        joints.map_or([[0.0; 3]; 7], |joints| {
            joints.map(|joint| [joint.re, joint.v1, joint.v2])
        })
    }
}
