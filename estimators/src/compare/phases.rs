//! What the joint does in each row: stands, moves, has just reversed.

use std::ops::Range;

use crate::JointLog;

/// Below this speed, over 20 ms, the joint stands: an encoder of 12 bits behind a hundredfold gear flickers by a third of it.
pub const STANDING_RAD_S: f64 = 0.005;
/// It must have stood for so long before and after: what motion excited has died away.
pub const STANDING_AFTER_S: f64 = 0.25;
/// Half of the window speed is taken over.
const HALF_WINDOW_S: f64 = 0.01;
/// A row this near to a change of direction counts as a reversal.
const REVERSAL_S: f64 = 0.05;

/// Row by row.
#[derive(Clone, Debug)]
pub struct Phases {
    /// Nothing moves, for a while.
    pub stands: Vec<bool>,
    /// The direction of motion has just changed, or is about to.
    pub reverses: Vec<bool>,
}

impl Phases {
    /// By the motor encoder, which every joint has.
    pub(crate) fn of(log: &JointLog, gear_ratio: f64) -> Self {
        let velocity = log.slow_velocity_rad_s(gear_ratio, HALF_WINDOW_S);
        // where speed is not known the joint may have moved
        let moves = |row: usize| velocity[row].is_nan() || velocity[row].abs() >= STANDING_RAD_S;
        let turns = turns(&velocity);
        let rows = |time_s: f64| (time_s / log.period_s).round() as usize;
        let moved_near = near(log.rows(), rows(STANDING_AFTER_S), moves);
        let mut turned = vec![false; log.rows()];
        turns.into_iter().for_each(|row| turned[row] = true);
        let turned_near = near(log.rows(), rows(REVERSAL_S), |row| turned[row]);
        Self {
            stands: moved_near.iter().map(|moved| !moved).collect(),
            reverses: turned_near
                .iter()
                .zip(&moved_near)
                .map(|(turned, moved)| *turned && *moved)
                .collect(),
        }
    }

    /// The longest run of rows in which the joint stands.
    pub fn longest_hold(&self) -> Option<Range<usize>> {
        let mut longest = 0..0;
        let mut begun = 0;
        for row in 0..=self.stands.len() {
            if !self.stands.get(row).copied().unwrap_or(false) {
                if row - begun > longest.len() {
                    longest = begun..row;
                }
                begun = row + 1;
            }
        }
        (!longest.is_empty()).then_some(longest)
    }
}

/// Rows with a marked row within so many rows.
fn near(rows: usize, reach: usize, marked: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut found = vec![false; rows];
    let mut newest: Option<usize> = None;
    for (row, found) in found.iter_mut().enumerate() {
        if marked(row) {
            newest = Some(row);
        }
        *found |= newest.is_some_and(|newest| row - newest <= reach);
    }
    newest = None;
    for (row, found) in found.iter_mut().enumerate().rev() {
        if marked(row) {
            newest = Some(row);
        }
        *found |= newest.is_some_and(|newest| newest - row <= reach);
    }
    found
}

/// Rows in which the direction of a motion faster than standing changes.
fn turns(velocity_rad_s: &[f64]) -> Vec<usize> {
    let mut turns = Vec::new();
    let mut direction = 0.0;
    let mut last_moving = 0;
    for (row, velocity) in velocity_rad_s.iter().enumerate() {
        if velocity.is_nan() || velocity.abs() < STANDING_RAD_S {
            continue;
        }
        if velocity.signum() == -direction {
            turns.push((last_moving + row) / 2);
        }
        direction = velocity.signum();
        last_moving = row;
    }
    turns
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sample;

    fn log(position_rad: impl Fn(f64) -> f64, seconds: f64) -> JointLog {
        let period_s = 1e-3;
        let rows = (seconds / period_s) as usize;
        let samples = (0..rows).map(|row| Sample {
            cycle: row as u64,
            motor_position_rad: 100.0 * position_rad(row as f64 * period_s),
            link_position_rad: f64::NAN,
            motor_torque_nm: f64::NAN,
            load_nm: 0.0,
        });
        JointLog {
            time_s: (0..rows).map(|row| row as f64 * period_s).collect(),
            samples: samples.collect(),
            joint_torque_nm: vec![0.0; rows],
            gravity_nm: vec![0.0; rows],
            period_s,
        }
    }

    #[test]
    fn a_hold_between_two_moves_is_found_and_a_swing_never_stands() {
        // moves for 1 s, holds for 2 s, moves back
        let path = |time_s: f64| time_s.min(1.0) - (time_s - 3.0).clamp(0.0, 1.0);
        let phases = Phases::of(&log(path, 4.0), 100.0);
        let hold = phases.longest_hold().unwrap();
        assert!(
            (1240..1280).contains(&hold.start) && (2720..2760).contains(&hold.end),
            "{hold:?}"
        );
        let swing = |time_s: f64| 0.2 * (10.0 * time_s).sin();
        let phases = Phases::of(&log(swing, 3.0), 100.0);
        assert!(phases.stands.iter().all(|stands| !stands));
        // sin(10 t) turns at 0.157, 0.471, … s: nine times in 3 s, each 101 rows wide
        let reversing = phases.reverses.iter().filter(|is| **is).count();
        assert!((850..1000).contains(&reversing), "{reversing}");
    }
}
