//! Torque that the robot file needs along the recorded motion, and how it changes with what the file may be wrong about: inverse
//! dynamics, which cannot run away from the recording.

use gap_report::TorqueSource;
use joint_model::friction::Sliding;
use joint_model::harmonic;
use joint_model::rigid_body::{Chain, Link};
use joint_twin::joint::JointModel;
use joint_twin::known::{self, Every, KnownValue, PART_MIN};
use nalgebra::{Matrix3, Vector3};
use robot::{Effect, Robot, Tolerance, changed_chain};

use super::motion::{JointMotion, Piece};
use crate::evidence::arm::{LINKS_WRONG, OF_LINK};

/// How the torque of every joint changes with something of the whole arm.
#[derive(Clone, Debug)]
pub struct ArmColumn {
    /// Joint by joint, row by row.
    pub change_nm: Vec<Vec<f64>>,
}

/// Torques along one piece, joint by joint.
#[derive(Clone, Debug)]
pub struct Torques {
    /// What the rigid bodies need.
    pub rigid_nm: Vec<Vec<f64>>,
    /// Inertia about the joint's axis in the rows' middle.
    pub inertia_kg_m2: Vec<f64>,
    /// What a kg m² more of each joint's link about its axis needs of that joint; none where no body has it.
    pub link_inertia_nm: Vec<Option<Vec<f64>>>,
    /// Changes by one standard deviation of the links' values.
    pub links: Vec<ArmColumn>,
    /// The same where the file is wrong of them, [`OF_LINK`] of each link.
    pub masses: Vec<ArmColumn>,
    /// By a payload's mass in the last link's origin, and its first moment along three axes.
    pub payload: Vec<ArmColumn>,
    /// By what a point at the last link's x, y, z, and x and y, y and z, x and z together, adds of inertia per kilogram and square metre,
    /// without its mass.
    pub tip: Vec<ArmColumn>,
    /// By gravity along the base's x, y and z, as parts of it: what a tilted base changes.
    pub tilt: Vec<ArmColumn>,
}

/// The arm's bodies as the robot file has them.
pub fn chain(robot: &Robot) -> Chain {
    // a robot that was built from a file has a chain
    robot.loaded_chain().unwrap_or_else(|_| robot.chain.clone())
}

impl Torques {
    /// The same with what a joint carries as it was measured, whatever the bodies are.
    pub fn carried_as(&self, joint: usize, measured_nm: &[f64]) -> Self {
        let mut other = self.clone();
        other.rigid_nm[joint] = measured_nm.to_vec();
        let columns = [
            &mut other.links,
            &mut other.masses,
            &mut other.payload,
            &mut other.tip,
            &mut other.tilt,
        ];
        for column in columns.into_iter().flatten() {
            column.change_nm[joint].fill(0.0);
        }
        other
    }

    /// Along a piece.
    pub fn along(robot: &Robot, piece: &Piece) -> Self {
        let chain = &chain(robot);
        let rows = Rows::of(piece);
        let rigid_nm = rows.torque_nm(chain);
        let change = |changed: &Chain, factor: f64| ArmColumn {
            change_nm: minus(rows.torque_nm(changed), &rigid_nm, factor),
        };
        let nothing = || ArmColumn {
            change_nm: rigid_nm.iter().map(|nm| vec![0.0; nm.len()]).collect(),
        };
        let if_any =
            |changed: &Option<Chain>| changed.as_ref().map_or_else(nothing, |of| change(of, 1.0));
        let links = tolerated(chain, &robot.tolerance)
            .iter()
            .map(|changed| change(changed, 1.0))
            .collect();
        let of_link = |joint: usize| {
            let more = Effect::LinkInertia { inertia_kg_m2: 1.0 };
            let of_joint = [(Some(joint), &more)];
            let heavier =
                changed_chain(chain.links(), chain.gravity_m_s2(), chain.tool(), of_joint);
            change(&heavier.ok()?, 1.0).change_nm.into_iter().nth(joint)
        };
        Self {
            inertia_kg_m2: rows.inertia_kg_m2(chain),
            link_inertia_nm: (0..chain.joint_count()).map(of_link).collect(),
            links,
            masses: wrong(chain).iter().map(if_any).collect(),
            payload: payload(chain, &rows, &rigid_nm),
            tip: tip(chain)
                .iter()
                .map(|changed| change(changed, 1.0))
                .collect(),
            tilt: tilted(chain)
                .iter()
                .map(|changed| change(changed, 1.0 / GRAVITY_PART))
                .collect(),
            rigid_nm,
        }
    }
}

/// The arm's motion row by row.
struct Rows<'a> {
    joints: &'a [JointMotion],
    rows: usize,
}

impl<'a> Rows<'a> {
    fn of(piece: &'a Piece) -> Self {
        Self {
            joints: &piece.joints,
            rows: piece.rows(),
        }
    }

    fn at(&self, of: fn(&JointMotion) -> &[f64], row: usize, into: &mut [f64]) {
        for (value, joint) in into.iter_mut().zip(self.joints) {
            *value = of(joint)[row];
        }
    }

    fn torque_nm(&self, chain: &Chain) -> Vec<Vec<f64>> {
        let count = self.joints.len();
        let mut torque_nm = vec![vec![0.0; self.rows]; count];
        let [mut q, mut v, mut a, mut at_row] = [(); 4].map(|()| vec![0.0; count]);
        for row in 0..self.rows {
            self.at(|joint| &joint.position_rad, row, &mut q);
            self.at(|joint| &joint.velocity_rad_s, row, &mut v);
            self.at(|joint| &joint.acceleration_rad_s2, row, &mut a);
            chain.inverse_dynamics(&q, &v, &a, &mut at_row);
            for (column, torque) in torque_nm.iter_mut().zip(&at_row) {
                column[row] = *torque;
            }
        }
        torque_nm
    }

    fn inertia_kg_m2(&self, chain: &Chain) -> Vec<f64> {
        let count = self.joints.len();
        let mut q = vec![0.0; count];
        let rest = vec![0.0; count];
        self.at(|joint| &joint.position_rad, self.rows / 2, &mut q);
        let inertia = |joint: usize| {
            let [mut still, mut pushed] = [(); 2].map(|()| vec![0.0; count]);
            let mut unit = rest.clone();
            unit[joint] = 1.0;
            chain.inverse_dynamics(&q, &rest, &rest, &mut still);
            chain.inverse_dynamics(&q, &rest, &unit, &mut pushed);
            pushed[joint] - still[joint]
        };
        (0..count).map(inertia).collect()
    }
}

fn minus(changed: Vec<Vec<f64>>, from: &[Vec<f64>], factor: f64) -> Vec<Vec<f64>> {
    let mut changed = changed;
    for (column, from) in changed.iter_mut().zip(from) {
        for (value, from) in column.iter_mut().zip(from) {
            *value = factor * (*value - from);
        }
    }
    changed
}

/// Multiplies one of a link's values.
type ChangeOfLink = fn(&mut Link, f64);

/// Chains with one value of one link more by a standard deviation of its tolerance; those that no body could be are left out.
fn tolerated(chain: &Chain, tolerance: &Tolerance) -> Vec<Chain> {
    let changes: [(&str, ChangeOfLink); 5] = [
        ("mass_kg", |link, factor| link.mass_kg *= factor),
        ("centre_of_mass_m", |link, factor| {
            link.centre_of_mass_m.x *= factor;
        }),
        ("centre_of_mass_m", |link, factor| {
            link.centre_of_mass_m.y *= factor;
        }),
        ("centre_of_mass_m", |link, factor| {
            link.centre_of_mass_m.z *= factor;
        }),
        ("inertia_kg_m2", |link, factor| {
            link.inertia_kg_m2 *= factor;
        }),
    ];
    let mut all = Vec::new();
    for index in 0..chain.joint_count() {
        for (name, change) in changes {
            let deviation = tolerance.of(name);
            if deviation > 0.0 {
                all.extend(changed(chain, |links| {
                    change(&mut links[index], 1.0 + deviation);
                }));
            }
        }
    }
    all
}

/// Chains with one value of one link more by a standard deviation of what it is where the file is wrong of it, link by link; none where no
/// body could be like that.
fn wrong(chain: &Chain) -> Vec<Option<Chain>> {
    let of_link = |index: usize| {
        let more = |change: &dyn Fn(&mut Link)| changed(chain, |links| change(&mut links[index]));
        let apart_m = LINKS_WRONG * chain.links()[index].centre_of_mass_m.norm();
        let along = |axis: usize| more(&|link: &mut Link| link.centre_of_mass_m[axis] += apart_m);
        let values: [Option<Chain>; OF_LINK] = [
            more(&|link| link.mass_kg *= 1.0 + LINKS_WRONG),
            along(0),
            along(1),
            along(2),
            more(&|link| link.inertia_kg_m2 *= 1.0 + LINKS_WRONG),
        ];
        values
    };
    (0..chain.joint_count()).flat_map(of_link).collect()
}

fn changed(chain: &Chain, change: impl FnOnce(&mut [Link])) -> Option<Chain> {
    let mut links = chain.links().to_vec();
    change(&mut links);
    Chain::new(&links, chain.gravity_m_s2(), chain.tool()).ok()
}

/// Torque per kilogram at the last link's origin, and per kg m of first moment along its axes. Torque is linear in a link's mass,
/// first moment and inertia (Khalil and Dombre, Modeling, Identification and Control of Robots, 2002, eq 9.36), so two masses
/// opposite each other take the inertia out.
fn payload(chain: &Chain, rows: &Rows<'_>, rigid_nm: &[Vec<f64>]) -> Vec<ArmColumn> {
    const MASS_KG: f64 = 1.0;
    const LEVER_M: f64 = 0.1;
    let with = |centre_m: Vector3<f64>| {
        let heavier = changed(chain, |links| {
            if let Some(last) = links.last_mut() {
                last.add_point_mass(MASS_KG, centre_m);
            }
        })?;
        Some(rows.torque_nm(&heavier))
    };
    let columns = || {
        let mass = minus(with(Vector3::zeros())?, rigid_nm, 1.0 / MASS_KG);
        let mut all = vec![ArmColumn { change_nm: mass }];
        for axis in 0..3 {
            let lever_m = LEVER_M * Vector3::ith(axis, 1.0);
            let (ahead, behind) = (with(lever_m)?, with(-lever_m)?);
            all.push(ArmColumn {
                change_nm: minus(ahead, &behind, 0.5 / (MASS_KG * LEVER_M)),
            });
        }
        Some(all)
    };
    columns().unwrap_or_default()
}

/// Places whose point inertias make that of any place: inertia is quadratic in the place.
pub const TIP_PLACES_M: [[f64; 3]; 6] = [
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
    [1.0, 1.0, 0.0],
    [0.0, 1.0, 1.0],
    [1.0, 0.0, 1.0],
];

/// Weights of those places in the inertia of a point elsewhere: `J(c) = Σ x² J(x) + xy (J(x+y) - J(x) - J(y)) + …`.
pub fn tip_weights([x, y, z]: [f64; 3]) -> [f64; 6] {
    [
        x * x - x * y - x * z,
        y * y - x * y - y * z,
        z * z - y * z - x * z,
        x * y,
        y * z,
        x * z,
    ]
}

/// Chains whose last link has the inertia of a kilogram at each of those places, and not its mass; none where one is no body.
fn tip(chain: &Chain) -> Vec<Chain> {
    let with = TIP_PLACES_M.map(|place_m| {
        changed(chain, |links| {
            if let Some(last) = links.last_mut() {
                let centre = Vector3::from(place_m);
                last.inertia_kg_m2 +=
                    Matrix3::identity() * centre.norm_squared() - centre * centre.transpose();
            }
        })
    });
    with.into_iter()
        .collect::<Option<Vec<_>>>()
        .unwrap_or_default()
}

/// Part of gravity by which the effect of more of it along an axis is found: it is linear, so any would do.
const GRAVITY_PART: f64 = 1e-3;

/// Chains with more gravity along each axis; none where nothing falls.
fn tilted(chain: &Chain) -> Vec<Chain> {
    let gravity_m_s2 = chain.gravity_m_s2();
    let more_m_s2 = GRAVITY_PART * gravity_m_s2.norm();
    if more_m_s2 == 0.0 {
        return Vec::new();
    }
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()].into_iter();
    let all = axes.filter_map(|axis| {
        let mut on = chain.clone();
        on.set_gravity(gravity_m_s2 + more_m_s2 * axis).ok()?;
        Some(on)
    });
    all.collect()
}

/// What the robot file needs of one joint, beyond its rigid bodies.
#[derive(Clone)]
pub struct Drive {
    model: JointModel,
    known: Vec<KnownValue>,
    /// The sensor lies behind rotor and gear.
    feels_rotor: bool,
    friction_is_a_simulators: bool,
}

impl Drive {
    /// Of a joint whose torque is seen there.
    pub fn of(robot: &Robot, joint: usize, source: TorqueSource) -> Self {
        let model = JointModel::nominal(robot, joint);
        Self {
            known: known::of_joint(&model, &robot.tolerance, Every::default()),
            model,
            feels_rotor: source != TorqueSource::Sensor,
            friction_is_a_simulators: robot.joints[joint].friction_is_a_simulators,
        }
    }

    /// The joint as its robot file has it.
    pub fn model(&self) -> &JointModel {
        &self.model
    }

    /// Whether nobody measured the joint's friction: the file states none, or a description for simulators does.
    pub fn rubs_unmeasured(&self) -> bool {
        let friction = &self.model.friction;
        let at = Sliding::at(1.0);
        let is_smooth = friction.level_nm(&at) == 0.0 && friction.fluid_drag_nm(1.0) == 0.0;
        is_smooth || self.friction_is_a_simulators
    }

    /// Dry friction that the file states at a speed.
    pub fn dry_nm(&self, speed_rad_s: f64) -> f64 {
        self.model.friction.level_nm(&Sliding::at(speed_rad_s))
    }

    /// The part of it that is in proportion to the torque's unit: all of it, and without the friction that nobody measured.
    pub fn in_proportion_nm(
        &self,
        motion: &JointMotion,
        slip: &[f64],
        rigid_nm: &[f64],
    ) -> Vec<f64> {
        if !self.friction_is_a_simulators {
            return self.torque_nm(motion, slip, rigid_nm);
        }
        let model = JointModel {
            friction: Default::default(),
            ..self.model.clone()
        };
        self.torque_of(&model, motion, slip, rigid_nm)
    }

    /// Torque that the source would show.
    pub fn torque_nm(&self, motion: &JointMotion, slip: &[f64], rigid_nm: &[f64]) -> Vec<f64> {
        self.torque_of(&self.model, motion, slip, rigid_nm)
    }

    fn torque_of(
        &self,
        model: &JointModel,
        motion: &JointMotion,
        slip: &[f64],
        rigid_nm: &[f64],
    ) -> Vec<f64> {
        let rows = 0..rigid_nm.len();
        rows.map(|k| {
            let [q, v, a] = [
                motion.position_rad[k],
                motion.velocity_rad_s[k],
                motion.acceleration_rad_s2[k],
            ];
            let [sin_nm, cos_nm] = model.gravity_sin_cos_nm;
            let springs = model.springs.iter();
            let springs_nm: f64 = springs.map(|spring| spring.holding_nm(q)).sum();
            let friction = &model.friction;
            let load_nm = rigid_nm[k] + sin_nm * q.sin() + cos_nm * q.cos() + springs_nm;
            let load_nm = load_nm + friction.tables.held_nm(q, load_nm);
            let motor_rad = model.gear_ratio * q;
            let at = Sliding {
                load_nm,
                motor_position_rad: motor_rad,
                ..Sliding::at(v)
            };
            let drift = model.drift.as_ref();
            let warmed_nm = drift.map_or(0.0, |drift| drift.change_nm(motion.time_s[k]));
            let mut torque_nm = load_nm
                + (friction.level_nm(&at) + warmed_nm) * slip[k]
                + friction.fluid_drag_nm(v);
            if self.feels_rotor {
                torque_nm += model.rotor_inertia_kg_m2 * a;
                torque_nm -= model.torque_offset_nm;
                torque_nm -= model.gear_ratio * harmonic::sum(&model.torque_ripple, motor_rad);
                torque_nm /= model.torque_gain;
            }
            torque_nm
        })
        .collect()
    }

    /// Changes by one standard deviation of what the file says of the joint itself.
    pub fn tolerated(&self, motion: &JointMotion, slip: &[f64], rigid_nm: &[f64]) -> Vec<Vec<f64>> {
        let nominal_nm = self.torque_nm(motion, slip, rigid_nm);
        let known = self.known.iter();
        known
            .map(|value| {
                let mut model = self.model.clone();
                value.apply(&mut model, 1.0);
                let changed_nm = self.torque_of(&model, motion, slip, rigid_nm);
                let pairs = changed_nm.iter().zip(&nominal_nm);
                pairs.map(|(changed, nominal)| changed - nominal).collect()
            })
            .collect()
    }
}

/// Columns that are not small beside the largest.
pub fn that_count(columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    let rms = |column: &Vec<f64>| (column.iter().map(|x| x * x).sum::<f64>()).sqrt();
    let sizes: Vec<f64> = columns.iter().map(rms).collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let both = columns.into_iter().zip(sizes);
    both.filter(|(_, size)| *size > PART_MIN * largest)
        .map(|(column, _)| column)
        .collect()
}
