"""The table of benches/drives.sh: drives_table.py FOLDER."""

import json
import pathlib
import sys

folder = pathlib.Path(sys.argv[1])
CASES = [
    ("emulator", "emulator, shared memory, 7 joints"),
    ("ethercat-7", "virtual EtherCAT, veth, 7 joints on 7 slaves"),
    ("ethercat-12", "virtual EtherCAT, veth, 12 joints on 12 slaves"),
    ("moteus-7", "virtual moteus, 4 pseudo-terminals, 7 joints"),
]


def cyclictest():
    """p50, p99, p99.9 and largest lateness in us, of the histogram."""
    path = folder / "cyclictest.hist"
    if not path.exists():
        return None
    rows = [line.split() for line in path.read_text().splitlines() if line and line[0] != "#"]
    counts = [(int(us), int(count)) for us, count, *_ in rows]
    total = sum(count for _, count in counts)
    found = []
    for share in (0.5, 0.99, 0.999):
        seen = 0
        for us, count in counts:
            seen += count
            if seen >= share * total:
                found.append(us)
                break
    return found + [max((us for us, count in counts if count), default=0)]


def row(cells):
    print("| " + " | ".join(cells) + " |")


row(
    [
        "case",
        "cycles",
        "exchange p50, p99, p99.9, us",
        "lateness p50, p99, p99.9, largest, us",
        "cycles without a sample",
        "frames lost",
        "off the drives' clock p50, p99, largest, us",
        "busy, stolen, %",
    ]
)
row(["---"] * 2 + ["---:"] * 6)
yardstick = cyclictest()
if yardstick:
    row(["cyclictest"] + ["-"] * 2 + [", ".join(map(str, yardstick))] + ["-"] * 4)
for name, told in CASES:
    path = folder / f"{name}.json"
    if not path.exists():
        row([told] + ["did not run"] + ["-"] * 6)
        continue
    timing = json.loads(path.read_text())["timing"]
    counters = timing["counters"]

    def us(quantiles, *keys):
        if not quantiles["count"]:
            return "-"
        return ", ".join(f"{quantiles[key]:.0f}" for key in keys)

    three = ("p50_us", "p99_us", "p999_us")
    before = [float(part) for part in (folder / f"{name}.stat").read_text().split()]
    busy, stolen, all_ = (before[index + 3] - before[index] for index in range(3))
    row(
        [
            told,
            str(counters["cycles"]),
            us(timing["exchange"], *three),
            us(timing["wakeup_lateness"], *three, "max_us"),
            str(counters["drive_faults"]),
            str(counters["bus_frames_lost"]),
            us(timing["clock_offset"], "p50_us", "p99_us", "max_us"),
            f"{100 * busy / all_:.0f}, {100 * stolen / all_:.1f}",
        ]
    )
