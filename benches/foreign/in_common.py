"""What names have in common with a law on no list: the part of the law's square, along the motion that the arm made, that the name's
own law makes at the size and shape that fit best.

A name of several numbers may have them all; a shape is tried at a few values. Names of a gear, an encoder or the timing make no
torque of their own along a given motion and are left out, which allows them nothing.
"""

import math

import numpy as np
from numba import njit

from simulator import friction_level_nm, rest_of, surroundings_nm

# A part of the usual speed, from where friction falls within a turn to where it falls over most of the motion.
STRIBECK_PARTS = (0.03, 0.06, 0.12, 0.25, 0.5)
# Friction that warms settles within a part of the recording.
WARMING_PARTS = (0.05, 0.1, 0.2, 0.4, 0.8)
# Waves of a torque or a friction per turn of the motor, and per turn of the joint.
MOTOR_WAVES = (1.0, 2.0, 4.0, 6.0)
JOINT_WAVES = range(1, 9)


@njit(cache=True)
def law_nm(joint, without, motor_rad, motor_rad_s, link_rad, next_link_rad, time_s, step_s):
    """Torque of what one joint has beyond another, row by row."""
    torque_nm, rested_s = np.zeros(time_s.shape[0]), 0.0
    for k in range(time_s.shape[0]):
        rested_s = rest_of(rested_s, abs(motor_rad_s[k]), step_s)
        seen = (motor_rad[k], motor_rad_s[k], link_rad[k], 0.0, rested_s, time_s[k])
        level_nm = friction_level_nm(joint, *seen) - friction_level_nm(without, *seen)
        torque_nm[k] = level_nm * math.tanh(motor_rad_s[k] / joint.presliding)
        torque_nm[k] += (joint.cubic_nm_s3_rad3 - without.cubic_nm_s3_rad3) * motor_rad_s[k] ** 3
        around = (link_rad[k], next_link_rad[k], time_s[k])
        torque_nm[k] += surroundings_nm(joint, *around) - surroundings_nm(without, *around)
    return torque_nm


def shapes(joint, link_rad, speed_rad_s, drive_nm, friction_nm, time_s, loop_hz):
    """Name, and the columns of its law at each shape that is tried; of a shape all columns together."""
    sign = np.tanh(speed_rad_s / joint["presliding"])
    acceleration_rad_s2 = np.gradient(speed_rad_s) * loop_hz
    rotor_kg_m2 = joint["gear_ratio"] ** 2 * joint["rotor_inertia_kg_m2"]
    load_nm = drive_nm - friction_nm - rotor_kg_m2 * acceleration_rad_s2
    one, sine, cosine = np.ones_like(link_rad), np.sin(link_rad), np.cos(link_rad)
    usual_rad_s = np.quantile(np.abs(speed_rad_s), 0.9)
    past_s = time_s - time_s[0]
    yield "coulomb_friction", [sign]
    yield "viscous_friction", [speed_rad_s]
    yield "quadratic_friction", [speed_rad_s * np.abs(speed_rad_s)]
    for part in STRIBECK_PARTS:
        yield "stribeck_friction", [sign * np.exp(-np.abs(speed_rad_s) / (part * usual_rad_s))]
    yield "asymmetric_friction", [np.abs(sign)]
    yield "load_dependent_friction", [sign * np.abs(load_nm)]
    yield "thermal_friction_drift", [sign * past_s]
    for part in WARMING_PARTS:
        yield "thermal_friction_drift", [sign * (1.0 - np.exp(-past_s / (part * past_s[-1])))]
    yield "torque_offset", [one]
    yield "torque_constant_error", [drive_nm]
    yield "joint_spring", [one, link_rad]
    for name in ("rotor_inertia", "link_inertia"):
        yield name, [acceleration_rad_s2]
    for name in ("gravity_torque", "encoder_offset", "base_tilt"):
        yield name, [sine, cosine]
    yield "payload", [sine, cosine, acceleration_rad_s2]
    for waves in (*JOINT_WAVES, *(of_motor * joint["gear_ratio"] for of_motor in MOTOR_WAVES)):
        both = [np.sin(waves * link_rad), np.cos(waves * link_rad)]
        yield "torque_ripple", both
        yield "position_dependent_friction", [sign * wave for wave in both]


def part_of(torque_nm, columns):
    """Part of a torque's square that columns make at the sizes that fit best."""
    matrix = np.stack(columns, axis=1)
    scale = np.sqrt((matrix**2).mean(axis=0))
    matrix = matrix[:, scale > 0.0] / scale[scale > 0.0]
    sizes = np.linalg.lstsq(matrix, torque_nm, rcond=None)[0]
    return float(1.0 - ((torque_nm - matrix @ sizes) ** 2).sum() / (torque_nm**2).sum())


def in_common(case, exact, arm, index, course, outcome):
    """Of each name the most that it has in common with what the joint has beyond the exact arm's."""
    joint, following = arm.joints[index], (index + 1) % len(arm.links)
    link_rad, motor_rad_s = outcome.true_link_rad[:, index], outcome.true_motor_rad_s[:, index]
    law = law_nm(
        joint, exact.joints[index], outcome.true_motor_rad[:, index], motor_rad_s, link_rad,
        outcome.true_link_rad[:, following], course.time_s, 1.0 / case.loop_hz,
    )  # fmt: skip
    if not law.any():
        return {}
    drive_nm = joint["gear_ratio"] * outcome.true_drive_motor_nm[:, index]
    seen = (link_rad, motor_rad_s, drive_nm, outcome.true_friction_nm[:, index], course.time_s)
    most = {}
    for name, columns in shapes(joint, *seen, case.loop_hz):
        most[name] = max(most.get(name, 0.0), part_of(law, columns))
    return {name: round(part, 4) for name, part in most.items()}
