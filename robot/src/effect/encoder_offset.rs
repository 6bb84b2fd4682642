//! Encoder offset: the joint's zero, joint side; both encoders read so much more.

use super::{Full, Parameter, Scope, Sensors};

pub(super) const SCOPE: Scope = Scope::Joint;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("offset_rad").adds_up()];

pub(super) fn act(sensors: &mut dyn Sensors, strength: f64, offset_rad: f64) -> Result<(), Full> {
    sensors.add_offset(strength * offset_rad);
    Ok(())
}
