//! How far a twin is usually off: less on a single joint than in an arm, where the other joints' motion adds to it.

/// What is within the errors of a good twin. Squares are parts of the floor that any residual has
/// ([`crate::search::Search::floor`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trust {
    /// A residual by the robot file as it is below this is no gap.
    pub by_file: f64,
    /// The same with known values fitted.
    pub by_known: f64,
    /// A residual beside the effects below this may have any shape.
    pub of_any_shape: f64,
    /// No twin is taken to be better than this.
    pub least: f64,
    /// What naming an effect costs more, in nats: each of several joints may look like something by chance, and what the
    /// others do is not independent from sample to sample.
    pub naming_nats: f64,
    /// Nats of torques of no named law over velocity, acceleration, jerk and travel since a reversal: a twin's friction is
    /// another's law.
    pub friction_nats: f64,
    /// The same over anything else.
    pub rest_nats: f64,
}

const ALONE: Trust = Trust {
    by_file: 0.3,
    by_known: 0.1,
    of_any_shape: 2.0,
    least: 0.2,
    naming_nats: 0.0,
    friction_nats: 90.0,
    rest_nats: 45.0,
};
const IN_ARM: Trust = Trust {
    by_file: 0.3,
    by_known: 0.1,
    of_any_shape: 2.0,
    least: 0.4,
    naming_nats: 3.0,
    friction_nats: 90.0,
    rest_nats: 60.0,
};

impl Trust {
    /// In a robot of so many joints.
    pub fn of(joints: usize) -> &'static Self {
        if joints > 1 { &IN_ARM } else { &ALONE }
    }

    /// Nats that a torque over this variable may be worth.
    pub fn nats(&self, over: &str) -> f64 {
        match over {
            "velocity" | "acceleration" | "jerk" | "travel since the last reversal" => {
                self.friction_nats
            }
            _ => self.rest_nats,
        }
    }
}
