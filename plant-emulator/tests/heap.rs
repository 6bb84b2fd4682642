//! A step never touches the heap. One test in this file, so that no other thread's calls are counted.

mod common;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

use common::{PERIOD_S, braked, torque, velocity};
use plant_emulator::{Plant, PlantParameters};
use robot::{Effect, Injection};

thread_local! {
    static HEAP_CALLS: Cell<usize> = const { Cell::new(0) };
}

struct CountingAllocator;

// SAFETY: every call goes to the system allocator with the caller's own arguments.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        HEAP_CALLS.set(HEAP_CALLS.get() + 1);
        // SAFETY: the caller keeps `alloc`'s contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        HEAP_CALLS.set(HEAP_CALLS.get() + 1);
        // SAFETY: the caller keeps `dealloc`'s contract, and `pointer` came from the system allocator.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn a_step_never_uses_the_heap() {
    let before = HEAP_CALLS.get();
    drop(black_box(Box::new(1)));
    assert_eq!(HEAP_CALLS.get() - before, 2, "the counter is dead");

    let robot = robot::load("pa10").expect("a shipped robot");
    let parameters = PlantParameters::for_robot(&robot).expect("a shipped plant file");
    // begin while it runs: the rigid bodies, the gear and the path of commands change
    let effects = [
        (
            None,
            Effect::Payload {
                mass_kg: 2.0,
                centre_m: [0.0, 0.0, 0.1],
            },
        ),
        (Some(1), Effect::Backlash { gap_rad: 1e-3 }),
        (Some(2), Effect::CoulombFriction { coulomb_nm: 3.0 }),
        (None, Effect::CommandDelay { delay_s: 1e-3 }),
        (None, Effect::DroppedSamples { fraction: 0.1 }),
    ];
    let injections = effects.map(|(joint, effect)| Injection {
        joint,
        effect,
        start_s: 0.05,
    });
    let plant = Plant::new(&robot, &parameters, &injections, 1, &[0.2; 7], PERIOD_S);
    let mut plant = plant.expect("a valid plant");

    let before = HEAP_CALLS.get();
    for command in [velocity(&[0.1; 7]), torque(&[0.5; 7]), braked()] {
        for _ in 0..150 {
            black_box(plant.step(black_box(&command)));
        }
    }
    black_box(plant.truth());
    assert_eq!(HEAP_CALLS.get(), before);
}
