"""A topic of ROS 2 as a signal of the graph."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Metric, Output
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .headers import OtherMessageError, WrongMessageError
from .node import Endpoint, Node, join, leave, sender_in
from .parameters import Ros2Block, Ros2Parameters, address, message_type, quality

SENDERS = 64
"""Senders of one topic whose numbers are remembered."""


class TopicHealth(Signal):
    """State of reception on a topic."""

    age = Field(unit="s", text="since the newest message came; before it, since the run began")
    late = Field(dtype="bool", text="whether that is more than max_age")
    received = Field(dtype="int64", text="messages so far")
    lost = Field(
        dtype="int64", text="messages that never came, by the gaps in each sender's numbers"
    )
    refused = Field(dtype="int64", text="messages that did not fit the type, sizes or frames")
    absent = Field(dtype="int64", text="values that messages said they do not have")


class SubscribeParameters(Ros2Parameters):
    """The parameters of ``ros2.Subscribe``."""

    texts: dict[str, str | list[str]] = parameter(
        {},
        text="name: the joints' names, in the order of the signal, by default the robot's; frame_id: "
        "the frame that messages must have; transforms.child_frame_id: whose transforms",
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
    message, and quaternions the identity. Messages are read on a thread of Zenoh; this block only copies
    numbers. A message whose lists have other sizes, with numbers that are not finite, a quaternion whose
    length is not one, or that is none of this type is refused and counted. Joints are put into the robot's
    order by their names, transforms into that of ``texts: {transforms.child_frame_id: [...]}``; a message
    of other transforms is not for this block. ``health`` says how old the newest message is. A type of
    another hash, as after a change of the definition, is not heard.

    The frame that a header names must be the frame of the signal: of the world ``world``, ``map`` or
    ``odom``, of the body any but these and but other links of the robot, else the frame itself. A message
    in another one is refused; ``frame`` and ``texts: {frame_id: ...}`` say what is meant. A value whose
    covariance begins with -1 is not there: it stays as before the first message, and ``absent`` counts it.

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
        self._blank = {name: np.array(view) for name, view in self.message}
        self._targets = dict(iter(self.message))
        self._newest: tuple[Mapping[str, Any], int] | None = None
        self._received = self._lost = self._refused = 0
        self._sequences: dict[bytes, int] = {}
        self._refusal = ""
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
        values = self._blank if newest is None or safe else newest[0]
        for name, target in self._targets.items():
            np.copyto(target, values[name])
        health = self.health
        health.age[()] = age
        health.late[()] = late
        health.received[()] = self._received
        health.lost[()] = self._lost
        health.refused[()] = self._refused
        health.absent[()] = sum(self._codec.absent.values())

    def close(self) -> None:
        """Leave."""
        if self._node is not None:
            leave(self._node)
        self._node = None

    def metrics(self) -> Mapping[str, Metric]:
        """Return the number of messages received."""
        return {"received": self._received, "refused": self._refused}

    def warnings(self) -> Sequence[str]:
        """Return why messages were refused, and what was taken for granted or not there."""
        topic, found = self.params.topic, []
        if self._refused:
            found.append(
                f"{topic}: {self._refused} messages were refused, the last: {self._refusal}"
            )
        for name, frame in self._codec.assumed.items():
            found.append(
                f"{topic}: the frame {name!r} is taken for {frame}; texts: {{frame_id: {name}}} says so"
            )
        for field, count in self._codec.absent.items():
            found.append(f"{topic}: {count} messages say that they have no {field}")
        return found

    def hear(self, data: bytes, beside: bytes = b"") -> None:
        """Take a message; a thread of Zenoh calls this."""
        sender = sender_in(beside)
        if sender is not None:  # before the message is read: one that is refused has come
            gid, sequence = sender
            last = self._sequences.pop(gid, sequence)
            self._lost += max(sequence - last - 1, 0)
            self._sequences[gid] = sequence
            if len(self._sequences) > SENDERS:
                del self._sequences[next(iter(self._sequences))]
        try:
            values = self._codec.read(data, None if self._newest is None else self._newest[0])
        except OtherMessageError:
            return
        except WrongMessageError as error:
            self._refused += 1
            self._refusal = str(error)
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
