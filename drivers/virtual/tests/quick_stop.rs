//! How long a joint that ran away goes on once it is told to stop, on virtual EtherCAT drives in virtual time.

mod common;

use common::{Loop, PERIOD_NS};
use robot::Robot;
use rt_loop::driver::QuickStop;
use shm_types::messages::{DriveMode, DriveRequest};
use virtual_drives::{Kind, open, run_config};

/// What the emulated joint was once seen to run away at.
const RUNAWAY_RAD_S: f64 = 20.0;

/// One drive whose joint runs away.
struct Runaway(Loop);

impl Runaway {
    fn with(of_joint: &str) -> Self {
        let mut robot: Robot = robot::load("shd17").expect("shipped");
        robot.joints[0].drive = Some(of_joint.parse().expect("TOML"));
        let run = run_config(1, PERIOD_NS);
        let bus = open(Kind::Ethercat, &robot, &run).expect("it opens");
        Self(Loop::new(bus))
    }

    fn quick_stop(&self) -> QuickStop {
        let told = self.0.bus.capabilities();
        told.joints[0].quick_stop.expect("told")
    }

    fn cycle(&mut self, mode: DriveMode, request: DriveRequest, motor_torque_nm: f64) {
        self.0.command.mode = mode as u32;
        self.0.command.request = request as u32;
        self.0.command.motor_torque_nm[0] = motor_torque_nm;
        self.0.cycles(1);
    }

    fn joint_velocity_rad_s(&self) -> f64 {
        self.0.bus.truth().link_velocity_rad_s[0]
    }

    /// From the runaway's velocity until the joint has a hundredth of it.
    fn stops_after_s(&mut self) -> f64 {
        for _ in 0..1500 {
            self.cycle(DriveMode::Torque, DriveRequest::Enable, 0.0);
        }
        while self.joint_velocity_rad_s() < RUNAWAY_RAD_S {
            self.cycle(DriveMode::Torque, DriveRequest::None, 0.36);
            assert!(self.0.cycle < 15_000, "it gets there");
        }
        let begun = self.0.cycle;
        while self.joint_velocity_rad_s().abs() > 0.01 * RUNAWAY_RAD_S {
            self.cycle(DriveMode::Braked, DriveRequest::QuickStop, 0.0);
            assert!(self.0.cycle < begun + 15_000, "it ends");
        }
        (self.0.cycle - begun) as f64 * PERIOD_NS as f64 * 1e-9
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
