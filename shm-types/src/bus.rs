//! Joining an instance: opening its topics as their one writer or as a reader.

use std::fmt::{Debug, Display};

use iceoryx2::port::listener::Listener as IpcListener;
use iceoryx2::port::notifier::Notifier as IpcNotifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::*;
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use iceoryx2_bb_posix::file_descriptor::FileDescriptorBased;

use realtime::process::user_id;
use realtime::wait::readable;

use crate::instance::Instance;
use crate::messages::{
    Command, DriveCommand, DriveSample, Heartbeat, LastCycle, LoopStatus, OperatorRequest,
    PlantTruth, SensorSample, Supervision, TorqueEstimate,
};
use crate::topics::{Signal, Topic};

type Ipc = ipc::Service;

/// A process's membership in an instance.
#[derive(Debug)]
pub struct Bus {
    node: Node<Ipc>,
}

/// Why a process cannot join or a topic cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum BusError {
    /// The instance's shared memory cannot be joined.
    #[error("cannot join instance `{instance}`: {reason}")]
    Join {
        /// Its name.
        instance: String,
        /// The middleware's reason.
        reason: String,
    },
    /// A topic cannot be opened; a second writer is refused this way.
    #[error("cannot open topic `{topic}` as {role}: {reason}")]
    Open {
        /// Its name.
        topic: &'static str,
        /// `writer` or `reader`.
        role: &'static str,
        /// The middleware's reason.
        reason: String,
    },
}

/// Payloads that may travel: fixed layout, no pointers.
///
/// What opens a topic is a method of the message, so that the middleware's code for it is compiled once, in this crate, and not in
/// every program anew.
pub trait Message: ZeroCopySend + Copy + Debug + 'static {
    /// [`Bus::writer`].
    ///
    /// # Errors
    /// [`BusError::Open`].
    fn writer(bus: &Bus, topic: &Topic<Self>) -> Result<Writer<Self>, BusError>;

    /// [`Bus::reader`].
    ///
    /// # Errors
    /// [`BusError::Open`].
    fn reader(bus: &Bus, topic: &Topic<Self>) -> Result<Reader<Self>, BusError>;
}

macro_rules! messages {
    ($($message:ty),+ $(,)?) => {$(
        impl Message for $message {
            fn writer(bus: &Bus, topic: &Topic<Self>) -> Result<Writer<Self>, BusError> {
                bus.open_writer(topic)
            }

            fn reader(bus: &Bus, topic: &Topic<Self>) -> Result<Reader<Self>, BusError> {
                bus.open_reader(topic)
            }
        }
    )+};
}

messages!(
    Command,
    DriveCommand,
    DriveSample,
    Heartbeat,
    LastCycle,
    LoopStatus,
    OperatorRequest,
    PlantTruth,
    SensorSample,
    Supervision,
    TorqueEstimate,
);

impl Bus {
    /// Joins the instance.
    ///
    /// # Errors
    /// [`BusError::Join`] if its directory or shared memory cannot be used.
    pub fn join(instance: &Instance) -> Result<Self, BusError> {
        set_log_level(LogLevel::Error);
        let join_error = |reason: String| BusError::Join {
            instance: instance.name().to_owned(),
            reason,
        };
        let config = instance
            .ipc_config()
            .map_err(|error| join_error(error.to_string()))?;
        let node = NodeBuilder::new()
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map_err(|error| join_error(error.to_string()))?;
        instance
            .close_shared_memory(user_id())
            .map_err(|error| join_error(error.to_string()))?;
        Ok(Self { node })
    }

    /// Becomes the topic's one writer.
    ///
    /// # Errors
    /// [`BusError::Open`], also when there is a writer already.
    pub fn writer<T: Message>(&self, topic: &Topic<T>) -> Result<Writer<T>, BusError> {
        T::writer(self, topic)
    }

    /// Becomes a reader of the topic, with the topic's whole buffer.
    ///
    /// # Errors
    /// [`BusError::Open`], also when the topic has all the readers it admits.
    pub fn reader<T: Message>(&self, topic: &Topic<T>) -> Result<Reader<T>, BusError> {
        T::reader(self, topic)
    }

    fn open_writer<T: Message>(&self, topic: &Topic<T>) -> Result<Writer<T>, BusError> {
        let error = |reason: String| BusError::Open {
            topic: topic.name,
            role: "writer",
            reason,
        };
        let service = self.open(topic).map_err(error)?;
        let publisher = service
            .publisher_builder()
            // One being sent, one loaned in advance.
            .max_loaned_samples(2)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|failure| error(failure.to_string()))?;
        let mut writer = Writer {
            publisher,
            loaned: None,
        };
        writer.prepare();
        Ok(writer)
    }

    fn open_reader<T: Message>(&self, topic: &Topic<T>) -> Result<Reader<T>, BusError> {
        let error = |reason: String| BusError::Open {
            topic: topic.name,
            role: "reader",
            reason,
        };
        let service = self.open(topic).map_err(error)?;
        let subscriber = service
            .subscriber_builder()
            .create()
            .map_err(|failure| error(failure.to_string()))?;
        Ok(Reader { subscriber })
    }

    /// Opens a signal to raise it.
    ///
    /// # Errors
    /// [`BusError::Open`].
    pub fn notifier(&self, signal: &Signal) -> Result<Notifier, BusError> {
        let error = |reason: String| BusError::Open {
            topic: signal.name,
            role: "writer",
            reason,
        };
        let service = self.open_signal(signal).map_err(error)?;
        let notifier = service
            .notifier_builder()
            .create()
            .map_err(|failure| error(failure.to_string()))?;
        Ok(Notifier { notifier })
    }

    /// Opens a signal to wait for it. A wake-up that the middleware loses is found `recheck_ns` later.
    ///
    /// # Errors
    /// [`BusError::Open`].
    pub fn listener(&self, signal: &Signal, recheck_ns: u64) -> Result<Listener, BusError> {
        let error = |reason: String| BusError::Open {
            topic: signal.name,
            role: "reader",
            reason,
        };
        let service = self.open_signal(signal).map_err(error)?;
        let listener = service
            .listener_builder()
            .create()
            .map_err(|failure| error(failure.to_string()))?;
        Ok(Listener {
            listener,
            recheck_ns,
        })
    }

    /// Removes what processes that were killed have left, so that their places are free.
    pub fn clear_dead(&self) {
        let _ = self.node.try_cleanup_dead_nodes();
    }

    fn open<T: Message>(
        &self,
        topic: &Topic<T>,
    ) -> Result<iceoryx2::service::port_factory::publish_subscribe::PortFactory<Ipc, T, ()>, String>
    {
        let name = topic
            .name
            .try_into()
            .map_err(|error| format!("{error:?}"))?;
        let open = || {
            self.node
                .service_builder(&name)
                .publish_subscribe::<T>()
                .max_publishers(1)
                .max_subscribers(topic.readers_max)
                // Every process of the instance, and observers coming and going.
                .max_nodes(32)
                .subscriber_max_buffer_size(topic.buffer)
                .enable_safe_overflow(true)
                // A restarted service finds the sample the loop is waiting on.
                .history_size(1)
                .open_or_create()
        };
        settled(open, |error| {
            use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError as Open;
            use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenOrCreateError as Error;
            matches!(
                error,
                Error::PublishSubscribeOpenError(Open::HangsInCreation | Open::DoesNotExist)
            )
        })
    }

    fn open_signal(
        &self,
        signal: &Signal,
    ) -> Result<iceoryx2::service::port_factory::event::PortFactory<Ipc>, String> {
        let name = signal
            .name
            .try_into()
            .map_err(|error| format!("{error:?}"))?;
        let open = || {
            self.node
                .service_builder(&name)
                .event()
                .max_nodes(32)
                .max_notifiers(4)
                .max_listeners(4)
                // A signal says one thing. The middleware looks through all the events there may be at every wake-up: 256 if not told.
                .event_id_max_value(0)
                .open_or_create()
        };
        settled(open, |error| {
            use iceoryx2::service::builder::event::EventOpenError as Open;
            use iceoryx2::service::builder::event::EventOpenOrCreateError as Error;
            matches!(
                error,
                Error::EventOpenError(Open::HangsInCreation | Open::DoesNotExist)
            )
        })
    }
}

/// How often a topic is opened that another process is making: the middleware waits for half a second each time, and on a busy machine
/// the other may be kept from it for longer, or end.
const OPENINGS: usize = 6;

/// What opening gives once nobody is in the midst of making or removing it.
fn settled<S, E: Display>(
    open: impl Fn() -> Result<S, E>,
    is_in_the_midst: impl Fn(&E) -> bool,
) -> Result<S, String> {
    let mut opened = open();
    for _ in 1..OPENINGS {
        if !opened.as_ref().err().is_some_and(&is_in_the_midst) {
            break;
        }
        opened = open();
    }
    opened.map_err(|error| error.to_string())
}

/// The one writer of a topic.
///
/// Loaning a message from the middleware allocates once. [`prepare`](Self::prepare) does that ahead of time, so that
/// [`send`](Self::send) is free of it.
pub struct Writer<T: Message> {
    publisher: Publisher<Ipc, T, ()>,
    loaned: Option<SampleMutUninit<Ipc, std::mem::MaybeUninit<T>, ()>>,
}

impl<T: Message> Writer<T> {
    /// Loans the next message: one heap allocation, to be made outside the time-critical part of a cycle.
    pub fn prepare(&mut self) {
        if self.loaned.is_none() {
            self.loaned = self.publisher.loan_uninit().ok();
        }
    }

    /// Sends one message to all readers; `false` if it could not be sent. Frees what [`prepare`](Self::prepare)
    /// allocated; allocates only if that was not called since the last message.
    pub fn send(&mut self, message: T) -> bool {
        self.prepare();
        match self.loaned.take() {
            Some(loaned) => loaned.write_payload(message).send().is_ok(),
            None => false,
        }
    }

    /// Sends one message and loans the next: for writers without a time-critical part.
    pub fn send_and_prepare(&mut self, message: T) -> bool {
        let sent = self.send(message);
        self.prepare();
        sent
    }

    /// Gives readers that have joined since the last message the last message.
    pub fn greet_new_readers(&self) {
        // A reader that cannot be reached is dead; its heartbeat tells.
        let _ = self.publisher.update_connections();
    }
}

/// A reader of a topic.
#[derive(Debug)]
pub struct Reader<T: Message> {
    subscriber: Subscriber<Ipc, T, ()>,
}

impl<T: Message> Reader<T> {
    /// The oldest unread message.
    ///
    /// A connection that broke because its writer died reads as no message: heartbeats tell who lives.
    pub fn take(&self) -> Option<T> {
        self.subscriber
            .receive()
            .ok()
            .flatten()
            .map(|sample| *sample.payload())
    }

    /// The newest message; older unread ones are dropped.
    pub fn take_newest(&self) -> Option<T> {
        let mut newest = None;
        while let Some(message) = self.take() {
            newest = Some(message);
        }
        newest
    }
}

/// Raises a signal.
#[derive(Debug)]
pub struct Notifier {
    notifier: IpcNotifier<Ipc>,
}

impl Notifier {
    /// Wakes every listener.
    pub fn notify(&self) {
        // A listener that is gone or full needs no waking; `MissedDeadline` is raised after the event was sent.
        let _ = self.notifier.notify();
    }
}

/// Waits for a signal.
///
/// The middleware (iceoryx2 0.10) can lose a wake-up for good: when a signal is raised just while the one before is
/// being collected, the listener is noted as notified while its socket is empty, and nobody writes to the socket again
/// until the listener looks without being told to. So no wait relies on the socket for longer than `recheck_ns`.
#[derive(Debug)]
pub struct Listener {
    listener: IpcListener<Ipc>,
    recheck_ns: u64,
}

impl Listener {
    /// Waits until the signal is raised, at most `longest_ns`; `true` if it was. Look at the topic afterwards either way.
    pub fn wait(&self, longest_ns: u64) -> bool {
        // SAFETY: the descriptor is only polled, never read, written or closed through this number.
        let descriptor = unsafe { self.listener.file_descriptor().native_handle() };
        let mut left_ns = longest_ns;
        loop {
            let slice_ns = left_ns.min(self.recheck_ns);
            let readable = readable(descriptor, slice_ns);
            let raised = self.listener.try_wait(|_| ()).unwrap_or(0) > 0;
            left_ns -= slice_ns;
            if readable || raised || left_ns == 0 {
                return readable || raised;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topics::COMMAND_READY;

    /// The state that the race leaves behind: noted as notified, the socket empty.
    fn take_from_socket(listener: &Listener) {
        let mut byte = [0_u8];
        // SAFETY: the descriptor is valid as long as the listener; the buffer is as long as is said.
        let taken = unsafe {
            let descriptor = listener.listener.file_descriptor().native_handle();
            libc::recv(descriptor, byte.as_mut_ptr().cast(), 1, libc::MSG_DONTWAIT)
        };
        assert_eq!(taken, 1, "the signal had reached the socket");
    }

    #[test]
    fn a_topic_in_the_making_is_opened_again_and_not_for_ever() {
        let asked = std::cell::Cell::new(0);
        let open_after = |settled_after: usize, error: &'static str| {
            asked.set(0);
            let open = || {
                asked.set(asked.get() + 1);
                if asked.get() > settled_after {
                    Ok(asked.get())
                } else {
                    Err(error)
                }
            };
            settled(open, |error| *error == "in the midst")
        };
        assert_eq!(open_after(2, "in the midst"), Ok(3));
        let never = open_after(usize::MAX, "in the midst");
        assert_eq!((never.is_err(), asked.get()), (true, OPENINGS));
        // what is wrong for good is said at once
        assert!(open_after(1, "another").is_err());
        assert_eq!(asked.get(), 1);
    }

    #[test]
    fn a_listener_whose_wake_up_was_lost_finds_it_and_hears_the_next() {
        let name = format!("signal-{}", std::process::id());
        let instance = Instance::new(&name, user_id()).unwrap();
        instance.make_parent(user_id()).unwrap();
        instance.make_directory().unwrap();
        let bus = Bus::join(&instance).unwrap();
        let listener = bus.listener(&COMMAND_READY, 1_000_000).unwrap();
        let notifier = bus.notifier(&COMMAND_READY).unwrap();
        let longest_ns = 60_000_000_000;

        notifier.notify();
        take_from_socket(&listener);
        notifier.notify();
        assert!(listener.wait(longest_ns), "found without the socket");
        assert!(!listener.wait(0), "each is found once");
        notifier.notify();
        take_from_socket(&listener);
        assert!(listener.wait(longest_ns));
        notifier.notify();
        assert!(listener.wait(longest_ns), "the socket works again");

        drop((listener, notifier, bus));
        instance.vanish().unwrap();
    }
}
