//! Virtual drives for a robot on a network interface, until they are stopped from outside.
//!
//! `cargo run --release -p ethercat-emulator --example serve -- veth1 pa10 2`: interface, robot, axes a slave. Needs CAP_NET_RAW.

use std::error::Error;
use std::sync::atomic::AtomicBool;

use ethercat_emulator::socket::{RawSocket, now_ns, serve};
use ethercat_emulator::{Options, segment};
use plant_emulator::PlantParameters;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let interface = arguments.next().ok_or("give an interface")?;
    let robot = robot::load(&arguments.next().unwrap_or_else(|| "shd17".to_owned()))?;
    let mut options = Options::for_joints(robot.joints.len());
    if let Some(axes) = arguments.next() {
        options.axes_per_slave = axes.parse()?;
    }
    let socket = RawSocket::open(&interface)?;
    let parameters = PlantParameters::for_robot(&robot)?;
    let mut drives = segment(&robot, &parameters, &[], &options, now_ns())?;
    serve(&socket, &mut drives, &AtomicBool::new(false), |_| ());
    Ok(())
}
