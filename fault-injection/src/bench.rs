//! The loop with faults around it, in virtual time and one process: admission, cycle, controller, driver and virtual drives are
//! those of a run.

use motion::Trajectory;
use robot::Robot;
use rt_loop::admission::{admits_command, check_sample};
use rt_loop::bus_clock;
use rt_loop::config::cycle_config;
use rt_loop::cycle::{CycleConfig, CycleInput, CycleState, Orders};
use rt_loop::driver::{DriveFault, Driver};
use rt_loop::statistics::Counters;
use services::controller::Controller;
use services::feedforward::FeedforwardError;
use shm_types::instance::RunConfig;
use shm_types::messages::{
    Command, DriveCommand, DriveMode, DriveRequest, DriveSample, Header, LoopState, PerJoint,
};
use virtual_drives::{BusFault, Kind, VirtualDrives, VirtualError, run_config};

use crate::drive::FaultyDriver;
use crate::outcome::{Account, Observed, Outcome, SetUp};
use crate::scenarios::{AtSetUp, OrderDisturbance, Scenario};
use crate::service::FaultyService;

/// 1.5 kHz.
const PERIOD_NS: u64 = 666_667;
/// Number of the run; any will do.
const SESSION: u64 = 1;

/// Why a scenario cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The robot file cannot be used.
    #[error(transparent)]
    Robot(#[from] robot::RobotError),
    /// The trajectory cannot be used.
    #[error(transparent)]
    Motion(#[from] motion::MotionError),
    /// The drives cannot be built or opened.
    #[error(transparent)]
    Drives(#[from] VirtualError),
    /// This robot cannot be controlled this way.
    #[error(transparent)]
    Feedforward(#[from] FeedforwardError),
}

/// Part of the period after which the controller's answer is there.
const ANSWER_PARTS: u64 = 4;
/// Part of the period in which the drives' sample must have come, as in a run.
const SAMPLE_DEADLINE_PARTS: u64 = 3;

/// One robot on its default trajectory, with drives of one kind.
#[derive(Clone, Debug)]
pub struct Bench {
    kind: Kind,
    robot: Robot,
    trajectory: Trajectory,
    run: RunConfig,
    config: CycleConfig,
}

impl Bench {
    /// A shipped robot, or a robot file.
    ///
    /// # Errors
    /// [`BenchError`].
    pub fn new(robot: &str, kind: Kind) -> Result<Self, BenchError> {
        let name = robot.to_owned();
        let robot = robot::load(robot)?;
        let trajectory_name = motion::default_name(&robot).to_owned();
        let trajectory = motion::load(&trajectory_name, &robot)?;
        let mut start = motion::Reference::default();
        trajectory.sample(0.0, &mut start);
        let run = RunConfig {
            session: SESSION,
            robot: name,
            driver: "emulator".to_owned(),
            trajectory: trajectory_name,
            initial_position_rad: start.position_rad[..robot.joints.len()].to_vec(),
            ..run_config(robot.joints.len(), PERIOD_NS)
        };
        let config = cycle_config(&run, &robot);
        Ok(Self {
            kind,
            robot,
            trajectory,
            run,
            config,
        })
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// How many joints it has.
    pub fn joints(&self) -> usize {
        self.robot.joints.len()
    }

    /// Runs a scenario to its end.
    ///
    /// # Errors
    /// [`BenchError`].
    pub fn run(&self, scenario: &Scenario) -> Result<Outcome, BenchError> {
        let mut loop_ = self.start(scenario)?;
        let mut account = self.account(scenario);
        let mut cycle = 0;
        while cycle < scenario.cycles {
            loop_.cycle(cycle, scenario.orders_in(cycle), &mut account);
            cycle += 1 + scenario.skipped_after(cycle);
        }
        let names = &self.config.joint_names;
        Ok(account.finish(loop_.state.fault.map(|fault| fault.sentence(names))))
    }

    /// Looks for drives of which something is broken, as a run does before its loop begins.
    ///
    /// # Errors
    /// [`BenchError`] where there are no such drives at all.
    pub fn set_up(&self, broken: &AtSetUp) -> Result<SetUp, BenchError> {
        let opened =
            virtual_drives::open_broken(self.kind, &self.robot, &self.run, Some(broken.fault));
        match opened {
            Ok(_) => Ok(SetUp { refused: None }),
            Err(VirtualError::Open(refused)) => Ok(SetUp {
                refused: Some(refused.to_string()),
            }),
            Err(error) => Err(error.into()),
        }
    }

    /// The drives' kind.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The loop's period.
    pub fn period_ns(&self) -> u64 {
        PERIOD_NS
    }

    pub(crate) fn account(&self, scenario: &Scenario) -> Account {
        let limits = self.config.joints.iter().map(|joint| joint.motor_torque_nm);
        Account::new(scenario.begin(), limits.collect())
    }

    /// The loop with the faults of a scenario around it, before its first cycle.
    pub(crate) fn start(&self, scenario: &Scenario) -> Result<FaultyLoop<'_>, BenchError> {
        let drives = virtual_drives::open(self.kind, &self.robot, &self.run)?;
        let ratios = self.config.joints.iter().map(|joint| joint.gear_ratio);
        let mut loop_ = FaultyLoop {
            config: &self.config,
            epoch_ns: drives.now_ns(),
            driver: FaultyDriver::new(drives, ratios.collect(), scenario.drive.clone()),
            buses: scenario.bus.clone(),
            service: FaultyService::new(scenario.service.clone()),
            controller: Controller::new(&self.run, self.robot.clone(), self.trajectory.clone())?,
            state: CycleState::default(),
            counters: Counters::default(),
            reference_rad: [0.0; shm_types::JOINTS_MAX],
        };
        // The drives take their clock from the first command; until then they are braked.
        let _ = loop_.driver.write(&DriveCommand {
            header: Header {
                session: SESSION,
                joint_count: self.robot.joints.len() as u64,
                ..Header::default()
            },
            ..DriveCommand::default()
        });
        Ok(loop_)
    }
}

pub(crate) struct FaultyLoop<'a> {
    config: &'a CycleConfig,
    /// When cycle 0 was, as far as the loop has followed the drives' clock.
    epoch_ns: u64,
    driver: FaultyDriver<Box<dyn VirtualDrives>>,
    buses: Vec<(u64, BusFault)>,
    service: FaultyService,
    controller: Controller,
    state: CycleState,
    counters: Counters,
    reference_rad: PerJoint,
}

impl FaultyLoop<'_> {
    pub fn state(&self) -> LoopState {
        self.state.state
    }

    pub fn break_now(&mut self, fault: BusFault) {
        self.driver.inner.break_now(fault);
    }

    /// As the loop's process does it, with messages handed over instead of sent.
    pub fn cycle(&mut self, cycle: u64, orders: Orders, account: &mut Account) {
        let config = self.config;
        let planned_ns = self.epoch_ns + cycle * PERIOD_NS;
        self.driver.inner.pass_until(planned_ns);
        for (_, fault) in self.buses.iter().filter(|(at, _)| *at == cycle) {
            self.driver.inner.break_now(*fault);
        }
        let read_until_ns = planned_ns + PERIOD_NS / SAMPLE_DEADLINE_PARTS;
        let sample = self.driver.read(cycle, planned_ns, read_until_ns);
        self.driver
            .inner
            .pass_until(planned_ns + PERIOD_NS / ANSWER_PARTS);
        let sample = sample.and_then(|sample| self.admitted(cycle, sample));
        let refused_before = self.counters.refused_commands();
        let command = self.command(cycle, sample.as_ref().ok());
        let input = CycleInput {
            cycle,
            planned_ns,
            sample: sample.as_ref().map_err(|fault| *fault),
            command: command.as_ref(),
            orders,
        };
        let output = self.state.step(config, &input);
        let written = self.driver.write(&output.drive_command);
        self.state.written(written);
        self.driver.prepare();
        if sample.is_ok() {
            let later_ns = bus_clock::step_ns(&self.state.bus, PERIOD_NS);
            self.epoch_ns = self.epoch_ns.saturating_add_signed(later_ns);
        }
        account.lose(
            sample.is_err(),
            command.is_none(),
            self.counters.refused_commands() - refused_before,
        );
        let truth = self.driver.inner.truth();
        account.add(&Observed {
            cycle,
            state: self.state.state,
            mode: DriveMode::from_raw(output.drive_command.mode).unwrap_or_default(),
            torque_nm: &output.drive_command.motor_torque_nm,
            link_position_rad: &truth.link_position_rad,
            reference_rad: &self.reference_rad,
            is_driven: (0..config.joints.len()).any(|joint| self.driver.inner.is_driven(joint)),
            may_move: output.drive_command.request == DriveRequest::Enable as u32
                || DriveMode::from_raw(output.drive_command.mode) != Some(DriveMode::Braked),
        });
    }

    fn admitted(&mut self, cycle: u64, sample: DriveSample) -> Result<DriveSample, DriveFault> {
        check_sample(&sample, SESSION, cycle, self.config.joint_count())?;
        self.state.admit(self.config, cycle, &sample)?;
        Ok(sample)
    }

    fn command(&mut self, cycle: u64, sample: Option<&DriveSample>) -> Option<Command> {
        let asked = sample.map(|sample| self.state.sensor_sample(self.config, cycle, sample));
        let answer = asked.and_then(|asked| self.controller.command(&asked));
        if let Some(answer) = &answer {
            self.reference_rad = answer.reference_position_rad;
        }
        let arriving = self.service.arriving(cycle, answer);
        let asked = asked?.header;
        let counters = &mut self.counters;
        arriving
            .filter(|command| admits_command(command, &asked, counters))
            .last()
    }
}

/// Orders of a scenario's operator and supervisor in one cycle.
pub(crate) fn orders(disturbances: impl Iterator<Item = OrderDisturbance>) -> Orders {
    let mut orders = Orders::default();
    for disturbance in disturbances {
        match disturbance {
            OrderDisturbance::EmergencyStop => orders.emergency_stop = true,
            OrderDisturbance::Reset => orders.reset = true,
            OrderDisturbance::SupervisorSilent => orders.supervisor_silent = true,
        }
    }
    orders
}
