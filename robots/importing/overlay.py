"""Applies a short YAML to a URDF or MJCF file: what it adds, and what it changes.

Its keys are those of a full description, but ``links`` and ``joints`` are mappings from a name to
the values that differ, values in ``profiles`` may be left out where the file has them, and feet
and named points may be given in the frame of any body of the file.
"""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from ..parts import Joint, Link
from ..validation import RobotFault
from ..validation.faults import listing, nearest
from ..validation.types import shown
from .build import Built, Frame, tidy

OWN_KEYS = ("file", "weld")
_UP = np.array([0.0, 0.0, 1.0])
RADIUS = 0.005
"""The radius of a contact point for which the YAML gives none [m]."""


class Overlay:
    """The content of a short YAML, and what is wrong with it."""

    def __init__(self, data: Mapping[str, Any]) -> None:
        self.data = data
        self.faults: list[RobotFault] = []

    def add(self, path: tuple[str | int, ...], message: str, expected: str = "", found: str = "",
            fix: str = "") -> None:  # fmt: skip
        """Note a fault."""
        self.faults.append(RobotFault(path, message, expected, found, fix))

    def mapping(self, key: str) -> Mapping[str, Any]:
        """The mapping under a key; empty, and a fault, where it is something else."""
        value = self.data.get(key)
        if value is None:
            return {}
        if not isinstance(value, Mapping):
            self.add((key,), f"{key} cannot be {shown(value)}",
                     f"a mapping from the names in the file to what differs: {key}: {{NAME: ...}}",
                     shown(value))  # fmt: skip
            return {}
        return {str(name): each for name, each in value.items()}

    def check_keys(self, legal: list[str]) -> None:
        """Report unknown keys."""
        for key in self.data:
            if key not in legal and key not in OWN_KEYS:
                right = nearest(str(key), [*legal, *OWN_KEYS])
                fix = f"{right}: {shown(self.data[key])}" if right else ""
                self.add((str(key),), f"the robot has no key {key!r}",
                         listing([*OWN_KEYS, *legal], 20), repr(key), fix)  # fmt: skip

    def welded(self, joints: list[str]) -> list[str]:
        """The joints that ``weld`` names, by name or shell pattern."""
        found: list[str] = []
        given = self.data.get("weld", [])
        if not isinstance(given, list) or not all(isinstance(each, str) for each in given):
            self.add(("weld",), f"weld cannot be {shown(given)}", "a list of joints or patterns",
                     shown(given))  # fmt: skip
            return []
        for k, pattern in enumerate(given):
            matching = [name for name in joints if fnmatchcase(name, pattern)]
            if not matching:
                self.add(("weld", k), f"weld: the file has no joint {pattern}", listing(joints),
                         pattern, nearest(pattern, joints))  # fmt: skip
            found += matching
        return found

    def change(self, key: str, parts: list[dict[str, Any]], kind: type[Link | Joint]) -> None:
        """Change the links or joints of the file that the YAML names."""
        named = {part["name"]: part for part in parts}
        fields = [name for name in kind.model_fields if name != "name"]
        for name, change in self.mapping(key).items():
            if name not in named:
                self.add((key, name), f"the file has no {key[:-1]} {name}",
                         listing(list(named)), name, nearest(name, named))  # fmt: skip
            elif not isinstance(change, Mapping):
                self.add((key, name), f"{key[:-1]} {name} cannot be {shown(change)}",
                         f"a mapping with some of {listing(fields)}", shown(change))  # fmt: skip
            else:
                named[name].update(change)

    def profiles(self, rated: Mapping[str, Any]) -> dict[str, Any]:
        """The profiles of the YAML, filled from the file's; the file's alone where it has none."""
        given = self.mapping("profiles")
        if not given:
            return {"rated": dict(rated)}
        return {
            name: _filled(profile, rated) if isinstance(profile, Mapping) else profile
            for name, profile in given.items()
        }

    def frame(self, path: tuple[str | int, ...], name: Any, built: Built) -> Frame | None:
        """The body of the file with that name; ``None``, and a fault, if there is none."""
        if isinstance(name, str) and name in built.frames:
            return built.frames[name]
        self.add(path, f"the file has no link {shown(name)}", listing(list(built.frames), 60),
                 shown(name), nearest(str(name), built.frames))  # fmt: skip
        return None

    def feet(self, built: Built) -> tuple[list[Any], list[Any]]:
        """Feet and contact points as in a full description, from both ways to write them."""
        feet, contacts = [], []
        given = self.data.get("feet") or []
        if not isinstance(given, list):
            return given, self.data.get("contacts") or []
        for k, foot in enumerate(given):
            if not isinstance(foot, Mapping) or "at" not in foot:
                feet.append(foot)
                continue
            made = self._foot(("feet", k), foot, built)
            if made:
                feet.append(made[0])
                contacts += made[1]
        own = self.data.get("contacts") or []
        return feet, [*contacts, *own] if isinstance(own, list) else own

    def _foot(
        self, path: tuple[str | int, ...], foot: Mapping[str, Any], built: Built
    ) -> tuple[dict[str, Any], list[dict[str, Any]]] | None:
        """A foot given in the frame ``at`` of the file: a ball, or the points of a sole."""
        legal = ("name", "at", "ball", "points", "radius")
        for key in foot:
            if key not in legal:
                right = nearest(str(key), legal)
                self.add((*path, str(key)), f"a foot has no key {key!r}", listing(legal), repr(key),
                         f"{right}: {shown(foot[key])}" if right else "")  # fmt: skip
        frame = self.frame((*path, "at"), foot["at"], built)
        radius, name = foot.get("radius", RADIUS), str(foot.get("name", foot["at"]))
        points = foot.get("points")
        if frame is None or not isinstance(radius, (int, float)):
            if frame is not None:
                self.add((*path, "radius"), f"foot {name}: radius cannot be {shown(radius)}",
                         "a number of m", shown(radius))  # fmt: skip
            return None
        if points is None:
            centre = self._point((*path, "ball"), foot.get("ball", [0.0, 0.0, 0.0]))
            if centre is None:
                return None
            lowest = tidy(frame.point(centre) - radius * _UP)
            return {"name": name, "link": frame.link, "sole": lowest}, [
                {"name": name, "foot": name, "position": lowest, "radius": radius}
            ]
        if isinstance(points, list):
            points = {str(k + 1): point for k, point in enumerate(points)}
        if not isinstance(points, Mapping) or not points:
            self.add((*path, "points"), f"foot {name}: points cannot be {shown(points)}",
                     "a list or mapping of points [x, y, z]", shown(points))  # fmt: skip
            return None
        places = {}
        for each, point in points.items():
            place = self._point((*path, "points", each), point)
            if place is None:
                return None
            places[f"{name}_{each}"] = frame.point(place)
        sole = tidy(np.mean(list(places.values()), axis=0))
        return {"name": name, "link": frame.link, "sole": sole}, [
            {"name": each, "foot": name, "position": place, "radius": radius}
            for each, place in places.items()
        ]

    def _point(self, path: tuple[str | int, ...], value: Any) -> list[float] | None:
        numbers = isinstance(value, list) and all(isinstance(each, (int, float)) for each in value)
        if numbers and len(value) == 3:
            return [float(each) for each in value]
        self.add(path, f"a point cannot be {shown(value)}", "[x, y, z] in m", shown(value))
        return None

    def points(self, built: Built) -> dict[str, Any]:
        """Named points, each on a link of the description or in the frame of a body of the file."""
        found: dict[str, Any] = {}
        links = [link["name"] for link in built.links]
        for name, value in self.mapping("points").items():
            found[name] = value
            if isinstance(value, list) and len(value) == 2 and value[0] not in links:
                frame = self.frame(("points", name, 0), value[0], built)
                place = self._point(("points", name, 1), value[1])
                if frame is not None and place is not None:
                    found[name] = [frame.link, frame.point(place)]
        return found


def _filled(profile: Mapping[str, Any], rated: Mapping[str, Any]) -> dict[str, Any]:
    """A profile with the file's values where it has none.

    A value that it gives for all motors counts for all, also where the file has different ones.
    """
    motors = {
        name: {key: value for key, value in rating.items() if key not in profile}
        for name, rating in rated["motors"].items()
    }
    own = profile.get("motors", {})
    if not isinstance(own, Mapping):
        return {**rated, **profile}
    for name, rating in own.items():
        both = {**motors.pop(name, {}), **rating} if isinstance(rating, Mapping) else rating
        motors[name] = both
    return {**rated, **profile, "motors": {name: each for name, each in motors.items() if each}}
