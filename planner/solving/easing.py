"""Solves hard jumps by way of easier ones, with stronger motors first and then weaker ones step by step.

For a somersault a solver that starts from a rough guess rarely finds a motion within tight motor limits. With
limits that are higher by 40 % or more it does. That motion is then a good initial guess for limits a little lower, and so on
down to the real ones. All other constraints hold at every step.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...mathematics.arrays import Array
from ..problem.problem import Problem
from ..task.plan import ARRAYS, JumpPlan
from .solver import Solution, solve

EASES = (1.4, 2.0)
"""Times the real motor limits that a first motion is looked for with."""
FIRST_STEP, LAST_STEP = 0.1, 0.02
"""By how much the limits come down at a time; halved where the solver does not follow."""
COLD_LIMIT, WARM_LIMIT = 250, 100
"""Iterations."""


def eased(problem: Problem, ease: float) -> Problem:
    """The problem with motor limits ``ease`` times as high."""
    motors = np.array([family.startswith("motor") for family in problem.families])
    scale = np.where(motors, ease, 1.0)
    return replace(
        problem, row_lower=problem.row_lower * scale, row_upper=problem.row_upper * scale
    )


def tighten(problem: Problem, values: Array, ease: float) -> Solution | None:
    """A solution of the problem, from one of the problem eased so much; ``None`` if none is
    reached."""
    step, found = FIRST_STEP, None
    iterations, cpu = 0, 0.0
    while ease > 1.0 or found is None:
        to = max(1.0, ease - step)
        trial = solve(eased(problem, to), values, warm=True, solver="fatrop", limit=WARM_LIMIT)
        iterations, cpu = iterations + trial.iterations, cpu + trial.cpu
        if trial.solved:
            values, ease, found = trial.values, to, trial
            continue
        step /= 2.0
        if step < LAST_STEP:
            return None
    return replace(found, iterations=iterations, cpu=cpu)


def from_eased(problem: Problem, guess: Array) -> Solution | None:
    """A solution of the problem from a rough guess, by way of eased ones."""
    for ease in EASES:
        first = solve(eased(problem, ease), guess, solver="fatrop", limit=COLD_LIMIT)
        if first.solved:
            found = tighten(problem, first.values, ease)
            if found is not None:
                return replace(found, iterations=found.iterations + first.iterations)
    return None


def with_impacts(plan: JumpPlan) -> JumpPlan:
    """A plan whose feet arrive at rest with an impact of no impulse after every flight."""
    flying = np.append(plan.phase[:-1] == 3, False)
    touchdowns = np.flatnonzero(flying[:-1] & ~flying[1:]) + 1
    arrays = {
        name: np.insert(getattr(plan, name), touchdowns, getattr(plan, name)[touchdowns], axis=0)
        for name in ARRAYS
    }
    arrays["contact_force"][touchdowns + np.arange(len(touchdowns))] = 0.0
    return replace(plan, **arrays)
