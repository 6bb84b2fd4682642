//! One axis of a drive: its objects, its power state machine, its loops, its brake.
//!
//! Objects and their meaning: IEC 61800-7-201 (CiA 402-2) and ETG.6010. Positions are encoder counts at the motor, torques
//! per mille of the rated torque, velocities counts a second.

use core::f64::consts::TAU;

use plant_emulator::{JointCommand, PlantMode};

use crate::objects::{DataType, Dictionary, Entry};
use crate::power::{Conditions, PowerMachine, PowerState};

/// Objects of the next axis begin this much later (ETG.6010, section 4).
pub const AXIS_OFFSET: u16 = 0x800;

/// Error codes (IEC 61800-7-201, Annex: error codes).
pub mod error_code {
    #![allow(missing_docs, reason = "the names say it")]
    pub const UNDERVOLTAGE: u16 = 0x3220;
    pub const PARAMETER: u16 = 0x6320;
    pub const FOLLOWING_ERROR: u16 = 0x8611;
    pub const SYNC_CONTROLLER: u16 = 0x8700;
    /// Maker's own: the target was not neutral when operation was enabled.
    pub const TARGET_AT_ENABLING: u16 = 0xff01;
}

/// Modes of operation.
pub mod mode {
    #![allow(missing_docs, reason = "the names say it")]
    pub const NONE: i8 = 0;
    pub const CYCLIC_POSITION: i8 = 8;
    pub const CYCLIC_VELOCITY: i8 = 9;
    pub const CYCLIC_TORQUE: i8 = 10;
}

/// High voltage of a drive in order, mV.
const LINK_VOLTAGE_MV: i64 = 48_000;
/// What is left of it in a brown-out, mV.
const BROWN_OUT_MV: i64 = 15_000;
/// Velocity below which an axis stands, counts a second over counts a turn: assumed, 0.01 turns a second.
const STANDSTILL_TURNS_S: f64 = 0.01;
/// A stop that takes longer ends here, so that a fault reaction always does.
const STOP_MAX_S: f64 = 1.0;
/// Part of the velocity loop's bandwidth that the position loop has. Assumed: cascaded loops are tuned a factor 4 to 8 apart.
const POSITION_LOOP_PART: f64 = 1.0 / 6.0;

/// How an axis is built.
#[derive(Clone, Debug)]
pub struct AxisConfig {
    /// The robot's joint behind it.
    pub joint: usize,
    /// Counts a turn of the motor.
    pub encoder_counts: u32,
    /// Counts a turn of the encoder behind the gear, where there is one.
    pub link_encoder_counts: Option<u32>,
    /// Counts added to the position at start, to begin near the end of 32 bits.
    pub first_count: i64,
    /// Torque of 1000 per mille, mNm.
    pub rated_torque_mnm: u32,
    /// Most torque, per mille.
    pub torque_limit_permille: u16,
    /// Current at rated torque, mA.
    pub rated_current_ma: u32,
    /// Rotor inertia, which the velocity loop is tuned for.
    pub rotor_inertia_kg_m2: f64,
    /// Bandwidth of the velocity loop with the rotor alone.
    pub velocity_bandwidth_hz: f64,
    /// Its integral time.
    pub velocity_integral_s: f64,
    /// From the order to open the brake until the shaft is free.
    pub brake_release_s: f64,
    /// From the order to close it until it holds.
    pub brake_engage_s: f64,
    /// Self-test after power-up.
    pub self_test_s: f64,
    /// Operation enabled with a target that is not neutral is a fault: torque or velocity not 0.
    pub strict_enabling: bool,
}

/// What an axis's sensors say, motor side but for the link encoder.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sensed {
    /// Motor angle.
    pub motor_position_rad: f64,
    /// Motor velocity; NaN where the drive derives it.
    pub motor_velocity_rad_s: f64,
    /// Motor torque.
    pub motor_torque_nm: f64,
    /// Joint angle; NaN where there is no encoder for it.
    pub link_position_rad: f64,
}

/// What the bus does, as far as an axis has to know.
#[derive(Clone, Copy, Debug, Default)]
pub struct BusState {
    /// The slave is in OP.
    pub operational: bool,
    /// Controlword and the mode's target are part of the outputs.
    pub mapped: Mapped,
}

/// Which outputs of an axis the master sends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the objects")]
pub struct Mapped {
    pub controlword: bool,
    pub position: bool,
    pub velocity: bool,
    pub torque: bool,
}

impl Mapped {
    fn has_target_of(self, mode: i8) -> bool {
        match mode {
            mode::CYCLIC_POSITION => self.position,
            mode::CYCLIC_VELOCITY => self.velocity,
            mode::CYCLIC_TORQUE => self.torque,
            _ => true,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Brake {
    Closed,
    Opening { open_in_s: f64 },
    Open,
    Closing { closed_in_s: f64 },
}

/// One axis.
#[derive(Clone, Debug)]
pub struct Axis {
    config: AxisConfig,
    offset: u16,
    machine: PowerMachine,
    brake: Brake,
    tested_in_s: f64,
    /// A fault that came up since the last step.
    raised: Option<u16>,
    /// A fault whose cause stays.
    persisting: bool,
    brown_out: bool,
    new_fault: Option<u16>,
    stop_s: f64,
    ramp_turns_s: f64,
    integral_nm: f64,
    following_s: f64,
    velocity_turns_s: f64,
    last_position_rad: Option<f64>,
    command: JointCommand,
    limited: bool,
}

impl Axis {
    /// Axis `position` of a slave, after power-up.
    pub fn new(config: AxisConfig, position: usize) -> Self {
        Self {
            tested_in_s: config.self_test_s,
            config,
            offset: AXIS_OFFSET * position as u16,
            machine: PowerMachine::default(),
            brake: Brake::Closed,
            raised: None,
            persisting: false,
            brown_out: false,
            new_fault: None,
            stop_s: 0.0,
            ramp_turns_s: 0.0,
            integral_nm: 0.0,
            following_s: 0.0,
            velocity_turns_s: 0.0,
            last_position_rad: None,
            command: JointCommand::default(),
            limited: false,
        }
    }

    /// How it is built.
    pub fn config(&self) -> &AxisConfig {
        &self.config
    }

    /// Where it stands.
    pub fn state(&self) -> PowerState {
        self.machine.state()
    }

    /// What it asks of the motor until the next step.
    pub fn command(&self) -> JointCommand {
        self.command
    }

    /// What came up since this was asked last.
    pub fn take_new_fault(&mut self) -> Option<u16> {
        self.new_fault.take()
    }

    /// Makes a fault come up. One that persists cannot be reset.
    pub fn raise(&mut self, code: u16, persists: bool) {
        self.raised.get_or_insert(code);
        self.persisting |= persists;
    }

    /// The cause of a persisting fault is gone.
    pub fn clear_cause(&mut self) {
        self.persisting = false;
    }

    /// High voltage breaks down, or comes back.
    pub fn set_brown_out(&mut self, brown_out: bool) {
        self.brown_out = brown_out;
        if brown_out {
            self.raise(error_code::UNDERVOLTAGE, false);
        }
    }

    /// Power was off: everything starts anew. Where the brake is, is mechanics.
    pub fn power_cycle(&mut self) {
        *self = Self::new(self.config.clone(), usize::from(self.offset / AXIS_OFFSET));
    }

    /// Writes the axis's objects into a dictionary.
    pub fn add_objects(&self, dictionary: &mut Dictionary) {
        use DataType::*;
        let at = |index: u16| index + self.offset;
        let config = &self.config;
        let counts = i64::from(config.encoder_counts);
        let mut add = |index: u16, entry: Entry| dictionary.variable(at(index), entry);
        let signed = |name: &str, value: i64| Entry::new(I32, name, value);
        add(0x603f, Entry::new(U16, "Error code", 0).tx());
        add(0x6040, Entry::new(U16, "Controlword", 0).rx());
        add(0x6041, Entry::new(U16, "Statusword", 0).tx());
        let option = |name: &str, value: i64, most: i64| {
            Entry::new(I16, name, value).writable().within(0, most)
        };
        add(0x605a, option("Quick stop option code", 2, 6));
        add(0x605b, option("Shutdown option code", 0, 1));
        add(0x605c, option("Disable operation option code", 0, 1));
        add(0x605d, option("Halt option code", 1, 3));
        add(0x605e, option("Fault reaction option code", 2, 2));
        add(
            0x6060,
            Entry::new(I8, "Modes of operation", 0).rx().within(0, 10),
        );
        add(0x6061, Entry::new(I8, "Modes of operation display", 0).tx());
        add(0x6062, signed("Position demand value", 0).tx());
        add(0x6064, signed("Position actual value", 0).tx());
        let window = (i64::from(config.encoder_counts) * 10).min(i64::from(u32::MAX));
        add(
            0x6065,
            Entry::new(U32, "Following error window", window).writable(),
        );
        add(
            0x6066,
            Entry::new(U16, "Following error time out", 10).writable(),
        );
        add(0x606b, signed("Velocity demand value", 0).tx());
        add(0x606c, signed("Velocity actual value", 0).tx());
        add(0x6071, Entry::new(I16, "Target torque", 0).rx());
        let limit = i64::from(config.torque_limit_permille);
        add(
            0x6072,
            Entry::new(U16, "Max torque", limit).rx().within(0, limit),
        );
        add(0x6074, Entry::new(I16, "Torque demand value", 0).tx());
        add(
            0x6075,
            Entry::new(
                U32,
                "Motor rated current",
                i64::from(config.rated_current_ma),
            ),
        );
        add(
            0x6076,
            Entry::new(
                U32,
                "Motor rated torque",
                i64::from(config.rated_torque_mnm),
            ),
        );
        add(0x6077, Entry::new(I16, "Torque actual value", 0).tx());
        add(0x6078, Entry::new(I16, "Current actual value", 0).tx());
        add(
            0x6079,
            Entry::new(U32, "DC link circuit voltage", LINK_VOLTAGE_MV).tx(),
        );
        add(0x607a, signed("Target position", 0).rx());
        add(0x607c, signed("Home offset", 0).writable());
        add(0x607e, Entry::new(U8, "Polarity", 0).pre_op());
        add(0x6080, Entry::new(U32, "Max motor speed", 6000).writable());
        let deceleration = (counts * 100).min(i64::from(u32::MAX));
        add(
            0x6085,
            Entry::new(U32, "Quick stop deceleration", deceleration)
                .writable()
                .within(1, i64::from(u32::MAX)),
        );
        add(0x60b0, signed("Position offset", 0).rx());
        add(0x60b1, signed("Velocity offset", 0).rx());
        add(0x60b2, Entry::new(I16, "Torque offset", 0).rx());
        add(
            0x60e0,
            Entry::new(U16, "Positive torque limit value", limit).rx(),
        );
        add(
            0x60e1,
            Entry::new(U16, "Negative torque limit value", limit).rx(),
        );
        add(0x60f4, signed("Following error actual value", 0).tx());
        add(0x60fd, Entry::new(U32, "Digital inputs", 0).tx());
        add(0x60ff, signed("Target velocity", 0).rx());
        // cyclic position, velocity and torque (bits 7 to 9)
        add(0x6502, Entry::new(U32, "Supported drive modes", 0x380));
        // servo drive of profile 402
        add(0x67ff, Entry::new(U32, "Single device type", 0x0002_0192));
        let unsigned = |name: &str, value: i64| Entry::new(U32, name, value);
        dictionary.record(
            at(0x607d),
            "Software position limit",
            [
                signed("Min position limit", i64::from(i32::MIN)).writable(),
                signed("Max position limit", i64::from(i32::MAX)).writable(),
            ],
        );
        dictionary.record(
            at(0x608f),
            "Position encoder resolution",
            [
                unsigned("Encoder increments", counts),
                unsigned("Motor revolutions", 1),
            ],
        );
        dictionary.record(
            at(0x6091),
            "Gear ratio",
            [
                unsigned("Motor revolutions", 1),
                unsigned("Shaft revolutions", 1),
            ],
        );
        dictionary.record(
            at(0x60c2),
            "Interpolation time period",
            [
                Entry::new(U8, "Interpolation time period value", 1).writable(),
                Entry::new(I8, "Interpolation time index", -3)
                    .writable()
                    .within(-6, 0),
            ],
        );
        if let Some(counts) = config.link_encoder_counts {
            dictionary.record(
                at(0x60e4),
                "Additional position actual value",
                [signed("1st additional position actual value", 0).tx()],
            );
            dictionary.record(
                at(0x60e6),
                "Additional position encoder resolution - encoder increments",
                [unsigned(
                    "1st additional encoder increments",
                    i64::from(counts),
                )],
            );
            dictionary.record(
                at(0x60eb),
                "Additional position encoder resolution - motor revolutions",
                [unsigned("1st additional motor revolutions", 1)],
            );
        }
    }

    /// One step of the drive's own cycle, `step_s` long: outputs and sensors in, the next command and the inputs out.
    pub fn step(
        &mut self,
        dictionary: &mut Dictionary,
        sensed: &Sensed,
        bus: BusState,
        step_s: f64,
    ) {
        let offset = self.offset;
        let at = |index: u16| index + offset;
        self.tested_in_s = (self.tested_in_s - step_s).max(0.0);
        self.measure(sensed, step_s);
        let mode = dictionary.number(at(0x6060), 0) as i8;
        dictionary.set(at(0x6061), 0, i64::from(mode));
        if self.state().has_torque() && !bus.operational {
            self.raise(error_code::SYNC_CONTROLLER, false);
        }
        let before = self.state();
        self.power(dictionary, bus, mode);
        if self.state() != before {
            self.entered(before);
        }
        self.move_brake(step_s);
        self.drive(dictionary, sensed, mode, step_s);
        self.report(dictionary, sensed, bus);
    }

    fn counts_turn(&self) -> f64 {
        f64::from(self.config.encoder_counts)
    }

    fn measure(&mut self, sensed: &Sensed, step_s: f64) {
        let last_rad = self
            .last_position_rad
            .replace(sensed.motor_position_rad)
            .unwrap_or(sensed.motor_position_rad);
        self.velocity_turns_s = if sensed.motor_velocity_rad_s.is_finite() {
            sensed.motor_velocity_rad_s / TAU
        } else {
            let velocity_turns_s = (sensed.motor_position_rad - last_rad) / step_s / TAU;
            // a low-pass of a third a step against the encoder's digits
            self.velocity_turns_s + (velocity_turns_s - self.velocity_turns_s) / 3.0
        };
    }

    fn power(&mut self, dictionary: &mut Dictionary, bus: BusState, mode: i8) {
        let offset = self.offset;
        let at = |index: u16| index + offset;
        let controlword = dictionary.number(at(0x6040), 0) as u16;
        let reacting = matches!(
            self.state(),
            PowerState::FaultReactionActive | PowerState::QuickStopActive
        );
        let ramps = match self.state() {
            PowerState::FaultReactionActive => dictionary.number(at(0x605e), 0) != 0,
            _ => dictionary.number(at(0x605a), 0) != 0,
        };
        let stands = self.velocity_turns_s.abs() < STANDSTILL_TURNS_S && self.ramp_turns_s == 0.0;
        let conditions = Conditions {
            voltage: !self.brown_out,
            tested: self.tested_in_s == 0.0,
            fault: self.raised.is_some(),
            fault_persists: self.persisting || self.brown_out,
            stopped: reacting && (stands || !ramps || self.stop_s > STOP_MAX_S),
            stays_in_quick_stop: dictionary.number(at(0x605a), 0) >= 5,
        };
        match self.machine.step(controlword, conditions) {
            Some(4) => {
                if let Some(code) = self.refuses(dictionary, bus, mode) {
                    self.raise(code, false);
                }
            }
            Some(13) => {
                let code = self.raised.take().unwrap_or(error_code::PARAMETER);
                dictionary.set(at(0x603f), 0, i64::from(code));
                self.new_fault = Some(code);
            }
            Some(15) => dictionary.set(at(0x603f), 0, 0),
            _ => {}
        }
        if matches!(
            self.state(),
            PowerState::Fault | PowerState::FaultReactionActive
        ) {
            self.raised = None;
        }
    }

    /// Why operation is not to be enabled, where something speaks against it.
    fn refuses(&self, dictionary: &Dictionary, bus: BusState, mode: i8) -> Option<u16> {
        let at = |index: u16| index + self.offset;
        if !bus.operational {
            return Some(error_code::SYNC_CONTROLLER);
        }
        if mode == mode::NONE || !bus.mapped.has_target_of(mode) {
            return Some(error_code::PARAMETER);
        }
        let target = |index: u16| dictionary.number(at(index), 0);
        match mode {
            mode::CYCLIC_POSITION => {
                let apart = (target(0x607a) as i32).wrapping_sub(target(0x6064) as i32);
                let window = target(0x6065);
                (i64::from(apart).abs() > window).then_some(error_code::FOLLOWING_ERROR)
            }
            mode::CYCLIC_VELOCITY => (self.config.strict_enabling && target(0x60ff) != 0)
                .then_some(error_code::TARGET_AT_ENABLING),
            _ => (self.config.strict_enabling && target(0x6071) != 0)
                .then_some(error_code::TARGET_AT_ENABLING),
        }
    }

    fn entered(&mut self, before: PowerState) {
        self.stop_s = 0.0;
        self.ramp_turns_s = self.velocity_turns_s;
        let torque = self.state().has_torque();
        if torque && !before.has_torque() {
            self.integral_nm = 0.0;
            self.following_s = 0.0;
            self.brake = Brake::Opening {
                open_in_s: self.config.brake_release_s,
            };
        }
        if !torque && self.brake != Brake::Closed {
            self.brake = Brake::Closing {
                closed_in_s: self.config.brake_engage_s,
            };
        }
    }

    fn move_brake(&mut self, step_s: f64) {
        self.brake = match self.brake {
            Brake::Opening { open_in_s } if open_in_s <= step_s => Brake::Open,
            Brake::Opening { open_in_s } => Brake::Opening {
                open_in_s: open_in_s - step_s,
            },
            Brake::Closing { closed_in_s } if closed_in_s <= step_s => Brake::Closed,
            Brake::Closing { closed_in_s } => Brake::Closing {
                closed_in_s: closed_in_s - step_s,
            },
            brake => brake,
        };
    }

    /// -1 where a bit of the polarity object (0x607e) turns a quantity round: 7 position, 6 velocity, and 5 torque as several
    /// makers have it.
    fn sign(&self, dictionary: &Dictionary, bit: u8) -> f64 {
        let polarity = dictionary.number(0x607e + self.offset, 0);
        if polarity >> bit & 1 == 0 { 1.0 } else { -1.0 }
    }

    fn drive(&mut self, dictionary: &mut Dictionary, sensed: &Sensed, mode: i8, step_s: f64) {
        let torque_nm = match self.state() {
            PowerState::OperationEnabled if self.brake == Brake::Open => {
                self.follow(dictionary, sensed, mode, step_s)
            }
            PowerState::QuickStopActive | PowerState::FaultReactionActive => {
                self.slow_down(dictionary, step_s)
            }
            // An axis that is switched off holds until its brake does; one in a fault cannot.
            state if state != PowerState::Fault && matches!(self.brake, Brake::Closing { .. }) => {
                self.velocity_loop(0.0, step_s)
            }
            _ => {
                self.integral_nm = 0.0;
                0.0
            }
        };
        let torque_nm = self.limit(dictionary, torque_nm);
        let holds = matches!(self.brake, Brake::Closed | Brake::Opening { .. });
        self.command = JointCommand {
            mode: if holds {
                PlantMode::Braked
            } else {
                PlantMode::Torque
            },
            motor_torque_nm: torque_nm,
            joint_velocity_rad_s: 0.0,
        };
    }

    fn follow(
        &mut self,
        dictionary: &mut Dictionary,
        sensed: &Sensed,
        mode: i8,
        step_s: f64,
    ) -> f64 {
        let offset = self.offset;
        let at = |index: u16| index + offset;
        let (position_sign, velocity_sign, torque_sign) = (
            self.sign(dictionary, 7),
            self.sign(dictionary, 6),
            self.sign(dictionary, 5),
        );
        let number = |index: u16| dictionary.number(at(index), 0);
        let permille_nm = f64::from(self.config.rated_torque_mnm) * 1e-6;
        let offset_nm = number(0x60b2) as f64 * permille_nm * torque_sign;
        let velocity_offset = number(0x60b1) as f64 / self.counts_turn() * velocity_sign;
        match mode {
            mode::CYCLIC_TORQUE => number(0x6071) as f64 * permille_nm * torque_sign + offset_nm,
            mode::CYCLIC_VELOCITY => {
                let target = number(0x60ff) as f64 / self.counts_turn() * velocity_sign;
                self.velocity_loop(target + velocity_offset, step_s) + offset_nm
            }
            mode::CYCLIC_POSITION => {
                let target = (number(0x607a) as i32).wrapping_add(number(0x60b0) as i32);
                let actual = self.position_count(dictionary, sensed) as i32;
                let apart = target.wrapping_sub(actual);
                dictionary.set(at(0x60f4), 0, i64::from(apart));
                dictionary.set(at(0x6062), 0, i64::from(target));
                self.watch_following(dictionary, apart, step_s);
                let gain_1_s = TAU * self.config.velocity_bandwidth_hz * POSITION_LOOP_PART;
                let apart_turns = f64::from(apart) / self.counts_turn() * position_sign;
                let velocity = gain_1_s * apart_turns + velocity_offset;
                self.velocity_loop(velocity, step_s) + offset_nm
            }
            _ => 0.0,
        }
    }

    fn watch_following(&mut self, dictionary: &Dictionary, apart: i32, step_s: f64) {
        let window = dictionary.number(0x6065 + self.offset, 0);
        let time_out_s = dictionary.number(0x6066 + self.offset, 0) as f64 * 1e-3;
        if window == i64::from(u32::MAX) || i64::from(apart).abs() <= window {
            self.following_s = 0.0;
            return;
        }
        self.following_s += step_s;
        if self.following_s > time_out_s {
            self.raise(error_code::FOLLOWING_ERROR, false);
        }
    }

    fn slow_down(&mut self, dictionary: &Dictionary, step_s: f64) -> f64 {
        self.stop_s += step_s;
        let deceleration = dictionary.number(0x6085 + self.offset, 0) as f64 / self.counts_turn();
        let less = deceleration * step_s;
        self.ramp_turns_s = if self.ramp_turns_s.abs() <= less {
            0.0
        } else {
            self.ramp_turns_s - less * self.ramp_turns_s.signum()
        };
        self.velocity_loop(self.ramp_turns_s, step_s)
    }

    /// Proportional-integral, tuned for the rotor; the integral stops where the torque is at its limit.
    fn velocity_loop(&mut self, target_turns_s: f64, step_s: f64) -> f64 {
        let gain_nm_s_turn =
            TAU * self.config.velocity_bandwidth_hz * self.config.rotor_inertia_kg_m2 * TAU;
        let proportional_nm = gain_nm_s_turn * (target_turns_s - self.velocity_turns_s);
        if !self.limited {
            self.integral_nm += proportional_nm * step_s / self.config.velocity_integral_s;
        }
        proportional_nm + self.integral_nm
    }

    fn limit(&mut self, dictionary: &Dictionary, torque_nm: f64) -> f64 {
        let offset = self.offset;
        let at = |index: u16| index + offset;
        let permille_nm = f64::from(self.config.rated_torque_mnm) * 1e-6;
        let most = dictionary.number(at(0x6072), 0);
        let limit_nm = |index: u16| most.min(dictionary.number(at(index), 0)) as f64 * permille_nm;
        let (up_nm, down_nm) = (limit_nm(0x60e0), limit_nm(0x60e1));
        let limited_nm = torque_nm.clamp(-down_nm, up_nm);
        self.limited = limited_nm != torque_nm;
        limited_nm
    }

    /// Position as counted, all turns.
    fn position_count(&self, dictionary: &Dictionary, sensed: &Sensed) -> i64 {
        let turns = sensed.motor_position_rad / TAU * self.sign(dictionary, 7);
        let counted = (turns * self.counts_turn()).round() as i64;
        counted + self.config.first_count + dictionary.number(0x607c + self.offset, 0)
    }

    fn report(&self, dictionary: &mut Dictionary, sensed: &Sensed, bus: BusState) {
        const VOLTAGE: u16 = 0x0010;
        const REMOTE: u16 = 0x0200;
        const LIMITED: u16 = 0x0800;
        const FOLLOWS: u16 = 0x1000;
        let at = |index: u16| index + self.offset;
        let follows = self.state() == PowerState::OperationEnabled && self.brake == Brake::Open;
        let bits = [
            (!self.brown_out, VOLTAGE),
            (bus.operational, REMOTE),
            (self.limited, LIMITED),
            (follows, FOLLOWS),
        ];
        let set = |(is_set, bit): (bool, u16)| if is_set { bit } else { 0 };
        let status = bits
            .into_iter()
            .map(set)
            .fold(self.state().status_bits(), |word, bit| word | bit);
        dictionary.set(at(0x6041), 0, i64::from(status));
        let position = self.position_count(dictionary, sensed);
        let velocity = self.velocity_turns_s * self.counts_turn() * self.sign(dictionary, 6);
        let permille_nm = f64::from(self.config.rated_torque_mnm) * 1e-6;
        let torque_sign = self.sign(dictionary, 5);
        let permille = |torque_nm: f64| (torque_nm / permille_nm * torque_sign).round() as i64;
        let demand_nm = self.command.motor_torque_nm;
        let voltage_mv = if self.brown_out {
            BROWN_OUT_MV
        } else {
            LINK_VOLTAGE_MV
        };
        let values = [
            (0x6064, position),
            (0x606c, velocity.round() as i64),
            (0x6074, permille(demand_nm)),
            (0x6077, permille(sensed.motor_torque_nm)),
            (0x6078, permille(sensed.motor_torque_nm)),
            (0x6079, voltage_mv),
        ];
        for (index, value) in values {
            dictionary.set(at(index), 0, value);
        }
        if let Some(counts) = self.config.link_encoder_counts {
            let turns = sensed.link_position_rad / TAU * self.sign(dictionary, 7);
            let count = (turns * f64::from(counts)).round() as i64;
            dictionary.set(at(0x60e4), 1, count);
        }
    }
}
