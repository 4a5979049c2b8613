#!/bin/sh
# ProxQP of proxsuite 0.8.0: a program whose lower bound lies above its upper bound, as where a controller makes bounds from limits of position and speed that contradict each other, has no
# solution; ProxQP calls it solved. The answer lies between the bounds and breaks both. Constraints that contradict each other
# by two rows are not called solved. PIQP 0.7.0 does not call any of them solved.
# Seen: 1 <= x <= -1 (as a row, as a box): PROXQP_SOLVED, with x = 0; as two rows: PROXQP_MAX_ITER_REACHED. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check proxsuite==0.8.0 piqp==0.7.0 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
import piqp
import proxsuite

P, c, one, inf = np.eye(2), np.array([0.3, -0.2]), np.eye(1, 2), np.inf
full = np.full(2, inf)
CASES = {  # rows, their bounds, bounds of x
    "row": (one, np.array([1.0]), np.array([-1.0]), -full, full),
    "box": (one, np.array([-5.0]), np.array([5.0]), np.array([1.0, -inf]), np.array([-1.0, inf])),
    "two rows": (np.vstack([one, one]), np.array([1.0, -inf]), np.array([inf, -1.0]), -full, full),
}
found = {}
for name, (rows, low, high, least, most) in CASES.items():
    prox = proxsuite.proxqp.dense.QP(2, 0, len(low), True)
    prox.init(P, c, None, None, rows, low, high, least, most)
    prox.solve()
    other = piqp.DenseSolver()
    other.settings.verbose = False
    other.setup(P, c, None, None, rows, low, high, least, most)
    found[name] = prox.results.info.status == proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED, other.solve() == piqp.PIQP_SOLVED
    print(f"1 <= x <= -1 as {name}: ProxQP {prox.results.info.status.name}, x = {prox.results.x[0]:.3f}; PIQP {other.result.info.status.name}")
sys.exit(0 if found == {"row": (True, False), "box": (True, False), "two rows": (False, False)} else 1)
CODE
