//! Every effect of the contract as a family over its strength, with what is plausible for a joint.

use std::f64::consts::TAU;

use robot::{Effect, EncoderSide};

use crate::random::Random;
use crate::rig::RigKind;
use crate::sizes::Sizes;

/// A change of a known value is a gap only beyond so many of its standard deviations.
const BEYOND_TOLERANCE: f64 = 3.0;

/// An effect whose shape is drawn and whose strength is still open.
pub(crate) struct Family {
    pub make: Box<dyn Fn(f64) -> Effect>,
    /// Below this it would be within the tolerance of what the file knows.
    pub least: f64,
    /// The strongest that is plausible.
    pub most: f64,
}

fn family(least: f64, most: f64, make: impl Fn(f64) -> Effect + 'static) -> Option<Family> {
    (most > 0.0).then(|| Family {
        make: Box::new(make),
        least,
        most,
    })
}

/// The family of that name at a joint; none where the joint cannot have it or nobody could see it.
pub(crate) fn draw(
    name: &str,
    kind: RigKind,
    sizes: &Sizes,
    random: &mut Random,
) -> Option<Family> {
    let known = BEYOND_TOLERANCE * sizes.tolerance;
    friction(name, known, sizes, random)
        .or_else(|| gear(name, known, sizes, random))
        .or_else(|| actuator(name, known, sizes, random))
        .or_else(|| body(name, known, kind, sizes, random))
        .or_else(|| sensing(name, sizes, random))
        .or_else(|| timing(name))
}

fn friction(name: &str, known: f64, sizes: &Sizes, random: &mut Random) -> Option<Family> {
    let friction_nm = sizes.friction_nm;
    let sign = random.sign();
    // less friction than half of what is known is not plausible
    let part = if sign > 0.0 { 1.0 } else { 0.5 };
    let speed_rad_s = sizes.speed_rad_s.max(0.1);
    match name {
        "coulomb_friction" => family(known * friction_nm, part * friction_nm, move |a| {
            Effect::CoulombFriction {
                coulomb_nm: sign * a,
            }
        }),
        "viscous_friction" => {
            let known_nm_s_rad = sizes.viscous_nm_s_rad;
            let most = if sign > 0.0 {
                2.0 * friction_nm / speed_rad_s
            } else {
                0.6 * known_nm_s_rad
            };
            family(known * known_nm_s_rad, most, move |a| {
                Effect::ViscousFriction {
                    viscous_nm_s_rad: sign * a,
                }
            })
        }
        "quadratic_friction" => family(0.0, 2.0 * friction_nm / speed_rad_s.powi(2), |a| {
            Effect::QuadraticFriction {
                quadratic_nm_s2_rad2: a,
            }
        }),
        "stribeck_friction" => {
            let stribeck_velocity_rad_s = random.magnitude(0.008, 0.12);
            let sign = if random.chance(0.8) { 1.0 } else { -1.0 };
            let most = if sign > 0.0 { 1.0 } else { 0.4 } * friction_nm;
            family(known * sizes.stribeck_nm, most, move |a| {
                Effect::StribeckFriction {
                    stribeck_nm: sign * a,
                    stribeck_velocity_rad_s,
                }
            })
        }
        "asymmetric_friction" => {
            // rows per direction are off independently
            let least = if sizes.directional {
                known * friction_nm
            } else {
                0.0
            };
            family(least, 0.5 * friction_nm, move |a| {
                Effect::AsymmetricFriction {
                    asymmetry_nm: sign * a,
                }
            })
        }
        "load_dependent_friction" if sizes.is_loaded() => {
            family(known * sizes.load_coefficient, 0.4, |a| {
                Effect::LoadDependentFriction {
                    load_coefficient: a,
                }
            })
        }
        "position_dependent_friction" => {
            let cycles_per_motor_rev = random.pick(&[1.0, 3.0, 4.0, 6.0]);
            let phase_rad = random.between(0.0, TAU);
            family(0.0, 0.5 * friction_nm, move |a| {
                Effect::PositionDependentFriction {
                    amplitude_nm: a,
                    cycles_per_motor_rev,
                    phase_rad,
                }
            })
        }
        "thermal_friction_drift" => {
            let time_constant_s = random.chance(0.5).then(|| random.between(5.0, 20.0));
            let most = part * friction_nm * 0.8;
            family(0.0, most, move |a| match time_constant_s {
                Some(_) => Effect::ThermalFrictionDrift {
                    drift_nm_s: None,
                    time_constant_s,
                    change_nm: Some(sign * a),
                },
                None => Effect::ThermalFrictionDrift {
                    drift_nm_s: Some(sign * a / 30.0),
                    time_constant_s: None,
                    change_nm: None,
                },
            })
        }
        _ => None,
    }
}

fn gear(name: &str, known: f64, sizes: &Sizes, random: &mut Random) -> Option<Family> {
    let stiffness = sizes.stiffness_nm_rad;
    let limit_nm = sizes.limit_nm;
    match name {
        "kinematic_error" => {
            let cycles = random.pick(&[1.0, 2.0, 4.0]);
            let phase_rad = random.between(0.0, TAU);
            let second = if random.chance(0.4) { 0.4 } else { 0.0 };
            let phase_rad_2 = if second > 0.0 {
                random.between(0.0, TAU)
            } else {
                0.0
            };
            let cycles_2 = if second > 0.0 { 2.0 * cycles } else { 0.0 };
            family(0.0, 6e-4, move |a| Effect::KinematicError {
                amplitude_rad: a,
                cycles_per_motor_rev: cycles,
                phase_rad,
                amplitude_rad_2: second * a,
                cycles_per_motor_rev_2: cycles_2,
                phase_rad_2,
                amplitude_rad_3: 0.0,
                cycles_per_motor_rev_3: 0.0,
                phase_rad_3: 0.0,
            })
        }
        "torsional_compliance" => {
            let (sign, most) = if random.chance(0.8) {
                (-1.0, 0.7)
            } else {
                (1.0, 1.0)
            };
            family(known * stiffness, most * stiffness, move |a| {
                Effect::TorsionalCompliance {
                    stiffness_nm_rad: sign * a,
                }
            })
        }
        "soft_windup" => {
            let low_stiffness_nm_rad = stiffness * random.between(0.15, 0.4);
            family(0.0, 0.3 * limit_nm, move |a| Effect::SoftWindup {
                low_stiffness_nm_rad,
                knee_nm: a,
            })
        }
        "torsional_hysteresis" => {
            let yield_rad = random.magnitude(5e-5, 4e-4);
            // as stiff as the gear itself at most
            family(
                0.0,
                (0.2 * limit_nm).min(2.0 * stiffness * yield_rad),
                move |a| Effect::TorsionalHysteresis {
                    width_nm: a,
                    yield_rad,
                },
            )
        }
        "structural_damping" => {
            let exponent = random.pick(&[1.0, 0.7, 0.5]);
            family(
                known * sizes.damping_nm_s_rad,
                8.0 * sizes.damping_nm_s_rad,
                move |a| Effect::StructuralDamping {
                    damping_nm_s_rad: a,
                    exponent,
                },
            )
        }
        "backlash" => family(0.0, 4e-3, |a| Effect::Backlash { gap_rad: a }),
        _ => None,
    }
}

fn actuator(name: &str, known: f64, sizes: &Sizes, random: &mut Random) -> Option<Family> {
    let sign = random.sign();
    let motor_limit_nm = sizes.limit_nm / sizes.gear_ratio;
    match name {
        "torque_constant_error" => family(known, 0.35, move |a| Effect::TorqueConstantError {
            gain: 1.0 + sign * a,
        }),
        "torque_offset" => family(0.0, 0.2 * sizes.limit_nm, move |a| Effect::TorqueOffset {
            offset_nm: sign * a,
        }),
        "torque_ripple" => {
            let cycles_per_motor_rev = random.pick(&[2.0, 5.0, 6.0, 8.0, 12.0]);
            let phase_rad = random.between(0.0, TAU);
            family(0.0, 0.15 * motor_limit_nm, move |a| Effect::TorqueRipple {
                amplitude_nm: a,
                cycles_per_motor_rev,
                phase_rad,
            })
        }
        // strength is what the drive lacks of its limit
        "torque_saturation" => family(0.0, 0.95, move |a| Effect::TorqueSaturation {
            limit_nm: motor_limit_nm * (1.0 - a),
        }),
        "current_loop_lag" => family(0.0, 0.03, |a| Effect::CurrentLoopLag { time_constant_s: a }),
        _ => None,
    }
}

fn body(
    name: &str,
    known: f64,
    kind: RigKind,
    sizes: &Sizes,
    random: &mut Random,
) -> Option<Family> {
    let gravity_nm = sizes.gravity_max_nm();
    match name {
        "payload" => payload(known, kind, sizes, random),
        "link_inertia" => {
            let inertia = sizes.link_inertia_kg_m2;
            family(known * inertia, 1.5 * inertia, |a| Effect::LinkInertia {
                inertia_kg_m2: a,
            })
        }
        "rotor_inertia" => {
            let (sign, most) = if random.chance(0.7) {
                (1.0, 1.5)
            } else {
                (-1.0, 0.6)
            };
            let inertia = sizes.rotor_inertia_kg_m2;
            family(known * inertia, most * inertia, move |a| {
                Effect::RotorInertia {
                    inertia_kg_m2: sign * a,
                }
            })
        }
        "gravity_torque" if gravity_nm > 0.0 => {
            let (sin, cos) = random.between(0.0, TAU).sin_cos();
            family(known * gravity_nm, 0.6 * gravity_nm, move |a| {
                Effect::GravityTorque {
                    sin_nm: sin * a,
                    cos_nm: cos * a,
                }
            })
        }
        "joint_spring" => {
            let [low_rad, high_rad] = sizes.position_rad;
            let span_rad = (high_rad - low_rad).max(0.1);
            let rest_rad = random.between(low_rad - 0.3 * span_rad, high_rad + 0.3 * span_rad);
            family(0.0, 0.3 * sizes.limit_nm / span_rad, move |a| {
                Effect::JointSpring {
                    stiffness_nm_rad: a,
                    rest_rad,
                }
            })
        }
        "base_tilt" if gravity_nm > 0.0 => {
            let direction = match kind {
                RigKind::OneJoint => random.sign() * TAU / 4.0,
                RigKind::SevenJoints => random.between(0.0, TAU),
            };
            let (pitch, roll) = direction.sin_cos();
            family(0.0, 0.3, move |a| Effect::BaseTilt {
                roll_rad: if kind == RigKind::OneJoint {
                    0.0
                } else {
                    roll * a
                },
                pitch_rad: pitch * a,
            })
        }
        _ => None,
    }
}

/// On the bench at the link's end, on the arm at the flange.
fn payload(known: f64, kind: RigKind, sizes: &Sizes, random: &mut Random) -> Option<Family> {
    let (centre_m, most_kg) = match kind {
        RigKind::OneJoint => {
            let arm_m = random.between(0.15, 0.4);
            (
                [0.0, 0.0, random.sign() * arm_m],
                0.3 * sizes.limit_nm / (9.81 * arm_m),
            )
        }
        RigKind::SevenJoints => (
            [
                random.between(-0.05, 0.05),
                random.between(-0.05, 0.05),
                random.between(0.0, 0.15),
            ],
            8.0,
        ),
    };
    let least_kg = match kind {
        RigKind::OneJoint => known * sizes.gravity_max_nm() / (9.81 * centre_m[2].abs()),
        RigKind::SevenJoints => 0.0,
    };
    family(least_kg, most_kg, move |a| Effect::Payload {
        mass_kg: a,
        centre_m,
    })
}

fn sensing(name: &str, sizes: &Sizes, random: &mut Random) -> Option<Family> {
    let sign = random.sign();
    let link_side = sizes.has_link_encoder && random.chance(0.5);
    let (side, ratio) = if link_side {
        (EncoderSide::Link, 1.0)
    } else {
        (EncoderSide::Motor, sizes.gear_ratio)
    };
    match name {
        "encoder_offset" if sizes.is_loaded() => family(0.0, 0.3, move |a| Effect::EncoderOffset {
            offset_rad: sign * a,
        }),
        "encoder_eccentricity" => {
            let cycles_per_rev = random.pick(&[1.0, 2.0]);
            let phase_rad = random.between(0.0, TAU);
            family(0.0, 6e-3 * ratio.min(30.0), move |a| {
                Effect::EncoderEccentricity {
                    amplitude_rad: a,
                    cycles_per_rev,
                    phase_rad,
                    side,
                }
            })
        }
        "encoder_quantisation" => family(0.0, 2e-3 * ratio, move |a| Effect::EncoderQuantisation {
            resolution_rad: a,
            side,
        }),
        // strength is the filter's time constant
        "velocity_filter_lag" => family(0.0, 0.05, |a| Effect::VelocityFilterLag {
            cutoff_hz: 1.0 / (TAU * a),
        }),
        _ => None,
    }
}

fn timing(name: &str) -> Option<Family> {
    match name {
        "command_delay" => family(0.0, 0.02, |a| Effect::CommandDelay { delay_s: a }),
        "sensor_delay" => family(0.0, 0.02, |a| Effect::SensorDelay {
            delay_s: a,
            side: None,
        }),
        "dropped_commands" => family(0.0, 0.6, |a| Effect::DroppedCommands { fraction: a }),
        "dropped_samples" => family(0.0, 0.6, |a| Effect::DroppedSamples { fraction: a }),
        _ => None,
    }
}

/// Effects that no recording of such a rig can tell from this one: they move the same signals in the same way.
pub(crate) fn equivalents(effect: &Effect, kind: RigKind) -> &'static [&'static str] {
    match effect {
        Effect::CommandDelay { .. } => &["sensor_delay"],
        Effect::SensorDelay { .. } => &["command_delay"],
        // one joint about a level axis: a tilt, a turned zero and a shifted centre of mass load it alike
        Effect::BaseTilt { .. } if kind == RigKind::OneJoint => {
            &["encoder_offset", "gravity_torque"]
        }
        Effect::EncoderOffset { .. } if kind == RigKind::OneJoint => {
            &["base_tilt", "gravity_torque"]
        }
        _ => &[],
    }
}
