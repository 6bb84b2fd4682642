//! Laws that rigid-body dynamics obey whatever the numbers: inverses, gradients, energy, symmetry.

mod rigid_body_chains;

use joint_model::rigid_body::{Chain, LINKS_MAX, Moving, Standing};
use nalgebra::{DMatrix, Vector3};
use proptest::collection::vec;
use proptest::prelude::*;
use rigid_body_chains::{REFERENCE, reference_chain};

type JointValues = [f64; LINKS_MAX];

/// As many values as a chain may have joints; shorter chains read the first of them.
fn joint_values(largest: f64) -> impl Strategy<Value = Vec<f64>> {
    vec(-largest..largest, LINKS_MAX)
}

/// Any chain or tree of the reference.
fn chains() -> impl Strategy<Value = Chain> {
    let (chains, trees) = (&REFERENCE.chains, &REFERENCE.trees);
    (0..chains.len() + trees.len()).prop_map(|index| {
        let chain = chains
            .get(index)
            .unwrap_or_else(|| &trees[index - chains.len()]);
        chain.build()
    })
}

fn torque_nm(
    chain: &Chain,
    position: &[f64],
    velocity: &[f64],
    acceleration: &[f64],
) -> JointValues {
    let mut torque_nm = [0.0; LINKS_MAX];
    chain.inverse_dynamics(position, velocity, acceleration, &mut torque_nm);
    torque_nm
}

fn acceleration_rad_s2(
    chain: &Chain,
    position: &[f64],
    velocity: &[f64],
    torque: &[f64],
) -> JointValues {
    let mut acceleration_rad_s2 = [0.0; LINKS_MAX];
    chain.forward_dynamics(position, velocity, torque, &mut acceleration_rad_s2);
    acceleration_rad_s2
}

fn gravity_torque_nm(chain: &Chain, position: &[f64]) -> JointValues {
    let mut torque_nm = [0.0; LINKS_MAX];
    chain.gravity_torque(position, &mut torque_nm);
    torque_nm
}

fn weightless(chain: &Chain) -> Chain {
    let mut chain = chain.clone();
    chain.set_gravity(Vector3::zeros()).expect("zero is finite");
    chain
}

/// Column by column: the torque of a unit acceleration, at rest and without gravity.
fn mass_matrix_kg_m2(chain: &Chain, position: &[f64]) -> DMatrix<f64> {
    let (chain, count) = (weightless(chain), chain.joint_count());
    DMatrix::from_fn(count, count, |row, column| {
        let mut unit = [0.0; LINKS_MAX];
        unit[column] = 1.0;
        torque_nm(&chain, position, &[0.0; LINKS_MAX], &unit)[row]
    })
}

fn energy_j(chain: &Chain, position: &[f64], velocity: &[f64]) -> f64 {
    let momentum = torque_nm(&weightless(chain), position, &[0.0; LINKS_MAX], velocity);
    let twice_kinetic_j: f64 = momentum.iter().zip(velocity).map(|(p, v)| p * v).sum();
    chain.potential_energy_j(position) + 0.5 * twice_kinetic_j
}

/// Largest difference, relative to the largest expected value.
fn relative_error(found: &[f64], expected: &[f64]) -> f64 {
    let scale = expected
        .iter()
        .fold(0.0_f64, |scale, value| scale.max(value.abs()));
    let error = found
        .iter()
        .zip(expected)
        .fold(0.0_f64, |error, (a, b)| error.max((a - b).abs()));
    error / scale
}

proptest! {
    #[test]
    fn inverse_dynamics_undo_forward_dynamics(
        chain in chains(),
        position in joint_values(3.0),
        velocity in joint_values(2.0),
        applied in joint_values(20.0),
    ) {
        let count = chain.joint_count();
        let acceleration = acceleration_rad_s2(&chain, &position, &velocity, &applied);
        let recovered = torque_nm(&chain, &position, &velocity, &acceleration);
        let error = relative_error(&recovered[..count], &applied[..count]);
        prop_assert!(error < 1e-9, "{error:e}");
    }

    #[test]
    fn one_joint_of_a_heavier_chain_needs_what_the_whole_chain_tells(
        chain in chains(),
        position in joint_values(3.0),
        velocity in joint_values(2.0),
        acceleration in joint_values(20.0),
        place in 0.0..1.0,
    ) {
        let count = chain.joint_count();
        let heavier = chain.with_heavier_link((place * count as f64) as usize, 1.7).expect("a heavier body is one");
        prop_assert!(heavier.moves_as(&chain));
        let mut moving = Moving::default();
        chain.links_moving(&position, &velocity, &acceleration, &mut moving);
        let mut standing = Standing::default();
        chain.links_standing(&position, &mut standing);
        let whole_nm = torque_nm(&heavier, &position, &velocity, &acceleration);
        let gravity_nm = gravity_torque_nm(&heavier, &position);
        for joint in 0..count {
            prop_assert_eq!(heavier.moving_torque_nm(joint, &moving), whole_nm[joint]);
            let carried = heavier.carried(joint, &standing);
            prop_assert_eq!(standing.holding_torque_nm(joint, &carried), gravity_nm[joint]);
            // turned by the joint itself, it carries the same
            let mut turned = position.clone();
            turned[joint] += 0.1;
            chain.links_standing(&turned, &mut standing);
            let turned_nm = gravity_torque_nm(&heavier, &turned)[joint];
            prop_assert_eq!(standing.holding_torque_nm(joint, &carried), turned_nm);
            chain.links_standing(&position, &mut standing);
        }
    }

    #[test]
    fn gravity_torque_is_the_gradient_of_potential_energy(
        chain in chains(),
        position in joint_values(3.0),
    ) {
        const STEP_RAD: f64 = 1e-5;
        let mut gradient_nm = [0.0; LINKS_MAX];
        for joint in 0..chain.joint_count() {
            let energy_beside = |step_rad: f64| {
                let mut beside = position.clone();
                beside[joint] += step_rad;
                chain.potential_energy_j(&beside)
            };
            gradient_nm[joint] = (energy_beside(STEP_RAD) - energy_beside(-STEP_RAD)) / (2.0 * STEP_RAD);
        }
        let error = relative_error(&gradient_nm, &gravity_torque_nm(&chain, &position));
        prop_assert!(error < 1e-6, "{error:e}");
    }

    #[test]
    fn gravity_torque_is_the_inverse_dynamics_at_rest(
        chain in chains(),
        position in joint_values(3.0),
    ) {
        let rest = [0.0; LINKS_MAX];
        let error = relative_error(
            &gravity_torque_nm(&chain, &position),
            &torque_nm(&chain, &position, &rest, &rest),
        );
        prop_assert!(error < 1e-12, "{error:e}");
    }

    #[test]
    fn the_mass_matrix_is_symmetric_and_positive(
        chain in chains(),
        position in joint_values(3.0),
    ) {
        let mass = mass_matrix_kg_m2(&chain, &position);
        prop_assert!((&mass - mass.transpose()).amax() < 1e-12 * mass.amax());
        prop_assert!(mass.cholesky().is_some());
    }

    #[test]
    fn velocity_torques_do_the_work_that_kinetic_energy_takes(
        chain in chains(),
        position in joint_values(3.0),
        velocity in joint_values(1.0),
    ) {
        // Without acceleration and gravity: τ·q̇ = d/dt (½ q̇ᵀ M q̇) along q̇.
        const STEP_S: f64 = 1e-5;
        let count = chain.joint_count();
        let chain = weightless(&chain);
        let energy_at = |time_s: f64| {
            let moved: Vec<f64> = position.iter().zip(&velocity).map(|(q, v)| q + v * time_s).collect();
            energy_j(&chain, &moved, &velocity[..count])
        };
        let rate_w = (energy_at(STEP_S) - energy_at(-STEP_S)) / (2.0 * STEP_S);
        let torque = torque_nm(&chain, &position, &velocity, &[0.0; LINKS_MAX]);
        let power_w: f64 = torque[..count].iter().zip(&velocity).map(|(t, v)| t * v).sum();
        let scale_w: f64 = torque[..count].iter().zip(&velocity).map(|(t, v)| (t * v).abs()).sum();
        prop_assert!((power_w - rate_w).abs() < 1e-6 * scale_w + 1e-8, "{power_w} W is not {rate_w} W");
    }
}

/// One step of the fourth-order Runge-Kutta method without applied torque.
fn fall(chain: &Chain, position: &mut JointValues, velocity: &mut JointValues, step_s: f64) {
    let (start, start_velocity) = (*position, *velocity);
    let moved = |from: &JointValues, rate: &JointValues, time_s: f64| -> JointValues {
        std::array::from_fn(|joint| from[joint] + time_s * rate[joint])
    };
    let (mut rate, mut acceleration) = ([0.0; LINKS_MAX], [0.0; LINKS_MAX]);
    for (fraction, weight) in [(0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)] {
        let stage_position = moved(&start, &rate, fraction * step_s);
        rate = moved(&start_velocity, &acceleration, fraction * step_s);
        acceleration = acceleration_rad_s2(chain, &stage_position, &rate, &[0.0; LINKS_MAX]);
        *position = moved(position, &rate, weight * step_s / 6.0);
        *velocity = moved(velocity, &acceleration, weight * step_s / 6.0);
    }
}

#[test]
fn a_chain_under_other_gravity_moves_in_another_way() {
    let (chain, _) = reference_chain(3);
    assert!(!chain.moves_as(&weightless(&chain)));
    assert!(!chain.moves_as(&reference_chain(2).0));
}

#[test]
fn a_falling_chain_keeps_its_energy() {
    const STEP_S: f64 = 1e-4;
    for count in [1, 2, 3, 7] {
        let (chain, states) = reference_chain(count);
        let (mut position, mut velocity) = ([0.0; LINKS_MAX], [0.0; LINKS_MAX]);
        position[..count].copy_from_slice(&states[0].position_rad);
        let at_start_j = energy_j(&chain, &position, &velocity);
        let potential_at_start_j = chain.potential_energy_j(&position);
        for _ in 0..2000 {
            fall(&chain, &mut position, &mut velocity, STEP_S);
        }
        let exchanged_j = (chain.potential_energy_j(&position) - potential_at_start_j).abs();
        let lost_j = energy_j(&chain, &position, &velocity) - at_start_j;
        assert!(
            exchanged_j > 0.1,
            "{count} joints fell by {exchanged_j} J only"
        );
        assert!(
            lost_j.abs() < 1e-8 * exchanged_j,
            "{count} joints lost {lost_j:e} J of {exchanged_j} J"
        );
    }
}
