//! One joint simulated along a recording, with the controller that ran on it.
//!
//! The joint gets the recorded command plus what a controller adds for the difference between recorded and simulated
//! position, `K_p·e + K_d·F[ė]`, `e = q_rec - q_sim`. There are two:
//!
//! - The robot file's, through the drive as the command ([`Way::Commanded`]). For a controller that is linear in the
//!   measured motion this *is* its closed loop, whatever it fed forward, so nothing needs to be known of that.
//! - One of our own that holds the simulation on the recorded motion, by a torque on the rotor ([`Way::Held`]): it knows
//!   the recording's future, so no delay of drive or sensors makes it unstable, and its torque is told, so that it can be
//!   counted as a disturbance.
//!
//! Motor and link are two masses with the gear between them, in implicit steps: spring, damping and friction act with
//! their values at the end of a step, so no stiffness asks for a smaller one. Friction is a spring that slips
//! (elasto-plastic: Dupont, Hayward, Armstrong, Altpeter, IEEE Trans. Automatic Control 47 (2002) 787-792).

use joint_model::filter::Butterworth;
use joint_model::friction::{Direction, Sliding};

use crate::joint::{JointModel, sum};
use crate::load::Load;

/// What the recording gives the simulation, at a constant rate.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Drive {
    /// Between two samples.
    pub period_s: f64,
    /// Of the first sample since the recording began.
    pub start_s: f64,
    /// Measured motor position over the gear ratio.
    pub motor_rad: Vec<f64>,
    /// Measured link position, where feedback is on it.
    pub link_rad: Option<Vec<f64>>,
    /// Torque sent, joint side.
    pub command_nm: Vec<f64>,
}

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
}

/// How a feedback's torque reaches the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Through the drive, on what the sensors show.
    Commanded,
    /// On the rotor, beside the drive and without delay.
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

/// Longest substep: friction and gear are implicit, so this is for accuracy only.
const SUBSTEP_S: f64 = 4e-4;
/// Twist by which the gear's slope is found.
const PROBE_RAD: f64 = 1e-7;
/// Commands and positions that are remembered for delays.
const HISTORY: usize = 256;

/// Simulates the joint along a recording. Sensors are quantised and noisy only with `noise`; without it they are exact,
/// as regressors want them.
pub fn simulate(
    model: &JointModel,
    feedback: &Feedback,
    drive: &Drive,
    load: &Load,
    mut noise: Option<&mut dyn Noise>,
) -> Trace {
    let samples = drive.motor_rad.len();
    let mut trace = Trace::with_capacity(samples);
    let mut joint = State::at_start(model, drive, load);
    if let Some(noise) = noise.as_deref_mut() {
        // nobody knows where an encoder's steps lie
        joint.rounding = [noise.uniform(), noise.uniform()];
    }
    let mut loop_ = Loop::new(feedback);
    let substeps = (drive.period_s / SUBSTEP_S).ceil().max(1.0) as usize;
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
    for k in 0..samples {
        let measured = joint.measure(model, drive.period_s, noise.as_deref_mut());
        let added_nm = match feedback.way {
            Way::Commanded => loop_.torque_nm(feedback, drive, k as f64, &measured),
            Way::Held => {
                let ahead = model.sensor_delay_s / drive.period_s;
                loop_.torque_nm(feedback, drive, k as f64 + ahead, &joint.seen_now(model))
            }
        };
        let command_nm = match feedback.way {
            Way::Commanded => drive.command_nm[k] + added_nm,
            Way::Held => drive.command_nm[k],
        };
        trace.push(&measured, command_nm);
        if feedback.way == Way::Held {
            joint.holding_nm = added_nm;
        }
        let kept = match noise.as_deref_mut() {
            Some(noise) => noise.uniform() >= model.dropped_commands,
            None => true,
        };
        joint.receive(command_nm, kept);
        let time_s = drive.start_s + k as f64 * drive.period_s;
        for (share, held) in &held {
            joint.drive(model, held, answer);
            joint.advance(model, load, k, *share, time_s, step_s);
        }
    }
    trace
}

impl Trace {
    fn with_capacity(samples: usize) -> Self {
        let column = || Vec::with_capacity(samples);
        Self {
            motor_rad: column(),
            link_rad: column(),
            command_nm: column(),
            torque_nm: column(),
            holding_nm: column(),
            joint_torque_nm: column(),
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
        let ratio = model.gear_ratio;
        Self {
            motor_rad: motor_rad
                + model.encoder_offset_rad
                + sum(&model.motor_eccentricity, motor_rad * ratio) / ratio,
            link_rad: link_rad + model.encoder_offset_rad + sum(&model.link_eccentricity, link_rad),
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

    /// For the recording at a sample, or between two.
    fn torque_nm(
        &mut self,
        feedback: &Feedback,
        drive: &Drive,
        sample: f64,
        measured: &Measured,
    ) -> f64 {
        let recorded = |column: &[f64]| {
            let last = column.len() - 1;
            let before = (sample as usize).min(last);
            let after = (before + 1).min(last);
            column[before] + (sample - before as f64).min(1.0) * (column[after] - column[before])
        };
        let error_rad = match &drive.link_rad {
            Some(link_rad) if feedback.on_link => recorded(link_rad) - measured.link_rad,
            _ => recorded(&drive.motor_rad) - measured.motor_rad,
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

/// The commands that the drive holds during a substep: each until the next is old enough, which may be within it.
struct Held {
    /// In samples.
    older: usize,
    newer: usize,
    /// Of the substep.
    share_of_newer: f64,
}

impl Held {
    /// In a substep of so many periods, for a command that is so many periods old at its beginning.
    fn at(age: f64, periods: f64) -> Self {
        let older = (age - 1e-9).ceil().max(0.0);
        let share_of_older = ((age - (older - 1.0)) / periods).clamp(0.0, 1.0);
        Self {
            older: older as usize,
            newer: (older - 1.0).max(0.0) as usize,
            share_of_newer: 1.0 - share_of_older,
        }
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
    seen: [[f64; 5]; HISTORY],
    newest: usize,
}

impl State {
    /// On the recorded motion, the gear wound up by the load.
    fn at_start(model: &JointModel, drive: &Drive, load: &Load) -> Self {
        let load_nm = load.torque_nm.first().copied().unwrap_or(0.0);
        let motor_rad = drive.motor_rad.first().copied().unwrap_or(0.0) - model.encoder_offset_rad;
        let velocity_rad_s = load.velocity_rad_s.first().copied().unwrap_or(0.0);
        let (error_rad, _) = model
            .kinematic_error
            .error_and_slope(motor_rad * model.gear_ratio);
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
        let link_rad = self.link_rad + model.link_skew_s * self.link_rad_s + model.link_zero_rad;
        self.seen[self.newest] = [
            self.motor_rad,
            link_rad,
            self.drive_nm,
            self.joint_torque_nm,
            self.holding_nm,
        ];
        let periods = model.sensor_delay_s / period_s;
        let seen = if periods > 0.0 {
            [0, 1, 2, 3, 4].map(|signal| delayed(periods, |age| self.seen[self.index(age)][signal]))
        } else {
            self.seen[self.newest]
        };
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

    /// What sensors without delay and noise show.
    fn seen_now(&self, model: &JointModel) -> Measured {
        Measured::of(model, self.seen[self.newest])
    }

    fn index(&self, age: usize) -> usize {
        (self.newest + HISTORY - age.min(HISTORY - 1)) % HISTORY
    }

    fn receive(&mut self, command_nm: f64, kept: bool) {
        let before = self.commands_nm[self.index(1)];
        self.commands_nm[self.newest] = if kept { command_nm } else { before };
    }

    /// The current loop, by the part of the difference that it makes up in a substep.
    fn drive(&mut self, model: &JointModel, held: &Held, answer: f64) {
        let limit_nm = model.torque_limit_nm * model.gear_ratio;
        let command_nm = |age: usize| self.commands_nm[self.index(age)].clamp(-limit_nm, limit_nm);
        let older_nm = command_nm(held.older);
        let demand_nm = older_nm + held.share_of_newer * (command_nm(held.newer) - older_nm);
        self.drive_nm += answer * (demand_nm - self.drive_nm);
    }

    /// Motor and link to the end of a substep.
    fn advance(
        &mut self,
        model: &JointModel,
        load: &Load,
        k: usize,
        share: f64,
        time_s: f64,
        step_s: f64,
    ) {
        let motor_angle_rad = self.motor_rad * model.gear_ratio;
        // what repeats with the angle acts at that of the middle of the substep, or it comes late as the joint turns
        let middle_rad = motor_angle_rad + 0.5 * step_s * self.motor_rad_s * model.gear_ratio;
        let shaft_nm = model.torque_gain * self.drive_nm
            + model.torque_offset_nm
            + self.holding_nm
            + model.gear_ratio * sum(&model.torque_ripple, middle_rad);
        let link = LinkLoad::at(model, load, k, share, self.link_rad);
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
        let (error_rad, slope) = model.kinematic_error.error_and_slope(motor_angle_rad);
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
        let inertia = model.rotor_inertia_kg_m2 + lever * coupling * (lever - b);
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
        let moving_rad_s = self.motor_rad_s.abs().max(1e-9).copysign(self.motor_rad_s);
        let drag_nm_s_rad = model.friction.fluid_drag_nm(moving_rad_s) / moving_rad_s;
        let inertia = inertia + step_s * drag_nm_s_rad;
        let direction = Direction::of(momentum);
        let level_nm = level(direction, load_nm, speed_rad_s);
        let bend_rad = model.presliding_rad;
        let stiffness = level_nm / bend_rad;
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

struct LinkLoad {
    inertia_kg_m2: f64,
    torque_nm: f64,
}

impl LinkLoad {
    fn at(model: &JointModel, load: &Load, k: usize, share: f64, link_rad: f64) -> Self {
        let next = (k + 1).min(load.torque_nm.len() - 1);
        let between = |column: &[f64]| column[k] + share * (column[next] - column[k]);
        let away_rad = link_rad - between(&load.position_rad);
        let [sin_nm, cos_nm] = model.gravity_sin_cos_nm;
        let added_nm = if sin_nm == 0.0 && cos_nm == 0.0 {
            0.0
        } else {
            let (sin, cos) = link_rad.sin_cos();
            sin_nm * sin + cos_nm * cos
        };
        let springs_nm: f64 = model
            .springs
            .iter()
            .map(|spring| spring.stiffness_nm_rad * (link_rad - spring.rest_rad))
            .sum();
        Self {
            inertia_kg_m2: between(&load.inertia_kg_m2),
            torque_nm: between(&load.torque_nm)
                + between(&load.slope_nm_rad) * away_rad
                + added_nm
                + springs_nm,
        }
    }
}

/// Between the remembered values around an age.
fn delayed(periods: f64, at: impl Fn(usize) -> f64) -> f64 {
    let whole = periods as usize;
    let share = periods - whole as f64;
    at(whole) + share * (at(whole + 1) - at(whole))
}
