//! Contacts: how soon pushes of several sizes are found, and how often there is an alarm without one.
//!
//! The emulated joint moves as for calibration and judgement while something outside pushes its link every two seconds for
//! 0.2 s, either way; then it moves for an hour alone. What is counted is the estimator's message in every cycle, in virtual time.

use blind::score::Rate;
use estimators::Kind;
use plant_emulator::process::emulated_plant;
use report::decimal;
use robot::{Push, Robot};
use serde::Serialize;
use shm_types::instance::RunConfig;

use super::motions::Motion;
use super::stage::Stage;
use crate::error::CliError;
use crate::reproduce::sheet::Sheet;

/// Sizes of the pushes; the gear is rated for 16 Nm.
const SIZES_NM: [f64; 6] = [0.5, 1.0, 1.5, 2.0, 4.0, 8.0];
/// From push to push; no whole number of swings.
const EVERY_S: f64 = 2.07;
const FIRST_S: f64 = 1.0;
const PUSH_S: f64 = 0.2;

/// Pushes of one size.
#[derive(Clone, Debug, Serialize)]
pub struct Detections {
    /// Joint side, either way.
    pub torque_nm: f64,
    /// How many there were, and how many of them were found while they lasted.
    pub found: Rate,
    /// From the push's beginning to the message that says so; the median.
    pub delay_ms: Option<f64>,
    /// The longest.
    pub delay_max_ms: Option<f64>,
    /// Push by push; none where it was not found.
    #[serde(skip)]
    delays_ms: Vec<Option<f64>>,
}

/// Alarms without a push.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FalseAlarms {
    /// How long was watched.
    pub hours: f64,
    /// Contacts that were none.
    pub alarms: u64,
    /// 95 % interval of the rate that such a count comes from (Poisson), alarms an hour.
    pub per_hour_95: [f64; 2],
    /// External torque over its standard deviation, the largest.
    pub largest_sigmas: f64,
    /// The threshold's mean.
    pub threshold_nm: f64,
}

/// Both.
#[derive(Clone, Debug, Serialize)]
pub struct Collisions {
    /// Size by size.
    pub detections: Vec<Detections>,
    /// In motion without a push.
    pub false_alarms: FalseAlarms,
}

/// One cycle's external torque.
struct Heard {
    time_s: f64,
    torque_nm: f64,
    std_nm: f64,
    threshold_nm: f64,
    is_contact: bool,
}

/// A joint that is pushed, and what is known of it.
pub struct Pushed<'a> {
    /// The joint.
    pub stage: &'a Stage<'a>,
    /// With calibrated estimators.
    pub model: &'a Robot,
}

impl Pushed<'_> {
    /// Pushes during these motions, none during the last.
    ///
    /// # Errors
    /// [`CliError`] if the loop stopped or a file cannot be written.
    pub fn collide(&self, pushed: &[&Motion], alone: &Motion) -> Result<Collisions, CliError> {
        let mut delays_ms = SIZES_NM.map(|_| Vec::new());
        for motion in pushed {
            self.push(motion, &mut delays_ms)?;
        }
        let classes = SIZES_NM.into_iter().zip(delays_ms);
        Ok(Collisions {
            detections: classes
                .map(|(torque_nm, delays_ms)| Detections::of(torque_nm, delays_ms))
                .collect(),
            false_alarms: self.leave_alone(alone)?,
        })
    }

    fn push(
        &self,
        motion: &Motion,
        delays_ms: &mut [Vec<Option<f64>>; SIZES_NM.len()],
    ) -> Result<(), CliError> {
        let pushes = pushes(motion.duration_s);
        let mut found_s: Vec<Option<f64>> = vec![None; pushes.len()];
        self.listen(motion, &pushes, |heard| {
            let place = pushes.partition_point(|push| push.start_s <= heard.time_s);
            let Some(place) = place.checked_sub(1) else {
                return;
            };
            let since_s = heard.time_s - pushes[place].start_s;
            if heard.is_contact && since_s <= PUSH_S && found_s[place].is_none() {
                found_s[place] = Some(since_s);
            }
        })?;
        for (place, found_s) in found_s.into_iter().enumerate() {
            delays_ms[place % SIZES_NM.len()].push(found_s.map(|found_s| 1e3 * found_s));
        }
        Ok(())
    }

    fn leave_alone(&self, motion: &Motion) -> Result<FalseAlarms, CliError> {
        let mut alarms = FalseAlarms::default();
        let (mut cycles, mut was_contact) = (0_u64, false);
        self.listen(motion, &[], |heard| {
            cycles += 1;
            alarms.alarms += u64::from(heard.is_contact && !was_contact);
            was_contact = heard.is_contact;
            alarms.threshold_nm += heard.threshold_nm;
            let sigmas = heard.torque_nm.abs() / heard.std_nm;
            alarms.largest_sigmas = alarms.largest_sigmas.max(sigmas);
        })?;
        alarms.hours = motion.duration_s / 3600.0;
        alarms.threshold_nm /= cycles.max(1) as f64;
        Ok(alarms.with_interval())
    }

    /// Runs a motion in virtual time and tells of every cycle with an external torque.
    fn listen(
        &self,
        motion: &Motion,
        pushes: &[Push],
        mut each: impl FnMut(Heard),
    ) -> Result<(), CliError> {
        let course = self.stage.trajectory(motion)?;
        let run = RunConfig {
            estimators: vec![Kind::Fusion.identifier().to_owned()],
            ..self.stage.run_config(motion)
        };
        let plant = emulated_plant(self.stage.robot, &run, &[])
            .map_err(CliError::input)?
            .with_pushes(pushes.to_vec());
        let simulated = twin::simulate_plant(&run, self.model, plant, course, |messages| {
            if let Some(estimate) = &messages.estimate {
                let external = &estimate.external;
                if external.torque_nm[0].is_finite() {
                    each(Heard {
                        time_s: (messages.cycle * run.period_ns) as f64 * 1e-9,
                        torque_nm: external.torque_nm[0],
                        std_nm: external.std_nm[0],
                        threshold_nm: external.threshold_nm[0],
                        is_contact: external.contact_joints & 1 == 1,
                    });
                }
            }
            true
        });
        simulated.map_err(|error| CliError::Negative(format!("motion {}: {error}", motion.name)))
    }
}

/// All sizes in turn, then all the other way.
fn pushes(duration_s: f64) -> Vec<Push> {
    let count = ((duration_s - FIRST_S - PUSH_S) / EVERY_S) as usize;
    (0..count)
        .map(|place| {
            let size_nm = SIZES_NM[place % SIZES_NM.len()];
            let is_back = (place / SIZES_NM.len()) % 2 == 1;
            Push {
                joint: 0,
                torque_nm: if is_back { -size_nm } else { size_nm },
                start_s: FIRST_S + EVERY_S * place as f64,
                duration_s: PUSH_S,
            }
        })
        .collect()
}

impl Detections {
    fn of(torque_nm: f64, delays_ms: Vec<Option<f64>>) -> Self {
        let mut known_ms: Vec<f64> = delays_ms.iter().copied().flatten().collect();
        known_ms.sort_unstable_by(f64::total_cmp);
        Self {
            torque_nm,
            found: Rate::of(delays_ms.iter().map(Option::is_some)),
            delay_ms: known_ms.get(known_ms.len() / 2).copied(),
            delay_max_ms: known_ms.last().copied(),
            delays_ms,
        }
    }

    fn row(&self) -> Vec<String> {
        let shown =
            |delay_ms: Option<f64>| delay_ms.map_or(String::new(), |delay_ms| decimal(delay_ms, 1));
        let Rate { hits, of, .. } = self.found;
        let interval = [self.found.low, self.found.high].map(|share| decimal(100.0 * share, 0));
        vec![
            format!("{}", self.torque_nm),
            format!("{hits} of {of}"),
            interval.join(" to "),
            shown(self.delay_ms),
            shown(self.delay_max_ms),
        ]
    }
}

impl FalseAlarms {
    fn with_interval(self) -> Self {
        Self {
            per_hour_95: poisson_95(self.alarms).map(|count| count / self.hours),
            ..self
        }
    }

    fn words(&self) -> String {
        let [low, high] = self.per_hour_95;
        format!(
            "{} false alarms in {:.2} h, {low:.2} to {high:.2} an hour (95 %); largest external torque {:.2} of its standard \
             deviations; threshold {:.2} Nm on average",
            self.alarms, self.hours, self.largest_sigmas, self.threshold_nm
        )
    }
}

impl Collisions {
    /// Those of several joints as one.
    pub fn together(all: &[&Self]) -> Self {
        let class = |(place, torque_nm): (usize, f64)| {
            let each = all.iter().filter_map(|found| found.detections.get(place));
            let delays_ms = each.flat_map(|class| class.delays_ms.iter().copied());
            Detections::of(torque_nm, delays_ms.collect())
        };
        let alarms = all.iter().map(|found| &found.false_alarms);
        let hours: f64 = alarms.clone().map(|alarms| alarms.hours).sum();
        let false_alarms = FalseAlarms {
            hours,
            alarms: alarms.clone().map(|alarms| alarms.alarms).sum(),
            largest_sigmas: alarms
                .clone()
                .map(|alarms| alarms.largest_sigmas)
                .fold(0.0, f64::max),
            threshold_nm: alarms
                .map(|alarms| alarms.threshold_nm * alarms.hours / hours)
                .sum(),
            ..FalseAlarms::default()
        };
        Self {
            detections: SIZES_NM.into_iter().enumerate().map(class).collect(),
            false_alarms: false_alarms.with_interval(),
        }
    }

    /// Sizes down; false alarms below.
    pub fn sheet(&self) -> Sheet {
        let columns = [
            "push, Nm",
            "found",
            "95 % interval, %",
            "after, median, ms",
            "longest, ms",
        ];
        let mut sheet = Sheet::new("Pushes of 0.2 s, both ways, moving and standing", columns);
        sheet
            .rows
            .extend(self.detections.iter().map(Detections::row));
        sheet.notes.push(self.false_alarms.words());
        sheet
    }
}

/// The means of a Poisson distribution between which a count is no surprise: each end leaves 2.5 %.
fn poisson_95(count: u64) -> [f64; 2] {
    // the distribution function up to `most`
    let up_to = |most: u64, mean: f64| {
        let mut term = (-mean).exp();
        let mut sum = term;
        for k in 1..=most {
            term *= mean / k as f64;
            sum += term;
        }
        sum
    };
    let mean_where = |most: u64, share: f64| {
        let (mut low, mut high) = (0.0, 20.0 + 3.0 * most as f64);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if up_to(most, middle) > share {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    };
    let low = match count {
        0 => 0.0,
        count => mean_where(count - 1, 0.975),
    };
    [low, mean_where(count, 0.025)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poisson_intervals_are_the_tables() {
        for (count, [low, high]) in [
            (0, [0.0, 3.689]),
            (1, [0.0253, 5.572]),
            (5, [1.623, 11.668]),
        ] {
            let found = poisson_95(count);
            assert!(
                (found[0] - low).abs() < 1e-3 && (found[1] - high).abs() < 1e-3,
                "{found:?}"
            );
        }
    }

    #[test]
    fn every_size_comes_as_often_either_way() {
        let pushes = pushes(2.0 * 12.0 * EVERY_S + 2.0);
        for size_nm in SIZES_NM {
            let count = |torque_nm| {
                pushes
                    .iter()
                    .filter(|push| push.torque_nm == torque_nm)
                    .count()
            };
            assert_eq!((count(size_nm), count(-size_nm)), (2, 2));
        }
    }
}
