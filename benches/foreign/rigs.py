"""Arms of one, two and six joints drawn at random, and what a robot file of limited accuracy says of them."""

import copy
import math
from dataclasses import dataclass, field

import numpy as np

from simulator import Chain, JOINT, joint_parameters

GRAVITY_M_S2 = np.array([0.0, 0.0, -9.81])
# What the robot file does not know exactly, beside the links.
UNCERTAIN = ("rotor_inertia_kg_m2", "stiffness_nm_rad", "coulomb_nm", "viscous_nm_s_rad", "stribeck_nm")


@dataclass
class Link:
    """Frame in the parent's, axis, and a body with its inertia about its centre; named as its joint."""

    name: str
    origin_m: np.ndarray
    axis: np.ndarray
    mass_kg: float
    centre_m: np.ndarray
    inertia_kg_m2: np.ndarray
    rpy_rad: tuple = (0.0, 0.0, 0.0)


@dataclass
class Arm:
    """Links, joints and how the arm may move; then what effects put into its timing and sensing."""

    links: list
    joints: np.ndarray
    # per joint: how far from its centre and how fast it may swing
    reach_rad: list
    centre_rad: list
    speed_rad_s: list
    # per joint, rotor included, and the most that gravity asks
    inertia_kg_m2: list
    gravity_nm: list
    gravity_m_s2: np.ndarray = field(default_factory=GRAVITY_M_S2.copy)
    command_delay_s: float = 0.0
    sensor_delay_s: float = 0.0
    lost_commands: float = 0.0
    lost_samples: float = 0.0
    velocity_filter_hz: float | None = None
    # of the motor encoder, per joint: times the resolution of the robot file
    coarser: np.ndarray | None = None
    # per joint: the drive's limit as a share of the largest command of a run without it; zero for none
    limit_share: np.ndarray | None = None

    def __post_init__(self):
        count = len(self.links)
        self.coarser = np.ones(count) if self.coarser is None else self.coarser
        self.limit_share = np.zeros(count) if self.limit_share is None else self.limit_share

    def chain(self):
        column = lambda name: np.array([getattr(link, name) for link in self.links], dtype=float)
        rotation = np.array([rotation_of(*link.rpy_rad) for link in self.links])
        return Chain(
            column("origin_m"), rotation, column("axis"), column("mass_kg"), column("centre_m"), column("inertia_kg_m2")
        )

    def rotor_kg_m2(self):
        """Rotor inertias, joint side."""
        return self.joints["gear_ratio"] ** 2 * self.joints["rotor_inertia_kg_m2"]


def rotation_of(roll_rad, pitch_rad, yaw_rad):
    """Roll about x, then pitch about y, then yaw about z, of fixed axes."""
    cr, sr, cp, sp = math.cos(roll_rad), math.sin(roll_rad), math.cos(pitch_rad), math.sin(pitch_rad)
    cy, sy = math.cos(yaw_rad), math.sin(yaw_rad)
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def link(name, origin_m, axis, mass_kg, centre_m, diagonal_kg_m2, rpy_rad=(0.0, 0.0, 0.0)):
    vector = lambda values: np.array(values, dtype=float)
    inertia_kg_m2 = np.diag(diagonal_kg_m2).astype(float)
    return Link(name, vector(origin_m), vector(axis), mass_kg, vector(centre_m), inertia_kg_m2, rpy_rad)


def drawn_joint(gear_ratio, rotor_kg_m2, coulomb_nm, viscous_nm_s_rad):
    joint = joint_parameters()
    joint["gear_ratio"], joint["rotor_inertia_kg_m2"] = gear_ratio, rotor_kg_m2 / gear_ratio**2
    joint["coulomb_nm"], joint["viscous_nm_s_rad"] = coulomb_nm, viscous_nm_s_rad
    return joint


def make_elastic(joint, stiffness_nm_rad, damping_ratio, link_inertia_kg_m2):
    joint["stiffness_nm_rad"] = stiffness_nm_rad
    joint["damping_nm_s_rad"] = damping_ratio * math.sqrt(stiffness_nm_rad * link_inertia_kg_m2)


def one_joint(rng, elastic):
    """A pendulum, standing or hanging at zero."""
    gear_ratio = float(rng.choice([50, 80, 100, 120, 160]))
    mass_kg, length_m = rng.uniform(1.5, 5.0), rng.uniform(0.2, 0.45)
    own_kg_m2 = mass_kg * length_m**2 * rng.uniform(0.08, 0.3)
    rpy_rad = (math.pi, 0.0, 0.0) if rng.random() < 0.5 else (0.0, 0.0, 0.0)
    body = link("axis", (0, 0, 0.2), (0, 1, 0), mass_kg, (0, 0, length_m), (own_kg_m2, own_kg_m2, 0.002), rpy_rad)
    inertia_kg_m2 = mass_kg * length_m**2 + own_kg_m2
    rotor_kg_m2 = inertia_kg_m2 * rng.uniform(0.25, 1.2)
    gravity_nm = mass_kg * length_m * 9.81
    coulomb_nm, speed_rad_s = gravity_nm * rng.uniform(0.1, 0.3), rng.uniform(0.8, 1.8)
    joint = drawn_joint(gear_ratio, rotor_kg_m2, coulomb_nm, coulomb_nm / speed_rad_s * rng.uniform(0.2, 0.8))
    if elastic:
        make_elastic(joint, rng.uniform(200, 500) * gravity_nm, 0.02, inertia_kg_m2)
    reach_rad, centre_rad = rng.uniform(0.6, 1.2), rng.uniform(-0.3, 0.3)
    return Arm(
        [body], np.array([joint], JOINT), [reach_rad], [centre_rad], [speed_rad_s], [inertia_kg_m2 + rotor_kg_m2], [gravity_nm]
    )


def two_joints(rng, elastic):
    """Shoulder and elbow about parallel axes, gravity in their plane."""
    upper_kg, fore_kg = rng.uniform(4.0, 7.0), rng.uniform(1.5, 3.0)
    upper = (upper_kg * 0.02, upper_kg * 0.02, 0.004)
    fore = (fore_kg * 0.012, fore_kg * 0.012, 0.002)
    links = [
        link("shoulder", (0, 0, 0.3), (0, 1, 0), upper_kg, (0, 0, 0.25), upper),
        link("elbow", (0, 0.05, 0.4), (0, 1, 0), fore_kg, (0, 0, 0.2), fore),
    ]
    # stretched out
    inertia_kg_m2 = [upper_kg * 0.0825 + fore_kg * 0.6**2, fore_kg * 0.052]
    gravity_nm = [9.81 * (upper_kg * 0.25 + fore_kg * 0.6), 9.81 * fore_kg * 0.2]
    speed_rad_s, joints = [1.0, 1.4], []
    for i in range(2):
        gear_ratio, rotor_kg_m2 = float(rng.choice([80, 100, 120])), inertia_kg_m2[i] * rng.uniform(0.3, 0.8)
        coulomb_nm = gravity_nm[i] * rng.uniform(0.1, 0.25)
        viscous_nm_s_rad = coulomb_nm / speed_rad_s[i] * rng.uniform(0.2, 0.7)
        joints.append(drawn_joint(gear_ratio, rotor_kg_m2, coulomb_nm, viscous_nm_s_rad))
        if elastic:
            make_elastic(joints[i], rng.uniform(250, 500) * gravity_nm[i], 0.02, inertia_kg_m2[i])
        inertia_kg_m2[i] += rotor_kg_m2
    return Arm(links, np.array(joints, JOINT), [0.7, 0.9], [0.4, 0.5], speed_rad_s, inertia_kg_m2, gravity_nm)


def six_joints(rng, elastic):
    """Links as in the UR5's published URDF; rotors and friction of such an arm's size."""
    links = [
        link("shoulder_pan", (0, 0, 0.0892), (0, 0, 1), 3.7, (0, -0.0256, 0.0019), (0.0103, 0.0103, 0.0067)),
        link("shoulder_lift", (0, 0.1358, 0), (0, 1, 0), 8.393, (0, -0.02, 0.2125), (0.2269, 0.2269, 0.0151)),
        link("elbow", (0, -0.1197, 0.425), (0, 1, 0), 2.275, (0, 0.01, 0.196), (0.0494, 0.0494, 0.0041)),
        link("wrist1", (0, 0, 0.3923), (0, 1, 0), 1.219, (0, 0.093, 0), (0.0025, 0.0022, 0.0022)),
        link("wrist2", (0, 0.093, 0), (0, 0, 1), 1.219, (0, 0, 0.0947), (0.0025, 0.0025, 0.0022)),
        link("wrist3", (0, 0, 0.0947), (0, 1, 0), 0.4, (0.015, 0.06, 0), (0.0004, 0.0003, 0.0004)),
    ]
    inertia_kg_m2, gravity_nm = [2.0, 3.3, 0.9, 0.06, 0.05, 0.01], [10.0, 55.0, 18.0, 3.0, 2.0, 0.6]
    rotor_kg_m2 = [1.1, 1.1, 1.1, 0.25, 0.25, 0.25]
    coulomb_nm, viscous_nm_s_rad = [7.0, 8.0, 6.0, 2.2, 2.0, 1.8], [8.0, 9.0, 7.0, 1.6, 1.5, 1.4]
    stiffness_nm_rad, joints = [25e3, 25e3, 20e3, 6e3, 6e3, 5e3], []
    for i in range(6):
        rotor = rotor_kg_m2[i] * rng.uniform(0.8, 1.2)
        coulomb, viscous = coulomb_nm[i] * rng.uniform(0.8, 1.2), viscous_nm_s_rad[i] * rng.uniform(0.7, 1.2)
        joints.append(drawn_joint(101.0, rotor, coulomb, viscous))
        if elastic:
            make_elastic(joints[i], stiffness_nm_rad[i], 0.01, inertia_kg_m2[i])
        inertia_kg_m2[i] += rotor_kg_m2[i]
    reach_rad, centre_rad = [1.0, 0.6, 0.8, 1.0, 1.0, 1.2], [0.0, 0.3, 0.7, -0.4, 0.5, 0.0]
    speed_rad_s = [1.0, 0.8, 1.0, 1.5, 1.5, 1.5]
    return Arm(links, np.array(joints, JOINT), reach_rad, centre_rad, speed_rad_s, inertia_kg_m2, gravity_nm)


ARMS = {"single": one_joint, "two": two_joints, "six": six_joints}


def as_in_its_file(arm, tolerance, rng):
    """The arm as its robot file has it: each value off by the file's tolerance (one standard deviation, two at most)."""
    factor = lambda: 1.0 + tolerance * float(np.clip(rng.normal(), -2.0, 2.0))
    known = copy.deepcopy(arm)
    for body in known.links:
        body.mass_kg *= factor()
        body.centre_m = body.centre_m * np.array([factor(), factor(), factor()])
        body.inertia_kg_m2 = body.inertia_kg_m2 * factor()
    for joint in known.joints:
        for name in UNCERTAIN:
            joint[name] *= factor()
    return known


def add_payload(body, mass_kg, centre_m):
    """A point mass fixed to a link."""
    at = lambda mass_kg, off_m: mass_kg * (off_m @ off_m * np.eye(3) - np.outer(off_m, off_m))
    total_kg = body.mass_kg + mass_kg
    common_m = (body.mass_kg * body.centre_m + mass_kg * centre_m) / total_kg
    body.inertia_kg_m2 = (
        body.inertia_kg_m2 + at(body.mass_kg, body.centre_m - common_m) + at(mass_kg, centre_m - common_m)
    )
    body.mass_kg, body.centre_m = total_kg, common_m
