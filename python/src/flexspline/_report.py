"""What a diagnosis says, and what becomes of it."""

from __future__ import annotations

import html
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

import numpy as np

from . import _native
from ._errors import InputError
from ._robot import Robot, robot_of

if TYPE_CHECKING:
    from ._arrays import Floats

PathLike = Union[str, "os.PathLike[str]"]


class Parameter(float):
    """A fitted value, the change against the robot file; its name ends with its unit.

    It is a number; `std` is its standard error, `at_bound` whether it ended at a limit of what was searched.
    """

    std: float
    at_bound: bool

    def __new__(cls, told: dict[str, Any]) -> Parameter:
        value = super().__new__(cls, told["value"])
        value.std = told["std"]
        value.at_bound = told["at_bound"]
        return value

    def __reduce__(self) -> tuple[Any, ...]:
        return Parameter, ({"value": float(self), "std": self.std, "at_bound": self.at_bound},)


class Effect:
    """A physical effect that is named as a part of the gap."""

    def __init__(self, told: dict[str, Any], joints: list[str], minor: bool) -> None:
        self.name: str = told["effect"]
        """Which effect."""
        self.joints = joints
        """The joints that see it: one, or those of a cause that the arm shares."""
        self.minor = minor
        """Whether it is too small or too uncertain a part to matter."""
        self.probability: float = told["probability"]
        """Calibrated: of the statements made with 0.9, nine in ten are right."""
        self.share: float = told["share"]
        """Part of the gap's energy that it takes off; of a shared effect its mean over the joints."""
        self.share_interval: tuple[float, float] = (told["share_low"], told["share_high"])
        """The share's 95 % interval."""
        self.side: str | None = told.get("side")
        """Which encoder, where the effect has one."""
        self.parameters: dict[str, Parameter] = {k: Parameter(v) for k, v in told["parameters"].items()}
        """How large it is."""

    def __repr__(self) -> str:
        on = ", ".join(self.joints)
        values = "".join(f", {name} {value:.4g} ± {value.std:.2g}" for name, value in self.parameters.items())
        return f"<{self.name} at {on}: {100 * self.share:.0f} % of the gap{values}>"


class Remains:
    """A variable over which a part of what has no name lies."""

    def __init__(self, told: dict[str, Any]) -> None:
        self.over: str = told["over"]
        """`position`, `velocity`, `load`, `time`, `since_reversal`, `motor_phase` or `other_joints`."""
        self.share: float = told["share"]
        """Part of the gap's energy."""
        self.at: Floats = np.asarray(told.get("at", []), dtype=np.float64)
        """Corners of a line through the rest, in the variable's unit."""
        self.torque_nm: Floats = np.asarray(told.get("torque_nm", []), dtype=np.float64)
        """The torque at them."""

    def __repr__(self) -> str:
        return f"<{100 * self.share:.0f} % of the gap over {self.over}>"


class JointReport:
    """What is said of one joint."""

    def __init__(self, told: dict[str, Any], effects: list[Effect]) -> None:
        self.name: str = told["joint"]
        """The joint."""
        self.verdict: str = told["verdict"]
        """`no_gap`, `explained`, `partly_explained`, `unexplained`, `ambiguous` or `insufficient_data`."""
        self.reason: str = told.get("reason", "")
        """Why, with the numbers that decided."""
        self.effects = effects
        """What is named, largest share first, those that it shares with other joints included."""
        self.remaining_share: float = told["remaining_share"]
        """Part of the gap that has no name."""
        self.remaining: list[Remains] = [Remains(rest) for rest in told["remaining_over"]]
        """What that depends on, largest share first."""
        torque = told["gap"]["torque_rms_nm"]
        self.gap_nm: float = torque["before"]
        """Root mean square of the torque that the robot file does not explain."""
        self.gap_after_nm: float = torque["after"]
        """The same with the effects."""
        self.noise_floor_nm: float = torque["noise_floor"]
        """What noise alone leaves."""
        self.shrink: float = told["gap"]["shrink"]
        """Part of the gap's energy that the effects take off, on data that nothing was fitted to."""
        self.confusable: list[tuple[str, str]] = [tuple(pair["effects"]) for pair in told["confusable"]]
        """Pairs of effects that this data cannot tell apart; `suggest` finds the motion that would."""

    def __repr__(self) -> str:
        return f"<{self.name}: {self.verdict}, {self.gap_nm:.3g} Nm to {self.gap_after_nm:.3g} Nm>"


class Report:
    """A diagnosis. In a notebook it shows itself: a sentence, the robot, the shares, what remains."""

    _inner: _native.Diagnosis

    def __init__(self, native: _native.Diagnosis, robot: Robot) -> None:
        self._inner = native
        self._told: dict[str, Any] = json.loads(native.json())
        self.robot = robot
        """The robot that was diagnosed."""

    @property
    def headline(self) -> str:
        """The result in one sentence."""
        return self._inner.headline()

    @property
    def effects(self) -> list[Effect]:
        """Every effect that matters, those of the whole arm first, then joint by joint, largest share first."""
        own = [effect for joint in self.joints for effect in joint.effects if effect.joints == [joint.name]]
        return self._shared() + own

    @property
    def joints(self) -> list[JointReport]:
        """What is said of each joint, in the robot's order."""
        return [self._joint(told) for told in self._told["joints"]]

    @property
    def data(self) -> list[str]:
        """What was wrong or missing in the recordings, worst first."""
        told = self._told.get("data", [])
        return [": ".join(filter(None, [one.get("joint"), one["what"]])) for one in told]

    def joint(self, name: str) -> JointReport:
        """What is said of that joint."""
        for told in self._told["joints"]:
            if told["joint"] == name:
                return self._joint(told)
        known = ", ".join(told["joint"] for told in self._told["joints"])
        raise InputError(f"the report has no joint `{name}`; its joints are {known}")

    def _shared(self) -> list[Effect]:
        return [Effect(told, told["joints"], minor=False) for told in self._told["shared_effects"]]

    def _joint(self, told: dict[str, Any]) -> JointReport:
        name = told["joint"]
        effects = [Effect(effect, [name], minor=False) for effect in told["effects"]]
        effects += [effect for effect in self._shared() if name in effect.joints]
        effects.sort(key=lambda effect: -effect.share)
        effects += [Effect(effect, [name], minor=True) for effect in told["minor_effects"]]
        return JointReport(told, effects)

    def to_dict(self) -> dict[str, Any]:
        """All of it, as `report.json` of `flexspline gap diagnose` has it."""
        told: dict[str, Any] = json.loads(self._inner.json())
        return told

    def to_pandas(self) -> Any:
        """A row a joint, effect and parameter; a joint without an effect has one row."""
        import pandas

        rows = []
        for joint in self.joints:
            of_joint = {
                "joint": joint.name,
                "verdict": joint.verdict,
                "gap_nm": joint.gap_nm,
                "gap_after_nm": joint.gap_after_nm,
                "remaining_share": joint.remaining_share,
            }
            for effect in joint.effects:
                of_effect = {
                    **of_joint,
                    "effect": effect.name,
                    "minor": effect.minor,
                    "probability": effect.probability,
                    "share": effect.share,
                    "share_low": effect.share_interval[0],
                    "share_high": effect.share_interval[1],
                }
                parameters = effect.parameters.items()
                rows += [{**of_effect, "parameter": k, "value": float(v), "std": v.std} for k, v in parameters]
                rows += [] if parameters else [of_effect]
            rows += [] if joint.effects else [of_joint]
        return pandas.DataFrame(rows)

    def traces(self, joint: str) -> dict[str, Floats]:
        """Torque over time of a joint's first stretch: `measured_nm`, `nominal_nm` by the robot file, `augmented_nm` with the effects."""
        self.joint(joint)
        traces = self._inner.traces(joint)
        if traces is None:
            raise InputError(f"joint `{joint}`: could not be diagnosed, so it has no traces; {self.joint(joint).reason}")
        return {name: np.asarray(values) for name, values in traces.items()}

    def save(self, path: PathLike) -> None:
        """Writes the page for people (`.html`) or the report for programs (`.json`), by the name's end."""
        end = Path(path).suffix.lower()
        if end not in (".html", ".json"):
            raise InputError(f"{os.fspath(path)}: a report is a page or data; name it .html or .json")
        text = self._inner.html() if end == ".html" else self._inner.json() + "\n"
        Path(path).write_text(text, encoding="utf-8")

    def apply(self, robot: Robot | PathLike | None = None, remaining: bool = False) -> Robot:
        """The robot with the effects added, that was diagnosed if no other is given.

        With `remaining` what has no name is added too, as torque tables. `Robot.changes` says what was done.
        """
        target = self.robot if robot is None else robot_of(robot)
        native, changes, left_out = _native.mended(target._inner, self._inner.json(), remaining)
        mended = Robot._of(native)
        told = [f"{joint or 'arm'}: {effect}: {done}" for joint, effect, done in changes]
        mended.changes = told + left_out
        return mended

    def plot(self, joint: str | None = None) -> Any:
        """Draws shares and traces with Matplotlib, of one joint or of each that has a gap; returns the figure."""
        from ._plot import plot

        return plot(self, joint)

    def _repr_html_(self) -> str:
        # a frame of its own: the page's style is not the notebook's, nor the notebook's the page's
        page = html.escape(self._inner.short_html())
        grow = "this.style.height = this.contentDocument.documentElement.scrollHeight + 20 + 'px'"
        return f'<iframe srcdoc="{page}" style="width: 100%; height: 600px; border: 0" onload="{grow}"></iframe>'

    def __repr__(self) -> str:
        return self._inner.text()
