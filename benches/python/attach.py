"""Whether a running loop notices that Python attaches to it.

    pip install ./python mcap-protobuf-support psutil
    python benches/python/attach.py

One run of the emulated bench joint in real time. By turns it is left alone, attached to 20 times a second, and left alone while the
same is done to another instance, whose processes are all stopped: what that costs the loop is the machine's share, for the two have
nothing in common. Prints quantiles of the recorded cycles: how late the loop woke up, and its own work.
"""

import signal
import subprocess
import sysconfig
import tempfile
import time
from pathlib import Path

import flexspline as fx
import numpy as np
import psutil
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

TURNS = 20
TURN_S = 3.0
# Between two attachments, each of which takes rows and leaves.
PACE_S = 0.05
# Of a turn's begin and end, cycles are not counted: rows come so late at most, which is how turns are found in the recording.
EDGE_S = 0.1
COMMAND = sysconfig.get_path("scripts") + "/flexspline"
RUN, STILL = "python-bench", "python-still"


def started(name, folder, seconds):
    """A run that can be attached to."""
    arguments = ["--robot", "shd17", "--instance", name, "--duration", f"{seconds}s", "--record", folder / f"{name}.mcap"]
    child = subprocess.Popen([COMMAND, "run", *arguments], stdout=subprocess.DEVNULL)
    while child.poll() is None:
        try:
            with fx.attach(name) as attached:
                next(iter(attached))
            return child
        except fx.InputError:
            time.sleep(0.1)
    raise SystemExit(f"{name} did not start")


def alone(_):
    pass


def attached(seen):
    with fx.attach(RUN) as attachment:
        rows = next(iter(attachment))
        seen.append((int(rows["cycle"][-1]), time.monotonic_ns()))


def elsewhere(_):
    with fx.attach(STILL):
        time.sleep(0.02)


def turns(conditions, seen):
    """Begin and end of each condition's turns, and how often it was done."""
    told = {what: ([], 0) for what in conditions}
    for _ in range(TURNS):
        for what in conditions:
            begin_ns, done = time.monotonic_ns(), 0
            end_ns = begin_ns + int(1e9 * TURN_S)
            while time.monotonic_ns() < end_ns - 1e9 * PACE_S:
                pace_ns = time.monotonic_ns() + int(1e9 * PACE_S)
                what(seen)
                done += 1
                time.sleep(max(0, pace_ns - time.monotonic_ns()) * 1e-9)
            spans, before = told[what]
            told[what] = ([*spans, (begin_ns, end_ns)], before + done * (what is not alone))
    return told


def cycles(path):
    """Number, lateness and own work in us, and the missed deadlines so far, of every recorded cycle."""
    with open(path, "rb") as file:
        messages = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics=["/loop"])
        rows = [
            (row.cycle, row.wakeup_lateness_ns * 1e-3, row.compute_ns * 1e-3, row.missed_deadlines) for *_, row in messages
        ]
    return np.array(rows).T


def main():
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        still = started(STILL, folder, 3600)
        # the janitor is left to clean up
        stopped = [one for one in psutil.Process(still.pid).children() if "janitor" not in one.cmdline()]
        stopped.append(psutil.Process(still.pid))
        run = None
        try:
            for process in stopped:
                process.suspend()
            run = started(RUN, folder, 3600)
            with fx.attach(RUN) as attachment:
                period_ns = 1e9 / attachment.sample_rate_hz
            seen = []
            told = turns((alone, attached, elsewhere), seen)
            run.send_signal(signal.SIGINT)
            run.wait()
        finally:
            for process in stopped:
                process.kill()
            still.wait()
            if run is not None and run.poll() is None:
                run.terminate()
        number, late_us, work_us, missed = cycles(folder / f"{RUN}.mcap")
    # the first cycle's instant, by the rows that came quickest
    began_ns = min(came_ns - cycle * period_ns for cycle, came_ns in seen)
    at_ns = began_ns + number * period_ns
    longest_us = None
    print("| | times | woke late, us: p50 | p99 | p99.9 | own work, us: p50 | p99 | p99.9 | cycles beyond the first p99.9 | missed deadlines | of cycles |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for what, (spans, done) in told.items():
        within = np.zeros(len(number), dtype=bool)
        for begin_ns, end_ns in spans:
            within |= (at_ns > begin_ns + 1e9 * EDGE_S) & (at_ns < end_ns - 1e9 * EDGE_S)
        quantiles = [np.quantile(us[within], q) for us in (late_us, work_us) for q in (0.5, 0.99, 0.999)]
        longest_us = longest_us or quantiles[-1]
        longer = int((work_us[within] > longest_us).sum())
        counts = [longer, int(np.diff(missed, prepend=missed[0])[within].sum()), int(within.sum())]
        print("|", " | ".join([what.__name__, str(done), *(f"{us:.1f}" for us in quantiles), *map(str, counts)]), "|")


if __name__ == "__main__":
    main()
