//! What a fault came to.

use serde::Serialize;
use shm_types::messages::{DriveMode, LoopState, PerJoint};
use virtual_drives::Kind;

use crate::scenarios::{AtSetUp, Scenario};

/// The account of one scenario.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Outcome {
    /// Every state after `Running`, with the cycles it lasted.
    pub states: Vec<(String, u64)>,
    /// The state at the end.
    pub end_state: String,
    /// Why the loop last left `Running`, if it did.
    pub fault: Option<String>,
    /// Cycles from the fault's begin to the loop's first cycle outside `Running`; none if it stayed there.
    pub reacted_after_cycles: Option<u64>,
    /// Cycles from the fault's begin to the first with closed brakes, if they closed.
    pub braked_after_cycles: Option<u64>,
    /// Largest torque sent, in parts of the joint's limit.
    pub torque_max: f64,
    /// Largest change of torque from one cycle to the next while joints moved, in parts of the joint's limit.
    pub torque_step_max: f64,
    /// Furthest a joint was from its reference, as the plant truly stood, joint side.
    pub excursion_rad: f64,
    /// Longest stretch of cycles in which a drive followed a torque although the loop asked for brakes and nothing else.
    pub unasked_torque_cycles: u64,
    /// Cycles without a usable sample.
    pub samples_lost: u64,
    /// Cycles without a usable command.
    pub commands_lost: u64,
    /// Commands that came and were refused.
    pub commands_refused: u64,
}

/// Cycles from asking for brakes to when every drive has let go of its torque: until the command acts, and one for the plant.
const LET_GO_CYCLES: u64 = 3;
/// Cycles of 1.5 kHz after which drives stop that no command reaches: each kind's watchdog, as it is set and read back.
fn watchdog_cycles(kind: Kind) -> u64 {
    match kind {
        Kind::Emulator => 15,
        Kind::Ethercat => 30,
        Kind::Moteus => 150,
    }
}

impl Outcome {
    /// Whether a scenario ended as documented, and no drive followed a torque that nobody asked for, for longer than it
    /// takes to hear of that, or its watchdog.
    pub fn is_as_documented(&self, scenario: &Scenario, kind: Kind) -> bool {
        let documented = scenario.end_state_on(kind);
        let is = |state: LoopState| self.end_state == format!("{state:?}");
        // moteus has no brakes: a joint under a load sinks in `Damping`, and out of its range it is broken.
        let sank = kind == Kind::Moteus && documented == LoopState::SafeStop;
        (is(documented) || sank && is(LoopState::Faulted))
            && self.unasked_torque_cycles <= watchdog_cycles(kind) + LET_GO_CYCLES
    }
}

/// What one cycle adds to the account.
#[derive(Clone, Copy, Debug)]
pub struct Observed<'a> {
    /// The cycle.
    pub cycle: u64,
    /// The state it ended in.
    pub state: LoopState,
    /// What the drives were asked to do.
    pub mode: DriveMode,
    /// What they were sent, motor side.
    pub torque_nm: &'a PerJoint,
    /// Where the joints truly are.
    pub link_position_rad: &'a PerJoint,
    /// Where they should be, as far as last known.
    pub reference_rad: &'a PerJoint,
    /// Whether any drive truly follows a torque.
    pub is_driven: bool,
    /// Whether the loop asked for anything but brakes.
    pub may_move: bool,
}

/// Sums up a scenario.
#[derive(Clone, Debug)]
pub struct Account {
    outcome: Outcome,
    begin: u64,
    torque_limits_nm: Vec<f64>,
    before: Option<(DriveMode, PerJoint)>,
    last: LoopState,
    /// Cycles in a row in which a drive followed a torque unasked.
    unasked_cycles: u64,
    /// The newest cycle outside `Running`.
    last_left: u64,
}

impl Account {
    /// For a fault that begins in the cycle `begin`.
    pub fn new(begin: u64, torque_limits_nm: Vec<f64>) -> Self {
        Self {
            outcome: Outcome::default(),
            begin,
            torque_limits_nm,
            before: None,
            last: LoopState::Initialising,
            unasked_cycles: 0,
            last_left: 0,
        }
    }

    /// See [`Outcome::unasked_torque_cycles`].
    pub fn unasked_torque_cycles(&self) -> u64 {
        self.outcome.unasked_torque_cycles
    }

    /// The newest cycle that did not end in `Running`.
    pub fn last_left(&self) -> u64 {
        self.last_left
    }

    /// Adds one cycle.
    pub fn add(&mut self, observed: &Observed<'_>) {
        let moving = observed.mode == DriveMode::Torque;
        if observed.cycle >= self.begin {
            self.add_state(observed);
            for (joint, limit_nm) in self.torque_limits_nm.iter().enumerate() {
                let torque_nm = observed.torque_nm[joint];
                let outcome = &mut self.outcome;
                outcome.torque_max = outcome.torque_max.max(torque_nm.abs() / limit_nm);
                if let Some((DriveMode::Torque, before_nm)) = &self.before
                    && moving
                {
                    let step = (torque_nm - before_nm[joint]).abs() / limit_nm;
                    outcome.torque_step_max = outcome.torque_step_max.max(step);
                }
                let away_rad = observed.link_position_rad[joint] - observed.reference_rad[joint];
                outcome.excursion_rad = outcome.excursion_rad.max(away_rad.abs());
            }
        }
        self.add_unasked(observed);
        if observed.state != LoopState::Running {
            self.last_left = observed.cycle;
        }
        self.before = Some((observed.mode, *observed.torque_nm));
        self.last = observed.state;
    }

    fn add_unasked(&mut self, observed: &Observed<'_>) {
        self.unasked_cycles = match observed.is_driven && !observed.may_move {
            true => self.unasked_cycles + 1,
            false => 0,
        };
        let longest = &mut self.outcome.unasked_torque_cycles;
        *longest = (*longest).max(self.unasked_cycles);
    }

    fn add_state(&mut self, observed: &Observed<'_>) {
        let outcome = &mut self.outcome;
        let since = observed.cycle - self.begin;
        if observed.state != LoopState::Running {
            outcome.reacted_after_cycles.get_or_insert(since);
        }
        if observed.state.is_latched() {
            outcome.braked_after_cycles.get_or_insert(since);
        }
        let name = format!("{:?}", observed.state);
        match outcome.states.last_mut() {
            Some((last, cycles)) if *last == name => *cycles += 1,
            None if observed.state == LoopState::Running => (),
            _ => outcome.states.push((name, 1)),
        }
    }

    /// The whole account.
    pub fn finish(mut self, fault: Option<String>) -> Outcome {
        self.outcome.end_state = format!("{:?}", self.last);
        self.outcome.fault = fault;
        self.outcome
    }

    /// What was lost in a cycle.
    pub fn lose(&mut self, sample: bool, command: bool, refused: u64) {
        self.outcome.samples_lost += u64::from(sample);
        self.outcome.commands_lost += u64::from(command);
        self.outcome.commands_refused += refused;
    }
}

/// What came of drives that were looked for while something was broken.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetUp {
    /// The driver's line; `None` where it opened them.
    pub refused: Option<String>,
}

impl SetUp {
    /// Whether it is what the fault's documentation says, in one line.
    pub fn is_as_documented(&self, broken: &AtSetUp) -> bool {
        match (&self.refused, broken.refused) {
            (Some(told), Some(part)) => told.contains(part) && told.lines().count() == 1,
            (None, None) => true,
            _ => false,
        }
    }
}
