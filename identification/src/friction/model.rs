//! The three models of friction over speed that PA10-05 compares, each direction of motion on its own.

use serde::Serialize;

/// A model of the friction that opposes motion at speed `v ≥ 0` in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FrictionModel {
    /// `F0 + Fv·v`: Table I's "viscous model".
    CoulombViscous,
    /// `c0 + c1·v + c2·v² + c3·v³`.
    Cubic,
    /// Eq (7): `F0 + Fv·v + Fs·(1 - exp(-v/Vc))`.
    Stribeck,
}

/// Symbol and unit of each model's parameters.
const COULOMB_VISCOUS: [(&str, &str); 2] = [("F0", "Nm"), ("Fv", "Nm s/rad")];
const CUBIC: [(&str, &str); 4] = [
    ("c0", "Nm"),
    ("c1", "Nm s/rad"),
    ("c2", "Nm s²/rad²"),
    ("c3", "Nm s³/rad³"),
];
const STRIBECK: [(&str, &str); 4] = [
    ("F0", "Nm"),
    ("Fv", "Nm s/rad"),
    ("Fs", "Nm"),
    ("Vc", "rad/s"),
];

impl FrictionModel {
    /// In the order of Table I.
    pub const ALL: [Self; 3] = [Self::CoulombViscous, Self::Cubic, Self::Stribeck];

    /// In words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::CoulombViscous => "Coulomb and viscous",
            Self::Cubic => "cubic",
            Self::Stribeck => "Stribeck",
        }
    }

    /// Number of parameters in one direction: Table I's "model DOF".
    #[must_use]
    pub const fn parameter_count(self) -> usize {
        self.symbols().len()
    }

    /// Symbol and unit of each parameter.
    #[must_use]
    pub const fn symbols(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::CoulombViscous => &COULOMB_VISCOUS,
            Self::Cubic => &CUBIC,
            Self::Stribeck => &STRIBECK,
        }
    }
}

/// A fitted parameter of one model in one direction. Magnitudes: positive opposes the motion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// As in the model's equation.
    pub symbol: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The estimate.
    pub value: f64,
    /// One standard deviation of the estimate; none where the data do not determine it.
    pub standard_error: Option<f64>,
    /// The fit wanted to leave the range the speeds can tell of: a finding, not a value. Only `Vc` has bounds.
    pub at_bound: bool,
}
