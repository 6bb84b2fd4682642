//! Where friction no longer tells of load: an overrunning load has eased it to its floor.
//!
//! Table V falls without end, friction does not: it cannot drop below zero, and a gear keeps a little of it however hard
//! the load pulls. There the torque is gravity plus a small remainder that neither a region of Table V nor the ripple over
//! the motor's angle describes. Fitted all the same, such rows bend the outer regions of Table V towards slope zero and
//! make gravity look smaller than it is. They are left out.

/// Below this share of the unloaded friction a row is left out. The remainder on the floor is a few hundredths; gravity of a
/// robot file that is known to some percent adds as much again.
const LEAST_SHARE: f64 = 0.15;

/// Whether a level of friction is so far above the floor that it still tells of load.
pub(crate) fn is_above_floor(level_nm: f64, unloaded_nm: f64) -> bool {
    level_nm >= LEAST_SHARE * unloaded_nm
}
