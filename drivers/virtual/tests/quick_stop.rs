//! How long a joint that ran away goes on once it is told to stop, on virtual EtherCAT drives in virtual time.

use robot::Robot;
use rt_loop::driver::QuickStop;
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use shm_types::messages::{DriveCommand, DriveMode, DriveRequest};
use virtual_drives::{Kind, VirtualDrives, open};

const PERIOD_NS: u64 = 666_667;
/// What the emulated joint was once seen to run away at.
const RUNAWAY_RAD_S: f64 = 20.0;

fn run_config() -> RunConfig {
    RunConfig {
        session: 1,
        robot: String::new(),
        driver: "ethercat".to_owned(),
        trajectory: String::new(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        mode: Mode::Realtime,
        period_ns: PERIOD_NS,
        cycles: 0,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        estimators: Vec::new(),
        command_deadline_ns: PERIOD_NS,
        cores: Vec::new(),
        initial_position_rad: vec![0.0],
    }
}

/// A bus with one drive, at its cycles.
struct Runaway {
    bus: Box<dyn VirtualDrives>,
    cycle: u64,
    epoch_ns: u64,
}

impl Runaway {
    fn with(of_joint: &str) -> Self {
        let mut robot: Robot = robot::load("shd17").expect("shipped");
        robot.joints[0].drive = Some(of_joint.parse().expect("TOML"));
        let bus = open(Kind::Ethercat, &robot, &run_config()).expect("it opens");
        Self {
            epoch_ns: bus.now_ns(),
            bus,
            cycle: 0,
        }
    }

    fn quick_stop(&self) -> QuickStop {
        self.bus.capabilities().joints[0].quick_stop.expect("told")
    }

    fn cycle(&mut self, mode: DriveMode, request: DriveRequest, motor_torque_nm: f64) {
        let planned_ns = self.epoch_ns + self.cycle * PERIOD_NS;
        self.bus.pass_until(planned_ns);
        let sample = self
            .bus
            .read(self.cycle, planned_ns, planned_ns + PERIOD_NS / 3);
        sample.expect("nothing is broken");
        self.bus.pass_until(planned_ns + PERIOD_NS / 4);
        let mut command = DriveCommand {
            mode: mode as u32,
            request: request as u32,
            ..DriveCommand::default()
        };
        command.motor_torque_nm[0] = motor_torque_nm;
        self.bus.write(&command).expect("it is sent");
        self.bus.prepare();
        self.cycle += 1;
    }

    fn joint_velocity_rad_s(&self) -> f64 {
        self.bus.truth().link_velocity_rad_s[0]
    }

    /// From the runaway's velocity until the joint has a hundredth of it.
    fn stops_after_s(&mut self) -> f64 {
        for _ in 0..1500 {
            self.cycle(DriveMode::Torque, DriveRequest::Enable, 0.0);
        }
        while self.joint_velocity_rad_s() < RUNAWAY_RAD_S {
            self.cycle(DriveMode::Torque, DriveRequest::None, 0.36);
            assert!(self.cycle < 15_000, "it gets there");
        }
        let begun = self.cycle;
        while self.joint_velocity_rad_s().abs() > 0.01 * RUNAWAY_RAD_S {
            self.cycle(DriveMode::Braked, DriveRequest::QuickStop, 0.0);
            assert!(self.cycle < begun + 15_000, "it ends");
        }
        (self.cycle - begun) as f64 * PERIOD_NS as f64 * 1e-9
    }
}

#[test]
fn a_joint_that_ran_away_stops_on_the_robot_files_ramp() {
    let mut own = Runaway::with("");
    let own_rad_s2 = own.quick_stop().ramp_rad_s2.expect("a ramp");
    let own_s = own.stops_after_s();
    println!("{RUNAWAY_RAD_S} rad/s, the drive's own ramp of {own_rad_s2:.1} rad/s²: {own_s:.3} s");
    let mut before_s = own_s;
    for ramp_rad_s2 in [40.0, 80.0] {
        let mut runaway = Runaway::with(&format!("quick_stop_rad_s2 = {ramp_rad_s2:?}"));
        let stop = runaway.quick_stop();
        assert!(
            stop.ramp_rad_s2
                .is_some_and(|read| (read - ramp_rad_s2).abs() < 0.1)
        );
        assert_eq!(stop.option, Some(2));
        let after_s = runaway.stops_after_s();
        println!("{RUNAWAY_RAD_S} rad/s, quick_stop_rad_s2 = {ramp_rad_s2}: {after_s:.3} s");
        assert!(after_s < before_s, "{after_s} s, before {before_s} s");
        // The drive's velocity loop follows the ramp a little later.
        assert!(after_s < RUNAWAY_RAD_S / ramp_rad_s2 + 0.1, "{after_s} s");
        before_s = after_s;
    }
    let by_current = Runaway::with("quick_stop_option = 3");
    assert_eq!(by_current.quick_stop().option, Some(3));
}
