"""The report of a block on a parameter or a robot that it cannot work with."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class UnmetRequirement:
    """Something about the graph's robot or a parameter that a block cannot work with.

    ``message`` describes the problem. ``parameter`` is the parameter concerned, if any, as ``name``
    or ``name.key``. ``nearest`` holds legal names that resemble the one found. ``fix`` is the text
    to write instead.
    """

    message: str
    parameter: str = ""
    expected: str = ""
    found: str = ""
    nearest: tuple[str, ...] = ()
    fix: str = ""
