"""The directions in which the frontier is looked for: what a jump there asks for, rung by rung.

A direction is a ray of tasks of one to three lines. Rung ``k`` asks for ``k`` times the direction's
``step``; everything else that a task says is the same on all rungs, and what it leaves unsaid is
chosen by the planner's usual recipe. A pair goes in two directions at once, each by the same share
of its ``GOALS``, so that its value is a share in per cent.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ...planner.task.task import JumpTask, make_task

GOALS = {
    "up": 0.25, "ahead": 0.60, "back": 0.30, "aside": 0.35, "turn": math.radians(120.0),
    "step up": 0.12, "step down": 0.35,
}  # fmt: skip
"""What 100 % of each direction is in a pair [m, rad]: what is wanted of BRUCE at a rate of 95 %."""
LOOSEST: Mapping[str, Any] = {"effort": 1.0, "margins": None, "foot_clearance": 0.02}
"""What a task says besides for the theoretical bound: all of the motors' torque and speed, no
margins but the 5 mrad at the joints without which no plan is valid, and feet that rise by 2 cm."""


@dataclass(frozen=True)
class Direction:
    """A ray of tasks.

    Attributes:
        name: what it is called.
        what: what the value is and what else the tasks say, in words.
        values: what a task with a value [the unit below, in SI] says.
        step: between two rungs, in SI units.
        shown: how many of ``unit`` are one SI unit.
        unit: in which people read the value.
        start: the rung at which the search begins, near where success was last seen to end.
        most: the last rung.
    """

    name: str
    what: str
    values: Callable[[float], dict[str, float]]
    step: float
    shown: float
    unit: str
    start: int
    most: int

    def value(self, rung: int) -> float:
        """A rung's value in ``unit``."""
        return round(rung * self.step * self.shown, 6)

    def task(self, rung: int) -> JumpTask:
        """The task on a rung, as a user would ask for it."""
        return make_task({"name": f"{self.name} {self.value(rung):g}", **self._said(rung)})

    def loosest(self, rung: int) -> JumpTask:
        """The same with all that the motors have and without margins: for the theoretical bound."""
        name = f"{self.name} {self.value(rung):g} at most"
        return make_task({"name": name, **self._said(rung), **LOOSEST})

    def _said(self, rung: int) -> dict[str, float]:
        return {key: round(value, 9) for key, value in self.values(rung * self.step).items()}


def _length(name: str, what: str, values: Callable[[float], dict[str, float]],
            step_cm: float, start: int, most: int) -> Direction:  # fmt: skip
    return Direction(name, what, values, 0.01 * step_cm, 100.0, "cm", start, most)


def _pair(
    name: str, what: str, values: Callable[[float], dict[str, float]], start: int
) -> Direction:
    return Direction(name, what, values, 0.1, 100.0, "%", start, 20)


DIRECTIONS: tuple[Direction, ...] = (
    _length("up", "the rise", lambda v: {"rise": v}, 1.0, 22, 50),
    _length("ahead", "the distance; rise 12 cm",
            lambda v: {"rise": 0.12, "distance_x": v}, 5.0, 10, 24),
    _length("back", "the distance; rise 12 cm",
            lambda v: {"rise": 0.12, "distance_x": -v}, 2.5, 11, 32),
    _length("aside", "the distance to the left; rise 12 cm",
            lambda v: {"rise": 0.12, "distance_y": v}, 2.5, 12, 32),
    Direction("turn", "the turn to the left; rise 12 cm",
              lambda v: {"rise": 0.12, "twist": v}, math.radians(10.0), 180.0 / math.pi, "deg", 8, 27),
    _length("step up", "the step's height; 20 cm ahead, rise 6 cm above the step",
            lambda v: {"rise": 0.06 + v, "distance_x": 0.20, "landing_height": v}, 1.0, 8, 30),
    _length("step down", "the step's height; 25 cm ahead, rise 8 cm",
            lambda v: {"rise": 0.08, "distance_x": 0.25, "landing_height": -v}, 5.0, 5, 12),
    _pair("ahead and up", "the share of 60 cm ahead and of a rise of 25 cm",
          lambda s: {"rise": s * GOALS["up"], "distance_x": s * GOALS["ahead"]}, 6),
    _pair("ahead and turn", "the share of 60 cm ahead and of a turn by 120 deg; rise 12 cm",
          lambda s: {"rise": 0.12, "distance_x": s * GOALS["ahead"], "twist": s * GOALS["turn"]}, 6),
    _pair("aside and turn", "the share of 35 cm to the left and of a turn by 120 deg; rise 12 cm",
          lambda s: {"rise": 0.12, "distance_y": s * GOALS["aside"], "twist": s * GOALS["turn"]}, 6),
    _pair("step up and ahead",
          "the share of a step of 12 cm and of 60 cm ahead; rise 6 cm above the step",
          lambda s: {"rise": 0.06 + s * GOALS["step up"], "distance_x": s * GOALS["ahead"],
                     "landing_height": s * GOALS["step up"]}, 5),
)  # fmt: skip
"""All directions, in the order in which they are told."""
