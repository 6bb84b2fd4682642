#!/usr/bin/env python3
"""How much trials with one input differ (github.com/nikhilushinde/AutoKoopman, Schunk LWA 4P).

    schunk_lwa4p.py FOLDER

FOLDER holds measurement_N/{input,trajectory}.csv. Prints, for each distinct input, the number of trials, how far their
inputs differ, and the standard deviation of the positions over the trials at the start and at the end, joint by joint.
"""

import pathlib
import sys

import numpy as np


def main():
    groups = {}
    for trial in sorted(pathlib.Path(sys.argv[1]).glob("measurement_*")):
        table = lambda name: np.loadtxt(trial / name, delimiter=",")
        torque_nm, position_rad = table("input.csv"), table("trajectory.csv")[:, :6]
        groups.setdefault(torque_nm.tobytes(), []).append(position_rad)
    for group in groups.values():
        rows = min(len(position_rad) for position_rad in group)
        spread_mrad = 1e3 * np.std([position_rad[:rows] for position_rad in group], axis=0)
        print(len(group), "trials with one input, bit for bit; spread in mrad")
        print("  start", spread_mrad[0].round(1), "\n  end  ", spread_mrad[-1].round(1))


if __name__ == "__main__":
    main()
