//! Effects that show in single samples and in no band: lost samples and commands, the torque at which a drive ends, coarse
//! encoders, a slow velocity filter. They are counted, not fitted.

use joint_twin::control::is_slower_than_loop;
use joint_twin::known::LAW;
use joint_twin::scale::ROWS_MIN;
use recording::{JointColumns, Recording, Signal};
use robot::{Control, Effect, EncoderSide, RobotJoint};

use crate::commanded::Law;
use crate::follow::{Response, SLOW_LAG_S, slow_drive};
use crate::found::{Found, LOST_MIN, SURE};
use crate::limit::drive_limit;
use crate::lost::{LeftOut, left_out};
use crate::mend::blank_repeats;
use crate::timing::{Timing, columns};

/// A position that stays although the joint should have moved by so many steps of its encoder was not measured.
const STEPS_MOVED: f64 = 3.0;
/// A step coarser than the file's by this factor is another encoder.
const COARSER: f64 = 1.4;
/// Rows that move for each that moves by another number of steps than the one before, from which on the speed is even.
const EVEN: usize = 50;
/// A velocity that lags its own position by this much of the lag of a told filter and a backward difference is filtered as it should be.
const USUAL_LAG: f64 = 1.3;

/// What the samples of one joint show, over all recordings. Where the robot file tells of no feedback there is no
/// velocity filter that could be slower than told, and where it tells no controller no delay that could be longer. A recording
/// slower than the loop lacks most commands.
pub fn find(
    recordings: &[&Recording],
    index: usize,
    joint: &RobotJoint,
    timing: &Timing,
) -> Vec<Found> {
    let columns = columns(recordings, joint);
    let control = timing.control.as_ref();
    let Some(rate_hz) = recordings.first().map(|recording| recording.sample_rate_hz) else {
        return Vec::new();
    };
    let period_s = 1.0 / rate_hz;
    let delay_cycles = control.map_or(1, |control| control.delay_cycles as usize);
    let lost = lost_samples(&columns, joint);
    let responses = Response::all(&columns, period_s);
    let lacks_commands = control.is_some_and(|control| is_slower_than_loop(control, rate_hz));
    let told_cycles = timing.is_told.then_some(delay_cycles);
    let (left_out, slow) = if lacks_commands {
        (None, Vec::new())
    } else if lost.is_some() {
        // nothing tells whether the drive left out commands too
        (None, slow_where_measured(&columns, period_s, told_cycles))
    } else {
        let told_rows = timing.told_rows();
        let left_out = left_out(&columns, &responses, told_rows);
        let slow = match left_out {
            // commands that are left out come later, as from a slow loop
            Some(left_out) => late(&left_out, told_rows, period_s)
                .filter(|_| timing.is_told)
                .into_iter()
                .collect(),
            None => slow_drive(&responses, told_cycles),
        };
        (left_out.map(lost_commands), slow)
    };
    let found = [
        lost,
        left_out,
        drive_limit(&columns, &responses, joint.torque_limit_nm),
        coarse_encoder(
            &columns,
            Signal::MotorPositionRad,
            EncoderSide::Motor,
            joint.motor_encoder_resolution_rad,
            joint.position_noise_rad,
        ),
        coarse_encoder(
            &columns,
            Signal::LinkPositionRad,
            EncoderSide::Link,
            joint.link_encoder_resolution_rad,
            joint.position_noise_rad,
        ),
        control
            .filter(|control| control.is_closed())
            .and_then(|control| {
                let usual_s = usual_lag_s(lag_of_filter_s(control), period_s);
                slow_velocity(&columns, rate_hz, usual_s).or_else(|| {
                    let is_of_loop = timing.is_told && !lacks_commands;
                    let law = is_of_loop.then_some(Law {
                        control,
                        joint: index,
                        gear_ratio: joint.gear_ratio,
                        rate_hz,
                    })?;
                    law.slow_filter(&columns, usual_s)
                })
            }),
    ];
    found.into_iter().flatten().chain(slow).collect()
}

/// Lag and delay of a drive some of whose torques were not measured anew: those tell nothing of their commands.
fn slow_where_measured(
    columns: &[JointColumns],
    period_s: f64,
    told_cycles: Option<usize>,
) -> Vec<Found> {
    let mut measured = columns.to_vec();
    measured.iter_mut().for_each(blank_repeats);
    slow_drive(&Response::all(&measured, period_s), told_cycles)
}

/// A part of many, with its standard error; none where there are too few.
fn fraction(lost: usize, of: usize) -> Option<(f64, f64)> {
    if of < ROWS_MIN {
        return None;
    }
    let part = lost as f64 / of as f64;
    let std = (part.max(1.0 / of as f64) * (1.0 - part) / of as f64).sqrt();
    (part > LOST_MIN && part > SURE * std).then_some((part, std))
}

/// Rows in which nothing of the joint changed although it moved: none of its encoders where there are two, nor the torque beside one alone.
fn lost_samples(columns: &[JointColumns], joint: &RobotJoint) -> Option<Found> {
    let resolution_rad = joint.motor_encoder_resolution_rad.unwrap_or(0.0);
    let noise_rad = joint.position_noise_rad;
    let step_rad = resolution_rad.max(step_of(columns, Signal::MotorPositionRad).unwrap_or(0.0));
    let (mut lost, mut of) = (0, 0);
    for columns in columns {
        let Some(position_rad) = columns.signals.get(&Signal::MotorPositionRad) else {
            continue;
        };
        let link_rad = columns.measured(Signal::LinkPositionRad);
        let torques = [Signal::MotorTorqueNm, Signal::JointTorqueNm];
        let torques = torques
            .iter()
            .filter_map(|signal| columns.measured(*signal));
        let beside: Vec<&[f64]> = match link_rad {
            Some(link_rad) => vec![link_rad],
            None => torques.collect(),
        };
        for k in 2..position_rad.len().saturating_sub(2) {
            // what a row should have moved, from the rows around it
            let moves_rad = 0.25 * (position_rad[k + 2] - position_rad[k - 2]);
            let sure_rad = STEPS_MOVED * step_rad.max(noise_rad);
            if !moves_rad.is_finite() || moves_rad.abs() <= sure_rad {
                continue;
            }
            of += 1;
            let stays = |values: &[f64]| values[k] == values[k - 1];
            let all_stay = stays(position_rad) && beside.iter().all(|values| stays(values));
            lost += usize::from(all_stay);
        }
    }
    let (part, std) = fraction(lost, of)?;
    Some(Found {
        effect: Effect::DroppedSamples { fraction: part },
        std,
        because: format!("{lost} of {of} rows repeat the row before although the joint moved"),
    })
}

/// Commands that the drive left out.
fn lost_commands(left_out: LeftOut) -> Found {
    let LeftOut {
        fraction,
        std,
        nats,
        ..
    } = left_out;
    Found {
        effect: Effect::DroppedCommands { fraction },
        std,
        because: format!(
            "the drive left out {:.1} % of its commands, which explains its torque by {nats:.0} nats better than any delay and lag",
            100.0 * fraction
        ),
    }
}

/// Those that it did not leave out, if they come later than the controller's delay lets them.
fn late(left_out: &LeftOut, told_rows: usize, period_s: f64) -> Option<Found> {
    let late_rows = left_out
        .delay_rows
        .checked_sub(told_rows)
        .filter(|rows| *rows > 0)?;
    let delay_s = late_rows as f64 * period_s;
    Some(Found {
        effect: Effect::CommandDelay { delay_s },
        std: 0.1 * period_s,
        because: format!(
            "commands that the drive took act {:.2} ms later than the controller's delay",
            1e3 * delay_s
        ),
    })
}

/// The step of a signal; none where its values are not in steps.
fn step_of(columns: &[JointColumns], signal: Signal) -> Option<f64> {
    let values = columns
        .iter()
        .filter_map(|columns| columns.signals.get(&signal));
    let values: Vec<f64> = values.flatten().copied().collect();
    let step = recording::step(&values)?;
    let changes = values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    let changes: Vec<f64> = changes.filter(|change| change.is_finite()).collect();
    (!is_of_speed(&changes, step)).then_some(step)
}

/// Whether rows of an even speed, each as far from the next, make these steps: an encoder's steps differ from row to row.
fn is_of_speed(steps: &[f64], step: f64) -> bool {
    let times = |steps: f64| (steps / step).round();
    let changes = steps
        .windows(2)
        .filter(|two| times(two[0]) != times(two[1]));
    let moved = steps.iter().filter(|steps| times(**steps) > 0.0);
    changes.count() * EVEN < moved.count()
}

fn coarse_encoder(
    columns: &[JointColumns],
    signal: Signal,
    side: EncoderSide,
    file_rad: Option<f64>,
    noise_rad: f64,
) -> Option<Found> {
    let step_rad = step_of(columns, signal)?;
    let expected_rad = file_rad?;
    // a step below the noise is no coarser encoder than the noise makes it anyway
    let is_coarse = step_rad > COARSER * expected_rad && step_rad > COARSER * noise_rad;
    is_coarse.then(|| Found {
        effect: Effect::EncoderQuantisation {
            resolution_rad: step_rad,
            side,
        },
        std: LAW * step_rad,
        because: format!(
            "{signal} comes in steps of {step_rad:.3e} rad, the robot file has {expected_rad:.3e} rad"
        ),
    })
}

/// By how much the robot file's velocity filter delays a slow motion: the sum of its poles' time constants.
fn lag_of_filter_s(control: &Control) -> f64 {
    if control.velocity_filter_hz <= 0.0 {
        return 0.0;
    }
    let order = f64::from(control.velocity_filter_order);
    // a Butterworth filter's poles lie on a circle
    1.0 / (std::f64::consts::TAU * control.velocity_filter_hz)
        / (std::f64::consts::PI / (2.0 * order)).sin()
}

/// The lag of a velocity that is filtered as it should be: as told, and the half sample of a backward difference.
fn usual_lag_s(told_s: f64, period_s: f64) -> f64 {
    SLOW_LAG_S.max(USUAL_LAG * (told_s + 0.5 * period_s))
}

/// How far the reported velocity is behind the derivative of the reported position, where that is clearly more than usual.
fn slow_velocity(columns: &[JointColumns], rate_hz: f64, usual_s: f64) -> Option<Found> {
    let period_s = 1.0 / rate_hz;
    let (mut slope, mut square, mut left, mut rows) = (0.0, 0.0, 0.0, 0.0);
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for columns in columns {
        let position = columns.signals.get(&Signal::MotorPositionRad);
        let velocity = columns.signals.get(&Signal::MotorVelocityRadS);
        let (Some(position_rad), Some(velocity_rad_s)) = (position, velocity) else {
            continue;
        };
        // position smoothed and velocity smoothed alike, so that only what the drive did remains
        let width = ((0.01 * rate_hz) as usize).max(2);
        for k in (2 * width..velocity_rad_s.len().saturating_sub(2 * width)).step_by(width) {
            let mean = |from: usize, to: usize| {
                velocity_rad_s[from..to].iter().sum::<f64>() / (to - from) as f64
            };
            let true_rad_s = (position_rad[k + width] - position_rad[k - width])
                / (2.0 * width as f64 * period_s);
            let told_rad_s =
                0.5 * (mean(k - width, k + width) + mean(k - width + 1, k + width + 1));
            // over as long as those means: over longer a joint that vibrates changes less than it does
            let half = width / 2;
            let end = |middle: usize| mean(middle - half, middle + half);
            let change = (end(k + width) - end(k - width)) / (2.0 * width as f64 * period_s);
            if true_rad_s.is_finite() && told_rad_s.is_finite() && change.is_finite() {
                pairs.push((change, true_rad_s - told_rad_s));
            }
        }
    }
    for (change, behind) in &pairs {
        slope += change * behind;
        square += change * change;
        rows += 1.0;
    }
    if rows < ROWS_MIN as f64 || square <= 0.0 {
        return None;
    }
    let lag_s = slope / square;
    for (change, behind) in &pairs {
        left += (behind - lag_s * change).powi(2);
    }
    let std_s = (left / (rows - 1.0) / square).sqrt();
    if lag_s < usual_s || lag_s < SURE * std_s {
        return None;
    }
    let cutoff_hz = 1.0 / (std::f64::consts::TAU * lag_s);
    Some(Found {
        effect: Effect::VelocityFilterLag { cutoff_hz },
        std: cutoff_hz * std_s / lag_s,
        because: format!(
            "the reported velocity is {:.2} ms behind the position's derivative",
            1e3 * lag_s
        ),
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may")]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::follow::tests::{columns, command};

    /// The velocity of a position as a filter of the first order shows it, a thousand times a second.
    fn filtered(position_rad: impl Fn(usize) -> f64, cutoff_hz: f64) -> Vec<f64> {
        let share = 1.0 - (-TAU * cutoff_hz / 1000.0).exp();
        let velocity_rad_s = |k: usize| (position_rad(k + 1) - position_rad(k)) * 1000.0;
        let mut slow_rad_s = velocity_rad_s(0);
        (0..20_000)
            .map(|k| {
                let shown_rad_s = slow_rad_s;
                slow_rad_s += share * (velocity_rad_s(k) - slow_rad_s);
                shown_rad_s
            })
            .collect()
    }

    fn wave(k: usize) -> f64 {
        let t = k as f64 / 1000.0;
        40.0 * (2.0 * t).sin() + 11.0 * (5.3 * t).sin()
    }

    #[test]
    fn a_coarse_encoder_is_measured_and_a_fine_one_is_not_called_coarse() {
        let coarse: Vec<f64> = (0..20_000)
            .map(|k| (wave(k) / 0.01).round() * 0.01)
            .collect();
        let joint = columns(vec![(Signal::MotorPositionRad, coarse)]);
        let find = |file| {
            coarse_encoder(
                std::slice::from_ref(&joint),
                Signal::MotorPositionRad,
                EncoderSide::Motor,
                Some(file),
                0.0,
            )
        };
        let found = find(0.001).unwrap();
        let Effect::EncoderQuantisation { resolution_rad, .. } = found.effect else {
            panic!("{found:?}");
        };
        assert!((resolution_rad - 0.01).abs() < 1e-6);
        assert!(find(0.01).is_none());
        let smooth = columns(vec![(
            Signal::MotorPositionRad,
            (0..20_000).map(wave).collect(),
        )]);
        assert_eq!(step_of(&[smooth], Signal::MotorPositionRad), None);
        // back and forth at one speed
        let even = (0..20_000_i32).map(|k| 0.01 * f64::from((k % 4000 - 2000).abs()));
        let even = columns(vec![(Signal::MotorPositionRad, even.collect())]);
        assert_eq!(step_of(&[even], Signal::MotorPositionRad), None);
    }

    #[test]
    fn speeds_of_an_even_number_of_steps_make_no_coarser_encoder() {
        // at rest, a few slow steps, and most of the time 72 or 73 of them a row
        let mut position = 0.0;
        let steps = (0..5000_usize).map(|k| match k {
            0..9 => 1.0,
            9..46 => 2.0,
            _ if k % 5 < 3 => 72.0,
            _ => 73.0,
        });
        let moved = steps.map(|steps| {
            position += 6e-6 * steps;
            position
        });
        let joint = columns(vec![(Signal::LinkPositionRad, moved.collect())]);
        let step = step_of(&[joint], Signal::LinkPositionRad);
        assert!(step.is_none_or(|step| step < 7e-6), "{step:?}");
        // an encoder as coarse as that, printed with so few digits that one step is known to a hundredth only
        let mut counts = 0;
        let printed = (0..5000_u32).map(|k| {
            counts += k * k % 41;
            1e-7 * (122.4 * f64::from(counts)).round()
        });
        let printed = printed.collect();
        let joint = columns(vec![(Signal::LinkPositionRad, printed)]);
        let step = step_of(&[joint], Signal::LinkPositionRad).unwrap();
        assert!((step / 12.24e-6 - 1.0).abs() < 0.001, "{step:?}");
    }

    #[test]
    fn a_slow_velocity_is_measured() {
        let cutoff_hz = 40.0;
        let joint = columns(vec![
            (Signal::MotorPositionRad, (0..20_000).map(wave).collect()),
            (Signal::MotorVelocityRadS, filtered(wave, cutoff_hz)),
        ]);
        let usual = |told_s| usual_lag_s(told_s, 1e-3);
        let found = slow_velocity(std::slice::from_ref(&joint), 1000.0, usual(0.0)).unwrap();
        let Effect::VelocityFilterLag {
            cutoff_hz: found_hz,
        } = found.effect
        else {
            panic!("{found:?}");
        };
        assert!((found_hz / cutoff_hz - 1.0).abs() < 0.2, "{found_hz}");
        // told, it is no fault
        let told_s = 1.0 / (TAU * cutoff_hz);
        assert_eq!(slow_velocity(&[joint], 1000.0, usual(told_s)), None);
    }

    #[test]
    fn a_velocity_of_a_joint_that_vibrates_is_no_later_than_told() {
        let cutoff_hz = 60.0;
        let shakes = |k: usize| wave(k) + 0.2 * (TAU * 24.0 * k as f64 / 1000.0).sin();
        let joint = columns(vec![
            (Signal::MotorPositionRad, (0..20_000).map(shakes).collect()),
            (Signal::MotorVelocityRadS, filtered(shakes, cutoff_hz)),
        ]);
        let usual_s = usual_lag_s(1.0 / (TAU * cutoff_hz), 1e-3);
        assert_eq!(slow_velocity(&[joint], 1000.0, usual_s), None);
    }

    #[test]
    fn a_late_drive_shows_between_lost_samples() {
        let command_nm = command();
        let mut torque_nm = vec![0.0; command_nm.len()];
        torque_nm[11..].copy_from_slice(&command_nm[..command_nm.len() - 11]);
        let mut position_rad: Vec<f64> = (0..command_nm.len()).map(wave).collect();
        for k in 1..command_nm.len() {
            // three rows of ten, in no order
            if k * k % 101 % 10 < 3 {
                torque_nm[k] = torque_nm[k - 1];
                position_rad[k] = position_rad[k - 1];
            }
        }
        let joint = columns(vec![
            (Signal::CommandTorqueNm, command_nm),
            (Signal::MotorTorqueNm, torque_nm),
            (Signal::MotorPositionRad, position_rad),
        ]);
        let found = slow_where_measured(&[joint], 1e-3, Some(0));
        let [
            Found {
                effect: Effect::CommandDelay { delay_s },
                ..
            },
        ] = found[..]
        else {
            panic!("{found:?}");
        };
        assert!((delay_s / 0.01 - 1.0).abs() < 0.02, "{delay_s}");
    }

    #[test]
    fn a_leap_between_trajectories_is_no_slow_drive() {
        let [mut rows, mut torque] = [(); 2].map(|()| command());
        // each trajectory begins anywhere, and the drive follows a row later within it
        for (k, u) in rows.iter_mut().enumerate() {
            *u += 40.0 * ((k / 5000) as f64 * 2.0).sin();
        }
        torque[1..].copy_from_slice(&rows[..19_999]);
        for first in [0, 5000, 10_000, 15_000] {
            torque[first] = rows[first];
        }
        let joint = columns(vec![
            (Signal::CommandTorqueNm, rows),
            (Signal::MotorTorqueNm, torque),
        ]);
        let runs = [0..5000, 5000..10_000, 10_000..15_000, 15_000..20_000];
        let runs = recording::grid::in_runs(&joint, &runs);
        let responses = Response::all(&runs, 1e-3);
        assert_eq!(slow_drive(&responses, Some(0)), []);
        assert_eq!(left_out(&runs, &responses, 1), None);
    }

    #[test]
    fn a_step_that_no_file_states_is_no_effect() {
        let coarse = (0..20_000).map(|k| (wave(k) / 0.01).round() * 0.01);
        let joint = columns(vec![(Signal::LinkPositionRad, coarse.collect())]);
        let (signal, side) = (Signal::LinkPositionRad, EncoderSide::Link);
        assert_eq!(coarse_encoder(&[joint], signal, side, None, 0.0), None);
    }

    #[test]
    fn both_encoders_repeat_where_samples_are_dropped_whatever_the_torque_does() {
        let mut file = robot::load("shd17").unwrap().joints.remove(0);
        file.motor_encoder_resolution_rad = Some(1e-4);
        let found = |dropped: usize| {
            let mut motor_rad: Vec<f64> = (0..20_000).map(wave).collect();
            for k in 1..motor_rad.len() {
                if k * k % 101 % 10 < dropped {
                    motor_rad[k] = motor_rad[k - 1];
                }
            }
            let link_rad = motor_rad.iter().map(|rad| rad / 100.0).collect();
            let joint = columns(vec![
                (Signal::MotorPositionRad, motor_rad),
                (Signal::LinkPositionRad, link_rad),
                (Signal::MotorTorqueNm, command()),
            ]);
            lost_samples(&[joint], &file)
        };
        assert_eq!(found(0), None);
        let Some(Found {
            effect: Effect::DroppedSamples { fraction },
            ..
        }) = found(1)
        else {
            panic!("none");
        };
        assert!((0.05..0.2).contains(&fraction), "{fraction}");
    }
}
