"""The content of a URDF or MJCF file, read by MuJoCo, with all joints at zero."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ...mathematics.arrays import Array
from .bodies import Inertial
from .capsules import Capsule
from .looks import NOTHING_SEEN, RawLook


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
class RawBody:
    """A body of the file: ``rotation`` and ``position`` [m] in the world at the zero of all joints,
    its own ``inertial``, ``capsules`` and ``look`` in its own frame, and the joints that carry it."""

    name: str
    parent: str
    rotation: Array
    position: Array
    inertial: Inertial
    joints: tuple[RawJoint, ...] = ()
    capsules: tuple[Capsule, ...] = ()
    look: RawLook = NOTHING_SEEN


@dataclass(frozen=True)
class RawModel:
    """All bodies of a file but the world, each behind its parent, branch by branch.

    Attributes:
        name: what the file calls the robot.
        path: the file.
        bodies: the bodies by name.
        world: what the file calls the body that does not move; bodies without a joint may hang
            on it.
        names_world: whether the file itself has a link for the world, as it must in MJCF.
        pose: joint angles of the file's key frame ``home``, ``stand`` or its first; empty for none.
        mimics: joints that the file ties to another one.
        notes: what could not be taken over, one sentence each.
    """

    name: str
    path: Path
    is_urdf: bool
    bodies: Mapping[str, RawBody]
    world: str
    names_world: bool
    pose: Mapping[str, float] = field(default_factory=dict)
    mimics: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
