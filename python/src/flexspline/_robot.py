"""Robots."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Union

from . import _native
from ._errors import FormatWarning

if TYPE_CHECKING:
    from typing import Any

PathLike = Union[str, "os.PathLike[str]"]


class Robot:
    """A robot: rigid bodies, drives, and what is known of them. The "sim" of every comparison.

    `Robot("arm.urdf")` reads a URDF, a MuJoCo model, a robot file (TOML), or a shipped robot by its name: `pa10`, `shd17`.
    It is never changed; `Report.apply` makes another one.
    """

    _native: _native.Robot
    changes: list[str] = []
    """What `Report.apply` did to it, in words."""

    def __init__(self, path: PathLike) -> None:
        self._native = _native.Robot(path)

    @classmethod
    def _of(cls, native: _native.Robot) -> Robot:
        robot = cls.__new__(cls)
        robot._native = native
        return robot

    @property
    def name(self) -> str:
        """What the robot is called."""
        return self._native.name

    @property
    def joints(self) -> list[str]:
        """Names of the joints, in the chain's order."""
        return self._native.joints

    @property
    def notes(self) -> list[str]:
        """What was assumed, held or not read of its description."""
        return self._native.notes

    def to_toml(self) -> str:
        """The robot file. What was written by hand stays as it was, comments included.

        A URDF or a MuJoCo model is named in it relative to where the robot was read from.
        """
        return self._native.text

    def to_mjcf(self, path: PathLike | None = None) -> str:
        """The MuJoCo model with everything of the robot that MuJoCo has words for; also written to `path` if it is given.

        A robot that comes from a MuJoCo model keeps that model, with changed values; another is converted. Meshes are named
        relative to `path`, or to the working directory. What cannot be said is told by a `FormatWarning`.
        """
        return self._written("mjcf", path, "robot.xml")

    def to_urdf(self, path: PathLike | None = None) -> str:
        """The URDF, as `to_mjcf` does it."""
        return self._written("urdf", path, "robot.urdf")

    def save(self, path: PathLike) -> None:
        """Writes it as the name asks for: `.toml`, `.xml` (MuJoCo) or `.urdf`."""
        end = Path(path).suffix.lower()
        if end in (".xml", ".mjcf"):
            self.to_mjcf(path)
        elif end == ".urdf":
            self.to_urdf(path)
        else:
            self._native.save_robot_file(path)

    def _written(self, format: str, path: PathLike | None, name: str) -> str:
        text, notes = self._native.written(format, name if path is None else path)
        for note in notes:
            warnings.warn(note, FormatWarning, stacklevel=3)
        if path is not None:
            Path(path).write_text(text)
        return text

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self._native.text, self._native.given)

    def __repr__(self) -> str:
        return f"<Robot {self.name!r} with {', '.join(self.joints)}>"


def _unpickled(text: str, given: str) -> Robot:
    return Robot._of(_native.Robot.from_text(text, given))


def robot_of(robot: Robot | PathLike) -> Robot:
    """A robot, or the one of that name or path."""
    return robot if isinstance(robot, Robot) else Robot(robot)
