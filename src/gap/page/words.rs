//! The report in sentences.

use gap_report::{
    BeforeAfter, Candidate, Confusable, JointReport, NamedEffect, Remains, Report, SharedEffect,
    TwinKind, Verdict,
};
use report::number;

use super::{gap_to_noise, largest_first, of_shared, with_gap};

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
    let own = match flagged.as_slice() {
        [only] => joint_sentence(report, only),
        _ => arm_sentence(report, &flagged),
    };
    let largest = largest_first(report).into_iter().next();
    let most = largest.and_then(|joint| joint.effects.first());
    let most = most.map_or(0.0, |found| found.share);
    // what holds most of the gaps comes first
    let (larger, smaller): (Vec<_>, Vec<_>) = report
        .shared_effects
        .iter()
        .partition(|shared| shared.effect.share >= most);
    let [larger, smaller] = [larger, smaller].map(|all| all.into_iter().map(shared_sentence));
    let all: Vec<String> = larger.chain([own]).chain(smaller).collect();
    format!("{}.", all.join("; "))
}

fn shared_sentence(shared: &SharedEffect) -> String {
    let on = match shared.joints.as_slice() {
        few if few.len() <= 3 => few.join(", "),
        many => format!("{} joints", many.len()),
    };
    format!(
        "{} acts on {on}, {} % of their gaps on average",
        with_value(&shared.effect),
        percent(shared.effect.share)
    )
}

/// Which joint and effect hold most, and what all that is named is worth; the rest is in the table.
fn arm_sentence(report: &Report, flagged: &[&JointReport]) -> String {
    let Some(largest) = largest_first(report).into_iter().next() else {
        return String::new();
    };
    let shared = of_shared(report, largest).map(|(shared, here)| (&shared.effect, here.share));
    let own = largest.effects.iter().map(|found| (found, found.share));
    let most = own.chain(shared).max_by(|a, b| a.1.total_cmp(&b.1));
    let most = most.map_or_else(
        || without_effects(report, largest),
        |(found, share)| format!("of which {} is {} %", with_value(found), percent(share)),
    );
    let rms_nm = |of: fn(&BeforeAfter) -> f64| {
        let squares = flagged
            .iter()
            .map(|joint| of(&joint.gap.torque_rms_nm).powi(2));
        number(squares.sum::<f64>().sqrt(), 3)
    };
    format!(
        "{} of {} joints have a gap, the largest {} with {} Nm rms, {most}; what is named brings the arm's from {} to {} Nm rms",
        flagged.len(),
        report.joints.len(),
        largest.joint,
        number(largest.gap.torque_rms_nm.before, 3),
        rms_nm(|rms| rms.before),
        rms_nm(|rms| rms.after),
    )
}

/// What is said of a joint none of whose own effects is named.
fn without_effects(report: &Report, joint: &JointReport) -> String {
    match joint.verdict {
        Verdict::Explained => "explained by what acts on several joints".to_owned(),
        Verdict::PartlyExplained => "partly explained by what acts on several joints".to_owned(),
        _ => likely(report, joint)
            .unwrap_or_else(|| "for which no effect on the list accounts".to_owned()),
    }
}

/// What a gap without a name most likely is, where the report holds an effect for that.
fn likely(report: &Report, joint: &JointReport) -> Option<String> {
    let first = joint.candidates.first()?;
    let is_effect = !matches!(first.effect.as_str(), "none" | "unknown");
    // what several joints share may be named while it takes little here
    let mut shared = report.shared_effects.iter();
    let is_named = shared.any(|shared| shared.effect.effect == first.effect);
    (is_effect && !is_named).then(|| {
        format!(
            "most likely {} ({}), not surely enough to be named",
            words(&first.effect),
            number(first.probability, 2)
        )
    })
}

fn joint_sentence(report: &Report, joint: &JointReport) -> String {
    let effects: Vec<String> = joint.effects.iter().map(with_value).collect();
    let (are, take) = if effects.len() == 1 {
        ("is", "takes")
    } else {
        ("are", "take")
    };
    let effects = listed(&effects);
    let gap = format!(
        "{} has a gap of {} Nm rms",
        joint.joint,
        number(joint.gap.torque_rms_nm.before, 3)
    );
    let taken: f64 = joint.effects.iter().map(|found| found.share).sum();
    let takes = format!("{effects} {take} {} % of it", percent(taken));
    match joint.verdict {
        Verdict::Explained if effects.is_empty() => {
            format!("{gap}, {}", without_effects(report, joint))
        }
        Verdict::Explained if taken >= ALL => format!("{gap}: {effects} {are} all of it"),
        Verdict::Explained => format!("{gap}: {takes}"),
        Verdict::PartlyExplained => {
            let rest = rest_over(joint).map_or("has no name".to_owned(), |over| {
                format!("depends on {over}")
            });
            if effects.is_empty() {
                let partly = without_effects(report, joint);
                return format!("{gap}, {partly}; what remains {rest}");
            }
            format!("{gap}: {takes}; what remains {rest}")
        }
        Verdict::Ambiguous => match undecided(&joint.candidates, &joint.confusable) {
            Some(pair) => format!(
                "{gap}: {} or {}, this data cannot tell them apart",
                words(&pair.effects[0]),
                words(&pair.effects[1])
            ),
            None => format!("{gap}: two explanations that this data cannot tell apart"),
        },
        _ => {
            let ratio = gap_to_noise(joint).map_or(String::new(), |ratio| {
                format!(", {} times the noise,", number(ratio, 2))
            });
            let rest =
                rest_over(joint).map_or(String::new(), |over| format!("; it depends on {over}"));
            match likely(report, joint) {
                Some(likely) => format!("{gap}{}, {likely}{rest}", ratio.trim_end_matches(',')),
                None => format!("{gap}{ratio} that no known effect accounts for{rest}"),
            }
        }
    }
}

/// What the rest depends on most, where that is known.
fn rest_over(joint: &JointReport) -> Option<&'static str> {
    let most = joint.remaining_over.first()?;
    Some(variable(most.over))
}

/// `a, b and c`.
fn listed(names: &[String]) -> String {
    match names {
        [others @ .., last] if !others.is_empty() => format!("{} and {last}", others.join(", ")),
        few => few.concat(),
    }
}

/// Named effects that take so much are all of it: half of the last per cent that is shown.
const ALL: f64 = 0.995;

/// A share in per cent: two digits, and near all of it as many as tell what is left.
pub fn percent(share: f64) -> String {
    let left = 1.0 - share;
    let digits = if (1e-5..0.01).contains(&left) {
        (-left.log10()).ceil() as usize
    } else {
        2
    };
    match 100.0 * share {
        // less than anybody measures
        tiny if tiny != 0.0 && tiny.abs() < 0.01 => "<0.01".to_owned(),
        percent => number(percent, digits),
    }
}

/// An effect as people read it, with its size and unit.
pub fn with_value(found: &NamedEffect) -> String {
    let name = words(&found.effect);
    let Some((value, unit)) = size(found) else {
        return name;
    };
    let value = short(value);
    format!("{name} {value} {unit}").trim_end().to_owned()
}

/// The number that says how large an effect is: of two that belong together their length, of a tilt how far the base leans, else the first
/// that is no place.
fn size(found: &NamedEffect) -> Option<(f64, &'static str)> {
    let value = |name: &str| found.parameters.get(name).map(|found| found.value);
    if let (Some(sine), Some(cosine)) = (value("sin_nm"), value("cos_nm")) {
        return Some((sine.hypot(cosine), unit("sin_nm")));
    }
    if let (Some(roll), Some(pitch)) = (value("roll_rad"), value("pitch_rad")) {
        return Some(((roll.cos() * pitch.cos()).acos(), unit("roll_rad")));
    }
    let is_place = |name: &str| name.starts_with("centre_m") || name == "rest_rad";
    let mut sizes = found.parameters.iter();
    let (name, size) = sizes.find(|(name, _)| !is_place(name))?;
    Some((size.value, unit(name)))
}

/// Three digits, or two where the third is a zero behind the point.
fn short(value: f64) -> String {
    let three = number(value, 3);
    match three.strip_suffix('0') {
        Some(two) if two.contains('.') && !two.ends_with('.') => two.to_owned(),
        _ => three,
    }
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
pub fn words(effect: &str) -> String {
    effect
        .replace('_', " ")
        .replace("coulomb", "Coulomb")
        .replace("stribeck", "Stribeck")
}

/// Quantity and unit of a variable of the report's ranges.
pub fn signal_axis(variable: &str) -> (String, &'static str) {
    let unit = unit(variable);
    let suffixes = ["_rad_s", "_rad", "_nm", "_s", "_hz"];
    let suffix = suffixes.iter().find(|suffix| variable.ends_with(**suffix));
    let name = suffix.and_then(|suffix| variable.strip_suffix(suffix));
    (name.unwrap_or(variable).replace('_', " "), unit)
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
            Verdict::Unexplained | Verdict::PartlyExplained => steps.push(rest_step(joint)),
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

/// What to do about a part of the gap that has no name.
fn rest_step(joint: &JointReport) -> String {
    let name = &joint.joint;
    let has_table = joint.remaining_over.iter().any(|rest| !rest.at.is_empty());
    let apply = if has_table {
        "; `flexspline gap apply --remaining` writes it into the robot file as a table, and the gap shrinks without a name"
    } else {
        ""
    };
    let over = rest_over(joint).map_or(String::new(), |over| format!(" and depends on {over}"));
    format!(
        "{name}: {} % of the gap is on no list{over}; look at the joint where the ranges above hold most of it{apply}.",
        percent(joint.remaining_share)
    )
}

/// What a joint is ambiguous by: the most probable cause and the next that may stand for it.
fn undecided<'a>(candidates: &[Candidate], confusable: &'a [Confusable]) -> Option<&'a Confusable> {
    let has = |pair: &Confusable, of: &Candidate| pair.effects.contains(&of.effect);
    let decides = candidates.split_first().and_then(|(first, others)| {
        others.iter().find_map(|other| {
            let mut pairs = confusable.iter();
            pairs.find(|pair| has(pair, first) && has(pair, other))
        })
    });
    decides.or(confusable.first())
}

#[cfg(test)]
mod tests {
    use gap_report::Parameter;

    use super::*;

    #[test]
    fn what_is_undecided_is_the_most_probable_cause() {
        let candidate = |effect: &str| Candidate {
            effect: effect.to_owned(),
            probability: 0.5,
        };
        let pair = |effects: [&str; 2]| Confusable {
            effects: effects.map(str::to_owned),
            distance: 1.0,
            reason: String::new(),
        };
        let candidates = ["torque_offset", "gravity_torque", "joint_spring"].map(candidate);
        let frictions = pair(["coulomb_friction", "viscous_friction"]);
        let decides = pair(["gravity_torque", "torque_offset"]);
        let both = [frictions.clone(), decides.clone()];
        assert_eq!(undecided(&candidates, &both), Some(&decides));
        assert_eq!(undecided(&candidates, &both[..1]), Some(&frictions));
        assert_eq!(undecided(&candidates, &[]), None);
    }

    #[test]
    fn shares_and_values_have_the_digits_that_tell() {
        let shares = [0.5121, 0.999_93, 1.0, 0.996, 0.0, 1e-7];
        let told = shares.map(percent);
        assert_eq!(told, ["51", "99.993", "100", "99.6", "0", "<0.01"]);
        let values = [3.0, 3.24, 2.004, 120.0, 0.0305, -5.551];
        let told = values.map(short);
        assert_eq!(told, ["3.0", "3.24", "2.0", "120", "0.0305", "−5.55"]);
    }

    #[test]
    fn an_effect_is_told_by_its_size_and_not_by_its_place() {
        let named = |effect: &str, parameters: &[(&str, f64)]| {
            let parameter = |value: f64| Parameter {
                value,
                std: 0.1,
                at_bound: false,
            };
            let parameters = parameters.iter();
            with_value(&NamedEffect {
                effect: effect.to_owned(),
                probability: 0.9,
                parameters: parameters
                    .map(|(name, value)| ((*name).to_owned(), parameter(*value)))
                    .collect(),
                side: None,
                share: 0.5,
                share_low: 0.4,
                share_high: 0.6,
                shrink_alone: 0.5,
                of_links: false,
            })
        };
        let spring = named(
            "joint_spring",
            &[("rest_rad", -1.86), ("stiffness_nm_rad", 2.5)],
        );
        assert_eq!(spring, "joint spring 2.5 Nm/rad");
        let gravity = named("gravity_torque", &[("sin_nm", 3.0), ("cos_nm", -4.0)]);
        assert_eq!(gravity, "gravity torque 5.0 Nm");
        let payload = named("payload", &[("centre_m_x", 0.1), ("mass_kg", 1.5)]);
        assert_eq!(payload, "payload 1.5 kg");
    }

    #[test]
    fn ranges_have_quantity_and_unit() {
        let axis = |name| signal_axis(name);
        let velocity = ("motor velocity".to_owned(), "rad/s");
        assert_eq!(axis("motor_velocity_rad_s"), velocity);
        assert_eq!(axis("load_nm"), ("load".to_owned(), "Nm"));
    }

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
