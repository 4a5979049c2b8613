#!/bin/sh
# Numba 0.68.1: np.linalg.norm of a vector that is taken from its end, such as x[::-1], is wrong without a word in compiled code. The
# stride goes to BLAS as it is, and its norm of a negative stride is not that of the same elements. Steps forward (x[::2]) are right.
# Seen: x = [1, 2, 3, 4, 12]: norm(x) 13.1909, norm(x[::-1]) 12.0 where NumPy has 13.1909.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" numba==0.68.1 scipy==1.17.0 numpy==2.4.6
PYTHONPATH="$folder" python3 -W ignore - <<'CODE'
import sys

import numba
import numpy as np


@numba.njit
def norms(x):
    return np.linalg.norm(x), np.linalg.norm(x[::-1]), np.linalg.norm(x[::2])


x = np.array([1.0, 2.0, 3.0, 4.0, 12.0])
found, expected = norms(x), norms.py_func(x)
print(f"Numba {numba.__version__}: x, x[::-1], x[::2]: {np.round(found, 4)}, NumPy: {np.round(expected, 4)}")
right = [bool(np.isclose(a, b)) for a, b in zip(found, expected)]
sys.exit(right != [True, False, True])
CODE
