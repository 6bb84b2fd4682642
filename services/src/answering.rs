//! The process around a core that answers every sample of the loop with one message.

use std::sync::atomic::{AtomicBool, Ordering};

use realtime::clock::{monotonic_ns, sleep_until};
use realtime::grant::{Request, apply};
use shm_types::bus::{Bus, BusError, Message, Writer};
use shm_types::instance::{Mode, RunConfig, Wait};
use shm_types::messages::{Heartbeat, SensorSample};
use shm_types::topics::{self, Role, Signal, Topic};

/// How long a service sleeps at most: a heartbeat comes at least this often.
const BEAT_NS: u64 = 100_000_000;
/// How late a sample is answered whose wake-up was lost: more than a period, so that it costs nothing otherwise.
const RECHECK_NS: u64 = 1_000_000;
/// A predecessor that was killed may still count as the topic's writer for a moment.
const TAKEOVER_TRIES: usize = 200;
/// Between two tries.
const TAKEOVER_PAUSE_NS: u64 = 5_000_000;

/// What distinguishes one service from another.
pub struct Service<'a, T> {
    /// Which process this is.
    pub role: Role,
    /// Its SCHED_FIFO priority in real time.
    pub fifo_priority: u8,
    /// Where it answers.
    pub topic: Topic<T>,
    /// What wakes the loop to read the answer, if the loop waits for it.
    pub ready: Option<Signal>,
    /// The answer to a sample; `None` if there can be none.
    pub answer: &'a mut dyn FnMut(&SensorSample) -> Option<T>,
}

/// Answers samples until `stop` is set.
///
/// # Errors
/// [`BusError`] if a topic cannot be opened or another process answers already.
pub fn serve<T: Message>(
    bus: &Bus,
    run: &RunConfig,
    joint_count: usize,
    service: Service<'_, T>,
    stop: &AtomicBool,
) -> Result<(), BusError> {
    let samples = bus.reader(&topics::SENSOR_SAMPLE)?;
    let sample_ready = bus.listener(&topics::SENSOR_SAMPLE_READY, run.recheck_ns(RECHECK_NS))?;
    let mut writer = take_over(bus, &service.topic)?;
    let answer_ready = match &service.ready {
        Some(signal) => Some(bus.notifier(signal)?),
        None => None,
    };
    let mut heartbeat = take_over(bus, &service.role.heartbeat())?;
    let _held = (run.mode == Mode::Realtime).then(|| {
        apply(&Request {
            fifo_priority: Some(service.fifo_priority),
            core: run.core_of(service.role),
            lock_memory: true,
            hold_dma_latency: false,
        })
    });
    let mut beat_at_ns = 0;
    let mut cycle = 0;
    while !stop.load(Ordering::Relaxed) {
        let now_ns = monotonic_ns();
        if now_ns >= beat_at_ns {
            heartbeat.send_and_prepare(heartbeat_now(run.session, now_ns, cycle));
            beat_at_ns = now_ns + BEAT_NS;
        }
        match run.wait {
            Wait::Block => {
                sample_ready.wait(BEAT_NS);
            }
            Wait::Spin => std::hint::spin_loop(),
        }
        // An older sample is past its deadline; only the newest is worth an answer.
        let newest = samples.take_newest();
        let Some(sample) = newest.and_then(|sample| sample.checked(run.session, joint_count))
        else {
            continue;
        };
        cycle = sample.header.cycle;
        if let Some(answer) = (service.answer)(&sample) {
            writer.send(answer);
            if let Some(answer_ready) = &answer_ready {
                answer_ready.notify();
            }
            writer.prepare();
        }
    }
    Ok(())
}

/// A sign of life of this process.
pub fn heartbeat_now(session: u64, now_ns: u64, cycle: u64) -> Heartbeat {
    Heartbeat {
        session,
        process_id: u64::from(std::process::id()),
        sent_at_ns: now_ns,
        cycle,
    }
}

/// Becomes the writer of a topic whose last writer may have been killed a moment ago.
///
/// # Errors
/// [`BusError`] if the topic still has a writer after a second.
pub fn take_over<T: Message>(bus: &Bus, topic: &Topic<T>) -> Result<Writer<T>, BusError> {
    let mut tries = 0;
    loop {
        match bus.writer(topic) {
            Err(_) if tries < TAKEOVER_TRIES => {
                tries += 1;
                bus.clear_dead();
                sleep_until(monotonic_ns() + TAKEOVER_PAUSE_NS);
            }
            outcome => return outcome,
        }
    }
}
