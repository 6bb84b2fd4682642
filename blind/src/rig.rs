//! The robots of the cases: one-joint bench rigs drawn at random, and the PA-10.

use std::f64::consts::TAU;

use plant_emulator::PlantParameters;
use robot::{
    Control, ControlKind, Effect, Feedback, Feedforward, InertiaFile, LinkFile, Robot, RobotError,
    RobotFile, RobotJoint, Source, Tolerance,
};
use serde::{Deserialize, Serialize};

use crate::random::Random;

const GRAVITY_M_S2: f64 = 9.81;
/// Of both kinds: how well the values of the file are known.
const TOLERANCE: [f64; 2] = [0.01, 0.03];

/// Which kind of robot a case is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RigKind {
    /// A bench with one joint, drawn at random.
    OneJoint,
    /// The PA-10.
    SevenJoints,
}

/// A robot of a case, and what its plant has beside the robot file.
#[derive(Clone, Debug)]
pub(crate) struct Rig {
    /// As the case holds it.
    pub file: RobotFile,
    pub robot: Robot,
    /// The plant without effects: the file's physics, off by its tolerance.
    pub plant: PlantParameters,
}

impl Rig {
    pub fn draw(kind: RigKind, random: &mut Random) -> Result<Self, RobotError> {
        let file = match kind {
            RigKind::OneJoint => bench(random),
            RigKind::SevenJoints => arm(random)?,
        };
        let robot = file.clone().build(Source::File("robot.toml".into()))?;
        let plant = plant(&robot, random);
        Ok(Self { file, robot, plant })
    }
}

/// The file's values are off by their tolerance; drives and bristles are of no listed effect's making.
fn plant(robot: &Robot, random: &mut Random) -> PlantParameters {
    let mut plant = PlantParameters::nominal(robot);
    plant.parameter_deviation = robot.tolerance.default;
    plant.link_deviation = robot.tolerance.default;
    let largest_nm = robot.joints.iter().map(joint_limit_nm).fold(0.0, f64::max);
    plant.joint_torque_noise_nm = random
        .chance(0.25)
        .then(|| largest_nm * random.magnitude(2e-4, 2e-3));
    for joint in &mut plant.joints {
        joint.bristle_deflection_rad = random.magnitude(1e-4, 6e-4);
        joint.bristle_damping_ratio = random.between(0.3, 0.8);
    }
    plant
}

/// The most the drive gives, joint side.
pub(crate) fn joint_limit_nm(joint: &RobotJoint) -> f64 {
    joint.torque_limit_nm.unwrap_or(1.0) * joint.gear_ratio
}

/// The PA-10 as a user may have identified it: the shipped file with the damping of its gears, without which the model's
/// joints flutter.
fn arm(random: &mut Random) -> Result<RobotFile, RobotError> {
    let (mut file, source) = robot::load_file("pa10")?;
    let shipped = file.clone().build(source)?;
    let hidden = PlantParameters::for_robot(&shipped).ok();
    file.parameter_tolerance = tolerance(random);
    let link_encoders = random.chance(0.5);
    for (index, joint) in file.joints.iter_mut().enumerate() {
        let plant = hidden.as_ref().and_then(|plant| plant.joints.get(index));
        let damping = plant.into_iter().flat_map(|plant| &plant.effects);
        joint
            .effects
            .extend(damping.filter(|effect| matches!(effect, Effect::StructuralDamping { .. })));
        if link_encoders {
            joint.link_encoder_resolution_rad = Some(resolution_rad(random, 17, 20));
        }
    }
    Ok(file)
}

fn tolerance(random: &mut Random) -> Tolerance {
    Tolerance {
        default: (random.between(TOLERANCE[0], TOLERANCE[1]) * 1e3).round() * 1e-3,
        parameters: Default::default(),
    }
}

/// Of an encoder with so many bits, from the first up to and with the second.
fn resolution_rad(random: &mut Random, least: u32, most: u32) -> f64 {
    let bits = least + random.index((most - least + 1) as usize) as u32;
    TAU / f64::from(1_u32 << bits)
}

/// The sizes of a bench from which everything else follows, joint side.
struct Bench {
    ratio: f64,
    limit_nm: f64,
    speed_rad_s: f64,
    link: LinkFile,
    link_inertia_kg_m2: f64,
    rotor_inertia_kg_m2: f64,
    stiffness_nm_rad: f64,
    locked_hz: f64,
}

impl Bench {
    fn draw(random: &mut Random) -> Self {
        let limit_nm = random.magnitude(10.0, 120.0);
        let arm_m = random.between(0.08, 0.35);
        let mass_kg = limit_nm * random.between(0.1, 0.45) / (GRAVITY_M_S2 * arm_m);
        let own_kg_m2 = mass_kg * (random.between(0.2, 0.5) * arm_m).powi(2);
        let link_inertia_kg_m2 = own_kg_m2 + mass_kg * arm_m * arm_m;
        let locked_hz = random.between(14.0, 40.0);
        let upright = random.chance(0.15);
        let (axis, centre_of_mass_m) = if upright {
            ([0.0, 0.0, 1.0], [arm_m, 0.0, 0.0])
        } else {
            ([0.0, 1.0, 0.0], [0.0, 0.0, random.sign() * arm_m])
        };
        Self {
            ratio: random.magnitude(30.0, 160.0).round(),
            limit_nm,
            speed_rad_s: random.between(1.2, 3.0),
            link: LinkFile {
                parent: None,
                kind: Default::default(),
                joint: "joint1".to_owned(),
                origin_m: [0.0; 3],
                origin_rpy_rad: [0.0; 3],
                axis,
                mass_kg,
                centre_of_mass_m,
                inertia_kg_m2: InertiaFile {
                    xx: own_kg_m2,
                    yy: own_kg_m2,
                    zz: own_kg_m2,
                    xy: 0.0,
                    yz: 0.0,
                    xz: 0.0,
                },
            },
            link_inertia_kg_m2,
            rotor_inertia_kg_m2: link_inertia_kg_m2 * random.magnitude(0.3, 3.0),
            stiffness_nm_rad: link_inertia_kg_m2 * (TAU * locked_hz).powi(2),
            locked_hz,
        }
    }

    fn inertia_kg_m2(&self) -> f64 {
        self.link_inertia_kg_m2 + self.rotor_inertia_kg_m2
    }

    /// What the file knows of gear and friction.
    fn effects(&self, random: &mut Random) -> Vec<Effect> {
        let coulomb_nm = self.limit_nm * random.between(0.02, 0.07);
        let reduced_kg_m2 =
            self.link_inertia_kg_m2 * self.rotor_inertia_kg_m2 / self.inertia_kg_m2();
        let critical_nm_s_rad = 2.0 * (self.stiffness_nm_rad * reduced_kg_m2).sqrt();
        let mut effects = vec![
            Effect::CoulombFriction { coulomb_nm },
            Effect::ViscousFriction {
                viscous_nm_s_rad: self.limit_nm * random.between(0.01, 0.05) / self.speed_rad_s,
            },
            Effect::TorsionalCompliance {
                stiffness_nm_rad: self.stiffness_nm_rad,
            },
            Effect::StructuralDamping {
                damping_nm_s_rad: critical_nm_s_rad * random.between(0.04, 0.1),
                exponent: 1.0,
            },
        ];
        if random.chance(0.5) {
            effects.push(Effect::StribeckFriction {
                stribeck_nm: coulomb_nm * random.between(0.1, 0.4),
                stribeck_velocity_rad_s: random.magnitude(0.01, 0.08),
            });
        }
        if random.chance(0.3) {
            effects.push(Effect::LoadDependentFriction {
                load_coefficient: random.between(0.02, 0.1),
            });
        }
        if random.chance(0.2) {
            effects.push(Effect::PositionDependentFriction {
                amplitude_nm: coulomb_nm * random.between(0.05, 0.15),
                cycles_per_motor_rev: 2.0,
                phase_rad: random.between(0.0, TAU),
            });
        }
        effects
    }

    /// As stiff as the gear's own mode allows.
    fn control(&self, feedback: Feedback, random: &mut Random) -> Control {
        let softest = if feedback == Feedback::Link {
            12.0
        } else {
            5.0
        };
        let bandwidth_hz = random.between(1.5, 4.0).min(self.locked_hz / softest);
        let bandwidth_rad_s = TAU * bandwidth_hz;
        let damping = random.between(0.7, 1.0);
        Control {
            rate_hz: 1500.0,
            kind: ControlKind::PdFeedforward,
            proportional_nm_rad: vec![self.inertia_kg_m2() * bandwidth_rad_s.powi(2)],
            derivative_nm_s_rad: vec![2.0 * damping * self.inertia_kg_m2() * bandwidth_rad_s],
            feedback,
            feedforward: random.pick(&[
                Feedforward::Model,
                Feedforward::Model,
                Feedforward::RigidBody,
                Feedforward::RigidBody,
                Feedforward::None,
            ]),
            velocity_filter_hz: random.pick(&[100.0, 200.0, 300.0]),
            velocity_filter_order: random.pick(&[1, 1, 2]),
            delay_cycles: 1,
        }
    }
}

fn bench(random: &mut Random) -> RobotFile {
    let sizes = Bench::draw(random);
    let range_rad = random.between(1.0, 2.2);
    let link_encoder = random.chance(0.5);
    let feedback = if link_encoder && random.chance(0.25) {
        Feedback::Link
    } else {
        Feedback::Motor
    };
    let joint = RobotJoint {
        name: sizes.link.joint.clone(),
        gear_ratio: sizes.ratio,
        rotor_inertia_kg_m2: sizes.rotor_inertia_kg_m2 / sizes.ratio.powi(2),
        torque_limit_nm: Some(sizes.limit_nm / sizes.ratio),
        torque_constant_nm_a: None,
        motor_encoder_resolution_rad: Some(resolution_rad(random, 13, 18)),
        link_encoder_resolution_rad: link_encoder.then(|| resolution_rad(random, 17, 21)),
        position_noise_rad: if random.chance(0.5) {
            random.magnitude(2e-7, 4e-6)
        } else {
            0.0
        },
        torque_noise_nm: sizes.limit_nm / sizes.ratio * random.magnitude(3e-4, 5e-3),
        position_limit_rad: Some([-range_rad, range_rad]),
        velocity_limit_rad_s: Some(sizes.speed_rad_s),
        standstill_limit_rad: None,
        following_limit_rad: None,
        brake: None,
        direction_friction: None,
        load_torque: None,
        friction_table: None,
        torque_tables: Vec::new(),
        estimators: None,
        drive: None,
        friction_is_a_simulators: false,
        effects: sizes.effects(random),
    };
    RobotFile {
        name: "bench".to_owned(),
        gravity_m_s2: [0.0, 0.0, -GRAVITY_M_S2],
        parameter_tolerance: tolerance(random),
        urdf: None,
        mjcf: None,
        held: Default::default(),
        tool_origin_m: [0.0; 3],
        tool_origin_rpy_rad: [0.0; 3],
        shared_effects: Vec::new(),
        drive: None,
        control: Some(sizes.control(feedback, random)),
        links: vec![sizes.link],
        joints: vec![joint],
    }
}
