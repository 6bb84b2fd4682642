//! Virtual EtherCAT drives: slaves that masters take for hardware, with an emulated robot behind them.
//!
//! The core is frame bytes in, frame bytes out, with time as an argument ([`Segment::receive`]); [`socket`] puts it on a
//! network interface. Each slave has the registers, memory, sync managers and FMMUs of a controller ([`esc`]), an EEPROM
//! ([`sii`]), a mailbox with CoE ([`coe`]), a state machine with its checks ([`slave`]), distributed clocks ([`clock`]), and
//! one or more CiA 402 axes ([`axis`], [`power`]). What moves is the plant of [`plant_emulator`].
//!
//! ```
//! use ethercat_emulator::{Options, segment, wire};
//! use plant_emulator::PlantParameters;
//!
//! let robot = robot::load("shd17")?;
//! let parameters = PlantParameters::for_robot(&robot)?;
//! let mut drives = segment(&robot, &parameters, &[], &Options::for_joints(1), 0)?;
//! // a broadcast read of the AL status finds one slave in INIT
//! let mut frame = wire::frame(&[(7, 0, [0, 0, 0x30, 0x01], &[0, 0])]);
//! assert!(drives.receive(&mut frame, 1_000_000).is_some());
//! wire::for_each_datagram(&mut frame, |datagram| {
//!     assert_eq!((datagram.working_counter(), datagram.data[0]), (1, 1));
//! });
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Left out: redundancy and branches, hot connect, file and Ethernet over EtherCAT, interrupts to the master, SYNC1, modes of
//! operation other than the cyclic ones. Frames take no time but the slaves' hops.

pub mod axis;
pub mod clock;
pub mod coe;
pub mod esc;
pub mod fault;
pub mod objects;
pub mod power;
mod segment;
mod setup;
pub mod sii;
pub mod slave;
pub mod socket;

pub use ethercat_wire::frame as wire;
pub use fault::{Fault, TimedFault};
pub use segment::{Returned, Segment};
pub use setup::{Options, PRODUCT, SetupError, VENDOR, segment};
pub use slave::{Slave, SlaveConfig};
