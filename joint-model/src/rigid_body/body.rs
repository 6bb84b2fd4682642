//! What the recursions read of each link, computed once.
//!
//! Each link gets a frame of its own: the joint frame turned so that the joint's axis is z. A joint then
//! moves by a plane rotation, and products with the axis become the choice of a component.

use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Rotation3, Unit, UnitQuaternion, Vector3};

use super::Link;
use super::symmetric::Symmetric3;
use crate::JOINTS_MAX;

/// One link in its aligned frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    /// From this frame to the parent's, at joint angle zero.
    rotation_at_zero: Matrix3<f64>,
    /// This frame's origin in the parent's frame.
    pub(super) origin_m: Vector3<f64>,
    pub(super) mass_kg: f64,
    /// Mass times centre of mass.
    pub(super) first_moment_kg_m: Vector3<f64>,
    /// Inertia about the frame's origin.
    pub(super) inertia_kg_m2: Symmetric3,
    /// The link with the mass of everything it carries as a point at the next joint.
    pub(super) augmented: AugmentedLink,
    /// From this frame to the joint frame.
    pub(super) alignment: Rotation3<f64>,
}

/// A link plus, as a point at the next joint's origin, the mass of all links after it.
///
/// A link's mass pulls on its joint's origin, which is a point of the parent too, so a mass may be counted
/// there instead: joint torques stay the same, and the recursions need no masses
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
        self.rotation_at_zero == other.rotation_at_zero && self.origin_m == other.origin_m
    }

    /// From this frame to the parent's.
    #[inline]
    pub(super) fn rotation(&self, position_rad: f64) -> Matrix3<f64> {
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

/// The bodies of a chain, base to tip.
pub(super) fn bodies(links: &[Link]) -> ArrayVec<Body, JOINTS_MAX> {
    let mut bodies: ArrayVec<Body, JOINTS_MAX> = ArrayVec::new();
    for (index, link) in links.iter().enumerate() {
        let parent_alignment = bodies
            .last()
            .map_or(Rotation3::identity(), |parent| parent.alignment);
        bodies.push(body(link, &parent_alignment, &links[index + 1..]));
    }
    bodies
}

fn body(link: &Link, parent_alignment: &Rotation3<f64>, after: &[Link]) -> Body {
    let alignment = turning_z_onto(&link.axis);
    let to_aligned = alignment.inverse();
    let centre_m = to_aligned * link.centre_of_mass_m;
    let central_kg_m2 = to_aligned.matrix() * link.inertia_kg_m2 * to_aligned.matrix().transpose();
    let central_second_kg_m2 = Matrix3::identity() * (0.5 * central_kg_m2.trace()) - central_kg_m2;
    let second_kg_m2 = central_second_kg_m2 + link.mass_kg * centre_m * centre_m.transpose();
    let first_kg_m = link.mass_kg * centre_m;

    let mass_after_kg: f64 = after.iter().map(|link| link.mass_kg).sum();
    let next_m = after.first().map_or(Vector3::zeros(), |next| {
        to_aligned * next.origin.translation.vector
    });
    let from_parent = parent_alignment.inverse();
    let origin_rotation = UnitQuaternion::new_normalize(*link.origin.rotation).to_rotation_matrix();
    Body {
        rotation_at_zero: (from_parent * origin_rotation * alignment).into_inner(),
        origin_m: from_parent * link.origin.translation.vector,
        mass_kg: link.mass_kg,
        first_moment_kg_m: first_kg_m,
        inertia_kg_m2: Symmetric3::of(&(Matrix3::identity() * second_kg_m2.trace() - second_kg_m2)),
        augmented: AugmentedLink {
            first_moment_kg_m: first_kg_m + mass_after_kg * next_m,
            second_moment_kg_m2: Symmetric3::of(
                &(second_kg_m2 + mass_after_kg * next_m * next_m.transpose()),
            ),
        },
        alignment,
    }
}
