"""Finds elements and attributes of a URDF that are nearly words of it, and inertias that no body has.

Every reader of URDFs passes over what it does not know, since many tools put elements of their own into the files. So
``<inertila>`` or ``loewr`` leaves a robot without an inertia or a limit, and nothing says so. Words that are far from all
of a URDF's own are left alone.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree

from ...files.problems import nearest

NEAR = 0.8
"""The likeness from which a word is taken for another one, misspelt."""
LEAST_INERTIA = -1e-12
"""Rounding of what wrote the file [kg m^2]."""
PRODUCTS = ("ixy", "ixz", "iyz")
"""Elements of an inertia that may be negative."""
CHILDREN: dict[str, tuple[str, ...]] = {
    "robot": ("link", "joint", "material"),
    "link": ("inertial", "visual", "collision"),
    "inertial": ("origin", "mass", "inertia"),
    "visual": ("origin", "geometry", "material"),
    "collision": ("origin", "geometry"),
    "geometry": ("mesh", "box", "cylinder", "sphere", "capsule"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "calibration", "safety_controller"),
}  # fmt: skip
"""The elements that a URDF knows, by the one they stand in."""
ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "link": ("name",),
    "joint": ("name", "type"),
    "origin": ("xyz", "rpy"),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "parent": ("link",),
    "child": ("link",),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction"),
    "mimic": ("joint", "multiplier", "offset"),
    "mesh": ("filename", "scale"),
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
}
"""The attributes that a URDF knows, by their element."""


def misspelt(part: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Yield the words of an element and of all in it that are nearly a URDF's, as they are and as they should be."""
    known = ATTRIBUTES.get(part.tag, ())
    for word in part.attrib:
        near = _near(word, known)
        if near and near not in part.attrib:
            yield f"{word}= in <{part.tag}>", f"{near}="
    for inner in part:
        near = _near(inner.tag, CHILDREN.get(part.tag, ()))
        if near:
            yield f"<{inner.tag}>", f"<{near}>"
        elif inner.tag in CHILDREN.get(part.tag, ()):
            yield from misspelt(inner)


def _near(word: str, known: tuple[str, ...]) -> str:
    """Return the known word that ``word`` nearly is; empty if it is one, or far from all."""
    if word in known:
        return ""
    swapped = [each for each in known if sorted(each) == sorted(word)]
    return next(iter(swapped or nearest(word, known, 1, NEAR)), "")


TURN = 2.0 * math.pi
"""rad"""
ROUND = 5.0
"""Degrees of which angles that people write are multiples."""


def turned_by_degrees(part: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Yield the ``rpy`` of a link or joint that seem to be degrees, and what they are in radians: whole multiples of five
    degrees beyond a turn.
    """
    for origin in part.iter("origin"):
        angles = [read_number(text) for text in (origin.get("rpy") or "").split()]
        if any(abs(a) > TURN and a % ROUND == 0.0 for a in angles):
            radians = " ".join(f"{math.radians(a):.9g}" for a in angles)
            yield f'rpy="{origin.get("rpy")}"', f'rpy="{radians}"'


def limited_by_degrees(joint: ElementTree.Element) -> str:
    """Return a sentence on limits of a hinge that seem to be degrees, beyond two turns; empty where they do not. Some hinges
    do turn so far, so it is no fault."""
    limit = joint.find("limit")
    if limit is None or joint.get("type") != "revolute":
        return ""
    ends = {key: read_number(limit.get(key)) for key in ("lower", "upper") if limit.get(key)}
    if not any(abs(a) > 2.0 * TURN and a % ROUND == 0.0 for a in ends.values()):
        return ""
    given = " ".join(f'{key}="{limit.get(key)}"' for key in ends)
    radians = " ".join(f'{key}="{math.radians(a):.9g}"' for key, a in ends.items())
    return f"limits of joint {joint.get('name', '')} look like degrees, {given}, and a URDF's are radians; write {radians} if they are"


def read_number(text: str | None) -> float:
    """Return the number of an attribute; NaN where it is none."""
    try:
        return float(text or "")
    except ValueError:
        return math.nan


def wrong_inertia(link: ElementTree.Element) -> str:
    """Return the mass of a link and the numbers of its inertia that no body has, as they are written; empty where there
    are none.

    MuJoCo does not look at those of a link that a fixed joint holds.
    """
    inertia, mass = link.find("inertial/inertia"), link.find("inertial/mass")
    numbers = (
        {} if inertia is None else {name: inertia.get(name, "0") for name in ATTRIBUTES["inertia"]}
    )
    if mass is not None:
        numbers["mass"] = mass.get("value", "0")
    wrong = []
    for name, text in numbers.items():
        try:
            value = float(text)
        except ValueError:
            continue  # MuJoCo names the line
        if not math.isfinite(value) or (name not in PRODUCTS and value < LEAST_INERTIA):
            wrong.append(f"{name} {text}")
    return ", ".join(wrong)
