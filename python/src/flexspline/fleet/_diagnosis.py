"""Every recording diagnosed once."""

from __future__ import annotations

import contextlib
import datetime
import os
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Callable

import fsspec
from fsspec.implementations.local import LocalFileSystem

from . import _dataset as dataset
from . import _engines as engines
from . import _recordings as sources
from ._dataset import Dataset
from ._recordings import Job


@dataclass(frozen=True)
class SetAside:
    """A recording without a result."""

    recording: str
    #: `bad_input`, `not_read` or `crash`; the latter two are tried again at the next start.
    kind: str
    #: One line.
    reason: str


@dataclass(frozen=True)
class Done:
    """What a call of `diagnose` did."""

    out: str
    #: Recordings diagnosed by this call.
    diagnosed: int
    #: Recordings whose result was there already, or that are known as bad input.
    already: int
    #: Recordings that this call set aside.
    set_aside: list[SetAside]


def diagnose(
    recordings: Any,
    robots: Any,
    engine: str = "local",
    *,
    out: str | os.PathLike[str],
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Done:
    """Diagnoses many recordings of many robots, each once, and writes a Parquet dataset to `out`.

    `recordings`: a path, glob or fsspec address, several of them, or a table (list of dicts, pandas, Polars, Arrow)
    with the column `recording` and, if told, `robot`, `recorded_at`, `operating_hours`. What is not told is taken from
    the address: the folder is the robot's name, a date in the file's name is when it was recorded.

    `robots`: a robot file, or robot files by robots' names; names may be patterns, as `{"axis-*": "axis.toml"}`.

    `engine`: `local`, `ray` or `dask`. A Ray or Dask this process is connected to is used as it is, with paths that its
    workers can read; else one is started with `workers` workers (one for each core if not given).

    A call goes on where an earlier one was stopped, however it was. What could not be diagnosed is set aside with the
    reason and stops nothing. Where a recording, its robot file or the product has changed, the result is made anew.

    `progress` is called with how many recordings are finished, and of how many.

    Raises ValueError, FileNotFoundError or ImportError, in one line, before anything is diagnosed.
    """
    import flexspline

    results = Dataset(out)
    wanted = sources.jobs(recordings, robots, flexspline.__version__)
    results.tidy()
    done, aside = results.results(), results.set_aside()
    jobs = []
    for job in wanted:
        address = job.key.split("-")[0]
        earlier = {**done.get(address, {}), **aside.get(address, {})}
        path = earlier.get(job.key)
        if path is None or _kind(path) in ("not_read", "crash"):
            jobs.append(replace(job, stale=tuple(earlier.values())))
    already, diagnosed, set_aside = len(wanted) - len(jobs), 0, []
    if not jobs:
        return Done(results.url, 0, already, [])
    running = engines.by_name(engine, _Work(results.url), workers)
    try:
        for job, outcome in engines.run(running, jobs):
            if isinstance(outcome, engines.Crashed):
                # its worker could not write this down
                outcome = SetAside(job.recording, "crash", f"the worker died: {outcome}")
                _write_down(results, job, outcome)
            if outcome is None:
                diagnosed += 1
            else:
                set_aside.append(outcome)
            if progress is not None:
                progress(already + diagnosed + len(set_aside), len(wanted))
    finally:
        running.close()
    return Done(results.url, diagnosed, already, set_aside)


class _Work:
    """What a worker does with one recording; it goes to the workers by value."""

    def __init__(self, out: str):
        self.out = out

    def __call__(self, job: Job) -> SetAside | None:
        import flexspline

        results = Dataset(self.out)
        try:
            with _local(job) as (recording, robot_file):
                with open(recording, "rb") as file:
                    content = _digest(file)
                rows = _rows(job, content, recording, robot_file)
        except flexspline.InputError as error:
            aside = SetAside(job.recording, "bad_input", _line(error))
        except OSError as error:
            aside = SetAside(job.recording, "not_read", _line(error))
        except Exception as error:
            aside = SetAside(job.recording, "crash", f"{type(error).__name__}: {_line(error)}")
        else:
            results.write(job.robot, job.key, rows)
            results.remove([path for path in job.stale if not path.endswith(f"/{job.key}.parquet")])
            return None
        _write_down(results, job, aside)
        return aside


def _rows(job: Job, content: str, recording: str, robot_file: str) -> list[dict]:
    import flexspline

    begin_s = time.process_time()
    # one recording a worker and one thread a recording: more would only fight for the cores
    report = flexspline.diagnose(robot_file, recording, threads=1).to_dict()
    processor_s = time.process_time() - begin_s
    of_recording = {
        "recording": job.recording,
        "content": content,
        "model": report["robot"],
        "robot_file": job.robot_file,
        "recorded_at": job.recorded_at,
        "operating_hours": job.operating_hours,
        "seconds": report["seconds"],
        "sample_rate_hz": report["sample_rate_hz"],
        "processor_seconds": processor_s,
        "product_version": flexspline.__version__,
        "schema_version": dataset.VERSION,
    }
    return [{**of_recording, **row} for row in rows_of(report)]


def rows_of(report: dict) -> list[dict]:
    """A report as rows, one a joint and effect, and one for a joint without an effect."""
    rows = []
    for joint in report["joints"]:
        gap = joint.get("gap") or {}
        torque = gap.get("torque_rms_nm") or {}
        name = joint["joint"]
        of_joint = {
            "joint": name,
            "verdict": joint["verdict"],
            "torque_rms_before_nm": torque.get("before"),
            "torque_rms_after_nm": torque.get("after"),
            "torque_rms_noise_floor_nm": torque.get("noise_floor"),
            "shrink": gap.get("shrink"),
            "remaining_share": joint.get("remaining_share"),
        }
        effects = [(effect, False, False) for effect in joint["effects"]]
        effects += [(effect, True, False) for effect in joint["minor_effects"]]
        for effect in report["shared_effects"]:
            if name in effect["joints"]:
                effects.append(({**effect, **effect.get("joint_shares", {}).get(name, {})}, False, True))
        confusable = {other for group in joint["confusable"] for other in group["effects"]}
        confusable -= {effect["effect"] for effect, _, _ in effects}
        of_joint["confusable_with"] = sorted(confusable)
        if not effects:
            rows.append({**of_joint, "effect": None, "minor": False, "shared": False, "parameters": []})
        for effect, minor, shared in effects:
            row = {**of_joint, "effect": effect["effect"], "minor": minor, "shared": shared}
            row.update({key: effect.get(key) for key in ("probability", "share", "share_low", "share_high")})
            row["parameters"] = [{"name": name, **value} for name, value in effect["parameters"].items()]
            rows.append(row)
    return rows


@contextlib.contextmanager
def _local(job: Job) -> Iterator[tuple[str, str]]:
    """Recording and robot file as paths of this machine; what lies elsewhere is fetched and removed again."""
    with contextlib.ExitStack() as stack:
        mapping = sources.mapping_address(job.recording)
        beside = [mapping] if mapping is not None else []
        yield _fetched(job.recording, stack, beside), _fetched(job.robot_file, stack, [])


def _fetched(address: str, stack: contextlib.ExitStack, beside: list[str]) -> str:
    fs, path = fsspec.core.url_to_fs(address)
    if isinstance(fs, LocalFileSystem):
        # a shipped robot's name stays as it is
        return path if fs.exists(path) else address
    folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="flexspline-fleet-"))
    for other in beside:
        _, other_path = fsspec.core.url_to_fs(other)
        if fs.exists(other_path):
            fs.get_file(other_path, os.path.join(folder, other_path.rsplit("/", 1)[-1]))
    target = os.path.join(folder, path.rsplit("/", 1)[-1])
    fs.get_file(path, target)
    return target


def _digest(file: Any) -> str:
    import hashlib

    digest = hashlib.blake2b(digest_size=16)
    while block := file.read(1 << 20):
        digest.update(block)
    return digest.hexdigest()


def _write_down(results: Dataset, job: Job, aside: SetAside) -> None:
    what = {
        "recording": job.recording,
        "robot": job.robot,
        "kind": aside.kind,
        "reason": aside.reason,
        "at": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"),
    }
    results.write_set_aside(aside.kind, job.key, what)
    path = f"/{aside.kind}/{job.key}.json"
    results.remove([stale for stale in job.stale if not stale.endswith(path)])


def _kind(path: str) -> str:
    return path.rsplit("/", 2)[-2]


def _line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
