//! Laws whose shape the rows tell: what repeats with the motor's angle, and what drifts.

use std::f64::consts::TAU;

use gap_report::TorqueSource;
use joint_model::filter::FilterError;
use joint_twin::signal::beside::Beside;
use joint_twin::signal::waves::PERIODS_MIN;
use nalgebra::DMatrix;

use super::laws::{Law, Repeats};
use super::rows::{JointRows, Kept};
use crate::evidence::{ALIKE, independent_rows};

impl JointRows {
    /// Adds those laws whose shape the rows tell, one of each kind: a ripple of the motor's torque, friction that repeats with the motor's
    /// angle, and one that drifts. Which is what takes most of what all else leaves; it is added if that may be worth its name.
    pub(super) fn offer(
        &mut self,
        source: TorqueSource,
        kept: &[Kept<'_>],
    ) -> Result<(), FilterError> {
        let gap_nm = self.seen.gap_nm();
        let laws = self.laws.iter().flat_map(|(_, columns)| columns);
        let beside = [&self.tolerated, &self.links, &self.untold];
        // as free as they may be
        let known = laws.chain(beside.into_iter().flatten()).map(|column| {
            let square: f64 = column.iter().map(|x| x * x).sum();
            let scale = (ALIKE * square).sqrt().max(f64::MIN_POSITIVE).recip();
            column.iter().map(|x| scale * x).collect()
        });
        let left = Beside::new(&known.collect::<Vec<Vec<f64>>>(), &gap_nm);
        let square: f64 = left.left().iter().map(|x| x * x).sum();
        let independent = independent_rows(left.left());
        let until_s = self.seen.time_s.iter().copied().fold(0.0, f64::max);
        let cycles = self.cycles(kept);
        let repeats = || {
            let among = cycles.len();
            cycles.iter().map(move |cycles| Repeats {
                cycles: *cycles,
                among,
            })
        };
        // what a motor makes does not reach a sensor behind the gear as it is
        let ripples = repeats().filter(|_| source != TorqueSource::Sensor);
        let kinds: [Vec<Law>; 3] = [
            ripples.map(Law::Ripple).collect(),
            repeats().map(Law::PositionDependent).collect(),
            vec![Law::Drift(until_s)],
        ];
        for kind in kinds {
            let mut most = None;
            for law in kind {
                let mut columns = vec![Vec::new(); law.amplitudes()];
                for piece in kept {
                    for (column, added) in columns.iter_mut().zip(law.columns(&piece.along)) {
                        column.extend(piece.limited(&added)?);
                    }
                }
                let mut pair = columns.concat();
                pair.resize(2 * gap_nm.len(), 0.0);
                let gain = left.gains(&DMatrix::from_vec(gap_nm.len(), 2, pair))[0];
                if most.as_ref().is_none_or(|(best, _)| gain > *best) {
                    most = Some((gain, (law, columns)));
                }
            }
            let Some((gain, (law, columns))) = most else {
                continue;
            };
            let nats = -0.5 * independent * (1.0 - gain / square).max(f64::MIN_POSITIVE).ln();
            if nats > law.cost(false) {
                self.laws.push((law, columns));
            }
        }
        Ok(())
    }

    /// Cycles per turn of the motor that repeat often enough within the motion, and at half of the speeds within the band.
    fn cycles(&self, kept: &[Kept<'_>]) -> Vec<u32> {
        /// Of motors' pole pairs there are some tens, and of their slots.
        const CYCLES_MAX: u32 = 128;
        // a ratio of one is what a file has that states none
        let first = kept.first();
        let Some(first) = first.filter(|piece| piece.along.gear_ratio != 1.0) else {
            return Vec::new();
        };
        let turns = |rad: f64| (first.along.gear_ratio * rad / TAU).abs();
        let position = self.seen.position_rad.iter();
        let [low, high] = position.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], q| {
            [low.min(*q), high.max(*q)]
        });
        let mut speeds: Vec<f64> = self.seen.velocity_rad_s.iter().map(|v| v.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        let turns_s = turns(speeds.get(speeds.len() / 2).copied().unwrap_or(0.0));
        let within = |cycles: &u32| {
            let cycles = f64::from(*cycles);
            cycles * turns(high - low) >= PERIODS_MIN
                && cycles * turns_s <= first.piece.compared_hz()
        };
        (1..=CYCLES_MAX).filter(within).collect()
    }
}
