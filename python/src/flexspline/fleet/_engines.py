"""Where recordings are diagnosed: in processes of this machine, on Ray, or on Dask. Each schedules as it comes.

An engine takes one job at a time and says which are finished. That is all it is asked; how many are handed over at once
is bounded, so that a million recordings are no million objects of the engine's.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, Callable, Protocol, TypeVar

J = TypeVar("J")

#: Jobs handed over for each worker: one runs, the next are there when it has ended.
AHEAD = 3
#: How long a process of this machine may outlive a caller that was killed.
ORPHAN_S = 1.0
#: A process keeps what its largest recording took: 0.5 GB with seven joints. By itself loky takes 0.3 GB more than after
#: the first recording for a leak, and starts the process anew.
LEAK_BYTES = "2e9"


class Crashed(Exception):
    """The worker died, and did so again where the engine tried again."""


class Engine(Protocol):
    #: How many jobs run at once.
    workers: int
    #: How often a job is handed over whose worker dies. An engine that tries again by itself is asked once.
    tries: int

    def submit(self, job: Any) -> Any: ...
    def wait(self, futures: list) -> list: ...
    def result(self, future: Any) -> Any: ...
    def close(self) -> None: ...


def by_name(name: str, work: Callable, workers: int | None) -> Engine:
    """Starts an engine, or joins the one this process is connected to."""
    if workers is not None and workers < 1:
        raise ValueError(f"workers: {workers}, at least 1 is needed")
    engines: dict[str, Callable[..., Engine]] = {"local": Local, "ray": Ray, "dask": Dask}
    if name not in engines:
        raise ValueError(f"engine: `{name}` is none of {', '.join(engines)}")
    try:
        return engines[name](work, workers)
    except ImportError as missing:
        raise ImportError(f"engine {name}: {missing}; install it with pip install 'flexspline[{name}]'") from missing


def run(engine: Engine, jobs: Iterable[J]) -> Iterator[tuple[J, Any]]:
    """Yields every job with its result, or with `Crashed`, as they end.

    Where a dying worker takes others' jobs with it, these are handed over again one by one: then it is clear who did it.
    """
    lost: list[J] = []
    for job, result in _bounded(engine, jobs, AHEAD * engine.workers):
        if isinstance(result, Crashed) and engine.tries > 1:
            lost.append(job)
        else:
            yield job, result
    for job in lost:
        for _ in range(engine.tries - 1):
            [(_, result)] = _bounded(engine, [job], 1)
            if not isinstance(result, Crashed):
                break
        yield job, result


def _bounded(engine: Engine, jobs: Iterable[J], most: int) -> Iterator[tuple[J, Any]]:
    queue = iter(jobs)
    waiting: dict[Any, J] = {}
    while True:
        for job in islice(queue, most - len(waiting)):
            waiting[engine.submit(job)] = job
        if not waiting:
            return
        for future in engine.wait(list(waiting)):
            job = waiting.pop(future)
            try:
                yield job, engine.result(future)
            except Crashed as crashed:
                yield job, crashed


class Local:
    """Processes of this machine, by loky: unlike the standard library's they need no guard in the user's script."""

    # the pool breaks as a whole: once with others, then twice alone
    tries = 3

    def __init__(self, work: Callable, workers: int | None):
        import loky

        self._loky = loky
        self._work = work
        self.workers = workers or loky.cpu_count()
        self._pool: Any = None

    def submit(self, job: Any) -> Any:
        if self._pool is None:
            self._pool = self._loky.ProcessPoolExecutor(
                self.workers,
                initializer=_end_with,
                initargs=(os.getpid(),),
                env={"LOKY_MAX_MEMORY_LEAK_SIZE": LEAK_BYTES},
            )
        try:
            return self._pool.submit(self._work, job)
        except self._loky.BrokenProcessPool:
            self.close()
            return self.submit(job)

    def wait(self, futures: list) -> list:
        import concurrent.futures

        return list(concurrent.futures.wait(futures, return_when=concurrent.futures.FIRST_COMPLETED).done)

    def result(self, future: Any) -> Any:
        try:
            return future.result()
        except self._loky.BrokenProcessPool as broken:
            raise Crashed(str(broken).strip().splitlines()[0]) from broken

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(kill_workers=True)
            self._pool = None


def _end_with(caller: int) -> None:
    """Ends this process when its caller is gone: loky's would wait for ever for work that nobody hands over."""

    def watch() -> None:
        while os.getppid() == caller:
            time.sleep(ORPHAN_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _called(work: Callable, job: Any) -> Any:
    return work(job)


class Ray:
    """Tasks of Ray: of the cluster this process is connected to, else of a Ray of this machine."""

    # Ray itself tries again, three times
    tries = 1

    def __init__(self, work: Callable, workers: int | None):
        import ray

        self._ray = ray
        self._own = not ray.is_initialized()
        if self._own:
            ray.init(num_cpus=workers, include_dashboard=False, log_to_driver=False)
        self.workers = workers or max(1, int(ray.cluster_resources().get("CPU", 1)))
        self._work = work
        self._task = ray.remote(num_cpus=1, max_retries=3)(_called)

    def submit(self, job: Any) -> Any:
        return self._task.remote(self._work, job)

    def wait(self, futures: list) -> list:
        done, _ = self._ray.wait(futures, num_returns=1)
        return done

    def result(self, future: Any) -> Any:
        crashes = (self._ray.exceptions.WorkerCrashedError, self._ray.exceptions.OutOfMemoryError)
        try:
            return self._ray.get(future)
        except crashes as crash:
            raise Crashed(str(crash).strip().splitlines()[0]) from crash

    def close(self) -> None:
        if self._own:
            self._ray.shutdown()


class Dask:
    """Tasks of Dask: of the client of this process, else of processes of this machine."""

    # Dask itself tries again, as often as `distributed.scheduler.allowed-failures` says
    tries = 1

    def __init__(self, work: Callable, workers: int | None):
        import distributed

        self._distributed = distributed
        self._work = work
        self._own: list = []
        try:
            self._client = distributed.get_client()
        except ValueError:  # there is none
            cluster = distributed.LocalCluster(
                n_workers=workers or os.cpu_count(), threads_per_worker=1, dashboard_address=None
            )
            self._client = distributed.Client(cluster)
            self._own = [self._client, cluster]
        self.workers = workers or max(1, sum(self._client.nthreads().values()))

    def submit(self, job: Any) -> Any:
        return self._client.submit(self._work, job, pure=False)

    def wait(self, futures: list) -> list:
        return list(self._distributed.wait(futures, return_when="FIRST_COMPLETED").done)

    def result(self, future: Any) -> Any:
        try:
            return future.result()
        except self._distributed.KilledWorker as killed:
            raise Crashed(str(killed).strip().splitlines()[0]) from killed

    def close(self) -> None:
        for owned in self._own:
            owned.close()
