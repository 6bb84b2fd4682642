"""The results: one Parquet file a recording, one row a joint and effect.

    OUT/effects/robot=NAME/KEY.parquet      rows of one recording
    OUT/set_aside/KIND/KEY.json             a recording that could not be diagnosed, and why

A key is `ADDRESS-VERSION`: a digest of where the recording is, and one of all that its result depends on. So a listing
tells what is done, no two results of a recording can both count, and no file is ever changed: a worker that is killed
leaves a whole file or none.
"""

from __future__ import annotations

import io
import json
import os
import socket
import time
from typing import Any
from urllib.parse import quote

import fsspec
import pyarrow as pa
import pyarrow.parquet
from fsspec.implementations.local import LocalFileSystem

#: Counts up when columns change their meaning; results of another version are made anew.
VERSION = 1

SCHEMA = pa.schema(
    [
        ("recording", pa.string()),  # address
        ("content", pa.string()),  # digest of its bytes: two addresses of the same recording count once
        ("model", pa.string()),  # name in the robot file
        ("robot_file", pa.string()),  # address
        ("recorded_at", pa.timestamp("us", "UTC")),
        ("operating_hours", pa.float64()),
        ("seconds", pa.float64()),  # length of the recording
        ("sample_rate_hz", pa.float64()),
        ("joint", pa.string()),
        ("verdict", pa.string()),
        ("torque_rms_before_nm", pa.float64()),
        ("torque_rms_after_nm", pa.float64()),
        ("torque_rms_noise_floor_nm", pa.float64()),
        ("shrink", pa.float64()),
        ("remaining_share", pa.float64()),
        ("effect", pa.string()),  # none where the joint has no named effect
        ("minor", pa.bool_()),  # below the materiality
        ("shared", pa.bool_()),  # one cause that several joints see: a row for each of them
        ("probability", pa.float64()),
        ("share", pa.float64()),  # of the joint's gap
        ("share_low", pa.float64()),
        ("share_high", pa.float64()),
        (
            "parameters",
            pa.list_(
                pa.struct(
                    [
                        ("name", pa.string()),
                        ("value", pa.float64()),
                        ("std", pa.float64()),
                        ("at_bound", pa.bool_()),
                    ]
                )
            ),
        ),
        ("confusable_with", pa.list_(pa.string())),  # other names this recording cannot tell from the joint's
        ("processor_seconds", pa.float64()),  # of the diagnosis
        ("product_version", pa.string()),
        ("schema_version", pa.int32()),
    ]
)

#: Why a recording was set aside. Only the first is not tried again at the next start.
KINDS = ("bad_input", "not_read", "crash")

#: No result takes this long to write: a file half written for longer belongs to a worker that is gone.
ABANDONED_S = 3600.0


class Dataset:
    """A folder of results, anywhere that fsspec reaches."""

    def __init__(self, out: str | os.PathLike[str]):
        self.url = os.fspath(out)
        self.fs, self.root = fsspec.core.url_to_fs(self.url)

    def results(self) -> dict[str, dict[str, str]]:
        """Paths of results by the recording's digest and key; one listing, nothing is opened."""
        return self._by_key("effects", ".parquet")

    def set_aside(self) -> dict[str, dict[str, str]]:
        """Paths of recordings that were set aside, likewise."""
        return self._by_key("set_aside", ".json")

    def read_set_aside(self) -> list[dict[str, Any]]:
        """What was set aside and why, by recording."""
        found = [json.loads(self.fs.cat_file(path)) for keys in self.set_aside().values() for path in keys.values()]
        return sorted(found, key=lambda entry: entry["recording"])

    def read(self) -> pa.Table:
        """All rows, with the column `robot` of the folders' names."""
        # a worker reads nothing, and need not import it
        from pyarrow import dataset

        folder = f"{self.root}/effects"
        # what another process has written since is not in the cache of an object store
        self.fs.invalidate_cache()
        if not self.results():
            raise ValueError(f"{self.url}: no results, neither diagnosed nor in {folder}; run fleet.diagnose first")

        partitioning = dataset.partitioning(pa.schema([("robot", pa.string())]), flavor="hive")
        return dataset.dataset(
            folder,
            filesystem=self.fs,
            format="parquet",
            schema=pa.schema([*SCHEMA, ("robot", pa.string())]),
            partitioning=partitioning,
        ).to_table()

    def write(self, robot: str, key: str, rows: list[dict[str, Any]]) -> None:
        """Writes the rows of one recording, whole or not at all."""
        buffer = io.BytesIO()
        pa.parquet.write_table(pa.Table.from_pylist(rows, schema=SCHEMA), buffer, compression="zstd")
        self._put(f"{self.root}/effects/robot={quote(robot, safe='')}", f"{key}.parquet", buffer.getvalue())

    def write_set_aside(self, kind: str, key: str, what: dict[str, Any]) -> None:
        """Writes down that a recording was set aside."""
        self._put(f"{self.root}/set_aside/{kind}", f"{key}.json", json.dumps(what, indent=1).encode())

    def remove(self, paths: list[str]) -> None:
        """Removes files; one that is gone already is no error."""
        for path in paths:
            try:
                self.fs.rm_file(path)
            except FileNotFoundError:
                pass

    def tidy(self) -> None:
        """Removes what killed workers have left half written. Object stores show no such files."""
        if isinstance(self.fs, LocalFileSystem):
            for path, info in self.fs.find(self.root, detail=True).items():
                if _is_partial(path) and time.time() - info["mtime"] > ABANDONED_S:
                    self.remove([path])

    def _by_key(self, folder: str, suffix: str) -> dict[str, dict[str, str]]:
        self.fs.invalidate_cache()
        found: dict[str, dict[str, str]] = {}
        for path in self.fs.find(f"{self.root}/{folder}"):
            if path.endswith(suffix) and not _is_partial(path):
                key = path.rsplit("/", 1)[1][: -len(suffix)]
                found.setdefault(key.split("-")[0], {})[key] = path
        return found

    def _put(self, folder: str, name: str, data: bytes) -> None:
        if not isinstance(self.fs, LocalFileSystem):
            # an object appears whole
            self.fs.pipe_file(f"{folder}/{name}", data)
            return
        os.makedirs(folder, exist_ok=True)
        partial = f"{folder}/.{name}.{socket.gethostname()}-{os.getpid()}"
        with open(partial, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, f"{folder}/{name}")


def _is_partial(path: str) -> bool:
    return path.rsplit("/", 1)[1].startswith(".")
