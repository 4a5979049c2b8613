#!/bin/sh
# filterpy 2.0.0: CubatureKalmanFilter takes the points of its measurement from before the process noise was added, and does not draw them anew: Q of the step
# is in P, but neither in the gain nor in the innovation's variance. On a linear system, where such a filter is a Kalman filter, it is another one.
# UnscentedKalmanFilter of the same package draws them anew and is right. The filter trusts its model as if it were exact, all the more the larger Q is.
# Seen: prediction variance 0 + Q = 4, measurement 1 with variance 1: Kalman and unscented filter 0.8 with variance 0.8; cubature filter 0 with variance 4.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check filterpy==2.0.0 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
from filterpy.kalman import CubatureKalmanFilter, KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

KNOWN, Q, R, z = 1e-12, 4.0, 1.0, np.array([[1.0]])
stay = lambda x, dt: x
kalman = KalmanFilter(1, 1)
kalman.F = kalman.H = np.eye(1)
unscented = UnscentedKalmanFilter(1, 1, 1.0, hx=lambda x: x, fx=stay, points=MerweScaledSigmaPoints(1, 0.1, 2.0, 2.0))
cubature = CubatureKalmanFilter(1, 1, 1.0, hx=lambda x: x, fx=stay)
found = {}
for name, own in (("Kalman", kalman), ("unscented", unscented), ("cubature", cubature)):
    own.P, own.Q, own.R = KNOWN * np.eye(1), Q * np.eye(1), R * np.eye(1)
    own.predict()
    before = float(np.ravel(own.P)[0])
    own.update(z if name != "unscented" else z[0])
    found[name] = float(np.ravel(own.x)[0]), float(np.ravel(own.P)[0])
    print(f"{name}: variance {before:.3f} before; after the measurement {found[name][0]:.3f}, variance {found[name][1]:.3f}")
near = lambda name, x, P: np.allclose(found[name], (x, P), atol=1e-6)
sys.exit(0 if near("Kalman", 0.8, 0.8) and near("unscented", 0.8, 0.8) and near("cubature", 0.0, 4.0) else 1)
CODE
