"""Which cases a seed stands for: rig, effect, motion, controller, and what of them is recorded and told."""

import zlib
from dataclasses import dataclass

import numpy as np

from effects import EFFECTS, LISTED, UNLISTED
from simulator import COMPUTED_TORQUE, FEED_NOTHING, FEED_RIGID_BODY, FEED_MODEL, PD_FEEDFORWARD, PD_GRAVITY, VELOCITY_PI

STRONG, MODERATE = 1.0, 0.4
RATES_HZ = (1500, 1000, 500, 250, 100)
MOTIONS_OF_ONE = ("multisine", "multisine", "point_to_point", "ramps", "sine")
MOTIONS_OF_ARMS = ("multisine", "mixed", "point_to_point")
# Counted in samples or the controller's own: beside another effect they tell nothing that they do not tell alone.
NOT_IN_PAIRS = ("encoder_quantisation", "dropped_samples", "velocity_filter_lag")
# Those that are told of an arm's joint, and a law on no list.
IN_TWO = (
    *("coulomb_friction", "viscous_friction", "stribeck_friction", "load_dependent_friction", "position_dependent_friction"),
    *("thermal_friction_drift", "torsional_compliance", "torque_constant_error", "torque_offset", "payload", "base_tilt"),
    *("rotor_inertia", "joint_spring", "command_delay"),
)
IN_SIX = (
    *("coulomb_friction", "viscous_friction", "stribeck_friction", "torsional_compliance", "torque_constant_error"),
    *("torque_offset", "payload", "rotor_inertia", "joint_spring"),
)
# What MuJoCo has a parameter for.
IN_MUJOCO_ONE = ("coulomb_friction", "viscous_friction", "payload", "joint_spring", "rotor_inertia", "torque_constant_error")
IN_MUJOCO_SIX = ("coulomb_friction", "viscous_friction", "payload", "joint_spring")
SEEN_IN_COMMANDS = ("command_delay", "current_loop_lag", "dropped_commands", "torque_saturation")
SEEN_IN_TWIST = ("kinematic_error", "soft_windup", "torsional_hysteresis")


@dataclass
class Case:
    """One recording and the robot file that it is held against."""

    name: str
    seed: int
    rig: str
    engine: str
    # [name, joint's index, strength]
    effects: list
    elastic: bool
    # LuGre bristles, else a steep tanh; whether the robot file has a Stribeck entry, and the exponent of the plant's law
    bristles: bool
    stribeck_in_file: bool
    stribeck_exponent: int
    parameter_tolerance: float
    drive_lag_s: float
    motion: str
    duration_s: float
    segments: int
    controller: int
    feedforward: int
    bandwidth_hz: float
    velocity_filter_hz: float
    delay_cycles: int
    loop_hz: int
    rate_hz: int
    # of the controller: `all`, `unknown` (its rate only), or `absent`
    told: str
    motor_encoder_bits: int
    link_encoder_bits: int
    has_link_encoder: bool
    has_command: bool
    has_velocity: bool
    # of the reference: 0 nothing, 1 position, 2 velocity too
    reference_columns: int
    parquet: bool
    mapped: bool
    # scattered_nan, nan_stretch, missing_rows
    damage: str | None

    def rng(self):
        return generator(self.seed, f"{self.name} made")


def generator(seed, text):
    """Every case has its own random numbers, so that it is the same whatever else is made."""
    return np.random.default_rng([seed, zlib.crc32(text.encode())])


def drawn(seed, name, rig, effects, number, engine="numba"):
    """A case that an effect can be seen in; all else is chance."""
    rng = generator(seed, name)
    chance = lambda share: bool(rng.random() < share)
    one_of = lambda *values: values[rng.integers(len(values))]
    names = [effect for effect, _, _ in effects]
    needs = {need for effect in names for need in EFFECTS[effect].needs}
    elastic = chance(0.55)
    elastic = engine == "numba" and (("elastic" in needs) or (elastic and "rigid" not in needs))
    rate_hz = RATES_HZ[number % len(RATES_HZ)]
    loop_hz = {100: 1000, 250: one_of(250, 1000), 500: one_of(500, 1000)}.get(rate_hz, rate_hz)
    if elastic and loop_hz == 250:  # nobody runs a loop that slow on a gear that swings at 30 Hz
        loop_hz = 1000
    controllers = [PD_FEEDFORWARD, PD_FEEDFORWARD, PD_FEEDFORWARD, PD_GRAVITY]
    controller = one_of(*controllers, *([] if engine == "mujoco" else [COMPUTED_TORQUE, VELOCITY_PI]))
    told = "all" if controller in (PD_FEEDFORWARD, VELOCITY_PI) and chance(0.75) else one_of("unknown", "absent")
    filtered = "velocity_filter_lag" in names
    if filtered:
        controller, told = PD_FEEDFORWARD, "all"
    feedforward = FEED_RIGID_BODY
    if controller == PD_FEEDFORWARD:
        feedforward = one_of(FEED_NOTHING, FEED_RIGID_BODY, FEED_RIGID_BODY, FEED_MODEL)
    motion = one_of(*(MOTIONS_OF_ONE if rig == "single" else MOTIONS_OF_ARMS))
    stribeck_in_file = chance(0.4) and engine == "numba" and "stribeck_friction" not in names
    seen_in_twist = any(name in SEEN_IN_TWIST for name in names) and chance(0.8)
    seen_in_commands = any(name in SEEN_IN_COMMANDS for name in names) and chance(0.8)
    return Case(
        name=name, seed=seed, rig=rig, engine=engine, effects=effects,
        elastic=elastic, bristles=chance(0.4), stribeck_in_file=stribeck_in_file,
        # the file's law has exponent 1: with another one there would be a gap that nobody put in
        stribeck_exponent=1 if stribeck_in_file else one_of(1, 1, 2),
        parameter_tolerance=one_of(0.01, 0.02, 0.03), drive_lag_s=0.0 if engine == "mujoco" else one_of(0.0, 0.0, 0.0, 2e-4),
        motion="point_to_point" if "dwells" in needs else motion,
        duration_s=one_of(20.0, 25.0, 30.0), segments=one_of(1, 1, 1, 2, 3),
        controller=controller, feedforward=feedforward, bandwidth_hz=float(rng.uniform(3.0, 6.0)),
        velocity_filter_hz=100.0 if filtered else one_of(0.0, 60.0, 100.0), delay_cycles=one_of(0, 1, 1),
        loop_hz=loop_hz, rate_hz=rate_hz, told=told,
        motor_encoder_bits=int(rng.integers(14, 21)), link_encoder_bits=int(rng.integers(17, 21)),
        has_link_encoder=chance(0.5 if elastic else 0.25) or "link_encoder" in needs or seen_in_twist,
        has_command=chance(0.65) or seen_in_commands, has_velocity=chance(0.5), reference_columns=one_of(0, 1, 2),
        parquet=chance(0.5), mapped=chance(0.5),
        damage=one_of("scattered_nan", "nan_stretch", "missing_rows") if chance(0.15) else None,
    )  # fmt: skip


def plan(seed):
    """About a hundred cases, two fifths without a gap; over several seeds every effect has its turn."""
    rng = np.random.default_rng(seed)
    cases = []

    def add(rig, label, effects, engine="numba"):
        name = f"{'mujoco_' if engine == 'mujoco' else ''}{rig}_{label}"
        cases.append(drawn(seed, name, rig, effects, len(cases), engine))

    def add_without(rig, count, engine="numba"):
        for number in range(count):
            add(rig, f"none_{number:02}", [], engine)

    def add_each(rig, names, joints, count, engine="numba"):
        for name in rng.permutation(names)[:count].tolist():
            add(rig, name, [[name, int(rng.integers(joints)), STRONG]], engine)

    add_without("single", 24)
    for name in rng.permutation(LISTED)[:26].tolist():
        strength = (STRONG, MODERATE)[rng.integers(2)]
        add("single", f"{name}_{'strong' if strength == STRONG else 'moderate'}", [[name, 0, strength]])
    for number in range(4):
        pair = rng.choice([name for name in LISTED if name not in NOT_IN_PAIRS], 2, replace=False).tolist()
        add("single", f"pair_{number}", [[name, 0, STRONG] for name in without_contradiction(pair)])
    add_each("single", [name for name in UNLISTED if "neighbour" not in EFFECTS[name].needs], 1, 6)
    add_without("two", 8)
    add_each("two", IN_TWO, 2, 10)
    add_each("two", ("x_coupling", "x_bump"), 2, 2)
    add_without("six", 5)
    # the last wrist carries nothing
    add_each("six", IN_SIX, 5, 6)
    add_each("six", ("x_bump",), 5, 1)
    add_without("single", 3, "mujoco")
    add_each("single", IN_MUJOCO_ONE, 1, 3, "mujoco")
    add_without("six", 1, "mujoco")
    add_each("six", IN_MUJOCO_SIX, 4, 3, "mujoco")
    return cases


def without_contradiction(pair):
    """A delay needs a rigid gear: what is in the gear's twist stays alone then."""
    needs = [EFFECTS[name].needs for name in pair]
    both = any("rigid" in need for need in needs) and any("elastic" in need for need in needs)
    return pair[:1] if both else pair
