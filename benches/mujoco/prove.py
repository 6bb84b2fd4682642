"""Is MuJoCo closer to the robot once the diagnosed effects are in its model?

    pip install -r benches/mujoco/requirements.txt
    pip install --no-deps -r benches/mujoco/models.txt
    cargo build --release --bin flexspline
    python benches/mujoco/prove.py target/release/flexspline > table.md

The robot is MuJoCo itself with one effect more than its model: put into the compiled model, not by Flexspline. It is recorded
on one motion and diagnosed against the model; `gap apply --format mjcf` writes a new model; and on another motion the robot,
the model as it was and the new one follow the same reference under the same controller. The error is the rms difference of
the joints' positions between robot and model.

`--only panda:payload` runs one; `--keep DIR` keeps its files.
"""

import argparse
import importlib.util
import json
import pathlib
import subprocess
import tempfile

import mujoco
import numpy as np

STEP_S = 0.001
ROW_STEPS = 2  # a recording has 500 rows a second
RECORDED_S, HELD_OUT_S = 20.0, 10.0
POSITION_NOISE_RAD, VELOCITY_NOISE_RAD_S = 1e-5, 1e-3
TORQUE_NOISE = 2e-4  # of the largest torque

ROBOTS = {
    "panda": ("robosuite", "models/assets/robots/panda/robot.xml"),
    "sawyer": ("robosuite", "models/assets/robots/sawyer/robot.xml"),
    "pendulum": ("dm_control", "suite/pendulum.xml"),
}


def model_file(robot, folder):
    package, path = ROBOTS[robot]
    path = pathlib.Path(importlib.util.find_spec(package).submodule_search_locations[0]) / path
    if robot != "pendulum":
        return path
    # its motor of 1 Nm cannot lift the mass; a user who records a robot has one that can
    text = path.read_text().replace('ctrlrange="-1 1"', 'ctrlrange="-20 20"')
    text = text.replace('file="./common/', f'file="{path.parent}/common/')
    own = folder / "pendulum.xml"
    own.write_text(text)
    return own


class Arm:
    """A compiled model whose motors are told torques."""

    def __init__(self, path):
        self.model = model = mujoco.MjModel.from_xml_path(str(path))
        model.opt.timestep = STEP_S
        # links that touch each other are none of the effects
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.data = mujoco.MjData(model)
        self.applied = lambda dq: 0.0
        assert model.nu == model.njnt == model.nv
        self.joints = [model.joint(int(model.actuator_trnid[i, 0])).id for i in range(model.nu)]
        assert self.joints == sorted(self.joints)
        self.names = [model.joint(i).name for i in range(model.njnt)]
        self.limit = np.abs(model.actuator_ctrlrange[:, 1]).copy()


class Controller:
    """Proportional-derivative feedback with the weight by the model as it was."""

    def __init__(self, path):
        self.arm = Arm(path)
        model, data = self.arm.model, self.arm.data
        ranges = np.where(model.jnt_limited[:, None], model.jnt_range, [-np.pi, np.pi])
        self.centre = ranges.mean(axis=1)
        self.reach = np.minimum(0.25 * (ranges[:, 1] - ranges[:, 0]), 0.7)
        data.qpos[:] = self.centre
        mujoco.mj_forward(model, data)
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        self.inertia_kg_m2 = np.diag(inertia).copy()
        self.stiffness = (2 * np.pi * 2.0) ** 2 * self.inertia_kg_m2
        self.damping = 2 * 0.7 * 2 * np.pi * 2.0 * self.inertia_kg_m2

    def torque(self, goal, speed, q, dq):
        model, data = self.arm.model, self.arm.data
        data.qpos[:], data.qvel[:] = q, dq
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        torque = self.stiffness * (goal - q) + self.damping * (speed - dq) + data.qfrc_bias
        return np.clip(torque, -self.arm.limit, self.arm.limit)


class Motion:
    """Sums of three sines a joint."""

    def __init__(self, controller, seed):
        random = np.random.default_rng(seed)
        joints = len(controller.centre)
        self.centre = controller.centre
        self.rate = 2 * np.pi * random.uniform([0.1, 0.25, 0.6], [0.2, 0.5, 1.0], (joints, 3))
        self.phase = random.uniform(0, 2 * np.pi, (joints, 3))
        self.size = controller.reach[:, None] * [0.6, 0.3, 0.1]

    def at(self, t):
        angle = self.rate * t + self.phase
        goal = self.centre + (self.size * np.sin(angle)).sum(axis=1)
        return goal, (self.size * self.rate * np.cos(angle)).sum(axis=1)


def run(arm, controller, motion, seconds):
    """Rows of reference, its velocity, position, velocity and the torque the motors were told."""
    model, data = arm.model, arm.data
    mujoco.mj_resetData(model, data)
    data.qpos[:], data.qvel[:] = motion.at(0.0)
    rows = []
    for step in range(round(seconds / STEP_S)):
        goal, speed = motion.at(step * STEP_S)
        q, dq = data.qpos.copy(), data.qvel.copy()
        torque = controller.torque(goal, speed, q, dq)
        data.ctrl[:] = torque
        data.qfrc_applied[:] = arm.applied(dq)
        if step % ROW_STEPS == 0:
            rows.append([goal, speed, q, dq, torque])
        mujoco.mj_step(model, data)
    return np.array(rows)


def write(path, rows, arm, seed):
    random = np.random.default_rng(seed)
    goal, speed, q, dq, torque = rows.transpose(1, 0, 2)
    q = q + random.normal(0, POSITION_NOISE_RAD, q.shape)
    dq = dq + random.normal(0, VELOCITY_NOISE_RAD_S, dq.shape)
    torque = torque + random.normal(0, 1, torque.shape) * TORQUE_NOISE * arm.limit
    signals = {
        "reference_position_rad": goal,
        "reference_velocity_rad_s": speed,
        "link_position_rad": q,
        "link_velocity_rad_s": dq,
        "motor_torque_nm": torque,
    }
    columns = {"time_s": np.arange(len(rows)) * STEP_S * ROW_STEPS}
    for index, name in enumerate(arm.names):
        columns |= {f"{name}.{signal}": values[:, index] for signal, values in signals.items()}
    np.savetxt(path, np.array(list(columns.values())).T, "%.9g", ",", header=",".join(columns), comments="")


def coulomb(arm):
    arm.model.dof_frictionloss[:] += 0.2 * arm.usual_nm


def viscous(arm):
    arm.model.dof_damping[:] += 0.3 * arm.usual_nm


def quadratic(arm):
    arm.model.dof_dampingpoly[:, 0] += 0.3 * arm.usual_nm


def armature(arm):
    arm.model.dof_armature[:] += 0.3 * arm.inertia_kg_m2
    mujoco.mj_setConst(arm.model, arm.data)


def spring(arm):
    arm.model.jnt_stiffness[:] += 0.5 * arm.usual_nm
    arm.model.qpos_spring[:] = 0.2


def offset(arm):
    arm.applied = lambda dq: 0.3 * arm.usual_nm


def constant(arm):
    arm.model.actuator_gear[:, 0] *= 0.85


def payload(arm):
    model = arm.model
    body = model.jnt_bodyid[-1]
    mass_kg, centre_m = model.body_mass[body], model.body_ipos[body].copy()
    added_kg, at_m = 0.1 * model.body_subtreemass[model.jnt_bodyid[0]], centre_m + [0.0, 0.0, 0.1]
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    turn = turn.reshape(3, 3)
    inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
    lever = at_m - centre_m
    inertia += mass_kg * added_kg / (mass_kg + added_kg) * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    model.body_mass[body] = mass_kg + added_kg
    model.body_ipos[body] = (mass_kg * centre_m + added_kg * at_m) / (mass_kg + added_kg)
    mujoco.mju_mat2Quat(model.body_iquat[body], axes.flatten())
    model.body_inertia[body] = moments
    mujoco.mj_setConst(model, arm.data)


def stribeck(arm):
    # beside Coulomb friction: more where the joint is slow
    coulomb(arm)
    arm.applied = lambda dq: -0.15 * arm.usual_nm * np.exp(-np.abs(dq) / 0.05) * np.tanh(dq / 0.005)


EFFECTS = {
    "coulomb_friction": coulomb,
    "viscous_friction": viscous,
    "quadratic_friction": quadratic,
    "rotor_inertia": armature,
    "joint_spring": spring,
    "torque_offset": offset,
    "torque_constant_error": constant,
    "payload": payload,
    "coulomb_friction and stribeck_friction": stribeck,
}


def ask(binary, *arguments):
    """Exit code and the last line that was said."""
    done = subprocess.run([binary, *map(str, arguments)], capture_output=True, text=True)
    said = (done.stdout + done.stderr).strip().splitlines()
    return done.returncode, said[-1] if said else ""


def named(report):
    """Effects with the number of joints that have them; minor ones where nothing else is named."""
    shared = [f"{shared['effect']} (arm)" for shared in report["shared_effects"]]
    for kind, words in (("effects", ""), ("minor_effects", "minor: ")):
        counts = {}
        for joint in report["joints"]:
            for effect in joint[kind]:
                counts[effect["effect"]] = counts.get(effect["effect"], 0) + 1
        told = shared + [f"{name} ({count})" for name, count in counts.items()]
        if told:
            return words + ", ".join(told)
    return "nothing"


def error_mrad(rows, others):
    return 1e3 * np.sqrt(np.mean((rows[:, 2] - others[:, 2]) ** 2))


def prove(binary, robot, effect, folder):
    path = model_file(robot, folder)
    controller = Controller(path)
    motion = Motion(controller, 1)
    real = Arm(path)
    # effects are so large beside what the joint needs anyway
    usual = run(Arm(path), controller, motion, RECORDED_S)[:, 4]
    real.usual_nm = np.sqrt(np.mean(usual**2, axis=0))
    real.inertia_kg_m2 = controller.inertia_kg_m2
    EFFECTS[effect](real)
    recording, report, mended = (folder / name for name in ("real.csv", "report.json", "mended.xml"))
    write(recording, run(real, controller, motion, RECORDED_S), real, 2)
    code, said = ask(binary, "gap", "diagnose", "--robot", path, "--recording", recording, "--json", report)
    if code != 0:
        return [said, "", "", "", ""]
    found = json.loads(report.read_text())
    other = Motion(controller, 3)
    truth = run(real, controller, other, HELD_OUT_S)
    before = error_mrad(truth, run(Arm(path), controller, other, HELD_OUT_S))
    code, said = ask(
        binary, "gap", "apply", "--report", report, "--robot", path, "--format", "mjcf", "--out", mended,
        "--json", folder / "applied.json",
    )
    if code != 0:
        return [named(found), "0", f"{before:.3g}", f"{before:.3g}", said]
    applied = json.loads((folder / "applied.json").read_text())
    weights = {joint["joint"]: joint["gap"]["torque_rms_nm"]["before"] ** 2 for joint in found["joints"]}
    total = sum(weights[joint["joint"]] for joint in applied["joints"]) or 1.0
    written = sum(weights[joint["joint"]] * joint["written"] for joint in applied["joints"]) / total
    after = error_mrad(truth, run(Arm(mended), controller, other, HELD_OUT_S))
    closer = f"{100 * (1 - after / before):.0f} %"
    return [named(found), f"{100 * written:.0f} %", f"{before:.3g}", f"{after:.3g}", closer]


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("binary")
    arguments.add_argument("--only", action="append", default=[], metavar="ROBOT:EFFECT")
    arguments.add_argument("--keep", type=pathlib.Path, metavar="DIR")
    arguments = arguments.parse_args()
    print("| robot | effect put in | named, on so many joints | share written | error before, mrad | after | closer |")
    print("|---|---|---|---|---|---|---|")
    for robot in ROBOTS:
        for effect in EFFECTS:
            if arguments.only and f"{robot}:{effect}" not in arguments.only:
                continue
            with tempfile.TemporaryDirectory() as folder:
                kept = arguments.keep and arguments.keep / f"{robot}-{effect.split()[0]}-{len(effect)}"
                if kept:
                    kept.mkdir(parents=True, exist_ok=True)
                told = prove(arguments.binary, robot, effect, kept or pathlib.Path(folder))
            print("|", " | ".join([robot, effect, *told]), "|", flush=True)


if __name__ == "__main__":
    main()
