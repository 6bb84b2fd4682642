//! `<compiler>` and `<option>`: how numbers are meant, and what is done to masses.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::error::RobotError;
use crate::mass::MassProperties;
use crate::model::Model;
use crate::xml::Element;

/// The settings that matter here, with MuJoCo's defaults.
pub struct Compiler {
    /// What an angle of 1 is.
    pub angle_rad: f64,
    pub euler: [char; 3],
    pub autolimits: bool,
    inertia_from_geom: FromGeom,
    geom_groups: [f64; 2],
    mass_min_kg: f64,
    inertia_min_kg_m2: f64,
    balances: bool,
    total_mass_kg: f64,
    pub gravity_m_s2: [f64; 3],
    pub timestep_s: f64,
}

#[derive(Clone, Copy, PartialEq)]
enum FromGeom {
    Never,
    WhereNeeded,
    Always,
}

impl Compiler {
    pub fn of(root: &Element) -> Result<Self, RobotError> {
        let mut settings = Self {
            angle_rad: 1.0_f64.to_radians(),
            euler: ['x', 'y', 'z'],
            autolimits: true,
            inertia_from_geom: FromGeom::WhereNeeded,
            geom_groups: [0.0, 5.0],
            mass_min_kg: 0.0,
            inertia_min_kg_m2: 0.0,
            balances: false,
            total_mass_kg: -1.0,
            gravity_m_s2: [0.0, 0.0, -9.81],
            timestep_s: 0.002,
        };
        for compiler in root.all("compiler") {
            settings.read(compiler)?;
        }
        for option in root.all("option") {
            settings.read_option(option)?;
        }
        Ok(settings)
    }

    fn read(&mut self, compiler: &Element) -> Result<(), RobotError> {
        let is = |key: &str, value: &str| compiler.attribute(key) == Some(value);
        match compiler.attribute("angle") {
            Some("radian") => self.angle_rad = 1.0,
            Some("degree") => self.angle_rad = 1.0_f64.to_radians(),
            None => {}
            Some(other) => {
                return Err(compiler.invalid(format!("angle = {other:?} must be degree or radian")));
            }
        }
        if is("coordinate", "global") {
            return Err(compiler.invalid(
                "coordinate = \"global\" is not read; save the model with MuJoCo, which writes local ones",
            ));
        }
        if let Some(text) = compiler.attribute("eulerseq") {
            let axes: Vec<char> = text.chars().collect();
            let known = axes.iter().all(|axis| "xyzXYZ".contains(*axis));
            self.euler = axes.try_into().ok().filter(|_| known).ok_or_else(|| {
                compiler.invalid(format!(
                    "eulerseq = {text:?} must be three of x, y, z, X, Y, Z"
                ))
            })?;
        }
        if let Some(autolimits) = compiler.attribute("autolimits") {
            self.autolimits = autolimits == "true";
        }
        if let Some(balances) = compiler.attribute("balanceinertia") {
            self.balances = balances == "true";
        }
        match compiler.attribute("inertiafromgeom") {
            Some("true") => self.inertia_from_geom = FromGeom::Always,
            Some("false") => self.inertia_from_geom = FromGeom::Never,
            Some(_) => self.inertia_from_geom = FromGeom::WhereNeeded,
            None => {}
        }
        self.geom_groups = compiler
            .numbers("inertiagrouprange")?
            .unwrap_or(self.geom_groups);
        self.mass_min_kg = compiler.number("boundmass")?.unwrap_or(self.mass_min_kg);
        self.inertia_min_kg_m2 = compiler
            .number("boundinertia")?
            .unwrap_or(self.inertia_min_kg_m2);
        self.total_mass_kg = compiler
            .number("settotalmass")?
            .unwrap_or(self.total_mass_kg);
        Ok(())
    }

    fn read_option(&mut self, option: &Element) -> Result<(), RobotError> {
        self.gravity_m_s2 = option.numbers("gravity")?.unwrap_or(self.gravity_m_s2);
        if let Some(timestep_s) = option.number("timestep")? {
            if timestep_s <= 0.0 {
                return Err(option.invalid(format!("timestep = {timestep_s} must be above zero")));
            }
            self.timestep_s = timestep_s;
        }
        let mut flags = option.all("flag");
        if flags.any(|flag| flag.attribute("gravity") == Some("disable")) {
            self.gravity_m_s2 = [0.0; 3];
        }
        Ok(())
    }

    /// Whether a body's mass is its geoms'.
    pub fn weighs_geoms_of(&self, body: &Element) -> bool {
        match self.inertia_from_geom {
            FromGeom::Never => false,
            FromGeom::WhereNeeded => body.child("inertial").is_none(),
            FromGeom::Always => true,
        }
    }

    /// Whether geoms of this group have mass.
    pub fn weighs(&self, group: f64) -> bool {
        (self.geom_groups[0]..=self.geom_groups[1]).contains(&group)
    }

    /// Whether the mass of what does not move matters too.
    pub fn weighs_everything(&self) -> bool {
        self.total_mass_kg > 0.0
    }

    /// With the least mass and inertia that bodies have, and, where it is asked for, an inertia that a body can have.
    pub fn bounded(
        &self,
        mut mass: MassProperties,
        body: &Element,
    ) -> Result<MassProperties, RobotError> {
        mass.mass_kg = mass.mass_kg.max(self.mass_min_kg);
        if self.inertia_min_kg_m2 <= 0.0 && !self.balances {
            return Ok(mass);
        }
        let inertia_kg_m2 = mass.inertia_kg_m2;
        if !inertia_kg_m2.iter().all(|element| element.is_finite()) {
            return Err(body.invalid("the inertia is not finite"));
        }
        let principal = SymmetricEigen::new(inertia_kg_m2);
        let mut moments = principal
            .eigenvalues
            .map(|moment| moment.max(self.inertia_min_kg_m2));
        if self.balances && 2.0 * moments.max() > moments.sum() {
            moments = Vector3::repeat(moments.mean());
        }
        if moments != principal.eigenvalues {
            let axes = principal.eigenvectors;
            mass.inertia_kg_m2 = axes * Matrix3::from_diagonal(&moments) * axes.transpose();
        }
        Ok(mass)
    }

    /// Scales all masses to the sum that is asked for.
    pub fn total_mass(&self, model: &mut Model) {
        let sum_kg: f64 = model.bodies.iter().map(|body| body.mass.mass_kg).sum();
        if self.total_mass_kg > 0.0 && sum_kg > 0.0 {
            let factor = self.total_mass_kg / sum_kg;
            for body in &mut model.bodies {
                body.mass.mass_kg *= factor;
                body.mass.inertia_kg_m2 *= factor;
            }
        }
    }
}
