//! The report in sentences.

use gap_diagnosis::report::{
    JointReport, NamedEffect, Remains, Report, SharedEffect, TwinKind, Verdict,
};
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
    let shared: Vec<String> = report.shared_effects.iter().map(shared_sentence).collect();
    let own = match flagged.as_slice() {
        [only] => joint_sentence(only),
        _ => arm_sentence(report, &flagged),
    };
    let all: Vec<String> = shared.into_iter().chain([own]).collect();
    format!("{}.", all.join("; "))
}

fn shared_sentence(shared: &SharedEffect) -> String {
    let on = match shared.joints.as_slice() {
        few if few.len() <= 3 => few.join(", "),
        many => format!("{} joints", many.len()),
    };
    format!("{} acts on {on}", with_value(&shared.effect))
}

/// Which joint and effect hold most, and what that is worth; the rest is in the table.
fn arm_sentence(report: &Report, flagged: &[&JointReport]) -> String {
    let before_nm = |joint: &JointReport| joint.gap.torque_rms_nm.before;
    let largest = flagged
        .iter()
        .max_by(|a, b| before_nm(a).total_cmp(&before_nm(b)));
    let Some(largest) = largest else {
        return String::new();
    };
    let most = largest.effects.first().map_or_else(
        || "no effect on the list accounts for it".to_owned(),
        |found| format!("{} is {} % of it", with_value(found), percent(found.share)),
    );
    format!(
        "{} of {} joints have a gap, the largest {}, {} Nm rms: {most}",
        flagged.len(),
        report.joints.len(),
        largest.joint,
        number(before_nm(largest), 3),
    )
}

fn joint_sentence(joint: &JointReport) -> String {
    let effects: Vec<String> = joint.effects.iter().map(with_value).collect();
    let (is, takes) = if effects.len() == 1 {
        ("is", "takes")
    } else {
        ("are", "take")
    };
    let effects = effects.join(" and ");
    let name = &joint.joint;
    let taken: f64 = joint.effects.iter().map(|found| found.share).sum();
    let remains = joint.remaining_over.first().map_or(String::new(), |over| {
        format!(", over {}", variable(over.over))
    });
    match joint.verdict {
        Verdict::Explained if effects.is_empty() => {
            format!("{name}: the gap is explained by what acts on several joints")
        }
        Verdict::Explained if taken >= ALL => format!("{name}: {effects} {is} all of the gap"),
        Verdict::Explained => format!("{name}: {effects} {takes} {} % of the gap", percent(taken)),
        Verdict::PartlyExplained => format!(
            "{name}: {effects} {takes} {} % of the gap; something remains{remains}",
            percent(taken)
        ),
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
            format!("{name}: a gap{ratio} that no known effect accounts for{remains}")
        }
    }
}

/// Named effects that take so much are all of it: half of the last per cent that is shown.
const ALL: f64 = 0.995;

fn percent(share: f64) -> String {
    number(100.0 * share, 2)
}

/// An effect as people read it, with its first value and unit.
pub fn with_value(found: &NamedEffect) -> String {
    let name = words(&found.effect);
    let Some((parameter, value)) = found.parameters.iter().next() else {
        return name;
    };
    format!("{name} {} {}", number(value.value, 3), unit(parameter))
        .trim_end()
        .to_owned()
}

/// What the rest depends on, as people read it.
pub fn variable(over: Remains) -> &'static str {
    match over {
        Remains::Position => "position",
        Remains::Velocity => "velocity",
        Remains::Load => "load",
        Remains::Time => "time",
        Remains::SinceReversal => "the time since the last reversal",
        Remains::MotorPhase => "the motor's angle",
        Remains::OtherJoints => "the other joints' motion",
    }
}

/// An identifier as people read it.
fn words(effect: &str) -> String {
    effect
        .replace('_', " ")
        .replace("coulomb", "Coulomb")
        .replace("stribeck", "Stribeck")
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
