#!/bin/sh
# python-control 0.10.2: `step_info(y, T)` of a measured response takes every step for one from zero. Where the log begins elsewhere (a leg's length from 0.5 to 0.6 m, a heading from 90 to 100 deg) overshoot, rise and
# settling are shares of the final value, not of the step: the regulator looks better the farther from zero it works. There is no argument for the initial value, and nothing is said.
# Expected: the figures of a response do not change when a constant is added to it. Seen: the same second-order response (overshoot 37%, settled after 7.0 s): as 0 to 1 right; as 5 to 6 overshoot 6%, settled
# after 4.5 s, as 50 to 51 overshoot 0.7%, settled after 0. `step_info(y - y[0], T)` is right. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check control==0.10.2 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import control
import numpy as np

times = np.linspace(0.0, 30.0, 6001)
damping, omega = 0.3, 1.6  # of 1, rad/s
damped = omega * np.sqrt(1 - damping**2)
step = 1 - np.exp(-damping * omega * times) * (np.cos(damped * times) + damping * omega / damped * np.sin(damped * times))
found = {}
for begin in (0.0, 5.0, 50.0):
    info = control.step_info(begin + step, times)
    found[begin] = info["Overshoot"], info["SettlingTime"], info["RiseTime"]
    print(f"python-control 0.10.2, {begin:g} to {begin + 1:g}: overshoot {found[begin][0]:.1f}%, settled after {found[begin][1]:.2f} s, rise time {found[begin][2]:.2f} s")
again = control.step_info(50.0 + step - 50.0, times)
true = 100 * float(step.max() - 1)  # percent of the step, which is 1
settled = float(times[np.flatnonzero(np.abs(step - step[-1]) > 0.02)[-1]])
print(f"own: overshoot {true:.1f}%, settled after {settled:.2f} s")
right = abs(found[0.0][0] - true) < 0.1 and abs(found[0.0][1] - settled) < 0.05 and abs(again["Overshoot"] - true) < 0.1
sys.exit(0 if right and abs(found[5.0][0] - true / 6) < 0.1 and abs(found[50.0][0] - true / 51) < 0.05 and found[50.0][1] < 1.0 and abs(found[5.0][1] - 4.46) < 0.1 else 1)
CODE
