//! A joint's load from the measured torsion of its gear, for friction that depends on load (PA10-05, Table V).
//!
//! `T = K(Δθ - Δθ_0)` with the robot file's compliance, and its soft wind-up where it has one. `Δθ_0` makes the first sample,
//! taken with the brakes closed, agree with the model's gravity: encoders have offsets, and nobody knows them better.
//! Limits: the load is as good as the stiffness and the law it enters. On the emulated PA-10, one stiffness for a gear that has
//! three is off by a quarter; joint 2 gains (10.3 to 7.5 mrad rms), but joint 4, whose friction changes by 5 Nm per Nm of load,
//! goes from 5.8 to 37.5 mrad. Calibrate the stiffness before use. The gear's kinematic error is read as torsion (1 arc minute of it times the stiffness is some Nm), and a load that friction
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

#[cfg(test)]
mod tests {
    use super::*;

    fn joint(changed: impl FnOnce(&mut RobotJoint)) -> RobotJoint {
        let mut joint = robot::load("shd17").expect("shipped").joints.remove(0);
        changed(&mut joint);
        joint
    }

    #[test]
    fn a_change_of_torsion_is_a_change_of_load_whatever_the_encoders_offset() {
        for offset_rad in [0.0, 0.3] {
            let mut load = TorsionLoad::new(&joint(|_| ())).expect("has all it takes");
            assert!((load.load_nm(offset_rad, 4.0) - 4.0).abs() < 1e-9);
            let twisted_nm = load.load_nm(offset_rad + 1e-4, 4.0);
            assert!((twisted_nm - 4.0 - 0.8333).abs() < 1e-9, "{twisted_nm}");
            assert_eq!(load.load_nm(f64::NAN, 3.0), 3.0);
        }
    }

    #[test]
    fn what_a_joint_lacks_is_named() {
        let blind = joint(|joint| joint.link_encoder_resolution_rad = None);
        let missing = |joint| TorsionLoad::new(&joint).map(drop);
        assert_eq!(missing(blind), Err(Missing("link_encoder_resolution_rad")));
        let stiff = joint(|joint| joint.effects.clear());
        assert!(missing(stiff).is_err());
    }
}
