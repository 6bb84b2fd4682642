"""Inverse dynamics of an arm of seven joints along a motion, by this package on arrays and by Pinocchio in a loop of Python.

    pip install ./python pin==4.1.0
    python benches/python/dynamics.py

Prints what a row takes, least of five passes, and how far the torques are apart.
"""

import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import pinocchio

import flexspline as fx

ROWS = 20_000
PASSES = 5


def least_us(compute):
    """What a row takes, and the last result."""
    spent = []
    for _ in range(PASSES):
        begin = time.process_time()
        torque = compute()
        spent.append(time.process_time() - begin)
    return 1e6 * min(spent) / ROWS, torque


def main():
    robot = fx.Robot("pa10")
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        # the drives' friction is no part of it
        warnings.simplefilter("ignore", fx.FormatWarning)
        path = Path(folder) / "pa10.urdf"
        robot.to_urdf(path)
        model = pinocchio.buildModelFromUrdf(str(path))
    data = model.createData()
    q, v, a = np.random.default_rng(0).normal(size=(3, ROWS, len(robot.joints)))

    def loop():
        return np.array([pinocchio.rnea(model, data, q[row], v[row], a[row]).copy() for row in range(ROWS)])

    own_us, own = least_us(lambda: robot.inverse_dynamics(q, v, a))
    loop_us, theirs = least_us(loop)
    # a URDF has no rotors
    rotors = robot.inverse_dynamics(0 * q, 0 * v, a) - np.array([pinocchio.rnea(model, data, 0 * q[row], 0 * v[row], a[row]).copy() for row in range(ROWS)])
    print(f"flexspline, arrays: {own_us:.2f} us a row")
    print(f"Pinocchio {pinocchio.__version__}, loop: {loop_us:.2f} us a row, {loop_us / own_us:.1f} times as long")
    print(f"largest difference, rotors aside: {np.abs(own - theirs - rotors).max():.1e} Nm of {np.abs(theirs).max():.0f} Nm")


if __name__ == "__main__":
    main()
