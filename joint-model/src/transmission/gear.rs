//! The ideal gear: what the three parts of a harmonic drive do to each other without loss or error.
//!
//! PA10-05 eqs (2)–(4): `θ_wg = (N+1)·θ_cs - N·θ_fs`, `ω_wg = (N+1)·ω_cs - N·ω_fs`,
//! `T_wg = T_cs/(N+1) = T_fs/N`. With the circular spline fixed the output turns against the input; robot files and
//! everything else here count both about the joint's axis, so there `θ_fs = θ_wg/N`.

/// A harmonic drive by its ratio.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gear {
    /// `N`: motor revolutions per joint revolution with the circular spline fixed.
    pub ratio: f64,
}

impl Gear {
    /// Eq (2): wave generator angle from circular spline and flexspline angle, all about one axis.
    pub fn wave_generator_rad(&self, circular_spline_rad: f64, flexspline_rad: f64) -> f64 {
        (self.ratio + 1.0) * circular_spline_rad - self.ratio * flexspline_rad
    }

    /// Eq (3): the same for velocities.
    pub fn wave_generator_rad_s(&self, circular_spline_rad_s: f64, flexspline_rad_s: f64) -> f64 {
        (self.ratio + 1.0) * circular_spline_rad_s - self.ratio * flexspline_rad_s
    }

    /// Eq (2) for the flexspline's angle: what the output would show without compliance and kinematic error.
    pub fn flexspline_rad(&self, wave_generator_rad: f64, circular_spline_rad: f64) -> f64 {
        ((self.ratio + 1.0) * circular_spline_rad - wave_generator_rad) / self.ratio
    }

    /// Eq (3) for the flexspline's velocity.
    pub fn flexspline_rad_s(&self, wave_generator_rad_s: f64, circular_spline_rad_s: f64) -> f64 {
        ((self.ratio + 1.0) * circular_spline_rad_s - wave_generator_rad_s) / self.ratio
    }

    /// Eq (4): torque at the wave generator that balances a torque at the flexspline.
    pub fn wave_generator_nm(&self, flexspline_nm: f64) -> f64 {
        flexspline_nm / self.ratio
    }

    /// Eq (4): torque at the flexspline beside a torque at the wave generator.
    pub fn flexspline_nm(&self, wave_generator_nm: f64) -> f64 {
        self.ratio * wave_generator_nm
    }

    /// Eq (4): torque at the circular spline beside a torque at the wave generator.
    pub fn circular_spline_nm(&self, wave_generator_nm: f64) -> f64 {
        (self.ratio + 1.0) * wave_generator_nm
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GEAR: Gear = Gear { ratio: 50.0 };

    #[test]
    fn turned_as_one_body_the_parts_keep_together() {
        assert!((GEAR.wave_generator_rad(0.3, 0.3) - 0.3).abs() < 1e-12);
        assert!((GEAR.wave_generator_rad_s(-2.0, -2.0) + 2.0).abs() < 1e-12);
    }

    #[test]
    fn with_the_circular_spline_fixed_the_output_turns_the_other_way_n_times_slower() {
        assert_eq!(GEAR.wave_generator_rad(0.0, 1.0), -50.0);
    }

    #[test]
    fn with_the_flexspline_fixed_the_circular_spline_turns_along_n_plus_one_times_slower() {
        assert_eq!(GEAR.wave_generator_rad(1.0, 0.0), 51.0);
    }

    #[test]
    fn the_flexspline_follows_from_the_other_two() {
        for (circular_rad, flexspline_rad) in [(0.0, 0.2), (0.3, 0.3), (-0.7, 1.3)] {
            let input_rad = GEAR.wave_generator_rad(circular_rad, flexspline_rad);
            assert!((GEAR.flexspline_rad(input_rad, circular_rad) - flexspline_rad).abs() < 1e-12);
            let input_rad_s = GEAR.wave_generator_rad_s(circular_rad, flexspline_rad);
            assert!(
                (GEAR.flexspline_rad_s(input_rad_s, circular_rad) - flexspline_rad).abs() < 1e-12
            );
        }
    }

    #[test]
    fn the_torques_stand_as_one_to_n_to_n_plus_one() {
        assert_eq!(GEAR.flexspline_nm(0.2), 10.0);
        assert!((GEAR.circular_spline_nm(0.2) - 10.2).abs() < 1e-12);
    }

    #[test]
    fn power_in_is_power_out() {
        let (circular_rad_s, flexspline_rad_s, wave_generator_nm) = (0.7, -1.3, 0.2);
        let flexspline_nm = GEAR.flexspline_nm(wave_generator_nm);
        assert!((GEAR.wave_generator_nm(flexspline_nm) - wave_generator_nm).abs() < 1e-15);
        let input_w =
            wave_generator_nm * GEAR.wave_generator_rad_s(circular_rad_s, flexspline_rad_s);
        let output_w = GEAR.circular_spline_nm(wave_generator_nm) * circular_rad_s
            - flexspline_nm * flexspline_rad_s;
        assert!((input_w - output_w).abs() < 1e-12);
    }
}
