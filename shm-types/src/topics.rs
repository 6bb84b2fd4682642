//! The topics: who writes what for whom. Every topic has one writer; a second cannot join.

use std::marker::PhantomData;

use crate::messages::{
    Command, DriveCommand, DriveSample, Heartbeat, LastCycle, LoopStatus, OperatorRequest,
    PlantTruth, SensorSample, Supervision, TorqueEstimate,
};

/// A topic that carries messages of type `T`.
#[derive(Debug)]
pub struct Topic<T> {
    /// Service name within the instance.
    pub name: &'static str,
    /// How many readers it admits.
    pub readers_max: usize,
    /// How many messages a reader may leave unread before the oldest is dropped.
    pub buffer: usize,
    message: PhantomData<T>,
}

impl<T> Topic<T> {
    const fn new(name: &'static str, readers_max: usize, buffer: usize) -> Self {
        Self {
            name,
            readers_max,
            buffer,
            message: PhantomData,
        }
    }
}

/// A wake-up signal without content.
#[derive(Clone, Copy, Debug)]
pub struct Signal {
    /// Service name within the instance.
    pub name: &'static str,
}

/// Messages a relay may fall behind before it loses one: about 1.4 s at 1.5 kHz.
pub const RELAY_BUFFER: usize = 2048;
/// Cycles that the loop keeps for the case that it stops.
pub const LAST_CYCLES_KEPT: usize = 100;

/// Loop → drives.
pub const DRIVE_COMMAND: Topic<DriveCommand> = Topic::new("drive/command", 1, 16);
/// Drives → loop.
pub const DRIVE_SAMPLE: Topic<DriveSample> = Topic::new("drive/sample", 1, 16);
/// Loop → estimator, feedforward, relay.
pub const SENSOR_SAMPLE: Topic<SensorSample> = Topic::new("loop/sample", 3, RELAY_BUFFER);
/// Feedforward → loop, relay.
pub const COMMAND: Topic<Command> = Topic::new("feedforward/command", 2, RELAY_BUFFER);
/// Estimator → loop (which waits for it in lockstep), feedforward (which may correct with it), relay.
pub const TORQUE_ESTIMATE: Topic<TorqueEstimate> = Topic::new("estimator/torque", 3, RELAY_BUFFER);
/// Loop → relay.
pub const LOOP_STATUS: Topic<LoopStatus> = Topic::new("loop/status", 1, RELAY_BUFFER);
/// Emulator → relay.
pub const PLANT_TRUTH: Topic<PlantTruth> = Topic::new("plant/truth", 1, RELAY_BUFFER);
/// Relay → loop, which in lockstep waits for the recorder.
pub const RELAY_PROGRESS: Topic<Heartbeat> = Topic::new("relay/progress", 1, 4);
/// Operator → supervisor.
pub const OPERATOR_REQUEST: Topic<OperatorRequest> = Topic::new("operator/request", 1, 16);
/// Supervisor → loop.
pub const SUPERVISION: Topic<Supervision> = Topic::new("supervisor/orders", 1, 16);
/// Loop → supervisor, after a stop.
pub const LAST_CYCLES: Topic<LastCycle> = Topic::new("loop/last_cycles", 1, LAST_CYCLES_KEPT);

/// Relay → anybody: the loop's samples, once more.
pub const OBSERVED_SAMPLE: Topic<SensorSample> = Topic::new("observe/sample", 8, 64);
/// Relay → anybody: the loop's status, once more.
pub const OBSERVED_STATUS: Topic<LoopStatus> = Topic::new("observe/status", 8, 64);
/// Relay → anybody: the torque estimates, once more.
pub const OBSERVED_ESTIMATE: Topic<TorqueEstimate> = Topic::new("observe/estimate", 8, 64);

/// Drives have a new sample.
pub const DRIVE_SAMPLE_READY: Signal = Signal {
    name: "drive/sample/ready",
};
/// Loop has a command for the drives.
pub const DRIVE_COMMAND_READY: Signal = Signal {
    name: "drive/command/ready",
};
/// Loop has published a sample.
pub const SENSOR_SAMPLE_READY: Signal = Signal {
    name: "loop/sample/ready",
};
/// Feedforward has answered the loop.
pub const COMMAND_READY: Signal = Signal {
    name: "feedforward/command/ready",
};
/// Estimator has answered the loop; raised in lockstep only.
pub const TORQUE_ESTIMATE_READY: Signal = Signal {
    name: "estimator/torque/ready",
};

/// The processes of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Role {
    /// The control loop.
    Loop,
    /// The emulated robot.
    Emulator,
    /// Joint torque from sensors.
    Estimator,
    /// Control torque from model and feedback.
    Feedforward,
    /// Recorder and server of observers.
    Relay,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Loop,
        Self::Emulator,
        Self::Estimator,
        Self::Feedforward,
        Self::Relay,
    ];

    /// Its name on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Loop => "loop",
            Self::Emulator => "emulator",
            Self::Estimator => "estimator",
            Self::Feedforward => "feedforward",
            Self::Relay => "relay",
        }
    }

    /// The topic of its heartbeats, read by the supervisor.
    pub const fn heartbeat(self) -> Topic<Heartbeat> {
        Topic::new(
            match self {
                Self::Loop => "heartbeat/loop",
                Self::Emulator => "heartbeat/emulator",
                Self::Estimator => "heartbeat/estimator",
                Self::Feedforward => "heartbeat/feedforward",
                Self::Relay => "heartbeat/relay",
            },
            1,
            4,
        )
    }
}
