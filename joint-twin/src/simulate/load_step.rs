//! The load on a link between two samples.

use crate::joint::JointModel;
use crate::load::Load;

/// On the link, at one instant.
pub(super) struct LinkLoad {
    pub(super) inertia_kg_m2: f64,
    pub(super) torque_nm: f64,
}

/// The load from a sample to the next, in a straight line.
pub(super) struct LoadStep {
    /// Inertia, torque, slope, position; and how they change until the next sample.
    from: [f64; 4],
    change: [f64; 4],
}

impl LoadStep {
    #[inline]
    pub(super) fn from(load: &Load, k: usize) -> Self {
        let next = (k + 1).min(load.torque_nm.len() - 1);
        let columns = [
            &load.inertia_kg_m2,
            &load.torque_nm,
            &load.slope_nm_rad,
            &load.position_rad,
        ];
        let from = columns.map(|column| column[k]);
        let to = columns.map(|column| column[next]);
        Self {
            from,
            change: [0, 1, 2, 3].map(|i| to[i] - from[i]),
        }
    }

    #[inline]
    pub(super) fn at(&self, model: &JointModel, share: f64, link_rad: f64) -> LinkLoad {
        let [inertia_kg_m2, torque_nm, slope_nm_rad, position_rad] =
            [0, 1, 2, 3].map(|i| self.from[i] + share * self.change[i]);
        let [sin_nm, cos_nm] = model.gravity_sin_cos_nm;
        let added_nm = if sin_nm == 0.0 && cos_nm == 0.0 {
            0.0
        } else {
            let (sin, cos) = link_rad.sin_cos();
            sin_nm * sin + cos_nm * cos
        };
        let springs = model.springs.iter();
        let springs_nm: f64 = springs.map(|spring| spring.holding_nm(link_rad)).sum();
        let carried_nm =
            torque_nm + slope_nm_rad * (link_rad - position_rad) + added_nm + springs_nm;
        LinkLoad {
            inertia_kg_m2,
            torque_nm: carried_nm + model.friction.tables.held_nm(link_rad, carried_nm),
        }
    }
}
