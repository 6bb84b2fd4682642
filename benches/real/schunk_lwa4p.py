#!/usr/bin/env python3
"""Schunk LWA 4P trials (github.com/nikhilushinde/AutoKoopman) as logs that need no mapping file.

    schunk_lwa4p.py FOLDER OUT

FOLDER holds measurement_N/{time,input,trajectory}.csv; OUT/trial_NNN.csv is written for each. The torque was told and not
measured: it is the same in all trials of an input. Which side of the gear it is meant at is not published.
"""

import pathlib
import sys

SIGNALS = "link_position_rad", "link_velocity_rad_s", "command_torque_nm"


def main():
    folder, out = map(pathlib.Path, sys.argv[1:])
    out.mkdir(parents=True, exist_ok=True)
    columns = ["time_s"] + [f"joint{joint}.{signal}" for signal in SIGNALS for joint in range(1, 7)]
    for trial in folder.glob("measurement_*"):
        time, state, torque = (
            (trial / f"{name}.csv").read_text().split() for name in ("time", "trajectory", "input")
        )
        torque += [",,,,,"] * (len(time) - len(torque))  # a row too few
        rows = [",".join(columns), *map(",".join, zip(time, state, torque, strict=True))]
        number = int(trial.name.removeprefix("measurement_"))
        (out / f"trial_{number:03}.csv").write_text("\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
