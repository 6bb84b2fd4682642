//! Where things stand: `pos` with `quat`, `axisangle`, `euler`, `xyaxes` or `zaxis`.

use nalgebra::{
    Isometry3, Matrix3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3,
};

use super::classes::View;
use super::compiler::Compiler;
use crate::error::RobotError;

/// Shorter vectors have no direction.
const LENGTH_MIN: f64 = 1e-12;

/// The frame of an element in the frame around it.
pub fn pose(view: &View, compiler: &Compiler) -> Result<Isometry3<f64>, RobotError> {
    let position_m = view.numbers::<3>("pos")?.unwrap_or_default();
    Ok(Isometry3::from_parts(
        Translation3::from(position_m),
        orientation(view, compiler)?,
    ))
}

/// How an element is turned against the frame around it.
pub fn orientation(view: &View, compiler: &Compiler) -> Result<UnitQuaternion<f64>, RobotError> {
    let no_direction = |key: &str| view.element.invalid(format!("{key} must not be zero"));
    if let Some([w, x, y, z]) = view.numbers("quat")? {
        return UnitQuaternion::try_new(Quaternion::new(w, x, y, z), LENGTH_MIN)
            .ok_or_else(|| no_direction("quat"));
    }
    if let Some([x, y, z, angle]) = view.numbers("axisangle")? {
        let axis = Unit::try_new(Vector3::new(x, y, z), LENGTH_MIN);
        let axis = axis.ok_or_else(|| no_direction("the axis of axisangle"))?;
        return Ok(UnitQuaternion::from_axis_angle(
            &axis,
            angle * compiler.angle_rad,
        ));
    }
    if let Some(angles) = view.numbers::<3>("euler")? {
        return Ok(euler(
            angles.map(|angle| angle * compiler.angle_rad),
            compiler.euler,
        ));
    }
    if let Some([x1, x2, x3, y1, y2, y3]) = view.numbers("xyaxes")? {
        let x = Vector3::new(x1, x2, x3).try_normalize(LENGTH_MIN);
        let x = x.ok_or_else(|| no_direction("the x axis of xyaxes"))?;
        let y = Vector3::new(y1, y2, y3);
        let y = (y - x * x.dot(&y)).try_normalize(LENGTH_MIN);
        let y = y.ok_or_else(|| no_direction("what the y axis of xyaxes has across the x axis"))?;
        let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
        return Ok(UnitQuaternion::from_rotation_matrix(&axes));
    }
    if let Some(z) = view.numbers::<3>("zaxis")? {
        let z = Vector3::from(z);
        return z_onto(&z).ok_or_else(|| no_direction("zaxis"));
    }
    Ok(UnitQuaternion::identity())
}

/// The least turn that brings z onto a direction.
pub fn z_onto(direction: &Vector3<f64>) -> Option<UnitQuaternion<f64>> {
    direction.try_normalize(LENGTH_MIN)?;
    // straight down there is no least turn; MuJoCo takes x
    Some(
        UnitQuaternion::rotation_between(&Vector3::z(), direction).unwrap_or_else(|| {
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI)
        }),
    )
}

/// Turns one after the other: small letters about axes that turn along, capital ones about axes that stay.
fn euler(angles_rad: [f64; 3], axes: [char; 3]) -> UnitQuaternion<f64> {
    let mut turned = UnitQuaternion::identity();
    for (angle_rad, letter) in angles_rad.into_iter().zip(axes) {
        let axis = match letter.to_ascii_lowercase() {
            'x' => Vector3::x_axis(),
            'y' => Vector3::y_axis(),
            _ => Vector3::z_axis(),
        };
        let turn = UnitQuaternion::from_axis_angle(&axis, angle_rad);
        turned = if letter.is_ascii_lowercase() {
            turned * turn
        } else {
            turn * turned
        };
    }
    turned
}
