"""Derivatives by way of lifted expressions are those of the whole.

A flight's interval is exact: momentum to rounding, attitude to fourth order.
"""

from functools import lru_cache

import casadi as ca
import numpy as np
import pytest

from aloft.planner.checking.validity import check_plan
from aloft.planner.models.euler_angles import pose_of, twist_of
from aloft.planner.models.exact_dynamics import ExactDynamics
from aloft.planner.models.robot_model import model_of
from aloft.planner.models.symbolic_model import SymbolicModel, centroidal_momentum
from aloft.planner.problem.stage_functions import (
    IntermediateExpressions,
    flight_interval,
    make_coordinates,
)
from aloft.planner.solving.solve import solve_jump
from aloft.planner.task.task import make_task
from aloft.robots.description import find_robot

Z = ca.SX.sym("z", 3)
LIFTED = ca.vertcat(Z[0] * Z[1], Z[2] ** 2 + Z[0])


def value(inner: ca.SX) -> ca.SX:
    return ca.sin(inner[0]) * inner[1] ** 2 + Z[1] * inner[0] + ca.exp(Z[0])


def evaluated(expression: ca.SX) -> np.ndarray:
    return np.array(ca.Function("f", [Z], [ca.densify(expression)])([0.3, -0.7, 1.1]))


def test_they_are_the_same() -> None:
    lift = IntermediateExpressions()
    lifted, plain = value(lift(LIFTED)), value(LIFTED)
    hessian, slope = lift.hessian(lifted, Z)
    wanted, wanted_slope = ca.hessian(plain, Z)
    np.testing.assert_allclose(evaluated(hessian), evaluated(wanted), rtol=1e-12)
    np.testing.assert_allclose(evaluated(slope), evaluated(wanted_slope), rtol=1e-12)
    np.testing.assert_allclose(
        evaluated(lift.jacobian(lifted, Z)), evaluated(ca.jacobian(plain, Z)), rtol=1e-12
    )
    np.testing.assert_allclose(evaluated(lift.put_back([lifted])[0]), evaluated(plain), rtol=1e-12)


def test_nothing_lifted_is_nothing_special() -> None:
    lift = IntermediateExpressions()
    found = lift.hessian(value(LIFTED), Z)[0]
    np.testing.assert_allclose(evaluated(found), evaluated(ca.hessian(value(LIFTED), Z)[0]))


ROBOT = find_robot("bruce")


@lru_cache(maxsize=1)
def model() -> SymbolicModel:
    return model_of(ROBOT)[0]


def state(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    q, v = rng.uniform(-0.5, 0.5, 16), rng.uniform(-3.0, 3.0, 16)
    q[6:] += ROBOT.standing_position
    return q, v


def test_the_momentum_is_pinocchios() -> None:
    q, v = ca.SX.sym("q", 16), ca.SX.sym("v", 16)
    found = centroidal_momentum(model(), q, v, (0, 1))
    function = ca.Function("momentum", [q, v], list(found))
    dynamics = ExactDynamics(ROBOT)
    for seed in range(3):
        place, rate = state(seed)
        com, linear, angular = (np.array(x).ravel() for x in function(place, rate))
        exact = dynamics.centroidal(pose_of(place), twist_of(place, rate, np.zeros(16))[0])
        np.testing.assert_allclose(com, exact[0], atol=1e-12)
        np.testing.assert_allclose(linear, ROBOT.total_mass * exact[1], atol=1e-11)
        np.testing.assert_allclose(angular, exact[2], atol=1e-11)


@lru_cache(maxsize=1)
def interval() -> tuple[ca.Function, ca.Function]:
    """What finds the accelerations and impulses of an interval, by Newton's method, and its end."""
    q, v, a, r = (ca.SX.sym(name, n) for name, n in (("q", 16), ("v", 16), ("a", 16), ("r", 3)))
    h, lift = ca.SX.sym("h"), IntermediateExpressions()
    found = flight_interval(model(), make_coordinates(model(), "full"), q, v, h, a, r, lift)
    rows, end = lift.put_back([ca.vertcat(*found.rows), ca.vertcat(found.end, found.end_velocity)])
    unknown = ca.vertcat(a[:6], r)
    solve = ca.rootfinder(
        "step", "newton", {"x": unknown, "p": ca.vertcat(q, v, a[6:], h), "g": rows},
        {"abstol": 1e-9},
    )  # fmt: skip
    return solve, ca.Function("end", [q, v, a, r, h], [end])


def step(place: np.ndarray, rate: np.ndarray, bend: np.ndarray, h: float) -> np.ndarray:
    """The state at the interval's end where the rows are zero."""
    solve, ends = interval()
    start = np.concatenate([[0.0, 0.0, -9.81], np.zeros(3), rate[3:6]])
    at = np.array(solve(start, np.concatenate([place, rate, bend, [h]]))).ravel()
    return np.array(ends(place, rate, np.concatenate([at[:6], bend]), at[6:], h)).ravel()


def error(seed: int, intervals: int, duration: float = 0.1) -> tuple[float, float]:
    """Attitude and momentum missed after intervals of one motion of the joints."""
    place, rate = state(seed)
    bend = np.random.default_rng(100 + seed).uniform(-40.0, 40.0, 10)
    ends = []
    for count in (intervals, 64):
        now = np.concatenate([place, rate])
        for _ in range(count):
            now = step(now[:16], now[16:], bend, duration / count)
        ends.append(now)
    dynamics = ExactDynamics(ROBOT)
    first, last = (
        dynamics.centroidal(pose_of(x[:16]), twist_of(x[:16], x[16:], np.zeros(16))[0])
        for x in (np.concatenate([place, rate]), ends[0])
    )
    fallen = first[0] + duration * first[1] - 0.5 * 9.81 * duration**2 * np.array([0.0, 0.0, 1.0])
    kept = max(np.abs(last[2] - first[2]).max(), np.abs(last[0] - fallen).max())
    return float(np.abs(ends[0][3:6] - ends[1][3:6]).max()), float(kept)


@pytest.mark.parametrize("seed", [0, 1])
def test_attitude_is_of_fourth_order_and_momentum_exact(seed: int) -> None:
    (coarse, kept), (fine, _) = error(seed, 2), error(seed, 4)
    assert kept < 2e-4 * 0.1, "gravity's digits only"
    assert fine < coarse / 10.0, "halving the interval divides the error by sixteen"
    assert coarse < 0.01


@pytest.mark.long
def test_a_plan_on_few_knots_is_exact() -> None:
    knots = {"squat": 8, "thrust": 12, "flight": 8, "landing": 10}
    plan = solve_jump(
        make_task({"name": "far", "rise": 0.12, "distance_x": 0.2, "knots": knots}), ROBOT
    )
    figures = check_plan(plan, ROBOT).figures
    assert figures["flight_error_mm"] < 0.05
    assert figures["flight_error_deg"] < 0.02
