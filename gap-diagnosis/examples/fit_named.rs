//! Effects that the caller names, fitted to a recording by the diagnosis' own steps: what an effect is worth that the
//! diagnosis did not choose.
//!
//! ```text
//! cargo run --release -p gap-diagnosis --example fit_named -- robot.toml log.csv stribeck_friction
//! ```
//! The robot file's known values are fitted beside them and not told. Prints one line an effect, as a robot file's `effects`
//! list has it, and behind `#` the whitened residual, root mean square, with no effect and with them. The first joint of the
//! robot file is meant.

use std::error::Error;
use std::path::Path;

use gap_diagnosis::closed_loop::named::refitted;
use gap_diagnosis::closed_loop::search::{Model, Search, Term};
use gap_diagnosis::effects::{Hypothesis, Shown, plain};
use joint_twin::JointTwin;
use joint_twin::stretch::stretches;

const JOINT: usize = 0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(robot), Some(path)) = (arguments.next(), arguments.next()) else {
        return Err("give a robot file, a recording and the names of effects".into());
    };
    let robot = robot::load(&robot)?;
    let recording = recording::read(Path::new(&path))?;
    let stretches = stretches(&[&recording], &robot)?;
    let twin = JointTwin::new(&robot, JOINT, &stretches)?;
    let twin = twin.ok_or("no torque of the first joint is recorded")?;
    let search = Search::new(&twin)?;
    let size = |residual_nm: &[f64]| {
        let white = search.whitener.apply(residual_nm);
        (white.iter().map(|x| x * x).sum::<f64>() / white.len() as f64).sqrt()
    };
    let nothing = refitted(&search, &Model::default())?;
    let mut best = (size(&search.residual_nm(&nothing)?), nothing);
    let shown = Shown {
        joints: search.twin.joints(),
        has_link_encoder: false,
        has_command: false,
        timing_is_open: false,
        limit_is_open: false,
        feels_weight: true,
    };
    let before = best.0;
    for name in arguments {
        let offered = plain(&search.scale, shown).into_iter();
        let shapes: Vec<Hypothesis> = offered.filter(|shape| shape.name() == name).collect();
        if shapes.is_empty() {
            return Err(
                format!("`{name}` is no effect that this recording can be asked for").into(),
            );
        }
        let so_far = best.1.clone();
        best.0 = f64::INFINITY;
        for hypothesis in shapes {
            let mut start = so_far.clone();
            start.terms.push(Term {
                amplitudes: vec![0.0; hypothesis.amplitudes()],
                hypothesis,
            });
            let refined = refitted(&search, &start)?;
            let left = size(&search.residual_nm(&refined)?);
            if left < best.0 {
                best = (left, refined);
            }
        }
    }
    let (after, found) = best;
    for term in &found.terms {
        let effect = serde_json::to_value(term.effect(&search.scale))?;
        let fields = effect.as_object().ok_or("an effect is a table")?;
        let entries: Vec<String> = fields
            .iter()
            .map(|(key, value)| format!("{key} = {value}"))
            .collect();
        println!("  {{ {} }},", entries.join(", "));
    }
    println!("  # whitened residual {before:.3}, {after:.3}");
    Ok(())
}
