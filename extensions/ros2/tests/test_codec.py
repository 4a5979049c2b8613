"""Numbers become bytes in CDR and come back; what does not fit is refused and raises nothing else."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.needed import needs

from aloft.extensions.ros2.codec import Codec, MessageType, WrongMessageError, type_store
from aloft.runtime.language.errors import BlockError

from .cdr_writer import imu, joint_state, transforms

needs("rosbags")
NAMES = ["hip", "knee", "ankle"]
TIME = 1_700_000_000_123_456_789


def joints(order: list[str] | None = None) -> Codec:
    kind = MessageType("sensor_msgs/msg/JointState", "jazzy", {})
    return Codec(kind, {"n_joints": 3}, {"name": NAMES}, order or NAMES)


def values(codec: Codec, seed: int = 1) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    found = {}
    for leaf in codec.type.leaves:
        shape = codec.shapes[leaf.name]
        found[leaf.name] = {
            "float64": rng.standard_normal(shape),
            "int64": rng.integers(0, 100, shape),
            "bool": np.ones(shape, bool),
        }[leaf.dtype]
        if leaf.parts == "xyzw":
            turns = found[leaf.name]
            turns /= np.sqrt(np.sum(turns * turns, axis=-1, keepdims=True))
    return found


def test_bytes_are_those_of_another_writer() -> None:
    codec = joints()
    given_ = values(codec)
    expected = joint_state(
        TIME, NAMES, *(given_[k].tolist() for k in ("position", "velocity", "effort"))
    )
    assert codec.write(given_, TIME) == expected
    fields = ["orientation", "orientation_covariance", "angular_velocity", "linear_acceleration"]
    kind = MessageType("sensor_msgs/msg/Imu", "jazzy", {}, fields)
    sensor = Codec(kind, {}, {"frame_id": "base"})
    given_ = {name: np.zeros(shape) for name, shape in sensor.shapes.items()}
    given_["orientation"][3] = 1.0
    given_["orientation_covariance"][0] = -1.0
    given_["angular_velocity"][:] = (0.1, 0.2, 0.3)
    given_["linear_acceleration"][:] = (1.0, 2.0, 9.81)
    assert sensor.write(given_, TIME) == imu(TIME, "base", [0.1, 0.2, 0.3], [1.0, 2.0, 9.81])
    without = Codec(MessageType(kind.name, "jazzy", {}, fields[2:]), {}, {"frame_id": "base"})
    data = without.write({name: given_[name] for name in fields[2:]}, TIME)
    assert type_store("jazzy").deserialize_cdr(data, kind.name).orientation_covariance[0] == -1.0
    tf = Codec(
        MessageType("tf2_msgs/msg/TFMessage", "jazzy", {"transforms": 2}), {},
        {"frame_id": "world", "transforms.child_frame_id": ["a", "b"]},
    )  # fmt: skip
    given_ = values(tf)
    place, turn = (given_[f"transforms_transform_{n}"] for n in ("translation", "rotation"))
    poses = [(name, place[k].tolist(), turn[k].tolist()) for k, name in enumerate("ab")]
    assert tf.write(given_, TIME) == transforms(TIME, "world", poses)


def test_a_clock_and_a_flag_as_bytes() -> None:
    clock = Codec(MessageType("rosgraph_msgs/msg/Clock", "jazzy", {}), {}, {})
    assert clock.write({}, 3_000_000_005).hex() == "000100000300000005000000"
    flag = Codec(MessageType("std_msgs/msg/Bool", "jazzy", {}), {}, {})
    # CDR pads nothing after a message's last value, but rosbags may up to four bytes
    assert flag.write({"data": np.array(True)}, 0)[:5].hex() == "0001000001"
    twist = Codec(MessageType("geometry_msgs/msg/Twist", "jazzy", {}), {}, {})
    data = twist.write({"linear": np.array([1.0, 0, 0]), "angular": np.array([0, 0, -2.0])}, 0)
    assert data.hex() == ("00010000000000000000f03f" + "00" * 16 + "00" * 16 + "00000000000000c0")


SIZED = {"tf2_msgs/msg/TFMessage": {"transforms": 2}, "std_msgs/msg/Float64MultiArray": {"data": 5}}


@pytest.mark.parametrize(
    "name",
    ["sensor_msgs/msg/JointState", "sensor_msgs/msg/Imu", "geometry_msgs/msg/WrenchStamped",
     "geometry_msgs/msg/Twist", "std_msgs/msg/Bool", "nav_msgs/msg/Odometry",
     "sensor_msgs/msg/BatteryState", *SIZED],
)  # fmt: skip
def test_what_is_written_is_read(name: str) -> None:
    codec = Codec(MessageType(name, "jazzy", SIZED.get(name, {})), {"n_joints": 3}, {})
    given_ = values(codec)
    found = codec.read(codec.write(given_, TIME))
    assert list(found) == [leaf.name for leaf in codec.type.leaves]
    for leaf in codec.type.leaves:
        rounded = np.float32 if leaf.base == "float32" else found[leaf.name].dtype
        np.testing.assert_array_equal(found[leaf.name], given_[leaf.name].astype(rounded))


def test_a_byte_is_a_number_from_0_to_255() -> None:
    codec = Codec(MessageType("std_msgs/msg/Byte", "jazzy", {}), {}, {})
    for value in (0, 127, 128, 200, 255):
        data = codec.write({"data": np.array(value)}, 0)
        assert data[4] == value
        assert codec.read(data)["data"] == value
    many = Codec(MessageType("std_msgs/msg/ByteMultiArray", "jazzy", {"data": 3}), {}, {})
    given_ = {leaf.name: np.zeros(many.shapes[leaf.name], leaf.dtype) for leaf in many.type.leaves}
    given_["data"] = np.array([127, 128, 255])
    assert many.read(many.write(given_, 0))["data"].tolist() == [127, 128, 255]


def test_every_type_that_has_numbers_is_written_and_read() -> None:
    count = 0
    for name in type_store("jazzy").fielddefs:
        try:
            codec = Codec(MessageType(name, "jazzy", {}), {"n_joints": 2}, {})
        except BlockError:
            continue
        count += 1
        given_ = values(codec)
        assert codec.read(codec.write(given_, 0)).keys() == given_.keys(), name
    assert count > 100


def test_joints_are_put_in_order_by_their_names() -> None:
    codec = joints()
    given_ = values(codec)
    found = joints(["ankle", "hip", "knee"]).read(codec.write(given_, TIME))
    np.testing.assert_array_equal(found["position"], given_["position"][[2, 0, 1]])
    with pytest.raises(WrongMessageError, match="it has no 'toe'"):
        joints(["toe", "hip", "knee"]).read(codec.write(given_, TIME))


def test_lists_of_another_length_are_refused() -> None:
    kind = MessageType("std_msgs/msg/Float64MultiArray", "jazzy", {"data": 4})
    other = MessageType("std_msgs/msg/Float64MultiArray", "jazzy", {"data": 5})
    data = Codec(other, {}, {}).write(values(Codec(other, {}, {})), 0)
    with pytest.raises(WrongMessageError, match=r"data has shape \(5,\), expected \(4,\)"):
        Codec(kind, {}, {}).read(data)


def test_numbers_that_are_not_finite_are_refused() -> None:
    codec = joints()
    given_ = values(codec)
    given_["velocity"][1] = np.nan
    with pytest.raises(WrongMessageError, match="velocity is not finite"):
        codec.read(codec.write(given_, TIME))


def test_integers_beyond_their_type_are_cut() -> None:
    codec = Codec(MessageType("std_msgs/msg/UInt8", "jazzy", {}), {}, {})
    assert codec.read(codec.write({"data": np.array(300)}, 0))["data"] == 255
    assert codec.read(codec.write({"data": np.array(-3)}, 0))["data"] == 0


CODECS = [
    joints(),
    Codec(MessageType("tf2_msgs/msg/TFMessage", "jazzy", {"transforms": 2}), {}, {}),
]


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=300), st.sampled_from(CODECS), st.integers(0, 200), st.integers(1, 255))
def test_bytes_that_nobody_meant_raise_nothing_else(
    data: bytes, codec: Codec, place: int, change: int
) -> None:
    changed = bytearray(codec.write(values(codec), TIME))
    changed[place % len(changed)] ^= change
    for each in (data, b"\x00\x01\x00\x00" + data, bytes(changed), bytes(changed[:place])):
        try:
            found = codec.read(each)
        except WrongMessageError:
            continue
        assert {name: value.shape for name, value in found.items()} == codec.shapes


def test_texts_that_do_not_fit() -> None:
    kind = MessageType("tf2_msgs/msg/TFMessage", "jazzy", {"transforms": 2})
    with pytest.raises(BlockError, match="needs one text for each message of the list, and has 1"):
        Codec(kind, {}, {"transforms.child_frame_id": ["a"]})
    with pytest.raises(BlockError, match=r"has no text 'name'; its texts are transforms.header"):
        Codec(kind, {}, {"name": "x"})


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
    from aloft.extensions.ros2.codec import type_store

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


def test_a_list_of_size_zero_is_left_out() -> None:
    scan = MessageType("sensor_msgs/msg/LaserScan", "jazzy", {"ranges": 3, "intensities": 0})
    assert "ranges" in scan.signal.fields and "intensities" not in scan.signal.fields
