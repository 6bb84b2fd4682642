"""The diagnosis."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any, Union

from . import _native
from ._errors import InputError
from ._recording import recordings_of
from ._report import Report
from ._robot import Robot, robot_of

PathLike = Union[str, "os.PathLike[str]"]
Progress = Callable[[int, int], object]


def diagnose(
    robot: Robot | PathLike,
    recordings: Any,
    *,
    mapping: PathLike | None = None,
    engine: str | None = None,
    materiality: float = _native.MATERIALITY,
    threads: int | None = None,
    progress: bool | Progress = False,
) -> Report:
    """Says where simulation and robot part, which effects cause it, and how far the gap shrinks once they are added.

    `recordings`: one or several of `Recording`, paths, pandas or Polars frames, Arrow tables, or arrays by column name.
    `mapping`: which column of a file is which signal; guessed where that is certain. `engine`: `motion` holds the recorded
    motion against the robot file, `closed-loop` a simulation; chosen by what the robot file tells. `materiality`: share of a
    joint's gap below which an effect is a minor one. `threads`: one a core if not given. `progress`: `True`, or a function
    that is called with the number of joints done and of all. Ctrl-C stops it; the interpreter is free meanwhile.

    Raises `InputError` with the line that the command would print.
    """
    robot = robot_of(robot)
    if not 0.0 <= materiality < 1.0:
        raise InputError(f"materiality {materiality}: a share is a number from 0 to below 1, such as 0.02")
    if threads is not None and threads < 1:
        raise InputError(f"threads {threads}: give 1 or more, or leave it out")
    tables = [recording._inner for recording in recordings_of(recordings, robot, mapping)]
    if not tables:
        raise InputError("no recording was given")
    tell = printed("joints") if progress is True else progress or None
    return Report(_native.diagnose(robot._inner, tables, engine, materiality, threads, tell), robot)


def printed(what: str) -> Progress:
    """Tells on standard error how far it is."""

    def tell(done: int, of: int) -> None:
        end = "\n" if done == of else ""
        print(f"\r{done} of {of} {what}", end=end, file=sys.stderr, flush=True)

    return tell
