"""An instance that runs, seen from Python."""

import os
import signal
import subprocess
import time
from contextlib import contextmanager

import numpy as np
import pytest
from conftest import COMMAND, EXAMPLES

import flexspline as fx
from flexspline._live import _row_of


@contextmanager
def running(folder, *options):
    """Name and process of a run in real time on the emulator, there to be attached to; its recording goes to the folder."""
    name = f"python-{os.getpid()}"
    arguments = ["run", "--instance", name, "--duration", "60s", *options]
    run = subprocess.Popen(
        [COMMAND, *arguments], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    try:
        for _ in range(200):
            if run.poll() is not None:
                pytest.skip(f"this machine cannot run an instance: {run.stderr.read().strip()}")
            try:
                fx.attach(name).close()
                break
            except fx.InputError:
                time.sleep(0.1)
        yield name, run
    finally:
        run.terminate()
        run.communicate(timeout=30)


@pytest.fixture
def instance(tmp_path):
    with running(tmp_path, "--robot", "shd17") as started:
        yield started


def test_rows_come_as_long_as_it_runs(instance):
    name, run = instance
    with fx.attach(name) as attached:
        assert attached.joints == ["joint1"]
        taken = []
        for rows in attached:
            taken.append(rows)
            if sum(map(len, taken)) > 200:
                break
        rows = np.concatenate(taken)
        assert np.all(np.diff(rows["cycle"].astype(np.int64)) > 0)
        assert np.allclose(np.diff(rows["time_s"]), np.diff(rows["cycle"].astype(float)) / attached.sample_rate_hz)
        assert rows.dtype == _row_of(1)
        assert np.isfinite(rows["motor_position_rad"]).all()
        assert attached.robot.joints == ["joint1"]
        assert attached.lost == 0
    for _ in range(20):
        with fx.attach(name) as attached:
            assert len(next(iter(attached)))
    with fx.attach(name) as attached:
        batches = iter(attached)
        assert next(batches)["cycle"][0] > rows["cycle"][-1]
        run.send_signal(signal.SIGINT)
        for _ in batches:
            pass
    with pytest.raises(fx.InputError, match="is running"):
        fx.attach(name)


def test_nobody_there_is_said():
    with pytest.raises(fx.InputError, match="no instance `nobody` is running"):
        fx.attach("nobody")


class Played(fx.Attachment):
    """A run in virtual time, handed over as an attachment does: no machine is so busy that it loses rows."""

    # a live one asks its instance
    joints = sample_rate_hz = robot = None

    def __init__(self, run, robot, stopped):
        self.joints, self.sample_rate_hz, self.robot = robot.joints, run.sample_rate_hz, robot
        self._rows = np.zeros(len(run), _row_of(len(robot.joints)))
        for signal in self._rows.dtype.names[3:]:
            self._rows[signal] = np.nan
        self._rows["cycle"] = np.arange(len(run))
        self._rows["running"] = ~stopped(run.time_s)
        self._rows["time_s"] = run.time_s
        for index, joint in enumerate(robot.joints):
            for signal, values in run[joint].items():
                self._rows[signal][:, index] = values

    def __iter__(self):
        yield from np.array_split(self._rows, len(self._rows) // 15)


def test_an_instance_is_watched():
    bench = fx.Robot(EXAMPLES / "bench.toml")
    run = fx.simulate(bench, "multi_sine", duration_s=10.0)
    # without a robot it is watched against the one that runs
    event = next(fx.watch(Played(run, bench, lambda time_s: time_s < 2.0), window_s=7.0))
    assert (event["event"], event["joint"]) == ("watching", "joint1")
    # what a joint learns from comes first, and nothing of it from before the loop ran
    assert 9.0 <= event["at_s"] <= 9.6
    # a loop that stands still half of the time leaves nothing to learn from
    event = next(fx.watch(Played(run, bench, lambda time_s: time_s % 0.4 < 0.2), window_s=7.0))
    assert (event["event"], event["joint"]) == ("blind", "joint1")
