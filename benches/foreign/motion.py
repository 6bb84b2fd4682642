"""References for one joint: position, velocity and acceleration over time, within a reach and a speed."""

import math

import numpy as np

SOFT_START_S = 1.0
JERK_S = 0.06


def multisine(time_s, reach_rad, speed_rad_s, rng):
    """Five to eight sines between 0.06 and 1.6 Hz, the slow ones larger."""
    count = rng.integers(5, 9)
    rate_rad_s = 2.0 * np.pi * np.exp(rng.uniform(math.log(0.07), math.log(1.6), count))
    rate_rad_s[0] = 2.0 * np.pi * rng.uniform(0.06, 0.12)
    angle_rad = rate_rad_s[:, None] * time_s + rng.uniform(0.0, 2.0 * np.pi, count)[:, None]
    weight = (rate_rad_s / (2.0 * np.pi)) ** -0.8
    position_rad, velocity_rad_s = weight @ np.sin(angle_rad), (weight * rate_rad_s) @ np.cos(angle_rad)
    scale = min(reach_rad / np.abs(position_rad).max(), speed_rad_s / np.abs(velocity_rad_s).max())
    acceleration_rad_s2 = -(weight * rate_rad_s**2) @ np.sin(angle_rad)
    return scale * position_rad, scale * velocity_rad_s, scale * acceleration_rad_s2


def sine(time_s, reach_rad, speed_rad_s, rng):
    rate_rad_s = 2.0 * np.pi * rng.uniform(0.15, 0.5)
    size_rad = min(reach_rad, speed_rad_s / rate_rad_s)
    angle_rad = rate_rad_s * time_s
    position_rad = size_rad * np.sin(angle_rad)
    return position_rad, rate_rad_s * size_rad * np.cos(angle_rad), -(rate_rad_s**2) * position_rad


def with_soft_start(time_s, position_rad, velocity_rad_s, acceleration_rad_s2):
    """Multiplied by a fifth-order step, so that the motion begins at rest."""
    part = np.clip(time_s / SOFT_START_S, 0.0, 1.0)
    moving = part < 1.0
    step = part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
    step_1_s = (30.0 * part**2 - 60.0 * part**3 + 30.0 * part**4) / SOFT_START_S * moving
    step_1_s2 = (60.0 * part - 180.0 * part**2 + 120.0 * part**3) / SOFT_START_S**2 * moving
    return (
        step * position_rad,
        step_1_s * position_rad + step * velocity_rad_s,
        step_1_s2 * position_rad + 2.0 * step_1_s * velocity_rad_s + step * acceleration_rad_s2,
    )


def next_move(kind, number, at_rad, reach_rad, speed_rad_s, rng):
    """Where to, at which speed and acceleration, and how long to stay there."""
    if kind == "point_to_point":
        goal_rad = rng.uniform(-reach_rad, reach_rad)
        while abs(goal_rad - at_rad) < 0.25 * reach_rad:
            goal_rad = rng.uniform(-reach_rad, reach_rad)
        return goal_rad, rng.uniform(0.3, 1.0) * speed_rad_s, rng.uniform(2.0, 5.0) * speed_rad_s, rng.uniform(0.2, 0.9)
    goal_rad = reach_rad * (-1.0) ** number * rng.uniform(0.6, 1.0)
    speed = (0.12, 0.45, 0.25, 0.8)[number // 2 % 4] * speed_rad_s
    return goal_rad, speed, 4.0 * speed_rad_s, rng.uniform(0.0, 0.15)


def moves(kind, time_s, reach_rad, speed_rad_s, rng):
    """Moves of trapezoidal speed from standstill to standstill, rounded off over JERK_S."""
    position_rad = np.zeros(len(time_s))
    begin_s, at_rad, number = 0.3, 0.0, 0
    duration_s = len(time_s) * time_s[1]
    while begin_s < duration_s:
        goal_rad, speed, acceleration, dwell_s = next_move(kind, number, at_rad, reach_rad, speed_rad_s, rng)
        way_rad, sign = abs(goal_rad - at_rad), np.sign(goal_rad - at_rad)
        rise_s = speed / acceleration
        if speed * rise_s > way_rad:  # too short to reach the speed
            rise_s = math.sqrt(way_rad / acceleration)
            speed = acceleration * rise_s
        cruise_s = way_rad / speed - rise_s
        whole_s = 2.0 * rise_s + cruise_s
        into_s = np.clip(time_s - begin_s, 0.0, whole_s)
        left_s = whole_s - into_s
        rising_rad = 0.5 * acceleration * into_s**2
        cruising_rad = 0.5 * acceleration * rise_s**2 + speed * (into_s - rise_s)
        falling_rad = speed * cruise_s + acceleration * rise_s**2 - 0.5 * acceleration * left_s**2
        done_rad = np.where(into_s < rise_s, rising_rad, np.where(into_s < rise_s + cruise_s, cruising_rad, falling_rad))
        position_rad = np.where(time_s >= begin_s, at_rad + sign * done_rad, position_rad)
        begin_s, at_rad, number = begin_s + whole_s + dwell_s, goal_rad, number + 1
    return rounded_off(position_rad, 1.0 / time_s[1])


def rounded_off(position_rad, rate_hz):
    """A Hann window bounds the jerk; derivatives are central differences of what it leaves."""
    width = max(1, int(JERK_S * rate_hz))
    window = np.hanning(width + 2)[1:-1]
    padded_rad = np.pad(position_rad, (width // 2, width - 1 - width // 2), mode="edge")
    smooth_rad = np.pad(np.convolve(padded_rad, window / window.sum(), "valid"), (1, 1), mode="edge")
    velocity_rad_s = (smooth_rad[2:] - smooth_rad[:-2]) * rate_hz / 2.0
    acceleration_rad_s2 = (smooth_rad[2:] - 2.0 * smooth_rad[1:-1] + smooth_rad[:-2]) * rate_hz**2
    return smooth_rad[1:-1], velocity_rad_s, acceleration_rad_s2


def reference(kind, duration_s, rate_hz, reach_rad, centre_rad, speed_rad_s, rng):
    """One of `multisine`, `sine`, `point_to_point` and `ramps` (back and forth at four speeds)."""
    time_s = np.arange(int(duration_s * rate_hz)) / rate_hz
    if kind in ("point_to_point", "ramps"):
        position_rad, velocity_rad_s, acceleration_rad_s2 = moves(kind, time_s, reach_rad, speed_rad_s, rng)
    else:
        wave = {"multisine": multisine, "sine": sine}[kind](time_s, reach_rad, speed_rad_s, rng)
        position_rad, velocity_rad_s, acceleration_rad_s2 = with_soft_start(time_s, *wave)
    return position_rad + centre_rad, velocity_rad_s, acceleration_rad_s2
