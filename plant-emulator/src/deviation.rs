//! The individual behind the robot file: no two arms are alike, and neither is as its data sheet says.
//!
//! Masses, rotor inertias, gear stiffness and every friction value are multiplied by `1 + s·n`, with `s` the plant's
//! `parameter_deviation` and `n` normal, drawn from the seed's own stream of the joint. A link's inertia tensor
//! follows its mass; it and the coordinates of the centre of mass are multiplied by `1 + l·n` each, with `l` the plant's
//! `link_deviation`. Lengths, gear ratios and sensors are exact.

use std::sync::Arc;

use joint_model::friction::{
    FrictionLookup, LoadTorque, LoadTorqueRow, SteadyFriction, StribeckCurve, StribeckRow,
};
use joint_model::rigid_body::Link;
use joint_model::transmission::CatalogueCompliance;
use robot::{Effect, Part, Robot, RobotJoint};

use crate::inject::TimedEffect;
use crate::noise::{Noise, Purpose};
use crate::parameters::{JointPlantParameters, PlantParameters};

/// One joint of the individual.
pub(crate) struct Individual {
    pub rotor_inertia_kg_m2: f64,
    /// What the tables of the robot file give; its effects come on top.
    pub friction: SteadyFriction,
    pub curve: CatalogueCompliance,
    /// Effects of the robot file and of the plant file.
    pub effects: Vec<TimedEffect>,
    pub link: Link,
}

/// Never below a tenth: a huge deviation must not turn a mass negative.
const FACTOR_MIN: f64 = 0.1;

struct Deviation {
    noise: Noise,
    relative: f64,
}

impl Deviation {
    fn factor(&mut self) -> f64 {
        (1.0 + self.relative * self.noise.normal()).max(FACTOR_MIN)
    }

    fn stribeck_row(&mut self, row: &robot::StribeckRow) -> StribeckRow {
        StribeckRow {
            f0_nm: row.f0_nm * self.factor(),
            fv_nm_s_rad: row.fv_nm_s_rad * self.factor(),
            fs_nm: row.fs_nm * self.factor(),
            vc_rad_s: row.vc_rad_s * self.factor(),
        }
    }

    fn load_row(&mut self, row: &robot::LoadTorqueRow) -> LoadTorqueRow {
        let factor = self.factor();
        LoadTorqueRow {
            slopes: row.slopes.map(|slope| slope * factor),
            knees_nm: row.knees_nm,
            zero_load_nm: row.zero_load_nm,
        }
    }

    fn lookup_row(&mut self, row_nm: &[f64]) -> Arc<[f64]> {
        let factor = self.factor();
        row_nm.iter().map(|level_nm| level_nm * factor).collect()
    }

    fn centre_and_inertia(&mut self, link: &mut Link) {
        link.inertia_kg_m2 *= self.factor();
        for coordinate_m in link.centre_of_mass_m.iter_mut() {
            *coordinate_m *= self.factor();
        }
    }

    fn link(&mut self, link: &Link) -> Link {
        let factor = self.factor();
        Link {
            mass_kg: link.mass_kg * factor,
            inertia_kg_m2: link.inertia_kg_m2 * factor,
            ..*link
        }
    }
}

/// Draws the individual's joints and links, base to tip.
pub(crate) fn individual(
    robot: &Robot,
    parameters: &PlantParameters,
    seed: u64,
) -> Vec<Individual> {
    let joints = robot
        .joints
        .iter()
        .zip(&parameters.joints)
        .zip(robot.chain.links());
    joints
        .enumerate()
        .map(|(index, ((file, hidden), link))| {
            let noise = Noise::new(seed, Purpose::Deviation, index);
            let mut deviation = Deviation {
                noise,
                relative: parameters.parameter_deviation,
            };
            let mut individual = Individual {
                link: deviation.link(link),
                rotor_inertia_kg_m2: file.rotor_inertia_kg_m2 * deviation.factor(),
                curve: hidden.curve().scaled(deviation.factor()),
                friction: table_friction(file, hidden, &mut deviation),
                effects: effects(file, hidden, &mut deviation),
            };
            deviation.relative = parameters.link_deviation;
            deviation.centre_and_inertia(&mut individual.link);
            individual
        })
        .collect()
}

fn table_friction(
    file: &RobotJoint,
    hidden: &JointPlantParameters,
    deviation: &mut Deviation,
) -> SteadyFriction {
    let curve = file.direction_friction.as_ref().map(|table| StribeckCurve {
        positive: deviation.stribeck_row(&table.positive),
        negative: deviation.stribeck_row(&table.negative),
    });
    let load_torque = file.load_torque.as_ref().map(|table| LoadTorque {
        positive: deviation.load_row(&table.positive),
        negative: deviation.load_row(&table.negative),
        knee_rounding_nm: hidden.load_knee_rounding_nm,
    });
    let lookup = file.friction_table.as_ref().map(|table| FrictionLookup {
        positive_nm: deviation.lookup_row(&table.positive_nm),
        negative_nm: deviation.lookup_row(&table.negative_nm),
    });
    let unloaded_nm = curve.map_or(0.0, |curve| curve.positive.f0_nm.min(curve.negative.f0_nm));
    let least_nm = hidden.least_friction * unloaded_nm;
    SteadyFriction {
        curve,
        load_torque,
        lookup,
        tables: file.torque_tables(),
        least_nm,
        ..SteadyFriction::default()
    }
}

/// The robot file's effects, with friction off by a factor, and what the plant file adds to them.
fn effects(
    file: &RobotJoint,
    hidden: &JointPlantParameters,
    deviation: &mut Deviation,
) -> Vec<TimedEffect> {
    let mut stiffness_seen = false;
    let known = file.effects.iter().filter(|effect| {
        // the first stiffness is what the plant's own curve stands for; further ones change it
        let is_base = matches!(effect, Effect::TorsionalCompliance { .. }) && !stiffness_seen;
        stiffness_seen |= is_base;
        !is_base
    });
    let mut all: Vec<TimedEffect> = known
        .map(|effect| {
            let factor = if effect.part() == Part::Friction {
                deviation.factor()
            } else {
                1.0
            };
            TimedEffect {
                factor,
                ..TimedEffect::always(*effect)
            }
        })
        .collect();
    let named = |hidden: &Effect| {
        // a look-up table is position-dependent friction in another form
        let in_table = matches!(hidden, Effect::PositionDependentFriction { .. })
            && file.friction_table.is_some();
        in_table
            || file
                .effects
                .iter()
                .any(|known| known.name() == hidden.name())
    };
    all.extend(
        hidden
            .effects
            .iter()
            .filter(|effect| !named(effect))
            .map(|effect| TimedEffect::always(*effect)),
    );
    all
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use joint_model::friction::{DryFriction, Sliding};
    use robot::FrictionTable;

    use super::*;

    #[test]
    fn centres_and_inertias_are_off_by_their_own_deviation_and_nothing_else_changes() {
        let robot = robot::load("pa10").unwrap();
        let exact = PlantParameters::for_robot(&robot).unwrap();
        let off = PlantParameters {
            link_deviation: 0.02,
            ..exact.clone()
        };
        let [exact, off] = [exact, off].map(|parameters| individual(&robot, &parameters, 7));
        for ((exact, off), file) in exact.iter().zip(&off).zip(robot.chain.links()) {
            assert_eq!(exact.link.mass_kg, off.link.mass_kg);
            assert_eq!(exact.rotor_inertia_kg_m2, off.rotor_inertia_kg_m2);
            assert_eq!(exact.link.centre_of_mass_m, file.centre_of_mass_m);
            for (off_m, file_m) in off.link.centre_of_mass_m.iter().zip(&file.centre_of_mass_m) {
                assert!((off_m - file_m).abs() <= 0.1 * file_m.abs());
                assert!(*file_m == 0.0 || off_m != file_m);
            }
            let factor = off.link.inertia_kg_m2[(0, 0)] / exact.link.inertia_kg_m2[(0, 0)];
            assert!(factor != 1.0 && (factor - 1.0).abs() < 0.1, "{factor}");
        }
    }

    #[test]
    fn a_friction_table_is_in_the_plant_and_stands_for_the_hidden_harmonics() {
        let mut robot = robot::load("pa10").unwrap();
        let parameters = PlantParameters::for_robot(&robot).unwrap();
        robot.joints[1].friction_table = Some(FrictionTable {
            positive_nm: vec![5.0, -5.0],
            negative_nm: vec![3.0, -3.0],
        });
        let joints = individual(&robot, &parameters, 7);
        let harmonics = |joint: &Individual| {
            let is_harmonic = |timed: &&TimedEffect| {
                matches!(timed.effect, Effect::PositionDependentFriction { .. })
            };
            joint.effects.iter().filter(is_harmonic).count()
        };
        assert_eq!((harmonics(&joints[0]), harmonics(&joints[1])), (2, 0));
        let lookup = joints[1].friction.lookup.as_ref().unwrap();
        for (velocity_rad_s, file_nm) in [(0.1, 5.0), (-0.1, 3.0)] {
            let found_nm = lookup.level_nm(&Sliding::at(velocity_rad_s));
            // within five of the plant's standard deviations
            assert!((found_nm / file_nm - 1.0).abs() < 5.0 * parameters.parameter_deviation);
        }
    }
}
