"""Real robot descriptions with one thing made wrong: is it reported, does it work all the same, does it crash.

Each case takes a URDF of the package ``example-robot-data`` and makes one seeded change, such as a person or a converter
makes: an element lost, doubled or renamed, a number that is none, a unit that is another, a file that is cut.
It is read as ``aloft robot show``, ``import`` and ``check-up`` read it: where it is accepted, the short YAML is written
beside it and both are read once more.
"""

from __future__ import annotations

import random
import tempfile
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

from ..robots.description import ReadRobot, RobotError, read
from ..robots.importing.new_yaml import new_yaml
from ..robots.importing.package_files import find_file
from ..robots.report import report
from ..robots.surfaces import missing_meshes
from ..runtime.language.errors import AloftError
from ..studies.check_up import check_up
from .rows import Row

PACKAGE = "package://example-robot-data/robots/"
FILES = (
    "solo_description/robots/solo12.urdf", "a1_description/urdf/a1.urdf", "bolt_description/robots/bolt.urdf",
    "ur_description/urdf/ur5_robot.urdf", "iris_description/robots/iris.urdf",
    "double_pendulum_description/urdf/double_pendulum_continuous.urdf", "hyq_description/robots/hyq_no_sensors.urdf",
    "panda_description/urdf/panda.urdf",
)  # fmt: skip
WORDS = ("", "abc", "nan", "inf", "1,5", "0x1p3", "1e999", "--1")


def mutated_robots(count: int = 500, seed: int = 9000) -> list[Row]:
    """A row for each kind of mistake: how often it was tried, and what became of it.

    Args:
        count: the cases of all kinds together.
        seed: of the first case; each has the next.
    """
    found: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    examples: dict[str, str] = {}
    originals = {path: _said(path) for path in _files()}
    if not originals:
        return [Row("mutated_robots", None, "", note="pip install example-robot-data")]
    kinds, paths = list(KINDS), list(originals)
    with tempfile.TemporaryDirectory(prefix="aloft-mutated-") as folder:
        for number in range(count):
            draw = random.Random(seed + number)
            kind = kinds[number % len(kinds)]
            path = draw.choice(paths)
            data = KINDS[kind](draw, path.read_bytes())
            if data is None:
                found[kind]["nothing to change"] += 1
                continue
            outcome, said = _outcome(Path(folder) / path.name, data, originals[path])
            found[kind][outcome] += 1
            examples.setdefault(f"{kind}: {outcome}", f"seed {seed + number}, {path.name}: {said}")
    rows = [
        Row(kind, float(sum(c.values())), "cases", note=_counted(c)) for kind, c in found.items()
    ]
    whole = sum(found.values(), Counter())
    crashes = float(whole["crash"])
    rows.append(Row("all of them", float(count), "cases", note=_counted(whole)))
    rows.append(Row("crashes", crashes, "cases", goal=0.0, note=""))
    return [
        *rows,
        *(Row(f"example of {name}", None, "", note=said) for name, said in examples.items()),
    ]


def _files() -> Iterator[Path]:
    for name in FILES:
        path = find_file(PACKAGE + name, Path())
        if path is not None:
            yield path


def _counted(counter: Counter[str]) -> str:
    return ", ".join(f"{count} {what}" for what, count in sorted(counter.items()))


def _said(path: Path) -> frozenset[str]:
    """What is said of a file that is read."""
    return frozenset(_said_of(read(path)))


def _said_of(found: ReadRobot) -> set[str]:
    """Notes of the import, remarks of the check-up, and meshes that are not there."""
    try:
        remarks = [
            f"{each['part']}: {each['found']}" for each in check_up(found.description)["remarks"]
        ]
    except AloftError as error:
        remarks = [str(error)]
    return {*found.notes, *missing_meshes(found.description), *remarks}


def _outcome(path: Path, data: bytes, usual: frozenset[str]) -> tuple[str, str]:
    """What becomes of a file, and what is said of it."""
    path.write_bytes(data)
    beside = path.with_suffix(".yaml")
    beside.unlink(missing_ok=True)
    try:
        found = read(path)
        report(found)
        text, _ = new_yaml(path, beside)
        beside.write_text(text, encoding="utf-8")
        report(read(beside))
    except RobotError as error:
        return "reported", error.faults[0].message
    except Exception as error:  # noqa: BLE001  # this is what is looked for
        return "crash", f"{type(error).__name__}: {error}"
    more = sorted(_said_of(found) - usual)
    return ("accepted and said", more[0]) if more else ("accepted", "")


Change = Callable[[random.Random, bytes], bytes | None]


def _tree(change: Callable[[random.Random, ET.Element], bool]) -> Change:
    """A change of the elements; false where there is nothing to change."""

    def changed(draw: random.Random, data: bytes) -> bytes | None:
        root = ET.fromstring(data)
        return ET.tostring(root) if change(draw, root) else None

    return changed


def _pick(draw: random.Random, root: ET.Element, path: str) -> ET.Element | None:
    found = root.findall(path)
    return draw.choice(found) if found else None


def _lose(*paths: str) -> Change:
    """An element is lost."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        owners = [
            (owner, each) for path in paths for owner in root.findall(path.rpartition("/")[0] or ".")
            for each in owner.findall(path.rpartition("/")[2])
        ]  # fmt: skip
        if owners:
            owner, each = draw.choice(owners)
            owner.remove(each)
        return bool(owners)

    return _tree(change)


def _double(path: str) -> Change:
    """An element is there twice."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        each = _pick(draw, root, path)
        if each is not None:
            root.append(each)
        return each is not None

    return _tree(change)


def _set(path: str, attribute: str, new: Callable[[random.Random, str], str]) -> Change:
    """An attribute has another value."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        with_it = [each for each in root.findall(path) if attribute in each.attrib]
        if not with_it:
            return False
        each = draw.choice(with_it)
        before = each.attrib[attribute]
        each.attrib[attribute] = new(draw, before)
        return each.attrib[attribute] != before

    return _tree(change)


def _scaled(factor: float) -> Callable[[random.Random, str], str]:
    return lambda _, text: " ".join(repr(factor * float(word)) for word in text.split())


def _of_all(path: str, attributes: tuple[str, ...], factor: float) -> Change:
    """All values of a kind are in another unit."""

    def change(draw: random.Random, root: ET.Element) -> bool:
        for each in root.findall(path):
            for name in attributes:
                if name in each.attrib:
                    each.attrib[name] = _scaled(factor)(draw, each.attrib[name])
        return bool(root.findall(path))

    return _tree(change)


def _misspelt(draw: random.Random, text: str) -> str:
    """Two letters of a word are swapped."""
    place = draw.randrange(max(1, len(text) - 1))
    return text[:place] + text[place + 1 : place + 2] + text[place : place + 1] + text[place + 2 :]


def _misspell_tag(draw: random.Random, root: ET.Element) -> bool:
    each = draw.choice(
        [e for path in ("link/*", "joint/*", "link/inertial/*") for e in root.findall(path)]
    )
    before = each.tag
    each.tag = _misspelt(draw, each.tag)
    return each.tag != before


def _misspell_attribute(draw: random.Random, root: ET.Element) -> bool:
    parts = ("link/inertial/*", "joint/origin", "joint/limit", "joint/axis")
    each = draw.choice([e for path in parts for e in root.findall(path) if e.attrib])
    name = draw.choice(sorted(each.attrib))
    wrong = _misspelt(draw, name)
    if wrong in each.attrib:
        return False
    each.attrib[wrong] = each.attrib.pop(name)
    return True


def _swap_limits(draw: random.Random, root: ET.Element) -> bool:
    ranged = [e for e in root.findall("joint/limit") if {"lower", "upper"} <= set(e.attrib)]
    if not ranged:
        return False
    limit = draw.choice(ranged)
    limit.attrib["lower"], limit.attrib["upper"] = limit.attrib["upper"], limit.attrib["lower"]
    return limit.attrib["lower"] != limit.attrib["upper"]


def _swap_ends(draw: random.Random, root: ET.Element) -> bool:
    joint = _pick(draw, root, "joint")
    if joint is None:
        return False
    parent, child = joint.find("parent"), joint.find("child")
    if parent is None or child is None:
        return False
    parent.attrib["link"], child.attrib["link"] = child.attrib["link"], parent.attrib["link"]
    return True


def _cut(draw: random.Random, data: bytes) -> bytes:
    return data[: draw.randrange(1, len(data.rstrip()) - 1)]


def _insert(*pieces: bytes) -> Change:
    def change(draw: random.Random, data: bytes) -> bytes:
        place = draw.randrange(len(data))
        return data[:place] + draw.choice(pieces) + data[place:]

    return change


def _lose_byte(byte: bytes) -> Change:
    def change(draw: random.Random, data: bytes) -> bytes:
        place = draw.choice([k for k in range(len(data)) if data[k : k + 1] == byte])
        return data[:place] + data[place + 1 :]

    return change


def _no_number(draw: random.Random, text: str) -> str:
    words = text.split() or [""]
    words[draw.randrange(len(words))] = draw.choice(WORDS)
    return " ".join(words)


def _one_less(draw: random.Random, text: str) -> str:
    return " ".join(text.split()[:-1])


def _negative(draw: random.Random, text: str) -> str:
    return repr(-abs(float(text)) or -1.0)


KINDS: dict[str, Change] = {
    "the file is cut": _cut,
    "bytes that are no UTF-8": _insert(b"\xff", b"\xe9", b"\xc3("),
    "a quotation mark is lost": _lose_byte(b'"'),
    "a bracket is lost": _lose_byte(b">"),
    "another encoding than declared": lambda _, data: (
        b'<?xml version="1.0" encoding="utf-16"?>\n' + data
    ),
    "a link is lost": _lose("link"),
    "a joint is lost": _lose("joint"),
    "parent or child of a joint is lost": _lose("joint/parent", "joint/child"),
    "a mass is lost": _lose("link/inertial/mass"),
    "an inertia is lost": _lose("link/inertial/inertia"),
    "an inertial is lost": _lose("link/inertial"),
    "limits of a joint are lost": _lose("joint/limit"),
    "a link is there twice": _double("link"),
    "a joint is there twice": _double("joint"),
    "a link has another name": _set("link", "name", lambda _, text: f"{text}_2"),
    "a joint of an unknown type": _set("joint", "type", _misspelt),
    "an element is misspelt": _tree(_misspell_tag),
    "an attribute is misspelt": _tree(_misspell_attribute),
    "a mass that is no number": _set("link/inertial/mass", "value", _no_number),
    "an inertia that is no number": _set("link/inertial/inertia", "ixx", _no_number),
    "a place that is no number": _set("joint/origin", "xyz", _no_number),
    "an axis that is no number": _set("joint/axis", "xyz", _no_number),
    "a limit that is no number": _set("joint/limit", "upper", _no_number),
    "a place of two numbers": _set("joint/origin", "xyz", _one_less),
    "a negative mass": _set("link/inertial/mass", "value", _negative),
    "a negative inertia": _set("link/inertial/inertia", "iyy", _negative),
    "a mass of zero": _set("link/inertial/mass", "value", lambda *_: "0"),
    "an axis of zero": _set("joint/axis", "xyz", lambda *_: "0 0 0"),
    "an inertia that no body has": _set("link/inertial/inertia", "izz", _scaled(30.0)),
    "one mass in grams": _set("link/inertial/mass", "value", _scaled(1000.0)),
    "all masses in grams": _of_all("link/inertial/mass", ("value",), 1000.0),
    "inertias in kg mm²": _of_all(
        "link/inertial/inertia", ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), 1e6
    ),
    "places in millimetres": _of_all("joint/origin", ("xyz",), 1000.0),
    "limits in degrees": _of_all("joint/limit", ("lower", "upper"), 57.29578),
    "limits of a joint swapped": _tree(_swap_limits),
    "parent and child swapped": _tree(_swap_ends),
    "a negative effort": _set("joint/limit", "effort", _negative),
    "a negative speed limit": _set("joint/limit", "velocity", _negative),
    "a mesh that is not there": _set(
        "link/visual/geometry/mesh", "filename", lambda _, text: f"{text}.old"
    ),
}
"""What is made wrong, by what it is called."""
