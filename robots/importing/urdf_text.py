"""Reads from a URDF what MuJoCo drops: speed limits, mimic joints, the lines of elements."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from ...files.problems import listing
from ..validation import DescriptionError, RobotError
from ..validation.errors import number
from .urdf_words import misspelt, turned_by_degrees, wrong_inertia
from .xacro_text import XACRO, expand_xacro

HINGES = ("revolute", "continuous")
KINDS = (*HINGES, "prismatic", "fixed", "floating", "planar")
DECLARED = re.compile(r"\s*<\?xml[^>]*?\sencoding\s*=\s*[\"']([^\"']*)[\"']")
"""Pattern of the encoding that a file declares."""


@dataclass(frozen=True)
class UrdfJoint:
    """A joint's ``effort`` and ``speed`` (NaN where not given), the joint it mimics, if any, whose position times
    ``multiplier`` plus ``offset`` is its own, and its ``range``: ``free`` for a joint that has no limits though its type asks for them, ``none`` where they
    leave it at zero, else empty. ``half`` are the limits [rad, m] of a joint that has one, with zero as the other."""

    effort: float
    speed: float
    mimics: str
    range: str = ""
    multiplier: float = 1.0
    offset: float = 0.0
    half: tuple[float, float] | None = None


class XmlFile:
    """An XML file, its content and root, and where a link or joint of some name stands in it. Of a xacro file it
    is the URDF that it stands for, and so are the lines."""

    def __init__(self, path: Path) -> None:
        """Read the file. Raises ``RobotError`` where it is no URDF and no MJCF."""
        self.path = path
        try:
            text = expand_xacro(path) if path.suffix == XACRO else path.read_text("utf-8")
            if not text.strip():
                raise self.error("the file is empty", "a URDF or MJCF file")
            self._check_encoding(text)
            self.root = ElementTree.fromstring(text)
            self.content = text
            self.hangs_from_world = self._add_world()
            # Comments are blanked: nothing is found in them, and all other positions stay.
            self.text = re.sub(r"<!--.*?-->", _blanked, text, flags=re.DOTALL)
        except OSError as error:
            raise self.error(f"the file cannot be read: {error.strerror}") from error
        except UnicodeDecodeError as error:
            raise self.error("this is no text in UTF-8", "URDF or MJCF") from error
        except ElementTree.ParseError as error:
            line, column = error.position
            what = f"this is no XML: {error.msg.partition(':')[0]}"
            description_error = DescriptionError((), what, line=line, column=column + 1)
            raise RobotError(str(path), [description_error]) from error
        if self.root.tag not in ("robot", "mujoco"):
            raise self.error(
                "this is neither a URDF nor an MJCF file",
                "the root element <robot> of a URDF or <mujoco> of an MJCF file",
                f"<{self.root.tag}>",
            )

    def _add_world(self) -> bool:
        """Add a link ``world`` where a joint hangs from it and the URDF has none, as Drake welds a robot to its world. Return
        whether that was so."""
        parents = [joint.find("parent") for joint in self.root.findall("joint")]
        hangs = any(parent is not None and parent.get("link") == WORLD for parent in parents)
        if not self.is_urdf or not hangs or self.has("link", WORLD):
            return False
        self.root.insert(0, ElementTree.Element("link", name=WORLD))
        # Behind the root's tag, on its line: all other lines stay.
        self.content = re.sub(
            r"<robot\b[^>]*>", rf'\g<0><link name="{WORLD}"/>', self.content, count=1
        )
        return True

    def _check_encoding(self, text: str) -> None:
        """Raise ``RobotError`` where the text, read as UTF-8, is another one in the encoding that it declares."""
        declared = DECLARED.match(text)
        if not declared:
            return
        try:
            same = text.encode("utf-8").decode(declared[1]) == text
        except (LookupError, UnicodeError):
            same = False
        if not same:
            raise self.error(
                f"the file declares the encoding {declared[1]} and is in UTF-8",
                'encoding="utf-8"', declared[1],
            )  # fmt: skip

    @property
    def is_urdf(self) -> bool:
        """True for a URDF, false for MJCF."""
        return bool(self.root.tag == "robot")

    def error(self, message: str, expected: str = "", found: str = "", fix: str = "") -> RobotError:
        """Return an error of the file as a whole."""
        return RobotError(str(self.path), [DescriptionError((), message, expected, found, fix)])

    def has(self, tag: str, name: str) -> bool:
        """Check whether the root has an element with this tag and name."""
        return any(element.get("name") == name for element in self.root.findall(tag))

    def place(self, tag: str, name: str) -> tuple[int, int]:
        """Return the line and column of the element of that tag and name; (0, 0) if it is not found."""
        pattern = rf"<{tag}\s(?:[^>]*?\s)?name\s*=\s*[\"']{re.escape(name)}[\"']"
        found = re.search(pattern, self.text)
        if not found:
            return 0, 0
        before = self.text[: found.start()]
        return before.count("\n") + 1, found.start() - before.rfind("\n")


WORLD = "world"
"""The link from which a robot hangs that is welded to the ground, in Drake without being declared."""


def _blanked(comment: re.Match[str]) -> str:
    return re.sub(r"[^\n]", " ", comment.group())


def urdf_joints(file: XmlFile) -> dict[str, UrdfJoint]:
    """Return every joint's effort, speed and mimic by name."""
    found = {}
    for joint in file.root.findall("joint"):
        limit, mimic = joint.find("limit"), joint.find("mimic")
        effort, speed = (
            _value(limit.get(key)) if limit is not None else math.nan
            for key in ("effort", "velocity")
        )
        mimics = mimic.get("joint", "") if mimic is not None else ""
        by = {} if mimic is None else mimic.attrib
        found[joint.get("name", "")] = UrdfJoint(
            effort, speed, mimics, _range(joint),
            _value(by.get("multiplier", "1")), _value(by.get("offset", "0")), _half(joint),
        )  # fmt: skip
    return found


def _range(joint: ElementTree.Element) -> str:
    """Return the ``range`` of a ``UrdfJoint``."""
    if joint.get("type") not in ("revolute", "prismatic"):
        return ""
    limit = joint.find("limit")
    given = [None if limit is None else limit.get(key) for key in ("lower", "upper")]
    if given == [None, None]:
        return "free"
    return "none" if [_value(text or "0") for text in given] == [0.0, 0.0] else ""


def _half(joint: ElementTree.Element) -> tuple[float, float] | None:
    """Return the limits of a joint of which only one is written; the format's default of the other is zero."""
    limit = joint.find("limit")
    if limit is None or joint.get("type") not in ("revolute", "prismatic"):
        return None
    given = [limit.get(key) for key in ("lower", "upper")]
    lower, upper = (_value(text or "0") for text in given)
    return (lower, upper) if given.count(None) == 1 and lower < upper else None


def check_urdf(file: XmlFile) -> None:
    """Raise ``RobotError`` with everything that no reader of a URDF could make sense of."""
    errors: list[DescriptionError] = []

    def add(
        tag: str, name: str, message: str, expected: str = "", found: str = "", fix: str = ""
    ) -> None:
        line, column = file.place(tag, name)
        errors.append(DescriptionError((), message, expected, found, fix, line, column))

    links = [link.get("name", "") for link in file.root.findall("link")]
    if not links:
        raise file.error("the URDF has no links", "at least one <link>", "none")
    for name in dict.fromkeys(links):
        if links.count(name) > 1:
            add("link", name, f"link {name!r} is there {links.count(name)} times", "each name once")
    for part in (*file.root.findall("link"), *file.root.findall("joint")):
        name = part.get("name", "")
        for found, meant in misspelt(part):
            what = f"{part.tag} {name} has {found}, which a URDF does not know"
            add(part.tag, name, what, meant, found)
        for found, radians in turned_by_degrees(part):
            what = f"{part.tag} {name} has angles that look like degrees, and a URDF's are radians"
            add(part.tag, name, what, "radians", found, radians)
        wrong = wrong_inertia(part)
        if wrong:
            add("link", name, f"link {name} has a mass or an inertia that no body has",
                "finite numbers, none negative but ixy, ixz and iyz", wrong)  # fmt: skip
    carried: dict[str, str] = {}
    joints = [joint.get("name", "") for joint in file.root.findall("joint")]
    for name in dict.fromkeys(joints):
        if joints.count(name) > 1:
            add(
                "joint",
                name,
                f"joint {name!r} is there {joints.count(name)} times",
                "each name once",
            )
    for joint in file.root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        if kind not in KINDS:
            add(
                "joint",
                name,
                f"joint {name} has no type that a URDF knows",
                listing(KINDS),
                repr(kind),
            )
        for end in ("parent", "child"):
            element = joint.find(end)
            link = element.get("link", "") if element is not None else ""
            if link not in links:
                what = f"the {end} of joint {name} is {link!r}, and there is no such link"
                add("joint", name, what, listing(links), repr(link))
            elif end == "child" and link in carried:
                what = f"link {link} is carried by two joints, {carried[link]} and {name}"
                add("joint", name, what, "one joint that carries each link")
            elif end == "child":
                carried[link] = name
        axis = joint.find("axis")
        if kind in (*HINGES, "prismatic") and axis is not None:
            values = [_value(text) for text in (axis.get("xyz") or "").split()]
            if len(values) != 3 or not math.isfinite(math.hypot(*values)) or not any(values):
                add("joint", name, f"the axis of joint {name} is no direction",
                    "three numbers that are not all zero", repr(axis.get("xyz")))  # fmt: skip
        limit = joint.find("limit")
        if limit is not None and kind in ("revolute", "prismatic"):
            lower, upper = (_value(limit.get(key, "0")) for key in ("lower", "upper"))
            if not lower < upper and not _range(joint):
                add("joint", name, f"the limits of joint {name} leave it no room or are reversed",
                    "lower < upper", f"lower {number(lower)}, upper {number(upper)}")  # fmt: skip
    roots = [name for name in dict.fromkeys(links) if name not in carried]
    if len(roots) != 1 and not errors:
        add("link", (roots or links)[0], f"the links make no single tree: {len(roots)} have no parent",
            "one link that no joint carries", listing(roots))  # fmt: skip
    if errors:
        raise RobotError(str(file.path), errors)


def _value(text: str | None) -> float:
    try:
        return float(text) if text is not None else math.nan
    except ValueError:
        return math.nan
