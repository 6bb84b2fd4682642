//! A ripple of the motor that is faster than the band in which torques are compared, by order analysis: the torque's part that repeats a
//! whole number of times a turn, whatever the speed.
//!
//! The torque less what swings, `τ - J·q̈ - D(ω)·q`, is slow but for the ripple: `D = K·M·ω²/(M·ω² - K)` is a link's inertia `M` behind a
//! gear's stiffness `K`. Times `exp(-i·n·φ)` of the motor's angle, a ripple of n cycles a turn stands still (Fyfe and Munck, Mechanical
//! Systems and Signal Processing 11 (1997) 187-205). Short means of that are the same at every speed and in both directions; those of a
//! friction that repeats change their sign with the direction, those of an encoder's error grow with the square of the speed.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use joint_model::harmonic;
use joint_twin::JointTwin;
use joint_twin::known::LAW;
use joint_twin::observe::Band;
use joint_twin::signal::smooth::{low_pass, second_difference};
use joint_twin::stretch::JointStretch;
use nalgebra::Complex;
use recording_checks::found::{Found, sure_nats};
use robot::Effect;

use super::spectrum::CYCLES;

/// Over so long the speed hardly changes and the angle turns several times.
const BLOCK_S: f64 = 0.2;
/// A torque may be read up to one row before or after the positions beside it; so many steps to either side are looked at, of so much.
const READINGS: i32 = 4;
const READING_ROWS: f64 = 0.25;
/// From so many times the band's cut-off on what is slow has but a twenty-fifth of a ripple: the low-pass runs twice. As far from where a
/// link swings on its gear's spring how that is damped, which nobody knows, does not matter.
const FASTER: f64 = 1.5;

/// Means of one block, at one number of cycles.
struct Block {
    /// Of the drive's torque.
    torque_nm: Complex<f64>,
    /// Of what swings takes.
    taken_nm: Complex<f64>,
    velocity_rad_s: f64,
    /// By which the ripple's phase goes on from one row to the next.
    phase_rad: f64,
}

impl Block {
    /// What is left of a torque that was read so many rows after the positions.
    fn left_nm(&self, rows: f64) -> Complex<f64> {
        self.torque_nm * Complex::from_polar(1.0, -rows * self.phase_rad) - self.taken_nm
    }
}

/// A ripple that is faster than the band.
#[derive(Clone, Debug)]
pub struct FastRipple {
    /// Its whole number.
    pub cycles_per_motor_rev: f64,
    /// With its size.
    pub found: Found,
}

/// The largest ripple that is faster than the band; none where nothing repeats so for certain, where the means tell as well of another
/// cause, or where it is less than a law is exact by.
pub(super) fn fast_ripple(twin: &JointTwin<'_>) -> Option<FastRipple> {
    let stretches = twin.stretches().into_iter();
    let turned: Vec<Turned> = stretches
        .filter_map(|stretch| Turned::of(twin, stretch))
        .collect();
    let torques = turned.iter().flat_map(|of| of.torque_nm.iter());
    let (square, rows) = torques.fold((0.0, 0.0), |(square, rows), nm| {
        (square + nm * nm, rows + 1.0)
    });
    let usual_nm = f64::sqrt(square / f64::max(rows, 1.0));
    // what repeats with a shaft does so a whole number of times
    let [fewest, most] = CYCLES.map(|cycles| cycles.ceil() as u32);
    let found = (fewest..=most).filter_map(|cycles| {
        let blocks: Vec<Block> = turned.iter().flat_map(|of| of.blocks(cycles)).collect();
        let line = Line::of(&blocks)?;
        Some((cycles, line))
    });
    let (cycles, line) =
        found.max_by(|(_, a), (_, b)| a.mean_nm.norm().total_cmp(&b.mean_nm.norm()))?;
    let size_nm = line.mean_nm.norm();
    (size_nm / 2.0_f64.sqrt() > LAW * usual_nm).then(|| {
        let amplitude_nm = size_nm / twin.nominal.gear_ratio;
        // what swings is known as well as the rotor
        let not_known = LAW.hypot(twin.tolerance_of("rotor_inertia_kg_m2"));
        let found = Found {
            effect: Effect::TorqueRipple {
                amplitude_nm,
                cycles_per_motor_rev: f64::from(cycles),
                // what is left is the ripple taken off
                phase_rad: (line.mean_nm.arg() - FRAC_PI_2 + PI).rem_euclid(TAU) - PI,
            },
            std: line.std_nm.hypot(not_known * size_nm) / twin.nominal.gear_ratio,
            because: format!(
                "the motor's torque repeats {cycles} times a turn with {amplitude_nm:.2e} Nm, faster than the band that is compared, by \
                 {:.0} nats",
                line.nats
            ),
        };
        FastRipple {
            cycles_per_motor_rev: f64::from(cycles),
            found,
        }
    })
}

/// One stretch, sample by sample.
struct Turned {
    /// None where a signal was not there.
    fast: Vec<Option<Fast>>,
    torque_nm: Vec<f64>,
    motor_angle_rad: Vec<f64>,
    velocity_rad_s: Vec<f64>,
    gear_ratio: f64,
    rotor_kg_m2: f64,
    /// None of a gear that is rigid.
    stiffness_nm_rad: Option<f64>,
    cutoff_hz: f64,
    rate_hz: f64,
}

/// What of a sample is faster than the band, joint side.
struct Fast {
    torque_nm: f64,
    position_rad: f64,
    acceleration_rad_s2: f64,
    /// All of it: what it carries.
    link_kg_m2: f64,
}

impl Fast {
    /// What rotor, gear and link take of the torque; none where the link is about to resonate.
    fn taken_nm(&self, of: &Turned, frequency_hz: f64) -> Option<f64> {
        // a second difference shows less of what is fast
        let half = PI * frequency_hz / of.rate_hz;
        let acceleration_rad_s2 = self.acceleration_rad_s2 * (half / half.sin()).powi(2);
        let square = (TAU * frequency_hz).powi(2);
        // the link's inertia beside its gear's spring
        let over = of
            .stiffness_nm_rad
            .map_or(0.0, |stiffness| self.link_kg_m2 * square / stiffness);
        let away = FASTER * FASTER;
        let gear_nm = if over * away < 1.0 {
            self.link_kg_m2 * acceleration_rad_s2 / (1.0 - over)
        } else if over > away {
            of.stiffness_nm_rad? * self.position_rad / (1.0 - 1.0 / over)
        } else {
            return None;
        };
        Some(of.rotor_kg_m2 * acceleration_rad_s2 + gear_nm)
    }
}

impl Turned {
    fn of(twin: &JointTwin<'_>, stretch: &JointStretch) -> Option<Self> {
        let nominal = &twin.nominal;
        let rate_hz = 1.0 / stretch.drive.period_s;
        let cutoff_hz = Band::at(rate_hz).cutoff_hz;
        let motor_rad = &stretch.drive.motor_rad;
        let motor_angle_rad: Vec<f64> = motor_rad
            .iter()
            .map(|rad| rad * nominal.gear_ratio)
            .collect();
        let fast = |value: &dyn Fn(usize) -> f64| -> Option<Vec<f64>> {
            let all: Vec<f64> = (0..motor_rad.len()).map(value).collect();
            let slow = low_pass(&all, cutoff_hz, rate_hz).ok()?;
            Some(all.iter().zip(slow).map(|(all, slow)| all - slow).collect())
        };
        let torque_nm = fast(&|k| {
            let told_nm = harmonic::sum(&nominal.torque_ripple, motor_angle_rad[k]);
            stretch.torque_nm[k] + nominal.gear_ratio * told_nm
        })?;
        let position_rad = fast(&|k| motor_rad[k])?;
        let acceleration_rad_s2 = fast(&|k| second_difference(motor_rad, k) * rate_hz.powi(2))?;
        let fast = (0..motor_rad.len()).map(|k| {
            stretch.is_whole[k].then(|| Fast {
                torque_nm: torque_nm[k],
                position_rad: position_rad[k],
                acceleration_rad_s2: acceleration_rad_s2[k],
                link_kg_m2: stretch.load.inertia_kg_m2[k],
            })
        });
        Some(Self {
            fast: fast.collect(),
            torque_nm: stretch.torque_nm.clone(),
            motor_angle_rad,
            velocity_rad_s: stretch.load.velocity_rad_s.clone(),
            gear_ratio: nominal.gear_ratio,
            rotor_kg_m2: nominal.rotor_inertia_kg_m2,
            stiffness_nm_rad: nominal
                .stiffness_is_known
                .then_some(nominal.stiffness_nm_rad),
            cutoff_hz,
            rate_hz,
        })
    }

    fn blocks(&self, cycles: u32) -> Vec<Block> {
        let cycles = f64::from(cycles);
        let samples = ((BLOCK_S * self.rate_hz) as usize).max(1);
        let seen_hz = FASTER * self.cutoff_hz..0.5 * self.rate_hz;
        let block = |first: usize| {
            let [mut torque_nm, mut taken_nm] = [Complex::new(0.0, 0.0); 2];
            let (mut velocity_rad_s, mut count) = (0.0, 0_u32);
            for k in first..first + samples {
                let frequency_hz = cycles * (self.gear_ratio * self.velocity_rad_s[k] / TAU).abs();
                let is_seen = seen_hz.contains(&frequency_hz);
                let Some(fast) = self.fast[k].as_ref().filter(|_| is_seen) else {
                    continue;
                };
                if let Some(swings_nm) = fast.taken_nm(self, frequency_hz) {
                    let back = Complex::from_polar(2.0, -cycles * self.motor_angle_rad[k]);
                    torque_nm += back * fast.torque_nm;
                    taken_nm += back * swings_nm;
                    velocity_rad_s += self.velocity_rad_s[k];
                    count += 1;
                }
            }
            let rows = f64::from(count);
            (2 * count as usize >= samples).then(|| Block {
                torque_nm: torque_nm / rows,
                taken_nm: taken_nm / rows,
                velocity_rad_s: velocity_rad_s / rows,
                phase_rad: cycles * self.gear_ratio * velocity_rad_s / rows / self.rate_hz,
            })
        };
        let last = self.fast.len().saturating_sub(samples);
        (0..last).step_by(samples).filter_map(block).collect()
    }
}

/// What means have in common.
struct Line {
    mean_nm: Complex<f64>,
    std_nm: f64,
    /// By which it explains them better than nothing.
    nats: f64,
}

impl Line {
    /// None where they have nothing in common for certain, or what is no ripple's explains them as well.
    fn of(blocks: &[Block]) -> Option<Self> {
        let read = (-READINGS..=READINGS).map(|step| READING_ROWS * f64::from(step));
        let read = read.filter_map(|rows| Self::read_after(blocks, rows));
        read.max_by(|a, b| a.nats.total_cmp(&b.nats))
    }

    fn read_after(blocks: &[Block], rows: f64) -> Option<Self> {
        let count = blocks.len() as f64;
        let means_nm: Vec<Complex<f64>> = blocks.iter().map(|block| block.left_nm(rows)).collect();
        let all: f64 = means_nm.iter().map(|mean_nm| mean_nm.norm_sqr()).sum();
        // by a factor of each block's velocity
        let left = |factor: &dyn Fn(f64) -> f64| {
            let mut like = Complex::new(0.0, 0.0);
            let mut square = 0.0;
            for (block, mean_nm) in blocks.iter().zip(&means_nm) {
                let factor = factor(block.velocity_rad_s);
                like += mean_nm * factor;
                square += factor * factor;
            }
            (like / square, all - like.norm_sqr() / square)
        };
        let (mean_nm, own) = left(&|_| 1.0);
        let (_, of_friction) = left(&f64::signum);
        let (_, of_encoder) = left(&|velocity| velocity * velocity);
        // so unlikely is it that normal complex numbers that are about nothing have as much in common
        let nats = |other: f64| (count - 1.0) * (other / own).ln();
        let is_told = nats(all.min(of_friction).min(of_encoder)) > sure_nats();
        is_told.then(|| Self {
            mean_nm,
            std_nm: (own / count / (count - 1.0)).sqrt(),
            nats: nats(all),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means of blocks that differ by a tenth, by what is in each at its velocity.
    fn blocks(mean_nm: impl Fn(f64) -> f64) -> Vec<Block> {
        (0..40)
            .map(|k| {
                let velocity_rad_s = [1.0, -0.7, 0.5, -1.1][k % 4];
                let off = Complex::from_polar(0.1, 2.4 * k as f64);
                Block {
                    torque_nm: off + mean_nm(velocity_rad_s),
                    taken_nm: Complex::new(0.0, 0.0),
                    velocity_rad_s,
                    phase_rad: 0.4 * velocity_rad_s,
                }
            })
            .collect()
    }

    #[test]
    fn a_ripple_is_the_same_at_every_speed() {
        let line = |blocks: &[Block]| Line::of(blocks).map(|line| line.mean_nm.norm());
        assert!(line(&blocks(|_| 1.0)).is_some_and(|size_nm| (size_nm - 1.0).abs() < 0.05));
        assert_eq!(line(&blocks(f64::signum)), None);
        assert_eq!(line(&blocks(|velocity_rad_s| velocity_rad_s.powi(2))), None);
        assert_eq!(line(&blocks(|_| 0.0)), None);
        // at one speed nothing tells one from the other
        let mut even = blocks(|_| 1.0);
        even.iter_mut().for_each(|block| block.velocity_rad_s = 1.0);
        assert_eq!(line(&even), None);
    }

    #[test]
    fn a_torque_that_is_read_later_is_put_back() {
        let mut blocks = blocks(|_| 1.0);
        for block in &mut blocks {
            // half of it answers what swings, half a row later
            block.taken_nm = block.torque_nm;
            block.torque_nm *= 2.0 * Complex::from_polar(1.0, 0.5 * block.phase_rad);
        }
        let size_nm = Line::of(&blocks).map(|line| line.mean_nm.norm());
        assert!(
            size_nm.is_some_and(|size_nm| (size_nm - 1.0).abs() < 0.05),
            "{size_nm:?}"
        );
    }
}
