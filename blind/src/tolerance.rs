//! What a joint's known values may explain: a gap that they make within their tolerance is none, whatever caused it.

use joint_model::rigid_body::{Chain, Link};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use plant_emulator::PlantParameters;
use robot::{Effect, LoadTorqueRow, Robot, RobotJoint, StribeckRow};

use crate::BlindError;
use crate::bench::{Bench, Run, Setup};
use crate::likeness::dot;

/// Standard deviations, of all values together, within which what they explain is no gap.
const WITHIN: f64 = 3.0;
/// Explained is what they leave at most this part of, rms.
const LEFT: f64 = 0.3;
/// Steps in which the least squares are regularized less and less.
const STEPS: usize = 200;

/// How one joint's disturbance torque changes with each value that the robot file knows of it, by a standard deviation.
pub(crate) struct Tolerance {
    /// Products of the responses.
    matrix: DMatrix<f64>,
    responses: DMatrix<f64>,
}

impl Tolerance {
    /// Of a joint on its trajectory. `exact`: the run of the plant that has the file's values, which it made with this seed.
    ///
    /// # Errors
    /// [`BlindError`].
    pub fn of(
        bench: &Bench<'_>,
        (plant, seed): (&PlantParameters, u64),
        exact: &Run,
        joint: usize,
    ) -> Result<Self, BlindError> {
        let robot = bench.robot;
        let exact_nm = &bench.disturbances_nm(exact)?[joint];
        let mut responses: Vec<DVector<f64>> = Vec::new();
        let mut respond = |nm: &[f64]| {
            let response = nm.iter().zip(exact_nm).map(|(other, exact)| other - exact);
            responses.push(DVector::from_iterator(exact_nm.len(), response));
        };
        let factor = 1.0 + robot.tolerance.default;
        for other in of_joint(&robot.joints[joint], factor) {
            let mut body = robot.clone();
            body.joints[joint] = other;
            let stiffness = PlantParameters::nominal(&body).joints[joint].stiffness_nm_rad;
            let mut plant = plant.clone();
            plant.joints[joint].stiffness_nm_rad = stiffness;
            let setup = Setup {
                body: &body,
                plant: &plant,
                injections: &[],
                disturbance: None,
                seed,
            };
            respond(&bench.disturbances_nm(&bench.run(setup)?)?[joint]);
        }
        for other in with_other_links(robot, joint, factor) {
            // what the arm's bodies ask for along the same motion needs no run
            let bench = Bench {
                robot: &other,
                ..*bench
            };
            respond(&bench.disturbances_nm(exact)?[joint]);
        }
        let responses = DMatrix::from_columns(&responses);
        Ok(Self {
            matrix: responses.transpose() * &responses,
            responses,
        })
    }

    /// Whether the known values explain this change of the disturbance torque within their tolerance.
    pub fn explains(&self, change_nm: &[f64]) -> bool {
        self.within(change_nm).is_some_and(|within| {
            let left = within.left(change_nm);
            left.norm() <= LEFT * dot(change_nm, change_nm).sqrt()
        })
    }

    /// What is left of signals once the known values have taken of this change what they can within their tolerance; none where they
    /// make nothing.
    pub fn within(&self, change_nm: &[f64]) -> Option<Within<'_>> {
        let target = self.taken(change_nm);
        let count = target.len();
        // no deviations are larger than the target over the ridge
        let most = target.norm() / WITHIN;
        let mut ridge = self.matrix.trace().max(most).max(f64::MIN_POSITIVE);
        let mut last = None;
        for _ in 0..STEPS {
            let regular = &self.matrix + DMatrix::identity(count, count) * ridge;
            let Some(regular) = regular.cholesky() else {
                break;
            };
            if regular.solve(&target).norm() > WITHIN {
                break;
            }
            last = Some(regular);
            ridge *= 0.8;
        }
        last.map(|regular| Within { of: self, regular })
    }

    fn taken(&self, nm: &[f64]) -> DVector<f64> {
        self.responses.transpose() * DVector::from_column_slice(nm)
    }
}

/// Known values that move as far as one change asks them to, within their tolerance.
pub(crate) struct Within<'a> {
    of: &'a Tolerance,
    regular: Cholesky<f64, Dyn>,
}

impl Within<'_> {
    fn left(&self, nm: &[f64]) -> DVector<f64> {
        let deviations = self.regular.solve(&self.of.taken(nm));
        DVector::from_column_slice(nm) - &self.of.responses * deviations
    }

    /// The product of two signals where the known values move along, at what their tolerance makes that cost: zero if they make one of
    /// the two for nothing.
    pub fn product(&self, a: &[f64], b: &[f64]) -> f64 {
        dot(a, b) - self.of.taken(a).dot(&self.regular.solve(&self.of.taken(b)))
    }
}

/// A joint with one of its values off, for each.
fn of_joint(file: &RobotJoint, factor: f64) -> Vec<RobotJoint> {
    let mut all = Vec::new();
    let mut with = |change: &dyn Fn(&mut RobotJoint)| {
        let mut other = file.clone();
        change(&mut other);
        if other != *file {
            all.push(other);
        }
    };
    with(&|joint| joint.rotor_inertia_kg_m2 *= factor);
    let values: [fn(&mut StribeckRow) -> &mut f64; 4] = [
        |row| &mut row.f0_nm,
        |row| &mut row.fv_nm_s_rad,
        |row| &mut row.fs_nm,
        |row| &mut row.vc_rad_s,
    ];
    for value in values {
        with(&|joint| {
            if let Some(table) = &mut joint.direction_friction {
                *value(&mut table.positive) *= factor;
            }
        });
        with(&|joint| {
            if let Some(table) = &mut joint.direction_friction {
                *value(&mut table.negative) *= factor;
            }
        });
    }
    let steeper = |row: &mut LoadTorqueRow| row.slopes = row.slopes.map(|slope| slope * factor);
    with(&|joint| {
        if let Some(table) = &mut joint.load_torque {
            steeper(&mut table.positive);
        }
    });
    with(&|joint| {
        if let Some(table) = &mut joint.load_torque {
            steeper(&mut table.negative);
        }
    });
    let higher = |row: &mut Vec<f64>| row.iter_mut().for_each(|level_nm| *level_nm *= factor);
    with(&|joint| {
        if let Some(table) = &mut joint.friction_table {
            higher(&mut table.positive_nm);
            higher(&mut table.negative_nm);
        }
    });
    for k in 0..file.effects.len() {
        for value in 0.. {
            let mut other = file.clone();
            let Some(known) = known_value(&mut other.effects[k], value) else {
                break;
            };
            *known *= factor;
            all.push(other);
        }
    }
    all
}

/// The robot with one value of a link off, for each that the joint carries.
fn with_other_links(robot: &Robot, joint: usize, factor: f64) -> Vec<Robot> {
    let values: [fn(&mut Link) -> &mut f64; 4] = [
        |link| &mut link.mass_kg,
        |link| &mut link.centre_of_mass_m[0],
        |link| &mut link.centre_of_mass_m[1],
        |link| &mut link.centre_of_mass_m[2],
    ];
    let links = robot.chain.links();
    let mut all = Vec::new();
    let mut with = |links: &[Link]| {
        // links that make no body are none that the file could mean
        if let Ok(chain) = Chain::new(links, robot.chain.gravity_m_s2(), robot.chain.tool()) {
            all.push(Robot {
                chain,
                ..robot.clone()
            });
        }
    };
    for carried in joint..links.len() {
        for value in values {
            let mut links = links.to_vec();
            let known = value(&mut links[carried]);
            if *known != 0.0 {
                *known *= factor;
                with(&links);
            }
        }
        let mut links = links.to_vec();
        links[carried].inertia_kg_m2 *= factor;
        with(&links);
    }
    all
}

/// The values of an effect of the file that are known no better than its tolerance.
fn known_value(effect: &mut Effect, number: usize) -> Option<&mut f64> {
    match (effect, number) {
        (
            Effect::CoulombFriction { coulomb_nm: value }
            | Effect::ViscousFriction {
                viscous_nm_s_rad: value,
            }
            | Effect::QuadraticFriction {
                quadratic_nm_s2_rad2: value,
            }
            | Effect::StribeckFriction {
                stribeck_nm: value, ..
            }
            | Effect::AsymmetricFriction {
                asymmetry_nm: value,
            }
            | Effect::LoadDependentFriction {
                load_coefficient: value,
            }
            | Effect::PositionDependentFriction {
                amplitude_nm: value,
                ..
            }
            | Effect::TorsionalCompliance {
                stiffness_nm_rad: value,
            },
            0,
        )
        | (
            Effect::StribeckFriction {
                stribeck_velocity_rad_s: value,
                ..
            },
            1,
        ) => Some(value),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::likeness::common;

    /// Two values, each a wave of its own, one standard deviation of it 1 Nm.
    fn tolerance() -> Tolerance {
        let wave = |per: f64| DVector::from_fn(600, |k, _| (per * k as f64).sin());
        let responses = DMatrix::from_columns(&[wave(0.05), wave(0.13)]);
        Tolerance {
            matrix: responses.transpose() * &responses,
            responses,
        }
    }

    #[test]
    fn what_the_values_make_within_their_tolerance_is_explained_and_nothing_else() {
        let tolerance = tolerance();
        let change = |a: f64, b: f64, other: f64| -> Vec<f64> {
            let mixed = &tolerance.responses * DVector::from_vec(vec![a, b]);
            let other = (0..600).map(|k| other * (0.31 * f64::from(k)).sin());
            mixed.iter().zip(other).map(|(a, b)| a + b).collect()
        };
        assert!(tolerance.explains(&change(1.0, -2.0, 0.0)));
        assert!(tolerance.explains(&change(1.0, -2.0, 0.4)));
        // a part that no value makes is seen
        assert!(!tolerance.explains(&change(1.0, -2.0, 1.2)));
        // so is a value that is further off
        assert!(!tolerance.explains(&change(4.0, -3.0, 0.0)));
        assert!(!tolerance.explains(&change(0.0, 0.0, 0.5)));
    }

    #[test]
    fn a_law_is_held_against_names_where_the_known_values_move_along() {
        let tolerance = tolerance();
        let wave = |per: f64, nm: f64| (0..600).map(move |k| nm * (per * f64::from(k)).sin());
        let sum = |a: f64, b: f64| -> Vec<f64> {
            wave(0.05, a)
                .zip(wave(0.31, b))
                .map(|(a, b)| a + b)
                .collect()
        };
        let law = sum(1.0, 1.0);
        let within = tolerance.within(&law).expect("the values make something");
        let alike = |name: Vec<f64>| common(&law, &[name], |a, b| within.product(a, b));
        // of what the values leave the second part is nearly all
        assert!(alike(sum(0.0, 1.0)) > 0.95, "{}", alike(sum(0.0, 1.0)));
        assert!(alike(sum(1.0, 0.0)) < 0.05, "{}", alike(sum(1.0, 0.0)));
        // without them half of it
        assert!((common(&law, &[sum(0.0, 1.0)], dot) - 0.5).abs() < 0.05);
        // nothing is taken off what is more than they can be
        let law = sum(100.0, 1.0);
        let within = tolerance.within(&law).expect("the values make something");
        let first = common(&law, &[sum(1.0, 0.0)], |a, b| within.product(a, b));
        assert!(first > 0.95, "{first}");
    }
}
