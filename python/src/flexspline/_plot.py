"""Pictures of a report with Matplotlib."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ._report import JointReport, Report


def plot(report: Report, joint: str | None) -> Any:
    """A row a joint: the shares of its gap, and the torque over time."""
    from matplotlib.figure import Figure

    if joint is not None:
        shown = [report.joint(joint)]
    else:
        with_gap = [one for one in report.joints if one.verdict not in ("no_gap", "insufficient_data")]
        shown = with_gap or report.joints[:1]
    figure = Figure(figsize=(11, 2.6 * len(shown) + 0.6), layout="constrained")
    figure.suptitle(report.headline, wrap=True, fontsize=11)
    for (shares, torque), one in zip(figure.subplots(len(shown), 2, width_ratios=[1, 2], squeeze=False), shown):
        _shares(shares, one)
        _torque(torque, report, one)
    return figure


def _shares(axes: Any, joint: JointReport) -> None:
    named = [effect for effect in joint.effects if not effect.minor]
    names = [effect.name.replace("_", " ") for effect in named]
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
    lines = [("measured_nm", "robot", "#333333"), ("nominal_nm", "simulation", "#c0504d"), ("augmented_nm", "with effects", "#3566a8")]
    for key, label, colour in lines:
        axes.plot(traces["time_s"], traces[key], label=label, color=colour, linewidth=0.9)
    axes.set_xlabel("time, s")
    axes.set_ylabel("torque, Nm")
    axes.set_title(f"{joint.gap_nm:.3g} Nm rms between robot and simulation, {joint.gap_after_nm:.3g} Nm with the effects", fontsize=9)
    axes.legend(frameon=False, ncols=3, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
