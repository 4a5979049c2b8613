"""``ros2.Subscribe`` has the newest message, refuses what does not fit, and says how old it is."""

from typing import Any

import numpy as np
import pytest
from tests.needed import needs
from tests.waiting import wait_for

from aloft.extensions.ros2.codec import Codec, MessageType
from aloft.extensions.ros2.node import attachment
from aloft.extensions.ros2.subscribe import Subscribe
from aloft.runtime.testing.bench import BlockBench

needs("rosbags")
TWIST = MessageType("geometry_msgs/msg/Twist", "jazzy", {})


def bench(endpoint: str = "tcp/127.0.0.1:1", **params: Any) -> BlockBench[Subscribe]:
    given = {"topic": "cmd_vel", "type": TWIST.name, "router": endpoint}
    return BlockBench(Subscribe, {**given, **params}, rate=100.0)


def twist(forward: float) -> bytes:
    values = {"linear": np.array([forward, 0.0, 0.0]), "angular": np.zeros(3)}
    return Codec(TWIST, {}, {}).write(values, 0)


def test_messages_of_another_session_arrive(router: tuple[str, Any]) -> None:
    endpoint, session = router
    key = f"0/cmd_vel/geometry_msgs::msg::dds_::Twist_/{TWIST.hash}"
    with bench(endpoint) as made:
        made.step()
        assert made.block.health.received == 0 and not made.block.message.linear.any()

        def arrives() -> bool:
            session.put(key, twist(0.5), attachment=attachment(1, 0, bytes(16)))
            made.step()
            return bool(made.block.health.received > 0)

        assert wait_for(arrives)
        assert made.block.message.linear.tolist() == [0.5, 0.0, 0.0]
        tokens = [str(reply.ok.key_expr) for reply in session.liveliness().get("@ros2_lv/**")]
        assert sorted(token.split("/")[5] for token in tokens) == ["MS", "NN"]


def test_gaps_and_what_does_not_fit_are_counted() -> None:
    with bench() as made:
        block = made.block
        for number in (1, 2, 5):
            block.hear(twist(float(number)), attachment(number, 0, bytes(16)))
        block.hear(b"nonsense", attachment(6, 0, bytes(16)))
        block.hear(twist(9.0)[:-1])
        block.hear(twist(float("nan")))
        block.hear(twist(7.0), attachment(7, 0, bytes(16)))
        made.step()
        assert block.message.linear[0] == 7.0
        health = block.health
        assert (health.received, health.lost, health.refused) == (4, 2, 3)
        assert block.metrics() == {"received": 4, "refused": 3}
        assert 0.0 <= float(health.age) < 60.0 and not health.late


@pytest.mark.parametrize("late", ["hold", "safe", "stop"])
def test_what_happens_without_messages(late: str) -> None:
    with bench(max_age=0.02, late=late) as made:
        made.block.hear(twist(1.0))

        def is_late() -> bool:
            made.step()
            return bool(made.block.health.late)

        assert wait_for(is_late)
        assert made.block.message.linear[0] == (0.0 if late == "safe" else 1.0)
        reason = made.block.context.clock.stop_reason or ""
        assert reason.startswith("nothing has come on cmd_vel for") == (late == "stop")
        made.block.hear(twist(2.0))
        made.step()
        values = (2.0,) if late != "safe" else (2.0, 0.0)  # it may be late again by now
        assert made.block.message.linear[0] in values
