"""The robot's description: one data file from which every model of the robot is built.

Its parts are links, joints, feet, contact points, actuators and sensors. The simulator's model and the
controller's model are both made from a ``RobotDescription``, so they cannot disagree. All frames are parallel
to the base's at the zero pose; quantities are in SI.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    ConfigDict,
    Field,
    field_validator,
)

from ..files.names import is_file_name
from ..mathematics.arrays import Array
from ..mathematics.constants import GRAVITY
from ..mathematics.linear_algebra import inverse, product
from .element import Color, Element, Length, Radius, Vector3
from .shapes import Shape


class Mesh(Element):
    """A mesh that a link is drawn as, in place of its collision shapes.

    ``file`` is a path, or ``package://NAME/PATH`` of an installed package. The file's corners times
    ``scale``, turned by ``orientation`` (a quaternion x, y, z, w) and moved by ``position`` [m], are
    in the link's frame. ``color`` is ``#RRGGBB``.
    """

    later = ("color",)

    file: str
    position: Vector3 = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    scale: Vector3 = (1.0, 1.0, 1.0)
    color: Color | None = None


class Box(Element):
    """A box that a link is drawn as: its ``size`` [m] along x, y, z, its edges rounded by ``round`` [m].

    Its middle is at ``position`` [m, link frame], and ``orientation`` (a quaternion x, y, z, w) turns it;
    ``color`` is ``#RRGGBB``.
    """

    size: tuple[Length, Length, Length]
    position: Vector3 = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    round: Radius = 0.0
    color: Color | None = None


class TurnedShape(Element):
    """A part as from a lathe that a link is drawn as: ``profile`` turned about ``axis``.

    A point of the profile is a radius and a place along the axis [m], counted from ``position``
    [m, link frame]; ``color`` is ``#RRGGBB``.
    """

    profile: Annotated[tuple[tuple[Radius, float], ...], Field(min_length=2)]
    position: Vector3 = (0.0, 0.0, 0.0)
    axis: Vector3 = (0.0, 0.0, 1.0)
    color: Color | None = None


class Appearance(Element):
    """Appearance of a link, in place of its collision shapes: ``meshes``, ``boxes`` and ``turned`` parts, and capsules
    for the rest of what an imported file shows.
    """

    later = ("boxes", "turned")

    meshes: tuple[Mesh, ...] = ()
    shapes: tuple[Shape, ...] = ()
    boxes: tuple[Box, ...] = ()
    turned: tuple[TurnedShape, ...] = ()


class Link(Element):
    """A rigid body: ``mass`` [kg], ``com`` [m, link frame], ``inertia`` about the CoM [kg m^2]
    as xx, yy, zz, xy, xz, yz, with products of inertia as they stand in the tensor."""

    name: str
    mass: float
    com: Vector3
    inertia: tuple[float, float, float, float, float, float]
    shapes: tuple[Shape, ...] = ()


SLIDE_UNITS: Mapping[str, str] = {
    "rad": "m", "rad/s": "m/s", "rad/s^2": "m/s^2", "N m": "N", "N m s": "N s", "N m/rad": "N/m",
    "N m s/rad": "N s/m", "kg m^2": "kg",
}  # fmt: skip
"""Units of a sliding joint's quantities, or its motor's, by those of one that turns."""


class Joint(Element):
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

    def unit(self, hinge: str) -> str:
        """Return the unit of a quantity of this joint that a hinge has in the unit ``hinge``."""
        return SLIDE_UNITS.get(hinge, hinge) if self.kind == "slide" else hinge


class Foot(Element):
    """A foot: the ``link`` it belongs to and its ``sole`` centre [m, link frame]."""

    name: str
    link: str
    sole: Vector3


class ContactPoint(Element):
    """A point that may carry load, with rubber that is a ball of ``radius`` [m].

    ``position`` [m, link frame] is the ball's lowest point at the zero pose, so its centre is
    ``radius`` above that in the link's frame, however the link is turned later.
    """

    name: str
    foot: str
    position: Vector3
    radius: float


class Thruster(Element):
    """A rotor with blades, a fan or a nozzle that pushes its ``link`` at ``position`` [m, link frame] along
    ``axis``, with up to ``max_thrust`` [N] and never backwards.

    ``torque_ratio`` [m] is the moment on the link about ``axis`` for each newton of thrust: the drag of blades that
    turn about the axis by the right hand is a negative one. Thrust follows what is asked for with ``time_constant``
    [s], as a first-order lag.
    """

    link: str
    position: Vector3 = (0.0, 0.0, 0.0)
    axis: Vector3 = (0.0, 0.0, 1.0)
    max_thrust: float
    torque_ratio: float = 0.0
    time_constant: float = 0.0


class MotorRating(Element):
    """The values of one motor, at the gearbox output, that differ from those of its profile.

    The meaning of each value is that of ``ActuatorProfile``; ``None`` is the profile's own value.
    """

    simulated_only = ("gear_play",)

    peak_torque: float | None = None
    corner_speed: float | None = None
    no_load_speed: float | None = None
    continuous_torque: float | None = None
    rotor_inertia: float | None = None
    friction: float | None = None
    damping: float | None = None
    gear_play: float | None = None


class ActuatorProfile(Element):
    """The limits of the motors, at the gearbox output.

    ``peak_torque`` [N m] is available up to ``corner_speed`` and falls linearly to zero at
    ``no_load_speed`` [rad/s]; braking torque is ``peak_torque`` at any speed. ``rotor_inertia``
    [kg m^2] is that at the gearbox output; ``friction`` [N m] and ``damping`` [N m s/rad] act at
    each joint's side of the gearbox. ``gear_play`` [rad] is the width of the play of the gear, at its output.

    ``motors`` gives other values for motors by name or by a shell pattern such as ``*_knee_*``;
    later entries win. For a motor that drives a slide, N stands for N m and m for rad.
    A joint that no motor drives has one of ``peak_torque`` zero among ``motors``.
    """

    later = ("motors",)
    simulated_only = ("gear_play",)

    peak_torque: float
    corner_speed: float
    no_load_speed: float
    continuous_torque: float
    rotor_inertia: float
    friction: float
    damping: float
    gear_play: float = 0.0
    motors: Mapping[str, MotorRating] = {}


@dataclass(frozen=True, eq=False)
class Motors:
    """The chosen profile's values, one element a motor (n_joints,), at the gearbox output.

    ``friction``, ``damping`` and ``gear_play`` are one element a joint: the joint at the motor's place in the
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
    gear_play: Array


class PowerSupply(Element):
    """Supply of the motors: a pack, or a supply on a bench.

    ``rated_voltage`` [V] is that at which the motors reach the speeds of their profile. A pack that is nearly full has
    ``open_voltage`` [V] without load, behind ``resistance`` [ohm]; ``recovery_resistance`` [ohm] builds up under load.
    A pack of ``capacity`` [A s] loses ``fall`` [V] from full to empty. ``board_power`` [W] is what computer and boards
    draw. ``torque_constant`` [N m/A, at the output] and ``winding_resistance`` [ohm] are those of all motors; where
    they are not known, copper heat is that of a motor whose voltage alone ends its peak torque at the corner speed.
    A winding takes ``winding_heat_capacity`` [J/K], and gives heat to what cools it through ``winding_thermal_resistance`` [K/W].
    """

    rated_voltage: float = Field(gt=0.0)
    open_voltage: float = Field(gt=0.0)
    resistance: float = Field(ge=0.0)
    recovery_resistance: float = Field(0.0, ge=0.0)
    capacity: float = Field(gt=0.0)
    fall: float = Field(0.0, ge=0.0)
    board_power: float = Field(0.0, ge=0.0)
    torque_constant: float | None = Field(None, gt=0.0)
    winding_resistance: float | None = Field(None, ge=0.0)
    winding_heat_capacity: float | None = Field(None, gt=0.0)
    winding_thermal_resistance: float | None = Field(None, gt=0.0)

    def heating(self, motors: Motors) -> Array:
        """Return the copper heat of every motor for its torque squared [W/(N m)^2], (n_motors,)."""
        if self.torque_constant is not None and self.winding_resistance is not None:
            heat = self.winding_resistance / self.torque_constant**2
            return np.full(len(motors.peak_torque), heat)
        driven = motors.peak_torque > 0.0
        slower = np.where(driven, motors.no_load_speed - motors.corner_speed, 0.0)
        return slower / np.where(driven, motors.peak_torque, 1.0)


class Transmission(Element):
    """``joint_to_motor``: motor velocity = matrix times joint velocity (n_joints square), so
    joint torque = its transpose times motor torque."""

    motors: tuple[str, ...]
    joint_to_motor: tuple[tuple[float, ...], ...]


class SensorMount(Element):
    """A sensor mounted on a ``link`` at ``position`` [m, link frame], its axes turned from the link's by ``orientation``
    (a quaternion x, y, z, w).

    ``kind`` names what it is, or a class as ``module:Class``; that class knows the further settings.
    """

    model_config = ConfigDict(extra="allow")

    later = ("position", "orientation")

    kind: str
    link: str
    position: Vector3 = (0.0, 0.0, 0.0)
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


class Sensors(Element):
    """The sensors that the robot has besides its joint encoders: an ``imu`` at the base's origin,
    parallel to the base, a tactile switch at every contact point, and further ones by name."""

    model_config = ConfigDict(extra="allow")

    if TYPE_CHECKING:  # Pydantic takes no value for this name before 2.9; type checkers need one
        __pydantic_extra__: dict[str, SensorMount] = Field(init=False)
    else:
        __pydantic_extra__: dict[str, SensorMount]

    imu: bool = True
    switches: bool = True

    @property
    def mounted(self) -> Mapping[str, SensorMount]:
        """The further sensors by name, in the order of the description."""
        return self.__pydantic_extra__ or {}

    @property
    def built_in(self) -> Sensors:
        """The sensors without those that are mounted on links."""
        return Sensors(imu=self.imu, switches=self.switches)


BASE_VELOCITIES = {"floating": 6, "planar": 3, "fixed": 0}
"""The number of velocities of each kind of base."""


class RobotDescription(Element):
    """A robot: links, joints, feet, contact points, transmission, actuators, sensors, stance.

    ``base_joint`` says how the base link is held: ``floating`` moves freely, ``planar`` moves in
    the x-z plane and turns about y, ``fixed`` is bolted to the world at its origin. Feet and
    contacts may be missing. ``held`` are joints that stand still at an angle while the robot is
    at work: the planner leaves them out, and the controller holds them.
    """

    later = ("base_joint", "profile", "sensors", "held", "thrusters")
    seen_only = ("looks",)
    simulated_only = ("supply",)

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
    """Joint positions [rad, or m for a slide] by name of the pose the robot stands in. A joint that is not named is at
    its angle in ``held``, else at zero."""
    held: Mapping[str, float] = {}
    """Angles [rad] by name of joints that stand still while the robot is at work."""
    points: Mapping[str, tuple[str, Vector3]] = {}
    """Named points [m, link frame] where something may push: name -> (link, position)."""
    thrusters: Mapping[str, Thruster] = {}
    """Actuators that drive the robot without joints, such as the rotors of a quadrotor, by name."""
    supply: PowerSupply | None = None
    """Supply of the motors; ``None`` where it is unknown."""
    looks: Mapping[str, Appearance] = {}
    """Appearance of links, by name; others are drawn as their collision shapes."""

    @field_validator("name")
    @classmethod
    def _name(cls, value: str) -> str:
        if not is_file_name(value):
            raise ValueError(
                f"{value!r} cannot be the name of a robot, which names files: expected one without "
                "'/', backslash and '..'"
            )
        return value

    def __eq__(self, other: object) -> bool:
        """Check whether all fields are equal; pydantic compares cached arrays, too."""
        if not isinstance(other, RobotDescription):
            return NotImplemented
        return all(getattr(self, n) == getattr(other, n) for n in type(self).model_fields)

    @property
    def dimensions(self) -> Mapping[str, int]:
        """The named dimensions every graph with this robot has."""
        return {
            "n_joints": len(self.joints),
            "n_velocities": len(self.joints) + self.base_velocities,
            "n_contacts": len(self.contacts),
            "n_feet": len(self.feet),
            "n_thrusters": len(self.thrusters),
        }

    @property
    def element_names(self) -> Mapping[str, tuple[str, ...]]:
        """The robot's own names for the elements along a dimension."""
        return {
            "n_joints": tuple(joint.name for joint in self.joints),
            "n_contacts": tuple(contact.name for contact in self.contacts),
            "n_feet": tuple(foot.name for foot in self.feet),
            "n_thrusters": tuple(self.thrusters),
        }

    @property
    def base_velocities(self) -> int:
        """The number of velocities of the base: 6 if floating, 3 if planar, 0 if fixed."""
        return BASE_VELOCITIES[self.base_joint]

    def with_profile(self, name: str) -> Self:
        """Return the same robot with another actuator profile in use.

        Raises:
            LookupError: it has no such profile; the message names those that it has.
        """
        if name not in self.profiles:
            there = ", ".join(self.profiles)
            raise LookupError(f"{self.name} has no actuator profile {name!r}; there is {there}")
        return self if name == self.motors.profile else self.changed(profile=name)

    def freed(self, names: Sequence[str]) -> Self:
        """Return the same robot with those held joints, by name or pattern, free to move; it stands with them as it
        held them. Joints that are free already stay so.

        Raises:
            LookupError: a name or pattern fits no joint; the message names those that it holds.
        """
        for pattern in names:
            if not any(fnmatchcase(joint.name, pattern) for joint in self.joints):
                held = ", ".join(self.held) or "none"
                raise LookupError(f"{self.name} has no joint {pattern!r}; it holds {held}")
        freed = [name for name in self.held if any(fnmatchcase(name, p) for p in names)]
        if not freed:
            return self
        return self.changed(
            held={name: angle for name, angle in self.held.items() if name not in freed},
            standing={**self.standing, **{name: self.held[name] for name in freed}},
        )

    def changed(self, **fields: Any) -> Self:
        """Return a copy with other values in some fields, which are not validated again."""
        copy = self.model_copy(update=fields)
        for name in list(vars(copy)):  # pydantic copies cached properties too
            if name not in type(self).model_fields:
                del vars(copy)[name]
        return copy

    def content(self) -> dict[str, Any]:
        """Return all that is computed with, also by a simulator, as plain data from which the robot can be read
        again.
        """
        return self.model_dump(mode="json", context={"simulated": True})

    @cached_property
    def motors(self) -> Motors:
        """The values of every motor in the profile in use, one element for each motor."""
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
                    "rotor_inertia", "friction", "damping", "gear_play",
                )
            ),
        )  # fmt: skip

    @cached_property
    def rotor_matrix(self) -> Array:
        """The rotors' inertia as seen by the joints [kg m^2], (n_joints, n_joints)."""
        return self.rotor_matrix_of(1.0)

    def rotor_matrix_of(self, factor: Array | float) -> Array:
        """Return the same with a factor on the inertia of each rotor, (n_motors,)."""
        matrix = self.joint_to_motor
        return product(matrix.T * (self.motors.rotor_inertia * factor), matrix)

    @cached_property
    def joint_to_motor(self) -> NDArray[np.float64]:
        """Motor velocity = this (n_joints, n_joints) times joint velocity."""
        rows = self.transmission.joint_to_motor
        return np.array(rows, dtype=np.float64).reshape(len(rows), len(self.joints))

    @cached_property
    def torque_to_motor(self) -> NDArray[np.float64]:
        """Motor torque = this (n_joints, n_joints) times joint torque."""
        return np.ascontiguousarray(inverse(self.joint_to_motor).T)

    def motor_unit(self, motor: int, hinge: str) -> str:
        """Return the unit of a motor's quantity, as ``Joint.unit``; one that moves slides only has their units."""
        gears = self.joint_to_motor[motor].tolist()
        units = {j.unit(hinge) for j, gear in zip(self.joints, gears, strict=True) if gear}
        return units.pop() if len(units) == 1 else hinge

    @cached_property
    def standing_position(self) -> NDArray[np.float64]:
        """The joints' positions in the standing pose [rad, or m for a slide], (n_joints,)."""
        angles = {**self.held, **self.standing}
        return np.array([angles.get(joint.name, 0.0) for joint in self.joints])

    @cached_property
    def joint_limits(self) -> NDArray[np.float64]:
        """Lower and upper joint limits [rad, or m for a slide], (n_joints, 2); infinite where there are
        none."""
        free = (-np.inf, np.inf)
        return np.array([j.limits or free for j in self.joints]).reshape(-1, 2)

    @cached_property
    def total_mass(self) -> float:
        """The robot's mass [kg]."""
        return sum(link.mass for link in self.links)

    @property
    def weight(self) -> float:
        """The robot's weight [N]."""
        return self.total_mass * GRAVITY

    def link(self, name: str) -> Link:
        """Return the link called ``name``."""
        return next(link for link in self.links if link.name == name)

    def foot_of_contact(self) -> tuple[int, ...]:
        """Return the index of each contact point's foot."""
        names = [foot.name for foot in self.feet]
        return tuple(names.index(contact.foot) for contact in self.contacts)
