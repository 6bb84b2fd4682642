//! A stretch at fewer samples, for runs that are compared with each other only: where rows come faster than a coarse substep is
//! long, it is one over several of them.

use joint_model::friction::Sliding;

use crate::joint::JointModel;
use crate::load::Load;
use crate::observe::Band;
use crate::simulate::{Between, Drive, Feedback, Trace};

/// Part by which falling friction may make the rotor faster within a step, at most: friction acts through a step as it is at its
/// beginning, and a joint that sticks and slips would do so otherwise.
const FASTER_MOST: f64 = 0.5;
/// Speeds at which that is looked at, each so many times the one before.
const SPEEDS_RAD_S: [f64; 2] = [1e-3, 1.0];
const SPEEDS_FACTOR: f64 = 1.25;

/// What a run is made of, at every so many samples.
pub(super) struct Thinned {
    pub every: usize,
    pub drive: Drive,
    pub tracking: Feedback,
    /// As the robot file has it.
    pub load: Load,
    pub band: Band,
}

impl Thinned {
    /// None where samples are no closer than coarse substeps, or the joint's friction falls so steeply that several of them are too
    /// long a step.
    pub fn of(
        model: &JointModel,
        drive: &Drive,
        tracking: &Feedback,
        load: &Load,
        band: Band,
    ) -> Option<Self> {
        let every = band.every_coarse();
        let step_s = every as f64 * drive.period_s;
        if every < 2 || step_s * falls_per_s(model) > FASTER_MOST {
            return None;
        }
        let thin = |values: &[f64]| -> Vec<f64> { values.iter().step_by(every).copied().collect() };
        let command_nm = match drive.between {
            // together they do as much as one that stays as long
            Between::Stays => {
                let together = drive.command_nm.chunks(every);
                let mean = |commands: &[f64]| commands.iter().sum::<f64>() / commands.len() as f64;
                together.map(mean).collect()
            }
            Between::Line => thin(&drive.command_nm),
        };
        Some(Self {
            every,
            drive: Drive {
                period_s: step_s,
                motor_rad: thin(&drive.motor_rad),
                link_rad: drive.link_rad.as_deref().map(thin),
                command_nm,
                ..*drive
            },
            tracking: Feedback {
                delay_samples: tracking.delay_samples / every as f64,
                smooth_rad: tracking.smooth_rad.as_deref().map(thin),
                ..tracking.clone()
            },
            load: Load {
                position_rad: thin(&load.position_rad),
                velocity_rad_s: thin(&load.velocity_rad_s),
                inertia_kg_m2: thin(&load.inertia_kg_m2),
                torque_nm: thin(&load.torque_nm),
                coupling_nm: thin(&load.coupling_nm),
                slope_nm_rad: thin(&load.slope_nm_rad),
            },
            band: Band {
                rate_hz: band.rate_hz / every as f64,
                ..band
            },
        })
    }

    /// Puts what held the rotor where it would be at every sample: it is the mean since the sample before, whose middle is earlier
    /// the further that is away.
    pub fn put_right(&self, trace: &mut Trace) {
        let later = 0.5 * (1.0 - 1.0 / self.every as f64);
        let holding_nm = &mut trace.holding_nm;
        for k in 1..holding_nm.len() {
            holding_nm[k - 1] += later * (holding_nm[k] - holding_nm[k - 1]);
        }
    }
}

/// How quickly falling friction makes the rotor alone faster: the most that a difference in speed grows, per second and as a part of
/// itself.
fn falls_per_s(model: &JointModel) -> f64 {
    let [slowest, fastest] = SPEEDS_RAD_S;
    let speeds = std::iter::successors(Some(slowest), |speed| Some(SPEEDS_FACTOR * speed));
    let speeds = speeds.take_while(|speed| *speed < fastest);
    let level_nm = |velocity_rad_s: f64| model.friction.level_nm(&Sliding::at(velocity_rad_s));
    let steepest = speeds
        .flat_map(|speed| [speed, -speed])
        .map(|speed| {
            let faster = SPEEDS_FACTOR * speed;
            (level_nm(speed) - level_nm(faster)) / (faster - speed).abs()
        })
        .fold(0.0, f64::max);
    steepest / model.rotor_inertia_kg_m2
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use std::collections::BTreeMap;

    use made_up::robot;
    use recording::{JointColumns, Recording, Signal};
    use robot::Effect;

    use super::{FASTER_MOST, falls_per_s};
    use crate::joint::JointModel;
    use crate::signal::difference;
    use crate::stretch::stretches;
    use crate::{Changes, JointTwin};

    const RATE_HZ: f64 = 1500.0;

    /// The motor moves in sines under a torque of its own: what holds a twin on that is compared as well.
    fn recorded(seconds: f64) -> Recording {
        let time_s: Vec<f64> = (0..(seconds * RATE_HZ) as usize)
            .map(|row| row as f64 / RATE_HZ)
            .collect();
        let motor_rad =
            |time_s: &f64| 100.0 * (0.4 * (2.0 * time_s).sin() + 0.1 * (7.0 * time_s).sin());
        let motor_nm = |time_s: &f64| 0.1 * (2.0 * time_s).cos();
        let signals = [
            (
                Signal::MotorPositionRad,
                time_s.iter().map(motor_rad).collect(),
            ),
            (Signal::MotorTorqueNm, time_s.iter().map(motor_nm).collect()),
        ];
        Recording {
            segment: None,
            joints: vec![JointColumns {
                name: "joint1".to_owned(),
                signals: BTreeMap::from(signals),
            }],
            time_s,
            sample_rate_hz: RATE_HZ,
            metadata: BTreeMap::new(),
            truncated: false,
        }
    }

    #[test]
    fn a_joint_that_sticks_and_slips_is_not_run_over_several_samples() {
        let robot = ::robot::load("pa10").unwrap();
        // only that of the last joint is less the faster it turns
        for (joint, sticks) in [(5, false), (6, true)] {
            let model = JointModel::nominal(&robot, joint);
            let part = falls_per_s(&model) / 750.0;
            assert_eq!(part > FASTER_MOST, sticks, "{part}");
        }
    }

    #[test]
    fn effects_respond_over_several_samples_as_over_each() {
        let robot = robot();
        let recording = recorded(12.0);
        let stretches = stretches(&[&recording], &robot).unwrap();
        let twin = JointTwin::new(&robot, 0, &stretches).unwrap().unwrap();
        assert!(twin.pieces[0].thinned.is_some());
        let effects = [
            Effect::CoulombFriction { coulomb_nm: 0.5 },
            Effect::ViscousFriction {
                viscous_nm_s_rad: 0.3,
            },
            Effect::LinkInertia {
                inertia_kg_m2: 0.05,
            },
            Effect::Payload {
                mass_kg: 0.5,
                centre_m: [0.0, 0.0, 0.2],
            },
            Effect::CommandDelay { delay_s: 2e-3 },
            Effect::SensorDelay {
                delay_s: 2e-3,
                side: None,
            },
        ];
        let rms = |values: &[f64]| {
            (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt()
        };
        for effect in effects {
            let changed = Changes {
                effects: vec![effect],
                ..Changes::default()
            };
            let nominal = Changes::default();
            let [fine, coarse] = [
                difference(
                    &twin.simulated(&changed, None).unwrap(),
                    &twin.simulated(&nominal, None).unwrap(),
                ),
                difference(
                    &twin.coarsely(&changed).unwrap(),
                    &twin.coarsely(&nominal).unwrap(),
                ),
            ];
            let off = rms(&difference(&coarse, &fine)) / rms(&fine);
            assert!(off < 0.05, "{effect:?}: {off}");
        }
    }
}
