//! Time of one call for the PA-10, for an arm of 7 joints with arbitrary axes, and for the longest chain.
//!
//! The PA-10's results are printed first: `benches/peers/run` compares them with another library's.

#[path = "../tests/rigid_body_chains/mod.rs"]
mod rigid_body_chains;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use joint_model::JOINTS_MAX;
use joint_model::rigid_body::Chain;
use rigid_body_chains::{State, reference_chain};

fn inverse_dynamics(chain: &Chain, state: &State, torque_nm: &mut [f64]) {
    let (position, velocity) = (&state.position_rad, &state.velocity_rad_s);
    chain.inverse_dynamics(position, velocity, &state.acceleration_rad_s2, torque_nm);
}

fn gravity_torque(chain: &Chain, state: &State, torque_nm: &mut [f64]) {
    chain.gravity_torque(&state.position_rad, torque_nm);
}

fn forward_dynamics(chain: &Chain, state: &State, acceleration_rad_s2: &mut [f64]) {
    let (position, velocity) = (&state.position_rad, &state.velocity_rad_s);
    chain.forward_dynamics(
        position,
        velocity,
        &state.applied_torque_nm,
        acceleration_rad_s2,
    );
}

type Algorithm = fn(&Chain, &State, &mut [f64]);

const ALGORITHMS: [(&str, Algorithm); 3] = [
    ("inverse_dynamics", inverse_dynamics),
    ("gravity_torque", gravity_torque),
    ("forward_dynamics", forward_dynamics),
];

fn pa10(criterion: &mut Criterion) {
    let chain = robot::load("pa10").expect("the shipped robot loads").chain;
    let (_, states) = reference_chain(chain.joint_count());
    for (name, algorithm) in ALGORITHMS {
        let mut result = vec![0.0; chain.joint_count()];
        algorithm(&chain, &states[0], &mut result);
        println!("result {name} {result:?}");
    }
    bench(criterion, "pa10", &chain, &states[0]);
}

fn arbitrary_chains(criterion: &mut Criterion) {
    for joint_count in [7, JOINTS_MAX] {
        let (chain, states) = reference_chain(joint_count);
        bench(
            criterion,
            &format!("{joint_count}_joints"),
            &chain,
            &states[0],
        );
    }
}

fn bench(criterion: &mut Criterion, name: &str, chain: &Chain, state: &State) {
    let mut group = criterion.benchmark_group(name);
    for (name, algorithm) in ALGORITHMS {
        let mut result = vec![0.0; chain.joint_count()];
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                algorithm(black_box(chain), black_box(state), &mut result);
                black_box(&result);
            });
        });
    }
    group.bench_function("tool_pose", |bencher| {
        bencher.iter(|| black_box(chain).tool_pose(black_box(&state.position_rad)));
    });
    group.finish();
}

criterion_group!(benches, pa10, arbitrary_chains);
criterion_main!(benches);
