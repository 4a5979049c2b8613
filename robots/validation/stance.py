"""Checks of the feet, of what they touch the ground with, and of the pose the robot stands in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ...files.problems import listing
from ..robot_description import ContactPoint, Foot, Joint
from .errors import Draft, Path, number, vector

MARGIN = 1e-9
"""Tolerance of a pose at a joint's limit [rad, m]: rounding."""


def check_feet(draft: Draft) -> None:
    """Report feet on unknown links or without contact points, and points that nothing can touch."""
    links, feet = draft.names("links"), draft.names("feet")
    contacts = draft.elements("contacts", ContactPoint)
    for k, foot in draft.elements("feet", Foot):
        if foot.link not in links:
            draft.unknown(
                ("feet", k, "link"), f"the link of foot {foot.name}", foot.link, "link", links
            )
        if not all(map(math.isfinite, foot.sole)):
            draft.add(
                ("feet", k, "sole"), f"the sole of foot {foot.name} is nowhere",
                "three finite numbers of m", vector(foot.sole),
            )  # fmt: skip
        points = draft.data.get("contacts") or ()
        if len(contacts) == len(points) and all(c.foot != foot.name for _, c in contacts):
            draft.add(
                ("feet", k), f"foot {foot.name} has no contact point", "at least one in contacts",
                "none", f"contacts: [{{name: {foot.name}_1, foot: {foot.name}, "
                f"position: {vector(foot.sole)}, radius: 0.005}}]",
            )  # fmt: skip
    if contacts and not feet:
        owners = list(dict.fromkeys(contact.foot for _, contact in contacts))
        draft.add(
            ("contacts",), f"contact points belong to feet that are not there: {listing(owners)}",
            "a foot for each in feet", "feet: none", "feet, or no contacts",
        )  # fmt: skip
    for k, contact in contacts:
        path: Path = ("contacts", k)
        if contact.foot not in feet:
            draft.unknown(
                (*path, "foot"), f"the foot of contact {contact.name}", contact.foot, "foot", feet
            )
        if not all(map(math.isfinite, contact.position)):
            draft.add(
                (*path, "position"), f"contact {contact.name} is nowhere",
                "three finite numbers of m", vector(contact.position),
            )  # fmt: skip
        if not (math.isfinite(contact.radius) and contact.radius > 0.0):
            draft.add(
                (*path, "radius"),
                f"contact {contact.name} has a radius of {number(contact.radius)} m",
                "a positive number of m: the rubber there is round", number(contact.radius),
                "radius: 0.005",
            )  # fmt: skip
    for name, value in draft.entries("points"):
        link = value[0] if isinstance(value, Sequence) and len(value) == 2 else None
        if isinstance(link, str) and link not in links:
            draft.unknown(("points", name, 0), f"the link of point {name}", link, "link", links)


def check_poses(draft: Draft) -> None:
    """Report poses of unknown joints and angles outside the joints' limits."""
    joints = draft.names("joints")
    limits = {
        joint.name: (k, *joint.limits)
        for k, joint in draft.elements("joints", Joint)
        if joint.limits is not None and joint.limits[0] < joint.limits[1]
    }
    angles = {key: dict(draft.entries(key)) for key in ("standing", "held")}
    for pose, given in angles.items():
        for name, value in given.items():
            if name not in joints:
                draft.unknown((pose, name), f"a joint in {pose}", name, "joint", joints)
                continue
            angle = _number(value)
            if angle is None:
                continue
            if not math.isfinite(angle):
                draft.add((pose, name), f"{pose}: joint {name} is at no angle", "a finite number",
                          number(angle))  # fmt: skip
            elif name in limits:
                _, lower, upper = limits[name]
                if not lower - MARGIN <= angle <= upper + MARGIN:
                    draft.add(
                        (pose, name), f"{pose}: joint {name} is outside its limits",
                        f"a value in {vector((lower, upper))}", number(angle),
                        f"{name}: {number(min(max(angle, lower), upper))}",
                    )  # fmt: skip
    for name, angle in angles["held"].items():
        stands = angles["standing"].get(name, angle)
        if _number(stands) != _number(angle):
            draft.add(
                ("standing", name), f"joint {name} is held at another angle than it stands at",
                f"{name}: {angle}, as in held", f"{name}: {stands}",
            )  # fmt: skip
    if not all(isinstance(draft.data.get(key) or {}, Mapping) for key in angles):
        return
    for name, (k, lower, upper) in limits.items():
        if not any(name in given for given in angles.values()) and not (
            lower - MARGIN <= 0.0 <= upper + MARGIN
        ):
            draft.add(
                ("joints", k, "limits"),
                f"joint {name} stands at 0, which is outside its limits: standing does not name it",
                f"an angle in {vector((lower, upper))} in standing", "none",
                f"standing: {{{name}: {number(0.5 * (lower + upper))}}}",
            )  # fmt: skip


def _number(value: object) -> float | None:
    try:
        return float(value)  # type: ignore[arg-type]  # what is no number raises
    except (TypeError, ValueError):
        return None
