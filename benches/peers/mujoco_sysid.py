"""Fits a joint's friction and armature with the system identification of the package mujoco, as its README does it.

    mujoco_sysid.py ROBOT.toml FIT.csv HELD_OUT.csv STEP_S even|weighed RESULT.json

Its default optimiser, its default residual, one thread. What is compared is the joint's state: MuJoCo's position sensor shows the
position one step before, which a fit takes for less inertia and viscous friction. `weighed` gives rows near reversals, where
MuJoCo's friction has no spring before it slips, the weight that Flexspline gives them. Time begins with the data in memory and includes building the
model; every call of the residual is noted with its instant, and afterwards run on the held-out log.
"""

import sys

import mujoco
import numpy as np
from mujoco import sysid
from mujoco.sysid._src import signal_modifier

import signals

# Joint side: a generous box around what a joint of this size may have.
LOWEST = [0.0, 0.0, 0.01]
HIGHEST = [10.0, 10.0, 1.0]
NAMES = ["frictionloss", "damping", "armature"]


def model_spec(joint, step_s):
    coulomb_nm, viscous_nm_s_rad, armature_kg_m2 = joint.nominal()
    inertia = joint.inertia_kg_m2
    return mujoco.MjSpec.from_string(f"""
<mujoco>
  <option timestep="{step_s}" gravity="0 0 {-joint.gravity_m_s2}"/>
  <worldbody>
    <body name="link">
      <inertial pos="0 0 {-joint.centre_m}" mass="{joint.mass_kg}" diaginertia="{inertia} {inertia} {inertia}"/>
      <joint name="joint" type="hinge" axis="0 -1 0" limited="false"
        frictionloss="{coulomb_nm}" damping="{viscous_nm_s_rad}" armature="{armature_kg_m2}"/>
    </body>
  </worldbody>
  <actuator>
    <position name="servo" joint="joint" kp="{joint.stiffness_nm_rad}" kv="{joint.damping_nm_s_rad}"/>
  </actuator>
</mujoco>""")


def control(log, model):
    """The goal at the model's own steps. The package spreads a control over whole steps from its first to its last instant:
    were these no whole number of steps apart, the simulation would run ahead of the log by up to a step."""
    steps = int(log.time_s[-1] / model.opt.timestep)
    # a whole number must not be rounded up
    time_s = (1.0 - 1e-9) * model.opt.timestep * np.arange(steps + 1)
    goal_rad = np.interp(time_s, log.time_s, log.goal_rad)
    return sysid.TimeSeries.from_control_names(time_s, goal_rad[:, None], model)


def sequences(spec, logs):
    model = spec.compile()
    series = sysid.TimeSeries
    return sysid.ModelSequences(
        name="joint",
        spec=spec,
        sequence_name=[f"log{k}" for k in range(len(logs))],
        initial_state=[
            sysid.create_initial_state(model, log.position_rad[:1], log.velocity_rad_s[:1]) for log in logs
        ],
        control=[control(log, model) for log in logs],
        sensordata=[series.from_names(log.time_s, log.position_rad[:, None], model, ["joint_qpos"]) for log in logs],
        allow_missing_sensors=True,
    )


def set_of(name):
    def modify(spec, parameter):
        attribute = getattr(spec.joint("joint"), name)
        if np.ndim(attribute):
            attribute[0] = parameter.value[0]
        else:
            setattr(spec.joint("joint"), name, parameter.value[0])

    return modify


def parameters(joint):
    found = sysid.ParameterDict()
    for name, nominal, low, high in zip(NAMES, joint.nominal(), LOWEST, HIGHEST, strict=True):
        found.add(sysid.Parameter(name, nominal, low, high, modifier=set_of(name)))
    return found


def weighed(log):
    """The default residual of one sequence, times the weights of its rows."""
    weights = signals.reversal_weights(log)

    def modify(params, predicted, measured, model, return_pred_all, state=None, **_):
        predicted = sysid.TimeSeries(state[:, 0], state[:, 1:2], measured.signal_mapping)
        measured = signal_modifier.apply_delayed_ts_window(measured, predicted, 0.0, 0.0)
        predicted = predicted.resample(measured.times)
        left = signal_modifier.weighted_diff(predicted_data=predicted.data, measured_data=measured.data, model=model)
        left = signal_modifier.normalize_residual(left, measured.data)
        return left * np.interp(measured.times, log.time_s, weights)[:, None], predicted, measured

    return modify


def main():
    robot, fit, held_out, step_s, rows, result = sys.argv[1:]
    joint = signals.read_joint(robot)
    fit, held_out = signals.read_log(fit, joint), signals.read_log(held_out, joint)
    trace, rollouts = [], 0
    clock = signals.Clock()
    start = parameters(joint)
    options = {"modify_residual": weighed(fit)} if rows == "weighed" else {}
    fitted = sequences(model_spec(joint, step_s), [fit])
    residual = sysid.build_residual_fn(models_sequences=[fitted], n_threads=1, **options)

    def noted(x, *rest, **options):
        nonlocal rollouts
        answer = residual(x, *rest, **options)
        columns = 1 if x.ndim == 1 else x.shape[1]
        rollouts += columns
        if columns == 1:
            cost = float(np.sum(np.square(np.concatenate(answer[0]))))
            values = [float(value) for value in np.ravel(x)]
            trace.append({"seconds": clock.seconds(), "runs": rollouts, "cost": cost, "values": values})
        return answer

    found, _ = sysid.optimize(initial_params=start, residual_fn=noted, optimizer="mujoco", verbose=False)
    seconds, wall_seconds = clock.seconds(), clock.wall_seconds()

    check = sysid.build_residual_fn(
        models_sequences=[sequences(model_spec(joint, step_s), [held_out])], n_threads=1, return_pred_all=True
    )

    def own_error_rad(values):
        _, predicted, _ = check(np.array(values), start)
        series = predicted[0][0]
        recorded = np.interp(series.times, held_out.time_s, held_out.position_rad)
        return signals.rms_after_start(series.times, series.data[:, 0] - recorded)

    trace = signals.improvements(trace)
    for entry in trace:
        entry["own_error_rad"] = own_error_rad(entry["values"])
    signals.write(
        result,
        name=f"mujoco {mujoco.__version__} sysid, step {1000 * float(step_s):.3g} ms, rows {rows}",
        seconds=seconds,
        wall_seconds=wall_seconds,
        runs=rollouts,
        values=[float(value) for value in found.as_vector()],
        trace=trace,
    )


if __name__ == "__main__":
    main()
