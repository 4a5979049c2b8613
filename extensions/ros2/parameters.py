"""Parameters and typed ports common to the blocks that talk to ROS 2."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any, Literal

from pydantic import field_validator

from ...robots.description import RobotDescription
from ...runtime.language.block import Block, Context, UnmetRequirement
from ...runtime.language.errors import BlockError
from ...runtime.language.parameters import Parameters, parameter
from .codec import Codec, MessageType
from .headers import WORLDS, FrameNames, unclear_frame
from .node import NodeAddress, Quality, is_topic

FRAMES = {"body": "base_link", "world": "world"}
"""The frames of ROS 2 that aloft's are called by default."""


class Ros2Parameters(Parameters):
    """Parameters common to ``ros2.Publish`` and ``ros2.Subscribe``."""

    topic: str = parameter(..., text="the topic, as /joint_states")
    type: str = parameter(..., text="the message type, as sensor_msgs/msg/JointState")
    sizes: dict[str, int | str] = parameter(
        {}, text="sizes of lists by their path: numbers, or dimensions such as n_joints"
    )
    fields: list[str] = parameter(
        [], text="the fields of the signal; none: all but covariances and layouts, which are zero"
    )
    frame: str | None = parameter(
        None,
        text="frame of the numbers in the graph, as world or a sensor's; by default the type's",
    )
    distribution: str = parameter("jazzy", text="of ROS 2, for types and their hashes")
    domain: int = parameter(0, ge=0, le=232, text="ROS_DOMAIN_ID")
    router: str = parameter("tcp/127.0.0.1:7447", text="endpoint of rmw_zenoh's router")
    namespace: str = parameter("/", text="of the node, before topics that do not begin with /")
    node: str = parameter("aloft", text="the name under which `ros2 node list` shows the graph")
    reliability: Literal["reliable", "best_effort"] = parameter("reliable", text="of the topic")
    depth: int = parameter(10, ge=1, text="messages that ROS 2 keeps for a slow reader")

    @field_validator("topic")
    @classmethod
    def _topic(cls, value: str) -> str:
        if not is_topic(value):
            raise ValueError("expected names of letters, digits and '_', joined by '/'")
        return value


@lru_cache(maxsize=64)
def _type(
    name: str, distribution: str, sizes: tuple[tuple[str, int | str], ...], fields: tuple[str, ...],
    frame: str | None,
) -> MessageType:  # fmt: skip
    return MessageType(name, distribution, dict(sizes), fields, frame)


def message_type(params: Ros2Parameters) -> MessageType:
    """Return the message type that parameters ask for. Raises ``BlockError``."""
    sizes = tuple(params.sizes.items())
    return _type(params.type, params.distribution, sizes, tuple(params.fields), params.frame)


def quality(params: Ros2Parameters) -> Quality:
    """Return the quality of service that parameters select."""
    return Quality(params.reliability == "reliable", params.depth)


def address(params: Ros2Parameters) -> NodeAddress:
    """Return the node of a block."""
    return NodeAddress(params.router, params.domain, params.namespace, params.node)


class Ros2Block(Block):
    """A block with one port whose signal follows from a message type."""

    Params = Ros2Parameters
    params: Ros2Parameters

    @classmethod
    def dimensions(cls, params: Parameters, robot: RobotDescription | None) -> Mapping[str, int]:
        """Return the dimensions; neither the domain nor the depth is one."""
        return {}

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a type that is not known, and sizes and texts that do not fit it."""
        robot = context.robot
        assert isinstance(params, Ros2Parameters)
        sizes = {} if robot is None else dict(robot.dimensions)
        try:
            found = message_type(params)
            missing = [
                size
                for leaf in found.leaves
                for size in leaf.shape
                if isinstance(size, str) and size not in sizes
            ]
            if not missing:
                Codec(found, sizes, texts_of(params, robot, found))
        except BlockError as error:
            yield UnmetRequirement(str(error), parameter="type", found=params.type)
            return
        yield from _unnamed_transforms(params, found)
        yield from _unclear_frames(params, robot, found)

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return a twist."""
        return {
            "topic": "/cmd_vel", "type": "geometry_msgs/msg/Twist", "router": "tcp/127.0.0.1:1"
        }  # fmt: skip

    def codec(self) -> Codec:
        """Return the codec of this block's messages."""
        context: Context = self.context
        found = message_type(self.params)
        order = [joint.name for joint in context.robot.joints] if context.robot is not None else []
        texts = texts_of(self.params, context.robot, found)
        given = texts.get("name", order)
        names = [given] if isinstance(given, str) else list(given)
        robot = context.robot
        frames = FrameNames(
            "" if robot is None else robot.base,
            () if robot is None else tuple(link.name for link in robot.links),
            getattr(self.params, "texts", {}),
        )
        return Codec(found, context.dimensions, texts, names, frames)


def _unnamed_transforms(params: Ros2Parameters, found: MessageType) -> Iterable[UnmetRequirement]:
    """Report a list of transforms that does not say whose they are."""
    texts = getattr(params, "texts", {})
    for path in found.texts:
        owner, _, name = path.rpartition(".")
        if name != "child_frame_id" or owner not in found.lists:
            continue
        names, size = texts.get(path, ()), found.lists[owner]
        names = [names] if isinstance(names, str) else list(names)
        if not names or len(set(names)) < len(names):
            yield UnmetRequirement(
                f"it does not say whose {owner} they are"
                if not names
                else f"{path} has a name twice",
                parameter="texts",
                expected=f"{size} different names",
                found=", ".join(names) or "none",
                fix=f"texts: {{{path}: [foot, ...]}}",
            )


def _unclear_frames(
    params: Ros2Parameters, robot: RobotDescription | None, found: MessageType
) -> Iterable[UnmetRequirement]:
    """Report a header's frame that contradicts the frame of the numbers, and no ``frame`` that explains it."""
    given = getattr(params, "texts", {})
    base = "" if robot is None else robot.base
    for path, frame, _ in found.claims:
        name = given.get(path, given.get("frame_id"))
        if params.frame is not None or not isinstance(name, str) or path.endswith("child_frame_id"):
            continue
        if unclear_frame(name, frame, base):
            yield UnmetRequirement(
                f"{path} is {name!r}, and the numbers of {found.name} are taken to be in {frame}",
                parameter="texts",
                expected=", ".join(WORLDS) if frame == "world" else "a frame of the body",
                found=name,
                fix=f"frame: {name}, or frame: {frame} where the two are the same",
            )
            return


def texts_of(
    params: Ros2Parameters, robot: RobotDescription | None, found: MessageType
) -> dict[str, str | list[str]]:
    """Return the texts of a message: those that the graph gives, the frame, and the joints' names."""
    texts: dict[str, str | list[str]] = {}
    frames = dict.fromkeys(leaf.frame for leaf in found.leaves if leaf.frame is not None)
    if frames and any(path.endswith("frame_id") for path in found.texts):
        frame = next(iter(frames))
        own = robot.base if robot is not None and frame == "body" else FRAMES.get(frame, frame)
        texts["frame_id"] = own
    if found.name == "sensor_msgs/msg/JointState" and robot is not None:
        texts["name"] = [joint.name for joint in robot.joints]
    return {**texts, **getattr(params, "texts", {})}
