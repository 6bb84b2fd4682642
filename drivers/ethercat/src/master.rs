//! From cables to PRE-OP and mapped process data: what [`ethercrab`] does for us, on the calling thread.
//!
//! ethercrab finds the slaves, gives them their addresses, reads who they are, brings their clocks together, and sets sync
//! managers and FMMUs by the mapping it reads from them. Its own task for sending ends at the first frame that comes back twice,
//! so frames are sent and received here.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::pin::pin;
use std::task::{Context, Poll, Waker};
use std::time::Duration;

use ethercat_wire::link::Link;
use ethercat_wire::socket::FRAME_MAX;
use ethercrab::subdevice_group::PreOp;
use ethercrab::{
    DefaultLock, MainDevice, MainDeviceConfig, PduRx, PduStorage, PduTx, RetryBehaviour,
    SubDeviceGroup, Timeouts,
};

/// Slaves and bytes of process data at most.
const SLAVES_MAX: usize = 32;
const PROCESS_DATA_MAX: usize = 4096;
const FRAMES: usize = 16;
const FRAME_DATA: usize = PduStorage::element_size(1100);
/// Frames that bring clocks together before anything else. Enough for 100 ppm: each takes away a part of what is left.
const CLOCK_FRAMES: u32 = 2000;
/// A slave's EEPROM answers within milliseconds; a busy machine, on which this thread has no priority yet, may add some.
const EEPROM_TIME: Duration = Duration::from_secs(1);
/// The same for a frame, after which it is sent again.
const FRAME_TIME: Duration = Duration::from_millis(500);
/// Longest sleep while ethercrab waits: its time-outs are looked at so often.
const LOOK_NS: u64 = 1_000_000;

/// A slave, as its EEPROM and registers have it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Device {
    /// Station address.
    pub station: u16,
    /// Order name.
    pub name: String,
    /// Vendor, product, revision, serial number.
    pub identity: [u32; 4],
    /// Station alias.
    pub alias: u16,
    /// Whether it has distributed clocks.
    pub has_clock: bool,
}

type Group = SubDeviceGroup<SLAVES_MAX, PROCESS_DATA_MAX, DefaultLock, PreOp>;

/// The bus in PRE-OP.
pub struct Master {
    main: MainDevice<'static>,
    link: Box<dyn Link>,
    tx: PduTx<'static>,
    rx: PduRx<'static>,
    group: Group,
    /// The slaves along the cable.
    pub devices: Vec<Device>,
}

/// Runs a future of ethercrab's to its end, with its frames sent and received at `link`.
fn run<F: Future>(
    link: &dyn Link,
    tx: &mut PduTx<'static>,
    rx: &mut PduRx<'static>,
    future: F,
) -> F::Output {
    let mut future = pin!(future);
    let mut context = Context::from_waker(Waker::noop());
    let mut buffer = [0; FRAME_MAX];
    loop {
        if let Poll::Ready(outcome) = future.as_mut().poll(&mut context) {
            return outcome;
        }
        while let Some(frame) = tx.next_sendable_frame() {
            // a frame that is not sent is a lost one, and sent again
            let _ = frame.send_blocking(|bytes| {
                let _ = link.send(bytes);
                Ok(bytes.len())
            });
        }
        link.wait(LOOK_NS);
        while let Some(length) = link.receive(&mut buffer) {
            // what ethercrab does not know, such as a frame that came twice, is none of ours
            let _ = rx.receive_frame(&buffer[..length]);
        }
    }
}

/// Has ethercrab do something, and makes one line of whatever goes wrong.
fn guarded<T>(
    what: &str,
    act: impl FnOnce() -> Result<T, ethercrab::error::Error>,
) -> Result<T, String> {
    match catch_unwind(AssertUnwindSafe(act)) {
        Ok(Ok(done)) => Ok(done),
        Ok(Err(error)) => Err(format!("{what}: {error}")),
        Err(_) => Err(format!(
            "{what}: a slave sent what the master does not understand; switch the drives off and on"
        )),
    }
}

impl Master {
    /// Finds the slaves and brings them to PRE-OP.
    ///
    /// # Errors
    /// One line.
    pub fn to_pre_op(link: Box<dyn Link>) -> Result<Self, String> {
        // Lives as long as the program; a bus is opened once or twice in one.
        let storage: &'static PduStorage<FRAMES, FRAME_DATA> =
            Box::leak(Box::new(PduStorage::new()));
        let (mut tx, mut rx, pdu_loop) = storage
            .try_split()
            .map_err(|()| "the frames of a bus are used twice".to_owned())?;
        let config = MainDeviceConfig {
            dc_static_sync_iterations: CLOCK_FRAMES,
            retry_behaviour: RetryBehaviour::Count(3),
        };
        let timeouts = Timeouts {
            eeprom: EEPROM_TIME,
            pdu: FRAME_TIME,
            ..Timeouts::default()
        };
        let main = MainDevice::new(pdu_loop, timeouts, config);
        // System time is the loop's own clock: what the loop follows are differences of one clock.
        let group = guarded("the drives do not come to PRE-OP", || {
            let init = main.init_single_group::<SLAVES_MAX, PROCESS_DATA_MAX>(|| link.now_ns());
            run(&*link, &mut tx, &mut rx, init)
        })?;
        let devices = group
            .iter(&main)
            .map(|slave| {
                let identity = slave.identity();
                Device {
                    station: slave.configured_address(),
                    name: slave.name().to_owned(),
                    identity: [
                        identity.vendor_id,
                        identity.product_id,
                        identity.revision,
                        identity.serial,
                    ],
                    alias: slave.alias_address(),
                    has_clock: slave.dc_support().any(),
                }
            })
            .collect();
        Ok(Self {
            main,
            link,
            tx,
            rx,
            group,
            devices,
        })
    }

    /// Sets sync managers and FMMUs as the slaves' mapping says.
    ///
    /// # Errors
    /// One line.
    pub fn map(self) -> Result<(), String> {
        let Self {
            main,
            link,
            mut tx,
            mut rx,
            group,
            ..
        } = self;
        // Answers to others at this cable came meanwhile; ethercrab would take those with its numbers for its own.
        let mut buffer = [0; FRAME_MAX];
        while link.receive(&mut buffer).is_some() {}
        guarded("the process data cannot be mapped", || {
            run(&*link, &mut tx, &mut rx, group.into_pre_op_pdi(&main)).map(drop)
        })
    }
}
