//! A drive that trips while the arm moves is told by joint and code, and the loop acts at once.

use robot::DriveFaultInjection;
use shm_types::control_options::ControlOptions;
use shm_types::drive::DriveState;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use shm_types::messages::LoopState;
use twin::TwinError;

const PERIOD_NS: u64 = 666_667;
/// The cycle at whose beginning the drive trips.
const TRIPS: u64 = 1500;

fn run(initial_position_rad: Vec<f64>) -> RunConfig {
    RunConfig {
        session: 1,
        robot: "pa10".to_owned(),
        driver: "emulator".to_owned(),
        trajectory: "lemniscate".to_owned(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions::default(),
        estimators: Vec::new(),
        mode: Mode::Lockstep,
        period_ns: PERIOD_NS,
        cycles: 3000,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        command_deadline_ns: PERIOD_NS,
        cores: Vec::new(),
        initial_position_rad,
    }
}

#[test]
fn a_drive_fault_is_told_within_two_cycles() {
    let robot = robot::load("pa10").expect("shipped");
    let trajectory = motion::load("lemniscate", &robot).expect("shipped");
    let mut start = motion::Reference::default();
    trajectory.sample(0.0, &mut start);
    let run = run(start.position_rad[..7].to_vec());
    let trip = DriveFaultInjection {
        joint: 3,
        error_code: 0x7305,
        start_s: TRIPS as f64 * PERIOD_NS as f64 * 1e-9,
        cause_s: 0.0,
    };
    let plant = plant_emulator::process::emulated_plant(&robot, &run, &[]).expect("a plant");
    let drives = twin::drives(&run, &robot, plant).with_faults(vec![trip]);
    let mut first_told = None;
    let ended = twin::simulate_drives(&run, &robot, drives, trajectory, |messages| {
        let status = messages.status.expect("sent in every cycle");
        let state = LoopState::from_raw(status.state).expect("a state");
        if status.drives.state_of(3).is_faulted() {
            first_told.get_or_insert((messages.cycle, status.drives.error_code[3], state));
        } else if messages.cycle > 20 {
            assert_eq!(state, LoopState::Running);
            assert_eq!(status.drives.state_of(3), DriveState::Enabled);
        }
        true
    });
    let Err(TwinError::SafeStop { fault, .. }) = ended else {
        panic!("the loop went on: {ended:?}")
    };
    let name = &robot.joints[3].name;
    assert!(fault.contains(name) && fault.contains("0x7305"), "{fault}");
    let (cycle, code, state) = first_told.expect("told");
    assert_eq!((code, state), (0x7305, LoopState::SafeStop));
    assert!((TRIPS..=TRIPS + 2).contains(&cycle), "cycle {cycle}");
}
