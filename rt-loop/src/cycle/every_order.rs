//! Every order in which things can happen, tried one by one: from each place that can be reached, everything that a cycle can bring.
//!
//! The joint stands still or runs away, and counts stop where nothing depends on them any more; then what the loop remembers is
//! finite ([`Place`]), and all of it can be visited. Orders with other motions are drawn at random beside this, in `tests`.

use std::collections::{HashSet, VecDeque};

use super::*;
use crate::driver::DriveFault;
use crate::limits::JointLimits;
use shm_types::JOINTS_MAX;
use shm_types::drive::DriveState;

/// What the drives' sample shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Shown {
    Missing,
    Still,
    Damping,
    Braked,
    SwitchPressed,
    RanAway,
    /// Drives that tell their state.
    Drive(DriveState),
}

/// What a cycle brings.
#[derive(Clone, Copy, Debug)]
struct Brought {
    /// Whether the command before was sent.
    sent: bool,
    shown: Shown,
    command: Option<DriveMode>,
    orders: Orders,
}

/// Where the loop stands, as far as anything depends on it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Place {
    state: u32,
    faulted_by: u32,
    missing: u64,
    moving: u64,
    /// None, some, the last allowed, too many.
    acknowledged: u32,
    mode: u32,
    /// Until samples must show what was sent.
    same_mode: u64,
    enabling: u64,
    resetting: u64,
    pressed: bool,
    ran_away: bool,
    /// The first sample has no step before it, and a second one after a runaway counts as a jump.
    seen: bool,
}

fn config() -> CycleConfig {
    let joint = JointLimits {
        gear_ratio: 50.0,
        motor_torque_nm: 2.0,
        motor_torque_rate_nm_s: 300.0,
        position_min_rad: -1.0,
        position_max_rad: 1.0,
        velocity_rad_s: 1.0,
        acceleration_rad_s2: 10.0,
        damping_nm_s_rad: 50.0,
        standstill_rad: 0.05,
        following_rad: 1.0,
    };
    CycleConfig {
        session: 9,
        period_ns: 666_667,
        joints: vec![joint],
        joint_names: vec!["elbow".to_owned()],
        hold_cycles: 2,
        damping_cycles: 2,
        waiting_cycles: 2,
        enabling_cycles: 6,
        reenabling_cycles: 4,
        reset_cycles: 3,
    }
}

fn place(config: &CycleConfig, state: &CycleState) -> Place {
    let motion = state.motions.motions()[0];
    Place {
        state: state.state as u32,
        faulted_by: state.fault.map_or(0, |fault| fault.code() & 0xff),
        missing: state
            .cycles_without_command
            .min(config.patience_cycles() + 1),
        moving: state.sending.moving_cycles().min(4),
        acknowledged: match state.acknowledgements {
            0 => 0,
            ACKNOWLEDGEMENTS_MAX => 2,
            count if count < ACKNOWLEDGEMENTS_MAX => 1,
            _ => 3,
        },
        mode: state.sending.mode as u32,
        same_mode: state.sending.same_mode_cycles().min(4),
        enabling: state.enabling_left,
        resetting: state.resetting_cycles,
        pressed: state.emergency_stop_pressed,
        ran_away: config.joints[0].has_run_away(motion),
        seen: state.motions != JointMotions::default(),
    }
}

fn everything() -> Vec<Brought> {
    let shown = [
        Shown::Missing,
        Shown::Still,
        Shown::Damping,
        Shown::Braked,
        Shown::SwitchPressed,
        Shown::RanAway,
        Shown::Drive(DriveState::NotReady),
        Shown::Drive(DriveState::SwitchedOff),
        Shown::Drive(DriveState::Enabled),
        Shown::Drive(DriveState::QuickStop),
        Shown::Drive(DriveState::Fault),
    ];
    let commands = [None, Some(DriveMode::Torque), Some(DriveMode::Velocity)];
    let orders = |bits: u32| Orders {
        emergency_stop: bits & 1 != 0,
        reset: bits & 2 != 0,
        supervisor_silent: bits & 4 != 0,
    };
    let mut all = Vec::new();
    for shown in shown {
        for command in commands {
            // A command answers a sample.
            if shown == Shown::Missing && command.is_some() {
                continue;
            }
            all.extend((0..16).map(|bits| Brought {
                sent: bits & 8 == 0,
                shown,
                command,
                orders: orders(bits),
            }));
        }
    }
    all
}

fn step(config: &CycleConfig, state: &mut CycleState, cycle: u64, brought: Brought) -> CycleOutput {
    let mut sample = DriveSample {
        header: Header {
            session: 9,
            cycle,
            measured_at_ns: 0,
            joint_count: 1,
        },
        mode: match brought.shown {
            Shown::Damping => DriveMode::Damping as u32,
            Shown::Braked | Shown::Drive(DriveState::SwitchedOff) => DriveMode::Braked as u32,
            _ => DriveMode::Torque as u32,
        },
        inputs: match brought.shown {
            Shown::SwitchPressed => EMERGENCY_STOP_PRESSED,
            _ => 0,
        },
        ..DriveSample::default()
    };
    if let Shown::Drive(state) = brought.shown {
        sample.drives.state[0] = state as u32;
    }
    sample.readings.motor_position_rad[0] = match brought.shown {
        Shown::RanAway => 50.0 * 1.2,
        _ => 0.0,
    };
    let command = brought.command.map(|mode| Command {
        mode: mode as u32,
        motor_torque_nm: [0.5; JOINTS_MAX],
        joint_velocity_rad_s: [0.1; JOINTS_MAX],
        ..Command::default()
    });
    let input = CycleInput {
        cycle,
        planned_ns: cycle * config.period_ns,
        sample: match brought.shown {
            Shown::Missing => Err(DriveFault::NoSample),
            _ => Ok(&sample),
        },
        command: command.as_ref(),
        orders: brought.orders,
    };
    state.written(match brought.sent {
        true => Ok(()),
        false => Err(DriveFault::NotSent),
    });
    state.step(config, &input)
}

/// What holds at every step, wherever it starts.
fn check(
    config: &CycleConfig,
    before: &CycleState,
    brought: Brought,
    after: &CycleState,
    output: &CycleOutput,
) {
    let told = format!("{:?}, {brought:?}: {:?}", before.state, after.state);
    let sent = output.drive_command.mode;
    let obeys = sent == DriveMode::Torque as u32 || sent == DriveMode::Velocity as u32;
    let fresh = brought.command.is_some() && brought.sent;
    let asked_to_stop = brought.orders.emergency_stop
        || brought.orders.supervisor_silent
        || brought.shown == Shown::SwitchPressed;
    match after.state {
        LoopState::Running => {
            assert!(fresh, "{told}: nothing to obey");
            let off = matches!(brought.shown, Shown::Drive(state)
                if !matches!(state, DriveState::Enabled | DriveState::QuickStop));
            assert!(!off, "{told}: the drives do not obey");
        }
        LoopState::Enabling => assert_eq!(
            output.drive_command.request,
            DriveRequest::Enable as u32,
            "{told}"
        ),
        LoopState::Holding => assert!(
            after.cycles_without_command <= config.hold_cycles,
            "{told}: held for too long"
        ),
        LoopState::Damping => assert_ne!(sent, DriveMode::Velocity as u32, "{told}"),
        _ => assert_eq!(sent, DriveMode::Braked as u32, "{told}"),
    }
    if !obeys {
        assert_eq!(output.drive_command.motor_torque_nm, [0.0; JOINTS_MAX]);
        assert_eq!(output.drive_command.joint_velocity_rad_s, [0.0; JOINTS_MAX]);
    }
    if before.sending.must_show_motion() && brought.shown == Shown::Braked && fresh {
        assert!(after.state.is_latched(), "{told}: the drives are off");
    }
    if brought.shown == Shown::Drive(DriveState::Fault) {
        assert!(after.state.is_latched(), "{told}: a drive is faulted");
    }
    if asked_to_stop {
        assert!(after.state.is_latched(), "{told}: asked to stop");
        assert_eq!(sent, DriveMode::Braked as u32, "{told}");
    }
    if before.state == LoopState::Faulted {
        assert_eq!(after.state, LoopState::Faulted, "{told}: left");
    }
    if before.state == LoopState::SafeStop && after.state != LoopState::SafeStop {
        assert_eq!(after.state, LoopState::Ready, "{told}");
        let asked = brought.orders.reset || before.resetting_cycles > 0;
        let faulted = brought.shown == Shown::Drive(DriveState::Fault);
        assert!(
            asked && !faulted && brought.shown != Shown::Missing,
            "{told}"
        );
    }
    if after.state == LoopState::Running && before.state != LoopState::Running {
        assert!(before.state != LoopState::SafeStop, "{told}: not reset");
    }
    if after.cycles_without_command > config.patience_cycles() {
        assert!(
            after.state.is_latched() || !after.state.has_begun(),
            "{told}"
        );
    }
}

#[test]
fn every_order_of_events_keeps_the_joints_safe() {
    let config = config();
    let everything = everything();
    let mut seen = HashSet::new();
    let mut ahead = VecDeque::from([(CycleState::default(), 0_u64)]);
    seen.insert(place(&config, &CycleState::default()));
    let mut steps = 0;
    while let Some((state, cycle)) = ahead.pop_front() {
        for &brought in &everything {
            let mut after = state.clone();
            let output = step(&config, &mut after, cycle + 1, brought);
            check(&config, &state, brought, &after, &output);
            steps += 1;
            // Between the first acknowledgement and the last allowed nothing changes: the last is tried with the first.
            let mut last = after.clone();
            if (1..ACKNOWLEDGEMENTS_MAX).contains(&after.acknowledgements) {
                last.acknowledgements = ACKNOWLEDGEMENTS_MAX;
            }
            for next in [after, last] {
                if seen.insert(place(&config, &next)) {
                    ahead.push_back((next, cycle + 1));
                }
            }
        }
    }
    let states: HashSet<u32> = seen.iter().map(|place| place.state).collect();
    assert_eq!(
        states.len(),
        LoopState::ALL.len(),
        "every state was visited"
    );
    assert!(seen.len() > 300 && steps > 20_000, "{} places", seen.len());
}
