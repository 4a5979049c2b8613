"""Checks of a description, one after the other; first that every key is known and holds a value of the right type."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from ...files.problems import listing
from ...files.validation import explain, names_at
from ..robot_description import RobotDescription
from ..shapes import SHAPE_KINDS
from .actuation import check_actuation, check_thrusters
from .errors import DescriptionError, Draft, Path, nearest
from .stance import check_feet, check_poses
from .structure import check_bodies, check_joints, check_looks, check_names, check_tree


def find_errors(data: Any) -> tuple[DescriptionError, ...]:
    """Return every fault of a description, given as plain data: mappings, lists, numbers and text.

    A value of a wrong type is reported and otherwise passed over, so that it hides nothing else.
    Data without a fault can be read by ``RobotDescription.model_validate``.
    """
    if not isinstance(data, dict):
        found = "nothing" if data is None else f"a {type(data).__name__}"
        expected = "keys such as name, base, links and joints"
        return (DescriptionError((), "this describes no robot", expected, found),)
    draft = Draft(data)
    check_types(draft, RobotDescription)
    check_names(draft)
    check_bodies(draft)
    check_joints(draft)
    check_tree(draft)
    check_actuation(draft)
    check_thrusters(draft)
    check_feet(draft)
    check_poses(draft)
    check_looks(draft)
    return tuple(draft.errors)


def check_types(draft: Draft, kind: type[BaseModel]) -> None:
    """Report every key that is unknown or missing and every value of a wrong type."""
    try:
        draft.whole = kind.model_validate(draft.data)
    except ValidationError as error:
        for each in error.errors(include_url=False):
            _report(draft, kind, each)


def _report(draft: Draft, kind: type[BaseModel], error: Mapping[str, Any]) -> None:
    path, code, value = _in_data(error["loc"]), error["type"], error.get("input")
    owner, key = where(draft.data, path[:-1]), path[-1]
    if code == "extra_forbidden":
        legal = names_at(kind, path[:-1])
        right = nearest(str(key), legal)
        draft.add(
            path, f"{owner} has no key {key!r}", listing(legal, 20), repr(key),
            f"{right}: {shown(value)}" if right else "",
        )  # fmt: skip
    elif code == "model_type" and path[:-1] == ("sensors",):
        right = nearest(str(key), ("imu", "switches"))
        draft.add(
            path, f"{owner} has no key {key!r}", "imu, switches, or a sensor with its kind and link",
            repr(key), f"{right}: {shown(value)}" if right else "",
        )  # fmt: skip
    elif code == "missing":
        if isinstance(key, int):
            draft.add(path[:-1], f"{owner}: too few values", f"at least {key + 1}", f"{key}")
        else:
            draft.add(path, f"{owner} lacks {key!r}", f"a value for {key!r}", "nothing")
    else:
        expected, reason = explain(error)
        name = key if not isinstance(key, int) else f"value {key + 1}"
        draft.add(
            path, f"{owner}: {name} cannot be {shown(value)}", expected or reason, shown(value)
        )


def _in_data(location: Path) -> Path:
    """Return the place of an error in the data: pydantic also names the kind of a shape, which is no key."""
    return tuple(
        key
        for depth, key in enumerate(location)
        if key not in SHAPE_KINDS or location[max(depth - 2, 0)] != "shapes"
    )


def shown(value: Any) -> str:
    """Return a value as it would be written in the file, cut off where it is long."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def where(data: Any, path: Path) -> str:
    """Return a path's element in words: ``link shank``, ``profile koala``, ``the robot``."""
    words: list[str] = []
    singular = {"links": "link", "joints": "joint", "feet": "foot", "contacts": "contact",
                "shapes": "shape", "profiles": "profile", "thrusters": "thruster"}  # fmt: skip
    for depth, key in enumerate(path):
        holder, data = data, _inside(data, key)
        kind = singular.get(str(path[depth - 1])) if depth else None
        if isinstance(key, int):
            name = data.get("name") if isinstance(data, Mapping) else None
            text = f"{kind or words.pop()} {name if isinstance(name, str) else key + 1}"
            words.append(text)
        elif kind and isinstance(holder, Mapping):
            words.append(f"{kind} {key}")
        elif key not in singular:
            words.append(str(key))
    return ", ".join(words) or "the robot"


def _inside(data: Any, key: str | int) -> Any:
    try:
        return data[key]
    except (KeyError, IndexError, TypeError):
        return None
