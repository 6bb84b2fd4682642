//! What was named at one joint may change how its link swings, or how its encoders show that. The other joints feel the link by
//! the arm's rigid bodies; their twins took it for the robot file's, and they were told effects of their own for it. They are
//! judged again beside it where that explains more.

use joint_model::filter::FilterError;
use robot::{Effect, Robot};

use crate::evidence::naming;
use crate::explain::{Explanation, explain, without_effects};
use crate::on_all_cores::OnAllCores;
use crate::refine::Refined;
use crate::repeats::floor::Repeated;
use crate::report::DataFinding;
use crate::search::Search;
use crate::stretch::Stretch;
use crate::twin::JointTwin;

/// Joints whose effects are tried, those first whose names are worth most.
const TRIED: usize = 3;

/// A joint's search and what it was told; none where nothing tells its torque.
pub(crate) type Searched<'a> = Option<(Search<'a>, Explanation)>;

/// A joint with effects that others feel, and a robot that has them.
pub(crate) struct Beside {
    joint: usize,
    names: Vec<&'static str>,
    /// The other joints with a gap.
    others: Vec<usize>,
    pub robot: Robot,
}

impl Beside {
    /// Every joint that was told such effects while others have a gap.
    pub fn among(robot: &Robot, joints: &[Searched<'_>]) -> Vec<Self> {
        let has_gap = |joint: &usize| {
            let told = joints[*joint].as_ref();
            told.is_some_and(|(_, explanation)| explanation.is_told())
        };
        let with_gap: Vec<usize> = (0..joints.len()).filter(has_gap).collect();
        let mut found: Vec<(f64, Self)> = Vec::new();
        for &joint in &with_gap {
            let Some((search, explanation)) = &joints[joint] else {
                continue;
            };
            let terms = explanation.refined.model.terms.iter();
            let felt: Vec<(&'static str, Effect)> = terms
                .filter(|term| term.hypothesis.is_felt())
                .map(|term| (term.hypothesis.effect, term.effect(&search.scale)))
                .collect();
            let others: Vec<usize> = with_gap.iter().copied().filter(|k| *k != joint).collect();
            if felt.is_empty() || others.is_empty() {
                continue;
            }
            let beside = Self {
                joint,
                names: felt.iter().map(|(name, _)| *name).collect(),
                others,
                robot: with(robot, joint, felt.into_iter().map(|(_, effect)| effect)),
            };
            found.push((explanation.named_gain(), beside));
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found
            .into_iter()
            .take(TRIED)
            .map(|(_, beside)| beside)
            .collect()
    }

    /// Of the other joints with a gap, in the robot's order; none of the rest.
    pub fn twins<'a>(
        &'a self,
        stretches: &'a [Stretch],
    ) -> Result<Vec<Option<JointTwin<'a>>>, FilterError> {
        (0..self.robot.joints.len())
            .on_all_cores(|joint| {
                if self.others.contains(&joint) {
                    JointTwin::new(&self.robot, joint, stretches)
                } else {
                    Ok(None)
                }
            })
            .collect()
    }

    fn note(&self, joint: usize) -> DataFinding {
        let of = &self.robot.joints[self.joint].name;
        DataFinding {
            joint: Some(self.robot.joints[joint].name.clone()),
            severity: "note".to_owned(),
            what: format!(
                "feels what was named at {of} ({}); it is judged beside it",
                self.names.join(", ")
            ),
            remedy: String::new(),
        }
    }
}

/// The robot with effects of one joint.
fn with(robot: &Robot, joint: usize, effects: impl Iterator<Item = Effect>) -> Robot {
    let mut changed = robot.clone();
    for effect in effects {
        if !matches!(effect, Effect::LinkInertia { .. }) {
            changed.joints[joint].effects.push(effect);
            continue;
        }
        let chain = robot::changed_chain(
            changed.chain.links(),
            changed.chain.gravity_m_s2(),
            changed.chain.tool(),
            [(Some(joint), &effect)],
        );
        // an inertia that makes no body was named wrongly, and helps nobody
        if let Ok(chain) = chain {
            changed.chain = chain;
        }
    }
    changed
}

/// Explains anew the joints that have less to explain beside what was named at another one: the one that takes most off all of
/// them together. `twins`: of each that is tried.
pub(crate) fn explained_again<'a>(
    tried: &[Beside],
    twins: &'a [Vec<Option<JointTwin<'a>>>],
    mut joints: Vec<Searched<'a>>,
    repeated: &Repeated,
) -> Result<(Vec<Searched<'a>>, Vec<DataFinding>), FilterError> {
    let all = tried
        .iter()
        .zip(twins)
        .on_all_cores(|(beside, twins)| better(&beside.robot, twins, &joints, repeated))
        .collect::<Result<Vec<_>, FilterError>>()?;
    let mut best: Option<(f64, &Beside, Vec<Better<'a>>)> = None;
    for (beside, better) in tried.iter().zip(all) {
        let nats = better.iter().map(|joint| joint.nats).sum();
        if nats > best.as_ref().map_or(0.0, |(most, ..)| *most) {
            best = Some((nats, beside, better));
        }
    }
    let Some((_, beside, better)) = best else {
        return Ok((joints, Vec::new()));
    };
    let notes = better.iter().map(|of| beside.note(of.joint)).collect();
    let again = better
        .into_iter()
        .on_all_cores(|Better { joint, search, .. }| {
            let settled = joints[joint]
                .as_ref()
                .map_or(&[][..], |(_, before)| &before.without.model.settled);
            let explanation = explain(&search, settled)?;
            Ok((joint, (search, explanation)))
        })
        .collect::<Result<Vec<_>, FilterError>>()?;
    for (joint, searched) in again {
        joints[joint] = Some(searched);
    }
    Ok((joints, notes))
}

/// A joint of which another twin leaves less than the one before, no effect added.
struct Better<'a> {
    joint: usize,
    /// How much less.
    nats: f64,
    search: Search<'a>,
}

/// The joints of which these twins leave less than those before.
fn better<'a>(
    robot: &Robot,
    twins: &'a [Option<JointTwin<'a>>],
    joints: &[Searched<'_>],
    repeated: &Repeated,
) -> Result<Vec<Better<'a>>, FilterError> {
    let all = twins
        .iter()
        .zip(joints)
        .enumerate()
        .on_all_cores(|(joint, (twin, before))| {
            let (Some(twin), Some((search, explanation))) = (twin, before) else {
                return Ok(None);
            };
            let left = |search: &Search<'_>, refined: &Refined| {
                search.left(&refined.model, &refined.residual_nm).total()
            };
            let before = left(search, &explanation.without);
            let mut search = Search::new(twin)?;
            search.repeats_nm = repeated.scatter_nm(&robot.joints[joint].name, &search)?;
            let now = without_effects(&search, &explanation.without.model.settled)?;
            let nats = 0.5 * (before - left(&search, &now));
            Ok((nats > naming(1)).then_some(Better {
                joint,
                nats,
                search,
            }))
        })
        .collect::<Result<Vec<_>, FilterError>>()?;
    Ok(all.into_iter().flatten().collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use std::collections::BTreeMap;

    use recording::{JointColumns, Recording, Signal};
    use robot::{RobotFile, Source};

    use crate::diagnose::diagnose;
    use crate::report::{Report, Verdict};

    use super::*;

    const RATE_HZ: f64 = 250.0;
    const ROWS: usize = 5000;
    const RATIO: f64 = 100.0;
    const ROTOR_KG_M2: f64 = 2e-5;
    const COULOMB_NM: [f64; 2] = [3.0, 1.0];
    const VISCOUS_NM_S_RAD: [f64; 2] = [2.0, 0.6];

    fn robot() -> Robot {
        let link = |joint: &str, height_m: f64, mass_kg: f64| {
            format!(
                "[[link]]\njoint = \"{joint}\"\norigin_m = [0.0, 0.0, {height_m}]\n\
                 origin_rpy_rad = [0.0, 0.0, 0.0]\naxis = [0.0, 1.0, 0.0]\nmass_kg = {mass_kg}\n\
                 centre_of_mass_m = [0.0, 0.0, 0.2]\n\
                 inertia_kg_m2 = {{ xx = 0.06, yy = 0.06, zz = 0.004, xy = 0.0, yz = 0.0, xz = 0.0 }}\n"
            )
        };
        let joint = |name: &str, index: usize| {
            let [coulomb_nm, viscous] = [COULOMB_NM[index], VISCOUS_NM_S_RAD[index]];
            format!(
                "[[joint]]\nname = \"{name}\"\ngear_ratio = {RATIO}\n\
                 rotor_inertia_kg_m2 = {ROTOR_KG_M2}\nmotor_encoder_resolution_rad = 1e-5\n\
                 torque_noise_nm = 2e-4\neffects = [\n\
                 {{ effect = \"coulomb_friction\", coulomb_nm = {coulomb_nm} }},\n\
                 {{ effect = \"viscous_friction\", viscous_nm_s_rad = {viscous} }},\n]\n"
            )
        };
        let text = [
            "name = \"two\"\ngravity_m_s2 = [0.0, 0.0, -9.81]\nparameter_tolerance = 0.02\n".into(),
            link("shoulder", 0.3, 4.0),
            link("elbow", 0.4, 3.0),
            joint("shoulder", 0),
            joint("elbow", 1),
        ];
        let file = RobotFile::parse(&text.concat(), "two.toml").unwrap();
        file.build(Source::Shipped("two")).unwrap()
    }

    /// Position, velocity and acceleration of a joint.
    fn motion(joint: usize, time_s: f64) -> [f64; 3] {
        let sines = [(0.5, 1.3), (0.25, 3.1), (0.05, 9.0)];
        let mut at = [0.0; 3];
        for (size_rad, rad_s) in sines {
            let rad_s = rad_s * (1.0 + 0.17 * joint as f64);
            let angle = rad_s * time_s + joint as f64;
            at[0] += size_rad * angle.sin();
            at[1] += size_rad * rad_s * angle.cos();
            at[2] -= size_rad * rad_s * rad_s * angle.sin();
        }
        at
    }

    /// What the arm shows with this fault of the elbow's motor encoder, motor side, over the motor's angle.
    fn recorded(robot: &Robot, fault_rad: impl Fn(f64) -> f64) -> Recording {
        let mut columns = vec![(Vec::new(), Vec::new()); 2];
        for k in 0..ROWS {
            let time_s = k as f64 / RATE_HZ;
            let at = [motion(0, time_s), motion(1, time_s)];
            let of = |which: usize| [at[0][which], at[1][which]];
            let mut torque_nm = [0.0; 2];
            let chain = &robot.chain;
            chain.inverse_dynamics(&of(0), &of(1), &of(2), &mut torque_nm);
            for (joint, (motor_rad, motor_nm)) in columns.iter_mut().enumerate() {
                let [position_rad, velocity_rad_s, acceleration_rad_s2] = at[joint];
                let friction_nm = COULOMB_NM[joint] * (velocity_rad_s / 1e-3).tanh()
                    + VISCOUS_NM_S_RAD[joint] * velocity_rad_s;
                let rotor_nm = RATIO * RATIO * ROTOR_KG_M2 * acceleration_rad_s2;
                let turned_rad = RATIO * position_rad;
                let off_rad = if joint == 1 {
                    fault_rad(turned_rad)
                } else {
                    0.0
                };
                motor_rad.push(turned_rad + off_rad);
                motor_nm.push((torque_nm[joint] + friction_nm + rotor_nm) / RATIO);
            }
        }
        let joints = columns.into_iter().zip(["shoulder", "elbow"]);
        Recording {
            time_s: (0..ROWS).map(|k| k as f64 / RATE_HZ).collect(),
            segment: None,
            joints: joints
                .map(|((motor_rad, motor_nm), name)| JointColumns {
                    name: name.to_owned(),
                    signals: BTreeMap::from([
                        (Signal::MotorPositionRad, motor_rad),
                        (Signal::MotorTorqueNm, motor_nm),
                    ]),
                })
                .collect(),
            sample_rate_hz: RATE_HZ,
            metadata: BTreeMap::new(),
            truncated: false,
        }
    }

    fn told(fault_rad: impl Fn(f64) -> f64) -> Report {
        let robot = robot();
        let recording = recorded(&robot, fault_rad);
        let recordings = [("made up".to_owned(), recording)];
        diagnose(&robot, &recordings, &|_| ()).unwrap().report
    }

    #[test]
    fn a_joint_that_sees_its_neighbours_wrong_encoder_has_no_gap_beside_it() {
        for joint in told(|_| 0.0).joints {
            assert_eq!(joint.verdict, Verdict::NoGap, "{}", joint.joint);
        }
        let report = told(|turned_rad| 0.03 * (turned_rad + 0.4).sin());
        let elbow = &report.joints[1];
        assert_eq!(elbow.effects[0].effect, "encoder_eccentricity");
        let notes: Vec<_> = report.data.iter().map(|finding| &finding.what).collect();
        assert!(
            notes.iter().any(|what| what.contains("judged beside it")),
            "{notes:?}"
        );
        assert_eq!(report.joints[0].verdict, Verdict::NoGap);
    }
}
