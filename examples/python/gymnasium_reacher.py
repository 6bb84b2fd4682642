"""A Gymnasium environment brought nearer to the robot that its policy shall run on.

    pip install ./python "gymnasium[mujoco]"
    python examples/python/gymnasium_reacher.py

The robot is Reacher-v5 with friction that the environment's model does not have; nobody tells the diagnosis. One policy acts on
the robot, on the environment as it comes, and on the environment with the mended model. Writes mended_reacher.xml.
"""

from pathlib import Path

import gymnasium
import mujoco
import numpy as np

import flexspline as fx

MODEL = Path(gymnasium.__file__).parent / "envs/mujoco/assets/reacher.xml"
JOINTS = ("joint0", "joint1")
# What the robot has beside the damping of the model, 1 Nm s/rad.
FRICTION_NM = {"joint0": 4.0, "joint1": 2.0}
MORE_DAMPING_NM_S_RAD = {"joint0": 1.5, "joint1": 0.8}
STEPS = 3000
POSITION_NOISE_RAD = 1e-5


def robot_file() -> str:
    """The model with the hidden friction, written to a file as Gymnasium wants it."""
    spec = mujoco.MjSpec.from_file(str(MODEL))
    for joint in spec.joints:
        if joint.name in JOINTS:
            joint.frictionloss = FRICTION_NM[joint.name]
            joint.damping[0] += MORE_DAMPING_NM_S_RAD[joint.name]
    spec.compile()
    path = Path("robot_reacher.xml").resolve()
    path.write_text(spec.to_xml())
    return str(path)


def policy(observation: np.ndarray, step: int, dt: float) -> np.ndarray:
    """Moves both joints along sums of sines; feedback by the angles that the observation tells."""
    time = step * dt
    angle = np.arctan2(observation[2:4], observation[0:2])
    wanted = np.array([0.5 * np.sin(0.9 * time) + 0.5 * np.sin(2.1 * time), 0.6 * np.sin(1.3 * time + 1) + 0.4 * np.sin(2.7 * time)])
    return np.clip((20.0 * (wanted - angle) - 4.0 * observation[6:8]) / 200.0, -1.0, 1.0).astype(np.float32)


def run(model: str) -> dict[str, np.ndarray]:
    """An episode: time, angle and torque, a row a step."""
    environment = gymnasium.make("Reacher-v5", xml_file=model, max_episode_steps=STEPS)
    observation, _ = environment.reset(seed=3)
    inner = environment.unwrapped
    inner.set_state(np.zeros_like(inner.data.qpos), np.zeros_like(inner.data.qvel))
    observation = inner._get_obs()
    rows = {name: [] for name in ("time", "angle", "torque")}
    for step in range(STEPS):
        action = policy(observation, step, inner.dt)
        rows["time"].append(step * inner.dt)
        rows["angle"].append(inner.data.qpos[:2].copy())
        rows["torque"].append(200.0 * action.astype(float))
        observation, *_ = environment.step(action)
    environment.close()
    return {name: np.array(column) for name, column in rows.items()}


def apart_mrad(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> np.ndarray:
    """How far two episodes are apart, rms a joint."""
    return 1e3 * np.sqrt(np.mean((one["angle"] - other["angle"]) ** 2, axis=0))


def main() -> tuple[np.ndarray, np.ndarray]:
    """Distance between robot and environment before and after, mrad rms a joint."""
    real, before = run(robot_file()), run(str(MODEL))
    noise = np.random.default_rng(1)
    joints = {
        joint: {
            "link_position_rad": real["angle"][:, k] + noise.normal(0.0, POSITION_NOISE_RAD, STEPS),
            "motor_torque_nm": real["torque"][:, k],
        }
        for k, joint in enumerate(JOINTS)
    }
    report = fx.diagnose(MODEL, fx.Recording.from_arrays(real["time"], joints, name="robot"))
    print(report)
    mended = Path("mended_reacher.xml").resolve()
    report.apply().to_mjcf(mended)
    after = run(str(mended))
    distances = apart_mrad(real, before), apart_mrad(real, after)
    for k, joint in enumerate(JOINTS):
        print(f"{joint}: environment and robot are {distances[0][k]:.1f} mrad apart, {distances[1][k]:.2f} mrad once mended")
    return distances


if __name__ == "__main__":
    main()
