"""The content of a URDF or MJCF file, read by MuJoCo, with all joints at zero, and the inertia of its bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from .hulls import RawShape
from .looks import NOTHING_SEEN, RawLook


@dataclass(frozen=True)
class Inertial:
    """``mass`` [kg], ``com`` [m] (3,) and ``inertia`` about the CoM [kg m^2] (3, 3) in a frame."""

    mass: float
    com: Array
    inertia: Array

    def moved(self, rotation: Array, position: Array) -> Inertial:
        """Return the body in another frame, in which its own frame has this rotation and position."""
        if np.array_equal(rotation, np.eye(3)):
            return Inertial(self.mass, self.com + position, self.inertia)
        inertia = rotation @ self.inertia @ rotation.T
        return Inertial(self.mass, rotation @ self.com + position, 0.5 * (inertia + inertia.T))

    def scaled(self, share: float) -> Inertial:
        """Return a body of the same distribution with a ``share`` of the mass."""
        return Inertial(self.mass * share, self.com, self.inertia * share)


NOTHING = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))


def joined(bodies: list[Inertial]) -> Inertial:
    """Join several bodies, all given in the same frame, into one."""
    bodies = [body for body in bodies if body.mass > 0.0 or np.any(body.inertia)]
    if len(bodies) <= 1:
        return bodies[0] if bodies else NOTHING
    mass = sum(body.mass for body in bodies)
    if mass <= 0.0:
        return Inertial(mass, bodies[0].com, np.sum([body.inertia for body in bodies], axis=0))
    com = np.sum([body.mass * body.com for body in bodies], axis=0) / mass
    inertia = np.zeros((3, 3))
    for body in bodies:
        arm = body.com - com
        inertia += body.inertia + body.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    return Inertial(mass, com, inertia)


@dataclass(frozen=True)
class RawJoint:
    """A joint of the file; ``anchor`` [m] and ``axis`` in the world at the zero of all joints.

    ``effort`` and ``speed`` are NaN where the file gives none; ``rotor_inertia``, ``damping`` and
    ``friction`` are those of the file, at the joint.
    """

    name: str
    kind: str
    """``hinge``, ``slide``, ``free`` or ``ball``."""
    axis: Array
    anchor: Array
    limits: tuple[float, float] | None
    effort: float
    speed: float
    rotor_inertia: float
    damping: float
    friction: float


@dataclass(frozen=True)
class RawThruster:
    """An actuator that pushes a ``body`` at ``position`` [m] along ``axis``, both in the body's frame; see
    ``Thruster``."""

    body: str
    position: Array
    axis: Array
    max_thrust: float
    torque_ratio: float
    time_constant: float


@dataclass(frozen=True)
class RawSensor:
    """A sensor of a ``kind`` of the description at ``position`` [m] in the frame of a ``body``, in which its axes have
    ``rotation``; ``noise`` has the standard deviation by field, where the file gives one."""

    kind: str
    body: str
    position: Array
    rotation: Array
    noise: Mapping[str, float]


@dataclass(frozen=True)
class RawBody:
    """A body of the file: ``rotation`` and ``position`` [m] in the world at the zero of all joints,
    its own ``inertial``, ``shapes`` and ``look`` in its own frame, and the joints that carry it."""

    name: str
    parent: str
    rotation: Array
    position: Array
    inertial: Inertial
    joints: tuple[RawJoint, ...] = ()
    shapes: tuple[RawShape, ...] = ()
    look: RawLook = NOTHING_SEEN


@dataclass(frozen=True)
class Reference:
    """MuJoCo's own compile of the file, with all bodies as they are written; ``spec`` is what was compiled.

    Attributes:
        model: the compiled model; ``None`` where MuJoCo compiles it in no way, and ``refused`` says why.
        refused: what MuJoCo says of the file as it is; empty where it compiles it.
        stand_ins: bodies that have hardly any mass in the model, since MuJoCo refuses what the file gives them.
    """

    spec: Any
    model: Any
    refused: str = ""
    stand_ins: tuple[str, ...] = ()


@dataclass(frozen=True)
class RawModel:
    """Bodies of a file but the world, each behind its parent, branch by branch.

    Attributes:
        name: what the file calls the robot.
        path: the file.
        bodies: the bodies by name.
        world: what the file calls the body that does not move; bodies without a joint may hang
            on it.
        names_world: whether the file itself has a link for the world, as it must in MJCF.
        pose: joint angles of the file's key frame ``home``, ``stand`` or its first; empty for none.
        thrusters: actuators that push at a place, by name.
        sensors: those that the file mounts on links, by name.
        held: where the file holds joints that it ties to another one, holds, or leaves no range [rad, m]; bodies beyond
            are given with them there.
        compiled: whether MuJoCo's compiler sets masses that the file does not give.
        reference: MuJoCo's own compile of the file, with which the import is compared.
        notes: what could not be taken over, one sentence each.
    """

    name: str
    path: Path
    is_urdf: bool
    bodies: Mapping[str, RawBody]
    world: str
    names_world: bool
    pose: Mapping[str, float] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    thrusters: Mapping[str, RawThruster] = field(default_factory=dict)
    sensors: Mapping[str, RawSensor] = field(default_factory=dict)
    compiled: bool = False
    reference: Reference | None = None
