//! What lies between motor and link: stiffness, hysteresis, damping, kinematic error. One effect, one file.
//!
//! Torsion is joint side: motor angle over the gear ratio, plus kinematic error, minus link angle. Torque is what the
//! gear transmits to the link; it acts on the motor with the opposite sign. (SD, eq (3), counts torsion the other
//! way round.)

mod backlash;
mod compliance;
mod gear;
mod hysteresis;
mod kinematic_error;
mod soft_windup;
mod structural_damping;

pub use backlash::Backlash;
pub use compliance::{ArctanCompliance, CatalogueCompliance, LinearCompliance, Spring};
pub use gear::Gear;
pub use hysteresis::TorsionalHysteresis;
pub use kinematic_error::{KinematicHarmonic, kinematic_error};
pub use soft_windup::SoftWindup;
pub use structural_damping::StructuralDamping;
