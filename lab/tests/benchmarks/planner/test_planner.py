"""The planner's solvers side by side: the same problem and, with Drake, the same optimum."""

from __future__ import annotations

import builtins
from typing import Any

import pytest

from aloft.lab.benchmarks.planner.planner import INSTALL, SNOPT, SNOPT_GOAL, solver_rows
from aloft.lab.benchmarks.planner.snopt import SnoptProgram
from aloft.planner.problem.guess import ballistic_guess
from aloft.planner.solving.solve import make_problem
from aloft.planner.solving.solver import solve
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

JUMP: dict[str, Any] = {
    "rise": 0.1,
    "knots": {"squat": 4, "thrust": 8, "flight": 12, "landing": 7},
}


def test_without_drake_the_rows_say_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def missing(name: str, *args: Any, **others: Any) -> Any:
        if name.startswith("pydrake"):
            raise ImportError(name)
        return real(name, *args, **others)

    monkeypatch.setattr(builtins, "__import__", missing)
    ipopt, *peers = solver_rows({"low": JUMP}, rounds=1)
    assert ipopt.peer == "IPOPT"
    assert ipopt.ratio is not None and ipopt.ratio > 0.0
    assert [(row.peer, row.value, row.goal, row.note) for row in peers] == [
        (SNOPT, None, SNOPT_GOAL, INSTALL)
    ] * 2


def test_snopt_confirms_the_optimum_of_the_same_problem() -> None:
    pytest.importorskip("pydrake")
    problem = make_problem(
        make_task({"recipe": "paper", "name": "low", **JUMP}), find_robot("bruce")
    )
    own = solve(problem, ballistic_guess(problem))
    found = SnoptProgram(problem).solve(own.values, time_limit=30.0)
    assert found.solved
    assert found.cost == pytest.approx(own.cost, rel=1e-4)
    assert found.violation < 1e-4
    assert 0.0 < found.callback_cpu < found.cpu
