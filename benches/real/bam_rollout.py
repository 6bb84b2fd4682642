#!/usr/bin/env python3
"""How far a robot file's servo ends up from logs of a real one (github.com/Rhoban/bam), in that project's own metric.

    bam_rollout.py --parameters m1.json --robot xl330.toml --robot mended.toml LOG.json...

Each log is rolled out in closed loop: its goal, the servo's controller, the motor's equation, the robot file's friction
and pendulum, by `servo_pipe` (plant-emulator/examples). The error is the mean of |simulated - recorded position| over the
5 ms grid of `bam.process`. Torque constant and resistance are those of the published parameters, supply and gain those
that the log names. Prints mrad, log by log, and mean and standard deviation over the logs; and of each log the duty cycle
per firmware gain and rad of error (that of the controller here is 0.00288), the least supply, and the largest error while
the motor is on. Build the example first:

    cargo build --release -p plant-emulator --example servo_pipe
"""

import argparse
import json
import math
import pathlib
import subprocess

import numpy as np

ROW_S = 0.005
# XL330Actuator of better-actuator-models 1.0.2: parts of the supply per firmware gain and rad, and the current limit
DUTY_FULL = 885
DUTY_PER_GAIN_RAD = 4096 / (2 * math.pi) / (256 * DUTY_FULL)
CURRENT_LIMIT_A = 1.75


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--parameters", type=pathlib.Path, required=True, help="published model; its kt and R are taken")
    parser.add_argument("--robot", type=pathlib.Path, required=True, action="append", help="robot file; may be given again")
    parser.add_argument("--rollout", default="target/release/examples/servo_pipe", help="the built example")
    parser.add_argument("logs", type=pathlib.Path, nargs="+", metavar="LOG.json")
    return parser.parse_args()


def on_grid(log):
    """Goal, position and whether the motor is on, as `bam.process` interpolates them."""
    column = lambda name: np.array([float(entry[name]) for entry in log["entries"]])
    time_s = column("timestamp")
    at_s = np.arange(0.0, time_s[-1], ROW_S)
    names = ("goal_position", "position", "torque_enable")
    goal_rad, position_rad, on = (np.interp(at_s, time_s, column(name)) for name in names)
    return goal_rad, position_rad, on > 0.5


def facts(log):
    """What the log itself says of its controller: duty cycle per gain and rad where it is not clipped, volts, rad."""
    column = lambda name: np.array([float(entry[name]) for entry in log["entries"]])
    load = column("load")
    duty = np.where(load > 32767.0, load - 65536.0, load) / DUTY_FULL
    error_rad, on = column("goal_position") - column("position"), column("torque_enable") > 0.5
    told = on & (np.abs(duty) < 0.9) & (np.abs(error_rad) > 0.05)
    slope = error_rad[told] @ duty[told] / (error_rad[told] @ error_rad[told])
    return slope / log["kp"], column("input_volts").min(), np.abs(error_rad[on]).max()


def servo(log, parameters):
    """Gain, limits by supply and by current, and back-EMF, all as torque at the output."""
    kt, ohm = parameters["kt"], parameters["R"]
    full_nm = kt / ohm * log["vin"]
    return full_nm * log["kp"] * DUTY_PER_GAIN_RAD, full_nm, kt * CURRENT_LIMIT_A, kt**2 / ohm


def rollout_rad(program, robot, log, parameters):
    goal_rad, position_rad, on = on_grid(log)
    lines = ["begin " + " ".join(map(repr, map(float, (position_rad[0], *servo(log, parameters)))))]
    lines += [f"{goal!r} {int(is_on)}" for goal, is_on in zip(goal_rad.tolist(), on, strict=True)]
    command = [program, robot, repr(ROW_S)]
    output = subprocess.run(command, input="\n".join(lines), text=True, check=True, stdout=subprocess.PIPE).stdout
    return np.array(output.split(), dtype=float), position_rad


def main():
    told = arguments()
    parameters = json.loads(told.parameters.read_text())
    logs = [json.loads(path.read_text()) for path in told.logs]
    errors_mrad = []
    for robot in told.robot:
        away = [np.subtract(*rollout_rad(told.rollout, robot, log, parameters)) for log in logs]
        errors_mrad.append([1e3 * np.abs(away_rad).mean() for away_rad in away])
    for log, path, *errors in zip(logs, told.logs, *errors_mrad, strict=True):
        duty, volts, largest_rad = facts(log)
        told_by_log = f"gain {log['kp']:3}  {log['trajectory']:15}  {duty:.5f}  {volts:.1f} V  {largest_rad:.2f} rad"
        print(path.stem, "", told_by_log, *(f"{error:7.1f}" for error in errors))
    for name, of in ("mean", np.mean), ("standard deviation", np.std):
        print(f"{name:72}", *(f"{of(errors):7.1f}" for errors in errors_mrad))


if __name__ == "__main__":
    main()
