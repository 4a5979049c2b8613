#!/bin/sh
# filterpy 2.0.0: `update(None)` is a tick without a measurement: "nothing is changed". In a bank of filters the probabilities change: MMAEFilterBank and IMMEstimator
# multiply them with the likelihood that each filter gives a residual of zero under its last variance. So a sensor that is silent speaks for the quietest model, tick by tick:
# the bank is sure of it when the sensor comes back, and MMAEFilterBank, whose probability of the other model is then zero, never leaves it.
# Seen: two models of equal probability; after 3000 ticks without a measurement MMAE has (1, 0) and stays there for 50 measurements of a manoeuvre that the second
# model fits; the IMM's go from (0.5, 0.5) to (0.977, 0.023), where its transition matrix alone keeps them.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check filterpy==2.0.0 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
from filterpy.kalman import IMMEstimator, KalmanFilter, MMAEFilterBank


def model(noise):
    own = KalmanFilter(1, 1)
    own.F = own.H = own.R = np.eye(1)
    own.Q = noise * np.eye(1)
    return own


def settled():
    """The two models after measurements that have told their variances, and no more."""
    quiet, lively = model(0.01), model(4.0)
    for own in (quiet, lively):
        for _ in range(50):
            own.predict()
            own.update(np.zeros((1, 1)))
        own.x = np.zeros((1, 1))
    return [quiet, lively]


bank = MMAEFilterBank(settled(), [0.5, 0.5], 1, H=np.eye(1))
imm = IMMEstimator(settled(), [0.5, 0.5], np.array([[0.97, 0.03], [0.03, 0.97]]))
for tick in range(3000):
    for own in (bank, imm):
        own.predict()
        own.update(None)
    if tick in (0, 9, 99, 2999):
        print(f"{tick + 1} ticks without a measurement: MMAE {np.round(bank.p, 3)}, IMM {np.round(imm.mu, 3)}")
silent = bank.p.copy()
for own in bank.filters:  # what they believe of the place is as before the silence
    own.x, own.P = np.zeros((1, 1)), np.eye(1)
for tick in range(50):
    bank.predict()
    bank.update(np.array([[8.0 * (-1.0) ** tick]]))
fresh = MMAEFilterBank(settled(), [0.5, 0.5], 1, H=np.eye(1))
for tick in range(50):
    fresh.predict()
    fresh.update(np.array([[8.0 * (-1.0) ** tick]]))
print(f"50 measurements of a manoeuvre later: {np.round(bank.p, 3)}; without the silence {np.round(fresh.p, 3)}")
sys.exit(0 if silent[1] == 0.0 and bank.p[1] == 0.0 and fresh.p[1] > 0.99 and imm.mu[0] > 0.7 else 1)
CODE
