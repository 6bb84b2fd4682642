//! One joint's servo drive: torque in digits, current loop, velocity loop on its own clock, watchdog.

use core::f64::consts::TAU;

use crate::inject::{Actuator, Sensing};
use crate::mechanics::Shaft;
use crate::signals::{DriveState, PlantMode};

/// What one command asks of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Setpoint {
    /// Motor side.
    Torque {
        motor_torque_nm: f64,
    },
    /// Joint side.
    Velocity {
        joint_velocity_rad_s: f64,
    },
    Damping,
    Braked,
}

impl Setpoint {
    /// None for a value that no digits can carry.
    pub fn new(mode: PlantMode, motor_torque_nm: f64, joint_velocity_rad_s: f64) -> Option<Self> {
        let value = match mode {
            PlantMode::Torque => motor_torque_nm,
            PlantMode::Velocity => joint_velocity_rad_s,
            PlantMode::Damping | PlantMode::Braked => 0.0,
        };
        value.is_finite().then_some(match mode {
            PlantMode::Torque => Self::Torque { motor_torque_nm },
            PlantMode::Velocity => Self::Velocity {
                joint_velocity_rad_s,
            },
            PlantMode::Damping => Self::Damping,
            PlantMode::Braked => Self::Braked,
        })
    }

    fn state(self) -> DriveState {
        match self {
            Self::Torque { .. } => DriveState::Torque,
            Self::Velocity { .. } => DriveState::Velocity,
            Self::Damping => DriveState::Damping,
            Self::Braked => DriveState::Braked,
        }
    }

    fn acknowledges_watchdog(self) -> bool {
        matches!(self, Self::Damping | Self::Braked)
    }
}

/// How a drive is built and tuned.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ServoConstants {
    pub torque_digit_nm: f64,
    /// Motor side.
    pub torque_limit_nm: f64,
    pub current_loop_time_constant_s: f64,
    /// Joint side.
    pub safe_damping_nm_s_rad: f64,
    pub watchdog_cycles: u32,
    pub velocity_period_s: f64,
    /// Motor torque per joint velocity error.
    pub velocity_gain_nm_s_rad: f64,
    pub velocity_integral_s: f64,
    pub velocity_sensing_hz: f64,
}

/// One joint's drive.
#[derive(Clone, Debug)]
pub(crate) struct Servo {
    constants: ServoConstants,
    state: DriveState,
    setpoint: Setpoint,
    missed_cycles: u32,
    /// Torque the current loop is asked for, motor side.
    demand_nm: f64,
    /// Torque the current gives with the nominal constant, motor side.
    torque_nm: Lag,
    integral_nm: f64,
    since_velocity_tick_s: f64,
    /// Joint side.
    sensed_rad_s: Lag,
    lagged_rad_s: Lag,
    limited: bool,
}

impl Servo {
    /// Holding the shaft under a torque, motor side.
    pub fn holding(constants: ServoConstants, torque_nm: f64) -> Self {
        Self {
            constants,
            state: DriveState::Holding,
            setpoint: Setpoint::Braked,
            missed_cycles: 0,
            demand_nm: torque_nm,
            torque_nm: Lag::at(torque_nm),
            integral_nm: 0.0,
            since_velocity_tick_s: 0.0,
            sensed_rad_s: Lag::at(0.0),
            lagged_rad_s: Lag::at(0.0),
            limited: false,
        }
    }

    pub fn state(&self) -> DriveState {
        self.state
    }

    /// Whether the torque asked for was cut.
    pub fn is_limited(&self) -> bool {
        self.limited
    }

    /// Current times nominal torque constant, motor side.
    pub fn torque_nm(&self) -> f64 {
        self.torque_nm.value
    }

    /// Velocity as the drive knows it, joint side.
    pub fn velocity_rad_s(&self, sensing: &Sensing) -> f64 {
        if sensing.velocity_cutoff_hz.is_some() {
            self.lagged_rad_s.value
        } else {
            self.sensed_rad_s.value
        }
    }

    /// Takes this period's command, or notes that none came.
    pub fn receive(&mut self, setpoint: Option<Setpoint>) {
        let Some(setpoint) = setpoint else {
            self.miss();
            return;
        };
        self.missed_cycles = 0;
        if matches!(self.state, DriveState::Watchdog { .. }) && !setpoint.acknowledges_watchdog() {
            return;
        }
        if setpoint.state() == DriveState::Velocity && self.state != DriveState::Velocity {
            self.integral_nm = self.torque_nm.value;
            self.since_velocity_tick_s = self.constants.velocity_period_s;
        }
        self.setpoint = setpoint;
        self.state = setpoint.state();
    }

    fn miss(&mut self) {
        let missed_cycles = self.missed_cycles.saturating_add(1);
        self.missed_cycles = missed_cycles;
        let runs = matches!(self.state, DriveState::Torque | DriveState::Velocity);
        if runs && missed_cycles >= self.constants.watchdog_cycles {
            self.state = DriveState::Watchdog { missed_cycles };
        }
    }

    /// One substep of the current loop and, when its clock ticks, of the velocity loop.
    pub fn advance(
        &mut self,
        actuator: &Actuator,
        sensing: &Sensing,
        joint_velocity_rad_s: f64,
        step_s: f64,
    ) {
        self.sense(sensing, joint_velocity_rad_s, step_s);
        let limit_nm = self.constants.torque_limit_nm.min(actuator.limit_nm);
        match (self.state, self.setpoint) {
            (DriveState::Holding, _) => return,
            (DriveState::Torque, Setpoint::Torque { motor_torque_nm }) => {
                let digits = (motor_torque_nm / self.constants.torque_digit_nm).round() as i16;
                self.demand(
                    f64::from(digits) * self.constants.torque_digit_nm,
                    motor_torque_nm,
                    limit_nm,
                );
            }
            (
                DriveState::Velocity,
                Setpoint::Velocity {
                    joint_velocity_rad_s,
                },
            ) => {
                self.since_velocity_tick_s += step_s;
                if self.since_velocity_tick_s >= self.constants.velocity_period_s {
                    self.since_velocity_tick_s -= self.constants.velocity_period_s;
                    self.velocity_loop(
                        joint_velocity_rad_s - self.velocity_rad_s(sensing),
                        limit_nm,
                    );
                }
            }
            _ => self.demand(0.0, 0.0, limit_nm),
        }
        let lag_s = self.constants.current_loop_time_constant_s + actuator.lag_s;
        self.torque_nm.advance(self.demand_nm, lag_s, step_s);
    }

    fn sense(&mut self, sensing: &Sensing, joint_velocity_rad_s: f64, step_s: f64) {
        self.sensed_rad_s.advance(
            joint_velocity_rad_s,
            1.0 / (TAU * self.constants.velocity_sensing_hz),
            step_s,
        );
        let lag_s = sensing
            .velocity_cutoff_hz
            .map_or(0.0, |cutoff_hz| 1.0 / (TAU * cutoff_hz));
        self.lagged_rad_s
            .advance(self.sensed_rad_s.value, lag_s, step_s);
    }

    fn demand(&mut self, representable_nm: f64, asked_nm: f64, limit_nm: f64) {
        self.demand_nm = representable_nm.clamp(-limit_nm, limit_nm);
        self.limited = (asked_nm - self.demand_nm).abs() > self.constants.torque_digit_nm;
    }

    /// Proportional-integral; the integral stops where the torque is at its limit.
    fn velocity_loop(&mut self, error_rad_s: f64, limit_nm: f64) {
        let proportional_nm = self.constants.velocity_gain_nm_s_rad * error_rad_s;
        let share = self.constants.velocity_period_s / self.constants.velocity_integral_s;
        let integral_nm = self.integral_nm + share * proportional_nm;
        let asked_nm = proportional_nm + integral_nm;
        self.demand(asked_nm, asked_nm, limit_nm);
        if !self.limited {
            self.integral_nm = integral_nm;
        }
    }

    /// What the drive does to the shaft; `shaft_nm` is the torque that really acts.
    pub fn shaft(&self, shaft_nm: f64) -> Shaft {
        match self.state {
            DriveState::Holding | DriveState::Braked => Shaft::Held,
            DriveState::Damping | DriveState::Watchdog { .. } => Shaft::Free {
                motor_torque_nm: shaft_nm,
                brake_nm_s_rad: self.constants.safe_damping_nm_s_rad,
            },
            _ => Shaft::Free {
                motor_torque_nm: shaft_nm,
                brake_nm_s_rad: 0.0,
            },
        }
    }
}

/// A first-order lag, exact for an input that is constant over each step.
#[derive(Clone, Copy, Debug)]
struct Lag {
    value: f64,
    step_s: f64,
    time_constant_s: f64,
    /// Part of the way to the input in one step; recomputed only when step or time constant change.
    share: f64,
}

impl Lag {
    fn at(value: f64) -> Self {
        Self {
            value,
            step_s: 0.0,
            time_constant_s: 0.0,
            share: 1.0,
        }
    }

    fn advance(&mut self, input: f64, time_constant_s: f64, step_s: f64) {
        if self.time_constant_s != time_constant_s || self.step_s != step_s {
            self.share = if time_constant_s > 0.0 {
                -(-step_s / time_constant_s).exp_m1()
            } else {
                1.0
            };
            (self.time_constant_s, self.step_s) = (time_constant_s, step_s);
        }
        self.value += self.share * (input - self.value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 1e-4;

    fn servo() -> Servo {
        let constants = ServoConstants {
            torque_digit_nm: 0.001,
            torque_limit_nm: 2.0,
            current_loop_time_constant_s: 2e-4,
            safe_damping_nm_s_rad: 10.0,
            watchdog_cycles: 3,
            velocity_period_s: 1.0 / 1504.0,
            velocity_gain_nm_s_rad: 1.0,
            velocity_integral_s: 0.05,
            velocity_sensing_hz: 300.0,
        };
        Servo::holding(constants, 0.25)
    }

    fn run(servo: &mut Servo, actuator: &Actuator, steps: usize) {
        for _ in 0..steps {
            servo.advance(actuator, &Sensing::default(), 0.0, STEP_S);
        }
    }

    fn torque(motor_torque_nm: f64) -> Option<Setpoint> {
        Setpoint::new(PlantMode::Torque, motor_torque_nm, 0.0)
    }

    #[test]
    fn holds_until_the_first_command_however_long_that_takes() {
        let mut servo = servo();
        for _ in 0..100 {
            servo.receive(None);
            run(&mut servo, &Actuator::default(), 7);
        }
        assert_eq!(servo.state(), DriveState::Holding);
        assert_eq!(servo.torque_nm(), 0.25);
        assert!(matches!(servo.shaft(0.25), Shaft::Held));
    }

    #[test]
    fn torque_comes_in_whole_digits_with_the_current_loops_lag() {
        let mut servo = servo();
        servo.receive(torque(0.12345));
        run(&mut servo, &Actuator::default(), 2);
        assert!((servo.torque_nm() - 0.123 - (0.25 - 0.123) * (-1.0_f64).exp()).abs() < 1e-12);
        run(&mut servo, &Actuator::default(), 200);
        assert!((servo.torque_nm() - 0.123).abs() < 1e-12);
        assert!(!servo.is_limited());
    }

    #[test]
    fn limits_are_a_status() {
        let mut servo = servo();
        for (asked_nm, given_nm) in [(5.0, 2.0), (-5.0, -2.0), (1e9, 2.0), (-1e9, -2.0)] {
            servo.receive(torque(asked_nm));
            run(&mut servo, &Actuator::default(), 200);
            assert!((servo.torque_nm() - given_nm).abs() < 1e-9);
            assert!(servo.is_limited());
        }
    }

    #[test]
    fn the_watchdog_trips_after_its_cycles_and_wants_to_be_acknowledged() {
        let mut servo = servo();
        servo.receive(torque(0.5));
        servo.receive(None);
        servo.receive(None);
        assert_eq!(servo.state(), DriveState::Torque);
        servo.receive(None);
        assert_eq!(servo.state(), DriveState::Watchdog { missed_cycles: 3 });
        servo.receive(torque(0.5));
        assert!(matches!(servo.state(), DriveState::Watchdog { .. }));
        run(&mut servo, &Actuator::default(), 200);
        assert!(servo.torque_nm().abs() < 1e-9);
        assert!(
            matches!(servo.shaft(0.0), Shaft::Free { brake_nm_s_rad, .. } if brake_nm_s_rad > 0.0)
        );
        servo.receive(Some(Setpoint::Braked));
        servo.receive(torque(0.5));
        assert_eq!(servo.state(), DriveState::Torque);
    }

    #[test]
    fn a_command_that_is_no_number_is_no_command() {
        assert_eq!(torque(f64::NAN), None);
        assert_eq!(
            Setpoint::new(PlantMode::Braked, f64::NAN, f64::NAN),
            Some(Setpoint::Braked)
        );
    }
}
