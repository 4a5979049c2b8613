"""Bags as robots write them: messages of their own, pictures, several senders, packed, cut off; read right, or refused by topic."""

from __future__ import annotations

import numpy as np
import pytest

from aloft.hal.log.log_file import LogError, read_log

rosbags = pytest.importorskip("rosbags")
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(get_types_from_msg("float32 q\nint8 mode", "quadruped/msg/Motor"))
STORE.register(get_types_from_msg("string name\nfloat64 q", "quadruped/msg/Part"))
STORE.register(get_types_from_msg("Part[] parts", "quadruped/msg/Parts"))
STORE.register(get_types_from_msg("Motor[3] motors\nfloat32[3] gyro\nuint32 tick\nfloat64[] more\nstring note", "quadruped/msg/State"))  # fmt: skip
TYPES = STORE.types
NUMBER = "std_msgs/msg/Float64"
MS = 10**6


def header(ns, frame=""):
    stamp = TYPES["builtin_interfaces/msg/Time"](ns // 10**9, ns % 10**9)
    return TYPES["std_msgs/msg/Header"](stamp, frame)


def number(value):
    return TYPES[NUMBER](float(value))


def write(folder, messages, plugin=StoragePlugin.MCAP, packed=None):
    """Write a bag of (topic, type, arrival [ns], message)."""
    writer = Writer(folder / "bag", version=9, storage_plugin=plugin)
    if packed is not None:
        writer.set_compression(packed, CompressionFormat.ZSTD)
    with writer:
        made = {}
        for topic, kind, arrival, message in messages:
            if topic not in made:
                made[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(made[topic], arrival, STORE.serialize_cdr(message, kind))
    return folder / "bag"


def states(count=5):
    motor = TYPES["quadruped/msg/Motor"]
    for k in range(count):
        motors = [motor(q=k + 0.25 * j, mode=j) for j in range(3)]
        gyro = np.array([k, 0, 0], np.float32)
        state = TYPES["quadruped/msg/State"](motors, gyro, k, np.zeros(k % 2), "fine")
        yield "/low/state", "quadruped/msg/State", k * MS, state


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_messages_of_a_robots_own(tmp_path, plugin):
    log = read_log(write(tmp_path, states(), plugin))
    assert log.array("low_state.motors.q").values[2].tolist() == [2.0, 2.25, 2.5]
    assert log.array("low_state.motors.q[1]").values[:, 0].tolist() == [
        0.25,
        1.25,
        2.25,
        3.25,
        4.25,
    ]
    assert log.array("low_state.gyro").values.shape == (5, 3)
    assert log.array("low_state.tick").stamps == pytest.approx(1e-3 * np.arange(5))
    for name, why in {"more": "is empty in row 4", "note": "is text"}.items():
        with pytest.raises(LogError, match=f"low_state.{name} {why}"):
            log.array(f"low_state.{name}")


@pytest.mark.parametrize("packed", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_bags_that_are_packed(tmp_path, packed):
    log = read_log(write(tmp_path, states(), StoragePlugin.SQLITE3, packed))
    assert log.array("low_state.tick").values[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_parts_that_change_their_order_are_refused(tmp_path):
    part, kind = TYPES["quadruped/msg/Part"], "quadruped/msg/Parts"

    def bag(name, swap):
        messages = [("/ok", NUMBER, k * MS, number(k)) for k in range(5)]
        for k in range(5):
            parts = [part(name="hip", q=1.0), part(name="knee", q=2.0)]
            messages.append(("/p", kind, k * MS, TYPES[kind](parts[::-1] if k == swap else parts)))
        (tmp_path / name).mkdir()
        return read_log(write(tmp_path / name, messages))

    same = bag("same", 99)
    assert same.array("p.parts.q").values[4].tolist() == [1.0, 2.0]
    assert same.texts["p.parts.name"] == ["hip", "knee"]
    text = r"p\.parts is not of the same parts all along: p\.parts\.name changes .* in row 3"
    with pytest.raises(LogError, match=text):
        bag("swapped", 3).array("p.parts.q")
    (tmp_path / "a.bag").mkdir()
    with pytest.raises(LogError, match=r"a\.bag is a folder that is called like a file of ROS 1: rename it"):  # fmt: skip
        read_log(tmp_path / "a.bag")


def test_topics_whose_names_differ_by_a_line_are_apart(tmp_path):
    messages = [(topic, NUMBER, k * MS, number(sign * k)) for k in range(3) for topic, sign in (("/a/b", 1), ("/a_b", -1))]  # fmt: skip
    log = read_log(write(tmp_path, messages))
    assert log.array("a/b.data").values[:, 0].tolist() == [0.0, 1.0, 2.0]
    assert log.array("a_b.data").values[:, 0].tolist() == [0.0, -1.0, -2.0]


def test_what_is_no_column_of_a_topic_is_said_and_the_others_are_read(tmp_path):
    vector = TYPES["geometry_msgs/msg/Vector3"](1.0, 2.0, 3.0)
    layout = TYPES["std_msgs/msg/MultiArrayLayout"]([], 0)
    messages = []
    for k in range(4):
        messages += [
            ("/ok", NUMBER, k * MS, number(k)),
            ("/picture", "sensor_msgs/msg/Image", k * MS, TYPES["sensor_msgs/msg/Image"](
                header(k), 400, 400, "rgb8", 0, 1200, np.zeros(480_000, np.uint8))),
            ("/two", "geometry_msgs/msg/Vector3Stamped", k * MS, TYPES["geometry_msgs/msg/Vector3Stamped"](
                header(k * MS, "ab"[k % 2]), vector)),
            ("/grows", "std_msgs/msg/Float64MultiArray", k * MS, TYPES["std_msgs/msg/Float64MultiArray"](
                layout, np.zeros(3 + k // 2))),
        ]  # fmt: skip
    messages.append(("/once", NUMBER, 5 * MS, number(1)))
    log = read_log(write(tmp_path, messages))
    assert log.array("ok.data").values[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0]
    for name, why in {
        "picture.data": "picture has messages of 4800.. bytes, which are no row of a log",
        "two.vector": "has messages of several frames, a, b: two sensors, whose rows are mixed",
        "grows.data": "has 3 numbers at first, and 4 in row 3", "once.data": "has one row",
    }.items():  # fmt: skip
        with pytest.raises(LogError, match=why):
            log.array(name)


def test_headers_that_are_never_stamped_leave_the_arrivals(tmp_path):
    vector = TYPES["geometry_msgs/msg/Vector3"](1.0, 2.0, 3.0)
    kind = "geometry_msgs/msg/Vector3Stamped"
    messages = [("/v", kind, 10**9 + k * MS, TYPES[kind](header(0), vector)) for k in range(3)]
    log = read_log(write(tmp_path, messages))
    assert log.array("v.vector").stamps == pytest.approx([0.0, 1e-3, 2e-3])


def test_senders_that_take_turns_on_a_topic_are_no_column(tmp_path):
    mcap = pytest.importorskip("mcap.writer")
    file = tmp_path / "log.mcap"

    def write_turns(order):
        with file.open("wb") as out:
            writer = mcap.Writer(out)
            writer.start("ros2")
            schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data")
            channels = [writer.register_channel("/y", "cdr", schema) for _ in range(2)]
            for k, sender in enumerate(order):
                data = b"\0\1\0\0" + np.float64(k).tobytes()
                writer.add_message(channels[sender], k * MS, data, k * MS)
            writer.finish()

    write_turns([0, 0, 1, 1])  # a node that was started again
    assert read_log(file).array("y.data").values[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0]
    write_turns([0, 1, 0, 1])
    with pytest.raises(LogError, match="y has messages of several senders, whose rows are mixed"):
        read_log(file)
    with file.open("wb") as out:
        writer = mcap.Writer(out)
        writer.start("ros2")
        writer.register_channel("/x", "json", writer.register_schema("x", "jsonschema", b"{}"))
        writer.finish()
    with pytest.raises(LogError, match="are all of its channels of ROS 2"):
        read_log(file)


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.95])
def test_bags_that_were_cut_off(tmp_path, plugin, share):
    bag = write(tmp_path, states(200), plugin)
    file = next(each for each in bag.iterdir() if each.suffix in (".mcap", ".db3"))
    whole = file.read_bytes()
    file.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(LogError, match=r"cannot read bag as a ROS 2 bag: .*Is it whole"):
        read_log(bag)
    (tmp_path / "empty").mkdir()
    with pytest.raises(LogError, match="cannot read empty as a ROS 2 bag"):
        read_log(tmp_path / "empty")
