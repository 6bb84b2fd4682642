//! Whatever another process writes into shared memory: nobody who reads it panics, hangs or keeps what is no number.
//!
//! `PROPTEST_CASES=N cargo test --release -p fault-injection --test any_messages` tries N sequences with each reader.

use std::sync::LazyLock;

use plant_emulator::drives::EmulatedDrives;
use plant_emulator::process::emulated_plant;
use proptest::prelude::*;
use rand_core::RngCore;
use rand_pcg::Pcg32;
use robot::Robot;
use rt_loop::admission::{admits_command, check_sample};
use rt_loop::statistics::Counters;
use rt_loop::supervision::SupervisorWatch;
use services::controller::Controller;
use services::estimators::Estimators;
use services::relay::{Assembler, record_row};
use services::tracking::Tracking;
use shm_types::control_options::ControlOptions;
use shm_types::drive::{BusReport, DriveReport};
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use shm_types::messages::{
    Command, DriveCommand, DriveMode, DriveSample, Estimates, ExternalTorque, Header, LoopState,
    LoopStatus, PerJoint, PlantTruth, Readings, SensorSample, Supervision, TorqueEstimate,
};

const PERIOD_NS: u64 = 666_667;
const SESSION: u64 = 7;
/// After so many good messages nothing of a bad one may be left: a second.
const RECOVERY_CYCLES: u64 = 1500;

fn shd17() -> Robot {
    static SHD17: LazyLock<Robot> = LazyLock::new(|| robot::load("shd17").expect("shipped"));
    SHD17.clone()
}

fn run(options: ControlOptions) -> RunConfig {
    RunConfig {
        session: SESSION,
        robot: "shd17".to_owned(),
        driver: "emulator".to_owned(),
        trajectory: "sine".to_owned(),
        plant: None,
        control: ControlMode::Torque,
        options,
        mode: Mode::Lockstep,
        period_ns: PERIOD_NS,
        cycles: 0,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        estimators: Vec::new(),
        command_deadline_ns: PERIOD_NS,
        cores: Vec::new(),
        initial_position_rad: vec![0.0],
    }
}

fn controller(options: ControlOptions) -> Controller {
    let robot = shd17();
    let trajectory = motion::load("sine", &robot).expect("shipped");
    Controller::new(&run(options), robot, trajectory).expect("controllable")
}

fn good_sample(cycle: u64) -> SensorSample {
    let mut readings = Readings::default();
    readings.motor_position_rad[0] = 1e-4 * (cycle % 100) as f64;
    readings.link_position_rad[0] = 1e-6 * (cycle % 100) as f64;
    readings.motor_torque_nm[0] = 0.01;
    readings.joint_torque_nm[0] = 1.0;
    SensorSample {
        header: Header {
            session: SESSION,
            cycle,
            measured_at_ns: cycle * PERIOD_NS,
            joint_count: 1,
        },
        motion_time_ns: cycle * PERIOD_NS,
        motion_rate: 1.0,
        state: LoopState::Running as u32,
        reserved: 0,
        readings,
    }
}

/// Messages as another process may write them: some values as they should be, some as they could not be.
struct Anything(Pcg32);

impl Anything {
    fn below(&mut self, bound: u32) -> u32 {
        self.0.next_u32() % bound
    }

    fn number(&mut self) -> f64 {
        let odd = [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            0.0,
            1e12,
        ];
        match self.below(6) {
            0 => f64::from_bits(self.0.next_u64()),
            1 => odd[self.below(6) as usize],
            _ => f64::from(self.0.next_u32()) / f64::from(u32::MAX) * 2.0 - 1.0,
        }
    }

    fn per_joint(&mut self) -> PerJoint {
        std::array::from_fn(|_| self.number())
    }

    fn mode(&mut self) -> u32 {
        match self.below(6) {
            0 => self.0.next_u32(),
            _ => self.below(5),
        }
    }

    fn header(&mut self) -> Header {
        Header {
            session: match self.below(5) {
                0 => self.0.next_u64(),
                _ => SESSION,
            },
            cycle: match self.below(6) {
                0 => self.0.next_u64(),
                1 => u64::MAX,
                _ => u64::from(self.below(5000)),
            },
            measured_at_ns: self.0.next_u64(),
            joint_count: match self.below(8) {
                0 => self.0.next_u64(),
                1 => 17,
                _ => 1,
            },
        }
    }

    fn readings(&mut self) -> Readings {
        Readings {
            motor_position_rad: self.per_joint(),
            motor_velocity_rad_s: self.per_joint(),
            link_position_rad: self.per_joint(),
            link_velocity_rad_s: self.per_joint(),
            motor_torque_nm: self.per_joint(),
            joint_torque_nm: self.per_joint(),
            motor_current_a: self.per_joint(),
            temperature_c: self.per_joint(),
        }
    }

    fn sensor_sample(&mut self) -> SensorSample {
        SensorSample {
            header: self.header(),
            motion_time_ns: self.0.next_u64(),
            motion_rate: self.number(),
            state: self.mode(),
            reserved: 0,
            readings: self.readings(),
        }
    }

    fn command(&mut self) -> Command {
        Command {
            header: self.header(),
            mode: self.mode(),
            reserved: 0,
            motor_torque_nm: self.per_joint(),
            joint_velocity_rad_s: self.per_joint(),
            feedforward_torque_nm: self.per_joint(),
            feedback_torque_nm: self.per_joint(),
            reference_position_rad: self.per_joint(),
            reference_velocity_rad_s: self.per_joint(),
            reference_acceleration_rad_s2: self.per_joint(),
        }
    }

    fn drive_command(&mut self) -> DriveCommand {
        DriveCommand {
            header: self.header(),
            mode: self.mode(),
            request: self.mode(),
            motor_torque_nm: self.per_joint(),
            joint_velocity_rad_s: self.per_joint(),
            joint_mode: std::array::from_fn(|_| self.mode()),
            joint_position_rad: self.per_joint(),
            position_gain_scale: self.per_joint(),
            velocity_gain_scale: self.per_joint(),
        }
    }

    fn drives(&mut self) -> DriveReport {
        DriveReport {
            state: std::array::from_fn(|_| self.mode()),
            mode: std::array::from_fn(|_| self.mode()),
            status_word: std::array::from_fn(|_| self.0.next_u32()),
            error_code: std::array::from_fn(|_| self.0.next_u32()),
            device_status: std::array::from_fn(|_| self.mode()),
            age_cycles: std::array::from_fn(|_| self.mode()),
            warnings: std::array::from_fn(|_| self.0.next_u32()),
            position_validity: std::array::from_fn(|_| self.mode()),
            supply_voltage_v: self.per_joint(),
        }
    }

    fn bus(&mut self) -> BusReport {
        BusReport {
            clock: self.mode(),
            faults: self.mode(),
            working_counter_expected: self.0.next_u32(),
            working_counter: self.0.next_u32(),
            clock_offset_ns: self.0.next_u64() as i64,
            frames_lost: self.0.next_u64(),
            jitter_ns: self.0.next_u64(),
        }
    }

    fn drive_sample(&mut self) -> DriveSample {
        DriveSample {
            header: self.header(),
            readings: self.readings(),
            commands_missed: self.0.next_u32(),
            mode: self.mode(),
            inputs: self.0.next_u32(),
            reserved: 0,
            drives: self.drives(),
            bus: self.bus(),
        }
    }

    fn estimate(&mut self) -> TorqueEstimate {
        TorqueEstimate {
            header: self.header(),
            residual: self.estimates(),
            structural_damping: self.estimates(),
            compliance: self.estimates(),
            taghirad: self.estimates(),
            disturbance_observer: self.estimates(),
            gaussian_process: self.estimates(),
            fusion: self.estimates(),
            external: ExternalTorque {
                torque_nm: self.per_joint(),
                std_nm: self.per_joint(),
                threshold_nm: self.per_joint(),
                contact_joints: self.0.next_u64(),
            },
        }
    }

    fn estimates(&mut self) -> Estimates {
        Estimates {
            torque_nm: self.per_joint(),
            std_nm: self.per_joint(),
            age_cycles: std::array::from_fn(|_| self.0.next_u32()),
            validity: std::array::from_fn(|_| self.mode()),
        }
    }

    fn status(&mut self) -> LoopStatus {
        LoopStatus {
            header: self.header(),
            state: self.mode(),
            fault: self.0.next_u32(),
            limited_joints: self.0.next_u64(),
            wakeup_lateness_ns: self.0.next_u64(),
            missed_deadlines: self.0.next_u64(),
            stale_commands: self.0.next_u64(),
            motor_torque_nm: self.per_joint(),
            drives: self.drives(),
            bus: self.bus(),
            ..LoopStatus::default()
        }
    }

    fn truth(&mut self) -> PlantTruth {
        PlantTruth {
            header: self.header(),
            link_position_rad: self.per_joint(),
            link_velocity_rad_s: self.per_joint(),
            joint_torque_nm: self.per_joint(),
            friction_torque_nm: self.per_joint(),
        }
    }
}

fn anything() -> impl Strategy<Value = u64> {
    any::<u64>()
}

/// How many messages a sequence has.
const MESSAGES: usize = 8;

proptest! {
    /// The loop takes no command but a finite one of its session, robot and cycle.
    #[test]
    fn the_loop_admits_nothing_but_an_answer(seed in anything()) {
        let mut any = Anything(Pcg32::new(seed, 0));
        let asked = Header { session: SESSION, joint_count: 1, ..any.header() };
        let mut counters = Counters::default();
        for _ in 0..MESSAGES {
            let mut command = any.command();
            if any.below(2) == 0 {
                command.header = asked;
            }
            if admits_command(&command, &asked, &mut counters) {
                prop_assert_eq!((command.header.session, command.header.cycle), (SESSION, asked.cycle));
                prop_assert!(command.mode == DriveMode::Velocity as u32 || command.motor_torque_nm[0].is_finite());
                prop_assert!(command.mode == DriveMode::Torque as u32 || command.joint_velocity_rad_s[0].is_finite());
            }
        }
    }

    #[test]
    fn the_loop_admits_no_sample_but_one_of_its_cycle(seed in anything()) {
        let mut any = Anything(Pcg32::new(seed, 0));
        for _ in 0..MESSAGES {
            let sample = any.drive_sample();
            let cycle = if any.below(2) == 0 { sample.header.cycle } else { 100 };
            if check_sample(&sample, SESSION, cycle, 1).is_ok() {
                prop_assert_eq!((sample.header.session, sample.header.cycle), (SESSION, cycle));
                prop_assert!(sample.readings.motor_position_rad[0].is_finite());
            }
        }
    }

    #[test]
    fn a_foreign_supervisor_is_not_heard(seed in anything()) {
        let mut any = Anything(Pcg32::new(seed, 0));
        let mut watch = SupervisorWatch::new(SESSION, Some(3));
        for _ in 0..MESSAGES {
            let session = any.header().session;
            let message = Supervision { session, sent_at_ns: 0, emergency_stop: any.below(2), resets: any.mode() };
            let mut heard = watch;
            let orders = heard.orders(std::iter::once(message));
            prop_assert!(session == SESSION || !orders.reset);
            if session == SESSION { watch = heard; }
        }
    }

    /// The controller answers good samples with numbers again, whatever came before.
    #[test]
    fn the_controller_forgets_what_was_no_number(seed in anything(), corrected in any::<bool>()) {
        let mut any = Anything(Pcg32::new(seed, 0));
        let correction_gain = if corrected { 1.0 } else { 0.0 };
        let mut controller = controller(ControlOptions { correction_gain, ..ControlOptions::default() });
        for _ in 0..MESSAGES {
            let mut sample = any.sensor_sample();
            if any.below(2) == 0 {
                sample.motion_rate = 1.0;
                sample.header.cycle = 4990 + u64::from(any.below(10));
            }
            if let Some(sample) = sample.checked(SESSION, 1) {
                controller.command(&sample);
            }
            let estimate = any.estimate();
            if estimate.header.check(SESSION, 1).is_ok() {
                controller.take_estimate(estimate);
            }
        }
        let last = (5000..5000 + RECOVERY_CYCLES).map(|cycle| controller.command(&good_sample(cycle))).last().flatten();
        let command = last.expect("answers");
        prop_assert!(command.motor_torque_nm[0].is_finite(), "{}", command.motor_torque_nm[0]);
    }

    /// So do the estimators.
    #[test]
    fn the_estimators_forget_what_was_no_number(seed in anything()) {
        let mut any = Anything(Pcg32::new(seed, 0));
        let mut estimators = Estimators::new(&shd17(), &[], PERIOD_NS as f64 * 1e-9).expect("a shipped robot");
        for _ in 0..MESSAGES {
            let mut sample = any.sensor_sample();
            if any.below(2) == 0 {
                sample.motion_rate = 1.0;
                sample.header.cycle = 4990 + u64::from(any.below(10));
            }
            if let Some(sample) = sample.checked(SESSION, 1) {
                estimators.estimate(&sample);
            }
        }
        let last = (5000..5000 + RECOVERY_CYCLES).map(|cycle| estimators.estimate(&good_sample(cycle))).last();
        let estimate = last.expect("answers");
        prop_assert!(estimate.residual.torque_nm[0].is_finite());
        prop_assert!(estimate.structural_damping.torque_nm[0].is_finite());
    }

    /// The drives obey no command that is none, and their sensors go on showing numbers.
    #[test]
    fn the_drives_survive_any_command(seed in anything()) {
        let mut any = Anything(Pcg32::new(seed, 0));
        let plant = emulated_plant(&shd17(), &run(ControlOptions::default()), &[]).expect("a plant");
        let mut drives = EmulatedDrives::new(plant, SESSION, &shd17(), PERIOD_NS);
        for _ in 0..MESSAGES {
            drives.take(any.drive_command());
            for _ in 0..20 {
                drives.advance();
            }
            let (sample, truth) = drives.measure(0);
            prop_assert!(sample.readings.motor_position_rad[0].is_finite());
            prop_assert!(truth.link_position_rad[0].is_finite());
        }
    }

    /// The relay makes rows of anything, in order, without growing.
    #[test]
    fn the_relay_survives_any_message(seed in anything()) {
        let mut any = Anything(Pcg32::new(seed, 0));
        let mut assembler = Assembler::default();
        let mut tracking = Tracking::new(&shd17());
        let (mut joints, mut truth) = (Vec::new(), Vec::new());
        let mut last_cycle = None;
        for _ in 0..MESSAGES {
            assembler.add_status(any.status());
            let (sample, command) = (any.sensor_sample(), any.command());
            let (estimate, plant) = (any.estimate(), any.truth());
            if let Some(row) = assembler.row(sample.header.cycle) { row.sample = Some(sample); }
            if let Some(row) = assembler.row(command.header.cycle) { row.command = Some(command); }
            if let Some(row) = assembler.row(estimate.header.cycle) { row.estimate = Some(estimate); }
            if let Some(row) = assembler.row(plant.header.cycle) { row.truth = Some(plant); }
            while let Some(row) = assembler.next_due() {
                prop_assert!(last_cycle.is_none_or(|last| last < row.cycle), "in order");
                last_cycle = Some(row.cycle);
                tracking.add(&row);
                record_row(&row, 1, &mut joints, &mut truth);
            }
        }
        prop_assert!(tracking.report().joints.len() == 1);
    }
}
