"""Recordings."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import Any, Union

import numpy as np

from . import _native
from ._arrays import Floats, columns_of, floats, seconds
from ._errors import InputError
from ._robot import Robot

PathLike = Union[str, "os.PathLike[str]"]


class Recording:
    """Measured signals of joints, a row at a time. SI units; a value that was not measured is NaN.

    Signals are `motor_torque_nm`, `link_position_rad` and so on: `motor_` before the gear, `link_` and `joint_` after it.
    `recording["elbow"]["motor_torque_nm"]` is a read-only array, `recording.time_s` its times.
    """

    _inner: _native.Recording

    def __init__(self) -> None:
        raise TypeError("take Recording.load(path), Recording.from_arrays(...) or Recording.from_table(frame)")

    @classmethod
    def _of(cls, native: _native.Recording) -> Recording:
        recording = cls.__new__(cls)
        recording._inner = native
        return recording

    @classmethod
    def load(cls, path: PathLike, robot: Robot | None = None, mapping: PathLike | None = None) -> Recording:
        """Reads MCAP, Parquet, CSV, a bag of ROS, a LeRobot dataset, `.npz`, `.mat` or HDF5.

        `mapping` says which column is which signal, else a file `NAME.mapping.toml` beside it does; with a `robot` that is
        guessed where it is certain.
        """
        return cls._of(_native.Recording.load(path, robot._inner if robot else None, mapping))

    @classmethod
    def from_arrays(cls, time: Any, joints: Mapping[str, Mapping[str, Any]], name: str = "arrays") -> Recording:
        """Of arrays by joint and signal, with the time of each row in seconds, or as dates. `name` is what errors call it."""
        columns = [("time_s", seconds(time, f"{name}: time"))]
        if not isinstance(joints, Mapping):
            raise InputError(f"{name}: joints: give {{joint: {{signal: array}}}}, not {type(joints).__name__}")
        for joint, signals in joints.items():
            if not isinstance(signals, Mapping):
                raise InputError(f"{name}: joint `{joint}`: give {{signal: array}}, not {type(signals).__name__}")
            for signal, values in signals.items():
                if signal not in _native.SIGNALS:
                    known = ", ".join(_native.SIGNALS)
                    raise InputError(f"{name}: joint `{joint}`: `{signal}` is no signal; signals are {known}")
                columns.append((f"{joint}.{signal}", floats(values, f"{name}: `{joint}.{signal}`")))
        return cls._of(_native.Recording.from_columns(name, columns, None))

    @classmethod
    def from_table(cls, table: Any, robot: Robot | None = None, name: str = "table") -> Recording:
        """Of a pandas or Polars frame, an Arrow table, or arrays by column name.

        Columns are called `time_s` and `JOINT.SIGNAL`; with a `robot` other names are guessed where that is certain.
        """
        columns = columns_of(table)
        if columns is None:
            raise InputError(f"{name}: a {type(table).__name__} is neither a data frame nor a mapping of columns")
        return cls._of(_native.Recording.from_columns(name, columns, robot._inner if robot else None))

    def save(self, path: PathLike) -> None:
        """Writes it as the name asks for: `.mcap`, `.parquet` or `.csv`."""
        self._inner.save(path)

    @property
    def name(self) -> str:
        """File, or what it was called."""
        return self._inner.name

    @property
    def guessed(self) -> list[str]:
        """What its columns were taken for, where nothing said it; a line a joint."""
        return self._inner.guessed

    @property
    def metadata(self) -> dict[str, str]:
        """What the recorder wrote about the run."""
        return self._inner.metadata

    @property
    def sample_rate_hz(self) -> float:
        """The planned rate where it is told, else what the times show."""
        return self._inner.sample_rate_hz

    @property
    def joints(self) -> list[str]:
        """Names of the joints."""
        return self._inner.joints

    @property
    def time_s(self) -> Floats:
        """Time of each row."""
        return self._inner.time_s

    def __getitem__(self, joint: str) -> dict[str, Floats]:
        return {signal: self._inner.column(joint, signal) for signal in self._inner.signals(joint)}

    def __len__(self) -> int:
        return self._inner.rows

    def to_dict(self) -> dict[str, Floats]:
        """Columns by name: `time_s` and `JOINT.SIGNAL`; what `pandas.DataFrame`, `polars.DataFrame` and `pyarrow.table` take."""
        columns = {"time_s": self.time_s}
        for joint in self.joints:
            columns.update({f"{joint}.{signal}": values for signal, values in self[joint].items()})
        return columns

    def to_pandas(self) -> Any:
        """As a pandas frame."""
        import pandas

        return pandas.DataFrame(self.to_dict())

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self.name, [(name, np.asarray(values)) for name, values in self.to_dict().items()])

    def __repr__(self) -> str:
        rate = f"{self.sample_rate_hz:.5g} Hz"
        return f"<Recording {self.name!r}: {len(self)} rows at {rate} of {', '.join(self.joints)}>"


def _unpickled(name: str, columns: list[tuple[str, Floats]]) -> Recording:
    return Recording._of(_native.Recording.from_columns(name, columns, None))


def recordings_of(given: Any, robot: Robot, mapping: PathLike | None = None) -> list[Recording]:
    """One or several recordings, paths or tables."""
    if isinstance(given, Recording):
        return [given]
    if isinstance(given, (str, os.PathLike)):
        return [Recording.load(given, robot, mapping)]
    if columns_of_one(given):
        return [Recording.from_table(given, robot)]
    if not isinstance(given, Iterable):
        raise InputError(f"recordings: a {type(given).__name__} is neither a recording nor a path nor a table")
    return [one for each in given for one in recordings_of(each, robot, mapping)]


def columns_of_one(given: Any) -> bool:
    """Whether it is a table."""
    return isinstance(given, Mapping) or hasattr(given, "columns") or hasattr(given, "column_names")
