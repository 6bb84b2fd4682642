//! The worst seconds: what was measured, and what the simulation says with and without the effects.

use gap_diagnosis::JointTraces;
use gap_report::Report;
use report::{Axis, Figure, Panel, Section, Series};

use super::with_gap;

/// Length of what is shown.
const SHOWN_S: f64 = 3.0;
const PANEL_HEIGHT: u32 = 280;
const MEASURED: &str = "measured";
const WITH_EFFECTS: &str = "robot file with the effects";
/// Points of a cloud at most: more hide one another.
const POINTS: usize = 1500;
/// Points of what the model says, drawn above it: few enough that the cloud shows between them.
const MODEL_POINTS: usize = 200;

/// The worst seconds of every joint that has a gap.
pub fn section(report: &Report, traces: &[JointTraces]) -> Section {
    let mut section = Section::new("traces", "Torque, and the worst seconds").paragraph(
        "Disturbance torque: what is left of the drive's torque when that of the rigid robot is taken off.",
    );
    for joint in with_gap(report) {
        let Some(of_joint) = traces.iter().find(|traces| traces.joint == joint.joint) else {
            continue;
        };
        let over_motion = over_motion(of_joint);
        let caption = format!(
            "{}: torque {}in the seconds in which the gap is largest",
            joint.joint,
            if over_motion.is_empty() {
                ""
            } else {
                "over velocity, over position, and "
            }
        );
        let panels: Vec<Panel> = over_motion.into_iter().chain(over_time(of_joint)).collect();
        if panels.is_empty() {
            continue;
        }
        let figure = Figure::new(caption)
            .columns(panels.len())
            .panel_height(PANEL_HEIGHT);
        section = section.figure(panels.into_iter().fold(figure, Figure::panel));
    }
    section
}

/// Disturbance torque over velocity and over position, as measured and by the robot file with the effects.
fn over_motion(traces: &JointTraces) -> Vec<Panel> {
    if traces.velocity_rad_s.is_empty() {
        return Vec::new();
    }
    let cloud = |over: &[f64], torque_nm: &[f64], points: usize| -> Vec<[f64; 2]> {
        let every = over.len().div_ceil(points).max(1);
        let both = over.iter().zip(torque_nm).step_by(every);
        both.map(|(x, y)| [*x, *y]).collect()
    };
    let panel = |name: &str, unit: &str, over: &[f64]| {
        let measured = cloud(over, &traces.measured_nm, POINTS);
        let modelled = cloud(over, &traces.augmented_nm, MODEL_POINTS);
        Panel::new(Axis::new(name, unit), Axis::new("disturbance torque", "Nm"))
            .series(Series::points(MEASURED, measured))
            .series(Series::points(WITH_EFFECTS, modelled))
    };
    vec![
        panel("velocity", "rad/s", &traces.velocity_rad_s),
        panel("position", "rad", &traces.position_rad),
    ]
}

fn over_time(traces: &JointTraces) -> Option<Panel> {
    let (from, to) = worst(traces)?;
    let line = |values: &[f64]| -> Vec<[f64; 2]> {
        let times = traces.time_s.get(from..to).unwrap_or_default();
        let values = values.get(from..to).unwrap_or_default();
        times.iter().zip(values).map(|(t, y)| [*t, *y]).collect()
    };
    let panel = Panel::new(
        Axis::new("time", "s"),
        Axis::new("disturbance torque", "Nm"),
    )
    .series(Series::line(MEASURED, line(&traces.measured_nm)))
    .series(Series::dashed(WITH_EFFECTS, line(&traces.augmented_nm)))
    .series(Series::line("robot file", line(&traces.nominal_nm)));
    Some(panel)
}

/// The stretch of [`SHOWN_S`] with the largest mean square between measured and nominal.
fn worst(traces: &JointTraces) -> Option<(usize, usize)> {
    let count = traces
        .time_s
        .len()
        .min(traces.measured_nm.len())
        .min(traces.nominal_nm.len());
    if count < 2 {
        return None;
    }
    let step_s = (traces.time_s[count - 1] - traces.time_s[0]) / (count - 1) as f64;
    let length = if step_s > 0.0 {
        (SHOWN_S / step_s) as usize
    } else {
        count
    };
    let length = length.clamp(2, count);
    let squares: Vec<f64> = (0..count)
        .map(|k| (traces.measured_nm[k] - traces.nominal_nm[k]).powi(2))
        .map(|square| if square.is_finite() { square } else { 0.0 })
        .collect();
    let mut sum: f64 = squares[..length].iter().sum();
    let mut best = (0, sum);
    for from in 1..=count - length {
        sum += squares[from + length - 1] - squares[from - 1];
        if sum > best.1 {
            best = (from, sum);
        }
    }
    Some((best.0, best.0 + length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_seconds_are_those_of_the_largest_gap() {
        let time_s: Vec<f64> = (0..3000).map(|k| f64::from(k) * 0.01).collect();
        let measured_nm = time_s
            .iter()
            .map(|t| if (12.0..13.0).contains(t) { 5.0 } else { 0.1 })
            .collect();
        let zero = vec![0.0; time_s.len()];
        let traces = JointTraces {
            joint: "joint1".to_owned(),
            measured_nm,
            nominal_nm: zero.clone(),
            augmented_nm: zero,
            time_s,
            position_rad: Vec::new(),
            velocity_rad_s: Vec::new(),
        };
        let (from, to) = worst(&traces).expect("there are samples");
        assert!(traces.time_s[from] <= 12.0 && traces.time_s[to - 1] >= 12.99);
        assert_eq!(to - from, 300);
    }
}
