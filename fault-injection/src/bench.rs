//! The loop with faults around it, in virtual time and one process: admission, cycle, controller and emulated drives are those
//! of a run.

use motion::Trajectory;
use plant_emulator::drives::EmulatedDrives;
use plant_emulator::process::emulated_plant;
use plant_emulator::{Plant, PlantError};
use robot::Robot;
use rt_loop::admission::{admits_command, check_sample};
use rt_loop::config::cycle_config;
use rt_loop::cycle::{CycleConfig, CycleInput, CycleState, Orders};
use rt_loop::driver::{Capabilities, DriveFault, Driver};
use rt_loop::statistics::Counters;
use services::controller::Controller;
use services::feedforward::FeedforwardError;
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use shm_types::messages::{
    Command, DriveCommand, DriveMode, DriveSample, Header, PerJoint, PlantTruth,
};

use crate::drive::FaultyDriver;
use crate::outcome::{Account, Observed, Outcome};
use crate::scenarios::{OrderDisturbance, Scenario};
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
    /// The plant cannot be built.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// This robot cannot be controlled this way.
    #[error(transparent)]
    Feedforward(#[from] FeedforwardError),
}

/// One robot on its default trajectory.
#[derive(Clone, Debug)]
pub struct Bench {
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
    pub fn new(robot: &str) -> Result<Self, BenchError> {
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
            plant: None,
            control: ControlMode::Torque,
            options: ControlOptions::default(),
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
            initial_position_rad: start.position_rad[..robot.joints.len()].to_vec(),
        };
        let config = cycle_config(&run, &robot);
        Ok(Self {
            robot,
            trajectory,
            run,
            config,
        })
    }

    /// Runs a scenario to its end.
    ///
    /// # Errors
    /// [`BenchError`].
    pub fn run(&self, scenario: &Scenario) -> Result<Outcome, BenchError> {
        let plant = emulated_plant(&self.robot, &self.run, &[])?;
        let ratios = self.config.joints.iter().map(|joint| joint.gear_ratio);
        let mut loop_ = FaultyLoop {
            config: &self.config,
            driver: FaultyDriver::new(
                EmulatedDriver::new(plant, &self.robot),
                ratios.collect(),
                scenario.drive.clone(),
            ),
            service: FaultyService::new(scenario.service.clone()),
            controller: Controller::new(&self.run, self.robot.clone(), self.trajectory.clone())?,
            state: CycleState::default(),
            counters: Counters::default(),
            reference_rad: [0.0; shm_types::JOINTS_MAX],
        };
        let limits = self.config.joints.iter().map(|joint| joint.motor_torque_nm);
        let mut account = Account::new(scenario.begin(), limits.collect());
        let mut cycle = 0;
        while cycle < scenario.cycles {
            loop_.cycle(cycle, scenario.orders_in(cycle), &mut account);
            cycle += 1 + scenario.skipped_after(cycle);
        }
        let names = &self.config.joint_names;
        Ok(account.finish(loop_.state.fault.map(|fault| fault.sentence(names))))
    }
}

struct FaultyLoop<'a> {
    config: &'a CycleConfig,
    driver: FaultyDriver<EmulatedDriver>,
    service: FaultyService,
    controller: Controller,
    state: CycleState,
    counters: Counters,
    reference_rad: PerJoint,
}

impl FaultyLoop<'_> {
    /// As the loop's process does it, with messages handed over instead of sent.
    fn cycle(&mut self, cycle: u64, orders: Orders, account: &mut Account) {
        let config = self.config;
        let planned_ns = cycle * PERIOD_NS;
        let sample = self.driver.read(cycle, planned_ns, planned_ns);
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
        account.lose(
            sample.is_err(),
            command.is_none(),
            self.counters.refused_commands() - refused_before,
        );
        account.add(&Observed {
            cycle,
            state: self.state.state,
            mode: DriveMode::from_raw(output.drive_command.mode).unwrap_or_default(),
            torque_nm: &output.drive_command.motor_torque_nm,
            link_position_rad: &self.driver.inner.truth.link_position_rad,
            reference_rad: &self.reference_rad,
        });
    }

    fn admitted(&mut self, cycle: u64, sample: DriveSample) -> Result<DriveSample, DriveFault> {
        check_sample(&sample, SESSION, cycle, self.config.joint_count())?;
        self.state.admit(self.config, cycle, &sample)?;
        Ok(sample)
    }

    fn command(&mut self, cycle: u64, sample: Option<&DriveSample>) -> Option<Command> {
        let asked = sample.map(|sample| self.state.sensor_sample(self.config, cycle, sample));
        let answer = asked.map(|asked| self.controller.command(&asked));
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

/// The emulated drives as a driver in virtual time: the plant goes on by the loop's clock, whether commands come or not.
#[derive(Debug)]
struct EmulatedDriver {
    drives: EmulatedDrives,
    truth: PlantTruth,
}

impl EmulatedDriver {
    fn new(plant: Plant, robot: &Robot) -> Self {
        let mut drives = EmulatedDrives::new(plant, SESSION, robot, PERIOD_NS);
        // The loop's first command tells its clock, and keeps the brakes closed.
        drives.take(DriveCommand {
            header: Header {
                session: SESSION,
                joint_count: robot.joints.len() as u64,
                ..Header::default()
            },
            ..DriveCommand::default()
        });
        Self {
            drives,
            truth: PlantTruth::default(),
        }
    }
}

impl Driver for EmulatedDriver {
    fn capabilities(&self) -> Capabilities {
        Capabilities::default()
    }

    fn read(&mut self, cycle: u64, planned_ns: u64, _: u64) -> Result<DriveSample, DriveFault> {
        while self.drives.cycle() < cycle {
            self.drives.advance();
        }
        let (sample, truth) = self.drives.measure(planned_ns);
        self.truth = truth;
        Ok(sample)
    }

    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        self.drives.take(*command);
        Ok(())
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
