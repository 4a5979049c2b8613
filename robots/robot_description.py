"""The robot's description: one data file from which every model of the robot is built.

The simulator's model and the controller's model are both made from a ``RobotDescription``, so
they cannot disagree. All frames are parallel to the base's at the zero pose; quantities are in SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from functools import cached_property
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from ..mathematics.arrays import Array
from ..mathematics.linear_algebra import inverse, product
from .parts import (
    ActuatorProfile,
    ContactPoint,
    Foot,
    Joint,
    Link,
    Look,
    Motors,
    Part,
    Sensors,
    Transmission,
    Vector3,
)

BASE_VELOCITIES = {"floating": 6, "planar": 3, "fixed": 0}
"""The number of velocities of each kind of base."""


class RobotDescription(Part):
    """A robot: links, joints, feet, contact points, transmission, actuators, sensors, stance.

    ``base_joint`` says how the base link is held: ``floating`` moves freely, ``planar`` moves in
    the x-z plane and turns about y, ``fixed`` is bolted to the world at its origin. Feet and
    contacts may be missing. ``held`` are joints that stand still at an angle while the robot is
    at work: the planner leaves them out, and the controller holds them.
    """

    later = ("base_joint", "profile", "sensors", "held")
    seen_only = ("looks",)

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
    """Joint angles [rad] by name of the pose the robot stands in. A joint that is not named is at
    its angle in ``held``, else at zero."""
    held: Mapping[str, float] = {}
    """Angles [rad] by name of joints that stand still while the robot is at work."""
    points: Mapping[str, tuple[str, Vector3]] = {}
    """Named points [m, link frame] where something may push: name -> (link, position)."""
    looks: Mapping[str, Look] = {}
    """What links are drawn as, by name; others are drawn as their collision shapes."""

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
        """The number of velocities of the base: 6 if floating, 3 if planar, 0 if fixed."""
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
                    "rotor_inertia", "friction", "damping",
                )
            ),
        )  # fmt: skip

    @cached_property
    def rotor_matrix(self) -> Array:
        """The rotors' inertia as seen by the joints [kg m^2], (n_joints, n_joints)."""
        matrix = self.joint_to_motor
        return product(matrix.T * self.motors.rotor_inertia, matrix)

    @cached_property
    def joint_to_motor(self) -> NDArray[np.float64]:
        """Motor velocity = this (n_joints, n_joints) times joint velocity."""
        return np.array(self.transmission.joint_to_motor, dtype=np.float64)

    @cached_property
    def torque_to_motor(self) -> NDArray[np.float64]:
        """Motor torque = this (n_joints, n_joints) times joint torque."""
        return np.ascontiguousarray(inverse(self.joint_to_motor).T)

    @cached_property
    def standing_position(self) -> NDArray[np.float64]:
        """The standing pose's joint angles [rad], (n_joints,)."""
        angles = {**self.held, **self.standing}
        return np.array([angles.get(joint.name, 0.0) for joint in self.joints])

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
