//! The report in sentences.

use gap_diagnosis::report::{JointReport, Report, TwinKind, Verdict};
use report::number;

use super::{gap_to_noise, with_gap};

/// The verdict on the whole robot.
pub fn sentence(report: &Report) -> String {
    let flagged: Vec<&JointReport> = with_gap(report).collect();
    if flagged.is_empty() {
        let mute = report
            .joints
            .iter()
            .filter(|joint| joint.verdict == Verdict::InsufficientData)
            .count();
        return match mute {
            0 => "Simulation and robot agree: no joint has a gap beyond noise and the tolerance of the robot file.".to_owned(),
            _ if mute == report.joints.len() => {
                "The data supports no statement about any joint.".to_owned()
            }
            _ => format!("No gap was found, but {mute} of {} joints lack the data for a statement.", report.joints.len()),
        };
    }
    let shared = report.shared_effects.iter().map(|shared| {
        format!(
            "{} (probability {}) acts on {}",
            words(&shared.effect.effect),
            number(shared.effect.probability, 2),
            shared.joints.join(", ")
        )
    });
    let own = flagged.iter().map(|joint| joint_sentence(joint));
    let all: Vec<String> = shared.chain(own).collect();
    format!("{}.", all.join("; "))
}

fn joint_sentence(joint: &JointReport) -> String {
    let effects: Vec<String> = joint
        .effects
        .iter()
        .map(|found| {
            format!(
                "{} (probability {})",
                words(&found.effect),
                number(found.probability, 2)
            )
        })
        .collect();
    let effects = effects.join(" and ");
    let name = &joint.joint;
    let percent = number(100.0 * joint.gap.shrink, 2);
    match joint.verdict {
        Verdict::Explained if effects.is_empty() => {
            format!("{name}: the gap is explained by what acts on several joints")
        }
        Verdict::Explained => {
            format!("{name}: the gap comes from {effects} and shrinks by {percent} % with that")
        }
        Verdict::PartlyExplained => {
            format!("{name}: {effects} shrinks the gap by {percent} %, but structure remains")
        }
        Verdict::Ambiguous => match joint.confusable.first() {
            Some(pair) => format!(
                "{name}: {} or {}, this data cannot tell them apart",
                words(&pair.effects[0]),
                words(&pair.effects[1])
            ),
            None => format!("{name}: two explanations that this data cannot tell apart"),
        },
        _ => {
            let ratio = gap_to_noise(joint).map_or(String::new(), |ratio| {
                format!(" of {} times the noise", number(ratio, 2))
            });
            format!("{name}: a gap{ratio} that no known effect accounts for")
        }
    }
}

/// An identifier as people read it.
fn words(effect: &str) -> String {
    effect.replace('_', " ")
}

/// A verdict as people read it.
pub fn verdict_in_words(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::NoGap => "no gap",
        Verdict::Explained => "explained",
        Verdict::PartlyExplained => "partly explained",
        Verdict::Unexplained => "unexplained",
        Verdict::Ambiguous => "ambiguous",
        Verdict::InsufficientData => "not enough data",
    }
}

/// How the simulation was driven.
pub fn twin(kind: TwinKind) -> &'static str {
    match kind {
        TwinKind::ClosedLoop => "closed loop, by the robot file's controller",
        TwinKind::FollowsMotion => "follows the recorded motion: the controller is not known",
        TwinKind::OpenLoop => "open loop, by the recorded torque",
    }
}

/// The unit that a parameter's name ends with.
pub fn unit(parameter: &str) -> &'static str {
    const UNITS: [(&str, &str); 13] = [
        ("_nm_s2_rad2", "Nm s²/rad²"),
        ("_nm_s_rad", "Nm s/rad"),
        ("_nm_rad", "Nm/rad"),
        ("_nm_s", "Nm/s"),
        ("_nm", "Nm"),
        ("_kg_m2", "kg m²"),
        ("_kg", "kg"),
        ("_rad_s", "rad/s"),
        ("_rad", "rad"),
        ("_hz", "Hz"),
        ("_s", "s"),
        ("_per_motor_rev", "per motor turn"),
        ("_per_rev", "per turn"),
    ];
    // harmonics are numbered, coordinates named
    let name = parameter
        .strip_suffix("_2")
        .or_else(|| parameter.strip_suffix("_3"))
        .unwrap_or(parameter);
    if name.starts_with("centre_m") {
        return "m";
    }
    let known = UNITS.iter().find(|(suffix, _)| name.ends_with(suffix));
    known.map_or("", |(_, unit)| unit)
}

/// What somebody should do who has read so far.
pub fn next_steps(report: &Report) -> Vec<String> {
    let mut steps = Vec::new();
    for finding in &report.data {
        if finding.severity == "error" && !finding.remedy.is_empty() {
            steps.push(format!("Mend the data first: {finding}"));
        }
    }
    let named = report.joints.iter().any(|joint| !joint.effects.is_empty());
    if named || !report.shared_effects.is_empty() {
        steps.push(
            "Write the effects into the robot file with `flexspline gap apply`, run it, and diagnose the new recording."
                .to_owned(),
        );
    }
    for joint in &report.joints {
        let name = &joint.joint;
        match joint.verdict {
            Verdict::Ambiguous => steps.push(format!(
                "{name}: record the trajectory that `flexspline gap suggest` writes; it separates what this data cannot."
            )),
            Verdict::Unexplained => steps.push(format!(
                "{name}: look at the joint where and when the maps above are brightest; the cause is on no list."
            )),
            Verdict::PartlyExplained => steps.push(format!(
                "{name}: something beside what was named remains; look at what the maps above still show once it is applied."
            )),
            Verdict::InsufficientData => steps.push(format!("{name}: {}", joint.reason)),
            Verdict::NoGap | Verdict::Explained => {}
        }
        let bound = joint.effects.iter().filter(|found| {
            found
                .parameters
                .values()
                .any(|parameter| parameter.at_bound)
        });
        steps.extend(bound.map(|found| {
            format!(
                "{name}: {} ended on the limit of what was searched; take it for a shape, not for a value.",
                words(&found.effect)
            )
        }));
    }
    if steps.is_empty() {
        steps.push("Nothing: the robot file describes this robot on this motion.".to_owned());
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_is_found_by_the_name_s_end() {
        for (name, expected) in [
            ("coulomb_nm", "Nm"),
            ("viscous_nm_s_rad", "Nm s/rad"),
            ("drift_nm_s", "Nm/s"),
            ("stribeck_velocity_rad_s", "rad/s"),
            ("phase_rad_2", "rad"),
            ("centre_m_x", "m"),
            ("cycles_per_motor_rev_3", "per motor turn"),
            ("gain", ""),
        ] {
            assert_eq!(unit(name), expected, "{name}");
        }
    }
}
