use super::testing::parameters;
use super::*;
use crate::TorqueEstimator;

const PERIOD_S: f64 = 1.0 / 1500.0;

fn joint() -> RobotJoint {
    robot::load("shd17").unwrap().joints.remove(0)
}

fn fusion() -> Fusion {
    Fusion::new(&parameters(), &joint(), PERIOD_S).unwrap()
}

/// At rest with the gear twisted.
fn held(cycle: u64, torsion_rad: f64) -> Sample {
    Sample {
        cycle,
        motor_position_rad: 50.0,
        link_position_rad: 0.5 - torsion_rad,
        motor_torque_nm: 0.04,
        load_nm: 1.9,
    }
}

#[test]
fn the_equations_of_motion_by_hand() {
    // θ_ke = 1e-4 cos θ_m at a quarter turn: nothing, and falling by 1e-4 per rad of the motor, so λ = 1 + 100·1e-4 = 1.01
    let skewed = FusionParameters {
        kinematic_error: robot::estimators::KinematicErrorTable {
            cosine_rad: vec![1e-4],
            sine_rad: vec![0.0],
        },
        ..parameters()
    };
    let constants = Fusion::new(&skewed, &joint(), PERIOD_S).unwrap().constants;
    let motor_rad = 0.5 * std::f64::consts::PI / 100.0;
    let state = [motor_rad, 0.5, motor_rad - 3e-4, 0.4, 0.2, -0.3];
    let forces = Forces {
        drive_nm: 6.0,
        load_nm: 1.9,
        stiffness: 1.1,
    };
    let found = constants.accelerations(&state, &Plays::default(), forces);
    // springs 5000·3e-4 + 3000·1e-4, play 1000·1e-4: 1.9 Nm; T = 1.1·1.9 + 1·(1.01·0.5 - 0.4) = 2.195 Nm
    assert!((found.gear.torque_nm - 2.195).abs() < 1e-9);
    // (6 - 2 of Coulomb - 1·0.5 - 0.2 - 1.01·2.195)/0.114 and (2.195 - 1.9 - 0.3)/0.29
    assert!((found.motor_rad_s2 - 1.08305 / 0.114).abs() < 1e-9);
    assert!((found.link_rad_s2 + 0.005 / 0.29).abs() < 1e-9);
}

#[test]
fn the_filters_slopes_are_the_derivatives_of_its_equations() {
    let constants = fusion().constants;
    let plays = Plays::default();
    let forces = Forces {
        drive_nm: 6.0,
        load_nm: 1.9,
        stiffness: 1.1,
    };
    // slow, so that friction's slope counts too; within the play and between the knees
    for state in [
        [0.5, 0.01, 0.5 - 5e-5, 0.02, 0.2, -0.3],
        [0.5, -0.02, 0.5 + 3e-4, 0.0, 0.0, 1.0],
    ] {
        let at = constants.accelerations(&state, &plays, forces);
        let rows = [constants.motor_row(&at), constants.link_row(&at)];
        for place in 0..STATES {
            let step = 1e-8;
            let moved = |by: f64| {
                let mut state = state;
                state[place] += by;
                let at = constants.accelerations(&state, &plays, forces);
                [at.motor_rad_s2, at.link_rad_s2]
            };
            let (before, after) = (moved(-step), moved(step));
            for side in 0..2 {
                let slope = (after[side] - before[side]) / (2.0 * step);
                let miss = (slope - rows[side][place]).abs();
                assert!(miss < 1e-4 * (1.0 + slope.abs()), "{side} {place} {slope}");
            }
        }
    }
}

#[test]
fn a_held_torsion_reads_as_the_law_says_for_as_long_as_it_is_held() {
    let mut fusion = fusion();
    let mut last = Estimate::bare(0.0);
    for cycle in 0..90_000 {
        last = fusion.estimate(&held(cycle, 3e-4)).unwrap();
    }
    // springs 1.5 + 0.3, play 0.1, which the filter's first milliseconds may have dragged a little
    assert!((last.torque_nm - 1.9).abs() < 0.01, "{last:?}");
    let std_nm = last.std_nm.unwrap();
    // a tenth of it, as long as nothing was learned of stiffness
    assert!(std_nm > 0.19 && std_nm < 0.25, "{std_nm}");
}

#[test]
fn without_an_encoder_the_estimate_is_less_sure_than_with_both() {
    let (mut seeing, mut blinking) = (fusion(), fusion());
    let mut stds = [0.0; 2];
    for cycle in 0..1000 {
        let sample = held(cycle, 3e-4);
        stds[0] = seeing.estimate(&sample).unwrap().std_nm.unwrap();
        if cycle % 10 == 0 {
            stds[1] = blinking.estimate(&sample).unwrap().std_nm.unwrap();
        }
    }
    assert!(stds[1] > 1.05 * stds[0], "{stds:?}");
}

#[test]
fn each_missing_signal_is_named_and_a_short_one_of_motor_torque_is_bridged() {
    let mut fusion = fusion();
    let blind = Sample {
        link_position_rad: f64::NAN,
        ..held(0, 1e-4)
    };
    assert_eq!(
        fusion.estimate(&blind),
        Err(Missing(Signal::LinkPositionRad))
    );
    let weak = |cycle| Sample {
        motor_torque_nm: f64::NAN,
        ..held(cycle, 1e-4)
    };
    assert_eq!(
        fusion.estimate(&weak(1)),
        Err(Missing(Signal::MotorTorqueNm))
    );
    assert!(fusion.estimate(&held(2, 1e-4)).is_ok());
    assert!(fusion.estimate(&weak(3)).is_ok());
    assert!(fusion.estimate(&weak(3 + GAP_MAX_CYCLES)).is_err());
}

#[test]
fn a_swing_is_followed_more_quietly_than_by_its_encoders() {
    // A link on a linear spring swings freely at 20 Hz with the rotor held by its drive: exact, then rounded readings.
    let linear = FusionParameters {
        knees_rad: vec![0.0],
        stiffness_steps_nm_rad: vec![8000.0],
        plays_rad: Vec::new(),
        play_stiffnesses_nm_rad: Vec::new(),
        damping_nm_s_rad: 0.0,
        link_inertia_kg_m2: 8000.0 / (40.0 * std::f64::consts::PI).powi(2),
        ..parameters()
    };
    let mut fusion = Fusion::new(&linear, &joint(), PERIOD_S).unwrap();
    let step_rad = joint().link_encoder_resolution_rad.unwrap();
    let (mut fused, mut raw, mut count) = (0.0, 0.0, 0.0);
    for cycle in 0..6000 {
        let time_s = cycle as f64 * PERIOD_S;
        let torsion_rad = 3e-4 * (40.0 * std::f64::consts::PI * time_s).cos();
        let torque_nm = 8000.0 * torsion_rad;
        let sample = Sample {
            cycle,
            motor_position_rad: 0.0,
            link_position_rad: (-torsion_rad / step_rad).round() * step_rad,
            motor_torque_nm: torque_nm / 100.0,
            load_nm: 0.0,
        };
        let found = fusion.estimate(&sample).unwrap();
        if cycle > 3000 {
            fused += (found.torque_nm - torque_nm).powi(2);
            raw += (8000.0 * -sample.link_position_rad - torque_nm).powi(2);
            count += 1.0;
        }
    }
    let (fused, raw): (f64, f64) = ((fused / count).sqrt(), (raw / count).sqrt());
    assert!(fused < 0.9 * raw, "{fused} {raw}");
}

#[test]
fn a_sample_that_comes_twice_in_motion_is_no_stop() {
    // 2 rad/s under a load that the gear carries: a repeated reading is 1.3 mrad behind, 90 steps
    let (mut whole, mut holed) = (fusion(), fusion());
    let moving = |cycle: u64| Sample {
        motor_position_rad: 200.0 * cycle as f64 * PERIOD_S,
        link_position_rad: 2.0 * cycle as f64 * PERIOD_S - 3e-4,
        motor_torque_nm: 0.059,
        ..held(cycle, 0.0)
    };
    let mut worst_nm = 0.0_f64;
    for cycle in 0..3000 {
        let taken = if cycle % 100 == 50 { cycle - 1 } else { cycle };
        let seen = Sample {
            cycle,
            ..moving(taken)
        };
        let full_nm = whole.estimate(&moving(cycle)).unwrap().torque_nm;
        let nm = holed.estimate(&seen).unwrap().torque_nm;
        worst_nm = worst_nm.max((nm - full_nm).abs());
    }
    assert!(worst_nm < 0.05, "{worst_nm}");
}

#[test]
fn at_rest_gravity_tells_what_a_step_rounds_away_and_a_held_push_is_no_error_of_a_step() {
    // 0.15 Nm beside gravity are a step of an encoder; 3 Nm are a push, which torsion tells
    for (push_nm, expected_nm, slack_nm) in [(0.15, 1.75, 0.08), (3.0, 4.75, 0.2)] {
        let linear = FusionParameters {
            knees_rad: vec![0.0],
            stiffness_steps_nm_rad: vec![8000.0],
            plays_rad: Vec::new(),
            play_stiffnesses_nm_rad: Vec::new(),
            ..parameters()
        };
        let mut fusion = Fusion::new(&linear, &joint(), PERIOD_S).unwrap();
        let mut last_nm = 0.0;
        for cycle in 0..30_000 {
            let sample = Sample {
                load_nm: 1.75,
                ..held(cycle, (1.75 + push_nm) / 8000.0)
            };
            last_nm = fusion.estimate(&sample).unwrap().torque_nm;
        }
        assert!((last_nm - expected_nm).abs() < slack_nm, "{last_nm}");
    }
}
