#!/bin/sh
# CasADi 3.8.2: an `interpolant` of the kind "bspline" is zero outside of its grid, with a derivative of zero, and says nothing. The
# kind "linear" continues its last piece. A torque that a motor's map gives at 3 rad/s is gone at 3.0001 rad/s, and an optimiser that steps
# out of the grid sees a flat zero that does not lead it back. Clamp the argument, or make the grid wider than what can occur.
# Seen: v^2 on a grid of 0 to 3: at 3, 3.0001 and 4: bspline 9, 0, 0; linear 9, 9.00055, 14.5. A map of two arguments is zero as soon as one is outside.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "casadi==3.8.2" "numpy==2.4.6"
"$folder/venv/bin/python" - <<'CODE'
import sys

import casadi as ca
import numpy as np

grid = np.linspace(0, 3, 7)
table = np.add.outer(grid**2, 10 + grid**2).ravel(order="F")
told = {}
for kind in ("bspline", "linear"):
    map_, x = ca.interpolant("map", kind, [grid], grid**2), ca.MX.sym("x")
    slope = ca.Function("slope", [x], [ca.jacobian(map_(x), x)])
    plane = ca.interpolant("plane", kind, [grid, grid], table)
    told[kind] = [float(map_(at)) for at in (3.0, 3.0001, 4.0)] + [float(slope(4.0)), float(plane([1.0, 3.0001]))]
    print(f"casadi 3.8.2: {kind}: at 3, 3.0001, 4: {np.round(told[kind][:3], 5)}, slope at 4 {told[kind][3]}, map at (1, 3.0001) {told[kind][4]:.4g}")
spline, line = told["bspline"], told["linear"]
sys.exit(0 if abs(spline[0] - 9) < 1e-9 and not any(spline[1:]) and min(line) > 5 else 1)
CODE
