"""The tasks of robots as a bench finds them, in their order."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ....studies.rehearsing.learning import ladder

EFFORT = 0.75
"""The share of the motors' torque and speed that the plans may use. The shipped recipe's 0.85 leaves too little for a
real robot: saturation, load friction and friction take 15 % of the peak torque in the trial ``real``."""
ALONE = "jump.yaml"
"""The graph of one jump."""
OTHERS = "robots/"
"""The graphs of robots other than BRUCE."""
TIMES = 5
"""Number of times that a robot that learns makes a jump of one kind."""
PUSHES = (0.0, 90.0, 180.0, 270.0)
"""The directions of pushes in flight [deg], in which robots take turns."""


@dataclass(frozen=True)
class AskedJump:
    """One kind of jump.

    Attributes:
        robot: that makes it.
        graph: the shipped graph that makes it.
        task: changes of that graph's task.
        times: how often it is made by a robot that learns.
        sets: further parameters of the graph.
        behind: a shipped file that the graph includes behind all others.
    """

    task: Mapping[str, Any]
    graph: str = ALONE
    times: int = TIMES
    sets: Mapping[str, Any] = field(default_factory=dict)
    behind: str = ""
    robot: str = "bruce"

    @property
    def alone(self) -> bool:
        """True for one jump without a push, from which a robot learns."""
        return self.graph == ALONE or self.graph.startswith(OTHERS)

    def before(self, first: bool) -> list[dict[str, float]]:
        """Return the smaller jumps that a robot that learns makes before: all of the ladder at
        ``first``, then half as far."""
        rungs = ladder(self.task, self.task["rise"])
        return rungs if first else rungs[-1:] if len(self.task) > 1 and self.alone else []


ASKED: Mapping[str, AskedJump] = {
    "in place 12 cm": AskedJump({"rise": 0.12}),
    "ahead 20 cm": AskedJump({"rise": 0.12, "distance_x": 0.2}),
    "back 12 cm": AskedJump({"rise": 0.08, "distance_x": -0.12}),
    "aside 15 cm": AskedJump({"rise": 0.08, "distance_y": 0.15}),
    "turn 30 deg": AskedJump({"rise": 0.10, "twist": math.radians(30.0)}),
    "up 5 cm": AskedJump({"rise": 0.11, "distance_x": 0.15, "landing_height": 0.05}),
    "down 15 cm": AskedJump({"rise": 0.08, "distance_x": 0.2, "landing_height": -0.15}),
}
"""The jumps of every robot, in their order."""
RANDOM, PUSH, TEN = "random task", "pushed in flight", "ten in a row"
SEEN = "ten in a row, place measured"
EVERY = (*ASKED, RANDOM, PUSH, TEN, SEEN)
"""All tasks, in the order in which a robot does them."""


def _others(
    name: str, in_place: str, ahead: str, rise: float, distance: float
) -> Mapping[str, AskedJump]:
    graph = f"{OTHERS}{name}_jump.yaml"
    return {
        in_place: AskedJump({"rise": rise}, graph, robot=name),
        ahead: AskedJump({"rise": rise, "distance_x": distance}, graph, robot=name),
    }


ASKED_OF_OTHERS: Mapping[str, Mapping[str, AskedJump]] = {
    "go2": _others("go2", "in place 10 cm", "ahead 20 cm", 0.1, 0.2),
    "g1": _others("g1", "in place 5 cm", "ahead 8 cm", 0.05, 0.08),
    "solo12": _others("solo12", "in place 10 cm", "ahead 15 cm", 0.1, 0.15),
}
"""The tasks of robots other than BRUCE."""


def asked_of(seed: int, robot: str = "bruce") -> Mapping[str, AskedJump]:
    """Return the jumps that the robot of a seed is asked for, by name; BRUCE's random task and push
    are its own."""
    if robot != "bruce":
        return ASKED_OF_OTHERS[robot]
    angle = math.radians(PUSHES[seed % len(PUSHES)])
    ten: dict[str, Any] = {"rise": 0.06, "repeat": 10}
    return {
        **ASKED,
        RANDOM: AskedJump(random_task(seed), times=4),
        PUSH: AskedJump({"rise": 0.12}, "push_12cm.yaml", 1, {"push.angle": angle}),
        TEN: AskedJump(ten, "hops.yaml", 1),
        SEEN: AskedJump(ten, "hops.yaml", 1, behind="controllers/pose_sensor.yaml"),
    }


def random_task(seed: int) -> Mapping[str, float]:
    """Draw a task of 6 to 14 cm, -10 to 22 cm ahead, up to 10 cm aside, and turned by up to 40 deg."""
    rng = np.random.default_rng(seed)

    def between(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 3)

    return {
        "rise": between(0.06, 0.14),
        "distance_x": between(-0.10, 0.22),
        "distance_y": between(-0.10, 0.10),
        "twist": between(-math.radians(40.0), math.radians(40.0)),
    }
