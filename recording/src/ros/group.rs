//! Messages of one topic with the same joints: rows of a table of their own, to be read at other times.

use super::message::{Kind, Told};

/// A state that was not heard of for as many times the usual is not made up.
const GAP_STEPS: f64 = 10.0;

/// What one topic says of some joints.
pub(crate) struct Group {
    pub(crate) topic: String,
    pub(crate) kind: Kind,
    pub(crate) joints: Vec<String>,
    pub(crate) stamps_ns: Vec<i64>,
    /// Of each row the [`Kind::quantities`] of each joint in turn.
    values: Vec<f64>,
    pub(crate) messages: u64,
}

impl Group {
    pub(crate) fn new(topic: String, kind: Kind, joints: Vec<String>) -> Self {
        Self {
            topic,
            kind,
            joints,
            stamps_ns: Vec::new(),
            values: Vec::new(),
            messages: 0,
        }
    }

    fn width(&self) -> usize {
        self.joints.len() * self.kind.quantities().len()
    }

    /// Adds a message with the same joints, whose clock shows `start_ns`.
    pub(crate) fn add(&mut self, start_ns: i64, told: &Told) {
        self.messages += 1;
        if self.kind == Kind::Trajectory {
            self.replace_from(start_ns);
        }
        for (after_ns, values) in &told.rows {
            self.stamps_ns.push(start_ns.saturating_add(*after_ns));
            self.values.extend(values);
        }
    }

    /// A new trajectory ends the one before, and leads away from where that has come to.
    fn replace_from(&mut self, start_ns: i64) {
        let before = |stamp: &i64| *stamp < start_ns;
        let kept = self
            .stamps_ns
            .iter()
            .rposition(before)
            .map_or(0, |row| row + 1);
        if kept == 0 {
            self.stamps_ns.clear();
            self.values.clear();
            return;
        }
        let width = self.width();
        let reached: Vec<f64> = (0..width).map(|column| self.at(start_ns, column)).collect();
        self.stamps_ns.truncate(kept);
        self.values.truncate(kept * width);
        self.stamps_ns.push(start_ns);
        self.values.extend(reached);
    }

    /// Puts the rows in the order of their time; whether they were not.
    pub(crate) fn sort(&mut self) -> bool {
        if self.stamps_ns.is_sorted() {
            return false;
        }
        let mut order: Vec<usize> = (0..self.stamps_ns.len()).collect();
        order.sort_by_key(|row| self.stamps_ns[*row]);
        let width = self.width();
        let rows = order
            .iter()
            .flat_map(|row| &self.values[row * width..][..width]);
        self.values = rows.copied().collect();
        self.stamps_ns.sort_unstable();
        true
    }

    /// One quantity of one joint at its own times.
    pub(crate) fn column(&self, joint: usize, quantity: usize) -> Vec<f64> {
        let column = joint * self.kind.quantities().len() + quantity;
        let rows = self.values.iter().skip(column).step_by(self.width().max(1));
        rows.copied().collect()
    }

    /// One quantity of one joint at other times, which do not run backwards.
    pub(crate) fn column_at(&self, times_ns: &[i64], joint: usize, quantity: usize) -> Vec<f64> {
        let column = joint * self.kind.quantities().len() + quantity;
        let gap_ns = self.longest_gap_ns();
        let value = |time_ns: &i64| {
            let after = self.stamps_ns.partition_point(|stamp| stamp < time_ns);
            let next_ns = self.stamps_ns.get(after);
            let exact = next_ns == Some(time_ns);
            let bridged = exact || self.kind == Kind::Trajectory || {
                let before_ns = after.checked_sub(1).map(|before| self.stamps_ns[before]);
                before_ns
                    .zip(next_ns)
                    .is_some_and(|(before_ns, next_ns)| next_ns.saturating_sub(before_ns) <= gap_ns)
            };
            if bridged {
                self.at(*time_ns, column)
            } else {
                f64::NAN
            }
        };
        times_ns.iter().map(value).collect()
    }

    /// A column by a straight line between the rows before and after; a trajectory's end is held.
    fn at(&self, time_ns: i64, column: usize) -> f64 {
        let width = self.width();
        let after = self.stamps_ns.partition_point(|stamp| *stamp < time_ns);
        let value = |row: usize| self.values[row * width + column];
        match (after.checked_sub(1), self.stamps_ns.get(after)) {
            (_, Some(next_ns)) if *next_ns == time_ns => value(after),
            (Some(before), Some(next_ns)) => {
                let before_ns = i128::from(self.stamps_ns[before]);
                let done = (i128::from(time_ns) - before_ns) as f64;
                let share = done / (i128::from(*next_ns) - before_ns) as f64;
                value(before) + share * (value(after) - value(before))
            }
            (Some(before), None) => value(before),
            (None, _) => f64::NAN,
        }
    }

    /// Of the median step.
    fn longest_gap_ns(&self) -> i64 {
        let steps = self.stamps_ns.windows(2);
        let mut steps: Vec<i64> = steps.map(|pair| pair[1].saturating_sub(pair[0])).collect();
        if steps.is_empty() {
            return 0;
        }
        let middle = steps.len() / 2;
        let median = *steps.select_nth_unstable(middle).1;
        (GAP_STEPS * median as f64) as i64
    }

    /// How often it was heard of, if that can be told.
    pub(crate) fn rate_hz(&self) -> Option<f64> {
        let first = self.stamps_ns.first()?;
        let seconds = self.stamps_ns.last()?.saturating_sub(*first) as f64 * 1e-9;
        let steps = self.stamps_ns.len() - 1;
        (seconds > 0.0).then(|| steps as f64 / seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(rows: &[(i64, f64)]) -> Told {
        Told {
            joints: vec!["elbow".to_owned()],
            stamp_ns: 0,
            rows: rows
                .iter()
                .map(|(after_ns, position)| (*after_ns, vec![*position, f64::NAN, f64::NAN]))
                .collect(),
        }
    }

    fn group(kind: Kind) -> Group {
        Group::new("/topic".to_owned(), kind, vec!["elbow".to_owned()])
    }

    #[test]
    fn states_are_met_by_straight_lines_and_long_gaps_are_left_open() {
        let mut states = group(Kind::JointState);
        for (stamp_ns, position) in [(30, 3.0), (0, 0.0), (10, 1.0), (20, 2.0), (1000, 9.0)] {
            states.add(stamp_ns, &told(&[(0, position)]));
        }
        assert!(states.sort());
        let met = states.column_at(&[-1, 0, 5, 30, 500, 1000, 1001], 0, 0);
        assert!(met[0].is_nan() && met[4].is_nan() && met[6].is_nan());
        assert_eq!([met[1], met[2], met[3], met[5]], [0.0, 0.5, 3.0, 9.0]);
        assert_eq!(states.column(0, 0), [0.0, 1.0, 2.0, 3.0, 9.0]);
    }

    #[test]
    fn a_new_trajectory_ends_the_one_before_where_that_has_come_to() {
        let mut trajectory = group(Kind::Trajectory);
        trajectory.add(0, &told(&[(0, 0.0), (100, 10.0)]));
        trajectory.add(50, &told(&[(50, 0.0)]));
        assert_eq!(
            trajectory.column_at(&[0, 25, 50, 75, 100, 900], 0, 0),
            [0.0, 2.5, 5.0, 2.5, 0.0, 0.0]
        );
    }
}
