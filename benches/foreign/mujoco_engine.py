"""MuJoCo in the place of our plant: its rigid bodies, its integrator and its friction loss under the same controller."""

import mujoco
import numpy as np

from simulator import STEPS_PER_S, Filter, Outcome, compute_command, rounded, set_velocity, work_space

# Friction loss is a constraint that MuJoCo softens: here as stiff as its steps allow.
FRICTION_STEPS = 4.0
FRICTION_IMPEDANCE = (0.95, 0.999, 0.001, 0.5, 2.0)


def model_of(arm, step_s):
    text = lambda values: " ".join(repr(float(value)) for value in values)
    bodies = ""
    for link, joint, rotor_kg_m2 in zip(arm.links, arm.joints, arm.rotor_kg_m2(), strict=True):
        inertia = link.inertia_kg_m2
        upper = [inertia[a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        bodies += (
            f'<body pos="{text(link.origin_m)}" euler="{text(link.rpy_rad)}">'
            f'<joint name="{link.name}" type="hinge" axis="{text(link.axis)}" armature="{rotor_kg_m2}"'
            f' frictionloss="{joint["coulomb_nm"]}" damping="{joint["viscous_nm_s_rad"]}"/>'
            f'<inertial pos="{text(link.centre_m)}" mass="{link.mass_kg}" fullinertia="{text(upper)}"/>'
        )
    motors = "".join(f'<motor joint="{link.name}"/>' for link in arm.links)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian" eulerseq="XYZ"/>'
        f'<option timestep="{step_s!r}" gravity="{text(arm.gravity_m_s2)}" integrator="implicitfast" cone="elliptic"/>'
        f"<worldbody>{bodies}{'</body>' * len(arm.links)}</worldbody><actuator>{motors}</actuator></mujoco>"
    )
    model.dof_solref[:] = FRICTION_STEPS * step_s, 1.0
    model.dof_solimp[:] = FRICTION_IMPEDANCE
    return model


def simulate(loop_hz, course, arm, control, disturbance):
    """As `simulator.simulate`, for rigid gears and what MuJoCo has: friction, rotors, bodies, and torques on the joint."""
    rows, n = course.position_rad.shape
    substeps = int(np.ceil(STEPS_PER_S / loop_hz))
    model = model_of(arm, 1.0 / (loop_hz * substeps))
    data = mujoco.MjData(model)
    outcome = Outcome(*np.zeros((len(Outcome._fields), rows, n)))
    low_pass, work, torque_nm, sum_rad = Filter(*np.zeros((3, n))), work_space(n), np.zeros(n), np.zeros(n)
    ratio, gain, offset_nm = arm.joints["gear_ratio"], arm.joints["torque_gain"], arm.joints["torque_offset_nm"]
    spring_nm_rad, rest_rad = arm.joints["spring_nm_rad"], arm.joints["spring_rest_rad"]
    first_row = 0
    for k in range(rows):
        if course.begins[k]:
            first_row = k
            data.qpos[:], data.qvel[:] = course.position_rad[k], 0.0
            mujoco.mj_forward(model, data)
            drive_motor_nm = data.qfrc_bias / ratio
            sum_rad[:] = 0.0
        for i in range(n):
            seen_motor_rad = data.qpos[i] * ratio[i]
            outcome.motor_position_rad[k, i] = rounded(seen_motor_rad, disturbance.motor_resolution_rad[i])
            outcome.link_position_rad[k, i] = rounded(data.qpos[i], disturbance.link_resolution_rad[i])
        outcome.true_link_rad[k] = outcome.true_motor_rad[k] = data.qpos
        outcome.true_link_rad_s[k] = outcome.true_motor_rad_s[k] = data.qvel
        outcome.true_drive_motor_nm[k] = drive_motor_nm
        outcome.drive_torque_motor_nm[k] = drive_motor_nm + disturbance.torque_noise_motor_nm[k]
        measured_rad = outcome.motor_position_rad[k] / ratio
        set_velocity(low_pass, measured_rad, loop_hz, control.velocity_filter_hz, course.begins[k])
        outcome.motor_velocity_rad_s[k] = low_pass.output_rad_s * ratio
        compute_command(control, course, k, loop_hz, measured_rad, low_pass.output_rad_s, sum_rad, work, torque_nm)
        outcome.command_torque_motor_nm[k] = torque_nm / ratio
        acting = k - control.delay_cycles
        if acting >= first_row:
            drive_motor_nm = outcome.command_torque_motor_nm[acting]
        for _ in range(substeps):
            made_nm = drive_motor_nm * ratio * gain + offset_nm
            data.ctrl[:] = made_nm - spring_nm_rad * (data.qpos - rest_rad)
            mujoco.mj_step(model, data)
    return outcome
