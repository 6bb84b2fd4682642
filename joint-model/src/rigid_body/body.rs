//! What the recursions read of each link, computed once.
//!
//! Each link gets a frame of its own: the joint frame turned so that the joint's axis is z. A joint then
//! turns by a plane rotation or slides along z, and products with the axis become the choice of a component.

use nalgebra::{Matrix3, Rotation3, Unit, UnitQuaternion, Vector3};

use super::symmetric::Symmetric3;
use super::{JointKind, Link};

/// One link in its aligned frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    /// The link this one hangs on, or the base.
    pub(super) parent: Option<usize>,
    pub(super) slides: bool,
    /// From this frame to the parent's, with the joint at zero.
    rotation_at_zero: Matrix3<f64>,
    /// This frame's origin in the parent's frame, with the joint at zero.
    origin_m: Vector3<f64>,
    pub(super) mass_kg: f64,
    /// Mass times centre of mass.
    pub(super) first_moment_kg_m: Vector3<f64>,
    /// Inertia about the frame's origin.
    pub(super) inertia_kg_m2: Symmetric3,
    /// What augmented links count as a point at this frame's origin: this link's mass and that of all it carries but for
    /// what slides.
    pub(super) at_origin_kg: f64,
    /// Mass of this link and all it carries.
    pub(super) carried_kg: f64,
    /// Of that, what the parent's augmented link leaves out, because it slides against the parent.
    pub(super) left_out_kg: f64,
    /// The link with the mass of everything that turns on it as points at the next joints.
    pub(super) augmented: AugmentedLink,
    /// From this frame to the joint frame.
    pub(super) alignment: Rotation3<f64>,
}

/// A link plus, as points at the origins of the joints that turn on it, the mass of all links after them.
///
/// A link's mass pulls on its joint's origin, which is a point of the parent too where the joint turns, so a mass may be
/// counted there instead: joint torques stay the same, and the recursions need no masses
/// (the augmented bodies of Hooker and Margulies, J. Astronautical Sciences 12 (1965) 123-128).
#[derive(Clone, Copy, Debug)]
pub(super) struct AugmentedLink {
    /// Sum of mass times position.
    pub(super) first_moment_kg_m: Vector3<f64>,
    /// Sum of mass times position times transposed position (not the inertia, which is its trace minus it).
    pub(super) second_moment_kg_m2: Symmetric3,
}

impl Body {
    /// Whether another link is joined to its parent as this one is.
    pub(super) fn is_where(&self, other: &Self) -> bool {
        self.parent == other.parent
            && self.slides == other.slides
            && self.rotation_at_zero == other.rotation_at_zero
            && self.origin_m == other.origin_m
    }

    /// This frame's origin in the parent's frame.
    #[inline]
    pub(super) fn origin_m(&self, position: f64) -> Vector3<f64> {
        if self.slides {
            self.origin_m + self.rotation_at_zero.column(2) * position
        } else {
            self.origin_m
        }
    }

    /// From this frame to the parent's.
    #[inline]
    pub(super) fn rotation(&self, position_rad: f64) -> Matrix3<f64> {
        if self.slides {
            return self.rotation_at_zero;
        }
        let (sin, cos) = position_rad.sin_cos();
        let r = &self.rotation_at_zero;
        Matrix3::new(
            r.m11 * cos + r.m12 * sin,
            r.m12 * cos - r.m11 * sin,
            r.m13,
            r.m21 * cos + r.m22 * sin,
            r.m22 * cos - r.m21 * sin,
            r.m23,
            r.m31 * cos + r.m32 * sin,
            r.m32 * cos - r.m31 * sin,
            r.m33,
        )
    }
}

/// A rotation that turns z onto `axis`, accurate for axes along and against z too.
///
/// Duff et al., Building an Orthonormal Basis, Revisited, J. Computer Graphics Techniques 6 (2017), Listing 3.
fn turning_z_onto(axis: &Unit<Vector3<f64>>) -> Rotation3<f64> {
    let n = axis.normalize();
    let sign = 1.0_f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    let x = Vector3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x);
    let y = Vector3::new(b, sign + n.y * n.y * a, -n.y);
    Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, n]))
}

/// The bodies of a chain, in the order of its links.
pub(super) fn bodies(links: &[Link]) -> Vec<Body> {
    let mut bodies: Vec<Body> = Vec::with_capacity(links.len());
    for index in 0..links.len() {
        bodies.push(body(links, index, &bodies));
    }
    bodies
}

fn body(links: &[Link], index: usize, before: &[Body]) -> Body {
    let link = &links[index];
    let alignment = turning_z_onto(&link.axis);
    let to_aligned = alignment.inverse();
    let centre_m = to_aligned * link.centre_of_mass_m;
    let central_kg_m2 = to_aligned.matrix() * link.inertia_kg_m2 * to_aligned.matrix().transpose();
    let central_second_kg_m2 = Matrix3::identity() * (0.5 * central_kg_m2.trace()) - central_kg_m2;
    let second_kg_m2 = central_second_kg_m2 + link.mass_kg * centre_m * centre_m.transpose();
    let first_kg_m = link.mass_kg * centre_m;

    let slides = link.kind == JointKind::Prismatic;
    let at_origin_kg = mass_on(links, index, |link| link.kind == JointKind::Revolute);
    let carried_kg = mass_on(links, index, |_| true);
    let mut augmented_first_kg_m = first_kg_m;
    let mut augmented_second_kg_m2 = second_kg_m2;
    for (number, next) in links.iter().enumerate().skip(index + 1) {
        if next.parent == Some(index) && next.kind == JointKind::Revolute {
            let mass_kg = mass_on(links, number, |link| link.kind == JointKind::Revolute);
            let next_m = to_aligned * next.origin.translation.vector;
            augmented_first_kg_m += mass_kg * next_m;
            augmented_second_kg_m2 += mass_kg * next_m * next_m.transpose();
        }
    }
    let from_parent = link.parent.map_or(Rotation3::identity(), |parent| {
        before[parent].alignment.inverse()
    });
    let origin_rotation = UnitQuaternion::new_normalize(*link.origin.rotation).to_rotation_matrix();
    Body {
        parent: link.parent,
        slides,
        rotation_at_zero: (from_parent * origin_rotation * alignment).into_inner(),
        origin_m: from_parent * link.origin.translation.vector,
        mass_kg: link.mass_kg,
        first_moment_kg_m: first_kg_m,
        inertia_kg_m2: Symmetric3::of(&(Matrix3::identity() * second_kg_m2.trace() - second_kg_m2)),
        at_origin_kg,
        carried_kg,
        left_out_kg: if slides {
            carried_kg
        } else {
            carried_kg - at_origin_kg
        },
        augmented: AugmentedLink {
            first_moment_kg_m: augmented_first_kg_m,
            second_moment_kg_m2: Symmetric3::of(&augmented_second_kg_m2),
        },
        alignment,
    }
}

/// Mass of a link and of those it carries by nothing but joints that pass, summed in the order of the links.
fn mass_on(links: &[Link], base: usize, passes: impl Fn(&Link) -> bool) -> f64 {
    let hangs_on_base = |mut index: usize| {
        while index > base {
            match links[index].parent {
                Some(parent) if passes(&links[index]) => index = parent,
                _ => return false,
            }
        }
        index == base
    };
    let carried = links.iter().enumerate().skip(base);
    carried
        .filter(|(index, _)| hangs_on_base(*index))
        .map(|(_, link)| link.mass_kg)
        .sum()
}
