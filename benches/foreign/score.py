"""Counts the diagnoses against the truth, as Markdown or JSON.

A case without a gap is right if no joint has a verdict but `no_gap` or `insufficient_data` and nothing is shared; else it is a
false alarm.

A case with one or two effects is judged by the effects that the report names, at joints and as shared:

- right: every true effect is named, and nothing else. `ambiguous` is right too if the true effect is among those that this joint's
  report says cannot be told apart; the others of that set then count as nothing else.
- more: every true effect is named, and something else beside.
- half: one of two is named.
- wrong: something is named and nothing of it is true.
- unexplained: a gap, and no name.
- missed: no gap. unsure: no gap or `insufficient_data`.

Alike, because no recording of such a rig tells them apart: command and sensor delay; on one joint a base tilt or an encoder offset
may be called base tilt, encoder offset or gravity torque. An effect of the whole arm (payload, tilt, timing) may be named at any
joint, or as shared.

A law on no list is judged at its joint by what names take of the gap there: right if there is a gap and no name takes more of it than
that name has in common with the law (`in_common` of truth.json) and a tenth; missed if there is no gap; unsure; else wrong, a name
for what is not its own.

Parameters: of cases with one effect that is right or more, under its own name; amplitudes, gains and times, no phases, no cycles.
The error is relative to the true value (of a gain, to its distance from 1); an interval is the value and 1.96 standard deviations.
"""

import json
import math
import statistics
from collections import Counter, defaultdict

ALIKE = ({"command_delay", "sensor_delay"},)
TILT_ALIKE = {"base_tilt", "encoder_offset", "gravity_torque"}
MAY_BE_SHARED = {"payload", "base_tilt", "command_delay", "sensor_delay", "dropped_commands", "dropped_samples"}
QUIET = {"no_gap", "insufficient_data"}
CLASSES = ("right", "more", "half", "wrong", "unexplained", "missed", "unsure", "failed")
NOT_COMPARED = ("cycles", "phase", "exponent")
SIGMAS = 1.96
# Part of a gap that a name may take beyond what it has in common with the law that made it.
BEYOND = 0.1


def wilson(hits, count):
    """Share and its 95 % interval (Wilson, J. Am. Stat. Assoc. 22 (1927) 209-212)."""
    if count == 0:
        return None
    share, z2 = hits / count, SIGMAS**2
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = SIGMAS * math.sqrt(share * (1 - share) / count + z2 / (4 * count**2)) / (1 + z2 / count)
    return share, max(middle - half, 0.0), min(middle + half, 1.0)


def right_names(effect, one_joint):
    names = {effect["effect"]}
    if one_joint and names & {"base_tilt", "encoder_offset"}:
        return TILT_ALIKE
    return names.union(*(alike for alike in ALIKE if names & alike))


def confusable(joint):
    """What this joint's report says cannot be told apart."""
    if joint["verdict"] != "ambiguous":
        return set()
    return {name for pair in joint.get("confusable", []) for name in pair["effects"]}


def judge_unlisted(effect, joints, shared):
    joint = next(joint for joint in joints if joint["joint"] == effect["joint"])
    if joint["verdict"] in QUIET:
        return {"no_gap": "missed", "insufficient_data": "unsure"}[joint["verdict"]]
    takes = [(entry["effect"], entry["share"]) for entry in joint.get("effects", [])]
    at_joint = [(entry["effect"], entry["joint_shares"].get(joint["joint"])) for entry in shared]
    takes += [(name, here["share"]) for name, here in at_joint if here]
    is_its_own = all(share <= effect["in_common"].get(name, 0.0) + BEYOND for name, share in takes)
    return "right" if is_its_own else "wrong"


def judge_listed(effects, joints, shared):
    said = {(joint["joint"], effect["effect"]) for joint in joints for effect in joint.get("effects", [])}
    said |= {(None, name) for name in shared}
    found, accounted = 0, set()
    for effect in effects:
        names = right_names(effect, len(joints) == 1)
        at = [joint for joint in joints if effect["shared"] or joint["joint"] == effect["joint"]]
        places = [joint["joint"] for joint in at] + ([None] if names & MAY_BE_SHARED else [])
        right = {(place, name) for place in places for name in names}
        if right & said:
            found, accounted = found + 1, accounted | right
        elif any(names & confusable(joint) for joint in at):
            found += 1
            accounted |= {(joint["joint"], name) for joint in at for name in confusable(joint)}
    if found == len(effects):
        return "more" if said - accounted else "right"
    if found:
        return "half"
    verdicts = {joint["verdict"] for joint in joints}
    if verdicts == {"no_gap"} and not shared:
        return "missed"
    if verdicts <= QUIET and not shared:
        return "unsure"
    return "wrong" if said else "unexplained"


def judge(truth, report):
    """One of CLASSES."""
    if report is None:
        return "failed"
    joints, causes = report["joints"], report.get("shared_effects", [])
    shared = [entry["effect"] for entry in causes]
    if not truth["effects"]:
        quiet = all(joint["verdict"] in QUIET for joint in joints) and not shared
        return "right" if quiet else "wrong"
    unlisted = [effect for effect in truth["effects"] if effect["effect"].startswith("x_")]
    return judge_unlisted(unlisted[0], joints, causes) if unlisted else judge_listed(truth["effects"], joints, shared)


def in_words(report, error):
    """What was said, for the list of misses."""
    if report is None:
        return error or "no report"
    parts = []
    for joint in report["joints"]:
        names = [f"{effect['effect']} {effect['probability']:.2f}" for effect in joint.get("effects", [])]
        if joint["verdict"] != "no_gap":
            parts.append(f"{joint['joint']}: {joint['verdict']} {', '.join(names)}".strip())
    parts += [f"shared: {entry['effect']}" for entry in report.get("shared_effects", [])]
    return "; ".join(parts) or "no gap"


def parameters(truth, report):
    """Of the one effect under its own name: parameter, true value, told value and standard deviation."""
    (effect,) = truth["effects"]
    at_joint = [joint for joint in report["joints"] if effect["shared"] or joint["joint"] == effect["joint"]]
    entries = [*report.get("shared_effects", []), *(entry for joint in at_joint for entry in joint.get("effects", []))]
    told = next((entry["parameters"] for entry in entries if entry["effect"] == effect["effect"]), {})
    for name, true in effect["parameters"].items():
        value = told.get(name)
        if isinstance(value, dict) and not name.startswith(NOT_COMPARED):
            size = abs(true - 1.0) if name == "gain" else abs(true)
            off, std = value["value"] - true, value["std"]
            within = None if value.get("at_bound") else abs(off) <= SIGMAS * std
            yield {
                "effect": effect["effect"], "parameter": name, "true": true, "told": value["value"], "std": std,
                "relative_error": abs(off) / size, "within": within,
            }  # fmt: skip


def read(folder):
    """Every case that was made, judged where it was run."""
    for path in sorted(folder.glob("*/truth.json")):
        truth = json.loads(path.read_text())
        case = truth["case"]
        entry = {"name": case["name"], "case": case, "effects": truth["effects"], "left_out": truth["left_out"]}
        run, report = path.parent / "told/run.json", path.parent / "told/report.json"
        if run.is_file():
            run = json.loads(run.read_text())
            report = json.loads(report.read_text()) if run["exit_code"] == 0 and report.is_file() else None
            entry |= {"class": judge(truth, report), "said": in_words(report, run["error"]), "seconds": run["seconds"]}
            judged = entry["class"] in ("right", "more") and len(truth["effects"]) == 1
            entry["parameters"] = list(parameters(truth, report)) if judged else []
        yield entry


def count(entries):
    """One line of a table."""
    kinds = {"none": [], "listed": [], "unlisted": []}
    for entry in entries:
        names = [effect["effect"] for effect in entry["effects"]]
        kind = "none" if not names else "unlisted" if any(name.startswith("x_") for name in names) else "listed"
        kinds[kind].append(entry["class"])
    none, listed = kinds["none"], kinds["listed"]
    return {
        "none": len(none),
        "false_alarms": none.count("wrong"),
        "failed_none": none.count("failed"),
        "false_alarm_share": wilson(none.count("wrong"), len(none)),
        "listed": len(listed),
        "listed_share": wilson(listed.count("right"), len(listed)),
        "unlisted": len(kinds["unlisted"]),
        "unlisted_share": wilson(kinds["unlisted"].count("right"), len(kinds["unlisted"])),
        "classes": {kind: dict(Counter(kinds[kind])) for kind in ("listed", "unlisted")},
    }


RIGS = {"single": "one joint", "two": "two joints", "six": "six joints"}


def by_rig(case):
    mujoco = case["engine"] == "mujoco"
    return (list(RIGS).index(case["rig"]), mujoco), RIGS[case["rig"]] + (", MuJoCo" if mujoco else "")


def by_gear(case):
    gear, encoder = "elastic" if case["elastic"] else "rigid", "link encoder" if case["has_link_encoder"] else "motor only"
    return (gear, encoder), f"{gear}, {encoder}"


def by_rate(case):
    return (case["rate_hz"], case["loop_hz"]), f"{case['rate_hz']} Hz of {case['loop_hz']} Hz"


# Each gives a place in the order and a label.
GROUPS = {"Number of joints": by_rig, "Gear and encoders": by_gear, "Recorded rate": by_rate}


def score(entries):
    judged = [entry for entry in entries if "class" in entry]
    groups = {}
    for title, group in GROUPS.items():
        by_group = defaultdict(list)
        for entry in judged:
            by_group[group(entry["case"])].append(entry)
        groups[title] = {label: count(by_group[order, label]) for order, label in sorted(by_group)} | {"all": count(judged)}
    of_parameters = [{"name": entry["name"], **value} for entry in judged for value in entry["parameters"]]
    keep = ("name", "class", "said", "seconds")
    return {
        "made": len(entries),
        "left_out": {entry["name"]: entry["left_out"] for entry in entries if entry["left_out"]},
        "not_run": [entry["name"] for entry in entries if not entry["left_out"] and "class" not in entry],
        "groups": groups,
        "misses": [
            {key: entry[key] for key in keep} | {"true": [effect["effect"] for effect in entry["effects"]]}
            for entry in judged
            if entry["class"] != "right"
        ],
        "parameters": of_parameters,
    }


def share(values):
    return "" if values is None else "{:.2f} ({:.2f}-{:.2f})".format(*values)


def markdown_table(head, rows):
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)


def group_table(title, counts):
    head = [title, "no gap", "false alarms", "share", "listed"]
    unlisted = [name for name in CLASSES if name not in ("more", "half", "unexplained")]
    head += [*CLASSES, "share right", "on no list", *unlisted, "share right"]
    rows = []
    for name, line in counts.items():
        # a failure on a case without a gap is no false alarm, and is not hidden either
        alarms = line["false_alarms"] if not line["failed_none"] else f"{line['false_alarms']}, {line['failed_none']} failed"
        cells = [name, line["none"], alarms, share(line["false_alarm_share"]), line["listed"]]
        cells += [line["classes"]["listed"].get(kind, 0) for kind in CLASSES] + [share(line["listed_share"]), line["unlisted"]]
        cells += [line["classes"]["unlisted"].get(kind, 0) for kind in unlisted] + [share(line["unlisted_share"])]
        rows.append(cells)
    return markdown_table(head, rows)


def parameter_table(entries):
    by_name = defaultdict(list)
    for entry in entries:
        by_name[entry["effect"], entry["parameter"]].append(entry)
        by_name["all", ""].append(entry)
    rows = []
    for (effect, parameter), of_name in sorted(by_name.items(), key=lambda item: (item[0][0] == "all", item[0])):
        within = [entry["within"] for entry in of_name if entry["within"] is not None]
        error = statistics.median(entry["relative_error"] for entry in of_name)
        rows.append([effect, parameter, len(of_name), f"{error:.3f}", share(wilson(sum(within), len(within)))])
    return markdown_table(["effect", "parameter", "values", "median relative error", "in the 95 % interval"], rows)


def as_markdown(result):
    parts = [f"{result['made']} cases made, {len(result['left_out'])} left out, {len(result['not_run'])} not run yet."]
    parts += [f"Left out: {name}: {why}." for name, why in result["left_out"].items()]
    parts += [group_table(title, counts) for title, counts in result["groups"].items()]
    parts.append(parameter_table(result["parameters"]))
    rows = [
        [miss["name"], miss["class"], ", ".join(miss["true"]) or "none", miss["said"], f"{miss['seconds']:.1f}"]
        for miss in result["misses"]
    ]
    parts.append(markdown_table(["not right", "class", "true", "said", "s"], rows))
    return "\n\n".join(parts)
