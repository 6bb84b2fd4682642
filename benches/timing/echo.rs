//! The bare exchange: two processes and the middleware, nothing else. One sends a message as large as the loop's sample, the other
//! answers with one as large as a command. Once a period, pinned and scheduled as loop and feedforward are.

use std::fmt::Debug;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use realtime::clock::{monotonic_ns, sleep_until};
use realtime::grant::{Request, apply};
use realtime::process::user_id;
use rt_loop::process::treatment;
use shm_types::instance::{Instance, Wait};
use shm_types::messages::{Command as Answer, SensorSample};

use crate::histograms::{Times, empty};

/// Told to a copy of this program that answers.
pub const FLAG: &str = "--echo";
/// As the feedforward process has it.
const ANSWERER_PRIORITY: u8 = 75;
const PERIOD_NS: u64 = 666_667;
/// The other process needs so long to join.
const START: Duration = Duration::from_millis(700);

/// One end: sends `Out`, hears `In`.
struct End<Out: Debug + ZeroCopySend + 'static, In: Debug + ZeroCopySend + 'static> {
    publisher: Publisher<ipc::Service, Out, ()>,
    subscriber: Subscriber<ipc::Service, In, ()>,
    notifier: Notifier<ipc::Service>,
    listener: Listener<ipc::Service>,
    wait: Wait,
    _node: Node<ipc::Service>,
}

impl<Out, In> End<Out, In>
where
    Out: Copy + Debug + ZeroCopySend + 'static,
    In: Copy + Debug + ZeroCopySend + 'static,
{
    fn open(instance: &Instance, out: &str, into: &str, wait: Wait) -> Self {
        let config = instance.ipc_config().expect("a good name");
        set_log_level(LogLevel::Error);
        let node = NodeBuilder::new()
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .expect("a node");
        let name = |name: &str| ServiceName::new(name).expect("a good name");
        let sent = node
            .service_builder(&name(out))
            .publish_subscribe::<Out>()
            .open_or_create()
            .expect("a service");
        let heard = node
            .service_builder(&name(into))
            .publish_subscribe::<In>()
            .open_or_create()
            .expect("a service");
        let event = |of: &str| {
            node.service_builder(&name(&format!("{of}/ready")))
                .event()
                .open_or_create()
                .expect("a service")
        };
        Self {
            publisher: sent.publisher_builder().create().expect("a publisher"),
            subscriber: heard.subscriber_builder().create().expect("a subscriber"),
            notifier: event(out).notifier_builder().create().expect("a notifier"),
            listener: event(into).listener_builder().create().expect("a listener"),
            wait,
            _node: node,
        }
    }

    fn send(&self, message: Out) {
        let loaned = self.publisher.loan_uninit().expect("a loan");
        let _ = loaned.write_payload(message).send();
        if self.wait == Wait::Block {
            let _ = self.notifier.notify();
        }
    }

    fn hear(&self) -> In {
        loop {
            if let Ok(Some(message)) = self.subscriber.receive() {
                return *message.payload();
            }
            match self.wait {
                Wait::Block => {
                    let _ = self.listener.blocking_wait(|_| ());
                }
                Wait::Spin => std::hint::spin_loop(),
            }
        }
    }
}

/// The answering process, until it is killed.
pub fn answer(name: &str, wait: &str) {
    let instance = Instance::new(name, user_id()).expect("a good name");
    let wait = match wait {
        "spin" => Wait::Spin,
        _ => Wait::Block,
    };
    let run = instance.run_config().expect("written by the one who asks");
    let end: End<Answer, SensorSample> = End::open(&instance, "answer", "question", wait);
    let (_grant, _held) = apply(&Request {
        fifo_priority: Some(ANSWERER_PRIORITY),
        core: run.core_of(shm_types::topics::Role::Feedforward),
        lock_memory: true,
        hold_dma_latency: false,
    });
    loop {
        let asked = end.hear();
        end.send(Answer {
            header: asked.header,
            ..Answer::default()
        });
    }
}

/// Asks once a period and takes the time to each answer. The instance's directory is there; its run says how to wait and where.
pub fn ask(instance: &Instance, seconds: u64) -> Times {
    let run = instance.run_config().expect("written before");
    let wait = match run.wait {
        Wait::Spin => "spin",
        Wait::Block => "block",
    };
    let mut answerer = start(&[FLAG, instance.name(), wait]);
    let end: End<SensorSample, Answer> = End::open(instance, "question", "answer", run.wait);
    std::thread::sleep(START);
    let (_grant, _held) = apply(&treatment(run.core_of(shm_types::topics::Role::Loop)));
    let mut times = empty();
    let begun_ns = monotonic_ns();
    for cycle in 0..seconds * 1_000_000_000 / PERIOD_NS {
        sleep_until(begun_ns + cycle * PERIOD_NS);
        let asked_ns = monotonic_ns();
        let mut sample = SensorSample::default();
        sample.header.cycle = cycle;
        end.send(sample);
        while end.hear().header.cycle != cycle {}
        times.saturating_record((monotonic_ns() - asked_ns).max(1));
    }
    answerer.kill().expect("our own process");
    answerer.wait().expect("our own process");
    times
}

fn start(arguments: &[&str]) -> Child {
    Command::new(std::env::current_exe().expect("this program"))
        .args(arguments)
        .stdin(Stdio::null())
        .spawn()
        .expect("this program starts")
}
