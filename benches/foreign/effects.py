"""What a plant may have that its robot file lacks: each function puts one effect into an arm and returns its true parameters.

Names and parameters are those of Flexspline's reports; a parameter is the change against the robot file where the file has
such a value. Names that begin with `x_` are laws on no list: there the right answer is that nobody knows.
"""

import math
from dataclasses import dataclass

import numpy as np

from rigs import GRAVITY_M_S2, Arm, add_payload, rotation_of

EFFECTS = {}


@dataclass
class Effect:
    """How an effect is put in, and what a case must have for it to be there at all."""

    apply: object
    # one cause that several joints see
    whole_arm: bool
    needs: tuple


def effect(*needs, whole_arm=False):
    """Adds a function to the table. `elastic`: it is in the gear's twist; `rigid`: an elastic joint's loop would shake;
    `link_encoder`: it is that encoder's; `dwells`: it grows while the joint rests; `neighbour`: another joint causes it."""

    def add(function):
        EFFECTS[function.__name__] = Effect(function, whole_arm, needs)
        return function

    return add


@dataclass
class Site:
    """A joint that gets an effect. Strength 1 is plain to see, 0.4 moderate."""

    arm: Arm
    file: Arm
    index: int
    strength: float
    duration_s: float
    stribeck_exponent: int
    rng: np.random.Generator

    def __post_init__(self):
        self.joint, self.file_joint = self.arm.joints[self.index], self.file.joints[self.index]
        self.coulomb_nm, self.gear_ratio = float(self.joint["coulomb_nm"]), float(self.joint["gear_ratio"])
        self.speed_rad_s = self.arm.speed_rad_s[self.index]
        self.reach_rad, self.centre_rad = self.arm.reach_rad[self.index], self.arm.centre_rad[self.index]
        self.gravity_nm = self.arm.gravity_nm[self.index]
        if len(self.arm.links) == 6:  # its wrists carry next to nothing
            self.gravity_nm = max(self.gravity_nm, 3.0 * self.coulomb_nm)
        self.sign = int(self.rng.choice([-1, 1]))

    def phase_rad(self):
        return self.rng.uniform(-3.0, 3.0)

    def changed(self, name):
        """By how much the plant's value is off the file's."""
        return float(self.joint[name] - self.file_joint[name])

    def set(self, **values):
        for name, value in values.items():
            self.joint[name] = value

    def add(self, name, value):
        self.joint[name] += value


@effect()
def coulomb_friction(site):
    more = 1.0 if site.rng.random() < 0.7 else -1.0
    site.add("coulomb_nm", 0.4 * more * site.strength * site.coulomb_nm)
    return {"coulomb_nm": site.changed("coulomb_nm")}


@effect()
def viscous_friction(site):
    usual = max(float(site.joint["viscous_nm_s_rad"]), 0.5 * site.coulomb_nm / site.speed_rad_s)
    site.add("viscous_nm_s_rad", 0.8 * site.strength * usual)
    return {"viscous_nm_s_rad": site.changed("viscous_nm_s_rad")}


@effect()
def quadratic_friction(site):
    quadratic = site.strength * site.coulomb_nm / site.speed_rad_s**2
    site.set(quadratic_nm_s2_rad2=quadratic)
    return {"quadratic_nm_s2_rad2": quadratic}


@effect()
def stribeck_friction(site):
    stribeck_nm, velocity_rad_s = 0.5 * site.strength * site.coulomb_nm, site.rng.uniform(0.03, 0.1) * site.speed_rad_s
    exponent = site.stribeck_exponent
    site.set(stribeck_nm=stribeck_nm, stribeck_velocity_rad_s=velocity_rad_s, stribeck_exponent=exponent)
    # with another exponent than the reports' law the values mean something else
    return {"stribeck_nm": stribeck_nm, "stribeck_velocity_rad_s": velocity_rad_s} if exponent == 1 else {}


@effect()
def asymmetric_friction(site):
    asymmetry_nm = 0.25 * site.strength * site.coulomb_nm * site.sign
    site.set(asymmetry_nm=asymmetry_nm)
    return {"asymmetry_nm": asymmetry_nm}


@effect()
def load_dependent_friction(site):
    site.set(load_coefficient=0.12 * site.strength)
    return {"load_coefficient": 0.12 * site.strength}


@effect()
def position_dependent_friction(site):
    amplitude_nm, cycles = 0.25 * site.strength * site.coulomb_nm, float(site.rng.choice([1, 2]))
    site.set(friction_wave_nm=amplitude_nm, friction_wave_cycles=cycles, friction_wave_phase_rad=site.phase_rad())
    return {"amplitude_nm": amplitude_nm, "cycles_per_motor_rev": cycles}


@effect("elastic")
def kinematic_error(site):
    amplitude_rad, cycles = 1e-3 * site.strength, 2.0
    site.set(kinematic_error_rad=amplitude_rad, kinematic_error_cycles=cycles, kinematic_error_phase_rad=site.phase_rad())
    return {"amplitude_rad": amplitude_rad, "cycles_per_motor_rev": cycles}


@effect("elastic")
def torsional_compliance(site):
    site.add("stiffness_nm_rad", -0.45 * site.strength * float(site.joint["stiffness_nm_rad"]))
    return {"stiffness_nm_rad": site.changed("stiffness_nm_rad")}


@effect("elastic")
def soft_windup(site):
    low_nm_rad = (0.3 if site.strength == 1.0 else 0.55) * float(site.joint["stiffness_nm_rad"])
    site.set(low_stiffness_nm_rad=low_nm_rad, knee_nm=0.3 * site.gravity_nm)
    return {"low_stiffness_nm_rad": low_nm_rad, "knee_nm": 0.3 * site.gravity_nm}


@effect("elastic")
def torsional_hysteresis(site):
    width_nm = 0.25 * site.strength * site.gravity_nm
    yield_rad = 0.3 * site.gravity_nm / float(site.joint["stiffness_nm_rad"])
    site.set(hysteresis_nm=0.5 * width_nm, hysteresis_yield_rad=yield_rad)
    return {"width_nm": width_nm, "yield_rad": yield_rad}


@effect("elastic")
def structural_damping(site):
    # of a gear that twists as fast as a third of the load does it four times a swing
    twist_rad_s = 1.2 * site.speed_rad_s * site.gravity_nm / float(site.joint["stiffness_nm_rad"])
    damping_nm = 0.15 * site.strength * site.gravity_nm / math.sqrt(twist_rad_s)
    site.set(structural_damping_nm=damping_nm, structural_damping_exponent=0.5)
    return {"damping_nm_s_rad": damping_nm, "exponent": 0.5}


@effect("elastic")
def backlash(site):
    site.set(backlash_rad=2.5e-3 * site.strength)
    return {"gap_rad": 2.5e-3 * site.strength}


@effect()
def thermal_friction_drift(site):
    change_nm = -0.4 * site.strength * site.coulomb_nm
    if site.rng.random() < 0.5:
        site.set(friction_drift_nm_s=change_nm / site.duration_s)
        return {"drift_nm_s": change_nm / site.duration_s}
    site.set(friction_change_nm=change_nm, friction_change_s=8.0)
    return {"change_nm": change_nm, "time_constant_s": 8.0}


@effect()
def torque_constant_error(site):
    gain = 1.0 + 0.15 * site.strength * site.sign
    site.set(torque_gain=gain)
    return {"gain": gain}


@effect()
def torque_offset(site):
    offset_nm = 0.3 * site.strength * site.coulomb_nm * site.sign
    site.set(torque_offset_nm=offset_nm)
    return {"offset_nm": offset_nm}


@effect()
def torque_ripple(site):
    amplitude_motor_nm = 0.25 * site.strength * site.coulomb_nm / site.gear_ratio
    cycles = float(site.rng.choice([1, 4, 6]))
    site.set(ripple_motor_nm=amplitude_motor_nm, ripple_cycles=cycles, ripple_phase_rad=site.phase_rad())
    return {"amplitude_nm": amplitude_motor_nm, "cycles_per_motor_rev": cycles}


@effect()
def torque_saturation(site):
    # the limit itself follows from a run without it
    site.arm.limit_share[site.index] = 0.75 if site.strength == 1.0 else 0.88
    return {}


@effect()
def current_loop_lag(site):
    site.set(drive_lag_s=6e-3 * site.strength)
    return {"time_constant_s": 6e-3 * site.strength}


@effect(whole_arm=True)
def payload(site):
    body = site.arm.links[-1]
    mass_kg = 0.2 * site.strength * sum(near.mass_kg for near in site.arm.links[-2:])
    centre_m = 1.5 * body.centre_m + np.array([0.0, 0.0, 0.05])
    add_payload(body, mass_kg, centre_m)
    return {"mass_kg": mass_kg}


@effect()
def link_inertia(site):
    inertia_kg_m2 = 0.35 * site.strength * site.arm.inertia_kg_m2[site.index]
    site.set(added_link_inertia_kg_m2=inertia_kg_m2)
    return {"inertia_kg_m2": inertia_kg_m2}


@effect()
def rotor_inertia(site):
    site.add("rotor_inertia_kg_m2", 0.6 * site.strength * float(site.joint["rotor_inertia_kg_m2"]))
    return {"inertia_kg_m2": site.changed("rotor_inertia_kg_m2")}


@effect()
def gravity_torque(site):
    sin_nm, cos_nm = 0.15 * site.strength * site.gravity_nm * site.sign, 0.05 * site.strength * site.gravity_nm
    site.set(gravity_sin_nm=sin_nm, gravity_cos_nm=cos_nm)
    return {"sin_nm": sin_nm, "cos_nm": cos_nm}


@effect()
def joint_spring(site):
    stiffness_nm_rad = 0.25 * site.strength * site.gravity_nm / site.reach_rad
    rest_rad = site.rng.uniform(-0.3, 0.3)
    site.set(spring_nm_rad=stiffness_nm_rad, spring_rest_rad=rest_rad)
    return {"stiffness_nm_rad": stiffness_nm_rad, "rest_rad": rest_rad}


@effect(whole_arm=True)
def base_tilt(site):
    roll_rad, pitch_rad = 0.06 * site.strength * site.sign, 0.05 * site.strength
    site.arm.gravity_m_s2 = rotation_of(roll_rad, pitch_rad, 0.0).T @ GRAVITY_M_S2
    # one joint about y feels no roll
    return {"pitch_rad": pitch_rad} if len(site.arm.links) == 1 else {"roll_rad": roll_rad, "pitch_rad": pitch_rad}


@effect()
def encoder_offset(site):
    site.set(encoder_offset_rad=0.06 * site.strength * site.sign)
    return {"offset_rad": 0.06 * site.strength * site.sign}


@effect("elastic", "link_encoder")
def encoder_eccentricity(site):
    amplitude_rad, cycles = 3e-3 * site.strength, 8.0
    site.set(eccentricity_rad=amplitude_rad, eccentricity_cycles=cycles, eccentricity_phase_rad=site.phase_rad())
    return {"amplitude_rad": amplitude_rad, "cycles_per_rev": cycles}


@effect()
def encoder_quantisation(site):
    # the resolution itself follows from the robot file's
    site.arm.coarser[site.index] = 64.0 if site.strength == 1.0 else 16.0
    return {}


@effect("rigid", whole_arm=True)
def velocity_filter_lag(site):
    site.arm.velocity_filter_hz = 12.0 if site.strength == 1.0 else 30.0
    return {"cutoff_hz": site.arm.velocity_filter_hz}


@effect("rigid", whole_arm=True)
def command_delay(site):
    site.arm.command_delay_s = 6e-3 * site.strength
    return {"delay_s": site.arm.command_delay_s}


@effect("rigid", whole_arm=True)
def sensor_delay(site):
    site.arm.sensor_delay_s = 6e-3 * site.strength
    return {"delay_s": site.arm.sensor_delay_s}


@effect(whole_arm=True)
def dropped_commands(site):
    site.arm.lost_commands = 0.25 * site.strength
    return {"fraction": site.arm.lost_commands}


@effect(whole_arm=True)
def dropped_samples(site):
    site.arm.lost_samples = 0.15 * site.strength
    return {"fraction": site.arm.lost_samples}


@effect()
def x_wall(site):
    """A cushion on one side of the range."""
    stiffness_nm_rad = 1.5 * site.strength * site.gravity_nm / site.reach_rad
    site.set(wall_nm_rad=stiffness_nm_rad, wall_at_rad=site.centre_rad + 0.4 * site.reach_rad)
    return {}


@effect()
def x_vibration(site):
    site.set(vibration_nm=0.3 * site.strength * site.coulomb_nm, vibration_hz=site.rng.uniform(2.0, 6.0))
    return {}


@effect()
def x_bump(site):
    """More friction near one angle."""
    at_rad = site.centre_rad + 0.2 * site.reach_rad
    site.set(bump_nm=0.7 * site.strength * site.coulomb_nm, bump_at_rad=at_rad, bump_width_rad=0.12)
    return {}


@effect()
def x_step(site):
    """Friction that jumps in the midst of the recording."""
    site.set(friction_step_nm=0.5 * site.strength * site.coulomb_nm, friction_step_s=0.55 * site.duration_s)
    return {}


@effect("dwells")
def x_ageing(site):
    """Friction that grows with the logarithm of the time at rest."""
    site.set(ageing_nm=0.2 * site.strength * site.coulomb_nm, ageing_s=0.1)
    return {}


@effect()
def x_cubic(site):
    site.set(cubic_nm_s3_rad3=0.6 * site.strength * site.coulomb_nm / site.speed_rad_s**3)
    return {}


@effect("neighbour")
def x_coupling(site):
    """A torque that follows another joint's angle."""
    site.set(coupling_nm=0.2 * site.strength * site.gravity_nm)
    return {}


UNLISTED = tuple(name for name in EFFECTS if name.startswith("x_"))
LISTED = tuple(name for name in EFFECTS if name not in UNLISTED)
