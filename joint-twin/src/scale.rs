//! Sizes of a joint along its recordings, by which fitting steps are chosen.

use joint_model::friction::Sliding;
use nalgebra::{Unit, Vector3};

use crate::joint::JointModel;
use crate::stretch::JointStretch;

/// Quantile at which largest torques are compared: a few samples may be anything.
const NEARLY_ALL: f64 = 0.999;
/// Fewer rows than this tell nothing: what is told of them is known to a tenth at best.
pub const ROWS_MIN: usize = 100;
/// A drive whose torque reaches this part of the largest command is not at its limit.
pub const SATURATED: f64 = 0.97;

/// Sizes of a joint, by which steps are chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Dry friction in slow motion, or a part of the torque where the file knows none.
    pub friction_nm: f64,
    /// The least that the file's friction comes to at any speed: more cannot be taken off it.
    pub least_friction_nm: f64,
    /// The file's drag at the usual speed.
    pub drag_nm: f64,
    /// Friction over load that the file has: less would be friction that load takes away. None where a table may have it fall.
    pub load_coefficient: Option<f64>,
    /// Fastest speed but for a few samples.
    pub speed_rad_s: f64,
    /// Motor turns per joint turn.
    pub gear_ratio: f64,
    /// Of the gear.
    pub stiffness_nm_rad: f64,
    /// Whether the robot file tells it.
    pub stiffness_is_known: bool,
    /// Largest torque but for a few samples, motor side.
    pub motor_torque_nm: f64,
    /// Rotor and link, joint side.
    pub inertia_kg_m2: f64,
    /// Of the rotor alone, joint side.
    pub rotor_inertia_kg_m2: f64,
    /// What can be taken off the link about the joint's axis and leave a body.
    pub spare_link_inertia_kg_m2: f64,
    /// Directions across the joint's axis, in its frame.
    pub across_axis: [Vector3<f64>; 2],
    /// Between two samples.
    pub period_s: f64,
    /// Range of the motor's angle.
    pub motor_turns: f64,
}

impl Scale {
    /// Of a joint about an axis of its frame, along its recordings, with what can be taken off its link's inertia.
    pub fn of(
        model: &JointModel,
        axis: Unit<Vector3<f64>>,
        stretches: &[&JointStretch],
        spare_link_inertia_kg_m2: f64,
    ) -> Self {
        let all = |column: fn(&JointStretch) -> &[f64]| {
            let mut values: Vec<f64> = stretches
                .iter()
                .flat_map(|stretch| column(stretch).iter().map(|x| x.abs()))
                .collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let high = |values: &[f64]| values[(0.99 * (values.len() - 1) as f64) as usize];
        let torque_nm = high(&all(|stretch| &stretch.torque_nm));
        let speed_rad_s = high(&all(|stretch| &stretch.load.velocity_rad_s)).max(1e-3);
        let inertia = all(|stretch| &stretch.load.inertia_kg_m2);
        let friction = &model.friction;
        let at_part = |part: f64| friction.level_nm(&Sliding::at(part * speed_rad_s));
        let told_nm = at_part(0.2);
        Self {
            friction_nm: told_nm.max(0.05 * torque_nm).max(1e-6),
            least_friction_nm: [0.0, 0.05, 0.2, 1.0]
                .map(at_part)
                .into_iter()
                .fold(f64::INFINITY, f64::min),
            drag_nm: friction.fluid_drag_nm(speed_rad_s),
            load_coefficient: friction
                .load_torque
                .is_none()
                .then_some(friction.load_dependent.load_coefficient),
            speed_rad_s,
            gear_ratio: model.gear_ratio,
            stiffness_nm_rad: model.stiffness_nm_rad,
            stiffness_is_known: model.stiffness_is_known,
            motor_torque_nm: torque_nm / model.gear_ratio,
            inertia_kg_m2: model.rotor_inertia_kg_m2 + inertia[inertia.len() / 2],
            rotor_inertia_kg_m2: model.rotor_inertia_kg_m2,
            spare_link_inertia_kg_m2,
            across_axis: across(axis),
            period_s: stretches[0].drive.period_s,
            motor_turns: motor_turns(model.gear_ratio, stretches),
        }
    }

    /// Torque of the motor behind the gear, but for a few samples.
    pub fn torque_nm(&self) -> f64 {
        self.gear_ratio * self.motor_torque_nm
    }

    /// Twist of the gear under the joint's friction.
    pub fn twist_rad(&self) -> f64 {
        if self.stiffness_is_known {
            self.friction_nm / self.stiffness_nm_rad
        } else {
            5e-4
        }
    }
}

/// The largest size but for a few, which may be anything; of no values zero.
pub fn largest_of(values: impl Iterator<Item = f64>) -> f64 {
    let sizes = values.filter(|value| value.is_finite()).map(f64::abs);
    let mut sizes: Vec<f64> = sizes.collect();
    sizes.sort_by(f64::total_cmp);
    let nearly_all = (NEARLY_ALL * sizes.len().saturating_sub(1) as f64) as usize;
    sizes.get(nearly_all).copied().unwrap_or(0.0)
}

/// Two directions at right angles to each other and to an axis.
fn across(axis: Unit<Vector3<f64>>) -> [Vector3<f64>; 2] {
    let one = Vector3::ith(axis.iamin(), 1.0);
    let one = (one - *axis * axis.dot(&one)).normalize();
    [one, axis.cross(&one)]
}

fn motor_turns(gear_ratio: f64, stretches: &[&JointStretch]) -> f64 {
    let positions = || {
        stretches
            .iter()
            .flat_map(|stretch| &stretch.load.position_rad)
    };
    let high = positions().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = positions().copied().fold(f64::INFINITY, f64::min);
    (gear_ratio * (high - low) / std::f64::consts::TAU).max(1e-3)
}
