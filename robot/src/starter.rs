//! A commented robot file to begin with.

use std::fmt::Write;

use crate::description::Description;
use crate::error::{Place, RobotError};
use crate::robot::load_raw;
use crate::{Robot, RobotJoint, Source, load};

/// What a joint's table may say beside what a description does.
const OF_A_JOINT: &str = "\
# gear_ratio = 100.0                    # motor turns per joint turn; 1 as it stands
# rotor_inertia_kg_m2 = 1e-5            # motor side; none as it stands
# torque_limit_nm = 0.5                 # motor side
# torque_constant_nm_a = 0.05           # motor side
# motor_encoder_resolution_rad = 1e-3   # motor side; unknown as it stands
# link_encoder_resolution_rad = 1e-5    # joint side
# position_noise_rad = 1e-5             # standard deviations of the sensors' noise
# torque_noise_nm = 0.001
# effects = [                           # what you know of friction and the gear, at the joint
#   { effect = \"coulomb_friction\", coulomb_nm = 2.0 },
#   { effect = \"viscous_friction\", viscous_nm_s_rad = 1.0 },
#   { effect = \"torsional_compliance\", stiffness_nm_rad = 8000.0 },
# ]
";

const OF_CONTROL: &str = "\
# What made the torques while the robot was recorded. Where you do not know it, leave it out.
# [control]
# kind = \"pd\"                           # or \"velocity_pi\", \"open_loop_torque\"
# rate_hz = 1000.0
";

/// A robot without a description: one link that hangs from a hinge.
const WITHOUT_DESCRIPTION: &str = "\
# A robot of [[link]] tables, each on the one before it, and a [[joint]] for the drive of each.
# Lines that begin with `#` say what else there is. Put your numbers in the place of these.
name = \"bench\"
gravity_m_s2 = [0.0, 0.0, -9.81]
parameter_tolerance = 0.02              # how well the values below are known: relative, one standard deviation

[[link]]
joint = \"shoulder\"                      # the joint that carries it
origin_m = [0.0, 0.0, 0.3]              # the joint's frame in the parent's
origin_rpy_rad = [0.0, 0.0, 0.0]        # fixed axes: roll, pitch, yaw
axis = [0.0, 1.0, 0.0]                  # in the joint's frame
# kind = \"prismatic\"                    # it slides: read rad as m and Nm as N
# parent = \"base\"                       # another link's joint, where it is not the one before
mass_kg = 2.0
centre_of_mass_m = [0.0, 0.0, -0.2]     # in the joint's frame
inertia_kg_m2 = { xx = 0.02, yy = 0.02, zz = 0.004 }    # about the centre of mass

[[joint]]
name = \"shoulder\"                       # as recordings call it
# position_limit_rad = [-2.0, 2.0]
# velocity_limit_rad_s = 3.0
";

/// The text of a commented robot file: for a URDF or a MuJoCo model, which the file names as `named`, or for no description
/// at all. It loads as it stands, and says what the description does.
///
/// # Errors
/// [`RobotError`] if the description cannot be read, or is a robot file already.
pub fn starter(description: Option<&str>, named: &str) -> Result<String, RobotError> {
    let Some(path) = description else {
        return Ok(format!(
            "{WITHOUT_DESCRIPTION}{OF_A_JOINT}\n{OF_CONTROL}{}",
            gains(1)
        ));
    };
    let (text, source) = load_raw(path)?;
    let is_file = matches!(source, Source::File(_));
    let kind = Description::of(&text, path)?.filter(|_| is_file);
    let Some(kind) = kind else {
        return Err(Place::new(path, "")
            .invalid("is a robot file already; `robot check` tells what is in it"));
    };
    let robot = load(path)?;
    let key = kind.key();
    let mut file = format!(
        "# A robot file for {named}, which says the masses, frames and limits.\n\
         # Lines that begin with `#` are what it does not say: put in what you know, and leave the rest.\n\
         name = {}\n{key} = {}\n\
         # gravity_m_s2 = {:?}\n\
         # parameter_tolerance = 0.02            # how well the values are known: relative, one standard deviation\n\
         # held = {{ gripper = 0.02 }}             # joints that do not move, rad or m; those without a table below are at 0\n",
        quoted(&robot.name),
        quoted(named),
        <[f64; 3]>::from(robot.chain.gravity_m_s2()),
    );
    for note in &robot.notes {
        let _ = writeln!(file, "# {note}");
    }
    for joint in &robot.joints {
        let _ = write!(
            file,
            "\n[[joint]]\nname = {}\n{}{OF_A_JOINT}",
            quoted(&joint.name),
            said(joint, named)
        );
    }
    let _ = write!(file, "\n{}", control(&robot, named));
    Ok(file)
}

fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}

/// What the description says of a joint, for people to read.
fn said(joint: &RobotJoint, named: &str) -> String {
    let mut parts = Vec::new();
    if joint.gear_ratio != 1.0 {
        parts.push(format!("gear ratio {}", joint.gear_ratio));
    }
    if joint.rotor_inertia_kg_m2 != 0.0 {
        parts.push(format!("rotor inertia {} kg m²", joint.rotor_inertia_kg_m2));
    }
    if let Some(limit_nm) = joint.torque_limit_nm {
        parts.push(format!("largest torque {limit_nm} Nm"));
    }
    if let Some([low, high]) = joint.position_limit_rad {
        parts.push(format!("{low} to {high} rad"));
    }
    if let Some(limit) = joint.velocity_limit_rad_s {
        parts.push(format!("at most {limit} rad/s"));
    }
    parts.extend(joint.effects.iter().map(|effect| effect.name().to_owned()));
    if parts.is_empty() {
        return String::new();
    }
    // a table without it takes the description's, but for the ratio, which a table says itself
    let ratio = if joint.gear_ratio == 1.0 {
        String::new()
    } else {
        format!("gear_ratio = {:?}\n", joint.gear_ratio)
    };
    format!("# {named} says: {}\n{ratio}", parts.join(", "))
}

fn control(robot: &Robot, named: &str) -> String {
    match &robot.control {
        Some(control) => format!(
            "# {named} says the controller: {} Hz, proportional {:?}, derivative {:?}.\n\
             # A table [control] takes its place.\n",
            control.rate_hz, control.proportional_nm_rad, control.derivative_nm_s_rad
        ),
        None => format!("{OF_CONTROL}{}", gains(robot.joints.len())),
    }
}

fn gains(count: usize) -> String {
    format!(
        "# proportional_nm_rad = {:?}   # joint side, in the order of the tables above\n\
         # derivative_nm_s_rad = {:?}\n",
        vec![100.0; count],
        vec![10.0; count]
    )
}
