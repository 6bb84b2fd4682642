//! `flexspline drives emulate ethercat`.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

use ethercat_emulator::socket::{RawSocket, now_ns, serve};
use ethercat_emulator::{Options, Segment, segment};
use plant_emulator::PlantParameters;
use robot::Robot;

use super::hands::Hands;
use crate::cli::EmulateEthercatArguments;
use crate::error::CliError;
use crate::output::print;
use crate::run::stop_on_signals;

/// How exactly `--duration` is kept.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);
/// Cycles a second where neither the command nor the robot file says.
const RATE_HZ: f64 = 1500.0;

/// Emulates drives until Ctrl-C or for the time asked.
///
/// # Errors
/// [`CliError::Input`] before the interface is served.
pub fn emulate(arguments: &EmulateEthercatArguments) -> Result<(), CliError> {
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    robot.check_fits_loop().map_err(CliError::input)?;
    let options = options(arguments, &robot)?;
    let parameters = PlantParameters::for_robot(&robot).map_err(CliError::input)?;
    let injections = match &arguments.inject {
        Some(path) => robot::load_injection(path, &robot).map_err(CliError::input)?,
        None => Vec::new(),
    };
    let socket = RawSocket::open(&arguments.interface).map_err(CliError::input)?;
    let mut drives =
        segment(&robot, &parameters, &injections, &options, now_ns()).map_err(CliError::input)?;
    if let Some(path) = &arguments.inject {
        let pushes = robot::load_pushes(path, &robot).map_err(CliError::input)?;
        drives = drives.with_pushes(pushes);
    }
    let stop = stop_on_signals()?;
    print(&told(&robot, &drives, &arguments.interface))?;
    if let Some(duration) = arguments.duration {
        let stop = Arc::clone(&stop);
        let begun = Instant::now();
        thread::spawn(move || {
            while begun.elapsed() < duration {
                thread::sleep(LOOK_INTERVAL);
            }
            stop.store(true, Ordering::Relaxed);
        });
    }
    let hands = arguments.hands.then(|| Hands::listen(&robot));
    serve(&socket, &mut drives, &stop, |drives| {
        for push in hands.iter().flat_map(Hands::take) {
            drives.push(push.joint, push.torque_nm, push.duration_s);
        }
    });
    print(&format!("{} frames served\n", drives.frames()))
}

fn options(arguments: &EmulateEthercatArguments, robot: &Robot) -> Result<Options, CliError> {
    let trajectory = match &arguments.trajectory {
        Some(name) => name.clone(),
        None => motion::default_name(robot).to_owned(),
    };
    let mut start = motion::Reference::default();
    motion::load(&trajectory, robot)
        .map_err(CliError::input)?
        .sample(0.0, &mut start);
    let rate_hz = arguments
        .rate
        .or_else(|| robot.control.as_ref().map(|control| control.rate_hz))
        .unwrap_or(RATE_HZ);
    let cycle_times_ns = arguments
        .cycle_times
        .iter()
        .map(|time| {
            u32::try_from(time.as_nanos()).map_err(|_| {
                CliError::Input(format!(
                    "--cycle-times {}: at most 4.29s",
                    humantime::format_duration(*time)
                ))
            })
        })
        .collect::<Result<Vec<u32>, CliError>>()?;
    Ok(Options {
        axes_per_slave: arguments.axes,
        rate_hz,
        seed: arguments.seed,
        position_rad: start.position_rad[..robot.joints.len()].to_vec(),
        clock_error_ppm: arguments.clock_error,
        brake_release_s: arguments.brake_release.as_secs_f64(),
        cycle_times_ns,
        sync_type_writable: !arguments.fixed_sync_type,
        sync_error_limit: arguments.sync_error_limit,
        emergencies: !arguments.no_emergencies,
        faults: arguments.fault.clone(),
        ..Options::for_joints(robot.joints.len())
    })
}

/// `slave 0 on veth1: joint1, joint2`
fn told(robot: &Robot, drives: &Segment, interface: &str) -> String {
    drives
        .slaves()
        .iter()
        .enumerate()
        .map(|(position, slave)| {
            let joints: Vec<&str> = slave
                .axes()
                .iter()
                .map(|axis| robot.joints[axis.config().joint].name.as_str())
                .collect();
            format!("slave {position} on {interface}: {}\n", joints.join(", "))
        })
        .collect()
}
