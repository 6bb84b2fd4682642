"""What is done with a robot: simulated, moved on purpose, identified."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Union

from . import _native
from ._diagnose import printed
from ._errors import InputError
from ._recording import Recording
from ._report import Report
from ._robot import Robot, robot_of

PathLike = Union[str, "os.PathLike[str]"]
Progress = Callable[[int, int], object]


def simulate(
    robot: Robot | PathLike,
    reference: Recording | PathLike,
    *,
    duration_s: float = 30.0,
    seed: int = 1,
) -> Recording:
    """What the robot file says the robot would do: the whole loop with a plant that is what the file says and nothing else.

    `reference`: a `Recording`, whose reference of every joint is followed, or a trajectory, by its name such as `multi_sine`, or
    the path of a file, which is followed for `duration_s`. `seed`: of the sensors' noise. Ctrl-C stops it.
    """
    robot = robot_of(robot)
    if isinstance(reference, Recording):
        return Recording._of(_native.simulate_recording(robot._inner, reference._inner, seed))
    if not 0.0 < duration_s < float("inf"):
        raise InputError(f"duration_s {duration_s}: give the seconds that the trajectory shall last")
    return Recording._of(_native.simulate_trajectory(robot._inner, reference, duration_s, seed))


class Suggestion:
    """A motion that tells apart what the recordings could not."""

    def __init__(self, trajectory: str, told: dict[str, Any]) -> None:
        self.trajectory = trajectory
        """The trajectory file, as `flexspline run --trajectory` and `simulate` take it."""
        self.experiment: str = told["experiment"]
        """Its name on the menu of experiments."""
        self.pairs: list[dict[str, Any]] = told["pairs"]
        """Joint, effects, and how far they are expected to be apart: below a `distance` of 9 nobody can tell them."""

    def save(self, path: PathLike) -> None:
        """Writes the trajectory file; its name ends with `.toml`."""
        if Path(path).suffix != ".toml":
            raise InputError(f"{os.fspath(path)}: a trajectory is written as TOML; name it .toml")
        Path(path).write_text(self.trajectory, encoding="utf-8")

    def __repr__(self) -> str:
        pairs = (f"{pair['joint']}: {' or '.join(pair['effects'])}: d² {pair['distance_expected']:.3g}" for pair in self.pairs)
        return f"<{self.experiment}: {'; '.join(pairs)}>"


def suggest(
    robot: Robot | PathLike,
    report: Report,
    *,
    duration_s: float = 30.0,
    threads: int | None = None,
    progress: bool | Progress = False,
) -> Suggestion:
    """The trajectory that would best tell apart the effects that a report calls confusable.

    Raises `NegativeError` if nothing is confused, or no motion helps.
    """
    tell = printed("experiments") if progress is True else progress or None
    found = _native.suggest(robot_of(robot)._inner, report._inner.json(), duration_s, threads, tell)
    trajectory, told = found
    return Suggestion(trajectory, json.loads(told))


def identify(
    robot: Robot | PathLike,
    out: PathLike,
    what: str = "all",
    *,
    joints: Iterable[str] = (),
    seed: int = 1,
) -> Robot:
    """Fits the joint model to the experiments of the papers, and returns the robot with what was found.

    `what`: `friction`, `periodic`, `stiffness`, `gravity` or `all`. Recordings that lie in `out` are taken; what is not recorded
    yet is recorded on the emulated robot in virtual time, and a stopped call goes on where it was. `out` then also has
    `identified.toml`, the results as JSON and `report.html`.
    """
    robot = robot_of(robot)
    given = robot._inner.given
    if robot.changes:
        Path(out).mkdir(parents=True, exist_ok=True)
        given = os.fspath(Path(out) / "start.toml")
        robot.save(given)
    _native.identify(given, what, out, list(joints), seed)
    return Robot(Path(out) / "identified.toml")
