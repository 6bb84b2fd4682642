"""An effect at a joint, in every robot of a model: in how many it is, how much of it, and what is tested of that."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import polars as pl

from . import _statistics as statistics

#: A robot has an effect that is named in at least this part of its recordings; a fleet, one that this part of it has.
HALF = 0.5
#: Share of a joint's gap below which an effect makes no robot unlike others: the diagnosis' own materiality.
MATERIAL = 0.02
#: Parameters that say where or how an effect is, and not how much.
NO_AMOUNT = ("phase_rad", "cycles_per", "exponent", "rest_rad", "stribeck_velocity", "yield_rad")
#: Name of the joint of what a whole robot has.
WHOLE_ROBOT = "all joints"

#: What two rows must agree in to tell of the same thing.
KEY = ["model", "joint", "effect", "cycles"]


def key_columns() -> list[pl.Expr]:
    """The columns of `KEY` that rows have not: the joint with shared effects set apart, and cycles."""
    cycles = (
        pl.col("parameters")
        .list.eval(
            pl.element()
            .struct.field("value")
            .filter(pl.element().struct.field("name").str.starts_with("cycles_per"))
            .first()
        )
        .list.first()
    )
    # A shared effect is one thing of the whole robot. Cycles are fitted, so they are alike to a tenth only.
    return [
        pl.when(pl.col("shared")).then(pl.lit(WHOLE_ROBOT)).otherwise(pl.col("joint")).alias("of_joint"),
        cycles.round(1).alias("cycles"),
    ]


@dataclass
class Amount:
    """A parameter of an effect in every robot; NaN where it was not named."""

    name: str
    value: np.ndarray
    std: np.ndarray
    slopes: list[statistics.Slope | None]
    #: The slopes' mean over the fleet, of three robots or more.
    fleet_slope: statistics.Mean | None


@dataclass
class Subject:
    """An effect at a joint of a model, in every robot of that model."""

    key: tuple
    robots: list[str]
    #: Recordings that could have named it, and that did.
    of: np.ndarray
    named: np.ndarray
    #: Mean share of the gap where it is named.
    share: np.ndarray
    amounts: list[Amount]
    #: What each recording says of them: `robot`, `recording`, `time`, `parameter`, `value`, `std`.
    values: pl.DataFrame
    #: Not unlike the others, so far.
    trusted: np.ndarray
    p: dict[tuple, np.ndarray] = field(default_factory=dict)
    q: dict[tuple, np.ndarray] = field(default_factory=dict)

    @property
    def has(self) -> np.ndarray:
        """Robots in whose recordings it is named often enough."""
        return (self.of > 0) & (self.named >= HALF * np.maximum(self.of, 1))

    def test(self) -> None:
        """Tests every robot against those that are trusted so far."""
        self.p = {("named",): statistics.named_unlike_others(self.named, self.of, self.trusted)}
        for amount in self.amounts:
            told = np.isfinite(amount.value) & self.has
            p = np.full(len(self.robots), np.nan)
            p[told] = statistics.unlike_others(amount.value[told], amount.std[told], self.trusted[told])
            self.p["value", amount.name] = p
            self.p["drift", amount.name] = np.array([np.nan if line is None else line.p() for line in amount.slopes])
            fleet = amount.fleet_slope
            self.p["fleet drift", amount.name] = np.array([np.nan if fleet is None else fleet.p()])

    def named_unlike(self, rate: float) -> np.ndarray:
        """Robots that have it where others have not, or have not where others have."""
        rest = self.trusted.sum() - self.trusted
        others = (self.trusted @ self.named - self.trusted * self.named) / np.maximum(
            self.trusted @ self.of - self.trusted * self.of, 1
        )
        material = np.where(self.has, self.share >= MATERIAL, np.nanmean(self.share) >= MATERIAL)
        return (self.q["named",] <= rate) & (self.has != (others >= HALF)) & material & (rest > 0)

    def value_unlike(self, amount: Amount, rate: float) -> np.ndarray:
        """Robots that have more or less of it than the others."""
        return (self.q["value", amount.name] <= rate) & (self.share >= MATERIAL)

    def distrust(self, rate: float) -> bool:
        """Trusts robots that are unlike no more; whether there is a new one."""
        unlike = self.named_unlike(rate)
        for amount in self.amounts:
            unlike = unlike | self.value_unlike(amount, rate)
        before = self.trusted.sum()
        self.trusted = self.trusted & ~unlike
        return bool(self.trusted.sum() != before)

    def fleet(self, amount: Amount) -> statistics.Mean | None:
        """Mean over the robots that have it and are not unlike the others."""
        told = np.isfinite(amount.value) & self.has & self.trusted
        return statistics.random_effects(amount.value[told], amount.std[told]) if told.sum() >= 2 else None


def subjects_of(rows: pl.DataFrame) -> list[Subject]:
    """Everything that was named anywhere, in every robot that could have it."""
    looks = rows.filter(pl.col("verdict") != "insufficient_data")
    at_joint = looks.select("model", "robot", "joint", "recording", "confusable_with").unique(
        ["model", "robot", "joint", "recording"]
    )
    found = looks.filter(pl.col("effect").is_not_null()).sort("share", descending=True, nulls_last=True)
    found = found.unique(["model", "robot", "of_joint", "recording", "effect", "cycles"], keep="first", maintain_order=True)
    subjects = []
    groups = found.partition_by("model", "of_joint", "effect", "cycles", as_dict=True)
    for key in sorted(groups, key=str):
        model, joint, effect, _ = key
        seen = at_joint.filter(pl.col("model") == model)
        seen = seen if joint == WHOLE_ROBOT else seen.filter(pl.col("joint") == joint)
        named = groups[key].select("robot", "recording", "share", "time", "parameters")
        # a recording that cannot tell this effect from the one it names says nothing of it
        could = seen.filter(~pl.col("confusable_with").list.contains(effect)).select("robot", "recording")
        could = pl.concat([could, named.select("robot", "recording")]).unique()
        subjects.append(_subject(key, sorted(seen["robot"].unique()), could, named))
    return subjects


def _subject(key: tuple, robots: list[str], could: pl.DataFrame, named: pl.DataFrame) -> Subject:
    def by_robot(frame: pl.DataFrame, what: pl.Expr, missing: float) -> np.ndarray:
        table = dict(frame.group_by("robot").agg(what.alias("what")).iter_rows())
        return np.array([table.get(robot, missing) for robot in robots], dtype=float)

    amounts = named.explode("parameters").unnest("parameters")
    amounts = amounts.filter(
        ~pl.any_horizontal(*(pl.col("name").str.starts_with(start) for start in NO_AMOUNT))
        & (pl.col("std") > 0)
        & pl.col("value").is_finite()
        & pl.col("std").is_finite()
        & ~pl.col("at_bound")
    )
    return Subject(
        key=key,
        robots=robots,
        of=by_robot(could, pl.len(), 0),
        named=by_robot(named, pl.len(), 0),
        share=by_robot(named, pl.col("share").mean(), np.nan),
        amounts=[
            _amount(name, robots, group) for (name,), group in sorted(amounts.partition_by("name", as_dict=True).items())
        ],
        values=amounts.select("robot", "recording", "time", pl.col("name").alias("parameter"), "value", "std"),
        trusted=np.ones(len(robots), dtype=bool),
    )


def _amount(name: str, robots: list[str], rows: pl.DataFrame) -> Amount:
    """Each robot's mean and slope.

    A recording's stated error has a part that is the same in all of a robot's recordings, so the error of a robot's mean
    comes from how its recordings scatter: as all robots' do together, or as its own do if that is more.
    """
    number = {robot: index for index, robot in enumerate(robots)}
    of = np.array([number[robot] for robot in rows["robot"]])
    value, std, time = (rows[column].to_numpy().astype(float) for column in ("value", "std", "time"))
    weight = 1.0 / std**2
    mean, error = np.full(len(robots), np.nan), np.full(len(robots), np.nan)
    residual = np.empty(len(value))
    for robot in np.unique(of):
        own = of == robot
        mean[robot] = np.average(value[own], weights=weight[own])
        residual[own] = value[own] - mean[robot]
    scale = statistics.pooled_scale(residual, weight, len(np.unique(of)))
    slopes: list[statistics.Slope | None] = [None] * len(robots)
    for robot in np.unique(of):
        own = of == robot
        own_scale = statistics.pooled_scale(residual[own], weight[own]) if own.sum() > 1 else scale
        error[robot] = np.sqrt(max(scale, own_scale) / weight[own].sum())
        timed = own & np.isfinite(time)
        slopes[robot] = statistics.slope(time[timed], value[timed], std[timed])
    lines = [line for line in slopes if line is not None and line.std > 0]
    fleet_slope = (
        statistics.random_effects(np.array([line.value for line in lines]), np.array([line.std for line in lines]))
        if len(lines) >= 3
        else None
    )
    return Amount(name, mean, error, slopes, fleet_slope)


_KEY_SCHEMA = {"model": pl.String, "joint": pl.String, "effect": pl.String, "cycles": pl.Float64, "parameter": pl.String}

EFFECT_SCHEMA = {
    **_KEY_SCHEMA,
    "robots": pl.Int64,
    "robots_with": pl.Int64,
    "named": pl.Int64,
    "of": pl.Int64,
    "share": pl.Float64,
    "mean": pl.Float64,
    "low": pl.Float64,
    "high": pl.Float64,
    "spread": pl.Float64,
    "slope": pl.Float64,
    "slope_low": pl.Float64,
    "slope_high": pl.Float64,
    "slope_q": pl.Float64,
    "common": pl.Boolean,
}

ROBOT_SCHEMA = {
    "robot": pl.String,
    **_KEY_SCHEMA,
    "named": pl.Int64,
    "of": pl.Int64,
    "share": pl.Float64,
    "value": pl.Float64,
    "std": pl.Float64,
    "shrunk": pl.Float64,
    "shrunk_std": pl.Float64,
    "p_named": pl.Float64,
    "p_value": pl.Float64,
    "q": pl.Float64,
    "unlike": pl.Boolean,
    "why": pl.String,
}

DRIFT_SCHEMA = {
    "robot": pl.String,
    **_KEY_SCHEMA,
    "recordings": pl.Int64,
    "slope": pl.Float64,
    "low": pl.Float64,
    "high": pl.Float64,
    "level": pl.Float64,
    "p": pl.Float64,
    "q": pl.Float64,
    "drifts": pl.Boolean,
}


VALUE_SCHEMA = {
    "robot": pl.String,
    **_KEY_SCHEMA,
    "recording": pl.String,
    "time": pl.Float64,
    "value": pl.Float64,
    "std": pl.Float64,
}


def effect_rows(subject: Subject, rate: float) -> list[tuple]:
    """Rows of the fleet's table."""
    rows = []
    share = float(np.average(np.nan_to_num(subject.share), weights=subject.named))
    common = bool(subject.has.mean() >= HALF)
    for amount in subject.amounts:
        fleet, line = subject.fleet(amount), amount.fleet_slope
        mean = (None,) * 4 if fleet is None else (fleet.value, *fleet.interval(), fleet.spread)
        drift: tuple = (None,) * 4
        if line is not None:
            drift = (line.value, *line.interval(), float(subject.q["fleet drift", amount.name][0]))
        counts = (len(subject.robots), int(subject.has.sum()), int(subject.named.sum()), int(subject.of.sum()))
        rows.append((*subject.key, amount.name, *counts, share, *mean, *drift, common))
    return rows


def robot_rows(subject: Subject, rate: float) -> list[tuple]:
    """Rows of the robots' table."""
    rows = []
    named_unlike = subject.named_unlike(rate)
    for amount in subject.amounts:
        fleet = subject.fleet(amount)
        told = np.isfinite(amount.value)
        drawn = np.full((2, len(subject.robots)), np.nan)
        if fleet is not None:
            drawn[:, told] = statistics.shrunk(amount.value[told], amount.std[told], fleet)
        value_unlike = subject.value_unlike(amount, rate)
        q = np.fmin(subject.q["named",], subject.q["value", amount.name])
        for index, robot in enumerate(subject.robots):
            whys = []
            if named_unlike[index]:
                whys.append("has it, others have not" if subject.has[index] else "has it not, others have")
            if value_unlike[index] and fleet is not None:
                whys.append("more than others" if abs(amount.value[index]) > abs(fleet.value) else "less than others")
            p_named, p_value = subject.p["named",], subject.p["value", amount.name]
            numbers = (subject.share, amount.value, amount.std, *drawn, p_named, p_value, q)
            rows.append(
                (
                    robot,
                    *subject.key,
                    amount.name,
                    int(subject.named[index]),
                    int(subject.of[index]),
                    *(_number(column[index]) for column in numbers),
                    bool(whys),
                    "; ".join(whys),
                )
            )
    return rows


def drift_rows(subject: Subject, rate: float) -> list[tuple]:
    """Rows of the drifts' table."""
    rows = []
    for amount in subject.amounts:
        p, q = subject.p["drift", amount.name], subject.q["drift", amount.name]
        for index, line in enumerate(amount.slopes):
            if line is None:
                continue
            drifts = bool(q[index] <= rate and subject.share[index] >= MATERIAL)
            told = (line.freedom + 2, line.value, *line.interval(), line.level, _number(p[index]), _number(q[index]))
            rows.append((subject.robots[index], *subject.key, amount.name, *told, drifts))
    return rows


def value_rows(subject: Subject, rate: float) -> list[tuple]:
    """Rows of the recordings' table."""
    order = ["robot", "parameter", "recording", "time", "value", "std"]
    return [(robot, *subject.key, *rest) for robot, *rest in subject.values.select(order).iter_rows()]


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
