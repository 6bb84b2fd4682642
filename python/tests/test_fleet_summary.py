"""The summary of a fleet, on rows whose truth is known. No seed here is one that the summary was developed with."""

import datetime

import numpy as np
import polars as pl
import pytest
from flexspline.fleet import _statistics as statistics
from flexspline.fleet._summary import of_rows

FIRST = datetime.datetime(2026, 3, 2, tzinfo=datetime.timezone.utc)
MONTH_DAYS = 365.25 / 12


def parameter(name, value, std):
    return [{"name": name, "value": float(value), "std": float(std), "at_bound": False}]


def fleet(seed, robots=24, recordings=16, broken=(), worn=(), wear_nm_month=0.03, spurious=0.04, **change):
    """Rows of one-joint robots with friction in common: 0.5 Nm, 0.05 between robots, 0.03 from day to day."""
    draw = np.random.default_rng(seed)
    rows = []
    for robot in range(robots):
        own_nm = 0.5 + 0.05 * draw.normal()
        for day in range(0, 7 * recordings, 7):
            row = {
                "recording": f"{robot}/{day}",
                "content": f"{robot}-{day}",
                "model": "axis",
                "robot": f"axis-{robot:02d}",
                "recorded_at": FIRST + datetime.timedelta(days=day),
                "operating_hours": 8.0 * day,
                "joint": "joint1",
                "verdict": "explained",
                "confusable_with": [],
                "shared": False,
                **change,
            }
            coulomb_nm = own_nm + 0.03 * draw.normal() + (wear_nm_month * day / MONTH_DAYS if robot in worn else 0.0)
            friction = parameter("coulomb_nm", coulomb_nm, 0.06)
            rows.append({**row, "effect": "coulomb_friction", "share": 0.9, "parameters": friction})
            if robot in broken:
                gap = parameter("gap_rad", 1e-3 + 5e-5 * draw.normal(), 5e-5)
                rows.append({**row, "effect": "backlash", "share": 0.5, "parameters": gap})
            for effect in ("gravity_torque", "viscous_friction", "torque_offset"):
                if draw.random() < spurious:
                    found = parameter("some_nm", 0.1 + 0.05 * draw.normal(), 0.05)
                    rows.append({**row, "effect": effect, "share": 0.1, "parameters": found})
    return pl.DataFrame(rows)


def told(frame):
    return set(frame.select("robot", "effect").rows())


@pytest.mark.parametrize("seed", [501, 502, 503])
def test_finds_the_broken_robot_the_worn_one_and_what_is_common(seed):
    summary = of_rows(fleet(seed, broken=(5,), worn=(11,), wear_nm_month=0.06))
    assert ("axis-05", "backlash") in told(summary.unlike)
    assert ("axis-11", "coulomb_friction") in told(summary.drifting)
    [common] = summary.common.rows(named=True)
    assert (common["effect"], common["robots_with"]) == ("coulomb_friction", 24)
    # four times what 24 robots scatter by
    assert abs(common["mean"] - 0.5) < 4 * 0.05 / 24**0.5
    assert 0.02 < common["spread"] < 0.1


def test_false_discoveries_stay_below_the_rate():
    """In fleets of like robots whatever is told is false.

    Where 5 % of 40 fleets have a false one, seven or more have one by a chance of 0.3 %.
    """
    with_a_false_one = 0
    for seed in range(600, 640):
        summary = of_rows(fleet(seed, spurious=(0.04, 0.1, 0.3)[seed % 3]))
        with_a_false_one += bool(told(summary.unlike) | told(summary.drifting))
    assert with_a_false_one < 7


def test_more_of_a_common_effect_is_unlike_too():
    rows = fleet(510)
    more = pl.col("parameters").list.eval(
        pl.struct(
            pl.element().struct.field("name"),
            pl.element().struct.field("value") + 0.5,
            pl.element().struct.field("std"),
            pl.element().struct.field("at_bound"),
        )
    )
    friction = (pl.col("robot") == "axis-09") & (pl.col("effect") == "coulomb_friction")
    summary = of_rows(rows.with_columns(pl.when(friction).then(more).otherwise(pl.col("parameters")).alias("parameters")))
    [row] = summary.unlike.rows(named=True)
    assert (row["robot"], row["why"]) == ("axis-09", "more than others")


def test_a_robot_without_the_common_effect_is_unlike():
    rows = fleet(511)
    lacking = (pl.col("robot") == "axis-03") & (pl.col("effect") == "coulomb_friction")
    none = pl.when(lacking).then(None).otherwise(pl.col("effect")).alias("effect")
    summary = of_rows(rows.with_columns(none))
    [row] = summary.unlike.rows(named=True)
    assert (row["robot"], row["why"]) == ("axis-03", "has it not, others have")


def test_what_a_recording_cannot_tell_apart_says_nothing():
    rows = fleet(512, spurious=0.0)
    # the same, with half of the recordings naming what looks alike
    other = (pl.col("robot") == "axis-02") & (pl.col("recorded_at").dt.ordinal_day() % 2 == 0)
    rows = rows.with_columns(
        pl.when(other).then(pl.lit("torque_constant_error")).otherwise(pl.col("effect")).alias("effect"),
        pl.when(other).then(pl.lit(["coulomb_friction"])).otherwise(pl.col("confusable_with")).alias("confusable_with"),
    )
    friction = of_rows(rows).robots.filter((pl.col("robot") == "axis-02") & (pl.col("effect") == "coulomb_friction"))
    assert friction["named"].item() == friction["of"].item() < 16


def test_copies_of_a_recording_count_once():
    rows = fleet(513, broken=(1,))
    copied = rows.with_columns(("copy/" + pl.col("recording")).alias("recording"))
    once, twice = of_rows(rows), of_rows(pl.concat([rows, copied]))
    assert twice.robots.equals(once.robots) and twice.counts["copies"] == 24 * 16


def test_drift_by_operating_hours():
    summary = of_rows(fleet(514, worn=(4,), wear_nm_month=0.08), over="hours")
    [row] = summary.drifting.rows(named=True)
    # eight hours a day
    assert row["low"] < 0.08 / MONTH_DAYS / 8.0 * 1000.0 < row["high"]


def test_few_robots_are_no_fleet_and_no_error():
    summary = of_rows(fleet(515, robots=2, recordings=1))
    assert summary.unlike.is_empty() and summary.drifts.is_empty() and summary.counts["tests"] == 0
    assert "2 recordings of 2 robots" in str(summary)


def test_the_page_escapes_what_it_is_given(tmp_path):
    summary = of_rows(fleet(516, broken=(5,), robots=8, model="<script>"))
    summary.save(tmp_path / "fleet.html")
    page = (tmp_path / "fleet.html").read_text()
    assert "<script>" not in page and "axis-05" in page and "<svg" in page


@pytest.mark.parametrize(("over", "ends"), [("date", ("2026-03-02", "2026-06-15")), ("hours", ("0 h", "840 h"))])
def test_the_page_shows_every_recording_of_a_drift(over, ends):
    summary = of_rows(fleet(518, worn=(4,), wear_nm_month=0.08), over=over)
    [row] = summary.drifting.rows(named=True)
    own = (pl.col("robot") == "axis-04") & (pl.col("effect") == "coulomb_friction")
    assert summary.values.filter(own)["recording"].n_unique() == 16
    [figure] = [part for part in summary.to_html().split("<figure>") if "axis-04: joint1 Coulomb friction, Nm" in part]
    assert figure.count("<circle") == 16
    assert all(end in figure for end in ends)
    assert row["recordings"] == 16


def test_random_effects_agree_with_statsmodels():
    meta = pytest.importorskip("statsmodels.stats.meta_analysis")
    draw = np.random.default_rng(517)
    std = draw.uniform(0.1, 0.5, 12)
    value = 2.0 + 0.4 * draw.normal(size=12) + std * draw.normal(size=12)
    ours = statistics.random_effects(value, std)
    theirs = meta.combine_effects(value, std**2, method_re="iterated", use_t=True)
    assert ours.spread == pytest.approx(np.sqrt(theirs.tau2), rel=1e-4)
    assert ours.value == pytest.approx(theirs.mean_effect_re, rel=1e-6)
    assert ours.std == pytest.approx(theirs.sd_eff_w_re_hksj, rel=1e-4)


def test_shrunk_values_lie_between_own_and_fleet():
    value, std = np.array([1.0, 2.0, 6.0]), np.array([0.1, 0.1, 5.0])
    fleet_mean = statistics.random_effects(value, std)
    drawn, error = statistics.shrunk(value, std, fleet_mean)
    assert np.all(np.minimum(value, fleet_mean.value) <= drawn) and np.all(drawn <= np.maximum(value, fleet_mean.value))
    # the vague one goes nearly all the way
    assert abs(drawn[2] - fleet_mean.value) < 0.1 * abs(value[2] - fleet_mean.value)
    assert np.all(error <= std)
