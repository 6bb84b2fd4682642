//! Are the numbers of a robot file possible? Each error names the value and what is allowed.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use joint_model::friction::SteadyFriction;
use joint_model::torque_table::TABLES_MAX;

use crate::error::{Place, RobotError};
use crate::tolerance::PARAMETERS;
use crate::{
    Control, ControlKind, Effect, FrictionTable, LoadTorqueRow, RobotJoint, StribeckRow, Tolerance,
    TorqueTable,
};

/// What a number must be.
#[derive(Clone, Copy, Debug)]
pub enum Must {
    BeFinite,
    BePositive,
    NotBeNegative,
    /// From 0 up to, but not including, 1.
    BeFraction,
}

impl Must {
    fn holds(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Self::BeFinite => true,
                Self::BePositive => value > 0.0,
                Self::NotBeNegative => value >= 0.0,
                Self::BeFraction => (0.0..1.0).contains(&value),
            }
    }

    fn words(self) -> &'static str {
        match self {
            Self::BeFinite => "must be a finite number",
            Self::BePositive => "must be above zero and finite",
            Self::NotBeNegative => "must be zero or above and finite",
            Self::BeFraction => "must be at least 0 and below 1",
        }
    }
}

/// One number.
pub fn number(place: &Place, key: &str, value: f64, must: Must) -> Result<(), RobotError> {
    if must.holds(value) {
        return Ok(());
    }
    Err(place.invalid(format!("{key} = {value} {}", must.words())))
}

/// Several numbers under one key.
pub fn numbers(place: &Place, key: &str, values: &[f64], must: Must) -> Result<(), RobotError> {
    values
        .iter()
        .try_for_each(|value| number(place, key, *value, must))
}

/// Numbers that may be absent.
fn optional(place: &Place, key: &str, value: Option<f64>, must: Must) -> Result<(), RobotError> {
    value.map_or(Ok(()), |value| number(place, key, value, must))
}

pub fn is_usable_in_name(c: char) -> bool {
    !c.is_control() && !c.is_whitespace() && !matches!(c, ',' | '.' | '"')
}

pub fn is_usable_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(is_usable_in_name)
}

/// A name that can stand in a column heading `JOINT.SIGNAL`.
pub fn name(place: &Place, key: &str, name: &str) -> Result<(), RobotError> {
    if is_usable_name(name) {
        return Ok(());
    }
    let rule = "must not be empty nor hold spaces, commas, dots or quotes, because recordings use it in headings";
    Err(place.invalid(format!("{key} = {name:?} {rule}")))
}

/// Everything of a joint but its name.
pub fn joint(place: &Place, joint: &RobotJoint) -> Result<(), RobotError> {
    number(place, "gear_ratio", joint.gear_ratio, Must::BePositive)?;
    number(
        place,
        "rotor_inertia_kg_m2",
        joint.rotor_inertia_kg_m2,
        Must::NotBeNegative,
    )?;
    number(
        place,
        "position_noise_rad",
        joint.position_noise_rad,
        Must::NotBeNegative,
    )?;
    number(
        place,
        "torque_noise_nm",
        joint.torque_noise_nm,
        Must::NotBeNegative,
    )?;
    optional(
        place,
        "torque_limit_nm",
        joint.torque_limit_nm,
        Must::BePositive,
    )?;
    optional(
        place,
        "torque_constant_nm_a",
        joint.torque_constant_nm_a,
        Must::BePositive,
    )?;
    optional(
        place,
        "motor_encoder_resolution_rad",
        joint.motor_encoder_resolution_rad,
        Must::BePositive,
    )?;
    optional(
        place,
        "link_encoder_resolution_rad",
        joint.link_encoder_resolution_rad,
        Must::BePositive,
    )?;
    optional(
        place,
        "velocity_limit_rad_s",
        joint.velocity_limit_rad_s,
        Must::BePositive,
    )?;
    optional(
        place,
        "standstill_limit_rad",
        joint.standstill_limit_rad,
        Must::BePositive,
    )?;
    optional(
        place,
        "following_limit_rad",
        joint.following_limit_rad,
        Must::BePositive,
    )?;
    if let Some(brake) = joint.brake {
        number(
            place,
            "brake.release_s",
            brake.release_s,
            Must::NotBeNegative,
        )?;
        number(place, "brake.engage_s", brake.engage_s, Must::NotBeNegative)?;
    }
    if let Some([low, high]) = joint.position_limit_rad {
        numbers(place, "position_limit_rad", &[low, high], Must::BeFinite)?;
        if low >= high {
            return Err(place.invalid(format!(
                "position_limit_rad = [{low}, {high}] must be ascending"
            )));
        }
    }
    if let Some(friction) = &joint.direction_friction {
        stribeck(place, "direction_friction.positive", &friction.positive)?;
        stribeck(place, "direction_friction.negative", &friction.negative)?;
    }
    if let Some(torque) = &joint.load_torque {
        load(place, "load_torque.positive", &torque.positive)?;
        load(place, "load_torque.negative", &torque.negative)?;
    }
    if let Some(table) = &joint.friction_table {
        friction_table(place, table)?;
    }
    torque_tables(place, &joint.torque_tables)?;
    if let Some(estimators) = &joint.estimators {
        estimators.check(place)?;
    }
    effects(place, &joint.effects)
}

/// Two points make an interpolation. 4096 resolve a hundred times the 39 cycles per motor revolution that PA10-05,
/// Table III, reaches.
const TABLE_POINTS: RangeInclusive<usize> = 2..=4096;

fn friction_table(place: &Place, table: &FrictionTable) -> Result<(), RobotError> {
    let rows = [
        ("friction_table.positive_nm", &table.positive_nm),
        ("friction_table.negative_nm", &table.negative_nm),
    ];
    for (key, row_nm) in rows {
        if !TABLE_POINTS.contains(&row_nm.len()) {
            let (least, most) = TABLE_POINTS.into_inner();
            return Err(place.invalid(format!(
                "{key} has {} points, give {least} to {most}",
                row_nm.len()
            )));
        }
        numbers(place, key, row_nm, Must::BeFinite)?;
    }
    let (positive, negative) = (table.positive_nm.len(), table.negative_nm.len());
    if positive == negative {
        return Ok(());
    }
    Err(place.invalid(format!(
        "friction_table has {positive} points in positive_nm and {negative} in negative_nm, give both as many"
    )))
}

fn torque_tables(place: &Place, tables: &[TorqueTable]) -> Result<(), RobotError> {
    if tables.len() > TABLES_MAX {
        return Err(place.invalid(format!(
            "torque_tables has {} tables, a joint takes at most {TABLES_MAX}; add up those over one variable",
            tables.len()
        )));
    }
    for (index, table) in tables.iter().enumerate() {
        let key = |name: &str| format!("torque_tables {}: {name}", index + 1);
        let (corners, values) = (table.at.len(), table.torque_nm.len());
        if !TABLE_POINTS.contains(&corners) || corners != values {
            let (least, most) = TABLE_POINTS.into_inner();
            return Err(place.invalid(format!(
                "{} has {corners} corners and torque_nm {values} values, give {least} to {most}, of both as many",
                key("at")
            )));
        }
        numbers(place, &key("at"), &table.at, Must::BeFinite)?;
        numbers(place, &key("torque_nm"), &table.torque_nm, Must::BeFinite)?;
        if let Some(pair) = table.at.windows(2).find(|pair| pair[0] >= pair[1]) {
            return Err(place.invalid(format!(
                "{} has {} before {}, but corners must rise",
                key("at"),
                pair[0],
                pair[1]
            )));
        }
    }
    Ok(())
}

fn stribeck(place: &Place, key: &str, row: &StribeckRow) -> Result<(), RobotError> {
    number(
        place,
        &format!("{key}.f0_nm"),
        row.f0_nm,
        Must::NotBeNegative,
    )?;
    number(
        place,
        &format!("{key}.fv_nm_s_rad"),
        row.fv_nm_s_rad,
        Must::BeFinite,
    )?;
    number(place, &format!("{key}.fs_nm"), row.fs_nm, Must::BeFinite)?;
    number(
        place,
        &format!("{key}.vc_rad_s"),
        row.vc_rad_s,
        Must::BePositive,
    )
}

fn load(place: &Place, key: &str, row: &LoadTorqueRow) -> Result<(), RobotError> {
    numbers(place, &format!("{key}.slopes"), &row.slopes, Must::BeFinite)?;
    numbers(
        place,
        &format!("{key}.knees_nm"),
        &row.knees_nm,
        Must::BeFinite,
    )?;
    number(
        place,
        &format!("{key}.zero_load_nm"),
        row.zero_load_nm,
        Must::BeFinite,
    )?;
    let [first, second] = row.knees_nm;
    if first < second {
        return Ok(());
    }
    Err(place.invalid(format!(
        "{key}.knees_nm = [{first}, {second}] must be ascending, swap them"
    )))
}

/// Effects at one place. Entries of one kind add up, so of what adds up the sum must be possible: a file may hold a
/// stiffness and, beside it, a negative change of it. What shapes an entry must be possible in each.
pub fn effects(place: &Place, effects: &[Effect]) -> Result<(), RobotError> {
    let mut sums: BTreeMap<(&str, &str), (f64, Must)> = BTreeMap::new();
    let mut friction = SteadyFriction::default();
    for effect in effects {
        let name = effect.name();
        // writing an effect cannot fail: it is a flat table
        let values = toml::Table::try_from(effect).unwrap_or_default();
        for parameter in effect.kind().parameters() {
            let what = format!("effect {name}: {}", parameter.name);
            for value in values.get(parameter.name).into_iter().flat_map(floats) {
                number(place, &what, value, parameter.each)?;
                let sum = sums.entry((name, parameter.name));
                sum.or_insert((0.0, parameter.sum)).0 += value;
            }
        }
        thermal(place, effect)?;
        effect.act(&mut friction, 1.0).map_err(|full| {
            place.invalid(format!(
                "effect {name} stands there more than {} times; leave out the smallest",
                full.at_most
            ))
        })?;
    }
    sums.iter().try_for_each(|((effect, key), (sum, must))| {
        let what = format!("effect {effect}: {key}");
        number(place, &what, *sum, *must)
    })
}

/// A number, or the coordinates of a point.
fn floats(value: &toml::Value) -> Vec<f64> {
    match value {
        toml::Value::Array(list) => list.iter().filter_map(toml::Value::as_float).collect(),
        single => single.as_float().into_iter().collect(),
    }
}

fn thermal(place: &Place, effect: &Effect) -> Result<(), RobotError> {
    let Effect::ThermalFrictionDrift {
        drift_nm_s,
        time_constant_s,
        change_nm,
    } = effect
    else {
        return Ok(());
    };
    match (drift_nm_s, time_constant_s, change_nm) {
        (Some(_), None, None) | (None, Some(_), Some(_)) => Ok(()),
        _ => {
            Err(place.invalid("effect thermal_friction_drift: give drift_nm_s alone, or time_constant_s and change_nm"))
        }
    }
}

/// Tolerances and the names they stand under.
pub fn tolerance(file: &str, tolerance: &Tolerance) -> Result<(), RobotError> {
    let place = Place::new(file, "parameter_tolerance");
    let known: Vec<String> = PARAMETERS.map(str::to_owned).to_vec();
    number(&place, "default", tolerance.default, Must::NotBeNegative)?;
    for (name, value) in &tolerance.parameters {
        if !known.contains(name) {
            return Err(place.unknown("parameter", name, &known));
        }
        number(&place, name, *value, Must::NotBeNegative)?;
    }
    Ok(())
}

/// The controller; fills in the gains that its kind may leave out.
pub fn control(file: &str, control: &mut Control, joint_count: usize) -> Result<(), RobotError> {
    const FILTER_ORDER_MAX: u32 = 10;
    const DELAY_CYCLES_MAX: u32 = 1000;
    let place = Place::new(file, "control");
    if control.rate_hz == 0.0 {
        return Err(place.invalid(
            "rate_hz is missing or 0; give the controller's cycles per second, or kind = \"unknown\" and nothing else",
        ));
    }
    let needs_gains = matches!(
        control.kind,
        ControlKind::PdFeedforward | ControlKind::VelocityPi
    );
    gains(
        &place,
        "proportional_nm_rad",
        &mut control.proportional_nm_rad,
        joint_count,
        needs_gains,
    )?;
    gains(
        &place,
        "derivative_nm_s_rad",
        &mut control.derivative_nm_s_rad,
        joint_count,
        needs_gains,
    )?;
    number(&place, "rate_hz", control.rate_hz, Must::BePositive)?;
    number(
        &place,
        "velocity_filter_hz",
        control.velocity_filter_hz,
        Must::NotBeNegative,
    )?;
    let (filter_hz, nyquist_hz) = (control.velocity_filter_hz, control.rate_hz / 2.0);
    if filter_hz >= nyquist_hz {
        return Err(place.invalid(format!(
            "velocity_filter_hz = {filter_hz} must be below half of rate_hz, that is below {nyquist_hz}; 0 for no filter"
        )));
    }
    let (order, delay) = (control.velocity_filter_order, control.delay_cycles);
    if !(1..=FILTER_ORDER_MAX).contains(&order) {
        return Err(place.invalid(format!(
            "velocity_filter_order = {order} must be from 1 to {FILTER_ORDER_MAX}"
        )));
    }
    if delay > DELAY_CYCLES_MAX {
        return Err(place.invalid(format!(
            "delay_cycles = {delay} must be at most {DELAY_CYCLES_MAX}"
        )));
    }
    Ok(())
}

fn gains(
    place: &Place,
    key: &str,
    gains: &mut Vec<f64>,
    joints: usize,
    needed: bool,
) -> Result<(), RobotError> {
    if gains.is_empty() && !needed {
        gains.resize(joints, 0.0);
    }
    if gains.len() != joints {
        let found = gains.len();
        return Err(place.invalid(format!(
            "{key} has {found} values, give one for each of the {joints} joints"
        )));
    }
    numbers(place, key, gains, Must::NotBeNegative)
}
