//! How a joint's channels respond: to known values, to every effect, and to effects that repeat with an angle.

use joint_twin::TwinError;
use joint_twin::observe::Channel;
use joint_twin::on_all_cores::OnAllCores;
use joint_twin::signal::beside::Beside;
use joint_twin::signal::difference;
use joint_twin::{Changes, Row};
use nalgebra::DMatrix;

use crate::closed_loop::search::{Model, Search};
use crate::closed_loop::spectrum::{SAME, below, most_seen, peaks};
use crate::effects::{Hypothesis, periodic};

/// Peaks over the motor angle that are tried.
const PEAKS: usize = 2;
/// Standard deviations by which a known value is moved to find its response.
const PROBE: f64 = 0.3;

/// A hypothesis with the channels' response to each of its amplitudes.
pub(crate) type Columns = (Hypothesis, Vec<Vec<f64>>);

impl Search<'_> {
    /// Response to a change, beside a model; `base` is what [`JointTwin::coarsely`](joint_twin::JointTwin::coarsely) says of the model.
    fn response(
        &self,
        base: &[f64],
        model: &Model,
        change: impl FnOnce(&mut Changes),
    ) -> Result<Vec<f64>, TwinError> {
        let mut changes = model.changes(&self.scale);
        changes.known.resize(self.twin.known.len(), 0.0);
        change(&mut changes);
        Ok(difference(&self.twin.coarsely(&changes)?, base))
    }

    fn hypothesis_columns(
        &self,
        base: &[f64],
        model: &Model,
        hypothesis: &Hypothesis,
    ) -> Result<Vec<Vec<f64>>, TwinError> {
        let at = |amplitudes: &[f64]| {
            self.response(base, model, |changes| {
                changes
                    .effects
                    .push(hypothesis.effect(amplitudes, &self.scale));
            })
        };
        (0..hypothesis.amplitudes())
            .map(|index| {
                let (probe, beside) = hypothesis.probes(index);
                let mut column = at(&probe)?;
                if let Some(beside) = beside {
                    for (value, beside) in column.iter_mut().zip(at(&beside)?) {
                        *value -= beside;
                    }
                }
                let reach = hypothesis.reach();
                column.iter_mut().for_each(|value| *value /= reach);
                Ok(column)
            })
            .collect()
    }

    /// Responses to everything that is known, about a model.
    pub(crate) fn known_columns(
        &self,
        base: &[f64],
        model: &Model,
    ) -> Result<Vec<Vec<f64>>, TwinError> {
        (0..self.twin.known.len())
            .on_all_cores(|index| {
                let mut column =
                    self.response(base, model, |changes| changes.known[index] += PROBE)?;
                column.iter_mut().for_each(|value| *value /= PROBE);
                Ok(column)
            })
            .collect()
    }

    /// Columns as the whitener makes them.
    pub(crate) fn whitened(&self, columns_nm: &[Vec<f64>]) -> Vec<Vec<f64>> {
        let columns_nm = columns_nm.iter();
        columns_nm
            .on_all_cores(|column| self.whitener.apply(column))
            .collect()
    }

    /// Responses to hypotheses, about a model.
    pub(crate) fn columns(
        &self,
        base: &[f64],
        model: &Model,
        hypotheses: Vec<Hypothesis>,
    ) -> Result<Vec<Columns>, TwinError> {
        hypotheses
            .into_iter()
            .on_all_cores(|hypothesis| {
                let columns = self.hypothesis_columns(base, model, &hypothesis)?;
                Ok((hypothesis, columns))
            })
            .collect()
    }

    /// Periodic effects at the cycles at which a residual repeats, over what known values leave beside a model.
    pub(crate) fn periodic_hypotheses(
        &self,
        model: &Model,
        residual_nm: &[f64],
        known_nm: &[Vec<f64>],
    ) -> Vec<Hypothesis> {
        let mut cycles: Vec<f64> = Vec::new();
        let rows = &self.twin.rows;
        let target = self.whitener.apply(residual_nm);
        let beside = Beside::new(&self.whitened(known_nm), &target);
        let named = model.terms.iter().map(|term| &term.hypothesis);
        let of_motor = named.filter(|hypothesis| hypothesis.repeats_with_motor());
        let harmonics = of_motor.clone().flat_map(Hypothesis::harmonics);
        let parts = below(of_motor.map(|of| of.shape[0]), self.scale.motor_turns);
        let fast = self.fast_ripple.iter().map(|of| of.cycles_per_motor_rev);
        for found in parts.into_iter().chain(harmonics).chain(fast) {
            if !cycles.contains(&found) {
                cycles.push(found);
            }
        }
        let most = most_seen(rows, self.scale.gear_ratio, 1.0 / self.scale.period_s);
        for channel in [Channel::Motor, Channel::Torsion] {
            let (whitener, places) = self.whitener.only(rows, channel);
            let beside = beside.only(&places);
            let of_channel: Vec<&Row> = places.iter().map(|k| &rows[*k]).collect();
            for with_direction in [false, true] {
                let gains = |mut waves: DMatrix<f64>| {
                    for mut wave in waves.column_iter_mut() {
                        if with_direction {
                            for (value, row) in wave.iter_mut().zip(&of_channel) {
                                *value *= row.velocity_rad_s.signum();
                            }
                        }
                        let white = whitener.apply(wave.as_slice());
                        wave.copy_from_slice(&white);
                    }
                    beside.gains(&waves)
                };
                for found in peaks(&of_channel, most, gains, PEAKS) {
                    if !cycles
                        .iter()
                        .any(|known| (known / found - 1.0).abs() < SAME)
                    {
                        cycles.push(found);
                    }
                }
            }
        }
        cycles.into_iter().flat_map(periodic).collect()
    }
}
