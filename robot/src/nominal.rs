//! From what a robot file says about a joint to the physics of [`joint_model`].

use joint_model::friction::{
    FrictionLookup, LoadTorque, LoadTorqueRow, PeriodicFriction, SteadyFriction, StribeckCurve,
    StribeckFriction, StribeckRow, TERMS_MAX,
};

use joint_model::torque_table::{self, TorqueTables};

use crate::{
    DirectionalFriction, Effect, FrictionTable, LoadTorqueTable, RobotJoint, TableOver, TorqueTable,
};

impl RobotJoint {
    /// All friction the file knows, as torque over velocity, load and motor angle. Effects and tables add up.
    pub fn steady_friction(&self) -> SteadyFriction {
        let mut friction = SteadyFriction {
            curve: self.direction_friction.as_ref().map(stribeck_curve),
            load_torque: self.load_torque.as_ref().map(load_torque),
            lookup: self.friction_table.as_ref().map(friction_lookup),
            tables: self.torque_tables(),
            ..SteadyFriction::default()
        };
        for effect in &self.effects {
            // There is room: a robot file with more terms was refused.
            let added = add_friction(&mut friction, effect, 1.0);
            debug_assert!(added.is_ok(), "{} terms were checked", effect.name());
        }
        friction
    }

    /// The torque that no effect has a name for.
    pub fn torque_tables(&self) -> TorqueTables {
        TorqueTables::new(self.torque_tables.iter().map(torque_table))
    }
}

/// A joint's model has room for so many Stribeck or periodic terms, and they are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a joint takes at most {TERMS_MAX} effects of this kind")]
pub struct FrictionFull;

/// Adds `strength` times an effect, if it is friction that depends on velocity, load or motor angle; any other effect
/// changes nothing.
///
/// # Errors
/// [`FrictionFull`].
pub fn add_friction(
    friction: &mut SteadyFriction,
    effect: &Effect,
    strength: f64,
) -> Result<(), FrictionFull> {
    match *effect {
        Effect::CoulombFriction { coulomb_nm } => {
            friction.coulomb.coulomb_nm += strength * coulomb_nm
        }
        Effect::ViscousFriction { viscous_nm_s_rad } => {
            friction.viscous.viscous_nm_s_rad += strength * viscous_nm_s_rad;
        }
        Effect::QuadraticFriction {
            quadratic_nm_s2_rad2,
        } => {
            friction.quadratic.quadratic_nm_s2_rad2 += strength * quadratic_nm_s2_rad2;
        }
        Effect::AsymmetricFriction { asymmetry_nm } => {
            friction.asymmetric.asymmetry_nm += strength * asymmetry_nm;
        }
        Effect::LoadDependentFriction { load_coefficient } => {
            friction.load_dependent.load_coefficient += strength * load_coefficient;
        }
        Effect::StribeckFriction {
            stribeck_nm,
            stribeck_velocity_rad_s,
        } => {
            let term = StribeckFriction {
                stribeck_nm: strength * stribeck_nm,
                stribeck_velocity_rad_s,
            };
            friction.stribeck.try_push(term).map_err(|_| FrictionFull)?;
        }
        Effect::PositionDependentFriction {
            amplitude_nm,
            cycles_per_motor_rev,
            phase_rad,
        } => {
            let term = PeriodicFriction {
                amplitude_nm: strength * amplitude_nm,
                cycles_per_motor_rev,
                phase_rad,
            };
            friction.periodic.try_push(term).map_err(|_| FrictionFull)?;
        }
        _ => (),
    }
    Ok(())
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
