"""Writes rigid_body_reference.json: random serial chains and trees, and what Pinocchio computes for them.

    pip install pin==4.1.0
    python rigid_body_reference.py
"""

import json
import pathlib

import numpy as np
import pinocchio as pin

JOINTS_MAX = 16
STATES_PER_CHAIN = 3
# Joints of the trees, whose joints turn or slide and hang on any link before them or on the base.
TREES = [2, 3, 4, 5, 7, 9, 12, 16, 16, 24]
# Number of chain -> axes that are exactly along or against z, where a shortest turn to z needs care.
SPECIAL_AXES = {3: [0.0, 0.0, 1.0], 5: [0.0, 0.0, -1.0]}


def unit_vector(rng):
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def random_frame(rng):
    quaternion = rng.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    translation = rng.uniform(-0.5, 0.5, size=3)
    return pin.SE3(pin.Quaternion(quaternion).toRotationMatrix(), translation)


def frame_json(frame):
    quaternion = pin.Quaternion(frame.rotation)
    return {"translation_m": frame.translation.tolist(), "quaternion_xyzw": quaternion.coeffs().tolist()}


def random_inertia(rng, mass_kg):
    """The central inertia of point masses, so that it belongs to a body."""
    points = rng.uniform(-0.2, 0.2, size=(6, 3))
    points -= points.mean(axis=0)
    second_moment = mass_kg / 6 * points.T @ points
    return np.trace(second_moment) * np.eye(3) - second_moment


def random_link(rng, joint_count):
    mass_kg = rng.uniform(0.2, 5.0)
    return {
        "origin": frame_json(random_frame(rng)),
        "axis": SPECIAL_AXES.get(joint_count, unit_vector(rng).tolist()),
        "mass_kg": mass_kg,
        "centre_of_mass_m": rng.uniform(-0.3, 0.3, size=3).tolist(),
        "inertia_kg_m2": random_inertia(rng, mass_kg).tolist(),
    }


def frame_of(frame):
    return pin.SE3(pin.Quaternion(np.array(frame["quaternion_xyzw"])).toRotationMatrix(), np.array(frame["translation_m"]))


def pinocchio_model(chain):
    model = pin.Model()
    model.gravity.linear = np.array(chain["gravity_m_s2"])
    for number, link in enumerate(chain["links"]):
        kind = pin.JointModelPrismaticUnaligned if link.get("slides") else pin.JointModelRevoluteUnaligned
        # the base is Pinocchio's joint 0, so link i is its joint i + 1
        parent = link.get("parent", number - 1)
        joint = model.addJoint(parent + 1, kind(np.array(link["axis"])), frame_of(link["origin"]), f"joint{number}")
        inertia = pin.Inertia(link["mass_kg"], np.array(link["centre_of_mass_m"]), np.array(link["inertia_kg_m2"]))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    return model


def random_state(rng, model, tool):
    position = rng.uniform(-np.pi, np.pi, size=model.nq)
    velocity = rng.uniform(-2.0, 2.0, size=model.nv)
    acceleration = rng.uniform(-5.0, 5.0, size=model.nv)
    applied = rng.uniform(-20.0, 20.0, size=model.nv)
    data = model.createData()
    state = {
        "position_rad": position.tolist(),
        "velocity_rad_s": velocity.tolist(),
        "acceleration_rad_s2": acceleration.tolist(),
        "inverse_dynamics_nm": pin.rnea(model, data, position, velocity, acceleration).tolist(),
        "gravity_torque_nm": pin.computeGeneralizedGravity(model, data, position).tolist(),
        "applied_torque_nm": applied.tolist(),
        "forward_dynamics_rad_s2": pin.aba(model, data, position, velocity, applied).tolist(),
        "potential_energy_j": pin.computePotentialEnergy(model, data, position),
    }
    pin.forwardKinematics(model, data, position)
    state["last_joint_frame"] = frame_json(data.oMi[model.njoints - 1])
    state["tool_pose"] = frame_json(data.oMi[model.njoints - 1] * tool)
    return state


def random_chain(rng, joint_count):
    chain = {
        "gravity_m_s2": (9.81 * unit_vector(rng)).tolist(),
        "tool": frame_json(random_frame(rng)),
        "links": [random_link(rng, joint_count) for _ in range(joint_count)],
    }
    model = pinocchio_model(chain)
    chain["states"] = [random_state(rng, model, frame_of(chain["tool"])) for _ in range(STATES_PER_CHAIN)]
    return chain


def random_tree(rng, joint_count):
    tree = {
        "gravity_m_s2": (9.81 * unit_vector(rng)).tolist(),
        "tool": frame_json(random_frame(rng)),
        "links": [
            random_link(rng, joint_count)
            | {"parent": int(rng.integers(max(-1, number - 4), number)), "slides": bool(rng.random() < 0.3)}
            for number in range(joint_count)
        ],
    }
    model = pinocchio_model(tree)
    tree["states"] = [random_state(rng, model, frame_of(tree["tool"])) for _ in range(STATES_PER_CHAIN)]
    return tree


def main():
    rng = np.random.default_rng(20240731)
    chains = [random_chain(rng, joint_count) for joint_count in range(1, JOINTS_MAX + 1)]
    trees = [random_tree(rng, joint_count) for joint_count in TREES]
    one_per_line = [",\n".join(json.dumps(chain) for chain in group) for group in (chains, trees)]
    path = pathlib.Path(__file__).with_suffix(".json")
    path.write_text(
        f'{{"pinocchio": "{pin.__version__}", "chains": [\n{one_per_line[0]}\n], "trees": [\n{one_per_line[1]}\n]}}\n'
    )


if __name__ == "__main__":
    main()
