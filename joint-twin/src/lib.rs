//! A recorded joint beside its simulation: what torque and encoders would have shown by the robot file and with any effect.
#![forbid(unsafe_code)]

pub mod control;
mod elastic;
pub mod joint;
pub mod known;
mod links;
pub mod load;
pub mod observe;
pub mod on_all_cores;
mod remembered;
mod rows;
pub mod scale;
pub mod signal;
pub mod simulate;
pub mod stop;
pub mod stretch;
mod thinned;
mod vibration;
pub mod whiten;
mod whole_arm;

use std::convert::Infallible;
use std::sync::{Arc, Mutex, PoisonError};

use joint_model::filter::FilterError;
use nalgebra::{Unit, Vector3};
use rand_core::{RngCore, SeedableRng};
use rand_pcg::Pcg64Mcg;
use recording::repeats::Place;
use robot::effect::parts::Full;
use robot::{Effect, Part, Robot};

use crate::joint::JointModel;
use crate::known::{Every, KnownValue};
use crate::load::{Load, LoadChange, Motion};
use crate::observe::{Band, Channel, Room, channels};
use crate::remembered::Remembered;
use crate::simulate::{Between, Feedback, Noise, Substeps, Trace, simulate};
use crate::stretch::{JointStretch, Stretch};
use crate::vibration::Vibration;
use crate::whole_arm::WholeArm;
pub use rows::Row;
use rows::rows;
use thinned::Thinned;
pub use vibration::Swing;

/// The beginning of a stretch does not count: nobody knows how far friction and gear were wound up.
pub const START_S: f64 = 0.5;
/// The end does not: the low-pass has nothing behind it.
pub const END_S: f64 = 0.1;

/// Runs that are remembered. With so many, between a twelfth and a quarter of a search's runs are found again, and hardly more with
/// any number.
const RUNS: usize = 256;
/// Loads that are remembered, of two megabytes at most: runs that follow one another mostly share theirs.
const LOADS: usize = 2;

/// Why a twin cannot be run.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TwinError {
    /// A filter cannot be designed.
    #[error("the recording's rate or the controller's filter does not fit: {0}")]
    Filter(#[from] FilterError),
    /// The joint has no room for an effect.
    #[error("{effect}: {full}; leave out the smallest of those in the robot file")]
    Full {
        /// Its identifier.
        effect: &'static str,
        /// How many it has room for.
        full: Full,
    },
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
    /// For coarse substeps, where those are longer than samples are apart.
    thinned: Option<Thinned>,
    /// The robot file's controller, or the same.
    controller: Feedback,
    band: Band,
    /// Values of links, last among what is known, and how the load changes with a standard deviation of each.
    links: Vec<(KnownValue, LoadChange)>,
    /// How the load changes with inertia added to the link about the joint's axis, per kg m².
    link_inertia: LoadChange,
    /// How the load changes with payload and tilt.
    whole_arm: WholeArm,
    /// Loads that changes made of the recorded motion's.
    loads: Remembered<(Changes, Substeps), Arc<Load>>,
    /// Of the motor above the band.
    vibration: Vibration,
    /// Of the thinned samples, those that count.
    kept: Vec<usize>,
}

impl<'a> JointTwin<'a> {
    /// For a joint of a robot; none where no recording tells its torque.
    ///
    /// # Errors
    /// [`TwinError::Filter`] if the controller's filter cannot be designed at a recording's rate.
    pub fn new(
        robot: &'a Robot,
        joint: usize,
        stretches: &'a [Stretch],
    ) -> Result<Option<Self>, TwinError> {
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
        let period_s = there.iter().map(|(_, signals)| signals.drive.period_s);
        let period_s = period_s.fold(0.0, f64::max);
        let mut drives = there.iter().map(|(_, signals)| &signals.drive);
        let every = Every {
            both_s: has_both.then_some(period_s),
            torque_s: drives
                .any(|drive| drive.between == Between::Line)
                .then_some(period_s),
            reported_s: channels.contains(&Channel::Drive).then_some(period_s),
        };
        let mut known = known::of_joint(&nominal, &robot.tolerance, every);
        let links = known::of_links(robot, joint, &motions);
        known.extend(links.iter().map(|(known, _)| known.clone()));
        let mut pieces = Vec::with_capacity(there.len());
        for (index, &(stretch, signals)) in there.iter().enumerate() {
            let of_piece = links
                .iter()
                .map(|(value, changes)| (value.clone(), changes[index].clone()));
            let of_piece = of_piece.collect();
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

    /// How well the robot file knows one of its values, as a part of it.
    pub fn tolerance_of(&self, name: &str) -> f64 {
        self.robot.tolerance.of(name)
    }

    /// Where the recordings' pieces lie that they are of.
    pub fn places(&self) -> Vec<Place> {
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

    /// Largest part of gravity that lies across the joint's axis on the recorded motion.
    pub fn gravity_part(&self) -> f64 {
        let motions = self.pieces.iter().map(|piece| &piece.stretch.motion);
        let poses = motions.flat_map(Motion::poses_rad);
        let across =
            poses.map(|pose_rad| self.robot.chain.gravity_across_axis(&pose_rad, self.joint));
        across.fold(0.0, f64::max)
    }

    /// How strong gravity is across the axis of the first joint, which does not turn in space.
    pub fn gravity_across_m_s2(&self) -> f64 {
        let chain = &self.robot.chain;
        let first = &chain.links()[0];
        let axis = first.origin.rotation * first.axis;
        chain.gravity_m_s2().cross(&axis).norm()
    }

    /// How many joints the robot has.
    pub fn joints(&self) -> usize {
        self.robot.joints.len()
    }

    /// Noise of the torque sensors within the band, from how they differ from sample to sample.
    pub fn torque_sensor_noise_nm(&self) -> f64 {
        let sensed = self.pieces.iter();
        let sensed = sensed.filter_map(|piece| piece.joint.joint_torque_nm.as_ref());
        let sensed_nm: Vec<f64> = sensed.flatten().copied().collect();
        let deviation_nm = recording::noise_std(&sensed_nm).unwrap_or(0.0);
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
    pub fn swing(&self) -> Option<Swing> {
        let samples = self.pieces.iter().flat_map(|piece| {
            let kept = piece.kept.iter().map(|row| row * piece.band.stride());
            kept.map(|k| (&piece.vibration, k, piece.joint.load.velocity_rad_s[k]))
        });
        Swing::of(samples, self.nominal.presliding_rad)
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
    /// [`TwinError`].
    pub fn simulated(&self, changes: &Changes, seed: Option<u64>) -> Result<Vec<f64>, TwinError> {
        self.along(changes, Substeps::Fine, seed)
    }

    /// The same without noise and in longer substeps, for differences between simulations.
    ///
    /// # Errors
    /// [`TwinError`].
    pub fn coarsely(&self, changes: &Changes) -> Result<Vec<f64>, TwinError> {
        self.along(changes, Substeps::Coarse, None)
    }

    fn along(
        &self,
        changes: &Changes,
        substeps: Substeps,
        seed: Option<u64>,
    ) -> Result<Vec<f64>, TwinError> {
        let asked = Asked {
            changes: changes.clone().without_rest(),
            substeps,
            seed,
        };
        self.runs.or(asked, |asked| self.made(asked))
    }

    fn made(&self, asked: &Asked) -> Result<Vec<f64>, TwinError> {
        // a bench is emptied before it is used, whatever a thread that panicked has left
        let benches = || self.benches.lock().unwrap_or_else(PoisonError::into_inner);
        let free = benches().pop();
        let mut bench = free.unwrap_or_default();
        let Bench { trace, room } = &mut bench;
        let mut all = Vec::with_capacity(self.rows.len());
        for (place, piece) in self.pieces.iter().enumerate() {
            crate::stop::look();
            self.run(place, asked, &piece.tracking, trace)?;
            let (band, load) = match piece.thinned_for(asked.substeps) {
                Some(thinned) => (thinned.band, &thinned.load),
                None => (piece.band, &piece.joint.load),
            };
            let seen = (load, piece.joint.has_torque_beside_command);
            let columns = band.simulated(&self.nominal, seen, trace, &self.channels, room)?;
            all.extend(piece.pick(&columns));
        }
        benches().push(bench);
        Ok(all)
    }

    /// Everything the sensors would show in one stretch under the robot file's controller.
    ///
    /// # Errors
    /// [`TwinError`].
    pub fn controlled(&self, piece: usize, changes: &Changes) -> Result<Trace, TwinError> {
        let asked = Asked {
            changes: changes.clone(),
            substeps: Substeps::Fine,
            seed: None,
        };
        let mut trace = Trace::default();
        self.run(piece, &asked, &self.pieces[piece].controller, &mut trace)?;
        Ok(trace)
    }

    fn run(
        &self,
        piece: usize,
        asked: &Asked,
        feedback: &Feedback,
        trace: &mut Trace,
    ) -> Result<(), TwinError> {
        let Asked {
            changes,
            substeps,
            seed,
        } = asked;
        let place = piece as u64;
        let piece = &self.pieces[piece];
        let thinned = piece.thinned_for(*substeps);
        let mut model = self.nominal.clone();
        for (known, deviations) in self.known.iter().zip(&changes.known) {
            if *deviations != 0.0 {
                known.apply(&mut model, *deviations);
            }
        }
        for effect in &changes.effects {
            model = model.with(effect)?;
        }
        let load = self.load(piece, changes, *substeps);
        let mut sensors = seed.map(|seed| Sensors::new(seed, place));
        let noise = sensors.as_mut().map(|noise| noise as &mut dyn Noise);
        let drive = &piece.joint.drive;
        if let Some(thinned) = thinned {
            let (drive, feedback) = (&thinned.drive, &thinned.tracking);
            simulate(&model, feedback, drive, &load, *substeps, noise, trace);
            thinned.put_right(trace);
        } else {
            simulate(&model, feedback, drive, &load, *substeps, noise, trace);
        }
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
        Ok(())
    }

    /// What the joint carries with these changes.
    fn load(&self, piece: &Piece<'a>, changes: &Changes, substeps: Substeps) -> Arc<Load> {
        let of_links = self.known.len() - piece.links.len();
        let known = changes.known.iter().enumerate();
        let of_load = Changes {
            known: known
                .map(|(place, moved)| if place < of_links { 0.0 } else { *moved })
                .collect(),
            effects: changes
                .effects
                .iter()
                .filter(|effect| effect.part() == Part::Bodies)
                .cloned()
                .collect(),
        };
        let asked = (of_load.without_rest(), substeps);
        let made = piece.loads.or(asked, |(changes, substeps)| {
            Ok::<_, Infallible>(Arc::new(self.changed_load(piece, changes, *substeps)))
        });
        match made {
            Ok(load) => load,
        }
    }

    fn changed_load(&self, piece: &Piece<'a>, changes: &Changes, substeps: Substeps) -> Load {
        let motion = &piece.stretch.motion;
        let of_links = self.known.len() - piece.links.len();
        let deviations = changes.known.get(of_links..).unwrap_or_default();
        let mut sum = piece
            .whole_arm
            .change(
                &self.robot.chain,
                motion,
                &changes.effects,
                &piece.links,
                deviations,
            )
            .unwrap_or_default();
        for effect in &changes.effects {
            if let Effect::LinkInertia { inertia_kg_m2 } = *effect {
                sum.add(&piece.link_inertia, inertia_kg_m2);
            }
        }
        for ((_, change), deviations) in piece.links.iter().zip(deviations) {
            if *deviations != 0.0 {
                sum.add(change, *deviations);
            }
        }
        let (mut load, every) = match piece.thinned_for(substeps) {
            Some(thinned) => (thinned.load.clone(), thinned.every),
            None => (piece.joint.load.clone(), 1),
        };
        motion.change(&mut load, &sum, every);
        load
    }
}

impl<'a> Piece<'a> {
    fn new(
        robot: &Robot,
        joint: usize,
        stretch: &'a Stretch,
        signals: &'a JointStretch,
        links: Vec<(KnownValue, LoadChange)>,
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
        tracking.smooth_rad = control::without_leaps(
            &signals.drive.motor_rad,
            step_rad / file.gear_ratio,
            band.rate_hz,
        )?;
        let vibration = Vibration::of(
            &signals.drive.motor_rad,
            noise_rad / file.gear_ratio,
            band.cutoff_hz,
            stretch.rate_hz,
        )?;
        let link_inertia = known::link_inertia(robot, joint, &stretch.motion);
        Ok(Self {
            stretch,
            joint: signals,
            link_inertia,
            whole_arm: WholeArm::of(joint),
            loads: Remembered::at_most(LOADS),
            thinned: Thinned::of(
                &JointModel::nominal(robot, joint),
                &signals.drive,
                &tracking,
                &signals.load,
                band,
            ),
            tracking,
            controller,
            band,
            links,
            vibration,
            kept,
        })
    }

    fn thinned_for(&self, substeps: Substeps) -> Option<&Thinned> {
        let thinned = self.thinned.as_ref();
        thinned.filter(|_| substeps == Substeps::Coarse)
    }

    /// Of every channel the rows that count, one channel after the other.
    fn pick(&self, columns: &[Vec<f64>]) -> impl Iterator<Item = f64> {
        columns
            .iter()
            .flat_map(|column| self.kept.iter().map(|row| column[*row]))
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
