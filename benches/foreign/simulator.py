"""A closed loop of arm, gears, drives, encoders and controller, made without a line of Flexspline's.

What it does otherwise than Flexspline's twin and emulator: semi-implicit Euler steps of 50 us with the friction's slope taken
implicitly, the mass matrix from inverse dynamics of unit accelerations and Gaussian elimination, friction as a steep tanh or as
LuGre bristles, and first-order filters by the bilinear transform. Noise and losses are arguments: the same arguments give the
same bytes.

Torques are joint side unless a name says `motor_nm`. So are angles, those of the motor too; only what a recorder gets of the motor
(`Outcome.motor_position_rad`, `motor_velocity_rad_s`) is before the gear, as recordings have it.

Order within a cycle: encoders are read, the controller computes a command from them, the command of `delay_cycles` ago becomes
the drive's. The torque of a row is the one that the drive makes until then.
"""

import math
from collections import namedtuple

import numpy as np
from numba import njit

STEPS_PER_S = 20_000
TANH, LUGRE = 0, 1
PD_FEEDFORWARD, PD_GRAVITY, COMPUTED_TORQUE, VELOCITY_PI = 0, 1, 2, 3
FEED_NOTHING, FEED_RIGID_BODY, FEED_MODEL = 0, 1, 2

# One joint's drive, gear, friction and surroundings. Zero leaves an effect out, stiffness zero makes the gear rigid.
JOINT = np.dtype(
    [
        (name, np.float64)
        for name in """
        gear_ratio rotor_inertia_kg_m2
        stiffness_nm_rad damping_nm_s_rad
        low_stiffness_nm_rad knee_nm backlash_rad
        hysteresis_nm hysteresis_yield_rad
        structural_damping_nm structural_damping_exponent
        kinematic_error_rad kinematic_error_cycles kinematic_error_phase_rad
        bristles presliding
        coulomb_nm viscous_nm_s_rad quadratic_nm_s2_rad2 cubic_nm_s3_rad3
        stribeck_nm stribeck_velocity_rad_s stribeck_exponent
        asymmetry_nm load_coefficient
        friction_wave_nm friction_wave_cycles friction_wave_phase_rad
        friction_drift_nm_s friction_change_nm friction_change_s
        friction_step_nm friction_step_s
        bump_nm bump_at_rad bump_width_rad
        ageing_nm ageing_s
        torque_gain torque_offset_nm torque_limit_motor_nm drive_lag_s
        ripple_motor_nm ripple_cycles ripple_phase_rad
        gravity_sin_nm gravity_cos_nm spring_nm_rad spring_rest_rad added_link_inertia_kg_m2
        wall_nm_rad wall_at_rad vibration_nm vibration_hz coupling_nm
        encoder_offset_rad eccentricity_rad eccentricity_cycles eccentricity_phase_rad
        """.split()
    ]
)

# Rigid bodies, base first: each joint's frame in its parent's (origin, rotation), its axis, and its link's mass, centre and
# inertia about the centre.
Chain = namedtuple("Chain", "origin_m rotation axis mass_kg centre_m inertia_kg_m2")
# Work space of `inverse_dynamics`, per link: its frame's rotation in the parent's, and what its joint transmits.
Work = namedtuple("Work", "rotation force_n moment_nm")
# Per joint. `bristle_rad` is LuGre's deflection, `wound` the hysteresis' share of its most, `rested_s` for how long the contact
# has been at rest; the torques and the acceleration are those of the step before.
State = namedtuple(
    "State",
    "motor_rad motor_rad_s link_rad link_rad_s link_rad_s2 bristle_rad wound rested_s friction_nm drive_motor_nm",
)
# Of the controller's low-pass: position, difference quotient and output of the row before.
Filter = namedtuple("Filter", "position_rad rate_rad_s output_rad_s")
# Per row: what the joint was asked to do, the time, and whether a trajectory begins there (the arm is then at rest).
Course = namedtuple("Course", "time_s position_rad velocity_rad_s acceleration_rad_s2 begins")
# `chain` to `joints` are those of the robot file: what the controller believes.
Control = namedtuple(
    "Control", "kind feedforward proportional derivative velocity_filter_hz delay_cycles chain gravity_m_s2 joints"
)
# `torque_noise_motor_nm` and `command_lost` have a value per row, resolutions one per joint; zero is exact.
Disturbance = namedtuple(
    "Disturbance",
    "command_delay_s sensor_delay_s command_lost torque_noise_motor_nm motor_resolution_rad link_resolution_rad",
)
# The first five are what a recorder sees, the rest is what really happened.
Outcome = namedtuple(
    "Outcome",
    "drive_torque_motor_nm command_torque_motor_nm motor_position_rad link_position_rad motor_velocity_rad_s "
    "true_link_rad true_link_rad_s true_motor_rad true_motor_rad_s true_friction_nm true_drive_motor_nm",
)


def joint_parameters():
    """A joint without any effect; the values that divide something are there."""
    joint = np.zeros(1, JOINT)
    joint["torque_gain"] = 1.0
    joint["presliding"] = 1e-3
    for name in "stribeck_velocity_rad_s stribeck_exponent hysteresis_yield_rad structural_damping_exponent".split():
        joint[name] = 1.0
    for name in "friction_change_s ageing_s bump_width_rad".split():
        joint[name] = 1.0
    return joint[0]


@njit(cache=True)
def work_space(joint_count):
    return Work(np.zeros((joint_count, 3, 3)), np.zeros((joint_count, 3)), np.zeros((joint_count, 3)))


@njit(cache=True)
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def plus(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@njit(cache=True)
def times(scale, a):
    return scale * a[0], scale * a[1], scale * a[2]


@njit(cache=True)
def row(matrix, k):
    return matrix[k, 0], matrix[k, 1], matrix[k, 2]


@njit(cache=True)
def turned(matrix, a):
    return (
        matrix[0, 0] * a[0] + matrix[0, 1] * a[1] + matrix[0, 2] * a[2],
        matrix[1, 0] * a[0] + matrix[1, 1] * a[1] + matrix[1, 2] * a[2],
        matrix[2, 0] * a[0] + matrix[2, 1] * a[1] + matrix[2, 2] * a[2],
    )


@njit(cache=True)
def turned_back(matrix, a):
    return (
        matrix[0, 0] * a[0] + matrix[1, 0] * a[1] + matrix[2, 0] * a[2],
        matrix[0, 1] * a[0] + matrix[1, 1] * a[1] + matrix[2, 1] * a[2],
        matrix[0, 2] * a[0] + matrix[1, 2] * a[1] + matrix[2, 2] * a[2],
    )


@njit(cache=True)
def set_joint_rotation(fixed, axis, angle_rad, rotation):
    """The child frame in the parent's: the fixed rotation, then Rodrigues' about the axis."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    v = 1.0 - c
    x, y, z = axis[0], axis[1], axis[2]
    first = (c + x * x * v, x * y * v - z * s, x * z * v + y * s)
    second = (y * x * v + z * s, c + y * y * v, y * z * v - x * s)
    third = (z * x * v - y * s, z * y * v + x * s, c + z * z * v)
    for a in range(3):
        for b in range(3):
            rotation[a, b] = fixed[a, 0] * first[b] + fixed[a, 1] * second[b] + fixed[a, 2] * third[b]


@njit(cache=True)
def inverse_dynamics(position_rad, velocity_rad_s, acceleration_rad_s2, gravity_m_s2, chain, work, torque_nm):
    """Newton-Euler: the joint torques that make this acceleration, into `torque_nm`."""
    joint_count = position_rad.shape[0]
    turn_rad_s = turn_rad_s2 = (0.0, 0.0, 0.0)
    # gravity is an upward acceleration of the base
    acceleration_m_s2 = (-gravity_m_s2[0], -gravity_m_s2[1], -gravity_m_s2[2])
    for i in range(joint_count):
        rotation = work.rotation[i]
        set_joint_rotation(chain.rotation[i], chain.axis[i], position_rad[i], rotation)
        origin_m, axis, centre_m = row(chain.origin_m, i), row(chain.axis, i), row(chain.centre_m, i)
        at_origin_m_s2 = plus(
            plus(acceleration_m_s2, cross(turn_rad_s2, origin_m)), cross(turn_rad_s, cross(turn_rad_s, origin_m))
        )
        acceleration_m_s2 = turned_back(rotation, at_origin_m_s2)
        turn_rad_s, turn_rad_s2 = turned_back(rotation, turn_rad_s), turned_back(rotation, turn_rad_s2)
        own_rad_s = times(velocity_rad_s[i], axis)
        turn_rad_s2 = plus(plus(turn_rad_s2, times(acceleration_rad_s2[i], axis)), cross(turn_rad_s, own_rad_s))
        turn_rad_s = plus(turn_rad_s, own_rad_s)
        at_centre_m_s2 = plus(
            plus(acceleration_m_s2, cross(turn_rad_s2, centre_m)), cross(turn_rad_s, cross(turn_rad_s, centre_m))
        )
        force_n = times(chain.mass_kg[i], at_centre_m_s2)
        inertia = chain.inertia_kg_m2[i]
        moment_nm = plus(turned(inertia, turn_rad_s2), cross(turn_rad_s, turned(inertia, turn_rad_s)))
        moment_nm = plus(moment_nm, cross(centre_m, force_n))
        for a in range(3):
            work.force_n[i, a], work.moment_nm[i, a] = force_n[a], moment_nm[a]
    for i in range(joint_count - 1, -1, -1):
        moment_nm = row(work.moment_nm, i)
        torque_nm[i] = chain.axis[i, 0] * moment_nm[0] + chain.axis[i, 1] * moment_nm[1] + chain.axis[i, 2] * moment_nm[2]
        if i > 0:
            force_n = turned(work.rotation[i], row(work.force_n, i))
            moment_nm = plus(turned(work.rotation[i], moment_nm), cross(row(chain.origin_m, i), force_n))
            for a in range(3):
                work.force_n[i - 1, a] += force_n[a]
                work.moment_nm[i - 1, a] += moment_nm[a]


@njit(cache=True)
def set_mass_matrix(position_rad, chain, work, mass_kg_m2, unit, column):
    """Column by column: the torques of a unit acceleration without gravity and speed. `unit` and `column` are work space."""
    joint_count = position_rad.shape[0]
    still = np.zeros(3)
    rest = np.zeros(joint_count)
    for j in range(joint_count):
        unit[:] = 0.0
        unit[j] = 1.0
        inverse_dynamics(position_rad, rest, unit, still, chain, work, column)
        mass_kg_m2[:, j] = column


@njit(cache=True)
def solve(matrix, right):
    """Gaussian elimination without pivots (a mass matrix is positive definite); the result replaces `right`."""
    size = right.shape[0]
    for k in range(size):
        for i in range(k + 1, size):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k, size):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for i in range(size - 1, -1, -1):
        total = right[i]
        for j in range(i + 1, size):
            total -= matrix[i, j] * right[j]
        right[i] = total / matrix[i, i]


@njit(cache=True)
def surroundings_nm(joint, position_rad, next_position_rad, time_s):
    """What a spring, an offset of gravity or a law on no list asks of the joint beside its links."""
    torque_nm = joint.gravity_sin_nm * math.sin(position_rad) + joint.gravity_cos_nm * math.cos(position_rad)
    torque_nm += joint.spring_nm_rad * (position_rad - joint.spring_rest_rad)
    if joint.wall_nm_rad != 0.0 and position_rad > joint.wall_at_rad:
        torque_nm += joint.wall_nm_rad * (position_rad - joint.wall_at_rad)
    if joint.vibration_nm != 0.0:
        torque_nm += joint.vibration_nm * math.sin(2.0 * math.pi * joint.vibration_hz * time_s)
    return torque_nm + joint.coupling_nm * math.sin(2.0 * next_position_rad)


@njit(cache=True)
def gear(joint, motor_rad, motor_rad_s, link_rad, link_rad_s, wound, step_s):
    """Torque of an elastic gear on the link, its lever arm on the motor, and how far the hysteresis is wound up."""
    shift_rad, lever = 0.0, 1.0
    if joint.kinematic_error_rad != 0.0:
        angle_rad = joint.kinematic_error_cycles * motor_rad * joint.gear_ratio + joint.kinematic_error_phase_rad
        shift_rad = joint.kinematic_error_rad * math.sin(angle_rad)
        # the shift's slope over the motor's angle, so that the gear makes no energy
        lever += joint.kinematic_error_rad * joint.kinematic_error_cycles * joint.gear_ratio * math.cos(angle_rad)
    twist_rad, twist_rad_s = motor_rad + shift_rad - link_rad, motor_rad_s * lever - link_rad_s
    if joint.backlash_rad > 0.0:
        half_rad = 0.5 * joint.backlash_rad
        if abs(twist_rad) > half_rad:
            twist_rad -= math.copysign(half_rad, twist_rad)
        else:
            twist_rad, twist_rad_s = 0.0, 0.0
    torque_nm = joint.stiffness_nm_rad * twist_rad
    if joint.knee_nm > 0.0:
        knee_rad = joint.knee_nm / joint.low_stiffness_nm_rad
        if abs(twist_rad) < knee_rad:
            torque_nm = joint.low_stiffness_nm_rad * twist_rad
        else:
            beyond_rad = abs(twist_rad) - knee_rad
            torque_nm = math.copysign(joint.knee_nm + joint.stiffness_nm_rad * beyond_rad, twist_rad)
    if joint.hysteresis_nm != 0.0:
        # Bouc-Wen with exponent one: saturates on the way up, straight on the way back
        up = 0.5 + 0.5 * math.copysign(1.0, wound * twist_rad_s)
        wound += step_s * (twist_rad_s / joint.hysteresis_yield_rad) * (1.0 - abs(wound) * up)
        torque_nm += joint.hysteresis_nm * wound
    torque_nm += joint.damping_nm_s_rad * twist_rad_s
    if joint.structural_damping_nm != 0.0 and abs(twist_rad_s) > 1e-9:
        magnitude_nm = joint.structural_damping_nm * abs(twist_rad_s) ** joint.structural_damping_exponent
        torque_nm += math.copysign(magnitude_nm, twist_rad_s)
    return torque_nm, lever, wound


@njit(cache=True)
def friction_level_nm(joint, motor_rad, motor_rad_s, link_rad, load_nm, rested_s, time_s):
    """What dry friction comes to while sliding; never negative."""
    speed_rad_s = abs(motor_rad_s)
    level_nm = joint.coulomb_nm + joint.friction_drift_nm_s * time_s + joint.load_coefficient * abs(load_nm)
    if joint.friction_change_nm != 0.0:
        level_nm += joint.friction_change_nm * (1.0 - math.exp(-time_s / joint.friction_change_s))
    if joint.friction_step_nm != 0.0 and time_s > joint.friction_step_s:
        level_nm += joint.friction_step_nm
    if joint.stribeck_nm != 0.0:
        ratio = speed_rad_s / joint.stribeck_velocity_rad_s
        level_nm += joint.stribeck_nm * math.exp(-(ratio**joint.stribeck_exponent))
    if joint.friction_wave_nm != 0.0:
        angle_rad = joint.friction_wave_cycles * motor_rad * joint.gear_ratio + joint.friction_wave_phase_rad
        level_nm += joint.friction_wave_nm * math.sin(angle_rad)
    if joint.bump_nm != 0.0:
        level_nm += joint.bump_nm * math.exp(-0.5 * ((link_rad - joint.bump_at_rad) / joint.bump_width_rad) ** 2)
    if joint.ageing_nm != 0.0:
        level_nm += joint.ageing_nm * math.log(1.0 + rested_s / joint.ageing_s)
    if joint.asymmetry_nm != 0.0:
        level_nm += joint.asymmetry_nm * math.tanh(motor_rad_s / 0.002)
    return max(level_nm, 0.0)


@njit(cache=True)
def rest_of(rested_s, speed_rad_s, step_s):
    """How long the contact has rested: it grows below 0.01 rad/s and is forgotten within 0.02 rad of travel."""
    if speed_rad_s < 0.01:
        return rested_s + step_s
    return max(rested_s - step_s * rested_s * speed_rad_s / 0.02, 0.0)


@njit(cache=True)
def friction(joint, level_nm, motor_rad_s, bristle_rad, step_s):
    """Torque, its slope over speed for the implicit step, and the bristles' deflection."""
    speed_rad_s = abs(motor_rad_s)
    if joint.bristles == LUGRE:
        stiffness_nm_rad = joint.coulomb_nm / joint.presliding
        # implicit in the deflection: stable however stiff the bristles are
        slip = step_s * stiffness_nm_rad * speed_rad_s / max(level_nm, 1e-6)
        bent_rad = (bristle_rad + step_s * motor_rad_s) / (1.0 + slip)
        inertia_kg_m2 = joint.gear_ratio * joint.gear_ratio * joint.rotor_inertia_kg_m2
        # micro-damping that fades with speed
        damping_nm_s_rad = 0.3 * math.sqrt(stiffness_nm_rad * inertia_kg_m2) * math.exp(-((speed_rad_s / 0.01) ** 2))
        torque_nm = stiffness_nm_rad * bent_rad + damping_nm_s_rad * (bent_rad - bristle_rad) / step_s
        slope_nm_s_rad = damping_nm_s_rad + step_s * stiffness_nm_rad
    else:
        bent_rad = bristle_rad
        sign = math.tanh(motor_rad_s / joint.presliding)
        torque_nm = level_nm * sign
        slope_nm_s_rad = level_nm / joint.presliding * (1.0 - sign * sign)
    torque_nm += joint.viscous_nm_s_rad * motor_rad_s + joint.quadratic_nm_s2_rad2 * motor_rad_s * speed_rad_s
    torque_nm += joint.cubic_nm_s3_rad3 * motor_rad_s**3
    return torque_nm, slope_nm_s_rad + joint.viscous_nm_s_rad, bent_rad


@njit(cache=True)
def feed_model(control, course, k, work, torque_nm):
    """What the robot file says that the reference takes."""
    velocity_rad_s, acceleration_rad_s2 = course.velocity_rad_s[k], course.acceleration_rad_s2[k]
    position_rad = course.position_rad[k]
    inverse_dynamics(position_rad, velocity_rad_s, acceleration_rad_s2, control.gravity_m_s2, control.chain, work, torque_nm)
    for i in range(torque_nm.shape[0]):
        joint = control.joints[i]
        torque_nm[i] += joint.gear_ratio**2 * joint.rotor_inertia_kg_m2 * acceleration_rad_s2[i]
        if control.feedforward == FEED_MODEL:
            level_nm = joint.coulomb_nm
            if joint.stribeck_nm != 0.0:
                level_nm += joint.stribeck_nm * math.exp(-abs(velocity_rad_s[i]) / joint.stribeck_velocity_rad_s)
            torque_nm[i] += level_nm * math.tanh(velocity_rad_s[i] / 0.005) + joint.viscous_nm_s_rad * velocity_rad_s[i]


@njit(cache=True)
def compute_command(control, course, k, loop_hz, position_rad, velocity_rad_s, sum_rad, work, torque_nm):
    """The controller's torque; `sum_rad` is the velocity error's integral."""
    joint_count = torque_nm.shape[0]
    kind = control.kind
    error_rad = course.position_rad[k] - position_rad
    error_rad_s = course.velocity_rad_s[k] - velocity_rad_s
    if kind == COMPUTED_TORQUE:
        wanted_rad_s2 = course.acceleration_rad_s2[k] + control.proportional * error_rad + control.derivative * error_rad_s
        inverse_dynamics(
            position_rad, velocity_rad_s, wanted_rad_s2, control.gravity_m_s2, control.chain, work, torque_nm
        )
        for i in range(joint_count):
            joint = control.joints[i]
            torque_nm[i] += joint.gear_ratio**2 * joint.rotor_inertia_kg_m2 * wanted_rad_s2[i]
        return
    torque_nm[:] = 0.0
    if kind == PD_GRAVITY:
        rest = np.zeros(joint_count)
        inverse_dynamics(position_rad, rest, rest, control.gravity_m_s2, control.chain, work, torque_nm)
    elif control.feedforward != FEED_NOTHING:
        feed_model(control, course, k, work, torque_nm)
    if kind == VELOCITY_PI:
        sum_rad += error_rad_s / loop_hz
        error_rad = sum_rad
    torque_nm += control.proportional * error_rad + control.derivative * error_rad_s


@njit(cache=True)
def rounded(value, resolution):
    return math.floor(value / resolution + 0.5) * resolution if resolution > 0.0 else value


@njit(cache=True)
def seen_by_encoders(joint, motor_rad, link_rad):
    """Both encoders' angles before they are rounded, the motor's before the gear."""
    link_rad += joint.encoder_offset_rad
    if joint.eccentricity_rad != 0.0:
        angle_rad = joint.eccentricity_cycles * link_rad + joint.eccentricity_phase_rad
        link_rad += joint.eccentricity_rad * math.sin(angle_rad)
    return (motor_rad + joint.encoder_offset_rad) * joint.gear_ratio, link_rad


@njit(cache=True)
def set_velocity(low_pass, position_rad, loop_hz, cutoff_hz, begins):
    """Backward difference and first-order low-pass (bilinear transform); a cut-off of zero leaves the difference."""
    warp = math.tan(math.pi * cutoff_hz / loop_hz)
    for i in range(position_rad.shape[0]):
        if begins:
            low_pass.position_rad[i] = position_rad[i]
            low_pass.rate_rad_s[i] = low_pass.output_rad_s[i] = 0.0
        rate_rad_s = (position_rad[i] - low_pass.position_rad[i]) * loop_hz
        if warp > 0.0:
            sum_rad_s = (1.0 - warp) * low_pass.output_rad_s[i] + warp * (rate_rad_s + low_pass.rate_rad_s[i])
            low_pass.output_rad_s[i] = sum_rad_s / (1.0 + warp)
        else:
            low_pass.output_rad_s[i] = rate_rad_s
        low_pass.position_rad[i], low_pass.rate_rad_s[i] = position_rad[i], rate_rad_s


@njit(cache=True)
def put_at_rest(state, position_rad, joints, chain, gravity_m_s2, work, torque_nm):
    """The arm held still, its gears twisted and its drives loaded by gravity."""
    state.motor_rad[:], state.link_rad[:] = position_rad, position_rad
    state.motor_rad_s[:], state.link_rad_s[:], state.link_rad_s2[:] = 0.0, 0.0, 0.0
    state.bristle_rad[:], state.wound[:] = 0.0, 0.0
    inverse_dynamics(position_rad, state.link_rad_s, state.link_rad_s, gravity_m_s2, chain, work, torque_nm)
    for i in range(joints.shape[0]):
        state.drive_motor_nm[i] = torque_nm[i] / joints[i].gear_ratio
        if joints[i].stiffness_nm_rad > 0.0:
            state.motor_rad[i] += torque_nm[i] / joints[i].stiffness_nm_rad


@njit(cache=True)
def drive_nm(joint, state, i, wanted_motor_nm, step_s):
    """What the drive puts on the motor's shaft, joint side; its own report lacks gain, ripple and offset."""
    if joint.torque_limit_motor_nm > 0.0:
        wanted_motor_nm = min(max(wanted_motor_nm, -joint.torque_limit_motor_nm), joint.torque_limit_motor_nm)
    if joint.drive_lag_s > 0.0:
        wanted_motor_nm -= (wanted_motor_nm - state.drive_motor_nm[i]) * math.exp(-step_s / joint.drive_lag_s)
    state.drive_motor_nm[i] = wanted_motor_nm
    made_motor_nm = wanted_motor_nm * joint.torque_gain
    if joint.ripple_motor_nm != 0.0:
        angle_rad = joint.ripple_cycles * state.motor_rad[i] * joint.gear_ratio + joint.ripple_phase_rad
        made_motor_nm += joint.ripple_motor_nm * math.sin(angle_rad)
    return made_motor_nm * joint.gear_ratio + joint.torque_offset_nm


@njit(cache=True)
def advance(state, wanted_motor_nm, time_s, step_s, joints, chain, gravity_m_s2, work, mass_kg_m2, spare):
    """One step of the arm. `spare` is work space of four rows."""
    n = joints.shape[0]
    rest, asked_nm, right, unit = spare[0], spare[1], spare[2], spare[3]
    rest[:] = 0.0
    inverse_dynamics(state.link_rad, state.link_rad_s, rest, gravity_m_s2, chain, work, asked_nm)
    set_mass_matrix(state.link_rad, chain, work, mass_kg_m2, unit, right)
    for i in range(n):
        joint = joints[i]
        motor_rad, motor_rad_s, link_rad = state.motor_rad[i], state.motor_rad_s[i], state.link_rad[i]
        made_nm = drive_nm(joint, state, i, wanted_motor_nm[i], step_s)
        asked_nm[i] += surroundings_nm(joint, link_rad, state.link_rad[(i + 1) % n], time_s)
        mass_kg_m2[i, i] += joint.added_link_inertia_kg_m2
        elastic = joint.stiffness_nm_rad > 0.0
        if elastic:
            load_nm, lever, state.wound[i] = gear(
                joint, motor_rad, motor_rad_s, link_rad, state.link_rad_s[i], state.wound[i], step_s
            )
        else:
            load_nm, lever = asked_nm[i], 1.0
            for j in range(n):
                load_nm += mass_kg_m2[i, j] * state.link_rad_s2[j]
        state.rested_s[i] = rest_of(state.rested_s[i], abs(motor_rad_s), step_s)
        level_nm = friction_level_nm(joint, motor_rad, motor_rad_s, link_rad, load_nm, state.rested_s[i], time_s)
        friction_nm, slope_nm_s_rad, state.bristle_rad[i] = friction(
            joint, level_nm, motor_rad_s, state.bristle_rad[i], step_s
        )
        state.friction_nm[i] = friction_nm
        # the friction's slope counts as inertia, which makes its step implicit
        resisting_kg_m2 = joint.gear_ratio**2 * joint.rotor_inertia_kg_m2 + step_s * slope_nm_s_rad
        if elastic:
            state.motor_rad_s[i] += step_s * (made_nm - friction_nm - load_nm * lever) / resisting_kg_m2
            state.motor_rad[i] += step_s * state.motor_rad_s[i]
            right[i] = load_nm - asked_nm[i]
        else:
            right[i] = made_nm - friction_nm - asked_nm[i]
            mass_kg_m2[i, i] += resisting_kg_m2
    solve(mass_kg_m2, right)
    for i in range(n):
        state.link_rad_s2[i] = right[i]
        state.link_rad_s[i] += step_s * right[i]
        state.link_rad[i] += step_s * state.link_rad_s[i]
        if joints[i].stiffness_nm_rad == 0.0:
            state.motor_rad[i], state.motor_rad_s[i] = state.link_rad[i], state.link_rad_s[i]


@njit(cache=True)
def simulate(loop_hz, course, joints, chain, gravity_m_s2, control, disturbance):
    """The closed loop along a course: an Outcome of a value per row and joint."""
    rows, n = course.position_rad.shape
    o = np.zeros((11, rows, n))
    outcome = Outcome(o[0], o[1], o[2], o[3], o[4], o[5], o[6], o[7], o[8], o[9], o[10])
    s = np.zeros((10, n))
    state = State(s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7], s[8], s[9])
    low_pass = Filter(np.zeros(n), np.zeros(n), np.zeros(n))
    work, mass_kg_m2, spare = work_space(n), np.zeros((n, n)), np.zeros((4, n))
    torque_nm, sum_rad, command_motor_nm, measured_rad = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    substeps = int(math.ceil(STEPS_PER_S / loop_hz))
    step_s = 1.0 / (loop_hz * substeps)
    # delays that are no whole cycles: what was there so many steps ago, of the same trajectory
    command_late = int(round(disturbance.command_delay_s / step_s))
    sensor_late = int(round(disturbance.sensor_delay_s / step_s))
    kept = max(command_late, sensor_late) + 1
    old_command_motor_nm = np.zeros((kept, n))
    old_motor_rad, old_link_rad = np.zeros((kept, n)), np.zeros((kept, n))
    step, first_row, first_step = 0, 0, 0
    for k in range(rows):
        if course.begins[k]:
            first_row, first_step = k, step
            put_at_rest(state, course.position_rad[k], joints, chain, gravity_m_s2, work, torque_nm)
            command_motor_nm[:] = state.drive_motor_nm
            sum_rad[:] = 0.0
        now_motor_rad, now_link_rad = state.motor_rad, state.link_rad
        if sensor_late > 0 and step > first_step:
            then = max(step - sensor_late, first_step) % kept
            now_motor_rad, now_link_rad = old_motor_rad[then], old_link_rad[then]
        for i in range(n):
            seen_motor_rad, seen_link_rad = seen_by_encoders(joints[i], now_motor_rad[i], now_link_rad[i])
            outcome.motor_position_rad[k, i] = rounded(seen_motor_rad, disturbance.motor_resolution_rad[i])
            outcome.link_position_rad[k, i] = rounded(seen_link_rad, disturbance.link_resolution_rad[i])
            measured_rad[i] = outcome.motor_position_rad[k, i] / joints[i].gear_ratio
        set_velocity(low_pass, measured_rad, loop_hz, control.velocity_filter_hz, course.begins[k])
        compute_command(control, course, k, loop_hz, measured_rad, low_pass.output_rad_s, sum_rad, work, torque_nm)
        for i in range(n):
            outcome.motor_velocity_rad_s[k, i] = low_pass.output_rad_s[i] * joints[i].gear_ratio
            outcome.command_torque_motor_nm[k, i] = torque_nm[i] / joints[i].gear_ratio
        outcome.drive_torque_motor_nm[k] = state.drive_motor_nm + disturbance.torque_noise_motor_nm[k]
        outcome.true_drive_motor_nm[k], outcome.true_friction_nm[k] = state.drive_motor_nm, state.friction_nm
        outcome.true_link_rad[k], outcome.true_link_rad_s[k] = state.link_rad, state.link_rad_s
        outcome.true_motor_rad[k], outcome.true_motor_rad_s[k] = state.motor_rad, state.motor_rad_s
        acting = k - control.delay_cycles
        if acting >= first_row and not disturbance.command_lost[k]:
            command_motor_nm[:] = outcome.command_torque_motor_nm[acting]
        for substep in range(substeps):
            old_command_motor_nm[step % kept] = command_motor_nm
            old_motor_rad[step % kept], old_link_rad[step % kept] = state.motor_rad, state.link_rad
            wanted_motor_nm = old_command_motor_nm[max(step - command_late, first_step) % kept]
            time_s = course.time_s[k] + substep * step_s
            advance(state, wanted_motor_nm, time_s, step_s, joints, chain, gravity_m_s2, work, mass_kg_m2, spare)
            step += 1
    return outcome
