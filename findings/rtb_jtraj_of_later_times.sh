#!/bin/sh
# roboticstoolbox-python 1.5.0: `jtraj` with a vector of times that does not begin at zero begins in the middle of its motion, and is too slow: the times are divided by the last of them.
# `quintic` and `trapezoidal` of the same module take the same vector from its first time on. A second motion of a plan, or one stamped with the robot's clock, starts with a jump.
# Seen: from 0 to 1 rad over 1 to 3 s: jtraj starts at 0.210 rad with 0.494 rad/s, the others at 0; with a clock of 1000 s the whole motion is the last 0.00000008 rad.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check roboticstoolbox-python==1.5.0 numpy==2.4.6 scipy==1.17.1
MPLCONFIGDIR="$folder" "$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import numpy as np
from roboticstoolbox import jtraj, quintic, trapezoidal

starts = {}
for first in (0.0, 1.0, 1000.0):
    times = first + np.linspace(0.0, 2.0, 201)
    joint, five, trapeze = jtraj([0.0], [1.0], times), quintic(0.0, 1.0, times), trapezoidal(0.0, 1.0, times)
    starts[first] = float(joint.q[0, 0])
    print(f"{first:.0f} to {first + 2:.0f} s: jtraj from {joint.q[0, 0]:.8f} at {joint.qd[0, 0]:.3f} rad/s to {joint.q[-1, 0]:.3f};", end=" ")
    print(f"quintic from {five.q[0]:.3f}, trapezoidal from {trapeze.q[0]:.3f}")
    assert abs(five.q[0]) < 1e-9 and abs(trapeze.q[0]) < 1e-9
sys.exit(0 if starts[0.0] == 0.0 and starts[1.0] > 0.2 and starts[1000.0] > 0.999 else 1)
CODE
