//! What is done to any sampled signal, whatever it measures.

pub mod band;
pub mod beside;
pub mod random;
pub(crate) mod rounding;
pub mod smooth;
pub(crate) mod waves;
