//! How friction turns round with the direction: no joint's friction jumps at a reversal, its asperities bend first (Dahl, A Solid
//! Friction Model, 1968).
//!
//! Along a recorded motion the bend has no freedom but its length and its shape: `ds = (1 - s·sign dq)^i · dq/length`, between -1 and
//! 1; with an exponent of 0 a spring gives way at once (Prandtl's elastic and plastic body), with 1 bit by bit. Every joint has a bend
//! and no robot file tells it, so it is found first and is no name.

use super::motion::JointMotion;

/// The bend of friction before it slips.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Presliding {
    /// Travel from no bend to slip at the slope that it has without a bend, in rad (m) at the joint.
    pub length_rad: f64,
    /// Whether it gives way bit by bit.
    pub is_gradual: bool,
}

impl Default for Presliding {
    fn default() -> Self {
        Self {
            length_rad: SHORTEST_RAD,
            is_gradual: false,
        }
    }
}

/// The shortest length that is tried, less than encoders show.
const SHORTEST_RAD: f64 = 1e-5;
/// Each is twice the one before, up to ten milliradians: more than gears have between their teeth.
const LENGTHS: i32 = 10;
/// The longest.
pub fn longest_rad() -> f64 {
    SHORTEST_RAD * f64::from(LENGTHS).exp2()
}

/// Golden sections between two of them: to two per cent.
const SECTIONS: usize = 8;

/// The bend that leaves least, by `left`, and what it leaves.
///
/// # Errors
/// Those of `left`.
pub fn least<E>(
    mut left: impl FnMut(Presliding) -> Result<f64, E>,
) -> Result<(Presliding, f64), E> {
    let mut best = (f64::INFINITY, Presliding::default());
    for is_gradual in [false, true] {
        let mut at = |octave: f64| -> Result<f64, E> {
            let presliding = Presliding {
                length_rad: SHORTEST_RAD * octave.exp2(),
                is_gradual,
            };
            let left = left(presliding)?;
            if left < best.0 {
                best = (left, presliding);
            }
            Ok(left)
        };
        let mut coarse = (f64::INFINITY, 0.0);
        for octave in (0..=LENGTHS).map(f64::from) {
            let left = at(octave)?;
            if left < coarse.0 {
                coarse = (left, octave);
            }
        }
        let (mut low, mut high) = (coarse.1 - 1.0, coarse.1 + 1.0);
        let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
        for _ in 0..SECTIONS {
            let inner = [high - golden * (high - low), low + golden * (high - low)];
            if at(inner[0])? < at(inner[1])? {
                high = inner[1];
            } else {
                low = inner[0];
            }
        }
    }
    Ok((best.1, best.0))
}

impl Presliding {
    /// Two that are as likely: of the other shape, and half as long again.
    pub fn others(&self) -> [Self; 2] {
        [
            Self {
                is_gradual: !self.is_gradual,
                ..*self
            },
            Self {
                length_rad: 1.5 * self.length_rad,
                ..*self
            },
        ]
    }

    /// How far friction is bent along a motion, row by row: -1 to 1, and the sign of the velocity once the joint slips.
    pub fn slip(&self, motion: &JointMotion) -> Vec<f64> {
        let mut bend = motion.velocity_rad_s.first().map_or(0.0, |v| v.signum());
        let mut before_rad = motion.position_rad.first().copied().unwrap_or(0.0);
        let position = motion.position_rad.iter();
        position
            .map(|position_rad| {
                let moved_rad = position_rad - before_rad;
                before_rad = *position_rad;
                if moved_rad != 0.0 {
                    bend = self.after(bend, moved_rad);
                }
                bend
            })
            .collect()
    }

    fn after(&self, bend: f64, moved_rad: f64) -> f64 {
        if self.is_gradual {
            let sign = moved_rad.signum();
            sign + (bend - sign) * (-moved_rad.abs() / self.length_rad).exp()
        } else {
            (bend + moved_rad / self.length_rad).clamp(-1.0, 1.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turning() -> JointMotion {
        JointMotion {
            velocity_rad_s: vec![-1.0; 201],
            position_rad: (0..=200).map(|k: i32| f64::from((k - 100).abs())).collect(),
            ..JointMotion::default()
        }
    }

    #[test]
    fn the_bend_turns_round_within_its_length() {
        let of = |is_gradual: bool| {
            let presliding = Presliding {
                length_rad: 10.0,
                is_gradual,
            };
            presliding.slip(&turning())
        };
        let (at_once, gradual) = (of(false), of(true));
        for (row, bend) in [(100, -1.0), (110, 0.0), (120, 1.0)] {
            assert!(
                (at_once[row] - bend).abs() < 1e-9,
                "{row}: {}",
                at_once[row]
            );
        }
        assert!((gradual[110] - (1.0 - 2.0 * (-1.0_f64).exp())).abs() < 1e-9);
        assert!((gradual[200] - 1.0).abs() < 1e-3);
    }

    #[test]
    fn the_length_that_leaves_least_is_found() {
        let found = least(|bend: Presliding| {
            let off = (bend.length_rad / 3e-4).ln().abs();
            Ok::<f64, ()>(off + f64::from(u8::from(!bend.is_gradual)))
        });
        let Ok((found, _)) = found else {
            unreachable!("nothing fails")
        };
        assert!(found.is_gradual);
        assert!((found.length_rad / 3e-4 - 1.0).abs() < 0.05, "{found:?}");
    }
}
