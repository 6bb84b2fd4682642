//! Effects on the gear: stiffness, soft wind-up, hysteresis, damping, kinematic error, backlash.

use arrayvec::ArrayVec;
use joint_model::transmission::{
    Backlash, CatalogueCompliance, KinematicError, KinematicHarmonic, SoftWindup, Spring,
    StructuralDamping, TorsionalHysteresis,
};
use robot::Effect;

use super::Full;

/// The most elements of a kind at one joint.
pub(crate) const ELEMENTS_MAX: usize = 4;

/// A soft start that has taken over by `strength`.
#[derive(Clone, Copy, Debug)]
struct Windup {
    low_stiffness_nm_rad: f64,
    knee_nm: f64,
    strength: f64,
}

/// The gear of one joint.
#[derive(Clone, Debug)]
pub(crate) struct Transmission {
    curve: CatalogueCompliance,
    /// What a stiffness in an effect is compared with: the robot file's, where it has one.
    reference_nm_rad: Option<f64>,
    stiffness_factor: f64,
    windups: ArrayVec<Windup, ELEMENTS_MAX>,
    backlash: Backlash,
    pub hysteresis: ArrayVec<TorsionalHysteresis, ELEMENTS_MAX>,
    damping: ArrayVec<StructuralDamping, ELEMENTS_MAX>,
    pub kinematic_error: KinematicError,
}

impl Transmission {
    pub fn new(curve: CatalogueCompliance, reference_nm_rad: Option<f64>) -> Self {
        Self {
            curve,
            reference_nm_rad,
            stiffness_factor: 1.0,
            windups: ArrayVec::new(),
            backlash: Backlash::default(),
            hysteresis: ArrayVec::new(),
            damping: ArrayVec::new(),
            kinematic_error: KinematicError::default(),
        }
    }

    pub(super) fn add(&mut self, effect: &Effect, strength: f64) -> Result<(), Full> {
        match *effect {
            Effect::TorsionalCompliance { stiffness_nm_rad } => {
                self.stiffness_factor += strength * self.stiffness_change(stiffness_nm_rad);
            }
            Effect::SoftWindup {
                low_stiffness_nm_rad,
                knee_nm,
            } => {
                let windup = Windup {
                    low_stiffness_nm_rad,
                    knee_nm,
                    strength,
                };
                return self
                    .windups
                    .try_push(windup)
                    .map_err(Full::of(ELEMENTS_MAX));
            }
            Effect::TorsionalHysteresis {
                width_nm,
                yield_rad,
            } => {
                let element = TorsionalHysteresis {
                    width_nm: strength * width_nm,
                    yield_rad,
                };
                return self
                    .hysteresis
                    .try_push(element)
                    .map_err(Full::of(ELEMENTS_MAX));
            }
            Effect::StructuralDamping {
                damping_nm_s_rad,
                exponent,
            } => {
                let element = StructuralDamping {
                    damping_nm_s_rad: strength * damping_nm_s_rad,
                    exponent,
                };
                return self
                    .damping
                    .try_push(element)
                    .map_err(Full::of(ELEMENTS_MAX));
            }
            Effect::Backlash { gap_rad } => self.backlash.gap_rad += strength * gap_rad,
            Effect::KinematicError { .. } => return self.add_kinematic_error(effect, strength),
            _ => {}
        }
        Ok(())
    }

    /// Relative change by a stiffness: a change of the robot file's, or the stiffness itself where it has none.
    fn stiffness_change(&self, stiffness_nm_rad: f64) -> f64 {
        match self.reference_nm_rad {
            Some(reference_nm_rad) => stiffness_nm_rad / reference_nm_rad,
            None => stiffness_nm_rad / self.curve.stiffness_nm_rad[0] - 1.0,
        }
    }

    fn add_kinematic_error(&mut self, effect: &Effect, strength: f64) -> Result<(), Full> {
        let Effect::KinematicError {
            amplitude_rad,
            cycles_per_motor_rev,
            phase_rad,
            amplitude_rad_2,
            cycles_per_motor_rev_2,
            phase_rad_2,
            amplitude_rad_3,
            cycles_per_motor_rev_3,
            phase_rad_3,
        } = *effect
        else {
            return Ok(());
        };
        let harmonics = [
            (amplitude_rad, cycles_per_motor_rev, phase_rad),
            (amplitude_rad_2, cycles_per_motor_rev_2, phase_rad_2),
            (amplitude_rad_3, cycles_per_motor_rev_3, phase_rad_3),
        ];
        for (amplitude_rad, cycles_per_motor_rev, phase_rad) in harmonics {
            if amplitude_rad == 0.0 {
                continue;
            }
            let amplitude_rad = strength * amplitude_rad;
            let harmonic = KinematicHarmonic {
                amplitude_rad,
                cycles_per_motor_rev,
                phase_rad,
            };
            let pushed = self.kinematic_error.harmonics.try_push(harmonic);
            pushed.map_err(Full::of(KinematicError::HARMONICS_MAX))?;
        }
        Ok(())
    }

    fn main(&self) -> CatalogueCompliance {
        self.curve.scaled(self.stiffness_factor)
    }

    /// Torque of the spring alone.
    pub fn elastic_nm(&self, torsion_rad: f64) -> f64 {
        let main = self.main();
        let loaded_rad = self.backlash.loaded_torsion_rad(torsion_rad);
        self.windups
            .iter()
            .fold(main.torque_nm(loaded_rad), |torque_nm, windup| {
                let soft_nm = windup.spring(main).torque_nm(loaded_rad);
                torque_nm + windup.strength * (soft_nm - torque_nm)
            })
    }

    /// Energy of the spring alone.
    pub fn elastic_j(&self, torsion_rad: f64) -> f64 {
        let main = self.main();
        let loaded_rad = self.backlash.loaded_torsion_rad(torsion_rad);
        self.windups
            .iter()
            .fold(main.energy_j(loaded_rad), |energy_j, windup| {
                let soft_j = windup.spring(main).energy_j(loaded_rad);
                energy_j + windup.strength * (soft_j - energy_j)
            })
    }

    /// Torsion under a torque; exact while no soft start is halfway in.
    pub fn torsion_rad(&self, torque_nm: f64) -> f64 {
        let main = self.main();
        let loaded_rad = match self.windups.iter().rfind(|windup| windup.strength > 0.5) {
            Some(windup) => windup.spring(main).torsion_rad(torque_nm),
            None => main.torsion_rad(torque_nm),
        };
        self.backlash.torsion_rad(loaded_rad)
    }

    /// Structural damping torque over torsion rate.
    pub fn damping_nm_s_rad(&self, torsion_rate_rad_s: f64) -> f64 {
        self.damping
            .iter()
            .map(|element| element.coefficient_nm_s_rad(torsion_rate_rad_s))
            .sum()
    }

    /// The steepest the gear gets.
    pub fn stiffness_max_nm_rad(&self) -> f64 {
        let hysteresis: f64 = self
            .hysteresis
            .iter()
            .map(|loop_| 0.5 * loop_.width_nm / loop_.yield_rad)
            .sum();
        let soft = self
            .windups
            .iter()
            .map(|windup| windup.low_stiffness_nm_rad);
        self.main()
            .stiffness_nm_rad
            .into_iter()
            .chain(soft)
            .fold(0.0, f64::max)
            + hysteresis
    }

    /// The softest it gets.
    pub fn stiffness_min_nm_rad(&self) -> f64 {
        self.main()
            .stiffness_nm_rad
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }
}

impl Windup {
    fn spring(&self, main: CatalogueCompliance) -> SoftWindup<CatalogueCompliance> {
        SoftWindup {
            main,
            low_stiffness_nm_rad: self.low_stiffness_nm_rad,
            knee_nm: self.knee_nm,
        }
    }
}
