//! Effects on what moves: rotor inertia, torques on the link, and the rigid bodies themselves.

use arrayvec::ArrayVec;
use joint_model::joint_spring::JointSpring;
use joint_model::rigid_body::{Chain, ChainError, Link};
use nalgebra::{Isometry3, Vector3};
use robot::effect::parts::{self, Full};
use robot::{Part, changed_chain};

use super::TimedEffect;

/// The most springs of one joint.
const SPRINGS_MAX: usize = 4;

/// What acts at one joint beside the chain's own dynamics.
#[derive(Clone, Debug, Default)]
pub(crate) struct JointLoad {
    /// Added, motor side.
    pub rotor_inertia_kg_m2: f64,
    gravity_sin_nm: f64,
    gravity_cos_nm: f64,
    springs: ArrayVec<JointSpring, SPRINGS_MAX>,
}

impl parts::Load for JointLoad {
    fn add_rotor_inertia(&mut self, inertia_kg_m2: f64) {
        self.rotor_inertia_kg_m2 += inertia_kg_m2;
    }

    fn add_gravity(&mut self, sin_nm: f64, cos_nm: f64) {
        self.gravity_sin_nm += sin_nm;
        self.gravity_cos_nm += cos_nm;
    }

    fn add_spring(&mut self, spring: JointSpring) -> Result<(), Full> {
        Full::push(&mut self.springs, spring)
    }
}

impl JointLoad {
    /// Torque needed to hold the joint against added gravity and springs.
    pub fn holding_nm(&self, link_position_rad: f64) -> f64 {
        let (sin, cos) = link_position_rad.sin_cos();
        let springs = self.springs.iter();
        let springs_nm: f64 = springs
            .map(|spring| spring.holding_nm(link_position_rad))
            .sum();
        self.gravity_sin_nm * sin + self.gravity_cos_nm * cos + springs_nm
    }

    /// Energy whose slope is [`JointLoad::holding_nm`].
    pub fn energy_j(&self, link_position_rad: f64) -> f64 {
        let (sin, cos) = link_position_rad.sin_cos();
        let springs = self.springs.iter();
        let springs_j: f64 = springs
            .map(|spring| spring.energy_j(link_position_rad))
            .sum();
        self.gravity_cos_nm * sin - self.gravity_sin_nm * cos + springs_j
    }
}

/// The chains of a run, each with the time from which it holds; the first from the beginning.
///
/// `effects` come with the joint they name. A payload sits on the last link, wherever it is named.
pub(crate) fn chains(
    links: &[Link],
    gravity_m_s2: Vector3<f64>,
    effects: &[(Option<usize>, TimedEffect)],
) -> Result<Vec<(f64, Chain)>, ChainError> {
    let mut starts_s: Vec<f64> = effects
        .iter()
        .filter(|(_, timed)| timed.effect.part() == Part::Bodies)
        .map(|(_, timed)| timed.start_s.max(0.0))
        .chain([0.0])
        .collect();
    starts_s.sort_by(f64::total_cmp);
    starts_s.dedup();
    starts_s
        .into_iter()
        .map(|start_s| {
            let active = effects.iter().filter(|(_, timed)| timed.start_s <= start_s);
            let tool = Isometry3::identity();
            let effects = active.map(|(joint, timed)| (*joint, &timed.effect));
            Ok((start_s, changed_chain(links, gravity_m_s2, tool, effects)?))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use joint_model::rigid_body::JointKind;
    use nalgebra::Matrix3;
    use robot::Effect;
    use robot::effect::parts::Load;

    use super::*;

    fn pendulum() -> Link {
        Link {
            parent: None,
            kind: JointKind::Revolute,
            origin: Isometry3::identity(),
            axis: Vector3::y_axis(),
            mass_kg: 2.0,
            centre_of_mass_m: Vector3::new(0.0, 0.0, 0.3),
            inertia_kg_m2: Matrix3::from_diagonal(&Vector3::new(0.02, 0.02, 0.004)),
        }
    }

    fn down() -> Vector3<f64> {
        Vector3::new(0.0, 0.0, -9.81)
    }

    fn holding_nm(effect: Option<Effect>, position_rad: f64) -> f64 {
        let effects: Vec<_> = effect
            .map(|effect| (Some(0), TimedEffect::always(effect)))
            .into_iter()
            .collect();
        let chains = chains(&[pendulum()], down(), &effects).expect("a valid chain");
        let mut torque_nm = [0.0];
        chains[0].1.gravity_torque(&[position_rad], &mut torque_nm);
        torque_nm[0]
    }

    #[test]
    fn a_payload_adds_its_lever() {
        let payload = Effect::Payload {
            mass_kg: 1.5,
            centre_m: [0.0, 0.0, 0.5],
        };
        let added_nm = holding_nm(Some(payload), 0.7) - holding_nm(None, 0.7);
        assert!((added_nm + 1.5 * 9.81 * 0.5 * 0.7_f64.sin()).abs() < 1e-9);
    }

    #[test]
    fn a_pitch_turns_the_pendulum_with_the_base() {
        let tilt = Effect::BaseTilt {
            roll_rad: 0.0,
            pitch_rad: 0.2,
        };
        assert!((holding_nm(Some(tilt), 0.5) - holding_nm(None, 0.7)).abs() < 1e-9);
    }

    #[test]
    fn link_inertia_adds_about_the_axis_and_to_nothing_else() {
        let ring = Effect::LinkInertia { inertia_kg_m2: 0.1 };
        assert!((holding_nm(Some(ring), 0.5) - holding_nm(None, 0.5)).abs() < 1e-12);
        let acceleration = |effects: &[_]| {
            let chains = chains(&[pendulum()], Vector3::zeros(), effects).expect("a valid chain");
            let mut acceleration_rad_s2 = [0.0];
            chains[0]
                .1
                .forward_dynamics(&[0.0], &[0.0], &[1.0], &mut acceleration_rad_s2);
            acceleration_rad_s2[0]
        };
        let with_ring = acceleration(&[(Some(0), TimedEffect::always(ring))]);
        assert!((1.0 / with_ring - 1.0 / acceleration(&[]) - 0.1).abs() < 1e-12);
    }

    #[test]
    fn each_start_has_its_chain() {
        let payload = Effect::Payload {
            mass_kg: 1.0,
            centre_m: [0.0; 3],
        };
        let later = (
            None,
            TimedEffect {
                start_s: 2.0,
                ..TimedEffect::always(payload)
            },
        );
        let chains = chains(&[pendulum()], down(), &[later]).expect("valid chains");
        let masses: Vec<_> = chains
            .iter()
            .map(|(start_s, chain)| (*start_s, chain.links()[0].mass_kg))
            .collect();
        assert_eq!(masses, [(0.0, 2.0), (2.0, 3.0)]);
    }

    #[test]
    fn the_added_energy_has_the_added_torque_as_slope() {
        let mut load = JointLoad::default();
        load.add_gravity(2.0, -0.5);
        let spring = JointSpring {
            stiffness_nm_rad: 3.0,
            rest_rad: 0.2,
        };
        load.add_spring(spring).expect("room");
        for q in [-1.0, 0.0, 0.9] {
            let slope_nm = (load.energy_j(q + 1e-6) - load.energy_j(q - 1e-6)) / 2e-6;
            assert!((slope_nm - load.holding_nm(q)).abs() < 1e-6);
        }
    }
}
