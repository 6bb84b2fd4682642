"""Robots converted by `robot convert`, in the programs that they were converted for.

    python benches/robots/converted.py target/release/examples/inverse_dynamics target/release/flexspline

Every model that compare.py reads is written as MJCF and as URDF. MuJoCo and Pinocchio read what was written, and their inverse
dynamics are set beside ours of the model that it came from: five motions, the largest difference relative to the largest
torque. Prints those that differ by more than 1e-9 or are refused, and the count.
"""

import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import pinocchio as pin

from compare import Mujoco, Pinocchio, ours, package, short


def difference(kind, path, found):
    model = kind(path, found)
    worst = 0.0
    for motion in found["motions"]:
        right = np.array(motion["torque"])
        wrong = np.abs(model.torque(found["joints"], motion) - right).max()
        worst = max(worst, wrong / np.abs(right).max())
    return worst


def main():
    binary, flexspline = (str(pathlib.Path(name).resolve()) for name in sys.argv[1:3])
    # MuJoCo leaves a log where it runs
    os.chdir(tempfile.mkdtemp())
    prefix = pathlib.Path(pin.__file__).parents[4]
    models = sorted(prefix.glob("share/example-robot-data/robots/**/*.urdf"))
    models += sorted(path for name in ("robosuite", "dm_control", "gymnasium") for path in package(name).rglob("*.xml"))
    counts = {"MuJoCo": [0, 0], "Pinocchio": [0, 0]}
    for path in models:
        found = ours(binary, path)
        if "refused" in found or not any(np.any(motion["torque"]) for motion in found["motions"]):
            continue
        found["notes"] = []
        for kind, extension in ((Mujoco, "xml"), (Pinocchio, "urdf")):
            with tempfile.TemporaryDirectory() as folder:
                out = pathlib.Path(folder) / f"robot.{extension}"
                run = subprocess.run([flexspline, "robot", "convert", path, "--out", out], capture_output=True, text=True)
                try:
                    if run.returncode != 0:
                        raise ValueError(run.stderr.strip())
                    worst = difference(kind, out, found)
                except Exception as error:  # noqa: BLE001
                    counts[kind.name][1] += 1
                    print(f"{short(path)}: {kind.name}: {str(error).strip().splitlines()[0]}", flush=True)
                    continue
            counts[kind.name][int(worst > 1e-9)] += 1
            if worst > 1e-9:
                print(f"{short(path)}: {kind.name}: {worst:.1e}", flush=True)
    for name, (equal, other) in counts.items():
        print(f"{name}: {equal} of {equal + other} converted models agree to 1e-9")


if __name__ == "__main__":
    main()
