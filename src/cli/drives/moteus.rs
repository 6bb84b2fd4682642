//! What can be typed after `flexspline drives emulate moteus`.

use std::time::Duration;

use clap::Args;
use moteus_emulator::Fault;

/// `flexspline drives emulate moteus`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  flexspline drives emulate moteus --robot shd17 --link /tmp/moteus
  python3 -m moteus.moteus_tool --fdcanusb /tmp/moteus --target 1 --info
  flexspline drives emulate moteus --robot pa10 --buses 2 --fault silent:3@2s+500ms

The drives have the identifiers 1, 2, 3 ... in the order of the joints, and are calibrated and set up for them. A joint is
held until its drive is first enabled, then it falls where nobody holds it, as an arm without brakes does.
Faults, each KIND:WHERE@START[+DURATION] from the first line on: silent:ID, bus-off:BUS, pty-closed:BUS,
drive-fault:ID/CODE, brown-out:ID, lost:BUS/SHARE, doubled:BUS/SHARE, delayed:BUS/TIME.
Ends with Ctrl-C, or after --duration. Exit code: 0 done, 2 bad input.")]
pub struct EmulateMoteusArguments {
    /// Robot: pa10, shd17, or a robot file
    #[arg(long, default_value = "shd17", value_name = "NAME|FILE")]
    pub robot: String,
    /// Trajectory at whose beginning the robot stands; the robot's own if not given
    #[arg(long, value_name = "NAME|FILE")]
    pub trajectory: Option<String>,
    /// Buses, each with a port of its own, that the joints are spread over in their order
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub buses: usize,
    /// Name for the first bus's port beside its own; the others get it with their number behind it
    #[arg(long, value_name = "PATH")]
    pub link: Option<String>,
    /// Start as after power-on: drives without an encoder at the joint know their position within a turn of the rotor only
    #[arg(long)]
    pub unhomed: bool,
    /// What breaks when; may be given more than once
    #[arg(long, value_name = "KIND:WHERE@START[+DURATION]")]
    pub fault: Vec<Fault>,
    /// Take pushes on the robot from standard input, each a line JOINT TORQUE_NM TIME, as joint1 5.5 2s; joint side
    #[arg(long)]
    pub hands: bool,
    /// Seed of the robot's deviations and of frames that are lost
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
    /// How long to run, as 15s; until Ctrl-C if not given
    #[arg(long, value_name = "D", value_parser = humantime::parse_duration)]
    pub duration: Option<Duration>,
}
