//! The chain: its links, joint frames, gravity and tool.

use nalgebra::{Isometry3, Matrix3, SymmetricEigen, Unit, Vector3};

use super::body::{Body, bodies};

/// The most links a chain may have, two arms with all their fingers; every buffer of the algorithms is sized by it.
pub const LINKS_MAX: usize = 128;

/// How far an inertia may be from symmetric or from positive semidefinite, relative to its largest element:
/// rounding of a rotated or summed inertia, and no more.
const ROUNDING: f64 = 1e-9;

/// How far a principal moment may exceed the sum of the others, relative to itself. Two moments of a flat body
/// add up to the third; written with four significant digits they miss it by up to 5e-4 each.
const TRIANGLE_TOLERANCE: f64 = 1e-3;

/// How far an axis or quaternion may be from unit length: rounding in single precision.
const UNIT_LENGTH_TOLERANCE: f64 = 1e-6;

/// How a joint moves its link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum JointKind {
    /// It turns about its axis: rad, Nm, kg m².
    #[default]
    Revolute,
    /// It slides along its axis: what is said of it in rad, Nm and kg m² is then m, N and kg.
    Prismatic,
}

/// One moving link and the joint that carries it.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// Index of the link that carries this one, smaller than its own; `None` for the base. In a serial chain that is
    /// the link before: see [`Link::serial`].
    pub parent: Option<usize>,
    /// How the joint moves.
    pub kind: JointKind,
    /// The joint frame in the parent link's frame (in the base's, where that is the parent), with the joint at zero.
    pub origin: Isometry3<f64>,
    /// The joint's axis in the joint frame.
    pub axis: Unit<Vector3<f64>>,
    /// Mass of the link.
    pub mass_kg: f64,
    /// Centre of mass in the joint frame.
    pub centre_of_mass_m: Vector3<f64>,
    /// Inertia about the centre of mass, in axes parallel to the joint frame.
    pub inertia_kg_m2: Matrix3<f64>,
}

impl Link {
    /// The parent of link `index` in a serial chain.
    pub fn serial(index: usize) -> Option<usize> {
        index.checked_sub(1)
    }

    /// Adds a point mass at a place in the joint frame: parallel axes about the common centre. A total of nothing or
    /// less is left to [`Chain::new`], which names the link.
    pub fn add_point_mass(&mut self, mass_kg: f64, centre_m: Vector3<f64>) {
        let total_kg = self.mass_kg + mass_kg;
        if total_kg <= 0.0 {
            self.mass_kg = total_kg;
            return;
        }
        let apart_m = centre_m - self.centre_of_mass_m;
        let reduced_kg = self.mass_kg * mass_kg / total_kg;
        self.inertia_kg_m2 += reduced_kg
            * (Matrix3::identity() * apart_m.norm_squared() - apart_m * apart_m.transpose());
        self.centre_of_mass_m += apart_m * (mass_kg / total_kg);
        self.mass_kg = total_kg;
    }
}

/// Why a chain cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ChainError {
    /// No links at all, or more than [`LINKS_MAX`].
    #[error("a chain has 1 to {LINKS_MAX} joints, not {found}")]
    JointCount {
        /// Links given.
        found: usize,
    },
    /// A mass is negative or not finite.
    #[error("link {link}: a mass is at least 0 kg, not {mass_kg} kg")]
    Mass {
        /// Index of the link.
        link: usize,
        /// The value found.
        mass_kg: f64,
    },
    /// An inertia is not symmetric positive semidefinite, or violates the triangle inequality.
    #[error(
        "link {link}: no body has this inertia; it must be symmetric, about the centre of mass, \
         with no principal moment negative or larger than the sum of the other two"
    )]
    Inertia {
        /// Index of the link.
        link: usize,
    },
    /// An origin, axis or centre of mass is not finite, or the axis or the origin's quaternion is not of unit length.
    #[error(
        "link {link}: origin, axis and centre of mass must be finite, axis and quaternion of unit length"
    )]
    Geometry {
        /// Index of the link.
        link: usize,
    },
    /// A link hangs on itself or on one after it.
    #[error("link {link}: its parent must be one of the links before it, not link {parent}")]
    Parent {
        /// Index of the link.
        link: usize,
        /// The value found.
        parent: usize,
    },
    /// A component of gravity is not finite.
    #[error("gravity must be finite, not {gravity_m_s2:?} m/s²")]
    Gravity {
        /// The value found.
        gravity_m_s2: [f64; 3],
    },
    /// The tool frame is not finite, or its quaternion is not of unit length.
    #[error("the tool frame must be finite, its quaternion of unit length")]
    Tool,
}

/// Links on a fixed base: in a row or as a tree, each joint turning or sliding.
#[derive(Clone, Debug)]
pub struct Chain {
    pub(super) links: Vec<Link>,
    pub(super) bodies: Vec<Body>,
    /// Whether any link hangs on another than the one before it.
    pub(super) branches: bool,
    pub(super) gravity_m_s2: Vector3<f64>,
    pub(super) tool: Isometry3<f64>,
}

impl Chain {
    /// Builds a chain. `tool` is the tool frame in the last link's frame.
    ///
    /// # Errors
    /// [`ChainError`], naming the link.
    pub fn new(
        links: &[Link],
        gravity_m_s2: Vector3<f64>,
        tool: Isometry3<f64>,
    ) -> Result<Self, ChainError> {
        if !(1..=LINKS_MAX).contains(&links.len()) {
            return Err(ChainError::JointCount { found: links.len() });
        }
        for (index, link) in links.iter().enumerate() {
            check_link(index, link)?;
        }
        check_gravity(&gravity_m_s2)?;
        if !is_pose(&tool) {
            return Err(ChainError::Tool);
        }
        Ok(Self {
            bodies: bodies(links),
            branches: links
                .iter()
                .enumerate()
                .any(|(index, link)| link.parent != Link::serial(index)),
            links: links.to_vec(),
            gravity_m_s2,
            tool,
        })
    }

    /// The same chain with mass and inertia of one link multiplied by `factor`.
    ///
    /// # Errors
    /// [`ChainError`], naming the link.
    pub fn with_heavier_link(&self, index: usize, factor: f64) -> Result<Self, ChainError> {
        let mut links = self.links.clone();
        links[index].mass_kg *= factor;
        links[index].inertia_kg_m2 *= factor;
        Self::new(&links, self.gravity_m_s2, self.tool)
    }

    /// Number of joints, 1 to [`LINKS_MAX`].
    pub fn joint_count(&self) -> usize {
        self.bodies.len()
    }

    /// The links, each after its parent.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Acceleration of free fall in the base frame.
    pub fn gravity_m_s2(&self) -> Vector3<f64> {
        self.gravity_m_s2
    }

    /// The tool frame in the last link's frame.
    pub fn tool(&self) -> Isometry3<f64> {
        self.tool
    }

    /// Replaces gravity, for a base that is tilted or in free fall.
    ///
    /// # Errors
    /// [`ChainError::Gravity`]; the chain then keeps what it had.
    pub fn set_gravity(&mut self, gravity_m_s2: Vector3<f64>) -> Result<(), ChainError> {
        check_gravity(&gravity_m_s2)?;
        self.gravity_m_s2 = gravity_m_s2;
        Ok(())
    }
}

fn check_link(index: usize, link: &Link) -> Result<(), ChainError> {
    if let Some(parent) = link.parent.filter(|parent| *parent >= index) {
        return Err(ChainError::Parent {
            link: index,
            parent,
        });
    }
    if !is_pose(&link.origin) || !is_unit(link.axis.norm()) || !is_finite(&link.centre_of_mass_m) {
        return Err(ChainError::Geometry { link: index });
    }
    if !link.mass_kg.is_finite() || link.mass_kg < 0.0 {
        return Err(ChainError::Mass {
            link: index,
            mass_kg: link.mass_kg,
        });
    }
    if !is_inertia_of_a_body(&link.inertia_kg_m2) {
        return Err(ChainError::Inertia { link: index });
    }
    Ok(())
}

fn check_gravity(gravity_m_s2: &Vector3<f64>) -> Result<(), ChainError> {
    if is_finite(gravity_m_s2) {
        return Ok(());
    }
    Err(ChainError::Gravity {
        gravity_m_s2: (*gravity_m_s2).into(),
    })
}

fn is_pose(frame: &Isometry3<f64>) -> bool {
    is_finite(&frame.translation.vector) && is_unit(frame.rotation.norm())
}

fn is_finite(vector: &Vector3<f64>) -> bool {
    vector.iter().all(|component| component.is_finite())
}

/// Not for NaN either.
fn is_unit(length: f64) -> bool {
    (length - 1.0).abs() <= UNIT_LENGTH_TOLERANCE
}

/// Whether a body has such an inertia: symmetric, no principal moment negative or larger than the sum of the others.
pub fn is_inertia_of_a_body(inertia_kg_m2: &Matrix3<f64>) -> bool {
    // Checked first: the eigenvalue iteration below never ends on NaN.
    if !inertia_kg_m2.iter().all(|element| element.is_finite()) {
        return false;
    }
    let rounding = ROUNDING * inertia_kg_m2.amax();
    if (inertia_kg_m2 - inertia_kg_m2.transpose()).amax() > rounding {
        return false;
    }
    let moments = SymmetricEigen::new(*inertia_kg_m2).eigenvalues;
    let largest = moments.max();
    moments.min() >= -rounding && 2.0 * largest - moments.sum() <= TRIANGLE_TOLERANCE * largest
}

/// The inertia of a body that is nearest to one that no body has: of `½·tr(I)·1 - I`, the second moments of mass, the negative ones are
/// zero. The inertia must be finite and symmetric.
///
/// Source: Wensing, Kim and Slotine, Linear matrix inequalities for physically consistent inertial parameter identification, IEEE Robotics
/// and Automation Letters 3 (2018), eq. 14, which says what second moments an inertia has.
pub fn nearest_inertia_of_a_body(inertia_kg_m2: &Matrix3<f64>) -> Matrix3<f64> {
    let moments = Matrix3::identity() * (0.5 * inertia_kg_m2.trace()) - inertia_kg_m2;
    let mut eigen = SymmetricEigen::new(moments);
    eigen
        .eigenvalues
        .iter_mut()
        .for_each(|moment| *moment = moment.max(0.0));
    let moments = eigen.recompose();
    Matrix3::identity() * moments.trace() - moments
}
