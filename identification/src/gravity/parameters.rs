//! The parameters of gravity and what torque each of them makes.
//!
//! Gravity torque is linear in each link's mass `m` and first moment `m·c`, so the torque of one parameter is that of a
//! chain of which only this parameter is not zero. Parameters are counted link by link as `m·c_x, m·c_y, m·c_z, m`, and
//! in units of how well the robot file knows them (one standard deviation), so that the smallest change is the likeliest.

use joint_model::JOINTS_MAX;
use joint_model::rigid_body::{Chain, ChainError, Link};
use nalgebra::{DVector, Vector3};
use robot::Robot;

use super::Quantity;
use crate::loaded_arm::{
    Payload, PointMass, base_gravity_m_s2, gravity_chain, known_payloads, massless,
};

/// Parameters of one link.
pub(super) const PER_LINK: usize = 4;

/// In the order of a link's parameters.
pub(super) const QUANTITIES: [Quantity; PER_LINK] = [
    Quantity::MomentX,
    Quantity::MomentY,
    Quantity::MomentZ,
    Quantity::Mass,
];

/// The robot file's values, how well it knows them, and the chains that make the columns.
pub(super) struct Parameters {
    /// kg m and kg.
    pub file: DVector<f64>,
    /// Standard deviation by the file's tolerance; zero for the parameters of a link without mass, which stay.
    pub tolerance: DVector<f64>,
    /// For each link, the chain with 1 kg at its origin, then at a distance of 1 m along x, y and z.
    unit_chains: Vec<[Chain; PER_LINK]>,
    bare: Vec<Link>,
    gravity_m_s2: Vector3<f64>,
    known_payloads: Vec<PointMass>,
}

impl Parameters {
    pub fn of(robot: &Robot) -> Result<Self, ChainError> {
        let links = robot.chain.links();
        let gravity_m_s2 = base_gravity_m_s2(robot);
        let bare: Vec<Link> = links.iter().map(massless).collect();
        let unit_chain = |index: usize, centre_m: Vector3<f64>| {
            let mut bare = bare.clone();
            bare[index].mass_kg = 1.0;
            bare[index].centre_of_mass_m = centre_m;
            gravity_chain(&bare, gravity_m_s2, &[])
        };
        let unit_chains = (0..links.len()).map(|index| {
            Ok([
                unit_chain(index, Vector3::zeros())?,
                unit_chain(index, Vector3::x())?,
                unit_chain(index, Vector3::y())?,
                unit_chain(index, Vector3::z())?,
            ])
        });
        Ok(Self {
            file: values(links.iter().flat_map(file_values)),
            tolerance: values(tolerances(robot)),
            unit_chains: unit_chains.collect::<Result<_, ChainError>>()?,
            bare,
            gravity_m_s2,
            known_payloads: known_payloads(robot),
        })
    }

    pub fn count(&self) -> usize {
        self.file.len()
    }

    pub fn joints(&self) -> usize {
        self.bare.len()
    }

    /// Nothing but what hung at the flange and what the file says hangs there.
    pub fn payload_chain(&self, payload: &Payload) -> Result<Chain, ChainError> {
        let mut payloads = self.known_payloads.clone();
        payloads.push(PointMass::from(payload));
        gravity_chain(&self.bare, self.gravity_m_s2, &payloads)
    }

    /// Torque about one joint's axis per unit of each parameter.
    pub fn torques_nm(&self, position_rad: &[f64], joint: usize) -> impl Iterator<Item = f64> {
        let torque_nm = move |chain: &Chain| {
            let mut torques_nm = [0.0; JOINTS_MAX];
            chain.gravity_torque(position_rad, &mut torques_nm[..position_rad.len()]);
            torques_nm[joint]
        };
        self.unit_chains.iter().flat_map(move |[mass, x, y, z]| {
            let mass_nm = torque_nm(mass);
            let moment_nm = |chain: &Chain| torque_nm(chain) - mass_nm;
            [moment_nm(x), moment_nm(y), moment_nm(z), mass_nm]
        })
    }
}

fn values(values: impl Iterator<Item = f64>) -> DVector<f64> {
    DVector::from_vec(values.collect())
}

fn file_values(link: &Link) -> [f64; PER_LINK] {
    let moment = link.centre_of_mass_m * link.mass_kg;
    [moment.x, moment.y, moment.z, link.mass_kg]
}

/// A centre is known to its tolerance times the size of the arm's longest link, in every direction: one that the file
/// puts on an axis is not known without error.
fn tolerances(robot: &Robot) -> impl Iterator<Item = f64> {
    let links = robot.chain.links();
    let sizes_m = links.iter().flat_map(|link| {
        [
            link.origin.translation.vector.norm(),
            link.centre_of_mass_m.norm(),
        ]
    });
    let size_m = sizes_m.fold(0.0, f64::max);
    let (mass, centre) = (
        robot.tolerance.of("mass_kg"),
        robot.tolerance.of("centre_of_mass_m"),
    );
    links.iter().flat_map(move |link| {
        let moment = centre * size_m * link.mass_kg;
        [moment, moment, moment, mass * link.mass_kg]
    })
}
