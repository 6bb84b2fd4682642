//! What a driver finds on its bus, and whether that fits the robot file: opened, exchanged with brakes closed, brought down.

use realtime::clock::{monotonic_ns, sleep_until};
use robot::Robot;
use rt_loop::driver::{Behind, Capabilities, DriveFault, Driver, JointCapabilities, OpenContext};
use shm_types::control_options::ControlOptions;
use shm_types::drive::{BusReport, ClockState, DriveReport};
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use shm_types::messages::{DriveCommand, Header};

use super::finding::{Finding, Verdict};
use crate::cli::DoctorArguments;
use crate::drivers;
use crate::error::CliError;
use crate::run::period_ns;

/// Exchanges for so long: drives that were just opened lose frames in their first tenths of a second.
const LOOK_NS: u64 = 1_000_000_000;
/// Number of the look; no run has it.
const SESSION: u64 = 0;

/// What was seen in the exchanges.
struct Look {
    cycles: u64,
    failed: u64,
    last_fault: Option<DriveFault>,
    drives: DriveReport,
    bus: BusReport,
}

/// Findings about the drives behind `--driver`; none where a run starts what stands behind it.
///
/// # Errors
/// [`CliError::Input`] if there is no such driver or robot.
pub fn findings(arguments: &DoctorArguments) -> Result<Vec<Finding>, CliError> {
    let Some(name) = &arguments.driver else {
        return Ok(Vec::new());
    };
    let entry = drivers::find(name)?;
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    robot.check_fits_loop().map_err(CliError::input)?;
    let run = run_config(name, arguments, &robot)?;
    if entry.behind != Behind::Hardware {
        return Ok(vec![drives(
            Verdict::Good,
            format!("{}; there only in a run", entry.summary),
            None,
        )]);
    }
    let context = OpenContext {
        run: &run,
        robot: &robot,
        bus: None,
    };
    match rt_loop::process::open_driver(entry, &context) {
        Err(error) => Ok(vec![drives(Verdict::Missing, error.to_string(), None)]),
        Ok(mut driver) => {
            let capabilities = driver.capabilities();
            let look = exchange(&mut driver, &run, robot.joints.len() as u64);
            driver.shutdown();
            Ok(told(&robot, &capabilities, &look))
        }
    }
}

fn run_config(
    driver: &str,
    arguments: &DoctorArguments,
    robot: &Robot,
) -> Result<RunConfig, CliError> {
    let period_ns = period_ns(None, robot)?;
    Ok(RunConfig {
        session: SESSION,
        robot: arguments.robot.clone(),
        driver: driver.to_owned(),
        trajectory: "hold".to_owned(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        estimators: Vec::new(),
        mode: Mode::Realtime,
        period_ns,
        cycles: 0,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        command_deadline_ns: period_ns,
        cores: Vec::new(),
        initial_position_rad: vec![0.0; robot.joints.len()],
    })
}

/// Exchanges as the loop does, with brakes closed.
fn exchange(driver: &mut dyn Driver, run: &RunConfig, joint_count: u64) -> Look {
    let mut look = Look {
        cycles: LOOK_NS / run.period_ns,
        failed: 0,
        last_fault: None,
        drives: DriveReport::default(),
        bus: BusReport::default(),
    };
    let epoch_ns = monotonic_ns() + run.period_ns;
    for cycle in 0..look.cycles {
        let planned_ns = epoch_ns + cycle * run.period_ns;
        sleep_until(planned_ns);
        match driver.read(cycle, planned_ns, planned_ns + run.period_ns / 2) {
            Ok(sample) => (look.drives, look.bus) = (sample.drives, sample.bus),
            Err(fault) => {
                look.failed += 1;
                look.last_fault = Some(fault);
            }
        }
        let braked = DriveCommand {
            header: Header {
                session: run.session,
                cycle,
                measured_at_ns: planned_ns,
                joint_count,
            },
            ..DriveCommand::default()
        };
        if let Err(fault) = driver.write(&braked) {
            look.last_fault = Some(fault);
        }
        driver.prepare();
    }
    look
}

fn told(robot: &Robot, capabilities: &Capabilities, look: &Look) -> Vec<Finding> {
    let mut findings = vec![bus(capabilities, look)];
    for (index, joint) in robot.joints.iter().enumerate() {
        findings.push(drive(
            &joint.name,
            &capabilities.joints[index],
            index,
            &look.drives,
        ));
    }
    findings
}

fn bus(capabilities: &Capabilities, look: &Look) -> Finding {
    let lost = look.failed.max(look.bus.frames_lost);
    let clock = match ClockState::from_raw(look.bus.clock) {
        Some(ClockState::Locked) => format!(", clock locked at {} ns", look.bus.clock_offset_ns),
        Some(ClockState::Locking) => ", clock not locked yet".to_owned(),
        Some(ClockState::Lost) => ", clock lost".to_owned(),
        Some(ClockState::None) | None => String::new(),
    };
    let fault = look
        .last_fault
        .map_or(String::new(), |fault| format!(", last {fault:?}"));
    let is = format!(
        "{}: {lost} of {} exchanges failed{clock}{fault}",
        capabilities.bus, look.cycles
    );
    let mend = "look at cable, supply and the master's settings".to_owned();
    match lost {
        0 => drives(Verdict::Good, is, None),
        lost if lost < look.cycles => drives(Verdict::Weak, is, Some(mend)),
        _ => drives(Verdict::Missing, is, Some(mend)),
    }
}

fn drive(
    joint: &str,
    capabilities: &JointCapabilities,
    index: usize,
    report: &DriveReport,
) -> Finding {
    let state = report.state_of(index);
    let watchdog = capabilities
        .watchdog
        .map_or("none".to_owned(), |watchdog| format!("{watchdog:?}"));
    let error = match report.error_code[index] {
        0 => String::new(),
        code => format!(", error {code:#06x}"),
    };
    let is = format!(
        "{joint}: {}, {}{error}, watchdog {watchdog}",
        capabilities.device,
        state.name()
    );
    match state.is_faulted() {
        true => drives(
            Verdict::Missing,
            is,
            Some("reset it from the monitor of a run, or at the drive".to_owned()),
        ),
        false => drives(Verdict::Good, is, None),
    }
}

fn drives(verdict: Verdict, is: String, mend: Option<String>) -> Finding {
    Finding {
        about: "drives",
        verdict,
        is,
        wanted: "drives that answer every cycle and fit the robot file".to_owned(),
        mend,
        cost: "the loop does not start, or stops",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use shm_types::drive::DriveState;

    fn look(failed: u64) -> Look {
        Look {
            cycles: 100,
            failed,
            last_fault: (failed > 0).then_some(DriveFault::NoSample),
            drives: DriveReport::default(),
            bus: BusReport::default(),
        }
    }

    #[test]
    fn a_faulted_drive_and_a_silent_bus_are_missing() {
        let robot = robot::load("shd17").unwrap();
        let capabilities = Capabilities {
            joints: vec![JointCapabilities::default()],
            ..Capabilities::default()
        };
        let verdicts = |look: &Look| {
            let found = told(&robot, &capabilities, look);
            [found[0].verdict, found[1].verdict]
        };
        assert_eq!(verdicts(&look(0)), [Verdict::Good; 2]);
        assert_eq!(verdicts(&look(3))[0], Verdict::Weak);
        assert_eq!(verdicts(&look(100))[0], Verdict::Missing);
        let mut faulted = look(0);
        faulted.drives.state[0] = DriveState::Fault as u32;
        faulted.drives.error_code[0] = 0x2310;
        assert_eq!(verdicts(&faulted)[1], Verdict::Missing);
        assert!(
            told(&robot, &capabilities, &faulted)[1]
                .is
                .contains("0x2310")
        );
    }
}
