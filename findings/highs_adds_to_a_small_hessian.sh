#!/bin/sh
# HiGHS 1.16.0 (highspy, by qpsolvers 4.13.0): its QP solver adds 1e-7 to the diagonal of the Hessian and reports "optimal" for
# the program so changed. Weights of a controller written in small units (m^2, or 1e-8 per squared newton) vanish behind it:
# the answer is P / (P + 1e-7) of the right one. From 1e-9 on entries of the Hessian are dropped as zero: then the answer is a bound.
# Seen: the least of P x^2 / 2 - 3 P x within 1,000 is at 3; told are 3.00, 2.73, 1.5, 0.273 and -1,000 for P = 1e-3, 1e-6, 1e-7, 1e-8
# and 5e-10. The same program times 1e6 is solved rightly.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "highspy==1.16.0" "qpsolvers==4.13.0" "numpy==2.4.6" "scipy==1.17.1"
"$folder/venv/bin/python" - <<'CODE'
import sys

import highspy
import numpy as np
import qpsolvers
from scipy import sparse


def least(weight):
    box = np.array([1000.0])
    problem = qpsolvers.Problem(sparse.csc_matrix([[weight]]), np.array([-3 * weight]), lb=-box, ub=box)
    answer = qpsolvers.solve_problem(problem, solver="highs")
    return bool(answer.found), float(answer.x[0])


weights = (1e-3, 1e-6, 1e-7, 1e-8, 5e-10)
told = {weight: least(weight) for weight in weights}
for weight, (found, place) in told.items():
    print(f"highspy {highspy.Highs().version()}: P = {weight:.0e}: found {found}, at {place:.3f} for 3; times 1e6: {least(weight * 1e6)[1]:.3f}")
shares = all(found and abs(place - 3 * p / (p + 1e-7)) < 1e-3 for p, (found, place) in told.items() if p > 1e-9)
sys.exit(0 if shares and told[5e-10] == (True, -1000.0) and abs(least(5e-10 * 1e6)[1] - 3) < 1e-2 else 1)
CODE
