"""``ros2.Publish`` is seen by whoever listens as ROS 2 does, and never waits for a network."""

import time
from typing import Any

import numpy as np
import pytest
from tests.needed import needs
from tests.waiting import wait_for

from aloft.extensions.ros2.publish import SLOTS, Publish
from aloft.runtime.loading import LoadError, checked_text
from aloft.runtime.testing.bench import BlockBench

needs("rosbags")
BOOL = "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9"


def bench(endpoint: str, **params: Any) -> BlockBench[Publish]:
    given = {"topic": "/joint_states", "type": "sensor_msgs/msg/JointState", "router": endpoint}
    return BlockBench(Publish, {**given, **params}, robot="bruce", rate=100.0)


def test_joints_arrive_as_ros_2_reads_them(router: tuple[str, Any]) -> None:
    import zenoh
    from rosbags.typesys import Stores, get_typestore

    endpoint, session = router
    store = get_typestore(Stores.ROS2_JAZZY)
    heard: list[Any] = []
    key = f"0/joint_states/sensor_msgs::msg::dds_::JointState_/{store.hash_rihs01('sensor_msgs/msg/JointState')}"
    session.declare_subscriber(key, zenoh.handlers.Callback(heard.append, indirect=False))
    with bench(endpoint) as made:
        position = np.linspace(0.0, 0.9, 10)
        made.set("message", position=position)

        def step() -> bool:
            made.step()
            return len(heard) > 3

        assert wait_for(step)
        tokens = {str(reply.ok.key_expr) for reply in session.liveliness().get("@ros2_lv/**")}
    message = store.deserialize_cdr(heard[0].payload.to_bytes(), "sensor_msgs/msg/JointState")
    np.testing.assert_array_equal(message.position, position)
    assert message.name[0] == made.block.robot.joints[0].name and len(message.name) == 10
    assert abs(message.header.stamp.sec - time.time()) < 3600
    beside = heard[0].attachment.to_bytes()
    assert len(beside) == 33 and beside[:8] == (1).to_bytes(8, "little") and beside[16] == 16
    kinds = sorted(token.split("/")[5] for token in tokens)
    assert kinds == ["MP", "NN"]
    (node,) = [token for token in tokens if "/NN/" in token]
    assert node.endswith("/0/0/NN/%/%/aloft") and node.startswith("@ros2_lv/0/")
    (topic,) = [token for token in tokens if "/MP/" in token]
    assert "/%joint_states/sensor_msgs::msg::dds_::JointState_/RIHS01_" in topic
    assert topic.endswith("/::,10:,:,:,,")
    assert wait_for(lambda: not list(session.liveliness().get("@ros2_lv/**")) or None) is not None


def test_without_a_router_nothing_waits() -> None:
    began = time.monotonic()
    with bench("tcp/127.0.0.1:1", type="std_msgs/msg/Bool", topic="stop") as made:
        for _ in range(3 * SLOTS):
            made.step()
        block = made.block
        assert wait_for(lambda: block.metrics()["not_sent"] == 3 * SLOTS)
        assert block.metrics()["sent"] == 0
    assert time.monotonic() - began < 15.0


def test_a_router_that_comes_later_is_found(router: tuple[str, Any]) -> None:
    import zenoh

    endpoint, session = router
    heard: list[Any] = []
    with bench(endpoint, type="std_msgs/msg/Bool", topic="stop", namespace="/bruce") as made:
        key = f"0/bruce/stop/std_msgs::msg::dds_::Bool_/{BOOL}"
        session.declare_subscriber(key, zenoh.handlers.Callback(heard.append, indirect=False))
        made.set("message", data=True)

        def step() -> bool:
            made.step()
            return bool(heard)

        assert wait_for(step)
    assert heard[0].payload.to_bytes()[4] == 1


GRAPH = """
rate: 100 Hz
robot: bruce
blocks:
  angle: {{use: blocks.Constant, with: {{value: {ten}, unit: rad}}}}
  torque: {{use: blocks.Constant, with: {{value: {ten}, unit: N m}}}}
  out:
    use: ros2.Publish
    with: {{topic: {topic}, type: {type}, fields: [position, effort]{more}}}
    in: {{message: {{{wires}}}}}
"""
WIRES = "position: angle.y.value, effort: torque.y.value"


def graph(
    type_: str = "sensor_msgs/msg/JointState", wires: str = WIRES, more: str = "",
    topic: str = "/joint_states",
) -> Any:  # fmt: skip
    text = GRAPH.format(type=type_, wires=wires, more=more, topic=topic, ten=[0.1] * 10)
    return checked_text(text, "graph.yaml")


def test_a_graph_checks_units_frames_and_types() -> None:
    assert graph().block("out").block_type.inputs["message"].signal.fields["effort"].unit
    for arguments, expected in [
        ({"wires": "position: torque.y.value, effort: torque.y.value"}, "N m"),
        ({"type_": "sensor_msgs/msg/JointStates"}, "the nearest are sensor_msgs/msg/JointState"),
        ({"more": ", sizes: {positions: 3}"}, "has no list 'positions'"),
        ({"topic": "/a b"}, "joined by '/'"),
        ({"more": ", texts: {names: [a]}"}, "has no text 'names'"),
        ({"wires": "torque: torque.y.value"}, "effort"),
    ]:
        with pytest.raises(LoadError) as caught:
            graph(**arguments)
        assert expected in str(caught.value), arguments
