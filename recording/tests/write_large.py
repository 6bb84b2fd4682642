"""Writes a bag of 2 GB: pictures of 6 MB, and 150 000 joint states of seven joints, 50 MB, among them.

Usage: python3 write_large.py mcap|sqlite3|ros1 PATH
"""

import os
import sys

import numpy
import rosbags.rosbag1
import rosbags.rosbag2
from rosbags.typesys import Stores, get_typestore

kind, path = sys.argv[1:]
STATES = 150_000
STATES_PER_PICTURE = 480
if kind == "ros1":
    store = get_typestore(Stores.ROS1_NOETIC)
    writer = rosbags.rosbag1.Writer(path)
    serialize, extra = store.serialize_ros1, {"seq": 0}
else:
    store = get_typestore(Stores.ROS2_HUMBLE)
    writer = rosbags.rosbag2.Writer(path, version=9, storage_plugin=rosbags.rosbag2.StoragePlugin[kind.upper()])
    serialize, extra = store.serialize_cdr, {}
types = store.types
names = [f"robot_arm_axis_{number}_joint" for number in range(1, 8)]
pixels = numpy.frombuffer(os.urandom(1080 * 1920 * 3), "u1")
size = 0
with writer:
    states = writer.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=store)
    pictures = writer.add_connection("/camera/image_raw", "sensor_msgs/msg/Image", typestore=store)
    for row in range(STATES):
        now_ns = 1_700_000_000_000_000_000 + row * 1_000_000
        stamp = types["builtin_interfaces/msg/Time"](sec=now_ns // 1_000_000_000, nanosec=now_ns % 1_000_000_000)
        header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="", **extra)
        value = numpy.sin(row * 1e-3 + numpy.arange(7.0))
        state = types["sensor_msgs/msg/JointState"](header=header, name=names, position=value, velocity=value, effort=value)
        message = serialize(state, "sensor_msgs/msg/JointState")
        size += len(message)
        writer.write(states, now_ns, message)
        if row % STATES_PER_PICTURE == 0:
            picture = types["sensor_msgs/msg/Image"](
                header=header, height=1080, width=1920, encoding="rgb8", is_bigendian=0, step=5760, data=pixels
            )
            writer.write(pictures, now_ns, serialize(picture, "sensor_msgs/msg/Image"))
print(f"joint states: {size / 1e6:.1f} MB")
