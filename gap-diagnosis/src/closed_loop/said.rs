//! From what explains a joint to what its report says of it.

use std::collections::BTreeMap;

use gap_report::{
    BeforeAfter, Confusable, Gap, JointReport, NamedEffect, Parameter, SignalGap, Verdict,
};
use joint_twin::TwinError;
use joint_twin::observe::Channel;
use recording_checks::data::ONE_FREQUENCY;
use recording_checks::found::Found as Counted;
use robot::EffectKind;

use crate::closed_loop::search::{Model, Term};
use crate::diagnose::JointTraces;
use crate::evidence::ERRORS;
use crate::evidence::shares::{self, Interval};
use crate::evidence::told::{Found, Said};

use super::bus::CommonDelay;
use super::called::Responses;
use super::counted;
use super::joint::{Explained, Joint};
use super::spectrum::SAME;
use super::turns::FastRipple;

/// What the arm shares.
pub(super) struct Arm<'a> {
    /// Name of a cause, and its columns.
    pub shared: Option<(Option<&'static str>, usize)>,
    /// A delay of its bus.
    pub common: Option<&'a CommonDelay>,
}

/// What is told of a joint.
pub(super) struct Told {
    /// For the report.
    pub report: JointReport,
    /// For its pictures.
    pub traces: JointTraces,
    /// Share of the cause that the arm shares.
    pub shared: Option<Interval>,
    /// Share of the delay that the arm has in common.
    pub delay_share: f64,
}

impl Joint<'_> {
    /// What the other joints do, rows of the motor's signal.
    fn others_moving(&self) -> Vec<Vec<f64>> {
        let of_motor = self.compared.motor_rows();
        let others = self.search.twin.others().into_iter();
        others
            .map(|of| of_motor.iter().map(|k| of[*k]).collect())
            .collect()
    }

    fn signals(&self, gap_nm: &[f64]) -> Vec<SignalGap> {
        let channels = self.search.twin.channels.iter().zip(&self.compared.spans);
        let mut all: Vec<SignalGap> = channels
            .map(|(channel, span)| {
                let own = &gap_nm[span.rows.clone()];
                let square = own.iter().map(|x| x * x).sum::<f64>() / own.len().max(1) as f64;
                SignalGap {
                    signal: channel.signal().to_owned(),
                    gap_to_noise: square.sqrt() / span.floor_nm.max(f64::MIN_POSITIVE),
                }
            })
            .collect();
        all.sort_by(|a, b| b.gap_to_noise.total_cmp(&a.gap_to_noise));
        all
    }

    pub fn said(
        &self,
        name: &str,
        explained: &Explained,
        counted: &[Counted],
        arm: &Arm<'_>,
        materiality: f64,
    ) -> Result<Told, TwinError> {
        let rows = self.rows()?;
        let gap_nm = self
            .compared
            .pick(&self.search.residual_nm(&Model::default())?);
        let best = explained.sets[0];
        let left = explained.evidence.mean_squares(best.names);
        let settled = explained.evidence.settled();
        let mut above = left.iter().zip(settled);
        let is_at_floor = explained.leaves.is_none()
            && above.all(|(left, settled)| *left <= ERRORS.powi(2) * settled.floor);
        let called = Responses {
            search: &self.search,
            about: &explained.about,
        };
        let found = Found {
            joint: name,
            rows: &rows,
            called: &called,
            gear_ratio: self.search.scale.gear_ratio,
            friction: &self.search.twin.nominal.friction,
            noise_square: explained.evidence.floor_square(best.names),
            evidence: &explained.evidence,
            sets: &explained.sets,
            leaves: explained.leaves,
            is_at_floor: Some(is_at_floor),
            shared: arm.shared.as_slice(),
            of_links: None,
            signals: self.signals(&gap_nm),
            is_one_frequency: self.poverty == Some(ONE_FREQUENCY),
            materiality,
        };
        let Said {
            mut report, shared, ..
        } = found.said(&self.others_moving());
        let mut counted = counted.to_vec();
        counted.extend(self.fast_ripple_beside(&mut report));
        let settled_shares = self.settled_shares(explained, &gap_nm)?;
        let rest = 1.0 - settled_shares.iter().sum::<f64>();
        let shared = shared.first().map(|share| Interval {
            value: rest * share.value,
            low: rest * share.low,
            high: rest * share.high,
        });
        let is_common = |found: &Counted| {
            let common = arm.common;
            common.is_some_and(|common| common.is_seen_as(found, self.index))
        };
        counted::add(&mut report, &counted, &settled_shares, is_common);
        report.gap = self.gap(&report, &gap_nm, left[0]);
        let settled = counted.iter().filter(|found| counted::is_settled(found));
        let in_common = settled.zip(&settled_shares);
        let in_common = in_common.filter(|(found, _)| is_common(found));
        let delay_share = in_common.map(|(_, share)| share).sum();
        let model = &explained.about.model;
        report.gap.position_rms_rad =
            crate::closed_loop::values::position_rms_rad(&self.search, &Model::default(), model)?;
        Ok(Told {
            report,
            traces: self.traces(name, model)?,
            shared,
            delay_share,
        })
    }

    /// A ripple that is faster than what is compared, where no name of the report repeats as often.
    fn fast_ripple_beside(&self, report: &mut JointReport) -> Option<Counted> {
        let FastRipple {
            cycles_per_motor_rev,
            found,
        } = self.search.fast_ripple.as_ref()?;
        let repeats = |effect: &NamedEffect| {
            let cycles = effect.parameters.get("cycles_per_motor_rev");
            cycles.is_some_and(|cycles| (cycles.value / cycles_per_motor_rev - 1.0).abs() < SAME)
        };
        if let Some(own) = report.effects.iter_mut().find(|effect| repeats(effect)) {
            // a joint that is slow for a while only tells less of it than one that is fast for long
            let surer = counted::named_effect(found, own.share).parameters;
            let std = |of: &BTreeMap<String, Parameter>| of.get("amplitude_nm").map(|own| own.std);
            let is_surer = std(&surer)
                .zip(std(&own.parameters))
                .is_some_and(|(a, b)| a < b);
            if own.effect == found.effect.name() && is_surer {
                own.parameters = surer;
            }
            return None;
        }
        report.minor_effects.retain(|effect| !repeats(effect));
        if self.search.twin.nominal.stiffness_is_known {
            report.confusable.push(Confusable {
                effects: [EffectKind::TorqueRipple, EffectKind::KinematicError]
                    .map(|kind| kind.name().to_owned()),
                distance: 0.0,
                reason: "faster than its link swings a gear's error is a torque, as a ripple is"
                    .to_owned(),
            });
        }
        Some(found.clone())
    }

    /// Parts of the gap that the drive takes by what its samples show, each, beside what the file's values are in the end.
    fn settled_shares(&self, explained: &Explained, gap_nm: &[f64]) -> Result<Vec<f64>, TwinError> {
        let count = self.settled.len();
        if count == 0 {
            return Ok(Vec::new());
        }
        let Explained {
            about,
            evidence,
            sets,
            ..
        } = explained;
        let beside = evidence.values_beside(sets[0].names);
        let square = |gap_nm: &[f64]| {
            let mut without_nm = gap_nm.to_vec();
            for (column, value) in about.known.iter().zip(&beside) {
                let rows = without_nm.iter_mut().zip(column);
                rows.for_each(|(row, x)| *row -= value * x);
            }
            evidence.square(&without_nm)
        };
        let everything = (1 << count) - 1;
        let left = |set: usize| -> Result<f64, TwinError> {
            if set == 0 {
                return Ok(square(gap_nm));
            }
            if set == everything {
                return Ok(evidence.left_at(0, &beside).iter().sum());
            }
            let terms = self.settled.iter().enumerate();
            let own: Vec<Term> = terms
                .filter(|(place, _)| set & (1 << place) != 0)
                .map(|(_, term)| term.clone())
                .collect();
            let model = Model::of_settled(&self.search, &own);
            Ok(square(
                &self.compared.pick(&self.search.residual_nm(&model)?),
            ))
        };
        let left = (0..=everything).map(left).collect::<Result<Vec<_>, _>>()?;
        let all = left[0].max(f64::MIN_POSITIVE);
        let taken = shares::taken(count, |set| left[set]);
        let mut parts: Vec<f64> = taken.iter().map(|own| (own / all).max(0.0)).collect();
        // one that makes it worse beside another leaves the other no more than there is
        let sum = parts.iter().sum::<f64>().max(1.0);
        parts.iter_mut().for_each(|part| *part /= sum);
        Ok(parts)
    }

    /// Mean square of the motor's gap, and what nobody can tell of it.
    fn motor_squares(&self, gap_nm: &[f64]) -> [f64; 2] {
        let span = &self.compared.spans[0];
        let own = &gap_nm[span.rows.clone()];
        let square = own.iter().map(|x| x * x).sum::<f64>() / own.len().max(1) as f64;
        [square, span.floor_nm.powi(2)]
    }

    /// How far the motor's gap shrinks to this mean square, above what nobody can tell.
    pub fn shrink(&self, gap_nm: &[f64], after: f64) -> f64 {
        let [before, noise] = self.motor_squares(gap_nm);
        let above = |square: f64| (square - noise).max(0.0);
        if above(before) > 0.0 {
            1.0 - above(after) / above(before)
        } else {
            0.0
        }
    }

    /// Of the motor's torque.
    fn gap(&self, report: &JointReport, gap_nm: &[f64], after: f64) -> Gap {
        let [before, noise] = self.motor_squares(gap_nm);
        let shrink = if report.verdict == Verdict::NoGap {
            0.0
        } else {
            self.shrink(gap_nm, after)
        };
        let told = &report.gap;
        Gap {
            torque_rms_nm: BeforeAfter {
                before: before.sqrt(),
                after: after.sqrt(),
                noise_floor: noise.sqrt(),
                held_out: true,
            },
            position_rms_rad: told.position_rms_rad,
            shrink,
            // as far from it as the interval of what all signals are told
            shrink_low: (shrink - (told.shrink - told.shrink_low)).min(shrink),
            shrink_high: (shrink + (told.shrink_high - told.shrink))
                .clamp(shrink, f64::max(1.0, shrink)),
        }
    }

    fn traces(&self, name: &str, model: &Model) -> Result<JointTraces, TwinError> {
        let before_nm = self.search.residual_nm(&Model::default())?;
        let after_nm = self.search.residual_nm(model)?;
        let rows = &self.search.twin.rows;
        let shown: Vec<usize> = (0..rows.len())
            .filter(|k| rows[*k].channel == Channel::Motor && rows[*k].stretch == 0)
            .collect();
        let pick = |of: &dyn Fn(usize) -> f64| shown.iter().map(|k| of(*k)).collect::<Vec<f64>>();
        let measured = &self.search.measured_nm;
        Ok(JointTraces {
            joint: name.to_owned(),
            time_s: pick(&|k| rows[k].time_s),
            measured_nm: pick(&|k| measured[k]),
            nominal_nm: pick(&|k| measured[k] - before_nm[k]),
            augmented_nm: pick(&|k| measured[k] - after_nm[k]),
            position_rad: pick(&|k| rows[k].position_rad),
            velocity_rad_s: pick(&|k| rows[k].velocity_rad_s),
        })
    }
}
