"""Where the solver begins: standing, a ballistic flight, standing; or the same jump straight ahead,
displaced and turned as the task wants it."""

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


def displaced_guess(problem: Problem, straight: Problem, values: Array) -> Array:
    """Every variable of a problem, from the solution of the same jump without its sideways
    displacement and twist: the whole robot is moved and turned in proportion to the flight."""
    task, coordinates, assembly = problem.task, problem.coordinates, problem.assembly
    n, own, plane = coordinates.size, straight.coordinates, straight.assembly
    guess = ballistic_guess(problem)
    step = values[plane.state_start[problem.flight.start] + 2 * own.size]
    duration = step * len(problem.flight)
    for k in range(problem.knots):
        share = float(problem.steps[problem.flight.start : k].sum() / len(problem.flight))
        share = share if k in problem.flight else float(k >= problem.flight.stop)
        flying = k in problem.flight
        state, control = assembly.state_start[k], assembly.control_start[k]
        other, others = plane.state_start[k], plane.control_start[k]
        turn = _turn(share * task.twist)
        q = own.matrix @ values[other : other + own.size]
        v = own.matrix @ values[other + own.size : other + 2 * own.size]
        ahead = np.array([share * task.distance_x, 0.0])
        q[:2] = turn @ (q[:2] - ahead) + share * np.array([task.distance_x, task.distance_y])
        v[:2] = turn @ v[:2]
        q[5] += share * task.twist
        if flying:
            v[1] += task.distance_y / duration
            v[5] += task.twist / duration
        guess[state : state + n] = coordinates.reduce(q)
        guess[state + n : state + 2 * n] = coordinates.reduce(v)
        if k == problem.knots - 1:
            break
        a = own.matrix @ values[others : others + own.size]
        a[:2] = turn @ a[:2]
        guess[control : control + n] = coordinates.reduce(a)
        if flying:
            guess[state + 2 * n] = step
            continue
        pushed = values[others + own.size : others + own.size + own.forces]
        forces = (own.force_matrix @ pushed).reshape(-1, 3)
        forces[:, :2] = forces[:, :2] @ turn.T
        start = control + n
        guess[start : start + coordinates.forces] = coordinates.reduce_forces(forces.ravel())
        hold = assembly.knots[k].hold
        if hold is not None:
            guess[control + hold] = step
    return guess


def _turn(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
