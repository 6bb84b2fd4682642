"""Writes one log with the libraries that own the formats, and what must come out of each file.

Usage: python3 write_as_owners.py FOLDER

manifest.json names the files; values are the bits of doubles, as hexadecimal numbers, so that nothing is rounded on the way.
"""

import json
import sys
from pathlib import Path

import h5py
import numpy
import pandas
import pyarrow
import pyarrow.parquet
import rosbags.rosbag1
import rosbags.rosbag2
import scipy.io
from rosbags.typesys import Stores, get_typestore

FOLDER = Path(sys.argv[1])
JOINTS = ["shoulder", "elbow", "wrist"]
ROWS = 500
START_NS = 1_700_000_000_123_456_789

generator = numpy.random.default_rng(5)
clock_ns = numpy.arange(ROWS) * 2_000_000 + generator.integers(0, 90_000, ROWS)
clock_ns[0] = 0
time_s = clock_ns * 1e-9
values = {name: generator.normal(size=(ROWS, len(JOINTS))) * scale for name, scale in [("q", 1.0), ("dq", 7.0), ("tau", 1e-3)]}
values["tau"][100:110, 1] = numpy.nan
SIGNALS = {"q": "link_position_rad", "dq": "link_velocity_rad_s", "tau": "joint_torque_nm"}
manifest = []


def bits(column):
    return [format(number, "016x") for number in numpy.ascontiguousarray(column, "f8").view("u8")]


def wrote(writer, kind, path, arrays=values, signals=SIGNALS, clock=time_s):
    """Notes what the file at that path holds; a clock of whole numbers is of nanoseconds since 1970."""
    columns = {
        f"{joint}.{signals[name]}": bits(array[:, index]) for name, array in arrays.items() for index, joint in enumerate(JOINTS)
    }
    times = {"nanoseconds": clock.tolist()} if clock.dtype.kind == "i" else {"seconds": bits(clock)}
    manifest.append({"writer": writer, "kind": kind, "file": path.name, "columns": columns, **times})


def beside(path):
    """The names of the joints, which arrays have none of."""
    path.with_name(path.stem + ".mapping.toml").write_text(f"joints = {JOINTS}\n")


def bag(kind, path, writer, store, **header):
    types = store.types
    with writer:
        states = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
        pictures = writer.add_connection("/camera", "sensor_msgs/msg/Image", typestore=store)
        serialize = store.serialize_ros1 if "rosbag1" in type(writer).__module__ else store.serialize_cdr
        for row in range(ROWS):
            seconds, nanoseconds = divmod(START_NS + int(clock_ns[row]), 1_000_000_000)
            stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
            head = types["std_msgs/msg/Header"](stamp=stamp, frame_id="base", **header)
            # In another order than the joints, and another in the second half.
            order = [2, 0, 1]
            state = types["sensor_msgs/msg/JointState"](
                header=head, name=[JOINTS[index] for index in order], position=values["q"][row, order],
                velocity=values["dq"][row, order], effort=values["tau"][row, order],
            )
            received_ns = START_NS + int(clock_ns[row]) + 5_000_000
            writer.write(states, received_ns, serialize(state, "sensor_msgs/msg/JointState"))
            if row % 50 == 0:
                picture = types["sensor_msgs/msg/Image"](
                    header=head, height=10, width=10, encoding="mono8", is_bigendian=0, step=10, data=numpy.zeros(100, "u1")
                )
                writer.write(pictures, received_ns, serialize(picture, "sensor_msgs/msg/Image"))
    wrote("rosbags", kind, path, clock=START_NS + clock_ns)


def bags():
    store = get_typestore(Stores.ROS2_HUMBLE)
    for storage in rosbags.rosbag2.StoragePlugin:
        for mode in [None, rosbags.rosbag2.CompressionMode.FILE, rosbags.rosbag2.CompressionMode.MESSAGE]:
            packed = "" if mode is None else f", zstd by {mode.name.lower()}"
            # Chunks of MCAP are packed by themselves.
            if storage.name == "MCAP" and mode is not None and mode.name == "MESSAGE":
                continue
            path = FOLDER / f"bag_{storage.name.lower()}_{mode.name.lower() if mode else 'plain'}"
            writer = rosbags.rosbag2.Writer(path, version=9, storage_plugin=storage)
            if mode is not None:
                writer.set_compression(mode, rosbags.rosbag2.CompressionFormat.ZSTD)
            bag(f"rosbag2, {storage.name}{packed}", path, writer, store)
    store = get_typestore(Stores.ROS1_NOETIC)
    for packing in [None, *rosbags.rosbag1.Writer.CompressionFormat]:
        name = packing.name.lower() if packing else "none"
        path = FOLDER / f"one_{name}.bag"
        writer = rosbags.rosbag1.Writer(path)
        if packing is not None:
            writer.set_compression(packing)
        bag(f"ROS 1 bag, chunks {name}", path, writer, store, seq=0)


def arrays():
    for name, save in [("plain", numpy.savez), ("compressed", numpy.savez_compressed)]:
        path = FOLDER / f"arrays_{name}.npz"
        save(path, t=time_s, **{**values, "dq": numpy.asfortranarray(values["dq"])}, gains=numpy.ones(7))
        beside(path)
        wrote("numpy", f"`{save.__name__}`", path)
    for packed in [False, True]:
        for struct in [False, True]:
            path = FOLDER / f"v5_{packed}_{struct}.mat"
            held = {"t": time_s[:, None], **values, "robot": "arm", "gains": numpy.ones(7)}
            scipy.io.savemat(path, {"log": held} if struct else held, do_compression=packed)
            beside(path)
            kind = f"`savemat`{', packed' if packed else ''}{', one struct' if struct else ''}"
            wrote("scipy.io", kind, path)
    turned = FOLDER / "turned.mat"
    scipy.io.savemat(turned, {"t": time_s, **{name: array.T for name, array in values.items()}})
    beside(turned)
    wrote("scipy.io", "`savemat`, a row for each joint", turned)
    single = {name: array.astype("f4") for name, array in values.items()}
    ways = {
        "contiguous": {},
        "gzip, shuffled": {"compression": "gzip", "shuffle": True},
        "with checksums, may grow": {"fletcher32": True, "chunks": (64, 2), "maxshape": (None, 3)},
    }
    for version in ["earliest", "latest"]:
        for index, (way, options) in enumerate(ways.items()):
            path = FOLDER / f"{version}_{index}.h5"
            with h5py.File(path, "w", libver=version) as file:
                file["t"] = time_s
                for name, array in single.items():
                    file.create_dataset(f"observations/{name}", data=array, **options)
                file["images"] = numpy.zeros((3, 4, 4), "u1")
            beside(path)
            wrote("h5py", f"float32 in a group, {way}, format {version}", path, arrays=single)


def tables():
    frame = pandas.DataFrame({
        f"{joint}.{SIGNALS[name]}": array[:, index] for name, array in values.items() for index, joint in enumerate(JOINTS)
    })
    frame.insert(0, "time_s", time_s)
    for name, options in [
        ("comma", {}),
        ("semicolon, decimal comma", {"sep": ";", "decimal": ","}),
        ("tab", {"sep": "\t"}),
        ("space, quoted names", {"sep": " ", "na_rep": "nan", "quoting": 2}),
    ]:
        path = FOLDER / f"{name.split(',')[0]}.csv"
        frame.to_csv(path, index=False, **options)
        wrote("pandas", f"`to_csv`, {name}", path)
    for packing in [None, "snappy", "zstd", "gzip", "lz4"]:
        path = FOLDER / f"table_{packing}.parquet"
        frame.to_parquet(path, index=False, compression=packing)
        wrote("pandas", f"`to_parquet`, {packing or 'plain'}", path)
    stamped = frame.drop(columns="time_s")
    stamped.insert(0, "timestamp", pandas.to_datetime(START_NS + clock_ns, unit="ns"))
    path = FOLDER / "stamped.parquet"
    stamped.to_parquet(path, index=False)
    wrote("pandas", "`to_parquet`, time stamps of nanoseconds", path, clock=START_NS + clock_ns)
    path = FOLDER / "dates.csv"
    stamped.to_csv(path, index=False)
    wrote("pandas", "`to_csv`, dates", path, clock=START_NS + clock_ns)


def datasets():
    """As LeRobot lays its datasets out, versions 2.1 and 3.0: lists of float32 and a float32 time."""
    states = {"q": values["q"].astype("f4"), "action": values["dq"].astype("f4")}
    signals = {"q": "link_position_rad", "action": "reference_position_rad"}
    half = ROWS // 2
    times = numpy.tile(numpy.arange(half, dtype="f4") / numpy.float32(50), 2)

    def write(path, rows):
        path.parent.mkdir(parents=True, exist_ok=True)
        of = {"observation.state": "q", "action": "action"}
        columns = {
            name: pyarrow.FixedSizeListArray.from_arrays(pyarrow.array(states[array][rows].ravel()), len(JOINTS))
            for name, array in of.items()
        }
        columns["timestamp"] = pyarrow.array(times[rows])
        columns["episode_index"] = pyarrow.array(numpy.arange(ROWS)[rows] // half)
        pyarrow.parquet.write_table(pyarrow.table(columns), path)

    for version in ["v2.1", "v3.0"]:
        folder = FOLDER / f"dataset_{version}"
        if version == "v3.0":
            write(folder / "data/chunk-000/file-000.parquet", slice(0, ROWS))
        else:
            for episode in range(2):
                write(folder / f"data/chunk-000/episode_00000{episode}.parquet", slice(half * episode, half * (episode + 1)))
        names = [f"{joint}.pos" for joint in JOINTS]
        # Some converters put the list into another.
        names = [names] if version == "v2.1" else names
        info = {"codebase_version": version, "fps": 50, "features": {
            "observation.state": {"dtype": "float32", "shape": [3], "names": names},
            "action": {"dtype": "float32", "shape": [3], "names": names},
        }}
        (folder / "meta").mkdir()
        (folder / "meta/info.json").write_text(json.dumps(info))
        kind = f"LeRobot's layout {version}, two episodes"
        # Times are the short decimals that they were before they were rounded to 24 bits.
        clock = numpy.array([float(str(time)) for time in times])
        wrote("pyarrow", kind, folder, arrays=states, signals=signals, clock=clock)


bags()
arrays()
tables()
datasets()
(FOLDER / "manifest.json").write_text(json.dumps(manifest))
