"""A driver as a process of its own, in Python: joints that follow the commanded velocity.

    pip install iceoryx2==0.10.0
    cargo run --release -- run --driver process --control velocity --rate 500 &
    python examples/process_driver.py default

What comes is `drive/command`, what is owed for each is one `drive/sample`: that of the next cycle. Python needs 0.1 to
0.3 ms for it, so let the loop be slower than 1.5 kHz. The process ends when no command has come for two seconds.
"""

import ctypes
import json
import math
import os
import sys
import time

import iceoryx2 as iox2

JOINTS_MAX = 16
PerJoint = ctypes.c_double * JOINTS_MAX
NumberPerJoint = ctypes.c_uint32 * JOINTS_MAX
# As shm-types/src/messages.rs and drive.rs have them.
VELOCITY, ENABLE, SWITCHED_OFF, ENABLED = 3, 1, 2, 4
WATCHDOG_S, GONE_S = 0.02, 2.0


def structure(name: str, fields: list) -> type:
    """A message of a fixed layout, under the name that the other languages know it by."""
    return type(name, (ctypes.Structure,), {"_fields_": fields, "type_name": staticmethod(lambda: name)})


Header = structure(
    "FlexsplineHeader",
    [(name, ctypes.c_uint64) for name in ("session", "cycle", "measured_at_ns", "joint_count")],
)
Command = structure(
    "FlexsplineDriveCommand",
    [
        ("header", Header),
        ("mode", ctypes.c_uint32),
        ("request", ctypes.c_uint32),
        ("motor_torque_nm", PerJoint),
        ("joint_velocity_rad_s", PerJoint),
        ("joint_mode", NumberPerJoint),
        ("joint_position_rad", PerJoint),
        ("position_gain_scale", PerJoint),
        ("velocity_gain_scale", PerJoint),
    ],
)
READINGS = (
    "motor_position_rad",
    "motor_velocity_rad_s",
    "link_position_rad",
    "link_velocity_rad_s",
    "motor_torque_nm",
    "joint_torque_nm",
    "motor_current_a",
    "temperature_c",
)
DRIVES = (
    "state",
    "mode",
    "status_word",
    "error_code",
    "device_status",
    "age_cycles",
    "warnings",
    "position_validity",
)
Sample = structure(
    "FlexsplineDriveSample",
    [("header", Header)]
    + [(name, PerJoint) for name in READINGS]
    + [(name, ctypes.c_uint32) for name in ("commands_missed", "drive_mode", "inputs", "reserved")]
    + [(name, NumberPerJoint) for name in DRIVES]
    + [("supply_voltage_v", PerJoint)]
    + [(name, ctypes.c_uint32) for name in ("clock", "faults", "working_counter_expected", "working_counter")]
    + [("clock_offset_ns", ctypes.c_int64), ("frames_lost", ctypes.c_uint64), ("jitter_ns", ctypes.c_uint64)],
)


def opened(open_it):
    """The loop makes its topics when it starts."""
    give_up_at = time.monotonic() + 10.0
    while True:
        try:
            return open_it()
        except Exception:
            if time.monotonic() > give_up_at:
                raise
            time.sleep(0.01)


def main() -> int:
    name = sys.argv[1] if len(sys.argv) > 1 else "default"
    directory = f"/tmp/flexspline-{os.geteuid()}/{name}"
    with open(f"{directory}/run.json") as file:
        run = json.load(file)
    # Motor turns per joint turn, of the robots that come with Flexspline: take yours from your robot file.
    ratios = [{"shd17": 100.0}.get(run["robot"], 50.0)] * len(run["initial_position_rad"])
    iox2.set_log_level(iox2.LogLevel.Error)
    config = iox2.config.from_file(iox2.FilePath.new(f"{directory}/iceoryx2.toml"))
    node = iox2.NodeBuilder.new().config(config).create(iox2.ServiceType.Ipc)

    def service(topic):
        return node.service_builder(iox2.ServiceName.new(topic))

    commands = opened(lambda: service("drive/command").publish_subscribe(Command).open())
    samples = opened(lambda: service("drive/sample").publish_subscribe(Sample).open())
    ready = opened(lambda: service("drive/sample/ready").event().open())
    subscriber = commands.subscriber_builder().create()
    publisher = samples.publisher_builder().create()
    notifier = ready.notifier_builder().create()

    position = [rad * ratio for rad, ratio in zip(run["initial_position_rad"], ratios)]
    velocity, enabled = [0.0] * len(position), False
    cycles, heard = 0, time.monotonic()
    while cycles == 0 or time.monotonic() - heard < GONE_S:
        message = subscriber.receive()
        if message is None:
            if time.monotonic() - heard > WATCHDOG_S:
                velocity, enabled = [0.0] * len(position), False
            time.sleep(0.0001)
            continue
        command = message.payload().contents
        heard = time.monotonic()
        # The loop's first command tells its clock: the sample of that very cycle is owed for it.
        ahead = 0 if cycles == 0 and command.header.cycle == 0 else 1
        position = [p + v * run["period_ns"] * 1e-9 * ahead for p, v in zip(position, velocity)]
        enabled = command.mode == VELOCITY and (enabled or command.request == ENABLE)
        asked = command.joint_velocity_rad_s
        velocity = [
            asked[joint] * ratio if enabled and math.isfinite(asked[joint]) else 0.0
            for joint, ratio in enumerate(ratios)
        ]
        sample = Sample()
        sample.header = command.header
        sample.header.cycle += ahead
        sample.header.measured_at_ns += ahead * run["period_ns"]
        sample.drive_mode = command.mode
        for reading in READINGS:
            getattr(sample, reading)[:] = [math.nan] * JOINTS_MAX
        for joint in range(len(position)):
            sample.motor_position_rad[joint] = position[joint]
            sample.motor_velocity_rad_s[joint] = velocity[joint]
            sample.state[joint] = ENABLED if enabled else SWITCHED_OFF
        message.delete()
        publisher.loan_uninit().write_payload(sample).send()
        notifier.notify()
        cycles += 1
    print("drove", cycles, "cycles")
    return 0


if __name__ == "__main__":
    sys.exit(main())
