//! What the loop's thread takes from the heap in a cycle: the middleware's loans, and nothing else.
//!
//! All processes of an instance run here as threads in lockstep, so that the loop's own thread can be watched.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use realtime::process::user_id;
use rt_loop::driver::{Capabilities, DriveFault, Driver};
use rt_loop::emulator_driver::EmulatorDriver;
use rt_loop::process::control;
use shm_types::bus::Bus;
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Instance, Mode, RunConfig, Wait};
use shm_types::messages::{DriveCommand, DriveSample};

struct Counting;

thread_local! {
    static HEAP_CALLS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: every call is passed on to the system's allocator unchanged; counting touches a thread-local number only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        HEAP_CALLS.set(HEAP_CALLS.get() + 1);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promises are passed on.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        HEAP_CALLS.set(HEAP_CALLS.get() + 1);
        // SAFETY: the caller's promises are passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Cycles between which heap calls are compared: after the start, before the end.
const WATCHED: std::ops::Range<u64> = 1000..4000;

/// The emulator's driver, which on the loop's own thread notes the heap calls so far.
struct WatchedDriver {
    driver: EmulatorDriver,
    heap_calls: Arc<[AtomicU64; 2]>,
}

impl Driver for WatchedDriver {
    fn capabilities(&self) -> Capabilities {
        self.driver.capabilities()
    }

    fn read(
        &mut self,
        cycle: u64,
        planned_ns: u64,
        give_up_at_ns: u64,
    ) -> Result<DriveSample, DriveFault> {
        if cycle == WATCHED.start {
            self.heap_calls[0].store(HEAP_CALLS.get(), Ordering::Relaxed);
        }
        if cycle == WATCHED.end {
            self.heap_calls[1].store(HEAP_CALLS.get(), Ordering::Relaxed);
        }
        self.driver.read(cycle, planned_ns, give_up_at_ns)
    }

    fn write(&mut self, command: &DriveCommand) -> Result<(), DriveFault> {
        self.driver.write(command)
    }

    fn prepare(&mut self) {
        self.driver.prepare();
    }
}

/// Heap calls of the loop's thread in the watched cycles.
fn heap_calls_of_a_run() -> u64 {
    let instance =
        Instance::new(&format!("heap-{}", std::process::id()), user_id()).expect("a good name");
    instance.make_parent(user_id()).expect("ours");
    instance.wipe().expect("wiped");
    instance.make_directory().expect("made");
    let robot = robot::load("pa10").expect("shipped");
    let mut start = motion::Reference::default();
    motion::load("lemniscate", &robot)
        .expect("shipped")
        .sample(0.0, &mut start);
    let run = RunConfig {
        session: 1,
        robot: "pa10".to_owned(),
        driver: "emulator".to_owned(),
        trajectory: "lemniscate".to_owned(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        estimators: Vec::new(),
        mode: Mode::Lockstep,
        period_ns: 666_667,
        cycles: WATCHED.end + 100,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        command_deadline_ns: 500_000,
        cores: Vec::new(),
        initial_position_rad: start.position_rad[..7].to_vec(),
    };
    instance.write_run_config(&run).expect("written");
    let stop = Arc::new(AtomicBool::new(false));
    let beside = [
        start_thread(&instance, &stop, |instance, stop| {
            plant_emulator::process::run(instance, stop).expect("emulates")
        }),
        start_thread(&instance, &stop, |instance, stop| {
            services::estimator_process::run(instance, stop).expect("estimates")
        }),
        start_thread(&instance, &stop, |instance, stop| {
            services::feedforward_process::run(instance, stop).expect("controls")
        }),
        start_thread(&instance, &stop, |instance, stop| {
            services::relay_process::run(instance, stop).expect("relays")
        }),
    ];
    let heap_calls: Arc<[AtomicU64; 2]> = Arc::default();
    let bus = Bus::join(&instance).expect("ours");
    let driver = WatchedDriver {
        driver: EmulatorDriver::open(&bus, &run).expect("the first loop"),
        heap_calls: Arc::clone(&heap_calls),
    };
    let config = rt_loop::config::cycle_config(&run, &robot);
    let report = control(&bus, driver, run, config, &AtomicBool::new(false)).expect("runs");
    assert_eq!(report.final_state, "Running");
    stop.store(true, Ordering::Relaxed);
    for thread in beside {
        thread.join().expect("no panic");
    }
    drop(bus);
    instance.vanish().expect("wiped");
    heap_calls[1].load(Ordering::Relaxed) - heap_calls[0].load(Ordering::Relaxed)
}

fn start_thread(
    instance: &Instance,
    stop: &Arc<AtomicBool>,
    work: fn(&Instance, &AtomicBool),
) -> std::thread::JoinHandle<()> {
    let (instance, stop) = (instance.clone(), Arc::clone(stop));
    std::thread::spawn(move || work(&instance, &stop))
}

#[test]
fn the_detector_sees_one_allocation() {
    let before = HEAP_CALLS.get();
    drop(black_box(Box::new(1_u64)));
    assert_eq!(HEAP_CALLS.get() - before, 1);
}

#[test]
fn a_cycle_allocates_three_loans_and_nothing_else() {
    let cycles = WATCHED.end - WATCHED.start;
    // Sample, drive command and status; a heartbeat every 150 cycles.
    assert_eq!(heap_calls_of_a_run(), 3 * cycles + cycles / 150);
}
