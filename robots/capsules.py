"""Capsules of links in motion: where they are, how far apart, and which links are legs and arms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..mathematics.arrays import Array
from .description import RobotDescription
from .kinematics import LinkPoses, from_base_outwards

Capsule = tuple[Array, Array, float]
"""Both ends (n, 3) and the radius."""


def capsule_ends(robot: RobotDescription, poses: LinkPoses, link: str) -> list[Capsule]:
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


def arms(robot: RobotDescription) -> list[list[str]]:
    """The links of every limb that moves and has no foot, from the base outwards, limbs in the order of their joints."""
    in_legs, found = {link for chain in legs(robot) for link in chain}, list[list[str]]()
    for _, joint in from_base_outwards(robot):
        own = next((arm for arm in found if joint.parent in arm), None)
        if own is not None:
            own.append(joint.child)
        elif joint.name not in robot.held and joint.child not in in_legs:
            found.append([joint.child])
    return found


def capsule_gaps(pairs: Sequence[tuple[Array, Array, float, Array, Array, float]]) -> Array:
    """The distances (pairs, n) between pairs of capsules."""
    a, b, radius, c, d, other_radius = (np.array(part) for part in zip(*pairs, strict=True))
    return segment_distance(a, b, c, d) - (radius + other_radius)[:, None]


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """The distance (...) between the segments a-b and c-d, all (..., 3).

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
    best = np.full(aa.shape, np.inf)
    for s in (np.clip(crossing, 0.0, 1.0), np.zeros(aa.shape), np.ones(aa.shape)):
        t = np.clip((cb + s * ac) / np.where(cc > 0.0, cc, 1.0), 0.0, 1.0)
        s = np.clip((t * ac - ab) / np.where(aa > 0.0, aa, 1.0), 0.0, 1.0)
        gap = between + s[..., None] * along - t[..., None] * across
        best = np.minimum(best, np.sqrt(_dot(gap, gap)))
    return best


def _dot(x: Array, y: Array) -> Array:
    # A sum over an axis of three costs several times as much.
    return np.asarray(x[..., 0] * y[..., 0] + x[..., 1] * y[..., 1] + x[..., 2] * y[..., 2])


def lacking(gaps: Array, wanted: float, at: int, *, carried: bool = False) -> Array:
    """By how much [m] any of the pairs is closer than ``wanted``, or than at the instant ``at`` where it is closer
    then, the worst at each instant (n,). Pairs of a link and the one that it is ``carried`` by which are that close
    at ``at`` form the joint between them, and do not count."""
    then = gaps[:, at : at + 1]
    short = np.minimum(wanted, then) - gaps
    if carried:
        short = short[then[:, 0] > wanted]
    return np.asarray(short.max(axis=0, initial=-np.inf))
