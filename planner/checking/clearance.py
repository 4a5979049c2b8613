"""Distances in a plan: of the robot's bodies from the ground, and of its legs from each other.

Links are the capsules of the robot's description, as in the simulator. The ground is level with a
step where the task has one. Everything is vectorised over instants.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ...robots.kinematics import LinkPoses, from_base_outwards
from ..task.sequence import edge_of
from ..task.task import JumpTask

BALLS = 13
"""Along a capsule, where the ground has edges."""


def step_edge(task: JumpTask, jump: int = 0) -> float | None:
    """The x at which the ground changes height under one of the task's jumps; see ``edge_of``."""
    return edge_of(task.hops()[jump], task.places()[jump])


def ground_height(task: JumpTask, x: Array, progress: Array | float) -> Array:
    """The ground's height [m] at ``x`` [m].

    ``progress``, of the same shape, is how many flights are over, with the share of the present
    one's time: 1.5 in the middle of the second flight. Below 0 counts as 0, above all as all.
    """
    hops, places = task.hops(), task.places()
    done = np.clip(np.broadcast_to(progress, x.shape), 0.0, len(hops))
    levels = np.array([place.z for place in places])
    found = levels[np.floor(done + 0.5).astype(np.int64)]
    for number, hop in enumerate(hops):
        edge = edge_of(hop, places[number])
        if edge is None:
            continue
        beyond = x > edge if (hop.distance_x or 0.0) >= 0.0 else x < edge
        flying = (done > number) & (done < number + 1)
        found = np.where(beyond & (flying | (done == number)), levels[number + 1], found)
        found = np.where(~beyond & (flying | (done == number + 1)), levels[number], found)
    return np.asarray(found)


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
    robot: RobotDescription, task: JumpTask, poses: LinkPoses, progress: Array
) -> dict[str, Array]:
    """By link, except for feet, the lowest height [m] of its capsules above the ground, (n,).

    Balls along a capsule stand for it, close enough that no edge of a step passes between two. Where
    the ground has edges, a ball's height is that of its lower side above the ground right below it.
    """
    feet = {foot.link for foot in robot.feet}
    uneven = any(hop.landing_height or hop.gap for hop in task.hops())
    shares = np.linspace(0.0, 1.0, BALLS if uneven else 2)[:, None, None]
    aside = np.linspace(-0.95, 0.95, 7)[:, None, None] if uneven else np.zeros((1, 1, 1))
    found = {}
    for link in robot.links:
        if link.name in feet or not link.shapes:
            continue
        heights = []
        for start, stop, radius in capsule_ends(robot, poses, link.name):
            centres = start + shares * (stop - start)
            x = centres[:, :, 0] + radius * aside
            below = centres[:, :, 2] - radius * np.sqrt(1.0 - aside**2)
            heights.append((below - ground_height(task, x, progress)).min(axis=(0, 1)))
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


def leg_lack(robot: RobotDescription, poses: LinkPoses, wanted: float) -> Array | None:
    """By how much [m] the links of different legs are closer than ``wanted``, or than at the first
    instant where they stand closer than that, the worst at each instant (n,); ``None`` where no
    two legs have shapes."""
    lack: Array | None = None
    for gap in _gaps(robot, poses):
        found = np.minimum(wanted, gap[0]) - gap
        lack = found if lack is None else np.maximum(lack, found)
    return lack


def _gaps(robot: RobotDescription, poses: LinkPoses) -> Iterator[Array]:
    """The distances (n,) between all capsules of one leg and all of another."""
    chains = [
        [capsule for link in chain for capsule in capsule_ends(robot, poses, link)]
        for chain in legs(robot)
    ]
    for number, chain in enumerate(chains):
        for other in chains[number + 1 :]:
            for a, b, radius in chain:
                for c, d, other_radius in other:
                    yield segment_distance(a, b, c, d) - radius - other_radius


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
