"""Makes a case: draws the arm, lets it move, and writes robot file, recording and truth into a folder of its own."""

import copy
import dataclasses
import json
import math
import shutil

import numpy as np

import files
import motion
from effects import EFFECTS, UNLISTED, Site
from in_common import in_common
from rigs import ARMS, as_in_its_file
from simulator import COMPUTED_TORQUE, LUGRE, Control, Course, Disturbance, simulate

# Between two trajectories of one recording.
PAUSE_S = 3.7
DAMPING = 0.8
# Of a loop around a rotor alone, its derivative gain over inertia times its delay: 45 degrees of phase margin.
MARGIN_RAD = 0.8
# A joint this far from its reference has been lost by its controller: no recording that anyone would keep.
LOST_RAD = 0.5


def drawn_arm(case, rng):
    """The plant without its effects, as its robot file has it, and with them; and the effects' truth."""
    exact = ARMS[case.rig](rng, case.elastic)
    for joint, speed_rad_s in zip(exact.joints, exact.speed_rad_s, strict=True):
        joint["bristles"] = LUGRE if case.bristles else 0.0
        joint["presliding"] = rng.uniform(2e-4, 6e-4) if case.bristles else rng.choice([5e-4, 1e-3, 3e-3])
        joint["drive_lag_s"] = case.drive_lag_s
        if case.stribeck_in_file:
            joint["stribeck_nm"], joint["stribeck_velocity_rad_s"] = 0.25 * joint["coulomb_nm"], 0.05 * speed_rad_s
            joint["stribeck_exponent"] = case.stribeck_exponent
    known = as_in_its_file(exact, case.parameter_tolerance, rng)
    arm, truth = copy.deepcopy(exact), []
    for name, index, strength in case.effects:
        site = Site(arm, known, index, strength, case.duration_s, case.stribeck_exponent, rng)
        parameters = EFFECTS[name].apply(site)
        shared = EFFECTS[name].whole_arm and len(arm.links) > 1
        truth.append({"effect": name, "joint": arm.links[index].name, "shared": shared, "parameters": parameters})
    return exact, known, arm, truth


def drawn_course(case, arm, rng):
    """References of all joints, one trajectory after the other with a pause between."""
    trajectories, begin_s = [], 0.0
    for segment in range(case.segments):
        of_joints = []
        for i in range(len(arm.links)):
            kind = case.motion
            if kind == "mixed":
                kind = ("multisine", "ramps", "point_to_point")[(i + segment) % 3]
            duration_s = case.duration_s / case.segments
            limits = (arm.reach_rad[i], arm.centre_rad[i], arm.speed_rad_s[i])
            of_joints.append(motion.reference(kind, duration_s, case.loop_hz, *limits, rng))
        position_rad, velocity_rad_s, acceleration_rad_s2 = np.array(of_joints).transpose(1, 2, 0)
        time_s = begin_s + np.arange(len(position_rad)) / case.loop_hz
        begins = np.arange(len(position_rad)) == 0
        trajectories.append(Course(time_s, position_rad, velocity_rad_s, acceleration_rad_s2, begins))
        begin_s = time_s[-1] + PAUSE_S
    return Course(*(np.concatenate(parts) for parts in zip(*trajectories, strict=True)))


def slowest_natural_rad_s(case, arm):
    """The loop's natural frequency: as drawn, or less where delays would use up the phase margin.

    Above a gear's resonance the drive feels its rotor alone, and a loop around an inertia crosses over at derivative gain over
    inertia; there the delays of hold, difference quotient, filter, bus and drive may take MARGIN_RAD.
    """
    cycle_s = 1.0 / case.loop_hz
    cutoff_hz = case.velocity_filter_hz if arm.velocity_filter_hz is None else arm.velocity_filter_hz
    late_s = (1.0 + case.delay_cycles + arm.lost_commands / (1.0 - arm.lost_commands)) * cycle_s
    late_s += 1.0 / (2.0 * math.pi * cutoff_hz) if cutoff_hz > 0.0 else 0.0
    late_s += arm.command_delay_s + arm.sensor_delay_s + arm.joints["drive_lag_s"].max()
    alone = (arm.rotor_kg_m2() / arm.inertia_kg_m2).min() if case.elastic else 1.0
    return min(2.0 * math.pi * case.bandwidth_hz, MARGIN_RAD * alone / (2.0 * DAMPING * late_s))


def tuned_control(case, exact, known, arm):
    """Gains for the loop's natural frequency, as a robot file tells them: to four digits. The filter is what really runs."""
    natural_rad_s = np.full(len(arm.links), slowest_natural_rad_s(case, arm))
    if case.rig == "six":
        natural_rad_s[3:] *= 1.2
    inertia_kg_m2 = np.ones(len(arm.links)) if case.controller == COMPUTED_TORQUE else np.array(exact.inertia_kg_m2)
    four_digits = lambda values: np.array([float(f"{value:.4g}") for value in values])
    return Control(
        case.controller,
        case.feedforward,
        four_digits(inertia_kg_m2 * natural_rad_s**2),
        four_digits(2.0 * DAMPING * inertia_kg_m2 * natural_rad_s),
        case.velocity_filter_hz if arm.velocity_filter_hz is None else arm.velocity_filter_hz,
        case.delay_cycles,
        known.chain(),
        known.gravity_m_s2,
        known.joints,
    )


def moved(case, arm, course, control, disturbance):
    if case.engine == "mujoco":
        import mujoco_engine  # takes a second to load

        return mujoco_engine.simulate(case.loop_hz, course, arm, control, disturbance)
    arguments = (arm.joints, arm.chain(), arm.gravity_m_s2, control, disturbance)
    return simulate(float(case.loop_hz), course, *arguments)


def set_limits(case, arm, course, control, disturbance, truth):
    """A drive's limit is a share of what a run without it asks for at most."""
    limited = np.flatnonzero(arm.limit_share)
    if not len(limited):
        return
    free = moved(case, arm, course, control, disturbance)
    for i in limited:
        largest_motor_nm = np.quantile(np.abs(free.command_torque_motor_nm[case.loop_hz :, i]), 0.999)
        arm.joints[i]["torque_limit_motor_nm"] = arm.limit_share[i] * largest_motor_nm
    for entry in truth:
        if entry["effect"] == "torque_saturation":
            entry["parameters"]["limit_nm"] = float(arm.joints[limited[0]]["torque_limit_motor_nm"])


def recorded(case, arm, course, outcome, rng):
    """The columns of the recording: some of the loop's cycles, some of its signals."""
    every = slice(None, None, case.loop_hz // case.rate_hz)
    told = {"reference_position_rad": course.position_rad} if case.reference_columns > 0 else {}
    if case.reference_columns > 1:
        told["reference_velocity_rad_s"] = course.velocity_rad_s
    if case.has_command:
        told["command_torque_nm"] = outcome.command_torque_motor_nm
    measured = {"motor_torque_nm": outcome.drive_torque_motor_nm, "motor_position_rad": outcome.motor_position_rad}
    if case.has_velocity:
        measured["motor_velocity_rad_s"] = outcome.motor_velocity_rad_s
    if case.has_link_encoder:
        measured["link_position_rad"] = outcome.link_position_rad
    columns = {"time_s": course.time_s[every]}
    if case.segments > 1:
        columns["segment"] = np.cumsum(course.begins)[every] - 1.0
    for i, link in enumerate(arm.links):
        for signal, values in (told | measured).items():
            columns[f"{link.name}.{signal}"] = values[every, i].copy()
    if arm.lost_samples > 0.0:
        lost = rng.random(len(columns["time_s"])) < arm.lost_samples
        lost[0] = False
        # a lost sample is the one before again
        last = np.maximum.accumulate(np.where(lost, 0, np.arange(len(lost))))
        columns |= {name: values[last] for name, values in columns.items() if name.split(".")[-1] in measured}
    return columns


def damaged(case, columns, rng):
    """As logs are when they come from elsewhere."""
    rows = len(columns["time_s"])
    names = [name for name in columns if name not in ("time_s", "segment")]
    if case.damage == "scattered_nan":
        for name in names:
            columns[name][rng.random(rows) < 0.01] = np.nan
    elif case.damage == "nan_stretch":
        first = next(name for name in names if name.endswith("motor_torque_nm"))
        columns[first][int(0.4 * rows) :][: int(0.8 * case.rate_hz)] = np.nan
    elif case.damage == "missing_rows":
        kept = np.ones(rows, bool)
        for _ in range(3):
            at = rng.integers(2 * case.rate_hz, rows - 3 * case.rate_hz)
            kept[at : at + int(rng.uniform(0.1, 0.5) * case.rate_hz)] = False
        columns = {name: values[kept] for name, values in columns.items()}
    return columns


def sensors_of(case, exact):
    """Per joint, the robot file's resolutions and noise."""
    keys = {"motor_encoder_resolution_rad": 2.0 * math.pi / 2**case.motor_encoder_bits}
    if case.has_link_encoder:
        keys["link_encoder_resolution_rad"] = 2.0 * math.pi / 2**case.link_encoder_bits
    return [
        keys | {"torque_noise_nm": 0.006 * (gravity_nm + 2.0 * joint["coulomb_nm"]) / joint["gear_ratio"]}
        for gravity_nm, joint in zip(exact.gravity_nm, exact.joints, strict=True)
    ]


def make(case):
    """Everything about a case, before it is written."""
    rng = case.rng()
    exact, known, arm, truth = drawn_arm(case, rng)
    course = drawn_course(case, arm, rng)
    control = tuned_control(case, exact, known, arm)
    sensors = sensors_of(case, exact)
    rows, count = course.position_rad.shape
    resolution_rad = sensors[0]["motor_encoder_resolution_rad"] * arm.coarser
    for entry in truth:
        if entry["effect"] == "encoder_quantisation":
            entry["parameters"]["resolution_rad"] = float(resolution_rad.max())
    noise_nm = np.array([of_joint["torque_noise_nm"] for of_joint in sensors])
    disturbance = Disturbance(
        arm.command_delay_s,
        arm.sensor_delay_s,
        rng.random(rows) < arm.lost_commands,
        noise_nm * rng.standard_normal((rows, count)),
        resolution_rad,
        np.full(count, 2.0 * math.pi / 2**case.link_encoder_bits),
    )
    set_limits(case, arm, course, control, disturbance, truth)
    outcome = moved(case, arm, course, control, disturbance)
    for entry, (name, index, _) in zip(truth, case.effects, strict=True):
        if name in UNLISTED:
            entry["in_common"] = in_common(case, exact, arm, index, course, outcome)
    columns = damaged(case, recorded(case, arm, course, outcome, rng), rng)
    return known, arm, course, control, sensors, disturbance, outcome, columns, truth


def left_out_because(course, outcome):
    error_rad = np.abs(outcome.true_link_rad - course.position_rad).max()
    if not error_rad <= LOST_RAD:
        return f"the controller lost the joint, {error_rad:.2g} rad from its reference"
    return None


def write(case, folder):
    """The case's folder; the truth comes last, so that a folder with a truth is whole. Returns why it is left out, if it is."""
    known, _, course, control, sensors, _, outcome, columns, truth = make(case)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    left_out = left_out_because(course, outcome)
    if left_out is None:
        files.write_robot(folder / "robot.toml", case, known, control, sensors)
        files.write_recording(folder, case, columns, known)
    whole = {"case": dataclasses.asdict(case), "effects": truth, "left_out": left_out}
    (folder / "truth.json").write_text(json.dumps(whole, indent=1) + "\n")
    return left_out
