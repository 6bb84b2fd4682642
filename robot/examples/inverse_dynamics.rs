//! Prints what a robot is and the torques of random motions, as JSON: to compare with what another program makes of the file.
//!
//! `cargo run --release -p robot --example inverse_dynamics -- arm.urdf [MOTIONS]`
#![allow(clippy::unwrap_used, reason = "an example may end there")]

use serde_json::json;

/// A number between -1 and 1 that looks random: the fractional part of a multiple of the golden ratio.
fn scattered(index: usize) -> f64 {
    let turned = (index as f64 + 1.0) * 0.618_033_988_749_894_9;
    2.0 * turned.fract() - 1.0
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().unwrap_or_else(|| "pa10".to_owned());
    let count: usize = arguments.next().map_or(5, |text| text.parse().unwrap());
    let robot = match robot::load(&path) {
        Ok(robot) => robot,
        Err(error) => {
            println!("{}", json!({ "refused": error.to_string() }));
            return;
        }
    };
    let joints = robot.joints.len();
    let motions: Vec<_> = (0..count)
        .map(|motion| {
            let values = |part: usize, most: f64| -> Vec<f64> {
                let start = (3 * motion + part) * joints;
                (start..start + joints)
                    .map(|index| most * scattered(index))
                    .collect()
            };
            let (q, dq, ddq) = (values(0, 2.0), values(1, 3.0), values(2, 5.0));
            let mut torque = vec![0.0; joints];
            robot.chain.inverse_dynamics(&q, &dq, &ddq, &mut torque);
            json!({ "position": q, "velocity": dq, "acceleration": ddq, "torque": torque })
        })
        .collect();
    let names = robot.joint_names();
    let inertias: Vec<f64> = robot
        .joints
        .iter()
        .map(|joint| joint.rotor_inertia_kg_m2 * joint.gear_ratio.powi(2))
        .collect();
    println!(
        "{}",
        json!({
            "name": robot.name,
            "joints": names,
            "gravity": robot.chain.gravity_m_s2().as_slice(),
            "rotor_inertia": inertias,
            "notes": robot.notes,
            "motions": motions,
        })
    );
}
