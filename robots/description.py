"""The robot's description: one data file from which every model of the robot is built.

The simulator's model and the controller's model are both made from a ``RobotDescription``, so
they cannot disagree. All frames are parallel to the base's at the zero pose; quantities are in SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, model_validator

Vector3 = tuple[float, float, float]


class _Data(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, ignored_types=(cached_property,))


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
    """A hinge from ``parent`` to ``child`` at ``origin`` [m, parent frame] about ``axis``, with
    ``limits`` [rad]."""

    name: str
    parent: str
    child: str
    origin: Vector3
    axis: Vector3
    limits: tuple[float, float]


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


class ActuatorProfile(_Data):
    """What one motor can do, at the gearbox output. ``peak_torque`` [N m] holds up to
    ``corner_speed`` and falls linearly to zero at ``no_load_speed`` [rad/s]; braking torque is
    ``peak_torque`` at any speed. ``rotor_inertia`` [kg m^2], ``friction`` [N m] and ``damping``
    [N m s/rad] act at each joint's side of the gearbox."""

    peak_torque: float
    corner_speed: float
    no_load_speed: float
    continuous_torque: float
    rotor_inertia: float
    friction: float
    damping: float


class Transmission(_Data):
    """``joint_to_motor``: motor velocity = matrix times joint velocity (n_joints square), so
    joint torque = its transpose times motor torque."""

    motors: tuple[str, ...]
    joint_to_motor: tuple[tuple[float, ...], ...]


class RobotDescription(_Data):
    """A legged robot: links, joints, feet, contact points, transmission, actuators, stance."""

    name: str
    text: str = ""
    base: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    feet: tuple[Foot, ...]
    contacts: tuple[ContactPoint, ...]
    transmission: Transmission
    profiles: Mapping[str, ActuatorProfile]
    standing: Mapping[str, float]
    """Joint angles [rad] by name of the pose the robot stands in."""
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
            "n_velocities": len(self.joints) + 6,
            "n_contacts": len(self.contacts),
            "n_feet": len(self.feet),
        }

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
        """Lower and upper joint limits [rad], (n_joints, 2)."""
        return np.array([j.limits for j in self.joints])

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
