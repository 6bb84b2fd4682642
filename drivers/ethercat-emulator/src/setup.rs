//! From a robot to the slaves that drive it.

use core::f64::consts::TAU;

use plant_emulator::{Plant, PlantError, PlantParameters};
use robot::{Injection, Robot, RobotJoint};

use crate::axis::AxisConfig;
use crate::fault::{Fault, TimedFault};
use crate::segment::Segment;
use crate::slave::{AXES_MAX, Slave, SlaveConfig};

/// Vendor of the virtual drives: none of ETG's members, whose numbers are small or have a member's bits.
pub const VENDOR: u32 = 0x0f1e_7890;
/// Product code; the number of axes is added to it.
pub const PRODUCT: u32 = 0x4020_0000;
/// Counts a turn where the robot file names no motor encoder: 17 bits, common in servo drives.
const COUNTS_UNKNOWN: f64 = 131_072.0;
/// Rated torque where the robot file has no limit, Nm.
const RATED_UNKNOWN_NM: f64 = 1.0;
/// Ten times what crystals are off by; steering could not take more away.
const CLOCK_ERROR_MAX_PPM: f64 = 1000.0;
/// Largest torque over rated torque, per mille. Assumed: 3 is what catalogues of servo motors give.
const PEAK_PERMILLE: u16 = 3000;

/// How the virtual drives are made.
#[derive(Clone, Debug)]
pub struct Options {
    /// Axes a slave; the last slave has what is left.
    pub axes_per_slave: usize,
    /// Drives' own cycles a second, and the plant's.
    pub rate_hz: f64,
    /// Seed of everything random in the plant.
    pub seed: u64,
    /// Where the robot stands at start.
    pub position_rad: Vec<f64>,
    /// What the slaves' clocks are off by: the first, by which all go, by this, the others spread evenly down to nothing.
    pub clock_error_ppm: f64,
    /// Time a brake takes to open, and half of it to close.
    pub brake_release_s: f64,
    /// Cycle times of SYNC0 that the drives take; all if empty.
    pub cycle_times_ns: Vec<u32>,
    /// Count that joint positions begin at when the motor is at zero.
    pub first_count: i64,
    /// The synchronisation type (0x1c32:01) can be written.
    pub sync_type_writable: bool,
    /// Limit of the sync error counter (0x10f1:02); 0 is none.
    pub sync_error_limit: u32,
    /// Faults are told by emergency messages.
    pub emergencies: bool,
    /// What breaks, and when.
    pub faults: Vec<TimedFault>,
}

impl Options {
    /// One axis a slave at 1500 Hz, with clocks up to 20 ppm off, for a robot of so many joints.
    pub fn for_joints(joints: usize) -> Self {
        Self {
            axes_per_slave: 1,
            rate_hz: 1500.0,
            seed: 1,
            position_rad: vec![0.0; joints],
            clock_error_ppm: 20.0,
            brake_release_s: 0.06,
            cycle_times_ns: Vec::new(),
            first_count: 0,
            sync_type_writable: true,
            sync_error_limit: 0,
            emergencies: true,
            faults: Vec::new(),
        }
    }
}

/// Why no drives can be made.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// The plant cannot be built.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// Axes a slave.
    #[error("{axes} axes a slave; give 1 to {AXES_MAX}")]
    Axes {
        /// As given.
        axes: usize,
    },
    /// No clock is off by so much.
    #[error("a clock error of {ppm} ppm; give at most {CLOCK_ERROR_MAX_PPM} ppm either way")]
    ClockError {
        /// As given.
        ppm: f64,
    },
    /// A fault names what is not there.
    #[error("fault: there is no {what} {number}, the last is {last}")]
    NoSuch {
        /// Slave or joint.
        what: &'static str,
        /// As given.
        number: usize,
        /// Of the robot.
        last: usize,
    },
}

/// Virtual drives for all joints of a robot, powered up at `now_ns`.
///
/// # Errors
/// [`SetupError`], naming what to change.
pub fn segment(
    robot: &Robot,
    parameters: &PlantParameters,
    injections: &[Injection],
    options: &Options,
    now_ns: u64,
) -> Result<Segment, SetupError> {
    let axes = options.axes_per_slave;
    if !(1..=AXES_MAX).contains(&axes) {
        return Err(SetupError::Axes { axes });
    }
    let ppm = options.clock_error_ppm;
    if !(-CLOCK_ERROR_MAX_PPM..=CLOCK_ERROR_MAX_PPM).contains(&ppm) {
        return Err(SetupError::ClockError { ppm });
    }
    let step_s = 1.0 / options.rate_hz;
    let plant = Plant::new(
        robot,
        parameters,
        injections,
        options.seed,
        &options.position_rad,
        step_s,
    )?;
    let joints: Vec<usize> = (0..robot.joints.len()).collect();
    let count = joints.len().div_ceil(axes);
    check_faults(&options.faults, count, joints.len())?;
    let slaves = joints
        .chunks(axes)
        .enumerate()
        .map(|(position, joints)| {
            let axes = joints
                .iter()
                .map(|joint| axis(*joint, &robot.joints[*joint], parameters, options))
                .collect();
            let config = slave(position, count, axes, options);
            Slave::new(config, now_ns)
        })
        .collect();
    let step_ns = (step_s * 1e9).round() as u64;
    Ok(Segment::new(
        slaves,
        plant,
        step_ns,
        options.faults.clone(),
        now_ns,
    ))
}

fn slave(position: usize, count: usize, axes: Vec<AxisConfig>, options: &Options) -> SlaveConfig {
    let spread = 1.0 - position as f64 / (count.max(2) - 1) as f64;
    SlaveConfig {
        alias: 0,
        identity: [VENDOR, PRODUCT + axes.len() as u32, 1, position as u32 + 1],
        axes,
        clock_error_ppm: options.clock_error_ppm * spread,
        cycle_times_ns: options.cycle_times_ns.clone(),
        sync_type_writable: options.sync_type_writable,
        sync_error_limit: options.sync_error_limit,
        needs_all_axes: true,
        emergencies: options.emergencies,
    }
}

fn axis(
    joint: usize,
    file: &RobotJoint,
    parameters: &PlantParameters,
    options: &Options,
) -> AxisConfig {
    let counts = |resolution_rad: f64| (TAU / resolution_rad).round().clamp(1.0, 1e9) as u32;
    let peak = f64::from(PEAK_PERMILLE) / 1000.0;
    let rated_nm = file
        .torque_limit_nm
        .map_or(RATED_UNKNOWN_NM, |limit_nm| limit_nm / peak);
    let rated_a = file
        .torque_constant_nm_a
        .map_or(1.0, |constant_nm_a| rated_nm / constant_nm_a);
    AxisConfig {
        joint,
        encoder_counts: file
            .motor_encoder_resolution_rad
            .map_or(COUNTS_UNKNOWN as u32, counts),
        link_encoder_counts: file.link_encoder_resolution_rad.map(counts),
        first_count: options.first_count,
        // rounded up: the limit must not lie below the robot file's
        rated_torque_mnm: (rated_nm * 1e3).ceil().max(1.0) as u32,
        torque_limit_permille: PEAK_PERMILLE,
        rated_current_ma: (rated_a * 1e3).ceil().max(1.0) as u32,
        rotor_inertia_kg_m2: file.rotor_inertia_kg_m2,
        velocity_bandwidth_hz: parameters.velocity_loop_bandwidth_hz,
        velocity_integral_s: parameters.velocity_loop_integral_s,
        brake_release_s: options.brake_release_s,
        brake_engage_s: options.brake_release_s / 2.0,
        self_test_s: 0.05,
        strict_enabling: true,
    }
}

fn check_faults(faults: &[TimedFault], slaves: usize, joints: usize) -> Result<(), SetupError> {
    for timed in faults {
        let (what, number, count) = match timed.fault {
            Fault::CableOut { after, .. } => ("cable after slave", after, slaves + 1),
            Fault::CounterShort { slave, .. }
            | Fault::SlaveReset { slave }
            | Fault::BrownOut { slave, .. }
            | Fault::DcLost { slave, .. }
            | Fault::MailboxSilent { slave, .. } => ("slave", slave, slaves),
            Fault::DriveFault { joint, .. } => ("joint", joint, joints),
            Fault::FrameLost { .. } | Fault::FrameDoubled { .. } | Fault::FrameDelayed { .. } => {
                continue;
            }
        };
        if number >= count {
            return Err(SetupError::NoSuch {
                what,
                number,
                last: count - 1,
            });
        }
    }
    Ok(())
}
