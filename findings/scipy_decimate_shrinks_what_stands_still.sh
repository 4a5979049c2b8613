#!/bin/sh
# SciPy 1.17.1: `scipy.signal.decimate` with its defaults multiplies a constant with 0.98855. Its filter (Chebyshev of order 8) has the top of its ripple above zero frequency, and runs forth and back. `resample_poly` keeps the
# constant in the middle, but takes the log for zero before its first and after its last sample: a quarter is missing from the first, and waves of percents follow.
# Expected: a log of half the rate has the same mean. Seen: an accelerometer at rest reads 9.698 m/s^2 in place of 9.81, a height of 500 m is 494.3 m; by resample_poly its first samples
# are 7.36, 10.47, 9.47. Nothing in the numbers shows it where the signal moves. resample_poly(padtype="line") keeps 9.81 throughout, decimate(ftype="fir") in the middle.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check scipy==1.17.1 numpy==2.4.6
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
from scipy.signal import decimate, resample_poly

rest = np.full(400, 9.81)  # m/s^2
noisy = rest + np.random.default_rng(0).normal(0.0, 0.05, 400)
rows = {
    "decimate(2)": decimate(rest, 2),
    "decimate(4)": decimate(rest, 4),
    "decimate(2, ftype='fir')": decimate(rest, 2, ftype="fir"),
    "resample_poly(1, 2)": resample_poly(rest, 1, 2),
    "resample_poly(1, 2, padtype='line')": resample_poly(rest, 1, 2, padtype="line"),
}
for name, row in rows.items():
    print(f"SciPy 1.17.1, {name} of 9.81: first {np.round(row[:3], 3)}, in the middle {row[len(row) // 2]:.3f}, last {row[-1]:.3f}")
print(f"noisy: mean {noisy.mean():.3f}, mean of every second by decimate {decimate(noisy, 2).mean():.3f}")
middle = {name: float(row[len(row) // 2]) for name, row in rows.items()}
low = all(np.allclose(rows[name], 9.81 * 10 ** (-0.1 / 20), atol=0.01) for name in ("decimate(2)", "decimate(4)"))
kept = all(abs(middle[name] - 9.81) < 1e-6 for name in list(rows)[2:]) and np.allclose(rows["resample_poly(1, 2, padtype='line')"], 9.81)
sys.exit(0 if low and kept and np.allclose(rows["resample_poly(1, 2)"][:3], [7.359, 10.466, 9.476], atol=0.01) else 1)
CODE
