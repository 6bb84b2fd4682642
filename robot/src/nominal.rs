//! From what a robot file says about a joint to the physics of [`joint_model`].

use joint_model::friction::{
    FrictionLookup, LoadTorque, LoadTorqueRow, SteadyFriction, StribeckCurve, StribeckRow,
};
use joint_model::torque_table::{self, TorqueTables};

use crate::{
    DirectionalFriction, Effect, FrictionTable, LoadTorqueTable, RobotJoint, TableOver, TorqueTable,
};

impl RobotJoint {
    /// Inertia of the rotor about the joint's axis, the file's own and what its effects add to it, in kg m²: `N²·J`.
    pub fn reflected_inertia_kg_m2(&self) -> f64 {
        let added = self.effects.iter().map(|effect| match effect {
            Effect::RotorInertia { inertia_kg_m2 } => *inertia_kg_m2,
            _ => 0.0,
        });
        (self.rotor_inertia_kg_m2 + added.sum::<f64>()) * self.gear_ratio.powi(2)
    }

    /// All friction the file knows, as torque over velocity, load and motor angle. Effects and tables add up.
    pub fn steady_friction(&self) -> SteadyFriction {
        let mut friction = self.table_friction();
        for effect in &self.effects {
            let added = effect.act(&mut friction, 1.0);
            assert!(added.is_ok(), "a robot file with more terms is refused");
        }
        friction
    }

    /// Friction of the file's tables alone.
    pub fn table_friction(&self) -> SteadyFriction {
        SteadyFriction {
            curve: self.direction_friction.as_ref().map(stribeck_curve),
            load_torque: self.load_torque.as_ref().map(load_torque),
            lookup: self.friction_table.as_ref().map(friction_lookup),
            tables: self.torque_tables(),
            ..SteadyFriction::default()
        }
    }

    /// The torque that no effect has a name for.
    pub fn torque_tables(&self) -> TorqueTables {
        TorqueTables::new(self.torque_tables.iter().map(torque_table))
    }
}

fn stribeck_curve(table: &DirectionalFriction) -> StribeckCurve {
    let row = |row: &crate::StribeckRow| StribeckRow {
        f0_nm: row.f0_nm,
        fv_nm_s_rad: row.fv_nm_s_rad,
        fs_nm: row.fs_nm,
        vc_rad_s: row.vc_rad_s,
    };
    StribeckCurve {
        positive: row(&table.positive),
        negative: row(&table.negative),
    }
}

fn load_torque(table: &LoadTorqueTable) -> LoadTorque {
    let row = |row: &crate::LoadTorqueRow| LoadTorqueRow {
        slopes: row.slopes,
        knees_nm: row.knees_nm,
        zero_load_nm: row.zero_load_nm,
    };
    // The table as printed, corners and all.
    LoadTorque {
        positive: row(&table.positive),
        negative: row(&table.negative),
        knee_rounding_nm: 0.0,
    }
}

fn friction_lookup(table: &FrictionTable) -> FrictionLookup {
    FrictionLookup {
        positive_nm: table.positive_nm.as_slice().into(),
        negative_nm: table.negative_nm.as_slice().into(),
    }
}

fn torque_table(table: &TorqueTable) -> torque_table::TorqueTable {
    let over = match table.over {
        TableOver::Position => torque_table::TableOver::Position,
        TableOver::Velocity => torque_table::TableOver::Velocity,
        TableOver::Load => torque_table::TableOver::Load,
    };
    torque_table::TorqueTable {
        over,
        at: table.at.as_slice().into(),
        torque_nm: table.torque_nm.as_slice().into(),
    }
}
