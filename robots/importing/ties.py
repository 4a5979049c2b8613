"""Joints of a file that do not move on their own: held at an angle, or tied to another joint.

A description has neither, so such a joint is fixed where the file holds it: at its constant, or where it is while the
joint that it follows is at its angle in the file's key frame, else at zero or, where zero lies outside its limits, at the
limit next to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .urdf_text import UrdfJoint

DEEPEST = 50
"""The longest chain of joints that follow each other; longer ones are rings."""


@dataclass(frozen=True)
class Tie:
    """A joint's position is ``zero`` plus the polynomial ``coefficients`` of how far its ``leader`` is from
    ``leader_zero`` [rad, m]; without a leader the first of them."""

    leader: str
    coefficients: tuple[float, ...]
    zero: float = 0.0
    leader_zero: float = 0.0

    def at(self, position: float) -> float:
        """Return the joint's position for its leader's."""
        away = position - self.leader_zero
        return self.zero + sum(c * away**k for k, c in enumerate(self.coefficients))


def ties_of_mjcf(spec: Any, model: Any) -> dict[str, Tie]:
    """Return the joints that an equality of MJCF ties to another one or holds, by name."""
    import mujoco

    found = {}
    for eq in spec.equalities:
        if eq.type != mujoco.mjtEq.mjEQ_JOINT or not eq.active:
            continue
        zeros = [
            float(model.qpos0[model.joint(name).qposadr[0]]) if name else 0.0
            for name in (eq.name1, eq.name2)
        ]
        found[eq.name1] = Tie(eq.name2, tuple(map(float, eq.data[:5])), zeros[0], zeros[1])
    return found


def ties_of_urdf(joints: Mapping[str, UrdfJoint]) -> dict[str, Tie]:
    """Return the joints of a URDF that mimic others, or whose limits leave them at zero, by name."""
    found = {
        name: Tie(joint.mimics, (joint.offset, joint.multiplier))
        for name, joint in joints.items()
        if joint.mimics
    }
    still = {name: Tie("", (0.0,)) for name, joint in joints.items() if joint.range == "none"}
    return {**still, **found}


def held_positions(
    ties: Mapping[str, Tie], pose: Mapping[str, float], limits: Mapping[str, tuple[float, float]]
) -> dict[str, float]:
    """Return where the file holds each tied joint [rad, m].

    Args:
        ties: by joint.
        pose: the key frame's positions by joint, if the file has one.
        limits: of joints that have some.
    """

    def position(name: str, depth: int) -> float:
        if name in ties and depth < DEEPEST:
            tie = ties[name]
            return tie.at(position(tie.leader, depth + 1)) if tie.leader else tie.at(0.0)
        if name in pose:
            return pose[name]
        lower, upper = limits.get(name, (0.0, 0.0))
        return min(max(0.0, lower), upper) if lower < upper else 0.0

    return {name: position(name, 0) for name in ties}


def tie_notes(ties: Mapping[str, Tie], held: Mapping[str, float], is_urdf: bool) -> list[str]:
    """Return a sentence for each tied joint."""
    found = []
    for name, tie in ties.items():
        at = f"fixed at {held[name] + 0.0:.6g} here"
        if not is_urdf:
            what = f"follows {tie.leader}" if tie.leader else "is held"
            found.append(f"joint {name} {what} in the file and is {at}")
        elif tie.leader:
            found.append(f"joint {name} mimics {tie.leader} in the URDF and is {at}")
        else:
            found.append(f"joint {name} has a range of 0 to 0 in the URDF and is {at}")
    return found
