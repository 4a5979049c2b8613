#!/bin/sh
# filterpy 2.0.0 has two `rts_smoother`: the method of KalmanFilter takes Fs[k] and Qs[k] as those that led to sample k, as `batch_filter` does; the function of
# the module takes them as those that lead from it to the next. With one F for all they agree; with steps that vary, as in a log with gaps, the function
# gives other states for the lists that its own `batch_filter` was given, and says nothing.
# Seen: steps of 0.05 s and 0.5 s in turn: rms error of the velocity 0.131 m/s filtered, 0.079 m/s by the method, 0.367 m/s by the function.
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check filterpy==2.0.0 numpy==2.4.6 scipy==1.17.1
"$folder/env/bin/python" - <<'CODE'
import sys

import numpy as np
from filterpy.kalman import KalmanFilter, batch_filter, rts_smoother

random = np.random.default_rng(0)
count = 400
steps = np.where(np.arange(count) % 2, 0.5, 0.05)
Fs = [np.array([[1.0, dt], [0.0, 1.0]]) for dt in steps]
Qs = [0.05 * np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]]) for dt in steps]
H, R = np.array([[1.0, 0.0]]), np.array([[0.0025]])
x, truth, zs = np.zeros((2, 1)), [], []
for F, Q in zip(Fs, Qs):
    x = F @ x + np.linalg.cholesky(Q) @ random.normal(size=(2, 1))
    truth.append(x)
    zs.append(x[:1] + np.sqrt(R) * random.normal())
truth = np.array(truth)
rms = lambda states: float(np.sqrt(np.mean((states - truth)[:, 1, 0] ** 2)))

own = KalmanFilter(2, 1)
own.H, own.R = H, R
means, covariances, _, _ = own.batch_filter(zs, Fs=Fs, Qs=Qs)
same, _, _, _ = batch_filter(np.zeros((2, 1)), np.eye(2), zs, Fs, Qs, [H] * count, [R] * count)
assert np.allclose(means, same)  # the two filters agree
filtered = rms(means)
method = rms(own.rts_smoother(means, covariances, Fs=Fs, Qs=Qs)[0])
function = rms(rts_smoother(means, covariances, Fs, Qs)[0])
moved = rms(rts_smoother(means, covariances, Fs[1:] + Fs[-1:], Qs[1:] + Qs[-1:])[0])
print(f"velocity, rms error [m/s]: filtered {filtered:.3f}; method {method:.3f}; function {function:.3f}, with its lists moved by one {moved:.3f}")
sys.exit(0 if abs(moved - method) < 1e-9 and method < filtered < function else 1)
CODE
