//! Time of one call for an arm of 7 joints and for the longest chain.

#[path = "../tests/rigid_body_chains/mod.rs"]
mod rigid_body_chains;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use joint_model::JOINTS_MAX;
use rigid_body_chains::reference_chain;

fn dynamics(criterion: &mut Criterion) {
    for joint_count in [7, JOINTS_MAX] {
        let (chain, states) = reference_chain(joint_count);
        let state = &states[0];
        let (position, velocity) = (&state.position_rad[..], &state.velocity_rad_s[..]);
        let mut result = vec![0.0; joint_count];
        let mut group = criterion.benchmark_group(format!("{joint_count}_joints"));
        group.bench_function("inverse_dynamics", |bencher| {
            bencher.iter(|| {
                let acceleration = black_box(&state.acceleration_rad_s2[..]);
                black_box(&chain).inverse_dynamics(
                    black_box(position),
                    velocity,
                    acceleration,
                    &mut result,
                );
                black_box(&result);
            });
        });
        group.bench_function("gravity_torque", |bencher| {
            bencher.iter(|| {
                black_box(&chain).gravity_torque(black_box(position), &mut result);
                black_box(&result);
            });
        });
        group.bench_function("forward_dynamics", |bencher| {
            bencher.iter(|| {
                let torque = black_box(&state.applied_torque_nm[..]);
                black_box(&chain).forward_dynamics(
                    black_box(position),
                    velocity,
                    torque,
                    &mut result,
                );
                black_box(&result);
            });
        });
        group.bench_function("tool_pose", |bencher| {
            bencher.iter(|| black_box(&chain).tool_pose(black_box(position)));
        });
        group.finish();
    }
}

criterion_group!(benches, dynamics);
criterion_main!(benches);
