"""Key expressions, tokens and attachments are byte for byte those of rmw_zenoh's own documents."""

import pytest

from aloft.extensions.ros2.node import (
    ATTACHMENT,
    NodeName,
    Quality,
    attachment,
    data_key,
    dds_type,
    full_name,
    is_topic,
    sender_in,
)

STRING = "std_msgs/msg/String"
HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def test_data_keys_of_the_design_document() -> None:
    key = f"0/chatter/std_msgs::msg::dds_::String_/{HASH}"
    assert data_key(0, "/chatter", STRING, HASH) == key
    key = f"0/robot1/chatter/std_msgs::msg::dds_::String_/{HASH}"
    assert data_key(0, full_name("chatter", "/robot1"), STRING, HASH) == key
    assert dds_type("sensor_msgs/msg/JointState") == "sensor_msgs::msg::dds_::JointState_"


def test_tokens_of_the_design_document() -> None:
    listener = NodeName(0, "aac3178e146ba6f1fc6e6a4085e77f21", 0, "/", "listener")
    assert listener.token() == ("@ros2_lv/0/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener")
    talker = NodeName(0, "8b20917502ee955ac4476e0266340d5c", 0, "/", "talker")
    assert talker.endpoint(10, "MP", "/chatter", STRING, HASH, Quality(depth=7)) == (
        "@ros2_lv/0/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
        f"std_msgs::msg::dds_::String_/{HASH}/::,7:,:,:,,"
    )


def test_qualities() -> None:
    # a token of pull request 266, in which every value is the default
    assert Quality(depth=42).chunk() == "::,:,:,:,,"
    assert Quality(reliable=False, depth=1).chunk() == "2::,1:,:,:,,"


def test_names_in_a_namespace() -> None:
    node = NodeName(3, "ab", 0, "/bruce", "aloft")
    assert node.token() == "@ros2_lv/3/ab/0/0/NN/%/%bruce/aloft"
    topic = full_name("left/imu", "/bruce")
    assert topic == "/bruce/left/imu" and full_name("/imu", "/bruce") == "/imu"
    assert "/%bruce%left%imu/" in node.endpoint(1, "MS", topic, STRING, HASH, Quality())


def test_the_attachment_is_33_bytes() -> None:
    data = attachment(1, 0x1122334455667788, bytes(range(16)))
    assert data.hex() == "0100000000000000887766554433221110000102030405060708090a0b0c0d0e0f"
    assert len(data) == ATTACHMENT == 33
    assert sender_in(data) == (data[17:], 1)
    assert sender_in(b"") is None and sender_in(data[:-1]) is None
    assert sender_in(data[:16] + b"\x11" + data[17:]) is None


@pytest.mark.parametrize(
    ("name", "good"),
    [("/joint_states", True), ("imu", True), ("/a/b", True), ("/a b", False), ("/1a", False),
     ("/a/", False), ("", False), ("/a/**", False)],
)  # fmt: skip
def test_topics(name: str, good: bool) -> None:
    assert is_topic(name) is good
