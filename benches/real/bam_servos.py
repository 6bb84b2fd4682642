#!/usr/bin/env python3
"""Logs of a servo with a pendulum (github.com/Rhoban/bam) as CSV that `flexspline` reads.

    bam_servos.py OUT.csv PARAMETERS.json LOG.json...

The log has no current. Its `load` is the duty cycle in parts of 885 (XL330), so the motor's torque follows from the
published torque constant and resistance: `kt·(V - kt·ω)/R`; a motor that is switched off gives none. One segment a log.
"""

import json
import sys

import numpy as np

DUTY_FULL = 885.0
SMOOTH_S = 0.03


def torque_nm(log, parameters):
    entries = log["entries"]
    column = lambda name: np.array([float(entry[name]) for entry in entries])
    time_s, position_rad = column("timestamp"), column("position")
    load = column("load")
    duty = np.where(load > 32767.0, load - 65536.0, load) / DUTY_FULL
    # the reported speed is coarse and late: the position's slope over a short window instead
    velocity_rad_s = np.array(
        [np.polyfit(time_s[near] - at, position_rad[near], 1)[0] for at, near in windows(time_s)]
    )
    kt, ohm = parameters["kt"], parameters["R"]
    driven_nm = kt * (duty * column("input_volts") - kt * velocity_rad_s) / ohm
    return time_s, column("goal_position"), position_rad, np.where(column("torque_enable") > 0.5, driven_nm, 0.0)


def windows(time_s):
    for at in time_s:
        yield at, np.abs(time_s - at) <= SMOOTH_S / 2.0


def main():
    out, parameters, *logs = sys.argv[1:]
    parameters = json.load(open(parameters))
    with open(out, "w") as file:
        file.write("time_s,segment,servo.reference_position_rad,servo.motor_position_rad,servo.motor_torque_nm\n")
        for segment, log in enumerate(logs):
            for row in zip(*torque_nm(json.load(open(log)), parameters)):
                file.write("{:.6f},{},{:.6f},{:.6f},{:.6f}\n".format(row[0], segment, *row[1:]))


if __name__ == "__main__":
    main()
