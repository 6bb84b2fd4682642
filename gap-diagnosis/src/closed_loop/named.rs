//! Effects whose names the caller tells: their values fitted, and how far the gap shrinks with them. What the diagnosis is held against
//! where the truth is known.

use joint_twin::JointTwin;
use joint_twin::TwinError;
use joint_twin::stretch::stretches;
use recording::Recording;
use robot::Robot;

use super::joint::{Joint, ROUNDS};
use super::refine::{Worth, refined};
use super::rows::{About, Compared};
use crate::closed_loop::repeated::Repeated;
use crate::closed_loop::search::{Model, Search};
use crate::diagnose::{DiagnoseError, prepared};
use crate::evidence::{Evidence, Names, Settled};

/// Held-out shrink of one joint with effects of these names; none where no recording tells its torque.
///
/// # Errors
/// [`DiagnoseError`].
pub fn shrink(
    robot: &Robot,
    recordings: &[(String, Recording)],
    joint: usize,
    names: &[&str],
) -> Result<Option<f64>, DiagnoseError> {
    let tables: Vec<&Recording> = recordings.iter().map(|(_, recording)| recording).collect();
    let prepared = prepared(robot, &tables, |_| true);
    let stretches = stretches(&prepared.tables(&tables), &prepared.robot)?;
    let Some(twin) = JointTwin::new(&prepared.robot, joint, &stretches)? else {
        return Ok(None);
    };
    let counted = &prepared.counted[joint];
    let name = &robot.joints[joint].name;
    let joint = Joint::of(joint, &twin, counted, name, &Repeated::among(&[]), None)?;
    let mut about = About::of(&joint.search, &joint.compared, &joint.start())?;
    for _ in 0..ROUNDS {
        let evidence = about.evidence(&joint.compared, None);
        let start = about.told(
            &joint.search,
            &evidence.fit(best_of(&about, &evidence, names)),
        );
        let worth = Worth::of(&joint.compared, evidence.settled());
        let known = &about.known;
        let fitted = refined(&joint.search, &joint.compared, &worth, known, &start)?;
        about = About::of(&joint.search, &joint.compared, &fitted.model)?;
    }
    let evidence = about.evidence(&joint.compared, None);
    let left = evidence.mean_squares(best_of(&about, &evidence, names));
    let gap_nm = joint.search.residual_nm(&Model::default())?;
    Ok(Some(joint.shrink(&joint.compared.pick(&gap_nm), left[0])))
}

/// Of all shapes of these names the ones that fit best together. A name that shows nothing here is left out.
fn best_of(about: &About, evidence: &Evidence, names: &[&str]) -> Names {
    let mut sets: Vec<Names> = vec![0];
    for name in names {
        let responses = about.responses.iter().enumerate();
        let own: Vec<usize> = responses
            .filter(|(_, response)| response.term.hypothesis.name() == *name)
            .map(|(item, _)| item)
            .collect();
        if !own.is_empty() {
            let with = |set: &Names| own.iter().map(|item| set | 1 << item).collect::<Vec<_>>();
            sets = sets.iter().flat_map(with).collect();
        }
    }
    let score = |set: &Names| evidence.scored(*set).score;
    let best = sets
        .into_iter()
        .max_by(|a, b| score(a).total_cmp(&score(b)));
    best.unwrap_or(0)
}

/// A model with the values that leave least, its names as they are; the file's values are fitted beside them.
///
/// # Errors
/// [`TwinError`].
pub fn refitted(search: &Search<'_>, start: &Model) -> Result<Model, TwinError> {
    let compared = Compared::of(search);
    let about = About::of(search, &compared, start)?;
    let settled: Vec<Settled> = compared
        .spans
        .iter()
        .map(|span| Settled {
            independent_rows: span.rows.len() as f64,
            variance: span.floor_nm.powi(2).max(f64::MIN_POSITIVE),
            floor: span.floor_nm.powi(2),
        })
        .collect();
    let worth = Worth::of(&compared, &settled);
    let mut start = start.clone();
    start.known.resize(search.twin.known.len(), 0.0);
    Ok(refined(search, &compared, &worth, &about.known, &start)?.model)
}
