//! The rigid bodies of a recorded arm: the robot file's links, its shared effects, and what hung at the flange.

use joint_model::rigid_body::{Chain, ChainError, Link};
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};
use recording::Recording;
use robot::{Effect, Robot};

use crate::IdentificationError;

/// What hangs at the flange.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Payload {
    /// Its mass; zero for the bare arm.
    pub mass_kg: f64,
    /// Its centre in the last link's frame, as the effect `payload` has it.
    pub centre_m: [f64; 3],
}

/// One recording of slow motion, and what hung at the flange.
#[derive(Clone, Copy, Debug)]
pub struct Sweep<'a> {
    /// The recording; the other joints may stand or move slowly too.
    pub recording: &'a Recording,
    /// The payload it was made with.
    pub payload: Payload,
}

/// Metadata of a recording: mass of the payload in kg.
pub const PAYLOAD_KEY: &str = "payload_kg";

/// Metadata of a recording: centre of the payload in the last link's frame, in m, as `x, y, z`.
pub const PAYLOAD_CENTRE_KEY: &str = "payload_centre_m";

impl Payload {
    /// What the recorder wrote: metadata [`PAYLOAD_KEY`] and, if that is not zero, [`PAYLOAD_CENTRE_KEY`].
    ///
    /// # Errors
    /// [`IdentificationError::PayloadMissing`] if either is missing or no number.
    pub fn of(recording: &Recording) -> Result<Self, IdentificationError> {
        let numbers = |key: &'static str, count: usize| {
            let text = recording.metadata.get(key);
            let parsed: Option<Vec<f64>> = text.and_then(|text| {
                let numbers = text.split(',').map(|part| part.trim().parse().ok());
                numbers.collect()
            });
            parsed
                .filter(|found| found.len() == count && found.iter().all(|x| x.is_finite()))
                .ok_or_else(|| IdentificationError::PayloadMissing {
                    key,
                    found: text.cloned(),
                })
        };
        let mass_kg = numbers(PAYLOAD_KEY, 1)?[0];
        if mass_kg == 0.0 {
            return Ok(Self::default());
        }
        let centre_m = numbers(PAYLOAD_CENTRE_KEY, 3)?;
        Ok(Self {
            mass_kg,
            centre_m: [centre_m[0], centre_m[1], centre_m[2]],
        })
    }
}

/// A body of which only gravity matters.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PointMass {
    pub mass_kg: f64,
    /// In the last link's frame.
    pub centre_m: Vector3<f64>,
}

impl From<&Payload> for PointMass {
    fn from(payload: &Payload) -> Self {
        Self {
            mass_kg: payload.mass_kg,
            centre_m: Vector3::from(payload.centre_m),
        }
    }
}

/// The payloads that the robot file knows.
pub(crate) fn known_payloads(robot: &Robot) -> Vec<PointMass> {
    let payload = |effect: &Effect| match *effect {
        Effect::Payload { mass_kg, centre_m } => Some(PointMass {
            mass_kg,
            centre_m: Vector3::from(centre_m),
        }),
        _ => None,
    };
    robot.shared_effects.iter().filter_map(payload).collect()
}

/// Free fall in the frame of the base, which may be tilted: it rolls about its x axis, then pitches about the y axis
/// of the world.
pub(crate) fn base_gravity_m_s2(robot: &Robot) -> Vector3<f64> {
    let mut gravity_m_s2 = robot.chain.gravity_m_s2();
    for effect in &robot.shared_effects {
        if let Effect::BaseTilt {
            roll_rad,
            pitch_rad,
        } = *effect
        {
            let tilt = UnitQuaternion::from_euler_angles(roll_rad, pitch_rad, 0.0);
            gravity_m_s2 = tilt.inverse() * gravity_m_s2;
        }
    }
    gravity_m_s2
}

/// A chain for gravity torques: links of these masses, and point masses on the last one.
pub(crate) fn gravity_chain(
    links: &[Link],
    gravity_m_s2: Vector3<f64>,
    payloads: &[PointMass],
) -> Result<Chain, ChainError> {
    let mut links = links.to_vec();
    if let Some(last) = links.last_mut() {
        payloads.iter().for_each(|payload| add(last, payload));
    }
    Chain::new(&links, gravity_m_s2, Isometry3::identity())
}

/// The robot file's arm with this payload at its flange.
pub(crate) fn loaded_chain(robot: &Robot, payload: &Payload) -> Result<Chain, ChainError> {
    let mut payloads = known_payloads(robot);
    payloads.push(PointMass::from(payload));
    gravity_chain(robot.chain.links(), base_gravity_m_s2(robot), &payloads)
}

/// The link without mass: its place in the chain.
pub(crate) fn massless(link: &Link) -> Link {
    Link {
        mass_kg: 0.0,
        centre_of_mass_m: Vector3::zeros(),
        inertia_kg_m2: Matrix3::zeros(),
        ..*link
    }
}

/// Masses add up, and centres by mass. The inertia stays: gravity does not see it.
fn add(link: &mut Link, payload: &PointMass) {
    let total_kg = link.mass_kg + payload.mass_kg;
    if total_kg != 0.0 {
        let moment_kg_m = link.centre_of_mass_m * link.mass_kg + payload.centre_m * payload.mass_kg;
        link.centre_of_mass_m = moment_kg_m / total_kg;
    }
    link.mass_kg = total_kg;
}
