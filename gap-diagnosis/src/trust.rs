//! How far a twin is usually off: less on a single joint than in an arm, where the other joints' motion adds to it.

/// What is within the errors of a good twin. Squares are parts of the floor that any residual has
/// ([`crate::search::Search::floor`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trust {
    /// A residual by the robot file as it is below this is no gap.
    pub by_file: f64,
    /// The same with known values fitted.
    pub by_known: f64,
    /// No twin is taken to be better than this.
    pub least: f64,
    /// What naming an effect costs more, in nats: each of several joints may look like something by chance, and what the
    /// others do is not independent from sample to sample.
    pub naming_nats: f64,
    /// Nats that a torque of no named law may be worth: a twin's friction is another's law.
    pub shape_nats: f64,
    /// The same where the recording lacks commands, or is too slow: what the torque does between two rows comes aliased.
    pub aliased_nats: f64,
}

const ALONE: Trust = Trust {
    by_file: 0.3,
    by_known: 0.1,
    least: 0.2,
    naming_nats: 0.0,
    shape_nats: 20.0,
    aliased_nats: 60.0,
};
const IN_ARM: Trust = Trust {
    by_file: 0.3,
    by_known: 0.1,
    least: 0.3,
    naming_nats: 3.0,
    shape_nats: 30.0,
    aliased_nats: 90.0,
};

impl Trust {
    /// In a robot of so many joints.
    pub fn of(joints: usize) -> &'static Self {
        if joints > 1 { &IN_ARM } else { &ALONE }
    }
}
