"""Simulation, inverse dynamics, suggestions, identification, and a watch along a recording."""

import os
import subprocess

import numpy as np
import pytest
from conftest import COMMAND, EXAMPLES, motion, rigid_nm

import flexspline as fx


@pytest.fixture(scope="module")
def bench():
    return fx.Robot(EXAMPLES / "bench.toml")


@pytest.fixture(scope="module")
def simulated(bench):
    return fx.simulate(bench, "multi_sine", duration_s=12.0)


def test_inverse_dynamics_is_that_of_the_equation(robot):
    _, position, velocity, acceleration = motion(4.0)
    torque = robot.inverse_dynamics(position, velocity, acceleration)
    assert torque.shape == position.shape
    assert np.allclose(torque, rigid_nm(position, velocity, acceleration), atol=1e-9)
    assert np.array_equal(robot.inverse_dynamics(position[3], velocity[3], acceleration[3]), torque[3])
    strided = robot.inverse_dynamics(*(np.asfortranarray(one)[::2] for one in (position, velocity, acceleration)))
    assert np.array_equal(strided, torque[::2])


def test_rotors_count_by_the_square_of_the_gear_ratio(bench):
    still, moving = np.zeros((1, 1)), np.ones((1, 1))
    inertia = bench.inverse_dynamics(still, still, moving) - bench.inverse_dynamics(still, still, still)
    # 1.841 kg at 0.3717 m, 0.03345 kg m² about its centre, and a rotor of 1.14e-5 kg m² behind a gear of 100
    assert inertia[0, 0] == pytest.approx(1.841 * 0.3717**2 + 0.03345 + 1.14e-5 * 100**2, rel=1e-9)


def test_motions_of_the_wrong_shape_or_kind_are_refused(robot):
    good = np.zeros((5, 2))
    for bad, part in [
        (np.zeros((5, 3)), "give (rows, 2)"),
        (np.zeros((4, 2)), "one shape"),
        (np.zeros((5, 2), dtype=object), "not numbers"),
        (np.float64(1.0), "give (rows, 2)"),
        ("fast", "not numbers"),
    ]:
        with pytest.raises(fx.InputError, match=part.replace("(", r"\(").replace(")", r"\)")):
            robot.inverse_dynamics(good, good, bad)
    assert robot.inverse_dynamics(good[:0], good[:0], good[:0]).shape == (0, 2)
    assert np.isnan(robot.inverse_dynamics(good, good, np.full((5, 2), np.nan))).all()


def test_a_simulation_has_no_gap_to_its_own_robot(bench, simulated):
    assert len(simulated) == 18_000
    assert fx.diagnose(bench, simulated).joint("joint1").verdict == "no_gap"


def test_a_recording_is_followed(bench, simulated):
    again = fx.simulate(bench, simulated, seed=2)
    reference = simulated["joint1"]["reference_position_rad"]
    assert np.allclose(again["joint1"]["reference_position_rad"][: len(reference) - 10], reference[: len(again) - 10][: len(reference) - 10], atol=1e-3)
    assert not np.array_equal(again["joint1"]["motor_torque_nm"][:100], simulated["joint1"]["motor_torque_nm"][:100])


def test_what_cannot_be_simulated_is_refused(bench, robot, recording):
    with pytest.raises(fx.InputError, match="a twin needs the reference of every joint"):
        fx.simulate(robot, recording)
    with pytest.raises(fx.InputError, match="no_such"):
        fx.simulate(bench, "no_such")
    with pytest.raises(fx.InputError, match="duration_s"):
        fx.simulate(bench, "sine", duration_s=0.0)


def test_nothing_confused_is_no_suggestion(bench, simulated):
    report = fx.diagnose(bench, simulated)
    with pytest.raises(fx.NegativeError, match="nothing to tell apart"):
        fx.suggest(bench, report)


def recorded(folder, trajectory, duration):
    """A run of the emulated bench joint with a spring that its robot file does not know."""
    spring = '[[effect]]\njoint = "joint1"\neffect = "joint_spring"\nstiffness_nm_rad = 6.0\nrest_rad = 0.4\n'
    (folder / "spring.toml").write_text(spring)
    arguments = ["run", "--mode", "lockstep", "--robot", EXAMPLES / "bench.toml", "--trajectory", trajectory]
    arguments += ["--duration", duration, "--inject", folder / "spring.toml", "--estimators", "residual"]
    arguments += ["--instance", f"py-{os.getpid()}", "--record", folder / f"{trajectory.stem}.mcap"]
    subprocess.run([COMMAND, *arguments], check=True, stdout=subprocess.DEVNULL)
    return folder / f"{trajectory.stem}.mcap"


def test_the_suggested_motion_tells_apart_what_the_recording_could_not(bench, tmp_path):
    (tmp_path / "small.toml").write_text('[[joint]]\nkind = "multi_sine"\nname = "joint1"\namplitude_rad = 0.05\n')
    # a spring, a link's weight and an offset of the encoder: all are a torque and a slope over so small a range
    before = fx.diagnose(bench, recorded(tmp_path, tmp_path / "small.toml", "12s"))
    assert any("joint_spring" in pair for pair in before.joint("joint1").confusable)
    steps = []
    suggestion = fx.suggest(bench, before, duration_s=15.0, progress=lambda *step: steps.append(step))
    assert steps and steps[-1][0] == steps[-1][1]
    assert suggestion.experiment in repr(suggestion)
    # what nobody can tell apart is below 9
    assert max(pair["distance_expected"] for pair in suggestion.pairs) > 9.0
    suggestion.save(tmp_path / "next.toml")
    after = fx.diagnose(bench, recorded(tmp_path, tmp_path / "next.toml", "15s")).joint("joint1")
    assert not any("joint_spring" in pair for pair in after.confusable)
    [spring] = [effect for effect in after.effects if effect.name == "joint_spring"]
    assert spring.probability > 0.9
    assert spring.parameters["stiffness_nm_rad"] == pytest.approx(6.0, rel=0.1)


def test_identified_friction_is_that_of_the_emulated_joint(bench, tmp_path):
    told = fx.identify(bench, tmp_path, "friction")
    assert told.joints == bench.joints
    assert "direction_friction" in told.to_toml()
    with pytest.raises(fx.InputError, match="there are friction, periodic"):
        fx.identify(bench, tmp_path, "colour")
    with pytest.raises(fx.InputError, match="no such joint"):
        fx.identify(bench, tmp_path, "friction", joints=["elbow"])


def test_a_watch_learns_and_says_what_appears(bench):
    still = fx.simulate(bench, "multi_sine", duration_s=36.0)
    signals = {name: values.copy() for name, values in still["joint1"].items()}
    # a torque of 4 Nm at the joint that the robot file does not know, from the 24th second on
    late = still.time_s > 24.0
    for name in ("motor_torque_nm", "command_torque_nm"):
        signals[name][late] += 0.04
    changed = fx.Recording.from_arrays(still.time_s, {"joint1": signals})
    events = list(fx.watch(changed, bench, window_s=15.0))
    assert events[0]["event"] == "watching"
    assert 15.0 <= events[0]["at_s"] <= 24.0
    gaps = [event for event in events if event["event"] == "gap"]
    assert gaps, events
    assert gaps[0]["appeared_s"] == pytest.approx(24.0, abs=1.5)
    assert gaps[0]["candidates"][0]["effect"] == "torque_offset"


def test_a_watch_needs_a_robot(simulated):
    with pytest.raises(fx.InputError, match="robot is missing"):
        next(fx.watch(simulated))
