//! Effects on the gear: stiffness, soft wind-up, hysteresis, damping, kinematic error, backlash.

use arrayvec::ArrayVec;
use joint_model::transmission::{
    Backlash, CatalogueCompliance, KinematicHarmonic, SoftWindup, Spring, StructuralDamping,
    TorsionalHysteresis,
};
use robot::effect::parts::{self, Full, SoftStart};

/// The most elements of a kind at one joint.
pub(crate) const ELEMENTS_MAX: usize = 4;
/// The most harmonics of kinematic error.
const KINEMATIC_HARMONICS_MAX: usize = 12;

/// The gear of one joint.
#[derive(Clone, Debug)]
pub(crate) struct Transmission {
    curve: CatalogueCompliance,
    /// What a stiffness in an effect is compared with: the robot file's, where it has one.
    reference_nm_rad: Option<f64>,
    stiffness_factor: f64,
    windups: ArrayVec<SoftStart, ELEMENTS_MAX>,
    backlash: Backlash,
    pub hysteresis: ArrayVec<TorsionalHysteresis, ELEMENTS_MAX>,
    damping: ArrayVec<StructuralDamping, ELEMENTS_MAX>,
    pub kinematic_error: ArrayVec<KinematicHarmonic, KINEMATIC_HARMONICS_MAX>,
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
            kinematic_error: ArrayVec::new(),
        }
    }

    /// Relative change by a stiffness: a change of the robot file's, or the stiffness itself where it has none.
    fn stiffness_change(&self, stiffness_nm_rad: f64) -> f64 {
        match self.reference_nm_rad {
            Some(reference_nm_rad) => stiffness_nm_rad / reference_nm_rad,
            None => stiffness_nm_rad / self.curve.stiffness_nm_rad[0] - 1.0,
        }
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
                let soft_nm = soft_windup(windup, main).torque_nm(loaded_rad);
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
                let soft_j = soft_windup(windup, main).energy_j(loaded_rad);
                energy_j + windup.strength * (soft_j - energy_j)
            })
    }

    /// Torsion under a torque; exact while no soft start is halfway in.
    pub fn torsion_rad(&self, torque_nm: f64) -> f64 {
        let main = self.main();
        let loaded_rad = match self.windups.iter().rfind(|windup| windup.strength > 0.5) {
            Some(windup) => soft_windup(windup, main).torsion_rad(torque_nm),
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

impl parts::Gear for Transmission {
    fn add_stiffness(&mut self, stiffness_nm_rad: f64, strength: f64) {
        self.stiffness_factor += strength * self.stiffness_change(stiffness_nm_rad);
    }

    fn add_soft_windup(&mut self, start: SoftStart) -> Result<(), Full> {
        Full::push(&mut self.windups, start)
    }

    fn add_hysteresis(&mut self, element: TorsionalHysteresis) -> Result<(), Full> {
        Full::push(&mut self.hysteresis, element)
    }

    fn add_structural_damping(&mut self, element: StructuralDamping) -> Result<(), Full> {
        Full::push(&mut self.damping, element)
    }

    fn add_gap(&mut self, gap_rad: f64) {
        self.backlash.gap_rad += gap_rad;
    }

    fn add_kinematic_error(&mut self, harmonic: KinematicHarmonic) -> Result<(), Full> {
        Full::push(&mut self.kinematic_error, harmonic)
    }
}

fn soft_windup(start: &SoftStart, main: CatalogueCompliance) -> SoftWindup<CatalogueCompliance> {
    SoftWindup {
        main,
        low_stiffness_nm_rad: start.low_stiffness_nm_rad,
        knee_nm: start.knee_nm,
    }
}
