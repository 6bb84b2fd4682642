//! What follows a motion: the papers' way with one model or another, our extensions of it, and feedback alone.

use robot::{Control, Feedforward, Robot};
use shm_types::control_options::{ControlOptions, FrictionVelocity, StiffnessTorque};

/// What the feedforward knows; the plant is always the emulated arm.
#[derive(Clone, Debug)]
pub struct Controller {
    /// In tables.
    pub name: &'static str,
    /// How the feedforward uses the model.
    pub options: ControlOptions,
    /// Limits, gains, feedforward.
    pub model: Robot,
    /// What the emulated arm is made from, its sensors included.
    pub plant: Robot,
}

/// The model of the papers' tables, as the shipped robot file has it.
pub const PUBLISHED: &str = "published tables";
/// The model identified on the arm itself.
pub const IDENTIFIED: &str = "identified";
/// Feedback alone.
pub const NO_MODEL: &str = "no model";
/// Feedback alone, at those of the gains tried that follow best.
pub const HIGH_GAINS: &str = "no model, high gains";

/// Every controller with a model, the one of the papers first.
pub fn with_models(plant: &Robot, identified: &Robot) -> Vec<Controller> {
    let mut controllers = vec![
        Controller {
            name: PUBLISHED,
            options: ControlOptions::default(),
            model: plant.clone(),
            plant: plant.clone(),
        },
        Controller {
            name: IDENTIFIED,
            options: ControlOptions::default(),
            model: identified.clone(),
            plant: plant.clone(),
        },
    ];
    controllers.extend(extensions(plant, identified));
    controllers
}

/// Step of the link encoder that the extended arm gets: that of the resolver PA10-05 has on the motor, at the joint.
const LINK_ENCODER_RAD: f64 = 7.662e-6;

/// What the papers' authors wished for, each on top of the identified model. The one place to add another.
fn extensions(plant: &Robot, identified: &Robot) -> Vec<Controller> {
    let measured = ControlOptions {
        friction_velocity: FrictionVelocity::Measured,
        ..ControlOptions::default()
    };
    let torsion = ControlOptions {
        stiffness_torque: StiffnessTorque::Torsion,
        ..ControlOptions::default()
    };
    let correction = ControlOptions {
        correction_gain: 1.0,
        ..ControlOptions::default()
    };
    let velocity_and_correction = ControlOptions {
        friction_velocity: FrictionVelocity::Measured,
        ..correction
    };
    [
        ("+ measured velocity", measured),
        ("+ torsion", torsion),
        ("+ correction", correction),
        ("+ velocity, correction", velocity_and_correction),
    ]
    .into_iter()
    .map(|(name, options)| {
        let has_encoder = options.stiffness_torque == StiffnessTorque::Torsion;
        let equipped = |robot: &Robot| {
            if has_encoder {
                with_link_encoders(robot)
            } else {
                robot.clone()
            }
        };
        Controller {
            name,
            options,
            model: equipped(identified),
            plant: equipped(plant),
        }
    })
    .collect()
}

fn with_link_encoders(robot: &Robot) -> Robot {
    let mut robot = robot.clone();
    for joint in &mut robot.joints {
        joint.link_encoder_resolution_rad = Some(LINK_ENCODER_RAD);
    }
    robot
}

/// The same gains with nothing fed forward.
pub fn without_model(plant: &Robot) -> Controller {
    let mut model = plant.clone();
    if let Some(control) = &mut model.control {
        control.feedforward = Feedforward::None;
    }
    Controller {
        name: NO_MODEL,
        options: ControlOptions::default(),
        model,
        plant: plant.clone(),
    }
}

impl Controller {
    /// With other gains.
    #[must_use]
    pub fn with_gains(mut self, change: impl FnOnce(&mut Control)) -> Self {
        if let Some(control) = &mut self.model.control {
            change(control);
        }
        self
    }
}
