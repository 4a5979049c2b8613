"""Message types become signals with units and frames; hashes are those that ROS 2 publishes."""

import pytest

from aloft.ros2.message_types import MessageType
from aloft.runtime.language.errors import BlockError

pytest.importorskip("rosbags")


def fields(name: str, **sizes: int | str) -> dict[str, tuple[object, ...]]:
    signal = MessageType(name, "jazzy", sizes).signal
    return {
        name: (field.shape, str(field.unit) if field.unit else None, field.frame)
        for name, field in signal.fields.items()
    }


def test_units_and_frames_are_those_of_the_type() -> None:
    assert fields("sensor_msgs/JointState") == {
        "position": (("n_joints",), "rad", None),
        "velocity": (("n_joints",), "rad/s", None),
        "effort": (("n_joints",), "N m", None),
    }
    imu = fields("sensor_msgs/msg/Imu")
    assert imu["angular_velocity"] == ((3,), "rad/s", "body")
    assert imu["linear_acceleration"] == ((3,), "m/s^2", "body")
    assert imu["orientation"][0] == (4,) and "orientation_covariance" not in imu
    chosen = MessageType("sensor_msgs/Imu", "jazzy", {}, ["orientation_covariance"]).signal
    assert list(chosen.fields) == ["orientation_covariance"]
    with pytest.raises(BlockError, match="has no field 'turn'; its fields are orientation,"):
        MessageType("sensor_msgs/Imu", "jazzy", {}, ["turn"])
    assert fields("geometry_msgs/msg/WrenchStamped")["wrench_force"] == ((3,), "N", "world")
    tf = fields("tf2_msgs/msg/TFMessage", transforms=2)
    assert tf["transforms_transform_translation"] == ((2, 3), "m", "world")
    assert tf["transforms_transform_rotation"][0] == (2, 4)
    assert fields("geometry_msgs/msg/Twist")["linear"] == ((3,), "m/s", "body")
    assert fields("std_msgs/msg/Float64MultiArray", data=4) == {"data": ((4,), None, None)}
    signal = MessageType("std_msgs/msg/Bool", "jazzy", {}).signal
    assert signal.fields["data"].dtype_name == "bool" and signal.fields["data"].shape == ()
    assert MessageType("rosgraph_msgs/msg/Clock", "jazzy", {}).leaves == ()


@pytest.mark.parametrize(
    ("name", "found"),
    [
        # of rmw_zenoh's design document
        ("std_msgs/msg/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
        ("std_msgs/msg/Bool", "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9"),
    ],
)
def test_hashes(name: str, found: str) -> None:
    from aloft.ros2.message_types import type_store

    assert type_store("jazzy").hash_rihs01(name) == f"RIHS01_{found}"
    if name.endswith("Bool"):
        assert MessageType(name, "jazzy", {}).hash == f"RIHS01_{found}"


@pytest.mark.parametrize(
    ("name", "sizes", "text"),
    [
        ("sensor_msgs/msg/JointStates", {}, "the nearest are sensor_msgs/msg/JointState"),
        ("sensor_msgs/msg/Imu", {"x": 3}, "has no list 'x'; its lists are none"),
        ("std_msgs/msg/String", {}, "has no numbers, so it is no signal"),
        ("geometry_msgs/msg/Polygon", {}, "has no numbers without sizes: {points: ...}"),
    ],
)
def test_what_is_no_signal(name: str, sizes: dict[str, int | str], text: str) -> None:
    with pytest.raises(BlockError) as caught:
        MessageType(name, "jazzy", sizes)
    assert text in str(caught.value)


def test_a_distribution_that_is_not_known() -> None:
    with pytest.raises(BlockError, match="does not know ROS 2 jazzi; it knows dashing, eloquent"):
        MessageType("std_msgs/msg/Bool", "jazzi", {})
