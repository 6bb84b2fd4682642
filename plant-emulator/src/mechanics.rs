//! One joint between motor and link: rotor, friction, gear, in one substep.

use joint_model::friction::{Direction, LuGre, Sliding};
use joint_model::transmission::{TorsionalHysteresis, kinematic_error};

use crate::inject::{Conditions, ELEMENTS_MAX};

/// Level below which bristles get no softer, so that a joint without friction keeps finite numbers.
const LEVEL_MIN_NM: f64 = 1e-6;

/// Speed at which the slope of drag at rest is taken.
const SLOW_RAD_S: f64 = 1e-9;

/// What does not change during a run.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointConstants {
    pub gear_ratio: f64,
    /// Motor side, without what effects add.
    pub rotor_inertia_kg_m2: f64,
    pub bristles: LuGre,
}

/// How the bristles of a joint are made; see the plant file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BristleShape {
    pub deflection_rad: f64,
    pub damping_ratio: f64,
    pub damping_velocity_rad_s: f64,
}

impl JointConstants {
    /// Bristles that bend as far as the shape says under the friction of the unloaded joint at rest.
    pub fn new(
        gear_ratio: f64,
        rotor_inertia_kg_m2: f64,
        conditions: &Conditions,
        shape: BristleShape,
    ) -> Self {
        let level_nm = [Direction::Positive, Direction::Negative]
            .map(|direction| {
                conditions.friction.level_nm(&Sliding {
                    direction,
                    ..Sliding::at(0.0)
                })
            })
            .into_iter()
            .fold(LEVEL_MIN_NM, f64::max);
        let stiffness_nm_rad = level_nm / shape.deflection_rad;
        let reflected_kg_m2 = rotor_inertia_kg_m2 * gear_ratio * gear_ratio;
        let bristles = LuGre {
            stiffness_nm_rad,
            damping_nm_s_rad: 2.0
                * shape.damping_ratio
                * (stiffness_nm_rad * reflected_kg_m2).sqrt(),
            damping_velocity_rad_s: shape.damping_velocity_rad_s,
        };
        Self {
            gear_ratio,
            rotor_inertia_kg_m2,
            bristles,
        }
    }

    /// Rotor inertia at the joint side, with what effects add.
    pub fn reflected_inertia_kg_m2(&self, conditions: &Conditions) -> f64 {
        (self.rotor_inertia_kg_m2 + conditions.load.rotor_inertia_kg_m2)
            * self.gear_ratio
            * self.gear_ratio
    }
}

/// The link's motion and what it yields to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinkMotion {
    pub position_rad: f64,
    pub velocity_rad_s: f64,
    /// Joint acceleration per joint torque, all other torques held.
    pub mobility_rad_s2_nm: f64,
}

/// What the drive does to the shaft during a substep.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shaft {
    /// Turns under a torque (motor side) against a brake (joint side).
    Free {
        motor_torque_nm: f64,
        brake_nm_s_rad: f64,
    },
    /// Held where it is.
    Held,
}

/// One joint's state between motor and link.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct JointState {
    /// Motor angle over the gear ratio.
    pub rotor_rad: f64,
    /// Motor velocity over the gear ratio.
    pub rotor_rad_s: f64,
    /// Torque the gear transmits to the link.
    pub joint_torque_nm: f64,
    /// Torque spent against friction.
    pub friction_nm: f64,
    torsion_rad: f64,
    bristle_rad: f64,
    hysteresis_nm: [f64; ELEMENTS_MAX],
}

impl JointState {
    /// At rest with the gear wound up to `joint_torque_nm`.
    pub fn at_rest(
        constants: &JointConstants,
        conditions: &Conditions,
        link_position_rad: f64,
        joint_torque_nm: f64,
    ) -> Self {
        // the kinematic error depends on the motor angle it shifts; it is small, so this converges in a few rounds
        const ROUNDS: usize = 50;
        let torsion_rad = conditions.transmission.torsion_rad(joint_torque_nm);
        let harmonics = &conditions.transmission.kinematic_error;
        let mut rotor_rad = link_position_rad + torsion_rad;
        for _ in 0..ROUNDS {
            let (error_rad, _) = kinematic_error(harmonics, rotor_rad * constants.gear_ratio);
            rotor_rad = link_position_rad + torsion_rad - error_rad;
        }
        Self {
            rotor_rad,
            joint_torque_nm,
            torsion_rad,
            ..Self::default()
        }
    }

    /// Joint-side motor torque that keeps this state at rest.
    pub fn holding_nm(&self, constants: &JointConstants, conditions: &Conditions) -> f64 {
        self.joint_torque_nm * self.lever(constants, conditions).1
    }

    /// Kinematic error, and motion of the gear's input per motion of the rotor.
    fn lever(&self, constants: &JointConstants, conditions: &Conditions) -> (f64, f64) {
        let motor_rad = self.rotor_rad * constants.gear_ratio;
        let harmonics = &conditions.transmission.kinematic_error;
        let (error_rad, slope) = kinematic_error(harmonics, motor_rad);
        (error_rad, 1.0 + slope * constants.gear_ratio)
    }

    /// One substep: gear torque from the motion at its beginning, then the rotor to its end.
    pub fn advance(
        &mut self,
        constants: &JointConstants,
        conditions: &Conditions,
        link: &LinkMotion,
        shaft: Shaft,
        step_s: f64,
    ) {
        let (error_rad, lever) = self.lever(constants, conditions);
        let inertia_kg_m2 = constants.reflected_inertia_kg_m2(conditions);
        let relative_mobility = lever * lever / inertia_kg_m2 + link.mobility_rad_s2_nm;
        self.twist(
            conditions,
            error_rad,
            lever,
            link,
            relative_mobility,
            step_s,
        );
        match shaft {
            Shaft::Held => {
                self.rotor_rad_s = 0.0;
                self.friction_nm = 0.0;
            }
            Shaft::Free {
                motor_torque_nm,
                brake_nm_s_rad,
            } => {
                let drive_nm =
                    motor_torque_nm * constants.gear_ratio - lever * self.joint_torque_nm;
                self.turn(
                    constants,
                    conditions,
                    drive_nm,
                    brake_nm_s_rad,
                    step_s / inertia_kg_m2,
                    step_s,
                );
                self.rotor_rad += step_s * self.rotor_rad_s;
            }
        }
    }

    /// Gear torque from torsion and torsion rate.
    fn twist(
        &mut self,
        conditions: &Conditions,
        error_rad: f64,
        lever: f64,
        link: &LinkMotion,
        relative_mobility: f64,
        step_s: f64,
    ) {
        let gear = &conditions.transmission;
        let torsion_rad = self.rotor_rad + error_rad - link.position_rad;
        let rate_rad_s = lever * self.rotor_rad_s - link.velocity_rad_s;
        let twist_rad = torsion_rad - self.torsion_rad;
        self.torsion_rad = torsion_rad;
        for (torque_nm, element) in self.hysteresis_nm.iter_mut().zip(&gear.hysteresis) {
            *torque_nm = element.advance_nm(*torque_nm, twist_rad);
        }
        // damping at the rate this very damping leaves over: linearly implicit, so it cannot reverse the rate
        let damping = gear.damping_nm_s_rad(rate_rad_s);
        let damping_nm = damping * rate_rad_s / (1.0 + step_s * damping * relative_mobility);
        self.joint_torque_nm =
            gear.elastic_nm(torsion_rad) + self.hysteresis_nm.iter().sum::<f64>() + damping_nm;
    }

    /// Rotor velocity at the end of the substep, together with bristles, drag and brake.
    fn turn(
        &mut self,
        constants: &JointConstants,
        conditions: &Conditions,
        drive_nm: f64,
        brake_nm_s_rad: f64,
        velocity_per_torque: f64,
        step_s: f64,
    ) {
        let velocity_rad_s = self.rotor_rad_s;
        let at = Sliding {
            load_nm: self.joint_torque_nm,
            motor_position_rad: self.rotor_rad * constants.gear_ratio,
            ..Sliding::at(velocity_rad_s)
        };
        let level_nm = conditions.friction.level_nm(&at);
        let bristles =
            constants
                .bristles
                .begin_step(self.bristle_rad, velocity_rad_s, level_nm, step_s);
        let moving_rad_s = if velocity_rad_s.abs() > SLOW_RAD_S {
            velocity_rad_s
        } else {
            SLOW_RAD_S
        };
        let drag_nm_s_rad = conditions.friction.fluid_drag_nm(moving_rad_s) / moving_rad_s;
        let resistance_nm_s_rad = bristles.drag_slope_nm_s_rad + drag_nm_s_rad + brake_nm_s_rad;
        let after_rad_s = (velocity_rad_s
            + velocity_per_torque * (drive_nm - bristles.drag_at_rest_nm))
            / (1.0 + velocity_per_torque * resistance_nm_s_rad);
        self.bristle_rad = bristles.end_rad(after_rad_s);
        self.friction_nm = bristles.drag_nm(after_rad_s) + drag_nm_s_rad * after_rad_s;
        self.rotor_rad_s = after_rad_s;
    }

    /// Kinetic energy of the rotor and energy stored in spring, hysteresis and bristles.
    pub fn energy_j(
        &self,
        constants: &JointConstants,
        conditions: &Conditions,
        link_position_rad: f64,
    ) -> f64 {
        let (error_rad, _) = self.lever(constants, conditions);
        let torsion_rad = self.rotor_rad + error_rad - link_position_rad;
        let stored_j: f64 = self
            .hysteresis_nm
            .iter()
            .zip(&conditions.transmission.hysteresis)
            .map(|(torque_nm, element)| hysteresis_j(*torque_nm, element))
            .sum();
        0.5 * constants.reflected_inertia_kg_m2(conditions) * self.rotor_rad_s * self.rotor_rad_s
            + 0.5 * constants.bristles.stiffness_nm_rad * self.bristle_rad * self.bristle_rad
            + conditions.transmission.elastic_j(torsion_rad)
            + stored_j
    }
}

/// What a Dahl element gives back at most.
fn hysteresis_j(torque_nm: f64, element: &TorsionalHysteresis) -> f64 {
    if element.width_nm == 0.0 {
        return 0.0;
    }
    torque_nm * torque_nm * element.yield_rad / element.width_nm
}
