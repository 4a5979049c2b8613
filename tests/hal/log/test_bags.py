"""ROS 2 bags, MCAP files and recordings of aloft as logs: columns by topic and field, each with the clock of its headers."""

from __future__ import annotations

import numpy as np
import pytest

import aloft
from aloft.hal.log.log_file import LogError, read_log
from aloft.hal.log.parameters import LogParameters
from aloft.hal.log.played_log import play
from aloft.robots.description import find_robot

from ...cli.conftest import run_here

rosbags = pytest.importorskip("rosbags")
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
JOINTS = [joint.name for joint in find_robot("bruce").joints]
COUNT, PERIOD, LATE = 200, 0.005, 0.02
"""Messages arrive so late at most that their arrival is another clock than their headers'."""


def write_bag(folder, plugin, *, swap=False, frame="base"):
    """Write a bag with an IMU at rest and joints that turn by 0.1 rad/s times their number."""
    types = STORE.types
    time_type, header_type = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    vector, four = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    nothing = np.zeros(9)
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        imu = writer.add_connection("/imu/data", "sensor_msgs/msg/Imu", typestore=STORE)
        joints = writer.add_connection(
            "/joint_states", "sensor_msgs/msg/JointState", typestore=STORE
        )
        for k in range(COUNT):
            time = PERIOD * k
            stamp = time_type(sec=10 + int(time), nanosec=round(1e9 * (time % 1.0)))
            header = header_type(stamp=stamp, frame_id=frame)
            arrival = round(1e9 * (10.0 + time + LATE / 8 * (k % 2)))
            message = types["sensor_msgs/msg/Imu"](
                header, four(0.0, 0.0, 0.0, 1.0), nothing, vector(0.01 * k, 0.0, 0.0), nothing,
                vector(0.0, 0.0, 9.81), nothing,
            )  # fmt: skip
            writer.write(imu, arrival, STORE.serialize_cdr(message, "sensor_msgs/msg/Imu"))
            names = JOINTS[::-1] if swap and k > 100 else JOINTS
            message = types["sensor_msgs/msg/JointState"](
                header, names, 0.1 * time * np.arange(len(JOINTS)), 0.1 * np.arange(len(JOINTS)),
                np.zeros(len(JOINTS)),
            )  # fmt: skip
            writer.write(
                joints, arrival, STORE.serialize_cdr(message, "sensor_msgs/msg/JointState")
            )
    return folder


@pytest.fixture(params=["sqlite", "mcap", "mcap file"])
def bag(request, tmp_path):
    plugin = StoragePlugin.SQLITE3 if request.param == "sqlite" else StoragePlugin.MCAP
    folder = write_bag(tmp_path / "bag", plugin)
    return next(folder.glob("*.mcap")) if request.param == "mcap file" else folder


def test_a_bag_has_a_column_for_each_field_and_the_clock_of_its_headers(bag):
    log = read_log(bag)
    rates = log.array("imu_data.angular_velocity")
    assert rates.values[:, 0] == pytest.approx(0.01 * np.arange(COUNT))
    assert rates.stamps == pytest.approx(PERIOD * np.arange(COUNT), abs=1e-9)
    assert log.array("imu_data.linear_acceleration[2]").values[:, 0] == pytest.approx(9.81)
    assert log.texts["joint_states.name"] == JOINTS
    assert log.array("joint_states.position").values.shape == (COUNT, len(JOINTS))


def test_bytes_of_a_bag_are_from_0_to_255(tmp_path):
    numbers = [0, 127, 128, 200, 255]
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kinds = {
            each: f"std_msgs/msg/{each}" for each in ("Byte", "Char", "Int8", "ByteMultiArray")
        }
        topics = {
            each: writer.add_connection(f"/{each}", kinds[each], typestore=STORE) for each in kinds
        }
        for k, number in enumerate(numbers):
            for each in ("Byte", "Char", "Int8"):
                writer.write(topics[each], k, bytes([0, 1, 0, 0, number]))
            many = bytes([0, 1, 0, 0, *(0,) * 8, 2, 0, 0, 0, number, 255])
            writer.write(topics["ByteMultiArray"], k, many)
    log = read_log(tmp_path / "bag")
    for topic in ("Byte", "Char"):
        assert log.array(f"{topic}.data").values[:, 0].tolist() == numbers
    assert log.array("Int8.data").values[:, 0].tolist() == [0, 127, -128, -56, -1]
    assert log.array("ByteMultiArray.data").values.tolist() == [[each, 255] for each in numbers]


def test_a_bag_plays_the_robot(bag):
    result = aloft.load({
        "rate": "100 Hz", "robot": "bruce",
        "blocks": {"robot": {"use": "hal.LogRobot", "with": {
            "file": str(bag),
            "imu": {"angular_velocity": "imu_data.angular_velocity",
                    "specific_force": "imu_data.linear_acceleration"},
            "joints": {"names": "joint_states.name", "position": "joint_states.position",
                       "velocity": "joint_states.velocity"},
        }}},
    }).run()  # fmt: skip
    assert result.success
    places = result.signal("robot.joints.position")[:-1]  # a run ends a tick behind the log
    time = 0.01 * np.arange(len(places))
    assert places == pytest.approx(0.1 * time[:, None] * np.arange(len(JOINTS)), abs=1e-9)
    assert result.metrics["log_jitter"] < 1e-3


def test_a_bag_says_in_which_frame_its_imu_measures(tmp_path):
    folder = write_bag(tmp_path / "bag", StoragePlugin.MCAP, frame="left_calf")
    given = {"file": "bag", "imu": {"angular_velocity": "imu_data.angular_velocity",
                                    "specific_force": "imu_data.linear_acceleration"}}  # fmt: skip
    robot = find_robot("bruce")
    played = play(read_log(folder), LogParameters.model_validate(given), robot, 0.01)
    warning = "the IMU's messages are in the frame left_calf, and it is played at torso: imu.link: left_calf"
    assert warning in played.warnings
    given["imu"]["link"] = "left_calf"
    played = play(read_log(folder), LogParameters.model_validate(given), robot, 0.01)
    assert warning not in played.warnings


def test_joints_that_change_their_order_are_refused(tmp_path):
    folder = write_bag(tmp_path / "bag", StoragePlugin.MCAP, swap=True)
    log = read_log(folder)
    assert log.array("imu_data.angular_velocity").values.shape == (COUNT, 3)
    text = r"joint_states\.name changes from message to message, in row 101 first"
    with pytest.raises(LogError, match=text):
        log.array("joint_states.position")


@pytest.mark.long
def test_a_recording_of_aloft_plays_the_robot_again(tmp_path):
    bag = write_bag(tmp_path / "bag", StoragePlugin.MCAP)
    graph = (
        "rate: 100 Hz\nrobot: bruce\nblocks:\n  robot:\n    use: hal.LogRobot\n    with:\n"
        f"      file: {bag}\n      joints: {{names: joint_states.name, position: joint_states.position}}\n"
    )
    (tmp_path / "first.yaml").write_text(graph)
    recording = tmp_path / "first.rrd"
    run_here("run", str(tmp_path / "first.yaml"), "--record", str(recording))
    log = read_log(recording)
    assert log.array("robot.joints.position").values.shape[1] == len(JOINTS)
    again = aloft.load({
        "rate": "100 Hz", "robot": "bruce",
        "blocks": {"robot": {"use": "hal.LogRobot", "with": {
            "file": str(recording), "joints": {"position": "robot.joints.position"},
        }}},
    }).run()  # fmt: skip
    first = aloft.load(graph).run().signal("robot.joints.position")
    second = again.signal("robot.joints.position")
    assert second[: len(first)] == pytest.approx(first, abs=1e-12)
    assert len(second) == len(first) + 1
