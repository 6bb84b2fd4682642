//! Effects on the path of commands and samples: delays and losses.

use robot::Effect;

/// Delays and losses of one joint.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Timing {
    pub command_delay_s: f64,
    pub sensor_delay_s: f64,
    /// Part of the commands that is lost.
    pub dropped_commands: f64,
    /// Part of the samples that is lost.
    pub dropped_samples: f64,
}

impl Timing {
    pub(super) fn add(&mut self, effect: &Effect) {
        match *effect {
            Effect::CommandDelay { delay_s } => self.command_delay_s += delay_s,
            Effect::SensorDelay { delay_s } => self.sensor_delay_s += delay_s,
            Effect::DroppedCommands { fraction } => {
                self.dropped_commands = either(self.dropped_commands, fraction);
            }
            Effect::DroppedSamples { fraction } => {
                self.dropped_samples = either(self.dropped_samples, fraction)
            }
            _ => {}
        }
    }
}

/// Part lost by one of two independent causes.
fn either(a: f64, b: f64) -> f64 {
    1.0 - (1.0 - a) * (1.0 - b)
}
