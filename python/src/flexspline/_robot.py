"""Robots."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import Any, Union

import numpy as np

from . import _native
from ._arrays import Floats, table
from ._errors import FormatWarning, InputError

PathLike = Union[str, "os.PathLike[str]"]


class Robot:
    """A robot: rigid bodies, drives, and what is known of them. The "sim" of every comparison.

    `Robot("arm.urdf")` reads a URDF, a MuJoCo model, a robot file (TOML), or a shipped robot by its name: `pa10`, `shd17`.
    It is never changed; `Report.apply` makes another one.
    """

    _inner: _native.Robot
    changes: list[str] = []
    """What `Report.apply` did to it, in words."""

    def __init__(self, path: PathLike) -> None:
        self._inner = _native.Robot(path)

    @classmethod
    def _of(cls, native: _native.Robot) -> Robot:
        robot = cls.__new__(cls)
        robot._inner = native
        return robot

    @property
    def name(self) -> str:
        """What the robot is called."""
        return self._inner.name

    @property
    def joints(self) -> list[str]:
        """Names of the joints, in the chain's order."""
        return self._inner.joints

    @property
    def notes(self) -> list[str]:
        """What was assumed, held or not read of its description."""
        return self._inner.notes

    def inverse_dynamics(self, position: Any, velocity: Any, acceleration: Any) -> Floats:
        """Torque at the joints that a motion needs: rigid bodies, payloads and rotors, gravity included; no friction.

        Arrays of one row a sample and one column a joint, in rad (m for sliding joints) and seconds, or of one sample alone.
        """
        given = [("position", position), ("velocity", velocity), ("acceleration", acceleration)]
        arrays = [np.ascontiguousarray(table(values, name, len(self.joints))) for name, values in given]
        if len({array.shape for array in arrays}) > 1:
            shapes = ", ".join(str(array.shape) for array in arrays)
            raise InputError(f"position, velocity and acceleration have the shapes {shapes}; give arrays of one shape")
        rows = (np.atleast_2d(array) for array in arrays)
        return _native.inverse_dynamics(self._inner, *rows).reshape(arrays[0].shape)

    def to_toml(self) -> str:
        """The robot file. What was written by hand stays as it was, comments included.

        A URDF or a MuJoCo model is named in it relative to where the robot was read from.
        """
        return self._inner.text

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
            self._inner.save_robot_file(path)

    def _written(self, format: str, path: PathLike | None, name: str) -> str:
        text, notes = self._inner.written(format, name if path is None else path)
        for note in notes:
            warnings.warn(note, FormatWarning, stacklevel=3)
        if path is not None:
            Path(path).write_text(text)
        return text

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickled, (self._inner.text, self._inner.given)

    def __repr__(self) -> str:
        return f"<Robot {self.name!r} with {', '.join(self.joints)}>"


def _unpickled(text: str, given: str) -> Robot:
    return Robot._of(_native.Robot.from_text(text, given))


def robot_of(robot: Robot | PathLike) -> Robot:
    """A robot, or the one of that name or path."""
    return robot if isinstance(robot, Robot) else Robot(robot)
