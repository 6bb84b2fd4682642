//! How friction turns round with the direction: no joint's friction jumps at a reversal.
//!
//! Asperities bend first (Dahl, A Solid Friction Model, 1968). Along a recorded motion that bend has no freedom but its length and its
//! shape: `ds = (1 - s·sign dq)^i · dq/length`, between -1 and 1; with an exponent of 0 a spring gives way at once (Prandtl's elastic and
//! plastic body), with 1 bit by bit. Or friction rises with the speed, where a joint creeps under a film or vibrates more than it moves,
//! and in most simulators (a sigmoid; Gaz et al., Dynamic Identification of the Franka Emika Panda Robot, 2019). Every joint has one of
//! these and no robot file tells it, so it is found first and is no name.

use super::motion::JointMotion;

/// How friction turns round.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Presliding {
    /// With the travel, as a spring that gives way at once: from no bend to slip, in rad (m) at the joint.
    AtOnce { length_rad: f64 },
    /// With the travel, bit by bit; length at the slope that it has without a bend.
    Gradual { length_rad: f64 },
    /// With the speed: `tanh(q̇/speed)`.
    BySpeed { speed_rad_s: f64 },
}

impl Default for Presliding {
    fn default() -> Self {
        Self::AtOnce {
            length_rad: SHORTEST_RAD,
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

/// The way of each kind that leaves least, by `left`, and what it leaves: the best first. `creeping_rad_s`: about the highest speed up to
/// which friction may rise; up to a higher one it is viscous friction.
///
/// # Errors
/// Those of `left`.
pub fn least<E>(
    creeping_rad_s: f64,
    mut left: impl FnMut(Presliding) -> Result<f64, E>,
) -> Result<[(Presliding, f64); 3], E> {
    let travel = |octave: f64| SHORTEST_RAD * octave.exp2();
    let kinds: [&dyn Fn(f64) -> Presliding; 3] = [
        &|octave| Presliding::AtOnce {
            length_rad: travel(octave),
        },
        &|octave| Presliding::Gradual {
            length_rad: travel(octave),
        },
        &|octave| Presliding::BySpeed {
            speed_rad_s: creeping_rad_s * (octave - f64::from(LENGTHS)).exp2(),
        },
    ];
    let mut all = [(Presliding::default(), f64::INFINITY); 3];
    for (of, best) in kinds.into_iter().zip(&mut all) {
        let mut at = |octave: f64| -> Result<f64, E> {
            let left = left(of(octave))?;
            if left < best.1 {
                *best = (of(octave), left);
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
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    Ok(all)
}

impl Presliding {
    /// The same, half as long again.
    pub fn longer(mut self) -> Self {
        let (Self::AtOnce { length_rad: size }
        | Self::Gradual { length_rad: size }
        | Self::BySpeed { speed_rad_s: size }) = &mut self;
        *size *= 1.5;
        self
    }

    /// How far friction is bent along a motion, row by row: -1 to 1, and the sign of the velocity once the joint slips.
    pub fn slip(self, motion: &JointMotion) -> Vec<f64> {
        let mut bend = motion.velocity_rad_s.first().map_or(0.0, |v| v.signum());
        let mut before_rad = motion.position_rad.first().copied().unwrap_or(0.0);
        let both = motion.position_rad.iter().zip(&motion.velocity_rad_s);
        both.map(|(position_rad, velocity_rad_s)| {
            let moved_rad = position_rad - before_rad;
            before_rad = *position_rad;
            let sign = moved_rad.signum();
            match self {
                Self::BySpeed { speed_rad_s } => {
                    bend = (velocity_rad_s / speed_rad_s.max(f64::MIN_POSITIVE)).tanh();
                }
                _ if moved_rad == 0.0 => {}
                Self::AtOnce { length_rad } => {
                    bend = (bend + moved_rad / length_rad).clamp(-1.0, 1.0);
                }
                Self::Gradual { length_rad } => {
                    bend = sign + (bend - sign) * (-moved_rad.abs() / length_rad).exp();
                }
            }
            bend
        })
        .collect()
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
            let length_rad = 10.0;
            if is_gradual {
                Presliding::Gradual { length_rad }.slip(&turning())
            } else {
                Presliding::AtOnce { length_rad }.slip(&turning())
            }
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
    fn the_way_that_leaves_least_is_found() {
        let found = least(0.1, |bend: Presliding| {
            let left = match bend {
                Presliding::AtOnce { .. } => 9.0,
                Presliding::Gradual { length_rad } => (length_rad / 3e-4).ln().abs(),
                Presliding::BySpeed { speed_rad_s } => 0.5 + (speed_rad_s / 0.04).ln().abs(),
            };
            Ok::<f64, ()>(left)
        });
        let Ok([(first, _), (second, left), (third, _)]) = found else {
            unreachable!("nothing fails")
        };
        let Presliding::Gradual { length_rad } = first else {
            panic!("{first:?}")
        };
        assert!((length_rad / 3e-4 - 1.0).abs() < 0.05, "{first:?}");
        assert!(matches!(second, Presliding::BySpeed { .. }) && left < 0.6);
        assert!(matches!(third, Presliding::AtOnce { .. }));
    }
}
