"""Whether a running loop notices that Python attaches to it a hundred times.

    pip install ./python
    python benches/python/attach.py

Runs the emulated bench joint in real time in pairs, one left alone and one to which a process of Python attaches a hundred times,
takes rows and leaves. Prints the loop's own histograms: how late it woke up, and its own work.
"""

import json
import subprocess
import sysconfig
import tempfile
from pathlib import Path

import flexspline as fx

PAIRS = 3
SECONDS = 30
ATTACHMENTS = 100
COMMAND = sysconfig.get_path("scripts") + "/flexspline"


def run(attachments):
    """The report of a run."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.json"
        arguments = ["--robot", "shd17", "--instance", "python-bench", "--duration", f"{SECONDS}s", "--json", str(path)]
        child = subprocess.Popen([COMMAND, "run", *arguments], stdout=subprocess.DEVNULL)
        made = 0
        while made < attachments and child.poll() is None:
            try:
                with fx.attach("python-bench") as attached:
                    next(iter(attached))
                made += 1
            except (fx.InputError, StopIteration):
                # not running yet
                continue
        child.wait()
        return json.loads(path.read_text()), made


def main():
    print("| pair | attachments | woke late, us: p50 | p99 | p99.9 | own work, us: p50 | p99 | p99.9 | missed deadlines | of cycles |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for pair in range(PAIRS):
        for attachments in (0, ATTACHMENTS):
            report, made = run(attachments)
            timing = report["timing"]
            late, work, counters = (timing[key] for key in ("wakeup_lateness", "compute", "counters"))
            quantiles = [f"{of[q]:.1f}" for of in (late, work) for q in ("p50_us", "p99_us", "p999_us")]
            print("|", " | ".join([str(pair + 1), str(made), *quantiles, str(counters["missed_deadlines"]), str(counters["cycles"])]), "|")


if __name__ == "__main__":
    main()
