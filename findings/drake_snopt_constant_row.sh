#!/bin/sh
# Drake 1.51.1, SNOPT: a constraint with a row that does not depend on the variables, as one of several rows of a function
# may, is solved; declare its true gradient sparsity (`SetGradientSparsityPattern`, which has no entry for that row) to make
# it faster, and the same feasible program is called infeasible, with the guess returned as it was. So sparsity is no mere
# hint: rows without entries have to be left out. Seen: success and info 1 without the pattern, failure and info 14 with it.
# Exits non-zero if that changes.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" -q install drake==1.51.1 numpy==2.2.6
"$folder/venv/bin/python" - <<'P'
import numpy as np
from pydrake.solvers import MathematicalProgram, SnoptSolver


def rows(x):
    return np.array([x[0] + x[1], 0 * x[0] + 1.0])


def solve(with_pattern):
    program = MathematicalProgram()
    x = program.NewContinuousVariables(2)
    binding = program.AddConstraint(rows, np.ones(2), np.ones(2), x)
    if with_pattern:
        binding.evaluator().SetGradientSparsityPattern([(0, 0), (0, 1)])
    program.AddCost(x[0] ** 2 + x[1] ** 2)
    answer = SnoptSolver().Solve(program, np.array([0.3, 0.2]))
    found = np.round(answer.GetSolution(x), 4).tolist()
    print(f"sparsity declared: {with_pattern}; success {answer.is_success()}, "
          f"info {answer.get_solver_details().info}, x = {found}")
    return answer.is_success()


without, with_pattern = solve(False), solve(True)
raise SystemExit(0 if without and not with_pattern else 1)
P
