//! `flexspline drives emulate moteus`.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant};

use moteus_emulator::process::Ports;
use moteus_emulator::{Bench, Setup};

use super::hands::Hands;
use crate::cli::EmulateMoteusArguments;
use crate::error::CliError;
use crate::output::print;
use crate::run::stop_on_signals;

/// How exactly `--duration` is kept.
const LOOK_INTERVAL: Duration = Duration::from_millis(20);

/// Emulates drives until Ctrl-C or for the time asked.
///
/// # Errors
/// [`CliError::Input`] before the ports are open, [`CliError::Negative`] if one cannot be kept.
pub fn emulate(arguments: &EmulateMoteusArguments) -> Result<(), CliError> {
    let robot = robot::load(&arguments.robot).map_err(CliError::input)?;
    robot.check_fits_loop().map_err(CliError::input)?;
    let trajectory = match &arguments.trajectory {
        Some(name) => name.clone(),
        None => motion::default_name(&robot).to_owned(),
    };
    let mut start = motion::Reference::default();
    motion::load(&trajectory, &robot)
        .map_err(CliError::input)?
        .sample(0.0, &mut start);
    let setup = Setup {
        initial_position_rad: start.position_rad[..robot.joints.len()].to_vec(),
        buses: arguments.buses,
        is_homed: !arguments.unhomed,
        seed: arguments.seed,
        faults: arguments.fault.clone(),
    };
    let mut bench = Bench::new(&robot, &setup).map_err(CliError::input)?;
    let stop = stop_on_signals()?;
    let mut ports =
        Ports::open(arguments.buses, arguments.link.as_deref()).map_err(CliError::input)?;
    for bus in 0..arguments.buses {
        print(&told(&robot, &bench, &ports, bus))?;
    }
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
    ports
        .serve(&mut bench, &stop, |bench| {
            for push in hands.iter().flat_map(Hands::take) {
                bench.push(push.joint, push.torque_nm, push.duration_s);
            }
        })
        .map_err(|error| CliError::Negative(format!("a port is lost: {error}")))
}

/// `bus 1 /dev/pts/3: joint1 = id 1, joint2 = id 2`
fn told(robot: &robot::Robot, bench: &Bench, ports: &Ports, bus: usize) -> String {
    let joints: Vec<String> = bench
        .joints_on(bus)
        .iter()
        .map(|(joint, id)| format!("{} = id {id}", robot.joints[*joint].name))
        .collect();
    format!(
        "bus {} {}: {}\n",
        bus + 1,
        ports.path(bus).display(),
        joints.join(", ")
    )
}
