//! A driver as a process of its own: joints that follow the commanded velocity, on the topics of the drives.
//!
//! ```sh
//! cargo run --release -- run --driver process --control velocity &
//! cargo run --release --example process_driver default
//! ```
//!
//! Replace [`Joint`] by your bus. What comes is `drive/command`, what is owed for each is one `drive/sample`: that of the next
//! cycle. The process ends when no command has come for two seconds.

use std::process::ExitCode;

use realtime::clock::monotonic_ns;
use realtime::process::user_id;
use shm_types::bus::Bus;
use shm_types::drive::DriveState;
use shm_types::instance::{Instance, RunConfig};
use shm_types::messages::{DriveCommand, DriveMode, DriveRequest, DriveSample, Header};
use shm_types::topics;

/// Without a command for so long the joints stop.
const WATCHDOG_NS: u64 = 20_000_000;
/// Without a command for so long nobody is there any more.
const GONE_NS: u64 = 2_000_000_000;
/// How late a command is taken whose wake-up was lost.
const RECHECK_NS: u64 = 100_000;

/// One joint that goes as fast as it is told, motor side.
#[derive(Clone, Default)]
struct Joint {
    position_rad: f64,
    velocity_rad_s: f64,
    state: DriveState,
}

impl Joint {
    fn obey(&mut self, command: &DriveCommand, joint: usize, gear_ratio: f64) {
        let enable = command.request == DriveRequest::Enable as u32;
        let obeys = command.mode_of(joint) == Some(DriveMode::Velocity);
        self.state = match (obeys, self.state) {
            (true, DriveState::Enabled) => DriveState::Enabled,
            (true, _) if enable => DriveState::Enabled,
            _ => DriveState::SwitchedOff,
        };
        let asked_rad_s = command.joint_velocity_rad_s[joint];
        self.velocity_rad_s = match self.state {
            DriveState::Enabled if asked_rad_s.is_finite() => asked_rad_s * gear_ratio,
            _ => 0.0,
        };
    }
}

fn main() -> ExitCode {
    let name = std::env::args().nth(1).unwrap_or("default".to_owned());
    match drive(&name) {
        Ok(cycles) => {
            println!("drove {cycles} cycles");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::from(2)
        }
    }
}

fn drive(name: &str) -> Result<u64, Box<dyn std::error::Error>> {
    let instance = Instance::new(name, user_id())?;
    let run = instance.run_config()?;
    let robot = robot::load(&run.robot)?;
    let bus = Bus::join(&instance)?;
    let commands = bus.reader(&topics::DRIVE_COMMAND)?;
    let command_ready = bus.listener(&topics::DRIVE_COMMAND_READY, RECHECK_NS)?;
    let mut samples = bus.writer(&topics::DRIVE_SAMPLE)?;
    let sample_ready = bus.notifier(&topics::DRIVE_SAMPLE_READY)?;
    let mut joints = vec![Joint::default(); robot.joints.len()];
    for (index, joint) in joints.iter_mut().enumerate() {
        joint.position_rad = run.initial_position_rad[index] * robot.joints[index].gear_ratio;
    }
    let (mut cycles, mut heard_ns) = (0, monotonic_ns());
    while cycles == 0 || monotonic_ns() - heard_ns < GONE_NS {
        command_ready.wait(WATCHDOG_NS);
        if monotonic_ns() - heard_ns > WATCHDOG_NS {
            joints
                .iter_mut()
                .for_each(|joint| joint.velocity_rad_s = 0.0);
        }
        while let Some(command) = commands.take() {
            if command.header.check(run.session, joints.len()).is_err() {
                continue;
            }
            heard_ns = monotonic_ns();
            // The loop's first command tells its clock: the sample of that very cycle is owed for it.
            let ahead = u64::from(cycles > 0 || command.header.cycle > 0);
            for (index, joint) in joints.iter_mut().enumerate() {
                let moved_rad = joint.velocity_rad_s * run.period_ns as f64 * 1e-9;
                joint.position_rad += moved_rad * ahead as f64;
                joint.obey(&command, index, robot.joints[index].gear_ratio);
            }
            samples.send_and_prepare(sample(&run, &command, ahead, &joints));
            sample_ready.notify();
            cycles += 1;
        }
    }
    Ok(cycles)
}

fn sample(run: &RunConfig, command: &DriveCommand, ahead: u64, joints: &[Joint]) -> DriveSample {
    let mut sample = DriveSample {
        header: Header {
            cycle: command.header.cycle.saturating_add(ahead),
            measured_at_ns: command.header.measured_at_ns + ahead * run.period_ns,
            ..command.header
        },
        mode: command.mode,
        ..DriveSample::default()
    };
    for (index, joint) in joints.iter().enumerate() {
        sample.readings.motor_position_rad[index] = joint.position_rad;
        sample.readings.motor_velocity_rad_s[index] = joint.velocity_rad_s;
        sample.drives.state[index] = joint.state as u32;
        sample.drives.mode[index] = command.mode;
    }
    sample
}
