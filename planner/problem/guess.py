"""Initial guess of the solver: standing, a ballistic flight, standing; or the same jump straight ahead, displaced and
turned as the task wants it.
"""

from __future__ import annotations

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.constants import GRAVITY
from ..task.phase import Phase
from .layout import ProblemPhase
from .problem import FullProblem

USUAL_TIMES = {Phase.SQUAT: 0.4, Phase.THRUST: 0.2, Phase.LANDING: 0.15}
"""s; where the time of a phase is free."""


def flight_guess(problem: FullProblem, number: int) -> tuple[float, float]:
    """Return the rough duration of a flight [s] and its initial vertical speed [m/s]."""
    hop = problem.task.hops()[number]
    fall = hop.landing_height or 0.0
    if hop.rise is not None:
        up = np.sqrt(2.0 * GRAVITY * hop.rise)
    elif hop.take_off_speed is not None:
        up = hop.take_off_speed
    else:
        up = np.sqrt(2.0 * GRAVITY * max(0.15, fall + 0.1))
    duration = hop.flight_time
    if duration is None:
        duration = (up + np.sqrt(max(up * up - 2.0 * GRAVITY * fall, 0.04))) / GRAVITY
    return float(duration), float(fall / duration + 0.5 * GRAVITY * duration)


def ballistic_guess(problem: FullProblem) -> Array:
    """Return every variable of the problem: the robot stands, flies as its centre of mass would, and stands again; the
    weight is shared equally by the contact points.
    """
    coordinates, assembly = problem.coordinates, problem.assembly
    n = coordinates.size
    weight = problem.model.robot.weight / len(problem.model.robot.contacts)
    every = len(coordinates.axes)
    falling = coordinates.reduce(np.where(np.arange(problem.model.size) == 2, -GRAVITY, 0.0))
    guess = np.zeros(assembly.variables)
    for problem_phase in problem.problem_phases:
        start = problem.stances[problem_phase.place].coordinates
        mean = _mean_length(problem, problem_phase)
        if problem_phase.flies:
            duration, up = flight_guess(problem, problem_phase.place)
            travel = (problem.stances[problem_phase.place + 1].coordinates - start) / duration
        for k in range(problem_phase.first, problem_phase.stop):
            whole, speed = start, np.zeros(len(start))
            state, control = assembly.state_start[k], assembly.control_start[k]
            if problem_phase.flies:
                time = mean * float(problem.steps[problem_phase.first : k].sum())
                whole, speed = start + time * travel, travel.copy()
                whole[2] = start[2] + up * time - 0.5 * GRAVITY * time * time
                speed[2] = up - GRAVITY * time
                guess[control : control + n] = falling
                turning = list(coordinates.turning)
                guess[control + n : control + n + len(turning)] = coordinates.reduce(speed)[turning]
            elif not problem_phase.impact:
                first = control + n + every - 1
                guess[first : control + n + coordinates.forces : every] = weight
            guess[state : state + n] = coordinates.reduce(whole)
            guess[state + n : state + 2 * n] = coordinates.reduce(speed)
            _guess_lengths(problem, guess, k, mean)
    k, end = problem.knots - 1, problem.end.coordinates
    guess[assembly.state_start[k] : assembly.state_start[k] + n] = coordinates.reduce(end)
    return np.clip(guess, problem.lower, problem.upper)


def _mean_length(problem: FullProblem, problem_phase: ProblemPhase) -> float:
    """Return the mean length of a phase's intervals [s]."""
    if problem_phase.flies:
        return flight_guess(problem, problem_phase.place)[0] / problem_phase.count
    low, high = problem_phase.bounds
    usual = USUAL_TIMES[problem_phase.phase] / problem_phase.count
    return min(max(usual, low), high)


def _guess_lengths(problem: FullProblem, guess: Array, k: int, mean: float) -> None:
    """Set the mean interval lengths among a knot's variables: its own, and that it chooses."""
    assembly, knot = problem.assembly, problem.assembly.knots[k]
    if problem.phase_at(k).timed:
        guess[assembly.state_start[k] + 2 * problem.coordinates.size] = mean
    if knot.hold is not None:
        following = problem.phase_at(k + 1)
        guess[assembly.control_start[k] + knot.hold] = _mean_length(problem, following)


def displaced_guess(problem: FullProblem, straight: FullProblem, values: Array) -> Array:
    """Return every variable of a problem, from the solution of jumps straight ahead or in place, with the same knots:
    the whole robot is moved and turned in proportion to the flight.
    """
    coordinates, assembly = problem.coordinates, problem.assembly
    n, own, plane = coordinates.size, straight.coordinates, straight.assembly
    guess = ballistic_guess(problem)
    places, straight_places = problem.task.places(), straight.task.places()
    for k in range(problem.knots):
        problem_phase = problem.phase_at(k)
        state, control = assembly.state_start[k], assembly.control_start[k]
        other, others = plane.state_start[k], plane.control_start[k]
        here, there = places[problem_phase.place], places[problem_phase.place + problem_phase.flies]
        share = (
            float(problem.steps[problem_phase.first : k].sum() / problem_phase.count)
            * problem_phase.flies
        )
        twist, aside, ahead = there.heading - here.heading, there.y - here.y, there.x - here.x
        angle = here.heading + share * twist
        turn = _turn(angle)
        q = own.matrix @ values[other : other + own.size]
        v = own.matrix @ values[other + own.size : other + 2 * own.size]
        place = np.array([here.x + share * ahead, here.y + share * aside])
        first, second = (
            straight_places[problem_phase.place + i].x for i in (0, int(problem_phase.flies))
        )
        q[:2] = turn @ (q[:2] - [first + share * (second - first), 0.0]) + place
        v[:2] = turn @ v[:2]
        q[5] += angle
        if problem_phase.flies:
            duration = values[other + 2 * own.size] * problem_phase.count
            v[0] += (ahead - (second - first)) / duration
            v[1] += aside / duration
            v[5] += twist / duration
        guess[state : state + n] = coordinates.reduce(q)
        guess[state + n : state + 2 * n] = coordinates.reduce(v)
        if k == problem.knots - 1:
            break
        if problem_phase.timed:
            guess[state + 2 * n] = values[other + 2 * own.size]
        a = own.matrix @ values[others : others + own.size]
        a[:2] = turn @ a[:2]
        guess[control : control + n] = coordinates.reduce(a)
        hold, held = assembly.knots[k].hold, plane.knots[k].hold
        if hold is not None and held is not None:
            guess[control + hold] = values[others + held]
        if problem_phase.flies:
            rates = np.zeros(len(q))
            bent = values[others + own.size : others + own.size + len(own.turning)]
            rates[[own.free_base[i] for i in own.turning]] = bent
            rates[5] += twist / duration
            turning = coordinates.reduce(rates)[list(coordinates.turning)]
            guess[control + n : control + n + len(turning)] = turning
            continue
        pushed = values[others + own.size : others + own.size + own.forces]
        forces = (own.force_matrix @ pushed).reshape(-1, 3)
        forces[:, :2] = forces[:, :2] @ turn.T
        start = control + n
        guess[start : start + coordinates.forces] = coordinates.reduce_forces(forces.ravel())
    return guess


def _turn(angle: float) -> Array:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
