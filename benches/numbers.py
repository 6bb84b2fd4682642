#!/usr/bin/env python3
"""Counts lines and numbers of the diagnosis' crates, or of those named, outside tests, room by room.

    benches/numbers.py [--list] [CRATE]...

A number is a constant with a numeric value, or a decimal in the code itself: 0, 0.5, 1 and whole numbers up to 4 are formulas and do
not count, nor does a constant that is one of another constant. Constants that decide what is told stand in docs/gap-numbers.md with unit and source; constants of the computation (steps,
capacities, limits of iterations) stand there too, by themselves. A constant that stands in neither table, stands there with another
value, or stands there and is no more, is an error: exit 1.
"""

import re
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CRATES = ("gap-diagnosis", "gap-report", "joint-twin", "recording-checks")
TABLES = ROOT / "docs" / "gap-numbers.md"
NUMBER = r"(?<![\w.])(?:\d[\d_]*\.\d+(?:e-?\d+)?|\d[\d_]*e-?\d+)(?![\w.])"
CONSTANT = re.compile(r"\bconst ([A-Z][A-Z0-9_]*): ([^=;]*(?:;[^=\]]*\][^=;]*)*)=\s*([^;]*);")
NUMERIC = re.compile(r"\b(?:f64|usize|u8|u32|u64|i32|i64)\b")
FORMULAS = {0.0, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0}


def code(path):
    """A file's lines without its tests, and its code without comments and texts."""
    lines = path.read_text().split("\n")
    for k, line in enumerate(lines):
        if re.match(r"(pub(\(\w+\))? )?mod tests \{", line):
            while lines[k - 1].startswith("#["):
                k -= 1
            lines = lines[:k]
            break
    while lines and not lines[-1].strip():
        lines.pop()
    bare = [re.sub(r'"(?:\\.|[^"\\])*"', '""', line) for line in lines]
    return lines, "\n".join(re.sub(r"//.*", "", line) for line in bare)


def comment(lines, constant):
    """What stands above a constant, or above those that it follows."""
    at = next(k for k, line in enumerate(lines) if re.search(rf"\bconst {constant}:", line))
    above = []
    for line in reversed(lines[:at]):
        if line.strip().startswith("///"):
            above.append(line.strip().removeprefix("///").strip())
        elif above or not re.search(r"\bconst [A-Z]", line):
            break
    return " ".join(reversed(above))


def is_formula(value):
    """Whether a constant's value is made of others by numbers that do not count."""
    names = re.findall(r"[A-Z][A-Z0-9_]+", value)
    digits = re.findall(r"(?<![\w.])\d[\d_.]*(?:e-?\d+)?", value)
    return bool(names) and all(float(x) in FORMULAS for x in digits)


def numbers(source):
    """Constants with their values, and bare decimals."""
    constants = [
        (name, " ".join(value.split()))
        for name, kind, value in CONSTANT.findall(source)
        if NUMERIC.search(kind) and re.search(r"\d", value) and not is_formula(value)
    ]
    rest = CONSTANT.sub(lambda of: "" if NUMERIC.search(of[2]) else of[0], source)
    decimals = [x for x in re.findall(NUMBER, rest) if float(x) not in FORMULAS]
    return constants, decimals


def told():
    """What the tables say: (file, name) with value and whether it decides."""
    told = {}
    decides = True
    for line in TABLES.read_text().split("\n") if TABLES.is_file() else []:
        if line.startswith("## "):
            decides = line.startswith("## That decide")
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| `") and len(cells) >= 4:
            told[cells[0].strip("`"), cells[1].strip("`")] = (cells[2].strip("`"), decides)
    return told


def main():
    arguments = [argument for argument in sys.argv[1:] if argument != "--list"]
    crates = arguments or CRATES
    rooms = defaultdict(lambda: defaultdict(int))
    wrong = []
    tables = {of: row for of, row in told().items() if of[0].split("/")[0] in crates}
    seen = set()
    files = [(crate, path) for crate in crates for path in sorted((ROOT / crate / "src").rglob("*.rs"))]
    for crate, path in files:
        inside = path.relative_to(ROOT / crate / "src")
        name = f"{crate}/{inside}"
        room = rooms["/".join(name.split("/")[: min(2, len(inside.parts))])]
        lines, text = code(path)
        constants, decimals = numbers(text)
        room["lines"] += len(lines)
        room["decimals"] += len(decimals)
        if "--list" in sys.argv and decimals:
            print(f"{name}: {' '.join(decimals)}")
        for constant, value in constants:
            seen.add((name, constant))
            is_told, decides = tables.get((name, constant), (None, True))
            room["decide" if decides else "compute"] += 1
            if is_told is None:
                wrong.append(f"| `{name}` | `{constant}` | `{value}` | {comment(lines, constant)} |")
            elif is_told != value:
                wrong.append(f"{name}: {constant} is {value} and {is_told} in {TABLES.name}")
    wrong.extend(f"{TABLES.name}: no {of} in {name}" for name, of in sorted(set(tables) - seen))
    columns = ("lines", "decide", "compute", "decimals")
    print("| room | lines | constants that decide | constants of the computation | bare decimals |")
    print("| --- | --- | --- | --- | --- |")
    for room in sorted(rooms):
        print(f"| `{room}` |", *(f"{rooms[room][column]} |" for column in columns))
    print("| all |", *(f"{sum(room[column] for room in rooms.values())} |" for column in columns))
    for line in wrong:
        print(line, file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
