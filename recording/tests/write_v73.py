"""Writes v73.mat as MATLAB's `save` with '-v7.3' does: a head of its own, axes in reverse, what each dataset is in an attribute.

Usage: python3 write_v73.py v73.mat    (h5py 3)
"""

import sys

import h5py
import numpy

time_s = numpy.arange(40) * 0.004
angles_rad = numpy.stack([numpy.sin(time_s), numpy.cos(time_s)], axis=1)


def put(group, name, table, kind="double"):
    packed = {"compression": "gzip", "shuffle": True} if table.size > 2 else {}
    dataset = group.create_dataset(name, data=table.T, **packed)
    dataset.attrs["MATLAB_class"] = numpy.bytes_(kind)


with h5py.File(sys.argv[1], "w", userblock_size=512) as file:
    log = file.create_group("log")
    log.attrs["MATLAB_class"] = numpy.bytes_("struct")
    put(log, "t", time_s[:, None])
    put(log, "q", angles_rad)
    put(log, "tau", angles_rad[::-1].astype("f4"), "single")
    put(log, "q_des", numpy.full((40, 2), 7, "i2"), "int16")
    put(log, "robot", numpy.array([[112], [97]], "u2"), "char")
    put(log, "masses", numpy.ones((7, 1)))
    references = file.create_group("#refs#")
    put(references, "a", numpy.ones((40, 1)))
text = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Jan  1 00:00:00 2024 HDF5 schema 1.00 ."
with open(sys.argv[1], "r+b") as file:
    file.write(text.ljust(116) + bytes(8) + b"\x00\x02IM")
