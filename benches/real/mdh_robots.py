#!/usr/bin/env python3
"""Robot files of two arms that are published as numbers beside modified Denavit-Hartenberg parameters.

    python3 benches/real/mdh_robots.py ur10 ur10_dyn_ident/data/robotparams/ur10_cad.yml > ur10.toml
    python3 benches/real/mdh_robots.py dual_arm \
        dyn_ident_dualArmV2/code/para_est/grav_fric_paras/calculate_dynamics_with_SWmodel.m > dual_arm.toml

Both give mass, centre (or first moment) and the inertia about the frame of each link.
"""

import math
import pathlib
import re
import sys

QUARTER = math.pi / 2


def ur10(text):
    """Masses of the YAML file; the frames stand in the repository's notebook."""
    value = {key: float(number) for key, number in re.findall(r"^(\w+): (\S+)$", text, re.M)}
    frames = [
        (0, 0, 0.128, 0),
        (-QUARTER, 0, 0.176, -QUARTER),
        (0, 0.612, -0.128, 0),
        (0, 0.572, 0.116, QUARTER),
        (QUARTER, 0, 0.116, 0),
        (-QUARTER, 0, 0.092, 0),
    ]
    links = []
    for number, frame in enumerate(frames, 1):
        mass = value[f"m_{number}"]
        centre = [value[f"l_{number}{axis}"] / mass for axis in "xyz"]
        inertia = {key: value[f"L_{number}{key}"] for key in ("xx", "yy", "zz", "xy", "xz", "yz")}
        links.append((frame, mass, centre, inertia))
    return "ur10", [0.0, 0.0, -9.81], links


def dual_arm(text):
    """Masses, lengths and frames of the model that was generated with SYMORO; centres are in mm, inertias in kg mm²."""
    value = {}
    for key, number, _, over in re.findall(r"\b(\w+)=(-?\d+(\.\d+)?)(/1e[36])?;", text):
        value[key] = float(number) / {"/1e3": 1e3, "/1e6": 1e6}.get(over, 1.0)
    frames = [
        (0, 0, 0, QUARTER),
        (-QUARTER, 0, 0, 0),
        (QUARTER, 0, value["L2"], 0),
        (-QUARTER, value["L3"], 0, 0),
        (QUARTER, 0, value["L4"], 0),
        (-QUARTER, 0, 0, -QUARTER),
        (QUARTER, value["L5"], 0, 0),
    ]
    links = []
    for number, frame in enumerate(frames, 1):
        centre = [value[f"{axis}{number}"] for axis in "xyz"]
        inertia = {key: value[f"I{number}{key}"] for key in ("xx", "yy", "zz", "xy", "xz", "yz")}
        links.append((frame, value[f"m{number}"], centre, inertia))
    # its base accelerates by g = -9.81 along y, where gravity would pull by as much
    return "dual_arm_left", [0.0, -value["g"], 0.0], links


def origin(alpha, a, d, theta):
    """Place and roll, pitch, yaw of `Rot(x, alpha) Trans(x, a) Trans(z, d) Rot(z, theta)`."""
    place = [a, -math.sin(alpha) * d, math.cos(alpha) * d]
    (ca, sa), (ct, st) = ((math.cos(angle), math.sin(angle)) for angle in (alpha, theta))
    turned = [[ct, -st, 0.0], [ca * st, ca * ct, -sa], [sa * st, sa * ct, ca]]
    pitch = math.asin(max(-1.0, min(1.0, -turned[2][0])))
    if abs(math.cos(pitch)) > 1e-9:
        roll, yaw = math.atan2(turned[2][1], turned[2][2]), math.atan2(turned[1][0], turned[0][0])
    else:
        roll, yaw = math.atan2(math.copysign(1.0, pitch) * turned[0][1], turned[1][1]), 0.0
    return place, [roll, pitch, yaw]


def main():
    robots = {"ur10": ur10, "dual_arm": dual_arm}
    if len(sys.argv) != 3 or sys.argv[1] not in robots:
        sys.exit(__doc__)
    name, gravity, links = robots[sys.argv[1]](pathlib.Path(sys.argv[2]).read_text(errors="replace"))
    written = lambda values: "[" + ", ".join(f"{value:.9g}" for value in values) + "]"
    print(f'name = "{name}"\ngravity_m_s2 = {written(gravity)}')
    for number, (frame, mass, centre, inertia) in enumerate(links, 1):
        place, turned = origin(*frame)
        square = sum(x * x for x in centre)
        at = dict(zip("xyz", centre))
        about_centre = {
            key: value - mass * ((square if key[0] == key[1] else 0.0) - at[key[0]] * at[key[1]])
            for key, value in inertia.items()
        }
        print(f'[[link]]\njoint = "joint{number}"')
        print(f"origin_m = {written(place)}\norigin_rpy_rad = {written(turned)}\naxis = [0.0, 0.0, 1.0]")
        print(f"mass_kg = {mass}\ncentre_of_mass_m = {written(centre)}")
        print("inertia_kg_m2 = { " + ", ".join(f"{key} = {value:.6g}" for key, value in about_centre.items()) + " }")
    for number in range(1, len(links) + 1):
        print(f'[[joint]]\nname = "joint{number}"')


if __name__ == "__main__":
    main()
