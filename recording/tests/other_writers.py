"""Writes a ROS 2 bag with the reference packages (mcap, mcap-ros2-support): joint states and tool poses."""

import math
import sys

from mcap_ros2.writer import Writer

HEADER = """
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
"""
POSE_STAMPED = """std_msgs/Header header
geometry_msgs/Pose pose
================================================================================
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
================================================================================
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
================================================================================
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""

with open(sys.argv[1], "wb") as stream:
    writer = Writer(stream)
    states = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE + HEADER)
    poses = writer.register_msgdef("geometry_msgs/msg/PoseStamped", POSE_STAMPED + HEADER)
    for k in range(1000):
        ns = 1_700_000_000_000_000_000 + k * 4_000_000
        header = {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": "base_link"}
        names, q = ["elbow", "shoulder"], [math.sin(k * 0.01), math.cos(k * 0.01)]
        state = {"header": header, "name": names, "position": q, "velocity": [k, -k], "effort": []}
        writer.write_message("/joint_states", states, state, log_time=ns, publish_time=ns)
        if k % 5 == 0 or k == 999:
            pose = {
                "position": {"x": k * 0.001, "y": 2.0, "z": 3.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            }
            writer.write_message("/tool", poses, {"header": header, "pose": pose}, log_time=ns, publish_time=ns)
    writer.finish()
