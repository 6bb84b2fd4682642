//! Friction and load torque of a harmonic drive as measured tables, each direction of motion on its own
//! (Kennedy and Desai, IEEE/ASME Trans. Mechatronics 2005, "PA10-05": section IV, Tables II and V), and torque that has no
//! name at all. Joint side.

use serde::{Deserialize, Serialize};

/// Friction by direction of motion: eq (7) with the coefficients of Table II.
///
/// The magnitudes oppose the motion in both rows. The paper writes eq (7) for signed velocity, so its negative rows
/// carry negative `Fs·sgn` and `Vc`; the signs cancel, and here both rows are written for speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DirectionalFriction {
    /// For positive joint velocity.
    pub positive: StribeckRow,
    /// For negative joint velocity.
    pub negative: StribeckRow,
}

/// One direction of eq (7): friction at speed `v ≥ 0` is `f0 + fv·v + fs·(1 - exp(-v/vc))`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StribeckRow {
    /// `F0`: friction at the limit of speed zero.
    pub f0_nm: f64,
    /// `Fv`: viscous coefficient.
    pub fv_nm_s_rad: f64,
    /// `Fs`: what friction gains while the speed passes `vc`; negative where it first falls.
    pub fs_nm: f64,
    /// `Vc`: speed over which `fs` builds up; positive.
    pub vc_rad_s: f64,
}

/// Torque that deforms the wave generator, over gravity torque, by direction of motion (Table V, eq (5) `T_c`).
///
/// Each row gives `T_c` *along the direction of motion*: positive hinders the motion like friction, negative helps.
/// For the positive rows that is the paper's sign. Its negative rows are printed without saying so, but make physical
/// sense only if read this way: a joint that gravity pushes along loses friction in either direction. Taken as torque
/// about the axis, they would make gravity-assisted motion in the negative direction *harder* by the same amount.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadTorqueTable {
    /// For positive joint velocity.
    pub positive: LoadTorqueRow,
    /// For negative joint velocity.
    pub negative: LoadTorqueRow,
}

/// One direction of Table V: continuous and piecewise linear in the gravity torque about the axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadTorqueRow {
    /// Slopes below the first knee, between the knees, and above the second; Nm per Nm.
    pub slopes: [f64; 3],
    /// Gravity torques at which the slope changes, ascending.
    pub knees_nm: [f64; 2],
    /// `T_c` at gravity torque zero, which fixes the offset (the paper's "zero-gravity stiffness").
    pub zero_load_nm: f64,
}

/// Friction over the motor angle, by direction of motion, added to all other friction of the joint (section IV-B2).
///
/// Evenly spaced points over one revolution of the motor, the i-th of n at motor angle `2π·i/n`, between which friction
/// is interpolated linearly. As many points in both rows, 2 to 4096. Positive opposes the motion in both rows; where
/// the level itself stands elsewhere, in `direction_friction` say, the rows have no mean and so hold both signs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionTable {
    /// For positive joint velocity.
    pub positive_nm: Vec<f64>,
    /// For negative joint velocity.
    pub negative_nm: Vec<f64>,
}

/// What a [`TorqueTable`] is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TableOver {
    /// Joint angle, rad.
    Position,
    /// Joint velocity, rad/s.
    Velocity,
    /// Torque that the gear carries, Nm.
    Load,
}

/// Torque that no law has a name for, over one number: straight lines from corner to corner, and that of the last corner beyond it.
///
/// Positive where the drive has to spend more torque in the positive direction, whichever way the joint moves. As many values as
/// corners, 2 to 4096; corners rise. Tables of a joint add up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TorqueTable {
    /// What the corners are.
    pub over: TableOver,
    /// Corners.
    pub at: Vec<f64>,
    /// Torque at each.
    pub torque_nm: Vec<f64>,
}
