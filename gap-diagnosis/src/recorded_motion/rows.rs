//! One joint's compared rows: the torque that the robot file does not need, and all columns that may explain it, in one band.

use gap_report::TorqueSource;
use joint_model::filter::FilterError;
use joint_model::rigid_body::JointKind;
use joint_twin::known::PART_MIN;
use joint_twin::load::POSES;
use joint_twin::signal::band::{Band, MOTION_HZ};
use nalgebra::{DMatrix, DVector};
use robot::Robot;

use super::dynamics::{ArmColumn, Drive, Torques, that_count, tip_weights};
use super::laws::{Along, Law};
use super::motion::{JointMotion, Piece};
use super::presliding::{self, Presliding};
use super::turning::Turning;
use crate::evidence::INEXACT;
use crate::evidence::rows::Rows;
use crate::evidence::told::MATERIALITY;

/// Compared rows of a joint at most: twenty times as many as are independent on the longest of eight real logs.
const ROWS_MAX: usize = 3000;
/// Part of its speed that a joint usually does not exceed.
const USUAL: f64 = 0.95;

/// Rows of one joint, all of one length.
#[derive(Clone, Debug, Default)]
pub struct JointRows {
    /// What they are and what they are held against.
    pub seen: Rows,
    /// Torque that the rigid bodies need.
    pub rigid_nm: Vec<f64>,
    /// What was commanded, where that is beside the measured torque.
    pub command_nm: Option<Vec<f64>>,
    /// Columns of each law.
    pub laws: Vec<(Law, Vec<Vec<f64>>)>,
    /// Columns of one standard deviation each, of what the file may be wrong about of the joint.
    pub tolerated: Vec<Vec<f64>>,
    /// And of the links.
    pub links: Vec<Vec<f64>>,
    /// Columns of the links' values where the file is wrong of them.
    pub masses: Vec<Vec<f64>>,
    /// Columns of one standard deviation each, of what no file tells: the time between torque and position, and how friction bends.
    pub untold: Vec<Vec<f64>>,
    /// Friction that bends, the file's and what is found of it.
    pub dry_nm: f64,
    /// What a unit of the torque is, by what masses and friction need.
    pub unit_nm: f64,
    /// Columns of a payload: mass, and first moment along three axes.
    pub payload: Vec<Vec<f64>>,
    /// Columns of a point's inertia at the tip, place by place.
    pub tip: Vec<Vec<f64>>,
    /// Columns of the base's roll and pitch.
    pub tilt: Vec<Vec<f64>>,
    /// The column of a late reference; none where the torque is not the controller's.
    pub late: Vec<Vec<f64>>,
    /// Usual speed.
    pub speed_rad_s: f64,
    /// Mean position.
    pub mean_rad: f64,
    /// How friction turns round: what leaves least, and what it may be as well.
    pub presliding: [Presliding; 3],
    /// Whether the controller feeds the reference's velocity back, where that was open.
    pub feeds_rate: bool,
    /// Inertia about the axis.
    pub inertia_kg_m2: f64,
    /// Noise of the torque within the band, if it is alike at all frequencies.
    pub noise_nm: f64,
    /// What of the torque is faster than the band, root mean square: the most of any piece.
    pub fast_nm: f64,
    /// Rows a second of the recording.
    pub recorded_hz: f64,
    /// Part of the recorded rows that do not count, as a controller asked for more than its drive gives.
    pub at_limit_part: f64,
}

/// What one piece gives to a joint's rows.
pub(super) struct Kept<'a> {
    pub piece: &'a Piece,
    band: Band,
    rows: Vec<usize>,
    pub along: Along<'a>,
}

impl Kept<'_> {
    pub fn limited(&self, column: &[f64]) -> Result<Vec<f64>, FilterError> {
        let smooth = self.band.limit(column)?;
        Ok(self.raw(&smooth))
    }

    fn raw(&self, column: &[f64]) -> Vec<f64> {
        self.rows.iter().map(|row| column[*row]).collect()
    }
}

impl JointRows {
    /// Rows of a joint along all pieces; none where it has no torque, no rows, or does not go far enough to slip.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn of(
        robot: &Robot,
        joint: usize,
        source: TorqueSource,
        pieces: &[Piece],
        torques: &[Torques],
    ) -> Result<Option<Self>, FilterError> {
        let slides = robot.chain.links()[joint].kind == JointKind::Prismatic;
        let counted = |piece: &Piece| {
            let of_joint = &piece.joints[joint];
            let rows = piece.counted();
            // who turns no further than friction may bend may never slip
            let may_slip = slides || of_joint.range_rad() > presliding::longest_rad();
            let rows = if may_slip { rows } else { 0..0 };
            // a joint at rest holds any torque up to its breakaway: what it holds then tells nothing
            let tell = rows.filter(|row| of_joint.is_whole[*row] && of_joint.is_moving[*row]);
            tell.collect::<Vec<usize>>()
        };
        let mut counted: Vec<Vec<usize>> = pieces.iter().map(counted).collect();
        for (rows, piece) in counted.iter_mut().zip(pieces) {
            let begun = begun(&piece.joints[joint]);
            rows.retain(|row| *row >= begun);
        }
        let total: usize = counted.iter().map(Vec::len).sum();
        if total == 0 {
            return Ok(None);
        }
        let every = total.div_ceil(ROWS_MAX).max(1);
        let of_rows = |of: fn(&JointMotion) -> &[f64]| {
            let both = pieces.iter().zip(&counted);
            let values = both.flat_map(|(piece, rows)| {
                let column = of(&piece.joints[joint]);
                rows.iter().map(|row| column[*row])
            });
            values.collect::<Vec<f64>>()
        };
        let speed_rad_s = usual(of_rows(|joint| &joint.velocity_rad_s));
        let position_rad = of_rows(|joint| &joint.position_rad);
        let mean_rad = position_rad.iter().sum::<f64>() / total as f64;
        let drive = Drive::of(robot, joint, source);
        let is_open = pieces
            .iter()
            .any(|piece| piece.joints[joint].rate_feed_nm.is_some());
        let turning = Turning {
            drive: &drive,
            joint,
            pieces,
            torques,
            counted: &counted,
            speed_rad_s,
        };
        let mut bend = turning.bent(true)?;
        let mut feeds_rate = true;
        if is_open {
            let without = turning.bent(false)?;
            if without.left < bend.left {
                (bend, feeds_rate) = (without, false);
            }
        }
        let mut rows = Self {
            speed_rad_s,
            presliding: bend.bend,
            dry_nm: bend.dry_nm + drive.dry_nm(speed_rad_s),
            unit_nm: bend.unit_nm,
            feeds_rate,
            mean_rad,
            inertia_kg_m2: torques[0].inertia_kg_m2[joint],
            ..Self::default()
        };
        let gravity_part = gravity_part(robot, joint, pieces);
        let laws = Law::of_joint(speed_rad_s, true, gravity_part);
        let recorded = pieces.iter().map(|piece| piece.joints[joint].at_limit_part);
        let weight = pieces.iter().map(|piece| piece.rows() as f64);
        rows.at_limit_part = recorded
            .zip(weight.clone())
            .map(|(part, rows)| part * rows)
            .sum::<f64>()
            / weight.sum::<f64>();
        rows.laws = laws
            .iter()
            .map(|law| (*law, vec![Vec::new(); law.amplitudes()]))
            .collect();
        let mut kept = Vec::new();
        for ((piece, torques), counted) in pieces.iter().zip(torques).zip(&counted) {
            let motion = &piece.joints[joint];
            if motion.torque_nm.is_none() {
                return Ok(None);
            }
            let band_part = 2.0 * piece.compared_hz() / motion.recorded_hz;
            rows.noise_nm = rows.noise_nm.max(motion.noise_nm * band_part.sqrt());
            rows.fast_nm = rows.fast_nm.max(motion.fast_nm);
            rows.recorded_hz = motion.recorded_hz;
            let piece_of = Kept {
                piece,
                band: Band::of(piece.rate_hz, piece.compared_hz()),
                rows: counted.iter().copied().step_by(every).collect(),
                along: rows.along(&drive, piece, torques, joint),
            };
            rows.add(&drive, torques, joint, &piece_of)?;
            kept.push(piece_of);
        }
        rows.tolerated = that_count(std::mem::take(&mut rows.tolerated));
        rows.links = that_count(std::mem::take(&mut rows.links));
        // a torque of which the file needs next to nothing tells nothing of its scale; nor does friction that nobody measured
        let square = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>();
        let needed = rows.columns(Law::TorqueConstant).first();
        let needed = needed.map_or(0.0, |needed_nm| square(needed_nm));
        if needed < MATERIALITY * square(&rows.seen.measured_nm) {
            rows.laws
                .retain(|(law, _)| !matches!(law, Law::LoadDependent | Law::TorqueConstant));
        }
        rows.drop_link_inertia_of_the_first();
        if square(&rows.seen.measured_nm) == 0.0 {
            rows.drop_masses();
        } else {
            rows.offer(source, &kept)?;
        }
        Ok(Some(rows))
    }

    /// The same joint, of which its torque sensor tells what it carries; none where it has none beside the drive's torque. What a link
    /// needs the sensor has felt: laws of it are none of this joint's.
    ///
    /// # Errors
    /// [`FilterError`].
    pub fn beside_its_sensor(
        robot: &Robot,
        joint: usize,
        pieces: &[Piece],
        torques: &[Torques],
    ) -> Result<Option<Self>, FilterError> {
        let both = pieces.iter().zip(torques).map(|(piece, torques)| {
            let sensor_nm = piece.joints[joint].sensor_nm.as_deref()?;
            Some(torques.carried_as(joint, sensor_nm))
        });
        let Some(carried) = both.collect::<Option<Vec<_>>>() else {
            return Ok(None);
        };
        let rows = Self::of(robot, joint, TorqueSource::Drive, pieces, &carried)?;
        Ok(rows.map(|mut rows| {
            rows.laws
                .retain(|(law, _)| !matches!(law, Law::LinkInertia | Law::Gravity | Law::Spring));
            rows
        }))
    }

    /// A joint that nothing drives tells its friction over its masses, and nothing of those: all masses that are none would leave no
    /// torque either.
    fn drop_masses(&mut self) {
        self.laws.retain(|(law, _)| {
            !matches!(
                law,
                Law::Inertia
                    | Law::LinkInertia
                    | Law::Gravity
                    | Law::TorqueConstant
                    | Law::LoadDependent
            )
        });
        self.payload.clear();
        self.masses.clear();
    }

    /// Where nothing else turns it a link moves as its joint does, and its inertia is the joint's.
    fn drop_link_inertia_of_the_first(&mut self) {
        let column = |law: Law| {
            let mut laws = self.laws.iter();
            laws.find(|(of, _)| *of == law)
                .and_then(|(_, columns)| columns.first())
        };
        let (Some(joint), Some(link)) = (column(Law::Inertia), column(Law::LinkInertia)) else {
            return;
        };
        let apart = joint
            .iter()
            .zip(link)
            .map(|(a, b)| (a - b).powi(2))
            .sum::<f64>();
        let [joint, link] = [joint, link].map(|of| of.iter().map(|x| x * x).sum::<f64>());
        let least = PART_MIN.powi(2) * joint;
        if apart < least || link < least {
            self.laws.retain(|(law, _)| *law != Law::LinkInertia);
        }
    }

    /// The same with the torque in this unit, as if the file needed none.
    pub fn without_need(&self, size_nm: f64) -> Self {
        let mut rows = self.in_unit(size_nm);
        rows.seen.nominal_nm.fill(0.0);
        rows.tolerated.clear();
        rows.links.clear();
        rows.masses.clear();
        rows.untold.remove(0);
        rows
    }

    /// The same with the torque in this unit. How large it is exactly is not known: that is the first column of what no file tells.
    pub fn in_unit(&self, size_nm: f64) -> Self {
        let mut rows = self.clone();
        let measured = [&mut rows.seen.measured_nm].into_iter();
        let all = measured.chain(&mut rows.command_nm).chain(&mut rows.untold);
        all.flatten().for_each(|torque| *torque *= size_nm);
        rows.noise_nm *= size_nm;
        rows.fast_nm *= size_nm;
        let laws = std::mem::take(&mut rows.laws);
        let (constant, laws): (Vec<_>, Vec<_>) = laws
            .into_iter()
            .partition(|(law, _)| *law == Law::TorqueConstant);
        rows.laws = laws;
        let unknown = constant.into_iter().flat_map(|(_, columns)| columns);
        rows.untold.splice(0..0, unknown);
        rows
    }

    /// The same with masses that need so many times the file's torque, as exactly unknown.
    pub fn with_masses(&self, factor: f64) -> Self {
        let mut rows = self.in_unit(1.0);
        let seen = [&mut rows.seen.nominal_nm, &mut rows.rigid_nm].into_iter();
        let all = seen
            .chain(&mut rows.tolerated)
            .chain(&mut rows.links)
            .chain(&mut rows.masses)
            .chain(rows.untold.first_mut())
            .chain(&mut rows.payload)
            .chain(&mut rows.tip)
            .chain(&mut rows.tilt);
        let in_proportion = rows.laws.iter_mut();
        let in_proportion = in_proportion.filter(|(law, _)| *law == Law::LoadDependent);
        let all = all.chain(in_proportion.flat_map(|(_, columns)| columns));
        all.flatten().for_each(|torque| *torque *= factor);
        rows
    }

    /// Columns of a payload that is about at a place. Its inertia is quadratic in the first moment and inverse in the mass; as both grow
    /// together it does too, so that its slopes alone make it (Euler), without a constant.
    pub fn payload_at(&self, centre_m: [f64; 3]) -> Vec<Vec<f64>> {
        let mut columns = self.payload.clone();
        let at = tip_weights(centre_m);
        for (place, column) in columns.iter_mut().enumerate() {
            let weights: [f64; 6] = match place.checked_sub(1) {
                None => at.map(|weight| -weight),
                Some(axis) => {
                    let mut unit = [0.0; 3];
                    unit[axis] = 1.0;
                    let alone = tip_weights(unit);
                    let mut both_m = centre_m;
                    both_m[axis] += 1.0;
                    let both = tip_weights(both_m);
                    std::array::from_fn(|k| both[k] - alone[k] - at[k])
                }
            };
            for (tip, weight) in self.tip.iter().zip(weights) {
                for (sum, change) in column.iter_mut().zip(tip) {
                    *sum += weight * change;
                }
            }
        }
        columns
    }

    /// What the file's masses make over sine and cosine of the joint's own position; none where that is not all that they make.
    pub fn gravity_nm(&self) -> Option<[f64; 2]> {
        let [sin, cos] = self.columns(Law::Gravity) else {
            return None;
        };
        let acceleration = self.columns(Law::Inertia).first()?;
        let of = DMatrix::from_fn(sin.len(), 3, |row, column| {
            [sin[row], cos[row], acceleration[row]][column]
        });
        let needed_nm = DVector::from_column_slice(&self.rigid_nm);
        let values = of.tr_mul(&of).cholesky()?.solve(&of.tr_mul(&needed_nm));
        let left = (&needed_nm - &of * &values).norm();
        (left <= INEXACT * needed_nm.norm()).then_some([values[0], values[1]])
    }

    /// Columns of a law; none where the joint may not have it.
    pub fn columns(&self, of: Law) -> &[Vec<f64>] {
        let mut all = self.laws.iter();
        let found = all.find(|(law, _)| *law == of);
        found.map_or(&[], |(_, columns)| columns)
    }

    fn along<'a>(
        &self,
        drive: &Drive,
        piece: &'a Piece,
        torques: &'a Torques,
        joint: usize,
    ) -> Along<'a> {
        let motion = &piece.joints[joint];
        let rigid_nm = &torques.rigid_nm[joint];
        let slip = self.presliding[0].slip(motion);
        Along {
            motion,
            gear_ratio: drive.model().gear_ratio,
            in_proportion_nm: drive.in_proportion_nm(motion, &slip, rigid_nm),
            load_nm: rigid_nm,
            slip,
            link_inertia_nm: torques.link_inertia_nm[joint]
                .as_deref()
                .unwrap_or(&motion.acceleration_rad_s2),
            mean_rad: self.mean_rad,
        }
    }

    fn add(
        &mut self,
        drive: &Drive,
        torques: &Torques,
        joint: usize,
        kept: &Kept<'_>,
    ) -> Result<(), FilterError> {
        let Kept { piece, along, .. } = kept;
        let (motion, slip) = (along.motion, &along.slip);
        let rigid_nm = &torques.rigid_nm[joint];
        let nominal_nm = drive.torque_nm(motion, slip, rigid_nm);
        for (law, columns) in &mut self.laws {
            for (column, added) in columns.iter_mut().zip(law.columns(along)) {
                column.extend(kept.limited(&added)?);
            }
        }
        let own = drive.tolerated(motion, slip, rigid_nm);
        let mut tolerated = Vec::new();
        for column in own {
            tolerated.push(kept.limited(&column)?);
        }
        join(&mut self.tolerated, tolerated);
        join(&mut self.links, of_arm(&torques.links, joint, kept)?);
        join(&mut self.masses, of_arm(&torques.masses, joint, kept)?);
        join(&mut self.payload, of_arm(&torques.payload, joint, kept)?);
        join(&mut self.tip, of_arm(&torques.tip, joint, kept)?);
        join(&mut self.tilt, of_arm(&torques.tilt, joint, kept)?);
        let late = motion.late_nm_s.iter();
        let late = late.map(|late| kept.limited(late));
        join(&mut self.late, late.collect::<Result<Vec<_>, _>>()?);
        if let Some(torque_nm) = motion.torque_nm(self.feeds_rate) {
            let smooth_nm = kept.band.limit(&torque_nm)?;
            let mut untold = vec![kept.raw(&motion.clock_nm(&smooth_nm, piece.rate_hz))];
            let others = self.presliding[1..].iter();
            let others = others.map(|presliding| presliding.slip(motion));
            for bent in others.chain([turned_earlier(slip, piece)]) {
                let both = bent.iter().zip(slip);
                let apart: Vec<f64> = both.map(|(a, b)| self.dry_nm * (a - b)).collect();
                untold.push(kept.limited(&apart)?);
            }
            join(&mut self.untold, untold);
            self.seen.measured_nm.extend(kept.raw(&smooth_nm));
        }
        if let Some(command_nm) = &motion.command_nm {
            let all = self.command_nm.get_or_insert_default();
            all.extend(kept.limited(command_nm)?);
        }
        self.seen.nominal_nm.extend(kept.limited(&nominal_nm)?);
        self.rigid_nm.extend(kept.limited(rigid_nm)?);
        self.seen.load_nm.extend(kept.raw(rigid_nm));
        self.seen
            .position_rad
            .extend(kept.raw(&motion.position_rad));
        self.seen
            .velocity_rad_s
            .extend(kept.raw(&motion.velocity_rad_s));
        self.seen
            .since_reversal_s
            .extend(kept.raw(&since_reversal_s(motion, piece.rate_hz)));
        self.seen
            .time_s
            .extend(kept.rows.iter().map(|row| piece.time_s(*row)));
        Ok(())
    }
}

/// Friction that turns round before the joint does, which sticks there for less time than its standing would be seen in.
fn turned_earlier(slip: &[f64], piece: &Piece) -> Vec<f64> {
    let rows = (0.5 * piece.rate_hz / MOTION_HZ).ceil() as usize;
    let last = slip.len().saturating_sub(1);
    (0..slip.len())
        .map(|row| slip[(row + rows).min(last)])
        .collect()
}

fn of_arm(
    columns: &[ArmColumn],
    joint: usize,
    kept: &Kept<'_>,
) -> Result<Vec<Vec<f64>>, FilterError> {
    columns
        .iter()
        .map(|arm| kept.limited(&arm.change_nm[joint]))
        .collect()
}

/// Appends each column to the one in its place.
fn join(all: &mut Vec<Vec<f64>>, added: Vec<Vec<f64>>) {
    all.resize(added.len().max(all.len()), Vec::new());
    for (column, added) in all.iter_mut().zip(added) {
        column.extend(added);
    }
}

/// The row at which a joint has begun to move: how far friction is bent before, nobody knows.
fn begun(motion: &JointMotion) -> usize {
    /// Of the usual speed.
    const MOVES: f64 = 0.1;
    let speed_rad_s = usual(motion.velocity_rad_s.clone());
    let moves = |v: &f64| v.abs() > MOVES * speed_rad_s;
    motion.velocity_rad_s.iter().position(moves).unwrap_or(0)
}

fn usual(mut values: Vec<f64>) -> f64 {
    for value in &mut values {
        *value = value.abs();
    }
    values.sort_by(f64::total_cmp);
    let place = (USUAL * values.len().saturating_sub(1) as f64) as usize;
    values.get(place).copied().unwrap_or(0.0)
}

fn since_reversal_s(motion: &JointMotion, rate_hz: f64) -> Vec<f64> {
    let mut since = 0.0;
    let mut before = 0.0;
    let velocity = motion.velocity_rad_s.iter();
    velocity
        .map(|velocity_rad_s| {
            if *velocity_rad_s * before < 0.0 {
                since = 0.0;
            } else {
                since += 1.0 / rate_hz;
            }
            before = *velocity_rad_s;
            since
        })
        .collect()
}

/// Largest part of gravity that lies across a joint's axis on the recorded motion.
fn gravity_part(robot: &Robot, joint: usize, pieces: &[Piece]) -> f64 {
    let poses = pieces.iter().flat_map(|piece| {
        let every = (piece.rows() / POSES).max(1);
        (0..piece.rows()).step_by(every).map(move |row| {
            let joints = piece.joints.iter();
            joints
                .map(|joint| joint.position_rad[row])
                .collect::<Vec<f64>>()
        })
    });
    let across = poses.map(|position_rad| robot.chain.gravity_across_axis(&position_rad, joint));
    across.fold(0.0, f64::max)
}
