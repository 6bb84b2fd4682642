//! Robot files, effects and injection files: read, checked, turned into models.
#![forbid(unsafe_code)]

mod effect;

pub use effect::{Effect, EncoderSide};
