"""Where the robot stands at the start and at the end of a jump."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ..task.errors import PlanError
from ..task.task import JumpTask
from .symbolic_model import SymbolicModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Stance:
    """A standing pose: ``coordinates`` (n_velocities), contact ``points`` (n_contacts, 3) and
    ``com`` in the world, ``heading`` of the feet [rad]."""

    coordinates: Array
    points: Array
    com: Array
    heading: float


class StanceFinder:
    """Places a robot with flat soles on the ground for given joint angles."""

    def __init__(self, model: SymbolicModel) -> None:
        import casadi as ca

        self.model = model
        q = ca.SX.sym("q", model.size)
        frames = model.frames(q)
        robot = model.robot
        soles = [model.point(frames, foot.link, foot.sole) for foot in robot.feet]
        self._points: Any = ca.Function(
            "stance",
            [q],
            [
                ca.horzcat(*model.contact_points(q)),
                model.com(q),
                sum(soles) / len(soles),
                frames[robot.feet[0].link][0],
            ],
        )

    def _evaluate(self, q: Array) -> list[Array]:
        return [np.array(value) for value in self._points.call([q])]

    def place(
        self, joints: Array, *, heading: float = 0.0, at: tuple[float, float, float] = (0, 0, 0)
    ) -> Stance:
        """The stance with the soles' middle at ``at`` [m].

        Raises:
            PlanError: the joint angles do not put both soles flat on the ground.
        """
        q = np.zeros(self.model.size)
        q[6:] = joints
        foot = self._evaluate(q)[3]
        q[3] = -np.arctan2(-foot[2, 0], foot[0, 0])
        q[5] = heading
        if heading and q[3]:  # turn the leaning pose as a whole: R = Rz(heading) Ry(lean)
            q[3:6] = _turned(q[3], heading)
        q[:3] = np.array(at) - self._evaluate(q)[2].ravel()
        points, com, _, _ = self._evaluate(q)
        if np.abs(points[2] - at[2]).max() > 1e-6:
            raise PlanError(
                "the soles are not flat on the ground: with these joint angles the contact points "
                f"are at heights {np.round(points[2], 4).tolist()} m; choose angles with equal "
                "hip pitch + knee + ankle sums and leg lengths",
                family="stance",
            )
        return Stance(q, points.T.copy(), com.ravel(), heading)


def stances_of(task: JumpTask, robot: RobotDescription, finder: StanceFinder
               ) -> tuple[Stance, ...]:  # fmt: skip
    """The task's stances: at the start, between jumps, with the same joint angles, and at the end.
    The pitch includes the body's turns so far."""
    names = [joint.name for joint in robot.joints]
    first, last = task.start_joints(robot), task.end_joints(robot)
    places = task.places()
    found = []
    for number, place in enumerate(places):
        angles = last if number == len(places) - 1 else first
        stance = finder.place(
            np.array([angles[name] for name in names]),
            heading=place.heading,
            at=(place.x, place.y, place.z),
        )
        turned = stance.coordinates.copy()
        turned[3] += place.turned
        found.append(Stance(turned, stance.points, stance.com, stance.heading))
    return tuple(found)


def _turned(lean: float, heading: float) -> Array:
    """Pitch, roll, yaw of a base leaning by ``lean`` that is then turned by ``heading``."""
    cl, sl, ch, sh = np.cos(lean), np.sin(lean), np.cos(heading), np.sin(heading)
    rotation = np.array([[ch * cl, -sh, ch * sl], [sh * cl, ch, sh * sl], [-sl, 0.0, cl]])
    return np.array(
        [
            np.arctan2(rotation[0, 2], rotation[2, 2]),
            np.arcsin(-rotation[1, 2]),
            np.arctan2(rotation[1, 0], rotation[1, 1]),
        ]
    )
