"""Keeps what follows from a robot alone: recipe and scaling ask for it for every task anew."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

from ...robots.description import RobotDescription

KEPT = 8
"""For how many robots and arguments a function's results are kept."""

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")
_OfRobot = Callable[Concatenate[RobotDescription, _Parameters], _Result]


_texts: OrderedDict[int, tuple[RobotDescription, str]] = OrderedDict()
"""The content of the robots used last, by their ``id``. They are kept alive with it, so that no other
object has it, and they cannot change."""


def _text_of(robot: RobotDescription) -> str:
    if id(robot) not in _texts:
        _texts[id(robot)] = robot, robot.model_dump_json()
    _texts.move_to_end(id(robot))
    while len(_texts) > KEPT:
        _texts.popitem(last=False)
    return _texts[id(robot)][1]


def per_robot(function: _OfRobot[_Parameters, _Result]) -> _OfRobot[_Parameters, _Result]:
    """Call a function once for the same robot and arguments. What it returns must not be changed."""
    kept: OrderedDict[str, _Result] = OrderedDict()

    @wraps(function)
    def called(
        robot: RobotDescription, *args: _Parameters.args, **kwargs: _Parameters.kwargs
    ) -> _Result:
        # A description is not hashable, and two of the same content may be different objects.
        key = f"{_text_of(robot)} {args} {sorted(kwargs.items())}"
        if key not in kept:
            kept[key] = function(robot, *args, **kwargs)
        kept.move_to_end(key)
        while len(kept) > KEPT:
            kept.popitem(last=False)
        return kept[key]

    return called
