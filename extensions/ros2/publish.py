"""A signal of the graph as a topic of ROS 2."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Input, Metric
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Signal
from .node import Endpoint, Node, attachment, join, leave
from .parameters import Ros2Block, Ros2Parameters, address, message_type, quality

SLOTS = 32
"""Messages that may wait for the thread that sends."""
_SOONEST, _LATEST = 0.001, 0.01


class PublishParameters(Ros2Parameters):
    """The parameters of ``ros2.Publish``."""

    texts: dict[str, str | list[str]] = parameter(
        {}, text="texts by their path in the message; frame_id stands for every header's frame"
    )
    stamp: Literal["wall", "run"] = parameter(
        "wall", text="times of messages: of day, counted on by ticks, or since the run began"
    )


class Publish(Ros2Block):
    """Publishes ``message`` to ROS 2 over Zenoh (rmw_zenoh, Jazzy and newer), without ROS.

    The input ``message`` has a field for each number of the type, with the type's units and frames:
    ``sensor_msgs/msg/JointState`` has ``position``, ``velocity`` and ``effort``. Vectors are (3,) and
    quaternions (4,), x, y, z, w; names within messages are joined with ``_``. ``fields`` chooses some;
    the others are zero. Lists that have no size in ``sizes`` stay empty. Joint names are the robot's.

    In every run of the block the numbers are copied to one of ``SLOTS`` slots; a thread of its own
    makes messages of them and sends them. Nothing here waits for a network or for a router; while
    there is none, messages are lost. ROS 2's router (``ros2 run rmw_zenoh_cpp rmw_zenohd``) is
    reached at ``router``.

    It was tested between sessions of Zenoh, with names and hashes from rmw_zenoh's own documents; with
    a running ROS 2 it was not. It offers no durability, no services and no actions.
    """

    Params = PublishParameters
    params: PublishParameters
    acts_outside = True
    message: Signal

    @classmethod
    def specialize(
        cls,
        params: Parameters,
        folder: Path,
        robot: RobotDescription | None = None,
        graph_folder: Path | None = None,
    ) -> type[Block]:
        """Return the class whose input has the fields of the message type."""
        assert isinstance(params, PublishParameters)
        return _class_for(message_type(params).signal)

    def setup(self) -> None:
        """Make room for messages that wait."""
        self._codec = self.codec()
        self._slots = [{name: np.array(view) for name, view in self.message} for _ in range(SLOTS)]
        self._ticks = np.zeros(SLOTS, np.int64)
        self._views = [[(slot[name], view) for name, view in self.message] for slot in self._slots]
        self._head = self._tail = 0
        self._sent = self._lost = 0
        self._put: Any = None
        self._gid = b""
        self._begin = 0
        self._ended = threading.Event()
        self._node: Node | None = None
        self._thread: threading.Thread | None = None

    def start(self) -> None:
        """Begin to join ROS 2's graph; waits for nothing."""
        params = self.params
        self._begin = time.time_ns() if params.stamp == "wall" else 0
        self._node = join(address(params))
        found = self._codec.type
        self._node.add(
            Endpoint("MP", params.topic, found.name, found.hash, quality(params), self._joined)
        )
        self._thread = threading.Thread(target=self._run, name="aloft publish", daemon=True)
        self._thread.start()

    def step(self) -> None:
        """Leave the numbers to the thread that sends."""
        slot = self._head % SLOTS
        for target, view in self._views[slot]:
            np.copyto(target, view)
        self._ticks[slot] = self.context.clock.tick
        self._head += 1

    def close(self) -> None:
        """Send what waits, and leave."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(2.0)
        if self._node is not None:
            leave(self._node)
        self._node = self._thread = None

    def metrics(self) -> Mapping[str, Metric]:
        """Return the numbers of messages that were sent and that were not."""
        return {"sent": self._sent, "not_sent": self._lost}

    def _joined(self, session: Any, key: str, gid: bytes) -> Any:
        import zenoh

        publisher = session.declare_publisher(
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            express=False,
            priority=zenoh.Priority.DATA,
            reliability=zenoh.Reliability.RELIABLE
            if self.params.reliability == "reliable"
            else zenoh.Reliability.BEST_EFFORT,
        )
        self._gid, self._put = gid, publisher.put
        return publisher

    def _run(self) -> None:
        rest = min(max(0.5 * self.period, _SOONEST), _LATEST)
        while True:
            ended = self._ended.wait(rest)
            self._send_waiting()
            if ended:
                return

    def _send_waiting(self) -> None:
        while self._tail < self._head:
            if self._head - self._tail >= SLOTS:  # the oldest are being written over
                self._lost += self._head - self._tail - SLOTS // 2
                self._tail = self._head - SLOTS // 2
            slot = self._tail % SLOTS
            self._tail += 1
            put = self._put
            if put is None:
                self._lost += 1
                continue
            try:
                instant = self._begin + round(
                    int(self._ticks[slot]) * self.context.clock.base_period * 1e9
                )
                data = self._codec.write(self._slots[slot], instant)
                if self._head - (self._tail - 1) >= SLOTS:
                    self._lost += 1  # it was written over meanwhile
                    continue
                self._sent += 1
                put(data, attachment=attachment(self._sent, time.time_ns(), self._gid))
            except Exception:  # noqa: BLE001  # a lost session ends no run
                self._lost += 1


_CLASSES: dict[type[Signal], type[Publish]] = {}


def _class_for(signal: type[Signal]) -> type[Publish]:
    if signal not in _CLASSES:
        body: dict[str, Any] = {"__doc__": Publish.__doc__, "__module__": Publish.__module__}
        body["message"] = Input(signal, text="the numbers of the message")
        _CLASSES[signal] = type("Publish", (Publish,), body)
    return _CLASSES[signal]
