#!/bin/sh
# pykalman 0.11.2: a measurement that is missing is masked (numpy.ma). Where one entry of a sample is masked, the whole sample is left out, those that are there, too: a robot whose GNSS comes at
# 1 Hz beside an odometer at 10 Hz, in one array with masks for the ticks without GNSS, loses nine of ten samples of its odometer.
# Expected: the entries that are there correct the state, as masks of single entries promise. Seen: with a second sensor that never speaks the state is the initial one to the last sample, after 60 samples
# of a good first sensor; with that sensor alone it is right. The mask has the full shape (samples, sensors), and nothing is said. An own filter that drops rows of the masked sensor is right.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check pykalman==0.11.2 numpy==2.4.6
"$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import numpy as np
from pykalman import KalmanFilter

SAMPLES, STEP = 60, 0.1
F, Q, START, VARIANCE = np.array([[1.0, STEP], [0.0, 1.0]]), 1e-4 * np.eye(2), np.zeros(2), 4.0 * np.eye(2)
H, R = np.array([[0.0, 1.0], [1.0, 0.0]]), np.diag([0.01, 1.0])  # an odometer's speed, a receiver's position
speeds = 1.0 + 0.1 * np.random.default_rng(0).normal(size=SAMPLES)


def filtered(rows, measured):
    kalman = KalmanFilter(F, H[rows], Q, R[np.ix_(rows, rows)], initial_state_mean=START, initial_state_covariance=VARIANCE)
    return kalman.filter(measured)[0][-1]


def own(mask):
    """A Kalman filter that takes those rows of each sample that are there."""
    state, variance = START, VARIANCE
    for k in range(SAMPLES):
        if k:
            state, variance = F @ state, F @ variance @ F.T + Q
        there = ~mask[k]
        rows, measured = H[there], both[k][there]
        gain = variance @ rows.T @ np.linalg.inv(rows @ variance @ rows.T + R[np.ix_(there, there)])
        state, variance = state + gain @ (measured - rows @ state), variance - gain @ rows @ variance
    return state


both = np.column_stack((speeds, STEP * np.arange(SAMPLES)))
never, some = np.zeros((2, SAMPLES, 2), bool)
never[:, 1] = True  # the receiver never speaks
some[:, 1] = np.arange(SAMPLES) % 10 != 0  # it speaks at every tenth tick
alone = filtered([0], speeds[:, None])
silent = filtered([0, 1], np.ma.array(both, mask=never))
print(f"pykalman 0.11.2, position and speed after {SAMPLES} samples: odometer alone {alone.round(3)}, own {own(never).round(3)}; with a masked receiver {silent.round(3)}")
tenth = filtered([0, 1], np.ma.array(both, mask=some))
only = np.ma.array(both, mask=np.repeat(some[:, 1:], 2, axis=1))
print(f"with a receiver at every tenth tick {tenth.round(3)}, own {own(some).round(3)}; with the odometer masked at the other nine, too, {filtered([0, 1], only).round(3)}")
same = np.array_equal(tenth, filtered([0, 1], only))
sys.exit(0 if np.allclose(alone, own(never)) and abs(alone[1] - 1) < 0.05 and np.array_equal(silent, START) and same and not np.allclose(tenth, own(some), atol=1e-3) else 1)
CODE
