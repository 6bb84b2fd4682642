//! A robot as a robot file that needs no other file.

use std::collections::BTreeMap;

use joint_model::rigid_body::{JointKind, Link};

use super::{Symmetric, Written, roll_pitch_yaw};
use crate::error::{Place, RobotError};
use crate::file::{InertiaFile, LinkFile, LinkKind};
use crate::{Robot, RobotFile};

impl Robot {
    /// As a robot file with a `[[link]]` table for each link. Nothing is left out but where the notes say so.
    ///
    /// # Errors
    /// [`RobotError`] for a value that TOML does not have.
    pub fn to_robot_file(&self) -> Result<Written, RobotError> {
        let links = self.chain.links();
        let tool = self.chain.tool();
        let file = RobotFile {
            name: self.name.clone(),
            gravity_m_s2: self.chain.gravity_m_s2().into(),
            parameter_tolerance: self.tolerance.clone(),
            urdf: None,
            mjcf: None,
            held: BTreeMap::new(),
            tool_origin_m: tool.translation.vector.into(),
            tool_origin_rpy_rad: roll_pitch_yaw(&tool.rotation),
            shared_effects: self.shared_effects.clone(),
            control: self.control.clone(),
            drive: self.drive.clone(),
            links: (0..links.len())
                .map(|index| self.link_file(links, index))
                .collect(),
            joints: self.joints.clone(),
        };
        let text = file.to_toml().map_err(|error| {
            Place::new(&self.name, "").invalid(format!("cannot be written as TOML: {error}"))
        })?;
        Ok(Written {
            text,
            left_out: Vec::new(),
        })
    }

    fn link_file(&self, links: &[Link], index: usize) -> LinkFile {
        let link = &links[index];
        let i = Symmetric::of(&link.inertia_kg_m2);
        let name = |index: usize| self.joints[index].name.clone();
        LinkFile {
            joint: name(index),
            parent: (link.parent != Link::serial(index))
                .then(|| link.parent.map_or_else(|| "base".to_owned(), name)),
            kind: match link.kind {
                JointKind::Revolute => LinkKind::Revolute,
                JointKind::Prismatic => LinkKind::Prismatic,
            },
            origin_m: link.origin.translation.vector.into(),
            origin_rpy_rad: roll_pitch_yaw(&link.origin.rotation),
            axis: link.axis.into_inner().into(),
            mass_kg: link.mass_kg,
            centre_of_mass_m: link.centre_of_mass_m.into(),
            inertia_kg_m2: InertiaFile {
                xx: i.xx,
                yy: i.yy,
                zz: i.zz,
                xy: i.xy,
                yz: i.yz,
                xz: i.xz,
            },
        }
    }
}
