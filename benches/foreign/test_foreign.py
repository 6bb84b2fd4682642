"""Laws that simulator and judge must hold: `benches/foreign/foreign test`."""

import dataclasses
import pathlib
import tempfile
import unittest

import mujoco
import numpy as np

import cases
import mujoco_engine
import plan
import score
from rigs import ARMS, GRAVITY_M_S2
from simulator import LUGRE, Control, Course, Disturbance, inverse_dynamics, set_mass_matrix, simulate, work_space


def case(**changes):
    """A clean one: one trajectory, all told, nothing damaged."""
    plain = plan.drawn(1, "test", "single", [], 1)
    clean = {"segments": 1, "damage": None, "rate_hz": 1000, "loop_hz": 1000, "duration_s": 6.0, "motion": "multisine"}
    clean |= {"effects": [], "elastic": False, "controller": 0, "feedforward": 1, "delay_cycles": 1, "has_link_encoder": True}
    return dataclasses.replace(plain, **clean | changes)


class InverseDynamics(unittest.TestCase):
    def test_is_mujoco_s(self):
        rng = np.random.default_rng(0)
        for rig in ARMS:
            arm = ARMS[rig](rng, False)
            arm.joints["rotor_inertia_kg_m2"] = arm.joints["viscous_nm_s_rad"] = arm.joints["coulomb_nm"] = 0.0
            model = mujoco_engine.model_of(arm, 1e-3)
            data, count = mujoco.MjData(model), len(arm.links)
            for _ in range(5):
                data.qpos[:], data.qvel[:], data.qacc[:] = moving = rng.normal(size=(3, count))
                mujoco.mj_inverse(model, data)
                torque_nm = np.zeros(count)
                inverse_dynamics(*moving, GRAVITY_M_S2, arm.chain(), work_space(count), torque_nm)
                np.testing.assert_allclose(torque_nm, data.qfrc_inverse, rtol=1e-9, atol=1e-9)


class Energy(unittest.TestCase):
    def test_what_the_drives_give_is_stored_or_lost(self):
        """Two elastic joints: work of the drives less friction and gear damping is kinetic, lifting and twist energy."""
        arm = ARMS["two"](np.random.default_rng(3), True)
        # a wave of the gear that an unfit lever arm would make energy from
        arm.joints["kinematic_error_rad"], arm.joints["kinematic_error_cycles"] = 1e-3, 2.0
        chain, joints, rotor_kg_m2 = arm.chain(), arm.joints, arm.rotor_kg_m2()
        outcome, loop_hz = free_run(arm, 4000.0, 2.0)
        work, mass_kg_m2, spare = work_space(2), np.zeros((2, 2)), np.zeros((2, 2))
        stored_j = []
        for link_rad, link_rad_s in zip(outcome.true_link_rad, outcome.true_link_rad_s, strict=True):
            set_mass_matrix(link_rad, chain, work, mass_kg_m2, *spare)
            stored_j.append(0.5 * link_rad_s @ mass_kg_m2 @ link_rad_s + lifted_j(arm, link_rad))
        wave_rad = 2.0 * joints["gear_ratio"] * outcome.true_motor_rad
        twist_rad = outcome.true_motor_rad + 1e-3 * np.sin(wave_rad) - outcome.true_link_rad
        lever = 1.0 + 1e-3 * 2.0 * joints["gear_ratio"] * np.cos(wave_rad)
        twist_rad_s = lever * outcome.true_motor_rad_s - outcome.true_link_rad_s
        stored_j += (0.5 * rotor_kg_m2 * outcome.true_motor_rad_s**2).sum(axis=1)
        stored_j += (0.5 * joints["stiffness_nm_rad"] * twist_rad**2).sum(axis=1)
        # what the drive makes in the cycle that ends at a row stands in that row; velocities at both ends
        mean_rad_s = 0.5 * (outcome.true_motor_rad_s[1:] + outcome.true_motor_rad_s[:-1])
        given_w = outcome.true_drive_motor_nm[1:] * joints["gear_ratio"] * mean_rad_s
        lost_w = outcome.true_friction_nm * outcome.true_motor_rad_s + joints["damping_nm_s_rad"] * twist_rad_s**2
        given_j = np.cumsum(given_w.sum(axis=1)) / loop_hz
        lost_j = np.cumsum(0.5 * (lost_w[1:] + lost_w[:-1]).sum(axis=1)) / loop_hz
        self.assertGreater(lost_j[-1], 1.0)
        np.testing.assert_allclose(stored_j[1:] - stored_j[0], given_j - lost_j, atol=0.01 * lost_j[-1])

    def test_friction_never_adds_any(self):
        for bristles in (0.0, LUGRE):
            arm = ARMS["single"](np.random.default_rng(4), False)
            arm.joints["bristles"] = bristles
            outcome, _ = free_run(arm, 1000.0, 4.0)
            power_w = outcome.true_friction_nm * outcome.true_motor_rad_s
            # bristles give back what bending them took, no more
            self.assertGreater(np.cumsum(power_w).min(), -1e-3 * power_w.max())


def lifted_j(arm, link_rad):
    """Of both links of the two-joint arm, which swing about y from upright."""
    upper, fore = arm.links
    first_rad, second_rad = link_rad[0], link_rad[0] + link_rad[1]
    height_m = upper.centre_m[2] * np.cos(first_rad)
    fore_m = fore.origin_m[2] * np.cos(first_rad) + fore.centre_m[2] * np.cos(second_rad)
    return 9.81 * (upper.mass_kg * height_m + fore.mass_kg * fore_m)


def free_run(arm, loop_hz, duration_s):
    """Exact encoders, no noise, PD with the weight held."""
    count, rows = len(arm.links), int(loop_hz * duration_s)
    time_s = np.arange(rows) / loop_hz
    angle_rad = 2.0 * np.pi * time_s[:, None] * np.ones(count)
    reference = (0.3 * np.sin(angle_rad), 0.6 * np.pi * np.cos(angle_rad), np.zeros((rows, count)))
    course = Course(time_s, *reference, np.arange(rows) == 0)
    inertia_kg_m2 = np.array(arm.inertia_kg_m2)
    gains = (100.0 * inertia_kg_m2, 10.0 * inertia_kg_m2)
    control = Control(1, 0, *gains, 0.0, 0, arm.chain(), arm.gravity_m_s2, arm.joints)
    nothing = np.zeros(count)
    disturbance = Disturbance(0.0, 0.0, np.zeros(rows, bool), np.zeros((rows, count)), nothing, nothing)
    return simulate(loop_hz, course, arm.joints, arm.chain(), arm.gravity_m_s2, control, disturbance), loop_hz


class TorqueBalance(unittest.TestCase):
    def test_of_a_case_between_reversals(self):
        """Recorded torque less what the true bodies, rotor and friction take: noise, where nothing else was put in."""
        made = case(bristles=False, stribeck_in_file=False, drive_lag_s=0.0, told="all")
        known, arm, course, _, sensors, _, outcome, *_ = cases.make(made)
        velocity_rad_s = outcome.true_link_rad_s
        # over 20 ms, about the cycle whose torque a row holds
        width = 20
        mean = lambda values: np.convolve(values[:, 0], np.ones(width) / width, "valid")
        acceleration_rad_s2 = (velocity_rad_s[width:, 0] - velocity_rad_s[:-width, 0]) * made.loop_hz / width
        asked_nm = []
        for k, rad_s2 in enumerate(acceleration_rad_s2):
            torque_nm, middle = np.zeros(1), k + width // 2
            state = (outcome.true_link_rad[middle], velocity_rad_s[middle], np.array([rad_s2]))
            inverse_dynamics(*state, arm.gravity_m_s2, arm.chain(), work_space(1), torque_nm)
            asked_nm.append(torque_nm[0] + arm.rotor_kg_m2()[0] * rad_s2)
        drive_nm = mean(outcome.drive_torque_motor_nm[1:] * arm.joints["gear_ratio"])
        left_nm = drive_nm - mean(outcome.true_friction_nm[1:]) - asked_nm
        speed_rad_s = np.array([np.abs(velocity_rad_s[k : k + width]).min() for k in range(len(left_nm))])
        noise_nm = sensors[0]["torque_noise_nm"] * arm.joints["gear_ratio"][0] / np.sqrt(width)
        self.assertLess(np.sqrt(np.mean(left_nm[speed_rad_s > 0.05] ** 2)), 1.5 * noise_nm)


class Cases(unittest.TestCase):
    def test_same_seed_same_bytes(self):
        changes = {"damage": "missing_rows", "segments": 2, "mapped": True, "effects": [["coulomb_friction", 0, 1.0]]}
        for parquet in (False, True):
            made = case(parquet=parquet, **changes)
            with tempfile.TemporaryDirectory() as first, tempfile.TemporaryDirectory() as second:
                written = [pathlib.Path(folder) / "case" for folder in (first, second)]
                for folder in written:
                    self.assertIsNone(cases.write(made, folder))
                for path in written[0].iterdir():
                    self.assertEqual(path.read_bytes(), (written[1] / path.name).read_bytes(), path.name)

    def test_a_seed_is_about_a_hundred_cases_two_fifths_without_a_gap(self):
        for seed in (1, 99):
            planned = plan.plan(seed)
            without = sum(not planned_case.effects for planned_case in planned) / len(planned)
            self.assertEqual(len({planned_case.name for planned_case in planned}), len(planned))
            self.assertTrue(95 <= len(planned) <= 110 and 0.35 <= without <= 0.45)

    def test_true_changes_are_against_the_robot_file(self):
        known, arm, *_, truth = cases.make(case(effects=[["coulomb_friction", 0, 1.0]]))
        change_nm = arm.joints[0]["coulomb_nm"] - known.joints[0]["coulomb_nm"]
        self.assertAlmostEqual(truth[0]["parameters"]["coulomb_nm"], change_nm)

    def test_a_law_has_in_common_with_names_what_its_shape_says(self):
        """A cube over speeds up to its largest is nearer to a square than to a line, and nothing like a spring."""
        *_, (law,) = cases.make(case(effects=[["x_cubic", 0, 1.0]]))
        common = law["in_common"]
        self.assertGreater(common["quadratic_friction"], common["viscous_friction"])
        self.assertGreater(common["viscous_friction"], common["coulomb_friction"])
        self.assertGreater(common["quadratic_friction"], 0.9)
        self.assertLess(common["joint_spring"], 0.3)
        *_, (wall,) = cases.make(case(effects=[["x_wall", 0, 1.0]]))
        self.assertGreater(wall["in_common"]["joint_spring"], wall["in_common"]["viscous_friction"])

    def test_a_second_trajectory_knows_nothing_of_the_first(self):
        """A delay reaches back to its own trajectory's beginning only."""
        _, _, course, *_, outcome, _, _ = cases.make(case(effects=[["sensor_delay", 0, 1.0]], segments=2, duration_s=8.0))
        (second,) = np.flatnonzero(course.begins)[1:]
        seen_rad = outcome.link_position_rad[second : second + 5, 0]
        np.testing.assert_allclose(seen_rad, course.position_rad[second, 0], atol=1e-3)


def report(*joints, shared=()):
    return {"joints": list(joints), "shared_effects": [{"effect": name} for name in shared]}


def joint(verdict, *names, name="axis", share=1.0, confusable=()):
    said = [{"effect": effect, "probability": 0.9, "share": share, "parameters": {}} for effect in names]
    pairs = [{"effects": list(pair)} for pair in confusable]
    return {"joint": name, "verdict": verdict, "effects": said, "confusable": pairs}


def truth(*names, at="axis", shared=False):
    return {"effects": [{"effect": name, "joint": at, "shared": shared, "parameters": {}} for name in names]}


class Judge(unittest.TestCase):
    def check(self, wanted, true, told):
        self.assertEqual(score.judge(true, told), wanted)

    def test_without_a_gap(self):
        self.check("right", truth(), report(joint("no_gap")))
        self.check("right", truth(), report(joint("insufficient_data")))
        self.check("wrong", truth(), report(joint("unexplained")))
        self.check("wrong", truth(), report(joint("no_gap"), shared=["payload"]))
        self.check("failed", truth(), None)

    def test_one_effect(self):
        true = truth("coulomb_friction")
        self.check("right", true, report(joint("explained", "coulomb_friction")))
        self.check("more", true, report(joint("explained", "coulomb_friction", "torque_offset")))
        self.check("wrong", true, report(joint("explained", "viscous_friction")))
        self.check("unexplained", true, report(joint("unexplained")))
        self.check("missed", true, report(joint("no_gap")))
        self.check("unsure", true, report(joint("insufficient_data")))
        other = joint("explained", "coulomb_friction", name="elbow")
        self.check("wrong", true, report(joint("no_gap"), other))

    def test_alike(self):
        self.check("right", truth("command_delay"), report(joint("explained", "sensor_delay")))
        self.check("right", truth("base_tilt"), report(joint("explained", "gravity_torque")))
        self.check("wrong", truth("gravity_torque"), report(joint("explained", "base_tilt")))
        on_two = report(joint("explained", "gravity_torque"), joint("no_gap", name="elbow"))
        self.check("wrong", truth("base_tilt", shared=True), on_two)

    def test_ambiguous_needs_the_true_name_in_the_set(self):
        pair = [("torque_offset", "asymmetric_friction")]
        told = report(joint("ambiguous", "asymmetric_friction", confusable=pair))
        self.check("right", truth("torque_offset"), told)
        self.check("wrong", truth("payload"), told)

    def test_shared(self):
        true = truth("payload", at="elbow", shared=True)
        quiet = [joint("no_gap"), joint("no_gap", name="elbow")]
        self.check("right", true, report(*quiet, shared=["payload"]))
        self.check("right", true, report(joint("explained", "payload"), quiet[1]))
        self.check("wrong", true, report(*quiet, shared=["base_tilt"]))

    def test_pair(self):
        true = truth("payload", "coulomb_friction")
        self.check("right", true, report(joint("explained", "coulomb_friction", "payload")))
        self.check("half", true, report(joint("explained", "coulomb_friction", "torque_offset")))

    def test_on_no_list(self):
        true = truth("x_wall")
        true["effects"][0]["in_common"] = {"joint_spring": 0.6}
        self.check("right", true, report(joint("unexplained")))
        self.check("right", true, report(joint("partly_explained", "joint_spring", share=0.69)))
        self.check("wrong", true, report(joint("partly_explained", "joint_spring", share=0.71)))
        self.check("right", true, report(joint("partly_explained", "payload", share=0.09)))
        self.check("wrong", true, report(joint("partly_explained", "payload", share=0.11)))
        self.check("missed", true, report(joint("no_gap")))
        of_arm = report(joint("explained"), shared=["payload"])
        of_arm["shared_effects"][0]["joint_shares"] = {"axis": {"share": 0.8}}
        self.check("wrong", true, of_arm)

    def test_parameters(self):
        true = truth("torque_constant_error")
        true["effects"][0]["parameters"] = {"gain": 1.1}
        told = report(joint("explained", "torque_constant_error"))
        told["joints"][0]["effects"][0]["parameters"] = {"gain": {"value": 1.12, "std": 0.02, "at_bound": False}}
        (value,) = score.parameters(true, told)
        self.assertAlmostEqual(value["relative_error"], 0.2)
        self.assertTrue(value["within"])

    def test_wilson(self):
        share, low, high = score.wilson(8, 10)
        self.assertAlmostEqual(share, 0.8)
        self.assertAlmostEqual(low, 0.4902, places=4)
        self.assertAlmostEqual(high, 0.9433, places=4)


if __name__ == "__main__":
    unittest.main()
