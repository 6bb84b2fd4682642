//! All nominal friction of one joint in steady motion, for feedforward.

use arrayvec::ArrayVec;

use super::{
    AsymmetricFriction, CoulombFriction, Direction, DryFriction, FrictionLookup,
    LoadDependentFriction, LoadTorque, PeriodicFriction, QuadraticFriction, Sliding, StribeckCurve,
    StribeckFriction, ViscousFriction,
};
use crate::torque_table::TorqueTables;

/// The most Stribeck or periodic terms of one joint.
pub const TERMS_MAX: usize = 8;

/// The sum of a joint's friction laws. The default is a joint without friction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SteadyFriction {
    /// PA10-05 eq (7), where the joint has one.
    pub curve: Option<StribeckCurve>,
    /// PA10-05 Table V, where the joint has one.
    pub load_torque: Option<LoadTorque>,
    /// Look-up table over the motor angle, where the joint has one.
    pub lookup: Option<FrictionLookup>,
    /// What no law has a name for. Over velocity it is drag; what it holds at rest is no friction, and added where the load is.
    pub tables: TorqueTables,
    /// What remains of the level however much an overrunning load eases the motion.
    pub least_nm: f64,
    /// Coulomb friction.
    pub coulomb: CoulombFriction,
    /// Viscous friction.
    pub viscous: ViscousFriction,
    /// Quadratic friction.
    pub quadratic: QuadraticFriction,
    /// Difference between the directions.
    pub asymmetric: AsymmetricFriction,
    /// Friction in proportion to load.
    pub load_dependent: LoadDependentFriction,
    /// Breakaway terms.
    pub stribeck: ArrayVec<StribeckFriction, TERMS_MAX>,
    /// Harmonics in the motor angle.
    pub periodic: ArrayVec<PeriodicFriction, TERMS_MAX>,
}

impl SteadyFriction {
    /// Sum of the dry laws, at least `least_nm` and never negative: no sum of changes makes friction push.
    pub fn level_nm(&self, at: &Sliding) -> f64 {
        let fixed_nm = self.coulomb.level_nm(at)
            + self.asymmetric.level_nm(at)
            + self.load_dependent.level_nm(at);
        let curve_nm = self.curve.map_or(0.0, |law| law.level_nm(at));
        let load_nm = self.load_torque.map_or(0.0, |law| law.level_nm(at));
        let lookup_nm = self.lookup.as_ref().map_or(0.0, |law| law.level_nm(at));
        let stribeck_nm: f64 = self.stribeck.iter().map(|law| law.level_nm(at)).sum();
        let periodic_nm: f64 = self.periodic.iter().map(|law| law.level_nm(at)).sum();
        (fixed_nm + curve_nm + load_nm + stribeck_nm + periodic_nm + lookup_nm)
            .max(self.least_nm)
            .max(0.0)
    }

    /// The part that vanishes at rest by itself: viscous and quadratic drag, and tables over velocity.
    pub fn fluid_drag_nm(&self, velocity_rad_s: f64) -> f64 {
        self.viscous.drag_nm(velocity_rad_s)
            + self.quadratic.drag_nm(velocity_rad_s)
            + self.tables.drag_nm(velocity_rad_s)
            + self
                .curve
                .map_or(0.0, |law| law.viscous_drag_nm(velocity_rad_s))
    }

    /// [`fluid_drag_nm`](Self::fluid_drag_nm) over the velocity: what a time step has to treat implicitly.
    pub fn fluid_drag_nm_s_rad(&self, velocity_rad_s: f64) -> f64 {
        let curve_nm_s_rad = self.curve.map_or(0.0, |law| {
            law.row(Direction::of(velocity_rad_s)).fv_nm_s_rad
        });
        self.viscous.viscous_nm_s_rad
            + self.quadratic.quadratic_nm_s2_rad2 * velocity_rad_s.abs()
            + self.tables.drag_nm_s_rad(velocity_rad_s)
            + curve_nm_s_rad
    }

    /// Torque to spend against friction, joint side, positive with positive velocity.
    ///
    /// `load_nm` is the torque transmitted to the link (gravity torque in slow motion). `tanh(ω/smoothing_rad_s)`
    /// stands for the sign, so a feedforward on desired velocity does not jump at reversals; a smoothing of zero
    /// gives the sign itself, and no dry friction at rest.
    pub fn drag_nm(
        &self,
        velocity_rad_s: f64,
        load_nm: f64,
        motor_position_rad: f64,
        smoothing_rad_s: f64,
    ) -> f64 {
        let at = Sliding {
            load_nm,
            motor_position_rad,
            ..Sliding::at(velocity_rad_s)
        };
        self.level_nm(&at) * smooth_sign(velocity_rad_s, smoothing_rad_s)
            + self.fluid_drag_nm(velocity_rad_s)
    }
}

fn smooth_sign(velocity_rad_s: f64, smoothing_rad_s: f64) -> f64 {
    if velocity_rad_s == 0.0 {
        0.0
    } else if smoothing_rad_s > 0.0 {
        (velocity_rad_s / smoothing_rad_s).tanh()
    } else {
        velocity_rad_s.signum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::friction::{LoadTorqueRow, StribeckRow};

    fn joint_2() -> SteadyFriction {
        let mut periodic = ArrayVec::new();
        periodic.push(PeriodicFriction {
            amplitude_nm: 6.0,
            cycles_per_motor_rev: 6.0,
            phase_rad: -1.5,
        });
        SteadyFriction {
            curve: Some(StribeckCurve {
                positive: StribeckRow {
                    f0_nm: 39.9709,
                    fv_nm_s_rad: 35.3200,
                    fs_nm: 6.2713,
                    vc_rad_s: 0.0685,
                },
                negative: StribeckRow {
                    f0_nm: 41.3113,
                    fv_nm_s_rad: 35.8947,
                    fs_nm: 5.9018,
                    vc_rad_s: 0.0709,
                },
            }),
            load_torque: Some(LoadTorque {
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
            }),
            periodic,
            ..SteadyFriction::default()
        }
    }

    #[test]
    fn never_pushes() {
        let friction = joint_2();
        for v in [-0.5, -0.01, 0.01, 0.5] {
            for load_nm in [-120.0, -20.0, 0.0, 20.0, 120.0] {
                for motor_rad in [0.0, 0.3, 2.0] {
                    assert!(friction.drag_nm(v, load_nm, motor_rad, 0.005) * v >= 0.0);
                }
            }
        }
    }

    #[test]
    fn a_look_up_table_adds_its_row_of_the_direction() {
        let without = joint_2();
        let with = SteadyFriction {
            lookup: Some(FrictionLookup {
                positive_nm: [2.0, -1.0].into(),
                negative_nm: [-3.0, 4.0].into(),
            }),
            ..joint_2()
        };
        let added_nm = |v, motor_rad| {
            with.drag_nm(v, 0.0, motor_rad, 0.0) - without.drag_nm(v, 0.0, motor_rad, 0.0)
        };
        assert!((added_nm(0.1, 0.0) - 2.0).abs() < 1e-12);
        // in the negative direction the row still counts positive against the motion
        assert!((added_nm(-0.1, 0.0) - 3.0).abs() < 1e-12);
        assert!((added_nm(-0.1, std::f64::consts::PI) + 4.0).abs() < 1e-12);
        assert_eq!(with.drag_nm(0.0, 0.0, 0.0, 0.005), 0.0);
        assert!(with.drag_nm(1e-9, 0.0, 0.0, 0.005).abs() < 1e-4);
        assert!(with.drag_nm(-1e-9, 0.0, 0.0, 0.005).abs() < 1e-4);
    }

    #[test]
    fn vanishes_at_rest_and_is_continuous_there() {
        let friction = joint_2();
        assert_eq!(friction.drag_nm(0.0, 10.0, 0.2, 0.005), 0.0);
        assert_eq!(friction.drag_nm(0.0, 10.0, 0.2, 0.0), 0.0);
        assert!(friction.drag_nm(1e-9, 10.0, 0.2, 0.005).abs() < 1e-4);
        assert!(friction.drag_nm(-1e-9, 10.0, 0.2, 0.005).abs() < 1e-4);
    }

    #[test]
    fn reaches_the_unsmoothed_law_at_speed() {
        let friction = joint_2();
        let (smooth_nm, sharp_nm) = (
            friction.drag_nm(0.1, 0.0, 0.0, 0.005),
            friction.drag_nm(0.1, 0.0, 0.0, 0.0),
        );
        assert!((smooth_nm / sharp_nm - 1.0).abs() < 1e-9);
    }

    #[test]
    fn fluid_drag_is_its_coefficient_times_the_velocity() {
        let friction = SteadyFriction {
            viscous: ViscousFriction {
                viscous_nm_s_rad: 1.0,
            },
            quadratic: QuadraticFriction {
                quadratic_nm_s2_rad2: -0.3,
            },
            ..joint_2()
        };
        for v in [-2.0, -1e-3, 0.0, 1e-3, 2.0] {
            let drag_nm = friction.fluid_drag_nm_s_rad(v) * v;
            assert!((drag_nm - friction.fluid_drag_nm(v)).abs() < 1e-12, "{v}");
        }
    }

    #[test]
    fn symmetric_laws_are_odd() {
        let friction = SteadyFriction {
            coulomb: CoulombFriction { coulomb_nm: 2.0 },
            viscous: ViscousFriction {
                viscous_nm_s_rad: 1.0,
            },
            load_dependent: LoadDependentFriction {
                load_coefficient: 0.1,
            },
            ..SteadyFriction::default()
        };
        for v in [0.001, 0.1, 3.0] {
            assert_eq!(
                friction.drag_nm(-v, 5.0, 0.0, 0.01),
                -friction.drag_nm(v, 5.0, 0.0, 0.01)
            );
        }
    }
}
