"""The functions of a whole problem as CasADi's solvers call them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...mathematics.arrays import Array
from ..models.python_function import Compute, python_function
from .assembly import Assembly
from .program_values import ProgramValues


def program_functions(assembly: Assembly, *, upper: bool = True) -> dict[str, Any]:
    """Return ``f``, ``g`` (symbols and expressions in a dict for nlpsol) and the functions ``nlp_f``, ``nlp_g``,
    ``nlp_grad_f``, ``nlp_jac_g``, ``nlp_hess_l`` with the signatures nlpsol's own would have; with ``upper`` also
    ``hess_lag``, the upper triangle of the Hessian alone.

    An expression of them is good as long as the dict is kept.
    """
    import casadi as ca

    own = ProgramValues(assembly)
    n, m, parameters = assembly.variables, assembly.constraints, assembly.parameters
    one, slope, rows = (ca.Sparsity.dense(size) for size in (1, n, m))
    jacobian = ca.Sparsity(m, n, own.starts.tolist(), own.rows.tolist())
    given = {"x": slope, "p": ca.Sparsity.dense(parameters)}
    of_lagrangian = {**given, "lam_f": one, "lam_g": rows}

    seen = np.full(n, np.nan), np.zeros(parameters)

    def evaluate(values: Sequence[Array]) -> None:
        """Compute cost and rows, which solvers ask for one after the other, unless that was done there last."""
        if not all(map(np.array_equal, seen, values)):
            own.evaluate(*values)
            for kept, new in zip(seen, values, strict=True):
                kept[:] = new

    def cost(values: Sequence[Array]) -> Sequence[Array]:
        evaluate(values)
        return (own.cost(),)

    def constraints(values: Sequence[Array]) -> Sequence[Array]:
        evaluate(values)
        return (own.values,)

    def gradient(values: Sequence[Array]) -> Sequence[Array]:
        return (own.gradient(*values),)

    def cost_and_gradient(values: Sequence[Array]) -> Sequence[Array]:
        return *cost(values), *gradient(values)

    def derivatives(values: Sequence[Array]) -> Sequence[Array]:
        evaluate(values)
        own.jacobian(*values)
        return own.values, own.entries

    def result(values: Sequence[Array]) -> Sequence[Array]:
        """Return what nlpsol evaluates once when a solver has ended; nobody reads its gradients."""
        return *cost(values[:2]), own.values, np.zeros(n), np.zeros(parameters)

    def hessian(upper: bool) -> tuple[Any, Compute]:
        pattern, first, further = assembly.hessian_pattern(upper)

        def compute(values: Sequence[Array]) -> Sequence[Array]:
            of_pieces = own.hessian(*values)
            entries = of_pieces[first]
            for places, sources in further:
                entries[places] += of_pieces[sources]
            return (entries,) if upper else (own.slope(values[3]), entries)

        return pattern, compute

    pattern, of_whole = hessian(upper=False)
    found = {
        "nlp_f": python_function("nlp_f", given, {"f": one}, cost),
        "nlp_g": python_function("nlp_g", given, {"g": rows}, constraints),
        "nlp_grad_f": python_function("nlp_grad_f", given, {"grad_f_x": slope}, gradient),
        "grad_f": python_function(
            "nlp_grad_f", given, {"f": one, "grad_f_x": slope}, cost_and_gradient
        ),
        "nlp_jac_g": python_function(
            "nlp_jac_g", given, {"g": rows, "jac_g_x": jacobian}, derivatives
        ),
        "nlp_hess_l": python_function(
            "nlp_hess_l", of_lagrangian, {"grad_gamma_x": slope, "hess_gamma_x_x": pattern}, of_whole
        ),
        "nlp_grad": python_function(
            "nlp_grad", of_lagrangian,
            {"f": one, "g": rows, "grad_gamma_x": slope, "grad_gamma_p": given["p"]}, result,
        ),
    }  # fmt: skip
    if upper:
        pattern, of_triangle = hessian(upper=True)
        found["hess_lag"] = python_function(
            "nlp_hess_l", of_lagrangian, {"triu_hess_gamma_x_x": pattern}, of_triangle
        )
    x, p = ca.MX.sym("x", n), ca.MX.sym("p", parameters)
    return {**found, "x": x, "p": p, "f": found["nlp_f"](x, p), "g": found["nlp_g"](x, p)}
