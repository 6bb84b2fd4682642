//! What the emulated drives tell of themselves, and how the arm goes with it.

use plant_emulator::drives::EmulatedDrives;
use plant_emulator::{Plant, PlantParameters};
use robot::{DriveFaultInjection, HoldingBrake, Robot};
use shm_types::drive::DriveState;
use shm_types::messages::{DriveCommand, DriveMode, DriveRequest, DriveSample, Header};

const PERIOD_NS: u64 = 666_667;

struct Bench {
    drives: EmulatedDrives,
    joint_count: u64,
}

impl Bench {
    fn new(robot: &Robot, faults: Vec<DriveFaultInjection>) -> Self {
        let parameters = PlantParameters::for_robot(robot).expect("parameters");
        let start = vec![0.4; robot.joints.len()];
        let plant = Plant::new(robot, &parameters, &[], 1, &start, PERIOD_NS as f64 * 1e-9);
        let plant = plant.expect("a plant");
        Self {
            drives: EmulatedDrives::new(plant, 1, robot, PERIOD_NS).with_faults(faults),
            joint_count: robot.joints.len() as u64,
        }
    }

    fn cycle(&mut self, mode: DriveMode, request: DriveRequest) -> DriveSample {
        let cycle = self.drives.cycle();
        self.drives.take(DriveCommand {
            header: Header {
                session: 1,
                cycle,
                measured_at_ns: cycle * PERIOD_NS,
                joint_count: self.joint_count,
            },
            mode: mode as u32,
            request: request as u32,
            ..DriveCommand::default()
        });
        self.drives.advance();
        self.drives.measure(self.drives.cycle() * PERIOD_NS).0
    }

    fn cycles(&mut self, count: usize, mode: DriveMode, request: DriveRequest) -> DriveSample {
        (0..count)
            .map(|_| self.cycle(mode, request))
            .last()
            .expect("some cycles")
    }
}

fn pa10() -> Robot {
    robot::load("pa10").expect("shipped")
}

#[test]
fn brakes_hold_until_they_are_open_and_again_when_they_have_closed() {
    let mut robot = pa10();
    // 30 cycles to open, 15 to close.
    robot.joints[1].brake = Some(HoldingBrake {
        release_s: 0.02,
        engage_s: 0.01,
    });
    let mut bench = Bench::new(&robot, Vec::new());
    let still = bench.cycles(3, DriveMode::Braked, DriveRequest::None);
    assert_eq!(still.drives.state_of(1), DriveState::SwitchedOff);
    let opening = bench.cycles(20, DriveMode::Torque, DriveRequest::Enable);
    assert_eq!(opening.drives.state_of(0), DriveState::Enabled);
    assert_eq!(opening.drives.state_of(1), DriveState::Enabling);
    assert_eq!(
        opening.mode,
        DriveMode::Braked as u32,
        "not everybody obeys"
    );
    let at_rad = opening.readings.motor_position_rad[1];
    let held_rad = still.readings.motor_position_rad[1];
    assert!((at_rad - held_rad).abs() < 1e-3, "the brake is closed");
    let open = bench.cycles(30, DriveMode::Torque, DriveRequest::Enable);
    assert_eq!(open.drives.state_of(1), DriveState::Enabled);
    assert_eq!(open.mode, DriveMode::Torque as u32);
    let fallen_rad = open.readings.motor_position_rad[1];
    assert!((fallen_rad - at_rad).abs() > 1e-3, "no torque holds it now");
    // The drive holds until the brake does.
    let closing = bench.cycles(5, DriveMode::Braked, DriveRequest::None);
    assert_eq!(closing.drives.state_of(1), DriveState::QuickStop);
    assert_eq!(closing.drives.state_of(0), DriveState::SwitchedOff);
    let closed = bench.cycles(20, DriveMode::Braked, DriveRequest::None);
    assert_eq!(closed.drives.state_of(1), DriveState::SwitchedOff);
}

#[test]
fn a_tripped_drive_tells_its_code_and_is_cleared_by_a_reset() {
    let fault = DriveFaultInjection {
        joint: 3,
        error_code: 0x7305,
        start_s: 0.01,
        cause_s: 0.004,
    };
    let mut bench = Bench::new(&pa10(), vec![fault]);
    let before = bench.cycles(15, DriveMode::Torque, DriveRequest::Enable);
    assert_eq!(before.drives.state_of(3), DriveState::Enabled);
    let tripped = bench.cycle(DriveMode::Torque, DriveRequest::None);
    assert_eq!(tripped.drives.error_code[3], 0x7305);
    assert!(tripped.drives.state_of(3).is_faulted());
    assert_eq!(
        tripped.drives.find(7, DriveState::is_faulted),
        Some(3),
        "no other"
    );
    let early = bench.cycles(4, DriveMode::Braked, DriveRequest::ResetFault);
    assert_eq!(
        early.drives.state_of(3),
        DriveState::Fault,
        "the cause is still there"
    );
    let cleared = bench.cycles(4, DriveMode::Braked, DriveRequest::ResetFault);
    assert_eq!(cleared.drives.state_of(3), DriveState::SwitchedOff);
    assert_eq!(cleared.drives.error_code[3], 0);
}
