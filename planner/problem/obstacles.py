"""The ground and a step in it as an obstacle: how high points of the body are above it.

Feet on their way over a step follow a timetable (the ``air`` piece) in an ordinary jump. What turns
over in flight has none: there feet, calves, thighs and torso are all kept above the step's shape,
which is rounded so that it has derivatives. In every jump onto or off a step the calves are, also
while the robot stands in front of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ...mathematics.arrays import Indices
from ...robots.description import Capsule, RobotDescription, Shape
from ...robots.robot_description import Link
from ...robots.shapes import Edge, corners_of, edges
from ..models.coordinates import Coordinates
from ..models.symbolic_model import SymbolicModel
from ..task.read_task import edge_room
from ..task.scaling import ball_feet
from ..task.sequence import Hop, StanceLocation, step_of
from .layout import ProblemPhase

Vector3 = tuple[float, float, float]
Point = tuple[str, tuple[str, tuple[float, float, float]], float]
SHARES = (0.125, 0.25, 0.375, 0.625, 0.75, 0.875)
"""Places of the points between a calf's ends and its middle, as shares of its length."""
LONG = 0.5
"""Edges of a hull at least as long as that, as a share of its longest one, get points between their ends."""
ROUNDING = 0.01
"""m; how long before the edge the rounded step has half its height."""


def obstacle_points(model: SymbolicModel, coordinates: Coordinates) -> list[Point]:
    """Return points of the base and the computed limbs (kind, (link, place), radius): contact points, of kind ``foot``,
    then corners of the shapes, and the middles of capsules, of kind ``calf`` for the links that carry a foot and
    ``body`` for all others. Between those of a calf there are more, of kind ``shin``, or a step's edge could pass
    between two of them. The feet's own shapes are left to their contact points.
    """
    robot = model.robot
    link_of = {foot.name: foot.link for foot in robot.feet}
    carriers = {joint.parent for joint in robot.joints if joint.child in link_of.values()}
    balls: dict[str, Vector3] = {}
    found: list[Point] = []
    for c in coordinates.contacts:
        contact = robot.contacts[c]
        place, radius = touching_sphere(robot, c)
        found.append(("foot", (link_of[contact.foot], place), radius))
        if radius:
            balls[link_of[contact.foot]] = place
    for link in robot.links:
        limb = model.limb_of_link[link.name]
        if limb >= 0 and limb not in coordinates.limbs:
            continue
        if link.name in balls:
            found += _upper_half(link, balls[link.name])
        if link.name in link_of.values():
            continue
        kind = "calf" if link.name in carriers else "body"
        for shape in link.shapes:
            places = list(shape.corners)
            if isinstance(shape, Capsule):
                places.insert(1, _between(shape.start, shape.end, 0.5))
            found += [(kind, (link.name, place), shape.radius) for place in places]
            if kind == "calf":
                found += [
                    ("shin", (link.name, _between(*edge, share)), shape.radius)
                    for edge in _along(shape)
                    for share in SHARES
                ]
    return found


def _upper_half(link: Link, ball: Vector3) -> Iterator[Point]:
    """Return points along the capsules of a leg's last link, which ends in a ball: of its half at the knee, as the
    other half is nearer to the ground than the gap that is kept.
    """
    corners, _ = corners_of(link.shapes)
    half = 0.5 * max((math.dist(corner, ball) for corner in corners), default=0.0)
    for shape in link.shapes:
        for edge in _along(shape):
            for share in (0.0, *SHARES[:3], 0.5, *SHARES[3:], 1.0):
                place = _between(*edge, share)
                if math.dist(place, ball) > half:
                    yield "shank", (link.name, place), shape.radius


def _along(shape: Shape) -> list[Edge]:
    """Return the long edges of a hull, and a capsule's axis: what a step's edge could pass between the corners of."""
    found = edges(shape)
    longest = max(math.dist(*edge) for edge in found)
    return [edge for edge in found if math.dist(*edge) > LONG * longest]


def _between(start: Vector3, end: Vector3, share: float) -> Vector3:
    x, y, z = (a + share * (b - a) for a, b in zip(start, end, strict=True))
    return x, y, z


def touching_sphere(robot: RobotDescription, contact: int) -> tuple[Vector3, float]:
    """Return the centre [m, link frame] and radius [m] of what touches the ground at a contact point: the point itself,
    without a radius, unless its foot is a ball.
    """
    for ball in ball_feet(robot):
        if ball.point == contact:
            x, y, z = (float(value) for value in ball.centre)
            return (x, y, z), ball.radius
    return robot.contacts[contact].position, 0.0


def heights_above_step(
    model: SymbolicModel, coordinates: Coordinates, q: Any, w: Mapping[str, Any]
) -> list[Any]:
    """Return the heights of ``obstacle_points``, less their radii, above ground that changes by ``step`` at ``edge`` on
    the way ``onwards`` (+1 or -1); within ``early`` of the edge, and a point's radius, the higher ground still, or
    already, counts for all but 0.25 % of the step. Ground that leans, and its step, are planes, and ``higher`` marks
    the higher side.
    """
    import casadi as ca

    frames = model.frames(coordinates.expand(q), coordinates.limbs)
    rows = []
    higher = w["higher"] if "higher" in w else ca.sign(w["step"])
    for _, point, radius in obstacle_points(model, coordinates):
        place = model.point(frames, *point)
        way = w["onwards"] * (place[0] - w["edge"]) + higher * (w["early"] + radius)
        whole = 0.5 * (1.0 + ca.tanh(3.0 * way / w["early"]))
        if "higher" in w:
            here = ca.vertcat(1.0, place[:2])
            below = ca.dot(w["ground"], here) + ca.dot(w["step"], here) * whole
            rows.append(place[2] - radius - below)
            continue
        rows.append(place[2] - radius - w["ground"] - w["step"] * whole)
    return rows


class ObstacleRows:
    """Points that a problem keeps above the ground at a knot, and the ground below them."""

    def __init__(self, model: SymbolicModel, coordinates: Coordinates) -> None:
        kinds = [kind for kind, _, _ in obstacle_points(model, coordinates)]
        self._of_kind = {
            name: np.flatnonzero(np.array(kinds) == name).astype(np.int64)
            for name in ("foot", "calf", "shin", "shank", "body")
        }
        self.feet = len(self._of_kind["foot"])
        self.count = len(kinds)
        self.knees_fold = bool(ball_feet(model.robot))
        self._folding = self._of("calf", "shin", "shank", "body")

    def _of(self, *kinds: str) -> Indices:
        return np.sort(np.concatenate([self._of_kind[kind] for kind in kinds]))

    def rows(
        self, hop: Hop, edge: float | None, problem_phase: ProblemPhase, first: bool
    ) -> Indices:
        """Return the rows of a jump's knot; ``first`` marks the flight's first."""
        turns = bool(hop.rotation)
        if self.knees_fold and not problem_phase.flies and not turns:
            # A leg that ends in a ball has no ankle, so its knee can fold down to the ground.
            return self._folding
        landed = not problem_phase.flies and problem_phase.place > 0 and edge is not None
        if edge is None and not turns:
            return np.zeros(0, np.int64)
        # Off a step the legs may give way until the hips are near the ground.
        kinds = ["calf"] if turns else ["calf", "shin", "shank"]
        kinds += ["body"] if turns or landed else []
        if turns and problem_phase.flies and not first:
            kinds = ["foot", *kinds]
        return np.concatenate([self._of_kind[kind] for kind in kinds])


def side_clearance(
    robot: RobotDescription, hop: Hop, edge: float | None, start: StanceLocation, end: StanceLocation, apart: float
) -> float:  # fmt: skip
    """Return the distance [m] that the folding knees of a robot with ball feet keep off a step's side: as far ``apart``
    as from the ground, or as the standing robot is. Links of other robots keep ``ROUNDING`` from it.
    """
    if edge is None or hop.rotation or not ball_feet(robot):
        return 0.0
    before, behind = edge_room(robot, hop, start, end, apart)
    stands = abs(before - edge if step_of(hop, start) > 0.0 else behind - edge)
    return min(apart, max(0.0, stands - 2.0 * ROUNDING))


def step_parameters(
    hop: Hop, edge: float | None, start: StanceLocation, end: StanceLocation, share: float,
    leans: bool, beside: float = 0.0,
) -> dict[str, Any]:  # fmt: skip
    """Return the piece's parameters under a jump from ``start`` to ``end``. With no edge the ground changes in the
    middle of the flight; ``share`` of its time is past. Planes if it ``leans``. The higher ground reaches ``beside``
    [m] beyond its edge, for what must keep off its side.
    """
    ground, step = start.z, hop.landing_height or 0.0
    onwards = 1.0 if (hop.distance_x or 0.0) >= 0.0 else -1.0
    if edge is not None and beside:
        edge -= math.copysign(beside, step_of(hop, start)) * onwards
    if leans:
        before, after = np.array(start.plane), np.array(end.plane)
        planes = {"ground": before, "step": after - before}
        if edge is None:
            planes = {"ground": after if share >= 0.5 else before, "step": np.zeros(3)}
        return {
            **planes, "edge": edge or 0.0, "onwards": onwards, "early": ROUNDING,
            "higher": 1.0 if step_of(hop, start) > 0.0 else -1.0,
        }  # fmt: skip
    if edge is None:
        ground, step, edge = ground + (step if share >= 0.5 else 0.0), 0.0, 0.0
    return {"ground": ground, "step": step, "edge": edge, "onwards": onwards, "early": ROUNDING}
