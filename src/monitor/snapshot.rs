//! How a run stands at one instant: what the screen shows and `--json` writes.

use rt_loop::report::Quantiles;
use serde::Serialize;
use shm_types::drive::DriveState;
use shm_types::instance::Mode;

/// Everything shown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Snapshot {
    /// Name of the instance.
    pub instance: String,
    /// The robot's name.
    pub robot: String,
    /// Driver that talks to the hardware.
    pub driver: String,
    /// Name or file of the trajectory.
    pub trajectory: String,
    /// How time passes.
    pub mode: Mode,
    /// Whether anything has been heard of the loop yet.
    pub heard: bool,
    /// The loop's state, by name.
    pub state: String,
    /// Why the loop left `Running` last, if it ever did.
    pub fault: Option<String>,
    /// The newest cycle.
    pub cycle: u64,
    /// Its time since the start.
    pub time_s: f64,
    /// Rate asked for.
    pub asked_rate_hz: f64,
    /// Cycles a second that were run: by their planned instants, in lockstep by the wall clock.
    pub rate_hz: Option<f64>,
    /// Times of the cycles heard; empty in lockstep, which has none.
    pub times: LoopTimes,
    /// How late the loop woke up, counted in powers of two.
    pub lateness_buckets: Vec<Bucket>,
    /// Cycles that did not reach the monitor.
    pub lost_cycles: u64,
    /// The loop's counters since its start.
    pub counters: LoopCounters,
    /// Joints in the robot's order.
    pub joints: Vec<JointLine>,
    /// Processes of the instance.
    pub processes: Vec<ProcessLine>,
}

/// Times of the cycles heard since the monitor joined or was cleared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LoopTimes {
    /// Late by this much against the planned instant.
    pub late_at_wakeup: Quantiles,
    /// The loop's own work.
    pub own_compute: Quantiles,
    /// From publishing a sample to holding its command.
    pub sample_to_command: Quantiles,
    /// Reading from and writing to the drives.
    pub exchange_with_drives: Quantiles,
}

/// Cycles that woke up late by at most so much, and by more than the bucket before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Bucket {
    /// Upper end; the last bucket has none.
    pub up_to_us: u64,
    /// How many.
    pub count: u64,
}

/// Counters of the loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LoopCounters {
    /// Periods whose command was late, whose work ended late, or that were skipped.
    pub missed_deadlines: u64,
    /// Periods that were skipped.
    pub skipped_periods: u64,
    /// Cycles without a fresh command.
    pub stale_commands: u64,
    /// Commands that were refused.
    pub refused_commands: u64,
}

/// One joint; what the robot has no signal for is none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointLine {
    /// Its name.
    pub joint: String,
    /// Of the link's encoder, or else of the motor's divided by the gear ratio.
    pub link_position_rad: Option<f64>,
    /// Measured, or else from positions 20 ms apart.
    pub link_velocity_rad_s: Option<f64>,
    /// Measured, before the gear.
    pub motor_torque_nm: Option<f64>,
    /// Sent to the drive, before the gear.
    pub commanded_motor_torque_nm: Option<f64>,
    /// Of a torque sensor, after the gear.
    pub joint_torque_nm: Option<f64>,
    /// Of the torque estimators, after the gear.
    pub estimates: JointEstimates,
    /// Whether a limit changed its command a moment ago.
    pub limited: bool,
    /// From the robot file.
    pub position_limit_rad: Option<[f64; 2]>,
    /// From the robot file.
    pub velocity_limit_rad_s: Option<f64>,
    /// From the robot file, before the gear.
    pub motor_torque_limit_nm: Option<f64>,
    /// What the drive tells of itself, if it does.
    pub drive: Option<DriveLine>,
}

/// One joint's drive.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DriveLine {
    /// Its state, by name.
    pub state: &'static str,
    /// Its own status word.
    pub status_word: u32,
    /// Its own fault number; 0 is none.
    pub error_code: u32,
    /// Cycles since its readings were latched.
    pub age_cycles: u32,
    /// Bits of `shm_types::drive::warning`.
    pub warnings: u32,
    /// Of its supply, where it is measured.
    pub supply_voltage_v: Option<f64>,
}

impl DriveLine {
    /// What somebody who looks has to know first, in seven letters; nothing where all is well.
    pub fn words(&self) -> String {
        let named = |state: DriveState| self.state == state.name();
        match (self.error_code, self.age_cycles) {
            (0, 0) if named(DriveState::Enabled) => String::new(),
            (0, 0) if named(DriveState::NotReady) => "starts".to_owned(),
            (0, 0) if named(DriveState::SwitchedOff) => "off".to_owned(),
            (0, 0) if named(DriveState::Enabling) => "enables".to_owned(),
            (0, 0) if named(DriveState::QuickStop) => "stopped".to_owned(),
            (0, 0) => "fault".to_owned(),
            (0, age) => format!("old {age}"),
            (code, _) => format!("{code:#06x}"),
        }
    }
}

/// Torque of one joint without a torque sensor, after the gear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct JointEstimates {
    /// Motor torque minus modelled friction.
    pub residual_torque_nm: Option<f64>,
    /// From the rate of torsion.
    pub structural_damping_torque_nm: Option<f64>,
    /// From torsion and motor momentum.
    pub fusion_torque_nm: Option<f64>,
    /// One standard deviation of the same.
    pub fusion_std_nm: Option<f64>,
}

/// One process of the instance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ProcessLine {
    /// What it is.
    pub role: String,
    /// Its process id.
    pub process_id: u32,
    /// Since it was started.
    pub age_s: f64,
    /// How often its role was started again.
    pub restarts: u64,
    /// How its predecessor ended.
    pub last_end: Option<String>,
}

/// Words for the loop's fault code: its kind in the low byte, the joint in the next, a drive's own error above that. 0 is none.
pub fn fault_words(code: u32, joint_names: &[&str]) -> Option<String> {
    let words = match code & 0xff {
        0 => return None,
        1 => "no fresh command",
        2 => "no sample from the drives",
        3 => "old sample from the drives",
        4 => "sample of another run",
        5 => "motor position was no number",
        6 => "drives refused their mode",
        7 => "command could not be sent",
        8 => "ran away",
        9 => "drives had stopped by themselves",
        10 => "motor position jumped",
        11 => "encoder stood still",
        12 => "emergency stop",
        13 => "supervisor silent",
        14 => "far from its reference",
        15 => "bus counted too few answers",
        16 => "device left the exchange",
        17 => "nothing came from its drive",
        18 => "drive is faulted",
        19 => "drive is off although it should obey",
        20 => "drive was not enabled in time",
        21 => "bus is off",
        22 => "link to the drives is lost",
        23 => "drives were off although they should obey",
        kind => return Some(format!("fault {kind}")),
    };
    let joint = joint_names.get((code >> 8 & 0xff) as usize);
    Some(match (code & 0xff, joint) {
        (18, Some(joint)) => format!("{joint}: {words}, error {:#06x}", code >> 16),
        (5 | 8 | 10 | 11 | 14 | 16 | 17 | 19 | 20, Some(joint)) => format!("{joint}: {words}"),
        _ => words.to_owned(),
    })
}
