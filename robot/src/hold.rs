//! The robot of which some joints do not move.

use joint_model::rigid_body::Chain;
use nalgebra::{Isometry3, Point3};

use crate::error::{Place, RobotError};
use crate::mass::MassProperties;
use crate::model::{HeldJoint, Lumped, Movement, Part, lump, note_of_held};
use crate::{Control, Effect, Robot};

impl Robot {
    /// The robot of which only these joints move; the others are held at zero and become part of what carries them, as the
    /// joints of a gripper that nobody recorded. Names of no joint are passed over. [`Robot::notes`] says what is held.
    ///
    /// # Errors
    /// [`RobotError`] if no joint is left.
    pub fn moving_only(&self, names: &[&str]) -> Result<Self, RobotError> {
        let moves = |index: usize| names.contains(&self.joints[index].name.as_str());
        let kept: Vec<usize> = (0..self.joints.len())
            .filter(|index| moves(*index))
            .collect();
        if kept.len() == self.joints.len() {
            return Ok(self.clone());
        }
        let place = Place::new(&self.name, "");
        if kept.is_empty() {
            let own = self.joint_names().join(", ");
            return Err(place.invalid(format!(
                "none of its joints is among those that move; it has {own}"
            )));
        }
        let lumped = self.lumped(&moves);
        let (gravity_m_s2, mut tool) = (self.chain.gravity_m_s2(), self.chain.tool());
        let mut shared_effects = self.shared_effects.clone();
        let mut notes = self.notes.clone();
        match last_frame(&lumped) {
            Some(frame) => {
                tool = frame * tool;
                for effect in &mut shared_effects {
                    if let Effect::Payload { centre_m, .. } = effect {
                        *centre_m = (frame * Point3::from(*centre_m)).into();
                    }
                }
            }
            None => notes
                .push("tool and payload are on the last joint that moves, in its frame".to_owned()),
        }
        let held: Vec<HeldJoint> = (0..self.joints.len())
            .filter(|index| !moves(*index))
            .map(|index| HeldJoint {
                name: self.joints[index].name.clone(),
                position: 0.0,
                mimics: None,
                leader_moves: false,
            })
            .collect();
        notes.extend(note_of_held(&held));
        let of_kept = |gains: &[f64]| kept.iter().map(|index| gains[*index]).collect();
        Ok(Self {
            chain: Chain::new(&lumped.links, gravity_m_s2, tool)
                .map_err(|error| place.invalid(error.to_string()))?,
            joints: kept
                .iter()
                .map(|index| self.joints[*index].clone())
                .collect(),
            shared_effects,
            control: self.control.as_ref().map(|control| Control {
                proportional_nm_rad: of_kept(&control.proportional_nm_rad),
                derivative_nm_s_rad: of_kept(&control.derivative_nm_s_rad),
                ..control.clone()
            }),
            notes,
            ..self.clone()
        })
    }

    /// The links with what does not move as part of what carries it.
    pub(crate) fn lumped(&self, moves: &dyn Fn(usize) -> bool) -> Lumped {
        let links = self.chain.links().iter().enumerate();
        let parts: Vec<Part> = links
            .map(|(index, link)| Part {
                parent: link.parent,
                origin: link.origin,
                movement: if moves(index) {
                    Movement::Joint(link.kind, link.axis)
                } else {
                    Movement::Held(link.kind, link.axis, 0.0)
                },
                mass: MassProperties::of(link),
            })
            .collect();
        lump(&parts)
    }

    /// A place in the last link's frame of this robot, where it is known in that of the robot of which only these joints move:
    /// where a payload that was found on that one stands in this one's file.
    pub fn in_last_link(&self, names: &[&str], centre_m: [f64; 3]) -> [f64; 3] {
        let moves = |index: usize| names.contains(&self.joints[index].name.as_str());
        match last_frame(&self.lumped(&moves)) {
            Some(frame) => (frame.inverse() * Point3::from(centre_m)).into(),
            None => centre_m,
        }
    }
}

/// The frame of the last link in that of the last one that moves; none where that does not carry it.
pub(crate) fn last_frame(lumped: &Lumped) -> Option<Isometry3<f64>> {
    match lumped.places.last() {
        Some((Some(link), frame)) if *link + 1 == lumped.links.len() => Some(*frame),
        _ => None,
    }
}
