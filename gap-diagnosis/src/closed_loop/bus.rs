//! A delay of the bus: what the samples of most joints show alike is one cause.

use recording_checks::found::Found;
use robot::Effect;

use crate::evidence::ERRORS;

/// A delay that the samples of several joints show alike.
#[derive(Clone, Debug)]
pub struct CommonDelay {
    /// Mean over the joints.
    pub found: Found,
    /// Indices of the joints.
    pub joints: Vec<usize>,
}

impl CommonDelay {
    /// Whether this joint is one of those, and this what it shows.
    pub fn is_seen_as(&self, found: &Found, joint: usize) -> bool {
        self.joints.contains(&joint) && matches!(found.effect, Effect::CommandDelay { .. })
    }
}

/// The delay that more than half of the joints show within their errors: joints on one bus are late together.
pub fn common_delay(counted: &[Vec<Found>]) -> Option<CommonDelay> {
    let mut delays: Vec<(usize, f64, f64)> = Vec::new();
    for (joint, found) in counted.iter().enumerate() {
        delays.extend(found.iter().filter_map(|found| match found.effect {
            Effect::CommandDelay { delay_s } => Some((joint, delay_s, found.std)),
            _ => None,
        }));
    }
    delays.sort_by(|a, b| a.1.total_cmp(&b.1));
    let (_, median_s, _) = *delays.get(delays.len() / 2)?;
    delays.retain(|(_, delay_s, std_s)| (delay_s - median_s).abs() <= ERRORS * std_s);
    if delays.len() < 2 || 2 * delays.len() <= counted.len() {
        return None;
    }
    let count = delays.len() as f64;
    let mean = |of: fn(&(usize, f64, f64)) -> f64| delays.iter().map(of).sum::<f64>() / count;
    let delay_s = mean(|delay| delay.1);
    let mut joints: Vec<usize> = delays.iter().map(|delay| delay.0).collect();
    joints.sort_unstable();
    Some(CommonDelay {
        found: Found {
            effect: Effect::CommandDelay { delay_s },
            // what one joint's error comes from, the grid of delays that are tried, is the same at all
            std: mean(|delay| delay.2),
            because: format!(
                "the drives of {} joints are all {:.2} ms later than the controller's delay",
                joints.len(),
                1e3 * delay_s
            ),
        },
        joints,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn late(delay_s: f64) -> Vec<Found> {
        vec![Found {
            effect: Effect::CommandDelay { delay_s },
            std: 1e-4,
            because: String::new(),
        }]
    }

    #[test]
    fn a_delay_of_most_joints_is_one() {
        let common = common_delay(&[late(2.0e-3), late(2.1e-3), Vec::new(), late(1.9e-3)]);
        let common = common.expect("three of four joints are late alike");
        assert_eq!(common.joints, [0, 1, 3]);
        assert!(
            matches!(common.found.effect, Effect::CommandDelay { delay_s } if (delay_s - 2e-3).abs() < 1e-9)
        );
        assert!(common.is_seen_as(&late(2.1e-3)[0], 1));
        assert!(!common.is_seen_as(&late(2.1e-3)[0], 2));
    }

    #[test]
    fn delays_of_few_joints_or_of_different_length_are_their_own() {
        let joints = [late(2e-3), Vec::new(), Vec::new(), Vec::new()];
        assert!(common_delay(&joints).is_none());
        assert!(common_delay(&[late(2e-3), late(2e-3), Vec::new(), Vec::new()]).is_none());
        assert!(common_delay(&[late(2e-3), late(5e-3), late(9e-3)]).is_none());
        assert!(common_delay(&[late(2e-3)]).is_none());
    }
}
