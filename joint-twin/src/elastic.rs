//! How an arm's links move behind its gears while its motors move as they were recorded.
//!
//! What a motor does suddenly, as when it breaks away from rest, its link follows as gear and inertia let it, and the other
//! joints feel the link. The links are integrated: `M(q)·q̈ + h(q, q̇) = τ(motor + error - q)`, the springs implicit, so that
//! no stiffness asks for smaller steps; what rings above some tens of hertz dies out by the steps.

use joint_model::rigid_body::Chain;
use nalgebra::{DMatrix, DVector};

use crate::joint::JointModel;

/// Longest step.
const STEP_S: f64 = 1e-3;
/// The mass matrix is computed so often: poses change slowly.
const POSE_S: f64 = 5e-3;
/// A joint whose only encoder is behind its gear is held on it by a spring so many times stiffer than a step could tell.
const RIGID: f64 = 100.0;

/// Every link's position, from every motor's, joint side, at a constant rate. A joint without a gear here was measured behind
/// it.
pub(crate) fn links_rad(
    chain: &Chain,
    gears: &[Option<JointModel>],
    motor_rad: &[Vec<f64>],
    rate_hz: f64,
) -> Vec<Vec<f64>> {
    let samples = motor_rad.first().map_or(0, Vec::len);
    let mut links_rad: Vec<Vec<f64>> = vec![Vec::with_capacity(samples); gears.len()];
    if samples == 0 {
        return links_rad;
    }
    let steps = (1.0 / (rate_hz * STEP_S)).ceil().max(1.0) as usize;
    let step_s = 1.0 / (rate_hz * steps as f64);
    let poses_every = ((POSE_S / step_s) as usize).max(1);
    let mut arm = Arm::at_start(chain, gears, motor_rad, rate_hz, step_s);
    let mut step = 0;
    for k in 0..samples {
        for (link_rad, position_rad) in links_rad.iter_mut().zip(arm.position_rad.iter()) {
            link_rad.push(*position_rad);
        }
        let next = (k + 1).min(samples - 1);
        for substep in 1..=steps {
            if step % poses_every == 0 {
                arm.pose();
            }
            let share = substep as f64 / steps as f64;
            arm.advance(|joint| {
                let motor_rad = &motor_rad[joint];
                motor_rad[k] + share * (motor_rad[next] - motor_rad[k])
            });
            step += 1;
        }
    }
    links_rad
}

struct Arm<'a> {
    chain: &'a Chain,
    gears: &'a [Option<JointModel>],
    step_s: f64,
    position_rad: DVector<f64>,
    velocity_rad_s: DVector<f64>,
    mass_kg_m2: DMatrix<f64>,
    /// Of the gears.
    stiffness_nm_rad: DVector<f64>,
    /// Of `M + h²K`; none where the arm's inertia is none.
    implicit: Option<nalgebra::Cholesky<f64, nalgebra::Dyn>>,
    out: Vec<f64>,
}

impl<'a> Arm<'a> {
    /// The gears wound up by gravity.
    fn at_start(
        chain: &'a Chain,
        gears: &'a [Option<JointModel>],
        motor_rad: &[Vec<f64>],
        rate_hz: f64,
        step_s: f64,
    ) -> Self {
        let count = gears.len();
        let motors_rad: Vec<f64> = motor_rad.iter().map(|motor_rad| motor_rad[0]).collect();
        let mut out = vec![0.0; count];
        chain.gravity_torque(&motors_rad, &mut out);
        let wound = (0..count).map(|joint| {
            let twist_rad = gears[joint]
                .as_ref()
                .map(|gear| gear.torsion_rad(out[joint]));
            behind(gears, joint, motors_rad[joint]) - twist_rad.unwrap_or(0.0)
        });
        let position_rad = DVector::from_iterator(count, wound);
        let velocity_rad_s = motor_rad.iter().map(|motor_rad| {
            let next_rad = motor_rad.get(1).unwrap_or(&motor_rad[0]);
            (next_rad - motor_rad[0]) * rate_hz
        });
        Self {
            chain,
            gears,
            step_s,
            velocity_rad_s: DVector::from_iterator(count, velocity_rad_s),
            mass_kg_m2: DMatrix::zeros(count, count),
            stiffness_nm_rad: DVector::zeros(count),
            implicit: None,
            position_rad,
            out,
        }
    }

    /// Inertia and stiffness at the present pose.
    fn pose(&mut self) {
        let count = self.gears.len();
        let at = self.position_rad.as_slice();
        for joint in 0..count {
            let column = DVector::from_vec(mass_column_kg_m2(self.chain, at, joint));
            self.mass_kg_m2.set_column(joint, &column);
        }
        for joint in 0..count {
            self.stiffness_nm_rad[joint] = match &self.gears[joint] {
                Some(gear) => gear.stiffness_nm_rad,
                None => RIGID * self.mass_kg_m2[(joint, joint)] / self.step_s.powi(2),
            };
        }
        let springs = DMatrix::from_diagonal(&(self.step_s.powi(2) * &self.stiffness_nm_rad));
        self.implicit = (&self.mass_kg_m2 + springs).cholesky();
    }

    /// To the end of a step, when the motors are there.
    fn advance(&mut self, motor_rad: impl Fn(usize) -> f64) {
        let rest = vec![0.0; self.gears.len()];
        self.chain.inverse_dynamics(
            self.position_rad.as_slice(),
            self.velocity_rad_s.as_slice(),
            &rest,
            &mut self.out,
        );
        let mut momentum = &self.mass_kg_m2 * &self.velocity_rad_s;
        for joint in 0..self.gears.len() {
            let torsion_rad =
                behind(self.gears, joint, motor_rad(joint)) - self.position_rad[joint];
            let spring_nm = match &self.gears[joint] {
                Some(gear) => gear.elastic_nm(torsion_rad),
                None => self.stiffness_nm_rad[joint] * torsion_rad,
            };
            momentum[joint] += self.step_s * (spring_nm - self.out[joint]);
        }
        if let Some(implicit) = &self.implicit {
            self.velocity_rad_s = implicit.solve(&momentum);
        }
        self.position_rad += self.step_s * &self.velocity_rad_s;
    }
}

/// Torque on every joint by which one alone accelerates, per its acceleration: a column of the mass matrix.
pub(crate) fn mass_column_kg_m2(chain: &Chain, position_rad: &[f64], joint: usize) -> Vec<f64> {
    let count = position_rad.len();
    let rest = vec![0.0; count];
    let mut unit = vec![0.0; count];
    unit[joint] = 1.0;
    let (mut gravity_nm, mut moving_nm) = (vec![0.0; count], vec![0.0; count]);
    chain.gravity_torque(position_rad, &mut gravity_nm);
    chain.inverse_dynamics(position_rad, &rest, &unit, &mut moving_nm);
    let columns = moving_nm.iter().zip(&gravity_nm);
    columns
        .map(|(moving_nm, gravity_nm)| moving_nm - gravity_nm)
        .collect()
}

/// Where the gear's output would be without load.
fn behind(gears: &[Option<JointModel>], joint: usize, motor_rad: f64) -> f64 {
    let error_rad = gears[joint].as_ref().map_or(0.0, |gear| {
        let (error_rad, _) = gear.kinematic_error(motor_rad * gear.gear_ratio);
        error_rad
    });
    motor_rad + error_rad
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 1000.0;

    fn behind_motors(name: &str, motor_rad: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let robot = robot::load(name).unwrap();
        let gears: Vec<Option<JointModel>> = (0..robot.joints.len())
            .map(|joint| Some(JointModel::nominal(&robot, joint)))
            .collect();
        links_rad(&robot.chain, &gears, motor_rad, RATE_HZ)
    }

    #[test]
    fn a_link_swings_further_than_its_motor_below_its_resonance() {
        let robot = robot::load("shd17").unwrap();
        let gear = JointModel::nominal(&robot, 0);
        let mut torque_nm = [0.0];
        robot
            .chain
            .inverse_dynamics(&[0.0], &[0.0], &[1.0], &mut torque_nm);
        let resonance_rad_s = (gear.stiffness_nm_rad / torque_nm[0]).sqrt();
        let motor_rad: Vec<f64> = (0..4000)
            .map(|k| 0.1 * (resonance_rad_s / 3.0 * k as f64 / RATE_HZ).sin())
            .collect();
        let links_rad = behind_motors("shd17", &[motor_rad]);
        let largest_rad = links_rad[0][3000..].iter().copied().fold(0.0, f64::max);
        let expected_rad = 0.1 / (1.0 - 1.0 / 9.0);
        assert!(
            (largest_rad / expected_rad - 1.0).abs() < 0.01,
            "{largest_rad} {expected_rad}"
        );
    }

    #[test]
    fn a_link_follows_what_its_motor_does_in_an_instant_later() {
        let motor_rad: Vec<f64> = (0..200).map(|k| if k < 100 { 0.0 } else { 1e-3 }).collect();
        let links_rad = behind_motors("shd17", &[motor_rad]);
        assert!(links_rad[0][99].abs() < 1e-9);
        assert!(links_rad[0][101] < 2e-4, "{}", links_rad[0][101]);
        let reaches = |from: usize| links_rad[0][from..].iter().copied().fold(0.0, f64::max);
        assert!(reaches(101) > 1e-3, "it overshoots");
    }

    #[test]
    fn an_arm_that_stands_hangs_in_its_gears() {
        let robot = robot::load("pa10").unwrap();
        let at_rad = [0.3, 0.8, -0.4, 1.0, 0.2, -0.6, 0.1];
        let motors: Vec<Vec<f64>> = at_rad.iter().map(|q| vec![*q; 2000]).collect();
        let links_rad = behind_motors("pa10", &motors);
        let ends_rad: Vec<f64> = links_rad.iter().map(|link| link[1999]).collect();
        let mut torque_nm = [0.0; 7];
        robot.chain.gravity_torque(&ends_rad, &mut torque_nm);
        for (joint, (end_rad, motor_rad)) in ends_rad.iter().zip(at_rad).enumerate() {
            let gear = JointModel::nominal(&robot, joint);
            let twist_rad = gear.torsion_rad(torque_nm[joint]);
            assert!((motor_rad - end_rad - twist_rad).abs() < 1e-6, "{joint}");
        }
    }
}
