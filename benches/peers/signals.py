"""One joint's log as peers want it: joint side, SI, with the goal of a position servo that stands for the controller.

The controller is linear in the measured motion, so its loop around any simulation is the recorded torque and its gains on
recorded less simulated motion: a servo with these gains whose goal is `q + (u + K_d q̇)/K_p` of the recording. The
torque is the command, one cycle later (the joint's delay); it and the velocity are low-passed without delay, so that a
coarser step loses nothing but noise.
"""

import csv
import json
import os
import pathlib
import time
import tomllib
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, filtfilt

LOW_PASS_HZ = 60.0
# Nobody knows how far friction was wound up when the recording began.
START_S = 0.5
# A row at a reversal counts a fifteenth.
REVERSAL, REVERSAL_S = 15.0, 0.12


@dataclass
class Joint:
    """The robot file's one joint, a pendulum that hangs down at zero."""

    gear_ratio: float
    armature_kg_m2: float
    mass_kg: float
    centre_m: float
    inertia_kg_m2: float
    gravity_m_s2: float
    stiffness_nm_rad: float
    damping_nm_s_rad: float
    effects: dict

    def value(self, effect, key):
        return self.effects.get(effect, {}).get(key, 0.0)

    def nominal(self):
        """Coulomb friction, viscous friction and rotor inertia, joint side."""
        return [
            self.value("coulomb_friction", "coulomb_nm"),
            self.value("viscous_friction", "viscous_nm_s_rad"),
            self.armature_kg_m2,
        ]


@dataclass
class Log:
    """Even in time."""

    time_s: np.ndarray
    position_rad: np.ndarray
    velocity_rad_s: np.ndarray
    torque_nm: np.ndarray
    goal_rad: np.ndarray


class Clock:
    """Seconds by the processor, of this process and of another that works for it, and by the wall."""

    def __init__(self, helper=None):
        # Linux: the processor's clock of a process
        self.clocks = [(~pid << 3) | 2 for pid in (os.getpid(), helper) if pid is not None]
        self.begin_s, self.begin_wall_s = self.processor_s(), time.perf_counter()

    def processor_s(self):
        return sum(time.clock_gettime(clock) for clock in self.clocks)

    def seconds(self):
        return self.processor_s() - self.begin_s

    def wall_seconds(self):
        return time.perf_counter() - self.begin_wall_s


def read_joint(path):
    robot = tomllib.loads(pathlib.Path(path).read_text())
    joint, link, control = robot["joint"][0], robot["link"][0], robot["control"]
    return Joint(
        gear_ratio=joint["gear_ratio"],
        armature_kg_m2=joint["rotor_inertia_kg_m2"] * joint["gear_ratio"] ** 2,
        mass_kg=link["mass_kg"],
        centre_m=link["centre_of_mass_m"][2],
        inertia_kg_m2=link["inertia_kg_m2"]["yy"],
        gravity_m_s2=-robot["gravity_m_s2"][2],
        stiffness_nm_rad=control["proportional_nm_rad"][0],
        damping_nm_s_rad=control["derivative_nm_s_rad"][0],
        effects={effect["effect"]: effect for effect in joint["effects"]},
    )


def read_log(path, joint):
    with open(path, newline="") as file:
        rows = csv.reader(file)
        header = next(rows)
        table = np.array([[float(cell) for cell in row] for row in rows])
    column = {name.split(".")[-1]: table[:, k] for k, name in enumerate(header)}
    time_s = column["time_s"]
    rate_hz = (len(time_s) - 1) / (time_s[-1] - time_s[0])
    low_pass = butter(2, LOW_PASS_HZ, fs=rate_hz)
    position_rad = column["motor_position_rad"] / joint.gear_ratio
    velocity_rad_s = filtfilt(*low_pass, np.gradient(position_rad, 1.0 / rate_hz))
    command_nm = column["command_torque_nm"] * joint.gear_ratio
    acting_nm = np.concatenate([command_nm[:1], command_nm[:-1]])
    torque_nm = filtfilt(*low_pass, acting_nm)
    goal_rad = position_rad + (torque_nm + joint.damping_nm_s_rad * velocity_rad_s) / joint.stiffness_nm_rad
    return Log(time_s - time_s[0], position_rad, velocity_rad_s, torque_nm, goal_rad)


def reversal_weights(log):
    """Factors of a residual as Flexspline's diagnosis has them: friction before it slips follows another law."""
    turns_s = log.time_s[1:][np.diff(np.sign(log.velocity_rad_s)) != 0]
    after = np.searchsorted(turns_s, log.time_s)
    padded_s = np.concatenate([[-np.inf], turns_s, [np.inf]])
    nearest_s = np.minimum(log.time_s - padded_s[after], padded_s[after + 1] - log.time_s)
    return 1.0 / np.sqrt(1.0 + (REVERSAL * np.exp(-np.square(nearest_s / REVERSAL_S))) ** 2)


def rms_after_start(time_s, away_rad):
    return float(np.sqrt(np.mean(np.square(away_rad[time_s >= START_S]))))


def improvements(trace):
    """The best so far, wherever it gets better, and the last."""
    best, kept = np.inf, []
    for entry in trace:
        if entry["cost"] < best:
            best = entry["cost"]
            kept.append(entry)
    return kept


def write(path, **result):
    pathlib.Path(path).write_text(json.dumps(result, indent=1))
