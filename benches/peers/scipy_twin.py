"""Fits a joint's friction and rotor inertia with scipy.optimize.least_squares on Flexspline's own twin.

    scipy_twin.py TWIN_PIPE ROBOT.toml FIT.csv DIFF_STEP RESULT.json

The residual is the one that the diagnosis squares. Values are parts of the robot file's, so that all are of one size.
Time is that of both processes and includes the reading of the recording.
"""

import sys

import numpy as np
import scipy
from scipy.optimize import least_squares

import signals
from twin_pipe import TwinPipe


def main():
    program, robot, fit, diff_step, result = sys.argv[1:]
    joint = signals.read_joint(robot)
    nominal = np.array(joint.nominal())
    sides = np.array([1.0, 1.0, joint.gear_ratio**-2])
    trace = []
    with TwinPipe(program, robot, fit) as twin:
        clock = signals.Clock(twin.process.pid)

        def residual(parts):
            answer = twin.ask("residual", (parts - 1.0) * nominal * sides)
            entry = {"seconds": clock.seconds(), "runs": len(trace) + 1}
            trace.append({**entry, "cost": float(answer @ answer), "values": (parts * nominal).tolist()})
            return answer

        step = None if diff_step == "default" else float(diff_step)
        found = least_squares(residual, np.ones(3), diff_step=step, bounds=(0.0, 10.0))
        seconds, wall_seconds = clock.seconds(), clock.wall_seconds()
    signals.write(
        result,
        name=f"scipy {scipy.__version__} least_squares on our twin, diff_step {diff_step}",
        seconds=seconds,
        wall_seconds=wall_seconds,
        runs=len(trace),
        values=(found.x * nominal).tolist(),
        trace=signals.improvements(trace),
    )


if __name__ == "__main__":
    main()
