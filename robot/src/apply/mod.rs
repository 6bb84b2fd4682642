//! Effects written where other simulators read them: into the user's own MuJoCo model or URDF, or as actuators of Isaac Lab.

mod assets;
mod bodies;
mod isaaclab;
mod mjcf;
mod text;
mod urdf;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::description::Description;
use crate::error::RobotError;
use crate::file::RobotFile;
use crate::links::Reshaping;
use crate::robot::load_raw;
use crate::{Effect, Part, Robot, RobotJoint, Source};

/// Whose file is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Simulator {
    /// MuJoCo's model.
    Mjcf,
    /// URDF.
    Urdf,
    /// Actuators of Isaac Lab, as Python text.
    IsaacLab,
}

impl Simulator {
    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mjcf => "MJCF",
            Self::Urdf => "URDF",
            Self::IsaacLab => "Isaac Lab",
        }
    }

    fn description(self) -> Option<Description> {
        match self {
            Self::Mjcf => Some(Description::Mjcf),
            Self::Urdf => Some(Description::Urdf),
            Self::IsaacLab => None,
        }
    }
}

/// What became of an effect.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// It is written; in words, what was changed.
    Written(String),
    /// Something of it is written, and what is not.
    InPart(String, String),
    /// The format has no words for it, and why.
    Cannot(String),
}

/// A simulator's file to which effects are added.
pub struct SimulatorFile {
    simulator: Simulator,
    inner: Box<dyn Takes>,
    /// What of the robot file itself is not in it, in sentences.
    pub notes: Vec<String>,
}

/// What each format does.
trait Takes {
    /// `joint` is the index of the robot's; `None` for the whole arm.
    fn add(&mut self, joint: Option<usize>, effect: &Effect) -> Outcome;

    /// Gives links other masses in a text that was there before; `held` is where joints stand that are none of the robot's.
    fn reshape(&mut self, held: &BTreeMap<String, f64>, by: &Reshaping) -> Result<(), RobotError>;

    /// What a joint has by now.
    fn sums(&self, index: usize) -> &Sums;

    fn text(&self) -> Result<String, RobotError>;
}

impl SimulatorFile {
    /// The file for a robot, with what the robot's own file says of its joints. `name_or_path` is where the robot comes from:
    /// a model of that simulator, which is then taken as it stands, or anything else, which is converted. It will be written
    /// to `out`, and files that it names are named from there.
    ///
    /// # Errors
    /// [`RobotError`] if the model cannot be read.
    pub fn of(
        robot: &Robot,
        name_or_path: &str,
        simulator: Simulator,
        out: &Path,
    ) -> Result<Self, RobotError> {
        Self::with_links(robot, None, name_or_path, simulator, out)
    }

    /// The same with links that weigh other than the robot's.
    ///
    /// # Errors
    /// [`RobotError`] if the model cannot be read.
    pub fn with_links(
        robot: &Robot,
        links: Option<&Reshaping>,
        name_or_path: &str,
        simulator: Simulator,
        out: &Path,
    ) -> Result<Self, RobotError> {
        let reshaped = links.map(|by| robot.reshaped(by)).transpose()?;
        let robot = reshaped.as_ref().unwrap_or(robot);
        let base = base(name_or_path, simulator)?;
        let is_converted = base.is_none() && simulator != Simulator::IsaacLab;
        let mut notes = Vec::new();
        let mut held = None;
        let (text, path) = match base {
            Some(base) => {
                held = Some(base.held);
                (
                    assets::named_from(simulator, base.text, &base.path, out)?,
                    base.path,
                )
            }
            None => {
                let written = match simulator {
                    Simulator::Mjcf => Some(robot.to_mjcf()),
                    Simulator::Urdf => Some(robot.to_urdf()),
                    Simulator::IsaacLab => None,
                };
                let written = written.map(|written| {
                    notes.extend(written.left_out);
                    written.text
                });
                (written.unwrap_or_default(), out.to_owned())
            }
        };
        let mut inner: Box<dyn Takes> = match simulator {
            Simulator::Mjcf => Box::new(mjcf::MjcfFile::of(robot, text, &path)?),
            Simulator::Urdf => Box::new(urdf::UrdfFile::of(robot, text, &path)?),
            Simulator::IsaacLab => Box::new(isaaclab::IsaacLabFile::of(robot)),
        };
        // what was converted has the links already
        if let (Some(by), Some(held)) = (links, held) {
            inner.reshape(&held, by)?;
        }
        notes.extend(own_effects(robot, simulator, is_converted, inner.as_mut()));
        notes.sort();
        notes.dedup();
        Ok(Self {
            simulator,
            inner,
            notes,
        })
    }

    /// Adds an effect to a joint of the robot, by its index, or to the whole arm.
    pub fn add(&mut self, joint: Option<usize>, effect: &Effect) -> Outcome {
        self.inner.add(joint, effect)
    }

    /// Whether it has words for a friction of a joint, as a change of what the joint has by now: none has any for friction below zero.
    pub fn says_friction(&self, joint: usize, effect: &Effect) -> bool {
        let sums = self.inner.sums(joint);
        match *effect {
            Effect::CoulombFriction { coulomb_nm } => added(sums.coulomb_nm, coulomb_nm) >= 0.0,
            Effect::ViscousFriction { viscous_nm_s_rad } => {
                added(sums.viscous_nm_s_rad, viscous_nm_s_rad) >= 0.0
            }
            Effect::QuadraticFriction { .. } | Effect::AsymmetricFriction { .. } => {
                self.simulator == Simulator::Mjcf
            }
            _ => false,
        }
    }

    /// The text with everything that could be said.
    ///
    /// # Errors
    /// [`RobotError`] if the text that was read is not valid any more, which it always is.
    pub fn text(&self) -> Result<String, RobotError> {
        self.inner.text()
    }
}

/// Adds what the robot file says beside the model, and tells what the simulator has no words for. What was converted has the
/// bodies' effects already, and told what it left out.
fn own_effects(
    robot: &Robot,
    simulator: Simulator,
    is_converted: bool,
    file: &mut dyn Takes,
) -> Vec<String> {
    let mut notes = Vec::new();
    let mut note = |of: &str, unsaid: &[&str]| {
        if !unsaid.is_empty() && !is_converted {
            notes.push(format!(
                "{of}: the robot file's {} cannot be said in {}",
                unsaid.join(", "),
                simulator.name()
            ));
        }
    };
    let mut is_unsaid = |joint: Option<usize>, effect: &Effect| {
        let in_bodies = effect.part() == Part::Bodies;
        !(is_converted && in_bodies) && matches!(file.add(joint, effect), Outcome::Cannot(_))
    };
    for (index, joint) in robot.joints.iter().enumerate() {
        let effects = joint.effects.iter();
        let effects = effects.filter(|effect| is_unsaid(Some(index), effect));
        let mut unsaid: Vec<&str> = effects.map(Effect::name).chain(tables(joint)).collect();
        if simulator == Simulator::Urdf && joint.rotor_inertia_kg_m2 != 0.0 {
            unsaid.push("rotor inertia");
        }
        note(&joint.name, &unsaid);
    }
    let shared = robot.shared_effects.iter();
    let shared = shared.filter(|effect| is_unsaid(None, effect));
    let unsaid: Vec<&str> = shared.map(Effect::name).collect();
    note(&robot.name, &unsaid);
    notes
}

/// A value with its change. What is taken off a value as a whole leaves nothing, whatever the rounding.
fn added(value: f64, change: f64) -> f64 {
    if differs(value, -change) {
        value + change
    } else {
        0.0
    }
}

/// Whether two values are not the same but for rounding.
fn differs(a: f64, b: f64) -> bool {
    (a - b).abs() > 1e-9 * a.abs().max(b.abs())
}

fn tables(joint: &RobotJoint) -> impl Iterator<Item = &'static str> {
    let tables = [
        (joint.direction_friction.is_some(), "direction_friction"),
        (joint.load_torque.is_some(), "load_torque"),
        (joint.friction_table.is_some(), "friction_table"),
        (!joint.torque_tables.is_empty(), "torque_tables"),
    ];
    tables
        .into_iter()
        .filter_map(|(is_there, name)| is_there.then_some(name))
}

/// A model as it stands.
struct Base {
    text: String,
    path: PathBuf,
    /// Where joints stand that are none of the robot's.
    held: BTreeMap<String, f64>,
}

/// The model of that simulator from which the robot comes.
fn base(name_or_path: &str, simulator: Simulator) -> Result<Option<Base>, RobotError> {
    let Some(wanted) = simulator.description() else {
        return Ok(None);
    };
    let (text, source) = load_raw(name_or_path)?;
    let Source::File(path) = source else {
        return Ok(None);
    };
    if let Some(own) = Description::of(&text, name_or_path)? {
        let held = BTreeMap::new();
        return Ok((own == wanted).then_some(Base { text, path, held }));
    }
    named(&RobotFile::parse(&text, name_or_path)?, &path, wanted)
}

/// The model that a robot file of that path names.
fn named(file: &RobotFile, path: &Path, wanted: Description) -> Result<Option<Base>, RobotError> {
    let named = match wanted {
        Description::Mjcf => &file.mjcf,
        Description::Urdf => &file.urdf,
    };
    let Some(named) = named else {
        return Ok(None);
    };
    let whole = path.parent().unwrap_or(Path::new("")).join(named);
    let as_what = format!("{} = {named:?}", wanted.key());
    let text = crate::build::read_beside(&whole, &path.display().to_string(), &as_what)?;
    Ok(Some(Base {
        text,
        path: whole,
        held: file.held.clone(),
    }))
}

/// The model that a robot file names, with other links and nothing else changed; files that it names are named from `out`. `None` where
/// the robot file has its links itself.
///
/// # Errors
/// [`RobotError`] if the model cannot be read.
pub fn reshaped_description(
    file: &RobotFile,
    source: &Source,
    by: &Reshaping,
    out: &Path,
) -> Result<Option<String>, RobotError> {
    let Source::File(path) = source else {
        return Ok(None);
    };
    for simulator in [Simulator::Urdf, Simulator::Mjcf] {
        let wanted = simulator.description();
        let base = wanted.map(|wanted| Ok((wanted, named(file, path, wanted)?)));
        let Some((description, Some(base))) = base.transpose()? else {
            continue;
        };
        let text = assets::named_from(simulator, base.text, &base.path, out)?;
        let model = description.read(&text, &base.path)?;
        let name = base.path.display().to_string();
        let document = crate::xml::document(&text, &name)?;
        let bodies = model.reshaped(&base.held, by)?;
        let mut changes = text::Changes::default();
        match simulator {
            Simulator::Mjcf => bodies::of_mjcf(&document, &bodies, &mut changes),
            Simulator::Urdf | Simulator::IsaacLab => {
                bodies::of_urdf(&document, &bodies, &mut changes)
            }
        }
        return changes.apply(&text, &name).map(Some);
    }
    Ok(None)
}

/// What joints of the robot file say in the terms that simulators share. Everything is at the joint.
#[derive(Clone, Debug, Default)]
struct Sums {
    coulomb_nm: f64,
    viscous_nm_s_rad: f64,
    quadratic_nm_s2_rad2: f64,
    /// Springs and constant torques: stiffness, and torque at zero in the joint's positive direction.
    stiffness_nm_rad: f64,
    torque_at_zero_nm: f64,
    armature_kg_m2: f64,
    torque_gain: f64,
    limit_nm: Option<f64>,
    delay_s: f64,
}

impl Sums {
    /// Of a joint without its effects.
    fn of(joint: &RobotJoint) -> Self {
        let ratio = joint.gear_ratio.abs();
        Self {
            armature_kg_m2: joint.rotor_inertia_kg_m2 * ratio * ratio,
            torque_gain: 1.0,
            limit_nm: joint.torque_limit_nm.map(|limit_nm| limit_nm * ratio),
            ..Self::default()
        }
    }
}

/// Six digits: more than a fit is worth.
pub(crate) fn short(value: f64) -> String {
    let value: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    value.to_string()
}

/// Words for a change of a value.
pub(crate) fn changed(key: &str, before: f64, after: f64) -> String {
    format!("{key} {} -> {}", short(before), short(after))
}

/// The folder of a path, as the system knows it.
fn folder(path: &Path) -> PathBuf {
    let parent = path.parent().filter(|parent| *parent != Path::new(""));
    let parent = parent.unwrap_or(Path::new("."));
    fs::canonicalize(parent).unwrap_or_else(|_| parent.to_owned())
}
