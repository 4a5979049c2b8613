"""Checks of links and joints: names, the tree that hangs on the base, every joint and every body for itself, looks.

A mesh that is not there is no fault: the robot runs without.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ...files.problems import listing
from ..element import Vector3
from ..robot_description import Appearance, Box, Joint, Link, Mesh
from ..shapes import THINNEST, Hull, is_body
from .errors import Draft, Path, nearest, number, vector

RESERVED = {"links": ("world",), "joints": ("base",), "contacts": ("floor",)}
"""Names that the models keep for themselves."""


def check_names(draft: Draft) -> None:
    """Report names that stand twice in one list, names without text and names that are taken."""
    for key, word in (("links", "link"), ("joints", "joint"), ("feet", "foot"),
                      ("contacts", "contact")):  # fmt: skip
        first: dict[str, int] = {}
        elements = draft.data.get(key)
        if not isinstance(elements, (list, tuple)):
            continue
        for k, element in enumerate(elements):
            name = element.get("name") if isinstance(element, Mapping) else None
            if not isinstance(name, str):
                continue
            path = (key, k, "name")
            if name in first:
                draft.add(
                    path, f"{word} {name!r} is there twice", f"another name than {word} "
                    f"{first[name] + 1}", f"name: {name}", f"name: {name}_2",
                )  # fmt: skip
            elif not name.strip():
                draft.add(path, f"{word} {k + 1} has an empty name", "a name", repr(name))
            elif name in RESERVED.get(key, ()):
                draft.add(
                    path, f"no {word} can be called {name!r}: the models use that name",
                    "another name", f"name: {name}", f"name: {name}_{word}",
                )  # fmt: skip
            first.setdefault(name, k)


def check_tree(draft: Draft) -> None:
    """Report links that no tree can hold: unknown, carried twice, in a ring or not connected."""
    links, base = draft.names("links"), draft.data.get("base")
    if not isinstance(base, str):
        return
    if base not in links:
        draft.unknown(("base",), "the base", base, "link", links)
    joints = draft.elements("joints", Joint)
    carrier: dict[str, Joint] = {}
    sound = base in links
    for k, joint in joints:
        for key, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                draft.unknown(
                    ("joints", k, key), f"the {key} of joint {joint.name}", link, "link", links
                )
                sound = False
        if joint.child == base:
            draft.add(
                ("joints", k, "child"), f"joint {joint.name} carries the base {base}",
                "a base that no joint carries", f"child: {base}",
                "swap the joint's parent and child, or name another base",
            )  # fmt: skip
            sound = False
        elif joint.child in carrier:
            draft.add(
                ("joints", k, "child"),
                f"link {joint.child} is carried by two joints, "
                f"{carrier[joint.child].name} and {joint.name}",
                "one joint that carries each link", f"child: {joint.child}",
            )  # fmt: skip
            sound = False
        carrier.setdefault(joint.child, joint)
    _check_connection(draft, links, base, carrier)
    if sound:
        _check_order(draft, base, [joint for _, joint in joints])


def _check_connection(draft: Draft, links: list[str], base: str, carrier: dict[str, Joint]) -> None:
    """Report rings, each once, and links that no joint carries."""
    told: list[str] = []
    for k, link in enumerate(links):
        if link == base:
            continue
        if link not in carrier:
            if not _unread_joint(draft):
                draft.add(
                    ("links", k), f"link {link} hangs on nothing: no joint carries it",
                    f"a joint with child: {link}", "none",
                )  # fmt: skip
            continue
        way = [link]
        while way[-1] in carrier and way[-1] != base and carrier[way[-1]].parent not in way:
            way.append(carrier[way[-1]].parent)
        last = carrier.get(way[-1])
        if way[-1] == base or last is None or link in told:
            continue
        ring = way[way.index(last.parent) :]
        if link in ring:
            told += ring
            names = [carrier[each].name for each in ring]
            draft.add(
                ("joints", _index(draft, names[0]), "parent"),
                f"joints {listing(names)} carry each other in a ring and do not hang on the base",
                f"a tree that hangs on {base}", " <- ".join([*ring, ring[0]]),
            )  # fmt: skip


def _unread_joint(draft: Draft) -> bool:
    """Check whether some joint could not be read, so that links may seem to hang on nothing."""
    found = draft.data.get("joints")
    return not isinstance(found, (list, tuple)) or len(draft.elements("joints", Joint)) < len(found)


def _index(draft: Draft, name: str) -> int:
    return next(k for k, joint in draft.elements("joints", Joint) if joint.name == name)


def _check_order(draft: Draft, base: str, joints: list[Joint]) -> None:
    """Report the first joint that is not where a walk through the tree, branch by branch, has it."""
    walk: list[Joint] = []

    def visit(link: str) -> None:
        for joint in joints:
            if joint.parent == link:
                walk.append(joint)
                visit(joint.child)

    visit(base)
    if len(walk) < len(joints):
        return  # Not a tree; that is reported.
    for joint, right in zip(joints, walk, strict=True):
        if joint is not right:
            draft.add(
                ("joints", _index(draft, joint.name)),
                f"joint {joint.name} is listed where joint {right.name} belongs: joints are "
                "listed branch by branch, each behind the joint that carries its parent",
                "the order " + listing([each.name for each in walk], 40),
                "the order " + listing([each.name for each in joints], 40),
            )  # fmt: skip
            return


__all__ = ["check_tree", "nearest"]


UNIT = 1e-6
"""Tolerance of an axis' length about one: six digits in a file are enough."""


def check_joints(draft: Draft) -> None:
    """Report origins that are not finite, axes that are no direction, limits that are reversed."""
    for k, joint in draft.elements("joints", Joint):
        path: Path = ("joints", k)
        if not all(map(math.isfinite, joint.origin)):
            draft.add(
                (*path, "origin"), f"joint {joint.name} is nowhere",
                "three finite numbers of m", vector(joint.origin),
            )  # fmt: skip
        check_axis(draft, (*path, "axis"), f"joint {joint.name}", joint.axis)
        if joint.limits is not None:
            _check_limits(draft, (*path, "limits"), joint.name, *joint.limits)


def check_axis(draft: Draft, path: Path, owner: str, axis: Vector3) -> None:
    """Report an axis that is no unit vector."""
    length = math.hypot(*axis)
    found, expected = vector(axis), "a vector of length 1"
    if not math.isfinite(length) or length < 1e-9:
        draft.add(path, f"the axis of {owner} is no direction", expected, found, "axis: [0, 0, 1]")
    elif abs(length - 1.0) > UNIT:
        unit = vector(round(value / length, 9) for value in axis)
        draft.add(
            path, f"the axis of {owner} has length {number(length)}", expected, found,
            f"axis: {unit}",
        )  # fmt: skip


def _check_limits(draft: Draft, path: Path, name: str, lower: float, upper: float) -> None:
    found, expected = vector((lower, upper)), "[lower, upper] with lower < upper"
    if math.isnan(lower) or math.isnan(upper):
        draft.add(path, f"the limits of joint {name} are not numbers", expected, found)
    elif math.isinf(lower) or math.isinf(upper):
        draft.add(
            path, f"the limits of joint {name} are infinite", "two finite numbers, or no limits",
            found, "limits: null",
        )  # fmt: skip
    elif lower > upper:
        draft.add(
            path, f"the limits of joint {name} are reversed", expected, found,
            f"limits: {vector((upper, lower))}",
        )  # fmt: skip
    elif lower == upper:
        draft.add(
            path, f"the limits of joint {name} leave it no room", expected, found,
            f"held: {{{name}: {number(lower)}}}",
        )  # fmt: skip


TRIANGLE = 1e-6
"""Tolerance of the triangle inequality of principal moments, relative to the largest: so much is rounding in published
files.
"""


def check_bodies(draft: Draft) -> None:
    """Report masses, centres, inertias and shapes that no body can have.

    The base of a robot that is bolted to the world needs no mass: nothing moves it.
    """
    bolted = draft.data.get("base") if draft.data.get("base_joint") == "fixed" else None
    for k, link in draft.elements("links", Link):
        path: Path = ("links", k)
        empty = link.mass == 0.0 and not any(link.inertia)
        if empty and link.name == bolted:
            pass
        elif not (math.isfinite(link.mass) and link.mass > 0.0):
            draft.add(
                (*path, "mass"), f"link {link.name} has a mass of {number(link.mass)} kg",
                "a positive number of kg", number(link.mass),
                "mass: 0.1",
            )  # fmt: skip
        if not all(map(math.isfinite, link.com)):
            draft.add(
                (*path, "com"), f"link {link.name} has no centre of mass",
                "three finite numbers of m", vector(link.com),
            )  # fmt: skip
        if not empty:
            _check_inertia(draft, (*path, "inertia"), link)
        for i, shape in enumerate(link.shapes):
            if isinstance(shape, Hull):
                if not is_body(shape):
                    draft.add(
                        (*path, "shapes", i), f"shape {i + 1} of link {link.name} is no hull",
                        f"four or more finite corners that are {THINNEST * 1e3:g} mm or more out of one plane",
                        f"{len(shape.corners)} corners",
                    )  # fmt: skip
                continue
            values = (*shape.start, *shape.end, shape.radius)
            if not all(map(math.isfinite, values)) or shape.radius <= 0.0:
                draft.add(
                    (*path, "shapes", i), f"shape {i + 1} of link {link.name} is no capsule",
                    "finite ends and a positive radius [m]",
                    f"start {vector(shape.start)}, end {vector(shape.end)}, "
                    f"radius {number(shape.radius)}",
                )  # fmt: skip


def _check_inertia(draft: Draft, path: Path, link: Link) -> None:
    name, found = f"link {link.name}", vector(link.inertia)
    if not all(map(math.isfinite, link.inertia)):
        draft.add(path, f"{name} has no inertia", "six finite numbers of kg m^2", found)
        return
    xx, yy, zz, xy, xz, yz = link.inertia
    moments = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    shown = vector(moments.tolist())
    if moments[0] <= 0.0:
        draft.add(
            path, f"{name} has an inertia that no body has: a principal moment is not positive",
            "three positive principal moments", f"{found}, with principal moments {shown}",
        )  # fmt: skip
    elif moments[2] > (moments[0] + moments[1]) * (1.0 + TRIANGLE):
        draft.add(
            path,
            f"{name} has an inertia that no body has: "
            "a principal moment is larger than the sum of the others",
            "principal moments of which each is at most the sum of the others",
            f"{found}, with principal moments {shown}",
        )


def check_looks(draft: Draft) -> None:
    """Report looks of unknown links, and parts that would be nowhere or have no direction."""
    links = draft.names("links")
    for name, _ in draft.entries("looks"):
        if name not in links:
            draft.unknown(("looks", name), "the link of a look", name, "link", links)
        look = draft.part(Appearance, "looks", name)
        if not isinstance(look, Appearance):
            continue
        solid: Mapping[str, Sequence[Mesh | Box]] = {"meshes": look.meshes, "boxes": look.boxes}
        for kind, elements in solid.items():
            for k, element in enumerate(elements):
                path = ("looks", name, kind, k)
                what = f"{'a mesh' if kind == 'meshes' else 'a box'} of link {name}"
                more = element.scale if isinstance(element, Mesh) else ()
                if not all(map(math.isfinite, (*element.position, *element.orientation, *more))):
                    draft.add(path, f"{what} is nowhere", "finite numbers", "others")
                elif not any(element.orientation):
                    draft.add(
                        (*path, "orientation"), f"{what} has no orientation",
                        "a quaternion x, y, z, w that is not zero", str(list(element.orientation)),
                        "orientation: [0, 0, 0, 1]",
                    )  # fmt: skip
                if isinstance(element, Box) and 2.0 * element.round > min(element.size):
                    draft.add(
                        (*path, "round"), f"{what} is rounded by more than half of its least side",
                        f"at most {0.5 * min(element.size):g} m", f"{element.round:g} m",
                    )  # fmt: skip
        for k, turned in enumerate(look.turned):
            path = ("looks", name, "turned", k)
            what = f"a turned part of link {name}"
            places = [along for _, along in turned.profile]
            if not all(map(math.isfinite, (*turned.position, *turned.axis, *places))):
                draft.add(path, f"{what} is nowhere", "finite numbers", "others")
            elif not any(turned.axis):
                draft.add(
                    (*path, "axis"), f"{what} has an axis without direction",
                    "a vector x, y, z that is not zero", str(list(turned.axis)), "axis: [0, 0, 1]",
                )  # fmt: skip
            elif not any(radius for radius, _ in turned.profile):
                draft.add(
                    (*path, "profile"), f"{what} has no thickness", "a radius above zero", "0 m"
                )
