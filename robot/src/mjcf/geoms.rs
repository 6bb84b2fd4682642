//! What geoms weigh: bodies of one density in MuJoCo's primitive shapes.

use std::f64::consts::PI;

use nalgebra::{Isometry3, Matrix3, Vector3};

use super::classes::View;
use super::compiler::Compiler;
use super::frames;
use crate::error::RobotError;
use crate::mass::MassProperties;

/// MuJoCo's density where a geom says none, that of water.
const DENSITY_KG_M3: f64 = 1000.0;

/// Mass of a geom in the frame around it; `None` of one that has none.
pub fn mass(geom: &View, compiler: &Compiler) -> Result<Option<MassProperties>, RobotError> {
    let own_mass_kg = geom.number("mass")?;
    let density_kg_m3 = geom.number("density")?.unwrap_or(DENSITY_KG_M3);
    let group = geom.number("group")?.unwrap_or(0.0);
    let weighs_nothing = match own_mass_kg {
        Some(mass_kg) => mass_kg == 0.0,
        None => density_kg_m3 == 0.0,
    };
    let kind = geom.attribute("type").unwrap_or("sphere");
    if weighs_nothing || !compiler.weighs(group) || matches!(kind, "plane" | "hfield") {
        return Ok(None);
    }
    if geom.attribute("shellinertia") == Some("true") {
        return Err(geom
            .element
            .invalid("shellinertia is not read; give the body an <inertial>"));
    }
    let (shape, frame) = shape(geom, kind, compiler)?;
    let mass_kg = own_mass_kg.unwrap_or(density_kg_m3 * shape.volume_m3());
    if mass_kg < 0.0 {
        return Err(geom
            .element
            .invalid(format!("mass {mass_kg} kg must be zero or above")));
    }
    let about_itself = MassProperties {
        mass_kg,
        centre_m: Vector3::zeros(),
        inertia_kg_m2: Matrix3::from_diagonal(&(shape.moments_m2() * mass_kg)),
    };
    Ok(Some(about_itself.seen_from(&frame)))
}

/// Sizes are halves and radii; cylinders and capsules lie along z.
enum Shape {
    Box { half_m: [f64; 3] },
    Ellipsoid { radii_m: [f64; 3] },
    Cylinder { radius_m: f64, half_m: f64 },
    Capsule { radius_m: f64, half_m: f64 },
}

fn shape(
    geom: &View,
    kind: &str,
    compiler: &Compiler,
) -> Result<(Shape, Isometry3<f64>), RobotError> {
    if geom.attribute("mesh").is_some() || matches!(kind, "mesh" | "sdf") {
        return Err(geom.element.invalid(
            "the inertia of a mesh is not computed; give the body an <inertial>, as MuJoCo writes it when it saves a model with <compiler saveinertial=\"true\"/>",
        ));
    }
    let size = geom.list("size")?.unwrap_or_default();
    let ends = geom.numbers::<6>("fromto")?;
    let mut frame = Isometry3::from_parts(
        geom.numbers::<3>("pos")?.unwrap_or_default().into(),
        frames::orientation(geom, compiler)?,
    );
    let mut half_length_m = None;
    if let Some([x1, y1, z1, x2, y2, z2]) = ends {
        let (from, to) = (Vector3::new(x1, y1, z1), Vector3::new(x2, y2, z2));
        let turn = frames::z_onto(&(from - to));
        let turn = turn.ok_or_else(|| geom.element.invalid("fromto must have a length"))?;
        frame = Isometry3::from_parts(((from + to) / 2.0).into(), turn);
        half_length_m = Some((to - from).norm() / 2.0);
    }
    let needed = |index: usize| {
        let value = size.get(index).copied().filter(|value| *value > 0.0);
        value.ok_or_else(|| {
            let count = index + 1;
            geom.element
                .invalid(format!("size of a {kind} needs {count} numbers above zero"))
        })
    };
    let lying = |half: usize| half_length_m.map_or_else(|| needed(half), Ok);
    let shape = match kind {
        "sphere" => Shape::Ellipsoid {
            radii_m: [needed(0)?; 3],
        },
        "capsule" => Shape::Capsule {
            radius_m: needed(0)?,
            half_m: lying(1)?,
        },
        "cylinder" => Shape::Cylinder {
            radius_m: needed(0)?,
            half_m: lying(1)?,
        },
        "box" | "ellipsoid" => {
            let sizes = match half_length_m {
                Some(half_m) => [needed(0)?, needed(0)?, half_m],
                None => [needed(0)?, needed(1)?, needed(2)?],
            };
            if kind == "box" {
                Shape::Box { half_m: sizes }
            } else {
                Shape::Ellipsoid { radii_m: sizes }
            }
        }
        other => return Err(geom.element.invalid(format!("type {other:?} is not known"))),
    };
    Ok((shape, frame))
}

impl Shape {
    fn volume_m3(&self) -> f64 {
        match self {
            Self::Box { half_m: [x, y, z] } => 8.0 * x * y * z,
            Self::Ellipsoid { radii_m: [x, y, z] } => 4.0 / 3.0 * PI * x * y * z,
            Self::Cylinder { radius_m, half_m } => 2.0 * PI * radius_m.powi(2) * half_m,
            Self::Capsule { radius_m, half_m } => {
                PI * radius_m.powi(2) * (2.0 * half_m + 4.0 / 3.0 * radius_m)
            }
        }
    }

    /// Principal moments about the centre, of 1 kg.
    fn moments_m2(&self) -> Vector3<f64> {
        let of_squares = |[x, y, z]: [f64; 3], part: f64| {
            let [x, y, z] = [x * x, y * y, z * z];
            Vector3::new(y + z, x + z, x + y) * part
        };
        match *self {
            Self::Box { half_m } => of_squares(half_m, 1.0 / 3.0),
            Self::Ellipsoid { radii_m } => of_squares(radii_m, 1.0 / 5.0),
            Self::Cylinder { radius_m, half_m } => cylinder_m2(radius_m, half_m),
            Self::Capsule { radius_m, half_m } => {
                // a cylinder with half a sphere at each end, whose centre is 3/8 of its radius beyond
                let (r, length) = (radius_m, 2.0 * half_m);
                let of_spheres = 4.0 * r / (4.0 * r + 3.0 * length);
                let sphere_m2 = 0.4 * r * r;
                let across_m2 = sphere_m2 + length * (3.0 * r + 2.0 * length) / 8.0;
                let spheres_m2 = Vector3::new(across_m2, across_m2, sphere_m2);
                cylinder_m2(r, half_m) * (1.0 - of_spheres) + spheres_m2 * of_spheres
            }
        }
    }
}

fn cylinder_m2(radius_m: f64, half_m: f64) -> Vector3<f64> {
    let across_m2 = radius_m.powi(2) / 4.0 + half_m.powi(2) / 3.0;
    Vector3::new(across_m2, across_m2, radius_m.powi(2) / 2.0)
}
