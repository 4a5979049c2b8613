"""Capsules of links in motion: where they are, how far apart, and which links are legs and arms."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.segment_distances import capsule_gaps
from ...robots.description import RobotDescription
from ...robots.kinematics import LinkPoses, from_base_outwards
from ...robots.limb import chain_to
from .exact_dynamics import run_compiled

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
    return [[robot.joints[k].child for k in chain_to(robot, foot.link)] for foot in robot.feet]


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


def gaps_between(some: Sequence[Capsule], others: Sequence[Capsule]) -> Array:
    """The distances (n_some n_others, n) between some capsules and others; of all pairs of these."""
    if not some or not others:
        return np.zeros((0, 0))
    stacked = [np.array(part) for each in (some, others) for part in zip(*each, strict=True)]
    gaps = np.zeros((len(some) * len(others), len(some[0][0])))
    run_compiled(KernelCall(capsule_gaps, *stacked, gaps))
    return gaps


def lacking(gaps: Array, wanted: float, at: int, *, carried: bool = False) -> Array:
    """By how much [m] any of the pairs is closer than ``wanted``, or than at the instant ``at`` where it is closer
    then, the worst at each instant (n,). Pairs of a link and the one that it is ``carried`` by which are that close
    at ``at`` form the joint between them, and do not count."""
    then = gaps[:, at : at + 1]
    short = np.minimum(wanted, then) - gaps
    if carried:
        short = short[then[:, 0] > wanted]
    return np.asarray(short.max(axis=0, initial=-np.inf))
