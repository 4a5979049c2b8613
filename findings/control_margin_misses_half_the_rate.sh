#!/bin/sh
# python-control 0.10.2: `margin` and `stability_margins` of a sampled loop miss the gain limit at half the sampling rate, where every
# sampled loop is real: crossings are kept only where their angle is below pi. A loop that half a percent more gain makes unstable
# is said to have an infinite gain margin. The closed loop's poles tell the truth.
# Seen: L(z) = K T/(z - 1) with K T = 1.99 and 1.5: gain margin inf, no warning of it; its only pole 1 - K T leaves the unit circle
# at 2/(K T) = 1.005 and 1.333 times the gain.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m pip install -q --disable-pip-version-check --target "$folder" control==0.10.2 numpy==2.4.6 scipy==1.17.1
PYTHONPATH="$folder" python3 -W ignore - <<'CODE'
import sys

import control
import numpy as np

PERIOD = 0.01
missed = 0
for gain in (1.99, 1.5):
    loop = control.tf([gain], [1, -1], PERIOD)
    found = float(control.margin(loop)[0])
    more, less = (np.abs(control.feedback(control.tf([k * gain], [1, -1], PERIOD)).poles()).max()
                  for k in (2.0 / gain * 1.001, 2.0 / gain * 0.999))
    print(f"control 0.10.2: K T = {gain}: margin {found}; closed loop's pole {less:.4f} at {1.998 / gain:.4f} times the gain, "
          f"{more:.4f} at {2.002 / gain:.4f} times")
    missed += found == np.inf and less < 1.0 < more
sys.exit(0 if missed == 2 else 1)
CODE
