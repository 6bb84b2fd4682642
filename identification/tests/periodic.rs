//! Position-dependent friction from recordings of known friction: harmonics, the look-up table, errors.
#![allow(clippy::unwrap_used, reason = "a test may")]

mod friction_bench;

use std::f64::consts::TAU;

use friction_bench::{Bench, column};
use identification::friction::SETTLING_S;
use identification::periodic::{Harmonic, PeriodicAnalysis, analyse_periodic};
use joint_model::friction::{DryFriction, FrictionLookup, PeriodicFriction, Sliding};
use proptest::prelude::*;
use recording::{Recording, Signal};
use robot::Effect;

/// 0.01 rad/s as in the paper, so many whole motor revolutions each way.
fn slow_motion(bench: &mut Bench, revolutions: f64) -> Recording {
    let duration_s = revolutions * TAU / (0.01 * 50.0) + 1.5;
    bench.record(&[(0.01, duration_s), (0.0, 0.5), (-0.01, duration_s)])
}

fn analysed(bench: &mut Bench, revolutions: f64) -> PeriodicAnalysis {
    let recording = slow_motion(bench, revolutions);
    analyse_periodic(&[recording], &bench.robot, bench.name(), SETTLING_S).unwrap()
}

/// Joint 2 of Table III.
fn joint_2(seed: u64) -> Bench {
    let mut bench = Bench::joint_2(seed);
    bench.add_harmonic(6.0, 6.0, -1.5);
    bench.add_harmonic(2.5, 39.0, -6.9 + TAU);
    bench
}

fn assert_is(found: &Harmonic, truth: &PeriodicFriction) {
    let amplitude = (found.amplitude_nm - truth.amplitude_nm) / found.amplitude_standard_error_nm;
    let phase = (found.phase_rad - truth.phase_rad) / found.phase_standard_error_rad;
    assert!(
        amplitude.abs() < 4.0,
        "{amplitude} standard errors: {found:?}"
    );
    assert!(phase.abs() < 4.0, "{phase} standard errors: {found:?}");
    assert_eq!(found.cycles_per_motor_rev, truth.cycles_per_motor_rev);
    assert_eq!(f64::from(found.order), truth.cycles_per_motor_rev);
    assert!(found.order_deviation.abs() < 4.0 * found.order_standard_error);
}

#[test]
fn table_iii_comes_back_in_both_directions_and_combined() {
    let mut bench = joint_2(1);
    let analysis = analysed(&mut bench, 12.0);
    for found in [
        &analysis.positive.harmonics,
        &analysis.negative.harmonics,
        &analysis.combined,
    ] {
        assert_eq!(found.len(), 2, "{found:?}");
        for (found, truth) in found.iter().zip(&bench.friction.periodic) {
            assert_is(found, truth);
        }
        // the paper's column f: 47.60 and 310.50
        assert!((found[0].cycles_per_joint_rad - 47.75).abs() < 0.1);
        assert!((found[1].cycles_per_joint_rad - 310.35).abs() < 0.1);
    }
    assert_eq!(analysis.positive.revolutions, 12);
    assert!(
        (analysis.positive.mean_nm - 41.1).abs() < 0.7,
        "{}",
        analysis.positive.mean_nm
    );
    assert!(analysis.positive.residual_rms_nm < 0.2 * analysis.positive.rms_nm);
}

#[test]
fn the_effect_written_is_the_one_that_made_the_recording() {
    let mut bench = joint_2(2);
    let analysis = analysed(&mut bench, 6.0);
    for (found, truth) in analysis.combined.iter().zip(&bench.friction.periodic) {
        let Effect::PositionDependentFriction {
            amplitude_nm,
            cycles_per_motor_rev,
            phase_rad,
        } = found.effect()
        else {
            panic!("another effect");
        };
        let written = PeriodicFriction {
            amplitude_nm,
            cycles_per_motor_rev,
            phase_rad,
        };
        for motor_position_rad in [-40.0, 0.0, 1.0, 77.0] {
            let at = Sliding {
                motor_position_rad,
                ..Sliding::at(-0.01)
            };
            assert!((written.level_nm(&at) - truth.level_nm(&at)).abs() < 0.2);
        }
    }
}

#[test]
fn the_table_is_the_friction_without_its_mean() {
    let mut bench = joint_2(3);
    let analysis = analysed(&mut bench, 12.0);
    let table = analysis.friction_table(512);
    let lookup = FrictionLookup {
        positive_nm: table.positive_nm.into(),
        negative_nm: table.negative_nm.into(),
    };
    for velocity_rad_s in [0.01, -0.01] {
        let mut squares = 0.0;
        for step in 0..1000 {
            let at = Sliding {
                motor_position_rad: TAU * f64::from(step) / 1000.0,
                ..Sliding::at(velocity_rad_s)
            };
            let truth_nm: f64 = bench
                .friction
                .periodic
                .iter()
                .map(|law| law.level_nm(&at))
                .sum();
            squares += (lookup.level_nm(&at) - truth_nm).powi(2);
        }
        let rms_nm = (squares / 1000.0).sqrt();
        println!("table misses by {rms_nm:.4} Nm rms");
        assert!(rms_nm < 0.15, "{rms_nm} Nm");
    }
}

#[test]
fn a_frequency_between_orders_is_reported_as_measured() {
    let mut bench = Bench::joint_2(4);
    // f = 47.60 per rad as Table III prints it
    bench.add_harmonic(6.0, 47.60 * TAU / 50.0, -1.5);
    let analysis = analysed(&mut bench, 12.0);
    let found = &analysis.combined[0];
    assert_eq!(found.order, 6);
    let truth = 47.60 * TAU / 50.0;
    assert!((found.cycles_per_motor_rev - truth).abs() < 4.0 * found.order_standard_error);
    assert!((found.order_deviation - (truth - 6.0)).abs() < 4.0 * found.order_standard_error);
    assert!((found.amplitude_nm - 6.0).abs() < 4.0 * found.amplitude_standard_error_nm);
    assert!(
        (found.phase_rad + 1.5).abs() < 4.0 * found.phase_standard_error_rad,
        "{found:?}"
    );
}

#[test]
fn noise_alone_has_no_harmonics() {
    let mut found = 0;
    for seed in 0..10 {
        let analysis = analysed(&mut Bench::joint_2(seed), 2.0);
        found += analysis.positive.harmonics.len() + analysis.negative.harmonics.len();
    }
    println!("{found} harmonics in 20 spectra of noise");
    // one in a hundred spectra is allowed one
    assert!(found <= 2, "{found}");
}

#[test]
fn standard_errors_cover_the_truth() {
    let (mut within, mut all) = (0, 0);
    for seed in 100..115 {
        let mut bench = joint_2(seed);
        let analysis = analysed(&mut bench, 2.0);
        for direction in [&analysis.positive, &analysis.negative] {
            for (found, truth) in direction.harmonics.iter().zip(&bench.friction.periodic) {
                let amplitude_nm = found.amplitude_nm - truth.amplitude_nm;
                let phase_rad = found.phase_rad - truth.phase_rad;
                within += usize::from(amplitude_nm.abs() < 2.0 * found.amplitude_standard_error_nm);
                within += usize::from(phase_rad.abs() < 2.0 * found.phase_standard_error_rad);
                all += 2;
            }
        }
    }
    let coverage = f64::from(u32::try_from(within).unwrap()) / f64::from(all);
    println!("coverage of two standard errors: {coverage:.3} of {all}");
    assert!((0.88..0.99).contains(&coverage), "{coverage}");
}

#[test]
fn less_than_a_revolution_or_one_direction_is_said_so() {
    let mut bench = joint_2(5);
    let short = slow_motion(&mut bench, 0.5);
    let error = analyse_periodic(&[short], &bench.robot, "joint2", SETTLING_S).unwrap_err();
    assert!(
        error.to_string().contains("whole motor revolutions"),
        "{error}"
    );
    let one_way = bench.record(&[(0.01, 20.0)]);
    let error = analyse_periodic(&[one_way], &bench.robot, "joint2", SETTLING_S).unwrap_err();
    assert!(
        error.to_string().contains("constant negative velocity"),
        "{error}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn garbage_does_not_panic(
        torque in prop::collection::vec(prop_oneof![any::<f64>(), -1.0..1.0], 700),
        position in prop::collection::vec(prop_oneof![any::<f64>(), -9.0..9.0], 700),
        points in 0_usize..40,
    ) {
        let mut bench = Bench::joint_2(0);
        let mut garbage = bench.record(&[(0.1, 1.4), (-0.1, 1.4)]);
        *column(&mut garbage, 1, Signal::MotorTorqueNm) = torque;
        *column(&mut garbage, 1, Signal::MotorPositionRad) = position;
        if let Ok(analysis) = analyse_periodic(&[garbage], &bench.robot, "joint2", SETTLING_S) {
            let _ = analysis.friction_table(points);
        }
    }

    /// Positions that pass for motion, with torque of any kind.
    #[test]
    fn garbage_torque_does_not_panic(
        torque in prop::collection::vec(prop_oneof![any::<f64>(), -1.0..1.0], 700),
    ) {
        let mut bench = Bench::joint_2(0);
        let mut garbage = bench.record(&[(0.2, 1.4), (-0.2, 1.4)]);
        *column(&mut garbage, 1, Signal::MotorTorqueNm) = torque;
        if let Ok(analysis) = analyse_periodic(&[garbage], &bench.robot, "joint2", SETTLING_S) {
            let _ = analysis.friction_table(64);
        }
    }
}
