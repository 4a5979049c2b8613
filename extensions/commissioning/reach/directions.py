"""The directions in which a robot's reach is looked for, at its own size.

A direction is a ray of tasks of one to three lines. Rung ``k`` asks for ``k`` times the direction's
``step``; everything else that a task says is the same on all rungs, and what it leaves unsaid is
chosen by the planner's usual recipe. A pair goes in two directions at once, each by the same share
of its ``GOALS``, so that its value is a share in per cent.

Lengths are BRUCE's, times the ratio of the legs' lengths. How high the jumps ahead, back, aside and so on
rise is told by the caller, because it depends on the motors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....planner.task.read_task import contradictions, edge_room
from ....planner.task.task import JumpTask, make_task
from ....robots.robot_description import RobotDescription

GOALS = {
    "up": 0.25, "ahead": 0.60, "back": 0.30, "aside": 0.35, "turn": math.radians(120.0),
    "step up": 0.12, "step down": 0.35,
}  # fmt: skip
"""Goals at a rate of 95 % by direction [m, rad]: 100 % of each direction in a pair."""
LOOSEST: Mapping[str, Any] = {"effort": 1.0, "margins": None, "foot_clearance": 0.02}
"""Task settings for the theoretical bound: all of the motors' torque and speed, no margins but the
5 mrad at the joints without which no plan is valid, and feet that rise by 2 cm."""
ROUND = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""The lengths that are taken for steps, times a power of ten."""
LONGEST = 2.0
"""Largest length of a jump onto or off a step [m]."""


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
        robot: the name of the robot, where it is not BRUCE.
    """

    name: str
    what: str
    values: Callable[[float], dict[str, float]]
    step: float
    shown: float
    unit: str
    start: int
    most: int
    robot: str = ""

    def value(self, rung: int) -> float:
        """Return a rung's value in ``unit``."""
        return round(rung * self.step * self.shown, 6)

    def task(self, rung: int) -> JumpTask:
        """Return the task on a rung, as a user would ask for it."""
        return make_task({"name": f"{self.name} {self.value(rung):g}", **self._said(rung)})

    def loosest(self, rung: int) -> JumpTask:
        """Return the task with all that the motors have and without margins: for the theoretical
        bound."""
        name = f"{self.name} {self.value(rung):g} at most"
        return make_task({"name": name, **self._said(rung), **LOOSEST})

    def _said(self, rung: int) -> dict[str, Any]:
        robot = {"robot": self.robot} if self.robot else {}
        return robot | {key: round(x, 9) for key, x in self.values(rung * self.step).items()}


def round_length(length: float) -> float:
    """Return the round length nearest to it [m], by its ratio; see ``ROUND``."""
    power = 10.0 ** math.floor(math.log10(length))
    return round(power * min(ROUND, key=lambda each: abs(math.log(length / power / each))), 9)


@dataclass(frozen=True)
class JumpSizes:
    """The lengths from which the directions are made [m].

    Attributes:
        scale: the length of the robot's legs, as a multiple of BRUCE's.
        rise: of the jumps that go somewhere.
        onto: how far ahead it jumps onto a step.
        off: and off one.
        onto_edge, off_edge: how far ahead the step's edge is; without one midway.
    """

    scale: float = 1.0
    rise: float = 0.12
    onto: float = 0.20
    off: float = 0.25
    onto_edge: float | None = None
    off_edge: float | None = None


def single_directions(sizes: JumpSizes = JumpSizes(), robot: str = "") -> tuple[Direction, ...]:
    """Return up, ahead, back, aside, turned, and onto and off a step."""
    rise, onto, off = sizes.rise, sizes.onto, sizes.off
    over = 0.5 * rise  # above a step; and so much of the rise is left off one
    down = rise / 1.5
    edges = [{} if at is None else {"step_edge": at} for at in (sizes.onto_edge, sizes.off_edge)]

    def length(name: str, what: str, values: Callable[[float], dict[str, float]],
               step_cm: float, start: int, most: int) -> Direction:  # fmt: skip
        step = round_length(0.01 * step_cm * sizes.scale)
        return Direction(name, what, values, step, 100.0, "cm", start, most, robot)

    return (
        length("up", "the rise", lambda v: {"rise": v}, 1.0, 22, 50),
        length("ahead", f"the distance; rise {_cm(rise)}",
               lambda v: {"rise": rise, "distance_x": v}, 5.0, 10, 24),
        length("back", f"the distance; rise {_cm(rise)}",
               lambda v: {"rise": rise, "distance_x": -v}, 2.5, 11, 32),
        length("aside", f"the distance to the left; rise {_cm(rise)}",
               lambda v: {"rise": rise, "distance_y": v}, 2.5, 12, 32),
        Direction("turn", f"the turn to the left; rise {_cm(rise)}",
                  lambda v: {"rise": rise, "twist": v}, math.radians(10.0), 180.0 / math.pi, "deg", 8, 27,
                  robot),
        length("step up", f"the step's height; {_cm(onto)} ahead, rise {_cm(over)} above the step",
               lambda v: {"rise": over + v, "distance_x": onto, "landing_height": v, **edges[0]},
               1.0, 8, 30),
        length("step down", f"the step's height; {_cm(off)} ahead, rise {_cm(down)}",
               lambda v: {"rise": down, "distance_x": off, "landing_height": -v, **edges[1]},
               5.0, 5, 12),
    )  # fmt: skip


def _cm(length: float) -> str:
    return f"{round(100.0 * length, 2):g} cm"


def _pair(
    name: str, what: str, values: Callable[[float], dict[str, float]], start: int
) -> Direction:
    return Direction(name, what, values, 0.1, 100.0, "%", start, 20)


DIRECTIONS: tuple[Direction, ...] = (
    *single_directions(),
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
"""BRUCE's directions, in the order of the report."""


def sizes_of(robot: RobotDescription, bruce: RobotDescription, highest: float) -> JumpSizes:
    """Compute the lengths for a robot that can be planned to rise by ``highest`` [m] and no higher.

    Jumps rise as far as BRUCE's for their legs, but no further than half of ``highest``. Jumps onto and off a step
    are so much longer that the robot stands wholly on either side of the edge. The edge is midway for BRUCE, and for
    others midway between the front of the robot as it stands before it and its back, often that of its knees, as it
    stands behind it.
    """
    usual = JumpSizes()
    scale = leg_length(robot) / leg_length(bruce)
    rise = round(min(scale * usual.rise, 0.5 * highest), 2)
    beside = robot.name if robot.name != bruce.name else ""

    def over(length: float, number: int) -> tuple[float, float | None]:
        """Return the length, or a greater one [m], with which the direction of that number is
        consistent at its start, and the edge."""
        length = _whole_steps(scale * length)
        while length < LONGEST:
            way = single_directions(JumpSizes(scale, rise, length, length), beside)[number]
            task = way.task(way.start)
            if not contradictions(task, robot):
                if not beside:
                    break
                start, end = task.places()
                return length, round(0.5 * sum(edge_room(robot, task.hops()[0], start, end)), 2)
            length = _whole_steps(length + 0.05)
        return length, None

    (onto, onto_edge), (off, off_edge) = over(usual.onto, -2), over(usual.off, -1)
    return JumpSizes(scale, rise, onto, off, onto_edge, off_edge)


def leg_length(robot: RobotDescription) -> float:
    """Compute the mean length of thigh and shank together [m]: of the two longest parts of each leg
    between joints, or between the last joint and the ground.

    Raises:
        ValueError: the robot has no feet.
    """
    if not robot.feet:
        raise ValueError(f"{robot.name} has no feet")
    joint_of = {joint.child: joint for joint in robot.joints}
    lengths = []
    for foot in robot.feet:
        places = [c.position for c in robot.contacts if c.foot == foot.name]
        parts = [float(np.linalg.norm(np.mean(places, axis=0)))] if places else []
        link = foot.link
        while link in joint_of and joint_of[link].parent in joint_of:
            parts.append(float(np.linalg.norm(joint_of[link].origin)))
            link = joint_of[link].parent
        lengths.append(sum(sorted(parts)[-2:]))
    return float(np.mean(lengths))


def _whole_steps(length: float) -> float:
    """Round the length to whole steps of 5 cm [m]."""
    return round(0.05 * round(length / 0.05), 9)
