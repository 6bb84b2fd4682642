#!/usr/bin/env python3
"""Makes the recordings of a fleet whose truth is known, with the emulated plant.

    python3 benches/fleet/make.py --flexspline target/release/flexspline --out FLEET

Of 1,000 recordings of 30 s, 950 are of 38 single axes (the SHD-17 bench) and 50 of 5 arms (the PA-10), at 500 rows a
second. Every robot is an individual: the plant draws its masses, stiffness and friction 2 % off, by the robot's own seed.

Common to all: more Coulomb friction than the robot file has, a little different in each robot and from day to day.
Three robots have a bad gear each: backlash, kinematic error, friction that waves with the motor's angle.
One axis wears: its Coulomb friction grows by the same amount every month.

FLEET/robots holds the robot files, FLEET/recordings/ROBOT/DATE.mcap the recordings, FLEET/truth.json what was put in.
Recordings that are there already are left alone, so that it goes on where it was stopped.
"""

import argparse
import datetime
import json
import os
import pathlib
import random
import re
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor

ROBOTS = pathlib.Path(__file__).resolve().parents[2] / "robots"
# Logs of industrial controllers have rates like this one; it costs a third of 1500 rows a second.
RATE_HZ = 500
FIRST_DAY = datetime.date(2026, 1, 5)
DAYS = 168
MONTH_DAYS = 365.25 / 12
# Wear of the one axis: 1.2 % of its 2.5 Nm a month.
WEAR_NM_MONTH = 0.03
WORN = "axis-28"
BAD_GEARS = {
    "axis-07": ("joint1", "backlash", {"gap_rad": 1e-3}),
    "axis-19": ("joint1", "kinematic_error", {"amplitude_rad": 6e-4, "cycles_per_motor_rev": 2.0, "phase_rad": 0.3}),
    "arm-3": ("joint4", "position_dependent_friction", {"amplitude_nm": 3.0, "cycles_per_motor_rev": 2.0, "phase_rad": 0.3}),
}
# joint: mean over the fleet, scatter between robots, scatter from day to day; all in Nm.
COMMON_COULOMB_NM = {
    "axis": {"joint1": (0.5, 0.05, 0.03)},
    "arm": {"joint2": (5.0, 0.3, 0.15), "joint4": (2.0, 0.15, 0.06)},
}


def robot_files(folder):
    """The shipped robots at the fleet's rate. The axis gets gains that its loop is stable with at that rate."""
    axis = (ROBOTS / "shd17.toml").read_text()
    for pattern, value in [
        (r'^name = "shd17"', 'name = "axis"'),
        (r"^rate_hz = 1500.0", f"rate_hz = {RATE_HZ}.0"),
        (r"^proportional_nm_rad = \[400.0\]", "proportional_nm_rad = [100.0]"),
        (r"^derivative_nm_s_rad = \[20.0\]", "derivative_nm_s_rad = [8.0]"),
        (r"^velocity_filter_hz = 200.0", "velocity_filter_hz = 80.0"),
    ]:
        axis, count = re.subn(pattern, value, axis, flags=re.MULTILINE)
        assert count == 1, f"robots/shd17.toml has no line {pattern}"
    arm = (ROBOTS / "pa10.toml").read_text()
    for pattern, value in [(r'^name = "pa10"', 'name = "arm"'), (r"^rate_hz = 1500.0", f"rate_hz = {RATE_HZ}.0")]:
        arm, count = re.subn(pattern, value, arm, flags=re.MULTILINE)
        assert count == 1, f"robots/pa10.toml has no line {pattern}"
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in [("axis", axis), ("arm", arm)]:
        path = folder / f"{name}.toml"
        if not path.is_file() or path.read_text() != text:
            path.write_text(text)


def fleet(recordings, seed):
    """Every recording as (robot, model, day, plant seed, effects, trajectory), and the truth."""
    draw = random.Random(seed)
    per_axis, per_arm = max(1, recordings * 25 // 1000), max(1, recordings * 10 // 1000)
    robots = [(f"axis-{n:02d}", "axis", per_axis) for n in range(1, 39)]
    robots += [(f"arm-{n}", "arm", per_arm) for n in range(1, 6)]
    plan, individual = [], {}
    for number, (robot, model, count) in enumerate(robots):
        own_nm = {joint: draw.gauss(mean, between) for joint, (mean, between, _) in COMMON_COULOMB_NM[model].items()}
        individual[robot] = own_nm
        for k in range(count):
            days = round(k * DAYS / max(1, count - 1))
            effects = []
            for joint, (_, _, daily) in COMMON_COULOMB_NM[model].items():
                coulomb_nm = own_nm[joint] + draw.gauss(0.0, daily)
                if robot == WORN:
                    coulomb_nm += WEAR_NM_MONTH * days / MONTH_DAYS
                effects.append((joint, "coulomb_friction", {"coulomb_nm": round(coulomb_nm, 5)}))
            if robot in BAD_GEARS:
                effects.append(BAD_GEARS[robot])
            joints = ["joint1"] if model == "axis" else [f"joint{n}" for n in range(1, 8)]
            speeds = (0.7, 1.2) if model == "axis" else (0.4, 0.5)
            motion = [(joint, draw.uniform(*speeds), draw.randrange(1, 2**31)) for joint in joints]
            day = FIRST_DAY + datetime.timedelta(days=days)
            plan.append((robot, model, day, 1000 + seed * 100 + number, effects, motion))
    truth = {
        "seed": seed,
        "recordings": len(plan),
        "common": {
            model: {joint: mean for joint, (mean, _, _) in table.items()} for model, table in COMMON_COULOMB_NM.items()
        },
        "coulomb_nm": individual,
        "bad_gears": {
            robot: {"joint": gear[0], "effect": gear[1], "parameters": gear[2]} for robot, gear in BAD_GEARS.items()
        },
        "drifting": {WORN: {"joint": "joint1", "effect": "coulomb_friction", "coulomb_nm_month": WEAR_NM_MONTH}},
    }
    # In the order of the days, so that a part of the fleet's recordings has all of its robots.
    return sorted(plan, key=lambda entry: (entry[2], entry[0])), truth


def toml_tables(name, rows):
    return "".join(f"[[{name}]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in row.items()) for row in rows)


def make(flexspline, folder, entry):
    robot, model, day, plant_seed, effects, motion = entry
    target = folder / "recordings" / robot / f"{day}.mcap"
    if target.is_file():
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as scratch:
        scratch = pathlib.Path(scratch)
        injections = [{"joint": joint, "effect": effect, **parameters} for joint, effect, parameters in effects]
        (scratch / "effects.toml").write_text(toml_tables("effect", injections))
        joints = [
            {
                "name": joint,
                "kind": "multi_sine",
                "amplitude_rad": 1.0 if model == "axis" else 0.6,
                "speed_rad_s": speed_rad_s,
                "seed": phases,
            }
            for joint, speed_rad_s, phases in motion
        ]
        (scratch / "motion.toml").write_text('kind = "multi_sine"\n' + toml_tables("joint", joints))
        command = [flexspline, "run", "--mode", "lockstep", "--robot", folder / "robots" / f"{model}.toml"]
        command += ["--trajectory", scratch / "motion.toml", "--duration", "30s", "--estimators", "residual"]
        command += ["--inject", scratch / "effects.toml", "--seed", str(plant_seed)]
        command += ["--instance", f"{robot}-{os.getpid()}", "--record", scratch / "run.mcap"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            raise SystemExit(f"{robot} {day}: {done.stderr.strip() or done.stdout.strip()}")
        os.replace(scratch / "run.mcap", target)


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--flexspline", required=True, type=pathlib.Path, help="the command, built with --release")
    options.add_argument("--out", required=True, type=pathlib.Path, help="folder of the fleet")
    options.add_argument("--recordings", type=int, default=1000, help="how many [1000]")
    options.add_argument("--seed", type=int, default=1, help="another fleet of the same kind [1]")
    options.add_argument("--jobs", type=int, default=1, help="recordings made at a time [1]")
    given = options.parse_args()
    robot_files(given.out / "robots")
    plan, truth = fleet(given.recordings, given.seed)
    (given.out / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")
    with ThreadPoolExecutor(given.jobs) as pool:
        for done, _ in enumerate(pool.map(lambda entry: make(given.flexspline, given.out, entry), plan), 1):
            if done % 50 == 0 or done == len(plan):
                print(f"{done} of {len(plan)} recordings", flush=True)


if __name__ == "__main__":
    main()
