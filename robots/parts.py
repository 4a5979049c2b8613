"""The parts of a robot's description: links, joints, feet, contact points, actuators, sensors.

All frames are parallel to the base's at the zero pose; quantities are in SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    model_serializer,
)

from ..mathematics.arrays import Array

Vector3 = tuple[float, float, float]


class Part(BaseModel):
    """Immutable data that refuses unknown keys."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, ignored_types=(cached_property,), defer_build=True
    )

    later: ClassVar[tuple[str, ...]] = ()
    """Fields that came after version 0.1. They are left out where they have their default, so that
    a description that does not use them keeps its content, and plans made for it their keys."""
    seen_only: ClassVar[tuple[str, ...]] = ()
    """Fields that say what the part looks like, on which nothing that is computed depends. They are
    in a dump only with ``context={"looks": True}``: a robot keeps its content without its meshes."""

    @model_serializer(mode="wrap")
    def _without_unused(
        self, serialize: SerializerFunctionWrapHandler, info: SerializationInfo
    ) -> dict[str, Any]:
        data: dict[str, Any] = serialize(self)
        fields = type(self).model_fields
        looks = bool((info.context or {}).get("looks"))
        for name in self.later:
            if getattr(self, name) == fields[name].default:
                data.pop(name, None)
        for name in self.seen_only:
            if not looks or getattr(self, name) == fields[name].default:
                data.pop(name, None)
        return data


class Shape(Part):
    """A collision capsule from ``start`` to ``end`` [m, link frame] of ``radius`` [m]."""

    start: Vector3
    end: Vector3
    radius: float


class Mesh(Part):
    """A mesh that a link is drawn as, in place of its collision shapes.

    ``file`` is a path, or ``package://NAME/PATH`` of an installed package. The file's corners times
    ``scale``, turned by ``orientation`` (a quaternion x, y, z, w) and moved by ``position`` [m], are
    in the link's frame.
    """

    file: str
    position: Vector3 = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    scale: Vector3 = (1.0, 1.0, 1.0)


class Look(Part):
    """What a link is drawn as: ``meshes``, and capsules for the rest."""

    meshes: tuple[Mesh, ...]
    shapes: tuple[Shape, ...] = ()


class Link(Part):
    """A rigid body: ``mass`` [kg], ``com`` [m, link frame], ``inertia`` about the CoM [kg m^2]
    as xx, yy, zz, xy, xz, yz, with products of inertia as they stand in the tensor."""

    name: str
    mass: float
    com: Vector3
    inertia: tuple[float, float, float, float, float, float]
    shapes: tuple[Shape, ...] = ()


class Joint(Part):
    """A joint from ``parent`` to ``child`` at ``origin`` [m, parent frame].

    A ``hinge`` turns the child about ``axis`` [rad]; a ``slide`` moves it along ``axis`` [m].
    ``limits`` are in the same unit; ``None`` is a joint without limits.
    """

    later = ("kind",)

    name: str
    kind: Literal["hinge", "slide"] = "hinge"
    parent: str
    child: str
    origin: Vector3
    axis: Vector3
    limits: tuple[float, float] | None = None


class Foot(Part):
    """A foot: the ``link`` it belongs to and its ``sole`` centre [m, link frame]."""

    name: str
    link: str
    sole: Vector3


class ContactPoint(Part):
    """A point that may carry load, with rubber that is a ball of ``radius`` [m].

    ``position`` [m, link frame] is the ball's lowest point at the zero pose, so its centre is
    ``radius`` above that in the link's frame, however the link is turned later.
    """

    name: str
    foot: str
    position: Vector3
    radius: float


class MotorRating(Part):
    """The values of one motor, at the gearbox output, that differ from those of its profile.

    The meaning of each value is that of ``ActuatorProfile``; ``None`` is the profile's own value.
    """

    peak_torque: float | None = None
    corner_speed: float | None = None
    no_load_speed: float | None = None
    continuous_torque: float | None = None
    rotor_inertia: float | None = None
    friction: float | None = None
    damping: float | None = None


class ActuatorProfile(Part):
    """The limits of the motors, at the gearbox output.

    ``peak_torque`` [N m] is available up to ``corner_speed`` and falls linearly to zero at
    ``no_load_speed`` [rad/s]; braking torque is ``peak_torque`` at any speed. ``rotor_inertia``
    [kg m^2] is that at the gearbox output; ``friction`` [N m] and ``damping`` [N m s/rad] act at
    each joint's side of the gearbox.

    ``motors`` gives other values for motors by name or by a shell pattern such as ``*_knee_*``;
    later entries win. For a motor that drives a slide, N stands for N m and m for rad.
    A joint that no motor drives has one of ``peak_torque`` zero among ``motors``.
    """

    later = ("motors",)

    peak_torque: float
    corner_speed: float
    no_load_speed: float
    continuous_torque: float
    rotor_inertia: float
    friction: float
    damping: float
    motors: Mapping[str, MotorRating] = {}


@dataclass(frozen=True, eq=False)
class Motors:
    """The chosen profile's values, one element a motor (n_joints,), at the gearbox output.

    ``friction`` and ``damping`` are one element a joint: the joint at the motor's place in the
    order of the description.
    """

    profile: str
    peak_torque: Array
    corner_speed: Array
    no_load_speed: Array
    continuous_torque: Array
    rotor_inertia: Array
    friction: Array
    damping: Array


class Transmission(Part):
    """``joint_to_motor``: motor velocity = matrix times joint velocity (n_joints square), so
    joint torque = its transpose times motor torque."""

    motors: tuple[str, ...]
    joint_to_motor: tuple[tuple[float, ...], ...]


class MountedSensorPart(Part):
    """A sensor mounted on a ``link`` at ``position`` [m, link frame], its axes parallel to the link's.

    ``kind`` names what it is, or a class as ``module:Class``; that class knows the further settings.
    """

    model_config = ConfigDict(extra="allow")

    later = ("position",)

    kind: str
    link: str
    position: Vector3 = (0.0, 0.0, 0.0)


class Sensors(Part):
    """The sensors that the robot has besides its joint encoders: an ``imu`` at the base's origin,
    parallel to the base, a tactile switch at every contact point, and further ones by name."""

    model_config = ConfigDict(extra="allow")

    __pydantic_extra__: dict[str, MountedSensorPart]

    imu: bool = True
    switches: bool = True

    @property
    def mounted(self) -> Mapping[str, MountedSensorPart]:
        """The further sensors by name, in the order of the description."""
        return self.__pydantic_extra__ or {}
