//! Torque that no law has a name for, as a table over one number: what a joint was seen to need beside everything else.
//!
//! `T(x) = t_i + (t_{i+1} - t_i)·(x - x_i)/(x_{i+1} - x_i)` between two corners, and that of the last corner beyond it, where
//! nothing was seen. `x` is the joint's angle, its velocity, or the torque that the gear carries. Joint side; positive where the
//! drive has to spend more torque in the positive direction, whichever way the joint moves.
//!
//! Source: the rest of a diagnosis, a straight line through it from corner to corner; a fit, not a cause. Over velocity it is split
//! at rest, `T(ω) = T(0) + d(ω)`: `d` vanishes there as viscous drag does, so that a time step can take it implicitly.
//! Left out: time, what happened before, and what two variables do together.

use std::sync::Arc;

use arrayvec::ArrayVec;

/// The most tables of one joint.
pub const TABLES_MAX: usize = 8;
/// A table's slope at rest is taken up to here: far below what any encoder tells from rest.
const AT_REST_RAD_S: f64 = 1e-6;

/// The number that a table is over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableOver {
    /// Joint angle.
    Position,
    /// Joint velocity.
    Velocity,
    /// Torque that the gear transmits to the link.
    Load,
}

/// One table. Clones share their rows, so a copy costs no heap.
#[derive(Clone, Debug, PartialEq)]
pub struct TorqueTable {
    /// What [`at`](Self::at) is.
    pub over: TableOver,
    /// Corners, ascending.
    pub at: Arc<[f64]>,
    /// Torque at each corner. A table without corners changes nothing.
    pub torque_nm: Arc<[f64]>,
}

impl TorqueTable {
    fn corners(&self) -> impl Iterator<Item = [f64; 2]> {
        let both = self.at.iter().zip(self.torque_nm.iter());
        both.map(|(at, torque_nm)| [*at, *torque_nm])
    }

    /// Torque at a value.
    pub fn torque_nm(&self, value: f64) -> f64 {
        let mut before: Option<[f64; 2]> = None;
        for [at, torque_nm] in self.corners() {
            if value < at {
                return before.map_or(torque_nm, |[from, from_nm]| {
                    from_nm + (torque_nm - from_nm) * (value - from) / (at - from)
                });
            }
            before = Some([at, torque_nm]);
        }
        before.map_or(0.0, |[_, torque_nm]| torque_nm)
    }

    /// Its integral from the first corner on.
    fn energy_j(&self, value: f64) -> f64 {
        let mut sum = 0.0;
        let mut before: Option<[f64; 2]> = None;
        for [at, torque_nm] in self.corners() {
            let [from, from_nm] = before.unwrap_or([at, torque_nm]);
            let to = at.min(value);
            // trapezoids are exact under straight lines
            sum += 0.5 * (from_nm + self.torque_nm(to)) * (to - from);
            if value <= at {
                return sum;
            }
            before = Some([at, torque_nm]);
        }
        before.map_or(0.0, |[last, torque_nm]| sum + torque_nm * (value - last))
    }
}

/// All tables of a joint, which add up. The default is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TorqueTables {
    all: ArrayVec<TorqueTable, TABLES_MAX>,
}

impl TorqueTables {
    /// The first [`TABLES_MAX`] of these.
    pub fn new(tables: impl IntoIterator<Item = TorqueTable>) -> Self {
        Self {
            all: tables.into_iter().take(TABLES_MAX).collect(),
        }
    }

    fn over(&self, over: TableOver) -> impl Iterator<Item = &TorqueTable> {
        self.all.iter().filter(move |table| table.over == over)
    }

    /// Torque that the joint needs at rest.
    pub fn held_nm(&self, position_rad: f64, load_nm: f64) -> f64 {
        let tables = self.all.iter();
        let at_rest = tables.map(|table| match table.over {
            TableOver::Position => table.torque_nm(position_rad),
            TableOver::Velocity => table.torque_nm(0.0),
            TableOver::Load => table.torque_nm(load_nm),
        });
        at_rest.sum()
    }

    /// Torque that it needs more while it moves.
    pub fn drag_nm(&self, velocity_rad_s: f64) -> f64 {
        self.over(TableOver::Velocity)
            .map(|table| table.torque_nm(velocity_rad_s) - table.torque_nm(0.0))
            .sum()
    }

    /// [`drag_nm`](Self::drag_nm) over the velocity: what a time step has to treat implicitly.
    pub fn drag_nm_s_rad(&self, velocity_rad_s: f64) -> f64 {
        let moving_rad_s = velocity_rad_s.abs().max(AT_REST_RAD_S);
        let moving_rad_s = moving_rad_s.copysign(velocity_rad_s);
        self.drag_nm(moving_rad_s) / moving_rad_s
    }

    /// Energy that turning the joint here has put into what is over its angle.
    pub fn energy_j(&self, position_rad: f64) -> f64 {
        self.over(TableOver::Position)
            .map(|table| table.energy_j(position_rad))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(over: TableOver) -> TorqueTable {
        TorqueTable {
            over,
            at: [-1.0, 0.5, 2.0].into(),
            torque_nm: [2.0, -1.0, 5.0].into(),
        }
    }

    #[test]
    fn meets_its_corners_the_middle_between_them_and_stays_beyond() {
        let table = table(TableOver::Position);
        for (at, expected_nm) in [
            (-9.0, 2.0),
            (-1.0, 2.0),
            (-0.25, 0.5),
            (0.5, -1.0),
            (1.25, 2.0),
            (2.0, 5.0),
            (7.0, 5.0),
        ] {
            assert!((table.torque_nm(at) - expected_nm).abs() < 1e-12, "{at}");
        }
    }

    #[test]
    fn each_variable_is_its_own_and_all_add_up() {
        let all = [TableOver::Position, TableOver::Velocity, TableOver::Load];
        let tables = TorqueTables::new(all.map(table));
        let at = |value| table(TableOver::Load).torque_nm(value);
        assert!((tables.held_nm(1.5, -0.5) - (at(1.5) + at(0.0) + at(-0.5))).abs() < 1e-12);
        assert!((tables.drag_nm(1.0) - (at(1.0) - at(0.0))).abs() < 1e-12);
    }

    #[test]
    fn drag_vanishes_at_rest_and_is_its_coefficient_times_the_velocity() {
        let tables = TorqueTables::new([table(TableOver::Velocity)]);
        assert_eq!(tables.drag_nm(0.0), 0.0);
        for velocity_rad_s in [-3.0, -0.2, 1e-9, 0.4, 3.0] {
            let drag_nm = tables.drag_nm_s_rad(velocity_rad_s) * velocity_rad_s;
            assert!((drag_nm - tables.drag_nm(velocity_rad_s)).abs() < 1e-9);
        }
        let slope_nm_s_rad = -3.0 / 1.5;
        assert!((tables.drag_nm_s_rad(0.0) - slope_nm_s_rad).abs() < 1e-6);
    }

    #[test]
    fn the_energy_has_the_torque_as_slope() {
        let tables = TorqueTables::new([table(TableOver::Position), table(TableOver::Load)]);
        for position_rad in [-2.0, -0.4, 0.5, 1.9, 4.0] {
            let step_j =
                tables.energy_j(position_rad + 1e-6) - tables.energy_j(position_rad - 1e-6);
            let torque_nm = table(TableOver::Position).torque_nm(position_rad);
            assert!((step_j / 2e-6 - torque_nm).abs() < 1e-5, "{position_rad}");
        }
    }

    #[test]
    fn no_corners_are_no_torque_and_any_value_gives_an_answer() {
        let empty = TorqueTable {
            over: TableOver::Load,
            at: [].into(),
            torque_nm: [].into(),
        };
        assert_eq!(empty.torque_nm(1.0), 0.0);
        assert_eq!(empty.energy_j(1.0), 0.0);
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let torque_nm = table(TableOver::Load).torque_nm(value);
            assert!(torque_nm.is_finite(), "{value}");
        }
    }
}
