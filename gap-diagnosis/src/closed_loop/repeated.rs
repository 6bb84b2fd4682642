//! Repeats among the recordings of a diagnosis: the noise floor that they show, beside the robot file's.
//!
//! What counts is the disturbance torque less the twin's along the repeat's own motion. Where repeats move apart, the torque
//! that a model makes of their motion is no noise.

use std::collections::BTreeMap;

use gap_report::DataFinding;
use joint_twin::TwinError;
use joint_twin::observe::Channel;
use recording::Recording;
use recording::repeats::{Group, Place, Repeat, mean_and_variance, repeats};

use crate::closed_loop::search::{Model, Search};

/// The repeats among a diagnosis' recordings.
pub(crate) struct Repeated {
    groups: Vec<Group>,
}

impl Repeated {
    /// None are looked for in a recording alone.
    pub fn among(recordings: &[(String, Recording)]) -> Self {
        let groups = match recordings {
            [] | [_] => Vec::new(),
            several => repeats(several).unwrap_or_default(),
        };
        Self { groups }
    }

    /// Those that are alike, of groups in which the joint moves.
    fn alike(&self, joint: &str) -> Vec<Vec<Place>> {
        let moves = |group: &&Group| {
            let mut joints = group.joints.iter();
            joints.any(|found| found.joint == joint && !found.stands)
        };
        let groups = self.groups.iter().filter(moves);
        let alike = groups.map(|group| group.alike().collect::<Vec<Place>>());
        alike.filter(|alike| alike.len() > 1).collect()
    }

    /// Standard deviation between repeats of what the robot file's twin leaves of the motor's channel, rows away from
    /// reversals; none without repeats.
    ///
    /// # Errors
    /// [`TwinError`].
    pub fn scatter_nm(&self, joint: &str, search: &Search<'_>) -> Result<Option<f64>, TwinError> {
        let alike = self.alike(joint);
        if alike.is_empty() {
            return Ok(None);
        }
        let twin = search.twin;
        let left_nm = search.residual_nm(&Model::default())?;
        let (places, stretches) = (twin.places(), twin.stretches());
        let group_of = |stretch: usize| alike.iter().position(|g| g.contains(&places[stretch]));
        // the same instant of the repeats of a group
        let mut at: BTreeMap<(usize, i64), (Vec<f64>, f64)> = BTreeMap::new();
        for (k, row) in twin.rows.iter().enumerate() {
            let Some(group) = group_of(row.stretch).filter(|_| row.channel == Channel::Motor)
            else {
                continue;
            };
            let since_s = row.time_s - stretches[row.stretch].drive.start_s;
            let instant = (since_s * twin.rows_hz()).round() as i64;
            let (values_nm, weight) = at.entry((group, instant)).or_default();
            values_nm.push(left_nm[k]);
            *weight += search.whitener.weight(k).powi(2);
        }
        let several = at.values().filter(|(values_nm, _)| values_nm.len() > 1);
        let (square, weights) =
            several.fold((0.0, 0.0), |(square, weights), (values_nm, weight)| {
                let (_, variance) = mean_and_variance(values_nm);
                (square + weight * variance, weights + weight)
            });
        Ok((weights > 0.0).then(|| (square / weights).sqrt()))
    }

    /// What is to be said of a joint's noise floor; nothing without repeats.
    pub fn floor(&self, joint: &str, search: &Search<'_>) -> Option<DataFinding> {
        let scatter_nm = search.repeats_nm?;
        let count: usize = self.alike(joint).iter().map(Vec::len).sum();
        let file_nm = search.file_noise_nm(Channel::Motor);
        let taken = if scatter_nm > file_nm {
            "the repeats' scatter"
        } else {
            "the robot file's"
        };
        Some(DataFinding {
            joint: Some(joint.to_owned()),
            severity: "note".to_owned(),
            what: format!(
                "noise floor of the torque is {taken}: {count} repeats of one input scatter by {scatter_nm:.3e} Nm, the robot \
                 file's noise makes {file_nm:.3e} Nm"
            ),
            remedy: String::new(),
        })
    }

    /// Repeats that are not alike: what is diagnosed together may not be one robot.
    pub fn that_differ(&self) -> Vec<DataFinding> {
        let differ = self.groups.iter().flat_map(|group| &group.repeats);
        let differ = differ.filter(|repeat| repeat.differs);
        differ.flat_map(finding).collect()
    }
}

fn finding(repeat: &Repeat) -> impl Iterator<Item = DataFinding> {
    let joints = repeat.joints.iter().filter(|joint| joint.differs);
    joints.map(|joint| DataFinding {
        joint: Some(joint.joint.clone()),
        severity: "warning".to_owned(),
        what: format!(
            "{} from {:.2} s on is not as the other repeats of its input: {} deviates by {:.1} of their scatter, probability {:.0e}",
            repeat.recording, repeat.from_s, joint.signal, joint.in_scatters, joint.probability
        ),
        remedy: "find out what was changed, or diagnose that recording alone".to_owned(),
    })
}
