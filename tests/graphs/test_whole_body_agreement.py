"""The whole-body controller's own method against a polished reference, on states of whole jumps.

The reference solves the whole program in accelerations and forces with DAQP, takes its active
constraints, and solves the conditions of optimality for them with residuals in long double.
"""

from pathlib import Path

import daqp
import numpy as np
import pytest

import aloft
from aloft.blocks.control.whole_body_controller import WholeBodyController
from aloft.lab.benchmarks.full_program import FullProgram
from aloft.mathematics.whole_body_qp import SOLVED
from aloft.runtime.running.executor import Executor
from aloft.runtime.running.memory import BoundGraph

GRAPHS = Path(__file__).parents[2] / "graphs"


def polished(program):
    """The minimiser, and whether it fulfils all conditions."""
    cost, equal, limits = program.cost, program.equality, program.inequality
    m, rows = len(equal.bound), np.vstack([equal.matrix, program.inequality.matrix])
    upper = np.concatenate([equal.bound, limits.bound])
    lower = np.concatenate([equal.bound, np.full(len(limits.bound), -1e30)])
    sense = np.concatenate([np.full(m, 5), np.zeros(len(limits.bound))]).astype(np.int32)
    _, _, flag, about = daqp.solve(
        cost.hessian.copy(), cost.gradient.copy(), rows, upper, lower, sense, primal_tol=1e-9
    )
    assert flag > 0
    active = np.concatenate([np.ones(m, bool), about["lam"][m:] > 1e-9])
    normals, n = rows[active].astype(np.longdouble), len(cost.gradient)
    size = n + len(normals)
    system = np.zeros((size, size), np.longdouble)
    system[:n, :n], system[:n, n:], system[n:, :n] = cost.hessian, normals.T, normals
    right = np.concatenate([-cost.gradient, upper[active]]).astype(np.longdouble)
    answer, rough = np.zeros(size, np.longdouble), system.astype(float)
    for _ in range(12):
        answer += np.linalg.solve(rough, (right - system @ answer).astype(float))
    x = answer[:n].astype(float)
    feasible = (limits.matrix @ x - limits.bound).max(initial=-1.0) < 1e-8
    return x, feasible and answer[n + m :].min(initial=0.0) > -1e-7


class Watch:
    """Compares after every step, and counts."""

    def __init__(self, block, every):
        self.full = FullProgram(block)
        self.block, self.every, self.step = block, every, block.step
        self.errors, self.limited, self.stances, self.ticks = [], 0, {}, 0

    def __call__(self):
        self.step()
        block = self.block
        self.ticks += 1
        active = np.flatnonzero(block.phase.stance)
        if not len(active) or self.ticks % self.every:
            return
        assert int(block._code[0]) == SOLVED
        program = self.full.assemble(active)
        x, optimal = polished(program)
        assert optimal
        n = len(block.command.acceleration)
        force = np.zeros_like(block.command.force)
        force[active] = x[n:].reshape(-1, 3)
        terms = block.terms
        torque = terms.mass_matrix[6:] @ x[:n] + terms.nonlinear_effects[6:]
        torque -= np.einsum("ikn,ik->n", terms.contact_jacobian[:, :, 6:], force)
        self.errors.append(float(np.abs(block.command.torque - torque).max()))
        slack = program.limits.bound - program.limits.matrix @ x
        self.limited += bool(slack.min() < 1e-6)
        self.stances[len(active)] = self.stances.get(len(active), 0) + 1


def compare(name, overrides=(), every=1, duration=None):
    graph = aloft.load(GRAPHS / f"{name}.yaml", overrides)
    bound = BoundGraph(graph.checked)
    (block,) = (b for b in bound.blocks.values() if isinstance(b, WholeBodyController))
    watch = Watch(block, every)
    block.step = watch
    ticks = None if duration is None else round(duration * graph.checked.base_rate)
    Executor(bound, log=False, fuse=False).run(ticks)  # so that the step can be watched
    return watch


def test_it_agrees_while_standing():
    watch = compare("jump", duration=0.04)
    assert len(watch.errors) == 20
    assert max(watch.errors) < 1e-9


@pytest.mark.long
def test_it_agrees_on_hundreds_of_states_of_jumps():
    watches = [
        compare("up_5cm", every=4),
        compare("push", every=4),
        compare("somersault", {"wbc.torque_margin": 0.8}, every=4),
    ]
    errors = np.concatenate([watch.errors for watch in watches])
    assert len(errors) > 700
    assert errors.max() < 1e-6
    assert sum(watch.limited for watch in watches) > 10
    stances = {count for watch in watches for count in watch.stances}
    assert {2, 4} <= stances
