//! One case: a rig, a motion, and the effect that makes a gap of the wanted size.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use motion::Trajectory;
use plant_emulator::PlantParameters;
use robot::{Effect, Injection, Robot};
use twin::TwinError;

use crate::BlindError;
use crate::bench::{Bench, Run, Setup, rms, rms_difference};
use crate::course::{Course, Room};
use crate::families::{draw, equivalents};
use crate::label::{CaseKind, Label, TrueEffect, TrueUnlisted};
use crate::likeness::{common, dot, shapes};
use crate::pairs::{DESIGNS, Design};
use crate::plan::CasePlan;
use crate::random::Random;
use crate::rig::{Rig, RigKind, joint_limit_nm};
use crate::sizes::Sizes;
use crate::strength::{Found, search};
use crate::tolerance::Tolerance;
use crate::unlisted::Unlisted;

/// Rigs and motions that are drawn before a case is given up.
const DRAWS: usize = 80;
/// Effects that are tried on one rig before another is drawn.
const EFFECTS_TRIED: usize = 5;
/// A run without effects must stay below this part of the drive's torque.
const TORQUE_USED: f64 = 0.95;
/// Gaps over noise below this are as small as what nobody can know, whatever causes them.
const SMALL_LEVEL: f64 = 0.5;
/// Draws of an effect whose shape is free that are held against a law on no list.
const SHAPES: usize = 2;
/// Part of the most that is plausible at which is looked first how large a change an effect makes.
const PROBED: f64 = 0.5;
/// How often that is halved where the loop does not bear it.
const HALVED_MOST: usize = 6;
/// The strongest unlisted law, as part of the drive's torque.
const UNLISTED_MOST: f64 = 0.25;

/// A case before it is written.
pub(crate) struct Case {
    pub rig: Rig,
    pub run: Run,
    pub label: Label,
}

/// # Errors
/// [`BlindError::Exhausted`] if no rig and motion drawn suits the plan.
pub(crate) fn make(plan: &CasePlan) -> Result<Case, BlindError> {
    let mut random = Random::new(plan.seed, plan.stream);
    for attempt in 0..DRAWS {
        let design = (plan.kind == CaseKind::Pair)
            .then(|| DESIGNS[(plan.ordinal + attempt / 10) % DESIGNS.len()]);
        if let Some(case) = draw_case(plan, design, attempt, &mut random)? {
            return Ok(case);
        }
    }
    Err(BlindError::Exhausted {
        case: plan.number,
        draws: DRAWS,
    })
}

fn draw_case(
    plan: &CasePlan,
    design: Option<Design>,
    attempt: usize,
    random: &mut Random,
) -> Result<Option<Case>, BlindError> {
    let rig = Rig::draw(plan.rig, random)?;
    if design.is_some_and(|design| !design.suits(&rig)) {
        return Ok(None);
    }
    let course = design.map_or(Course::Rich, |design| design.course(random));
    let rooms = rooms(&rig, random);
    let Ok(trajectory) = course.trajectory(&rooms, plan.duration_s, &rig.robot, random) else {
        return Ok(None);
    };
    let seeds = [random.bits(), random.bits()];
    let Some(stand) = Stand::new(&rig, &trajectory, plan.duration_s, seeds)? else {
        return Ok(None);
    };
    let Some(truth) = truth(plan, design, attempt, &stand, random)? else {
        return Ok(None);
    };
    let Ok(run) = stand.run(&truth) else {
        return Ok(None);
    };
    let label = Label {
        case: format!("case-{:04}", plan.number),
        kind: plan.kind,
        rig: plan.rig,
        level: plan.level,
        effects: truth.effects.into_iter().map(|found| found.0).collect(),
        unlisted: truth.unlisted,
        pair: truth.pair,
        noise_nm: stand.noise_nm.clone(),
        files: BTreeMap::new(),
    };
    drop(stand);
    Ok(Some(Case { rig, run, label }))
}

/// Where each joint may move.
fn rooms(rig: &Rig, random: &mut Random) -> Vec<Room> {
    let control = rig.robot.control.as_ref();
    let joints = rig.robot.joints.iter().enumerate();
    joints
        .map(|(index, joint)| {
            let [low_rad, high_rad] = joint.position_limit_rad.unwrap_or([-1.0, 1.0]);
            let half_rad = 0.5 * (high_rad - low_rad);
            let arm = rig.robot.joints.len() > 1;
            let most_rad = if arm { 0.6 } else { 2.0 };
            let centre_rad =
                0.5 * (high_rad + low_rad) + random.between(-0.35, 0.35) * half_rad.min(1.2);
            let reach_rad = (random.between(0.35, 1.0) * (0.6 * half_rad)).min(most_rad);
            let speed_rad_s = random.between(0.35, 0.8) * joint.velocity_limit_rad_s.unwrap_or(1.0);
            // the gains are of the size of the inertia times the square of the bandwidth
            let stiff = control.map_or(1.0, |control| control.proportional_nm_rad[index]);
            let damp = control.map_or(1.0, |control| control.derivative_nm_s_rad[index]);
            let inertia_kg_m2 = (damp * damp / (4.0 * stiff)).max(1e-3);
            let force = 0.25 * joint_limit_nm(joint) / inertia_kg_m2;
            Room {
                centre_rad,
                reach_rad,
                speed_rad_s,
                acceleration_rad_s2: force.min(random.between(2.0, 12.0) * speed_rad_s),
            }
        })
        .collect()
}

/// What is put into a plant.
#[derive(Default)]
struct Truth {
    effects: Vec<(TrueEffect, Injection)>,
    unlisted: Option<TrueUnlisted>,
    pair: Vec<String>,
}

/// A rig on its trajectory with the run without effects, against which gaps are measured.
struct Stand<'a> {
    rig: &'a Rig,
    bench: Bench<'a>,
    seed: u64,
    /// The plant with the file's values, and its run.
    nominal: PlantParameters,
    nominal_seed: u64,
    exact: Run,
    /// Of each joint, once somebody asked.
    tolerances: RefCell<BTreeMap<usize, Rc<Tolerance>>>,
    /// Disturbance torque of every joint without effects.
    without_nm: Vec<Vec<f64>>,
    noise_nm: Vec<f64>,
    sizes: Vec<Sizes>,
}

impl<'a> Stand<'a> {
    /// None if rig and trajectory do not work together even without a gap.
    fn new(
        rig: &'a Rig,
        trajectory: &'a Trajectory,
        duration_s: f64,
        [seed, other_seed]: [u64; 2],
    ) -> Result<Option<Self>, BlindError> {
        let bench = Bench {
            robot: &rig.robot,
            trajectory,
            duration_s,
        };
        let run = |plant: &PlantParameters, seed| {
            bench.run(Setup {
                body: &rig.robot,
                plant,
                injections: &[],
                disturbance: None,
                seed,
            })
        };
        let nominal = PlantParameters {
            joint_torque_noise_nm: rig.plant.joint_torque_noise_nm,
            ..PlantParameters::nominal(&rig.robot)
        };
        let (Ok(without), Ok(exact)) = (run(&rig.plant, seed), run(&nominal, other_seed)) else {
            return Ok(None);
        };
        if !within_torque(&rig.robot, &without) {
            return Ok(None);
        }
        let joints: Vec<usize> = (0..rig.robot.joints.len()).collect();
        let without_nm = bench.disturbances_nm(&without)?;
        let exact_nm = bench.disturbances_nm(&exact)?;
        let noise_nm = without_nm
            .iter()
            .zip(&exact_nm)
            .map(|(without, exact)| rms_difference(without, exact))
            .collect();
        let sizes = joints
            .iter()
            .map(|joint| Sizes::of(&rig.robot, *joint, trajectory, duration_s))
            .collect();
        Ok(Some(Self {
            rig,
            bench,
            seed,
            nominal,
            nominal_seed: other_seed,
            exact,
            tolerances: RefCell::default(),
            without_nm,
            noise_nm,
            sizes,
        }))
    }

    fn run(&self, truth: &Truth) -> Result<Run, BlindError> {
        let injections: Vec<Injection> = truth.effects.iter().map(|found| found.1).collect();
        let law = truth.unlisted.as_ref().and_then(|unlisted| {
            let joint = self.rig.robot.joint_index(&unlisted.joint)?;
            Some((joint, unlisted.law.at(joint, unlisted.nm)))
        });
        self.bench.run(Setup {
            body: &self.rig.robot,
            plant: &self.rig.plant,
            injections: &injections,
            disturbance: law,
            seed: self.seed,
        })
    }

    /// What this truth changes of every joint's disturbance torque; none if the loop stops for safety.
    fn changes_nm(&self, truth: &Truth) -> Result<Option<Vec<Vec<f64>>>, BlindError> {
        let run = match self.run(truth) {
            Err(
                BlindError::Twin(TwinError::SafeStop { .. } | TwinError::Diverged { .. })
                | BlindError::Plant(_),
            ) => return Ok(None),
            run => run?,
        };
        let with_nm = self.bench.disturbances_nm(&run)?;
        let joints = with_nm.iter().zip(&self.without_nm);
        let changes = joints.map(|(with, without)| {
            let each = with.iter().zip(without);
            each.map(|(with, without)| with - without).collect()
        });
        Ok(Some(changes.collect()))
    }

    /// The largest gap over noise that this truth makes at one of the joints; none if the loop stops for safety.
    fn gap_to_noise(&self, truth: &Truth, joints: &[usize]) -> Result<Option<f64>, BlindError> {
        let changes_nm = self.changes_nm(truth)?;
        Ok(changes_nm.map(|changes_nm| {
            let ratios = joints.iter().map(|&joint| self.ratio(&changes_nm, joint));
            ratios.fold(0.0, f64::max)
        }))
    }

    fn ratio(&self, changes_nm: &[Vec<f64>], joint: usize) -> f64 {
        rms(&changes_nm[joint]) / self.noise_nm[joint]
    }

    /// Whether this truth is a gap: at the joint that shows it most the known values do not explain it within their tolerance.
    fn is_gap(&self, truth: &Truth, joints: &[usize]) -> Result<bool, BlindError> {
        let Some(changes_nm) = self.changes_nm(truth)? else {
            return Ok(false);
        };
        let ratio = |joint: &usize| self.ratio(&changes_nm, *joint);
        let most = joints.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b)));
        let Some(&joint) = most else {
            return Ok(false);
        };
        Ok(!self.tolerance(joint)?.explains(&changes_nm[joint]))
    }

    fn tolerance(&self, joint: usize) -> Result<Rc<Tolerance>, BlindError> {
        if let Some(known) = self.tolerances.borrow().get(&joint) {
            return Ok(Rc::clone(known));
        }
        let nominal = (&self.nominal, self.nominal_seed);
        let found = Rc::new(Tolerance::of(&self.bench, nominal, &self.exact, joint)?);
        self.tolerances
            .borrow_mut()
            .insert(joint, Rc::clone(&found));
        Ok(found)
    }

    /// Searches the strength whose gap has the wanted size.
    fn scale(
        &self,
        wanted: f64,
        most: f64,
        joints: &[usize],
        truth: impl Fn(f64) -> Truth,
    ) -> Result<Option<Found>, BlindError> {
        let mut failure = None;
        let found = search(wanted, most, |strength| {
            self.gap_to_noise(&truth(strength), joints)
                .unwrap_or_else(|error| {
                    failure = Some(error);
                    None
                })
        });
        failure.map_or(Ok(found), Err)
    }

    /// This effect, as strong as wanted; none if that is not plausible here.
    fn effect(
        &self,
        name: &str,
        joint: usize,
        kind: RigKind,
        level: f64,
        random: &mut Random,
    ) -> Result<Option<(TrueEffect, Injection)>, BlindError> {
        let Some(family) = draw(name, kind, &self.sizes[joint], random) else {
            return Ok(None);
        };
        let sample = (family.make)(family.most);
        let on_bus = sample.may_be_shared() && kind == RigKind::SevenJoints && random.chance(0.5);
        let shared = sample.is_whole_arm() || on_bus;
        let on = (!shared).then_some(joint);
        let joints: Vec<usize> = match on {
            Some(joint) => vec![joint],
            None => (0..self.sizes.len()).collect(),
        };
        let entry = |effect: Effect, gap_to_noise: f64| {
            let true_effect = TrueEffect {
                gap_to_noise,
                ..self.entry(on, effect, kind)
            };
            let injection = Injection {
                joint: on,
                effect,
                start_s: 0.0,
            };
            (true_effect, injection)
        };
        let found = self.scale(level, family.most, &joints, |strength| Truth {
            effects: vec![entry((family.make)(strength), 0.0)],
            ..Truth::default()
        })?;
        let Some(found) = found.filter(|found| found.strength >= family.least) else {
            return Ok(None);
        };
        let effect = entry((family.make)(found.strength), found.gap_to_noise);
        let truth = Truth {
            effects: vec![effect.clone()],
            ..Truth::default()
        };
        let is_gap = level < SMALL_LEVEL || self.is_gap(&truth, &joints)?;
        Ok(is_gap.then_some(effect))
    }

    fn unlisted(
        &self,
        plan: &CasePlan,
        law: usize,
        random: &mut Random,
    ) -> Result<Option<TrueUnlisted>, BlindError> {
        let joint = random.index(self.sizes.len());
        let sizes = &self.sizes[joint];
        let joints = self.sizes.len();
        let law = Unlisted::draw(
            plan.seed,
            law,
            joint,
            joints,
            sizes,
            plan.duration_s,
            random,
        );
        let level = plan.level;
        let entry = |nm: f64, gap_to_noise: f64| TrueUnlisted {
            joint: self.rig.robot.joints[joint].name.clone(),
            law: law.clone(),
            nm,
            gap_to_noise,
            in_common: BTreeMap::new(),
        };
        let most_nm = UNLISTED_MOST * sizes.limit_nm;
        let found = self.scale(level, most_nm, &[joint], |nm| Truth {
            unlisted: Some(entry(nm, 0.0)),
            ..Truth::default()
        })?;
        let Some(found) = found else {
            return Ok(None);
        };
        let unlisted = entry(found.strength, found.gap_to_noise);
        let truth = Truth {
            unlisted: Some(unlisted.clone()),
            ..Truth::default()
        };
        let is_gap = level < SMALL_LEVEL || self.is_gap(&truth, &[joint])?;
        if !is_gap {
            return Ok(None);
        }
        let in_common = self.in_common(&truth, joint, plan.rig, random)?;
        Ok(Some(TrueUnlisted {
            in_common,
            ..unlisted
        }))
    }

    /// What each effect of the list has in common with a truth at a joint: the part of the change's square that the plant with that effect
    /// in it makes too, at the strength that fits best, with the known values as they are or moving along within their tolerance, of which
    /// the larger counts: how much of a law the file's own values are blamed for is not a name's fault. Of an effect whose shape is free
    /// the most that some draws of it have, and its [`shapes`] beside them.
    fn in_common(
        &self,
        truth: &Truth,
        joint: usize,
        kind: RigKind,
        random: &mut Random,
    ) -> Result<BTreeMap<String, f64>, BlindError> {
        let Some(changes_nm) = self.changes_nm(truth)? else {
            return Ok(BTreeMap::new());
        };
        let change_nm = &changes_nm[joint];
        let law = truth.unlisted.as_ref().map(|unlisted| &unlisted.law);
        let waves = law.and_then(|law| law.waves_per_motor_rev(self.sizes[joint].gear_ratio));
        let known = self.tolerance(joint)?;
        let within = known.within(change_nm);
        let in_common = |alike_nm: &[Vec<f64>]| {
            let moving = within
                .as_ref()
                .map(|within| common(change_nm, alike_nm, |a, b| within.product(a, b)));
            common(change_nm, alike_nm, dot).max(moving.unwrap_or(0.0))
        };
        let mut all = BTreeMap::new();
        for name in Effect::names() {
            let mut most: f64 = 0.0;
            for _ in 0..SHAPES {
                let size_nm = rms(change_nm);
                for alike_nm in self.drawn_nm(name, joint, kind, size_nm, waves, random)? {
                    most = most.max(in_common(&alike_nm));
                }
            }
            if most > 0.0 {
                all.insert((*name).to_owned(), most);
            }
        }
        Ok(all)
    }

    /// Whether the other names of a pair together make all of what its truth makes but for what nobody can know.
    fn is_alike(
        &self,
        truth: &Truth,
        joint: usize,
        kind: RigKind,
        random: &mut Random,
    ) -> Result<bool, BlindError> {
        let Some(changes_nm) = self.changes_nm(truth)? else {
            return Ok(false);
        };
        let size_nm = rms(&changes_nm[joint]);
        let mut others_nm = Vec::new();
        for name in truth.pair.iter().skip(1) {
            let shaped = self.drawn_nm(name, joint, kind, size_nm, None, random)?;
            others_nm.extend(shaped.into_iter().flatten());
        }
        let left = (1.0 - common(&changes_nm[joint], &others_nm, dot)).max(0.0);
        Ok(left.sqrt() * self.ratio(&changes_nm, joint) < SMALL_LEVEL)
    }

    /// What one draw of an effect changes of a joint's disturbance torque, at each of its [`shapes`] and as strong as makes it about so
    /// large: what a strong effect does to the motion is not the shape of a weak one.
    fn drawn_nm(
        &self,
        name: &str,
        joint: usize,
        kind: RigKind,
        size_nm: f64,
        waves: Option<f64>,
        random: &mut Random,
    ) -> Result<Vec<Vec<Vec<f64>>>, BlindError> {
        let sizes = self.sizes[joint].clone().if_it_were_loaded();
        let Some(family) = draw(name, kind, &sizes, random) else {
            return Ok(Vec::new());
        };
        let at = |part: f64| shapes((family.make)(part * family.most), waves);
        let made = |together: Vec<Effect>| {
            let each = together.into_iter();
            each.map(|effect| self.made_by(effect, joint, kind))
                .collect::<Result<Option<Vec<_>>, _>>()
        };
        let mut all = Vec::new();
        for place in 0..at(PROBED).len() {
            // where the loop stops for safety less of it may be borne
            let mut part = PROBED;
            let mut found = made(at(part).swap_remove(place))?;
            for _ in 0..HALVED_MOST {
                if found.is_some() {
                    break;
                }
                part *= 0.5;
                found = made(at(part).swap_remove(place))?;
            }
            let Some(found) = found else {
                continue;
            };
            let largest_nm = found.iter().map(|nm| rms(nm)).fold(0.0, f64::max);
            let wanted = (part * size_nm / largest_nm.max(f64::MIN_POSITIVE)).min(1.0);
            let again = made(at(wanted).swap_remove(place))?;
            all.push(again.unwrap_or(found));
        }
        Ok(all)
    }

    /// What an effect changes of a joint's disturbance torque; none if the loop stops for safety.
    fn made_by(
        &self,
        effect: Effect,
        joint: usize,
        kind: RigKind,
    ) -> Result<Option<Vec<f64>>, BlindError> {
        let on = (!effect.is_whole_arm()).then_some(joint);
        let injection = Injection {
            joint: on,
            effect,
            start_s: 0.0,
        };
        let truth = Truth {
            effects: vec![(self.entry(on, effect, kind), injection)],
            ..Truth::default()
        };
        let changes_nm = self.changes_nm(&truth)?;
        Ok(changes_nm.map(|mut changes_nm| changes_nm.swap_remove(joint)))
    }

    /// An effect as a label tells it, its gap not known yet.
    fn entry(&self, on: Option<usize>, effect: Effect, kind: RigKind) -> TrueEffect {
        TrueEffect {
            joint: on.map(|joint| self.rig.robot.joints[joint].name.clone()),
            effect,
            stage: effect.kind().stage(),
            gap_to_noise: 0.0,
            equivalents: equivalents(&effect, kind)
                .iter()
                .map(|name| (*name).to_owned())
                .collect(),
        }
    }
}

fn within_torque(robot: &Robot, run: &Run) -> bool {
    run.rows().all(|row| {
        row.iter().zip(&robot.joints).all(|(cell, joint)| {
            let limit_nm = joint.torque_limit_nm.unwrap_or(f64::INFINITY);
            cell.command_torque_nm.unwrap_or(0.0).abs() < TORQUE_USED * limit_nm
        })
    })
}

/// What the plan asks for on this stand; none if it cannot be had here.
fn truth(
    plan: &CasePlan,
    design: Option<Design>,
    attempt: usize,
    stand: &Stand<'_>,
    random: &mut Random,
) -> Result<Option<Truth>, BlindError> {
    match (plan.kind, design) {
        (CaseKind::NoGap, _) => Ok(Some(Truth::default())),
        (CaseKind::Unknown, _) => {
            let law = plan.ordinal + attempt / 4;
            let unlisted = stand.unlisted(plan, law, random)?;
            Ok(unlisted.map(|unlisted| Truth {
                unlisted: Some(unlisted),
                ..Truth::default()
            }))
        }
        (CaseKind::Pair, Some(design)) => {
            let name = design.truth(random);
            let joint = random.index(stand.sizes.len());
            let Some(effect) = stand.effect(name, joint, plan.rig, plan.level, random)? else {
                return Ok(None);
            };
            let truth = Truth {
                effects: vec![effect],
                unlisted: None,
                pair: design.alternatives(name),
            };
            let is_alike = stand.is_alike(&truth, joint, plan.rig, random)?;
            Ok(is_alike.then_some(truth))
        }
        _ => listed(plan, attempt, stand, random),
    }
}

/// One or two effects of the list, those first that the plan names first.
fn listed(
    plan: &CasePlan,
    attempt: usize,
    stand: &Stand<'_>,
    random: &mut Random,
) -> Result<Option<Truth>, BlindError> {
    let wanted = if plan.kind == CaseKind::TwoEffects {
        2
    } else {
        1
    };
    let mut effects: Vec<(TrueEffect, Injection)> = Vec::new();
    let first = attempt / 2 * EFFECTS_TRIED % plan.effects.len();
    let names = plan.effects.iter().cycle().skip(first);
    let mut joint = random.index(stand.sizes.len());
    for name in names.take(wanted * EFFECTS_TRIED) {
        let is_double = |(known, _): &(TrueEffect, Injection)| {
            known.effect.name() == *name || known.equivalents.iter().any(|other| other == name)
        };
        if effects.iter().any(is_double) {
            continue;
        }
        if let Some(effect) = stand.effect(name, joint, plan.rig, plan.level, random)? {
            effects.push(effect);
            if effects.len() == wanted {
                return Ok(Some(Truth {
                    effects,
                    ..Truth::default()
                }));
            }
            if random.chance(0.4) {
                joint = random.index(stand.sizes.len());
            }
        }
    }
    Ok(None)
}
