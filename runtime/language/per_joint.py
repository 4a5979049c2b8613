"""Values for the joints of a robot, given by name or pattern and never by position."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, RootModel, StrictFloat, model_validator
from pydantic_core import PydanticCustomError

from ...robots.description import RobotDescription

BY_POSITION = "by_position"
"""The type of pydantic's error for a list, which would give values by position."""


class PerJoint(RootModel[StrictFloat | dict[str, StrictFloat]]):
    """A parameter with one value for every joint of the robot.

    In a graph it is one number for all joints, or a mapping from joint names or shell patterns to
    numbers, in which later entries win::

        stiffness: {"*": 40, "*_knee": 60, left_knee: 65}

    A list is refused, because its meaning would change with the order of the joints. The load
    report names patterns that match no joint and joints without a value. Bounds and a unit are
    declared as for a number, and hold for every value::

        stiffness: PerJoint = live_parameter(40.0, unit="N m/rad", ge=0.0, text="...")
    """

    model_config = ConfigDict(frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _refuse_lists(cls, data: Any) -> Any:
        if isinstance(data, Sequence) and not isinstance(data, str):
            raise PydanticCustomError(
                BY_POSITION,
                "values are given by joint name, not by position",
                {"expected": "a number for all joints, or numbers by joint name or pattern"},
            )
        return data

    def resolve(self, robot: RobotDescription) -> NDArray[np.float64]:
        """Return the values in the order of the description's joints, (n_joints,).

        Raises:
            LookupError: a pattern matches no joint, or a joint has no value. Loading reports both,
                so this cannot happen in a graph that was loaded without problems.
        """
        unmatched, missing = self.unmatched_patterns(robot), self.joints_without_value(robot)
        if unmatched:
            raise LookupError(f"{robot.name} has no joint {', '.join(unmatched)}")
        if missing:
            raise LookupError(f"there is no value for {robot.name}'s {', '.join(missing)}")
        return np.array([self._value(joint.name) for joint in robot.joints], dtype=np.float64)

    def unmatched_patterns(self, robot: RobotDescription) -> tuple[str, ...]:
        """Return the patterns that match none of the robot's joints."""
        names = [joint.name for joint in robot.joints]
        return tuple(
            pattern
            for pattern in self._patterns()
            if not any(fnmatchcase(name, pattern) for name in names)
        )

    def joints_without_value(self, robot: RobotDescription) -> tuple[str, ...]:
        """Return the robot's joints that no pattern matches."""
        names = (joint.name for joint in robot.joints)
        return tuple(name for name in names if self._value(name) is None)

    def _patterns(self) -> Mapping[str, float]:
        return self.root if isinstance(self.root, dict) else {"*": self.root}

    def _value(self, joint: str) -> float | None:
        value = None
        for pattern, each in self._patterns().items():
            if fnmatchcase(joint, pattern):
                value = each
        return value

    # Pydantic checks bounds by comparing the whole object; a bound holds if all values obey it.

    def _all(self, holds: Callable[[float], bool]) -> bool:
        return all(holds(value) for value in self._patterns().values())

    def __ge__(self, bound: float) -> bool:
        return self._all(lambda value: value >= bound)

    def __gt__(self, bound: float) -> bool:
        return self._all(lambda value: value > bound)

    def __le__(self, bound: float) -> bool:
        return self._all(lambda value: value <= bound)

    def __lt__(self, bound: float) -> bool:
        return self._all(lambda value: value < bound)


def by_name(values: Sequence[Any], robot: RobotDescription) -> dict[str, Any]:
    """Return the likely meaning of a list of values by position, by joint name; empty if it is
    unclear.

    The list is taken for one value for every joint, or one for every joint of a leg, from the base
    outwards and the same for all legs.
    """
    joints = [joint.name for joint in robot.joints]
    if len(values) == len(joints):
        return dict(zip(joints, values, strict=True))
    legs = [tuple(_chain(robot, foot.link)) for foot in robot.feet]
    if not legs or any(len(leg) != len(values) for leg in legs):
        return {}
    found: dict[str, Any] = {}
    for value, *names in zip(values, *legs, strict=True):
        pattern = _pattern(names)
        exact = [name for name in joints if fnmatchcase(name, pattern)]
        keys = [pattern] if sorted(exact) == sorted(set(names)) else names
        found.update(dict.fromkeys(keys, value))
    return found


def _chain(robot: RobotDescription, link: str) -> Iterator[str]:
    """Yield the names of the joints from the base to a link."""
    joint = next((joint for joint in robot.joints if joint.child == link), None)
    if joint is not None:
        yield from _chain(robot, joint.parent)
        yield joint.name


def _pattern(names: Sequence[str]) -> str:
    """Return the common start and the common end of some names, with a star between them."""
    shortest = min(len(name) for name in names)
    start = 0
    while start < shortest and len({name[start] for name in names}) == 1:
        start += 1
    if start == shortest and len(set(names)) == 1:
        return names[0]
    end = 0
    while end < shortest - start and len({name[-1 - end] for name in names}) == 1:
        end += 1
    head, tail = names[0][:start], names[0][len(names[0]) - end :]
    # Whole words are preferred where they match the same names: "*_knee", not "*t_knee".
    words = f"{head[: head.rfind('_') + 1]}*{tail[tail.find('_') :] if '_' in tail else ''}"
    return words if words != "*" else f"{head}*{tail}"
