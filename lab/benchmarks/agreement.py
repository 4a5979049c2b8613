"""Agreement of the methods for the whole-body program, on states of recorded jumps and on random
ones.

Every program is solved by the own method with pyramids and with round cones, by DAQP and by Clarabel,
and their torques are compared with a minimum that is proved: its conditions of optimality hold in
extended precision. A solver only proposes which constraints are active. Newton's method solves the
conditions of optimality for these, with residuals in extended precision; then all conditions are
checked. A convex program has one minimum where they hold, so it does not matter who has proposed it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...blocks.control.whole_body_controller import WholeBodyController
from ...mathematics.active_set import INFEASIBLE
from ...mathematics.arrays import Array, Flags, Indices
from ...mathematics.compiling.compile_calls import compile_calls
from ...mathematics.compiling.kernel_call import KernelCall
from ...mathematics.quadratic_program import SOLVED as CLARABEL_SOLVED
from ...mathematics.quadratic_program import Clarabel, cone_rows
from ...mathematics.whole_body_cones import PLANES, cone_memory, solve_with_cones
from ...mathematics.whole_body_qp import (
    SOLVED,
    RigidBodyTerms,
    TaskRows,
    WholeBodySolution,
)
from ...mathematics.whole_body_reduction import reduce_program, reduction_memory
from ...mathematics.whole_body_solution import active_set_program, solve_with_pyramids
from ...runtime.graph import load
from ...runtime.loading.reading.files import FOLDER
from ...runtime.running.executor import Executor
from ...runtime.running.memory import BoundGraph
from .full_program import FullMatrices, FullProgram, rows_without_pyramids
from .rows import Row

Long = NDArray[np.longdouble]

NEWTON_STEPS = 12
FEASIBLE = 1e-8
"""Largest violation of a constraint [N, N m] and most negative multiplier accepted, times ``size``.
"""
INSIDE, EDGE, APEX = 0, 1, 2
"""Position of a contact force in its friction cone: inside, on its edge, or at its apex."""


class Proposal(NamedTuple):
    """A candidate for the minimum: a solution x, the active inequalities, and the position of each
    force in its cone. Without ``places`` friction is among the inequalities."""

    x: Array
    active: Flags
    places: Indices


def proved_minimum(program: FullMatrices, proposal: Proposal, friction: float) -> Array | None:
    """Prove the proposal and return the minimiser, or ``None`` if the proposal is not right.

    Args:
        friction: of the round cones, if the proposal has any.
    """
    (p, q), (a, b), (g, h) = program.cost, program.equality, program.inequality
    places, n = proposal.places, len(q)
    if len(places):
        kept = rows_without_pyramids(len(places), len(h))
        g, h = g[kept], h[kept]
    first = n - 3 * len(places)
    held = [first + 3 * j + k for j in np.flatnonzero(places == APEX) for k in range(3)]
    edges = [first + 3 * int(j) for j in np.flatnonzero(places == EDGE)]
    lines = np.vstack((a, g[proposal.active], np.eye(n)[held])).astype(np.longdouble)
    right = np.hstack((b, h[proposal.active], np.zeros(len(held)))).astype(np.longdouble)
    m, k = len(lines), len(edges)
    hessian, gradient = p.astype(np.longdouble), q.astype(np.longdouble)
    x, y, v = (
        proposal.x.astype(np.longdouble),
        np.zeros(m, np.longdouble),
        np.zeros(k, np.longdouble),
    )
    for step in range(NEWTON_STEPS):
        normals, bends = _normals(x, edges, friction, v)
        matrix = np.zeros((n + m + k, n + m + k))
        matrix[:n, :n] = p + bends
        sides = np.vstack((lines.astype(np.float64), normals.astype(np.float64)))
        matrix[:n, n:], matrix[n:, :n] = sides.T, sides
        outside = np.array(
            [np.hypot(x[i], x[i + 1]) - np.longdouble(friction) * x[i + 2] for i in edges],
            np.longdouble,
        )
        residual = np.hstack(
            (hessian @ x + gradient + lines.T @ y + normals.T @ v, lines @ x - right, outside)
        )
        try:
            change = np.linalg.solve(matrix, residual.astype(np.float64))
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(change).all():
            return None
        x, y, v = x - change[:n], y - change[n : n + m], v - change[n + m :]
        if step > 2 and np.abs(change[:n]).max() < 1e-13 * (1.0 + float(np.abs(x).max())):
            break
    size = 1.0 + float(np.abs(q).max())
    prices = y[len(b) : len(b) + int(proposal.active.sum())].astype(np.float64)
    answer = x.astype(np.float64)
    normals, _ = _normals(x, edges, friction, v)
    slope = hessian @ x + gradient + lines.T @ y + normals.T @ v
    fine = (
        float(np.abs(slope).max()) < 1e-9 * size
        and float((g @ answer - h).max(initial=-1.0)) < FEASIBLE
        and float(prices.min(initial=0.0)) > -FEASIBLE * size
        and float(v.min(initial=0.0)) > -FEASIBLE * size
        and all(
            np.hypot(*answer[i : i + 2]) - friction * answer[i + 2] < FEASIBLE
            for i in range(first, n, 3)
            if len(places)
        )
    )
    pushes = y[m - len(held) :].astype(np.float64).reshape(-1, 3)
    fine = fine and all(friction * np.hypot(s[0], s[1]) + s[2] < FEASIBLE * size for s in pushes)
    return answer if fine else None


def _normals(x: Long, edges: list[int], friction: float, multipliers: Long) -> tuple[Long, Array]:
    """Return the gradients of |f_t| - mu f_z of the forces at their cones' edges, and their
    curvature."""
    normals, bends = np.zeros((len(edges), len(x)), np.longdouble), np.zeros((len(x), len(x)))
    for row, i in enumerate(edges):
        size = np.hypot(x[i], x[i + 1])
        u = x[i : i + 2] / size if size > 0.0 else np.zeros(2, np.longdouble)
        normals[row, i : i + 2], normals[row, i + 2] = u, -friction
        across = np.array([-u[1], u[0]], np.float64)
        share = float(multipliers[row] / size) if size > 0.0 else 0.0
        bends[i : i + 2, i : i + 2] = share * np.outer(across, across)
    return normals, bends


GRAPH = FOLDER / "jump.yaml"
SEED = 7001
"""The seed of the recorded jumps; the next ones follow it."""
JUMPS: dict[str, dict[str, Any]] = {
    "as shipped": {},
    "slipping": {"robot.ground.friction": 0.35, "wbc.friction": 0.1},
    "torque-limited": {"wbc.torque_margin": 0.35},
    "turning": {"plan.task": "tasks/twist_30deg.yaml"},
    "aside": {"plan.task": "tasks/side_10cm.yaml"},
}
"""The jumps whose states are used, and what differs from ``graphs/jump.yaml``."""
STANCES = (None, (True, True, False, False), (False, False, False, True))
"""Points in stance that each state is solved with: the recorded ones, one foot, and one point."""


class SolvedState(NamedTuple):
    """The controller's inputs in a tick, and the values that may differ from its parameters.

    ``peak`` (n_joints,) are the motors' peak torques [N m], ``friction``, ``force_min`` and ``force_max`` [N] the
    limits of the forces.
    """

    rows: TaskRows
    model: RigidBodyTerms
    stance: Flags
    velocity: Array
    peak: Array
    friction: float
    force_min: float
    force_max: float


def recorded_states(
    overrides: dict[str, Any], duration: float | None = None, every: int = 1
) -> tuple[WholeBodyController, list[SolvedState]]:
    """Run a jump and return its controller, and its states in ticks with a point in stance.

    Raises:
        RunError: the jump failed.
    """
    graph = load(GRAPH, overrides).checked
    bound = BoundGraph(graph)
    (block,) = (b for b in bound.blocks.values() if isinstance(b, WholeBodyController))
    found: list[SolvedState] = []
    step: Callable[[], None] = block.step

    def watched() -> None:
        step()
        if block.phase.stance.any() and bound.clock.tick % every == 0:
            found.append(present_state(block))

    block.step = watched  # type: ignore[method-assign]  # a recorder in its place
    ticks = None if duration is None else round(duration * graph.base_rate)
    Executor(bound, log=False, fuse=False).run(ticks).raise_if_failed()
    return block, found


def present_state(block: WholeBodyController) -> SolvedState:
    """Return the state that a controller has now."""
    w = block._weights
    return SolvedState(
        TaskRows(*(array.copy() for array in block._rows)),
        RigidBodyTerms(*(array.copy() for array in block._model)),
        block.phase.stance.copy(),
        block.joints.velocity.copy(),
        block._motors.peak.copy(),
        float(w.friction[0]),
        float(w.force_min[0]),
        float(w.force_max[0]),
    )


def show_state(block: WholeBodyController, state: SolvedState) -> None:
    """Write a state into the memory of a controller whose graph does not run."""
    pairs: list[tuple[Array, Any]] = [
        *zip(block._rows, state.rows, strict=True),
        *zip(block._model, state.model, strict=True),
        (block.phase.stance, state.stance),
        (block.joints.velocity, state.velocity),
        (block._motors.peak, state.peak),
        (block._weights.friction, state.friction),
        (block._weights.force_min, state.force_min),
        (block._weights.force_max, state.force_max),
    ]
    for array, values in pairs:
        array.setflags(write=True)  # inputs are read-only for the block itself
        array[...] = values


def random_states(states: list[SolvedState], count: int, seed: int) -> Iterator[SolvedState]:
    """Yield ``count`` programs made from recorded ones: other points in stance, tasks that ask for
    up to ten times as much with other weights, other speeds, friction and limits.

    One in fifty has no solution: its forces must be larger than they may be. Otherwise there is always one,
    because tasks are no constraints.
    """
    random = np.random.default_rng(seed)
    for _ in range(count):
        state = states[int(random.integers(len(states)))]
        stance = random.random(len(state.stance)) < 0.6
        stance[random.integers(len(stance))] = True
        rows = TaskRows(*(array.copy() for array in state.rows))
        size = 10.0 ** random.uniform(-1.0, 1.0)
        rows.desired[:] += (
            size * np.abs(rows.desired).mean() * random.standard_normal(len(rows.desired))
        )
        rows.weights[:] *= 10.0 ** random.uniform(-1.0, 1.0, len(rows.weights))
        least = float(random.choice([0.0, 0.0, 0.0, 1.0, 10.0, 60.0]))
        yield SolvedState(
            rows,
            state.model,
            stance,
            state.velocity + random.normal(0.0, 3.0, len(state.velocity)),
            state.peak * random.uniform(0.15, 1.0),
            random.uniform(0.1, 1.0),
            least,
            least + (float(random.uniform(20.0, 400.0)) if random.random() > 0.02 else -1.0),
        )


OWN, DAQP, CONES, CLARABEL = (
    "own method",
    "DAQP",
    "own method, round cones",
    "Clarabel, round cones",
)
TORQUE_ERROR = 1e-6
"""Largest accepted torque error against the proved minimum [N m]."""
LARGE = 10.0
"""Torques larger than this [N m] may have that error as a share of themselves in units of it."""
CLARABEL_TOLERANCE = 1e-12
"""Tolerance of Clarabel's gaps: tight enough for its slacks and multipliers to tell the active set.
"""
NO_PLACES = np.zeros(0, np.int64)
STATES = 5_000
"""Least number of states of recorded jumps."""


def agreement(count: int = 50_000, seed: int = 1, states: int = STATES) -> list[Row]:
    """Compare the methods and return a row for each of their errors and counts.

    Args:
        count: of random programs.
        seed: of these.
        states: how many states of recorded jumps there must be.

    Raises:
        AssertionError: the jumps have fewer states than that.
    """
    found: list[SolvedState] = []
    block: WholeBodyController | None = None
    for number, overrides in enumerate(JUMPS.values()):
        if block is None or len(found) < states:
            block, more = recorded_states({"robot.seed": SEED + number, **overrides})
            found += more
    assert block is not None
    if len(found) < states:
        raise AssertionError(f"the jumps have {len(found)} states, not {states}")
    methods = Methods(block)
    recorded = methods.compare(_stances(found))
    drawn = methods.compare(random_states(found, count, seed))
    return [*recorded.rows("recorded states"), *drawn.rows(f"random programs of seed {seed}")]


def _stances(states: Iterable[SolvedState]) -> Iterable[SolvedState]:
    """Yield the states with the recorded points in stance; every third on one foot and every fifth
    on one point as well."""
    for number, state in enumerate(states):
        yield state
        for every, stance in zip((3, 5), STANCES[1:], strict=True):
            if number % every == 0:
                yield state._replace(stance=np.array(stance))


@dataclass
class Agreement:
    """The results of a set of programs.

    ``errors`` [N m] by method; ``by_own`` counts the minima that only the own method has proposed,
    ``unsolved`` programs with a proved minimum for which a method had none, ``impossible`` those for which every method says that there is none, ``unproved`` those left.
    """

    programs: int = 0
    limited: int = 0
    errors: dict[str, list[float]] = field(default_factory=dict)
    unsolved: dict[str, int] = field(default_factory=dict)
    impossible: dict[str, int] = field(default_factory=dict)
    unproved: dict[str, int] = field(default_factory=dict)
    by_own: dict[str, int] = field(default_factory=dict)

    def rows(self, what: str) -> list[Row]:
        """Return the rows of these programs."""
        rows = [
            Row(
                f"{what}",
                float(self.programs),
                "",
                note=f"{self.limited} with a torque at its limit",
            )
        ]
        for name, errors in self.errors.items():
            kind = "round" if name in (CONES, CLARABEL) else "pyramids"
            parts = [
                f"median {np.median(errors):.1g}, {len(errors)} programs",
                f"{self.impossible.get(kind, 0)} without a solution, which the method says",
            ]
            if self.by_own.get(kind):
                parts.append(f"{self.by_own[kind]} of the minima proposed by the own method only")
            if self.unproved.get(kind):
                parts.append(f"{self.unproved[kind]} left out: no proof")
            note = "; ".join(parts)
            goal = None if name == CLARABEL else TORQUE_ERROR
            rows.append(
                Row(f"{what}: {name}, largest error", max(errors), "N m", goal=goal, note=note)
            )
            unsolved = float(self.unsolved.get(name, 0))
            rows.append(
                Row(
                    f"{what}: {name}, not solved",
                    unsolved,
                    "",
                    goal=None if name == CLARABEL else 0.0,
                )
            )
        return rows


class Methods:
    """All methods on one program at a time, in the memory of a controller whose graph does not run."""

    def __init__(self, block: WholeBodyController) -> None:
        self._block = block
        n, contacts = len(block.command.acceleration), len(block.command.force)
        self._n = n
        self._solution = WholeBodySolution(
            np.zeros(n - 6), np.zeros(n), np.zeros((contacts, 3)), np.zeros(1, np.int64)
        )
        self.full, program = FullProgram(block), block._program
        reduction = reduction_memory(n, contacts)
        self._active_set = active_set_program(n, contacts)
        planes = active_set_program(n, contacts, PLANES)
        self._reduce = KernelCall(reduce_program, program, reduction, self._solution)
        self._own = KernelCall(
            solve_with_pyramids, program, reduction, self._active_set, self._solution
        )
        self._cones = KernelCall(
            solve_with_cones, program, reduction, cone_memory(contacts), planes, self._solution
        )
        refused = compile_calls([self.full.limit, self._reduce, self._own, self._cones])
        if refused:
            raise AssertionError(f"the kernels are not compiled: {refused}")
        self._clarabel = Clarabel(CLARABEL_TOLERANCE)
        self._coarser = Clarabel()

    def solve(self, call: KernelCall) -> None:
        """Reduce the present program and solve it by ``_own`` or ``_cones``."""
        self._reduce.run()
        call.run()

    def compare(self, states: Iterable[SolvedState]) -> Agreement:
        """Solve all programs."""
        found = Agreement()
        for state in states:
            show_state(self._block, state)
            self.full.limit.run()
            active = np.flatnonzero(state.stance)
            program = self.full.assemble(active)
            found.programs += 1
            self._pyramids(found, program, active)
            self._round(found, program, active, state.friction)
        return found

    def _pyramids(self, found: Agreement, program: FullMatrices, active: Indices) -> None:
        self.solve(self._own)
        code, own = int(self._solution.code[0]), self._solution.torque.copy()
        guess = np.hstack((self._solution.acceleration, self._solution.force[active].ravel()))
        x, pressed = _by_daqp(program)
        best = None
        if x is not None:
            best = proved_minimum(program, Proposal(x, pressed, NO_PLACES), 0.0)
        if best is None and code == SOLVED:
            held = self._active_set.memory.is_active[: len(pressed)].copy()
            best = proved_minimum(program, Proposal(guess, held, NO_PLACES), 0.0)
            found.by_own["pyramids"] = found.by_own.get("pyramids", 0) + (best is not None)
        if best is None:
            nothing = x is None and code == INFEASIBLE
            counts = found.impossible if nothing else found.unproved
            counts["pyramids"] = counts.get("pyramids", 0) + 1
            return
        torque = self.full.torque(best, active)
        slack = program.limits.bound - program.limits.matrix @ best
        found.limited += bool(slack.min(initial=1.0) < 1e-6)
        self._note(found, OWN, own if code == SOLVED else None, torque)
        self._note(found, DAQP, None if x is None else self.full.torque(x, active), torque)

    def _round(
        self, found: Agreement, program: FullMatrices, active: Indices, friction: float
    ) -> None:
        self.solve(self._cones)
        code, own = int(self._solution.code[0]), self._solution.torque.copy()
        guess = np.hstack((self._solution.acceleration, self._solution.force[active].ravel()))
        (p, q), (a, b), (g, h) = program.cost, program.equality, program.inequality
        kept = rows_without_pyramids(len(active), len(h))
        cones = cone_rows(len(active), len(q), self._n, friction)
        problem = p, q, g[kept], h[kept], a, b, cones
        answer = self._clarabel.answer(*problem)
        solved = str(answer.status) in CLARABEL_SOLVED
        best = None
        for solver in (self._clarabel, self._coarser):
            if solved and best is None:
                again = answer if solver is self._clarabel else solver.answer(*problem)
                proposal = self._from_clarabel(again, len(b), len(active))
                best = proved_minimum(program, proposal, friction)
        if best is None and code == SOLVED:
            best = self._from_cones(program, guess, friction, len(active))
            found.by_own["round"] = found.by_own.get("round", 0) + (best is not None)
        if best is None:
            nothing = not solved and code == INFEASIBLE
            counts = found.impossible if nothing else found.unproved
            counts["round"] = counts.get("round", 0) + 1
            return
        torque = self.full.torque(best, active)
        self._note(found, CONES, own if code == SOLVED else None, torque)
        other = self.full.torque(np.asarray(answer.x), active) if solved else None
        self._note(found, CLARABEL, other, torque)

    @staticmethod
    def _from_clarabel(answer: object, equations: int, count: int) -> Proposal:
        """Read a proposal from Clarabel's slacks and multipliers: the larger of each pair is the
        one that is not zero."""
        x, s, z = (np.asarray(getattr(answer, name)) for name in ("x", "s", "z"))
        places = np.zeros(count, np.int64)
        for point in range(count):
            first = len(s) - 3 * (count - point)
            slack, price = s[first : first + 3], z[first : first + 3]
            inside = slack[0] - np.hypot(slack[1], slack[2])
            pressed = price[0] - np.hypot(price[1], price[2])
            places[point] = EDGE
            if price[0] < inside:
                places[point] = INSIDE
            elif slack[0] < pressed:
                places[point] = APEX
        active = s[equations : len(s) - 3 * count] < z[equations : len(s) - 3 * count]
        for apex in np.flatnonzero(places == APEX):
            active[2 * apex : 2 * apex + 2] = False  # the apex says more than its normal force
        return Proposal(x, active, places)

    @staticmethod
    def _from_cones(program: FullMatrices, x: Array, friction: float, count: int) -> Array | None:
        """Return the minimum that the own method proposes."""
        kept = rows_without_pyramids(count, len(program.inequality.bound))
        g, h = program.inequality.matrix[kept], program.inequality.bound[kept]
        forces = x[len(x) - 3 * count :].reshape(-1, 3)
        size = np.hypot(forces[:, 0], forces[:, 1])
        on_edge = size - friction * forces[:, 2] > -1e-9 * (1.0 + size)
        places = np.where(on_edge, np.where(size > 1e-6, EDGE, APEX), INSIDE)
        tight = h - g @ x < 1e-8
        for point in np.flatnonzero(places == APEX):
            tight[2 * point : 2 * point + 2] = False
        return proved_minimum(program, Proposal(x, tight, places), friction)

    @staticmethod
    def _note(found: Agreement, name: str, torque: Array | None, best: Array) -> None:
        if torque is None:
            found.unsolved[name] = found.unsolved.get(name, 0) + 1
            found.errors.setdefault(name, [])
            return
        scale = max(1.0, float(np.abs(best).max()) / LARGE)
        found.errors.setdefault(name, []).append(float(np.abs(torque - best).max()) / scale)


def _by_daqp(program: FullMatrices) -> tuple[Array | None, Flags]:
    """Solve with DAQP and return the solution, and the inequalities that it says are active."""
    import daqp

    cost, equality, inequality = program.cost, program.equality, program.inequality
    matrix = np.vstack((equality.matrix, inequality.matrix))
    upper = np.hstack((equality.bound, inequality.bound))
    lower = np.hstack((equality.bound, np.full(len(inequality.bound), -1e30)))
    sense = np.zeros(len(upper), np.int32)
    sense[: len(equality.bound)] = 5
    x, _, flag, about = daqp.solve(cost.hessian, cost.gradient, matrix, upper, lower, sense)
    pressed = np.asarray(about["lam"])[len(equality.bound) :] > 1e-9
    return (np.array(x) if flag > 0 else None), pressed
