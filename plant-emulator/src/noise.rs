//! Seeded randomness: one PCG stream for each purpose and joint, so that what happens at one joint leaves the noise of
//! all others as it is. (O'Neill, HMC-CS-2014-0905, 2014; streams are PCG's own.)

use rand_core::RngCore;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// What a stream is for.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Purpose {
    /// Deviation of parameters from the robot file.
    Deviation,
    /// Sensor noise.
    Sensors,
    /// Which commands are lost.
    DroppedCommands,
    /// Which samples are lost.
    DroppedSamples,
    /// Poses at which the plant looks for its fastest mode.
    Poses,
}

/// One stream of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Noise(Pcg64);

impl Noise {
    pub fn new(seed: u64, purpose: Purpose, joint: usize) -> Self {
        let stream = (purpose as u128) << 64 | joint as u128;
        Self(Pcg64::new(u128::from(seed), stream))
    }

    /// Mean 0, standard deviation 1.
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// Uniform from 0 up to, not including, 1.
    pub fn uniform(&mut self) -> f64 {
        const BITS: u32 = 53;
        (self.0.next_u64() >> (64 - BITS)) as f64 / (1_u64 << BITS) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_seed_purpose_and_joint_and_by_nothing_else() {
        let first = |seed, purpose, joint| Noise::new(seed, purpose, joint).normal();
        assert_eq!(first(1, Purpose::Sensors, 0), first(1, Purpose::Sensors, 0));
        assert_ne!(first(1, Purpose::Sensors, 0), first(2, Purpose::Sensors, 0));
        assert_ne!(
            first(1, Purpose::Sensors, 0),
            first(1, Purpose::Deviation, 0)
        );
        assert_ne!(first(1, Purpose::Sensors, 0), first(1, Purpose::Sensors, 1));
    }

    #[test]
    fn moments_are_those_of_the_distributions() {
        let mut noise = Noise::new(3, Purpose::Sensors, 0);
        let normal: Vec<f64> = (0..100_000).map(|_| noise.normal()).collect();
        let mean = normal.iter().sum::<f64>() / 1e5;
        let variance = normal.iter().map(|x| x * x).sum::<f64>() / 1e5;
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.02);
        let uniform: Vec<f64> = (0..100_000).map(|_| noise.uniform()).collect();
        assert!((uniform.iter().sum::<f64>() / 1e5 - 0.5).abs() < 0.01);
        assert!(uniform.iter().all(|x| (0.0..1.0).contains(x)));
    }
}
