//! A joint's recordings beside its twin, as the evidence takes them: compared rows signal by signal, what the robot file needs and may
//! be wrong about, and the response to every effect, all about one model.

use joint_twin::TwinError;
use joint_twin::on_all_cores::OnAllCores;
use joint_twin::signal::difference;
use robot::Effect;

use crate::closed_loop::search::{Model, Search, Term};
use crate::effects::Hypothesis;
use crate::evidence::{
    AMPLITUDE_NATS, DEVIATIONS, ERRORS, Evidence, Fit, INEXACT, ITEMS_MAX, Item, Message,
    NAME_NATS, Names, Presupposed, Problem, Span,
};

/// Names among which one costs [`NAME_NATS`]; among more the odds against each are longer. Before anything is seen it is then one to five
/// that a joint has any of them; fitted to 200 development cases, so that what is stated with a probability holds as often.
const AMONG: f64 = 4.0;
/// What every joint may have.
const USUAL: [&str; 3] = ["coulomb_friction", "viscous_friction", "torque_offset"];

/// Compared rows of one joint: which row of the twin each is, and how much it counts.
#[derive(Clone, Debug)]
pub struct Compared {
    order: Vec<usize>,
    weights: Vec<f64>,
    /// Signals, in the order of the twin's channels.
    pub spans: Vec<Span>,
    /// Part of what the names explain by which no law is exact.
    pub inexact: f64,
}

impl Compared {
    /// Rows signal by signal. What nobody can tell of a row lets it count less; the mean square of the weights is one.
    pub fn of(search: &Search<'_>) -> Self {
        let rows = &search.twin.rows;
        let mut order = Vec::with_capacity(rows.len());
        let mut weights = Vec::with_capacity(rows.len());
        let mut spans = Vec::new();
        for &channel in &search.twin.channels {
            let begin = order.len();
            order.extend((0..rows.len()).filter(|k| rows[*k].channel == channel));
            let own = order[begin..]
                .iter()
                .map(|k| search.whitener.weight(*k))
                .collect::<Vec<f64>>();
            let square = own.iter().map(|w| w * w).sum::<f64>() / own.len().max(1) as f64;
            let mean = square.sqrt().max(f64::MIN_POSITIVE);
            weights.extend(own.iter().map(|w| w / mean));
            spans.push(Span {
                rows: begin..order.len(),
                // of rows that count as much as the mean one
                floor_nm: search.twin_floor_nm(channel) / mean,
            });
        }
        Self {
            order,
            weights,
            spans,
            inexact: INEXACT,
        }
    }

    /// Whether so many times a column is more than the floor of some signal.
    pub fn shows(&self, column: &[f64], times: f64) -> bool {
        self.spans.iter().any(|span| {
            let own = &column[span.rows.clone()];
            let floor = own.len() as f64 * span.floor_nm.powi(2);
            times.powi(2) * own.iter().map(|x| x * x).sum::<f64>() > floor
        })
    }

    /// A column of the twin's rows, as it counts.
    pub fn pick(&self, column: &[f64]) -> Vec<f64> {
        let both = self.order.iter().zip(&self.weights);
        both.map(|(row, weight)| weight * column[*row]).collect()
    }

    /// A column of the motor's rows, as it counts, that does not show in other signals.
    pub fn of_motor(&self, column: &[f64]) -> Vec<f64> {
        let both = column.iter().zip(&self.weights);
        let mut all: Vec<f64> = both.map(|(x, weight)| x * weight).collect();
        all.resize(self.order.len(), 0.0);
        all
    }

    /// Rows of the twin that the motor's signal has.
    pub fn motor_rows(&self) -> &[usize] {
        let span = self.spans.first().map_or(0..0, |span| span.rows.clone());
        &self.order[span]
    }
}

/// Something that may be named, with its responses.
#[derive(Clone, Debug)]
pub struct Response {
    /// At the size at which they were found; its amplitudes are none where it is not of the model.
    pub term: Term,
    /// For each amplitude, and for the shape where that is free and it is of the model.
    pub columns: Vec<Vec<f64>>,
    kind: usize,
    cost: f64,
}

/// A cause that the arm shares, as one joint's signals answer it.
#[derive(Clone, Debug)]
pub struct OfArm {
    /// Per unit of each amplitude, about those said.
    pub columns: Vec<Vec<f64>>,
    /// Amplitudes that the model has.
    pub said: Vec<f64>,
    /// What the other joints say of them.
    pub message: Message,
}

impl OfArm {
    /// Lets a joint's gap be what it would be without the cause.
    pub fn add_to(&self, about: &mut About) {
        for (column, said) in self.columns.iter().zip(&self.said) {
            add(&mut about.gap_nm, column, *said);
        }
    }
}

/// Everything about one model.
#[derive(Clone, Debug)]
pub struct About {
    /// The model.
    pub model: Model,
    /// What would be left without its effects and with the file's own values, as the responses about it tell.
    pub gap_nm: Vec<f64>,
    /// To everything that may be named.
    pub responses: Vec<Response>,
    /// To the file's values and what no file tells, of one standard deviation each.
    pub known: Vec<Vec<f64>>,
}

impl About {
    /// Of the model's responses.
    ///
    /// # Errors
    /// [`TwinError`].
    pub fn of(search: &Search<'_>, compared: &Compared, model: &Model) -> Result<Self, TwinError> {
        let mut model = model.clone();
        model.known.resize(search.twin.known.len(), 0.0);
        let base_nm = search.coarsely_nm(&model)?;
        let residual_nm = search.residual_nm(&model)?;
        let known_nm = search.known_columns(&base_nm, &model)?;
        let known: Vec<Vec<f64>> = known_nm.iter().map(|raw| compared.pick(raw)).collect();
        let mut gap_nm = compared.pick(&residual_nm);
        for (column, value) in known.iter().zip(&model.known) {
            add(&mut gap_nm, column, *value);
        }
        let mut responses = Vec::new();
        for (place, term) in model.terms.iter().enumerate() {
            let mut columns = own_columns(search, compared, &model, place, Step::Ahead(&base_nm))?;
            let mut term = term.clone();
            if term.hypothesis.is_switch() {
                // there or not: beside the shape's response, that to its being there
                let mut without = model.clone();
                without.terms.remove(place);
                let raw = difference(&base_nm, &search.coarsely_nm(&without)?);
                columns.insert(0, compared.pick(&raw));
                term.amplitudes = vec![1.0];
            }
            for (column, amplitude) in columns.iter().zip(&term.amplitudes) {
                add(&mut gap_nm, column, *amplitude);
            }
            responses.push(Response::of(search, term, columns));
        }
        let is_told = |hypothesis: &Hypothesis| {
            let mut own = model.terms.iter();
            own.any(|term| is_same(&term.hypothesis, hypothesis))
        };
        let of_arm = search.twin.joints() > 1;
        let lever_m = lever_m(search, &model);
        let others = search.hypotheses.iter();
        let others = others
            .map(|of| lever_m.map_or_else(|| of.clone(), |lever_m| of.hanging_at(lever_m)))
            .chain(search.periodic_hypotheses(&model, &residual_nm, &known_nm))
            .filter(|hypothesis| !(is_told(hypothesis) || of_arm && hypothesis.is_of_arm()))
            .collect();
        let others = search.columns(&base_nm, &model, others)?;
        let of_others = others.into_iter().filter_map(|(hypothesis, columns)| {
            let columns: Vec<Vec<f64>> = columns.iter().map(|raw| compared.pick(raw)).collect();
            let is_number = columns.iter().flatten().all(|x| x.is_finite());
            let shows = columns.iter().flatten().any(|x| *x != 0.0);
            let term = Term {
                amplitudes: vec![0.0; hypothesis.amplitudes()],
                hypothesis,
            };
            (is_number && shows).then(|| Response::of(search, term, columns))
        });
        responses.extend(of_others);
        responses.truncate(ITEMS_MAX);
        let mut about = Self {
            model,
            gap_nm,
            responses,
            known,
        };
        about.share_costs(search.twin.joints());
        Ok(about)
    }

    /// Shapes of one name share its odds: each costs the logarithm of how many there are. One joint of an arm has a cause by longer odds
    /// than a bench's only one.
    fn share_costs(&mut self, joints: usize) {
        let mut kinds: Vec<String> = Vec::new();
        for response in &mut self.responses {
            let name = kind_name(&response.term.hypothesis);
            response.kind = match kinds.iter().position(|kind| *kind == name) {
                Some(place) => place,
                None => {
                    kinds.push(name);
                    kinds.len() - 1
                }
            };
        }
        let count = |kind: usize| self.responses.iter().filter(|of| of.kind == kind).count();
        let counts: Vec<usize> = (0..kinds.len()).map(count).collect();
        let among = (kinds.len() * joints) as f64 / AMONG;
        let among = among.ln().max(0.0);
        for response in &mut self.responses {
            response.cost += among;
            if response.term.hypothesis.shape_is_free() {
                response.cost += (counts[response.kind] as f64).ln();
            }
        }
    }

    /// The evidence, beside what the arm shares.
    pub fn evidence(&self, compared: &Compared, of_arm: Option<&OfArm>) -> Evidence {
        Evidence::of(&Problem {
            gap_nm: &self.gap_nm,
            spans: &compared.spans,
            items: &self.items(),
            inexact: compared.inexact,
            tolerated: &self.known,
            is_open: true,
            shared: of_arm.map(|of| (of.columns.as_slice(), &of.message)),
        })
    }

    /// The evidence of what every joint may have, beside what the arm shares.
    pub fn usual_evidence(&self, compared: &Compared, of_arm: &OfArm) -> Evidence {
        let items: Vec<Item<'_>> = self
            .items()
            .into_iter()
            .filter(|item| item.is_usual)
            .collect();
        Evidence::of(&Problem {
            gap_nm: &self.gap_nm,
            spans: &compared.spans,
            items: &items,
            inexact: compared.inexact,
            tolerated: &self.known,
            is_open: true,
            shared: Some((of_arm.columns.as_slice(), &of_arm.message)),
        })
    }

    fn items(&self) -> Vec<Item<'_>> {
        let responses = self.responses.iter();
        responses
            .map(|response| Item {
                kind: response.kind,
                cost: response.cost,
                presupposed: Presupposed::NOTHING,
                deviation: Some(response.term.hypothesis.plausible_steps()),
                is_usual: USUAL.contains(&response.term.hypothesis.name()),
                columns: &response.columns,
            })
            .collect()
    }

    /// The model that a fit tells.
    pub fn told(&self, search: &Search<'_>, fit: &Fit) -> Model {
        let known = fit.beside.iter().take(self.known.len());
        let terms = fit.amplitudes.iter();
        Model {
            known: known.map(|k| k.clamp(-DEVIATIONS, DEVIATIONS)).collect(),
            settled: self.model.settled.clone(),
            terms: terms
                .map(|(item, amplitudes)| self.term(search, *item, amplitudes))
                .collect(),
        }
    }

    /// An item at these amplitudes.
    pub fn term(&self, search: &Search<'_>, item: usize, amplitudes: &[f64]) -> Term {
        let response = &self.responses[item];
        let count = response.term.amplitudes.len();
        let mut steps = vec![0.0; Search::values(&response.term.hypothesis)];
        // the shape comes last
        if let (Some(step), Some(shape)) = (steps.last_mut(), amplitudes.get(count)) {
            *step = *shape;
        }
        let mut term = search.stepped(&response.term, &steps);
        let lowest = term.hypothesis.lowest(&search.scale);
        for (own, amplitude) in term.amplitudes.iter_mut().zip(amplitudes) {
            *own = amplitude.max(lowest);
        }
        term
    }

    /// Whether a fit is one that a joint can have.
    pub fn is_possible(&self, search: &Search<'_>, fit: &Fit) -> bool {
        let mut place = 0;
        fit.amplitudes.iter().all(|(item, amplitudes)| {
            let hypothesis = &self.responses[*item].term.hypothesis;
            let own = place;
            place += amplitudes.len();
            let lowest = hypothesis.lowest(&search.scale);
            let error = ERRORS * fit.covariance[(own, own)].max(0.0).sqrt();
            // of what cannot be less than nothing, nothing is the set without it
            let margin = if lowest < 0.0 { error } else { 0.0 };
            let passes = hypothesis.amplitudes() == 1
                && amplitudes
                    .first()
                    .is_some_and(|value| value + margin < lowest);
            !passes
        })
    }

    /// Which items are one name.
    pub fn kind(&self, item: usize) -> usize {
        self.responses[item].kind
    }

    /// Whether every joint may have it.
    pub fn is_usual(&self, item: usize) -> bool {
        USUAL.contains(&self.responses[item].term.hypothesis.name())
    }

    /// Kinds of a set, sorted.
    pub fn kinds(&self, names: Names) -> Vec<String> {
        let responses = self.responses.iter().enumerate();
        let mut kinds: Vec<String> = responses
            .filter(|(item, _)| names & 1 << item != 0)
            .map(|(_, response)| kind_name(&response.term.hypothesis))
            .collect();
        kinds.sort_unstable();
        kinds
    }
}

/// How far from its axis a mass hangs that is what a model adds to the weight and the inertia of an only joint's link.
fn lever_m(search: &Search<'_>, model: &Model) -> Option<f64> {
    let effects = || model.terms.iter().map(|term| term.effect(&search.scale));
    let weight_nm = effects().find_map(|effect| match effect {
        Effect::GravityTorque { sin_nm, cos_nm } => Some(sin_nm.hypot(cos_nm)),
        _ => None,
    })?;
    let inertia_kg_m2 = effects().find_map(|effect| match effect {
        Effect::LinkInertia { inertia_kg_m2 } => Some(inertia_kg_m2),
        _ => None,
    })?;
    let lever_m = inertia_kg_m2 * search.twin.gravity_across_m_s2() / weight_nm;
    (lever_m > 0.0 && lever_m.is_finite()).then_some(lever_m)
}

/// Kinds of a model's terms, sorted.
pub fn kinds_of(model: &Model) -> Vec<String> {
    let terms = model.terms.iter();
    let mut kinds: Vec<String> = terms.map(|term| kind_name(&term.hypothesis)).collect();
    kinds.sort_unstable();
    kinds
}

/// Of a kinematic error several harmonics may be told; of everything else one.
fn kind_name(hypothesis: &Hypothesis) -> String {
    match hypothesis.shape.first() {
        Some(cycles) if !hypothesis.repeats(hypothesis) && hypothesis.is_periodic() => {
            format!("{} {cycles:.0}", hypothesis.name())
        }
        _ => hypothesis.name().to_owned(),
    }
}

fn is_same(one: &Hypothesis, other: &Hypothesis) -> bool {
    one.shape.len() == other.shape.len()
        && kind_name(one) == kind_name(other)
        && one
            .shape
            .iter()
            .zip(&other.shape)
            .all(|(a, b)| (a / b - 1.0).abs() < 0.3)
}

impl Response {
    fn of(search: &Search<'_>, term: Term, columns: Vec<Vec<f64>>) -> Self {
        let hypothesis = &term.hypothesis;
        let values = hypothesis.amplitudes() + hypothesis.shape.len();
        let among = if hypothesis.is_periodic() {
            // any number of cycles that the recording holds may have been found
            search.scale.motor_turns.max(1.0).ln()
        } else {
            0.0
        };
        Self {
            cost: NAME_NATS + AMPLITUDE_NATS * (values.max(1) - 1) as f64 + among,
            kind: 0,
            term,
            columns,
        }
    }
}

/// From where the response to a step is taken.
#[derive(Clone, Copy)]
pub enum Step<'a> {
    /// From what the model itself shows.
    Ahead(&'a [f64]),
    /// From a step back, each so many times the effect's own: what a tilt about an axis along which gravity points does is of second order,
    /// which a step one way would show as of first.
    BothWays(&'a [f64]),
}

/// Responses to the values of one of the model's own terms.
pub fn own_columns(
    search: &Search<'_>,
    compared: &Compared,
    model: &Model,
    place: usize,
    step: Step<'_>,
) -> Result<Vec<Vec<f64>>, TwinError> {
    let term = &model.terms[place];
    let values = Search::values(&term.hypothesis);
    (0..values)
        .on_all_cores(|value| {
            let at = |size: f64| {
                let mut steps = vec![0.0; values];
                steps[value] = size;
                let mut beside = model.clone();
                beside.terms[place] = search.stepped(term, &steps);
                search.coarsely_nm(&beside)
            };
            Ok(match step {
                Step::Ahead(base_nm) => compared.pick(&difference(&at(1.0)?, base_nm)),
                Step::BothWays(sizes) => {
                    let [ahead_nm, back_nm] = [at(sizes[value])?, at(-sizes[value])?];
                    let mut column = compared.pick(&difference(&ahead_nm, &back_nm));
                    column.iter_mut().for_each(|x| *x *= 0.5);
                    column
                }
            })
        })
        .collect()
}

fn add(sum: &mut [f64], column: &[f64], factor: f64) {
    if factor != 0.0 {
        for (sum, x) in sum.iter_mut().zip(column) {
            *sum += factor * x;
        }
    }
}
