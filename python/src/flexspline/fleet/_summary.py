"""What a fleet's results say: what is common, which robot is unlike the others, and what drifts.

The arithmetic is in `_statistics`; docs/fleet.md says what is tested and how.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field

import numpy as np
import polars as pl

from . import _page as page
from . import _statistics as statistics
from ._dataset import Dataset
from ._subjects import (
    DRIFT_SCHEMA,
    EFFECT_SCHEMA,
    KEY,
    ROBOT_SCHEMA,
    VALUE_SCHEMA,
    drift_rows,
    effect_rows,
    key_columns,
    robot_rows,
    subjects_of,
    value_rows,
)

#: False discoveries among all that is told of robots and drifts.
RATE = 0.05
#: Looks at the fleet without the robots that the look before found unlike.
LOOKS = 5

CLOCKS = {
    "date": ("recorded_at", "month", 365.25 / 12 * 86400e6),
    "hours": ("operating_hours", "1000 h", 1000.0),
}


@dataclass(frozen=True)
class Summary:
    """A fleet's summary, as tables; `save` writes the page."""

    #: One row a model, joint, effect and parameter: how many robots have it, its mean, how robots scatter, fleet's drift.
    effects: pl.DataFrame
    #: One row a robot and each of these: its own value, drawn to the fleet's by its error, and how unlike it is.
    robots: pl.DataFrame
    #: One row a robot and each of these with five values or more: slope over time.
    drifts: pl.DataFrame
    #: One row a recording and each of these that it names: what it says. `time` is in the unit that slopes are told by.
    values: pl.DataFrame
    #: Recordings, robots, joints and tests behind it.
    counts: dict[str, int]
    #: The rate of false discoveries.
    rate: float
    #: What slopes are told by: `month` or `1000 h`.
    clock: str
    #: Recordings without a result, with kind and reason.
    set_aside: list[dict] = field(default_factory=list)

    @property
    def unlike(self) -> pl.DataFrame:
        """Rows of `robots` by which a robot is unlike the others."""
        return self.robots.filter(pl.col("unlike")).sort("q")

    @property
    def drifting(self) -> pl.DataFrame:
        """Rows of `drifts` that are drifts."""
        return self.drifts.filter(pl.col("drifts")).sort("q")

    @property
    def common(self) -> pl.DataFrame:
        """Rows of `effects` that the fleet has in common."""
        return self.effects.filter(pl.col("common"))

    def to_html(self) -> str:
        """The page, one file without anything from outside."""
        return page.html(self)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the page."""
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.to_html())

    def __str__(self) -> str:
        return "\n".join(page.sentences(self))

    def _repr_html_(self) -> str:
        return page.body(self)


def summary(dataset: str | os.PathLike[str], *, over: str = "date", rate: float = RATE) -> Summary:
    """Reads a dataset of `fleet.diagnose` and says what the fleet has in common, who is unlike the others, what drifts.

    `over`: drift is told by `date` or by operating `hours`. `rate`: of false ones among the robots told unlike and the
    drifts told, at most this part, on average.

    Raises ValueError in one line.
    """
    if over not in CLOCKS:
        raise ValueError(f"over: `{over}` is none of {', '.join(CLOCKS)}")
    if not 0.0 < rate < 1.0:
        raise ValueError(f"rate: {rate}, it must be between 0 and 1")
    results = Dataset(dataset)
    rows = pl.DataFrame(results.read())
    return of_rows(rows, over=over, rate=rate, set_aside=results.read_set_aside())


def of_rows(rows: pl.DataFrame, *, over: str = "date", rate: float = RATE, set_aside: list[dict] | None = None) -> Summary:
    """The same of rows that were read before."""
    column, clock, unit = CLOCKS[over]
    rows, copies = _once(rows)
    time = pl.col(column).dt.epoch("us") if over == "date" else pl.col(column)
    rows = rows.with_columns((time / unit).alias("time"), *key_columns())
    subjects = subjects_of(rows)
    for _ in range(LOOKS):
        for subject in subjects:
            subject.test()
        p = [subject.p[name] for subject in subjects for name in subject.p]
        q = statistics.false_discovery_rate(np.concatenate(p)) if p else np.array([])
        split = iter(np.split(q, np.cumsum([len(part) for part in p])[:-1]) if p else [])
        for subject in subjects:
            subject.q = {name: next(split) for name in subject.p}
        # without those that are unlike, the others are more alike: look again
        if not any([subject.distrust(rate) for subject in subjects]):
            break
    counts = {
        "recordings": rows.select("robot", "recording").n_unique(),
        "copies": copies,
        "robots": rows["robot"].n_unique(),
        "joints": rows.select("robot", "joint").n_unique(),
        "tests": int(np.sum(~np.isnan(q))),
    }
    effects, robots, drifts, values = (
        pl.DataFrame([row for subject in subjects for row in part(subject, rate)], schema=schema, orient="row")
        for part, schema in (
            (effect_rows, EFFECT_SCHEMA),
            (robot_rows, ROBOT_SCHEMA),
            (drift_rows, DRIFT_SCHEMA),
            (value_rows, VALUE_SCHEMA),
        )
    )
    return Summary(
        effects=effects.sort("common", "share", descending=True, nulls_last=True),
        robots=robots.sort("robot", *KEY, "parameter"),
        drifts=drifts.sort("robot", *KEY, "parameter"),
        values=values.sort("robot", *KEY, "parameter", "time"),
        counts=counts,
        rate=rate,
        clock=clock,
        set_aside=set_aside or [],
    )


def _once(rows: pl.DataFrame) -> tuple[pl.DataFrame, int]:
    """Without copies of a recording under other addresses, and how many there were."""
    first = rows.group_by("robot", "content").agg(pl.col("recording").min())
    kept = rows.join(first, on=["robot", "content", "recording"])
    return kept, rows["recording"].n_unique() - kept["recording"].n_unique()
