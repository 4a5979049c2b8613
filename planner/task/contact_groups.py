"""Groups of contact points as a task names them, and phases in which they leave the ground or come down in turn.

take_off: {fore: 80 ms}                    # the fore feet leave the ground 80 ms before the flight begins
touchdown: {hind: 60 ms}                   # the hind feet come down 60 ms after it has ended
take_off: {FL: 90 ms, RR: 90 ms, FR: 40 ms}
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from ...robots.description import RobotDescription
from ...robots.kinematics import standing_contacts

ALL = "all"
SIDES = {"fore": (0, 1.0), "hind": (0, -1.0), "left": (1, 1.0), "right": (1, -1.0)}
"""Words for the contact points on one side of the middle between the feet: the axis and its sign."""
NEAR_MIDDLE = 0.01
"""m; nearer to the middle a point is on neither side."""
MOST_IN_TURN = 0.5
"""s; by how much feet leave or land after each other at most."""
LEAST_TOGETHER = 0.03
"""s; for how long all of them are on the ground before they leave, or after they have landed, at least."""
PART_OF_KNOTS = 0.67
"""Intervals of a part in which some of the feet are off the ground, by those of the whole phase."""


def contact_points(robot: RobotDescription, words: str | Iterable[str]) -> tuple[int, ...]:
    """Return the contact points that one of the words means: ``all``; else those whose names contain it; else, for
    ``fore``, ``hind``, ``left`` and ``right``, those on that side of the standing robot. Empty where there is none.
    """
    found = set[int]()
    for word in (words,) if isinstance(words, str) else words:
        named = {k for k, c in enumerate(robot.contacts) if word in (ALL, c.name) or word in c.name}
        if not named and word in SIDES:
            axis, sign = SIDES[word]
            places = sign * standing_contacts(robot)[:, axis]
            named = {k for k, place in enumerate(places.tolist()) if place > NEAR_MIDDLE}
        found |= named
    return tuple(sorted(found))


def in_turn(
    whole: Mapping[str, Any], lifted: Mapping[str, float], knots: int, *, landing: bool
) -> list[dict[str, Any]]:
    """Return a phase on the ground in parts, as keywords of ``PhaseSpec``: one on all contact points and one for each
    time.

    Args:
        whole: the keywords of the phase; its ``time`` [s] may be ``None``.
        lifted: for how long [s] before its end, or in a ``landing`` from its beginning, points are off the ground.
        knots: intervals of the whole phase.
    """
    times = sorted(set(lifted.values()))
    rest = whole.get("time")
    if rest is not None:
        rest = max(LEAST_TOGETHER, round(rest - times[-1], 6))
    parts = [{**whole, "time": rest}]
    share = max(4, round(PART_OF_KNOTS * knots / len(times)))
    for shorter, longer in zip([0.0, *times], times, strict=False):
        off = tuple(name for name, time in lifted.items() if time >= longer)
        time = round(longer - shorter, 6)
        parts.insert(1, {**whole, "time": time, "raised": off, "knots": share})
    return parts[::-1] if landing else parts


def wrong_times(lifted: Mapping[str, float], whole: float | None, phase: str) -> str:
    """Return what is wrong with the times [s] of feet that leave or land in turn in a phase of that time; empty:
    nothing.
    """
    if not lifted:
        return "name contact points and a time, such as {fore: 80 ms}"
    most = MOST_IN_TURN if whole is None else min(MOST_IN_TURN, whole - LEAST_TOGETHER)
    for name, time in lifted.items():
        if not 0.0 < time <= most:
            return f"{name}: expected a time above 0 and up to {most:g} s in this {phase}, found {time:g} s"
    return ""


def wrong_groups(
    robot: RobotDescription, groups: Sequence[tuple[str, str | Iterable[str]]]
) -> Iterator[tuple[str, str]]:
    """Yield by its place in the task each word that means no contact point, and what it could be."""
    for where, words in groups:
        for word in (words,) if isinstance(words, str) else words:
            if not contact_points(robot, word):
                names = ", ".join(contact.name for contact in robot.contacts)
                sides = ", ".join(side for side in SIDES if contact_points(robot, side))
                what = f"no contact point of {robot.name} is named like {word!r}"
                yield where, f"{what}; there is {names}, or a side: {sides}"
