"""One cyclic-position master for all axes of a bus, whatever library sends its frames."""

import struct

FOLLOWING = 0x1027  # operation enabled, target followed: the brake is open
COUNTS_A_CYCLE = 1


class Walk:
    """Takes the inputs of each slave, gives its outputs, and remembers how far every axis came."""

    def __init__(self, axes_of):
        self.axes_of = axes_of
        self.target = {}
        self.moved = {}
        self.first = {}

    def outputs(self, slave, inputs):
        axes = self.axes_of[slave]
        stride = len(inputs) // axes
        data = b""
        for axis in range(axes):
            status, _, _, position = struct.unpack_from("<HbBi", inputs, axis * stride)
            key = (slave, axis)
            word = {0x40: 6, 0x21: 7, 0x23: 15, 0x27: 15}.get(status & 0x6F, 0)
            if status & 0x106F == FOLLOWING:
                self.first.setdefault(key, position)
                self.target[key] += COUNTS_A_CYCLE
                self.moved[key] = position - self.first[key]
            elif status & 0x6F != 0x27:
                self.target[key] = position
            data += struct.pack("<HbBiihh", word, 8, 0, self.target[key], 0, 0, 0)
        return data

    def check(self, cycles):
        """Every axis came a good part of the way it was sent."""
        for slave, axes in enumerate(self.axes_of):
            for axis in range(axes):
                moved = self.moved.get((slave, axis), 0)
                assert moved > 0.2 * cycles * COUNTS_A_CYCLE, (slave, axis, moved, cycles)
