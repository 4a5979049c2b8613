#!/bin/sh
# OSQP 1.1.3: `warm_starting=False` does not make a solve a function of the program. The step size rho that one solve has
# adapted stays for the next, so the same program, solved twice by one solver from zero, takes other iterations and ends in
# another point. Only a new `setup` begins anew. Who restarts a controller from a snapshot does not get the same torques.
# Seen: 675 iterations, then 500 and 500, and two different answers; new solvers give one. Exits non-zero if that changes.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" -q install osqp==1.1.3 numpy==2.2.6 scipy==1.15.3
"$folder/venv/bin/python" - <<'P'
import numpy as np, osqp
from scipy import sparse

random = np.random.default_rng(1)
n, equations, rows = 60, 20, 140
root = random.normal(size=(n, n)) * 10.0 ** random.uniform(-1, 1, n)
square = sparse.csc_matrix(np.triu(root @ root.T + 1e-3 * np.eye(n)))
dense = random.normal(size=(rows, n)) * 10.0 ** random.uniform(-1, 1, (rows, 1))
slack = np.concatenate([np.zeros(equations), random.uniform(0, 0.5, rows - equations)])
upper = dense @ random.normal(size=n) + slack
lower = np.concatenate([upper[:equations], np.full(rows - equations, -np.inf)])
gradient = random.normal(size=n) * 10


def new():
    solver = osqp.OSQP()
    solver.setup(
        square, gradient, sparse.csc_matrix(dense), lower, upper,
        verbose=False, eps_abs=1e-8, eps_rel=1e-8, max_iter=50_000, warm_starting=False,
    )
    return solver


def told(solver):
    answer = solver.solve()
    assert answer.info.status == "solved", answer.info.status
    return answer.info.iter, answer.x.tobytes()


solver = new()
one = [told(solver) for _ in range(3)]
each = [told(new()) for _ in range(3)]
print(f"osqp {osqp.__version__}: one solver, from zero each time: {[i for i, _ in one]} iterations, "
      f"{len({x for _, x in one})} answers; a new solver each time: {[i for i, _ in each]}, {len({x for _, x in each})}")
raise SystemExit(0 if len({x for _, x in one}) > 1 and len({x for _, x in each}) == 1 else 1)
P
