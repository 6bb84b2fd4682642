"""What the package costs in processor time: its import, handing over arrays, and the wait after Ctrl-C.

    pip install ./python
    python benches/python/costs.py
"""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np

import flexspline as fx

SIGNALS = ("reference_position_rad", "motor_position_rad", "link_position_rad", "motor_torque_nm")
PASSES = 5
# Processor time after which Ctrl-C is pressed.
PRESSED_S = (0.1, 0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 4.0)


def import_s():
    """Of NumPy, and of the package after it; the least of some passes."""
    code = """
import time
begin = time.process_time()
import numpy
between = time.process_time()
import flexspline
print(between - begin, time.process_time() - between)
"""
    passes = [subprocess.check_output([sys.executable, "-c", code], text=True).split() for _ in range(PASSES)]
    return np.array(passes, dtype=float).min(axis=0)


def arrays():
    """40 s of an arm of seven joints at 1.5 kHz, and the arm."""
    robot = fx.Robot("pa10")
    time_s = np.arange(0, 40, 1 / 1500)
    joints = {}
    for k, joint in enumerate(robot.joints):
        position = 0.3 * np.sin((0.5 + 0.1 * k) * time_s)
        joints[joint] = dict(zip(SIGNALS, (position, 50 * position, position, 0.1 * np.cos(time_s))))
    return robot, time_s, joints


def hand_over_s(time_s, joints):
    """The least of some passes."""
    spent = []
    for _ in range(PASSES):
        begin = time.process_time()
        fx.Recording.from_arrays(time_s, joints)
        spent.append(time.process_time() - begin)
    return min(spent)


def interrupted_s(robot, recording, pressed_s):
    """From the signal's handler to the exception; `None` where the diagnosis was done before."""
    begin = time.process_time()

    def press():
        while time.process_time() - begin < pressed_s:
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    handled = []

    def handle(*_):
        handled.append(time.process_time())
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGINT, handle)
    thread = threading.Thread(target=press)
    thread.start()
    try:
        fx.diagnose(robot, recording)
        thread.join()
    except KeyboardInterrupt:
        return time.process_time() - handled[0]
    finally:
        signal.signal(signal.SIGINT, before)
    return None


def main():
    numpy_s, own_s = import_s()
    print(f"import: {numpy_s:.3f} s NumPy, {own_s:.3f} s flexspline after it")
    robot, time_s, joints = arrays()
    megabytes = 8e-6 * len(time_s) * (1 + len(joints) * len(SIGNALS))
    print(f"from_arrays: {1e3 * hand_over_s(time_s, joints):.0f} ms for {megabytes:.0f} MB")
    recording = fx.Recording.from_arrays(time_s, joints)
    for pressed_s in PRESSED_S:
        waited_s = interrupted_s(robot, recording, pressed_s)
        told = "the diagnosis was done before" if waited_s is None else f"{waited_s:.2f} s until the exception"
        print(f"Ctrl-C after {pressed_s} s: {told}")


if __name__ == "__main__":
    main()
