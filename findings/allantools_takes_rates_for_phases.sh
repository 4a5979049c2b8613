#!/bin/sh
# AllanTools 2024.6: its Allan deviations take the series for phases (an angle, seconds of a clock) unless data_type="freq" is given, though `rate=` is given with it. A gyroscope's log is of rates: `oadev(gyro, rate=200)` differentiates
# it once more, says nothing, and gives a curve that looks like one of an inertial sensor.
# Expected: white noise of 0.005 deg/s/sqrt(Hz) has 0.005 at 1 s and falls with the root of the time. Seen: 0.122 at 1 s, 24 times the angle random walk, falling with the time (as quantisation noise does); the bias
# instability at the foot of the curve is lost. With data_type="freq" 0.005. An own deviation of averages over 1 s is the judge. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check allantools==2024.6 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import allantools
import numpy as np

RATE, WALK, SECONDS = 200, 0.005, 3600  # Hz, deg/s/sqrt(Hz), s
gyro = np.random.default_rng(0).normal(0.0, WALK * np.sqrt(RATE), RATE * SECONDS)  # deg/s
times = [0.1, 1.0, 10.0]
found = {name: allantools.oadev(gyro, rate=RATE, taus=times, **settings)[1] for name, settings in {"as it is": {}, "freq": {"data_type": "freq"}}.items()}
averages = gyro.reshape(SECONDS, RATE).mean(axis=1)
own = float(np.sqrt(0.5 * np.mean(np.diff(averages) ** 2)))
for name, deviations in found.items():
    slope = np.log10(deviations[2] / deviations[0]) / 2
    print(f"AllanTools 2024.6, {name}: {np.round(deviations, 5)} at {times} s, slope {slope:.2f}; own at 1 s {own:.5f}")
wrong, right = found["as it is"], found["freq"]
sys.exit(0 if 20 < wrong[1] / WALK < 28 and abs(right[1] / own - 1) < 0.05 and wrong[0] / wrong[2] > 80 else 1)
CODE
