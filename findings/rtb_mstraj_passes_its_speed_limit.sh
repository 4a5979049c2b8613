#!/bin/sh
# roboticstoolbox-python 1.5.0: `mstraj` with qdmax ("maximum speed") goes faster than that: at its start, its end, and by so much the shorter the acceleration time. The blend from rest has half of
# `tacc` for the whole way that the cruise would have made in it, so it swings above the cruising speed. `tsegment` has the same blends.
# Seen: from 0 over 1 to 2 rad with qdmax=1 rad/s: 1.26 (tacc 0.4 s) to 1.48 rad/s (0.05 s); tacc=0 is the only one that keeps the limit, by a step of the velocity.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check roboticstoolbox-python==1.5.0 numpy==2.4.6 scipy==1.17.1
MPLCONFIGDIR="$folder" "$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import numpy as np
from roboticstoolbox import mstraj

fastest = {}
for tacc in (0.0, 0.05, 0.1, 0.2, 0.4):
    way = mstraj(np.array([[1.0], [2.0]]), dt=0.001, tacc=tacc, qdmax=1.0, q0=[0.0])
    fastest[tacc] = float(np.abs(way.qd).max()), float(np.abs(np.diff(way.q[:, 0])).max() / 0.001)
    print(f"tacc {tacc} s: fastest {fastest[tacc][0]:.3f} rad/s by qd, {fastest[tacc][1]:.3f} rad/s by differences of q")
over = all(max(pair) > 1.2 and min(pair) > 1.2 for tacc, pair in fastest.items() if tacc > 0.0)
sys.exit(0 if over and fastest[0.0][0] <= 1.0 + 1e-9 else 1)
CODE
