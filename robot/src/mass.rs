//! Frames and mass properties as descriptions of robots give them.

use joint_model::rigid_body::Link;
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};

/// A frame by its place and fixed-axis roll, pitch, yaw.
pub fn isometry(origin_m: [f64; 3], rpy_rad: [f64; 3]) -> Isometry3<f64> {
    let [roll, pitch, yaw] = rpy_rad;
    Isometry3::from_parts(
        Translation3::from(origin_m),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// Mass, centre and inertia about the centre, all in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    pub mass_kg: f64,
    pub centre_m: Vector3<f64>,
    pub inertia_kg_m2: Matrix3<f64>,
}

/// Nothing of a robot swings as if its mass were farther from its own centre; a URDF of somebody who knows no inertia has 1.
const GYRATION_M: f64 = 1.0;

impl MassProperties {
    /// That it swings as no part of a robot does, if so.
    pub fn told_if_wide(&self) -> Option<String> {
        let largest = self.largest_inertia_kg_m2();
        let is_wide = self.mass_kg > 0.0 && largest > self.mass_kg * GYRATION_M.powi(2);
        is_wide.then(|| {
            format!(
                "{} kg with {largest} kg m² swings as if it were {:.1} m wide; correct mass or inertia",
                self.mass_kg,
                2.0 * (largest / self.mass_kg).sqrt()
            )
        })
    }

    /// About its centre.
    pub fn largest_inertia_kg_m2(&self) -> f64 {
        self.inertia_kg_m2.symmetric_eigenvalues().max()
    }

    /// A whole link's, in its frame.
    pub fn of(link: &Link) -> Self {
        Self {
            mass_kg: link.mass_kg,
            centre_m: link.centre_of_mass_m,
            inertia_kg_m2: link.inertia_kg_m2,
        }
    }

    pub fn none() -> Self {
        Self {
            mass_kg: 0.0,
            centre_m: Vector3::zeros(),
            inertia_kg_m2: Matrix3::zeros(),
        }
    }

    /// The same body in a frame in which this one's frame stands so.
    pub fn seen_from(&self, frame: &Isometry3<f64>) -> Self {
        let turn = frame.rotation.to_rotation_matrix();
        Self {
            mass_kg: self.mass_kg,
            centre_m: (frame * Point3::from(self.centre_m)).coords,
            inertia_kg_m2: turn * self.inertia_kg_m2 * turn.transpose(),
        }
    }

    /// Several bodies as one: about their common centre, by the parallel-axis theorem.
    pub fn sum(parts: &[Self]) -> Self {
        // one alone keeps its very values
        if let [only] = parts {
            return *only;
        }
        let mass_kg: f64 = parts.iter().map(|part| part.mass_kg).sum();
        let moment: Vector3<f64> = parts.iter().map(|part| part.centre_m * part.mass_kg).sum();
        let centre_m = if mass_kg > 0.0 {
            moment / mass_kg
        } else {
            Vector3::zeros()
        };
        let about_common_centre = |part: &Self| {
            let lever = part.centre_m - centre_m;
            let shift = Matrix3::identity() * lever.norm_squared() - lever * lever.transpose();
            part.inertia_kg_m2 + part.mass_kg * shift
        };
        Self {
            mass_kg,
            centre_m,
            inertia_kg_m2: parts.iter().map(about_common_centre).sum(),
        }
    }
}
