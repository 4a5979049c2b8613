"""How independent the equations of a jump's problem are."""

import numpy as np
from numpy.typing import NDArray

from aloft.planner.problem.problem import FullProblem
from aloft.planner.problem.program_functions import program_functions


def smallest_singular_value(problem: FullProblem, at: NDArray[np.float64]) -> float:
    """Of the Jacobian of all equations there, each divided by its length; zero: they depend."""
    functions = program_functions(problem.assembly)
    jacobian = np.array(functions["nlp_jac_g"](at, problem.parameters)[1])
    equations = jacobian[problem.row_lower == problem.row_upper]
    sizes = np.linalg.norm(equations, axis=1, keepdims=True)
    return float(np.linalg.svd(equations / sizes, compute_uv=False)[-1])
