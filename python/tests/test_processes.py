"""The interpreter around it: Ctrl-C, threads, forks, import."""

import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from test_report import same

import flexspline as fx


def test_ctrl_c_stops_it(tmp_path):
    """A child that diagnoses the shipped arm of seven joints is interrupted in the midst."""
    code = """
import sys, time
import numpy as np
import flexspline as fx
robot = fx.Robot("pa10")
t = np.arange(0, 40, 1 / 1500)
def signals(k):
    q = 0.3 * np.sin((0.5 + 0.1 * k) * t)
    return {"reference_position_rad": q, "motor_position_rad": 50 * q, "link_position_rad": q, "motor_torque_nm": 0.1 * np.cos(t)}
recording = fx.Recording.from_arrays(t, {joint: signals(k) for k, joint in enumerate(robot.joints)})
print("ready", flush=True)
try:
    fx.diagnose(robot, recording)
    print("done")
except KeyboardInterrupt:
    print("interrupted", time.time())
"""
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "ready\n"
    time.sleep(1.0)
    child.send_signal(signal.SIGINT)
    sent = time.time()
    said = child.communicate(timeout=60)[0].split()
    assert said[0] == "interrupted"
    print(f"stopped after {float(said[1]) - sent:.2f} s")


def test_other_threads_run_meanwhile(robot, recording):
    counted = 0
    stop = threading.Event()

    def count():
        nonlocal counted
        while not stop.wait(0.001):
            counted += 1

    thread = threading.Thread(target=count)
    thread.start()
    fx.diagnose(robot, recording)
    stop.set()
    thread.join()
    # the interpreter's lock would let it count at most once
    assert counted > 5


def test_several_threads_at_once(robot, recording, report):
    with ThreadPoolExecutor(4) as threads:
        reports = list(threads.map(lambda _: fx.diagnose(robot, recording), range(4)))
    assert all(same(one, report) for one in reports)


def _in_child(pipe, robot, recording):
    pipe.send(fx.diagnose(robot, recording).to_dict()["joints"])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_diagnoses_too(robot, recording, report):
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe()
    child = context.Process(target=_in_child, args=(there, robot, recording))
    child.start()
    assert here.poll(120), "the child hangs"
    assert here.recv() == report.to_dict()["joints"]
    child.join()
    assert child.exitcode == 0


def test_import_is_light():
    code = "import sys, flexspline; print([m for m in ('pandas', 'polars', 'pyarrow', 'matplotlib') if m in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_memory_does_not_grow(robot):
    import resource

    time_s = np.arange(0.0, 4.0, 1 / 250)
    values = np.sin(time_s)
    joints = {"elbow": {"link_position_rad": values, "motor_torque_nm": values}}

    def largest_kib(times):
        for _ in range(times):
            recording = fx.Recording.from_arrays(time=time_s, joints=joints)
            recording["elbow"]["motor_torque_nm"]
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    before = largest_kib(200)
    assert largest_kib(2000) - before < 20_000
