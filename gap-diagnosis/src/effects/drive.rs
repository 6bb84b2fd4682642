//! The drive and its bus: how much torque comes of a command, and when.

use recording_checks::units::GAIN;
use robot::{Effect, LateSide};

use super::form::{Form, Wave, friction_step_nm};

/// Steps of a torque constant, as a part of it.
const CONSTANT_STEP: f64 = 0.01;
/// Steps of the current loop's lag.
const LAG_STEP_S: f64 = 5e-4;

/// The drive gives more or less than it is asked for, by what its gain differs from 1.
pub const TORQUE_CONSTANT_ERROR: Form = Form {
    lowest: |_| (GAIN[0] - 1.0) / CONSTANT_STEP,
    ..Form::of(|amplitude, _, _| Effect::TorqueConstantError {
        gain: 1.0 + amplitude[0] * CONSTANT_STEP,
    })
};

/// A constant torque.
pub const TORQUE_OFFSET: Form = Form::of(|amplitude, _, scale| Effect::TorqueOffset {
    offset_nm: amplitude[0] * friction_step_nm(scale),
});

/// The motor gives more and less as it turns.
pub const TORQUE_RIPPLE: Form = Form::wave(|amplitude, cycles, scale| {
    let Wave { size, phase_rad } = Wave::of(amplitude);
    Effect::TorqueRipple {
        amplitude_nm: size * friction_step_nm(scale) / scale.gear_ratio,
        cycles_per_motor_rev: cycles,
        phase_rad,
    }
});

/// The drive gives no more than a limit: it is there or not, and the limit does not enter linearly.
pub const TORQUE_SATURATION: Form = Form {
    may_show: |shown, _| shown.limit_is_open && shown.has_command,
    shapes: |scale| {
        [0.95, 0.85, 0.7, 0.5]
            .map(|part| part * scale.motor_torque_nm)
            .to_vec()
    },
    shape_range: |scale| [0.2, 1.2].map(|part| part * scale.motor_torque_nm),
    is_positive: true,
    is_switch: true,
    ..Form::of(|_, limit_nm, _| Effect::TorqueSaturation { limit_nm })
};

/// The drive's torque follows its command after a while.
pub const CURRENT_LOOP_LAG: Form = Form {
    may_show: |shown, _| shown.has_command,
    is_positive: true,
    ..Form::of(|amplitude, _, _| Effect::CurrentLoopLag {
        time_constant_s: amplitude[0] * LAG_STEP_S,
    })
};

/// Steps of a current loop's lag that this is.
pub fn lag_steps(time_constant_s: f64) -> f64 {
    time_constant_s / LAG_STEP_S
}

/// Commands come late to the drive, in periods of the samples.
pub const COMMAND_DELAY: Form = Form {
    may_show: |shown, _| shown.timing_is_open && shown.has_command,
    is_positive: true,
    ..Form::of(|amplitude, _, scale| Effect::CommandDelay {
        delay_s: amplitude[0] * scale.period_s,
    })
};

/// Measurements come late to the controller, in periods of the samples. It is the commands that tell.
pub const SENSOR_DELAY: Form = Form {
    may_show: |shown, _| shown.timing_is_open && shown.has_command,
    is_positive: true,
    ..Form::of(|amplitude, _, scale| Effect::SensorDelay {
        delay_s: amplitude[0] * scale.period_s,
        side: None,
    })
};

/// Encoders show where a joint was before the torques that come with them, in periods of the samples. Commands that follow what they
/// show do not tell it.
pub const LATE_ENCODERS: Form = Form {
    is_positive: true,
    ..Form::of(|amplitude, _, scale| Effect::SensorDelay {
        delay_s: amplitude[0] * scale.period_s,
        side: Some(LateSide::Both),
    })
};
