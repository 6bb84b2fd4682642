//! What is done to any sampled signal, whatever it measures.

pub mod band;
pub mod beside;
pub mod random;
pub(crate) mod rounding;
pub mod smooth;
pub mod waves;

/// What one signal has more than another, sample by sample.
pub fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}
