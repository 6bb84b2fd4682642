"""A fleet's summary as sentences and as one HTML page without anything from outside."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import TYPE_CHECKING

import polars as pl

from ._subjects import KEY, MATERIAL

if TYPE_CHECKING:
    from ._summary import Summary

#: Ends of parameters' names, the longer first.
UNITS = {
    "_nm_s2_rad2": "Nm s²/rad²",
    "_nm_s_rad": "Nm s/rad",
    "_nm_rad": "Nm/rad",
    "_rad_s": "rad/s",
    "_kg_m2": "kg m²",
    "_nm_s": "Nm/s",
    "_nm": "Nm",
    "_rad": "rad",
    "_kg": "kg",
    "_hz": "Hz",
    "_s": "s",
    "_m": "m",
}

#: Figures on the page: the effects with the largest shares, and whatever makes a robot unlike.
FIGURES = 12

STYLE = """
.fleet { font: 15px/1.5 system-ui, sans-serif; color: #1d2733; max-width: 62rem; margin: 0 auto; padding: 1rem; }
.fleet h1 { font-size: 1.5rem; } .fleet h2 { font-size: 1.15rem; margin-top: 2rem; }
.fleet table { border-collapse: collapse; display: block; overflow-x: auto; }
.fleet th, .fleet td { text-align: left; padding: .25rem .8rem .25rem 0; white-space: nowrap; }
.fleet th, .fleet td { border-bottom: 1px solid #dde3ea; } .fleet th { font-weight: 600; }
.fleet figure { margin: 1.2rem 0; } .fleet figcaption { font-weight: 600; } .fleet svg { max-width: 100%; height: auto; }
.fleet .quiet { color: #5b6876; }
"""


def sentences(summary: Summary) -> list[str]:
    """The whole summary in a few lines."""
    counts = summary.counts
    head = f"{counts['recordings']} recordings of {counts['robots']} robots"
    if counts["copies"]:
        head += f", {counts['copies']} copies counted once"
    if summary.set_aside:
        head += f", {len(summary.set_aside)} set aside"
    lines = [head + "."]
    for row in _material(summary.common).iter_rows(named=True):
        lines.append(
            f"Common: {_thing(row)} of {row['model']}, in {row['robots_with']} of {row['robots']} robots: "
            f"{_interval(row, 'mean', 'low', 'high')}, robots differ by {_value(row['spread'], row['parameter'])}."
        )
    for row in summary.unlike.iter_rows(named=True):
        lines.append(
            f"Unlike the others: {row['robot']}, {_thing(row)} {_value(row['value'], row['parameter'])}, "
            f"{row['why']} (named in {row['named']} of {row['of']} recordings)."
        )
    for row in summary.drifting.iter_rows(named=True):
        lines.append(f"Drifts: {row['robot']}, {_thing(row)}: {_slope(row, 'slope', 'low', 'high', summary.clock)}.")
    for row in _fleet_drifts(summary).iter_rows(named=True):
        told = _slope(row, "slope", "slope_low", "slope_high", summary.clock)
        lines.append(f"Drifts in the whole fleet: {_thing(row)} of {row['model']}: {told}.")
    lines.append(_promise(summary))
    return lines


def body(summary: Summary) -> str:
    """The page's content, for a notebook too."""
    parts = [f"<style>{STYLE}</style><div class='fleet'><h1>What the fleet says</h1>"]
    parts.append(f"<p>{escape(sentences(summary)[0])} <span class='quiet'>{escape(_promise(summary))}</span></p>")
    parts.append("<h2>Unlike the others</h2>")
    parts.append(
        _table(
            ["robot", "what", "its value", "others", "why", "named in", "q"],
            [
                [
                    row["robot"],
                    _thing(row),
                    _value(row["value"], row["parameter"]),
                    _of_fleet(summary, row),
                    row["why"],
                    f"{row['named']} of {row['of']}",
                    f"{row['q']:.2g}",
                ]
                for row in summary.unlike.iter_rows(named=True)
            ],
            "No robot is.",
        )
    )
    parts.append("<h2>What drifts</h2>")
    drifts = [
        [row["robot"], _thing(row), _slope(row, "slope", "low", "high", summary.clock), _relative(row), f"{row['q']:.2g}"]
        for row in summary.drifting.iter_rows(named=True)
    ]
    drifts += [
        [
            "all " + row["model"],
            _thing(row),
            _slope(row, "slope", "slope_low", "slope_high", summary.clock),
            "",
            f"{row['slope_q']:.2g}",
        ]
        for row in _fleet_drifts(summary).iter_rows(named=True)
    ]
    parts.append(_table(["robot", "what", "slope, 95 % interval", "of its value", "q"], drifts, "Nothing does."))
    parts.append("<h2>What the fleet has in common</h2>")
    parts.append(
        _table(
            ["model", "what", "robots that have it", "mean, 95 % interval", "robots differ by", "share of the gap"],
            [
                [
                    row["model"],
                    _thing(row),
                    f"{row['robots_with']} of {row['robots']}",
                    _interval(row, "mean", "low", "high"),
                    _value(row["spread"], row["parameter"]),
                    f"{100 * row['share']:.1f} %",
                ]
                for row in summary.common.iter_rows(named=True)
            ],
            "Nothing.",
        )
    )
    parts.extend(_figures(summary))
    if summary.set_aside:
        parts.append("<h2>Set aside</h2>")
        rows = [[entry["recording"], entry["kind"], entry["reason"]] for entry in summary.set_aside]
        parts.append(_table(["recording", "kind", "reason"], rows, ""))
    parts.append("</div>")
    return "\n".join(parts)


def html(summary: Summary) -> str:
    """The page."""
    head = "<!doctype html><html lang='en'><meta charset='utf-8'><meta name='viewport' content='width=device-width'>"
    return f"{head}<title>What the fleet says</title>\n{body(summary)}\n</html>\n"


def _promise(summary: Summary) -> str:
    return (
        f"Of the robots told unlike and the drifts, {100 * summary.rate:.2g} % at most are false on average "
        f"(Benjamini-Hochberg over {summary.counts['tests']} tests: robots by effects by what is told of them)."
    )


def _material(effects: pl.DataFrame) -> pl.DataFrame:
    return effects.filter(pl.col("share") >= MATERIAL)


def _fleet_drifts(summary: Summary) -> pl.DataFrame:
    return _material(summary.common).filter(pl.col("slope_q") <= summary.rate)


def _thing(row: dict) -> str:
    cycles = "" if row["cycles"] is None else f" at {row['cycles']:g} cycles"
    parameter = _plain(row["parameter"])
    effect = row["effect"].replace("_", " ").replace("coulomb", "Coulomb").replace("stribeck", "Stribeck")
    detail = "" if parameter in ("amplitude", "gap") or parameter.lower() in effect.lower() else f" ({parameter})"
    return f"{row['joint']} {effect}{cycles}{detail}"


def _plain(parameter: str) -> str:
    ends = [end for end in UNITS if parameter.endswith(end)]
    return parameter[: -len(ends[0])].replace("_", " ") if ends else parameter.replace("_", " ")


def _unit(parameter: str) -> str:
    return next((" " + unit for end, unit in UNITS.items() if parameter.endswith(end)), "")


def _value(value: float | None, parameter: str) -> str:
    return "-" if value is None else f"{value:.3g}{_unit(parameter)}"


def _interval(row: dict, value: str, low: str, high: str) -> str:
    if row[value] is None:
        return "-"
    return f"{_value(row[value], row['parameter'])} ({row[low]:.3g} to {row[high]:.3g})"


def _slope(row: dict, value: str, low: str, high: str, clock: str) -> str:
    return f"{row[value]:+.3g}{_unit(row['parameter'])} a {clock} ({row[low]:+.3g} to {row[high]:+.3g})"


def _relative(row: dict) -> str:
    return f"{100 * row['slope'] / abs(row['level']):+.2g} %" if row["level"] else ""


def _of_fleet(summary: Summary, row: dict) -> str:
    same = pl.all_horizontal(*(pl.col(name).eq_missing(pl.lit(row[name])) for name in [*KEY, "parameter"]))
    fleet = summary.effects.filter(same).row(0, named=True)
    if fleet["mean"] is None or fleet["robots_with"] < 2:
        return "have it not"
    return f"{_value(fleet['mean'], row['parameter'])} ± {fleet['spread']:.2g}"


def _table(heads: list[str], rows: list[list[str]], nothing: str) -> str:
    if not rows:
        return f"<p>{escape(nothing)}</p>"
    head = "".join(f"<th>{escape(name)}</th>" for name in heads)
    lines = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows)
    return f"<table><tr>{head}</tr>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def _figures(summary: Summary) -> Iterable[str]:
    order = [*KEY, "parameter"]
    common = _material(summary.common).select(order)
    wanted = pl.concat([common, summary.unlike.select(order)]).unique(maintain_order=True).head(FIGURES)
    for number, row in enumerate(wanted.iter_rows(named=True)):
        if number == 0:
            yield "<h2>Robot by robot</h2><p class='quiet'>Line and circle: each robot's own mean, 95 %. Dot: drawn to the "
            yield "fleet's by its error. Band: the fleet's mean, and how robots differ, 95 %. Orange: unlike the others.</p>"
        same = pl.all_horizontal(*(pl.col(name).eq_missing(pl.lit(row[name])) for name in order))
        robots = summary.robots.filter(same & pl.col("value").is_not_null()).sort("robot")
        fleet = summary.effects.filter(same).row(0, named=True)
        caption = escape(f"{row['model']}: {_thing(row)}")
        yield f"<figure><figcaption>{caption}</figcaption>{_forest(robots, fleet)}</figure>"


def _forest(robots: pl.DataFrame, fleet: dict) -> str:
    left, width, right, line, top = 90, 560, 90, 15, 24
    rows = list(robots.iter_rows(named=True))
    ends = [row["value"] + sign * 2 * row["std"] for row in rows for sign in (-1, 1)]
    band = None
    if fleet["mean"] is not None:
        band = (fleet["mean"] - 2 * fleet["spread"], fleet["mean"] + 2 * fleet["spread"])
        ends += band
    low, high = min(ends), max(ends)
    margin = 0.05 * (high - low or abs(high) or 1.0)
    low, high = low - margin, high + margin

    def x(value: float) -> float:
        return left + width * (value - low) / (high - low)

    bottom = top + line * len(rows)
    across, down = left + width + right, bottom + 24
    parts = [f"<svg viewBox='0 0 {across} {down}' width='{across}' font-size='11' role='img'>"]
    if band is not None:
        begin, middle, end = x(band[0]), x(fleet["mean"]), x(band[1])
        box = f"x='{begin:.1f}' y='{top - 6}' width='{end - begin:.1f}' height='{bottom - top}'"
        parts.append(f"<rect {box} fill='#e3ebf5'/>")
        ends_at = f"x1='{middle:.1f}' x2='{middle:.1f}' y1='{top - 6}' y2='{bottom - 6}'"
        parts.append(f"<line {ends_at} stroke='#7d97b8'/>")
    for index, row in enumerate(rows):
        y = top + line * index
        colour = "#c8590b" if row["unlike"] else "#27476e"
        name, told = escape(row["robot"]), escape(_value(row["value"], row["parameter"]))
        begin, end = x(row["value"] - 1.96 * row["std"]), x(row["value"] + 1.96 * row["std"])
        parts.append(f"<text x='{left - 8}' y='{y + 4}' text-anchor='end' fill='{colour}'>{name}</text>")
        parts.append(f"<line x1='{begin:.1f}' x2='{end:.1f}' y1='{y}' y2='{y}' stroke='{colour}'/>")
        parts.append(f"<circle cx='{x(row['value']):.1f}' cy='{y}' r='2.5' fill='white' stroke='{colour}'/>")
        if row["shrunk"] is not None:
            parts.append(f"<circle cx='{x(row['shrunk']):.1f}' cy='{y}' r='3.5' fill='{colour}'/>")
        parts.append(f"<text x='{left + width + 8}' y='{y + 4}' fill='{colour}'>{told}</text>")
    for value in (low + margin, 0.5 * (low + high), high - margin):
        parts.append(f"<text x='{x(value):.1f}' y='{bottom + 14}' text-anchor='middle' fill='#5b6876'>{value:.3g}</text>")
    return "".join(parts) + "</svg>"
