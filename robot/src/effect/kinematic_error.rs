//! Kinematic error: the gear leads and lags as the motor turns, by up to three harmonics, joint side.

use joint_model::transmission::KinematicHarmonic;

use super::{Full, Gear, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 9] = [
    Parameter::new("amplitude_rad"),
    Parameter::new("cycles_per_motor_rev"),
    Parameter::new("phase_rad"),
    Parameter::new("amplitude_rad_2"),
    Parameter::new("cycles_per_motor_rev_2"),
    Parameter::new("phase_rad_2"),
    Parameter::new("amplitude_rad_3"),
    Parameter::new("cycles_per_motor_rev_3"),
    Parameter::new("phase_rad_3"),
];

#[expect(
    clippy::too_many_arguments,
    reason = "three harmonics of three numbers, as files write them"
)]
pub(super) fn act(
    gear: &mut dyn Gear,
    strength: f64,
    amplitude_rad: f64,
    cycles_per_motor_rev: f64,
    phase_rad: f64,
    amplitude_rad_2: f64,
    cycles_per_motor_rev_2: f64,
    phase_rad_2: f64,
    amplitude_rad_3: f64,
    cycles_per_motor_rev_3: f64,
    phase_rad_3: f64,
) -> Result<(), Full> {
    let harmonics = [
        (amplitude_rad, cycles_per_motor_rev, phase_rad),
        (amplitude_rad_2, cycles_per_motor_rev_2, phase_rad_2),
        (amplitude_rad_3, cycles_per_motor_rev_3, phase_rad_3),
    ];
    let there = harmonics.into_iter().filter(|harmonic| harmonic.0 != 0.0);
    for (amplitude_rad, cycles_per_motor_rev, phase_rad) in there {
        gear.add_kinematic_error(KinematicHarmonic {
            amplitude_rad: strength * amplitude_rad,
            cycles_per_motor_rev,
            phase_rad,
        })?;
    }
    Ok(())
}
