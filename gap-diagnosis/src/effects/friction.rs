//! Friction at the joint: levels, drags, and how they change with time.

use joint_twin::scale::Scale;
use robot::Effect;

use super::form::{Form, Wave, friction_step_nm};

/// Steps of friction over load.
const LOAD_STEP: f64 = 0.01;
/// Friction that falls at lower speeds than this is part of how a joint begins to slip.
const CREEPING_RAD_S: f64 = 0.008;
/// Steps of what a second changes: a part of friction's.
const RATE_STEP: f64 = 0.1;

/// A level that depends on the direction alone.
pub const COULOMB: Form = Form {
    lowest: all_friction,
    ..Form::of(|amplitude, _, scale| Effect::CoulombFriction {
        coulomb_nm: amplitude[0] * friction_step_nm(scale),
    })
};

/// Drag in proportion to velocity.
pub const VISCOUS: Form = Form {
    lowest: |scale| -scale.drag_nm / friction_step_nm(scale),
    ..Form::of(|amplitude, _, scale| Effect::ViscousFriction {
        viscous_nm_s_rad: amplitude[0] * friction_step_nm(scale) / scale.speed_rad_s,
    })
};

/// Drag in proportion to the square of velocity.
pub const QUADRATIC: Form = Form::of(|amplitude, _, scale| Effect::QuadraticFriction {
    quadratic_nm_s2_rad2: amplitude[0] * friction_step_nm(scale) / scale.speed_rad_s.powi(2),
});

/// An excess at rest that falls with speed. The excess enters linearly, the velocity over which it falls does not.
pub const STRIBECK: Form = Form {
    lowest: all_friction,
    shapes: |scale| {
        [0.02, 0.06, 0.18]
            .map(|part| (part * scale.speed_rad_s).max(slowest_rad_s(scale)))
            .to_vec()
    },
    shape_range: |scale| [slowest_rad_s(scale), 0.5 * scale.speed_rad_s],
    ..Form::of(
        |amplitude, velocity_rad_s, scale| Effect::StribeckFriction {
            stribeck_nm: amplitude[0] * friction_step_nm(scale),
            stribeck_velocity_rad_s: velocity_rad_s,
        },
    )
};

/// Half the difference between the directions.
pub const ASYMMETRIC: Form = Form::of(|amplitude, _, scale| Effect::AsymmetricFriction {
    asymmetry_nm: amplitude[0] * friction_step_nm(scale),
});

/// A level in proportion to the torque the gear carries. Load never takes friction away, but where a table of the file says so.
pub const LOAD_DEPENDENT: Form = Form {
    lowest: |scale| {
        let told = scale.load_coefficient;
        told.map_or(f64::NEG_INFINITY, |coefficient| -coefficient / LOAD_STEP)
    },
    ..Form::of(|amplitude, _, _| Effect::LoadDependentFriction {
        load_coefficient: amplitude[0] * LOAD_STEP,
    })
};

/// A level that repeats with the motor's turn.
pub const POSITION_DEPENDENT: Form = Form::wave(|amplitude, cycles, scale| {
    let Wave { size, phase_rad } = Wave::of(amplitude);
    Effect::PositionDependentFriction {
        amplitude_nm: size * friction_step_nm(scale),
        cycles_per_motor_rev: cycles,
        phase_rad,
    }
});

/// A level that changes at a constant rate as the joint warms.
pub const CONSTANT_DRIFT: Form = Form::of(|amplitude, _, scale| Effect::ThermalFrictionDrift {
    drift_nm_s: Some(amplitude[0] * RATE_STEP * friction_step_nm(scale)),
    time_constant_s: None,
    change_nm: None,
});

/// A level that changes towards another. The change enters linearly, its time constant does not.
pub const FIRST_ORDER_DRIFT: Form = Form {
    shapes: |_| vec![8.0],
    shape_range: |_| [1.0, 300.0],
    ..Form::of(
        |amplitude, time_constant_s, scale| Effect::ThermalFrictionDrift {
            drift_nm_s: None,
            time_constant_s: Some(time_constant_s),
            change_nm: Some(amplitude[0] * friction_step_nm(scale)),
        },
    )
};

/// No more is taken off than there is.
fn all_friction(scale: &Scale) -> f64 {
    -scale.least_friction_nm / friction_step_nm(scale)
}

/// Slower is creeping, which every joint does in its own way.
fn slowest_rad_s(scale: &Scale) -> f64 {
    CREEPING_RAD_S.min(0.1 * scale.speed_rad_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::tests::scale;

    #[test]
    fn no_more_is_taken_off_than_there_is() {
        let least = (COULOMB.lowest)(&scale());
        let Effect::CoulombFriction { coulomb_nm } = (COULOMB.effect)(&[least], 0.0, &scale())
        else {
            panic!("no Coulomb friction");
        };
        assert!((coulomb_nm + 1.0).abs() < 1e-12, "{coulomb_nm}");
    }

    #[test]
    fn load_takes_no_friction_away_unless_a_table_says_so() {
        let least = (LOAD_DEPENDENT.lowest)(&scale());
        let Effect::LoadDependentFriction { load_coefficient } =
            (LOAD_DEPENDENT.effect)(&[least], 0.0, &scale())
        else {
            panic!("no load-dependent friction");
        };
        assert!(
            (load_coefficient + 0.05).abs() < 1e-12,
            "{load_coefficient}"
        );
        let table = Scale {
            load_coefficient: None,
            ..scale()
        };
        assert_eq!((LOAD_DEPENDENT.lowest)(&table), f64::NEG_INFINITY);
    }
}
