"""How far a planned robot keeps from the ground and its legs from each other.

Links are the capsules of the robot's description, as in the simulator. The ground is level with a
step where the task has one. Everything is vectorised over instants.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...runtime.description import RobotDescription
from ...runtime.kinematics import LinkPoses, from_base_outwards
from .task import JumpTask

Array = NDArray[np.float64]

SHORTEST_JUMP_OVER_AN_EDGE = 0.03
"""Start and landing closer together than this [m] have no room for a step's edge between them."""


def step_edge(task: JumpTask) -> float | None:
    """The x at which the ground changes height; ``None`` if the ground is level, or if the robot
    lands where it stood, so that there can be no edge and the ground is taken to move in flight."""
    if task.landing_height == 0.0:
        return None
    if task.step_edge is not None:
        return task.step_edge
    return 0.5 * task.distance_x if abs(task.distance_x) >= SHORTEST_JUMP_OVER_AN_EDGE else None


def ground_height(task: JumpTask, x: Array, share: Array | float) -> Array:
    """The ground's height [m] at ``x`` [m]; ``share`` of the flight's time is past, of the same
    shape, below 0 before lift-off and above 1 after touchdown."""
    share = np.broadcast_to(share, x.shape)
    edge = step_edge(task)
    if edge is None:
        return np.where(share >= 0.5, task.landing_height, 0.0)
    beyond = x > edge if task.distance_x >= 0.0 else x < edge
    return np.where(beyond, task.landing_height, 0.0)


def capsule_ends(
    robot: RobotDescription, poses: LinkPoses, link: str
) -> list[tuple[Array, Array, float]]:
    """Both ends (n, 3) and the radius of every capsule of a link."""
    position, rotation = poses.of(link)
    return [
        (
            position + rotation @ np.array(shape.start),
            position + rotation @ np.array(shape.end),
            shape.radius,
        )
        for shape in robot.link(link).shapes
    ]


def body_heights(
    robot: RobotDescription, task: JumpTask, poses: LinkPoses, share: Array
) -> dict[str, Array]:
    """By link, except for feet, the lowest height [m] of its capsules above the ground, (n,)."""
    feet = {foot.link for foot in robot.feet}
    found = {}
    for link in robot.links:
        if link.name in feet or not link.shapes:
            continue
        heights = [
            end[:, 2] - radius - ground_height(task, end[:, 0], share)
            for start, stop, radius in capsule_ends(robot, poses, link.name)
            for end in (start, 0.5 * (start + stop), stop)
        ]
        found[link.name] = np.min(heights, axis=0)
    return found


def legs(robot: RobotDescription) -> list[list[str]]:
    """The links of every leg, from the base outwards, legs in the order of the feet."""
    parent = {joint.child: joint.parent for _, joint in from_base_outwards(robot)}
    found = []
    for foot in robot.feet:
        chain, link = [foot.link], foot.link
        while parent[link] != robot.base:
            link = parent[link]
            chain.append(link)
        found.append(chain[::-1])
    return found


def leg_gap(robot: RobotDescription, poses: LinkPoses) -> Array:
    """The least distance [m] between links of different legs, (n,); negative where they overlap."""
    chains = [
        [capsule for link in chain for capsule in capsule_ends(robot, poses, link)]
        for chain in legs(robot)
    ]
    gap = np.full(len(poses.position), np.inf)
    for number, chain in enumerate(chains):
        for other in chains[number + 1 :]:
            for a, b, radius in chain:
                for c, d, other_radius in other:
                    gap = np.minimum(gap, segment_distance(a, b, c, d) - radius - other_radius)
    return gap


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """The distance between the segments a-b and c-d, all (n, 3).

    The closest points are the crossing of the two lines where it lies in both segments, else an
    end of one of them and what is closest to it on the other.
    """
    along, across, between = b - a, d - c, a - c
    aa, cc = _dot(along, along), _dot(across, across)
    ac, ab, cb = _dot(along, across), _dot(along, between), _dot(across, between)
    determinant = aa * cc - ac * ac
    crossing = np.where(
        determinant > 1e-12 * aa * cc,
        (ac * cb - cc * ab) / np.where(determinant > 0.0, determinant, 1.0),
        0.5,
    )
    best = np.full(len(a), np.inf)
    for s in (np.clip(crossing, 0.0, 1.0), np.zeros(len(a)), np.ones(len(a))):
        t = np.clip((cb + s * ac) / np.where(cc > 0.0, cc, 1.0), 0.0, 1.0)
        s = np.clip((t * ac - ab) / np.where(aa > 0.0, aa, 1.0), 0.0, 1.0)
        gap = between + s[:, None] * along - t[:, None] * across
        best = np.minimum(best, np.sqrt(_dot(gap, gap)))
    return best


def _dot(x: Array, y: Array) -> Array:
    return np.asarray((x * y).sum(axis=1))
