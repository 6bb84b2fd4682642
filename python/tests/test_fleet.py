"""Recordings of a fleet, diagnosed once each, whatever happens to workers, files and stores."""

import datetime
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import textwrap
import threading
import time

import flexspline as fx
import pytest
from flexspline import fleet
from flexspline.fleet import _engines as engines
from flexspline.fleet import _recordings as sources
from flexspline.fleet._dataset import SCHEMA, Dataset
from flexspline.fleet._diagnosis import _Work

ROBOT = """
name = "pendulum"
gravity_m_s2 = [0.0, 0.0, -9.81]

[[link]]
joint = "joint1"
origin_m = [0.0, 0.0, 0.0]
origin_rpy_rad = [0.0, 0.0, 0.0]
axis = [0.0, 1.0, 0.0]
mass_kg = 1.0
centre_of_mass_m = [0.0, 0.0, -0.3]
inertia_kg_m2 = { xx = 0.01, yy = 0.01, zz = 0.001 }

[[joint]]
name = "joint1"
gear_ratio = 100.0
rotor_inertia_kg_m2 = 1e-5
"""


def write_recording(path, seed, coulomb_nm=1.0):
    """A pendulum that rubs, 12 s at 200 rows a second, with the noise of its sensors."""
    import numpy as np

    draw = np.random.default_rng(seed)
    time_s = np.arange(0.0, 12.0, 0.005)
    position, velocity, acceleration = 0.0, 0.0, 0.0
    for frequency_hz in (0.2, 0.45, 0.7):
        w, phase = 2 * np.pi * frequency_hz, draw.uniform(0, 2 * np.pi)
        position = position + 0.3 * np.sin(w * time_s + phase)
        velocity = velocity + 0.3 * w * np.cos(w * time_s + phase)
        acceleration = acceleration - 0.3 * w * w * np.sin(w * time_s + phase)
    inertia_kg_m2 = 0.01 + 1.0 * 0.3**2 + 1e-5 * 100**2
    torque_nm = inertia_kg_m2 * acceleration + 9.81 * 0.3 * np.sin(position) + coulomb_nm * np.tanh(velocity / 1e-3)
    torque_nm = torque_nm + 0.01 * draw.normal(size=len(time_s))
    path.parent.mkdir(parents=True, exist_ok=True)
    # at the motor, by the gear's ratio
    rows = np.column_stack([time_s, position, torque_nm / 100.0])
    head = "time_s,joint1.link_position_rad,joint1.motor_torque_nm"
    np.savetxt(path, rows, fmt="%.9g", delimiter=",", header=head, comments="")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fleet")
    (folder / "pendulum.toml").write_text(ROBOT)
    for seed, name in enumerate(["a/2026-01-05", "a/2026-01-12", "b/2026-01-05", "b/2026-01-12"]):
        write_recording(folder / "recordings" / f"{name}.csv", 700 + seed)
    return folder


@pytest.fixture
def folder(made, tmp_path):
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path


def diagnose(folder, out="out", **options):
    options = {"workers": 1, **options}
    return fleet.diagnose(f"{folder}/recordings/*/*.csv", folder / "pendulum.toml", out=folder / out, **options)


def table(folder, out="out"):
    return Dataset(folder / out).read()


def test_each_recording_is_one_file_with_a_row_for_each_effect(folder):
    told = []
    done = diagnose(folder, progress=lambda *step: told.append(step))
    assert (done.diagnosed, done.already, done.set_aside) == (4, 0, [])
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert len(list((folder / "out").rglob("*.parquet"))) == 4
    rows = table(folder)
    assert rows.schema.names == [*SCHEMA.names, "robot"]
    friction = [row for row in rows.to_pylist() if row["effect"] == "coulomb_friction"]
    assert sorted(row["robot"] for row in friction) == ["a", "a", "b", "b"]
    for row in friction:
        [coulomb] = row["parameters"]
        assert coulomb["name"] == "coulomb_nm" and coulomb["value"] == pytest.approx(1.0, abs=0.05)
        assert row["recorded_at"].date() in (datetime.date(2026, 1, 5), datetime.date(2026, 1, 12))
        assert row["model"] == "pendulum" and row["processor_seconds"] > 0


def test_rows_are_those_of_the_report(folder):
    recording = folder / "recordings" / "a" / "2026-01-05.csv"
    fleet.diagnose(recording, folder / "pendulum.toml", out=folder / "out", workers=1)
    [joint] = fx.diagnose(folder / "pendulum.toml", recording, threads=1).to_dict()["joints"]
    named = {effect["effect"]: effect for effect in joint["effects"] + joint["minor_effects"]}
    rows = table(folder).to_pylist()
    assert {row["effect"] for row in rows} == set(named)
    for row in rows:
        assert row["share"] == named[row["effect"]]["share"] and row["verdict"] == joint["verdict"]
        assert {one["name"]: one["value"] for one in row["parameters"]} == {
            name: one["value"] for name, one in named[row["effect"]]["parameters"].items()
        }


def test_goes_on_where_it_was_stopped_and_repeats_nothing(folder):
    first = fleet.diagnose(f"{folder}/recordings/a/*.csv", folder / "pendulum.toml", out=folder / "out", workers=1)
    written = {path: path.stat().st_mtime_ns for path in (folder / "out").rglob("*.parquet")}
    done = diagnose(folder)
    assert (first.diagnosed, done.diagnosed, done.already) == (2, 2, 2)
    assert all(path.stat().st_mtime_ns == when for path, when in written.items())
    assert diagnose(folder).diagnosed == 0


def test_what_changed_is_made_anew_and_counts_once(folder):
    diagnose(folder)
    write_recording(folder / "recordings" / "a" / "2026-01-05.csv", 710, coulomb_nm=2.0)
    assert diagnose(folder).diagnosed == 1
    assert len(list((folder / "out").rglob("*.parquet"))) == 4
    values = [row["parameters"][0]["value"] for row in table(folder).to_pylist() if row["effect"] == "coulomb_friction"]
    assert sorted(round(value) for value in values) == [1, 1, 1, 2]
    # another robot file concerns all
    (folder / "pendulum.toml").write_text(ROBOT.replace("mass_kg = 1.0", "mass_kg = 1.001"))
    assert diagnose(folder).diagnosed == 4
    assert len(list((folder / "out").rglob("*.parquet"))) == 4


def test_poisoned_files_are_set_aside_with_their_reason(folder):
    recordings = folder / "recordings"
    (recordings / "a" / "2026-01-05.csv").write_text("this is no recording\n")
    (recordings / "b" / "2026-01-12.csv").write_bytes(os.urandom(4000))
    done = diagnose(folder)
    assert done.diagnosed == 2 and sorted(aside.kind for aside in done.set_aside) == ["bad_input", "bad_input"]
    assert all(aside.reason and "\n" not in aside.reason for aside in done.set_aside)
    reasons = Dataset(folder / "out").read_set_aside()
    assert [entry["robot"] for entry in reasons] == ["a", "b"]
    # known as bad: not tried again, until it is another file
    again = diagnose(folder)
    assert (again.diagnosed, again.already, again.set_aside) == (0, 4, [])
    write_recording(recordings / "a" / "2026-01-05.csv", 711)
    assert diagnose(folder).diagnosed == 1
    assert len(fleet.summary(folder / "out").set_aside) == 1


def test_what_cannot_be_read_is_tried_again(folder):
    recording = folder / "recordings" / "a" / "2026-01-05.csv"
    [job] = sources.jobs(recording, folder / "pendulum.toml", fx.__version__)
    kept = recording.read_bytes()
    # it vanishes between the listing and the worker
    recording.unlink()
    assert _Work(str(folder / "out"))(job).kind == "not_read"
    assert [entry["kind"] for entry in Dataset(folder / "out").read_set_aside()] == ["not_read"]
    recording.write_bytes(kept)
    assert diagnose(folder).diagnosed == 4
    assert Dataset(folder / "out").read_set_aside() == []


SCRIPT = """
    import sys
    from flexspline import fleet
    folder, engine = sys.argv[1:]
    if __name__ == "__main__":
        done = fleet.diagnose(
            f"{folder}/recordings/*/*.csv", f"{folder}/pendulum.toml", engine, out=f"{folder}/out", workers=2,
            progress=lambda *step: print(*step, flush=True),
        )
        print(done, flush=True)
"""


def worker_pids(parent):
    psutil = pytest.importorskip("psutil")
    children = psutil.Process(parent).children(recursive=True)
    return [
        child.pid
        for child in children
        if any(sign in " ".join(child.cmdline()) for sign in ("popen_loky", "ray::_called", "spawn_main"))
    ]


@pytest.mark.parametrize("engine", ["local", "ray", "dask"])
def test_killed_workers_lose_nothing_and_count_nothing_twice(folder, engine):
    pytest.importorskip({"local": "loky", "ray": "ray", "dask": "distributed"}[engine])
    for seed in range(8):
        write_recording(folder / "recordings" / "c" / f"2026-02-{seed + 1:02d}.csv", 720 + seed)
    script = folder / "script.py"
    script.write_text(textwrap.dedent(SCRIPT))
    run = subprocess.Popen(
        [sys.executable, script, folder, engine],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "RAY_worker_niceness": "0"},
    )
    try:
        assert run.stdout.readline().split() == ["1", "12"], run.communicate(timeout=100)[1]
        victims = worker_pids(run.pid)
        os.kill(victims[0], signal.SIGKILL)
        out, errors = run.communicate(timeout=100)
    finally:
        run.kill()
    assert victims and run.returncode == 0, errors
    assert "diagnosed=12, already=0, set_aside=[]" in out
    rows = table(folder).to_pylist()
    assert len({row["recording"] for row in rows}) == 12 == len(list((folder / "out").rglob("*.parquet")))
    friction = [row["recording"] for row in rows if row["effect"] == "coulomb_friction"]
    assert len(friction) == len(set(friction)) == 12


def test_a_driver_killed_in_the_midst_goes_on(folder):
    script = folder / "script.py"
    script.write_text(textwrap.dedent(SCRIPT))
    command = [sys.executable, script, folder, "local"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "RAY_worker_niceness": "0"}
    run = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert run.stdout.readline().split() == ["1", "4"]
    run.kill()
    run.communicate()
    # a worker may still finish what it is at: then it is there, and is not made again
    out = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=100).stdout
    assert out.splitlines()[-1].startswith("Done(") and "set_aside=[]" in out
    assert len(list((folder / "out").rglob("*.parquet"))) == 4


def test_a_recording_that_kills_its_worker_is_set_aside_and_takes_no_other_along():
    pytest.importorskip("loky")
    engine = engines.Local(deadly, 2)
    try:
        results = dict(engines.run(engine, range(8)))
    finally:
        engine.close()
    crashed = {job for job, result in results.items() if isinstance(result, engines.Crashed)}
    assert crashed == {5} and all(results[job] == job * job for job in results if job != 5)


def deadly(job):
    if job == 5:
        os.kill(os.getpid(), signal.SIGKILL)
    return job * job


def test_half_written_files_are_no_results(folder):
    diagnose(folder)
    path = next((folder / "out").rglob("*.parquet"))
    (path.parent / f".{path.name}.host-1").write_bytes(b"PAR1 half")
    old = path.parent / f".{path.name}.host-2"
    old.write_bytes(b"PAR1 half")
    os.utime(old, (time.time() - 7200, time.time() - 7200))
    assert len({row["recording"] for row in table(folder).to_pylist()}) == 4
    assert diagnose(folder).already == 4
    assert not old.exists()


def test_recordings_inside_an_archive(folder):
    shutil.make_archive(str(folder / "all"), "zip", folder / "recordings")
    done = fleet.diagnose(
        [f"zip://{name}::{folder}/all.zip" for name in ("a/2026-01-05.csv", "b/2026-01-12.csv")],
        folder / "pendulum.toml",
        out=folder / "out",
        workers=1,
    )
    assert done.diagnosed == 2 and done.set_aside == []
    assert {row["robot"] for row in table(folder).to_pylist()} == {"a", "b"}


def test_an_object_store_end_to_end(folder, monkeypatch):
    server = pytest.importorskip("moto.server")
    s3fs = pytest.importorskip("s3fs")
    store = server.ThreadedMotoServer(port=0)
    store.start()
    host, port = store.get_host_and_port()
    for name, value in {"AWS_ACCESS_KEY_ID": "x", "AWS_SECRET_ACCESS_KEY": "x", "AWS_DEFAULT_REGION": "us-east-1"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
    monkeypatch.setenv("FSSPEC_S3_ENDPOINT_URL", f"http://{host}:{port}")
    try:
        fs = s3fs.S3FileSystem(endpoint_url=f"http://{host}:{port}", skip_instance_cache=True)
        fs.mkdir("fleet")
        fs.put(f"{folder}/recordings", "fleet/recordings", recursive=True)
        fs.put(f"{folder}/pendulum.toml", "fleet/pendulum.toml")
        call = ("s3://fleet/recordings/*/*.csv", "s3://fleet/pendulum.toml")
        done = fleet.diagnose(*call, out="s3://fleet/out", workers=1)
        assert (done.diagnosed, done.set_aside) == (4, [])
        assert fleet.diagnose(*call, out="s3://fleet/out", workers=1).already == 4
        assert fleet.summary("s3://fleet/out").counts["recordings"] == 4
    finally:
        store.stop()


def test_a_table_tells_robots_dates_and_hours(folder):
    address = str(folder / "recordings" / "a" / "2026-01-05.csv")
    row = {"recording": address, "robot": "press 7/left", "recorded_at": "2025-12-24T10:00:00Z", "operating_hours": 812.5}
    fleet.diagnose([row], {"press*": folder / "pendulum.toml"}, out=folder / "out", workers=1)
    first = table(folder).to_pylist()[0]
    assert first["robot"] == "press 7/left" and first["operating_hours"] == 812.5
    assert first["recorded_at"] == datetime.datetime(2025, 12, 24, 10, tzinfo=datetime.timezone.utc)
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame([row, {"recording": str(folder / "recordings" / "b" / "2026-01-05.csv"), "robot": "press 8"}])
    frame["recorded_at"] = pandas.to_datetime(frame["recorded_at"])
    assert fleet.diagnose(frame, {"press*": folder / "pendulum.toml"}, out=folder / "out", workers=1).already == 1


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("x/run-2026-01-05.mcap", (2026, 1, 5)),
        ("x/20260105T123000.mcap", (2026, 1, 5, 12, 30)),
        ("x/arm_2026-01-05_12-30-15.csv", (2026, 1, 5, 12, 30, 15)),
        ("x/2026-13-45.mcap", None),
        ("x/serial-1234567890123.mcap", None),
        ("2026-01-05/run.mcap", None),
    ],
)
def test_dates_in_names(name, expected):
    found = sources._instant(None, name)
    assert found == (expected and datetime.datetime(*expected, tzinfo=datetime.timezone.utc))


@pytest.mark.parametrize(
    ("recordings", "robots", "options", "line"),
    [
        ("nothing/*.csv", "pendulum.toml", {}, "no recording matches"),
        ("nothing.csv", "pendulum.toml", {}, "no such recording"),
        ([], "pendulum.toml", {}, "none given"),
        ([{"path": "x"}], "pendulum.toml", {}, "it needs `recording`"),
        ("recordings/*/*.csv", {"c": "pendulum.toml"}, {}, "has no robot file"),
        ("recordings/*/*.csv", {}, {}, "robots: empty"),
        ("recordings/*/*.csv", "missing.toml", {}, "missing.toml"),
        ("recordings/*/*.csv", "pendulum.toml", {"engine": "spark"}, "none of local, ray, dask"),
        ("recordings/*/*.csv", "pendulum.toml", {"workers": 0}, "at least 1"),
    ],
)
def test_bad_input_is_one_line_before_anything_is_done(folder, monkeypatch, recordings, robots, options, line):
    monkeypatch.chdir(folder)
    with pytest.raises((ValueError, FileNotFoundError), match=line) as raised:
        fleet.diagnose(recordings, robots, out="out", **options)
    assert "\n" not in str(raised.value)
    assert not list((folder / "out").rglob("*.parquet")) and not list((folder / "out").rglob("*.json"))


def test_a_summary_of_nothing_is_one_line(tmp_path):
    with pytest.raises(ValueError, match="run fleet.diagnose first"):
        fleet.summary(tmp_path)


def test_set_aside_files_are_plain_json(folder):
    (folder / "recordings" / "a" / "2026-01-05.csv").write_text("x")
    diagnose(folder)
    [path] = (folder / "out" / "set_aside" / "bad_input").glob("*.json")
    assert set(json.loads(path.read_text())) == {"recording", "robot", "kind", "reason", "at"}
    assert pathlib.Path(json.loads(path.read_text())["recording"]).name == "2026-01-05.csv"


def test_two_calls_at_once_write_the_same_files(folder):
    calls = [threading.Thread(target=diagnose, args=(folder,)) for _ in range(2)]
    for call in calls:
        call.start()
    for call in calls:
        call.join()
    assert len(list((folder / "out").rglob("*.parquet"))) == 4
    assert len({row["recording"] for row in table(folder).to_pylist()}) == 4
