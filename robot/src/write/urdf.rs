//! A robot as a URDF.

use std::fmt::Write;

use joint_model::rigid_body::{JointKind, Link};
use nalgebra::Vector3;

use super::{
    Symmetric, Written, coulomb_nm, in_attribute, left_out_of_joints, left_out_of_robot, link_name,
    loaded, numbers, roll_pitch_yaw, sum_of, unsaid, vector, viscous_nm_s_rad,
};
use crate::file::down;
use crate::{Effect, Robot, RobotJoint};

/// What URDF wants to be told where a robot file says nothing: limits that nothing reaches.
const NO_LIMIT: f64 = 1e9;

impl Robot {
    /// As a URDF: bodies, limits, friction, and gear ratios as transmissions.
    pub fn to_urdf(&self) -> Written {
        let chain = loaded(self);
        let mut text = format!(
            "<robot name=\"{}\">\n  <link name=\"base\"/>\n",
            in_attribute(&self.name)
        );
        for (index, link) in chain.links().iter().enumerate() {
            let own = link_name(self, Some(index));
            let parent = link_name(self, link.parent);
            text += &link_element(&own, link);
            text += &joint_element(&self.joints[index], link, &parent, &own);
        }
        for joint in self.joints.iter().filter(|joint| joint.gear_ratio != 1.0) {
            let name = in_attribute(&joint.name);
            let _ = writeln!(
                text,
                "  <transmission name=\"{name}_transmission\">\n    \
                 <type>transmission_interface/SimpleTransmission</type>\n    \
                 <joint name=\"{name}\">\n      \
                 <hardwareInterface>hardware_interface/EffortJointInterface</hardwareInterface>\n    \
                 </joint>\n    \
                 <actuator name=\"{name}_motor\">\n      \
                 <mechanicalReduction>{}</mechanicalReduction>\n    </actuator>\n  </transmission>",
                joint.gear_ratio
            );
        }
        text += "</robot>\n";
        let mut left_out = left_out_of_robot(self, "URDF");
        let gravity_m_s2 = chain.gravity_m_s2();
        if gravity_m_s2 != Vector3::from(down()) {
            left_out.push(format!(
                "gravity {} m/s²: URDF has none, and who reads it takes 0 0 -9.81",
                vector(&gravity_m_s2)
            ));
        }
        left_out.extend(left_out_of_joints(self, "URDF", |joint| {
            let is_said = |effect: &Effect| {
                matches!(
                    effect,
                    Effect::CoulombFriction { .. } | Effect::ViscousFriction { .. }
                )
            };
            let mut parts = unsaid(joint, is_said);
            if joint.rotor_inertia_kg_m2 != 0.0 {
                parts.push("rotor inertia".to_owned());
            }
            parts
        }));
        if self.control.is_some() {
            left_out.push("control: URDF has no controller".to_owned());
        }
        Written { text, left_out }
    }
}

fn link_element(name: &str, link: &Link) -> String {
    let i = Symmetric::of(&link.inertia_kg_m2);
    format!(
        "  <link name=\"{name}\">\n    <inertial>\n      <origin xyz=\"{}\"/>\n      \
         <mass value=\"{}\"/>\n      \
         <inertia ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"/>\n    \
         </inertial>\n  </link>\n",
        vector(&link.centre_of_mass_m),
        link.mass_kg,
        i.xx,
        i.xy,
        i.xz,
        i.yy,
        i.yz,
        i.zz
    )
}

fn joint_element(joint: &RobotJoint, link: &Link, parent: &str, child: &str) -> String {
    let limits = joint.position_limit_rad;
    let kind = match (link.kind, limits) {
        (JointKind::Prismatic, _) => "prismatic",
        (JointKind::Revolute, Some(_)) => "revolute",
        (JointKind::Revolute, None) => "continuous",
    };
    let mut text = format!(
        "  <joint name=\"{}\" type=\"{kind}\">\n    <parent link=\"{parent}\"/>\n    \
         <child link=\"{child}\"/>\n    <origin xyz=\"{}\" rpy=\"{}\"/>\n    <axis xyz=\"{}\"/>\n",
        in_attribute(&joint.name),
        vector(&link.origin.translation.vector),
        numbers(&roll_pitch_yaw(&link.origin.rotation)),
        vector(&link.axis)
    );
    let effort_nm = joint
        .torque_limit_nm
        .map(|limit_nm| limit_nm * joint.gear_ratio.abs());
    // what slides must have limits
    let limits = limits.or((kind == "prismatic").then_some([-NO_LIMIT, NO_LIMIT]));
    if limits.is_some() || effort_nm.is_some() || joint.velocity_limit_rad_s.is_some() {
        let ends = limits.map_or(String::new(), |[lower, upper]| {
            format!("lower=\"{lower}\" upper=\"{upper}\" ")
        });
        let _ = writeln!(
            text,
            "    <limit {ends}effort=\"{}\" velocity=\"{}\"/>",
            effort_nm.unwrap_or(NO_LIMIT),
            joint.velocity_limit_rad_s.unwrap_or(NO_LIMIT)
        );
    }
    let (damping, friction) = (sum_of(joint, viscous_nm_s_rad), sum_of(joint, coulomb_nm));
    if damping != 0.0 || friction != 0.0 {
        let _ = writeln!(
            text,
            "    <dynamics damping=\"{damping}\" friction=\"{friction}\"/>"
        );
    }
    text + "  </joint>\n"
}
