//! Sensor delay: measurements are so much older, at once. Either all that a drive reports, as a bus makes it; or its encoders beside
//! torques that are not, as a slower path or a filter of positions makes it.

use super::{Bus, EncoderSide, Full, LateSide};

pub(super) fn act(
    bus: &mut dyn Bus,
    _strength: f64,
    delay_s: f64,
    side: Option<LateSide>,
) -> Result<(), Full> {
    let sides: &[EncoderSide] = match side {
        None => {
            bus.delay_samples(delay_s);
            &[]
        }
        Some(LateSide::Motor) => &[EncoderSide::Motor],
        Some(LateSide::Link) => &[EncoderSide::Link],
        Some(LateSide::Both) => &[EncoderSide::Motor, EncoderSide::Link],
    };
    for side in sides {
        bus.delay_encoder(*side, delay_s);
    }
    Ok(())
}
