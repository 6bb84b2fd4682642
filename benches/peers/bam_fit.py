"""Fits a joint's friction and armature with `bam.fit` of the package better-actuator-models, its command line unchanged.

    bam_fit.py ROBOT.toml FIT.csv HELD_OUT.csv STEP_S BUDGET_S RESULT.json

The servo of `signals` is BAM's eRob, a joint with a harmonic drive and a proportional-derivative controller: with the torque constant
below, its gains are the robot file's and neither its current nor its voltage saturates. The pendulum is BAM's, a rod with
a mass at its end. What the other peers do not fit is held by BAM's own option `--set`. `bam.fit` never ends by itself before its
100 000 trials: it is stopped after the budget. Time begins when everything is imported.
"""

import importlib.metadata
import json
import math
import pathlib
import runpy
import subprocess
import sys
import tempfile

import numpy as np
import optuna
import wandb  # noqa: F401  (bam.fit imports it: that is not fitting)

import signals

TORQUE_CONSTANT_NM_A = 4.0
RESISTANCE_OHM = 0.1
GRAVITY_M_S2 = 9.80665  # BAM's
LENGTH_M = 0.45


def pendulum(joint):
    """Masses of rod and end that have the link's weight and inertia about the joint."""
    inertia_kg_m2 = joint.inertia_kg_m2 + joint.mass_kg * joint.centre_m**2
    moment_kg_m = joint.mass_kg * joint.centre_m * joint.gravity_m_s2 / GRAVITY_M_S2
    with_third_kg, with_half_kg = inertia_kg_m2 / LENGTH_M**2, moment_kg_m / LENGTH_M
    arm_kg = 6.0 * (with_half_kg - with_third_kg)
    return {"mass": with_half_kg - arm_kg / 2.0, "arm_mass": arm_kg, "length": LENGTH_M}


def raw_log(joint, log):
    gain = joint.stiffness_nm_rad / TORQUE_CONSTANT_NM_A
    entries = [
        {
            "timestamp": float(t),
            "position": float(q),
            "speed": float(v),
            "control": float(u / TORQUE_CONSTANT_NM_A),
            "goal_position": float(goal),
            "torque_enable": True,
        }
        for t, q, v, u, goal in zip(
            log.time_s, log.position_rad, log.velocity_rad_s, log.torque_nm, log.goal_rad, strict=True
        )
    ]
    damping = joint.damping_nm_s_rad / TORQUE_CONSTANT_NM_A / math.sqrt(gain)
    return {**pendulum(joint), "kp": gain, "damping": damping, "motor": "erob", "trajectory": "log", "entries": entries}


def processed(joint, log, step_s, folder):
    """The log as `bam.process` leaves it."""
    raw, done = folder / "raw", folder / "processed"
    for made in (raw, done):
        made.mkdir(parents=True)
    (raw / "log.json").write_text(json.dumps(raw_log(joint, log)))
    command = [sys.executable, "-m", "bam.process", "--raw", raw, "--logdir", done, "--dt", step_s]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return done


def held(joint):
    values = {"kt": TORQUE_CONSTANT_NM_A, "R": RESISTANCE_OHM, "q_offset": 0.0}
    rise_nm = joint.value("stribeck_friction", "stribeck_nm")
    if rise_nm == 0.0:
        return "m1", values
    velocity_rad_s = joint.value("stribeck_friction", "stribeck_velocity_rad_s")
    return "m2", {**values, "friction_stribeck": rise_nm, "dtheta_stribeck": velocity_rad_s, "alpha": 1.0}


def main():
    robot, fit, held_out, step_s, budget_s, result = sys.argv[1:]
    joint = signals.read_joint(robot)
    folder = pathlib.Path(tempfile.mkdtemp(dir=pathlib.Path(result).parent))
    fit_folder = processed(joint, signals.read_log(fit, joint), step_s, folder / "fit")
    held_out_folder = processed(joint, signals.read_log(held_out, joint), step_s, folder / "held_out")
    model, values = held(joint)
    trace = []
    optimize = optuna.study.Study.optimize

    def noted_optimize(study, objective, callbacks=(), **options):
        def note(study, trial):
            entry = {"seconds": clock.seconds(), "runs": trial.number + 1, "cost": trial.value}
            names = ("friction_base", "friction_viscous", "armature")
            trace.append({**entry, "values": [trial.params[name] for name in names]})
            if entry["seconds"] > float(budget_s):
                study.stop()

        optimize(study, objective, callbacks=[*callbacks, note], **options)

    optuna.study.Study.optimize = noted_optimize
    sys.argv = ["bam.fit", "--actuator", "erob80_100", "--model", model, "--logdir", str(fit_folder)]
    sys.argv += ["--set", repr(values), "--output", str(folder / "params.json")]
    clock = signals.Clock()
    runpy.run_module("bam.fit", run_name="__main__")
    wall_seconds = clock.wall_seconds()
    last = trace[-1]

    from bam.model import load_model_from_dict
    from bam.simulate import Simulator

    log = json.loads((held_out_folder / "log.json").read_text())
    recorded = np.array([entry["position"] for entry in log["entries"]])
    time_s = log["dt"] * np.arange(len(recorded))

    def own_error_rad(found):
        names = dict(zip(("friction_base", "friction_viscous", "armature"), found, strict=True))
        fitted = load_model_from_dict({"model": model, "actuator": "erob80_100", **values, **names})
        positions, _, _ = Simulator(fitted).rollout_log(log, simulate_control=True)
        return signals.rms_after_start(time_s, np.array(positions) - recorded)

    kept = signals.improvements(trace)
    for entry in kept:
        entry["own_error_rad"] = own_error_rad(entry["values"])
    version = importlib.metadata.version("better-actuator-models")
    signals.write(
        result,
        name=f"better-actuator-models {version}, {model}, step {1000 * float(step_s):.3g} ms",
        seconds=last["seconds"],
        wall_seconds=wall_seconds,
        runs=last["runs"],
        values=kept[-1]["values"],
        trace=kept,
    )


if __name__ == "__main__":
    main()
