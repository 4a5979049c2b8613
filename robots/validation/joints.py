"""Checks of every joint for itself: where it is, its axis, its limits."""

from __future__ import annotations

import math

from ..parts import Joint
from .draft import Draft
from .faults import Path, number, vector

UNIT = 1e-6
"""How far an axis' length may be from one: six digits in a file are enough."""


def check_joints(draft: Draft) -> None:
    """Report origins that are not finite, axes that are no direction, limits that are reversed."""
    for k, joint in draft.parts("joints", Joint):
        path: Path = ("joints", k)
        if not all(map(math.isfinite, joint.origin)):
            draft.add(
                (*path, "origin"), f"joint {joint.name} is nowhere",
                "three finite numbers of m", vector(joint.origin),
            )  # fmt: skip
        _check_axis(draft, (*path, "axis"), joint)
        if joint.limits is not None:
            _check_limits(draft, (*path, "limits"), joint.name, *joint.limits)


def _check_axis(draft: Draft, path: Path, joint: Joint) -> None:
    length = math.hypot(*joint.axis)
    found, expected = vector(joint.axis), "a vector of length 1"
    if not math.isfinite(length) or length < 1e-9:
        draft.add(
            path, f"the axis of joint {joint.name} is no direction", expected, found,
            "axis: [0, 0, 1]",
        )  # fmt: skip
    elif abs(length - 1.0) > UNIT:
        unit = vector(round(value / length, 9) for value in joint.axis)
        draft.add(
            path, f"the axis of joint {joint.name} has length {number(length)}", expected, found,
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
