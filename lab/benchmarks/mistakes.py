"""Mistakes that people and converters make in the file of a robot: seeded changes of its bytes or
its elements.

An element lost, doubled or renamed, a number that is none, a unit that is another, a file that is cut. ``URDF`` and
``MJCF`` hold the same kinds of mistakes, as far as both formats can have them.
"""

from __future__ import annotations

import random
import xml.etree.ElementTree as ET
from collections.abc import Callable

WORDS = ("", "abc", "nan", "inf", "1,5", "0x1p3", "1e999", "--1")

Change = Callable[[random.Random, bytes], bytes | None]


def tree(change: Callable[[random.Random, ET.Element], bool]) -> Change:
    """Wrap a change of the elements; it returns false where there is nothing to change."""

    def changed(draw: random.Random, data: bytes) -> bytes | None:
        root = ET.fromstring(data)
        return ET.tostring(root) if change(draw, root) else None

    return changed


def pick(draw: random.Random, root: ET.Element, path: str) -> ET.Element | None:
    found = root.findall(path)
    return draw.choice(found) if found else None


def lose(*paths: str) -> Change:
    """Return a change that loses an element."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        owners = [
            (owner, each) for path in paths for owner in root.findall(path.rpartition("/")[0] or ".")
            for each in owner.findall(path.rpartition("/")[2])
        ]  # fmt: skip
        if owners:
            owner, each = draw.choice(owners)
            owner.remove(each)
        return bool(owners)

    return tree(change)


def double(path: str) -> Change:
    """Return a change that doubles an element."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        each = pick(draw, root, path)
        if each is not None:
            root.append(each)
        return each is not None

    return tree(change)


def set_to(path: str, attribute: str, new: Callable[[random.Random, str], str]) -> Change:
    """Return a change that sets an attribute to another value."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        with_it = [each for each in root.findall(path) if attribute in each.attrib]
        if not with_it:
            return False
        each = draw.choice(with_it)
        before = each.attrib[attribute]
        each.attrib[attribute] = new(draw, before)
        return each.attrib[attribute] != before

    return tree(change)


def scaled(factor: float) -> Callable[[random.Random, str], str]:
    return lambda _, text: " ".join(repr(factor * float(word)) for word in text.split())


def of_all(path: str, attributes: tuple[str, ...], factor: float) -> Change:
    """Return a change of all values of a kind to another unit."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        for each in root.findall(path):
            for name in attributes:
                if name in each.attrib:
                    each.attrib[name] = scaled(factor)(draw, each.attrib[name])
        return bool(root.findall(path))

    return tree(change)


def misspelt(draw: random.Random, text: str) -> str:
    """Swap two letters of a word."""
    place = draw.randrange(max(1, len(text) - 1))
    return text[:place] + text[place + 1 : place + 2] + text[place : place + 1] + text[place + 2 :]


def misspell_tag(*paths: str) -> Change:
    """Return a change that misspells the name of an element."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        each = draw.choice([e for path in paths for e in root.findall(path)])
        before = each.tag
        each.tag = misspelt(draw, each.tag)
        return each.tag != before

    return tree(change)


def misspell_attribute(*paths: str) -> Change:
    """Return a change that misspells the name of an attribute."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        each = draw.choice([e for path in paths for e in root.findall(path) if e.attrib])
        name = draw.choice(sorted(each.attrib))
        wrong = misspelt(draw, name)
        if wrong in each.attrib:
            return False
        each.attrib[wrong] = each.attrib.pop(name)
        return True

    return tree(change)


def _swap_limits(draw: random.Random, root: ET.Element) -> bool:
    ranged = [e for e in root.findall("joint/limit") if {"lower", "upper"} <= set(e.attrib)]
    if not ranged:
        return False
    limit = draw.choice(ranged)
    limit.attrib["lower"], limit.attrib["upper"] = limit.attrib["upper"], limit.attrib["lower"]
    return limit.attrib["lower"] != limit.attrib["upper"]


def _swap_ends(draw: random.Random, root: ET.Element) -> bool:
    joint = pick(draw, root, "joint")
    if joint is None:
        return False
    parent, child = joint.find("parent"), joint.find("child")
    if parent is None or child is None:
        return False
    parent.attrib["link"], child.attrib["link"] = child.attrib["link"], parent.attrib["link"]
    return True


def cut(draw: random.Random, data: bytes) -> bytes:
    return data[: draw.randrange(1, len(data.rstrip()) - 1)]


def insert(*pieces: bytes) -> Change:
    def change(draw: random.Random, data: bytes) -> bytes:
        place = draw.randrange(len(data))
        return data[:place] + draw.choice(pieces) + data[place:]

    return change


def lose_byte(byte: bytes) -> Change:
    def change(draw: random.Random, data: bytes) -> bytes:
        place = draw.choice([k for k in range(len(data)) if data[k : k + 1] == byte])
        return data[:place] + data[place + 1 :]

    return change


def no_number(draw: random.Random, text: str) -> str:
    words = text.split() or [""]
    words[draw.randrange(len(words))] = draw.choice(WORDS)
    return " ".join(words)


def one_less(draw: random.Random, text: str) -> str:
    return " ".join(text.split()[:-1])


def negative(draw: random.Random, text: str) -> str:
    return repr(-abs(float(text)) or -1.0)


URDF: dict[str, Change] = {
    "the file is cut": cut,
    "bytes that are no UTF-8": insert(b"\xff", b"\xe9", b"\xc3("),
    "a quotation mark is lost": lose_byte(b'"'),
    "a bracket is lost": lose_byte(b">"),
    "another encoding than declared": lambda _, data: (
        b'<?xml version="1.0" encoding="utf-16"?>\n' + data
    ),
    "a link is lost": lose("link"),
    "a joint is lost": lose("joint"),
    "parent or child of a joint is lost": lose("joint/parent", "joint/child"),
    "a mass is lost": lose("link/inertial/mass"),
    "an inertia is lost": lose("link/inertial/inertia"),
    "an inertial is lost": lose("link/inertial"),
    "limits of a joint are lost": lose("joint/limit"),
    "a link is there twice": double("link"),
    "a joint is there twice": double("joint"),
    "a link has another name": set_to("link", "name", lambda _, text: f"{text}_2"),
    "a joint of an unknown type": set_to("joint", "type", misspelt),
    "an element is misspelt": misspell_tag("link/*", "joint/*", "link/inertial/*"),
    "an attribute is misspelt": misspell_attribute(
        "link/inertial/*", "joint/origin", "joint/limit", "joint/axis"
    ),
    "a mass that is no number": set_to("link/inertial/mass", "value", no_number),
    "an inertia that is no number": set_to("link/inertial/inertia", "ixx", no_number),
    "a place that is no number": set_to("joint/origin", "xyz", no_number),
    "an axis that is no number": set_to("joint/axis", "xyz", no_number),
    "a limit that is no number": set_to("joint/limit", "upper", no_number),
    "a place of two numbers": set_to("joint/origin", "xyz", one_less),
    "a negative mass": set_to("link/inertial/mass", "value", negative),
    "a negative inertia": set_to("link/inertial/inertia", "iyy", negative),
    "a mass of zero": set_to("link/inertial/mass", "value", lambda *_: "0"),
    "an axis of zero": set_to("joint/axis", "xyz", lambda *_: "0 0 0"),
    "an inertia that no body has": set_to("link/inertial/inertia", "izz", scaled(30.0)),
    "one mass in grams": set_to("link/inertial/mass", "value", scaled(1000.0)),
    "all masses in grams": of_all("link/inertial/mass", ("value",), 1000.0),
    "inertias in kg mm²": of_all(
        "link/inertial/inertia", ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), 1e6
    ),
    "places in millimetres": of_all("joint/origin", ("xyz",), 1000.0),
    "limits in degrees": of_all("joint/limit", ("lower", "upper"), 57.29578),
    "limits of a joint swapped": tree(_swap_limits),
    "parent and child swapped": tree(_swap_ends),
    "a negative effort": set_to("joint/limit", "effort", negative),
    "a negative speed limit": set_to("joint/limit", "velocity", negative),
    "a mesh that is not there": set_to(
        "link/visual/geometry/mesh", "filename", lambda _, text: f"{text}.old"
    ),
}
"""Changes of a URDF file, each by the name of the mistake."""


def _swap_range(draw: random.Random, root: ET.Element) -> bool:
    ranged = [e for e in root.iter("joint") if len(e.get("range", "").split()) == 2]
    if not ranged:
        return False
    joint = draw.choice(ranged)
    low, high = joint.attrib["range"].split()
    joint.attrib["range"] = f"{high} {low}"
    return low != high


def _double_beside(tag: str) -> Change:
    """Return a change that doubles an element of a kind, one beside the other."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        pairs = [(owner, each) for owner in root.iter() for each in owner.findall(tag)]
        if pairs:
            owner, each = draw.choice(pairs)
            owner.append(each)
        return bool(pairs)

    return tree(change)


def _close_loop(draw: random.Random, root: ET.Element) -> bool:
    names = [each.attrib["name"] for each in root.findall(BODIES) if "name" in each.attrib]
    if len(names) < 2:
        return False
    one, other = draw.sample(names, 2)
    tie = ET.SubElement(ET.SubElement(root, "equality"), "connect")
    tie.attrib.update({"body1": one, "body2": other, "anchor": "0 0 0"})
    return True


def _lose_attribute(path: str, attribute: str) -> Change:
    def change(draw: random.Random, root: ET.Element) -> bool:
        having = [each for each in root.findall(path) if attribute in each.attrib]
        if having:
            del draw.choice(having).attrib[attribute]
        return bool(having)

    return tree(change)


BODIES = ".//body"
MJCF: dict[str, Change] = {
    **{kind: URDF[kind] for kind in (
        "the file is cut", "bytes that are no UTF-8", "a quotation mark is lost", "a bracket is lost",
        "another encoding than declared",
    )},
    "a body is lost": lose(".//body/body"),
    "a joint is lost": lose(".//body/joint"),
    "a mass is lost": _lose_attribute(".//inertial", "mass"),
    "an inertia is lost": _lose_attribute(".//inertial", "diaginertia"),
    "an inertial is lost": lose(".//body/inertial"),
    "limits of a joint are lost": _lose_attribute(".//body/joint", "range"),
    "an actuator is lost": lose("actuator/general", "actuator/motor"),
    "a body is there twice": _double_beside("body"),
    "a joint is there twice": _double_beside("joint"),
    "a joint has another name": set_to(".//body/joint", "name", lambda _, text: f"{text}_2"),
    "a geom of an unknown type": set_to(".//body/geom", "type", misspelt),
    "an element is misspelt": misspell_tag(".//body/*", "actuator/*"),
    "an attribute is misspelt": misspell_attribute(
        ".//inertial", ".//body/joint", ".//body/geom", "actuator/*"
    ),
    "a mass that is no number": set_to(".//inertial", "mass", no_number),
    "an inertia that is no number": set_to(".//inertial", "diaginertia", no_number),
    "a place that is no number": set_to(BODIES, "pos", no_number),
    "an axis that is no number": set_to(".//body/joint", "axis", no_number),
    "a limit that is no number": set_to(".//body/joint", "range", no_number),
    "a place of two numbers": set_to(BODIES, "pos", one_less),
    "a negative mass": set_to(".//inertial", "mass", negative),
    "a negative inertia": set_to(".//inertial", "diaginertia", lambda _, text: f"-{text}"),
    "a mass of zero": set_to(".//inertial", "mass", lambda *_: "0"),
    "an axis of zero": set_to(".//body/joint", "axis", lambda *_: "0 0 0"),
    "an inertia that no body has": set_to(
        ".//inertial", "diaginertia", lambda _, text: " ".join(["30", *text.split()[1:]])
    ),
    "one mass in grams": set_to(".//inertial", "mass", scaled(1000.0)),
    "all masses in grams": of_all(".//inertial", ("mass",), 1000.0),
    "inertias in kg mm²": of_all(".//inertial", ("diaginertia",), 1e6),
    "places in millimetres": of_all(BODIES, ("pos",), 1000.0),
    "all lengths in millimetres": of_all(".//*", ("pos", "size"), 1000.0),
    "limits in degrees": of_all(".//body/joint", ("range",), 57.29578),
    "limits of a joint swapped": tree(_swap_range),
    "a negative effort": set_to("actuator/*", "forcerange", lambda _, text: "1 -1"),
    "a loop is closed": tree(_close_loop),
}  # fmt: skip
"""Changes of an MJCF file as MuJoCo writes it, each by the name of the mistake."""
