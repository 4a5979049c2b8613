#!/bin/sh
# filterpy 2.0.0: after one `predict` of UnscentedKalmanFilter a second `update`, as for two sensors of one tick, does not start from the result of the
# first: the sigma points are still those of the prediction. The same knowledge is counted twice, and the variance becomes negative, without a word.
# `compute_process_sigmas`, which its docstring names for this, also moves the state by another time step, unless dt=0 is given.
# Seen: two measurements of 2 (variance 0.5) on a prediction of 0 (variance 2.1): KalmanFilter 1.787 with variance 0.223; UKF 3.231 with variance
# -1.292; with compute_process_sigmas(dt) 1.327 and -0.725, with compute_process_sigmas(0) as the Kalman filter. All functions are linear, where a UKF is a Kalman filter.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check filterpy==2.0.0 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
from filterpy.kalman import KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

F = np.array([[1.0, 1.0], [0.0, 1.0]])
Q, R, z = 0.1 * np.eye(2), 0.5 * np.eye(1), np.array([2.0])


def linear():
    own = KalmanFilter(2, 1)
    own.x, own.F, own.H, own.Q, own.R = np.zeros(2), F, np.array([[1.0, 0.0]]), Q, R
    return own


def unscented():
    points = MerweScaledSigmaPoints(2, 0.1, 2.0, 1.0)
    move = lambda x, dt: x + dt * np.array([x[1], 0.0])
    own = UnscentedKalmanFilter(2, 1, dt=1.0, hx=lambda x: x[:1], fx=move, points=points)
    own.Q, own.R = Q, R
    return own


def twice(own, between=lambda own: None):
    """Position and its variance after two updates of one tick."""
    own.predict()
    own.update(z)
    between(own)
    own.update(z)
    return float(own.x[0]), float(own.P[0, 0])


found = {
    "KalmanFilter": twice(linear()),
    "UKF": twice(unscented()),
    "UKF, compute_process_sigmas(dt)": twice(unscented(), lambda own: own.compute_process_sigmas(1.0)),
    "UKF, compute_process_sigmas(0)": twice(unscented(), lambda own: own.compute_process_sigmas(0.0)),
}
for name, (place, variance) in found.items():
    print(f"{name}: {place:.3f}, variance {variance:+.3f}")
exact, ukf, moved, still = found.values()
near = lambda a, b: np.allclose(a, b, atol=1e-6)
sys.exit(0 if ukf[1] < -1.0 and not near(moved, exact) and near(still, exact) else 1)
CODE
