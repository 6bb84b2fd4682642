//! Rigid-body dynamics against Pinocchio, an independent library: random chains of 1 to 16 joints, and random trees.

mod rigid_body_chains;

use joint_model::JOINTS_MAX;
use joint_model::rigid_body::Chain;
use nalgebra::Isometry3;
use rigid_body_chains::{REFERENCE, State};

/// Relative to the largest value of the same kind; measured: below 1e-13.
const TOLERANCE: f64 = 1e-11;

fn for_every_state(check: impl Fn(&Chain, &State)) {
    for (index, reference_chain) in REFERENCE.chains.iter().enumerate() {
        let chain = reference_chain.build();
        assert_eq!(chain.joint_count(), index + 1);
        reference_chain
            .states
            .iter()
            .for_each(|state| check(&chain, state));
    }
    for tree in &REFERENCE.trees {
        let chain = tree.build();
        tree.states.iter().for_each(|state| check(&chain, state));
    }
}

#[track_caller]
fn assert_close(found: &[f64], expected: &[f64]) {
    let scale = expected
        .iter()
        .fold(0.0_f64, |scale, value| scale.max(value.abs()));
    let error = found
        .iter()
        .zip(expected)
        .fold(0.0_f64, |error, (a, b)| error.max((a - b).abs()));
    assert!(
        error <= TOLERANCE * scale,
        "{found:?} is not {expected:?}: {error:e} apart, scale {scale}"
    );
}

#[track_caller]
fn assert_same_frame(found: &Isometry3<f64>, expected: &Isometry3<f64>) {
    assert_close(
        found.to_homogeneous().as_slice(),
        expected.to_homogeneous().as_slice(),
    );
}

#[test]
fn the_reference_holds_chains_of_every_length() {
    assert_eq!(REFERENCE.chains.len(), JOINTS_MAX);
}

#[test]
fn inverse_dynamics() {
    for_every_state(|chain, state| {
        let mut torque_nm = vec![f64::NAN; chain.joint_count()];
        chain.inverse_dynamics(
            &state.position_rad,
            &state.velocity_rad_s,
            &state.acceleration_rad_s2,
            &mut torque_nm,
        );
        assert_close(&torque_nm, &state.inverse_dynamics_nm);
    });
}

#[test]
fn gravity_torque() {
    for_every_state(|chain, state| {
        let mut torque_nm = vec![f64::NAN; chain.joint_count()];
        chain.gravity_torque(&state.position_rad, &mut torque_nm);
        assert_close(&torque_nm, &state.gravity_torque_nm);
    });
}

#[test]
fn forward_dynamics() {
    for_every_state(|chain, state| {
        let mut acceleration_rad_s2 = vec![f64::NAN; chain.joint_count()];
        chain.forward_dynamics(
            &state.position_rad,
            &state.velocity_rad_s,
            &state.applied_torque_nm,
            &mut acceleration_rad_s2,
        );
        assert_close(&acceleration_rad_s2, &state.forward_dynamics_rad_s2);
    });
}

#[test]
fn potential_energy() {
    for_every_state(|chain, state| {
        assert_close(
            &[chain.potential_energy_j(&state.position_rad)],
            &[state.potential_energy_j],
        );
    });
}

#[test]
fn frames_of_the_last_joint_and_the_tool() {
    for_every_state(|chain, state| {
        let last = chain.joint_frame(&state.position_rad, chain.joint_count() - 1);
        assert_same_frame(&last, &state.last_joint_frame.isometry());
        assert_same_frame(
            &chain.tool_pose(&state.position_rad),
            &state.tool_pose.isometry(),
        );
    });
}
