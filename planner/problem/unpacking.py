"""Conversion of the problem's variables to a plan, and of a plan of a near task to variables. A solve on another grid
starts from a plan's motion at other instants of the same phases.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ...mathematics.compiling.lanes import Lanes
from ..models.euler_angles import coordinates_of, pose_of, twist_of
from ..models.interpreted import interpreted
from ..models.symbolic_model import SymbolicModel, centroidal_momentum
from ..task.plan import PlannedJump
from ..task.sequence import LEVEL, ground_axes
from .guess import ballistic_guess
from .layout import ProblemPhase
from .problem import FullProblem

Phases = Sequence[int]


def segments(phases: Phases) -> list[tuple[int, int, int]]:
    """Return the runs of intervals in one phase: (phase, first interval, one behind the last)."""
    found, start = [], 0
    for phase, group in groupby(int(phase) for phase in phases):
        stop = start + len(list(group))
        found.append((phase, start, stop))
        start = stop
    return found


def same_phases(first: Phases, second: Phases) -> bool:
    """Check whether both go through the same phases in the same order."""
    return [s[0] for s in segments(first)] == [s[0] for s in segments(second)]


def matching_times(time: Array, phases: Phases, steps: Array, others: Phases) -> Array:
    """Return for every knot of a grid (interval lengths ``steps`` in phases ``others``) the instant of the motion with
    knots at ``time`` and intervals in ``phases`` that is as far into the same phase.

    Only the proportions of ``steps`` within a phase count. (n_steps + 1,)
    """
    out = np.empty(len(steps) + 1)
    for (_, a, b), (_, c, d) in zip(segments(phases), segments(others), strict=True):
        share = np.concatenate([[0.0], np.cumsum(steps[c:d])]) / steps[c:d].sum()
        out[c : d + 1] = time[a] + share * (time[b] - time[a])
    return out


def states_at(instants: Array, time: Array, place: Array, rate: Array) -> tuple[Array, Array]:
    """Return places and rates at those instants between knots: places by the cubic through both ends' places and rates,
    rates linearly.
    """
    k = np.clip(np.searchsorted(time, instants + 1e-12, side="right") - 1, 0, len(time) - 2)
    h = (time[k + 1] - time[k])[:, None]
    u = (instants[:, None] - time[k][:, None]) / h
    way = place[k + 1] - place[k]
    bend = 3.0 * way - h * (2.0 * rate[k] + rate[k + 1])
    twist = h * (rate[k] + rate[k + 1]) - 2.0 * way
    moved = place[k] + u * (h * rate[k] + u * (bend + u * twist))
    return moved, (1.0 - u) * rate[k] + u * rate[k + 1]


def means_over(instants: Array, time: Array, values: Array) -> Array:
    """Return the means between the instants of what is constant over the intervals of ``time`` (rows of ``values``),
    (n_instants - 1, ...).
    """
    total = np.concatenate(
        [np.zeros_like(values[:1]), np.cumsum(np.diff(time)[:, None] * values[: len(time) - 1], 0)]
    )
    sums = np.column_stack([np.interp(instants, time, column) for column in total.T])
    return np.asarray(np.diff(sums, axis=0) / np.diff(instants)[:, None])


def knot_times(problem: FullProblem, values: Array) -> Array:
    """Return the time of every knot [s]."""
    n, assembly = problem.coordinates.size, problem.assembly
    steps = problem.steps.copy()
    for problem_phase in problem.problem_phases:
        for k in range(
            problem_phase.first, problem_phase.stop if problem_phase.timed else problem_phase.first
        ):
            steps[k] *= values[assembly.state_start[k] + 2 * n]
    return np.concatenate([[0.0], np.cumsum(steps)])


def unpack(problem: FullProblem, values: Array) -> dict[str, Any]:
    """Return the arrays of a plan, and its lift-off and touchdown times."""
    assembly, coordinates, model = problem.assembly, problem.coordinates, problem.exact
    n, count = coordinates.size, problem.knots
    times = knot_times(problem, values)
    states = values[assembly.state_start[:, None] + np.arange(2 * n)]
    q, v = states[:, :n] @ coordinates.matrix.T, states[:, n:] @ coordinates.matrix.T
    bend, force = np.zeros((count, model.size)), np.zeros((count, 3 * len(model.robot.contacts)))
    grounded = np.zeros((count, len(model.robot.contacts)), dtype=bool)
    impacts = np.zeros(count, dtype=bool)
    for problem_phase in problem.problem_phases:
        here = slice(problem_phase.first, problem_phase.stop)
        control = assembly.control_start[here, None] + np.arange(n)
        impacts[here] = problem_phase.impact
        grounded[here, list(problem_phase.contacts)] = True
        if not problem_phase.impact:
            bend[here] = values[control] @ coordinates.matrix.T
        if not problem_phase.flies:
            pushed = values[control[:, :1] + n + np.arange(coordinates.forces)]
            force[here] = pushed @ coordinates.force_matrix.T
            force.reshape(count, -1, 3)[here][~grounded[here]] = 0.0
            _turn_forces(problem, problem_phase, force[here], to_world=True)
    phases = [int(phase) for phase in problem.phases]
    for array in (bend, force, grounded):
        array[-1] = array[-2]
    steps = np.diff(times, append=times[-1])
    steps[-1] = steps[-2]
    middle = q + 0.5 * steps[:, None] * v + 0.125 * steps[:, None] ** 2 * bend
    moving = v + 0.5 * steps[:, None] * bend
    _middles_in_flight(problem, values, steps, q, v, middle, moving)
    middle[-1], moving[-1] = middle[-2], moving[-2]
    com, speed, momentum, torque = _evaluate(model, q, v, middle, moving, bend, force)
    torque[impacts] = 0.0
    velocity, acceleration = twist_of(
        *(np.stack(each) for each in ((q, middle), (v, moving), (bend, bend)))
    )
    flights = [(float(times[f.start]), float(times[f.stop])) for f in problem.flights]
    return {
        "time": times,
        "position": pose_of(q),
        "velocity": velocity[0],
        "acceleration": acceleration[1],
        "contact_force": force.reshape(count, -1, 3),
        "contact": grounded,
        "phase": np.array([*phases, phases[-1]], dtype=np.int64),
        "joint_torque": torque,
        "com": com,
        "com_velocity": speed,
        "angular_momentum": momentum,
        "lift_off_time": flights[0][0],
        "touchdown_time": flights[0][1],
        "later_flights": tuple(flights[1:]),
    }


def _turn_forces(
    problem: FullProblem, problem_phase: ProblemPhase, force: Array, *, to_world: bool
) -> None:
    """Turn the forces in a phase (n, 3 n_contacts) from the axes of the ground that it stands on to the
    world's, or back, in place."""
    slope = problem.stances[problem_phase.place].slope
    if slope != LEVEL:
        axes = ground_axes(slope)
        for each in force:
            each[:] = (each.reshape(-1, 3) @ (axes.T if to_world else axes)).ravel()


def _middles_in_flight(
    problem: FullProblem, values: Array, steps: Array,
    q: Array, v: Array, middle: Array, moving: Array,
) -> None:  # fmt: skip
    """Compute the angles and rates of the base in the middle of intervals in flight; see ``exact_flight``."""
    coordinates, assembly = problem.coordinates, problem.assembly
    own = list(coordinates.turning)
    base = slice(3, 6)
    for flight in problem.flights:
        here, behind = slice(flight.start, flight.stop), slice(flight.start + 1, flight.stop + 1)
        rates = np.zeros((len(flight), coordinates.size))
        start = assembly.control_start[here, None] + coordinates.size
        rates[:, own] = values[start + np.arange(len(own))]
        moving[here, base] = (rates @ coordinates.matrix.T)[:, base]
        middle[here, base] = 0.5 * (q[here, base] + q[behind, base])
        middle[here, base] += 0.125 * steps[here, None] * (v[here, base] - v[behind, base])


def can_start(problem: FullProblem, plan: PlannedJump) -> bool:
    """Check whether a plan goes through the same phases, so that ``pack`` can make variables of it."""
    if _same_grid(problem, plan):
        return True
    impacts = bool(np.any(plan.steps <= 0.0)) or any(s.impact for s in problem.problem_phases)
    return not impacts and same_phases(
        plan.phase[:-1].tolist(), [int(phase) for phase in problem.phases]
    )


def _same_grid(problem: FullProblem, plan: PlannedJump) -> bool:
    """Check whether all intervals stand for the same; only then can there be impacts."""
    intervals = len(plan.time) == problem.knots
    impacts = {s.first for s in problem.problem_phases if s.impact}
    return (
        intervals
        and plan.phase[:-1].tolist() == [int(phase) for phase in problem.phases]
        and set(np.flatnonzero(plan.steps <= 0.0).tolist()) == impacts
    )


def pack(problem: FullProblem, plan: PlannedJump, guess: Array | None = None) -> Array:
    """Return variables near a plan of a task like this one.

    The plan may have other numbers of knots: it is followed phase by phase, and must go through
    the same phases. Only then the interval lengths of a ``guess`` are needed.
    """
    assembly, coordinates = problem.assembly, problem.coordinates
    n = coordinates.size
    q, v = coordinates_of(plan.position, plan.velocity)
    steps, force = plan.steps, plan.contact_force.reshape(len(plan.time), -1)
    instants = plan.time
    if not _same_grid(problem, plan):
        phases = [int(phase) for phase in problem.phases]
        lengths = np.diff(knot_times(problem, ballistic_guess(problem) if guess is None else guess))
        instants = matching_times(plan.time, plan.phase[:-1].tolist(), lengths, phases)
        q, v = states_at(instants, plan.time, q, v)
        force = means_over(instants, plan.time, force)
        steps = np.diff(instants)
    values = np.empty(assembly.variables)
    place, rate = coordinates.reduce(q), coordinates.reduce(v)
    force = force.copy()
    for problem_phase in problem.problem_phases:
        _turn_forces(
            problem, problem_phase, force[problem_phase.first : problem_phase.stop], to_world=False
        )
    pushes = coordinates.reduce_forces(force)
    own = np.arange(n)
    values[assembly.state_start[:, None] + own] = place
    values[assembly.state_start[:, None] + n + own] = rate
    turning = np.array(coordinates.turning, dtype=np.int64)
    before: int | None = None
    for problem_phase in problem.problem_phases:
        here = slice(problem_phase.first, problem_phase.stop)
        behind = slice(problem_phase.first + 1, problem_phase.stop + 1)
        control = assembly.control_start[here, None]
        step = 1.0 if problem_phase.impact else steps[here, None]
        values[control + own] = (rate[behind] - rate[here]) / step
        if problem_phase.flies:
            turned = (place[behind] - place[here]) / steps[here, None]
            rates = 1.5 * turned - 0.25 * (rate[here] + rate[behind])
            values[control + n + np.arange(len(turning))] = rates[:, turning]
        else:
            values[control + n + np.arange(coordinates.forces)] = pushes[here]
        mean = (
            float(instants[problem_phase.stop] - instants[problem_phase.first])
            / problem_phase.count
        )
        if problem_phase.timed:
            values[assembly.state_start[here] + 2 * n] = mean
        hold = None if before is None else assembly.knots[before].hold
        if before is not None and hold is not None:
            values[assembly.control_start[before] + hold] = mean
        before = problem_phase.stop - 1
    return values


_evaluators: dict[tuple[int, int], tuple[SymbolicModel, tuple[Lanes, ...]]] = {}
KEPT = 32
"""Evaluators that are kept, of a model and a number of instants, and functions of models."""


def _evaluate(
    model: SymbolicModel, q: Array, v: Array, middle: Array, moving: Array, bend: Array,
    force: Array,
) -> tuple[Array, Array, Array, Array]:  # fmt: skip
    """Return the centre of mass, its velocity and the angular momentum at the knots; joint torques in the middle of the
    intervals.
    """
    key, functions = (id(model), len(q)), _functions(model, force.shape[1])
    given = (q, v), (middle, moving, bend, force)
    if key not in _evaluators:
        if len(_evaluators) >= KEPT:
            _evaluators.clear()
        # CasADi's own call takes as long as ten of the lanes, but these are not made for one plan.
        _evaluators[key] = model, ()
        states, torques = (
            np.array(function.map(len(q))(*(array.T for array in arrays))).T.copy()
            for function, arrays in zip(functions, given, strict=True)
        )
    else:
        if not _evaluators[key][1]:
            made = tuple(interpreted(function).lanes(len(q)) for function in functions)
            _evaluators[key] = model, made
        for lanes, arrays in zip(_evaluators[key][1], given, strict=True):
            for own, values in zip(lanes.inputs, arrays, strict=True):
                own[:] = values
            lanes.run()
        states, torques = (lanes.outputs[0].copy() for lanes in _evaluators[key][1])
    return states[:, :3].copy(), states[:, 3:6].copy(), states[:, 6:].copy(), torques


_of_models: dict[int, tuple[SymbolicModel, Any, Any]] = {}


def _functions(model: SymbolicModel, pushed: int) -> tuple[Any, Any]:
    """Return the functions of one instant that ``_evaluate`` needs: of a state, and joint torques under ``pushed``
    forces.
    """
    import casadi as ca

    if id(model) not in _of_models:
        if len(_of_models) >= KEPT:
            _of_models.clear()
        place, rate, bend_of = (ca.SX.sym(name, model.size) for name in ("q", "v", "a"))
        pushes = ca.SX.sym("F", pushed)
        whole = centroidal_momentum(model, place, rate)
        named = {c.name: pushes[3 * i : 3 * i + 3] for i, c in enumerate(model.robot.contacts)}
        torque = model.inverse_dynamics(place, rate, bend_of, named)[2]
        of_state = ca.vertcat(whole.com, whole.linear / model.robot.total_mass, whole.angular)
        _of_models[id(model)] = (
            model,
            ca.Function("states", [place, rate], [ca.densify(of_state)], {"cse": True}),
            ca.Function(
                "torques", [place, rate, bend_of, pushes], [ca.densify(torque)], {"cse": True}
            ),
        )
    return _of_models[id(model)][1:]
