//! The serial chain in a URDF: revolute joints in a row, fixed joints merged into the links they hang on.

use joint_model::rigid_body::{JointKind, Link};
use nalgebra::{Isometry3, Matrix3, Translation3, Unit, UnitQuaternion, Vector3};
use urdf_rs::{Joint, JointType, Pose};

use crate::error::{Place, RobotError};

/// One moving joint of the URDF with the link it carries.
pub struct UrdfLink {
    /// Name of the joint.
    pub joint: String,
    /// The rigid body.
    pub link: Link,
    /// Limits, where the URDF has meaningful ones.
    pub position_limit_rad: Option<[f64; 2]>,
    /// Speed limit, where the URDF has a meaningful one.
    pub velocity_limit_rad_s: Option<f64>,
}

/// Reads the chain out of the URDF's text.
pub fn read_chain(text: &str, file: &str) -> Result<Vec<UrdfLink>, RobotError> {
    let robot = urdf_rs::read_from_string(text).map_err(|error| RobotError::Syntax {
        place: Box::new(Place::new(file, "")),
        what: format!("not a valid URDF: {error}"),
    })?;
    let tree = Tree {
        file,
        robot: &robot,
    };
    tree.check()?;
    let mut chain = Vec::new();
    let mut next = tree.rigid_body(tree.root()?)?.next;
    while let Some((joint, to_joint)) = next {
        let body = tree.rigid_body(&joint.child.link)?;
        chain.push(tree.link(joint, to_joint, &body)?);
        next = body.next;
    }
    if chain.is_empty() {
        return Err(tree
            .place("")
            .invalid("no revolute or continuous joint found; a robot needs at least one"));
    }
    Ok(chain)
}

struct Tree<'a> {
    file: &'a str,
    robot: &'a urdf_rs::Robot,
}

/// One link as part of a body, in the body's frame.
struct Part {
    mass_kg: f64,
    centre_m: Vector3<f64>,
    inertia_kg_m2: Matrix3<f64>,
}

/// A link with all that is fixed to it, in the link's frame.
struct Body<'a> {
    mass_kg: f64,
    centre_m: Vector3<f64>,
    inertia_kg_m2: Matrix3<f64>,
    /// The moving joint at its end, and the pose of that joint's frame.
    next: Option<(&'a Joint, Isometry3<f64>)>,
}

impl<'a> Tree<'a> {
    fn place(&self, within: &str) -> Place {
        Place::new(self.file, within)
    }

    /// Every joint connects links that exist, every link has one parent at most.
    fn check(&self) -> Result<(), RobotError> {
        let links: Vec<String> = self
            .robot
            .links
            .iter()
            .map(|link| link.name.clone())
            .collect();
        if let Some(twice) = (1..links.len()).find(|index| links[..*index].contains(&links[*index]))
        {
            let place = self.place(&format!("link `{}`", links[twice]));
            return Err(place.invalid("two links have this name; give each its own"));
        }
        let mut children: Vec<&str> = Vec::new();
        for joint in &self.robot.joints {
            let place = self.place(&format!("joint `{}`", joint.name));
            for end in [&joint.parent.link, &joint.child.link] {
                if !links.contains(end) {
                    return Err(place.unknown("link", end, &links));
                }
            }
            if children.contains(&joint.child.link.as_str()) {
                return Err(place.invalid(format!(
                    "link `{}` has two parents; only serial chains are supported",
                    joint.child.link
                )));
            }
            children.push(&joint.child.link);
        }
        Ok(())
    }

    fn root(&self) -> Result<&'a str, RobotError> {
        let is_child = |name: &str| {
            self.robot
                .joints
                .iter()
                .any(|joint| joint.child.link == name)
        };
        let roots: Vec<&str> = self
            .robot
            .links
            .iter()
            .map(|link| link.name.as_str())
            .filter(|name| !is_child(name))
            .collect();
        match roots.as_slice() {
            [root] => self.all_hang_on(root).map(|()| *root),
            [] => Err(self
                .place("")
                .invalid("no base link: every link is a joint's child, so the joints form a loop")),
            _ => {
                let roots = roots.join("`, `");
                Err(self.place("").invalid(format!(
                    "several base links: `{roots}`; connect them, or remove all but one"
                )))
            }
        }
    }

    /// With one parent each, links that cannot be reached from the base form loops.
    fn all_hang_on(&self, root: &str) -> Result<(), RobotError> {
        let mut reached = vec![root];
        let mut next = 0;
        while let Some(name) = reached.get(next).copied() {
            let below = self
                .robot
                .joints
                .iter()
                .filter(|joint| joint.parent.link == name);
            reached.extend(below.map(|joint| joint.child.link.as_str()));
            next += 1;
        }
        match self
            .robot
            .links
            .iter()
            .find(|link| !reached.contains(&link.name.as_str()))
        {
            Some(link) => {
                let place = self.place(&format!("link `{}`", link.name));
                Err(place.invalid(format!(
                    "not connected to the base link `{root}` but part of a loop; break the loop"
                )))
            }
            None => Ok(()),
        }
    }

    /// Merges the links that are fixed to `base`. Links were checked to have one parent, so this ends.
    fn rigid_body(&self, base: &str) -> Result<Body<'a>, RobotError> {
        let mut parts: Vec<Part> = Vec::new();
        let mut moving: Vec<(&Joint, Isometry3<f64>)> = Vec::new();
        let mut open = vec![(base, Isometry3::identity())];
        while let Some((name, pose)) = open.pop() {
            parts.extend(self.part(name, &pose)?);
            for joint in self
                .robot
                .joints
                .iter()
                .filter(|joint| joint.parent.link == name)
            {
                let to_joint = pose * isometry(&joint.origin);
                match joint.joint_type {
                    JointType::Fixed => open.push((&joint.child.link, to_joint)),
                    JointType::Revolute | JointType::Continuous => moving.push((joint, to_joint)),
                    ref other => {
                        let place = self.place(&format!("joint `{}`", joint.name));
                        let other = format!("{other:?}").to_lowercase();
                        return Err(place.invalid(format!(
                            "type {other} is not supported; make it revolute, continuous or fixed"
                        )));
                    }
                }
            }
        }
        if moving.len() > 1 {
            let names: Vec<&str> = moving
                .iter()
                .map(|(joint, _)| joint.name.as_str())
                .collect();
            let what = format!(
                "joints `{}` all hang on link `{base}`; only serial chains are supported, make all but one fixed",
                names.join("`, `")
            );
            return Err(self.place("").invalid(what));
        }
        Ok(merge(&parts, moving.pop()))
    }

    /// Mass, centre and inertia of one link in the body's frame; nothing where the link has no mass.
    fn part(&self, name: &str, pose: &Isometry3<f64>) -> Result<Option<Part>, RobotError> {
        let Some(link) = self.robot.links.iter().find(|link| link.name == name) else {
            return Ok(None);
        };
        let to_centre = pose * isometry(&link.inertial.origin);
        let i = &link.inertial.inertia;
        let about_centre = Matrix3::new(
            i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz,
        );
        let turn = to_centre.rotation.to_rotation_matrix();
        let inertia_kg_m2 = turn * about_centre * turn.transpose();
        let centre_m = to_centre.translation.vector;
        let mass_kg = link.inertial.mass.value;
        let finite =
            mass_kg.is_finite() && inertia_kg_m2.iter().chain(&centre_m).all(|x| x.is_finite());
        if !finite || mass_kg < 0.0 {
            let place = self.place(&format!("link `{name}`"));
            let rule = "must be zero or above, and origin and inertia finite";
            return Err(place.invalid(format!("mass {mass_kg} kg {rule}")));
        }
        Ok((mass_kg > 0.0).then_some(Part {
            mass_kg,
            centre_m,
            inertia_kg_m2,
        }))
    }

    fn link(
        &self,
        joint: &Joint,
        origin: Isometry3<f64>,
        body: &Body,
    ) -> Result<UrdfLink, RobotError> {
        let place = self.place(&format!("joint `{}`", joint.name));
        if joint.mimic.is_some() {
            return Err(place.invalid("mimic joints are not supported; make it fixed"));
        }
        let axis = Unit::try_new(Vector3::from(joint.axis.xyz.0), 1e-9)
            .filter(|axis| axis.iter().all(|x| x.is_finite()))
            .ok_or_else(|| {
                place.invalid(format!(
                    "axis {:?} must be finite and not zero",
                    joint.axis.xyz.0
                ))
            })?;
        let (low, high, speed) = (joint.limit.lower, joint.limit.upper, joint.limit.velocity);
        let limited = joint.joint_type == JointType::Revolute
            && low.is_finite()
            && high.is_finite()
            && low < high;
        Ok(UrdfLink {
            joint: joint.name.clone(),
            link: Link {
                parent: None,
                kind: JointKind::Revolute,
                origin,
                axis,
                mass_kg: body.mass_kg,
                centre_of_mass_m: body.centre_m,
                inertia_kg_m2: body.inertia_kg_m2,
            },
            position_limit_rad: limited.then_some([low, high]),
            velocity_limit_rad_s: (speed.is_finite() && speed > 0.0).then_some(speed),
        })
    }
}

fn isometry(pose: &Pose) -> Isometry3<f64> {
    let [roll, pitch, yaw] = pose.rpy.0;
    Isometry3::from_parts(
        Translation3::from(pose.xyz.0),
        UnitQuaternion::from_euler_angles(roll, pitch, yaw),
    )
}

/// Adds the parts up about their common centre (parallel-axis theorem).
fn merge<'a>(parts: &[Part], next: Option<(&'a Joint, Isometry3<f64>)>) -> Body<'a> {
    let mass_kg: f64 = parts.iter().map(|part| part.mass_kg).sum();
    let moment: Vector3<f64> = parts.iter().map(|part| part.centre_m * part.mass_kg).sum();
    let centre_m = if mass_kg > 0.0 {
        moment / mass_kg
    } else {
        Vector3::zeros()
    };
    let about_common_centre = |part: &Part| {
        let lever = part.centre_m - centre_m;
        let shift = Matrix3::identity() * lever.norm_squared() - lever * lever.transpose();
        part.inertia_kg_m2 + part.mass_kg * shift
    };
    Body {
        mass_kg,
        centre_m,
        inertia_kg_m2: parts.iter().map(about_common_centre).sum(),
        next,
    }
}
