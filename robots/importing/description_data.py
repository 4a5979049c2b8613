"""A full description as plain data, from a URDF or MJCF file and the short YAML that adds to it.

The keys of the short YAML are those of a full description, but ``links`` and ``joints`` are mappings from a name
to the values that differ, values in ``profiles`` may be left out where the file has them, and feet
and named points may be given in the frame of any body of the file. A fault of the result is reported where it
stands: in the YAML, or in the URDF or MJCF file.

These formats give each joint at most an effort and a speed. What they leave open of an actuator profile is
assumed here, cautiously, and said in the notes: the torque falls from 0.6 of the speed limit on, and a motor
bears two fifths of its peak torque for long.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np

from ...files.problems import listing
from ..comparison.compare import compare_with_file
from ..comparison.differences import Differences
from ..robot_description import SLIDE_UNITS, Joint, Link, RobotDescription
from ..validation import DescriptionError, RobotError, find_errors
from ..validation.errors import Draft, nearest
from ..validation.find_errors import shown
from .build import BodyFrame, LinkTree, bolted, build, tidy
from .looks import link_looks
from .odd_bodies import odd_bodies
from .raw_model import RawJoint, RawModel
from .read_model import read_model
from .urdf_text import XmlFile

OWN_KEYS = ("file", "weld")
_UP = np.array([0.0, 0.0, 1.0])
RADIUS = 0.005
"""The radius of a contact point for which the YAML gives none [m]."""
ROOM = 0.1
"""Distance from a limit at which joints stand that cannot be at zero [rad, m]."""


class Overlay(Draft):
    """The content of a short YAML, and what is wrong with it."""

    def mapping(self, key: str) -> Mapping[str, Any]:
        """Return the mapping under a key; empty, and a fault, where it is something else."""
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
        """Return the joints that ``weld`` names, by name or shell pattern."""
        found: list[str] = []
        given = self.data.get("weld", [])
        if not isinstance(given, list) or not all(isinstance(each, (str, int)) for each in given):
            self.add(("weld",), f"weld cannot be {shown(given)}", "a list of joints or patterns",
                     shown(given))  # fmt: skip
            return []
        for k, pattern in enumerate(map(str, given)):
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
        """Return the profiles of the YAML, filled from the file's; the file's alone where it has none."""
        given = self.mapping("profiles")
        if not given:
            return {"rated": dict(rated)}
        return {
            name: _filled(profile, rated) if isinstance(profile, Mapping) else profile
            for name, profile in given.items()
        }

    def frame(self, path: tuple[str | int, ...], name: Any, built: LinkTree) -> BodyFrame | None:
        """Return the body of the file with that name; ``None``, and a fault, if there is none."""
        if isinstance(name, (str, int)) and str(name) in built.frames:  # YAML reads 2 as a number
            return built.frames[str(name)]
        self.add(path, f"the file has no link {shown(name)}", listing(list(built.frames), 60),
                 shown(name), nearest(str(name), built.frames))  # fmt: skip
        return None

    def feet(self, built: LinkTree) -> tuple[list[Any], list[Any]]:
        """Return the feet and contact points as in a full description, from both ways to write them."""
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
        self, path: tuple[str | int, ...], foot: Mapping[str, Any], built: LinkTree
    ) -> tuple[dict[str, Any], list[dict[str, Any]]] | None:
        """Return a foot given in the frame ``at`` of the file: a ball, or the points of a sole."""
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

    def points(self, built: LinkTree) -> dict[str, Any]:
        """Return named points, each on a link of the description or in the frame of a body of the file."""
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

    def thrusters(self, built: LinkTree, model: RawModel) -> dict[str, Any]:
        """Return the thrusters as in a full description: those of the file, with what the YAML changes, and the YAML's
        own, each on a link of the description or in the frame of a body of the file.
        """
        found: dict[str, Any] = {
            name: {
                "link": raw.body, "position": raw.position.tolist(), "axis": raw.axis.tolist(),
                "max_thrust": raw.max_thrust, "torque_ratio": raw.torque_ratio,
                "time_constant": raw.time_constant,
            }
            for name, raw in model.thrusters.items()
        }  # fmt: skip
        for name, value in self.mapping("thrusters").items():
            known = found.get(name, {})
            found[name] = {**known, **value} if isinstance(value, Mapping) else value
        links = [link["name"] for link in built.links]
        for name, value in found.items():
            at = value.get("link") if isinstance(value, Mapping) else None
            at = str(at) if isinstance(at, int) else at
            if at is None or (at in links and at not in built.frames):
                continue
            frame = self.frame(("thrusters", name, "link"), at, built)
            place = self._point(
                ("thrusters", name, "position"), value.get("position", [0.0, 0.0, 0.0])
            )
            axis = self._point(("thrusters", name, "axis"), value.get("axis", [0.0, 0.0, 1.0]))
            if frame is not None and place is not None and axis is not None:
                turned = frame.rotation @ np.array(axis)
                found[name] = {
                    **value, "link": frame.link, "position": frame.point(place),
                    "axis": tidy(turned, 12),
                }  # fmt: skip
        return found


def _filled(profile: Mapping[str, Any], rated: Mapping[str, Any]) -> dict[str, Any]:
    """Return a profile with the file's values where it has none.

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


NAME = "rated"
CORNER = 0.6
"""Corner speed as a share of the speed limit, which is taken for the no-load speed."""
CONTINUOUS = 0.4
"""Continuous torque as a share of the effort limit."""
EFFORT = 100.0
"""Peak torque [N m, N] where the file gives none."""
SPEED = 20.0
"""No-load speed [rad/s, m/s] where the file gives none."""
ROTOR_TIME, ROTOR_TIMES = 0.006, (0.0035, 0.02)
"""s; rotor inertia at the gear's output times no-load speed over peak torque: how long the rotor alone takes to that speed
by that torque. It is taken for motors of which the file gives both. Of those whose inertia is known it is 3.6 to 6.2 ms
(G1's legs), 4.7 (ANYmal C), 5.2 (BRUCE), 6.3 (A1), 12.7 (Go2), 18.7 (G1's wrists) and 19.3 ms (Solo12): see robots/."""
KEYS = ("peak_torque", "corner_speed", "no_load_speed", "continuous_torque", "rotor_inertia",
        "friction", "damping")  # fmt: skip


def rated_profile(
    joints: Mapping[str, RawJoint], is_urdf: bool, notes: list[str], *, estimate: bool = True
) -> dict[str, Any]:
    """Return the profile as plain data; joints that differ from most have an entry under ``motors``.

    With ``estimate`` the inertia of rotors follows from their ratings, where the file tells of no rotor.
    """
    values = {name: _values(joint, is_urdf) for name, joint in joints.items()}
    if estimate and not any(joint.rotor_inertia for joint in joints.values()):
        _estimate_rotors(values, joints, notes)
    efforts = [n for n, j in joints.items() if math.isnan(j.effort) or (is_urdf and j.effort <= 0)]
    speeds = [n for n, j in joints.items() if not j.speed > 0 and values[n]["peak_torque"] > 0]
    for what, missing, value, hinge in (
        ("effort", efforts, EFFORT, "N m"), ("speed", speeds, SPEED, "rad/s"),
    ):  # fmt: skip
        slides = [name for name in missing if joints[name].kind == "slide"]
        turning = [name for name in missing if name not in slides]
        for names, unit in ((turning, hinge), (slides, SLIDE_UNITS[hinge])):
            if names:
                notes.append(f"no {what} limit of {listing(names, 6)}: {value:g} {unit} is assumed")
    passive = [name for name, joint in joints.items() if not is_urdf and joint.effort == 0.0]
    if passive:
        notes.append(f"no actuator moves {listing(passive, 6)}")
    driven = [value for value in values.values() if value["peak_torque"] > 0] or [
        {**dict.fromkeys(KEYS, 0.0), "peak_torque": EFFORT, "continuous_torque": EFFORT,
         "corner_speed": CORNER * SPEED, "no_load_speed": SPEED}
    ]  # fmt: skip
    common = {key: Counter(value[key] for value in driven).most_common(1)[0][0] for key in KEYS}
    if not 0.0 <= common["corner_speed"] < common["no_load_speed"]:
        common["corner_speed"] = CORNER * common["no_load_speed"]
    motors = {
        name: {key: value[key] for key in KEYS if value[key] != common[key]}
        for name, value in values.items()
    }
    return {**common, "motors": {name: changed for name, changed in motors.items() if changed}}


def _values(joint: RawJoint, is_urdf: bool) -> dict[str, float]:
    known = joint.effort > 0.0 or (joint.effort == 0.0 and not is_urdf)
    effort = joint.effort if known else EFFORT
    speed = joint.speed if joint.speed > 0.0 else SPEED
    return {
        "peak_torque": effort,
        "corner_speed": round(CORNER * speed, 9),
        "no_load_speed": speed,
        "continuous_torque": round(CONTINUOUS * effort, 9),
        "rotor_inertia": joint.rotor_inertia,
        "friction": joint.friction,
        "damping": joint.damping,
    }


def _estimate_rotors(
    values: dict[str, dict[str, float]], joints: Mapping[str, RawJoint], notes: list[str]
) -> None:
    """Estimate the rotors' inertia of the motors of which the file gives torque and speed."""
    found = []
    for name, joint in joints.items():
        if joint.kind == "hinge" and joint.effort > 0.0 and joint.speed > 0.0:
            inertia = float(f"{ROTOR_TIME * joint.effort / joint.speed:.3g}")
            values[name]["rotor_inertia"] = inertia
            found.append(inertia)
    if found:
        low, high = min(found), max(found)
        least, most = (low * ROTOR_TIMES[0] / ROTOR_TIME, high * ROTOR_TIMES[1] / ROTOR_TIME)
        each = f"{low:g}" if low == high else f"{low:g} to {high:g}"
        notes.append(
            f"rotor inertia is estimated from peak torque and no-load speed: {each} kg m^2, which may as "
            f"well be {least:.2g} to {most:.2g}; write rotor_inertia under profiles"
        )


def _tells_rotors(profiles: Any) -> bool:
    """Check whether a YAML's profiles give the inertia of any rotor."""
    ratings = list(profiles.values()) if isinstance(profiles, Mapping) else []
    for profile in list(ratings):
        motors = profile.get("motors") if isinstance(profile, Mapping) else None
        ratings += list(motors.values()) if isinstance(motors, Mapping) else []
    return any(isinstance(each, Mapping) and "rotor_inertia" in each for each in ratings)


TAGS = {"links": ("link", "body"), "joints": ("joint", "joint")}
"""The elements of a URDF and of MJCF that describe a part of a description."""


def written_path(
    description_error: DescriptionError, data: Mapping[str, Any]
) -> tuple[str | int, ...]:
    """Return the path of a fault as a short YAML has it: links and joints by name, contacts by foot."""
    path = description_error.path
    if len(path) > 1 and path[0] == "contacts" and isinstance(path[1], int):
        # Contact points of a short YAML are in its feet.
        feet = [foot["name"] for foot in data["feet"]]
        foot = data["contacts"][path[1]]["foot"]
        return ("feet", feet.index(foot)) if foot in feet else path
    if len(path) > 1 and path[0] in TAGS and isinstance(path[1], int):
        return (path[0], str(data[path[0]][path[1]]["name"]), *path[2:])
    return path


def located_in_model(
    description_error: DescriptionError, data: Mapping[str, Any], model: RawModel
) -> DescriptionError:
    """Return the fault with the line of the link or joint in the URDF or MJCF file, if it is one's."""
    path = written_path(description_error, data)
    line = column = 0
    if len(path) > 1 and path[0] in TAGS:
        tag = TAGS[str(path[0])][not model.is_urdf]
        line, column = XmlFile(model.path).place(tag, str(path[1]))
    return replace(description_error, path=path, file=str(model.path), line=line, column=column)


@dataclass(frozen=True)
class Imported:
    """Result of an import: the description's ``data``, the ``errors`` of the YAML, what the file lacks or what is
    approximated in ``notes``, the ``model`` and tree it was made from, and the tree without the YAML's changes in
    ``unchanged``.
    """

    data: dict[str, Any]
    errors: list[DescriptionError]
    notes: list[str]
    model: RawModel
    built: LinkTree
    unchanged: LinkTree

    def compared(self) -> list[Differences]:
        """Compare what was read of the file with MuJoCo's and Pinocchio's own readings.

        Raises:
            RobotError: they differ; it carries every difference with both numbers.
        """
        links, joints = self.unchanged.links, self.unchanged.joints
        changed = links != self.built.links or joints != self.built.joints
        own = {**self.data, "links": links, "joints": joints, "standing": {}, "held": {}}
        if changed and find_errors(own):
            return []  # a file with faults that the YAML mends
        found = compare_with_file(self.model, self.unchanged)
        errors = [error for each in found for error in each.errors]
        if errors:
            raise RobotError(str(self.model.path), errors)
        return found


def import_robot(path: Path, added: Mapping[str, Any], model: RawModel | None = None) -> Imported:
    """Return the description that a URDF or MJCF file and a YAML's content make together.

    Args:
        path: of the file.
        added: the YAML's content.
        model: what the file holds, where it was read before.

    Raises:
        RobotError: the file cannot be read at all.
    """
    model = model or read_model(path)
    overlay = Overlay(added)
    overlay.check_keys(list(RobotDescription.model_fields))
    notes = [*model.notes, *odd_bodies(model)]
    joints = [joint.name for body in model.bodies.values() for joint in body.joints]
    welded = [*overlay.welded(joints), *model.held]
    base_joint = added.get("base_joint", "")
    built = build(model, welded, base_joint if isinstance(base_joint, str) else "")
    notes += built.notes
    if not base_joint:
        notes += bolted(model, built.base_joint)
    unchanged = replace(
        built, links=[{**link} for link in built.links], joints=[{**each} for each in built.joints]
    )
    overlay.change("links", built.links, Link)
    overlay.change("joints", built.joints, Joint)
    feet, contacts = overlay.feet(built)
    estimate = not _tells_rotors(added.get("profiles"))
    rated = rated_profile(built.raw_joints, model.is_urdf, notes, estimate=estimate)
    names = [joint["name"] for joint in built.joints]
    data: dict[str, Any] = {
        "name": added.get("name", model.name),
        "text": added.get("text", ""),
        "base": built.base,
        "base_joint": added.get("base_joint", built.base_joint),
        "links": built.links,
        "joints": built.joints,
        "feet": feet,
        "contacts": contacts,
        "transmission": added.get("transmission") or own_motors(names),
        "profiles": overlay.profiles(rated),
        "points": overlay.points(built),
    }
    if "points" not in added and data["base_joint"] == "floating":
        base = next(link for link in built.links if link["name"] == built.base)
        data["points"] = {"torso_com": [built.base, list(base["com"])]}
    bodies = {name: body.look for name, body in model.bodies.items()}
    data["looks"] = link_looks(bodies, built.frames, path.parent)
    data["standing"] = _pose_within_limits(model.pose, built.joints, notes)
    data["sensors"] = {"imu": data["base_joint"] != "fixed", "switches": bool(contacts)}
    for key in ("profile", "sensors", "standing", "held", "supply", "looks"):
        if key in added:
            data[key] = added[key]
    if isinstance(data["sensors"], Mapping):
        data["sensors"] = {name: _with_text(each) for name, each in data["sensors"].items()}
    if thrusters := overlay.thrusters(built, model):
        data["thrusters"] = thrusters
    _stand_within_limits(data)
    return Imported(data, overlay.errors, notes, model, built, unchanged)


def _with_text(mount: Any) -> Any:
    """Return a mounted sensor whose link is a text, where a link is called by a number."""
    if isinstance(mount, Mapping) and type(mount.get("link")) is int:
        return {**mount, "link": str(mount["link"])}
    return mount


ROUNDED = 1e-3
"""Distance from a limit [rad, m] that rounding explains: degrees or radians that are written with a few digits."""


def _pose_within_limits(
    pose: Mapping[str, float], joints: list[dict[str, Any]], notes: list[str]
) -> dict[str, float]:
    """Return the key frame's positions of the robot's joints, each within its limits."""
    found, far = {}, []
    for joint in joints:
        name, limits = joint["name"], joint["limits"]
        if name not in pose:
            continue
        found[name] = angle = pose[name]
        simple = isinstance(limits, list) and all(isinstance(v, (int, float)) for v in limits)
        if simple and len(limits) == 2 and limits[0] < limits[1]:
            found[name] = min(max(angle, limits[0]), limits[1])
            if abs(found[name] - angle) > ROUNDED:
                far.append(f"{name} at {angle:g} for {found[name]:g}")
    if far:
        notes.append(
            f"the key frame is outside joint limits, and the pose ends at them: {listing(far, 6)}"
        )
    return found


def _stand_within_limits(data: dict[str, Any]) -> None:
    """Let joints that cannot be at zero, and of which nothing else is given, stand near that limit."""
    standing, held = data["standing"], data.get("held") or {}
    if not isinstance(standing, Mapping) or not isinstance(held, Mapping):
        return
    added = {}
    for joint in data["joints"]:
        limits = joint["limits"]
        known = joint["name"] in standing or joint["name"] in held
        if known or not isinstance(limits, list) or len(limits) != 2:
            continue
        if all(isinstance(value, (int, float)) for value in limits) and limits[0] < limits[1]:
            room = min(ROOM, 0.5 * (limits[1] - limits[0]))
            if not limits[0] < 0.0 < limits[1]:
                added[joint["name"]] = min(max(0.0, limits[0] + room), limits[1] - room)
    data["standing"] = {**standing, **added}


def own_motors(joints: list[str]) -> dict[str, Any]:
    """Return the transmission of a robot in which every joint has a motor of its own, called as it is."""
    size = range(len(joints))
    return {
        "motors": list(joints),
        "joint_to_motor": [[float(row == column) for column in size] for row in size],
    }
