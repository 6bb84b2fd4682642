"""Inverse dynamics of other people's models, ours beside Pinocchio's and MuJoCo's.

    pip install -r benches/robots/requirements.txt
    pip install --no-deps -r benches/robots/models.txt
    cargo build --release -p robot --example inverse_dynamics
    python benches/robots/compare.py target/release/examples/inverse_dynamics > table.md

Every URDF of example-robot-data is loaded by Pinocchio with a fixed base; every MJCF of the other packages by MuJoCo, whose
contact, constraints, friction, springs, armature and fluid are switched off, for they are no rigid bodies; ball and free joints
stay where they stand. Five motions of all joints each; the difference is the largest one relative to the largest torque.
"""

import importlib.util
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

import mujoco
import numpy as np
import pinocchio as pin


def ours(binary, path):
    run = subprocess.run([binary, str(path), "5"], capture_output=True, text=True, timeout=60)
    if run.returncode != 0:
        return {"refused": "PANIC " + run.stderr.strip().splitlines()[0]}
    return json.loads(run.stdout)


def usable(name):
    """What a joint of this name is called in a robot file."""
    return re.sub(r'[\s,."]', "_", name)


def package(name):
    return pathlib.Path(importlib.util.find_spec(name).submodule_search_locations[0])


class Pinocchio:
    name = "Pinocchio"

    def __init__(self, path, found):
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.model.gravity.linear = np.array(found["gravity"])

    def torque(self, joints, motion):
        model = self.model
        q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        columns = []
        called = {usable(name): name for name in model.names}
        for name, position, velocity, acceleration in zip(
            joints, motion["position"], motion["velocity"], motion["acceleration"]
        ):
            index = model.getJointId(called[name])
            joint = model.joints[index]
            if joint.nq == 2:
                q[joint.idx_q : joint.idx_q + 2] = np.cos(position), np.sin(position)
            else:
                q[joint.idx_q] = position
            v[joint.idx_v], a[joint.idx_v] = velocity, acceleration
            columns.append(joint.idx_v)
        return pin.rnea(model, self.data, q, v, a)[columns]

    def joints(self):
        return self.model.njoints - 1


class Mujoco:
    name = "MuJoCo"

    def __init__(self, path, found):
        self.model = model = mujoco.MjModel.from_xml_path(str(path))
        flags = mujoco.mjtDisableBit
        model.opt.disableflags |= flags.mjDSBL_CONSTRAINT
        if not np.any(found["gravity"]):
            model.opt.gravity[:] = 0
        model.opt.density = model.opt.viscosity = 0
        model.dof_damping[:] = 0
        model.dof_frictionloss[:] = 0
        model.dof_armature[:] = 0
        model.jnt_stiffness[:] = 0
        model.body_gravcomp[:] = 0
        for tendon in ("tendon_stiffness", "tendon_damping", "tendon_armature"):
            getattr(model, tendon)[:] = 0
        self.data = mujoco.MjData(model)
        self.held = held_of(found.get("notes", []))
        # what MuJoCo computed of the armature it was given
        mujoco.mj_setConst(model, self.data)
        self.names = {usable(model.joint(i).name): i for i in range(model.njnt)}

    def torque(self, joints, motion):
        model, data = self.model, self.data
        data.qpos[:] = model.qpos0
        for name, position in self.held.items():
            data.qpos[model.jnt_qposadr[self.names[name]]] = position
        data.qvel[:], data.qacc[:] = 0, 0
        columns = []
        for name, position, velocity, acceleration in zip(
            joints, motion["position"], motion["velocity"], motion["acceleration"]
        ):
            index = self.names[name]
            column = model.jnt_dofadr[index]
            data.qpos[model.jnt_qposadr[index]] = position
            data.qvel[column], data.qacc[column] = velocity, acceleration
            columns.append(column)
        mujoco.mj_inverse(model, data)
        return data.qfrc_inverse[columns].copy()

    def joints(self):
        return self.model.njnt


def held_of(notes):
    held = {}
    for note in notes:
        if note.startswith("held"):
            for part in note.split(": ", 1)[1].split(", "):
                name, _, rest = part.partition("` at ")
                held[name.strip("`")] = float(rest.split()[0])
    return held


def short(path):
    """The path in its package."""
    parts = path.parts
    root = "example-robot-data" if "example-robot-data" in parts else "site-packages"
    return "/".join(parts[parts.index(root) + 1 :])


def compare(kind, path, binary):
    """Result, joints and words for one model; `None` where there is no joint to compare."""
    found = ours(binary, path)
    refused = found.get("refused", "").replace(f"{path.parent}/", "")
    if "robot needs at least one" in refused:
        return None
    try:
        model = kind(path, found | {"gravity": found.get("gravity", [0, 0, -9.81])})
    except Exception as error:  # noqa: BLE001
        why = str(error).strip().splitlines()[0].replace(f"{path.parent}/", "")
        return f"{kind.name} does not read it", "", why
    if refused:
        return "refused", model.joints(), refused
    worst = 0.0
    for motion in found["motions"]:
        theirs = model.torque(found["joints"], motion)
        worst = max(worst, np.abs(theirs - motion["torque"]).max() / max(np.abs(theirs).max(), 1e-300))
    held = len(held_of(found["notes"]))
    fixed = sum("taken as fixed" in note for note in found["notes"])
    words = [f"{held} held"] * (held > 0) + [f"{fixed} free or ball joints fixed"] * (fixed > 0)
    return worst, len(found["joints"]), ", ".join(words)


def main():
    binary = str(pathlib.Path(sys.argv[1]).resolve())
    # MuJoCo leaves a log where it runs
    os.chdir(tempfile.mkdtemp())
    prefix = pathlib.Path(pin.__file__).parents[4]
    urdfs = sorted(prefix.glob("share/example-robot-data/robots/**/*.urdf"))
    xmls = sorted(path for name in ("robosuite", "dm_control", "gymnasium") for path in package(name).rglob("*.xml"))
    models = [(Pinocchio, path) for path in urdfs]
    models += [(Mujoco, path) for path in xmls if "<mujoco" in path.read_text(errors="replace")]
    rows, jointless = [], 0
    for kind, path in models:
        result = compare(kind, path, binary)
        if result is None:
            jointless += 1
        else:
            rows.append((short(path), kind.name, *result))
    print("| model | beside | joints | largest relative difference | |\n|---|---|---|---|---|")
    for path, name, result, joints, words in rows:
        result = f"{result:.1e}" if isinstance(result, float) else result
        print(f"| {path} | {name} | {joints} | {result} | {words} |")
    compared = [row[2] for row in rows if isinstance(row[2], float)]
    print(
        f"\n{sum(error < 1e-9 for error in compared)} of {len(compared)} compared models agree to 1e-9; "
        f"{len(rows) - len(compared)} were refused by us or by the other; {jointless} files have no joint."
    )


if __name__ == "__main__":
    main()
