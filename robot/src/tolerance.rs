//! How well the values of a robot file are known.

use std::collections::BTreeMap;
use std::fmt;

use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Relative standard deviation of values that the file does not speak of.
pub const DEFAULT_TOLERANCE: f64 = 0.02;

/// The names a table of tolerances may use.
pub(crate) const PARAMETERS: [&str; 36] = [
    "default",
    "mass_kg",
    "centre_of_mass_m",
    "inertia_kg_m2",
    "rotor_inertia_kg_m2",
    "torque_constant_nm_a",
    "direction_friction",
    "load_torque",
    "friction_table",
    "coulomb_nm",
    "viscous_nm_s_rad",
    "quadratic_nm_s2_rad2",
    "stribeck_nm",
    "stribeck_velocity_rad_s",
    "asymmetry_nm",
    "load_coefficient",
    "amplitude_nm",
    "amplitude_rad",
    "cycles_per_motor_rev",
    "phase_rad",
    "stiffness_nm_rad",
    "low_stiffness_nm_rad",
    "knee_nm",
    "width_nm",
    "yield_rad",
    "damping_nm_s_rad",
    "exponent",
    "gap_rad",
    "drift_nm_s",
    "time_constant_s",
    "change_nm",
    "gain",
    "offset_nm",
    "sin_nm",
    "cos_nm",
    "delay_s",
];

/// Relative standard deviations of the values in a robot file: one number, or a table with a number per parameter
/// and `default` for the rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Tolerance {
    /// For every parameter without a number of its own.
    pub default: f64,
    /// By parameter name, as the robot file writes it.
    pub parameters: BTreeMap<String, f64>,
}

impl Tolerance {
    /// Relative standard deviation of the parameter, such as `coulomb_nm` or `mass_kg`.
    pub fn of(&self, parameter: &str) -> f64 {
        self.parameters
            .get(parameter)
            .copied()
            .unwrap_or(self.default)
    }
}

impl Default for Tolerance {
    fn default() -> Self {
        Self {
            default: DEFAULT_TOLERANCE,
            parameters: BTreeMap::new(),
        }
    }
}

impl Serialize for Tolerance {
    fn serialize<S: Serializer>(&self, output: S) -> Result<S::Ok, S::Error> {
        if self.parameters.is_empty() {
            return output.serialize_f64(self.default);
        }
        let default = std::iter::once(("default", self.default));
        output.collect_map(
            default.chain(
                self.parameters
                    .iter()
                    .map(|(name, value)| (name.as_str(), *value)),
            ),
        )
    }
}

impl<'de> Deserialize<'de> for Tolerance {
    fn deserialize<D: Deserializer<'de>>(input: D) -> Result<Self, D::Error> {
        struct NumberOrTable;

        impl<'de> Visitor<'de> for NumberOrTable {
            type Value = Tolerance;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a number, or a table with a number per parameter")
            }

            fn visit_f64<E>(self, default: f64) -> Result<Tolerance, E> {
                Ok(Tolerance {
                    default,
                    ..Tolerance::default()
                })
            }

            fn visit_i64<E>(self, default: i64) -> Result<Tolerance, E> {
                Ok(Tolerance {
                    default: default as f64,
                    ..Tolerance::default()
                })
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Tolerance, A::Error> {
                let mut tolerance = Tolerance::default();
                while let Some((name, value)) = map.next_entry::<String, f64>()? {
                    tolerance.parameters.insert(name, value);
                }
                if let Some(default) = tolerance.parameters.remove("default") {
                    tolerance.default = default;
                }
                Ok(tolerance)
            }
        }

        input.deserialize_any(NumberOrTable)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[derive(Serialize, Deserialize)]
    struct File {
        parameter_tolerance: Tolerance,
    }

    fn read(text: &str) -> Tolerance {
        toml::from_str::<File>(text).unwrap().parameter_tolerance
    }

    #[test]
    fn a_number_holds_for_everything() {
        assert_eq!(read("parameter_tolerance = 0.1").of("mass_kg"), 0.1);
        assert_eq!(read("parameter_tolerance = 0").of("mass_kg"), 0.0);
    }

    #[test]
    fn a_table_holds_per_parameter_and_survives_writing() {
        let tolerance = read("parameter_tolerance = { default = 0.03, mass_kg = 0.1 }");
        assert_eq!(
            (tolerance.of("mass_kg"), tolerance.of("coulomb_nm")),
            (0.1, 0.03)
        );
        let written = toml::to_string(&File {
            parameter_tolerance: tolerance.clone(),
        })
        .unwrap();
        assert_eq!(read(&written), tolerance);
        assert_eq!(
            read("parameter_tolerance = { mass_kg = 0.1 }").default,
            DEFAULT_TOLERANCE
        );
    }
}
