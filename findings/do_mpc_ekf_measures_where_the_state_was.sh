#!/bin/sh
# do-mpc 5.1.2: its extended Kalman filter (do_mpc.estimator.EKF) takes the gradient of the measurement at the state before the prediction, and the measurement itself at the predicted one. The filter
# by definition takes both at the predicted state. Where a step changes the gradient (a range past a beacon, an angle, a camera) the gain is that of another place, or has the wrong sign.
# Linear measurements are right, so are those that change little in one step.
# Expected, by the definition in numpy and the exact posterior on a grid: a body at 0 m and 10 m/s, 0.1 s later a range sqrt(1 + x^2) = 1.6 m: x = 1.26 m (1.25 by the grid) with a deviation of 0.14 m.
# Seen: x = 1.00 m with a deviation of 1.00 m: nothing is learnt, for the gradient at 0 m is zero. From -0.3 m (range 1.4 m): 0.14 m in place of 1.00 (0.97 by the grid).
# Exits with 0 while this is so, else with 1.
set -e
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/python" -m pip install -q --disable-pip-version-check do-mpc==5.1.2 casadi==3.8.2 numpy==2.4.6 scipy==1.17.1
MPLCONFIGDIR="$folder" "$folder/env/bin/python" -W ignore - <<'CODE'
import sys

import casadi as ca
import do_mpc
import numpy as np

STEP, SPREAD, NOISE = 0.1, np.diag([1.0, 1e-4]), np.diag([1e-9, 1e-9])


def by_do_mpc(kind, start, linear, measured):
    model = do_mpc.model.Model(kind)
    place, speed, push = model.set_variable("_x", "place"), model.set_variable("_x", "speed"), model.set_variable("_u", "push")
    model.set_rhs("place", place + STEP * speed if kind == "discrete" else speed)
    model.set_rhs("speed", speed + STEP * push if kind == "discrete" else push)
    model.set_meas("seen", place if linear else ca.sqrt(1 + place**2), meas_noise=False)
    model.setup()
    filter_ = do_mpc.estimator.EKF(model)
    filter_.settings.t_step = STEP
    filter_.x0, filter_.P0 = np.reshape(start, (2, 1)), SPREAD.copy()
    filter_.setup()
    filter_.set_initial_guess()
    state = filter_.make_step(np.array([[measured]]), np.zeros((1, 1)), NOISE, np.array([[0.01]]))
    return float(state[0, 0]), float(np.sqrt(filter_.P0[0, 0]))


def by_definition(start, linear, measured):
    step = np.array([[1, STEP], [0, 1]])
    state, spread = step @ start, step @ SPREAD @ step.T + NOISE
    slope = 1.0 if linear else state[0] / np.hypot(1, state[0])
    row = np.array([slope, 0.0])
    gain = spread @ row / (row @ spread @ row + 0.01)
    state = state + gain * (measured - (state[0] if linear else np.hypot(1, state[0])))
    return float(state[0]), float(np.sqrt(((np.eye(2) - np.outer(gain, row)) @ spread)[0, 0]))


def by_grid(start, linear, measured):
    """The likeliest place, by the prior times the likelihood on a fine grid."""
    middle, spread = start[0] + STEP * start[1], 1.0 + STEP**2 * 1e-4
    places = np.linspace(middle - 4, middle + 4, 800001)
    model = places if linear else np.hypot(1, places)
    return float(places[np.argmin((places - middle) ** 2 / spread + (model - measured) ** 2 / 0.01)])


good = bad = True
for start, linear, measured in (((0.0, 10.0), False, 1.6), ((-0.3, 10.0), False, 1.4), ((0.0, 10.0), True, 1.25)):
    right, likely = by_definition(np.array(start), linear, measured), by_grid(start, linear, measured)
    print(f"from {start[0]} m, {'place' if linear else 'range'} {measured} m: the definition {right[0]:.3f} +- {right[1]:.3f} m, the likeliest {likely:.3f} m")
    for kind in ("discrete", "continuous"):
        told = by_do_mpc(kind, start, linear, measured)
        print(f"  do-mpc {do_mpc.__version__}, {kind}: {told[0]:.3f} +- {told[1]:.3f} m")
        if linear:
            good = good and np.allclose(told, right, atol=1e-4)
        else:
            bad = bad and abs(told[0] - likely) > 0.15 and abs(right[0] - likely) < 0.1
sys.exit(0 if good and bad else 1)
CODE
