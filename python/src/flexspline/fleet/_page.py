"""A fleet's summary as sentences and as one HTML page without anything from outside."""

from __future__ import annotations

import datetime
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

SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

#: Figures on the page: the effects with the largest shares, and whatever makes a robot unlike.
FIGURES = 12

STYLE = """
.fleet { font: 15px/1.5 system-ui, sans-serif; color: #1d2733; max-width: 72rem; margin: 0 auto; padding: 1rem; }
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
                    _rate(row["q"]),
                ]
                for row in summary.unlike.iter_rows(named=True)
            ],
            "No robot is.",
        )
    )
    parts.append("<h2>What drifts</h2>")
    drifts = [
        [row["robot"], _thing(row), _slope(row, "slope", "low", "high", summary.clock), _relative(row), _rate(row["q"])]
        for row in summary.drifting.iter_rows(named=True)
    ]
    drifts += [
        [
            "all " + row["model"],
            _thing(row),
            _slope(row, "slope", "slope_low", "slope_high", summary.clock),
            "",
            _rate(row["slope_q"]),
        ]
        for row in _fleet_drifts(summary).iter_rows(named=True)
    ]
    parts.append(_table(["robot", "what", "slope, 95 % interval", f"of its value a {summary.clock}", "q"], drifts, "Nothing does."))
    parts.extend(_courses(summary))
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


def _digits(value: float, form: str = "") -> str:
    """Three digits, as people write them: 6690 and 2.9·10⁻⁵, not 6.69e+03 and 2.9e-05."""
    if value == 0.0:
        return "0"
    mantissa, exponent = f"{value:{form}.2e}".split("e")
    if -3 <= int(exponent) <= 5:
        return f"{float(f'{value:.2e}'):{form}.{max(0, 2 - int(exponent))}f}"
    return f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPT)}"


def _value(value: float | None, parameter: str) -> str:
    return "-" if value is None else f"{_digits(value)}{_unit(parameter)}"


def _interval(row: dict, value: str, low: str, high: str) -> str:
    if row[value] is None:
        return "-"
    return f"{_value(row[value], row['parameter'])} ({_digits(row[low])} to {_digits(row[high])})"


def _rate(q: float) -> str:
    """A rate of false discoveries; how small a very small one is depends on the laws' far tails, which nobody knows."""
    return "below 10⁻⁶" if q < 1e-6 else _digits(q)


def _slope(row: dict, value: str, low: str, high: str, clock: str) -> str:
    told, least, most = (_digits(row[name], "+") for name in (value, low, high))
    return f"{told}{_unit(row['parameter'])} a {clock} ({least} to {most})"


def _relative(row: dict) -> str:
    return f"{100 * row['slope'] / abs(row['level']):+.2g} %" if row["level"] else ""


def _of_fleet(summary: Summary, row: dict) -> str:
    same = pl.all_horizontal(*(pl.col(name).eq_missing(pl.lit(row[name])) for name in [*KEY, "parameter"]))
    fleet = summary.effects.filter(same).row(0, named=True)
    if fleet["mean"] is None or fleet["robots_with"] < 2:
        return "have it not"
    return f"{_value(fleet['mean'], row['parameter'])} ± {_digits(fleet['spread'])}"


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


def _courses(summary: Summary) -> Iterable[str]:
    """Each drifting robot's recordings over time."""
    order = [*KEY, "parameter"]
    for number, row in enumerate(summary.drifting.head(FIGURES).iter_rows(named=True)):
        if number == 0:
            yield "<p class='quiet'>Dot and line: what a recording says, 95 %. Orange: the drift. Band: the fleet's mean, and how "
            yield "robots differ, 95 %.</p>"
        same = pl.all_horizontal(*(pl.col(name).eq_missing(pl.lit(row[name])) for name in order))
        told = summary.values.filter(same & (pl.col("robot") == row["robot"]) & pl.col("time").is_finite())
        fleet = summary.effects.filter(same).row(0, named=True)
        caption = escape(f"{row['robot']}: {_thing(row)}{_unit(row['parameter']).replace(' ', ', ', 1)}")
        yield f"<figure><figcaption>{caption}</figcaption>{_course(told, row, fleet, summary.clock)}</figure>"


def _course(told: pl.DataFrame, drift: dict, fleet: dict, clock: str) -> str:
    left, width, height, top = 60, 590, 170, 10
    time, value, std = (told[name].to_list() for name in ("time", "value", "std"))
    begin, end = min(time), max(time)
    # the line's level is that at the mean of its times, weighted as the line is
    weight = [1.0 / one**2 for one in std]
    middle = sum(w * t for w, t in zip(weight, time)) / sum(weight)
    line = [drift["level"] + drift["slope"] * (t - middle) for t in (begin, end)]
    ends = [v + sign * 1.96 * s for v, s in zip(value, std) for sign in (-1, 1)] + line
    band = []
    if fleet["mean"] is not None:
        band = [fleet["mean"] + sign * 2 * fleet["spread"] for sign in (-1, 1)]
    low, high = min(ends + band), max(ends + band)
    margin = 0.05 * (high - low or abs(high) or 1.0)
    low, high = low - margin, high + margin

    def x(at: float) -> float:
        return left + width * (at - begin) / (end - begin)

    def y(of: float) -> float:
        return top + height * (high - of) / (high - low)

    across, down = left + width + 40, top + height + 30
    parts = [f"<svg viewBox='0 0 {across} {down}' width='{across}' font-size='11' role='img'>"]
    if band:
        box = f"x='{left}' y='{y(band[1]):.1f}' width='{width}' height='{y(band[0]) - y(band[1]):.1f}'"
        parts.append(f"<rect {box} fill='#e3ebf5'/>")
        at = f"{y(fleet['mean']):.1f}"
        parts.append(f"<line x1='{left}' x2='{left + width}' y1='{at}' y2='{at}' stroke='#7d97b8'/>")
    for t, v, s in zip(time, value, std):
        ends_at = f"x1='{x(t):.1f}' x2='{x(t):.1f}' y1='{y(v - 1.96 * s):.1f}' y2='{y(v + 1.96 * s):.1f}'"
        parts.append(f"<line {ends_at} stroke='#b9c7d8'/>")
        parts.append(f"<circle cx='{x(t):.1f}' cy='{y(v):.1f}' r='3' fill='#27476e'/>")
    ends_at = f"x1='{x(begin):.1f}' x2='{x(end):.1f}' y1='{y(line[0]):.1f}' y2='{y(line[1]):.1f}'"
    parts.append(f"<line {ends_at} stroke='#c8590b' stroke-width='2'/>")
    for of in (low + margin, 0.5 * (low + high), high - margin):
        parts.append(f"<text x='{left - 8}' y='{y(of) + 4:.1f}' text-anchor='end' fill='#5b6876'>{_digits(of)}</text>")
    for at in (begin, 0.5 * (begin + end), end):
        when = f"<text x='{x(at):.1f}' y='{top + height + 18}' text-anchor='middle' fill='#5b6876'>"
        parts.append(f"{when}{_instant(at, clock)}</text>")
    return "".join(parts) + "</svg>"


def _instant(time: float, clock: str) -> str:
    if clock != "month":
        return f"{1000 * time:.0f} h"
    begin = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)
    return (begin + datetime.timedelta(days=time * 365.25 / 12)).date().isoformat()


def _forest(robots: pl.DataFrame, fleet: dict) -> str:
    left, width, right, line, top = 90, 560, 150, 15, 24
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
        parts.append(f"<text x='{x(value):.1f}' y='{bottom + 14}' text-anchor='middle' fill='#5b6876'>{_digits(value)}</text>")
    return "".join(parts) + "</svg>"
