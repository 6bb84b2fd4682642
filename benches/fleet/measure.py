#!/usr/bin/env python3
"""Diagnoses a fleet made by make.py on an engine, and measures what that costs beside the diagnosis itself.

    python3 benches/fleet/measure.py --fleet FLEET --engine ray --workers 2 --out FLEET/ray

Recordings come in the order of their days, so that robots of one and of seven joints are mixed from the beginning.
Processor time is that of this process and all its children, the engine's own ones included, without that of the thread
here that looks at them; so a busy machine does not change it much. What the diagnoses themselves took stands in the
dataset. The rest is overhead. Writes OUT/measured.json.
"""

import argparse
import json
import pathlib
import statistics
import threading
import time

import psutil
from flexspline import fleet
from flexspline.fleet._dataset import Dataset

#: Between two looks at the processes. What a process takes after the last look before its end is not seen.
LOOK_S = 1.0


class Watch(threading.Thread):
    """Processor time and memory of this process and of all its children."""

    def __init__(self):
        super().__init__(daemon=True)
        self.me = psutil.Process()
        self.begin_s = time.monotonic()
        self.before_s = sum(self.me.cpu_times()[:2])
        self.processor_s = {}
        self.memory = {}
        self.looking_s = 0.0
        self.done = threading.Event()
        self.lock = threading.Lock()
        self.look()

    def look(self):
        with self.lock:
            self._look()

    def _look(self):
        begin_s = time.thread_time()
        for process in [self.me, *self.me.children(recursive=True)]:
            try:
                with process.oneshot():
                    key = (process.pid, process.create_time())
                    self.processor_s[key] = sum(process.cpu_times()[:2])
                    name = " ".join(process.cmdline())[:200]
                    sample = (time.monotonic() - self.begin_s, process.memory_info().rss / 2**20)
                    self.memory.setdefault((*key, process.pid == self.me.pid), (name, []))[1].append(sample)
            except psutil.Error:
                pass
        self.looking_s += time.thread_time() - begin_s

    def run(self):
        while not self.done.wait(LOOK_S):
            self.look()

    def total_s(self):
        with self.lock:
            return sum(self.processor_s.values()) - self.before_s - self.looking_s

    def by_program_s(self):
        """Processor time by what the processes are, the largest first."""
        told = {"this script": -self.before_s - self.looking_s}
        for (*key, is_me), (name, _) in self.memory.items():
            name = "this script" if is_me else program(name)
            told[name] = told.get(name, 0.0) + self.processor_s[tuple(key)]
        return {name: round(s, 1) for name, s in sorted(told.items(), key=lambda one: -one[1])}

    def workers(self, count):
        """The children that took most processor time: MiB held in each tenth of their life."""
        kids = [key for key in self.memory if not key[2]]
        kids.sort(key=lambda key: -self.processor_s[key[:2]])
        told = []
        for key in kids[:count]:
            samples = [mib for _, mib in self.memory[key][1]]
            tenths = [samples[k * len(samples) // 10 : (k + 1) * len(samples) // 10] for k in range(10)]
            told.append(
                {
                    "processor_s": round(self.processor_s[key[:2]], 1),
                    "median_mib_by_tenth": [round(statistics.median(tenth), 1) for tenth in tenths if tenth],
                    "most_mib": round(max(samples), 1),
                }
            )
        return told


def program(command):
    """What a process is, by its command line."""
    words = command.split()
    # an interpreter is what it runs
    scripts = [word for word in words[1:] if word.endswith(".py") or word.startswith(("loky.", "distributed.", "ray::"))]
    return pathlib.Path((scripts or words or ["?"])[0]).name


def costs(results):
    return results.read().select(["recording", "processor_seconds", "model"]).to_pylist()


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--fleet", required=True, type=pathlib.Path, help="folder made by make.py")
    options.add_argument("--engine", required=True, choices=["local", "ray", "dask"])
    options.add_argument("--workers", type=int, default=2)
    options.add_argument("--recordings", type=int, help="only so many, by day")
    options.add_argument("--skip", type=int, default=0, help="without the first so many, by day [0]")
    options.add_argument("--out", required=True, type=pathlib.Path, help="dataset; what is there already is not counted")
    given = options.parse_args()
    recordings = sorted((given.fleet / "recordings").glob("*/*.mcap"), key=lambda path: (path.name, path.parent.name))
    recordings = recordings[given.skip :][: given.recordings]
    wanted = {str(path) for path in recordings}
    robots = {"axis-*": given.fleet / "robots" / "axis.toml", "arm-*": given.fleet / "robots" / "arm.toml"}
    results = Dataset(given.out)
    before = {row["recording"] for row in costs(results)} if results.results() else set()
    steps = []
    watch = Watch()
    watch.start()

    def progress(done, of):
        if done == of:
            # before the engine ends its processes
            watch.look()
        if done % 50 == 0 or done == of:
            steps.append((done, round(time.monotonic() - watch.begin_s, 1), round(watch.total_s(), 1)))
            print(f"{done} of {of}, {steps[-1][2]} s of processor time", flush=True)

    done = fleet.diagnose(recordings, robots, given.engine, out=given.out, workers=given.workers, progress=progress)
    watch.look()
    watch.done.set()
    cost_s = {row["recording"]: (row["model"], row["processor_seconds"]) for row in costs(results)}
    cost_s = {name: cost for name, cost in cost_s.items() if name in wanted - before}
    diagnoses_s = sum(seconds for _, seconds in cost_s.values())
    models = {model: [s for name, s in cost_s.values() if name == model] for model, _ in cost_s.values()}
    measured = {
        "engine": given.engine,
        "workers": given.workers,
        "recordings": len(recordings),
        "diagnosed": done.diagnosed,
        "set_aside": len(done.set_aside),
        "wall_s": round(time.monotonic() - watch.begin_s, 1),
        "processor_s": round(watch.total_s(), 1),
        "diagnoses_processor_s": round(diagnoses_s, 1),
        "overhead": round(watch.total_s() / diagnoses_s - 1.0, 4),
        "by_program_processor_s": watch.by_program_s(),
        "median_processor_s": {model: round(statistics.median(all_s), 2) for model, all_s in models.items()},
        "steps_recordings_wall_s_processor_s": steps,
        "workers_memory": watch.workers(given.workers),
    }
    (given.out / "measured.json").write_text(json.dumps(measured, indent=1) + "\n")
    print(json.dumps(measured, indent=1))


if __name__ == "__main__":
    main()
