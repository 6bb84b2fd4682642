//! Where an arm's links were: by their own encoders where these are fine enough, else behind their motors.

use joint_model::filter::FilterError;
use joint_model::rigid_body::Chain;
use robot::{Robot, RobotJoint};

use crate::joint::JointModel;
use crate::load::{Load, Motion};
use crate::observe::Band;

/// Part of a motion's acceleration that a link's encoder may blur if the motion is taken from it: what a twin gets wrong of
/// others' motion anyway.
const BLUR_PART: f64 = 0.02;
/// Stiffness of a gear by which it is found how well a swing behind it is known, over what the robot file tells.
const SOFTER: f64 = 0.9;
/// How far a joint's two encoders may be apart to show one motion.
const AGREE_RAD: f64 = 0.05;

/// What the encoders say, joint side.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Position {
    pub motor_rad: Vec<f64>,
    pub link_rad: Option<Vec<f64>>,
    pub is_whole: Vec<bool>,
    /// Whether the only encoder is behind the gear.
    pub is_of_link: bool,
}

impl Position {
    /// Where motor and link were, if the encoders have the faults that the robot file tells.
    fn without_faults(&self, model: &JointModel, rate_hz: f64) -> Self {
        let samples = model
            .encoder_delays_s
            .map(|more_s| (model.sensor_delay_s + more_s) * rate_hz);
        let of_motor = usize::from(self.is_of_link);
        let motor_rad = earlier(&self.motor_rad, samples[of_motor]);
        let link_rad = self.link_rad.as_ref();
        let link_rad = link_rad.map(|shown| earlier(shown, samples[1]));
        let link = |shown: f64| shown - model.link_fault_rad(shown);
        let motor = |shown: f64| {
            if self.is_of_link {
                link(shown)
            } else {
                shown - model.motor_fault_rad(shown)
            }
        };
        Self {
            motor_rad: motor_rad.into_iter().map(motor).collect(),
            link_rad: link_rad.map(|shown| shown.into_iter().map(link).collect()),
            ..self.clone()
        }
    }
}

/// Values that came so many samples late, when they were true. What is missing at the end stays as it was last.
fn earlier(values: &[f64], samples: f64) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    let at = |k: usize| {
        let place = (k as f64 + samples).min(last as f64);
        let before = place as usize;
        let after = (before + 1).min(last);
        values[before] + (place - before as f64) * (values[after] - values[before])
    };
    (0..values.len()).map(at).collect()
}

/// The links of an arm along a stretch.
pub(crate) struct Links {
    /// As well as it can be told.
    pub motion: Motion,
    /// Every link behind its motor: a joint's own twin is driven by its motor.
    behind: Motion,
    /// As it would be with the gears softer of those links that no encoder shows.
    softer: Motion,
    /// Of each joint, whether that is so.
    is_unseen: Vec<bool>,
    /// Step and noise of the encoders that show the links, joint side; none where their rounding is not asked for.
    encoders: Vec<[f64; 2]>,
    cutoff_hz: f64,
}

impl Links {
    /// From what the encoders say, but for faults that the robot file tells of them.
    pub fn of(robot: &Robot, shown: &[Position], rate_hz: f64) -> Result<Self, FilterError> {
        let nominal = (0..shown.len()).map(|joint| JointModel::nominal(robot, joint));
        let nominal: Vec<JointModel> = nominal.collect();
        let really = shown.iter().zip(&nominal);
        let really: Vec<Position> = really
            .map(|(position, model)| position.without_faults(model, rate_hz))
            .collect();
        let motors: Vec<Vec<f64>> = really.iter().map(|p| p.motor_rad.clone()).collect();
        let gears = really.iter().zip(nominal);
        let gears: Vec<Option<JointModel>> = gears
            .map(|(position, model)| (!position.is_of_link).then_some(model))
            .collect();
        let of_motors = Motion::of(&motors, rate_hz)?;
        let behind = of_motors.behind_gears(&robot.chain, &gears)?;
        let mut links = Self {
            motion: behind.clone(),
            softer: behind.clone(),
            behind,
            is_unseen: gears.iter().map(Option::is_some).collect(),
            encoders: robot.joints.iter().map(motor_encoder).collect(),
            cutoff_hz: Band::at(rate_hz).cutoff_hz,
        };
        if really.len() > 1 {
            for (joint, (position, file)) in really.iter().zip(&robot.joints).enumerate() {
                links.see(joint, position, file, rate_hz)?;
            }
            let unseen = || links.is_unseen.iter().zip(&gears);
            if unseen().any(|(is_unseen, _)| *is_unseen) {
                let softer = unseen().map(|(is_unseen, gear)| {
                    let mut gear = gear.clone()?;
                    if *is_unseen {
                        gear.stiffness_nm_rad *= SOFTER;
                    }
                    Some(gear)
                });
                let softer: Vec<Option<JointModel>> = softer.collect();
                let softer = of_motors.behind_gears(&robot.chain, &softer)?;
                links.softer = links.motion.clone();
                for joint in (0..gears.len()).filter(|joint| links.is_unseen[*joint]) {
                    links.softer = links.softer.with_own(&softer, joint);
                }
            }
        }
        Ok(links)
    }

    /// Every link where its motor is, for what is asked of the rigid bodies only.
    pub fn rigid(robot: &Robot, shown: &[Position], rate_hz: f64) -> Result<Self, FilterError> {
        let really = shown.iter().enumerate().map(|(joint, position)| {
            let model = JointModel::nominal(robot, joint);
            position.without_faults(&model, rate_hz).motor_rad
        });
        let motion = Motion::of(&really.collect::<Vec<_>>(), rate_hz)?;
        Ok(Self {
            behind: motion.clone(),
            softer: motion.clone(),
            motion,
            is_unseen: vec![false; shown.len()],
            encoders: Vec::new(),
            cutoff_hz: Band::at(rate_hz).cutoff_hz,
        })
    }

    /// Where its own encoder shows how a link swings, nothing needs to be known of the gear.
    fn see(
        &mut self,
        joint: usize,
        position: &Position,
        file: &RobotJoint,
        rate_hz: f64,
    ) -> Result<(), FilterError> {
        let moving_rad_s2 = self.behind.acceleration_rad_s2(joint);
        let encoder =
            link_encoder(file).filter(|encoder| tells_swing(*encoder, moving_rad_s2, rate_hz));
        let link_rad = position.link_rad.as_ref();
        let link_rad = link_rad.filter(|link_rad| agree(link_rad, &position.motor_rad));
        if let Some((link_rad, encoder)) = link_rad.zip(encoder) {
            self.motion.set(joint, link_rad)?;
            self.is_unseen[joint] = false;
            self.encoders[joint] = encoder;
        }
        Ok(())
    }

    /// What a joint carries.
    pub fn load(&self, chain: &Chain, joint: usize) -> Load {
        self.motion.with_own(&self.behind, joint).load(chain, joint)
    }

    /// By how much its load is another with softer gears of the other links that no encoder shows: what nobody can know of how
    /// they swing. Little where they follow their motors, all of it and more near the resonance.
    pub fn unseen_nm(&self, chain: &Chain, joint: usize, load: &Load) -> Vec<f64> {
        let mut others = (0..self.is_unseen.len()).filter(|other| *other != joint);
        if !others.any(|other| self.is_unseen[other]) {
            return vec![0.0; load.coupling_nm.len()];
        }
        let softer = self.softer.with_own(&self.behind, joint);
        let softer = softer.load(chain, joint);
        let both = load.coupling_nm.iter().zip(&softer.coupling_nm);
        both.map(|(as_told_nm, softer_nm)| as_told_nm - softer_nm)
            .collect()
    }

    /// Torque on a joint that rounding of the other joints' encoders pretends, root mean square.
    pub fn rounding_nm(&self, chain: &Chain, joint: usize, samples: usize) -> Vec<f64> {
        if self.encoders.is_empty() {
            return vec![0.0; samples];
        }
        self.motion
            .rounding_nm(chain, joint, &self.encoders, self.cutoff_hz)
    }
}

/// Step and noise of the motor's encoder, joint side.
fn motor_encoder(joint: &RobotJoint) -> [f64; 2] {
    let step_rad = joint.motor_encoder_resolution_rad.unwrap_or(0.0);
    [step_rad, joint.position_noise_rad].map(|of_motor| of_motor / joint.gear_ratio)
}

/// Step and noise of the link's encoder, where the robot file tells them.
fn link_encoder(joint: &RobotJoint) -> Option<[f64; 2]> {
    let step_rad = joint.link_encoder_resolution_rad?;
    Some([step_rad, joint.position_noise_rad])
}

/// Whether an encoder's step and noise are small beside a motion's acceleration within the band that is compared.
fn tells_swing([step_rad, noise_rad]: [f64; 2], moving_rad_s2: &[f64], rate_hz: f64) -> bool {
    let cutoff_hz = Band::at(rate_hz).cutoff_hz;
    let reading_rad = (step_rad.powi(2) / 12.0 + noise_rad.powi(2)).sqrt();
    let blur_rad_s2 = (std::f64::consts::TAU * cutoff_hz).powi(2)
        * reading_rad
        * (2.0 * cutoff_hz / rate_hz).sqrt();
    let square: f64 = moving_rad_s2.iter().map(|x| x * x).sum();
    blur_rad_s2.powi(2) < BLUR_PART.powi(2) * square / moving_rad_s2.len().max(1) as f64
}

/// Whether two encoders of one joint show the same motion, but for what gears twist and zeros are off.
fn agree(link_rad: &[f64], motor_rad: &[f64]) -> bool {
    let mut both = link_rad.iter().zip(motor_rad);
    both.all(|(link_rad, motor_rad)| (link_rad - motor_rad).abs() < AGREE_RAD)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    #[test]
    fn an_encoder_tells_a_swing_if_it_is_fine_and_agrees_with_the_other() {
        let moving_rad_s2: Vec<f64> = (0..1500)
            .map(|k| 5.0 * (0.01 * f64::from(k)).sin())
            .collect();
        let step_rad = |bits: i32| std::f64::consts::TAU / 2.0_f64.powi(bits);
        assert!(tells_swing([step_rad(20), 0.0], &moving_rad_s2, 1500.0));
        assert!(!tells_swing([step_rad(12), 0.0], &moving_rad_s2, 1500.0));
        assert!(!tells_swing([step_rad(20), 1e-3], &moving_rad_s2, 1500.0));
        let motor_rad = [0.0, 0.5, 1.0];
        assert!(agree(&[0.01, 0.51, 0.99], &motor_rad));
        // one of them turns the other way, or was counted from another zero
        assert!(!agree(&[0.0, -0.5, -1.0], &motor_rad));
    }

    #[test]
    fn faults_that_the_file_tells_are_taken_off_what_encoders_show() {
        let mut robot = robot::load("shd17").unwrap();
        let ratio = robot.joints[0].gear_ratio;
        let motor_rad: Vec<f64> = (0..3000).map(|k| 1e-3 * f64::from(k)).collect();
        let at_rate_hz = 1000.0;
        let fault = |turned_rad: f64| 1e-3 * (2.0 * turned_rad + 0.3).sin();
        let late = 4;
        let before = |k: usize| motor_rad[k.max(late) - late];
        let shown = Position {
            motor_rad: (0..3000)
                .map(|k| before(k) + fault(before(k) * ratio) / ratio)
                .collect(),
            link_rad: Some((0..3000).map(before).collect()),
            is_whole: vec![true; 3000],
            is_of_link: false,
        };
        robot.joints[0].effects.extend([
            robot::Effect::EncoderEccentricity {
                amplitude_rad: 1e-3,
                cycles_per_rev: 2.0,
                phase_rad: 0.3,
                side: robot::EncoderSide::Motor,
            },
            robot::Effect::SensorDelay {
                delay_s: late as f64 / at_rate_hz,
                side: Some(robot::LateSide::Both),
            },
        ]);
        let model = JointModel::nominal(&robot, 0);
        let really = shown.without_faults(&model, at_rate_hz);
        let link_rad = really.link_rad.unwrap();
        for k in 0..2990 {
            // the fault is taken where the encoder says it is, not where it is: off by its own square
            let off_rad = really.motor_rad[k] - motor_rad[k];
            assert!(off_rad.abs() < 1e-5 / ratio, "{k}: {off_rad}");
            assert!((link_rad[k] - motor_rad[k]).abs() < 1e-12);
        }
    }

    #[test]
    fn what_swings_unseen_is_what_the_gears_spring_makes_of_the_motion() {
        let robot = robot::load("pa10").unwrap();
        let at = |joint: usize, k: usize| {
            let time_s = k as f64 / 1000.0;
            0.2 * (5.0 * time_s + joint as f64).sin()
        };
        let shown: Vec<Position> = (0..7)
            .map(|joint| Position {
                motor_rad: (0..4000).map(|k| at(joint, k)).collect(),
                link_rad: None,
                is_whole: vec![true; 4000],
                is_of_link: false,
            })
            .collect();
        let rms_nm = |shown: &[Position]| {
            let links = Links::of(&robot, shown, 1000.0).unwrap();
            let load = links.load(&robot.chain, 1);
            let unseen_nm = links.unseen_nm(&robot.chain, 1, &load);
            let square: f64 = unseen_nm[500..3500].iter().map(|x| x * x).sum();
            (square / 3000.0).sqrt()
        };
        let unseen_nm = rms_nm(&shown);
        assert!(unseen_nm > 1e-4, "{unseen_nm}");
        // behind the gear there is nothing to guess
        let behind: Vec<Position> = shown
            .into_iter()
            .map(|position| Position {
                is_of_link: true,
                ..position
            })
            .collect();
        assert_eq!(rms_nm(&behind), 0.0);
    }
}
