//! The steps on the whole loop with emulated drives, in lockstep: what passes on a sound arm, and what is refused on others.

use commissioning::{Eyes, Finding, Stage, Step, Verdict, small_sine, watch};
use plant_emulator::drives::EmulatedDrives;
use robot::{Push, Robot, RobotFile, Source};
use rt_loop::driver::DriveFault;
use shm_types::control_options::ControlOptions;
use shm_types::instance::{ControlMode, Mode, RunConfig, Wait};
use shm_types::messages::{DriveCommand, DriveMode, DriveSample, PlantTruth};
use twin::{Drives, TwinError};

const PERIOD_NS: u64 = 666_667;

/// Two joints about the vertical, each with a spring that brings it back: no gravity that would have to be supported.
const ARM: &str = r#"
name = "bench"
gravity_m_s2 = [0.0, 0.0, -9.81]
parameter_tolerance = 0.0

[control]
rate_hz = 1500.0
kind = "pd_feedforward"
proportional_nm_rad = [400.0, 400.0]
derivative_nm_s_rad = [20.0, 20.0]
feedback = "motor"
feedforward = "model"
velocity_filter_hz = 200.0
velocity_filter_order = 1
delay_cycles = 1

[[link]]
joint = "joint1"
origin_m = [0.0, 0.0, 0.0]
axis = [0.0, 0.0, 1.0]
mass_kg = 1.0
centre_of_mass_m = [0.0, 0.0, 0.1]
inertia_kg_m2 = { xx = 0.03, yy = 0.03, zz = 0.05 }

[[link]]
joint = "joint2"
origin_m = [0.0, 0.0, 0.2]
axis = [0.0, 0.0, 1.0]
mass_kg = 1.0
centre_of_mass_m = [0.0, 0.0, 0.1]
inertia_kg_m2 = { xx = 0.03, yy = 0.03, zz = 0.05 }

[[joint]]
name = "joint1"
gear_ratio = 100.0
rotor_inertia_kg_m2 = 2e-5
torque_limit_nm = 0.37
torque_constant_nm_a = 0.05
motor_encoder_resolution_rad = 1.5e-4
position_limit_rad = [-0.15, 0.15]
velocity_limit_rad_s = 3.0
effects = [
  { effect = "coulomb_friction", coulomb_nm = 0.3 },
  { effect = "viscous_friction", viscous_nm_s_rad = 8.0 },
  { effect = "joint_spring", stiffness_nm_rad = 30.0, rest_rad = 0.0 },
  { effect = "torsional_compliance", stiffness_nm_rad = 8333.0 },
]

[[joint]]
name = "joint2"
gear_ratio = 50.0
rotor_inertia_kg_m2 = 8e-5
torque_limit_nm = 0.74
torque_constant_nm_a = 0.05
motor_encoder_resolution_rad = 1.5e-4
position_limit_rad = [-0.15, 0.15]
velocity_limit_rad_s = 3.0
effects = [
  { effect = "coulomb_friction", coulomb_nm = 0.3 },
  { effect = "viscous_friction", viscous_nm_s_rad = 8.0 },
  { effect = "joint_spring", stiffness_nm_rad = 30.0, rest_rad = 0.0 },
  { effect = "torsional_compliance", stiffness_nm_rad = 8333.0 },
]
"#;

fn arm() -> Robot {
    RobotFile::parse(ARM, "arm.toml")
        .and_then(|file| file.build(Source::File("arm.toml".into())))
        .expect("a robot")
}

/// A hand that holds a joint at its torque for a second: 5.1 Nm go 0.16 rad against the spring.
fn hand(joint: usize, torque_nm: f64, start_s: f64) -> Push {
    Push {
        joint,
        torque_nm,
        start_s,
        duration_s: 1.2,
    }
}

/// What is wrong with the drives.
#[derive(Clone, Copy, Default)]
struct Wrong {
    torque_reversed: Option<usize>,
    brake_stuck: bool,
}

struct WrongDrives {
    inner: EmulatedDrives,
    wrong: Wrong,
}

impl Drives for WrongDrives {
    fn measure(
        &mut self,
        cycle: u64,
        planned_ns: u64,
    ) -> (Result<DriveSample, DriveFault>, PlantTruth) {
        Drives::measure(&mut self.inner, cycle, planned_ns)
    }

    fn take(&mut self, mut command: DriveCommand) -> Result<(), DriveFault> {
        if let Some(joint) = self.wrong.torque_reversed {
            command.motor_torque_nm[joint] *= -1.0;
        }
        if self.wrong.brake_stuck {
            command.mode = DriveMode::Braked as u32;
        }
        Drives::take(&mut self.inner, command)
    }

    fn advance(&mut self) {
        self.inner.advance();
    }
}

/// Runs what a stage needs for so long, or until it is judged; the verdict, and the loop's reason where it has stopped.
fn try_stage(
    step: Step,
    joint: usize,
    hands: Vec<Push>,
    wrong: Wrong,
    longest_s: f64,
) -> (Verdict, String) {
    let robot = arm();
    let stage = Stage {
        step,
        joint: step.is_per_joint().then_some(joint),
    };
    let run = RunConfig {
        session: 1,
        robot: "bench".to_owned(),
        driver: "emulator".to_owned(),
        trajectory: "hold".to_owned(),
        plant: None,
        control: ControlMode::Torque,
        options: ControlOptions {
            task: step.task(joint),
            ..ControlOptions::default()
        },
        estimators: Vec::new(),
        mode: Mode::Lockstep,
        period_ns: PERIOD_NS,
        cycles: (longest_s * 1e9) as u64 / PERIOD_NS,
        wait: Wait::Block,
        wake_early_ns: 0,
        seed: 1,
        inject: None,
        record: None,
        command_deadline_ns: PERIOD_NS,
        cores: Vec::new(),
        initial_position_rad: vec![0.0; 2],
    };
    let sine = small_sine(&robot, joint, &[0.0, 0.0])
        .build("the sine", &robot)
        .expect("within limits");
    let plant = plant_emulator::process::emulated_plant(&robot, &run, &[])
        .expect("a plant")
        .with_pushes(hands);
    let drives = WrongDrives {
        inner: twin::drives(&run, &robot, plant),
        wrong,
    };
    let mut judge = watch(stage, &robot, Some(sine.clone()));
    let mut eyes = Eyes::default();
    let mut verdict = Verdict::Waiting;
    let ended = twin::simulate_drives(&run, &robot, drives, sine, |messages| {
        if let Some(sample) = messages.sample {
            eyes.take_sample(sample);
        }
        let status = messages.status.expect("sent in every cycle");
        let moment = eyes.take_status(&status).expect("a state");
        verdict = judge.see(&moment);
        // A loop that has stopped says why once the twin ends it.
        matches!(verdict, Verdict::Waiting | Verdict::Stopped)
    });
    let why = match ended {
        Err(TwinError::SafeStop { fault, .. }) => fault,
        Err(other) => panic!("{other}"),
        Ok(()) => String::new(),
    };
    (verdict, why)
}

fn passed(tried: (Verdict, String)) -> Finding {
    match tried {
        (Verdict::Passed(finding), _) => finding,
        other => panic!("not passed: {other:?}"),
    }
}

fn refused(tried: (Verdict, String)) -> String {
    match tried {
        (Verdict::Refused(finding), _) => finding.told,
        other => panic!("not refused: {other:?}"),
    }
}

fn sound() -> Wrong {
    Wrong::default()
}

#[test]
fn a_sound_arm_passes_every_step_but_the_stops_that_end_a_twin() {
    let hands = || {
        vec![
            hand(0, 5.1, 1.0),
            hand(0, -5.1, 3.0),
            hand(1, 5.1, 5.0),
            hand(1, -5.1, 7.0),
        ]
    };
    let still = Vec::new;
    for step in [
        Step::Scan,
        Step::Check,
        Step::BrakesClosed,
        Step::BrakesOpen,
    ] {
        passed(try_stage(step, 0, still(), sound(), 9.0));
    }
    for step in [Step::ZeroTorque, Step::Sign, Step::Limits] {
        for joint in [0, 1] {
            // What was done to joint 1 is over when it is joint 2's turn.
            let hands = hands().split_off(2 * joint);
            passed(try_stage(step, joint, hands, sound(), 12.0));
        }
    }
    for joint in [0, 1] {
        let torque = passed(try_stage(Step::FirstTorque, joint, still(), sound(), 9.0));
        assert!(
            torque.value > 0.0 && torque.value < 0.2 * torque.limit,
            "{torque:?}"
        );
        let sine = passed(try_stage(Step::Sine, joint, still(), sound(), 20.0));
        assert!((0.8..1.2).contains(&sine.value), "{sine:?}");
    }
}

#[test]
fn a_joint_that_turns_the_wrong_way_or_not_at_all_is_refused() {
    let told = refused(try_stage(
        Step::Sign,
        1,
        vec![hand(1, -5.1, 1.0)],
        sound(),
        9.0,
    ));
    assert!(
        told.contains("joint2") && told.contains("reversed"),
        "{told}"
    );
    let told = refused(try_stage(
        Step::ZeroTorque,
        0,
        vec![hand(1, 5.1, 1.0)],
        sound(),
        9.0,
    ));
    assert!(told.contains("exchanged"), "{told}");
    let told = refused(try_stage(Step::ZeroTorque, 0, Vec::new(), sound(), 122.0));
    assert!(told.contains("seen to move by 0.000 rad"), "{told}");
}

#[test]
fn a_stop_before_the_end_of_the_range_is_refused_and_beyond_it_the_loop_ends_it() {
    // 3 Nm go 0.09 rad against the spring: as a stop before the limit would have it.
    let held = vec![hand(0, 3.0, 1.0), hand(0, -3.0, 3.0)];
    let told = refused(try_stage(Step::Limits, 0, held, sound(), 122.0));
    assert!(told.contains("position_limit_rad"), "{told}");
    // 10 Nm go 0.3 rad: no stop within 0.1 rad of the limit.
    let through = vec![hand(0, -10.0, 1.0)];
    let (verdict, why) = try_stage(Step::Limits, 0, through, sound(), 9.0);
    assert_eq!(verdict, Verdict::Stopped);
    assert!(why.contains("joint1"), "{why}");
}

#[test]
fn a_brake_that_does_not_open_is_told_by_the_loop_before_anything_moves() {
    let stuck = Wrong {
        brake_stuck: true,
        ..sound()
    };
    let (verdict, why) = try_stage(Step::BrakesOpen, 0, Vec::new(), stuck, 9.0);
    assert_eq!(verdict, Verdict::Stopped);
    assert!(why.contains("joint1") && why.contains("enabled"), "{why}");
}

#[test]
fn torque_of_the_wrong_sign_is_seen_before_the_joint_has_gone_two_degrees() {
    let reversed = Wrong {
        torque_reversed: Some(1),
        ..sound()
    };
    let (verdict, _) = try_stage(Step::FirstTorque, 1, Vec::new(), reversed, 9.0);
    let Verdict::Refused(finding) = verdict else {
        panic!("not refused: {verdict:?}")
    };
    assert!(
        finding.told.contains("joint2") && finding.told.contains("sign of its torque is wrong"),
        "{finding:?}"
    );
    assert!(finding.value.abs() < 0.035, "{finding:?}");
    passed(try_stage(Step::FirstTorque, 0, Vec::new(), reversed, 9.0));
}

#[test]
fn a_switch_that_nobody_is_stopped_by_is_refused() {
    let told = refused(try_stage(
        Step::EmergencyStop,
        0,
        Vec::new(),
        sound(),
        122.0,
    ));
    assert!(told.contains("the loop went on"), "{told}");
}
