"""The program `twin_pipe` (gap-diagnosis/examples): asks a joint's twin along one recording."""

import struct
import subprocess

import numpy as np


class TwinPipe:
    """Values are what the joint has beyond its robot file: Coulomb, viscous friction, rotor inertia at the motor side."""

    def __init__(self, program, robot, recording):
        self.process = subprocess.Popen(
            [program, robot, recording], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.wait()

    def ask(self, what, values=()):
        line = " ".join([what, *(repr(float(value)) for value in values)])
        self.process.stdin.write(f"{line}\n".encode())
        self.process.stdin.flush()
        (count,) = struct.unpack("<Q", self.process.stdout.read(8))
        return np.frombuffer(self.process.stdout.read(8 * count), dtype="<f8")
