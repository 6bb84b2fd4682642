"""Pictures of a report with Matplotlib."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any

from ._native import words

if TYPE_CHECKING:
    from ._report import JointReport, Report

# Traces with what they are, and how they are drawn: the robot lies below what comes near it.
_LINES = [
    ("measured_nm", "robot", "#b9b9b9", 3.0),
    ("nominal_nm", "simulation", "#c0504d", 0.9),
    ("augmented_nm", "simulation with the effects", "#3566a8", 0.9),
]


def _figure(size: tuple[float, float]) -> Any:
    """A figure of no window, which a notebook shows as it shows any picture."""
    from matplotlib.figure import Figure

    class Picture(Figure):
        def _repr_png_(self) -> bytes:
            png = BytesIO()
            self.savefig(png, format="png", dpi=110)
            return png.getvalue()

    return Picture(figsize=size, layout="constrained")


def plot(report: Report, joint: str | None) -> Any:
    """A row a joint: the shares of its gap, and the torque over time."""
    from matplotlib.lines import Line2D

    if joint is not None:
        shown = [report.joint(joint)]
    else:
        with_gap = [one for one in report.joints if one.verdict not in ("no_gap", "insufficient_data")]
        shown = with_gap or report.joints[:1]
    figure = _figure((11, 2.6 * len(shown) + 0.6))
    figure.suptitle(report.headline, wrap=True, fontsize=11)
    for (shares, torque), one in zip(figure.subplots(len(shown), 2, width_ratios=[1, 2], squeeze=False), shown):
        _shares(shares, one)
        _torque(torque, report, one)
    figure.legend(handles=[Line2D([], [], color=colour, label=label) for _, label, colour, _ in _LINES], loc="outside lower right", ncols=3)
    return figure


def _shares(axes: Any, joint: JointReport) -> None:
    named = [effect for effect in joint.effects if not effect.minor]
    names = [words(effect.name) for effect in named]
    shares = [effect.share for effect in named]
    low = [max(0.0, effect.share - effect.share_interval[0]) for effect in named]
    high = [max(0.0, effect.share_interval[1] - effect.share) for effect in named]
    minor = [effect.share for effect in joint.effects if effect.minor]
    rest = [("minor effects", sum(minor))] if minor else []
    rest.append(("without a name", joint.remaining_share))
    names += [name for name, _ in rest]
    shares += [share for _, share in rest]
    errors = [[100 * x for x in ends + [0.0] * len(rest)] for ends in (low, high)]
    colours = ["#3566a8"] * len(named) + ["#9a9a9a"] * len(rest)
    axes.barh(names, [100 * share for share in shares], xerr=errors, color=colours, ecolor="#333333", capsize=3)
    axes.invert_yaxis()
    axes.set_xlabel("share of the gap, %")
    axes.set_title(joint.name)
    axes.spines[["top", "right"]].set_visible(False)


def _torque(axes: Any, report: Report, joint: JointReport) -> None:
    if joint.verdict == "insufficient_data":
        axes.text(0.5, 0.5, joint.reason, ha="center", va="center", wrap=True, transform=axes.transAxes)
        axes.set_axis_off()
        return
    traces = report.traces(joint.name)
    for key, label, colour, width in _LINES:
        axes.plot(traces["time_s"], traces[key], label=label, color=colour, linewidth=width)
    axes.set_xlabel("time, s")
    axes.set_ylabel("disturbance torque, Nm")
    axes.set_title(f"{joint.gap_nm:.3g} Nm rms between robot and simulation, {joint.gap_after_nm:.3g} Nm with the effects", fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
