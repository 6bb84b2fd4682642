//! Torque saturation: the drive gives no more than a limit. It is there or not; the limit does not enter linearly.

use robot::Effect;

use super::Shown;
use super::form::Form;
use crate::twin::scale::Scale;

/// Parts of the torque that a drive is seen to reach at which it may end.
const JUST_BELOW: [f64; 2] = [1.0, 0.99];

#[derive(Debug)]
pub struct TorqueSaturation;

impl Form for TorqueSaturation {
    fn effect(&self, _: &[f64], limit_nm: f64, _: &Scale) -> Effect {
        Effect::TorqueSaturation { limit_nm }
    }

    fn may_show(&self, shown: Shown, scale: &Scale) -> bool {
        shown.has_command && scale.may_saturate
    }

    fn shapes(&self, scale: &Scale) -> Vec<f64> {
        let parts = [0.95, 0.85, 0.7, 0.5].map(|part| part * scale.motor_torque_nm);
        // a drive that reports its torque shows where it ends; a joint that stalls there may do so from a little less on only
        let reached_nm = scale.reached_motor_nm.into_iter();
        let shown = reached_nm.flat_map(|reached_nm| JUST_BELOW.map(|part| part * reached_nm));
        shown.chain(parts).collect()
    }

    fn shape_range(&self, scale: &Scale) -> [f64; 2] {
        let reached_nm = scale.reached_motor_nm.unwrap_or(0.0);
        let most_nm = reached_nm.max(scale.motor_torque_nm);
        [0.2 * scale.motor_torque_nm, 1.2 * most_nm]
    }

    fn is_positive(&self) -> bool {
        true
    }

    fn is_switch(&self) -> bool {
        true
    }
}
