"""The phases of a task divided into intervals: what the knots of its problem stand for.

Knots are the beginnings of intervals, and the end. A problem phase is a phase with a number of intervals;
where its time is free, and in every flight, the mean length of its intervals is a state that the
knot before it chooses. With impacts one interval of no length, the touchdown's impulse, comes
between a flight and the ground.

Where forces and legs move fast, at lift-off and around touchdown, intervals are short; where the
robot squats or comes to rest they are long. Each function gives the intervals' lengths as multiples
of the phase's mean.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...mathematics.arrays import Array
from ...robots.description import RobotDescription
from ..task.phase import Phase
from ..task.sequence import PHASES
from ..task.task import JumpTask, JumpTaskError

GROWTH = {Phase.SQUAT: 0.5, Phase.THRUST: 0.4, Phase.LANDING: 5.0}
"""The last interval's length by the first's."""
GROWTH_BETWEEN = 2.0
"""The same for a landing that leads to another jump."""
FLIGHT_MIDDLE = 4.0
"""The length of an interval in the middle of the flight by one at its ends."""


def spacing(phase: Phase, count: int, *, last: bool = True) -> Array:
    """Return interval lengths (count,) with a mean of one; with ``last`` no jump follows."""
    place = (np.arange(count) + 0.5) / count
    if phase is Phase.FLIGHT:
        lengths = 1.0 + (FLIGHT_MIDDLE - 1.0) * np.sin(np.pi * place)
    else:
        growth = GROWTH[phase]
        if phase is Phase.LANDING and not last:
            growth = GROWTH_BETWEEN
        lengths = growth**place
    return np.asarray(lengths * count / lengths.sum())


SHORTEST_FLIGHT, LONGEST_FLIGHT = 0.04, 1.5
"""s; bounds of a flight time that is left to the planner."""
SHORTEST_STANCE, LONGEST_STANCE = 0.03, 0.6
"""s; bounds of any other."""


@dataclass(frozen=True, eq=False)
class ProblemPhase:
    """A phase of the problem.

    Attributes:
        phase: which.
        first, count: its first knot, and how many intervals it has.
        time: how long it lasts [s]; ``None`` if that is free.
        lengths: of its intervals as multiples of their mean, (count,).
        place: how many flights are before it: where the feet stand, or a flight takes off.
        contacts: the contact points on the ground.
        impact: whether it is the impulse of a touchdown.
    """

    phase: Phase
    first: int
    count: int
    time: float | None
    lengths: Array
    place: int
    contacts: tuple[int, ...]
    impact: bool = False

    @cached_property
    def flies(self) -> bool:
        """True if the robot is in the air."""
        return self.phase is Phase.FLIGHT

    @cached_property
    def timed(self) -> bool:
        """True if the mean length of its intervals is a state."""
        return self.flies or self.time is None

    @cached_property
    def stop(self) -> int:
        """The knot at which it ends."""
        return self.first + self.count

    @cached_property
    def piece(self) -> str:
        """The piece that its intervals are made of."""
        if self.impact:
            return "impact"
        return "flight" if self.flies else "free_stance" if self.timed else "stance"

    @property
    def bounds(self) -> tuple[float, float]:
        """The least and the greatest mean length of its intervals [s]."""
        if self.time is not None:
            return self.time / self.count, self.time / self.count
        low, high = (
            (SHORTEST_FLIGHT, LONGEST_FLIGHT) if self.flies else (SHORTEST_STANCE, LONGEST_STANCE)
        )
        return low / self.count, high / self.count


def layout(task: JumpTask, robot: RobotDescription) -> tuple[ProblemPhase, ...]:
    """Return the phases of a task in the order of time.

    Raises:
        JumpTaskError: a phase on the ground names no contact point.
    """
    phase_specs, found, knot, place = task.phase_specs(), list[ProblemPhase](), 0, 0
    for number, phase_spec in enumerate(phase_specs):
        phase, on_ground = PHASES[phase_spec.phase], phase_spec.on_ground(robot)
        flies = phase is Phase.FLIGHT
        if not flies and not on_ground:
            raise JumpTaskError(
                f"phase {number + 1}, {phase_spec.phase}: no contact point of {robot.name} is on the ground"
            )
        if task.impact and found and found[-1].flies:
            found.append(
                ProblemPhase(phase, knot, 1, 0.0, np.zeros(1), place, on_ground, impact=True)
            )
            knot += 1
        last = all(later.phase != "flight" for later in phase_specs[number:])
        count = phase_spec.knots or 1
        lengths = spacing(phase, count, last=last)
        found.append(ProblemPhase(phase, knot, count, phase_spec.time, lengths, place, on_ground))
        knot, place = knot + count, place + flies
    return tuple(found)
