//! Steady friction from constant-velocity motion: PA10-05, section IV-B1, Tables I and II. Joint side.
//!
//! [`measure_steady`] turns recordings into one friction value per stretch of constant velocity. [`identify_friction`]
//! fits three models to them, each direction of motion on its own, by weighted least squares; compares them as Table I
//! does and by information criteria and held-out trials; and chooses one. [`JointFriction::robot_friction`] is what a
//! robot file takes (Table II).
//!
//! Source: W. C. Kennedy, J. P. Desai, IEEE/ASME Trans. Mechatronics 2005 ("PA10-05").

mod choice;
mod comparison;
mod fit;
mod least_squares;
mod model;
mod speeds;
mod steady;
mod stribeck;

pub use choice::{JointFriction, identify_friction};
pub use comparison::ModelComparison;
pub use fit::DirectionFit;
pub use model::{FrictionModel, Parameter};
pub use steady::{SETTLING_S, SteadyMeasurement, measure_steady};
