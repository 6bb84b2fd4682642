//! What the plant has and the robot file does not say: `NAME.plant.toml`.
//!
//! Shipped for the shipped robots; for a robot file of one's own, the file beside it, or generic values.

use std::path::Path;

use joint_model::transmission::CatalogueCompliance;
use robot::{Effect, Robot, RobotJoint, Source};
use serde::Deserialize;

use crate::PlantError;

/// The plant files of the shipped robots.
const SHIPPED: [(&str, &str); 2] = [
    ("pa10", include_str!("../../robots/pa10.plant.toml")),
    ("shd17", include_str!("../../robots/shd17.plant.toml")),
];

/// Digits of the drive at a joint's torque limit where no plant file says how fine its digits are. Assumed; 32767 are
/// the most two bytes hold.
const DIGITS_AT_LIMIT: f64 = 30_000.0;

/// PA10-05, eq (1).
const PA10_DIGIT_NM: f64 = 0.001;

/// Torsion of a gear of unknown stiffness under the joint's friction. Assumed: a harmonic drive twists by 0.3 to 1 mrad
/// under it.
const UNKNOWN_TWIST_RAD: f64 = 3e-4;

/// Least stiffness assumed where none is known, for joints with next to no friction.
const UNKNOWN_STIFFNESS_MIN_NM_RAD: f64 = 5000.0;

/// A tenth of the arc minute that catalogues allow.
const GENERIC_KINEMATIC_ERROR_RAD: f64 = 2.9e-5;

/// A plant file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlantParameters {
    /// Relative standard deviation of masses, rotor inertias, stiffnesses and friction from the robot file's values.
    pub parameter_deviation: f64,
    /// The same of every coordinate of the links' centres of mass, and of their inertias beside their masses.
    #[serde(default)]
    pub link_deviation: f64,
    /// Torque of one digit of the drive's two-byte command and report, motor side (PA10-05, eq (1)).
    pub torque_digit_nm: f64,
    /// Rate of the drive's velocity loop (PA10-05: 1504 Hz).
    pub velocity_loop_rate_hz: f64,
    /// Bandwidth of that loop with the rotor alone.
    pub velocity_loop_bandwidth_hz: f64,
    /// Integral time of that loop.
    pub velocity_loop_integral_s: f64,
    /// First-order low-pass on the velocity inside the drive.
    pub velocity_sensing_hz: f64,
    /// Periods without a command after which a drive makes itself safe.
    pub watchdog_cycles: u32,
    /// Whether the drive reports the motor's velocity.
    pub reports_motor_velocity: bool,
    /// Standard deviation of the joint torque sensor's noise; absent where there is no such sensor.
    #[serde(default)]
    pub joint_torque_noise_nm: Option<f64>,
    /// Per joint, in the robot's order.
    #[serde(rename = "joint")]
    pub joints: Vec<JointPlantParameters>,
}

/// One joint of a plant file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointPlantParameters {
    /// The joint's name.
    pub name: String,
    /// `K1`, `K2`, `K3` of the gear's catalogue.
    pub stiffness_nm_rad: [f64; 3],
    /// `T1`, `T2` of the gear's catalogue.
    pub stiffness_knees_nm: [f64; 2],
    /// How far the friction bristles bend before they slide, joint side.
    pub bristle_deflection_rad: f64,
    /// Their damping over the critical one of the rotor on its bristles.
    pub bristle_damping_ratio: f64,
    /// Velocity beyond which that damping fades.
    pub bristle_damping_velocity_rad_s: f64,
    /// Load over which the knees of PA10-05 Table V are rounded.
    pub load_knee_rounding_nm: f64,
    /// Part of the unloaded friction level that no overrunning load takes away.
    pub least_friction: f64,
    /// Lag of the current loop.
    pub current_loop_time_constant_s: f64,
    /// Braking with short-circuited windings, joint side.
    pub safe_damping_nm_s_rad: f64,
    /// Effects the real gear has and the robot file does not name. One that the robot file names is not added again.
    #[serde(default)]
    pub effects: Vec<Effect>,
}

impl PlantParameters {
    /// The plant of a robot: for a robot file the file `NAME.plant.toml` beside it; for a shipped robot, or a file
    /// that carries a shipped robot's name, the shipped one; otherwise [`PlantParameters::generic`].
    ///
    /// # Errors
    /// [`PlantError::File`], [`PlantError::Text`], [`PlantError::Parameter`] or [`PlantError::Joints`].
    pub fn for_robot(robot: &Robot) -> Result<Self, PlantError> {
        if let Source::File(path) = &robot.source {
            let beside = path.with_extension("plant.toml");
            if beside.is_file() {
                return Self::load(&beside, robot);
            }
        }
        match SHIPPED.iter().find(|(name, _)| *name == robot.name) {
            Some((name, text)) => Self::parse(text, &format!("{name}.plant.toml"), robot),
            None => Ok(Self::generic(robot)),
        }
    }

    /// Reads a plant file.
    ///
    /// # Errors
    /// [`PlantError::File`], [`PlantError::Text`], [`PlantError::Parameter`] or [`PlantError::Joints`].
    pub fn load(path: &Path, robot: &Robot) -> Result<Self, PlantError> {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|error| PlantError::File {
            file: file.clone(),
            reason: error.to_string(),
        })?;
        Self::parse(&text, &file, robot)
    }

    /// The same from text; `file` is what errors call it.
    ///
    /// # Errors
    /// [`PlantError::File`], [`PlantError::Text`], [`PlantError::Parameter`] or [`PlantError::Joints`].
    pub fn parse(text: &str, file: &str, robot: &Robot) -> Result<Self, PlantError> {
        let parameters: Self = robot::parse_toml(text, file)?;
        parameters.check(robot)?;
        Ok(parameters)
    }

    /// A plant that has the robot file's physics and nothing else: exact parameters, one stiffness, nothing hidden.
    /// What remains different is the form: bristles, rounded knees, rotor and link apart, drive and sensors.
    pub fn nominal(robot: &Robot) -> Self {
        let largest_nm = robot
            .joints
            .iter()
            .filter_map(|joint| joint.torque_limit_nm)
            .fold(0.0, f64::max);
        Self {
            parameter_deviation: 0.0,
            link_deviation: 0.0,
            torque_digit_nm: if largest_nm > 0.0 {
                largest_nm / DIGITS_AT_LIMIT
            } else {
                PA10_DIGIT_NM
            },
            velocity_loop_rate_hz: 1504.0,
            velocity_loop_bandwidth_hz: 150.0,
            velocity_loop_integral_s: 0.02,
            velocity_sensing_hz: 1000.0,
            watchdog_cycles: 15,
            reports_motor_velocity: false,
            joint_torque_noise_nm: None,
            joints: robot.joints.iter().map(nominal_joint).collect(),
        }
    }

    /// For a robot without a plant file: the nominal plant with parameters off by 2 % and, at each joint, torsional
    /// hysteresis, structural damping and kinematic error scaled from its friction and stiffness. All assumed.
    pub fn generic(robot: &Robot) -> Self {
        let mut parameters = Self {
            parameter_deviation: 0.02,
            ..Self::nominal(robot)
        };
        for (joint, file) in parameters.joints.iter_mut().zip(&robot.joints) {
            let (stiffness_nm_rad, friction_nm) =
                (joint.stiffness_nm_rad[0], file_friction_nm(file));
            joint.effects = vec![
                // a twentieth of the joint's friction is lost in the flexspline, over the twist that friction causes
                Effect::TorsionalHysteresis {
                    width_nm: 0.05 * friction_nm,
                    yield_rad: (friction_nm / stiffness_nm_rad).max(1e-6),
                },
                // a tenth of a millisecond of the stiffness: a few per cent of critical at 50 to 100 Hz
                Effect::StructuralDamping {
                    damping_nm_s_rad: 1e-4 * stiffness_nm_rad,
                    exponent: 1.0,
                },
                Effect::kinematic_error(GENERIC_KINEMATIC_ERROR_RAD, 2.0, 0.0),
            ];
        }
        parameters
    }

    /// Checks that joints and values fit the robot.
    pub(crate) fn check(&self, robot: &Robot) -> Result<(), PlantError> {
        let expected: Vec<String> = robot
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .collect();
        let found: Vec<String> = self.joints.iter().map(|joint| joint.name.clone()).collect();
        if found != expected {
            return Err(PlantError::Joints { found, expected });
        }
        not_negative("plant", "parameter_deviation", self.parameter_deviation)?;
        not_negative("plant", "link_deviation", self.link_deviation)?;
        not_negative(
            "plant",
            "joint_torque_noise_nm",
            self.joint_torque_noise_nm.unwrap_or(0.0),
        )?;
        positive("plant", "torque_digit_nm", self.torque_digit_nm)?;
        positive("plant", "velocity_loop_rate_hz", self.velocity_loop_rate_hz)?;
        positive(
            "plant",
            "velocity_loop_bandwidth_hz",
            self.velocity_loop_bandwidth_hz,
        )?;
        positive(
            "plant",
            "velocity_loop_integral_s",
            self.velocity_loop_integral_s,
        )?;
        positive("plant", "velocity_sensing_hz", self.velocity_sensing_hz)?;
        self.joints.iter().try_for_each(JointPlantParameters::check)
    }
}

impl JointPlantParameters {
    pub(crate) fn curve(&self) -> CatalogueCompliance {
        CatalogueCompliance {
            stiffness_nm_rad: self.stiffness_nm_rad,
            knees_nm: self.stiffness_knees_nm,
        }
    }

    fn check(&self) -> Result<(), PlantError> {
        for stiffness in self.stiffness_nm_rad {
            positive(&self.name, "stiffness_nm_rad", stiffness)?;
        }
        let [knee_1_nm, knee_2_nm] = self.stiffness_knees_nm;
        not_negative(&self.name, "first of stiffness_knees_nm", knee_1_nm)?;
        not_negative(
            &self.name,
            "second minus first of stiffness_knees_nm",
            knee_2_nm - knee_1_nm,
        )?;
        positive(
            &self.name,
            "bristle_deflection_rad",
            self.bristle_deflection_rad,
        )?;
        not_negative(
            &self.name,
            "bristle_damping_ratio",
            self.bristle_damping_ratio,
        )?;
        positive(
            &self.name,
            "bristle_damping_velocity_rad_s",
            self.bristle_damping_velocity_rad_s,
        )?;
        not_negative(
            &self.name,
            "load_knee_rounding_nm",
            self.load_knee_rounding_nm,
        )?;
        not_negative(&self.name, "least_friction", self.least_friction)?;
        not_negative(
            &self.name,
            "current_loop_time_constant_s",
            self.current_loop_time_constant_s,
        )?;
        not_negative(
            &self.name,
            "safe_damping_nm_s_rad",
            self.safe_damping_nm_s_rad,
        )
    }
}

/// Stiffness of a joint's gear in the robot file: the first entry. Later ones are changes of it.
pub(crate) fn file_stiffness_nm_rad(joint: &RobotJoint) -> Option<f64> {
    joint.effects.iter().find_map(|effect| match effect {
        Effect::TorsionalCompliance { stiffness_nm_rad } => Some(*stiffness_nm_rad),
        _ => None,
    })
}

/// Friction of a slow, unloaded joint by its robot file.
fn file_friction_nm(joint: &RobotJoint) -> f64 {
    let table_nm = joint
        .direction_friction
        .map_or(0.0, |table| table.positive.f0_nm.max(table.negative.f0_nm));
    let effects_nm: f64 = joint
        .effects
        .iter()
        .map(|effect| match effect {
            Effect::CoulombFriction { coulomb_nm } => *coulomb_nm,
            _ => 0.0,
        })
        .sum();
    table_nm + effects_nm
}

fn nominal_joint(joint: &RobotJoint) -> JointPlantParameters {
    let stiff_nm_rad =
        (file_friction_nm(joint) / UNKNOWN_TWIST_RAD).max(UNKNOWN_STIFFNESS_MIN_NM_RAD);
    let stiffness_nm_rad = file_stiffness_nm_rad(joint).unwrap_or(stiff_nm_rad);
    let reflected_inertia_kg_m2 = joint.rotor_inertia_kg_m2 * joint.gear_ratio * joint.gear_ratio;
    JointPlantParameters {
        name: joint.name.clone(),
        stiffness_nm_rad: [stiffness_nm_rad; 3],
        stiffness_knees_nm: [1.0, 2.0],
        bristle_deflection_rad: 3e-4,
        bristle_damping_ratio: 0.5,
        bristle_damping_velocity_rad_s: 0.01,
        load_knee_rounding_nm: 1.0,
        least_friction: 0.05,
        current_loop_time_constant_s: 2e-4,
        // stops the rotor alone within 20 ms
        safe_damping_nm_s_rad: reflected_inertia_kg_m2 / 0.02,
        effects: Vec::new(),
    }
}

fn positive(joint: &str, name: &'static str, value: f64) -> Result<(), PlantError> {
    check(joint, name, value, value > 0.0, "above zero")
}

fn not_negative(joint: &str, name: &'static str, value: f64) -> Result<(), PlantError> {
    check(joint, name, value, value >= 0.0, "zero or above")
}

fn check(
    joint: &str,
    name: &'static str,
    value: f64,
    holds: bool,
    must: &'static str,
) -> Result<(), PlantError> {
    if holds && value.is_finite() {
        return Ok(());
    }
    Err(PlantError::Parameter {
        joint: joint.to_owned(),
        name,
        value,
        must,
    })
}
