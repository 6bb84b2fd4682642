//! What to do where no motion of the joint helps.

/// In words, for two effects that look alike on every motion.
pub fn advice(pair: &[String; 2]) -> &'static str {
    let has = |names: &[&str]| pair.iter().any(|effect| names.contains(&effect.as_str()));
    if has(&["command_delay"]) && has(&["sensor_delay"]) {
        "command and position show only the sum of both delays; compare the time stamps of the drive's latch"
    } else if has(&["thermal_friction_drift"]) {
        "let the joint cool down and repeat the recording cold and warm"
    } else if has(&["torque_constant_error"]) {
        "repeat the recording with another payload whose mass is known, or turn the joint by hand with the motor unpowered and measure the force"
    } else if has(&["torque_offset", "torque_ripple", "torque_saturation"]) {
        "turn the joint by hand with the motor unpowered and measure the force: what the motor does is then gone"
    } else if has(&["payload", "gravity_torque", "base_tilt", "link_inertia"]) {
        "repeat the recording with another payload whose mass is known, and level the base"
    } else if has(&["encoder_offset", "encoder_eccentricity", "kinematic_error"]) {
        "measure the link's angle from outside at a few poses"
    } else {
        "turn the joint by hand with the motor unpowered and measure the force at several speeds"
    }
}
