//! The EtherCAT driver at a cable of memory with virtual slaves behind it.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ethercat::EthercatDriver;
use ethercat_emulator::power::PowerState;
use ethercat_emulator::{Options, Segment, Slave, segment};
use ethercat_wire::link::{Cable, Link};
use ethercat_wire::socket::{FRAME_MAX, SocketError};
use plant_emulator::{PlantParameters, PlantTruth};
use robot::Robot;
use rt_loop::driver::{Acyclic, Capabilities, DriveFault, Driver, OpenContext, OpenError};
use shm_types::instance::RunConfig;
use shm_types::messages::{DriveCommand, DriveSample};

use crate::{BusFault, Noise, VirtualDrives, VirtualError};

/// From sending a frame to its coming back: what a frame takes over a veth pair (docs/drives.md), which is more than over a
/// cable.
const ROUND_TRIP_NS: u64 = 50_000;
/// Frames that wait for a place that does not take them: more than any socket holds.
const WAITING_MAX: usize = 256;

/// How a joint's drive stops is the robot file's on virtual drives too.
const STOPS: [&str; 2] = ["quick_stop_rad_s2", "quick_stop_option"];

/// A frame on its way back, and when it is there.
type Coming = (u64, Vec<u8>);

/// The slaves, the clock, and what comes back to each place.
#[derive(Debug)]
struct Line {
    segment: Segment,
    now_ns: u64,
    places: Vec<VecDeque<Coming>>,
    noise: Option<Noise>,
}

impl Line {
    fn pass_until(&mut self, until_ns: u64) {
        self.now_ns = self.now_ns.max(until_ns);
        self.segment.advance(self.now_ns);
    }
}

/// The whole cable. It outlives every panic, so a poisoned lock is as good as another.
#[derive(Clone, Debug)]
struct Memory(Arc<Mutex<Line>>);

impl Memory {
    fn line(&self) -> MutexGuard<'_, Line> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Cable for Memory {
    fn open(&self) -> Result<Box<dyn Link>, SocketError> {
        let mut line = self.line();
        line.places.push(VecDeque::new());
        Ok(Box::new(Place {
            number: line.places.len() - 1,
            memory: self.clone(),
        }))
    }
}

/// One place at it.
struct Place {
    number: usize,
    memory: Memory,
}

impl Link for Place {
    fn now_ns(&self) -> u64 {
        self.memory.line().now_ns
    }

    fn send(&self, frame: &[u8]) -> bool {
        let mut line = self.memory.line();
        let mut frame = frame.to_vec();
        let now_ns = line.now_ns;
        if let Some(Noise(change)) = &mut line.noise {
            change(&mut frame);
        }
        let returned = line.segment.receive(&mut frame, now_ns + ROUND_TRIP_NS / 2);
        let Some(returned) = returned else {
            return true;
        };
        let due_ns = now_ns + ROUND_TRIP_NS + returned.delay_ns;
        for place in &mut line.places {
            for _ in 0..returned.copies {
                if place.len() < WAITING_MAX {
                    let behind = place.partition_point(|(other_ns, _)| *other_ns <= due_ns);
                    place.insert(behind, (due_ns, frame.clone()));
                }
            }
        }
        true
    }

    fn receive(&self, buffer: &mut [u8; FRAME_MAX]) -> Option<usize> {
        let mut line = self.memory.line();
        let now_ns = line.now_ns;
        let place = &mut line.places[self.number];
        place.front().filter(|(due_ns, _)| *due_ns <= now_ns)?;
        let (_, mut frame) = place.pop_front()?;
        if let Some(Noise(change)) = &mut line.noise {
            change(&mut frame);
        }
        let length = frame.len().min(FRAME_MAX);
        buffer[..length].copy_from_slice(&frame[..length]);
        Some(length)
    }

    fn wait(&self, timeout_ns: u64) {
        let mut line = self.memory.line();
        let end_ns = line.now_ns + timeout_ns;
        let due_ns = line.places[self.number].front().map(|(due_ns, _)| *due_ns);
        line.pass_until(due_ns.map_or(end_ns, |due_ns| due_ns.min(end_ns)));
    }

    fn sleep(&self, for_ns: u64) {
        let mut line = self.memory.line();
        let end_ns = line.now_ns + for_ns;
        line.pass_until(end_ns);
    }
}

/// Driver and slaves.
pub struct Ethercat {
    driver: EthercatDriver,
    memory: Memory,
}

impl Ethercat {
    /// A slave for each joint, powered up, in SAFE-OP.
    pub fn open(
        robot: &Robot,
        run: &RunConfig,
        broken: Option<BusFault>,
        noise: Option<Noise>,
    ) -> Result<Self, VirtualError> {
        let options = Options::for_joints(robot.joints.len());
        Self::open_as(robot, run, options, broken, noise)
    }

    fn open_as(
        robot: &Robot,
        run: &RunConfig,
        options: Options,
        broken: Option<BusFault>,
        noise: Option<Noise>,
    ) -> Result<Self, VirtualError> {
        let parameters = PlantParameters::for_robot(robot)?;
        let options = Options {
            rate_hz: 1e9 / run.period_ns as f64,
            seed: run.seed,
            position_rad: run.initial_position_rad.clone(),
            ..options
        };
        let memory = Memory(Arc::new(Mutex::new(Line {
            segment: segment(robot, &parameters, &[], &options, 0)?,
            now_ns: 0,
            places: Vec::new(),
            noise,
        })));
        if let Some(BusFault::Ethercat(fault)) = broken {
            memory.line().segment.inject(fault, 0);
        }
        let mut robot = robot.clone();
        robot.drive = Some(table("interface = \"virtual\"")?);
        for joint in &mut robot.joints {
            let mut drive = table("homed = true")?;
            let own = joint.drive.take().unwrap_or_default();
            drive.extend(
                own.into_iter()
                    .filter(|(key, _)| STOPS.contains(&key.as_str())),
            );
            joint.drive = Some(drive);
        }
        let context = OpenContext {
            run,
            robot: &robot,
            bus: None,
        };
        Ok(Self {
            driver: EthercatDriver::open(&context, Box::new(memory.clone()))?,
            memory,
        })
    }
}

/// A table of a robot file.
pub fn table(text: &str) -> Result<toml::Table, OpenError> {
    text.parse()
        .map_err(|error: toml::de::Error| OpenError::Setting(error.message().to_owned()))
}

impl Driver for Ethercat {
    fn capabilities(&self) -> Capabilities {
        self.driver.capabilities()
    }

    fn read(
        &mut self,
        cycle: u64,
        planned_ns: u64,
        give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault> {
        self.driver.read(cycle, planned_ns, give_up_at_ns)
    }

    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        self.driver.write(command)
    }

    fn prepare(&mut self) {
        self.driver.prepare();
    }

    fn acyclic(&mut self) -> Option<Box<dyn Acyclic>> {
        self.driver.acyclic()
    }

    fn shutdown(&mut self) {
        self.driver.shutdown();
    }
}

impl VirtualDrives for Ethercat {
    fn truth(&self) -> PlantTruth {
        self.memory.line().segment.plant().truth()
    }

    fn is_driven(&self, joint: usize) -> bool {
        let line = self.memory.line();
        let mut axes = line.segment.slaves().iter().flat_map(Slave::axes);
        axes.any(|axis| {
            axis.config().joint == joint && axis.state() == PowerState::OperationEnabled
        })
    }

    fn now_ns(&self) -> u64 {
        self.memory.line().now_ns
    }

    fn pass_until(&mut self, until_ns: u64) {
        self.memory.line().pass_until(until_ns);
    }

    fn break_now(&mut self, fault: BusFault) {
        if let BusFault::Ethercat(fault) = fault {
            let mut line = self.memory.line();
            let now_ns = line.now_ns;
            line.segment.advance(now_ns);
            line.segment.inject(fault, now_ns);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rt_loop::bus_clock;
    use shm_types::drive::ClockState;

    use crate::run_config;

    const PERIOD_NS: u64 = 666_667;
    /// What the loop may be off its place before SYNC0, once both go together.
    const PHASE_MAX_NS: u64 = 20_000;

    #[test]
    fn the_loop_keeps_its_place_before_sync0_of_a_bus_whose_clock_is_50_ppm_off() {
        let robot = robot::load("pa10").expect("shipped");
        for clock_error_ppm in [-50.0, 50.0] {
            let options = Options {
                clock_error_ppm,
                ..Options::for_joints(7)
            };
            let mut bus = Ethercat::open_as(&robot, &run_config(7, PERIOD_NS), options, None, None)
                .expect("it opens");
            let mut epoch_ns = bus.now_ns();
            let (mut locked_at, mut furthest_ns) = (None, 0);
            // Ten seconds; at 50 ppm three quarters of a period go by in them.
            for cycle in 0..15_000 {
                let planned_ns = epoch_ns + cycle * PERIOD_NS;
                bus.pass_until(planned_ns);
                let sync0_ns = bus.memory.line().segment.slaves()[0].next_sync0_ns(planned_ns);
                let sample = bus.read(cycle, planned_ns, planned_ns + PERIOD_NS / 3);
                let sample = sample.expect("nothing is broken");
                bus.pass_until(planned_ns + PERIOD_NS / 4);
                bus.write(&DriveCommand::default()).expect("it is sent");
                bus.prepare();
                let later_ns = bus_clock::step_ns(&sample.bus, PERIOD_NS);
                epoch_ns = epoch_ns.saturating_add_signed(later_ns);
                if ClockState::from_raw(sample.bus.clock) == Some(ClockState::Locked) {
                    locked_at.get_or_insert(cycle);
                    let ahead_ns = sync0_ns.expect("it comes") - planned_ns;
                    let off_ns = ahead_ns.abs_diff(PERIOD_NS - PERIOD_NS / 8);
                    furthest_ns = furthest_ns.max(off_ns);
                }
            }
            let locked_at = locked_at.expect("they come together");
            println!(
                "{clock_error_ppm} ppm: locked after {locked_at} cycles, then {furthest_ns} ns off at most"
            );
            assert!(furthest_ns < PHASE_MAX_NS, "{furthest_ns} ns");
        }
    }
}
