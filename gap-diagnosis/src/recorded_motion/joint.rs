//! One joint as it is regressed: its rows, what may be named of it, and which names are.

use gap_report::{DataFinding, JointReport, JointTorque, SignalGap, TorqueSource};
use joint_twin::signal::band::COMPARED_HZ;
use recording_checks::units::GAIN;
use robot::{EffectKind, Robot, Tolerance};

use super::dynamics::Drive;
use super::laws::{self, Law};
use super::motion::apart_s;
use super::rows::JointRows;
use super::shared::Prior;
use super::signals::controller;
use crate::evidence::arm::{self, AheadOf, Cause, Shared};
use crate::evidence::imitation::{self, Ahead};
use crate::evidence::told::MATERIALITY;
use crate::evidence::{
    DEVIATIONS, ERRORS, Evidence, Fit, Item, Names, Presupposed, Problem, Scored, Span,
};

/// Part of the torque that nobody can tell: torque transducers and current sensors of class 0.5 are linear to half a per cent.
const LINEAR: f64 = 0.005;
/// A value is certain by so many nats: three standard deviations.
const CERTAIN_NATS: f64 = 0.5 * DEVIATIONS * DEVIATIONS;
/// Part of the torque by which a command may differ from it without a word.
const COMMAND_TOLD: f64 = 0.05;

/// A joint as it is regressed.
#[derive(Clone)]
pub struct Joint {
    /// Among the robot's.
    pub index: usize,
    /// Where its torque is from.
    pub source: TorqueSource,
    /// What is compared.
    pub rows: JointRows,
    /// The same where its torque sensor tells what it carries; none where it has none beside the drive's torque.
    pub of_gear: Option<JointRows>,
    /// What the robot file needs of it beyond the rigid bodies.
    pub drive: Drive,
    /// How torque and masses miss each other, where that is by more than a torque constant's error could make.
    pub misfit: Option<Misfit>,
}

/// By how much a joint's masses need another torque than is recorded.
#[derive(Clone, Copy, Debug)]
pub struct Misfit {
    /// Of what is recorded.
    needed: f64,
    /// By which that explains more than names without it, and other masses at the arm's end.
    ahead_nats: f64,
    /// Which of the two is taken to be wrong.
    of: Wrong,
}

/// What a misfit is put down to: no motion of one joint tells them apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wrong {
    /// Torques are in no joint's N m.
    Unit,
    /// Other joints' torques are in N m.
    Masses,
    /// What the joint carries is not what the file's bodies need: its torque sensor measures something else.
    Load,
}

/// A joint's sets of names, without and with a shared cause.
#[derive(Clone)]
pub struct Searched {
    /// What decides among them.
    pub evidence: Evidence,
    /// What is told first, then the best first.
    pub sets: Vec<Scored>,
    /// How many of the file's values are of links; they come first.
    links: usize,
    /// A smooth law on no list that explains something that the names leave; none before that was looked at.
    pub leaves: Option<Option<Ahead>>,
}

impl Searched {
    /// By how much a joint is better told than it is by `other`, with the rows that both count as independent. `unit_nm`: of the other's
    /// torque, here.
    pub fn ahead_of(&self, other: &Self, unit_nm: f64) -> AheadOf {
        let [own, others] = [self, other].map(|searched| {
            let names = searched.sets[0].names;
            let left: f64 = searched.sets[0].left.iter().sum();
            let is_of_links = |place: usize| place < searched.links;
            let [cost, of_links] = searched.evidence.cost_and_strain(names, is_of_links);
            (left.max(f64::MIN_POSITIVE), cost, of_links)
        });
        let rows = |of: &Self| of.evidence.independent_rows();
        let independent = rows(self).min(rows(other));
        let left = 0.5 * independent * (unit_nm.powi(2) * others.0 / own.0).ln();
        AheadOf {
            own: left + others.1 - own.1,
            strain_of_links: [own.2, others.2],
        }
    }
}

/// What a reference that comes late looks like where the torque is the controller's: one that is held from row to row is half a row late.
fn late_reference(robot: &Robot, joint: usize, recorded_hz: f64) -> String {
    let late_s = 0.5 / recorded_hz;
    let stiffness = controller(robot).map(|of| of.proportional_nm_rad[joint]);
    stiffness.map_or_else(String::new, |stiffness| {
        format!(
            "; a reference that the drive holds from row to row is half a row late, {:.1} ms, which looks like viscous friction of {:.3} \
             Nm s/rad",
            1e3 * late_s,
            stiffness * late_s
        )
    })
}

impl Joint {
    fn items(&self) -> Vec<Item<'_>> {
        let expects_friction = self.drive.rubs_unmeasured();
        let laws = self.rows.laws.iter();
        laws.map(|(law, columns)| Item {
            kind: law.kind(),
            cost: law.cost(expects_friction),
            presupposed: if expects_friction {
                law.presupposes(self.rows.laws.iter().map(|(law, _)| *law))
            } else {
                Presupposed::NOTHING
            },
            deviation: law.deviation(),
            is_usual: law.is_usual(),
            columns,
        })
        .collect()
    }

    /// Friction that every joint has, where nobody measured it.
    fn expected(&self) -> Names {
        if !self.drive.rubs_unmeasured() {
            return 0;
        }
        let laws = self.rows.laws.iter().enumerate();
        laws.filter(|(_, (law, _))| law.is_expected())
            .fold(0, |names, (place, _)| names | 1 << place)
    }

    /// Columns of a cause that the arm shares.
    pub fn of_arm(&self, cause: Cause) -> &[Vec<f64>] {
        match cause {
            Cause::Payload => &self.rows.payload,
            Cause::Delay => &self.rows.late,
            Cause::Masses(_) => &self.rows.masses,
            Cause::Tilt => &self.rows.tilt,
        }
    }

    /// Names that causes of the arm are held against: to second order a late reference is half of it viscous friction, so that beside that
    /// it would be told as half as late; and links' values are what a link weighs at its joint.
    pub fn in_place_of(&self, causes: &[Cause]) -> Names {
        let is_alike = |law: Law| {
            let mut causes = causes.iter();
            causes.any(|cause| match cause {
                Cause::Delay => law == Law::Viscous,
                // what a sensor behind the gear feels of inertia is a link's
                Cause::Masses(_) => match law {
                    Law::Gravity | Law::LinkInertia => true,
                    Law::Inertia => self.source == TorqueSource::Sensor,
                    _ => false,
                },
                Cause::Payload | Cause::Tilt => false,
            })
        };
        let laws = self.rows.laws.iter().enumerate();
        let alike = laws.filter(|(_, (law, _))| is_alike(*law));
        alike.fold(0, |names, (place, _)| names | 1 << place)
    }

    fn spans(&self) -> [Span; 1] {
        let torque_nm = &self.rows.seen.measured_nm;
        let square = torque_nm.iter().map(|x| x * x).sum::<f64>();
        [Span {
            rows: 0..self.rows.seen.count(),
            floor_nm: LINEAR * (square / torque_nm.len().max(1) as f64).sqrt(),
        }]
    }

    /// What decides among its names, beside what the arm shares.
    pub fn evidence(&self, shared: Option<&Prior<'_>>) -> Evidence {
        let links = match shared {
            Some(prior) if prior.has_links => &[][..],
            _ => self.rows.links.as_slice(),
        };
        Evidence::of(&Problem {
            gap_nm: &self.rows.seen.gap_nm(),
            spans: &self.spans(),
            items: &self.items(),
            tolerated: &[links, &self.rows.tolerated, &self.rows.untold].concat(),
            is_open: false,
            inexact: 0.0,
            shared: shared.map(|prior| (prior.columns.as_slice(), &prior.message)),
        })
    }

    /// The gap of its torque beside the noise.
    pub fn signal_gap(&self) -> SignalGap {
        let rows = self.rows.seen.count().max(1) as f64;
        let gap_nm = self.rows.seen.gap_nm();
        let square = gap_nm.iter().map(|x| x * x).sum::<f64>() / rows;
        SignalGap {
            signal: self.source.signal_name().to_owned(),
            gap_to_noise: square.sqrt() / self.rows.noise_nm.max(f64::MIN_POSITIVE),
        }
    }

    /// Its sets beside what the arm shares, without what that stands for.
    pub fn searched(&self, shared: Option<&Prior<'_>>) -> Searched {
        let evidence = self.evidence(shared);
        let in_place_of = shared.map_or(0, |prior| self.in_place_of(prior.causes));
        let is_wrong = shared.is_some_and(|prior| prior.causes.iter().any(Cause::is_of_links));
        let rotor_kg_m2 = self.drive.model().rotor_inertia_kg_m2;
        let has_none = |fit: &Fit| {
            fit.amplitudes.iter().all(|(item, values)| {
                // beside the links' inertias the rest is the rotor's, which is no lighter than nothing
                let is_rotor = self.rows.laws[*item].0 == Law::Inertia;
                let is_lighter = is_rotor && values[0] < -rotor_kg_m2;
                in_place_of & 1 << item == 0 && !(is_wrong && is_lighter)
            })
        };
        let sets = evidence.best(|fit| has_none(fit) && self.is_possible(fit));
        Searched {
            links: match shared {
                Some(prior) if prior.has_links => 0,
                _ => self.rows.links.len(),
            },
            evidence,
            sets,
            leaves: None,
        }
    }

    /// Takes back names whose part of the gap a smooth law over what no name depends on explains better: the best set of the others,
    /// beside such a law, where that is ahead of the best set.
    pub fn without_imitations(&self, searched: &mut Searched) {
        if searched.leaves.is_some() {
            return;
        }
        searched.leaves = Some(imitation::take_back(
            &mut searched.sets,
            &searched.evidence,
            &self.rows.seen,
            <[f64]>::to_vec,
            self.expected(),
            |fit| self.is_possible(fit),
        ));
    }

    /// Whether a fit is one that the joint can have.
    pub fn is_possible(&self, fit: &Fit) -> bool {
        let rows = &self.rows;
        let model = self.drive.model();
        laws::is_possible(
            fit,
            |item| rows.laws[item].0,
            |law| law.limits(model, rows.speed_rad_s, rows.inertia_kg_m2),
            |velocity_rad_s| model.friction.drag_nm(velocity_rad_s, 0.0, 0.0, 0.0),
            self.drive
                .rubs_unmeasured()
                .then_some(model.friction.coulomb.coulomb_nm),
            rows.speed_rad_s,
        )
    }

    /// Searched without a shared cause, and from then on in another unit of torque, if that explains more than names do, or other masses at
    /// the arm's end would, for certain. Where masses and friction need another torque by a factor that no torque constant is off by, the
    /// factor is unknown and beside every set. `alone`: searched as it was recorded.
    pub fn in_another_unit(&self, alone: &Searched) -> Option<(Self, Searched)> {
        // what is reckoned from the file's own gains has the file's unit
        if self.source == TorqueSource::Controller {
            return None;
        }
        let (other, searched, size_nm) = self.at_another_size()?;
        // Masses may be missing, or too many. Friction that was measured tells the unit as well, and other masses would be one more cause;
        // who did not measure it knows the masses no better.
        let masses_cost = if self.drive.rubs_unmeasured() {
            0.0
        } else {
            Cause::Payload.cost()
        };
        let other_masses = self.searched(Some(&Prior {
            causes: &[Cause::Payload],
            columns: self.rows.payload.clone(),
            has_links: false,
            message: arm::prior(&[Cause::Payload]),
        }));
        let ahead_nats = [
            searched.ahead_of(alone, size_nm).of_one(),
            searched.ahead_of(&other_masses, size_nm).of_one() + masses_cost,
            self.follows_need(&searched, size_nm),
        ];
        let ahead_nats = ahead_nats.into_iter().fold(f64::INFINITY, f64::min);
        let misfit = Some(Misfit {
            needed: size_nm,
            ahead_nats,
            of: Wrong::Unit,
        });
        (ahead_nats >= CERTAIN_NATS).then(|| (Self { misfit, ..other }, searched))
    }

    /// The joint with what its torque sensor says that it carries, where no name explains it with what the file's bodies need, which leaves
    /// a part of the torque that matters, and this does for certain. `alone`: searched as it was recorded.
    pub fn beside_its_sensor(&self, alone: &Searched) -> Option<(Self, Searched)> {
        let torque_nm = self.rows.seen.measured_nm.iter();
        let torque: f64 = torque_nm.map(|nm| nm * nm).sum();
        let left: f64 = alone.sets[0].left.iter().sum();
        let is_unexplained = alone.sets[0].names == 0 && left > MATERIALITY * torque;
        let rows = self.of_gear.clone().filter(|_| is_unexplained)?;
        let other = Self {
            rows,
            of_gear: None,
            ..self.clone()
        };
        let searched = other.searched(None);
        let ahead_nats = searched.ahead_of(alone, 1.0).of_one();
        let misfit = Some(Misfit {
            needed: 1.0,
            ahead_nats,
            of: Wrong::Load,
        });
        (ahead_nats >= CERTAIN_NATS).then(|| (Self { misfit, ..other }, searched))
    }

    /// Nats by which names of a torque in a unit are better than those of one that follows no masses at all: such a one follows them in no
    /// unit.
    fn follows_need(&self, searched: &Searched, size_nm: f64) -> f64 {
        let without = Self {
            rows: self.rows.without_need(size_nm),
            ..self.clone()
        };
        searched.ahead_of(&without.searched(None), 1.0).of_one()
    }

    /// Whether its torque, as it was recorded, follows what the file's masses need.
    pub fn is_in_newton_metres(&self, alone: &Searched) -> bool {
        let needs = !self.rows.columns(Law::TorqueConstant).is_empty();
        needs && self.follows_need(alone, 1.0) >= CERTAIN_NATS
    }

    /// The joint as it was recorded, with masses that need its torque: what a unit explains of one whose friction nobody measured, other
    /// masses do as well.
    pub fn with_masses_for(&self, other: &Self) -> Option<(Self, Searched)> {
        let misfit = other
            .misfit
            .filter(|misfit| misfit.of == Wrong::Unit && self.drive.rubs_unmeasured())?;
        let joint = Self {
            rows: self.rows.with_masses(misfit.needed.recip()),
            misfit: Some(Misfit {
                of: Wrong::Masses,
                ..misfit
            }),
            ..self.clone()
        };
        let searched = joint.searched(None);
        Some((joint, searched))
    }

    /// The torque's unit, in N m as recorded.
    pub fn unit_nm(&self) -> f64 {
        let in_unit = self.misfit.filter(|misfit| misfit.of == Wrong::Unit);
        in_unit.map_or(1.0, |misfit| misfit.needed)
    }

    fn at_another_size(&self) -> Option<(Self, Searched, f64)> {
        /// The unit settles beside the names, which settle with it.
        const ROUNDS: usize = 2;
        let mut laws = self.rows.laws.iter();
        laws.find(|(law, _)| *law == Law::TorqueConstant)?;
        let mut size_nm = self.rows.unit_nm;
        let mut found = None;
        for _ in 0..ROUNDS {
            if size_nm <= 0.0 || (GAIN[0]..GAIN[1]).contains(&size_nm) {
                return None;
            }
            let other = Self {
                rows: self.rows.in_unit(size_nm),
                ..self.clone()
            };
            let searched = other.searched(None);
            let beside = searched.evidence.values_beside(searched.sets[0].names);
            let part = 1.0 + beside[other.rows.links.len() + other.rows.tolerated.len()];
            found = Some((other, searched, size_nm));
            size_nm /= part;
        }
        found
    }

    /// What a reader should know of a torque that its masses do not need.
    pub fn note_of_misfit(&self, name: &str) -> Option<DataFinding> {
        let Misfit {
            needed,
            ahead_nats,
            of,
        } = self.misfit?;
        let signal = self.source.signal_name();
        let of_torque = |judged: &str| {
            format!(
                "{signal} is {:.3} times what the file's masses and friction need, by {ahead_nats:.0} nats a better explanation than any \
                 names; no torque constant is so far off. The joint is judged {judged}",
                needed.recip()
            )
        };
        let (what, remedy) = match of {
            Wrong::Unit => (
                of_torque(&format!("as if its torque were {needed:.3} times as large")),
                format!(
                    "in the mapping file, [joint.{name}], {signal}: check its scale (amperes, per cent, gear side); if that is right, the \
                     file's masses are {needed:.3} times the robot's"
                ),
            ),
            Wrong::Masses => (
                of_torque(&format!(
                    "in the torque as it was recorded, for other joints' torques fit their masses, and as if its masses were {:.3} of the \
                     file's",
                    needed.recip()
                )),
                format!(
                    "check masses and centres of the links that it carries; if they are right, in the mapping file, [joint.{name}], \
                     {signal}: multiply its scale by {needed:.3}"
                ),
            ),
            Wrong::Load => (
                format!(
                    "what its torque sensor says that it carries explains {signal} by {ahead_nats:.0} nats better than what the file's \
                     bodies need: its motor and gear are judged by the difference of the two torques, and nothing is said of its link"
                ),
                format!(
                    "check its masses and what else pulls at it; to see what they leave, leave {signal} out of the mapping file"
                ),
            ),
        };
        Some(DataFinding {
            joint: Some(name.to_owned()),
            severity: "warning".to_owned(),
            what,
            remedy,
        })
    }

    /// That the robot file is of no use: with all that is told, more than the whole torque is left.
    pub fn note_of_file(&self, told: &JointReport) -> Option<DataFinding> {
        let torque_nm = &self.rows.seen.measured_nm;
        let square = torque_nm.iter().map(|x| x * x).sum::<f64>();
        let torque_nm = (square / torque_nm.len().max(1) as f64).sqrt();
        let left_nm = told.gap.torque_rms_nm.after;
        // nobody drives a joint without a torque
        (left_nm > torque_nm && torque_nm > 0.0).then(|| DataFinding {
            joint: Some(told.joint.clone()),
            severity: "warning".to_owned(),
            what: format!(
                "the robot file and all that is told leave {left_nm:.3} Nm rms of a torque of {torque_nm:.3} Nm rms: nothing at all would \
                 leave less, so that neither is to be believed"
            ),
            remedy: "check the file's masses and inertias, and the torque's unit, sign and joint".to_owned(),
        })
    }

    /// That the file's values, within their tolerance, take more of its torque than is left: no name has that. `searched`: what is told;
    /// `links`: what all joints say of the links' values, where that is written for a mended file.
    pub fn note_of_values(
        &self,
        name: &str,
        searched: &Searched,
        links: Option<&Shared>,
    ) -> Option<DataFinding> {
        let own = self.rows.links[..searched.links].iter();
        let own = own.chain(&self.rows.tolerated);
        let best = &searched.sets[0];
        let of_own = searched.evidence.values_beside(best.names);
        let mut moved_nm = vec![0.0; self.rows.seen.count()];
        let mut add = |column: &[f64], value: f64| {
            for (nm, of_value) in moved_nm.iter_mut().zip(column) {
                *nm += value * of_value;
            }
        };
        own.zip(&of_own)
            .for_each(|(column, value)| add(column, *value));
        if let Some(links) = links {
            let of_links = self.of_arm(links.cause).iter().zip(links.said.iter());
            of_links.for_each(|(column, value)| add(column, *value));
        }
        let rms = |square: f64| (square / self.rows.seen.count().max(1) as f64).sqrt();
        let moved_nm = rms(moved_nm.iter().map(|nm| nm * nm).sum());
        let left_nm = rms(best.left.iter().sum()).hypot(self.spans()[0].floor_nm);
        let written = match links {
            Some(_) => {
                "`flexspline gap apply` writes what all joints say of the links, the report's `links`, and leaves friction as it is"
            }
            None => {
                "`flexspline gap apply` leaves them as they are, so a mended file leaves that too"
            }
        };
        (moved_nm > left_nm).then(|| DataFinding {
            joint: Some(name.to_owned()),
            severity: "note".to_owned(),
            what: format!(
                "the robot file's own values, moved within their tolerance, take {moved_nm:.3} Nm rms of its torque beside what is named, \
                 more than the {left_nm:.3} Nm that are left: {written}"
            ),
            remedy: "identify the masses, or whatever friction the file has; or state in parameter_tolerance how well they are known"
                .to_owned(),
        })
    }

    /// That with what is named nothing of the joint's inertia is left for certain: something moves it that was not recorded.
    pub fn note_of_inertia(&self, told: &JointReport) -> Option<DataFinding> {
        let rotor_kg_m2 = match self.source {
            TorqueSource::Sensor => 0.0,
            _ => self.drive.model().rotor_inertia_kg_m2,
        };
        let of_file_kg_m2 = self.rows.inertia_kg_m2 + rotor_kg_m2;
        let mut named = told.effects.iter().filter(|found| !found.of_links);
        let lighter = named.find(|found| found.effect == EffectKind::LinkInertia.name())?;
        let change = lighter.parameters.get("inertia_kg_m2")?;
        let is_none = of_file_kg_m2 + change.value < ERRORS * change.std;
        is_none.then(|| DataFinding {
            joint: Some(told.joint.clone()),
            severity: "warning".to_owned(),
            what: format!(
                "of {of_file_kg_m2:.3e} kg m² about its axis nothing is left for certain with the {:.3e} kg m² that are named: no joint has \
                 that, so its torque is not all that moves it, or the file's masses are not those of this joint",
                change.value
            ),
            remedy: "if it was moved by hand or by another drive, record it as it drives itself; else check the file's masses"
                .to_owned(),
        })
    }

    /// That the gravity torque that is named is what another zero of the position makes of the file's masses.
    pub fn note_of_zero(&self, told: &JointReport, tolerance: &Tolerance) -> Option<DataFinding> {
        let mut named = told.effects.iter().filter(|found| !found.of_links);
        let found = named.find(|found| found.effect == EffectKind::GravityTorque.name())?;
        let of = |name: &str| found.parameters.get(name);
        let [sin, cos] = [of("sin_nm")?, of("cos_nm")?];
        let [of_sin, of_cos] = self.rows.gravity_nm()?;
        let with = [of_sin + sin.value, of_cos + cos.value];
        let [before_nm, with_nm] = [of_sin.hypot(of_cos), with[0].hypot(with[1])];
        // as large as the file's, by what it tells of mass and centre
        let known = tolerance
            .of("mass_kg")
            .hypot(tolerance.of("centre_of_mass_m"));
        let apart_nm = ERRORS * sin.std.hypot(cos.std) + DEVIATIONS * known * before_nm;
        let is_turned = (with_nm - before_nm).abs() < apart_nm;
        // a zero that is moved turns sine and cosine into each other
        let moved_rad = f64::atan2(
            with[1] * of_sin - with[0] * of_cos,
            with[0] * of_sin + with[1] * of_cos,
        );
        is_turned.then(|| DataFinding {
            joint: Some(told.joint.clone()),
            severity: "note".to_owned(),
            what: format!(
                "the gravity torque that is named makes what the file's masses make where its position's zero lies {moved_rad:+.3} rad \
                 elsewhere, {with_nm:.3} Nm at most: it may be the zero, and no mass"
            ),
            remedy: format!(
                "if so, in the mapping file, [joint.{}], its position: add {moved_rad:.3} to its offset",
                told.joint
            ),
        })
    }

    /// That torque and position are farther apart in time than drives and sensors make them. `searched`: what is told.
    pub fn note_of_clock(&self, name: &str, searched: &Searched) -> Option<DataFinding> {
        // an unknown unit comes before the time
        let has_unit = self.misfit.is_some_and(|misfit| misfit.of != Wrong::Load);
        let place = searched.links + self.rows.tolerated.len() + usize::from(has_unit);
        let values = searched.evidence.values_beside(searched.sets[0].names);
        let deviations = *values.get(place)?;
        let signal = self.source.signal_name();
        // to first order, which is too little where it is long
        (deviations.abs() > DEVIATIONS).then(|| DataFinding {
            joint: Some(name.to_owned()),
            severity: "warning".to_owned(),
            what: format!(
                "{signal} comes at least {:.0} ms {} the position, {:.1} standard deviations of what rows, drives and sensors are apart: \
                 friction and inertia may be off by it",
                1e3 * deviations.abs() * apart_s(self.rows.recorded_hz),
                if deviations < 0.0 { "after" } else { "before" },
                deviations.abs()
            ),
            remedy: "record both at the same instant, or filter both alike; else move one of the two columns by that time"
                .to_owned(),
        })
    }

    /// What was taken for its torque, and by the torque constants of the file and of what is told what the motor's is. A sensor behind
    /// the gear measures for itself.
    pub fn torque(&self, told: &JointReport) -> JointTorque {
        let gains = told.named().filter_map(|found| {
            let is_gain = found.effect == EffectKind::TorqueConstantError.name();
            is_gain.then(|| found.parameters.get("gain"))?
        });
        let gain = self.drive.model().torque_gain * gains.map(|gain| gain.value).product::<f64>();
        JointTorque {
            source: self.source,
            unit: self.unit_nm(),
            motor_per_recorded: if self.source == TorqueSource::Sensor {
                1.0
            } else {
                gain
            },
        }
    }

    /// What a reader should know of where the torque comes from.
    pub fn notes(&self, robot: &Robot) -> Vec<DataFinding> {
        let file = &robot.joints[self.index];
        let note = |severity: &str, what: String, remedy: &str| DataFinding {
            joint: Some(file.name.clone()),
            severity: severity.to_owned(),
            what,
            remedy: remedy.to_owned(),
        };
        let mut notes = Vec::new();
        match self.source {
            TorqueSource::Sensor => notes.push(note(
                "note",
                "its torque is that of the sensor behind the gear, which does not feel the motor, its rotor and what the gear loses \
                 before the sensor"
                    .to_owned(),
                "",
            )),
            TorqueSource::Controller => notes.push(note(
                "note",
                format!(
                    "its torque is what the robot file's controller makes of reference and position; no torque was measured{}{}",
                    if self.rows.feeds_rate {
                        ""
                    } else {
                        ", and it leaves less where the controller brakes the whole velocity, not its difference from the reference's"
                    },
                    late_reference(robot, self.index, self.rows.recorded_hz),
                ),
                "",
            )),
            TorqueSource::Drive | TorqueSource::Command => {}
        }
        let gap_nm = self.rows.seen.gap_nm();
        let square = gap_nm.iter().map(|x| x * x).sum::<f64>();
        if self.rows.fast_nm > (square / gap_nm.len().max(1) as f64).sqrt() {
            notes.push(note(
                "note",
                format!(
                    "{:.3e} Nm rms of its torque is faster than {COMPARED_HZ:.0} Hz, more than its gap is below: noise, or what repeats with the \
                     motor's turn, of which nothing is said",
                    self.rows.fast_nm
                ),
                "to see a ripple or cogging, record the joint as it turns slowly",
            ));
        }
        if self.rows.at_limit_part > 0.0 {
            notes.push(note(
                "warning",
                format!(
                    "in {:.1} % of the rows the controller asks for more than the drive's limit: those, and what the band mixes with them, \
                     do not count",
                    100.0 * self.rows.at_limit_part
                ),
                "record a motion that the drive can follow, or its torque",
            ));
        }
        if self.source == TorqueSource::Controller && file.torque_limit_nm.is_none() {
            let torque_nm = self.rows.seen.measured_nm.iter();
            let largest_nm = torque_nm.fold(0.0, |most: f64, nm| most.max(nm.abs()));
            notes.push(note(
                "warning",
                format!(
                    "its drive is taken to give whatever the controller asks for, {largest_nm:.3} Nm at the joint at most: the robot file \
                     states no limit"
                ),
                "add torque_limit_nm, of the motor, to its [[joint]]",
            ));
        }
        if let Some(command_nm) = &self.rows.command_nm {
            let rms = |of: &dyn Fn(usize) -> f64| {
                let rows = 0..self.rows.seen.count();
                rows.map(|k| of(k).powi(2)).sum::<f64>().sqrt()
            };
            let apart = rms(&|k| command_nm[k] - self.rows.seen.measured_nm[k])
                / rms(&|k| self.rows.seen.measured_nm[k]).max(f64::MIN_POSITIVE);
            if apart > COMMAND_TOLD {
                notes.push(note(
                    "warning",
                    format!(
                        "command_torque_nm is not what the drive made: they differ by {:.0} % of the measured torque below {} Hz; \
                         the joint is judged by the measured torque",
                        100.0 * apart,
                        COMPARED_HZ,
                    ),
                    "if the column is a model's torque and no command, leave it out of the mapping",
                ));
            }
        }
        notes
    }
}
