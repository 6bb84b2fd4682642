//! Dropped samples: this part of the samples never arrives, at once. Several lose independently.

use super::{Bus, Full, Parameter, Scope};

pub(super) const SCOPE: Scope = Scope::Bus;
pub(super) const PARAMETERS: [Parameter; 1] = [Parameter::new("fraction").sum_is_fraction()];

pub(super) fn act(bus: &mut dyn Bus, _strength: f64, fraction: f64) -> Result<(), Full> {
    bus.lose_samples(fraction);
    Ok(())
}
