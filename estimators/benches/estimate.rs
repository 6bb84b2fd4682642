//! What one estimate of each of seven joints costs: estimator by estimator, the external torque, and all together.
//!
//! The yardstick is the inverse dynamics of the same arm, once.
#![allow(missing_docs, reason = "the macros make undocumented functions")]

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use estimators::{Estimate, ExternalTorque, JointEstimators, Kind, Sample};
use robot::Robot;
use robot::estimators::{
    ComplianceParameters, DisturbanceObserverParameters, EstimatorParameters, FusionParameters,
    GaussianProcessTable, KinematicErrorTable, TaghiradParameters,
};

const JOINTS: usize = 7;
/// Of the arm's links, as large as SD's.
const LINK_ENCODER_RAD: f64 = 1.2e-5;
const PERIOD_S: f64 = 1.0 / 1500.0;

/// Parameters of the size that a calibration gives.
fn parameters() -> EstimatorParameters {
    let kinematic_error = KinematicErrorTable {
        cosine_rad: vec![1e-5; 6],
        sine_rad: vec![1e-5; 6],
    };
    EstimatorParameters {
        structural_damping: None,
        compliance: Some(ComplianceParameters {
            stiffness_nm_rad: 8333.0,
            stiffening_per_nm: 0.089,
            wave_generator_stiffness_nm_rad: 1.33,
            wave_generator_stiffening_per_nm: 83.5,
            torsion_scale: 1.0,
            torque_scale: 1.0,
            zero_rad: 0.0,
            torque_max_nm: 16.0,
            kinematic_error: kinematic_error.clone(),
        }),
        taghirad: Some(TaghiradParameters {
            stiffness_nm_rad: 8000.0,
            damping_nm: 2.0,
            exponent: 0.7,
            zero_rad: 0.0,
        }),
        disturbance_observer: Some(DisturbanceObserverParameters {
            coulomb_nm: [2.0; 2],
            viscous_nm_s_rad: [1.0; 2],
        }),
        gaussian_process: Some(GaussianProcessTable {
            compliance_nm: [-15.0, 15.0],
            motor_nm: [-20.0, 20.0],
            residual_nm: vec![vec![0.1; 25]; 25],
            std_nm: vec![vec![0.1; 25]; 25],
        }),
        fusion: Some(FusionParameters {
            zero_rad: 0.0,
            kinematic_error,
            knees_rad: [0.0, 1.0, 2.0, 3.0, 4.5, 6.0, 8.0]
                .map(|k| 1.4e-4 * k)
                .to_vec(),
            stiffness_steps_nm_rad: vec![3000.0, 5000.0, 500.0, 1000.0, 2000.0, 100.0, 100.0],
            plays_rad: vec![5e-5, 1e-4, 2e-4, 4e-4],
            play_stiffnesses_nm_rad: vec![2000.0, 400.0, 200.0, 100.0],
            damping_nm_s_rad: 2.0,
            coulomb_nm: 1.2,
            viscous_nm_s_rad: 2.0,
            link_inertia_kg_m2: 0.29,
            gravity_share: 1.0,
            free_std_nm: 0.1,
            moving_std_nm: 0.08,
            resting_std_nm: 0.05,
            follows_stiffness: true,
        }),
    }
}

/// A joint that swings under load.
fn sample(cycle: u64) -> Sample {
    let phase = TAU * cycle as f64 / 1500.0;
    let motor_position_rad = 30.0 * phase.sin();
    Sample {
        cycle,
        motor_position_rad,
        link_position_rad: motor_position_rad / 100.0 - 8e-4 * phase.cos(),
        motor_torque_nm: 0.1 * phase.cos(),
        load_nm: 3.0,
    }
}

/// The PA-10 with link encoders and every estimator calibrated.
fn arm() -> Robot {
    let mut arm = robot::load("pa10").expect("shipped");
    for joint in &mut arm.joints {
        joint.link_encoder_resolution_rad = Some(LINK_ENCODER_RAD);
        joint.estimators = Some(parameters());
    }
    arm
}

/// One cycle of the arm by these estimators; the fused torques.
fn estimate(
    joints: &mut [JointEstimators],
    kinds: &[Kind],
    sample: &Sample,
) -> [Option<Estimate>; JOINTS] {
    let mut fused = [None; JOINTS];
    for (joint, fused) in joints.iter_mut().zip(&mut fused) {
        for kind in kinds {
            let answer = black_box(joint.estimate(*kind, black_box(sample)));
            if *kind == Kind::Fusion {
                *fused = answer.and_then(Result::ok);
            }
        }
    }
    fused
}

fn yardstick(criterion: &mut Criterion) {
    let chain = arm().chain;
    let [position_rad, velocity_rad_s, acceleration_rad_s2] =
        [[0.3; JOINTS], [0.4; JOINTS], [0.5; JOINTS]];
    let mut torque_nm = [0.0; JOINTS];
    criterion.bench_function("yardstick: inverse dynamics", |bench| {
        bench.iter(|| {
            chain.inverse_dynamics(
                black_box(&position_rad),
                &velocity_rad_s,
                &acceleration_rad_s2,
                &mut torque_nm,
            );
            black_box(&mut torque_nm);
        })
    });
}

fn estimators(criterion: &mut Criterion) {
    let arm = arm();
    let joints = arm.joints.iter();
    let joints: Vec<JointEstimators> = joints
        .map(|joint| JointEstimators::new(joint, PERIOD_S).expect("possible parameters"))
        .collect();
    for kind in Kind::ALL {
        let mut joints = joints.clone();
        let mut cycle = 0;
        criterion.bench_function(&format!("seven joints: {}", kind.name()), |bench| {
            bench.iter(|| {
                cycle += 1;
                estimate(&mut joints, &[kind], &sample(cycle));
            })
        });
    }
    external_torque(criterion, &arm);
    let (mut joints, mut external) = (joints, observer(&arm));
    let mut cycle = 0;
    criterion.bench_function("seven joints: all, and external torque", |bench| {
        bench.iter(|| {
            cycle += 1;
            let sample = sample(cycle);
            let fused = estimate(&mut joints, &Kind::ALL, &sample);
            black_box(external.estimate(&[sample; JOINTS], &fused));
        })
    });
}

fn external_torque(criterion: &mut Criterion, arm: &Robot) {
    let mut external = observer(arm);
    let fused = Estimate {
        torque_nm: 1.0,
        std_nm: Some(0.1),
    };
    let mut cycle = 0;
    criterion.bench_function("seven joints: external torque", |bench| {
        bench.iter(|| {
            cycle += 1;
            let samples = [sample(cycle); JOINTS];
            black_box(external.estimate(&samples, &[Some(fused); JOINTS]));
        })
    });
}

fn observer(arm: &Robot) -> ExternalTorque {
    ExternalTorque::new(arm, PERIOD_S).expect("a possible filter")
}

criterion_group!(benches, yardstick, estimators);
criterion_main!(benches);
