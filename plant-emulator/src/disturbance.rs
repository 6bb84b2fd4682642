//! What acts on a link and is none of the effects with a name: laws that come from outside the emulator.

use core::fmt::Debug;

/// The arm as a disturbance sees it, at the beginning of a substep.
#[derive(Clone, Copy, Debug)]
pub struct ArmMotion<'a> {
    /// Since the start of the run.
    pub time_s: f64,
    /// Until it is asked again.
    pub step_s: f64,
    /// Of every joint, after the gear.
    pub link_position_rad: &'a [f64],
    /// Of every joint, after the gear.
    pub link_velocity_rad_s: &'a [f64],
}

/// A torque on a link, as a law of time, motion and what it remembers. Asked once a substep, in order of time.
pub trait Disturbance: Debug + Send {
    /// Positive about the joint's axis.
    fn torque_nm(&mut self, arm: &ArmMotion<'_>) -> f64;
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;
    use crate::{Plant, PlantCommand, PlantMode, PlantParameters};

    #[derive(Debug)]
    struct Push {
        nm: f64,
    }

    impl Disturbance for Push {
        fn torque_nm(&mut self, _: &ArmMotion<'_>) -> f64 {
            self.nm
        }
    }

    #[test]
    fn a_push_twists_the_gear_of_a_joint_that_is_held() {
        let robot = robot::load("shd17").unwrap();
        let parameters = PlantParameters::nominal(&robot);
        let joint_torque_nm = |nm: f64| {
            let mut plant = Plant::new(&robot, &parameters, &[], 1, &[0.3], 1.0 / 1500.0).unwrap();
            plant.disturb(0, Box::new(Push { nm })).unwrap();
            let braked = PlantCommand {
                fresh: true,
                mode: PlantMode::Braked,
                ..PlantCommand::default()
            };
            let held_nm = (0..1500).map(|_| {
                plant.step(&braked);
                plant.truth().joint_torque_nm[0]
            });
            held_nm.sum::<f64>() / 1500.0
        };
        let change_nm = joint_torque_nm(2.0) - joint_torque_nm(0.0);
        assert!((change_nm + 2.0).abs() < 0.1, "{change_nm}");
    }

    #[test]
    fn a_joint_that_is_not_there_cannot_be_pushed() {
        let robot = robot::load("shd17").unwrap();
        let parameters = PlantParameters::nominal(&robot);
        let mut plant = Plant::new(&robot, &parameters, &[], 1, &[0.0], 1.0 / 1500.0).unwrap();
        let refused = plant.disturb(1, Box::new(Push { nm: 1.0 })).unwrap_err();
        assert!(
            refused
                .to_string()
                .contains("joint 1, the robot has joints 0 to 0"),
            "{refused}"
        );
    }
}
