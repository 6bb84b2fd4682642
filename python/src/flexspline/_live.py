"""A running robot, and gaps as they appear."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from typing import Any, Union

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._errors import InputError
from ._recording import Recording
from ._robot import Robot, robot_of

PathLike = Union[str, "os.PathLike[str]"]
# Rows of a recording that are looked at together: as many as come in a second or less.
_ROWS_AT_ONCE = 1000


class Attachment:
    """An observer of a running instance. Iterating yields arrays of the rows that came since the last, as long as it runs.

    Fields of a row: `cycle`, `running` (whether the loop was), `time_s` since the start, and each signal with a value a joint, NaN
    where the robot has none. The loop does not notice: rows come through its relay.
    """

    def __init__(self, name: str = "default") -> None:
        self._inner = _native.Attachment(name)
        self._dtype = _row_of(len(self._inner.joints))

    @property
    def joints(self) -> list[str]:
        """Names of the joints, in the order of each signal's values."""
        return self._inner.joints

    @property
    def sample_rate_hz(self) -> float:
        """Rows a second."""
        return self._inner.sample_rate_hz

    @property
    def robot(self) -> Robot:
        """The robot that runs."""
        return Robot(self._inner.robot)

    @property
    def lost(self) -> int:
        """Rows that were dropped because a minute's waited already."""
        return self._inner.lost

    def __iter__(self) -> Iterator[NDArray[Any]]:
        while (rows := self._inner.next_rows()) is not None:
            yield rows.view(self._dtype)[:, 0]

    def close(self) -> None:
        """Leaves the instance."""
        self._inner.close()

    def __enter__(self) -> Attachment:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _row_of(joints: int) -> np.dtype[Any]:
    """What a row of an attachment is."""
    signals = [(signal, np.float64, (joints,)) for signal in _native.SIGNALS]
    return np.dtype([("cycle", np.uint64), ("running", np.uint64), ("time_s", np.float64), *signals])


def attach(name: str = "default") -> Attachment:
    """Attaches to the running instance of that name."""
    return Attachment(name)


def watch(
    stream: Attachment | Recording | PathLike,
    robot: Robot | PathLike | None = None,
    *,
    window_s: float = 20.0,
    between_false_s: float = 36_000.0,
    threads: int | None = None,
) -> Iterator[dict[str, Any]]:
    """Says when a gap appears, and what it most likely is, along a recording or at a running robot: yields events.

    `robot`: the file to watch against, that of the instance if not given. `window_s`: what a joint learns from first; what is there
    then is taken as given. `between_false_s`: mean time between two diagnoses for nothing, of each joint. `event` of an event is
    `watching`, `blind`, `gap` (with `joint`, `appeared_s` and `candidates`, the most probable first) or `dismissed`.
    """
    if not isinstance(stream, (Attachment, Recording)):
        stream = Recording.load(stream, None if robot is None else robot_of(robot))
    if robot is None:
        if isinstance(stream, Recording):
            raise InputError("robot is missing: give the robot to watch against")
        robot = stream.robot
    robot = robot_of(robot)
    rows = _rows_of_recording(stream, robot) if isinstance(stream, Recording) else _rows_of_instance(stream)
    watched = _native.Watch(robot._inner, stream.sample_rate_hz, window_s, between_false_s)
    for some in rows:
        for event in watched.push(some, threads):
            yield json.loads(event)


def _rows_of_recording(recording: Recording, robot: Robot) -> Iterator[NDArray[np.float64]]:
    columns = [recording.time_s]
    missing = np.full(len(recording), np.nan)
    signals = [recording[joint] for joint in robot.joints]
    for signal in _native.SIGNALS:
        columns += [of_joint.get(signal, missing) for of_joint in signals]
    for first in range(0, len(recording), _ROWS_AT_ONCE):
        yield np.column_stack([column[first : first + _ROWS_AT_ONCE] for column in columns])


def _rows_of_instance(attachment: Attachment) -> Iterator[NDArray[np.float64]]:
    for rows in attachment:
        # a cycle in which the loop was not running is a hole
        rows = rows[rows["running"] == 1]
        if len(rows):
            yield np.column_stack([rows["time_s"], *(rows[signal] for signal in _native.SIGNALS)])
