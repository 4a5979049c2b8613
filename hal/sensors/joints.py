"""What joint encoders and drives measure: angles, velocities, torques from currents."""

from __future__ import annotations

from ...blocks.signals import JointState
from .sensor import RosMessage, Sensor


class JointSensors(Sensor):
    """Encoders and current sensors in all drives of a robot. Who simulates the drives knows the true
    values, and their bus carries the readings, so there is nothing to mount."""

    kind = "joints"
    signal = JointState
    averaged = ("torque",)
    ros2 = RosMessage(
        "sensor_msgs/msg/JointState",
        {"position": "position", "velocity": "velocity", "torque": "effort"},
    )
