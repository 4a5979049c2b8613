"""Where the solver begins: standing, a ballistic flight, standing; or a plan of a near task."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..signals import Phase
from .problem import Problem
from .symbolic_model import GRAVITY

Array = NDArray[np.float64]


def ballistic_guess(problem: Problem) -> Array:
    """Every variable of the problem: the robot stands, flies as its centre of mass would, and
    stands again; the weight is shared equally by the contact points."""
    task, coordinates, assembly = problem.task, problem.coordinates, problem.assembly
    n = coordinates.size
    fall = task.landing_height
    if task.rise is not None:
        up = np.sqrt(2.0 * GRAVITY * task.rise)
    elif task.take_off_speed is not None:
        up = task.take_off_speed
    else:
        up = np.sqrt(2.0 * GRAVITY * max(0.15, fall + 0.1))
    duration = task.flight_time
    if duration is None:
        duration = (up + np.sqrt(max(up * up - 2.0 * GRAVITY * fall, 0.04))) / GRAVITY
    step = duration / len(problem.flight)
    up = fall / duration + 0.5 * GRAVITY * duration
    travel = (problem.end.coordinates - problem.start.coordinates) / duration
    start, end = problem.start.coordinates, problem.end.coordinates
    weight = problem.model.robot.total_mass * GRAVITY / len(problem.model.robot.contacts)
    guess = np.zeros(assembly.variables)
    for k in range(problem.knots):
        whole, speed = (start, np.zeros(len(start))) if k < problem.flight.start else (end, 0 * end)
        if k in problem.flight:
            time = step * float(problem.steps[problem.flight.start : k].sum())
            whole, speed = start + time * travel, travel.copy()
            whole[2] = start[2] + up * time - 0.5 * GRAVITY * time * time
            speed[2] = up - GRAVITY * time
        state, control = assembly.state_start[k], assembly.control_start[k]
        guess[state : state + n] = coordinates.reduce(whole)
        guess[state + n : state + 2 * n] = coordinates.reduce(speed)
        if k == problem.knots - 1:
            break
        if problem.phases[k] is Phase.FLIGHT:
            guess[state + 2 * n] = step
            guess[control : control + n] = coordinates.reduce(
                np.where(np.arange(len(start)) == 2, -GRAVITY, 0.0)
            )
        else:
            every = len(coordinates.axes)
            guess[control + n + every - 1 : control + n + coordinates.forces : every] = weight
            hold = assembly.knots[k].hold
            if hold is not None:
                guess[control + hold] = step
    return np.clip(guess, problem.lower, problem.upper)
