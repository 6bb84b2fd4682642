//! What a drive does with its motor: modes, watchdog, faults, and the control of position, as functions of time.
//!
//! Source: mjbots/moteus, fw/bldc_servo_control.h (modes, watchdog, limits), fw/pid.h (the controller), fw/error.h (codes);
//! meaning: protocol/registers.md. Revolutions and Nm are those of the output, as everywhere in moteus. Left out: the
//! current loop (the emulated robot's own drive has one), field weakening, derating by temperature and power, and the modes
//! that set voltages.

use core::f64::consts::TAU;

use crate::config::Config;
use crate::trajectory::{Goal, Trajectory};

/// Torque of one ampere times the motor's speed constant in turns a minute and volt (fw/bldc_servo.cc, `kTorqueFactor`).
pub const TORQUE_FACTOR: f64 = 1.5 / 1.732_050_807_568_877_2 * 60.0 / TAU;
/// Torque constant of a motor whose speed constant is not configured (fw/bldc_servo_control.h, `kDefaultTorqueConstant`).
const TORQUE_CONSTANT_UNKNOWN_NM_A: f64 = 0.1;
/// Time from the first command to control: the gate driver is switched on within a millisecond, then the current sensors are
/// calibrated over 256 periods of 30 kHz (fw/bldc_servo.cc, `kCalibrateCount`).
const ENABLING_S: f64 = 0.001;
const CALIBRATING_S: f64 = 256.0 / 30_000.0;
/// Below this bus voltage a drive that runs faults (fw/bldc_servo_control.h).
const UNDER_VOLTAGE_V: f64 = 4.0;

/// What a drive is doing; register 0x000.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// No current. Ends faults and timeouts.
    #[default]
    Stopped = 0,
    /// No current until a stop.
    Fault = 1,
    /// The gate driver is switched on.
    Enabling = 2,
    /// The current sensors are calibrated.
    Calibrating = 3,
    /// A current is held.
    Current = 9,
    /// Position control.
    Position = 10,
    /// The watchdog has run out; until a stop.
    Timeout = 11,
    /// Velocity control to zero, without position.
    ZeroVelocity = 12,
    /// Torque alone within bounds, position control at them.
    StayWithin = 13,
    /// The windings are shorted.
    Brake = 15,
}

impl Mode {
    /// The modes that a command may ask for; `None` for one that there is not or that is not emulated.
    pub fn from_command(raw: i32) -> Option<Self> {
        [
            Self::Stopped,
            Self::Current,
            Self::Position,
            Self::Timeout,
            Self::ZeroVelocity,
            Self::StayWithin,
            Self::Brake,
        ]
        .into_iter()
        .find(|mode| *mode as i32 == raw)
    }

    fn controls(self) -> bool {
        matches!(
            self,
            Self::Position | Self::Timeout | Self::ZeroVelocity | Self::StayWithin
        )
    }

    fn is_watched(self) -> bool {
        matches!(self, Self::Position | Self::StayWithin)
    }
}

/// Fault and limit codes of register 0x00f (fw/error.h).
#[allow(missing_docs, reason = "the names are the maker's")]
pub mod code {
    pub const NONE: u8 = 0;
    pub const MOTOR_DRIVER: u8 = 33;
    pub const OVER_VOLTAGE: u8 = 34;
    pub const ENCODER: u8 = 35;
    pub const MOTOR_NOT_CONFIGURED: u8 = 36;
    pub const OVER_TEMPERATURE: u8 = 38;
    pub const START_OUTSIDE_LIMIT: u8 = 39;
    pub const UNDER_VOLTAGE: u8 = 40;
    pub const STOP_POSITION_DEPRECATED: u8 = 45;
    pub const POSITION_ERROR: u8 = 49;
    pub const VELOCITY_ERROR: u8 = 50;
    pub const LIMIT_MAX_VELOCITY: u8 = 96;
    pub const LIMIT_MAX_CURRENT: u8 = 99;
    pub const LIMIT_MAX_TORQUE: u8 = 102;
    pub const LIMIT_POSITION_BOUNDS: u8 = 103;
}

/// What a frame or a diagnostic line commands. NaN is "not controlled" or "not given".
#[derive(Clone, Copy, Debug)]
pub struct Command {
    /// What to do.
    pub mode: Mode,
    /// Register 0x020, revolutions; NaN for wherever the output is.
    pub position_rev: f64,
    /// Register 0x021.
    pub velocity_rev_s: f64,
    /// Register 0x022, at the output.
    pub feedforward_nm: f64,
    /// Register 0x023.
    pub kp_scale: f64,
    /// Register 0x024.
    pub kd_scale: f64,
    /// Register 0x02b.
    pub ilimit_scale: f64,
    /// Register 0x025; NaN for no limit but the current's.
    pub max_torque_nm: f64,
    /// Register 0x026.
    pub stop_position_rev: f64,
    /// Register 0x027; 0 for the configured time, NaN for none.
    pub timeout_s: f64,
    /// Register 0x028; NaN for the configured limit, negative for none.
    pub velocity_limit_rev_s: f64,
    /// Register 0x029; as the velocity limit.
    pub acceleration_limit_rev_s2: f64,
    /// Register 0x02d.
    pub ignore_bounds: bool,
    /// Registers 0x040 and 0x041.
    pub bounds_rev: [f64; 2],
    /// Register 0x01c.
    pub q_current_a: f64,
    /// Register 0x01d; it makes no torque.
    pub d_current_a: f64,
}

impl Default for Command {
    /// What a frame that gives nothing but a mode means.
    fn default() -> Self {
        Self {
            mode: Mode::Stopped,
            position_rev: 0.0,
            velocity_rev_s: 0.0,
            feedforward_nm: 0.0,
            kp_scale: 1.0,
            kd_scale: 1.0,
            ilimit_scale: 1.0,
            max_torque_nm: f64::NAN,
            stop_position_rev: f64::NAN,
            timeout_s: 0.0,
            velocity_limit_rev_s: f64::NAN,
            acceleration_limit_rev_s2: f64::NAN,
            ignore_bounds: false,
            bounds_rev: [0.0; 2],
            q_current_a: 0.0,
            d_current_a: 0.0,
        }
    }
}

/// The part of the configuration that control uses, taken out of it whenever it changes.
#[derive(Clone, Copy, Debug)]
pub struct Tuning {
    kp: f64,
    ki: f64,
    kd: f64,
    sign: f64,
    iratelimit: f64,
    ilimit_nm: f64,
    default_timeout_s: f64,
    timeout_mode: u8,
    timeout_max_torque_nm: f64,
    velocity_limit_rev_s: f64,
    acceleration_limit_rev_s2: f64,
    max_velocity_rev_s: f64,
    max_velocity_derate_rev_s: f64,
    max_current_a: f64,
    max_voltage_v: f64,
    fault_temperature_c: f64,
    fault_position_error_rev: f64,
    fault_velocity_error_rev_s: f64,
    inertia_feedforward: f64,
    max_position_slip_rev: f64,
    zero_capture_rev_s: f64,
    position_derate_rev: f64,
    bounds_rev: [f64; 2],
    /// Output revolutions per rotor revolution.
    pub ratio: f64,
    /// Which way the output turns with the rotor: 1 or -1.
    pub output_sign: f64,
    /// Motor torque per ampere.
    pub torque_constant_nm_a: f64,
    resistance_ohm: f64,
    is_calibrated: bool,
}

impl Tuning {
    /// From the configuration as it is.
    pub fn of(config: &Config) -> Self {
        let number = |name: &str| config.number(name);
        let speed_constant = number("motor.Kv");
        Self {
            kp: number("servo.pid_position.kp"),
            ki: number("servo.pid_position.ki"),
            kd: number("servo.pid_position.kd"),
            sign: number("servo.pid_position.sign"),
            iratelimit: number("servo.pid_position.iratelimit"),
            ilimit_nm: number("servo.pid_position.ilimit"),
            default_timeout_s: number("servo.default_timeout_s"),
            timeout_mode: number("servo.timeout_mode") as u8,
            timeout_max_torque_nm: number("servo.timeout_max_torque_Nm"),
            velocity_limit_rev_s: number("servo.default_velocity_limit"),
            acceleration_limit_rev_s2: number("servo.default_accel_limit"),
            max_velocity_rev_s: number("servo.max_velocity"),
            max_velocity_derate_rev_s: number("servo.max_velocity_derate"),
            max_current_a: number("servo.max_current_A"),
            max_voltage_v: number("servo.max_voltage"),
            fault_temperature_c: number("servo.fault_temperature"),
            fault_position_error_rev: number("servo.fault_position_error"),
            fault_velocity_error_rev_s: number("servo.fault_velocity_error"),
            inertia_feedforward: number("servo.inertia_feedforward"),
            max_position_slip_rev: number("servo.max_position_slip"),
            zero_capture_rev_s: number("servo.velocity_zero_capture_threshold"),
            position_derate_rev: number("servo.position_derate"),
            bounds_rev: [
                number("servopos.position_min"),
                number("servopos.position_max"),
            ],
            ratio: number("motor_position.rotor_to_output_ratio"),
            output_sign: number("motor_position.output.sign"),
            torque_constant_nm_a: if speed_constant > 0.0 {
                TORQUE_FACTOR / speed_constant
            } else {
                TORQUE_CONSTANT_UNKNOWN_NM_A
            },
            resistance_ohm: number("motor.resistance_ohm"),
            is_calibrated: number("motor.poles") > 0.0,
        }
    }
}

/// What the drive measures in a step.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Of the output, as the drive knows it.
    pub position_rev: f64,
    /// Of the output.
    pub velocity_rev_s: f64,
    /// Before the gear, as the current tells.
    pub motor_torque_nm: f64,
    /// Supply.
    pub bus_v: f64,
    /// Of the power stage.
    pub temperature_c: f64,
}

/// Torques of the position controller; registers 0x030 to 0x034 and 0x03b to 0x03d.
#[derive(Clone, Copy, Debug, Default)]
pub struct Parts {
    /// Measured minus wanted.
    pub error_rev: f64,
    /// Measured minus wanted.
    pub error_rev_s: f64,
    /// From the position.
    pub proportional_nm: f64,
    /// From the velocity.
    pub derivative_nm: f64,
    /// From the past.
    pub integral_nm: f64,
    /// What is asked of the motor, at the output.
    pub command_nm: f64,
}

/// A drive's control.
#[derive(Clone, Debug)]
pub struct Servo {
    mode: Mode,
    code: u8,
    command: Command,
    goal: Goal,
    trajectory: Trajectory,
    parts: Parts,
    timeout_s: f64,
    enabling_s: f64,
    was_enabled: bool,
    injected: u8,
}

impl Default for Servo {
    fn default() -> Self {
        Self {
            mode: Mode::Stopped,
            code: code::NONE,
            command: Command::default(),
            goal: Goal {
                position_rev: None,
                velocity_rev_s: 0.0,
                velocity_limit_rev_s: f64::NAN,
                acceleration_limit_rev_s2: f64::NAN,
            },
            trajectory: Trajectory::default(),
            parts: Parts::default(),
            timeout_s: 0.0,
            enabling_s: 0.0,
            was_enabled: false,
            injected: code::NONE,
        }
    }
}

impl Servo {
    /// What it is doing.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Why it faults, or what limits it; 0 for neither.
    pub fn code(&self) -> u8 {
        self.code
    }

    /// The command as last given.
    pub fn commanded(&self) -> &Command {
        &self.command
    }

    /// The trajectory as it stands.
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    /// The controller's torques of the last step.
    pub fn parts(&self) -> &Parts {
        &self.parts
    }

    /// What is left of the watchdog's time; NaN where it is off.
    pub fn timeout_s(&self) -> f64 {
        self.timeout_s
    }

    /// Whether its motor was ever driven since it was powered.
    pub fn was_enabled(&self) -> bool {
        self.was_enabled
    }

    /// Makes it fault with this code in the next step and hinders it from running; 0 ends that.
    pub fn inject(&mut self, code: u8) {
        self.injected = code;
    }

    /// Takes a command (fw/bldc_servo_control.h, `PrepareCommand`).
    pub fn command(&mut self, mut command: Command, tuning: &Tuning) {
        let given = |value: f64, default: f64| match value {
            _ if value.is_nan() => default,
            _ if value < 0.0 => f64::NAN,
            _ => value,
        };
        if command.timeout_s == 0.0 {
            command.timeout_s = tuning.default_timeout_s;
        }
        self.timeout_s = command.timeout_s;
        let mut velocity_limit = given(command.velocity_limit_rev_s, tuning.velocity_limit_rev_s);
        let acceleration_limit = given(
            command.acceleration_limit_rev_s2,
            tuning.acceleration_limit_rev_s2,
        );
        if !(velocity_limit.is_nan() && acceleration_limit.is_nan()) {
            // f64::min takes the other where one is NaN
            velocity_limit = velocity_limit.min(tuning.max_velocity_rev_s);
        }
        if command.velocity_rev_s.is_nan() {
            command.velocity_rev_s = 0.0;
        }
        self.goal = Goal {
            position_rev: (!command.position_rev.is_nan()).then_some(command.position_rev),
            velocity_rev_s: limited(command.velocity_rev_s, velocity_limit),
            velocity_limit_rev_s: velocity_limit,
            acceleration_limit_rev_s2: acceleration_limit,
        };
        self.command = command;
        let is_limited = velocity_limit.is_finite() || acceleration_limit.is_finite();
        if command.stop_position_rev.is_finite() && is_limited {
            self.fault(code::STOP_POSITION_DEPRECATED);
        }
    }

    /// Starts the control position again from where the output is (register 0x133).
    pub fn recapture(&mut self) {
        self.trajectory = Trajectory::default();
        self.parts = Parts::default();
    }

    /// One step: the torque the motor shall give, motor side.
    pub fn step(&mut self, measured: &Measured, tuning: &Tuning, step_s: f64) -> f64 {
        if self.timeout_s > 0.0 {
            self.timeout_s = (self.timeout_s - step_s).max(0.0);
        }
        self.follow_command(measured, tuning, step_s);
        self.check(measured, tuning);
        if self.mode.is_watched() && self.timeout_s <= 0.0 {
            self.mode = Mode::Timeout;
        }
        if !self.mode.controls() {
            self.recapture();
        }
        if self.mode != Mode::Fault {
            self.code = code::NONE;
        }
        self.torque_nm(measured, tuning, step_s)
    }

    /// Goes over to the commanded mode where that is allowed.
    fn follow_command(&mut self, measured: &Measured, tuning: &Tuning, step_s: f64) {
        let asked = self.command.mode;
        if asked == Mode::Stopped {
            self.mode = Mode::Stopped;
            return;
        }
        match self.mode {
            Mode::Fault | Mode::Timeout => {}
            Mode::Stopped => {
                self.mode = Mode::Enabling;
                self.enabling_s = 0.0;
                self.was_enabled = true;
            }
            Mode::Enabling | Mode::Calibrating => {
                self.enabling_s += step_s;
                if self.enabling_s >= ENABLING_S + CALIBRATING_S {
                    self.enter(asked, measured, tuning);
                } else if self.enabling_s >= ENABLING_S {
                    self.mode = Mode::Calibrating;
                }
            }
            mode if mode == asked => {}
            _ => self.enter(asked, measured, tuning),
        }
    }

    fn enter(&mut self, mode: Mode, measured: &Measured, tuning: &Tuning) {
        let [least, most] = tuning.bounds_rev;
        let is_outside = measured.position_rev < least || measured.position_rev > most;
        if mode.is_watched() && is_outside && !self.command.ignore_bounds {
            self.fault(code::START_OUTSIDE_LIMIT);
            return;
        }
        self.mode = mode;
        self.recapture();
    }

    fn fault(&mut self, code: u8) {
        self.mode = Mode::Fault;
        self.code = code;
    }

    /// What ends any mode in which the motor is driven.
    fn check(&mut self, measured: &Measured, tuning: &Tuning) {
        if matches!(self.mode, Mode::Stopped | Mode::Fault) {
            return;
        }
        let found = match () {
            () if self.injected != code::NONE => self.injected,
            () if measured.bus_v > tuning.max_voltage_v => code::OVER_VOLTAGE,
            () if measured.bus_v < UNDER_VOLTAGE_V => code::UNDER_VOLTAGE,
            () if measured.temperature_c > tuning.fault_temperature_c => code::OVER_TEMPERATURE,
            () => return,
        };
        self.fault(found);
    }

    fn torque_nm(&mut self, measured: &Measured, tuning: &Tuning, step_s: f64) -> f64 {
        self.parts.command_nm = 0.0;
        let command = self.command;
        match self.mode {
            Mode::Stopped | Mode::Fault | Mode::Enabling | Mode::Calibrating => 0.0,
            Mode::Brake => braking_nm(measured, tuning),
            Mode::Current => self.limited_nm(
                command.q_current_a * tuning.torque_constant_nm_a,
                measured,
                tuning,
            ),
            Mode::Position => self.hold(&command, measured, tuning, step_s),
            Mode::ZeroVelocity => self.hold_still(measured, tuning, step_s),
            Mode::StayWithin => self.stay_within(measured, tuning, step_s),
            Mode::Timeout => match tuning.timeout_mode {
                10 => self.come_to_rest(measured, tuning, step_s),
                12 => self.hold_still(measured, tuning, step_s),
                15 => braking_nm(measured, tuning),
                _ => 0.0,
            },
        }
    }

    /// Velocity control to zero, with a torque limit of its own.
    fn hold_still(&mut self, measured: &Measured, tuning: &Tuning, step_s: f64) -> f64 {
        self.goal = Goal {
            position_rev: None,
            velocity_rev_s: 0.0,
            velocity_limit_rev_s: f64::NAN,
            acceleration_limit_rev_s2: f64::NAN,
        };
        let still = Command {
            kp_scale: 0.0,
            kd_scale: self.command.kd_scale,
            ilimit_scale: 0.0,
            max_torque_nm: tuning.timeout_max_torque_nm,
            ..Command::default()
        };
        self.hold(&still, measured, tuning, step_s)
    }

    /// Slows down within the configured limits and holds the position it comes to.
    fn come_to_rest(&mut self, measured: &Measured, tuning: &Tuning, step_s: f64) -> f64 {
        self.goal = Goal {
            position_rev: None,
            velocity_rev_s: 0.0,
            velocity_limit_rev_s: tuning.velocity_limit_rev_s.min(tuning.max_velocity_rev_s),
            acceleration_limit_rev_s2: tuning.acceleration_limit_rev_s2,
        };
        self.hold(&Command::default(), measured, tuning, step_s)
    }

    fn stay_within(&mut self, measured: &Measured, tuning: &Tuning, step_s: f64) -> f64 {
        let command = self.command;
        let [least, most] = command.bounds_rev;
        let violated = match () {
            () if measured.position_rev < least => Some(least),
            () if measured.position_rev > most => Some(most),
            () => None,
        };
        self.goal.velocity_rev_s = 0.0;
        self.goal.position_rev = None;
        self.trajectory = Trajectory {
            position_rev: violated,
            ..Trajectory::default()
        };
        if violated.is_some() {
            return self.hold(&command, measured, tuning, step_s);
        }
        self.parts = Parts::default();
        let free = Command {
            kp_scale: 0.0,
            kd_scale: 0.0,
            ilimit_scale: 0.0,
            ..command
        };
        self.hold(&free, measured, tuning, step_s)
    }

    /// Position control to the trajectory.
    fn hold(
        &mut self,
        command: &Command,
        measured: &Measured,
        tuning: &Tuning,
        step_s: f64,
    ) -> f64 {
        self.advance_trajectory(measured, tuning, step_s);
        let parts = &mut self.parts;
        let wanted_rev = self
            .trajectory
            .position_rev
            .unwrap_or(measured.position_rev);
        parts.error_rev = measured.position_rev - wanted_rev;
        parts.error_rev_s = measured.velocity_rev_s - self.trajectory.velocity_rev_s;
        let mut wound_nm = parts.error_rev * tuning.ki * step_s;
        if tuning.iratelimit > 0.0 {
            wound_nm = limited(wound_nm, tuning.iratelimit * step_s);
        }
        parts.integral_nm = limited(
            parts.integral_nm + wound_nm,
            tuning.ilimit_nm * command.ilimit_scale,
        );
        parts.proportional_nm = command.kp_scale * tuning.kp * parts.error_rev;
        parts.derivative_nm = command.kd_scale * tuning.kd * parts.error_rev_s;
        let feedback_nm =
            tuning.sign * (parts.proportional_nm + parts.derivative_nm + parts.integral_nm);
        let inertial_nm = TAU * self.trajectory.acceleration_rev_s2 * tuning.inertia_feedforward;
        let asked_nm = feedback_nm + command.feedforward_nm + inertial_nm;
        let (position_off, velocity_off) = (parts.error_rev.abs(), parts.error_rev_s.abs());
        if position_off > tuning.fault_position_error_rev {
            self.fault(code::POSITION_ERROR);
            return 0.0;
        }
        if velocity_off > tuning.fault_velocity_error_rev_s {
            self.fault(code::VELOCITY_ERROR);
            return 0.0;
        }
        let allowed_nm = limited(asked_nm, command.max_torque_nm);
        if allowed_nm != asked_nm {
            self.code = code::LIMIT_MAX_TORQUE;
        }
        self.limited_nm(allowed_nm * tuning.ratio, measured, tuning)
    }

    fn advance_trajectory(&mut self, measured: &Measured, tuning: &Tuning, step_s: f64) {
        let start_rev_s = if measured.velocity_rev_s.abs() < tuning.zero_capture_rev_s {
            0.0
        } else {
            measured.velocity_rev_s
        };
        self.trajectory
            .advance(&mut self.goal, (measured.position_rev, start_rev_s), step_s);
        let Some(mut position_rev) = self.trajectory.position_rev else {
            return;
        };
        if tuning.max_position_slip_rev.is_finite() {
            let slip_rev = position_rev - measured.position_rev;
            position_rev = measured.position_rev + limited(slip_rev, tuning.max_position_slip_rev);
        }
        let stop_rev = self.command.stop_position_rev;
        let is_past = |bound_rev: f64, direction: f64| (position_rev - bound_rev) * direction > 0.0;
        let bound = match () {
            () if !self.command.ignore_bounds && is_past(tuning.bounds_rev[0], -1.0) => {
                tuning.bounds_rev[0]
            }
            () if !self.command.ignore_bounds && is_past(tuning.bounds_rev[1], 1.0) => {
                tuning.bounds_rev[1]
            }
            () if is_past(stop_rev, self.trajectory.velocity_rev_s) => stop_rev,
            () => f64::NAN,
        };
        if bound.is_finite() {
            position_rev = bound;
            self.trajectory.velocity_rev_s = 0.0;
            self.trajectory.acceleration_rev_s2 = 0.0;
        }
        self.trajectory.position_rev = Some(position_rev);
    }

    /// Cuts a motor torque to what bounds, speed and current allow.
    fn limited_nm(&mut self, motor_nm: f64, measured: &Measured, tuning: &Tuning) -> f64 {
        let (mut allowed_nm, mut limit) = (motor_nm, code::NONE);
        if !motor_nm.is_finite() {
            return 0.0;
        }
        let [least, most] = tuning.bounds_rev;
        let beyond_rev = match motor_nm > 0.0 {
            true => measured.position_rev - most,
            false => least - measured.position_rev,
        };
        if beyond_rev > 0.0 && !self.command.ignore_bounds {
            allowed_nm *= (1.0 - beyond_rev / tuning.position_derate_rev).max(0.0);
            limit = code::LIMIT_POSITION_BOUNDS;
        }
        let most_nm = tuning.max_current_a * tuning.torque_constant_nm_a;
        let too_fast = measured.velocity_rev_s.abs() - tuning.max_velocity_rev_s;
        if too_fast >= 0.0 && measured.velocity_rev_s * allowed_nm > 0.0 {
            let share = (1.0 - too_fast / tuning.max_velocity_derate_rev_s).max(0.0);
            if allowed_nm.abs() > share * most_nm {
                allowed_nm = limited(allowed_nm, share * most_nm);
                limit = code::LIMIT_MAX_VELOCITY;
            }
        }
        if allowed_nm.abs() > most_nm {
            allowed_nm = limited(allowed_nm, most_nm);
            limit = code::LIMIT_MAX_CURRENT;
        }
        if !tuning.is_calibrated {
            self.fault(code::MOTOR_NOT_CONFIGURED);
            return 0.0;
        }
        if limit != code::NONE && self.mode != Mode::Fault {
            self.code = limit;
        }
        self.parts.command_nm = allowed_nm / tuning.ratio;
        allowed_nm
    }
}

/// The value cut to `±most`; the value itself where there is no limit.
fn limited(value: f64, most: f64) -> f64 {
    if most.is_nan() {
        value
    } else {
        value.max(-most).min(most)
    }
}

/// Torque of shorted windings at low speed: the back-EMF drives its current through the resistance,
/// `τ = −Kt²·ω / (1.5·R)` with `Kt` in Nm per ampere of the q axis, whose flux is `Kt/1.5`.
fn braking_nm(measured: &Measured, tuning: &Tuning) -> f64 {
    if tuning.resistance_ohm <= 0.0 || tuning.ratio == 0.0 {
        return 0.0;
    }
    let rotor_rad_s = measured.velocity_rev_s / tuning.ratio * TAU;
    let constant = tuning.torque_constant_nm_a;
    let torque_nm = -constant * constant * rotor_rad_s / (1.5 * tuning.resistance_ohm);
    limited(torque_nm, tuning.max_current_a * constant)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 1.0 / 6000.0;

    fn config() -> Config {
        let mut config = Config::factory([0; 16]);
        config.configure("motor.poles", 14.0);
        config.configure("servopos.position_min", -0.5);
        config.configure("servopos.position_max", 0.5);
        config
    }

    fn at(position_rev: f64) -> Measured {
        Measured {
            position_rev,
            velocity_rev_s: 0.0,
            motor_torque_nm: 0.0,
            bus_v: 24.0,
            temperature_c: 30.0,
        }
    }

    fn run(servo: &mut Servo, tuning: &Tuning, measured: &Measured, seconds: f64) -> f64 {
        let steps = (seconds / STEP_S).round() as usize;
        (0..steps).fold(0.0, |_, _| servo.step(measured, tuning, STEP_S))
    }

    fn position(position_rev: f64) -> Command {
        Command {
            mode: Mode::Position,
            position_rev,
            velocity_limit_rev_s: -1.0,
            acceleration_limit_rev_s2: -1.0,
            ..Command::default()
        }
    }

    #[test]
    fn torque_is_kp_times_the_way_missing_with_its_scale_and_feedforward() {
        let (mut servo, tuning) = (Servo::default(), Tuning::of(&config()));
        let command = Command {
            kp_scale: 0.5,
            feedforward_nm: 0.1,
            ..position(0.2)
        };
        servo.command(command, &tuning);
        let torque_nm = run(&mut servo, &tuning, &at(0.1), 0.02);
        assert_eq!(servo.mode(), Mode::Position);
        assert!((torque_nm - (0.5 * 4.0 * 0.1 + 0.1)).abs() < 1e-6);
        servo.command(
            Command {
                max_torque_nm: 0.05,
                ..command
            },
            &tuning,
        );
        let torque_nm = run(&mut servo, &tuning, &at(0.1), 0.01);
        assert!((torque_nm - 0.05).abs() < 1e-9);
        assert_eq!(servo.code(), code::LIMIT_MAX_TORQUE);
    }

    #[test]
    fn nan_is_not_controlled_and_zero_scales_leave_the_feedforward_alone() {
        let (mut servo, tuning) = (Servo::default(), Tuning::of(&config()));
        servo.command(position(f64::NAN), &tuning);
        assert!(run(&mut servo, &tuning, &at(0.1), 0.02).abs() < 1e-12);
        assert!((servo.trajectory().position_rev.expect("runs") - 0.1).abs() < 1e-12);
        let torque = Command {
            kp_scale: 0.0,
            kd_scale: 0.0,
            feedforward_nm: -0.3,
            ..position(f64::NAN)
        };
        servo.command(torque, &tuning);
        assert!((run(&mut servo, &tuning, &at(0.4), 0.01) + 0.3).abs() < 1e-9);
    }

    #[test]
    fn the_watchdog_stops_what_is_no_longer_commanded_until_a_stop() {
        let (mut servo, tuning) = (Servo::default(), Tuning::of(&config()));
        servo.command(position(0.1), &tuning);
        run(&mut servo, &tuning, &at(0.1), 0.09);
        assert_eq!(servo.mode(), Mode::Position);
        run(&mut servo, &tuning, &at(0.1), 0.02);
        assert_eq!(servo.mode(), Mode::Timeout);
        servo.command(position(0.1), &tuning);
        run(&mut servo, &tuning, &at(0.1), 0.05);
        assert_eq!(servo.mode(), Mode::Timeout);
        servo.command(Command::default(), &tuning);
        run(&mut servo, &tuning, &at(0.1), 0.001);
        assert_eq!(servo.mode(), Mode::Stopped);
        servo.command(
            Command {
                timeout_s: f64::NAN,
                ..position(0.1)
            },
            &tuning,
        );
        run(&mut servo, &tuning, &at(0.1), 1.0);
        assert_eq!(servo.mode(), Mode::Position);
    }

    #[test]
    fn a_fault_is_kept_until_a_stop() {
        let (mut servo, tuning) = (Servo::default(), Tuning::of(&config()));
        servo.command(
            Command {
                timeout_s: f64::NAN,
                ..position(0.1)
            },
            &tuning,
        );
        run(&mut servo, &tuning, &at(0.1), 0.02);
        let low = Measured {
            bus_v: 3.0,
            ..at(0.1)
        };
        assert_eq!(run(&mut servo, &tuning, &low, 0.001), 0.0);
        assert_eq!(
            (servo.mode(), servo.code()),
            (Mode::Fault, code::UNDER_VOLTAGE)
        );
        run(&mut servo, &tuning, &at(0.1), 0.1);
        assert_eq!(
            (servo.mode(), servo.code()),
            (Mode::Fault, code::UNDER_VOLTAGE)
        );
        servo.command(Command::default(), &tuning);
        run(&mut servo, &tuning, &at(0.1), 0.001);
        assert_eq!((servo.mode(), servo.code()), (Mode::Stopped, code::NONE));
    }

    #[test]
    fn control_does_not_begin_outside_the_bounds_or_without_calibration() {
        let (mut servo, tuning) = (Servo::default(), Tuning::of(&config()));
        servo.command(position(0.1), &tuning);
        run(&mut servo, &tuning, &at(0.6), 0.02);
        assert_eq!(
            (servo.mode(), servo.code()),
            (Mode::Fault, code::START_OUTSIDE_LIMIT)
        );

        let mut config = config();
        config.reset();
        let (mut servo, tuning) = (Servo::default(), Tuning::of(&config));
        servo.command(position(0.0), &tuning);
        run(&mut servo, &tuning, &at(0.0), 0.02);
        assert_eq!(
            (servo.mode(), servo.code()),
            (Mode::Fault, code::MOTOR_NOT_CONFIGURED)
        );
    }

    #[test]
    fn no_command_makes_more_torque_than_the_current_or_a_torque_that_is_no_number() {
        let mut config = config();
        config.configure("servo.max_current_A", 10.0);
        let tuning = Tuning::of(&config);
        let most_nm = 10.0 * tuning.torque_constant_nm_a;
        for value in [f64::NAN, f64::INFINITY, -f64::INFINITY, 1e300, -1e300, 0.0] {
            for mode in [
                Mode::Position,
                Mode::ZeroVelocity,
                Mode::StayWithin,
                Mode::Current,
                Mode::Brake,
            ] {
                let mut servo = Servo::default();
                let command = Command {
                    mode,
                    position_rev: value,
                    velocity_rev_s: value,
                    feedforward_nm: value,
                    kp_scale: value,
                    kd_scale: value,
                    ilimit_scale: value,
                    max_torque_nm: value,
                    bounds_rev: [value; 2],
                    q_current_a: value,
                    ..Command::default()
                };
                servo.command(command, &tuning);
                for _ in 0..300 {
                    let torque_nm = servo.step(&at(0.1), &tuning, STEP_S);
                    assert!(
                        torque_nm.abs() <= most_nm * (1.0 + 1e-9),
                        "{torque_nm} of {command:?}"
                    );
                }
            }
        }
    }
}
