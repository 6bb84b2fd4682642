//! The segment on a network interface: a raw socket, the clock, and nothing else.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};

use ethercat_wire::socket::FRAME_MAX;
pub use ethercat_wire::socket::{RawSocket, SocketError, now_ns};
use realtime::grant::{Request, apply};

use crate::segment::Segment;

/// As the emulated plant's own process: below the loop and the controller.
const FIFO_PRIORITY: u8 = 70;
/// Frames that wait to be sent late; further ones are sent at once.
const DELAYED_MAX: usize = 64;
/// How long nobody looks whether to stop, at most.
const LOOK_NS: u64 = 50_000_000;

/// Serves the segment on the interface until `stop` is set, with a real-time priority where the system grants one. What else is done
/// with it, `beside`, is asked for 20 times a second at least, and must not take long.
pub fn serve(
    socket: &RawSocket,
    segment: &mut Segment,
    stop: &AtomicBool,
    mut beside: impl FnMut(&mut Segment),
) {
    let _held = apply(&Request {
        fifo_priority: Some(FIFO_PRIORITY),
        core: None,
        lock_memory: false,
        hold_dma_latency: false,
    });
    let mut buffer = [0; FRAME_MAX];
    let mut delayed: VecDeque<(u64, Vec<u8>)> = VecDeque::new();
    while !stop.load(Ordering::Relaxed) {
        while let Some(length) = socket.receive(&mut buffer) {
            let frame = &mut buffer[..length];
            let Some(returned) = segment.receive(frame, now_ns()) else {
                continue;
            };
            for _ in 0..returned.copies {
                if returned.delay_ns > 0 && delayed.len() < DELAYED_MAX {
                    delayed.push_back((now_ns() + returned.delay_ns, frame.to_vec()));
                } else {
                    // one that the kernel does not take is a lost one
                    let _ = socket.send(frame);
                }
            }
        }
        while delayed
            .front()
            .is_some_and(|(due_ns, _)| *due_ns <= now_ns())
        {
            if let Some((_, frame)) = delayed.pop_front() {
                let _ = socket.send(&frame);
            }
        }
        segment.advance(now_ns());
        beside(segment);
        let due_ns = delayed.front().map_or(u64::MAX, |(due_ns, _)| *due_ns);
        let next_ns = segment.next_event_ns().min(due_ns);
        let wait_ns = next_ns.saturating_sub(now_ns()).min(LOOK_NS);
        if wait_ns > 0 {
            socket.wait(wait_ns);
        }
    }
}
