//! What tests make up: one joint of two masses in small explicit steps, which share no integrator and no friction law with the twin,
//! and an arm whose rigid bodies swing.
#![forbid(unsafe_code)]

use std::collections::BTreeMap;

use recording::{JointColumns, Recording, Signal};
use robot::{Robot, RobotFile, RobotJoint, Source};

const RATE_HZ: f64 = 1000.0;
const ROWS: usize = 12_000;
/// Steps of the plant in a row.
const SUBSTEPS: usize = 25;
const RATIO: f64 = 100.0;
const ROTOR_KG_M2: f64 = 1e-5;
const RESOLUTION_RAD: f64 = 1e-5;
const NOISE_NM: f64 = 2e-4;
const COULOMB_NM: f64 = 2.0;
const VISCOUS_NM_S_RAD: f64 = 1.0;
const STIFFNESS_NM_RAD: f64 = 20_000.0;
const DAMPING_NM_S_RAD: f64 = 5.0;
const LINK_KG: f64 = 3.0;
/// From the joint to the link's centre of mass.
const CENTRE_M: f64 = 0.3;
const LINK_KG_M2: f64 = 0.06;
const BUMP_RAD: f64 = 0.15;
const BUMP_WIDTH_RAD: f64 = 0.05;

/// What the joint has that its robot file does not know, and how it is moved.
pub struct MadeUp {
    /// Joint side: how far its gear turns before it carries.
    pub gap_rad: f64,
    /// At the link's centre of mass.
    pub payload_kg: f64,
    /// Joint side: its amplitude.
    pub ripple_nm: f64,
    /// How often it repeats in a turn of the motor.
    pub ripple_cycles: f64,
    /// Joint side: friction more around one angle, which is no law with a name.
    pub bump_nm: f64,
    /// Joint side: damping of the gear beyond what is known, with the root of the rate at which it twists.
    pub root_damping_nm: f64,
    /// Whether the link's position is recorded beside the motor's.
    pub has_link_encoder: bool,
    /// Wanted position over time, as sines of an amplitude and an angular frequency.
    pub sines: [[f64; 2]; 2],
}

impl MadeUp {
    /// As the robot file has it, on a way of nearly half a radian to both sides.
    pub const KNOWN: Self = Self {
        gap_rad: 0.0,
        payload_kg: 0.0,
        ripple_nm: 0.0,
        ripple_cycles: 6.0,
        bump_nm: 0.0,
        root_damping_nm: 0.0,
        has_link_encoder: false,
        sines: [[0.4, 2.0], [0.1, 7.0]],
    };

    /// The motor held on its way by feedback, and a mass at the link's centre; its torque's noise is made of random numbers between 0 and 1.
    pub fn recorded(&self, mut random: impl FnMut() -> f64) -> Recording {
        let step_s = 1.0 / RATE_HZ / SUBSTEPS as f64;
        let rotor_kg_m2 = RATIO * RATIO * ROTOR_KG_M2;
        let link_kg = LINK_KG + self.payload_kg;
        let link_kg_m2 = LINK_KG_M2 + link_kg * CENTRE_M * CENTRE_M;
        let [mut motor_rad, mut motor_nm, mut link_rad] = [0; 3].map(|_| Vec::with_capacity(ROWS));
        let wanted_at = |time_s: f64| -> f64 {
            let of = |[amplitude_rad, rad_s]: [f64; 2]| amplitude_rad * (rad_s * time_s).sin();
            self.sines.map(of).iter().sum()
        };
        let wanted_speed_at = |time_s: f64| -> f64 {
            let of =
                |[amplitude_rad, rad_s]: [f64; 2]| amplitude_rad * rad_s * (rad_s * time_s).cos();
            self.sines.map(of).iter().sum()
        };
        let [mut at, mut speed] = [[0.0; 2], [wanted_speed_at(0.0); 2]];
        for row in 0..ROWS {
            let time_s = row as f64 / RATE_HZ;
            let torque_nm =
                400.0 * (wanted_at(time_s) - at[0]) + 20.0 * (wanted_speed_at(time_s) - speed[0]);
            let normal = (0..12).map(|_| random()).sum::<f64>() - 6.0;
            motor_nm.push(torque_nm / RATIO + NOISE_NM * normal);
            motor_rad.push((at[0] * RATIO / RESOLUTION_RAD).round() * RESOLUTION_RAD);
            link_rad.push((at[1] / RESOLUTION_RAD).round() * RESOLUTION_RAD);
            for _ in 0..SUBSTEPS {
                let twist_rad = at[0] - at[1];
                let free_rad = twist_rad.clamp(-0.5 * self.gap_rad, 0.5 * self.gap_rad);
                let twist_rad_s = speed[0] - speed[1];
                let root_nm = self.root_damping_nm * twist_rad_s.abs().sqrt().copysign(twist_rad_s);
                let gear_nm = STIFFNESS_NM_RAD * (twist_rad - free_rad)
                    + DAMPING_NM_S_RAD * twist_rad_s
                    + root_nm;
                let bump_nm = self.bump_nm * (-((at[0] - BUMP_RAD) / BUMP_WIDTH_RAD).powi(2)).exp();
                let friction_nm =
                    (COULOMB_NM + bump_nm) * (speed[0] / 2e-3).tanh() + VISCOUS_NM_S_RAD * speed[0];
                let ripple_nm = self.ripple_nm * (self.ripple_cycles * RATIO * at[0]).sin();
                let weight_nm = link_kg * 9.81 * CENTRE_M * at[1].sin();
                speed[0] += step_s * (torque_nm + ripple_nm - friction_nm - gear_nm) / rotor_kg_m2;
                speed[1] += step_s * (gear_nm + weight_nm) / link_kg_m2;
                at[0] += step_s * speed[0];
                at[1] += step_s * speed[1];
            }
        }
        let mut signals = BTreeMap::from([
            (Signal::MotorPositionRad, motor_rad),
            (Signal::MotorTorqueNm, motor_nm),
        ]);
        if self.has_link_encoder {
            signals.insert(Signal::LinkPositionRad, link_rad);
        }
        Recording {
            time_s: (0..ROWS).map(|row| row as f64 / RATE_HZ).collect(),
            segment: None,
            joints: vec![JointColumns {
                name: "joint1".to_owned(),
                signals,
            }],
            sample_rate_hz: RATE_HZ,
            metadata: BTreeMap::new(),
            truncated: false,
        }
    }
}

/// What is known of the joint.
#[allow(
    clippy::unwrap_used,
    reason = "only tests build this; the text is a constant"
)]
pub fn robot() -> Robot {
    let text = format!(
        "name = \"one\"\ngravity_m_s2 = [0.0, 0.0, -9.81]\nparameter_tolerance = 0.02\n\
         [[link]]\njoint = \"joint1\"\norigin_m = [0.0, 0.0, 0.3]\n\
         origin_rpy_rad = [0.0, 0.0, 0.0]\naxis = [0.0, 1.0, 0.0]\nmass_kg = {LINK_KG}\n\
         centre_of_mass_m = [0.0, 0.0, {CENTRE_M}]\n\
         inertia_kg_m2 = {{ xx = 0.06, yy = {LINK_KG_M2}, zz = 0.004, xy = 0.0, yz = 0.0, xz = 0.0 }}\n\
         [[joint]]\nname = \"joint1\"\ngear_ratio = {RATIO}\nrotor_inertia_kg_m2 = {ROTOR_KG_M2}\n\
         motor_encoder_resolution_rad = {RESOLUTION_RAD}\ntorque_noise_nm = {NOISE_NM}\neffects = [\n\
         {{ effect = \"coulomb_friction\", coulomb_nm = {COULOMB_NM} }},\n\
         {{ effect = \"viscous_friction\", viscous_nm_s_rad = {VISCOUS_NM_S_RAD} }},\n\
         {{ effect = \"torsional_compliance\", stiffness_nm_rad = {STIFFNESS_NM_RAD:?} }},\n\
         {{ effect = \"structural_damping\", damping_nm_s_rad = {DAMPING_NM_S_RAD:?}, exponent = 1.0 }},\n]\n"
    );
    let file = RobotFile::parse(&text, "one.toml").unwrap();
    file.build(Source::Shipped("one")).unwrap()
}

/// Every joint of an arm swings at its own frequencies; joint `heavier` carries more than its file says.
pub fn swinging(robot: &Robot, heavier: Option<usize>) -> Recording {
    let count = robot.joints.len();
    let rows = 600;
    let mut columns = vec![[vec![0.0; rows], vec![0.0; rows]]; count];
    let mut rigid_nm = vec![0.0; count];
    let time_s: Vec<f64> = (0..rows).map(|k| k as f64 / 50.0).collect();
    for (k, time_s) in time_s.iter().enumerate() {
        let [mut position, mut velocity, mut acceleration] = [0; 3].map(|_| vec![0.0; count]);
        for joint in 0..count {
            for (part, rate_rad_s) in [0.9, 2.3].iter().enumerate() {
                let rate_rad_s = rate_rad_s * (1.0 + 0.13 * joint as f64);
                let size_rad = 0.5 / (1.0 + 2.0 * part as f64);
                let (sin, cos) = (rate_rad_s * time_s + joint as f64).sin_cos();
                position[joint] += size_rad * sin;
                velocity[joint] += size_rad * rate_rad_s * cos;
                acceleration[joint] -= size_rad * rate_rad_s * rate_rad_s * sin;
            }
        }
        let chain = &robot.chain;
        chain.inverse_dynamics(&position, &velocity, &acceleration, &mut rigid_nm);
        for (joint, file) in robot.joints.iter().enumerate() {
            let rotor_kg_m2 = file.rotor_inertia_kg_m2 * file.gear_ratio.powi(2);
            let friction_nm = 4.0 * velocity[joint].signum() + 3.0 * velocity[joint];
            let more = if heavier == Some(joint) { 1.6 } else { 1.0 };
            let torque_nm =
                more * rigid_nm[joint] + rotor_kg_m2 * acceleration[joint] + friction_nm;
            columns[joint][0][k] = file.gear_ratio * position[joint];
            columns[joint][1][k] = torque_nm / file.gear_ratio;
        }
    }
    let of_joint = |([angle_rad, torque_nm], file): ([Vec<f64>; 2], &RobotJoint)| {
        let signals = [
            (Signal::MotorPositionRad, angle_rad),
            (Signal::MotorTorqueNm, torque_nm),
        ];
        JointColumns {
            name: file.name.clone(),
            signals: signals.into(),
        }
    };
    Recording {
        time_s,
        segment: None,
        joints: columns
            .into_iter()
            .zip(&robot.joints)
            .map(of_joint)
            .collect(),
        sample_rate_hz: 50.0,
        metadata: Default::default(),
        truncated: false,
    }
}
