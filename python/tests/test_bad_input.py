"""Whatever is handed over, an exception with one line comes back, or a result."""

import numpy as np
import pytest
from conftest import DATA, arrays
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as of_numpy

import flexspline as fx


@pytest.fixture
def good():
    return arrays(seconds=2.0)


def refused(call, *parts):
    """It raises an `InputError` of one line with these parts in it."""
    with pytest.raises(fx.InputError) as caught:
        call()
    line = str(caught.value)
    assert "\n" not in line and line
    for part in parts:
        assert part in line, line
    return line


def made(time, joints):
    return lambda: fx.Recording.from_arrays(time=time, joints=joints)


def with_torque(good, torque):
    time, joints = good
    return time, {**joints, "elbow": {**joints["elbow"], "motor_torque_nm": torque}}


def test_arrays_of_different_length(good):
    refused(made(*with_torque(good, good[1]["elbow"]["motor_torque_nm"][:-1])), "elbow.motor_torque_nm", "499", "500")
    refused(made(good[0][:-1], good[1]), "499", "500")


@pytest.mark.parametrize("dtype", [object, str, bytes, bool, complex, "datetime64[s]"])
def test_what_is_no_number(good, dtype):
    torque = np.arange(500).astype(dtype)
    refused(made(*with_torque(good, torque)), "elbow.motor_torque_nm", "not numbers")


@pytest.mark.parametrize("dtype", ["f4", "f8", ">f8", "i2", "u8", "f2"])
def test_numbers_of_any_kind_are_converted(good, dtype):
    torque = (100 * np.sin(np.arange(500))).astype("i2").clip(0).astype(dtype)
    recording = made(*with_torque(good, torque))()
    assert np.array_equal(recording["elbow"]["motor_torque_nm"], torque.astype(float))


def test_strided_reversed_and_read_only_arrays_are_read_as_they_look(good):
    torque = np.sin(np.arange(1000.0))
    frozen = torque[:500].copy()
    frozen.flags.writeable = False
    for shown in (torque[::2], torque[499::-1], frozen, np.asfortranarray(torque.reshape(500, 2))[:, 1]):
        recording = made(*with_torque(good, shown))()
        assert np.array_equal(recording["elbow"]["motor_torque_nm"], shown)


def test_misaligned_memory_is_read(good):
    raw = np.frombuffer(b"x" + np.arange(500.0).tobytes(), dtype=np.uint8)[1:]
    shown = raw.view(np.float64)
    assert not shown.flags.aligned
    recording = made(*with_torque(good, shown))()
    assert np.array_equal(recording["elbow"]["motor_torque_nm"], np.arange(500.0))


def test_axes(good):
    refused(made(*with_torque(good, np.zeros((500, 1)))), "2 axes")
    refused(made(*with_torque(good, np.float64(3.0))), "0 axes")
    refused(made(*with_torque(good, [[1, 2], [3]])), "elbow.motor_torque_nm")


def test_what_is_infinite_is_refused_and_what_is_missing_is_not(good):
    torque = good[1]["elbow"]["motor_torque_nm"].copy()
    torque[7] = np.inf
    refused(made(*with_torque(good, torque)), "row 8", "elbow.motor_torque_nm", "inf")
    torque[7] = np.nan
    assert np.isnan(made(*with_torque(good, torque))()["elbow"]["motor_torque_nm"][7])


def test_times(good):
    time, joints = good
    backwards = time.copy()
    backwards[9] = backwards[3]
    refused(made(backwards, joints), "row 10")
    missing = time.copy()
    missing[9] = np.nan
    refused(made(missing, joints), "row 10", "time")
    refused(made(np.zeros(500), joints), "sample rate")
    refused(made(["now"] * 500, joints), "time")
    refused(made(np.arange(500).astype("timedelta64[Y]"), joints), "timedelta64[Y]", "seconds")


def test_nothing(good):
    empty = np.array([])
    refused(made(empty, {"elbow": {"motor_torque_nm": empty}}), "0 rows")
    refused(made(good[0], {}), "name the columns")
    refused(made(good[0], {"elbow": {}}), "name the columns")
    refused(lambda: fx.diagnose(DATA / "arm.urdf", []), "no recording")
    refused(lambda: fx.Recording.from_table({}), "name the columns")
    refused(lambda: fx.diagnose(DATA / "arm.urdf", 7), "int")


def test_what_is_not_there(good, robot):
    time, joints = good
    refused(made(time, {"elbow": {"torque": time}}), "`torque` is no signal", "motor_torque_nm")
    recording = made(time, joints)()
    refused(lambda: recording["knee"], "no joint `knee`", "`shoulder`, `elbow`")
    knee = fx.Recording.from_arrays(time=time, joints={"knee": joints["elbow"]})
    refused(lambda: fx.diagnose(robot, knee), "none of its joints", "shoulder, elbow")
    refused(lambda: fx.Robot("no such.urdf"), "no such.urdf")
    refused(lambda: fx.Robot("shd71"), "did you mean the shipped robot `shd17`?")
    refused(lambda: fx.diagnose(robot, "no such.mcap"), "no such.mcap")
    refused(lambda: fx.diagnose(robot, recording, engine="petrol"), "petrol", "closed-loop")
    refused(lambda: fx.diagnose(robot, recording, materiality=1.0), "materiality")
    refused(lambda: fx.diagnose(robot, recording, threads=0), "threads")


def test_the_line_is_that_of_the_command(tmp_path, robot):
    import subprocess
    import sysconfig

    path = tmp_path / "run.csv"
    path.write_text("time_s,elbow.motor_torque_nm\n0,1\n1,2\n0.5,3\n")
    line = refused(lambda: fx.diagnose(robot, path))
    command = sysconfig.get_path("scripts") + "/flexspline"
    arguments = ["gap", "diagnose", "--robot", str(DATA / "arm.urdf"), "--recording", str(path)]
    told = subprocess.run([command, *arguments], capture_output=True, text=True)
    assert told.returncode == 2
    assert told.stderr.strip().splitlines()[-1] == f"flexspline: {line}"


def test_a_report_of_another_robot(report):
    refused(lambda: report.apply("shd17"), "is about robot `arm`")


ANYTHING = st.one_of(
    st.none(),
    st.integers(),
    st.text(max_size=5),
    st.lists(st.floats(), max_size=5),
    of_numpy.arrays(
        dtype=of_numpy.scalar_dtypes(),
        shape=of_numpy.array_shapes(min_dims=0, max_dims=2, min_side=0, max_side=6),
    ),
    of_numpy.arrays(dtype=np.float64, shape=st.integers(0, 6)),
)
SIGNALS = st.sampled_from(["motor_torque_nm", "link_position_rad", "temperature_c", "speed"])


@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(ANYTHING, st.dictionaries(st.text(max_size=3), st.one_of(ANYTHING, st.dictionaries(SIGNALS, ANYTHING, max_size=3)), max_size=3))
def test_any_arrays_give_a_recording_or_one_line(time, joints):
    try:
        recording = fx.Recording.from_arrays(time=time, joints=joints)
    except fx.InputError as error:
        assert "\n" not in str(error)
        return
    assert all(len(values) == len(recording) for values in recording.to_dict().values())


@settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.dictionaries(st.sampled_from(["time_s", "t", "elbow.motor_torque_nm", "q1", "tau_1", "", "a.b"]), ANYTHING, max_size=4))
def test_any_table_gives_a_recording_or_one_line(table):
    try:
        fx.Recording.from_table(table, fx.Robot(DATA / "arm.urdf"))
    except fx.InputError as error:
        assert "\n" not in str(error)


@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_damaged_recordings_are_diagnosed_or_refused(robot, data):
    time, joints = arrays(seconds=2.0)
    for signals in joints.values():
        for values in signals.values():
            first, last = sorted(data.draw(st.tuples(st.integers(0, 499), st.integers(0, 499))))
            values[first:last] = data.draw(st.sampled_from([np.nan, 0.0, 1e300, -1.0]))
    try:
        report = fx.diagnose(robot, fx.Recording.from_arrays(time=time, joints=joints))
        assert len(report.joints) == 2
    except fx.InputError as error:
        assert "\n" not in str(error)
