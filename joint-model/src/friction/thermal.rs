//! Thermal friction drift: grease thins as the gear warms, so the level drifts over minutes.
//!
//! Either `ΔT = r·t` (a constant drift) or `ΔT = C·(1 - exp(-t/τ))` (towards a warm state). Source: Simoni,
//! Beschi, Legnani, Visioli, IEEE/ASME Trans. Mechatronics 20 (2015) 1892–1899, a first-order thermal state.
//! Left out: heating by the friction's own power; time since the drift began is an argument.

/// How a friction level changes as the gear warms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ThermalFrictionDrift {
    /// Steady drift.
    Constant {
        /// Change of the level per second.
        drift_nm_s: f64,
    },
    /// First-order approach to a warm level.
    FirstOrder {
        /// Change of the level when warm.
        change_nm: f64,
        /// Time to reach 63 % of it. Positive.
        time_constant_s: f64,
    },
}

impl ThermalFrictionDrift {
    /// Change of the friction level after `elapsed_s`; zero before the drift begins.
    pub fn change_nm(&self, elapsed_s: f64) -> f64 {
        let elapsed_s = elapsed_s.max(0.0);
        match *self {
            Self::Constant { drift_nm_s } => drift_nm_s * elapsed_s,
            Self::FirstOrder {
                change_nm,
                time_constant_s,
            } => change_nm * -(-elapsed_s / time_constant_s).exp_m1(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn begins_at_zero_and_ends_at_the_warm_change() {
        let law = ThermalFrictionDrift::FirstOrder {
            change_nm: -3.0,
            time_constant_s: 600.0,
        };
        assert_eq!(law.change_nm(-5.0), 0.0);
        assert_eq!(law.change_nm(0.0), 0.0);
        assert!((law.change_nm(600.0) + 3.0 * 0.632_120_558_8).abs() < 1e-9);
        assert!((law.change_nm(1e5) + 3.0).abs() < 1e-12);
    }

    #[test]
    fn a_constant_drift_is_a_line() {
        let law = ThermalFrictionDrift::Constant { drift_nm_s: 0.01 };
        assert_eq!(law.change_nm(20.0), 2.0 * law.change_nm(10.0));
    }
}
