//! What the monitor knows of a run: messages in, one snapshot out. No clock, no terminal.

use hdrhistogram::Histogram;
use robot::Robot;
use rt_loop::report::Quantiles;
use shm_types::JOINTS_MAX;
use shm_types::drive::DriveState;
use shm_types::instance::{Mode, RunConfig};
use shm_types::messages::{LoopState, LoopStatus, PerJoint, SensorSample, TorqueEstimate};
use shm_types::roster::Member;

use super::snapshot::{
    Bucket, DriveLine, JointEstimates, JointLine, LoopCounters, LoopTimes, ProcessLine, Snapshot,
    fault_words,
};

/// A velocity that no sensor gives is the way of this many cycles divided by their time: 20 ms at 1.5 kHz.
const VELOCITY_CYCLES: u64 = 30;
/// The rate is counted over this long.
const RATE_NS: u64 = 1_000_000_000;
/// A limit stays marked for this many cycles, to be seen: half a second at 1.5 kHz.
const LIMITED_SHOWN_CYCLES: u64 = 750;

/// Everything heard since the monitor joined.
#[derive(Debug)]
pub struct View {
    instance: String,
    run: RunConfig,
    robot: Robot,
    status: Option<LoopStatus>,
    sample: Option<SensorSample>,
    estimate: Option<TorqueEstimate>,
    /// Positions a while ago, to tell velocities from.
    earlier: Option<(u64, PerJoint)>,
    link_velocity_rad_s: PerJoint,
    limited_cycle: [Option<u64>; JOINTS_MAX],
    times: Times,
    rate: Rate,
    lost_cycles: u64,
    members: Vec<Member>,
}

impl View {
    /// Of a run of this robot, before the first message.
    pub fn new(instance: &str, run: RunConfig, robot: Robot) -> Self {
        Self {
            instance: instance.to_owned(),
            run,
            robot,
            status: None,
            sample: None,
            estimate: None,
            earlier: None,
            link_velocity_rad_s: [f64::NAN; JOINTS_MAX],
            limited_cycle: [None; JOINTS_MAX],
            times: Times::default(),
            rate: Rate::default(),
            lost_cycles: 0,
            members: Vec::new(),
        }
    }

    fn is_of_this_run(&self, header: &shm_types::messages::Header) -> bool {
        header
            .check(self.run.session, self.robot.joints.len())
            .is_ok()
    }

    /// Takes the end of a cycle, heard at `now_ns`.
    pub fn add_status(&mut self, status: &LoopStatus, now_ns: u64) {
        if !self.is_of_this_run(&status.header) {
            return;
        }
        if let Some(before) = &self.status {
            let cycles_run =
                |status: &LoopStatus| status.header.cycle.saturating_sub(status.skipped_periods);
            self.lost_cycles +=
                (cycles_run(status).saturating_sub(cycles_run(before))).saturating_sub(1);
        }
        if self.run.mode == Mode::Realtime {
            self.times.record(status);
        }
        let at_ns = match self.run.mode {
            Mode::Realtime => status.header.measured_at_ns,
            // Its own time is virtual.
            Mode::Lockstep => now_ns,
        };
        self.rate.record(status, at_ns);
        for (joint, cycle) in self.limited_cycle.iter_mut().enumerate() {
            if status.limited_joints & (1 << joint) != 0 {
                *cycle = Some(status.header.cycle);
            }
        }
        self.status = Some(*status);
    }

    /// Takes a measurement.
    pub fn add_sample(&mut self, sample: &SensorSample) {
        if !self.is_of_this_run(&sample.header) {
            return;
        }
        let position_rad = self.joint_positions_rad(sample);
        let cycle = sample.header.cycle;
        match self.earlier {
            Some((before, from_rad)) if cycle >= before.saturating_add(VELOCITY_CYCLES) => {
                let elapsed_s = (cycle - before) as f64 * self.run.period_ns as f64 * 1e-9;
                self.link_velocity_rad_s = std::array::from_fn(|joint| {
                    (position_rad[joint] - from_rad[joint]) / elapsed_s
                });
                self.earlier = Some((cycle, position_rad));
            }
            Some((before, _)) if cycle > before => (),
            _ => self.earlier = Some((cycle, position_rad)),
        }
        self.sample = Some(*sample);
    }

    /// Takes an estimate.
    pub fn add_estimate(&mut self, estimate: &TorqueEstimate) {
        if self.is_of_this_run(&estimate.header) {
            self.estimate = Some(*estimate);
        }
    }

    /// Takes the list of processes.
    pub fn set_members(&mut self, members: Vec<Member>) {
        self.members = members;
    }

    /// Counts times anew.
    pub fn clear(&mut self) {
        self.times = Times::default();
        self.lost_cycles = 0;
    }

    /// Joint side: of the link's encoder where there is one, of the motor's otherwise.
    fn joint_positions_rad(&self, sample: &SensorSample) -> PerJoint {
        let readings = &sample.readings;
        let mut position_rad = [f64::NAN; JOINTS_MAX];
        for (joint, facts) in self.robot.joints.iter().enumerate() {
            position_rad[joint] = present(readings.link_position_rad[joint])
                .unwrap_or(readings.motor_position_rad[joint] / facts.gear_ratio);
        }
        position_rad
    }

    /// How things stand at `now_ns`.
    pub fn snapshot(&self, now_ns: u64) -> Snapshot {
        let status = self.status.unwrap_or_default();
        Snapshot {
            instance: self.instance.clone(),
            robot: self.robot.name.clone(),
            driver: self.run.driver.clone(),
            trajectory: self.run.trajectory.clone(),
            mode: self.run.mode,
            heard: self.status.is_some(),
            state: LoopState::from_raw(status.state)
                .map_or("?".to_owned(), |state| format!("{state:?}")),
            fault: fault_words(status.fault, &self.robot.joint_names()),
            cycle: status.header.cycle,
            time_s: status.header.cycle as f64 * self.run.period_ns as f64 * 1e-9,
            asked_rate_hz: 1e9 / self.run.period_ns as f64,
            rate_hz: self.rate.rate_hz(),
            times: self.times.quantiles(),
            lateness_buckets: self.times.lateness_buckets(),
            lost_cycles: self.lost_cycles,
            counters: LoopCounters {
                missed_deadlines: status.missed_deadlines,
                skipped_periods: status.skipped_periods,
                stale_commands: status.stale_commands,
                refused_commands: status.refused_commands,
            },
            joints: (0..self.robot.joints.len())
                .map(|joint| self.joint_line(joint))
                .collect(),
            processes: self
                .members
                .iter()
                .map(|member| process_line(member, now_ns))
                .collect(),
        }
    }

    fn joint_line(&self, joint: usize) -> JointLine {
        let facts = &self.robot.joints[joint];
        let sample = self.sample.as_ref();
        let reading = |of: fn(&SensorSample) -> &PerJoint| {
            sample.and_then(|sample| present(of(sample)[joint]))
        };
        let estimated = |of: fn(&TorqueEstimate) -> &PerJoint| {
            self.estimate
                .as_ref()
                .and_then(|estimate| present(of(estimate)[joint]))
        };
        let cycle = self.status.map_or(0, |status| status.header.cycle);
        JointLine {
            joint: facts.name.clone(),
            link_position_rad: sample
                .and_then(|sample| present(self.joint_positions_rad(sample)[joint])),
            link_velocity_rad_s: reading(|sample| &sample.readings.link_velocity_rad_s)
                .or(present(self.link_velocity_rad_s[joint])),
            motor_torque_nm: reading(|sample| &sample.readings.motor_torque_nm),
            commanded_motor_torque_nm: self
                .status
                .and_then(|status| present(status.motor_torque_nm[joint])),
            joint_torque_nm: reading(|sample| &sample.readings.joint_torque_nm),
            estimates: JointEstimates {
                residual_torque_nm: estimated(|estimate| &estimate.residual.torque_nm),
                structural_damping_torque_nm: estimated(|estimate| {
                    &estimate.structural_damping.torque_nm
                }),
                fusion_torque_nm: estimated(|estimate| &estimate.fusion.torque_nm),
                fusion_std_nm: estimated(|estimate| &estimate.fusion.std_nm),
            },
            limited: self.limited_cycle[joint]
                .is_some_and(|at| cycle <= at.saturating_add(LIMITED_SHOWN_CYCLES)),
            position_limit_rad: facts.position_limit_rad,
            velocity_limit_rad_s: facts.velocity_limit_rad_s,
            motor_torque_limit_nm: facts.torque_limit_nm,
            drive: self.status.and_then(|status| drive_line(&status, joint)),
        }
    }
}

/// `None` where the driver tells nothing of its drives.
fn drive_line(status: &LoopStatus, joint: usize) -> Option<DriveLine> {
    let drives = &status.drives;
    let state = drives.state_of(joint);
    (state != DriveState::Unknown).then(|| DriveLine {
        state: state.name(),
        status_word: drives.status_word[joint],
        error_code: drives.error_code[joint],
        age_cycles: drives.age_cycles[joint],
        warnings: drives.warnings[joint],
        supply_voltage_v: present(drives.supply_voltage_v[joint]).filter(|&volts| volts > 0.0),
    })
}

fn present(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn process_line(member: &Member, now_ns: u64) -> ProcessLine {
    ProcessLine {
        role: member.role.clone(),
        process_id: member.process_id,
        age_s: now_ns.saturating_sub(member.started_at_ns) as f64 * 1e-9,
        restarts: member.restarts,
        last_end: member.last_end.clone(),
    }
}

/// Times of the cycles heard.
#[derive(Debug)]
struct Times {
    wakeup_lateness_ns: Histogram<u64>,
    compute_ns: Histogram<u64>,
    command_latency_ns: Histogram<u64>,
    exchange_ns: Histogram<u64>,
}

impl Default for Times {
    fn default() -> Self {
        // As the loop's own: 1 ns to 10 s, three digits.
        let histogram = || {
            Histogram::new_with_bounds(1, 10_000_000_000, 3)
                .expect("the bounds are constants in range")
        };
        Self {
            wakeup_lateness_ns: histogram(),
            compute_ns: histogram(),
            command_latency_ns: histogram(),
            exchange_ns: histogram(),
        }
    }
}

impl Times {
    fn record(&mut self, status: &LoopStatus) {
        self.wakeup_lateness_ns
            .saturating_record(status.wakeup_lateness_ns.max(1));
        self.compute_ns.saturating_record(status.compute_ns.max(1));
        self.exchange_ns
            .saturating_record(status.exchange_ns.max(1));
        if status.command_latency_ns > 0 {
            self.command_latency_ns
                .saturating_record(status.command_latency_ns);
        }
    }

    fn quantiles(&self) -> LoopTimes {
        LoopTimes {
            late_at_wakeup: Quantiles::of(&self.wakeup_lateness_ns),
            own_compute: Quantiles::of(&self.compute_ns),
            sample_to_command: Quantiles::of(&self.command_latency_ns),
            exchange_with_drives: Quantiles::of(&self.exchange_ns),
        }
    }

    /// Counts between 1, 2, 4 … µs.
    fn lateness_buckets(&self) -> Vec<Bucket> {
        let mut below = 0;
        (0..BUCKETS)
            .map(|power| {
                let up_to_us = 1_u64 << power;
                let up_to = match power + 1 == BUCKETS {
                    true => self.wakeup_lateness_ns.len(),
                    false => self.wakeup_lateness_ns.count_between(0, up_to_us * 1000),
                };
                let count = up_to - below;
                below = up_to;
                Bucket { up_to_us, count }
            })
            .collect()
    }
}

/// Buckets of lateness: up to 1, 2, 4 … 4096 µs; the last holds everything above too.
const BUCKETS: u32 = 13;

/// Cycles a second that the loop ran.
#[derive(Debug, Default)]
struct Rate {
    since: Option<(u64, u64)>,
    newest: Option<(u64, u64)>,
    rate_hz: Option<f64>,
}

impl Rate {
    fn record(&mut self, status: &LoopStatus, now_ns: u64) {
        let cycles_run = status.header.cycle.saturating_sub(status.skipped_periods);
        self.newest = Some((cycles_run, now_ns));
        let Some((before, since_ns)) = self.since else {
            self.since = self.newest;
            return;
        };
        if now_ns >= since_ns.saturating_add(RATE_NS) {
            self.rate_hz = Some(rate(cycles_run - before.min(cycles_run), now_ns - since_ns));
            self.since = self.newest;
        }
    }

    /// Over the last whole second, or over what there is of the first.
    fn rate_hz(&self) -> Option<f64> {
        let ((before, since_ns), (cycles_run, now_ns)) = (self.since?, self.newest?);
        let first = || {
            (now_ns > since_ns)
                .then(|| rate(cycles_run - before.min(cycles_run), now_ns - since_ns))
        };
        self.rate_hz.or_else(first)
    }
}

fn rate(cycles: u64, elapsed_ns: u64) -> f64 {
    cycles as f64 * 1e9 / elapsed_ns as f64
}

#[cfg(test)]
#[path = "view_tests.rs"]
mod tests;
