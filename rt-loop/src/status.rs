//! The message that ends a cycle.

use shm_types::messages::{ABSENT, DriveMode, LoopStatus};

use crate::cycle::{CycleOutput, CycleState};
use crate::statistics::{Counters, CycleTimes};

/// How the loop stands, what it sent, how it kept its time.
pub fn loop_status(
    state: &CycleState,
    output: &CycleOutput,
    times: &CycleTimes,
    counters: &Counters,
) -> LoopStatus {
    let sent = &output.drive_command;
    LoopStatus {
        header: sent.header,
        state: state.state as u32,
        fault: state.fault.map_or(0, |fault| fault.code()),
        limited_joints: output.limited_joints,
        wakeup_lateness_ns: times.wakeup_lateness_ns,
        compute_ns: times.compute_ns,
        command_latency_ns: times.command_latency_ns,
        exchange_ns: times.exchange_ns,
        missed_deadlines: counters.missed_deadlines,
        skipped_periods: counters.skipped_periods,
        stale_commands: counters.stale_commands,
        refused_commands: counters.refused_commands(),
        // In velocity mode no torque was commanded, which is not the same as none.
        motor_torque_nm: if sent.mode == DriveMode::Velocity as u32 {
            ABSENT
        } else {
            sent.motor_torque_nm
        },
        drives: state.drives,
        bus: state.bus,
    }
}
