//! What is large and what is small for one joint of a rig: the scale on which effects are drawn.

use joint_model::friction::{Direction, Sliding};
use motion::{Reference, Trajectory};
use robot::{Effect, Robot};

use crate::rig::joint_limit_nm;

/// Speed at which friction counts as sliding slowly.
const SLOW_RAD_S: f64 = 0.1;
/// Samples of the trajectory at which gravity is looked at.
const POSES: usize = 200;

/// One joint's scale, joint side where nothing else is said.
#[derive(Clone, Debug)]
pub(crate) struct Sizes {
    pub gear_ratio: f64,
    pub limit_nm: f64,
    /// Of slow sliding.
    pub friction_nm: f64,
    /// What friction rises by per speed, as the file has it.
    pub viscous_nm_s_rad: f64,
    /// Breakaway above sliding, as the file has it.
    pub stribeck_nm: f64,
    pub load_coefficient: f64,
    pub stiffness_nm_rad: f64,
    pub damping_nm_s_rad: f64,
    /// Motor side.
    pub rotor_inertia_kg_m2: f64,
    /// Of everything beyond the joint.
    pub link_inertia_kg_m2: f64,
    /// The largest and the smallest along the trajectory.
    pub gravity_nm: [f64; 2],
    pub position_rad: [f64; 2],
    pub speed_rad_s: f64,
    pub has_link_encoder: bool,
    /// Relative standard deviation of what the file says.
    pub tolerance: f64,
    /// Whether friction is a table per direction.
    pub directional: bool,
}

impl Sizes {
    pub fn of(robot: &Robot, joint: usize, trajectory: &Trajectory, duration_s: f64) -> Self {
        let file = &robot.joints[joint];
        let level_nm = |speed_rad_s: f64| {
            file.steady_friction().level_nm(&Sliding {
                direction: Direction::Positive,
                ..Sliding::at(speed_rad_s)
            })
        };
        let sum = |of: fn(&Effect) -> f64| file.effects.iter().map(of).sum::<f64>();
        let table_viscous = file
            .direction_friction
            .map_or(0.0, |table| table.positive.fv_nm_s_rad);
        let mut sizes = Self {
            gear_ratio: file.gear_ratio,
            limit_nm: joint_limit_nm(file),
            friction_nm: level_nm(SLOW_RAD_S),
            viscous_nm_s_rad: table_viscous
                + sum(|effect| match effect {
                    Effect::ViscousFriction { viscous_nm_s_rad } => *viscous_nm_s_rad,
                    _ => 0.0,
                }),
            stribeck_nm: sum(|effect| match effect {
                Effect::StribeckFriction { stribeck_nm, .. } => *stribeck_nm,
                _ => 0.0,
            }),
            load_coefficient: sum(|effect| match effect {
                Effect::LoadDependentFriction { load_coefficient } => *load_coefficient,
                _ => 0.0,
            }),
            stiffness_nm_rad: sum(|effect| match effect {
                Effect::TorsionalCompliance { stiffness_nm_rad } => *stiffness_nm_rad,
                _ => 0.0,
            }),
            damping_nm_s_rad: sum(|effect| match effect {
                Effect::StructuralDamping {
                    damping_nm_s_rad, ..
                } => *damping_nm_s_rad,
                _ => 0.0,
            }),
            rotor_inertia_kg_m2: file.rotor_inertia_kg_m2,
            link_inertia_kg_m2: 0.0,
            gravity_nm: [0.0; 2],
            position_rad: [0.0; 2],
            speed_rad_s: 0.0,
            has_link_encoder: file.link_encoder_resolution_rad.is_some(),
            tolerance: robot.tolerance.default,
            directional: file.direction_friction.is_some(),
        };
        sizes.follow(robot, joint, trajectory, duration_s);
        sizes
    }

    fn follow(&mut self, robot: &Robot, joint: usize, trajectory: &Trajectory, duration_s: f64) {
        let count = robot.joints.len();
        let (rest, mut unit) = (vec![0.0; count], vec![0.0; count]);
        unit[joint] = 1.0;
        let mut out = vec![0.0; count];
        let mut reference = Reference::default();
        self.gravity_nm = [f64::INFINITY, f64::NEG_INFINITY];
        self.position_rad = self.gravity_nm;
        let widen = |range: &mut [f64; 2], value: f64| {
            *range = [range[0].min(value), range[1].max(value)];
        };
        for pose in 0..=POSES {
            trajectory.sample(duration_s * pose as f64 / POSES as f64, &mut reference);
            let position_rad = &reference.position_rad[..count];
            robot.chain.gravity_torque(position_rad, &mut out);
            let gravity_nm = out[joint];
            robot
                .chain
                .inverse_dynamics(position_rad, &rest, &unit, &mut out);
            self.link_inertia_kg_m2 = self.link_inertia_kg_m2.max(out[joint] - gravity_nm);
            widen(&mut self.gravity_nm, gravity_nm);
            widen(&mut self.position_rad, position_rad[joint]);
            self.speed_rad_s = self.speed_rad_s.max(reference.velocity_rad_s[joint].abs());
        }
    }

    /// As if the joint carried a weight of a tenth of what it can hold: what names that need one have in common with a law is asked of
    /// every joint, for the diagnosis may name them at any.
    pub fn if_it_were_loaded(mut self) -> Self {
        if !self.is_loaded() {
            let nm = 0.1 * self.limit_nm;
            self.gravity_nm = [-nm, nm];
        }
        self
    }

    /// The most gravity asks for.
    pub fn gravity_max_nm(&self) -> f64 {
        self.gravity_nm[1].max(-self.gravity_nm[0])
    }

    /// Whether the load changes along the way by as much as friction.
    pub fn is_loaded(&self) -> bool {
        self.gravity_nm[1] - self.gravity_nm[0] > 0.5 * self.friction_nm
    }
}
