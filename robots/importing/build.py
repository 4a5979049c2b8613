"""Conversion of the bodies of a file to the links and joints of a description.

Bodies that no joint moves become part of the body they are fixed to, and every link's frame is put
at its joint and turned parallel to the base's at the zero of all joints, so that joint axes may
point anywhere. A body with several joints becomes several links: each but the last is given a
millionth of the body, because a link has a mass; together they are the body at the zero pose.
So is a link without mass given a thousandth of what it carries, if that has any. Else it becomes part of
what carries it. A link with a mass and no inertia is a ball of it, of the density of water.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...files.problems import listing
from ...mathematics.arrays import Array
from ..validation import DescriptionError, RobotError
from .capsules import Capsule, coarse
from .hulls import RawShape
from .raw_model import Inertial, RawBody, RawJoint, RawModel, joined

GROUND = "ground"
"""The base link of a robot that is bolted to the world by a file's own world body."""
SHARE = 1e-3
"""Share of what it carries that a link without mass has."""
SPLIT = 1e-6
"""Share of a body with several joints that each of its links but the last has; of light ones ``SHARE``."""
LIGHTEST, ROUNDEST = 1e-11, 1e-12
"""The least mass [kg] and inertia [kg m^2] of such a link, with which simulators compute."""


def split_share(body: Inertial) -> float:
    """Return the share of a body with several joints that each of its links but the last has."""
    if not np.isfinite(body.inertia).all():
        return SHARE  # a fault that is told of the description
    least = float(np.linalg.eigvalsh(body.inertia)[0])
    heavy = SPLIT * body.mass > LIGHTEST and SPLIT * least > ROUNDEST
    return SPLIT if heavy else SHARE


@dataclass(frozen=True)
class BodyFrame:
    """The pose of a body of the file: its ``link``, and rotation and position [m] in its frame."""

    link: str
    rotation: Array
    position: Array

    def point(self, place: Any) -> list[float]:
        """Convert a point [m] from the body's frame to the link's."""
        return tidy(self.rotation @ np.asarray(place, dtype=float) + self.position)


@dataclass
class BuiltLink:
    """A link that is being put together: its origin [m] in the base's frame and its content."""

    name: str
    origin: Array
    bodies: list[Inertial] = field(default_factory=list)
    shapes: list[RawShape] = field(default_factory=list)


@dataclass(frozen=True)
class LinkTree:
    """The tree of a description: plain data for ``base``, ``base_joint``, ``links``, ``joints``,
    the file's joints by name, where every body of the file went, and what was done to links without mass
    in ``notes``."""

    base: str
    base_joint: str
    links: list[dict[str, Any]]
    joints: list[dict[str, Any]]
    raw_joints: Mapping[str, RawJoint]
    frames: Mapping[str, BodyFrame]
    notes: tuple[str, ...] = ()
    balls: tuple[str, ...] = ()
    """Links without an inertia in the file, which are balls."""


def tidy(values: Any, digits: int = 11) -> list[float]:
    """Return plain numbers without rounding errors, so that every machine reads the same robot."""
    return [float(value) for value in np.round(np.asarray(values, dtype=float), digits) + 0.0]


def build(model: RawModel, welded: Collection[str] = (), base_joint: str = "") -> LinkTree:
    """Return the tree of links and joints.

    Args:
        model: what the file holds.
        welded: names of joints that are taken for fixed at zero.
        base_joint: ``floating``, ``planar`` or ``fixed`` where the file does not decide it or the
            user decides otherwise; empty to go by the file.

    Raises:
        RobotError: the file holds several robots, or joints that a description has not.
    """
    root, found_joint, dropped = _base_of(model, base_joint)
    still = {*welded, *dropped}
    start = model.bodies.get(root) or RawBody(
        GROUND, "", np.eye(3), np.zeros(3), Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    )
    turn, place = start.rotation, start.position
    links = {start.name: BuiltLink(start.name, np.zeros(3), [start.inertial], [*start.shapes])}
    frames = {start.name: BodyFrame(start.name, np.eye(3), np.zeros(3))}
    joints: list[dict[str, Any]] = []
    raw: dict[str, RawJoint] = {}
    parts: set[str] = set()
    beside: list[str] = []
    for body in model.bodies.values():
        if body.name == start.name:
            continue
        parent = start.name if body.parent == model.world and root == GROUND else body.parent
        if parent not in frames:
            beside.append(body.name)
            continue
        moving = [joint for joint in body.joints if joint.name not in still]
        share = split_share(body.inertial) if len(moving) > 1 else 0.0
        rotation, position = turn.T @ body.rotation, turn.T @ (body.position - place)
        carrier = links[frames[parent].link]
        for k, joint in enumerate(moving):
            last = k == len(moving) - 1
            name = body.name if last else f"{body.name}_{k + 1}"
            anchor = turn.T @ (joint.anchor - place)
            link = links[name] = BuiltLink(name, anchor)
            if not last:
                piece = body.inertial.scaled(share)
                link.bodies.append(piece.moved(rotation, position - anchor))
                if body.inertial.mass >= NO_MASS:
                    parts.add(name)
            limits = None if joint.limits is None else list(joint.limits)
            joints.append({
                "name": joint.name, "kind": joint.kind, "parent": carrier.name, "child": name,
                "origin": tidy(anchor - carrier.origin), "axis": _axis(turn.T @ joint.axis),
                "limits": limits,
            })  # fmt: skip
            raw[joint.name] = joint
            carrier = link
        pieces = max(len(moving) - 1, 0)
        inertial = body.inertial.scaled(1.0 - share * pieces) if pieces else body.inertial
        frame = BodyFrame(carrier.name, rotation, position - carrier.origin)
        frames[body.name] = frame
        carrier.bodies.append(inertial.moved(frame.rotation, frame.position))
        carrier.shapes += [each.moved(frame.rotation, frame.position) for each in body.shapes]
    moving_links = {
        n: link for n, link in links.items() if n != start.name or found_joint != "fixed"
    }
    bare, balls, notes = _complete_links(moving_links, joints, parts)
    if bare:
        tree = build(model, [*welded, *bare.values()], base_joint)
        merged = [
            f"link {link} has no mass and carries none: it is part of {_holder(tree, link)} here, and joint "
            f"{joint} is fixed"
            for link, joint in bare.items()
        ]
        return replace(tree, notes=(*merged, *tree.notes))
    return LinkTree(
        start.name, found_joint, [_link_data(link) for link in links.values()], joints, raw, frames,
        (*notes, *_beside(beside)), tuple(balls),
    )  # fmt: skip


def _beside(bodies: list[str]) -> list[str]:
    """Return a note of bodies that hang on nothing of the robot."""
    return [f"left out: bodies beside the robot: {listing(bodies, 6)}"] if bodies else []


def _holder(tree: LinkTree, name: str) -> str:
    """Return the link that a body of the file became part of."""
    return tree.frames[name].link if name in tree.frames else tree.base


NO_MASS = 1e-9
"""kg; a link of less has none."""
NO_INERTIA = 1e-12
"""m^2; a link whose inertia is less than its mass times this has none."""
WATER = 1000.0
"""kg/m^3"""


def _complete_links(
    links: Mapping[str, BuiltLink], joints: list[dict[str, Any]], parts: Collection[str]
) -> tuple[dict[str, str], list[str], list[str]]:
    """Give mass and inertia to links that have none, but not to ``parts`` of a body. Returns those that carry none either, with the
    joint that carries each, those that became balls, and notes of what was given."""
    bare, balls, notes = dict[str, str](), list[str](), list[str]()
    carrier = {joint["child"]: joint["name"] for joint in joints}
    for name in reversed([*links]):
        link, whole = links[name], joined(links[name].bodies)
        if name in parts:
            continue
        if abs(whole.mass) < NO_MASS:
            behind = [j["child"] for j in joints if j["parent"] == name and j["child"] not in bare]
            heavy = next(
                (links[child] for child in behind if joined(links[child].bodies).mass > 0.0), None
            )
            if heavy is None:
                if name in carrier:
                    bare[name] = carrier[name]
                continue
            body = joined(heavy.bodies)
            piece = body.scaled(SHARE).moved(np.eye(3), heavy.origin - link.origin)
            link.bodies[:], heavy.bodies[:] = [piece], [body.scaled(1.0 - SHARE)]
            notes.append(f"link {name} has no mass: it has a thousandth of {heavy.name} here")
        elif np.abs(whole.inertia).max() < NO_INERTIA * whole.mass:
            radius = (3.0 * whole.mass / (4.0 * np.pi * WATER)) ** (1.0 / 3.0)
            ball = 0.4 * whole.mass * radius**2 * np.eye(3)
            link.bodies[:] = [Inertial(whole.mass, whole.com, ball)]
            balls.append(name)
            notes.append(
                f"link {name} has no inertia: it is a ball of its mass and of water's density here"
            )
    return bare, balls, notes[::-1]


def _base_of(model: RawModel, wanted: str) -> tuple[str, str, list[str]]:
    """Return the base's name (``GROUND`` for the world), how it is held, and joints that say just that."""
    roots = [body for body in model.bodies.values() if body.parent == model.world]

    def has_joints(root: RawBody) -> bool:
        within = {root.name}
        for body in model.bodies.values():
            if body.parent in within:
                within.add(body.name)
                if body.joints:
                    return True
        return False

    free = [body for body in roots if any(joint.kind == "free" for joint in body.joints)]
    others = [
        joint.name
        for body in model.bodies.values()
        for joint in body.joints
        if joint.kind == "ball"
        or (joint.kind == "free" and body.name not in [f.name for f in free])
    ]
    if others:
        raise _error(model, f"joints {listing(others)} are no hinges or slides, which a robot's are",
                     "one axis each")  # fmt: skip
    if len(free) > 1 and sum(map(has_joints, free)) == 1:
        free = [body for body in free if has_joints(body)]  # the others are things beside it
    if len(free) > 1:
        names = listing([body.name for body in free])
        raise _error(
            model, f"bodies {names} move freely: that is more than one robot", "one", names
        )
    if free:
        released = [joint.name for joint in free[0].joints]
        return free[0].name, wanted or "floating", released
    if not roots:
        raise _error(model, "the file holds no body besides the world", "at least one", "none")
    if len(roots) == 1 and _is_planar(roots[0]):
        released = [joint.name for joint in roots[0].joints]
        return roots[0].name, wanted or "planar", released
    if len(roots) == 1 and not roots[0].joints and not model.names_world:
        return roots[0].name, wanted or "floating", []
    return GROUND, wanted or "fixed", []


def bolted(model: RawModel, base_joint: str) -> list[str]:
    """Return a note of an MJCF body that carries two limbs or more and no joint holds: its free joint may be lost."""
    roots = [body for body in model.bodies.values() if body.parent == model.world]
    if model.is_urdf or base_joint != "fixed" or len(roots) != 1 or roots[0].joints:
        return []
    limbs = [body for body in model.bodies.values() if body.parent == roots[0].name and body.joints]
    if len(limbs) < 2:
        return []
    return [f"{roots[0].name} has no free joint, so it is bolted to the world"]


def _is_planar(body: RawBody) -> bool:
    """Check whether a body is carried by slides along x and z and a hinge about y, without motors."""
    kinds = sorted(
        (joint.kind, tuple(tidy(joint.axis)))
        for joint in body.joints
        if joint.effort == 0.0 and joint.limits is None
    )
    wanted = [("hinge", (0.0, 1.0, 0.0)), ("slide", (0.0, 0.0, 1.0)), ("slide", (1.0, 0.0, 0.0))]
    return len(body.joints) == 3 and kinds == wanted


def _error(model: RawModel, message: str, expected: str = "", found: str = "") -> RobotError:
    return RobotError(str(model.path), [DescriptionError((), message, expected, found)])


def _axis(axis: Array) -> list[float]:
    """Return a unit vector; what is nearly a coordinate axis is one."""
    straight = np.where(np.abs(axis - np.round(axis)) < 1e-10, np.round(axis), axis)
    return tidy(straight / np.linalg.norm(straight), 12)


def _link_data(link: BuiltLink) -> dict[str, Any]:
    whole = joined(link.bodies)
    tensor = whole.inertia
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    shapes = [
        {"start": coarse(s.start), "end": coarse(s.end), "radius": coarse(np.array([s.radius]))[0]}
        if isinstance(s, Capsule)
        else {"corners": [coarse(corner) for corner in s.corners]}
        for s in link.shapes
    ]
    return {
        "name": link.name,
        "mass": float(f"{whole.mass:.11g}"),
        "com": tidy(whole.com),
        "inertia": [float(f"{tensor[pair]:.11g}") for pair in pairs],
        "shapes": shapes,
    }
