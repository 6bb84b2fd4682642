//! Effects on the path of commands and samples: delays and losses.

use robot::EncoderSide;
use robot::effect::parts::{self, either_lost};

/// Delays and losses of one joint.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Timing {
    pub command_delay_s: f64,
    pub sensor_delay_s: f64,
    /// By which an encoder's angle is older than the sample, motor's and link's.
    pub encoder_delays_s: [f64; 2],
    /// Part of the commands that is lost.
    pub dropped_commands: f64,
    /// Part of the samples that is lost.
    pub dropped_samples: f64,
}

impl parts::Bus for Timing {
    fn delay_commands(&mut self, delay_s: f64) {
        self.command_delay_s += delay_s;
    }

    fn delay_samples(&mut self, delay_s: f64) {
        self.sensor_delay_s += delay_s;
    }

    fn delay_encoder(&mut self, side: EncoderSide, delay_s: f64) {
        self.encoder_delays_s[side as usize] += delay_s;
    }

    fn lose_commands(&mut self, fraction: f64) {
        self.dropped_commands = either_lost(self.dropped_commands, fraction);
    }

    fn lose_samples(&mut self, fraction: f64) {
        self.dropped_samples = either_lost(self.dropped_samples, fraction);
    }
}
