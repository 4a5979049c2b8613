"""The search along one direction of the frontier: what is tried next, given what was found."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field

from ...planner.task.task import JumpTask
from ...studies.journal import Outcome
from .directions import Direction
from .jobs import FIRST_LOOK, required
from .ladders import furthest, outward

MOST_CPU, FIRST_LOOK_CPU = 90.0, 15.0
"""s; after so much processor time no further solve is begun in a search along one direction; the
second with fewer runs a rung than ``FIRST_LOOK``."""


@dataclass(frozen=True)
class Ask:
    """A try on a rung: ``recipe`` and ``loosest`` are plans, ``run`` is the runs of the former;
    ``near`` is the task from whose plan a solve may start."""

    kind: str
    rung: int
    near: JumpTask | None = None


@dataclass
class Tries:
    """What was tried along a direction by its rung, and where each search ended. ``planned_ended``
    and ``theory_ended`` are false where ``MOST_CPU`` stopped the search, which might go further."""

    direction: Direction
    recipe: dict[int, Outcome] = field(default_factory=dict)
    runs: dict[int, list[Outcome]] = field(default_factory=dict)
    loosest: dict[int, Outcome] = field(default_factory=dict)
    planned: int = 0
    reached: int = 0
    theory: int = 0
    planned_ended: bool = True
    theory_ended: bool = True


def explore(tries: Tries, runs: int) -> Generator[Ask, None, None]:
    """The tries along one direction, one after the other; what each found is in ``tries`` before
    the next is asked for."""
    way = tries.direction
    most = MOST_CPU if runs >= FIRST_LOOK else FIRST_LOOK_CPU
    search = furthest(way.start, way.most)
    rung = next(search)
    try:
        while _spent(tries.recipe) < most:
            yield Ask("recipe", rung)
            tries.planned = max([k for k, v in tries.recipe.items() if v.success], default=0)
            rung = search.send(tries.recipe[rung].success)
        tries.planned_ended = False
    except StopIteration as end:
        tries.planned = end.value
    if tries.planned:
        walk = outward(min(way.start, tries.planned), tries.planned)
        rung = next(walk)
        try:
            while True:
                if rung not in tries.recipe:
                    yield Ask("recipe", rung)
                good = False
                if tries.recipe[rung].success:
                    yield Ask("run", rung)
                    landed = sum(run.success for run in tries.runs[rung])
                    good = landed >= required(runs)
                rung = walk.send(good)
        except StopIteration as end:
            tries.reached = end.value
    tries.theory = tries.planned  # its plan keeps the looser limits as well
    near = way.task(tries.planned) if tries.planned else None
    search = furthest(tries.planned + 1, way.most, tries.planned)
    try:
        rung = next(search)
        while _spent(tries.loosest) < most:
            yield Ask("loosest", rung, near)
            if tries.loosest[rung].success:
                tries.theory, near = rung, way.loosest(rung)
            rung = search.send(tries.loosest[rung].success)
        tries.theory_ended = False
    except StopIteration as end:
        tries.theory = end.value


def _spent(outcomes: dict[int, Outcome]) -> float:
    return sum(float(outcome.metrics.get("cpu_s", 0.0)) for outcome in outcomes.values())
