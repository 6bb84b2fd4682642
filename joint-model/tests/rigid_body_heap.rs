//! The dynamics never touch the heap. One test in this file, so that no other thread's calls are counted.

mod rigid_body_chains;

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::hint::black_box;

use joint_model::rigid_body::{LINKS_MAX, Moving, Standing};
use rigid_body_chains::REFERENCE;

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

fn heap_calls_of(action: impl FnOnce()) -> usize {
    let before = HEAP_CALLS.get();
    action();
    HEAP_CALLS.get() - before
}

#[test]
fn no_computation_uses_the_heap() {
    assert_eq!(
        heap_calls_of(|| drop(black_box(Box::new(1)))),
        2,
        "the counter is dead"
    );

    for reference in REFERENCE.chains.iter().chain(&REFERENCE.trees) {
        let (chain, state) = (reference.build(), &reference.states[0]);
        let (position, velocity) = (&state.position_rad[..], &state.velocity_rad_s[..]);
        let mut result = [0.0; LINKS_MAX];
        let calls = heap_calls_of(|| {
            chain.inverse_dynamics(position, velocity, &state.acceleration_rad_s2, &mut result);
            black_box(&result);
            chain.gravity_torque(position, &mut result);
            black_box(&result);
            chain.forward_dynamics(position, velocity, &state.applied_torque_nm, &mut result);
            let mut moving = Moving::default();
            chain.links_moving(position, velocity, &state.acceleration_rad_s2, &mut moving);
            let mut standing = Standing::default();
            chain.links_standing(position, &mut standing);
            black_box((
                &result,
                chain.moving_torque_nm(0, &moving),
                chain.carried(0, &standing),
                chain.tool_pose(position),
                chain.potential_energy_j(position),
            ));
        });
        assert_eq!(calls, 0, "{} joints", chain.joint_count());
    }
}
