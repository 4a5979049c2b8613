"""The benchmark of solvers on the paper's planning problem."""

from __future__ import annotations

import pytest

from aloft.lab.benchmarks.planner import paper_solvers
from aloft.planner.problem.program import SimpleProblem
from aloft.planner.solving.paper_plan import paper_problem
from aloft.planner.solving.solver import solve
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot


@pytest.fixture(scope="module")
def problem() -> SimpleProblem:
    return paper_problem(make_task({**paper_solvers.TASK, "name": "jump"}), find_robot("bruce"))


@pytest.mark.long
def test_sequential_programming_finds_ipopts_plan_with_another_qp_solver(
    problem: SimpleProblem,
) -> None:
    ipopt = solve(problem, problem.guess, solver="ipopt", limit=500)
    found = paper_solvers.solve_by_sqp(problem, ipopt.values, "qrqp")
    assert ipopt.solved and found.solved
    assert found.cost == pytest.approx(ipopt.cost, rel=1e-5)


@pytest.mark.long
def test_what_gave_up_says_so_and_drake_may_be_missing(
    problem: SimpleProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(paper_solvers, "find_spec", lambda name: None)
    own = solve(problem, problem.guess, solver="ipopt", limit=500)
    stopped = solve(problem, problem.guess, solver="ipopt", limit=3)
    told = paper_solvers._row("IPOPT", "from the guess", stopped, own)
    assert told.note.endswith("no solution, so this is the time it took to give up")
    row = paper_solvers._snopt_row(problem, problem.guess, "from the guess", own, 1.0)
    assert row.value is None and row.note.startswith("Drake is not installed; pip install ")
