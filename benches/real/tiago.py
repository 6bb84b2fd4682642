#!/usr/bin/env python3
"""The logs of TIAGo's arm in figaroh-examples as one recording.

    python3 benches/real/tiago.py figaroh-examples/examples/tiago tiago.csv

Motor torque is current times ratio times motor constant, as its notebook has them; the torso's torque is not known.
"""

import csv
import pathlib
import sys

ARM = {
    "arm_1_joint": 100 * 0.136,
    "arm_2_joint": 100 * 0.136,
    "arm_3_joint": 100 * -0.087,
    "arm_4_joint": 100 * -0.087,
    "arm_5_joint": 336 * -0.0613,
    "arm_6_joint": 336 * -0.0613,
    "arm_7_joint": 336 * -0.0613,
}
TORSO = "torso_lift_joint"


def read(path):
    with open(path, newline="") as file:
        head, *rows = csv.reader(file)
    columns = {name.lstrip("- "): index for index, name in enumerate(head)}
    return columns, rows


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1]) / "data/identification/dynamic"
    positions, position_rows = read(folder / "tiago_position.csv")
    efforts, effort_rows = read(folder / "tiago_effort.csv")
    with open(sys.argv[2], "w", newline="") as file:
        out = csv.writer(file)
        of_arm = [f"{joint}.{signal}" for joint in ARM for signal in ("link_position_rad", "motor_torque_nm")]
        out.writerow(["time_s", f"{TORSO}.link_position_rad", *of_arm])
        for at, current in zip(position_rows, effort_rows):
            row = [at[0], at[positions[f"{TORSO}_position"]]]
            for joint, nm_per_ampere in ARM.items():
                row.append(at[positions[f"{joint}_position"]])
                row.append(float(current[efforts[f"{joint}_effort"]]) * nm_per_ampere)
            out.writerow(row)


if __name__ == "__main__":
    main()
