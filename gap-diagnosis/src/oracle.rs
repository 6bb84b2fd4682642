//! How far a gap shrinks when the true names are told and only their values are fitted: what the diagnosis is held
//! against where the truth is known.

use recording::Recording;
use robot::Robot;

use crate::diagnose::{DiagnoseError, prepared, settled};
use crate::explain::with_structure;
use crate::judge;
use crate::search::{Model, Search};
use crate::stretch::stretches;
use crate::twin::JointTwin;

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
    let search = Search::new(&twin)?;
    let settled = settled(&prepared.counted[joint], &search.scale);
    let refined = with_structure(&search, &settled, names)?;
    let before_nm = search.residual_nm(&Model::default())?;
    let (after_nm, _) = search.held_out(&refined);
    Ok(Some(judge::gap(&search, &before_nm, &after_nm).shrink))
}
