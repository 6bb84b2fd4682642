"""Which recordings there are, of which robot, and what each one's result depends on."""

from __future__ import annotations

import datetime
import fnmatch
import hashlib
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Union

import fsspec
from fsspec.implementations.local import LocalFileSystem

import flexspline

from . import _dataset as dataset

Address = Union[str, "os.PathLike[str]"]

#: 2026-01-05, 2026-01-05T12-30-00 and 20260105T123000, as recorders name files.
DATE = re.compile(r"(?<!\d)(\d{4})-?([01]\d)-?([0-3]\d)(?:[T_ -]?([0-2]\d)[:-]?([0-5]\d)(?:[:-]?([0-5]\d))?)?(?!\d)")

#: What stores say of a file's version. A file that has changed differs in one of them.
VERSION_KEYS = ("size", "mtime", "ETag", "etag", "LastModified", "last_modified", "updated", "generation", "md5Hash")


@dataclass(frozen=True)
class Job:
    """One recording to diagnose."""

    recording: str
    robot: str
    robot_file: str
    recorded_at: datetime.datetime | None
    operating_hours: float | None
    key: str
    #: Earlier results of the same address, removed when the new one is there.
    stale: tuple[str, ...] = field(default=(), compare=False)


def jobs(recordings: Any, robots: Any, product_version: str) -> list[Job]:
    """One job for each recording.

    Raises ValueError or FileNotFoundError with one line: what is wrong, where, and what to change.
    """
    files = _RobotFiles(robots)
    found: dict[str, Job] = {}
    for row in _rows(recordings):
        for address, info in _expand(row["recording"]):
            robot = str(row.get("robot") or _folder(address))
            robot_file = files.of(robot, address)
            recorded_at = _instant(row.get("recorded_at"), address)
            hours = row.get("operating_hours")
            hours = None if hours is None or hours != hours else float(hours)
            depends_on = [
                *_version(info),
                *_version(_mapping_info(address)),
                robot,
                files.digest(robot_file),
                str(recorded_at),
                str(hours),
                product_version,
                str(dataset.VERSION),
            ]
            key = f"{digest(address.encode())}-{digest(chr(10).join(depends_on).encode())}"
            job = Job(address, robot, robot_file, recorded_at, hours, key)
            earlier = found.setdefault(address, job)
            if earlier != job:
                raise ValueError(f"{address}: given twice, with different robots, dates or hours; give it once")
    if not found:
        raise ValueError("recordings: none given; name a path, a glob or a table with a column `recording`")
    return list(found.values())


def digest(data: bytes) -> str:
    """Sixteen hexadecimal digits: of a million recordings two share them once in thirty million fleets."""
    return hashlib.blake2b(data, digest_size=8).hexdigest()


def mapping_address(address: str) -> str | None:
    """Where a log's mapping file would be. An MCAP recording needs none."""
    inner, chained, archive = address.partition("::")
    stem, dot, ending = inner.rpartition(".")
    return f"{stem}.mapping.toml{chained}{archive}" if dot and ending.lower() != "mcap" else None


class _RobotFiles:
    def __init__(self, robots: Any):
        if isinstance(robots, Mapping):
            self.patterns = {str(pattern): os.fspath(path) for pattern, path in robots.items()}
        else:
            self.patterns = {"*": os.fspath(robots)}
        if not self.patterns:
            raise ValueError("robots: empty; give a robot file, or robot files by robot's name")
        self.digests: dict[str, str] = {}

    def of(self, robot: str, address: str) -> str:
        if robot in self.patterns:
            return self.patterns[robot]
        for pattern, path in self.patterns.items():
            if fnmatch.fnmatchcase(robot, pattern):
                return path
        names = ", ".join(self.patterns)
        raise ValueError(f"{address}: robot `{robot}` has no robot file; `robots` has {names}")

    def digest(self, path: str) -> str:
        if path not in self.digests:
            fs, inner = fsspec.core.url_to_fs(path)
            is_file = fs.isfile(inner)
            shipped = isinstance(fs, LocalFileSystem) and not is_file
            if isinstance(fs, LocalFileSystem):
                # one line now, and not one for each recording
                flexspline.Robot(path if shipped else inner)
            # what a shipped robot is comes with the product's version
            self.digests[path] = path if shipped else digest(fs.cat_file(inner))
        return self.digests[path]


def _rows(recordings: Any) -> Iterable[Mapping[str, Any]]:
    if isinstance(recordings, (str, os.PathLike)):
        recordings = [recordings]
    elif hasattr(recordings, "to_dicts"):  # Polars
        recordings = recordings.to_dicts()
    elif hasattr(recordings, "to_pylist"):  # Arrow
        recordings = recordings.to_pylist()
    elif hasattr(recordings, "to_dict"):  # pandas
        recordings = recordings.to_dict("records")
    for row in recordings:
        if isinstance(row, (str, os.PathLike)):
            yield {"recording": row}
            continue
        unknown = set(row) - {"recording", "robot", "recorded_at", "operating_hours"}
        if "recording" not in row or unknown:
            has = ", ".join(map(str, row))
            raise ValueError(
                f"recordings: a row has {has}; it needs `recording` and may have `robot`, `recorded_at`, `operating_hours`"
            )
        yield row


def _expand(recording: Address) -> list[tuple[str, dict]]:
    address = os.fspath(recording)
    fs, path = fsspec.core.url_to_fs(address)
    if not any(sign in path for sign in "*?["):
        if not fs.exists(path):
            raise FileNotFoundError(f"{address}: no such recording")
        return [(_address(fs, path, address), fs.info(path))]
    found = fs.glob(path, detail=True)
    files = [(_address(fs, name, address), info) for name, info in sorted(found.items()) if info["type"] == "file"]
    if not files:
        raise FileNotFoundError(f"{address}: no recording matches")
    return files


def _mapping_info(address: str) -> dict:
    mapping = mapping_address(address)
    if mapping is None:
        return {}
    fs, path = fsspec.core.url_to_fs(mapping)
    return fs.info(path) if fs.exists(path) else {}


def _version(info: Mapping[str, Any]) -> list[str]:
    return [f"{key}={info[key]}" for key in VERSION_KEYS if key in info]


def _address(fs: fsspec.AbstractFileSystem, path: str, given: str) -> str:
    if isinstance(fs, LocalFileSystem):
        return path
    # inside an archive: where the archive is follows
    _, chained, archive = given.partition("::")
    return f"{fs.unstrip_protocol(path)}{chained}{archive}"


def _folder(address: str) -> str:
    parts = address.partition("::")[0].split("/")
    return parts[-2] if len(parts) > 1 and parts[-2] else "robot"


def _instant(given: Any, address: str) -> datetime.datetime | None:
    if given is None or given != given:
        found = DATE.search(address.partition("::")[0].rsplit("/", 1)[-1])
        if not found:
            return None
        year, month, day, hour, minute, second = (int(number) for number in found.groups(default="0"))
        try:
            return datetime.datetime(year, month, day, hour, minute, second, tzinfo=datetime.timezone.utc)
        except ValueError:  # digits that are no date
            return None
    if isinstance(given, str):
        given = datetime.datetime.fromisoformat(given.replace("Z", "+00:00"))
    elif isinstance(given, datetime.date) and not isinstance(given, datetime.datetime):
        given = datetime.datetime(given.year, given.month, given.day)
    elif hasattr(given, "to_pydatetime"):
        given = given.to_pydatetime()
    if given.tzinfo is None:
        given = given.replace(tzinfo=datetime.timezone.utc)
    return given.astimezone(datetime.timezone.utc)
