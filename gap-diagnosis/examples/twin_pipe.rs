//! One joint's twin along one recording, for programs in other languages: they write a line, they read numbers.
//!
//! ```text
//! cargo run --release -p gap-diagnosis --example twin_pipe -- robots/shd17.toml run.mcap
//! ```
//! Lines on standard input; a `C V J` is what the joint has beyond its robot file: Coulomb friction in Nm and viscous
//! friction in Nm s/rad at the joint side, rotor inertia in kg m² at the motor side.
//!
//! - `residual C V J`: the whitened residual, all compared numbers.
//! - `errors C V J`: root mean squares of what is left of the motor channel, in Nm, weighted as in a report of the
//!   diagnosis (rows near a reversal count little), and of recorded less simulated motor position under the robot file's
//!   controller, in rad at the joint side, the first half second aside.
//! - `refit`: `C V J` fitted by the diagnosis' own Gauss-Newton steps from zero, the robot file's known values beside them
//!   and what these found of the three included.
//!
//! The answer is a count as an unsigned integer of eight bytes and as many floating-point numbers of eight bytes, all
//! little-endian. The first joint of the robot file is meant. `benches/peers/identify` uses this.

use std::error::Error;
use std::io::{BufRead, Write};
use std::path::Path;

use gap_diagnosis::closed_loop::named::refitted;
use gap_diagnosis::closed_loop::search::{Model, Search, Term};
use gap_diagnosis::closed_loop::values::mean_square;
use gap_diagnosis::effects::{Shown, plain};
use joint_twin::joint::JointModel;
use joint_twin::observe::Channel;
use joint_twin::stretch::stretches;
use joint_twin::{Changes, JointTwin};
use robot::Effect;

const JOINT: usize = 0;
/// The effects that `refit` fits.
const NAMES: [&str; 3] = ["coulomb_friction", "viscous_friction", "rotor_inertia"];
/// Nobody knows how far friction and gear were wound up when the recording began.
const START_S: f64 = 0.5;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(robot), Some(path)) = (arguments.next(), arguments.next()) else {
        return Err("give a robot file and a recording".into());
    };
    let robot = robot::load(&robot)?;
    let recording = recording::read(Path::new(&path))?;
    let stretches = stretches(&[&recording], &robot)?;
    let twin = JointTwin::new(&robot, JOINT, &stretches)?;
    let twin = twin.ok_or("no torque of the first joint is recorded")?;
    let search = Search::new(&twin)?;
    let mut output = std::io::stdout().lock();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let (what, values) = parse(&line)?;
        let answer = match what {
            "residual" => residual(&search, &changes(&values)?)?,
            "errors" => errors(&search, &changes(&values)?)?.to_vec(),
            "refit" => refit(&search)?.to_vec(),
            _ => return Err(format!("`{what}` is none of residual, errors, refit").into()),
        };
        output.write_all(&(answer.len() as u64).to_le_bytes())?;
        for value in answer {
            output.write_all(&value.to_le_bytes())?;
        }
        output.flush()?;
    }
    Ok(())
}

fn parse(line: &str) -> Result<(&str, Vec<f64>), Box<dyn Error>> {
    let mut words = line.split_whitespace();
    let what = words.next().ok_or("an empty line")?;
    let values = words.map(str::parse).collect::<Result<_, _>>()?;
    Ok((what, values))
}

fn changes(values: &[f64]) -> Result<Changes, Box<dyn Error>> {
    let &[coulomb_nm, viscous_nm_s_rad, inertia_kg_m2] = values else {
        return Err("three values are wanted: C V J".into());
    };
    Ok(Changes {
        known: Vec::new(),
        effects: vec![
            Effect::CoulombFriction { coulomb_nm },
            Effect::ViscousFriction { viscous_nm_s_rad },
            Effect::RotorInertia { inertia_kg_m2 },
        ],
    })
}

fn left_nm(search: &Search<'_>, changes: &Changes) -> Result<Vec<f64>, Box<dyn Error>> {
    let simulated_nm = search.twin.simulated(changes, None)?;
    let pairs = search.measured_nm.iter().zip(&simulated_nm);
    Ok(pairs
        .map(|(measured, simulated)| measured - simulated)
        .collect())
}

fn residual(search: &Search<'_>, changes: &Changes) -> Result<Vec<f64>, Box<dyn Error>> {
    Ok(search.whitener.apply(&left_nm(search, changes)?))
}

fn errors(search: &Search<'_>, changes: &Changes) -> Result<[f64; 2], Box<dyn Error>> {
    let torque = mean_square(search, &left_nm(search, changes)?, Channel::Motor);
    let mut away_rad = Vec::new();
    for (piece, stretch) in search.twin.stretches().into_iter().enumerate() {
        let simulated = search.twin.controlled(piece, changes)?;
        let start = (START_S / stretch.drive.period_s) as usize;
        let pairs = stretch.drive.motor_rad.iter().zip(&simulated.motor_rad);
        away_rad.extend(pairs.skip(start).map(|(a, b)| a - b));
    }
    let square: f64 = away_rad.iter().map(|away_rad| away_rad * away_rad).sum();
    let position_rad = (square / away_rad.len() as f64).sqrt();
    Ok([torque.sqrt(), position_rad])
}

fn refit(search: &Search<'_>) -> Result<[f64; 3], Box<dyn Error>> {
    let shown = Shown {
        joints: search.twin.joints(),
        has_link_encoder: false,
        has_command: false,
        timing_is_open: false,
        limit_is_open: false,
        feels_weight: true,
    };
    let offered = plain(&search.scale, shown).into_iter();
    let terms = offered
        .filter(|hypothesis| NAMES.contains(&hypothesis.name()))
        .map(|hypothesis| Term {
            amplitudes: vec![0.0; hypothesis.amplitudes()],
            hypothesis,
        });
    let start = Model {
        terms: terms.collect(),
        ..Model::default()
    };
    let fitted = refitted(search, &start)?;
    let value = |term: &Term| match term.effect(&search.scale) {
        Effect::CoulombFriction { coulomb_nm } => [coulomb_nm, 0.0, 0.0],
        Effect::ViscousFriction { viscous_nm_s_rad } => [0.0, viscous_nm_s_rad, 0.0],
        Effect::RotorInertia { inertia_kg_m2 } => [0.0, 0.0, inertia_kg_m2],
        _ => [0.0; 3],
    };
    let nominal = &search.twin.nominal;
    let mut joint = nominal.clone();
    for (known, deviations) in search.twin.known.iter().zip(&fitted.known) {
        known.apply(&mut joint, *deviations);
    }
    let of = |joint: &JointModel| {
        [
            joint.friction.coulomb.coulomb_nm,
            joint.friction.viscous.viscous_nm_s_rad,
            joint.rotor_inertia_kg_m2 / joint.gear_ratio.powi(2),
        ]
    };
    let (before, after) = (of(nominal), of(&joint));
    let known = [0, 1, 2].map(|k| after[k] - before[k]);
    let terms = fitted.terms.iter().map(value);
    Ok(terms
        .chain([known])
        .fold([0.0; 3], |sum, own| [0, 1, 2].map(|k| sum[k] + own[k])))
}
