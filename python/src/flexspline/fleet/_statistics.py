"""Means over recordings and over robots, and how far a robot is from the others. Pure: arrays in, numbers out.

Sources
  PM    Paule, Mandel, J. Res. NBS 87 (1982) 377-385: variance between groups from the generalised Q statistic
  HKSJ  Hartung, Knapp, Statistics in Medicine 20 (2001) 3875-3889: interval of a random-effects mean, by Student's t
  BH    Benjamini, Hochberg, J. R. Statist. Soc. B 57 (1995) 289-300: false discovery rate
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

#: How alike recordings of one robot are at least taken to be in whether an effect is named: the correlation of two of
#: them. Assumed; it keeps two recordings that agree by chance from making a robot unlike the others.
LEAST_CORRELATION = 0.1


@dataclass(frozen=True)
class Mean:
    """A mean over groups that scatter by more than their own errors."""

    value: float
    std: float
    #: Scatter of the groups' true values.
    spread: float
    #: Of Student's t.
    freedom: int

    def p(self) -> float:
        """Two-sided, of the mean being zero."""
        return float(2.0 * stats.t.sf(abs(self.value) / self.std, self.freedom))

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """What holds the true mean at this level."""
        half = stats.t.ppf(0.5 + level / 2, self.freedom) * self.std if self.freedom > 0 else float("inf")
        return self.value - half, self.value + half


def spread_between(value: np.ndarray, std: np.ndarray) -> float:
    """Standard deviation of the groups' true values (PM): that with which the generalised Q is what it should be."""
    freedom = len(value) - 1
    if freedom < 1:
        return 0.0

    def excess(variance: float) -> float:
        weight = 1.0 / (std**2 + variance)
        return float(np.sum(weight * (value - np.average(value, weights=weight)) ** 2) - freedom)

    low, high = 0.0, float(np.var(value, ddof=1)) + float(np.max(std)) ** 2
    if excess(low) <= 0.0:
        return 0.0
    while excess(high) > 0.0:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0.0 else (low, middle)
    return float(np.sqrt(0.5 * (low + high)))


def random_effects(value: np.ndarray, std: np.ndarray) -> Mean:
    """Mean of groups with values and standard deviations (PM, HKSJ)."""
    spread = spread_between(value, std)
    weight = 1.0 / (std**2 + spread**2)
    mean = float(np.average(value, weights=weight))
    freedom = len(value) - 1
    scale = float(np.sum(weight * (value - mean) ** 2)) / freedom if freedom > 0 else 1.0
    # never narrower than the groups' own errors allow
    return Mean(mean, float(np.sqrt(max(scale, 1.0) / np.sum(weight))), spread, freedom)


def shrunk(value: np.ndarray, std: np.ndarray, fleet: Mean) -> tuple[np.ndarray, np.ndarray]:
    """Each group's value drawn to the mean by as much as its own error is larger than the spread, and its std."""
    own = fleet.spread**2 / (fleet.spread**2 + std**2)
    return fleet.value + own * (value - fleet.value), np.sqrt(own * std**2 + (1.0 - own) ** 2 * fleet.std**2)


def unlike_others(value: np.ndarray, std: np.ndarray, trusted: np.ndarray) -> np.ndarray:
    """Two-sided p of each group being one more of the trusted others. None (NaN) with fewer than three others."""
    p = np.full(len(value), np.nan)
    for group in range(len(value)):
        others = trusted & (np.arange(len(value)) != group)
        if others.sum() < 3:
            continue
        fleet = random_effects(value[others], std[others])
        scatter = np.sqrt(std[group] ** 2 + fleet.spread**2 + fleet.std**2)
        p[group] = 2.0 * stats.t.sf(abs(value[group] - fleet.value) / scatter, fleet.freedom)
    return p


def named_unlike_others(named: np.ndarray, of: np.ndarray, trusted: np.ndarray) -> np.ndarray:
    """Two-sided p of a group's share of namings being that of the trusted others, by a beta-binomial law.

    Its mean is the others', with half a naming in one recording more, so that it is never zero. Its correlation is what
    the others show by moments, at least `LEAST_CORRELATION`. NaN with fewer than three others, or nothing to name.
    """
    others = trusted[None, :] & ~np.eye(len(named), dtype=bool) & (of[None, :] > 0)
    total, hits = others @ of, others @ named
    mean = (hits + 0.5) / (total + 1.0)
    binomial = of[None, :] * (mean * (1 - mean))[:, None]
    excess = (named[None, :] - of[None, :] * mean[:, None]) ** 2 - binomial
    pairs = np.sum(others * binomial * (of - 1)[None, :], axis=1)
    shown = np.divide(np.sum(others * excess, axis=1), pairs, out=np.zeros(len(named)), where=pairs > 0)
    precision = 1.0 / np.clip(shown, LEAST_CORRELATION, 0.99) - 1.0
    law = stats.betabinom(of.astype(int), mean * precision, (1 - mean) * precision)
    p = np.minimum(1.0, 2.0 * np.minimum(law.sf(named - 1), law.cdf(named)))
    return np.where((others.sum(axis=1) >= 3) & (of > 0), p, np.nan)


def pooled_scale(residual: np.ndarray, weight: np.ndarray, groups: int = 1) -> float:
    """Mean weighted square about the means of so many groups; 1, the stated errors, where each has one value."""
    freedom = len(residual) - groups
    return float(np.sum(weight * residual**2)) / freedom if freedom > 0 else 1.0


@dataclass(frozen=True)
class Slope:
    """A straight line through values over time."""

    value: float
    std: float
    freedom: int
    #: Value at the middle of the time told.
    level: float

    def p(self) -> float:
        """Two-sided, of there being no slope."""
        return float(2.0 * stats.t.sf(abs(self.value) / self.std, self.freedom)) if self.std > 0 else 1.0

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """What holds the true slope at this level."""
        half = float(stats.t.ppf(0.5 + level / 2, self.freedom)) * self.std
        return self.value - half, self.value + half


def slope(time: np.ndarray, value: np.ndarray, std: np.ndarray) -> Slope | None:
    """Weighted least squares, its error from the values' scatter. None of fewer than five values or two instants."""
    if len(value) < 5 or np.ptp(time) <= 0.0:
        return None
    weight = 1.0 / std**2
    weight = weight / weight.mean()
    centre = np.average(time, weights=weight)
    from_centre = time - centre
    squares = float(np.sum(weight * from_centre**2))
    level = float(np.average(value, weights=weight))
    rise = float(np.sum(weight * from_centre * value)) / squares
    freedom = len(value) - 2
    scatter = float(np.sum(weight * (value - level - rise * from_centre) ** 2)) / freedom
    return Slope(rise, float(np.sqrt(scatter / squares)), freedom, level)


def false_discovery_rate(p: np.ndarray) -> np.ndarray:
    """The rate at which each p would just be a discovery (BH); NaN stays, and is no test."""
    q = np.full(len(p), np.nan)
    tested = np.flatnonzero(~np.isnan(p))
    if len(tested):
        q[tested] = stats.false_discovery_control(p[tested])
    return q
