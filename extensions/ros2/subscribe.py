"""A topic of ROS 2 as a signal of the graph."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Metric, Output
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .codec import WrongMessageError
from .node import Endpoint, Node, join, leave, sequence_in
from .parameters import Ros2Block, Ros2Parameters, address, message_type, quality


class TopicHealth(Signal):
    """State of reception on a topic."""

    age = Field(unit="s", text="since the newest message came; before it, since the run began")
    late = Field(dtype="bool", text="whether that is more than max_age")
    received = Field(dtype="int64", text="messages so far")
    lost = Field(dtype="int64", text="messages that never came, by the gaps in their numbers")
    refused = Field(dtype="int64", text="messages that did not fit the type or the sizes")


class SubscribeParameters(Ros2Parameters):
    """The parameters of ``ros2.Subscribe``."""

    texts: dict[str, list[str]] = parameter(
        {}, text="name: the joints' names, in the order of the signal; by default the robot's"
    )
    max_age: float | None = parameter(
        None, unit="s", gt=0, text="after so long without a message `late` takes effect"
    )
    late: Literal["hold", "safe", "stop"] = parameter(
        "hold", text="keep the last numbers, give zeros, or end the run"
    )


class Subscribe(Ros2Block):
    """Has the newest message of a topic of ROS 2 over Zenoh (rmw_zenoh, Jazzy and newer), without ROS.

    The output ``message`` has the fields that ``ros2.Publish`` describes, zero before the first
    message. Messages are read on a thread of Zenoh; this block only copies numbers. A message whose
    lists have other sizes, with numbers that are not finite, or that is none of this type is refused
    and counted. Joints are put into the robot's order by their names. ``health`` says how old the
    newest message is. A type of another hash, as after a change of the definition, is not heard.

    A replay takes the outputs from the recording.
    """

    outside = "real"
    Params = SubscribeParameters
    params: SubscribeParameters
    message: Signal
    health = Output(TopicHealth, text="ages and counts")

    @classmethod
    def specialize(
        cls,
        params: Parameters,
        folder: Path,
        robot: RobotDescription | None = None,
        graph_folder: Path | None = None,
    ) -> type[Block]:
        """Return the class whose output has the fields of the message type."""
        assert isinstance(params, SubscribeParameters)
        return _class_for(message_type(params).signal)

    def setup(self) -> None:
        """Find the views that messages are copied to."""
        self._codec = self.codec()
        self._zeros = {name: np.zeros_like(view) for name, view in self.message}
        self._targets = dict(iter(self.message))
        self._newest: tuple[Mapping[str, Any], int] | None = None
        self._received = self._lost = self._refused = 0
        self._sequence: int | None = None
        self._node: Node | None = None

    def start(self) -> None:
        """Begin to join ROS 2's graph; waits for nothing."""
        params, found = self.params, self._codec.type
        self._node = join(address(params))
        self._node.add(
            Endpoint("MS", params.topic, found.name, found.hash, quality(params), self._joined)
        )

    def step(self) -> None:
        """Copy the newest message, if there is one."""
        newest = self._newest
        age = self.time if newest is None else (time.monotonic_ns() - newest[1]) * 1e-9
        limit = self.params.max_age
        late = limit is not None and age > limit
        if late and self.params.late == "stop":
            self.request_stop(f"nothing has come on {self.params.topic} for {age * 1e3:.0f} ms")
        safe = late and self.params.late == "safe"
        values = self._zeros if newest is None or safe else newest[0]
        for name, target in self._targets.items():
            np.copyto(target, values[name])
        health = self.health
        health.age[()] = age
        health.late[()] = late
        health.received[()] = self._received
        health.lost[()] = self._lost
        health.refused[()] = self._refused

    def close(self) -> None:
        """Leave."""
        if self._node is not None:
            leave(self._node)
        self._node = None

    def metrics(self) -> Mapping[str, Metric]:
        """Return the number of messages received."""
        return {"received": self._received, "refused": self._refused}

    def hear(self, data: bytes, beside: bytes = b"") -> None:
        """Take a message; a thread of Zenoh calls this."""
        sequence = sequence_in(beside)
        if sequence is not None:  # before the message is read: one that is refused has come
            if self._sequence is not None and sequence > self._sequence + 1:
                self._lost += sequence - self._sequence - 1
            self._sequence = sequence
        try:
            values = self._codec.read(data)
        except WrongMessageError:
            self._refused += 1
            return
        self._received += 1
        self._newest = (values, time.monotonic_ns())

    def _joined(self, session: Any, key: str, gid: bytes) -> Any:
        import zenoh

        def heard(sample: Any) -> None:
            beside = sample.attachment
            self.hear(sample.payload.to_bytes(), b"" if beside is None else beside.to_bytes())

        return session.declare_subscriber(key, zenoh.handlers.Callback(heard, indirect=False))


_CLASSES: dict[type[Signal], type[Subscribe]] = {}


def _class_for(signal: type[Signal]) -> type[Subscribe]:
    if signal not in _CLASSES:
        body: dict[str, Any] = {"__doc__": Subscribe.__doc__, "__module__": Subscribe.__module__}
        body["message"] = Output(signal, text="the numbers of the newest message")
        _CLASSES[signal] = type("Subscribe", (Subscribe,), body)
    return _CLASSES[signal]
