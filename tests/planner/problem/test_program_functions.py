"""The functions of a whole problem are the sums of its pieces, knot by knot, to the bit."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from aloft.mathematics.arrays import Array
from aloft.planner.problem.problem import FullProblem
from aloft.planner.problem.program_functions import program_functions
from aloft.planner.problem.program_values import ProgramValues
from aloft.planner.solving.solve import make_problem
from aloft.planner.task.task import Knots, make_task
from aloft.robots.description import find_robot

FACTOR = 0.7


@cache
def problem() -> FullProblem:
    robot = find_robot("bruce")
    task = make_task({"name": "near", "robot": "bruce", "rise": 0.1, "distance_x": 0.05})
    task = task.resolved(robot).model_copy(
        update={"knots": Knots(squat=4, thrust=5, flight=4, landing=4)}
    )
    return make_problem(task, robot)


def points() -> list[tuple[Array, Array]]:
    """Return variables and multipliers."""
    rng, assembly = np.random.default_rng(3), problem().assembly
    return [
        (rng.uniform(0.1, 0.5, assembly.variables), rng.normal(size=assembly.constraints))
        for _ in range(2)
    ]


def summed(x: Array, multipliers: Array) -> dict[str, Array]:
    """Return cost, rows and derivatives as they are written down, with dense matrices, knot after knot."""
    whole, parameters = problem().assembly, problem().parameters
    n, m = whole.variables, whole.constraints
    found = {
        "f": np.zeros(()), "g": np.zeros(m), "grad": np.zeros(n), "slope": np.zeros(n),
        "jac": np.zeros((m, n)), "hess": np.zeros((n, n)),
    }  # fmt: skip
    linear = np.zeros(m)
    for name, users in whole.users.items():
        piece, costs = whole.pieces[name], np.zeros(())
        for k, columns, rows in zip(
            users, whole.piece_columns[name], whole.piece_rows[name], strict=True
        ):
            start = whole.parameter_start[name, k]
            given = x[columns], parameters[start : start + piece.value.size1_in(1)]
            kept = rows >= 0
            own = np.where(kept, multipliers[rows], 0.0)
            cost, values = (np.array(each).ravel() for each in piece.value(*given))
            costs += cost[0]
            found["g"][rows[kept]] += values[kept]
            found["grad"][columns] += np.array(piece.gradient(*given)).ravel()
            found["jac"][np.ix_(rows[kept], columns)] += np.array(piece.jacobian(*given)[1])[kept]
            slope, bend = (np.array(each) for each in piece.hessian(*given, FACTOR, own))
            found["slope"][columns] += slope.ravel()
            found["hess"][np.ix_(columns, columns)] += bend
        found["f"] += costs
    for row, column, sign in zip(*whole.linear_terms, strict=True):
        linear[row] += sign * x[column]
        found["jac"][row, column] += sign
        found["slope"][column] += multipliers[row] * sign
    found["g"] += linear
    return found


def test_each_function_is_the_sum_of_the_pieces() -> None:
    functions = program_functions(problem().assembly)
    for x, multipliers in points():
        check(functions, x, multipliers)


def test_what_was_computed_elsewhere_or_for_another_problem_is_not_taken() -> None:
    functions, p = program_functions(problem().assembly), problem().parameters
    (x, multipliers), (elsewhere, _) = points()
    fresh = {name: functions[name](x, p) for name in ("nlp_f", "nlp_g")}
    for variables, parameters in ((elsewhere, p), (x, p + 1.0)):
        functions["nlp_g"](variables, parameters)
        functions["nlp_hess_l"](variables, parameters, FACTOR, multipliers)
        for name in ("nlp_f", "nlp_g"):
            assert np.any(np.array(functions[name](variables, parameters)) != np.array(fresh[name]))
            assert np.all(np.array(functions[name](x, p)) == np.array(fresh[name]))


def check(functions: dict[str, Any], x: Array, multipliers: Array) -> None:
    """Compare all functions with the sums."""
    p = problem().parameters
    rows, jacobian = functions["nlp_jac_g"](x, p)
    slope, hessian = functions["nlp_hess_l"](x, p, FACTOR, multipliers)
    cost, gradient = functions["grad_f"](x, p)
    ended = functions["nlp_grad"](x, p, FACTOR, multipliers)
    expected = summed(x, multipliers)
    same: dict[str, list[Any]] = {
        "f": [functions["nlp_f"](x, p), cost, ended[0]],
        "g": [functions["nlp_g"](x, p), rows, ended[1]],
        "grad": [functions["nlp_grad_f"](x, p), gradient],
        "jac": [jacobian],
        "slope": [slope],
        "hess": [hessian],
    }
    for name, values in same.items():
        for value in values:
            np.testing.assert_array_equal(
                np.array(value).reshape(expected[name].shape), expected[name]
            )
    triangle = np.array(functions["hess_lag"](x, p, FACTOR, multipliers))
    np.testing.assert_array_equal(triangle, np.triu(expected["hess"]))


def test_rows_come_before_their_jacobian_and_with_the_same_bits() -> None:
    own, theirs = ProgramValues(problem().assembly), program_functions(problem().assembly)
    for x, _ in points():
        own.evaluate(x, problem().parameters)
        own.differentiate()
        rows, jacobian = theirs["nlp_jac_g"](x, problem().parameters)
        np.testing.assert_array_equal(own.values, np.array(rows).ravel())
        np.testing.assert_array_equal(own.entries, np.array(jacobian.nonzeros()))
        assert jacobian.colind() == own.starts.tolist()
        assert jacobian.row() == own.rows.tolist()
