"""The single rigid body that stands for a robot: what is lumped together, and what is lost."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...mathematics.arrays import Array
from .stance import Stance
from .symbolic_model import SymbolicModel

STRAIGHT = 0.985
"""The longest leg by the length of a straight one, where the knee is singular."""
BENT = 0.8
"""The most the body may bend a knee by its limit: the robot's own legs, which weigh something and
so raise its hips over its centre of mass, are bent more or less than the body's."""
BLEND = 0.04
"""s, in which a foot that leaves the ground comes to its course."""
SPARE = 0.008
"""m, of a leg's length, that is kept at lift-off and touchdown."""


@dataclass(frozen=True)
class RigidBody:
    """A robot as one body with legs without mass.

    Attributes:
        inertia: of the whole robot as it stands, about its centre of mass, torso axes (3, 3).
        hips: from the centre of mass, torso axes (n_legs, 3).
        shortest, longest: of a leg from hip to ankle [m].
        standing: its length as the robot stands [m].
    """

    inertia: Array
    hips: Array
    shortest: float
    longest: float
    standing: float

    def at_hop(self, speed: float) -> float:
        """The longest leg [m] at lift-off and touchdown with that vertical speed [m/s]: the foot,
        at rest at first, lags behind the body while it gains its speed."""
        return min(self.standing, self.longest - SPARE - 0.5 * BLEND * abs(speed))


def lump(model: SymbolicModel, start: Stance) -> RigidBody:
    """The body of a robot in its stance."""
    import casadi as ca

    robot = model.robot
    q, v = ca.SX.sym("q", model.size), ca.SX.sym("v", model.size)
    _, angular = model.momentum(q, v)
    upright = start.coordinates.copy()
    upright[:6] = 0.0
    matrix = ca.Function("A", [q], [ca.jacobian(angular, v), model.com(q)], {"cse": True})
    columns, com = (np.array(x) for x in matrix(upright))
    # Rates of pitch, roll and yaw of the upright torso turn it about y, x and z.
    inertia = columns[:, [4, 3, 5]]
    hips, straight, lengths, knees = [], [], [], []
    for leg in model.limbs:
        origins = [np.array(robot.joints[index].origin) for index in leg]
        hips.append(origins[0] - com.ravel())
        bones = [float(np.linalg.norm(o)) for o in origins[1:] if np.any(o)]
        straight.append(sum(bones))
        bent = next(index for index in leg[1:] if np.any(robot.joints[index].origin))
        knees.append((bones, robot.joint_limits[bent], start.coordinates[6 + bent]))
    for bones, limits, angle in knees:
        thigh, calf = bones[0], sum(bones[1:])
        most = BENT * float(np.abs(limits).max())
        lengths.append([np.sqrt(thigh**2 + calf**2 + 2 * thigh * calf * np.cos(bend))
                        for bend in (most, float(angle))])  # fmt: skip
    return RigidBody(
        0.5 * (inertia + inertia.T), np.array(hips), max(x[0] for x in lengths),
        STRAIGHT * min(straight), min(x[1] for x in lengths),
    )  # fmt: skip


def ankles(model: SymbolicModel, stance: Stance) -> Array:
    """Where the ankles are in a stance, in the order of the limbs (n_legs, 3)."""
    import casadi as ca

    q = ca.SX.sym("q", model.size)
    frames = model.frames(q)
    last = [model.robot.joints[leg[-1]].child for leg in model.limbs]
    places = ca.Function("ankles", [q], [ca.horzcat(*(frames[link][1] for link in last))])
    return np.array(places(stance.coordinates)).T
