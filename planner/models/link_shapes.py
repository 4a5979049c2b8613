"""Collision shapes of links in motion: where they are, how far apart, and which links are legs and arms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.compiling.compile_calls import run_compiled
from ...mathematics.rotations import matrices_of_quaternions
from ...mathematics.segment_distances import capsule_gaps
from ...mathematics.whole_body_motion import place_points
from ...robots.description import Capsule, Hull, RobotDescription, Shape, Vector3
from ...robots.kinematics import LinkPoses, from_base_outwards
from ...robots.limb import chain_to
from ...robots.shapes import convex, edges
from ...robots.surfaces import quaternion_from_z
from ..task.scaling import per_robot

FAR = 0.1
"""m; shapes that are known to be that far apart are not measured exactly."""


@dataclass(frozen=True)
class MovingShape:
    """A ``shape`` of a link that has these positions (n, 3) [m] and rotations (n, 3, 3) at n instants, with its corners
    there, (n_corners, n, 3) [m].
    """

    shape: Shape
    position: Array
    rotation: Array
    corners: Array

    def place(self, point: Vector3) -> Array:
        """Return the place of a point of the link, (n, 3) [m]."""
        return np.asarray(self.position + self.rotation @ np.array(point))

    def edges(self) -> list[tuple[Array, Array]]:
        """Return the ends of its edges, each (n, 3) [m]; see ``robots.shapes.edges``."""
        return [(self.place(start), self.place(end)) for start, end in edges(self.shape)]


def moving_shapes(robot: RobotDescription, poses: LinkPoses) -> dict[str, list[MovingShape]]:
    """Return the shapes of every link, by its name, at the instants of the poses."""
    links, corners = _corners(robot)
    count = len(poses.position)
    places = np.empty((len(links), count, 3))
    run_compiled(
        place_points, poses.position, poses.rotation.reshape(count, -1, 9),
        np.array([poses.names.index(link) for link in links], dtype=np.int64), corners, places,
    )  # fmt: skip
    found, first = dict[str, list[MovingShape]](), 0
    for link in robot.links:
        found[link.name] = []
        for shape in link.shapes:
            stop = first + len(shape.corners)
            moving = MovingShape(shape, *poses.of(link.name), places[first:stop])
            found[link.name].append(moving)
            first = stop
    return found


@per_robot
def _corners(robot: RobotDescription) -> tuple[list[str], Array]:
    """Return the link of every corner of all shapes, and the corners in its frame, (n, 3) [m]."""
    found = [(link.name, c) for link in robot.links for s in link.shapes for c in s.corners]
    return [link for link, _ in found], np.array([c for _, c in found]).reshape(-1, 3)


@per_robot
def legs(robot: RobotDescription) -> list[list[str]]:
    """Return the links of every leg, from the base outwards, legs in the order of the feet."""
    return [[robot.joints[k].child for k in chain_to(robot, foot.link)] for foot in robot.feet]


@per_robot
def arms(robot: RobotDescription) -> list[list[str]]:
    """Return the links of every limb that moves and has no foot, from the base outwards, limbs in the order of their
    joints.
    """
    in_legs, found = {link for chain in legs(robot) for link in chain}, list[list[str]]()
    for _, joint in from_base_outwards(robot):
        own = next((arm for arm in found if joint.parent in arm), None)
        if own is not None:
            own.append(joint.child)
        elif joint.name not in robot.held and joint.child not in in_legs:
            found.append([joint.child])
    return found


def gaps_between(some: Sequence[MovingShape], others: Sequence[MovingShape]) -> Array:
    """Return the distances (n_some n_others, n) [m] between some shapes and others; of all pairs of these. Where two
    overlap, minus how deep.
    """
    if not some or not others:
        return np.zeros((0, 0))
    gaps = np.zeros((len(some) * len(others), len(some[0].position)))
    if all(isinstance(each.shape, Capsule) for each in (*some, *others)):
        ends = [np.stack([each.corners for each in group]) for group in (some, others)]
        radii = [np.array([each.shape.radius for each in group]) for group in (some, others)]
        parts = [(whole[:, 0], whole[:, 1], r) for whole, r in zip(ends, radii, strict=True)]
        run_compiled(capsule_gaps, *parts[0], *parts[1], gaps)
        return gaps
    for row, (one, other) in zip(gaps, product(some, others), strict=True):
        _fill_gaps(one, other, row)
    return gaps


def _fill_gaps(one: MovingShape, other: MovingShape, out: Array) -> None:
    """Compute the distances (n,) [m] between two shapes, of which one at least is a hull; as far as ``FAR`` those of
    balls around them will do.
    """
    import coal

    (a, to_a, reach_a), (b, to_b, reach_b) = _solid(one.shape), _solid(other.shape)
    middles = [each.place(_middle(each.shape)) for each in (one, other)]
    out[:] = np.linalg.norm(middles[0] - middles[1], axis=1) - reach_a - reach_b
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for k in np.flatnonzero(out < FAR):
        poses = [coal.Transform3s(each.rotation[k], each.position[k]) for each in (one, other)]
        result.clear()
        out[k] = coal.distance(a, poses[0] * to_a, b, poses[1] * to_b, request, result)


def _middle(shape: Shape) -> Vector3:
    x, y, z = np.mean(shape.corners, axis=0).tolist()
    return x, y, z


@lru_cache(maxsize=512)
def _solid(shape: Shape) -> tuple[Any, Any, float]:
    """Return Coal's shape, the place of its frame in the link's, and its reach from the middle of its corners [m]."""
    import coal

    middle = np.array(_middle(shape))
    reach = float(np.linalg.norm(np.array(shape.corners) - middle, axis=1).max()) + shape.radius
    if isinstance(shape, Hull):
        return convex(shape.corners), coal.Transform3s(), reach
    along = np.array(shape.end) - np.array(shape.start)
    turn = matrices_of_quaternions(quaternion_from_z(along))
    solid = coal.Capsule(shape.radius, float(np.linalg.norm(along)))
    return solid, coal.Transform3s(turn, middle), reach


def clearance_deficit(gaps: Array, wanted: float, at: int, *, carried: bool = False) -> Array:
    """Return the distance [m] by which any of the pairs is closer than ``wanted``, or than at the instant ``at`` where
    it is closer then, the worst at each instant (n,). Pairs of a link and the one that it is ``carried`` by which are
    that close at ``at`` form the joint between them, and do not count.
    """
    then = gaps[:, at : at + 1]
    short = np.minimum(wanted, then) - gaps
    if carried:
        short = short[then[:, 0] > wanted]
    return np.asarray(short.max(axis=0, initial=-np.inf))
