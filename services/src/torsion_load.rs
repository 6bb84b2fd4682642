//! A joint's load from the measured torsion of its gear, for friction that depends on load (PA10-05, Table V).
//!
//! `T = K(Δθ - Δθ_0)` with the robot file's compliance, and its soft wind-up where it has one. `Δθ_0` makes the first sample,
//! taken with the brakes closed, agree with the model's gravity: encoders have offsets, and nobody knows them better.
//! Limits: the gear's kinematic error is read as torsion (1 arc minute of it times the stiffness is some Nm), and a load that friction
//! held at the start stays in `Δθ_0`.

use joint_model::transmission::{LinearCompliance, SoftWindup, Spring};
use robot::{Effect, RobotJoint};

/// One joint's load sensor.
#[derive(Clone, Copy, Debug)]
pub struct TorsionLoad {
    spring: SoftWindup<LinearCompliance>,
    zero_rad: Option<f64>,
}

/// What a joint lacks for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Missing(pub &'static str);

impl TorsionLoad {
    /// A sensor with the robot file's compliance.
    ///
    /// # Errors
    /// [`Missing`]: the key or effect the joint would need.
    pub fn new(joint: &RobotJoint) -> Result<Self, Missing> {
        joint
            .link_encoder_resolution_rad
            .ok_or(Missing("link_encoder_resolution_rad"))?;
        let stiffness_nm_rad = joint
            .effects
            .iter()
            .find_map(|effect| match *effect {
                Effect::TorsionalCompliance { stiffness_nm_rad } => Some(stiffness_nm_rad),
                _ => None,
            })
            .ok_or(Missing("the effect torsional_compliance"))?;
        let soft_start = joint.effects.iter().find_map(|effect| match *effect {
            Effect::SoftWindup {
                low_stiffness_nm_rad,
                knee_nm,
            } => Some((low_stiffness_nm_rad, knee_nm)),
            _ => None,
        });
        let (low_stiffness_nm_rad, knee_nm) = soft_start.unwrap_or((stiffness_nm_rad, 0.0));
        Ok(Self {
            spring: SoftWindup {
                main: LinearCompliance { stiffness_nm_rad },
                low_stiffness_nm_rad,
                knee_nm,
            },
            zero_rad: None,
        })
    }

    /// Torque transmitted to the link at a torsion (motor angle over gear ratio minus link angle); the model's gravity where
    /// there is no reading.
    pub fn load_nm(&mut self, torsion_rad: f64, gravity_nm: f64) -> f64 {
        if !torsion_rad.is_finite() {
            return gravity_nm;
        }
        let spring = self.spring;
        let zero_rad = *self
            .zero_rad
            .get_or_insert_with(|| torsion_rad - spring.torsion_rad(gravity_nm));
        spring.torque_nm(torsion_rad - zero_rad)
    }
}
