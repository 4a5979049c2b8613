"""Content of a URDF that a description has no place for, one sentence each, with where it may be written instead.

A URDF itself knows neither friction nor softness of contacts. Files give them to Gazebo, under ``<gazebo reference=...>``,
or to Bullet, under ``<contact>`` of a link. Of what only says how a simulator runs, such as plugins, nothing is told.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

from ...files.problems import listing
from .left_out import MOST, by_value
from .urdf_text import XmlFile
from .urdf_words import read_number

Said = tuple[str, Any]
"""Name of a link or joint, and an element that describes it."""
FRICTION = {"mu1": "mu1", "mu2": "mu2", "mu": "mu1", "lateral_friction": "mu1"}
TWIST = ("rolling_friction", "spinning_friction")
SOFT = (
    "kp",
    "kd",
    "minDepth",
    "maxVel",
    "soft_cfm",
    "soft_erp",
    "min_depth",
    "max_vel",
    "stiffness",
    "damping",
)
BOUNCE = ("restitution", "restitution_coefficient")
RATES = ("acceleration", "deceleration", "jerk")
"""Limits that later versions of the format know."""
SPRINGS = ("springStiffness", "springReference")
"""Names of springs in Gazebo, SDF and Bullet."""
TRUE = ("1", "true", "True")


def left_out_of_urdf(file: XmlFile) -> Iterator[str]:
    """Yield the sentences for a URDF."""
    links = [*_said(file, "link", ("contact", "surface"))]
    yield from _contacts(links)
    yield from _joints(file)
    floating = [
        name for name, each in _said(file, "link", ("gravity",))
        if (each.tag, _text(each) in TRUE) in (("turnGravityOff", True), ("gravity", False))
    ]  # fmt: skip
    if floating:
        yield f"left out: {_names(floating)} without weight; gravity acts on all links"
    loops = [
        each.get("name") or f"number {k + 1}"
        for gazebo in file.root.findall("gazebo")
        for k, each in enumerate(gazebo)
        if _closes(each)
    ]
    if loops:
        yield (
            f"left out: joints {_names(loops)}, which close loops for Gazebo; describe the mechanism by its "
            "transmission: transmission: {motors, joint_to_motor}"
        )


def _said(file: XmlFile, tag: str, inside: tuple[str, ...]) -> Iterator[Said]:
    """Yield what a simulator reads of a link or joint: the elements of its ``<gazebo>``, and of its own ones that stand
    ``inside`` it or its collision shapes.
    """
    for part in file.root.findall(tag):
        name = part.get("name", "")
        for owner in (part, *part.findall("collision")):
            for each in owner:
                if each.tag in inside:
                    yield from ((name, inner) for inner in each.iter())
    for gazebo in file.root.findall("gazebo"):
        name = gazebo.get("reference", "")
        if file.has(tag, name):
            yield from (
                (name, each) for part in gazebo if part.tag != "sensor" for each in part.iter()
            )


def _contacts(said: list[Said]) -> Iterator[str]:
    """Yield the contact parameters, by value."""
    friction = _values(said, FRICTION, FRICTION.get)
    if friction:
        yield f"left out: friction coefficient {friction}; friction is the ground's, robot.ground.friction in a graph or trial"
    twist = _values(said, TWIST)
    if twist:
        yield f"left out: {twist}; contacts here have normal force and sliding friction, condim 3"
    soft = _values(said, SOFT)
    if soft:
        yield f"left out: softness of contacts, {soft}; robot.ground.soles in a graph or trial makes soles soft"
    bounce = _values(said, BOUNCE)
    if bounce:
        yield f"left out: {bounce}; how contacts bounce is the simulator's own for all"


def _joints(file: XmlFile) -> Iterator[str]:
    """Yield the springs, soft limits, and gears that couple joints."""
    springs = _values(_said(file, "joint", ("dynamics",)), SPRINGS)
    if springs:
        yield f"left out: springs of joints, {springs}; joints here have none"
    soft = [*_soft_limits(file)]
    if soft:
        yield (
            f"left out: soft limits {_names(soft)}; those of <limit> hold, and joints: {{NAME: {{limits: "
            "[LOW, HIGH]}} narrows them"
        )
    rates = [
        (
            ", ".join(f"{key} {limit.get(key)}" for key in RATES if limit.get(key)),
            joint.get("name", ""),
        )
        for joint in file.root.findall("joint")
        if (limit := joint.find("limit")) is not None
    ]
    limited = by_value([text for text, _ in rates], [name for _, name in rates], "")
    if limited:
        yield f"left out: limits of joints' {limited}; motors here have torque and speed"
    coupled = [
        each.get("name") or f"number {k + 1}"
        for k, each in enumerate(file.root.findall("transmission"))
        if len([inner for inner in each if str(inner.tag).lower().endswith("joint")]) > 1
    ]
    if coupled:
        yield (
            f"left out: transmissions {_names(coupled)}, which couple joints; here every joint has a motor of its "
            "own unless transmission: {motors, joint_to_motor} says otherwise"
        )


def _soft_limits(file: XmlFile) -> Iterator[str]:
    """Yield the limits of safety controllers that are narrower than the joint's."""
    for joint in file.root.findall("joint"):
        soft, hard = joint.find("safety_controller"), joint.find("limit")
        if soft is None or hard is None:
            continue
        ends = [(soft.get(f"soft_{key}_limit"), hard.get(key)) for key in ("lower", "upper")]
        if any(given is not None and _differ(given, limit) for given, limit in ends):
            low, high = (f"{read_number(given or limit):.4g}" for given, limit in ends)
            yield f"{low} to {high} ({joint.get('name', '')})"


def _values(said: Iterable[Said], words: Iterable[str], called: Any = None) -> str:
    """Return the values that elements of these names have, with the links or joints that have them; zeros are none."""
    found: dict[str, dict[str, str]] = {}
    for name, each in said:
        if each.tag in words and _text(each) and _differ(_text(each), "0"):
            found.setdefault(name, {})[called(each.tag) if called else each.tag] = _text(each)
    rows = []
    for values in found.values():
        same = called and len({*values.values()}) == 1
        rows.append(next(iter(values.values())) if same
                    else ", ".join(f"{tag} {value}" for tag, value in values.items()))  # fmt: skip
    return by_value(rows, [*found], "")


def _text(element: Any) -> str:
    """Return an element's content, its text or its ``value``; numbers without zeros at their end."""
    text = str(element.get("value") or element.text or "").strip()
    number = read_number(text)
    return text if math.isnan(number) else f"{number:g}"


def _differ(one: str, other: str | None) -> bool:
    return abs(read_number(one) - read_number(other)) > 1e-9 if other is not None else True


def _closes(element: Any) -> bool:
    """Check whether an element of ``<gazebo>`` ties two links together: a joint of SDF, or of its first versions."""
    ends = {str(inner.tag) for inner in element}
    return {"parent", "child"} <= ends or {"body1", "body2"} <= ends


def _names(names: list[str]) -> str:
    return listing(names, MOST)
