//! Robot files as they are written: the keys of the TOML text, not yet checked or built.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::error::RobotError;
use crate::parse::parse;
use crate::{
    Control, DirectionalFriction, Effect, EstimatorParameters, FrictionTable, LoadTorqueTable,
    Tolerance, TorqueTable,
};

/// A robot file, key by key. [`RobotFile::build`](crate::RobotFile::build) checks it and makes the robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotFile {
    /// What the robot is called.
    pub name: String,
    /// Acceleration of free fall in the base frame.
    #[serde(default = "down")]
    pub gravity_m_s2: [f64; 3],
    /// How well the values of the file are known.
    #[serde(default)]
    pub parameter_tolerance: Tolerance,
    /// URDF with the rigid bodies, relative to the robot file; or `mjcf`, or `[[link]]` tables instead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub urdf: Option<String>,
    /// MuJoCo model with the rigid bodies, relative to the robot file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mjcf: Option<String>,
    /// Where joints stand that are none of the robot's, rad or m; at zero where this does not say.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub held: BTreeMap<String, f64>,
    /// Origin of the end-effector frame in the last link's frame.
    #[serde(default)]
    pub tool_origin_m: [f64; 3],
    /// Orientation of the end-effector frame in the last link's frame: fixed-axis roll, pitch, yaw.
    #[serde(default)]
    pub tool_origin_rpy_rad: [f64; 3],
    /// Effects of the whole arm that the nominal model knows, such as a payload.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shared_effects: Vec<Effect>,
    /// What ran on the robot while it was recorded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control: Option<Control>,
    /// What the driver of the hardware needs to know: bus, interface. Its keys are the driver's, which checks them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<toml::Table>,
    /// The links, each after the one it hangs on, where there is no URDF and no MuJoCo model.
    #[serde(default, rename = "link", skip_serializing_if = "Vec::is_empty")]
    pub links: Vec<LinkFile>,
    /// The drives, matched to the chain by joint name. Joints of a URDF that have no table are held, but where there is no
    /// table at all every joint that moves by itself is one of the robot.
    #[serde(default, rename = "joint")]
    pub joints: Vec<RobotJoint>,
}

impl RobotFile {
    /// Reads the text of a robot file; `file` is what errors call it.
    ///
    /// # Errors
    /// [`RobotError`] with file, line and key. Values are checked when the robot is built.
    pub fn parse(text: &str, file: &str) -> Result<Self, RobotError> {
        parse(text, file)
    }

    /// The text of a file that says the same.
    ///
    /// # Errors
    /// [`toml::ser::Error`] for a value that TOML does not have.
    pub fn to_toml(&self) -> Result<String, toml::ser::Error> {
        toml::to_string(self)
    }
}

pub(crate) fn down() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

fn direct_drive() -> f64 {
    1.0
}

/// How a link's joint moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LinkKind {
    /// It turns about the axis.
    #[default]
    Revolute,
    /// It slides along the axis: read rad as m and Nm as N wherever the joint is meant.
    Prismatic,
}

/// One `[[link]]`: a moving link and the joint that carries it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinkFile {
    /// Name of the `[[joint]]` that carries the link.
    pub joint: String,
    /// Joint of the link that this one hangs on, one of those before it, or `base`; the link before it where this is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
    /// How the joint moves.
    #[serde(default)]
    pub kind: LinkKind,
    /// Joint frame in the parent's.
    #[serde(default)]
    pub origin_m: [f64; 3],
    /// Orientation of the joint frame in the parent's: fixed-axis roll, pitch, yaw.
    #[serde(default)]
    pub origin_rpy_rad: [f64; 3],
    /// Joint axis in the joint frame; of any length but zero.
    pub axis: [f64; 3],
    /// Mass of the link.
    pub mass_kg: f64,
    /// Centre of mass in the joint frame.
    pub centre_of_mass_m: [f64; 3],
    /// Inertia about the centre of mass, in axes parallel to the joint frame.
    pub inertia_kg_m2: InertiaFile,
}

/// A symmetric inertia tensor, element by element.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the names are the elements")]
pub struct InertiaFile {
    pub xx: f64,
    pub yy: f64,
    pub zz: f64,
    #[serde(default)]
    pub xy: f64,
    #[serde(default)]
    pub yz: f64,
    #[serde(default)]
    pub xz: f64,
}

/// A brake that holds the shaft while the drive does not.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HoldingBrake {
    /// From being told to the shaft being free.
    pub release_s: f64,
    /// From being told to the shaft being held.
    pub engage_s: f64,
}

/// One joint's drive and sensors. Everything it holds adds up: effects and tables.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotJoint {
    /// The joint's name, which recordings use too.
    pub name: String,
    /// Motor turns per joint turn; 1 where the file is silent, a motor on the joint's axis.
    #[serde(default = "direct_drive")]
    pub gear_ratio: f64,
    /// Motor side, wave generator included; 0 where the file is silent.
    #[serde(default)]
    pub rotor_inertia_kg_m2: f64,
    /// Largest torque the drive gives, motor side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque_limit_nm: Option<f64>,
    /// Motor torque per ampere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub torque_constant_nm_a: Option<f64>,
    /// Step of the motor encoder, motor side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor_encoder_resolution_rad: Option<f64>,
    /// Step of the link encoder, joint side.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub link_encoder_resolution_rad: Option<f64>,
    /// Standard deviation of the position sensors' noise, each on its own side of the gear.
    #[serde(default)]
    pub position_noise_rad: f64,
    /// Standard deviation of the reported torque's noise, motor side.
    #[serde(default)]
    pub torque_noise_nm: f64,
    /// Where the joint may go.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_limit_rad: Option<[f64; 2]>,
    /// How fast the joint may go, either way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_limit_rad_s: Option<f64>,
    /// How far the reference may go on while the motor encoder shows no step, before the loop takes the joint for blocked or
    /// its encoder for dead; 0.05 rad where the file is silent. Soft joints at low gains need more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standstill_limit_rad: Option<f64>,
    /// How far the joint may be from its reference before the loop takes it for one that does not follow; 1 rad where the file
    /// is silent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub following_limit_rad: Option<f64>,
    /// The holding brake, where its times matter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brake: Option<HoldingBrake>,
    /// Friction measured per direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction_friction: Option<DirectionalFriction>,
    /// Torque over load measured per direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load_torque: Option<LoadTorqueTable>,
    /// Friction over the motor angle measured per direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction_table: Option<FrictionTable>,
    /// Torque that no effect has a name for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub torque_tables: Vec<TorqueTable>,
    /// Calibrated torque estimators.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimators: Option<EstimatorParameters>,
    /// What the driver of the hardware needs to know of this joint's drive: address, counts, limits. Its keys are the
    /// driver's, which checks them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drive: Option<toml::Table>,
    /// What the nominal model already knows.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<Effect>,
    /// Whether Coulomb or viscous friction is what a URDF or a MuJoCo model says: settings of a simulator, which nobody measured.
    #[serde(skip)]
    pub friction_is_a_simulators: bool,
}

impl RobotJoint {
    /// A joint of which nothing is known: driven directly, without rotor.
    pub fn named(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            gear_ratio: direct_drive(),
            rotor_inertia_kg_m2: 0.0,
            torque_limit_nm: None,
            torque_constant_nm_a: None,
            motor_encoder_resolution_rad: None,
            link_encoder_resolution_rad: None,
            position_noise_rad: 0.0,
            torque_noise_nm: 0.0,
            position_limit_rad: None,
            velocity_limit_rad_s: None,
            standstill_limit_rad: None,
            following_limit_rad: None,
            brake: None,
            direction_friction: None,
            load_torque: None,
            friction_table: None,
            torque_tables: Vec::new(),
            estimators: None,
            drive: None,
            effects: Vec::new(),
            friction_is_a_simulators: false,
        }
    }
}
