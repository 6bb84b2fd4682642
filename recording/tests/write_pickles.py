"""Writes the pickles that the tests read, as programs save their logs, and one as `torch.save` lays it out.

Usage: python3 write_pickles.py FOLDER    (numpy 2; PyTorch is not needed)
"""

import collections
import io
import pickle
import sys
import types
import zipfile
from pathlib import Path

import numpy

FOLDER = Path(sys.argv[1])
ROWS = 40
time_s = numpy.arange(ROWS) * 0.004
angles_rad = numpy.stack([numpy.sin(time_s), numpy.cos(time_s)], axis=1)
counts = numpy.arange(2 * ROWS, dtype="i4").reshape(ROWS, 2)


def save(name, log, protocol):
    (FOLDER / name).write_bytes(pickle.dumps(log, protocol=protocol))


log = {"time": time_s, "q": angles_rad, "dq": numpy.asfortranarray(angles_rad.astype("f4")), "q_des": counts.astype(">i4")}
for protocol in (2, 4, 5):
    save(f"arrays_{protocol}.pkl", {"log": log | {"gains": [20.0, 1.5], "robot": "two"}}, protocol)

rows = [
    collections.OrderedDict(time=float(time), joint={"q": list(angles), "tau": tuple(count)}, gait=None, battery=numpy.float32(7.5))
    for time, angles, count in zip(time_s, angles_rad.tolist(), counts.tolist(), strict=True)
]
save("rows.pkl", rows, 4)


class FloatStorage:
    """Stands for PyTorch's class in the pickle: it is told by its module and name alone."""


class LongStorage:
    """As `FloatStorage`."""


def _rebuild_tensor_v2(*arguments):
    raise NotImplementedError(arguments)


utils = types.ModuleType("torch._utils")
utils._rebuild_tensor_v2 = _rebuild_tensor_v2
_rebuild_tensor_v2.__module__ = "torch._utils"
torch = types.ModuleType("torch")
torch.FloatStorage, torch.LongStorage = FloatStorage, LongStorage
FloatStorage.__module__ = LongStorage.__module__ = "torch"
sys.modules |= {"torch": torch, "torch._utils": utils}


class Tensor:
    """A part of a storage, with strides."""

    def __init__(self, key, storage, kind, offset, size, stride):
        self.storage = ("storage", kind, key, "cpu", len(storage))
        self.arguments = (self, offset, size, stride, False, collections.OrderedDict())

    def __reduce__(self):
        return _rebuild_tensor_v2, (Kept(self.storage), *self.arguments[1:])


class Kept:
    """What is kept outside of the pickle."""

    def __init__(self, what):
        self.what = what


class Pickler(pickle.Pickler):
    def persistent_id(self, value):
        return value.what if isinstance(value, Kept) else None


# The second storage is a table of four rows: one of its columns is the time, and two are angles, one after the other.
kept = numpy.stack([time_s, angles_rad[:, 0], angles_rad[:, 1], 0.0 * time_s]).astype("<f4")
storages = {"0": kept.ravel(), "1": counts.astype("<i8").ravel()}
log = {
    "time": Tensor("0", storages["0"], FloatStorage, 0, (ROWS,), (1,)),
    "dof_pos": Tensor("0", storages["0"], FloatStorage, ROWS, (ROWS, 1, 2), (1, 1, ROWS)),
    "des_dof_pos": Tensor("1", storages["1"], LongStorage, 0, (ROWS, 2), (2, 1)),
}
described = io.BytesIO()
Pickler(described, protocol=2).dump(log)
with zipfile.ZipFile(FOLDER / "log.pt", "w") as archive:
    archive.writestr("log/data.pkl", described.getvalue())
    archive.writestr("log/byteorder", "little")
    for key, storage in storages.items():
        archive.writestr(f"log/data/{key}", storage.tobytes())
    archive.writestr("log/version", "3\n")
