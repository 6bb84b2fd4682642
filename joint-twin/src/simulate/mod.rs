//! One joint simulated along a recording, with the controller that ran on it.
//!
//! The joint gets the recorded command plus what a controller adds for the difference between recorded and simulated
//! position, `K_p·e + K_d·F[ė]`, `e = q_rec - q_sim`. There are two:
//!
//! - The robot file's, through the drive as the command ([`Way::Commanded`]). For a controller that is linear in the
//!   measured motion this *is* its closed loop, whatever it fed forward, so nothing needs to be known of that.
//! - One of our own that holds the simulation on the recorded motion, by a spring and a damper on the rotor
//!   ([`Way::Held`]): it knows the recording's future and acts in every substep, so neither a delay of drive or sensors nor a
//!   low rate makes it unstable, and its torque is told, so that it can be counted as a disturbance.
//!
//! Motor and link are two masses with the gear between them, in implicit steps: spring, damping and friction act with
//! their values at the end of a step, so no stiffness asks for a smaller one. Friction is a spring that slips
//! (elasto-plastic: Dupont, Hayward, Armstrong, Altpeter, IEEE Trans. Automatic Control 47 (2002) 787-792).

mod drive;
mod hold;
mod load_step;

use joint_model::filter::Butterworth;
use joint_model::friction::{Direction, Sliding};
use joint_model::harmonic;

use crate::joint::JointModel;
use crate::load::Load;
pub use drive::{Between, Drive};
use drive::{Held, between, smoothly_between};
use hold::Hold;
use load_step::LoadStep;

/// Feedback on the measured position, joint side.
#[derive(Clone, Debug, PartialEq)]
pub struct Feedback {
    /// On position.
    pub proportional_nm_rad: f64,
    /// On velocity.
    pub derivative_nm_s_rad: f64,
    /// On the backward difference.
    pub velocity_filter: Option<Butterworth>,
    /// The link encoder instead of the motor's.
    pub on_link: bool,
    /// Samples from a measurement to the beginning of its command.
    pub delay_samples: f64,
    /// How its torque reaches the joint.
    pub way: Way,
    /// What the rotor is held on instead of the recorded motion, joint side, if anything.
    pub smooth_rad: Option<Vec<f64>>,
}

/// How a feedback's torque reaches the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Through the drive, on what the sensors show.
    Commanded,
    /// On the rotor, beside the drive and without delay, along the recorded motion as it curves from sample to sample.
    Held,
}

/// What the simulated sensors showed, joint side.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trace {
    /// Motor encoder over the gear ratio.
    pub motor_rad: Vec<f64>,
    /// Link encoder.
    pub link_rad: Vec<f64>,
    /// Torque sent.
    pub command_nm: Vec<f64>,
    /// Torque the drive reports.
    pub torque_nm: Vec<f64>,
    /// Torque that holds the simulation on the recorded motion, seen as the drive's is.
    pub holding_nm: Vec<f64>,
    /// Torque in the gear's output.
    pub joint_torque_nm: Vec<f64>,
}

/// Random numbers of the sensors.
pub trait Noise {
    /// Of mean 0 and variance 1.
    fn normal(&mut self) -> f64;
    /// Between 0 and 1.
    fn uniform(&mut self) -> f64;
}

/// How long substeps are at most: friction and gear are implicit, so this is for accuracy only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Substeps {
    /// For what is compared with a recording.
    Fine,
    /// For what is compared with another simulation, of the same substeps.
    Coarse,
}

impl Substeps {
    pub(crate) fn longest_s(self) -> f64 {
        match self {
            Self::Fine => 4e-4,
            Self::Coarse => 1.4e-3,
        }
    }
}

/// Twist by which the gear's slope is found.
const PROBE_RAD: f64 = 1e-7;
/// Commands and positions that are remembered for delays.
const HISTORY: usize = 256;

/// Simulates the joint along a recording. Sensors are quantised and noisy only with `noise`; without it they are exact,
/// as regressors want them. What they showed is in `trace`, whatever was there before.
pub fn simulate(
    model: &JointModel,
    feedback: &Feedback,
    drive: &Drive,
    load: &Load,
    substeps: Substeps,
    mut noise: Option<&mut dyn Noise>,
    trace: &mut Trace,
) {
    let samples = drive.motor_rad.len();
    trace.empty(samples);
    let mut joint = State::at_start(model, drive, load);
    if let Some(noise) = noise.as_deref_mut() {
        // nobody knows where an encoder's steps lie
        joint.rounding = [noise.uniform(), noise.uniform()];
    }
    let mut loop_ = Loop::new(feedback);
    let substeps = (drive.period_s / substeps.longest_s()).ceil().max(1.0) as usize;
    let step_s = drive.period_s / substeps as f64;
    let answer = if model.current_lag_s > 0.0 {
        -(-step_s / model.current_lag_s).exp_m1()
    } else {
        1.0
    };
    let delay = feedback.delay_samples + model.command_delay_s / drive.period_s;
    let held: Vec<(f64, Held)> = (0..substeps)
        .map(|substep| {
            let share = substep as f64 / substeps as f64;
            (share, Held::at(delay - share, 1.0 / substeps as f64))
        })
        .collect();
    let [motor_late_s, _] = model.encoder_delays_s;
    let ahead = (model.sensor_delay_s + motor_late_s) / drive.period_s;
    let along_rad = feedback.smooth_rad.as_ref().unwrap_or(&drive.motor_rad);
    for k in 0..samples {
        let measured = joint.measure(model, drive.period_s, noise.as_deref_mut());
        let added_nm = match feedback.way {
            Way::Commanded => loop_.torque_nm(feedback, drive, k, &measured),
            Way::Held => 0.0,
        };
        let command_nm = drive.command_nm[k] + added_nm;
        trace.push(&measured, command_nm);
        let kept = match noise.as_deref_mut() {
            Some(noise) => noise.uniform() >= model.dropped_commands,
            None => true,
        };
        joint.receive(command_nm, kept);
        let time_s = drive.start_s + k as f64 * drive.period_s;
        let along = LoadStep::from(load, k);
        let mut held_nm = 0.0;
        for (share, held) in &held {
            let now = k as f64 + share;
            let demand_nm = match (drive.between, feedback.way) {
                (Between::Line, Way::Held) => {
                    let middle = now + 0.5 / substeps as f64;
                    joint.limited_nm(model, between(&drive.command_nm, middle - delay))
                }
                _ => joint.demand_nm(model, held),
            };
            joint.drive_nm += answer * (demand_nm - joint.drive_nm);
            let hold = match feedback.way {
                Way::Commanded => Hold::default(),
                Way::Held => {
                    let next = now + 1.0 / substeps as f64;
                    let motor_rad = [now, next].map(|at| smoothly_between(along_rad, at + ahead));
                    let rotor = [joint.motor_rad, joint.motor_rad_s];
                    Hold::on(feedback, model, rotor, motor_rad, step_s)
                }
            };
            held_nm += joint.advance(model, &along, *share, &hold, time_s, step_s);
        }
        joint.holding_nm = held_nm / substeps as f64;
    }
}

impl Trace {
    /// With room for so many samples.
    fn empty(&mut self, samples: usize) {
        for column in [
            &mut self.motor_rad,
            &mut self.link_rad,
            &mut self.command_nm,
            &mut self.torque_nm,
            &mut self.holding_nm,
            &mut self.joint_torque_nm,
        ] {
            column.clear();
            column.reserve(samples);
        }
    }

    fn push(&mut self, measured: &Measured, command_nm: f64) {
        self.motor_rad.push(measured.motor_rad);
        self.link_rad.push(measured.link_rad);
        self.torque_nm.push(measured.torque_nm);
        self.holding_nm.push(measured.holding_nm);
        self.command_nm.push(command_nm);
        self.joint_torque_nm.push(measured.joint_torque_nm);
    }
}

#[derive(Clone, Copy, Debug)]
struct Measured {
    motor_rad: f64,
    link_rad: f64,
    torque_nm: f64,
    holding_nm: f64,
    joint_torque_nm: f64,
}

impl Measured {
    /// From motor and link angle, drive's and joint's torque, and what holds.
    fn of(model: &JointModel, seen: [f64; 5]) -> Self {
        let [motor_rad, link_rad, torque_nm, joint_torque_nm, holding_nm] = seen;
        Self {
            motor_rad: motor_rad + model.motor_fault_rad(motor_rad),
            link_rad: link_rad + model.link_fault_rad(link_rad),
            torque_nm,
            joint_torque_nm,
            holding_nm,
        }
    }
}

/// The controller, as a difference to what was recorded.
struct Loop {
    filter: Option<Butterworth>,
    error_before_rad: f64,
}

impl Loop {
    fn new(feedback: &Feedback) -> Self {
        Self {
            filter: feedback.velocity_filter.clone(),
            error_before_rad: 0.0,
        }
    }

    /// For the recording at a sample.
    fn torque_nm(
        &mut self,
        feedback: &Feedback,
        drive: &Drive,
        sample: usize,
        measured: &Measured,
    ) -> f64 {
        let error_rad = match &drive.link_rad {
            Some(link_rad) if feedback.on_link => link_rad[sample] - measured.link_rad,
            _ => drive.motor_rad[sample] - measured.motor_rad,
        };
        let difference_rad_s = (error_rad - self.error_before_rad) / drive.period_s;
        self.error_before_rad = error_rad;
        let rate_rad_s = match &mut self.filter {
            Some(filter) => filter.step(difference_rad_s),
            None => difference_rad_s,
        };
        feedback.proportional_nm_rad * error_rad + feedback.derivative_nm_s_rad * rate_rad_s
    }
}

/// The joint's state, joint side.
struct State {
    motor_rad: f64,
    motor_rad_s: f64,
    link_rad: f64,
    link_rad_s: f64,
    /// Torque of the current loop.
    drive_nm: f64,
    /// Torque that holds the simulation on the recorded motion.
    holding_nm: f64,
    joint_torque_nm: f64,
    /// How far friction has bent before it slips.
    bent_rad: f64,
    hysteresis_nm: f64,
    /// Where the encoders' steps lie, as parts of one: motor's and link's.
    rounding: [f64; 2],
    commands_nm: [f64; HISTORY],
    /// As [`Measured::of`] takes them: encoders first.
    seen: [[f64; 5]; HISTORY],
    /// How fast the encoders turned then.
    turning_rad_s: [[f64; 2]; HISTORY],
    newest: usize,
}

impl State {
    /// On the recorded motion, the gear wound up by the load.
    fn at_start(model: &JointModel, drive: &Drive, load: &Load) -> Self {
        let load_nm = load.torque_nm.first().copied().unwrap_or(0.0);
        let shown_rad = drive.motor_rad.first().copied().unwrap_or(0.0);
        // what the encoder shows of its own faults turns little with the angle
        let motor_rad = (0..4).fold(shown_rad, |motor_rad, _| {
            shown_rad - model.motor_fault_rad(motor_rad)
        });
        let velocity_rad_s = load.velocity_rad_s.first().copied().unwrap_or(0.0);
        let (error_rad, _) = model.kinematic_error(motor_rad * model.gear_ratio);
        let link_rad = motor_rad + error_rad - model.torsion_rad(load_nm);
        let command_nm = drive.command_nm.first().copied().unwrap_or(0.0);
        Self {
            motor_rad,
            motor_rad_s: velocity_rad_s,
            link_rad,
            link_rad_s: velocity_rad_s,
            drive_nm: command_nm,
            holding_nm: 0.0,
            joint_torque_nm: load_nm,
            bent_rad: 0.0,
            hysteresis_nm: 0.0,
            rounding: [0.0; 2],
            commands_nm: [command_nm; HISTORY],
            seen: [[motor_rad, link_rad, command_nm, load_nm, 0.0]; HISTORY],
            turning_rad_s: [[velocity_rad_s; 2]; HISTORY],
            newest: 0,
        }
    }

    fn measure(
        &mut self,
        model: &JointModel,
        period_s: f64,
        noise: Option<&mut (dyn Noise + '_)>,
    ) -> Measured {
        self.newest = (self.newest + 1) % HISTORY;
        // so little later that the link turns on as it does
        let link_rad = self.link_rad
            + self.stand_in_twist_rad(model)
            + model.link_skew_s * self.link_rad_s
            + model.link_zero_rad;
        self.seen[self.newest] = [
            self.motor_rad,
            link_rad,
            self.drive_nm,
            self.joint_torque_nm,
            self.holding_nm,
        ];
        self.turning_rad_s[self.newest] = [self.motor_rad_s, self.link_rad_s];
        let mut seen = self.seen[self.newest];
        for (signal, seen) in seen.iter_mut().enumerate() {
            *seen = match model.encoder_delays_s.get(signal) {
                Some(more_s) => {
                    let late_s = model.sensor_delay_s + more_s;
                    turned_rad(late_s / period_s, |age| {
                        let at = self.index(age);
                        [
                            self.seen[at][signal],
                            self.turning_rad_s[at][signal] * period_s,
                        ]
                    })
                }
                None => delayed(model.sensor_delay_s / period_s, |age| {
                    self.seen[self.index(age)][signal]
                }),
            };
        }
        let shown = Measured::of(model, seen);
        let Some(noise) = noise else {
            return shown;
        };
        let noisy = |value: f64, deviation: f64, step: f64, place: f64, normal: f64| {
            let value = value + deviation * normal;
            if step > 0.0 {
                ((value / step + place).round() - place) * step
            } else {
                value
            }
        };
        let ratio = model.gear_ratio;
        Measured {
            motor_rad: noisy(
                shown.motor_rad,
                model.position_noise_rad / ratio,
                model.motor_resolution_rad / ratio,
                self.rounding[0],
                noise.normal(),
            ),
            link_rad: noisy(
                shown.link_rad,
                model.position_noise_rad,
                model.link_resolution_rad,
                self.rounding[1],
                noise.normal(),
            ),
            torque_nm: shown.torque_nm + ratio * model.torque_noise_nm * noise.normal(),
            ..shown
        }
    }

    /// Twist of the spring that stands for a gear of which no stiffness is known: the real one is taken to have none.
    fn stand_in_twist_rad(&self, model: &JointModel) -> f64 {
        if model.stiffness_is_known {
            0.0
        } else {
            self.joint_torque_nm / model.stiffness_nm_rad
        }
    }

    fn index(&self, age: usize) -> usize {
        (self.newest + HISTORY - age.min(HISTORY - 1)) % HISTORY
    }

    fn receive(&mut self, command_nm: f64, kept: bool) {
        let before = self.commands_nm[self.index(1)];
        self.commands_nm[self.newest] = if kept { command_nm } else { before };
    }

    /// Torque that the drive is to make in a substep.
    fn demand_nm(&self, model: &JointModel, held: &Held) -> f64 {
        let command_nm = |age: usize| self.limited_nm(model, self.commands_nm[self.index(age)]);
        let older_nm = command_nm(held.older);
        older_nm + held.share_of_newer * (command_nm(held.newer) - older_nm)
    }

    fn limited_nm(&self, model: &JointModel, command_nm: f64) -> f64 {
        let limit_nm = model.torque_limit_nm * model.gear_ratio;
        command_nm.clamp(-limit_nm, limit_nm)
    }

    /// Motor and link to the end of a substep. Returns the torque that held the rotor.
    fn advance(
        &mut self,
        model: &JointModel,
        load: &LoadStep,
        share: f64,
        hold: &Hold,
        time_s: f64,
        step_s: f64,
    ) -> f64 {
        let motor_angle_rad = self.motor_rad * model.gear_ratio;
        // what repeats with the angle acts at that of the middle of the substep, or it comes late as the joint turns
        let middle_rad = motor_angle_rad + 0.5 * step_s * self.motor_rad_s * model.gear_ratio;
        let shaft_nm = model.torque_gain * self.drive_nm
            + model.torque_offset_nm
            + hold.torque_nm
            + model.gear_ratio * harmonic::sum(&model.torque_ripple, middle_rad);
        let link = load.at(model, share, self.link_rad);
        let level = |direction: Direction, load_nm: f64, speed_rad_s: f64| {
            let drift_nm = model.drift.map_or(0.0, |drift| drift.change_nm(time_s));
            let at = Sliding {
                speed_rad_s,
                direction,
                load_nm,
                motor_position_rad: middle_rad,
            };
            (model.friction.level_nm(&at) + drift_nm).max(0.0)
        };
        let (error_rad, slope) = model.kinematic_error(motor_angle_rad);
        let lever = 1.0 + slope * model.gear_ratio;
        let torsion_rad = self.motor_rad + error_rad - self.link_rad;
        let gear = self.gear(model, torsion_rad, lever, step_s);
        // the link's velocity at the end is `a + b·motor velocity`
        let coupling = gear.slope_nm_s_rad * step_s;
        let mass = link.inertia_kg_m2 + coupling;
        let per_mass = 1.0 / mass;
        let a = (link.inertia_kg_m2 * self.link_rad_s + step_s * (gear.torque_nm - link.torque_nm))
            * per_mass;
        let b = coupling * lever * per_mass;
        let inertia = model.rotor_inertia_kg_m2
            + lever * coupling * (lever - b)
            + step_s * hold.drag_nm_s_rad;
        let drive_nm = shaft_nm - lever * (gear.torque_nm - gear.slope_nm_s_rad * a);
        let before_rad_s = self.motor_rad_s;
        self.turn(
            model,
            &level,
            gear.torque_nm,
            model.rotor_inertia_kg_m2 * before_rad_s + step_s * drive_nm,
            inertia,
            step_s,
        );
        let link_rad_s = a + b * self.motor_rad_s;
        let twist_rad = step_s * (lever * self.motor_rad_s - link_rad_s);
        if let Some(hysteresis) = &model.hysteresis {
            self.hysteresis_nm = hysteresis.advance_nm(self.hysteresis_nm, twist_rad);
        }
        self.joint_torque_nm =
            gear.torque_nm + gear.slope_nm_s_rad * (lever * self.motor_rad_s - link_rad_s);
        self.motor_rad += step_s * self.motor_rad_s;
        self.link_rad_s = link_rad_s;
        self.link_rad += step_s * link_rad_s;
        hold.torque_nm - hold.drag_nm_s_rad * self.motor_rad_s
    }

    /// Motor velocity at the end of a substep from its momentum without friction.
    fn turn(
        &mut self,
        model: &JointModel,
        level: &impl Fn(Direction, f64, f64) -> f64,
        load_nm: f64,
        momentum: f64,
        inertia: f64,
        step_s: f64,
    ) {
        let speed_rad_s = self.motor_rad_s.abs();
        let inertia = inertia + step_s * model.friction.fluid_drag_nm_s_rad(self.motor_rad_s);
        let direction = Direction::of(momentum);
        let level_nm = level(direction, load_nm, speed_rad_s);
        let bend_rad = model.presliding_rad;
        let stiffness = level_nm * (1.0 / bend_rad);
        let sticking_rad_s = (momentum - step_s * stiffness * self.bent_rad)
            / (inertia + step_s * step_s * stiffness);
        let bent_rad = self.bent_rad + step_s * sticking_rad_s;
        if bent_rad.abs() <= bend_rad {
            self.motor_rad_s = sticking_rad_s;
            self.bent_rad = bent_rad;
        } else {
            self.motor_rad_s = (momentum - step_s * level_nm.copysign(bent_rad)) / inertia;
            self.bent_rad = bend_rad.copysign(bent_rad);
        }
    }

    fn gear(&self, model: &JointModel, torsion_rad: f64, lever: f64, step_s: f64) -> Gear {
        let elastic_nm = model.elastic_nm(torsion_rad);
        let stiffness = if model.is_linear() {
            model.stiffness_nm_rad
        } else {
            let beside_nm = model.elastic_nm(torsion_rad + PROBE_RAD.copysign(torsion_rad));
            (beside_nm - elastic_nm).abs() / PROBE_RAD
        };
        let rate_rad_s = lever * self.motor_rad_s - self.link_rad_s;
        let damping = model
            .structural_damping
            .map_or(0.0, |damping| damping.coefficient_nm_s_rad(rate_rad_s));
        let memory = model.hysteresis.map_or(0.0, |hysteresis| {
            0.5 * hysteresis.width_nm / hysteresis.yield_rad
        });
        Gear {
            torque_nm: elastic_nm + self.hysteresis_nm,
            slope_nm_s_rad: step_s * (stiffness + memory) + damping,
        }
    }
}

/// The gear in a substep: `torque + slope·rate` with the rate at its end.
struct Gear {
    torque_nm: f64,
    slope_nm_s_rad: f64,
}

/// An angle so many periods ago, by the angles and turns a period of so many periods' age: a cubic between two that turns as both did
/// (Hermite). What is yet to come turns on, as much faster or slower as in the last period.
fn turned_rad(periods: f64, at: impl Fn(usize) -> [f64; 2]) -> f64 {
    if periods <= 0.0 {
        let [[now, turn], [_, turn_before]] = [at(0), at(1)];
        return now - periods * (turn - 0.5 * periods * (turn - turn_before));
    }
    let whole = periods as usize;
    let [[after, turn_after], [before, turn_before]] = [at(whole), at(whole + 1)];
    let t = 1.0 - (periods - whole as f64);
    let way = after - before;
    let [bend, twist] = [
        3.0 * way - 2.0 * turn_before - turn_after,
        turn_before + turn_after - 2.0 * way,
    ];
    before + t * (turn_before + t * (bend + t * twist))
}

/// Between the remembered values around an age.
fn delayed(periods: f64, at: impl Fn(usize) -> f64) -> f64 {
    let whole = periods as usize;
    let share = periods - whole as f64;
    at(whole) + share * (at(whole + 1) - at(whole))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use robot::{Effect, EncoderSide};

    use super::*;
    use crate::control;

    const SECONDS: f64 = 6.0;

    /// A bench along these positions, told by its motor's encoder at a rate, under a load and without a command.
    fn along(
        model: &JointModel,
        [rate_hz, load_nm]: [f64; 2],
        substeps: Substeps,
        at: fn(f64) -> f64,
    ) -> Trace {
        let samples = (SECONDS * rate_hz) as usize;
        let drive = Drive {
            period_s: 1.0 / rate_hz,
            command_nm: vec![0.0; samples],
            motor_rad: (0..samples).map(|k| at(k as f64 / rate_hz)).collect(),
            ..Drive::default()
        };
        driven(model, &drive, load_nm, substeps)
    }

    fn driven(model: &JointModel, drive: &Drive, load_nm: f64, substeps: Substeps) -> Trace {
        let robot = robot::load("shd17").unwrap();
        let motor_rad = drive.motor_rad.clone();
        let samples = motor_rad.len();
        let load = Load {
            position_rad: motor_rad,
            velocity_rad_s: vec![0.0; samples],
            inertia_kg_m2: vec![0.1; samples],
            torque_nm: vec![load_nm; samples],
            coupling_nm: vec![0.0; samples],
            slope_nm_rad: vec![0.0; samples],
        };
        let feedback = control::tracking(&robot, 0, 1.0 / drive.period_s);
        let mut trace = Trace::default();
        simulate(model, &feedback, drive, &load, substeps, None, &mut trace);
        trace
    }

    fn swing_rad(time_s: f64) -> f64 {
        0.4 * (std::f64::consts::TAU * 0.5 * time_s).sin()
    }

    fn nominal() -> JointModel {
        JointModel::nominal(&robot::load("shd17").unwrap(), 0)
    }

    #[test]
    fn coarse_substeps_respond_as_fine_ones_do() {
        let changed = nominal()
            .with(&Effect::CoulombFriction { coulomb_nm: 0.3 })
            .unwrap();
        // means of tenths of a second, once the start is over
        let holding_nm = |model: &JointModel, substeps| -> Vec<f64> {
            let trace = along(model, [1500.0, 0.0], substeps, swing_rad);
            let means = trace.holding_nm.chunks(150).skip(10);
            means.map(|some| some.iter().sum::<f64>() / 150.0).collect()
        };
        let response = |substeps| -> Vec<f64> {
            let before_nm = holding_nm(&nominal(), substeps);
            let after_nm = holding_nm(&changed, substeps);
            let both = after_nm.iter().zip(&before_nm);
            both.map(|(after, before)| after - before).collect()
        };
        let (fine, coarse) = (response(Substeps::Fine), response(Substeps::Coarse));
        let off: f64 = fine.iter().zip(&coarse).map(|(a, b)| (a - b).powi(2)).sum();
        let whole: f64 = fine.iter().map(|x| x * x).sum();
        let largest = fine.iter().copied().fold(0.0, f64::max);
        assert!((largest / 0.3 - 1.0).abs() < 0.05, "{largest}");
        assert!(off < 1e-3 * whole, "{off} of {whole}");
    }

    #[test]
    fn a_joint_is_held_on_its_motion_at_a_hundred_samples_a_second() {
        let trace = along(&nominal(), [100.0, 0.0], Substeps::Fine, swing_rad);
        for (k, motor_rad) in trace.motor_rad.iter().enumerate().skip(50) {
            let away_rad = motor_rad - swing_rad(k as f64 / 100.0);
            assert!(away_rad.abs() < 0.06, "sample {k}: {away_rad}");
        }
    }

    #[test]
    fn a_torque_stays_from_sample_to_sample_or_goes_on_in_a_line() {
        let mut prompt = nominal();
        prompt.current_lag_s = 0.0;
        let reported_nm = |between| {
            let drive = Drive {
                period_s: 0.01,
                motor_rad: vec![0.0; 100],
                command_nm: (0..100).map(|k| 0.01 * f64::from(k)).collect(),
                between,
                ..Drive::default()
            };
            let mut feedback = control::tracking(&robot::load("shd17").unwrap(), 0, 100.0);
            feedback.delay_samples = 0.0;
            let load = Load {
                position_rad: vec![0.0; 100],
                velocity_rad_s: vec![0.0; 100],
                inertia_kg_m2: vec![0.1; 100],
                torque_nm: vec![0.0; 100],
                coupling_nm: vec![0.0; 100],
                slope_nm_rad: vec![0.0; 100],
            };
            let mut trace = Trace::default();
            simulate(
                &prompt,
                &feedback,
                &drive,
                &load,
                Substeps::Fine,
                None,
                &mut trace,
            );
            trace.torque_nm
        };
        // just before sample 40 the command of sample 39 still acts; on a line it has come as far as a substep before 40
        let stays_nm = reported_nm(Between::Stays)[40];
        assert!((stays_nm - 0.39).abs() < 1e-9, "{stays_nm}");
        let on_line_nm = reported_nm(Between::Line)[40];
        assert!((on_line_nm - 0.4).abs() < 5e-4, "{on_line_nm}");
    }

    #[test]
    fn a_gear_of_unknown_stiffness_shows_no_twist() {
        let mut rigid = nominal();
        rigid.stiffness_is_known = false;
        let trace = along(&rigid, [1500.0, 20.0], Substeps::Fine, swing_rad);
        let twists = trace.motor_rad.iter().zip(&trace.link_rad);
        let largest_rad = twists
            .skip(50)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(largest_rad < 1e-6, "{largest_rad}");
        // under the same load a gear that is known twists
        let known = along(&nominal(), [1500.0, 20.0], Substeps::Fine, swing_rad);
        assert!((known.motor_rad[900] - known.link_rad[900]).abs() > 1e-4);
    }

    #[test]
    fn a_joint_at_rest_stands_where_its_faulty_encoder_shows_it() {
        let eccentric = nominal()
            .with(&Effect::EncoderEccentricity {
                amplitude_rad: 0.1,
                cycles_per_rev: 2.0,
                phase_rad: 0.4,
                side: EncoderSide::Motor,
            })
            .unwrap();
        let trace = along(&eccentric, [1500.0, 0.0], Substeps::Fine, |_| 0.2);
        // its friction would hold it anywhere near
        assert!(
            (trace.motor_rad[10] - 0.2).abs() < 1e-5,
            "{}",
            trace.motor_rad[10]
        );
    }
}
