//! Position-dependent friction as a look-up table over the wave generator's angle, one row per direction of motion.
//!
//! `T = t_i + (t_{i+1} - t_i)·(x - i)` with `x = n·θ_m/2π` counted within the revolution and `i = floor(x)`, so `t_i`
//! holds at the motor angle `2π·i/n` and the last point leads back to the first. Joint side, a change of the level: a
//! positive value opposes the motion in either row. Source: PA10-05, section IV-B2, and PA10-03, section 4.1, which
//! feed forward the torque of a slow motion "in the form of a look-up table". Theirs runs over the range of the joint;
//! this one over a motor revolution, because every frequency of Table III is a whole number of cycles in it. Left out:
//! the part that depends on the joint's angle.

use core::f64::consts::TAU;
use std::sync::Arc;

use super::{Direction, DryFriction, Sliding};

/// Friction level at evenly spaced motor angles. Clones share their rows, so a copy costs no heap.
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionLookup {
    /// Levels for motion in the positive direction, at motor angles `2π·i/n`. An empty row changes nothing.
    pub positive_nm: Arc<[f64]>,
    /// The same for the negative direction; also positive where it opposes the motion.
    pub negative_nm: Arc<[f64]>,
}

impl FrictionLookup {
    fn row_nm(&self, direction: Direction) -> &[f64] {
        match direction {
            Direction::Positive => &self.positive_nm,
            Direction::Negative => &self.negative_nm,
        }
    }
}

impl DryFriction for FrictionLookup {
    fn level_nm(&self, at: &Sliding) -> f64 {
        let row_nm = self.row_nm(at.direction);
        if row_nm.is_empty() {
            return 0.0;
        }
        let place = (at.motor_position_rad / TAU).rem_euclid(1.0) * row_nm.len() as f64;
        // Just below a whole revolution the remainder rounds up to one: that is the first point again.
        let index = place as usize % row_nm.len();
        let (here_nm, next_nm) = (row_nm[index], row_nm[(index + 1) % row_nm.len()]);
        here_nm + (next_nm - here_nm) * place.fract()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> FrictionLookup {
        FrictionLookup {
            positive_nm: [1.0, 4.0, -2.0, 0.5, 3.0].into(),
            negative_nm: [2.0, -1.0].into(),
        }
    }

    fn level_nm(table: &FrictionLookup, velocity_rad_s: f64, motor_position_rad: f64) -> f64 {
        table.level_nm(&Sliding {
            motor_position_rad,
            ..Sliding::at(velocity_rad_s)
        })
    }

    #[test]
    fn repeats_with_every_motor_revolution() {
        for velocity_rad_s in [-0.1, 0.1] {
            for motor_rad in [-7.0, -1e-17, 0.0, 0.4, 3.1] {
                let here_nm = level_nm(&table(), velocity_rad_s, motor_rad);
                for revolutions in [-40.0, -1.0, 1.0, 25.0] {
                    let there_nm =
                        level_nm(&table(), velocity_rad_s, motor_rad + revolutions * TAU);
                    assert!((here_nm - there_nm).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn meets_every_point_and_the_middle_between_two() {
        let table = table();
        for (index, &point_nm) in table.positive_nm.iter().enumerate() {
            let next_nm = table.positive_nm[(index + 1) % 5];
            let at_nm = |place: f64| level_nm(&table, 0.1, TAU * place / 5.0);
            assert!((at_nm(index as f64) - point_nm).abs() < 1e-12);
            assert!((at_nm(index as f64 + 0.5) - 0.5 * (point_nm + next_nm)).abs() < 1e-12);
        }
    }

    #[test]
    fn is_continuous_and_stays_within_its_points() {
        let (table, steps) = (table(), 10_000);
        let mut before_nm = level_nm(&table, 0.1, -TAU);
        for step in 1..=2 * steps {
            let motor_rad = TAU * (f64::from(step) / f64::from(steps) - 1.0);
            let here_nm = level_nm(&table, 0.1, motor_rad);
            assert!((-2.0..=4.0).contains(&here_nm));
            // the steepest piece falls by 6 Nm in a fifth of a revolution
            assert!((here_nm - before_nm).abs() <= 6.0 * 5.0 / f64::from(steps) + 1e-12);
            before_nm = here_nm;
        }
    }

    #[test]
    fn each_direction_reads_its_own_row() {
        let table = table();
        assert_eq!(level_nm(&table, 1e-9, 0.0), 1.0);
        assert_eq!(level_nm(&table, -1e-9, 0.0), 2.0);
        assert_eq!(level_nm(&table, -0.1, 0.25 * TAU), 0.5);
    }

    #[test]
    fn no_points_are_no_friction_and_one_point_is_coulombs() {
        let table = FrictionLookup {
            positive_nm: [].into(),
            negative_nm: [3.0].into(),
        };
        for motor_rad in [-2.0, 0.0, 5.0] {
            assert_eq!(level_nm(&table, 0.1, motor_rad), 0.0);
            assert_eq!(level_nm(&table, -0.1, motor_rad), 3.0);
        }
    }

    #[test]
    fn any_angle_gives_an_answer() {
        for motor_rad in [f64::NAN, f64::INFINITY, f64::MAX, -f64::MIN_POSITIVE] {
            level_nm(&table(), 0.1, motor_rad);
        }
        assert_eq!(level_nm(&table(), 0.1, -f64::MIN_POSITIVE), 1.0);
    }
}
