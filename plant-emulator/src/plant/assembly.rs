//! Building a plant: individual parameters, effects sorted to their joints, static equilibrium.

use core::f64::consts::{PI, TAU};

use joint_model::JOINTS_MAX;
use joint_model::rigid_body::{Chain, Link};
use robot::{Injection, Robot, RobotJoint};

use super::substeps::substeps;
use super::{Joint, Plant, mobility_rad_s2_nm};
use crate::deviation::{Individual, individual};
use crate::inject::{Conditions, TimedEffect, Transmission, chains};
use crate::mechanics::{BristleShape, JointConstants, JointState};
use crate::noise::{Noise, Purpose};
use crate::parameters::{JointPlantParameters, file_stiffness_nm_rad};
use crate::sensors::{HISTORY, Observed, SensorConstants, Sensors};
use crate::servo::{Servo, ServoConstants};
use crate::{PlantError, PlantParameters, PlantSample};

/// Resolution of the PA-10's resolver at the joint (PA10-05, section II), for robot files that give none.
const RESOLVER_RAD: f64 = 0.000439 * PI / 180.0;

pub(super) fn assemble(
    robot: &Robot,
    parameters: &PlantParameters,
    injections: &[Injection],
    seed: u64,
    initial_position_rad: &[f64],
    period_s: f64,
) -> Result<Plant, PlantError> {
    robot.check_fits_loop()?;
    parameters.check(robot)?;
    check_period(period_s)?;
    let link_position_rad = start_position(robot, initial_position_rad)?;
    let individuals = individual(robot, parameters, seed);
    let arm_effects = arm_effects(robot, injections)?;
    let chains = chains_of(robot, &individuals, &arm_effects)?;
    let mut load_nm = [0.0; JOINTS_MAX];
    chains[0].1.gravity_torque(&link_position_rad, &mut load_nm);
    let mut joints = Vec::with_capacity(individuals.len());
    for (index, own) in individuals.into_iter().enumerate() {
        let effects = joint_effects(index, &own, &arm_effects);
        let builder = JointBuilder {
            index,
            file: &robot.joints[index],
            hidden: &parameters.joints[index],
            parameters,
            seed,
            link_position_rad: link_position_rad[index],
            gravity_nm: load_nm[index],
            mobility_rad_s2_nm: mobility_rad_s2_nm(&chains[0].1, &link_position_rad, index),
        };
        joints.push(builder.build(own, &effects, period_s)?);
    }
    let substeps = substeps(&joints, &chains, &link_position_rad, seed, period_s)?;
    let sample = PlantSample::empty(joints.len());
    let mut plant = Plant {
        joints,
        pushes: Vec::new(),
        external_nm: [0.0; JOINTS_MAX],
        chains,
        chain: 0,
        link_position_rad,
        link_velocity_rad_s: [0.0; JOINTS_MAX],
        cycle: 0,
        period_s,
        substeps,
        sample,
        disturbances: Vec::new(),
    };
    plant.latch();
    Ok(plant)
}

fn check_period(period_s: f64) -> Result<(), PlantError> {
    if (1e-4..=0.02).contains(&period_s) {
        Ok(())
    } else {
        Err(PlantError::Period { period_s })
    }
}

fn start_position(robot: &Robot, position_rad: &[f64]) -> Result<[f64; JOINTS_MAX], PlantError> {
    let expected = robot.joints.len();
    if position_rad.len() != expected || position_rad.iter().any(|angle| !angle.is_finite()) {
        return Err(PlantError::StartPosition {
            expected,
            found: position_rad.to_vec(),
        });
    }
    let mut padded = [0.0; JOINTS_MAX];
    padded[..expected].copy_from_slice(position_rad);
    Ok(padded)
}

/// The effects that come with a joint's name or for all: those of the whole arm in the robot file, then the injected.
fn arm_effects(
    robot: &Robot,
    injections: &[Injection],
) -> Result<Vec<(Option<usize>, TimedEffect)>, PlantError> {
    let mut all: Vec<_> = robot
        .shared_effects
        .iter()
        .map(|effect| (None, TimedEffect::always(*effect)))
        .collect();
    for injection in injections {
        let needs_joint = !injection.effect.may_be_shared();
        let fits = injection
            .joint
            .map_or(!needs_joint, |joint| joint < robot.joints.len());
        if !fits {
            return Err(PlantError::InjectedJoint {
                effect: injection.effect.name(),
                joint: injection.joint,
                last: robot.joints.len() - 1,
            });
        }
        let timed = TimedEffect {
            start_s: injection.start_s,
            ..TimedEffect::always(injection.effect)
        };
        all.push((injection.joint, timed));
    }
    Ok(all)
}

/// What one joint has: its own effects and those of the arm that name it or no joint.
fn joint_effects(
    index: usize,
    own: &Individual,
    arm_effects: &[(Option<usize>, TimedEffect)],
) -> Vec<TimedEffect> {
    let named = arm_effects
        .iter()
        .filter(|(joint, _)| joint.is_none_or(|joint| joint == index));
    own.effects
        .iter()
        .copied()
        .chain(named.map(|(_, timed)| *timed))
        .collect()
}

fn chains_of(
    robot: &Robot,
    individuals: &[Individual],
    arm_effects: &[(Option<usize>, TimedEffect)],
) -> Result<Vec<(f64, Chain)>, PlantError> {
    let links: Vec<Link> = individuals.iter().map(|own| own.link).collect();
    // link inertia may also stand in a joint's own list
    let own = individuals
        .iter()
        .enumerate()
        .flat_map(|(index, own)| own.effects.iter().map(move |timed| (Some(index), *timed)));
    let effects: Vec<_> = own.chain(arm_effects.iter().copied()).collect();
    chains(&links, robot.chain.gravity_m_s2(), &effects).map_err(PlantError::Chain)
}

/// What it takes to build one joint.
struct JointBuilder<'a> {
    index: usize,
    file: &'a RobotJoint,
    hidden: &'a JointPlantParameters,
    parameters: &'a PlantParameters,
    seed: u64,
    link_position_rad: f64,
    gravity_nm: f64,
    mobility_rad_s2_nm: f64,
}

impl JointBuilder<'_> {
    fn build(
        &self,
        own: Individual,
        effects: &[TimedEffect],
        period_s: f64,
    ) -> Result<Joint, PlantError> {
        let gear = Transmission::new(own.curve, file_stiffness_nm_rad(self.file));
        let empty = Conditions::new(own.friction, gear);
        let (constant, timed): (Vec<TimedEffect>, Vec<TimedEffect>) =
            effects.iter().partition(|timed| timed.is_constant());
        let fixed = self.with_effects(&empty, &constant, 0.0)?;
        let now = self.with_effects(&fixed, &timed, 0.0)?;
        let last_start_s = timed.iter().map(|timed| timed.start_s).fold(0.0, f64::max);
        let full = self.with_effects(&fixed, &timed, last_start_s + 1.0)?;
        self.check(&full, own.rotor_inertia_kg_m2, period_s)?;

        let constants = self.constants(own.rotor_inertia_kg_m2, &fixed, &full);
        let load_nm = self.gravity_nm + now.holding_nm(self.link_position_rad, self.gravity_nm);
        let state = JointState::at_rest(&constants, &now, self.link_position_rad, load_nm);
        let motor_position_rad = state.rotor_rad * constants.gear_ratio;
        let shaft_nm = state.holding_nm(&constants, &now) / constants.gear_ratio;
        let reported_nm =
            now.actuator
                .reported_nm(shaft_nm, motor_position_rad, constants.gear_ratio);
        let observed = Observed {
            motor_position_rad,
            motor_velocity_rad_s: 0.0,
            motor_torque_nm: reported_nm,
            link_position_rad: self.link_position_rad,
            joint_torque_nm: load_nm,
        };
        Ok(Joint {
            servo: Servo::holding(self.servo(&constants, &now), reported_nm),
            sensors: Sensors::new(
                self.sensors(),
                observed,
                self.noise(Purpose::Sensors),
                self.noise(Purpose::DroppedSamples),
            ),
            constants,
            fixed,
            timed,
            now,
            state,
            commands: vec![None; HISTORY],
            command_drops: self.noise(Purpose::DroppedCommands),
            mobility_rad_s2_nm: self.mobility_rad_s2_nm,
        })
    }

    fn noise(&self, purpose: Purpose) -> Noise {
        Noise::new(self.seed, purpose, self.index)
    }

    fn with_effects(
        &self,
        base: &Conditions,
        effects: &[TimedEffect],
        time_s: f64,
    ) -> Result<Conditions, PlantError> {
        let mut conditions = base.clone();
        for timed in effects {
            conditions
                .add(timed, time_s)
                .map_err(|full| PlantError::TooManyEffects {
                    joint: self.index,
                    effect: timed.effect.name(),
                    at_most: full.at_most,
                })?;
        }
        Ok(conditions)
    }

    fn check(
        &self,
        full: &Conditions,
        rotor_inertia_kg_m2: f64,
        period_s: f64,
    ) -> Result<(), PlantError> {
        let must_be_positive = [
            ("stiffness_nm_rad", full.transmission.stiffness_min_nm_rad()),
            (
                "rotor_inertia_kg_m2",
                rotor_inertia_kg_m2 + full.load.rotor_inertia_kg_m2,
            ),
            ("gear_ratio", self.file.gear_ratio),
        ];
        for (name, value) in must_be_positive {
            if value.is_nan() || value <= 0.0 {
                return Err(PlantError::NotPositive {
                    joint: self.index,
                    name,
                    value,
                });
            }
        }
        let at_most_s = (HISTORY - 2) as f64 * period_s;
        let timing = &full.timing;
        let of_encoders_s = timing
            .encoder_delays_s
            .map(|more_s| timing.sensor_delay_s + more_s);
        let [motor_s, link_s] = of_encoders_s;
        for delay_s in [
            timing.command_delay_s,
            timing.sensor_delay_s,
            motor_s,
            link_s,
        ] {
            if !(0.0..=at_most_s).contains(&delay_s) {
                return Err(PlantError::Delay {
                    joint: self.index,
                    delay_s,
                    at_most_s,
                });
            }
        }
        Ok(())
    }

    /// Bristles are made for the friction that is always there, unless what comes later dwarfs it.
    fn constants(
        &self,
        rotor_inertia_kg_m2: f64,
        fixed: &Conditions,
        full: &Conditions,
    ) -> JointConstants {
        let shape = BristleShape {
            deflection_rad: self.hidden.bristle_deflection_rad,
            damping_ratio: self.hidden.bristle_damping_ratio,
            damping_velocity_rad_s: self.hidden.bristle_damping_velocity_rad_s,
        };
        let made_for = |conditions| {
            JointConstants::new(self.file.gear_ratio, rotor_inertia_kg_m2, conditions, shape)
        };
        let (always, at_last) = (made_for(fixed), made_for(full));
        let is_dwarfed =
            always.bristles.stiffness_nm_rad < 0.01 * at_last.bristles.stiffness_nm_rad;
        if is_dwarfed { at_last } else { always }
    }

    fn servo(&self, constants: &JointConstants, now: &Conditions) -> ServoConstants {
        let parameters = self.parameters;
        let digits_max_nm = f64::from(i16::MAX) * parameters.torque_digit_nm;
        let rotor_gain =
            TAU * parameters.velocity_loop_bandwidth_hz * constants.reflected_inertia_kg_m2(now);
        ServoConstants {
            torque_digit_nm: parameters.torque_digit_nm,
            torque_limit_nm: self
                .file
                .torque_limit_nm
                .unwrap_or(digits_max_nm)
                .min(digits_max_nm),
            current_loop_time_constant_s: self.hidden.current_loop_time_constant_s,
            safe_damping_nm_s_rad: self.hidden.safe_damping_nm_s_rad,
            watchdog_cycles: parameters.watchdog_cycles,
            velocity_period_s: 1.0 / parameters.velocity_loop_rate_hz,
            velocity_gain_nm_s_rad: rotor_gain / constants.gear_ratio,
            velocity_integral_s: parameters.velocity_loop_integral_s,
            velocity_sensing_hz: parameters.velocity_sensing_hz,
        }
    }

    fn sensors(&self) -> SensorConstants {
        let file = self.file;
        SensorConstants {
            gear_ratio: file.gear_ratio,
            motor_resolution_rad: file
                .motor_encoder_resolution_rad
                .unwrap_or(RESOLVER_RAD * file.gear_ratio),
            link_resolution_rad: file.link_encoder_resolution_rad,
            position_noise_rad: file.position_noise_rad,
            torque_noise_nm: file.torque_noise_nm,
            torque_digit_nm: self.parameters.torque_digit_nm,
            reports_motor_velocity: self.parameters.reports_motor_velocity,
            joint_torque_noise_nm: self.parameters.joint_torque_noise_nm,
        }
    }
}
