//! Load torque: the three-slope law of PA10-05 Table V.
//!
//! The paper's `T_c` is what remains of the torque of a slow motion after friction and gravity are taken off, as a
//! function of gravity torque `T_g`; it calls it the torque that deforms the wave generator. Continuous and piecewise
//! linear: slope 1 below knee T1, slope 2 between the knees, slope 3 above T2; the column "zero-gravity stiffness" is
//! `T_c` at `T_g = 0` and fixes the offset.
//!
//! What the slopes mean: driving against the load (`T_g` along the motion) the flat slope is friction that rises
//! slowly with load, 0.1 to 0.9 Nm per Nm. Once the load overruns the drive by 10 to 25 Nm the steep slope takes away
//! almost all Coulomb friction: beyond the second knee the load carries the joint and the teeth slide easily. So `T_c`
//! is a change of friction, and this type treats it as one.
//!
//! Rows of the negative direction are read along the direction of motion: their `T_c` counts positive when it makes
//! the motion harder, their argument stays `T_g` about the joint's axis. Only so do both rows mirror each other (joint
//! 2: the drop is at -23…-12 Nm going up and at 11…22 Nm going down). Joint 3 negative prints T1 > T2; its knees
//! are taken in rising order.

use super::{Direction, DryFriction, Sliding};

/// One direction of Table V.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadTorqueRow {
    /// Slopes 1 to 3, in order of rising gravity torque.
    pub slopes: [f64; 3],
    /// Knees T1 and T2, rising, both on one side of zero.
    pub knees_nm: [f64; 2],
    /// `T_c` without load.
    pub zero_load_nm: f64,
}

impl LoadTorqueRow {
    /// `T_c` along the direction of motion, at a gravity torque about the joint's axis.
    pub fn torque_nm(&self, gravity_nm: f64) -> f64 {
        self.shifted_nm(gravity_nm, |excess_nm| excess_nm.max(0.0))
    }

    /// The same with knees rounded within `width_nm` of them.
    fn smooth_torque_nm(&self, gravity_nm: f64, width_nm: f64) -> f64 {
        self.shifted_nm(gravity_nm, |excess_nm| rounded_hinge(excess_nm, width_nm))
    }

    /// A line plus one hinge for each knee, shifted to pass through `zero_load_nm`.
    fn shifted_nm(&self, gravity_nm: f64, hinge: impl Fn(f64) -> f64) -> f64 {
        let [slope_1, slope_2, slope_3] = self.slopes;
        let [knee_1_nm, knee_2_nm] = self.knees_nm;
        let law_nm = |load_nm: f64| {
            slope_1 * load_nm
                + (slope_2 - slope_1) * hinge(load_nm - knee_1_nm)
                + (slope_3 - slope_2) * hinge(load_nm - knee_2_nm)
        };
        self.zero_load_nm + law_nm(gravity_nm) - law_nm(0.0)
    }
}

/// `max(x, 0)` with its corner rounded by a parabola within `width` of it: continuous in slope, exact elsewhere.
fn rounded_hinge(x: f64, width: f64) -> f64 {
    if x.abs() < width {
        (x + width) * (x + width) / (4.0 * width)
    } else {
        x.max(0.0)
    }
}

/// Both directions of one joint's Table V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LoadTorque {
    /// Motion in the positive direction.
    pub positive: LoadTorqueRow,
    /// Motion in the negative direction, along the motion.
    pub negative: LoadTorqueRow,
    /// How far from its knees the law is rounded: zero for the table as printed, some Nm for a gear, which changes from
    /// one regime to the next without a corner.
    pub knee_rounding_nm: f64,
}

impl LoadTorque {
    /// The row that applies to a direction.
    pub fn row(&self, direction: Direction) -> &LoadTorqueRow {
        match direction {
            Direction::Positive => &self.positive,
            Direction::Negative => &self.negative,
        }
    }
}

impl DryFriction for LoadTorque {
    /// The change of friction against the unloaded gear, negative where an overrunning load eases the motion.
    ///
    /// `T_c` at zero load is left out: the friction of Table II was measured without load and already contains it.
    fn level_nm(&self, at: &Sliding) -> f64 {
        let row = self.row(at.direction);
        let torque_nm = if self.knee_rounding_nm > 0.0 {
            row.smooth_torque_nm(at.load_nm, self.knee_rounding_nm)
        } else {
            row.torque_nm(at.load_nm)
        };
        torque_nm - row.zero_load_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Joint 2 of Table V.
    const JOINT_2: LoadTorque = LoadTorque {
        positive: LoadTorqueRow {
            slopes: [0.31, 2.63, 0.20],
            knees_nm: [-23.48, -11.75],
            zero_load_nm: -1.44,
        },
        negative: LoadTorqueRow {
            slopes: [-0.06, -2.80, -0.27],
            knees_nm: [11.16, 21.75],
            zero_load_nm: 0.45,
        },
        knee_rounding_nm: 0.0,
    };

    #[test]
    fn passes_through_its_zero_load_value_with_the_printed_slopes() {
        for (row, inside_nm) in [
            (JOINT_2.positive, [-30.0, -15.0, 10.0]),
            (JOINT_2.negative, [-10.0, 15.0, 30.0]),
        ] {
            assert!((row.torque_nm(0.0) - row.zero_load_nm).abs() < 1e-12);
            for (slope, load_nm) in row.slopes.into_iter().zip(inside_nm) {
                assert!(
                    (row.torque_nm(load_nm + 0.5) - row.torque_nm(load_nm - 0.5) - slope).abs()
                        < 1e-9
                );
            }
        }
    }

    #[test]
    fn is_continuous_at_the_knees() {
        for row in [JOINT_2.positive, JOINT_2.negative] {
            for knee_nm in row.knees_nm {
                assert!(
                    (row.torque_nm(knee_nm + 1e-9) - row.torque_nm(knee_nm - 1e-9)).abs() < 1e-7
                );
            }
        }
    }

    #[test]
    fn an_overrunning_load_eases_the_motion_in_both_directions() {
        let level_nm = |velocity, load_nm| {
            JOINT_2.level_nm(&Sliding {
                load_nm,
                ..Sliding::at(velocity)
            })
        };
        assert!(level_nm(0.1, -25.0) < -30.0);
        assert!(level_nm(-0.1, 25.0) < -25.0);
        assert!(level_nm(0.1, 25.0) > 0.0);
        assert!(level_nm(-0.1, -25.0).abs() < 3.0);
    }

    #[test]
    fn rounding_the_knees_changes_little_away_from_them() {
        for row in [JOINT_2.positive, JOINT_2.negative] {
            assert!((row.smooth_torque_nm(0.0, 1.0) - row.zero_load_nm).abs() < 1e-12);
            for load_nm in [-40.0, -17.0, 5.0, 17.0, 40.0] {
                assert!((row.smooth_torque_nm(load_nm, 1.0) - row.torque_nm(load_nm)).abs() < 0.05);
            }
            assert!(row.smooth_torque_nm(1e6, 1.0).is_finite());
        }
    }
}
