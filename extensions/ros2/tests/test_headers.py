"""``ros2.Subscribe`` believes what messages say of their numbers: frames, whose they are, and which are there."""

from typing import Any

import numpy as np
import pytest
from tests.needed import needs

from aloft.extensions.ros2.codec import Codec, MessageType, type_store
from aloft.extensions.ros2.node import attachment
from aloft.extensions.ros2.subscribe import Subscribe
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing.bench import BlockBench

needs("rosbags")
IMU, WRENCH, TF = "sensor_msgs/msg/Imu", "geometry_msgs/msg/WrenchStamped", "tf2_msgs/msg/TFMessage"
ODOMETRY, TWIST = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist"
POSE = "geometry_msgs/msg/PoseStamped"


def bench(name: str, robot: str | None = None, **params: Any) -> BlockBench[Subscribe]:
    given = {"topic": "x", "type": name, "router": "tcp/127.0.0.1:1", **params}
    return BlockBench(Subscribe, given, rate=100.0, robot=robot)


def message(
    name: str, texts: dict[str, Any], sizes: dict[str, Any] | None = None, **values: Any
) -> bytes:
    kind = MessageType(name, "jazzy", sizes or {}, list(values))
    found = {key: np.asarray(value, np.float64) for key, value in values.items()}
    return Codec(kind, {}, texts).write(found, 0)


def counts(made: BlockBench[Subscribe]) -> tuple[int, int, int]:
    made.step()
    health = made.block.health
    return int(health.received), int(health.refused), int(health.absent)


def test_a_covariance_of_minus_one_means_that_there_is_no_value() -> None:
    none = [-1.0, *[0.0] * 8]
    data = message(
        IMU, {}, orientation=[0.6, 0.0, 0.8, 0.0], orientation_covariance=none,
        angular_velocity=[0.1, 0.2, 0.3], linear_acceleration=[1.0, 2.0, 3.0],
        linear_acceleration_covariance=none,
    )  # fmt: skip
    with bench(IMU) as made:
        made.block.hear(data)
        assert counts(made) == (1, 0, 2)
        found = made.block.message
        assert found.orientation.tolist() == [0.0, 0.0, 0.0, 1.0]
        assert found.angular_velocity.tolist() == [0.1, 0.2, 0.3]
        assert not found.linear_acceleration.any()
        assert made.block.warnings() == [
            "x: 1 messages say that they have no orientation",
            "x: 1 messages say that they have no linear_acceleration",
        ]


def test_each_sender_has_numbers_of_its_own() -> None:
    data = message(TWIST, {}, linear=[1.0, 0.0, 0.0])
    with bench(TWIST) as made:
        for k in (0, 1, 2, 5):  # two are lost of one sender, none of the other
            made.block.hear(data, attachment(1000 + k, 0, b"A" * 16))
            made.block.hear(data, attachment(5 + min(k, 3), 0, b"B" * 16))
        for k in range(100):
            made.block.hear(data, attachment(k, 0, k.to_bytes(16, "little")))
        made.step()
        assert int(made.block.health.lost) == 2 and len(made.block._sequences) == 64


@pytest.mark.parametrize(
    ("frame_id", "params", "taken"),
    [
        ("world", {}, True),
        ("/map", {}, True),
        ("", {}, True),
        ("l_ankle_ft", {}, False),
        ("l_ankle_ft", {"frame": "l_ankle_ft"}, True),
        ("world", {"frame": "l_ankle_ft"}, False),
        ("lab", {"frame": "world", "texts": {"frame_id": "lab"}}, True),
        ("world", {"frame": "world", "texts": {"frame_id": "lab"}}, False),
    ],
)
def test_the_header_says_the_frame(frame_id: str, params: dict[str, Any], taken: bool) -> None:
    data = message(WRENCH, {"frame_id": frame_id}, wrench_force=[0.0, 100.0, 0.0])
    with bench(WRENCH, **params) as made:
        made.block.hear(data)
        assert counts(made) == ((1, 0, 0) if taken else (0, 1, 0))
        frame = type(made.block.message).fields["wrench_force"].frame
        assert frame == params.get("frame", "world")
        if not taken:
            (said,) = made.block.warnings()
            assert f"header.frame_id is {frame_id!r}, and the signal is in {frame}" in said


def test_a_sensor_on_the_body_is_taken_for_it_with_a_word() -> None:
    with bench(IMU, robot="bruce") as made:
        base, foot = made.block.robot.base, made.block.robot.links[-1].name
        for name in (base, "imu_link", "odom", foot):
            made.block.hear(message(IMU, {"frame_id": name}, angular_velocity=[0.1, 0.0, 0.0]))
        assert counts(made) == (2, 2, 2)  # none has an orientation
        refused, taken, _ = made.block.warnings()
        assert refused.endswith(f"header.frame_id is {foot!r}, and the signal is in body")
        assert taken.startswith("x: the frame 'imu_link' is taken for body")


def test_the_velocity_of_an_odometry_is_in_the_child_frame() -> None:
    texts = {"header.frame_id": "odom", "child_frame_id": "map"}
    data = message(ODOMETRY, texts, twist_twist_linear=[1.0, 0.0, 0.0])
    with bench(ODOMETRY) as made:
        made.block.hear(data)
        assert counts(made) == (0, 1, 0)
        assert "child_frame_id is 'map', and the signal is in body" in made.block.warnings()[0]


def transforms(*poses: tuple[str, float]) -> bytes:
    texts = {"frame_id": "world", "transforms.child_frame_id": [name for name, _ in poses]}
    places = [[x, 0.0, 0.0] for _, x in poses]
    turns = [[0.0, 0.0, 0.0, 1.0]] * len(poses)
    return message(
        TF, texts, {"transforms": len(poses)}, transforms_transform_translation=places,
        transforms_transform_rotation=turns,
    )  # fmt: skip


def test_transforms_are_found_by_their_names() -> None:
    texts = {"transforms.child_frame_id": ["foot", "hand"]}
    with bench(TF, sizes={"transforms": 2}, texts=texts) as made:

        def places() -> list[float]:
            made.step()
            return made.block.message.transforms_transform_translation[:, 0].tolist()

        made.block.hear(transforms(("camera", -7.0), ("hand", 2.0)))
        assert places() == [0.0, 2.0]
        assert made.block.message.transforms_transform_rotation[0].tolist() == [0.0, 0.0, 0.0, 1.0]
        made.block.hear(transforms(("foot", 1.0)))
        made.block.hear(transforms(("camera", -8.0)))
        assert places() == [1.0, 2.0] and counts(made) == (2, 0, 0)


def test_transforms_need_names() -> None:
    with pytest.raises(BlockError, match="it does not say whose transforms they are"):
        bench(TF, sizes={"transforms": 1})
    with pytest.raises(BlockError, match=r"transforms\.child_frame_id has a name twice"):
        bench(TF, sizes={"transforms": 2}, texts={"transforms.child_frame_id": ["a", "a"]})


def test_a_frame_that_contradicts_the_type_is_a_mistake() -> None:
    with pytest.raises(
        BlockError, match=r"header\.frame_id is 'lab', and the numbers of .* in world"
    ):
        bench(POSE, texts={"frame_id": "lab"})


@pytest.mark.parametrize(
    ("sent", "found"),
    [([0.0, 0.0, 0.0, 0.0], None), ([2.0, 0.0, 0.0, 0.0], None), ([0.0, 0.0, 0.6, 0.801], 1.0)],
)
def test_rotations_have_length_one(sent: list[float], found: float | None) -> None:
    store = type_store("jazzy")
    raw = store.deserialize_cdr(message(POSE, {}, pose_position=[0.0, 0.0, 0.0]), POSE)
    turn = raw.pose.orientation
    assert [turn.x, turn.y, turn.z, turn.w] == [
        0.0,
        0.0,
        0.0,
        1.0,
    ]  # left out, it is sent as no turn
    turn.x, turn.y, turn.z, turn.w = sent
    with bench(POSE) as made:
        made.block.hear(bytes(store.serialize_cdr(raw, POSE, little_endian=True)))
        assert counts(made) == ((0, 1, 0) if found is None else (1, 0, 0))
        assert np.linalg.norm(made.block.message.pose_orientation) == pytest.approx(1.0, abs=1e-15)


def test_a_rotation_that_was_never_written_is_sent_as_none() -> None:
    data = message(POSE, {}, pose_orientation=[0.0, 0.0, 0.0, 0.0])
    assert type_store("jazzy").deserialize_cdr(data, POSE).pose.orientation.w == 1.0
