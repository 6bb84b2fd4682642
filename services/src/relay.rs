//! Puts the messages of one cycle, which several processes send, together into one row.

use std::collections::{BTreeMap, VecDeque};

use recording::{Header, JointCycle, JointTruth, LoopCycle};
use robot::Robot;
use shm_types::control_options::{ControlOptions, FrictionVelocity, StiffnessTorque, Task};
use shm_types::instance::{ControlMode, Mode, RunConfig};
use shm_types::messages::{Command, LoopStatus, PlantTruth, SensorSample, TorqueEstimate};
use shm_types::topics::RELAY_BUFFER;

/// Everything sent about one cycle; a message that did not come is missing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CycleMessages {
    /// The cycle.
    pub cycle: u64,
    /// What was measured.
    pub sample: Option<SensorSample>,
    /// What was asked for.
    pub command: Option<Command>,
    /// What was estimated.
    pub estimate: Option<TorqueEstimate>,
    /// How the cycle went.
    pub status: Option<LoopStatus>,
    /// What the plant really did.
    pub truth: Option<PlantTruth>,
}

/// A cycle waits this long for late messages before it is written: an estimate may come after the cycle's end.
const PATIENCE_CYCLES: u64 = 16;

/// Rows that wait at most: as many as the topics can hold messages of.
const WAITING_MAX: usize = 2 * RELAY_BUFFER;
/// A status further ahead of the one before is nonsense: 11 minutes at 1.5 kHz.
const SKIPPED_MAX_CYCLES: u64 = 1_000_000;
/// No run comes this far: 95 000 years at 1.5 kHz. Times of later cycles could not be counted.
const CYCLE_MAX: u64 = 1 << 42;

/// Collects messages by cycle and gives them back in order, whole. Other processes wrote them: a cycle that cannot be is
/// refused, and no more rows wait than there can be.
#[derive(Clone, Debug, Default)]
pub struct Assembler {
    waiting: VecDeque<CycleMessages>,
    /// Cycles before this one were given back.
    next_cycle: u64,
    newest_status_cycle: Option<u64>,
    /// Messages that came after their cycle was given back.
    pub late_messages: u64,
    /// Messages of cycles that cannot be.
    pub refused_messages: u64,
}

impl Assembler {
    /// The row a message of `cycle` belongs to; `None`, and counted, if it has been given back or cannot be.
    pub fn row(&mut self, cycle: u64) -> Option<&mut CycleMessages> {
        if cycle < self.next_cycle {
            self.late_messages += 1;
            return None;
        }
        let newest = self.newest_status_cycle.unwrap_or(cycle);
        if cycle > newest.saturating_add(WAITING_MAX as u64).min(CYCLE_MAX) {
            self.refused_messages += 1;
            return None;
        }
        let index = self.waiting.partition_point(|row| row.cycle < cycle);
        if self.waiting.get(index).is_none_or(|row| row.cycle != cycle) {
            if self.waiting.len() >= WAITING_MAX {
                self.refused_messages += 1;
                return None;
            }
            self.waiting.insert(
                index,
                CycleMessages {
                    cycle,
                    ..CycleMessages::default()
                },
            );
        }
        self.waiting.get_mut(index)
    }

    /// Takes the message that ends a cycle.
    pub fn add_status(&mut self, status: LoopStatus) {
        let cycle = status.header.cycle;
        let newest = self.newest_status_cycle.unwrap_or(cycle);
        if cycle > newest.saturating_add(SKIPPED_MAX_CYCLES).min(CYCLE_MAX) {
            self.refused_messages += 1;
            return;
        }
        self.newest_status_cycle = Some(newest.max(cycle));
        if let Some(row) = self.row(cycle) {
            row.status = Some(status);
        }
    }

    /// The next cycle that is old enough to be written.
    pub fn next_due(&mut self) -> Option<CycleMessages> {
        let newest = self.newest_status_cycle?;
        let due = |row: &CycleMessages| row.cycle + PATIENCE_CYCLES <= newest;
        if !self.waiting.front().is_some_and(due) {
            return None;
        }
        self.next_left()
    }

    /// The next cycle, however young: at the end of a run. Only cycles the loop has finished count.
    pub fn next_left(&mut self) -> Option<CycleMessages> {
        let row = self.waiting.pop_front()?;
        self.next_cycle = row.cycle + 1;
        self.newest_status_cycle
            .is_some_and(|newest| row.cycle <= newest)
            .then_some(row)
    }
}

/// The row as a recording holds it; `None` without a measurement. `joints` and `truth` are refilled.
pub fn record_row(
    messages: &CycleMessages,
    joint_count: usize,
    joints: &mut Vec<JointCycle>,
    truth: &mut Vec<JointTruth>,
) -> Option<LoopCycle> {
    let sample = messages.sample.as_ref()?;
    joints.clear();
    joints.extend((0..joint_count).map(|joint| joint_cycle(messages, sample, joint)));
    truth.clear();
    if let Some(plant) = &messages.truth {
        truth.extend((0..joint_count).map(|joint| JointTruth {
            link_position_rad: plant.link_position_rad[joint],
            link_velocity_rad_s: plant.link_velocity_rad_s[joint],
            joint_torque_nm: plant.joint_torque_nm[joint],
            friction_torque_nm: plant.friction_torque_nm[joint],
        }));
    }
    Some(messages.status.as_ref().map(loop_cycle).unwrap_or_default())
}

fn control_name(control: ControlMode) -> &'static str {
    match control {
        ControlMode::Torque => "torque",
        ControlMode::Velocity => "velocity",
    }
}

/// The control that [`recording_header`] wrote down; torque control without options where nothing is told.
pub fn recorded_control(metadata: &BTreeMap<String, String>) -> (ControlMode, ControlOptions) {
    let is = |key: &str, value: &str| metadata.get(key).is_some_and(|told| told == value);
    let control = match is("control", control_name(ControlMode::Velocity)) {
        true => ControlMode::Velocity,
        false => ControlMode::Torque,
    };
    let mut options = ControlOptions::default();
    if is("friction_velocity", FrictionVelocity::Measured.name()) {
        options.friction_velocity = FrictionVelocity::Measured;
    }
    if is("stiffness_torque", StiffnessTorque::Torsion.name()) {
        options.stiffness_torque = StiffnessTorque::Torsion;
    }
    let gain = metadata
        .get("correction")
        .and_then(|gain| gain.parse().ok());
    options.correction_gain = gain.unwrap_or_default();
    let task = metadata.get("task").and_then(|name| Task::from_name(name));
    options.task = task.unwrap_or_default();
    (control, options)
}

/// What a recording says about its run.
pub fn recording_header(run: &RunConfig, robot: &Robot) -> Header {
    let mode = match run.mode {
        Mode::Realtime => "realtime",
        Mode::Lockstep => "lockstep",
    };
    let mut metadata = BTreeMap::from(
        [
            ("robot", run.robot.clone()),
            ("driver", run.driver.clone()),
            ("trajectory", run.trajectory.clone()),
            ("mode", mode.to_owned()),
            ("control", control_name(run.control).to_owned()),
            ("seed", run.seed.to_string()),
            ("version", env!("CARGO_PKG_VERSION").to_owned()),
            (
                "friction_velocity",
                run.options.friction_velocity.name().to_owned(),
            ),
            (
                "stiffness_torque",
                run.options.stiffness_torque.name().to_owned(),
            ),
            ("correction", run.options.correction_gain.to_string()),
        ]
        .map(|(key, value)| (key.to_owned(), value)),
    );
    if run.options.task != Task::Follow {
        metadata.insert("task".to_owned(), run.options.task.name());
    }
    if let Some(path) = &run.inject {
        metadata.insert("inject".to_owned(), path.display().to_string());
    }
    Header {
        joint_names: robot
            .joints
            .iter()
            .map(|joint| joint.name.clone())
            .collect(),
        sample_rate_hz: 1e9 / run.period_ns as f64,
        metadata,
    }
}

fn joint_cycle(messages: &CycleMessages, sample: &SensorSample, joint: usize) -> JointCycle {
    let present = |value: f64| value.is_finite().then_some(value);
    let readings = &sample.readings;
    let command = messages.command.as_ref();
    let estimate = messages.estimate.unwrap_or_default();
    let [residual_nm, _] = estimate.residual.valid_nm(joint);
    let [structural_damping_nm, _] = estimate.structural_damping.valid_nm(joint);
    let [fusion_nm, fusion_std_nm] = estimate.fusion.valid_nm(joint);
    let external = &estimate.external;
    let drives = messages.status.unwrap_or_default().drives;
    let told = |number: u32| (number != 0).then_some(i64::from(number));
    let drive_state = told(drives.state[joint]);
    JointCycle {
        reference_position_rad: command
            .and_then(|command| present(command.reference_position_rad[joint])),
        reference_velocity_rad_s: command
            .and_then(|command| present(command.reference_velocity_rad_s[joint])),
        command_torque_nm: messages
            .status
            .and_then(|status| present(status.motor_torque_nm[joint])),
        motor_torque_nm: present(readings.motor_torque_nm[joint]),
        motor_position_rad: present(readings.motor_position_rad[joint]),
        motor_velocity_rad_s: present(readings.motor_velocity_rad_s[joint]),
        link_position_rad: present(readings.link_position_rad[joint]),
        link_velocity_rad_s: present(readings.link_velocity_rad_s[joint]),
        joint_torque_nm: present(readings.joint_torque_nm[joint]),
        motor_current_a: present(readings.motor_current_a[joint]),
        temperature_c: present(readings.temperature_c[joint]),
        estimate_residual_torque_nm: present(residual_nm),
        estimate_structural_damping_nm: present(structural_damping_nm),
        estimate_fusion_nm: present(fusion_nm),
        estimate_fusion_std_nm: present(fusion_std_nm),
        estimate_external_nm: present(external.torque_nm[joint]),
        estimate_external_std_nm: present(external.std_nm[joint]),
        segment: None,
        drive_state,
        drive_status_word: drive_state.map(|_| i64::from(drives.status_word[joint])),
        drive_error_code: told(drives.error_code[joint]),
        drive_age_cycles: told(drives.age_cycles[joint]),
    }
}

fn loop_cycle(status: &LoopStatus) -> LoopCycle {
    let signed = |time_ns: u64| i64::try_from(time_ns).unwrap_or(i64::MAX);
    LoopCycle {
        cycle: status.header.cycle,
        state: status.state,
        wakeup_lateness_ns: signed(status.wakeup_lateness_ns),
        compute_ns: signed(status.compute_ns),
        command_latency_ns: signed(status.command_latency_ns),
        exchange_ns: signed(status.exchange_ns),
        limited: status.limited_joints as u32,
        missed_deadlines: status.missed_deadlines,
        stale_commands: status.stale_commands,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::messages::Header as MessageHeader;

    fn status(cycle: u64) -> LoopStatus {
        LoopStatus {
            header: MessageHeader {
                cycle,
                ..MessageHeader::default()
            },
            ..LoopStatus::default()
        }
    }

    fn run(control: ControlMode, options: ControlOptions) -> RunConfig {
        RunConfig {
            session: 1,
            robot: "shd17".to_owned(),
            driver: "emulator".to_owned(),
            trajectory: "hold".to_owned(),
            plant: None,
            control,
            options,
            estimators: Vec::new(),
            mode: Mode::Lockstep,
            period_ns: 666_667,
            cycles: 1,
            wait: shm_types::instance::Wait::Block,
            wake_early_ns: 0,
            seed: 1,
            inject: None,
            record: None,
            command_deadline_ns: 500_000,
            cores: Vec::new(),
            initial_position_rad: vec![0.0],
        }
    }

    #[test]
    fn a_recording_tells_how_its_robot_was_controlled() {
        let robot = robot::load("shd17").expect("a shipped robot");
        let options = ControlOptions {
            friction_velocity: FrictionVelocity::Measured,
            stiffness_torque: StiffnessTorque::Torsion,
            correction_gain: 0.25,
            task: Task::Nudge { joint: 3 },
        };
        let released = ControlOptions {
            task: Task::Release,
            ..ControlOptions::default()
        };
        for control in [ControlMode::Torque, ControlMode::Velocity] {
            for options in [options, released, ControlOptions::default()] {
                let header = recording_header(&run(control, options), &robot);
                assert_eq!(recorded_control(&header.metadata), (control, options));
            }
        }
        let nothing_told = recorded_control(&BTreeMap::new());
        assert_eq!(
            nothing_told,
            (ControlMode::Torque, ControlOptions::default())
        );
    }

    #[test]
    fn rows_come_in_order_whatever_order_messages_come_in() {
        let mut assembler = Assembler::default();
        for cycle in [2, 0, 1, 4, 3] {
            assembler.row(cycle).expect("not given back yet").sample =
                Some(SensorSample::default());
        }
        for cycle in [1, 0, 4, 2, 3] {
            assembler.add_status(status(cycle));
        }
        assert_eq!(assembler.next_due(), None, "all still young");
        assembler.add_status(status(2 + PATIENCE_CYCLES));
        let due: Vec<u64> = std::iter::from_fn(|| assembler.next_due())
            .map(|row| row.cycle)
            .collect();
        assert_eq!(due, [0, 1, 2]);
        assert!(assembler.row(1).is_none());
        assert_eq!(assembler.late_messages, 1);
    }

    #[test]
    fn messages_of_cycles_that_cannot_be_change_nothing_and_take_no_memory() {
        let mut assembler = Assembler::default();
        assembler.add_status(status(100));
        assembler.add_status(status(u64::MAX));
        for cycle in (0..1_000_000).map(|index| u64::MAX - index * 7) {
            assert!(assembler.row(cycle).is_none());
        }
        let mut unstarted = Assembler::default();
        let rows = (0..100_000_u64).filter(|&cycle| unstarted.row(3 * cycle).is_some());
        assert_eq!(rows.count(), WAITING_MAX, "before the first status");
        assembler.add_status(status(100 + PATIENCE_CYCLES));
        assert_eq!(assembler.next_due().map(|row| row.cycle), Some(100));
        assert_eq!(assembler.refused_messages, 1_000_001);
    }

    #[test]
    fn cycles_the_loop_never_finished_are_not_rows() {
        let mut assembler = Assembler::default();
        assembler.add_status(status(7));
        // The plant is one latch ahead of the loop.
        assembler.row(8).expect("new").truth = Some(PlantTruth::default());
        let left: Vec<u64> = std::iter::from_fn(|| assembler.next_left())
            .map(|row| row.cycle)
            .collect();
        assert_eq!(left, [7]);
    }

    #[test]
    fn absent_signals_stay_absent() {
        let mut sample = SensorSample::default();
        sample.readings.motor_position_rad[0] = 1.5;
        let messages = CycleMessages {
            sample: Some(sample),
            ..CycleMessages::default()
        };
        let (mut joints, mut truth) = (Vec::new(), Vec::new());
        record_row(&messages, 1, &mut joints, &mut truth).expect("a measurement is there");
        assert_eq!(joints[0].motor_position_rad, Some(1.5));
        assert_eq!(joints[0].link_position_rad, None);
        assert!(truth.is_empty());
    }
}
