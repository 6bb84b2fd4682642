"""Reads the sample topic of a running instance from Python and prints ten samples.

    pip install iceoryx2==0.10.0
    cargo run --release -- run &
    python examples/observe.py default

The middleware's version must be the one Flexspline is built with. Observers attach to the relay's topics
("observe/..."): however many there are, and however slow, the loop does not notice.
"""

import ctypes
import os
import sys
import time

import iceoryx2 as iox2

JOINTS_MAX = 16
PerJoint = ctypes.c_double * JOINTS_MAX


class Header(ctypes.Structure):
    _fields_ = [
        ("session", ctypes.c_uint64),
        ("cycle", ctypes.c_uint64),
        ("measured_at_ns", ctypes.c_uint64),
        ("joint_count", ctypes.c_uint64),
    ]


class Readings(ctypes.Structure):
    """SI; motor_ before the gear, link_ and joint_ after it; NaN where the robot has no such signal."""

    _fields_ = [
        (name, PerJoint)
        for name in (
            "motor_position_rad",
            "motor_velocity_rad_s",
            "link_position_rad",
            "link_velocity_rad_s",
            "motor_torque_nm",
            "joint_torque_nm",
            "motor_current_a",
            "temperature_c",
        )
    ]


class SensorSample(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("motion_time_ns", ctypes.c_uint64),
        ("motion_rate", ctypes.c_double),
        ("state", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("readings", Readings),
    ]

    @staticmethod
    def type_name() -> str:
        return "FlexsplineSensorSample"


def main() -> int:
    name = sys.argv[1] if len(sys.argv) > 1 else "default"
    iox2.set_log_level(iox2.LogLevel.Error)
    config_file = f"/tmp/flexspline-{os.geteuid()}/{name}/iceoryx2.toml"
    config = iox2.config.from_file(iox2.FilePath.new(config_file))
    node = iox2.NodeBuilder.new().config(config).create(iox2.ServiceType.Ipc)
    service = (
        node.service_builder(iox2.ServiceName.new("observe/sample")).publish_subscribe(SensorSample).open()
    )
    subscriber = service.subscriber_builder().create()
    printed, give_up_at = 0, time.monotonic() + 10.0
    while printed < 10:
        if time.monotonic() > give_up_at:
            print(f"no sample from instance `{name}` within 10 s", file=sys.stderr)
            return 1
        message = subscriber.receive()
        if message is None:
            time.sleep(0.02)
            continue
        sample = message.payload().contents
        joints = sample.header.joint_count
        print("cycle", sample.header.cycle, "motor_position_rad", list(sample.readings.motor_position_rad[:joints]))
        printed += 1
        message.delete()
    return 0


if __name__ == "__main__":
    sys.exit(main())
