"""The robot's description: one data file from which every model of the robot is built.

The simulator's model and the controller's model are both made from a ``RobotDescription``, so
they cannot disagree. All frames are parallel to the base's at the zero pose; quantities are in SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

Vector3 = tuple[float, float, float]
Array = NDArray[np.float64]

BASE_VELOCITIES = {"floating": 6, "planar": 3, "fixed": 0}
"""How many velocities the base has."""


class _Data(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, ignored_types=(cached_property,))

    later: ClassVar[tuple[str, ...]] = ()
    """Fields that came after version 0.1. They are left out where they have their default, so that
    a description that does not use them keeps its content, and plans made for it their keys."""

    @model_serializer(mode="wrap")
    def _without_unused(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data: dict[str, Any] = serialize(self)
        fields = type(self).model_fields
        for name in self.later:
            if getattr(self, name) == fields[name].default:
                data.pop(name, None)
        return data


class Shape(_Data):
    """A collision capsule from ``start`` to ``end`` [m, link frame] of ``radius`` [m]."""

    start: Vector3
    end: Vector3
    radius: float


class Link(_Data):
    """A rigid body: ``mass`` [kg], ``com`` [m, link frame], ``inertia`` about the CoM [kg m^2]
    as xx, yy, zz, xy, xz, yz, with products of inertia as they stand in the tensor."""

    name: str
    mass: float
    com: Vector3
    inertia: tuple[float, float, float, float, float, float]
    shapes: tuple[Shape, ...] = ()


class Joint(_Data):
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


class Foot(_Data):
    """A foot: the ``link`` it belongs to and its ``sole`` centre [m, link frame]."""

    name: str
    link: str
    sole: Vector3


class ContactPoint(_Data):
    """A point that may carry load: ``position`` of its lowest point [m, link frame] and the
    ``radius`` [m] of the rubber there."""

    name: str
    foot: str
    position: Vector3
    radius: float


class MotorRating(_Data):
    """What one motor can do, at the gearbox output, where it differs from its profile's others.

    The meaning of each value is that of ``ActuatorProfile``; ``None`` is the profile's own value.
    """

    peak_torque: float | None = None
    corner_speed: float | None = None
    no_load_speed: float | None = None
    continuous_torque: float | None = None
    rotor_inertia: float | None = None
    friction: float | None = None
    damping: float | None = None


class ActuatorProfile(_Data):
    """What the motors can do, at the gearbox output. ``peak_torque`` [N m] holds up to
    ``corner_speed`` and falls linearly to zero at ``no_load_speed`` [rad/s]; braking torque is
    ``peak_torque`` at any speed. ``rotor_inertia`` [kg m^2] counts at the gearbox output;
    ``friction`` [N m] and ``damping`` [N m s/rad] act at each joint's side of the gearbox.

    ``motors`` gives other values for motors by name or by a shell pattern such as ``*_knee_*``;
    later entries win. For a motor that drives a slide, N stands for N m and m for rad.
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


class Transmission(_Data):
    """``joint_to_motor``: motor velocity = matrix times joint velocity (n_joints square), so
    joint torque = its transpose times motor torque."""

    motors: tuple[str, ...]
    joint_to_motor: tuple[tuple[float, ...], ...]


class Sensors(_Data):
    """Which sensors the robot has besides its joint encoders: an ``imu`` at the base's origin,
    parallel to the base, and a tactile switch at every contact point."""

    imu: bool = True
    switches: bool = True


class RobotDescription(_Data):
    """A robot: links, joints, feet, contact points, transmission, actuators, sensors, stance.

    ``base_joint`` says how the base link is held: ``floating`` moves freely, ``planar`` moves in
    the x-z plane and turns about y, ``fixed`` is bolted to the world at its origin. Feet and
    contacts may be missing. ``held`` are joints that stand still at an angle while the robot is
    at work: the planner leaves them out, and the controller holds them.
    """

    later = ("base_joint", "profile", "sensors", "held")

    name: str
    text: str = ""
    base: str
    base_joint: Literal["floating", "planar", "fixed"] = "floating"
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    feet: tuple[Foot, ...] = ()
    contacts: tuple[ContactPoint, ...] = ()
    transmission: Transmission
    profiles: Mapping[str, ActuatorProfile]
    profile: str = ""
    """The profile in use; empty: the first."""
    sensors: Sensors = Sensors()
    standing: Mapping[str, float] = {}
    """Joint angles [rad] by name of the pose the robot stands in; zero where none is given."""
    held: Mapping[str, float] = {}
    """Angles [rad] by name of joints that stand still while the robot is at work."""
    points: Mapping[str, tuple[str, Vector3]] = {}
    """Named points [m, link frame] where something may push: name -> (link, position)."""

    @model_validator(mode="after")
    def _check_names(self) -> RobotDescription:
        links = [link.name for link in self.links]
        joints = [joint.name for joint in self.joints]
        feet = [foot.name for foot in self.feet]
        for kind, names in (("link", links), ("joint", joints), ("foot", feet)):
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"{kind} {name!r} is there twice")
        known = [(self.base, links, "base")]
        known += [(j.parent, links, f"joint {j.name}: parent") for j in self.joints]
        known += [(j.child, links, f"joint {j.name}: child") for j in self.joints]
        known += [(f.link, links, f"foot {f.name}: link") for f in self.feet]
        known += [(c.foot, feet, f"contact {c.name}: foot") for c in self.contacts]
        known += [(name, joints, "standing") for name in self.standing]
        known += [(link, links, f"point {name}: link") for name, (link, _) in self.points.items()]
        for name, names, where in known:
            if name not in names:
                raise ValueError(f"{where} {name!r} is not one of {', '.join(names)}")
        n = len(joints)
        rows = self.transmission.joint_to_motor
        if len(rows) != n or any(len(row) != n for row in rows):
            raise ValueError(f"joint_to_motor must be {n} x {n}")
        return self

    @property
    def dimensions(self) -> Mapping[str, int]:
        """The named dimensions every graph with this robot has."""
        return {
            "n_joints": len(self.joints),
            "n_velocities": len(self.joints) + self.base_velocities,
            "n_contacts": len(self.contacts),
            "n_feet": len(self.feet),
        }

    @property
    def base_velocities(self) -> int:
        """How many velocities the base has: 6 floating, 3 planar, 0 fixed."""
        return BASE_VELOCITIES[self.base_joint]

    def with_profile(self, name: str) -> Self:
        """The same robot with another actuator profile in use.

        Raises:
            LookupError: it has no such profile; the message names those that it has.
        """
        if name not in self.profiles:
            there = ", ".join(self.profiles)
            raise LookupError(f"{self.name} has no actuator profile {name!r}; there is {there}")
        return self if name == self.motors.profile else self.changed(profile=name)

    def changed(self, **fields: Any) -> Self:
        """A copy with other values in some fields, which are not validated again."""
        copy = self.model_copy(update=fields)
        for name in list(vars(copy)):  # pydantic copies cached properties too
            if name not in type(self).model_fields:
                del vars(copy)[name]
        return copy

    @cached_property
    def motors(self) -> Motors:
        """What every motor of the profile in use can do."""
        name = self.profile or next(iter(self.profiles))
        profile = self.profiles[name]

        def values(what: str, names: tuple[str, ...]) -> Array:
            found = np.full(len(names), getattr(profile, what))
            for pattern, rating in profile.motors.items():
                value = getattr(rating, what)
                for k, each in enumerate(names):
                    if value is not None and fnmatchcase(each, pattern):
                        found[k] = value
            return found

        names = self.transmission.motors
        return Motors(
            name,
            *(
                values(what, names)
                for what in (
                    "peak_torque", "corner_speed", "no_load_speed", "continuous_torque",
                    "rotor_inertia", "friction", "damping",
                )
            ),
        )  # fmt: skip

    @cached_property
    def rotor_matrix(self) -> Array:
        """The rotors' inertia as seen by the joints [kg m^2], (n_joints, n_joints)."""
        matrix = self.joint_to_motor
        return np.asarray((matrix.T * self.motors.rotor_inertia) @ matrix)

    @cached_property
    def joint_to_motor(self) -> NDArray[np.float64]:
        """Motor velocity = this (n_joints, n_joints) times joint velocity."""
        return np.array(self.transmission.joint_to_motor, dtype=np.float64)

    @cached_property
    def torque_to_motor(self) -> NDArray[np.float64]:
        """Motor torque = this (n_joints, n_joints) times joint torque."""
        return np.ascontiguousarray(np.linalg.inv(self.joint_to_motor).T)

    @cached_property
    def standing_position(self) -> NDArray[np.float64]:
        """The standing pose's joint angles [rad], (n_joints,), zero where none is given."""
        return np.array([self.standing.get(j.name, 0.0) for j in self.joints])

    @cached_property
    def joint_limits(self) -> NDArray[np.float64]:
        """Lower and upper joint limits [rad], (n_joints, 2); infinite where there are none."""
        free = (-np.inf, np.inf)
        return np.array([j.limits or free for j in self.joints]).reshape(-1, 2)

    @cached_property
    def total_mass(self) -> float:
        """The robot's mass [kg]."""
        return sum(link.mass for link in self.links)

    def link(self, name: str) -> Link:
        """The link of that name."""
        return next(link for link in self.links if link.name == name)

    def foot_of_contact(self) -> tuple[int, ...]:
        """For every contact point the index of its foot."""
        names = [foot.name for foot in self.feet]
        return tuple(names.index(contact.foot) for contact in self.contacts)


def read_description(path: Path) -> RobotDescription:
    """Read a description from a YAML file. Raises pydantic's ``ValidationError``."""
    data: Any = yaml.load(path.read_text(), Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    return RobotDescription.model_validate(data)


@lru_cache(maxsize=8)
def find_robot(name: str, folder: Path | None = None) -> RobotDescription:
    """The description called ``name``: one of ours, or a YAML file relative to ``folder``.

    Raises:
        LookupError: there is none; the message names those that exist.
    """
    if name.endswith((".yaml", ".yml")):
        path = (folder or Path()) / name
        if not path.is_file():
            raise LookupError(f"no robot description at {path}")
        return read_description(path)
    shipped = Path(__file__).parent
    path = shipped / name / f"{name}.yaml"
    if not path.is_file():
        names = sorted(p.parent.name for p in shipped.glob("*/*.yaml") if p.stem == p.parent.name)
        raise LookupError(f"no robot called {name!r}; there is {', '.join(names)}")
    return read_description(path)
