"""A robot that rubs and a simulation that does not: diagnosed, mended, and simulated again.

    pip install ./python mujoco
    python examples/python/mujoco_arm.py

The robot is MuJoCo itself with friction that arm.xml does not have; nobody tells the diagnosis. Writes mended.xml.
"""

from pathlib import Path

import mujoco
import numpy as np

import flexspline as fx

ARM = Path(__file__).parent / "arm.xml"
# What the robot has and its description has not.
HIDDEN = {"shoulder": {"frictionloss": 2.5, "damping": 1.2}, "elbow": {"frictionloss": 0.8, "damping": 0.5}}
SECONDS = 30.0
TORQUE_NOISE_NM = 0.1
# A controller as robots have it: soft, so that a wrong model shows in how far it is off.
STIFFNESS_NM_RAD = np.array([60.0, 25.0])
DAMPING_NM_S_RAD = np.array([6.0, 2.5])


def robot() -> mujoco.MjModel:
    """The model with the hidden friction."""
    spec = mujoco.MjSpec.from_file(str(ARM))
    for joint in spec.joints:
        joint.frictionloss = HIDDEN[joint.name]["frictionloss"]
        # MuJoCo's own makes a creep of dry friction; this is as stiff as its step allows
        joint.solref_friction[0] = 2 * spec.option.timestep
        joint.damping[0] = HIDDEN[joint.name]["damping"]
    return spec.compile()


def reference(time: float) -> tuple[np.ndarray, np.ndarray]:
    """Position and velocity that both joints shall follow: sums of sines."""
    frequencies, phases = np.array([[0.13, 0.29, 0.53], [0.17, 0.37, 0.61]]), np.array([[0.0, 1.0, 2.0], [0.5, 2.5, 4.0]])
    w = 2 * np.pi * frequencies
    return 0.3 * np.sin(w * time + phases).sum(axis=1), 0.3 * (w * np.cos(w * time + phases)).sum(axis=1)


def run(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    """Follows the reference: time, position, velocity and torque, a row a step."""
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = reference(0.0)
    rows = {name: [] for name in ("time", "reference", "position", "velocity", "torque")}
    while data.time < SECONDS:
        wanted, speed = reference(data.time)
        data.ctrl[:] = STIFFNESS_NM_RAD * (wanted - data.qpos) + DAMPING_NM_S_RAD * (speed - data.qvel)
        values = data.time, wanted, data.qpos.copy(), data.qvel.copy(), data.ctrl.copy()
        for column, value in zip(rows.values(), values):
            column.append(value)
        mujoco.mj_step(model, data)
    return {name: np.array(column) for name, column in rows.items()}


def recording(rows: dict[str, np.ndarray], name: str) -> fx.Recording:
    """What a robot's sensors record: encoders of 17 bits, torque with noise. Without a gear both of its sides are the same."""
    noise = np.random.default_rng(1)
    step = 2 * np.pi / 2**17
    joints = {
        joint: {
            "reference_position_rad": rows["reference"][:, index],
            "link_position_rad": step * np.round(rows["position"][:, index] / step),
            "motor_torque_nm": rows["torque"][:, index] + noise.normal(0.0, TORQUE_NOISE_NM, len(rows["time"])),
        }
        for index, joint in enumerate(HIDDEN)
    }
    return fx.Recording.from_arrays(time=rows["time"], joints=joints, name=name)


def apart_mrad(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> np.ndarray:
    """How far two runs are apart, rms a joint."""
    return 1e3 * np.sqrt(np.mean((one["position"] - other["position"]) ** 2, axis=0))


def main() -> tuple[np.ndarray, np.ndarray]:
    """Distance between robot and simulation before and after, mrad rms a joint."""
    real = run(robot())
    before = run(mujoco.MjModel.from_xml_path(str(ARM)))

    report = fx.diagnose(ARM, recording(real, "robot"))
    print(report)
    mended = report.apply()
    print("\n".join(mended.changes))

    after = run(mujoco.MjModel.from_xml_string(mended.to_mjcf("mended.xml")))
    distances = apart_mrad(real, before), apart_mrad(real, after)
    for index, joint in enumerate(HIDDEN):
        print(f"{joint}: simulation and robot are {distances[0][index]:.2f} mrad apart, {distances[1][index]:.2f} mrad once mended")
    return distances


if __name__ == "__main__":
    main()
