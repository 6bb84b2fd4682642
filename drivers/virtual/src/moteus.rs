//! The moteus driver at ports of memory with virtual drives behind them.

use std::cell::RefCell;
use std::rc::Rc;
use std::time::Duration;

use moteus_driver::MoteusDriver;
use moteus_driver::host::{Host, Serial};
use moteus_emulator::{Bench, Fault, Mode, Setup};
use plant_emulator::PlantTruth;
use robot::Robot;
use rt_loop::driver::{Capabilities, DriveFault, Driver, OpenContext};
use rustix::io::Errno;
use shm_types::instance::RunConfig;
use shm_types::messages::{DriveCommand, DriveSample};

use crate::ethercat::table;
use crate::{BusFault, Noise, VirtualDrives, VirtualError};

/// Joints on a bus: as many as 1.5 kHz have time for (docs/drives-moteus.md).
const JOINTS_ON_BUS: usize = 2;
/// Name of a port; the number of its bus follows.
const PORT: &str = "bus";

/// The drives and the clock.
#[derive(Debug)]
struct Rig {
    bench: Bench,
    now_ns: u64,
    noise: Option<Noise>,
}

impl Rig {
    fn pass_until(&mut self, until_ns: u64) {
        self.now_ns = self.now_ns.max(until_ns);
        self.bench.advance_to(self.now_ns);
    }
}

#[derive(Clone, Debug)]
struct Memory(Rc<RefCell<Rig>>);

/// The computer's end of a bus.
struct Wire {
    memory: Memory,
    bus: usize,
    /// A line that is not whole yet.
    line: Vec<u8>,
    /// What has come and was not taken.
    come: Vec<u8>,
}

impl Serial for Wire {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Errno> {
        let mut rig = self.memory.0.borrow_mut();
        let now_ns = rig.now_ns;
        if !rig.bench.is_open(self.bus) {
            return Err(Errno::IO);
        }
        for byte in bytes {
            if matches!(byte, b'\r' | b'\n') {
                if let Some(Noise(change)) = &mut rig.noise {
                    change(&mut self.line);
                }
                rig.bench.take_line(self.bus, now_ns, &self.line);
                self.line.clear();
            } else {
                self.line.push(*byte);
            }
        }
        Ok(bytes.len())
    }

    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Errno> {
        let mut rig = self.memory.0.borrow_mut();
        let now_ns = rig.now_ns;
        if !rig.bench.is_open(self.bus) {
            return Err(Errno::IO);
        }
        let mut read = Vec::new();
        rig.bench.read(self.bus, now_ns, &mut read);
        if let Some(Noise(change)) = &mut rig.noise
            && !read.is_empty()
        {
            change(&mut read);
        }
        self.come.extend(read);
        let length = self.come.len().min(buffer.len());
        if length == 0 {
            return Err(Errno::AGAIN);
        }
        buffer[..length].copy_from_slice(&self.come[..length]);
        self.come.drain(..length);
        Ok(length)
    }
}

impl Host for Memory {
    fn now_ns(&self) -> u64 {
        self.0.borrow().now_ns
    }

    fn open(&self, path: &str) -> Result<Box<dyn Serial>, Errno> {
        let bus = path.strip_prefix(PORT).and_then(|bus| bus.parse().ok());
        let bus: usize = bus.ok_or(Errno::NOENT)?;
        if !self.0.borrow().bench.is_open(bus) {
            return Err(Errno::NOENT);
        }
        Ok(Box::new(Wire {
            memory: self.clone(),
            bus,
            line: Vec::new(),
            come: Vec::new(),
        }))
    }

    fn wait(&self, _: &mut dyn Iterator<Item = &dyn Serial>, wait_ns: u64) {
        let mut rig = self.0.borrow_mut();
        let end_ns = rig.now_ns + wait_ns;
        // what is due already is of a bus that is not read at the moment
        let next_ns = rig.bench.next_answer_ns().filter(|ns| *ns > rig.now_ns);
        rig.pass_until(next_ns.map_or(end_ns, |next_ns| next_ns.min(end_ns)));
    }

    fn sleep(&self, for_ns: u64) {
        let mut rig = self.0.borrow_mut();
        let end_ns = rig.now_ns + for_ns;
        rig.pass_until(end_ns);
    }
}

/// Driver and drives.
pub struct Moteus {
    driver: MoteusDriver,
    memory: Memory,
}

impl Moteus {
    /// Drives that were looked at and stand still.
    pub fn open(
        robot: &Robot,
        run: &RunConfig,
        broken: Option<BusFault>,
        noise: Option<Noise>,
    ) -> Result<Self, VirtualError> {
        let buses = robot.joints.len().div_ceil(JOINTS_ON_BUS);
        let setup = Setup {
            initial_position_rad: run.initial_position_rad.clone(),
            buses,
            is_homed: true,
            seed: run.seed,
            // From the first line on that somebody sends.
            faults: match broken {
                Some(BusFault::Moteus(kind, for_ns)) => vec![Fault {
                    kind,
                    start: Duration::ZERO,
                    duration: Some(Duration::from_nanos(for_ns)),
                }],
                _ => Vec::new(),
            },
        };
        let bench = Bench::new(robot, &setup)?;
        let mut robot = robot.clone();
        let ports: Vec<String> = (0..buses).map(|bus| format!("\"{PORT}{bus}\"")).collect();
        robot.drive = Some(table(&format!("ports = [{}]", ports.join(", ")))?);
        for bus in 0..buses {
            for (joint, id) in bench.joints_on(bus) {
                let text = format!("id = {id}\nbus = {}", bus + 1);
                robot.joints[joint].drive = Some(table(&text)?);
            }
        }
        let memory = Memory(Rc::new(RefCell::new(Rig {
            bench,
            now_ns: 0,
            noise,
        })));
        let context = OpenContext {
            run,
            robot: &robot,
            bus: None,
        };
        Ok(Self {
            driver: MoteusDriver::open(&context, Box::new(memory.clone()))?,
            memory,
        })
    }
}

impl Driver for Moteus {
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

    fn shutdown(&mut self) {
        self.driver.shutdown();
    }
}

impl VirtualDrives for Moteus {
    fn truth(&self) -> PlantTruth {
        self.memory.0.borrow().bench.truth()
    }

    fn is_driven(&self, joint: usize) -> bool {
        let rig = self.memory.0.borrow();
        rig.bench.controller(joint).servo().mode() == Mode::Position
    }

    fn now_ns(&self) -> u64 {
        self.memory.0.borrow().now_ns
    }

    fn pass_until(&mut self, until_ns: u64) {
        self.memory.0.borrow_mut().pass_until(until_ns);
    }

    fn break_now(&mut self, fault: BusFault) {
        if let BusFault::Moteus(kind, for_ns) = fault {
            let mut rig = self.memory.0.borrow_mut();
            let now_ns = rig.now_ns;
            rig.bench.advance_to(now_ns);
            rig.bench.inject(kind, for_ns);
        }
    }
}
