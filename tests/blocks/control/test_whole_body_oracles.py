"""The whole-body controller's own method against other solvers, on the states of whole jumps.

The reference is the active set that quadprog finds on the full program, in accelerations and forces,
with its optimality conditions solved again and their residuals taken in extended precision.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import quadprog

import aloft
from aloft.blocks.control.whole_body_controller import WholeBodyController
from aloft.blocks.control.whole_body_solver import ExternalSolver
from aloft.lab.benchmarks.full_program import FullProgram
from aloft.mathematics.active_set import INFEASIBLE
from aloft.mathematics.quadratic_program import QuadraticProgramSolver
from aloft.mathematics.whole_body_qp import SOLVED
from aloft.robots.description import find_robot

GRAPH = Path(aloft.__file__).parent / "graphs" / "jump.yaml"
ROBOT = find_robot("bruce")
ONE_FOOT = np.array([True, True, False, False])
ONE_POINT = np.array([False, False, False, True])
JUMPS = {
    "as shipped": {},
    "slipping": {"robot.ground.friction": 0.35, "wbc.friction": 0.1},
    "torque-limited": {"wbc.torque_margin": 0.35},
    "another seed": {"robot.seed": 7001},
}


class State(NamedTuple):
    """What the controller had in a tick: the tasks' rows, the model, and the points in stance."""

    rows: tuple
    model: tuple
    stance: np.ndarray
    velocity: np.ndarray


def states_of_a_jump(monkeypatch, overrides, *, duration, every):
    """The controller of a jump, and its states in ticks with at least one point in stance."""
    found, blocks, step = [], [], WholeBodyController.step

    def recording(self):
        step(self)
        if self.phase.stance.any() and self.tick % every == 0:
            blocks[:] = [self]
            found.append(
                State(
                    tuple(array.copy() for array in self._rows),
                    tuple(array.copy() for array in self._model),
                    self.phase.stance.copy(),
                    self.joints.velocity.copy(),
                )
            )

    with monkeypatch.context() as patch:
        patch.setattr(WholeBodyController, "step", recording)
        aloft.load(GRAPH, overrides).run(duration=duration, fuse=False)
    return blocks[0], found


def write(array, values):
    """Write into the memory of an input, which is read-only for the block itself."""
    array.setflags(write=True)
    array[...] = values


class Solvers:
    """All solvers on one state at a time, in the memory of the controller of a jump that is over."""

    def __init__(self, block: WholeBodyController) -> None:
        self.block, self.full = block, FullProgram(block)
        self.daqp, self.clarabel = map(QuadraticProgramSolver, ("daqp", "clarabel"))
        program, reduction, *_, solution = block._solve.arguments
        self.reduced = ExternalSolver("daqp", "pyramid", program, reduction, solution)

    def set(self, state: State, stance: np.ndarray) -> None:
        block = self.block
        for into, values in ((block._rows, state.rows), (block._model, state.model)):
            for array, value in zip(into, values, strict=True):
                write(array, value)
        write(block.phase.stance, stance)
        write(block.joints.velocity, state.velocity)
        self.full.limit.run()
        self.active = np.flatnonzero(stance)
        self.program = self.full.assemble(self.active)

    def own(self):
        """The code and the torque of the controller's own method."""
        self.block._reduce.run()
        self.block._solve.run()
        return int(self.block._code[0]), self.block.command.torque.copy()

    def torque(self, x):
        """The joint torque of a solution of the full program."""
        return self.full.torque(x, self.active)

    def by_daqp(self):
        """The torque by DAQP on the reduced program; none if it finds no solution."""
        self.block._reduce.run()
        self.reduced.solve()
        solved = int(self.block._code[0]) == SOLVED
        return self.block.command.torque.copy() if solved else None

    def by(self, solver):
        program = self.program
        return solver.solve(
            program.cost.hessian, program.cost.gradient, program.inequality.matrix,
            program.inequality.bound, program.equality.matrix, program.equality.bound,
        )  # fmt: skip

    def cost(self, x):
        program = self.program
        return 0.5 * x @ program.cost.hessian @ x + program.cost.gradient @ x

    def reference(self):
        """The optimum, or ``None`` where there is none."""
        p, q = self.program.cost
        a, b = self.program.equality
        g, h = self.program.inequality
        normals = np.vstack([a, -g])
        try:
            answer = quadprog.solve_qp(p, -q, normals.T.copy(), np.concatenate([b, -h]), len(b))
        except ValueError:
            return None
        active = answer[5][answer[5] > 0] - 1
        active = np.union1d(np.arange(len(b)), active)
        rows, bound = normals[active], np.concatenate([b, -h])[active]
        n, m = len(q), len(active)
        matrix = np.zeros((n + m, n + m))
        matrix[:n, :n], matrix[:n, n:], matrix[n:, :n] = p, -rows.T, rows
        right = np.concatenate([-q, bound])
        exact, solution = matrix.astype(np.longdouble), np.zeros(n + m, np.longdouble)
        for _ in range(4):
            solution = solution + np.linalg.solve(matrix, (right - exact @ solution).astype(float))
        x, multipliers = solution[:n].astype(float), solution[n + len(b) :]
        size = 1.0 + np.abs(q).max()
        assert np.abs((right - exact @ solution).astype(float)).max() < 1e-9 * size
        assert (g @ x - h).max() < 1e-7
        assert float(multipliers.min(initial=0.0)) > -1e-9 * size
        return x


def compare(solvers, states, turns):
    """Solve every state; returns how many programs, how many without solution, and errors.

    Every third state is that of one foot, and every fifth that of one point.
    """
    errors, infeasible, gaps = [], 0, []
    for k, state in enumerate(states):
        stance = state.stance
        if turns and k % 3 == 0:
            stance = ONE_FOOT
        elif turns and k % 5 == 0:
            stance = ONE_POINT
        solvers.set(state, stance)
        code, torque = solvers.own()
        x = solvers.reference()
        if x is None:
            assert code == INFEASIBLE
            assert solvers.by_daqp() is None  # so that nothing is lost without another solver
            infeasible += 1
            continue
        assert code == SOLVED
        best = solvers.torque(x)
        daqp, reduced = solvers.by(solvers.daqp), solvers.by_daqp()
        assert daqp is not None and reduced is not None
        found = torque, solvers.torque(daqp), reduced
        errors.append([np.abs(each - best).max() for each in found])
        if k % 10 == 0:
            other, cost = solvers.by(solvers.clarabel), solvers.cost(x)
            gaps.append(abs(solvers.cost(other) - cost) / (1.0 + abs(cost)))
    return len(states), infeasible, np.array(errors).max(axis=0), max(gaps)


def check(monkeypatch, jumps, *, duration, every):
    total = 0
    for overrides in jumps:
        block, states = states_of_a_jump(monkeypatch, overrides, duration=duration, every=every)
        assert block._solve.compiled is not None
        for turns in (False, True):
            count, infeasible, (own, daqp, reduced), gap = compare(Solvers(block), states, turns)
            assert infeasible == 0
            assert max(own, daqp, reduced) < 1e-6, (overrides, own, daqp, reduced)
            assert gap < 1e-6, (overrides, gap)
        total += count
    return total


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:Converted matrix")
def test_the_solvers_agree_on_states_of_a_jump(monkeypatch):
    assert check(monkeypatch, [JUMPS["torque-limited"]], duration=0.9, every=5) > 50


@pytest.mark.long
@pytest.mark.filterwarnings("ignore:Converted matrix")
def test_the_solvers_agree_on_the_states_of_four_jumps(monkeypatch):
    assert check(monkeypatch, JUMPS.values(), duration=None, every=8) > 550
