"""Derivatives by way of lifted expressions are those of the whole."""

import casadi as ca
import numpy as np

from aloft.planner.problem.lifted import Lifted

Z = ca.SX.sym("z", 3)
LIFTED = ca.vertcat(Z[0] * Z[1], Z[2] ** 2 + Z[0])


def value(inner: ca.SX) -> ca.SX:
    return ca.sin(inner[0]) * inner[1] ** 2 + Z[1] * inner[0] + ca.exp(Z[0])


def evaluated(expression: ca.SX) -> np.ndarray:
    return np.array(ca.Function("f", [Z], [ca.densify(expression)])([0.3, -0.7, 1.1]))


def test_they_are_the_same() -> None:
    lift = Lifted()
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
    lift = Lifted()
    found = lift.hessian(value(LIFTED), Z)[0]
    np.testing.assert_allclose(evaluated(found), evaluated(ca.hessian(value(LIFTED), Z)[0]))
