"""A robot of two links, and recordings of one that rubs."""

import sysconfig
from pathlib import Path

import numpy as np
import pytest

import flexspline as fx

DATA = Path(__file__).parent / "data"
EXAMPLES = Path(__file__).parents[2] / "examples"
#: The command that the wheel carries.
COMMAND = sysconfig.get_path("scripts") + "/flexspline"
COULOMB_NM = {"shoulder": 3.0, "elbow": 1.0}
VISCOUS_NM_S_RAD = {"shoulder": 1.5, "elbow": 0.4}


def motion(seconds, seed=0, rate_hz=250.0):
    """Sums of sines of every joint: position, velocity, acceleration by row and joint."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / rate_hz)
    position, velocity, acceleration = (np.zeros((len(time), 2)) for _ in range(3))
    for joint in range(2):
        for frequency_hz in (0.11, 0.23, 0.37, 0.53):
            w, phase = 2 * np.pi * frequency_hz, random.uniform(0, 2 * np.pi)
            amplitude = 0.25 / (1 + frequency_hz)
            position[:, joint] += amplitude * np.sin(w * time + phase)
            velocity[:, joint] += amplitude * w * np.cos(w * time + phase)
            acceleration[:, joint] -= amplitude * w * w * np.sin(w * time + phase)
    return time, position, velocity, acceleration


def rigid_nm(position, velocity, acceleration):
    """Torque of the two links of arm.urdf, by Lagrange's equation of the double pendulum."""
    m1, c1, i1, m2, c2, i2, length, g = 2.0, 0.3, 0.06, 1.0, 0.25, 0.02, 0.5, 9.81
    (q1, q2), (v1, v2), (a1, a2) = position.T, velocity.T, acceleration.T
    h, s = m2 * length * c2 * np.cos(q2), m2 * length * c2 * np.sin(q2)
    m11 = i1 + m1 * c1**2 + i2 + m2 * (length**2 + c2**2) + 2 * h
    m12, m22 = i2 + m2 * c2**2 + h, i2 + m2 * c2**2
    elbow_gravity = m2 * g * c2 * np.sin(q1 + q2)
    shoulder = m11 * a1 + m12 * a2 - s * (2 * v1 * v2 + v2**2) + (m1 * c1 + m2 * length) * g * np.sin(q1) + elbow_gravity
    elbow = m12 * a1 + m22 * a2 + s * v1**2 + elbow_gravity
    return np.column_stack([shoulder, elbow])


def arrays(seconds=30.0, seed=0, friction=True):
    """Time and signals by joint, as `Recording.from_arrays` takes them."""
    time, position, velocity, acceleration = motion(seconds, seed)
    torque = rigid_nm(position, velocity, acceleration)
    noise = np.random.default_rng(seed + 1000)
    joints = {}
    for index, name in enumerate(["shoulder", "elbow"]):
        own = torque[:, index] + noise.normal(0.0, 0.02, len(time))
        if friction:
            v = velocity[:, index]
            own = own + COULOMB_NM[name] * np.tanh(v / 1e-3) + VISCOUS_NM_S_RAD[name] * v
        joints[name] = {"link_position_rad": position[:, index].copy(), "motor_torque_nm": own}
    return time, joints


@pytest.fixture(scope="session")
def robot():
    return fx.Robot(DATA / "arm.urdf")


@pytest.fixture(scope="session")
def recording():
    time, joints = arrays()
    return fx.Recording.from_arrays(time=time, joints=joints, name="rubbing arm")


@pytest.fixture(scope="session")
def report(robot, recording):
    return fx.diagnose(robot, recording)
