//! One joint's twin along all its recordings: what the channels would show if the joint were as told.

use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};

use joint_model::filter::FilterError;
use joint_model::friction::Sliding;
use nalgebra::{Unit, Vector3};
use rand_core::{RngCore, SeedableRng};
use rand_pcg::Pcg64Mcg;
use robot::{Effect, Robot};

use crate::control;
use crate::joint::JointModel;
use crate::known::{self, KnownValue};
use crate::load::{Load, LoadChange, Motion};
use crate::observe::{Band, Channel, Room, channels};
use crate::remembered::Remembered;
use crate::repeats::Place;
use crate::rounding::Rounding;
use crate::search::SLOWEST_LOOP_HZ;
use crate::simulate::{Between, Feedback, Noise, Substeps, Trace, simulate};
use crate::smooth::derivative;
use crate::stretch::{JointStretch, Stretch};
use crate::vibration::{Swing, Vibration};
use crate::whole_arm::WholeArm;

/// The beginning of a stretch does not count: nobody knows how far friction and gear were wound up.
const START_S: f64 = 0.5;
/// The end does not: the low-pass has nothing behind it.
const END_S: f64 = 0.1;
/// Half the time over which the low-pass spreads what happens in an instant.
const AROUND_S: f64 = 0.06;

/// Of a bend from sample to sample, what a torque may have been off in between: a corner halfway between two is off by half.
const BEND: f64 = 0.25;

/// Runs that are remembered. With so many, between a twelfth and a quarter of a search's runs are found again, and hardly more with
/// any number.
const RUNS: usize = 256;
/// Loads that are remembered, of two megabytes each: runs that follow one another mostly share theirs.
const LOADS: usize = 2;

/// One sample of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Index of the stretch.
    pub stretch: usize,
    /// What is compared.
    pub channel: Channel,
    /// Since the recording began.
    pub time_s: f64,
    /// Joint side.
    pub position_rad: f64,
    /// Joint side.
    pub velocity_rad_s: f64,
    /// Joint side.
    pub acceleration_rad_s2: f64,
    /// Torque of the rigid bodies.
    pub load_nm: f64,
    /// Motor side.
    pub motor_angle_rad: f64,
    /// Largest torque that accelerates rotor and link, and of the other joints' motion, within what the low-pass sees.
    pub inertial_nm: f64,
    /// Largest torque that nobody can know of how the other joints' links swing where no encoder shows it.
    pub unseen_nm: f64,
    /// Torque that swings the rotor above the band, beyond what is usual of the recording or beyond its friction, whichever is more.
    pub vibrating_nm: f64,
    /// Dry friction, without load and by the robot file, that such a swing takes off a slower motion.
    pub shaken_nm: f64,
    /// How far dry friction falls, without load and by the robot file, because the joint gets faster within what the low-pass sees.
    pub falling_nm: f64,
    /// Largest torque that the drive may have made between two samples beside what a line from one to the other tells, where they come
    /// more slowly than any loop.
    pub aliased_nm: f64,
    /// What rounding of the encoders adds where it beats with the samples: no noise that differs from sample to sample.
    pub beating_nm: f64,
}

/// How a joint is said to differ from its robot file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changes {
    /// Of what is known, in standard deviations.
    pub known: Vec<f64>,
    /// Added.
    pub effects: Vec<Effect>,
}

impl Changes {
    /// The same without the known values behind the last one that was moved.
    fn without_rest(mut self) -> Self {
        let moved = self.known.iter().rposition(|known| *known != 0.0);
        self.known.truncate(moved.map_or(0, |last| last + 1));
        self
    }
}

/// One joint along its recordings.
pub struct JointTwin<'a> {
    /// As the robot file has it.
    pub nominal: JointModel,
    /// What may be refitted.
    pub known: Vec<KnownValue>,
    /// What is compared.
    pub channels: Vec<Channel>,
    /// What each compared number belongs to.
    pub rows: Vec<Row>,
    robot: &'a Robot,
    joint: usize,
    pieces: Vec<Piece<'a>>,
    runs: Remembered<Asked, Vec<f64>>,
    /// Of runs that are over.
    benches: Mutex<Vec<Bench>>,
}

/// What a run depends on.
#[derive(Clone, Debug, PartialEq)]
struct Asked {
    changes: Changes,
    substeps: Substeps,
    /// Of the sensors' noise, if there is any.
    seed: Option<u64>,
}

/// Where a run is made: of some megabytes, which are not asked for anew for each.
#[derive(Debug, Default)]
struct Bench {
    trace: Trace,
    room: Room,
}

struct Piece<'a> {
    stretch: &'a Stretch,
    joint: &'a JointStretch,
    /// Keeps the simulation on the recorded motion.
    tracking: Feedback,
    /// The robot file's controller, or the same.
    controller: Feedback,
    band: Band,
    links: Vec<Option<LoadChange>>,
    /// How the load changes with inertia added to the link about the joint's axis, per kg m².
    link_inertia: LoadChange,
    /// How the load changes with payload and tilt.
    whole_arm: WholeArm,
    /// Loads that changes made of the recorded motion's.
    loads: Remembered<Changes, Arc<Load>>,
    /// Of the motor above the band, beyond what is usual.
    vibration: Vibration,
    /// Of the thinned samples, those that count.
    kept: Vec<usize>,
}

impl<'a> JointTwin<'a> {
    /// For a joint of a robot; none where no recording tells its torque.
    ///
    /// # Errors
    /// [`FilterError`] if the controller's filter cannot be designed at a recording's rate.
    pub fn new(
        robot: &'a Robot,
        joint: usize,
        stretches: &'a [Stretch],
    ) -> Result<Option<Self>, FilterError> {
        let nominal = JointModel::nominal(robot, joint);
        let there: Vec<_> = stretches
            .iter()
            .filter_map(|stretch| Some((stretch, stretch.joints[joint].as_ref()?)))
            .collect();
        let Some((_, first)) = there.first() else {
            return Ok(None);
        };
        // what one recording lacks cannot be compared in all
        let channels: Vec<Channel> = channels(first)
            .into_iter()
            .filter(|channel| {
                there
                    .iter()
                    .all(|(_, s)| self::channels(s).contains(channel))
            })
            .collect();
        let motions: Vec<_> = there.iter().map(|(stretch, _)| &stretch.motion).collect();
        let has_both = channels.contains(&Channel::Torsion);
        let periods_s = there.iter().map(|(_, signals)| signals.drive.period_s);
        let both_every_s = has_both.then(|| periods_s.fold(0.0, f64::max));
        let mut known = known::of_joint(&nominal, &robot.tolerance, both_every_s);
        let links = known::of_links(robot, joint, &motions);
        let beside = known.len();
        known.extend(links.iter().map(|(known, _)| known.clone()));
        let mut pieces = Vec::with_capacity(there.len());
        for (index, &(stretch, signals)) in there.iter().enumerate() {
            let mut of_piece: Vec<Option<LoadChange>> = vec![None; beside];
            of_piece.extend(
                links
                    .iter()
                    .map(|(_, changes)| Some(changes[index].clone())),
            );
            pieces.push(Piece::new(robot, joint, stretch, signals, of_piece)?);
        }
        let rows = rows(&pieces, &channels, &nominal);
        Ok(Some(Self {
            nominal,
            known,
            channels,
            rows,
            robot,
            joint,
            pieces,
            runs: Remembered::at_most(RUNS),
            benches: Mutex::default(),
        }))
    }

    /// The recordings' signals.
    pub fn stretches(&self) -> Vec<&JointStretch> {
        self.pieces.iter().map(|piece| piece.joint).collect()
    }

    /// Where the recordings' pieces lie that they are of.
    pub(crate) fn places(&self) -> Vec<Place> {
        let place = |piece: &Piece<'_>| Place {
            recording: piece.stretch.recording,
            first_row: piece.stretch.first_row,
        };
        self.pieces.iter().map(place).collect()
    }

    /// What can be taken off the link's inertia about the joint's axis.
    pub fn spare_link_inertia_kg_m2(&self) -> f64 {
        known::spare_link_inertia_kg_m2(self.robot, self.joint)
    }

    /// The joint's axis, in its frame.
    pub fn axis(&self) -> Unit<Vector3<f64>> {
        self.robot.chain.links()[self.joint].axis
    }

    /// How many joints the robot has.
    pub fn joints(&self) -> usize {
        self.robot.joints.len()
    }

    /// Noise of the torque sensors within the band, from how they differ from sample to sample.
    pub fn torque_sensor_noise_nm(&self) -> f64 {
        let mut steps_nm: Vec<f64> = self
            .pieces
            .iter()
            .filter_map(|piece| piece.joint.joint_torque_nm.as_ref())
            .flat_map(|torque_nm| torque_nm.windows(4))
            .map(|x| (x[3] - 3.0 * x[2] + 3.0 * x[1] - x[0]).abs())
            .collect();
        if steps_nm.is_empty() {
            return 0.0;
        }
        let middle = steps_nm.len() / 2;
        let (_, median_nm, _) = steps_nm.select_nth_unstable_by(middle, f64::total_cmp);
        // third differences of independent samples have 20 times their variance; the median is at 0.6745 deviations
        let deviation_nm = *median_nm / 0.6745 / 20.0_f64.sqrt();
        let band = self.pieces[0].band;
        deviation_nm * (2.0 * band.cutoff_hz / band.rate_hz).sqrt()
    }

    /// Velocity, its direction, and acceleration of each other joint, row by row.
    pub fn others(&self) -> Vec<Vec<f64>> {
        let of: [fn(&Motion, usize, usize) -> f64; 3] = [
            |motion, other, k| motion.velocity_rad_s(other)[k],
            |motion, other, k| motion.velocity_rad_s(other)[k].signum(),
            |motion, other, k| motion.acceleration_rad_s2(other)[k],
        ];
        let each = |other: usize| of.map(|of| self.of_another(other, of));
        self.other_joints().flat_map(each).collect()
    }

    /// Velocity of each other joint, row by row.
    pub fn others_velocity_rad_s(&self) -> Vec<Vec<f64>> {
        let each = |other: usize| self.of_another(other, |m, other, k| m.velocity_rad_s(other)[k]);
        self.other_joints().map(each).collect()
    }

    fn other_joints(&self) -> impl Iterator<Item = usize> {
        let own = self.joint;
        (0..self.robot.joints.len()).filter(move |other| *other != own)
    }

    /// Something of another joint's motion, row by row.
    fn of_another(&self, other: usize, of: impl Fn(&Motion, usize, usize) -> f64) -> Vec<f64> {
        let pieces = self.pieces.iter();
        pieces
            .flat_map(|piece| {
                let at = |row: &usize| of(&piece.stretch.motion, other, row * piece.band.stride());
                let once: Vec<f64> = piece.kept.iter().map(at).collect();
                once.repeat(self.channels.len())
            })
            .collect()
    }

    /// How the rotor swings above what is compared, where that outpaces the joint's motion.
    pub(crate) fn swing(&self) -> Option<Swing> {
        let samples = self.pieces.iter().flat_map(|piece| {
            let kept = piece.kept.iter().map(|row| row * piece.band.stride());
            kept.map(|k| (&piece.vibration, k, piece.joint.load.velocity_rad_s[k]))
        });
        Swing::of(samples, self.nominal.presliding_rad)
    }

    /// Above this nothing is compared.
    pub fn cutoff_hz(&self) -> f64 {
        self.pieces[0].band.cutoff_hz
    }

    /// Recorded rows a second.
    pub fn recorded_hz(&self) -> f64 {
        self.pieces[0].band.rate_hz
    }

    /// Compared numbers a second in one channel.
    pub fn rows_hz(&self) -> f64 {
        let band = self.pieces[0].band;
        band.rate_hz / band.stride() as f64
    }

    /// The channels as measured, row by row.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn measured(&self) -> Result<Vec<f64>, FilterError> {
        let mut all = Vec::with_capacity(self.rows.len());
        for piece in &self.pieces {
            let columns = piece
                .band
                .measured(&self.nominal, piece.joint, &self.channels)?;
            all.extend(piece.pick(&columns));
        }
        Ok(all)
    }

    /// The channels as they would be with these changes, row by row; with noise if a seed is given.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn simulated(&self, changes: &Changes, seed: Option<u64>) -> Result<Vec<f64>, FilterError> {
        self.along(changes, Substeps::Fine, seed)
    }

    /// The same without noise and in longer substeps, for differences between simulations.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn coarsely(&self, changes: &Changes) -> Result<Vec<f64>, FilterError> {
        self.along(changes, Substeps::Coarse, None)
    }

    fn along(
        &self,
        changes: &Changes,
        substeps: Substeps,
        seed: Option<u64>,
    ) -> Result<Vec<f64>, FilterError> {
        let asked = Asked {
            changes: changes.clone().without_rest(),
            substeps,
            seed,
        };
        self.runs.or(asked, |asked| self.made(asked))
    }

    fn made(&self, asked: &Asked) -> Result<Vec<f64>, FilterError> {
        // a bench is emptied before it is used, whatever a thread that panicked has left
        let benches = || self.benches.lock().unwrap_or_else(PoisonError::into_inner);
        let free = benches().pop();
        let mut bench = free.unwrap_or_default();
        let Bench { trace, room } = &mut bench;
        let mut all = Vec::with_capacity(self.rows.len());
        for (place, piece) in self.pieces.iter().enumerate() {
            self.run(place, asked, &piece.tracking, trace);
            let (of_joint, channels) = (piece.joint, &self.channels);
            let columns = piece
                .band
                .simulated(&self.nominal, of_joint, trace, channels, room)?;
            all.extend(piece.pick(&columns));
        }
        benches().push(bench);
        Ok(all)
    }

    /// Everything the sensors would show in one stretch under the robot file's controller.
    pub fn controlled(&self, piece: usize, changes: &Changes) -> Trace {
        let asked = Asked {
            changes: changes.clone(),
            substeps: Substeps::Fine,
            seed: None,
        };
        let mut trace = Trace::default();
        self.run(piece, &asked, &self.pieces[piece].controller, &mut trace);
        trace
    }

    fn run(&self, piece: usize, asked: &Asked, feedback: &Feedback, trace: &mut Trace) {
        let Asked {
            changes,
            substeps,
            seed,
        } = asked;
        let place = piece as u64;
        let piece = &self.pieces[piece];
        let mut model = self.nominal.clone();
        for (known, deviations) in self.known.iter().zip(&changes.known) {
            if *deviations != 0.0 {
                known.apply(&mut model, *deviations);
            }
        }
        for effect in &changes.effects {
            model = model.with(effect);
        }
        let load = self.load(piece, changes);
        let mut sensors = seed.map(|seed| Sensors::new(seed, place));
        let noise = sensors.as_mut().map(|noise| noise as &mut dyn Noise);
        let drive = &piece.joint.drive;
        simulate(&model, feedback, drive, &load, *substeps, noise, trace);
        // what holds the joint is told as the drive would report it: a drive that gives less reports more
        for holding_nm in &mut trace.holding_nm {
            *holding_nm /= model.torque_gain;
        }
        if let Some(mut sensors) = sensors.filter(|_| !piece.joint.has_command) {
            // the reported torque drives the simulation, its noise and all: what holds the joint takes that off again
            for holding_nm in &mut trace.holding_nm {
                *holding_nm += model.gear_ratio * model.torque_noise_nm * sensors.normal();
            }
        }
    }

    /// What the joint carries with these changes.
    fn load(&self, piece: &Piece<'a>, changes: &Changes) -> Arc<Load> {
        let is_of_load = |effect: &&Effect| {
            effect.is_whole_arm() || matches!(effect, Effect::LinkInertia { .. })
        };
        let known = changes.known.iter().zip(&piece.links);
        let of_load = Changes {
            known: known
                .map(|(deviations, link)| link.as_ref().map_or(0.0, |_| *deviations))
                .collect(),
            effects: changes.effects.iter().filter(is_of_load).cloned().collect(),
        };
        let made = piece.loads.or(of_load.without_rest(), |changes| {
            Ok::<_, Infallible>(Arc::new(self.changed_load(piece, changes)))
        });
        match made {
            Ok(load) => load,
        }
    }

    fn changed_load(&self, piece: &Piece<'a>, changes: &Changes) -> Load {
        let mut load = piece.joint.load.clone();
        let motion = &piece.stretch.motion;
        let whole_arm = &piece.whole_arm;
        if let Some(change) = whole_arm.change(&self.robot.chain, motion, &changes.effects) {
            load.add(&change, 1.0);
        }
        for effect in &changes.effects {
            if let Effect::LinkInertia { inertia_kg_m2 } = *effect {
                load.add(&piece.link_inertia, inertia_kg_m2);
            }
        }
        for (change, deviations) in piece.links.iter().zip(&changes.known) {
            if let Some(change) = change.as_ref().filter(|_| *deviations != 0.0) {
                load.add(change, *deviations);
            }
        }
        load
    }
}

impl<'a> Piece<'a> {
    fn new(
        robot: &Robot,
        joint: usize,
        stretch: &'a Stretch,
        signals: &'a JointStretch,
        links: Vec<Option<LoadChange>>,
    ) -> Result<Self, FilterError> {
        let mut tracking = control::tracking(robot, joint, stretch.rate_hz);
        if !signals.has_command {
            // what the drive reports acts already
            tracking.delay_samples = 0.0;
        }
        let told = control::told(robot, joint, stretch.rate_hz)?;
        let mut controller = told.unwrap_or_else(|| tracking.clone());
        controller.delay_samples = tracking.delay_samples;
        let band = Band::at(stretch.rate_hz);
        let stride = band.stride();
        let samples = signals.samples();
        let first = (START_S * stretch.rate_hz) as usize;
        let end = samples.saturating_sub((END_S * stretch.rate_hz) as usize);
        let kept = (0..samples.div_ceil(stride))
            .filter(|row| {
                let sample = row * stride;
                let around = sample.saturating_sub(stride)..(sample + stride).min(samples);
                (first..end).contains(&sample) && signals.is_whole[around].iter().all(|w| *w)
            })
            .collect();
        let file = &robot.joints[joint];
        let step_rad = file.motor_encoder_resolution_rad.unwrap_or(0.0);
        // a rounded value is anywhere within its step
        let noise_rad = file.position_noise_rad.hypot(step_rad / 12.0_f64.sqrt());
        let vibration = Vibration::of(
            &signals.drive.motor_rad,
            noise_rad / file.gear_ratio,
            band.cutoff_hz,
            stretch.rate_hz,
        )?;
        let link_inertia = known::link_inertia(robot, joint, &stretch.motion, &signals.load);
        Ok(Self {
            stretch,
            joint: signals,
            link_inertia,
            whole_arm: WholeArm::of(joint),
            loads: Remembered::at_most(LOADS),
            tracking,
            controller,
            band,
            links,
            vibration,
            kept,
        })
    }

    /// Of every channel the rows that count, one channel after the other.
    fn pick(&self, columns: &[Vec<f64>]) -> impl Iterator<Item = f64> {
        columns
            .iter()
            .flat_map(|column| self.kept.iter().map(|row| column[*row]))
    }
}

fn largest_around(values: &[f64], k: usize, around: usize) -> f64 {
    values[k.saturating_sub(around)..(k + around + 1).min(values.len())]
        .iter()
        .map(|value| value.abs())
        .fold(0.0, f64::max)
}

/// Torque that swings the rotor: what is unusual of it, or more than dry friction where the robot file tells any.
fn vibrating_nm(vibration: &Vibration, nominal: &JointModel, dry_nm: f64, k: usize) -> f64 {
    let inertia_kg_m2 = nominal.rotor_inertia_kg_m2;
    let unusual_nm = inertia_kg_m2 * vibration.unusual_rad_s2[k];
    if dry_nm > 0.0 {
        unusual_nm.max(inertia_kg_m2 * vibration.acceleration_rad_s2[k] - dry_nm)
    } else {
        unusual_nm
    }
}

/// How much less a friction is at the fastest velocity near a sample than at the slowest.
fn fall_around(velocity_rad_s: &[f64], level_nm: &[f64], k: usize, around: usize) -> f64 {
    let near = k.saturating_sub(around)..(k + around + 1).min(velocity_rad_s.len());
    let speed = |k: &usize| velocity_rad_s[*k].abs();
    let slowest = near.clone().min_by(|a, b| speed(a).total_cmp(&speed(b)));
    let fastest = near.max_by(|a, b| speed(a).total_cmp(&speed(b)));
    match (slowest, fastest) {
        (Some(slowest), Some(fastest)) => (level_nm[slowest] - level_nm[fastest]).max(0.0),
        _ => 0.0,
    }
}

/// How far the drive's torque may be off the lines between its samples, sample by sample: nothing where each lasts until the next, or
/// where they come so fast that what bends a line is noise, of which not every robot file speaks.
fn aliased_nm(joint: &JointStretch, nominal: &JointModel) -> Vec<f64> {
    let is_slow = 1.0 / joint.drive.period_s < SLOWEST_LOOP_HZ;
    if joint.drive.between == Between::Line && is_slow {
        let noise_nm = nominal.gear_ratio * nominal.torque_noise_nm;
        off_lines_nm(&joint.torque_nm, noise_nm)
    } else {
        vec![0.0; joint.samples()]
    }
}

/// The same of torques with so much noise, which bends a line by six times its variance.
fn off_lines_nm(torque_nm: &[f64], noise_nm: f64) -> Vec<f64> {
    let last = torque_nm.len().saturating_sub(1);
    (0..torque_nm.len())
        .map(|k| {
            let [before, after] = [k.saturating_sub(1), (k + 1).min(last)].map(|k| torque_nm[k]);
            let bend_nm = before - 2.0 * torque_nm[k] + after;
            BEND * (bend_nm.powi(2) - 6.0 * noise_nm.powi(2)).max(0.0).sqrt()
        })
        .collect()
}

fn rows(pieces: &[Piece<'_>], channels: &[Channel], nominal: &JointModel) -> Vec<Row> {
    let mut rows = Vec::new();
    for (stretch, piece) in pieces.iter().enumerate() {
        let drive = &piece.joint.drive;
        let load = &piece.joint.load;
        let acceleration_rad_s2 = derivative(&load.velocity_rad_s, drive.period_s);
        let around = (AROUND_S / drive.period_s) as usize;
        let moving_nm: Vec<f64> = acceleration_rad_s2
            .iter()
            .zip(&load.inertia_kg_m2)
            .zip(&load.coupling_nm)
            .map(|((acceleration_rad_s2, inertia_kg_m2), coupling_nm)| {
                let inertia_kg_m2 = nominal.rotor_inertia_kg_m2 + inertia_kg_m2;
                inertia_kg_m2 * acceleration_rad_s2.abs() + coupling_nm.abs()
            })
            .collect();
        let aliased_nm = aliased_nm(piece.joint, nominal);
        let unloaded_nm: Vec<f64> = load
            .velocity_rad_s
            .iter()
            .map(|velocity_rad_s| nominal.friction.level_nm(&Sliding::at(*velocity_rad_s)))
            .collect();
        let beating = |channel: Channel, k: usize| {
            let velocity_rad_s = load.velocity_rad_s[k];
            let of = |step_rad: f64, noise_rad: f64| {
                let rounding = Rounding {
                    step_rad,
                    noise_rad,
                    steps_hz: velocity_rad_s.abs() / step_rad,
                };
                rounding.beating_rad(1.0 / drive.period_s, piece.band.cutoff_hz)
            };
            let ratio = nominal.gear_ratio;
            let noise_rad = nominal.position_noise_rad;
            let motor_rad = of(nominal.motor_resolution_rad / ratio, noise_rad / ratio);
            let link_rad = of(nominal.link_resolution_rad, noise_rad);
            match channel {
                Channel::Torsion => nominal.stiffness_nm_rad * motor_rad.hypot(link_rad),
                Channel::Motor | Channel::Link => {
                    let bandwidth_rad_s = std::f64::consts::TAU * piece.band.cutoff_hz;
                    let own_nm = (nominal.rotor_inertia_kg_m2 + load.inertia_kg_m2[k])
                        * bandwidth_rad_s.powi(2)
                        * motor_rad;
                    own_nm.hypot(piece.joint.others_rounding_nm[k])
                }
                Channel::Drive => 0.0,
            }
        };
        for &channel in channels {
            rows.extend(piece.kept.iter().map(|row| {
                let k = row * piece.band.stride();
                Row {
                    stretch,
                    channel,
                    time_s: drive.start_s + k as f64 * drive.period_s,
                    position_rad: load.position_rad[k],
                    velocity_rad_s: load.velocity_rad_s[k],
                    acceleration_rad_s2: acceleration_rad_s2[k],
                    load_nm: load.torque_nm[k],
                    motor_angle_rad: nominal.gear_ratio * drive.motor_rad[k],
                    inertial_nm: largest_around(&moving_nm, k, around),
                    unseen_nm: largest_around(&piece.joint.unseen_nm, k, around),
                    vibrating_nm: vibrating_nm(&piece.vibration, nominal, unloaded_nm[k], k),
                    shaken_nm: unloaded_nm[k]
                        * piece.vibration.shaken_off(
                            k,
                            load.velocity_rad_s[k],
                            nominal.presliding_rad,
                        ),
                    falling_nm: fall_around(&load.velocity_rad_s, &unloaded_nm, k, around),
                    aliased_nm: largest_around(&aliased_nm, k, around),
                    beating_nm: beating(channel, k),
                }
            }));
        }
    }
    rows
}

#[cfg(test)]
impl Row {
    /// At rest, of the motor's channel.
    pub(crate) fn at_rest(time_s: f64) -> Self {
        Self {
            stretch: 0,
            channel: Channel::Motor,
            time_s,
            position_rad: 0.0,
            velocity_rad_s: 0.0,
            acceleration_rad_s2: 0.0,
            load_nm: 0.0,
            motor_angle_rad: 0.0,
            inertial_nm: 0.0,
            unseen_nm: 0.0,
            vibrating_nm: 0.0,
            shaken_nm: 0.0,
            falling_nm: 0.0,
            aliased_nm: 0.0,
            beating_nm: 0.0,
        }
    }
}

/// Seeded noise of the sensors.
struct Sensors {
    random: Pcg64Mcg,
    spare: Option<f64>,
}

impl Sensors {
    fn new(seed: u64, place: u64) -> Self {
        Self {
            random: Pcg64Mcg::seed_from_u64(seed ^ place.rotate_left(32)),
            spare: None,
        }
    }
}

impl Noise for Sensors {
    /// Box and Muller.
    fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        let (sin, cos) = (std::f64::consts::TAU * self.uniform()).sin_cos();
        self.spare = Some(radius * sin);
        radius * cos
    }

    fn uniform(&mut self) -> f64 {
        (self.random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_falls_as_far_as_the_joint_gets_faster_near_a_sample() {
        // Stribeck's: 2 Nm at rest, 1 Nm beyond 0.1 rad/s
        let level_nm = |velocity_rad_s: f64| 1.0 + (1.0 - 10.0 * velocity_rad_s.abs()).max(0.0);
        let velocity_rad_s: Vec<f64> = (0..100).map(|k| 0.01 * f64::from(k) - 0.2).collect();
        let levels_nm: Vec<f64> = velocity_rad_s.iter().map(|v| level_nm(*v)).collect();
        let fall_nm = |k: usize| fall_around(&velocity_rad_s, &levels_nm, k, 5);
        assert!((fall_nm(20) - 0.5).abs() < 1e-9, "{}", fall_nm(20));
        assert_eq!(fall_nm(80), 0.0);
        // what rises does not fall
        let rising_nm: Vec<f64> = levels_nm.iter().map(|level| -level).collect();
        assert_eq!(fall_around(&velocity_rad_s, &rising_nm, 20, 5), 0.0);
    }

    #[test]
    fn a_torque_between_two_samples_is_in_doubt_where_it_bends() {
        let line: Vec<f64> = (0..9).map(|k| 0.5 * f64::from(k)).collect();
        assert!(
            off_lines_nm(&line, 0.0)[1..8]
                .iter()
                .all(|off| *off < 1e-12)
        );
        // a push of 2 Nm that one sample shows may have lasted for twice as long or not at all
        let mut pushed = line.clone();
        pushed[4] += 2.0;
        let off_nm = off_lines_nm(&pushed, 0.0);
        assert!((off_nm[4] - 1.0).abs() < 1e-12 && (off_nm[3] - 0.5).abs() < 1e-12);
        // a bend within the noise is none
        assert_eq!(off_lines_nm(&pushed, 2.0), [0.0; 9]);
    }
}
