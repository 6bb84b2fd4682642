"""Robot file, recording and mapping file of a case, as flexspline reads them."""

import json
import math

import numpy as np
import pyarrow
import pyarrow.parquet

from simulator import VELOCITY_PI

DEGREE_RAD = math.pi / 180.0
FEEDFORWARD = ("none", "rigid_body", "model")


def toml(value):
    """A number always with a point or an exponent: the readers tell integers from floats."""
    if isinstance(value, (list, tuple, np.ndarray)):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, float):
        text = f"{value:.10g}"
        return text if any(mark in text for mark in ".en") else f"{text}.0"
    return json.dumps(value)


def table(values):
    return "{ " + ", ".join(f"{name} = {toml(value)}" for name, value in values.items()) + " }"


def control_lines(case, control):
    if case.told == "absent":
        return []
    values = {"rate_hz": float(case.loop_hz), "kind": "unknown"}
    if case.told == "all":
        values |= {
            "kind": "velocity_pi" if case.controller == VELOCITY_PI else "pd_feedforward",
            "proportional_nm_rad": control.proportional,
            "derivative_nm_s_rad": control.derivative,
            "feedback": "motor",
            "feedforward": FEEDFORWARD[case.feedforward],
            "velocity_filter_hz": case.velocity_filter_hz,
            "velocity_filter_order": 1,
            "delay_cycles": case.delay_cycles,
        }
    return ["[control]", *(f"{name} = {toml(value)}" for name, value in values.items())]


def link_lines(link):
    inertia = {
        a + b: float(link.inertia_kg_m2["xyz".index(a), "xyz".index(b)]) for a, b in ("xx", "yy", "zz", "xy", "yz", "xz")
    }
    return [
        "",
        "[[link]]",
        f'joint = "{link.name}"',
        f"origin_m = {toml(link.origin_m)}",
        f"origin_rpy_rad = {toml(link.rpy_rad)}",
        f"axis = {toml(link.axis)}",
        f"mass_kg = {toml(float(link.mass_kg))}",
        f"centre_of_mass_m = {toml(link.centre_m)}",
        f"inertia_kg_m2 = {table(inertia)}",
    ]


def joint_lines(name, joint, sensors):
    value = lambda key: float(joint[key])
    known = [{"effect": "coulomb_friction", "coulomb_nm": value("coulomb_nm")}]
    known.append({"effect": "viscous_friction", "viscous_nm_s_rad": value("viscous_nm_s_rad")})
    if value("stribeck_nm") != 0.0:
        stribeck = {key: value(key) for key in ("stribeck_nm", "stribeck_velocity_rad_s")}
        known.append({"effect": "stribeck_friction", **stribeck})
    if value("stiffness_nm_rad") > 0.0:
        known.append({"effect": "torsional_compliance", "stiffness_nm_rad": value("stiffness_nm_rad")})
    lines = ["", "[[joint]]", f'name = "{name}"']
    lines += [f"{key} = {toml(value(key))}" for key in ("gear_ratio", "rotor_inertia_kg_m2")]
    lines += [f"{key} = {toml(float(of_joint))}" for key, of_joint in sensors.items()]
    return [*lines, "effects = [", *(f"  {table(effect)}," for effect in known), "]"]


def write_robot(path, case, known, control, sensors):
    """`sensors`: per joint, the robot file's keys of resolution and noise."""
    lines = [f'name = "{case.name}"', f"gravity_m_s2 = {toml(known.gravity_m_s2)}"]
    lines += [f"parameter_tolerance = {toml(case.parameter_tolerance)}", *control_lines(case, control)]
    for link in known.links:
        lines += link_lines(link)
    for link, joint, of_joint in zip(known.links, known.joints, sensors, strict=True):
        lines += joint_lines(link.name, joint, of_joint)
    path.write_text("\n".join(lines) + "\n")


def mapped(columns, known):
    """The columns as another recorder would name them, in degrees and milliseconds, and the mapping file."""
    lines = ["[columns]", 'time_s = { column = "t_ms", scale = 1e-3 }']
    renamed = {"t_ms": columns["time_s"] * 1e3}
    if "segment" in columns:
        renamed["trial"] = columns["segment"]
        lines.append('segment = "trial"')
    for number, (link, joint) in enumerate(zip(known.links, known.joints, strict=True), 1):
        lines.append(f"[joint.{link.name}]")
        for name in [name for name in columns if name.startswith(f"{link.name}.")]:
            signal = name.split(".")[1]
            column, scale = f"ax{number}_{signal}", 1.0
            if "_rad" in signal:
                # motors' degrees are often told after the gear
                scale = DEGREE_RAD * (float(joint["gear_ratio"]) if signal.startswith("motor_") else 1.0)
                column = column.replace("_rad", "_deg")
                lines.append(f'{signal} = {{ column = "{column}", scale = {scale!r} }}')
            else:
                lines.append(f'{signal} = "{column}"')
            renamed[column] = columns[name] / scale
    return renamed, "\n".join(lines) + "\n"


def write_recording(folder, case, columns, known):
    """As CSV or Parquet; a value that is missing is an empty cell there and a null here."""
    if case.mapped:
        columns, mapping = mapped(columns, known)
        (folder / "recording.toml").write_text(mapping)
    if case.parquet:
        arrays = {name: pyarrow.array(values, mask=np.isnan(values)) for name, values in columns.items()}
        pyarrow.parquet.write_table(pyarrow.table(arrays), folder / "recording.parquet")
        return
    rows = np.column_stack(list(columns.values()))
    with open(folder / "recording.csv", "w") as file:
        file.write(",".join(columns) + "\n")
        for row in rows.tolist():
            # NaN is the one value that differs from itself
            file.write(",".join(f"{value:.10g}" if value == value else "" for value in row) + "\n")
