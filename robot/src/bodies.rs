//! Effects on the rigid bodies, put into the chain: payload, added link inertia, tilt of the base.

use joint_model::friction::SteadyFriction;
use joint_model::rigid_body::{Chain, ChainError, JointKind, Link, is_inertia_of_a_body};
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};

use crate::effect::parts::{Actuator, Bus, Gear, JointParts, Load, Sensors, Warming};
use crate::{Effect, Robot};

/// The arm's bodies, for effects to change.
pub struct Bodies {
    links: Vec<Link>,
    gravity_m_s2: Vector3<f64>,
    /// Of the effect that acts.
    joint: Option<usize>,
}

impl Bodies {
    /// A point mass in the last link's frame.
    pub(crate) fn add_payload(&mut self, mass_kg: f64, centre_m: Vector3<f64>) {
        if let Some(last) = self.links.last_mut() {
            last.add_point_mass(mass_kg, centre_m);
        }
    }

    /// About the axis of the joint that the effect names.
    pub(crate) fn add_inertia(&mut self, inertia_kg_m2: f64) {
        if let Some(link) = self.joint.and_then(|joint| self.links.get_mut(joint)) {
            match link.kind {
                JointKind::Revolute => add_ring(link, inertia_kg_m2),
                // what resists acceleration along the axis is mass
                JointKind::Prismatic => link.mass_kg += inertia_kg_m2,
            }
        }
    }

    /// The base rolls about its x axis, then pitches about the y axis of the world.
    pub(crate) fn tilt(&mut self, roll_rad: f64, pitch_rad: f64) {
        let tilt = UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, 0.0);
        self.gravity_m_s2 = tilt.inverse() * self.gravity_m_s2;
    }
}

/// Bodies alone: other parts are each joint's own.
impl JointParts for Bodies {
    fn friction(&mut self) -> Option<&mut SteadyFriction> {
        None
    }

    fn warming(&mut self) -> Option<&mut dyn Warming> {
        None
    }

    fn gear(&mut self) -> Option<&mut dyn Gear> {
        None
    }

    fn actuator(&mut self) -> Option<&mut dyn Actuator> {
        None
    }

    fn load(&mut self) -> Option<&mut dyn Load> {
        None
    }

    fn bodies(&mut self) -> Option<&mut Self> {
        Some(self)
    }

    fn sensors(&mut self) -> Option<&mut dyn Sensors> {
        None
    }

    fn bus(&mut self) -> Option<&mut dyn Bus> {
        None
    }
}

/// A chain of links with these effects on them; effects on other parts change nothing. Link inertia names its joint, a
/// payload sits on the last link whatever it names.
///
/// # Errors
/// [`ChainError`] if no body could be like that, such as one of negative mass.
pub fn changed_chain<'a>(
    links: &[Link],
    gravity_m_s2: Vector3<f64>,
    tool: Isometry3<f64>,
    effects: impl IntoIterator<Item = (Option<usize>, &'a Effect)>,
) -> Result<Chain, ChainError> {
    let mut bodies = Bodies {
        links: links.to_vec(),
        gravity_m_s2,
        joint: None,
    };
    for (joint, effect) in effects {
        bodies.joint = joint;
        let acted = effect.act(&mut bodies, 1.0);
        assert!(acted.is_ok(), "bodies take any number of effects");
    }
    Chain::new(&bodies.links, bodies.gravity_m_s2, tool)
}

/// Adds inertia about the joint's axis as a massless thin ring around it, the one body that adds least elsewhere. A slender link has no
/// ring to take away: its mass is drawn to the axis instead.
fn add_ring(link: &mut Link, inertia_kg_m2: f64) {
    let axis = link.axis.into_inner();
    let along = axis * axis.transpose();
    let across = Matrix3::identity() - along;
    let ringed = link.inertia_kg_m2 + inertia_kg_m2 * (along + 0.5 * across);
    let drawn = 1.0 + inertia_kg_m2 / axis.dot(&(link.inertia_kg_m2 * axis));
    let can_be_drawn = !is_inertia_of_a_body(&ringed) && drawn > 0.0;
    link.inertia_kg_m2 = if can_be_drawn {
        let draw = drawn.sqrt() * across + along;
        let spread = 0.5 * link.inertia_kg_m2.trace() * Matrix3::identity() - link.inertia_kg_m2;
        let spread = draw * spread * draw;
        spread.trace() * Matrix3::identity() - spread
    } else {
        ringed
    };
}

impl Robot {
    /// The arm as its file has it, effects on the rigid bodies included; [`Robot::chain`] is without them.
    ///
    /// # Errors
    /// [`ChainError`]; never of a robot that was built from a file.
    pub fn loaded_chain(&self) -> Result<Chain, ChainError> {
        let own =
            self.joints.iter().enumerate().flat_map(|(joint, file)| {
                file.effects.iter().map(move |effect| (Some(joint), effect))
            });
        let shared = self.shared_effects.iter().map(|effect| (None, effect));
        changed_chain(
            self.chain.links(),
            self.chain.gravity_m_s2(),
            self.chain.tool(),
            own.chain(shared),
        )
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use super::*;

    fn holding_nm(chain: &Chain, position_rad: f64) -> f64 {
        let mut torque_nm = [0.0];
        chain.gravity_torque(&[position_rad], &mut torque_nm);
        torque_nm[0]
    }

    #[test]
    fn a_payload_hangs_on_its_lever_and_a_tilt_turns_gravity() {
        let mut robot = crate::load("shd17").unwrap();
        let bare_nm = holding_nm(&robot.chain, 0.5);
        assert_eq!(holding_nm(&robot.loaded_chain().unwrap(), 0.5), bare_nm);
        robot.shared_effects.push(Effect::Payload {
            mass_kg: 2.0,
            centre_m: [0.0, 0.0, 0.3],
        });
        let lever_nm = 2.0 * 9.81 * 0.3 * 0.5_f64.sin();
        let loaded_nm = holding_nm(&robot.loaded_chain().unwrap(), 0.5);
        assert!((loaded_nm - bare_nm).abs() - lever_nm.abs() < 1e-9);
        assert!((loaded_nm / bare_nm - 1.0) * bare_nm.abs() > 0.9 * lever_nm);
        robot.shared_effects = vec![Effect::BaseTilt {
            roll_rad: 0.0,
            pitch_rad: 0.5,
        }];
        let tilted = robot.loaded_chain().unwrap();
        let upright_nm = [0.0, 1.0].map(|rad| holding_nm(&robot.chain, rad));
        let tilted_nm = holding_nm(&tilted, 0.5);
        let near = upright_nm.map(|nm| (nm - tilted_nm).abs() < 1e-9);
        assert!(near[0] || near[1], "{tilted_nm} {upright_nm:?}");
    }

    #[test]
    fn link_inertia_is_about_its_own_joint() {
        let mut robot = crate::load("shd17").unwrap();
        robot.joints[0]
            .effects
            .push(Effect::LinkInertia { inertia_kg_m2: 0.2 });
        let inertia = |chain: &Chain| {
            let mut torque_nm = [0.0];
            chain.inverse_dynamics(&[0.0], &[0.0], &[1.0], &mut torque_nm);
            torque_nm[0]
        };
        let added = inertia(&robot.loaded_chain().unwrap()) - inertia(&robot.chain);
        assert!((added - 0.2).abs() < 1e-12, "{added}");
    }

    #[test]
    fn less_inertia_than_a_slender_link_has_around_it_draws_it_to_the_axis() {
        let mut link = crate::load("shd17").unwrap().chain.links()[0];
        link.inertia_kg_m2 = Matrix3::from_diagonal(&Vector3::new(0.02, 0.02, 0.001));
        let axis = link.axis.into_inner();
        for change in [-0.005, -0.019] {
            let mut lighter = link;
            add_ring(&mut lighter, change);
            assert!(is_inertia_of_a_body(&lighter.inertia_kg_m2), "{change}");
            let about_axis = axis.dot(&(lighter.inertia_kg_m2 * axis));
            assert!((about_axis - 0.02 - change).abs() < 1e-12, "{about_axis}");
        }
        // nobody has less than nothing
        add_ring(&mut link, -0.03);
        assert!(!is_inertia_of_a_body(&link.inertia_kg_m2));
    }
}
