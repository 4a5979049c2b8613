"""The channels of a recording that have ROS 2's types, for MCAP files and bags: ``/tf``, ``/joint_states``,
``/imu``, the mounted sensors and the forces on the feet."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial

import numpy as np

from ...hal.sensors.sensor import RosMessage
from ...logs.exporting.export import WORLD, Channel, Timed
from ...logs.file.format import RecordedRows, nanoseconds
from ...logs.file.reader import RecordedRun
from ...logs.viewing.drawing import Moments
from ...logs.viewing.scene_ports import IMU, JOINTS, ScenePorts, port_of, ports_of, scene_ports
from ...logs.viewing.scene_sensors import sensor_ports
from ...mathematics.rotations import quaternions_of_matrices
from ...robots.robot_description import RobotDescription
from .codec import Codec, MessageType

PICTURE_RATE = 100.0
"""Poses a second in ``/tf`` [Hz]: more than an eye sees."""
DISTRIBUTION = "jazzy"
"""The distribution of ROS 2 whose messages are written."""
IMU_TYPE, WRENCH_TYPE = "sensor_msgs/msg/Imu", "geometry_msgs/msg/WrenchStamped"


def ros_channels(run: RecordedRun, robot: RobotDescription) -> list[Channel]:
    """Return the channels for which the recording of a robot has signals."""
    channels: list[Channel] = []
    ports = ports_of(run.header)
    joints, sensor = port_of(ports, JOINTS), port_of(ports, IMU)
    if joints is not None:
        channels.append(_ros("/joint_states", _joint_codec(robot), partial(_joints, joints)))
    if sensor is not None:
        codec = _codec(IMU_TYPE, {"frame_id": robot.base}, _IMU_FIELDS)
        numbers = {"angular_velocity": "angular_velocity", "specific_force": "linear_acceleration"}
        channels.append(_ros("/imu", codec, partial(_numbers, sensor, numbers)))
    for port, mounted in sensor_ports(robot, ports).items():
        if mounted.ros2 is not None:
            codec, fields = _sensor_codec(mounted.ros2, mounted.link)
            channels.append(_ros(f"/{mounted.name}", codec, partial(_numbers, port, fields)))
    drawn = scene_ports(run.header)
    if drawn is not None:
        names = [link.name for link in robot.links]
        texts = {"frame_id": WORLD, "transforms.child_frame_id": names}
        codec = _codec("tf2_msgs/msg/TFMessage", texts, sizes={"transforms": len(names)})
        channels.append(_ros("/tf", codec, partial(_poses, drawn, robot)))
        if drawn.contact_force is not None and drawn.contact_position is not None:
            codec = _codec(WRENCH_TYPE, {"frame_id": WORLD})
            for k, foot in enumerate(robot.feet):
                messages = partial(_wrench, drawn, [i == k for i in robot.foot_of_contact()])
                channels.append(_ros(f"/wrench/{foot.name}", codec, messages))
    return channels


_IMU_FIELDS = (
    "orientation", "orientation_covariance", "angular_velocity", "linear_acceleration",
)  # fmt: skip
_NO_ORIENTATION = {
    "orientation": np.array([0.0, 0.0, 0.0, 1.0]),
    "orientation_covariance": np.array([-1.0, *[0.0] * 8]),  # ROS 2's sign for none
}


def _codec(
    name: str,
    texts: Mapping[str, str | Sequence[str]],
    fields: Sequence[str] = (),
    sizes: Mapping[str, int] | None = None,
) -> Codec:
    return Codec(MessageType(name, DISTRIBUTION, sizes or {}, fields), {}, texts)


def _joint_codec(robot: RobotDescription) -> Codec:
    names = [joint.name for joint in robot.joints]
    kind = MessageType("sensor_msgs/msg/JointState", DISTRIBUTION, {})
    return Codec(kind, {"n_joints": len(names)}, {"name": names})


def _sensor_codec(message: RosMessage, frame: str) -> tuple[Codec, Mapping[str, str]]:
    """Return the codec of a mounted sensor, whose numbers are in the axes of its link, and the
    names in the message of its signal's fields."""
    fields = {field: path.replace(".", "_") for field, path in message.fields.items()}
    shown = _IMU_FIELDS if message.type == IMU_TYPE else tuple(fields.values())
    return _codec(message.type, {"frame_id": frame}, shown), fields


def _ros(
    topic: str, codec: Codec, messages: Callable[[Codec, RecordedRows], Iterator[Timed]]
) -> Channel:
    name = codec.type.name
    definition, _ = codec.type.store.generate_msgdef(name, ros_version=2)
    return Channel(topic, name, "cdr", "ros2msg", definition, (), partial(messages, codec))


def _instants(batch: RecordedRows) -> list[int]:
    found: list[int] = nanoseconds(batch.header.base_rate, batch.ticks).tolist()
    return found


def _joints(port: str, codec: Codec, batch: RecordedRows) -> Iterator[Timed]:
    fields = {"position": "position", "velocity": "velocity", "torque": "effort"}
    return _numbers(port, fields, codec, batch)


def _numbers(
    port: str, fields: Mapping[str, str], codec: Codec, batch: RecordedRows
) -> Iterator[Timed]:
    """Yield a message a tick with the ``fields`` of a port, each with its name in the message."""
    values = {name: batch.signal(f"{port}.{field}") for field, name in fields.items()}
    rest = _NO_ORIENTATION if codec.type.name == IMU_TYPE else {}
    for k, instant in enumerate(_instants(batch)):
        row = {name: value[k] for name, value in values.items()}
        yield instant, codec.write({**rest, **row}, instant)


def _wrench(
    ports: ScenePorts, on_foot: list[bool], codec: Codec, batch: RecordedRows
) -> Iterator[Timed]:
    """Yield the force on a foot and its torque about the middle of the foot's contact points."""
    assert ports.contact_force is not None and ports.contact_position is not None
    force = batch.signal(ports.contact_force)[:, on_foot]
    place = batch.signal(ports.contact_position)[:, on_foot]
    arm = place - place.mean(axis=1, keepdims=True)
    torques = np.cross(arm, force).sum(axis=1)
    for instant, total, torque in zip(_instants(batch), force.sum(axis=1), torques, strict=True):
        yield instant, codec.write({"wrench_force": total, "wrench_torque": torque}, instant)


def _poses(
    ports: ScenePorts, robot: RobotDescription, codec: Codec, batch: RecordedRows
) -> Iterator[Timed]:
    every = max(1, round(batch.header.base_rate / PICTURE_RATE))
    due = np.flatnonzero(batch.ticks % every == 0)
    poses = Moments(batch, due, []).poses(robot, ports.pose)
    instants = nanoseconds(batch.header.base_rate, batch.ticks[due]).tolist()
    turns = quaternions_of_matrices(poses.rotation)
    for k, instant in enumerate(instants):
        values = {
            "transforms_transform_translation": poses.position[k],
            "transforms_transform_rotation": turns[k],
        }
        yield instant, codec.write(values, instant)
