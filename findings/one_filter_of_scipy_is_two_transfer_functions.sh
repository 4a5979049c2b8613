#!/bin/sh
# SciPy 1.17.1 and python-control 0.10.2: the coefficients (b, a) that `lfilter` runs are those of powers of 1/z; `control.tf(b, a, dt)`, and SciPy's own `dlti(b, a, dt=dt)`, read them as those of powers of z. Where b and a are of
# one length, as from `butter`, both are one filter. The low-pass y += alpha (x - y), b = [alpha], a = [1, alpha - 1], is a sample later in the second reading, and an average of two samples is half a sample ahead of its input.
# Expected: the filter whose margins are computed is the one that runs. Seen: at 50 Hz of 500 Hz the low-pass (alpha 0.5) turns the phase by -26.3 deg in lfilter and freqz, by -62.3 in control and dlti; the average of
# two by -18 and by +18. A phase margin so computed is 36 deg too small, or too large. Nothing is said. Zeros at the shorter list's end (b = [alpha, 0]) make it one. Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check scipy==1.17.1 control==0.10.2 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import control
import numpy as np
from scipy import signal

RATE, FREQUENCY = 500.0, 50.0  # Hz
FILTERS = {
    "low-pass": ([0.5], [1.0, -0.5]),
    "average of two": ([0.5, 0.5], [1.0]),
    "low-pass, b with a zero": ([0.5, 0.0], [1.0, -0.5]),
    "butter(2, 40)": signal.butter(2, 40.0, fs=RATE),
}


def run(b, a):
    """Phase of the filter as it runs (deg), from its answer to a sine."""
    times = np.arange(5000) / RATE
    answer = signal.lfilter(b, a, np.exp(2j * np.pi * FREQUENCY * times))
    return float(np.degrees(np.angle(answer[-1] / np.exp(2j * np.pi * FREQUENCY * times[-1]))))


def phases(b, a):
    omega = 2 * np.pi * FREQUENCY
    of_freqz = signal.freqz(b, a, worN=[FREQUENCY], fs=RATE)[1][0]
    of_control = control.tf(b, a, 1 / RATE)(np.exp(1j * omega / RATE))
    of_dlti = signal.dfreqresp(signal.dlti(b, a, dt=1 / RATE), w=[omega / RATE])[1][0]
    return [round(run(b, a), 2)] + [round(float(np.degrees(np.angle(each))), 2) for each in (of_freqz, of_control, of_dlti)]


found = {name: phases(*coefficients) for name, coefficients in FILTERS.items()}
for name, (lfilter, freqz, tf, dlti) in found.items():
    print(f"SciPy 1.17.1, {name}: lfilter {lfilter} deg, freqz {freqz}; control.tf 0.10.2 {tf}, dlti {dlti}")
low, average = found["low-pass"], found["average of two"]
same = all(np.ptp(found[name]) < 0.05 for name in ("low-pass, b with a zero", "butter(2, 40)"))
late = np.allclose(low[:2], low[0], atol=0.05) and np.allclose(low[2:], low[0] - 36, atol=0.05)
sys.exit(0 if same and late and np.allclose(average, [-18, -18, 18, 18], atol=0.05) else 1)
CODE
