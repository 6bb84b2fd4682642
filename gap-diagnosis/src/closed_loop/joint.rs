//! One joint with its twin: which set of effects explains it, chosen by responses and fitted by simulation in turn.

use joint_twin::JointTwin;
use joint_twin::TwinError;
use joint_twin::on_all_cores::OnAllCores;
use recording_checks::found::Found as Counted;

use crate::closed_loop::repeated::Repeated;
use crate::closed_loop::search::{Model, Search, Term};
use crate::evidence::arm::AheadOf;
use crate::evidence::imitation::{self, Ahead};
use crate::evidence::rows::Rows;
use crate::evidence::{AMPLITUDE_NATS, Evidence, Scored};

use super::counted;
use super::refine::{Refined, Worth, refined};
use super::rows::{About, Compared, OfArm, kinds_of};

/// Rounds in which the best set and the responses about it settle.
pub(super) const ROUNDS: usize = 3;
/// Sets of different names that are fitted by simulation in each.
const FITTED: usize = 4;

/// One joint with its twin, ready to be explained.
pub(super) struct Joint<'a> {
    /// Its place among the robot's joints.
    pub index: usize,
    /// Its twin, and what may be fitted to it.
    pub search: Search<'a>,
    /// Rows that are compared.
    pub compared: Compared,
    /// Delay and lag that the samples show, which every model has.
    pub settled: Vec<Term>,
    /// Why its motion tells little, if it does.
    pub poverty: Option<&'static str>,
}

/// What explains a joint.
pub(super) struct Explained {
    /// Responses about the model that was fitted.
    pub about: About,
    /// What they explain.
    pub evidence: Evidence,
    /// What is told, then the others, the best first.
    pub sets: Vec<Scored>,
    /// A smooth law on no list that explains something that is left.
    pub leaves: Option<Ahead>,
}

impl Explained {
    /// Nats by which a joint is better told than it is by another explanation, with the rows that both count as independent.
    pub fn ahead_of(&self, other: &Self, joint: &Joint<'_>) -> AheadOf {
        let [own, others] = [self, other].map(|of| {
            let names = of.sets[0].names;
            let left = of.evidence.mean_squares(names);
            let settled = of.evidence.settled();
            let all: Vec<(f64, f64)> = left
                .iter()
                .zip(settled)
                .map(|(left, settled)| (left + settled.floor, settled.independent_rows))
                .collect();
            let known = &joint.search.twin.known;
            let is_of_links = |place: usize| known[place].known.is_of_links();
            let [cost, of_links] = of.evidence.cost_and_strain(names, is_of_links);
            (all, cost, of_links)
        });
        let by_signal = own.0.iter().zip(&others.0);
        let gained: f64 = by_signal
            .map(|((own, own_rows), (others, other_rows))| {
                0.5 * own_rows.min(*other_rows) * (others / own).ln()
            })
            .sum();
        AheadOf {
            own: gained + others.1 - own.1,
            strain_of_links: [own.2, others.2],
        }
    }
}

impl<'a> Joint<'a> {
    pub fn of(
        index: usize,
        twin: &'a JointTwin<'a>,
        counted: &[Counted],
        name: &str,
        repeated: &Repeated,
        poverty: Option<&'static str>,
    ) -> Result<Self, TwinError> {
        let mut search = Search::new(twin)?;
        search.repeats_nm = repeated.scatter_nm(name, &search)?;
        Ok(Self {
            index,
            compared: Compared::of(&search),
            poverty,
            settled: counted::settled(counted, &search.scale),
            search,
        })
    }

    pub fn start(&self) -> Model {
        Model::of_settled(&self.search, &self.settled)
    }

    pub fn weighed(&self, about: About, of_arm: Option<&OfArm>) -> Explained {
        let evidence = about.evidence(&self.compared, of_arm);
        let sets = evidence.best(|fit| about.is_possible(&self.search, fit));
        Explained {
            about,
            evidence,
            sets,
            leaves: None,
        }
    }

    /// The best set: responses choose some, simulation fits them, and the responses about the best of them choose again until the
    /// names stay.
    pub fn explained(&self, begin: About, of_arm: Option<&OfArm>) -> Result<Explained, TwinError> {
        let mut explained = self.weighed(begin, of_arm);
        for round in 0..ROUNDS {
            let Some(best) = self.best_fitted(&explained)? else {
                break;
            };
            if round > 0 && kinds_of(&best) == kinds_of(&explained.about.model) {
                break;
            }
            explained = self.weighed_about(&best, of_arm)?;
        }
        if self.take_back_imitations(&mut explained)? {
            // what is left was fitted beside what is gone
            let fitted = self.fitted(&explained, &explained.sets[0])?;
            explained = self.weighed_about(&fitted.model, of_arm)?;
            self.take_back_imitations(&mut explained)?;
        }
        Ok(explained)
    }

    fn weighed_about(&self, model: &Model, of_arm: Option<&OfArm>) -> Result<Explained, TwinError> {
        let mut about = About::of(&self.search, &self.compared, model)?;
        if let Some(of_arm) = of_arm {
            of_arm.add_to(&mut about);
        }
        Ok(self.weighed(about, of_arm))
    }

    /// Takes back names whose part of the gap a smooth law on no list explains better; whether there were any.
    fn take_back_imitations(&self, explained: &mut Explained) -> Result<bool, TwinError> {
        let Explained {
            about,
            evidence,
            sets,
            leaves,
        } = explained;
        let rows = self.rows()?;
        let best = sets[0].names;
        *leaves = imitation::take_back(
            sets,
            evidence,
            &rows,
            |column| self.compared.of_motor(column),
            0,
            |fit| about.is_possible(&self.search, fit),
        );
        let names = sets[0].names;
        if names != best {
            about.model = about.told(&self.search, &evidence.fit(names));
        }
        Ok(names != best)
    }

    /// Of the first few sets of different names the one that leaves least where it is simulated. Without names too: the file's values
    /// respond otherwise beside what the arm shares, and where they are.
    fn best_fitted(&self, explained: &Explained) -> Result<Option<Model>, TwinError> {
        let Explained {
            about,
            evidence,
            sets,
            ..
        } = explained;
        let mut tried: Vec<(Vec<String>, Scored)> = Vec::new();
        for set in sets {
            let kinds = about.kinds(set.names);
            if tried.len() < FITTED && !tried.iter().any(|(other, _)| *other == kinds) {
                tried.push((kinds, *set));
            }
        }
        let fitted = tried
            .iter()
            .on_all_cores(|(_, set)| {
                let fitted = self.fitted(explained, set)?;
                Ok((fitted.nats + evidence.cost(set.names), fitted))
            })
            .collect::<Result<Vec<(f64, Refined)>, TwinError>>()?;
        let best = fitted.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let best = best.map(|(_, fitted)| self.without_ends(explained, fitted));
        best.transpose()
    }

    /// The same model with what a name is where the motion does not reach its end, if that leaves no more than its further freedom costs.
    fn without_ends(&self, explained: &Explained, fitted: Refined) -> Result<Model, TwinError> {
        let mut simpler = fitted.model.clone();
        for term in &mut simpler.terms {
            if let Some((hypothesis, amplitude)) = term
                .hypothesis
                .without_end(&term.amplitudes, &self.search.scale)
            {
                *term = Term {
                    hypothesis,
                    amplitudes: vec![amplitude],
                };
            }
        }
        let mut kinds = kinds_of(&simpler);
        kinds.dedup();
        if simpler == fitted.model || kinds.len() < simpler.terms.len() {
            return Ok(fitted.model);
        }
        let Explained {
            about, evidence, ..
        } = explained;
        let worth = Worth::of(&self.compared, evidence.settled());
        let simpler = refined(&self.search, &self.compared, &worth, &about.known, &simpler)?;
        let is_enough = simpler.nats <= fitted.nats + AMPLITUDE_NATS;
        Ok(if is_enough {
            simpler.model
        } else {
            fitted.model
        })
    }

    /// A set, fitted by simulation.
    fn fitted(&self, explained: &Explained, set: &Scored) -> Result<Refined, TwinError> {
        let Explained {
            about, evidence, ..
        } = explained;
        let worth = Worth::of(&self.compared, evidence.settled());
        let start = about.told(&self.search, &evidence.fit(set.names));
        refined(&self.search, &self.compared, &worth, &about.known, &start)
    }

    /// Rows of the motor's signal, as they count.
    pub fn rows(&self) -> Result<Rows, TwinError> {
        let gap_nm = self
            .compared
            .pick(&self.search.residual_nm(&Model::default())?);
        let measured_nm = self.compared.pick(&self.search.measured_nm);
        let of_motor = self.compared.motor_rows();
        let row = |of: fn(&joint_twin::Row) -> f64| {
            let rows = of_motor.iter().map(|k| of(&self.search.twin.rows[*k]));
            rows.collect::<Vec<f64>>()
        };
        let count = of_motor.len();
        let both = measured_nm.iter().zip(&gap_nm).take(count);
        Ok(Rows {
            time_s: row(|row| row.time_s),
            position_rad: row(|row| row.position_rad),
            velocity_rad_s: row(|row| row.velocity_rad_s),
            load_nm: row(|row| row.load_nm),
            since_reversal_s: self.since_reversal_s(),
            nominal_nm: both.map(|(measured, gap)| measured - gap).collect(),
            measured_nm: measured_nm[..count].to_vec(),
        })
    }

    pub fn since_reversal_s(&self) -> Vec<f64> {
        let rows = &self.search.twin.rows;
        let of_motor = self.compared.motor_rows();
        let mut since_s = Vec::with_capacity(of_motor.len());
        let mut turned_s = f64::NEG_INFINITY;
        for (place, k) in of_motor.iter().enumerate() {
            let row = &rows[*k];
            let before = place.checked_sub(1).map(|p| &rows[of_motor[p]]);
            let turns = before.is_none_or(|before| {
                before.stretch != row.stretch || before.velocity_rad_s * row.velocity_rad_s <= 0.0
            });
            if turns {
                turned_s = row.time_s;
            }
            since_s.push(row.time_s - turned_s);
        }
        since_s
    }
}
