//! What can be typed after `flexspline drives emulate ethercat`.

use std::time::Duration;

use clap::Args;
use ethercat_emulator::TimedFault;

/// `flexspline drives emulate ethercat`
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  ip link add veth0 type veth peer name veth1; ip link set veth0 up; ip link set veth1 up
  flexspline drives emulate ethercat --interface veth1 --robot shd17         a master on veth0 finds one drive
  flexspline drives emulate ethercat --interface veth1 --robot pa10 --axes 2 --fault frame-lost:count=3@5s

Joint by joint, in the robot's order, each slave has --axes of them. Modes: cyclic position (8), velocity (9), torque (10).
Needs CAP_NET_RAW: root, or once setcap cap_net_raw+ep on the program.
Faults, with what they take: cable-out:after=SLAVES,for=T frame-lost:count=N frame-doubled:count=N
frame-delayed:count=N,by=T counter-short:slave=K,count=N slave-reset:slave=K drive-fault:joint=K,code=0xC,for=T
brown-out:slave=K,for=T dc-lost:slave=K,for=T mailbox-silent:slave=K,for=T. All numbers count from 0; times are 500us, 20ms or 3s.
Ends with Ctrl-C, or after --duration. Exit code: 0 done, 2 bad input.")]
pub struct EmulateEthercatArguments {
    /// Network interface that the master's frames come in on
    #[arg(long, value_name = "NAME")]
    pub interface: String,
    /// Robot: pa10, shd17, or a robot file
    #[arg(long, default_value = "shd17", value_name = "NAME|FILE")]
    pub robot: String,
    /// Trajectory at whose beginning the robot stands; the robot's own if not given
    #[arg(long, value_name = "NAME|FILE")]
    pub trajectory: Option<String>,
    /// File of effects to add to the emulated plant, and of pushes from outside
    #[arg(long, value_name = "FILE")]
    pub inject: Option<std::path::PathBuf>,
    /// Axes of each slave, 1 to 8
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub axes: usize,
    /// Cycles a second of the drives and their SYNC0; control.rate_hz of the robot file if not given, 1500 where it has none
    #[arg(long, value_name = "HZ")]
    pub rate: Option<f64>,
    /// SYNC0 cycle times that the drives take, as 2ms,8ms; any from 125us on if not given
    #[arg(long, value_name = "T,T", value_delimiter = ',', value_parser = humantime::parse_duration)]
    pub cycle_times: Vec<Duration>,
    /// What the first slave's clock, the bus's, is off by in millionths; the others lie between it and 0
    #[arg(
        long,
        default_value_t = 20.0,
        value_name = "PPM",
        allow_negative_numbers = true
    )]
    pub clock_error: f64,
    /// From the order to open a brake until the shaft is free; closing takes half of it
    #[arg(long, default_value = "60ms", value_name = "T", value_parser = humantime::parse_duration)]
    pub brake_release: Duration,
    /// Missed SYNC0s count 3, met ones take 1 off; above this limit a drive leaves OP; 0 for never
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub sync_error_limit: u32,
    /// Make the synchronisation type, object 0x1c32:01, read-only
    #[arg(long)]
    pub fixed_sync_type: bool,
    /// Tell drive faults in 0x603f only, without an emergency message
    #[arg(long)]
    pub no_emergencies: bool,
    /// What breaks when, counted from the moment all slaves are in OP; may be given more than once
    #[arg(long, value_name = "KIND:KEY=VALUE,...@TIME")]
    pub fault: Vec<TimedFault>,
    /// Take pushes on the robot from standard input, each a line JOINT TORQUE_NM TIME, as joint1 5.5 2s; joint side
    #[arg(long)]
    pub hands: bool,
    /// Seed of everything random in the robot
    #[arg(long, default_value_t = 1, value_name = "N")]
    pub seed: u64,
    /// How long to run, as 15s; until Ctrl-C if not given
    #[arg(long, value_name = "D", value_parser = humantime::parse_duration)]
    pub duration: Option<Duration>,
}
