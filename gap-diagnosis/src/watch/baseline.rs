//! What a joint was like while nothing changed: the robot file with what was already there, known values refitted.

use gap_report::Candidate;
use joint_model::rigid_body::Chain;
use joint_twin::known::KnownValue;
use joint_twin::observe::Channel;
use joint_twin::stretch::stretches;
use joint_twin::whiten::{Floor, Whitener};
use joint_twin::{Changes, JointTwin};
use recording::{Recording, Signal};
use robot::{Effect, Robot, Tolerance, changed_chain};

use crate::closed_loop;
use crate::closed_loop::search::Search;
use crate::diagnose::DiagnoseError;

/// One joint as it was.
#[derive(Clone, Debug)]
pub struct Baseline {
    joint: usize,
    /// With the effects that were found: what later diagnoses begin from.
    mended: Robot,
    /// With refitted links too, and nothing left to refit: what later samples are held against.
    settled: Robot,
    /// Refitted, in deviations.
    known: Vec<(KnownValue, f64)>,
    floors: Vec<(Channel, Floor)>,
    /// Effects that were already there.
    pub effects: Vec<Effect>,
    /// What it was learnt from.
    tables: Vec<Recording>,
}

impl Baseline {
    /// From a recording; none where nothing tells the joint's torque.
    ///
    /// # Errors
    /// [`DiagnoseError`].
    pub fn learn(
        robot: &Robot,
        joint: usize,
        recording: &Recording,
    ) -> Result<Option<Self>, DiagnoseError> {
        Self::of(robot, joint, vec![torque_of_one(robot, joint, recording)])
    }

    fn of(
        robot: &Robot,
        joint: usize,
        tables: Vec<Recording>,
    ) -> Result<Option<Self>, DiagnoseError> {
        let all: Vec<&Recording> = tables.iter().collect();
        let stretches = stretches(&all, robot)?;
        let Some(twin) = JointTwin::new(robot, joint, &stretches)? else {
            return Ok(None);
        };
        let search = Search::new(&twin)?;
        let name = &robot.joints[joint].name;
        let closed_loop::OfOne { model, .. } = closed_loop::one(&twin, name)?;
        let effects = model.changes(&search.scale).effects;
        let mended = with_effects(robot, joint, &effects);
        let (links, known): (Vec<_>, Vec<_>) = twin
            .known
            .iter()
            .cloned()
            .zip(model.known.iter().copied())
            .partition(|(known, _)| known.known.is_of_links());
        let floors = twin.channels.iter().map(|c| (*c, search.floor(*c)));
        Ok(Some(Self {
            joint,
            settled: with_links(&mended, &links),
            mended,
            known,
            floors: floors.collect(),
            effects,
            tables,
        }))
    }

    /// Time and whitened residual of every row of what this was learnt from and of a later recording, held against what the
    /// joint would be like throughout if it had not changed.
    ///
    /// # Errors
    /// [`DiagnoseError`].
    pub fn unchanged(
        &self,
        robot: &Robot,
        later: &Recording,
    ) -> Result<Vec<[f64; 2]>, DiagnoseError> {
        let mut tables = self.tables.clone();
        tables.push(torque_of_one(robot, self.joint, later));
        let Some(throughout) = Self::of(robot, self.joint, tables)? else {
            return Ok(Vec::new());
        };
        let throughout = Self {
            floors: self.floors.clone(),
            ..throughout
        };
        let mut rows = Vec::new();
        for table in &throughout.tables {
            rows.extend(throughout.residual(table)?);
        }
        Ok(rows)
    }

    /// Time and whitened residual of every row of a recording, held against what was.
    ///
    /// # Errors
    /// [`DiagnoseError`] if it cannot be simulated along.
    pub fn residual(&self, recording: &Recording) -> Result<Vec<[f64; 2]>, DiagnoseError> {
        let table = torque_of_one(&self.settled, self.joint, recording);
        let stretches = stretches(&[&table], &self.settled)?;
        let Some(mut twin) = JointTwin::new(&self.settled, self.joint, &stretches)? else {
            return Ok(Vec::new());
        };
        for (known, deviations) in &self.known {
            known.apply(&mut twin.nominal, *deviations);
        }
        let simulated_nm = twin.simulated(&Changes::default(), None)?;
        let measured_nm = twin.measured()?;
        let residual_nm: Vec<f64> = measured_nm
            .iter()
            .zip(&simulated_nm)
            .map(|(a, b)| a - b)
            .collect();
        let whitener = Whitener::new(&twin.rows, |row| self.floor(row.channel));
        let white = whitener.apply(&residual_nm);
        let times = twin.rows.iter().map(|row| row.time_s);
        Ok(times.zip(white).map(|(time_s, w)| [time_s, w]).collect())
    }

    fn floor(&self, channel: Channel) -> Floor {
        let known = self.floors.iter().find(|(of, _)| *of == channel);
        known.map_or_else(Floor::default, |(_, floor)| *floor)
    }

    /// What a recording shows beyond what was: every candidate, most probable first.
    ///
    /// # Errors
    /// [`DiagnoseError`].
    pub fn look(&self, recording: &Recording) -> Result<Vec<Candidate>, DiagnoseError> {
        let table = torque_of_one(&self.mended, self.joint, recording);
        let stretches = stretches(&[&table], &self.mended)?;
        let Some(twin) = JointTwin::new(&self.mended, self.joint, &stretches)? else {
            return Ok(Vec::new());
        };
        let name = &self.mended.joints[self.joint].name;
        Ok(closed_loop::one(&twin, name)?.candidates)
    }
}

/// Positions of all joints, everything else of one: nothing is computed for the others.
fn torque_of_one(robot: &Robot, joint: usize, recording: &Recording) -> Recording {
    let mut table = recording.clone();
    for columns in &mut table.joints {
        if columns.name != robot.joints[joint].name {
            columns.signals.retain(|signal, _| {
                matches!(signal, Signal::MotorPositionRad | Signal::LinkPositionRad)
            });
        }
    }
    table
}

fn with_effects(robot: &Robot, joint: usize, effects: &[Effect]) -> Robot {
    let mut mended = robot.clone();
    let file = &mut mended.joints[joint];
    for effect in effects.iter().filter(|effect| !effect.is_whole_arm()) {
        // what has no room stays as it was; the residual shows it
        if effect.act(&mut file.steady_friction(), 1.0).is_ok() {
            file.effects.push(*effect);
        }
    }
    let chain = &robot.chain;
    let whole = effects.iter().filter(|effect| effect.is_whole_arm());
    let changed = changed_chain(
        chain.links(),
        chain.gravity_m_s2(),
        chain.tool(),
        whole.map(|effect| (None, effect)),
    );
    // what makes no body stays as it was; the residual shows it
    if let Ok(changed) = changed {
        mended.chain = changed;
    }
    mended
}

/// With links moved by so many deviations; nothing else may move any more.
fn with_links(robot: &Robot, of_links: &[(KnownValue, f64)]) -> Robot {
    let mut settled = robot.clone();
    let chain = &robot.chain;
    let mut links = chain.links().to_vec();
    for (value, deviations) in of_links {
        value
            .known
            .multiply(&mut links, 1.0 + value.deviation * deviations);
    }
    // links that make no body stay as they were; the residual shows it
    if let Ok(chain) = Chain::new(&links, chain.gravity_m_s2(), chain.tool()) {
        settled.chain = chain;
    }
    settled.tolerance = Tolerance {
        default: 0.0,
        parameters: Default::default(),
    };
    settled
}
