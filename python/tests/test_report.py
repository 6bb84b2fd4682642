"""A known friction is found, and every way of handing over the same recording gives the same report."""

import json
import pickle

import numpy as np
import pytest
from conftest import COULOMB_NM, DATA, VISCOUS_NM_S_RAD, arrays

import flexspline as fx


def same(one, other):
    """Equal but for the time it took and what recordings are called."""
    one, other = ({k: v for k, v in r.to_dict().items() if k not in ("compute_seconds", "recordings")} for r in (one, other))
    return one == other


def test_friction_is_named_with_its_size(report):
    for joint in report.joints:
        named = {effect.name: effect for effect in joint.effects}
        assert {"coulomb_friction", "viscous_friction"} <= set(named), report
        coulomb = named["coulomb_friction"].parameters["coulomb_nm"]
        viscous = named["viscous_friction"].parameters["viscous_nm_s_rad"]
        assert coulomb == pytest.approx(COULOMB_NM[joint.name], rel=0.05)
        assert viscous == pytest.approx(VISCOUS_NM_S_RAD[joint.name], rel=0.1)
        assert 0 < coulomb.std < 0.1 * coulomb
        assert joint.gap_after_nm < 0.2 * joint.gap_nm
    assert "friction" in report.headline


def test_no_friction_is_no_gap(robot):
    time, joints = arrays(friction=False)
    report = fx.diagnose(robot, fx.Recording.from_arrays(time=time, joints=joints))
    assert [joint.verdict for joint in report.joints] == ["no_gap", "no_gap"]
    assert report.effects == []


def test_every_kind_of_table_is_the_same_recording(robot, recording, report, tmp_path):
    columns = recording.to_dict()
    tables = [columns, {name: list(values) for name, values in columns.items()}]
    pandas = pytest.importorskip("pandas")
    polars = pytest.importorskip("polars")
    arrow = pytest.importorskip("pyarrow")
    tables += [pandas.DataFrame(columns), polars.DataFrame(columns), arrow.table(columns)]
    for table in tables:
        assert same(fx.diagnose(robot, table), report), type(table)
    for end in ("mcap", "parquet", "csv"):
        path = tmp_path / f"run.{end}"
        recording.save(path)
        loaded = fx.Recording.load(path)
        assert np.array_equal(loaded["elbow"]["motor_torque_nm"], recording["elbow"]["motor_torque_nm"])
        assert same(fx.diagnose(robot, path), fx.diagnose(robot, loaded))
    assert same(fx.diagnose(DATA / "arm.urdf", [columns]), report)


def test_missing_values_of_frames_are_missing(recording):
    pandas = pytest.importorskip("pandas")
    arrow = pytest.importorskip("pyarrow")
    columns = recording.to_dict()
    torque = columns["elbow.motor_torque_nm"].copy()
    torque[10:20] = np.nan
    nullable = pandas.Series(np.where(np.isnan(torque), 0.0, torque), dtype="Float64")
    nullable[10:20] = pandas.NA
    for values in (torque, nullable, arrow.array(torque, from_pandas=True), np.ma.masked_invalid(torque)):
        table = {**columns, "elbow.motor_torque_nm": values}
        found = fx.Recording.from_table(table)["elbow"]["motor_torque_nm"]
        assert np.array_equal(found, torque, equal_nan=True), type(values)


def test_dates_are_times(recording):
    dates = np.datetime64("2026-01-01T12:00:00", "ns") + (recording.time_s * 1e9).astype("timedelta64[ns]")
    joints = {joint: recording[joint] for joint in recording.joints}
    dated = fx.Recording.from_arrays(time=dates, joints=joints)
    assert np.allclose(dated.time_s, recording.time_s, atol=1e-8)


def test_what_is_read_cannot_be_written_and_outlives_its_recording():
    time, joints = arrays(seconds=2.0)
    recording = fx.Recording.from_arrays(time=time, joints=joints)
    view = recording["elbow"]["motor_torque_nm"]
    again = recording["elbow"]["motor_torque_nm"]
    assert np.shares_memory(view, again)
    with pytest.raises(ValueError):
        view[0] = 1.0
    kept = view.copy()
    del recording, again
    assert np.array_equal(view, kept)


def test_what_was_handed_over_may_change_afterwards():
    time, joints = arrays(seconds=2.0)
    recording = fx.Recording.from_arrays(time=time, joints=joints)
    before = recording["elbow"]["motor_torque_nm"].copy()
    joints["elbow"]["motor_torque_nm"][:] = 0.0
    assert np.array_equal(recording["elbow"]["motor_torque_nm"], before)


def test_little_of_the_gap_is_left_at_the_mended_robot(robot, recording, report):
    mended = report.apply()
    assert any("coulomb_friction" in line for line in mended.changes)
    assert robot.changes == []
    again = fx.diagnose(mended, recording)
    for before, after in zip(report.joints, again.joints):
        assert after.gap_nm < 0.05 * before.gap_nm, again
    assert report.apply(robot).to_toml() == mended.to_toml()


def test_formats_say_the_friction(report, tmp_path):
    mended = report.apply()
    mjcf = mended.to_mjcf(tmp_path / "arm.xml")
    assert "frictionloss" in mjcf and "damping" in mjcf
    assert (tmp_path / "arm.xml").read_text() == mjcf
    assert 'friction="' in mended.to_urdf()
    mended.save(tmp_path / "arm.toml")
    assert fx.Robot(tmp_path / "arm.toml").joints == mended.joints
    read_again = fx.Robot(tmp_path / "arm.xml")
    assert read_again.joints == mended.joints


def test_tables_and_files_say_the_same(report, tmp_path):
    pandas = pytest.importorskip("pandas")
    frame = report.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    row = frame[(frame.joint == "elbow") & (frame.parameter == "coulomb_nm")].iloc[0]
    assert row.value == report.joint("elbow").effects[0].parameters["coulomb_nm"] or row.share > 0
    report.save(tmp_path / "report.json")
    assert json.loads((tmp_path / "report.json").read_text()) == report.to_dict()
    report.save(tmp_path / "report.html")
    assert "<!DOCTYPE html>" in (tmp_path / "report.html").read_text()
    for path in ("report.pdf", "report"):
        with pytest.raises(fx.InputError, match=r"name it \.html or \.json"):
            report.save(tmp_path / path)


def test_a_notebook_shows_headline_robot_shares_and_rest(report):
    shown = report._repr_html_()
    for part in ("Which effect", "The robot", "What remains", "shoulder", "elbow"):
        assert part in shown
    assert report.headline in repr(report)


def test_the_plot_has_a_row_a_joint(report):
    pytest.importorskip("matplotlib")
    assert len(report.plot().axes) == 4
    assert len(report.plot("elbow").axes) == 2
    with pytest.raises(fx.InputError, match="no joint `knee`; its joints are shoulder, elbow"):
        report.plot("knee")


def test_progress_counts_joints(robot, recording):
    told = []
    fx.diagnose(robot, recording, progress=lambda done, of: told.append((done, of)))
    assert told and all(of == 2 for _, of in told)
    assert max(done for done, _ in told) == 2

    def refuse(done, of):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        fx.diagnose(robot, recording, progress=refuse)


def test_robots_and_recordings_are_pickled(robot, recording, report):
    copies = [pickle.loads(pickle.dumps(one)) for one in (robot, recording, report.apply())]
    assert copies[0].to_toml() == robot.to_toml()
    assert np.array_equal(copies[1].time_s, recording.time_s)
    assert copies[2].to_toml() == report.apply().to_toml()
    assert same(fx.diagnose(copies[0], copies[1]), report)


def test_threads_change_nothing(robot, recording, report):
    assert same(fx.diagnose(robot, recording, threads=1), report)
